//! A noise model held against a log that it may not come from (floor 5): does it fit, and how much louder is the log?
//!
//! `curve` holds the Allan curve against the envelope that the model draws around its own, `spectrum` the spectrum
//! in bands and as a whole, `innovations` what the model's filter leaves, `means` shows why equal means prove
//! nothing, `parameters` puts a file's numbers beside the log's; `inflation` measures the factor between a bench
//! log's wideband noise and that of a vehicle that vibrates; `designs` ranks filters on logs.

mod curve;
pub mod designs;
pub mod inflation;
mod innovations;
mod means;
pub mod parameters;
mod spectrum;

use rayon::prelude::*;
use schemars::JsonSchema;
use serde::Serialize;

use crate::consistency::{Test, Verdict, effect};
use crate::filter::likelihood::Stretch;
use crate::noise::{Kind, NoiseModel, Term};
use crate::params::{AxisParams, Params};
use crate::replay::axes::{RATE_TOLERANCE, partners};
use crate::units::{Quantity, digits};

pub use curve::AllanEnvelope;
pub use innovations::Innovations;
pub use means::Means;
pub use parameters::Beside;
pub use spectrum::Band;

/// Fewest samples with which anything is compared: three averages of some thirty.
pub const FEWEST_SAMPLES: usize = 100;
/// A drift is seen when it is at least this share of the model's Allan variance at the longest averaging time.
const DRIFT_SHARE: f64 = 0.5;

/// One axis of a log, SI.
#[derive(Clone, Debug)]
pub struct LogAxis {
    pub name: String,
    /// Uniform and finite: what curves and spectra are made of.
    pub rate: Vec<f64>,
    /// How many of `rate` were missing and are filled in.
    pub filled: usize,
    /// Usable samples of the log that are not in `rate`.
    pub left_out: usize,
    /// Piece by piece, how many samples are missing before it, then its samples, of which some may not be finite;
    /// empty where `rate` is all of the log.
    pub whole: Vec<(u64, Vec<f64>)>,
}

impl LogAxis {
    /// All of the log.
    fn pieces(&self) -> Vec<Stretch<'_>> {
        match &self.whole[..] {
            [] => vec![Stretch { missing: 0, samples: &self.rate }],
            whole => whole.iter().map(|(missing, samples)| Stretch { missing: *missing, samples }).collect(),
        }
    }
}

/// A log at rest.
#[derive(Clone, Debug)]
pub struct Log {
    pub quantity: Quantity,
    pub sample_rate_hz: f64,
    pub axes: Vec<LogAxis>,
}

#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CompareError {
    #[error(
        "the log is in {log} but the parameters are for {params}: choose the columns with `columns` or `sensor`, or \
         give the right parameters"
    )]
    Quantity { log: &'static str, params: &'static str },
    #[error(
        "cannot tell which axis is which: the log has {log}, the parameters have {params}; choose with `columns`, in \
         the order of the parameters' axes"
    )]
    Axes { log: String, params: String },
    #[error("axis '{axis}': {message}")]
    Axis { axis: String, message: String },
    #[error("{flag} is {value}, expected {expected}")]
    Option { flag: &'static str, value: f64, expected: String },
}

/// One axis of [`Comparison`], SI units.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct AxisComparison {
    /// Of the parameters.
    pub name: String,
    pub log_axis: String,
    /// Of which curve, spectrum and mean are: the longest stretch without gaps and unusable samples, or a longer one
    /// whose short holes are filled in.
    pub samples: usize,
    pub filled: usize,
    /// Usable samples beside them.
    pub left_out: usize,
    pub allan: AllanEnvelope,
    pub spectrum: Vec<Band>,
    /// Of all samples of the log. Absent when no filter can be built of the model; a note says why.
    pub innovations: Option<Innovations>,
    pub means: Means,
    /// What could not be compared, or only with care.
    pub notes: Vec<String>,
}

/// What `compare` finds.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Comparison {
    /// "kfdesign-compare/1".
    pub format: String,
    pub verdict: Verdict,
    /// The verdict in words.
    pub meaning: String,
    /// Family-wise false-alarm probability.
    pub alpha: f64,
    pub params: Option<String>,
    /// File name and SHA-256 of the log, if it came from a file.
    pub log: Option<String>,
    pub log_sha256: Option<String>,
    pub quantity: Quantity,
    /// Of the log, at which the model is sampled, Hz.
    pub sample_rate: f64,
    pub params_sample_rate: f64,
    pub axes: Vec<AxisComparison>,
    pub tests: Vec<Test>,
    /// With `--parameters`: the file's numbers beside the log's.
    pub parameters: Vec<Beside>,
}

/// Holds the model of every axis against the log; the model is sampled at the log's rate.
///
/// Tests per axis: `allan_curve`, `spectrum_ratio`, `cumulative_spectrum`, and of the model's filter `nis` and
/// `whiteness`; Holm's adjustment over all tests and axes, p-values and effects to a verdict by [`effect::judge`].
/// Inconclusive also when the log is too short to show the model's drift. `alpha` in (0, 1).
///
/// Errors: another quantity, axes that cannot be told apart, a log too short or constant, a line of the model above
/// half the log's rate, no random noise.
pub fn compare(params: &Params, log: &Log, alpha: f64) -> Result<Comparison, CompareError> {
    check_alpha(alpha)?;
    let pairs = paired(params, log)?;
    let simulated = means::simulated(params, log.sample_rate_hz, &pairs)?;
    let found: Vec<(AxisComparison, Vec<Test>)> = pairs
        .par_iter()
        .zip(simulated)
        .map(|((axis, of_log), simulated)| compare_axis(params, axis, of_log, log.sample_rate_hz, simulated, alpha))
        .collect::<Result<_, _>>()?;
    let short: Vec<String> = found
        .iter()
        .zip(&pairs)
        .filter_map(|((axis, _), (of, _))| {
            unseen_drift(&of.noise(), axis.samples, 1.0 / log.sample_rate_hz).map(|s| format!("{}: {s}", axis.name))
        })
        .collect();
    let (axes, tests): (Vec<_>, Vec<_>) = found.into_iter().unzip();
    let mut tests: Vec<Test> = tests.into_iter().flatten().collect();
    let verdict = effect::judge(&mut tests, alpha, short.is_empty());
    Ok(Comparison {
        format: "kfdesign-compare/1".into(),
        verdict,
        meaning: meaning(verdict, alpha, &tests, &axes, &short),
        alpha,
        params: None,
        log: None,
        log_sha256: None,
        quantity: log.quantity,
        sample_rate: log.sample_rate_hz,
        params_sample_rate: params.sample_rate_hz,
        axes,
        tests,
        parameters: Vec::new(),
    })
}

/// A probability of a false alarm is above 0 and below 1.
pub fn check_alpha(alpha: f64) -> Result<(), CompareError> {
    if alpha > 0.0 && alpha < 1.0 {
        return Ok(());
    }
    Err(CompareError::Option { flag: "`alpha`", value: alpha, expected: "between 0 and 1".into() })
}

/// Axes of the parameters with theirs of the log, each fit to be worked with.
fn paired<'a>(params: &'a Params, log: &'a Log) -> Result<Vec<(&'a AxisParams, &'a LogAxis)>, CompareError> {
    if log.quantity != params.quantity {
        return Err(CompareError::Quantity { log: log.quantity.si_unit(), params: params.quantity.si_unit() });
    }
    let wanted: Vec<&str> = params.axes.iter().map(|a| a.name.as_str()).collect();
    let found: Vec<&str> = log.axes.iter().map(|a| a.name.as_str()).collect();
    let assigned = partners(&wanted, &found)
        .ok_or_else(|| CompareError::Axes { log: found.join(", "), params: wanted.join(", ") })?;
    let pairs: Vec<_> = params.axes.iter().zip(assigned.iter().map(|i| &log.axes[*i])).collect();
    for (axis, of_log) in &pairs {
        usable(axis, of_log, 1.0 / log.sample_rate_hz)
            .map_err(|message| CompareError::Axis { axis: of_log.name.clone(), message })?;
    }
    Ok(pairs)
}

fn usable(axis: &AxisParams, log: &LogAxis, dt: f64) -> Result<(), String> {
    let LogAxis { rate, .. } = log;
    if rate.len() < FEWEST_SAMPLES {
        return Err(format!(
            "{} samples without a gap are too few: at least {FEWEST_SAMPLES} are needed; use a longer log",
            rate.len()
        ));
    }
    if rate.iter().all(|x| *x == rate[0]) {
        return Err(format!(
            "constant ({} in SI units, {} samples): a sensor that says the same all the time has no noise to compare; \
             check the column",
            digits(rate[0]),
            rate.len()
        ));
    }
    let model = axis.noise();
    if !model.terms.iter().any(|term| !matches!(term, Term::RateRamp { .. })) {
        return Err(format!(
            "the parameters of '{}' have no random noise term; identify them from a log first",
            axis.name
        ));
    }
    model.check_rate(dt).map_err(|e| e.to_string())
}

fn compare_axis(
    params: &Params,
    axis: &AxisParams,
    log: &LogAxis,
    rate_hz: f64,
    simulated: f64,
    alpha: f64,
) -> Result<(AxisComparison, Vec<Test>), CompareError> {
    let (dt, model, name) = (1.0 / rate_hz, axis.noise(), axis.name.as_str());
    let mut notes = other_rate(params.sample_rate_hz, rate_hz, &model).into_iter().collect::<Vec<String>>();
    notes.extend(of_neighbours(&model, log));
    let (allan, test) = curve::allan_curve(name, &log.rate, dt, &model, alpha)?;
    let mut tests = vec![test];
    let ratios = spectrum::Ratios::new(&log.rate, dt, &model, 0.0);
    let (spectrum, of_spectrum) = spectrum::spectrum(name, &ratios, alpha);
    tests.extend(of_spectrum);
    let innovations = match innovations::innovations(params.quantity, rate_hz, axis, log, alpha) {
        Ok((innovations, of_filter)) => {
            tests.extend(of_filter);
            Some(innovations)
        }
        Err(error) => {
            notes.push(format!("innovations are not tested: {error}"));
            None
        }
    };
    let means = means::means(axis, &model, &log.rate, dt, simulated, params.quantity);
    let comparison = AxisComparison {
        name: name.into(),
        log_axis: log.name.clone(),
        samples: log.rate.len(),
        filled: log.filled,
        left_out: log.left_out,
        allan,
        spectrum,
        innovations,
        means,
        notes,
    };
    Ok((comparison, tests))
}

/// What is filled in follows its neighbours in level alone: what that changes.
fn of_neighbours(model: &NoiseModel, log: &LogAxis) -> Option<String> {
    let tied =
        |kind: Kind| matches!(kind, Kind::MovingAverage | Kind::BandLimit | Kind::Oscillation | Kind::Quantization);
    (log.filled > 0 && model.terms.iter().any(|term| tied(term.kind()))).then(|| {
        format!(
            "{} % of the samples are filled in and are not tied to their neighbours as averages, lines and \
             quantisation are: differences where the model has little power may come from that; \
             nis and whiteness are of the samples that are there",
            digits(100.0 * log.filled as f64 / log.rate.len() as f64)
        )
    })
}

/// What another sample rate changes: terms that count samples are other processes at another rate, all others are
/// continuous.
fn other_rate(params_hz: f64, log_hz: f64, model: &NoiseModel) -> Option<String> {
    if (log_hz / params_hz - 1.0).abs() <= RATE_TOLERANCE {
        return None;
    }
    let consequence = match model.of_samples() {
        None => "every term is continuous and is sampled at the log's rate".into(),
        Some(counted) => format!(
            "{counted} belongs to the samples and is another process at another rate: differences at high frequencies \
             may come from that"
        ),
    };
    Some(format!("the parameters are for {} Hz, the log has {} Hz: {consequence}", digits(params_hz), digits(log_hz)))
}

/// The log does not show the model's drift: why, with the length that would.
fn unseen_drift(model: &NoiseModel, samples: usize, dt: f64) -> Option<String> {
    let drift = NoiseModel { terms: model.terms.iter().filter(|t| t.kind().is_drift()).copied().collect() };
    let seen = |m: u64| drift.allan_variance(m, dt) >= DRIFT_SHARE * model.allan_variance(m, dt);
    let longest = samples as u64 / 3;
    let grid =
        |last: u64| std::iter::successors(Some(1u64), |m| Some(m + m.div_ceil(8))).take_while(move |m| *m <= last);
    if drift.terms.is_empty() || grid(longest).any(seen) {
        return None;
    }
    let needed = grid(u64::MAX / 16).find(|m| seen(*m)).map_or_else(
        || "the white noise hides it at all averaging times".into(),
        |m| format!("a log of about {} s would show it", digits(3.0 * m as f64 * dt)),
    );
    Some(format!(
        "in {} s the model's drift is less than half of its Allan variance at all averaging times, so it is not \
         tested; {needed}",
        digits(samples as f64 * dt)
    ))
}

/// The verdict in a few sentences, axis by axis.
fn meaning(verdict: Verdict, alpha: f64, tests: &[Test], axes: &[AxisComparison], short: &[String]) -> String {
    let tell = |chosen: &dyn Fn(&Test) -> bool| {
        let said = axes.iter().filter_map(|axis| {
            let own = tests.iter().filter(|t| t.axis == axis.name && chosen(t));
            let sentences: Vec<&str> = own.map(|t| t.meaning.as_str()).collect();
            (!sentences.is_empty()).then(|| format!("{}: {}", axis.name, sentences.join("; ")))
        });
        said.collect::<Vec<_>>().join(". ")
    };
    match verdict {
        Verdict::Inconsistent => tell(&|t| !t.pass()),
        Verdict::Inconclusive if !short.is_empty() => short.join(". "),
        Verdict::Inconclusive => format!(
            "deviations are real but the log is too short to tell whether they matter: {}",
            tell(&|t| effect::is_undecided(t, alpha))
        ),
        Verdict::Consistent => match tests.iter().filter(|t| t.adjusted_p_value < alpha).count() {
            0 => "nothing in the log speaks against the model".into(),
            1 => "one deviation is significant but small, within what is tolerated".into(),
            n => format!("{n} deviations are significant but small, within what is tolerated"),
        },
    }
}
