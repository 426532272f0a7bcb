//! What a filter does on average in a world that is not the one it was designed for: exact means and covariances, no
//! simulation.
//!
//! Filter and truth are linear and the gains do not depend on the data, so the joint state of both is Gaussian and
//! its first two moments follow from a linear recursion. Source: Brown and Hwang 2012, section 5.6 (suboptimal
//! analysis); Gelb 1974, section 7.2 (sensitivity of the error covariance to a wrong model).

mod settled;

use nalgebra::{DMatrix, DVector, DVectorView};

use super::gains::GainSequence;
use super::judge::Judge;
use crate::model::LinearModel;
use crate::numerics::linalg::{cholesky, symmetrise};
use crate::numerics::progress::checkpoint;

pub use settled::{Settled, expect_settled};

/// What a filter does on average when the world is the truth.
#[derive(Clone, Debug, PartialEq)]
pub struct Expectation {
    /// In the order of the epochs of the gains.
    pub epochs: Vec<ExpectedError>,
    /// One per measurement.
    pub innovations: Vec<ExpectedInnovations>,
}

/// The judged error e = A x_truth − B x_filter at an epoch, e ~ N(μ, Σ), SI.
#[derive(Clone, Debug, PartialEq)]
pub struct ExpectedError {
    /// μ.
    pub mean: DVector<f64>,
    /// Σ.
    pub covariance: DMatrix<f64>,
    /// What the filter claims that Σ is, C = B P(k|k) Bᵀ.
    pub claimed: DMatrix<f64>,
}

/// Normalised innovations y = ν/√S of one measurement over the whole run, S as the filter claims it.
#[derive(Clone, Debug, PartialEq)]
pub struct ExpectedInnovations {
    /// Mean over the updates of `E[y²]`: 1 when the filter is right.
    pub nis: f64,
    /// Mean over the updates of `E[y]`.
    pub mean: f64,
    /// For each block length L: mean over the complete blocks of E[(Σ y)²/L], 1 when the filter is right; NaN when
    /// no block is complete.
    pub blocks: Vec<f64>,
}

impl ExpectedError {
    /// E[eᵀ C⁻¹ e] = tr(C⁻¹ Σ) + μᵀ C⁻¹ μ; `None` where C is singular.
    pub fn nees(&self) -> Option<f64> {
        let (mean, covariance) = self.whitened()?;
        Some(covariance.trace() + mean.norm_squared())
    }

    /// var(eᵀ C⁻¹ e) = 2 tr((C⁻¹ Σ)²) + 4 μᵀ C⁻¹ Σ C⁻¹ μ; `None` where C is singular.
    pub fn nees_variance(&self) -> Option<f64> {
        let (mean, covariance) = self.whitened()?;
        Some(2.0 * covariance.norm_squared() + 4.0 * mean.dot(&(&covariance * &mean)))
    }

    /// L⁻¹ μ and L⁻¹ Σ L⁻ᵀ with C = L Lᵀ; `None` where C is singular.
    pub fn whitened(&self) -> Option<(DVector<f64>, DMatrix<f64>)> {
        let l = cholesky(&self.claimed).ok()?;
        let half = l.solve_lower_triangular(&self.covariance)?;
        let covariance = l.solve_lower_triangular(&half.transpose())?;
        Some((l.solve_lower_triangular(&self.mean)?, covariance))
    }
}

/// First and second moments of the errors and innovations of `filter`, run with `gains` in the world `truth`.
///
/// x_truth(0) ~ N(x0, P0) of the truth, x_filter(0) = x0 of the filter exactly, no prediction before the first
/// measurement; then predict, update. `gains` belong to `filter`; `block_lengths` has one list per measurement, in
/// samples of that measurement, each at least 1. The two models must agree in dt and in their measurements (number,
/// order and `every`), which the caller checks.
///
/// With T picking the states of the same name, the joint state is s = [x; e], x those states of the truth that reach
/// the filter's error, e = T x_truth − x_filter:
///
///   e ← F e + (T F_truth − F T) x + T v,   ν = h e + (h_truth − h T) x + w,   e ← e − K ν.
///
/// Any T gives the same result; this one keeps small errors of large states exact and drops x wholly when only noise
/// levels or P0 differ. A block sum a ← a + ν/√S is carried by its variance and its covariance with s.
pub fn expect(
    filter: &LinearModel,
    truth: &LinearModel,
    gains: &GainSequence,
    judge: &Judge,
    block_lengths: &[Vec<u64>],
) -> Expectation {
    assert_eq!(filter.every, truth.every, "measurements");
    assert_eq!(filter.every.len(), block_lengths.len(), "block lengths");
    let joint = Joint::new(filter, truth, judge);
    let mut moments = Moments::new(&joint, block_lengths);
    let mut epochs = Vec::with_capacity(gains.epochs.len());
    for_size!(joint.size, run(&joint, gains, judge, &mut moments, &mut epochs));
    Expectation { epochs, innovations: moments.measurements.into_iter().map(Watched::conclude).collect() }
}

/// The joint system of s = [x; e], n states.
struct Joint {
    size: usize,
    /// Where e begins in s.
    error_at: usize,
    /// Diagonal of the transition Φ, the outer product of it with itself, and the entries beside it as (row, column,
    /// value).
    diagonal: Vec<f64>,
    growth: Vec<f64>,
    coupling: Vec<(usize, usize, f64)>,
    /// Process noise covariance.
    noise: Vec<f64>,
    /// n numbers per measurement: ν = c s + w.
    seen: Vec<f64>,
    /// var w of every measurement, as it truly is.
    r: Vec<f64>,
    /// The judged error is J s.
    judged: DMatrix<f64>,
    mean0: DVector<f64>,
    covariance0: DMatrix<f64>,
}

impl Joint {
    fn new(filter: &LinearModel, truth: &LinearModel, judge: &Judge) -> Joint {
        let (n, m) = (filter.states.len(), truth.states.len());
        let same = |i: usize, j: usize| f64::from(filter.states[i].name == truth.states[j].name);
        let t = DMatrix::from_fn(n, m, same);
        let drive = &t * &truth.f - &filter.f * &t;
        let seen = &truth.h - &filter.h * &t;
        let judged = &judge.of_truth - &judge.of_estimate * &t;
        let kept = reaching(&truth.f, &[&drive, &seen, &judged]);
        let x = kept.len();
        let size = x + n;
        // s = [pick; T] x_truth − [0; I] x_filter
        let pick = DMatrix::from_fn(size, m, |i, j| if i < x { f64::from(kept[i] == j) } else { t[(i - x, j)] });
        let beside = |of_x: &DMatrix<f64>, of_e: &DMatrix<f64>| {
            let column = |i: usize, j: usize| if j < x { of_x[(i, kept[j])] } else { of_e[(i, j - x)] };
            DMatrix::from_fn(of_e.nrows(), size, column)
        };
        let mut phi = DMatrix::zeros(size, size);
        for (i, &row) in kept.iter().enumerate() {
            for (j, &column) in kept.iter().enumerate() {
                phi[(i, j)] = truth.f[(row, column)];
            }
        }
        phi.rows_mut(x, n).copy_from(&beside(&drive, &filter.f));
        let mut mean0 = &pick * &truth.x0;
        let mut start = mean0.rows_mut(x, n);
        start -= &filter.x0;
        let entries = (0..size).flat_map(|i| (0..size).map(move |j| (i, j)));
        let diagonal: Vec<f64> = phi.diagonal().iter().copied().collect();
        Joint {
            size,
            error_at: x,
            growth: DMatrix::from_fn(size, size, |i, j| diagonal[i] * diagonal[j]).as_slice().to_vec(),
            diagonal,
            coupling: entries
                .filter(|&(i, j)| i != j && phi[(i, j)] != 0.0)
                .map(|(i, j)| (i, j, phi[(i, j)]))
                .collect(),
            noise: (&pick * &truth.q * pick.transpose()).as_slice().to_vec(),
            seen: beside(&seen, &filter.h).transpose().as_slice().to_vec(),
            r: truth.r.diagonal().iter().copied().collect(),
            judged: beside(&judged, &judge.of_estimate),
            mean0,
            covariance0: &pick * &truth.p0 * pick.transpose(),
        }
    }
}

/// States of the truth with a share in one of `outputs`, at once or through F.
fn reaching(f: &DMatrix<f64>, outputs: &[&DMatrix<f64>]) -> Vec<usize> {
    let m = f.nrows();
    let mut kept: Vec<bool> = (0..m).map(|j| outputs.iter().any(|a| a.column(j).iter().any(|v| *v != 0.0))).collect();
    // A chain has at most m links.
    for _ in 0..m {
        for j in 0..m {
            kept[j] |= (0..m).any(|i| kept[i] && f[(i, j)] != 0.0);
        }
    }
    (0..m).filter(|&j| kept[j]).collect()
}

/// Moments in progress.
struct Moments {
    /// Columns of n numbers: cov(s, s), then cov(s, a) of every block sum a, then E[s].
    columns: Vec<f64>,
    measurements: Vec<Watched>,
    scratch: Scratch,
}

/// The innovations of one measurement.
struct Watched {
    /// Steps until it is taken again.
    wait: u64,
    /// First of its block sums among all.
    sums_at: usize,
    sums: Vec<BlockSum>,
    updates: u64,
    /// Σ E[y²], Σ E[y].
    square: f64,
    mean: f64,
}

/// A block sum a in progress.
struct BlockSum {
    length: u64,
    /// Updates until the block is complete.
    left: u64,
    mean: f64,
    variance: f64,
    /// Σ E[a²]/L over the complete blocks, and their number.
    total: f64,
    blocks: u64,
}

/// Memory of a step, taken once.
struct Scratch {
    before: Vec<f64>,
    /// c·column.
    dots: Vec<f64>,
    /// Gain of s.
    k: Vec<f64>,
    /// cov(s, ν) after the update.
    p: Vec<f64>,
}

impl BlockSum {
    fn new(length: u64) -> BlockSum {
        assert!(length > 0, "block length");
        BlockSum { length, left: length, mean: 0.0, variance: 0.0, total: 0.0, blocks: 0 }
    }
}

impl Watched {
    fn conclude(self) -> ExpectedInnovations {
        let updates = self.updates as f64;
        let blocks = self.sums.iter().map(|sum| sum.total / sum.blocks as f64).collect();
        ExpectedInnovations { nis: self.square / updates, mean: self.mean / updates, blocks }
    }
}

impl Moments {
    fn new(joint: &Joint, block_lengths: &[Vec<u64>]) -> Moments {
        let n = joint.size;
        let mut measurements = Vec::with_capacity(block_lengths.len());
        let mut all = 0;
        for lengths in block_lengths {
            let sums: Vec<BlockSum> = lengths.iter().map(|&length| BlockSum::new(length)).collect();
            measurements.push(Watched { wait: 0, sums_at: all, updates: 0, square: 0.0, mean: 0.0, sums });
            all += lengths.len();
        }
        let mut columns = vec![0.0; n * (n + all + 1)];
        columns[..n * n].copy_from_slice(joint.covariance0.as_slice());
        columns[n * (n + all)..].copy_from_slice(joint.mean0.as_slice());
        let scratch =
            Scratch { before: columns.clone(), dots: vec![0.0; n + all + 1], k: vec![0.0; n], p: vec![0.0; n] };
        Moments { columns, measurements, scratch }
    }
}

/// A step takes less than a microsecond for each pair of states.
const STEPS_BETWEEN_CHECKPOINTS: u64 = 1024;

/// The whole run; `n` is the size of the joint state.
#[inline(always)]
fn run(
    n: usize,
    joint: &Joint,
    gains: &GainSequence,
    judge: &Judge,
    moments: &mut Moments,
    epochs: &mut Vec<ExpectedError>,
) {
    let mut gain = gains.gains.chunks_exact(gains.states).zip(&gains.weights);
    let mut wanted = gains.epochs.iter().peekable();
    for step in 0..gains.steps {
        if step.is_multiple_of(STEPS_BETWEEN_CHECKPOINTS) {
            checkpoint();
        }
        let Moments { columns, measurements, scratch } = moments;
        if step > 0 {
            predict(n, joint, columns, &mut scratch.before);
        }
        for (i, watched) in measurements.iter_mut().enumerate() {
            if watched.wait == 0 {
                let Some((gain, &weight)) = gain.next() else { return };
                for (k, gain) in scratch.k[joint.error_at..].iter_mut().zip(gain) {
                    *k = -gain;
                }
                let (c, r) = (&joint.seen[i * n..(i + 1) * n], joint.r[i]);
                update(n, c, r, weight, columns, watched, scratch);
                watched.wait = gains.every[i];
            }
            watched.wait -= 1;
        }
        if let Some(epoch) = wanted.next_if(|epoch| epoch.step == step) {
            let claimed = judge.claimed(&epoch.covariance);
            epochs.push(judged(n, joint, columns, claimed));
        }
    }
}

/// s ← Φ s + noise. Nearly every Φ is diagonal.
#[inline(always)]
fn predict(n: usize, joint: &Joint, columns: &mut [f64], before: &mut [f64]) {
    let (diagonal, noise) = (&joint.diagonal[..n], &joint.noise[..n * n]);
    if joint.coupling.is_empty() {
        let (square, others) = columns.split_at_mut(n * n);
        let growth = &joint.growth[..n * n];
        for i in 0..n * n {
            square[i] = square[i] * growth[i] + noise[i];
        }
        for column in others.chunks_exact_mut(n) {
            for i in 0..n {
                column[i] *= diagonal[i];
            }
        }
        return;
    }
    before.copy_from_slice(columns);
    for (column, before) in columns.chunks_exact_mut(n).zip(before.chunks_exact(n)) {
        for i in 0..n {
            column[i] = diagonal[i] * before[i];
        }
    }
    // columns within: no sum waits for the one before it
    for &(i, j, f) in &joint.coupling {
        for (column, before) in columns.chunks_exact_mut(n).zip(before.chunks_exact(n)) {
            column[i] += f * before[j];
        }
    }
    // the columns of cov(s, s) from the right
    let (square, before) = (&mut columns[..n * n], &mut before[..n * n]);
    before.copy_from_slice(square);
    for j in 0..n {
        for i in 0..n {
            square[i + n * j] = diagonal[j] * before[i + n * j] + noise[i + n * j];
        }
    }
    for &(j, k, f) in &joint.coupling {
        for i in 0..n {
            square[i + n * j] += f * before[i + n * k];
        }
    }
}

/// ν = c s + w with var w = r, then s ← s + k ν and a ← a + ν·weight for every block sum of this measurement.
///
/// Every column takes (I + k cᵀ) from the left, E[s] among them; then cov(s, ν) = p goes to the columns of all that
/// ν was added to: C ← (I + k cᵀ) C (I + k cᵀ)ᵀ + k r kᵀ, the form of Bucy and Joseph.
#[inline(always)]
fn update(n: usize, c: &[f64], r: f64, weight: f64, columns: &mut [f64], watched: &mut Watched, scratch: &mut Scratch) {
    let (c, k, p) = (&c[..n], &scratch.k[..n], &mut scratch.p[..n]);
    for (column, dot) in columns.chunks_exact_mut(n).zip(&mut scratch.dots) {
        let mut sum = 0.0;
        for i in 0..n {
            sum += c[i] * column[i];
        }
        for i in 0..n {
            column[i] += k[i] * sum;
        }
        *dot = sum;
    }
    let dots = &scratch.dots[..];
    let mut variance = r;
    for i in 0..n {
        variance += c[i] * dots[i];
        p[i] = k[i] * r;
    }
    let square = &mut columns[..n * n];
    for j in 0..n {
        for i in 0..n {
            p[i] += square[i + n * j] * c[j];
        }
    }
    for i in 0..n {
        for j in 0..=i {
            let value = square[i + n * j] + p[i] * k[j];
            square[i + n * j] = value;
            square[j + n * i] = value;
        }
    }
    let mean = weight * dots[dots.len() - 1];
    watched.updates += 1;
    watched.mean += mean;
    watched.square += weight * weight * variance + mean * mean;
    for (at, sum) in (n + watched.sums_at..).zip(&mut watched.sums) {
        let column = &mut columns[n * at..n * (at + 1)];
        sum.mean += mean;
        sum.variance += weight * (2.0 * dots[at] + weight * variance);
        sum.left -= 1;
        if sum.left > 0 {
            for i in 0..n {
                column[i] += weight * p[i];
            }
            continue;
        }
        sum.total += (sum.variance + sum.mean * sum.mean) / sum.length as f64;
        sum.blocks += 1;
        (sum.left, sum.mean, sum.variance) = (sum.length, 0.0, 0.0);
        column.fill(0.0);
    }
}

fn judged(n: usize, joint: &Joint, columns: &[f64], claimed: DMatrix<f64>) -> ExpectedError {
    let mut covariance = &joint.judged * DMatrix::from_column_slice(n, n, &columns[..n * n]) * joint.judged.transpose();
    symmetrise(&mut covariance);
    let mean = &joint.judged * DVectorView::from_slice(&columns[columns.len() - n..], n);
    ExpectedError { mean, covariance, claimed }
}
