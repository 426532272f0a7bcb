//! One document byte for byte, from any number of threads, from shards in any order, from interrupted and resumed work.

use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;

use super::{SMALL, bench, two_axes};
use crate::support::Bench;

const RUN: &str = "montecarlo filter.json --duration 20s";

#[test]
fn threads_and_shards_leave_no_trace() {
    let bench = bench(&two_axes());
    // 45: no multiple of the four runs that go side by side
    bench.ok(&format!("{RUN} --runs 45 --threads 1 -o one.json"));
    let one = bench.read("one.json");
    for threads in [2, 4] {
        let printed = bench.ok(&format!("{RUN} --runs 0..45 --threads {threads} --json"));
        assert!(printed == one, "{threads} threads");
    }
    for (shard, runs) in [("a", "0..14"), ("b", "14..31"), ("c", "31..45"), ("d", "14..45")] {
        // a shard is a gate of its own
        let status = bench.run(&format!("{RUN} --runs {runs} -o {shard}.json")).status;
        assert!(status < 2, "{runs}: {status}");
    }
    for shards in ["a.json d.json", "d.json a.json", "c.json a.json b.json"] {
        bench.ok(&format!("merge {shards} -o merged.json"));
        assert!(bench.read("merged.json") == one, "{shards}");
    }
    // one document alone is judged as it is
    assert!(bench.ok("merge one.json --json") == one);
    // the runs are others with another seed, the same with another level
    let other =
        |flag: &str| serde_json::from_str::<Value>(&bench.ok(&format!("{RUN} --runs 45 {flag} --json"))).unwrap();
    let first: Value = serde_json::from_str(&one).unwrap();
    assert_ne!(other("--seed 2")["sums"], first["sums"]);
    assert_eq!(other("--alpha 0.02")["sums"], first["sums"]);
}

#[test]
fn resumed_runs_are_those_of_one_go() {
    let bench = bench(SMALL);
    bench.ok(&format!("{RUN} --runs 60 -o whole.json"));
    let whole = bench.read("whole.json");
    // no file yet: from the beginning; then on from 0..22; then nothing is left to do
    for runs in ["22", "60", "60"] {
        let status = bench.run(&format!("{RUN} --runs {runs} --resume -o parts.json")).status;
        assert!(status < 2, "{runs}: {status}");
    }
    assert!(bench.read("parts.json") == whole);
}

/// Waits until the process watches for SIGINT (bit 1 of its mask of caught signals).
#[cfg(target_os = "linux")]
fn until_it_listens(pid: u32) {
    let start = Instant::now();
    while start.elapsed() < Duration::from_secs(60) {
        let status = std::fs::read_to_string(format!("/proc/{pid}/status")).unwrap();
        let caught = status.lines().find_map(|line| line.strip_prefix("SigCgt:")).unwrap().trim();
        if u64::from_str_radix(caught, 16).unwrap() & 2 != 0 {
            return;
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    panic!("no handler of SIGINT within a minute");
}

/// Starts the command, interrupts it once it listens, and returns its exit status and what it said on stderr. A
/// process whose flags are not read yet when the signal comes has nothing to keep and ends by it: it is started
/// again.
#[cfg(target_os = "linux")]
fn interrupted(bench: &Bench, args: &str) -> (Option<i32>, String) {
    (0..100).map(|pause| interrupted_after(bench, args, pause)).find(|(status, _)| status.is_some()).unwrap()
}

#[cfg(target_os = "linux")]
fn interrupted_after(bench: &Bench, args: &str, pause_ms: u64) -> (Option<i32>, String) {
    let child = Command::new(env!("CARGO_BIN_EXE_kfdesign"))
        .args(args.split_whitespace())
        .current_dir(bench.path(""))
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let pid = child.id();
    until_it_listens(pid);
    std::thread::sleep(Duration::from_millis(pause_ms));
    assert!(Command::new("kill").args(["-INT", &pid.to_string()]).status().unwrap().success());
    let output = child.wait_with_output().unwrap();
    (output.status.code(), String::from_utf8(output.stderr).unwrap())
}

/// Far more runs than can be done before the signal; what is done is kept, valid, and gone on with.
#[cfg(target_os = "linux")]
#[test]
fn an_interrupted_experiment_keeps_its_runs() {
    let bench = bench(SMALL);
    let (status, said) = interrupted(&bench, &format!("{RUN} --runs 7..900000000 -o part.json"));
    assert_eq!(status, Some(2), "{said}");
    let part: Value = serde_json::from_str(&bench.read("part.json")).unwrap();
    let (first, end) = (part["runs"]["first"].as_u64().unwrap(), part["runs"]["end"].as_u64().unwrap());
    assert!(first == 7 && end > 7, "{first}..{end}");
    assert_eq!(
        said,
        format!(
            "kfdesign: interrupted after {} of 899999993 runs, which are in part.json; the same command with --resume goes on\n",
            end - 7
        )
    );
    assert_eq!((part["verdict"].as_str(), part["tests"].as_array().map(Vec::len)), (Some("inconclusive"), Some(0)));
    // judged as it is; gone on with; the same as in one go
    let runs = end + 30;
    assert!(bench.run("merge part.json -o judged.json").status < 2);
    assert!(bench.run(&format!("{RUN} --runs 7..{runs} --resume -o part.json")).status < 2);
    assert!(bench.run(&format!("{RUN} --runs 7..{runs} -o whole.json")).status < 2);
    assert!(bench.read("part.json") == bench.read("whole.json"));
    assert!(bench.run(&format!("{RUN} --runs 7..{end} -o shorter.json")).status < 2);
    assert!(bench.read("judged.json") == bench.read("shorter.json"));
    assert_eq!(bench.files(), ["filter.json", "judged.json", "params.json", "part.json", "shorter.json", "whole.json"]);

    // without -o there is nothing to keep, and it says so
    let (status, said) = interrupted(&bench, &format!("{RUN} --runs 900000000"));
    assert!(status == Some(2) && said.contains("with -o FILE they would have been kept"), "{said}");
    assert_eq!(said.lines().count(), 1);

    // a file that is there is not given up for unfinished work
    let before = bench.read("whole.json");
    let (status, said) = interrupted(&bench, &format!("{RUN} --runs 900000000 -o whole.json"));
    assert!(status == Some(2) && said.contains("whole.json is as it was: with --resume, or another -o"), "{said}");
    assert!(bench.read("whole.json") == before);
}
