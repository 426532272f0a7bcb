//! What consumers take of a sensor: white noise, and its drift as a random walk or as Gauss-Markov processes.

use crate::noise::Term;
use crate::params::{AxisParams, Measured, Params, TermEntry};
use crate::units::{Quantity, digits};

/// Slowest time constant, s, of the Gauss-Markov processes that stand for flicker.
const FLICKER_HORIZON: f64 = 10_000.0;

/// A number in SI with its 95 % interval, where one is known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Number {
    pub value: f64,
    pub interval: Option<[f64; 2]>,
}

/// How a drift that stays bounded becomes a random walk.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Walk {
    /// The same growth over short times: K² = K_rrw² + Σ 2σ²/Tc.
    Short,
    /// The same growth over this time, s: K² = K_rrw² + Σ 2σ² (1 − e^(−H/Tc))/H.
    Horizon(f64),
}

/// Which of three axes stands for all, where a consumer has one number.
#[derive(Clone, Debug, PartialEq)]
pub enum Choice {
    /// The largest of each number.
    Worst,
    /// The root mean square.
    Mean,
    /// This axis.
    Axis(String),
}

/// A first-order Gauss-Markov process.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GaussMarkov {
    pub std_dev: f64,
    /// s.
    pub correlation_time: f64,
}

/// One axis as consumers take it.
#[derive(Clone, Debug, PartialEq)]
pub struct Numbers {
    pub name: String,
    /// N, root of the two-sided density at low frequencies, unit/√Hz: what a consumer adds up over many samples. White noise, averaged or
    /// not, and the density of oscillations at zero, which is next to nothing of a narrow line and most of N behind a low-pass in the sensor.
    pub white: Number,
    /// N over that of the white noise alone.
    pub oscillations: f64,
    /// K, unit/s/√Hz; zero when there is no drift.
    pub walk: Number,
    /// What the walk stands for.
    pub processes: Vec<GaussMarkov>,
    /// Walk in the parameters themselves.
    pub rate_random_walk: f64,
    /// Spread of the bias from one power-up to the next.
    pub turn_on: Option<f64>,
    /// Terms that no consumer has: their document names.
    pub left_out: Vec<&'static str>,
}

/// One kind of sensor.
#[derive(Clone, Debug, PartialEq)]
pub struct Sensor {
    pub quantity: Quantity,
    pub axes: Vec<Numbers>,
}

impl Sensor {
    /// Errors: an axis without white noise, `Choice` of an axis that is not there.
    pub fn new(params: &Params, walk: Walk) -> Result<Sensor, String> {
        let axes = params.axes.iter().map(|axis| Numbers::new(axis, 1.0 / params.sample_rate_hz, walk));
        Ok(Sensor { quantity: params.quantity, axes: axes.collect::<Result<_, _>>()? })
    }

    /// One number for three axes.
    pub fn one(&self, choice: &Choice, of: impl Fn(&Numbers) -> f64) -> Result<f64, String> {
        let values = || self.axes.iter().map(&of);
        match choice {
            Choice::Worst => Ok(values().fold(0.0, f64::max)),
            Choice::Mean => Ok((values().map(|v| v * v).sum::<f64>() / self.axes.len() as f64).sqrt()),
            Choice::Axis(name) => self.axes.iter().find(|axis| axis.name == *name).map(&of).ok_or_else(|| {
                let known: Vec<&str> = self.axes.iter().map(|axis| axis.name.as_str()).collect();
                format!("--axis {name}: the axes are {}; expected one of them, worst or mean", known.join(", "))
            }),
        }
    }

    /// Three values for x, y, z; one axis stands for all three.
    pub fn three(&self, of: impl Fn(&Numbers) -> f64) -> Result<[f64; 3], String> {
        let values: Vec<f64> = self.axes.iter().map(of).collect();
        match values[..] {
            [one] => Ok([one; 3]),
            [x, y, z] => Ok([x, y, z]),
            _ => Err(format!("the parameters have {} axes, the file needs one or three", values.len())),
        }
    }
}

impl Numbers {
    fn new(axis: &AxisParams, dt: f64, rule: Walk) -> Result<Numbers, String> {
        let noise = axis.noise();
        let wideband = noise.wideband_density();
        if wideband <= 0.0 {
            return Err(format!("axis '{}' has no white noise; give axes[].white.density", axis.name));
        }
        let oscillations = noise.terms.iter().filter(|term| matches!(term, Term::Oscillation { .. }));
        let density = (wideband * wideband + oscillations.map(|term| term.psd(0.0, dt)).sum::<f64>()).sqrt();
        let mut processes = Vec::new();
        let (mut walk_square, mut left_out) = (0.0, Vec::new());
        for term in &noise.terms {
            match *term {
                Term::GaussMarkov { std_dev, correlation_time } => {
                    processes.push(GaussMarkov { std_dev, correlation_time });
                }
                Term::RateRandomWalk { density } => walk_square += density * density,
                Term::BiasInstability { .. } => processes.extend(chain(term, dt)),
                Term::White { .. } | Term::MovingAverage { .. } | Term::BandLimit { .. } => {}
                Term::Oscillation { .. } => left_out.push("oscillation"),
                Term::Quantization { .. } => left_out.push("quantization"),
                Term::RateRamp { .. } => left_out.push("rate_ramp"),
            }
        }
        left_out.dedup();
        let value = (walk_square + processes.iter().map(|p| p.growth(rule)).sum::<f64>()).sqrt();
        Ok(Numbers {
            name: axis.name.clone(),
            // the interval is that of the white noise alone
            white: Number { value: density, interval: white_interval(axis).filter(|_| density < 1.005 * wideband) },
            oscillations: density / wideband,
            walk: Number { value, interval: walk_interval(axis, rule) },
            processes,
            rate_random_walk: walk_square.sqrt(),
            turn_on: axis.turn_on_bias.as_ref().map(Measured::si),
            left_out,
        })
    }

    /// What must be known of these numbers.
    pub fn note(&self) -> Option<String> {
        (self.oscillations > 1.1).then(|| {
            format!(
                "{}: N is {:.2} times that of the white noise alone: it has the density of the oscillations at low frequencies, as behind a low-pass in the sensor",
                self.name, self.oscillations
            )
        })
    }

    /// Where the walk of short times stands for processes that have long died away after a minute.
    pub fn walk_note(&self, rule: Walk) -> Option<String> {
        const MINUTE: Walk = Walk::Horizon(60.0);
        let growth = |rule| self.processes.iter().map(|p| p.growth(rule)).sum::<f64>() + self.rate_random_walk.powi(2);
        let ratio = (growth(Walk::Short) / growth(MINUTE)).sqrt();
        (rule == Walk::Short && ratio > 3.0).then(|| {
            format!(
                "{}: K is that of the fastest drift and {ratio:.0} times that of --walk horizon=60s, which fits the drift over a minute",
                self.name
            )
        })
    }

    /// The one Gauss-Markov process of a consumer that has one, by the whole variance and the whole growth over short times: σ² = Σ σ_i²,
    /// Tc = 2σ²/Σ(2σ_i²/Tc_i). `None` when the drift has a random walk, which grows without bound, or when there is no drift.
    pub fn single_process(&self) -> Option<GaussMarkov> {
        if self.rate_random_walk > 0.0 || self.processes.is_empty() {
            return None;
        }
        let variance: f64 = self.processes.iter().map(|p| p.std_dev * p.std_dev).sum();
        let growth: f64 = self.processes.iter().map(|p| p.growth(Walk::Short)).sum();
        Some(GaussMarkov { std_dev: variance.sqrt(), correlation_time: 2.0 * variance / growth })
    }
}

impl GaussMarkov {
    /// Variance per second that a walk needs to grow as far as the process.
    fn growth(&self, rule: Walk) -> f64 {
        let variance = self.std_dev * self.std_dev;
        match rule {
            Walk::Short => 2.0 * variance / self.correlation_time,
            Walk::Horizon(horizon) => -2.0 * variance * (-horizon / self.correlation_time).exp_m1() / horizon,
        }
    }
}

/// The Gauss-Markov processes that stand for flicker.
fn chain(term: &Term, dt: f64) -> Vec<GaussMarkov> {
    let Some(states) = term.realisation(dt, FLICKER_HORIZON) else { return Vec::new() };
    (0..states.names.len())
        .map(|i| GaussMarkov {
            std_dev: states.h[i].abs() * states.p0[(i, i)].sqrt(),
            correlation_time: -dt / states.phi[(i, i)].ln(),
        })
        .collect()
}

/// Only where white noise is one term with an interval; beside it at most a floor.
fn white_interval(axis: &AxisParams) -> Option<[f64; 2]> {
    let wideband: Vec<&Measured> = axis.terms.iter().filter_map(TermEntry::wideband_density).collect();
    let only = *wideband.iter().max_by(|a, b| a.si().total_cmp(&b.si()))?;
    let floors = wideband.iter().filter(|other| other.is_floor_of(only.si())).count();
    only.interval_si().filter(|_| floors + 1 == wideband.len())
}

/// Only where the drift is one random walk with an interval, or one Gauss-Markov process whose intervals bound it: the corners.
fn walk_interval(axis: &AxisParams, rule: Walk) -> Option<[f64; 2]> {
    let mut drifts = axis.terms.iter().filter(|term| term.to_term().kind().is_drift());
    let only = drifts.next()?;
    if drifts.next().is_some() {
        return None;
    }
    match only {
        TermEntry::RateRandomWalk { density } => density.interval_si(),
        TermEntry::GaussMarkov { std_dev, correlation_time } => {
            let (sigma, time) = (std_dev.interval_si()?, correlation_time.interval_si()?);
            let at =
                |std_dev: f64, correlation_time: f64| GaussMarkov { std_dev, correlation_time }.growth(rule).sqrt();
            let ends = [at(sigma[0], time[1]), at(sigma[1], time[0])];
            [sigma, time, ends].as_flattened().iter().all(|end| end.is_finite()).then_some(ends)
        }
        _ => None,
    }
}

impl Walk {
    /// For comments.
    pub fn words(self) -> String {
        match self {
            Walk::Short => {
                "K = sqrt(K_rrw^2 + sum 2 sigma^2/Tc): the growth of the drift over times short beside Tc".into()
            }
            Walk::Horizon(h) => format!(
                "K = sqrt(K_rrw^2 + sum 2 sigma^2 (1 - exp(-H/Tc))/H), H = {} s: the growth of the drift over H",
                digits(h)
            ),
        }
    }
}
