//! The simulator: truth adds up, streams are independent of everything else, and the command writes what the library
//! made.

use kfdesign::input::{self, LogOptions};
use kfdesign::noise::Kind;
use kfdesign::numerics::distribution::chi_square_quantile;
use kfdesign::numerics::reduce::Moments;
use kfdesign::params::Params;
use kfdesign::simulate::{AxisBlock, Scenario, Simulator, TURN_ON_BIAS, TrueRate, term_number};

use crate::support::{Bench, data};

/// Every kind of term on one axis, two Gauss–Markov processes, and a plain second axis.
const RICH: &str = r#"{
  "format": "kfdesign-params/1", "quantity": "angular-rate", "sample_rate": "50 Hz",
  "axes": [
    {"name": "x", "bias": "2 deg/s", "turn_on_bias": {"std_dev": "0.5 deg/s"},
     "quantization": {"coefficient": "0.001 deg"},
     "white": {"density": "0.05 deg/s/sqrt(Hz)"},
     "bias_instability": {"coefficient": "0.02 deg/s"},
     "gauss_markov": [{"std_dev": "0.03 deg/s", "correlation_time": "10 s"},
                      {"std_dev": "0.01 deg/s", "correlation_time": "200 s"}],
     "moving_average": {"density": "0.02 deg/s/sqrt(Hz)", "samples": 4},
     "oscillation": {"std_dev": "0.02 deg/s", "frequency": "7 Hz", "correlation_time": "3 s"},
     "rate_random_walk": {"density": "0.001 deg/s/sqrt(s)"},
     "rate_ramp": {"slope": "0.0001 deg/s^2"}},
    {"name": "y", "white": {"density": "0.05 deg/s/sqrt(Hz)"}}
  ]
}"#;

const DEGREE: f64 = std::f64::consts::PI / 180.0;

fn rich() -> Params {
    Params::from_json(RICH, "rich.json").unwrap()
}

fn scenario(samples: u64) -> Scenario {
    Scenario {
        seed: 1,
        run: 0,
        samples,
        rate_hz: 50.0,
        true_rate: TrueRate::Rest,
        turn_on: false,
        saturation: None,
        quantisation: None,
    }
}

/// The whole run, block by block.
fn simulate(params: &Params, scenario: &Scenario, block: usize) -> Vec<AxisBlock> {
    let mut simulator = Simulator::new(params, scenario).unwrap();
    let mut whole: Vec<AxisBlock> = Vec::new();
    let mut blocks = Vec::new();
    loop {
        let n = simulator.next_block(block, &mut blocks);
        if n == 0 {
            return whole;
        }
        whole.resize_with(blocks.len(), AxisBlock::default);
        for (all, part) in whole.iter_mut().zip(&blocks) {
            assert_eq!(part.measured.len(), n);
            all.measured.extend(&part.measured);
            all.true_rate.extend(&part.true_rate);
            all.drift.extend(&part.drift);
            all.bias = part.bias;
            all.terms.resize_with(part.terms.len(), Vec::new);
            for (all, part) in all.terms.iter_mut().zip(&part.terms) {
                all.extend(part);
            }
        }
    }
}

mod library {
    use super::*;

    #[test]
    fn measured_is_the_sum_of_its_truth() {
        let params = rich();
        let motion = TrueRate::Sinusoid { amplitude: 0.2, frequency_hz: 0.5 };
        let axes = simulate(&params, &Scenario { true_rate: motion, ..scenario(500) }, 64);
        let kinds: Vec<Kind> = params.axes[0].noise().terms.iter().map(|t| t.kind()).collect();
        assert_eq!(kinds.len(), 9);
        let x = &axes[0];
        assert!((x.bias - 2.0 * DEGREE).abs() < 1e-15);
        for k in 0..500 {
            let terms: f64 = x.terms.iter().map(|t| t[k]).sum();
            assert!((x.measured[k] - (x.true_rate[k] + x.bias + terms)).abs() < 1e-15, "sample {k}");
            let drift: f64 = x
                .terms
                .iter()
                .zip(&kinds)
                .filter(|(_, kind)| {
                    !matches!(
                        kind,
                        Kind::White | Kind::Quantization | Kind::MovingAverage | Kind::BandLimit | Kind::Oscillation
                    )
                })
                .map(|(t, _)| t[k])
                .sum();
            assert!((x.drift[k] - drift).abs() < 1e-15, "sample {k}");
            let expected = 0.2 * (2.0 * std::f64::consts::PI * 0.5 * k as f64 / 50.0).sin();
            assert!((x.true_rate[k] - expected).abs() < 1e-13, "sample {k}");
        }
        assert!(axes[1].drift.iter().all(|d| *d == 0.0) && axes[1].bias == 0.0);
    }

    #[test]
    fn blocks_do_not_matter() {
        let params = rich();
        let motion = TrueRate::Samples(vec![(0..1000).map(f64::from).collect()]);
        let scenario = Scenario { true_rate: motion, ..scenario(1000) };
        let whole = simulate(&params, &scenario, 1000);
        assert_eq!(whole[1].true_rate[999], 999.0);
        for block in [1, 7, 999, 5000] {
            let parts = simulate(&params, &scenario, block);
            for (a, b) in whole.iter().zip(&parts) {
                assert_eq!((&a.measured, &a.drift, &a.true_rate), (&b.measured, &b.drift, &b.true_rate), "{block}");
            }
        }
    }

    #[test]
    fn nothing_else_changes_a_stream() {
        let params = rich();
        let base = simulate(&params, &scenario(300), 100);
        // the other axis away; terms of other kinds and the later one of the same kind away; a longer run
        let mut fewer = params.clone();
        fewer.axes.truncate(1);
        fewer.axes[0].terms.remove(6);
        fewer.axes[0].terms.remove(0);
        let found = simulate(&fewer, &scenario(900), 100);
        for (i, j) in [(0, 1), (1, 2), (2, 3), (3, 4), (4, 5), (5, 7), (6, 8)] {
            assert_eq!(found[0].terms[i][..300], base[0].terms[j], "term {j}");
        }
        // the turn-on draw and the motion have streams of their own or none
        let moved = Scenario { turn_on: true, true_rate: TrueRate::Constant(1.0), ..scenario(300) };
        assert_eq!(simulate(&params, &moved, 100)[0].terms, base[0].terms);
    }

    #[test]
    fn every_term_axis_run_and_seed_has_its_own_stream() {
        let params = rich();
        let mut twin = params.clone();
        twin.axes[1] = twin.axes[0].clone();
        let mut first: Vec<u64> = Vec::new();
        for (seed, run) in [(1, 0), (1, 1), (2, 0)] {
            for axis in simulate(&twin, &Scenario { seed, run, ..scenario(3) }, 3) {
                // the ramp is the last and draws nothing; the random walk starts at 0: compare the third sample's
                // change
                for term in &axis.terms[..8] {
                    first.push((term[2] - term[1]).to_bits());
                }
            }
        }
        let count = first.len();
        first.sort_unstable();
        first.dedup();
        assert_eq!((count, first.len()), (48, 48), "two streams are alike");
    }

    #[test]
    fn the_address_table_is_kept() {
        // part of what makes a published simulation repeatable
        for (kind, code) in [
            (Kind::Quantization, 0x1_0000),
            (Kind::White, 0x2_0000),
            (Kind::BiasInstability, 0x3_0000),
            (Kind::GaussMarkov, 0x4_0000),
            (Kind::RateRandomWalk, 0x5_0000),
            (Kind::RateRamp, 0x6_0000),
            (Kind::Oscillation, 0x7_0000),
            (Kind::MovingAverage, 0x8_0000),
            (Kind::BandLimit, 0x9_0000),
        ] {
            assert_eq!((term_number(kind, 0), term_number(kind, 3)), (code, code + 3));
        }
        assert_eq!(TURN_ON_BIAS, 1);
    }

    #[test]
    fn output_is_rounded_and_limited() {
        let step = 0.01 * DEGREE;
        let limit = 2.1 * DEGREE;
        let limited = Scenario { saturation: Some(limit), quantisation: Some(step), ..scenario(2000) };
        let plain = simulate(&rich(), &scenario(2000), 500);
        let found = simulate(&rich(), &limited, 500);
        let mut clipped = 0;
        for (x, y) in found[0].measured.iter().zip(&plain[0].measured) {
            if y.abs() > limit + step {
                clipped += 1;
                assert_eq!(*x, limit);
            } else if y.abs() < limit - step {
                assert!((x - y).abs() <= 0.5 * step * (1.0 + 1e-9), "{x} and {y}");
                assert!((x / step - (x / step).round()).abs() < 1e-9, "{x} is no multiple");
            }
        }
        assert!(clipped > 100, "the limit was hit {clipped} times");
        assert_eq!(found[0].drift, plain[0].drift, "truth is not rounded");
    }

    /// 20 000 runs: (bias − 2 deg/s)/0.5 deg/s is standard normal. Mean within 5 standard errors (5.7e-7), variance
    /// in its chi-square interval (1e-6).
    #[test]
    fn turn_on_bias_is_drawn_per_run() {
        let params = rich();
        let mut moments = Moments::default();
        for run in 0..20_000 {
            let axes = simulate(&params, &Scenario { run, turn_on: true, ..scenario(1) }, 1);
            moments.add((axes[0].bias / DEGREE - 2.0) / 0.5);
            assert_eq!(axes[1].bias, 0.0);
        }
        assert!(moments.mean.abs() < 5.0 / 20_000f64.sqrt(), "mean {}", moments.mean);
        let statistic = moments.variance() * 19_999.0;
        let range = chi_square_quantile(5e-7, 19_999.0)..chi_square_quantile(1.0 - 5e-7, 19_999.0);
        assert!(range.contains(&statistic), "variance {}", moments.variance());
    }

    /// Reference sensor, 10 min at 100 Hz: the white part of each axis has variance N²/dt; chi-square, false alarm 3
    /// × 1e-6.
    #[test]
    fn reference_sensor_has_its_white_noise() {
        let params = Params::read(&data("params.json")).unwrap();
        let axes = simulate(&params, &Scenario { rate_hz: 100.0, ..scenario(60_000) }, 10_000);
        for axis in &axes {
            let sum: f64 = axis.measured.iter().zip(&axis.drift).map(|(y, d)| (y - d - axis.bias).powi(2)).sum();
            let statistic = sum / (0.0562 * DEGREE).powi(2) * 0.01;
            let range = chi_square_quantile(5e-7, 60_000.0)..chi_square_quantile(1.0 - 5e-7, 60_000.0);
            assert!(range.contains(&statistic), "{statistic} is outside {range:?}");
        }
    }

    #[test]
    fn impossible_scenarios_are_refused() {
        let good = scenario(10);
        for (bad, words) in [
            (Scenario { samples: 0, ..good.clone() }, "no sample"),
            (Scenario { samples: u64::MAX, ..good.clone() }, "limit"),
            (Scenario { rate_hz: f64::NAN, ..good.clone() }, "sample rate"),
            (Scenario { rate_hz: 0.0, ..good.clone() }, "sample rate"),
            (Scenario { saturation: Some(-1.0), ..good.clone() }, "saturation"),
            (Scenario { quantisation: Some(0.0), ..good.clone() }, "quantisation"),
            (Scenario { true_rate: TrueRate::Constant(f64::NAN), ..good.clone() }, "true rate"),
            (
                Scenario { true_rate: TrueRate::Sinusoid { amplitude: 1.0, frequency_hz: 0.0 }, ..good.clone() },
                "frequency",
            ),
            (Scenario { true_rate: TrueRate::Samples(vec![vec![0.0; 9]]), ..good.clone() }, "9 samples, 10 are needed"),
            (Scenario { true_rate: TrueRate::Samples(vec![vec![0.0; 10]; 3]), ..good.clone() }, "expected 1 or 2"),
            (Scenario { true_rate: TrueRate::Samples(vec![vec![f64::NAN; 10]]), ..good.clone() }, "sample 1"),
        ] {
            let error = Simulator::new(&rich(), &bad).err().map(|e| e.to_string()).unwrap_or_default();
            assert!(error.contains(words), "{words}: {error}");
        }
    }
}

mod command {
    use super::*;
    use std::io::Read;

    /// Header and columns of a csv text.
    fn parse(text: &str) -> (Vec<String>, Vec<Vec<f64>>) {
        let mut lines = text.lines();
        let header: Vec<String> = lines.next().unwrap().split(',').map(String::from).collect();
        let mut columns = vec![Vec::new(); header.len()];
        for line in lines {
            for (column, cell) in columns.iter_mut().zip(line.split(',')) {
                column.push(cell.parse().unwrap());
            }
        }
        (header, columns)
    }

    fn gunzip(bytes: &[u8]) -> String {
        let mut text = String::new();
        flate2::read::GzDecoder::new(bytes).read_to_string(&mut text).unwrap();
        text
    }

    #[test]
    fn writes_what_the_library_made() {
        let bench = Bench::new();
        bench.file("rich.json", RICH);
        let out = bench.ok("simulate rich.json -o log.csv --duration 200s --seed 1");
        assert!(out.contains("log.csv: 10000 samples at 50 Hz (200.0 s), seed 1, run 0."), "{out}");
        let (header, columns) = parse(&bench.read("log.csv"));
        assert_eq!(
            header,
            [
                "time (s)",
                "gyro_x (deg/s)",
                "gyro_y (deg/s)",
                "truth_x_rate (deg/s)",
                "truth_x_bias (deg/s)",
                "truth_x_drift (deg/s)",
                "truth_y_rate (deg/s)",
                "truth_y_bias (deg/s)",
                "truth_y_drift (deg/s)"
            ]
        );
        let axes = simulate(&rich(), &scenario(10_000), 10_000);
        let expected: [&dyn Fn(usize) -> f64; 9] = [
            &|k| k as f64 / 50.0 * DEGREE,
            &|k| axes[0].measured[k],
            &|k| axes[1].measured[k],
            &|_| 0.0,
            &|_| 2.0 * DEGREE,
            &|k| axes[0].drift[k],
            &|_| 0.0,
            &|_| 0.0,
            &|_| 0.0,
        ];
        for ((name, column), expected) in header.iter().zip(&columns).zip(expected) {
            assert_eq!(column.len(), 10_000);
            for (k, value) in column.iter().enumerate() {
                assert!((value * DEGREE - expected(k)).abs() <= 1e-15 * expected(k).abs(), "{name}, sample {k}");
            }
        }
    }

    #[test]
    fn three_formats_hold_the_same_numbers() {
        let bench = Bench::new();
        bench.file("rich.json", RICH);
        for name in ["a.csv", "b.csv.gz", "c.npy", "again.csv"] {
            bench.ok(&format!("simulate rich.json -o {name} --duration 1min --seed 9 --run 4"));
        }
        let text = bench.read("a.csv");
        assert_eq!(text, bench.read("again.csv"), "same seed, same bytes");
        assert_eq!(text, gunzip(&std::fs::read(bench.path("b.csv.gz")).unwrap()));
        let (_, columns) = parse(&text);
        let npy = std::fs::read(bench.path("c.npy")).unwrap();
        let data = &npy[npy.len() - 3000 * 9 * 8..];
        for (i, bytes) in data.chunks_exact(8).enumerate() {
            assert_eq!(f64::from_le_bytes(bytes.try_into().unwrap()), columns[i % 9][i / 9]);
        }
        bench.ok("simulate rich.json -o other.csv --duration 1min --seed 9 --run 5");
        assert_ne!(text, bench.read("other.csv"));
    }

    #[test]
    fn durations_rates_and_units_are_understood() {
        let bench = Bench::new();
        bench.file("rich.json", RICH);
        for (args, samples) in [
            (vec!["--duration", "90min"], 270_000),
            (vec!["--duration", "0.01 h"], 1800),
            (vec!["--duration", "6e1s"], 3000),
            (vec!["--duration", "1500ms", "--rate", "200"], 300),
            (vec!["--duration", "1/2 s"], 25),
        ] {
            let mut all = vec!["simulate", "rich.json", "-o", "log.npy", "--json"];
            all.extend(&args);
            let out = bench.run_args(&all);
            assert_eq!(out.status, 0, "{args:?}: {}", out.stderr);
            let json: serde_json::Value = serde_json::from_str(&out.stdout).unwrap();
            assert_eq!(json["samples"], samples, "{args:?}");
        }
        bench.ok("simulate rich.json -o rad.csv --duration 1s --unit rad/s --no-truth");
        let (header, columns) = parse(&bench.read("rad.csv"));
        assert_eq!(header, ["time (s)", "gyro_x (rad/s)", "gyro_y (rad/s)"]);
        assert_eq!(columns[1], simulate(&rich(), &scenario(50), 50)[0].measured);
        for decimals in [3, 0] {
            bench.ok(&format!("simulate rich.json -o short.csv --duration 1s --decimals {decimals}"));
            let text = bench.read("short.csv");
            let rounded: Vec<&str> =
                text.lines().skip(1).flat_map(|l| l.split_once(',').unwrap().1.split(',')).collect();
            assert_eq!(rounded.len(), 50 * 8);
            for cell in rounded {
                assert!(cell.split('.').nth(1).is_none_or(|d| d.len() <= decimals) && cell != "-0", "{cell}");
            }
        }
    }

    #[test]
    fn specific_force_has_its_own_names() {
        let bench = Bench::new();
        bench.file(
            "accel.json",
            r#"{"format": "kfdesign-params/1", "quantity": "specific-force", "sample_rate": "10 Hz",
                "axes": [{"name": "accel_z", "white": {"density": "100 ug/sqrt(Hz)"}},
                         {"name": "x", "white": {"density": "0.1 m/s/sqrt(h)"}}]}"#,
        );
        bench.ok("simulate accel.json -o log.csv --duration 1s");
        assert!(bench.read("log.csv").starts_with("time (s),accel_z (ug),accel_x (ug),truth_accel_z_rate (ug),"));
    }

    #[test]
    fn motion_is_added() {
        let bench = Bench::new();
        bench.file("rich.json", RICH);
        let rate = |motion: &str| {
            let out =
                bench.run_args(&["simulate", "rich.json", "-o", "log.csv", "--duration", "2s", "--true-rate", motion]);
            assert_eq!(out.status, 0, "{motion}: {}", out.stderr);
            let (header, mut columns) = parse(&bench.read("log.csv"));
            assert_eq!(header[6], "truth_y_rate (deg/s)");
            columns.swap_remove(6)
        };
        assert!(rate("rest").iter().all(|x| *x == 0.0));
        assert!(rate("constant:-60 deg/min").iter().all(|x| (x + 1.0).abs() < 1e-15));
        for (k, x) in rate("sine:10deg/s,500 mHz").iter().enumerate() {
            assert!((x - 10.0 * (std::f64::consts::PI * k as f64 / 50.0).sin()).abs() < 1e-12, "sample {k}: {x}");
        }
    }

    #[test]
    fn motion_can_come_from_a_file() {
        let bench = Bench::new();
        bench.file("rich.json", RICH);
        let rows: String = (0..120).map(|k| format!("{},{}\n", k as f64 / 50.0, 0.5 * f64::from(k))).collect();
        bench.file("turn.csv", format!("time (s),gyro_x (deg/s)\n{rows}"));
        bench.ok("simulate rich.json -o log.csv --true-rate file:turn.csv");
        let (header, columns) = parse(&bench.read("log.csv"));
        for axis in [3, 6] {
            assert!(header[axis].ends_with("_rate (deg/s)"));
            assert_eq!(columns[axis].len(), 120, "the run is as long as the file");
            for (k, x) in columns[axis].iter().enumerate() {
                assert!((x - 0.5 * k as f64).abs() < 1e-12, "sample {k}: {x}");
            }
        }
        let out = bench.run("simulate rich.json -o long.csv --true-rate file:turn.csv --duration 1h");
        assert_eq!((out.status, out.stderr.lines().count()), (2, 1), "{}", out.stderr);
        assert!(out.stderr.contains("true rate has 120 samples, 180000 are needed"), "{}", out.stderr);
        let out = bench.run("simulate rich.json -o turn.csv --true-rate file:turn.csv");
        assert!(out.status == 2 && out.stderr.contains("it is the input file"), "{}", out.stderr);
    }

    /// The log reader takes the measured columns and leaves time and truth alone, with the same numbers in all formats.
    #[test]
    fn the_log_reads_back() {
        let bench = Bench::new();
        bench.file("rich.json", RICH);
        let axes = simulate(&rich(), &scenario(3000), 3000);
        for name in ["log.csv", "log.csv.gz", "log.npy"] {
            bench.ok(&format!("simulate rich.json -o {name} --duration 1min --seed 1"));
            let (recording, _) = input::read(&bench.path(name), &LogOptions::default()).unwrap();
            let names: Vec<&str> = recording.axes.iter().map(|a| a.name.as_str()).collect();
            assert_eq!(names, ["gyro_x", "gyro_y"], "{name}");
            assert!((recording.sample_rate_hz - 50.0).abs() < 1e-9, "{name}: {}", recording.sample_rate_hz);
            assert!(recording.gaps.is_empty());
            for (read, made) in recording.axes.iter().zip(&axes) {
                assert_eq!(read.values.len(), 3000, "{name}");
                for (a, b) in read.values.iter().zip(&made.measured) {
                    assert!((a - b).abs() <= 1e-15 * b.abs(), "{name}: {a:e} and {b:e}");
                }
            }
        }
    }

    /// `data/skydog_10min.csv.gz` made again by the command in data/README.md. On another platform the last bit of
    /// exp or ln may differ, and with it the rounding of a number in a thousand.
    #[test]
    fn the_log_in_data_is_made_again() {
        let kept = data("skydog_10min.csv.gz");
        if !kept.exists() && !data("../.ci").exists() {
            println!("skipped: a published package has no logs");
            return;
        }
        let bench = Bench::new();
        let params = data("params.json");
        bench.ok(&format!("simulate {} -o log.csv --duration 10min --seed 1 --decimals 4", params.display()));
        let (header, made) = parse(&bench.read("log.csv"));
        let (kept_header, kept) = parse(&gunzip(&std::fs::read(kept).unwrap()));
        assert_eq!(header, kept_header);
        assert_eq!((made.len(), kept[0].len()), (13, 60_000));
        for ((name, made), kept) in header.iter().zip(&made).zip(&kept) {
            assert_eq!(made.len(), kept.len());
            let off: Vec<f64> = made.iter().zip(kept).map(|(a, b)| (a - b).abs()).filter(|d| *d > 0.0).collect();
            assert!(off.len() <= 60 && off.iter().all(|d| *d < 1.01e-4), "{name}: {} numbers differ", off.len());
        }
    }

    #[test]
    fn a_refusal_is_one_line_and_leaves_nothing() {
        let bench = Bench::new();
        bench.file("rich.json", RICH);
        let long = ["simulate", "rich.json", "-o", "log.csv", "--duration", "2s"];
        let with = |extra: &[&'static str]| [&long[..], extra].concat();
        for (args, words) in [
            (vec!["simulate", "none.json", "-o", "log.csv", "--duration", "2s"], "none.json: cannot read"),
            (vec!["simulate", "rich.json", "-o", "rich.json", "--duration", "2s"], "it is the input file"),
            (vec!["simulate", "rich.json", "-o", "log.xlsx", "--duration", "2s"], ".csv, .csv.gz or .npy"),
            (vec!["simulate", "rich.json", "-o", "no/log.csv", "--duration", "2s"], "does not exist"),
            (vec!["simulate", "rich.json", "-o", "log.csv"], "--duration is missing"),
            (vec!["simulate", "rich.json", "-o", "log.csv", "--duration", "0s"], "--duration 0s"),
            (vec!["simulate", "rich.json", "-o", "log.csv", "--duration=-2h"], "--duration -2h"),
            (vec!["simulate", "rich.json", "-o", "log.csv", "--duration", "2"], "a number and a unit"),
            (vec!["simulate", "rich.json", "-o", "log.csv", "--duration", "h"], "a number and a unit"),
            (vec!["simulate", "rich.json", "-o", "log.csv", "--duration", "2 deg"], "--duration 2 deg"),
            (vec!["simulate", "rich.json", "-o", "log.csv", "--duration", "1e400s"], "a number and a unit"),
            (vec!["simulate", "rich.json", "-o", "log.csv", "--duration", "1e300s"], "limit"),
            (with(&["--rate", "0"]), "--rate 0"),
            (with(&["--rate", "nan"]), "--rate NaN"),
            (with(&["--rate=-5"]), "--rate -5"),
            (with(&["--unit", "deg"]), "--unit"),
            (with(&["--saturate", "0 deg/s"]), "above zero"),
            (with(&["--saturate", "3 m"]), "--saturate 3 m"),
            (with(&["--quantise", "1/0 deg/s"]), "--quantise"),
            (with(&["--decimals", "16"]), "16"),
            (with(&["--true-rate", "spin"]), "expected rest, constant"),
            (with(&["--true-rate", "spin:1"]), "expected rest, constant"),
            (with(&["--true-rate", "constant:1"]), "a number and a unit"),
            (with(&["--true-rate", "sine:1deg/s"]), "expected rest, constant"),
            (with(&["--true-rate", "sine:1deg/s,0Hz"]), "above zero"),
            (with(&["--true-rate", "file:none.csv"]), "none.csv"),
        ] {
            let out = bench.run_args(&args);
            assert_eq!(out.status, 2, "{args:?}: {}", out.stderr);
            assert_eq!(out.stderr.trim_end().lines().count(), 1, "{args:?}: {}", out.stderr);
            assert!(out.stderr.contains(words), "{args:?}: {}", out.stderr);
            assert_eq!((out.stdout.as_str(), bench.files()), ("", vec!["rich.json".to_string()]), "{args:?}");
            assert_eq!(bench.read("rich.json"), RICH);
        }
    }
}
