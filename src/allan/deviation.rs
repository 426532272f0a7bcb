//! The Allan family on phase: each deviation is a mean square of differences, O(n) per averaging factor.
//!
//! Everything is computed from the phase θ (angle for a gyro, velocity for an accelerometer), made from the rate by one
//! prefix sum, or given directly when the log holds the integral. With x the phase, N = n + 1 points of it,
//! tau = m dt (Riley 2008, NIST SP 1065, sections 5.2.2 to 5.2.11).

use rayon::prelude::*;

use super::moving::{self, second};
pub use super::phase::phase;
use super::{AllanError, Deviation, squares};
use crate::numerics::progress::checkpoint;
use crate::numerics::reduce::Sum;

/// A variance (square of the deviation, SI²) and how many differences it is the mean of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    pub variance: f64,
    pub terms: u64,
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

/// The variance at averaging factor `m` from phase (n + 1 values, unit·s) with sample period `dt` (s); see
/// [`variances`].
pub fn variance(deviation: Deviation, phase: &[f64], dt: f64, m: u64) -> Result<Estimate, AllanError> {
    let mut estimates = variances(deviation, phase, dt, &[m])?;
    estimates.pop().ok_or(AllanError::TooShort { samples: 0, needed: 1 })
}

/// The variances at several averaging factors, in one walk over the phase where they overlap.
///
/// * ADEV, overlapping ADEV: `⟨(x_{k+2m} − 2x_{k+m} + x_k)²⟩ / (2 tau²)`, k in steps of m or of 1
/// * MDEV: the same of phase averaged over m points, `⟨(Σ_{i=j}^{j+m−1} x_{i+2m} − 2x_{i+m} + x_i)²⟩ / (2 m² tau²)`
/// * HDEV, overlapping HDEV: `⟨(x_{k+3m} − 3x_{k+2m} + 3x_{k+m} − x_k)²⟩ / (6 tau²)`
/// * TOTDEV: second differences centred on every inner point, phase continued at both ends by odd reflection
///
/// Each value is the same to the bit whichever other factors are asked for. Fails with [`AllanError::TooShort`] when
/// at one of them not even one difference fits.
pub fn variances(deviation: Deviation, phase: &[f64], dt: f64, factors: &[u64]) -> Result<Vec<Estimate>, AllanError> {
    let samples = phase.len().saturating_sub(1);
    let counts: Vec<u64> = factors.iter().map(|m| terms(deviation, samples, *m)).collect();
    if let Some(at) = counts.iter().position(|count| *count == 0) {
        let needed = usize::try_from(fewest_samples(deviation, factors[at].max(1))).unwrap_or(usize::MAX);
        return Err(AllanError::TooShort { samples, needed });
    }
    let (x, steps) = (phase, factors.iter().map(|m| *m as usize).collect::<Vec<usize>>());
    // without overlap, and at the ends, one factor is one loop
    let each = |sum: &(dyn Fn(usize, usize) -> f64 + Sync)| -> Vec<f64> {
        let one = |(m, count): (&usize, &u64)| {
            checkpoint();
            sum(*m, *count as usize)
        };
        steps.par_iter().zip(&counts).map(one).collect()
    };
    let squares = match deviation {
        Deviation::Adev => each(&|m, count| sum_of_squares(count, |k| second(x, k * m, m))),
        Deviation::Hdev => each(&|m, count| sum_of_squares(count, |k| third(x, k * m, m))),
        Deviation::Mdev => each(&|m, count| moving::sum_of_squares(x, count, m)),
        Deviation::Oadev => squares::of_second_differences(x, &steps),
        Deviation::Ohdev => squares::of_third_differences(x, &steps),
        Deviation::Totdev => {
            let ends = each(&|m, _| at_the_ends(x, m));
            let inside = squares::of_second_differences(x, &steps);
            inside.iter().zip(ends).map(|(inside, ends)| inside + ends).collect()
        }
    };
    let norm = |m: u64| {
        let tau = m as f64 * dt;
        match deviation {
            Deviation::Adev | Deviation::Oadev | Deviation::Totdev => 2.0 * tau * tau,
            Deviation::Mdev => 2.0 * (m as f64 * tau).powi(2),
            Deviation::Hdev | Deviation::Ohdev => 6.0 * tau * tau,
        }
    };
    let estimates = factors.iter().zip(counts).zip(squares);
    Ok(estimates
        .map(|((m, terms), squares)| Estimate { variance: squares / (norm(*m) * terms as f64), terms })
        .collect())
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

/// Σ of the squares of the second differences of the reflected phase that reach over an end of it: centres 1 … m − 1
/// from either.
fn at_the_ends(x: &[f64], m: usize) -> f64 {
    let last = x.len() as isize - 1;
    let span = m as isize;
    let centred = |i: isize| {
        let middle = x[i as usize];
        (reflected(x, i + span) - middle) - (middle - reflected(x, i - span))
    };
    sum_of_squares(m - 1, |k| centred(k as isize + 1)) + sum_of_squares(m - 1, |k| centred(last - 1 - k as isize))
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
