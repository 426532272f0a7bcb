//! Noise parameters of a datasheet.

use std::ops::RangeInclusive;

use anyhow::{anyhow, bail};
use clap::ValueEnum;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::amounts::whole;
use super::import::{check_rate, not_empty};
use crate::import::Imported;
use crate::import::datasheet::{Datasheet, Instability, Sides, parameters};
use crate::params::Measured;
use crate::units::{Dimension, Quantity};

/// Of a low-pass filter: above, its noise bandwidth is the -3 dB bandwidth to five digits.
const ORDERS: RangeInclusive<u32> = 1..=100;

/// What a datasheet prints, each value with its unit.
#[derive(Clone, Debug, clap::Args, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Request {
    /// Angle random walk of a gyro (angular random walk): "0.15 deg/sqrt(h)"
    #[arg(long, visible_aliases = ["angular-random-walk", "arw"], value_name = "VALUE", allow_hyphen_values = true)]
    #[serde(default)]
    pub angle_random_walk: Option<String>,
    /// Velocity random walk of an accelerometer: "0.03 m/s/sqrt(h)"
    #[arg(
        long,
        visible_alias = "vrw",
        value_name = "VALUE",
        allow_hyphen_values = true,
        conflicts_with = "angle_random_walk"
    )]
    #[serde(default)]
    pub velocity_random_walk: Option<String>,
    /// Noise density, spectral noise density: "2.8 mdps/sqrt(Hz)", "90 ug/sqrt(Hz)"; see --sided
    #[arg(long, visible_alias = "noise-spectral-density", value_name = "VALUE", allow_hyphen_values = true)]
    #[serde(default)]
    pub noise_density: Option<String>,
    /// Whether the noise density is one-sided (deviation in a band = density sqrt(band)) or two-sided (as a random
    /// walk is)
    #[arg(long, value_enum, requires = "noise_density")]
    #[serde(default)]
    pub sided: Option<Sided>,
    /// Total noise, rms noise, output noise in --bandwidth: "0.05 deg/s"
    #[arg(long, visible_aliases = ["rms-noise", "output-noise"], value_name = "VALUE", allow_hyphen_values = true)]
    #[serde(default)]
    pub total_noise: Option<String>,
    /// -3 dB bandwidth: "92 Hz"
    #[arg(long, value_name = "FREQUENCY", allow_hyphen_values = true)]
    #[serde(default)]
    pub bandwidth: Option<String>,
    /// Order of the low-pass filter of that bandwidth, for its noise bandwidth (Butterworth)
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = whole::<u32>)]
    #[serde(default = "one")]
    pub filter_order: u32,
    /// Bias instability, in-run bias stability: "2.3 deg/h", "0.04 mg"
    #[arg(
        long,
        visible_aliases = ["in-run-bias-stability", "bias-stability"],
        value_name = "VALUE",
        allow_hyphen_values = true
    )]
    #[serde(default)]
    pub bias_instability: Option<String>,
    /// What the bias instability is
    #[arg(long, value_enum, default_value_t = InstabilityKind::Floor)]
    #[serde(default)]
    pub instability: InstabilityKind,
    /// Correlation time of the drift: "200 s"; makes a Gauss-Markov process of the bias instability, which else is
    /// flicker
    #[arg(long, value_name = "TIME", allow_hyphen_values = true)]
    #[serde(default)]
    pub correlation_time: Option<String>,
    /// Rate random walk: "0.5 deg/h/sqrt(h)"
    #[arg(long, visible_aliases = ["rrw", "acceleration-random-walk"], value_name = "VALUE", allow_hyphen_values = true)]
    #[serde(default)]
    pub rate_random_walk: Option<String>,
    /// Turn-on bias, zero-rate offset, bias repeatability, as one standard deviation: "0.5 deg/s"
    #[arg(
        long,
        visible_aliases = ["zero-rate-offset", "zero-g-offset", "bias-repeatability"],
        value_name = "VALUE",
        allow_hyphen_values = true
    )]
    #[serde(default)]
    pub turn_on_bias: Option<String>,
    /// Sample rate of the log in Hz
    #[arg(long, visible_aliases = ["sample-rate", "output-data-rate"], value_name = "HZ", allow_negative_numbers = true)]
    pub rate: f64,
    /// Names of the axes, all alike
    #[arg(long, value_delimiter = ',', value_name = "NAMES", default_value = "x,y,z")]
    #[serde(default = "axes")]
    pub axes: Vec<String>,
    /// The product, for the record
    #[arg(long, value_name = "TEXT")]
    #[serde(default)]
    pub name: Option<String>,
}

fn one() -> u32 {
    1
}

fn axes() -> Vec<String> {
    ["x", "y", "z"].map(String::from).to_vec()
}

/// What the frequencies of a noise density run over.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Sided {
    One,
    Two,
}

/// What a bias instability is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum InstabilityKind {
    #[default]
    /// The floor of the Allan deviation, as datasheets mostly have it
    Floor,
    /// The coefficient B of IEEE Std 952, of which the floor is 0.664 B
    Coefficient,
    /// The standard deviation of the drift; needs a correlation time
    Sigma,
}

/// Rules that were used, and what is doubtful, are in the result.
pub fn run(request: &Request) -> anyhow::Result<Imported> {
    check_rate(Some(request.rate))?;
    if !ORDERS.contains(&request.filter_order) {
        bail!("`filter_order` {}: expected {} to {}", request.filter_order, ORDERS.start(), ORDERS.end());
    }
    let found = parameters(&request.sheet()?).map_err(|message| anyhow!(message))?;
    not_empty(found, "the datasheet")
}

impl Request {
    /// Typed values with their flag and half powers of time beside the quantity's own dimension.
    fn values(&self) -> [(&'static str, &Option<String>, i8); 7] {
        [
            ("`angle_random_walk`", &self.angle_random_walk, 1),
            ("`velocity_random_walk`", &self.velocity_random_walk, 1),
            ("`noise_density`", &self.noise_density, 1),
            ("`total_noise`", &self.total_noise, 0),
            ("`bias_instability`", &self.bias_instability, 0),
            ("`rate_random_walk`", &self.rate_random_walk, -1),
            ("`turn_on_bias`", &self.turn_on_bias, 0),
        ]
    }

    fn sheet(&self) -> anyhow::Result<Datasheet> {
        let mut quantity: Option<(Quantity, &str)> = None;
        let mut values = Vec::with_capacity(7);
        for (flag, text, half_powers) in self.values() {
            let Some(text) = text else {
                values.push(None);
                continue;
            };
            let (of, value) = either(flag, text, half_powers)?;
            if let Some((other, before)) = quantity.filter(|(other, _)| *other != of) {
                bail!(
                    "{flag} {text}: of an {}, but {before} is of an {}: one sensor at a time",
                    of.name(),
                    other.name()
                );
            }
            quantity = Some((of, flag));
            values.push(Some(value));
        }
        let Some((quantity, _)) = quantity else {
            bail!("nothing was typed: give `angle_random_walk` or `noise_density`, and `bias_instability`");
        };
        for (flag, given, expected) in [
            ("`angle_random_walk`", &self.angle_random_walk, Quantity::AngularRate),
            ("`velocity_random_walk`", &self.velocity_random_walk, Quantity::SpecificForce),
        ] {
            if let Some(text) = given.as_ref().filter(|_| quantity != expected) {
                bail!("{flag} {text}: expected a unit of {}", expected.dimension().times_time(1).name());
            }
        }
        if self.axes.iter().any(|name| name.trim().is_empty()) {
            bail!("`axes`: a name is empty; expected names such as x,y,z");
        }
        if let Some(name) = (1..self.axes.len()).find(|i| self.axes[..*i].contains(&self.axes[*i])) {
            bail!("`axes`: '{}' stands twice", self.axes[name]);
        }
        let mut values = values.into_iter();
        let mut next = || values.next().flatten();
        let (angle, velocity) = (next(), next());
        Ok(Datasheet {
            quantity,
            sample_rate_hz: self.rate,
            axes: self.axes.clone(),
            name: self.name.clone(),
            random_walk: angle.or(velocity),
            noise_density: next(),
            sides: self.sided.map(|sides| match sides {
                Sided::One => Sides::One,
                Sided::Two => Sides::Two,
            }),
            total_noise: next(),
            bandwidth: typed("`bandwidth`", &self.bandwidth, Dimension::FREQUENCY)?,
            filter_order: self.filter_order,
            bias_instability: next(),
            instability: match self.instability {
                InstabilityKind::Floor => Instability::Floor,
                InstabilityKind::Coefficient => Instability::Coefficient,
                InstabilityKind::Sigma => Instability::Sigma,
            },
            correlation_time: typed("`correlation_time`", &self.correlation_time, Dimension::TIME)?,
            rate_random_walk: next(),
            turn_on_bias: next(),
        })
    }
}

fn typed(flag: &str, text: &Option<String>, dimension: Dimension) -> anyhow::Result<Option<Measured>> {
    let read = |text: &String| Measured::positive(text, dimension).map_err(|e| anyhow!("{flag} {text}: {e}"));
    text.as_ref().map(read).transpose()
}

/// A value of a gyro or of an accelerometer, as its unit says; of what is neither the complaint is about the nearer.
fn either(flag: &str, text: &str, half_powers: i8) -> anyhow::Result<(Quantity, Measured)> {
    let as_of = |quantity: Quantity| Measured::positive(text, quantity.dimension().times_time(half_powers));
    let gyro = match as_of(Quantity::AngularRate) {
        Ok(value) => return Ok((Quantity::AngularRate, value)),
        Err(complaint) => complaint,
    };
    match as_of(Quantity::SpecificForce) {
        Ok(value) => Ok((Quantity::SpecificForce, value)),
        Err(force) => {
            let length = crate::units::Unit::parse(text.trim_start_matches(|c: char| !c.is_alphabetic()))
                .is_ok_and(|u| u.dimension().length != 0);
            bail!("{flag} {text}: {}", if length { force } else { gyro })
        }
    }
}
