//! Predict and update on a [`LinearModel`], Joseph form, no allocation per step.
//!
//! Convention: x0, P0 belong to the first measurement (no prediction before it); then predict, update.

use nalgebra::{DMatrix, DVector};

use super::large;
pub(super) use super::measurement::Measurement;
pub use super::measurement::Update;
use super::transition::SparseTransition;
use crate::model::LinearModel;

/// Over a gap of so many samples an input is not held.
const LONGEST_HELD: u64 = 1_000_000;

/// State of a running filter.
///
/// `x` and `p` are x(k|k−1), P(k|k−1) after [`predict`](Kalman::predict) and x(k|k), P(k|k) after
/// [`update`](Kalman::update).
#[derive(Clone, Debug)]
pub struct Kalman {
    pub x: DVector<f64>,
    pub p: DMatrix<f64>,
    f: DMatrix<f64>,
    sparse: Option<SparseTransition>,
    /// Hᵀ, so that the row of one measurement is contiguous.
    h_columns: DMatrix<f64>,
    q: DMatrix<f64>,
    g: DMatrix<f64>,
    r: Vec<f64>,
    scratch: Scratch,
}

/// Memory of a step, taken once.
#[derive(Clone, Debug)]
struct Scratch {
    vector: Vec<f64>,
    matrix: Vec<f64>,
    /// F^(2^k), its difference from I, and the process noise of 2^k steps, for gaps.
    power: Vec<f64>,
    difference: Vec<f64>,
    noise: Vec<f64>,
}

impl Kalman {
    /// Starts at x0, P0.
    ///
    /// Measurements are taken one at a time, so R must be diagonal (its diagonal is used). Panics when the model's
    /// matrices do not fit each other; [`FilterDesign`](super::FilterDesign) checks what it reads.
    pub fn new(model: &LinearModel) -> Kalman {
        let n = model.x0.len();
        let m = model.h.nrows();
        assert_eq!(model.f.shape(), (n, n), "F");
        assert_eq!(model.q.shape(), (n, n), "Q");
        assert_eq!(model.p0.shape(), (n, n), "P0");
        assert_eq!(model.h.ncols(), n, "H");
        assert_eq!(model.r.shape(), (m, m), "R");
        assert_eq!(model.g.nrows(), n, "G");
        Kalman {
            x: model.x0.clone(),
            p: model.p0.clone(),
            f: model.f.clone(),
            sparse: SparseTransition::new(&model.f),
            h_columns: model.h.transpose(),
            q: model.q.clone(),
            g: model.g.clone(),
            r: model.r.diagonal().iter().copied().collect(),
            scratch: Scratch {
                vector: vec![0.0; n],
                matrix: vec![0.0; n * n],
                power: vec![0.0; n * n],
                difference: vec![0.0; n * n],
                noise: vec![0.0; n * n],
            },
        }
    }

    /// H x: the measurement that is expected where the states are now.
    pub fn expected(&self, index: usize) -> f64 {
        self.h_columns.column(index).dot(&self.x)
    }

    /// From here on the matrices of `model`, which has the same states; x and P stay.
    pub fn change(&mut self, model: &LinearModel) {
        let (x, p) = (std::mem::take(&mut self.x), std::mem::take(&mut self.p));
        assert_eq!(model.x0.len(), x.len(), "states");
        *self = Kalman { x, p, ..Kalman::new(model) };
    }

    /// x ← F x, P ← F P Fᵀ + Q.
    #[inline]
    pub fn predict(&mut self) {
        let Scratch { vector, matrix, .. } = &mut self.scratch;
        let (f, q) = (self.f.as_slice(), self.q.as_slice());
        let (x, p) = (self.x.as_mut_slice(), self.p.as_mut_slice());
        match (x.len(), &self.sparse) {
            (0, _) => {}
            (1, _) => predict_slices::<1>(f, q, x, p),
            (2, _) => predict_slices::<2>(f, q, x, p),
            (3, _) => predict_slices::<3>(f, q, x, p),
            (4, _) => predict_slices::<4>(f, q, x, p),
            (5, _) => predict_slices::<5>(f, q, x, p),
            (6, _) => predict_slices::<6>(f, q, x, p),
            (_, Some(sparse)) => sparse.predict(q, x, p, vector, matrix),
            (_, None) => large::predict(f, q, x, p, vector, matrix),
        }
    }

    /// x ← x + G u: after [`predict`](Kalman::predict), what the inputs of the sample before have done. Inputs are
    /// known exactly: the noise of a sensor at an input is part of Q.
    pub fn drive(&mut self, u: &[f64]) {
        for (column, u) in self.g.column_iter().zip(u) {
            self.x.axpy(*u, &column, 1.0);
        }
    }

    /// So many predictions, the inputs keeping their values; a gap of a million samples or more has lost an integrated
    /// input whatever it was. `inputs`: none before there is a first value.
    pub fn advance(&mut self, steps: u64, inputs: Option<&[f64]>) {
        match (steps, inputs) {
            (1, None) => self.predict(),
            (steps, None) | (steps @ LONGEST_HELD.., Some(_)) => self.predict_many(steps),
            (steps, Some(u)) => {
                for _ in 0..steps {
                    self.predict();
                    self.drive(u);
                }
            }
        }
    }

    /// n predictions with no measurement between (a gap); cost grows with log n.
    ///
    /// F^(2^k) and the noise of 2^k steps, Q + F Q Fᵀ + …, are doubled and applied where n has a binary one.
    /// Powers are kept as I + D, D ← 2D + D², so that poles close to one keep their distance from it.
    pub fn predict_many(&mut self, n: u64) {
        let Scratch { vector, matrix, power, difference, noise } = &mut self.scratch;
        let (x, p) = (self.x.as_mut_slice(), self.p.as_mut_slice());
        let states = x.len();
        power.copy_from_slice(self.f.as_slice());
        noise.copy_from_slice(self.q.as_slice());
        difference.copy_from_slice(power);
        for i in 0..states {
            difference[i * (states + 1)] -= 1.0;
        }
        let mut left = n;
        while left > 0 {
            if left & 1 == 1 && states > 0 {
                large::predict(power, noise, x, p, vector, matrix);
            }
            left >>= 1;
            if left > 0 {
                double(states, power, difference, noise, matrix);
            }
        }
    }

    /// Update with measurement `index` (a row of H). `gate`: reject when |ν| > gate·√S.
    ///
    /// S = h P hᵀ + r, K = P hᵀ/S, x ← x + K ν, P ← (I − K h) P (I − K h)ᵀ + K r Kᵀ.
    /// A measurement or variance that is not a finite number changes nothing and is reported as not accepted.
    /// Source: Bucy and Joseph 1968 (the form that stays definite for any gain).
    #[inline]
    pub fn update(&mut self, index: usize, z: f64, gate: Option<f64>) -> Update {
        let n = self.x.len();
        let measurement = Measurement {
            h: &self.h_columns.as_slice()[index * n..(index + 1) * n],
            r: self.r[index],
            z,
            gate: gate.unwrap_or(f64::INFINITY),
        };
        let Scratch { vector, matrix, .. } = &mut self.scratch;
        let (x, p) = (self.x.as_mut_slice(), self.p.as_mut_slice());
        match n {
            0 => Update::new(z, measurement.r, measurement.gate),
            1 => update_slices::<1>(&measurement, x, p),
            2 => update_slices::<2>(&measurement, x, p),
            3 => update_slices::<3>(&measurement, x, p),
            4 => update_slices::<4>(&measurement, x, p),
            5 => update_slices::<5>(&measurement, x, p),
            6 => update_slices::<6>(&measurement, x, p),
            _ => large::update(&measurement, x, p, vector, matrix),
        }
    }
}

impl Kalman {
    /// x ← x + K ν with the gain of measurement `index`, P as it is: what is left of a measurement too far out to be
    /// believed whole. Source: Masreliez and Martin 1977, section IV, with Huber's clipped score.
    pub fn nudge(&mut self, index: usize, innovation: f64) {
        let h = self.h_columns.column(index);
        let direction = &self.p * h;
        let variance = h.dot(&direction) + self.r[index];
        self.x.axpy(innovation / variance, &direction, 1.0);
    }
}

/// The first `N` columns of `N` numbers.
#[inline(always)]
pub(super) fn square<const N: usize>(numbers: &[f64]) -> [[f64; N]; N] {
    std::array::from_fn(|j| std::array::from_fn(|i| numbers[j * N + i]))
}

/// [`large::predict`] of a known size, in registers; the same operations in the same order.
#[inline(always)]
pub(super) fn predict_fixed<const N: usize>(
    f: &[[f64; N]; N],
    q: &[[f64; N]; N],
    x: &mut [f64; N],
    p: &mut [[f64; N]; N],
) {
    let old = *x;
    for i in 0..N {
        let mut sum = 0.0;
        for k in 0..N {
            sum += f[k][i] * old[k];
        }
        x[i] = sum;
    }
    let mut m = [[0.0; N]; N];
    for j in 0..N {
        for i in 0..N {
            for k in 0..N {
                m[j][i] += f[k][i] * p[j][k];
            }
        }
    }
    for j in 0..N {
        for i in j..N {
            let mut sum = q[j][i];
            for k in 0..N {
                sum += m[k][i] * f[k][j];
            }
            p[j][i] = sum;
            p[i][j] = sum;
        }
    }
}

/// [`large::update`] of a known size.
#[inline(always)]
pub(super) fn update_fixed<const N: usize>(
    h: &[f64; N],
    r: f64,
    z: f64,
    gate: f64,
    x: &mut [f64; N],
    p: &mut [[f64; N]; N],
) -> Update {
    let mut v = [0.0; N]; // P hᵀ
    let (mut predicted, mut variance) = (0.0, r);
    for i in 0..N {
        for k in 0..N {
            v[i] += p[k][i] * h[k];
        }
        predicted += h[i] * x[i];
        variance += h[i] * v[i];
    }
    let update = Update::new(z - predicted, variance, gate);
    if !update.accepted {
        return update;
    }
    let weight = 1.0 / variance;
    let gain = v.map(|v| v * weight);
    for i in 0..N {
        x[i] += gain[i] * update.innovation;
    }
    let mut t = [[0.0; N]; N];
    for j in 0..N {
        for i in 0..N {
            t[j][i] = p[j][i] - gain[i] * v[j];
        }
    }
    for i in 0..N {
        let mut t_h = 0.0;
        for j in 0..N {
            t_h += t[j][i] * h[j];
        }
        let rest = t_h - gain[i] * r;
        for j in 0..=i {
            let value = t[j][i] - rest * gain[j];
            p[j][i] = value;
            p[i][j] = value;
        }
    }
    update
}

#[inline(always)]
fn predict_slices<const N: usize>(f: &[f64], q: &[f64], x: &mut [f64], p: &mut [f64]) {
    let (mut state, mut covariance) = (std::array::from_fn(|i| x[i]), square::<N>(p));
    predict_fixed(&square(f), &square(q), &mut state, &mut covariance);
    x.copy_from_slice(&state);
    p.copy_from_slice(covariance.as_flattened());
}

#[inline(always)]
fn update_slices<const N: usize>(measurement: &Measurement<'_>, x: &mut [f64], p: &mut [f64]) -> Update {
    let h: [f64; N] = std::array::from_fn(|i| measurement.h[i]);
    let (mut state, mut covariance) = (std::array::from_fn(|i| x[i]), square::<N>(p));
    let update = update_fixed(&h, measurement.r, measurement.z, measurement.gate, &mut state, &mut covariance);
    if update.accepted {
        x.copy_from_slice(&state);
        p.copy_from_slice(covariance.as_flattened());
    }
    update
}

/// Q ← Q + F Q Fᵀ, then D ← 2D + D², F ← I + D.
fn double(n: usize, f: &mut [f64], d: &mut [f64], q: &mut [f64], m: &mut [f64]) {
    for j in 0..n {
        for i in 0..n {
            m[i + n * j] = (0..n).map(|k| f[i + n * k] * q[k + n * j]).sum();
        }
    }
    for j in 0..n {
        for i in j..n {
            let value = q[i + n * j] + (0..n).map(|k| m[i + n * k] * f[j + n * k]).sum::<f64>();
            q[i + n * j] = value;
            q[j + n * i] = value;
        }
    }
    for j in 0..n {
        for i in 0..n {
            m[i + n * j] = 2.0 * d[i + n * j] + (0..n).map(|k| d[i + n * k] * d[k + n * j]).sum::<f64>();
        }
    }
    d.copy_from_slice(m);
    f.copy_from_slice(m);
    for i in 0..n {
        f[i * (n + 1)] += 1.0;
    }
}
