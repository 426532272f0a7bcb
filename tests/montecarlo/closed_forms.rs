//! Statistics against what theory says they are.

use kfdesign::montecarlo::gate::LeastLaw;
use serde_json::Value;

use super::{SMALL, bench, changed};
use crate::support::Bench;

fn run(bench: &Bench, args: &str) -> Value {
    let out = bench.run(&format!("montecarlo {args} --json"));
    assert!(out.status < 2 && out.stderr.is_empty(), "{args}: {} {}", out.status, out.stderr);
    serde_json::from_str(&out.stdout).unwrap()
}

/// A filter that starts in its steady state has errors e(k+1) = λ e(k) + …, so the NEES at times D steps apart has
/// the correlation ρ = λ^(2D) and n of them are worth n²/(n + 2 Σ (n − h) ρ^h) (Bar-Shalom, Li & Kirubarajan 2001,
/// section 5.4). The reference sensor at 100 Hz has λ = 0.99949048; all 60 000 samples of 600 s are worth 31.1, 100
/// of them a little less.
#[test]
fn correlated_errors_count_as_few_independent_ones() {
    let sensor = r#"{"format": "kfdesign-params/1", "quantity": "angular-rate", "sample_rate": "100 Hz", "axes": [{"name": "x",
        "white": {"density": "0.0562 deg/s/sqrt(Hz)"},
        "gauss_markov": [{"std_dev": "0.0280596 deg/s", "correlation_time": "193.9312 s"}]}]}"#;
    let bench = bench(sensor);
    let mut pole = 0.0;
    let settled = changed(&bench.read("filter.json"), |design| {
        let axis = &mut design["axes"][0];
        let updated = &axis["steady_state"]["predicted_covariance"];
        // the constant bias is known here: its pole stays at one
        let poles = axis["steady_state"]["poles"].as_array().unwrap();
        pole = poles.iter().map(|p| p[0].as_f64().unwrap()).fold(1.0, f64::min);
        axis["P0"] = updated.clone();
    });
    bench.file("settled.json", settled);
    assert!((pole - 0.99949048).abs() < 1e-8, "{pole}");
    let found = run(&bench, "settled.json --duration 600s --runs 2");
    let found = found["axes"][0]["nees_average"]["effective_epochs"].as_f64().unwrap();
    let worth = |n: u64, apart: i32| {
        let rho = pole.powi(2 * apart);
        let pairs: f64 = (1..n).map(|h| (n - h) as f64 * rho.powi(h as i32)).sum();
        (n * n) as f64 / (n as f64 + 2.0 * pairs)
    };
    // P0 is the steady state's to the Riccati solver's 1e-12
    assert!((found / worth(100, 600) - 1.0).abs() < 1e-9, "{found} {}", worth(100, 600));
    let all = worth(60_000, 1);
    assert!((all - 31.1).abs() < 0.05 && found < all && found > 0.95 * all, "{found} {all}");
}

/// Runs are independent: the share of 1000 runs within k sigma at one time is binomial. Bounds of 5 standard
/// deviations for 1 and 2 sigma (6e-7 for each of 8 numbers, a little more for the skewed ones), of 15 misses beyond
/// 3 sigma where 2.7 are expected (3e-8 each).
#[test]
fn errors_are_within_their_sigmas_as_often_as_normal_ones() {
    let bench = bench(SMALL);
    let found = run(&bench, "filter.json --duration 20s --runs 1000");
    let runs = 1000.0;
    for component in found["axes"][0]["errors"].as_array().unwrap() {
        // at the first measurement, and 20 s later
        for time in [0, 99] {
            let share = |key: &str| component[key][time].as_f64().unwrap();
            for (key, p) in [("within_1_sigma", 0.682_689_5), ("within_2_sigma", 0.954_499_7)] {
                let bound = 5.0 * f64::sqrt(p * (1.0 - p) / runs);
                assert!((share(key) - p).abs() < bound, "{key}: {}", share(key));
            }
            let beyond = runs * (1.0 - share("within_3_sigma"));
            assert!((-0.5..15.5).contains(&beyond), "{beyond}");
        }
    }
}

/// All noise of the filter `factor` times the true one: the gains stay, so the errors are 1/factor of what is
/// claimed. The squared ones then are 20 log10(factor) dB too small: the inclination is minus that (Li & Zhao 2006:
/// positive is optimistic), NCI its absolute value. Within 5 standard errors of the mean log NEES, which NCI does
/// not exceed (6e-7 each).
#[test]
fn credibility_has_the_size_and_the_sign_of_the_mistake() {
    let bench = bench(SMALL);
    bench.file("truth.json", SMALL);
    for (factor, word, side) in [(2.0, "pessimistic", "pessimistic"), (0.5, "optimistic", "optimistic")] {
        let mut scaled = SMALL.to_string();
        for (name, value, unit) in
            [("std_dev\": \"", 0.5, "deg/s\"}"), ("density\": \"", 0.05, "deg/s/"), ("std_dev\": \"", 0.05, "deg/s\",")]
        {
            let old = format!("{name}{value} {unit}");
            assert!(scaled.contains(&old), "{old}");
            scaled = scaled.replace(&old, &format!("{name}{} {unit}", value * factor));
        }
        bench.file("scaled.json", scaled);
        bench.ok("tune scaled.json -o scaled-filter.json");
        let found = run(&bench, "scaled-filter.json --truth truth.json --runs 200 --duration 20s");
        let axis = &found["axes"][0];
        let credibility = &axis["credibility"];
        let number = |key: &str| credibility[key].as_f64().unwrap();
        let size = 20.0 * f64::log10(factor);
        let bound = 5.0 * number("standard_error_db");
        assert!(bound < 2.0, "{bound}: the sign and the size would not be told");
        assert!((number("inclination_db") + size).abs() < bound, "{credibility}");
        assert!((number("nci_db") - size.abs()).abs() < bound, "{credibility}");
        assert!(credibility["meaning"].as_str().unwrap().starts_with(word), "{credibility}");
        assert!(
            found["meaning"].as_str().unwrap().starts_with(&format!("the filter is {side}: ")),
            "{}",
            found["meaning"]
        );
        // exact, from the covariance analysis; tuned anew, so to the accuracy of a matrix product
        for expected in [&axis["nees_average"]["expected"], &axis["innovations"][0]["expected_nis"]] {
            assert!((expected.as_f64().unwrap() * factor * factor - 1.0).abs() < 1e-9, "{expected}");
        }
    }
}

/// 200 whole experiments at alpha 0.2: the number of false alarms, and of each test alone, is binomial with a mean
/// of 40. Outside 16 to 66 with a probability of 6e-6, 6e-5 for the verdict and the nine tests. Without any care for
/// multiplicity the verdict would alarm in 1 − 0.8⁹ of them, 173; with Bonferroni's on fully dependent tests in 4.
#[test]
fn false_alarms_are_as_many_as_intended() {
    let bench = bench(SMALL);
    let found = run(&bench, "filter.json --duration 20s --runs 10 --alpha 0.2 --replicates 200");
    let rate = &found["false_alarm_rate"];
    assert_eq!((rate["replicates"].as_u64(), rate["method"].as_str()), (Some(200), Some("experiments")));
    let tests = rate["tests"].as_array().unwrap();
    assert_eq!(tests.len(), 9);
    for rate in std::iter::once(rate).chain(tests) {
        let alarms = 200.0 * rate["value"].as_f64().unwrap();
        assert!((15.5..66.5).contains(&alarms), "{rate}");
    }
    let alone: f64 = tests.iter().map(|test| test["rejected"].as_f64().unwrap()).sum();
    assert!(alone >= rate["value"].as_f64().unwrap(), "{rate}: an alarm is that of some test");
}

/// Values in the middles of equal parts have the law P(p_min ≤ t) = t; beyond the fiftieth the power of t that leads
/// there from the five-hundredth. The quantile is the inverse of both.
#[test]
fn the_law_of_uniform_least_values() {
    let count = 2000;
    let law = LeastLaw::new((0..count).rev().map(|i| (f64::from(i) + 0.5) / f64::from(count)).collect());
    for p in [0.03, 0.2, 0.50001, 0.9] {
        assert!((law.quantile(p) - p).abs() < 1e-14 && (law.cdf(p) - p).abs() < 1e-14, "{p}: {}", law.quantile(p));
    }
    let power = 10f64.ln() / f64::ln(499.5 / 49.5);
    for t in [1e-12_f64, 1e-4, 0.02] {
        let p = 49.5 / 2000.0 * (t * 2000.0 / 49.5).powf(power);
        assert!((law.cdf(t) / p - 1.0).abs() < 1e-12 && (law.quantile(p) / t - 1.0).abs() < 1e-12, "{t}");
    }
    assert_eq!((law.quantile(0.0), law.quantile(1.0)), (0.0, 1999.5 / 2000.0));
    assert_eq!(LeastLaw::new(vec![]).quantile(0.9), 1.0);
}
