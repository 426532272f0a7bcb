//! NEES and NIS at every step, averaged over runs: the curves that textbooks draw.

use std::ops::Range;
use std::sync::Arc;

use rayon::prelude::*;

use super::course::{AxisCourse, Channel};
use super::engine::Course;
use super::lanes::{Aligned, CHUNK, ChannelSums, LANES, Lane, Scratch};
use crate::filter::Kalman;
use crate::filter::judge::Judge;
use crate::numerics::distribution::chi_square_quantile;
use crate::numerics::linalg::cholesky_in_place;

/// Runs whose sums are taken one after the other; sums of such blocks are added in order, so that threads leave no trace.
const BLOCK: u64 = 64;
/// Blocks under way at once: memory does not grow with the runs.
const WAVE: u64 = 8;
/// Longer runs are refused: every step keeps its whitening.
pub const MAX_EVERY_STEP: u64 = 200_000;

/// Averages of one axis, by steps.
#[derive(Clone, Debug, PartialEq)]
pub struct EveryStep {
    /// Mean of eᵀ P(k|k)⁻¹ e over its components, 1 for a true filter; NaN where P is singular.
    pub nees: Vec<f64>,
    /// Per measurement: mean of ν²/S, NaN at steps without it.
    pub nis: Vec<Vec<f64>>,
    /// Components of e.
    pub components: usize,
    pub runs: u64,
}

impl EveryStep {
    /// Between these the mean of a true filter's NEES (`components` of it), or NIS (1), is with probability 1 − alpha at one step:
    /// χ² quantiles over N runs × components (Bar-Shalom, Li and Kirubarajan 2001, section 5.4.2).
    pub fn bounds(&self, components: usize, alpha: f64) -> [f64; 2] {
        let degrees = (self.runs * components as u64) as f64;
        [0.5 * alpha, 1.0 - 0.5 * alpha].map(|p| chi_square_quantile(p, degrees) / degrees)
    }
}

/// What the inner loop needs to judge errors at every step, and what it adds up.
pub(super) struct Judged {
    /// Per step W A, then W B, by rows, with W the whitening of the claimed covariance of e = A x − B x̂.
    pub(super) whiten: Arc<[f64]>,
    pub(super) components: usize,
    /// Of the steps of a chunk, each lane.
    pub(super) nees: Aligned,
    /// Σ over the runs so far, by steps.
    nees_sum: Vec<f64>,
    nis_sum: Vec<Vec<f64>>,
    /// 1 for the lanes that are runs, 0 for those beyond the last.
    used: Lane,
}

/// Per step W A, then W B.
fn whitening(axis: &AxisCourse) -> Arc<[f64]> {
    let components = axis.judge.size();
    let (n, m) = (axis.filter.x0.len(), axis.truth.x0.len());
    let mut covariances = Vec::with_capacity(axis.gains.steps as usize * n * n);
    let mut filter = Kalman::new(&axis.filter);
    for step in 0..axis.gains.steps {
        if step > 0 {
            filter.predict();
        }
        for (i, channel) in axis.channels.iter().enumerate() {
            if step.is_multiple_of(channel.every) {
                filter.update(i, 0.0, None);
            }
        }
        covariances.extend(filter.p.iter());
    }
    let mut whiten = vec![0.0; axis.gains.steps as usize * components * (n + m)];
    let steps = covariances.par_chunks_exact(n * n).zip(whiten.par_chunks_exact_mut(components * (n + m)));
    steps.with_min_len(CHUNK).for_each_init(
        || (vec![0.0; components * n], vec![0.0; components * components]),
        |(product, root), (covariance, whiten)| {
            whitening_at(&axis.judge, n, covariance, product, root, whiten);
        },
    );
    whiten.into()
}

/// L⁻¹ A, then L⁻¹ B, by rows, with L Lᵀ = B P Bᵀ; NaN where that is singular. P by columns; `product` and `root` are scratch of
/// c n and c² numbers for c components.
fn whitening_at(judge: &Judge, n: usize, p: &[f64], product: &mut [f64], root: &mut [f64], whiten: &mut [f64]) {
    let (c, a, b) = (judge.size(), judge.of_truth.as_slice(), judge.of_estimate.as_slice());
    // B P, then B P Bᵀ, by columns
    for (j, column) in product.chunks_exact_mut(c).enumerate() {
        for (i, value) in column.iter_mut().enumerate() {
            *value = (0..n).map(|k| b[i + c * k] * p[k + n * j]).sum();
        }
    }
    for (j, column) in root.chunks_exact_mut(c).enumerate() {
        for (i, value) in column.iter_mut().enumerate() {
            *value = (0..n).map(|k| product[i + c * k] * b[j + c * k]).sum();
        }
    }
    if cholesky_in_place(root, c).is_err() {
        whiten.fill(f64::NAN);
        return;
    }
    let (of_truth, of_estimate) = whiten.split_at_mut(a.len());
    for (of, whiten) in [(a, of_truth), (b, of_estimate)] {
        let wide = of.len() / c;
        for i in 0..c {
            let (above, row) = whiten.split_at_mut(i * wide);
            for (j, value) in row[..wide].iter_mut().enumerate() {
                let rest: f64 = (0..i).map(|k| root[i + c * k] * above[k * wide + j]).sum();
                *value = (of[i + c * j] - rest) / root[i + c * i];
            }
        }
    }
}

impl Judged {
    fn new(axis: &AxisCourse, whiten: Arc<[f64]>) -> Judged {
        let steps = axis.gains.steps as usize;
        let mut nees = Aligned::new(CHUNK);
        nees.grow(CHUNK);
        Judged {
            whiten,
            components: axis.judge.size(),
            nees,
            nees_sum: vec![0.0; steps],
            nis_sum: vec![vec![0.0; steps]; axis.channels.len()],
            used: [1.0; LANES],
        }
    }

    /// The NEES of a step.
    #[inline(always)]
    pub(super) fn errors(&mut self, step: usize, truth: &[Lane], estimate: &[Lane]) {
        let (size, wide) = (self.components, truth.len() + estimate.len());
        let rows = &self.whiten[step * size * wide..][..size * wide];
        let (of_truth, of_estimate) = rows.split_at(size * truth.len());
        let mut nees = [0.0; LANES];
        for row in 0..size {
            let mut u = [0.0; LANES];
            for (a, x) in of_truth[row * truth.len()..].iter().zip(truth) {
                for l in 0..LANES {
                    u[l] += a * x[l];
                }
            }
            for (b, x) in of_estimate[row * estimate.len()..].iter().zip(estimate) {
                for l in 0..LANES {
                    u[l] -= b * x[l];
                }
            }
            for l in 0..LANES {
                nees[l] += u[l] * u[l];
            }
        }
        self.nees.lanes_mut()[step % CHUNK] = nees;
    }

    /// Adds what the steps of a chunk left: their NEES, and the fresh normalised innovations of every measurement.
    pub(super) fn absorb(&mut self, steps: Range<u64>, channels: &mut [ChannelSums], courses: &[Channel]) {
        let used = self.used;
        let chunk = steps.start as usize..steps.end as usize;
        for (sum, nees) in self.nees_sum[chunk].iter_mut().zip(self.nees.lanes()) {
            *sum += together(std::array::from_fn(|l| nees[l] * used[l]));
        }
        for ((sums, channel), course) in self.nis_sum.iter_mut().zip(channels).zip(courses) {
            let taken = steps.clone().filter(|step| course.every <= 1 || step.is_multiple_of(course.every));
            for (step, y) in taken.zip(&channel.y.lanes()[channel.lags..]) {
                sums[step as usize] += together(std::array::from_fn(|l| y[l] * y[l] * used[l]));
            }
            channel.y.keep_last(channel.lags);
        }
    }

    fn clear(&mut self) {
        self.nees_sum.fill(0.0);
        self.nis_sum.iter_mut().for_each(|nis| nis.fill(0.0));
    }
}

/// The sum of a lane, by halves.
#[inline(always)]
fn together(lane: Lane) -> f64 {
    let [a, b, c, d]: [f64; 4] = std::array::from_fn(|l| lane[l] + lane[l + 4]);
    (a + c) + (b + d)
}

fn add(total: &mut [f64], more: &[f64]) {
    for (total, more) in total.iter_mut().zip(more) {
        *total += more;
    }
}

impl Course {
    /// Averages over `runs`, the same runs as those of [`sums`](Course::sums), per axis. At most [`MAX_EVERY_STEP`] steps.
    pub fn every_step(&self, runs: Range<u64>) -> Vec<EveryStep> {
        (0..).zip(&self.axes).map(|(number, axis)| self.every_step_of(number, axis, runs.clone())).collect()
    }

    fn every_step_of(&self, number: u32, axis: &AxisCourse, runs: Range<u64>) -> EveryStep {
        let steps = axis.gains.steps as usize;
        let count = runs.end - runs.start;
        let blocks = count.div_ceil(BLOCK);
        let whiten = whitening(axis);
        let mut nees = vec![0.0; steps];
        let mut nis = vec![vec![0.0; steps]; axis.channels.len()];
        let mut scratches: Vec<Option<Scratch>> = (0..WAVE.min(blocks)).map(|_| None).collect();
        for wave in 0..blocks.div_ceil(WAVE) {
            let first = wave * WAVE;
            let here = (blocks - first).min(WAVE) as usize;
            scratches[..here].par_iter_mut().enumerate().for_each(|(place, scratch)| {
                let block = first + place as u64;
                let scratch = scratch.get_or_insert_with(|| {
                    let mut scratch = Scratch::new(axis);
                    scratch.judged = Some(Judged::new(axis, whiten.clone()));
                    scratch
                });
                scratch.judged.iter_mut().for_each(Judged::clear);
                let end = runs.end.min(runs.start + (block + 1) * BLOCK);
                for first in (runs.start + block * BLOCK..end).step_by(LANES) {
                    if let Some(judged) = &mut scratch.judged {
                        judged.used = std::array::from_fn(|l| f64::from(u8::from(first + (l as u64) < end)));
                    }
                    self.runs_of(number, first, scratch);
                }
            });
            for judged in scratches[..here].iter().flatten().filter_map(|scratch| scratch.judged.as_ref()) {
                add(&mut nees, &judged.nees_sum);
                nis.iter_mut().zip(&judged.nis_sum).for_each(|(nis, sums)| add(nis, sums));
            }
        }
        let components = axis.judge.size();
        nees.iter_mut().for_each(|sum| *sum /= (count * components as u64) as f64);
        for (nis, channel) in nis.iter_mut().zip(&axis.channels) {
            for (step, sum) in (0..).zip(nis.iter_mut()) {
                *sum = if channel.every <= 1 || u64::is_multiple_of(step, channel.every) {
                    *sum / count as f64
                } else {
                    f64::NAN
                };
            }
        }
        EveryStep { nees, nis, components, runs: count }
    }
}
