//! What every command writes to stdout and stderr: reports, documents, notes, progress.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::io::{ErrorKind, IsTerminal, Write};
use std::process::Stdio;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};

use anstream::stream::RawStream;
use anstream::{AutoStream, ColorChoice};
use anstyle::AnsiColor;
use clap::{Arg, Command, CommandFactory};
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;

use super::Status;
use crate::export::atomic::in_words;
use crate::numerics::progress::{self, Progress, Stopped};
use crate::report::{Report, terminal};

/// Characters in a line where nobody says how wide the terminal is, and at most: what a person reads at a glance.
const WIDTH: usize = 80;

/// Warnings before an answer that is to be seen at a glance: those of a log are of each axis, and the answer counts
/// them.
const MOST_WARNINGS: usize = 3;

/// How much a person wants to see.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Detail {
    /// The verdict.
    Quiet,
    /// What a person acts on.
    #[default]
    Brief,
    /// Every table and note.
    Full,
}

/// Of the command that runs.
static DETAIL: Mutex<Detail> = Mutex::new(Detail::Brief);

/// Why stdout did not take all that was meant for it.
static LOST: OnceLock<String> = OnceLock::new();

/// One machine-readable document on stdout.
pub fn print_json<T: Serialize>(value: &T) -> anyhow::Result<()> {
    let mut text = serde_json::to_string_pretty(value)?;
    text.push('\n');
    print_text(&text);
    Ok(())
}

/// What the library calls an option, `start`, as a shell knows it: --start; `output` is -o.
pub fn with_flags(text: &str) -> Cow<'_, str> {
    static FLAGS: OnceLock<BTreeMap<String, String>> = OnceLock::new();
    let shown = |argument: &Arg| {
        let long = argument.get_long()?;
        Some((long.to_string(), argument.get_short().map_or(format!("--{long}"), |short| format!("-{short}"))))
    };
    let all = || {
        let command = super::Cli::command();
        command.get_subcommands().flat_map(Command::get_arguments).filter_map(shown).collect()
    };
    if !text.contains('`') {
        return Cow::Borrowed(text);
    }
    let flags = FLAGS.get_or_init(all);
    let mut parts = text.split('`');
    let mut out = parts.next().unwrap_or_default().to_string();
    // a word between two marks, or not
    let mut opened = true;
    for part in parts {
        let flag = part.replace('_', "-");
        if let Some(flag) = flags.get(&flag).filter(|_| opened) {
            out += flag;
            opened = false;
        } else if opened {
            out += &format!("`{part}");
        } else {
            out += part;
            opened = true;
        }
    }
    Cow::Owned(out)
}

/// Text on stdout, as it is. Nothing here changes what the work has found: see [`exit_status`].
pub fn print_text(text: &str) {
    let mut out = std::io::stdout().lock();
    let written = out.write_all(text.as_bytes()).and_then(|()| out.flush());
    if let Err(error) = written
        // a reader that has seen enough is no error
        && error.kind() != ErrorKind::BrokenPipe
    {
        let _ = LOST.set(in_words(&error));
    }
}

/// Who asks for less or more.
pub fn set_detail(detail: Detail) {
    *DETAIL.lock().unwrap_or_else(PoisonError::into_inner) = detail;
}

fn detail() -> Detail {
    *DETAIL.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A person sees the answer and no more.
pub fn is_brief() -> bool {
    detail() == Detail::Brief
}

/// A report for a person: the answer, or every table, as wide as the terminal, and with whole lines where stdout is
/// none. `status`: of the work.
pub fn print_report(report: &Report<'_>, status: Status) {
    let width = terminal_size::terminal_size_of(std::io::stdout()).map(|(width, _)| usize::from(width.0));
    let ending = if status == Status::CheckFailed { " (exit 1)" } else { "" };
    let text = match detail() {
        Detail::Quiet => terminal::first_line(report, ending).map_or_else(String::new, |line| line + "\n"),
        Detail::Brief => terminal::brief(report, ending, width.map_or(WIDTH, |width| width.min(WIDTH))),
        Detail::Full => terminal::full(report, width),
    };
    let text = with_flags(&text);
    print_text(&if colours(&std::io::stdout()) { painted(&text) } else { text.into_owned() });
}

/// Whether the stream takes colours: a terminal, unless NO_COLOR or CLICOLOR=0 say otherwise.
fn colours(stream: &impl RawStream) -> bool {
    AutoStream::choice(stream) != ColorChoice::Never
}

/// Verdicts and warnings in colour.
fn painted(text: &str) -> String {
    let paint = |word: &str, colour: AnsiColor| {
        let style = colour.on_default().bold();
        format!("{style}{word}{style:#}")
    };
    let line = |line: &str| {
        let first = line.split([' ', ':']).next().unwrap_or_default();
        let colour = match first {
            "CONSISTENT" | "consistent" => Some(AnsiColor::Green),
            "INCONSISTENT" | "inconsistent" | "CHECK" => Some(AnsiColor::Red),
            "INCONCLUSIVE" | "inconclusive" | "warning" => Some(AnsiColor::Yellow),
            _ => None,
        };
        let line = match colour {
            Some(colour) => line.replacen(first, &paint(first, colour), 1),
            None => line.to_owned(),
        };
        line.replace(" FAIL", &format!(" {}", paint("FAIL", AnsiColor::Red)))
    };
    text.split('\n').map(line).collect::<Vec<_>>().join("\n")
}

/// An address in the browser, which is to print nothing here; where that fails, a person has the address.
pub fn open(address: &str) {
    let program = match std::env::consts::OS {
        "macos" => "open",
        "windows" => "explorer",
        _ => "xdg-open",
    };
    let mut command = std::process::Command::new(program);
    command.arg(address).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    if command.spawn().is_err() {
        say("note: no browser was found; open the address in one");
    }
}

/// A line on stderr. Who does not listen misses it.
pub fn say(line: &str) {
    let _ = writeln!(std::io::stderr().lock(), "{}", with_flags(line));
}

/// The same, in lines of a width where a person wants to see little, in colour on a terminal.
fn warn(line: &str) {
    let text = format!("  warning: {}", with_flags(line));
    let lines = if detail() == Detail::Full { vec![text] } else { terminal::broken(&text, WIDTH) };
    for line in lines {
        let line = if colours(&std::io::stderr()) { painted(line.trim_start()) } else { line };
        let _ = writeln!(std::io::stderr().lock(), "{line}");
    }
}

/// The help of clap, coloured for a terminal.
pub fn print_help(help: &clap::Error) {
    let text = help.render();
    print_text(&if std::io::stdout().is_terminal() { text.ansi().to_string() } else { text.to_string() });
}

/// The status of the work, whatever became of what it said. Only where the work was done (0) and its text is lost
/// for want of space, the work is one that could not be done (2).
pub fn exit_status(work: u8) -> u8 {
    match (work, LOST.get()) {
        (0, Some(reason)) => {
            say(&format!("kfdesign: stdout: cannot write: {reason}"));
            2
        }
        _ => work,
    }
}

/// Notes on stderr, and progress bars: only on a terminal, and only for work that lasts over a second.
#[derive(Default)]
struct Terminal {
    bar: Mutex<Option<ProgressBar>>,
    warnings: AtomicUsize,
}

impl Terminal {
    fn bar(&self) -> MutexGuard<'_, Option<ProgressBar>> {
        self.bar.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn end(&self) {
        if let Some(bar) = self.bar().take() {
            bar.finish_and_clear();
        }
    }
}

impl Progress for Terminal {
    fn begin(&self, stage: &'static str, parts: u64) {
        let bar = ProgressBar::new(parts);
        bar.set_draw_target(indicatif::ProgressDrawTarget::stderr_with_hz(5));
        if let Ok(style) = ProgressStyle::with_template("{msg} [{bar:30}] {percent}% {eta} left") {
            bar.set_style(style);
        }
        bar.set_message(stage);
        self.end();
        *self.bar() = Some(bar);
    }

    fn advance(&self, parts: u64) {
        if let Some(bar) = self.bar().as_ref() {
            bar.inc(parts);
        }
    }

    fn note(&self, line: &str) {
        if detail() == Detail::Full {
            self.end();
            say(line);
        }
    }

    fn warning(&self, line: &str) {
        let before = self.warnings.fetch_add(1, Ordering::Relaxed);
        let most = match detail() {
            Detail::Quiet => 0,
            Detail::Brief => MOST_WARNINGS,
            Detail::Full => usize::MAX,
        };
        if before < most {
            self.end();
            warn(line);
        }
    }
}

/// Runs a command: what it notes goes to stderr, how far it is to a bar.
pub fn watched<T: Send>(command: impl FnOnce() -> T + Send) -> Result<T, Stopped> {
    let terminal = Arc::new(Terminal::default());
    let watch: Arc<dyn Progress> = Arc::clone(&terminal) as _;
    let done = progress::watched(&watch, command);
    terminal.end();
    let more = terminal.warnings.load(Ordering::Relaxed).saturating_sub(MOST_WARNINGS);
    if more > 0 && is_brief() {
        say(&format!("  ({more} more warning{} with -v)", if more == 1 { "" } else { "s" }));
    }
    done
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Options that no command has, and marks without a partner, stay as they are.
    #[test]
    fn options_are_flags() {
        assert_eq!(with_flags("cut it with `start`/`end`"), "cut it with --start/--end");
        assert_eq!(with_flags("give `allow_zero_walk`"), "give --allow-zero-walk");
        assert_eq!(with_flags("`rate`"), "--rate");
        assert_eq!(with_flags("needs `output` FILE"), "needs -o FILE");
        assert_eq!(with_flags("a `word`, a ` and `rate` HZ"), "a `word`, a ` and --rate HZ");
        assert_eq!(with_flags("no marks"), "no marks");
    }
}
