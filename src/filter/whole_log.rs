//! A whole log through a time-invariant filter: innovations, NIS and likelihood, each the same as those of
//! [`Kalman`] to rounding.
//!
//! Gains and covariances of such a filter do not depend on the data. All of the state but a constant bias settles;
//! the bias, whose variance falls like 1/t for ever, is split off (Friedland 1969): a filter without it gives ν̃ and
//! S̃, and s, how ν̃ answers to the bias, settles too. With I the information on the bias, b̂ its estimate:
//!
//! ν = ν̃ − s b̂, S = S̃ (I + s²/S̃)/I, I ← I + s²/S̃, b̂ ← b̂ + (s/S̃)/I ν.
//!
//! Once S̃, its gain K and s stand still, a step is x ← F (I − K h) x + F K z, and Σ ln S telescopes to n ln S̃ + ln
//! (I_end/I_start).

use nalgebra::{DMatrix, DVector};
use pulp::{Arch, NullaryFnOnce};

mod approach;
mod settled;

use self::approach::{Approach, Came, LOOK};
use self::settled::{Bias, Run, Settled};
use super::Kalman;
use super::kalman::{predict_fixed, square, update_fixed};
use crate::model::LinearModel;
use crate::numerics::progress::checkpoint;

/// Innovations of a log of the first measurement of `model`, one at every step; inputs are zero, other measurements
/// are not taken.
///
/// Writes ν = z − H x(k|k−1) and ν²/S of every sample (NaN where it is not a number below 1e140; the filter predicts
/// over it) and hands back ln L = Σ −½ (ln 2πS + ν²/S). SI units. Panics when the three lists differ in length.
///
/// A model with at most six states beside the bias runs at the speed of its settled gains; others, and those that
/// take their measurement more seldom, carry their covariance from step to step.
pub fn innovations(model: &LinearModel, z: &[f64], innovation: &mut [f64], nis: &mut [f64]) -> f64 {
    assert!(z.len() == innovation.len() && z.len() == nis.len(), "as many results as samples");
    let squares = |innovation: &[f64], weight: &mut [f64]| {
        for (weight, v) in weight.iter_mut().zip(innovation) {
            *weight *= *v * *v;
        }
    };
    let Some(mut filter) = TwoStage::new(model) else {
        let log_likelihood = carried(model, z, innovation, nis);
        squares(innovation, nis);
        return log_likelihood;
    };
    for ((z, innovation), nis) in z.chunks(PIECE).zip(innovation.chunks_mut(PIECE)).zip(nis.chunks_mut(PIECE)) {
        checkpoint();
        filter.run(z, innovation, nis);
        squares(innovation, nis);
    }
    filter.log_likelihood()
}

/// ν and 1/S by a filter that carries its whole covariance from step to step; hands back ln L.
pub fn carried(model: &LinearModel, z: &[f64], innovation: &mut [f64], weight: &mut [f64]) -> f64 {
    let every = model.every[0].max(1);
    fn run<const N: usize>(carried: Carried<'_, N>) -> f64 {
        Arch::new().dispatch(carried)
    }
    match (every, model.x0.len()) {
        (1, 1) => run(Carried::<1> { model, z, innovation, weight }),
        (1, 2) => run(Carried::<2> { model, z, innovation, weight }),
        (1, 3) => run(Carried::<3> { model, z, innovation, weight }),
        (1, 4) => run(Carried::<4> { model, z, innovation, weight }),
        _ => {
            let mut kalman = Kalman::new(model);
            let mut log_likelihood = 0.0;
            for (k, z) in z.iter().enumerate() {
                if k > 0 {
                    kalman.predict();
                }
                (innovation[k], weight[k]) = (f64::NAN, f64::NAN);
                if k % every == 0 && usable(*z) {
                    let update = kalman.update(0, *z, None);
                    (innovation[k], weight[k]) = (update.innovation, 1.0 / update.variance);
                    log_likelihood += update.log_likelihood();
                }
            }
            log_likelihood
        }
    }
}

/// A filter of `N` states in registers, compiled for each instruction set.
struct Carried<'a, const N: usize> {
    model: &'a LinearModel,
    z: &'a [f64],
    innovation: &'a mut [f64],
    weight: &'a mut [f64],
}

impl<const N: usize> NullaryFnOnce for Carried<'_, N> {
    type Output = f64;
    #[inline(always)]
    fn call(self) -> f64 {
        let Carried { model, z, innovation, weight } = self;
        let (f, q) = (square::<N>(model.f.as_slice()), square::<N>(model.q.as_slice()));
        let (h, r) = (std::array::from_fn(|i| model.h[(0, i)]), model.r[(0, 0)]);
        let (mut x, mut p) = (std::array::from_fn(|i| model.x0[i]), square::<N>(model.p0.as_slice()));
        let (mut log_variance, mut nis, mut count, mut started) = (0.0, 0.0, 0_u64, false);
        let inverse_r = if r > 0.0 { 1.0 / r } else { 1.0 };
        let parts = z.chunks(LOOK).zip(innovation.chunks_mut(LOOK)).zip(weight.chunks_mut(LOOK));
        for ((z, innovation), weight) in parts {
            let mut product = 1.0;
            for ((z, innovation), weight) in z.iter().zip(innovation).zip(weight) {
                if started {
                    predict_fixed(&f, &q, &mut x, &mut p);
                }
                started = true;
                (*innovation, *weight) = (f64::NAN, f64::NAN);
                if usable(*z) {
                    let update = update_fixed(&h, r, *z, f64::INFINITY, &mut x, &mut p);
                    (*innovation, *weight) = (update.innovation, 1.0 / update.variance);
                    product *= update.variance * inverse_r;
                    nis += update.nis;
                    count += 1;
                }
            }
            log_variance += product.ln();
        }
        -0.5 * (count as f64 * (std::f64::consts::TAU / inverse_r).ln() + log_variance + nis)
    }
}

/// A measurement that can be used: the square of a larger one is no number.
#[inline(always)]
fn usable(z: f64) -> bool {
    z.abs() < 1e140
}

/// The states that are not the bias: most that are kept in registers, and that `with_size!` knows.
const MOST: usize = 6;
/// Samples whose results stay in the nearest caches until they are used again.
const PIECE: usize = 8192;

/// A time-invariant filter with one measurement at every step, in two stages.
#[derive(Clone, Debug)]
pub struct TwoStage {
    /// The filter without the bias.
    rest: Kalman,
    /// For what the bias does over a gap.
    whole: Kalman,
    f: DMatrix<f64>,
    q: DMatrix<f64>,
    h: DVector<f64>,
    r: f64,
    /// F of the bias into the other states; h of the bias.
    couple: DVector<f64>,
    seen: f64,
    /// Place of the bias among the states.
    place: Option<usize>,
    /// How the other states answer to the bias.
    answer: DVector<f64>,
    bias: f64,
    /// 1/variance of the bias; infinite when it is known (or there is none).
    information: f64,
    /// Σ over the samples so far, without the constant.
    log_variance: f64,
    nis: f64,
    count: u64,
    /// A sample was taken: the next begins with a prediction.
    started: bool,
    /// Covariance of the states beside the bias, and their answer to it, no longer change.
    still: bool,
    spare: DVector<f64>,
}

impl TwoStage {
    /// `None` for a model that it cannot run: more than six states beside the bias, or a measurement that is not
    /// taken at every step or has no noise.
    pub fn new(model: &LinearModel) -> Option<TwoStage> {
        let n = model.x0.len();
        if model.every.first() != Some(&1) || model.r[(0, 0)].is_nan() || model.r[(0, 0)] <= 0.0 {
            return None;
        }
        let constant = |i: &usize| {
            let i = *i;
            let alone =
                |j: usize| j == i || (model.f[(i, j)] == 0.0 && model.p0[(i, j)] == 0.0 && model.p0[(j, i)] == 0.0);
            let still = (0..n).all(|j| model.q[(i, j)] == 0.0 && model.q[(j, i)] == 0.0);
            model.f[(i, i)] == 1.0 && still && model.p0[(i, i)] > 0.0 && (0..n).all(alone)
        };
        let bias = (0..n).find(constant);
        let kept: Vec<usize> = (0..n).filter(|i| Some(*i) != bias).collect();
        if kept.len() > MOST {
            return None;
        }
        let rest = model.part(&kept);
        let of_bias = |column: DVector<f64>| column.select_rows(&kept);
        Some(TwoStage {
            place: bias,
            started: false,
            still: false,
            spare: DVector::zeros(kept.len()),
            f: rest.f.clone(),
            q: rest.q.clone(),
            h: rest.h.row(0).transpose(),
            r: rest.r[(0, 0)],
            couple: bias.map_or_else(|| DVector::zeros(kept.len()), |b| of_bias(model.f.column(b).into_owned())),
            seen: bias.map_or(0.0, |b| model.h[(0, b)]),
            answer: DVector::zeros(kept.len()),
            bias: bias.map_or(0.0, |b| model.x0[b]),
            information: bias.map_or(f64::INFINITY, |b| 1.0 / model.p0[(b, b)]),
            rest: Kalman::new(&rest),
            whole: Kalman::new(model),
            log_variance: 0.0,
            nis: 0.0,
            count: 0,
        })
    }

    /// The next samples: ν and 1/S of each, NaN where it is not a number below 1e140. Afterwards the state is that
    /// after the last.
    pub fn run(&mut self, z: &[f64], innovation: &mut [f64], weight: &mut [f64]) {
        let mut at = 0;
        while at < z.len() {
            if self.started && !self.still {
                let (z, innovation, weight) = (&z[at..], &mut innovation[at..], &mut weight[at..]);
                let came = with_size!(self.h.len(), self.approach(z, innovation, weight));
                at += came;
                if came > 0 {
                    continue;
                }
            }
            if self.started {
                self.predict();
            }
            self.started = true;
            if !usable(z[at]) {
                (innovation[at], weight[at]) = (f64::NAN, f64::NAN);
                self.still = false;
                at += 1;
                continue;
            }
            // the last sample of a stretch is not among the settled, so that the state is that after it
            let end = if self.still {
                z[at..].iter().position(|z| !usable(*z)).map_or(z.len(), |bad| at + bad) - 1
            } else {
                at
            };
            if end > at {
                let (z, innovation, weight) = (&z[at..end], &mut innovation[at..end], &mut weight[at..end]);
                with_size!(self.h.len(), self.settled(z, innovation, weight));
                at = end;
            }
            (innovation[at], weight[at]) = self.update(z[at]);
            at += 1;
        }
    }

    fn predict(&mut self) {
        self.rest.predict();
        self.spare.copy_from(&self.couple);
        self.spare.gemv(1.0, &self.f, &self.answer, 1.0);
        std::mem::swap(&mut self.answer, &mut self.spare);
    }

    /// Steps without a sample; cost grows with their logarithm.
    pub fn pause(&mut self, steps: u64) {
        if let Some(place) = self.place {
            // the states that follow a bias of one
            self.whole.x = self.answer.clone().insert_row(place, 1.0);
            self.whole.predict_many(steps);
            self.answer = self.whole.x.clone().remove_row(place);
        }
        self.rest.predict_many(steps);
        self.still = false;
    }

    /// ln L of all samples so far.
    pub fn log_likelihood(&self) -> f64 {
        -0.5 * (self.count as f64 * std::f64::consts::TAU.ln() + self.log_variance + self.nis)
    }

    /// x(k|k) and P(k|k) of the whole state: x = x̃ + V b̂, P = P̃ + V Vᵀ/I with V the answer to the bias.
    pub fn state(&self) -> (DVector<f64>, DMatrix<f64>) {
        let Some(place) = self.place else { return (self.rest.x.clone(), self.rest.p.clone()) };
        let n = self.h.len() + 1;
        let answer = self.answer.clone().insert_row(place, 1.0);
        let other = |i: usize| if i < place { i } else { i - 1 };
        let x =
            DVector::from_fn(n, |i, _| self.bias * answer[i] + if i == place { 0.0 } else { self.rest.x[other(i)] });
        let p = DMatrix::from_fn(n, n, |i, j| {
            let rest = if i == place || j == place { 0.0 } else { self.rest.p[(other(i), other(j))] };
            rest + answer[i] * answer[j] / self.information
        });
        (x, p)
    }

    /// One update; hands back ν and 1/S.
    fn update(&mut self, z: f64) -> (f64, f64) {
        let s = self.seen + self.h.dot(&self.answer);
        let update = self.rest.update(0, z, None);
        // K = P(k|k) hᵀ/r
        self.answer.gemv(-s / self.r, &self.rest.p, &self.h, 1.0);
        let innovation = update.innovation - s * self.bias;
        let variance = update.variance + s * s / self.information;
        self.information += s * s / update.variance;
        self.bias += s / update.variance / self.information * innovation;
        let nis = innovation * innovation / variance;
        self.log_variance += variance.ln();
        self.nis += nis;
        self.count += 1;
        (innovation, 1.0 / variance)
    }

    /// Samples while the gains still change; hands back how many were taken.
    fn approach<const N: usize>(&mut self, z: &[f64], innovation: &mut [f64], weight: &mut [f64]) -> usize {
        let [mut x, mut answer] = [&self.rest.x, &self.answer].map(|x| std::array::from_fn(|i| x[i]));
        let mut p = square::<N>(self.rest.p.as_slice());
        let came: Came = Arch::new().dispatch(Approach {
            f: square::<N>(self.f.as_slice()),
            q: square::<N>(self.q.as_slice()),
            h: std::array::from_fn(|i| self.h[i]),
            r: self.r,
            couple: std::array::from_fn(|i| self.couple[i]),
            seen: self.seen,
            x: &mut x,
            p: &mut p,
            answer: &mut answer,
            bias: &mut self.bias,
            information: &mut self.information,
            z,
            innovation,
            weight,
        });
        self.rest.x.copy_from_slice(&x);
        self.rest.p.copy_from_slice(p.as_flattened());
        self.answer.copy_from_slice(&answer);
        self.log_variance += came.log_variance;
        self.nis += came.nis;
        self.count += came.samples as u64;
        self.still = came.settled;
        came.samples
    }

    /// Samples with everything but the bias settled; x is predicted for the first, and afterwards for the one that
    /// follows the last.
    fn settled<const N: usize>(&mut self, z: &[f64], innovation: &mut [f64], weight: &mut [f64]) {
        let direction = &self.rest.p * &self.h;
        let variance = self.h.dot(&direction) + self.r;
        let driven = &self.f * direction / variance;
        let closed = &self.f - &driven * self.h.transpose();
        let s = self.seen + self.h.dot(&self.answer);
        let mut gains = Settled::<N>::new(
            std::array::from_fn(|i| std::array::from_fn(|j| closed[(i, j)])),
            std::array::from_fn(|i| driven[i]),
            std::array::from_fn(|i| self.h[i]),
            std::array::from_fn(|i| self.rest.x[i]),
            Bias::new(s, 1.0 / variance, self.information, self.bias),
        );
        self.nis += Arch::new().dispatch(Run { gains: &mut gains, z, innovation, weight });
        self.rest.x.copy_from_slice(&gains.x);
        self.count += z.len() as u64;
        self.log_variance += z.len() as f64 * variance.ln();
        self.bias = gains.bias.estimate();
        if self.information.is_finite() {
            let information = gains.bias.information();
            self.log_variance += (information / self.information).ln();
            self.information = information;
        }
    }
}
