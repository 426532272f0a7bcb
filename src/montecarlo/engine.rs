//! Runs by number, on all threads.

use std::borrow::Cow;
use std::ops::Range;

use rayon::prelude::*;

use super::course::AxisCourse;
use super::lanes::{LANES, Lane, Observer, Runs, Scratch, Truth, simulate};
use super::sums::Totals;

/// Steps (of all runs and axes) between two looks at the clock and at a request to stop.
const BATCH_STEPS: u64 = 20_000_000;

/// An experiment ready to run: the courses of its axes and the seed.
#[derive(Clone, Debug)]
pub struct Course {
    pub axes: Vec<AxisCourse>,
    pub steps: u64,
    pub seed: u64,
    pub dt: f64,
}

impl Course {
    /// Sums over `runs`, one per axis. `progress` is called with the number of runs just finished (all axes).
    ///
    /// Every random number is addressed by (seed, run, axis, source) and the sums are exact: any number of threads, any cut into ranges
    /// gives the same.
    pub fn sums(&self, runs: Range<u64>, progress: &(dyn Fn(u64) + Sync)) -> Vec<Totals> {
        let groups = (runs.end - runs.start).div_ceil(LANES as u64);
        let zero = || self.axes.iter().map(|axis| Totals::new(&axis.layout)).collect::<Vec<_>>();
        (0..groups * self.axes.len() as u64)
            .into_par_iter()
            .fold(
                || (zero(), self.axes.iter().map(|_| None).collect::<Vec<Option<Scratch>>>()),
                |(mut totals, mut scratch), item| {
                    let (axis, first) = ((item / groups) as usize, runs.start + item % groups * LANES as u64);
                    self.group(axis as u32, first, &runs, &mut totals[axis], &mut scratch[axis], progress);
                    (totals, scratch)
                },
            )
            .map(|(totals, _)| totals)
            .reduce(zero, |mut a, b| {
                a.iter_mut().zip(&b).for_each(|(a, b)| a.merge(b));
                a
            })
    }

    /// Up to eight runs of one axis.
    fn group(
        &self,
        number: u32,
        first: u64,
        runs: &Range<u64>,
        totals: &mut Totals,
        scratch: &mut Option<Scratch>,
        progress: &(dyn Fn(u64) + Sync),
    ) {
        let scratch = scratch.get_or_insert_with(|| Scratch::new(&self.axes[number as usize]));
        let eight = self.from(number, first, scratch);
        simulate(&self.axes[number as usize], eight, scratch, None);
        let used = (runs.end - first).min(LANES as u64);
        for (values, counts) in scratch.values.iter().zip(&scratch.counts).take(used as usize) {
            totals.add(values, counts);
        }
        progress(used);
    }

    /// `first` and the seven runs after it, of one axis, at their start.
    pub(super) fn from(&self, number: u32, first: u64, scratch: &mut Scratch) -> Runs<'_> {
        self.start(number, std::array::from_fn(|l| first.saturating_add(l as u64)), scratch)
    }

    fn start(&self, number: u32, runs: [u64; LANES], scratch: &mut Scratch) -> Runs<'_> {
        let axis = &self.axes[number as usize];
        let model = self.drawn(number, runs).map_or(Cow::Borrowed(&axis.nominal), Cow::Owned);
        Runs::new(axis, number, model, self.seed, runs, scratch)
    }

    /// The truths of these runs, where every run has its own.
    fn drawn(&self, number: u32, runs: [u64; LANES]) -> Option<Truth> {
        let axis = &self.axes[number as usize];
        let spread = axis.spread.as_ref()?;
        let models = runs.map(|run| spread.draw(self.seed, run, number, &axis.truth));
        Some(Truth::of(models.each_ref()))
    }

    /// [`sums`](Course::sums) in batches of a fraction of a second; after each, `pause` is given the sums so far and the number of the
    /// next run, and says whether to stop. Returns the sums and the end of the range that was done.
    pub fn sums_until(
        &self,
        runs: Range<u64>,
        start: Option<Vec<Totals>>,
        progress: &(dyn Fn(u64) + Sync),
        pause: &mut dyn FnMut(&[Totals], u64) -> bool,
    ) -> (Vec<Totals>, u64) {
        let per_run = self.steps * self.axes.len() as u64;
        let batch = (BATCH_STEPS / per_run).next_multiple_of(2 * LANES as u64).max(2 * LANES as u64);
        let mut totals = start.unwrap_or_else(|| self.axes.iter().map(|axis| Totals::new(&axis.layout)).collect());
        let mut next = runs.start;
        while next < runs.end {
            let end = next.saturating_add(batch).min(runs.end);
            let fresh = self.sums(next..end, progress);
            totals.iter_mut().zip(&fresh).for_each(|(total, fresh)| total.merge(fresh));
            next = end;
            if next < runs.end && pause(&totals, next) {
                break;
            }
        }
        (totals, next)
    }

    /// One run alone, every number of it: the same numbers as among many.
    pub fn trace(&self, run: u64) -> Vec<Trace> {
        let one = |number: u32, axis: &AxisCourse| {
            let mut trace = Trace::new(axis, self.steps);
            let mut scratch = Scratch::new(axis);
            simulate(axis, self.start(number, [run; LANES], &mut scratch), &mut scratch, Some(&mut trace));
            trace
        };
        (0..).zip(&self.axes).map(|(number, axis)| one(number, axis)).collect()
    }

    /// Eight runs, `first` and those after it, at every `every`-th step: what a figure needs, however long a run is. By axis, then by run.
    pub fn paths(&self, first: u64, every: u64) -> Vec<Vec<Path>> {
        let one = |number: u32, axis: &AxisCourse| {
            let mut paths = Paths { every: every.max(1), runs: std::array::from_fn(|_| Path::new(axis)) };
            let mut scratch = Scratch::new(axis);
            simulate(axis, self.from(number, first, &mut scratch), &mut scratch, Some(&mut paths));
            Vec::from(paths.runs)
        };
        (0..).zip(&self.axes).map(|(number, axis)| one(number, axis)).collect()
    }
}

/// States of one run of one axis, state by state.
#[derive(Clone, Debug, Default)]
pub struct Path {
    pub truth: Vec<Vec<f64>>,
    pub estimate: Vec<Vec<f64>>,
}

impl Path {
    fn new(axis: &AxisCourse) -> Path {
        Path { truth: vec![Vec::new(); axis.truth.x0.len()], estimate: vec![Vec::new(); axis.filter.x0.len()] }
    }
}

struct Paths {
    every: u64,
    runs: [Path; LANES],
}

impl Observer for Paths {
    fn step(&mut self, step: u64, truth: &[Lane], estimate: &[Lane]) {
        if !step.is_multiple_of(self.every) {
            return;
        }
        for (l, path) in self.runs.iter_mut().enumerate() {
            let columns = path.truth.iter_mut().zip(truth).chain(path.estimate.iter_mut().zip(estimate));
            columns.for_each(|(column, value)| column.push(value[l]));
        }
    }
}

/// Every number of one run of one axis, by steps.
#[derive(Clone, Debug, Default)]
pub struct Trace {
    /// State by state.
    pub truth: Vec<Vec<f64>>,
    pub estimate: Vec<Vec<f64>>,
    /// Per measurement; NaN at steps without it.
    pub measured: Vec<Vec<f64>>,
    pub innovation: Vec<Vec<f64>>,
    /// ν/√S.
    pub normalised: Vec<Vec<f64>>,
}

impl Trace {
    fn new(axis: &AxisCourse, steps: u64) -> Trace {
        let columns = |count: usize| vec![Vec::with_capacity(steps as usize); count];
        let channels = axis.channels.len();
        Trace {
            truth: columns(axis.truth.x0.len()),
            estimate: columns(axis.filter.x0.len()),
            measured: columns(channels),
            innovation: columns(channels),
            normalised: columns(channels),
        }
    }
}

impl Observer for Trace {
    fn update(&mut self, channel: usize, measured: &Lane, innovation: &Lane, normalised: &Lane) {
        self.measured[channel].push(measured[0]);
        self.innovation[channel].push(innovation[0]);
        self.normalised[channel].push(normalised[0]);
    }
    fn step(&mut self, step: u64, truth: &[Lane], estimate: &[Lane]) {
        let columns = self.truth.iter_mut().zip(truth).chain(self.estimate.iter_mut().zip(estimate));
        columns.for_each(|(column, value)| column.push(value[0]));
        let done = step as usize + 1;
        for column in [&mut self.measured, &mut self.innovation, &mut self.normalised].into_iter().flatten() {
            column.resize(done, f64::NAN);
        }
    }
}
