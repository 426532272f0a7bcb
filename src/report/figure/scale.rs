//! Axes: linear and logarithmic scales, tick positions and tick labels.
//!
//! plotters asks a scale for its key points; its own logarithmic ticks are uneven over many decades, so ours live here.

use std::ops::Range;

use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged, ValueFormatter};

/// One axis of a chart.
#[derive(Clone, Debug)]
pub(super) struct Scale {
    low: f64,
    high: f64,
    logarithmic: bool,
    major: Vec<f64>,
    minor: Vec<f64>,
    labels: Labels,
}

#[derive(Clone, Debug)]
enum Labels {
    /// Places 0, 1, 2 … have names.
    Names(Vec<String>),
    /// Fixed decimals after division by 10^factor.
    Fixed { decimals: usize, factor: i32 },
    /// 0.01, 1, 500.
    Plain,
    /// 10⁻³, 2·10⁻³.
    Power,
}

impl Scale {
    /// Covers `values` with round ends; `at_least` is always inside. Values that are not finite are left out.
    pub(super) fn linear(values: impl IntoIterator<Item = f64>, at_least: &[f64]) -> Scale {
        let (low, high) = extent(values.into_iter().chain(at_least.iter().copied()), |v| v.is_finite());
        let (low, high) = match (low, high) {
            (low, high) if low > high => (0.0, 1.0),
            (low, high) if high - low <= 1e-12 * low.abs().max(high.abs()) => {
                let half = if high == 0.0 { 1.0 } else { 0.5 * high.abs() };
                (low - half, high + half)
            }
            pair => pair,
        };
        Scale::linear_between(low, high, 5.0)
    }

    /// Exactly from `low` to `high`, with about `ticks` ticks inside.
    pub(super) fn linear_between(low: f64, high: f64, ticks: f64) -> Scale {
        let step = round_step((high - low) / ticks);
        let tolerance = 1e-9 * step;
        let first = ((low - tolerance) / step).ceil() as i64;
        let last = ((high + tolerance) / step).floor() as i64;
        let major: Vec<f64> = (first..=last).map(|i| i as f64 * step).collect();
        let largest = low.abs().max(high.abs());
        let power = largest.log10().floor() as i32;
        let factor = if (-2..5).contains(&power) { 0 } else { power };
        let decimals = (f64::from(factor) - (step * (1.0 + 1e-9)).log10().floor()).max(0.0) as usize;
        Scale { low, high, logarithmic: false, major, minor: vec![], labels: Labels::Fixed { decimals, factor } }
    }

    /// As [`Scale::linear_between`], up to the next tick if that is very near.
    pub(super) fn linear_to_tick(low: f64, high: f64, ticks: f64) -> Scale {
        let step = round_step((high - low) / ticks);
        let next = (high / step).ceil() * step;
        Scale::linear_between(low, if next - high < 0.02 * (high - low) { next } else { high }, ticks)
    }

    /// As [`Scale::linear`], widened by 4 % of the span at both ends so that no mark touches the frame.
    pub(super) fn linear_padded(values: impl IntoIterator<Item = f64>, at_least: &[f64]) -> Scale {
        let tight = Scale::linear(values, at_least);
        let margin = 0.04 * (tight.high - tight.low);
        Scale::linear_between(tight.low - margin, tight.high + margin, 5.0)
    }

    /// Covers the positive `values` with a margin; everything else is left out.
    pub(super) fn log(values: impl IntoIterator<Item = f64>) -> Scale {
        let (low, high) = extent(values, |v| v.is_finite() && v > 0.0);
        let (low, high) = if low > high { (0.1, 10.0) } else { (low.log10(), high.log10()) };
        let margin = (0.03 * (high - low)).max(if high - low < 0.3 { 0.3 } else { 0.05 });
        // doubles end at 1e308
        let low = (low - margin).clamp(-306.0, 305.0);
        let high = (high + margin).clamp(low + 0.6, 306.0);
        let decades: Vec<i32> = (low.ceil() as i32..=high.floor() as i32).collect();
        let every = decades.len().div_ceil(8).max(1) as i32;
        let inside = |v: &f64| (low..=high).contains(&v.log10());
        let multiples = |digits: &'static [i32]| {
            (low.floor() as i32..=high.floor() as i32)
                .flat_map(move |d| digits.iter().map(move |&k| f64::from(k) * 10f64.powi(d)))
        };
        let major: Vec<f64> = if decades.len() >= 3 {
            decades.iter().filter(|d| *d % every == 0).map(|&d| 10f64.powi(d)).collect()
        } else if high - low > 0.9 {
            multiples(&[1, 2, 5]).filter(inside).collect()
        } else {
            multiples(&[1, 2, 3, 4, 5, 6, 7, 8]).filter(inside).collect()
        };
        let minor = if every > 1 {
            decades.iter().filter(|d| *d % every != 0).map(|&d| 10f64.powi(d)).collect()
        } else {
            multiples(&[2, 3, 4, 5, 6, 7, 8, 9]).filter(inside).collect()
        };
        let labels = if low > -3.5 && high < 4.8 { Labels::Plain } else { Labels::Power };
        Scale { low: 10f64.powf(low), high: 10f64.powf(high), logarithmic: true, major, minor, labels }
    }

    /// One place per name, at 0, 1, 2 …
    pub(super) fn named(names: Vec<String>) -> Scale {
        let count = names.len().max(1) as f64;
        let major = (0..names.len()).map(|i| i as f64).collect();
        Scale { low: -0.5, high: count - 0.5, logarithmic: false, major, minor: vec![], labels: Labels::Names(names) }
    }

    /// Position in 0..=1 along the axis; outside it below 0 or above 1, not a number for what a log scale cannot show.
    pub(super) fn to_unit(&self, value: f64) -> f64 {
        if self.logarithmic {
            (value.log10() - self.low.log10()) / (self.high.log10() - self.low.log10())
        } else {
            (value - self.low) / (self.high - self.low)
        }
    }

    pub(super) fn value_at(&self, t: f64) -> f64 {
        if self.logarithmic {
            10f64.powf(self.low.log10() + t * (self.high.log10() - self.low.log10()))
        } else {
            self.low + t * (self.high - self.low)
        }
    }

    pub(super) fn ends(&self) -> (f64, f64) {
        (self.low, self.high)
    }

    pub(super) fn tick_label(&self, value: f64) -> String {
        match self.labels {
            Labels::Names(ref names) => names.get(value.round().max(0.0) as usize).cloned().unwrap_or_default(),
            Labels::Fixed { decimals, factor } => {
                let scaled = value / 10f64.powi(factor);
                let scaled = if scaled.abs() < 0.5 * 10f64.powi(-(decimals as i32)) { 0.0 } else { scaled };
                format!("{scaled:.decimals$}").replace('-', "−")
            }
            Labels::Plain => {
                let decimals = (-(value * (1.0 + 1e-9)).log10().floor()).max(0.0) as usize;
                format!("{value:.decimals$}")
            }
            Labels::Power => {
                let power = (value * (1.0 + 1e-9)).log10().floor() as i32;
                match (value / 10f64.powi(power)).round() as i64 {
                    1 => format!("10{}", superscript(power)),
                    digit => format!("{digit}·10{}", superscript(power)),
                }
            }
        }
    }

    pub(super) fn tick_labels(&self) -> impl Iterator<Item = String> + '_ {
        self.major.iter().map(|&v| self.tick_label(v))
    }

    /// "name (unit)", with the power of ten that was taken out of the tick labels: "bias (10⁻⁴ rad/s)".
    pub(super) fn caption(&self, name: &str, unit: &str) -> String {
        let factor = match self.labels {
            Labels::Fixed { factor, .. } if factor != 0 => format!("10{}", superscript(factor)),
            _ => String::new(),
        };
        match (factor.is_empty(), unit.is_empty()) {
            (true, true) => name.to_owned(),
            (true, false) => format!("{name} ({unit})"),
            (false, true) => format!("{name} ({factor})"),
            (false, false) => format!("{name} ({factor} {unit})"),
        }
    }
}

fn extent(values: impl IntoIterator<Item = f64>, keep: impl Fn(f64) -> bool) -> (f64, f64) {
    values
        .into_iter()
        .filter(|&v| keep(v))
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)))
}

/// 1, 2 or 5 times a power of ten, not smaller than `step`.
fn round_step(step: f64) -> f64 {
    let power = 10f64.powf(step.log10().floor());
    [1.0, 2.0, 5.0].into_iter().map(|digit| digit * power).find(|&s| s >= step * (1.0 - 1e-9)).unwrap_or(10.0 * power)
}

/// −3 as ⁻³.
pub(super) fn superscript(power: i32) -> String {
    power
        .to_string()
        .chars()
        .map(|c| match c {
            '-' => '⁻',
            '0' => '⁰',
            '1' => '¹',
            '2' => '²',
            '3' => '³',
            '4' => '⁴',
            '5' => '⁵',
            '6' => '⁶',
            '7' => '⁷',
            '8' => '⁸',
            _ => '⁹',
        })
        .collect()
}

impl Ranged for Scale {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        // `as` saturates and sends NaN to 0: what reaches a drawing area has been clipped before
        limit.0 + (self.to_unit(*value) * f64::from(limit.1 - limit.0)).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        if hint.weight().allow_light_points() { self.minor.clone() } else { self.major.clone() }
    }

    fn range(&self) -> Range<f64> {
        self.low..self.high
    }
}

impl ValueFormatter<f64> for Scale {
    fn format_ext(&self, value: &f64) -> String {
        self.tick_label(*value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(scale: &Scale) -> Vec<String> {
        scale.tick_labels().collect()
    }

    #[test]
    fn log_axes_have_a_label_per_decade() {
        assert_eq!(labels(&Scale::log([0.01, 3600.0])), ["0.01", "0.1", "1", "10", "100", "1000"]);
        assert_eq!(labels(&Scale::log([2e-6, 3e-3])), ["10⁻⁵", "10⁻⁴", "10⁻³"]);
        let wide = Scale::log([1e-9, 1e9]);
        assert!(wide.major.len() <= 8, "{:?}", labels(&wide));
    }

    #[test]
    fn short_log_axes_label_inside_the_decade() {
        assert_eq!(labels(&Scale::log([0.9, 6.0])), ["0.5", "1", "2", "5"].map(String::from)[1..].to_vec());
        assert!(labels(&Scale::log([2e-5, 2.2e-5])).len() >= 2);
    }

    #[test]
    fn linear_ticks_are_round_and_inside() {
        let scale = Scale::linear([-3.3, 4.1], &[]);
        assert_eq!(labels(&scale), ["−2", "0", "2", "4"]);
        assert_eq!(Scale::linear([0.0, 0.00042], &[]).caption("bias", "rad/s"), "bias (10⁻⁴ rad/s)");
        assert_eq!(labels(&Scale::linear([0.0, 0.00042], &[])), ["0", "1", "2", "3", "4"]);
    }

    #[test]
    fn scales_are_total() {
        for scale in [
            Scale::linear([], &[]),
            Scale::linear([f64::NAN, f64::INFINITY], &[]),
            Scale::linear([5.0], &[]),
            Scale::linear([0.0], &[]),
            Scale::linear([1e300, -1e300], &[]),
            Scale::linear([1e15, 1e15 + 1.0], &[]),
            Scale::log([]),
            Scale::log([-1.0, 0.0, f64::NAN]),
            Scale::log([1e-300, 1e300]),
            Scale::log([7.0]),
            Scale::log([5e-324]),
            Scale::log([f64::MAX]),
        ] {
            let (low, high) = scale.ends();
            assert!(low < high, "{scale:?}");
            assert!(scale.major.len() < 20, "{scale:?}");
            assert!(scale.to_unit(low).abs() < 1e-9 && (scale.to_unit(high) - 1.0).abs() < 1e-9);
        }
    }
}
