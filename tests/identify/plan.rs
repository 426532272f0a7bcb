//! How long to record: the bound against tables, exact sums and the exact Gaussian information; the command.

use kfdesign::identify::plan::{Planned, Sampling, Thinning};
use kfdesign::identify::{Method, identify_axis, parse_model};
use kfdesign::noise::{Filter, NoiseModel, Term};
use kfdesign::params::Params;
use kfdesign::units::Unit;
use nalgebra::{DMatrix, DVector};
use serde_json::Value;

use super::{gauss_markov, log, white};
use crate::support::{Bench, Outcome, data};

/// The reference sensor, to all digits (deg/s, s).
const N: f64 = 0.0562;
const SIGMA: f64 = 0.028_059_6;
const TC: f64 = 193.931_2;

fn planned(terms: &[Term]) -> Planned {
    Planned::new(&NoiseModel { terms: terms.to_vec() })
}

fn reference() -> Planned {
    planned(&[white(N), gauss_markov(SIGMA, TC)])
}

fn own(sensor_rate_hz: f64) -> Sampling {
    Sampling { sensor_rate_hz, every: 1, thinning: Thinning::Averages }
}

fn index(planned: &Planned, name: &str) -> usize {
    planned.names().position(|n| n == name).unwrap_or_else(|| panic!("no {name}"))
}

/// The printed bound of white noise + Gauss-Markov, N at 100 Hz and at 1 Hz, σ, Tc, q_c: an integral over
/// frequencies, of which the sum has half a coefficient less at the lowest end. That costs 1.1 Tc/T of itself at
/// most; besides, half a unit of the last printed digit.
#[test]
fn table_of_the_reference_sensor() {
    const TABLE: [(f64, [f64; 5], [f64; 5]); 5] = [
        (1.0, [1.179e-3, 1.21e-2, 0.168, 0.402, 0.127], [5e-7, 5e-5, 5e-4, 5e-4, 5e-4]),
        (2.0, [8.34e-4, 8.6e-3, 0.119, 0.284, 0.090], [5e-7, 5e-5, 5e-4, 5e-4, 5e-4]),
        (4.0, [5.89e-4, 6.1e-3, 0.084, 0.201, 0.063], [5e-7, 5e-5, 5e-4, 5e-4, 5e-4]),
        (10.0, [3.73e-4, 3.8e-3, 0.053, 0.127, 0.040], [5e-7, 5e-5, 5e-4, 5e-4, 5e-4]),
        (24.0, [2.41e-4, 2.5e-3, 0.034, 0.082, 0.026], [5e-7, 5e-5, 5e-4, 5e-4, 5e-4]),
    ];
    let planned = reference();
    for (hours, printed, half_digits) in TABLE {
        let span = 3600.0 * hours;
        let fast = planned.precision(span, &own(100.0));
        let means = planned.precision(span, &Sampling { every: 100, ..own(100.0) });
        let found = [fast[0], means[0], fast[1], fast[2], fast[3]];
        for i in 0..5 {
            let missing = if i < 2 { 1e-3 } else { 1.2 * TC / span };
            let (low, high) = (printed[i] - half_digits[i], (printed[i] + half_digits[i]) * (1.0 + missing));
            assert!(low < found[i] && found[i] < high, "{hours} h, number {i}: {} is not in {low} … {high}", found[i]);
        }
    }
}

/// The exact Gaussian information of n samples of unknown mean, ½ tr(P ∂_i C P ∂_k C), P = C⁻¹ − C⁻¹1
/// 1ᵀC⁻¹/(1ᵀC⁻¹1): the bound of the cosine coefficients is below by about 0.8 Tc/T, as they are not quite
/// independent (a separate computation in NumPy: 0.096, 0.510, 0.801 Tc/T of N, σ, Tc at 2 h, 0.207, 0.454, 0.933 at
/// 4 h, where 360 samples are coarse).
#[test]
fn exact_gaussian_information() {
    let n = 360;
    for hours in [2.0, 4.0] {
        let dt = 3600.0 * hours / n as f64;
        let logs = [N, SIGMA, TC].map(f64::ln);
        let covariance = |logs: [f64; 3]| {
            let [density, sigma, time] = logs.map(f64::exp);
            let white = density * density / dt;
            let drift = |i: usize, k: usize| sigma * sigma * (-(i.abs_diff(k) as f64) * dt / time).exp();
            DMatrix::from_fn(n, n, |i, k| drift(i, k) + if i == k { white } else { 0.0 })
        };
        let inverse = covariance(logs).try_inverse().unwrap();
        let sums: DVector<f64> = inverse.column_sum();
        let contrast = &inverse - &sums * sums.transpose() / sums.sum();
        let products = [0, 1, 2].map(|i| {
            let moved = |shift: f64| {
                let mut logs = logs;
                logs[i] += shift;
                covariance(logs)
            };
            &contrast * ((moved(1e-4) - moved(-1e-4)) / 2e-4)
        });
        let information =
            DMatrix::from_fn(3, 3, |i, k| 0.5 * products[i].component_mul(&products[k].transpose()).sum());
        let exact = information.try_inverse().unwrap();
        let found = reference().precision(3600.0 * hours, &own(1.0 / dt));
        for i in 0..3 {
            let missing = 1.0 - found[i] / exact[(i, i)].sqrt();
            let most = 1.05 * TC / (3600.0 * hours);
            assert!((0.0..most).contains(&missing), "{hours} h, parameter {i}: {missing} below, at most {most}");
        }
    }
}

/// Seven processes against every coefficient alone and derivatives by differences: 0.5 % of what the 2.5 % wide bins
/// may miss (1e-4 for smooth spectra, more for the line, where they are a quarter of the distance to it).
#[test]
fn bins_miss_little_of_the_exact_sum() {
    let (samples, rate) = (40_000, 10.0);
    let dt = 1.0 / rate;
    let terms = vec![
        Term::RateRandomWalk { density: 0.002 },
        gauss_markov(0.05, 8.0),
        white(0.02),
        gauss_markov(0.03, 200.0),
        Term::Oscillation { std_dev: 0.03, frequency_hz: 2.1, correlation_time: 15.0 },
        Term::Quantization { coefficient: 1e-3 },
    ];
    let names = [
        ("rate_random_walk.density", 0, 0),
        ("gauss_markov.std_dev", 1, 0),
        ("gauss_markov.correlation_time", 1, 1),
        ("white.density", 2, 0),
        ("gauss_markov[1].std_dev", 3, 0),
        ("gauss_markov[1].correlation_time", 3, 1),
        ("oscillation.std_dev", 4, 0),
        ("oscillation.frequency", 4, 1),
        ("oscillation.correlation_time", 4, 2),
        ("quantization.coefficient", 5, 0),
    ];
    let scaled = |term: &Term, which: usize, factor: f64| match *term {
        Term::RateRandomWalk { density } => Term::RateRandomWalk { density: density * factor },
        Term::White { density } => Term::White { density: density * factor },
        Term::Quantization { coefficient } => Term::Quantization { coefficient: coefficient * factor },
        Term::GaussMarkov { std_dev: s, correlation_time: t } => {
            if which == 0 {
                gauss_markov(s * factor, t)
            } else {
                gauss_markov(s, t * factor)
            }
        }
        Term::Oscillation { std_dev: s, frequency_hz: f, correlation_time: t } => {
            let mut all = [s, f, t];
            all[which] *= factor;
            Term::Oscillation { std_dev: all[0], frequency_hz: all[1], correlation_time: all[2] }
        }
        other => other,
    };
    let mut information = DMatrix::zeros(names.len(), names.len());
    for j in 1..samples {
        let f = f64::from(j) / (2.0 * f64::from(samples) * dt);
        let total: f64 = terms.iter().map(|term| term.psd(f, dt)).sum();
        let slope = |(_, term, which): &(&str, usize, usize)| {
            let at = |shift: f64| scaled(&terms[*term], *which, shift.exp()).psd(f, dt);
            (at(1e-5) - at(-1e-5)) / 2e-5 / total
        };
        let slopes = DVector::from_iterator(names.len(), names.iter().map(slope));
        information += 0.5 * &slopes * slopes.transpose();
    }
    let exact = information.try_inverse().unwrap();
    let planned = planned(&terms);
    let found = planned.precision(f64::from(samples) * dt, &own(rate));
    for (i, (name, _, _)) in names.iter().enumerate() {
        let ratio = found[index(&planned, name)] / exact[(i, i)].sqrt();
        assert!((ratio - 1.0).abs() < 5e-3, "{name}: {ratio}");
    }
    // σ √(2/Tc) of the second process, from the exact covariance
    let driving = (exact[(4, 4)] + 0.25 * exact[(5, 5)] - exact[(4, 5)]).sqrt();
    let ratio = found[index(&planned, "gauss_markov[1].driving_noise")] / driving;
    assert!((ratio - 1.0).abs() < 5e-3, "driving noise: {ratio}");
}

/// White noise: 1/√(2(n − 1)), and a ramp in it: N √(12/(n(n² − 1) dt³)) of a slope; the bins cost the ramp less
/// than 1e-3.
#[test]
fn white_noise_and_ramp_in_closed_form() {
    let planned = planned(&[white(N), Term::RateRamp { slope: -2e-5 }]);
    for samples in [101_u32, 7200, 1_000_000] {
        let n = f64::from(samples);
        let found = planned.precision(0.5 * n, &own(2.0));
        assert!((found[0] * (2.0 * (n - 1.0)).sqrt() - 1.0).abs() < 1e-12, "{samples}: {found:?}");
        let slope = N * (12.0 / (n * (n * n - 1.0) * 0.125)).sqrt() / 2e-5;
        assert!((found[1] / slope - 1.0).abs() < 1e-3, "{samples}: {found:?}, not {slope}");
    }
    // 1 % takes 5001 samples
    assert_eq!(planned.duration(0, 0.01, &own(2.0)), Some(2500.5));
}

/// Drift behind a filter of a few samples is told nearly as well as in white noise of the same density (2 % less of
/// the driving noise, which shares the most with N); the white floor that goes with the filter is no parameter.
#[test]
fn beside_a_band_limit() {
    let filter = Filter::new(&[1.0, 0.3], &[1.0, -0.2]).unwrap();
    let floor = N * 1e-5_f64.sqrt() * filter.numerator()[0];
    let drift = gauss_markov(SIGMA, TC);
    let limited = planned(&[white(floor), Term::BandLimit { density: N, filter }, drift]);
    let plain = planned(&[white(N), drift]);
    let names: Vec<&str> = limited.names().filter(|name| !name.contains("shape")).collect();
    assert_eq!(
        names,
        ["band_limit.density", "gauss_markov.std_dev", "gauss_markov.correlation_time", "gauss_markov.driving_noise"]
    );
    let of = |planned: &Planned, name: &str| planned.precision(7200.0, &own(2.0))[index(planned, name)];
    for name in &names[1..] {
        let ratio = of(&limited, name) / of(&plain, name);
        assert!((0.999..1.03).contains(&ratio), "{name}: {ratio}");
    }
    // a pole and a zero are found from the same samples
    let ratio = of(&limited, "band_limit.density") / of(&plain, "white.density");
    assert!(ratio > 1.0 && ratio < 3.0, "{ratio}");
}

/// What `identify` will know of a low-passed sensor, whose filter it has to find, is what is planned: the bound
/// beside its estimate, to 5 % (that is of the filter that was found). With white noise that is no more than a floor
/// there is something to be told at slow rates too, where the shape is not seen: drift as well as beside white
/// noise.
#[test]
fn a_low_passed_sensor_is_planned_as_it_will_be_found() {
    let params = Params::read(&data("low_pass/sensor.json")).unwrap();
    let model = params.axes[0].noise();
    let planned = Planned::new(&model);
    let rate = log(&model.terms, 60_000, 0.005, 31, 0);
    let unit = Unit::parse("rad/s").unwrap();
    let found = identify_axis("x", &rate, 0.005, &unit, Method::Likelihood, &parse_model("bl2+gm").unwrap()).unwrap();
    let known = found.precision.iter().find(|p| p.parameter == "band_limit.density").unwrap();
    let own_rate = planned.precision(300.0, &own(200.0))[index(&planned, "band_limit.density")];
    assert!((0.01 * known.cramer_rao_percent / own_rate - 1.0).abs() < 0.05, "{} {own_rate}", known.cramer_rao_percent);
    let plain = Planned::new(&NoiseModel { terms: vec![white(0.0035_f64.to_radians()), model.terms[2]] });
    for (thinning, most) in [(Thinning::Averages, 1.05), (Thinning::Decimation, 1.05)] {
        let slow = Sampling { every: 100, thinning, ..own(200.0) };
        let at =
            |planned: &Planned| planned.precision(36_000.0, &slow)[index(planned, "gauss_markov.correlation_time")];
        let ratio = at(&planned) / at(&plain);
        // thinned, the filter has kept noise from folding down
        assert!(ratio < most && ratio > 0.1, "{thinning:?}: {ratio}");
    }
}

/// What is planned is what is needed, at every rate, to 1e-4 or a sample.
#[test]
fn duration_is_the_inverse_of_precision() {
    let planned = reference();
    for index in 0..4 {
        for every in [1, 100] {
            for thinning in [Thinning::Averages, Thinning::Decimation] {
                let sampling = Sampling { every, thinning, ..own(100.0) };
                let span = planned.duration(index, 0.07, &sampling).unwrap();
                let (at, before) = (planned.precision(span, &sampling), planned.precision(0.99 * span, &sampling));
                let least = 0.07 * (1.0 - 2e-4 - 1.0 / (span * sampling.rate_hz()));
                assert!((least..=0.07).contains(&at[index]), "{index}, {every}: {at:?}");
                assert!(before[index] > 0.07, "{index}, {every}: {before:?}");
            }
        }
    }
}

#[test]
fn what_no_log_tells() {
    // two processes that are one
    let twins = planned(&[white(N), gauss_markov(SIGMA, TC), gauss_markov(SIGMA, TC)]);
    assert_eq!(twins.duration(index(&twins, "gauss_markov[1].std_dev"), 0.5, &own(100.0)), None);
    assert!(twins.duration(index(&twins, "white.density"), 0.01, &own(100.0)).is_none_or(|s| s > 50.0));
    // 16 h for 10 %, 10⁶ times as much for 0.01 %
    assert_eq!(reference().duration(2, 1e-4, &own(100.0)), None);
    // a slope of which the sign is unknown
    let flat = planned(&[white(N), Term::RateRamp { slope: 0.0 }]);
    assert_eq!(flat.duration(1, 0.5, &own(100.0)), None);
    let two = planned(&[white(N), Term::RateRamp { slope: 1e-5 }, Term::RateRamp { slope: 2e-5 }]);
    assert_eq!(two.names().last(), Some("rate_ramp[1].slope"));
    assert_eq!(two.duration(2, 0.5, &own(100.0)), None);
}

#[test]
fn command() {
    let bench = Bench::new();
    bench.file("params.json", std::fs::read(data("params.json")).unwrap());
    let plan = "plan params.json --parameter gauss_markov.correlation_time --precision";
    let text = bench.ok(&format!("{plan} 10%"));
    assert!(text.starts_with("x, y, z: gauss_markov.correlation_time (193.9 s) to 10.00 %: 16."), "{text}");
    assert!(
        text.contains("1 sigma") && text.contains("Lowest rate for at most 5 % more: 0.2000 Hz, means of 500"),
        "{text}"
    );
    let json: Value = serde_json::from_str(&bench.ok(&format!("{plan} 0.1 --axis y --json -o plan.json"))).unwrap();
    assert_eq!(json, serde_json::from_str::<Value>(&bench.read("plan.json")).unwrap());
    let [axis] = json["axes"].as_array().unwrap().as_slice() else { panic!("{json}") };
    assert_eq!((axis["name"].as_str(), json["format"].as_str()), (Some("y"), Some("kfdesign-plan/1")));
    let seconds = axis["duration_s"].as_f64().unwrap();
    let params = Params::read(&data("params.json")).unwrap();
    let planned = Planned::new(&params.axes[1].noise());
    let expected = planned.duration(2, 0.1, &own(100.0)).unwrap();
    assert!((seconds / expected - 1.0).abs() < 1e-9, "{seconds}, not {expected}");
    let names: Vec<&str> =
        axis["parameters"].as_array().unwrap().iter().map(|p| p["parameter"].as_str().unwrap()).collect();
    assert_eq!(names, planned.names().collect::<Vec<_>>());
    for pair in axis["rates"].as_array().unwrap().windows(2) {
        assert!(pair[0]["rate_hz"].as_f64() >= pair[1]["rate_hz"].as_f64());
    }
    // 5000 samples and a few more for the drift
    let slow = bench.ok("plan params.json --parameter white.density --precision 1% --rate 1 --axis x");
    assert!(slow.starts_with("x: white.density (0.05620 deg/s/sqrt(Hz)) to 1.000 %: 88."), "{slow}");
    let never = bench.run(&format!("{plan} 0.01% --json"));
    let json: Value = serde_json::from_str(&never.stdout).unwrap();
    assert_eq!((never.status, json["axes"][0]["duration_s"].is_null()), (1, true), "{json}");
    let said = bench.run(&format!("{plan} 0.01%"));
    assert!(said.stdout.contains("no log is long enough; ten years at 100.0 Hz give 0.1"), "{}", said.stdout);
}

/// A band limit belongs to its sample rate: another rate is told, on stderr, and no row of ten times the rate is
/// made of it; continuous terms are told nothing.
#[test]
fn another_rate_moves_a_filter_and_is_told() {
    let bench = Bench::new();
    std::fs::copy(data("params.json"), bench.path("params.json")).unwrap();
    std::fs::copy(data("low_pass/sensor.json"), bench.path("sensor.json")).unwrap();
    let note = "note: gyro_x: band_limit belongs to the samples at 200.0 Hz: at 50.00 Hz the same coefficients are another process";
    let wish = "--parameter gauss_markov.correlation_time --precision 10%";
    let moved = [
        bench.run("simulate sensor.json -o log.npy --duration 10s --rate 50"),
        bench.run(&format!("plan sensor.json {wish} --rate 50")),
    ];
    let kept = [
        bench.run("simulate sensor.json -o log.npy --duration 10s --rate 200"),
        bench.run(&format!("plan sensor.json {wish}")),
        bench.run("simulate params.json -o log.npy --duration 10s --rate 50"),
        bench.run(&format!("plan params.json {wish} --rate 50")),
    ];
    assert!(moved.iter().all(|run| run.status == 0 && run.stderr.matches(note).count() == 1), "{moved:?}");
    assert!(kept.iter().all(|run| run.status == 0 && !run.stderr.contains("note")), "{kept:?}");
    let faster = |run: &Outcome| run.stdout.matches("of the sensor").count();
    assert_eq!([faster(&moved[1]), faster(&kept[1]), faster(&kept[3])], [1, 1, 2]);
}
