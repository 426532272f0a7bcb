//! `kfdesign montecarlo` and `kfdesign merge`.

use std::path::{Path, PathBuf};

use super::files::{self, Kind};
use super::output::{print_report, print_text};
use super::{Status, Stop, VerdictFlags};
use crate::export::{atomic, junit};
use crate::ops::montecarlo::{Done, Judging, Request, Simulated, merge as merging, run as montecarlo};
use crate::view;

/// Many simulated runs through filter.json: does its covariance tell the truth?
///
/// The verdict is a gate for CI: exit status 0 consistent, 1 inconsistent. A true filter is called inconsistent with
/// probability --alpha, all tests and axes together; that probability is measured and printed.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples: kfdesign montecarlo filter.json --runs 1000 --duration 600s\n          \
kfdesign montecarlo filter.json --truth params.json --junit montecarlo.xml --report montecarlo.html\n          \
kfdesign montecarlo filter.json --runs 0..500 -o a.json    (another machine: --runs 500..1000 -o b.json; then kfdesign \
merge a.json b.json)")]
pub struct Args {
    #[command(flatten)]
    request: Request,
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
    #[command(flatten)]
    request: merging::Request,
    #[command(flatten)]
    outputs: Outputs,
}

#[derive(Debug, clap::Args)]
struct Outputs {
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
}

pub(super) fn run(args: &Args, stop: &Stop) -> anyhow::Result<Status> {
    let Args { request, outputs } = args;
    // the runs end at their next checkpoint, but not what judges them
    stop.heed(request.run.is_none());
    let kind = if request.run.is_some() { Kind::Table } else { Kind::Json };
    let own = [("-o", &request.output, kind), ("--every-step", &request.every_step, Kind::Table)];
    let written = outputs.check(&own, &request.inputs())?;
    match montecarlo(request, &|| stop.is_wanted())? {
        Done::One(said) => {
            if !outputs.json {
                print_text(&format!("{said}\n"));
            }
            Ok(Status::Done)
        }
        Done::Many(simulated) => {
            stop.heed(false);
            outputs.finish(*simulated, &request.judging, &written)
        }
    }
}

pub(super) fn merge(args: &MergeArgs) -> anyhow::Result<Status> {
    let MergeArgs { request, outputs } = args;
    let inputs: Vec<&Path> = request.shards.iter().map(PathBuf::as_path).collect();
    let written = outputs.check(&[("-o", &request.output, Kind::Json)], &inputs)?;
    outputs.finish(merging::run(request)?, &request.judging, &written)
}

impl Outputs {
    /// All outputs; what there is to say of them when they are written.
    fn check(&self, own: &[files::Output<'_>], inputs: &[&Path]) -> anyhow::Result<Vec<String>> {
        let pages = [("--junit", &self.junit, Kind::Xml), ("--report", &self.report, Kind::Html)];
        let outputs = [own, &pages].concat();
        files::check(&outputs, inputs)?;
        Ok(files::written(&outputs))
    }

    /// The verdict on the sums, everywhere it was asked for.
    fn finish(&self, simulated: Simulated, judging: &Judging, written: &[String]) -> anyhow::Result<Status> {
        let mut judged = simulated.judge(judging)?;
        if let Some(path) = &self.junit {
            atomic::write(path, junit::report(&judged.outcome)?.as_bytes())?;
        }
        if self.report.is_some() {
            judged.complete()?;
        }
        let mut report = view::montecarlo::montecarlo(judged.shown());
        files::write_page(self.report.as_deref(), &report)?;
        let status = self.judging.status([judged.outcome.verdict]);
        if self.json {
            print_text(&judged.json);
        } else {
            report.written = written.to_vec();
            print_report(&report, status);
        }
        Ok(status)
    }
}
