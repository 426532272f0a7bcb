//! `kfdesign allan`.

use super::Status;

/// Allan deviations of a log, with intervals and noise identification
#[derive(Debug, clap::Args)]
pub struct Args {}

pub(super) fn run(args: &Args) -> anyhow::Result<Status> {
    let _ = args;
    todo!()
}
