//! Discretisation, observability, augmentation.

use kfdesign::model::discretize::{angle_and_drift, van_loan};
use kfdesign::model::observability::{observability, undriven_states};
use kfdesign::model::{InitialBias, LinearModel, ModelError, Named, sensor_errors};
use kfdesign::noise::{NoiseModel, Term};
use kfdesign::numerics::linalg::{cholesky_semidefinite, relative_to_diagonal};
use kfdesign::units::Quantity;
use nalgebra::{DMatrix, DVector};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

const N: f64 = 0.0562;
const SIGMA: f64 = 0.03;
const TC: f64 = 193.9312;

/// A model from rows, dt = 0.01 s, one measurement, states "a", "b", "c" …
fn model(f: &[&[f64]], h: &[f64], q: &[f64]) -> LinearModel {
    let n = h.len();
    let named = |name: String| Named { name, unit: "rad/s".into() };
    LinearModel {
        dt: 0.01,
        states: ["a", "b", "c", "d"].iter().take(n).map(|s| named((*s).to_string())).collect(),
        inputs: vec![],
        measurements: vec![named("rate".into())],
        every: vec![1],
        outputs: vec![],
        f: DMatrix::from_fn(n, n, |i, j| f[i][j]),
        g: DMatrix::zeros(n, 0),
        h: DMatrix::from_row_slice(1, n, h),
        q: DMatrix::from_diagonal(&DVector::from_row_slice(q)),
        r: DMatrix::from_element(1, 1, 1.0),
        x0: DVector::zeros(n),
        p0: DMatrix::identity(n, n),
    }
}

/// F12, F22, Q11 − N² dt, Q12, Q22 of the angle-and-drift model with N, SIGMA, TC.
/// mpmath 1.3, 50 digits: expm of Van Loan's block matrix with these doubles.
const ANGLE_AND_DRIFT: [(f64, [f64; 5]); 5] = [
    (
        1e-6,
        [
            -9.999999974217661e-07,
            0.9999999948435322,
            3.0938807044951475e-24,
            -4.640821050760161e-18,
            9.281642101520321e-12,
        ],
    ),
    (
        0.01,
        [
            -0.009999742181038431,
            0.9999484366508276,
            3.093761068115851e-12,
            -4.6405817794411275e-10,
            9.281163560938741e-08,
        ],
    ),
    (
        1.0,
        [
            -0.9974261918895464,
            0.9948568038980342,
            3.081944333449673e-06,
            -4.6169626519123995e-06,
            9.233945764009459e-06,
        ],
    ),
    (100.0, [-78.13211414786446, 0.5971142645027492, 2.1393930854883747, -0.028330482846975775, 0.0005791090996146068]),
    (300.0, [-152.6435634190031, 0.2128983710769433, 30.46856732505183, -0.10813139767054551, 0.0008592068552335057]),
];

#[test]
fn angle_and_drift_equals_fifty_digit_arithmetic() {
    for (dt, expected) in ANGLE_AND_DRIFT {
        // The drift's part alone shows the cancellation that the white part would hide.
        let (f, q) = angle_and_drift(0.0, SIGMA, TC, dt);
        let found = [f[(0, 1)], f[(1, 1)], q[(0, 0)], q[(0, 1)], q[(1, 1)]];
        for (found, expected) in found.iter().zip(expected) {
            assert!((found / expected - 1.0).abs() < 2e-15, "dt = {dt}: {found:e}, expected {expected:e}");
        }
        assert_eq!((f[(0, 0)], f[(1, 0)], q[(1, 0)]), (1.0, 0.0, q[(0, 1)]));
        let (_, with_white) = angle_and_drift(N, SIGMA, TC, dt);
        let q11 = N * N * dt + expected[2];
        assert!((with_white[(0, 0)] / q11 - 1.0).abs() < 1e-15);
    }
}

#[test]
fn angle_and_drift_on_both_sides_of_the_series_limit() {
    // d/dx of the bracket is (1 − e^−x)²: the change across the limit equals that slope.
    let bracket = |x: f64| angle_and_drift(0.0, 1.0, 1.0, x).1[(0, 0)] / 2.0;
    let step = 1e-4;
    let slope = (bracket(1.5 + step) - bracket(1.5 - step)) / (2.0 * step);
    assert!((slope - (-(-1.5_f64).exp_m1()).powi(2)).abs() < 1e-8, "{slope}");
}

#[test]
fn van_loan_equals_the_closed_form() {
    for (dt, _) in ANGLE_AND_DRIFT {
        let a = DMatrix::from_row_slice(2, 2, &[0.0, -1.0, 0.0, -1.0 / TC]);
        let qc = DMatrix::from_row_slice(2, 2, &[N * N, 0.0, 0.0, 2.0 * SIGMA * SIGMA / TC]);
        let (f, q) = van_loan(&a, &qc, dt).unwrap();
        let (f_closed, q_closed) = angle_and_drift(N, SIGMA, TC, dt);
        // Doubling from a step of less than a second loses as many units of rounding as there are such steps.
        let tolerance = 1e-15 * dt.max(4.0);
        for i in 0..2 {
            for j in 0..2 {
                let (found, expected) = (q[(i, j)], q_closed[(i, j)]);
                assert!((found / expected - 1.0).abs() < tolerance, "Q{i}{j}, dt = {dt}: {found:e} {expected:e}");
                let (found, expected) = (f[(i, j)], f_closed[(i, j)]);
                assert!(
                    (found - expected).abs() <= tolerance * expected.abs(),
                    "F{i}{j}, dt = {dt}: {found} {expected}"
                );
            }
        }
    }
}

#[test]
fn van_loan_over_a_thousand_time_constants_is_the_stationary_covariance() {
    // Damped oscillator ẍ = −x − 0.2 ẋ + w: stationary variances 1/(2·0.2) for x and ẋ, no covariance.
    let a = DMatrix::from_row_slice(2, 2, &[0.0, 1.0, -1.0, -0.2]);
    let qc = DMatrix::from_row_slice(2, 2, &[0.0, 0.0, 0.0, 1.0]);
    let (f, q) = van_loan(&a, &qc, 10_000.0).unwrap();
    assert!(f.amax() < 1e-300);
    assert!((q - DMatrix::<f64>::identity(2, 2) * 2.5).amax() < 1e-12);
    assert!(van_loan(&a, &DMatrix::zeros(3, 3), 1.0).is_err());
    assert!(van_loan(&DMatrix::from_element(1, 1, f64::NAN), &DMatrix::zeros(1, 1), 1.0).is_err());
}

/// A continuous system of 1 to 20 states with eigenvalues within some ±2 (entries in ±2/√n), and L with Qc = L Lᵀ.
fn continuous_system() -> impl Strategy<Value = (DMatrix<f64>, DMatrix<f64>)> {
    (1_usize..=20).prop_flat_map(|n| {
        let entries = || prop::collection::vec(-2.0..2.0_f64, n * n);
        let scale = 1.0 / (n as f64).sqrt();
        let matrix = move |values| DMatrix::from_vec(n, n, values) * scale;
        (entries(), entries()).prop_map(move |(a, l)| (matrix(a), matrix(l)))
    })
}

proptest! {
    #![proptest_config(ProptestConfig { rng_seed: RngSeed::Fixed(1), ..ProptestConfig::default() })]
    /// d/ds of exp(A s) Qc exp(Aᵀ s), integrated over the step: A Qd + Qd Aᵀ + Qc = F Qc Fᵀ.
    #[test]
    fn van_loan_satisfies_its_lyapunov_identity((a, l) in continuous_system(), dt in 1e-3..3.0_f64) {
        let qc = &l * l.transpose();
        let (f, qd) = van_loan(&a, &qc, dt).unwrap();
        let left = &a * &qd + &qd * a.transpose() + &qc;
        let right = &f * &qc * f.transpose();
        let size = left.amax().max(right.amax()).max((&a * &qd).amax()).max(qc.amax());
        prop_assert!((left - right).amax() <= 1e-12 * size);
        prop_assert!(cholesky_semidefinite(&qd).is_ok());
    }

    /// One step of 2 dt equals two steps of dt.
    #[test]
    fn van_loan_composes((a, l) in continuous_system(), dt in 1e-3..1.5_f64) {
        let qc = &l * l.transpose();
        let (f, q) = van_loan(&a, &qc, dt).unwrap();
        let (f2, q2) = van_loan(&a, &qc, 2.0 * dt).unwrap();
        prop_assert!((&f * &f - &f2).amax() <= 1e-12 * f2.amax().max(f.amax().powi(2)));
        let twice = &f * &q * f.transpose() + &q;
        prop_assert!(relative_to_diagonal(&(twice - &q2), q2.diagonal().as_slice()) <= 1e-10);
    }
}

const SLOW: f64 = 0.999948436651; // exp(−0.01/193.9312)

#[test]
fn constant_and_drift_are_observable_through_the_decay() {
    let found = observability(&model(&[&[1.0, 0.0], &[0.0, SLOW]], &[1.0, 1.0], &[0.0, 1e-7])).unwrap();
    assert_eq!(found.rank, 2);
    assert_eq!(found.undriven, ["a"]);
    assert!(found.unobservable.is_empty());
    assert!(found.condition < 20.0, "over several correlation times the two are well apart: {}", found.condition);
    assert!((found.span_s - 4.0 * TC).abs() < 0.1);
    let text = found.sentences.join("\n");
    assert!(text.contains("a and b (correlation time 193.9 s"), "{text}");
    assert!(text.contains("after about 1551 s (8 correlation times)"), "{text}");
}

#[test]
fn constant_and_random_walk_are_seen_only_as_their_sum() {
    let found = observability(&model(&[&[1.0, 0.0], &[0.0, 1.0]], &[1.0, 1.0], &[0.0, 1e-7])).unwrap();
    assert_eq!(found.rank, 1);
    assert_eq!(found.undriven, ["a"]);
    assert_eq!(found.unobservable.len(), 1);
    let direction = &found.unobservable[0];
    assert!((direction[0].1 * direction[1].1 + 1.0).abs() < 1e-12, "(1, −1): {direction:?}");
    let text = found.sentences.join("\n");
    assert!(text.contains("a and b cannot be told apart"), "{text}");
    assert!(!text.contains("falls towards zero"), "{text}");
}

#[test]
fn a_state_that_reaches_no_measurement_is_named_alone() {
    let found = observability(&model(
        &[&[0.9, 0.0, 0.0], &[0.0, 1.0, 0.0], &[0.0, 0.0, 0.5]],
        &[1.0, 0.0, 1.0],
        &[1.0, 0.0, 1.0],
    ))
    .unwrap();
    assert_eq!(found.rank, 2);
    assert_eq!(found.unobservable, [vec![("b".to_string(), 1.0)]]);
    assert!(found.sentences.iter().any(|s| s.starts_with("b reaches no measurement")), "{:?}", found.sentences);
}

#[test]
fn drifts_of_very_different_speed_are_both_seen() {
    // Tc of 0.05 s, 0.1 s and 3 h in one sensor: rows of one spacing would confuse some pair of them.
    let pole = |tc: f64| (-0.01 / tc).exp();
    let f = [[pole(0.05), 0.0, 0.0], [0.0, pole(0.1), 0.0], [0.0, 0.0, pole(10_800.0)]];
    let found = observability(&model(&[&f[0], &f[1], &f[2]], &[1.0, 1.0, 1.0], &[1e-4, 1e-4, 1e-9])).unwrap();
    assert_eq!((found.rank, found.undriven.len()), (3, 0));
    // Two drifts with the same correlation time are one.
    let f = [[SLOW, 0.0, 0.0], [0.0, SLOW, 0.0], [0.0, 0.0, 0.5]];
    assert_eq!(observability(&model(&[&f[0], &f[1], &f[2]], &[1.0, 1.0, 1.0], &[1.0; 3])).unwrap().rank, 2);
}

#[test]
fn undriven_states_are_those_that_nothing_feeds_and_nothing_damps() {
    // a: ramp value fed by the slope b; c: driven walk; d: undriven but decaying.
    let f: [&[f64]; 4] = [&[1.0, 0.01, 0.0, 0.0], &[0.0, 1.0, 0.0, 0.0], &[0.0, 0.0, 1.0, 0.0], &[0.0, 0.0, 0.0, 0.9]];
    assert_eq!(undriven_states(&model(&f, &[1.0; 4], &[0.0, 0.0, 1.0, 0.0])), [0, 1]);
    // An angle fed by a driven drift is driven.
    let f: [&[f64]; 2] = [&[1.0, -0.01], &[0.0, SLOW]];
    assert!(undriven_states(&model(&f, &[1.0, 0.0], &[0.0, 1e-7])).is_empty());
}

#[test]
fn check_names_the_part_that_does_not_fit() {
    let good = model(&[&[1.0, 0.0], &[0.0, 0.9]], &[1.0, 1.0], &[0.0, 1.0]);
    assert_eq!(good.check(), Ok(()));
    type Change = fn(&mut LinearModel);
    let cases: [(&str, &str, Change); 12] = [
        ("F", "found 2 x 3; expected 2 x 2 (2 states by 2 states)", |m| m.f = DMatrix::zeros(2, 3)),
        ("H", "found 1 x 3; expected 1 x 2 (1 measurement by 2 states)", |m| m.h = DMatrix::zeros(1, 3)),
        ("G", "found 2 x 1; expected 2 x 0", |m| m.g = DMatrix::zeros(2, 1)),
        ("x0", "found 1 numbers; expected 2", |m| m.x0 = DVector::zeros(1)),
        ("F[1][0]", "NaN is not a finite number", |m| m.f[(1, 0)] = f64::NAN),
        ("P0", "is not symmetric: [1][0] is 0e0 but [0][1] is 5e-1", |m| m.p0[(0, 1)] = 0.5),
        ("Q[1][1]", "found -1e0; a variance cannot be negative", |m| m.q[(1, 1)] = -1.0),
        ("P0", "is not positive semidefinite", |m| {
            (m.p0[(0, 1)], m.p0[(1, 0)]) = (2.0, 2.0);
        }),
        ("R", "is not positive definite", |m| m.r[(0, 0)] = 0.0),
        ("states[1].name", "'a' appears twice", |m| m.states[1].name = "a".into()),
        ("measurements[0].every", "found 0", |m| m.every[0] = 0),
        ("measurements", "there is none", |m| m.measurements.clear()),
    ];
    for (part, message, change) in cases {
        let mut bad = good.clone();
        change(&mut bad);
        let Err(ModelError::Part { part: found, message: text }) = bad.check() else { panic!("{part}: {message}") };
        assert_eq!(found, part, "{text}");
        assert!(text.contains(message), "{part}: {text}");
    }
}

fn bias(mean: f64, std_dev: f64) -> Option<InitialBias> {
    Some(InitialBias { mean, std_dev })
}

#[test]
fn augmentation_names_every_state_and_keeps_blocks_apart() {
    let noise = NoiseModel {
        terms: vec![
            Term::RateRandomWalk { density: 1e-5 },
            Term::GaussMarkov { std_dev: 2e-4, correlation_time: 50.0 },
            Term::White { density: 3e-3 },
            Term::GaussMarkov { std_dev: 5e-4, correlation_time: 200.0 },
            Term::White { density: 4e-3 },
            Term::RateRamp { slope: 1e-7 },
            Term::Quantization { coefficient: 1e-6 },
        ],
    };
    let model = sensor_errors(Quantity::AngularRate, &noise, bias(0.01, 0.2), 0.1, 1e4).unwrap();
    let states: Vec<(&str, &str)> = model.states.iter().map(|s| (s.name.as_str(), s.unit.as_str())).collect();
    assert_eq!(
        states,
        [
            ("bias", "rad/s"),
            ("quantization", "rad"),
            ("quantization.previous", "rad"),
            ("gauss_markov", "rad/s"),
            ("gauss_markov.2", "rad/s"),
            ("rate_random_walk", "rad/s"),
            ("rate_ramp", "rad/s"),
            ("rate_ramp.slope", "rad/s^2"),
        ]
    );
    assert_eq!(model.measurements, [Named { name: "angular_rate".into(), unit: "rad/s".into() }]);
    assert!((model.r[(0, 0)] - 25e-6 / 0.1).abs() < 1e-18, "(3² + 4²) 10⁻⁶/dt");
    assert_eq!((model.x0[0], model.p0[(0, 0)]), (0.01, 0.2 * 0.2));
    assert_eq!(model.x0.rows(1, 7).amax(), 0.0);
    assert_eq!(model.h.row(0).iter().copied().collect::<Vec<_>>(), [1.0, 10.0, -10.0, 1.0, 1.0, 1.0, 1.0, 0.0]);
    // Diagonal of F: exp(−dt/Tc); the ramp's slope feeds its value and nothing else is coupled.
    assert!((model.f[(3, 3)] - (-0.1_f64 / 50.0).exp()).abs() < 1e-16);
    assert!((model.q[(4, 4)] / (25e-8 * -(-0.2_f64 / 200.0).exp_m1()) - 1.0).abs() < 1e-14);
    let coupled: Vec<(usize, usize)> =
        (0..64).map(|k| (k / 8, k % 8)).filter(|&(i, j)| i != j && model.f[(i, j)] != 0.0).collect();
    assert_eq!(coupled, [(2, 1), (6, 7)]);
    assert_eq!(model.q[(0, 0)], 0.0);
    assert!(model.check().is_ok());

    let force = sensor_errors(Quantity::SpecificForce, &noise, None, 0.1, 1e4).unwrap();
    assert_eq!((force.states[0].unit.as_str(), force.states[6].unit.as_str()), ("m/s", "m/s^3"));
    assert_eq!(force.states.len(), 7);
}

#[test]
fn augmented_model_has_the_autocovariance_of_its_terms() {
    let terms = vec![
        Term::White { density: 2e-3 },
        Term::GaussMarkov { std_dev: 1e-3, correlation_time: 3.0 },
        Term::GaussMarkov { std_dev: 2e-3, correlation_time: 0.4 },
        Term::Quantization { coefficient: 1e-5 },
    ];
    let dt = 0.05;
    let noise = NoiseModel { terms: terms.clone() };
    let model = sensor_errors(Quantity::AngularRate, &noise, None, dt, 1e3).unwrap();
    // P0 of a stationary process is stationary: P = F P Fᵀ + Q.
    let next = &model.f * &model.p0 * model.f.transpose() + &model.q;
    assert!(relative_to_diagonal(&(&next - &model.p0), model.p0.diagonal().as_slice()) < 1e-14);
    let mut cross = &model.p0 * model.h.transpose();
    for lag in 0..100 {
        let mut found = (&model.h * &cross)[0];
        if lag == 0 {
            found += model.r[0];
        }
        let expected: f64 = terms.iter().filter_map(|term| term.autocovariance(lag, dt)).sum();
        let size = terms.iter().filter_map(|term| term.autocovariance(0, dt)).sum::<f64>();
        assert!((found - expected).abs() < 1e-14 * size, "lag {lag}: {found:e} {expected:e}");
        cross = &model.f * cross;
    }
}

#[test]
fn augmentation_refuses_what_no_filter_can_use() {
    let drift = NoiseModel { terms: vec![Term::GaussMarkov { std_dev: 1e-3, correlation_time: 3.0 }] };
    let built = |noise: &NoiseModel, dt, std_dev| {
        sensor_errors(Quantity::AngularRate, noise, bias(0.0, std_dev), dt, 1e3).map_err(|e| e.to_string())
    };
    assert_eq!(
        built(&drift, 0.1, 1.0).unwrap_err(),
        "there is no white noise: a filter needs a measurement noise density greater than zero"
    );
    let white = NoiseModel { terms: vec![Term::White { density: 1e-3 }] };
    assert_eq!(built(&white, 0.0, 1.0).unwrap_err(), "dt is 0; expected a number greater than zero");
    assert!(built(&white, f64::NAN, 1.0).is_err());
    assert!(built(&white, 0.1, -1.0).is_err());
    assert_eq!(built(&white, 0.1, 1.0).unwrap().states.len(), 1);
}

#[test]
fn a_chain_of_drifts_for_flicker_is_observable_to_its_last_state() {
    let noise = NoiseModel { terms: vec![Term::White { density: 1e-3 }, Term::BiasInstability { coefficient: 1e-4 }] };
    let model = sensor_errors(Quantity::AngularRate, &noise, bias(0.0, 1e-2), 0.01, 1e5).unwrap();
    let found = observability(&model).unwrap();
    assert!(model.states.len() > 8, "{}", model.states.len());
    assert_eq!((found.rank, found.unobservable.len()), (model.states.len(), 0), "condition {:e}", found.condition);
    assert_eq!(found.undriven, ["bias"]);
}
