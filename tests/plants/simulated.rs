//! `simulate` of a sensor in its plant: what the aids show, and that the filter of the same design finds it consistent.

use kfdesign::simulate::{Flight, Scenario, Simulator, TrueRate};
use serde_json::Value;

use super::gyro;
use super::replay::{DEG, DT, state};
use crate::support::{Bench, data};

const HEADING: &str = r#"{"plant": "angle", "initial_std_dev": "30 deg", "aids": [{"name": "heading", "std_dev": "2 deg", "rate": "1 Hz",
    "gauss_markov": {"std_dev": "3 deg", "correlation_time": "60 s"}}]}"#;

/// What `simulate` writes is what the design describes: verdict consistent (1e-5), truth within five claimed sigmas
/// (1 in 2 million each).
#[test]
fn a_simulated_flight_is_consistent_with_its_design() {
    let bench = Bench::new();
    bench.file("angle.json", gyro(HEADING).to_json());
    let cases = [
        ("angle.json", "", "--aid heading=heading_z", "sine:20deg/s,0.02Hz", "angle"),
        (
            "angle.json",
            &*format!("--plant {}", data("design/vertical.json").display()),
            "--aid accelerometer=accelerometer_z",
            "sine:1deg/s,0.05Hz",
            "tilt",
        ),
    ];
    for (params, plant, aid, motion, name) in cases {
        bench.ok(&format!("tune {params} {plant} -o filter.json"));
        bench.ok(&format!(
            "simulate {params} {plant} -o log.csv --duration 10min --seed 7 --turn-on --true-rate {motion}"
        ));
        let log = bench.read("log.csv");
        let header = log.lines().next().unwrap();
        assert!(header.ends_with(&format!("truth_z_{name} (deg)")), "{header}");
        let run = bench.run(&format!("replay filter.json log.csv --columns gyro_z {aid} --alpha 1e-5 --json"));
        let printed: Value = serde_json::from_str(&run.stdout).unwrap_or_else(|_| panic!("{}", run.stderr));
        assert_eq!(printed["verdict"], "consistent", "{name}: {}", printed["meaning"]);
        let last = log.lines().last().unwrap().rsplit(',').next().unwrap();
        let (value, sigma) = state(&printed["axes"][0], name);
        assert!((value - last.parse::<f64>().unwrap() * DEG).abs() < 5.0 * sigma, "{name}: {value} {last} {sigma}");
    }
    let refused = bench.run(&format!(
        "simulate angle.json --plant {} -o log.csv --duration 1s",
        data("design/pendulum.json").display()
    ));
    assert!(refused.status == 2 && refused.stderr.contains("custom plant"), "{}", refused.stderr);
}

/// Angle and aid by their definition: θ⁺ = θ + dt ω; a heading within half a turn of zero, at every hundredth
/// sample, whose error has the variance of both its parts (60 headings of 60 runs, correlated over a minute: some 60
/// independent values; a chi-square of 60 is within 26 to 110 but for 1e-5). The same numbers for any block size.
#[test]
fn headings_are_the_angle_with_their_errors() {
    let params = gyro(HEADING);
    let design = params.design.clone().unwrap();
    let (mut square, mut steps) = (0.0, 0.0);
    for run in 0..60 {
        let scenario = Scenario {
            seed: 3,
            run,
            samples: 6000,
            rate_hz: 100.0,
            true_rate: TrueRate::Constant(30.0 * DEG),
            turn_on: true,
            saturation: None,
            quantisation: None,
        };
        let fly = |block: usize| {
            let mut simulator = Simulator::new(&params, &scenario).unwrap();
            let mut flight = Flight::new(&design, 1, &scenario).unwrap().unwrap();
            let (mut blocks, mut flown) = (Vec::new(), Vec::new());
            let (mut angle, mut heading) = (Vec::new(), Vec::new());
            while simulator.next_block(block, &mut blocks) > 0 {
                flight.next_block(&blocks, &mut flown);
                angle.extend_from_slice(&flown[0].state);
                heading.extend_from_slice(&flown[0].aids[0]);
            }
            (angle, heading)
        };
        let (angle, heading) = fly(6000);
        if run == 0 {
            let (other, others) = fly(77);
            assert_eq!(angle, other);
            assert!(heading.iter().zip(&others).all(|(a, b)| a.to_bits() == b.to_bits()));
        }
        // 30 deg/s for a minute: five turns
        assert!((angle[5999] - 30.0 * DEG * DT * 5999.0).abs() < 1e-9);
        let (mut sum, mut before) = (0.0, f64::NAN);
        for (k, z) in heading.iter().enumerate() {
            assert_eq!(z.is_finite(), k % 100 == 0);
            if z.is_finite() {
                assert!(z.abs() <= std::f64::consts::PI);
                let turns = ((z - angle[k]) / std::f64::consts::TAU).round();
                let error = z - angle[k] - turns * std::f64::consts::TAU;
                sum += error.powi(2);
                steps += if before.is_nan() { 0.0 } else { (error - before).powi(2) };
                before = error;
            }
        }
        square += sum / 60.0 / (13.0 * DEG * DEG);
    }
    assert!((26.0..110.0).contains(&square), "{square}");
    // from one heading to the next: 2 (2 deg)² and 2 (3 deg)² (1 − e^(−1/60)); the mean of 3540 squares, neighbours
    // sharing a value, has a relative standard deviation of √(3/3540) = 2.9 %: five are 15 %
    let expected = (8.0 + 18.0 * -(-1.0_f64 / 60.0).exp_m1()) * DEG * DEG;
    assert!((steps / 3540.0 / expected - 1.0).abs() < 0.15, "{} {expected}", steps / 3540.0);
}

/// The gate's power is told of aids too. 25 runs of 200 s have 5025 headings: mean NIS has a standard deviation of
/// √(2/5025) = 2 %, and a σ that is f times too large makes it about 1/f². Seen with 90 % by one of some thirty
/// tests at 1 % together: some five standard deviations, f near 1.05.
#[test]
fn the_gate_says_what_it_sees_of_an_aid() {
    let bench = Bench::new();
    bench.file(
        "angle.json",
        gyro(r#"{"plant": "angle", "aids": [{"name": "heading", "std_dev": "2 deg", "rate": "1 Hz"}]}"#).to_json(),
    );
    bench.ok("tune angle.json -o filter.json");
    let printed: Value =
        serde_json::from_str(&bench.ok("montecarlo filter.json --runs 25 --duration 200s --power --json")).unwrap();
    let detects = printed["detects"].as_array().unwrap();
    let aid = detects.iter().find(|d| d["parameter"] == "heading.std_dev").unwrap_or_else(|| panic!("{detects:?}"));
    let (large, small) = (aid["too_large"]["size"].as_f64().unwrap(), aid["too_small"]["size"].as_f64().unwrap());
    assert!((1.02..1.12).contains(&large) && (0.9..0.98).contains(&small), "{large} {small}");
}
