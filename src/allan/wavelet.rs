//! Haar wavelet variance: the Allan variance in the words of wavelets.
//!
//! The maximum-overlap coefficient of level j is W_{j,k} = ½ (ȳ_k − ȳ_{k−m}), ȳ_k the mean of the m = 2^{j−1}
//! samples that end at k. Hence ν²_j = E W² = ½ σ²_A(m dt), and the unbiased estimate, the mean square of the n −
//! 2^j + 1 coefficients that no end of the log touches, is half the overlapping Allan variance. White noise of
//! variance s² per sample: s²/2^j. Sources: Percival & Guttorp 1994; Percival & Walden 2000, sections 5.2 and 8.3;
//! Guerrier, Skaloud, Stebler & Victoria-Feser 2013, section 2.

use super::{AllanCurve, AllanPoint, Deviation};
use crate::noise::NoiseModel;

/// One level, SI².
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Level {
    /// j ≥ 1.
    pub level: u32,
    /// Length of the wavelet: 2^j samples.
    pub samples: u64,
    pub variance: f64,
    /// 95 %, from the degrees of freedom of the Allan point.
    pub lower: f64,
    pub upper: f64,
    /// Coefficients in the mean.
    pub terms: u64,
}

/// The levels of a curve of overlapping Allan deviations at averaging factors among which are powers of two; of
/// other deviations none.
pub fn levels(curve: &AllanCurve) -> Vec<Level> {
    let half_square = |deviation: f64| 0.5 * deviation * deviation;
    let of = |point: &AllanPoint| Level {
        level: point.m.ilog2() + 1,
        samples: 2 * point.m,
        variance: half_square(point.deviation),
        lower: half_square(point.lower),
        upper: half_square(point.upper),
        terms: point.terms,
    };
    let kept = curve.points.iter().filter(|p| curve.deviation == Deviation::Oadev && p.m.is_power_of_two());
    kept.map(of).collect()
}

/// ν²_j of this mixture, SI².
pub fn expected(model: &NoiseModel, level: &Level, dt: f64) -> f64 {
    0.5 * model.allan_variance(level.samples / 2, dt)
}
