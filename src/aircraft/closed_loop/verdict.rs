//! Every feed against every criterion.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::Serialize;

use super::analysis::{FeedResult, HalfResult, Steady};
use super::half::Half;
use super::modes::least_damped;
use super::varied::FeedPoint;
use crate::aircraft::flight::document::CriteriaEntry;
use crate::aircraft::flight::document::criteria::{Criterion, LimitEntry};
use crate::units::digits;

/// An oscillation that there is none of is damped as well as one can be.
const NO_OSCILLATION: f64 = 1.0;
/// A value may miss its limit by rounding.
const ROUNDING: f64 = 1e-9;

/// One feed, one limit, one surface or axis.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Judgement {
    pub feed: String,
    /// Of the criterion.
    pub name: &'static str,
    /// "elevator", "aileron", "rudder", or "pitch", "roll_yaw".
    pub surface: &'static str,
    /// "at_least", "at_most" or "not_worse_than".
    pub kind: &'static str,
    pub unit: &'static str,
    /// Null: there is no limit to it, or the loop is unstable.
    pub value: Option<f64>,
    pub limit: f64,
    pub pass: bool,
    /// In words.
    pub meaning: String,
}

/// A value that a criterion is about.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Value {
    /// Of which surface or half.
    pub of: &'static str,
    /// Infinite where a margin has no limit; NaN of an unstable loop.
    pub value: f64,
}

/// What a criterion is about in a feed, in its unit.
pub fn values(result: &FeedResult, criterion: &Criterion) -> Vec<Value> {
    result.halves.iter().flat_map(|half| of_half(half, criterion)).collect()
}

fn of_half(half: &HalfResult, criterion: &Criterion) -> Vec<Value> {
    let which = half.circuit.half;
    let Some(steady) = &half.steady else {
        return unstable(which, criterion).into_iter().map(|of| Value { of, value: f64::NAN }).collect();
    };
    let surfaces = |value: &dyn Fn(usize) -> Option<f64>| -> Vec<Value> {
        let each = which.surfaces().iter().enumerate();
        each.filter_map(|(i, of)| Some(Value { of, value: value(i)? })).collect()
    };
    let axis = |value: f64| vec![Value { of: which.name(), value }];
    let margin = |i: usize| &steady.margins.single[i];
    let without_limit = |x: Option<f64>| Some(x.unwrap_or(f64::INFINITY));
    let rate = |i: usize, by: Option<usize>| {
        let name = format!("{}_rate", which.surfaces()[i]);
        let rms = steady.rms.iter().find(|rms| rms.name == name)?;
        Some(by.map_or(rms.all, |source| rms.by[source]).to_degrees())
    };
    match criterion.name {
        "disk_margin" => surfaces(&|i| Some(margin(i).disk.margin)),
        "multiloop_disk_margin" => axis(steady.margins.multiloop.margin),
        "gain_margin" => surfaces(&|i| without_limit(margin(i).gain_up.map(|limit| limit.decibels()))),
        "gain_reduction" => surfaces(&|i| without_limit(margin(i).gain_down.map(|limit| -limit.decibels()))),
        "phase_margin" => {
            surfaces(&|i| without_limit(margin(i).phase().map(|crossover| crossover.phase.abs().to_degrees())))
        }
        "delay_margin" => surfaces(&|i| without_limit(margin(i).delay())),
        "sensitivity_peak" => axis(steady.margins.sensitivity.value),
        "damping" => axis(least_damped(&half.modes).map_or(NO_OSCILLATION, |mode| mode.damping())),
        "surface_rate" => surfaces(&|i| rate(i, None)),
        "surface_noise" => surfaces(&|i| rate(i, Some(1))),
        "offset" => {
            let angle = steady.offset.iter().find(|(name, _)| name == which.angle_name());
            angle.map_or_else(Vec::new, |(_, x)| axis(x.abs().to_degrees()))
        }
        name => rms_of(steady, name).map_or_else(Vec::new, axis),
    }
}

fn rms_of(steady: &Steady, name: &str) -> Option<f64> {
    steady.rms.iter().find(|rms| rms.name == name).map(|rms| rms.all.to_degrees())
}

/// What a criterion would have been about.
fn unstable(half: Half, criterion: &Criterion) -> Vec<&'static str> {
    use crate::aircraft::flight::document::criteria::Subject;
    let other = [
        ("q", Half::Pitch),
        ("theta", Half::Pitch),
        ("p", Half::RollYaw),
        ("r", Half::RollYaw),
        ("phi", Half::RollYaw),
    ];
    match criterion.subject {
        Subject::Surface => half.surfaces().to_vec(),
        Subject::Axes if other.iter().any(|(name, of)| *name == criterion.name && *of != half) => Vec::new(),
        Subject::Axes => vec![half.name()],
    }
}

/// All limits of all feeds, criterion by criterion.
pub fn judge(results: &[&FeedResult], criteria: &CriteriaEntry) -> Vec<Judgement> {
    criteria.0.iter().flat_map(|limit| results.iter().flat_map(|result| of_feed(results, result, limit))).collect()
}

fn of_feed(results: &[&FeedResult], result: &FeedResult, limit: &LimitEntry) -> Vec<Judgement> {
    let criterion = limit.criterion;
    let unit = criterion.unit;
    let found = values(result, &criterion);
    let mut out = Vec::new();
    let mut add = |of: Value, kind: &'static str, bound: f64, pass: bool, words: String| {
        let value = Some(of.value).filter(|value| value.is_finite());
        let what = format!("{}: {} of {}", result.name, criterion.meaning, of.of.replace('_', " and "));
        let meaning = if of.value.is_nan() {
            format!("{what}: the loop is unstable")
        } else {
            format!("{what} is {}; {words}", shown(of.value, unit))
        };
        let feed = result.name.clone();
        out.push(Judgement {
            feed,
            name: criterion.name,
            surface: of.of,
            kind,
            unit,
            value,
            limit: bound,
            pass,
            meaning,
        });
    };
    for of in found {
        if let Some(least) = limit.at_least {
            let pass = of.value >= least * (1.0 - ROUNDING);
            add(of, "at_least", least, pass, format!("at least {} is asked for", shown(least, unit)));
        }
        if let Some(most) = limit.at_most {
            let pass = of.value <= most * (1.0 + ROUNDING);
            add(of, "at_most", most, pass, format!("at most {} is asked for", shown(most, unit)));
        }
        let Some((other, share)) = limit.not_worse_than.as_ref().filter(|(other, _)| *other != result.name) else {
            continue;
        };
        let theirs = results.iter().find(|result| result.name == *other).map(|other| values(other, &criterion));
        let Some(theirs) = theirs.and_then(|all| all.into_iter().find(|theirs| theirs.of == of.of)) else { continue };
        let bound = if criterion.more_is_better { theirs.value * (1.0 - share) } else { theirs.value * (1.0 + share) };
        let pass = if criterion.more_is_better {
            of.value >= bound * (1.0 - ROUNDING)
        } else {
            of.value <= bound * (1.0 + ROUNDING)
        };
        let change = 100.0 * (of.value / theirs.value - 1.0);
        let change = if change.is_finite() { format!("{change:+.1} % against") } else { "beside".into() };
        let words = format!(
            "{change} {} of {other}, at most {} % worse is allowed",
            shown(theirs.value, unit),
            digits(100.0 * share)
        );
        add(of, "not_worse_than", bound, pass, words);
    }
    out
}

/// Sums up every feed.
pub fn feed_points(results: &[FeedResult], judgements: &[Judgement]) -> Vec<FeedPoint> {
    let passes = |name: &str| judgements.iter().all(|judgement| judgement.feed != name || judgement.pass);
    results.iter().map(|result| feed_point(result, passes(&result.name))).collect()
}

fn feed_point(result: &FeedResult, passes: bool) -> FeedPoint {
    let mut point = FeedPoint {
        name: result.name.clone(),
        stable: result.unstable().is_none(),
        disk: BTreeMap::new(),
        damping: BTreeMap::new(),
        surface_rate: BTreeMap::new(),
        angle: BTreeMap::new(),
        activity: None,
        passes,
    };
    for half in &result.halves {
        let which = half.circuit.half;
        let Some(steady) = &half.steady else { continue };
        for (surface, margins) in which.surfaces().iter().zip(&steady.margins.single) {
            point.disk.insert(surface, margins.disk.margin);
        }
        point.damping.insert(which.name(), least_damped(&half.modes).map_or(1.0, |mode| mode.damping()));
        for rms in &steady.rms {
            if rms.name.ends_with("_rate") {
                point.surface_rate.insert(rms.name.clone(), rms.all.to_degrees());
            } else if rms.name == which.angle_name() {
                point.angle.insert(rms.name.clone(), rms.all.to_degrees());
            }
        }
    }
    if point.stable {
        point.activity = Some(point.surface_rate.values().map(|rate| rate * rate).sum::<f64>().sqrt());
    }
    point
}

/// Of those that keep every criterion, the one with the least surface rate.
pub fn best(feeds: &[FeedPoint]) -> Option<&FeedPoint> {
    let kept = feeds.iter().filter(|feed| feed.stable && feed.passes);
    kept.min_by(|a, b| a.activity.unwrap_or(f64::INFINITY).total_cmp(&b.activity.unwrap_or(f64::INFINITY)))
}

/// With its unit.
pub fn shown(value: f64, unit: &str) -> String {
    let number = if value.is_finite() { digits(value) } else { "without limit".into() };
    if unit.is_empty() || !value.is_finite() { number } else { format!("{number} {unit}") }
}
