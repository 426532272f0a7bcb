//! Steady flight and the linear model about it.

use std::path::{Path, PathBuf};

use anyhow::{Context, anyhow, bail};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::amounts::with_unit;
use crate::aircraft::airframe::Airplane;
use crate::aircraft::airframe::trim::{Sideways, TrimRequest, Turn};
use crate::aircraft::control::document::{LinearDocument, Linearized};
use crate::aircraft::flight::FlightDocument;
use crate::units::Dimension;

/// An airplane, and how it flies.
#[derive(Clone, Debug, clap::Args, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Request {
    /// flight.json or airplane.json
    pub file: PathBuf,
    /// Airspeed
    #[arg(long, visible_alias = "airspeed", value_name = "SPEED", allow_hyphen_values = true)]
    #[serde(default)]
    pub speed: Option<String>,
    /// Above the sea
    #[arg(long, value_name = "LENGTH", allow_hyphen_values = true)]
    #[serde(default)]
    pub altitude: Option<String>,
    /// Angle of the flight path, positive up
    #[arg(long, value_name = "ANGLE", allow_hyphen_values = true)]
    #[serde(default)]
    pub climb: Option<String>,
    /// Of the heading, positive to the right: "10 deg/s"
    #[arg(long, value_name = "RATE", allow_hyphen_values = true)]
    #[serde(default)]
    pub turn_rate: Option<String>,
    /// Angle of bank of a turn
    #[arg(long, value_name = "ANGLE", allow_hyphen_values = true, conflicts_with = "turn_rate")]
    #[serde(default)]
    pub bank: Option<String>,
    /// What fixes the sideways motion
    #[arg(long, value_name = "WHAT", value_parser = Sideways::NAMES)]
    #[serde(default)]
    pub lateral: Option<String>,
    /// Also levels of an airplane this many times as large, by Froude's law
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    #[serde(default)]
    pub froude: Option<f64>,
}

/// The steady flight.
pub struct Done {
    pub linearized: Linearized,
    /// linear.json.
    pub document: LinearDocument,
}

/// What the document says, and over it what the request says.
pub fn run(request: &Request) -> anyhow::Result<Done> {
    if let Some(scale) = request.froude.filter(|n| !(*n > 0.0 && n.is_finite())) {
        bail!("`froude` {scale}: expected a positive number, full size over model");
    }
    let (airplane, documented) = read(&request.file)?;
    let wanted = request.steady_flight(documented)?;
    let shown = || request.file.display().to_string();
    let trim = airplane.trim(&wanted).with_context(shown)?;
    let linearized = Linearized::new(&airplane, trim).with_context(shown)?;
    let document = linearized.document(&airplane, &wanted, request.froude)?;
    Ok(Done { linearized, document })
}

/// The airplane, and the steady flight that a flight document asks for.
fn read(path: &Path) -> anyhow::Result<(Airplane, Option<TrimRequest>)> {
    let shown = path.display().to_string();
    let text = std::fs::read_to_string(path).with_context(|| format!("{shown}: cannot read"))?;
    if !text.contains("\"kfdesign-flight/") {
        return Ok((Airplane::from_json(&text, &shown)?, None));
    }
    let flight = FlightDocument::from_json(&text, &shown)?;
    let folder = path.parent().unwrap_or(Path::new("."));
    let (text, of_airplane) = flight.airplane.text("airplane", folder).map_err(|e| anyhow!("{shown}: {e}"))?;
    let airplane = Airplane::from_json(&text, &of_airplane)?;
    Ok((airplane, flight.trim.as_ref().map(|trim| trim.request())))
}

impl Request {
    fn steady_flight(&self, documented: Option<TrimRequest>) -> anyhow::Result<TrimRequest> {
        const ANGLE: Dimension = Dimension::new(2, 0, 0);
        let of = |option: &str, given: &Option<String>, dimension: Dimension, example: &str| {
            given.as_ref().map(|text| with_unit(option, text, dimension, example)).transpose()
        };
        let asked = |option: &str, found: Option<f64>, before: Option<f64>, example: &str| {
            let missing = || format!("{}: no {option} is given: add {option} \"{example}\"", self.file.display());
            found.or(before).with_context(missing)
        };
        let speed = of("`speed`", &self.speed, Dimension::new(0, 2, -2), "25 m/s")?;
        let altitude = of("`altitude`", &self.altitude, Dimension::new(0, 2, 0), "100 m")?;
        let turn_rate = of("`turn_rate`", &self.turn_rate, Dimension::new(2, 0, -2), "10 deg/s")?.map(Turn::Rate);
        let bank = of("`bank`", &self.bank, ANGLE, "30 deg")?.map(Turn::Bank);
        if turn_rate.is_some() && bank.is_some() {
            bail!("`turn_rate` and `bank` both say how it turns: give one of them");
        }
        let sideways = match self.lateral.as_deref() {
            Some(name) => Some(
                Sideways::named(name)
                    .with_context(|| format!("`lateral` {name}: expected one of {}", Sideways::NAMES.join(", ")))?,
            ),
            None => documented.map(|d| d.sideways),
        };
        Ok(TrimRequest {
            airspeed: asked("`speed`", speed, documented.map(|d| d.airspeed), "25 m/s")?,
            altitude: asked("`altitude`", altitude, documented.map(|d| d.altitude), "100 m")?,
            climb: of("`climb`", &self.climb, ANGLE, "5 deg")?.or(documented.map(|d| d.climb)).unwrap_or(0.0),
            turn: turn_rate.or(bank).or(documented.map(|d| d.turn)).unwrap_or(Turn::Rate(0.0)),
            sideways: sideways.unwrap_or_default(),
        })
    }
}
