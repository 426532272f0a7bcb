//! A noise model against a log: false alarms, power, effects, and the factor between bench and vehicle.

mod false_alarms;
mod holes;
mod inflate;
mod pieces;

use kfdesign::compare::parameters::parameters;
use kfdesign::compare::{Comparison, Log, LogAxis, compare};
use kfdesign::consistency::{Test, Verdict};
use kfdesign::noise::{Filter, Term};
use kfdesign::params::{AxisParams, Measured, Params, TermEntry};
use kfdesign::simulate::{Scenario, Simulator, TrueRate};
use kfdesign::units::{Quantity, Unit};

use crate::support::Bench;

/// One axis "x" at 10 Hz, SI units.
pub fn params(terms: &[Term]) -> Params {
    let si = |value: f64, unit: &str| Measured::from_si(value, None, Unit::parse(unit).unwrap());
    let entry = |term: &Term| match *term {
        Term::Quantization { coefficient } => TermEntry::Quantization { coefficient: si(coefficient, "rad") },
        Term::White { density } => TermEntry::White { density: si(density, "rad/s/sqrt(Hz)") },
        Term::MovingAverage { density, samples } => {
            TermEntry::MovingAverage { density: si(density, "rad/s/sqrt(Hz)"), samples }
        }
        Term::BandLimit { density, filter } => TermEntry::BandLimit { density: si(density, "rad/s/sqrt(Hz)"), filter },
        Term::Oscillation { std_dev, frequency_hz, correlation_time } => TermEntry::Oscillation {
            std_dev: si(std_dev, "rad/s"),
            frequency: si(frequency_hz, "Hz"),
            correlation_time: si(correlation_time, "s"),
        },
        Term::BiasInstability { coefficient } => TermEntry::BiasInstability { coefficient: si(coefficient, "rad/s") },
        Term::GaussMarkov { std_dev, correlation_time } => {
            TermEntry::GaussMarkov { std_dev: si(std_dev, "rad/s"), correlation_time: si(correlation_time, "s") }
        }
        Term::RateRandomWalk { density } => TermEntry::RateRandomWalk { density: si(density, "rad/s/sqrt(s)") },
        Term::RateRamp { slope } => TermEntry::RateRamp { slope: si(slope, "rad/s^2") },
    };
    Params {
        quantity: Quantity::AngularRate,
        sample_rate_hz: 10.0,
        axes: vec![AxisParams {
            name: "x".into(),
            bias: None,
            turn_on_bias: None,
            temperature: None,
            terms: terms.iter().map(entry).collect(),
            not_identified: vec![],
        }],
        design: None,
        source: None,
    }
}

/// A log of these parameters.
pub fn log(params: &Params, samples: u64, run: u64) -> Log {
    let scenario = Scenario {
        seed: 7,
        run,
        samples,
        rate_hz: params.sample_rate_hz,
        true_rate: TrueRate::Rest,
        turn_on: false,
        saturation: None,
        quantisation: None,
    };
    let mut blocks = vec![];
    Simulator::new(params, &scenario).unwrap().next_block(samples as usize, &mut blocks);
    let axes = params.axes.iter().zip(blocks);
    Log {
        quantity: params.quantity,
        sample_rate_hz: params.sample_rate_hz,
        axes: axes.map(|(a, b)| whole(&a.name, b.measured)).collect(),
    }
}

/// Of a log without holes.
fn whole(name: &str, rate: Vec<f64>) -> LogAxis {
    LogAxis { name: name.into(), rate, filled: 0, left_out: 0, whole: vec![] }
}

pub fn compared(model: &[Term], truth: &[Term], samples: u64, run: u64) -> Comparison {
    compare(&params(model), &log(&params(truth), samples, run), 0.01).unwrap()
}

const WHITE: Term = Term::White { density: 0.1 };

fn drift(std_dev: f64) -> Term {
    Term::GaussMarkov { std_dev, correlation_time: 20.0 }
}

fn test<'a>(found: &'a Comparison, name: &str) -> &'a Test {
    found.tests.iter().find(|t| t.name == name).unwrap()
}

fn failed(found: &Comparison) -> Vec<&str> {
    found.tests.iter().filter(|t| !t.pass()).map(|t| t.name.as_str()).collect()
}

/// 30 logs of their own model: each is rejected in 1.3 % at most (docs/validation.md), so six or more of them with
/// probability below 4e-6; halves of the p-values lie below ½, so that fewer than 3 or more than 27 do with 9e-7 for
/// each test (and more than 0.55 or less than 0.45 of them would not change that by a factor of 4).
#[test]
fn true_models_are_kept() {
    let model = [WHITE, drift(0.05)];
    let results: Vec<Comparison> = (0..30).map(|run| compared(&model, &model, 3000, run)).collect();
    let rejected = results.iter().filter(|r| r.tests.iter().any(|t| t.adjusted_p_value < 0.01)).count();
    assert!(rejected < 6, "{rejected}");
    for name in ["allan_curve", "spectrum_ratio", "cumulative_spectrum", "nis", "whiteness"] {
        let low = results.iter().filter(|r| test(r, name).p_value < 0.5).count();
        assert!((3..=27).contains(&low), "{name}: {low} of 30 p-values below one half");
    }
}

/// White noise 1.3 times the model's: the Allan deviation is 1.3 times the model's, the power 1.69 times. 20 000
/// samples: the standard deviation of the Allan ratio at 0.1 s is 0.7 %, of the power in the highest band (6666
/// coefficients) 1.7 %, of NIS 1 %; five of each.
#[test]
fn louder_noise_is_measured() {
    let found = compared(&[WHITE], &[Term::White { density: 0.13 }], 20_000, 0);
    assert_eq!(found.verdict, Verdict::Inconsistent);
    assert_eq!(failed(&found), ["allan_curve", "spectrum_ratio", "nis"], "level, not shape");
    let axis = &found.axes[0];
    assert!((axis.allan.measured[0] / axis.allan.model[0] - 1.3).abs() < 5.0 * 0.007);
    assert!((axis.spectrum.last().unwrap().ratio - 1.69).abs() < 5.0 * 0.017 * 1.69);
    let nis = axis.innovations.as_ref().unwrap().nis.unwrap().mean;
    assert!((nis - 1.69).abs() < 5.0 * 0.01 * 1.69, "{nis}");
    let effect = test(&found, "allan_curve").effect.as_ref().unwrap();
    assert!(effect.interval[0] < 1.3 && 1.3 < effect.interval[1], "{effect:?}");
}

/// Drift three times the model's or a third of it: the slow end of the curve and of the spectrum shows it and says
/// the direction, while NIS is blind to it. The ratio of variances is 9 where drift dominates: many tens of sigmas
/// of a band of 8 coefficients or more.
#[test]
fn wrong_drift_is_found_both_ways() {
    for (factor, word) in [(3.0, "more noise"), (1.0 / 3.0, "less noise")] {
        let found = compared(&[WHITE, drift(0.05)], &[WHITE, drift(0.05 * factor)], 20_000, 1);
        assert_eq!(found.verdict, Verdict::Inconsistent);
        let curve = test(&found, "allan_curve");
        assert!(!curve.pass() && curve.meaning.contains(word), "{}", curve.meaning);
        assert!((curve.effect.as_ref().unwrap().value.ln() - f64::ln(factor)).abs() < 0.5, "{}", curve.meaning);
        assert!(!test(&found, "spectrum_ratio").pass() && test(&found, "nis").pass());
    }
}

/// A line that the model lacks, of 0.4 times the power of the white noise: the spectrum says where.
#[test]
fn a_line_is_placed() {
    let line = Term::Oscillation { std_dev: 0.2, frequency_hz: 2.0, correlation_time: 20.0 };
    let found = compared(&[WHITE], &[WHITE, line], 20_000, 2);
    assert_eq!(found.verdict, Verdict::Inconsistent);
    let ratio = |hz: f64| found.axes[0].spectrum.iter().find(|b| b.from_hz <= hz && hz < b.to_hz).unwrap();
    assert!(ratio(2.0).ratio > ratio(2.0).upper && ratio(4.9).ratio < ratio(4.9).upper);
    assert!(!test(&found, "spectrum_ratio").pass() && !test(&found, "whiteness").pass());
    // with it in the model nothing is left
    assert_eq!(compared(&[WHITE, line], &[WHITE, line], 20_000, 2).verdict, Verdict::Consistent);
}

/// A known ramp is taken off the spectrum and belongs to the curve; without it in the model both see it (R τ/√2 is
/// ten times the white noise at 600 s).
#[test]
fn a_ramp_is_part_of_the_model() {
    let ramp = Term::RateRamp { slope: 1e-4 };
    assert_eq!(compared(&[WHITE, ramp], &[WHITE, ramp], 20_000, 3).verdict, Verdict::Consistent);
    let found = compared(&[WHITE], &[WHITE, ramp], 20_000, 3);
    assert!(!test(&found, "allan_curve").pass() && !test(&found, "spectrum_ratio").pass(), "{:?}", failed(&found));
}

/// The reference sensor for one hour: N²/T + 2σ²Tc/T·(1 − (Tc/T)(1 − e^(−T/Tc))) with N = 0.0562, σ = 0.0280596, Tc =
/// 193.9312 gives 0.0090075 deg/s (the leading term alone 0.0092: the published one).
#[test]
fn the_mean_of_a_log_strays_by_what_is_said() {
    let params = Params::read(&crate::support::data("params.json")).unwrap();
    let hour = log(&params, 360_000, 0);
    let found = compare(&params, &hour, 0.01).unwrap();
    let means = &found.axes[0].means;
    let x: f64 = 193.9312 / 3600.0;
    let variance = 0.0562f64.powi(2) / 3600.0 + 2.0 * 0.0280596f64.powi(2) * x * (1.0 - x * (1.0 - (-1.0 / x).exp()));
    assert!((means.std_dev.to_degrees() / variance.sqrt() - 1.0).abs() < 1e-9);
    assert!((means.std_dev.to_degrees() - 0.0090075).abs() < 1e-6, "{}", means.std_dev.to_degrees());
    assert!((means.real - hour.axes[0].rate.iter().sum::<f64>() / 360_000.0).abs() < 1e-12);
    // another run, of the same bias: within five standard deviations of the difference
    assert!(means.real != means.simulated);
    assert!((means.real - means.simulated).abs() < 5.0 * 2f64.sqrt() * means.std_dev);
    assert!(means.sentence.contains("has standard deviation 0.00900") && means.sentence.contains("proves nothing"));
}

/// Continuous terms are sampled at the log's rate; a moving average counts samples and is said to be another process.
#[test]
fn another_rate_is_said() {
    let at = |terms: &[Term], hz: f64| Params { sample_rate_hz: hz, ..params(terms) };
    let model = [WHITE, drift(0.05)];
    let found = compare(&params(&model), &log(&at(&model, 25.0), 20_000, 4), 0.01).unwrap();
    assert_eq!((found.sample_rate, found.params_sample_rate), (25.0, 10.0));
    assert_eq!(found.verdict, Verdict::Consistent);
    assert!(found.axes[0].notes[0].contains("every term is continuous"), "{:?}", found.axes[0].notes);
    let averaged = [Term::White { density: 0.02 }, Term::MovingAverage { density: 0.1, samples: 3 }];
    let found = compare(&params(&averaged), &log(&at(&averaged, 25.0), 5000, 5), 0.01).unwrap();
    assert!(found.axes[0].notes[0].contains("moving_average over 3 samples belongs to the samples"));
}

/// A log of 20 s shows nothing of a drift of 200 s: no failure, and no consent either. A length that is enough is
/// said, and is.
#[test]
fn a_short_log_decides_nothing_about_drift() {
    let model = [WHITE, Term::GaussMarkov { std_dev: 0.02, correlation_time: 200.0 }];
    let found = compared(&model, &model, 200, 6);
    assert_eq!(found.verdict, Verdict::Inconclusive, "{}", found.meaning);
    let needed: f64 =
        found.meaning.split("a log of about ").nth(1).unwrap().split(' ').next().unwrap().parse().unwrap();
    assert_eq!(compared(&model, &model, (10.0 * needed) as u64 + 3, 6).verdict, Verdict::Consistent);
    // a model without white noise has no filter, and is compared otherwise
    let found = compared(&[drift(0.05)], &[drift(0.05)], 3000, 7);
    assert!(found.axes[0].innovations.is_none() && found.axes[0].notes[0].starts_with("innovations are not tested: "));
    assert_eq!((found.verdict, found.tests.len()), (Verdict::Consistent, 3));
}

/// A log that says the same all the time, whatever read it, is refused with the axis and what to do.
#[test]
fn a_constant_axis_is_refused() {
    let mut still = log(&params(&[WHITE]), 200, 8);
    still.axes[0].rate.fill(0.5);
    let message = compare(&params(&[WHITE]), &still, 0.01).unwrap_err().to_string();
    assert!(message.starts_with("axis 'x': constant (0.5000 in SI units, 200 samples)"), "{message}");
}

#[test]
fn the_command_writes_one_document_and_its_views() {
    let bench = Bench::new();
    let params = crate::support::data("params.json").display().to_string();
    bench.ok(&format!("simulate {params} -o log.npy --duration 20min --seed 3"));
    let flags = "--alpha 0.02 -o out.json --report out.html --plot out.svg";
    let printed = bench.ok(&format!("compare {params} log.npy --json {flags}"));
    assert_eq!(printed, bench.read("out.json"));
    let document: serde_json::Value = serde_json::from_str(&printed).unwrap();
    assert_eq!((&document["format"], &document["verdict"]), (&"kfdesign-compare/1".into(), &"consistent".into()));
    assert_eq!(document["alpha"], 0.02);
    let schema: serde_json::Value = serde_json::from_str(&bench.ok("schema compare")).unwrap();
    let keys = |of: &serde_json::Value| of.as_object().unwrap().keys().cloned().collect::<Vec<_>>();
    assert_eq!(keys(&schema["properties"]), keys(&document));
    assert_eq!(keys(&schema["$defs"]["AxisComparison"]["properties"]), keys(&document["axes"][0]));
    for title in ["y: Allan deviation and envelope of the model", "y: spectrum of the log over that of the model"] {
        assert!(crate::support::figure(&bench.read("out.html"), title).contains("98.00 %"));
        assert!(bench.read("out.svg").contains(title));
    }
    // N is twice the model's
    bench.file("loud.json", std::fs::read_to_string(&params).unwrap().replace("0.0562", "0.1124"));
    let out = bench.run("compare loud.json log.npy");
    assert_eq!(out.status, 1);
    assert!(out.stdout.contains("\ninconsistent: x: ") && out.stdout.contains("proves nothing"), "{}", out.stdout);
}

/// What of a file is held against all white noise of a log is named for what it is.
#[test]
fn white_noise_in_parts_is_not_called_white() {
    let filter = Filter::new(&[1.0], &[1.0, -0.5]).unwrap();
    for (terms, name) in [
        (vec![WHITE], "white.density"),
        (vec![WHITE, Term::MovingAverage { density: 0.1, samples: 2 }], "wideband.density"),
        (vec![WHITE, Term::BandLimit { density: 0.1, filter }], "wideband.density"),
    ] {
        let file = params(&terms);
        let rows = parameters(&file, &log(&file, 2000, 0), &Unit::parse("rad/s").unwrap()).unwrap();
        assert_eq!(rows[0].parameter, name);
        assert!(rows[0].meaning.starts_with("x: your file says N = "), "{}", rows[0].meaning);
    }
}
