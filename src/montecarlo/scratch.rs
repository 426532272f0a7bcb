//! Memory of a worker: eight runs under way, their random numbers, and what is summed up of them.

use std::borrow::Cow;
use std::sync::Arc;

use pulp::{Arch, NullaryFnOnce};
use realfft::num_complex::Complex;
use realfft::{RealFftPlanner, RealToComplex};

use super::course::AxisCourse;
use super::lanes::{Aligned, CHUNK, LANES, Lane, Transition, Truth, entries};
use super::sums::{Channel, Layout};
use crate::numerics::normals::Normals;
use crate::numerics::random::StreamId;

/// Term part of the stream addresses of an experiment, beside those of [`crate::simulate`]: initial state, process
/// noise of column i of the root of Q, noise of measurement i.
const START: u32 = 0x10_0000;
const PROCESS: u32 = 0x11_0000;
const MEASUREMENT: u32 = 0x12_0000;

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

/// What the inner loop needs to judge errors at every step, and what it adds up.
pub(super) struct Judged {
    pub(super) whiten: Arc<Whitening>,
    pub(super) components: usize,
    /// Of the steps of a chunk, each lane: Σ over the runs that have taken it.
    pub(super) nees: Aligned,
    /// The same of ν²/S, by measurements, at those steps that have it.
    pub(super) nis: Vec<Aligned>,
    /// 1 for the lanes that are runs, 0 for those beyond the last.
    pub(super) used: Lane,
    /// Σ over the runs so far, by steps.
    pub(super) nees_sum: Vec<f64>,
    pub(super) nis_sum: Vec<Vec<f64>>,
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

    pub(super) fn finish(&mut self, channel: &Channel, number: usize, layout: &Layout, values: &mut [Vec<f64>; LANES]) {
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

    /// Truth and estimate by the same way, so that the estimate is zero.
    pub(super) fn move_back(&mut self) {
        for (truth, estimate) in self.truth.iter_mut().zip(&mut self.estimate) {
            truth.iter_mut().zip(estimate.iter()).for_each(|(truth, estimate)| *truth -= estimate);
            estimate.fill(0.0);
        }
    }
}

fn draw(normals: &mut Normals<LANES>, words: &mut [[u64; LANES]], numbers: &mut Aligned) {
    Arch::new().dispatch(Draw { normals, words, numbers: numbers.lanes_mut() });
}

/// Fresh numbers of a source of noise.
struct Draw<'a> {
    normals: &'a mut Normals<LANES>,
    words: &'a mut [[u64; LANES]],
    numbers: &'a mut [Lane],
}

impl NullaryFnOnce for Draw<'_> {
    type Output = ();
    #[inline(always)]
    fn call(self) {
        self.normals.fill(self.words, self.numbers);
    }
}

/// W A and W B by rows, step after step, with W the whitening of the claimed covariance of e = A x − B x̂.
pub(super) struct Whitening {
    pub(super) of_truth: Vec<f64>,
    /// Empty where A = B.
    pub(super) of_estimate: Vec<f64>,
}

impl Judged {
    /// Rows of W A and W B (none where A = B) of `count` steps from `first` on, where both have `N` states; where their
    /// NEES is added, and the lanes that count.
    #[inline(always)]
    pub(super) fn of<const N: usize>(&mut self, first: usize, count: usize) -> ([&[[f64; N]]; 2], &mut [Lane], Lane) {
        let rows = first * self.components..(first + count) * self.components;
        let of_truth = &self.whiten.of_truth.as_chunks().0[rows.clone()];
        let of_estimate = self.whiten.of_estimate.as_chunks().0.get(rows).unwrap_or_default();
        ([of_truth, of_estimate], &mut self.nees.lanes_mut()[first % CHUNK..][..count], self.used)
    }

    /// Adds the NEES of a step.
    #[inline(always)]
    pub(super) fn errors(&mut self, step: usize, truth: &[Lane], estimate: &[Lane]) {
        let Whitening { of_truth, of_estimate } = &*self.whiten;
        let of_estimate = if of_estimate.is_empty() { of_truth } else { of_estimate };
        let mut nees = [0.0; LANES];
        for row in step * self.components..(step + 1) * self.components {
            let of_truth = product(&of_truth[row * truth.len()..], truth);
            let of_estimate = product(&of_estimate[row * estimate.len()..], estimate);
            for l in 0..LANES {
                let u = of_truth[l] - of_estimate[l];
                nees[l] += u * u;
            }
        }
        let sum = &mut self.nees.lanes_mut()[step % CHUNK];
        for l in 0..LANES {
            sum[l] += nees[l] * self.used[l];
        }
    }
}

/// Σ a x.
#[inline(always)]
fn product(a: &[f64], x: &[Lane]) -> Lane {
    let mut sum = [0.0; LANES];
    for (a, x) in a.iter().zip(x) {
        for l in 0..LANES {
            sum[l] += a * x[l];
        }
    }
    sum
}
