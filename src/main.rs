//! The `kfdesign` command: parse, run, exit. Everything else is in the library.

use std::process::ExitCode;
use std::sync::Arc;

use kfdesign::cli::{self, Stop};

fn main() -> ExitCode {
    let stop = Arc::new(Stop::default());
    cli::watch_signals(&stop);
    ExitCode::from(cli::run(std::env::args_os(), &stop))
}
