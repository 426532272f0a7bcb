//! Runs side by side: four at a time go through the same gains, so that one instruction serves several runs.
//!
//! Lanes never mix: the numbers of a run do not depend on which runs are beside it.

use std::sync::Arc;

use nalgebra::DMatrix;
use rand::rngs::ChaCha8Rng;
use realfft::num_complex::Complex;
use realfft::{RealFftPlanner, RealToComplex};

use super::course::{AxisCourse, Channel};
use super::sums::{Layout, NIS_BIN, NIS_BINS};
use crate::model::LinearModel;
use crate::numerics::linalg::cholesky_semidefinite;
use crate::numerics::random::{StreamId, fill_normal, normal, stream};

/// Runs side by side.
pub(super) const LANES: usize = 4;
/// One number of each run.
pub(super) type Lane = [f64; LANES];

/// Steps whose random numbers are drawn at once.
const CHUNK: usize = 256;

/// Term part of the stream addresses of an experiment, beside those of [`crate::simulate`]: initial state, process noise of column i of
/// the root of Q, noise of measurement i, and the drawn parameters of `--truth-spread`.
const START: u32 = 0x10_0000;
const PROCESS: u32 = 0x11_0000;
const MEASUREMENT: u32 = 0x12_0000;
pub(super) const PARAMETERS: u32 = 0x13_0000;

/// Entries of a matrix that are not zero in some lane: (row, column, values).
type Entries<T> = Vec<(usize, usize, T)>;

/// The truth as the inner loop wants it, one model per lane.
#[derive(Clone, Debug)]
pub(super) struct Truth {
    x0: Vec<Lane>,
    f: Transition<Lane>,
    h: Vec<Vec<Lane>>,
    /// Columns of the roots of P0 and Q: (row, value).
    start: Vec<Vec<(usize, Lane)>>,
    process: Vec<Vec<(usize, Lane)>>,
    root_r: Vec<Lane>,
}

/// x ← F x.
#[derive(Clone, Debug)]
struct Transition<T> {
    /// Set when F is diagonal.
    diagonal: Vec<T>,
    entries: Entries<T>,
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

impl Transition<Lane> {
    fn apply(&self, x: &mut [Lane], scratch: &mut [Lane]) {
        if self.diagonal.len() == x.len() {
            for (x, f) in x.iter_mut().zip(&self.diagonal) {
                for l in 0..LANES {
                    x[l] *= f[l];
                }
            }
            return;
        }
        scratch.fill([0.0; LANES]);
        for (i, j, f) in &self.entries {
            for l in 0..LANES {
                scratch[*i][l] += f[l] * x[*j][l];
            }
        }
        x.copy_from_slice(&scratch[..x.len()]);
    }
}

/// Sees every number of a run; the engine does not look.
pub(super) trait Observer {
    fn step(&mut self, _step: u64, _truth: &[Lane], _estimate: &[Lane]) {}
    fn update(&mut self, _channel: usize, _measured: &Lane, _innovation: &Lane, _normalised: &Lane) {}
}

/// Looks at nothing.
pub(super) struct Blind;
impl Observer for Blind {}

/// Memory of a worker: taken once for an axis.
pub(super) struct Scratch {
    truth: Vec<Lane>,
    estimate: Vec<Lane>,
    spare: Vec<Lane>,
    f: Transition<Lane>,
    h: Vec<Vec<f64>>,
    process: Vec<Vec<Lane>>,
    noise: Vec<Vec<Lane>>,
    draws: Vec<f64>,
    channels: Vec<ChannelSums>,
    /// Results of each lane, by the [`Layout`].
    pub(super) values: [Vec<f64>; LANES],
    pub(super) counts: [Vec<u32>; LANES],
}

/// Running sums of one measurement's innovations.
struct ChannelSums {
    /// The last `lags` normalised innovations, then those of this chunk.
    y: Vec<Lane>,
    lags: usize,
    sum: Lane,
    squares: Lane,
    products: Vec<Lane>,
    block: Lane,
    filled: u64,
    blocks: Vec<Lane>,
    fft: Arc<dyn RealToComplex<f64>>,
    series: Vec<f64>,
    spectrum: Vec<Complex<f64>>,
    fft_scratch: Vec<Complex<f64>>,
}

impl ChannelSums {
    fn new(channel: &Channel) -> ChannelSums {
        let fft = RealFftPlanner::new().plan_fft_forward(channel.blocks);
        ChannelSums {
            y: Vec::with_capacity(channel.lags + CHUNK),
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

    fn start(&mut self) {
        self.y.clear();
        self.y.resize(self.lags, [0.0; LANES]);
        (self.sum, self.squares, self.block, self.filled) = ([0.0; LANES], [0.0; LANES], [0.0; LANES], 0);
        self.products.fill([0.0; LANES]);
        self.blocks.clear();
    }

    /// Adds the innovations of a chunk up and keeps the last ones.
    fn absorb(&mut self, base: u64, histogram: &mut [&mut [u32]; LANES]) {
        let fresh = &self.y[self.lags..];
        for y in fresh {
            for ((sum, squares), y) in self.sum.iter_mut().zip(&mut self.squares).zip(y) {
                *sum += y;
                *squares += y * y;
            }
        }
        for (h, product) in self.products.iter_mut().enumerate() {
            let past = &self.y[self.lags - h - 1..];
            let mut sum = [0.0; LANES];
            for (y, p) in fresh.iter().zip(past) {
                for l in 0..LANES {
                    sum[l] += y[l] * p[l];
                }
            }
            for l in 0..LANES {
                product[l] += sum[l];
            }
        }
        for y in fresh {
            for (counts, y) in histogram.iter_mut().zip(y) {
                let bin = (y * y / NIS_BIN) as usize;
                counts[bin.min(NIS_BINS)] += 1;
            }
        }
        let mut rest = fresh;
        while !rest.is_empty() {
            let (some, later) = rest.split_at(rest.len().min((base - self.filled) as usize));
            for y in some {
                for (block, y) in self.block.iter_mut().zip(y) {
                    *block += y;
                }
            }
            self.filled += some.len() as u64;
            if self.filled == base {
                self.blocks.push(self.block);
                (self.block, self.filled) = ([0.0; LANES], 0);
            }
            rest = later;
        }
        let kept = self.y.len() - self.lags;
        self.y.copy_within(kept.., 0);
        self.y.truncate(self.lags);
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
            truth: vec![[0.0; LANES]; m],
            estimate: vec![[0.0; LANES]; n],
            spare: vec![[0.0; LANES]; n.max(m)],
            f: Transition::new(n, entries([&axis.filter.f; LANES])),
            h: axis.filter.h.row_iter().map(|row| row.iter().copied().collect()).collect(),
            process: Vec::new(),
            noise: vec![vec![[0.0; LANES]; CHUNK]; axis.channels.len()],
            draws: vec![0.0; CHUNK],
            channels: axis.channels.iter().map(ChannelSums::new).collect(),
            values: std::array::from_fn(|_| vec![0.0; layout.values]),
            counts: std::array::from_fn(|_| vec![0; layout.counts]),
        }
    }
}

/// Streams of one source of noise, one per run.
struct Streams([ChaCha8Rng; LANES]);

impl Streams {
    fn new(seed: u64, runs: [u64; LANES], axis: u32, term: u32) -> Streams {
        Streams(runs.map(|run| stream(seed, StreamId { run, axis, term })))
    }
    fn one(&mut self) -> Lane {
        self.0.each_mut().map(normal)
    }
    fn fill(&mut self, out: &mut [Lane], draws: &mut [f64]) {
        let draws = &mut draws[..out.len()];
        for (l, rng) in self.0.iter_mut().enumerate() {
            fill_normal(rng, draws);
            for (out, draw) in out.iter_mut().zip(draws.iter()) {
                out[l] = *draw;
            }
        }
    }
}

/// Runs `runs` through the axis; results are in `scratch.values` and `scratch.counts`, one lane per run.
///
/// A run: x(0) ~ N(x0, P0), then z = H x + v, update with the gain of that step, x ← F x + w, and so on.
pub(super) fn simulate<O: Observer>(
    axis: &AxisCourse,
    number: u32,
    truth: &Truth,
    seed: u64,
    runs: [u64; LANES],
    scratch: &mut Scratch,
    observer: &mut O,
) {
    let address = |term| Streams::new(seed, runs, number, term);
    let mut process: Vec<Streams> = (0..).zip(&truth.process).map(|(i, _)| address(PROCESS + i)).collect();
    let mut noise: Vec<Streams> = (0..).zip(&axis.channels).map(|(i, _)| address(MEASUREMENT + i)).collect();
    scratch.process.resize(process.len(), vec![[0.0; LANES]; CHUNK]);
    scratch.channels.iter_mut().for_each(ChannelSums::start);
    scratch.counts.iter_mut().for_each(|counts| counts.fill(0));
    let Scratch { truth: x, estimate, spare, f, h, .. } = scratch;
    x.copy_from_slice(&truth.x0);
    let mut start = address(START);
    for column in &truth.start {
        let draw = start.one();
        for (i, root) in column {
            for l in 0..LANES {
                x[*i][l] += root[l] * draw[l];
            }
        }
    }
    for (state, x0) in estimate.iter_mut().zip(axis.filter.x0.iter()) {
        *state = [*x0; LANES];
    }
    let n = axis.gains.states;
    let mut gains = axis.gains.gains.chunks_exact(n).zip(&axis.gains.weights);
    let mut epochs = axis.epochs.iter().enumerate().peekable();
    let mut step = 0;
    while step < axis.gains.steps {
        let count = (axis.gains.steps - step).min(CHUNK as u64) as usize;
        for (streams, buffer) in process.iter_mut().zip(&mut scratch.process) {
            streams.fill(&mut buffer[..count], &mut scratch.draws);
        }
        for ((streams, buffer), channel) in noise.iter_mut().zip(&mut scratch.noise).zip(&axis.channels) {
            let due = (step + count as u64).div_ceil(channel.every) - step.div_ceil(channel.every);
            streams.fill(&mut buffer[..due as usize], &mut scratch.draws);
        }
        for k in 0..count {
            if step > 0 {
                truth.f.apply(x, spare);
                for (column, draws) in truth.process.iter().zip(&scratch.process) {
                    let draw = &draws[k];
                    for (i, root) in column {
                        for l in 0..LANES {
                            x[*i][l] += root[l] * draw[l];
                        }
                    }
                }
                f.apply(estimate, spare);
            }
            for (c, channel) in axis.channels.iter().enumerate() {
                if channel.every != 1 && step % channel.every != 0 {
                    continue;
                }
                let Some((gain, weight)) = gains.next() else { continue };
                let sums = &mut scratch.channels[c];
                let draw = &scratch.noise[c][sums.y.len() - sums.lags];
                let mut z = [0.0; LANES];
                for (h, x) in truth.h[c].iter().zip(x.iter()) {
                    for l in 0..LANES {
                        z[l] += h[l] * x[l];
                    }
                }
                for l in 0..LANES {
                    z[l] += truth.root_r[c][l] * draw[l];
                }
                let mut innovation = z;
                for (h, x) in h[c].iter().zip(estimate.iter()) {
                    for l in 0..LANES {
                        innovation[l] -= h * x[l];
                    }
                }
                for (x, k) in estimate.iter_mut().zip(gain) {
                    for l in 0..LANES {
                        x[l] += k * innovation[l];
                    }
                }
                let y = innovation.map(|v| v * weight);
                sums.y.push(y);
                observer.update(c, &z, &innovation, &y);
            }
            observer.step(step, x, estimate);
            if let Some((i, epoch)) = epochs.next_if(|(_, epoch)| epoch.step == step) {
                judge(epoch, i, &axis.layout, x, estimate, &mut scratch.values, &mut scratch.counts);
            }
            step += 1;
        }
        for (c, (sums, channel)) in scratch.channels.iter_mut().zip(&axis.channels).enumerate() {
            let place = axis.layout.histogram(c);
            let mut histogram = scratch.counts.each_mut().map(|counts| &mut counts[place..=place + NIS_BINS]);
            sums.absorb(channel.base, &mut histogram);
        }
    }
    for (c, (sums, channel)) in scratch.channels.iter_mut().zip(&axis.channels).enumerate() {
        sums.finish(channel, c, &axis.layout, &mut scratch.values);
    }
}

/// The errors at an epoch.
fn judge(
    epoch: &super::course::EpochCourse,
    number: usize,
    layout: &Layout,
    truth: &[Lane],
    estimate: &[Lane],
    values: &mut [Vec<f64>; LANES],
    counts: &mut [Vec<u32>; LANES],
) {
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
