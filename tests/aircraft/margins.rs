//! Margins against closed forms, published examples and the sheet's own bisections.

use kfdesign::aircraft::control::margins::{LoopMargins, MarginError, margins};
use kfdesign::aircraft::control::response::StateSpace;
use nalgebra::{DMatrix, dmatrix};

/// Longitudinal model of the sheet (5.2), level flight at 25 m/s.
fn airframe() -> (DMatrix<f64>, DMatrix<f64>) {
    let a = dmatrix![
        -0.272928276, 0.501895626, -1.315368773, -9.792422006;
        -0.552322059, -4.306069826, 24.392032730, -0.528067613;
        0.205956222, -3.819226224, -5.065459544, 0.0;
        0.0, 0.0, 0.999999859, 0.0
    ];
    (a, dmatrix![0.132707191; -2.460905430; -34.548609975; 0.0])
}

/// L = −[kq kθ] G servo, the servo of 50 rad/s and damping 0.7.
fn pitch(kq: f64, ktheta: f64) -> StateSpace {
    let (airframe, input) = airframe();
    let mut a = DMatrix::zeros(6, 6);
    a.view_mut((0, 0), (4, 4)).copy_from(&airframe);
    a.view_mut((0, 4), (4, 1)).copy_from(&input);
    a[(4, 5)] = 1.0;
    (a[(5, 4)], a[(5, 5)]) = (-2500.0, -70.0);
    let b = dmatrix![0.0; 0.0; 0.0; 0.0; 0.0; 2500.0];
    let c = dmatrix![0.0, 0.0, -kq, -ktheta, 0.0, 0.0];
    StateSpace { a, b, c, d: DMatrix::zeros(1, 1), interval: None }
}

fn close(found: f64, expected: f64, tolerance: f64, what: &str) {
    assert!((found - expected).abs() <= tolerance, "{what}: found {found}, expected {expected}");
}

/// 5.6 of the sheet: own bisection there, python-control agrees to 1e-6.
#[test]
fn the_pitch_loop_of_the_sheet() {
    type Row<'a> = (f64, f64, f64, [f64; 2], &'a [[f64; 2]], f64, [f64; 2], f64);
    let rows: [Row<'_>; 5] = [
        (
            0.3,
            1.0,
            0.0,
            [6.9767501, 51.603620],
            &[[126.186073, 1.604258], [158.295512, 7.032686], [95.372490, 14.073023]],
            0.1182805,
            [1.2090251, 30.339],
            1.2983005,
        ),
        (
            0.3,
            1.0,
            0.02,
            [3.1307479, 32.547785],
            &[[124.347728, 1.604258], [150.236648, 7.032686], [79.245994, 14.073023]],
            0.0982805,
            [0.8698415, 24.405],
            1.6120575,
        ),
        (
            0.3,
            1.0,
            0.05,
            [1.8243743, 21.964470],
            &[[121.590211, 1.604258], [138.148351, 7.032686], [55.056249, 14.073023]],
            0.0682805,
            [0.5012126, 19.431],
            2.4495251,
        ),
        (
            0.2,
            0.6,
            0.0,
            [10.5660348, 51.826976],
            &[[-174.784502, 0.040752], [117.685894, 1.022400]],
            2.0090043,
            [1.4235846, 29.045],
            1.1874591,
        ),
        (
            0.2,
            0.6,
            0.02,
            [4.7368013, 32.720109],
            &[[-174.8, 0.040752], [116.514310, 1.022400]],
            1.9890043,
            [1.1467084, 23.013],
            1.3511116,
        ),
    ];
    for (kq, ktheta, delay, gain, crossovers, least, disk, peak) in rows {
        let what = format!("{kq} {ktheta} {delay}");
        let found = margins(&pitch(kq, ktheta), delay, 0.0).unwrap();
        let single = &found.single[0];
        let up = single.gain_up.unwrap();
        close(up.factor, gain[0], 1e-5 * gain[0], &what);
        close(up.frequency, gain[1], 1e-4, &what);
        let seen: Vec<_> = single.crossovers.iter().filter(|c| c.frequency > 0.01).collect();
        for [phase, frequency] in crossovers {
            let crossing = seen
                .iter()
                .find(|c| (c.frequency - frequency).abs() < 1e-5)
                .unwrap_or_else(|| panic!("{what}: {seen:?}"));
            // the slow one of moderate gains is given to a digit where a delay stands beside it
            let tolerance = if *frequency < 0.1 { 0.1 } else { 1e-5 };
            close(crossing.phase.to_degrees(), *phase, tolerance, &what);
        }
        close(single.delay().unwrap(), least, 1e-6, &what);
        close(single.disk.margin, disk[0], 1e-6, &what);
        close(single.disk.frequency, disk[1], 0.01, &what);
        close(single.sensitivity.value, peak, 1e-6, &what);
        close(found.multiloop.margin, disk[0], 1e-6, &what);
    }
}

/// A slow crossover's delay: the phase of −174.78 deg is 185.2 deg away in the other direction, 79.32 s.
#[test]
fn a_negative_phase_is_a_long_delay() {
    let found = margins(&pitch(0.2, 0.6), 0.0, 0.0).unwrap();
    let slow = found.single[0].crossovers.iter().find(|c| (c.frequency - 0.040752).abs() < 1e-6).unwrap();
    close(slow.delay(), 79.32, 0.01, "delay");
}

#[test]
fn gains_and_phase_of_a_disk() {
    let disk = margins(&pitch(0.3, 1.0), 0.0, 0.0).unwrap().single[0].disk;
    close(disk.gains()[0], 0.246484, 1e-6, "lower");
    close(disk.gains()[1], 4.057051, 1e-5, "upper");
    close(disk.phase().to_degrees(), 62.30698, 1e-4, "phase");
}

/// L = 25/(s³ + 10 s² + 10 s + 10): gain intervals published with MATLAB's documentation of disk margins.
#[test]
fn a_published_disk_margin() {
    let system = StateSpace {
        a: dmatrix![-10.0, -10.0, -10.0; 1.0, 0.0, 0.0; 0.0, 1.0, 0.0],
        b: dmatrix![1.0; 0.0; 0.0],
        c: dmatrix![0.0, 0.0, 25.0],
        d: DMatrix::zeros(1, 1),
        interval: None,
    };
    for (skew, margin, gains) in [
        (-1.0, 0.486367, [0.5136, 1.4864]),
        (0.0, 0.458093, [0.6273, 1.5942]),
        (1.0, 0.402146, [1.0 / 1.402146, 1.0 / (1.0 - 0.402146)]),
    ] {
        let disk = margins(&system, 0.0, skew).unwrap().single[0].disk;
        close(disk.margin, margin, 1e-6, "margin");
        close(disk.gains()[0], gains[0], 5e-5, "lower");
        close(disk.gains()[1], gains[1], 5e-5, "upper");
    }
    // Routh: s³ + 10 s² + 10 s + 10 + 25 k is stable below 100 = 10 + 25 k, at √10 rad/s
    let up = margins(&system, 0.0, 0.0).unwrap().single[0].gain_up.unwrap();
    close(up.factor, 3.6, 1e-9, "gain");
    close(up.frequency, 10f64.sqrt(), 1e-6, "frequency");
}

/// Two commands: P = [1 10; −10 1](sI − [0 10; −10 0])⁻¹ and a static controller; published bounds 0.3754 and 0.3762.
#[test]
fn a_published_multiloop_disk_margin() {
    let controller = dmatrix![1.0, -2.0; 0.0, 1.0];
    let system = StateSpace {
        a: dmatrix![0.0, 10.0; -10.0, 0.0],
        b: controller,
        c: dmatrix![1.0, 10.0; -10.0, 1.0],
        d: DMatrix::zeros(2, 2),
        interval: None,
    };
    let found = margins(&system, 0.0, 0.0).unwrap();
    close(found.multiloop.margin, 0.376152, 1e-5, "multiloop");
}

/// LQG without a margin (Doyle 1978): the regulator's gain f (1 1), the filter's d (1 1)ᵀ.
fn doyle(q: f64) -> LoopMargins {
    let f = 2.0 + (4.0 + q).sqrt();
    let d = f;
    // plant ẋ = [1 1; 0 1] x + [0; 1] u, controller from y = x1 to u
    let (a, b, c) = (dmatrix![1.0, 1.0; 0.0, 1.0], dmatrix![0.0; 1.0], dmatrix![1.0, 0.0]);
    let (gain, filter) = (dmatrix![f, f], dmatrix![d; d]);
    let mut all = DMatrix::zeros(4, 4);
    all.view_mut((0, 0), (2, 2)).copy_from(&a);
    all.view_mut((2, 0), (2, 2)).copy_from(&(&filter * &c));
    all.view_mut((2, 2), (2, 2)).copy_from(&(&a - &b * &gain - &filter * &c));
    let system = StateSpace {
        a: all,
        b: dmatrix![0.0; 1.0; 0.0; 0.0],
        c: dmatrix![0.0, 0.0, f, f],
        d: DMatrix::zeros(1, 1),
        interval: None,
    };
    margins(&system, 0.0, 0.0).unwrap()
}

#[test]
fn optimal_is_not_robust() {
    for (q, down, up, disk) in [
        (1.0, 0.920844, 1.055728, 0.054217),
        (60.0, 0.929746, 1.010000, 0.009951),
        (1000.0, 0.972956, 1.000881, 0.000882),
    ] {
        let found = &doyle(q).single[0];
        close(found.gain_up.unwrap().factor, up, 1e-6, "up");
        close(found.gain_down.unwrap().factor, down, 1e-6, "down");
        // the sheet's last, of a grid, would hold a gain that is not stable: (2 + α)/(2 − α) beyond the upper limit
        close(found.disk.margin, disk, 1.5e-6, "disk");
        close(found.disk.gains()[1], 1.0 + 1.0 / (2.0 + f64::sqrt(4.0 + q)).powi(2), 1e-9, "the disk ends there");
        assert_eq!(found.disk.frequency, 0.0, "the real eigenvalue passes zero");
        // closed form: a real eigenvalue passes zero at 1 + 1/(d f)
        let f = 2.0 + f64::sqrt(4.0 + q);
        close(found.gain_up.unwrap().factor, 1.0 + 1.0 / (f * f), 1e-9, "Doyle's bound");
        assert_eq!(found.gain_up.unwrap().frequency, 0.0);
    }
}

#[test]
fn an_unstable_loop_has_no_margin() {
    let mut system = pitch(0.3, 1.0);
    system.c *= 8.0;
    let error = margins(&system, 0.0, 0.0).unwrap_err();
    assert!(matches!(&error, MarginError::Unstable { poles } if poles.len() == 1 && poles[0].1 > 40.0), "{error}");
    let three = StateSpace::gain(DMatrix::zeros(3, 3), None);
    assert!(matches!(margins(&three, 0.0, 0.0), Err(MarginError::Commands { found: 3 })));
}

/// A discrete integrator with gain k is stable for 0 < k < 2, the upper end at half the rate; L = 1/(z − 1).
#[test]
fn a_discrete_loop_ends_at_half_its_rate() {
    let one = |x: f64| DMatrix::from_element(1, 1, x);
    let system = StateSpace { a: one(1.0), b: one(1.0), c: one(0.5), d: one(0.0), interval: Some(0.1) };
    let found = &margins(&system, 0.0, 0.0).unwrap().single[0];
    close(found.gain_up.unwrap().factor, 4.0, 1e-9, "gain");
    close(found.gain_up.unwrap().frequency, 10.0 * std::f64::consts::PI, 1e-9, "frequency");
    assert!(found.gain_down.is_none());
    // S − T = (z − 1 − 0.5)/(z − 0.5), largest at z = −1: 2.5/1.5
    close(found.disk.margin, 2.0 / (2.5 / 1.5), 1e-9, "disk");
}
