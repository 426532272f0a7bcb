//! The folder: what is in it, and which names lead into it and nowhere else.

use std::fs;
use std::io;
use std::path::{Component, Path, PathBuf};
use std::time::UNIX_EPOCH;

use serde::Serialize;
use serde_json::{Map, Value};

use super::Refused;
use crate::cli::shell;
use crate::export::atomic::{self, AtomicFile, in_words};
use crate::units::plain;

/// Files that a page lists: a person looks through no more.
const MOST_FILES: usize = 1000;
/// Folders in folders that are looked into.
const DEPTH: usize = 2;
/// A larger document is none of ours.
const LARGEST_DOCUMENT: u64 = 16 << 20;
/// Endings of logs, with or without that of a packed file behind.
const LOGS: [&str; 18] = [
    "csv", "txt", "tsv", "dat", "log", "npy", "npz", "mat", "h5", "hdf5", "ulg", "bin", "bag", "mcap", "db3",
    "parquet", "asc", "imu",
];
const PACKED: [&str; 3] = ["gz", "bz2", "zst"];
/// Keys of a request that name columns or topics, which are no files and may begin with a slash.
const COLUMNS: [&str; 5] = ["columns", "topic", "time", "temperature", "aid"];
/// Keys of a request that name a file to be written.
const OUTPUTS: [&str; 2] = ["output", "every_step"];

/// A file of the folder.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Entry {
    name: String,
    /// `log`, or of a document the word in its format: `params`, `filter` …
    kind: String,
    size: u64,
    /// Seconds since 1970.
    modified: f64,
}

/// Files under the folder, by name. Hidden ones and links are not shown.
pub(super) fn list() -> Vec<Entry> {
    let mut out = Vec::new();
    walk(Path::new(""), DEPTH, &mut out);
    out.sort_by(|a, b| a.name.cmp(&b.name));
    out
}

fn walk(folder: &Path, depth: usize, out: &mut Vec<Entry>) {
    let Ok(entries) = fs::read_dir(Path::new(".").join(folder)) else { return };
    for entry in entries.flatten() {
        let (Ok(kind), Ok(name)) = (entry.file_type(), entry.file_name().into_string()) else { continue };
        if name.starts_with('.') || out.len() >= MOST_FILES {
            continue;
        }
        let path = folder.join(&name);
        if kind.is_dir() && depth > 0 {
            walk(&path, depth - 1, out);
        } else if kind.is_file()
            && let Ok(found) = entry.metadata()
        {
            let since = found.modified().ok().and_then(|time| time.duration_since(UNIX_EPOCH).ok());
            let kind = kind_of(&path, found.len());
            let modified = since.map_or(0.0, |since| since.as_secs_f64());
            out.push(Entry { name: plain(&path.to_string_lossy()).into_owned(), kind, size: found.len(), modified });
        }
    }
}

/// What a file is, by its ending and, of a document, by its format.
fn kind_of(path: &Path, size: u64) -> String {
    let lower = path.to_string_lossy().to_ascii_lowercase();
    let mut endings = lower.rsplit('.');
    let mut ending = endings.next().unwrap_or_default();
    if PACKED.contains(&ending) {
        ending = endings.next().unwrap_or_default();
    }
    if LOGS.contains(&ending) {
        return "log".into();
    }
    let document = (ending == "json" && size <= LARGEST_DOCUMENT).then(|| fs::read(path).ok()).flatten();
    let format = document.and_then(|text| serde_json::from_slice::<Format>(&text).ok());
    let word = format.and_then(|it| it.format?.strip_prefix("kfdesign-")?.split('/').next().map(String::from));
    word.unwrap_or_default()
}

/// Of a document all else is skipped.
#[derive(serde::Deserialize)]
struct Format {
    format: Option<String>,
}

/// A name that leads to a regular file of the folder, or to where one may be. Errors: it leads elsewhere.
pub(super) fn inside(name: &str) -> Result<PathBuf, Refused> {
    let elsewhere = || Refused::forbidden(format!("{}: not a file of this folder", plain(name)));
    let path = Path::new(name);
    let own = |part: Component<'_>| match part {
        Component::Normal(part) => part.to_str().is_some_and(|part| !part.starts_with('.')),
        Component::CurDir => true,
        _ => false,
    };
    let foreign = name.is_empty() || name.contains(['\0', '\\']) || name.get(1..2) == Some(":");
    if foreign || !path.components().all(own) {
        return Err(elsewhere());
    }
    let root = Path::new(".").canonicalize().map_err(|_| elsewhere())?;
    // links may lead about in the folder, but not out of it
    match path.canonicalize() {
        Ok(real) if real.starts_with(&root) && real.is_file() => Ok(path.to_path_buf()),
        Ok(_) => Err(elsewhere()),
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            let parent = path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
            let real = parent.canonicalize().map_err(|_| elsewhere())?;
            // a link to nothing is there without leading anywhere
            let link = path.symlink_metadata().is_ok();
            if real.starts_with(&root) && !link { Ok(path.to_path_buf()) } else { Err(elsewhere()) }
        }
        Err(_) => Err(elsewhere()),
    }
}

/// A request that may be done: every name in it leads into the folder, and its drafts are files.
#[derive(Debug)]
pub(super) struct Prepared {
    pub(super) command: String,
    /// As it was asked.
    pub(super) request: Value,
    /// As it is done: with drafts under the names of their files.
    pub(super) given: Value,
    pub(super) shell: String,
    drafts: Vec<Draft>,
}

/// A document that is not saved: a hidden file while its job is there, beside what it may name.
#[derive(Debug)]
struct Draft {
    name: String,
    path: String,
    _file: atomic::Scratch,
}

/// What a page asks for.
#[derive(Debug, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Asked {
    command: String,
    request: Value,
    /// Documents that are not saved, which the request names `draft:NAME`.
    #[serde(default)]
    drafts: Map<String, Value>,
    /// Files that are there may be written over.
    #[serde(default)]
    replace: bool,
}

impl Asked {
    pub(super) fn prepared(self, read_only: bool) -> Result<Prepared, Refused> {
        let words = shell::words(&self.command, &self.request).map_err(Refused::unprocessable)?;
        let mut drafts = Vec::new();
        for (name, document) in &self.drafts {
            // a document names files, too
            confine(&mut document.clone(), "", &[])?;
            let file = atomic::Scratch::new(Path::new(if read_only { "" } else { "." }), &pretty(document));
            let file = file.map_err(|error| Refused::failed(error.to_string()))?;
            drafts.push(Draft { name: format!("draft:{name}"), path: file.path().display().to_string(), _file: file });
        }
        let mut given = self.request.clone();
        confine(&mut given, "", &drafts)?;
        for key in OUTPUTS {
            let Some(output) = given.get(key).and_then(Value::as_str) else { continue };
            if read_only {
                return Err(Refused::forbidden(format!("{key}: this folder is served read-only")));
            }
            // files of other programs are made and not written
            if self.command != "export" && Path::new(output).exists() && !self.replace {
                return Err(Refused::conflict(format!("{output} is there already")));
            }
        }
        let shell = shell::line(&words);
        Ok(Prepared { command: self.command, request: self.request, given, shell, drafts })
    }
}

impl Prepared {
    /// A message that knows drafts by the names that a person gave them.
    pub(super) fn named(&self, text: &str) -> String {
        self.drafts.iter().fold(text.to_string(), |text, draft| text.replace(&draft.path, &draft.name))
    }
}

pub(super) fn pretty(document: &Value) -> Vec<u8> {
    format!("{document:#}\n").into_bytes()
}

/// Every text that may be a path must lead into the folder; those that name drafts get the names of their files.
fn confine(value: &mut Value, key: &str, drafts: &[Draft]) -> Result<(), Refused> {
    match value {
        Value::String(text) => match drafts.iter().find(|draft| draft.name == *text) {
            Some(draft) => text.clone_from(&draft.path),
            None if COLUMNS.contains(&key) => {}
            None => {
                // as FILE, FILE:AXIS or FILE#SENSOR
                for part in [text.as_str()].into_iter().chain(text.split([':', '#'])) {
                    let path = Path::new(part);
                    let climbs = path.components().any(|c| !matches!(c, Component::Normal(_) | Component::CurDir));
                    if climbs || path.symlink_metadata().is_ok() || part.contains('\0') {
                        inside(part)?;
                    }
                }
                if OUTPUTS.contains(&key) {
                    inside(text)?;
                }
            }
        },
        Value::Array(values) => values.iter_mut().try_for_each(|value| confine(value, key, drafts))?,
        Value::Object(keys) => keys.iter_mut().try_for_each(|(key, value)| confine(value, key, drafts))?,
        _ => {}
    }
    Ok(())
}

/// The text of a document. Errors: it is none, or not there.
pub(super) fn document(name: &str) -> Result<Vec<u8>, Refused> {
    let path = inside(name)?;
    let found = path.metadata().map_err(|_| Refused::unprocessable(format!("{name}: is no longer there")))?;
    if kind_of(&path, found.len()).is_empty() || !name.ends_with(".json") {
        return Err(Refused::forbidden(format!("{name}: is no document of kfdesign")));
    }
    fs::read(&path).map_err(|error| Refused::failed(format!("{name}: {}", in_words(&error))))
}

/// A file of this content, which replaces one only where that is wanted.
pub(super) fn save(name: &str, content: &[u8], replace: bool) -> Result<(), Refused> {
    let path = inside(name)?;
    if path.exists() && !replace {
        return Err(Refused::conflict(format!("{name} is there already: give another name, or replace it")));
    }
    atomic::write(&path, content).map_err(|error| Refused::failed(error.to_string()))
}

/// A new file for an upload: names of plain characters alone, and none that is there.
pub(super) fn upload(name: &str) -> Result<AtomicFile, Refused> {
    let plain = |c: char| c.is_ascii_alphanumeric() || "._-".contains(c);
    if !name.chars().all(plain) || name.len() > 200 {
        return Err(Refused::unprocessable(
            "a name of an uploaded file has letters, digits, '.', '_' and '-', at most 200".into(),
        ));
    }
    let path = inside(name)?;
    if path.symlink_metadata().is_ok() {
        return Err(Refused::conflict(format!("{name} is there already: rename the file and upload it again")));
    }
    AtomicFile::create(&path).map_err(|error| Refused::failed(error.to_string()))
}

/// Whether the folder is one that can be served.
pub(super) fn enter(folder: &Path) -> io::Result<()> {
    fs::read_dir(folder).and_then(|_| std::env::set_current_dir(folder))
}

/// Why a folder cannot be served.
pub(super) fn why_not(folder: &Path, error: &io::Error) -> String {
    let shown = folder.display();
    match error.kind() {
        io::ErrorKind::NotFound => format!("{shown}: there is no such folder; make it, or name another"),
        io::ErrorKind::NotADirectory => format!("{shown}: is a file; name the folder that it is in"),
        _ => format!("{shown}: cannot be read: {}", in_words(error)),
    }
}
