//! `kfdesign simulate`.

use super::Status;

/// A sensor stream with truth from params.json
#[derive(Debug, clap::Args)]
pub struct Args {}

pub(super) fn run(args: &Args) -> anyhow::Result<Status> {
    let _ = args;
    todo!()
}
