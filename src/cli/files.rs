//! The files a command reads and writes, looked at before the work.

use std::path::{Path, PathBuf};

use anyhow::bail;
use serde::Serialize;

use super::output::with_flags;
use crate::export::atomic;
use crate::report::{Report, html, print};

/// Endings of pages, pictures and binary tables, which no other program reads as a text of parameters.
const NO_TEXT: [&str; 9] = ["html", "htm", "svg", "png", "jpg", "pdf", "npy", "csv", "gz"];

/// What is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Json,
    /// Figures, in the format of the ending.
    Plot,
    Html,
    Xml,
    /// In the format of its ending.
    Table,
    /// A text of another program, which gives it its ending.
    Other,
}

impl Kind {
    /// Endings, and what they stand for.
    fn endings(self) -> (&'static [&'static str], &'static str) {
        match self {
            Kind::Json => (&["json"], "JSON"),
            Kind::Plot => (&print::ENDINGS, "SVG, PDF or PNG"),
            Kind::Html => (&["html", "htm"], "an HTML page"),
            Kind::Xml => (&["xml"], "JUnit XML"),
            Kind::Table | Kind::Other => (&[], "text"),
        }
    }

    /// Refuses an ending that says something else than what is written. Nothing is said by a name without an ending,
    /// or by a device.
    fn check(self, flag: &str, path: &Path) -> anyhow::Result<()> {
        if self == Kind::Table {
            return Ok(crate::export::table::check_ending(path)?);
        }
        let special = path.metadata().is_ok_and(|found| !found.is_file() && !found.is_dir());
        let Some(ending) = path.extension().filter(|_| !special) else { return Ok(()) };
        let ending = ending.to_string_lossy().to_ascii_lowercase();
        let (endings, what) = self.endings();
        let wrong = || format!("{}: {flag} writes {what}, not .{ending}", path.display());
        match endings.first() {
            Some(own) if !endings.contains(&&*ending) => {
                bail!("{}; name it {}", wrong(), path.with_extension(own).display())
            }
            None if NO_TEXT.contains(&&*ending) => bail!("{}; give it another ending", wrong()),
            _ => Ok(()),
        }
    }
}

/// An output with its flag.
pub(super) type Output<'a> = (&'a str, &'a Option<PathBuf>, Kind);

/// Refuses, before the work, what would be refused after it: two outputs of one name, an ending that is not what is
/// written, an output that is an input or cannot be written, a named pipe. A device or an open pipe (`/dev/null`,
/// `/dev/stdout`) may take several outputs.
pub(super) fn check(outputs: &[Output<'_>], inputs: &[&Path]) -> anyhow::Result<()> {
    let mut files: Vec<(&str, PathBuf)> = Vec::new();
    let given = || outputs.iter().filter_map(|(flag, path, kind)| Some((*flag, path.as_deref()?, *kind)));
    for (flag, path, _) in given() {
        if path.exists() && !path.is_file() {
            continue;
        }
        let place = place(path);
        if let Some((first, _)) = files.iter().find(|(_, other)| *other == place) {
            bail!("{}: named by both {first} and {flag}; give them different names", path.display());
        }
        files.push((flag, place));
    }
    for (_, path, _) in given() {
        inputs.iter().try_for_each(|input| atomic::refuse_input_as_output(path, input))?;
    }
    for (flag, path, kind) in given() {
        kind.check(flag, path)?;
        if is_named_pipe(path) {
            bail!("{}: it is a named pipe, which keeps nothing; give {flag} the name of a file", path.display());
        }
        atomic::check_output(path)?;
    }
    match inputs.iter().find(|input| is_named_pipe(input)) {
        Some(pipe) => bail!("{}: it is a named pipe; save what comes out of it to a file first", pipe.display()),
        None => Ok(()),
    }
}

/// What there is to say of outputs that are written.
pub(super) fn written(outputs: &[Output<'_>]) -> Vec<String> {
    let names: Vec<String> =
        outputs.iter().filter_map(|output| Some(output.1.as_ref()?.display().to_string())).collect();
    if names.is_empty() { Vec::new() } else { vec![format!("{} written", names.join(", "))] }
}

/// A document, where a file for it is named.
pub(super) fn write_json<T: Serialize>(path: Option<&Path>, document: &T) -> anyhow::Result<()> {
    let Some(path) = path else { return Ok(()) };
    let mut text = serde_json::to_string_pretty(document)?;
    text.push('\n');
    Ok(atomic::write(path, text.as_bytes())?)
}

/// The page, where a file for it is named.
pub(super) fn write_page(path: Option<&Path>, report: &Report<'_>) -> anyhow::Result<()> {
    let Some(path) = path else { return Ok(()) };
    Ok(atomic::write(path, with_flags(&html::page(report)?).as_bytes())?)
}

/// A pipe that has a name of its own; what a shell makes of `<(…)`, and `/dev/stdout`, have none.
fn is_named_pipe(path: &Path) -> bool {
    #[cfg(unix)]
    {
        use std::os::unix::fs::FileTypeExt;
        let found = atomic::place(path).and_then(|place| place.symlink_metadata().ok());
        found.is_some_and(|found| found.file_type().is_fifo())
    }
    #[cfg(not(unix))]
    {
        let _ = path;
        false
    }
}

/// Where a file is, or will be: links followed, `./` left out.
fn place(path: &Path) -> PathBuf {
    let place = atomic::place(path).unwrap_or_else(|| path.to_path_buf());
    let folder = place.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let whole = || Some(folder.canonicalize().ok()?.join(place.file_name()?));
    whole().unwrap_or(place.clone())
}
