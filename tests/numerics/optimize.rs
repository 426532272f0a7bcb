//! Searches against closed forms.

use std::cell::Cell;
use std::convert::Infallible;
use std::f64::consts::{FRAC_1_SQRT_2, PI, SQRT_2};

use kfdesign::numerics::optimize::*;
use nalgebra::DMatrix;

/// √2, the fixed point of the cosine (OEIS A003957), a flat root of third order, and one of eᵡ twelve decades below its
/// end.
#[test]
fn roots_of_smooth_functions() {
    type Case = (fn(f64) -> f64, f64, f64, f64, usize);
    let cases: [Case; 5] = [
        (|x| x * x - 2.0, 0.0, 2.0, SQRT_2, 12),
        (|x| 2.0 - x * x, 0.0, 2.0, SQRT_2, 12),
        (|x| x.cos() - x, 0.0, 1.5, 0.739_085_133_215_160_6, 12),
        (|x| (x - 0.3).powi(3), -1.0, 1.0, 0.3, 200),
        (|x| (-x).exp() - 1e-12, 0.0, 100.0, 12.0 * 10f64.ln(), 30),
    ];
    for (case, (f, low, high, root, most)) in cases.into_iter().enumerate() {
        for (low, high) in [(low, high), (high, low)] {
            let calls = Cell::new(0);
            let counted = |x: f64| {
                calls.set(calls.get() + 1);
                f(x)
            };
            let found = bracketed_root(counted, low, high, 0.0).unwrap();
            assert!((found - root).abs() <= 4.0 * f64::EPSILON * root.max(1.0), "{case}: {found}, expected {root}");
            assert!(calls.get() <= most, "{case}: {} calls", calls.get());
        }
    }
}

/// A tolerance is kept and spares calls; a leap over zero is found as its place; a root at an end needs no bracket.
#[test]
fn roots_to_a_tolerance_at_a_leap_and_at_an_end() {
    let leap = |x: f64| if x < 1.0 / 3.0 { -1.0 } else { 2.0 };
    for tolerance in [1e-1, 1e-2, 1e-3, 1e-6] {
        assert!((bracketed_root(leap, 0.0, 1.0, tolerance).unwrap() - 1.0 / 3.0).abs() <= tolerance, "{tolerance}");
        let found = bracketed_root(|x| x.powi(5) - 0.5, 0.0, 2.0, tolerance).unwrap();
        assert!((found - 0.5f64.powf(0.2)).abs() <= tolerance, "{tolerance}: {found}");
    }
    assert!((bracketed_root(leap, 0.0, 1.0, 0.0).unwrap() - 1.0 / 3.0).abs() < 1e-15);
    assert_eq!(bracketed_root(|x| x, 0.0, 5.0, 0.0), Some(0.0));
    assert_eq!(bracketed_root(|x| -x, 0.0, 5.0, 0.0), Some(0.0));
    assert_eq!(bracketed_root(|x| x - 5.0, 0.0, 5.0, 0.0), Some(5.0));
}

#[test]
fn no_root_without_a_change_of_sign_or_with_a_failure() {
    assert_eq!(bracketed_root(|x| x * x + 1.0, -1.0, 1.0, 0.0), None);
    assert_eq!(bracketed_root(|_| f64::NAN, -1.0, 1.0, 0.0), None);
    assert_eq!(bracketed_root(|x| if x.abs() < 1.0 { f64::NAN } else { x }, -1.0, 1.0, 0.0), None);
    assert_eq!(bracketed_root(|x| (x.abs() > 0.5).then_some(x), -1.0, 2.0, 0.0), None);
}

/// Whole numbers, numbers to a width, from above, and an error that passes through.
#[test]
fn bisection() {
    let between = |low: u64, high: u64| (high - low > 1).then_some(low + (high - low) / 2);
    assert_eq!(bisect(0, 1 << 30, between, |n| Ok::<_, Infallible>(n * n >= 1000)), Ok((31, 32)));
    for (low, high) in [(0.0, 3.0), (3.0, 0.0)] {
        let Ok((no, yes)) = bisect(low, high, half_way(1e-3), |x| Ok::<_, Infallible>((x > SQRT_2) == (low < high)));
        assert!((no - yes).abs() <= 1e-3 && (no - yes).abs() > 4e-4, "{no} {yes}");
        assert!((no < SQRT_2) == (low < high) && (yes > SQRT_2) == (low < high), "{no} {yes}");
    }
    assert_eq!(bisect(0.0, 1.0, half_way(0.1), |_| Err("no")), Err("no"));
}

/// A parabola, a kink, and a valley at an end.
#[test]
fn lowest_places() {
    for width in [1e-2, 1e-6] {
        assert!((lowest(|x| (x - SQRT_2).powi(2), -3.0, 8.0, width) - SQRT_2).abs() <= 0.5 * width);
        assert!((lowest(|x| (x - PI).abs(), 0.0, 4.0, width) - PI).abs() <= 0.5 * width);
        assert!(lowest(|x| x, 1.0, 2.0, width) <= 1.0 + width);
    }
}

fn problem<'a>(look: &'a Looks<'a>) -> Problem<'a> {
    Problem { look, f_abs: 1e-14, evaluations: 500, worth: 1e-12, ..Problem::default() }
}

/// (1 − x)² + 100 (y − x²)², least at (1, 1). Source: Rosenbrock 1960, Comput. J. 3.
fn rosenbrock(x: &[f64], _: &[f64], sloped: bool) -> Look {
    let bend = x[1] - x[0] * x[0];
    let slopes = vec![-2.0 * (1.0 - x[0]) - 400.0 * x[0] * bend, 200.0 * bend];
    let values = vec![(1.0 - x[0]).powi(2) + 100.0 * bend * bend];
    Look { values, slopes: if sloped { vec![slopes] } else { vec![] } }
}

#[test]
fn the_valley_of_rosenbrock() {
    let looks = Cell::new(0);
    let counted = |x: &[f64], scale: &[f64], sloped: bool| {
        looks.set(looks.get() + 1);
        rosenbrock(x, scale, sloped)
    };
    let found = minimize(&problem(&counted), &[-1.2, 1.0], &[(-5.0, 5.0); 2]);
    assert!(found.x.iter().all(|x| (x - 1.0).abs() < 1e-5) && found.f < 1e-10, "{found:?}");
    assert_eq!((found.reason, found.evaluations), (Reason::Converged, looks.get()));
    // twice as many with slopes that are those of the place before
    assert!(found.evaluations < 90, "{}", found.evaluations);
    // beyond the bound the best is on it: x = 0.5, y = x²
    let unequal = |_: &[f64], _: f64| vec![0.25, 2.0];
    let found =
        minimize(&Problem { scale: &unequal, ..problem(&rosenbrock) }, &[-1.2, 1.0], &[(-5.0, 0.5), (-5.0, 5.0)]);
    assert!((found.x[0] - 0.5).abs() < 1e-9 && (found.x[1] - 0.25).abs() < 1e-6, "{found:?}");
}

/// ½ (x − m)ᵀ A (x − m) with diagonals that are ten decades apart; x₁ held at a bound b moves the other to
/// m₂ − A₂₁ (b − m₁)/A₂₂.
#[test]
fn a_parabola_of_very_different_widths() {
    let (m, a, b, c) = ([3.0, 2e5], 1.0, 5e-6, 1e-10);
    let parabola = |x: &[f64], _: &[f64], _: bool| {
        let d = [x[0] - m[0], x[1] - m[1]];
        let g = vec![a * d[0] + b * d[1], b * d[0] + c * d[1]];
        Look { values: vec![0.5 * (d[0] * g[0] + d[1] * g[1])], slopes: vec![g] }
    };
    let scale = |_: &[f64], _: f64| vec![a.sqrt().recip(), c.sqrt().recip()];
    let mut scaled = Problem { scale: &scale, ..problem(&parabola) };
    for (bound, expected) in [(10.0, m), (2.0, [2.0, m[1] + b / c])] {
        let found = minimize(&scaled, &[0.0, 0.0], &[(-10.0, bound), (-1e9, 1e9)]);
        for (x, (e, s)) in found.x.iter().zip(expected.iter().zip(scale(&[], 0.0))) {
            assert!((x - e).abs() < 1e-6 * s, "{found:?}, expected {expected:?}");
        }
    }
    // a start at the minimum is not left for a worse place, and one outside is moved in
    scaled.start = 0.0;
    assert_eq!(minimize(&scaled, &m, &[(-10.0, 10.0), (-1e9, 1e9)]).x, m);
    scaled.rounds = 0;
    assert_eq!(minimize(&scaled, &[11.0, 1.0], &[(-10.0, 10.0), (-1e9, 1e9)]).x, [10.0, 1.0]);
}

/// The lowest point of x + y in the disk of radius 1 is −(1, 1)/√2; both are looked at together.
#[test]
fn a_constraint_by_differences() {
    let disk = |points: &[Vec<f64>]| -> Vec<Vec<f64>> {
        points.iter().map(|x| vec![x[0] + x[1], x[0] * x[0] + x[1] * x[1] - 1.0]).collect()
    };
    let by_differences = |x: &[f64], _: &[f64], sloped: bool| look(disk, x, &[1e-3, 2e-3], sloped);
    let unequal = |_: &[f64], _: f64| vec![0.5, 2.0];
    let within = Problem { look: &by_differences, constraints: 1, scale: &unequal, rounds: 1, ..Problem::default() };
    let found = minimize(&within, &[2.0, 1.0], &[(-9.0, 9.0); 2]);
    assert!(found.x.iter().all(|x| (x + FRAC_1_SQRT_2).abs() < 1e-3), "{found:?}");
    assert!((found.f + SQRT_2).abs() < 1e-6, "{found:?}");
}

#[test]
fn reasons() {
    let bounds = [(-5.0, 5.0); 2];
    let few = Problem { evaluations: 3, rounds: 1, ..problem(&rosenbrock) };
    assert_eq!(minimize(&few, &[-1.2, 1.0], &bounds).reason, Reason::OutOfEvaluations);
    let nothing = |_: &[f64], _: &[f64], _: bool| Look { values: vec![f64::NAN], slopes: vec![vec![1.0; 2]] };
    let found = minimize(&Problem { start: 7.0, ..problem(&nothing) }, &[1.0, 2.0], &bounds);
    assert_eq!((found.reason, found.x, found.f), (Reason::Failed, vec![1.0, 2.0], 7.0));
}

/// Of parabolas central differences are exact: x² + 3 y at (2, −1) has the slopes 4 and 3, x y those of y and x.
#[test]
fn slopes_by_differences() {
    let f = |points: &[Vec<f64>]| points.iter().map(|p| vec![p[0] * p[0] + 3.0 * p[1], p[0] * p[1]]).collect();
    let found = look(f, &[2.0, -1.0], &[0.5, 0.25], true);
    assert_eq!((found.values, found.slopes), (vec![1.0, -2.0], vec![vec![4.0, 3.0], vec![-1.0, 2.0]]));
    assert_eq!(look(f, &[2.0, -1.0], &[0.5, 0.25], false).slopes, Vec::<Vec<f64>>::new());
}

/// Of x² y³ + 5 x z at (2, −1, 3): [[2y³, 6xy², 5], [6xy², 6x²y, 0], [5, 0, 0]].
#[test]
fn second_differences() {
    let f = |p: &[f64]| p[0] * p[0] * p[1].powi(3) + 5.0 * p[0] * p[2];
    let (at, steps) = ([2.0, -1.0, 3.0], [1e-3, 2e-3, 10.0]);
    let found = hessian(|points| points.iter().map(|p| f(p)).collect(), &at, f(&at), &steps);
    let expected = [[-2.0, 12.0, 5.0], [12.0, -24.0, 0.0], [5.0, 0.0, 0.0]];
    for (i, row) in expected.iter().enumerate() {
        for (k, expected) in row.iter().enumerate() {
            assert!((found[(i, k)] - expected).abs() < 1e-4, "{i} {k}: {}, expected {expected}", found[(i, k)]);
        }
    }
}

/// The inverse of [[a², r a b], [r a b, b²]] is [[1/a², −r/(a b)], [−r/(a b), 1/b²]]/(1 − r²), over twenty decades;
/// of what is no sum of squares there is none.
#[test]
fn covariances() {
    let (a, b, r) = (1e10, 1e-10, 0.6);
    let found = covariance(&DMatrix::from_row_slice(2, 2, &[a * a, r, r, b * b])).unwrap();
    let expected = [1.0 / (a * a), -r, -r, 1.0 / (b * b)].map(|v| v / (1.0 - r * r));
    for (found, expected) in found.iter().zip(expected) {
        assert!((found / expected - 1.0).abs() < 1e-14, "{found}, expected {expected}");
    }
    assert_eq!(covariance(&DMatrix::from_row_slice(2, 2, &[1.0, 2.0, 2.0, 1.0])), None);
}
