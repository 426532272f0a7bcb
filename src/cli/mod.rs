//! One file per command; the only place that prints and exits (floor 9).
//!
//! Exit status: 0 done and consistent; 1 done, but a stated check failed or could not be judged; 2 could not do it,
//! with one clear line. It is that of the work, once known, whatever happens to stdout or stderr.

pub mod airplane;
pub mod allan;
pub mod compare;
pub mod completions;
pub mod datasheet;
pub mod export;
mod files;
pub mod fly;
pub mod identify;
pub mod import;
pub mod inflate;
pub mod info;
pub mod man;
pub mod montecarlo;
pub mod output;
pub mod plan;
pub mod replay;
pub mod schema;
pub mod simulate;
mod stop;
pub mod trim;
pub mod tune;

use std::ffi::OsString;

use clap::{Parser, Subcommand};

use self::output::{exit_status, print_help, say};
pub use self::stop::Stop;
use crate::consistency::Verdict;
use crate::units::plain;

/// How a command ended when it could do its work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// Exit 0.
    Done,
    /// Exit 1: done, but a stated check failed, or nothing could be judged.
    CheckFailed,
}

/// What a verdict that says nothing counts for.
#[derive(Clone, Copy, Debug, Default, clap::Args)]
pub struct VerdictFlags {
    /// Exit status 0, not 1, also when the verdict is inconclusive
    #[arg(long)]
    allow_inconclusive: bool,
}

impl VerdictFlags {
    /// The status that these verdicts together stand for.
    fn status(self, verdicts: impl IntoIterator<Item = Verdict>) -> Status {
        let good = |verdict: Verdict| match verdict {
            Verdict::Consistent => true,
            Verdict::Inconclusive => self.allow_inconclusive,
            Verdict::Inconsistent => false,
        };
        if verdicts.into_iter().all(good) { Status::Done } else { Status::CheckFailed }
    }
}

/// Kalman-filter design workbench for inertial sensors: identify, tune, replay, prove.
#[derive(Debug, Parser)]
#[command(
    name = "kfdesign",
    version,
    about,
    after_help = "Exit status: 0 done and consistent; 1 done, but a stated check failed, or the verdict is inconclusive\n(see --allow-inconclusive); 2 could not do it. It is that of the work, whatever becomes of its output.\nUnits are never guessed: the log's header or --unit says them."
)]
pub struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Info(info::Args),
    Allan(allan::Args),
    Identify(identify::Args),
    Plan(plan::Args),
    Compare(compare::Args),
    Inflate(inflate::Args),
    Simulate(simulate::Args),
    Airplane(airplane::Args),
    Trim(trim::Args),
    Fly(fly::Args),
    Tune(tune::Args),
    Replay(replay::Args),
    Montecarlo(montecarlo::Args),
    Merge(montecarlo::MergeArgs),
    Export(export::Args),
    Import(import::Args),
    Datasheet(datasheet::Args),
    Schema(schema::Args),
    Completions(completions::Args),
    Man(man::Args),
}

/// Runs a command line, whose first word is the name of the program, and gives its exit status. Signals are the
/// caller's: see [`Stop`].
pub fn run(args: impl IntoIterator<Item = OsString>, stop: &Stop) -> u8 {
    let cli = match Cli::try_parse_from(args) {
        Ok(cli) => cli,
        Err(error) if error.use_stderr() => {
            say(&format!("kfdesign: {}", usage_error(&error)));
            return 2;
        }
        Err(help) => {
            // help and version
            print_help(&help);
            return exit_status(0);
        }
    };
    find_threads();
    let command = || match cli.command {
        Command::Info(args) => info::run(&args),
        Command::Allan(args) => allan::run(&args),
        Command::Identify(args) => identify::run(&args),
        Command::Plan(args) => plan::run(&args),
        Command::Compare(args) => compare::run(&args),
        Command::Inflate(args) => inflate::run(&args),
        Command::Simulate(args) => simulate::run(&args),
        Command::Airplane(args) => airplane::run(&args),
        Command::Trim(args) => trim::run(&args),
        Command::Fly(args) => fly::run(&args),
        Command::Tune(args) => tune::run(&args),
        Command::Replay(args) => replay::run(&args),
        Command::Montecarlo(args) => montecarlo::run(&args, stop),
        Command::Merge(args) => montecarlo::merge(&args),
        Command::Export(args) => export::run(&args),
        Command::Import(args) => import::run(&args),
        Command::Datasheet(args) => datasheet::run(&args),
        Command::Schema(args) => schema::run(&args),
        Command::Completions(args) => completions::run(&args),
        Command::Man(args) => man::run(&args),
    };
    let result = output::watched(command).unwrap_or_else(|stopped| Err(stopped.into()));
    exit_status(match result {
        Ok(Status::Done) => 0,
        Ok(Status::CheckFailed) => 1,
        Err(error) => {
            say(&format!("kfdesign: {}", in_one_line(&error)));
            2
        }
    })
}

/// Where the machine gives no threads, for want of processes or of memory, this one does all the work. Rayon makes
/// its threads at the first need and cannot go on without them, so it is tried before.
fn find_threads() {
    if rayon::ThreadPoolBuilder::new().build().is_err() {
        let _ = rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build_global();
    }
}

/// The error with its causes, each once: many say theirs themselves.
fn in_one_line(error: &anyhow::Error) -> String {
    let mut said: Vec<String> = Vec::new();
    for cause in error.chain().map(ToString::to_string) {
        if !said.iter().any(|text| text.contains(&cause)) {
            said.push(cause);
        }
    }
    // also of what a file is called
    plain(&said.join(": ")).into_owned()
}

/// clap's message as one line: what was found and what is expected, without the usage block.
fn usage_error(error: &clap::Error) -> String {
    if error.kind() == clap::error::ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand {
        return "no subcommand: kfdesign --help lists them".into();
    }
    let text = error.render().to_string();
    let message = text.split("\n\n").next().unwrap_or(&text);
    let words: Vec<&str> = message.trim_start_matches("error: ").split_whitespace().collect();
    format!("{} (kfdesign --help, or kfdesign COMMAND --help, lists what there is)", words.join(" "))
}
