//! Degrees of freedom, intervals and the covariance of the points against tables, quadratic forms and full sums.

use super::*;

fn oadev(n: usize, m: u64, dt: f64, terms: &[Term]) -> f64 {
    edf::degrees_of_freedom(Deviation::Oadev, n, m, dt, &model(terms))
}

/// The "exact" column of formulas.md section 3 (n = 2000), to its printed digits.
#[test]
fn table() {
    let white = [Term::White { density: 1.0 }];
    let walk = [Term::RateRandomWalk { density: 1.0 }];
    let correlated = [gauss_markov(1.0, 100.0)];
    let rows: [(&[Term], u64, f64, f64); 20] = [
        (&white, 1, 1332.89, 0.005),
        (&white, 2, 1141.63, 0.005),
        (&white, 3, 876.46, 0.005),
        (&white, 5, 569.55, 0.005),
        (&white, 10, 294.22, 0.005),
        (&white, 20, 147.37, 0.005),
        (&white, 50, 57.76, 0.005),
        (&white, 100, 27.78, 0.005),
        (&white, 500, 4.00, 0.005),
        (&walk, 1, 1999.0, 0.05),
        (&walk, 2, 1027.29, 0.005),
        (&walk, 3, 650.88, 0.005),
        (&walk, 5, 377.23, 0.005),
        (&walk, 10, 184.96, 0.005),
        (&walk, 100, 17.02, 0.005),
        (&walk, 500, 2.24, 0.005),
        (&correlated, 1, 1994.1, 0.05),
        (&correlated, 10, 186.4, 0.05),
        (&correlated, 100, 18.28, 0.005),
        (&correlated, 500, 3.06, 0.005),
    ];
    for (terms, m, expected, digit) in rows {
        let got = oadev(2000, m, 1.0, terms);
        assert!((got - expected).abs() <= digit, "{terms:?} m = {m}: {got} and {expected}");
    }
    assert!((oadev(2000, 900, 1.0, &correlated) - 1.10).abs() <= 0.005);
}

/// The reference sensor at tau = 367 s: 8.7, 18.9, 100.3 degrees of freedom from 1, 2, 10 h, and the interval factors.
#[test]
fn reference_sensor() {
    let terms = [Term::White { density: 0.0562 }, gauss_markov(0.028_059_6, 193.9312)];
    for (hours, expected, low, high) in [(1, 8.7, 0.685, 1.849), (2, 18.9, 0.760, 1.463), (10, 100.3, 0.879, 1.160)] {
        let got = oadev(hours * 360_000, 36_700, 0.01, &terms);
        assert!((got - expected).abs() <= 0.05, "{hours} h: {got}");
        let (lower, upper) = edf::interval(1.0, got);
        assert!((lower - low).abs() <= 6e-4 && (upper - high).abs() <= 2e-3, "{hours} h: {lower} {upper}");
    }
}

#[test]
fn interval_factors() {
    for (dof, low, high) in [(3.0, 0.566_490, 3.728_547), (10.0, 0.698_717, 1.754_934), (100.0, 0.878_542, 1.160_737)] {
        let (lower, upper) = edf::interval(1.0, dof);
        assert!((lower - low).abs() < 5e-7 && (upper - high).abs() < 5e-7, "{dof}: {lower} {upper}");
    }
    assert_eq!(edf::interval(2.0, f64::INFINITY), (2.0, 2.0));
}

/// The coarse grid of lags against every lag, for every kind of term alone and for a mixture.
#[test]
fn few_lags_equal_all_lags() {
    let mixture = [
        Term::Quantization { coefficient: 1e-4 },
        Term::White { density: 0.05 },
        Term::BiasInstability { coefficient: 0.01 },
        gauss_markov(0.03, 40.0),
        gauss_markov(0.01, 0.05),
        Term::RateRandomWalk { density: 1e-4 },
    ];
    let mut models: Vec<Vec<Term>> = mixture.iter().map(|t| vec![*t]).collect();
    models.push(mixture.to_vec());
    let (n, dt) = (60_000, 0.01);
    for terms in &models {
        for m in [1, 7, 300, 9000, 25_000] {
            let count = (n + 1 - 2 * m) as f64;
            let r = |h: u64| -> f64 { terms.iter().map(|t| t.second_difference_autocovariance(m, h, dt)).sum() };
            let r0 = r(0);
            let tail: f64 = (1..n + 1 - 2 * m).map(|h| (count - h as f64) * (r(h) / r0).powi(2)).sum();
            let full = count * count / (count + 2.0 * tail);
            let fast = oadev(n as usize, m, dt, terms);
            assert!((fast / full - 1.0).abs() < 1e-6, "{terms:?} m = {m}: {fast} and {full}");
        }
    }
}

/// The quadratic form itself, from the covariance matrix of the samples, for all exact members and with a ramp.
#[test]
fn quadratic_forms() {
    let n = 48;
    let mixture = model(&[
        Term::White { density: 0.7 },
        gauss_markov(1.3, 9.0),
        Term::RateRandomWalk { density: 0.2 },
        Term::Quantization { coefficient: 0.5 },
        Term::RateRamp { slope: 0.05 },
    ]);
    let (covariance, mean) = quadratic_form::samples(&mixture, n, 1.0);
    for kind in [Deviation::Adev, Deviation::Oadev, Deviation::Mdev, Deviation::Hdev, Deviation::Ohdev] {
        for m in [1, 3, 8] {
            let a = quadratic_form::form(kind, n, m);
            let product = &a * &covariance;
            let expectation = product.trace() + (mean.transpose() * &a * &mean)[0];
            let variance =
                2.0 * (&product * &product).trace() + 4.0 * (mean.transpose() * &a * &covariance * &a * &mean)[0];
            let full = 2.0 * expectation * expectation / variance;
            let got = edf::degrees_of_freedom(kind, n, m as u64, 1.0, &mixture);
            assert!((got / full - 1.0).abs() < 1e-7, "{kind:?} m = {m}: {got} and {full}");
            let mean = edf::expected_variance(kind, m as u64, 1.0, &mixture);
            assert!((mean / expectation - 1.0).abs() < 1e-9, "{kind:?} m = {m}: {mean} and {expectation}");
        }
    }
}

/// allantools 2024.06 `edf_greenhall(alpha, 2, m, N=1001, overlapping=True, modified=True)` where it sums every lag.
#[test]
fn modified_as_greenhall_and_riley() {
    let table = [
        (NoiseType::Quantization, [466.20944622855797, 123.94023271983103, 39.86318374180643, 1.0411412434879985]),
        (NoiseType::White, [478.9961522792087, 94.6342584913727, 29.998982005983045, 1.0012979691522201]),
        (NoiseType::Flicker, [475.6545831191038, 93.27298363859968, 29.513568551627593, 1.0007892541734547]),
        (NoiseType::RandomWalk, [382.70053866207803, 74.95713116875199, 23.664507401675202, 1.0003978789754175]),
    ];
    for (noise, values) in table {
        for (m, expected) in [2, 10, 30, 330].into_iter().zip(values) {
            let got = edf::power_law_degrees_of_freedom(Deviation::Mdev, 1000, m, noise);
            assert!((got / expected - 1.0).abs() < 1e-6, "{noise:?} m = {m}: {got} and {expected}");
        }
    }
    // its short cut for many lags, good to a per cent (m = 1000 and 20 000 of N = 100 001)
    for (noise, many, few) in [
        (NoiseType::White, 94.47549870092259, 2.7387182965356196),
        (NoiseType::Flicker, 93.04793195876876, 2.5411858794446906),
        (NoiseType::RandomWalk, 74.81924295431219, 1.9333381324589767),
    ] {
        for (m, expected) in [(1000, many), (20_000, few)] {
            let got = edf::power_law_degrees_of_freedom(Deviation::Mdev, 100_000, m, noise);
            assert!((got / expected - 1.0).abs() < 0.01, "{noise:?} m = {m}: {got} and {expected}");
        }
    }
}

/// NIST SP 1065 table 7 at large m; at m = 1 TOTDEV is the overlapping ADEV and has its degrees of freedom.
#[test]
fn total_as_published() {
    let total = |n, m, noise| edf::power_law_degrees_of_freedom(Deviation::Totdev, n, m, noise);
    let n = 100_000;
    for (noise, b, c) in
        [(NoiseType::White, 1.5, 0.0), (NoiseType::Flicker, 1.168, 0.222), (NoiseType::RandomWalk, 0.927, 0.358)]
    {
        let published = b * 50.0 - c;
        assert!((total(n, 2000, noise) / published - 1.0).abs() < 1e-12);
        let at_one = edf::power_law_degrees_of_freedom(Deviation::Oadev, n, 1, noise);
        assert!((total(n, 1, noise) / at_one - 1.0).abs() < 0.03, "{noise:?}");
    }
}

/// MDEV of a long log: the double coarse sum against every lag.
#[test]
fn modified_of_a_mixture_with_few_lags() {
    let (n, m, dt) = (12_000_i64, 900_i64, 0.01);
    let mixture = model(&[Term::White { density: 0.05 }, gauss_markov(0.03, 2.0)]);
    let second: Vec<f64> = (0..n)
        .map(|h| mixture.terms.iter().map(|t| t.second_difference_autocovariance(m as u64, h as u64, dt)).sum())
        .collect();
    let terms = n + 2 - 3 * m;
    let moving =
        |h: i64| -> f64 { (1 - m..m).map(|u| (m - u.abs()) as f64 * second[(h + u).unsigned_abs() as usize]).sum() };
    let r0 = moving(0);
    let tail: f64 = (1..terms).map(|h| (terms - h) as f64 * (moving(h) / r0).powi(2)).sum();
    let full = (terms as f64).powi(2) / (terms as f64 + 2.0 * tail);
    let fast = edf::degrees_of_freedom(Deviation::Mdev, n as usize, m as u64, dt, &mixture);
    assert!((fast / full - 1.0).abs() < 1e-4, "{fast} and {full}");
}

#[test]
fn nothing_to_say_is_nan() {
    assert!(oadev(10, 6, 1.0, &[Term::White { density: 1.0 }]).is_nan());
    assert!(oadev(10, 1, 1.0, &[]).is_nan());
    assert_eq!(oadev(10, 1, 1.0, &[Term::RateRamp { slope: 1.0 }]), f64::INFINITY);
}
