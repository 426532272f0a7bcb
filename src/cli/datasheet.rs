//! `kfdesign datasheet`.

use std::path::PathBuf;

use anyhow::{anyhow, bail};
use clap::ValueEnum;

use super::Status;
use super::import::{check_rate, finish};
use crate::import::datasheet::{Datasheet, Instability, Sides, parameters};
use crate::params::Measured;
use crate::units::{Dimension, Quantity};

/// Noise parameters from the words that datasheets print
///
/// Every value carries the unit of the datasheet ("0.15 deg/sqrt(h)", "2.8 mdps/sqrt(Hz)", "90 ug/sqrt(Hz)", "2.3
/// deg/h"); the units tell whether it is a gyro or an accelerometer. The rule behind each parameter is said, and
/// what a datasheet leaves open is asked for. `compare FILE LOG --parameters` puts the numbers beside what a log
/// says.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Example: kfdesign datasheet --angle-random-walk \"0.13 deg/sqrt(h)\" --bias-instability \"2.3 deg/h\" --rate 100 -o params.json"
)]
pub struct Args {
    /// Angle random walk of a gyro (angular random walk): "0.15 deg/sqrt(h)"
    #[arg(long, visible_aliases = ["angular-random-walk", "arw"], value_name = "VALUE", allow_hyphen_values = true)]
    angle_random_walk: Option<String>,
    /// Velocity random walk of an accelerometer: "0.03 m/s/sqrt(h)"
    #[arg(
        long,
        visible_alias = "vrw",
        value_name = "VALUE",
        allow_hyphen_values = true,
        conflicts_with = "angle_random_walk"
    )]
    velocity_random_walk: Option<String>,
    /// Noise density, spectral noise density: "2.8 mdps/sqrt(Hz)", "90 ug/sqrt(Hz)"; see --sided
    #[arg(long, visible_alias = "noise-spectral-density", value_name = "VALUE", allow_hyphen_values = true)]
    noise_density: Option<String>,
    /// Whether the noise density is one-sided (deviation in a band = density sqrt(band)) or two-sided (as a random
    /// walk is)
    #[arg(long, value_enum, requires = "noise_density")]
    sided: Option<SidesArg>,
    /// Total noise, rms noise, output noise in --bandwidth: "0.05 deg/s"
    #[arg(long, visible_aliases = ["rms-noise", "output-noise"], value_name = "VALUE", allow_hyphen_values = true)]
    total_noise: Option<String>,
    /// -3 dB bandwidth: "92 Hz"
    #[arg(long, value_name = "FREQUENCY", allow_hyphen_values = true)]
    bandwidth: Option<String>,
    /// Order of the low-pass filter of that bandwidth, for its noise bandwidth (Butterworth)
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=100))]
    filter_order: u32,
    /// Bias instability, in-run bias stability: "2.3 deg/h", "0.04 mg"
    #[arg(long, visible_aliases = ["in-run-bias-stability", "bias-stability"], value_name = "VALUE", allow_hyphen_values = true)]
    bias_instability: Option<String>,
    /// What the bias instability is
    #[arg(long, value_enum, default_value_t = InstabilityArg::Floor)]
    instability: InstabilityArg,
    /// Correlation time of the drift: "200 s"; makes a Gauss-Markov process of the bias instability, which else is
    /// flicker
    #[arg(long, value_name = "TIME", allow_hyphen_values = true)]
    correlation_time: Option<String>,
    /// Rate random walk: "0.5 deg/h/sqrt(h)"
    #[arg(long, visible_aliases = ["rrw", "acceleration-random-walk"], value_name = "VALUE", allow_hyphen_values = true)]
    rate_random_walk: Option<String>,
    /// Turn-on bias, zero-rate offset, bias repeatability, as one standard deviation: "0.5 deg/s"
    #[arg(long, visible_aliases = ["zero-rate-offset", "zero-g-offset", "bias-repeatability"], value_name = "VALUE", allow_hyphen_values = true)]
    turn_on_bias: Option<String>,
    /// Sample rate of the log in Hz
    #[arg(long, visible_aliases = ["sample-rate", "output-data-rate"], value_name = "HZ", allow_negative_numbers = true)]
    rate: f64,
    /// Names of the axes, all alike
    #[arg(long, value_delimiter = ',', value_name = "NAMES", default_value = "x,y,z")]
    axes: Vec<String>,
    /// The product, for the record
    #[arg(long, value_name = "TEXT")]
    name: Option<String>,
    /// The parameters
    #[arg(short, long, value_name = "FILE.json")]
    output: Option<PathBuf>,
    /// The parameters on stdout, one document
    #[arg(long)]
    json: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum SidesArg {
    One,
    Two,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum InstabilityArg {
    /// The floor of the Allan deviation, as datasheets mostly have it
    Floor,
    /// The coefficient B of IEEE Std 952, of which the floor is 0.664 B
    Coefficient,
    /// The standard deviation of the drift; needs --correlation-time
    Sigma,
}

pub(super) fn run(args: &Args) -> anyhow::Result<Status> {
    check_rate(Some(args.rate))?;
    super::files::check(&[("-o", &args.output, super::files::Kind::Json)], &[])?;
    let sheet = args.sheet()?;
    let found = parameters(&sheet).map_err(|message| anyhow!(message))?;
    finish(&found, "the datasheet", args.output.as_deref(), None, args.json)
}

impl Args {
    /// Typed values with their flag and half powers of time beside the quantity's own dimension.
    fn values(&self) -> [(&'static str, &Option<String>, i8); 7] {
        [
            ("--angle-random-walk", &self.angle_random_walk, 1),
            ("--velocity-random-walk", &self.velocity_random_walk, 1),
            ("--noise-density", &self.noise_density, 1),
            ("--total-noise", &self.total_noise, 0),
            ("--bias-instability", &self.bias_instability, 0),
            ("--rate-random-walk", &self.rate_random_walk, -1),
            ("--turn-on-bias", &self.turn_on_bias, 0),
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
            bail!("nothing was typed: give --angle-random-walk or --noise-density, and --bias-instability");
        };
        for (flag, given, expected) in [
            ("--angle-random-walk", &self.angle_random_walk, Quantity::AngularRate),
            ("--velocity-random-walk", &self.velocity_random_walk, Quantity::SpecificForce),
        ] {
            if let Some(text) = given.as_ref().filter(|_| quantity != expected) {
                bail!("{flag} {text}: expected a unit of {}", expected.dimension().times_time(1).name());
            }
        }
        if self.axes.iter().any(|name| name.trim().is_empty()) {
            bail!("--axes: a name is empty; expected names such as x,y,z");
        }
        if let Some(name) = (1..self.axes.len()).find(|i| self.axes[..*i].contains(&self.axes[*i])) {
            bail!("--axes: '{}' stands twice", self.axes[name]);
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
                SidesArg::One => Sides::One,
                SidesArg::Two => Sides::Two,
            }),
            total_noise: next(),
            bandwidth: typed("--bandwidth", &self.bandwidth, Dimension::FREQUENCY)?,
            filter_order: self.filter_order,
            bias_instability: next(),
            instability: match self.instability {
                InstabilityArg::Floor => Instability::Floor,
                InstabilityArg::Coefficient => Instability::Coefficient,
                InstabilityArg::Sigma => Instability::Sigma,
            },
            correlation_time: typed("--correlation-time", &self.correlation_time, Dimension::TIME)?,
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
