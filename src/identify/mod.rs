//! Logs to noise parameters (floor 4): maximum likelihood, the weighted Allan fit, wavelet moments, the paper's
//! graphical recipe.
//!
//! One file or folder per method, one variant of [`Method`] each; what they share is here.

pub mod allan_fit;
pub mod graphical;
mod likelihood;
pub mod log_plan;
mod on_temperature;
mod points;
mod selection;
mod shape;
pub mod tails;
mod weighted_fit;

pub use likelihood::between::Between;
pub use likelihood::follow::{Followed, Follower};
pub use likelihood::hold::{Held, Hold, HoldCost};
pub use likelihood::maximum::maximum;
pub use likelihood::recent::{Recent, recent};
pub use likelihood::{Fitted, plan, temperature, windows};
pub use on_temperature::{OnTemperature, TemperatureDocument};
use schemars::JsonSchema;
use serde::Serialize;

use crate::allan::{AllanCurve, AllanPoint, AxisCurve};
use crate::consistency::effect::{PERIODOGRAM_TOLERANCE, VARIANCE_RATIO_TOLERANCE};
use crate::filter::likelihood::Stretch;
use crate::noise::{Kind, NoiseModel, Term};
use crate::params::{AxisParams, Check, CheckKind, Measured, NotIdentified, TermEntry};
use crate::units::{Unit, digits};
pub use likelihood::shared::{SharedTime, TimeProfile, shared_time};
pub use likelihood::sums::{Sum, Sums, counts_as_white};
use points::Distance;
pub use tails::{Student, Tails};

/// How parameters are taken from a log.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Method {
    /// The seed paper's reading of the Allan plot, faithfully, with what each step costs: [`graphical`].
    Graphical,
    /// Generalised least squares on the whole overlapping Allan curve, terms chosen by score: [`allan_fit`].
    Allan,
    /// Maximum likelihood on the cosine coefficients of the log, terms chosen by score; see `likelihood`.
    Likelihood,
    /// Generalised method of wavelet moments (Guerrier et al. 2013) on Haar wavelet variances: [`allan_fit`] with
    /// other weights.
    Gmwm,
}

impl Method {
    /// As in params.json.
    pub fn name(self) -> &'static str {
        match self {
            Method::Graphical => "graphical",
            Method::Allan => "allan",
            Method::Likelihood => "likelihood",
            Method::Gmwm => "gmwm",
        }
    }
}

/// Which terms may be in the model.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ModelChoice {
    Auto,
    /// `white+gm+gm+rrw+flicker+quantization+ramp`; over how many samples `ma` averages, if that is said (`ma2`).
    Terms {
        kinds: Vec<Kind>,
        average: Option<u32>,
        /// Poles, and zeros, of `bl`, if that is said (`bl2`).
        order: Option<u8>,
    },
}

impl ModelChoice {
    /// Why the model can be fitted to no Allan curve and no wavelet variances, if so.
    pub fn beyond_a_curve(&self) -> Option<String> {
        let ModelChoice::Terms { kinds, .. } = self else { return None };
        let kind = kinds.iter().find(|kind| !shape::in_allan_curve(**kind))?;
        Some(format!(
            "{} needs `method` likelihood: averages of the log do not show it apart from white noise",
            kind.short_name()
        ))
    }
}

/// One candidate of the model choice, for the table that is shown.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Candidate {
    pub model: String,
    pub parameters: usize,
    /// Weighted sum of squares of the Allan fit, misfit of the wavelet moments, and the degrees of freedom.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub chi_square: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub dof: Option<f64>,
    /// ln L of the whole log.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub log_likelihood: Option<f64>,
    /// ln L of the last third of the log under the parameters that the first two thirds give.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub held_out: Option<f64>,
    /// Lowest wins. Allan fit and wavelet moments: χ² plus 4 for every parameter and every process; likelihood: −2
    /// ln L plus a cost for every process.
    pub score: f64,
    /// Every parameter has a 95 % interval that says something.
    pub identified: bool,
    pub chosen: bool,
}

/// How well one parameter is known, in percent of itself.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Precision {
    /// `gauss_markov.std_dev`.
    pub parameter: String,
    /// Standard deviation from the curvature of the likelihood; null where it says nothing, and of a parameter that
    /// is held.
    #[schemars(with = "Option<f64>")]
    pub std_dev_percent: f64,
    /// Cramér-Rao bound: no unbiased estimate from a log like this has a smaller standard deviation.
    #[schemars(with = "Option<f64>")]
    pub cramer_rao_percent: f64,
}

/// What one axis gave.
#[derive(Clone, Debug)]
pub struct Identified {
    pub params: AxisParams,
    /// SI.
    pub model: NoiseModel,
    /// The measured overlapping Allan curve with exact intervals for the model.
    pub curve: AllanCurve,
    /// Best score first; empty for the graphical recipe.
    pub candidates: Vec<Candidate>,
    /// Likelihood only.
    pub precision: Vec<Precision>,
    /// Diffuse ln L of the samples (SI) at these parameters, by a Kalman filter; `None` where it would take too long.
    pub exact_log_likelihood: Option<f64>,
    /// Likelihood only: the model as it was fitted, to see what of it follows the temperature.
    pub fitted: Option<Fitted>,
    /// Likelihood only: what white noise and drift are as a whole.
    pub sums: Sums,
    /// What the intervals of the coefficients know of the law of the noise.
    pub tails: Tails,
    /// Of several logs: whether they differ.
    pub between: Vec<Between>,
    /// Likelihood only: what holding parameters costs.
    pub hold: Option<HoldCost>,
    /// Likelihood only, with one Gauss-Markov process: to compare the axes.
    pub time_profile: Option<TimeProfile>,
    pub not_identified: Vec<NotIdentified>,
    /// Sentences for a person.
    pub warnings: Vec<String>,
    /// Graphical recipe: its steps with numbers and what each costs.
    pub steps: Vec<graphical::Step>,
    /// p-value of the chosen model's fit (NaN for graphical).
    pub fit_p_value: f64,
    /// Likelihood only: distance of the cumulative periodogram of the log over the model's spectrum from a straight
    /// line.
    pub fit_distance: Option<f64>,
    /// Shortest averaging time that an Allan fit used, s.
    pub first_tau_s: Option<f64>,
    /// From which the parameters are.
    pub samples: usize,
}

/// One axis as read and as identified.
#[derive(Clone, Debug)]
pub struct IdentifiedAxis {
    pub measured: AxisCurve,
    /// Samples of the log that are not among those on which the terms were chosen.
    pub left_out: usize,
    /// Of those, the ones that were filled in.
    pub filled: usize,
    pub found: Identified,
    pub temperature: Option<OnTemperature>,
}

/// A fit that one true model in a million has.
const SURELY_MISSED: f64 = 1e-6;

impl Identified {
    /// The fit misses the log surely (p below 10⁻⁶) and by more than is tolerated of a measured log in `compare` and
    /// `replay`: a tenth of the cumulative periodogram, of the methods on curves a factor of 1.3 of the Allan
    /// variance where its own interval does not hold the model's. The second keeps logs that are so long that every
    /// model is seen to be one.
    pub fn missed(&self) -> Option<Check> {
        let (name, effect, tolerated, words) = match self.fit_distance {
            Some(distance) => {
                let words = format!("the cumulative periodogram departs by {} from a straight line", digits(distance));
                ("periodogram_distance", distance, PERIODOGRAM_TOLERANCE, words)
            }
            None => {
                let ratio = self.farthest();
                let words = format!("the Allan variance is up to {} times off", digits(ratio));
                ("variance_ratio", ratio, VARIANCE_RATIO_TOLERANCE, words)
            }
        };
        // not so of a p-value that is not a number: the graphical recipe has none
        (self.fit_p_value < SURELY_MISSED && effect > tolerated).then(|| Check {
            kind: CheckKind::Fit,
            axis: Some(self.params.name.clone()),
            message: format!(
                "{}: the model does not explain the log: {words}, tolerated {} (p = {})",
                self.params.name,
                digits(tolerated),
                digits(self.fit_p_value)
            ),
            numbers: [("p_value", self.fit_p_value), (name, effect), ("tolerated", tolerated)]
                .map(|(name, value)| (name.to_string(), value))
                .into(),
        })
    }

    /// Largest ratio, either way, of the log's Allan variance and the model's, of averaging times that were used and
    /// whose interval does not hold the model's.
    fn farthest(&self) -> f64 {
        let from = self.first_tau_s.unwrap_or(0.0);
        let ratio = |point: &AllanPoint| {
            let model = self.model.allan_variance(point.m, self.curve.dt);
            let outside = point.lower.powi(2) > model || point.upper.powi(2) < model;
            let ratio = point.deviation.powi(2) / model;
            if outside { ratio.max(1.0 / ratio) } else { 1.0 }
        };
        self.curve.points.iter().filter(|point| point.tau_s >= from).map(ratio).fold(1.0, f64::max)
    }
}

#[derive(Clone, Debug, thiserror::Error)]
#[error("{message}")]
pub struct IdentifyError {
    pub message: String,
}

/// Largest upper/lower ratio of a 95 % interval that still says something.
const WIDEST_INTERVAL: f64 = 10.0;
/// A random walk and a Gauss-Markov process differ in nearly all logs of this many correlation times, in three
/// quarters and more of those half as long (docs/validation.md).
const LENGTHS_TO_TELL: f64 = 40.0;

/// A log so many times as long is nothing to recommend.
const MOST_LENGTHS: f64 = 100.0;

/// The length of a log that would tell, if anybody would record it; `span_s`: of the one at hand.
fn worth_recording(needed_s: f64, span_s: f64) -> Option<f64> {
    (needed_s > span_s && needed_s < MOST_LENGTHS * span_s).then_some(needed_s)
}

/// Fewest samples from which anything is identified: three averages of ten samples.
pub const FEWEST_SAMPLES: usize = 30;

/// Identify one axis. `rate` SI, contiguous, finite; `dt` in s; `display` the unit of the log, in whose family
/// results are written.
///
/// Fails on fewer than 30 samples, on samples that are not finite and on a constant axis.
pub fn identify_axis(
    name: &str,
    rate: &[f64],
    dt: f64,
    display: &Unit,
    method: Method,
    choice: &ModelChoice,
) -> Result<Identified, IdentifyError> {
    let found = match method {
        Method::Graphical => graphical::identify(name, rate, dt, display),
        Method::Allan => allan_fit::identify(name, rate, dt, display, choice, Distance::CubeRoots),
        Method::Gmwm => allan_fit::identify(name, rate, dt, display, choice, Distance::Variances),
        Method::Likelihood => {
            let whole = [vec![Stretch { missing: 0, samples: rate }]];
            likelihood::identify(name, &[rate], &whole, dt, display, choice, &[])
        }
    };
    Ok(found?.with_tails(&[rate], dt))
}

/// The same by maximum likelihood from logs with gaps, or from several logs of one sensor, each with its own bias.
///
/// `stretches`: of each log samples without gaps; on those of them that have the most samples when they are cut to
/// one length the terms are chosen. `logs` are all samples, stretch by stretch. `holds`: parameters that keep a
/// value.
pub fn identify_logs(
    name: &str,
    stretches: &[&[f64]],
    logs: &[Vec<Stretch<'_>>],
    dt: f64,
    display: &Unit,
    choice: &ModelChoice,
    holds: &[Hold],
) -> Result<Identified, IdentifyError> {
    Ok(likelihood::identify(name, stretches, logs, dt, display, choice, holds)?
        .with_tails(stretches, dt)
        .with_spread(stretches))
}

/// Parses `auto` or `white+gm+…`; white noise is part of every model.
pub fn parse_model(text: &str) -> Result<ModelChoice, IdentifyError> {
    if text.trim() == "auto" {
        return Ok(ModelChoice::Auto);
    }
    let failed = |message: String| IdentifyError { message: format!("`model` {text}: {message}") };
    let known = || Kind::ALL.map(Kind::short_name).join(", ");
    let mut kinds = Vec::new();
    let (mut average, mut order) = (None, None);
    for part in text.split('+').map(str::trim) {
        let name = match part.find(|c: char| c.is_ascii_digit()).map(|at| part.split_at(at)) {
            Some(("ma", number)) => {
                let found = (2..=likelihood::LONGEST_AVERAGE).find(|samples| number == samples.to_string());
                let expected = || format!("'{part}': an average is over 2 to {} samples", likelihood::LONGEST_AVERAGE);
                average = Some(found.ok_or_else(|| failed(expected()))?);
                "ma"
            }
            Some(("bl", number)) => {
                let found = (1..=likelihood::MOST_POLES).find(|poles| number == poles.to_string());
                let expected = || format!("'{part}': a band limit has 1 to {} poles", likelihood::MOST_POLES);
                order = Some(found.ok_or_else(|| failed(expected()))?);
                "bl"
            }
            _ => part,
        };
        let kind = Kind::named(name)
            .ok_or_else(|| failed(format!("unknown term '{part}'; known are {} (joined by +), or auto", known())))?;
        if !matches!(kind, Kind::GaussMarkov | Kind::Oscillation) && kinds.contains(&kind) {
            return Err(failed(match kind {
                Kind::BandLimit => format!("'{part}': a model has one band limit at most"),
                Kind::MovingAverage => format!("'{part}': a model has one average at most"),
                _ => format!("'{part}' stands twice; only gm and osc may"),
            }));
        }
        kinds.push(kind);
    }
    if kinds.iter().filter(|k| **k == Kind::GaussMarkov).count() > 3 {
        return Err(failed("more than three gm cannot be told apart in an Allan curve".into()));
    }
    if kinds.contains(&Kind::BandLimit) && (kinds.contains(&Kind::MovingAverage) || kinds.contains(&Kind::Quantization))
    {
        return Err(failed("bl has averages and quantization in itself: leave them out".into()));
    }
    if !kinds.contains(&Kind::White) && !kinds.contains(&Kind::BandLimit) {
        return Err(failed("white must be part of the model, or bl: every sampled sensor has it".into()));
    }
    kinds.sort_unstable();
    Ok(ModelChoice::Terms { kinds, average, order })
}

/// The samples can be worked with.
fn usable(name: &str, rate: &[f64]) -> Result<(), IdentifyError> {
    let failed = |message: String| Err(IdentifyError { message: format!("{name}: {message}") });
    if rate.len() < FEWEST_SAMPLES {
        return failed(format!(
            "{} samples are too few to identify noise: at least {FEWEST_SAMPLES} are needed",
            rate.len()
        ));
    }
    if let Some(index) = rate.iter().position(|x| !x.is_finite()) {
        return failed(format!("sample {index} is not finite: cut the log with `start`/`end`"));
    }
    if rate.iter().all(|x| *x == rate[0]) {
        return failed(format!(
            "constant ({} in SI units, {} samples): a sensor that says the same all the time has no noise to identify; \
             check the column, or name the others with `columns`",
            digits(rate[0]),
            rate.len()
        ));
    }
    Ok(())
}

/// The unit of a term's coefficient in the family of the log's unit.
fn coefficient_unit(kind: Kind, display: &Unit) -> Unit {
    display.times_time(kind.half_seconds())
}

/// Of a random walk that was not seen.
fn would_have_shown(limit: Option<&Measured>) -> String {
    let of = |m: &Measured| format!("; a random walk above {} {} would have shown (95 %)", digits(m.value), m.unit);
    limit.map_or_else(String::new, of)
}

/// A term as documented, with the 95 % intervals (SI) of its parameters as far as they are known, in the order of
/// [`Term`].
fn entry(term: &Term, intervals: &[Option<[f64; 2]>], display: &Unit) -> Result<TermEntry, IdentifyError> {
    let unit = coefficient_unit(term.kind(), display);
    let interval = |index: usize| intervals.get(index).copied().flatten();
    let coefficient = |value: f64| Measured::from_si(value, interval(0), unit.clone());
    let further = |index: usize, value: f64, unit: &str| {
        let unit = Unit::parse(unit).map_err(|e| IdentifyError { message: e.to_string() })?;
        Ok(Measured { value, unit, interval: interval(index) })
    };
    Ok(match *term {
        Term::Quantization { coefficient: q } => TermEntry::Quantization { coefficient: coefficient(q) },
        Term::White { density } => TermEntry::White { density: coefficient(density) },
        Term::MovingAverage { density, samples } => TermEntry::MovingAverage { density: coefficient(density), samples },
        Term::BandLimit { density, filter } => TermEntry::BandLimit { density: coefficient(density), filter },
        Term::Oscillation { std_dev, frequency_hz, correlation_time } => TermEntry::Oscillation {
            std_dev: coefficient(std_dev),
            frequency: further(1, frequency_hz, "Hz")?,
            correlation_time: further(2, correlation_time, "s")?,
        },
        Term::BiasInstability { coefficient: b } => TermEntry::BiasInstability { coefficient: coefficient(b) },
        Term::GaussMarkov { std_dev, correlation_time } => TermEntry::GaussMarkov {
            std_dev: coefficient(std_dev),
            correlation_time: further(1, correlation_time, "s")?,
        },
        Term::RateRandomWalk { density } => TermEntry::RateRandomWalk { density: coefficient(density) },
        Term::RateRamp { slope } => TermEntry::RateRamp { slope: coefficient(slope) },
    })
}

/// The mean of the log with its 95 % interval for the constant bias; see [`NoiseModel::mean_variance`].
fn bias(mean: f64, samples: usize, dt: f64, model: &NoiseModel, display: &Unit) -> Measured {
    let sigma = model.mean_variance(samples as u64, dt).sqrt();
    let interval = (!model.terms.is_empty()).then_some([mean - 1.96 * sigma, mean + 1.96 * sigma]);
    Measured::from_si(mean, interval, display.times_time(0))
}
