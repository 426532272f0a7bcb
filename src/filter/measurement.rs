//! One scalar measurement, and what an update with it says.

/// One scalar-measurement update's results.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Update {
    /// ν = z − H x(k|k−1), SI.
    pub innovation: f64,
    /// S = H P Hᵀ + R.
    pub variance: f64,
    /// ν²/S.
    pub nis: f64,
    /// False when it was gated out or not a finite number (the state was not changed).
    pub accepted: bool,
}

impl Update {
    /// −½ (ln 2πS + ν²/S).
    pub fn log_likelihood(&self) -> f64 {
        -0.5 * ((std::f64::consts::TAU * self.variance).ln() + self.nis)
    }

    /// ν and S of a measurement, which can be used when both are numbers, S > 0 and |ν| ≤ gate·√S.
    #[inline(always)]
    pub fn new(innovation: f64, variance: f64, gate: f64) -> Update {
        let nis = innovation * innovation * (1.0 / variance);
        let sound = variance > 0.0 && variance.is_finite() && nis.is_finite();
        Update { innovation, variance, nis, accepted: sound && nis <= gate * gate }
    }
}

/// A scalar measurement z = h x + v, v ~ N(0, r).
pub(super) struct Measurement<'a> {
    pub(super) h: &'a [f64],
    pub(super) r: f64,
    pub(super) z: f64,
    pub(super) gate: f64,
}
