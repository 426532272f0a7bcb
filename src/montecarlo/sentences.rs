//! What a result means, in words. Optimistic: errors larger than claimed. Pessimistic: smaller.

use super::{Course, Outcome};
use crate::consistency::Test;
use crate::units::digits;

/// "too much", "too little" or nothing to say.
fn side(value: f64, bounds: [f64; 2]) -> Option<bool> {
    if value > bounds[1] {
        Some(true)
    } else if value < bounds[0] {
        Some(false)
    } else {
        None
    }
}

pub(super) fn nees(value: f64, bounds: [f64; 2], time_s: f64) -> String {
    let ratio = digits(value.sqrt());
    let time = digits(time_s);
    match side(value, bounds) {
        Some(true) => format!("optimistic: at {time} s the errors are {ratio} times as large as the covariance says"),
        Some(false) => {
            format!("pessimistic: at {time} s the errors are only {ratio} times as large as the covariance says")
        }
        None => "at all times the errors are as large as the covariance says".into(),
    }
}

pub(super) fn nees_average(value: f64, bounds: [f64; 2], effective: f64) -> String {
    let ratio = digits(value.sqrt());
    let worth = format!("a run is worth {} independent errors", digits(effective));
    match side(value, bounds) {
        Some(true) => format!("optimistic: over time the errors are {ratio} times as large as claimed; {worth}"),
        Some(false) => format!("pessimistic: over time the errors are only {ratio} times as large as claimed; {worth}"),
        None => format!("over time the errors are as large as claimed; {worth}"),
    }
}

pub(super) fn mean_error(outside: bool, time_s: f64) -> String {
    if outside {
        format!(
            "at {} s the errors are not zero on average: a wrong x0, or something drives the filter off",
            digits(time_s)
        )
    } else {
        "the errors are zero on average at all times".into()
    }
}

pub(super) fn nis(value: f64, bounds: [f64; 2]) -> String {
    let ratio = digits(value.sqrt());
    match side(value, bounds) {
        Some(true) => format!("optimistic: innovations are {ratio} times as large as √S; mostly R is too small"),
        Some(false) => format!("pessimistic: innovations are only {ratio} times as large as √S; mostly R is too large"),
        None => "innovations are as large as √S says".into(),
    }
}

pub(super) fn innovation_mean(value: f64, bound: f64) -> String {
    if value.abs() > bound {
        "innovations are not zero on average: a bias is not estimated".into()
    } else {
        "innovations are zero on average".into()
    }
}

pub(super) fn autocorrelation(value: f64, bound: f64, lag: usize, lag_s: f64) -> String {
    if value.abs() > bound {
        format!(
            "innovations are correlated, most at lag {lag} ({} s): the model misses something that fast",
            digits(lag_s)
        )
    } else {
        "no lag is correlated beyond chance".into()
    }
}

pub(super) fn ljung_box(outside: bool, lags: usize) -> String {
    if outside {
        format!("lags 1 to {lags} together are correlated")
    } else {
        format!("lags 1 to {lags} together are white")
    }
}

pub(super) fn cumulative_periodogram(distance: f64, bound: f64, period_s: f64, shortest_s: f64) -> String {
    let period = digits(period_s);
    match side(distance, [-bound, bound]) {
        Some(true) => format!("optimistic about slow drift: too much innovation power at periods above {period} s"),
        Some(false) => format!("pessimistic about slow drift: too little innovation power at periods above {period} s"),
        None => format!("innovations are white at periods above {} s", digits(shortest_s)),
    }
}

pub(super) fn low_frequency(value: f64, bounds: [f64; 2], seconds: f64) -> String {
    let (ratio, seconds) = (digits(value), digits(seconds));
    match side(value, bounds) {
        Some(true) => format!(
            "optimistic about slow drift: averaged over {seconds} s the innovations have {ratio} times the power that \
             the filter says"
        ),
        Some(false) => format!(
            "pessimistic about slow drift: averaged over {seconds} s the innovations have only {ratio} times the power \
             that the filter says"
        ),
        None => "slow innovations are as large as the filter says".into(),
    }
}

/// What runs that end before the filter settles do not judge.
pub(super) fn unsettled(course: &Course) -> String {
    let duration = course.steps as f64 * course.dt;
    let slow: Vec<String> = course
        .axes
        .iter()
        .filter(|axis| axis.settling_s > duration)
        .map(|axis| format!("{} ({} s)", axis.name, digits(axis.settling_s)))
        .collect();
    if slow.is_empty() {
        return String::new();
    }
    format!(
        "; runs of {} s end before the filter has settled: {}; judged is the way there, not the settled filter, which \
         a longer `duration` judges",
        digits(duration),
        slow.join(", ")
    )
}

/// The verdict in a sentence.
pub(super) fn verdict(outcome: &Outcome) -> String {
    let failed: Vec<&Test> = outcome.tests.iter().filter(|t| !t.pass()).collect();
    let Some(worst) = failed.iter().min_by(|a, b| a.p_value.total_cmp(&b.p_value)) else {
        return "errors and innovations are what the filter says".into();
    };
    let optimistic = failed.iter().filter(|t| t.meaning.starts_with("optimistic")).count();
    let pessimistic = failed.iter().filter(|t| t.meaning.starts_with("pessimistic")).count();
    let tendency = match (optimistic, pessimistic) {
        (0, 0) => "the filter is wrong",
        (_, 0) => "the filter is optimistic",
        (0, _) => "the filter is pessimistic",
        _ => "the filter is optimistic in one respect and pessimistic in another",
    };
    let count = outcome.tests.len();
    format!(
        "{tendency}: {} of {count} tests fail, first of all {} of axis {}: {}",
        failed.len(),
        worst.name,
        worst.axis,
        worst.meaning
    )
}
