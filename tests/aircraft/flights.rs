//! Flights for the tests of this folder.

use std::path::PathBuf;

use kfdesign::aircraft::airframe::Airplane;
use kfdesign::aircraft::airframe::trim::{Sideways, Trim, TrimRequest, Turn};
use kfdesign::aircraft::flight::{FlightDocument, FlightError, Plan, RowSink, Times, fly};
use serde_json::{Value, json};

/// Columns of one run.
pub struct Table {
    pub names: Vec<String>,
    pub columns: Vec<Vec<f64>>,
}

impl Table {
    pub fn get(&self, name: &str) -> &[f64] {
        let found = self.names.iter().position(|n| n.split(' ').next() == Some(name));
        &self.columns[found.unwrap_or_else(|| panic!("no column {name} in {:?}", self.names))]
    }
    pub fn last(&self, names: &[&str]) -> Vec<f64> {
        names.iter().map(|name| *self.get(name).last().unwrap()).collect()
    }
    /// The row at a time.
    pub fn at(&self, time: f64, names: &[&str]) -> Vec<f64> {
        let row = self.get("time").iter().position(|t| (t - time).abs() < 1e-9).unwrap();
        names.iter().map(|name| self.get(name)[row]).collect()
    }
}

/// Number and columns of finished runs.
type Kept = std::sync::Mutex<Vec<(u64, Vec<Vec<f64>>)>>;

struct Keep<'a>(&'a Kept, u64, Vec<Vec<f64>>);

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

pub fn folder() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("data/airplanes")
}

pub fn plan(document: &Value, times: Times) -> Result<Plan, String> {
    let document = FlightDocument::from_json(&document.to_string(), "flight.json").map_err(|e| e.to_string())?;
    Plan::new(&document, &folder(), &times).map_err(|e| e.to_string())
}

pub fn times(duration: f64, every: Option<f64>, step: Option<f64>) -> Times {
    Times { duration, every, step }
}

/// All runs in their order.
pub fn runs(document: &Value, times: Times, seed: u64, runs: u64) -> Result<Vec<Table>, String> {
    let plan = plan(document, times)?;
    let kept = Kept::new(Vec::new());
    fly(&plan, seed, runs, |run| Ok(Keep(&kept, run, Vec::new()))).map_err(|e: FlightError| e.to_string())?;
    let mut kept = kept.into_inner().unwrap();
    kept.sort_by_key(|(run, _)| *run);
    Ok(kept.into_iter().map(|(_, columns)| Table { names: plan.columns(), columns }).collect())
}

pub fn one(document: &Value, times: Times) -> Table {
    runs(document, times, 1, 1).unwrap().remove(0)
}

/// An airplane thrown into the air with its controls fixed: all axes move.
pub fn thrown() -> Value {
    json!({
        "format": "kfdesign-flight/1",
        "airplane": "aerosonde.json",
        "initial": {
            "altitude": "100 m", "u": "25 m/s", "v": "1 m/s", "w": "1.5 m/s",
            "phi": "10 deg", "theta": "5 deg", "psi": "30 deg",
            "p": "0.2 rad/s", "q": "-0.1 rad/s", "r": "0.1 rad/s"
        },
        "controls": { "elevator": "-0.14 rad", "aileron": "0.02 rad", "rudder": "-0.01 rad", "throttle": "0.8" }
    })
}

pub fn over_wgs84(mut document: Value) -> Value {
    document["earth"] = json!({ "wgs84": { "latitude": "48.7 deg", "longitude": "21.25 deg" } });
    document
}

pub fn level() -> Value {
    json!({
        "format": "kfdesign-flight/1",
        "airplane": "aerosonde.json",
        "trim": { "airspeed": "25 m/s", "altitude": "100 m" }
    })
}

/// Differences below `tolerance` each.
pub fn near(found: &[f64], expected: &[f64], tolerance: f64) {
    assert_eq!(found.len(), expected.len());
    for (f, e) in found.iter().zip(expected) {
        assert!((f - e).abs() < tolerance, "{found:?} against {expected:?}");
    }
}

pub const PLACE: [&str; 3] = ["north", "east", "down"];
pub const VELOCITY: [&str; 3] = ["u", "v", "w"];
pub const ANGLES: [&str; 3] = ["phi", "theta", "psi"];
pub const RATES: [&str; 3] = ["p", "q", "r"];

/// Level flight at 25 m/s and 100 m.
pub fn trim() -> Trim {
    let airplane = Airplane::read(&folder().join("aerosonde.json")).unwrap();
    let request = TrimRequest {
        airspeed: 25.0,
        altitude: 100.0,
        climb: 0.0,
        turn: Turn::Rate(0.0),
        sideways: Sideways::ZeroSideslip,
    };
    airplane.trim(&request).unwrap()
}

/// The airplane's document, to be changed.
pub fn aerosonde() -> Value {
    serde_json::from_str(&std::fs::read_to_string(folder().join("aerosonde.json")).unwrap()).unwrap()
}

/// Parameters of a sensor on every axis without any noise to speak of.
pub fn quiet(quantity: &str, unit: &str) -> Value {
    json!({
        "format": "kfdesign-params/1", "quantity": quantity, "sample_rate": "100 Hz",
        "axes": [{ "name": "x", "white": { "density": format!("1e-30 {unit}/sqrt(Hz)") } }]
    })
}
