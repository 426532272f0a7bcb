//! Figures and the report page of a comparison: a view of [`Comparison`].

use super::{BESIDE, BESIDE_CAPTION, MEANS, beside_rows, beside_words, mean_rows};
use crate::cli::output::digits;
use crate::cli::tests_table::{self, TESTS, caption};
use crate::compare::{AxisComparison, Band, Comparison};
use crate::report;
use crate::report::figure::{self, SpectrumRatio};
use crate::report::page::{Badge, Page, Section};
use crate::units::Unit;

/// All figures of all axes, one below the other.
pub(super) fn sheet(result: &Comparison, unit: &Unit) -> String {
    let figures: Vec<String> =
        result.axes.iter().flat_map(|axis| figures(axis, result.alpha, unit)).map(|(svg, _)| svg).collect();
    figure::sheet("Model and log", &figures)
}

/// Figures of one axis with their captions.
fn figures(axis: &AxisComparison, alpha: f64, unit: &Unit) -> Vec<(String, String)> {
    let level = digits(100.0 * (1.0 - alpha));
    let bands = axis.spectrum.iter().map(|b: &Band| [b.from_hz, b.to_hz, b.ratio, b.lower, b.upper]).collect();
    let ratio = figure::spectrum_ratio(&SpectrumRatio {
        title: format!("{}: spectrum of the log over that of the model", axis.name),
        bands,
        band_label: format!("{level} % for all bands together"),
    });
    vec![
        (
            report::allan::envelope(&axis.name, &axis.allan, alpha, unit),
            format!("A log of the model stays in the envelope at all averaging times with probability {level} %."),
        ),
        (ratio, "Where the steps leave the band, the model has too little (above one) or too much power.".into()),
    ]
}

/// The report page.
pub(super) fn page(result: &Comparison, unit: &Unit) -> Page {
    let text = |value: &Option<String>| value.clone().unwrap_or_default();
    let provenance = [
        ("parameters", text(&result.params)),
        ("log", text(&result.log)),
        ("log SHA-256", text(&result.log_sha256)),
        ("sample rate of the log", format!("{} Hz", digits(result.sample_rate))),
        ("alpha", result.alpha.to_string()),
        ("version", format!("kfdesign {}", env!("CARGO_PKG_VERSION"))),
    ];
    let tests = Section::new("Tests")
        .paragraph(
            "A test fails when it is significant and its effect is beyond what is tolerated; 'small' marks a deviation that is real but \
             within the tolerance.",
        )
        .table(
            caption("the model on this log", &result.tests, result.alpha),
            &TESTS,
            tests_table::rows(&result.tests, result.alpha),
        )
        .list(tests_table::said(&result.tests, result.alpha));
    let means = Section::new("Means, which prove nothing")
        .table(format!("In {unit}"), &MEANS, mean_rows(result, unit))
        .list(result.axes.iter().map(|a| format!("{}: {}.", a.name, a.means.sentence)).collect());
    let mut sections = vec![tests];
    if !result.parameters.is_empty() {
        let beside = Section::new("The file's numbers");
        sections.push(beside.table(BESIDE_CAPTION, &BESIDE, beside_rows(result)).list(beside_words(result)));
    }
    for axis in &result.axes {
        let mut section = Section::new(axis.name.clone());
        for note in &axis.notes {
            section = section.warning(note.clone());
        }
        sections.push(section.figures(figures(axis, result.alpha, unit)));
    }
    sections.push(means);
    Page {
        title: format!("{} against {}", text(&result.log), text(&result.params)),
        subtitle: "A noise model held against a log: does it fit?".to_string(),
        badge: Some(Badge::new(result.verdict, result.meaning.clone())),
        provenance: provenance.into_iter().map(|(label, value)| (label.to_string(), value)).collect(),
        sections,
    }
}
