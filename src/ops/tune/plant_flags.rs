//! The flags that choose the plant; each goes before what params.json says.

use std::path::{Path, PathBuf};

use anyhow::{Context, anyhow, bail};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::filter::AIRPLANE;
use crate::ops::checked;
use crate::params::{
    AidDrift, AidEntry, AttitudeEntry, AxisParams, Design, Measured, MotionEntry, Params, PlantEntry, check_name,
    unknown_plant,
};
use crate::units::{Dimension, Quantity};

/// The plant and what aids it.
#[derive(Clone, Debug, Default, clap::Args, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[command(next_help_heading = "Plant")]
pub struct PlantFlags {
    /// What the sensor is part of: static, angle, rate, vertical, attitude, airplane, or a design FILE.json [default:
    /// the design of the parameters, else static]
    #[arg(long, value_name = "PLANT")]
    pub plant: Option<String>,
    #[allow(rustdoc::broken_intra_doc_links, reason = "it is the help of a flag, too")]
    /// A measurement of the plant: "[NAME:] SIGMA [@ RATE] [, SIGMA over TIME]", for example "heading: 2 deg @ 1 Hz,
    /// 1 deg over 60 s"; or its column in the logs, as in replay: heading=yaw:deg
    #[arg(long, value_name = "AID")]
    pub aid: Vec<String>,
    /// Plant rate: "SIGMA over TIME" for a Gauss-Markov rate, or the density of an integrated random walk, such as
    /// "5 deg/s^2/sqrt(s)"
    #[arg(long, value_name = "MOTION")]
    pub motion: Option<String>,
    /// Plants vertical and attitude: noise parameters of the accelerometer, FILE or FILE:AXIS; of several axes
    /// attitude takes the noisiest
    #[arg(long, value_name = "PARAMS")]
    pub accelerometer: Option<String>,
    /// Plant airplane: the flight.json whose airplane, servos, gusts and autopilot the filter knows
    #[arg(long, value_name = "FLIGHT")]
    pub flight: Option<PathBuf>,
}

impl PlantFlags {
    /// The filter is made of a flight.
    pub(crate) fn is_airplane(&self) -> bool {
        self.plant.as_deref() == Some(AIRPLANE)
    }

    /// The aids that are columns of logs: NAME=COLUMN.
    pub(crate) fn columns(&self) -> Vec<String> {
        self.aid.iter().filter(|text| text.contains('=')).cloned().collect()
    }

    /// `None`: no flag was given, the parameters decide.
    pub(crate) fn design(&self, params: &Params) -> anyhow::Result<Option<Design>> {
        let aids: Vec<&String> = self.aid.iter().filter(|text| !text.contains('=')).collect();
        if self.flight.is_some() {
            bail!("`flight` belongs to `plant` airplane");
        }
        let nothing = self.plant.is_none() && aids.is_empty() && self.motion.is_none();
        if nothing && self.accelerometer.is_none() {
            return Ok(None);
        }
        let mut design = self.chosen(params.design.clone().unwrap_or_default())?;
        self.set_plant(&mut design.plant)?;
        if !aids.is_empty() {
            design.aids.clear();
        }
        for text in aids {
            let aid = aid(text, &design).with_context(|| format!("`aid` \"{text}\""))?;
            if design.aids.iter().any(|earlier| earlier.name == aid.name) {
                bail!("`aid` \"{text}\": '{}' is the name of an earlier aid too; write \"NAME: …\"", aid.name);
            }
            design.aids.push(aid);
        }
        Ok(Some(design))
    }

    /// The plant by name or file; one of the same name keeps what the document says of it.
    fn chosen(&self, documented: Design) -> anyhow::Result<Design> {
        let plant = match self.plant.as_deref() {
            None => return Ok(documented),
            Some(name) if name == documented.plant.name() => return Ok(documented),
            Some(path) if path.ends_with(".json") || path.contains(".json#") => {
                let (path, sensor) = path
                    .split_once(".json#")
                    .map_or((path.to_string(), None), |(stem, sensor)| (format!("{stem}.json"), Some(sensor)));
                let text = std::fs::read_to_string(&path).with_context(|| format!("`plant` {path}: cannot read"))?;
                return Ok(Design::from_json(&text, &path, sensor)?);
            }
            Some("static") => PlantEntry::Static,
            Some("angle") => PlantEntry::Angle { initial_std_dev: None },
            Some("rate") => {
                let text = self.motion.as_deref();
                let text =
                    text.context("`plant` rate: say how the rate moves, for example `motion` \"20 deg/s over 0.5 s\"")?;
                PlantEntry::Rate { motion: motion(text)?, initial_std_dev: None }
            }
            Some("vertical") => {
                let path = self.accelerometer.as_deref();
                let path = path.context("`plant` vertical: give the accelerometer's noise, `accelerometer` PARAMS")?;
                let accelerometer = Box::new(accelerometer(path, Choice::Named)?);
                PlantEntry::Vertical { accelerometer, gravity: None, initial_std_dev: None }
            }
            Some("attitude") => {
                let path = self.accelerometer.as_deref();
                let path = path.context("`plant` attitude: give the accelerometer's noise, `accelerometer` PARAMS")?;
                let accelerometer = accelerometer(path, Choice::Noisiest)?;
                PlantEntry::Attitude(Box::new(AttitudeEntry { accelerometer, gravity: None, scale_factor: None }))
            }
            Some("custom") => bail!(
                "`plant` custom: a custom plant needs its matrices; give them in a design file, `plant` FILE.json"
            ),
            Some(other) => bail!("`plant`: {}", unknown_plant(other)),
        };
        Ok(Design { plant, aids: Vec::new() })
    }

    /// What flags say about the plant that was chosen.
    fn set_plant(&self, plant: &mut PlantEntry) -> anyhow::Result<()> {
        let name = plant.name();
        match (&self.motion, &mut *plant) {
            (Some(text), PlantEntry::Rate { motion: known, .. }) => *known = motion(text)?,
            (Some(_), _) => bail!("`motion` is no matter of the plant '{name}'; it belongs to `plant` rate"),
            (None, _) => {}
        }
        match (&self.accelerometer, plant) {
            (Some(path), PlantEntry::Vertical { accelerometer: known, .. }) => {
                **known = accelerometer(path, Choice::Named)?;
            }
            (Some(path), PlantEntry::Attitude(entry)) => entry.accelerometer = accelerometer(path, Choice::Noisiest)?,
            (Some(_), _) => {
                bail!("`accelerometer` is no matter of the plant '{name}'; it belongs to `plant` vertical and attitude")
            }
            (None, _) => {}
        }
        Ok(())
    }
}

/// Which axis of several, where the flag names none.
#[derive(Clone, Copy, PartialEq)]
enum Choice {
    /// None: it must be named.
    Named,
    /// The one with the most white noise.
    Noisiest,
}

/// `FILE`, or `FILE:AXIS`.
fn accelerometer(text: &str, choice: Choice) -> anyhow::Result<AxisParams> {
    let (path, axis) = match text.rsplit_once(':') {
        Some((path, axis)) if !Path::new(text).exists() => (path, Some(axis)),
        _ => (text, None),
    };
    let params = checked::params(&PathBuf::from(path))?;
    if params.quantity != Quantity::SpecificForce {
        bail!("`accelerometer` {path}: is of an {}, expected a specific-force", params.quantity.name());
    }
    let names: Vec<&str> = params.axes.iter().map(|axis| axis.name.as_str()).collect();
    let white = |axis: &&AxisParams| axis.noise().white_density();
    let noisiest = params.axes.iter().max_by(|a, b| white(a).total_cmp(&white(b)));
    let wanted = match (axis, names.as_slice()) {
        (Some(axis), _) => axis,
        (None, _) if choice == Choice::Noisiest => noisiest.map_or("", |axis| axis.name.as_str()),
        (None, [one]) => one,
        (None, [first, ..]) => bail!(
            "`accelerometer` {path}: there are the axes {}; choose one, for example `accelerometer` {path}:{first}",
            names.join(", ")
        ),
        (None, []) => bail!("`accelerometer` {path}: there is no axis"),
    };
    let found = params.axes.iter().find(|axis| axis.name == wanted);
    found.cloned().ok_or_else(|| anyhow!("`accelerometer` {path}: no axis '{wanted}'; there are {}", names.join(", ")))
}

fn value(text: &str, dimension: Dimension) -> anyhow::Result<Measured> {
    Measured::positive(text.trim(), dimension).map_err(|message| anyhow!(message))
}

/// `SIGMA over TIME`.
fn drift(text: &str, dimension: Dimension) -> anyhow::Result<(Measured, Measured)> {
    let (std_dev, time) = text.split_once(" over ").with_context(|| {
        format!("'{}': expected SIGMA over TIME, for example \"1 {} over 60 s\"", text.trim(), dimension.example())
    })?;
    Ok((value(std_dev, dimension)?, value(time, Dimension::TIME)?))
}

fn motion(text: &str) -> anyhow::Result<MotionEntry> {
    let rate = Quantity::AngularRate.dimension();
    let parsed = if text.contains(" over ") {
        drift(text, rate).map(|(std_dev, correlation_time)| MotionEntry::GaussMarkov { std_dev, correlation_time })
    } else {
        value(text, rate.times_time(-3)).map(|density| MotionEntry::IntegratedRandomWalk { density })
    };
    parsed.with_context(|| format!("`motion` \"{text}\""))
}

/// `[NAME:] SIGMA [@ RATE] [, SIGMA over TIME]`.
fn aid(text: &str, design: &Design) -> anyhow::Result<AidEntry> {
    let plant = &design.plant;
    let dimension = plant.aided(None).with_context(|| format!("the plant '{}' has nothing to aid", plant.name()))?;
    let (name, rest) = match text.split_once(':') {
        Some((name, rest)) => (name.trim(), rest),
        None if matches!(plant, PlantEntry::Angle { .. } | PlantEntry::Attitude(_)) => ("heading", text),
        None => ("aid", text),
    };
    check_name(name).map_err(|message| anyhow!(message))?;
    let (white, correlated) = match rest.split_once(',') {
        Some((white, correlated)) => (white, Some(correlated)),
        None => (rest, None),
    };
    let (std_dev, rate) = match white.split_once('@') {
        Some((std_dev, rate)) => (std_dev, Some(value(rate, Dimension::FREQUENCY)?)),
        None => (white, None),
    };
    let gauss_markov = correlated.map(|text| drift(text, dimension)).transpose()?;
    Ok(AidEntry {
        name: name.to_string(),
        std_dev: value(std_dev, dimension)?,
        rate,
        gauss_markov: gauss_markov.map(|(std_dev, correlation_time)| AidDrift { std_dev, correlation_time }),
        measures: None,
    })
}
