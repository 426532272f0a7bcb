//! What is simulated: wrong designs, drawn truths, one run alone; and what is written about it.

use quick_junit::Report;
use serde_json::Value;

use super::{SMALL, bench, changed};
use crate::params::accepts;
use crate::support::{Bench, data};

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
}

/// Runs the command; its exit status and its document.
fn document(bench: &Bench, args: &str) -> (i32, Value) {
    let out = bench.run(&format!("montecarlo {args} --json"));
    assert!(out.status < 2 && out.stderr.is_empty(), "{args}: {} {}", out.status, out.stderr);
    (out.status, serde_json::from_str(&out.stdout).unwrap())
}

/// The shipped wrong designs are caught, the right one passes. Means are where the covariance analysis expects them:
/// within 5 standard deviations, NIS as of independent updates, NEES as a scaled χ² (two-sided 6e-7 for each of the
/// 14 numbers).
#[test]
fn wrong_designs_are_rejected_and_the_right_one_is_not() {
    let bench = Bench::new();
    let truth = data("wrong/truth.json");
    let designs = [
        ("truth", 0),
        ("sigma_x2.24", 1),
        ("white_x1.06", 1),
        ("correlation_time_x2", 1),
        ("correlation_time_x0.5", 1),
        ("drift_left_out", 1),
        ("turn_on_bias_x0.1", 1),
    ];
    for (name, expected) in designs {
        bench.ok(&format!("tune {} -o {name}.json", data(&format!("wrong/{name}.json")).display()));
        let runs = 60.0;
        let (status, found) =
            document(&bench, &format!("{name}.json --truth {} --runs 60 --duration 400s", truth.display()));
        assert_eq!(status, expected, "{name}: {}", found["meaning"]);
        assert_eq!(found["verdict"], if expected == 0 { "consistent" } else { "inconsistent" });
        let axis = &found["axes"][0];
        let innovations = &axis["innovations"][0];
        let (nis, mean) = (innovations["nis"].as_f64().unwrap(), innovations["expected_nis"].as_f64().unwrap());
        let updates = innovations["updates"].as_f64().unwrap();
        assert!((nis - mean).abs() < 5.0 * mean * (2.0 / updates).sqrt(), "{name}: NIS {nis}, expected {mean}");
        let nees = &axis["nees_average"];
        let (average, mean) = (nees["mean"].as_f64().unwrap(), nees["expected"].as_f64().unwrap());
        // at least as many degrees of freedom as one component has
        let freedom = runs * nees["effective_epochs"].as_f64().unwrap();
        assert!(
            (average - mean).abs() < 5.0 * mean * (2.0 / freedom).sqrt(),
            "{name}: NEES {average}, expected {mean}"
        );
    }
}

#[test]
fn drawn_truths_are_deterministic_and_judged() {
    let interval = r#""white": {"density": {"value": 0.05, "unit": "deg/s/sqrt(Hz)", "interval": [LOW, HIGH]}}"#;
    let spread = |low: &str, high: &str| {
        let white = interval.replace("LOW", low).replace("HIGH", high);
        SMALL.replace(r#""white": {"density": "0.05 deg/s/sqrt(Hz)"}"#, &white)
    };
    let bench = bench(SMALL);
    bench.file("narrow.json", spread("0.0499", "0.0501"));
    bench.file("wide.json", spread("0.025", "0.1"));
    let run = "filter.json --runs 40 --duration 20s";
    let (_, plain) = document(&bench, &format!("{run} --truth narrow.json"));
    let (consistent, narrow) = document(&bench, &format!("{run} --truth narrow.json --truth-spread --threads 1"));
    let (_, again) = document(&bench, &format!("{run} --truth narrow.json --truth-spread --threads 3"));
    assert!(narrow == again);
    assert_ne!(narrow["sums"], plain["sums"]);
    // 0.1 % of the noise is far from what 8000 innovations tell: the level is that of the true design, 1 %
    assert_eq!(consistent, 0, "{}", narrow["meaning"]);
    // a factor of two either way: innovations of one run have a mean square between 1/4 and 4
    let (inconsistent, wide) = document(&bench, &format!("{run} --truth wide.json --truth-spread"));
    assert_eq!(inconsistent, 1, "{}", wide["meaning"]);
    let nis = wide["tests"].as_array().unwrap().iter().find(|test| test["name"] == "nis").unwrap();
    assert_eq!(nis["pass"], false);
}

/// Run 7 as a table and run 7 as sums are the same numbers.
#[test]
fn one_run_alone_is_that_among_many() {
    let bench = bench(SMALL);
    let (_, sums) = document(&bench, "filter.json --duration 20s --runs 7..8");
    let said = bench.ok("montecarlo filter.json --duration 20s --run 7 -o run.csv");
    assert_eq!(said, "run 7 (seed 1): 200 samples of 0.1000 s in run.csv\n");
    let text = bench.read("run.csv");
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next().unwrap().split(',').collect();
    let rows: Vec<Vec<f64>> = lines.map(|line| line.split(',').map(|x| x.parse().unwrap()).collect()).collect();
    assert_eq!(rows.len(), 200);
    let column =
        |name: &str| header.iter().position(|h| h.starts_with(name)).unwrap_or_else(|| panic!("{name}: {header:?}"));
    let axis = &sums["axes"][0];
    // rounding only: numbers of a file are written with all their digits, and P0 is taken apart and put together again
    let close = |a: f64, b: f64, scale: f64| assert!((a - b).abs() <= 1e-9 * scale, "{a} {b}");
    for component in axis["errors"].as_array().unwrap() {
        let name = component["name"].as_str().unwrap();
        let (of_truth, estimate) = (column(&format!("x_{name}_true")), column(&format!("x_{name}_estimated")));
        let times = numbers(&axis["nees"]["time_s"]);
        let curves = ["mean", "rms", "predicted_sigma"].map(|key| numbers(&component[key]));
        for (i, time) in times.iter().enumerate() {
            let row = &rows[(time * 10.0).round() as usize];
            let error = row[of_truth] - row[estimate];
            close(curves[0][i], error, curves[2][i]);
            close(curves[1][i], error.abs(), curves[2][i]);
        }
        assert_eq!(times.len(), 101); // the first measurement and 100 evenly spread times
    }
    let y = column("x_innovation_normalised");
    let mean = |f: &dyn Fn(f64) -> f64| rows.iter().map(|row| f(row[y])).sum::<f64>() / 200.0;
    close(axis["innovations"][0]["nis"].as_f64().unwrap(), mean(&|y| y * y), 1.0);
    close(axis["innovations"][0]["mean"].as_f64().unwrap(), mean(&|y| y), 1.0);
    let lag_1: f64 = rows.windows(2).map(|pair| pair[0][y] * pair[1][y]).sum::<f64>() / 199.0;
    close(numbers(&axis["innovations"][0]["autocorrelation"])[0], lag_1 / mean(&|y| y * y), 1.0);
    // another run and another seed are other numbers
    for flags in ["--run 8", "--run 7 --seed 2"] {
        bench.ok(&format!("montecarlo filter.json --duration 20s {flags} -o other.csv"));
        assert_ne!(bench.read("other.csv"), text, "{flags}");
    }
}

/// The report counts what the verdict counts; every document fits the published schema.
#[test]
fn junit_and_schema_fit_the_documents() {
    let bench = bench(SMALL);
    bench.file("truth.json", SMALL.replace("0.05 deg/s/sqrt(Hz)", "0.08 deg/s/sqrt(Hz)"));
    let schema: Value = serde_json::from_str(&bench.ok("schema montecarlo")).unwrap();
    for (flags, failed) in
        [("", false), ("--truth truth.json", true), ("--runs 5..6", false), ("--replicates 2", false)]
    {
        let runs = if flags.contains("--runs") { "" } else { "--runs 20" };
        let run = format!("filter.json --duration 20s {runs} {flags} --power --junit out.xml");
        let (status, found) = document(&bench, &run);
        assert_eq!(status == 1, failed, "{flags}: {}", found["meaning"]);
        accepts(&schema, &schema, &found).unwrap();
        let tests = found["tests"].as_array().unwrap();
        let failures = tests.iter().filter(|test| test["pass"] == false).count();
        assert_eq!(failures > 0, failed);
        let report = Report::deserialize_from_str(&bench.read("out.xml")).unwrap();
        assert_eq!((report.tests, report.failures, report.errors), (tests.len(), failures, 0), "{flags}");
        assert_eq!(report.test_suites.len(), 1);
        assert_eq!(bench.read("out.xml").matches("<failure ").count(), failures);
    }
    // interrupted work has no verdict and no critical value
    let (_, shard) = document(&bench, "filter.json --duration 20s --runs 20");
    let partial = changed(&shard.to_string(), |d| {
        d["critical_p_value"] = Value::Null;
        d["verdict"] = "inconclusive".into();
        d["tests"] = Value::Array(vec![]);
        d["axes"] = Value::Array(vec![]);
    });
    accepts(&schema, &schema, &serde_json::from_str(&partial).unwrap()).unwrap();
    for wrong in ["runs", "sums", "experiment"] {
        let without = changed(&partial, |d| drop(d.as_object_mut().unwrap().remove(wrong)));
        assert!(accepts(&schema, &schema, &serde_json::from_str(&without).unwrap()).is_err(), "{wrong}");
    }
}
