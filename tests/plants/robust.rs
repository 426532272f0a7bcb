//! Aids that are sometimes wrong, other forms of the filter, and a custom plant, in replay.

use std::f64::consts::PI;

use kfdesign::filter::{FilterDesign, Kalman};
use kfdesign::numerics::random::{StreamId, normal, stream};
use kfdesign::simulate::TrueRate;
use serde_json::Value;

use super::replay::{DEG, DT, csv, flight, state, time};
use super::{gyro, gyro_with};
use crate::support::{Bench, data};

/// A flight with an aid of 2 deg at 1 Hz, made wrong by `spoil`, as log.csv; the true angle of every row, and the last.
fn flown(bench: &Bench, spoil: impl Fn(usize, &mut dyn FnMut() -> f64) -> f64) -> Vec<f64> {
    let params = gyro(
        r#"{"plant": "angle", "initial_std_dev": "30 deg", "aids": [{"name": "heading", "std_dev": "2 deg", "rate": "1 Hz"}]}"#,
    );
    bench.file("params.json", params.to_json());
    bench.ok("tune params.json -o filter.json");
    let (measured, rate, _) = flight(&params, TrueRate::Sinusoid { amplitude: 10.0 * DEG, frequency_hz: 0.02 });
    let mut rng = stream(29, StreamId { run: 0, axis: 0, term: 0 });
    let mut angle = 20.0 * DEG;
    let (mut heading, mut truth) = (Vec::new(), Vec::new());
    for (k, rate) in rate.iter().enumerate() {
        let mut draw = || normal(&mut rng);
        let z = angle + 2.0 * DEG * draw() + spoil(k, &mut draw);
        heading.push(if k % 100 == 0 { z - 2.0 * PI * (z / (2.0 * PI)).round() } else { f64::NAN });
        truth.push(angle);
        angle += rate * DT;
    }
    bench.file("log.csv", csv("t_s,gyro_z (rad/s),yaw (rad)", &[&time(), &measured, &heading]));
    truth
}

const RUN: &str = "replay filter.json log.csv --aid heading=yaw --alpha 1e-5";

/// The angle in rad, row by row.
fn angles(bench: &Bench) -> Vec<f64> {
    let text = bench.read("out.csv");
    text.lines().skip(1).map(|line| line.split(',').nth(1).unwrap().parse().unwrap()).collect()
}

fn rms_after(found: &[f64], truth: &[f64], from: usize) -> f64 {
    let squares: f64 = found[from..].iter().zip(&truth[from..]).map(|(a, b)| (a - b).powi(2)).sum();
    (squares / (found.len() - from) as f64).sqrt()
}

/// One heading in twenty is 40 deg off. Five percent of outliers, clipped at three sigma, add little: the error
/// stays within twice the claimed sigma (0.46 deg; an average over nine minutes, fifteen settling times), and what
/// is judged is consistent (1e-5). The plain filter is more than twice as wrong and is found out.
#[test]
fn outliers_of_an_aid_are_clipped() {
    let bench = Bench::new();
    let truth = flown(&bench, |k, draw| {
        let far = draw() > 1.6449;
        if k % 100 == 0 && far { 40.0 * DEG * draw().signum() } else { 0.0 }
    });
    let run = |flags: &str, status: i32| -> Value {
        let run = bench.run(&format!("{RUN} {flags} -o out.csv --json"));
        assert_eq!(run.status, status, "{flags}: {}", run.stderr);
        serde_json::from_str(&run.stdout).unwrap()
    };
    run("", 1);
    let plain = rms_after(&angles(&bench), &truth, 6000);
    let robust = run("--clip 3", 0);
    let clipped = rms_after(&angles(&bench), &truth, 6000);
    let rejected = robust["axes"][0]["rejected"].as_u64().unwrap();
    // 30 of 600 expected; Poisson beyond 8 or 62: below 1e-5
    assert!((9..62).contains(&rejected), "{rejected}");
    assert_eq!(robust["verdict"], "consistent", "{}", robust["meaning"]);
    assert!(robust["tests"].as_array().unwrap().iter().all(|t| t["name"] != "rejected"));
    let sigma = state(&robust["axes"][0], "angle").1;
    assert!(clipped < 2.0 * sigma && plain > 2.0 * clipped, "{plain} {clipped} {sigma}");
    // a gate keeps them out too, and its count is judged
    let gated = run("--gate 3", 1);
    let refused = bench.run(&format!("{RUN} --clip 0.5"));
    assert!(refused.status == 2 && refused.stderr.contains("clip is 0.5, expected at least 1"), "{}", refused.stderr);
    assert!(gated["tests"].as_array().unwrap().iter().any(|t| t["name"] == "rejected" && t["pass"] == false));
}

/// After five minutes the compass is turned by 60 deg for good. A gate believes the old heading for ever; clipped
/// steps walk over to the new one.
#[test]
fn a_clipped_filter_finds_back_where_a_gate_is_locked_out() {
    let bench = Bench::new();
    let truth = flown(&bench, |k, _| if k >= 30_000 { 60.0 * DEG } else { 0.0 });
    let off = |flags: &str| {
        bench.run(&format!("{RUN} {flags} -o out.csv"));
        let last = angles(&bench).last().copied().unwrap() - truth.last().unwrap();
        (last / DEG - 60.0).abs()
    };
    assert!(off("--gate 3") > 50.0);
    // five sigma of 0.46 deg, and as much for what is left of the walk
    assert!(off("--clip 3") < 5.0);
}

/// The square root gives the numbers of the Joseph form: estimates and sigmas to 1e-8 of a sigma, over a gap and a
/// long gap too.
#[test]
fn the_square_root_replays_as_the_joseph_form() {
    let bench = Bench::new();
    flown(&bench, |_, _| 0.0);
    let log = bench.read("log.csv");
    let kept = |row: usize| !(20_000..20_700).contains(&row) && !(40_000..45_000).contains(&row);
    let gaps: String =
        log.lines().enumerate().filter(|(row, _)| kept(*row)).map(|(_, line)| format!("{line}\n")).collect();
    bench.file("log.csv", gaps);
    let run = |form: &str| -> (Value, Vec<f64>) {
        let printed = bench.run(&format!("{RUN} --form {form} -o out.csv --json")).stdout;
        (serde_json::from_str(&printed).unwrap(), angles(&bench))
    };
    let ((joseph, a), (root, b)) = (run("joseph"), run("square-root"));
    let value = |v: &Value| v["axes"][0]["log_likelihood"].as_f64().unwrap();
    assert!((value(&joseph) / value(&root) - 1.0).abs() < 1e-9);
    for name in ["angle", "bias", "gauss_markov"] {
        let (x, s) = state(&joseph["axes"][0], name);
        let (y, t) = state(&root["axes"][0], name);
        assert!((x - y).abs() < 1e-8 * s && (s / t - 1.0).abs() < 1e-8, "{name}: {x} {y} {s} {t}");
    }
    assert!(a.iter().zip(&b).all(|(a, b)| (a - b).abs() < 1e-8) && a.len() == 54_300);
}

/// Without a constant bias the gains settle: after twenty time constants the constant-gain filter is the Kalman
/// filter, with its sigma.
#[test]
fn constant_gains_are_those_the_filter_settles_at() {
    let bench = Bench::new();
    let mut params = gyro_with(
        r#""gauss_markov": {"std_dev": "0.3 deg/s", "correlation_time": "20 s"}"#,
        r#"{"plant": "angle", "initial_std_dev": "30 deg", "aids": [{"name": "heading", "std_dev": "2 deg", "rate": "1 Hz"}]}"#,
    );
    params.axes[0].turn_on_bias.as_mut().unwrap().value = 1e-9;
    params.axes[0].bias.as_mut().unwrap().value = 0.0;
    bench.file("params.json", params.to_json());
    bench.ok("tune params.json -o filter.json");
    let (measured, rate, _) = flight(&params, TrueRate::Sinusoid { amplitude: 10.0 * DEG, frequency_hz: 0.02 });
    let mut rng = stream(31, StreamId { run: 0, axis: 0, term: 0 });
    let mut angle = 0.0;
    let heading: Vec<f64> = rate
        .iter()
        .enumerate()
        .map(|(k, rate)| {
            let z = angle + 2.0 * DEG * normal(&mut rng);
            angle += rate * DT;
            if k % 100 == 0 { z } else { f64::NAN }
        })
        .collect();
    bench.file("log.csv", csv("t_s,gyro_z (rad/s),yaw (rad)", &[&time(), &measured, &heading]));
    let run = |form: &str| -> (Value, Vec<f64>) {
        let printed = bench.run(&format!("{RUN} --form {form} -o out.csv --json")).stdout;
        (serde_json::from_str(&printed).unwrap(), angles(&bench))
    };
    let ((joseph, a), (constant, b)) = (run("joseph"), run("constant-gain"));
    let sigma = state(&constant["axes"][0], "angle").1;
    // claimed: P(k|k) of the steady state
    let design = FilterDesign::from_json(&bench.read("filter.json"), "filter.json").unwrap();
    let (steady, h) = (&design.axes[0].steady_state, &design.axes[0].model.h);
    let p = &steady.predicted_covariance;
    let updated = p[(0, 0)] - (steady.gain.row(0) * h * p.column(0))[0];
    assert!((sigma / updated.sqrt() - 1.0).abs() < 1e-9 && sigma < state(&joseph["axes"][0], "angle").1);
    let apart = |k: usize| (a[k] - b[k]).abs() / sigma;
    assert!(apart(100) > 0.1, "at first the gains differ: {}", apart(100));
    assert!((30_000..60_000).all(|k| apart(k) < 1e-4), "{}", apart(59_999));
    let value = |v: &Value| v["axes"][0]["log_likelihood"].as_f64().unwrap();
    assert_ne!(value(&joseph), value(&constant));
}

/// The pendulum of data/design with its torque and its encoder: the same as a filter written out here, and
/// consistent (1e-5).
#[test]
fn a_custom_plant_is_replayed_with_its_known_input() {
    let bench = Bench::new();
    bench.file("params.json", gyro(r#"{"plant": "static"}"#).to_json());
    bench.ok(&format!("tune params.json --plant {} -o filter.json", data("design/pendulum.json").display()));
    let design = FilterDesign::from_json(&bench.read("filter.json"), "filter.json").unwrap();
    let model = &design.axes[0].model;
    let n = model.x0.len();
    let mut rng = stream(37, StreamId { run: 0, axis: 0, term: 0 });
    let root = |a: &nalgebra::DMatrix<f64>| kfdesign::numerics::linalg::cholesky_semidefinite(a).unwrap();
    let (root_q, root_p) = (root(&model.q), root(&model.p0));
    let mut draw = |size: usize| nalgebra::DVector::from_fn(size, |_, _| normal(&mut rng));
    let mut x = &model.x0 + root_p * draw(n);
    let mut kalman = Kalman::new(model);
    let mut columns = vec![Vec::new(); 3];
    let mut log_likelihood = 0.0;
    for k in 0..60_000usize {
        let torque = if (k / 500) % 2 == 0 { 0.05 } else { -0.05 };
        let z = &model.h * &x + nalgebra::DVector::from_fn(2, |i, _| model.r[(i, i)].sqrt()).component_mul(&draw(2));
        let taken = k % model.every[1] == 0;
        columns[0].push(z[0]);
        columns[1].push(if taken { z[1] } else { f64::NAN });
        columns[2].push(torque);
        log_likelihood += kalman.update(0, z[0], None).log_likelihood();
        if taken {
            log_likelihood += kalman.update(1, z[1], None).log_likelihood();
        }
        x = &model.f * x + &model.g * torque + &root_q * draw(n);
        kalman.predict();
        kalman.drive(&[torque]);
    }
    bench
        .file("log.csv", csv("t_s,gyro_z (rad/s),enc (rad),torque", &[&time(), &columns[0], &columns[1], &columns[2]]));
    let run = "replay filter.json log.csv --columns gyro_z --aid encoder=enc --alpha 1e-5 --json";
    let result = bench.run(&format!("{run} --aid torque=torque:1"));
    let printed: Value = serde_json::from_str(&result.stdout).unwrap_or_else(|_| panic!("{}", result.stderr));
    assert_eq!(printed["verdict"], "consistent", "{}", printed["meaning"]);
    let axes = printed["axes"].as_array().unwrap();
    let found: f64 = axes.iter().map(|a| a["log_likelihood"].as_f64().unwrap()).sum();
    assert!((found / log_likelihood - 1.0).abs() < 1e-9, "{found} {log_likelihood}");
    let message = bench.run(run).stderr;
    assert!(message.contains("the filter needs torque beside the sensor"), "{message}");
}
