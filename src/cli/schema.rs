//! `kfdesign schema`.

use super::Status;

/// The JSON schema of a document
#[derive(Debug, clap::Args)]
pub struct Args {}

pub(super) fn run(args: &Args) -> anyhow::Result<Status> {
    let _ = args;
    todo!()
}
