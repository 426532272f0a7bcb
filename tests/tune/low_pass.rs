//! The sensor behind a low-pass of docs/low-pass.md.

use std::path::Path;

use serde_json::Value;

use super::{close, gauss_markov, sensor, tuned, white};
use crate::support::{Bench, data};

/// The numbers of the table are those of the commands above it; whether they are right is tested where `--truth` and
/// `replay` are. The two identified designs are fits, of which another machine may round the last digit otherwise:
/// half a unit of the last digit shown and 1e-4 beyond.
#[test]
fn the_table_of_wrong_filters_is_true() {
    let page = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/low-pass.md")).unwrap();
    let bench = Bench::new();
    let shipped = |name: &str| data(&format!("low_pass/{name}.json")).display().to_string();
    let truth = shipped("sensor");
    bench.ok(&format!("simulate {truth} -o log.npy --duration 1h --seed 3"));
    bench.ok("identify log.npy -o params.json");
    // a model that misses the spectrum of the log: written all the same
    assert_eq!(bench.run("identify log.npy --model white+gm -o drift.json").status, 1);
    let of = |row: &str, params: &str| {
        let design = bench.ok(&format!("tune {params} --truth {truth} -o filter.json --json"));
        let design: Value = serde_json::from_str(&design).unwrap();
        let last = |key: &str| {
            let sigmas = design["under_truth"][0]["drift"][key].as_array().unwrap();
            sigmas.last().unwrap().as_f64().unwrap().to_degrees()
        };
        let replayed = bench.run("replay filter.json log.npy --json");
        let replayed: Value = serde_json::from_str(&replayed.stdout).unwrap();
        let axis = &replayed["axes"][0];
        let log =
            [&axis["nis"]["mean"], &axis["whiteness"]["max_abs_autocorrelation"]].map(|v| v.as_f64().unwrap().abs());
        let found = [last("real"), last("claimed"), last("real") / last("claimed"), log[0], log[1]];
        let line = page.lines().find(|line| line.starts_with(&format!("| {row} |"))).unwrap();
        let cells: Vec<&str> = line.trim_matches('|').split('|').map(str::trim).collect();
        for (found, shown) in found.iter().zip(&cells[1..6]) {
            let decimals = shown.split_once('.').map_or(-1, |(_, digits)| digits.len() as i32);
            let half = 0.5 * 10f64.powi(-decimals);
            let shown: f64 = shown.parse().unwrap();
            assert!((found - shown).abs() < half + 1e-4 * shown, "{row}: {found}, the page has {shown}");
        }
        assert_eq!(replayed["verdict"], cells[6], "{row}");
    };
    of("as identified", "params.json");
    of("white, the density", &shipped("density"));
    of("white, the standard deviation", &shipped("std_dev"));
    of("white + fast drift", "drift.json");
}

/// A drift as fast as the samples is followed up to half their rate: there is no bandwidth to tell, and the words do
/// not say that there is no drift. With gain K and a = (1 − K) e^(−dt/Tc) the estimate has K/|1 − a e^(−iω)| of the
/// measurement, at half the rate (1 − a)/(1 + a) of what it has at zero: more than 1/√2 for a < 0.17.
#[test]
fn a_drift_as_fast_as_the_samples_has_no_bandwidth() {
    let fast = tuned(&sensor(200.0, vec![white(1e-5), gauss_markov(0.02, 0.04)], Some(0.5)));
    let steady = &fast.design.axes[0].steady_state;
    let a = (1.0 - steady.gain[(1, 0)]) * (-0.005f64 / 0.04).exp();
    assert!(a < 0.17, "{a}");
    assert!(fast.reports[0].bandwidth_hz.is_none());
    close(fast.reports[0].error_budget.iter().map(|s| s.share).sum(), 1.0, 1e-12);
    let bench = Bench::new();
    let mut design = std::fs::read_to_string(data("low_pass/std_dev.json")).unwrap();
    for (from, to) in [("0.00165", "0.00001"), ("60.0", "0.04"), ("0.004,", "0.02,")] {
        assert!(design.contains(from), "{from}");
        design = design.replace(from, to);
    }
    bench.file("fast.json", design);
    let told = bench.ok("tune fast.json -o filter.json");
    assert!(told.contains("up to half the sample rate: the drift estimate follows each sample"), "{told}");
    assert!(!told.contains("follows no drift"), "{told}");
}

/// Where noise of the measurement has states, R is not all that a sample scatters by.
#[test]
fn r_of_a_band_limited_sensor_is_its_white_noise() {
    let bench = Bench::new();
    let told = |name: &str| bench.ok(&format!("tune {} --runs 10", data(name).display()));
    for (name, limited) in [("low_pass/sensor.json", true), ("vibrating.json", true), ("low_pass/density.json", false)]
    {
        let text = told(name);
        let line = text.lines().find(|line| line.starts_with("R ")).unwrap();
        let words = if limited { "^2: white noise of one sample has sigma" } else { "^2: one sample has sigma" };
        assert!(line.contains(words), "{name}: {line}");
    }
}
