//! Autocovariance least squares on published examples and on a simulated sensor.

use kfdesign::filter::SensorLog;
use kfdesign::numerics::random::{StreamId, normal, stream};
use kfdesign::numerics::riccati::dare_doubling;
use kfdesign::params::Params;
use kfdesign::signal::correlation::lagged_products;
use kfdesign::simulate::{Scenario, Simulator, TrueRate};
use kfdesign::tune::objective::als::{Source, als, expected};
use kfdesign::tune::objective::{Objective, Request};
use nalgebra::{DMatrix, DVector};

use super::super::{close, gauss_markov, sensor, white};
use super::{chosen, log, moved, refused, request};

struct Example {
    f: DMatrix<f64>,
    h: DMatrix<f64>,
    gain: DMatrix<f64>,
    sources: Vec<Source>,
}

impl Example {
    /// The filter gain P Hᵀ S⁻¹ of a guess.
    fn new(f: DMatrix<f64>, h: DMatrix<f64>, sources: Vec<Source>, q: &DMatrix<f64>, r: &DMatrix<f64>) -> Example {
        let p = dare_doubling(&f, &h, q, r).unwrap().covariance;
        let gain = &p * h.transpose() * (&h * &p * h.transpose() + r).try_inverse().unwrap();
        Example { f, h, gain, sources }
    }

    /// Sample autocovariances of the innovations of `count` points after the first `start`, x(0) known.
    fn sampled(&self, sizes: &[f64], run: u64, count: usize, start: usize, lags: usize) -> Vec<DMatrix<f64>> {
        let (n, m) = (self.f.nrows(), self.h.nrows());
        let mut rng = stream(5, StreamId { run, axis: 0, term: 0 });
        let sum = |part: fn(&Source) -> &DMatrix<f64>| {
            self.sources
                .iter()
                .zip(sizes)
                .map(|(s, v)| part(s) * *v)
                .fold(None, |a: Option<DMatrix<f64>>, b| Some(a.map_or(b.clone(), |a| a + b)))
        };
        let root = |a: DMatrix<f64>| kfdesign::numerics::linalg::cholesky_semidefinite(&a).unwrap();
        let (q, r) = (root(sum(|s| &s.q).unwrap()), root(sum(|s| &s.r).unwrap()));
        let (mut x, mut estimate) = (DVector::zeros(n), DVector::zeros(n));
        let mut innovations = vec![Vec::new(); m];
        for k in 0..count {
            let noise = DVector::from_fn(m, |_, _| normal(&mut rng));
            let innovation = &self.h * (&x - &estimate) + &r * noise;
            if k >= start {
                innovations.iter_mut().zip(innovation.iter()).for_each(|(all, v)| all.push(*v));
            }
            estimate = &self.f * (&estimate + &self.gain * innovation);
            let drive = DVector::from_fn(n, |_, _| normal(&mut rng));
            x = &self.f * &x + &q * drive;
        }
        let mut all = vec![DMatrix::zeros(m, m); lags];
        for (a, b) in (0..m).flat_map(|a| (0..m).map(move |b| (a, b))) {
            let sums = lagged_products(&innovations[a], &innovations[b], lags - 1);
            for (j, sum) in sums.into_iter().enumerate() {
                all[j][(a, b)] = sum / (count - start - j) as f64;
            }
        }
        all
    }

    /// Means of the estimates of many runs are the truth within five of their standard deviations: false alarm 6e-7
    /// each.
    fn assert_recovers(&self, sizes: &[f64], runs: u64, count: usize) -> Vec<f64> {
        let of = |run| {
            let sampled = self.sampled(sizes, run, count, 100, 15);
            als(&self.f, &self.h, &self.gain, &self.sources, None, &sampled, (count - 100) as f64).unwrap().sizes
        };
        let found: Vec<Vec<f64>> = (0..runs).map(of).collect();
        let spread = |i: usize| {
            let mean = found.iter().map(|f| f[i]).sum::<f64>() / runs as f64;
            let variance = found.iter().map(|f| (f[i] - mean).powi(2)).sum::<f64>() / (runs - 1) as f64;
            let off = (mean - sizes[i]) / (variance / runs as f64).sqrt();
            assert!(off.abs() < 5.0, "variance {i}: {mean} instead of {}, {off} standard deviations", sizes[i]);
            variance.sqrt()
        };
        (0..sizes.len()).map(spread).collect()
    }
}

fn diagonal(n: usize, values: &[f64]) -> DMatrix<f64> {
    DMatrix::from_diagonal(&DVector::from_fn(n, |i, _| values[i]))
}

/// "Motivating example" of the authors' ALS package (Rajamani 2007, thesis, section 2.2): Q = 0.5, R = 0.1, a filter
/// made for 0.2 and 0.4, 1000 points, the first 100 left out, 15 lags, 200 runs.
#[test]
fn the_motivating_example_of_the_authors_is_recovered() {
    let mut f = diagonal(3, &[0.1, 0.2, 0.3]);
    f[(0, 2)] = 0.1;
    let g = DMatrix::from_column_slice(3, 1, &[1.0, 2.0, 3.0]);
    let h = DMatrix::from_row_slice(1, 3, &[0.1, 0.2, 0.0]);
    let q = &g * g.transpose();
    let sources = vec![
        Source { q: q.clone(), r: DMatrix::zeros(1, 1) },
        Source { q: DMatrix::zeros(3, 3), r: DMatrix::identity(1, 1) },
    ];
    let example = Example::new(f, h, sources, &(q * 0.2), &DMatrix::from_element(1, 1, 0.4));
    let spread = example.assert_recovers(&[0.5, 0.1], 200, 1000);
    // the cloud of the authors' figure lies within 0.1 … 1 and 0 … 0.2
    assert!(spread[0] < 0.15 && spread[1] < 0.04, "{spread:?}");
}

/// The diagonal example of the same package (`simulate_data8_diag`): three measurements, six variances, a filter
/// made for a Q of 1, 2, 3 and nearly no R.
#[test]
fn six_variances_of_the_diagonal_example_are_recovered() {
    let mut f = diagonal(3, &[0.1, 0.2, 0.3]);
    f[(0, 2)] = 0.1;
    let unit = |i: usize| DMatrix::from_fn(3, 3, |a, b| f64::from(a == i && b == i));
    let none = || DMatrix::<f64>::zeros(3, 3);
    let of_q = (0..3).map(|i| Source { q: unit(i), r: none() });
    let sources = of_q.chain((0..3).map(|i| Source { q: none(), r: unit(i) })).collect();
    let r = diagonal(3, &[0.5e-3, 0.2e-3, 0.8e-3]);
    let example = Example::new(f, DMatrix::identity(3, 3), sources, &diagonal(3, &[1.0, 2.0, 3.0]), &r);
    example.assert_recovers(&[0.5, 0.2, 0.1, 0.5, 0.2, 0.8], 60, 5000);
}

/// Identity: the innovations of the right filter are white with S; of another gain their power is larger.
#[test]
fn innovations_of_the_right_filter_are_expected_to_be_white() {
    let f = DMatrix::from_row_slice(2, 2, &[0.9, 0.1, 0.0, 0.7]);
    let h = DMatrix::from_row_slice(1, 2, &[1.0, 0.5]);
    let (q, r) = (diagonal(2, &[0.3, 0.1]), DMatrix::from_element(1, 1, 0.4));
    let p = dare_doubling(&f, &h, &q, &r).unwrap().covariance;
    let s = (&h * &p * h.transpose() + &r)[(0, 0)];
    let gain = &p * h.transpose() / s;
    let source = Source { q, r };
    let white = expected(&f, &h, &gain, &source, 4).unwrap();
    close(white[0][(0, 0)], s, 1e-12);
    assert!(white[1..].iter().all(|c| c[(0, 0)].abs() < 1e-12 * s), "{white:?}");
    assert!(expected(&f, &h, &(gain * 0.5), &source, 4).unwrap()[0][(0, 0)] > s);
}

fn simulated(params: &Params, samples: u64, seed: u64) -> SensorLog {
    let scenario = Scenario {
        seed,
        run: 0,
        samples,
        rate_hz: params.sample_rate_hz,
        true_rate: TrueRate::Rest,
        turn_on: true,
        saturation: None,
        quantisation: None,
    };
    let mut axes = Vec::new();
    Simulator::new(params, &scenario).unwrap().next_block(samples as usize, &mut axes);
    SensorLog { missing: vec![0; samples as usize], sensor: axes.swap_remove(0).measured, aids: vec![] }
}

/// Four hours at 10 Hz, the start wrong by factors. False alarm: five standard deviations each, 6e-7; the spread
/// that the least squares claims holds for a gain near the best one, and this one is not: half of it more.
#[test]
fn amounts_of_noise_of_a_sensor_are_found_and_times_stay() {
    let truth = sensor(10.0, vec![white(0.05), gauss_markov(0.04, 60.0)], Some(0.5));
    let mut own = simulated(&truth, 144_000, 3);
    // a gap, and samples that are no numbers
    own.missing[90_000] = 300;
    own.sensor[100_000..100_020].fill(f64::NAN);
    let logs = log(vec![own]);
    let start = sensor(10.0, vec![white(0.04), gauss_markov(0.06, 60.0)], Some(0.5));
    let (_, record) = chosen(&start, &Request { logs: &logs, ..request(Objective::Als) });
    for (path, value) in [("white.density", 0.05), ("gauss_markov.std_dev", 0.04)] {
        let found = moved(&record, path);
        let [lower, upper] = found.interval.unwrap();
        let std_dev = 1.5 * (upper / lower).ln() / (2.0 * 1.959_964);
        assert!((found.to / value).ln().abs() < 5.0 * std_dev && std_dev < 0.2, "{found:?}");
    }
    let time = moved(&record, "gauss_markov.correlation_time");
    assert!(time.held && time.factor == 1.0);
}

#[test]
fn what_als_cannot_tell_is_refused() {
    let params = sensor(10.0, vec![white(0.05), gauss_markov(0.04, 60.0)], Some(0.5));
    let logs = log(vec![simulated(&params, 2_000, 3)]);
    let message = refused(&params, &Request { logs: &logs, ..request(Objective::Als) });
    assert!(message.contains("too short for als"), "{message}");
    assert!(refused(&params, &request(Objective::Als)).contains("needs a log"));
    // two processes of nearly the same time
    let alike = sensor(10.0, vec![white(0.05), gauss_markov(0.04, 20.0), gauss_markov(0.04, 20.0002)], Some(0.5));
    let logs = log(vec![simulated(&params, 40_000, 3)]);
    let message = refused(&alike, &Request { logs: &logs, ..request(Objective::Als) });
    assert!(message.contains("hold some of them"), "{message}");
}
