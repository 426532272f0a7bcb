//! Every noise term against closed forms, quadrature, brute-force sums and its own sample paths.

#[allow(clippy::excessive_precision, clippy::approx_constant, reason = "17 digits, as the oracle printed them")]
mod vectors;

mod average;
mod band_limit;
mod line;
mod thinned;

use kfdesign::noise::{Filter, Term};
use kfdesign::numerics::random::{StreamId, stream};
use nalgebra::DMatrix;
use rand::rngs::ChaCha8Rng;

const DT: f64 = 0.01;
const WHITE: Term = Term::White { density: 0.0562 };
const GAUSS_MARKOV: Term = Term::GaussMarkov { std_dev: 0.03, correlation_time: 193.9312 };
const QUANTIZATION: Term = Term::Quantization { coefficient: 1e-3 };
const FLICKER: Term = Term::BiasInstability { coefficient: 0.013 };
const LINE: Term = Term::Oscillation { std_dev: 0.03, frequency_hz: 20.3, correlation_time: 0.5 };
const AVERAGE: Term = Term::MovingAverage { density: 0.0562, samples: 3 };
const RANDOM_WALK: Term = Term::RateRandomWalk { density: 2.85e-3 };
const RAMP: Term = Term::RateRamp { slope: 2e-4 };

/// `scipy.signal.butter(2, 0.2)`: a low-pass at a tenth of the sample rate.
const BUTTERWORTH: [[f64; 3]; 2] = [
    [0.067_455_273_889_071_9, 0.134_910_547_778_143_8, 0.067_455_273_889_071_9],
    [1.0, -1.142_980_502_539_901_1, 0.412_801_598_096_188_77],
];

fn limited() -> Term {
    Term::BandLimit { density: 0.0562, filter: Filter::new(&BUTTERWORTH[0], &BUTTERWORTH[1]).unwrap() }
}

fn all() -> [Term; 9] {
    [WHITE, AVERAGE, limited(), GAUSS_MARKOV, QUANTIZATION, FLICKER, LINE, RANDOM_WALK, RAMP]
}

fn assert_relative(found: f64, expected: f64, tolerance: f64, what: &str) {
    assert!((found - expected).abs() <= tolerance * expected.abs(), "{what}: {found:e}, expected {expected:e}");
}

fn rng(seed: u64) -> ChaCha8Rng {
    stream(seed, StreamId { run: 0, axis: 0, term: 0 })
}

/// The printed digits: half a unit of the last one.
fn assert_printed(found: f64, printed: &str, what: &str) {
    let expected: f64 = printed.parse().unwrap();
    let (mantissa, exponent) = printed.split_once('e').unwrap_or((printed, "0"));
    let decimals = mantissa.split_once('.').map_or(0, |(_, d)| d.len() as i32);
    let half_unit = 0.500001 * 10f64.powi(exponent.parse::<i32>().unwrap() - decimals);
    assert!((found - expected).abs() <= half_unit, "{what}: {found:e}, printed {printed}");
}

mod allan_curve {
    use super::*;

    #[test]
    fn textbook_points() {
        // IEEE Std 952 Annex C; the Gauss–Markov closed form at 60 digits (mpmath 1.3)
        let q = Term::Quantization { coefficient: 1e-3 / 12f64.sqrt() };
        for (term, m, printed) in [
            (q, 1, "2.5000e-3"),
            (q, 3, "2.7778e-4"),
            (q, 10, "2.5000e-5"),
            (WHITE, 1, "0.31584"),
            (WHITE, 10, "0.031584"),
            (WHITE, 100, "3.1584e-3"),
            (RAMP, 10, "2.000e-10"),
            (RAMP, 1000, "2.000e-6"),
            (GAUSS_MARKOV, 1, "4.6407014255234e-8"),
            (GAUSS_MARKOV, 2, "6.9607530287347e-8"),
            (GAUSS_MARKOV, 10, "3.1081538949899e-7"),
            (GAUSS_MARKOV, 100, "3.0820990268026e-6"),
            (GAUSS_MARKOV, 1000, "2.9770580413729e-5"),
            (GAUSS_MARKOV, 36653, "3.4302457682084e-4"),
        ] {
            assert_printed(term.allan_variance(m, DT), printed, &format!("{term:?} at m = {m}"));
        }
    }

    #[test]
    fn sampled_random_walk_against_continuous() {
        // K²τ/3 · (1 + 1/(2m²)): 1.5 at m = 1, 1.125 at m = 2, 1.02 at m = 5, 1.005 at m = 10
        for (m, factor) in [(1, 1.5), (2, 1.125), (5, 1.02), (10, 1.005)] {
            let continuous = 2.85e-3f64.powi(2) * m as f64 * DT / 3.0;
            assert_relative(RANDOM_WALK.allan_variance(m, DT), factor * continuous, 1e-14, "random walk");
        }
    }

    #[test]
    fn gauss_markov_maximum() {
        // x* = 1.892617834, σ_A,max = 0.617364283 σ; g(x) at other x (mpmath 1.3), all for dt ≪ Tc
        let term = Term::GaussMarkov { std_dev: 1.0, correlation_time: 1.0 };
        let at = |tau: f64| {
            let m = 1_000_000;
            term.allan_variance(m, tau / m as f64)
        };
        assert_printed(at(1.892617834).sqrt(), "0.617364283", "maximum");
        for (x, printed) in [
            (0.001, "6.661668999e-4"),
            (0.01, "6.616899169e-3"),
            (0.1, "0.0618919066"),
            (1.0, "0.3361824814"),
            (1.89, "0.3811384183"),
            (10.0, "0.1700018160"),
            (100.0, "0.0197"),
        ] {
            assert_printed(at(x), printed, &format!("g({x})"));
        }
        for x in [1.8, 1.88, 1.905, 2.0] {
            assert!(at(x) < at(1.892617834), "the maximum is not at 1.8926 but nearer {x}");
        }
    }

    #[test]
    fn gauss_markov_nothing_cancels() {
        for (x, m, expected) in vectors::GAUSS_MARKOV_ALLAN {
            let term = Term::GaussMarkov { std_dev: 1.0, correlation_time: 1.0 / x };
            assert_relative(term.allan_variance(m, 1.0), expected, 1e-12, &format!("x = {x}, m = {m}"));
        }
    }

    #[test]
    fn flicker_closed_form() {
        let term = Term::BiasInstability { coefficient: 1.0 };
        for (m, expected) in vectors::FLICKER_ALLAN {
            assert_relative(term.allan_variance(m, DT), expected, 1e-13, &format!("m = {m}"));
        }
        // the floor of the textbooks: σ_A = 0.6642824703 B
        assert_printed(term.allan_variance(1_000_000, DT).sqrt(), "0.6642824703", "flicker floor");
    }

    /// σ²_A(m) = 4 ∫ S sin⁴(πfm dt)/(m² sin²(πf dt)) df over the sampled spectrum, for every term with a spectrum.
    #[test]
    fn equals_the_integral_of_the_spectrum() {
        let gauss_markov = Term::GaussMarkov { std_dev: 0.03, correlation_time: 0.5 };
        for term in [WHITE, AVERAGE, limited(), gauss_markov, QUANTIZATION, FLICKER, LINE, RANDOM_WALK] {
            for m in [1, 2, 3, 10, 64] {
                let integral = 4.0
                    * integrate(0.0, 0.5 / DT, 400 * m as usize, |f| {
                        let window = (std::f64::consts::PI * f * m as f64 * DT).sin().powi(4)
                            / (m as f64 * (std::f64::consts::PI * f * DT).sin()).powi(2);
                        term.psd(f, DT) * window
                    });
                assert_relative(term.allan_variance(m, DT), integral, 1e-9, &format!("{term:?} at m = {m}"));
            }
        }
    }

    /// The spectrum integrates to the variance and to the covariance at any lag.
    #[test]
    fn spectrum_integrates_to_the_autocovariance() {
        let gauss_markov = Term::GaussMarkov { std_dev: 0.03, correlation_time: 0.05 };
        for term in [WHITE, AVERAGE, limited(), gauss_markov, QUANTIZATION, LINE] {
            for lag in [0, 1, 2, 7] {
                let integral = 2.0
                    * integrate(0.0, 0.5 / DT, 400, |f| {
                        term.psd(f, DT) * (2.0 * std::f64::consts::PI * f * lag as f64 * DT).cos()
                    });
                let found = term.autocovariance(lag, DT).unwrap();
                let scale = term.autocovariance(0, DT).unwrap();
                assert!((found - integral).abs() < 1e-11 * scale, "{term:?} at lag {lag}: {found:e} and {integral:e}");
            }
        }
        for term in [FLICKER, RANDOM_WALK, RAMP] {
            assert!(term.autocovariance(1, DT).is_none());
        }
    }

    #[test]
    fn spectra_tend_to_the_textbook_forms() {
        let f = 1e-3;
        let w = 2.0 * std::f64::consts::PI * f;
        for (term, expected) in [
            (QUANTIZATION, w * w * 1e-6 * DT),
            (WHITE, 0.0562 * 0.0562),
            (FLICKER, 0.013 * 0.013 / w),
            (RANDOM_WALK, (2.85e-3 / w).powi(2)),
            (GAUSS_MARKOV, 2.0 * 0.0009 * 193.9312 / (1.0 + (w * 193.9312).powi(2))),
        ] {
            assert_relative(term.psd(f, DT), expected, 1e-8, &format!("{term:?}"));
            assert_eq!(term.psd(f, DT), term.psd(-f, DT), "two-sided and even");
        }
    }

    /// Gauss–Legendre with 8 points on `panels` equal panels.
    fn integrate(from: f64, to: f64, panels: usize, f: impl Fn(f64) -> f64) -> f64 {
        const NODES: [(f64, f64); 4] = [
            (0.183_434_642_495_649_8, 0.362_683_783_378_362),
            (0.525_532_409_916_329, 0.313_706_645_877_887_3),
            (0.796_666_477_413_626_7, 0.222_381_034_453_374_48),
            (0.960_289_856_497_536_2, 0.101_228_536_290_376_26),
        ];
        let half = 0.5 * (to - from) / panels as f64;
        let mut sum = 0.0;
        for k in 0..panels {
            let centre = from + (2 * k + 1) as f64 * half;
            for (x, w) in NODES {
                sum += w * (f(centre - half * x) + f(centre + half * x));
            }
        }
        sum * half
    }
}

mod second_difference {
    use super::*;

    /// Coefficient of sample a in z/dt: −1 over the first m, +1 over the second.
    fn sign(a: i64, m: u64) -> f64 {
        if a < m as i64 { -1.0 } else { 1.0 }
    }

    /// The double sum over a (generalised) autocovariance of the samples.
    fn brute_force(m1: u64, m2: u64, h: i64, covariance: impl Fn(u64) -> f64) -> f64 {
        let mut sum = 0.0;
        for a in 0..2 * m1 as i64 {
            for b in 0..2 * m2 as i64 {
                sum += sign(a, m1) * sign(b, m2) * covariance((b + h - a).unsigned_abs());
            }
        }
        sum * DT * DT
    }

    #[test]
    fn equals_the_double_sum_for_every_term() {
        let fast = Term::GaussMarkov { std_dev: 0.03, correlation_time: 0.05 };
        let very_fast = Term::GaussMarkov { std_dev: 0.03, correlation_time: 1e-3 };
        let generalised = |term: Term| {
            move |l: u64| match term {
                Term::RateRandomWalk { density } => -0.5 * density * density * DT * l as f64,
                Term::BiasInstability { coefficient } => {
                    -2.0 * coefficient * coefficient / std::f64::consts::PI
                        * (1..=l).map(|k| 1.0 / (2 * k - 1) as f64).sum::<f64>()
                }
                _ => term.autocovariance(l, DT).unwrap(),
            }
        };
        for term in [WHITE, AVERAGE, limited(), GAUSS_MARKOV, fast, very_fast, QUANTIZATION, FLICKER, LINE, RANDOM_WALK]
        {
            for (m1, m2) in [(1, 1), (1, 2), (2, 1), (3, 3), (5, 12), (12, 5), (1, 25), (20, 20)] {
                let scale = (term.second_difference_autocovariance(m1, 0, DT)
                    * term.second_difference_autocovariance(m2, 0, DT))
                .sqrt();
                for h in -60..=60 {
                    let found = term.second_difference_cross_covariance(m1, m2, h, DT);
                    let expected = brute_force(m1, m2, h, generalised(term));
                    // the double sum itself cancels: the slow Gauss–Markov process loses 9 digits in it
                    let tolerance = if term == GAUSS_MARKOV { 1e-6 } else { 1e-11 };
                    assert!(
                        (found - expected).abs() <= tolerance * scale,
                        "{term:?} m1 = {m1}, m2 = {m2}, h = {h}: {found:e}, expected {expected:e}"
                    );
                }
            }
        }
    }

    #[test]
    fn is_twice_the_allan_variance_at_lag_zero() {
        for term in [WHITE, AVERAGE, limited(), GAUSS_MARKOV, QUANTIZATION, FLICKER, LINE, RANDOM_WALK] {
            for m in [1, 2, 3, 17, 1000, 123_457, 10_000_000] {
                let expected = 2.0 * (m as f64 * DT).powi(2) * term.allan_variance(m, DT);
                let found = term.second_difference_autocovariance(m, 0, DT);
                assert_relative(found, expected, 1e-12, &format!("{term:?} at m = {m}"));
            }
        }
        assert_eq!(RAMP.second_difference_autocovariance(5, 0, DT), 0.0);
    }

    #[test]
    fn gauss_markov_nothing_cancels() {
        for (x, m1, m2, h, expected, scale) in vectors::GAUSS_MARKOV {
            let term = Term::GaussMarkov { std_dev: 1.0, correlation_time: 1.0 / x };
            let found = term.second_difference_cross_covariance(m1, m2, h, 1.0);
            assert!(
                (found - expected).abs() <= 1e-12 * scale,
                "x = {x}, m1 = {m1}, m2 = {m2}, h = {h}: {found:e}, expected {expected:e}, off by {:e} of the scale",
                (found - expected) / scale
            );
        }
    }

    #[test]
    fn flicker_nothing_cancels() {
        let term = Term::BiasInstability { coefficient: 1.0 };
        for (m1, m2, h, expected, scale) in vectors::FLICKER {
            let found = term.second_difference_cross_covariance(m1, m2, h, 1.0);
            assert!(
                (found - expected).abs() <= 1e-11 * scale,
                "m1 = {m1}, m2 = {m2}, h = {h}: {found:e}, expected {expected:e}, off by {:e} of the scale",
                (found - expected) / scale
            );
        }
    }

    #[test]
    fn is_symmetric_and_vanishes_far_away() {
        for term in [WHITE, AVERAGE, GAUSS_MARKOV, QUANTIZATION, FLICKER, LINE, RANDOM_WALK] {
            for (m1, m2, h) in [(3, 8, 5), (3, 8, -5), (1000, 7, 900), (12, 12, 3)] {
                let a = term.second_difference_cross_covariance(m1, m2, h, DT);
                let b = term.second_difference_cross_covariance(m2, m1, -h, DT);
                assert_eq!(a, b, "{term:?}");
            }
        }
        // windows that do not touch: white, quantisation and random walk have no covariance at all
        for term in [WHITE, QUANTIZATION, RANDOM_WALK] {
            for h in [21, 1000, 10_000_000, -2001, -10_000_000] {
                assert_eq!(term.second_difference_cross_covariance(10, 1000, h, DT), 0.0, "{term:?} at {h}");
            }
        }
    }
}

mod realisation {
    use super::*;

    /// E z²/(2 m² dt²) of the samples h x_k, by propagating the covariance: the Allan variance of the state-space
    /// model.
    fn allan_variance(term: Term, m: usize, horizon_s: f64) -> f64 {
        let r = term.realisation(DT, horizon_s).unwrap();
        let mut p = r.p0.clone();
        let mut sum = 0.0;
        for a in 0..2 * m {
            let mut cross = &p * r.h.transpose();
            for b in a..2 * m {
                let sign = if (a < m) == (b < m) { 1.0 } else { -1.0 };
                let twice = if a == b { 1.0 } else { 2.0 };
                sum += sign * twice * (&r.h * &cross)[(0, 0)];
                cross = &r.phi * cross;
            }
            p = &r.phi * p * r.phi.transpose() + &r.q;
        }
        sum / (2.0 * (m * m) as f64)
    }

    #[test]
    fn has_the_allan_variance_of_the_process() {
        let fast = Term::GaussMarkov { std_dev: 0.03, correlation_time: 0.05 };
        for term in [fast, QUANTIZATION, AVERAGE, limited(), LINE, RANDOM_WALK, RAMP, FLICKER] {
            // flicker is a chain of states: 1 % between dt and the horizon
            let tolerance = if term == FLICKER { 1e-2 } else { 1e-11 };
            for m in [1, 2, 3, 10, 30] {
                let expected = term.allan_variance(m as u64, DT);
                assert_relative(allan_variance(term, m, 30.0 * DT), expected, tolerance, &format!("{term:?} m = {m}"));
            }
            assert_eq!(term.realisation(DT, 1.0).unwrap().exact, term != FLICKER);
        }
        assert!(WHITE.realisation(DT, 1.0).is_none());
    }

    /// h Φ^k P0 hᵀ is the autocovariance, and P0 the fixed point of the covariance recursion.
    #[test]
    fn starts_in_its_stationary_law() {
        for term in [GAUSS_MARKOV, QUANTIZATION, AVERAGE, limited(), LINE, FLICKER] {
            let r = term.realisation(DT, 1000.0).unwrap();
            let next: DMatrix<f64> = &r.phi * &r.p0 * r.phi.transpose() + &r.q;
            assert!((&next - &r.p0).amax() <= 1e-15 * r.p0.amax(), "{term:?} is not stationary");
            let mut x = &r.p0 * r.h.transpose();
            for lag in 0..10 {
                if let Some(expected) = term.autocovariance(lag, DT) {
                    let scale = term.autocovariance(0, DT).unwrap();
                    assert!(((&r.h * &x)[(0, 0)] - expected).abs() < 1e-14 * scale, "{term:?} at lag {lag}");
                }
                x = &r.phi * x;
            }
        }
    }

    #[test]
    fn sizes_agree() {
        for term in all() {
            let Some(r) = term.realisation(DT, 7200.0) else { continue };
            let n = r.names.len();
            assert_eq!((r.phi.shape(), r.q.shape(), r.p0.shape(), r.h.len()), ((n, n), (n, n), (n, n), n), "{term:?}");
        }
        // two hours at 100 Hz: dt/3 to 4 h in steps of at most 10^(2/3)
        assert_eq!(FLICKER.realisation(DT, 7200.0).unwrap().names.len(), 11);
    }
}

mod sample_path {
    use super::*;
    use kfdesign::numerics::distribution::chi_square_quantile;

    fn path(term: Term, seed: u64, n: usize) -> Vec<f64> {
        let mut y = vec![0.0; n];
        term.sample_path(DT, rng(seed)).fill(&mut y);
        y
    }

    /// Overlapping Allan variance and the equivalent degrees of freedom of that estimate.
    fn estimate(term: Term, y: &[f64], m: usize) -> (f64, f64) {
        let mut theta = vec![0.0; y.len() + 1];
        for (k, y) in y.iter().enumerate() {
            theta[k + 1] = theta[k] + y * DT;
        }
        let count = y.len() + 1 - 2 * m;
        let sum: f64 = (0..count).map(|k| (theta[k + 2 * m] - 2.0 * theta[k + m] + theta[k]).powi(2)).sum();
        let r = |h: usize| term.second_difference_autocovariance(m as u64, h as u64, DT);
        let tail: f64 = (1..count).map(|h| (count - h) as f64 * r(h).powi(2)).sum();
        let edf = (count as f64 * r(0)).powi(2) / (count as f64 * r(0).powi(2) + 2.0 * tail);
        (sum / count as f64 / (2.0 * (m as f64 * DT).powi(2)), edf)
    }

    /// False alarm: 1e-6 for each of the 36 points (chi-square with at least 130 equivalent degrees of freedom).
    #[test]
    fn has_the_allan_curve() {
        let fast = Term::GaussMarkov { std_dev: 0.03, correlation_time: 0.05 };
        for (seed, term) in [WHITE, GAUSS_MARKOV, fast, QUANTIZATION, FLICKER, RANDOM_WALK, LINE, AVERAGE, limited()]
            .into_iter()
            .enumerate()
        {
            let y = path(term, seed as u64, 200_000);
            for m in [1, 4, 40, 400] {
                let (found, edf) = estimate(term, &y, m);
                let ratio = found / term.allan_variance(m as u64, DT);
                let lower = chi_square_quantile(5e-7, edf) / edf;
                let upper = chi_square_quantile(1.0 - 5e-7, edf) / edf;
                assert!(edf > 130.0);
                assert!(
                    (lower..upper).contains(&ratio),
                    "{term:?} at m = {m}: {ratio} times theory, outside {lower}..{upper} (edf {edf})"
                );
            }
        }
    }

    /// Flicker at one percent: 10⁶ samples, half widths of 0.7 and 0.9 %.
    /// False alarm 1e-6 for each of two points.
    #[test]
    fn flicker_to_one_percent() {
        let y = path(FLICKER, 77, 1_000_000);
        for m in [1, 2] {
            let (found, edf) = estimate(FLICKER, &y, m);
            let ratio = found / FLICKER.allan_variance(m as u64, DT);
            let half_width = 4.9 * (2.0 / edf).sqrt();
            assert!(half_width < 0.01, "the test is too weak: {half_width}");
            assert!((ratio - 1.0).abs() < half_width, "m = {m}: {ratio} times theory, allowed ±{half_width}");
        }
    }

    /// Means of y_0 y_k over 20 000 independent paths against σ²φ^k: standard error σ² √((1 + φ^{2k})/20000), 5 of
    /// them. False alarm 5.7e-7 for each of four lags; the first is the stationary start.
    #[test]
    fn gauss_markov_is_stationary_from_the_start() {
        let (sigma, tc) = (0.03, 0.2);
        let term = Term::GaussMarkov { std_dev: sigma, correlation_time: tc };
        let runs = 20_000;
        let lags = [0, 1, 10, 40];
        let mut sums = [0.0; 4];
        for run in 0..runs {
            let y = path(term, run, 41);
            for (sum, lag) in sums.iter_mut().zip(lags) {
                *sum += y[0] * y[lag];
            }
        }
        for (sum, lag) in sums.iter().zip(lags) {
            let phi = (-(lag as f64) * DT / tc).exp();
            let deviation = sum / runs as f64 / (sigma * sigma) - phi;
            let allowed = 5.0 * ((1.0 + phi * phi) / runs as f64).sqrt();
            assert!(deviation.abs() < allowed, "lag {lag}: off by {deviation}, allowed {allowed}");
        }
    }

    /// Var y_k = K² k dt over 10 000 paths; chi-square, false alarm 1e-6 for each of two points.
    #[test]
    fn random_walk_starts_at_zero_and_spreads() {
        let runs = 10_000;
        let mut squares = [0.0; 2];
        for run in 0..runs {
            let y = path(RANDOM_WALK, run, 31);
            assert_eq!(y[0], 0.0);
            squares[0] += y[1] * y[1];
            squares[1] += y[30] * y[30];
        }
        for (sum, k) in squares.iter().zip([1.0, 30.0]) {
            let ratio = sum / (2.85e-3f64.powi(2) * k * DT);
            let dof = runs as f64;
            assert!(
                (chi_square_quantile(5e-7, dof)..chi_square_quantile(1.0 - 5e-7, dof)).contains(&ratio),
                "at step {k}: {ratio} against {dof}"
            );
        }
    }

    #[test]
    fn ramp_is_a_ramp() {
        let y = path(RAMP, 1, 100_001);
        assert_eq!(y[0], 0.0);
        assert_relative(y[100_000], 2e-4 * 1000.0, 1e-14, "ramp after 1000 s");
        assert_relative(path(Term::RateRamp { slope: -1.0 }, 1, 2)[1], -DT, 1e-15, "falling ramp");
    }

    #[test]
    fn twice_n_is_two_n() {
        for term in all() {
            let whole = path(term, 3, 1000);
            let mut generator = term.sample_path(DT, rng(3));
            let mut parts = vec![0.0; 1000];
            for part in parts.chunks_mut(77) {
                generator.fill(part);
            }
            assert_eq!(whole, parts, "{term:?}");
        }
    }
}
