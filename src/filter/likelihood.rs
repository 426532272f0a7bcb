//! Exact Gaussian likelihood of a log whose constant bias (and slope) is unknown or known to some precision, gaps included.

use nalgebra::{Cholesky, DMatrix, DVector};

use super::Kalman;
use crate::model::LinearModel;

/// Consecutive samples of a log.
#[derive(Clone, Copy, Debug)]
pub struct Stretch<'a> {
    /// Samples missing between the stretch before and this one.
    pub missing: u64,
    pub samples: &'a [f64],
}

/// What one log says.
#[derive(Clone, Debug, PartialEq)]
pub struct LogLikelihood {
    /// Diffuse ln L.
    pub value: f64,
    /// Generalised least-squares estimate of the bias; with a slope, of the bias in the middle of the log.
    pub bias: f64,
    /// Its variance.
    pub bias_variance: f64,
}

/// Innovations go through in blocks of this many.
const BLOCK: usize = 1024;
/// The covariance has settled when no entry moves by more than this many roundings of its diagonal in a step.
const SETTLED: f64 = 4.0 * f64::EPSILON;

/// ln L of z_k = b + a (t_k − t_mid) + h x_k + v_k, b (and a, with `slope`) unknown with a flat prior, x the states of `model`, which has one
/// measurement and no state for b:
///
/// ln L = −½ [n ln 2π + Σ ln S_k + ν̃ᵀ S⁻¹ ν̃ + ln det A], A = Uᵀ S⁻¹ U, with U the innovations of the filter on the regressors (1 and t_k − t_mid),
/// ν̃ what is left of those of the log after least squares on U. This is the diffuse likelihood of a filter with states for b and a.
///
/// The filter predicts over missing samples and over samples that are not finite. Units: SI. NaN when nothing can be said (fewer usable samples
/// than unknowns). Sources: Rosenberg 1973; Durbin & Koopman 2012, sections 5.6 and 7.2.
pub fn diffuse_log_likelihood(model: &LinearModel, log: &[Stretch<'_>], slope: bool) -> LogLikelihood {
    likelihood(model, log, slope, None)
}

/// The same with b ~ N(mean, variance) and no slope: A has 1/variance more and ln L has −½ ln variance, the likelihood of a filter with a
/// constant state for b. `bias` and its variance are those after the log.
pub fn log_likelihood_with_bias(model: &LinearModel, log: &[Stretch<'_>], mean: f64, variance: f64) -> LogLikelihood {
    likelihood(model, log, false, Some([mean, variance]))
}

fn likelihood(model: &LinearModel, log: &[Stretch<'_>], slope: bool, prior: Option<[f64; 2]>) -> LogLikelihood {
    let n = model.x0.len();
    let mean = prior.map_or(0.0, |[mean, _]| mean);
    let columns = 2 + usize::from(slope);
    let total: u64 = log.iter().map(|part| part.missing + part.samples.len() as u64).sum();
    let mut run = Run {
        filter: Kalman::new(model),
        f: model.f.as_slice().to_vec(),
        h: model.h.row(0).iter().copied().collect(),
        r: model.r[(0, 0)],
        states: (0..columns).map(|c| if c == 0 { model.x0.as_slice().to_vec() } else { vec![0.0; n] }).collect(),
        gain: vec![0.0; n],
        variance: f64::NAN,
        settled: false,
        spare: vec![0.0; n],
        before: DMatrix::zeros(n, n),
        sums: DMatrix::zeros(columns, columns),
        log_variance: 0.0,
        count: 0,
    };
    let middle = 0.5 * (total as f64 - 1.0);
    let mut step = 0;
    let mut data: Vec<Vec<f64>> = vec![vec![1.0; BLOCK]; columns];
    for part in log {
        run.pause(part.missing, step == 0);
        step += part.missing;
        for block in part.samples.chunks(BLOCK) {
            data[0].iter_mut().zip(block).for_each(|(out, z)| *out = z - mean);
            if slope {
                let times = data[2].iter_mut().zip(step..);
                times.for_each(|(t, k)| *t = (k as f64 - middle) * model.dt);
            }
            run.block(&mut data, block.len(), step == 0);
            step += block.len() as u64;
        }
    }
    run.conclude(prior)
}

struct Run {
    /// Carries the covariance; its state is not used.
    filter: Kalman,
    f: Vec<f64>,
    h: Vec<f64>,
    r: f64,
    /// x(k|k) of the log and of each regressor.
    states: Vec<Vec<f64>>,
    gain: Vec<f64>,
    /// S.
    variance: f64,
    settled: bool,
    spare: Vec<f64>,
    before: DMatrix<f64>,
    /// Σ ν_i ν_j/S over the columns.
    sums: DMatrix<f64>,
    log_variance: f64,
    count: u64,
}

impl Run {
    /// Steps without a measurement; the cost grows with their logarithm.
    fn pause(&mut self, steps: u64, first: bool) {
        if steps == 0 {
            return;
        }
        // x0, P0 belong to the first sample, usable or not
        let steps = steps - u64::from(first);
        for x in &mut self.states {
            let mut carrier = self.filter.clone();
            carrier.x.copy_from_slice(x);
            carrier.predict_many(steps);
            x.copy_from_slice(carrier.x.as_slice());
        }
        self.filter.predict_many(steps);
        self.settled = false;
    }

    fn predict_states(&mut self) {
        let n = self.h.len();
        for x in &mut self.states {
            for (i, out) in self.spare.iter_mut().enumerate() {
                *out = (0..n).map(|j| self.f[i + n * j] * x[j]).sum();
            }
            x.copy_from_slice(&self.spare);
        }
    }

    /// The first `length` samples of every column; they become innovations.
    fn block(&mut self, data: &mut [Vec<f64>], length: usize, first: bool) {
        let mut at = 0;
        while at < length {
            let usable = data[0][at].is_finite();
            if self.settled && usable {
                let end = data[0][at..length].iter().position(|z| !z.is_finite()).map_or(length, |bad| at + bad);
                self.settled_run(data, at, end);
                at = end;
                continue;
            }
            self.settled = false;
            let start = first && at == 0;
            if !start {
                self.before.copy_from(&self.filter.p);
                self.filter.predict();
                self.predict_states();
            }
            if usable {
                self.update(data, at);
                // P0 may be zero
                self.settled = !start && self.is_settled();
            }
            at += 1;
        }
    }

    fn update(&mut self, data: &[Vec<f64>], at: usize) {
        let n = self.h.len();
        self.variance = self.filter.update(0, 0.0, None).variance;
        // K = P(k|k) hᵀ/r, the same as P(k|k−1) hᵀ/S
        for (i, gain) in self.gain.iter_mut().enumerate() {
            *gain = (0..n).map(|j| self.filter.p[(i, j)] * self.h[j]).sum::<f64>() / self.r;
        }
        let innovations: Vec<f64> = self.states.iter().zip(data).map(|(x, z)| z[at] - dot(&self.h, x)).collect();
        for (x, innovation) in self.states.iter_mut().zip(&innovations) {
            x.iter_mut().zip(&self.gain).for_each(|(x, k)| *x += k * innovation);
        }
        for (i, a) in innovations.iter().enumerate() {
            for (j, b) in innovations.iter().enumerate() {
                self.sums[(i, j)] += a * b / self.variance;
            }
        }
        self.log_variance += self.variance.ln();
        self.count += 1;
    }

    /// The covariance is that of the update before.
    fn is_settled(&self) -> bool {
        let (n, p) = (self.h.len(), &self.filter.p);
        let still = |(i, j): (usize, usize)| {
            let scale = (p[(i, i)] * p[(j, j)]).sqrt();
            (p[(i, j)] - self.before[(i, j)]).abs() <= SETTLED * scale
        };
        (0..n).all(|i| (0..=i).all(|j| still((i, j))))
    }

    /// Samples `from..to` with the gain as it is.
    fn settled_run(&mut self, data: &mut [Vec<f64>], from: usize, to: usize) {
        let (n, f, h, gain, spare) = (self.h.len(), &self.f[..], &self.h[..], &self.gain[..], &mut self.spare[..]);
        for (x, z) in self.states.iter_mut().zip(data.iter_mut()) {
            let (x, z) = (&mut x[..], &mut z[from..to]);
            for_size!(n, settled_kernel(f, h, gain, x, z, spare));
        }
        let columns = self.states.len();
        for i in 0..columns {
            for j in 0..columns {
                self.sums[(i, j)] += dot(&data[i][from..to], &data[j][from..to]) / self.variance;
            }
        }
        // what became innovations is a regressor again in the next block
        data[1][from..to].fill(1.0);
        self.log_variance += (to - from) as f64 * self.variance.ln();
        self.count += (to - from) as u64;
    }

    fn conclude(mut self, prior: Option<[f64; 2]>) -> LogLikelihood {
        let unknowns = self.sums.nrows() - 1;
        let nothing = LogLikelihood { value: f64::NAN, bias: f64::NAN, bias_variance: f64::NAN };
        if self.count <= unknowns as u64 {
            return nothing;
        }
        let [mean, variance] = prior.unwrap_or([0.0, 1.0]);
        if prior.is_some() {
            self.sums[(1, 1)] += 1.0 / variance;
        }
        let information = self.sums.view((1, 1), (unknowns, unknowns)).into_owned();
        // a bias and a slope differ in unit
        let scale = information.diagonal().map(|v| 1.0 / v.sqrt());
        let scaled = DMatrix::from_fn(unknowns, unknowns, |i, j| information[(i, j)] * scale[i] * scale[j]);
        let Some(factor) = Cholesky::new(scaled) else { return nothing };
        let cross = DVector::from_fn(unknowns, |i, _| self.sums[(i + 1, 0)] * scale[i]);
        let solved = factor.solve(&cross);
        let rest = self.sums[(0, 0)] - cross.dot(&solved);
        let log_determinant =
            2.0 * factor.l().diagonal().iter().zip(scale.iter()).map(|(l, s)| (l / s).ln()).sum::<f64>();
        let constant = self.count as f64 * std::f64::consts::TAU.ln();
        LogLikelihood {
            value: -0.5 * (constant + self.log_variance + rest + log_determinant + variance.ln()),
            bias: mean + solved[0] * scale[0],
            bias_variance: factor.inverse()[(0, 0)] * scale[0] * scale[0],
        }
    }
}

/// x ← F x, ν = z − h x, x ← x + K ν; `z` becomes ν.
#[inline(always)]
fn settled_kernel(n: usize, f: &[f64], h: &[f64], gain: &[f64], x: &mut [f64], z: &mut [f64], spare: &mut [f64]) {
    let (f, h, gain) = (&f[..n * n], &h[..n], &gain[..n]);
    let (x, spare) = (&mut x[..n], &mut spare[..n]);
    for z in z {
        let mut predicted = 0.0;
        for i in 0..n {
            let mut sum = 0.0;
            for j in 0..n {
                sum += f[i + n * j] * x[j];
            }
            spare[i] = sum;
            predicted += h[i] * sum;
        }
        *z -= predicted;
        for i in 0..n {
            x[i] = spare[i] + gain[i] * *z;
        }
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
