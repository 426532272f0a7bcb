//! A scratch directory with the binary in it: run a command, look at exit status, stdout, stderr and files.

#![allow(dead_code, reason = "shared by all test modules; not every helper is used by each")]

use std::path::{Path, PathBuf};
use std::process::Command;

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
    pub fn run_args(&self, args: &[&str]) -> Outcome {
        let output =
            Command::new(env!("CARGO_BIN_EXE_kfdesign")).args(args).current_dir(self.dir.path()).output().unwrap();
        Outcome {
            status: output.status.code().unwrap_or(-1),
            stdout: String::from_utf8_lossy(&output.stdout).into_owned(),
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

/// A measured log by its path below the folder of measured logs, or `None` with a printed line when the logs are not here.
/// The folder is `$KFDESIGN_MEASURED`, else `../shared/data`. With CI=true a missing folder is a failure.
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
