//! Words and numbers of answers, which are short.

use crate::consistency::{Test, Verdict};
use crate::report::Conclusion;
use crate::units::{Unit, duration, significant};

/// Three significant digits: more than an interval of a per cent needs.
pub(super) fn three(value: f64) -> String {
    significant(value, 3).replace('-', "−")
}

/// A time in three digits.
pub(super) fn time(seconds: f64) -> String {
    match duration(seconds).split_once(' ') {
        Some((number, unit)) => format!("{} {unit}", number.parse().map_or(number.to_owned(), three)),
        None => String::new(),
    }
}

/// "deg/s/√Hz".
pub(super) fn unit(unit: &Unit) -> String {
    let text = unit.to_string();
    let Some((before, rest)) = text.split_once("sqrt(") else { return text };
    match rest.split_once(')') {
        Some((root, after)) => format!("{before}√{root}{after}"),
        None => text,
    }
}

/// "pass", or how many of the tests of an axis fail.
pub(super) fn result<'t>(tests: impl Iterator<Item = &'t Test>) -> String {
    let (mut all, mut failed) = (0, 0);
    for test in tests {
        all += 1;
        failed += usize::from(!test.pass());
    }
    match (all, failed) {
        (0, _) => "not judged".into(),
        (_, 0) => "pass".into(),
        _ => format!("FAIL: {failed} of {all} tests"),
    }
}

/// The verdict; of a bad one only the test that speaks most against the filter.
pub(super) fn conclusion(verdict: Verdict, meaning: &str, tests: &[Test]) -> Conclusion {
    let conclusion = Conclusion::new(verdict, meaning);
    let failed = || tests.iter().filter(|test| !test.pass());
    let worst = failed().min_by(|a, b| a.adjusted_p_value.total_cmp(&b.adjusted_p_value));
    match worst.filter(|_| verdict == Verdict::Inconsistent) {
        Some(test) => {
            let (count, all) = (failed().count(), tests.len());
            conclusion.brief(format!("{count} of {all} tests fail; above all {}: {}", test.axis, test.meaning))
        }
        None => conclusion,
    }
}

/// Two lines of a terminal.
const LONGEST: usize = 150;

/// As much of the text as fits, up to the end of a word.
pub(super) fn cut(text: &str) -> String {
    match text.char_indices().nth(LONGEST) {
        None => text.to_owned(),
        Some((end, _)) => {
            let kept = text[..end].rsplit_once(' ').map_or(&text[..end], |(kept, _)| kept);
            format!("{} …", kept.trim_end_matches([',', ';', ':']))
        }
    }
}

/// The first of the warnings, and how many more there are.
pub(super) fn warnings(mut all: Vec<String>) -> Vec<String> {
    let more = all.len().saturating_sub(1);
    all.truncate(1);
    let more = if more > 0 { format!(" ({more} more)") } else { String::new() };
    all.iter().map(|first| cut(first) + &more).collect()
}
