//! `kfdesign identify`.

use std::path::PathBuf;

use super::Status;
use super::files::{self, Kind};
use super::output::{is_brief, print_json, print_report, say};
use super::plot::Plot;
use crate::export::atomic;
use crate::ops::identify::{Request, run as identify};
use crate::params::Params;
use crate::view;

/// Noise parameters from a log at rest, with intervals
///
/// What the log cannot tell is listed under not_identified with the reason and, where it can be said, the log length
/// that would tell; it is never filled in with a number.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Example: kfdesign identify static.csv --unit deg/s --rate 100 -o params.json --report identify.html"
)]
#[command(mut_arg("plot", |plot| plot.help("Allan curve of every axis with the fitted components")))]
pub struct Args {
    #[command(flatten)]
    request: Request,
    /// The parameters: params.json
    #[arg(short, long, value_name = "FILE.json")]
    output: Option<PathBuf>,
    /// One HTML page with tables and figures
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    #[command(flatten)]
    plot: Plot,
    /// One JSON document on stdout
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &Args) -> anyhow::Result<Status> {
    let outputs = [("-o", &args.output, Kind::Json), ("--report", &args.report, Kind::Html), args.plot.output()];
    files::check(&outputs, &args.request.logs.iter().map(PathBuf::as_path).collect::<Vec<_>>())?;
    let done = identify(&args.request)?;
    if let Some(path) = &args.output {
        atomic::write(path, done.params.to_json().as_bytes())?;
    }
    let mut report = view::identify::identify(&done.params, &done.axes, done.shared.as_ref());
    args.plot.write(&format!("{}: overlapping Allan deviation", done.name()), &report)?;
    files::write_page(args.report.as_deref(), &report)?;
    let status = status(&done.params, args);
    if args.json {
        print_json(&done.document())?;
    } else {
        report.written = files::written(&outputs);
        report.next = Some(match &args.output {
            Some(path) => format!("kfdesign tune {}", path.display()),
            None => "the same with -o params.json, then kfdesign tune params.json".into(),
        });
        print_report(&report, status);
    }
    Ok(status)
}

/// A failed check is said on stderr, in one line, where the answer does not begin with it.
fn status(params: &Params, args: &Args) -> Status {
    let Some(failed) = params.failed_check() else { return Status::Done };
    if args.json || !is_brief() {
        let kept = args.output.as_deref().map_or_else(String::new, |path| format!(", kept in {}", path.display()));
        say(&format!("check failed: {failed} (exit status 1{kept})"));
    }
    Status::CheckFailed
}
