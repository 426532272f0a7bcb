//! The walk that a program's filter is given: its price, what is done where no drift is known, and where in the file
//! the numbers stand.

use kfdesign::noise::{NoiseModel, Term};
use kfdesign::params::Params;
use kfdesign::units::Quantity;

use super::{GYRO, close, field};
use crate::support::{Bench, data, measured};

/// Consumers that take a random walk, with the fields of gyro and accelerometer.
const WALKS: [(&str, &str, &str); 7] = [
    ("kalibr", "gyroscope_random_walk:", "accelerometer_random_walk:"),
    ("openvins", "gyroscope_random_walk:", "accelerometer_random_walk:"),
    ("vins", "gyr_w:", "acc_w:"),
    ("orbslam3", "IMU.GyroWalk:", "IMU.AccWalk:"),
    ("gtsam", "setBiasOmegaCovariance(", "setBiasAccCovariance("),
    ("px4", "EKF2_GYR_B_NOISE\t", "EKF2_ACC_B_NOISE\t"),
    ("ardupilot", "EK3_GBIAS_P_NSE,", "EK3_ABIAS_P_NSE,"),
];

/// "price A settled, B in the first minute … least possible C" of the first sensor: the larger of A and B, and C.
fn price(text: &str) -> [f64; 2] {
    let [settled, start] = ["price ", "settled, "].map(|key| field(&text.replace("# gyro", "gyro"), key));
    [settled.max(start), field(&text.replace("# gyro", "gyro"), "least possible ")]
}

/// The default walk of every shipped sensor costs every consumer's filter at most 10 % of error and no other rule
/// costs less; no value is clamped but one that is truly below its range, and a walk of more than 1.3 times the
/// error is said on stderr, of every consumer.
#[test]
fn the_default_walk_costs_least() {
    let bench = Bench::new();
    let shipped =
        ["sensors/analog-devices-adis16505-1", "sensors/invensense-mpu-6000", "sensors/kvh-dsp-1760", "params"];
    for sensor in shipped {
        bench.file("sensor.json", std::fs::read_to_string(data(&format!("{sensor}.json"))).unwrap());
        for (target, name, _) in WALKS {
            let run = |walk: &str| bench.run(&format!("export sensor.json --axis x --to {target} {walk}"));
            let told = run("");
            let [cost, least] = price(&told.stdout);
            let outside = format!("{} would be", name.trim_end_matches(['\t', ',', ':', '(']));
            let clamped = told.stderr.contains(&outside);
            assert!(clamped || cost < 1.1 && cost < least + 0.0015, "{sensor} {target}: {cost} {least}");
            assert_eq!(told.stderr.contains("the walk of the gyro costs"), cost > 1.3, "{}", told.stderr);
            // truly below EKF3's range: two of MEMS by a little, and the fibre-optic gyro
            assert!(!clamped || target == "ardupilot" && field(&told.stdout, name) <= 1e-5, "{}", told.stderr);
            for other in ["short", "horizon=10s", "horizon=60s", "horizon=1000s"] {
                let told = run(&format!("--walk {other}"));
                let [other_cost, other_least] = price(&told.stdout);
                assert!(
                    other_cost > cost - 0.0015 && other_least < least + 0.0015,
                    "{sensor} {target} {other}: {other_cost} {cost}"
                );
                assert_eq!(told.stderr.contains("the walk of the gyro costs"), other_cost > 1.3, "{}", told.stderr);
            }
        }
    }
    // the sum over the fastest flicker, which was the default, is no walk for any filter
    bench.file("mpu.json", std::fs::read_to_string(data("sensors/invensense-mpu-6000.json")).unwrap());
    let told = bench.run("export mpu.json --to kalibr --walk short");
    assert!(price(&told.stdout)[0] > 1.3, "{}", told.stdout);
    // a datasheet is no log at rest
    assert!(
        told.stdout.contains("# given, not from a log: a lower bound") && !told.stdout.contains("identified at rest")
    );
}

/// A log in which no drift was found: a program with a default keeps it, one that needs a number gets the 95 % limit
/// of `identify`, and without a limit the export is refused. 200 s of white noise end in one of these, never in a
/// zero.
#[test]
fn no_drift_found_is_not_zero_drift() {
    let bench = Bench::new();
    let drift = r#""gauss_markov": {"std_dev": "0.0280596 deg/s", "correlation_time": "193.9312 s"}"#;
    let unknown = |limit: &str| {
        GYRO.replace(
            drift,
            &format!(r#""not_identified": [{{"term": "rate_random_walk", "reason": "none is seen"{limit}}}]"#),
        )
    };
    bench.file("limited.json", unknown(r#", "upper_limit": "0.002 deg/s^2/sqrt(Hz)""#));
    bench.file("sheet.json", unknown(""));
    let limit = 0.002_f64.to_radians();
    let zero =
        |text: &str, key: &str| text.lines().any(|l| l.contains(key) && !l.starts_with('#') && field(l, key) == 0.0);
    for (target, name, _) in WALKS {
        let run = |file: &str, flag: &str| bench.run(&format!("export {file}.json --to {target} {flag}"));
        let (told, sheet, forced) = (run("limited", ""), run("sheet", ""), run("sheet", "--allow-zero-walk"));
        assert!(forced.status == 0 && forced.stderr.contains("--allow-zero-walk was given"), "{}", forced.stderr);
        if matches!(target, "px4" | "ardupilot") {
            for out in [told, sheet] {
                let there = out.stdout.lines().any(|l| l.contains(name) && !l.starts_with('#'));
                assert!(out.status == 0 && !there && out.stdout.contains("EK"), "{target}: {}", out.stdout);
                let words = "no drift is known; left out, so that the default stays";
                assert!(out.stdout.contains(words) && out.stderr.contains(words), "{target}: {}", out.stderr);
            }
            continue;
        }
        assert!(zero(&forced.stdout, name), "{target}: {}", forced.stdout);
        let expected = match target {
            "gtsam" => limit * limit,
            "vins" => limit * 10.0,
            _ => limit,
        };
        close(field(&told.stdout, name), expected);
        let words = "no drift was found; 3.49065850e-05 rad/s^2/sqrt(Hz) is its 95 % upper limit, not an estimate";
        assert!(told.stdout.contains(words) && told.stderr.contains(words), "{target}: {}{}", told.stdout, told.stderr);
        let words = "have no drift and no upper limit of one";
        assert!(
            sheet.status == 2 && sheet.stdout.is_empty() && sheet.stderr.contains(words),
            "{target}: {}",
            sheet.stderr
        );
    }
    // simulators: a field for a walk, or a process that is a walk up to 10 000 s: sigma = K sqrt(Tc/2)
    close(field(&bench.ok("export limited.json --to navego"), "imu.rrw = "), limit);
    close(field(&bench.ok("export limited.json --to matlab"), "'RandomWalk', ["), limit);
    let text = bench.ok("export limited.json --to gnss-ins-sim");
    close(field(&text, "'gyro_b_stability': np.array(["), (0.002 * 5000_f64.sqrt()) * 3600.0);
    assert!(bench.ok("export limited.json --to gazebo").contains("left out, so that the default stays"));
    for target in ["navego", "matlab", "gnss-ins-sim"] {
        assert_eq!(bench.run(&format!("export sheet.json --to {target}")).status, 2, "{target}");
        assert_eq!(bench.run(&format!("export sheet.json --to {target} --allow-zero-walk")).status, 0, "{target}");
    }
    // the whole way
    bench.file("white.json", GYRO.replace(drift, r#""bias": "0 deg/s""#));
    bench.ok("simulate white.json -o white.npy --duration 200s --seed 5");
    bench.ok("identify white.npy -o found.json");
    let found = bench.read("found.json");
    assert!(found.contains("upper_limit"), "{found}");
    let told = bench.run("export found.json --to kalibr");
    assert!(field(&told.stdout, "gyroscope_random_walk:") > 0.0, "{}", told.stdout);
    assert!(!bench.ok("export found.json --to px4").contains("EKF2_GYR_B_NOISE\t"));
}

/// At most ten lines of comment stand before the first value, of two sensors with flicker on three axes, measured
/// inflation and factors.
#[test]
fn the_numbers_are_at_the_top() {
    let bench = Bench::new();
    let gyro = std::fs::read_to_string(data("sensors/invensense-mpu-6000.json")).unwrap();
    bench.file("gyro.json", &gyro);
    bench.file(
        "acc.json",
        gyro.replace("angular-rate", "specific-force").replace("deg/sqrt(h)", "m/s/sqrt(h)").replace("deg/h", "m/s^2"),
    );
    for (target, _, _) in
        WALKS.iter().copied().chain(["matlab", "gnss-ins-sim", "navego", "gazebo"].map(|t| (t, "", "")))
    {
        let told = bench.run(&format!("export gyro.json --accelerometer acc.json --to {target} --inflate 3"));
        assert_eq!(told.status, 0, "{}", told.stderr);
        let comment = |line: &&str| {
            line.starts_with(['#', '%', '<', ' ', '-']) && !line.starts_with("<g") && !line.starts_with("%YAML")
        };
        let before = told.stdout.lines().filter(|line| !line.starts_with("%YAML")).take_while(comment).count();
        let brackets = if target == "gazebo" { 2 } else { 0 };
        assert!((4..=10 + brackets).contains(&before), "{target}: {before} in {}", told.stdout);
    }
}

/// The one Gauss-Markov process of a simulator: with the white noise its Allan deviation is the sensor's within the
/// factor that the file states, at averages from a sample to 10 000 s; for flicker no process does better by another
/// time (a factor of two) or size (10 %).
#[test]
fn one_process_stands_for_flicker() {
    let bench = Bench::new();
    bench.file("gyro.json", std::fs::read_to_string(data("sensors/invensense-mpu-6000.json")).unwrap());
    let text = bench.ok("export gyro.json --to navego");
    let [n, sigma, tc] = ["imu.arw = ", "imu.gb_dyn = ", "imu.gb_corr = "].map(|key| field(&text, key));
    let stated = field(&text.replace("% gyro", "gyro"), "within a factor of ");
    let coefficient = (6.9248_f64 / 3600.0).to_radians();
    let of = |terms: Vec<Term>| {
        let model = NoiseModel { terms };
        (0..=48).map(|i| model.allan_variance(10f64.powf(f64::from(i) / 8.0).round() as u64, 0.01)).collect::<Vec<_>>()
    };
    let white = Term::White { density: n };
    let truth = of(vec![white, Term::BiasInstability { coefficient }]);
    let factor = |std_dev: f64, correlation_time: f64| {
        let found = of(vec![white, Term::GaussMarkov { std_dev, correlation_time }]);
        found.iter().zip(&truth).map(|(a, b)| (0.5 * (a / b).ln().abs()).exp()).fold(1.0, f64::max)
    };
    let found = factor(sigma, tc);
    assert!((found / stated - 1.0).abs() < 2e-3 && found < 1.5, "{found} {stated}");
    for other in [factor(1.1 * sigma, tc), factor(sigma / 1.1, tc), factor(sigma, 2.0 * tc), factor(sigma, tc / 2.0)] {
        assert!(other > found, "{other} {found}");
    }
}

/// The table of docs/export.md: for every shipped sensor and measured log the walk of three consumers, its price,
/// the least possible one, the rules that were the default and the one offered before, and the +1/2 line of the
/// Allan plot at 1000 s or a tenth of the log.
#[test]
#[ignore = "minutes: identifies every log at rest"]
fn table_of_walks() {
    let bench = Bench::new();
    let mut rows: Vec<(String, String)> = Vec::new();
    for name in [
        "sensors/analog-devices-adis16505-1",
        "sensors/invensense-mpu-6000",
        "sensors/kvh-dsp-1760",
        "params",
        "two_drifts",
    ] {
        let file = name.replace('/', "-") + ".json";
        bench.file(&file, std::fs::read_to_string(data(&format!("{name}.json"))).unwrap());
        rows.push((name.rsplit('/').next().unwrap().to_owned(), file));
    }
    for (name, log, flags) in LOGS {
        let Some(path) = measured(&format!("static/{log}")) else { return };
        let file = name.replace(' ', "-") + ".json";
        let path = path.display();
        let told = bench.run(&format!("identify {path} {flags} -o {file}"));
        if told.status == 2 {
            println!("{name}: {}", told.stderr);
            continue;
        }
        rows.push((name.to_owned(), file));
    }
    println!("| sensor | axis | px4 | ardupilot | kalibr | short: EKF2, Kalibr | 60 s: EKF2, Kalibr | +1/2 line |");
    for (name, file) in rows {
        let params = Params::from_json(&bench.read(&file), &file).unwrap();
        let span = params.source.as_ref().and_then(|s| s.span_s).unwrap_or(10_000.0);
        for axis in &params.axes {
            let dt = 1.0 / params.sample_rate_hz;
            let tau = (0.1 * span).min(1000.0);
            let half = axis.noise().allan_variance((tau / dt).round() as u64, dt).sqrt() * (3.0 / tau).sqrt();
            let cell = |target: &str, step: f64, rule: &str| {
                let told = bench.run(&format!("export {file} --to {target} --axis {} --walk {rule}", axis.name));
                let (_, gyro, accelerometer) = WALKS.into_iter().find(|(name, ..)| *name == target).unwrap();
                let key = if params.quantity == Quantity::AngularRate { gyro } else { accelerometer };
                let there = told.stdout.lines().any(|l| l.contains(key) && !l.starts_with('#'));
                let k = if there { field(&told.stdout, key) * step.sqrt() } else { f64::NAN };
                let own = format!("# {}: with this walk", axis.name);
                let line = told.stdout.lines().find_map(|line| line.strip_prefix(own.as_str()));
                let of = |key: &str| line.map_or(f64::NAN, |line| field(line, key));
                (k, of(" drift is ").max(of(" at most ")), of("costs less than "))
            };
            let programs = [("px4", 0.01), ("ardupilot", 0.012), ("kalibr", 1.0)];
            let defaults = programs.map(|(target, step)| {
                let (k, cost, least) = cell(target, step, "least");
                format!("{k:.1e}, {cost:.3} ({least:.3})")
            });
            let others = ["short", "horizon=60s"].map(|rule| {
                let ((_, px4, _), (k, kalibr, _)) = (cell("px4", 0.01, rule), cell("kalibr", 1.0, rule));
                format!("{k:.1e}: {px4:.2}, {kalibr:.2}")
            });
            println!("| {name} | {} | {} | {} | {half:.1e} |", axis.name, defaults.join(" | "), others.join(" | "));
        }
    }
}

/// Name, log, flags of `identify`.
const LOGS: [(&str, &str, &str); 6] = [
    ("ADIS16405 gyro", "SMAC-Group_imudata/adis16405_recording1.csv.gz", "--columns 1,2,3 --unit deg/s --rate 100"),
    (
        "ADIS16405 accelerometer",
        "SMAC-Group_imudata/adis16405_recording1.csv.gz",
        "--columns 4,5,6 --unit g --rate 100",
    ),
    (
        "MPU6050 gyro 655 s",
        "sunsided_sensor-fusion/derived/set-2_unmoved-with-x-pointing-forward-10min.csv.gz",
        "--columns gyr_x_dps,gyr_y_dps,gyr_z_dps --unit deg/s",
    ),
    (
        "MPU6050 accelerometer 655 s",
        "sunsided_sensor-fusion/derived/set-2_unmoved-with-x-pointing-forward-10min.csv.gz",
        "--columns acc_x_g,acc_y_g,acc_z_g --unit g",
    ),
    (
        "MPU6050 gyro 123 s",
        "sunsided_sensor-fusion/derived/set-2_unmoved-with-x-pointing-forward.csv.gz",
        "--columns gyr_x_dps,gyr_y_dps,gyr_z_dps --unit deg/s",
    ),
    (
        "MPU-6050 gyro 449 s",
        "tomisuarez2_ImuCalibration/example_data_tinit_calc.csv",
        "--columns gx,gy,gz --unit 1/131deg/s --rate 100",
    ),
];
