//! `kfdesign replay`.

use super::Status;

/// A recorded log through filter.json, with a verdict
#[derive(Debug, clap::Args)]
pub struct Args {}

pub(super) fn run(args: &Args) -> anyhow::Result<Status> {
    let _ = args;
    todo!()
}
