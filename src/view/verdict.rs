//! The tests behind a verdict.

use crate::consistency::Test;
use crate::report::{Level, Section};
use crate::units::digits;

const TESTS: [&str; 10] =
    ["axis", "test", "statistic", "lower", "upper", "p", "effect", "interval", "tolerated", "result"];

/// The tests of `of` ("the innovations") and what the significant ones say; `more`: a sentence to what "small" means.
pub(super) fn tests<'a>(of: &str, more: &str, tests: &[Test], alpha: f64) -> Section<'a> {
    let caption = format!(
        "Tests of {of}: bounds at {} %, each alone; p adjusted for all {} tests (Holm)",
        digits(100.0 * (1.0 - alpha)),
        tests.len()
    );
    let said = tests.iter().filter(|t| t.adjusted_p_value < alpha);
    Section::of_page("Tests")
        .at(Level::Page)
        .paragraph(format!(
            "A test fails when it is significant and its effect is beyond what is tolerated; 'small' marks a deviation \
             that is real but within the tolerance.{more}"
        ))
        .at(Level::Full)
        .table(caption, &TESTS, tests.iter().map(|t| row(t, alpha)))
        .minor(&["statistic", "lower", "upper", "interval"])
        .at(Level::Page)
        .list(said.map(|t| format!("{}, {}: {}.", t.axis, t.name, t.meaning)).collect())
}

fn row(test: &Test, alpha: f64) -> [String; 10] {
    let range = |r: [f64; 2]| format!("{} … {}", digits(r[0]), digits(r[1]));
    let effect = test.effect.as_ref();
    let [value, interval, tolerance] = effect.map_or(["-"; 3].map(String::from), |effect| {
        [digits(effect.value), range(effect.interval), range(effect.tolerance)]
    });
    let result = match (test.pass(), test.adjusted_p_value < alpha) {
        _ if !test.has_numbers() => "none",
        (true, false) => "pass",
        (true, true) => "small",
        (false, _) => "FAIL",
    };
    let name = test.averaging_s.map_or_else(|| test.name.clone(), |s| format!("{} {} s", test.name, digits(s)));
    let [statistic, lower, upper, p] = [test.statistic, test.lower, test.upper, test.adjusted_p_value].map(digits);
    [test.axis.clone(), name, statistic, lower, upper, p, value, interval, tolerance, result.into()]
}
