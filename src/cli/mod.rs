//! One file per command; the only place that prints and exits (floor 9).
//!
//! Exit status: 0 done and consistent; 1 done, but a stated check failed or could not be judged; 2 could not do it,
//! with one clear line. It is that of the work, once known, whatever happens to stdout or stderr.

pub mod airplane;
pub mod allan;
pub mod closed_loop;
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
pub mod named;
pub mod output;
pub mod plan;
mod plot;
pub mod replay;
pub mod schema;
#[cfg(feature = "serve")]
pub mod serve;
pub mod shell;
mod signals;
pub mod simulate;
mod stop;
pub mod trim;
pub mod tune;

use std::ffi::OsString;
use std::path::Path;

use clap::error::ErrorKind;
use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};

use self::output::{Detail, exit_status, print_help, say};
use self::shell::quoted;
pub use self::signals::watch_signals;
pub use self::stop::Stop;
use crate::consistency::Verdict;
use crate::input::InputError;
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
    after_help = "Begin with: kfdesign identify LOG -o params.json, kfdesign tune params.json -o filter.json,\n\
                  \u{20}           kfdesign replay filter.json LOG; each says which command comes next\n\
                  Exit status: 0 done and consistent; 1 done, but a stated check failed, or the verdict is \
                  inconclusive (see --allow-inconclusive); 2 could not do it. It is that of the work, whatever becomes \
                  of its output.\nUnits are never guessed: the log's header or --unit says them."
)]
pub struct Cli {
    #[command(subcommand)]
    command: Command,
    /// Every table and note, not only the answer
    #[arg(short, long, global = true, display_order = 1000)]
    verbose: bool,
    /// The verdict alone
    #[arg(short, long, global = true, display_order = 1000)]
    quiet: bool,
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
    Loop(closed_loop::Args),
    Tune(tune::Args),
    Replay(replay::Args),
    Montecarlo(montecarlo::Args),
    Merge(montecarlo::MergeArgs),
    Export(export::Args),
    Import(import::Args),
    Datasheet(datasheet::Args),
    #[cfg(feature = "serve")]
    Serve(serve::Args),
    Schema(schema::Args),
    Completions(completions::Args),
    Man(man::Args),
}

/// Runs a command line, whose first word is the name of the program, and gives its exit status. Signals are the
/// caller's: see [`watch_signals`].
pub fn run(args: impl IntoIterator<Item = OsString>, stop: &Stop) -> u8 {
    let args: Vec<OsString> = args.into_iter().collect();
    let parsed = command().try_get_matches_from(&args).and_then(|found| Cli::from_arg_matches(&found));
    let cli = match parsed {
        Ok(cli) => cli,
        // the help, where nothing was asked for
        Err(help) if help.kind() == ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand => {
            print_help(&help);
            return 2;
        }
        Err(error) if error.use_stderr() => {
            say(&format!("kfdesign: {}", usage_error(&error, &args)));
            return 2;
        }
        Err(help) => {
            // help and version
            print_help(&help);
            return exit_status(0);
        }
    };
    output::set_detail(match (cli.quiet, cli.verbose) {
        (false, false) => Detail::Brief,
        (false, true) => Detail::Full,
        (true, false) => Detail::Quiet,
        (true, true) => {
            say("kfdesign: --quiet and --verbose contradict each other: give one of them");
            return 2;
        }
    });
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
        Command::Loop(args) => closed_loop::run(&args),
        Command::Tune(args) => tune::run(&args),
        Command::Replay(args) => replay::run(&args),
        Command::Montecarlo(args) => montecarlo::run(&args, stop),
        Command::Merge(args) => montecarlo::merge(&args),
        Command::Export(args) => export::run(&args),
        Command::Import(args) => import::run(&args),
        Command::Datasheet(args) => datasheet::run(&args),
        #[cfg(feature = "serve")]
        Command::Serve(args) => serve::run(&args),
        Command::Schema(args) => schema::run(&args),
        Command::Completions(args) => completions::run(&args),
        Command::Man(args) => man::run(&args),
    };
    let result = output::watched(command).unwrap_or_else(|stopped| Err(stopped.into()));
    exit_status(match result {
        Ok(Status::Done) => 0,
        Ok(Status::CheckFailed) => 1,
        Err(error) => {
            let missing = error.chain().find_map(|cause| cause.downcast_ref::<InputError>()).map(|e| &e.missing);
            let example = missing.filter(|missing| !missing.is_empty()).map(|missing| with_options(&args, missing));
            say(&format!("kfdesign: {}{}", in_one_line(&error), example.unwrap_or_default()));
            2
        }
    })
}

/// The command with options that were missing, to copy.
fn with_options(args: &[OsString], missing: &[(&str, String)]) -> String {
    let typed = args.iter().skip(1).map(|word| quoted(&word.to_string_lossy()));
    let options = missing.iter().flat_map(|(option, value)| [format!("--{option}"), quoted(value)]);
    let command: Vec<String> = std::iter::once("kfdesign".into()).chain(typed).chain(options).collect();
    plain(&format!("; for example: {}", command.join(" "))).into_owned()
}

/// Where the machine gives no threads, for want of processes or of memory, this one does all the work. Rayon makes
/// its threads at the first need and cannot go on without them, so it is tried before.
fn find_threads() {
    if rayon::ThreadPoolBuilder::new().build().is_err() {
        let _ = rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build_global();
    }
}

/// The error with its causes, each once: many say theirs themselves.
pub fn in_one_line(error: &anyhow::Error) -> String {
    let mut said: Vec<String> = Vec::new();
    for cause in error.chain().map(ToString::to_string) {
        if !said.iter().any(|text| text.contains(&cause)) {
            said.push(cause);
        }
    }
    // also of what a file is called
    without_system(&plain(&said.join(": ")))
}

/// Words of the operating system, as those of the program: no number, and what there is in place of what there is
/// not.
fn without_system(text: &str) -> String {
    let mut parts = text.split(" (os error ");
    let mut out = parts.next().unwrap_or_default().to_string();
    out.extend(parts.map(|part| part.split_once(')').map_or("", |(_, rest)| rest)));
    out.replace("No such file or directory", "there is no such file").replace("Is a directory", "it is a folder")
}

/// clap's message as one line: what was found, and what to do: the name that may be meant, or what to type.
fn usage_error(error: &clap::Error, args: &[OsString]) -> String {
    let text = error.render().to_string();
    let parts = text.split("\n\n").map(|part| part.split_whitespace().collect::<Vec<_>>().join(" "));
    let parts: Vec<String> = parts.collect();
    let part = |prefix: &str| parts.iter().find_map(|part| part.strip_prefix(prefix));
    let message = parts.first().map_or("", |part| part.trim_start_matches("error: "));
    let command = command();
    // of those that are typed the first is the command
    let typed = args.iter().skip(1).find_map(|word| command.find_subcommand(word));
    let file =
        args.get(1).filter(|word| typed.is_none() && Path::new(word).exists()).map(|word| word.to_string_lossy());
    let hint = match (file, part("tip: "), part("Usage: "), typed) {
        (Some(file), ..) => {
            format!("it is a file; what is to be done with it? kfdesign info {file} says what is in it")
        }
        // "a similar argument exists: '--unit'"
        (None, Some(tip), ..) => tip.to_string(),
        (None, None, Some(usage), Some(typed)) => {
            let name = typed.get_name();
            let help = typed.get_after_help().map(ToString::to_string).unwrap_or_default();
            let example = help.lines().next().and_then(|line| line.split_once(": ")).map(|(_, example)| example.trim());
            let example = example.map_or_else(String::new, |example| format!("; for example: {example}"));
            format!("usage: {usage}; options: kfdesign {name} -h{example}")
        }
        _ => "kfdesign --help, or kfdesign COMMAND --help, lists what there is".to_string(),
    };
    format!("{message} ({hint})")
}

/// The command line, whose short help has the options that a person needs first.
fn command() -> clap::Command {
    let short = |(name, first): &(&str, &[&str]), command: clap::Command| {
        let shown = |arg: &clap::Arg| arg.is_positional() || arg.get_long().is_some_and(|long| first.contains(&long));
        command.mut_subcommand(name, |sub| {
            let example = sub.get_after_help().map(ToString::to_string).unwrap_or_default();
            sub.mut_args(|arg| if shown(&arg) { arg } else { arg.hide_short_help(true) })
                .after_help(format!("{example}\nEvery option: kfdesign {name} --help"))
                .after_long_help(example)
        })
    };
    FIRST.iter().fold(Cli::command(), |command, entry| short(entry, command))
}

/// Options in the short help of a command: of the many there are, those without which little can be done.
const FIRST: [(&str, &[&str]); 12] = [
    ("allan", &["columns", "unit", "rate", "output", "plot"]),
    ("identify", &["columns", "sensor", "unit", "rate", "output", "report"]),
    ("compare", &["columns", "unit", "rate", "parameters", "report"]),
    ("inflate", &["columns", "unit", "rate", "from", "output"]),
    ("simulate", &["output", "duration", "seed", "rate", "true-rate"]),
    ("tune", &["output", "report", "plant", "objective", "log", "truth"]),
    ("replay", &["columns", "unit", "rate", "output", "report", "allow-inconclusive"]),
    ("montecarlo", &["runs", "duration", "truth", "output", "report", "junit"]),
    ("merge", &["output", "report", "junit"]),
    ("export", &["to", "output", "accelerometer", "rate", "inflate"]),
    ("trim", &["speed", "altitude", "climb", "bank", "output", "report"]),
    ("fly", &["output", "duration", "runs", "seed", "plot"]),
];
