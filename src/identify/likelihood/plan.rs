//! Before a log is recorded: how well its maximum likelihood estimates can be known, and how long it must be for that.
//!
//! The Cramér-Rao bound of n samples is the inverse of I_ik = ½ Σ_j ∂_i ln S(f_j) ∂_k ln S(f_j), f_j = j/(2 n dt), j =
//! 1 … n − 1, by the logarithms of the parameters, S the spectrum of the sampled series: the information of its
//! cosine coefficients without the mean. The sum is made over bins, each coefficient up to the 32nd alone, then 2.5
//! % wide and finer about lines, so that its cost does not grow with the log. For a Gauss-Markov process the
//! standard deviations are below those of the exact Gaussian information by up to about 0.9 Tc/T of themselves.
//! Source: Whittle 1953; Kay 1993, section 3.11.

use schemars::JsonSchema;
use serde::Serialize;

use super::form::Form;
use super::names::name_of;
use super::ordinates::Ordinates;
use super::{parameter_name, whittle};
use crate::noise::{Grid, Kind, NoiseModel, Role, Term};
use crate::numerics::optimize::covariance;
use crate::signal::lines::Line;

/// The longest log that is thought of: ten years, s.
pub const LONGEST_S: f64 = 10.0 * 365.25 * 86_400.0;

/// White noise beside a band limit of at most this share of the variance of its innovations is not told from it.
const UNTOLD: f64 = 0.05;
/// Zeros on the unit circle, where a search does not come to, are moved in to this.
const LARGEST_ZERO: f64 = 0.98;
/// What is thought of the logarithm of an area ratio beforehand, one over its variance: nothing that matters where
/// the log tells it, and the rest stays finite where the samples are too slow to.
const SHAPE: f64 = 0.01;

/// How the samples of a log are made of those of the sensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Thinning {
    /// Means of consecutive samples.
    Averages,
    /// The first of consecutive samples, the others thrown away.
    Decimation,
}

/// The samples of a log.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sampling {
    /// Of the sensor, Hz; the coefficients hold for its samples.
    pub sensor_rate_hz: f64,
    /// So many of them, at least one, make one of the log.
    pub every: usize,
    pub thinning: Thinning,
}

impl Sampling {
    /// Of the log, Hz.
    pub fn rate_hz(&self) -> f64 {
        self.sensor_rate_hz / self.every as f64
    }
}

/// Where the precision of one parameter comes from.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Origin {
    /// The logarithm of this number.
    Log(usize),
    /// ln q_c = ln σ − ½ ln Tc + ½ ln 2 of a Gauss-Markov process.
    Driving(usize, usize),
    /// A ramp of this slope, unit/s.
    Slope(f64),
}

/// A noise model whose parameters are to be found.
#[derive(Clone, Debug)]
pub struct Planned {
    form: Form,
    logs: Vec<f64>,
    parameters: Vec<(String, Origin)>,
    /// Frequency, Hz, and correlation time, s, of every line.
    lines: Vec<(f64, f64)>,
}

impl Planned {
    pub fn new(model: &NoiseModel) -> Planned {
        let within = |term: &Term| match *term {
            Term::BandLimit { density, filter } => {
                Term::BandLimit { density, filter: filter.zeros_within(LARGEST_ZERO) }
            }
            other => other,
        };
        let (form, logs) = Form::with_floor(&NoiseModel { terms: model.terms.iter().map(within).collect() }, UNTOLD);
        let known: Vec<String> = (0..logs.len()).map(|i| name_of(&form, i)).collect();
        // none of the white noise that only goes with a band limit
        let place = |name: &str| known.iter().position(|known| known == name);
        let mut parameters = Vec::new();
        let mut lines = Vec::new();
        for (i, term) in model.terms.iter().enumerate() {
            let kind = term.kind();
            let number = model.terms[..i].iter().filter(|other| other.kind() == kind).count();
            let names = kind.roles().iter().map(|role| parameter_name(kind, number, *role));
            match *term {
                Term::RateRamp { slope } => parameters.extend(names.map(|name| (name, Origin::Slope(slope)))),
                _ => parameters.extend(
                    names.filter_map(|name| Some((place(&name)?, name))).map(|(at, name)| (name, Origin::Log(at))),
                ),
            }
            match *term {
                Term::GaussMarkov { .. } => {
                    let at = place(&parameter_name(kind, number, Role::Coefficient));
                    let name = format!("{}.driving_noise", super::term_name(kind, number));
                    parameters.extend(at.map(|at| (name, Origin::Driving(at, at + 1))));
                }
                Term::Oscillation { frequency_hz, correlation_time, .. } => {
                    lines.push((frequency_hz, correlation_time));
                }
                _ => {}
            }
        }
        Planned { form, logs, parameters, lines }
    }

    /// As in params.json, in its order; and `gauss_markov.driving_noise`, σ √(2/Tc).
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.parameters.iter().map(|(name, _)| name.as_str())
    }

    /// Cramér-Rao bound of the relative standard deviation (1 sigma) of every parameter from a log of this length;
    /// infinite where the log cannot tell the parameter from others.
    pub fn precision(&self, span_s: f64, sampling: &Sampling) -> Vec<f64> {
        self.of_samples((span_s * sampling.rate_hz()).round() as usize, sampling)
    }

    fn of_samples(&self, samples: usize, sampling: &Sampling) -> Vec<f64> {
        let (dt, every) = (1.0 / sampling.rate_hz(), sampling.every);
        let averaged = sampling.thinning == Thinning::Averages;
        let grid = |frequency_hz: &[f64]| match every {
            1 => Grid::new(frequency_hz.to_vec(), dt),
            _ => Grid::thinned(frequency_hz, 1.0 / sampling.sensor_rate_hz, every, averaged),
        };
        // a line stands where the slower series shows it
        let line = |(frequency_hz, correlation_time): &(f64, f64)| Line {
            frequency_hz: (frequency_hz - (frequency_hz * dt).round() / dt).abs(),
            width_hz: 1.0 / (std::f64::consts::PI * correlation_time),
        };
        let lines: Vec<Line> = self.lines.iter().map(line).collect();
        let data = Ordinates::expected(samples, dt, &lines, grid);
        let mut information = whittle::expected_information(&data, &self.form, &self.logs);
        for (i, (_, role)) in self.form.roles().into_iter().enumerate() {
            information[(i, i)] += if role == Role::Shape { SHAPE } else { 0.0 };
        }
        let covariance = covariance(&information);
        let ramps = self.form.count(Kind::RateRamp);
        let of = |(_, origin): &(String, Origin)| match (*origin, &covariance) {
            (Origin::Log(i), Some(c)) => c[(i, i)].sqrt(),
            (Origin::Driving(s, t), Some(c)) => (c[(s, s)] + 0.25 * c[(t, t)] - c[(s, t)]).sqrt(),
            // two ramps are one
            (Origin::Slope(slope), _) if ramps == 1 => {
                whittle::slope_sigma(&data, &self.form, &self.logs) / slope.abs()
            }
            _ => f64::INFINITY,
        };
        self.parameters.iter().map(of).map(|sd| if sd.is_finite() { sd } else { f64::INFINITY }).collect()
    }

    /// Length of the shortest log, s, from which parameter number `index` of [`Planned::names`] is known to this
    /// relative standard deviation; None beyond [`LONGEST_S`].
    ///
    /// Right to 1e-5 or one sample. Standard deviations shrink about like T^(−1/2): by that rule the search jumps,
    /// within what it knows.
    pub fn duration(&self, index: usize, precision: f64, sampling: &Sampling) -> Option<f64> {
        let rate = sampling.rate_hz();
        let excess = |samples: f64| self.of_samples(samples as usize, sampling)[index] / precision;
        let longest = (LONGEST_S * rate).floor();
        let (mut short, mut long) = (1.0, f64::INFINITY);
        let mut at = (3600.0 * rate).floor().clamp(2.0, longest);
        for step in 0..400 {
            let excess = excess(at);
            if excess > 1.0 {
                if at >= longest {
                    return None;
                }
                short = at;
            } else {
                long = at;
            }
            if long - short <= 1.0 || (1.0 - 1e-5..=1.0).contains(&excess) {
                break;
            }
            // every third time halfway, so that both ends close in; never below the wish by rounding
            let jump = at * (excess * excess).clamp(1e-3, 1e3) * (1.0 + 1e-6);
            let end = long.min(longest);
            at = if step % 3 == 2 && long.is_finite() { (short * long).sqrt() } else { jump.min(end) }.round();
            at = at.clamp(short + 1.0, (long - 1.0).min(longest).max(short + 1.0));
        }
        long.is_finite().then_some(long / rate)
    }
}
