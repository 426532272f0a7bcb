//! Parameter files of other programs: field by field, and through each consumer's own discretisation back to the
//! parameters.

mod walks;

use kfdesign::identify::{Method, identify_axis, parse_model};
use kfdesign::numerics::random::{StreamId, normal, stream};
use kfdesign::params::AxisParams;
use kfdesign::units::Unit;

use super::support::{Bench, measured};

/// The reference sensor: N = 0.0562 deg/s/√Hz, σ = 0.0280596 deg/s, Tc = 193.9312 s at 100 Hz.
const GYRO: &str = r#"{"format": "kfdesign-params/1", "quantity": "angular-rate", "sample_rate": "100 Hz",
    "source": {"log": "bench.npy", "sha256": "abc"},
    "axes": [{"name": "z", "turn_on_bias": {"std_dev": "0.6 deg/s"},
        "white": {"density": {"value": 0.0562, "unit": "deg/s/sqrt(Hz)", "interval": [0.0555, 0.0569]}},
        "gauss_markov": {"std_dev": "0.0280596 deg/s", "correlation_time": "193.9312 s"}}]}"#;
/// With round numbers: N = 0.002 m/s²/√Hz, K = 3e-4 m/s³/√Hz.
const ACCELEROMETER: &str = r#"{"format": "kfdesign-params/1", "quantity": "specific-force", "sample_rate": "100 Hz",
    "axes": [{"name": "a", "white": {"density": "0.002 m/s^2/sqrt(Hz)"}, "rate_random_walk": {"density": "0.0003 m/s^2/sqrt(s)"}}]}"#;

const N: f64 = 9.808750396e-4;
const K: f64 = 4.973361164e-5;
const SIGMA: f64 = 4.897324068e-4;
const TC: f64 = 193.9312;

fn bench() -> Bench {
    let bench = Bench::new();
    bench.file("gyro.json", GYRO);
    bench.file("acc.json", ACCELEROMETER);
    bench
}

/// The number behind `key` and anything that is no number.
fn field(text: &str, key: &str) -> f64 {
    let line =
        text.lines().find(|l| l.contains(key) && !l.starts_with(['#', '%'])).unwrap_or_else(|| panic!("{key}: {text}"));
    let after = &line[line.find(key).unwrap() + key.len()..];
    let from = after.find(|c: char| c.is_ascii_digit() || c == '-').unwrap();
    let number: String = after[from..].chars().take_while(|c| c.is_ascii_digit() || "+-.e".contains(*c)).collect();
    number.parse().unwrap_or_else(|_| panic!("{key}: {number}"))
}

fn close(found: f64, expected: f64) {
    // nine digits are written, ten are given
    assert!((found / expected - 1.0).abs() < 1e-8, "{found:e} {expected:e}");
}

/// Every vector of the reference table of what the consumers' code takes: (target, flags, [(field, value)]).
#[test]
fn every_field_is_what_the_consumer_takes() {
    let bench = bench();
    let root = |x: f64| x.sqrt();
    type Row<'a> = (&'a str, &'a str, Vec<(&'a str, f64)>);
    let rows: Vec<Row<'_>> = vec![
        (
            "kalibr",
            "",
            vec![
                ("gyroscope_noise_density:", N),
                ("gyroscope_random_walk:", K),
                ("accelerometer_noise_density:", 0.002),
                ("accelerometer_random_walk:", 3e-4),
                ("update_rate:", 100.0),
            ],
        ),
        ("openvins", "", vec![("gyroscope_noise_density:", N), ("gyroscope_random_walk:", K), ("update_rate:", 100.0)]),
        (
            "vins",
            "",
            vec![("gyr_n:", N * root(200.0)), ("gyr_w:", K * 10.0), ("acc_n:", 0.002 * root(200.0)), ("acc_w:", 3e-3)],
        ),
        ("vins", "--rate 200", vec![("gyr_n:", N * 20.0), ("gyr_w:", K * root(200.0))]),
        (
            "orbslam3",
            "",
            vec![
                ("IMU.NoiseGyro:", N),
                ("IMU.GyroWalk:", K),
                ("IMU.NoiseAcc:", 0.002),
                ("IMU.AccWalk:", 3e-4),
                ("IMU.Frequency:", 100.0),
            ],
        ),
        (
            "gtsam",
            "",
            vec![
                ("setGyroscopeCovariance(", N * N),
                ("setBiasOmegaCovariance(", K * K),
                ("setAccelerometerCovariance(", 4e-6),
                ("setBiasAccCovariance(", 9e-8),
            ],
        ),
        (
            "px4",
            "",
            vec![
                ("EKF2_GYR_NOISE\t", N * 10.0),
                ("EKF2_GYR_B_NOISE\t", K * 10.0),
                ("EKF2_GBIAS_INIT\t", 0.6_f64.to_radians()),
                ("EKF2_ACC_NOISE\t", 0.02),
                ("EKF2_ACC_B_NOISE\t", 0.003),
            ],
        ),
        (
            "ardupilot",
            "",
            vec![
                ("EK3_GYRO_P_NSE,", N / root(0.012)),
                ("EK3_GBIAS_P_NSE,", K / root(0.012)),
                ("EK3_ACC_P_NSE,", 0.002 / root(0.012)),
            ],
        ),
        (
            "navego",
            "",
            vec![("imu.arw = ", N), ("imu.gb_dyn = ", SIGMA), ("imu.gb_corr = ", TC), ("imu.vrrw = ", 3e-4)],
        ),
        (
            "gazebo",
            "",
            vec![("gyroscopeNoiseDensity>", N), ("gyroscopeRandomWalk>", K), ("gyroscopeBiasCorrelationTime>", TC)],
        ),
        ("kalibr", "--inflate 10", vec![("gyroscope_noise_density:", 10.0 * N), ("accelerometer_random_walk:", 3e-3)]),
        // 2σ² (1 − e^(−H/Tc))/H
        (
            "kalibr",
            "--walk horizon=600s",
            vec![("gyroscope_random_walk:", root(2.0 * SIGMA * SIGMA * -(-600.0 / TC).exp_m1() / 600.0))],
        ),
    ];
    for (target, flags, fields) in rows {
        let walk = if flags.contains("--walk") { "" } else { "--walk short" };
        let text = bench.ok(&format!("export gyro.json --to {target} --accelerometer acc.json {walk} {flags}"));
        for (key, value) in fields {
            close(field(&text, key), value);
        }
        assert!(text.contains("abc") && text.contains("9.68657735e-04"), "origin and interval of {target}: {text}");
    }
    // those that know a Gauss-Markov drift: alone, the accelerometer has a walk
    let text = bench.ok("export gyro.json --to gnss-ins-sim");
    close(field(&text, "'gyro_arw': np.array(["), 60.0 * 0.0562);
    close(field(&text, "'gyro_b_stability': np.array(["), 3600.0 * 0.0280596);
    close(field(&text, "'gyro_b_corr': np.array(["), TC);
    let text = bench.ok("export gyro.json --to matlab");
    close(field(&text, "'NoiseDensity', ["), N);
    close(field(&text, "'BiasInstability', ["), 4.973_232_94e-6);
    assert!(text.contains("single-sided") && text.contains("[1, -0.9999484366508]"), "{text}");
    let refused = bench.run("export gyro.json --to gnss-ins-sim --accelerometer acc.json");
    assert!(refused.status == 2 && refused.stderr.contains("rate random walk"), "{}", refused.stderr);
}

/// A sensor stream as a consumer's own code makes it: white noise of deviation `white` per sample, a bias b⁺ = φ b +
/// `step` n.
fn consumer(white: f64, phi: f64, step: f64, run: u64) -> Vec<f64> {
    let mut rng = stream(77, StreamId { run, axis: 0, term: 0 });
    // two correlation times away from a start at zero
    let mut bias = 0.0;
    for _ in 0..40_000 {
        bias = phi * bias + step * normal(&mut rng);
    }
    (0..400_000)
        .map(|_| {
            let value = bias + white * normal(&mut rng);
            bias = phi * bias + step * normal(&mut rng);
            value
        })
        .collect()
}

/// Estimate and standard deviation of ln θ, from the 95 % interval.
fn ln_estimates(axis: &AxisParams) -> Vec<(String, f64, f64)> {
    let mut axis = axis.clone();
    axis.noise_parameters()
        .filter_map(|(path, m)| {
            let [low, high] = m.interval_si().filter(|i| i.iter().all(|end| end.is_finite() && *end > 0.0))?;
            Some((path, m.si().ln(), (high / low).ln() / (2.0 * 1.96)))
        })
        .collect()
}

/// Every consumer's file, simulated with that consumer's own discretisation for 4000 s, gives the parameters back: N
/// and the walk K (or N, σ and Tc) within five standard deviations of their estimates (6e-7 each; the estimates are
/// normal in their logarithms to some 0.2 sd here, which five sd leave room for: 1e-5 for the whole test).
#[test]
fn the_consumers_own_formulas_give_the_parameters_back() {
    let bench = bench();
    let read =
        |target: &str| bench.ok(&format!("export gyro.json --to {target} --accelerometer acc.json --walk short"));
    let alone = |target: &str| bench.ok(&format!("export gyro.json --to {target}"));
    let walk = |k: f64| vec![("white.density", N), ("rate_random_walk.density", k)];
    let drift = || vec![("white.density", N), ("gauss_markov.std_dev", SIGMA), ("gauss_markov.correlation_time", TC)];
    let (f, dt): (f64, f64) = (100.0, 0.01);
    let kalibr = read("kalibr");
    let orb = read("orbslam3");
    let vins = read("vins");
    let gtsam = read("gtsam");
    let (px4, ardupilot) = (read("px4"), read("ardupilot"));
    let sim = alone("gnss-ins-sim");
    let navego = alone("navego");
    let gazebo = alone("gazebo");
    let matlab = alone("matlab");
    let deg = 1f64.to_radians();
    let ekf = 0.012;
    // σ and Tc as the file says
    let markov = |sigma: f64, tc: f64| sigma * (-(-2.0 * dt / tc).exp_m1()).sqrt();
    let (sim_sigma, sim_tc) =
        (field(&sim, "'gyro_b_stability': np.array([") * deg / 3600.0, field(&sim, "'gyro_b_corr': np.array(["));
    let (nav_sigma, nav_tc) = (field(&navego, "imu.gb_dyn = "), field(&navego, "imu.gb_corr = "));
    let (gz_k, gz_tc) = (field(&gazebo, "gyroscopeRandomWalk>"), field(&gazebo, "gyroscopeBiasCorrelationTime>"));
    type Case<'a> = (&'a str, f64, [f64; 3], Vec<(&'a str, f64)>);
    let cases: Vec<Case<'_>> = vec![
        // IMU.simulate of Kalibr and OpenVINS: N √f per sample, K √dt per step
        (
            "kalibr",
            dt,
            [
                field(&kalibr, "gyroscope_noise_density:") * f.sqrt(),
                1.0,
                field(&kalibr, "gyroscope_random_walk:") * dt.sqrt(),
            ],
            walk(K),
        ),
        (
            "orbslam3",
            dt,
            [field(&orb, "IMU.NoiseGyro:") * f.sqrt(), 1.0, field(&orb, "IMU.GyroWalk:") / f.sqrt()],
            walk(K),
        ),
        // angle variance ½ dt² gyr_n² per step is that of a rate sample of deviation gyr_n/√2; bias dt² gyr_w²
        ("vins", dt, [field(&vins, "gyr_n:") / 2f64.sqrt(), 1.0, field(&vins, "gyr_w:") * dt], walk(K)),
        (
            "gtsam",
            dt,
            [
                (field(&gtsam, "setGyroscopeCovariance(") / dt).sqrt(),
                1.0,
                (field(&gtsam, "setBiasOmegaCovariance(") * dt).sqrt(),
            ],
            walk(K),
        ),
        ("px4", dt, [field(&px4, "EKF2_GYR_NOISE\t"), 1.0, field(&px4, "EKF2_GYR_B_NOISE\t") * dt], walk(K)),
        (
            "ardupilot",
            ekf,
            [field(&ardupilot, "EK3_GYRO_P_NSE,"), 1.0, field(&ardupilot, "EK3_GBIAS_P_NSE,") * ekf],
            walk(K),
        ),
        // Euler coefficient, exact gain
        (
            "gnss-ins-sim",
            dt,
            [
                field(&sim, "'gyro_arw': np.array([") * deg / 60.0 / dt.sqrt(),
                1.0 - dt / sim_tc,
                markov(sim_sigma, sim_tc),
            ],
            drift(),
        ),
        (
            "navego",
            dt,
            [field(&navego, "imu.arw = ") * f.sqrt(), (-dt / nav_tc).exp(), markov(nav_sigma, nav_tc)],
            drift(),
        ),
        (
            "gazebo",
            dt,
            [
                field(&gazebo, "gyroscopeNoiseDensity>") * f.sqrt(),
                (-dt / gz_tc).exp(),
                markov(gz_k * (gz_tc / 2.0).sqrt(), gz_tc),
            ],
            drift(),
        ),
        // single-sided: N √f per sample; the filter 1/(1 − a z⁻¹) on white noise of deviation BiasInstability
        (
            "matlab",
            dt,
            [
                field(&matlab, "'NoiseDensity', [") * f.sqrt(),
                -field(&matlab, "'Denominator', [1, "),
                field(&matlab, "'BiasInstability', ["),
            ],
            drift(),
        ),
    ];
    for (run, (target, step, [white, phi, bias], truth)) in (0..).zip(cases) {
        let log = consumer(white, phi, bias, run);
        let model = if phi == 1.0 { "white+rrw" } else { "white+gm" };
        let unit = Unit::parse("rad/s").unwrap();
        let found = identify_axis("z", &log, step, &unit, Method::Likelihood, &parse_model(model).unwrap()).unwrap();
        let estimates = ln_estimates(&found.params);
        let mut compared = 0;
        for (path, value) in truth {
            let Some((_, ln, sd)) = estimates.iter().find(|(p, ..)| p == path) else { continue };
            compared += 1;
            assert!((ln - value.ln()).abs() < 5.0 * sd, "{target} {path}: {:e} {value:e} {sd}", ln.exp());
        }
        assert!(compared >= 2, "{target}: {estimates:?}");
    }
}

/// Noise behind a low-pass: white noise of 0.01 and an oscillation of 3 Hz that dies away in 0.05 s. N is what the
/// mean over a long time shows: σ²(mean over T)·T by the autocovariance, here in closed form as the sum over all
/// lags, 1e-9 of it beyond the last that is taken.
#[test]
fn density_at_low_frequencies() {
    let (sigma, f0, time, dt) = (0.2_f64, 3.0_f64, 0.05_f64, 0.01_f64);
    let bench = bench();
    let white = r#""white": {"density": {"value": 0.0562, "unit": "deg/s/sqrt(Hz)", "interval": [0.0555, 0.0569]}}"#;
    let with = |extra: &str| GYRO.replace(white, &format!(r#""white": {{"density": "0.01 deg/s/sqrt(Hz)"}}{extra}"#));
    bench.file(
        "slow.json",
        with(r#", "oscillation": {"std_dev": "0.2 deg/s", "frequency": "3 Hz", "correlation_time": "0.05 s"}"#),
    );
    let found = bench.run("export slow.json --to kalibr");
    let lag = |h: i32| {
        let tau = f64::from(h) * dt;
        sigma.powi(2) * (-tau / time).exp() * (std::f64::consts::TAU * f0 * tau).cos()
    };
    let density = dt * (lag(0) + 2.0 * (1..200).map(lag).sum::<f64>());
    let expected = (0.01_f64.powi(2) + density).sqrt();
    assert!(expected > 3.0 * 0.01, "{expected}");
    close(field(&found.stdout, "gyroscope_noise_density:").to_degrees(), expected);
    let said = format!("N is {:.2} times that of the white noise alone", expected / 0.01);
    assert!(found.stderr.contains(&said) && found.stdout.contains(&said), "{said}: {}", found.stderr);
}

/// N of a band limit keeps its interval beside the floor that a filter needs, a hundredth of it at most; beside
/// white noise that counts there is none.
#[test]
fn a_band_limit_gives_n_with_its_interval() {
    let bench = bench();
    let white = r#""white": {"density": {"value": 0.0562, "unit": "deg/s/sqrt(Hz)", "interval": [0.0555, 0.0569]}}"#;
    let limited = |floor: f64| {
        GYRO.replace(
            white,
            &format!(
                r#""white": {{"density": "{floor} deg/s/sqrt(Hz)"}}, "band_limit": {{"density": {{"value": 0.0562, "unit": "deg/s/sqrt(Hz)", "interval": [0.0555, 0.0569]}}, "numerator": [1, 0.5], "denominator": [1, -0.5]}}"#
            ),
        )
    };
    for (floor, told) in [(5e-4, true), (6e-4, false), (0.03, false)] {
        bench.file("limited.json", limited(floor));
        let text = bench.ok("export limited.json --to kalibr");
        close(field(&text, "gyroscope_noise_density:").to_degrees(), 0.0562_f64.hypot(floor));
        // 0.0555 deg/s/sqrt(Hz) in rad
        assert_eq!(text.contains("9.68657735e-04"), told, "{floor}: {text}");
    }
}

/// One number for three axes, walks and their price, what is left out, and ranges.
#[test]
fn choices_are_said_in_the_file() {
    let bench = bench();
    let three = GYRO.replace(
        "\"axes\": [",
        r#""axes": [{"name": "x", "white": {"density": "0.03 deg/s/sqrt(Hz)"}, "oscillation": {"std_dev": "0.1 deg/s", "frequency": "20 Hz", "correlation_time": "1 s"}},
        {"name": "y", "white": {"density": "0.04 deg/s/sqrt(Hz)"}, "rate_random_walk": {"density": "0.001 deg/s/sqrt(s)"}},"#,
    );
    bench.file("three.json", three);
    let of = |axis: &str| {
        let text = bench.ok(&format!("export three.json --to kalibr --axis {axis}"));
        (field(&text, "gyroscope_noise_density:").to_degrees(), text)
    };
    let (worst, text) = of("worst");
    close(worst, 0.0562);
    assert!(text.contains("left out, no field for it: oscillation") && text.contains("the largest"), "{text}");
    // what the line of x has at low frequencies
    let line = 2.0 * 0.1_f64.powi(2) / (1.0 + (std::f64::consts::TAU * 20.0).powi(2));
    let mean = ((0.03_f64.powi(2) + line + 0.04_f64.powi(2) + 0.0562_f64.powi(2)) / 3.0).sqrt();
    assert!((of("mean").0 / mean - 1.0).abs() < 1e-4, "{} and {mean}", of("mean").0);
    close(of("y").0, 0.04);
    let tight = bench.run("export gyro.json --to px4 --inflate 1000");
    assert!(tight.stderr.contains("EKF2_GYR_NOISE would be 9.80875040e+00, outside its range"), "{}", tight.stderr);
    for (args, words) in [
        ("export gyro.json --to kalibr --axis w", "--axis w: the axes are z"),
        ("export gyro.json --to kalibr --walk long", "expected least, short or horizon=TIME"),
        ("export gyro.json --to kalibr --walk horizon=3", "--walk horizon 3"),
        ("export gyro.json --to kalibr --inflate 0", "--inflate 0: expected a number above zero"),
        ("export gyro.json --to kalibr --accelerometer gyro.json", "expected a specific force"),
        ("export gyro.json --to kaliber", "possible values"),
        ("export none.json --to kalibr", "none.json: cannot read"),
        ("export gyro.json --to kalibr -o gyro.json", "gyro.json"),
    ] {
        let out = bench.run(args);
        let line = out.stderr.lines().last().unwrap_or_default();
        assert!(out.status == 2 && line.starts_with("kfdesign: ") && line.contains(words), "{args}: {}", out.stderr);
    }
}

/// The commands of docs/ulog-to-ekf2.md on the real log, and the parameters that the page shows.
#[test]
fn the_story_from_a_ulog_to_ekf2_is_true() {
    let Some(log) = measured("formats/ulog/pyulog_sample.ulg") else { return };
    let page =
        std::fs::read_to_string(std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/ulog-to-ekf2.md")).unwrap();
    let bench = Bench::new();
    std::fs::copy(log, bench.path("sample.ulg")).unwrap();
    let story = page.split("## Why not").next().unwrap();
    for line in story.lines().filter_map(|line| line.strip_prefix("$ kfdesign ")) {
        bench.ok(line);
    }
    let written = bench.read("ekf2.params");
    let shown: Vec<&str> = page.lines().filter(|line| line.starts_with("1\t1\t")).take(4).collect();
    let found: Vec<&str> = written.lines().filter(|line| line.starts_with("1\t1\t")).collect();
    assert_eq!(
        found.iter().map(|line| line.split('\t').nth(2)).collect::<Vec<_>>(),
        shown.iter().map(|line| line.split('\t').nth(2)).collect::<Vec<_>>()
    );
    for (found, shown) in found.iter().zip(shown) {
        let number = |line: &str| line.split('\t').nth(3).unwrap().parse::<f64>().unwrap();
        // a fit: another machine rounds otherwise
        assert!((number(found) / number(shown) - 1.0).abs() < 1e-4, "{found}: {shown}");
    }
    // 6.82e-5 rad/s/sqrt(Hz) over sqrt(10 ms)
    assert!((number_of(&written, "EKF2_GYR_NOISE") / 6.82e-4 - 1.0).abs() < 1e-3);
}

fn number_of(params: &str, name: &str) -> f64 {
    let line = params.lines().find(|line| line.split('\t').nth(2) == Some(name)).unwrap();
    line.split('\t').nth(3).unwrap().parse().unwrap()
}
