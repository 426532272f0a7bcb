//! What consumers take of a sensor: white noise, and its drift as a random walk or as one Gauss-Markov process.

use super::filters::Aiding;
use crate::noise::{NoiseModel, Term};
use crate::numerics::optimize::lowest;
use crate::params::{AxisParams, Measured, Params, TermEntry};
use crate::tune::{AidedFilter, SensorDrift, WalkPrice, WalkTrial};
use crate::units::{Quantity, digits};

/// Slowest time constant, s, of the Gauss-Markov processes that stand for flicker; no walk is looked for that is
/// slower, and a simulated drift is as the sensor's up to averages over this time.
pub(super) const SLOWEST: f64 = 10_000.0;
/// s.
const MINUTE: f64 = 60.0;

/// A number in SI with its 95 % interval, where one is known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Number {
    pub value: f64,
    pub interval: Option<[f64; 2]>,
}

/// How a drift becomes a random walk.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Walk {
    /// The one that costs the consumer's filter least, see [`WalkTrial`].
    Least,
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

/// What the numbers depend on beside the sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Settings {
    /// s from one step of the consumer to the next.
    pub(super) step: f64,
    /// Of consumers with a filter.
    pub(super) aiding: Option<Aiding>,
    pub(super) rule: Walk,
    /// On N, K and σ.
    pub(super) inflation: f64,
}

/// One axis as consumers take it, before inflation.
#[derive(Clone, Debug, PartialEq)]
pub struct Numbers {
    pub name: String,
    /// N, root of the two-sided density at low frequencies, unit/√Hz: what a consumer adds up over many samples.
    /// White noise, averaged or not, and the density of oscillations at zero, which is next to nothing of a narrow
    /// line and most of N behind a low-pass in the sensor.
    pub white: Number,
    /// N over that of the white noise alone.
    pub oscillations: f64,
    /// K, unit/s/√Hz; `None` when the parameters have no drift.
    pub walk: Option<Number>,
    /// K that would have shown in the log where no drift was seen (95 %).
    pub walk_limit: Option<f64>,
    /// The drift itself.
    pub drift: Vec<Term>,
    /// What the walk stands for, with flicker as a chain that begins at the consumer's step.
    pub processes: Vec<GaussMarkov>,
    /// Walk in the parameters themselves, with ramps as walks.
    pub rate_random_walk: f64,
    /// Ramps are in it.
    pub ramp: bool,
    /// Spread of the bias from one power-up to the next.
    pub turn_on: Option<f64>,
    /// Terms that no consumer has: their document names.
    pub left_out: Vec<&'static str>,
    /// What a walk costs, with inflation, and the one that costs least, inflated.
    pub trial: Option<WalkTrial>,
    pub least: Option<(f64, WalkPrice)>,
    /// s from one step of the consumer to the next.
    step: f64,
}

/// One kind of sensor.
#[derive(Clone, Debug, PartialEq)]
pub struct Sensor {
    pub quantity: Quantity,
    pub axes: Vec<Numbers>,
}

impl Sensor {
    /// Errors: an axis without white noise, or with a drift that no filter of the consumer follows.
    pub(super) fn new(params: &Params, settings: &Settings) -> Result<Sensor, String> {
        let mut axes: Vec<Numbers> = Vec::with_capacity(params.axes.len());
        for (i, axis) in params.axes.iter().enumerate() {
            // axes are often alike: each is worked out once
            let alike = |other: &AxisParams| {
                let same = other.terms == axis.terms && other.not_identified == axis.not_identified;
                same && other.turn_on_bias == axis.turn_on_bias
            };
            let numbers = match params.axes.iter().take(i).position(alike) {
                Some(twin) => Numbers { name: axis.name.clone(), ..axes[twin].clone() },
                None => Numbers::new(axis, params, settings)?,
            };
            axes.push(numbers);
        }
        Ok(Sensor { quantity: params.quantity, axes })
    }

    /// One number for three axes, of those that have it; `None` where none has.
    pub fn one(&self, choice: &Choice, of: impl Fn(&Numbers) -> Option<f64>) -> Result<Option<f64>, String> {
        let values: Vec<f64> = self.axes.iter().filter_map(&of).collect();
        match choice {
            Choice::Worst => Ok(values.into_iter().reduce(f64::max)),
            Choice::Mean => {
                let mean = values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64;
                Ok((!values.is_empty()).then(|| mean.sqrt()))
            }
            Choice::Axis(name) => self.axes.iter().find(|axis| axis.name == *name).map(&of).ok_or_else(|| {
                let known: Vec<&str> = self.axes.iter().map(|axis| axis.name.as_str()).collect();
                format!("`axis` {name}: the axes are {}; expected one of them, worst or mean", known.join(", "))
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
    fn new(axis: &AxisParams, params: &Params, settings: &Settings) -> Result<Numbers, String> {
        let noise = axis.noise();
        let wideband = noise.wideband_density();
        if wideband <= 0.0 {
            return Err(format!("axis '{}' has no white noise; give axes[].white.density", axis.name));
        }
        let sampling = 1.0 / params.sample_rate_hz;
        let oscillations = noise.terms.iter().filter(|term| matches!(term, Term::Oscillation { .. }));
        let density = (wideband * wideband + oscillations.map(|term| term.psd(0.0, sampling)).sum::<f64>()).sqrt();
        let mut processes = Vec::new();
        let (mut walk_square, mut left_out, mut drift) = (0.0, Vec::new(), Vec::new());
        for term in &noise.terms {
            let term = &as_walk(*term, settings.rule);
            match *term {
                Term::GaussMarkov { std_dev, correlation_time } => {
                    processes.push(GaussMarkov { std_dev, correlation_time });
                }
                Term::RateRandomWalk { density } => walk_square += density * density,
                Term::BiasInstability { .. } => processes.extend(chain(term, settings.step)),
                Term::White { .. } | Term::MovingAverage { .. } | Term::BandLimit { .. } => continue,
                Term::Oscillation { .. } => left_out.push("oscillation"),
                Term::Quantization { .. } => left_out.push("quantization"),
                Term::RateRamp { .. } => {}
            }
            if term.kind().is_drift() {
                drift.push(*term);
            }
        }
        left_out.dedup();
        let turn_on = axis.turn_on_bias.as_ref().map(Measured::si);
        let trial = |processes: &[GaussMarkov], walk: f64| {
            let factor = settings.inflation;
            let sensor = SensorDrift {
                quantity: params.quantity,
                white: density * factor,
                processes: processes.iter().map(|p| [p.std_dev * factor, p.correlation_time]).collect(),
                walk: walk * factor,
            };
            let Aiding { integrals, std_dev, rate_hz, .. } = settings.aiding?;
            let filter = AidedFilter {
                step: settings.step,
                integrals,
                aid_std_dev: std_dev,
                aid_rate_hz: rate_hz,
                bias_std_dev: turn_on.unwrap_or(Aiding::any_bias(params.quantity)),
            };
            WalkTrial::new(&sensor, &filter)
        };
        let walk = walk_square.sqrt();
        let mut numbers = Numbers {
            name: axis.name.clone(),
            // the interval is that of the white noise alone
            white: Number { value: density, interval: white_interval(axis).filter(|_| density < 1.005 * wideband) },
            oscillations: density / wideband,
            walk: None,
            walk_limit: None,
            trial: None,
            least: None,
            rate_random_walk: walk,
            ramp: noise.terms.iter().any(|term| matches!(term, Term::RateRamp { .. })),
            turn_on,
            left_out,
            step: settings.step,
            processes,
            drift,
        };
        if numbers.drift.is_empty() {
            let limits = axis.not_identified.iter().filter_map(|entry| entry.upper_limit.as_ref());
            numbers.walk_limit = limits.map(Measured::si).reduce(f64::max);
            return Ok(numbers);
        }
        // a simulator has no filter, and no walk is asked for
        if settings.aiding.is_none() {
            return Ok(numbers);
        }
        let least_of = |trial: Option<&WalkTrial>| trial.and_then(|trial| trial.least(SLOWEST));
        let grown = |processes: &[GaussMarkov], rule: Walk| {
            (walk * walk + processes.iter().map(|p| p.growth(rule)).sum::<f64>()).sqrt()
        };
        numbers.trial = trial(&numbers.processes, walk);
        numbers.least = least_of(numbers.trial.as_ref());
        let value = match (settings.rule, numbers.least) {
            (Walk::Least, Some((k, _))) => k / settings.inflation,
            (Walk::Least, None) => {
                let name = &axis.name;
                return Err(format!(
                    "axis '{name}': no filter with a walk settles in its drift; give `walk` horizon=60s"
                ));
            }
            (rule, _) => grown(&numbers.processes, rule),
        };
        numbers.walk = Some(Number { value, interval: walk_interval(axis, settings.rule) });
        Ok(numbers)
    }

    /// What must be known of these numbers.
    pub fn note(&self) -> Option<String> {
        (self.oscillations > 1.1).then(|| {
            format!(
                "{}: N is {:.2} times that of the white noise alone: it has the density of the oscillations at low \
                 frequencies, as behind a low-pass in the sensor",
                self.name, self.oscillations
            )
        })
    }

    /// The one Gauss-Markov process of a consumer that has one, beside a walk if `walks`; `None` when nothing is
    /// left for it.
    ///
    /// One process is taken as it is. Of several, of flicker, and of a walk where the consumer has none, it is the
    /// process whose Allan deviation, with the white noise, is nearest the sensor's: the largest ratio (second
    /// result) is least over averaging times from a step to `SLOWEST`.
    pub fn single_process(&self, walks: bool) -> Option<(GaussMarkov, f64)> {
        let mut drift = self.drift.clone();
        drift.retain(|term| !(walks && matches!(term, Term::RateRandomWalk { .. })));
        if let [Term::GaussMarkov { std_dev, correlation_time }] = drift[..] {
            return Some((GaussMarkov { std_dev, correlation_time }, 1.0));
        }
        (!drift.is_empty()).then(|| nearest_process(self.white.value, &drift, self.step))
    }
}

/// See [`Numbers::single_process`].
fn nearest_process(white: f64, drift: &[Term], dt: f64) -> (GaussMarkov, f64) {
    const PER_DECADE: f64 = 8.0;
    let decades = (SLOWEST / dt).log10();
    let mut averages: Vec<u64> =
        (0..=(decades * PER_DECADE) as i32).map(|i| 10f64.powf(f64::from(i) / PER_DECADE).round() as u64).collect();
    averages.dedup();
    let of = |terms: &[Term]| -> Vec<f64> {
        let model = NoiseModel { terms: terms.to_vec() };
        averages.iter().map(|&m| model.allan_variance(m, dt)).collect()
    };
    let noise = of(&[Term::White { density: white }]);
    let truth: Vec<f64> = noise.iter().zip(of(drift)).map(|(noise, drift)| noise + drift).collect();
    // the largest |ln| of the ratio of the deviations with a process of variance v and unit Allan variances u
    let miss = |unit: &[f64], v: f64| {
        let each = unit.iter().zip(&noise).zip(&truth).map(|((u, noise), truth)| ((noise + v * u) / truth).ln().abs());
        0.5 * each.fold(0.0, f64::max)
    };
    let best_variance = |log_time: f64| {
        let unit = of(&[Term::GaussMarkov { std_dev: 1.0, correlation_time: log_time.exp() }]);
        // at most what the sensor shows at the averaging time at which the process shows most
        let most = unit.iter().zip(&truth).map(|(u, truth)| truth / u).fold(f64::INFINITY, f64::min).ln() + 2.0;
        let (log, found) = valley(most - 20.0, most, |log| miss(&unit, log.exp()));
        (log.exp(), found)
    };
    let (log_time, found) = valley(dt.ln(), (10.0 * SLOWEST).ln(), |log| best_variance(log).1);
    let std_dev = best_variance(log_time).0.sqrt();
    (GaussMarkov { std_dev, correlation_time: log_time.exp() }, found.exp())
}

/// Least value of `of` between `low` and `high`: the best of 40 points, then the golden section between its neighbours.
fn valley(low: f64, high: f64, of: impl Fn(f64) -> f64) -> (f64, f64) {
    const POINTS: i32 = 40;
    let step = (high - low) / f64::from(POINTS);
    let points = (0..=POINTS).map(|i| low + f64::from(i) * step).map(|x| (x, of(x)));
    let (best, value) = points.min_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((low, f64::INFINITY));
    let middle = lowest(&of, (best - step).max(low), (best + step).min(high), 1e-6);
    let found = of(middle);
    if found < value { (middle, found) } else { (best, value) }
}

impl GaussMarkov {
    /// Variance per second that a walk needs to grow as far as the process.
    fn growth(&self, rule: Walk) -> f64 {
        let variance = self.std_dev * self.std_dev;
        match rule {
            Walk::Least | Walk::Short => 2.0 * variance / self.correlation_time,
            Walk::Horizon(horizon) => -2.0 * variance * (-horizon / self.correlation_time).exp_m1() / horizon,
        }
    }
}

/// A ramp counts as the walk that has grown as far after a minute, or after the horizon of the rule: K = slope √H.
fn as_walk(term: Term, rule: Walk) -> Term {
    let horizon = if let Walk::Horizon(h) = rule { h } else { MINUTE };
    match term {
        Term::RateRamp { slope } => Term::RateRandomWalk { density: slope.abs() * horizon.sqrt() },
        other => other,
    }
}

/// The Gauss-Markov processes that stand for flicker, without those faster than a step: they are white noise to the
/// consumer.
fn chain(term: &Term, step: f64) -> Vec<GaussMarkov> {
    let Some(states) = term.realisation(step, SLOWEST) else { return Vec::new() };
    let process = |i: usize| GaussMarkov {
        std_dev: states.h[i].abs() * states.p0[(i, i)].sqrt(),
        correlation_time: -step / states.phi[(i, i)].ln(),
    };
    (0..states.names.len()).map(process).filter(|p| p.correlation_time >= step).collect()
}

/// Only where white noise is one term with an interval; beside it at most a floor.
fn white_interval(axis: &AxisParams) -> Option<[f64; 2]> {
    let wideband: Vec<&Measured> = axis.terms.iter().filter_map(TermEntry::wideband_density).collect();
    let only = *wideband.iter().max_by(|a, b| a.si().total_cmp(&b.si()))?;
    let floors = wideband.iter().filter(|other| other.is_floor_of(only.si())).count();
    only.interval_si().filter(|_| floors + 1 == wideband.len())
}

/// Only where the drift is one random walk with an interval, or one Gauss-Markov process whose intervals bound the
/// walk of the rule: the corners. The walk that costs least is no monotonic function of a correlation time, and has
/// none.
fn walk_interval(axis: &AxisParams, rule: Walk) -> Option<[f64; 2]> {
    let mut drifts = axis.terms.iter().filter(|term| term.to_term().kind().is_drift());
    let only = drifts.next()?;
    if drifts.next().is_some() {
        return None;
    }
    match only {
        TermEntry::RateRandomWalk { density } => density.interval_si(),
        TermEntry::GaussMarkov { std_dev, correlation_time } if rule != Walk::Least => {
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
            Walk::Least => "K: the random walk that costs this filter least, settled and in the first minute".into(),
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
