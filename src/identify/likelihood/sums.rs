//! What the processes of a model are together: white noise at low frequencies, and the growth of the drift over
//! short times. Both are known better than their parts, and are what files with one white number and one walk hold.

use nalgebra::{DMatrix, DVector};

use super::ordinates::Ordinates;
use super::whittle::{self, FAST, Fit};
use crate::noise::{Kind, Term};
use crate::numerics::distribution::NORMAL_95;
use crate::numerics::optimize::covariance;

/// SI, with its 95 % interval by the delta method on the logarithm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sum {
    pub value: f64,
    pub interval: Option<[f64; 2]>,
}

/// Over all processes of a fit.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sums {
    /// N² = Σ S(0) of what [`counts_as_white`].
    pub white: Option<Sum>,
    /// K² = Σ K_i² + Σ 2σ²/Tc of the other drifts; none with flicker, whose growth has no limit.
    pub walk: Option<Sum>,
}

/// Noise that a filter does not follow: all but drift, and Gauss-Markov processes that forget within ten samples, a
/// matter of bandwidth.
pub fn counts_as_white(term: &Term, dt: f64) -> bool {
    match *term {
        Term::GaussMarkov { correlation_time, .. } => correlation_time < FAST * dt,
        _ => !term.kind().is_drift(),
    }
}

/// Step of ln p for the slopes; their error is of the order of its square.
const STEP: f64 = 1e-4;

/// `information`: of the logarithms, where it is better known than by the cosine coefficients.
pub(super) fn sums(data: &Ordinates, fit: &Fit, information: Option<&DMatrix<f64>>) -> Sums {
    let information = information.cloned().unwrap_or_else(|| whittle::observed_information(data, fit));
    let covariance = covariance_holding(&information, &fit.held);
    let sum = |square: &dyn Fn(&[f64]) -> f64| root(square, &fit.logs, covariance.as_ref());
    // which drift is fast is decided once, not anew at every step
    let fast: Vec<bool> = fit.form.terms(&fit.logs).map(|term| counts_as_white(&term, data.dt)).collect();
    let over = |logs: &[f64], white: bool, of: &dyn Fn(&Term) -> f64| -> f64 {
        fit.form.terms(logs).zip(&fast).filter(|(_, fast)| **fast == white).map(|(term, _)| of(&term)).sum()
    };
    Sums {
        white: sum(&|logs| over(logs, true, &|term| term.psd(0.0, data.dt))),
        walk: sum(&|logs| over(logs, false, &growth)).filter(|_| !fit.form.has(Kind::BiasInstability)),
    }
}

/// Where `held` are known: their rows and columns are zero.
fn covariance_holding(information: &DMatrix<f64>, held: &[usize]) -> Option<DMatrix<f64>> {
    let free: Vec<usize> = (0..information.nrows()).filter(|i| !held.contains(i)).collect();
    let part = covariance(&information.select_rows(&free).select_columns(&free))?;
    let mut all = DMatrix::zeros(information.nrows(), information.ncols());
    for (i, row) in free.iter().enumerate() {
        free.iter().enumerate().for_each(|(k, column)| all[(*row, *column)] = part[(i, k)]);
    }
    Some(all)
}

/// Variance per second over times that are short beside the correlation time.
pub(super) fn growth(term: &Term) -> f64 {
    match *term {
        Term::GaussMarkov { std_dev, correlation_time } => 2.0 * std_dev * std_dev / correlation_time,
        Term::RateRandomWalk { density } => density * density,
        _ => 0.0,
    }
}

/// The root of a square of the parameters; `None` where it is zero.
fn root(square: &dyn Fn(&[f64]) -> f64, logs: &[f64], covariance: Option<&DMatrix<f64>>) -> Option<Sum> {
    let value = square(logs).sqrt();
    if value.is_nan() || value <= 0.0 {
        return None;
    }
    let ln_root = |i: usize, step: f64| {
        let mut logs = logs.to_vec();
        logs[i] += step;
        0.5 * square(&logs).ln()
    };
    let slope = DVector::from_fn(logs.len(), |i, _| (ln_root(i, STEP) - ln_root(i, -STEP)) / (2.0 * STEP));
    let deviation = covariance.map(|covariance| (slope.transpose() * covariance * &slope)[(0, 0)].max(0.0).sqrt());
    let ends = |sd: f64| [(-NORMAL_95 * sd).exp() * value, (NORMAL_95 * sd).exp() * value];
    Some(Sum { value, interval: deviation.map(ends).filter(|ends| ends[1].is_finite()) })
}
