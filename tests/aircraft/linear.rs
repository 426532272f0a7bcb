//! The nonlinear flight in its linear limit: responses by e^(At), covariances by Lyapunov's equation, both of a second
//! implementation.

use kfdesign::aircraft::airframe::Airplane;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use serde_json::json;

use super::flights::{Table, aerosonde, level, one, runs, times, trim};

/// The sheet's deviations after a step of one degree in the elevator, u w q θ by e^(At), and in the aileron, v p r φ;
/// here the mean of a hundredth of it up and down. The height, which the linear model leaves out, is felt by 1e-3 after
/// a second.
#[test]
fn small_steps_from_trim_follow_the_linear_model() {
    let c = trim().controls;
    let table = [
        (
            "elevator",
            c.elevator,
            ["u", "w", "q", "theta"],
            [
                (0.1, [0.003124628, -0.053370517, -0.040458369, -0.002371799]),
                (0.5, [0.029041255, -0.133543609, -0.015471864, -0.014343219]),
                (1.0, [0.096202308, -0.129688324, -0.019209078, -0.024049402]),
            ],
        ),
        (
            "aileron",
            c.aileron,
            ["v", "p", "r", "phi"],
            [
                (0.1, [0.017603632, 0.085256569, -0.007787667, 0.005832845]),
                (0.5, [0.267625782, 0.053293760, -0.003690457, 0.033618996]),
                (1.0, [0.207357641, 0.077233318, 0.029680749, 0.066112085]),
            ],
        ),
        (
            "rudder",
            c.rudder,
            ["v", "p", "r", "phi"],
            [
                (0.1, [0.051559970, -0.016036240, -0.036080324, -0.000731749]),
                (0.5, [0.412711156, -0.085338539, -0.029371292, -0.026254694]),
                (1.0, [0.202457967, -0.045121385, -0.020078916, -0.058302711]),
            ],
        ),
    ];
    for (surface, at, names, rows) in table {
        let fly = |part: f64| {
            let mut document = level();
            document["controls"] = json!({ surface: format!("{:e} rad", at + part.to_radians()) });
            one(&document, times(1.0, Some(0.1), None))
        };
        let (up, down) = (fly(0.01), fly(-0.01));
        for (time, expected) in rows {
            for ((up, down), (e, name)) in
                up.at(time, &names).iter().zip(down.at(time, &names)).zip(expected.iter().zip(names))
            {
                let found = 50.0 * (up - down);
                assert!((found - e).abs() < 1e-3 * e.abs() + 2e-6, "{surface} {time} {name}: {found} against {e}");
            }
        }
    }
}

/// The sheet's response to an up-gust of 1 − cos form, 3 m/s over 25 m, of which a thousandth is flown. w is that of
/// the airplane, not of the air.
#[test]
fn a_small_discrete_gust_follows_the_linear_model() {
    let mut document = level();
    document["gusts"] = json!({ "model": "1-cos", "form": "return", "length": "12.5 m", "w": "-3 mm/s" });
    let gust = one(&document, times(1.0, Some(0.25), None));
    let calm = one(&level(), times(1.0, Some(0.25), None));
    let names = ["u", "w", "q", "theta"];
    for (time, expected) in [
        (0.25, [0.075020817, -0.807741176, -0.225420932, -0.018279971]),
        (0.5, [0.349533613, -3.125071042, -0.234112959, -0.093833608]),
        (1.0, [0.380678000, 0.194063164, 0.242922861, 0.003640001]),
    ] {
        for ((g, c), e) in gust.at(time, &names).iter().zip(calm.at(time, &names)).zip(expected) {
            let found = 1e3 * (g - c);
            assert!((found - e).abs() < 2e-3 * e.abs() + 2e-4, "{time}: {found} against {e}");
        }
    }
    // half of the largest velocity where the airplane has flown half of the rise
    assert!((gust.at(0.25, &["gust_w"])[0] + 1.5e-3).abs() < 1e-6);
}

/// A hundredth of light turbulence on the airframe without servos; roll and yaw held by the sheet's gains. Mean squares
/// of 48 flights against the sheet's covariances by Lyapunov's equation, 8 states within 4.5 standard errors: a false
/// alarm in 1 of 18,000 such tests. A wrong sign of the pitch gust, a π too many in the roll gust, lengths of the other
/// document or a gust held for 0.1 s move at least one of them further.
#[test]
fn the_covariance_in_gusts_is_that_of_lyapunovs_equation() {
    const RUNS: u64 = 48;
    let mut document = level();
    document["airplane"] = aerosonde();
    document["airplane"].as_object_mut().unwrap().remove("actuators");
    document["gusts"] = json!({ "model": "dryden", "specification": "MIL-F-8785C", "wind_at_20ft": "0.15 kt" });
    document["autopilot"] = json!({
        "rate": "400 Hz", "delay": 0,
        "gains": { "kq": "0 s", "ktheta": 0, "kp": "0.06 s", "kphi": 0.6, "kr": "0.15 s", "washout": "1e9 s" }
    });
    let tables = runs(&document, times(110.0, Some(0.05), None), 2, RUNS).unwrap();
    let t = trim();
    let expected = [
        ("u", t.velocity[0], 1.253934456),
        ("w", t.velocity[2], 0.762500465),
        ("q", 0.0, 0.043561483),
        ("theta", t.theta, 0.037518875),
        ("v", 0.0, 1.057143233),
        ("p", 0.0, 0.048762152),
        ("r", 0.0, 0.027200083),
        ("phi", t.phi, 0.014489394),
    ];
    for (name, mean, sigma) in expected {
        let sigma = 0.01 * sigma;
        // 30 s forget the start in trim: the phugoid has fallen to 1.6 %, its square to 0.03 %
        let squares: Vec<f64> = tables
            .par_iter()
            .map(|table| {
                let values = &table.get(name)[600..];
                values.iter().map(|x| ((x - mean) / sigma).powi(2)).sum::<f64>() / values.len() as f64
            })
            .collect();
        let n = squares.len() as f64;
        let ratio = squares.iter().sum::<f64>() / n;
        let spread = squares.iter().map(|s| (s - ratio).powi(2)).sum::<f64>() / (n - 1.0);
        let z = (ratio - 1.0) / (spread / n).sqrt();
        assert!(z.abs() < 4.5, "{name}: ratio {ratio}, z {z}");
    }
    moves_at_every_step(&document);
}

/// The gust is another one at each step of the integration: mean square of its increments over 2.5 ms against the exact
/// law, within 5 standard errors of 4000 increments that are almost independent.
fn moves_at_every_step(document: &serde_json::Value) {
    use kfdesign::aircraft::atmosphere::dryden::{Dryden, Intensity, Specification};
    let table: Table = one(document, times(10.0, None, None));
    let intensity = Intensity { wind_at_20ft: Some(0.15 * 1852.0 / 3600.0), std_dev_aloft: None };
    let model = Dryden::new(Specification::MilF8785C, 100.0, intensity, 25.0, 2.8956).unwrap().model();
    let (states, f) = (model.state_covariance().unwrap(), model.over(1.0 / 400.0).unwrap().f);
    for (i, name) in ["gust_u", "gust_v", "gust_w", "gust_p"].into_iter().enumerate() {
        let values = table.get(name);
        assert_eq!(values.len(), 4001);
        let found = values.windows(2).map(|w| (w[1] - w[0]).powi(2)).sum::<f64>() / 4000.0;
        let c = model.c.row(i);
        let expected = 2.0 * ((c * states * c.transpose())[0] - (c * f * states * c.transpose())[0]);
        let z = (found / expected - 1.0) / (2.0_f64 / 4000.0).sqrt();
        assert!(z.abs() < 5.0, "{name}: {found} against {expected}, z {z}");
    }
}

/// The sheet's optimal gains in flight: a small way from trim and without servos, the airplane moves by xₖ₊₁ = (F −
/// G K) xₖ, F and G of all eight states over a sample.
#[test]
fn the_regulator_brings_the_airplane_back_as_its_gains_say() {
    const RATE: f64 = 400.0;
    const NAMES: [&str; 8] = ["u", "w", "q", "theta", "v", "p", "r", "phi"];
    let t = trim();
    let mut document = level();
    document["airplane"] = aerosonde();
    document["airplane"].as_object_mut().unwrap().remove("actuators");
    document["autopilot"] = json!({ "rate": "400 Hz", "delay": 0, "lqr": {
        "longitudinal": { "states": [0.01, 0.01, 1, 4], "elevator": 1 },
        "lateral": { "states": [0.01, 0.2, 1, 2], "aileron": 1, "rudder": 1 }
    } });
    #[rustfmt::skip]
    let gain = DMatrix::from_row_slice(3, 8, &[
        0.033029462, 0.062575619, -0.883946725, -2.274199624, 0.0, 0.0, 0.0, 0.0,
        0.0, 0.0, 0.0, 0.0, -0.001849133, 0.333197165, -0.028268589, 1.435724064,
        0.0, 0.0, 0.0, 0.0, 0.049252389, 0.037387976, -0.971484252, -0.092097875,
    ]);
    let away = [2e-3, -1e-3, 1e-4, 2e-4, 3e-3, 2e-4, -1e-4, 3e-4];
    let fly = |sign: f64| {
        let steady = [t.velocity[0], t.velocity[2], 0.0, t.theta, 0.0, 0.0, 0.0, t.phi];
        let units = ["m/s", "m/s", "rad/s", "rad", "m/s", "rad/s", "rad/s", "rad"];
        let mut document = document.clone();
        for (i, name) in NAMES.iter().enumerate() {
            document["initial"][*name] = json!(format!("{:e} {}", steady[i] + sign * away[i], units[i]));
        }
        one(&document, times(2.0, Some(0.1), None))
    };
    let (up, down) = (fly(1.0), fly(-1.0));
    let model = Airplane::from_json(&aerosonde().to_string(), "aerosonde").unwrap().linear(&t).full;
    let b = model.b.select_columns(&[0, 2, 3]);
    let mut driven = DMatrix::zeros(11, 11);
    driven.view_mut((0, 0), (8, 8)).copy_from(&(&model.a / RATE));
    driven.view_mut((0, 8), (8, 3)).copy_from(&(&b / RATE));
    let over = driven.exp();
    let closed = over.view((0, 0), (8, 8)) - over.view((0, 8), (8, 3)) * gain;
    for (time, samples) in [(0.1, 40), (0.5, 200), (1.0, 400)] {
        let expected = closed.pow(samples) * DVector::from_column_slice(&away);
        for (i, name) in NAMES.iter().enumerate() {
            let found = 0.5 * (up.at(time, &[*name])[0] - down.at(time, &[*name])[0]);
            // the height, which the linear model leaves out, is felt along the way by 1e-3 a second
            let allowed = if i < 4 { 2e-3 * expected.rows(0, 4).amax() } else { 1e-4 * expected.rows(4, 4).amax() };
            assert!((found - expected[i]).abs() < allowed, "{time} {name}: {found} against {}", expected[i]);
        }
    }
}
