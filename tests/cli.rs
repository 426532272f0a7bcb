//! What holds for every command: help, exit status, one-line errors, closed pipes, JSON alone on stdout.

use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};

use crate::support::{Bench, data};

const COMMANDS: [&str; 8] = ["allan", "identify", "compare", "inflate", "simulate", "tune", "replay", "schema"];

#[test]
fn every_command_has_help_on_stdout() {
    let bench = Bench::new();
    for command in COMMANDS {
        let out = bench.run(&format!("{command} --help"));
        assert_eq!(out.status, 0, "{command}: {}", out.stderr);
        assert!(out.stdout.contains("Usage:"), "{command}: {}", out.stdout);
        assert_eq!(out.stderr, "");
    }
}

#[test]
fn a_usage_error_is_one_line_and_status_2() {
    let bench = Bench::new();
    for (args, named) in [
        ("", "subcommand"),
        ("tnue x.json", "tnue"),
        ("tune", "PARAMS"),
        ("replay filter.json", "LOG"),
        ("allan log.csv --taus", "--taus"),
        ("simulate p.json -o l.csv --seed minus", "minus"),
        ("replay f.json l.csv --alpha", "--alpha"),
    ] {
        let out = bench.run(args);
        assert_eq!(out.status, 2, "{args}");
        assert_eq!(out.stderr.trim_end().lines().count(), 1, "{args}: {}", out.stderr);
        assert!(out.stderr.starts_with("kfdesign: "), "{args}: {}", out.stderr);
        assert!(out.stderr.contains(named), "{args}: {}", out.stderr);
        assert_eq!(out.stdout, "", "{args}");
    }
}

#[test]
fn a_reader_that_goes_away_is_no_error() {
    let bench = Bench::new();
    bench.ok(&format!("simulate {} -o log.npy --duration 60s --seed 3", data("params.json").display()));
    // all taus: far more than a pipe holds
    let mut child = Command::new(env!("CARGO_BIN_EXE_kfdesign"))
        .args(["allan", "log.npy", "--taus", "all", "--columns", "gyro_x"])
        .current_dir(bench.path("."))
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut line = String::new();
    BufReader::with_capacity(64, child.stdout.take().unwrap()).read_line(&mut line).unwrap();
    let out = child.wait_with_output().unwrap();
    assert_eq!(out.status.code(), Some(0), "{}", String::from_utf8_lossy(&out.stderr));
    assert!(!String::from_utf8_lossy(&out.stderr).contains("kfdesign: "), "{}", String::from_utf8_lossy(&out.stderr));
}

#[test]
fn json_is_one_document_and_nothing_else() {
    let bench = Bench::new();
    let params = data("params.json").display().to_string();
    bench.ok(&format!("simulate {params} -o log.npy --duration 10min --seed 4"));
    bench.ok(&format!("tune {params} -o filter.json"));
    for args in [
        "allan log.npy --taus decade --json",
        "identify log.npy --json",
        &format!("tune {params} --json"),
        "replay filter.json log.npy --json",
        "schema params",
        "schema filter",
        "schema replay",
        "schema compare",
        "schema inflate",
        &format!("compare {params} log.npy --json"),
        &format!("inflate {params} log.npy --json"),
    ] {
        let out = bench.run(args);
        assert!(out.status < 2, "{args}: {}", out.stderr);
        let value: serde_json::Value =
            serde_json::from_str(&out.stdout).unwrap_or_else(|e| panic!("{args}: {e}\n{}", out.stdout));
        assert!(value.is_object(), "{args}");
        assert!(out.stdout.ends_with("}\n"), "{args}");
    }
}
