//! How large a deviation is, beside how sure it is: the verdict on measured logs.
//!
//! On a million samples an exact test sees deviations that matter to nobody; on a minute of data it sees none. So
//! each test carries an [`Effect`]: the size of the deviation in a unit that means something, its interval, and the
//! range within which it does not matter (the tolerance, stated in the document).

use schemars::JsonSchema;
use serde::Serialize;

use super::{Test, Verdict, multiplicity};

/// Relative deviation of the mean NIS from its expectation that is tolerated: ±10 %, that is 5 % in √S.
pub const NIS_TOLERANCE: f64 = 0.10;
/// Largest |autocorrelation| of the innovations that is tolerated: one lag of 0.1 predicts 1 % of the innovation
/// variance.
pub const AUTOCORRELATION_TOLERANCE: f64 = 0.1;
/// Share of the innovation variance that its own past predicts and that is tolerated: what a better model could gain.
pub const PREDICTABLE_TOLERANCE: f64 = 0.03;
/// Low-frequency variance ratio that is tolerated, either way: about 14 % in the size of the drift.
pub const VARIANCE_RATIO_TOLERANCE: f64 = 1.3;
/// Largest distance of the cumulative periodogram from a straight line that is tolerated.
pub const PERIODOGRAM_TOLERANCE: f64 = 0.1;

/// The size of a deviation.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Effect {
    /// "relative_nis_deviation", "max_abs_autocorrelation", "predictable_share", "variance_ratio",
    /// "periodogram_distance".
    pub name: String,
    pub value: f64,
    /// Interval of confidence 1 − alpha.
    pub interval: [f64; 2],
    /// Deviations inside do not matter.
    pub tolerance: [f64; 2],
}

impl Effect {
    pub fn new(name: &str, value: f64, interval: [f64; 2], tolerance: [f64; 2]) -> Effect {
        Effect { name: name.to_string(), value, interval, tolerance }
    }
    /// The estimate is outside the tolerance.
    pub fn is_beyond(&self) -> bool {
        self.value < self.tolerance[0] || self.value > self.tolerance[1]
    }
    /// The whole interval is inside the tolerance.
    pub fn is_surely_small(&self) -> bool {
        self.interval[0] >= self.tolerance[0] && self.interval[1] <= self.tolerance[1]
    }
}

/// Judges a measured log. For each test, with Holm's adjusted p-value over all tests and axes:
///
/// 1. not significant (p̃ ≥ alpha): passes;
/// 2. significant, and the effect's estimate beyond its tolerance (or a test without an effect): fails;
/// 3. significant, the estimate within the tolerance: passes, since the deviation is real but small; if the interval
///    still reaches beyond the tolerance, the log cannot tell whether it is small, and the test is undecided.
///
/// Any failure makes the verdict inconsistent. Otherwise it is inconclusive when a test is undecided, has no
/// numbers, or when `enough` is false (the log is too short for the drift to be judged); else consistent. Under a
/// true design the probability of "inconsistent" is at most `alpha`; the effect can only lower it.
pub fn judge(tests: &mut [Test], alpha: f64, enough: bool) -> Verdict {
    let beyond = |test: &Test| test.effect.as_ref().is_none_or(Effect::is_beyond);
    multiplicity::judge_each(tests, |test| test.adjusted_p_value >= alpha || !beyond(test));
    let failed = tests.iter().any(|test| test.has_numbers() && !test.pass());
    let undecided = !enough || tests.is_empty() || tests.iter().any(|test| is_undecided(test, alpha));
    match (failed, undecided) {
        (true, _) => Verdict::Inconsistent,
        (false, true) => Verdict::Inconclusive,
        (false, false) => Verdict::Consistent,
    }
}

/// A judged test that could not tell: no numbers, or a sure deviation whose size may or may not matter.
pub fn is_undecided(test: &Test, alpha: f64) -> bool {
    let unsure = !test.effect.as_ref().is_some_and(Effect::is_surely_small);
    !test.has_numbers() || (test.pass() && test.adjusted_p_value < alpha && unsure)
}
