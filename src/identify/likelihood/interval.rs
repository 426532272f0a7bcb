//! Intervals of the parameters: from the observed information, or from the profile likelihood where that is not enough.

use nalgebra::DMatrix;
use rayon::prelude::*;

use super::ordinates::Ordinates;
use super::whittle::{self, Fit};
use crate::numerics::distribution::NORMAL_95;

/// Standard deviation of a logarithm from which the likelihood is no parabola any more; of drift parameters, and of others.
const ROUGH: [f64; 2] = [0.03, 0.15];

/// What the log says about one logarithm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Precision {
    /// From the observed information; infinite where that is singular.
    pub(super) sigma: f64,
    /// Cramér-Rao bound of the standard deviation, at the estimate.
    pub(super) bound: f64,
    /// 95 % limits; None where the likelihood stays above its 95 % level up to the end of what is searched.
    pub(super) lower: Option<f64>,
    pub(super) upper: Option<f64>,
}

impl Precision {
    /// Both limits.
    pub(super) fn interval(&self) -> Option<[f64; 2]> {
        Some([self.lower?, self.upper?])
    }
}

/// Of every logarithm of a fit.
pub(super) fn precisions(data: &Ordinates, fit: &Fit) -> Vec<Precision> {
    let expected = deviations(whittle::expected_information(data, &fit.form, &fit.logs));
    let observed = deviations(whittle::observed_information(data, fit));
    let bounds = whittle::bounds(data, &fit.form, &fit.logs);
    (0..fit.logs.len())
        .into_par_iter()
        .map(|i| {
            let (sigma, bound) = (observed[i], expected[i]);
            let drift = fit.form.pieces()[fit.form.roles()[i].0].kind().is_drift();
            let rough = if drift { ROUGH[0] } else { ROUGH[1] };
            let [lower, upper] = if sigma < rough {
                [-1.0, 1.0].map(|side| Some(fit.logs[i] + side * NORMAL_95 * sigma))
            } else {
                let step = [sigma, bound].into_iter().filter(|s| s.is_finite()).fold(rough, f64::max).min(2.0);
                [(-1.0, bounds[i].0), (1.0, bounds[i].1)].map(|(side, end)| profile(data, fit, i, side * step, end))
            };
            Precision { sigma, bound, lower, upper }
        })
        .collect()
}

/// Standard deviations that belong to an information matrix.
pub(super) fn deviations(information: DMatrix<f64>) -> Vec<f64> {
    let p = information.nrows();
    match covariance(&information) {
        Some(covariance) => (0..p).map(|i| covariance[(i, i)].max(0.0).sqrt()).collect(),
        None => vec![f64::INFINITY; p],
    }
}

/// The inverse of an information matrix; None where that is singular.
pub(super) fn covariance(information: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let p = information.nrows();
    // scaled to unit diagonal: logarithms of a frequency and of a coefficient differ by many orders
    let scale: Vec<f64> = (0..p).map(|i| information[(i, i)].abs().sqrt().max(1e-300)).collect();
    let scaled = DMatrix::from_fn(p, p, |i, k| information[(i, k)] / (scale[i] * scale[k]));
    let inverse = nalgebra::Cholesky::new(scaled)?.inverse();
    Some(DMatrix::from_fn(p, p, |i, k| inverse[(i, k)] / (scale[i] * scale[k])))
}

/// Where the likelihood, maximised over all other parameters, has fallen by χ²₁(0.95)/2 on the side of `step`; `end`: of the search.
///
/// The signed root of the fall is nearly straight in the logarithm and is followed by secants.
fn profile(data: &Ordinates, fit: &Fit, index: usize, step: f64, end: f64) -> Option<f64> {
    let centre = fit.logs[index];
    let inside = |v: f64| if step > 0.0 { v.min(end) } else { v.max(end) };
    let mut at = inside(centre + NORMAL_95 * step);
    let mut from = fit.logs.clone();
    let free: Vec<usize> = (0..from.len()).filter(|i| *i != index).collect();
    let (mut near, mut far): (f64, Option<f64>) = (centre, None);
    for _ in 0..16 {
        let mut start = from.clone();
        start[index] = at;
        let held = whittle::climb(data, &fit.form, &start, &free)?;
        let root = (2.0 * (fit.log_likelihood - held.log_likelihood)).max(0.0).sqrt();
        from = held.logs;
        if (root - NORMAL_95).abs() < 0.01 {
            return Some(at);
        }
        if root < NORMAL_95 {
            near = at;
            if at == end {
                return None;
            }
        } else {
            far = Some(at);
        }
        let straight = centre + (at - centre) * (NORMAL_95 / root.max(0.3)).clamp(0.2, 3.0);
        at = match far {
            // between the limits, or halfway when the secant leaves them
            Some(far) if (straight - near) * (straight - far) >= 0.0 => 0.5 * (near + far),
            _ => inside(straight),
        };
    }
    Some(at)
}
