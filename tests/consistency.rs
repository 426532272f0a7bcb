//! Consistency statistics against closed forms, scipy and statsmodels, and their measured sizes under the null
//! hypothesis.

use approx::assert_relative_eq;
use kfdesign::consistency::TestKind;
use kfdesign::consistency::effect::{self, Effect};
use kfdesign::consistency::low_frequency::{LowFrequency, block_lengths, detectable_ratio, time_constants};
use kfdesign::consistency::multiplicity::{holm, judge};
use kfdesign::consistency::normalized::{
    across_runs, effective_samples, gated_moments, mean_of_chi_squares, over_time,
};
use kfdesign::consistency::whiteness::{Autocorrelation, cumulative_periodogram, kolmogorov_quantile};
use kfdesign::consistency::{Test, Verdict};
use kfdesign::numerics::distribution::{kolmogorov_sf, normal_cdf, normal_quantile};
use kfdesign::numerics::random::{StreamId, fill_normal, stream};

/// A deterministic series, mean removed: sin(0.37 k²) + 0.3 sin(0.9 k), k < 400.
fn series() -> Vec<f64> {
    let x: Vec<f64> = (0..400).map(f64::from).map(|k| (0.37 * k * k).sin() + 0.3 * (0.9 * k).sin()).collect();
    let mean = x.iter().sum::<f64>() / x.len() as f64;
    x.iter().map(|v| v - mean).collect()
}

fn white(run: u64, n: usize) -> Vec<f64> {
    let mut values = vec![0.0; n];
    fill_normal(&mut stream(20, StreamId { run, axis: 0, term: 0 }), &mut values);
    values
}

fn accumulate(lags: usize, values: &[f64]) -> Autocorrelation {
    let mut sums = Autocorrelation::new(lags);
    values.iter().for_each(|y| sums.push(*y));
    sums
}

/// ANEES bounds as printed in Bar-Shalom, Li & Kirubarajan 2001 (n = 2, 50 runs: [1.5, 2.6]); digits from scipy 1.17.1,
/// chi2.ppf([0.025, 0.975], n*M)/M.
#[test]
fn anees_bounds_are_chi_square() {
    let vectors = [
        (1, 50, [0.64714727, 1.4284039]),
        (2, 50, [1.48443855, 2.59122394]),
        (2, 100, [1.62727983, 2.41057896]),
        (3, 50, [2.35969031, 3.71600894]),
        (6, 100, [5.3401855, 6.69769152]),
    ];
    for (states, runs, [lower, upper]) in vectors {
        let test = mean_of_chi_squares(0.0, runs, f64::from(states), 0.05);
        assert_relative_eq!(test.lower, lower, max_relative = 1e-8);
        assert_relative_eq!(test.upper, upper, max_relative = 1e-8);
    }
    let same = across_runs(&[1.0; 50], 1.0, 0.05);
    assert_relative_eq!(same.mean, 1.0);
    assert_relative_eq!(same.upper, 1.4284039, max_relative = 1e-8);
}

/// The two usual rules for the NEES of a perfect filter: sum it over time, or count the times outside a 95 % band.
///
/// The error has one state and the pole of the reference sensor's drift filter, 100 Hz, 600 s. Formula: the sum over
/// n epochs has the variance of n_eff of them, so it leaves its 95 % bounds with probability 2 Φ(−1.96 √(n_eff/n)) =
/// 96.5 %. Counting: independent simulation gave 45 %. False alarm: 400 experiments each, bounds at 4.5 standard
/// deviations (3.7 % and 11 %), 1e-5.
#[test]
fn usual_rules_reject_perfect_filters() {
    let (pole, steps, experiments) = (0.99949048_f64, 60_000, 400);
    let worth = effective_samples(steps as u64, pole * pole);
    let predicted = 2.0 * normal_cdf(-normal_quantile(0.975) * (worth / steps as f64).sqrt());
    assert_relative_eq!(predicted, 0.9646, max_relative = 1e-3);
    let path = |run: u64, axis: u32, pole: f64, steps: usize| {
        let mut noise = vec![0.0; steps];
        fill_normal(&mut stream(21, StreamId { run, axis, term: 0 }), &mut noise);
        let (mut error, fresh) = (noise[0], (1.0 - pole * pole).sqrt());
        noise.iter_mut().skip(1).for_each(|x| {
            error = pole * error + fresh * *x;
            *x = error;
        });
        noise
    };
    let bounds = mean_of_chi_squares(0.0, steps as u64, 1.0, 0.05);
    let summed = |run: &u64| {
        let mean = path(*run, 0, pole, steps).iter().map(|e| e * e).sum::<f64>() / steps as f64;
        mean < bounds.lower || mean > bounds.upper
    };
    let by_sum = (0..experiments).filter(summed).count() as f64 / experiments as f64;
    // 50 runs at every 40th step, 0.4 s, a fiftieth of the filter's time constant
    let (runs, times) = (50, steps / 40);
    let band = mean_of_chi_squares(0.0, runs, 1.0, 0.05);
    let counted = |experiment: &u64| {
        let mut nees = vec![0.0; times];
        for run in 0..runs {
            let errors = path(experiment * runs + run, 1, pole.powi(40), times);
            nees.iter_mut().zip(errors).for_each(|(sum, e)| *sum += e * e / runs as f64);
        }
        let outside = nees.iter().filter(|v| **v < band.lower || **v > band.upper).count();
        outside as f64 > 0.05 * times as f64
    };
    let by_count = (0..experiments).filter(counted).count() as f64 / experiments as f64;
    println!("perfect filters rejected: {by_sum} by the sum over time, {by_count} by counting times outside a band");
    assert!((by_sum - predicted).abs() < 0.042, "{by_sum}");
    assert!((by_count - 0.45).abs() < 0.11, "{by_count}");
}

/// Both tails: a mean at the 0.5 % point has p = 0.01 on either side, and the tendency is told apart.
#[test]
fn mean_tests_are_two_sided() {
    let bounds = mean_of_chi_squares(0.0, 40, 2.0, 0.01);
    for (mean, tendency) in [(bounds.lower, "pessimistic"), (bounds.upper, "optimistic")] {
        let at = mean_of_chi_squares(mean * 40.0, 40, 2.0, 0.01);
        assert_relative_eq!(at.p_value, 0.01, max_relative = 1e-6);
        let beyond = if tendency == "optimistic" { 1.001 } else { 0.999 };
        let outside = mean_of_chi_squares(mean * 40.0 * beyond, 40, 2.0, 0.01);
        assert_eq!(outside.tendency(), tendency);
        assert!(outside.nees("x").meaning.contains(tendency));
        assert!(outside.nis("x", 0.1, 0.01).meaning.contains(tendency));
    }
    assert_eq!(mean_of_chi_squares(80.0, 40, 2.0, 0.01).tendency(), "as predicted");
}

/// Direct sum n/(1 + 2 Σ (1 − h/n) ρ^h), evaluated in Python; ρ = λ² of the reference set, at 10 min, 1 h, 10 h of
/// 100 Hz.
#[test]
fn effective_sample_size_of_correlated_nees() {
    let rho = 0.9994904814605_f64.powi(2);
    for (n, expected) in [(60_000, 31.087211983006608), (360_000, 183.9747700477227), (3_600_000, 1835.2341747618832)] {
        assert_relative_eq!(effective_samples(n, rho), expected, max_relative = 1e-9);
    }
    assert_eq!(effective_samples(1000, 0.0), 1000.0);
    assert_relative_eq!(effective_samples(1000, 1.0), 1.0, max_relative = 1e-12);
    assert!(effective_samples(1000, 1.5).is_nan());
    // where the closed form hands over to the series both agree with the sum
    for rho in [1.0 - 2e-7, 1.0 - 5e-8] {
        let sum: f64 = (1..1000).map(|h| (1.0 - f64::from(h) / 1000.0) * f64::powi(rho, h)).sum();
        assert_relative_eq!(effective_samples(1000, rho), 1000.0 / (1.0 + 2.0 * sum), max_relative = 1e-8);
    }
    let correlated = over_time(1.0, 4, 60_000, 1.0, rho, 0.05);
    let independent = mean_of_chi_squares(124.0, 124, 1.0, 0.05);
    assert_relative_eq!(correlated.upper, independent.upper, max_relative = 2e-3);
}

/// scipy 1.17.1: truncnorm(-g, g).moment(2) and moment(4) − moment(2)².
#[test]
fn moments_behind_a_gate() {
    let vectors = [
        (1.0, 0.291125094772793, 0.07974655828470438),
        (2.0, 0.7737413035499232, 0.8175135200303281),
        (3.0, 0.9733369246625415, 1.7326583270389637),
        (5.0, 0.9999851327963293, 1.9996134524835267),
    ];
    for (gate, mean, variance) in vectors {
        let (m, v) = gated_moments(gate);
        assert_relative_eq!(m, mean, max_relative = 1e-9);
        assert_relative_eq!(v, variance, max_relative = 1e-8);
    }
}

/// statsmodels 0.15.0: acorr_ljungbox(x, lags=[10, 40]) and acf(x, nlags=40) of the same series.
#[test]
fn ljung_box_and_largest_lag() {
    let x = series();
    for (lags, statistic, p) in
        [(10, 5.277079929606187, 0.8719169535041091), (40, 49.26225080677584, 0.14958293548569887)]
    {
        let result = accumulate(lags, &x).whiteness(0.05);
        assert_relative_eq!(result.ljung_box, statistic, max_relative = 1e-10);
        assert_relative_eq!(result.ljung_box_upper_p_value, p, max_relative = 1e-8);
    }
    let result = accumulate(40, &x).whiteness(0.05);
    assert_eq!(result.max_lag, 17);
    // ours divides by the number of pairs, acf by n
    assert_relative_eq!(result.max_abs_autocorrelation, 0.2335244530027322 * 400.0 / 383.0, max_relative = 1e-10);
    assert!(result.interval[0] < result.max_abs_autocorrelation && result.max_abs_autocorrelation < result.interval[1]);
}

fn autoregressive(phi: f64, run: u64) -> Vec<f64> {
    let mut x = 0.0;
    white(run, 4000)
        .iter()
        .map(|e| {
            x = phi * x + e;
            x
        })
        .collect()
}

/// Missing samples keep their place: products and pairs equal a loop over all pairs of present samples.
#[test]
fn autocorrelation_over_missing_samples() {
    let x = series();
    let mut sums = Autocorrelation::new(12);
    let mut present: Vec<Option<f64>> = Vec::new();
    for (k, y) in x.iter().enumerate() {
        let missing = match k {
            50 => 3,
            51 => 1,
            200 => 40,
            _ => 0,
        };
        sums.skip(missing);
        present.extend(std::iter::repeat_n(None, missing as usize));
        sums.push(*y);
        present.push(Some(*y));
    }
    let squares: f64 = x.iter().map(|y| y * y).sum();
    let n = x.len() as f64;
    let result = sums.whiteness(0.05);
    for h in 1..=12 {
        let pairs: Vec<f64> = present.windows(h + 1).filter_map(|w| Some(w[0]? * w[h]?)).collect();
        let expected = pairs.iter().sum::<f64>() / pairs.len() as f64 / (squares / n);
        assert_relative_eq!(result.autocorrelation[h - 1], expected, max_relative = 1e-11);
    }
}

/// scipy 1.17.1: kstest of the cumulative periodogram against the uniform law (exact p-values for 198 points; its
/// sign is that of the straight line less ours).
#[test]
fn cumulative_periodogram_is_a_kolmogorov_test() {
    let result = cumulative_periodogram(&series(), 0.05).unwrap();
    assert_eq!(result.ordinates, 199);
    assert_relative_eq!(result.distance, 0.07371168969935776, max_relative = 1e-10);
    assert_relative_eq!(result.p_value, 0.22109024454963067, max_relative = 1e-2);
    let noise: Vec<f64> =
        (0..400).map(|k| (1e4 * ((f64::from(k) * 12.9898).sin() * 43758.5453).fract()).sin()).collect();
    let result = cumulative_periodogram(&noise, 0.05).unwrap();
    assert_relative_eq!(result.distance.abs(), 0.07191508587871276, max_relative = 1e-6);
    assert_relative_eq!(result.p_value, 0.2454309435050075, max_relative = 2e-2);
    assert!(cumulative_periodogram(&[0.0; 400], 0.05).is_none());
    assert!(cumulative_periodogram(&[1.0, -1.0, 1.0], 0.05).is_none());
}

/// The inverse of its law; far out one term of it is left, 2 e^(−2x²) = p.
#[test]
fn kolmogorov_quantiles() {
    for p in [1e-300, 1e-30, 1e-6] {
        assert_relative_eq!(kolmogorov_quantile(p), (0.5 * f64::ln(2.0 / p)).sqrt(), max_relative = 1e-14);
    }
    for p in [0.001, 0.05, 0.5, 0.9, 0.999] {
        assert_relative_eq!(kolmogorov_sf(kolmogorov_quantile(p)), p, max_relative = 1e-13);
    }
    assert_eq!((kolmogorov_quantile(0.0), kolmogorov_quantile(1.0)), (20.0, 0.1));
    assert!([-0.1, 1.1, f64::NAN].iter().all(|p| kolmogorov_quantile(*p).is_nan()));
}

/// scipy 1.17.1: chi2 of the block means of 16 samples of the same series (25 blocks).
#[test]
fn block_means_are_chi_square() {
    let mut blocks = LowFrequency::with_lengths(&[16]);
    series().iter().for_each(|y| blocks.push(*y));
    let results = blocks.results(1.0, 0.01);
    assert_eq!((results.len(), results[0].blocks, results[0].length), (1, 25, 16));
    assert_relative_eq!(results[0].ratio, 0.50321108824605, max_relative = 1e-10);
    assert_relative_eq!(results[0].p_value, 0.03751540214607164, max_relative = 1e-8);
    assert_relative_eq!(results[0].lower, 0.4207860844809879, max_relative = 1e-8);
    assert_relative_eq!(results[0].upper, 1.8771156064032297, max_relative = 1e-8);
    let [low, high] = detectable_ratio(30.0, 0.01, 0.9);
    assert_relative_eq!(low, 0.3424759471771888, max_relative = 1e-8);
    assert_relative_eq!(high, 2.6055318527338875, max_relative = 1e-8);
}

#[test]
fn block_lengths_follow_the_filter() {
    assert_eq!(block_lengths(&[1962.14]), [491, 1964, 7856, 31_424]);
    assert_eq!(block_lengths(&[2.0]), [4, 16]);
    assert_eq!(block_lengths(&[100.0, 10_000.0]), [25, 100, 400, 1600, 6400, 25_600, 102_400]);
    assert_eq!(block_lengths(&[])[..3], [16, 64, 256]);
    let constants = time_constants(&[(1.0, 0.0), (0.9994904814605, 0.0), (0.0, 0.0), (0.6, 0.3)]);
    assert_eq!(constants.len(), 2);
    assert_relative_eq!(constants[0] * 0.01, 19.6214, max_relative = 1e-5);
    assert_relative_eq!(constants[1], -1.0 / 0.45_f64.sqrt().ln(), max_relative = 1e-12);
}

/// Merging neighbours when the store is full gives the block means of twice the length.
#[test]
fn kept_blocks_double_without_growing() {
    let values = white(1, 100_000);
    let mut streamed = LowFrequency::with_lengths(&[2]);
    values.iter().for_each(|y| streamed.push(*y));
    let (length, periodogram) = streamed.periodogram(0.05).unwrap();
    assert_eq!(length, 8);
    let means: Vec<f64> = values.chunks_exact(8).map(|c| c.iter().sum::<f64>() / 8.0).collect();
    let whole = cumulative_periodogram(&means, 0.05).unwrap();
    assert_eq!(periodogram.ordinates, whole.ordinates);
    assert_relative_eq!(periodogram.distance, whole.distance, max_relative = 1e-9);
}

/// statsmodels 0.15.0: multipletests(p, method='holm').
#[test]
fn holm_adjustment() {
    let adjusted = holm(&[0.01, 0.04, 0.03, 0.005, 0.6, 0.0001, 0.2]);
    for (a, b) in adjusted.iter().zip([0.05, 0.12, 0.12, 0.03, 0.6, 0.0007, 0.4]) {
        assert_relative_eq!(*a, b, max_relative = 1e-12);
    }
    let with_nan = holm(&[0.01, f64::NAN]);
    assert_eq!(with_nan[0], 0.01);
    assert!(with_nan[1].is_nan());
}

fn test_with(p: f64, effect: Option<[f64; 3]>) -> Test {
    let test = Test::new("x", TestKind::Nees, 0.0, [0.0, 0.0], p, String::new());
    match effect {
        Some([low, value, high]) => test.with_effect(Effect::new("e", value, [low, high], [-0.1, 0.1])),
        None => test,
    }
}

/// Without a number nothing passes, by either rule, and no sentence claims that it did.
#[test]
fn what_is_no_number_never_passes() {
    let none = [(f64::NAN, 0.5), (0.0, f64::NAN), (f64::INFINITY, 0.5), (f64::NAN, f64::NAN)];
    for (statistic, p) in none {
        let test = || Test::new("x", TestKind::Nees, statistic, [0.0, 1.0], p, "all is well".into());
        let sound = || Test::new("x", TestKind::Nis, 0.5, [0.0, 1.0], 0.5, "all is well".into());
        assert!(!test().pass() && !test().has_numbers() && test().meaning.contains("nothing can be said"));
        assert!(!sound().pass(), "before it is judged");
        let mut tests = [test(), sound()];
        assert_eq!(judge(&mut tests, 0.01), Verdict::Inconclusive);
        assert_eq!((tests[0].pass(), tests[1].pass()), (false, true));
        let small = |test: Test| test.with_effect(Effect::new("e", 0.0, [0.0, 0.0], [-0.1, 0.1]));
        let mut tests = [small(test()), small(sound())];
        assert_eq!(effect::judge(&mut tests, 0.01, true), Verdict::Inconclusive);
        assert_eq!((tests[0].pass(), tests[1].pass()), (false, true));
    }
}

/// Every branch of the verdict on measured logs.
#[test]
fn verdict_weighs_significance_and_size() {
    let cases = [
        (vec![test_with(0.5, Some([-0.3, 0.2, 0.7]))], true, Verdict::Consistent), // not significant
        (vec![test_with(1e-9, Some([0.02, 0.03, 0.04]))], true, Verdict::Consistent), // sure but small
        (vec![test_with(1e-9, Some([0.02, 0.09, 0.16]))], true, Verdict::Inconclusive), // sure, perhaps large
        (vec![test_with(1e-9, Some([0.08, 0.12, 0.16]))], true, Verdict::Inconsistent), // sure and large
        (vec![test_with(1e-9, Some([-0.4, -0.2, -0.15]))], true, Verdict::Inconsistent), // the other side
        (vec![test_with(1e-9, None)], true, Verdict::Inconsistent),
        (vec![test_with(0.5, None)], false, Verdict::Inconclusive), // too short
        (vec![test_with(1e-9, None), test_with(0.5, None)], false, Verdict::Inconsistent),
        (vec![test_with(f64::NAN, None)], true, Verdict::Inconclusive),
        (vec![test_with(0.008, None), test_with(0.5, None)], true, Verdict::Consistent), // Holm: 0.016
        (vec![], true, Verdict::Inconclusive),
    ];
    for (i, (mut tests, enough, expected)) in cases.into_iter().enumerate() {
        assert_eq!(effect::judge(&mut tests, 0.01, enough), expected, "case {i}");
        let failed = tests.iter().any(|t| t.has_numbers() && !t.pass());
        assert_eq!(failed, expected == Verdict::Inconsistent, "case {i}");
    }
    assert_eq!(judge(&mut [test_with(1e-9, Some([0.02, 0.03, 0.04]))], 0.01), Verdict::Inconsistent);
    assert_eq!(judge(&mut [test_with(0.02, None)], 0.01), Verdict::Consistent);
}

/// Sizes under the null hypothesis: white noise, 2000 samples, 3000 runs, each test at alpha = 0.05. Each rejection
/// count is binomial(3000, 0.05) for an exact test; the bounds are 4.9 standard deviations (1e-6 two-sided) plus,
/// for the asymptotic ones (largest lag, Ljung-Box), 0.006 for the error of the approximation. Five tests:
/// false-alarm probability below 1e-5. With 2000 samples, a filter of 80 samples time constant and no more than 20
/// lags.
#[test]
fn sizes_under_the_null_hypothesis() {
    let (runs, alpha) = (3000, 0.05);
    let mut rejected = [0u32; 6];
    let mut family = 0u32;
    for run in 0..runs {
        let values = white(run, 2000);
        let sums = accumulate(20, &values);
        let whiteness = sums.whiteness(alpha);
        let mut low = LowFrequency::new(&[80.0], 0.0125);
        values.iter().for_each(|y| low.push(*y));
        let nis = mean_of_chi_squares(sums.squares(), sums.count(), 1.0, alpha);
        let mut tests = vec![nis.nis("x", 0.03, alpha)];
        tests.extend(whiteness.tests("x", 1.0, alpha));
        tests.extend(low.results(1.0, alpha).iter().take(2).map(|b| b.test("x", 1.0)));
        tests.push(low.periodogram(alpha).unwrap().1.test("x", 20.0));
        assert_eq!(tests.len(), 6);
        for (count, test) in rejected.iter_mut().zip(&tests) {
            *count += u32::from(test.p_value < alpha);
            assert_eq!(test.p_value < alpha, test.statistic < test.lower || test.statistic > test.upper, "{test:?}");
        }
        family += u32::from(judge(&mut tests, alpha) == Verdict::Inconsistent);
    }
    let n = runs as f64;
    let spread = 4.9 * (alpha * (1.0 - alpha) / n).sqrt();
    for (r, slack) in rejected.iter().zip([0.0, 0.006, 0.006, 0.0, 0.0, 0.002]) {
        let size = f64::from(*r) / n;
        assert!((size - alpha).abs() < spread + slack, "{rejected:?}");
    }
    // Holm: at most alpha; the tests are nearly independent, so hardly less
    let size = f64::from(family) / n;
    assert!(size < alpha + spread && size > 0.5 * alpha, "family-wise size {size}");
}

/// The block test rejects with 90 % probability at its stated `detects` ratios: 2000 runs, 4.9 standard deviations
/// (1e-6).
#[test]
fn stated_power_is_reached() {
    let (blocks, runs) = (40, 2000);
    let detects = detectable_ratio(f64::from(blocks), 0.01, 0.9);
    for (side, ratio) in detects.into_iter().enumerate() {
        let seen = (0..runs).filter(|run| {
            let mut low = LowFrequency::with_lengths(&[2]);
            // the two samples of a block are equal halves of one number: variance `ratio` of the scaled mean
            let values = white(10_000 + run + 5000 * side as u64, blocks as usize);
            values.iter().for_each(|y| {
                low.push(y * (ratio / 2.0).sqrt());
                low.push(y * (ratio / 2.0).sqrt());
            });
            low.results(1.0, 0.01)[0].p_value < 0.01
        });
        let power = seen.count() as f64 / runs as f64;
        assert!((power - 0.9).abs() < 4.9 * (0.09 / runs as f64).sqrt(), "ratio {ratio}: power {power}");
    }
}

/// Largest |autocorrelation| of an AR(1) series: the simultaneous interval holds the true value φ in at least 95 %
/// of 400 runs (bound: 4.9 standard deviations below 0.95, 1e-6), and the share that the past predicts, φ², is met.
#[test]
fn interval_of_the_largest_autocorrelation_covers() {
    let phi = 0.5_f64;
    let (mut covered, mut share) = (0, 0.0);
    for run in 0..400 {
        let result = accumulate(20, &autoregressive(phi, 50_000 + run)).whiteness(0.05);
        covered += u32::from(result.interval[0] <= phi && phi <= result.interval[1]);
        // Šidák's quantile for 20 lags: scipy 1.17.1, norm.ppf(1 − (1 − 0.95**(1/20))/2)
        let half_width = (result.interval[1] - result.interval[0]) / 2.0;
        assert_relative_eq!(half_width, 3.015994533489952 / 3999.0_f64.sqrt(), max_relative = 1e-9);
        let effect = result.tests("x", 1.0, 0.05)[1].effect.clone().unwrap();
        share += effect.value / 400.0;
        assert!(effect.is_beyond());
    }
    assert!(f64::from(covered) >= 400.0 * 0.95 - 4.9 * (400.0 * 0.95 * 0.05_f64).sqrt(), "covered {covered}");
    // mean of 400 values whose spread is about 0.025: 0.01 is eight standard errors, with room for the bias of order
    // 1/n
    assert!((share - phi * phi).abs() < 0.01, "{share}");
}

/// AR(1) with φ = 0.1: the interval of the predictable share, φ², covers it in 95 % of 400 runs (± 4.9 standard
/// deviations, 1e-6).
#[test]
fn interval_of_the_predictable_share_covers() {
    let phi = 0.1_f64;
    let truth = phi * phi;
    let covered = (0..400).filter(|run| {
        let result = accumulate(20, &autoregressive(phi, 60_000 + run)).whiteness(0.05);
        let effect = result.tests("x", 1.0, 0.05)[1].effect.clone().unwrap();
        effect.interval[0] <= truth && truth <= effect.interval[1]
    });
    let coverage = covered.count() as f64 / 400.0;
    assert!((coverage - 0.95).abs() < 4.9 * (0.05 * 0.95 / 400.0_f64).sqrt(), "{coverage}");
}
