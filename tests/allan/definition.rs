//! Every deviation against its definition in whole numbers, where nothing is rounded; the same bits from any number
//! of threads.

use super::*;

/// A walk of whole numbers, steps from −512 to 511: a phase of which all differences and their squares are exact.
fn whole_numbers(points: usize) -> Vec<i64> {
    let steps = congruential(1_234_567, points).into_iter().map(|u| (1024.0 * u) as i64 - 512);
    steps
        .scan(0, |at, step| {
            *at += step;
            Some(*at)
        })
        .collect()
}

fn second(x: &[i64], k: usize, m: usize) -> i128 {
    i128::from(x[k + 2 * m]) - 2 * i128::from(x[k + m]) + i128::from(x[k])
}

fn third(x: &[i64], k: usize, m: usize) -> i128 {
    second(x, k + m, m) - second(x, k, m)
}

/// NIST SP 1065, section 5.2, word by word for dt = 1.
fn definition(kind: Deviation, x: &[i64], m: usize) -> f64 {
    let n = x.len() - 1;
    let (seconds, thirds) = (n + 1 - 2 * m, (n + 1).saturating_sub(3 * m));
    let squares: Vec<i128> = match kind {
        Deviation::Adev => (0..seconds).step_by(m).map(|k| second(x, k, m).pow(2)).collect(),
        Deviation::Oadev => (0..seconds).map(|k| second(x, k, m).pow(2)).collect(),
        Deviation::Hdev => (0..thirds).step_by(m).map(|k| third(x, k, m).pow(2)).collect(),
        Deviation::Ohdev => (0..thirds).map(|k| third(x, k, m).pow(2)).collect(),
        Deviation::Mdev => {
            let mut sums = vec![0];
            for k in 0..seconds {
                sums.push(sums[k] + second(x, k, m));
            }
            (0..=seconds - m).map(|j| (sums[j + m] - sums[j]).pow(2)).collect()
        }
        Deviation::Totdev => {
            let at = |i: i64| match i {
                i if i < 0 => 2 * x[0] - x[-i as usize],
                i if i > n as i64 => 2 * x[n] - x[2 * n - i as usize],
                i => x[i as usize],
            };
            let centred = |i: i64| i128::from(at(i - m as i64)) - 2 * i128::from(at(i)) + i128::from(at(i + m as i64));
            (1..n as i64).map(|i| centred(i).pow(2)).collect()
        }
    };
    let m = m as f64;
    let norm = match kind {
        Deviation::Adev | Deviation::Oadev | Deviation::Totdev => 2.0 * m * m,
        Deviation::Hdev | Deviation::Ohdev => 6.0 * m * m,
        Deviation::Mdev => 2.0 * m.powi(4),
    };
    squares.iter().sum::<i128>() as f64 / (norm * squares.len() as f64)
}

/// Lengths around the windows of 16384 start points and the lanes of 16, factors from one sample to all that fit.
///
/// Tolerance: at most 1200 roundings of a positive sum and a few of the norm, 1.4e-13; MDEV's moved sums are whole
/// numbers here.
#[test]
fn every_deviation_is_its_definition() {
    for n in [6, 17, 100, 16_385, 16_384 + 2 * 100, 50_003] {
        let whole = whole_numbers(n + 1);
        let phase: Vec<f64> = whole.iter().map(|x| *x as f64).collect();
        for kind in ALL {
            let largest = deviation::largest_factor(kind, n);
            let mut factors = vec![1, 2, 3, 4, 5, 16, 33, 100, 1000, 5000, 16_384, 16_385, largest - 1, largest];
            factors.retain(|m| (1..=largest).contains(m));
            let found = deviation::variances(kind, &phase, 1.0, &factors).unwrap();
            for (m, found) in factors.iter().zip(found) {
                let exact = definition(kind, &whole, *m as usize);
                let error = (found.variance / exact - 1.0).abs();
                assert!(error < 1.5e-13, "{kind:?}, n = {n}, m = {m}: {error:e}");
                // alone or among others: the same bits
                assert_eq!(deviation::variance(kind, &phase, 1.0, *m).unwrap(), found, "{kind:?} {n} {m}");
            }
        }
    }
}

/// Against sums that are compensated at every step. Within a block of 8192 samples, eight chains of 1024, roundings
/// of at most the largest phase add up: below 1100 units of 2^−53 of it; and the mean, off by as much as it is
/// rounded, tilts the line by n 2^−53 of itself.
#[test]
fn phase_is_the_compensated_sum() {
    for n in [1, 8191, 8192, 50_000] {
        let mut rate = vec![0.0; n];
        fill_normal(&mut stream(3, StreamId { run: 0, axis: 0, term: 0 }), &mut rate);
        rate.iter_mut().for_each(|y| *y += 5.0);
        let exact = |terms: &[f64]| ExactSum::from_digits(terms).value();
        let mean = exact(&rate) / n as f64;
        let phase = deviation::phase(&rate, 0.5);
        let mut sum = ExactSum::default();
        let mut expected = vec![0.0];
        for y in &rate {
            sum.add(*y);
            sum.add(-mean);
            expected.push(0.5 * sum.value());
        }
        let largest = expected.iter().map(|x| x.abs()).fold(0.0, f64::max);
        let bound = 1.1e-16 * (1100.0 * largest + 2.0 * n as f64 * mean);
        for (k, (found, expected)) in phase.iter().zip(&expected).enumerate() {
            assert!((found - expected).abs() <= bound, "n = {n}, point {k}: {found} and {expected}");
        }
        assert_eq!(phase.len(), n + 1);
    }
}

#[test]
fn threads_leave_no_trace() {
    let rate = path(&model(&[Term::White { density: 0.1 }, gauss_markov(0.05, 20.0)]), 0.01, 70_000, 11, 0);
    for kind in ALL {
        let curve = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| allan::curve(&rate, 0.01, kind, TauGrid::Log(5)).unwrap())
        };
        let one = curve(1);
        for threads in [2, 5] {
            assert_eq!(curve(threads).points, one.points, "{kind:?}, {threads} threads");
        }
    }
}
