//! `kfdesign tune`.

use super::Status;

/// The augmented Kalman filter from params.json
#[derive(Debug, clap::Args)]
pub struct Args {}

pub(super) fn run(args: &Args) -> anyhow::Result<Status> {
    let _ = args;
    todo!()
}
