//! What every command writes to stdout and stderr: reports, documents, notes, progress.

use std::io::{ErrorKind, IsTerminal, Write};
use std::sync::OnceLock;

use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;

use crate::export::atomic::in_words;
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

/// Text on stdout. Nothing here changes what the work has found: see [`exit_status`].
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
    print_text(&terminal::text(report, Level::Full, width));
}

/// A line on stderr. Who does not listen misses it.
pub fn say(line: &str) {
    let _ = writeln!(std::io::stderr().lock(), "{line}");
}

/// The help of clap, coloured for a terminal.
pub fn print_help(help: &clap::Error) {
    let text = help.render();
    print_text(&if std::io::stdout().is_terminal() { text.ansi().to_string() } else { text.to_string() });
}

/// The status of the work, whatever became of what it said. Only where the work was done (0) and its text is lost for want of space, the
/// work is one that could not be done (2).
pub fn exit_status(work: u8) -> u8 {
    match (work, LOST.get()) {
        (0, Some(reason)) => {
            say(&format!("kfdesign: stdout: cannot write: {reason}"));
            2
        }
        _ => work,
    }
}

/// A progress bar on stderr: only on a terminal, and only for work that lasts over a second.
pub fn progress(total: u64, what: &'static str) -> ProgressBar {
    let bar = ProgressBar::new(total);
    bar.set_draw_target(indicatif::ProgressDrawTarget::stderr_with_hz(5));
    if let Ok(style) = ProgressStyle::with_template("{msg} [{bar:30}] {percent}% {eta} left") {
        bar.set_style(style);
    }
    bar.set_message(what);
    bar
}
