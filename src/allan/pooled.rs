//! One curve from several windows of a log that is too long to be held at once.

use rayon::prelude::*;

use super::deviation::{self, variances};
use super::noise_id::Evidence;
use super::{AllanCurve, AllanError, AllanPoint, Deviation, NoiseType, TauGrid, edf, tau};
use crate::numerics::reduce::Sum;

/// Mean squares of differences over windows of the same length: with `V_w(m)` the variance estimate of window w,
/// `V(m) = Σ_w V_w(m)/W`.
///
/// Every window gives each averaging time the same number of differences, so this is the mean square of all
/// differences that lie within a window; those that reach over an end are not taken. Averaging times stop where one
/// window's do. Degrees of freedom add up, as if the windows had independent noise; of drift slower than a window
/// they have not, but it is taken off each window with its mean and slope, all but a little.
#[derive(Clone, Debug)]
pub struct Pooled {
    kind: Deviation,
    samples: usize,
    dt: f64,
    factors: Vec<u64>,
    variances: Vec<Sum>,
    evidence: Vec<Evidence>,
    windows: u64,
}

impl Pooled {
    /// For windows of so many rate samples of period `dt` (s).
    pub fn new(kind: Deviation, samples: usize, dt: f64, grid: TauGrid) -> Pooled {
        let factors = tau::averaging_factors(grid, deviation::largest_factor(kind, samples));
        let (variances, evidence) = (vec![Sum::default(); factors.len()], vec![Evidence::default(); factors.len()]);
        Pooled { kind, samples, dt, factors, variances, evidence, windows: 0 }
    }

    /// Another window: its phase, finite, one point more than a window has samples. [`AllanError::TooShort`] when it
    /// has fewer.
    pub fn add(&mut self, phase: &[f64]) -> Result<(), AllanError> {
        if phase.len() != self.samples + 1 {
            return Err(AllanError::TooShort { samples: phase.len().saturating_sub(1), needed: self.samples });
        }
        let found = variances(self.kind, phase, self.dt, &self.factors)?;
        self.variances.iter_mut().zip(found).for_each(|(sum, found)| sum.add(found.variance));
        let each = self.evidence.par_iter_mut().zip(&self.factors);
        each.for_each(|(evidence, m)| evidence.add(&Evidence::of(phase, *m as usize)));
        self.windows += 1;
        Ok(())
    }

    /// Windows so far.
    pub fn windows(&self) -> u64 {
        self.windows
    }

    /// The curve, intervals with the degrees of freedom of the power law at each point; see [`super::curve`]. NaN
    /// without a window.
    pub fn curve(&self) -> AllanCurve {
        let Pooled { kind, samples, dt, .. } = *self;
        let windows = self.windows as f64;
        // where too few averages are left to identify the noise, the last type that was seen is taken
        let mut last = NoiseType::Unknown;
        let mut seen = Vec::new();
        for evidence in &self.evidence {
            let noise = evidence.kind();
            if noise != NoiseType::Unknown {
                last = noise;
            }
            seen.push((noise, last));
        }
        let points = self.factors.par_iter().zip(&self.variances).zip(seen).map(|((&m, sum), (noise, law))| {
            let mut point = AllanPoint {
                m,
                tau_s: m as f64 * dt,
                deviation: (sum.value() / windows).sqrt(),
                lower: f64::NAN,
                upper: f64::NAN,
                edf: f64::NAN,
                terms: self.windows * deviation::terms(kind, samples, m),
                noise,
            };
            point.set_edf(windows * edf::power_law_degrees_of_freedom(kind, samples, m, law));
            point
        });
        AllanCurve { deviation: kind, dt, samples, windows: self.windows, points: points.collect() }
    }
}
