//! Any plant with any set of noise terms gives a valid filter or a clear refusal.

use std::collections::BTreeSet;

use kfdesign::filter::FilterDesign;
use kfdesign::params::{PLANTS, Params};
use kfdesign::tune::{TuneOptions, tune};
use kfdesign::units::Unit;
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

/// A size between 10^low and 10^high.
fn size(low: f64, high: f64) -> impl Strategy<Value = f64> {
    (low..high).prop_map(|exponent| 10f64.powf(exponent))
}

/// One noise term of an axis; `quantity`: "deg/s" or "m/s^2".
fn term(quantity: &'static str) -> impl Strategy<Value = String> {
    let q = quantity;
    let integral = if q == "deg/s" { "deg" } else { "m/s" };
    let slope = if q == "deg/s" { "deg/s^2" } else { "m/s^3" };
    prop_oneof![
        (size(-4.0, 0.0), size(-2.0, 5.0)).prop_map(move |(s, t)| format!(
            r#""gauss_markov": [{{"std_dev": "{s} {q}", "correlation_time": "{t} s"}}, {{"std_dev": "{t} {q}", "correlation_time": "{s} s"}}]"#
        )),
        size(-6.0, -1.0).prop_map(move |k| format!(r#""rate_random_walk": {{"density": "{k} {q}/sqrt(s)"}}"#)),
        size(-4.0, -1.0).prop_map(move |b| format!(r#""bias_instability": {{"coefficient": "{b} {q}"}}"#)),
        size(-6.0, -2.0).prop_map(move |c| format!(r#""quantization": {{"coefficient": "{c} {integral}"}}"#)),
        (size(-4.0, 0.0), 2..6_u32)
            .prop_map(move |(n, m)| format!(r#""moving_average": {{"density": "{n} {q}/sqrt(Hz)", "samples": {m}}}"#)),
        (size(-3.0, 0.0), 0.1..4.9_f64, size(-1.0, 2.0)).prop_map(move |(s, f, t)| format!(
            r#""oscillation": {{"std_dev": "{s} {q}", "frequency": "{f} Hz", "correlation_time": "{t} s"}}"#
        )),
        size(-9.0, -5.0).prop_map(move |r| format!(r#""rate_ramp": {{"slope": "{r} {slope}"}}"#)),
    ]
}

/// An axis of any terms, each key once, mostly with white noise.
fn axis(quantity: &'static str) -> impl Strategy<Value = String> {
    let white = prop_oneof![1 => Just(None), 9 => size(-4.0, 0.0).prop_map(Some)];
    (white, prop::collection::vec(term(quantity), 0..4)).prop_map(move |(white, terms)| {
        let mut keys: Vec<String> =
            white.iter().map(|n| format!(r#""white": {{"density": "{n} {quantity}/sqrt(Hz)"}}"#)).collect();
        let mut seen = BTreeSet::new();
        for term in terms {
            if seen.insert(term.split(':').next().unwrap().to_string()) {
                keys.push(term);
            }
        }
        let body: String = keys.iter().map(|key| format!(", {key}")).collect();
        format!(r#"{{"name": "x"{body}}}"#)
    })
}

/// Sigma, rate in Hz, and the sigma and correlation time of a drift.
type Aid = (f64, i32, Option<(f64, f64)>);

/// Aids of an output in `unit`.
fn aids(unit: &'static str) -> impl Strategy<Value = String> {
    let aid = (
        size(-3.0, 1.0),
        prop::sample::select(vec![10, 5, 2, 1]),
        prop::option::of((size(-2.0, 1.0), size(-1.0, 3.0))),
    );
    prop::collection::vec(aid, 0..3).prop_map(move |aids| {
        let one = |(i, (s, rate, drift)): (usize, &Aid)| {
            let drift = drift.map_or(String::new(), |(s, t)| {
                format!(r#", "gauss_markov": {{"std_dev": "{s} {unit}", "correlation_time": "{t} s"}}"#)
            });
            format!(r#"{{"name": "aid{i}", "std_dev": "{s} {unit}", "rate": "{rate} Hz"{drift}}}"#)
        };
        let list: Vec<String> = aids.iter().enumerate().map(one).collect();
        format!("[{}]", list.join(", "))
    })
}

/// A `design` section of each plant.
fn design() -> impl Strategy<Value = String> {
    let motion = prop_oneof![
        (size(-1.0, 2.0), size(-1.0, 2.0)).prop_map(|(s, t)| format!(
            r#"{{"gauss_markov": {{"std_dev": "{s} deg/s", "correlation_time": "{t} s"}}}}"#
        )),
        size(-2.0, 2.0).prop_map(|k| format!(r#"{{"integrated_random_walk": {{"density": "{k} deg/s^2/sqrt(s)"}}}}"#)),
    ];
    let matrix = |n: usize| prop::collection::vec(prop::collection::vec(-1.2..1.2_f64, n), 2);
    let custom = (matrix(2), matrix(1), prop::bool::ANY, prop::bool::ANY).prop_map(|(a, g, discrete, aided)| {
        let time = if discrete { "discrete" } else { "continuous" };
        let aids = if aided { r#"[{"name": "aid", "std_dev": "1 m", "rate": "2 Hz", "measures": "place"}]"# } else { "[]" };
        format!(
            r#"{{"plant": "custom", "aids": {aids}, "custom": {{"time": "{time}", "A": {a:?}, "G": {g:?}, "H": [[1, 0], [0, 1]],
            "states": [{{"name": "turn", "unit": "rad/s", "std_dev": "1 rad/s"}}, {{"name": "place", "unit": "m", "std_dev": "1 m"}}],
            "outputs": [{{"name": "turn", "unit": "rad/s"}}, {{"name": "place", "unit": "m"}}], "sensor": "turn"}}}}"#
        )
    });
    prop_oneof![
        Just(r#"{"plant": "static"}"#.to_string()),
        aids("deg").prop_map(|aids| format!(r#"{{"plant": "angle", "aids": {aids}}}"#)),
        (motion, aids("deg/s")).prop_map(|(m, aids)| format!(r#"{{"plant": "rate", "motion": {m}, "aids": {aids}}}"#)),
        (axis("m/s^2"), aids("deg"))
            .prop_map(|(axis, aids)| format!(r#"{{"plant": "vertical", "accelerometer": {axis}, "aids": {aids}}}"#)),
        custom,
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 150, rng_seed: RngSeed::Fixed(5), ..ProptestConfig::default() })]
    #[test]
    fn any_plant_with_any_noise_gives_a_valid_filter_or_a_clear_refusal(axis in axis("deg/s"), design in design()) {
        let text = format!(
            r#"{{"format": "kfdesign-params/1", "quantity": "angular-rate", "sample_rate": "10 Hz", "axes": [{axis}], "design": {design}}}"#
        );
        let params = Params::from_json(&text, "params.json").unwrap();
        prop_assert_eq!(&Params::from_json(&params.to_json(), "again").unwrap().design, &params.design);
        let tuned = match tune(&params, &TuneOptions::default()) {
            Ok(tuned) => tuned,
            Err(error) => {
                let line = error.to_string();
                prop_assert!(line.starts_with("axis 'x': ") && !line.contains('\n') && !line.contains("NaN"), "{line}");
                return Ok(());
            }
        };
        let axis = &tuned.design.axes[0];
        let model = &axis.model;
        prop_assert_eq!(model.check(), Ok(()));
        prop_assert!(PLANTS.contains(&tuned.design.plant.as_str()));
        let names: BTreeSet<&str> = model.states.iter().map(|state| state.name.as_str()).collect();
        prop_assert_eq!(names.len(), model.states.len());
        for named in model.states.iter().chain(&model.inputs).chain(&model.measurements) {
            prop_assert!(Unit::parse(&named.unit).is_ok_and(|unit| unit.scale() == 1.0), "{named:?}");
        }
        // an aid's error has the unit of what it measures, a state at an input the integral's
        for (measurement, row) in model.measurements.iter().zip(model.h.row_iter()) {
            for (state, h) in model.states.iter().zip(row.iter()) {
                let drift = state.name.ends_with("gauss_markov") || state.name.ends_with("bias");
                prop_assert!(!drift || *h == 0.0 || state.unit == measurement.unit, "{state:?} {measurement:?}");
            }
        }
        prop_assert!(axis.steady_state.gain.iter().chain(&axis.steady_state.predicted_covariance).all(|v| v.is_finite()));
        prop_assert!(tuned.reports[0].predicted.sigma.iter().flatten().all(|v| v.is_finite()));
        let read = FilterDesign::from_json(&tuned.design.to_json(), "filter.json").unwrap();
        prop_assert_eq!(&read.axes[0].model, model);
    }
}
