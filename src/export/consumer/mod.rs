//! Parameter files for other programs, each in its own convention. One file per consumer.
//!
//! Sources: the consumers' own code and documentation, named in each file. Every file begins with a comment block: where the numbers come from, their
//! intervals, the rule for the walk and its price, the rate, the inflation.

mod ardupilot;
mod gazebo;
mod gnss_ins_sim;
mod gtsam;
mod kalibr;
mod matlab;
mod navego;
mod numbers;
mod openvins;
mod orbslam3;
mod px4;
mod vins;

pub use numbers::{Choice, GaussMarkov, Number, Numbers, Sensor, Walk};

use crate::units::{Quantity, digits};

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
    /// Lines about the factors that the white noise of the parameters has in it already.
    pub measured_inflation: Vec<String>,
    pub choice: Choice,
    pub walk: Walk,
    /// Lines about the origin, for the comment block.
    pub origin: Vec<String>,
    /// Lines about the price of the walk.
    pub price: Vec<String>,
}

/// A text file for a consumer, with what a person must be told.
#[derive(Clone, Debug, PartialEq)]
pub struct Written {
    pub text: String,
    pub warnings: Vec<String>,
}

/// The file for `target`. Errors: a sensor that the consumer needs is not there, or does not fit its form.
pub fn write(target: Target, export: &Export) -> Result<Written, String> {
    let mut written = match target {
        Target::Kalibr => kalibr::write(export),
        Target::OpenVins => openvins::write(export),
        Target::Vins => vins::write(export),
        Target::OrbSlam3 => orbslam3::write(export),
        Target::Gtsam => gtsam::write(export),
        Target::Px4 => px4::write(export),
        Target::ArduPilot => ardupilot::write(export),
        Target::Matlab => matlab::write(export),
        Target::GnssInsSim => gnss_ins_sim::write(export),
        Target::NaveGo => navego::write(export),
        Target::Gazebo => gazebo::write(export),
    }?;
    written.warnings.splice(0..0, export.axes().filter_map(Numbers::note));
    Ok(written)
}

impl Export {
    fn rate(&self) -> f64 {
        self.rate_hz.unwrap_or(self.sample_rate_hz)
    }

    /// N of one kind of sensor, one for three axes, inflated; `None` when it is not there.
    fn white(&self, quantity: Quantity) -> Result<Option<f64>, String> {
        self.one(quantity, |numbers| numbers.white.value)
    }

    /// K, likewise.
    fn walk(&self, quantity: Quantity) -> Result<Option<f64>, String> {
        self.one(quantity, |numbers| numbers.walk.value)
    }

    /// Both, where the sensor is there.
    fn white_and_walk(&self, quantity: Quantity) -> Result<Option<(f64, f64)>, String> {
        Ok(self.white(quantity)?.zip(self.walk(quantity)?))
    }

    fn one(&self, quantity: Quantity, of: impl Fn(&Numbers) -> f64) -> Result<Option<f64>, String> {
        let inflated = |value: f64| value * self.inflation;
        self.sensor(quantity).map(|sensor| sensor.one(&self.choice, of).map(inflated)).transpose()
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

    /// The comment block, each line behind `mark`; `interpretation`: what the consumer does with the numbers.
    fn head(&self, mark: &str, interpretation: &[&str]) -> String {
        let mut lines = self.origin.clone();
        lines.extend(interpretation.iter().map(|line| (*line).to_owned()));
        for sensor in self.sensors() {
            let unit = sensor.quantity.si_unit();
            for axis in &sensor.axes {
                let interval = |number: &Number| {
                    number
                        .interval
                        .map_or_else(String::new, |[low, high]| format!(" [{}, {}]", exponent(low), exponent(high)))
                };
                lines.push(format!(
                    "{}: N = {}{} {unit}/sqrt(Hz), K = {}{} {}",
                    axis.name,
                    exponent(axis.white.value),
                    interval(&axis.white),
                    exponent(axis.walk.value),
                    interval(&axis.walk),
                    walk_unit(sensor.quantity)
                ));
                for process in &axis.processes {
                    lines.push(format!(
                        "{}: Gauss-Markov drift of sigma {} {unit}, Tc {} s",
                        axis.name,
                        exponent(process.std_dev),
                        digits(process.correlation_time)
                    ));
                }
                lines.extend(axis.note());
                if !axis.left_out.is_empty() {
                    lines.push(format!("{}: left out, no field for it: {}", axis.name, axis.left_out.join(", ")));
                }
            }
        }
        // a log that moved says nothing of the sensor at rest
        let rest = match self.measured_inflation.is_empty() {
            _ if !self.failed.is_empty() => None,
            true => Some("identified at rest: a lower bound of what a moving vehicle shows"),
            false => Some("drift as identified at rest: a lower bound of what a moving vehicle shows"),
        };
        lines.extend(rest.map(String::from));
        lines.extend(self.failed.iter().map(|failed| format!("identified although a check failed: {failed}")));
        lines.extend(self.measured_inflation.iter().cloned());
        lines.push(match (self.inflation == 1.0, self.measured_inflation.is_empty()) {
            (true, true) => "inflation: none".into(),
            (true, false) => "inflation: none beyond that".into(),
            (false, _) => {
                format!("inflation: N and K (and sigma) below are {} times those above", digits(self.inflation))
            }
        });
        lines.iter().map(|line| format!("{mark} {line}\n")).collect()
    }

    /// About a consumer that knows no other drift than a walk.
    fn walk_words(&self) -> Vec<String> {
        let mut words = vec![self.walk.words()];
        words.extend(self.price.iter().cloned());
        words.extend(self.axes().filter_map(|axis| axis.walk_note(self.walk)));
        words
    }

    /// About one number for several axes.
    fn choice_words(&self) -> String {
        match &self.choice {
            Choice::Worst => "one number for all axes: the largest".into(),
            Choice::Mean => "one number for all axes: the root mean square".into(),
            Choice::Axis(name) => format!("one number for all axes: that of {name}"),
        }
    }

    /// A head for consumers of one white number and one walk.
    fn walk_head(&self, mark: &str, interpretation: &[&str]) -> String {
        let words = self.walk_words();
        let choice = self.choice_words();
        let lines: Vec<&str> =
            interpretation.iter().copied().chain(words.iter().map(String::as_str)).chain([choice.as_str()]).collect();
        self.head(mark, &lines)
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

/// What is said of a sensor that is not there.
fn lacking(quantity: Quantity) -> String {
    match quantity {
        Quantity::AngularRate => "the gyro is missing: give its parameters".into(),
        Quantity::SpecificForce => "the accelerometer is missing: give --accelerometer PARAMS".into(),
    }
}

/// A refusal of a file for two kinds of sensors when one is missing.
fn missing(what: &str, flag: &str) -> String {
    format!("{what}; give {flag}")
}
