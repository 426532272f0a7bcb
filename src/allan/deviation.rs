//! The Allan family on phase: each deviation is a mean square of differences, O(n) per averaging factor.
//!
//! Everything is computed from the phase θ (angle for a gyro, velocity for an accelerometer), made from the rate by one
//! compensated prefix sum, or given directly when the log holds the integral. With x the phase, N = n + 1 points of it,
//! tau = m dt (Riley 2008, NIST SP 1065, sections 5.2.2 to 5.2.11).

use super::{AllanError, Deviation};
use crate::numerics::reduce::{Sum, mean};

/// A variance (square of the deviation, SI²) and how many differences it is the mean of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    pub variance: f64,
    pub terms: u64,
}

/// Phase of rate samples without their mean: `θ_0 = 0, θ_k = dt Σ_{j<k} (y_j − ȳ)`, n + 1 values in unit·s.
///
/// No member of the family sees the mean; without it the phase stays small and the differences keep their digits.
pub fn phase(rate: &[f64], dt: f64) -> Vec<f64> {
    let level = mean(rate);
    let mut sum = Sum::default();
    let mut phase = Vec::with_capacity(rate.len() + 1);
    phase.push(0.0);
    for y in rate {
        sum.add(y - level);
        phase.push(sum.value() * dt);
    }
    phase
}

/// Rate samples that one difference at averaging factor `m` needs.
pub fn fewest_samples(deviation: Deviation, m: u64) -> u64 {
    match deviation {
        Deviation::Adev | Deviation::Oadev | Deviation::Totdev => m.saturating_mul(2),
        // the sums of m second differences span 3m phase points
        Deviation::Mdev => m.saturating_mul(3) - 1,
        Deviation::Hdev | Deviation::Ohdev => m.saturating_mul(3),
    }
}

/// Largest averaging factor with at least one difference in `samples` rate samples.
pub fn largest_factor(deviation: Deviation, samples: usize) -> u64 {
    let samples = samples as u64;
    match deviation {
        Deviation::Adev | Deviation::Oadev | Deviation::Totdev => samples / 2,
        Deviation::Mdev => (samples + 1) / 3,
        Deviation::Hdev | Deviation::Ohdev => samples / 3,
    }
}

/// Number of differences at averaging factor m in `samples` rate samples (0 when m is out of range).
pub fn terms(deviation: Deviation, samples: usize, m: u64) -> u64 {
    if m == 0 || m > largest_factor(deviation, samples) {
        return 0;
    }
    let n = samples as u64;
    match deviation {
        Deviation::Adev => n / m - 1,
        Deviation::Oadev => n + 1 - 2 * m,
        Deviation::Mdev => n + 2 - 3 * m,
        Deviation::Hdev => n / m - 2,
        Deviation::Ohdev => n + 1 - 3 * m,
        Deviation::Totdev => n - 1,
    }
}

/// The variance at averaging factor `m` from phase (n + 1 values, unit·s) with sample period `dt` (s).
///
/// * ADEV, overlapping ADEV: `⟨(x_{k+2m} − 2x_{k+m} + x_k)²⟩ / (2 tau²)`, k in steps of m or of 1
/// * MDEV: the same of phase averaged over m points, `⟨(Σ_{i=j}^{j+m−1} x_{i+2m} − 2x_{i+m} + x_i)²⟩ / (2 m² tau²)`
/// * HDEV, overlapping HDEV: `⟨(x_{k+3m} − 3x_{k+2m} + 3x_{k+m} − x_k)²⟩ / (6 tau²)`
/// * TOTDEV: second differences centred on every inner point, phase continued at both ends by odd reflection
///
/// Fails with [`AllanError::TooShort`] when not even one difference fits.
pub fn variance(deviation: Deviation, phase: &[f64], dt: f64, m: u64) -> Result<Estimate, AllanError> {
    let samples = phase.len().saturating_sub(1);
    let terms = terms(deviation, samples, m);
    if terms == 0 {
        let needed = usize::try_from(fewest_samples(deviation, m.max(1))).unwrap_or(usize::MAX);
        return Err(AllanError::TooShort { samples, needed });
    }
    let (x, count, m) = (phase, terms as usize, m as usize);
    let tau = m as f64 * dt;
    let squares = match deviation {
        Deviation::Adev => sum_of_squares(count, |k| second(x, k * m, m)),
        Deviation::Oadev => sum_of_squares(count, |k| second(x, k, m)),
        Deviation::Hdev => sum_of_squares(count, |k| third(x, k * m, m)),
        Deviation::Ohdev => sum_of_squares(count, |k| third(x, k, m)),
        Deviation::Mdev => sum_of_squares_of_moving_sums(x, count, m),
        Deviation::Totdev => {
            let at = |i: usize| reflected(x, i as isize + 1 - m as isize);
            sum_of_squares(count, |k| (at(k + 2 * m) - at(k + m)) - (at(k + m) - at(k)))
        }
    };
    let norm = match deviation {
        Deviation::Adev | Deviation::Oadev | Deviation::Totdev => 2.0 * tau * tau,
        Deviation::Mdev => 2.0 * (m as f64 * tau).powi(2),
        Deviation::Hdev | Deviation::Ohdev => 6.0 * tau * tau,
    };
    Ok(Estimate { variance: squares / (norm * terms as f64), terms })
}

fn second(x: &[f64], k: usize, m: usize) -> f64 {
    (x[k + 2 * m] - x[k + m]) - (x[k + m] - x[k])
}

fn third(x: &[f64], k: usize, m: usize) -> f64 {
    second(x, k + m, m) - second(x, k, m)
}

/// The phase continued by odd reflection about its first and last point: `x*_{−j} = 2x_0 − x_j`.
fn reflected(x: &[f64], i: isize) -> f64 {
    let last = x.len() as isize - 1;
    if i < 0 {
        2.0 * x[0] - x[(-i) as usize]
    } else if i > last {
        2.0 * x[last as usize] - x[(2 * last - i) as usize]
    } else {
        x[i as usize]
    }
}

/// Σ (Σ_{i=j}^{j+m−1} z_i)² over j, z the second differences; the inner sum is moved along, not recomputed.
fn sum_of_squares_of_moving_sums(x: &[f64], count: usize, m: usize) -> f64 {
    let mut moving = Sum::default();
    for i in 0..m {
        moving.add(second(x, i, m));
    }
    let mut total = Sum::default();
    for j in 0..count {
        total.add(moving.value().powi(2));
        if j + 1 < count {
            moving.add(second(x, j + m, m));
            moving.add(-second(x, j, m));
        }
    }
    total.value()
}

/// Plain sums over short blocks, compensated over the blocks: as accurate as needed and as fast as plain.
fn sum_of_squares(count: usize, term: impl Fn(usize) -> f64) -> f64 {
    const BLOCK: usize = 1024;
    let mut total = Sum::default();
    for start in (0..count).step_by(BLOCK) {
        let block = start..(start + BLOCK).min(count);
        total.add(block.map(|k| term(k).powi(2)).sum());
    }
    total.value()
}
