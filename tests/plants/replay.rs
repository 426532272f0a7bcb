//! Logs that move, through filters of plants. Verdicts at a false-alarm probability of 1e-5 each.

use std::f64::consts::PI;
use std::fmt::Write;

use kfdesign::filter::{FilterDesign, Kalman};
use kfdesign::numerics::random::{StreamId, normal, stream};
use kfdesign::params::Params;
use kfdesign::simulate::{Scenario, Simulator, TrueRate};
use serde_json::Value;

use super::gyro;
use crate::support::Bench;

pub(super) const DEG: f64 = PI / 180.0;
pub(super) const DT: f64 = 0.01;

/// Ten minutes of the sensor with this true rate: measured and true rate, rad/s, and the true bias.
pub(super) fn flight(params: &Params, true_rate: TrueRate) -> (Vec<f64>, Vec<f64>, f64) {
    let (seed, samples) = (12, 60_000);
    let scenario = Scenario {
        seed,
        run: 0,
        samples,
        rate_hz: 100.0,
        true_rate,
        turn_on: true,
        saturation: None,
        quantisation: None,
    };
    let mut blocks = Vec::new();
    let mut simulator = Simulator::new(params, &scenario).unwrap();
    assert_eq!(simulator.next_block(samples as usize, &mut blocks), samples as usize);
    (blocks[0].measured.clone(), blocks[0].true_rate.clone(), blocks[0].bias)
}

/// A log of columns with this header; NaN is an empty field.
pub(super) fn csv(header: &str, columns: &[&[f64]]) -> String {
    let mut text = format!("{header}\n");
    for k in 0..columns[0].len() {
        let field = |c: &&[f64]| if c[k].is_nan() { String::new() } else { format!("{:?}", c[k]) };
        let row: Vec<String> = columns.iter().map(field).collect();
        writeln!(text, "{}", row.join(",")).unwrap();
    }
    text
}

pub(super) fn time() -> Vec<f64> {
    (0..60_000).map(|k| f64::from(k) * DT).collect()
}

/// A Gauss-Markov process at every sample.
fn wandering(sigma: f64, tc: f64, number: u32) -> Vec<f64> {
    let mut rng = stream(17, StreamId { run: 0, axis: number, term: 0 });
    let decay = (-DT / tc).exp();
    let mut x = sigma * normal(&mut rng);
    (0..60_000)
        .map(|_| {
            let now = x;
            x = decay * x + sigma * (1.0 - decay * decay).sqrt() * normal(&mut rng);
            now
        })
        .collect()
}

pub(super) fn state(axis: &Value, name: &str) -> (f64, f64) {
    let states = axis["final_state"].as_array().unwrap();
    let state = states.iter().find(|s| s["name"] == name).unwrap_or_else(|| panic!("{name} among {states:?}"));
    (state["value"].as_f64().unwrap(), state["sigma"].as_f64().unwrap())
}

#[test]
fn an_angle_that_turns_over_is_followed_as_claimed() {
    let params = gyro(
        r#"{"plant": "angle", "initial_std_dev": "100 deg", "aids": [{"name": "heading", "std_dev": "2 deg", "rate": "1 Hz"}]}"#,
    );
    let bench = Bench::new();
    bench.file("params.json", params.to_json());
    bench.ok("tune params.json -o filter.json");
    // swings through 636 deg: many times over ±180 deg
    let (measured, rate, bias) = flight(&params, TrueRate::Sinusoid { amplitude: 40.0 * DEG, frequency_hz: 0.02 });
    let mut rng = stream(18, StreamId { run: 0, axis: 0, term: 0 });
    let mut angle = 60.0 * DEG;
    let (mut heading, mut truth) = (Vec::new(), 0.0);
    for (k, rate) in rate.iter().enumerate() {
        let z = angle + 2.0 * DEG * normal(&mut rng);
        let wrapped = z - 2.0 * PI * (z / (2.0 * PI)).round();
        heading.push(if k % 100 == 0 { wrapped } else { f64::NAN });
        truth = angle;
        angle += rate * DT;
    }
    let wraps = heading.iter().filter(|z| z.is_finite()).collect::<Vec<_>>();
    assert!(wraps.windows(2).any(|pair| (pair[0] - pair[1]).abs() > PI), "the heading passes ±180 deg");
    let log = csv("t_s,gyro_z (rad/s),yaw (rad)", &[&time(), &measured, &heading]);
    bench.file("log.csv", log);
    let run = "replay filter.json log.csv --aid heading=yaw --alpha 1e-5";
    let printed: Value = serde_json::from_str(&bench.ok(&format!("{run} --json"))).unwrap();
    assert_eq!(printed["verdict"], "consistent", "{}", printed["meaning"]);
    let axis = &printed["axes"][0];
    assert_eq!(
        (axis["accepted"].as_u64(), axis["samples"].as_u64(), axis["unusable"].as_u64()),
        (Some(600), Some(60_000), Some(0))
    );
    for (name, truth) in [("angle", truth), ("bias", bias)] {
        let (value, sigma) = state(axis, name);
        // a normal value is beyond five sigma once in 2 million
        assert!((value - truth).abs() < 5.0 * sigma, "{name}: {value} {truth} {sigma}");
    }
    // the same as a filter written out here
    let design = FilterDesign::from_json(&bench.read("filter.json"), "filter.json").unwrap();
    let mut kalman = Kalman::new(&design.axes[0].model);
    let mut log_likelihood = 0.0;
    for k in 0..measured.len() {
        if k > 0 {
            kalman.predict();
            kalman.x[0] += DT * measured[k - 1];
        }
        if heading[k].is_finite() {
            let away = heading[k] - kalman.x[0];
            let z = heading[k] - 2.0 * PI * (away / (2.0 * PI)).round();
            log_likelihood += kalman.update(0, z, None).log_likelihood();
        }
    }
    let found = axis["log_likelihood"].as_f64().unwrap();
    assert!((found / log_likelihood - 1.0).abs() < 1e-9, "{found} {log_likelihood}");
    for (i, name) in ["angle", "bias", "gauss_markov"].into_iter().enumerate() {
        let (value, sigma) = state(axis, name);
        assert!(
            (value - kalman.x[i]).abs() < 1e-9 * kalman.x.amax()
                && (sigma / kalman.p[(i, i)].sqrt() - 1.0).abs() < 1e-9
        );
    }
    // what is printed and written
    let text = bench.ok(&format!("{run} -o out.csv --innovations --report out.html"));
    assert!(text.contains("angle") && text.contains("consistent"), "{text}");
    let out = bench.read("out.csv");
    let header = out.lines().next().unwrap();
    assert!(header.contains("z_angle (rad)") && header.contains("z_innovation (rad)"), "{header}");
    assert!(bench.read("out.html").contains("heading"));

    // a gap holds the last rate; here the vehicle turns on, so that the gap costs nothing but noise
    let held = |from: usize, to: usize, column: &[f64]| {
        let kept: Vec<f64> =
            column.iter().enumerate().filter(|(k, _)| !(from..to).contains(k)).map(|(_, v)| *v).collect();
        kept
    };
    let columns = [time(), measured.clone(), heading.clone()].map(|c| held(30_010, 30_015, &c));
    bench.file("log.csv", csv("t_s,gyro_z (rad/s),yaw (rad)", &[&columns[0], &columns[1], &columns[2]]));
    let printed: Value = serde_json::from_str(&bench.ok(&format!("{run} --json"))).unwrap();
    let axis = &printed["axes"][0];
    assert_eq!(
        (axis["gaps"].as_u64(), axis["missing"].as_u64(), axis["accepted"].as_u64()),
        (Some(1), Some(5), Some(600))
    );
    assert_eq!(printed["verdict"], "consistent", "{}", printed["meaning"]);

    // a filter that believes its heading too much is caught
    let proud = gyro(
        r#"{"plant": "angle", "initial_std_dev": "100 deg", "aids": [{"name": "heading", "std_dev": "1.5 deg", "rate": "1 Hz"}]}"#,
    );
    bench.file("proud.json", proud.to_json());
    bench.ok("tune proud.json -o proud_filter.json");
    let out = bench.run("replay proud_filter.json log.csv --aid heading=yaw --alpha 1e-5");
    assert!(out.status == 1 && out.stdout.contains("inconsistent"), "{out:?}");

    // and a column that repeats older values is told
    let mut repeated = heading.clone();
    for k in 1..repeated.len() {
        if repeated[k].is_nan() {
            repeated[k] = repeated[k - 1];
        }
    }
    bench.file("log.csv", csv("t_s,gyro_z (rad/s),yaw (rad)", &[&time(), &measured, &repeated]));
    let out = bench.run("replay filter.json log.csv --aid heading=yaw");
    assert!(!out.stderr.contains("not at rest"), "a log that moves is what the filter is for: {}", out.stderr);
    assert!(
        out.stderr.contains("warning: heading has 60000 measurements in 60000 rows") && out.status == 1,
        "{}",
        out.stderr
    );
}

#[test]
fn a_tilt_from_gyro_and_accelerometer_is_followed_as_claimed() {
    let params = gyro(
        r#"{"plant": "vertical", "initial_std_dev": "10 deg", "accelerometer": {"name": "x",
            "white": {"density": "0.003 m/s^2/sqrt(Hz)"}, "turn_on_bias": {"std_dev": "0.001 m/s^2"},
            "gauss_markov": {"std_dev": "0.3 m/s^2", "correlation_time": "2 s"}}}"#,
    );
    let bench = Bench::new();
    bench.file("params.json", params.to_json());
    bench.ok("tune params.json -o filter.json");
    let (measured, rate, _) = flight(&params, TrueRate::Sinusoid { amplitude: 5.0 * DEG, frequency_hz: 0.1 });
    let error = wandering(0.3, 2.0, 1);
    let mut rng = stream(19, StreamId { run: 0, axis: 0, term: 0 });
    let (mut tilt, mut truth, mut force) = (-3.0 * DEG, 0.0, Vec::new());
    for (rate, error) in rate.iter().zip(&error) {
        force.push(9.80665 * tilt + error + 0.003 / DT.sqrt() * normal(&mut rng));
        truth = tilt;
        tilt += rate * DT;
    }
    bench.file("log.csv", csv("t_s,gyro_z (rad/s),f_lateral", &[&time(), &measured, &force]));
    let run = "replay filter.json log.csv --alpha 1e-5 --json --columns gyro_z --aid accelerometer=f_lateral:m/s^2";
    let printed: Value = serde_json::from_str(&bench.ok(run)).unwrap();
    assert_eq!(printed["verdict"], "consistent", "{}", printed["meaning"]);
    let (value, sigma) = state(&printed["axes"][0], "tilt");
    assert!((value - truth).abs() < 5.0 * sigma && sigma < 1.5 * DEG, "{value} {truth} {sigma}");
}

#[test]
fn a_rate_with_wheels_beside_the_gyro_has_two_series_of_innovations() {
    let params = gyro(
        r#"{"plant": "rate", "motion": {"gauss_markov": {"std_dev": "20 deg/s", "correlation_time": "0.5 s"}},
            "aids": [{"name": "wheels", "std_dev": "1 deg/s", "rate": "10 Hz"}]}"#,
    );
    let bench = Bench::new();
    bench.file("params.json", params.to_json());
    bench.ok("tune params.json -o filter.json");
    let motion = wandering(20.0 * DEG, 0.5, 2);
    let (measured, _, _) = flight(&params, TrueRate::Samples(vec![motion.clone()]));
    let mut rng = stream(20, StreamId { run: 0, axis: 0, term: 0 });
    let wheels: Vec<f64> = motion
        .iter()
        .enumerate()
        .map(|(k, rate)| if k % 10 == 0 { rate / DEG + normal(&mut rng) } else { f64::NAN })
        .collect();
    bench.file("log.csv", csv("t_s,gyro_z (rad/s),wheel_rate (deg/s)", &[&time(), &measured, &wheels]));
    let run = "replay filter.json log.csv --alpha 1e-5 --json --columns gyro_z --aid wheels=wheel_rate";
    let printed: Value = serde_json::from_str(&bench.ok(run)).unwrap();
    assert_eq!(printed["verdict"], "consistent", "{}", printed["meaning"]);
    let named: Vec<(&str, u64)> = printed["axes"]
        .as_array()
        .unwrap()
        .iter()
        .map(|axis| (axis["name"].as_str().unwrap(), axis["accepted"].as_u64().unwrap()))
        .collect();
    assert_eq!(named, [("z.angular_rate", 60_000), ("z.wheels", 6_000)]);
    let (value, sigma) = state(&printed["axes"][0], "rate");
    assert!((value - motion[59_999]).abs() < 5.0 * sigma, "{value} {} {sigma}", motion[59_999]);
}

#[test]
fn a_log_without_what_the_filter_measures_is_refused() {
    let params = gyro(r#"{"plant": "angle", "aids": [{"name": "heading", "std_dev": "2 deg", "rate": "1 Hz"}]}"#);
    let bench = Bench::new();
    bench.file("params.json", params.to_json());
    bench.ok("tune params.json -o filter.json");
    let wave: Vec<f64> = (0..200).map(|k| f64::from(k * 7 % 13)).collect();
    bench.file("log.csv", csv("t_s,gyro_z (deg/s),yaw,mag (uT)", &[&time()[..200], &wave, &wave, &wave]));
    let refused = |flags: &str, words: &[&str]| {
        let out = bench.run(&format!("replay filter.json log.csv {flags}"));
        let last = out.stderr.lines().last().unwrap_or_default();
        assert!(
            out.status == 2 && last.starts_with("kfdesign: ") && words.iter().all(|w| last.contains(w)),
            "{flags}: {out:?}"
        );
    };
    refused("", &["the filter needs heading beside the sensor", "--aid heading=COLUMN"]);
    refused("--aid yaw", &["--aid yaw: expected NAME=COLUMN"]);
    refused("--aid star=yaw", &["no measurement or input 'star'", "it has heading"]);
    refused("--aid heading=yaw", &["no unit is known for column 'yaw'", "--aid heading=yaw:deg"]);
    refused("--aid heading=yaw:deg/s", &["an angular rate, expected an angle"]);
    refused("--aid heading=yaw,mag", &["2 columns for 1 axes"]);
    refused("--aid heading=gyro_z", &["'gyro_z (deg/s)' is asked for twice"]);
    refused("--aid heading=nose:deg", &["no column 'nose'"]);
    refused("--aid heading=yaw:deg --aid heading=yaw:deg", &["'heading' is given twice"]);
    let out = bench.run("tune params.json --log log.csv -o other.json");
    assert!(out.status == 2 && out.stderr.contains("--aid heading=COLUMN"), "{out:?}");
    assert!(!bench.path("other.json").exists());
    // a custom plant with an input of its own, and one whose design was taken out by hand
    let design = std::fs::read_to_string(crate::support::data("design/pendulum.json")).unwrap();
    bench.file("pendulum.json", design);
    bench.ok("tune params.json --plant pendulum.json -o filter.json");
    refused("--aid encoder=yaw:deg", &["the filter needs torque", "--aid torque=COLUMN"]);
    let mut document: Value = serde_json::from_str(&bench.read("filter.json")).unwrap();
    document.as_object_mut().unwrap().remove("design");
    bench.file("filter.json", document.to_string());
    refused("--aid encoder=yaw:deg", &["custom plant", "'design' section"]);
}
