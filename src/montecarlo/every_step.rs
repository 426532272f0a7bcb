//! NEES and NIS at every step, averaged over runs: the curves that textbooks draw.

use std::ops::Range;
use std::sync::Arc;

use pulp::Arch;
use rayon::prelude::*;

use super::course::AxisCourse;
use super::engine::Course;
use super::kernels::{AddSquares, Stretch};
use super::lanes::{Aligned, CHUNK, LANES, Lane};
use super::scratch::{ChannelSums, Judged, Scratch, Whitening};
use super::sums::Channel;
use crate::filter::Kalman;
use crate::filter::judge::Judge;
use crate::numerics::distribution::chi_square_quantile;
use crate::numerics::linalg::cholesky_in_place;

/// Runs whose sums are taken one after the other; sums of such blocks are added in order, so that threads leave no
/// trace.
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
    /// Between these the mean of a true filter's NEES (`components` of it), or NIS (1), is with probability 1 −
    /// alpha at one step: χ² quantiles over N runs × components (Bar-Shalom, Li and Kirubarajan 2001, section
    /// 5.4.2).
    pub fn bounds(&self, components: usize, alpha: f64) -> [f64; 2] {
        let degrees = (self.runs * components as u64) as f64;
        [0.5 * alpha, 1.0 - 0.5 * alpha].map(|p| chi_square_quantile(p, degrees) / degrees)
    }
}

fn whitening(axis: &AxisCourse) -> Whitening {
    let components = axis.judge.size();
    let n = axis.filter.x0.len();
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
    let Judge { of_truth, of_estimate, .. } = &axis.judge;
    let of: &[_] = if of_truth == of_estimate { &[of_truth] } else { &[of_truth, of_estimate] };
    let of = of.iter().map(|of| {
        let mut whiten = vec![0.0; axis.gains.steps as usize * of.len()];
        let steps = covariances.par_chunks_exact(n * n).zip(whiten.par_chunks_exact_mut(of.len()));
        steps.with_min_len(CHUNK).for_each_init(
            || (vec![0.0; components * n], vec![0.0; components * components]),
            |(product, root), (p, whiten)| whitening_at(&axis.judge, p, [product, root], of.as_slice(), whiten),
        );
        whiten
    });
    let mut of = of.collect::<Vec<_>>().into_iter();
    Whitening { of_truth: of.next().unwrap_or_default(), of_estimate: of.next().unwrap_or_default() }
}

/// L⁻¹ A by rows, with A = `of` by columns and L Lᵀ = B P Bᵀ; NaN where that is singular. P by columns; scratch is
/// of c n and c² numbers for c components.
fn whitening_at(judge: &Judge, p: &[f64], [product, root]: [&mut [f64]; 2], of: &[f64], whiten: &mut [f64]) {
    let (c, n, b) = (judge.size(), judge.of_estimate.ncols(), judge.of_estimate.as_slice());
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
    let wide = of.len() / c;
    for i in 0..c {
        let (above, row) = whiten.split_at_mut(i * wide);
        for (j, value) in row[..wide].iter_mut().enumerate() {
            let rest: f64 = (0..i).map(|k| root[i + c * k] * above[k * wide + j]).sum();
            *value = (of[i + c * j] - rest) / root[i + c * i];
        }
    }
}

impl Judged {
    fn new(axis: &AxisCourse, whiten: Arc<Whitening>) -> Judged {
        let steps = axis.gains.steps as usize;
        Judged {
            whiten,
            components: axis.judge.size(),
            nees: Aligned::zeros(CHUNK),
            nis: axis.channels.iter().map(|_| Aligned::zeros(CHUNK)).collect(),
            used: [1.0; LANES],
            nees_sum: vec![0.0; steps],
            nis_sum: vec![vec![0.0; steps]; axis.channels.len()],
        }
    }

    /// Adds the squares of the fresh normalised innovations of every measurement.
    fn absorb(&mut self, channels: &mut [ChannelSums]) {
        for (sums, channel) in self.nis.iter_mut().zip(channels) {
            let y = &channel.y.lanes()[channel.lags..];
            Arch::new().dispatch(AddSquares { y, weight: &self.used, sums: sums.lanes_mut() });
            channel.y.keep_last(channel.lags);
        }
    }

    /// To the sums by steps, when all runs have taken the steps of a chunk.
    fn together(&mut self, steps: Range<u64>, courses: &[Channel]) {
        let chunk = steps.start as usize..steps.end as usize;
        for (sum, nees) in self.nees_sum[chunk].iter_mut().zip(self.nees.lanes_mut()) {
            *sum += lane_sum(&std::mem::take(nees));
        }
        for ((sums, nis), course) in self.nis_sum.iter_mut().zip(&mut self.nis).zip(courses) {
            let taken = steps.clone().filter(|step| course.every <= 1 || step.is_multiple_of(course.every));
            for (step, nis) in taken.zip(nis.lanes_mut()) {
                sums[step as usize] += lane_sum(&std::mem::take(nis));
            }
        }
    }

    fn clear(&mut self) {
        self.nees_sum.fill(0.0);
        self.nis_sum.iter_mut().for_each(|nis| nis.fill(0.0));
    }
}

/// By halves.
fn lane_sum(lane: &Lane) -> f64 {
    let [a, b, c, d]: [f64; 4] = std::array::from_fn(|l| lane[l] + lane[l + 4]);
    (a + c) + (b + d)
}

fn add(total: &mut [f64], more: &[f64]) {
    for (total, more) in total.iter_mut().zip(more) {
        *total += more;
    }
}

impl Course {
    /// Averages over `runs`, the same runs as those of [`sums`](Course::sums), per axis. At most [`MAX_EVERY_STEP`]
    /// steps.
    pub fn every_step(&self, runs: Range<u64>) -> Vec<EveryStep> {
        (0..).zip(&self.axes).map(|(number, axis)| self.every_step_of(number, axis, runs.clone())).collect()
    }

    fn every_step_of(&self, number: u32, axis: &AxisCourse, runs: Range<u64>) -> EveryStep {
        let steps = axis.gains.steps as usize;
        let count = runs.end - runs.start;
        let blocks = count.div_ceil(BLOCK);
        let whiten = Arc::new(whitening(axis));
        let mut nees = vec![0.0; steps];
        let mut nis = vec![vec![0.0; steps]; axis.channels.len()];
        let mut scratches: Vec<Option<Scratch>> = (0..WAVE.min(blocks)).map(|_| None).collect();
        for wave in 0..blocks.div_ceil(WAVE) {
            let first = wave * WAVE;
            let here = (blocks - first).min(WAVE) as usize;
            scratches[..here].par_iter_mut().with_max_len(1).enumerate().for_each(|(place, scratch)| {
                let first = runs.start + (first + place as u64) * BLOCK;
                let scratch = scratch.get_or_insert_with(|| {
                    let mut scratch = Scratch::new(axis);
                    scratch.judged = Some(Judged::new(axis, whiten.clone()));
                    scratch
                });
                self.block(number, first..runs.end.min(first + BLOCK), scratch);
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

    /// Sums over the runs of a block. All of them take a chunk of steps before any takes the next: gains and
    /// whitening are read once.
    fn block(&self, number: u32, runs: Range<u64>, scratch: &mut Scratch) {
        let (axis, arch) = (&self.axes[number as usize], Arch::new());
        scratch.judged.iter_mut().for_each(Judged::clear);
        scratch.channels.iter_mut().for_each(ChannelSums::start);
        let firsts = runs.clone().step_by(LANES);
        let mut groups: Vec<_> = firsts.clone().map(|first| self.from(number, first, scratch)).collect();
        for first in (0..axis.gains.steps).step_by(CHUNK) {
            let steps = first..(first + CHUNK as u64).min(axis.gains.steps);
            for (eight, from) in groups.iter_mut().zip(firsts.clone()) {
                if let Some(judged) = &mut scratch.judged {
                    judged.used = std::array::from_fn(|l| f64::from(u8::from(from + (l as u64) < runs.end)));
                }
                eight.draw(scratch);
                arch.dispatch(Stretch {
                    axis,
                    runs: eight,
                    scratch,
                    observer: None,
                    step: steps.start,
                    stop: steps.end,
                });
                let Scratch { judged, channels, .. } = &mut *scratch;
                judged.iter_mut().for_each(|judged| judged.absorb(channels));
            }
            scratch.judged.iter_mut().for_each(|judged| judged.together(steps.clone(), &axis.channels));
        }
    }
}
