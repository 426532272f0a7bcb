//! Dryden turbulence: closed forms, a second implementation's numbers, and simulated paths against exact covariances.

use kfdesign::aircraft::atmosphere::dryden::{Dryden, Intensity, STATES, Specification};
use kfdesign::aircraft::atmosphere::exceedance::std_dev;
use kfdesign::aircraft::atmosphere::turbulence::Turbulence;
use kfdesign::numerics::distribution::chi_square_quantile;
use kfdesign::numerics::random::{StreamId, stream};
use nalgebra::{SMatrix, SVector};
use rayon::prelude::*;

const SPAN: f64 = 2.8956;
/// 15 kt.
const LIGHT: f64 = 15.0 * 1852.0 / 3600.0;

fn low(specification: Specification, height: f64, airspeed: f64, wind: f64) -> Dryden {
    let intensity = Intensity { wind_at_20ft: Some(wind), std_dev_aloft: None };
    Dryden::new(specification, height, intensity, airspeed, SPAN).unwrap()
}

fn reference() -> Dryden {
    low(Specification::MilF8785C, 100.0, 25.0, LIGHT)
}

/// All to `relative` of the expected numbers.
fn close(found: &[f64], expected: &[f64], relative: f64) {
    assert_eq!(found.len(), expected.len());
    for (f, e) in found.iter().zip(expected) {
        assert!((f - e).abs() <= relative * e.abs(), "{found:?} against {expected:?}");
    }
}

fn std_devs(dryden: &Dryden) -> Vec<f64> {
    dryden.model().covariance().unwrap().diagonal().iter().map(|v| v.sqrt()).collect()
}

#[test]
fn lengths_and_intensities_are_those_of_the_documents() {
    let d = reference();
    close(&d.lengths, &[262.794_137_166, 262.794_137_166, 100.0], 1e-11);
    close(&d.std_devs, &[1.064_882_356, 1.064_882_356, 0.771_666_667], 1e-9);
    let handbook = low(Specification::MilHdbk1797, 100.0, 25.0, LIGHT);
    close(&handbook.lengths, &[262.794_137_166, 131.397_068_583, 50.0], 1e-11);
    let lower = low(Specification::MilF8785C, 50.0, 25.0, LIGHT);
    close(&lower.lengths, &[202.289_588_635, 202.289_588_635, 50.0], 1e-11);
    close(&lower.std_devs, &[1.229_601_119, 1.229_601_119, 0.771_666_667], 1e-9);
}

#[test]
fn standard_deviations_and_cross_covariances_are_the_sheets() {
    let d = reference();
    let covariance = d.model().covariance().unwrap();
    close(
        &std_devs(&d),
        &[1.064_882_356, 1.064_882_356, 0.771_666_667, 0.078_091_221, 0.048_050_757, 0.048_045_930],
        1e-8,
    );
    // the signs of air that turns like a rigid body: q = −∂w/∂x, r = +∂v/∂x
    close(&[covariance[(2, 4)], covariance[(1, 5)]], &[-0.008_512_344, 0.006_382_975], 1e-7);
    for (i, j) in [(0, 1), (0, 2), (1, 2), (0, 3), (2, 3), (2, 5), (1, 4), (4, 5)] {
        assert_eq!(covariance[(i, j)], 0.0);
    }
    close(
        &std_devs(&low(Specification::MilF8785C, 50.0, 25.0, LIGHT))[3..],
        &[0.098_388_774, 0.066_403_177, 0.063_101_808],
        1e-8,
    );
    let severe = low(Specification::MilF8785C, 100.0, 18.0, 3.0 * LIGHT);
    close(
        &std_devs(&severe),
        &[3.194_647_068, 3.194_647_068, 2.315, 0.234_273_664, 0.144_152_270, 0.144_137_789],
        1e-8,
    );
    // closed form of the roll gust: σp² = σw² 0.8 π² (πLw/4b)^(1/3)/(8 b Lw)
    let pi = std::f64::consts::PI;
    let roll = |sigma: f64, l: f64| sigma * (0.1 * pi * pi * (pi * l / (4.0 * SPAN)).cbrt() / (SPAN * l)).sqrt();
    close(&[std_devs(&d)[3]], &[roll(d.std_devs[2], 100.0)], 1e-12);
}

#[test]
fn spectra_are_the_sheets_and_those_of_the_filters() {
    let d = reference();
    let table = [
        (0.1, [3.60506166e+00, 3.69495146e+00, 8.33902617e-01, 5.72398901e-04, 1.33395408e-05, 5.91119920e-05]),
        (1.0, [6.80604842e-02, 1.01480303e-01, 1.28548744e-01, 5.60337227e-04, 2.01300135e-04, 1.60406205e-04]),
        (10.0, [6.86702171e-04, 1.02999112e-03, 1.42009907e-03, 1.80334246e-04, 7.15687779e-05, 7.41227618e-05]),
    ];
    for (omega, expected) in table {
        close(&d.spectra(omega), &expected, 1e-8);
        close(&of_filters(&d, omega), &expected, 1e-8);
    }
}

/// |C (jω − A)⁻¹ B|² / π: the one-sided spectrum of white noise of unit two-sided density behind the filters.
fn of_filters(d: &Dryden, omega: f64) -> Vec<f64> {
    let m = d.model();
    // (jω − A)⁻¹ by its real form of twice the size
    let n = STATES;
    let mut system = nalgebra::DMatrix::zeros(2 * n, 2 * n);
    for i in 0..n {
        for j in 0..n {
            system[(i, j)] = -m.a[(i, j)];
            system[(n + i, n + j)] = -m.a[(i, j)];
        }
        system[(i, n + i)] = -omega;
        system[(n + i, i)] = omega;
    }
    let mut drive = nalgebra::DMatrix::zeros(2 * n, 4);
    drive.view_mut((0, 0), (n, 4)).copy_from(&m.b);
    let x = system.lu().solve(&drive).unwrap();
    (0..6)
        .map(|k| {
            let part = |from: usize, noise: usize| (0..n).map(|i| m.c[(k, i)] * x[(from + i, noise)]).sum::<f64>();
            (0..4).map(|noise| part(0, noise).powi(2) + part(n, noise).powi(2)).sum::<f64>() / std::f64::consts::PI
        })
        .collect()
}

/// Lengths of one document in the filters of the other would be wrong by two: with their own, both have one spectrum.
#[test]
fn both_documents_have_the_same_spectra_by_their_own_lengths() {
    let handbook = low(Specification::MilHdbk1797, 100.0, 25.0, LIGHT);
    for omega in [0.03, 0.3, 3.0, 30.0] {
        close(&handbook.spectra(omega), &reference().spectra(omega), 1e-13);
        close(&of_filters(&handbook, omega), &of_filters(&reference(), omega), 1e-10);
    }
    close(&std_devs(&handbook), &std_devs(&reference()), 1e-12);
    // the spectra over all frequencies are the variances
    let d = reference();
    let (mut sum, steps) = ([0.0; 6], 40_000);
    // ω = e^s, trapezoid over s: spectral accuracy of a function that vanishes at both ends
    for i in 0..=steps {
        let omega = (-14.0 + 32.0 * f64::from(i) / f64::from(steps)).exp();
        for (sum, phi) in sum.iter_mut().zip(d.spectra(omega)) {
            *sum += phi * omega * 32.0 / f64::from(steps);
        }
    }
    let found: Vec<f64> = sum.iter().map(|v| v.sqrt()).collect();
    close(&found, &std_devs(&d), 1e-4);
}

#[test]
fn the_discrete_form_is_exact() {
    let step = reference().model().over(0.01).unwrap();
    let (f, q) = (step.f, step.q);
    // order u | w1 w2 q | v1 v2 r | p
    close(&[f[(0, 0)], q[(0, 0)]], &[0.999_049_137, 2.155_482_541e-3], 1e-9);
    close(
        &[f[(1, 1)], f[(1, 2)], f[(2, 1)], f[(2, 2)]],
        &[0.999_996_88, 0.009_975_031, -0.000_623_439, 0.995_009_365],
        1e-6,
    );
    close(&[q[(1, 1)], q[(1, 2)], q[(2, 2)]], &[3.320_858_299e-7, 4.975_062_396e-5, 9.950_145_547e-3], 1e-9);
    close(
        &[f[(4, 4)], f[(4, 5)], f[(5, 4)], f[(5, 5)]],
        &[0.999_999_548, 0.009_990_491, -0.000_090_414, 0.998_098_727],
        6e-6,
    );
    close(&[q[(4, 4)], q[(4, 5)], q[(5, 5)]], &[3.328_580_377e-7, 4.990_495_894e-5, 9.980_994_801e-3], 1e-9);
    close(&[f[(7, 7)], q[(7, 7)]], &[0.934_438_353, 7.734_089_204e-4], 1e-9);
    close(&[q[(1, 3)], q[(2, 3)], q[(3, 3)]], &[1.468_080_698e-6, 2.205_459_894e-4, 6.490_337_956e-6], 1e-9);
    close(&[q[(6, 6)]], &[8.236_398_664e-6], 1e-9);
}

/// Two steps are one of twice the length, and the stationary covariance stays: also for steps so short that entries of
/// Q differ by 1e-12.
#[test]
fn steps_compose_however_short_they_are() {
    let model = reference().model();
    let stationary = model.state_covariance().unwrap();
    for dt in [1e-4, 2.5e-3, 0.1, 5.0] {
        let (one, two) = (model.over(dt).unwrap(), model.over(2.0 * dt).unwrap());
        let q = one.q + one.f * one.q * one.f.transpose();
        let after = one.f * stationary * one.f.transpose() + one.q;
        for i in 0..STATES {
            for j in 0..STATES {
                let size = (two.q[(i, i)] * two.q[(j, j)]).sqrt();
                assert!((q[(i, j)] - two.q[(i, j)]).abs() <= 1e-11 * size, "{dt} {i} {j}");
                let size = (stationary[(i, i)] * stationary[(j, j)]).sqrt();
                assert!((after[(i, j)] - stationary[(i, j)]).abs() <= 1e-11 * size, "{dt} {i} {j}");
            }
        }
    }
}

#[test]
fn heights_without_turbulence_are_refused_and_between_it_is_linear() {
    let make = |height: f64, wind: Option<f64>, aloft: Option<f64>| {
        let intensity = Intensity { wind_at_20ft: wind, std_dev_aloft: aloft };
        Dryden::new(Specification::MilF8785C, height, intensity, 25.0, SPAN)
    };
    let message = make(3.0, Some(LIGHT), None).unwrap_err().to_string();
    assert!(message.contains("from 10 ft"), "{message}");
    let message = make(100.0, None, Some(1.0)).unwrap_err().to_string();
    assert!(message.contains("wind_at_20ft"), "{message}");
    let message = make(500.0, Some(LIGHT), None).unwrap_err().to_string();
    assert!(message.contains("std_dev"), "{message}");
    let ft = 0.3048;
    let at = |feet: f64| make(feet * ft, Some(LIGHT), Some(1.5)).unwrap();
    // at 1000 ft all lengths and intensities are equal: k = 1
    close(&at(1000.0).lengths, &[1000.0 * ft; 3], 1e-9);
    close(&at(2000.0).lengths, &[1750.0 * ft; 3], 1e-12);
    close(&at(1500.0).lengths, &[1375.0 * ft; 3], 1e-9);
    close(&at(1500.0).std_devs, &[0.5 * (0.1 * LIGHT + 1.5); 3], 1e-9);
    close(&make(5_000.0, None, Some(1.5)).unwrap().std_devs, &[1.5; 3], 1e-15);
}

/// Figures read off the chart of MIL-F-8785C as JSBSim holds them, and between its heights.
#[test]
fn intensity_aloft_is_that_of_the_chart() {
    let ft = 0.3048;
    let at = |probability: f64, feet: f64| std_dev(probability, feet * ft);
    for (probability, feet, expected) in [
        (1e-2, 3750.0, 7.4),
        (1e-3, 7500.0, 10.1),
        (1e-5, 35_000.0, 16.0),
        (0.2, 2000.0, 2.2 - 0.7 * 250.0 / 2000.0),
        // lengths and intensities of less than 2000 ft go over to this
        (1e-2, 1000.0, 6.9 + 0.5 * 250.0 / 2000.0),
        (1e-6, 65_000.0, 10.7),
        (1e-3, 60_000.0, 1.35),
    ] {
        close(&[at(probability, feet).unwrap()], &[expected * ft], 1e-12);
    }
    for (probability, feet, words) in [
        (0.5, 3000.0, "curves for 0.2, 0.1, 0.01, 0.001, 0.0001, 0.00001, 0.000001"),
        (1e-2, 45_000.0, "give a smaller exceedance"),
        (1e-6, 81_000.0, "ends at 80000 ft"),
    ] {
        let message = at(probability, feet).unwrap_err().to_string();
        assert!(message.contains(words), "{message}");
    }
}

fn path(seed: u64, run: u64, dt: f64) -> Turbulence {
    let streams = [0, 1, 2, 3].map(|axis| stream(seed, StreamId { run, axis, term: 0 }));
    Turbulence::new(&reference().model(), dt, streams).unwrap()
}

fn vector(t: &Turbulence) -> SVector<f64, 6> {
    let g = t.gust();
    SVector::from([g.velocity[0], g.velocity[1], g.velocity[2], g.rate[0], g.rate[1], g.rate[2]])
}

/// Covariances of 8000 independent paths at their first sample, at the 40th, and between both. 108 means of products,
/// each within 5 standard errors: a false alarm in 1 of 16,000 such tests.
#[test]
fn simulated_covariances_are_the_exact_ones() {
    const RUNS: u64 = 8000;
    let dt = 0.02;
    let pairs: Vec<_> = (0..RUNS)
        .into_par_iter()
        .map(|run| {
            let mut t = path(3, run, dt);
            let first = vector(&t);
            (0..40).for_each(|_| t.step());
            (first, vector(&t))
        })
        .collect();
    let model = reference().model();
    let (covariance, states) = (model.covariance().unwrap(), model.state_covariance().unwrap());
    let f = model.over(dt * 40.0).unwrap().f;
    let lagged: SMatrix<f64, 6, 6> = model.c * f * states * model.c.transpose();
    let check = |what: &str, expected: &SMatrix<f64, 6, 6>, product: &dyn Fn(usize, usize, usize) -> f64| {
        for i in 0..6 {
            for j in 0..6 {
                let mean = (0..RUNS as usize).map(|run| product(run, i, j)).sum::<f64>() / RUNS as f64;
                let e = expected[(i, j)];
                let spread = (covariance[(i, i)] * covariance[(j, j)] + e * e).sqrt();
                let z = (mean - e) / spread * (RUNS as f64).sqrt();
                assert!(z.abs() < 5.0, "{what} {i} {j}: {mean} against {e}, z {z}");
            }
        }
    };
    check("first", &covariance, &|run, i, j| pairs[run].0[i] * pairs[run].0[j]);
    check("last", &covariance, &|run, i, j| pairs[run].1[i] * pairs[run].1[j]);
    check("lag", &lagged, &|run, i, j| pairs[run].1[i] * pairs[run].0[j]);
}

/// Mean periodograms of 400 paths of 10 s against their exact expectation, which the exact autocovariance gives: 6
/// gusts at 4 frequencies, 1e-5 each, a false alarm in 1 of 4,000 such tests.
#[test]
fn simulated_spectra_are_the_exact_ones() {
    const RUNS: u64 = 400;
    let (dt, n) = (0.02, 500_usize);
    let lines = [2_usize, 8, 30, 120];
    let sums: Vec<[[f64; 4]; 6]> = (0..RUNS)
        .into_par_iter()
        .map(|run| {
            let mut t = path(4, run, dt);
            let mut parts = [[[0.0; 2]; 4]; 6];
            for k in 0..n {
                let y = vector(&t);
                for (line, &m) in lines.iter().enumerate() {
                    let (sin, cos) = (std::f64::consts::TAU * (m * k) as f64 / n as f64).sin_cos();
                    for i in 0..6 {
                        parts[i][line][0] += y[i] * cos;
                        parts[i][line][1] += y[i] * sin;
                    }
                }
                t.step();
            }
            parts.map(|lines| lines.map(|[re, im]| re * re + im * im))
        })
        .collect();
    let model = reference().model();
    let step = model.over(dt).unwrap().f;
    let mut lagged = model.state_covariance().unwrap();
    let mut expected = [[0.0; 4]; 6];
    for lag in 0..n {
        let c = model.c * lagged * model.c.transpose();
        for (line, &m) in lines.iter().enumerate() {
            let cos = (std::f64::consts::TAU * (m * lag) as f64 / n as f64).cos();
            for i in 0..6 {
                expected[i][line] += if lag == 0 { 1.0 } else { 2.0 } * (n - lag) as f64 * c[(i, i)] * cos;
            }
        }
        lagged = step * lagged;
    }
    let freedom = 2.0 * RUNS as f64;
    let bounds = [5e-6, 1.0 - 5e-6].map(|p| chi_square_quantile(p, freedom) / freedom);
    for i in 0..6 {
        for line in 0..4 {
            let ratio = sums.iter().map(|s| s[i][line]).sum::<f64>() / RUNS as f64 / expected[i][line];
            assert!(bounds[0] < ratio && ratio < bounds[1], "gust {i}, line {line}: {ratio} outside {bounds:?}");
        }
    }
}

/// Adding runs, or turbulence of another number, changes no number of a path.
#[test]
fn a_path_depends_on_its_address_alone() {
    let mut a = path(1, 5, 0.01);
    let mut b = path(1, 5, 0.01);
    let mut other = path(1, 6, 0.01);
    for _ in 0..100 {
        assert_eq!(a.gust(), b.gust());
        assert_ne!(a.gust(), other.gust());
        a.step();
        b.step();
        other.step();
    }
}
