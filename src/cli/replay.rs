//! `kfdesign replay`.

mod attitude;

use std::path::PathBuf;

use anyhow::Context;

use super::files::{self, Kind};
use super::output::{print_json, print_report, say};
use super::{Status, VerdictFlags};
use crate::consistency::{Test, TestKind};
use crate::export::table::TableWriter;
use crate::filter::{AttitudeDesign, FilterDesign, Form};
use crate::input::{Block, LogOptions, LogReader};
use crate::numerics::progress::{advance, begin};
use crate::ops::aid_columns::aid_columns;
use crate::ops::amounts::with_unit;
use crate::ops::checked;
use crate::ops::reading::{Reading, note_check};
use crate::replay::{Estimates, LogShape, Options, ReplayResult, Replayer};
use crate::signal::check::FindingKind;
use crate::units::Dimension;
use crate::view;

/// A recorded log through filter.json, with a verdict
///
/// Exit status 1 when the verdict is inconsistent, and when it is inconclusive (a log too short to judge the drift) unless
/// --allow-inconclusive.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example: kfdesign replay filter.json log.csv -o estimates.csv --innovations")]
pub struct Args {
    /// The design, as written by `tune`: filter.json or attitude.json
    filter: PathBuf,
    /// The log, of any format that `kfdesign info` reads
    log: PathBuf,
    /// Estimates with their sigmas, SI units: .csv, .csv.gz or .npy
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Add innovation, its sigma and NIS to the output
    #[arg(long, requires = "output")]
    innovations: bool,
    /// Add the estimates of every sample from the whole log (Rauch-Tung-Striebel) and their sigmas to the output
    #[arg(long, requires = "output", conflicts_with = "innovations")]
    smooth: bool,
    /// Probability of a false alarm, over all tests together
    #[arg(long, default_value_t = 0.01, value_name = "P", allow_negative_numbers = true)]
    alpha: f64,
    /// Reject samples whose innovation is further out than this many sigmas
    #[arg(long, value_name = "SIGMAS", allow_negative_numbers = true)]
    gate: Option<f64>,
    /// Samples further out than this many sigmas count as outliers: they move the estimate as far as one at that distance would, and are
    /// not judged (Masreliez and Martin 1977)
    #[arg(long, value_name = "SIGMAS", conflicts_with_all = ["gate", "smooth"], allow_negative_numbers = true)]
    robust: Option<f64>,
    /// How the filter carries its covariance
    #[arg(long, value_enum, default_value_t = FormFlag::Joseph, conflicts_with = "smooth")]
    form: FormFlag,
    /// Find the wideband noise (white, moving average, band limit, quantization, lines, Gauss-Markov processes of a few samples) anew as the log goes on,
    /// from its last samples: 1000s, 20min. Until there are as many the design stands for the rest, so no longer than the log it was identified from;
    /// only for a sensor at rest
    #[arg(long, value_name = "DURATION", conflicts_with = "smooth", allow_hyphen_values = true)]
    follow: Option<String>,
    /// One HTML page with tables and figures
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    /// Figures of every axis
    #[arg(long, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
    /// One JSON document on stdout
    #[arg(long)]
    json: bool,
    /// Column of an aid of the filter (or of a known input of a custom plant), one per axis: NAME=COLUMN[,COLUMN…], with the unit if the header does not say it: heading=yaw:deg.
    /// A row without a number is one without that measurement
    #[arg(long, value_name = "NAME=COLUMN")]
    aid: Vec<String>,
    #[command(flatten)]
    judging: VerdictFlags,
    #[command(flatten)]
    attitude: attitude::Flags,
    #[command(flatten)]
    reading: Reading,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum FormFlag {
    /// P ← (I − K h) P (I − K h)ᵀ + K r Kᵀ
    Joseph,
    /// A triangular factor of P: right where P in double precision is not
    SquareRoot,
    /// The gains of the steady state from the first sample on, no covariance; a constant bias stays at its x0
    ConstantGain,
}

pub(super) fn run(args: &Args) -> anyhow::Result<Status> {
    let options = Options {
        alpha: args.alpha,
        gate: args.robust.or(args.gate),
        clip: args.robust.is_some(),
        form: match args.form {
            FormFlag::Joseph => Form::Joseph,
            FormFlag::SquareRoot => Form::SquareRoot,
            FormFlag::ConstantGain => Form::ConstantGain,
        },
        follow: args.follow.as_deref().map(|text| with_unit("--follow", text, Dimension::TIME, "1000s")).transpose()?,
    };
    options.check()?;
    let outputs =
        [("-o", &args.output, Kind::Table), ("--report", &args.report, Kind::Html), ("--plot", &args.plot, Kind::Svg)];
    files::check(&outputs, &[&args.filter, &args.log])?;
    if AttitudeDesign::is(&args.filter) {
        return attitude::run(args);
    }
    args.attitude.refuse()?;
    let design = checked::design(&args.filter)?;
    let extra = aid_columns(&args.aid, &design).with_context(|| args.filter.display().to_string())?;
    let extra_columns = extra.len();
    let mut reader = LogReader::open(&args.log, &LogOptions { extra, ..args.reading.rates()? })?;
    let name = args.log.display().to_string();
    let mut check = reader.check().clone();
    // a plant's log is one that moves
    if design.plant != "static" {
        check.expect_motion();
    }
    note_check(&name, &check);
    let shape = LogShape {
        axes: reader.axes().iter().map(|a| a.name.clone()).collect(),
        quantity: reader.quantity(),
        sample_rate_hz: reader.check().sample_rate_hz,
        aids: extra_columns,
    };
    let replayer = Replayer::new(&design, &shape, options).with_context(|| name.clone())?;
    say_assignment(&design, &replayer, &shape);
    let mut result = stream(args, &design, replayer, &mut reader)?;
    result.log = Some(name);
    result.log_sha256 = Some(reader.sha256().to_string());
    say_rates(&design, &result);
    if design.plant == "static" && check.findings.iter().all(|finding| finding.kind != FindingKind::Motion) {
        say_follow(args, &result);
    }
    let unit = reader.axes().first().map(|a| a.unit.clone());
    let report = view::replay::replay(&result, &args.filter.display().to_string(), unit.as_ref());
    files::write_plot(args.plot.as_deref(), "Replay", &report)?;
    files::write_page(args.report.as_deref(), &report)?;
    if args.json {
        print_json(&result)?;
    } else {
        print_report(&report);
    }
    Ok(args.judging.status([result.verdict]))
}

/// One line on stderr for an aid that comes at another rate than the filter was made for.
fn say_rates(design: &FilterDesign, result: &ReplayResult) {
    let every = design.axes.iter().flat_map(|axis| axis.model.every.iter());
    for (axis, every) in result.axes.iter().zip(every) {
        let expected = (axis.samples / *every as u64).max(1) as f64;
        let ratio = (axis.accepted + axis.rejected) as f64 / expected;
        if *every > 1 && !(0.5..=2.0).contains(&ratio) {
            say(&format!(
                "  warning: {} has {} measurements in {} rows, the filter was made for one in {every}; empty the rows that repeat an \
                 older value, or tune with the aid's true rate",
                axis.measurement,
                axis.accepted + axis.rejected,
                axis.samples
            ));
        }
    }
}

/// One line on stderr when the wideband noise of a log at rest is not that of the design.
fn say_follow(args: &Args, result: &ReplayResult) {
    let other = |test: &&Test| !test.pass() && [TestKind::Nis, TestKind::Whiteness].contains(&test.kind);
    let mut axes: Vec<&str> = result.tests.iter().filter(other).map(|test| test.axis.as_str()).collect();
    axes.dedup();
    if !axes.is_empty() && args.follow.is_none() && args.form == FormFlag::Joseph && !args.smooth {
        say(&format!(
            "  note: the wideband noise is not what the design says ({}): --follow DURATION finds it anew as the log goes on",
            axes.join(", ")
        ));
    }
}

/// One line on stderr when names had to be matched or axes are left out.
fn say_assignment(design: &FilterDesign, replayer: &Replayer, log: &LogShape) {
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
        say(&format!("  note: {}", pairs.join(", ")));
    }
    if !left_out.is_empty() {
        say(&format!("  note: not in the filter, left out: {}", left_out.join(", ")));
    }
}

/// Block after block through the filter and, if asked, into the output file.
fn stream(
    args: &Args,
    design: &FilterDesign,
    mut replayer: Replayer,
    reader: &mut LogReader,
) -> anyhow::Result<ReplayResult> {
    let mut writer = match &args.output {
        Some(path) => Some(TableWriter::create(path, &header(design, args.innovations, args.smooth))?),
        None => None,
    };
    if args.smooth {
        replayer.remember();
    }
    begin("replay", reader.check().samples);
    let (mut block, mut estimates, mut time_s) = (Block::default(), Estimates::default(), Vec::new());
    while reader.next_block(&mut block)? {
        let streamed = writer.as_mut().filter(|_| !args.smooth);
        replayer.push(&block, streamed.is_some().then_some(&mut estimates));
        if let Some(writer) = streamed {
            writer.write(&columns(&estimates, args.innovations))?;
        }
        if args.smooth {
            time_s.extend_from_slice(&block.time_s);
        }
        advance(block.time_s.len() as u64);
    }
    if let Some(writer) = writer.as_mut().filter(|_| args.smooth) {
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
