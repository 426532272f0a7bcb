//! A flight document from its text to a verdict.

use std::path::Path;

use super::LoopError;
use super::analysis::{FeedResult, analyse, of_feed};
use super::document::{LoopDocument, document};
use super::feed::{Designed, Feed, Kind, feeds};
use super::half::Half;
use super::half_feed::raw;
use super::{verdict, warnings};
use crate::aircraft::control::document::Linearized;
use crate::aircraft::flight::document::{CriteriaEntry, FeedEntry};
use crate::aircraft::flight::setting::{Control, same_rate};
use crate::aircraft::flight::{FlightDocument, RateGains, Setting};
use crate::units::digits;

/// A loop that was judged, with everything that figures and further questions need.
#[derive(Clone, Debug)]
pub struct Judged {
    /// For which gains and filters were made.
    pub setting: Setting,
    /// In which they fly.
    pub truth: Setting,
    pub feeds: Vec<Feed>,
    pub criteria: CriteriaEntry,
    pub results: Vec<FeedResult>,
    /// The loop without a filter.
    pub raw: FeedResult,
    pub document: LoopDocument,
}

/// The loop without a filter.
pub(super) fn without(setting: &Setting) -> Feed {
    Feed {
        name: "raw".into(),
        kind: Kind::Raw,
        halves: Half::BOTH.map(|half| raw(setting, half)),
        designed: Designed::default(),
        of_true_states: None,
    }
}

impl Judged {
    /// The feeds of a document around its own airplane, or around that of `truth`; paths are taken from the folders.
    ///
    /// Errors: what cannot be read or does not fit together, a gain of the wrong sign, and, where gains and filters fly
    /// in what they were made for, an unstable loop.
    pub fn new(
        flight: &FlightDocument,
        folder: &Path,
        truth: Option<(&FlightDocument, &Path)>,
    ) -> Result<Judged, LoopError> {
        let setting = Setting::new(flight, folder)?;
        signs(&setting)?;
        let other = truth.map(|(flight, folder)| Setting::new(flight, folder)).transpose()?;
        if let Some(other) = &other
            && !same_rate(other.rate, setting.rate)
        {
            return Err(LoopError(format!(
                "truth: its autopilot has {} Hz, the flight's {} Hz; a loop is judged at one rate",
                digits(other.rate),
                digits(setting.rate)
            )));
        }
        let only_raw = [FeedEntry::Raw { name: None }];
        let entries = if flight.feeds.is_empty() { &only_raw[..] } else { &flight.feeds };
        let at = other.as_ref().unwrap_or(&setting).trim.airspeed();
        let feeds = feeds(&setting, entries, folder, at)?;
        let criteria = flight.criteria.clone().unwrap_or_default();
        for limit in &criteria.0 {
            let Some((name, _)) = &limit.not_worse_than else { continue };
            if !feeds.iter().any(|feed| feed.name == *name) {
                let known: Vec<&str> = feeds.iter().map(|feed| feed.name.as_str()).collect();
                return Err(LoopError(format!(
                    "criteria.{}.not_worse_than: no feed is called '{name}'; there are {}",
                    limit.criterion.name,
                    known.join(", ")
                )));
            }
        }
        let own = other.is_none();
        Judged::of(setting.clone(), other.unwrap_or(setting), feeds, criteria, own)
    }

    /// The same of parts; `stable`: an unstable loop is an error, not a verdict.
    pub fn of(
        setting: Setting,
        truth: Setting,
        feeds: Vec<Feed>,
        criteria: CriteriaEntry,
        stable: bool,
    ) -> Result<Judged, LoopError> {
        let results = analyse(&setting, &truth, &feeds)?;
        if let Some((result, (half, mode))) =
            results.iter().find_map(|result| Some((result, result.unstable()?))).filter(|_| stable)
        {
            return Err(LoopError(format!(
                "feed '{}': the loop of {} is unstable: {} of {} rad/s grows, damping {}; lower the gains, \
                 or filter less",
                result.name,
                half.title(),
                mode.name.replace('_', " "),
                digits(mode.frequency()),
                digits(mode.damping())
            )));
        }
        let known = results.iter().find(|result| result.kind == Kind::Raw).cloned();
        let raw = known.map_or_else(|| of_feed(&setting, &truth, &without(&setting)), Ok)?;
        let mut warned = warnings::warnings(&setting, &truth, &feeds, &results, &raw)?;
        for (result, (half, mode)) in results.iter().filter_map(|result| Some((result, result.unstable()?))) {
            warned.insert(
                0,
                format!(
                    "{}: the loop of {} is unstable: {} of {} rad/s grows, damping {}",
                    result.name,
                    half.title(),
                    mode.name.replace('_', " "),
                    digits(mode.frequency()),
                    digits(mode.damping())
                ),
            );
        }
        let notes = warnings::notes(&results, &raw);
        let judgements = verdict::judge(&results.iter().collect::<Vec<_>>(), &criteria);
        let linear = Linearized::new(&truth.airplane, truth.trim)?.document(&truth.airplane, &truth.request, None)?;
        let document = document((&truth, &setting.control), &linear, &results, judgements, (warned, notes));
        Ok(Judged { setting, truth, feeds, criteria, results, raw, document })
    }

    /// No criterion fails.
    pub fn passes(&self) -> bool {
        self.document.verdict != "fail"
    }
}

/// Every gain works against the motion it is to damp or hold. Errors: the first that drives it on, by name.
fn signs(setting: &Setting) -> Result<(), LoopError> {
    let Control::Gains(gains) = &setting.control else { return Ok(()) };
    let (along, across) = (&setting.models.longitudinal, &setting.models.lateral);
    let input = |model: &crate::aircraft::airframe::linear::LinearModel, name: &str, row: usize| {
        model.inputs.iter().position(|(known, _)| *known == name).map_or(0.0, |j| model.b[(row, j)])
    };
    // the derivative that the command δ = ± gain × motion meets, with its sign in the law
    let meets = [
        ("pitch rate", "elevator", input(along, "elevator", 2)),
        ("pitch angle", "elevator", input(along, "elevator", 2)),
        ("roll rate", "aileron", -input(across, "aileron", 1)),
        ("bank angle", "aileron", -input(across, "aileron", 1)),
        ("yaw rate", "rudder", input(across, "rudder", 2)),
    ];
    let names = RateGains::NAMES.iter().zip(gains.values());
    for ((name, gain), (motion, surface, derivative)) in names.zip(meets) {
        if gain * derivative > 0.0 {
            let sign = if derivative < 0.0 { "positive" } else { "negative" };
            return Err(LoopError(format!(
                "autopilot.gains.{name}: found {gain}, which drives the {motion} on instead of holding it, by what the \
                 {surface} of this airplane does; expected a {sign} gain"
            )));
        }
    }
    Ok(())
}
