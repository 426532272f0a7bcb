//! The whole chain (identify, tune, replay) on measured logs: skipped with a printed line where the logs are not,
//! see `support::measured`.

use serde_json::Value;

use crate::support::{Bench, Outcome, measured};

/// One sensor of one measured log: how it is read, and the white density its Allan deviation at 1 s shows (log
/// unit), per axis, computed independently from the raw numbers (see the data's own page); zero where none is
/// stated.
struct Log {
    label: &'static str,
    path: &'static str,
    flags: &'static str,
    white: [f64; 3],
}

const LOGS: [Log; 9] = [
    Log {
        label: "ADIS16405 gyro",
        path: "static/SMAC-Group_imudata/adis16405_recording1.csv.gz",
        flags: "--rate 100 --sensor gyro",
        white: [0.0409, 0.0430, 0.0387],
    },
    Log {
        label: "ADIS16405 accel",
        path: "static/SMAC-Group_imudata/adis16405_recording1.csv.gz",
        flags: "--rate 100 --sensor accel",
        white: [0.0; 3],
    },
    Log {
        label: "MPU6050 10 min gyro",
        path: "static/sunsided_sensor-fusion/derived/set-2_unmoved-with-x-pointing-forward-10min.csv.gz",
        flags: "--sensor gyro",
        white: [0.0129, 0.0092, 0.0094],
    },
    Log {
        label: "MPU6050 10 min accel",
        path: "static/sunsided_sensor-fusion/derived/set-2_unmoved-with-x-pointing-forward-10min.csv.gz",
        flags: "--sensor accel",
        white: [0.0; 3],
    },
    Log {
        label: "MPU6050 2 min gyro",
        path: "static/sunsided_sensor-fusion/derived/set-2_unmoved-with-x-pointing-forward.csv.gz",
        flags: "--sensor gyro",
        white: [0.0133, 0.0088, 0.0086],
    },
    Log {
        label: "MPU6050 2 min accel",
        path: "static/sunsided_sensor-fusion/derived/set-2_unmoved-with-x-pointing-forward.csv.gz",
        flags: "--sensor accel",
        white: [0.0; 3],
    },
    Log {
        label: "MPU6050 1 min gyro",
        path: "static/sunsided_sensor-fusion/derived/set-1_unmoved-z-pointing-left.csv.gz",
        flags: "--sensor gyro --end 62.6 --rate 100.3",
        white: [0.0128, 0.0078, 0.0081],
    },
    Log {
        label: "MPU-6050 raw gyro",
        path: "static/tomisuarez2_ImuCalibration/example_data_tinit_calc.csv",
        flags: "--rate 100 --columns gx,gy,gz --unit|1/131 deg/s",
        white: [0.0075, 0.0112, 0.0092],
    },
    Log {
        label: "MPU-6050 raw accel",
        path: "static/tomisuarez2_ImuCalibration/example_data_tinit_calc.csv",
        flags: "--rate 100 --columns ax,ay,az --unit|1/16384 g",
        white: [0.0; 3],
    },
];

/// Identify, tune, replay one log; the three documents.
struct Chain {
    identified: Value,
    replayed: Value,
    statuses: [i32; 3],
}

fn run(bench: &Bench, verb: &str, files: &[&str], log: &Log, more: &[&str]) -> Outcome {
    // words of the flags are parted by spaces, a value with a space in it stands behind '|'
    let flags: Vec<&str> = match log.flags.split_once('|') {
        Some((words, value)) => words.split_whitespace().chain([value]).collect(),
        None => log.flags.split_whitespace().collect(),
    };
    let args: Vec<&str> =
        std::iter::once(verb).chain(files.iter().copied()).chain(flags).chain(more.iter().copied()).collect();
    bench.run_args(&args)
}

fn chain(bench: &Bench, log: &Log, path: &str) -> Chain {
    let identify = run(bench, "identify", &[path], log, &["-o", "params.json", "--json"]);
    assert_eq!(identify.status, 0, "{}: {}", log.label, identify.stderr);
    let tune = bench.run("tune params.json -o filter.json");
    assert!(tune.status < 2, "{}: {}", log.label, tune.stderr);
    let replay = run(bench, "replay", &["filter.json", path], log, &["--json"]);
    assert!(replay.status < 2, "{}: {}", log.label, replay.stderr);
    Chain {
        identified: serde_json::from_str(&identify.stdout).unwrap(),
        replayed: serde_json::from_str(&replay.stdout).unwrap(),
        statuses: [identify.status, tune.status, replay.status],
    }
}

/// Value and interval of a parameter.
fn parameter(value: &Value) -> Option<(f64, [f64; 2], &str)> {
    let interval = value.get("interval")?;
    Some((value["value"].as_f64()?, [interval[0].as_f64()?, interval[1].as_f64()?], value["unit"].as_str()?))
}

/// Everything about one axis in words: drift terms with intervals.
fn drift(axis: &Value) -> String {
    let mut words = Vec::new();
    let mut show = |name: &str, value: &Value| {
        if let Some((value, [lower, upper], unit)) = parameter(value) {
            words.push(format!("{name} {value:.2e} [{lower:.1e}, {upper:.1e}] {unit}"));
        }
    };
    show("flicker", &axis["bias_instability"]["coefficient"]);
    for term in axis["gauss_markov"].as_array().into_iter().flatten() {
        show("GM σ", &term["std_dev"]);
        show("Tc", &term["correlation_time"]);
    }
    show("walk", &axis["rate_random_walk"]["density"]);
    show("ramp", &axis["rate_ramp"]["slope"]);
    show("quantisation", &axis["quantization"]["coefficient"]);
    words.join("; ")
}

/// The failed tests of one axis in a few words.
fn failures(replayed: &Value, axis: &str) -> String {
    let mut words: Vec<String> = replayed["tests"]
        .as_array()
        .into_iter()
        .flatten()
        .filter(|t| t["axis"] == axis && t["pass"] == false)
        .map(|t| {
            format!("{} {:.3}", t["name"].as_str().unwrap_or("?"), t["effect"]["value"].as_f64().unwrap_or(f64::NAN))
        })
        .collect();
    words.dedup();
    words.join(", ")
}

/// Density at low frequency of white noise, averaged and filtered noise together.
fn wideband(axis: &Value) -> f64 {
    let of = |kind: &str| axis[kind]["density"]["value"].as_f64().unwrap_or(0.0);
    of("white").hypot(of("moving_average")).hypot(of("band_limit"))
}

#[test]
fn the_chain_says_something_true_of_every_measured_log() {
    for log in &LOGS {
        let Some(path) = measured(log.path) else { return };
        let bench = Bench::new();
        let chain = chain(&bench, log, &path.display().to_string());
        let axes = chain.identified["params"]["axes"].as_array().unwrap();
        assert_eq!(axes.len(), 3, "{}", log.label);
        for (axis, expected) in axes.iter().zip(log.white) {
            let value = wideband(axis);
            // the Allan deviation at 1 s carries some drift and flicker beside the white noise, and a sampling error
            // of up to 10 % in a log of a minute; a wrong unit or a factor of √2 is far outside
            assert!(
                expected == 0.0 || (value / expected - 0.95).abs() < 0.25,
                "{}: wideband density {value}, Allan deviation at 1 s {expected}",
                log.label
            );
        }
        // exit status and verdict say the same
        let inconsistent = chain.replayed["verdict"] == "inconsistent";
        assert_eq!(chain.statuses[2] == 1, inconsistent, "{}", log.label);
        let failed = chain.replayed["tests"].as_array().unwrap().iter().any(|t| t["pass"] == false);
        assert_eq!(failed, inconsistent, "{}", log.label);
    }
}

/// `cargo test --release -- --ignored --nocapture table_of_measured_logs` prints the table of docs/validation.md.
#[test]
#[ignore = "prints a table for docs/validation.md; the chain itself is tested above"]
fn table_of_measured_logs() {
    println!(
        "| log | axis | Hz | s | white N [95 %] | drift [95 %] | NIS | max \\|r\\| (lag) | verdict | failed tests (effect) |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |");
    for log in &LOGS {
        let Some(path) = measured(log.path) else { return };
        let bench = Bench::new();
        let chain = chain(&bench, log, &path.display().to_string());
        let rate = chain.identified["params"]["sample_rate"]["value"].as_f64().unwrap();
        let span = chain.identified["params"]["source"]["span"]["value"].as_f64().unwrap();
        for (axis, replay) in chain.identified["params"]["axes"]
            .as_array()
            .unwrap()
            .iter()
            .zip(chain.replayed["axes"].as_array().unwrap())
        {
            let name = axis["name"].as_str().unwrap();
            let unit = axis["white"]["density"]["unit"].as_str().unwrap();
            println!(
                "| {} | {name} | {rate:.2} | {span:.0} | {:.4e} {unit} | {} | {:.3} | {:.3} ({}) | {} | {} |",
                log.label,
                wideband(axis),
                drift(axis),
                replay["nis"]["mean"].as_f64().unwrap_or(f64::NAN),
                replay["whiteness"]["max_abs_autocorrelation"].as_f64().unwrap_or(f64::NAN),
                replay["whiteness"]["lag"],
                chain.replayed["verdict"].as_str().unwrap(),
                failures(&chain.replayed, name),
            );
        }
    }
}

const SUNSIDED: &str = "static/sunsided_sensor-fusion/";

/// Every resting log of the folder: label, file, flags, length in s that is used.
const RESTING: [(&str, &str, &str, f64); 16] = [
    ("ADIS16405 gyro", "adis", "--rate 100 --sensor gyro", 10_000.0),
    ("ADIS16405 accelerometer", "adis", "--rate 100 --sensor accel", 10_000.0),
    ("MPU6050 gyro, 10 min", "derived/set-2_unmoved-with-x-pointing-forward-10min.csv.gz", "--sensor gyro", 655.1),
    (
        "MPU6050 accelerometer, 10 min",
        "derived/set-2_unmoved-with-x-pointing-forward-10min.csv.gz",
        "--sensor accel",
        655.1,
    ),
    ("MPU6050 gyro, 2 min", "derived/set-2_unmoved-with-x-pointing-forward.csv.gz", "--sensor gyro", 123.2),
    ("MPU6050 accelerometer, 2 min", "derived/set-2_unmoved-with-x-pointing-forward.csv.gz", "--sensor accel", 123.2),
    (
        "MPU6050 gyro, 102 s",
        "set-2_unmoved-with-z-pointing-front-and-y-down/mpu6050_gyroscope.mat",
        "--columns 2,3,4 --rate 99.4 --unit deg/s",
        102.4,
    ),
    (
        "MPU6050 accelerometer, 102 s",
        "set-2_unmoved-with-z-pointing-front-and-y-down/mpu6050_accelerometer.mat",
        "--columns 2,3,4 --rate 99.4 --unit g",
        102.4,
    ),
    (
        "MPU6050 gyro, 64 s",
        "set-1_unmoved-x-pointing-forward/mpu6050_gyroscope.mat",
        "--columns 2,3,4 --rate 100.3 --unit deg/s",
        63.6,
    ),
    (
        "MPU6050 accelerometer, 64 s",
        "set-1_unmoved-x-pointing-forward/mpu6050_accelerometer.mat",
        "--columns 2,3,4 --rate 100.3 --unit g",
        63.6,
    ),
    ("MPU6050 gyro, 63 s", "derived/set-1_unmoved-z-pointing-left.csv.gz", "--sensor gyro --rate 100.3", 62.6),
    (
        "MPU6050 accelerometer, 63 s",
        "derived/set-1_unmoved-z-pointing-left.csv.gz",
        "--sensor accel --rate 100.3",
        62.6,
    ),
    ("MPU-6050 raw gyro, 449 s", "raw", "--rate 100 --columns gx,gy,gz --unit|1/131 deg/s", 449.3),
    ("MPU-6050 raw accelerometer, 449 s", "raw", "--rate 100 --columns ax,ay,az --unit|1/16384 g", 449.3),
    ("VN-310 gyro, 34 s", "vn", "--rate 20 --columns 17,18,19", 34.5),
    ("VN-310 accelerometer, 34 s", "vn", "--rate 20 --columns 14,15,16", 34.5),
];

const BROAD: [&str; 4] = [
    "motion/dlaidig_broad/02_undisturbed_slow_rotation_B.hdf5",
    "motion/dlaidig_broad/05_undisturbed_slow_rotation_with_breaks_B.hdf5",
    "motion/dlaidig_broad/07_undisturbed_fast_rotation_B.hdf5",
    "motion/dlaidig_broad/21_undisturbed_fast_combined.mat",
];
const GYRO: &str = "--unit|rad/s";
const ACCEL: &str = "--unit|m/s^2";
const XSENS_GYRO: &str = "--columns 2,3,4 --time 1:s --unit|1/6258 rad/s";
const XSENS_ACCEL: &str = "--columns 2,3,4 --time 1:s --unit|1/415 m/s^2";
const RAW: &str = "motion/tomisuarez2_ImuCalibration/example_data_calibration.csv";
const RAW_GYRO: &str = "--rate 100 --columns gx,gy,gz --unit|1/131 deg/s";
const RAW_ACCEL: &str = "--rate 100 --columns ax,ay,az --unit|1/16384 g";
const XSENS: [&str; 2] = ["motion/Kyle-ak_imu_tk/xsens_gyro.mat", "motion/Kyle-ak_imu_tk/xsens_acc.mat"];

/// Parts of moving logs that are at rest, by the page of the data: label, file, the parts in s.
const PARTS: [(&str, &str, &[[f64; 2]]); 7] = [
    ("aktos-t, trial 02", BROAD[0], &[[1.0, 38.0], [155.0, 184.0]]),
    ("aktos-t, trial 05", BROAD[1], &[[1.0, 33.0], [103.0, 122.0], [181.0, 205.0]]),
    ("aktos-t, trial 07", BROAD[2], &[[1.0, 24.0], [146.0, 181.0]]),
    ("aktos-t, trial 21", BROAD[3], &[[1.0, 34.0], [156.0, 185.0]]),
    ("Xsens MTi gyro", XSENS[0], &[[1.0, 50.0]]),
    ("Xsens MTi accelerometer", XSENS[1], &[[1.0, 50.0]]),
    ("MPU-6050 raw", RAW, &[[0.0, 36.0]]),
];

/// The flags of the sensors of one of [`PARTS`].
fn sensors(file: &str) -> Vec<(&'static str, &'static str)> {
    match file {
        _ if file == XSENS[0] => vec![("", XSENS_GYRO)],
        _ if file == XSENS[1] => vec![("", XSENS_ACCEL)],
        RAW => vec![(" gyro", RAW_GYRO), (" accelerometer", RAW_ACCEL)],
        _ => vec![(" gyro", GYRO), (" accelerometer", ACCEL)],
    }
}

/// The flags that the check of a moving log names leave a part that is at rest by the page of the data, which says
/// whole seconds, and half a minute or more of it.
#[test]
fn the_calmest_part_of_a_moving_log_is_one_of_its_rests() {
    let rests: [&[[f64; 2]]; 7] = [
        &[[0.0, 40.0], [153.0, 186.4]],
        &[[0.0, 35.0], [68.0, 76.0], [101.0, 125.0], [147.0, 157.0], [179.0, 207.3]],
        &[[0.0, 26.0], [144.0, 183.9]],
        &[[0.0, 36.0], [154.0, 187.7]],
        &[[0.0, 52.0]],
        &[[0.0, 52.0]],
        &[[0.0, 36.5]],
    ];
    for ((label, file, _), rests) in PARTS.iter().zip(rests) {
        let Some(path) = measured(file) else { return };
        let path = path.display().to_string();
        let bench = Bench::new();
        for (sensor, flags) in sensors(file) {
            let log = Log { label: "", path: "", flags, white: [0.0; 3] };
            let out = run(&bench, "allan", &[&path], &log, &[]);
            let says = |text: &str| text.lines().filter(|l| l.contains("calmest on every axis")).count();
            assert_eq!(says(&out.stderr), 1, "{label}{sensor}: {}", out.stderr);
            let line = out.stderr.lines().find(|l| l.contains("calmest on every axis")).unwrap();
            let words: Vec<&str> = line.split_whitespace().collect();
            let after = |flag: &str| words.iter().position(|w| *w == flag).map(|i| words[i + 1]);
            let (start, end) = (after("--start"), after("--end"));
            let seconds = |text: Option<&str>, none: f64| text.map_or(none, |t| t.parse::<f64>().unwrap());
            let (from, to) = (seconds(start, 0.0), seconds(end, rests.last().unwrap()[1]));
            assert!(
                to - from > 30.0 && rests.iter().any(|[first, last]| first - 1.0 < from && to < last + 1.0),
                "{label}{sensor}: {line}"
            );
            // with these flags there is nothing left to cut
            let cut: Vec<&str> =
                [("--start", start), ("--end", end)].into_iter().filter_map(|(f, v)| Some([f, v?])).flatten().collect();
            let out = run(&bench, "allan", &[&path], &log, &cut);
            assert!(!out.stderr.contains("windows of") && says(&out.stderr) == 0, "{label}{sensor}: {}", out.stderr);
        }
    }
}

/// Axes that keep the bounds on the innovations: at 5 % and at 1 % for each, and at 1 % for all; as designed,
/// followed, by their own parameters.
type Kept = [[usize; 3]; 3];

/// Parameters from one half of each log, innovations of the other: `cargo test --release -- --ignored --nocapture
/// table_of_halves` prints the table of docs/validation.md. Outliers are left out where the command says that there
/// are some.
#[test]
#[ignore = "prints a table for docs/validation.md"]
fn table_of_halves() {
    let mut kept = Kept::default();
    print_head();
    for (label, file, flags, span_s) in RESTING {
        let relative = match file {
            "adis" => LOGS[0].path.to_string(),
            "raw" => LOGS[7].path.to_string(),
            "vn" => "static/UniStuttgart-INS_INSTINCT/vn310-imu.csv".into(),
            file => format!("{SUNSIDED}{file}"),
        };
        let Some(path) = measured(&relative) else { return };
        print_halves(label, &path.display().to_string(), flags, [0.0, span_s], &mut kept);
    }
    println!("kept by the bounds at 5 % and 1 % for each axis and 1 % for all: as designed, followed, own {kept:?}");
}

/// The same of the resting parts of moving logs.
#[test]
#[ignore = "prints a table for docs/validation.md"]
fn table_of_halves_of_resting_parts() {
    let mut kept = Kept::default();
    print_head();
    for (label, file, parts) in PARTS {
        let Some(path) = measured(file) else { return };
        for part in parts {
            for (sensor, flags) in sensors(file) {
                let label = format!("{label}{sensor}, {} to {} s", part[0], part[1]);
                print_halves(&label, &path.display().to_string(), flags, *part, &mut kept);
            }
        }
    }
    println!("kept by the bounds at 5 % and 1 % for each axis and 1 % for all: as designed, followed, own {kept:?}");
}

fn print_head() {
    println!(
        "| log | axis | n | model | first half on second: max \\|r\\| (lag), NIS | followed | its own parameters | said |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- | --- |");
}

fn print_halves(label: &str, path: &str, flags: &'static str, [from, to]: [f64; 2], kept: &mut Kept) {
    let log = Log { label: "", path: "", flags, white: [0.0; 3] };
    let bench = Bench::new();
    let [start, half, end] = [from, 0.5 * (from + to), to].map(|t| t.to_string());
    let second = ["--start", half.as_str(), "--end", end.as_str()];
    let json = |outcome: &Outcome| serde_json::from_str::<Value>(&outcome.stdout).unwrap();
    let chain = |part: &[&str]| {
        let identify = |more: &[&str]| {
            let all = [part, &["-o", "params.json", "--json"], more].concat();
            json(&run(&bench, "identify", &[path], &log, &all))
        };
        let mut found = identify(&[]);
        let outliers = |axis: &Value| axis["warnings"].to_string().contains("`without_outliers` leaves them out");
        if found["axes"].as_array().unwrap().iter().any(outliers) {
            found = identify(&["--without-outliers"]);
        }
        let tune = bench.run("tune params.json -o filter.json");
        assert!(tune.status < 2, "{label}: {}", tune.stderr);
        let replay = |more: &[&str]| {
            json(&run(&bench, "replay", &["filter.json", path], &log, &[&second[..], &["--json"], more].concat()))
        };
        // the memory is the log that was identified, at most 1000 s
        let memory = format!("{}s", f64::min(0.5 * (to - from), 1000.0));
        (found, replay(&[]), replay(&["--follow", &memory]))
    };
    let (found, replayed, followed) = chain(&["--start", &start, "--end", &half]);
    let (_, own, _) = chain(&second);
    for i in 0..3 {
        let result = |document: &Value| {
            let axis = &document["axes"][i];
            let [r, nis] = [&axis["whiteness"]["max_abs_autocorrelation"], &axis["nis"]["mean"]].map(|v| v.as_f64());
            format!("{:.4} ({}), {:.3}", r.unwrap_or(f64::NAN), axis["whiteness"]["lag"], nis.unwrap_or(f64::NAN))
        };
        // the factors of docs/validation.md
        for (kept, document) in kept.iter_mut().zip([&replayed, &followed, &own]) {
            let axis = &document["axes"][i];
            let n = axis["accepted"].as_f64().unwrap();
            let r = axis["whiteness"]["max_abs_autocorrelation"].as_f64().unwrap();
            let nis = (axis["nis"]["mean"].as_f64().unwrap() - 1.0).abs();
            for (kept, [of_r, of_nis]) in kept.iter_mut().zip([[3.3, 3.3 * 2_f64.sqrt()], [3.72, 5.16], [4.60, 7.42]]) {
                *kept += usize::from(r <= f64::max(0.01, of_r / n.sqrt()) && nis <= f64::max(0.02, of_nis / n.sqrt()));
            }
        }
        let axis = &found["axes"][i];
        let model = axis["candidates"]
            .as_array()
            .unwrap()
            .iter()
            .find(|c| c["chosen"] == true)
            .map_or("", |c| c["model"].as_str().unwrap_or(""));
        let words = axis["warnings"].to_string();
        let said =
            ["noise changes", "outliers", "level moves", "not at rest"].map(|w| if words.contains(w) { w } else { "" });
        println!(
            "| {label} | {} | {} | {model} | {} | {} | {} | {} |",
            ["x", "y", "z"][i],
            replayed["axes"][i]["samples"],
            result(&replayed),
            result(&followed),
            result(&own),
            said.iter().filter(|w| !w.is_empty()).copied().collect::<Vec<_>>().join(", ")
        );
    }
}
