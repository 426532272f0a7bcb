//! Results as reports (floor 7): for every command one function from its result to a [`Report`], which the back ends
//! of [`crate::report`] show. Nothing is computed, read or printed here.
//!
//! [`Report`]: crate::report::Report

pub mod airplane;
pub mod allan;
mod answer;
pub mod closed_loop;
pub mod compare;
pub mod export;
pub mod fly;
pub mod identify;
pub mod import;
pub mod inflate;
pub mod info;
pub mod montecarlo;
mod parameters;
pub mod plan;
pub mod replay;
pub mod simulate;
pub mod trim;
pub mod tune;
mod verdict;

use crate::params::{AxisParams, Params};
use crate::replay::axes::RATE_TOLERANCE;
use crate::units::digits;

/// Lines of provenance, the last of them the version.
fn provenance<'a>(lines: impl IntoIterator<Item = (&'a str, String)>) -> Vec<(String, String)> {
    let version = ("version", format!("kfdesign {}", env!("CARGO_PKG_VERSION")));
    lines.into_iter().chain([version]).map(|(label, value)| (label.to_string(), value)).collect()
}

/// Names of what is alike together, each with the first of its kind, in order.
fn alike<'n, T>(all: impl IntoIterator<Item = (&'n str, T)>, same: impl Fn(&T, &T) -> bool) -> Vec<(Vec<&'n str>, T)> {
    let mut groups: Vec<(Vec<&str>, T)> = Vec::new();
    for (name, one) in all {
        match groups.iter_mut().find(|(_, first)| same(first, &one)) {
            Some((names, _)) => names.push(name),
            None => groups.push((vec![name], one)),
        }
    }
    groups
}

/// "x, y: …" for what is said of each name, each sentence once.
fn by_name<'a>(said: impl IntoIterator<Item = (&'a str, &'a [String])>) -> Vec<String> {
    let each = said.into_iter().flat_map(|(name, sentences)| sentences.iter().map(move |sentence| (name, sentence)));
    alike(each, |a, b| a == b).iter().map(|(names, sentence)| format!("{}: {sentence}", names.join(", "))).collect()
}

/// What a rate other than that of the parameters makes of the terms that count samples, each sentence once.
pub fn notes_of_rate(params: &Params, axes: &[&AxisParams], rate_hz: f64) -> Vec<String> {
    if (rate_hz / params.sample_rate_hz - 1.0).abs() <= RATE_TOLERANCE {
        return Vec::new();
    }
    let [from, to] = [params.sample_rate_hz, rate_hz].map(digits);
    let sentence = |axis: &AxisParams| {
        let counted = axis.noise().of_samples()?;
        Some(format!(
            "{counted} belongs to the samples at {from} Hz: at {to} Hz the same coefficients are another process \
             (the corner of a filter moves with the rate)"
        ))
    };
    let said: Vec<(&str, Vec<String>)> =
        axes.iter().map(|axis| (axis.name.as_str(), sentence(axis).into_iter().collect())).collect();
    by_name(said.iter().map(|(name, sentences)| (*name, sentences.as_slice())))
}

/// The number, or a dash.
fn or_dash(value: Option<f64>) -> String {
    value.map_or_else(|| "-".into(), digits)
}
