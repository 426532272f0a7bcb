//! Figures and the report page of an identification.

use super::{Axis, STEPS, costs, headline, not_identified, step_rows, tables};
use crate::cli::allan;
use crate::params::Params;
use crate::report::figure;
use crate::report::page::{Page, PageError, Section};
use crate::units::digits;

/// All axes, one above the other.
pub(super) fn sheet(log: &str, axes: &[Axis]) -> String {
    let figures: Vec<String> = axes.iter().map(|axis| allan::figure(&axis.measured)).collect();
    figure::sheet(&format!("{log}: overlapping Allan deviation"), &figures)
}

/// The report page as HTML.
pub(super) fn page(params: &Params, axes: &[Axis]) -> Result<String, PageError> {
    let source = params.source.clone().unwrap_or_default();
    let log = source.log.unwrap_or_default();
    let provenance = [
        ("log", log.clone()),
        ("log SHA-256", source.sha256.unwrap_or_default()),
        ("samples", source.samples.map(|n| n.to_string()).unwrap_or_default()),
        ("span", source.span_s.map(|s| format!("{} s", digits(s))).unwrap_or_default()),
        ("sample rate", format!("{} Hz", digits(params.sample_rate_hz))),
        ("method", source.method.unwrap_or_default()),
        ("version", format!("kfdesign {}", source.version.unwrap_or_default())),
    ];
    let failed = params.failed_check();
    Page {
        title: format!("Noise parameters from {log}"),
        subtitle: failed.map_or_else(
            || "What a log of the sensor at rest says about its noise, and what it cannot say".into(),
            |failed| format!("A check failed: {failed}"),
        ),
        badge: None,
        provenance: provenance.into_iter().map(|(label, value)| (label.to_string(), value)).collect(),
        sections: axes.iter().map(|axis| section(axis, params)).collect(),
    }
    .to_html()
}

fn section(axis: &Axis, params: &Params) -> Section {
    let found = &axis.found;
    let parameters = tables::parameters(axis, params.quantity);
    let mut section = Section::new(found.params.name.clone()).paragraph(format!("{}.", headline(axis))).table(
        parameters.caption,
        parameters.header,
        parameters.rows,
    );
    for warning in &found.warnings {
        section = section.warning(warning.clone());
    }
    section = section.figures(vec![(
        allan::figure(&axis.measured),
        "The measured curve with exact 95 % intervals for the model, and the model's terms.".to_string(),
    )]);
    if !found.not_identified.is_empty() {
        section = section
            .paragraph("What this log does not tell:")
            .list(found.not_identified.iter().map(not_identified).collect());
    }
    if let Some(warmth) = &axis.warmth {
        section = warmth.sentences().into_iter().fold(section, Section::paragraph);
        if let Some(pairs) = warmth.table() {
            section = section.table(pairs.caption, pairs.header, pairs.rows);
        }
    }
    if let Some(candidates) = tables::candidates(&found.candidates) {
        section = section.table(candidates.caption, candidates.header, candidates.rows);
    }
    if !found.steps.is_empty() {
        section = section.table("The recipe, step by step", &STEPS, step_rows(&found.steps)).list(costs(&found.steps));
    }
    section
}
