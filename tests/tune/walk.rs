//! The price of a walk against plain recursions of the two filters and of what the wrong one does, step by step,
//! without any matrix of the library.

use kfdesign::tune::{AidedFilter, SensorDrift, WalkTrial};
use kfdesign::units::Quantity;

type Square<const N: usize> = [[f64; N]; N];

fn product<const N: usize>(a: &Square<N>, b: &Square<N>) -> Square<N> {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..N).map(|k| a[i][k] * b[k][j]).sum()))
}

fn transposed<const N: usize>(a: &Square<N>) -> Square<N> {
    std::array::from_fn(|i| std::array::from_fn(|j| a[j][i]))
}

/// A P Aᵀ + Q.
fn moved<const N: usize>(a: &Square<N>, p: &Square<N>, q: &Square<N>) -> Square<N> {
    let mut p = product(&product(a, p), &transposed(a));
    for (row, more) in p.iter_mut().zip(q) {
        row.iter_mut().zip(more).for_each(|(p, q)| *p += q);
    }
    p
}

/// Kalman update with a measurement of the first state; the gain.
fn update<const N: usize>(p: &mut Square<N>, r: f64) -> [f64; N] {
    let s = p[0][0] + r;
    let k: [f64; N] = std::array::from_fn(|i| p[i][0] / s);
    let row = p[0];
    for (row_of, k) in p.iter_mut().zip(k) {
        row_of.iter_mut().zip(row).for_each(|(p, first)| *p -= k * first);
    }
    k
}

const SENSOR: [f64; 3] = [1e-3, 5e-4, 60.0];
const FILTER: AidedFilter =
    AidedFilter { step: 0.05, integrals: 1, aid_std_dev: 0.01, aid_rate_hz: 5.0, bias_std_dev: 0.01 };

fn trial() -> WalkTrial {
    let [white, sigma, tc] = SENSOR;
    let sensor = SensorDrift { quantity: Quantity::AngularRate, white, processes: vec![[sigma, tc]], walk: 0.0 };
    WalkTrial::new(&sensor, &FILTER).unwrap()
}

/// Ratio of the errors after every measurement of 3000 s, and E[e²/P] at the end.
fn ratios(k: f64) -> (Vec<f64>, f64) {
    let ([n, sigma, tc], dt, r) = (SENSOR, FILTER.step, FILTER.aid_std_dev.powi(2));
    let phi = (-dt / tc).exp();
    let drive = sigma * sigma * (1.0 - phi * phi);
    // the right filter: angle, constant, drift
    let mut right = [[100.0 * r, 0.0, 0.0], [0.0, 1e-4, 0.0], [0.0, 0.0, sigma * sigma]];
    let (f3, q3) =
        ([[1.0, dt, dt], [0.0, 1.0, 0.0], [0.0, 0.0, phi]], [[n * n * dt, 0.0, 0.0], [0.0; 3], [0.0, 0.0, drive]]);
    // the simple one: angle, walk
    let mut simple = [[100.0 * r, 0.0], [0.0, 1e-4 + sigma * sigma]];
    let (f2, q2) = ([[1.0, dt], [0.0, 1.0]], [[n * n * dt, 0.0], [0.0, k * k * dt]]);
    // truth (angle, constant, drift) with the estimates of the simple one (angle, walk), which starts at zero
    let table =
        |of: &dyn Fn(usize, usize) -> f64| -> Square<5> { std::array::from_fn(|i| std::array::from_fn(|j| of(i, j))) };
    let mut joint = table(&|i, j| if i == j && i < 3 { right[i][i] } else { 0.0 });
    let f5 = table(&|i, j| match (i < 3, j < 3) {
        (true, true) => f3[i][j],
        (false, false) => f2[i - 3][j - 3],
        _ => 0.0,
    });
    let q5 = table(&|i, j| if i < 3 && j < 3 { q3[i][j] } else { 0.0 });
    let mut found = Vec::new();
    let mut nees = f64::NAN;
    for step in 0..60_000 {
        if step > 0 {
            (right, simple, joint) = (moved(&f3, &right, &q3), moved(&f2, &simple, &q2), moved(&f5, &joint, &q5));
        }
        if step % 4 != 0 {
            continue;
        }
        update(&mut right, r);
        let gain = update(&mut simple, r);
        // the estimates take the gain times z less the estimated angle
        let a = table(&|i, j| {
            let seen = if i < 3 { 0.0 } else { gain[i - 3] * (f64::from(j == 0) - f64::from(j == 3)) };
            f64::from(i == j) + seen
        });
        let added = table(&|i, j| if i < 3 || j < 3 { 0.0 } else { gain[i - 3] * gain[j - 3] * r });
        joint = moved(&a, &joint, &added);
        // drift less its estimate: constant + drift − walk
        let c = [0.0, 1.0, 1.0, 0.0, -1.0];
        let real: f64 = (0..5).flat_map(|i| (0..5).map(move |j| (i, j))).map(|(i, j)| c[i] * joint[i][j] * c[j]).sum();
        let least = right[1][1] + 2.0 * right[1][2] + right[2][2];
        found.push((real / least).sqrt());
        nees = real / simple[1][1];
    }
    (found, nees)
}

/// The walk is right by both recursions, for a walk that is too small, about right and too large; after 3000 s the
/// constant is known to 1e-5 of the error that stays, which the settled price leaves out.
#[test]
fn the_price_of_a_walk_is_that_of_plain_recursions() {
    let trial = trial();
    for k in [5e-6, 8e-5, 1e-3] {
        let price = trial.price(k).unwrap();
        let (ratios, nees) = ratios(k);
        let start = ratios.iter().take(301).copied().fold(1.0, f64::max);
        assert!((price.first_minute / start - 1.0).abs() < 1e-6, "{k}: {price:?} {start}");
        let settled = *ratios.last().unwrap();
        assert!((price.settled / settled - 1.0).abs() < 2e-2, "{k}: {price:?} {settled}");
        assert!((price.nees / nees - 1.0).abs() < 2e-2, "{k}: {price:?} {nees}");
    }
}

/// No walk from a hundredth to a hundred times the found one costs less; a drift that is a walk is its own best
/// walk, at no price.
#[test]
fn the_least_price_is_the_least() {
    let trial = trial();
    let (k, price) = trial.least(1e4).unwrap();
    for i in -40..=40 {
        let other = trial.price(k * 10f64.powf(0.05 * f64::from(i))).unwrap();
        assert!(other.worst() > price.worst() - 1e-5, "{i}: {other:?} {price:?}");
    }
    let sensor = SensorDrift { quantity: Quantity::SpecificForce, white: 1e-3, processes: vec![], walk: 3e-5 };
    for integrals in [1, 2] {
        let walk = WalkTrial::new(&sensor, &AidedFilter { integrals, ..FILTER }).unwrap();
        let (k, price) = walk.least(1e4).unwrap();
        assert!(k == 3e-5 && (price.worst() - 1.0).abs() < 1e-6 && (price.nees - 1.0).abs() < 1e-6, "{k} {price:?}");
        assert!(walk.price(3e-4).unwrap().settled > 1.2 && walk.price(3e-6).unwrap().settled > 1.2);
    }
    let none = SensorDrift { walk: 0.0, ..sensor };
    assert!(WalkTrial::new(&none, &FILTER).is_none());
}
