//! What `loop` compares: the feeds between the sensors and the gains.

use std::path::PathBuf;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::Serialize;

use super::values::{ANGLE, VELOCITY, linked as link, required, value, word};
use super::weights::{lateral, longitudinal};
use super::{LateralWeights, Linked, LongitudinalWeights, linked};
use crate::params::place::{KeyError, Object, Place};
use crate::params::{Measured, ParamsDocument, Range};
use crate::units::Dimension;

/// What stands between the sensors and the gains.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(tag = "type", rename_all = "lowercase", deny_unknown_fields)]
pub enum FeedEntry {
    /// The gyro as it is, and the angle of a complementary filter of gyro and attitude reference.
    Raw {
        #[serde(skip_serializing_if = "Option::is_none")]
        name: Option<String>,
    },
    /// The rate through a Butterworth low-pass.
    Lowpass {
        #[serde(skip_serializing_if = "Option::is_none")]
        name: Option<String>,
        #[schemars(schema_with = "order_schema")]
        order: u64,
        corner: Measured,
    },
    /// The rate without one frequency.
    Notch {
        #[serde(skip_serializing_if = "Option::is_none")]
        name: Option<String>,
        /// The strongest line of the gyro's parameters when absent.
        #[serde(skip_serializing_if = "Option::is_none")]
        frequency: Option<Measured>,
        /// Between the frequencies at which half the power is left; half the frequency when absent.
        #[serde(skip_serializing_if = "Option::is_none")]
        width: Option<Measured>,
    },
    /// The rate less what a Kalman filter of the gyro's errors estimates of them.
    Drift {
        #[serde(skip_serializing_if = "Option::is_none")]
        name: Option<String>,
        /// filter.json of the plant angle, rate or vertical; made of the gyro's parameters when absent.
        #[serde(skip_serializing_if = "Option::is_none")]
        filter: Option<PathBuf>,
        /// Density of the walk by which a constant bias is followed; 0.0005 deg/s/√s when absent.
        #[serde(skip_serializing_if = "Option::is_none")]
        bias_walk: Option<Measured>,
        /// Behind the filter.
        #[serde(skip_serializing_if = "Option::is_none")]
        lowpass: Option<LowpassEntry>,
    },
    /// A Kalman filter of airframe, servos, gusts and gyro errors that knows the command.
    Airframe {
        #[serde(skip_serializing_if = "Option::is_none")]
        name: Option<String>,
        /// Density of the walk by which a constant bias is followed; 0.0005 deg/s/√s when absent.
        #[serde(skip_serializing_if = "Option::is_none")]
        bias_walk: Option<Measured>,
        /// The turbulence it is designed for; that of the flight when absent.
        #[serde(skip_serializing_if = "Option::is_none")]
        wind_at_20ft: Option<Measured>,
        /// The airspeed it is designed for; that of the trim when absent.
        #[serde(skip_serializing_if = "Option::is_none")]
        airspeed: Option<Measured>,
        /// Several airspeeds: a filter for each, with what lies between interpolated by the airspeed that it flies at.
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        #[schemars(length(min = 2))]
        schedule: Vec<Measured>,
        /// filter.json of `tune` with the plant airplane; made of the flight when absent.
        #[serde(skip_serializing_if = "Option::is_none")]
        filter: Option<PathBuf>,
        /// params.json of the gyro it is designed for; that of the flight when absent.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(schema_with = "optional_params")]
        gyro: Option<Linked>,
        /// Behind the filter.
        #[serde(skip_serializing_if = "Option::is_none")]
        lowpass: Option<LowpassEntry>,
    },
    /// The airframe filter with optimal gains of all its states, instead of the autopilot's: they make Σ xᵀQx + uᵀRu
    /// least.
    Lqg {
        #[serde(skip_serializing_if = "Option::is_none")]
        name: Option<String>,
        longitudinal: LongitudinalWeights,
        lateral: LateralWeights,
        /// Standard deviation per sample of a noise on each command that the filter believes in (loop transfer
        /// recovery); none when absent.
        #[serde(skip_serializing_if = "Option::is_none")]
        recovery: Option<Measured>,
        /// Density of the walk by which a constant bias is followed; 0.0005 deg/s/√s when absent.
        #[serde(skip_serializing_if = "Option::is_none")]
        bias_walk: Option<Measured>,
    },
}

/// A Butterworth low-pass.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LowpassEntry {
    #[schemars(schema_with = "order_schema")]
    pub order: u64,
    pub corner: Measured,
}

/// A frequency as names show it.
fn hertz(frequency: &Measured) -> String {
    format!("{} Hz", (1e6 * frequency.si()).round() / 1e6)
}

impl FeedEntry {
    /// As given, or by what it is: "raw", "LP2 10 Hz", "drift KF + LP2 20 Hz", "airframe KF".
    pub fn name(&self) -> String {
        let low = |order: u64, corner: &Measured| format!("LP{order} {}", hertz(corner));
        let behind = |own: &str, lowpass: &Option<LowpassEntry>| match lowpass {
            Some(LowpassEntry { order, corner }) => format!("{own} + {}", low(*order, corner)),
            None => own.to_string(),
        };
        let (given, own) = match self {
            FeedEntry::Raw { name } => (name, "raw".to_string()),
            FeedEntry::Lowpass { name, order, corner } => (name, low(*order, corner)),
            FeedEntry::Notch { name, frequency, .. } => {
                (name, frequency.as_ref().map_or("notch".into(), |at| format!("notch {}", hertz(at))))
            }
            FeedEntry::Drift { name, lowpass, .. } => (name, behind("drift KF", lowpass)),
            FeedEntry::Airframe { name, lowpass, schedule, .. } => {
                let own = if schedule.is_empty() { "airframe KF" } else { "scheduled KF" };
                (name, behind(own, lowpass))
            }
            FeedEntry::Lqg { name, recovery, .. } => {
                (name, if recovery.is_some() { "LQG, recovered" } else { "LQG" }.to_string())
            }
        };
        given.clone().unwrap_or(own)
    }
}

/// Of an angular rate over the root of a time.
const WALK: Dimension = Dimension::new(2, 0, -3);

fn order_schema(_: &mut SchemaGenerator) -> Schema {
    json_schema!({ "description": "1 or 2.", "enum": [1, 2] })
}

fn optional_params(generator: &mut SchemaGenerator) -> Schema {
    linked::<ParamsDocument>(generator)
}

fn lowpass(place: &Place<'_>) -> Result<LowpassEntry, KeyError> {
    let o = place.object(&["order", "corner"])?;
    Ok(LowpassEntry { order: order(&o)?, corner: required(&o, "corner", Dimension::FREQUENCY)? })
}

fn order(o: &Object<'_>) -> Result<u64, KeyError> {
    let place = o.required("order")?;
    let order = place.count()?;
    if (1..=2).contains(&order) { Ok(order) } else { Err(place.error(format!("found {order}, expected 1 or 2"))) }
}

pub(super) fn feed(place: &Place<'_>) -> Result<FeedEntry, KeyError> {
    let all = [
        "type",
        "name",
        "order",
        "corner",
        "frequency",
        "width",
        "filter",
        "bias_walk",
        "lowpass",
        "wind_at_20ft",
        "airspeed",
        "schedule",
        "gyro",
        "longitudinal",
        "lateral",
        "recovery",
    ];
    let kind = word(&place.object(&all)?.required("type")?, &["raw", "lowpass", "notch", "drift", "airframe", "lqg"])?;
    let object = |known: &[&str]| place.object(&[&["type", "name"], known].concat());
    let walk = |o: &Object<'_>| value(o, "bias_walk", WALK, Range::Positive);
    let name = |o: &Object<'_>| o.optional("name").map(|p| p.text().map(str::to_string)).transpose();
    let path = |o: &Object<'_>| o.optional("filter").map(|p| p.text().map(Into::into)).transpose();
    let behind = |o: &Object<'_>| o.optional("lowpass").map(|p| lowpass(&p)).transpose();
    Ok(match kind {
        "raw" => FeedEntry::Raw { name: name(&object(&[])?)? },
        "lowpass" => {
            let o = object(&["order", "corner"])?;
            let corner = required(&o, "corner", Dimension::FREQUENCY)?;
            FeedEntry::Lowpass { name: name(&o)?, order: order(&o)?, corner }
        }
        "notch" => {
            let o = object(&["frequency", "width"])?;
            let get = |key: &str| value(&o, key, Dimension::FREQUENCY, Range::Positive);
            FeedEntry::Notch { name: name(&o)?, frequency: get("frequency")?, width: get("width")? }
        }
        "drift" => {
            let o = object(&["filter", "bias_walk", "lowpass"])?;
            FeedEntry::Drift { name: name(&o)?, filter: path(&o)?, bias_walk: walk(&o)?, lowpass: behind(&o)? }
        }
        "lqg" => {
            let o = object(&["longitudinal", "lateral", "recovery", "bias_walk"])?;
            FeedEntry::Lqg {
                name: name(&o)?,
                longitudinal: longitudinal(&o.required("longitudinal")?)?,
                lateral: lateral(&o.required("lateral")?)?,
                recovery: value(&o, "recovery", ANGLE, Range::Positive)?,
                bias_walk: walk(&o)?,
            }
        }
        _ => {
            let made_of = ["bias_walk", "wind_at_20ft", "airspeed", "schedule", "gyro"];
            let o = object(&[&["lowpass", "filter"], &made_of[..]].concat())?;
            if let Some(place) = o.optional("filter").and_then(|_| made_of.iter().find_map(|key| o.optional(key))) {
                return Err(place.error("does not go with `filter`, which was made already"));
            }
            FeedEntry::Airframe {
                name: name(&o)?,
                bias_walk: walk(&o)?,
                lowpass: behind(&o)?,
                filter: path(&o)?,
                schedule: schedule(&o)?,
                wind_at_20ft: value(&o, "wind_at_20ft", VELOCITY, Range::Positive)?,
                airspeed: value(&o, "airspeed", VELOCITY, Range::Positive)?,
                gyro: o.optional("gyro").map(|p| link(&p)).transpose()?,
            }
        }
    })
}

/// Airspeeds, two or more, in order. Errors: one, or out of order, or with an airspeed of its own.
fn schedule(o: &Object<'_>) -> Result<Vec<Measured>, KeyError> {
    let Some(place) = o.optional("schedule") else { return Ok(Vec::new()) };
    let speeds = place.list()?.into_iter().map(|p| Measured::from_place(&p, VELOCITY, Range::Positive));
    let speeds = speeds.collect::<Result<Vec<_>, _>>()?;
    if speeds.len() < 2 || speeds.windows(2).any(|pair| pair[0].si() >= pair[1].si()) {
        return Err(place.error("expected two airspeeds or more, the slowest first"));
    }
    match o.optional("airspeed") {
        Some(place) => Err(place.error("does not go with `schedule`, which has the airspeeds")),
        None => Ok(speeds),
    }
}

/// Names of feeds are all different. Errors: the first that stands twice.
pub(super) fn feeds(place: &Place<'_>) -> Result<Vec<FeedEntry>, KeyError> {
    let places = place.list()?;
    let feeds = places.iter().map(feed).collect::<Result<Vec<_>, _>>()?;
    for (i, feed) in feeds.iter().enumerate() {
        let name = feed.name();
        if let Some(first) = feeds[..i].iter().position(|earlier| earlier.name() == name) {
            return Err(
                places[i].error(format!("'{name}' is the name of feeds[{first}] too; give it a name of its own"))
            );
        }
    }
    Ok(feeds)
}
