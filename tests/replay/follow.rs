//! A filter that follows its noise: what it finds, that it is the filter of what it found, that it looks at nothing
//! that comes later.

use kfdesign::consistency::Verdict;
use kfdesign::filter::FilterDesign;
use kfdesign::identify::Follower;
use kfdesign::noise::{Filter, NoiseModel, Term};
use kfdesign::numerics::random::{StreamId, stream};
use kfdesign::params::Params;
use kfdesign::replay::{AxisResult, Estimates, LogShape, Options, Replayer};
use kfdesign::tune::{TuneOptions, tune};
use kfdesign::units::Quantity;

use rayon::prelude::*;

use super::{block, replay, shape};
use crate::support::Bench;

const DT: f64 = 0.01;

fn path(terms: &[Term], samples: usize, seed: u64, run: u64) -> Vec<f64> {
    let (mut sum, mut part) = (vec![0.0; samples], vec![0.0; samples]);
    for (i, term) in terms.iter().enumerate() {
        term.sample_path(DT, stream(seed, StreamId { run, axis: 0, term: i as u32 })).fill(&mut part);
        sum.iter_mut().zip(&part).for_each(|(s, p)| *s += p);
    }
    sum
}

fn line(std_dev: f64, frequency_hz: f64, correlation_time: f64) -> Term {
    Term::Oscillation { std_dev, frequency_hz, correlation_time }
}

/// Two zeros, two poles.
fn low_pass(zeros: [f64; 2], poles: [f64; 2]) -> Filter {
    Filter::new(&[1.0, zeros[0], zeros[1]], &[1.0, poles[0], poles[1]]).unwrap()
}

/// As `identify` writes a band limit: with white noise of 1e-5 of the variance of its innovations.
fn limited(density: f64, filter: Filter) -> [Term; 2] {
    [Term::White { density: density * 1e-5_f64.sqrt() * filter.numerator()[0] }, Term::BandLimit { density, filter }]
}

/// params.json of one axis, rad/s and 100 Hz, its bias known.
fn params(terms: &[Term]) -> String {
    let part = |term: &Term| match *term {
        Term::White { density } => format!(r#""white": {{"density": "{density} rad/s/sqrt(Hz)"}}"#),
        Term::Quantization { coefficient } => format!(r#""quantization": {{"coefficient": "{coefficient} rad"}}"#),
        Term::MovingAverage { density, samples } => {
            format!(r#""moving_average": {{"density": "{density} rad/s/sqrt(Hz)", "samples": {samples}}}"#)
        }
        Term::BandLimit { density, filter } => format!(
            r#""band_limit": {{"density": "{density} rad/s/sqrt(Hz)", "numerator": {:?}, "denominator": {:?}}}"#,
            filter.numerator(),
            filter.denominator()
        ),
        Term::Oscillation { std_dev, frequency_hz, correlation_time } => format!(
            r#""oscillation": [{{"std_dev": "{std_dev} rad/s", "frequency": "{frequency_hz} Hz", "correlation_time": "{correlation_time} s"}}]"#
        ),
        Term::GaussMarkov { std_dev, correlation_time } => {
            format!(r#""gauss_markov": [{{"std_dev": "{std_dev} rad/s", "correlation_time": "{correlation_time} s"}}]"#)
        }
        Term::BiasInstability { coefficient } => {
            format!(r#""bias_instability": {{"coefficient": "{coefficient} rad/s"}}"#)
        }
        Term::RateRandomWalk { density } => format!(r#""rate_random_walk": {{"density": "{density} rad/s/sqrt(s)"}}"#),
        Term::RateRamp { slope } => format!(r#""rate_ramp": {{"slope": "{slope} rad/s^2"}}"#),
    };
    let terms: Vec<String> = terms.iter().map(part).collect();
    format!(
        r#"{{"format": "kfdesign-params/1", "quantity": "angular-rate", "sample_rate": "100 Hz", "axes": [{{"name": "x", "bias": "0 rad/s",
        "turn_on_bias": {{"std_dev": "1e-12 rad/s"}}, {}}}]}}"#,
        terms.join(", ")
    )
}

fn designed(terms: &[Term]) -> FilterDesign {
    let params = Params::from_json(&params(terms), "params.json").unwrap();
    tune(&params, &TuneOptions::default()).unwrap().design
}

fn following(memory_s: f64) -> Options {
    Options { follow: Some(memory_s), ..Options::default() }
}

/// ν/√S of every row.
fn innovations(design: &FilterDesign, z: &[f64], missing: &[u64], options: Options) -> (Vec<f64>, AxisResult) {
    let mut replayer = Replayer::new(design, &shape(&["x"], 1.0 / DT), options).unwrap();
    let mut estimates = Estimates::default();
    replayer.push(&block(z, missing, DT, 0..z.len()), Some(&mut estimates));
    let update = &estimates.axes[0].updates[0];
    let all = update.innovation.iter().zip(&update.innovation_sigma).map(|(v, s)| v / s).collect();
    (all, replayer.finish().axes.remove(0))
}

/// White noise alone: n − 1 coefficients of the window with the power Σ (x − mean)², and (m − n)/n times as many
/// with that of the design. The search ends within 1e-5 in ln L; ln N has the information 2 m, so within √(1e-5/m) =
/// 1e-4 of the maximum.
#[test]
fn white_noise_is_the_mean_of_window_and_design() {
    let z = path(&[Term::White { density: 0.003 }], 1000, 71, 0);
    for (samples, memory) in [(200, 1000), (1000, 1000)] {
        let window = &z[..samples];
        let mut follower = Follower::new(&NoiseModel { terms: vec![Term::White { density: 0.002 }] }, DT, memory);
        assert!(follower.follow(window));
        let mean = window.iter().sum::<f64>() / samples as f64;
        let power = window.iter().map(|v| (v - mean).powi(2)).sum::<f64>() * DT / (samples as f64 - 1.0);
        let share = samples as f64 / memory as f64;
        let expected = (share * power + (1.0 - share) * 0.002_f64.powi(2)).sqrt();
        let [Term::White { density }] = follower.noise().terms[..] else { panic!("{:?}", follower.noise()) };
        assert!((density / expected - 1.0).abs() < 2e-4, "{density} {expected}");
    }
}

/// Nothing is learnt from fewer than 30 samples, nor from samples that are all the same; drift stays as it is.
#[test]
fn what_says_nothing_moves_nothing() {
    let drift = Term::GaussMarkov { std_dev: 0.001, correlation_time: 5.0 };
    let terms = vec![Term::White { density: 0.002 }, drift];
    let mut follower = Follower::new(&NoiseModel { terms: terms.clone() }, DT, 1000);
    let z = path(&terms, 1000, 72, 0);
    assert!(!follower.follow(&z[..29]) && !follower.follow(&[0.1; 500]));
    assert!(follower.follow(&z));
    let [Term::White { density }, Term::GaussMarkov { std_dev, correlation_time }] = follower.noise().terms[..] else {
        panic!("{:?}", follower.noise())
    };
    // through a logarithm and back
    assert!((std_dev / 0.001 - 1.0).abs() < 1e-12 && (correlation_time / 5.0 - 1.0).abs() < 1e-12);
    assert!((density / 0.002 - 1.0).abs() > 1e-6);
}

/// After the last change the filter is that of the parameters it names, tuned anew: innovations agree once the start
/// is forgotten. Flicker has to be in the design, for its fast states are part of R. The pole of the drift (10 s and
/// less) has 100 s for it: e⁻¹⁰ of what differs, some per mille.
#[test]
fn the_filter_is_that_of_what_was_found() {
    let kinds: [Vec<Term>; 3] = [
        vec![
            Term::White { density: 0.002 },
            Term::MovingAverage { density: 0.001, samples: 3 },
            Term::Quantization { coefficient: 1e-5 },
            line(0.01, 12.0, 2.0),
            Term::GaussMarkov { std_dev: 0.002, correlation_time: 3.0 },
        ],
        vec![
            Term::White { density: 0.002 },
            line(0.01, 12.0, 2.0),
            Term::GaussMarkov { std_dev: 0.005, correlation_time: 0.05 },
            Term::BiasInstability { coefficient: 1e-5 },
        ],
        [
            &limited(0.002, low_pass([0.5, 0.06], [-1.0, 0.4]))[..],
            &[Term::GaussMarkov { std_dev: 0.002, correlation_time: 3.0 }],
        ]
        .concat(),
    ];
    for terms in kinds {
        let mut true_terms = terms.clone();
        for term in &mut true_terms {
            *term = match *term {
                Term::White { density } => Term::White { density: 1.3 * density },
                Term::Oscillation { std_dev, correlation_time, .. } => line(2.0 * std_dev, 11.9, correlation_time),
                Term::BandLimit { density, .. } => {
                    Term::BandLimit { density: 3.0 * density, filter: low_pass([0.6, 0.1], [-0.4, 0.1]) }
                }
                term => term,
            };
        }
        // the only change: after 200 s
        let z = path(&true_terms, 30_000, 73, 0);
        let (followed, result) = innovations(&designed(&terms), &z, &vec![0; z.len()], following(3200.0));
        let found = result.follow.unwrap();
        assert_eq!(found.changes, 1);
        let value = |name: &str| found.parameters.iter().find(|p| p.parameter == name).map(|p| p.now);
        let coefficients = |name: &str| [0, 1, 2].map(|k| value(&format!("band_limit.{name}[{k}]")).unwrap());
        let limit = value("band_limit.density").map(|density| {
            limited(density, Filter::new(&coefficients("numerator"), &coefficients("denominator")).unwrap())
        });
        let end: Vec<Term> = terms
            .iter()
            .map(|term| match *term {
                Term::White { .. } if limit.is_some() => limit.unwrap()[0],
                Term::BandLimit { .. } => limit.unwrap()[1],
                Term::White { .. } => Term::White { density: value("white.density").unwrap() },
                Term::MovingAverage { samples, .. } => {
                    Term::MovingAverage { density: value("moving_average.density").unwrap(), samples }
                }
                Term::Quantization { .. } => {
                    Term::Quantization { coefficient: value("quantization.coefficient").unwrap() }
                }
                Term::Oscillation { .. } => {
                    let [a, b, c] = ["std_dev", "frequency", "correlation_time"]
                        .map(|name| value(&format!("oscillation.{name}")).unwrap());
                    line(a, b, c)
                }
                Term::GaussMarkov { .. } if value("gauss_markov.std_dev").is_some() => Term::GaussMarkov {
                    std_dev: value("gauss_markov.std_dev").unwrap(),
                    correlation_time: value("gauss_markov.correlation_time").unwrap(),
                },
                term => term,
            })
            .collect();
        let (tuned, _) = innovations(&designed(&end), &z, &vec![0; z.len()], Options::default());
        let (before, _) = innovations(&designed(&terms), &z, &vec![0; z.len()], Options::default());
        let largest = |other: &[f64], from: usize, to: usize| {
            (from..to).map(|k| (followed[k] - other[k]).abs()).fold(0.0, f64::max)
        };
        assert_eq!(largest(&before, 0, 20_000), 0.0, "{terms:?}");
        assert!(largest(&before, 29_000, 30_000) > 0.1, "{terms:?}");
        assert!(largest(&tuned, 29_000, 30_000) < 5e-3, "{terms:?}: {}", largest(&tuned, 29_000, 30_000));
    }
}

/// What comes later changes nothing before it, and a gap begins the window anew: with one every 20 samples no window
/// has the 30 that it takes.
#[test]
fn it_looks_at_the_past_alone() {
    let terms = [Term::White { density: 0.002 }, line(0.01, 12.0, 2.0)];
    let design = designed(&terms);
    let one = path(&terms, 6000, 74, 0);
    let mut other = one.clone();
    other[4000..].iter_mut().for_each(|v| *v *= 3.0);
    let none = vec![0; one.len()];
    let (first, result) = innovations(&design, &one, &none, following(10.0));
    let (second, _) = innovations(&design, &other, &none, following(10.0));
    assert_eq!(first[..4000], second[..4000]);
    assert_ne!(first[4001..], second[4001..]);
    assert_eq!(result.follow.unwrap().changes, (6000 / 63) as u64);
    let gaps: Vec<u64> = (0..one.len()).map(|k| u64::from(k % 20 == 0)).collect();
    let (_, result) = innovations(&design, &one, &gaps, following(4.8));
    assert_eq!(result.follow.unwrap().changes, 0);
}

/// Noise that stays the same, twenty logs of 12,000 samples with a memory of 3000: mean NIS within 4.9 standard
/// deviations of 1 (variance 2/n of the samples and 2/m of the level; 2e-5 for all), the largest of 50
/// autocorrelations below 5/√n (3e-5 each, 6e-4 for all; what the parameters are off adds less than a tenth of
/// 1/√n).
#[test]
fn noise_that_stays_the_same_is_left_in_peace() {
    let terms = [Term::White { density: 0.002 }, line(0.02, 12.0, 1.0), Term::RateRandomWalk { density: 1e-4 }];
    let design = designed(&terms);
    for run in 0..20 {
        let z = path(&terms, 12_000, 75, run);
        let axis = replay(&design, &z, following(30.0)).axes.remove(0);
        assert!(axis.follow.unwrap().changes > 60);
        let (nis, white) = (axis.nis.unwrap(), axis.whiteness.unwrap());
        let sd = (2.0 / 12_000.0 + 2.0 / 3000.0_f64).sqrt();
        assert!((nis.mean - 1.0).abs() < 4.9 * sd, "run {run}: {}", nis.mean);
        assert!(white.max_abs_autocorrelation < 5.0 / 12_000_f64.sqrt(), "run {run}: {white:?}");
    }
}

/// A line that slows down from 12 to 11 Hz within 400 s while the white noise grows by 20 %: the filter of the first
/// 200 s fails, the one that follows does not. Bounds as above; the parameters lag behind by half of the memory,
/// which adds to both.
#[test]
fn a_line_that_moves_is_followed() {
    let bench = Bench::new();
    let part = |i: u64, seconds: f64, frequency: f64, density: f64| {
        path(&[Term::White { density }, line(0.02, frequency, 1.0)], (seconds / DT) as usize, 76, i)
    };
    let mut z = part(0, 200.0, 12.0, 0.002);
    for i in 0..20 {
        let share = f64::from(i + 1) / 20.0;
        z.extend(part(u64::from(i as u32) + 1, 20.0, 12.0 - share, 0.002 * (1.0 + 0.2 * share)));
    }
    let rows = z.iter().map(|v| format!("{v}\n"));
    bench.file("log.csv", std::iter::once("gyro_x (rad/s)\n".to_string()).chain(rows).collect::<String>());
    bench.ok("identify log.csv --rate 100 --end 200 -o params.json");
    bench.ok("tune params.json -o filter.json");
    let run = |more: &str| {
        let outcome = bench.run(&format!("replay filter.json log.csv --rate 100 --start 200 {more}"));
        // said only where it would help
        let said = outcome.stderr.contains("the wideband noise is not what the design says");
        assert_eq!(said, more == "--json", "{more}: {}", outcome.stderr);
        (outcome.status, outcome.stdout)
    };
    let axis = |text: &str| serde_json::from_str::<serde_json::Value>(text).unwrap()["axes"][0].clone();
    let told = |axis: &serde_json::Value| {
        [&axis["whiteness"]["max_abs_autocorrelation"], &axis["nis"]["mean"]].map(|v| v.as_f64().unwrap())
    };
    let [still_r, still_nis] = told(&axis(&run("--json").1));
    assert!(still_r > 0.05 && still_nis > 1.1, "{still_r} {still_nis}");
    let followed = axis(&run("--follow 40s --json").1);
    let [r, nis] = told(&followed);
    assert!(r < 5.0 / 40_000_f64.sqrt() && (nis - 1.0).abs() < 0.03, "{r} {nis}");
    let frequency =
        followed["follow"]["parameters"].as_array().unwrap().iter().find(|p| p["parameter"] == "oscillation.frequency");
    let end = frequency.unwrap()["now"].as_f64().unwrap();
    assert!((end - 11.05).abs() < 0.1, "{end}");
    let text = run("--follow 40s").1;
    for words in ["Noise that was followed", "oscillation.frequency", "found along the log, not that of the design"] {
        assert!(text.contains(words), "{words}: {text}");
    }
}

/// A memory beside which the log is short changes nothing, and says so.
#[test]
fn too_long_a_memory_is_told() {
    let design = designed(&[Term::White { density: 0.002 }, line(0.01, 12.0, 2.0)]);
    let z = path(&[Term::White { density: 0.002 }], 6000, 80, 0);
    let result = |memory_s: f64| replay(&design, &z, following(memory_s));
    let long = result(1e30);
    assert_eq!(long.axes[0].follow.as_ref().unwrap().changes, 0);
    assert!(long.meaning.ends_with("it is that of the design"), "{}", long.meaning);
    let short = result(20.0);
    assert!(short.meaning.ends_with("not that of the design"), "{}", short.meaning);
}

/// What cannot be followed is refused with one line and exit 2.
#[test]
fn refusals() {
    let bench = Bench::new();
    bench.file("filter.json", designed(&[Term::White { density: 0.002 }, line(0.01, 12.0, 2.0)]).to_json());
    bench.file("log.csv", "t (s),x (rad/s)\n0,0.1\n0.01,0.2\n0.02,0.1\n");
    for (more, words) in [
        (
            "--follow 1s",
            "axis 'x': its noise cannot be followed: 100 samples say too little of its noise; give at least 1.200 s",
        ),
        ("--follow 5", "--follow 5: expected a number and a unit"),
        ("--follow=-5s", "follow is -5, expected seconds, more than 0"),
        ("--follow 10deg", "--follow 10deg"),
        ("--follow 10s --form square-root", "only the form joseph takes new noise"),
    ] {
        let outcome = bench.run(&format!("replay filter.json log.csv {more}"));
        let errors = outcome.stderr.lines().filter(|line| line.starts_with("kfdesign: ")).count();
        assert_eq!((outcome.status, errors), (2, 1), "{more}: {}", outcome.stderr);
        assert!(outcome.stderr.contains(words), "{more}: {}", outcome.stderr);
    }
    let refused = |design: &FilterDesign| {
        let shape =
            LogShape { axes: vec!["x".into()], quantity: Quantity::AngularRate, sample_rate_hz: 100.0, aids: 0 };
        Replayer::new(design, &shape, following(10.0)).map(|_| ()).unwrap_err().to_string()
    };
    // matrices that are not those of the noise terms
    let terms = [Term::White { density: 0.002 }, line(0.01, 12.0, 2.0)];
    for change in [
        |design: &mut FilterDesign| design.axes[0].model.r *= 0.5,
        |design: &mut FilterDesign| design.axes[0].model.q *= 2.0,
        |design: &mut FilterDesign| design.axes[0].model.f[(1, 2)] *= 1.01,
        |design: &mut FilterDesign| design.axes[0].model.h[(0, 1)] = 0.5,
        |design: &mut FilterDesign| design.axes[0].model.every = vec![2],
        |design: &mut FilterDesign| design.axes[0].noise.terms.clear(),
    ] {
        let mut design = designed(&terms);
        change(&mut design);
        assert!(refused(&design).contains("its matrices are not those of its noise terms"), "{}", refused(&design));
    }
    let mut design = designed(&terms);
    design.plant = "rate".into();
    assert!(refused(&design).contains("the plant is 'rate'"), "{}", refused(&design));
}

/// A line much narrower than a bin of a smooth spectrum would be there (40 Hz of 50, 100 s): its width is seen. ln
/// Tc is known to √(2 Tc/T) = 0.3, the frequency to 0.014 Hz; bounds are four and five of these (6e-5).
#[test]
fn narrow_lines_are_seen() {
    let white = Term::White { density: 0.002 };
    let z = path(&[white, line(0.02, 40.0, 5.0)], 10_000, 77, 0);
    let mut follower = Follower::new(&NoiseModel { terms: vec![white, line(0.02, 40.02, 5.0)] }, DT, 10_000);
    assert!(follower.follow(&z));
    let [_, Term::Oscillation { frequency_hz, correlation_time, .. }] = follower.noise().terms[..] else { panic!() };
    assert!((frequency_hz - 40.0).abs() < 0.07, "{frequency_hz}");
    assert!((correlation_time / 5.0).ln().abs() < 1.2, "{correlation_time}");
}

/// A wide P0 and a log that begins far from x0.
fn off() -> (FilterDesign, Vec<f64>) {
    let terms = [Term::White { density: 0.002 }, line(0.01, 12.0, 2.0)];
    let mut design = designed(&terms);
    design.axes[0].model.p0[(0, 0)] = 1.0;
    let z = path(&terms, 3000, 78, 0).into_iter().map(|v| v + 0.5).collect();
    (design, z)
}

/// A sample beyond the gate tells no more of the noise than one that is missing.
#[test]
fn what_is_not_used_is_not_learnt_from() {
    let (design, mut z) = off();
    let options = Options { gate: Some(6.0), ..following(10.0) };
    let mut found = [1e3, f64::NAN].map(|value| {
        z[500] = value;
        innovations(&design, &z, &vec![0; z.len()], options).1.follow.unwrap()
    });
    assert_eq!(found[0], found[1]);
    z[500] = 0.5;
    found[1] = innovations(&design, &z, &vec![0; z.len()], options).1.follow.unwrap();
    let density = |i: usize| found[i].parameters[0].now;
    assert!((density(0) / density(1) - 1.0).abs() < 0.01, "{} {}", density(0), density(1));
}

/// New noise leaves the estimate and its covariance: what is known of a constant bias never becomes less. The test
/// of x0 ends where the first change is.
#[test]
fn the_state_stays() {
    let (design, z) = off();
    let missing = vec![0; z.len()];
    let mut replayer = Replayer::new(&design, &shape(&["x"], 1.0 / DT), following(10.0)).unwrap();
    let mut estimates = Estimates::default();
    replayer.push(&block(&z, &missing, DT, 0..z.len()), Some(&mut estimates));
    let sigma = &estimates.axes[0].sigmas[0];
    assert!(sigma.windows(2).all(|pair| pair[1] <= pair[0] * (1.0 + 1e-12)));
    let followed = replayer.finish().axes.remove(0);
    assert_eq!(followed.follow.as_ref().unwrap().changes, 3000 / 63);
    let (_, short) = innovations(&design, &z[..63], &missing[..63], Options::default());
    assert_eq!(followed.start.unwrap().sigmas, short.start.unwrap().sigmas);
}

/// `cargo test --release -- --ignored --nocapture follow_study`: verdicts on 300 logs of five minutes each of the
/// design's own noise, and on filters whose drift is 1.5 times too large or too small, by memory.
#[test]
#[ignore = "prints a table for docs/validation.md"]
fn follow_study() {
    let noise = |factor: f64| {
        [
            Term::White { density: 0.002 },
            line(0.02, 12.0, 1.0),
            Term::GaussMarkov { std_dev: 0.002 * factor, correlation_time: 5.0 },
        ]
    };
    let designs = [1.0, 1.5, 1.0 / 1.5].map(|factor| designed(&noise(factor)));
    for memory in [None, Some(100.0), Some(30.0), Some(10.0), Some(3.0)] {
        let run = |run: u64| {
            let z = path(&noise(1.0), 30_000, 79, run);
            let options = Options { follow: memory, ..Options::default() };
            designs.each_ref().map(|design| {
                let result = replay(design, &z, options);
                let axis = &result.axes[0];
                let white = axis.whiteness.as_ref().unwrap();
                let broken = white.max_abs_autocorrelation > 3.72 / 30_000_f64.sqrt();
                let wrong = result.verdict == Verdict::Inconsistent;
                (wrong, axis.nis.unwrap().mean, broken, axis.log_likelihood)
            })
        };
        let all: Vec<_> = (0..300).into_par_iter().map(run).collect();
        let wrong = |i: usize| all.iter().filter(|logs| logs[i].0).count();
        let mean = |of: &dyn Fn(f64) -> f64| all.iter().map(|logs| of(logs[0].1)).sum::<f64>() / 300.0;
        let middle = mean(&|nis| nis);
        println!(
            "memory {memory:?}: inconsistent {} (drift right), {} (too large), {} (too small); NIS {middle:.4}, sd {:.4}; max |r| beyond its 1 % bound {}; ln L {:.1}",
            wrong(0),
            wrong(1),
            wrong(2),
            mean(&|nis| (nis - middle).powi(2)).sqrt(),
            all.iter().filter(|logs| logs[0].2).count(),
            all.iter().map(|logs| logs[0].3).sum::<f64>() / 300.0,
        );
    }
}
