//! `kfdesign allan`.

mod windows;

use std::path::PathBuf;

use anyhow::{Context, bail};
use clap::ValueEnum;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::reading::{Reading, note_check};
use super::stretch::{Stretch, into_stretches};
use crate::allan::{self, AxisCurve, Deviation, NoiseType, TauGrid};
use crate::identify::{self, Method, ModelChoice};
use crate::input::LogOptions;
use crate::numerics::progress::{advance, begin, note};
use crate::signal::LogCheck;
use crate::units::Quantity;
use crate::view;

/// Which deviations of which log.
#[derive(Clone, Debug, clap::Args, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Request {
    /// Log at rest: csv, txt, gz or npy
    pub log: PathBuf,
    /// Which deviation
    #[arg(long, value_enum, default_value_t = DeviationArg::Oadev)]
    #[serde(default)]
    pub deviation: DeviationArg,
    /// Averaging times: octave, decade (1, 2, 4, 10 …), log:N (N per decade), log (20 per decade) or all
    #[arg(long, default_value = "octave", value_name = "GRID")]
    #[serde(default = "octave")]
    pub taus: String,
    /// Read the log in windows of this length and average their squares, for logs too long for memory: 24h, 30min
    /// [default: whole; files above 4 GiB in windows of 10 000 000 samples]
    #[arg(long, value_name = "DURATION", allow_hyphen_values = true)]
    #[serde(default)]
    pub window: Option<String>,
    #[command(flatten)]
    #[serde(default)]
    pub reading: Reading,
}

fn octave() -> String {
    "octave".into()
}

#[derive(Clone, Copy, Debug, Default, ValueEnum, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum DeviationArg {
    /// Allan deviation, differences that do not overlap
    Adev,
    /// Overlapping Allan deviation
    #[default]
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

fn grid(text: &str) -> anyhow::Result<TauGrid> {
    let count = |text: &str| Some(text.parse().ok()?).filter(|count| (1..=1000).contains(count));
    Ok(match text {
        "octave" => TauGrid::Octave,
        "decade" => TauGrid::Decade,
        "all" => TauGrid::All,
        "log" => TauGrid::Log(20),
        _ => match text.strip_prefix("log:").and_then(count) {
            Some(count) => TauGrid::Log(count),
            None => bail!("`taus` {text}: expected octave, decade, all, log or log:N with N from 1 to 1000"),
        },
    })
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

/// The curves of every axis.
pub struct Done {
    /// Of the log.
    pub name: String,
    pub axes: Vec<AxisCurve>,
    pub document: Document,
}

/// Notes say what of the log is used, and where no mixture could be fitted.
pub fn run(request: &Request) -> anyhow::Result<Done> {
    let grid = grid(&request.taus)?;
    let options = LogOptions { no_digest: true, ..request.reading.options()? };
    let (header, axes) = match windows::axes(request, grid, &options)? {
        Some(found) => found,
        None => whole(request, grid, &options)?,
    };
    if axes.is_empty() {
        bail!("{}: no axis to work on", request.log.display());
    }
    axes.iter().for_each(notes);
    Ok(Done { name: header.name.clone(), document: document(&axes, request.deviation.kind(), header), axes })
}

/// The log in memory at once.
fn whole(request: &Request, grid: TauGrid, options: &LogOptions) -> anyhow::Result<(Header, Vec<AxisCurve>)> {
    let (mut recording, check) = crate::input::read(&request.log, options)?;
    note_check(&recording.name, &check);
    let (dt, kind) = (recording.dt(), request.deviation.kind());
    let parts = into_stretches(&mut recording, options.kind);
    let header =
        Header { name: recording.name, quantity: recording.quantity, sample_rate_hz: recording.sample_rate_hz, check };
    begin("Allan deviation", parts.len() as u64);
    let curve = |part| {
        let axis = axis_curve(part, dt, kind, grid);
        advance(1);
        axis
    };
    // of several errors that of the first axis
    let axes: Vec<anyhow::Result<AxisCurve>> = parts.into_par_iter().map(curve).collect();
    Ok((header, axes.into_iter().collect::<anyhow::Result<_>>()?))
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
    if let Some(used) = &axis.note {
        note(&format!("  note: {}: {used}", axis.name));
    }
    if let Err(reason) = &axis.fit {
        note(&format!(
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
