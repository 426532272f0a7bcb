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

/// Paragraphs of a help text in one line each, however they were broken.
fn words(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[test]
fn help_names_what_a_model_may_have_and_what_is_followed() {
    let bench = Bench::new();
    let help = words(&bench.ok("identify --help"));
    assert!(help.contains("ma2 … ma64") && help.contains("bl1 … bl6"), "{help}");
    let help = words(&bench.ok("replay --help"));
    assert!(help.contains("band limit, quantization, lines, Gauss-Markov processes of a few samples"), "{help}");
}

#[test]
fn formats_names_every_schema() {
    let refused = Bench::new().run("schema none").stderr;
    let names = refused.split("possible values: ").nth(1).unwrap().split(']').next().unwrap();
    let page = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/docs/formats.md")).unwrap();
    let first = words(page.split("\n## ").next().unwrap());
    for name in names.split(", ") {
        assert!(first.contains(&format!("`{name}`")) || first.contains(&format!("schema {name}`")), "{name}: {first}");
    }
    assert!(names.contains("attitude-replay"), "{names}");
}

#[test]
fn two_outputs_of_one_name_are_refused_before_the_work() {
    let bench = Bench::new();
    for (args, flags) in [
        ("allan log.csv -o a --plot ./a", "-o and --plot"),
        ("identify log.csv -o a --report a", "-o and --report"),
        ("identify log.csv -o b --report a --plot a", "--report and --plot"),
        ("tune params.json -o a --plot a", "-o and --plot"),
        ("replay filter.json log.csv -o a --report a", "-o and --report"),
        ("compare params.json log.csv -o a --report a", "-o and --report"),
        ("montecarlo filter.json -o a --every-step a", "-o and --every-step"),
        ("merge a.json b.json --junit a --report a", "--junit and --report"),
        ("import imu.yaml -o a --accelerometer a", "-o and --accelerometer"),
    ] {
        let out = bench.run(args);
        let said = format!("a: named by both {flags}; give them different names\n");
        assert!(out.status == 2 && out.stderr.lines().count() == 1 && out.stderr.ends_with(&said), "{args}: {out:?}");
    }
    // a device takes several; the log is looked for then
    let out = bench.run("identify log.csv -o /dev/null --report /dev/null");
    assert!(out.stderr.contains("log.csv: there is no such file"), "{out:?}");
    assert!(bench.files().is_empty());
}

#[test]
fn a_negative_value_reaches_its_own_message() {
    let bench = Bench::new();
    bench.file("log.csv", "gyro_x (deg/s)\n1\n2\n");
    bench.file("params.json", std::fs::read(data("params.json")).unwrap());
    for (args, said) in [
        ("allan log.csv --rate 1 --window -1s", "--window -1s"),
        ("identify log.csv --rate 1 --window -1s", "--window -1s"),
        ("allan log.csv --rate 1 --start -5s", "--start"),
        ("replay f.json log.csv --follow -5s", "follow is -5, expected seconds, more than 0"),
        ("simulate params.json -o l.csv --duration -5s", "--duration -5s"),
        ("simulate params.json -o l.csv --duration 5s --saturate -1deg/s", "--saturate -1deg/s"),
        ("simulate params.json -o l.csv --duration 5s --seed -1", "expected a whole number of at least 0"),
        ("tune params.json --seed -1", "expected a whole number of at least 0"),
        ("montecarlo f.json --seed -1", "expected a whole number of at least 0"),
        ("plan params.json --parameter white.density --precision -1%", "--precision -1%"),
    ] {
        let out = bench.run(args);
        // a log that is read is told of before
        let last = out.stderr.lines().last().unwrap();
        assert!(out.status == 2 && last.starts_with("kfdesign: ") && last.contains(said), "{args}: {out:?}");
        assert!(!last.contains("unexpected argument"), "{args}: {out:?}");
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
