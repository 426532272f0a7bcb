//! `tune --objective` and `tune --rank` as commands: documents, exit status, bad input.

use kfdesign::filter::FilterDesign;
use serde_json::Value;

use super::super::Bench;

/// One axis at 10 Hz, with intervals.
const PARAMS: &str = r#"{
  "format": "kfdesign-params/1", "quantity": "angular-rate", "sample_rate": "10 Hz",
  "axes": [{
    "name": "x", "turn_on_bias": { "std_dev": "0.5 deg/s" },
    "white": { "density": { "value": 0.05, "unit": "deg/s/sqrt(Hz)", "interval": [0.0495, 0.0505] } },
    "gauss_markov": { "std_dev": { "value": 0.04, "unit": "deg/s", "interval": [0.032, 0.05] },
                      "correlation_time": { "value": 60, "unit": "s", "interval": [35, 100] } }
  }]
}"#;

/// The same sensor, and one that drifts four times as much.
fn bench() -> Bench {
    let bench = Bench::new();
    bench.file("params.json", PARAMS);
    bench.file(
        "wrong.json",
        PARAMS.replace("\"value\": 0.04", "\"value\": 0.16").replace(", \"interval\": [0.032, 0.05]", ""),
    );
    bench.ok("simulate params.json -o log.npy --duration 40min --seed 4");
    bench
}

fn json(text: &str) -> Value {
    serde_json::from_str(text).unwrap()
}

#[test]
fn the_record_of_the_tuning_is_in_the_design_that_is_written() {
    let bench = bench();
    for objective in ["robust", "likelihood --log log.npy", "nees --truth wrong.json", "als --log log.npy"] {
        let printed = bench.ok(&format!(
            "tune params.json --objective {objective} --hold gauss_markov.correlation_time --runs 20 -o filter.json --report page.html"
        ));
        let name = objective.split(' ').next().unwrap();
        assert!(printed.starts_with(&format!("Objective {name}\n")), "{printed}");
        assert!(bench.read("page.html").contains(&format!("Objective {name}")));
        let filter = json(&bench.read("filter.json"));
        let tuning = &filter["tuning"];
        assert_eq!(tuning["objective"], name);
        assert!(tuning["verification"]["verdict"] == "consistent");
        let parameters = tuning["parameters"].as_array().unwrap();
        assert_eq!(parameters.len(), 3);
        assert!(tuning[name].as_array().is_some_and(|axes| axes.len() == 1), "{tuning}");
        let of = |path: &str| parameters.iter().find(|p| p["parameter"] == path).unwrap();
        assert_eq!(of("gauss_markov.correlation_time")["held"], true);
        // what the filter was built from is what the record says
        let sigma = &of("gauss_markov.std_dev")["to"];
        assert_eq!(&filter["axes"][0]["noise"]["gauss_markov"][0]["std_dev"]["value"], sigma);
        assert_ne!(sigma, &of("gauss_markov.std_dev")["from"]);
        // and it is a filter like any other
        FilterDesign::read(&bench.path("filter.json")).unwrap();
    }
    let nominal = json(&bench.ok("tune params.json --runs 20 --json"));
    assert_eq!(nominal["filter"]["tuning"]["objective"], "nominal");
}

#[test]
fn designs_are_ranked_by_what_they_foretell() {
    let bench = bench();
    bench.ok("tune wrong.json --runs 20 -o filter.json");
    let ranking = json(&bench.ok("tune --json --rank filter.json params.json log.npy"));
    let designs = ranking["designs"].as_array().unwrap();
    assert_eq!([&designs[0]["design"], &designs[1]["design"]], ["params.json", "filter.json"]);
    assert_eq!(designs[0]["behind"], 0.0);
    assert_eq!(designs[0]["measurements"], 8000);
    // a drift four times too large costs a 0.1-nat share of every time constant of the filter: some ten in 800 s
    let behind = designs[1]["behind"].as_f64().unwrap();
    assert!(behind > 3.0 * designs[1]["behind_std_dev"].as_f64().unwrap(), "{ranking}");
    assert_eq!(designs[0]["verdicts"][0], "consistent");
    assert!(designs[1]["steady"][0]["sigma"].as_f64() > designs[0]["steady"][0]["sigma"].as_f64());
    // the likelihood is that of the objective on the same rows
    let tuned = json(&bench.ok("tune params.json --runs 20 --json --objective likelihood --log log.npy --no-prior"));
    let before = tuned["filter"]["tuning"]["likelihood"][0]["logs"][0]["held_out_before"].as_f64().unwrap();
    let ranked = designs[0]["held_out_log_likelihood"].as_f64().unwrap();
    assert!((ranked - before).abs() < 1e-6, "{ranked} {before}");
    let text = bench.ok("tune --rank filter.json params.json log.npy");
    assert!(text.contains("params.json foretells what was held out clearly best"), "{text}");
}

/// An aided flight: its columns are named as in replay, its aid is found from the log.
#[test]
fn a_flight_with_aids_is_tuned_on() {
    let bench = bench();
    let mut rows = String::from("time (s),gyro_x (deg/s),yaw (deg)\n");
    let mut state = 16807_u64;
    let mut uniform = || {
        state = 16807 * state % 2_147_483_647;
        state as f64 / 2_147_483_647.0 - 0.5
    };
    let mut angle = 0.0;
    for k in 0..6000 {
        let rate = 10.0 * (0.01 * f64::from(k)).sin();
        // uniform errors of standard deviation 0.158 deg/s and 1 deg
        let gyro = rate + 0.547 * uniform();
        let error = 3.464 * uniform();
        let yaw = if k % 10 == 0 { format!("{:.9}", angle + error) } else { String::new() };
        rows.push_str(&format!("{:.1},{gyro:.9},{yaw}\n", 0.1 * f64::from(k)));
        angle += 0.1 * rate;
    }
    bench.file("flight.csv", rows);
    let run = |more: &[&str]| {
        let aided = ["tune", "params.json", "--runs", "20", "--plant", "angle", "--aid", "heading: 2 deg @ 1 Hz"];
        bench.run_args(&[&aided, more].concat())
    };
    let columns = ["--log", "flight.csv", "--aid", "heading=yaw"];
    let likelihood = [&["--objective", "likelihood", "--json"], &columns[..]].concat();
    let out = run(&likelihood);
    let tuned = json(&out.stdout);
    let parameters = tuned["filter"]["tuning"]["parameters"].as_array().unwrap();
    let aid = parameters.iter().find(|p| p["parameter"] == "heading.std_dev").unwrap();
    // 600 headings: 2.9 % each way, five times that
    assert!((aid["to"].as_f64().unwrap() - 1.0).abs() < 0.15, "{aid}");
    assert_eq!(tuned["replay"].as_array().unwrap().len(), 1);
    // replayed as identified: the log contradicts a heading of 2 deg
    assert_eq!(run(&columns).status, 1);
    let out = run(&["--log", "flight.csv"]);
    assert!(out.status == 2 && out.stderr.contains("--aid heading=COLUMN"), "{out:?}");
    let out = run(&["--objective", "als", "--log", "flight.csv", "--aid", "heading=yaw"]);
    assert!(out.status == 2 && out.stderr.contains("every sample"), "{out:?}");
}

#[test]
fn a_log_that_the_intervals_come_from_is_told() {
    let bench = bench();
    bench.ok("identify log.npy -o identified.json");
    let twice = bench.run("tune identified.json --runs 20 --objective likelihood --log log.npy");
    assert!(twice.stderr.contains("counts twice"), "{}", twice.stderr);
    let once = bench.run("tune identified.json --runs 20 --objective likelihood --log log.npy --no-prior");
    assert!(!once.stderr.contains("counts twice"), "{}", once.stderr);
}

#[test]
fn bad_requests_are_one_line_and_write_nothing() {
    let bench = bench();
    bench.file("bare.json", PARAMS.replace(", \"interval\": [35, 100]", ""));
    bench.file(
        "short.csv",
        "time (s),gyro_x (deg/s)\n".to_string()
            + &(0..200).map(|k| format!("{:.1},{}\n", 0.1 * f64::from(k), k % 7)).collect::<String>(),
    );
    let before = bench.files();
    for (command, words) in [
        ("tune params.json --objective guess", "guess"),
        (
            "tune bare.json --objective robust",
            "no interval of gauss_markov.correlation_time, or one without an end; run identify first",
        ),
        ("tune params.json --objective likelihood", "--objective likelihood needs a log: --log LOG"),
        ("tune params.json --objective als", "--objective als needs a log: --log LOG"),
        ("tune params.json --objective nees", "--objective nees needs the truth: --truth PARAMS"),
        (
            "tune params.json --objective robust --hold gauss_markov.tau",
            "--hold gauss_markov.tau: there is no such parameter; there are gauss_markov.correlation_time, gauss_markov.std_dev, white.density",
        ),
        ("tune params.json --hold nothing", "--hold nothing: there is no such parameter"),
        ("tune params.json --objective robust --hold white,gauss_markov", "every parameter is held"),
        ("tune bare.json --objective likelihood --log short.csv", "too short for gauss_markov.correlation_time"),
        ("tune params.json --objective als --log short.csv", "too short for als"),
        ("tune params.json --objective likelihood --log log.npy --held-out 2", "--held-out is 2; expected a share"),
        ("tune params.json --objective likelihood --log none.csv", "none.csv: there is no such file"),
        ("tune --rank params.json", "found 1 designs (.json) and 0 logs"),
        ("tune --rank log.npy", "found 0 designs (.json) and 1 logs"),
        ("tune --rank params.json log.npy --held-out 0", "--held-out is 0"),
        ("tune --rank params.json none.csv", "none.csv: there is no such file"),
        ("tune", "required"),
    ] {
        let output = if command.contains("compare") { "" } else { " -o filter.json" };
        let out = bench.run(&format!("{command}{output}"));
        let line = out.stderr.lines().last().unwrap_or_default();
        assert!(out.status == 2 && out.stdout.is_empty() && line.contains(words), "{command}: {out:?}");
    }
    assert_eq!(bench.files(), before);
}
