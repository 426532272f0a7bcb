//! Credibility in dB: how far the claimed covariance is from the true one, and in which direction.

use nalgebra::{DMatrix, SymmetricEigen};

use super::outcome::Credibility;
use crate::numerics::distribution::digamma;
use crate::numerics::random::{StreamId, fill_normal, stream};

/// Directions over which the absolute value is averaged.
const DIRECTIONS: usize = 1024;

/// Noncredibility and inclination indices of errors with the mean log₁₀ NEES `mean_log` and the moments E[u uᵀ]
/// (lower triangles by rows) of the whitened errors u of `size` components; `independent`: number of independent
/// errors in the means.
///
/// With ε = eᵀP⁻¹e and ε* = eᵀΣ⁻¹e, Σ the true mean-square error: NCI = 10 E|log₁₀(ε/ε*)| and inclination I = 10
/// E[log₁₀(ε/ε*)] (Li & Zhao 2005, FUSION). ε* ~ χ²(n), so E log₁₀ ε* = (ψ(n/2) + ln 2)/ln 10; with u = P^-½ e, ε/ε* =
/// vᵀS v for a uniform direction v and S = E[u uᵀ], which is averaged over 1024 fixed directions (one component
/// needs none).
pub(super) fn credibility(mean_log: f64, moments: &[Vec<f64>], size: usize, independent: f64) -> Option<Credibility> {
    // an eigenvalue search would not end on what is not finite
    if moments.is_empty() || !mean_log.is_finite() || moments.iter().flatten().any(|m| !m.is_finite()) {
        return None;
    }
    let half = size as f64 / 2.0;
    let of_law = (digamma(half) + std::f64::consts::LN_2) / std::f64::consts::LN_10;
    let inclination_db = 10.0 * (mean_log - of_law);
    let standard_error_db = 10.0 / std::f64::consts::LN_10 * (trigamma_of_half(size) / independent).sqrt();
    let directions = directions(size);
    let nci_db =
        10.0 * moments.iter().map(|m| mean_absolute_log(m, size, &directions)).sum::<f64>() / moments.len() as f64;
    let size_db = format!("{:.2} dB", inclination_db.abs());
    let meaning = if inclination_db.abs() <= 3.0 * standard_error_db {
        "the errors are as large as the covariance says".to_string()
    } else if inclination_db > 0.0 {
        format!("optimistic: the squared errors are {size_db} larger than the claimed covariance")
    } else {
        format!("pessimistic: the squared errors are {size_db} smaller than the claimed covariance")
    };
    Some(Credibility { nci_db, inclination_db, standard_error_db, meaning })
}

fn mean_absolute_log(moments: &[f64], size: usize, directions: &[Vec<f64>]) -> f64 {
    let full = DMatrix::from_fn(size, size, |i, j| moments[i.max(j) * (i.max(j) + 1) / 2 + i.min(j)]);
    let eigenvalues = SymmetricEigen::new(full).eigenvalues;
    let ratio = |v: &Vec<f64>| -> f64 { v.iter().zip(eigenvalues.iter()).map(|(v, s)| v * s.max(0.0)).sum() };
    directions.iter().map(|v| ratio(v).log10().abs()).sum::<f64>() / directions.len() as f64
}

/// Squared components of unit vectors.
fn directions(size: usize) -> Vec<Vec<f64>> {
    if size == 1 {
        return vec![vec![1.0]];
    }
    let mut rng = stream(0, StreamId { run: 0, axis: 0, term: u32::MAX });
    let one = |_| {
        let mut v = vec![0.0; size];
        fill_normal(&mut rng, &mut v);
        let square: f64 = v.iter().map(|x| x * x).sum();
        v.iter().map(|x| x * x / square).collect()
    };
    (0..DIRECTIONS).map(one).collect()
}

/// ψ'(n/2): the variance of ln χ²(n). ψ'(½) = π²/2, ψ'(1) = π²/6, ψ'(x + 1) = ψ'(x) − 1/x².
fn trigamma_of_half(n: usize) -> f64 {
    let square = std::f64::consts::PI.powi(2);
    let (mut value, mut x) = if n % 2 == 1 { (square / 2.0, 0.5) } else { (square / 6.0, 1.0) };
    while x < n as f64 / 2.0 {
        value -= 1.0 / (x * x);
        x += 1.0;
    }
    value
}
