//! Allan deviation of one axis: measured curve with its interval, fitted total and components.

use super::Curve;
use super::chart::{Axis, Chart};
use super::scale::Scale;
use super::style::Class;

/// One averaging time, in the display unit.
#[derive(Clone, Debug, PartialEq)]
pub struct AllanPoint {
    pub tau_s: f64,
    pub deviation: f64,
    pub lower: f64,
    pub upper: f64,
    /// The noise type identified here; empty where none is.
    pub noise: String,
}

/// What the figure shows; all values in `unit`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Allan {
    /// "gyro_x: overlapping Allan deviation".
    pub title: String,
    /// "Allan deviation".
    pub quantity: String,
    pub unit: String,
    pub points: Vec<AllanPoint>,
    /// What the band is; by default the 95 % interval.
    pub band_label: Option<String>,
    /// The fitted sum of the components.
    pub total: Option<Curve>,
    pub components: Vec<Curve>,
    /// Where parameters are read.
    pub marks: Vec<AllanMark>,
}

/// A parameter at the point of the curve that shows it.
#[derive(Clone, Debug, PartialEq)]
pub struct AllanMark {
    pub tau_s: f64,
    pub deviation: f64,
    /// "N".
    pub word: String,
    /// The component it belongs to, or none: the total.
    pub component: Option<usize>,
}

/// Log-log figure of one axis.
pub fn allan(data: &Allan) -> String {
    let mut chart = Chart::new(
        &data.title,
        &describe(data),
        Axis {
            name: "averaging time τ".into(),
            unit: "s".into(),
            scale: Scale::log(data.points.iter().map(|p| p.tau_s)),
        },
        Axis { name: data.quantity.clone(), unit: data.unit.clone(), scale: y_scale(data) },
    );
    chart.plot_height(250);
    chart.band(0, data.points.iter().map(|p| (p.tau_s, p.lower, p.upper)).collect());
    for (k, curve) in data.components.iter().enumerate() {
        chart.line(Class::Line(k + 2), curve.points.clone());
    }
    let measured: Vec<(f64, f64)> = data.points.iter().map(|p| (p.tau_s, p.deviation)).collect();
    let dotted = measured.len() <= 80;
    if let Some(total) = &data.total {
        chart.line(Class::Line(1), total.points.clone());
    }
    if dotted {
        chart.dots(0, measured);
        chart.legend_dots(0, "measured");
    } else {
        chart.line(Class::Line(0), measured);
        chart.legend_line(Class::Line(0), "measured");
    }
    chart.legend_band(0, data.band_label.as_deref().unwrap_or("95 % interval"));
    if let Some(total) = &data.total {
        chart.legend_line(Class::Line(1), &total.label);
    }
    for (k, curve) in data.components.iter().enumerate() {
        chart.legend_line(Class::Line(k + 2), &curve.label);
    }
    for mark in &data.marks {
        let series = mark.component.map_or(1, |k| k + 2);
        chart.tag(Some(series), (mark.tau_s, mark.deviation), &mark.word);
    }
    for (low, high, noise) in stretches(&data.points) {
        chart.stretch(low, high, noise);
    }
    chart.render()
}

/// Curves of several axes or logs in one panel: what differs between them. All values in `unit`.
pub fn allan_overlay(title: &str, unit: &str, curves: &[(String, Vec<AllanPoint>)]) -> String {
    let points = || curves.iter().flat_map(|(_, points)| points);
    let all = Allan { points: points().cloned().collect(), ..Allan::default() };
    let mut chart = Chart::new(
        title,
        &format!("Deviations of {} curves against averaging time on logarithmic axes.", curves.len()),
        Axis { name: "averaging time τ".into(), unit: "s".into(), scale: Scale::log(points().map(|p| p.tau_s)) },
        Axis { name: "deviation".into(), unit: unit.into(), scale: y_scale(&all) },
    );
    chart.plot_height(290);
    for (k, (_, points)) in curves.iter().enumerate() {
        chart.band(k, points.iter().map(|p| (p.tau_s, p.lower, p.upper)).collect());
    }
    for (k, (label, points)) in curves.iter().enumerate() {
        chart.line(Class::Line(k), points.iter().map(|p| (p.tau_s, p.deviation)).collect());
        chart.legend_line(Class::Line(k), label);
    }
    chart.legend_band(5, "95 % interval");
    chart.render()
}

/// Led by the measured deviations; wide intervals and small components may run out of the frame.
fn y_scale(data: &Allan) -> Scale {
    let positive = |v: &f64| v.is_finite() && *v > 0.0;
    let deviations = || data.points.iter().map(|p| p.deviation).filter(positive);
    let (low, high) = deviations().fold((f64::INFINITY, 0.0_f64), |(l, h), v| (l.min(v), h.max(v)));
    let edges = data.points.iter().flat_map(|p| [p.lower, p.upper]).filter(positive);
    let near = edges.map(|v| v.clamp(low / 3.0, (high * 3.0).max(low / 3.0)));
    // room for the words along the top
    let room = if data.points.iter().any(|p| !p.noise.is_empty()) { [high * (high / low).powf(0.12)] } else { [high] };
    // and a little below the lowest, where components cross
    Scale::log(deviations().chain(near).chain(room).chain([low / 2.0]))
}

/// Runs of equal noise type, each from half way to its neighbours.
fn stretches(points: &[AllanPoint]) -> Vec<(f64, f64, &str)> {
    let mut out = vec![];
    let mut start = 0;
    for group in points.chunk_by(|a, b| a.noise == b.noise) {
        let end = start + group.len();
        let (Some(first), Some(last)) = (group.first(), group.last()) else { continue };
        let half_way = |inner: &AllanPoint, outer: Option<&AllanPoint>| {
            outer.map_or(inner.tau_s, |outer| (inner.tau_s * outer.tau_s).sqrt())
        };
        let before = start.checked_sub(1).and_then(|i| points.get(i));
        if !first.noise.is_empty() {
            out.push((half_way(first, before), half_way(last, points.get(end)), first.noise.as_str()));
        }
        start = end;
    }
    out
}

fn describe(data: &Allan) -> String {
    let (Some(first), Some(last)) = (data.points.first(), data.points.last()) else {
        return format!("{}: no points", data.quantity);
    };
    let lowest = data.points.iter().min_by(|a, b| a.deviation.total_cmp(&b.deviation)).unwrap_or(first);
    format!(
        "{} against averaging time on logarithmic axes: {:.3e} {unit} at {:.3e} s, lowest {:.3e} {unit} at {:.3e} s, \
         {:.3e} {unit} at {:.3e} s.",
        data.quantity,
        first.deviation,
        first.tau_s,
        lowest.deviation,
        lowest.tau_s,
        last.deviation,
        last.tau_s,
        unit = data.unit
    )
}
