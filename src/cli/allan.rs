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
use super::output::{print_json, print_report, progress, say};
use super::stretch::{Stretch, into_stretches};
use crate::allan::{self, AxisCurve, Deviation, NoiseType, TauGrid};
use crate::identify::{self, Method, ModelChoice};
use crate::input::LogOptions;
use crate::signal::LogCheck;
use crate::units::Quantity;
use crate::view;

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
    files::write_json(args.output.as_deref(), &document)?;
    let report = view::allan::allan(&name, &axes);
    files::write_plot(args.plot.as_deref(), &format!("{name}: {}", args.deviation.kind().name()), &report)?;
    if args.json {
        print_json(&document)?;
    } else {
        print_report(&report);
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
                model: axis.fit.as_ref().ok().map(view::allan::kinds),
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
