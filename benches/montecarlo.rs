//! 1000 runs of 10,000 steps of the two-state static design, one axis, with NEES at 100 epochs, NIS, autocorrelation
//! and block sums, and the same with NEES and NIS averaged at every step; against the textbook loop (every run
//! propagates its own covariance, matrices of fixed size, NEES and NIS at every step) and the random numbers alone.

use std::hint::black_box;
use std::time::Instant;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use kfdesign::filter::FilterDesign;
use kfdesign::model::LinearModel;
use kfdesign::montecarlo::{Course, Experiment, calibration};
use kfdesign::numerics::normals::Normals;
use kfdesign::numerics::random::{StreamId, normal, stream};
use kfdesign::params::Params;
use kfdesign::tune::{TuneOptions, tune};
use nalgebra::{Matrix2, RowVector2, Vector2};

const RUNS: u64 = 1000;
const STEPS: u64 = 10_000;

fn design() -> FilterDesign {
    let axis = r#"{"name": "x", "bias": "0 deg/s", "turn_on_bias": {"std_dev": "0.6 deg/s"}, "white": {"density": "0.0562 deg/s/sqrt(Hz)"},
        "gauss_markov": [{"std_dev": "0.0280596 deg/s", "correlation_time": "193.9312 s"}]}"#;
    let text = format!(
        r#"{{"format": "kfdesign-params/1", "quantity": "angular-rate", "sample_rate": "100 Hz", "axes": [{axis}]}}"#
    );
    let params = Params::from_json(&text, "the bench").expect("sound parameters");
    tune(&params, &TuneOptions::default()).expect("a sound model").design
}

fn course() -> Course {
    let (truth, seed, alpha) = (None, 1, 0.01);
    let experiment =
        Experiment { design: design(), truth, truth_spread: false, steps: STEPS, seed, alpha, replicates: 0 };
    experiment.course().expect("a sound experiment")
}

/// Sum of all NEES and NIS over all runs.
fn textbook(model: &LinearModel) -> f64 {
    let square = |a: &nalgebra::DMatrix<f64>| Matrix2::from_fn(|i, j| a[(i, j)]);
    let (f, q, p0) = (square(&model.f), square(&model.q), square(&model.p0));
    let h = RowVector2::from_fn(|_, j| model.h[(0, j)]);
    let (r, root_q, root_p0) = (model.r[(0, 0)], q.map(f64::sqrt), p0.map(f64::sqrt));
    let mut sum = 0.0;
    for run in 0..RUNS {
        let mut rng = stream(1, StreamId { run, axis: 0, term: 0 });
        let mut truth = root_p0 * Vector2::from_fn(|_, _| normal(&mut rng));
        let (mut x, mut p) = (Vector2::zeros(), p0);
        for step in 0..STEPS {
            if step > 0 {
                truth = f * truth + root_q * Vector2::new(0.0, normal(&mut rng));
                x = f * x;
                p = f * p * f.transpose() + q;
            }
            let z = (h * truth)[0] + r.sqrt() * normal(&mut rng);
            let s = (h * p * h.transpose())[0] + r;
            let gain = p * h.transpose() / s;
            let innovation = z - (h * x)[0];
            x += gain * innovation;
            let left = Matrix2::identity() - gain * h;
            p = left * p * left.transpose() + gain * r * gain.transpose();
            let error = truth - x;
            sum += innovation * innovation / s;
            sum += p.try_inverse().map_or(0.0, |inverse| (error.transpose() * inverse * error)[0]);
        }
    }
    sum
}

/// As many normal numbers as the engine draws for a run's drift and measurements.
fn numbers() -> f64 {
    let mut sum = 0.0;
    let (mut words, mut out) = (vec![[0; 8]; 256], vec![[0.0; 8]; 256]);
    for run in (0..RUNS).step_by(8) {
        let mut normals = Normals::new(1, std::array::from_fn(|l| StreamId { run: run + l as u64, axis: 0, term: 0 }));
        for _ in 0..2 * STEPS / 256 {
            pulp::Arch::new().dispatch(Fill { normals: &mut normals, words: &mut words, out: &mut out });
            sum += out[0][0];
        }
    }
    sum
}

struct Fill<'a> {
    normals: &'a mut Normals<8>,
    words: &'a mut [[u64; 8]],
    out: &'a mut [[f64; 8]],
}

impl pulp::NullaryFnOnce for Fill<'_> {
    type Output = ();
    #[inline(always)]
    fn call(self) {
        self.normals.fill(self.words, self.out);
    }
}

fn on<T: Send>(threads: usize, work: impl Fn() -> T + Send) -> T {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads").install(work)
}

#[allow(clippy::print_stdout, reason = "the ratios are what the bench is for")]
fn engine(criterion: &mut Criterion) {
    let (course, model) = (course(), design().axes[0].model.clone());
    let all = |threads| on(threads, || black_box(course.sums(0..RUNS)));
    let mut group = criterion.benchmark_group("Monte Carlo, 1000 runs of 10 000 steps, 2 states");
    group.throughput(Throughput::Elements(RUNS * STEPS)).sample_size(10);
    group.bench_function("one thread", |bench| bench.iter(|| all(1)));
    group.bench_function("two threads", |bench| bench.iter(|| all(2)));
    group.finish();

    // they alternate, so that all see the same machine; the best of each counts
    let every = |threads| on(threads, || black_box(course.every_step(0..RUNS)));
    let mut best = [f64::INFINITY; 6];
    for _ in 0..7 {
        let works: [&dyn Fn() -> f64; 6] = [
            &|| all(1).len() as f64,
            &|| all(2).len() as f64,
            &|| textbook(&model),
            &numbers,
            &|| every(1)[0].nees[0],
            &|| every(2)[0].nees[0],
        ];
        for (best, work) in best.iter_mut().zip(works) {
            let start = Instant::now();
            black_box(work());
            *best = best.min(start.elapsed().as_secs_f64());
        }
    }
    println!("peers: montecarlo {} s; on one thread {} s", best[5], best[4]);
    let [one, two, textbook, numbers, every_one, every_two] = best.map(|seconds| seconds * 1e9 / (RUNS * STEPS) as f64);
    println!(
        "per run and step: one thread {one:.1} ns ({:.1} million a second), two threads {two:.1} ns ({:.1} million a second), \
         textbook loop {textbook:.1} ns, ratio {:.2}; random numbers {numbers:.1} ns, {:.0} % of one thread; NEES and NIS at every step \
         {every_one:.1} ns, two threads {every_two:.1} ns\n",
        1e3 / one,
        1e3 / two,
        one / textbook,
        100.0 * numbers / one,
    );
}

/// What the verdict costs beside the runs: its critical value, however many runs there are.
fn gate(criterion: &mut Criterion) {
    let course = course();
    let mut group = criterion.benchmark_group("critical value of the gate, one axis");
    group.sample_size(10);
    group.bench_function("1000 replicates", |bench| {
        bench.iter(|| on(1, || calibration::gate(black_box(&course), RUNS, 0.01, 1000).critical));
    });
    group.finish();
}

criterion_group!(benches, engine, gate);
criterion_main!(benches);
