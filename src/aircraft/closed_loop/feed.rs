//! What stands between the sensors and the gains.
//!
//! In every half a feed is a linear system: in go what is measured of the four states of the airframe (velocities as
//! they are, rates by the gyros, the angle by the attitude reference) and then the commands of this sample; out come
//! four estimates. A sample goes: measure, filter, command; so the estimates may rest on the measurement of now but
//! not on the command of now.

use super::LoopError;
use super::filters::{lowpass, notch};
use super::half::Half;
use super::half_feed::{HalfFeed, raw};
use super::kalman;
use super::sensors::{BIAS_WALK, Sensors};
use crate::aircraft::control::response::StateSpace;
use crate::aircraft::flight::Setting;
use crate::aircraft::flight::document::{FeedEntry, LowpassEntry};
use crate::aircraft::flight::setting::gyro;
use crate::params::Measured;
use crate::units::digits;
use std::path::Path;

/// What kind of feed it is, for what is said of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    Raw,
    Lowpass,
    Notch,
    Drift,
    Airframe,
    Lqg,
}

impl Kind {
    /// As in documents.
    pub fn name(self) -> &'static str {
        match self {
            Kind::Raw => "raw",
            Kind::Lowpass => "lowpass",
            Kind::Notch => "notch",
            Kind::Drift => "drift",
            Kind::Airframe => "airframe",
            Kind::Lqg => "lqg",
        }
    }
}

/// A feed of both halves.
#[derive(Clone, Debug)]
pub struct Feed {
    pub name: String,
    pub kind: Kind,
    /// Pitch, roll and yaw.
    pub halves: [HalfFeed; 2],
    /// What it was designed for, where that is not the flight itself.
    pub designed: Designed,
    /// Of optimal gains: the disk margins of each half's surfaces on the true states.
    pub of_true_states: Option<[Vec<f64>; 2]>,
}

/// The conditions a filter was made for; absent what is that of the flight.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Designed {
    /// m/s.
    pub airspeed: Option<f64>,
    /// m/s.
    pub wind_at_20ft: Option<f64>,
}

/// Makes the feeds of a document, to be flown at the airspeed `at` (m/s), which a schedule knows; paths are taken from
/// `folder`. Errors: one line with the key.
pub fn feeds(setting: &Setting, entries: &[FeedEntry], folder: &Path, at: f64) -> Result<Vec<Feed>, LoopError> {
    let airspeed = at;
    let all = entries.iter().enumerate().map(|(i, entry)| {
        let at = |e: LoopError| LoopError(format!("feeds[{i}]{}{}", if e.0.starts_with('.') { "" } else { ": " }, e.0));
        feed(setting, entry, folder, airspeed).map_err(at)
    });
    all.collect()
}

/// One of them.
pub fn feed(setting: &Setting, entry: &FeedEntry, folder: &Path, at: f64) -> Result<Feed, LoopError> {
    let mut of_true_states = None;
    let mut designed = Designed::default();
    let interval = setting.interval();
    let (kind, halves) = match entry {
        FeedEntry::Raw { .. } => (Kind::Raw, both(|half| Ok(raw(setting, half)))?),
        FeedEntry::Lowpass { order, corner, .. } => {
            below_half(".corner", corner.si(), setting.rate)?;
            let filter = lowpass(*order, corner.si(), interval);
            (Kind::Lowpass, both(|half| Ok(raw(setting, half).behind(&[filter.clone(), filter.clone()], half)))?)
        }
        FeedEntry::Notch { frequency, width, .. } => {
            (Kind::Notch, notches(setting, frequency.as_ref(), width.as_ref())?)
        }
        FeedEntry::Drift { filter, bias_walk, lowpass, .. } => {
            let walk = bias_walk.as_ref().map_or(BIAS_WALK, Measured::si);
            let make = |half: Half| match filter {
                None => kalman::drift(setting, half, walk),
                Some(path) => kalman::drift_of(setting, half, walk, &folder.join(path)),
            };
            (Kind::Drift, both(|half| low(make(half)?, lowpass.as_ref(), setting, half))?)
        }
        FeedEntry::Airframe { filter: Some(path), lowpass, .. } => {
            let path = folder.join(path);
            designed.airspeed = kalman::airspeed_of(&path)?;
            let make = |half: Half| kalman::airframe_of(setting, half, &path);
            (Kind::Airframe, both(|half| low(make(half)?, lowpass.as_ref(), setting, half))?)
        }
        FeedEntry::Lqg { longitudinal, lateral, recovery, bias_walk, .. } => {
            let walk = bias_walk.as_ref().map_or(BIAS_WALK, Measured::si);
            let recovery = recovery.as_ref().map_or(0.0, Measured::si);
            let along = (&longitudinal.states, &[longitudinal.elevator][..]);
            let across = (&lateral.states, &[lateral.aileron, lateral.rudder][..]);
            let (pitch, of_pitch) = kalman::lqg(setting, Half::Pitch, walk, along, recovery)?;
            let (roll_yaw, of_roll_yaw) = kalman::lqg(setting, Half::RollYaw, walk, across, recovery)?;
            of_true_states = Some([of_pitch, of_roll_yaw]);
            (Kind::Lqg, [pitch, roll_yaw])
        }
        FeedEntry::Airframe { bias_walk, wind_at_20ft, schedule, gyro: other, lowpass, .. } if !schedule.is_empty() => {
            let walk = bias_walk.as_ref().map_or(BIAS_WALK, Measured::si);
            let one = |speed: &Measured| {
                let of = setting.designed_for(Some(speed.si()), wind_at_20ft.as_ref().map(Measured::si));
                let mut of = of.map_err(|e| LoopError(e.0.replace(".airspeed", ".schedule")))?;
                if let Some(linked) = other {
                    of.gyro = Some(gyro(linked, ".gyro", folder)?);
                }
                Ok(of)
            };
            let settings = schedule.iter().map(one).collect::<Result<Vec<Setting>, LoopError>>()?;
            let make = |half: Half| kalman::scheduled(&settings, at, half, walk);
            (Kind::Airframe, both(|half| low(make(half)?, lowpass.as_ref(), setting, half))?)
        }
        FeedEntry::Airframe { bias_walk, wind_at_20ft, airspeed, gyro: other, lowpass, .. } => {
            let walk = bias_walk.as_ref().map_or(BIAS_WALK, Measured::si);
            let si = |m: &Option<Measured>| m.as_ref().map(Measured::si);
            designed = Designed { airspeed: si(airspeed), wind_at_20ft: si(wind_at_20ft) };
            let mut of = setting.designed_for(designed.airspeed, designed.wind_at_20ft)?;
            if let Some(linked) = other {
                of.gyro = Some(gyro(linked, ".gyro", folder)?);
            }
            (Kind::Airframe, both(|half| low(kalman::airframe(&of, half, walk)?, lowpass.as_ref(), setting, half))?)
        }
    };
    Ok(Feed { name: entry.name(), kind, halves, designed, of_true_states })
}

fn both(make: impl Fn(Half) -> Result<HalfFeed, LoopError>) -> Result<[HalfFeed; 2], LoopError> {
    Ok([make(Half::Pitch)?, make(Half::RollYaw)?])
}

fn below_half(key: &str, frequency: f64, rate: f64) -> Result<(), LoopError> {
    if frequency < 0.5 * rate {
        return Ok(());
    }
    Err(LoopError(format!(
        "{key}: {} Hz is not below half the {} Hz of the autopilot; lower it, or raise autopilot.rate",
        digits(frequency),
        digits(rate)
    )))
}

fn notches(
    setting: &Setting,
    frequency: Option<&Measured>,
    width: Option<&Measured>,
) -> Result<[HalfFeed; 2], LoopError> {
    both(|half| {
        let gyros = Sensors::new(setting, half)?.gyros;
        let filter = |i: usize| -> Result<StateSpace, LoopError> {
            let line = gyros.get(i).and_then(|gyro| gyro.line);
            let at = frequency.map(Measured::si).or(line).ok_or_else(|| {
                LoopError(
                    ".frequency: missing, and the gyro's parameters have no oscillation; give it, for example \"30 Hz\""
                        .into(),
                )
            })?;
            below_half(".frequency", at, setting.rate)?;
            // half the frequency is what autopilots set when nobody says more
            Ok(notch(at, width.map_or(0.5 * at, Measured::si), setting.interval()))
        };
        let filters = (0..half.rates().len()).map(filter).collect::<Result<Vec<_>, _>>()?;
        Ok(raw(setting, half).behind(&filters, half))
    })
}

/// The feed with a low-pass behind it, where there is one.
fn low(feed: HalfFeed, entry: Option<&LowpassEntry>, setting: &Setting, half: Half) -> Result<HalfFeed, LoopError> {
    let Some(LowpassEntry { order, corner }) = entry else { return Ok(feed) };
    below_half(".lowpass.corner", corner.si(), setting.rate)?;
    let filter = lowpass(*order, corner.si(), setting.interval());
    Ok(feed.behind(&[filter.clone(), filter], half))
}
