//! What runs over time: predicted standard deviations, estimates with their band, innovations.

use super::Curve;
use super::chart::{Axis, Chart};
use super::scale::Scale;
use super::style::Class;

/// One state of the figure of predicted standard deviations.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SigmaState {
    pub name: String,
    /// One value per time, in the unit of the figure.
    pub sigma: Vec<f64>,
    /// Where it ends, if it does.
    pub steady: Option<f64>,
}

/// Predicted standard deviation of each state from the first measurement on.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sigma {
    pub title: String,
    pub unit: String,
    pub time_s: Vec<f64>,
    pub states: Vec<SigmaState>,
    /// Marked by an upright line.
    pub settling_time_s: Option<f64>,
}

/// Log-log figure of [`Sigma`].
pub fn sigma(data: &Sigma) -> String {
    let values = data.states.iter().flat_map(|s| s.sigma.iter().copied().chain(s.steady));
    let settling = data.settling_time_s.filter(|t| t.is_finite());
    let mut chart = Chart::new(
        &data.title,
        &format!(
            "Predicted standard deviation against time for {}.",
            data.states.iter().map(|s| s.name.as_str()).collect::<Vec<_>>().join(", ")
        ),
        Axis {
            name: "time from the first measurement".into(),
            unit: "s".into(),
            scale: Scale::log(data.time_s.iter().copied()),
        },
        Axis { name: "predicted σ".into(), unit: data.unit.clone(), scale: Scale::log(values) },
    );
    if let Some(at) = settling {
        chart.upright(Class::Expected, at);
    }
    for (k, state) in data.states.iter().enumerate() {
        if let Some(steady) = state.steady {
            chart.level(Class::Thin(k), steady);
        }
        chart.line(Class::Line(k), data.time_s.iter().copied().zip(state.sigma.iter().copied()).collect());
        chart.legend_line(Class::Line(k), &state.name);
    }
    if let Some(first) = data.states.iter().position(|s| s.steady.is_some()) {
        chart.legend_line(Class::Thin(first), "steady state");
    }
    if settling.is_some() {
        chart.legend_line(Class::Expected, "settling time");
    }
    chart.render()
}

/// One state over a recording; values in `unit`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Estimate {
    pub title: String,
    /// "bias of gyro_x".
    pub quantity: String,
    pub unit: String,
    pub time_s: Vec<f64>,
    pub estimate: Vec<f64>,
    pub sigma: Vec<f64>,
    /// Known truth.
    pub truth: Option<Curve>,
    /// What was measured, averaged as far as it helps to see; it may run out of the frame.
    pub measured: Option<Curve>,
}

/// The estimate with bands of one and three sigma.
pub fn estimate(data: &Estimate) -> String {
    let clock = Clock::covering(&data.time_s);
    let at = |k: f64| {
        data.time_s.iter().zip(&data.estimate).zip(&data.sigma).map(move |((&t, &x), &s)| (t, x - k * s, x + k * s))
    };
    // the first moments, before anything is known, would flatten the rest
    let settled = data.time_s.len() / 20;
    let edges = at(3.0).skip(settled).flat_map(|(_, low, high)| [low, high]);
    let truth = data.truth.iter().flat_map(|c| c.points.iter().map(|p| p.1));
    let seen: Vec<f64> = edges.chain(truth).filter(|v| v.is_finite()).collect();
    let (low, high) = seen.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), &v| (l.min(v), h.max(v)));
    // measurements scatter far more than estimates: show enough of them to see where they lie
    let room = if data.measured.is_some() && low < high { 0.5 * (high - low) } else { 0.0 };
    let ends = if low <= high { vec![low - room, high + room] } else { vec![] };
    let mut chart = Chart::new(
        &data.title,
        &format!("{} over time with bands of one and three standard deviations.", data.quantity),
        clock.axis(),
        Axis { name: data.quantity.clone(), unit: data.unit.clone(), scale: Scale::linear_padded(ends, &[]) },
    );
    let scaled = |k: f64| at(k).map(|(t, low, high)| (clock.show(t), low, high)).collect::<Vec<_>>();
    if let Some(measured) = &data.measured {
        chart.line(Class::Thread(5), measured.points.iter().map(|&(t, x)| (clock.show(t), x)).collect());
    }
    chart.band(0, scaled(3.0));
    chart.band(0, scaled(1.0));
    if let Some(truth) = &data.truth {
        chart.line(Class::Truth, truth.points.iter().map(|&(t, x)| (clock.show(t), x)).collect());
    }
    chart.line(Class::Line(0), data.time_s.iter().zip(&data.estimate).map(|(&t, &x)| (clock.show(t), x)).collect());
    // over the estimate, which hides the bands where it is rough
    chart.edges(Class::Thread(0), &scaled(3.0));
    chart.legend_line(Class::Line(0), "estimate");
    chart.legend_band(0, "±1σ and ±3σ");
    if let Some(truth) = &data.truth {
        chart.legend_line(Class::Truth, &truth.label);
    }
    if let Some(measured) = &data.measured {
        chart.legend_line(Class::Thread(5), &measured.label);
    }
    chart.render()
}

/// Normalised innovations. For a long recording each entry is a stretch with its extremes; for a short one `lower ==
/// upper`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Innovations {
    pub title: String,
    pub time_s: Vec<f64>,
    pub lower: Vec<f64>,
    pub upper: Vec<f64>,
}

/// Innovations in units of their predicted standard deviation, with lines at ±3.
pub fn innovations(data: &Innovations) -> String {
    let clock = Clock::covering(&data.time_s);
    let largest = data.lower.iter().chain(&data.upper).filter(|v| v.is_finite()).fold(3.5_f64, |m, v| m.max(v.abs()));
    let limit = largest.min(12.0);
    let single = data.lower == data.upper;
    let mut chart = Chart::new(
        &data.title,
        &format!(
            "Innovations divided by their predicted standard deviation over time, with limits at plus and minus 3. \
             Largest magnitude {largest:.2}."
        ),
        clock.axis(),
        Axis {
            name: "normalised innovation".into(),
            unit: "σ".into(),
            scale: Scale::linear_between(-1.05 * limit, 1.05 * limit, 6.0),
        },
    );
    let times = data.time_s.iter().map(|&t| clock.show(t));
    if single {
        chart.line(Class::Thread(0), times.zip(data.lower.iter().copied()).collect());
        chart.legend_line(Class::Thread(0), "innovation");
    } else {
        let ends = times.zip(data.lower.iter().zip(&data.upper)).map(|(t, (&low, &high))| (t, low, high));
        let ends: Vec<(f64, f64, f64)> = ends.collect();
        chart.line(Class::Thread(0), ends.iter().map(|e| (e.0, e.1)).collect());
        chart.line(Class::Thread(0), ends.iter().map(|e| (e.0, e.2)).collect());
        chart.band(0, ends);
        chart.legend_band(0, "extremes of each stretch");
    }
    chart.level(Class::Bound, 3.0);
    chart.level(Class::Bound, -3.0);
    chart.legend_line(Class::Bound, "±3σ");
    chart.render()
}

/// Seconds, minutes or hours, whichever reads best.
pub(super) struct Clock {
    divisor: f64,
    unit: &'static str,
    low: f64,
    high: f64,
}

impl Clock {
    pub(super) fn covering(time_s: &[f64]) -> Clock {
        let finite = || time_s.iter().copied().filter(|t| t.is_finite());
        let (low, high) = finite().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), t| (l.min(t), h.max(t)));
        let (divisor, unit) = match high - low {
            span if span > 7200.0 => (3600.0, "h"),
            span if span > 600.0 => (60.0, "min"),
            _ => (1.0, "s"),
        };
        Clock { divisor, unit, low, high }
    }

    pub(super) fn show(&self, time_s: f64) -> f64 {
        time_s / self.divisor
    }

    /// s at which a twentieth of the span has passed.
    pub(super) fn early(&self) -> f64 {
        self.low + 0.05 * (self.high - self.low)
    }

    pub(super) fn axis(&self) -> Axis {
        let scale = if self.high > self.low {
            // a record that starts nearly at zero, as the mean of a first stretch does, starts at zero
            let low = if self.low > 0.0 && self.low < 0.02 * self.high { 0.0 } else { self.low };
            Scale::linear_to_tick(self.show(low), self.show(self.high), 6.0)
        } else {
            Scale::linear([self.low], &[])
        };
        Axis { name: "time".into(), unit: self.unit.into(), scale }
    }
}
