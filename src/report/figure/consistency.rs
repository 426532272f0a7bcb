//! What tells whether a filter's covariance is true: autocorrelation, NIS histogram, cumulative periodogram, NEES.

use super::Curve;
use super::chart::{Axis, Chart};
use super::scale::Scale;
use super::style::Class;
use super::trace::Clock;
use crate::units::digits;

/// Autocorrelation of the normalised innovations at lags 1, 2, …
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Autocorrelation {
    pub title: String,
    /// Lag in samples and value.
    pub points: Vec<(f64, f64)>,
    /// The limit for one lag of white innovations, for instance 1.96/√n.
    pub bound: f64,
    /// "95 % for white innovations".
    pub bound_label: String,
}

/// Stems with the bound.
pub fn autocorrelation(data: &Autocorrelation) -> String {
    let largest = data.points.iter().map(|p| p.1.abs()).filter(|v| v.is_finite()).fold(data.bound.abs(), f64::max);
    let limit = if largest.is_finite() && largest > 0.0 { 1.25 * largest } else { 1.0 };
    let last = data.points.iter().map(|p| p.0).fold(1.0, f64::max);
    let mut chart = Chart::new(
        &data.title,
        &format!(
            "Autocorrelation of the normalised innovations; largest magnitude {largest:.4}, bound {:.4}.",
            data.bound
        ),
        Axis { name: "lag".into(), unit: "samples".into(), scale: Scale::linear_between(0.0, last + 1.0, 6.0) },
        Axis { name: "autocorrelation".into(), unit: String::new(), scale: Scale::linear_between(-limit, limit, 6.0) },
    );
    chart.plot_height(170);
    chart.level(Class::Axis, 0.0);
    chart.level(Class::Bound, data.bound);
    chart.level(Class::Bound, -data.bound);
    chart.stems(0, data.points.clone());
    chart.legend_dots(0, "innovations");
    chart.legend_line(Class::Bound, &data.bound_label);
    chart.render()
}

/// Histogram of the normalised innovation squared beside its law.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Histogram {
    pub title: String,
    /// n + 1 edges.
    pub edges: Vec<f64>,
    /// Fraction of the samples in each of the n bins.
    pub observed: Vec<f64>,
    /// Probability of each bin under the stated law.
    pub expected: Vec<f64>,
    /// "χ²(1)".
    pub law: String,
}

/// Bars against the expected step line, probability on a logarithmic axis so that the tail shows.
pub fn nis_histogram(data: &Histogram) -> String {
    let bins: Vec<(f64, f64)> = data.edges.iter().copied().zip(data.edges.iter().copied().skip(1)).collect();
    let values = data.observed.iter().chain(&data.expected).copied();
    let mut chart = Chart::new(
        &data.title,
        &format!("Histogram of the normalised innovation squared against the {} law.", data.law),
        Axis {
            name: "normalised innovation squared".into(),
            unit: String::new(),
            scale: Scale::linear(data.edges.iter().copied(), &[0.0]),
        },
        Axis { name: "fraction per bin".into(), unit: String::new(), scale: Scale::log(values) },
    );
    chart.bars(bins.iter().zip(&data.observed).map(|(&(left, right), &share)| (left, right, share)).collect());
    let steps = bins.iter().zip(&data.expected).flat_map(|(&(left, right), &p)| [(left, p), (right, p)]);
    chart.line(Class::Line(1), steps.collect());
    chart.legend_bar("observed");
    chart.legend_line(Class::Line(1), &data.law);
    chart.render()
}

/// Cumulative periodogram of the innovations (Bartlett 1955), fractions 0..=1.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Periodogram {
    pub title: String,
    /// (frequency in Hz, cumulative fraction of the power).
    pub points: Vec<(f64, f64)>,
    /// Half width of the Kolmogorov band, for instance 1.358/√m.
    pub half_width: f64,
    /// "95 % band (Kolmogorov)".
    pub band_label: String,
}

/// How far the cumulative periodogram is above the straight line of white noise, with the band.
pub fn cumulative_periodogram(data: &Periodogram) -> String {
    let highest = data.points.iter().map(|p| p.0).filter(|f| f.is_finite()).fold(0.0, f64::max);
    let end = if highest > 0.0 { highest } else { 1.0 };
    let excess: Vec<(f64, f64)> = data.points.iter().map(|&(f, share)| (f, share - f / end)).collect();
    let w = data.half_width;
    let reach = excess.iter().map(|p| p.1.abs()).filter(|v| v.is_finite()).fold(w.abs(), f64::max);
    let reach = if reach > 0.0 && reach.is_finite() { 1.15 * reach } else { 1.0 };
    let mut chart = Chart::new(
        &data.title,
        &format!(
            "Cumulative periodogram up to {highest:.3e} Hz, less that of white noise, with a band of half width {w:.4}."
        ),
        Axis { name: "frequency".into(), unit: "Hz".into(), scale: Scale::linear_between(0.0, end, 6.0) },
        Axis {
            name: "power up to a frequency, less that of white noise".into(),
            unit: "fraction".into(),
            scale: Scale::linear_between(-reach, reach, 5.0),
        },
    );
    chart.band(5, vec![(0.0, -w, w), (end, -w, w)]);
    chart.level(Class::Expected, 0.0);
    chart.line(Class::Line(0), excess);
    chart.legend_line(Class::Line(0), "innovations");
    chart.legend_line(Class::Expected, "white");
    chart.legend_band(5, &data.band_label);
    chart.render()
}

/// NEES averaged over runs, against time; all lists have one entry per time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Nees {
    pub title: String,
    pub time_s: Vec<f64>,
    pub nees: Vec<f64>,
    pub lower: Vec<f64>,
    pub upper: Vec<f64>,
    /// The number of states, or 1 when NEES is divided by it.
    pub expected: f64,
    /// What the curve should be when the truth is another than the filter's own.
    pub under_truth: Option<Curve>,
    /// "95 % at one time".
    pub band_label: String,
}

/// Ratio of the largest to the smallest value from which NEES, and errors over claims, have a logarithmic axis.
pub(super) const WIDE: f64 = 15.0;

/// Average NEES with its band; a few times stand beside each other as dots, many are a line over time.
pub fn nees(data: &Nees) -> String {
    let few = data.nees.len() <= 12;
    let clock = Clock::covering(&data.time_s);
    let time = if few {
        let names = data.time_s.iter().map(|&t| short(t)).collect();
        Axis { name: "time".into(), unit: "s".into(), scale: Scale::named(names) }
    } else {
        clock.axis()
    };
    let place = |i: usize, t: f64| if few { i as f64 } else { clock.show(t) };
    let curve = data.under_truth.iter().flat_map(|c| c.points.iter().map(|p| p.1));
    let values: Vec<f64> =
        data.nees.iter().chain(&data.lower).chain(&data.upper).copied().chain(curve).chain([data.expected]).collect();
    let largest = values.iter().copied().filter(|v| v.is_finite()).fold(0.0, f64::max);
    let smallest = values.iter().copied().filter(|v| *v > 0.0).fold(f64::INFINITY, f64::min);
    let scale =
        if largest > WIDE * smallest { Scale::log(values) } else { Scale::linear_padded(values, &[data.expected]) };
    let outside = data.nees.iter().zip(data.lower.iter().zip(&data.upper)).filter(|(v, (l, u))| *v < l || *v > u);
    let mut chart = Chart::new(
        &data.title,
        &format!(
            "Average NEES at {} times; expected {:.3}; {} outside their bounds.",
            data.nees.len(),
            data.expected,
            outside.count()
        ),
        time,
        Axis { name: "average NEES".into(), unit: String::new(), scale },
    );
    let bounds = data.time_s.iter().enumerate().zip(data.lower.iter().zip(&data.upper));
    let band: Vec<(f64, f64, f64)> = if few {
        // a step over each time
        bounds.flat_map(|((i, _), (&l, &u))| [-0.5, 0.5].map(|half| (i as f64 + half, l, u))).collect()
    } else {
        bounds.map(|((_, &t), (&l, &u))| (clock.show(t), l, u)).collect()
    };
    chart.band(5, band);
    chart.level(Class::Expected, data.expected);
    let points: Vec<(f64, f64)> =
        data.time_s.iter().enumerate().zip(&data.nees).map(|((i, &t), &v)| (place(i, t), v)).collect();
    if few {
        chart.dots(0, points);
        chart.legend_dots(0, "average over runs");
    } else {
        chart.line(Class::Line(0), points);
        chart.legend_line(Class::Line(0), "average over runs");
    }
    if let Some(curve) = &data.under_truth {
        let shown = curve.points.iter().enumerate().map(|(i, &(t, v))| (place(i, t), v));
        chart.line(Class::Line(1), shown.collect());
        chart.legend_line(Class::Line(1), &curve.label);
        chart.legend_line(Class::Expected, "right covariance");
    } else {
        chart.legend_line(Class::Expected, "expected");
    }
    chart.legend_band(5, &data.band_label);
    chart.render()
}

/// Four digits without trailing zeros: 0.6, 180.
fn short(value: f64) -> String {
    let text = digits(value);
    if text.contains('.') && !text.contains('e') {
        text.trim_end_matches('0').trim_end_matches('.').into()
    } else {
        text
    }
}
