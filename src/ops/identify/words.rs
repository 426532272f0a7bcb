//! What `identify` says of a log beside the parameters.

use crate::identify::{Identified, Recent};
use crate::ops::stretch::Stretch;
use crate::params::BetweenLogs;
use crate::signal::upsets;
use crate::units::digits;

/// Steps of the level that are listed.
const MOST_STEPS: usize = 5;

/// That the noise of the log changes, and what can be done about it.
pub(super) fn change_words(recent: &Recent, part: &Stretch, dt: f64) -> String {
    let seconds = |samples: usize| digits(samples as f64 * dt);
    let of = if part.left_out > 0 { " of the longest stretch" } else { "" };
    format!(
        "the noise changes along the log: the last third{of} is told better by the {} s before it than by all {} s \
         before it (ln L +{}); what comes after \
         the log may be told best from {} s on: see what `start` gives there; drift is then known from less. A filter \
         that finds such noise anew as it runs: replay `follow`",
        seconds(recent.part),
        seconds(recent.before),
        digits(recent.gain),
        seconds(recent.start)
    )
}

/// What is in the log that no model of noise has.
pub(super) fn upset_words(part: &Stretch, dt: f64, robust: bool) -> Vec<String> {
    let time = |index: usize| digits(index as f64 * dt);
    let of = if part.left_out > 0 { " of the longest stretch" } else { "" };
    let mut words = Vec::new();
    let outliers = upsets::outliers(&part.rate);
    if let (Some(first), false) = (outliers.first(), robust) {
        words.push(format!(
            "outliers: {} of {} samples are farther from their surroundings than noise goes, the first at {} s{of}; \
             `without_outliers` leaves them out, or finds the law whose tails they are",
            outliers.len(),
            part.rate.len(),
            time(*first)
        ));
    }
    let mut clean = part.rate.clone();
    upsets::fill_outliers(&mut clean);
    let steps = upsets::steps(&clean, MOST_STEPS);
    if !steps.is_empty() {
        let each = steps.iter().map(|step| {
            let size = digits(part.unit.from_si(step.size));
            format!("{size} {} at {} s ({} sigma)", part.unit.text(), time(step.index), digits(step.sigmas))
        });
        words.push(format!(
            "the level moves at once: {}{of}; no stationary noise does that, and a model takes it for drift: identify \
             the parts between with `start`/`end`",
            each.collect::<Vec<_>>().join(", ")
        ));
    }
    words
}

/// What differs between the logs, as the document holds it.
pub(super) fn between_logs(found: &Identified) -> impl Iterator<Item = BetweenLogs> + use<'_> {
    found.between.iter().filter(|own| own.differs).map(|own| BetweenLogs {
        axis: found.params.name.clone(),
        parameter: own.parameter.clone(),
        spread_percent: own.spread_percent,
        interval_percent: own.spread_interval_percent,
        p_value: own.p_value,
    })
}
