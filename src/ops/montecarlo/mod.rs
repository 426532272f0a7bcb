//! A design against simulated truth, run by run.

mod judging;
pub mod merge;
mod tables;

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use self::judging::{Judged, Judging};
use super::amounts::{whole, with_unit};
use super::checked;
use crate::export::atomic;
use crate::montecarlo::calibration::MAX_RUN;
use crate::montecarlo::course::{MAX_STEPS, MIN_STEPS};
use crate::montecarlo::document::{self, Shard};
use crate::montecarlo::every_step::MAX_EVERY_STEP;
use crate::montecarlo::experiment::default_steps;
use crate::montecarlo::{Course, Experiment, Runs, Totals};
use crate::numerics::progress::{advance, begin, on_threads};
use crate::units::{Dimension, digits};

/// Time between two writes of unfinished work.
const CHECKPOINT: Duration = Duration::from_secs(20);
/// More threads than any machine has processors are a slip of the hand.
const MAX_THREADS: usize = 1024;

/// A design, how often, how long.
#[derive(Clone, Debug, clap::Args, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Request {
    /// The design, as written by `tune`
    pub filter: PathBuf,
    /// Number of runs, or a range A..B of run numbers (B not included)
    #[arg(long, default_value = "1000", value_name = "N|A..B", allow_hyphen_values = true)]
    #[serde(default = "runs")]
    pub runs: String,
    /// Length of a run, for example 600s or 2h [default: 600s; where the filter settles more slowly, twice its
    /// settling time, up to 600000 samples]
    #[arg(long, value_name = "TIME", allow_hyphen_values = true)]
    #[serde(default)]
    pub duration: Option<String>,
    /// Seed of all random numbers
    #[arg(long, default_value_t = 1, value_name = "N", value_parser = whole::<u64>, allow_negative_numbers = true)]
    #[serde(default = "seed")]
    pub seed: u64,
    /// Probability of a false alarm, over all tests and axes together
    #[arg(long, default_value_t = 0.01, value_name = "P", allow_hyphen_values = true)]
    #[serde(default = "alpha")]
    pub alpha: f64,
    /// Simulate these noise parameters instead of the design's own
    #[arg(long, value_name = "params.json")]
    #[serde(default)]
    pub truth: Option<PathBuf>,
    /// Draw the parameters of every run from their intervals
    #[arg(long)]
    #[serde(default)]
    pub truth_spread: bool,
    /// Measure the false-alarm probability with this many whole experiments, not from the law of the statistics
    #[arg(long, default_value_t = 0, value_name = "N", value_parser = whole::<u64>, allow_negative_numbers = true)]
    #[serde(default)]
    pub replicates: u64,
    /// Simulate this run alone; -o takes its numbers (.csv, .csv.gz or .npy)
    #[arg(long, value_name = "NUMBER", value_parser = whole::<u64>, allow_negative_numbers = true,
        conflicts_with_all = ["runs", "resume", "replicates", "json", "junit", "report", "power", "runs_for",
            "confirm"])]
    #[serde(default)]
    pub run: Option<u64>,
    /// Average NEES and NIS at every step, as a table (.csv, .csv.gz or .npy)
    #[arg(long, value_name = "FILE", conflicts_with = "run")]
    #[serde(default)]
    pub every_step: Option<PathBuf>,
    /// Go on from what -o FILE holds of the same experiment; without it, a file that is there is replaced only when
    /// the work is done
    #[arg(long, requires = "output")]
    #[serde(default)]
    pub resume: bool,
    /// Threads; the results do not depend on it
    #[arg(long, value_name = "N", value_parser = whole::<usize>, allow_negative_numbers = true)]
    #[serde(default)]
    pub threads: Option<usize>,
    /// The document: verdict, curves and sums. Unfinished work is kept there, too
    #[arg(short, long, value_name = "FILE")]
    #[serde(default)]
    pub output: Option<PathBuf>,
    #[command(flatten)]
    #[serde(default)]
    pub judging: Judging,
}

fn runs() -> String {
    "1000".into()
}

fn seed() -> u64 {
    1
}

fn alpha() -> f64 {
    0.01
}

/// What came of it.
pub enum Done {
    /// One run alone is in the table; what there is to say of it.
    One(String),
    /// The runs, not judged yet.
    Many(Box<Simulated>),
}

/// The sums of all runs, and where they come from.
pub struct Simulated {
    experiment: Experiment,
    course: Course,
    totals: Vec<Totals>,
    runs: Range<u64>,
    /// Label and name of the files that were read.
    sources: Vec<(String, String)>,
    /// Where the document belongs.
    output: Option<PathBuf>,
    threads: Option<usize>,
}

impl Request {
    /// Files that are read.
    pub fn inputs(&self) -> Vec<&Path> {
        std::iter::once(self.filter.as_path()).chain(self.truth.as_deref()).collect()
    }

    fn experiment(&self) -> anyhow::Result<Experiment> {
        let design = checked::design(&self.filter)?;
        let truth = self.truth.as_deref().map(checked::params).transpose()?;
        let steps = match &self.duration {
            Some(text) => steps(text, design.sample_rate_hz)?,
            None => default_steps(&design),
        };
        if !(self.alpha > 0.0 && self.alpha < 1.0) {
            bail!("`alpha` {}: expected a probability between 0 and 1, for example 0.01", self.alpha);
        }
        let Request { truth_spread, seed, alpha, replicates, .. } = *self;
        Ok(Experiment { design, truth, truth_spread, steps, seed, alpha, replicates })
    }
}

/// The runs; `stopping` is asked between them, and what is done by then is kept in `output`.
pub fn run(request: &Request, stopping: &(dyn Fn() -> bool + Sync)) -> anyhow::Result<Done> {
    request.judging.check()?;
    let experiment = request.experiment()?;
    if let Some(threads) = request.threads.filter(|threads| !(1..=MAX_THREADS).contains(threads)) {
        bail!("`threads` {threads}: expected 1 to {MAX_THREADS}");
    }
    if let Some(number) = request.run.filter(|number| *number >= MAX_RUN) {
        bail!("`run` {number}: expected a number below {MAX_RUN}");
    }
    on_threads(request.threads, || {
        let course = experiment.course().with_context(|| request.filter.display().to_string())?;
        match request.run {
            Some(number) => Ok(Done::One(tables::one_run(request, &experiment, &course, number)?)),
            None => Ok(Done::Many(Box::new(many_runs(request, experiment, course, stopping)?))),
        }
    })
}

/// Samples of a run of this length.
fn steps(text: &str, rate: f64) -> anyhow::Result<u64> {
    let steps = (with_unit("`duration`", text, Dimension::TIME, "600s")? * rate).round();
    if !(MIN_STEPS as f64..=MAX_STEPS as f64).contains(&steps) {
        let [least, most] = [MIN_STEPS, MAX_STEPS].map(|steps| digits(steps as f64 / rate));
        bail!("`duration` {text}: expected {least} s to {most} s ({MIN_STEPS} to {MAX_STEPS} samples at {rate} Hz)");
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
        Some(range) if range.end > MAX_RUN => bail!("`runs` {text}: expected run numbers up to {MAX_RUN}"),
        Some(range) if range.start < range.end => Ok(range),
        _ => bail!("`runs` {text}: expected a number of runs of at least 1, or a range like 500..1000"),
    }
}

fn many_runs(
    request: &Request,
    experiment: Experiment,
    course: Course,
    stopping: &(dyn Fn() -> bool + Sync),
) -> anyhow::Result<Simulated> {
    let runs = range(&request.runs)?;
    if runs.end - runs.start < 2 && !request.runs.contains("..") {
        bail!("`runs` {}: one run judges nothing; expected at least 2", request.runs);
    }
    request.judging.check_plans(&experiment)?;
    if request.every_step.is_some() && course.steps > MAX_EVERY_STEP {
        let samples = course.steps;
        bail!("`every_step`: a run has {samples} samples, expected at most {MAX_EVERY_STEP}; shorten `duration`");
    }
    let (start, next) = match request.output.as_deref().filter(|path| request.resume && path.exists()) {
        None => (None, runs.start),
        Some(path) => {
            let shard = Shard::read(path)?;
            shard.require(&experiment, "this command")?;
            if shard.runs.first != runs.start || shard.runs.end > runs.end {
                let Runs { first, end } = shard.runs;
                bail!(
                    "{}: runs: holds {first}..{end}, which is no beginning of `runs` {}; give another `output`, or \
                     leave `resume` out",
                    path.display(),
                    request.runs
                );
            }
            (Some(shard.totals(&course)?), shard.runs.end)
        }
    };
    let axes = course.axes.len() as u64;
    begin("runs", (runs.end - runs.start) * axes);
    advance((next - runs.start) * axes);
    // what is there before is not given up for unfinished work, unless that goes on from it
    let kept = request.output.as_deref().filter(|path| request.resume || !path.exists());
    let mut saved = Instant::now();
    let mut failure = None;
    let partial = |totals: &[Totals], end: u64| {
        let done = Runs { first: runs.start, end };
        document::partial_json(&experiment, &course, done, totals)
    };
    let mut pause = |totals: &[Totals], end: u64| {
        let stopping = stopping();
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
    if end < runs.end {
        let (done, all) = (end - runs.start, runs.end - runs.start);
        match (kept, &request.output) {
            (Some(path), _) => {
                let path = path.display();
                bail!(
                    "interrupted after {done} of {all} runs, which are in {path}; the same command with `resume` goes \
                     on"
                )
            }
            (None, Some(path)) => bail!(
                "interrupted after {done} of {all} runs; {} is as it was: with `resume`, or another `output`, they \
                 would have been kept",
                path.display()
            ),
            (None, None) => {
                bail!("interrupted after {done} of {all} runs; with `output` FILE they would have been kept")
            }
        }
    }
    // the runs are kept while they are judged, which can take longer than they did
    if let Some(path) = kept {
        atomic::write(path, partial(&totals, end).as_bytes())?;
    }
    if let Some(path) = &request.every_step {
        tables::every_step(path, &course, runs.clone())?;
    }
    let truth = request.truth.iter().map(|path| ("truth's parameters".to_string(), path.display().to_string()));
    let filter = std::iter::once(("filter".to_string(), request.filter.display().to_string()));
    let (sources, output) = (filter.chain(truth).collect(), request.output.clone());
    Ok(Simulated { experiment, course, totals, runs, sources, output, threads: request.threads })
}
