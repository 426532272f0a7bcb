//! `kfdesign montecarlo` and `kfdesign merge`: the same document however its runs were come by, refusals, truths, closed forms.

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

/// `text` as JSON with `change` made to it.
fn changed(text: &str, change: impl FnOnce(&mut Value)) -> String {
    let mut value: Value = serde_json::from_str(text).unwrap();
    change(&mut value);
    value.to_string()
}
