//! Fixed-interval smoothing: estimates of every sample from the whole log, those of Rauch, Tung & Striebel, by the adjoint form.
//!
//! Backwards from λ = 0, Λ = 0 after the last measurement: x(k|N) = x(k|k) − P(k|k) λ, P(k|N) = P(k|k) − P(k|k) Λ P(k|k); through a scalar measurement
//! with C = I − K h: λ ← Cᵀλ − hᵀ ν/s, Λ ← CᵀΛC + hᵀh/s; through a prediction: λ ← Fᵀλ, Λ ← FᵀΛF. No covariance is inverted, so that constants,
//! gaps and exactly known states need no exception. Memory: the filter is run twice, the second time in stretches of √N samples.
//! Sources: Rauch, Tung & Striebel 1965, AIAA J. 3; Bierman 1973, Automatica 9 (the adjoint form).

use nalgebra::{DMatrix, DVector};

use super::kalman::Kalman;
use crate::model::LinearModel;

/// What a log says, sample by sample.
#[derive(Clone, Copy, Debug)]
pub struct Measured<'a> {
    /// One series per measurement of the model, SI; NaN where there is none. Samples that are not multiples of its `every` are not looked at.
    pub measurements: &'a [&'a [f64]],
    /// One series per input, SI.
    pub inputs: &'a [&'a [f64]],
    /// Reject |ν| > gate √S.
    pub gate: Option<f64>,
}

/// Filtered and smoothed estimates of every sample, SI.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Smoothed {
    /// x(k|k) per state and sample.
    pub filtered: Vec<Vec<f64>>,
    /// √P(k|k) of its diagonal.
    pub filtered_sigma: Vec<Vec<f64>>,
    /// x(k|N).
    pub smoothed: Vec<Vec<f64>>,
    /// √P(k|N) of its diagonal.
    pub smoothed_sigma: Vec<Vec<f64>>,
}

/// One accepted measurement of a sample.
struct Taken {
    measurement: usize,
    gain: DVector<f64>,
    innovation: f64,
    variance: f64,
}

/// One sample of the forward run: x(k|k), P(k|k) and what led there.
struct Epoch {
    x: DVector<f64>,
    p: DMatrix<f64>,
    taken: Vec<Taken>,
}

/// The smoothed log. Every series must have the same length; panics when a series of the model is missing.
pub fn smooth(model: &LinearModel, measured: &Measured<'_>) -> Smoothed {
    assert_eq!(measured.measurements.len(), model.measurements.len(), "measurements");
    assert_eq!(measured.inputs.len(), model.inputs.len(), "inputs");
    let (n, samples) = (model.x0.len(), measured.measurements.first().map_or(0, |series| series.len()));
    let blank = || vec![vec![0.0; samples]; n];
    let mut out = Smoothed { filtered: blank(), filtered_sigma: blank(), smoothed: blank(), smoothed_sigma: blank() };
    let stretch = (samples as f64).sqrt().ceil().max(1.0) as usize;
    let mut filter = Kalman::new(model);
    let mut starts = Vec::new();
    for k in 0..samples {
        if k % stretch == 0 {
            starts.push(filter.clone());
        }
        step(model, measured, &mut filter, k, |_| ());
    }
    let mut adjoint = DVector::zeros(n);
    let mut information = DMatrix::zeros(n, n);
    for (i, mut filter) in starts.into_iter().enumerate().rev() {
        let first = i * stretch;
        let epochs: Vec<Epoch> = (first..samples.min(first + stretch))
            .map(|k| {
                let mut taken = Vec::new();
                step(model, measured, &mut filter, k, |t| taken.push(t));
                Epoch { x: filter.x.clone(), p: filter.p.clone(), taken }
            })
            .collect();
        for (i, epoch) in epochs.iter().enumerate().rev() {
            let k = first + i;
            let x = &epoch.x - &epoch.p * &adjoint;
            let p = &epoch.p - &epoch.p * &information * &epoch.p;
            for s in 0..n {
                out.filtered[s][k] = epoch.x[s];
                out.filtered_sigma[s][k] = epoch.p[(s, s)].sqrt();
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
            if k > 0 {
                adjoint = model.f.tr_mul(&adjoint);
                information = model.f.tr_mul(&(&information * &model.f));
            }
        }
    }
    out
}

/// The filter through sample k; `told` of every measurement that it took.
fn step(model: &LinearModel, measured: &Measured<'_>, filter: &mut Kalman, k: usize, mut told: impl FnMut(Taken)) {
    if k > 0 {
        filter.predict();
        let driven: Vec<f64> = measured.inputs.iter().map(|series| series[k - 1]).collect();
        filter.drive(&driven);
    }
    for (measurement, series) in measured.measurements.iter().enumerate() {
        if !k.is_multiple_of(model.every[measurement]) || series[k].is_nan() {
            continue;
        }
        let h = model.h.row(measurement).transpose();
        let cross = &filter.p * &h;
        let update = filter.update(measurement, series[k], measured.gate);
        if update.accepted {
            told(Taken {
                measurement,
                gain: cross / update.variance,
                innovation: update.innovation,
                variance: update.variance,
            });
        }
    }
}
