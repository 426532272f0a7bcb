//! What every command writes to stdout and stderr: reports, documents, notes, progress.

use std::borrow::Cow;
use std::collections::BTreeSet;
use std::io::{ErrorKind, IsTerminal, Write};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};

use clap::CommandFactory;
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;

use crate::export::atomic::in_words;
use crate::numerics::progress::{self, Progress, Stopped};
use crate::report::{Level, Report, terminal};

/// Why stdout did not take all that was meant for it.
static LOST: OnceLock<String> = OnceLock::new();

/// One machine-readable document on stdout.
pub fn print_json<T: Serialize>(value: &T) -> anyhow::Result<()> {
    let mut text = serde_json::to_string_pretty(value)?;
    text.push('\n');
    print_text(&text);
    Ok(())
}

/// What the library calls an option, `start`, as a shell knows it: --start.
pub fn with_flags(text: &str) -> Cow<'_, str> {
    static FLAGS: OnceLock<BTreeSet<String>> = OnceLock::new();
    let all = || {
        let command = super::Cli::command();
        let longs = command.get_subcommands().flat_map(|command| command.get_arguments()).filter_map(|a| a.get_long());
        longs.map(String::from).collect()
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
        if opened && flags.contains(&flag) {
            out += &format!("--{flag}");
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

/// A report for a person: as wide as the terminal, with every column and whole lines where stdout is none.
pub fn print_report(report: &Report<'_>) {
    let width = terminal_size::terminal_size_of(std::io::stdout()).map(|(width, _)| usize::from(width.0));
    print_text(&with_flags(&terminal::text(report, Level::Full, width)));
}

/// A line on stderr. Who does not listen misses it.
pub fn say(line: &str) {
    let _ = writeln!(std::io::stderr().lock(), "{}", with_flags(line));
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
        self.end();
        say(line);
    }
}

/// Runs a command: what it notes goes to stderr, how far it is to a bar.
pub fn watched<T: Send>(command: impl FnOnce() -> T + Send) -> Result<T, Stopped> {
    let terminal = Arc::new(Terminal::default());
    let watch: Arc<dyn Progress> = Arc::clone(&terminal) as _;
    let done = progress::watched(&watch, command);
    terminal.end();
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
        assert_eq!(with_flags("a `word`, a ` and `rate` HZ"), "a `word`, a ` and --rate HZ");
        assert_eq!(with_flags("no marks"), "no marks");
    }
}
