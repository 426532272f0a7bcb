//! Many tests, one statement: Holm's step-down adjustment over all tests and axes.

use super::{Test, Verdict};

/// Holm's adjusted p-values: p̃_(i) = max_{j ≤ i} min(1, (m − j + 1)·p_(j)), in the order of the input.
///
/// Rejecting where p̃ < α keeps the probability of any false rejection at most α, whatever the dependence between
/// the tests. NaN p-values stay NaN and count as no test. Source: Holm 1979, Scand. J. Statist. 6.
pub fn holm(p_values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..p_values.len()).filter(|&i| !p_values[i].is_nan()).collect();
    order.sort_by(|&a, &b| p_values[a].total_cmp(&p_values[b]));
    let tests = order.len();
    let mut adjusted = vec![f64::NAN; p_values.len()];
    let mut largest = 0.0f64;
    for (rank, &index) in order.iter().enumerate() {
        largest = largest.max(((tests - rank) as f64 * p_values[index]).min(1.0));
        adjusted[index] = largest;
    }
    adjusted
}

/// Holm's adjusted p-values of the tests, each judged by `pass`.
pub(super) fn judge_each(tests: &mut [Test], pass: impl Fn(&Test) -> bool) {
    let p_values: Vec<f64> = tests.iter().map(|t| t.p_value).collect();
    tests.iter_mut().zip(holm(&p_values)).for_each(|(test, adjusted)| test.judge(adjusted, &pass));
}

/// Judges by p-values alone, as is right for simulated data: a test passes when its adjusted p-value is at least
/// `alpha`, and the whole is inconsistent when any test fails. The family-wise false-alarm probability is at most
/// `alpha`.
pub fn judge(tests: &mut [Test], alpha: f64) -> Verdict {
    judge_each(tests, |test| test.adjusted_p_value >= alpha);
    if tests.is_empty() || tests.iter().any(|t| !t.has_numbers()) {
        Verdict::Inconclusive
    } else if tests.iter().all(Test::pass) {
        Verdict::Consistent
    } else {
        Verdict::Inconsistent
    }
}
