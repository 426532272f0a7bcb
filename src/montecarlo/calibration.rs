//! Replicates of the gate: they set its critical value and, with other random numbers, measure its false-alarm
//! probability.

use rayon::prelude::*;

use super::conclusion;
use super::engine::Course;
use super::gate::{AxisGate, Gate, Kind, Raw};
use super::law::Law;
use super::outcome::{Caught, FalseAlarmRate, Method, TestRate};
use crate::numerics::distribution::normal_quantile;

/// Replicates drawn for the critical value: a family-wise alpha of 0.01 is then met within 5 % of itself (one
/// standard deviation).
pub const REPLICATES: u64 = 50_000;
/// Further replicates that measure the false-alarm probability.
const MEASURED: u64 = 20_000;
/// Run numbers are below this; from here on they belong to the whole experiments that measure the false-alarm
/// probability.
pub const MAX_RUN: u64 = 1 << 40;
/// Most whole experiments that can be asked for: their run numbers stay below 2⁶⁰.
pub const MAX_REPLICATES: u64 = 1_000_000;

/// Interval of a probability after `hits` of `trials`: Wilson's score interval.
pub fn wilson(hits: u64, trials: u64, confidence: f64) -> [f64; 2] {
    let (n, z) = (trials as f64, normal_quantile(0.5 + 0.5 * confidence));
    let p = hits as f64 / n;
    let middle = p + z * z / (2.0 * n);
    let half = z * (p * (1.0 - p) / n + z * z / (4.0 * n * n)).sqrt();
    let scale = 1.0 / (1.0 + z * z / n);
    [((middle - half) * scale).max(0.0), ((middle + half) * scale).min(1.0)]
}

/// Raw p-values of `replicates` from the law, per axis.
fn drawn(course: &Course, runs: u64, replicates: std::ops::Range<u64>) -> Vec<Vec<Vec<f64>>> {
    let axis = |(number, axis): (u32, &super::course::AxisCourse)| {
        let Some(law) = Law::new(axis, runs) else { return Vec::new() };
        let raw = Raw::new(axis, runs);
        replicates.clone().into_par_iter().map(|replicate| law.draw(&raw, course.seed, replicate, number)).collect()
    };
    (0..).zip(&course.axes).map(axis).collect()
}

/// The gate of `runs` runs at family-wise level `alpha`.
pub fn gate(course: &Course, runs: u64, alpha: f64, replicates: u64) -> Gate {
    let drawn = drawn(course, runs, 0..replicates);
    let axes = course.axes.iter().zip(drawn).map(|(axis, raw)| AxisGate::new(Kind::of(axis), &raw)).collect();
    Gate::new(axes, alpha)
}

/// False-alarm probability of a gate of [`REPLICATES`], from replicates that it has not seen.
pub fn false_alarms(course: &Course, gate: &Gate, runs: u64) -> FalseAlarmRate {
    let drawn = drawn(course, runs, REPLICATES..REPLICATES + MEASURED);
    let raw = |replicate: u64| drawn.iter().filter_map(|axis| axis.get(replicate as usize).cloned()).collect();
    rate(course, gate, MEASURED, Method::Law, raw)
}

/// The same from whole experiments; `own` is the course whose truth is the design itself.
pub fn false_alarms_of_experiments(own: &Course, gate: &Gate, runs: u64, replicates: u64) -> FalseAlarmRate {
    rate(own, gate, replicates, Method::Experiments, |replicate| whole_experiment(own, runs, replicate))
}

/// Raw p-values of whole experiment number `number`, per axis; experiments share no runs.
fn whole_experiment(course: &Course, runs: u64, number: u64) -> Vec<Vec<f64>> {
    let first = MAX_RUN + number * runs.next_multiple_of(4);
    let totals = course.sums(first..first + runs);
    course.axes.iter().zip(&totals).map(|(axis, totals)| conclusion::raw_p_values(axis, totals, runs)).collect()
}

/// Whole experiments: how often some test of some axis has a p-value of at most `critical`; `gates`: one per axis of
/// `course`.
pub fn caught_of_experiments(
    course: &Course,
    gates: &[AxisGate],
    critical: f64,
    runs: u64,
    experiments: u64,
) -> Caught {
    let failed = |experiment: &u64| {
        let raw = whole_experiment(course, runs, *experiment);
        let mut axes = raw.iter().zip(gates);
        axes.any(|(raw, gate)| gate.p_values(raw).into_iter().any(|p| rejected(p, critical)))
    };
    Caught { caught: (0..experiments).filter(failed).count() as u64, of: experiments }
}

/// A p-value that is not a number is no pass.
fn rejected(p: f64, critical: f64) -> bool {
    p.is_nan() || p <= critical
}

fn rate(
    course: &Course,
    gate: &Gate,
    replicates: u64,
    method: Method,
    raw: impl Fn(u64) -> Vec<Vec<f64>>,
) -> FalseAlarmRate {
    let mut alone: Vec<Vec<[u64; 2]>> = gate.axes.iter().map(|axis| vec![[0; 2]; axis.kinds.len()]).collect();
    let mut hits = 0;
    for replicate in 0..replicates {
        let mut failed = false;
        for ((axis, raw), alone) in gate.axes.iter().zip(raw(replicate)).zip(&mut alone) {
            for (p, count) in axis.p_values(&raw).into_iter().zip(alone) {
                let rejected = rejected(p, gate.critical);
                failed |= rejected;
                count[0] += u64::from(p <= gate.alpha);
                count[1] += u64::from(rejected);
            }
        }
        hits += u64::from(failed);
    }
    let total = replicates.max(1);
    let tests = course.axes.iter().zip(&gate.axes).zip(&alone).flat_map(|((axis, gate), alone)| {
        gate.kinds.iter().zip(alone).map(|(kind, count)| TestRate {
            axis: axis.name.clone(),
            name: conclusion::test_name(axis, *kind),
            value: count[0] as f64 / total as f64,
            rejected: count[1] as f64 / total as f64,
        })
    });
    FalseAlarmRate {
        value: hits as f64 / total as f64,
        interval: wilson(hits, total, 0.95),
        replicates,
        method,
        tests: tests.collect(),
    }
}
