//! Runs by number, on all threads.

use crate::numerics::progress::{advance, checkpoint};
use std::borrow::Cow;
use std::ops::Range;

use pulp::Arch;
use rayon::prelude::*;

use super::course::{AxisCourse, EpochCourse};
use super::kernels::{Absorb, Stretch};
use super::lanes::{CHUNK, LANES, Lane, Truth};
use super::scratch::{ChannelSums, Observer, Runs, Scratch};
use super::spread::Spread;
use super::sums::{Layout, NIS_BINS, Totals};

/// Steps (of all runs and axes) between two looks at the clock and at a request to stop.
const BATCH_STEPS: u64 = 20_000_000;

/// An experiment ready to run: the courses of its axes and the seed.
#[derive(Clone, Debug)]
pub struct Course {
    pub axes: Vec<AxisCourse>,
    pub steps: u64,
    pub seed: u64,
    pub dt: f64,
    /// The truths at their nominal parameters, and where every run has its own, how it is drawn.
    nominal: Vec<Truth>,
    spreads: Vec<Option<Spread>>,
}

impl Course {
    /// `spreads`: one per axis.
    pub(super) fn new(axes: Vec<AxisCourse>, spreads: Vec<Option<Spread>>, steps: u64, seed: u64, dt: f64) -> Course {
        let nominal = axes.iter().map(|axis| Truth::of_one(&axis.truth)).collect();
        Course { axes, steps, seed, dt, nominal, spreads }
    }

    /// Sums over `runs`, one per axis. Who waits hears of each run of each axis.
    ///
    /// Every random number is addressed by (seed, run, axis, source) and the sums are exact: any number of threads,
    /// any cut into ranges gives the same.
    pub fn sums(&self, runs: Range<u64>) -> Vec<Totals> {
        let groups = (runs.end - runs.start).div_ceil(LANES as u64);
        let zero = || self.axes.iter().map(|axis| Totals::new(&axis.layout)).collect::<Vec<_>>();
        (0..groups * self.axes.len() as u64)
            .into_par_iter()
            // a stop is a panic, after which each of the many groups would begin before it hears of it
            .panic_fuse()
            .fold(
                || (zero(), self.axes.iter().map(|_| None).collect::<Vec<Option<Scratch>>>()),
                |(mut totals, mut scratch), item| {
                    let (axis, first) = ((item / groups) as usize, runs.start + item % groups * LANES as u64);
                    self.group(axis as u32, first, &runs, &mut totals[axis], &mut scratch[axis]);
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
    fn group(&self, number: u32, first: u64, runs: &Range<u64>, totals: &mut Totals, scratch: &mut Option<Scratch>) {
        let scratch = scratch.get_or_insert_with(|| Scratch::new(&self.axes[number as usize]));
        let eight = self.from(number, first, scratch);
        simulate(&self.axes[number as usize], eight, scratch, None);
        let used = (runs.end - first).min(LANES as u64);
        for (values, counts) in scratch.values.iter().zip(&scratch.counts).take(used as usize) {
            totals.add(values, counts);
        }
        advance(used);
    }

    /// `first` and the seven runs after it, of one axis, at their start.
    pub(super) fn from(&self, number: u32, first: u64, scratch: &mut Scratch) -> Runs<'_> {
        self.start(number, std::array::from_fn(|l| first.saturating_add(l as u64)), scratch)
    }

    fn start(&self, number: u32, runs: [u64; LANES], scratch: &mut Scratch) -> Runs<'_> {
        let axis = &self.axes[number as usize];
        let model = self.drawn(number, runs).map_or(Cow::Borrowed(&self.nominal[number as usize]), Cow::Owned);
        Runs::new(axis, number, model, self.seed, runs, scratch)
    }

    /// The truths of these runs, where every run has its own.
    fn drawn(&self, number: u32, runs: [u64; LANES]) -> Option<Truth> {
        let axis = &self.axes[number as usize];
        let spread = self.spreads[number as usize].as_ref()?;
        let models = runs.map(|run| spread.draw(self.seed, run, number, &axis.truth));
        Some(Truth::of(models.each_ref()))
    }

    /// [`sums`](Course::sums) in batches of a fraction of a second; after each, `pause` is given the sums so far and
    /// the number of the next run, and says whether to stop. Returns the sums and the end of the range that was
    /// done.
    pub fn sums_until(
        &self,
        runs: Range<u64>,
        start: Option<Vec<Totals>>,
        pause: &mut dyn FnMut(&[Totals], u64) -> bool,
    ) -> (Vec<Totals>, u64) {
        let per_run = self.steps * self.axes.len() as u64;
        let batch = (BATCH_STEPS / per_run).next_multiple_of(2 * LANES as u64).max(2 * LANES as u64);
        let mut totals = start.unwrap_or_else(|| self.axes.iter().map(|axis| Totals::new(&axis.layout)).collect());
        let mut next = runs.start;
        while next < runs.end {
            let end = next.saturating_add(batch).min(runs.end);
            let fresh = self.sums(next..end);
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

    /// Eight runs, `first` and those after it, at every `every`-th step: what a figure needs, however long a run is.
    /// By axis, then by run.
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

/// Runs `runs` through the axis; results are in `scratch.values` and `scratch.counts`, one lane per run.
///
/// A run: x(0) ~ N(x0, P0), then z = H x + v, update with the gain of that step, x ← F x + w, and so on. The inner
/// loops are compiled for each instruction set; operations and their order are the same in all, and so are the bits.
fn simulate(axis: &AxisCourse, mut runs: Runs, scratch: &mut Scratch, mut observer: Option<&mut dyn Observer>) {
    let arch = Arch::new();
    scratch.channels.iter_mut().for_each(ChannelSums::start);
    scratch.counts.iter_mut().for_each(|counts| counts.fill(0));
    let mut step = 0;
    let mut epochs = axis.epochs.iter().enumerate().peekable();
    while step < axis.gains.steps {
        checkpoint();
        runs.draw(scratch);
        if axis.moved_back {
            runs.move_back();
        }
        let end = (step + CHUNK as u64).min(axis.gains.steps);
        while step < end {
            // up to the next epoch, whose errors are judged
            let stop = epochs.peek().map_or(end, |(_, epoch)| (epoch.step + 1).min(end));
            let observer = observer.as_mut().map(|observer| &mut **observer as &mut dyn Observer);
            arch.dispatch(Stretch { axis, runs: &mut runs, scratch, observer, step, stop });
            step = stop;
            if let Some((i, epoch)) = epochs.next_if(|(_, epoch)| epoch.step + 1 == stop) {
                judge(epoch, i, &axis.layout, &runs, scratch);
            }
        }
        for (c, (sums, channel)) in scratch.channels.iter_mut().zip(&axis.channels).enumerate() {
            let place = axis.layout.histogram(c);
            let histogram = scratch.counts.each_mut().map(|counts| &mut counts[place..=place + NIS_BINS]);
            arch.dispatch(Absorb { sums, base: channel.base, histogram });
        }
    }
    for (c, (sums, channel)) in scratch.channels.iter_mut().zip(&axis.channels).enumerate() {
        sums.finish(channel, c, &axis.layout, &mut scratch.values);
    }
}

/// The errors at an epoch.
fn judge(epoch: &EpochCourse, number: usize, layout: &Layout, runs: &Runs, scratch: &mut Scratch) {
    let (Runs { truth, estimate, .. }, Scratch { values, counts, .. }) = (runs, scratch);
    let size = epoch.sigma.len();
    for l in 0..LANES {
        let (place, mean, moments) = (layout.epoch(number), layout.mean(number), layout.moments(number));
        let values = &mut values[l];
        let mut nees = 0.0;
        for i in 0..size {
            let known: f64 = truth.iter().enumerate().map(|(j, x)| epoch.of_truth[(i, j)] * x[l]).sum();
            let found: f64 = estimate.iter().enumerate().map(|(j, x)| epoch.of_estimate[(i, j)] * x[l]).sum();
            let u = known - found;
            values[mean + i] = u;
            nees += u * u;
        }
        values[place] = nees.log10();
        let mut at = moments;
        for i in 0..size {
            for j in 0..=i {
                values[at] = values[mean + i] * values[mean + j];
                at += 1;
            }
        }
        for i in 0..size {
            let error: f64 = (0..=i).map(|j| epoch.root[(i, j)] * values[mean + j]).sum();
            let ratio = error.abs() / epoch.sigma[i];
            for (sigmas, count) in (1..=3).zip(&mut counts[l][layout.within(number, i)..][..3]) {
                *count += u32::from(ratio <= f64::from(sigmas));
            }
        }
    }
}
