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

/// No number of the operating system, no jargon of a parser; the name that may be meant, and what to type.
#[test]
fn wrong_use_is_told_in_words() {
    let bench = Bench::new();
    bench.file("open.json", "{\"format\": ");
    bench.file("word.json", "{\"format\": nul}");
    bench.file("log.csv", "gyro_x (deg/s)\n1\n2\n");
    bench.file("params.json", std::fs::read(data("params.json")).unwrap());
    let no_file = "cannot read: there is no such file";
    for (args, said) in [
        ("tune none.json", no_file),
        ("replay none.json log.csv", no_file),
        ("montecarlo none.json", no_file),
        ("merge none.json", no_file),
        ("trim none.json", no_file),
        ("loop none.json", no_file),
        ("import none.yaml", no_file),
        ("tune params.json --plant none.json", no_file),
        ("montecarlo .", "cannot read: it is a folder"),
        ("identify -", "-: a log is read more than once: save it to a file first"),
        ("tune open.json", "not valid JSON: the text ends too early: a bracket or a quotation mark is not closed"),
        ("tune word.json", "not valid JSON: expected a number, a text in quotation marks, true, false, null"),
        ("log.csv", "it is a file; what is to be done with it? kfdesign info log.csv says what is in it"),
        ("replay", "usage: kfdesign replay <FILTER> <LOG>; options: kfdesign replay -h; for example: kfdesign replay"),
        ("export params.json other.json --to px4", "usage: kfdesign export [OPTIONS] --to <TARGET> <FILE>"),
        ("export params.json --to px5", "a similar value exists: 'px4'"),
        ("tune params.json --plant agnle", "did you mean 'angle'?"),
        ("plan params.json --parameter white.densty --precision 1%", "did you mean 'white.density'?"),
        ("identify log.csv --rate 1 --columns gyro_y", "did you mean 'gyro_x'?"),
    ] {
        let out = bench.as_typed(&args.split_whitespace().collect::<Vec<_>>());
        let told = out.stderr.lines().count() == 1 && out.stderr.contains(said);
        assert!(out.status == 2 && told && !out.stderr.contains("os error"), "{args}: {out:?}");
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

/// What a file is, its ending says; nothing is read, nothing done, nothing left.
#[test]
fn an_ending_that_is_not_what_is_written_is_refused_before_the_work() {
    let bench = Bench::new();
    for (args, said) in [
        ("allan none.csv -o a.csv", "a.csv: -o writes JSON, not .csv; name it a.json"),
        ("allan none.csv --plot a.jpg", "a.jpg: --plot writes SVG, PDF or PNG, not .jpg; name it a.svg"),
        ("identify none.csv -o a.yaml", "a.yaml: -o writes JSON, not .yaml; name it a.json"),
        ("identify none.csv --report r.pdf", "r.pdf: --report writes an HTML page, not .pdf; name it r.html"),
        ("identify none.csv --plot p.EPS", "p.EPS: --plot writes SVG, PDF or PNG, not .eps; name it p.svg"),
        ("plan none.json --parameter a --precision 1% -o a.txt", "a.txt: -o writes JSON"),
        ("compare none.json none.csv -o a.html", "a.html: -o writes JSON"),
        ("compare none.json none.csv --report r.pdf", "r.pdf: --report writes an HTML page"),
        ("compare none.json none.csv --plot p.gif", "p.gif: --plot writes SVG, PDF or PNG"),
        ("inflate none.json none.csv -o a.txt", "a.txt: -o writes JSON"),
        (
            "simulate none.json -o a.txt --duration 1s",
            "a.txt: cannot write: the extension says the format: .csv, .csv.gz",
        ),
        ("tune none.json -o a.txt", "a.txt: -o writes JSON"),
        ("tune none.json --report r.pdf", "r.pdf: --report writes an HTML page"),
        ("tune none.json --plot p.gif", "p.gif: --plot writes SVG, PDF or PNG"),
        ("replay none.json none.csv -o est.txt", "est.txt: cannot write: the extension says the format"),
        ("replay none.json none.csv --report r.pdf", "r.pdf: --report writes an HTML page"),
        ("replay none.json none.csv --plot p.gif", "p.gif: --plot writes SVG, PDF or PNG"),
        ("montecarlo none.json -o a.csv", "a.csv: -o writes JSON"),
        ("montecarlo none.json --run 1 -o a.json", "a.json: cannot write: the extension says the format"),
        ("montecarlo none.json --junit a.html", "a.html: --junit writes JUnit XML"),
        ("montecarlo none.json --report r.pdf", "r.pdf: --report writes an HTML page"),
        ("montecarlo none.json --every-step a.txt", "a.txt: cannot write: the extension says the format"),
        ("merge none.json -o a.txt", "a.txt: -o writes JSON"),
        ("import none.yaml -o a.yaml", "a.yaml: -o writes JSON"),
        ("datasheet --rate 100 -o a.txt", "a.txt: -o writes JSON"),
        ("export none.json --to kalibr -o a.html", "a.html: -o writes text, not .html; give it another ending"),
    ] {
        let out = bench.run(args);
        assert!(out.status == 2 && out.stderr.contains(said) && out.stderr.lines().count() == 1, "{args}: {out:?}");
    }
    assert!(bench.files().is_empty());
    let out = bench.run("identify none.csv -o /dev/null --report r.htm --plot p");
    assert!(out.stderr.contains("none.csv: there is no such file"), "{out:?}");
}

/// The status is that of the work, whatever becomes of what it says.
#[cfg(target_os = "linux")]
#[test]
fn a_verdict_is_not_lost_with_its_output() {
    let bench = Bench::new();
    let params = data("params.json").display().to_string();
    bench.ok(&format!("simulate {params} -o log.npy --duration 10min --seed 4"));
    bench.ok(&format!("tune {params} -o good.json"));
    // innovations half as large as this filter says
    let mut wrong: serde_json::Value = serde_json::from_str(&bench.read("good.json")).unwrap();
    for axis in wrong["axes"].as_array_mut().unwrap() {
        axis.as_object_mut().unwrap().remove("steady_state");
        axis["R"][0][0] = (axis["R"][0][0].as_f64().unwrap() * 4.0).into();
    }
    bench.file("wrong.json", wrong.to_string());
    let small = "--runs 8 --duration 300s";
    let truth = format!("--truth {params}");
    assert!(bench.run(&format!("montecarlo wrong.json {truth} {small} -o shard.json")).status == 1);
    let rows = [
        ("replay wrong.json log.npy".to_string(), 1),
        ("replay wrong.json log.npy --json".into(), 1),
        (format!("montecarlo wrong.json {truth} {small} --json"), 1),
        ("merge shard.json --json".into(), 1),
        (format!("compare {params} log.npy --json"), 0),
        ("replay good.json log.npy --allow-inconclusive".into(), 0),
        (format!("tune {params}"), 0),
        ("identify log.npy --method graphical".into(), 0),
        ("info log.npy".into(), 0),
        ("completions bash".into(), 0),
        ("--help".into(), 0),
        ("replay none.json log.npy".into(), 2),
        ("replay --nonsense".into(), 2),
    ];
    let run = |args: &str, stdout: Stdio, stderr: Stdio| {
        let command = &mut Command::new(env!("CARGO_BIN_EXE_kfdesign"));
        command.args(args.split_whitespace()).current_dir(bench.path("."));
        let out = command.stdout(stdout).stderr(stderr).output().unwrap();
        (out.status.code(), String::from_utf8_lossy(&out.stderr).into_owned())
    };
    let full = || Stdio::from(std::fs::File::options().write(true).open("/dev/full").unwrap());
    // whose reader is gone before anything is written
    let closed = || {
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        Stdio::from(writer)
    };
    for (args, work) in &rows {
        assert_eq!(run(args, Stdio::piped(), Stdio::piped()).0, Some(*work), "{args}");
        assert_eq!(run(args, closed(), Stdio::piped()).0, Some(*work), "{args} | true");
        assert_eq!(run(args, Stdio::piped(), closed()).0, Some(*work), "{args} 2>&1 | true");
        assert_eq!(run(args, closed(), closed()).0, Some(*work), "{args} |& true");
        assert_eq!(run(args, Stdio::piped(), full()).0, Some(*work), "{args} 2>/dev/full");
        // a text that was asked for and did not fit is work not done; a verdict stays what it is
        let (status, said) = run(args, full(), Stdio::piped());
        assert_eq!(status, Some(if *work == 0 { 2 } else { *work }), "{args} >/dev/full: {said}");
        let told = said.lines().last() == Some("kfdesign: stdout: cannot write: no space is left on the disk");
        assert_eq!(told, *work == 0, "{args}: {said}");
    }
}

/// Stacks that no machine has room for stand for a machine without threads: the same work, the same bytes.
#[cfg(target_os = "linux")]
#[test]
fn without_threads_the_work_goes_on_with_one() {
    let bench = Bench::new();
    let params = data("params.json").display().to_string();
    bench.ok(&format!("simulate {params} -o log.csv --duration 15min --seed 4"));
    for args in [
        "identify log.csv --json".to_string(),
        "allan log.csv --json".into(),
        format!("tune {params} --runs 8 --json"),
        format!("tune {params} --runs 8 -o filter.json"),
        "montecarlo filter.json --runs 8 --json".into(),
        "montecarlo filter.json --runs 8 --threads 3 --json".into(),
        "replay filter.json log.csv --json".into(),
    ] {
        let usual = bench.run(&args);
        let out = Command::new(env!("CARGO_BIN_EXE_kfdesign"))
            .args(args.split_whitespace().chain(["-v"]))
            .current_dir(bench.path("."))
            .env("RUST_MIN_STACK", (1u64 << 60).to_string())
            .output()
            .unwrap();
        assert_eq!(out.status.code(), Some(usual.status), "{args}: {}", String::from_utf8_lossy(&out.stderr));
        assert!(String::from_utf8_lossy(&out.stdout) == usual.stdout, "{args}");
    }
}

/// A pipe with a name is told of before it is opened, which would wait for its other end.
#[cfg(unix)]
#[test]
fn a_named_pipe_is_refused_at_the_start() {
    let bench = Bench::new();
    assert!(Command::new("mkfifo").arg(bench.path("pipe.json")).status().unwrap().success());
    std::os::unix::fs::symlink("pipe.json", bench.path("link.json")).unwrap();
    bench.file("params.json", std::fs::read(data("params.json")).unwrap());
    for args in [
        "identify log.csv -o pipe.json",
        "tune params.json -o link.json",
        "tune pipe.json",
        "simulate pipe.json -o log.csv --duration 1s",
        "montecarlo link.json",
        "merge pipe.json",
        "compare pipe.json log.csv",
        "inflate pipe.json log.csv",
        "replay pipe.json log.csv",
        "replay params.json pipe.json",
        "export pipe.json --to kalibr",
        "export pipe.json --to rust",
        "import pipe.json",
        "plan pipe.json --parameter white.density --precision 1%",
        "info pipe.json",
    ] {
        let out = bench.run(args);
        let told = out.stderr.contains("named pipe") || out.stderr.contains("save it to a file first");
        assert!(out.status == 2 && told && out.stderr.lines().count() == 1, "{args}: {out:?}");
    }
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
