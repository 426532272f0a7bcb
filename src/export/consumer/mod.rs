//! Parameter files for other programs, each in its own convention. One file per consumer.
//!
//! Sources: the consumers' own code and documentation, named in each file. Every file begins with at most ten lines
//! of comment: where the numbers come from, what the consumer does with them, the rule for the walk and its price,
//! the inflation. The numbers follow, then the details.

mod ardupilot;
mod filters;
mod gazebo;
mod gnss_ins_sim;
mod gtsam;
mod kalibr;
mod matlab;
mod navego;
mod numbers;
mod openvins;
mod orbslam3;
mod page;
mod px4;
mod vins;
mod walk;

pub use filters::Aiding;
pub use numbers::{Choice, GaussMarkov, Number, Numbers, Sensor, Walk};

use crate::params::Params;
use crate::units::{Quantity, digits};
use numbers::Settings;
use page::Page;

/// A program that takes noise parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Target {
    Kalibr,
    OpenVins,
    Vins,
    OrbSlam3,
    Gtsam,
    Px4,
    ArduPilot,
    Matlab,
    GnssInsSim,
    NaveGo,
    Gazebo,
}

/// Everything that a file is made of.
#[derive(Clone, Debug)]
pub struct Export {
    pub target: Target,
    pub gyro: Option<Sensor>,
    pub accelerometer: Option<Sensor>,
    /// Rate of the log, or of the consumer's steps, Hz; `None`: the consumer's default, or that of the parameters.
    pub rate_hz: Option<f64>,
    /// Of the parameters.
    pub sample_rate_hz: f64,
    /// Factor on every white density and every drift; 1 is none.
    pub inflation: f64,
    /// What the logs behind the parameters have failed; see [`crate::params::Source::failed`].
    pub failed: Vec<String>,
    /// All parameters were identified from logs.
    pub from_log: bool,
    /// Lines about the factors that the white noise of the parameters has in it already.
    pub measured_inflation: Vec<String>,
    pub choice: Choice,
    pub walk: Walk,
    /// Where no drift was found the file says zero.
    pub allow_zero_walk: bool,
    /// Lines about the origin, for the comment block.
    pub origin: Vec<String>,
}

/// A text file for a consumer, with what a person must be told.
#[derive(Clone, Debug, PartialEq)]
pub struct Written {
    pub text: String,
    pub warnings: Vec<String>,
}

/// The file. Errors: a sensor that the consumer needs is not there, does not fit its form, or has no drift and no
/// limit of one.
pub fn write(export: &Export) -> Result<Written, String> {
    let mut page = Page::new(export.axes().filter_map(Numbers::note).collect());
    match export.target {
        Target::Kalibr => kalibr::write(export, &mut page),
        Target::OpenVins => openvins::write(export, &mut page),
        Target::Vins => vins::write(export, &mut page),
        Target::OrbSlam3 => orbslam3::write(export, &mut page),
        Target::Gtsam => gtsam::write(export, &mut page),
        Target::Px4 => px4::write(export, &mut page),
        Target::ArduPilot => ardupilot::write(export, &mut page),
        Target::Matlab => matlab::write(export, &mut page),
        Target::GnssInsSim => gnss_ins_sim::write(export, &mut page),
        Target::NaveGo => navego::write(export, &mut page),
        Target::Gazebo => gazebo::write(export, &mut page),
    }?;
    Ok(page.finish(export))
}

impl Export {
    /// A sensor of the unit. Errors: see [`Sensor`]; a second one of its kind.
    pub fn add(&mut self, params: &Params) -> Result<(), String> {
        self.sample_rate_hz = if self.sample_rate_hz > 0.0 { self.sample_rate_hz } else { params.sample_rate_hz };
        let own = self.target.own_step().unwrap_or(1.0 / params.sample_rate_hz);
        let settings = Settings {
            step: self.rate_hz.map_or(own, |rate| 1.0 / rate),
            aiding: self.target.aiding(params.quantity),
            rule: self.walk,
            inflation: self.inflation,
        };
        let sensor = Sensor::new(params, &settings)?;
        let slot = match params.quantity {
            Quantity::AngularRate => &mut self.gyro,
            Quantity::SpecificForce => &mut self.accelerometer,
        };
        if slot.is_some() {
            return Err(format!("both files are of a {}", params.quantity.name()));
        }
        *slot = Some(sensor);
        Ok(())
    }

    fn rate(&self) -> f64 {
        self.rate_hz.unwrap_or(self.sample_rate_hz)
    }

    /// s from one step of the consumer's filter to the next.
    fn step(&self) -> f64 {
        let own = self.target.own_step().unwrap_or(1.0 / self.sample_rate_hz);
        self.rate_hz.map_or(own, |rate| 1.0 / rate)
    }

    /// N of one kind of sensor, one for three axes, inflated; `None` when it is not there.
    fn white(&self, quantity: Quantity) -> Result<Option<f64>, String> {
        let Some(sensor) = self.sensor(quantity) else { return Ok(None) };
        Ok(sensor.one(&self.choice, |n| Some(n.white.value))?.map(|n| n * self.inflation))
    }

    /// Spread of the bias between power-ups, not inflated.
    fn turn_on(&self, quantity: Quantity) -> Result<Option<f64>, String> {
        self.sensor(quantity).map_or(Ok(None), |sensor| sensor.one(&self.choice, |n| n.turn_on))
    }

    fn sensor(&self, quantity: Quantity) -> Option<&Sensor> {
        match quantity {
            Quantity::AngularRate => self.gyro.as_ref(),
            Quantity::SpecificForce => self.accelerometer.as_ref(),
        }
    }

    fn sensors(&self) -> impl Iterator<Item = &Sensor> {
        self.gyro.iter().chain(&self.accelerometer)
    }

    fn axes(&self) -> impl Iterator<Item = &Numbers> {
        self.sensors().flat_map(|sensor| &sensor.axes)
    }

    /// About one number for several axes.
    fn choice_words(&self) -> String {
        match &self.choice {
            Choice::Worst if self.walk == Walk::Least => {
                "one number for all axes: the largest, and the walk that costs least where it is dearest".into()
            }
            Choice::Worst => "one number for all axes: the largest".into(),
            Choice::Mean => "one number for all axes: the root mean square".into(),
            Choice::Axis(name) => format!("one number for all axes: that of {name}"),
        }
    }
}

/// "the gyro" in sentences.
fn device(quantity: Quantity) -> &'static str {
    match quantity {
        Quantity::AngularRate => "gyro",
        Quantity::SpecificForce => "accelerometer",
    }
}

/// Of K.
fn walk_unit(quantity: Quantity) -> &'static str {
    match quantity {
        Quantity::AngularRate => "rad/s^2/sqrt(Hz)",
        Quantity::SpecificForce => "m/s^3/sqrt(Hz)",
    }
}

/// Nine significant digits with a decimal point and an exponent: every reader takes it for a real number.
fn exponent(value: f64) -> String {
    let text = format!("{value:.8e}");
    match text.split_once('e') {
        Some((mantissa, power)) => {
            let power: i32 = power.parse().unwrap_or(0);
            format!("{mantissa}e{}{:02}", if power < 0 { '-' } else { '+' }, power.abs())
        }
        None => text,
    }
}

/// A plain decimal number with nine significant digits.
fn plain(value: f64) -> String {
    let decimals = if value > 0.0 { (8 - value.log10().floor() as i32).clamp(0, 17) as usize } else { 1 };
    let text = format!("{value:.decimals$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

/// Clamped into the range of a parameter, with a warning when it was outside.
fn clamped(name: &str, value: f64, low: f64, high: f64, warnings: &mut Vec<String>) -> f64 {
    let inside = value.clamp(low, high);
    if inside != value {
        warnings.push(format!(
            "{name} would be {}, outside its range {} to {}; {} is written",
            exponent(value),
            digits(low),
            digits(high),
            digits(inside)
        ));
    }
    inside
}

/// How the parameters of the second sensor come here.
const ACCELEROMETER: &str = "`accelerometer` PARAMS, which identify makes of a log with `sensor` accel";

/// What is said of a sensor that is not there.
fn lacking(quantity: Quantity) -> String {
    match quantity {
        Quantity::AngularRate => "the gyro is missing: give its parameters".into(),
        Quantity::SpecificForce => format!("the accelerometer is missing: give {ACCELEROMETER}"),
    }
}

/// A refusal of a file for two kinds of sensors when one is missing.
fn missing(what: &str, flag: &str) -> String {
    format!("{what}; give {flag}")
}
