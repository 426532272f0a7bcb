//! Logs to noise parameters: recovery of known truth, honesty about what a log cannot tell, the paper's recipe.

use std::time::Instant;

use kfdesign::identify::{Identified, Method, ModelChoice, identify_axis, parse_model};
use kfdesign::noise::{NoiseModel, Term};
use kfdesign::numerics::random::{StreamId, stream};
use kfdesign::units::Unit;

/// The reference sensor in deg, s (0.0562 deg/s/√Hz, 0.02806 deg/s, 193.93 s).
const N: f64 = 0.0562;
const SIGMA: f64 = 0.02806;
const TC: f64 = 193.93;

fn white(density: f64) -> Term {
    Term::White { density }
}
fn gauss_markov(std_dev: f64, correlation_time: f64) -> Term {
    Term::GaussMarkov { std_dev, correlation_time }
}

/// A log of these terms; one stream per term.
fn log(terms: &[Term], samples: usize, dt: f64, seed: u64, run: u64) -> Vec<f64> {
    let mut sum = vec![0.0; samples];
    let mut part = vec![0.0; samples];
    for (i, term) in terms.iter().enumerate() {
        term.sample_path(dt, stream(seed, StreamId { run, axis: 0, term: i as u32 })).fill(&mut part);
        sum.iter_mut().zip(&part).for_each(|(s, p)| *s += p);
    }
    sum
}

/// Numbers are taken as rad/s, whatever they are.
fn identify(rate: &[f64], dt: f64, choice: &ModelChoice) -> Identified {
    identify_axis("x", rate, dt, &Unit::parse("rad/s").unwrap(), Method::Allan, choice).unwrap()
}

fn label(model: &NoiseModel) -> String {
    let mut names: Vec<String> = model.terms.iter().map(|t| format!("{:?}", t.kind())).collect();
    names.sort();
    names.join("+")
}

/// ln of N, σ, Tc of a white + Gauss-Markov model.
fn logs(model: &NoiseModel) -> [f64; 3] {
    let mut out = [f64::NAN; 3];
    for term in &model.terms {
        match *term {
            Term::White { density } => out[0] = density.ln(),
            Term::GaussMarkov { std_dev, correlation_time } => {
                out[1] = std_dev.ln();
                out[2] = correlation_time.ln();
            }
            _ => {}
        }
    }
    out
}

/// Bias, efficiency and coverage of the Allan fit, and how often each model is chosen.
/// `cargo test --release -- --ignored --nocapture identify_study`
#[test]
#[ignore = "a study of several minutes, not a check: it prints the table of docs/validation.md"]
fn identify_study() {
    let runs: u64 = std::env::var("KFDESIGN_STUDY_RUNS").ok().and_then(|v| v.parse().ok()).unwrap_or(200);
    let forced = parse_model("white+gm").unwrap();
    // √ of the diagonal of the inverse Whittle information, ln N at 1 Hz, ln σ, ln Tc (formulas: 2 h; scales as T^(-1/2))
    let bound_2h = [8.577e-3, 0.11871, 0.28511];
    for hours in [1.0_f64, 2.0, 10.0] {
        let samples = (hours * 3600.0) as usize;
        let started = Instant::now();
        let mut errors: Vec<[f64; 3]> = Vec::new();
        let mut covered = [0; 3];
        let mut good_fits = 0;
        for run in 0..runs {
            let rate = log(&[white(N), gauss_markov(SIGMA, TC)], samples, 1.0, 11, run);
            let found = identify(&rate, 1.0, &forced);
            good_fits += usize::from(found.fit_p_value >= 0.01);
            if found.model.terms.len() < 2 {
                continue;
            }
            let truth = [N.ln(), SIGMA.ln(), TC.ln()];
            let estimate = logs(&found.model);
            errors.push([0, 1, 2].map(|i| estimate[i] - truth[i]));
            for (i, interval) in intervals(&found).into_iter().enumerate() {
                covered[i] += usize::from(interval[0].ln() <= truth[i] && truth[i] <= interval[1].ln());
            }
        }
        let n = errors.len() as f64;
        println!(
            "white+gm forced, {hours} h at 1 Hz, {runs} logs, {} with all parameters identified, {good_fits} with p >= 0.01, {:.2} s a log",
            errors.len(),
            started.elapsed().as_secs_f64() / runs as f64
        );
        for (i, name) in ["N", "sigma", "Tc"].iter().enumerate() {
            let mean = errors.iter().map(|e| e[i]).sum::<f64>() / n;
            let sd = (errors.iter().map(|e| (e[i] - mean).powi(2)).sum::<f64>() / (n - 1.0)).sqrt();
            let rms = (errors.iter().map(|e| e[i] * e[i]).sum::<f64>() / n).sqrt();
            let bound = bound_2h[i] * (2.0 / hours).sqrt();
            println!(
                "  {name:6} mean error {mean:+.4}  sd {sd:.4}  rms {rms:.4}  bound {bound:.4}  efficiency {:.2}  coverage {:.3}",
                (bound / sd).powi(2),
                covered[i] as f64 / n
            );
        }
    }
    let k = SIGMA * (2.0 / TC).sqrt() / 3.0;
    let cases: [(&str, Vec<Term>, f64); 7] = [
        ("white, 2 h", vec![white(N)], 7200.0),
        ("white + gm, 2 h", vec![white(N), gauss_markov(SIGMA, TC)], 7200.0),
        ("white + gm, 10 h", vec![white(N), gauss_markov(SIGMA, TC)], 36_000.0),
        ("white + gm, 2000 s", vec![white(N), gauss_markov(SIGMA, TC)], 2000.0),
        ("white + rrw, 2 h", vec![white(N), Term::RateRandomWalk { density: k }], 7200.0),
        ("white + flicker, 2 h", vec![white(N), Term::BiasInstability { coefficient: 0.012 }], 7200.0),
        ("white + ramp, 2 h", vec![white(N), Term::RateRamp { slope: 2e-5 }], 7200.0),
    ];
    for (name, terms, seconds) in cases {
        let samples = 4096;
        let dt = seconds / samples as f64;
        let started = Instant::now();
        let mut counts = std::collections::BTreeMap::new();
        for run in 0..runs {
            let found = identify(&log(&terms, samples, dt, 5, run), dt, &ModelChoice::Auto);
            *counts.entry(label(&found.model)).or_insert(0) += 1;
        }
        println!("{name}: {counts:?} of {runs}, {:.2} s a log", started.elapsed().as_secs_f64() / runs as f64);
    }
}

/// 95 % intervals of N, σ, Tc.
fn intervals(found: &Identified) -> [[f64; 2]; 3] {
    use kfdesign::params::TermEntry;
    let mut out = [[f64::NAN; 2]; 3];
    for entry in &found.params.terms {
        match entry {
            TermEntry::White { density } => out[0] = density.interval_si().unwrap(),
            TermEntry::GaussMarkov { std_dev, correlation_time } => {
                out[1] = std_dev.interval_si().unwrap();
                out[2] = correlation_time.interval_si().unwrap();
            }
            _ => {}
        }
    }
    out
}
