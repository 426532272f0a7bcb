//! Overlapping Allan deviation of 10⁶ samples at 20 taus per decade, ours against a plain reference on the same data.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use kfdesign::allan::{Deviation, TauGrid, deviation, edf, tau};
use kfdesign::noise::{NoiseModel, Term};
use kfdesign::numerics::random::{StreamId, fill_normal, stream};

const SAMPLES: usize = 1_000_000;
const DT: f64 = 0.01;

fn rate() -> Vec<f64> {
    let mut rate = vec![0.0; SAMPLES];
    fill_normal(&mut stream(1, StreamId { run: 0, axis: 0, term: 0 }), &mut rate);
    rate
}

/// The definition written plainly: running sum, then for every tau a loop over second differences.
fn plain(rate: &[f64], factors: &[u64]) -> Vec<f64> {
    let mut phase = vec![0.0];
    for y in rate {
        phase.push(phase[phase.len() - 1] + y * DT);
    }
    let mut deviations = Vec::new();
    for &m in factors {
        let m = m as usize;
        let mut sum = 0.0;
        for k in 0..phase.len() - 2 * m {
            let z = phase[k + 2 * m] - 2.0 * phase[k + m] + phase[k];
            sum += z * z;
        }
        let terms = (phase.len() - 2 * m) as f64;
        deviations.push((sum / (2.0 * (m as f64 * DT).powi(2) * terms)).sqrt());
    }
    deviations
}

fn ours(rate: &[f64], factors: &[u64]) -> Vec<f64> {
    let phase = deviation::phase(rate, DT);
    let estimates = deviation::variances(Deviation::Oadev, &phase, DT, factors).expect("all factors fit");
    estimates.iter().map(|estimate| estimate.variance.sqrt()).collect()
}

/// The grid of the side-by-side with other programs: 100 factors equally spaced in their logarithm up to a tenth of
/// the log, distinct.
fn peers_factors(samples: usize) -> Vec<u64> {
    let top = (samples as f64 / 10.0).floor().log2();
    let mut factors: Vec<u64> = (0..100).map(|i| (top * f64::from(i) / 99.0).exp2().round() as u64).collect();
    factors.dedup();
    factors
}

/// On the data of the side-by-side, where KFDESIGN_BENCH_DATA names its folder: the best of seven, as of the others;
/// one line per file, the largest last.
#[allow(clippy::print_stdout, reason = "the line is read by a script")]
fn peers(_: &mut Criterion) {
    let Some(folder) = std::env::var_os("KFDESIGN_BENCH_DATA") else { return };
    for name in ["rate_1e6", "rate_1e7"] {
        let path = std::path::Path::new(&folder).join(name).with_extension("f64");
        let Ok(bytes) = std::fs::read(&path) else { continue };
        let rate: Vec<f64> = bytes.as_chunks::<8>().0.iter().map(|value| f64::from_le_bytes(*value)).collect();
        drop(bytes);
        let factors = peers_factors(rate.len());
        let mut seconds: Vec<f64> = (0..7)
            .map(|_| {
                let start = std::time::Instant::now();
                black_box(ours(black_box(&rate), &factors));
                start.elapsed().as_secs_f64()
            })
            .collect();
        seconds.sort_by(f64::total_cmp);
        let (best, threads) = (seconds[0], rayon::current_num_threads());
        println!("peers: allan seconds {best:.4} samples {} taus {} threads {threads}", rate.len(), factors.len());
    }
}

fn overlapping(criterion: &mut Criterion) {
    let rate = rate();
    let factors = tau::averaging_factors(TauGrid::Log(20), deviation::largest_factor(Deviation::Oadev, SAMPLES));
    for (a, b) in ours(&rate, &factors).iter().zip(plain(&rate, &factors)) {
        assert!((a / b - 1.0).abs() < 1e-6, "{a} and {b}");
    }
    let mut group = criterion.benchmark_group("overlapping ADEV, 1e6 samples, log:20");
    group.sample_size(10);
    group.bench_function("plain reference", |b| b.iter(|| plain(black_box(&rate), &factors)));
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    group.bench_function("deviation::variances, one thread", |b| {
        b.iter(|| one.install(|| ours(black_box(&rate), &factors)));
    });
    group.bench_function("deviation::variances, all threads", |b| b.iter(|| ours(black_box(&rate), &factors)));
    group.bench_function("allan::curve, with noise types and intervals", |b| {
        b.iter(|| kfdesign::allan::curve(black_box(&rate), DT, Deviation::Oadev, TauGrid::Log(20)));
    });
    group.finish();
}

fn degrees_of_freedom(criterion: &mut Criterion) {
    let model = NoiseModel {
        terms: vec![
            Term::White { density: 0.0562 },
            Term::GaussMarkov { std_dev: 0.02806, correlation_time: 193.93 },
            Term::RateRandomWalk { density: 1e-4 },
        ],
    };
    let factors = tau::averaging_factors(TauGrid::Log(5), SAMPLES as u64 / 2);
    let mut group = criterion.benchmark_group("white + Gauss-Markov + random walk, 1e6 samples");
    group.sample_size(10);
    group.bench_function("exact edf, one tau", |b| {
        b.iter(|| edf::degrees_of_freedom(Deviation::Oadev, SAMPLES, black_box(10_000), DT, &model));
    });
    group.bench_function(format!("covariance of {} points", factors.len()), |b| {
        b.iter(|| edf::covariance(black_box(&factors), SAMPLES, DT, &model));
    });
    group.finish();
}

criterion_group!(benches, peers, overlapping, degrees_of_freedom);
criterion_main!(benches);
