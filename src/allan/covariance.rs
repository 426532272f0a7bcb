//! Covariance between overlapping Allan points, for any mixture of given processes at once.

use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};

use nalgebra::DMatrix;
use rayon::prelude::*;

use super::squares::folded;
use super::{Deviation, deviation, lag_sum};
use crate::noise::{NoiseModel, Term};
use crate::numerics::progress::checkpoint;

/// Covariance matrix of the overlapping Allan *variance* estimates at several averaging factors, from `samples` rate
/// samples of period `dt` (s), for a Gaussian mixture: with c the cross-covariance of the second differences and μ
/// their means, `cov(σ̂²_1, σ̂²_2) = Σ_k Σ_l [2 c(l−k)² + 4 μ_1 μ_2 c(l−k)] / (4 tau_1² tau_2² M_1 M_2)`, unit⁴.
///
/// Rows of factors at which no difference fits are NaN. Cost: about a thousand covariances per pair, whatever the
/// length.
pub fn covariance(factors: &[u64], samples: usize, dt: f64, model: &NoiseModel) -> DMatrix<f64> {
    let slope = |term: &Term| if let Term::RateRamp { slope } = term { *slope } else { 0.0 };
    let random = model.terms.iter().copied().filter(|term| !matches!(term, Term::RateRamp { .. }));
    let form = Form::new(factors, samples, dt, random.collect());
    let all: Vec<(usize, f64)> = (0..form.processes.len()).map(|process| (process, 1.0)).collect();
    form.covariance(&all, model.terms.iter().map(slope).sum())
}

/// The covariance of the Allan variances as a quadratic form in the squares of the coefficients of some processes.
///
/// c is linear in them, hence the covariance a sum over pairs of processes, whose parts are worked out once, when
/// they are first asked for; and a part per process that a ramp brings. Rounding apart, nothing is neglected.
/// Threads that ask at the same time share the work.
#[derive(Debug)]
pub struct Form {
    factors: Vec<u64>,
    samples: usize,
    dt: f64,
    processes: Vec<Term>,
    /// Row by row of the lower triangle.
    pairs: Vec<Pair>,
}

/// Two points, and what each pair of processes (a ≥ b, row by row), then each process with a ramp of slope 1/s, adds
/// to their covariance.
#[derive(Debug)]
struct Pair {
    points: (usize, usize),
    taken: AtomicBool,
    parts: OnceLock<Vec<f64>>,
}

/// Partial sums of a product over lags.
const LANES: usize = 8;

impl Form {
    /// Of these processes (a ramp among them counts nothing), from `samples` rate samples of period `dt` (s).
    pub fn new(factors: &[u64], samples: usize, dt: f64, processes: Vec<Term>) -> Form {
        let points = (0..factors.len()).flat_map(|i| (0..=i).map(move |j| (i, j)));
        let pair = |points| Pair { points, taken: AtomicBool::new(false), parts: OnceLock::new() };
        Form { factors: factors.to_vec(), samples, dt, processes, pairs: points.map(pair).collect() }
    }

    fn parts(&self, (i, j): (usize, usize)) -> Vec<f64> {
        parts(self.factors[i], self.factors[j], self.samples, self.dt, &self.processes)
    }

    fn work_out(&self) {
        // no thread waits for another: one that waited with a claim of its own further down its stack would wait for
        // ever
        self.pairs.par_iter().panic_fuse().for_each(|pair| {
            // before the claim, which must be filled
            checkpoint();
            if !pair.taken.swap(true, Ordering::Relaxed) {
                // filled already only by the same numbers
                let _ = pair.parts.set(self.parts(pair.points));
            }
        });
    }

    /// When the square of the coefficient of these processes is so many times what it was given as, the others are
    /// absent, and the rate has a ramp of `slope` (unit/s).
    pub fn covariance(&self, weights: &[(usize, f64)], slope: f64) -> DMatrix<f64> {
        if self.pairs.iter().any(|pair| pair.parts.get().is_none()) {
            self.work_out();
        }
        let triangle = |a: usize, b: usize| a.max(b) * (a.max(b) + 1) / 2 + a.min(b);
        let with_ramp = triangle(self.processes.len(), 0);
        let mut matrix = DMatrix::zeros(self.factors.len(), self.factors.len());
        for pair in &self.pairs {
            // what another thread has not finished yet is done here too
            let parts = pair.parts.get_or_init(|| self.parts(pair.points));
            let (i, j) = pair.points;
            let means = (slope * self.factors[i] as f64 * self.dt * self.factors[j] as f64 * self.dt).powi(2);
            let mut sum = 0.0;
            for (at, (a, weight_a)) in weights.iter().enumerate() {
                for (b, weight_b) in &weights[..=at] {
                    sum += weight_a * weight_b * parts[triangle(*a, *b)];
                }
                if slope != 0.0 {
                    sum += means * weight_a * parts[with_ramp + a];
                }
            }
            matrix[(i, j)] = sum;
            matrix[(j, i)] = sum;
        }
        matrix
    }
}

fn parts(m1: u64, m2: u64, samples: usize, dt: f64, processes: &[Term]) -> Vec<f64> {
    let count = processes.len();
    let [terms1, terms2] = [m1, m2].map(|m| deviation::terms(Deviation::Oadev, samples, m) as i64);
    if terms1 == 0 || terms2 == 0 {
        return vec![f64::NAN; count * (count + 3) / 2];
    }
    let [edges1, edges2] = [m1, m2].map(|m| [0, m as i64, 2 * m as i64]);
    let mut kinks: Vec<i64> = edges1.iter().flat_map(|e1| edges2.map(|e2| e1 - e2)).collect();
    kinks.sort_unstable();
    let mut weight_changes = [0, terms2 - terms1];
    weight_changes.sort_unstable();
    let norm = |m: u64, terms: i64| 2.0 * (m as f64 * dt).powi(2) * terms as f64;
    let norm = norm(m1, terms1) * norm(m2, terms2);
    let (lags, weights): (Vec<i64>, Vec<f64>) = lag_sum::nodes(-terms1..=terms2, &kinks, &weight_changes)
        .into_iter()
        .map(|(h, weight)| (h, weight * (terms1.min(terms2 - h) - (-h).max(0)) as f64 / norm))
        .unzip();
    let covariances: Vec<Vec<f64>> =
        processes.iter().map(|term| term.second_difference_cross_covariances(m1, m2, &lags, dt)).collect();
    let mut parts = Vec::with_capacity(count * (count + 3) / 2);
    let mut with_ramp = Vec::with_capacity(count);
    for (a, own) in covariances.iter().enumerate() {
        let weighted: Vec<f64> = weights.iter().zip(own).map(|(weight, c)| weight * c).collect();
        parts.extend(covariances[..a].iter().map(|other| 4.0 * product(&weighted, other)));
        parts.push(2.0 * product(&weighted, own));
        with_ramp.push(4.0 * weighted.iter().sum::<f64>());
    }
    parts.extend(with_ramp);
    parts
}

fn product(a: &[f64], b: &[f64]) -> f64 {
    let ((a, rest_a), (b, rest_b)) = (a.as_chunks::<LANES>(), b.as_chunks::<LANES>());
    let mut lanes = [0.0; LANES];
    for (a, b) in a.iter().zip(b) {
        (0..LANES).for_each(|i| lanes[i] += a[i] * b[i]);
    }
    folded(lanes) + rest_a.iter().zip(rest_b).map(|(a, b)| a * b).sum::<f64>()
}
