//! Spectra of series that are made of means of samples, or of every k-th sample.

use super::*;
use kfdesign::noise::Grid;

/// Every k-th sample of a Gauss-Markov process is one, and of white noise is white noise of √k times the density; a
/// spectrum that falls by five orders of magnitude to rounding.
#[test]
fn every_kth_sample_in_closed_form() {
    for every in [2_usize, 7, 100] {
        let slow = every as f64 * DT;
        let frequencies: Vec<f64> = (0..40).map(|i| 0.5 / slow * 1e-4_f64.powf(f64::from(i) / 39.0)).collect();
        let grid = Grid::thinned(&frequencies, DT, every, false);
        for (f, found) in frequencies.iter().zip(GAUSS_MARKOV.psd_on(&grid)) {
            assert_relative(found, GAUSS_MARKOV.psd(*f, slow), 1e-12, &format!("{every}, {f} Hz"));
        }
        for found in WHITE.psd_on(&grid) {
            assert_relative(found, every as f64 * 0.0562 * 0.0562, 1e-14, "white");
        }
    }
}

/// The Allan variance of means of k samples at a factor m is that of the samples at k m, for every process: 4 ∫ S
/// sin⁴(πfmk dt)/(m² sin²(πfk dt)) df. Midpoints, 4000 of them in u = √(f/fmax), so that the drift's corner at 8e-4
/// Hz has thirty: 1e-4.
#[test]
fn means_have_the_allan_variance_of_what_they_average() {
    let points = 4000;
    for term in all().into_iter().filter(|term| !matches!(term, Term::RateRamp { .. })) {
        for (every, m) in [(4_usize, 1_u64), (4, 3), (25, 2)] {
            let slow = every as f64 * DT;
            let place = |i: i32| (f64::from(i) + 0.5) / f64::from(points);
            let frequencies: Vec<f64> = (0..points).map(|i| 0.5 / slow * place(i).powi(2)).collect();
            let psd = term.psd_on(&Grid::thinned(&frequencies, DT, every, true));
            let of = |(f, psd): (&f64, &f64)| {
                // df = 2 fmax u du
                let (x, width) = (std::f64::consts::PI * f * slow, (2.0 * f / slow).sqrt() / f64::from(points));
                4.0 * width * psd * (x * m as f64).sin().powi(4) / (m as f64 * x.sin()).powi(2)
            };
            let found: f64 = frequencies.iter().zip(&psd).map(of).sum();
            assert_relative(found, term.allan_variance(every as u64 * m, DT), 1e-4, &format!("{term:?}, {every}, {m}"));
        }
    }
}
