//! A log through the reference sensor's filter: whole, with settled gains; whole, carrying the covariance; and one
//! call per predict and update (sizes known at run time, gate included); against the same equations written by hand
//! with statically sized nalgebra matrices on the same data. And the exact expectation of a mismatched filter.
//! `KFDESIGN_BENCH_DATA` names a folder with `rate_1e6.f64` and `angle_1e6.f64` (see `peers.py`) to run on as well.

use std::hint::black_box;
use std::time::Instant;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use kfdesign::filter::gains::GainSequence;
use kfdesign::filter::mismatch::expect;
use kfdesign::filter::whole_log::{carried, innovations};
use kfdesign::filter::{Judge, Kalman};
use kfdesign::model::{InitialBias, LinearModel, Named, sensor_errors};
use kfdesign::noise::{NoiseModel, Term};
use kfdesign::numerics::random::{StreamId, fill_normal, stream};
use kfdesign::units::Quantity;
use nalgebra::{DMatrix, DVector, SMatrix, SVector};

const STEPS: usize = 100_000;
/// Steps timed at once, short enough to fall between the interruptions of a busy machine; the best of all rounds
/// counts.
const ROUND: usize = 500;

/// Bias and `drifts` Gauss-Markov drifts in white noise at 100 Hz, SI.
fn model(drifts: usize) -> LinearModel {
    let slow = Term::GaussMarkov { std_dev: 4.897e-4, correlation_time: 193.9312 };
    let fast = Term::GaussMarkov { std_dev: 2e-4, correlation_time: 9.0 };
    let terms = [Term::White { density: 9.809e-4 }].into_iter().chain([slow, fast].into_iter().take(drifts)).collect();
    let bias = Some(InitialBias { mean: 0.0, std_dev: 1e-2 });
    sensor_errors(Quantity::AngularRate, &NoiseModel { terms }, bias, 0.01, 1e4).expect("a sound model")
}

fn measurements(model: &LinearModel) -> Vec<f64> {
    let mut z = vec![0.0; STEPS];
    fill_normal(&mut stream(1, StreamId { run: 0, axis: 0, term: 0 }), &mut z);
    let sigma = model.r[(0, 0)].sqrt();
    z.iter_mut().for_each(|v| *v *= sigma);
    z
}

fn ours(model: &LinearModel, z: &[f64]) -> f64 {
    let mut kalman = Kalman::new(model);
    let mut log_likelihood = kalman.update(0, z[0], None).log_likelihood();
    for z in &z[1..] {
        kalman.predict();
        log_likelihood += kalman.update(0, *z, None).log_likelihood();
    }
    log_likelihood
}

/// The textbook in nalgebra: sizes fixed at compile time, Joseph form, log-likelihood.
fn by_hand<const N: usize>(model: &LinearModel, z: &[f64]) -> f64 {
    let square = |a: &DMatrix<f64>| SMatrix::<f64, N, N>::from_fn(|i, j| a[(i, j)]);
    let (f, q, mut p) = (square(&model.f), square(&model.q), square(&model.p0));
    let h = SMatrix::<f64, 1, N>::from_fn(|_, j| model.h[(0, j)]);
    let r = model.r[(0, 0)];
    let mut x = SVector::<f64, N>::from_fn(|i, _| model.x0[i]);
    let mut log_likelihood = 0.0;
    for (k, z) in z.iter().enumerate() {
        if k > 0 {
            x = f * x;
            p = f * p * f.transpose() + q;
        }
        let s = (h * p * h.transpose())[0] + r;
        let gain = p * h.transpose() / s;
        let innovation = z - (h * x)[0];
        x += gain * innovation;
        let left = SMatrix::<f64, N, N>::identity() - gain * h;
        p = left * p * left.transpose() + gain * r * gain.transpose();
        log_likelihood -= 0.5 * ((std::f64::consts::TAU * s).ln() + innovation * innovation / s);
    }
    log_likelihood
}

/// Best time of a step in ns: the two alternate, so that both see the same machine.
fn best(z: &[f64], mut first: impl FnMut(&[f64]) -> f64, mut second: impl FnMut(&[f64]) -> f64) -> (f64, f64) {
    let mut best = (f64::INFINITY, f64::INFINITY);
    let time = |run: &mut dyn FnMut(&[f64]) -> f64, z: &[f64]| {
        let start = Instant::now();
        black_box(run(black_box(z)));
        start.elapsed().as_secs_f64() * 1e9 / ROUND as f64
    };
    for _ in 0..20 {
        for z in z.chunks_exact(ROUND) {
            best.0 = best.0.min(time(&mut first, z));
            best.1 = best.1.min(time(&mut second, z));
        }
    }
    best
}

#[allow(clippy::print_stdout, reason = "the ratio is what the bench is for")]
fn compare<const N: usize>(criterion: &mut Criterion) {
    let model = model(N - 1);
    assert_eq!(model.states.len(), N);
    let z = measurements(&model);
    let (a, b) = (ours(&model, &z), by_hand::<N>(&model, &z));
    assert!((a / b - 1.0).abs() < 1e-9, "{a} and {b}");

    let mut group = criterion.benchmark_group(format!("filter step, {N} states, {STEPS} steps"));
    group.throughput(Throughput::Elements(STEPS as u64)).sample_size(20);
    group.bench_function("Kalman", |bench| bench.iter(|| ours(&model, black_box(&z))));
    group.bench_function("by hand, SMatrix", |bench| bench.iter(|| by_hand::<N>(&model, black_box(&z))));
    group.finish();
    let (calls, hand) = best(&z, |z| ours(&model, z), |z| by_hand::<N>(&model, z));
    println!("{N} states: Kalman {calls:.1} ns/step, by hand {hand:.1} ns/step, ratio {:.2}\n", calls / hand);
    let (mut v, mut weight) = (vec![0.0; ROUND], vec![0.0; ROUND]);
    let (whole, hand) = best(&z, |z| carried(&model, z, &mut v, &mut weight), |z| by_hand::<N>(&model, z));
    println!(
        "{N} states: covariance carried {whole:.1} ns/step, by hand {hand:.1} ns/step, ratio {:.2}\n",
        whole / hand
    );
}

fn gap(criterion: &mut Criterion) {
    let kalman = Kalman::new(&model(1));
    criterion.bench_function("gap of an hour at 100 Hz, 2 states", |bench| {
        bench.iter(|| {
            let mut kalman = kalman.clone();
            kalman.predict_many(black_box(360_000));
            kalman.p[(1, 1)]
        });
    });
}

/// What the two-state filter does under three truths, four block lengths, 600 s at 100 Hz.
fn expectation(criterion: &mut Criterion) {
    let (filter, steps) = (model(1), 60_000);
    let gains = GainSequence::new(&filter, steps, &[0, 99, 9999, steps - 1]);
    let mut louder = filter.clone();
    louder.q *= 4.0;
    let mut slower = filter.clone();
    slower.f[(1, 1)] = (-0.01_f64 / 400.0).exp();
    let blocks = [vec![4, 64, 1024, 2000]];
    let mut group = criterion.benchmark_group("expectation under a truth, 2 states, 60 000 steps");
    group.throughput(Throughput::Elements(steps)).sample_size(20);
    for (name, truth) in [("another Q", louder), ("another Tc", slower), ("a drift more", model(2))] {
        let judge = Judge::new(&filter, &truth, &gains.epochs);
        group.bench_function(name, |bench| bench.iter(|| expect(&filter, black_box(&truth), &gains, &judge, &blocks)));
    }
    group.bench_function("the gains", |bench| bench.iter(|| GainSequence::new(black_box(&filter), steps, &[0])));
    group.finish();
}

/// White rate noise, a constant bias and a Gauss-Markov drift, deg/s: the rate measured, or the angle.
fn peers_model(states: usize) -> LinearModel {
    let (dt, density, sigma, tc, bias) = (0.01_f64, 0.0035_f64, 0.002_f64, 100.0_f64, 0.1_f64);
    let phi = (-dt / tc).exp();
    let drive = sigma * sigma * (1.0 - phi * phi);
    let named = |name: &str| Named { name: name.into(), unit: "deg/s".into() };
    let diagonal = |values: &[f64]| DMatrix::from_diagonal(&DVector::from_column_slice(values));
    let (f, h, q, r, p0) = if states == 2 {
        let p0 = diagonal(&[bias * bias, sigma * sigma]);
        (diagonal(&[1.0, phi]), vec![1.0, 1.0], diagonal(&[0.0, drive]), density * density / dt, p0)
    } else {
        let f = DMatrix::from_row_slice(3, 3, &[1.0, dt, dt, 0.0, 1.0, 0.0, 0.0, 0.0, phi]);
        let p0 = diagonal(&[1.0, bias * bias, sigma * sigma]);
        (f, vec![1.0, 0.0, 0.0], diagonal(&[density * density * dt, 0.0, drive]), 1e-4, p0)
    };
    LinearModel {
        dt,
        states: (0..states).map(|i| named(&format!("x{i}"))).collect(),
        inputs: vec![],
        measurements: vec![named("z")],
        every: vec![1],
        outputs: vec![],
        g: DMatrix::zeros(states, 0),
        h: DMatrix::from_row_slice(1, states, &h),
        r: DMatrix::from_element(1, 1, r),
        x0: DVector::zeros(states),
        f,
        q,
        p0,
    }
}

/// The whole road on the peers' data: 10⁶ samples, innovations, NIS and likelihood.
#[allow(clippy::print_stdout, reason = "the ratio is what the bench is for")]
fn whole_logs(_: &mut Criterion) {
    let Ok(folder) = std::env::var("KFDESIGN_BENCH_DATA") else { return };
    for (states, file, road) in [(2, "rate_1e6.f64", "filter"), (3, "angle_1e6.f64", "filter3")] {
        let bytes = std::fs::read(format!("{folder}/{file}")).expect("the peers' data");
        let z: Vec<f64> = bytes.as_chunks().0.iter().map(|b| f64::from_le_bytes(*b)).collect();
        let model = peers_model(states);
        let (mut v, mut nis) = (vec![0.0; z.len()], vec![0.0; z.len()]);
        let mut best = [f64::INFINITY; 3];
        for _ in 0..15 {
            let mut by = |which: usize, work: &mut dyn FnMut() -> f64| {
                let start = Instant::now();
                black_box(work());
                best[which] = best[which].min(start.elapsed().as_secs_f64());
            };
            by(0, &mut || innovations(&model, &z, &mut v, &mut nis));
            by(1, &mut || carried(&model, &z, &mut v, &mut nis));
            by(2, &mut || if states == 2 { by_hand::<2>(&model, &z) } else { by_hand::<3>(&model, &z) });
        }
        let [settled, carried, hand] = best;
        println!("peers: {road} {settled} s; covariance carried {carried} s, nalgebra by hand {hand} s\n");
    }
}

criterion_group!(benches, compare::<2>, compare::<3>, whole_logs, gap, expectation);
criterion_main!(benches);
