//! Figures and the report page of a replay: a view of [`ReplayResult`].

use super::{COUNTS, FOLLOWED, FOLLOWED_CAPTION, STATES, count_rows, follow_rows, in_log_unit, state_rows};
use crate::cli::output::digits;
use crate::cli::tests_table::{self, TESTS, caption};
use crate::numerics::distribution::{chi_square_cdf, chi_square_sf};
use crate::replay::{AxisResult, ReplayResult};
use crate::report::figure::{self, Curve};
use crate::report::page::{Badge, Page, Section};
use crate::units::Unit;

/// All figures of all axes, one below the other.
pub(super) fn sheet(result: &ReplayResult, unit: Option<&Unit>) -> String {
    let figures: Vec<String> =
        result.axes.iter().flat_map(|axis| figures(result, axis, unit)).map(|(svg, _)| svg).collect();
    figure::sheet("Replay", &figures)
}

/// The report page.
pub(super) fn page(result: &ReplayResult, filter: &str, unit: Option<&Unit>) -> Page {
    let log = result.log.clone().unwrap_or_default();
    let mut provenance = vec![
        ("filter".to_string(), filter.to_string()),
        ("log".to_string(), log.clone()),
        ("log SHA-256".to_string(), result.log_sha256.clone().unwrap_or_default()),
        ("sample rate of the filter".to_string(), format!("{} Hz", digits(result.sample_rate))),
        ("alpha".to_string(), result.alpha.to_string()),
        ("version".to_string(), format!("kfdesign {}", env!("CARGO_PKG_VERSION"))),
    ];
    if let Some(gate) = result.gate {
        provenance.push(("gate".to_string(), format!("{gate} sigma")));
    }
    let mut summary = Section::new("Summary")
        .table("Samples and log-likelihood (SI units)", &COUNTS, count_rows(result))
        .table("Estimates at the end of the log, with the filter's own sigma", &STATES, state_rows(result, unit));
    let followed = follow_rows(result);
    if !followed.is_empty() {
        summary = summary.table(FOLLOWED_CAPTION, &FOLLOWED, followed);
    }
    let mut tests = Section::new("Tests of the innovations");
    tests = if result.tests.is_empty() {
        tests.warning("Too few samples for any test.")
    } else {
        tests
            .paragraph(
                "A test fails when it is significant and its effect is beyond what is tolerated; 'small' marks a deviation that is \
                 real but within the tolerance. An optimistic filter expects smaller innovations than there are, a pessimistic one larger.",
            )
            .table(caption("the innovations", &result.tests, result.alpha), &TESTS, tests_table::rows(&result.tests, result.alpha))
            .list(tests_table::said(&result.tests, result.alpha))
    };
    let mut sections = vec![summary, tests];
    for axis in &result.axes {
        sections.push(Section::new(axis.name.clone()).figures(figures(result, axis, unit)));
    }
    Page {
        title: format!("Replay of {log}"),
        subtitle: "A recorded log through the filter: are its innovations what the filter says?".to_string(),
        badge: Some(Badge::new(result.verdict, result.meaning.clone())),
        provenance,
        sections,
    }
}

/// Figures of one axis with their captions.
fn figures(result: &ReplayResult, axis: &AxisResult, unit: Option<&Unit>) -> Vec<(String, String)> {
    let sight = &axis.sight;
    if sight.trace.is_empty() {
        return Vec::new();
    }
    let si = axis.unit.as_str();
    let shown = |value: f64| in_log_unit(value, 0.0, si, result.quantity, unit).0;
    let time_s: Vec<f64> = sight.trace.iter().map(|p| p.time_s).collect();
    let averaged: Vec<f64> = sight.trace.iter().map(|p| p.innovation).collect();
    let count = sight.samples_per_point;
    let level = digits(100.0 * (1.0 - result.alpha));
    let estimate = figure::estimate(&figure::Estimate {
        title: format!("{}: estimate", axis.name),
        quantity: if axis.of_plant { axis.measurement.clone() } else { format!("bias of {}", axis.name) },
        unit: in_log_unit(0.0, 0.0, si, result.quantity, unit).2,
        time_s: time_s.clone(),
        estimate: sight.trace.iter().map(|p| shown(p.estimate)).collect(),
        sigma: sight.trace.iter().map(|p| shown(p.sigma)).collect(),
        truth: None,
        measured: (count > 1).then(|| Curve {
            label: format!("log, mean of {count} samples"),
            points: sight.trace.iter().map(|p| (p.time_s, shown(p.measured))).collect(),
        }),
    });
    let caption = match axis.of_plant {
        true => "The filter's estimate of what is measured, with the sigma of the estimate.",
        false => "The filter's estimate of what a sensor at rest shows.",
    };
    let mut figures = vec![(estimate, caption.to_string())];
    figures.push((
        figure::innovations(&figure::Innovations {
            title: format!("{}: innovations", axis.name),
            time_s: time_s.clone(),
            lower: sight.trace.iter().map(|p| p.lowest).collect(),
            upper: sight.trace.iter().map(|p| p.highest).collect(),
        }),
        "Every innovation over its predicted standard deviation: outliers and bursts show here.".to_string(),
    ));
    if count > 1 {
        figures.push((
            figure::innovations(&figure::Innovations {
                title: format!("{}: averaged innovations", axis.name),
                time_s,
                lower: averaged.clone(),
                upper: averaged,
            }),
            format!("Means of {count} innovations times the root of {count}: wrong slow drift shows here, as too wide or too narrow."),
        ));
    }
    let lags = (1..).map(f64::from).zip(sight.autocorrelation.iter().copied()).collect();
    figures.push((
        figure::autocorrelation(&figure::Autocorrelation {
            title: format!("{}: autocorrelation", axis.name),
            points: lags,
            bound: sight.autocorrelation_bound,
            bound_label: format!("{level} % for one lag of white innovations"),
        }),
        "White innovations have no correlation at any lag.".to_string(),
    ));
    if !sight.cumulative_periodogram.is_empty() {
        figures.push((
            figure::cumulative_periodogram(&figure::Periodogram {
                title: format!("{}: cumulative periodogram", axis.name),
                points: sight.cumulative_periodogram.clone(),
                half_width: sight.periodogram_bound,
                band_label: format!("{level} % band (Kolmogorov)"),
            }),
            "Power of the block-averaged innovations up to each frequency: a straight line when the drift model is right.".to_string(),
        ));
    }
    figures.push((histogram(axis), "Normalised innovations squared beside the law they should follow.".to_string()));
    figures
}

fn histogram(axis: &AxisResult) -> String {
    let bins = &axis.sight.nis_histogram;
    let total: u64 = bins.iter().sum();
    let edges: Vec<f64> = (0..=bins.len()).map(|i| 0.5 * i as f64).collect();
    let last = bins.len().saturating_sub(1);
    let law = |i: usize| match i == last {
        true => chi_square_sf(edges[i], 1.0),
        false => chi_square_cdf(edges[i + 1], 1.0) - chi_square_cdf(edges[i], 1.0),
    };
    figure::nis_histogram(&figure::Histogram {
        title: format!("{}: NIS", axis.name),
        observed: bins.iter().map(|n| *n as f64 / total as f64).collect(),
        expected: (0..bins.len()).map(law).collect(),
        edges,
        law: "χ²(1)".to_string(),
    })
}
