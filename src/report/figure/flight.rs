//! A flight: what runs over time with its limits, and the way over the ground.

use super::chart::{Axis, Chart};
use super::scale::Scale;
use super::style::Class;
use super::trace::Clock;

/// Stretches that a figure shows at most: more than it has pixels.
const STRETCHES: usize = 1200;

/// Lines of any length in bounded memory: of every stretch the least and the greatest value with their times, so
/// that no spike is lost.
#[derive(Clone, Debug, Default)]
pub struct Envelope {
    /// Rows in a stretch.
    every: usize,
    /// Rows in the last stretch.
    filled: usize,
    /// Per stretch, per line.
    stretches: Vec<Vec<[(f64, f64); 2]>>,
}

impl Envelope {
    /// The next row: one value per line; what is not finite leaves a gap.
    pub fn add(&mut self, time_s: f64, values: &[f64]) {
        if self.stretches.is_empty() || self.filled == self.every {
            if self.stretches.len() == STRETCHES {
                let pairs = self.stretches.chunks(2).map(|pair| match pair {
                    [a, b] => a.iter().zip(b).map(|(a, b)| wider(*a, *b)).collect(),
                    rest => rest.concat(),
                });
                self.stretches = pairs.collect();
                self.every *= 2;
            }
            self.every = self.every.max(1);
            self.stretches.push(vec![[(f64::NAN, f64::NAN); 2]; values.len()]);
            self.filled = 0;
        }
        if let Some(last) = self.stretches.last_mut() {
            for (ends, value) in last.iter_mut().zip(values) {
                *ends = wider(*ends, [(time_s, *value); 2]);
            }
        }
        self.filled += 1;
    }

    /// The points of a line, in the order of time.
    pub fn line(&self, number: usize) -> Vec<(f64, f64)> {
        let mut points = Vec::with_capacity(2 * self.stretches.len());
        for [low, high] in self.stretches.iter().filter_map(|s| s.get(number)) {
            let (first, second) = if low.0 <= high.0 { (low, high) } else { (high, low) };
            points.push(*first);
            if first.0 < second.0 {
                points.push(*second);
            }
        }
        points
    }
}

/// Least and greatest of two stretches; a value that is not finite gives way.
fn wider(a: [(f64, f64); 2], b: [(f64, f64); 2]) -> [(f64, f64); 2] {
    if !b[0].1.is_finite() {
        return a;
    }
    if !a[0].1.is_finite() {
        return b;
    }
    [if b[0].1 < a[0].1 { b[0] } else { a[0] }, if b[1].1 > a[1].1 { b[1] } else { a[1] }]
}

/// Lines over time in one unit.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TimeLines {
    pub title: String,
    pub quantity: String,
    pub unit: String,
    /// Each with its points (s, value).
    pub lines: Vec<super::Curve>,
    /// Values that should not be passed.
    pub limits: Vec<f64>,
}

/// Figure of [`TimeLines`].
pub fn time_lines(data: &TimeLines) -> String {
    let points = || data.lines.iter().flat_map(|line| line.points.iter().copied());
    let clock = Clock::covering(&points().map(|p| p.0).collect::<Vec<_>>());
    let names = data.lines.iter().map(|line| line.label.as_str()).collect::<Vec<_>>().join(", ");
    let limits = if data.limits.is_empty() { "" } else { ", with its limits" };
    let mut chart = Chart::new(
        &data.title,
        &format!("{} over time: {names}{limits}.", data.quantity),
        clock.axis(),
        Axis {
            name: data.quantity.clone(),
            unit: data.unit.clone(),
            scale: Scale::linear_padded(points().map(|p| p.1).chain(data.limits.iter().copied()), &[]),
        },
    );
    for limit in &data.limits {
        chart.level(Class::Bound, *limit);
    }
    for (k, line) in data.lines.iter().enumerate() {
        chart.line(Class::Line(k), line.points.iter().map(|&(t, y)| (clock.show(t), y)).collect());
        chart.legend_line(Class::Line(k), &line.label);
    }
    if !data.limits.is_empty() {
        chart.legend_line(Class::Bound, "limits");
    }
    chart.render()
}

/// The way over the ground.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Track {
    pub title: String,
    /// (east, north) in m, in the order of time.
    pub points: Vec<(f64, f64)>,
    /// Where it was at equal times.
    pub marks: Vec<(f64, f64)>,
    /// What the marks are: "every 10 s".
    pub label: String,
}

/// Width and height of the frame, px: a metre east is as long as a metre north to the widths of the labels.
const FRAME: (f64, f64) = (370.0, 230.0);

/// Figure of [`Track`], north up.
pub fn track(data: &Track) -> String {
    let ends = |of: fn(&(f64, f64)) -> f64| {
        let values = data.points.iter().map(of).filter(|x| x.is_finite());
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)))
    };
    let ((west, east), (south, north)) = (ends(|p| p.0), ends(|p| p.1));
    // metres per pixel that both directions can have; a flight that goes nowhere gets a metre
    let per_px = ((east - west) / FRAME.0).max((north - south) / FRAME.1).max(1.0 / FRAME.1) * 1.08;
    let scale = |low: f64, high: f64, px: f64, ticks: f64| {
        let middle = 0.5 * (low + high);
        Scale::linear_between(middle - 0.5 * px * per_px, middle + 0.5 * px * per_px, ticks)
    };
    let mut chart = Chart::new(
        &data.title,
        &format!("Way over the ground, north up, marked {}.", data.label),
        Axis { name: "east".into(), unit: "m".into(), scale: scale(west, east, FRAME.0, 6.0) },
        Axis { name: "north".into(), unit: "m".into(), scale: scale(south, north, FRAME.1, 5.0) },
    );
    chart.plot_height(FRAME.1 as i32);
    chart.line(Class::Line(0), data.points.clone());
    chart.dots(1, data.marks.clone());
    chart.legend_line(Class::Line(0), "way");
    chart.legend_dots(1, &data.label);
    chart.render()
}
