//! Replay of three axes in blocks, statistics and all, against the bare predict-update loop on the same data.
//! The ratio of the two is what the statistics cost.

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use kfdesign::filter::document::SteadyState;
use kfdesign::filter::{AxisDesign, FilterDesign, Kalman};
use kfdesign::input::Block;
use kfdesign::model::{LinearModel, Named};
use kfdesign::numerics::random::{StreamId, fill_normal, stream};
use kfdesign::params::AxisParams;
use kfdesign::replay::{Estimates, LogShape, Options, Replayer};
use kfdesign::units::Quantity;
use nalgebra::{DMatrix, DVector};

const SAMPLES: usize = 100_000;
const BLOCK: usize = 8192;

/// Bias and one Gauss-Markov drift of the reference sensor at 100 Hz, SI.
fn axis(name: &str) -> AxisDesign {
    let named = |name: &str| Named { name: name.into(), unit: "rad/s".into() };
    let (dt, sigma, tc, density) = (0.01_f64, 4.897e-4_f64, 193.9312_f64, 9.809e-4_f64);
    let phi = (-dt / tc).exp();
    let model = LinearModel {
        dt,
        states: vec![named("bias"), named("drift")],
        inputs: vec![],
        measurements: vec![named("rate")],
        every: vec![1],
        outputs: vec![],
        f: DMatrix::from_diagonal(&DVector::from_row_slice(&[1.0, phi])),
        g: DMatrix::zeros(2, 0),
        h: DMatrix::from_row_slice(1, 2, &[1.0, 1.0]),
        q: DMatrix::from_diagonal(&DVector::from_row_slice(&[0.0, -sigma * sigma * (-2.0 * dt / tc).exp_m1()])),
        r: DMatrix::from_element(1, 1, density * density / dt),
        x0: DVector::zeros(2),
        p0: DMatrix::from_diagonal(&DVector::from_row_slice(&[1e-4, sigma * sigma])),
    };
    let steady_state = SteadyState {
        period: 1,
        gain: DMatrix::zeros(2, 1),
        predicted_covariance: DMatrix::zeros(2, 2),
        innovation_covariance: DMatrix::zeros(1, 1),
        poles: vec![(1.0, 0.0), (0.9994904814605, 0.0)],
        settling_time: 80.0,
        residual: 0.0,
        eigenvector_difference: 0.0,
    };
    let noise = AxisParams {
        name: name.into(),
        bias: None,
        turn_on_bias: None,
        temperature: None,
        terms: vec![],
        not_identified: vec![],
    };
    AxisDesign { name: name.into(), model, steady_state, noise, about: Default::default() }
}

fn blocks() -> Vec<Block> {
    let mut columns = vec![vec![0.0; SAMPLES]; 3];
    for (axis, column) in columns.iter_mut().enumerate() {
        fill_normal(&mut stream(1, StreamId { run: 0, axis: axis as u32, term: 0 }), column);
        column.iter_mut().for_each(|z| *z *= 9.809e-3);
    }
    (0..SAMPLES)
        .step_by(BLOCK)
        .map(|start| start..(start + BLOCK).min(SAMPLES))
        .map(|range| Block {
            values: columns.iter().map(|c| c[range.clone()].to_vec()).collect(),
            extra: vec![],
            missing: vec![0; range.len()],
            time_s: range.map(|k| k as f64 * 0.01).collect(),
        })
        .collect()
}

fn bench(criterion: &mut Criterion) {
    let names = ["x", "y", "z"];
    let design = FilterDesign {
        quantity: Quantity::AngularRate,
        sample_rate_hz: 100.0,
        plant: "static".into(),
        design: None,
        axes: names.iter().map(|n| axis(n)).collect(),
        tuning: serde_json::Value::Null,
    };
    let log = LogShape {
        axes: names.iter().map(ToString::to_string).collect(),
        quantity: Quantity::AngularRate,
        sample_rate_hz: 100.0,
        aids: 0,
    };
    let blocks = blocks();
    let mut group = criterion.benchmark_group("replay, 3 axes of 1e5 samples, 2 states");
    group.throughput(Throughput::Elements(3 * SAMPLES as u64)).sample_size(20);
    group.bench_function("bare filter loop", |b| {
        b.iter(|| {
            let mut total = 0.0;
            for (index, axis) in design.axes.iter().enumerate() {
                let mut kalman = Kalman::new(&axis.model);
                for (i, block) in blocks.iter().enumerate() {
                    for (k, z) in block.values[index].iter().enumerate() {
                        if i + k > 0 {
                            kalman.predict();
                        }
                        total += kalman.update(0, *z, None).log_likelihood();
                    }
                }
            }
            black_box(total)
        });
    });
    for (name, wanted) in [("verdict only", false), ("verdict and estimates", true)] {
        group.bench_with_input(BenchmarkId::new("replay", name), &wanted, |b, &wanted| {
            let mut estimates = Estimates::default();
            b.iter(|| {
                let Ok(mut replayer) = Replayer::new(&design, &log, Options::default()) else {
                    unreachable!("the log fits the design")
                };
                for block in &blocks {
                    replayer.push(block, wanted.then_some(&mut estimates));
                }
                black_box(replayer.finish().axes[0].log_likelihood)
            });
        });
    }
    group.finish();
}

criterion_group!(benches, bench);
criterion_main!(benches);
