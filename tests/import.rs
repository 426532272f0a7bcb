//! Parameter files of other programs and datasheets into params.json: field by field, there and back, and beside a log.

use std::f64::consts::{LN_2, PI, SQRT_2};

use kfdesign::identify::{Method, identify_axis, parse_model};
use kfdesign::noise::{FLICKER_FLOOR, GAUSS_MARKOV_PEAK, NoiseModel, Term};
use kfdesign::numerics::random::{StreamId, normal, stream};
use kfdesign::params::{AxisParams, Params};
use kfdesign::units::Unit;

use super::support::{Bench, data};

/// The reference sensor: N = 0.0562 deg/s/√Hz, σ = 0.0280596 deg/s, Tc = 193.9312 s, K = σ √(2/Tc), in SI.
const N: f64 = 9.808750396e-4;
const K: f64 = 4.973361164e-5;
const SIGMA: f64 = 4.897324068e-4;
const TC: f64 = 193.9312;

/// As Kalibr's wiki shows it, with the accelerometer of its example.
const KALIBR: &str = r#"#Accelerometers
accelerometer_noise_density: 1.86e-03   #Noise density (continuous-time)
accelerometer_random_walk:   4.33e-04   #Bias random walk

#Gyroscopes
gyroscope_noise_density:     9.808750396e-4
gyroscope_random_walk:       4.973361164e-05

rostopic:                    /imu0      #the IMU ROS topic
update_rate:                 100.0
"#;

/// As gaowenliang/imu_utils writes the reference sensor at 400 Hz: N √400, and 0.013114 deg/s, the lowest point of
/// its Allan deviation.
const DEVIATIONS: &str = r#"%YAML:1.0
---
type: IMU
name: skydog
Gyr:
   unit: " rad/s"
   avg-axis:
      gyr_n: 3.0e-02
      gyr_w: 2.0e-04
   x-axis:
      gyr_n: 1.9617500792e-02
      gyr_w: 2.2888e-04
   y-axis:
      gyr_n: 2.9617500792e-02
      gyr_w: 3.2888e-04
   z-axis:
      gyr_n: 3.9617500792e-02
      gyr_w: 4.2888e-04
Acc:
   unit: " m/s^2"
   avg-axis:
      acc_n: 4.0e-02
      acc_w: 6.32492e-04
"#;

/// Written by an early gaowenliang/imu_utils for a DJI A3 at 400 Hz (its data/A3_imu_param.yaml, first digits): N/20
/// would lie below the floor.
const EARLY: &str = r#"%YAML:1.0
---
type: IMU
name: A3
Gyr:
   unit: " rad/s"
   avg-axis:
      gyr_n: 1.03512e-04
      gyr_w: 2.94386e-05
   x-axis:
      gyr_n: 1.03126e-04
      gyr_w: 3.37658e-05
   y-axis:
      gyr_n: 1.07871e-04
      gyr_w: 3.19706e-05
   z-axis:
      gyr_n: 9.95403e-05
      gyr_w: 2.25795e-05
Acc:
   unit: " m/s^2"
   avg-axis:
      acc_n: 1.39850e-03
      acc_w: 6.32492e-04
"#;

/// As the fork mintar writes it, here with only the average.
const DENSITIES: &str = r#"%YAML:1.0
---
type: IMU
name: adis16460
Gyr:
   unit: "gyr_n: rad / sqrt(s), gyr_w: rad / s^2 / sqrt(Hz)"
   avg-axis:
      gyr_n: 9.808750396e-04
      gyr_w: 4.973361164e-05
Acc:
   unit: "acc_n: m / s^2 / sqrt(Hz), acc_w: m / s^3 / sqrt(Hz)"
   avg-axis:
      acc_n: 2.0e-03
      acc_w: 3.0e-04
"#;

/// As the demos of gnss-ins-sim have it.
const DICTIONARY: &str = r#"import numpy as np
# 'gyro_arw': in deg/rt-hr
imu_err = {'gyro_b': np.array([36.0, 0.0, -36.0]),
           'gyro_arw': np.array([3.372, 3.372, 3.372]) * 1.0,
           'gyro_b_stability': np.array([101.0146, 101.0146, 202.0292]) * 2.0 / 2,
           'gyro_b_corr': np.array([193.9312, 193.9312, 100.0]),
           'accel_b': np.zeros(3),
           'accel_vrw': np.array([0.12, 0.12, 0.12]),
           'accel_b_stability': np.array([4.0e-3] * 1), # three alike
           'accel_b_corr': np.array([float("inf"), 200.0, 200.0]),
           'mag_std': np.array([0.2, 0.2, 0.2])
}
"#;

fn bench() -> Bench {
    let bench = Bench::new();
    for (name, text) in [
        ("kalibr.yaml", KALIBR),
        ("deviations.yaml", DEVIATIONS),
        ("early.yaml", EARLY),
        ("densities.yaml", DENSITIES),
        ("imu_err.py", DICTIONARY),
    ] {
        bench.file(name, text);
    }
    bench
}

fn params(bench: &Bench, name: &str) -> Params {
    Params::from_json(&bench.read(name), name).unwrap()
}

/// Terms of one axis, SI.
fn terms(params: &Params, axis: usize) -> Vec<Term> {
    params.axes[axis].noise().terms
}

/// The numbers of a term.
fn numbers(term: &Term) -> Vec<f64> {
    match *term {
        Term::White { density } | Term::RateRandomWalk { density } => vec![density],
        Term::GaussMarkov { std_dev, correlation_time } => vec![std_dev, correlation_time],
        Term::BiasInstability { coefficient } => vec![coefficient],
        ref other => panic!("{other:?}"),
    }
}

/// Kinds and numbers within `digits` (relative).
fn assert_terms(found: &[Term], expected: &[Term], relative: f64) {
    assert_eq!(found.len(), expected.len(), "{found:?} {expected:?}");
    for (found, expected) in found.iter().zip(expected) {
        assert_eq!(found.kind(), expected.kind());
        for (a, b) in numbers(found).iter().zip(numbers(expected)) {
            assert!((a / b - 1.0).abs() < relative, "{found:?} {expected:?}");
        }
    }
}

/// Numbers are written with as many digits as the files have; only the unit's factor rounds.
const EXACT: f64 = 1e-12;
/// Vectors of the reference table have seven to ten digits.
const VECTOR: f64 = 1e-6;

#[test]
fn every_file_gives_the_sensor_of_the_reference_table() {
    let bench = bench();
    let walk = [Term::White { density: N }, Term::RateRandomWalk { density: K }];
    let said = bench.ok("import kalibr.yaml -o gyro.json --accelerometer acc.json");
    assert!(
        said.contains("continuous: taken as they are") && said.contains("acc.json written: specific-force"),
        "{said}"
    );
    let gyro = params(&bench, "gyro.json");
    assert_eq!((gyro.sample_rate_hz, gyro.axes.len()), (100.0, 3));
    assert_terms(&terms(&gyro, 2), &walk, EXACT);
    let force = [Term::White { density: 1.86e-3 }, Term::RateRandomWalk { density: 4.33e-4 }];
    assert_terms(&terms(&params(&bench, "acc.json"), 0), &force, EXACT);
    // the same numbers below imu0, behind OpenCV's first line, with matrices between them
    let nested: String = KALIBR.lines().map(|l| format!("  {l}\n")).collect();
    bench.file("chain.yaml", format!("%YAML:1.0\n---\nimu0:\n  T_i_b:\n    - [1.0, 0.0, 0.0, 0.0]\n    - [0.0, 1.0,\n       0.0, 0.0]\n{nested}  model: \"kalibr\"\n"));
    bench.ok("import chain.yaml -o chain.json");
    assert_terms(&terms(&params(&bench, "chain.json"), 0), &walk, EXACT);
    bench.file("orb.yaml", "IMU.NoiseGyro: 9.808750396e-4 # rad/s^0.5\nIMU.GyroWalk: 4.973361164e-5\nIMU.Frequency: 200.0\nCamera.type: \"PinHole\"\n");
    bench.ok("import orb.yaml -o orb.json");
    assert_terms(&terms(&params(&bench, "orb.json"), 0), &walk, EXACT);
    assert_eq!(params(&bench, "orb.json").sample_rate_hz, 200.0);

    // two dialects of one program: a deviation per sample and a floor, or densities
    bench.ok("import deviations.yaml --rate 400 -o deviations.json --accelerometer force.json");
    let found = params(&bench, "deviations.json");
    let floor = (2.0 * LN_2 / PI).sqrt();
    let flicker = |n: f64, w: f64| [Term::White { density: n }, Term::BiasInstability { coefficient: w / floor }];
    assert_terms(&terms(&found, 0), &flicker(N, 2.2888e-4), EXACT);
    assert_terms(&terms(&found, 1), &flicker(2.9617500792e-2 / 20.0, 3.2888e-4), EXACT);
    assert_terms(&terms(&found, 2), &flicker(3.9617500792e-2 / 20.0, 4.2888e-4), EXACT);
    // an early version of the same program wrote N itself
    let out = bench.run("import early.yaml --rate 400 -o early.json --accelerometer force.json");
    assert!(out.status == 0 && out.stderr.contains("would lie below gyr_w"), "{}", out.stderr);
    let early = params(&bench, "early.json");
    for (i, (n, w)) in
        [(1.03126e-4, 3.37658e-5), (1.07871e-4, 3.19706e-5), (9.95403e-5, 2.25795e-5)].into_iter().enumerate()
    {
        assert_terms(&terms(&early, i), &flicker(n, w), EXACT);
    }
    assert_terms(&terms(&params(&bench, "force.json"), 1), &flicker(1.39850e-3, 6.32492e-4), EXACT);
    bench.ok("import deviations.yaml --rate 400 --accelerometer force.json");
    assert_terms(&terms(&params(&bench, "force.json"), 1), &flicker(4.0e-2 / 20.0, 6.32492e-4), EXACT);
    assert_eq!(found.axes.iter().map(|a| a.name.as_str()).collect::<Vec<_>>(), ["x", "y", "z"]);
    assert_eq!(params(&bench, "force.json").axes.len(), 3, "the average stands for three");
    bench.ok("import densities.yaml --rate 400 -o densities.json --accelerometer force.json");
    assert_terms(&terms(&params(&bench, "densities.json"), 1), &walk, EXACT);
    let force = [Term::White { density: 2e-3 }, Term::RateRandomWalk { density: 3e-4 }];
    assert_terms(&terms(&params(&bench, "force.json"), 1), &force, EXACT);

    let out = bench.run("import imu_err.py --rate 100 -o sim.json --accelerometer force.json");
    assert!(out.status == 0 && out.stderr.contains("x: without a finite accel_b_corr"), "{}", out.stderr);
    let found = params(&bench, "sim.json");
    let drift = Term::GaussMarkov { std_dev: SIGMA, correlation_time: TC };
    assert_terms(&terms(&found, 0), &[Term::White { density: N }, drift], VECTOR);
    let other = Term::GaussMarkov { std_dev: 2.0 * SIGMA, correlation_time: 100.0 };
    assert_terms(&terms(&found, 2), &[Term::White { density: N }, other], VECTOR);
    let biases: Vec<Option<f64>> = found.axes.iter().map(|a| a.bias.as_ref().map(|b| b.unit.from_si(b.si()))).collect();
    assert_eq!(biases, [Some(36.0), None, Some(-36.0)]);
    // an infinite time is white noise of the deviation per sample, as the code makes it
    let force = params(&bench, "force.json");
    assert_terms(&terms(&force, 0), &[Term::White { density: 0.002 }, Term::White { density: 4e-3 / 10.0 }], EXACT);
    let steady = Term::GaussMarkov { std_dev: 4e-3, correlation_time: 200.0 };
    assert_terms(&terms(&force, 1), &[Term::White { density: 0.002 }, steady], EXACT);
    // the same as JSON
    bench.file("imu_err.json", r#"{"gyro_arw": [3.372, 3.372, 3.372], "gyro_b_stability": 101.0146, "gyro_b_corr": [193.9312,193.9312,193.9312]}"#);
    bench.ok("import imu_err.json --rate 100 -o json.json");
    assert_terms(&terms(&params(&bench, "json.json"), 2), &[Term::White { density: N }, drift], VECTOR);
}

/// What is exported and read again has every written digit, and is exported as the same numbers once more.
#[test]
fn there_and_back() {
    let bench = bench();
    bench.file("three.json", std::fs::read_to_string(data("params.json")).unwrap());
    bench.ok("import kalibr.yaml --accelerometer acc.json");
    let fields = |text: &str| -> Vec<String> {
        text.lines()
            .filter(|l| !l.starts_with(['#', '%']) && l.chars().any(|c| c.is_ascii_digit()))
            .map(String::from)
            .collect()
    };
    for (target, of) in [
        ("kalibr", "--accelerometer acc.json"),
        ("openvins", "--accelerometer acc.json"),
        ("orbslam3", "--accelerometer acc.json"),
        ("gnss-ins-sim", ""),
    ] {
        bench.ok(&format!("export three.json --to {target} {of} --walk short -o once"));
        let force = if of.is_empty() { "" } else { "--accelerometer force.json" };
        let rate = if of.is_empty() { "--rate 100" } else { "" };
        bench.ok(&format!("import once -o back.json {force} {rate}"));
        let again = of.replace("acc.json", "force.json");
        bench.ok(&format!("export back.json --to {target} {again} -o twice"));
        assert_eq!(fields(&bench.read("once")), fields(&bench.read("twice")), "{target}");
        assert!(fields(&bench.read("once")).len() >= 4, "{target}");
        // nine digits are written
        let back = terms(&params(&bench, "back.json"), 0);
        let drift = if of.is_empty() {
            Term::GaussMarkov { std_dev: SIGMA, correlation_time: TC }
        } else {
            Term::RateRandomWalk { density: K }
        };
        assert_terms(&back, &[Term::White { density: N }, drift], 1e-8);
    }
    // what is read back can be used: the same log's filter, a filter of the walk
    bench.ok("tune back.json -o filter.json");
}

/// The two factors are what the noise models themselves say.
#[test]
fn factors_of_the_bias_instability() {
    // far beyond the sample time; 1e-6: the sampled form's first term in 1/m
    let flicker = NoiseModel { terms: vec![Term::BiasInstability { coefficient: 1.0 }] };
    assert!((flicker.allan_variance(1_000_000, 0.01).sqrt() / FLICKER_FLOOR - 1.0).abs() < 1e-6);
    assert!((FLICKER_FLOOR - (2.0 * LN_2 / PI).sqrt()).abs() < 1e-12);
    let drift = NoiseModel { terms: vec![Term::GaussMarkov { std_dev: 1.0, correlation_time: 100.0 }] };
    let peak = (1..=1000).map(|i| drift.allan_variance(i * 100, 0.01).sqrt()).fold(0.0, f64::max);
    // a grid of 0.01 Tc misses a flat maximum by less than 1e-5
    assert!((peak / GAUSS_MARKOV_PEAK - 1.0).abs() < 1e-5, "{peak}");
}

#[test]
fn a_datasheet_by_its_own_words() {
    let bench = Bench::new();
    let sheet = |args: &[&str]| -> AxisParams {
        let all: Vec<&str> = ["datasheet", "--json", "--rate", "100"].iter().chain(args).copied().collect();
        let out = bench.run_args(&all);
        assert_eq!(out.status, 0, "{args:?}: {}", out.stderr);
        Params::from_json(&out.stdout, "stdout").unwrap().axes.remove(0)
    };
    let deg = PI / 180.0;
    let arw = ["--angle-random-walk", "3.372 deg/sqrt(h)"];
    let white = Term::White { density: N };
    assert_terms(&sheet(&arw).noise().terms, &[white], VECTOR);
    assert_terms(&sheet(&["--arw", "0.0562 deg/s/sqrt(Hz)"]).noise().terms, &[white], VECTOR);
    // the mark between one- and two-sided, also told by the random walk beside it
    let one = format!("{} deg/s/sqrt(Hz)", 0.0562 * SQRT_2);
    assert_terms(&sheet(&["--noise-density", &one, "--sided", "one"]).noise().terms, &[white], VECTOR);
    assert_terms(&sheet(&["--noise-density", "56.2 mdps/sqrt(Hz)", "--sided", "two"]).noise().terms, &[white], VECTOR);
    let told = bench.run_args(&["datasheet", "--rate", "100", arw[0], arw[1], "--noise-density", &one]);
    assert!(
        told.status == 0 && told.stdout.contains("is one-sided") && told.stdout.contains("which agrees"),
        "{told:?}"
    );
    let told =
        bench.run_args(&["datasheet", "--rate", "100", arw[0], arw[1], "--noise-density", "0.0562 dps/sqrt(Hz)"]);
    assert!(told.stdout.contains("is two-sided") && told.stdout.contains("which agrees"), "{told:?}");
    let odd = bench.run_args(&["datasheet", "--rate", "100", arw[0], arw[1], "--noise-density", "0.1 dps/sqrt(Hz)"]);
    assert!(odd.status == 0 && odd.stderr.contains("ratio 1.779"), "{odd:?}");
    // white noise of N through one pole at f has the variance 2 N² (π/2) f
    let rms = format!("{} deg/s", 0.0562 * (PI * 40.0).sqrt());
    assert_terms(&sheet(&["--total-noise", &rms, "--bandwidth", "40 Hz"]).noise().terms, &[white], VECTOR);
    // of second order π/(2√2): the Butterworth filter's ∫ df/(1 + (f/fc)⁴)
    let rms = format!("{} deg/s", 0.0562 * (2.0 * 40.0 * PI / (2.0 * SQRT_2)).sqrt());
    let second = ["--total-noise", &rms, "--bandwidth", "40 Hz", "--filter-order", "2"];
    assert_terms(&sheet(&second).noise().terms, &[white], VECTOR);

    let with = |args: &[&str]| sheet(&[&arw[..], args].concat()).noise().terms[1..].to_vec();
    let value = ["--bias-instability", "36 deg/h"];
    let si = 0.01 * deg;
    let coefficient = |c: f64| Term::BiasInstability { coefficient: c };
    assert_terms(&with(&value), &[coefficient(si / FLICKER_FLOOR)], EXACT);
    assert_terms(
        &with(&["--in-run-bias-stability", "36 deg/h", "--instability", "coefficient"]),
        &[coefficient(si)],
        EXACT,
    );
    let time = ["--correlation-time", "200 s"];
    let markov = |std_dev: f64| Term::GaussMarkov { std_dev, correlation_time: 200.0 };
    assert_terms(&with(&[&value[..], &time].concat()), &[markov(si / GAUSS_MARKOV_PEAK)], EXACT);
    let of = |what| [&value[..], &time, &["--instability", what]].concat();
    assert_terms(&with(&of("coefficient")), &[markov(si * FLICKER_FLOOR / GAUSS_MARKOV_PEAK)], EXACT);
    assert_terms(&with(&of("sigma")), &[markov(si)], EXACT);
    assert_terms(
        &with(&["--rate-random-walk", "3600 deg/h/sqrt(h)"]),
        &[Term::RateRandomWalk { density: deg / 60.0 }],
        EXACT,
    );
    let turn_on = sheet(&[&arw[..], &["--zero-rate-offset", "0.5 deg/s"]].concat()).turn_on_bias.unwrap();
    assert_eq!((turn_on.value, turn_on.unit.text()), (0.5, "deg/s"));

    // an accelerometer is known by its units; what is written can be read and its rules stand in it
    bench.ok("datasheet --help");
    let out = bench.run_args(&[
        "datasheet",
        "--velocity-random-walk",
        "0.03 m/s/sqrt(h)",
        "--bias-instability",
        "0.04 mg",
        "--rate",
        "200",
        "--axes",
        "a",
        "--name",
        "XY-1",
        "-o",
        "acc.json",
    ]);
    assert_eq!(out.status, 0, "{}", out.stderr);
    let found = params(&bench, "acc.json");
    assert_terms(
        &terms(&found, 0),
        &[Term::White { density: 5e-4 }, coefficient(4e-5 * 9.80665 / FLICKER_FLOOR)],
        EXACT,
    );
    let note = found.source.unwrap().note.unwrap();
    assert!(note.starts_with("XY-1: ") && note.contains("0.6643"), "{note}");
    assert!(out.stdout.contains("floor/0.6643"), "the rule is said: {}", out.stdout);
}

/// Sensor samples at 1 Hz: white noise of density `n` and a Gauss-Markov drift.
fn log(n: f64, sigma: f64, tc: f64, samples: usize, run: u64) -> Vec<f64> {
    let mut rng = stream(91, StreamId { run, axis: 0, term: 0 });
    let a = (-1.0 / tc).exp();
    let mut drift = sigma * normal(&mut rng);
    let mut one = || {
        let value = drift + n * normal(&mut rng);
        drift = a * drift + sigma * (1.0 - a * a).sqrt() * normal(&mut rng);
        value
    };
    (0..samples).map(|_| one()).collect()
}

/// Growth of the drift over short times and white noise as a whole: of 40 logs of two hours at 1 Hz the standard
/// deviation of ln K is that of the information matrix (0.090, and 0.0086 for N), and the 95 % intervals cover:
/// fewer than 32 of 40 have probability 1e-4, each time.
#[test]
fn sums_of_processes_have_honest_intervals() {
    use rayon::prelude::*;
    let unit = Unit::parse("rad/s").unwrap();
    let choice = parse_model("white+gm").unwrap();
    let found: Vec<[(f64, f64); 2]> = (0..40u64)
        .into_par_iter()
        .map(|run| {
            let log = log(N, SIGMA, TC, 7200, run);
            let sums = identify_axis("z", &log, 1.0, &unit, Method::Likelihood, &choice).unwrap().sums;
            [(sums.walk, K), (sums.white, N)].map(|(sum, truth)| {
                let sum = sum.unwrap();
                let [low, high] = sum.interval.unwrap();
                ((sum.value / truth).ln(), (high / low).ln() / 3.92)
            })
        })
        .collect();
    for (i, expected) in [(0, 0.090), (1, 0.0086)] {
        let count = found.len() as f64;
        let claimed = found.iter().map(|f| f[i].1).sum::<f64>() / count;
        // a log's own curvature scatters by some 10 %, the mean of 40 by 2 %
        assert!((claimed / expected - 1.0).abs() < 0.08, "{i}: {claimed}");
        let inside = found.iter().filter(|f| f[i].0.abs() < 1.96 * f[i].1).count();
        assert!(inside >= 32, "{i}: {inside} of 40");
    }
}

/// A process that forgets within three samples counts as white noise: its spectrum at zero is σ²(1 + a)/(1 − a) dt.
/// Twenty logs of 20,000 samples: all within five standard deviations (1e-5), and their mean square of the expected
/// size (χ² of 20 outside 8 … 45: 1e-3).
#[test]
fn fast_processes_are_white_noise() {
    use rayon::prelude::*;
    let unit = Unit::parse("rad/s").unwrap();
    let choice = parse_model("white+gm").unwrap();
    let a = (-1.0f64 / 3.0).exp();
    let truth = (0.3f64.powi(2) + (1.0 + a) / (1.0 - a)).sqrt();
    let scores: Vec<f64> = (100..120u64)
        .into_par_iter()
        .map(|run| {
            let sums = identify_axis("z", &log(0.3, 1.0, 3.0, 20_000, run), 1.0, &unit, Method::Likelihood, &choice)
                .unwrap()
                .sums;
            assert!(sums.walk.is_none(), "{sums:?}");
            let white = sums.white.unwrap();
            let [low, high] = white.interval.unwrap();
            (white.value / truth).ln() / ((high / low).ln() / 3.92)
        })
        .collect();
    assert!(scores.iter().all(|z| z.abs() < 5.0), "{scores:?}");
    let sum: f64 = scores.iter().map(|z| z * z).sum();
    assert!((8.0..45.0).contains(&sum), "{sum}: {scores:?}");
}

/// An hour of the reference sensor at 10 Hz beside its own numbers as other programs hold them, and beside wrong ones.
#[test]
fn a_files_numbers_beside_a_log() {
    let bench = bench();
    let one = std::fs::read_to_string(data("wrong/truth.json")).unwrap().replace("100 Hz", "10 Hz");
    bench.file("truth.json", one);
    bench.ok("simulate truth.json -o log.npy --duration 2h --seed 1 --rate 10");
    let rows = |args: &str| -> Vec<serde_json::Value> {
        let out = bench.run(&format!("compare {args} --parameters --json"));
        assert!(out.status < 2, "{}", out.stderr);
        let document: serde_json::Value = serde_json::from_str(&out.stdout).unwrap();
        document["parameters"].as_array().unwrap().clone()
    };
    let of = |rows: &[serde_json::Value], name: &str| -> (f64, bool, String) {
        let row = rows.iter().find(|r| r["parameter"] == name).unwrap_or_else(|| panic!("{name}: {rows:?}"));
        let (file, log, ratio) =
            (row["file"].as_f64().unwrap(), row["log"].as_f64().unwrap(), row["ratio"].as_f64().unwrap());
        assert!((file / log - ratio).abs() < 1e-9 * ratio);
        let ends: Vec<f64> = row["interval"].as_array().unwrap().iter().map(|e| e.as_f64().unwrap()).collect();
        let inside = row["inside"].as_bool().unwrap();
        assert_eq!(inside, ends[0] <= file && file <= ends[1]);
        (ratio, inside, row["meaning"].as_str().unwrap().to_owned())
    };
    // the truth: one seed, four intervals of 95 %; this one has all four inside
    let truth = rows("truth.json log.npy");
    for name in ["white.density", "gauss_markov.std_dev", "gauss_markov.correlation_time"] {
        let (ratio, inside, meaning) = of(&truth, name);
        assert!(
            inside && meaning.contains("your file says") && meaning.ends_with("inside"),
            "{name} {ratio} {meaning}"
        );
    }
    // the walk of Kalibr is the growth of the drift over short times
    bench.ok("export truth.json --to kalibr --walk short -o imu.yaml");
    let kalibr = rows("imu.yaml log.npy");
    assert!(of(&kalibr, "white.density").1 && of(&kalibr, "rate_random_walk.density").1, "{kalibr:?}");
    // ten times, as people inflate; an interval of K is a factor of 1.2 wide each way
    bench.ok("export truth.json --to kalibr --walk short --inflate 10 -o loud.yaml");
    let loud = rows("loud.yaml log.npy");
    for name in ["white.density", "rate_random_walk.density"] {
        let (ratio, inside, meaning) = of(&loud, name);
        assert!(!inside && (7.0..14.0).contains(&ratio) && meaning.contains("claims more"), "{meaning}");
    }
    // a datasheet's flicker is not in the log's own model: a fit that has it is asked for
    bench.run_args(&[
        "datasheet",
        "--arw",
        "3.372 deg/sqrt(h)",
        "--bias-instability",
        "1 deg/h",
        "--rate",
        "10",
        "--axes",
        "x",
        "-o",
        "sheet.json",
    ]);
    let sheet = rows("sheet.json log.npy");
    let (ratio, inside, meaning) = of(&sheet, "bias_instability.coefficient");
    assert!(!inside && ratio < 0.1 && meaning.contains("claims less"), "{meaning}");
    assert!(
        sheet.iter().any(|r| r["how"].as_str().unwrap().contains("asked for; the log chooses white+gm")),
        "{sheet:?}"
    );
    let text = bench.run("compare imu.yaml log.npy --parameters --report page.html").stdout;
    assert!(text.contains("x: your file says K = ") && text.contains("file/log"), "{text}");
    assert!(bench.read("page.html").contains("your file says K"));
}
