//! `kfdesign identify`.

mod checks;
mod sight;
pub(super) mod tables;
mod temperature;
mod windows;
mod words;

use std::path::{Path, PathBuf};

use anyhow::bail;
use clap::ValueEnum;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::Serialize;

use super::Status;
use super::allan::AxisCurve;
use super::files::{self, Kind};
use super::log_flags::{LogFlags, print_check};
use super::output::{digits, duration, print_json, print_text, progress, say, table};
use super::stretch::{Stretch, stretches};
use crate::allan::wavelet::{self, Level};
use crate::export::atomic;
use crate::identify::graphical::Step;
use crate::identify::{
    Between, Candidate, Identified, Method, ModelChoice, Precision, SharedTime, Tails, TimeProfile, identify_axis,
    identify_logs, parse_model, recent, shared_time,
};
use crate::input::{InputKind, LogOptions, TemperatureColumn};
use crate::params::{NotIdentified, Params, Source};
use crate::replay::axes::RATE_TOLERANCE;
use crate::signal::{LogCheck, Recording};
use crate::units::Quantity;

/// Noise parameters from a log at rest, with intervals
///
/// What the log cannot tell is listed under not_identified with the reason and, where it can be said, the log length that
/// would tell; it is never filled in with a number.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Example: kfdesign identify static.csv --unit deg/s --rate 100 -o params.json --report identify.html"
)]
pub struct Args {
    /// The log, sensor at rest, of any format that `kfdesign info` reads; several logs of the same sensor, one per start, also give its turn-on bias
    #[arg(required = true, value_name = "LOG")]
    logs: Vec<PathBuf>,
    /// The parameters: params.json
    #[arg(short, long, value_name = "FILE.json")]
    output: Option<PathBuf>,
    /// How parameters are taken from the log
    #[arg(long, value_enum, default_value_t = MethodArg::Likelihood)]
    method: MethodArg,
    /// Terms of the model: auto, or white+gm, white+rrw … (terms: white, gm (up to three), rrw, flicker, quantization, ramp; for likelihood
    /// also osc, ma (ma2 … ma64: an average over so many samples) and, in the place of white, bl (bl1 … bl6: a band limit of so many poles))
    #[arg(long, value_name = "MODEL", default_value = "auto")]
    model: String,
    /// Read the log in windows of this length and multiply their likelihoods, for logs too long for memory: 24h, 30min
    /// [default: whole; files above 4 GiB in windows of 10 000 000 samples]
    #[arg(long, value_name = "DURATION", allow_hyphen_values = true)]
    window: Option<String>,
    /// Leave outliers out: samples farther from their surroundings than normal noise goes. Where the rest has tails, those of Student's t, N holds their variance;
    /// where it has none, N is that of the noise without the outliers. Without this flag N holds the variance of all samples
    #[arg(long)]
    robust: bool,
    /// Temperature column, beside whose regression the parameters are shown: name or 1-based number, with the unit if the header does not say it
    /// (temp:degC); `none` reads none [default: found by name]. The parameters written are those without
    #[arg(long, value_name = "COLUMN")]
    temperature: Option<String>,
    /// One HTML page with tables and figures
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    /// Allan curve of every axis with the fitted components
    #[arg(long, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
    /// One JSON document on stdout
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    reading: LogFlags,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum MethodArg {
    /// The seed paper's reading of the Allan plot, each step with what it costs
    Graphical,
    /// Weighted fit of the whole Allan curve, terms chosen by score
    Allan,
    /// Maximum likelihood of the whole log, terms chosen by score, with the Cramér-Rao bound
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

/// Below this p-value the axes have different correlation times.
const SAME_TIME: f64 = 0.01;

/// What `identify --json` prints.
#[derive(Debug, Serialize, JsonSchema)]
pub(super) struct Document<'a> {
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
    /// Samples from which the parameters are; usable ones of the longest log that had no part in the choice of the terms; samples that were missing and filled in for that.
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
    /// Likelihood only, where the log has a temperature.
    #[serde(skip_serializing_if = "Option::is_none")]
    temperature: Option<temperature::Document<'a>>,
    /// Excess kurtosis of the whitened log, which the intervals of the coefficients know; with --robust the law of the noise, where it has tails.
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

/// One axis as read and as identified.
struct Axis {
    measured: AxisCurve,
    /// Samples of the log that are not among those on which the terms were chosen, and how many of these are filled in.
    left_out: usize,
    filled: usize,
    found: Identified,
    warmth: Option<temperature::Shown>,
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
                "the log is not at rest all the time (see the log check): motion counts as drift here; cut it with --start/--end"
                    .into(),
            );
        }
    }
}

pub(super) fn run(args: &Args) -> anyhow::Result<Status> {
    let choice = parse_model(&args.model)?;
    if args.method == MethodArg::Graphical && choice != ModelChoice::Auto {
        bail!(
            "--model {}: the graphical recipe has one model (white noise and one Gauss-Markov process); leave --model out",
            args.model
        );
    }
    let by_curve = matches!(args.method, MethodArg::Allan | MethodArg::Gmwm);
    if let Some(reason) = choice.beyond_a_curve().filter(|_| by_curve) {
        bail!("--model {}: {reason}", args.model);
    }
    if args.logs.len() > 1 && args.method != MethodArg::Likelihood {
        bail!("{} logs: only --method likelihood takes more than one", args.logs.len());
    }
    let outputs =
        [("-o", &args.output, Kind::Json), ("--report", &args.report, Kind::Html), ("--plot", &args.plot, Kind::Svg)];
    files::check(&outputs, &args.logs.iter().map(PathBuf::as_path).collect::<Vec<_>>())?;
    let mut options = args.reading.options()?;
    options.temperature = match args.temperature.as_deref().map(str::trim) {
        Some("none") => TemperatureColumn::Ignored,
        None if args.method != MethodArg::Likelihood => TemperatureColumn::Ignored,
        None => TemperatureColumn::Found,
        Some(column) if args.method == MethodArg::Likelihood => TemperatureColumn::Named(column.into()),
        Some(column) => bail!("--temperature {column}: only --method likelihood has a regression on temperature"),
    };
    let (log, axes) = match windows::axes(args, &choice, &options)? {
        Some(found) => found,
        None => whole(args, &choice, &options)?,
    };
    let params = Params {
        quantity: log.quantity,
        sample_rate_hz: log.sample_rate_hz,
        axes: axes.iter().map(|a| a.found.params.clone()).collect(),
        design: None,
        source: Some(Source {
            log: Some(args.logs.iter().map(|log| file_name(log)).collect::<Vec<_>>().join(", ")),
            sha256: log.sha256.clone(),
            samples: Some(log.checks.iter().map(|check| check.samples).sum()),
            span_s: Some(log.checks.iter().map(|check| check.span_s).sum()),
            method: Some(args.method.method().name().into()),
            version: Some(env!("CARGO_PKG_VERSION").into()),
            note: None,
            inflation: Vec::new(),
            checks: checks::checks(&log.checks, &axes),
            between_logs: axes.iter().flat_map(|axis| words::between_logs(&axis.found)).collect(),
        }),
    };
    if let Some(path) = &args.output {
        atomic::write(path, params.to_json().as_bytes())?;
    }
    if let Some(path) = &args.plot {
        atomic::write(path, sight::sheet(&log.name, &axes).as_bytes())?;
    }
    if let Some(path) = &args.report {
        atomic::write(path, sight::page(&params, &axes)?.as_bytes())?;
    }
    let profiles: Vec<&TimeProfile> = axes.iter().filter_map(|axis| axis.found.time_profile.as_ref()).collect();
    let shared = (profiles.len() == axes.len()).then(|| shared_time(&profiles)).flatten();
    if args.json {
        let document = document(&params, &axes, &log, args.method.method());
        print_json(&Document { shared_correlation_time: shared, ..document })?;
    } else {
        let mut text: Vec<String> = axes.iter().map(|axis| text(axis, params.quantity)).collect();
        text.extend(shared.as_ref().map(shared_words));
        print_text(&text.join("\n"));
    }
    Ok(checks::status(&params, args.output.as_deref()))
}

/// The logs in memory at once.
fn whole(args: &Args, choice: &ModelChoice, options: &LogOptions) -> anyhow::Result<(Log, Vec<Axis>)> {
    let mut readings = Vec::with_capacity(args.logs.len());
    for log in &args.logs {
        let (recording, check) = crate::input::read(log, options)?;
        print_check(&recording.name, &check);
        readings.push((recording, check));
    }
    for (i, (own, _)) in readings.iter().enumerate() {
        if let Some(same) = readings[..i].iter().position(|(r, _)| r.sha256.is_some() && r.sha256 == own.sha256) {
            let [own, first] = [i, same].map(|i| args.logs[i].display());
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
    let parts = by_axis(&args.logs, &readings, options.kind)?;
    if parts.is_empty() {
        bail!("{}: no axis to work on", args.logs[0].display());
    }
    let warmth = temperature::Warmth::new(&readings, options.kind);
    let bar = progress(parts.len() as u64, "identify");
    let axes: Vec<Axis> = parts
        .into_par_iter()
        .map(|part| {
            let axis = identify(part, dt, args, choice, &log, warmth.as_ref());
            bar.inc(1);
            axis
        })
        .collect::<anyhow::Result<_>>()?;
    bar.finish_and_clear();
    for AxisCurve { name, note, .. } in axes.iter().map(|axis| &axis.measured) {
        if let Some(note) = note {
            say(&format!("  note: {name}: {note}"));
        }
    }
    Ok((log, axes))
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
    args: &Args,
    choice: &ModelChoice,
    log: &Log,
    warmth: Option<&temperature::Warmth>,
) -> anyhow::Result<Axis> {
    // the integral and the Allan curve want every sample as it was
    if args.method == MethodArg::Likelihood {
        parts.iter_mut().for_each(Stretch::bridge);
    }
    // the first of the longest
    let longest = (0..parts.len()).rev().max_by_key(|i| parts[*i].rate.len()).unwrap_or(0);
    let upsets = words::upset_words(&parts[longest], dt, args.robust);
    let dropped: usize = if args.robust { parts.iter_mut().map(Stretch::drop_outliers).sum() } else { 0 };
    let (part, method) = (&parts[longest], args.method.method());
    let mut found = if method == Method::Likelihood {
        let logs: Vec<_> = parts.iter().map(Stretch::pieces).collect();
        let stretches: Vec<&[f64]> = parts.iter().map(|part| &part.rate[..]).collect();
        identify_logs(&part.name, &stretches, &logs, dt, &part.unit, choice)?
    } else {
        identify_axis(&part.name, &part.rate, dt, &part.unit, method, choice)?
    };
    if args.robust {
        let used = if method == Method::Likelihood { &parts[..] } else { std::slice::from_ref(part) };
        let rates: Vec<&[f64]> = used.iter().map(|part| &part.rate[..]).collect();
        let outliers: Vec<&[usize]> = used.iter().map(|part| &part.outliers[..]).collect();
        found.put_tails_back(&rates, &outliers, dt);
    }
    let changes = found.fitted.as_ref().and_then(|fitted| recent(&part.rate, dt, fitted));
    found.warnings.extend(changes.map(|recent| words::change_words(&recent, part, dt)));
    let warmth = warmth.zip(found.fitted.as_ref()).map(|(warmth, fitted)| warmth.shown(fitted, &parts, longest, dt));
    found.params.temperature = warmth.as_ref().and_then(temperature::Shown::record);
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
    Ok(Axis { measured, left_out: part.left_out, filled: part.filled, found, warmth })
}

fn wavelets(axis: &Axis) -> WaveletDocument {
    let Axis { measured, found, .. } = axis;
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

fn document<'a>(params: &'a Params, axes: &'a [Axis], log: &'a Log, method: Method) -> Document<'a> {
    let axis = |axis: &'a Axis| {
        let Axis { measured, found, .. } = axis;
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
        temperature: a.warmth.as_ref().map(temperature::Shown::document),
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

/// Whether the axes have one correlation time.
fn shared_words(shared: &SharedTime) -> String {
    let limit = |limit: Option<f64>| limit.map_or("open".into(), digits);
    format!(
        "One correlation time for all axes: {} s ({} … {}); likelihood ratio {}, p = {}: {}\n",
        digits(shared.correlation_time_s),
        limit(shared.lower_s),
        limit(shared.upper_s),
        digits(shared.likelihood_ratio),
        digits(shared.p_value),
        if shared.p_value < SAME_TIME { "the axes differ" } else { "the log does not tell the axes apart" }
    )
}

const STEPS: [&str; 4] = ["step", "formula", "value", "unit"];

/// Everything a person wants to see of one axis.
fn text(axis: &Axis, quantity: Quantity) -> String {
    let parameters = tables::parameters(axis, quantity);
    let mut out = format!("{}\n{}", headline(axis), table(parameters.header, &parameters.rows));
    if let Some(candidates) = tables::candidates(&axis.found.candidates) {
        out += &format!("\n{}:\n{}", candidates.caption, table(candidates.header, &candidates.rows));
    }
    if !axis.found.steps.is_empty() {
        out += &format!("\nThe recipe, step by step:\n{}", table(&STEPS, &step_rows(&axis.found.steps)));
        out += "What each step costs:\n";
        for sentence in costs(&axis.found.steps) {
            out += &format!("  {sentence}\n");
        }
    }
    if let Some(warmth) = &axis.warmth {
        out += &format!("\n{}\n", warmth.sentences().join("\n"));
        if let Some(pairs) = warmth.table() {
            out += &format!("{}:\n{}", pairs.caption, table(pairs.header, &pairs.rows));
        }
    }
    if !axis.found.between.is_empty() {
        let each = axis.found.between.iter().map(|own| format!("{} p = {}", own.parameter, digits(own.p_value)));
        out += &format!("\nWhether the logs are alike: {}\n", each.collect::<Vec<_>>().join(", "));
    }
    if !axis.found.not_identified.is_empty() {
        out += "\nNot identified:\n";
        for sentence in axis.found.not_identified.iter().map(not_identified) {
            out += &format!("  {sentence}\n");
        }
    }
    for warning in &axis.found.warnings {
        out += &format!("warning: {warning}\n");
    }
    out
}

/// "gyro_x: white+gm, 720000 samples in 2 h".
fn headline(axis: &Axis) -> String {
    let found = &axis.found;
    let samples = found.samples;
    let span = duration(samples as f64 * found.curve.dt);
    match found.candidates.iter().find(|c| c.chosen) {
        Some(chosen) => {
            let used = match found.first_tau_s {
                Some(tau) => format!(", averaging times from {} s", digits(tau)),
                None => String::new(),
            };
            let (name, p) = (&found.params.name, digits(found.fit_p_value));
            format!("{name}: {} from {samples} samples ({span}); fit p = {p}{used}", chosen.model)
        }
        None => format!("{}: the graphical recipe on {samples} samples ({span})", found.params.name),
    }
}

fn step_rows(steps: &[Step]) -> Vec<Vec<String>> {
    let row = |s: &Step| {
        let value = s.value.map_or("-".to_string(), digits);
        vec![s.what.clone(), s.formula.clone(), value, s.unit.clone()]
    };
    steps.iter().map(row).collect()
}

fn costs(steps: &[Step]) -> Vec<String> {
    steps.iter().map(|s| format!("{}: {}", s.what, s.cost)).collect()
}

fn not_identified(entry: &NotIdentified) -> String {
    let needed =
        entry.needed_log_s.map_or_else(String::new, |s| format!("; a log of about {} would tell", duration(s)));
    format!("{}: {}{needed}", entry.term, entry.reason)
}
