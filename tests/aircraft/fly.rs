//! Flights: trajectories of a second implementation, order of convergence, the linear model as a limit, what the log holds.

use std::path::PathBuf;

use kfdesign::aircraft::flight::{FlightDocument, FlightError, FlightReport, Plan, RowSink, Times, fly};
use nalgebra::DMatrix;
use serde_json::{Value, json};

/// Columns of one run.
struct Table {
    names: Vec<String>,
    columns: Vec<Vec<f64>>,
}

impl Table {
    fn get(&self, name: &str) -> &[f64] {
        let found = self.names.iter().position(|n| n.split(' ').next() == Some(name));
        &self.columns[found.unwrap_or_else(|| panic!("no column {name} in {:?}", self.names))]
    }
    fn last(&self, names: &[&str]) -> Vec<f64> {
        names.iter().map(|name| *self.get(name).last().unwrap()).collect()
    }
    /// The row at a time.
    fn at(&self, time: f64, names: &[&str]) -> Vec<f64> {
        let row = self.get("time").iter().position(|t| (t - time).abs() < 1e-9).unwrap();
        names.iter().map(|name| self.get(name)[row]).collect()
    }
}

struct Keep<'a>(&'a std::sync::Mutex<Vec<(u64, Vec<Vec<f64>>)>>, u64, Vec<Vec<f64>>);

impl RowSink<FlightError> for Keep<'_> {
    fn write(&mut self, columns: &[Vec<f64>]) -> Result<(), FlightError> {
        self.2.resize(columns.len(), Vec::new());
        self.2.iter_mut().zip(columns).for_each(|(kept, new)| kept.extend_from_slice(new));
        Ok(())
    }
    fn finish(self) -> Result<Option<String>, FlightError> {
        self.0.lock().unwrap().push((self.1, self.2));
        Ok(None)
    }
}

fn folder() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("data/airplanes")
}

fn plan(document: &Value, times: Times) -> Result<Plan, String> {
    let document = FlightDocument::from_json(&document.to_string(), "flight.json").map_err(|e| e.to_string())?;
    Plan::new(&document, &folder(), &times).map_err(|e| e.to_string())
}

fn times(duration: f64, every: Option<f64>, step: Option<f64>) -> Times {
    Times { duration, every, step }
}

/// All runs in their order.
fn runs(document: &Value, times: Times, seed: u64, runs: u64) -> Result<Vec<Table>, String> {
    let plan = plan(document, times)?;
    let kept = std::sync::Mutex::new(Vec::new());
    fly(&plan, seed, runs, |run| Ok(Keep(&kept, run, Vec::new()))).map_err(|e: FlightError| e.to_string())?;
    let mut kept = kept.into_inner().unwrap();
    kept.sort_by_key(|(run, _)| *run);
    Ok(kept.into_iter().map(|(_, columns)| Table { names: plan.columns(), columns }).collect())
}

fn one(document: &Value, times: Times) -> Table {
    runs(document, times, 1, 1).unwrap().remove(0)
}

/// An airplane thrown into the air with its controls fixed: all axes move.
fn thrown() -> Value {
    json!({
        "format": "kfdesign-flight/1",
        "airplane": "aerosonde.json",
        "initial": {
            "altitude": "100 m", "u": "25 m/s", "v": "1 m/s", "w": "1.5 m/s", "phi": "10 deg", "theta": "5 deg", "psi": "30 deg",
            "p": "0.2 rad/s", "q": "-0.1 rad/s", "r": "0.1 rad/s"
        },
        "controls": { "elevator": "-0.14 rad", "aileron": "0.02 rad", "rudder": "-0.01 rad", "throttle": "0.8" }
    })
}

fn over_wgs84(mut document: Value) -> Value {
    document["earth"] = json!({ "wgs84": { "latitude": "48.7 deg", "longitude": "21.25 deg" } });
    document
}

fn level() -> Value {
    json!({
        "format": "kfdesign-flight/1",
        "airplane": "aerosonde.json",
        "trim": { "airspeed": "25 m/s", "altitude": "100 m" }
    })
}

/// Differences below `tolerance` each.
fn near(found: &[f64], expected: &[f64], tolerance: f64) {
    assert_eq!(found.len(), expected.len());
    for (f, e) in found.iter().zip(expected) {
        assert!((f - e).abs() < tolerance, "{found:?} against {expected:?}");
    }
}

const PLACE: [&str; 3] = ["north", "east", "down"];
const VELOCITY: [&str; 3] = ["u", "v", "w"];
const ANGLES: [&str; 3] = ["phi", "theta", "psi"];
const RATES: [&str; 3] = ["p", "q", "r"];

/// The sheet's trajectory over the flat earth, to 1e-6 m and 1e-8 m/s.
#[test]
fn the_trajectory_over_the_flat_earth() {
    let table = one(&thrown(), times(10.0, Some(1.0), None));
    let expected = [
        (
            1.0,
            [
                20.832142534,
                13.911590883,
                -100.449369260,
                25.032993307,
                0.353616141,
                1.360343049,
                0.286131701,
                0.070285570,
                0.638325683,
                0.055218672,
                0.022805478,
                0.084315817,
            ],
        ),
        (
            2.0,
            [
                40.123548412,
                29.956258655,
                -100.655435567,
                25.126351013,
                0.290447136,
                1.349758391,
                0.385843803,
                0.053884688,
                0.767593893,
                0.090188051,
                0.033749093,
                0.132354634,
            ],
        ),
        (
            5.0,
            [
                79.501427889,
                94.822952029,
                -96.805895871,
                26.580519859,
                0.452905741,
                1.312458722,
                0.707471922,
                -0.067354960,
                1.362568597,
                0.123137751,
                0.121429278,
                0.229809827,
            ],
        ),
        (
            10.0,
            [
                11.261993600,
                199.803546906,
                -57.247114905,
                33.208990721,
                0.488380295,
                1.400433547,
                1.073612198,
                -0.373232230,
                3.103720366,
                0.186977542,
                0.336426174,
                0.234943178,
            ],
        ),
    ];
    for (time, row) in expected {
        near(&table.at(time, &PLACE), &row[..3], 1e-6);
        near(&table.at(time, &VELOCITY), &row[3..6], 1e-8);
        near(&table.at(time, &ANGLES), &row[6..9], 1e-8);
        near(&table.at(time, &RATES), &row[9..], 1e-8);
    }
    assert_eq!(*table.get("time").last().unwrap(), 10.0);
}

/// The sheet's trajectory over the rotating earth; what the gyro sees is inertial.
#[test]
fn the_trajectory_over_the_rotating_earth() {
    let mut document = over_wgs84(thrown());
    let quiet = json!({
        "format": "kfdesign-params/1", "quantity": "angular-rate", "sample_rate": "100 Hz",
        "axes": [{ "name": "x", "white": { "density": "1e-30 rad/s/sqrt(Hz)" } }]
    });
    document["sensors"] = json!({ "gyro": quiet });
    let table = one(&document, times(10.0, Some(1.0), None));
    let expected = [
        (
            0.0,
            [
                48.7,
                21.25,
                100.0,
                25.0,
                1.0,
                1.5,
                0.174532925,
                0.087266463,
                0.523598776,
                0.200046296,
                -0.100032544,
                0.099954011,
            ],
        ),
        (
            1.0,
            [
                48.7001873237,
                21.2501890016,
                100.4488745,
                25.033101605,
                0.353768491,
                1.360358109,
                0.286136085,
                0.070248320,
                0.638421972,
                0.055287857,
                0.022752928,
                0.084371184,
            ],
        ),
        (
            5.0,
            [
                48.7007146529,
                21.2512884654,
                96.7978920,
                26.582489309,
                0.453083196,
                1.312418104,
                0.707525499,
                -0.067415093,
                1.363160248,
                0.123174518,
                0.121471045,
                0.229880205,
            ],
        ),
        (
            10.0,
            [
                48.7001001539,
                21.2527137404,
                57.2342687,
                33.211579004,
                0.488540862,
                1.400481375,
                1.073654710,
                -0.373260045,
                3.104933823,
                0.186943609,
                0.336469396,
                0.234998640,
            ],
        ),
    ];
    for (time, row) in expected {
        // 1e-10 deg are 1.1e-5 m, the last digit of the sheet
        near(&table.at(time, &["latitude", "longitude"]), &row[..2], 1.1e-10);
        near(&table.at(time, &["height"]), &row[2..3], 1e-6);
        near(&table.at(time, &VELOCITY), &row[3..6], 1e-8);
        near(&table.at(time, &ANGLES), &row[6..9], 1e-8);
        near(&table.at(time, &["gyro_x", "gyro_y", "gyro_z"]), &row[9..], 1e-8);
        near(&table.at(time, &["truth_gyro_x_rate"]), &row[9..10], 1e-8);
    }
    // p, q, r are relative to the earth
    near(&table.at(0.0, &RATES), &[0.2, -0.1, 0.1], 1e-12);
    near(&ecef(&table, 10.0), &[3930750.552475, 1528799.623544, 4768655.805949], 2e-6);
}

/// Earth-fixed place of a row, by the definition of geodetic coordinates.
fn ecef(table: &Table, time: f64) -> [f64; 3] {
    let row = table.at(time, &["latitude", "longitude", "height"]);
    let place = kfdesign::aircraft::flight::earth::Geodetic {
        latitude: row[0].to_radians(),
        longitude: row[1].to_radians(),
        height: row[2],
    };
    place.to_ecef()
}

#[test]
fn gravity_and_coordinates_of_the_ellipsoid() {
    use kfdesign::aircraft::flight::earth::{EARTH_RATE, Geodetic, gravitation};
    let place = Geodetic { latitude: 48.7_f64.to_radians(), longitude: 21.25_f64.to_radians(), height: 100.0 };
    let r = place.to_ecef();
    near(&r, &[3930857.062405, 1528626.709523, 4768680.583478], 1e-6);
    let g = gravitation(r);
    near(&g, &[-6.0548278707, -2.3545937839, -7.3693719234], 1e-10);
    // with the centrifugal part, down and north
    let apparent = [g[0] + EARTH_RATE.powi(2) * r[0], g[1] + EARTH_RATE.powi(2) * r[1], g[2]];
    let (s, c) = place.latitude.sin_cos();
    let across = apparent[0] * place.longitude.cos() + apparent[1] * place.longitude.sin();
    near(&[-across * c - apparent[2] * s, -across * s + apparent[2] * c], &[9.809271111, -0.0000278], 5e-8);
    // there and back from pole to pole, up to 20 km
    for degrees in [-90.0_f64, -89.999, -45.0, -1e-9, 0.0, 30.0, 89.9999, 90.0] {
        for height in [-500.0, 0.0, 20_000.0] {
            let place = Geodetic { latitude: degrees.to_radians(), longitude: -2.0, height };
            let back = Geodetic::from_ecef(place.to_ecef());
            assert!(
                (back.latitude - place.latitude).abs() < 1e-15 * 10.0 && (back.height - height).abs() < 4e-9,
                "{degrees}"
            );
        }
    }
}

/// Halving the step divides the error by 2⁴: the classical Runge–Kutta method with the forces of every stage.
#[test]
fn the_integration_is_of_order_four() {
    let fine = one(&thrown(), times(4.0, Some(4.0), Some(2e-4)));
    let error = |step: f64| {
        let table = one(&thrown(), times(4.0, Some(4.0), Some(step)));
        let names = [PLACE, VELOCITY].concat();
        let differences = table.last(&names).into_iter().zip(fine.last(&names)).map(|(a, b)| (a - b).abs());
        differences.fold(0.0, f64::max)
    };
    let errors: Vec<f64> = [0.04, 0.02, 0.01].map(error).into();
    for pair in errors.windows(2) {
        assert!((3.6..4.6).contains(&(pair[0] / pair[1]).log2()), "{errors:?}");
    }
}
