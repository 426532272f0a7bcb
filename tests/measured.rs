//! The whole chain (identify, tune, replay) on measured logs: skipped with a printed line where the logs are not, see `support::measured`.

use serde_json::Value;

use crate::support::{Bench, Outcome, measured};

/// One sensor of one measured log: how it is read, and the white density its Allan deviation at 1 s shows (log unit), per axis,
/// computed independently from the raw numbers (see the data's own page); zero where none is stated.
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

/// Density at low frequency of white noise and averaged noise together.
fn wideband(axis: &Value) -> f64 {
    let of = |kind: &str| axis[kind]["density"]["value"].as_f64().unwrap_or(0.0);
    of("white").hypot(of("moving_average"))
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
            // the Allan deviation at 1 s carries some drift and flicker beside the white noise, and a sampling error of up to 10 %
            // in a log of a minute; a wrong unit or a factor of √2 is far outside
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
