//! Runs side by side: eight at a time go through the same gains, so that one instruction serves several runs.
//!
//! Lanes never mix: the numbers of a run do not depend on which runs are beside it.

use std::borrow::Cow;
use std::sync::Arc;

use nalgebra::DMatrix;
use pulp::Arch;
use realfft::num_complex::Complex;
use realfft::{RealFftPlanner, RealToComplex};

use super::course::{AxisCourse, Channel, EpochCourse};
use super::every_step::Judged;
use super::kernels::{Absorb, Draw, Stretch};
use super::sums::{Layout, NIS_BINS};
use crate::model::LinearModel;
use crate::numerics::linalg::cholesky_semidefinite;
use crate::numerics::normals::Normals;
use crate::numerics::random::StreamId;

/// Runs side by side.
pub(super) const LANES: usize = 8;
/// One number of each run.
pub(super) type Lane = [f64; LANES];

/// Lanes in memory that starts at a cache line, so that a register of a whole lane never crosses two.
#[derive(Clone, Debug)]
pub(super) struct Aligned {
    numbers: Vec<f64>,
    /// Numbers before the first lane.
    offset: usize,
    length: usize,
}

impl Aligned {
    /// Room for so many lanes; empty.
    pub(super) fn new(capacity: usize) -> Aligned {
        let numbers = vec![0.0; (capacity + 1) * LANES];
        // where a platform cannot say, lanes are right but slower
        let offset = numbers.as_ptr().align_offset(size_of::<Lane>());
        Aligned { numbers, offset: if offset < LANES { offset } else { 0 }, length: 0 }
    }
    /// As many lanes, zero.
    pub(super) fn zeros(count: usize) -> Aligned {
        let mut lanes = Aligned::new(count);
        lanes.grow(count);
        lanes
    }
    pub(super) fn len(&self) -> usize {
        self.length
    }
    #[inline(always)]
    pub(super) fn lanes(&self) -> &[Lane] {
        &self.numbers[self.offset..].as_chunks().0[..self.length]
    }
    #[inline(always)]
    pub(super) fn lanes_mut(&mut self) -> &mut [Lane] {
        &mut self.numbers[self.offset..].as_chunks_mut().0[..self.length]
    }
    /// So many lanes more, zero; beyond the capacity there are none.
    #[inline(always)]
    pub(super) fn grow(&mut self, count: usize) {
        let from = self.length;
        self.length = (from + count).min(self.numbers.len() / LANES - 1);
        self.lanes_mut()[from..].fill([0.0; LANES]);
    }
    #[inline(always)]
    pub(super) fn push(&mut self, lane: Lane) {
        self.grow(1);
        if let Some(last) = self.lanes_mut().last_mut() {
            *last = lane;
        }
    }
    pub(super) fn clear(&mut self) {
        self.length = 0;
    }
    #[inline(always)]
    pub(super) fn keep_last(&mut self, count: usize) {
        let from = self.length - count;
        self.lanes_mut().copy_within(from.., 0);
        self.length = count;
    }
}

/// Steps whose random numbers are drawn at once.
pub(super) const CHUNK: usize = 256;

/// Term part of the stream addresses of an experiment, beside those of [`crate::simulate`]: initial state, process noise of column i of
/// the root of Q, noise of measurement i, and the drawn parameters of `--truth-spread`.
const START: u32 = 0x10_0000;
const PROCESS: u32 = 0x11_0000;
const MEASUREMENT: u32 = 0x12_0000;
pub(super) const PARAMETERS: u32 = 0x13_0000;

/// Entries of a matrix that are not zero in some lane: (row, column, values).
pub(super) type Entries<T> = Vec<(usize, usize, T)>;

/// The truth as the inner loop wants it, one model per lane.
#[derive(Clone, Debug)]
pub(super) struct Truth {
    pub(super) x0: Vec<Lane>,
    pub(super) f: Transition<Lane>,
    pub(super) h: Vec<Vec<Lane>>,
    /// Columns of the roots of P0 and Q: (row, value).
    start: Vec<Vec<(usize, Lane)>>,
    pub(super) process: Vec<Vec<(usize, Lane)>>,
    pub(super) root_r: Vec<Lane>,
}

/// x ← F x.
#[derive(Clone, Debug)]
pub(super) struct Transition<T> {
    /// Set when F is diagonal.
    pub(super) diagonal: Vec<T>,
    pub(super) entries: Entries<T>,
}

impl Truth {
    pub(super) fn of_one(model: &LinearModel) -> Truth {
        Truth::of([model; LANES])
    }

    /// The models must be of the same shape.
    pub(super) fn of(models: [&LinearModel; LANES]) -> Truth {
        let n = models[0].x0.len();
        // P0 and Q were checked when the course was made; a root that cannot be taken is that of no noise
        let root = |m: &DMatrix<f64>| cholesky_semidefinite(m).unwrap_or_else(|_| DMatrix::zeros(n, n));
        let (f, h) = (models.map(|m| &m.f), models.map(|m| &m.h));
        let start: [DMatrix<f64>; LANES] = models.map(|m| root(&m.p0));
        let process: [DMatrix<f64>; LANES] = models.map(|m| root(&m.q));
        Truth {
            x0: (0..n).map(|i| models.map(|m| m.x0[i])).collect(),
            f: Transition::new(n, entries(f)),
            h: (0..h[0].nrows()).map(|row| (0..n).map(|j| h.map(|h| h[(row, j)])).collect()).collect(),
            start: columns(n, &entries(start.each_ref())),
            process: columns(n, &entries(process.each_ref())),
            root_r: (0..h[0].nrows()).map(|i| models.map(|m| m.r[(i, i)].sqrt())).collect(),
        }
    }
}

fn entries(matrices: [&DMatrix<f64>; LANES]) -> Entries<Lane> {
    let (rows, columns) = matrices[0].shape();
    let all = (0..rows).flat_map(|i| (0..columns).map(move |j| (i, j)));
    all.map(|(i, j)| (i, j, matrices.map(|m| m[(i, j)]))).filter(|(_, _, v)| *v != [0.0; LANES]).collect()
}

/// Columns that are not zero, in order.
fn columns(n: usize, entries: &Entries<Lane>) -> Vec<Vec<(usize, Lane)>> {
    let column = |j: usize| entries.iter().filter(move |e| e.1 == j).map(|&(i, _, v)| (i, v)).collect();
    (0..n).map(column).filter(|c: &Vec<(usize, Lane)>| !c.is_empty()).collect()
}

impl<T: Copy> Transition<T> {
    fn new(n: usize, entries: Entries<T>) -> Transition<T> {
        let diagonal = entries.len() == n && entries.iter().all(|(i, j, _)| i == j);
        Transition { diagonal: if diagonal { entries.iter().map(|e| e.2).collect() } else { Vec::new() }, entries }
    }
}

/// Sees every number of a run; the engine does not look.
pub(super) trait Observer {
    fn step(&mut self, _step: u64, _truth: &[Lane], _estimate: &[Lane]) {}
    fn update(&mut self, _channel: usize, _measured: &Lane, _innovation: &Lane, _normalised: &Lane) {}
}

/// Memory of a worker: taken once for an axis.
pub(super) struct Scratch {
    pub(super) spare: Vec<Lane>,
    pub(super) f: Transition<Lane>,
    pub(super) h: Vec<Vec<f64>>,
    words: Vec<[u64; LANES]>,
    /// Numbers of a chunk, one per step (of which a measurement that is not taken at every step uses some).
    pub(super) process: Vec<Aligned>,
    pub(super) noise: Vec<Aligned>,
    pub(super) channels: Vec<ChannelSums>,
    /// What every step is judged by, when it is wanted.
    pub(super) judged: Option<Judged>,
    /// Results of each lane, by the [`Layout`].
    pub(super) values: [Vec<f64>; LANES],
    pub(super) counts: [Vec<u32>; LANES],
}

/// Running sums of one measurement's innovations.
pub(super) struct ChannelSums {
    /// The last `lags` normalised innovations, then those of this chunk.
    pub(super) y: Aligned,
    pub(super) lags: usize,
    pub(super) sum: Lane,
    pub(super) squares: Lane,
    pub(super) products: Vec<Lane>,
    pub(super) block: Lane,
    pub(super) filled: u64,
    pub(super) blocks: Vec<Lane>,
    fft: Arc<dyn RealToComplex<f64>>,
    series: Vec<f64>,
    spectrum: Vec<Complex<f64>>,
    fft_scratch: Vec<Complex<f64>>,
}

impl ChannelSums {
    fn new(channel: &Channel) -> ChannelSums {
        let fft = RealFftPlanner::new().plan_fft_forward(channel.blocks);
        ChannelSums {
            y: Aligned::new(channel.lags + CHUNK),
            lags: channel.lags,
            sum: [0.0; LANES],
            squares: [0.0; LANES],
            products: vec![[0.0; LANES]; channel.lags],
            block: [0.0; LANES],
            filled: 0,
            blocks: Vec::with_capacity(channel.blocks),
            series: fft.make_input_vec(),
            spectrum: fft.make_output_vec(),
            fft_scratch: fft.make_scratch_vec(),
            fft,
        }
    }

    pub(super) fn start(&mut self) {
        self.y.clear();
        self.y.grow(self.lags);
        (self.sum, self.squares, self.block, self.filled) = ([0.0; LANES], [0.0; LANES], [0.0; LANES], 0);
        self.products.fill([0.0; LANES]);
        self.blocks.clear();
    }

    fn finish(&mut self, channel: &Channel, number: usize, layout: &Layout, values: &mut [Vec<f64>; LANES]) {
        for (l, values) in values.iter_mut().enumerate() {
            values[layout.sum(number)] = self.sum[l];
            values[layout.squares(number)] = self.squares[l];
            let lags = &mut values[layout.lags(number)..][..channel.lags];
            for (value, product) in lags.iter_mut().zip(&self.products) {
                *value = product[l];
            }
            let powers = &mut values[layout.blocks(number)..][..channel.lengths.len()];
            for (value, length) in powers.iter_mut().zip(&channel.lengths) {
                let sums = self.blocks[..channel.blocks].chunks_exact(*length);
                let total: f64 = sums.map(|block| block.iter().map(|b| b[l]).sum::<f64>().powi(2)).sum();
                *value = total / (*length as u64 * channel.base) as f64;
            }
            if channel.ordinates == 0 {
                continue;
            }
            for (x, block) in self.series.iter_mut().zip(&self.blocks) {
                *x = block[l];
            }
            // the lengths are those of the plan, so that it cannot fail
            let _ = self.fft.process_with_scratch(&mut self.series, &mut self.spectrum, &mut self.fft_scratch);
            let scale = 1.0 / (channel.base as f64 * channel.blocks as f64);
            let ordinates = &mut values[layout.ordinates(number)..][..channel.ordinates];
            for (value, amplitude) in ordinates.iter_mut().zip(&self.spectrum[1..]) {
                *value = amplitude.norm_sqr() * scale;
            }
        }
    }
}

impl Scratch {
    pub(super) fn new(axis: &AxisCourse) -> Scratch {
        let n = axis.filter.x0.len();
        let m = axis.truth.x0.len();
        let layout = &axis.layout;
        Scratch {
            spare: vec![[0.0; LANES]; n.max(m)],
            f: Transition::new(n, entries([&axis.filter.f; LANES])),
            h: axis.filter.h.row_iter().map(|row| row.iter().copied().collect()).collect(),
            words: vec![[0; LANES]; CHUNK],
            process: (0..m).map(|_| Aligned::zeros(CHUNK)).collect(),
            noise: axis.channels.iter().map(|_| Aligned::zeros(CHUNK)).collect(),
            judged: None,
            channels: axis.channels.iter().map(ChannelSums::new).collect(),
            values: std::array::from_fn(|_| vec![0.0; layout.values]),
            counts: std::array::from_fn(|_| vec![0; layout.counts]),
        }
    }
}

/// Eight runs under way: where their truths and estimates stand, and their generators.
pub(super) struct Runs<'a> {
    pub(super) model: Cow<'a, Truth>,
    pub(super) truth: Vec<Lane>,
    pub(super) estimate: Vec<Lane>,
    /// Updates so far.
    pub(super) update: usize,
    process: Vec<Normals<LANES>>,
    noise: Vec<Normals<LANES>>,
}

impl<'a> Runs<'a> {
    /// At step 0: x(0) ~ N(x0, P0).
    pub(super) fn new(
        axis: &AxisCourse,
        number: u32,
        model: Cow<'a, Truth>,
        seed: u64,
        runs: [u64; LANES],
        scratch: &mut Scratch,
    ) -> Runs<'a> {
        let address = |term| Normals::new(seed, runs.map(|run| StreamId { run, axis: number, term }));
        let mut truth = model.x0.clone();
        let mut draws = Aligned::zeros(CHUNK);
        draw(&mut address(START), &mut scratch.words, &mut draws);
        for (column, draw) in model.start.iter().zip(draws.lanes()) {
            for (i, root) in column {
                for l in 0..LANES {
                    truth[*i][l] += root[l] * draw[l];
                }
            }
        }
        Runs {
            truth,
            estimate: axis.filter.x0.iter().map(|x0| [*x0; LANES]).collect(),
            update: 0,
            process: (0..).zip(&model.process).map(|(i, _)| address(PROCESS + i)).collect(),
            noise: (0..).zip(&axis.channels).map(|(i, _)| address(MEASUREMENT + i)).collect(),
            model,
        }
    }

    /// Fresh numbers of all sources for the next chunk.
    pub(super) fn draw(&mut self, scratch: &mut Scratch) {
        let Scratch { words, process, noise, .. } = scratch;
        let sources = self.process.iter_mut().zip(process).chain(self.noise.iter_mut().zip(noise));
        sources.for_each(|(normals, numbers)| draw(normals, words, numbers));
    }
}

fn draw(normals: &mut Normals<LANES>, words: &mut [[u64; LANES]], numbers: &mut Aligned) {
    Arch::new().dispatch(Draw { normals, words, numbers: numbers.lanes_mut() });
}

/// Runs `runs` through the axis; results are in `scratch.values` and `scratch.counts`, one lane per run.
///
/// A run: x(0) ~ N(x0, P0), then z = H x + v, update with the gain of that step, x ← F x + w, and so on. The inner loops are compiled for
/// each instruction set; operations and their order are the same in all, and so are the bits.
pub(super) fn simulate(
    axis: &AxisCourse,
    mut runs: Runs,
    scratch: &mut Scratch,
    mut observer: Option<&mut dyn Observer>,
) {
    let arch = Arch::new();
    scratch.channels.iter_mut().for_each(ChannelSums::start);
    scratch.counts.iter_mut().for_each(|counts| counts.fill(0));
    let mut step = 0;
    let mut epochs = axis.epochs.iter().enumerate().peekable();
    while step < axis.gains.steps {
        runs.draw(scratch);
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
