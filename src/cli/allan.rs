//! `kfdesign allan`.

use std::path::{Path, PathBuf};

use anyhow::bail;

use super::Status;
use super::files::{self, Kind};
use super::output::{print_json, print_report};
use super::plot::Plot;
use crate::ops::allan::{Done, Request, run as allan};
use crate::report::{Report, Section};
use crate::view;

/// What `--plot` shows.
const FIGURES: &str = "Figure with interval band, fitted components, and N, B, K where they are read";

/// Allan deviations of a log, with intervals and noise identification
#[derive(Debug, clap::Args)]
#[command(mut_arg("plot", |plot| plot.help(FIGURES)))]
pub struct Args {
    #[command(flatten)]
    request: Request,
    /// Further logs, read alike; with them --plot has a panel for each axis, with a curve for each log
    #[arg(value_name = "LOG")]
    more: Vec<PathBuf>,
    /// One JSON document on stdout
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    plot: Plot,
    /// All curves in one panel
    #[arg(long, requires = "plot")]
    overlay: bool,
    /// The JSON document into a file
    #[arg(short, long, value_name = "FILE.json")]
    output: Option<PathBuf>,
}

pub(super) fn run(args: &Args) -> anyhow::Result<Status> {
    let outputs = [("-o", &args.output, Kind::Json), args.plot.output()];
    let logs: Vec<&Path> = [&args.request.log].into_iter().chain(&args.more).map(PathBuf::as_path).collect();
    files::check(&outputs, &logs)?;
    if !args.more.is_empty() && (args.json || args.output.is_some()) {
        bail!("a document is of one log: leave out {}", args.more[0].display());
    }
    let of = |log: &&Path| allan(&Request { log: log.to_path_buf(), ..args.request.clone() });
    let done: Vec<Done> = logs.iter().map(of).collect::<anyhow::Result<_>>()?;
    if let [done] = &done[..] {
        files::write_json(args.output.as_deref(), &done.document)?;
        if args.json {
            print_json(&done.document)?;
        }
    }
    let (quantity, deviation) = (done[0].document.quantity, done[0].document.deviation.name());
    if let Some(other) = done.iter().find(|done| done.document.quantity != quantity) {
        bail!("{} and {} hold different quantities; one panel has one", done[0].name, other.name);
    }
    let title = format!("{}: {deviation}", done.iter().map(|done| done.name.as_str()).collect::<Vec<_>>().join(", "));
    let next = format!("kfdesign identify {} -o params.json", done[0].name);
    let logs: Vec<_> = done.into_iter().map(|done| (done.name, done.axes)).collect();
    if args.overlay || logs.len() > 1 {
        let sections = view::allan::overlay(&logs, args.overlay);
        args.plot.write(&title, &Report { sections, ..Report::default() })?;
    }
    let last = logs.len() - 1;
    for (i, (name, axes)) in logs.iter().enumerate() {
        let mut report = view::allan::allan(name, axes);
        if last > 0 {
            // axes of several logs have the same names
            report.sections.insert(0, Section::new("").paragraph(format!("{name}:")));
        }
        if !args.overlay && last == 0 {
            args.plot.write(&title, &report)?;
        }
        if i == last {
            report.written = files::written(&outputs);
            report.next = (last == 0).then(|| next.clone());
        }
        if !args.json {
            print_report(&report, Status::Done);
        }
    }
    Ok(Status::Done)
}
