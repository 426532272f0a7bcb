//! `kfdesign datasheet`.

use std::path::PathBuf;

use super::Status;
use super::files::{self, Kind};
use super::import::finish;
use crate::ops::datasheet::{Request, run as datasheet};

/// Noise parameters from the words that datasheets print
///
/// Every value carries the unit of the datasheet ("0.15 deg/sqrt(h)", "2.8 mdps/sqrt(Hz)", "90 ug/sqrt(Hz)", "2.3
/// deg/h"); the units tell whether it is a gyro or an accelerometer. The rule behind each parameter is said, and
/// what a datasheet leaves open is asked for. `compare FILE LOG --parameters` puts the numbers beside what a log
/// says.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Example: kfdesign datasheet --angle-random-walk \"0.13 deg/sqrt(h)\" --bias-instability \"2.3 \
                  deg/h\" --rate 100 -o params.json"
)]
pub struct Args {
    #[command(flatten)]
    request: Request,
    /// The parameters
    #[arg(short, long, value_name = "FILE.json")]
    output: Option<PathBuf>,
    /// The parameters on stdout, one document
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &Args) -> anyhow::Result<Status> {
    files::check(&[("-o", &args.output, Kind::Json)], &[])?;
    let found = datasheet(&args.request)?;
    finish(&found, &[(&args.output, found.sensors.first())], args.json)
}
