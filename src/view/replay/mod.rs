//! A log through a filter.

mod attitude;

use serde_json::{Value, json};

use super::answer::{self, three};
use super::{provenance, verdict};
use crate::identify::Followed;
use crate::numerics::distribution::{chi_square_cdf, chi_square_sf};
use crate::replay::{AxisResult, Point, ReplayResult};
use crate::report::figure::{self, Curve};
use crate::report::{Report, Section};
use crate::units::{Quantity, Unit, digits, shown_unit};
pub use attitude::attitude;

/// `filter`: name of its file; `unit`: of the log.
pub fn replay<'a>(result: &'a ReplayResult, filter: &str, unit: Option<&'a Unit>) -> Report<'a> {
    let log = result.log.clone().unwrap_or_default();
    let gate = result.gate.map(|gate| ("gate", format!("{gate} sigma")));
    let lines = [
        ("filter", filter.to_string()),
        ("log", log.clone()),
        ("log SHA-256", result.log_sha256.clone().unwrap_or_default()),
        ("sample rate of the filter", format!("{} Hz", digits(result.sample_rate))),
        ("alpha", result.alpha.to_string()),
    ];
    let tests = if result.tests.is_empty() {
        Section::of_page("Tests").findings("warning", vec!["Too few samples for any test.".into()])
    } else {
        let more = " An optimistic filter expects smaller innovations than there are, a pessimistic one larger.";
        verdict::tests("the innovations", more, &result.tests, result.alpha)
    };
    let mut sections = vec![summary(result, unit), tests];
    sections.extend(result.axes.iter().map(|axis| figures(result, axis, unit)));
    Report {
        title: format!("Replay of {log}"),
        subtitle: "A recorded log through the filter: are its innovations what the filter says?".into(),
        verdict: Some(answer::conclusion(result.verdict, &result.meaning, &result.tests)),
        answer: answer(result, unit),
        provenance: provenance(lines.into_iter().chain(gate)),
        sections,
        ..Report::default()
    }
}

/// Each axis with the size of its innovations, the slow ones that fit least, and what the filter says now.
fn answer<'a>(result: &ReplayResult, unit: Option<&Unit>) -> Section<'a> {
    let row = |axis: &AxisResult| {
        let slow = axis.low_frequency.iter().min_by(|a, b| a.p_value.total_cmp(&b.p_value));
        let now = &axis.final_output;
        let (scale, shown) = in_log_unit(&now.unit, result.quantity, unit);
        let [value, sigma] = [now.value, now.sigma].map(|v| three(v / scale));
        let name = if axis.of_plant { format!("{} ", now.name) } else { String::new() };
        [
            axis.name.clone(),
            axis.accepted.to_string(),
            axis.nis.as_ref().map_or("-".into(), |nis| three(nis.mean)),
            slow.map_or("-".into(), |slow| format!("{} of predicted", three(slow.ratio))),
            format!("{name}{value} ± {sigma} {shown}"),
            answer::result(result.tests.iter().filter(|test| test.axis == axis.name)),
        ]
    };
    // what a plant gives first is no drift: an angle, a velocity
    let end = if result.axes.iter().any(|axis| axis.of_plant) { "at the end" } else { "drift at the end" };
    let header = ["", "samples", "NIS", "slow power", end, "result"];
    Section::new("").table("", &header, result.axes.iter().map(row))
}

fn summary<'a>(result: &ReplayResult, unit: Option<&Unit>) -> Section<'a> {
    let counts = result.axes.iter().map(|a| {
        let counts = [a.samples, a.accepted, a.gaps, a.missing, a.unusable, a.rejected].map(|n| n.to_string());
        let names = [a.name.clone(), a.log_axis.clone()];
        names.into_iter().chain(counts).chain([format!("{:.3}", a.log_likelihood)])
    });
    let parameters = |axis: &'_ AxisResult| -> Vec<[String; 5]> {
        let row =
            |p: &Followed| [axis.name.clone(), p.parameter.clone(), digits(p.design), digits(p.now), p.unit.clone()];
        axis.follow.iter().flat_map(|follow| &follow.parameters).map(row).collect()
    };
    Section::of_page("Summary")
        .table(
            "Samples and log-likelihood (SI units)",
            &["axis", "log column", "samples", "accepted", "gaps", "missing", "unusable", "rejected", "log-likelihood"],
            counts,
        )
        .table(
            "Estimates at the end of the log, with the filter's own sigma",
            &["axis", "of", "estimate", "sigma", "unit"],
            state_rows(result, unit),
        )
        .table(
            "Noise that was followed, SI",
            &["axis", "parameter", "design", "end of the log", "unit"],
            result.axes.iter().flat_map(parameters),
        )
}

/// The whole estimate of each axis, and its states where they are few; all are in the JSON document. Measurements of
/// one axis share them.
fn state_rows(result: &ReplayResult, unit: Option<&Unit>) -> Vec<[String; 5]> {
    let mut rows: Vec<[String; 5]> = Vec::new();
    for axis in &result.axes {
        let few = if axis.final_state.len() <= 3 || axis.of_plant { axis.final_state.as_slice() } else { &[] };
        let whole = Some(&axis.final_output).filter(|_| !axis.of_plant);
        for state in whole.into_iter().chain(few) {
            let (scale, shown) = in_log_unit(&state.unit, result.quantity, unit);
            let [value, sigma] = [state.value, state.sigma].map(|v| digits(v / scale));
            let row = [axis.axis.clone(), state.name.clone(), value, sigma, shown];
            if !rows.contains(&row) {
                rows.push(row);
            }
        }
    }
    rows
}

/// States of the measured quantity are shown in the log's unit, angles in the one that goes with it, others in SI:
/// scale and text.
fn in_log_unit(si: &str, quantity: Quantity, log: Option<&Unit>) -> (f64, String) {
    match log.filter(|unit| unit.dimension() == quantity.dimension()) {
        Some(unit) => shown_unit(si, quantity, unit),
        None => (1.0, si.to_string()),
    }
}

fn figures<'a>(result: &'a ReplayResult, axis: &'a AxisResult, unit: Option<&'a Unit>) -> Section<'a> {
    let curves = &axis.curves;
    let section = Section::new(axis.name.clone());
    if curves.trace.is_empty() {
        return section;
    }
    let titled = move |what: &str| format!("{}: {what}", axis.name);
    let times = move || curves.trace.iter().map(|p| p.time_s).collect::<Vec<f64>>();
    let count = curves.samples_per_point;
    let level = digits(100.0 * (1.0 - result.alpha));
    let estimate = move || {
        let (scale, unit) = in_log_unit(&axis.unit, result.quantity, unit);
        figure::estimate(&figure::Estimate {
            title: titled("estimate"),
            quantity: if axis.of_plant { axis.measurement.clone() } else { format!("bias of {}", axis.name) },
            unit,
            time_s: times(),
            estimate: curves.trace.iter().map(|p| p.estimate / scale).collect(),
            sigma: curves.trace.iter().map(|p| p.sigma / scale).collect(),
            truth: None,
            measured: (count > 1).then(|| Curve {
                label: format!("log, mean of {count} samples"),
                points: curves.trace.iter().map(|p| (p.time_s, p.measured / scale)).collect(),
            }),
        })
    };
    let innovations = move |what: &str, averaged: bool| {
        let point = |p: &Point| if averaged { [p.innovation; 2] } else { [p.lowest, p.highest] };
        let (lower, upper) = curves.trace.iter().map(point).map(|[lower, upper]| (lower, upper)).unzip();
        figure::innovations(&figure::Innovations { title: titled(what), time_s: times(), lower, upper })
    };
    let mut section = section
        .figure(
            match axis.of_plant {
                true => "The filter's estimate of what is measured, with the sigma of the estimate.",
                false => "The filter's estimate of what a sensor at rest shows.",
            },
            estimate,
        )
        .figure("Every innovation over its predicted standard deviation: outliers and bursts show here.", move || {
            innovations("innovations", false)
        });
    if count > 1 {
        let caption = format!(
            "Means of {count} innovations times the root of {count}: wrong slow drift shows here, as too wide or too \
             narrow."
        );
        section = section.figure(caption, move || innovations("averaged innovations", true));
    }
    let one_lag = format!("{level} % for one lag of white innovations");
    section = section.figure("White innovations have no correlation at any lag.", move || {
        figure::autocorrelation(&figure::Autocorrelation {
            title: titled("autocorrelation"),
            points: (1..).map(f64::from).zip(curves.autocorrelation.iter().copied()).collect(),
            bound: curves.autocorrelation_bound,
            bound_label: one_lag.clone(),
        })
    });
    if !curves.cumulative_periodogram.is_empty() {
        let caption = "Power of the block-averaged innovations up to each frequency, less that of white noise: within \
                       the band when the drift model is right.";
        section = section.figure(caption, move || {
            figure::cumulative_periodogram(&figure::Periodogram {
                title: titled("cumulative periodogram"),
                points: curves.cumulative_periodogram.clone(),
                half_width: curves.periodogram_bound,
                band_label: format!("{level} % band (Kolmogorov)"),
            })
        });
    }
    section.figure("Normalised innovations squared beside the law they should follow.", move || histogram(axis))
}

/// What the figures show, as numbers in SI: a page with a cursor draws them itself.
pub fn curves(result: &ReplayResult) -> Value {
    let axis = |axis: &AxisResult| {
        let curves = &axis.curves;
        let column = |of: fn(&Point) -> f64| curves.trace.iter().map(of).collect::<Vec<f64>>();
        let (edges, observed, expected) = shares(axis);
        json!({
            "name": axis.name, "axis": axis.axis, "unit": axis.unit, "samples_per_point": curves.samples_per_point,
            "trace": {
                "time_s": column(|p| p.time_s), "measured": column(|p| p.measured), "estimate": column(|p| p.estimate),
                "sigma": column(|p| p.sigma), "innovation": column(|p| p.innovation),
                "lowest": column(|p| p.lowest), "highest": column(|p| p.highest),
            },
            "autocorrelation": curves.autocorrelation, "autocorrelation_bound": curves.autocorrelation_bound,
            "cumulative_periodogram": curves.cumulative_periodogram, "periodogram_bound": curves.periodogram_bound,
            "nis_histogram": { "edges": edges, "observed": observed, "expected": expected },
        })
    };
    json!({ "axes": result.axes.iter().map(axis).collect::<Vec<_>>() })
}

/// Edges of the bins of NIS, what share of the samples is in each, and what share should be.
fn shares(axis: &AxisResult) -> (Vec<f64>, Vec<f64>, Vec<f64>) {
    let bins = &axis.curves.nis_histogram;
    let total: u64 = bins.iter().sum();
    let edges: Vec<f64> = (0..=bins.len()).map(|i| 0.5 * i as f64).collect();
    let last = bins.len().saturating_sub(1);
    let law = |i: usize| match i == last {
        true => chi_square_sf(edges[i], 1.0),
        false => chi_square_cdf(edges[i + 1], 1.0) - chi_square_cdf(edges[i], 1.0),
    };
    let observed = bins.iter().map(|n| *n as f64 / total as f64).collect();
    let expected = (0..bins.len()).map(law).collect();
    (edges, observed, expected)
}

fn histogram(axis: &AxisResult) -> String {
    let (edges, observed, expected) = shares(axis);
    figure::nis_histogram(&figure::Histogram {
        title: format!("{}: NIS", axis.name),
        observed,
        expected,
        edges,
        law: "χ²(1)".into(),
    })
}
