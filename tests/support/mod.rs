//! A scratch directory with the binary in it: run a command, look at exit status, stdout, stderr and files.

#![allow(dead_code, reason = "shared by all test modules; not every helper is used by each")]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::{Mutex, PoisonError};

use serde_json::Value;

use crate::params::accepts;

/// What a run of the binary gave.
#[derive(Debug)]
pub struct Outcome {
    pub status: i32,
    pub stdout: String,
    pub stderr: String,
}

/// A temporary directory in which `kfdesign` is run.
#[derive(Debug)]
pub struct Bench {
    dir: tempfile::TempDir,
}

impl Bench {
    pub fn new() -> Self {
        Bench { dir: tempfile::tempdir().unwrap() }
    }
    pub fn path(&self, name: &str) -> PathBuf {
        self.dir.path().join(name)
    }
    pub fn file(&self, name: &str, content: impl AsRef<[u8]>) -> PathBuf {
        let path = self.path(name);
        std::fs::write(&path, content).unwrap();
        path
    }
    pub fn read(&self, name: &str) -> String {
        std::fs::read_to_string(self.path(name)).unwrap()
    }
    /// Names of all files in the directory, sorted.
    pub fn files(&self) -> Vec<String> {
        let mut names: Vec<String> = std::fs::read_dir(self.dir.path())
            .unwrap()
            .map(|e| e.unwrap().file_name().to_string_lossy().into_owned())
            .collect();
        names.sort();
        names
    }
    /// Run `kfdesign` with arguments split at spaces.
    pub fn run(&self, args: &str) -> Outcome {
        self.run_args(&args.split_whitespace().collect::<Vec<_>>())
    }
    /// With every table and note, unless the arguments say how much is shown.
    pub fn run_args(&self, args: &[&str]) -> Outcome {
        let said = args.iter().any(|arg| ["-v", "-q", "--verbose", "--quiet"].contains(arg));
        self.as_typed(&[args, if said { &[] } else { &["-v"] }].concat())
    }
    /// As a person types it.
    pub fn as_typed(&self, args: &[&str]) -> Outcome {
        let output =
            Command::new(env!("CARGO_BIN_EXE_kfdesign")).args(args).current_dir(self.dir.path()).output().unwrap();
        let stdout = String::from_utf8_lossy(&output.stdout).into_owned();
        if args.contains(&"--json") {
            fits_its_schema(&stdout);
        }
        Outcome {
            status: output.status.code().unwrap_or(-1),
            stdout,
            stderr: String::from_utf8_lossy(&output.stderr).into_owned(),
        }
    }
    /// Run and expect exit 0; returns stdout.
    pub fn ok(&self, args: &str) -> String {
        let out = self.run(args);
        assert_eq!(out.status, 0, "kfdesign {args}\nstdout: {}\nstderr: {}", out.stdout, out.stderr);
        out.stdout
    }
}

/// A document that any test prints is one of its published schema, `kfdesign schema NAME` of the format
/// "kfdesign-NAME/1".
pub fn fits_its_schema(printed: &str) {
    static SCHEMAS: Mutex<BTreeMap<String, Value>> = Mutex::new(BTreeMap::new());
    let Ok(document) = serde_json::from_str::<Value>(printed) else { return };
    let format = document["format"].as_str().unwrap_or_else(|| panic!("a document without a format: {printed}"));
    let name = format.strip_prefix("kfdesign-").and_then(|rest| rest.strip_suffix("/1")).unwrap();
    let mut schemas = SCHEMAS.lock().unwrap_or_else(PoisonError::into_inner);
    let schema = schemas.entry(name.to_owned()).or_insert_with(|| {
        let printed = Command::new(env!("CARGO_BIN_EXE_kfdesign")).args(["schema", name]).output().unwrap();
        serde_json::from_slice(&printed.stdout).unwrap_or_else(|_| panic!("no schema of {format}"))
    });
    accepts(schema, schema, &document).unwrap_or_else(|why| panic!("{format}: {why}"));
}

/// The figure of a report page, by its title.
pub fn figure<'a>(html: &'a str, title: &str) -> &'a str {
    let at = html.find(&format!("<title>{title}</title>")).unwrap_or_else(|| panic!("no figure '{title}'"));
    let start = html[..at].rfind("<svg ").unwrap();
    let end = at + html[at..].find("</svg>\n").unwrap() + "</svg>\n".len();
    &html[start..end]
}

/// The project's own data folder.
pub fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("data").join(name)
}

/// A measured log by its path below the folder of measured logs, or `None` with a printed line when the logs are not
/// here. The folder is `$KFDESIGN_MEASURED`, else `../shared/data`. With CI=true a missing folder is a failure.
pub fn measured(name: &str) -> Option<PathBuf> {
    let root = std::env::var_os("KFDESIGN_MEASURED")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data"), PathBuf::from);
    let path = root.join(name);
    if path.exists() {
        return Some(path);
    }
    assert!(std::env::var("CI").as_deref() != Ok("true"), "measured logs not found: {}", path.display());
    println!("skipped: measured logs not found");
    None
}
