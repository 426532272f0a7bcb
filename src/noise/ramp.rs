//! Rate ramp: y_k = slope · k dt. Deterministic: no spectrum and no covariance, but an Allan variance.

use nalgebra::{dmatrix, dvector};

use super::{Realisation, SamplePath};

/// R²τ²/2, exact for samples too.
pub(super) fn allan_variance(slope: f64, m: u64, dt: f64) -> f64 {
    0.5 * (slope * m as f64 * dt).powi(2)
}

/// Value and slope; the slope is unknown with the stated size, the value starts at 0.
pub(super) fn realisation(slope: f64, dt: f64) -> Realisation {
    Realisation {
        phi: dmatrix![1.0, dt; 0.0, 1.0],
        q: dmatrix![0.0, 0.0; 0.0, 0.0],
        p0: dmatrix![0.0, 0.0; 0.0, slope * slope],
        h: dvector![1.0, 0.0].transpose(),
        names: vec!["rate_ramp".into(), "rate_ramp.slope".into()],
        exact: true,
    }
}

pub(super) struct Path {
    step: f64,
    index: u64,
}

impl Path {
    pub(super) fn new(slope: f64, dt: f64) -> Self {
        Path { step: slope * dt, index: 0 }
    }
}

impl SamplePath for Path {
    fn fill(&mut self, out: &mut [f64]) {
        for y in out {
            *y = self.step * self.index as f64;
            self.index += 1;
        }
    }
}
