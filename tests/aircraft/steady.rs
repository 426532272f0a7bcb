//! Steady flight, the linear models about it, modes, controllability, optimal gains: against the figures of a second
//! implementation.

use kfdesign::aircraft::airframe::Airplane;
use kfdesign::aircraft::airframe::levels::{Category, criteria};
use kfdesign::aircraft::airframe::modes::{Mode, ModeName, named};
use kfdesign::aircraft::airframe::trim::{Sideways, Trim, TrimRequest, Turn};
use kfdesign::aircraft::control::controllability::{controllability, gramian, observability};
use kfdesign::aircraft::control::document::Linearized;
use kfdesign::aircraft::control::regulator::regulator;
use nalgebra::{DMatrix, DVector};

use crate::support::data;

fn aerosonde() -> Airplane {
    Airplane::read(&data("airplanes/aerosonde.json")).unwrap()
}

fn request(airspeed: f64, climb: f64, turn_rate: f64) -> TrimRequest {
    TrimRequest { airspeed, altitude: 100.0, climb, turn: Turn::Rate(turn_rate), sideways: Sideways::ZeroSideslip }
}

fn level(airspeed: f64) -> Linearized {
    let airplane = aerosonde();
    let trim = airplane.trim(&request(airspeed, 0.0, 0.0)).unwrap();
    Linearized::new(&airplane, trim).unwrap()
}

/// Largest difference relative to the largest number of the expected row.
fn relative(found: &DMatrix<f64>, expected: &[&[f64]]) -> f64 {
    let expected = DMatrix::from_fn(expected.len(), expected[0].len(), |i, j| expected[i][j]);
    assert_eq!(found.shape(), expected.shape());
    let of_row = |i: usize| (found.row(i) - expected.row(i)).amax() / expected.row(i).amax().max(1e-30);
    (0..expected.nrows()).map(of_row).fold(0.0, f64::max)
}

fn near(found: &[f64], expected: &[f64], tolerance: f64) {
    assert_eq!(found.len(), expected.len());
    for (f, e) in found.iter().zip(expected) {
        assert!((f - e).abs() <= tolerance, "{found:?} against {expected:?}");
    }
}

/// A request, and what the trim must be.
type Steady = ([f64; 3], [f64; 7], [f64; 4], [f64; 8]);

#[rustfmt::skip]
const TRIMS: [Steady; 4] = [
    // airspeed, climb, turn rate; alpha phi theta elevator aileron rudder throttle; thrust torque rate current; u w p q
    // r F/m
    ([25.0, 0.0, 0.0], [0.053873983, -0.000530560, 0.053873975, -0.135469407, 0.006129659, -0.000977192, 0.777789841],
     [10.352416, 0.627798, 517.33881, 11.03272], [24.963728699, 1.346198144, 0.0, 0.0, 0.0, 0.528067687, 0.005195466,
     -9.792420628]),
    ([18.0, 0.0, 0.0], [0.144038920, -0.000356097, 0.144038911, -0.385016809, 0.007865283, -0.001253886, 0.585720825],
     [7.427940, 0.417603, 389.88409, 7.84103], [17.813597718, 2.583744637, 0.0, 0.0, 0.0, 1.407659876, 0.003455951,
     -9.705094845]),
    ([25.0, 5.0, 0.0], [0.053051955, -0.000888323, 0.140318396, -0.133194299, 0.010176864, -0.001622399, 0.865462667],
     [19.743292, 1.042312, 572.43255, 17.32684], [24.964826877, 1.325676808, 0.0, 0.0, 0.0, 1.371542269, 0.008625855,
     -9.710261666]),
    ([25.0, 0.0, 0.226474881], [0.068701125, 0.530265321, 0.059290445, -0.193216799, -0.012298754, -0.012865697,
     0.782462266],
     [10.824777, 0.649111, 520.28251, 11.35634], [24.941025145, 1.716177359, -0.013419931, 0.114341174, 0.195030441,
     0.777329776, -0.063827955, -11.296851923]),
];

#[test]
fn steady_flight_is_that_of_the_sheet() {
    let airplane = aerosonde();
    for ([speed, climb, turn], state, engine, motion) in TRIMS {
        let request = request(speed, f64::to_radians(climb), turn);
        let trim = airplane.trim(&request).unwrap();
        assert!(trim.residual < 1e-10, "{}", trim.residual);
        let c = trim.controls;
        near(&[trim.alpha, trim.phi, trim.theta, c.elevator, c.aileron, c.rudder, c.throttle], &state, 1e-8);
        let document = Linearized::new(&airplane, trim).unwrap().document(&airplane, &request, None).unwrap().trim;
        near(&[document.thrust, document.torque], &engine[..2], 1e-6);
        near(&[document.propeller_rate, document.current], &engine[2..], 1e-5);
        let [fx, fy, fz] = document.specific_force;
        near(&[document.u, document.w, document.p, document.q, document.r, fx, fy, fz], &motion, 1e-8);
    }
}

/// Every condition of a steady turn by its geometry, not by what the solver calls small.
#[test]
fn a_steady_turn_turns_and_climbs_as_asked() {
    let airplane = aerosonde();
    for sideways in [Sideways::ZeroSideslip, Sideways::ZeroSideForce] {
        for turn in [Turn::Rate(-0.3), Turn::Bank(25.0_f64.to_radians())] {
            let request = TrimRequest { climb: 0.03, turn, sideways, ..request(24.0, 0.0, 0.0) };
            let t = airplane.trim(&request).unwrap();
            let ([u, v, w], [p, q, r]) = (t.velocity, t.rate);
            let ((sf, cf), (st, ct)) = (t.phi.sin_cos(), t.theta.sin_cos());
            // the attitude stands still and the heading turns
            near(
                &[p + st / ct * (q * sf + r * cf), q * cf - r * sf, (q * sf + r * cf) / ct],
                &[0.0, 0.0, t.turn_rate],
                1e-12,
            );
            near(
                &[u * st - (v * sf + w * cf) * ct, (u * u + v * v + w * w).sqrt()],
                &[24.0 * 0.03_f64.sin(), 24.0],
                1e-10,
            );
            match turn {
                Turn::Rate(rate) => assert_eq!(t.turn_rate, rate),
                Turn::Bank(bank) => near(&[t.phi], &[bank], 1e-12),
            }
            if sideways == Sideways::ZeroSideslip { near(&[v], &[0.0], 1e-10) } else { assert!(v.abs() > 1e-3) }
        }
    }
    let flat = TrimRequest { sideways: Sideways::WingsLevel, ..request(25.0, 0.0, 0.02) };
    let t = airplane.trim(&flat).unwrap();
    near(&[t.phi], &[0.0], 1e-12);
    assert!(t.beta.abs() > 1e-3, "a flat turn slips: {}", t.beta);
}

#[test]
fn the_linear_models_are_those_of_the_sheet() {
    let Linearized { models, .. } = level(25.0);
    let along = &models.longitudinal;
    let across = &models.lateral;
    let checks: [(&DMatrix<f64>, &[&[f64]]); 6] = [
        (
            &along.a,
            &[
                &[-0.272928276, 0.501895626, -1.315368773, -9.792422006],
                &[-0.552322059, -4.306069826, 24.392032730, -0.528067613],
                &[0.205956222, -3.819226224, -5.065459544, 0.0],
                &[0.0, 0.0, 0.999999859, 0.0],
            ],
        ),
        (&along.b, &[&[0.132707191, 9.159534622], &[-2.460905430, 0.0], &[-34.548609975, 0.0], &[0.0, 0.0]]),
        (
            &along.e,
            &[
                &[0.272928276, -0.501895626, -0.030829371],
                &[0.552322059, 4.306069826, 0.571695969],
                &[-0.205956222, 3.819226224, 5.065459544],
                &[0.0, 0.0, 0.0],
            ],
        ),
        (
            &across.a,
            &[
                &[-0.743135817, 1.346198144, -24.963728699, 9.792420628],
                &[-3.699304996, -22.053663406, 10.432818334, 0.0],
                &[0.749165421, -2.881247880, -1.174493440, 0.0],
                &[0.0, 1.0, 0.053926149, 0.0],
            ],
        ),
        (
            &across.b,
            &[&[1.421815977, 3.601933809], &[125.216004937, -1.718585731], &[4.794711184, -23.803901309], &[0.0, 0.0]],
        ),
        (
            &across.e,
            &[
                &[0.743135817, 0.0, 0.0],
                &[3.699304996, 22.053663406, -10.432818334],
                &[-0.749165421, 2.881247880, 1.174493440],
                &[0.0, 0.0, 0.0],
            ],
        ),
    ];
    for (i, (found, expected)) in checks.into_iter().enumerate() {
        let error = relative(found, expected);
        assert!(error < 1e-8, "{i}: {error}\n{found}");
    }
    let Linearized { models, .. } = level(18.0);
    let checks: [(&DMatrix<f64>, &[&[f64]]); 4] = [
        (
            &models.longitudinal.a,
            &[
                &[-0.195004381, 0.813256864, -2.524574133, -9.705095460],
                &[-0.634873360, -3.135298639, 17.405647362, -1.407659787],
                &[0.395289718, -2.725320419, -3.647130872, 0.0],
                &[0.0, 0.0, 0.999999937, 0.0],
            ],
        ),
        (
            &models.longitudinal.b,
            &[&[0.183386582, 7.094358849], &[-1.264356680, 0.0], &[-17.909999411, 0.0], &[0.0, 0.0]],
        ),
        (
            &models.lateral.a,
            &[
                &[-0.535057789, 2.583744637, -17.813597718, 9.705094845],
                &[-2.663499597, -15.878637653, 7.511629201, 0.0],
                &[0.539399103, -2.074498474, -0.845635277, 0.0],
                &[0.0, 1.0, 0.145043374, 0.0],
            ],
        ),
        (
            &models.lateral.b,
            &[&[0.737069403, 1.867242487], &[64.911976959, -0.890914843], &[2.485578278, -12.339942439], &[0.0, 0.0]],
        ),
    ];
    for (i, (found, expected)) in checks.into_iter().enumerate() {
        let error = relative(found, expected);
        assert!(error < 1e-8, "{i}: {error}\n{found}");
    }
}

fn mode(modes: &[Mode], name: ModeName) -> [f64; 2] {
    let mode = named(modes, name).unwrap_or_else(|| panic!("no {name:?} in {modes:?}"));
    [mode.eigenvalue.0, mode.eigenvalue.1]
}

#[test]
fn modes_are_those_of_the_sheet_and_have_their_names() {
    let fast = level(25.0);
    near(&mode(&fast.longitudinal, ModeName::ShortPeriod), &[-4.68400044, 9.65902506], 1e-7);
    near(&mode(&fast.longitudinal, ModeName::Phugoid), &[-0.13822839, 0.48083869], 1e-7);
    near(&mode(&fast.lateral, ModeName::DutchRoll), &[-1.48280698, 5.81000559], 1e-7);
    near(&mode(&fast.lateral, ModeName::Roll), &[-21.06949427, 0.0], 1e-7);
    near(&mode(&fast.lateral, ModeName::Spiral), &[0.06381557, 0.0], 1e-7);
    let of = |name| *named(&fast.longitudinal, name).unwrap();
    let (short, phugoid) = (of(ModeName::ShortPeriod), of(ModeName::Phugoid));
    near(
        &[short.frequency(), short.damping(), short.time_to_half().unwrap()],
        &[10.7348323, 0.4363366, 0.147982],
        1e-6,
    );
    near(
        &[phugoid.frequency(), phugoid.damping(), phugoid.time_to_half().unwrap()],
        &[0.5003128, 0.2762839, 5.014507],
        1e-6,
    );
    let of = |name| *named(&fast.lateral, name).unwrap();
    near(
        &[of(ModeName::Roll).time_constant().unwrap(), of(ModeName::Spiral).time_to_double().unwrap()],
        &[0.0474620, 10.861725],
        1e-6,
    );
    let slow = level(18.0);
    near(&mode(&slow.longitudinal, ModeName::ShortPeriod), &[-3.38819704, 6.95622120], 1e-7);
    near(&mode(&slow.longitudinal, ModeName::Phugoid), &[-0.10051990, 0.68289500], 1e-7);
    near(&mode(&slow.lateral, ModeName::DutchRoll), &[-1.23830520, 4.26560523], 1e-7);
    near(&mode(&slow.lateral, ModeName::Spiral), &[0.12680040, 0.0], 1e-7);
    let airplane = aerosonde();
    for (request, expected) in [
        (
            request(25.0, 0.0, 0.0),
            [-21.06949448, -4.68400047, 9.65902504, -1.48280784, 5.81000639, -0.13822493, 0.48083567, 0.06381066],
        ),
        (
            request(25.0, 0.0, 9.80665 * 30.0_f64.to_radians().tan() / 25.0),
            [-20.97526072, -4.68349494, 9.65823899, -1.52844883, 5.78813705, -0.12343349, 0.53370555, 0.02507433],
        ),
        (
            request(25.0, 5.0_f64.to_radians(), 0.0),
            [-21.07384511, -4.69805919, 9.66590287, -1.49544487, 5.81487102, -0.12730441, 0.47126272, 0.09342869],
        ),
    ] {
        let full = Linearized::new(&airplane, airplane.trim(&request).unwrap()).unwrap().full;
        let of = |name| mode(&full, name);
        let [roll, s0, s1, d0, d1, p0, p1, spiral] = expected;
        near(&of(ModeName::Roll), &[roll, 0.0], 1e-7);
        near(&of(ModeName::ShortPeriod), &[s0, s1], 1e-7);
        near(&of(ModeName::DutchRoll), &[d0, d1], 1e-7);
        near(&of(ModeName::Phugoid), &[p0, p1], 1e-7);
        near(&of(ModeName::Spiral), &[spiral, 0.0], 1e-7);
    }
}

/// Step responses by the matrix exponential of [A b; 0 0].
#[test]
fn step_responses_are_those_of_the_sheet() {
    let Linearized { models, .. } = level(25.0);
    let after = |a: &DMatrix<f64>, b: &[f64], t: f64| -> Vec<f64> {
        let mut joined = DMatrix::zeros(5, 5);
        joined.view_mut((0, 0), (4, 4)).copy_from(&(a * t));
        (0..4).for_each(|i| joined[(i, 4)] = b[i] * t);
        joined.exp().view((0, 4), (4, 1)).iter().copied().collect()
    };
    let column = |b: &DMatrix<f64>, j: usize, by: f64| (b.column(j) * by).iter().copied().collect::<Vec<f64>>();
    let degree = 1.0_f64.to_radians();
    let (along, across) = (&models.longitudinal, &models.lateral);
    #[rustfmt::skip]
    let table = [
        (0, degree, 0.1, [0.003124628, -0.053370517, -0.040458369, -0.002371799]),
        (0, degree, 5.0, [1.056100100, -0.109178883, 0.005444574, -0.050409184]),
        (1, 0.1, 1.0, [0.759624014, 0.010487214, 0.019828166, 0.010282599]),
        (1, 0.1, 5.0, [0.559416640, 0.010757833, 0.016835113, 0.121091055]),
        (2, degree, 0.5, [0.267625782, 0.053293760, -0.003690457, 0.033618996]),
        (2, degree, 5.0, [0.486031010, 0.085108628, 0.143170783, 0.394991325]),
        (3, degree, 1.0, [0.202457967, -0.045121385, -0.020078916, -0.058302711]),
        (3, degree, 5.0, [0.045758237, -0.069913475, -0.128992378, -0.328375548]),
    ];
    for (input, by, t, expected) in table {
        let model = if input < 2 { along } else { across };
        near(&after(&model.a, &column(&model.b, input % 2, by), t), &expected, 2e-8);
    }
    // up-gust of 3 m/s over 25 m, w_g = −1.5 (1 − cos 2πt): states of the gust beside those of the airplane, g'' =
    // −4π²(g + 1.5)
    let mut joined = DMatrix::zeros(7, 7);
    joined.view_mut((0, 0), (4, 4)).copy_from(&along.a);
    (0..4).for_each(|i| joined[(i, 4)] = along.e[(i, 1)]);
    let square = 4.0 * std::f64::consts::PI.powi(2);
    (joined[(4, 5)], joined[(5, 4)], joined[(5, 6)]) = (1.0, -square, -1.5 * square);
    let start = DVector::from_vec(vec![0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]);
    for (t, expected) in [
        (0.25, [0.075020817, -0.807741176, -0.225420932, -0.018279971]),
        (0.5, [0.349533613, -3.125071042, -0.234112959, -0.093833608]),
        (1.0, [0.380678000, 0.194063164, 0.242922861, 0.003640001]),
    ] {
        near(&((&joined * t).exp() * &start).as_slice()[..4], &expected, 2e-8);
    }
}

#[test]
fn controllability_and_observability_are_those_of_the_sheet() {
    let found = level(25.0);
    let (along, across) = (&found.models.longitudinal, &found.models.lateral);
    let reach = |model, modes: &[Mode], inputs: &[usize]| controllability(model, modes, inputs).unwrap();
    let of = |reach: Vec<kfdesign::aircraft::control::controllability::Reach>| {
        reach.iter().flat_map(|r| [vec![r.pbh], r.cosines.clone()].concat()).collect::<Vec<f64>>()
    };
    near(&of(reach(along, &found.longitudinal, &[0])), &[6.8246064, 0.9281192, 0.1571034, 0.0348381], 1e-6);
    near(
        &of(reach(along, &found.longitudinal, &[0, 1])),
        &[8.1289752, 0.9281192, 0.0257974, 0.3787675, 0.0348381, 0.0513737],
        1e-6,
    );
    near(
        &of(reach(across, &found.lateral, &[0, 1])),
        &[17.8932080, 0.9339395, 0.2228222, 5.6568437, 0.1056880, 0.8958246, 0.9848657, 0.0323250, 0.1389109],
        1e-6,
    );
    let alone: Vec<f64> = reach(across, &found.lateral, &[0]).iter().map(|r| r.pbh).collect();
    near(&alone, &[11.4890555, 2.2429616, 0.4495662], 1e-6);
    near(
        &of(observability(along, &found.longitudinal, &[2]).unwrap()),
        &[0.3674689, 0.3676695, 0.0257696, 0.0258016],
        1e-6,
    );
    near(
        &of(observability(across, &found.lateral, &[1, 2]).unwrap()),
        &[0.9908240, 0.9813129, 0.1373599, 0.2848630, 0.1887604, 0.2142640, 0.2775970, 0.0332185, 0.2795903],
        1e-6,
    );
    // of velocities over the airspeed
    let (along, across) = (&along.in_angles(25.0), &across.in_angles(25.0));
    let w = gramian(across, &[0, 1], 5.0).unwrap();
    near(&w.eigenvalues, &[3.089378, 108.106102, 206.815984, 446.249299], 2e-6);
    near(&[w.condition], &[144.446], 1e-3);
    near(&[gramian(across, &[0], 5.0).unwrap().condition], &[425.344], 1e-3);
    near(&[gramian(across, &[1], 5.0).unwrap().condition], &[7078.97], 1e-2);
    near(&[gramian(along, &[0], 5.0).unwrap().condition], &[303.347], 1e-3);
}

#[test]
fn optimal_gains_are_those_of_the_sheet() {
    let found = level(25.0);
    let diagonal = |d: &[f64]| DMatrix::from_diagonal(&DVector::from_column_slice(d));
    let (along, across) = (&found.models.longitudinal, &found.models.lateral);
    let pitch =
        regulator(&along.a, &along.b.columns(0, 1).into_owned(), &diagonal(&[0.01, 0.01, 1.0, 4.0]), &diagonal(&[1.0]))
            .unwrap();
    near(pitch.gain.as_slice(), &[0.033029462, 0.062575619, -0.883946725, -2.274199624], 2e-8);
    let lateral = regulator(&across.a, &across.b, &diagonal(&[0.01, 0.2, 1.0, 2.0]), &diagonal(&[1.0, 1.0])).unwrap();
    let expected: [&[f64]; 2] = [
        &[-0.001849133, 0.333197165, -0.028268589, 1.435724064],
        &[0.049252389, 0.037387976, -0.971484252, -0.092097875],
    ];
    assert!(relative(&lateral.gain, &expected) < 1e-8, "{}", lateral.gain);
    for found in [&pitch, &lateral] {
        assert!(found.relative_residual < 1e-11, "{}", found.relative_residual);
    }
    // an input that does nothing to an unstable airplane
    let nothing = DMatrix::zeros(4, 1);
    assert!(regulator(&across.a, &nothing, &diagonal(&[1.0; 4]), &diagonal(&[1.0])).is_err());
}

/// CAP 10.497603 is beyond Level 2 of category B, and Level 1 at N = 3.799, the span of a light four-seater; the spiral
/// goes from Level 2 to Level 1.
#[test]
fn levels_as_flown_and_scaled() {
    let airplane = aerosonde();
    let found = level(25.0);
    let scale = 11.0 / 2.8956;
    let all = criteria(&airplane, &found.trim, &found.models, [&found.longitudinal, &found.lateral], Some(scale));
    let of = |name: &str, category| all.iter().find(|c| c.name == name && c.category == category).unwrap();
    let cap = of("cap", Category::B);
    near(&[cap.value.unwrap(), cap.scaled_value.unwrap()], &[10.497603, 10.497603 / scale], 1e-5);
    assert_eq!((cap.level, cap.scaled_level), (Some(3), Some(1)));
    let spiral = of("spiral_time_to_double", Category::B);
    near(&[spiral.value.unwrap(), spiral.scaled_value.unwrap()], &[10.861725, 21.17], 2e-3);
    assert_eq!((spiral.level, spiral.scaled_level), (Some(2), Some(1)));
    // table rows by hand
    assert_eq!(of("short_period_damping", Category::A).level, Some(1));
    assert_eq!(of("phugoid_damping", Category::C).level, Some(1));
    assert_eq!(of("dutch_roll_damping", Category::A).level, Some(1));
    assert_eq!(of("roll_time_constant", Category::A).level, Some(1));
    assert_eq!(of("cap", Category::C).level, Some(3));
    let roll = of("roll_performance", Category::A);
    assert!(roll.value.unwrap() > 0.1 && roll.value.unwrap() < 1.3 && roll.level == Some(1), "{roll:?}");
    assert!(all.len() == 21 && all.iter().all(|c| c.level.is_some()));
    // one that is slow to bank: a tenth of the aileron
    let mut stiff = airplane;
    stiff.actuators[1].as_mut().unwrap().travel = [-0.02, 0.02];
    let slow = criteria(&stiff, &found.trim, &found.models, [&found.longitudinal, &found.lateral], None);
    let roll = slow.iter().find(|c| c.name == "roll_performance" && c.category == Category::A).unwrap();
    assert!(roll.level.is_none_or(|level| level > 1), "{roll:?}");
}

/// A short period that is real, a phugoid that is not there: nothing is called by a wrong name.
#[test]
fn an_airplane_without_a_mode_has_no_level_of_it() {
    let mut airplane = aerosonde();
    // tail-heavy: a little negative margin
    airplane.aerodynamics.pitch.alpha = 0.3;
    let trim: Trim = airplane.trim(&request(25.0, 0.0, 0.0)).unwrap();
    let found = Linearized::new(&airplane, trim).unwrap();
    assert!(found.longitudinal.iter().any(|m| m.eigenvalue.0 > 0.0), "{:?}", found.longitudinal);
    assert!(named(&found.longitudinal, ModeName::ShortPeriod).is_none(), "{:?}", found.longitudinal);
    let all = criteria(&airplane, &trim, &found.models, [&found.longitudinal, &found.lateral], None);
    let cap = all.iter().find(|c| c.name == "cap").unwrap();
    assert!(cap.level.is_none() && cap.note.as_deref().is_some_and(|n| n.contains("short-period")), "{cap:?}");
}
