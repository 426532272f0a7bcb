//! Tables, JSON, progress: how every command speaks.

use std::borrow::Cow;
use std::collections::BTreeSet;
use std::io::{ErrorKind, IsTerminal, Write};
use std::sync::{Arc, OnceLock};

use clap::CommandFactory;
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;

use crate::export::atomic::in_words;
use crate::numerics::progress::{Progress, Stopped, watched};
use crate::params::{AxisParams, Params};
use crate::replay::axes::RATE_TOLERANCE;
pub use crate::units::digits;
use crate::units::{Quantity, Unit};

/// Why stdout did not take all that was meant for it.
static LOST: OnceLock<String> = OnceLock::new();

/// One machine-readable document on stdout.
pub fn print_json<T: Serialize>(value: &T) -> anyhow::Result<()> {
    let mut text = serde_json::to_string_pretty(value)?;
    text.push('\n');
    print(&text);
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

/// Text on stdout. Nothing here changes what the work has found: see [`exit_status`].
pub fn print_text(text: &str) {
    print(&with_flags(text));
}

fn print(text: &str) {
    let mut out = std::io::stdout().lock();
    let written = out.write_all(text.as_bytes()).and_then(|()| out.flush());
    if let Err(error) = written
        // a reader that has seen enough is no error
        && error.kind() != ErrorKind::BrokenPipe
    {
        let _ = LOST.set(in_words(&error));
    }
}

/// A line on stderr. Who does not listen misses it.
pub fn say(line: &str) {
    let _ = writeln!(std::io::stderr().lock(), "{}", with_flags(line));
}

/// The same of several lines, each with its end.
pub fn say_all(lines: &str) {
    lines.lines().for_each(say);
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

/// Seconds below two minutes, minutes below two hours, hours below a thousand of them, else days.
pub fn duration(seconds: f64) -> String {
    match seconds {
        s if s < 120.0 => format!("{} s", digits(s)),
        s if s < 7200.0 => format!("{} min", digits(s / 60.0)),
        s if s < 3.6e6 => format!("{} h", digits(s / 3600.0)),
        s => format!("{} days", digits(s / 86_400.0)),
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

/// The work with a bar that is moved on by [`crate::numerics::progress::advance`].
pub fn with_bar<T: Send>(bar: ProgressBar, work: impl FnOnce() -> T + Send) -> Result<T, Stopped> {
    struct Bar(ProgressBar);
    impl Progress for Bar {
        fn advance(&self, parts: u64) {
            self.0.inc(parts);
        }
    }
    let watch: Arc<dyn Progress> = Arc::new(Bar(bar.clone()));
    let done = watched(&watch, work);
    bar.finish_and_clear();
    done
}

/// "note: x, y: …" for what is said of each name, each sentence once.
pub fn notes<'a>(said: impl Iterator<Item = (&'a str, &'a [String])>) -> String {
    let mut found: Vec<(&str, Vec<&str>)> = Vec::new();
    for (name, sentences) in said {
        for sentence in sentences {
            match found.iter_mut().find(|(other, _)| other == sentence) {
                Some((_, names)) => names.push(name),
                None => found.push((sentence, vec![name])),
            }
        }
    }
    found.iter().map(|(sentence, names)| format!("note: {}: {sentence}\n", names.join(", "))).collect()
}

/// What a rate other than that of the parameters makes of the terms that count samples, "x, y: …", each sentence once.
pub fn notes_of_rate(params: &Params, axes: &[&AxisParams], rate_hz: f64) -> String {
    if (rate_hz / params.sample_rate_hz - 1.0).abs() <= RATE_TOLERANCE {
        return String::new();
    }
    let sentence = |axis: &AxisParams| {
        let counted = axis.noise().of_samples()?;
        Some(format!(
            "{counted} belongs to the samples at {} Hz: at {} Hz the same coefficients are another process (the corner of a filter moves with the rate)",
            digits(params.sample_rate_hz),
            digits(rate_hz)
        ))
    };
    let said: Vec<(&str, Vec<String>)> =
        axes.iter().map(|axis| (axis.name.as_str(), sentence(axis).into_iter().collect())).collect();
    notes(said.iter().map(|(name, sentences)| (*name, sentences.as_slice())))
}

/// A text table: first column left, the others right aligned, two spaces between.
pub fn table(header: &[&str], rows: &[Vec<String>]) -> String {
    let columns = header.len();
    let mut width: Vec<usize> = header.iter().map(|h| h.chars().count()).collect();
    for row in rows {
        for (w, cell) in width.iter_mut().zip(row) {
            *w = (*w).max(cell.chars().count());
        }
    }
    let mut out = String::new();
    let header: Vec<String> = header.iter().map(|h| (*h).to_string()).collect();
    for row in std::iter::once(&header).chain(rows) {
        let mut line = String::new();
        for (i, (cell, w)) in row.iter().zip(&width).enumerate() {
            let pad = " ".repeat(w - cell.chars().count());
            let last = i + 1 == columns;
            match (i == 0, last) {
                (true, true) => line.push_str(cell),
                (true, false) => line.push_str(&format!("{cell}{pad}  ")),
                (false, true) => line.push_str(&format!("{pad}{cell}")),
                (false, false) => line.push_str(&format!("{pad}{cell}  ")),
            }
        }
        out.push_str(line.trim_end());
        out.push('\n');
    }
    out
}

/// That of the quantity is shown in the unit of the axis, its integral and its derivative (an angle, an acceleration) in the unit that
/// goes with it, others in SI: scale and text.
pub fn shown_unit(si: &str, quantity: Quantity, unit: &Unit) -> (f64, String) {
    if si == quantity.si_unit() {
        return (unit.scale(), unit.to_string());
    }
    let dimension = Unit::parse(si).map(|si| si.dimension());
    let family = [2, -2].map(|half_powers| unit.times_time(half_powers));
    match family.into_iter().find(|unit| dimension == Ok(unit.dimension())) {
        Some(unit) => (unit.scale(), unit.to_string()),
        None => (1.0, si.to_owned()),
    }
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
