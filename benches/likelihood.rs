//! Maximum likelihood of white noise and one Gauss-Markov process: ours, from samples in memory to everything
//! `identify` gives (estimates, intervals, the Allan curve beside them), against the same estimates by hand, and its
//! cost by number of samples.
//!
//! By hand: mean taken off, scalar filter whose gain is kept once it has settled, BFGS on logarithms with central
//! differences, one thread. With KFDESIGN_BENCH_DATA=FOLDER also on `rate_1e6.f64` there (deg/s, 100 Hz, raw
//! little-endian f64).
#![allow(clippy::print_stdout, reason = "figures are what the bench is for")]

use std::path::Path;
use std::time::Instant;

use kfdesign::filter::likelihood::{Stretch, diffuse_log_likelihoods};
use kfdesign::identify::{Identified, Method, ModelChoice, identify_axis};
use kfdesign::model::{LinearModel, sensor_errors};
use kfdesign::noise::{Kind, NoiseModel, Term};
use kfdesign::numerics::random::{StreamId, fill_normal, stream};
use kfdesign::units::{Quantity, Unit};

const DT: f64 = 0.01;
/// deg/s/√Hz, deg/s, s.
const TRUTH: [f64; 3] = [0.0035, 0.002, 100.0];

fn simulated(n: usize) -> Vec<f64> {
    let [density, sigma, time] = TRUTH;
    let phi = (-DT / time).exp();
    let (mut white, mut drive) = (vec![0.0; n], vec![0.0; n]);
    fill_normal(&mut stream(1, StreamId { run: 0, axis: 0, term: 0 }), &mut white);
    fill_normal(&mut stream(1, StreamId { run: 0, axis: 0, term: 1 }), &mut drive);
    let mut drift = sigma * drive[0];
    let mut next = |(w, d): (&f64, &f64)| {
        let z = 0.05 + drift + density / DT.sqrt() * w;
        drift = phi * drift + sigma * (1.0 - phi * phi).sqrt() * d;
        z
    };
    white.iter().zip(&drive).map(&mut next).collect()
}

/// −ln L of the log less its mean; logarithms of N, sigma, Tc.
fn scalar(y: &[f64], [n, s, t]: [f64; 3]) -> f64 {
    let (r, variance, phi) = ((2.0 * n).exp() / DT, (2.0 * s).exp(), (-DT / t.exp()).exp());
    let q = -variance * (-2.0 * DT / t.exp()).exp_m1();
    let (mut x, mut p, mut sum, mut logs, mut k) = (0.0, variance, 0.0, 0.0, 0);
    while k < y.len() {
        let s = p + r;
        let (v, gain) = (y[k] - x, p / s);
        sum += v * v / s;
        logs += s.ln();
        x = phi * (x + gain * v);
        let next = phi * phi * (p - gain * p) + q;
        k += 1;
        if (next - p).abs() < 1e-16 * p {
            break;
        }
        p = next;
    }
    let s = p + r;
    let (closed, gain) = (phi * (1.0 - p / s), phi * p / s);
    let mut rest = 0.0;
    for y in &y[k..] {
        let v = y - x;
        rest += v * v;
        x = closed * x + gain * y;
    }
    let left = (y.len() - k) as f64;
    0.5 * (sum + rest / s + logs + left * s.ln() + y.len() as f64 * std::f64::consts::TAU.ln())
}

/// Logarithms at the maximum, −ln L there, and how many likelihoods it took.
fn by_hand(z: &[f64]) -> ([f64; 3], f64, usize) {
    let mean = z.iter().sum::<f64>() / z.len() as f64;
    let y: Vec<f64> = z.iter().map(|z| z - mean).collect();
    let deviation = |x: &[f64]| (x.iter().map(|v| v * v).sum::<f64>() / x.len() as f64).sqrt();
    let steps: Vec<f64> = y.windows(2).take(100_000).map(|pair| pair[1] - pair[0]).collect();
    let mut calls = 0;
    let mut f = |at: [f64; 3]| {
        calls += 1;
        scalar(&y, at)
    };
    const STEP: f64 = 5e-4;
    let mut at = [(deviation(&steps) * (0.5 * DT).sqrt()).ln(), (deviation(&y) / 10.0).ln(), 10_f64.ln()];
    let mut value = f(at);
    let slope = |f: &mut dyn FnMut([f64; 3]) -> f64, at: [f64; 3]| -> [f64; 3] {
        std::array::from_fn(|i| {
            let mut side = |by: f64| {
                let mut moved = at;
                moved[i] += by;
                f(moved)
            };
            (side(STEP) - side(-STEP)) / (2.0 * STEP)
        })
    };
    let mut gradient = slope(&mut f, at);
    let mut inverse = [[0.0; 3]; 3];
    (0..3).for_each(|i| inverse[i][i] = 1.0 / gradient.iter().map(|g| g * g).sum::<f64>().sqrt());
    for _ in 0..200 {
        let step: [f64; 3] = std::array::from_fn(|i| -(0..3).map(|k| inverse[i][k] * gradient[k]).sum::<f64>());
        let fall: f64 = -step.iter().zip(&gradient).map(|(s, g)| s * g).sum::<f64>();
        if fall < 1e-9 {
            break;
        }
        let mut share = 1.0;
        let found = loop {
            let next: [f64; 3] = std::array::from_fn(|i| at[i] + share * step[i]);
            let reached = f(next);
            if reached <= value - 1e-4 * share * fall {
                break Some((next, reached));
            }
            share *= 0.5;
            if share < 1e-6 {
                break None;
            }
        };
        let Some((next, reached)) = found else { break };
        let after = slope(&mut f, next);
        let s: [f64; 3] = std::array::from_fn(|i| next[i] - at[i]);
        let y: [f64; 3] = std::array::from_fn(|i| after[i] - gradient[i]);
        let sy: f64 = s.iter().zip(&y).map(|(s, y)| s * y).sum();
        if sy > 0.0 {
            let hy: [f64; 3] = std::array::from_fn(|i| (0..3).map(|k| inverse[i][k] * y[k]).sum());
            let yhy: f64 = y.iter().zip(&hy).map(|(y, h)| y * h).sum();
            for i in 0..3 {
                for k in 0..3 {
                    inverse[i][k] += (1.0 + yhy / sy) * s[i] * s[k] / sy - (hy[i] * s[k] + s[i] * hy[k]) / sy;
                }
            }
        }
        (at, value, gradient) = (next, reached, after);
    }
    (at, value, calls)
}

fn identify(z: &[f64], choice: &ModelChoice) -> Identified {
    let unit = Unit::parse("rad/s").expect("a unit");
    identify_axis("z", z, DT, &unit, Method::Likelihood, choice).expect("a log that can be identified")
}

fn white_and_drift() -> ModelChoice {
    ModelChoice::Terms { kinds: vec![Kind::White, Kind::GaussMarkov], average: None, order: None }
}

/// Density, standard deviation, correlation time.
fn numbers(found: &NoiseModel) -> [f64; 3] {
    let mut all = [f64::NAN; 3];
    for term in &found.terms {
        match *term {
            Term::White { density } => all[0] = density,
            Term::GaussMarkov { std_dev, correlation_time } => (all[1], all[2]) = (std_dev, correlation_time),
            _ => {}
        }
    }
    all
}

fn seconds<T>(work: impl FnOnce() -> T) -> (f64, T) {
    let start = Instant::now();
    let out = work();
    (start.elapsed().as_secs_f64(), out)
}

fn median(mut times: Vec<f64>) -> f64 {
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

/// The maximum alone, from where `by_hand` starts.
fn maximum(z: &[f64]) -> [f64; 3] {
    let deviation = |x: &[f64]| (x.iter().map(|v| v * v).sum::<f64>() / x.len() as f64).sqrt();
    let steps: Vec<f64> = z.windows(2).take(100_000).map(|pair| pair[1] - pair[0]).collect();
    let level = z.iter().sum::<f64>() / z.len() as f64;
    let std_dev = deviation(&z.iter().map(|z| z - level).collect::<Vec<f64>>()) / 10.0;
    let density = deviation(&steps) * (0.5 * DT).sqrt();
    let start =
        NoiseModel { terms: vec![Term::White { density }, Term::GaussMarkov { std_dev, correlation_time: 10.0 }] };
    let log = [vec![Stretch { missing: 0, samples: z }]];
    numbers(&kfdesign::identify::maximum(&start, &log, DT).expect("a maximum").0)
}

/// They alternate, so that all see the same machine. Hands back the seconds of the maximum alone.
fn compare(name: &str, z: &[f64]) -> f64 {
    let (mut ours, mut auto, mut hand, mut alone) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let mut last = None;
    let mut only = [f64::NAN; 3];
    for _ in 0..5 {
        let (time, found) = seconds(|| maximum(z));
        alone.push(time);
        only = found;
        let (time, found) = seconds(|| identify(z, &white_and_drift()));
        ours.push(time);
        auto.push(seconds(|| identify(z, &ModelChoice::Auto)).0);
        let (time, reference) = seconds(|| by_hand(z));
        hand.push(time);
        last = Some((found, reference));
    }
    let (ours, auto) = (median(ours), median(auto));
    let [hand, alone] = [hand, alone].map(|times| times.into_iter().fold(f64::INFINITY, f64::min));
    if let Some((found, (at, value, calls))) = last {
        println!("{name}: N, sigma, Tc {:?}, diffuse ln L {:?}", numbers(&found.model), found.exact_log_likelihood);
        println!("  by hand {:?}, ln L of the log less its mean {} ({calls} likelihoods)", at.map(f64::exp), -value);
    }
    println!("  the maximum alone {only:?}: {alone:.4} s, by hand {hand:.4} s, ratio {:.1}", hand / alone);
    println!("  identify white+gm {ours:.4} s, auto {auto:.4} s");
    alone
}

/// One likelihood by hand, and eight of ours, in ms.
fn likelihoods(z: &[f64]) {
    let near: Vec<[f64; 3]> = (0..8).map(|i| TRUTH.map(|v| v.ln() + 0.01 * f64::from(i))).collect();
    let model = |at: &[f64; 3]| -> LinearModel {
        let [density, std_dev, correlation_time] = at.map(f64::exp);
        let terms = vec![Term::White { density }, Term::GaussMarkov { std_dev, correlation_time }];
        sensor_errors(Quantity::AngularRate, &NoiseModel { terms }, None, DT, 1e4).expect("a sound model")
    };
    let models: Vec<LinearModel> = near.iter().map(model).collect();
    let log = [Stretch { missing: 0, samples: z }];
    let (mut eight, mut one) = (Vec::new(), Vec::new());
    for _ in 0..11 {
        eight.push(seconds(|| diffuse_log_likelihoods(&models, &log, false)).0);
        one.push(seconds(|| scalar(z, near[0])).0);
    }
    let (eight, one) = (median(eight) * 1e3, median(one) * 1e3);
    println!("  eight likelihoods {eight:.2} ms, one by hand {one:.2} ms, ratio a likelihood {:.1}", 8.0 * one / eight);
}

fn main() {
    let z = simulated(1_000_000);
    compare("simulated, 1e6 samples", &z);
    likelihoods(&z);
    for power in 3..=7 {
        let z = simulated(10_usize.pow(power));
        let choices = [white_and_drift(), ModelChoice::Auto];
        let times = choices.map(|choice| median((0..3).map(|_| seconds(|| identify(&z, &choice)).0).collect()));
        println!("growth: 1e{power} samples, white+gm {:.4} s, auto {:.4} s", times[0], times[1]);
    }
    if let Some(folder) = std::env::var_os("KFDESIGN_BENCH_DATA") {
        let bytes = std::fs::read(Path::new(&folder).join("rate_1e6.f64")).expect("rate_1e6.f64 in that folder");
        let number = |b: &[u8]| b.try_into().map_or(f64::NAN, f64::from_le_bytes);
        let z: Vec<f64> = bytes.chunks_exact(8).map(number).collect();
        let ours = compare("rate_1e6.f64", &z);
        println!("peers: likelihood seconds {ours:.4} samples {}", z.len());
    }
}
