//! A second airframe, the UltraStick 25e, at conditions that no other test has, against a second implementation (NumPy:
//! derivatives by complex step, Runge–Kutta steps of 1.25 ms).

use kfdesign::aircraft::airframe::Airplane;
use kfdesign::aircraft::airframe::trim::{Sideways, Trim, TrimRequest, Turn};
use nalgebra::DMatrix;
use serde_json::json;

use super::flights::{ANGLES, PLACE, RATES, VELOCITY, near, one, times};
use crate::support::data;

fn airplane() -> Airplane {
    Airplane::read(&data("airplanes/ultrastick-25e.json")).unwrap()
}

/// Airspeed, altitude, climb, turn rate.
fn trim([airspeed, altitude, climb, turn]: [f64; 4]) -> Trim {
    let turn = Turn::Rate(turn);
    airplane().trim(&TrimRequest { airspeed, altitude, climb, turn, sideways: Sideways::ZeroSideslip }).unwrap()
}

#[rustfmt::skip]
const TRIMS: [([f64; 4], f64, [f64; 7]); 3] = [
    // density; alpha phi theta elevator aileron rudder thrust
    ([17.0, 300.0, 0.0, 0.0], 1.190107311, [0.056623615, 0.0, 0.056623615, -0.080983593, 0.0, 0.0, 2.386583314]),
    ([14.0, 0.0, 0.07, 0.0], 1.225000018, [0.089882263, 0.0, 0.159882263, -0.109313002, 0.0, 0.0, 3.203892825]),
    ([20.0, 1500.0, 0.0, 0.4], 1.058104463, [0.058889745, 0.68529665, 0.045615401, -0.108114132, -0.00710523,
     -0.008135274, 2.962800758]),
];

#[test]
fn steady_flight_of_another_airplane() {
    for (request, density, expected) in TRIMS {
        let t = trim(request);
        let c = t.controls;
        near(&[t.density], &[density], 2e-9);
        near(&[t.alpha, t.phi, t.theta, c.elevator, c.aileron, c.rudder, c.throttle], &expected, 1e-8);
        assert!(t.residual < 1e-10, "{}", t.residual);
    }
}

/// A turn, in which the longitudinal and the lateral motion are one.
#[rustfmt::skip]
const LINEAR: [&[&[f64]]; 3] = [
    &[
        &[-0.130225917, 0.642062818, -1.131797056, -9.796449103, 0.309370389, 0.0, 0.0, 0.0],
        &[-0.539022578, -7.757125139, 18.676918057, -0.346220112, 0.018239833, 0.0, 0.0, -6.200199237],
        &[0.605724088, -6.834796986, -16.086877598, 0.0, 0.0, 0.30013091, 0.082958932, 0.0],
        &[0.0, 0.0, 0.77423133, 0.0, 0.0, 0.0, -0.632902715, -0.399583919],
        &[-0.312071336, -0.018399076, 0.0, -0.283020901, -0.817815529, 1.137281494, -19.805998995, 7.584717822],
        &[-0.060720968, -0.003579982, -0.3052609, 0.0, -2.839013198, -16.466919278, 3.210954138, 0.0],
        &[0.045667606, 0.002692467, -0.054243534, 0.0, 1.699730521, 0.504723507, -2.883320597, 0.0],
        &[0.0, 0.0, 0.028890152, 0.400416514, 0.0, 1.0, 0.035341388, 0.0],
    ],
    &[
        &[0.115632758, 0.510464523, 0.0, 0.0],
        &[-3.287552209, 0.0, 0.0, 0.0],
        &[-161.039529485, 0.0, 0.0, 0.0],
        &[0.0, 0.0, 0.0, 0.0],
        &[0.0, 0.0, 0.0, 6.400004526],
        &[0.0, 0.0, 188.868585141, -5.928112621],
        &[0.0, 0.0, -13.886365083, -98.65116347],
        &[0.0, 0.0, 0.0, 0.0],
    ],
    &[
        &[0.130225917, -0.894960566, -0.04531719, 0.0, 0.0, 0.0],
        &[0.791920325, 7.757125139, 1.288411945, 0.0, 0.0, 0.0],
        &[-0.605724088, 6.834796986, 16.086877598, 0.0, 0.0, 0.0],
        &[0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        &[0.002700947, 0.000159242, 0.0, 0.817815529, 0.039832752, -0.159331007],
        &[0.060720968, 0.003579982, 0.0, 2.839013198, 16.512457668, -3.457807695],
        &[-0.045667606, -0.002692467, 0.0, -1.699730521, -0.525017663, 2.837782207],
        &[0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    ],
];

#[test]
fn the_linear_model_of_another_airplane_in_a_turn() {
    let model = airplane().linear(&trim(TRIMS[2].0)).full;
    for (found, expected) in [&model.a, &model.b, &model.e].into_iter().zip(LINEAR) {
        let expected = DMatrix::from_fn(expected.len(), expected[0].len(), |i, j| expected[i][j]);
        for i in 0..8 {
            let difference = (found.row(i) - expected.row(i)).amax();
            assert!(difference <= 1e-7 * expected.row(i).amax(), "{i}: {difference}");
        }
    }
}

/// Thrown into wind from three sides with its controls fixed.
#[test]
fn the_trajectory_of_another_airplane() {
    let document = json!({
        "format": "kfdesign-flight/1",
        "airplane": "ultrastick-25e.json",
        "initial": {
            "altitude": "300 m", "u": "17 m/s", "v": "-1 m/s", "w": "1.2 m/s",
            "phi": "-20 deg", "theta": "4 deg", "psi": "80 deg",
            "p": "-0.3 rad/s", "q": "0.1 rad/s", "r": "0.2 rad/s"
        },
        "controls": { "elevator": "-0.06 rad", "aileron": "-0.01 rad", "rudder": "0.02 rad", "thrust": "4 N" },
        "wind": { "north": "2 m/s", "east": "-4 m/s", "down": "0.5 m/s" }
    });
    let table = one(&document, times(10.0, Some(1.0), None));
    #[rustfmt::skip]
    let expected = [
        (1.0, [5.86695933, 16.369826815, -299.697171591, 17.868011049, -2.248185467, -0.870901987, -0.626187968,
         -0.033870515, 1.213037565, -0.320441631, 0.046794189, -0.257332556]),
        (5.0, [83.005861486, 39.997809791, -253.456421773, 36.020269678, 3.359890532, -2.975057329, -1.375360772,
         -0.882461799, -0.442343238, -0.51759201, 0.372766965, -0.256910255]),
        (10.0, [48.554573903, 11.399245019, -88.362330706, 42.62811042, -1.553551591, -0.263444577, -1.117023043,
         -0.809522809, 1.531333995, -0.707712802, 0.496258146, -0.229150605]),
    ];
    for (time, row) in expected {
        near(&table.at(time, &PLACE), &row[..3], 1e-6);
        near(&table.at(time, &[VELOCITY, ANGLES, RATES].concat()), &row[3..], 2e-8);
    }
}

/// The column has the name and the unit of the document's key.
#[test]
fn a_file_gives_its_thrust() {
    let bench = crate::support::Bench::new();
    let file = bench.file("commands.csv", "time (s),thrust (mN)\n0,4000\n1,4000\n");
    let fly = |controls: serde_json::Value| {
        let document = json!({
            "format": "kfdesign-flight/1",
            "airplane": "ultrastick-25e.json",
            "trim": { "airspeed": "17 m/s", "altitude": "300 m" },
            "controls": controls
        });
        one(&document, times(1.0, Some(1.0), None)).last(&VELOCITY)
    };
    let fixed = fly(json!({ "thrust": "4 N" }));
    near(&fly(json!({ "file": file })), &fixed, 1e-12);
    assert!(fixed[0] > 17.3, "{fixed:?}");
}
