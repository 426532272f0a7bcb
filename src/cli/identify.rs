//! `kfdesign identify`.

use super::Status;

/// Noise parameters from a log at rest, with intervals
#[derive(Debug, clap::Args)]
pub struct Args {}

pub(super) fn run(args: &Args) -> anyhow::Result<Status> {
    let _ = args;
    todo!()
}
