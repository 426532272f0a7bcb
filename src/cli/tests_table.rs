//! The tests of a verdict document as a table.

use super::output::digits;
use crate::consistency::Test;

pub(super) const TESTS: [&str; 10] =
    ["axis", "test", "statistic", "lower", "upper", "p", "effect", "interval", "tolerated", "result"];

/// `of`: "the innovations".
pub(super) fn caption(of: &str, tests: &[Test], alpha: f64) -> String {
    format!(
        "Tests of {of}: bounds at {} %, each alone; p adjusted for all {} tests (Holm)",
        digits(100.0 * (1.0 - alpha)),
        tests.len()
    )
}

pub(super) fn rows(tests: &[Test], alpha: f64) -> Vec<Vec<String>> {
    tests.iter().map(|t| row(t, alpha)).collect()
}

/// What every significant test says.
pub(super) fn said(tests: &[Test], alpha: f64) -> Vec<String> {
    let of = |t: &Test| format!("{}, {}: {}.", t.axis, t.name, t.meaning);
    tests.iter().filter(|t| t.adjusted_p_value < alpha).map(of).collect()
}

fn row(test: &Test, alpha: f64) -> Vec<String> {
    let range = |r: [f64; 2]| format!("{} … {}", digits(r[0]), digits(r[1]));
    let (value, interval, tolerance) = test.effect.as_ref().map_or_else(
        || ("-".to_string(), "-".to_string(), "-".to_string()),
        |e| (digits(e.value), range(e.interval), range(e.tolerance)),
    );
    let result = match (test.pass(), test.adjusted_p_value < alpha) {
        _ if !test.has_numbers() => "none",
        (true, false) => "pass",
        (true, true) => "small",
        (false, _) => "FAIL",
    };
    vec![
        test.axis.clone(),
        test.averaging_s.map_or_else(|| test.name.clone(), |s| format!("{} {} s", test.name, digits(s))),
        digits(test.statistic),
        digits(test.lower),
        digits(test.upper),
        digits(test.adjusted_p_value),
        value,
        interval,
        tolerance,
        result.to_string(),
    ]
}
