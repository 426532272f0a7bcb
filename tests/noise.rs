//! Every noise term against closed forms, quadrature, brute-force sums and its own sample paths.

#[allow(clippy::excessive_precision, reason = "17 digits, as the oracle printed them")]
mod vectors;

use kfdesign::noise::Term;
use kfdesign::numerics::random::{StreamId, stream};
use nalgebra::DMatrix;
use rand::rngs::ChaCha8Rng;

const DT: f64 = 0.01;
const WHITE: Term = Term::White { density: 0.0562 };
const GAUSS_MARKOV: Term = Term::GaussMarkov { std_dev: 0.03, correlation_time: 193.9312 };
const QUANTIZATION: Term = Term::Quantization { coefficient: 1e-3 };
const FLICKER: Term = Term::BiasInstability { coefficient: 0.013 };
const RANDOM_WALK: Term = Term::RateRandomWalk { density: 2.85e-3 };
const RAMP: Term = Term::RateRamp { slope: 2e-4 };
const ALL: [Term; 6] = [WHITE, GAUSS_MARKOV, QUANTIZATION, FLICKER, RANDOM_WALK, RAMP];

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
        for term in [WHITE, gauss_markov, QUANTIZATION, FLICKER, RANDOM_WALK] {
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
        for term in [WHITE, gauss_markov, QUANTIZATION] {
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
        for term in [WHITE, GAUSS_MARKOV, fast, very_fast, QUANTIZATION, FLICKER, RANDOM_WALK] {
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
        for term in [WHITE, GAUSS_MARKOV, QUANTIZATION, FLICKER, RANDOM_WALK] {
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
        for term in [WHITE, GAUSS_MARKOV, QUANTIZATION, FLICKER, RANDOM_WALK] {
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
