//! The band limit: what other terms have no test for.

use super::*;
use kfdesign::noise::{FilterError, NoiseModel};

/// A term behind this filter, gain one at frequency zero.
fn behind(numerator: &[f64], denominator: &[f64]) -> Term {
    Term::BandLimit { density: 0.0562, filter: Filter::new(numerator, denominator).unwrap() }
}

/// A mean of three is the moving average of three, and one pole a fast Gauss-Markov process of the same density at
/// frequency zero.
#[test]
fn is_other_terms_in_special_cases() {
    let mean = behind(&[1.0, 1.0, 1.0], &[3.0]);
    let phi = 0.8f64;
    let one_pole = behind(&[1.0 - phi], &[1.0, -phi]);
    let variance = 0.0562f64.powi(2) / DT * (1.0 - phi) / (1.0 + phi);
    let drift = Term::GaussMarkov { std_dev: variance.sqrt(), correlation_time: -DT / phi.ln() };
    for (found, expected) in [(mean, AVERAGE), (one_pole, drift)] {
        for f in [0.0, 1.0, 13.0, 40.0] {
            let (a, b) = (found.psd(f, DT), expected.psd(f, DT));
            assert!((a - b).abs() < 1e-13 * expected.psd(0.0, DT), "{f} Hz: {a:e} {b:e}");
        }
        for lag in [0, 1, 2, 5, 100] {
            let (a, b) = (found.autocovariance(lag, DT).unwrap(), expected.autocovariance(lag, DT).unwrap());
            assert!((a - b).abs() < 1e-13 * variance.max(1e-3), "lag {lag}: {a:e} {b:e}");
        }
        for m in [1, 2, 10, 128, 129, 1000, 1_000_000_000] {
            let (a, b) = (found.allan_variance(m, DT), expected.allan_variance(m, DT));
            assert_relative(a, b, 1e-11, &format!("m = {m}"));
        }
    }
}

/// Short windows are added up, long ones in closed form: at 128 and 129 both against the double sum.
#[test]
fn both_ways_to_the_second_difference_agree() {
    for (numerator, denominator) in [
        (BUTTERWORTH[0].to_vec(), BUTTERWORTH[1].to_vec()),
        // scipy.signal.butter(3, 0.04)
        (
            vec![2.196_062_112_253_82e-4, 6.588_186_336_761_46e-4, 6.588_186_336_761_46e-4, 2.196_062_112_253_82e-4],
            vec![1.0, -2.748_835_809_214_676_6, 2.528_231_219_142_559, -0.777_638_560_238_080_8],
        ),
    ] {
        let term = behind(&numerator, &denominator);
        let r: Vec<f64> = (0..1200).map(|l| term.autocovariance(l, DT).unwrap()).collect();
        for (m1, m2, h) in [(128, 128, 0), (129, 129, 0), (129, 5, 70), (128, 5, 70), (7, 200, -33)] {
            let weights = |m: usize| (0..2 * m).map(move |i| if i < m { -1.0 } else { 1.0 });
            let mut sum = 0.0;
            for (i, u) in weights(m1).enumerate() {
                for (j, v) in weights(m2).enumerate() {
                    sum += u * v * r[(h + j as i64 - i as i64).unsigned_abs() as usize];
                }
            }
            let expected = sum * DT * DT;
            let found = term.second_difference_cross_covariance(m1 as u64, m2 as u64, h, DT);
            let scale = [m1, m2].map(|m| term.second_difference_autocovariance(m as u64, 0, DT).sqrt());
            let scale = scale[0] * scale[1];
            assert!((found - expected).abs() < 1e-9 * scale, "{m1} {m2} {h}: {found:e}, {expected:e}");
        }
    }
}

/// The states have variance one each, in units of the sample of white noise, however slow the filter is.
#[test]
fn states_are_orthonormal() {
    for term in [limited(), behind(&[1.0, 1.9, 0.95], &[1.0, -1.98, 0.9802])] {
        let r = term.realisation(DT, 1.0).unwrap();
        let n = r.names.len();
        assert_eq!(r.p0, DMatrix::identity(n, n) * (0.0562 * 0.0562 / DT));
        let variance = (&r.h * &r.p0 * r.h.transpose())[(0, 0)];
        assert_relative(variance, term.autocovariance(0, DT).unwrap(), 1e-13, "variance of a sample");
    }
}

/// The filter that is meant, whatever its scale; half power of the Butterworth filter where it was designed to be.
#[test]
fn filters_are_scaled_to_gain_one() {
    let filter = Filter::new(&BUTTERWORTH[0], &BUTTERWORTH[1]).unwrap();
    let scaled = Filter::new(&BUTTERWORTH[0].map(|b| -7.0 * b), &BUTTERWORTH[1].map(|a| 2.0 * a)).unwrap();
    for (a, b) in filter.numerator().iter().zip(scaled.numerator()) {
        assert_relative(*b, *a, 1e-14, "numerator");
    }
    assert_relative(filter.half_power().unwrap(), 0.1, 1e-9, "half power");
    assert_relative(limited().psd(10.0, DT), 0.5 * 0.0562 * 0.0562, 1e-9, "half of the power");
    assert_eq!(Filter::new(&[1.0], &[1.0]).unwrap().half_power(), None);
    let model = NoiseModel { terms: vec![WHITE, limited()] };
    assert_relative(model.wideband_density(), 0.0562 * 2f64.sqrt(), 1e-15, "root of the sum of squares");
}

#[test]
fn what_is_no_band_limit_is_refused() {
    let error = |b: &[f64], a: &[f64]| Filter::new(b, a).unwrap_err();
    assert_eq!(error(&[1.0; 10], &[1.0]), FilterError::Length { name: "numerator", found: 10 });
    assert_eq!(error(&[1.0], &[]), FilterError::Length { name: "denominator", found: 0 });
    assert_eq!(error(&[0.0, 1.0], &[1.0]), FilterError::Delay { name: "numerator" });
    assert_eq!(error(&[1.0, f64::NAN], &[1.0]), FilterError::NotFinite { name: "numerator" });
    assert_eq!(error(&[1.0], &[1.0, -1.2]), FilterError::Unstable);
    assert_eq!(error(&[1.0], &[1.0, 1.0]), FilterError::Unstable);
    // a high-pass, and a pole at 1
    assert!(matches!(error(&[1.0, -1.0], &[1.0]), FilterError::NoGain { name: "numerator", .. }));
    assert!(matches!(error(&[1.0], &[1.0, -1.0]), FilterError::NoGain { name: "denominator", .. }));
}
