//! The numbers of a file beside those that a log gives, one by one.
//!
//! The log is identified by maximum likelihood with terms of its own choice. A file's white noise is held against
//! all white noise of the log at low frequencies, a walk that is its only drift against the growth of the log's
//! drift over short times, √(K² + Σ 2σ²/Tc), which is what such a walk stands for; what else the log's model has
//! not, against a fit of the file's own terms.

use rayon::prelude::*;
use schemars::JsonSchema;
use serde::Serialize;

use super::{CompareError, Log, LogAxis, paired};
use crate::identify::{Identified, ModelChoice, Sum, counts_as_white, identify_logs};
use crate::noise::{Kind, Term};
use crate::params::{AxisParams, Measured, Params, TermEntry};
use crate::units::{Unit, digits};

/// One number of a file, and of the log.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Beside {
    /// Of the parameters.
    pub axis: String,
    /// As in params.json; `wideband.density` is that of white, moving_average and band_limit together, where the
    /// file has one of the latter two.
    pub parameter: String,
    /// Of the values: that of the file.
    pub unit: String,
    pub file: f64,
    /// Absent when the log does not tell.
    pub log: Option<f64>,
    /// 95 %, of this parameter alone; an open end is null.
    #[schemars(with = "Option<[Option<f64>; 2]>")]
    pub interval: Option<[f64; 2]>,
    /// file/log.
    pub ratio: Option<f64>,
    /// Whether the file's value is in the interval.
    pub inside: Option<bool>,
    /// What of the log it is held against.
    pub how: String,
    /// In a sentence.
    pub meaning: String,
}

/// Fewest and most Gauss-Markov processes that a log can be asked for.
const MOST_PROCESSES: usize = 3;

/// Every noise parameter of every axis beside its estimate; `display`: unit of the log. Errors: as
/// [`super::compare`], and a log that cannot be identified.
pub fn parameters(params: &Params, log: &Log, display: &Unit) -> Result<Vec<Beside>, CompareError> {
    let dt = 1.0 / log.sample_rate_hz;
    let pairs = paired(params, log)?;
    let found: Vec<Vec<Beside>> =
        pairs.par_iter().map(|(axis, of_log)| of_axis(axis, of_log, dt, display)).collect::<Result<_, _>>()?;
    Ok(found.into_iter().flatten().collect())
}

/// What the log says about one parameter.
struct Estimate {
    value: f64,
    interval: Option<[f64; 2]>,
    how: String,
}

fn of_axis(axis: &AxisParams, log: &LogAxis, dt: f64, display: &Unit) -> Result<Vec<Beside>, CompareError> {
    let identify = |choice: &ModelChoice| {
        let found = identify_logs(&axis.name, &[&log.rate], &[log.pieces()], dt, display, choice, &[]);
        found.map_err(|e| CompareError::Axis { axis: log.name.clone(), message: e.to_string() })
    };
    let mut file = axis.clone();
    file.terms.sort_by(|a, b| time(a).total_cmp(&time(b)));
    let found = identify(&ModelChoice::Auto)?;
    let kinds = kinds(&file);
    // only where something of the file is not in the log's model
    let mut own: Option<Option<Identified>> = None;
    let drifts: Vec<&TermEntry> = file.terms.iter().filter(|t| t.to_term().kind().is_drift()).collect();
    let walk_only = matches!(drifts[..], [TermEntry::RateRandomWalk { .. }]);
    let mut rows = Vec::new();
    if let Some((value, unit)) = white(&file, dt) {
        let estimate = found.sums.white.map(|sum| of_sum(sum, format!("white noise of {}", label(&found))));
        let plain = file.terms.iter().all(|t| t.wideband_density().is_none() || matches!(t, TermEntry::White { .. }));
        let path = if plain { "white.density" } else { "wideband.density" };
        rows.push(beside(&file.name, path, unit.from_si(value), &unit, estimate, String::new()));
    }
    let paths: Vec<(String, Measured)> = file
        .clone()
        .noise_parameters()
        .filter(|(path, _)| !["white", "moving_average", "band_limit"].iter().any(|kind| path.starts_with(kind)))
        .map(|(path, value)| (path, value.clone()))
        .collect();
    for (path, value) in paths {
        let mut estimate = match found.sums.walk.filter(|_| walk_only) {
            Some(sum) => Some(of_sum(sum, walk_words(&found))),
            None => of_path(&file, &found, &path),
        };
        let mut reason = String::new();
        if estimate.is_none() {
            let fitted = match &own {
                Some(fitted) => fitted,
                None => own.insert(
                    kinds
                        .clone()
                        .map(|kinds| identify(&ModelChoice::Terms { kinds, average: None, order: None }))
                        .transpose()?,
                ),
            };
            estimate = fitted.as_ref().and_then(|fitted| of_path(&file, fitted, &path)).map(|own| Estimate {
                how: format!("{}, asked for; the log chooses {}", own.how, label(&found)),
                ..own
            });
            reason = fitted.as_ref().map_or_else(String::new, |fitted| unknown(fitted, &path));
        }
        rows.push(beside(&file.name, &path, value.value, &value.unit, estimate, reason));
    }
    Ok(rows)
}

/// Gauss-Markov processes in the order in which identified ones stand.
fn time(term: &TermEntry) -> f64 {
    match term.to_term() {
        Term::GaussMarkov { correlation_time, .. } => correlation_time,
        _ => 0.0,
    }
}

/// All that counts as white noise, at low frequencies, SI, with the unit of the first.
fn white(file: &AxisParams, dt: f64) -> Option<(f64, Unit)> {
    let unit = file.terms.iter().find_map(TermEntry::wideband_density)?.unit.clone();
    let square: f64 = file.noise().terms.iter().filter(|t| counts_as_white(t, dt)).map(|t| t.psd(0.0, dt)).sum();
    Some((square.sqrt(), unit))
}

/// Of the file's terms, as a log can be asked for them; white noise is part of every model.
fn kinds(file: &AxisParams) -> Option<Vec<Kind>> {
    let mut kinds: Vec<Kind> = file.terms.iter().map(|term| term.to_term().kind()).collect();
    kinds.push(Kind::White);
    kinds.sort_unstable();
    let processes = kinds.iter().filter(|kind| **kind == Kind::GaussMarkov).count();
    kinds.dedup_by(|a, b| a == b && !matches!(a, Kind::GaussMarkov | Kind::Oscillation));
    (processes <= MOST_PROCESSES).then_some(kinds)
}

/// "white+gm".
fn label(found: &Identified) -> &str {
    found.candidates.iter().find(|c| c.chosen).map_or("no model", |c| c.model.as_str())
}

fn of_sum(sum: Sum, how: String) -> Estimate {
    Estimate { value: sum.value, interval: sum.interval, how }
}

fn walk_words(found: &Identified) -> String {
    let walk = matches!(
        found.model.terms.iter().filter(|t| t.kind().is_drift()).collect::<Vec<_>>()[..],
        [Term::RateRandomWalk { .. }]
    );
    if walk {
        format!("random walk of {}", label(found))
    } else {
        format!("growth over short times of {}, sqrt(K^2 + sum 2 sigma^2/Tc)", label(found))
    }
}

/// The same parameter of a model with as many terms of the kind.
fn of_path(file: &AxisParams, found: &Identified, path: &str) -> Option<Estimate> {
    let kind = |path: &str| path.split(['.', '[']).next().unwrap_or_default().to_owned();
    let count =
        |axis: &AxisParams| axis.clone().noise_parameters().filter(|(other, _)| kind(other) == kind(path)).count();
    if count(file) != count(&found.params) {
        return None;
    }
    let mut params = found.params.clone();
    let (_, value) = params.noise_parameters().find(|(other, _)| other == path)?;
    Some(Estimate {
        value: value.si(),
        interval: value.interval_si(),
        how: format!("{} of {}", kind(path), label(found)),
    })
}

/// Why a fit does not tell.
fn unknown(fitted: &Identified, path: &str) -> String {
    let said = fitted.not_identified.iter().find(|n| path.starts_with(&n.term) || n.term.starts_with(path));
    said.map_or_else(String::new, |n| format!(": {}", n.reason))
}

fn beside(axis: &str, path: &str, file: f64, unit: &Unit, estimate: Option<Estimate>, reason: String) -> Beside {
    let symbol = symbol(path);
    let said = format!("{axis}: your file says {symbol} = {} {unit}", digits(file));
    let row = Beside {
        axis: axis.into(),
        parameter: path.into(),
        unit: unit.to_string(),
        file,
        log: None,
        interval: None,
        ratio: None,
        inside: None,
        how: String::new(),
        meaning: format!("{said}; this log does not tell{reason}"),
    };
    let Some(Estimate { value, interval, how }) = estimate else { return row };
    let (log, interval) = (unit.from_si(value), interval.map(|ends| ends.map(|end| unit.from_si(end))));
    let inside = interval.map(|[low, high]| (low..=high).contains(&file));
    let shown = match interval {
        None => "no interval".into(),
        Some([low, high]) if !high.is_finite() => format!("above {}", digits(low)),
        Some([low, high]) => format!("{} … {}", digits(low), digits(high)),
    };
    let verdict = match inside {
        None => "this log does not bound it",
        Some(true) => "inside",
        Some(false) if path.ends_with("correlation_time") && file > log => "outside: longer than this log shows",
        Some(false) if path.ends_with("correlation_time") => "outside: shorter than this log shows",
        Some(false) if file > log => "outside: the file claims more than this log shows",
        Some(false) => "outside: the file claims less than this log shows",
    };
    let meaning = format!("{said}; this log says {} [{shown}]: {} times, {verdict}", digits(log), digits(file / log));
    Beside { log: Some(log), interval, ratio: Some(file / log), inside, how, meaning, ..row }
}

/// The letter of a parameter.
fn symbol(path: &str) -> &str {
    match path {
        "white.density" | "wideband.density" => "N",
        "rate_random_walk.density" => "K",
        "gauss_markov.std_dev" => "sigma",
        "gauss_markov.correlation_time" => "Tc",
        "bias_instability.coefficient" => "B",
        "quantization.coefficient" => "Q",
        "rate_ramp.slope" => "R",
        other => other,
    }
}
