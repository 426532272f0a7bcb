//! What no filter can do is said in the words of the states.

use kfdesign::tune::{TuneOptions, tune};

use super::{gyro, gyro_with};

fn refusal(terms: &str, design: &str) -> String {
    tune(&gyro_with(terms, design), &TuneOptions::default()).unwrap_err().to_string()
}

const WALK: &str = r#""rate_random_walk": {"density": "0.001 deg/s/sqrt(s)"}"#;

#[test]
fn directions_that_nothing_tells_apart_are_named() {
    // a rate that wanders as the bias does
    let rate = r#"{"plant": "rate", "motion": {"integrated_random_walk": {"density": "5 deg/s^2/sqrt(s)"}}}"#;
    let line = refusal(WALK, rate);
    assert!(line.contains("rate and bias cannot be told apart: a change of +1.000 in rate, −1.0000 in bias"), "{line}");
    assert!(line.contains("add a measurement (an aid)"), "{line}");
    // with a constant bias it is carried out, with a word: the split rests on P0
    let tuned = tune(&gyro(rate), &TuneOptions::default()).unwrap();
    let said = tuned.reports[0].observability.join(" ");
    assert!(said.contains("rate and bias cannot be told apart") && said.contains("the split rests on P0"), "{said}");
    let p = &tuned.design.axes[0].steady_state.predicted_covariance;
    let turn_on = 0.6 * std::f64::consts::PI / 180.0;
    // the prior of the rate, 100 deg/s, says nothing against 0.6 deg/s of the bias
    assert!((p[(2, 2)].sqrt() / turn_on - 1.0).abs() < 1e-4, "{}", p[(2, 2)].sqrt());
    // a constant bias of the accelerometer is a tilt
    let vertical = r#"{"plant": "vertical", "accelerometer": {"name": "x", "turn_on_bias": {"std_dev": "0.05 m/s^2"},
        "white": {"density": "0.003 m/s^2/sqrt(Hz)"}, "gauss_markov": {"std_dev": "0.5 m/s^2", "correlation_time": "2 s"}}}"#;
    let tuned = tune(&gyro(vertical), &TuneOptions::default()).unwrap();
    let said = tuned.reports[0].observability.join(" ");
    assert!(said.contains("tilt and accelerometer.bias cannot be told apart"), "{said}");
    let p = &tuned.design.axes[0].steady_state.predicted_covariance;
    assert!(p[(0, 0)].sqrt() > 0.05 / 9.80665, "the tilt is no better than the accelerometer's bias allows");
    // one that wanders is refused
    let wandering = vertical.replace(
        r#""gauss_markov": {"std_dev": "0.5 m/s^2", "correlation_time": "2 s"}"#,
        r#""rate_random_walk": {"density": "0.001 m/s^2/sqrt(s)"}"#,
    );
    let line = tune(&gyro(&wandering), &TuneOptions::default()).unwrap_err().to_string();
    assert!(line.contains("tilt and accelerometer.bias cannot be told apart"), "{line}");
}

#[test]
fn an_aid_slower_than_the_drift_is_a_warning() {
    let terms = r#""gauss_markov": {"std_dev": "0.03 deg/s", "correlation_time": "20 s"}"#;
    let slow = r#"{"plant": "angle", "aids": [{"name": "star", "std_dev": "0.1 deg", "rate": "0.02 Hz"}]}"#;
    let warnings = |terms: &str, design: &str| {
        tune(&gyro_with(terms, design), &TuneOptions::default()).unwrap().reports[0].warnings.join(" ")
    };
    let said = warnings(terms, slow);
    assert!(said.contains("a measurement every 50.00 s, a correlation time of 20.00 s"), "{said}");
    let fast = slow.replace("0.02 Hz", "1 Hz");
    assert!(!warnings(terms, &fast).contains("slower than the drift"));
}

#[test]
fn rates_of_aids_are_whole_fractions_of_the_sample_rate() {
    let aid = |rate: &str| {
        format!(r#"{{"plant": "angle", "aids": [{{"name": "h", "std_dev": "1 deg", "rate": "{rate}"}}]}}"#)
    };
    let every = |rate: &str| {
        let tuned = tune(&gyro(&aid(rate)), &TuneOptions::default()).map_err(|e| e.to_string())?;
        Ok::<_, String>((tuned.design.axes[0].model.every[0], tuned.reports[0].warnings.join(" ")))
    };
    assert_eq!(every("20 Hz").unwrap().0, 5);
    let (samples, said) = every("33 Hz").unwrap();
    assert!(samples == 3 && said.contains("h is taken every 3 samples, at 33.33 Hz"), "{said}");
    let line = every("40 Hz").unwrap_err();
    assert!(line.contains("no whole fraction") && line.contains("50.00 Hz") && line.contains("33.33 Hz"), "{line}");
    assert!(every("200 Hz").unwrap_err().contains("above the sample rate"));
    // rates that never meet again
    let odd = r#"{"plant": "angle", "aids": [{"name": "a", "std_dev": "1 deg", "rate": "0.10002 Hz"},
        {"name": "b", "std_dev": "1 deg", "rate": "0.1001 Hz"}, {"name": "c", "std_dev": "1 deg", "rate": "0.1003 Hz"}]}"#;
    let line = tune(&gyro(odd), &TuneOptions::default()).unwrap_err().to_string();
    assert!(line.contains("fall together only after more than a million samples"), "{line}");
}
