//! Plants joined with the errors of their sensors.

mod flights;
mod insight;
mod matrices;
mod property;
mod refused;
mod replay;
mod robust;
mod simulated;

use kfdesign::params::Params;

/// A gyro at 100 Hz, the reference sensor on one axis, with this `design` section.
fn gyro(design: &str) -> Params {
    gyro_with(r#""gauss_markov": {"std_dev": "0.0280596 deg/s", "correlation_time": "193.9312 s"}"#, design)
}

/// The same with other drift terms.
fn gyro_with(terms: &str, design: &str) -> Params {
    let text = format!(
        r#"{{"format": "kfdesign-params/1", "quantity": "angular-rate", "sample_rate": "100 Hz", "design": {design},
           "axes": [{{"name": "z", "bias": "-0.597 deg/s", "turn_on_bias": {{"std_dev": "0.6 deg/s"}},
           "white": {{"density": "0.0562 deg/s/sqrt(Hz)"}}, {terms}}}]}}"#
    );
    Params::from_json(&text, "params.json").unwrap()
}
