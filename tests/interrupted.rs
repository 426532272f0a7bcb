//! Ctrl-C and SIGTERM leave no unfinished files; a write that fails names the file that was asked for.
#![cfg(target_os = "linux")]

use std::os::unix::process::ExitStatusExt;
use std::process::{Command, Stdio};
use std::time::Duration;

use super::support::{Bench, data};

/// Runs the command, sends it `signal` after `pause`, and returns how it ended.
fn signalled(bench: &Bench, args: &str, signal: i32, pause: Duration) -> std::process::ExitStatus {
    let mut child = Command::new(env!("CARGO_BIN_EXE_kfdesign"))
        .args(args.split_whitespace())
        .current_dir(bench.path("."))
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    std::thread::sleep(pause);
    let sent = Command::new("kill").args([format!("-{signal}"), child.id().to_string()]).status().unwrap();
    let status = child.wait().unwrap();
    // one that has ended by itself is still there to be waited for
    assert!(sent.success());
    status
}

/// At twenty moments each. Whatever the moment, the process ends as the signal says or has done its work; there is
/// no file but whole ones.
#[test]
fn no_unfinished_file_is_left_by_a_signal() {
    let bench = Bench::new();
    bench.file("params.json", std::fs::read(data("params.json")).unwrap());
    bench.ok("simulate params.json -o log.npy --duration 20min --seed 4");
    bench.ok("tune params.json -o filter.json");
    let before = bench.files();
    let commands = [
        ("simulate params.json -o out.csv --duration 1000h", "out.csv"),
        ("simulate params.json -o out.csv.gz --duration 1000h", "out.csv.gz"),
        ("replay filter.json log.npy -o out.csv --innovations --report r.html --allow-inconclusive", "out.csv"),
    ];
    let mut caught = 0;
    for (args, out) in commands {
        for moment in 0..20 {
            let signal = [2, 15][moment % 2];
            // two dozen milliseconds, more and more densely packed at the start, where files are made
            let pause = Duration::from_micros(60 * (moment * moment) as u64);
            let status = signalled(&bench, args, signal, pause);
            assert!(status.signal() == Some(signal) || status.code() == Some(0), "{args}: {status:?}");
            caught += usize::from(status.signal().is_some());
            let left: Vec<String> = bench.files().into_iter().filter(|name| !before.contains(name)).collect();
            let whole = [out.to_string(), "r.html".into()];
            assert!(left.iter().all(|name| whole.contains(name)), "{args}, after {pause:?}: {left:?}");
            left.iter().for_each(|name| std::fs::remove_file(bench.path(name)).unwrap());
        }
    }
    assert!(caught >= 40, "{caught} of 60 caught in their work");
}

/// A file that may not grow further stands for a full disk: the one line names the output, and nothing is left.
#[test]
fn a_write_that_fails_names_the_output() {
    let bench = Bench::new();
    bench.file("params.json", std::fs::read(data("params.json")).unwrap());
    bench.ok("simulate params.json -o log.npy --duration 2min --seed 4");
    bench.ok("tune params.json -o filter.json");
    let before = bench.files();
    for (args, file) in [
        ("simulate params.json -o out.csv --duration 1h", "out.csv"),
        ("simulate params.json -o out.csv.gz --duration 1h", "out.csv.gz"),
        ("simulate params.json -o out.npy --duration 1h", "out.npy"),
        ("replay filter.json log.npy -o out.csv", "out.csv"),
        ("replay filter.json log.npy --report out.html", "out.html"),
        ("tune params.json --report out.html", "out.html"),
        ("identify log.npy --method graphical --plot out.svg", "out.svg"),
    ] {
        let limited = format!("ulimit -f 8; exec \"$0\" {args}");
        let out = Command::new("sh")
            .args(["-c", &limited, env!("CARGO_BIN_EXE_kfdesign")])
            .current_dir(bench.path("."))
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&out.stderr);
        let line = format!("kfdesign: {file}: cannot write: the file is larger than it may be (ulimit -f)");
        assert!(out.status.code() == Some(2) && said.lines().last() == Some(&line), "{args}: {said}");
        assert_eq!(bench.files(), before, "{args}");
    }
}
