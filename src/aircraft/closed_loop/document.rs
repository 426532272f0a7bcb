//! What `loop` says, as a document: deg, deg/s, dB and s, as people speak of loops.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::Serialize;

use super::analysis::{FeedResult, HalfResult, Steady, Step};
use super::flown::{Flown, Paired};
use super::modes::{LoopMode, least_damped};
use super::varied::{Optimized, Spread, Sweep};
use super::verdict::{Judgement, best, feed_points};
use crate::aircraft::airframe::levels::{CAUTION, criteria};
use crate::aircraft::airframe::modes::{Mode, ModeName};
use crate::aircraft::control::document::{LinearDocument, ReachDocument};
use crate::aircraft::flight::setting::Control;
use crate::aircraft::flight::{RateGains, Setting};

pub const FORMAT: &str = "kfdesign-loop/1";

/// What every feed does to the loop, and whether it keeps the criteria.
#[derive(Clone, Debug, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "Loop")]
pub struct LoopDocument {
    #[schemars(extend("const" = FORMAT))]
    pub format: &'static str,
    /// Of the program.
    pub version: &'static str,
    pub airplane: String,
    pub flight: FlightPoint,
    pub feeds: Vec<FeedDocument>,
    /// One per feed, limit and surface or axis.
    pub criteria: Vec<Judgement>,
    /// What would be unsafe although a margin looks good.
    pub warnings: Vec<String>,
    /// What each filter makes better and worse than the first feed.
    pub notes: Vec<String>,
    /// How surfaces reach the airplane's own motions and gyros see them; no filter changes the first.
    pub controllability: Vec<ReachDocument>,
    pub observability: Vec<ReachDocument>,
    /// What the levels of `handling` are worth.
    pub caution: &'static str,
    /// "pass" or "fail": all criteria together; "none" without any.
    pub verdict: &'static str,
    /// Of the feeds that keep every criterion, the one with the least surface rate; null: none keeps them.
    pub best: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sweep: Option<Sweep>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub spread: Option<Spread>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub optimized: Option<Optimized>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub flights: Option<Flown>,
    /// Differences of the rms of one flight between feeds, deg and deg/s.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub paired: Vec<Paired>,
}

/// Where and how it flies.
#[derive(Clone, Debug, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FlightPoint {
    /// m/s.
    pub airspeed: f64,
    /// m.
    pub altitude: f64,
    /// kt; absent without such turbulence.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub wind_at_20ft_kt: Option<f64>,
    /// Of the autopilot, Hz.
    pub rate_hz: f64,
    /// From the measurement to the servo, s.
    pub delay_s: f64,
    /// kq, ktheta, kp, kphi, kr, SI; absent where the autopilot has optimal gains.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gains: Option<BTreeMap<&'static str, f64>>,
}

#[derive(Clone, Debug, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "FeedResult")]
pub struct FeedDocument {
    pub name: String,
    /// raw, lowpass, notch, drift, airframe, lqg.
    #[serde(rename = "type")]
    pub kind: &'static str,
    pub pitch: HalfDocument,
    pub roll_yaw: HalfDocument,
}

/// One half of the motion. Of an unstable loop only its modes are known.
#[derive(Clone, Debug, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "Half")]
pub struct HalfDocument {
    pub stable: bool,
    /// Slowest first.
    pub modes: Vec<LoopModeDocument>,
    /// Of oscillations faster than 1.5 rad/s, those of filters included; null when there is none.
    pub least_damped: Option<LoopModeDocument>,
    pub margins: Vec<MarginDocument>,
    /// All commands of the half at once.
    pub multiloop: Option<MultiloopDocument>,
    /// By q, theta, elevator, elevator_rate | p, r, phi, aileron …; deg and deg/s.
    pub rms: BTreeMap<String, RmsDocument>,
    /// What the constant biases of the gyros cause, by rate and angle, deg and deg/s.
    pub offset: BTreeMap<String, f64>,
    /// Until a tenth of the angle's largest deviation is left, s; null when it stays.
    pub offset_removed_s: Option<f64>,
    /// What a filter knows of the drift of a gyro some time after its first measurement.
    pub known: Vec<KnownDocument>,
    /// Answer to a commanded angle.
    pub step: Option<StepDocument>,
    /// Largest values after a 1 − cos gust, deg and deg/s: that of the flight, or one of 3 m/s.
    pub gust_peaks: BTreeMap<String, f64>,
    /// Levels of MIL-F-8785C by the modes of the closed loop, phase B.
    pub handling: Vec<HandlingDocument>,
}

#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "LoopMode")]
pub struct LoopModeDocument {
    /// short_period, phugoid, dutch_roll, roll, spiral, oscillation, real of the airframe; servo, gust, sensor, filter.
    pub name: &'static str,
    /// [real, imaginary] in 1/s, of a pair the one above the axis.
    pub eigenvalue: [f64; 2],
    /// rad/s.
    pub frequency: f64,
    pub damping: f64,
}

/// Of one surface, the others closed; what is null has no limit.
#[derive(Clone, Debug, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "Margin")]
pub struct MarginDocument {
    pub surface: &'static str,
    /// Gain that can be added.
    pub gain_db: Option<f64>,
    /// rad/s.
    pub gain_frequency: Option<f64>,
    /// Gain that can be lost, above zero.
    pub gain_reduction_db: Option<f64>,
    /// Alone it says little of a rate loop: see disk.
    pub phase_deg: Option<f64>,
    /// rad/s.
    pub phase_frequency: Option<f64>,
    pub delay_s: Option<f64>,
    /// Disk margin of skew 0.
    pub disk: f64,
    /// rad/s.
    pub disk_frequency: f64,
    pub sensitivity_peak: f64,
}

#[derive(Clone, Debug, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "Multiloop")]
pub struct MultiloopDocument {
    pub disk: f64,
    /// rad/s.
    pub disk_frequency: f64,
    /// Largest singular value of S.
    pub sensitivity_peak: f64,
}

/// Root mean square and what each source alone makes of it.
#[derive(Clone, Copy, Debug, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "LoopRms")]
pub struct RmsDocument {
    pub all: f64,
    pub gust: f64,
    pub gyro_white: f64,
    pub drift: f64,
    pub reference: f64,
}

#[derive(Clone, Debug, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "Known")]
pub struct KnownDocument {
    pub filter: String,
    /// x, y or z.
    pub gyro: &'static str,
    /// Standard deviation of the whole drift after 10 s and 100 s, deg/s.
    pub after_10_s: f64,
    pub after_100_s: f64,
}

#[derive(Clone, Copy, Debug, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "StepResponse")]
pub struct StepDocument {
    /// 10 to 90 % of the value after 10 s.
    pub rise_s: Option<f64>,
    /// Part of it.
    pub overshoot: f64,
    /// Within 5 % of it from then on; null when not in 10 s.
    pub settling_s: Option<f64>,
    /// Part of the command that is there after 10 s.
    pub reached: f64,
}

#[derive(Clone, Debug, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "Handling")]
pub struct HandlingDocument {
    pub name: &'static str,
    pub unit: &'static str,
    pub value: Option<f64>,
    /// 1 to 3, 4 beyond Level 3; null: not judged.
    pub level: Option<u8>,
}

impl From<&LoopMode> for LoopModeDocument {
    fn from(mode: &LoopMode) -> Self {
        LoopModeDocument {
            name: mode.name,
            eigenvalue: [mode.eigenvalue.0, mode.eigenvalue.1],
            frequency: mode.frequency(),
            damping: mode.damping(),
        }
    }
}

/// The whole document; `linear` is that of the trim.
pub fn document(
    (setting, control): (&Setting, &Control),
    linear: &LinearDocument,
    results: &[FeedResult],
    criteria: Vec<Judgement>,
    said: (Vec<String>, Vec<String>),
) -> LoopDocument {
    let verdict = match (criteria.is_empty(), criteria.iter().all(|criterion| criterion.pass)) {
        (true, _) => "none",
        (false, true) => "pass",
        (false, false) => "fail",
    };
    let best = best(&feed_points(results, &criteria)).map(|feed| feed.name.clone());
    let feeds = results.iter().map(|result| FeedDocument {
        name: result.name.clone(),
        kind: result.kind.name(),
        pitch: half(setting, result, 0),
        roll_yaw: half(setting, result, 1),
    });
    let gains = match control {
        Control::Gains(gains) => Some(RateGains::NAMES.into_iter().zip(gains.values()).collect()),
        Control::Regulator(_) => None,
    };
    // by all surfaces of a half, and without the full model
    let of_half = |reach: &&ReachDocument| reach.model != "full";
    LoopDocument {
        format: FORMAT,
        version: env!("CARGO_PKG_VERSION"),
        airplane: setting.airplane.name.clone(),
        flight: FlightPoint {
            airspeed: setting.trim.airspeed(),
            altitude: setting.request.altitude,
            wind_at_20ft_kt: setting.wind_at_20ft.map(|wind| wind / KNOT),
            rate_hz: setting.rate,
            delay_s: setting.delay as f64 * setting.interval(),
            gains,
        },
        feeds: feeds.collect(),
        criteria,
        warnings: said.0,
        notes: said.1,
        controllability: linear.controllability.iter().filter(of_half).cloned().collect(),
        observability: linear.observability.iter().filter(of_half).cloned().collect(),
        caution: CAUTION,
        verdict,
        best,
        sweep: None,
        spread: None,
        optimized: None,
        flights: None,
        paired: Vec::new(),
    }
}

/// m/s.
pub const KNOT: f64 = 1852.0 / 3600.0;

fn half(setting: &Setting, result: &FeedResult, number: usize) -> HalfDocument {
    let half = &result.halves[number];
    let steady = half.steady.as_ref();
    let named = |values: &[(String, f64)]| values.iter().map(|(name, x)| (name.clone(), x.to_degrees())).collect();
    HalfDocument {
        stable: steady.is_some(),
        modes: half.modes.iter().map(LoopModeDocument::from).collect(),
        least_damped: least_damped(&half.modes).map(LoopModeDocument::from),
        margins: steady.map_or_else(Vec::new, |steady| margins(half, steady)),
        multiloop: steady.map(|steady| MultiloopDocument {
            disk: steady.margins.multiloop.margin,
            disk_frequency: steady.margins.multiloop.frequency,
            sensitivity_peak: steady.margins.sensitivity.value,
        }),
        rms: steady.map_or_else(BTreeMap::new, rms),
        offset: steady.map_or_else(BTreeMap::new, |steady| named(&steady.offset)),
        offset_removed_s: steady.and_then(|steady| steady.removed),
        known: half
            .known
            .iter()
            .map(|known| KnownDocument {
                filter: known.filter.clone(),
                gyro: ["x", "y", "z"][known.gyro],
                after_10_s: known.sigma[0].to_degrees(),
                after_100_s: known.sigma[1].to_degrees(),
            })
            .collect(),
        step: steady.map(|steady| {
            let Step { rise, overshoot, settling, reached } = steady.step;
            StepDocument { rise_s: rise, overshoot, settling_s: settling, reached }
        }),
        gust_peaks: steady.map_or_else(BTreeMap::new, |steady| named(&steady.gust_peaks)),
        handling: handling(setting, half, number),
    }
}

fn margins(half: &HalfResult, steady: &Steady) -> Vec<MarginDocument> {
    let each = half.circuit.half.surfaces().iter().zip(&steady.margins.single);
    let one = |(surface, margins): (&&'static str, &crate::aircraft::control::margins::Margins)| MarginDocument {
        surface,
        gain_db: margins.gain_up.map(|limit| limit.decibels()),
        gain_frequency: margins.gain_up.map(|limit| limit.frequency),
        gain_reduction_db: margins.gain_down.map(|limit| -limit.decibels()).filter(|db| db.is_finite()),
        phase_deg: margins.phase().map(|crossover| crossover.phase.to_degrees()),
        phase_frequency: margins.phase().map(|crossover| crossover.frequency),
        delay_s: margins.delay(),
        disk: margins.disk.margin,
        disk_frequency: margins.disk.frequency,
        sensitivity_peak: margins.sensitivity.value,
    };
    each.map(one).collect()
}

fn rms(steady: &Steady) -> BTreeMap<String, RmsDocument> {
    let one = |rms: &super::analysis::Rms| {
        let [gust, gyro_white, drift, reference] = rms.by.map(f64::to_degrees);
        (rms.name.clone(), RmsDocument { all: rms.all.to_degrees(), gust, gyro_white, drift, reference })
    };
    steady.rms.iter().map(one).collect()
}

/// Criteria of the airplane's own modes, with those of the closed loop in their place.
fn handling(setting: &Setting, half: &HalfResult, number: usize) -> Vec<HandlingDocument> {
    let names = [ModeName::ShortPeriod, ModeName::Phugoid, ModeName::DutchRoll, ModeName::Roll, ModeName::Spiral];
    let modes: Vec<Mode> = half
        .modes
        .iter()
        .filter_map(|mode| {
            let name = names.into_iter().find(|name| name.text() == mode.name)?;
            Some(Mode { name, eigenvalue: mode.eigenvalue })
        })
        .collect();
    let (along, across): (&[Mode], &[Mode]) = if number == 0 { (&modes, &[]) } else { (&[], &modes) };
    criteria(&setting.airplane, &setting.trim, &setting.models, [along, across], None)
        .into_iter()
        // phase B is cruise; a time to bank is that of the open loop
        .filter(|criterion| criterion.category.name() == "B" && criterion.name != "roll_performance")
        .filter(|criterion| criterion.value.is_some())
        .map(|criterion| HandlingDocument {
            name: criterion.name,
            unit: criterion.unit,
            value: criterion.value,
            level: criterion.level,
        })
        .collect()
}
