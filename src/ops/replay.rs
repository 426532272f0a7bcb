//! A recorded log through a filter, with a verdict.

pub mod attitude;

use std::path::PathBuf;

use anyhow::{Context, bail};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::amounts::with_unit;
use super::checked;
use super::logs::{Logs, Opened};
use super::reading::Reading;
use crate::consistency::{Test, TestKind};
use crate::export::table::TableWriter;
use crate::filter::{AttitudeDesign, FilterDesign, Form};
use crate::input::{Block, LogReader};
use crate::numerics::progress::{advance, begin, note, warning};
use crate::replay::attitude::AttitudeReplay;
use crate::replay::{Estimates, LogShape, Options, ReplayResult, Replayer};
use crate::signal::check::FindingKind;
use crate::units::{Dimension, Unit};

/// Which log goes through which filter, and how.
#[derive(Clone, Debug, clap::Args, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Request {
    /// The design, as written by `tune`: filter.json or attitude.json
    pub filter: PathBuf,
    /// The log, of any format that `kfdesign info` reads
    pub log: PathBuf,
    /// Estimates with their sigmas, SI units: .csv, .csv.gz or .npy
    #[arg(short, long, value_name = "FILE")]
    #[serde(default)]
    pub output: Option<PathBuf>,
    /// Add innovation, its sigma and NIS to the output
    #[arg(long, requires = "output")]
    #[serde(default)]
    pub innovations: bool,
    /// Add the estimates of every sample from the whole log (Rauch-Tung-Striebel) and their sigmas to the output
    #[arg(long, requires = "output", conflicts_with = "innovations")]
    #[serde(default)]
    pub smooth: bool,
    /// Probability of a false alarm, over all tests together
    #[arg(long, default_value_t = 0.01, value_name = "P", allow_negative_numbers = true)]
    #[serde(default = "alpha")]
    pub alpha: f64,
    /// Reject samples whose innovation is further out than this many sigmas
    #[arg(long, value_name = "SIGMAS", allow_negative_numbers = true)]
    #[serde(default)]
    pub gate: Option<f64>,
    /// Samples further out than this many sigmas count as outliers: they move the estimate as far as one at that
    /// distance would, and are not judged (Masreliez and Martin 1977)
    #[arg(long, alias = "robust", value_name = "SIGMAS", conflicts_with_all = ["gate", "smooth"],
        allow_negative_numbers = true)]
    #[serde(default, alias = "robust")]
    pub clip: Option<f64>,
    /// How the filter carries its covariance
    #[arg(long, value_enum, default_value_t = FormFlag::Joseph, conflicts_with = "smooth")]
    #[serde(default)]
    pub form: FormFlag,
    /// Find the wideband noise (white, moving average, band limit, quantization, lines, Gauss-Markov processes of a
    /// few samples) anew as the log goes on, from its last samples: 1000s, 20min. Until there are as many the design
    /// stands for the rest, so no longer than the log it was identified from; only for a sensor at rest
    #[arg(long, value_name = "DURATION", conflicts_with = "smooth", allow_hyphen_values = true)]
    #[serde(default)]
    pub follow: Option<String>,
    /// Column of an aid of the filter (or of a known input of a custom plant), one per axis: NAME=COLUMN[,COLUMN…],
    /// with the unit if the header does not say it: heading=yaw:deg. A row without a number is one without that
    /// measurement
    #[arg(long, value_name = "NAME=COLUMN")]
    #[serde(default)]
    pub aid: Vec<String>,
    #[command(flatten)]
    #[serde(default)]
    pub attitude: attitude::Flags,
    #[command(flatten)]
    #[serde(default)]
    pub reading: Reading,
}

fn alpha() -> f64 {
    0.01
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum FormFlag {
    /// P ← (I − K h) P (I − K h)ᵀ + K r Kᵀ
    #[default]
    Joseph,
    /// A triangular factor of P: right where P in double precision is not
    SquareRoot,
    /// The gains of the steady state from the first sample on, no covariance; a constant bias stays at its x0
    ConstantGain,
}

/// The verdict.
pub enum Done {
    /// And the unit of the log's axes.
    Linear(Box<ReplayResult>, Option<Unit>),
    Attitude(Box<AttitudeReplay>, Box<AttitudeDesign>),
}

impl Request {
    fn options(&self) -> anyhow::Result<Options> {
        let follow = self.follow.as_deref().map(|text| with_unit("`follow`", text, Dimension::TIME, "1000s"));
        let options = Options {
            alpha: self.alpha,
            gate: self.clip.or(self.gate),
            clip: self.clip.is_some(),
            form: match self.form {
                FormFlag::Joseph => Form::Joseph,
                FormFlag::SquareRoot => Form::SquareRoot,
                FormFlag::ConstantGain => Form::ConstantGain,
            },
            follow: follow.transpose()?,
        };
        options.check()?;
        Ok(options)
    }

    /// That can be known before the files are opened.
    pub fn check(&self) -> anyhow::Result<()> {
        if self.smooth && (self.innovations || self.clip.is_some() || self.follow.is_some()) {
            bail!("`smooth` goes with none of `innovations`, `clip` and `follow`");
        }
        self.options().map(|_| ())
    }
}

/// Estimates go to `output` as the log is read. Notes say what the log is, and how its axes and rates fit the filter.
pub fn run(request: &Request) -> anyhow::Result<Done> {
    request.check()?;
    checked::not_swapped(&request.filter, &request.log, "FILTER LOG")?;
    if AttitudeDesign::is(&request.filter) {
        return attitude::run(request);
    }
    request.attitude.refuse()?;
    let design = checked::design(&request.filter)?;
    let logs = Logs { reading: &request.reading, aids: &request.aid };
    let Opened { name, mut reader, shape, check } = logs.open(&request.log, &design)?;
    let replayer = Replayer::new(&design, &shape, request.options()?).with_context(|| name.clone())?;
    note_assignment(&design, &replayer, &shape);
    let mut result = stream(request, &design, replayer, &mut reader)?;
    result.log = Some(name);
    result.log_sha256 = Some(reader.sha256().to_string());
    note_rates(&design, &result);
    if design.plant == "static" && check.findings.iter().all(|finding| finding.kind != FindingKind::Motion) {
        note_follow(request, &result);
    }
    Ok(Done::Linear(Box::new(result), reader.axes().first().map(|a| a.unit.clone())))
}

/// A note on an aid that comes at another rate than the filter was made for.
fn note_rates(design: &FilterDesign, result: &ReplayResult) {
    let every = design.axes.iter().flat_map(|axis| axis.model.every.iter());
    for (axis, every) in result.axes.iter().zip(every) {
        let expected = (axis.samples / *every as u64).max(1) as f64;
        let ratio = (axis.accepted + axis.rejected) as f64 / expected;
        if *every > 1 && !(0.5..=2.0).contains(&ratio) {
            warning(&format!(
                "{} has {} measurements in {} rows, the filter was made for one in {every}; empty the rows that repeat \
                 an \
                 older value, or tune with the aid's true rate",
                axis.measurement,
                axis.accepted + axis.rejected,
                axis.samples
            ));
        }
    }
}

/// A note when the wideband noise of a log at rest is not that of the design.
fn note_follow(request: &Request, result: &ReplayResult) {
    let other = |test: &&Test| !test.pass() && [TestKind::Nis, TestKind::Whiteness].contains(&test.kind);
    let mut axes: Vec<&str> = result.tests.iter().filter(other).map(|test| test.axis.as_str()).collect();
    axes.dedup();
    if !axes.is_empty() && request.follow.is_none() && request.form == FormFlag::Joseph && !request.smooth {
        note(&format!(
            "  note: the wideband noise is not what the design says ({}): `follow` DURATION finds it anew as the log \
             goes on",
            axes.join(", ")
        ));
    }
}

/// A note when names had to be matched or axes are left out.
fn note_assignment(design: &FilterDesign, replayer: &Replayer, log: &LogShape) {
    let pairs: Vec<String> = design
        .axes
        .iter()
        .zip(replayer.log_axes())
        .filter(|(axis, found)| axis.name != **found)
        .map(|(axis, found)| format!("{found} goes through {}", axis.name))
        .collect();
    let left_out: Vec<&str> =
        log.axes.iter().filter(|a| !replayer.log_axes().contains(a)).map(String::as_str).collect();
    if !pairs.is_empty() {
        note(&format!("  note: {}", pairs.join(", ")));
    }
    if !left_out.is_empty() {
        note(&format!("  note: not in the filter, left out: {}", left_out.join(", ")));
    }
}

/// Block after block through the filter and, if asked, into the output file.
fn stream(
    request: &Request,
    design: &FilterDesign,
    mut replayer: Replayer,
    reader: &mut LogReader,
) -> anyhow::Result<ReplayResult> {
    let mut writer = match &request.output {
        Some(path) => Some(TableWriter::create(path, &header(design, request.innovations, request.smooth))?),
        None => None,
    };
    if request.smooth {
        replayer.remember();
    }
    begin("replay", reader.check().samples);
    let (mut block, mut estimates, mut time_s) = (Block::default(), Estimates::default(), Vec::new());
    while reader.next_block(&mut block)? {
        let streamed = writer.as_mut().filter(|_| !request.smooth);
        replayer.push(&block, streamed.is_some().then_some(&mut estimates));
        if let Some(writer) = streamed {
            writer.write(&columns(&estimates, request.innovations))?;
        }
        if request.smooth {
            time_s.extend_from_slice(&block.time_s);
        }
        advance(block.time_s.len() as u64);
    }
    if let Some(writer) = writer.as_mut().filter(|_| request.smooth) {
        let axes = replayer.smoothed();
        let mut all = vec![time_s.as_slice()];
        for axis in &axes {
            for i in 0..axis.filtered.len() {
                let of = [&axis.filtered, &axis.filtered_sigma, &axis.smoothed, &axis.smoothed_sigma];
                all.extend(of.map(|columns| columns[i].as_slice()));
            }
        }
        writer.write(&all)?;
    }
    let result = replayer.finish();
    if let Some(writer) = writer {
        writer.finish()?;
    }
    Ok(result)
}

fn header(design: &FilterDesign, innovations: bool, smooth: bool) -> Vec<String> {
    let mut names = vec!["time (s)".to_string()];
    for axis in &design.axes {
        for state in &axis.model.states {
            names.push(format!("{}_{} ({})", axis.name, state.name, state.unit));
            names.push(format!("{}_{}_sigma ({})", axis.name, state.name, state.unit));
            for part in ["smoothed", "smoothed_sigma"].iter().filter(|_| smooth) {
                names.push(format!("{}_{}_{part} ({})", axis.name, state.name, state.unit));
            }
        }
        for measurement in axis.model.measurements.iter().filter(|_| innovations) {
            let unit = &measurement.unit;
            let name = match axis.model.measurements.len() {
                1 => axis.name.clone(),
                _ => format!("{}_{}", axis.name, measurement.name),
            };
            names.push(format!("{name}_innovation ({unit})"));
            names.push(format!("{name}_innovation_sigma ({unit})"));
            names.push(format!("{name}_nis"));
        }
    }
    names
}

fn columns(estimates: &Estimates, innovations: bool) -> Vec<&[f64]> {
    let mut columns = vec![estimates.time_s.as_slice()];
    for axis in &estimates.axes {
        for (state, sigma) in axis.states.iter().zip(&axis.sigmas) {
            columns.extend([state.as_slice(), sigma.as_slice()]);
        }
        for update in axis.updates.iter().filter(|_| innovations) {
            columns.extend([update.innovation.as_slice(), update.innovation_sigma.as_slice(), update.nis.as_slice()]);
        }
    }
    columns
}
