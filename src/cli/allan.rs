//! `kfdesign allan`.

mod windows;

use std::path::PathBuf;

use anyhow::{Context, bail};
use clap::ValueEnum;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::Serialize;

use super::Status;
use super::files::{self, Kind};
use super::log_flags::{LogFlags, print_check};
use super::output::{digits, print_json, print_text, progress, say, table};
use super::stretch::{Stretch, into_stretches};
use crate::allan::{self, AllanCurve, Deviation, NoiseType, TauGrid};
use crate::export::atomic;
use crate::identify::{self, Method, ModelChoice};
use crate::input::LogOptions;
use crate::noise::NoiseModel;
use crate::report;
use crate::signal::LogCheck;
use crate::units::{Quantity, Unit};

/// Allan deviations of a log, with intervals and noise identification
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Log at rest: csv, txt, gz or npy
    log: PathBuf,
    /// Which deviation
    #[arg(long, value_enum, default_value_t = DeviationArg::Oadev)]
    deviation: DeviationArg,
    /// Averaging times: octave, decade (1, 2, 4, 10 …), log:N (N per decade), log (20 per decade) or all
    #[arg(long, value_parser = parse_grid, default_value = "octave", value_name = "GRID")]
    taus: TauGrid,
    /// One JSON document on stdout
    #[arg(long)]
    json: bool,
    /// SVG figure with interval band and fitted components
    #[arg(long, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
    /// The JSON document into a file
    #[arg(short, long, value_name = "FILE.json")]
    output: Option<PathBuf>,
    /// Read the log in windows of this length and average their squares, for logs too long for memory: 24h, 30min
    /// [default: whole; files above 4 GiB in windows of 10 000 000 samples]
    #[arg(long, value_name = "DURATION", allow_hyphen_values = true)]
    window: Option<String>,
    #[command(flatten)]
    reading: LogFlags,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum DeviationArg {
    /// Allan deviation, differences that do not overlap
    Adev,
    /// Overlapping Allan deviation
    Oadev,
    /// Modified Allan deviation
    Mdev,
    /// Hadamard deviation, differences that do not overlap
    Hdev,
    /// Overlapping Hadamard deviation
    Ohdev,
    /// Total deviation
    Totdev,
}

impl DeviationArg {
    fn kind(self) -> Deviation {
        match self {
            DeviationArg::Adev => Deviation::Adev,
            DeviationArg::Oadev => Deviation::Oadev,
            DeviationArg::Mdev => Deviation::Mdev,
            DeviationArg::Hdev => Deviation::Hdev,
            DeviationArg::Ohdev => Deviation::Ohdev,
            DeviationArg::Totdev => Deviation::Totdev,
        }
    }
}

fn parse_grid(text: &str) -> Result<TauGrid, String> {
    match text {
        "octave" => Ok(TauGrid::Octave),
        "decade" => Ok(TauGrid::Decade),
        "all" => Ok(TauGrid::All),
        "log" => Ok(TauGrid::Log(20)),
        _ => text
            .strip_prefix("log:")
            .and_then(|count| count.parse().ok())
            .filter(|count| (1..=1000).contains(count))
            .map(TauGrid::Log)
            .ok_or_else(|| "expected octave, decade, all, log or log:N with N from 1 to 1000".into()),
    }
}

/// What `allan --json` prints.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Document {
    /// "kfdesign-allan/1".
    pub format: &'static str,
    pub deviation: Deviation,
    pub quantity: Quantity,
    pub sample_rate: SampleRate,
    pub axes: Vec<AxisDocument>,
    pub log: LogCheck,
}

#[derive(Debug, Serialize, JsonSchema)]
pub struct SampleRate {
    pub value: f64,
    pub unit: &'static str,
}

/// The curve of one axis; all lists have one entry per averaging time.
#[derive(Debug, Serialize, JsonSchema)]
pub struct AxisDocument {
    pub name: String,
    /// Unit of deviation, lower and upper: that of the log.
    pub unit: String,
    /// Samples used: the longest stretch without gaps and unusable samples, or those of one window.
    pub samples: usize,
    /// Windows of that many samples whose squares were averaged, where the log was read in windows.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub windows: Option<u64>,
    pub tau_s: Vec<f64>,
    pub deviation: Vec<f64>,
    /// 95 % interval.
    pub lower: Vec<f64>,
    pub upper: Vec<f64>,
    pub edf: Vec<f64>,
    /// Differences averaged.
    pub terms: Vec<u64>,
    pub noise: Vec<NoiseType>,
    /// Where the degrees of freedom come from.
    pub intervals: Intervals,
    /// The fitted mixture, if there is one: kinds of its terms.
    pub model: Option<String>,
}

/// Where the degrees of freedom come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Intervals {
    /// Exact for the mixture fitted to the log (TOTDEV: published formula for the law that dominates).
    FittedMixture,
    /// For the power law identified at each point: no mixture could be fitted.
    PowerLaw,
}

/// One axis, SI.
pub(super) struct AxisCurve {
    pub(super) name: String,
    /// Of the rate, in the spelling of the log.
    pub(super) unit: Unit,
    /// What of the log was used, where it was not the whole of it in one piece.
    pub(super) note: Option<String>,
    pub(super) curve: AllanCurve,
    /// The fitted mixture or why there is none.
    pub(super) fit: Result<NoiseModel, String>,
}

/// What is said of the log as a whole.
struct Header {
    name: String,
    quantity: Quantity,
    sample_rate_hz: f64,
    check: LogCheck,
}

pub(super) fn run(args: &Args) -> anyhow::Result<Status> {
    files::check(&[("-o", &args.output, Kind::Json), ("--plot", &args.plot, Kind::Svg)], &[&args.log])?;
    let options = LogOptions { no_digest: true, ..args.reading.options()? };
    let (header, axes) = match windows::axes(args, &options)? {
        Some(found) => found,
        None => whole(args, &options)?,
    };
    if axes.is_empty() {
        bail!("{}: no axis to work on", args.log.display());
    }
    for axis in &axes {
        notes(axis);
    }
    let name = header.name.clone();
    let document = document(&axes, args.deviation.kind(), header);
    if let Some(path) = &args.output {
        let mut text = serde_json::to_string_pretty(&document)?;
        text.push('\n');
        atomic::write(path, text.as_bytes())?;
    }
    if let Some(path) = &args.plot {
        atomic::write(path, sheet(&name, &axes).as_bytes())?;
    }
    if args.json {
        print_json(&document)?;
    } else {
        let text: Vec<String> = axes.iter().map(|axis| text(axis, args.deviation)).collect();
        print_text(&text.join("\n"));
    }
    Ok(Status::Done)
}

/// The log in memory at once.
fn whole(args: &Args, options: &LogOptions) -> anyhow::Result<(Header, Vec<AxisCurve>)> {
    let (mut recording, check) = crate::input::read(&args.log, options)?;
    print_check(&recording.name, &check);
    let (dt, kind) = (recording.dt(), args.deviation.kind());
    let parts = into_stretches(&mut recording, options.kind);
    let header =
        Header { name: recording.name, quantity: recording.quantity, sample_rate_hz: recording.sample_rate_hz, check };
    let bar = progress(parts.len() as u64, "Allan deviation");
    let axes = parts
        .into_par_iter()
        .map(|part| {
            let axis = axis_curve(part, dt, kind, args.taus);
            bar.inc(1);
            axis
        })
        .collect::<anyhow::Result<_>>()?;
    bar.finish_and_clear();
    Ok((header, axes))
}

fn axis_curve(stretch: Stretch, dt: f64, kind: Deviation, grid: TauGrid) -> anyhow::Result<AxisCurve> {
    let curve = match &stretch.phase {
        Some(phase) => allan::curve_from_phase(phase, dt, kind, grid),
        None => allan::curve(&stretch.rate, dt, kind, grid),
    };
    let mut curve = curve.with_context(|| stretch.name.clone())?;
    let fit =
        identify::identify_axis(&stretch.name, &stretch.rate, dt, &stretch.unit, Method::Allan, &ModelChoice::Auto)
            .map(|identified| identified.model)
            .map_err(|error| error.to_string());
    if let Ok(model) = &fit {
        curve.refine(model);
    }
    let note = stretch.left_out_note("is used");
    Ok(AxisCurve { name: stretch.name, unit: stretch.unit, note, curve, fit })
}

/// What a person should know about an axis beside the numbers, on stderr.
fn notes(axis: &AxisCurve) {
    if let Some(note) = &axis.note {
        say(&format!("  note: {}: {note}", axis.name));
    }
    if let Err(reason) = &axis.fit {
        say(&format!(
            "  note: {}: intervals are for the power law at each tau, no mixture was fitted: {reason}",
            axis.name
        ));
    }
}

/// "white + gauss_markov".
fn model_name(model: &NoiseModel) -> String {
    let names: Vec<String> = model
        .terms
        .iter()
        .filter_map(|term| serde_json::to_value(term.kind()).ok())
        .filter_map(|kind| kind.as_str().map(String::from))
        .collect();
    names.join(" + ")
}

fn document(axes: &[AxisCurve], deviation: Deviation, header: Header) -> Document {
    let axes = axes
        .iter()
        .map(|axis| {
            let points = &axis.curve.points;
            let display = |si: f64| axis.unit.from_si(si);
            AxisDocument {
                name: axis.name.clone(),
                unit: axis.unit.text().into(),
                samples: axis.curve.samples,
                windows: (axis.curve.windows > 1).then_some(axis.curve.windows),
                tau_s: points.iter().map(|p| p.tau_s).collect(),
                deviation: points.iter().map(|p| display(p.deviation)).collect(),
                lower: points.iter().map(|p| display(p.lower)).collect(),
                upper: points.iter().map(|p| display(p.upper)).collect(),
                edf: points.iter().map(|p| p.edf).collect(),
                terms: points.iter().map(|p| p.terms).collect(),
                noise: points.iter().map(|p| p.noise).collect(),
                intervals: if axis.fit.is_ok() { Intervals::FittedMixture } else { Intervals::PowerLaw },
                model: axis.fit.as_ref().ok().map(model_name),
            }
        })
        .collect();
    Document {
        format: "kfdesign-allan/1",
        deviation,
        quantity: header.quantity,
        sample_rate: SampleRate { value: header.sample_rate_hz, unit: "Hz" },
        axes,
        log: header.check,
    }
}

fn text(axis: &AxisCurve, deviation: DeviationArg) -> String {
    let (unit, points) = (&axis.unit, &axis.curve.points);
    let rows: Vec<Vec<String>> = points
        .iter()
        .map(|p| {
            vec![
                digits(p.tau_s),
                digits(unit.from_si(p.deviation)),
                digits(unit.from_si(p.lower)),
                digits(unit.from_si(p.upper)),
                digits(p.edf),
                p.terms.to_string(),
                p.noise.name().into(),
            ]
        })
        .collect();
    let header = ["tau (s)", &format!("deviation ({unit})"), "95 % from", "to", "edf", "terms", "noise"];
    let basis = match &axis.fit {
        Ok(model) if deviation.kind() == Deviation::Totdev => {
            format!("published formula for the dominating law of the fitted {}", model_name(model))
        }
        Ok(model) => format!("exact for the fitted {}", model_name(model)),
        Err(_) => "for the power law at each tau".into(),
    };
    let lowest = points.iter().filter(|p| p.deviation > 0.0).min_by(|a, b| a.deviation.total_cmp(&b.deviation));
    let lowest = lowest.map_or_else(String::new, |p| {
        format!("Lowest: {} {unit} at {} s. ", digits(unit.from_si(p.deviation)), digits(p.tau_s))
    });
    let windows = match axis.curve.windows {
        1 => String::new(),
        windows => format!("{windows} windows of "),
    };
    format!(
        "{}: {} of {windows}{} samples\n{}{lowest}Intervals: {basis}.\n",
        axis.name,
        deviation.kind().name(),
        axis.curve.samples,
        table(&header, &rows),
    )
}

/// The curves of all axes, one above the other.
fn sheet(log: &str, axes: &[AxisCurve]) -> String {
    let figures: Vec<String> = axes.iter().map(figure).collect();
    let kind = axes.first().map_or("", |axis| axis.curve.deviation.name());
    report::figure::sheet(&format!("{log}: {kind}"), &figures)
}

/// The curve of one axis.
pub(super) fn figure(axis: &AxisCurve) -> String {
    let AxisCurve { name, unit, curve, fit, .. } = axis;
    report::allan::figure(name, curve, fit.as_ref().ok(), unit)
}
