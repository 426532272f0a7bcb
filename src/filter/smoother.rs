//! Fixed-interval smoothing: estimates of every sample from the whole log, those of Rauch, Tung & Striebel, by the
//! adjoint form.
//!
//! Backwards from λ = 0, Λ = 0 after the last measurement: x(k|N) = x(k|k) − P(k|k) λ, P(k|N) = P(k|k) − P(k|k) Λ
//! P(k|k); through a scalar measurement with C = I − K h: λ ← Cᵀλ − hᵀ ν/s, Λ ← CᵀΛC + hᵀh/s; through a prediction:
//! λ ← Fᵀλ, Λ ← FᵀΛF. No covariance is inverted, so that constants, gaps and exactly known states need no exception.
//! Memory: the filter is run twice, the second time in stretches of √N rows. Sources: Rauch, Tung & Striebel 1965,
//! AIAA J. 3; Bierman 1973, Automatica 9 (the adjoint form).

use nalgebra::{DMatrix, DVector};

use super::kalman::Kalman;
use crate::model::LinearModel;
use crate::numerics::progress::checkpoint;

/// What a filter was given, row by row: predictions with the inputs that were held, then the measurements that it
/// accepted.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct History {
    rows: Vec<Row>,
    /// Measurement (row of H) and value.
    taken: Vec<(usize, f64)>,
    /// Of all rows that have them, one behind the other.
    inputs: Vec<f64>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Row {
    /// Predictions since the row before; 0 for the first.
    steps: u64,
    /// Where its inputs begin and end in `inputs`; none before there was a first value.
    inputs: Option<(usize, usize)>,
    /// Where its measurements end in `taken`.
    end: usize,
}

impl History {
    /// A new row, so many predictions after the one before.
    pub fn row(&mut self, steps: u64, inputs: Option<&[f64]>) {
        let first = self.inputs.len();
        self.inputs.extend(inputs.unwrap_or_default());
        let inputs = inputs.map(|_| (first, self.inputs.len()));
        self.rows.push(Row { steps, inputs, end: self.taken.len() });
    }

    /// A measurement that was accepted in this row, in the order of the updates.
    pub fn take(&mut self, measurement: usize, z: f64) {
        if let Some(row) = self.rows.last_mut() {
            self.taken.push((measurement, z));
            row.end = self.taken.len();
        }
    }

    fn of(&self, row: usize) -> &[(usize, f64)] {
        let first = row.checked_sub(1).map_or(0, |before| self.rows[before].end);
        &self.taken[first..self.rows[row].end]
    }
}

/// Filtered and smoothed estimates of every row, SI.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Smoothed {
    /// x(k|k) per state and row.
    pub filtered: Vec<Vec<f64>>,
    /// √P(k|k) of its diagonal.
    pub filtered_sigma: Vec<Vec<f64>>,
    /// x(k|N).
    pub smoothed: Vec<Vec<f64>>,
    /// √P(k|N) of its diagonal.
    pub smoothed_sigma: Vec<Vec<f64>>,
}

/// One measurement of a row.
struct Taken {
    measurement: usize,
    gain: DVector<f64>,
    innovation: f64,
    variance: f64,
}

/// One row of the forward run: x(k|k), P(k|k) and what led there.
struct Epoch {
    x: DVector<f64>,
    p: DMatrix<f64>,
    taken: Vec<Taken>,
}

/// The smoothed rows.
pub fn smooth(model: &LinearModel, history: &History) -> Smoothed {
    let (n, rows) = (model.x0.len(), history.rows.len());
    let blank = || vec![vec![0.0; rows]; n];
    let mut out = Smoothed { filtered: blank(), filtered_sigma: blank(), smoothed: blank(), smoothed_sigma: blank() };
    let stretch = (rows as f64).sqrt().ceil().max(1.0) as usize;
    let mut filter = Kalman::new(model);
    let mut starts = Vec::new();
    for k in 0..rows {
        if k % stretch == 0 {
            checkpoint();
            starts.push(filter.clone());
        }
        step(model, history, &mut filter, k, |_| ());
    }
    let mut adjoint = DVector::zeros(n);
    let mut information = DMatrix::zeros(n, n);
    for (i, mut filter) in starts.into_iter().enumerate().rev() {
        checkpoint();
        let first = i * stretch;
        let epochs: Vec<Epoch> = (first..rows.min(first + stretch))
            .map(|k| {
                let mut taken = Vec::new();
                step(model, history, &mut filter, k, |t| taken.push(t));
                Epoch { x: filter.x.clone(), p: filter.p.clone(), taken }
            })
            .collect();
        for (i, epoch) in epochs.iter().enumerate().rev() {
            let k = first + i;
            let x = &epoch.x - &epoch.p * &adjoint;
            let p = &epoch.p - &epoch.p * &information * &epoch.p;
            for s in 0..n {
                out.filtered[s][k] = epoch.x[s];
                out.filtered_sigma[s][k] = epoch.p[(s, s)].max(0.0).sqrt();
                out.smoothed[s][k] = x[s];
                // a constant that is known exactly may be off by rounding
                out.smoothed_sigma[s][k] = p[(s, s)].max(0.0).sqrt();
            }
            for taken in epoch.taken.iter().rev() {
                let h = model.h.row(taken.measurement).transpose();
                let kept = DMatrix::identity(n, n) - &taken.gain * h.transpose();
                adjoint = kept.tr_mul(&adjoint) - &h * (taken.innovation / taken.variance);
                information = kept.tr_mul(&(&information * &kept)) + &h * h.transpose() / taken.variance;
            }
            match history.rows[k].steps {
                0 => {}
                1 => {
                    adjoint = model.f.tr_mul(&adjoint);
                    information = model.f.tr_mul(&(&information * &model.f));
                }
                steps => {
                    let f = power(&model.f, steps);
                    adjoint = f.tr_mul(&adjoint);
                    information = f.tr_mul(&(&information * &f));
                }
            }
        }
    }
    out
}

/// Fⁿ by squares.
fn power(f: &DMatrix<f64>, mut n: u64) -> DMatrix<f64> {
    let (mut out, mut square) = (DMatrix::identity(f.nrows(), f.nrows()), f.clone());
    while n > 0 {
        if n & 1 == 1 {
            out *= &square;
        }
        n >>= 1;
        if n > 0 {
            square = &square * &square;
        }
    }
    out
}

/// The filter through one row; `told` of every measurement.
fn step(model: &LinearModel, history: &History, filter: &mut Kalman, k: usize, mut told: impl FnMut(Taken)) {
    let row = history.rows[k];
    if row.steps > 0 {
        filter.advance(row.steps, row.inputs.map(|(from, to)| &history.inputs[from..to]));
    }
    for (measurement, z) in history.of(k) {
        let cross = &filter.p * model.h.row(*measurement).transpose();
        let update = filter.update(*measurement, *z, None);
        told(Taken {
            measurement: *measurement,
            gain: cross / update.variance,
            innovation: update.innovation,
            variance: update.variance,
        });
    }
}
