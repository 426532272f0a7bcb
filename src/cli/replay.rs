//! `kfdesign replay`.

use std::path::PathBuf;

use super::files::{self, Kind};
use super::output::{print_json, print_report};
use super::plot::Plot;
use super::{Status, VerdictFlags};
use crate::consistency::Verdict;
use crate::filter::AttitudeDesign;
use crate::ops::replay::attitude::linear_only;
use crate::ops::replay::{Done, Request, run as replay};
use crate::view;

/// A recorded log through filter.json, with a verdict
///
/// Exit status 1 when the verdict is inconsistent, and when it is inconclusive (a log too short to judge the drift)
/// unless --allow-inconclusive.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example: kfdesign replay filter.json log.csv -o estimates.csv --innovations")]
#[command(mut_arg("plot", |plot| plot.help("Figures of every axis")))]
pub struct Args {
    #[command(flatten)]
    request: Request,
    /// One HTML page with tables and figures
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    #[command(flatten)]
    plot: Plot,
    /// One JSON document on stdout
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    judging: VerdictFlags,
}

pub(super) fn run(args: &Args) -> anyhow::Result<Status> {
    let request = &args.request;
    request.check()?;
    let outputs = [("-o", &request.output, Kind::Table), ("--report", &args.report, Kind::Html), args.plot.output()];
    files::check(&outputs, &[&request.filter, &request.log])?;
    for (option, given) in [("report", args.report.is_some()), ("plot", args.plot.wanted())] {
        if given && AttitudeDesign::is(&request.filter) {
            return Err(linear_only(option, &request.filter));
        }
    }
    match replay(request)? {
        Done::Linear(result, unit) => {
            let mut report = view::replay::replay(&result, &request.filter.display().to_string(), unit.as_ref());
            args.plot.write("Replay", &report)?;
            files::write_page(args.report.as_deref(), &report)?;
            let status = args.judging.status([result.verdict]);
            if args.json {
                print_json(&result)?;
            } else {
                report.written = files::written(&outputs);
                let honest = result.verdict == Verdict::Consistent;
                report.next = honest.then(|| format!("kfdesign montecarlo {}", request.filter.display()));
                print_report(&report, status);
            }
            Ok(status)
        }
        Done::Attitude(result, design) => {
            let status = args.judging.status([result.verdict]);
            if args.json {
                print_json(&result)?;
            } else {
                let mut report = view::replay::attitude(&result, &design);
                report.written = files::written(&outputs);
                print_report(&report, status);
            }
            Ok(status)
        }
    }
}
