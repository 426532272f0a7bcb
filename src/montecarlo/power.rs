//! What the gate would see: the power of its tests against a wrong parameter, from the exact covariance analysis.
//!
//! The filter under test is held fixed and the truth is moved: "factor 2" means that the filter's value is twice the
//! true one. Means and variances of the statistics are exact ([`crate::filter::mismatch::expect`]) but for two
//! approximations: the variance of sums over time takes the correlation that the statistics have for a true filter,
//! and sums of squares have the scaled χ² law of their first two moments. The probability that the gate rejects is
//! at least that of its most powerful test, which is what is given.

use rayon::prelude::*;

use super::MonteCarloError;
use super::calibration::caught_of_experiments;
use super::conclusion::test_name;
use super::course::{AxisCourse, model_in, model_of};
use super::engine::Course;
use super::experiment::Experiment;
use super::gate::{AxisGate, Gate, Kind, Raw};
use super::outcome::{Detectable, Measure, Rejection, Sighting};
use crate::filter::mismatch::{Expectation, ExpectedError, expect};
use crate::model::LinearModel;
use crate::numerics::distribution::{chi_square_cdf, chi_square_quantile, chi_square_sf, normal_quantile, normal_sf};
use crate::numerics::optimize::bisect;

/// Probability with which a mistuning counts as seen.
pub const WISHED: f64 = 0.9;
/// Largest factor, and its inverse, that is looked at.
const LARGEST: f64 = 1000.0;
/// Largest offset in sigmas that is looked at.
const LARGEST_OFFSET: f64 = 100.0;
/// Relative accuracy of a found size (of its logarithm for factors).
const ACCURACY: f64 = 5e-3;

/// What can be wrong about one axis of a design.
#[derive(Clone, Debug, PartialEq)]
pub enum Mistuning {
    /// A coefficient of the noise terms by its path: `gauss_markov.std_dev`. Sizes are factors: filter over truth.
    Noise(String),
    /// The same of the plant or an aid: `heading.std_dev`.
    Plant(String),
    /// √P0 of this state. Sizes are factors.
    P0(usize),
    /// x0 of this state. Sizes are in sigmas of its P0.
    X0(usize),
}

/// Probability that the gate rejects, at least, and the test that does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Power {
    pub probability: f64,
    pub kind: Kind,
}

/// The gate of one axis as a mistuning meets it.
#[derive(Clone, Copy, Debug)]
pub struct Instrument<'a> {
    axis: &'a AxisCourse,
    raw: Raw<'a>,
    gate: &'a AxisGate,
    critical: f64,
}

impl Mistuning {
    /// All that can be wrong about an axis.
    pub fn all(experiment: &Experiment, number: usize, axis: &AxisCourse) -> Vec<Mistuning> {
        let design = &experiment.design.axes[number];
        let mut noise = design.noise.clone();
        let mut all = Vec::new();
        // a model that was edited by hand is not that of its parameters: these then say nothing about it
        let same = |built: LinearModel| {
            built.states == design.model.states
                && (&built.q - &design.model.q).amax() <= 1e-9 * design.model.q.amax()
                && (&built.r - &design.model.r).amax() <= 1e-9 * design.model.r.amax()
        };
        if model_of(&noise, &experiment.design).is_ok_and(same) {
            all.extend(noise.noise_parameters().map(|(path, _)| Mistuning::Noise(path)));
            let mut plant = experiment.design.design.clone().unwrap_or_default();
            all.extend(plant.noise_parameters().map(|(path, _)| Mistuning::Plant(path)));
        }
        let own = |i: &usize| axis.filter.f[(*i, *i)] == 1.0 && axis.filter.p0[(*i, *i)] > 0.0;
        let constants: Vec<usize> = (0..axis.filter.states.len()).filter(own).collect();
        all.extend(constants.iter().map(|i| Mistuning::P0(*i)));
        all.extend(constants.iter().map(|i| Mistuning::X0(*i)));
        all
    }

    /// As in documents and on the command line.
    pub fn name(&self, axis: &AxisCourse) -> String {
        match self {
            Mistuning::Noise(path) | Mistuning::Plant(path) => path.clone(),
            Mistuning::P0(i) => format!("P0 of {}", axis.filter.states[*i].name),
            Mistuning::X0(i) => format!("x0 of {}", axis.filter.states[*i].name),
        }
    }

    /// The truth for which the filter of axis `number` is wrong by `size`.
    pub fn truth(&self, experiment: &Experiment, number: usize, size: f64) -> Result<LinearModel, MonteCarloError> {
        let design = &experiment.design.axes[number];
        let mut model = design.model.clone();
        match self {
            Mistuning::Noise(path) | Mistuning::Plant(path) => {
                let mut noise = design.noise.clone();
                let mut plant = experiment.design.design.clone();
                let found = match (self, &mut plant) {
                    (Mistuning::Plant(_), Some(plant)) => plant.noise_parameters().find(|(name, _)| name == path),
                    _ => noise.noise_parameters().find(|(name, _)| name == path),
                };
                if let Some((_, parameter)) = found {
                    parameter.value /= size;
                }
                model = model_in(&noise, plant, &experiment.design)?;
                // P0 of a constant is what the filter claims, also where it was guessed from the noise
                for i in 0..model.states.len() {
                    if design.model.f[(i, i)] == 1.0 {
                        model.p0[(i, i)] = design.model.p0[(i, i)];
                    }
                }
            }
            Mistuning::P0(i) => {
                for j in 0..model.states.len() {
                    model.p0[(*i, j)] /= size;
                    model.p0[(j, *i)] /= size;
                }
            }
            Mistuning::X0(i) => model.x0[*i] -= size * model.p0[(*i, *i)].sqrt(),
        }
        Ok(model)
    }

    fn measure(&self) -> Measure {
        match self {
            Mistuning::Noise(_) | Mistuning::Plant(_) | Mistuning::P0(_) => Measure::Factor,
            Mistuning::X0(_) => Measure::Sigmas,
        }
    }
}

impl<'a> Instrument<'a> {
    /// Axis `number` of a gate over `runs` runs.
    pub fn new(course: &'a Course, gate: &'a Gate, number: usize, runs: u64) -> Instrument<'a> {
        let axis = &course.axes[number];
        Instrument { axis, raw: Raw::new(axis, runs), gate: &gate.axes[number], critical: gate.critical }
    }

    /// The same for another number of runs.
    pub fn with_runs(self, runs: u64) -> Instrument<'a> {
        Instrument { raw: Raw::new(self.axis, runs), ..self }
    }

    /// What the filter does when the world is `truth`, which has the states of the filter.
    pub fn expectation(&self, truth: &LinearModel) -> Expectation {
        let lengths = |c: &super::sums::Channel| c.lengths.iter().map(|l| *l as u64 * c.base).collect();
        let lengths: Vec<Vec<u64>> = self.axis.channels.iter().map(lengths).collect();
        expect(&self.axis.filter, truth, &self.axis.gains, &self.axis.judge, &lengths)
    }

    /// Power against that.
    pub fn power(&self, expectation: &Expectation) -> Power {
        let mut best = Power { probability: 0.0, kind: Kind::Nees };
        for (number, kind) in self.gate.kinds.iter().enumerate() {
            let p = self.gate.raw_for(number, self.critical);
            let probability = self.of_test(*kind, p, expectation);
            if probability > best.probability {
                best = Power { probability, kind: *kind };
            }
        }
        best
    }

    fn of_test(&self, kind: Kind, p: f64, expectation: &Expectation) -> f64 {
        let runs = self.raw.runs as f64;
        let size = self.axis.judge.size() as f64;
        let best = |values: &mut dyn Iterator<Item = f64>| values.fold(0.0, f64::max);
        let nees = |e: &ExpectedError| Some((e.nees()?, e.nees_variance()?));
        match kind {
            Kind::Nees => best(
                &mut expectation
                    .epochs
                    .iter()
                    .filter_map(nees)
                    .map(|(mean, variance)| outside(p, size * runs, mean * runs, variance * runs)),
            ),
            Kind::NeesAverage => {
                let regular = expectation.epochs.iter().zip(&self.axis.epochs).filter(|(_, epoch)| epoch.regular);
                let moments: Vec<(f64, f64)> = regular.filter_map(|(e, _)| nees(e)).collect();
                let count = moments.len() as f64;
                let mean = moments.iter().map(|m| m.0).sum::<f64>() / count;
                let variance = moments.iter().map(|m| m.1).sum::<f64>() / count;
                let worth = runs * self.raw.effective();
                let bounds = self.raw.nees_average_bounds(p).map(|sum| sum * worth / (count * runs));
                beyond(bounds, mean * worth, variance * worth)
            }
            Kind::MeanError => best(&mut expectation.epochs.iter().filter_map(|e| {
                let (mean, covariance) = e.whitened()?;
                let first = covariance.trace() + runs * mean.norm_squared();
                let second = 2.0 * covariance.norm_squared() + 4.0 * runs * mean.dot(&(&covariance * &mean));
                Some(above(chi_square_quantile(1.0 - p, size), first, second))
            })),
            Kind::Nis(c) => {
                let updates = runs * self.axis.channels[c].updates as f64;
                let nis = expectation.innovations[c].nis;
                outside(p, updates, updates * nis, 2.0 * updates * nis * nis)
            }
            Kind::InnovationMean(c) => {
                let updates = runs * self.axis.channels[c].updates as f64;
                let (z, mean) = (normal_quantile(1.0 - 0.5 * p), expectation.innovations[c].mean * updates.sqrt());
                normal_sf(z - mean) + normal_sf(z + mean)
            }
            Kind::LowFrequency(c) => {
                let channel = &self.axis.channels[c];
                let ratios = expectation.innovations[c].blocks.iter().zip(&channel.lengths);
                best(&mut ratios.map(|(ratio, length)| {
                    let blocks = runs * channel.blocks_of(*length) as f64;
                    outside(p, blocks, blocks * ratio, 2.0 * blocks * ratio * ratio)
                }))
            }
            // these see what a model lacks at short lags, not a wrong parameter
            Kind::Autocorrelation(_) | Kind::LjungBox(_) | Kind::CumulativePeriodogram(_) => 0.0,
        }
    }

    /// The smallest size in one direction (+1 too large, −1 too small) that is seen with 90 %.
    fn smallest(&self, experiment: &Experiment, number: usize, what: &Mistuning, direction: f64) -> Option<Sighting> {
        let (size, limit, first): (Box<dyn Fn(f64) -> f64>, f64, f64) = match what.measure() {
            Measure::Factor => (Box::new(move |x: f64| (direction * x).exp()), LARGEST.ln(), 0.005),
            Measure::Sigmas => (Box::new(move |x: f64| direction * x), LARGEST_OFFSET, 0.05),
        };
        let power = |x: f64| {
            let truth = what.truth(experiment, number, size(x)).ok()?;
            Some(self.power(&self.expectation(&truth)))
        };
        let (mut low, mut high) = (0.0, first);
        let mut seen = power(high)?;
        while seen.probability < WISHED {
            if high >= limit {
                return None;
            }
            (low, high) = (high, (4.0 * high).min(limit));
            seen = power(high)?;
        }
        let close = |low: f64, high: f64| (high - low > ACCURACY * high).then_some(0.5 * (low + high));
        let (high, seen) = narrowed((low, high), seen, close, power)?;
        Some(Sighting { size: size(high), test: test_name(self.axis, seen.kind), confirmed: None })
    }
}

/// Probability that a sum with this mean and variance leaves the two-sided χ²(`freedom`) bounds of level `p`; scaled
/// χ².
fn outside(p: f64, freedom: f64, mean: f64, variance: f64) -> f64 {
    beyond([0.5 * p, 1.0 - 0.5 * p].map(|p| chi_square_quantile(p, freedom)), mean, variance)
}

/// Probability that a sum of squares with this mean and variance is outside the bounds.
fn beyond([lower, upper]: [f64; 2], mean: f64, variance: f64) -> f64 {
    chi_square_cdf(lower * 2.0 * mean / variance, 2.0 * mean * mean / variance) + above(upper, mean, variance)
}

/// Probability that a sum of squares with this mean and variance is above `bound`.
fn above(bound: f64, mean: f64, variance: f64) -> f64 {
    chi_square_sf(bound * 2.0 * mean / variance, 2.0 * mean * mean / variance)
}

/// What a gate of `runs` runs sees, for every axis and parameter. Axes of one design and rate are worked out once.
pub fn detectable(experiment: &Experiment, own: &Course, gate: &Gate, runs: u64) -> Vec<Detectable> {
    let first_like = |number: usize| {
        let axes = &experiment.design.axes;
        let like = |i: &usize| axes[*i].model == axes[number].model && axes[*i].noise.terms == axes[number].noise.terms;
        (0..number).find(like)
    };
    let jobs: Vec<(usize, Mistuning)> = own
        .axes
        .iter()
        .enumerate()
        .filter(|(number, _)| first_like(*number).is_none())
        .flat_map(|(number, axis)| Mistuning::all(experiment, number, axis).into_iter().map(move |m| (number, m)))
        .collect();
    let found: Vec<(usize, Detectable)> = jobs
        .par_iter()
        .map(|(number, what)| {
            let instrument = Instrument::new(own, gate, *number, runs);
            let one = |direction| instrument.smallest(experiment, *number, what, direction);
            let (too_large, too_small) = rayon::join(|| one(1.0), || one(-1.0));
            let axis = &own.axes[*number];
            let parameter = what.name(axis);
            let detectable =
                Detectable { axis: axis.name.clone(), parameter, measure: what.measure(), too_large, too_small };
            (*number, detectable)
        })
        .collect();
    let of_axis = |number: usize| {
        let source = first_like(number).unwrap_or(number);
        let name = own.axes[number].name.clone();
        let found = found.iter().filter(move |(n, _)| *n == source);
        found.map(move |(_, d)| Detectable { axis: name.clone(), ..d.clone() })
    };
    (0..own.axes.len()).flat_map(of_axis).collect()
}

/// Power of the gate of `course` against the course's own truth.
pub fn rejection(course: &Course, gate: &Gate, runs: u64) -> Option<Rejection> {
    let of_axis = |number: usize| {
        let instrument = Instrument::new(course, gate, number, runs);
        let axis = &course.axes[number];
        let power = instrument.power(&instrument.expectation(&axis.truth));
        let test = test_name(axis, power.kind);
        Rejection { probability: power.probability, axis: axis.name.clone(), test, confirmed: None }
    };
    (0..course.axes.len()).map(of_axis).max_by(|a, b| a.probability.total_cmp(&b.probability))
}

/// Simulates the found sizes of axis `number` with `experiments` whole experiments each and counts what the gate
/// catches.
pub fn confirm(
    experiment: &Experiment,
    own: &Course,
    gate: &Gate,
    runs: u64,
    experiments: u64,
    found: &mut [Detectable],
) -> Result<(), MonteCarloError> {
    for number in 0..own.axes.len() {
        let axis = &own.axes[number];
        let all = Mistuning::all(experiment, number, axis);
        for entry in found.iter_mut().filter(|entry| entry.axis == axis.name) {
            let Some(what) = all.iter().find(|what| what.name(axis) == entry.parameter) else { continue };
            for sighting in [&mut entry.too_large, &mut entry.too_small].into_iter().flatten() {
                let truth = what.truth(experiment, number, sighting.size)?;
                let course = AxisCourse::new(&experiment.design.axes[number], truth, own.steps)?;
                let course = Course::new(vec![course], vec![None], own.steps, own.seed, own.dt);
                let caught =
                    caught_of_experiments(&course, &gate.axes[number..=number], gate.critical, runs, experiments);
                sighting.confirmed = Some(caught);
            }
        }
    }
    Ok(())
}

/// Runs, and duration, with which a mistuning of `size` of axis `number` is seen with 90 % probability.
#[derive(Clone, Debug, PartialEq)]
pub struct Needed {
    /// At the duration of the experiment; absent above a hundred million.
    pub runs: Option<(u64, Kind)>,
    /// s, at the runs of the experiment; absent above the longest run there is memory for.
    pub duration: Option<(f64, Kind)>,
    /// At this experiment.
    pub power: Power,
}

/// Most runs that a plan asks for.
const MOST_RUNS: u64 = 100_000_000;

/// See [`Needed`]. The critical values are those of `gate`: they hardly change with the number of runs.
pub fn plan(
    experiment: &Experiment,
    own: &Course,
    gate: &Gate,
    runs: u64,
    number: usize,
    what: &Mistuning,
    size: f64,
) -> Result<Needed, MonteCarloError> {
    let truth = what.truth(experiment, number, size)?;
    let instrument = Instrument::new(own, gate, number, runs);
    let expectation = instrument.expectation(&truth);
    let at = |runs: u64| instrument.with_runs(runs).power(&expectation);
    let power = at(runs);
    let runs_needed = least(2, MOST_RUNS, |runs| Some(at(runs)));
    let design = &experiment.design.axes[number];
    let shortest = (design.steady_state.settling_time / own.dt).ceil().max(super::course::MIN_STEPS as f64) as u64;
    let of_steps = |steps: u64| {
        let axis = AxisCourse::new(design, truth.clone(), steps).ok()?;
        let gate = &gate.axes[number];
        let kinds = Kind::of(&axis);
        if kinds != gate.kinds {
            return Some(Power { probability: 0.0, kind: Kind::Nees });
        }
        let instrument = Instrument { axis: &axis, raw: Raw::new(&axis, runs), gate, ..instrument };
        Some(instrument.power(&instrument.expectation(&truth)))
    };
    let longest = LONGEST_PLAN.min(super::course::MAX_STEPS);
    let duration = least(shortest.min(longest), longest, of_steps).map(|(steps, kind)| (steps as f64 * own.dt, kind));
    Ok(Needed { runs: runs_needed, duration, power })
}

/// Longest run that a plan looks at, in steps.
const LONGEST_PLAN: u64 = 4_000_000;

/// The smallest number, to 1 %, at which the power is as wished: doubled until it is, then halved.
fn least(first: u64, last: u64, power: impl Fn(u64) -> Option<Power>) -> Option<(u64, Kind)> {
    let (mut low, mut high) = (first, first);
    let mut seen = power(high)?;
    while seen.probability < WISHED {
        if high >= last {
            return None;
        }
        (low, high) = (high, (2 * high).min(last));
        seen = power(high)?;
    }
    let close = |low: u64, high: u64| (high - low > 1 + high / 100).then_some(low + (high - low) / 2);
    let (high, seen) = narrowed((low, high), seen, close, power)?;
    Some((high, seen.kind))
}

/// The least place at which the power is as wished, between one where it is not and one where it is `seen`, and the
/// power there.
fn narrowed<T: Copy>(
    (low, high): (T, T),
    mut seen: Power,
    between: impl Fn(T, T) -> Option<T>,
    power: impl Fn(T) -> Option<Power>,
) -> Option<(T, Power)> {
    let past = |middle| {
        let at = power(middle).ok_or(())?;
        let enough = at.probability >= WISHED;
        if enough {
            seen = at;
        }
        Ok::<_, ()>(enough)
    };
    let (_, high) = bisect(low, high, between, past).ok()?;
    Some((high, seen))
}
