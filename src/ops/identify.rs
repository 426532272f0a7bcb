//! Noise parameters from a log at rest.

mod checks;
mod temperature;
mod windows;
mod words;

use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use clap::ValueEnum;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::reading::{Reading, note_check};
use super::stretch::{Stretch, stretches};
use crate::allan::AxisCurve;
use crate::allan::wavelet::{self, Level};
use crate::identify::graphical::Step;
use crate::identify::{
    Between, Candidate, Hold, HoldCost, Identified, IdentifiedAxis, Method, ModelChoice, OnTemperature, Precision,
    SharedTime, Tails, TemperatureDocument, TimeProfile, identify_axis, identify_logs, parse_model, recent,
    shared_time,
};
use crate::input::{InputKind, LogOptions, TemperatureColumn};
use crate::numerics::progress::{advance, begin, note};
use crate::params::{Params, Source};
use crate::replay::axes::RATE_TOLERANCE;
use crate::signal::{LogCheck, Recording};
use crate::units::{Quantity, amount, digits};

/// What is identified from which logs.
#[derive(Clone, Debug, clap::Args, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Request {
    /// The log, sensor at rest, of any format that `kfdesign info` reads; several logs of the same sensor, one per
    /// start, also give its turn-on bias
    #[arg(required = true, value_name = "LOG")]
    pub logs: Vec<PathBuf>,
    /// How parameters are taken from the log
    #[arg(long, value_enum, default_value_t = MethodArg::Likelihood)]
    #[serde(default)]
    pub method: MethodArg,
    /// Terms of the model: auto, or white+gm, white+rrw … (terms: white, gm (up to three), rrw, flicker,
    /// quantization, ramp; for likelihood also osc, ma (ma2 … ma64: an average over so many samples) and, in the
    /// place of white, bl (bl1 … bl6: a band limit of so many poles))
    #[arg(long, value_name = "MODEL", default_value = "auto")]
    #[serde(default = "auto")]
    pub model: String,
    /// Keep a parameter at a value while the others are found: gauss_markov.correlation_time=200s, of every axis or of
    /// one (x.gauss_markov.correlation_time=200s); what that costs is said. The terms are chosen without it
    #[arg(long, value_name = "NAME=VALUE")]
    #[serde(default)]
    pub hold: Vec<String>,
    /// Read the log in windows of this length and multiply their likelihoods, for logs too long for memory: 24h, 30min
    /// [default: whole; files above 4 GiB in windows of 10 000 000 samples]
    #[arg(long, value_name = "DURATION", allow_hyphen_values = true)]
    #[serde(default)]
    pub window: Option<String>,
    /// Leave outliers out: samples farther from their surroundings than normal noise goes. Where the rest has tails,
    /// those of Student's t, N holds their variance; where it has none, N is that of the noise without the outliers.
    /// Without this flag N holds the variance of all samples
    #[arg(long, alias = "robust")]
    #[serde(default, alias = "robust")]
    pub without_outliers: bool,
    /// Temperature column, beside whose regression the parameters are shown: name or 1-based number, with the unit
    /// if the header does not say it (temp:degC); `none` reads none [default: found by name]. The parameters written
    /// are those without
    #[arg(long, value_name = "COLUMN")]
    #[serde(default)]
    pub temperature: Option<String>,
    #[command(flatten)]
    #[serde(default)]
    pub reading: Reading,
}

fn auto() -> String {
    "auto".into()
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum MethodArg {
    /// The seed paper's reading of the Allan plot, each step with what it costs
    Graphical,
    /// Weighted fit of the whole Allan curve, terms chosen by score
    Allan,
    /// Maximum likelihood of the whole log, terms chosen by score, with the Cramér-Rao bound
    #[default]
    Likelihood,
    /// Generalised method of wavelet moments: Haar wavelet variances, each weighted by the inverse of its own variance
    Gmwm,
}

impl MethodArg {
    fn method(self) -> Method {
        match self {
            MethodArg::Graphical => Method::Graphical,
            MethodArg::Allan => Method::Allan,
            MethodArg::Likelihood => Method::Likelihood,
            MethodArg::Gmwm => Method::Gmwm,
        }
    }
}

/// What `identify --json` prints.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Document<'a> {
    /// "kfdesign-identify/1".
    format: &'static str,
    /// As written with `-o`.
    params: &'a Params,
    axes: Vec<AxisDocument<'a>>,
    log: Option<&'a LogCheck>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    further_logs: Vec<&'a LogCheck>,
    /// Where every axis has one Gauss-Markov process, by likelihood.
    #[serde(skip_serializing_if = "Option::is_none")]
    shared_correlation_time: Option<SharedTime>,
}

fn is_zero(count: &usize) -> bool {
    *count == 0
}

/// How the parameters of one axis came about.
#[derive(Debug, Serialize, JsonSchema)]
struct AxisDocument<'a> {
    name: &'a str,
    /// Samples from which the parameters are; usable ones of the longest log that had no part in the choice of the
    /// terms; samples that were missing and filled in for that.
    samples: usize,
    left_out: usize,
    #[serde(skip_serializing_if = "is_zero")]
    filled: usize,
    /// Shortest averaging time that an Allan fit used, s.
    #[serde(skip_serializing_if = "Option::is_none")]
    first_tau_s: Option<f64>,
    /// Absent for the graphical recipe.
    fit_p_value: Option<f64>,
    candidates: &'a [Candidate],
    /// Likelihood only.
    #[serde(skip_serializing_if = "<[Precision]>::is_empty")]
    precision: &'a [Precision],
    /// Likelihood only: diffuse ln L of the samples in SI units, by a Kalman filter at these parameters.
    #[serde(skip_serializing_if = "Option::is_none")]
    exact_log_likelihood: Option<f64>,
    steps: &'a [Step],
    warnings: &'a [String],
    /// Where parameters are held: what that costs.
    #[serde(skip_serializing_if = "Option::is_none")]
    hold: Option<&'a HoldCost>,
    /// Likelihood only, where the log has a temperature.
    #[serde(skip_serializing_if = "Option::is_none")]
    temperature: Option<TemperatureDocument<'a>>,
    /// Excess kurtosis of the whitened log, which the intervals of the coefficients know; with --without-outliers the
    /// law of the noise, where it has tails.
    tails: Tails,
    /// Of several logs: whether each parameter is the same in all.
    #[serde(skip_serializing_if = "<[Between]>::is_empty")]
    between_logs: &'a [Between],
    allan: CurveDocument,
    /// Wavelet moments only.
    #[serde(skip_serializing_if = "Option::is_none")]
    wavelet_variance: Option<WaveletDocument>,
}

/// Haar wavelet variances by maximum overlap and the model's, in the square of `unit`.
#[derive(Debug, Serialize, JsonSchema)]
struct WaveletDocument {
    unit: String,
    /// The wavelet of level j is 2^j samples long.
    level: Vec<u32>,
    variance: Vec<f64>,
    lower: Vec<f64>,
    upper: Vec<f64>,
    model: Vec<f64>,
}

/// The measured curve and the model's; in `unit`.
#[derive(Debug, Serialize, JsonSchema)]
struct CurveDocument {
    unit: String,
    tau_s: Vec<f64>,
    deviation: Vec<f64>,
    lower: Vec<f64>,
    upper: Vec<f64>,
    edf: Vec<f64>,
    model: Vec<f64>,
}

/// What is said of the log, or the logs, as a whole.
struct Log {
    name: String,
    quantity: Quantity,
    sample_rate_hz: f64,
    /// Of one log.
    sha256: Option<String>,
    checks: Vec<LogCheck>,
}

impl Log {
    fn warn_of_motion(&self, axis: &str, found: &mut Identified) {
        if self.checks.iter().any(|check| check.moves(axis)) {
            found.warnings.push(
                "the log is not at rest all the time (see the log check): motion counts as drift here; cut it with \
                 `start`/`end`"
                    .into(),
            );
        }
    }
}

/// What was found.
pub struct Done {
    pub params: Params,
    pub axes: Vec<IdentifiedAxis>,
    /// Where every axis has one Gauss-Markov process, by likelihood.
    pub shared: Option<SharedTime>,
    method: Method,
    log: Log,
}

/// Notes say what of the logs is used.
pub fn run(request: &Request) -> anyhow::Result<Done> {
    let (method, model) = (request.method, &request.model);
    let choice = parse_model(model)?;
    if method == MethodArg::Graphical && choice != ModelChoice::Auto {
        bail!(
            "`model` {model}: the graphical recipe has one model (white noise and one Gauss-Markov process); leave \
             `model` out"
        );
    }
    let by_curve = matches!(method, MethodArg::Allan | MethodArg::Gmwm);
    if let Some(reason) = choice.beyond_a_curve().filter(|_| by_curve) {
        bail!("`model` {model}: {reason}");
    }
    if request.logs.len() > 1 && method != MethodArg::Likelihood {
        bail!("{} logs: only `method` likelihood takes more than one", request.logs.len());
    }
    if let Some(hold) = request.hold.first().filter(|_| method != MethodArg::Likelihood) {
        bail!("`hold` {hold}: only `method` likelihood holds parameters");
    }
    let holds = request.hold.iter().map(|text| hold(text)).collect::<anyhow::Result<Vec<Hold>>>()?;
    let mut options = request.reading.options()?;
    options.temperature = match request.temperature.as_deref().map(str::trim) {
        Some("none") => TemperatureColumn::Ignored,
        None if method != MethodArg::Likelihood => TemperatureColumn::Ignored,
        None => TemperatureColumn::Found,
        Some(column) if method == MethodArg::Likelihood => TemperatureColumn::Named(column.into()),
        Some(column) => bail!("`temperature` {column}: only `method` likelihood has a regression on temperature"),
    };
    let (log, axes) = match windows::axes(request, &choice, &holds, &options)? {
        Some(found) => found,
        None => whole(request, &choice, &holds, &options)?,
    };
    let params = Params {
        quantity: log.quantity,
        sample_rate_hz: log.sample_rate_hz,
        axes: axes.iter().map(|a| a.found.params.clone()).collect(),
        design: None,
        source: Some(Source {
            log: Some(request.logs.iter().map(|log| file_name(log)).collect::<Vec<_>>().join(", ")),
            sha256: log.sha256.clone(),
            samples: Some(log.checks.iter().map(|check| check.samples).sum()),
            span_s: Some(log.checks.iter().map(|check| check.span_s).sum()),
            method: Some(method.method().name().into()),
            version: Some(env!("CARGO_PKG_VERSION").into()),
            note: held_note(&request.hold),
            inflation: Vec::new(),
            checks: checks::checks(&log.checks, &axes),
            reading: request.reading.said(),
            between_logs: axes.iter().flat_map(|axis| words::between_logs(&axis.found)).collect(),
        }),
    };
    let profiles: Vec<&TimeProfile> = axes.iter().filter_map(|axis| axis.found.time_profile.as_ref()).collect();
    let shared = (profiles.len() == axes.len()).then(|| shared_time(&profiles)).flatten();
    Ok(Done { params, axes, shared, method: method.method(), log })
}

impl Done {
    /// Of the log, the first of several.
    pub fn name(&self) -> &str {
        &self.log.name
    }

    pub fn document(&self) -> Document<'_> {
        let document = document(&self.params, &self.axes, &self.log, self.method);
        Document { shared_correlation_time: self.shared.clone(), ..document }
    }
}

/// The logs in memory at once.
fn whole(
    request: &Request,
    choice: &ModelChoice,
    holds: &[Hold],
    options: &LogOptions,
) -> anyhow::Result<(Log, Vec<IdentifiedAxis>)> {
    let mut readings = Vec::with_capacity(request.logs.len());
    for log in &request.logs {
        let (recording, check) = crate::input::read(log, options)?;
        note_check(&recording.name, &check);
        readings.push((recording, check));
    }
    for (i, (own, _)) in readings.iter().enumerate() {
        if let Some(same) = readings[..i].iter().position(|(r, _)| r.sha256.is_some() && r.sha256 == own.sha256) {
            let [own, first] = [i, same].map(|i| request.logs[i].display());
            bail!("{own}: the same samples as {first}: a log counts once; name logs of different starts");
        }
    }
    let (recording, _) = &readings[0];
    let log = Log {
        name: recording.name.clone(),
        quantity: recording.quantity,
        sample_rate_hz: recording.sample_rate_hz,
        sha256: recording.sha256.clone().filter(|_| readings.len() == 1),
        checks: readings.iter().map(|(_, check)| check.clone()).collect(),
    };
    let dt = recording.dt();
    let parts = by_axis(&request.logs, &readings, options.kind)?;
    let names: Vec<String> = parts.iter().map(|logs| logs[0].name.clone()).collect();
    if parts.is_empty() {
        bail!("{}: no axis to work on", request.logs[0].display());
    }
    let temperature = temperature::Temperature::new(&readings, options.kind);
    begin("identify", parts.len() as u64);
    // of several errors that of the first axis
    let axes: Vec<anyhow::Result<IdentifiedAxis>> = parts
        .into_par_iter()
        .map(|part| {
            let holds = holds_of(holds, &part[0].name, &names);
            let axis = identify(part, dt, request, &Wanted { choice, holds: &holds }, &log, temperature.as_ref());
            advance(1);
            axis
        })
        .collect();
    let axes: Vec<IdentifiedAxis> = axes.into_iter().collect::<anyhow::Result<_>>()?;
    for AxisCurve { name, note: used, .. } in axes.iter().map(|axis| &axis.measured) {
        if let Some(used) = used {
            note(&format!("  note: {name}: {used}"));
        }
    }
    Ok((log, axes))
}

/// "gauss_markov.correlation_time=200s".
fn hold(text: &str) -> anyhow::Result<Hold> {
    let expected =
        || anyhow::anyhow!("`hold` {text}: expected NAME=VALUE, for example gauss_markov.correlation_time=200s");
    let (parameter, value) = text.split_once('=').ok_or_else(expected)?;
    let (value, unit) = amount(value.trim()).ok_or_else(expected)?.with_context(|| format!("`hold` {text}"))?;
    Ok(Hold { parameter: parameter.trim().into(), value, unit })
}

/// What is held of one axis: what names it, and what names none of the axes.
fn holds_of(holds: &[Hold], axis: &str, axes: &[String]) -> Vec<Hold> {
    let named = |hold: &Hold, axis: &str| {
        hold.parameter.strip_prefix(axis).and_then(|rest| rest.strip_prefix('.')).map(String::from)
    };
    let of = |hold: &Hold| match named(hold, axis) {
        Some(parameter) => Some(Hold { parameter, ..hold.clone() }),
        None => (!axes.iter().any(|other| named(hold, other).is_some())).then(|| hold.clone()),
    };
    holds.iter().filter_map(of).collect()
}

/// That the parameters in the document are not the log's alone.
fn held_note(holds: &[String]) -> Option<String> {
    (!holds.is_empty()).then(|| format!("held: {}", holds.join(", ")))
}

/// What is asked for of an axis.
struct Wanted<'a> {
    choice: &'a ModelChoice,
    holds: &'a [Hold],
}

fn file_name(path: &Path) -> String {
    path.file_name().map_or_else(|| path.display().to_string(), |name| name.to_string_lossy().into_owned())
}

/// The stretches of each axis, one per log; the logs must be of one sensor.
fn by_axis(logs: &[PathBuf], readings: &[(Recording, LogCheck)], kind: InputKind) -> anyhow::Result<Vec<Vec<Stretch>>> {
    let (first, _) = &readings[0];
    let mut all: Vec<Vec<Stretch>> = stretches(first, kind).into_iter().map(|part| vec![part]).collect();
    for (log, (recording, _)) in logs.iter().zip(readings).skip(1) {
        let differs = |what: &str, found: &str, expected: &str| {
            anyhow::anyhow!(
                "{}: {what} {found}, but {} has {expected}: logs of one sensor are needed",
                log.display(),
                logs[0].display()
            )
        };
        if recording.quantity != first.quantity {
            return Err(differs("quantity", recording.quantity.name(), first.quantity.name()));
        }
        let [rate, expected] = [recording, first].map(|r| r.sample_rate_hz);
        if (rate / expected - 1.0).abs() > RATE_TOLERANCE {
            return Err(differs("sample rate", &format!("{} Hz", digits(rate)), &format!("{} Hz", digits(expected))));
        }
        let further = stretches(recording, kind);
        let names =
            |parts: &mut dyn Iterator<Item = &Stretch>| parts.map(|p| p.name.clone()).collect::<Vec<_>>().join(", ");
        let (own, known) = (names(&mut further.iter()), names(&mut all.iter().map(|parts| &parts[0])));
        if own != known {
            return Err(differs("axes", &own, &known));
        }
        all.iter_mut().zip(further).for_each(|(parts, part)| parts.push(part));
    }
    Ok(all)
}

/// `parts`: the stretches of one axis, one per log.
fn identify(
    mut parts: Vec<Stretch>,
    dt: f64,
    request: &Request,
    wanted: &Wanted<'_>,
    log: &Log,
    of_logs: Option<&temperature::Temperature>,
) -> anyhow::Result<IdentifiedAxis> {
    // the integral and the Allan curve want every sample as it was
    if request.method == MethodArg::Likelihood {
        parts.iter_mut().for_each(Stretch::bridge);
    }
    // the first of the longest
    let longest = (0..parts.len()).rev().max_by_key(|i| parts[*i].rate.len()).unwrap_or(0);
    let upsets = words::upset_words(&parts[longest], dt, request.without_outliers);
    let dropped: usize = if request.without_outliers { parts.iter_mut().map(Stretch::drop_outliers).sum() } else { 0 };
    let (part, method) = (&parts[longest], request.method.method());
    let mut found = if method == Method::Likelihood {
        let logs: Vec<_> = parts.iter().map(Stretch::pieces).collect();
        let stretches: Vec<&[f64]> = parts.iter().map(|part| &part.rate[..]).collect();
        identify_logs(&part.name, &stretches, &logs, dt, &part.unit, wanted.choice, wanted.holds)?
    } else {
        identify_axis(&part.name, &part.rate, dt, &part.unit, method, wanted.choice)?
    };
    if request.without_outliers {
        let used = if method == Method::Likelihood { &parts[..] } else { std::slice::from_ref(part) };
        let rates: Vec<&[f64]> = used.iter().map(|part| &part.rate[..]).collect();
        let outliers: Vec<&[usize]> = used.iter().map(|part| &part.outliers[..]).collect();
        found.put_tails_back(&rates, &outliers, dt);
    }
    let changes = found.fitted.as_ref().and_then(|fitted| recent(&part.rate, dt, fitted));
    found.warnings.extend(changes.map(|recent| words::change_words(&recent, part, dt)));
    let temperature = of_logs.zip(found.fitted.as_ref()).map(|(all, fitted)| all.against(fitted, &parts, longest, dt));
    found.params.temperature = temperature.as_ref().and_then(OnTemperature::record);
    if dropped > 0 {
        found.warnings.push(format!("{dropped} outliers were left out"));
    }
    found.warnings.extend(upsets);
    log.warn_of_motion(&part.name, &mut found);
    let part = parts.swap_remove(longest);
    let (curve, fit) = (found.curve.clone(), Ok(found.model.clone()));
    let role = if method == Method::Likelihood { "chooses the terms" } else { "is used" };
    let note = part.left_out_note(role);
    let measured = AxisCurve { name: part.name.clone(), unit: part.unit.clone(), note, curve, fit };
    Ok(IdentifiedAxis { measured, left_out: part.left_out, filled: part.filled, found, temperature })
}

fn wavelets(axis: &IdentifiedAxis) -> WaveletDocument {
    let IdentifiedAxis { measured, found, .. } = axis;
    let unit = &measured.unit;
    let square = |si: f64| unit.from_si(unit.from_si(si));
    let levels = wavelet::levels(&found.curve);
    let all = |of: &dyn Fn(&Level) -> f64| levels.iter().map(|level| square(of(level))).collect();
    WaveletDocument {
        unit: unit.text().into(),
        level: levels.iter().map(|level| level.level).collect(),
        variance: all(&|level| level.variance),
        lower: all(&|level| level.lower),
        upper: all(&|level| level.upper),
        model: all(&|level| wavelet::expected(&found.model, level, found.curve.dt)),
    }
}

fn document<'a>(params: &'a Params, axes: &'a [IdentifiedAxis], log: &'a Log, method: Method) -> Document<'a> {
    let axis = |axis: &'a IdentifiedAxis| {
        let IdentifiedAxis { measured, found, .. } = axis;
        let points = &found.curve.points;
        let unit = &measured.unit;
        CurveDocument {
            unit: unit.text().into(),
            tau_s: points.iter().map(|p| p.tau_s).collect(),
            deviation: points.iter().map(|p| unit.from_si(p.deviation)).collect(),
            lower: points.iter().map(|p| unit.from_si(p.lower)).collect(),
            upper: points.iter().map(|p| unit.from_si(p.upper)).collect(),
            edf: points.iter().map(|p| p.edf).collect(),
            model: points
                .iter()
                .map(|p| unit.from_si(found.model.allan_variance(p.m, found.curve.dt).sqrt()))
                .collect(),
        }
    };
    let axes = axes.iter().map(|a| AxisDocument {
        name: &a.found.params.name,
        samples: a.found.samples,
        left_out: a.left_out,
        filled: a.filled,
        first_tau_s: a.found.first_tau_s,
        fit_p_value: a.found.fit_p_value.is_finite().then_some(a.found.fit_p_value),
        candidates: &a.found.candidates,
        precision: &a.found.precision,
        exact_log_likelihood: a.found.exact_log_likelihood,
        steps: &a.found.steps,
        warnings: &a.found.warnings,
        hold: a.found.hold.as_ref(),
        temperature: a.temperature.as_ref().map(OnTemperature::document),
        tails: a.found.tails,
        between_logs: &a.found.between,
        allan: axis(a),
        wavelet_variance: (method == Method::Gmwm).then(|| wavelets(a)),
    });
    let mut logs = log.checks.iter();
    let log = logs.next();
    Document {
        format: "kfdesign-identify/1",
        params,
        axes: axes.collect(),
        log,
        further_logs: logs.collect(),
        shared_correlation_time: None,
    }
}
