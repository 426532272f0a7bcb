//! `kfdesign serve`.

use std::path::PathBuf;
use std::time::Duration;

use super::Status;
use super::output::{open, print_text, say};
use crate::ops::amounts::{whole, with_unit};
use crate::serve::{Options, serve};
use crate::units::Dimension;

/// Bytes of an uploaded file: a log of a day at 1 kHz.
const LARGEST_UPLOAD: u64 = 1 << 30;

/// The workbench in the browser: logs, noise, design, gate and loop on one page
///
/// It serves this machine alone, to whoever has the address that it prints; from another machine, go through
/// ssh -L 8765:127.0.0.1:8765. Files of the folder are those of the command line, and the other way round.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example: kfdesign serve flights/")]
pub struct Args {
    /// Where logs are, and documents are saved
    #[arg(default_value = ".")]
    folder: PathBuf,
    /// Port; where it is taken, the next free one of twenty; 0 for any
    #[arg(long, default_value_t = 8765, value_name = "N")]
    port: u16,
    /// Do not open the browser
    #[arg(long)]
    no_open: bool,
    /// Write nothing into the folder
    #[arg(long)]
    read_only: bool,
    /// Jobs at a time
    #[arg(long, default_value_t = 1, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=64))]
    jobs: u64,
    /// End after so long without a request
    #[arg(long, default_value = "8h", value_name = "TIME")]
    idle: String,
    /// Largest file that the page may upload, bytes
    #[arg(long, default_value_t = LARGEST_UPLOAD, value_name = "BYTES", value_parser = whole::<u64>)]
    upload_limit: u64,
}

pub(super) fn run(args: &Args) -> anyhow::Result<Status> {
    let idle = with_unit("`idle`", &args.idle, Dimension::TIME, "8h")?;
    let options = Options {
        folder: &args.folder,
        port: args.port,
        read_only: args.read_only,
        jobs: usize::try_from(args.jobs)?,
        idle: Duration::try_from_secs_f64(idle)?,
        upload_limit: args.upload_limit,
    };
    let ready = |address: &str| {
        print_text(&format!("{address}\n"));
        say("Ctrl-C stops");
        if !args.no_open {
            open(address);
        }
    };
    serve(&options, ready).map_err(anyhow::Error::msg)?;
    say(&format!("nobody asked for {}: stopped", args.idle));
    Ok(Status::Done)
}
