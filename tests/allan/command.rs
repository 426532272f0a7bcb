//! `kfdesign allan` from the outside.

use serde_json::Value;

use super::*;
use crate::support::Bench;

/// A log with one column, every digit written.
fn log(header: &str, values: &[f64]) -> String {
    values.iter().fold(format!("{header}\n"), |text, v| format!("{text}{v:?}\n"))
}

fn json(bench: &Bench, args: &str) -> Value {
    serde_json::from_str(&bench.ok(args)).unwrap()
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect()
}

/// The published 1000 points as a log in deg/s give the published numbers in deg/s.
#[test]
fn published_values_in_the_unit_of_the_log() {
    let bench = Bench::new();
    bench.file("nist.csv", log("gyro_x (deg/s)", &nist()));
    let document = json(&bench, "allan nist.csv --rate 1 --taus decade --json");
    assert_eq!(document["format"], "kfdesign-allan/1");
    assert_eq!(document["deviation"], "oadev");
    assert_eq!(document["sample_rate"], serde_json::json!({"value": 1.0, "unit": "Hz"}));
    assert_eq!(document["log"]["samples"], 1000);
    let axis = &document["axes"][0];
    assert_eq!((axis["name"].as_str(), axis["unit"].as_str()), (Some("gyro_x"), Some("deg/s")));
    assert_eq!(numbers(&axis["tau_s"]), [1.0, 2.0, 4.0, 10.0, 20.0, 40.0, 100.0, 200.0, 400.0]);
    let deviation = numbers(&axis["deviation"]);
    for (index, printed) in [(0, "2.922319e-1"), (3, "9.159953e-2"), (6, "3.241343e-2")] {
        assert_eq!(format!("{:.6e}", deviation[index]), printed);
    }
    let (lower, upper, edf) = (numbers(&axis["lower"]), numbers(&axis["upper"]), numbers(&axis["edf"]));
    for i in 0..9 {
        assert!(lower[i] < deviation[i] && deviation[i] < upper[i]);
        let (low, high) = edf::interval(deviation[i], edf[i]);
        assert!((low / lower[i] - 1.0).abs() < 1e-12 && (high / upper[i] - 1.0).abs() < 1e-12);
    }
    let noise: Vec<&str> = axis["noise"].as_array().unwrap().iter().map(|n| n.as_str().unwrap()).collect();
    assert_eq!(noise, ["white", "white", "white", "white", "white", "unknown", "unknown", "unknown", "unknown"]);
}

#[test]
fn rate_increments_and_angle_agree() {
    let bench = Bench::new();
    let dt = 0.01;
    let increments: Vec<f64> = nist().iter().map(|y| (y * 1048576.0).round() / 1048576.0).collect();
    let rate: Vec<f64> = increments.iter().map(|v| v / dt).collect();
    let mut angle = vec![0.0];
    for v in &increments {
        angle.push(angle[angle.len() - 1] + v);
    }
    bench.file("rate.csv", log("x (deg/s)", &rate));
    bench.file("increments.csv", log("x (deg)", &increments));
    bench.file("angle.csv", log("x (deg)", &angle));
    let curve = |args: &str| {
        let axis = json(&bench, &format!("allan {args} --rate 100 --json"))["axes"][0].clone();
        assert_eq!(axis["unit"], "deg/s");
        assert_eq!(axis["samples"], 1000);
        numbers(&axis["deviation"])
    };
    let from_rate = curve("rate.csv");
    for other in [curve("increments.csv --input increments"), curve("angle.csv --input angle")] {
        assert_eq!(other.len(), from_rate.len());
        for (a, b) in from_rate.iter().zip(other) {
            assert!((a / b - 1.0).abs() < 1e-12, "{a} and {b}");
        }
    }
}

/// Every deviation runs; the file, stdout and the figure are the same result; nothing else is left behind.
#[test]
fn all_deviations_and_files() {
    let bench = Bench::new();
    let values = congruential(1, 3000);
    bench.file(
        "two.csv",
        values.chunks(2).fold("x (rad/s),y (rad/s)\n".into(), |t, p| format!("{t}{:?},{:?}\n", p[0], p[1])),
    );
    for kind in ["adev", "oadev", "mdev", "hdev", "ohdev", "totdev"] {
        let out =
            bench.ok(&format!("allan two.csv --rate 100 --deviation {kind} --json -o {kind}.json --plot {kind}.svg"));
        assert_eq!(out, bench.read(&format!("{kind}.json")));
        let document: Value = serde_json::from_str(&out).unwrap();
        assert_eq!(document["deviation"], kind);
        assert_eq!(document["axes"].as_array().unwrap().len(), 2);
        let figure = bench.read(&format!("{kind}.svg"));
        assert!(figure.starts_with("<svg") && figure.contains("95 % interval") && figure.contains("rad/s"));
    }
    let text = bench.ok("allan two.csv --rate 100 --taus log:3");
    for word in ["x: overlapping Allan deviation of 1500 samples", "tau (s)", "deviation (rad/s)", "edf", "Intervals:"]
    {
        assert!(text.contains(word), "{word} not in\n{text}");
    }
    assert_eq!(bench.files().len(), 13);
}

/// A gap and an unusable sample: the longest stretch is used, and it says so.
#[test]
fn longest_stretch_is_used() {
    let bench = Bench::new();
    let mut text = String::from("t (s),x (deg/s)\n");
    for (k, y) in nist().iter().enumerate() {
        let time = if k < 400 { k as f64 * 0.5 } else { k as f64 * 0.5 + 30.0 };
        let value = if k == 500 { "nan".into() } else { format!("{y:?}") };
        text.push_str(&format!("{time},{value}\n"));
    }
    bench.file("gap.csv", text);
    let out = bench.run("allan gap.csv --json");
    assert_eq!(out.status, 0, "{}", out.stderr);
    let document: Value = serde_json::from_str(&out.stdout).unwrap();
    assert_eq!(document["axes"][0]["samples"], 499);
    assert!(out.stderr.contains("499 samples, 501 left out"), "{}", out.stderr);
    let expected = allan::curve(&nist()[501..], 0.5, Deviation::Oadev, TauGrid::Octave).unwrap();
    for (a, b) in numbers(&document["axes"][0]["deviation"]).iter().zip(&expected.points) {
        assert!((a / b.deviation - 1.0).abs() < 1e-12);
    }
}

#[test]
fn complaints_are_one_line_and_leave_nothing() {
    let bench = Bench::new();
    bench.file("log.csv", log("x (deg/s)", &nist()));
    bench.file("one.csv", "x (deg/s)\n1.0\n");
    for (args, words) in [
        ("allan log.csv --rate 1 -o log.csv", "input"),
        ("allan log.csv --rate 1 --plot log.csv", "input"),
        ("allan log.csv --rate 1 -o missing/out.json", "cannot write"),
        ("allan one.csv --rate 1", "one.csv"),
        ("allan absent.csv --rate 1", "absent.csv"),
    ] {
        let out = bench.run(args);
        assert_eq!((out.status, out.stdout.as_str()), (2, ""), "{args}: {}", out.stderr);
        let last = out.stderr.lines().last().unwrap();
        assert!(last.starts_with("kfdesign: ") && last.contains(words), "{args}: {}", out.stderr);
    }
    let out = bench.run("allan log.csv --rate 1 --taus sometimes");
    assert!(out.status == 2 && out.stderr.contains("octave, decade, all"), "{}", out.stderr);
    assert_eq!(bench.read("log.csv"), log("x (deg/s)", &nist()));
    assert_eq!(bench.files(), ["log.csv", "one.csv"]);
}

/// Two logs: a panel for each axis with a curve for each log, or one panel for all; a document is of one log.
#[test]
fn several_logs_share_a_panel() {
    let bench = Bench::new();
    let values = congruential(1, 6000);
    for (name, values) in [("a.csv", &values[..3000]), ("b.csv", &values[3000..])] {
        let rows = values.chunks(2).map(|p| format!("{:?},{:?}\n", p[0], p[1]));
        bench.file(name, format!("x (rad/s),y (rad/s)\n{}", rows.collect::<String>()));
    }
    // bands have two digits; one is the fine grid
    let bands = |figure: &str| {
        let found = figure.split(" class=\"kf4").skip(1);
        found.filter(|rest| rest.starts_with(|c: char| c.is_ascii_digit())).count()
    };
    let curves = |file: &str| bench.read(file).split("<svg y=").skip(1).map(bands).collect::<Vec<_>>();
    let text = bench.ok("allan a.csv b.csv --rate 100 --plot two.svg");
    assert!(text.starts_with("a.csv:\n") && text.contains("\nb.csv:\n"), "{text}");
    // a band for each curve, and one in the legend
    assert_eq!(curves("two.svg"), [3, 3]);
    let svg = bench.read("two.svg");
    for word in ["<title>x: overlapping", "<title>y: overlapping", "\na.csv\n", "\nb.csv\n"] {
        assert!(svg.contains(word), "{word}");
    }
    bench.ok("allan a.csv b.csv --rate 100 --plot one.svg --overlay");
    assert_eq!(curves("one.svg"), [5]);
    assert!(bench.read("one.svg").contains("\nb.csv, y\n"));
    bench.ok("allan a.csv --rate 100 --plot axes.svg --overlay");
    assert_eq!(curves("axes.svg"), [3]);
    for refused in ["allan a.csv b.csv --rate 100 --json", "allan a.csv --rate 100 --overlay"] {
        let out = bench.run(refused);
        assert_eq!((out.status, out.stderr.lines().count()), (2, 1), "{refused}: {}", out.stderr);
    }
}

/// The log over time: moving average, a line at what the log check found, nothing drawn over a gap.
#[test]
fn a_log_is_drawn_over_time() {
    let bench = Bench::new();
    let time = |k: usize| if k < 700 { 0.01 * k as f64 } else { 0.01 * k as f64 + 5.0 };
    let rows = congruential(1, 1500).into_iter().enumerate().map(|(k, y)| format!("{:.2},{y:?}\n", time(k)));
    bench.file("log.csv", format!("t (s),x (deg/s)\n{}", rows.collect::<String>()));
    bench.ok("info log.csv --plot log.svg");
    let svg = bench.read("log.svg");
    for word in ["x: log.csv", "mean of 101 samples, 1.010 s", "a: gap at 12.00 s", "x (deg/s)"] {
        assert!(svg.contains(word), "{word}");
    }
    // log and average in two pieces each, and a sample in the legend
    assert_eq!(svg.matches("<polyline class=\"kf12\"").count(), 3);
    assert_eq!(svg.matches("<polyline class=\"kf20\"").count(), 3);
    let out = bench.run("info none.csv --plot log.eps");
    assert!(out.status == 2 && out.stderr.contains("--plot writes SVG, PDF or PNG"), "{}", out.stderr);
}
