//! `kfdesign montecarlo` and `kfdesign merge`: the same document however its runs were come by, refusals, truths,
//! closed forms.

mod closed_forms;
mod every_step;
mod refused;
mod shards;
mod truths;

use serde_json::Value;

use super::support::Bench;

/// A small design at 10 Hz that settles within seconds: a constant bias and one fast Gauss-Markov drift.
const SMALL: &str = r#"{"format": "kfdesign-params/1", "quantity": "angular-rate", "sample_rate": "10 Hz", "axes": [{
    "name": "x",
    "turn_on_bias": {"std_dev": "0.5 deg/s"},
    "white": {"density": "0.05 deg/s/sqrt(Hz)"},
    "gauss_markov": [{"std_dev": "0.05 deg/s", "correlation_time": "5 s"}]
}]}"#;

/// A directory that holds params.json with `params` and filter.json tuned for it.
fn bench(params: &str) -> Bench {
    let bench = Bench::new();
    bench.file("params.json", params);
    bench.ok("tune params.json -o filter.json");
    bench
}

/// [`SMALL`] with a second axis y of its own noise.
fn two_axes() -> String {
    let mut params: Value = serde_json::from_str(SMALL).unwrap();
    let mut second = params["axes"][0].clone();
    second["name"] = "y".into();
    second["white"]["density"] = "0.04 deg/s/sqrt(Hz)".into();
    params["axes"].as_array_mut().unwrap().push(second);
    params.to_string()
}

/// A drift that the filter learns in 1068 s. Runs are twice as long if no length is given; shorter ones are judged
/// as far as they go, and say what they leave out; the 600 s of others stay theirs.
#[test]
fn runs_are_as_long_as_the_design_needs() {
    let slow = SMALL.replace("5 s", "3000 s").replace("0.05 deg/s\"", "0.01 deg/s\"");
    let slower = slow.replace("3000 s", "1e7 s").replace("0.01 deg/s\"", "0.001 deg/s\"");
    for (params, expected, unsettled) in [(SMALL, 600.0, None), (&slow, 2.0, None), (&slower, 600.0, Some("x ("))] {
        let bench = bench(params);
        let design: Value = serde_json::from_str(&bench.read("filter.json")).unwrap();
        let settling = design["axes"][0]["steady_state"]["settling_time"]["value"].as_f64().unwrap();
        let out = bench.run("montecarlo filter.json --runs 4 --json");
        assert!(out.status < 2, "{out:?}");
        let document: Value = serde_json::from_str(&out.stdout).unwrap();
        let duration = document["duration_s"].as_f64().unwrap();
        let expected = if expected > 2.0 { expected } else { 2.0 * settling };
        assert!((duration - expected).abs() <= 0.1, "{duration} s, settling {settling} s");
        let said = document["meaning"].as_str().unwrap();
        let words = unsettled.map_or("settled", |axis| axis);
        assert_eq!(
            said.contains("end before the filter has settled") && said.contains(words),
            unsettled.is_some(),
            "{said}"
        );
        // more runs go on from these
        bench.run("montecarlo filter.json --runs 2 -o part.json");
        assert!(bench.run("montecarlo filter.json --runs 4 --resume -o part.json").status < 2);
        assert!(bench.read("part.json") == out.stdout);
    }
    let bench = bench(&slow);
    let short = bench.run("montecarlo filter.json --runs 10 --duration 20s");
    assert!(
        short.status < 2 && short.stdout.contains("; runs of 20.00 s end before the filter has settled: x ("),
        "{short:?}"
    );
}

/// `text` as JSON with `change` made to it.
fn changed(text: &str, change: impl FnOnce(&mut Value)) -> String {
    let mut value: Value = serde_json::from_str(text).unwrap();
    change(&mut value);
    value.to_string()
}
