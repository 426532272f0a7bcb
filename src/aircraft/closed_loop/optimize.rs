//! Corner and gains by which a stated cost is least while the criteria hold and the raw loop's margins stay.
//!
//! Each feed has its own: ln of the corner of its low-pass, where it has one, and ln of a factor on each gain.
//! Sequential quadratic programming with differences of exact covariances and margins; a loop that is unstable is no
//! place at all.

use std::collections::BTreeMap;
use std::path::Path;

use super::LoopError;
use super::analysis::{FeedResult, of_feed};
use super::circuit::law;
use super::document::KNOT;
use super::feed::{Feed, feed};
use super::flights::flown;
use super::flown::Paired;
use super::half::Half;
use super::judged::{Judged, without};
use super::varied::{FeedPoint, HeldOut, Moved, Optimized, OptimizedFeed};
use super::verdict::{Judgement, feed_points, judge};
use crate::aircraft::flight::document::{CriteriaEntry, FeedEntry, OptimizeEntry};
use crate::aircraft::flight::setting::Control;
use crate::aircraft::flight::{Plan, RateGains, Setting};
use crate::numerics::optimize::{Problem, compass, look, minimize};
use crate::params::Measured;
use crate::units::{Unit, digits};
use rayon::prelude::*;

/// Gains move by no more than this factor: beyond it the airplane flies by another autopilot.
const FURTHEST: f64 = 3.0;
/// A limit is kept with this much to spare, so that rounding of the search does not break it.
const RESERVE: f64 = 1e-3;
/// How far a limit is missed that an unstable loop misses: more than any loop that is judged.
const UNSTABLE: f64 = 10.0;
/// First and last step of the search within the limits, in ln: a tenth, and what no servo shows.
const FIRST: f64 = 0.1;
const LAST: f64 = 0.002;
/// Steps of differences in ln: well above the rounding of margins, 1e-6, and small for curves of a decade.
const STEP: f64 = 1e-3;

/// One search: a feed of the document in a loop.
struct Search<'a> {
    judged: &'a Judged,
    entry: &'a FeedEntry,
    folder: &'a Path,
    wanted: &'a OptimizeEntry,
    gains: RateGains,
}

impl Search<'_> {
    /// The corner of the low-pass, Hz.
    fn corner(&self) -> Option<f64> {
        match self.entry {
            FeedEntry::Lowpass { corner, .. } => Some(corner.si()),
            FeedEntry::Drift { lowpass: Some(low), .. } | FeedEntry::Airframe { lowpass: Some(low), .. } => {
                Some(low.corner.si())
            }
            _ => None,
        }
    }

    fn start(&self) -> Vec<f64> {
        self.corner().map(f64::ln).into_iter().chain([0.0; RateGains::NAMES.len()]).collect()
    }

    fn bounds(&self) -> Vec<(f64, f64)> {
        // below a fiftieth of the rate no rate loop of that rate lives; above 0.45 of it a low-pass is none
        let corner = [0.02, 0.45].map(|share: f64| (share * self.judged.setting.rate).ln());
        let gains = [(-FURTHEST.ln(), FURTHEST.ln()); RateGains::NAMES.len()];
        self.corner().map(|_| (corner[0], corner[1])).into_iter().chain(gains).collect()
    }

    /// Corner and gains at a place of the search.
    fn at(&self, x: &[f64]) -> (Option<f64>, RateGains) {
        let first = usize::from(self.corner().is_some());
        let factor = |i: usize| x[first + i].exp();
        let values = self.gains.values();
        let gains = RateGains::of(std::array::from_fn(|i| values[i] * factor(i)), self.gains.washout);
        (self.corner().map(|_| x[0].exp()), gains)
    }

    /// The feed with this corner and gains of its own.
    fn feed(&self, x: &[f64]) -> Result<Feed, LoopError> {
        let (corner, gains) = self.at(x);
        let mut entry = self.entry.clone();
        if let Some(corner) = corner {
            let own = match &mut entry {
                FeedEntry::Lowpass { corner, .. } => Some(corner),
                FeedEntry::Drift { lowpass, .. } | FeedEntry::Airframe { lowpass, .. } => {
                    lowpass.as_mut().map(|low| &mut low.corner)
                }
                _ => None,
            };
            own.into_iter().for_each(|own| *own = Measured::from_si(corner, None, Unit::hertz()));
        }
        let setting = &self.judged.setting;
        let mut made = feed(setting, &entry, self.folder, self.judged.truth.trim.airspeed())?;
        made.name = self.entry.name();
        let with = Setting { control: Control::Gains(gains), ..setting.clone() };
        for (half, own) in Half::BOTH.into_iter().zip(&mut made.halves) {
            own.law = Some(law(&with, half));
        }
        Ok(made)
    }

    /// The loop of a place in the airplane of `truth`, beside that without a filter, whose gains are as they were.
    fn look(&self, x: &[f64], truth: &Setting, raw: &FeedResult) -> Option<Looked> {
        let feed = self.feed(x).ok()?;
        let result = of_feed(&self.judged.setting, truth, &feed).ok()?;
        if result.unstable().is_some() {
            return None;
        }
        let others = self.judged.results.iter().filter(|other| other.name != result.name);
        let all: Vec<&FeedResult> = others.chain([&result]).collect();
        let judged = judge(&all, &self.judged.criteria);
        let own: Vec<Judgement> = judged.into_iter().filter(|judgement| judgement.feed == result.name).collect();
        let mut misses: Vec<f64> = own.iter().map(missed).collect();
        let [ours, theirs] = [&result, raw].map(|result| feed_points(std::slice::from_ref(result), &[]).remove(0));
        let kept = 1.0 - self.wanted.margins_lost;
        for (map, of_raw) in [(&ours.disk, &theirs.disk), (&ours.damping, &theirs.damping)] {
            misses.extend(map.iter().filter_map(|(name, value)| Some(kept - value / of_raw.get(name)?)));
        }
        let angles = |point: &FeedPoint| point.angle.values().map(|a| a * a).sum::<f64>().sqrt();
        let activity = |point: &FeedPoint| point.activity.unwrap_or(f64::NAN);
        let (rate, attitude) = (activity(&ours), angles(&ours));
        let cost = self.wanted.surface_rate * (rate / activity(&theirs)).powi(2)
            + self.wanted.attitude * (attitude / angles(&theirs)).powi(2);
        let least = |map: &BTreeMap<&'static str, f64>| map.values().copied().fold(f64::INFINITY, f64::min);
        Some(Looked { cost, rate, attitude, disk: least(&ours.disk), damping: least(&ours.damping), misses })
    }

    fn run(&self) -> Result<(OptimizedFeed, Feed), LoopError> {
        let (truth, raw) = (&self.judged.truth, &self.judged.raw);
        let start = self.start();
        let name = self.entry.name();
        let before = self.look(&start, truth, raw);
        let before =
            before.ok_or_else(|| LoopError(format!("optimize: feed '{name}': the loop is unstable as it is")))?;
        let count = before.misses.len();
        let values = |points: &[Vec<f64>]| -> Vec<Vec<f64>> {
            let one = |x: &Vec<f64>| match self.look(x, truth, raw) {
                Some(found) => [found.cost].into_iter().chain(found.misses.iter().map(|m| m + RESERVE)).collect(),
                None => vec![UNSTABLE; count + 1],
            };
            points.par_iter().map(one).collect()
        };
        let steps = vec![STEP; start.len()];
        let problem = Problem {
            look: &|x, _, sloped| look(values, x, &steps, sloped),
            constraints: count,
            f_abs: 1e-5,
            worth: 1e-4,
            // it only has to come near: the steps below go to the end
            evaluations: 30,
            rounds: 1,
            ..Problem::default()
        };
        let found = minimize(&problem, &start, &self.bounds());
        // the least of several motions has kinks, at which differences end; steps go on from there within the limits
        let costs = |points: &[Vec<f64>]| -> Vec<f64> {
            let one = |x: &Vec<f64>| self.look(x, truth, raw).filter(Looked::keeps).map_or(f64::INFINITY, |l| l.cost);
            points.par_iter().map(one).collect()
        };
        let both = costs(&[start.clone(), found.x.clone()]);
        let from = if both[0] < both[1] { &start } else { &found.x };
        let (end, cost) = compass(costs, from, &self.bounds(), FIRST, LAST);
        // where nothing keeps the limits, what comes nearest to them is shown
        let x = if cost.is_finite() { end } else { found.x };
        let after = self.look(&x, truth, raw);
        let (x, after) = after.map_or((start.clone(), before.clone()), |after| (x, after));
        let ((corner, gains), (corner_before, gains_before)) = (self.at(&x), self.at(&start));
        let moved = |of: fn(&Looked) -> f64| Moved { from: of(&before), to: of(&after) };
        let each = RateGains::NAMES.iter().zip(gains_before.values().into_iter().zip(gains.values()));
        let held_out = self.held_out(&start, &x)?;
        let optimized = OptimizedFeed {
            feed: name,
            corner: corner_before.zip(corner).map(|(from, to)| Moved { from, to }),
            gains: each.map(|(name, (from, to))| (*name, Moved { from, to })).collect(),
            cost: moved(|l| l.cost),
            surface_rate: moved(|l| l.rate),
            attitude: moved(|l| l.attitude),
            disk: moved(|l| l.disk),
            damping: moved(|l| l.damping),
            passes: after.keeps(),
            held_out,
        };
        Ok((optimized, self.feed(&x)?))
    }

    /// Before and after in the wind that the search has not seen.
    fn held_out(&self, start: &[f64], x: &[f64]) -> Result<Option<HeldOut>, LoopError> {
        let Some(own) = self.judged.truth.wind_at_20ft else { return Ok(None) };
        let wind = self.wanted.held_out_wind.as_ref().map_or(2.0 * own, Measured::si);
        let truth = self.judged.truth.designed_for(None, Some(wind))?;
        let raw = of_feed(&self.judged.setting, &truth, &without(&self.judged.setting))?;
        let looked = [start, x].map(|x| self.look(x, &truth, &raw));
        let [Some(before), Some(after)] = looked else { return Ok(None) };
        let cost = Moved { from: before.cost, to: after.cost };
        Ok(Some(HeldOut { wind_at_20ft: wind / KNOT, cost, passes: after.keeps() }))
    }
}

/// What is known of a place.
#[derive(Clone, Debug)]
struct Looked {
    cost: f64,
    rate: f64,
    attitude: f64,
    disk: f64,
    damping: f64,
    /// By how much each limit is missed, as a share of it; below zero where it is kept.
    misses: Vec<f64>,
}

impl Looked {
    fn keeps(&self) -> bool {
        self.misses.iter().all(|miss| *miss <= 0.0)
    }
}

fn missed(judgement: &Judgement) -> f64 {
    let over = |value: f64| (value - judgement.limit) / judgement.limit.abs().max(f64::MIN_POSITIVE);
    match (judgement.value, judgement.pass) {
        (Some(value), true) => -over(value).abs(),
        (Some(value), false) => over(value).abs(),
        // without a limit to it, or without a value
        (None, true) => -1.0,
        (None, false) => UNSTABLE,
    }
}

/// Every feed with corner and gains of its own, and these feeds; those with gains of their own already are left out.
/// Errors: the autopilot has no gains; a loop that is unstable as it is.
pub fn optimize(
    judged: &Judged,
    entries: &[FeedEntry],
    folder: &Path,
    wanted: &OptimizeEntry,
) -> Result<(Optimized, Vec<Feed>), LoopError> {
    let Control::Gains(gains) = judged.setting.control else {
        return Err(LoopError("optimize: the autopilot has no gains that could be moved; give autopilot.gains".into()));
    };
    let entries = entries.iter().filter(|entry| !matches!(entry, FeedEntry::Lqg { .. }));
    let found = entries.map(|entry| Search { judged, entry, folder, wanted, gains }.run());
    let found: Vec<(OptimizedFeed, Feed)> = found.collect::<Result<_, _>>()?;
    let kept = found.iter().filter(|(feed, _)| feed.passes);
    let best = kept.min_by(|a, b| a.0.cost.to.total_cmp(&b.0.cost.to)).map(|(feed, _)| feed);
    let optimized = Optimized {
        cost: format!(
            "{} (surface rates)^2 + {} (pitch and bank)^2, each over that of the raw gyro with the gains as they were",
            digits(wanted.surface_rate),
            digits(wanted.attitude)
        ),
        kept: format!(
            "every criterion, and disk margins and damping of the raw loop but for {} %",
            digits(100.0 * wanted.margins_lost)
        ),
        best: best.map(|feed| feed.feed.clone()),
        gains: best.map(|feed| pasted(feed, gains.washout)),
        feeds: found.iter().map(|(feed, _)| feed.clone()).collect(),
        flights: Vec::new(),
    };
    Ok((optimized, found.into_iter().map(|(_, feed)| feed).collect()))
}

/// Flights of these feeds beside the raw gyro with the gains as they were. Errors: a flight that cannot be flown.
pub fn again(judged: &Judged, feeds: Vec<Feed>, plan: &Plan, runs: u64, seed: u64) -> Result<Vec<Paired>, LoopError> {
    let mut first = without(&judged.setting);
    first.name = "raw, gains as they were".into();
    let feeds = std::iter::once(first).chain(feeds).collect();
    let (setting, truth) = (judged.setting.clone(), judged.truth.clone());
    let other = Judged::of(setting, truth, feeds, CriteriaEntry::default(), false)?;
    Ok(flown(&other, plan, runs, seed)?.paired)
}

/// As it stands in flight.json.
fn pasted(feed: &OptimizedFeed, washout: f64) -> serde_json::Value {
    let value = |name: &str| feed.gains.get(name).map_or(0.0, |moved| moved.to);
    let rounded = |name: &str| crate::units::significant(value(name), 4);
    let time = |name: &str| format!("{} s", rounded(name));
    serde_json::json!({
        "kq": time("kq"), "ktheta": rounded("ktheta").parse::<f64>().unwrap_or(0.0), "kp": time("kp"),
        "kphi": rounded("kphi").parse::<f64>().unwrap_or(0.0), "kr": time("kr"), "washout": format!("{washout} s"),
    })
}
