//! What the parameters of a design are chosen by.

mod als;
mod command;
mod likelihood;
mod nees;
mod robust;

use kfdesign::params::{Measured, Params};
use kfdesign::tune::objective::{Log, Moved, Objective, Record, Request, tune_by};
use kfdesign::tune::{TuneOptions, Tuned};

/// The parameters of a request that every objective has.
fn request(objective: Objective) -> Request<'static> {
    Request { objective, hold: &[], truth: None, logs: &[], held_out: 0.0, priors: true, seed: 1 }
}

fn chosen(params: &Params, request: &Request<'_>) -> (Tuned, Record) {
    let (tuned, record) = tune_by(params, &TuneOptions::default(), request).unwrap();
    (tuned, record.unwrap())
}

fn refused(params: &Params, request: &Request<'_>) -> String {
    tune_by(params, &TuneOptions::default(), request).unwrap_err().to_string()
}

fn moved<'a>(record: &'a Record, path: &str) -> &'a Moved {
    record.parameters.iter().find(|moved| moved.parameter == path).unwrap()
}

/// Intervals of the coefficients of the first axis.
fn with_intervals(mut params: Params, intervals: &[(&str, [f64; 2])]) -> Params {
    for (path, interval) in intervals {
        let found = params.axes[0].noise_parameters().find(|(name, _)| name == path);
        let value: &mut Measured = found.unwrap().1;
        value.interval = Some(*interval);
    }
    params
}

/// NIST SP 1065: n ← 16807 n mod 2³¹ − 1, less a half.
fn uniform() -> impl Iterator<Item = f64> {
    std::iter::successors(Some(16807_u64), |n| Some(16807 * n % 2_147_483_647))
        .map(|n| n as f64 / 2_147_483_647.0 - 0.5)
}

fn log(axes: Vec<kfdesign::filter::SensorLog>) -> Vec<Log> {
    vec![Log { name: "log".into(), axes }]
}
