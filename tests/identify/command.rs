//! The command `identify` says what the library finds, and refuses what it must.

use kfdesign::filter::likelihood::Stretch;
use kfdesign::identify::{ModelChoice, identify_logs};
use kfdesign::noise::Term;
use kfdesign::params::{CheckKind, Params, TermEntry};
use kfdesign::signal::bridge::bridge;
use kfdesign::units::Unit;

use super::{N, SIGMA, TC, gauss_markov, log, white};
use crate::support::{Bench, measured};

/// Three axes in one log, the middle one with an unusable sample: the numbers of the command are those of the library.
fn three_axis_log(bench: &Bench) -> Vec<Vec<f64>> {
    let unit = Unit::parse("deg/s").unwrap();
    let mut axes: Vec<Vec<f64>> = (0..3)
        .map(|axis| {
            let rate = log(&[white(N), gauss_markov(SIGMA, 20.0)], 3000, 0.1, 10, axis);
            rate.iter().map(|x| (x + 0.1) * 1e6).map(|x| x.round() / 1e6).collect()
        })
        .collect();
    let mut text = String::from("gyro_x (deg/s),gyro_y (deg/s),gyro_z (deg/s)\n");
    for (k, ((x, y), z)) in axes[0].iter().zip(&axes[1]).zip(&axes[2]).enumerate() {
        let y = if k == 1000 { f64::NAN } else { *y };
        text += &format!("{x},{y},{z}\n");
    }
    bench.file("log.csv", text);
    axes[1][1000] = f64::NAN;
    axes.iter().map(|axis| axis.iter().map(|x| unit.to_si(*x)).collect()).collect()
}

#[test]
fn command_writes_what_the_library_finds() {
    let bench = Bench::new();
    let axes = three_axis_log(&bench);
    let out = bench.run("identify log.csv --rate 10 -o params.json --report r.html --plot p.svg --json");
    assert_eq!(out.status, 0, "{}", out.stderr);
    assert!(
        out.stderr.contains(
            "gyro_y: a stretch with short holes chooses the terms: 3000 samples, 1 of them missing and filled in there with noise as elsewhere in the log, 0 left out"
        ),
        "{}",
        out.stderr
    );
    assert_eq!(bench.files(), ["log.csv", "p.svg", "params.json", "r.html"]);
    let document: serde_json::Value = serde_json::from_str(&out.stdout).unwrap();
    let written: serde_json::Value = serde_json::from_str(&bench.read("params.json")).unwrap();
    assert_eq!(document["params"], written);
    let params = Params::read(&bench.path("params.json")).unwrap();
    let unit = Unit::parse("deg/s").unwrap();
    for (i, axis) in params.axes.iter().enumerate() {
        let bridged = bridge(&axes[i]).map(|found| found.samples);
        assert_eq!(bridged.is_some(), i == 1);
        let rate = bridged.unwrap_or_else(|| axes[i].clone());
        let whole = [vec![Stretch { missing: 0, samples: &axes[i] }]];
        let expected = identify_logs(&axis.name, &[&rate], &whole, 0.1, &unit, &ModelChoice::Auto, &[]).unwrap();
        assert_eq!(*axis, Params::from_json(&bench.read("params.json"), "p").unwrap().axes[i]);
        assert_eq!(axis.terms.len(), expected.params.terms.len());
        for (a, b) in axis.noise().terms.iter().zip(&expected.model.terms) {
            let (a, b) = (a.allan_variance(7, 0.1), b.allan_variance(7, 0.1));
            assert!((a / b - 1.0).abs() < 1e-6, "{}: {a} and {b}", axis.name);
        }
        assert!(
            axis.terms
                .iter()
                .all(|t| !matches!(t, TermEntry::White { density } if density.unit.text() != "deg/s/sqrt(Hz)"))
        );
    }
    let source = params.source.unwrap();
    assert_eq!((source.method.as_deref(), source.samples), (Some("likelihood"), Some(3000)));
    assert_eq!(source.log.as_deref(), Some("log.csv"));
    assert_eq!(source.sha256.unwrap().len(), 64);
    let count = |name: &str| document["axes"][1][name].as_u64();
    assert_eq!(["samples", "left_out", "filled"].map(count), [Some(2999), Some(0), Some(1)]);
    assert_eq!(document["axes"][0].get("filled"), None);
    assert!(bench.read("p.svg").contains("gyro_z"));
    assert!(
        bench.read("r.html").contains("What this log does not tell") || bench.read("r.html").contains("Parameters")
    );
    // same input, same bytes
    let again = bench.run("identify log.csv --rate 10 --json");
    assert_eq!(out.stdout, again.stdout);
}

#[test]
fn command_shows_tables_and_refuses_what_it_must() {
    let bench = Bench::new();
    three_axis_log(&bench);
    let text = bench.ok("identify log.csv --rate 10 --columns gyro_x");
    for words in ["gyro_x: white", "angle random walk", "95 % from", "Candidates", "chosen"] {
        assert!(text.contains(words), "{words}:\n{text}");
    }
    let text = bench.ok("identify log.csv --rate 10 --columns gyro_x --method graphical");
    for words in ["The recipe, step by step", "minimum/0.664", "N/sqrt(dt)", "What each step costs"] {
        assert!(text.contains(words), "{words}:\n{text}");
    }
    for (arguments, words) in [
        ("identify log.csv --rate 10 -o log.csv", "log.csv: cannot write: it is the input file"),
        ("identify log.csv --rate 10 --report ./log.csv", "it is the input file"),
        ("identify log.csv --rate 10 --model white+x", "unknown term 'x'"),
        ("identify log.csv --rate 10 --model bl2 --method gmwm", "kfdesign: --model bl2: bl needs --method likelihood"),
        (
            "identify log.csv --rate 10 --model white+ma3 --method allan",
            "kfdesign: --model white+ma3: ma needs --method",
        ),
        ("identify log.csv --rate 10 --model white+gm --method graphical", "the graphical recipe has one model"),
        ("identify log.csv --rate 10 --end 1 --columns gyro_x", "samples are too few to identify noise"),
    ] {
        let out = bench.run(arguments);
        assert_eq!(out.status, 2, "{arguments}: {}", out.stderr);
        let last = out.stderr.lines().last().unwrap();
        assert!(last.contains(words), "{arguments}: {last}");
        assert!(out.stdout.is_empty());
    }
    assert_eq!(bench.files(), ["log.csv"]);
}

/// The reference sensor as somebody might state it.
const PARAMS_OF_A_CLAIM: &str = r#"{ "format": "kfdesign-params/1", "quantity": "angular-rate", "sample_rate": "1 Hz", "axes": [{ "name": "gyro_x",
    "bias": "0.6 deg/s", "white": { "density": "0.0562 deg/s/sqrt(Hz)" },
    "gauss_markov": [{ "std_dev": "0.028 deg/s", "correlation_time": "20 s" }] }] }"#;

/// An hour of the reference sensor whose correlation time has a lower limit alone: `null` in the document, a dash in
/// the table, the reason in words. The document is a design like any other, but for what needs both limits.
#[test]
fn a_correlation_time_without_an_upper_limit_goes_through() {
    let bench = Bench::new();
    bench.file("log.csv", {
        let rate = log(&[white(N), gauss_markov(SIGMA, TC)], 3600, 1.0, 47, 2);
        rate.iter().fold("gyro_x (deg/s)\n".to_string(), |text, x| text + &format!("{:.9}\n", x + 0.6))
    });
    let text = bench.ok("identify log.csv --rate 1 -o params.json --report r.html");
    let row = text.lines().find(|line| line.starts_with("Gauss-Markov Tc")).unwrap();
    assert_eq!(row.split_whitespace().nth(4), Some("-"), "{row}");
    assert!(text.contains("gauss_markov.correlation_time: above"), "{text}");
    let document: serde_json::Value = serde_json::from_str(&bench.read("params.json")).unwrap();
    let [sigma, time] = ["std_dev", "correlation_time"].map(|name| &document["axes"][0]["gauss_markov"][0][name]);
    for of in [sigma, time] {
        assert!(of["interval"][0].as_f64() < of["value"].as_f64() && of["interval"][1].is_null(), "{of}");
    }
    bench.ok("tune params.json -o filter.json");
    let exported = bench.ok("export params.json --to gnss-ins-sim");
    // N has an interval, K has none
    let densities = exported.lines().find(|line| line.contains(": N = ")).unwrap();
    assert!(densities.matches('[').count() == 1 && !densities.contains("inf]"), "{exported}");
    bench.file("claims.json", PARAMS_OF_A_CLAIM);
    let out = bench.run("compare claims.json log.csv --rate 1 --parameters");
    assert!(out.stdout.contains("; this log says") && out.stdout.contains(" [above "), "{out:?}");
    assert!(!out.stdout.contains("inf]"), "{out:?}");
    let out = bench.run("tune params.json -o robust.json --objective robust");
    let said = "no interval of gauss_markov.std_dev, gauss_markov.correlation_time, or one without an end";
    assert!(out.status == 2 && out.stderr.contains(said), "{out:?}");
    assert_eq!(bench.files(), ["claims.json", "filter.json", "log.csv", "params.json", "r.html"]);
}

/// The measured industrial gyro whose white density is known from its Allan deviation at 1 s (deg/s/√Hz, computed
/// independently), band-limited: within 10 %, and the band limit is said.
#[test]
fn measured_gyro_has_its_known_density() {
    let Some(path) = measured("static/SMAC-Group_imudata/adis16405_recording1.csv.gz") else { return };
    let bench = Bench::new();
    let command =
        format!("identify {} --rate 100 --sensor gyro --method allan --model white+flicker+rrw --json", path.display());
    let document: serde_json::Value = serde_json::from_str(&bench.ok(&command)).unwrap();
    for (axis, known) in [0.0409, 0.0430, 0.0387].into_iter().enumerate() {
        let density = document["params"]["axes"][axis]["white"]["density"]["value"].as_f64().unwrap();
        assert!((density / known - 1.0).abs() < 0.1, "axis {axis}: {density}, not {known}");
        assert!(document["axes"][axis]["first_tau_s"].as_f64().unwrap() > 0.05);
        let warnings = document["axes"][axis]["warnings"].to_string();
        assert!(warnings.contains("left out"), "{warnings}");
    }
}

/// A log that moves from 100 s to 120 s of 200 s is identified, but that is a failed check: exit status 1, said in
/// the document and by every later command, and nowhere "at rest". The part that is calm is named with the flags
/// that leave it, and they give a log with which all is well. White noise of 1000 windows has a motion with a
/// probability below 1e-6.
#[test]
fn a_log_that_moves_is_a_failed_check_wherever_it_goes() {
    let bench = Bench::new();
    let mut rate = log(&[white(N), gauss_markov(SIGMA, 20.0)], 20_000, 0.01, 11, 0);
    (10_000..12_000).for_each(|i| rate[i] += 20.0 * (i as f64 / 30.0).sin());
    let text: String = rate.iter().map(|x| format!("{x:.6}\n")).collect();
    bench.file("log.csv", format!("gyro_x (deg/s)\n{text}"));
    let out = bench.run("identify log.csv --rate 100 -o params.json --report r.html");
    assert_eq!(out.status, 1, "{}", out.stderr);
    let failed = "the log is not at rest all the time (gyro_x)";
    assert!(out.stderr.contains(&format!("check failed: {failed}")), "{}", out.stderr);
    let params = Params::read(&bench.path("params.json")).unwrap();
    let kinds: Vec<CheckKind> = params.source.as_ref().unwrap().checks.iter().map(|check| check.kind).collect();
    assert!(kinds.starts_with(&[CheckKind::Motion, CheckKind::Calm]), "{kinds:?}");
    assert_eq!(params.source.as_ref().unwrap().checks[0].numbers["of"], 20_000.0);
    assert_eq!(Params::from_json(&params.to_json(), "p").unwrap(), params);
    assert!(!bench.read("r.html").contains("log of the sensor at rest"));
    for command in [
        "tune params.json -o filter.json --runs 20",
        "export params.json --to matlab -o imu.m",
        "simulate params.json -o s.csv --duration 10s",
        "compare params.json log.csv --rate 100",
        "plan params.json --parameter white.density --precision 1%",
    ] {
        let out = bench.run(command);
        let said = out.stderr.matches(&format!("params.json: identified although a check failed: {failed}")).count();
        assert_eq!(said, 1, "{command}: {}", out.stderr);
    }
    assert!(!bench.read("imu.m").contains("identified at rest"), "{}", bench.read("imu.m"));
    // what another program's user reads there is a flag
    assert!(bench.read("imu.m").contains("that --end 99.2 leaves"), "{}", bench.read("imu.m"));
    assert!(bench.read("imu.m").contains(failed));
    // the design hands it on
    if bench.files().contains(&"filter.json".to_string()) {
        let out = bench.run("montecarlo filter.json --runs 20 --duration 60s");
        assert!(out.stderr.contains(&format!("filter.json: identified although a check failed: {failed}")));
    }
    let calm = params.source.as_ref().unwrap().checks[1].message.clone();
    let flags = calm.split("that ").nth(1).unwrap().split(" leaves").next().unwrap();
    let flags = flags.replace("`start`", "--start").replace("`end`", "--end");
    let out = bench.run(&format!("identify log.csv --rate 100 {flags} -o calm.json"));
    assert_eq!(out.status, 0, "{flags}: {}", out.stderr);
    assert!(Params::read(&bench.path("calm.json")).unwrap().source.unwrap().checks.is_empty());
    bench.run("export calm.json --to matlab -o calm.m");
    assert!(bench.read("calm.m").contains("identified at rest"));
}

/// A fit that misses the data surely and by more than is tolerated: a model of white noise for a log of white noise
/// and a line that has most of the power. And with the line in the model not.
#[test]
fn a_fit_that_misses_the_log_is_a_failed_check() {
    let bench = Bench::new();
    let line = Term::Oscillation { std_dev: 10.0 * N, frequency_hz: 8.0, correlation_time: 1.0 };
    let text: String = log(&[white(N), line], 20_000, 0.01, 12, 0).iter().map(|x| format!("{x:.6}\n")).collect();
    bench.file("log.csv", format!("gyro_x (deg/s)\n{text}"));
    let out = bench.run("identify log.csv --rate 100 --model white -o params.json");
    assert_eq!(out.status, 1, "{}", out.stderr);
    let params = Params::read(&bench.path("params.json")).unwrap();
    let checks = &params.source.as_ref().unwrap().checks;
    assert_eq!(checks.iter().map(|check| check.kind).collect::<Vec<_>>(), [CheckKind::Fit]);
    assert!(checks[0].numbers["periodogram_distance"] > checks[0].numbers["tolerated"]);
    assert!(params.failed_check().unwrap().contains("the model misses the spectrum of the log (gyro_x)"));
    let out = bench.run("identify log.csv --rate 100 --model white+osc -o params.json");
    assert_eq!(out.status, 0, "{}", out.stderr);
}
