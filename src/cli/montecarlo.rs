//! `kfdesign montecarlo` and `kfdesign merge`.

mod tables;

use std::borrow::Cow;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use anyhow::{Context, bail};

use super::files::{self, Kind};
use super::output::{print_report, print_text};
use super::{Status, Stop, VerdictFlags};
use crate::export::{atomic, junit};
use crate::montecarlo::calibration::{self, MAX_REPLICATES, MAX_RUN, REPLICATES};
use crate::montecarlo::course::{MAX_STEPS, MIN_STEPS};
use crate::montecarlo::document::{self, Shard};
use crate::montecarlo::every_step::MAX_EVERY_STEP;
use crate::montecarlo::experiment::default_steps;
use crate::montecarlo::gate::Gate;
use crate::montecarlo::power::{self, Mistuning};
use crate::montecarlo::{Course, Experiment, Outcome, Runs, Totals, conclude};
use crate::numerics::progress::{advance, begin};
use crate::ops::amounts::{whole, with_unit};
use crate::ops::checked;
use crate::units::{Dimension, digits};
use crate::view;
use crate::view::montecarlo::MonteCarlo;

/// Time between two writes of unfinished work.
const CHECKPOINT: Duration = Duration::from_secs(20);
/// More threads than any machine has processors are a slip of the hand.
const MAX_THREADS: usize = 1024;

/// Many simulated runs through filter.json: does its covariance tell the truth?
///
/// The verdict is a gate for CI: exit status 0 consistent, 1 inconsistent. A true filter is called inconsistent with
/// probability --alpha, all tests and axes together; that probability is measured and printed.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples: kfdesign montecarlo filter.json --runs 1000 --duration 600s\n          \
kfdesign montecarlo filter.json --truth params.json --junit montecarlo.xml --report montecarlo.html\n          \
kfdesign montecarlo filter.json --runs 0..500 -o a.json    (another machine: --runs 500..1000 -o b.json; then kfdesign merge a.json b.json)")]
pub struct Args {
    /// The design, as written by `tune`
    filter: PathBuf,
    /// Number of runs, or a range A..B of run numbers (B not included)
    #[arg(long, default_value = "1000", value_name = "N|A..B", allow_hyphen_values = true)]
    runs: String,
    /// Length of a run, for example 600s or 2h [default: 600s; where the filter settles more slowly, twice its
    /// settling time, up to 600000 samples]
    #[arg(long, value_name = "TIME", allow_hyphen_values = true)]
    duration: Option<String>,
    #[arg(long, default_value_t = 1, value_name = "N", value_parser = whole::<u64>, allow_negative_numbers = true)]
    seed: u64,
    /// Probability of a false alarm, over all tests and axes together
    #[arg(long, default_value_t = 0.01, value_name = "P", allow_hyphen_values = true)]
    alpha: f64,
    /// Simulate these noise parameters instead of the design's own
    #[arg(long, value_name = "params.json")]
    truth: Option<PathBuf>,
    /// Draw the parameters of every run from their intervals
    #[arg(long)]
    truth_spread: bool,
    /// Measure the false-alarm probability with this many whole experiments, not from the law of the statistics
    #[arg(long, default_value_t = 0, value_name = "N", value_parser = whole::<u64>, allow_negative_numbers = true)]
    replicates: u64,
    /// Simulate this run alone; -o takes its numbers (.csv, .csv.gz or .npy)
    #[arg(long, value_name = "NUMBER", value_parser = whole::<u64>, allow_negative_numbers = true,
        conflicts_with_all = ["runs", "resume", "replicates", "json", "junit", "report", "power", "plan", "confirm"])]
    run: Option<u64>,
    /// Average NEES and NIS at every step, as a table (.csv, .csv.gz or .npy)
    #[arg(long, value_name = "FILE", conflicts_with = "run")]
    every_step: Option<PathBuf>,
    /// Go on from what -o FILE holds of the same experiment; without it, a file that is there is replaced only when
    /// the work is done
    #[arg(long, requires = "output")]
    resume: bool,
    /// Threads; the results do not depend on it
    #[arg(long, value_name = "N", value_parser = whole::<usize>, allow_negative_numbers = true)]
    threads: Option<usize>,
    #[command(flatten)]
    outputs: Outputs,
}

/// One verdict from documents of `montecarlo`
///
/// The documents must be of one experiment and their runs must adjoin; the result is byte for byte that of all runs
/// in one go. One document alone, also of interrupted work, is judged as it is.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example: kfdesign merge shard-*.json -o montecarlo.json")]
pub struct MergeArgs {
    /// Documents in any order
    #[arg(required = true)]
    shards: Vec<PathBuf>,
    #[command(flatten)]
    outputs: Outputs,
}

#[derive(Debug, clap::Args)]
struct Outputs {
    /// The document: verdict, curves and sums
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// The document on stdout
    #[arg(long)]
    json: bool,
    /// Test report for CI servers
    #[arg(long, value_name = "FILE.xml")]
    junit: Option<PathBuf>,
    /// Verdict, curves and figures on one page
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    #[command(flatten)]
    judging: VerdictFlags,
    /// Print what the gate would see: the smallest mistuning of every parameter that is caught with 90 % probability
    #[arg(long)]
    power: bool,
    /// Simulate each of these sizes, and the given truth, in this many whole experiments and count what is caught
    #[arg(long, default_value_t = 0, value_name = "N", value_parser = whole::<u64>, allow_negative_numbers = true)]
    confirm: u64,
    /// How many runs, or how long ones, see this mistuning: \"gauss_markov.std_dev x1.3\" (the filter's value is 1.3
    /// times the true one)
    #[arg(long, value_name = "\"PARAMETER xFACTOR\"")]
    plan: Vec<String>,
}

pub(super) fn run(args: &Args, stop: &Stop) -> anyhow::Result<Status> {
    // the runs end at their next checkpoint, but not what judges them
    stop.heed(args.run.is_none());
    let inputs: Vec<&Path> = std::iter::once(args.filter.as_path()).chain(args.truth.as_deref()).collect();
    let kind = if args.run.is_some() { Kind::Table } else { Kind::Json };
    args.outputs.check(&inputs, kind, &args.every_step)?;
    let design = checked::design(&args.filter)?;
    let truth = args.truth.as_deref().map(checked::params).transpose()?;
    let steps = match &args.duration {
        Some(text) => steps(text, design.sample_rate_hz)?,
        None => default_steps(&design),
    };
    let experiment = Experiment {
        design,
        truth,
        truth_spread: args.truth_spread,
        steps,
        seed: args.seed,
        alpha: args.alpha,
        replicates: args.replicates,
    };
    if !(experiment.alpha > 0.0 && experiment.alpha < 1.0) {
        bail!("--alpha {}: expected a probability between 0 and 1, for example 0.01", args.alpha);
    }
    if let Some(threads) = args.threads.filter(|threads| !(1..=MAX_THREADS).contains(threads)) {
        bail!("--threads {threads}: expected 1 to {MAX_THREADS}");
    }
    if let Some(number) = args.run.filter(|number| *number >= MAX_RUN) {
        bail!("--run {number}: expected a number below {MAX_RUN}");
    }
    let work = || {
        let course = experiment.course().with_context(|| args.filter.display().to_string())?;
        match args.run {
            Some(number) => tables::one_run(args, &experiment, &course, number),
            None => many_runs(args, &experiment, &course, stop),
        }
    };
    // where there are no more threads to be had, those that are there do the work
    match args.threads.map(|threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build()) {
        Some(Ok(pool)) => pool.install(work),
        Some(Err(_)) | None => work(),
    }
}

/// Samples of a run of this length.
fn steps(text: &str, rate: f64) -> anyhow::Result<u64> {
    let steps = (with_unit("--duration", text, Dimension::TIME, "600s")? * rate).round();
    if !(MIN_STEPS as f64..=MAX_STEPS as f64).contains(&steps) {
        let [least, most] = [MIN_STEPS, MAX_STEPS].map(|steps| digits(steps as f64 / rate));
        bail!("--duration {text}: expected {least} s to {most} s ({MIN_STEPS} to {MAX_STEPS} samples at {rate} Hz)");
    }
    Ok(steps as u64)
}

/// `1000` or `500..1000`.
fn range(text: &str) -> anyhow::Result<Range<u64>> {
    let number = |text: &str| text.trim().parse::<u64>().ok();
    let range = match text.split_once("..") {
        None => number(text).map(|count| 0..count),
        Some((first, end)) => number(first).zip(number(end)).map(|(first, end)| first..end),
    };
    match range {
        Some(range) if range.end > MAX_RUN => bail!("--runs {text}: expected run numbers up to {MAX_RUN}"),
        Some(range) if range.start < range.end => Ok(range),
        _ => bail!("--runs {text}: expected a number of runs of at least 1, or a range like 500..1000"),
    }
}

fn many_runs(args: &Args, experiment: &Experiment, course: &Course, stop: &Stop) -> anyhow::Result<Status> {
    let runs = range(&args.runs)?;
    if runs.end - runs.start < 2 && !args.runs.contains("..") {
        bail!("--runs {}: one run judges nothing; expected at least 2", args.runs);
    }
    args.outputs.check_plans(experiment)?;
    if args.every_step.is_some() && course.steps > MAX_EVERY_STEP {
        bail!(
            "--every-step: a run has {} samples, expected at most {MAX_EVERY_STEP}; shorten --duration",
            course.steps
        );
    }
    let (start, mut next) = match args.outputs.output.as_deref().filter(|path| args.resume && path.exists()) {
        None => (None, runs.start),
        Some(path) => {
            let shard = Shard::read(path)?;
            shard.require(experiment, "this command")?;
            if shard.runs.first != runs.start || shard.runs.end > runs.end {
                let Runs { first, end } = shard.runs;
                bail!(
                    "{}: runs: holds {first}..{end}, which is no beginning of --runs {}; give another -o, or leave --resume out",
                    path.display(),
                    args.runs
                );
            }
            (Some(shard.totals(course)?), shard.runs.end)
        }
    };
    let axes = course.axes.len() as u64;
    begin("runs", (runs.end - runs.start) * axes);
    advance((next - runs.start) * axes);
    // what is there before is not given up for unfinished work, unless that goes on from it
    let kept = args.outputs.output.as_deref().filter(|path| args.resume || !path.exists());
    let mut saved = Instant::now();
    let mut failure = None;
    let partial = |totals: &[Totals], end: u64| {
        let done = Runs { first: runs.start, end };
        document::partial_json(experiment, course, done, totals)
    };
    let mut pause = |totals: &[Totals], end: u64| {
        let stopping = stop.is_wanted();
        if let Some(path) = kept.filter(|_| stopping || saved.elapsed() > CHECKPOINT) {
            failure = atomic::write(path, partial(totals, end).as_bytes()).err();
            saved = Instant::now();
        }
        stopping || failure.is_some()
    };
    let (totals, end) = course.sums_until(next..runs.end, start, &mut pause);
    if let Some(failure) = failure {
        return Err(failure.into());
    }
    next = end;
    if next < runs.end {
        let done = next - runs.start;
        match kept {
            Some(path) => bail!(
                "interrupted after {done} of {} runs, which are in {}; the same command with --resume goes on",
                runs.end - runs.start,
                path.display()
            ),
            None => {
                let how = match &args.outputs.output {
                    Some(path) => format!("{} is as it was: with --resume, or another -o", path.display()),
                    None => "with -o FILE".into(),
                };
                bail!("interrupted after {done} of {} runs; {how} they would have been kept", runs.end - runs.start)
            }
        }
    }
    // the runs are kept while they are judged, which can take longer than they did
    if let Some(path) = kept {
        atomic::write(path, partial(&totals, end).as_bytes())?;
    }
    stop.heed(false);
    let truth = args.truth.iter().map(|path| ("truth's parameters".to_string(), path.display().to_string()));
    let filter = std::iter::once(("filter".to_string(), args.filter.display().to_string()));
    let sources: Vec<_> = filter.chain(truth).collect();
    if let Some(path) = &args.every_step {
        tables::every_step(path, course, runs.clone())?;
    }
    args.outputs.finish(experiment, course, &totals, runs, &sources)
}

pub(super) fn merge(args: &MergeArgs) -> anyhow::Result<Status> {
    let inputs: Vec<&Path> = args.shards.iter().map(PathBuf::as_path).collect();
    args.outputs.check(&inputs, Kind::Json, &None)?;
    let shards = args.shards.iter().map(|path| Shard::read(path)).collect::<Result<Vec<_>, _>>()?;
    let shards = document::in_order(shards)?;
    let (Some(first), Some(last)) = (shards.first(), shards.last()) else { bail!("nothing to merge") };
    let experiment = first.experiment.clone();
    let course = experiment.course().with_context(|| first.path.clone())?;
    let runs = first.runs.first..last.runs.end;
    let mut totals = first.totals(&course)?;
    for shard in &shards[1..] {
        totals.iter_mut().zip(shard.totals(&course)?).for_each(|(sum, more)| sum.merge(&more));
    }
    let names: Vec<&str> = shards.iter().map(|shard| shard.path.as_str()).collect();
    let sources = [("merged from".to_string(), names.join(", "))];
    args.outputs.finish(&experiment, &course, &totals, runs, &sources)
}

impl Outputs {
    /// All outputs, among them the table of every step, can be written; `kind`: what -o is.
    fn check(&self, inputs: &[&Path], kind: Kind, every_step: &Option<PathBuf>) -> anyhow::Result<()> {
        if self.confirm > MAX_REPLICATES {
            bail!("--confirm {}: expected at most {MAX_REPLICATES} experiments", self.confirm);
        }
        let outputs = [
            ("-o", &self.output, kind),
            ("--junit", &self.junit, Kind::Xml),
            ("--report", &self.report, Kind::Html),
            ("--every-step", every_step, Kind::Table),
        ];
        files::check(&outputs, inputs)
    }

    /// Every plan names a parameter and a factor: better known before the runs than after.
    fn check_plans(&self, experiment: &Experiment) -> anyhow::Result<()> {
        if !self.plan.is_empty() {
            let own = experiment.own_course()?;
            self.plan.iter().try_for_each(|text| planned(experiment, &own, text).map(|_| ()))?;
        }
        Ok(())
    }

    /// The verdict on the sums, everywhere it was asked for. `sources`: label and name of the files that were read.
    fn finish(
        &self,
        experiment: &Experiment,
        course: &Course,
        totals: &[Totals],
        runs: Range<u64>,
        sources: &[(String, String)],
    ) -> anyhow::Result<Status> {
        let count = runs.end - runs.start;
        let gate = calibration::gate(course, count, experiment.alpha, REPLICATES);
        let mut outcome = conclude(course, totals, runs, &gate);
        outcome.false_alarm_rate = Some(match experiment.replicates {
            0 => calibration::false_alarms(course, &gate, count),
            replicates => {
                begin("false alarms", (replicates * count).saturating_mul(course.axes.len() as u64));
                let own = experiment.own_course()?;
                calibration::false_alarms_of_experiments(&own, &gate, count, replicates)
            }
        });
        if experiment.truth.is_some() && !experiment.truth_spread {
            outcome.rejection = power::rejection(course, &gate, count);
            if let Some(rejection) = outcome.rejection.as_mut().filter(|_| self.confirm > 0) {
                begin("confirm", (self.confirm * count).saturating_mul(course.axes.len() as u64));
                let (axes, critical) = (&gate.axes, gate.critical);
                rejection.confirmed =
                    Some(calibration::caught_of_experiments(course, axes, critical, count, self.confirm));
            }
        }
        let detects = experiment.truth.is_none() || self.power;
        let mut plans = Vec::new();
        if detects || !self.plan.is_empty() {
            plans = self.look(experiment, course, &gate, detects, &mut outcome)?;
        }
        let json = document::to_json(experiment, &outcome, totals);
        if let Some(path) = &self.output {
            atomic::write(path, json.as_bytes())?;
        }
        if let Some(path) = &self.junit {
            atomic::write(path, junit::report(&outcome)?.as_bytes())?;
        }
        if self.report.is_some() && !detects {
            // the page always has the table; what the document holds does not depend on the page
            let (course, gate) = as_own_truth(experiment, course, &gate, count)?;
            outcome.detects = power::detectable(experiment, &course, &gate, count);
        }
        let view = MonteCarlo { experiment, course, outcome: &outcome, sources, power: self.power, plans: &plans };
        let report = view::montecarlo::montecarlo(view);
        files::write_page(self.report.as_deref(), &report)?;
        if self.json {
            print_text(&json);
        } else {
            print_report(&report);
        }
        Ok(self.judging.status([outcome.verdict]))
    }
}

impl Outputs {
    /// What the gate sees when the design is wrong, into the outcome if `detects` says so; the plans in words.
    fn look(
        &self,
        experiment: &Experiment,
        course: &Course,
        gate: &Gate,
        detects: bool,
        outcome: &mut Outcome,
    ) -> anyhow::Result<Vec<String>> {
        let runs = outcome.runs.count();
        let (course, gate) = as_own_truth(experiment, course, gate, runs)?;
        let (course, gate) = (course.as_ref(), gate.as_ref());
        let plans: Vec<(usize, Mistuning, f64, &str)> =
            self.plan.iter().map(|text| planned(experiment, course, text)).collect::<Result<_, _>>()?;
        if detects {
            outcome.detects = power::detectable(experiment, course, gate, runs);
        }
        if self.confirm > 0 {
            let sizes: usize =
                outcome.detects.iter().map(|d| d.too_large.iter().count() + d.too_small.iter().count()).sum();
            begin("confirm", (self.confirm * runs).saturating_mul(sizes as u64));
            power::confirm(experiment, course, gate, runs, self.confirm, &mut outcome.detects)?;
        }
        let plan = |(number, what, size, wished): (usize, Mistuning, f64, &str)| {
            let needed = power::plan(experiment, course, gate, runs, number, &what, size)?;
            Ok(view::montecarlo::plan(outcome, wished, &needed))
        };
        plans.into_iter().map(plan).collect()
    }
}

/// Course and gate of the design as its own truth: what power is about. Another truth may be judged by other
/// components.
fn as_own_truth<'a>(
    experiment: &Experiment,
    course: &'a Course,
    gate: &'a Gate,
    runs: u64,
) -> anyhow::Result<(Cow<'a, Course>, Cow<'a, Gate>)> {
    if experiment.truth.is_none() && !experiment.truth_spread {
        return Ok((Cow::Borrowed(course), Cow::Borrowed(gate)));
    }
    let own = experiment.own_course()?;
    let gate = calibration::gate(&own, runs, experiment.alpha, REPLICATES);
    Ok((Cow::Owned(own), Cow::Owned(gate)))
}

/// The axis, what is wrong about it and by how much: `gauss_markov.std_dev x1.3`, with `y:` before it for another
/// axis than the first.
fn planned<'a>(
    experiment: &Experiment,
    course: &Course,
    text: &'a str,
) -> anyhow::Result<(usize, Mistuning, f64, &'a str)> {
    let (axis, rest) = text.split_once(':').map_or((None, text), |(axis, rest)| (Some(axis.trim()), rest));
    let number = match axis {
        None => 0,
        Some(name) => course.axes.iter().position(|a| a.name == name).with_context(|| {
            let names: Vec<&str> = course.axes.iter().map(|a| a.name.as_str()).collect();
            format!("--plan \"{text}\": no axis '{name}'; there are {}", names.join(", "))
        })?,
    };
    let course = &course.axes[number];
    let all = Mistuning::all(experiment, number, course);
    let names: Vec<String> = all.iter().map(|what| what.name(course)).collect();
    let expected = || {
        format!(
            "--plan \"{text}\": expected a parameter and a factor like \"{} x1.3\"; parameters: {}",
            names.first().map_or("P0 of bias", String::as_str),
            names.join(", ")
        )
    };
    let (name, factor) = rest.trim().rsplit_once(char::is_whitespace).with_context(expected)?;
    let what = all
        .iter()
        .zip(&names)
        .find(|(_, known)| *known == name.trim())
        .map(|(what, _)| what.clone())
        .with_context(expected)?;
    let factor = factor.trim_start_matches(['x', '×']);
    let size = factor
        .parse::<f64>()
        .ok()
        .filter(|f| f.is_finite() && *f > 0.0 && *f != 1.0 && (1e-3..=1e3).contains(f))
        .with_context(expected)?;
    Ok((number, what, size, text))
}
