//! airplane.json and flight.json against their published schemas: what one refuses, the other does.

use std::path::PathBuf;

use kfdesign::aircraft::airframe::Airplane;
use kfdesign::aircraft::flight::FlightDocument;
use serde_json::{Value, json};

use crate::params::accepts;
use crate::support::{Bench, data};

fn shipped(folder: &str) -> Vec<(PathBuf, Value)> {
    let files = std::fs::read_dir(data(folder)).unwrap().map(|e| e.unwrap().path());
    let json = files.filter(|p| p.extension().is_some_and(|e| e == "json"));
    let read = |p: PathBuf| {
        let value = serde_json::from_str(&std::fs::read_to_string(&p).unwrap()).unwrap();
        (p, value)
    };
    let all: Vec<(PathBuf, Value)> = json.map(read).collect();
    assert!(!all.is_empty());
    all
}

/// The pointers of all values inside, without those of documents of another kind.
fn places(value: &Value, at: &str, out: &mut Vec<String>) {
    out.push(at.to_string());
    match value {
        Value::Object(map) => map.iter().for_each(|(key, value)| places(value, &format!("{at}/{key}"), out)),
        Value::Array(list) => (0..).zip(list).for_each(|(i, value)| places(value, &format!("{at}/{i}"), out)),
        _ => {}
    }
}

/// Each document as it is, without each key, with a key more in each object, and with another type at each place:
/// schema and reader agree.
fn agree(name: &str, documents: &[Value], reads: impl Fn(&str) -> Result<(), String>) {
    let schema: Value = serde_json::from_str(&Bench::new().ok(&format!("schema {name}"))).unwrap();
    let check = |value: &Value, changed: &str| {
        let (by_schema, by_reader) = (accepts(&schema, &schema, value), reads(&value.to_string()));
        assert_eq!(by_schema.is_ok(), by_reader.is_ok(), "{name}, {changed}: {by_schema:?}, {by_reader:?}");
        by_reader.is_ok()
    };
    for document in documents {
        assert!(check(document, "as it is"), "{:?}", reads(&document.to_string()));
        let mut all = Vec::new();
        places(document, "", &mut all);
        let mut refused = 0;
        for at in &all {
            let mut other = document.clone();
            *other.pointer_mut(at).unwrap() = json!(true);
            refused += u32::from(!check(&other, &format!("true at {at}")));
            let mut more = document.clone();
            if let Some(object) = more.pointer_mut(at).unwrap().as_object_mut() {
                object.insert("another".into(), json!("1 m"));
                assert!(!check(&more, &format!("another key at {at}")));
            }
            let (parent, key) = at.rsplit_once('/').unwrap_or_default();
            let mut less = document.clone();
            if let Some(object) = less.pointer_mut(parent).unwrap().as_object_mut() {
                object.remove(key);
                check(&less, &format!("without {at}"));
            }
        }
        assert_eq!(refused as usize, all.len(), "{name}");
    }
}

#[test]
fn airplanes_are_what_their_schema_says() {
    let mut all: Vec<Value> = shipped("airplanes").into_iter().map(|(_, value)| value).collect();
    let mut full = all[0].clone();
    full["positions"] = json!({ "accelerometer": ["0.1 m", "0 m", { "value": 0, "unit": "m" }] });
    full["actuators"] = json!({ "rudder": { "frequency": "30 rad/s", "damping": 1, "limit": ["-10 deg", "20 deg"] } });
    all.push(full);
    agree("airplane", &all, |text| Airplane::from_json(text, "airplane").map(|_| ()).map_err(|e| e.to_string()));
}

#[test]
fn flights_are_what_their_schema_says() {
    let mut all: Vec<Value> = shipped("flights").into_iter().map(|(_, value)| value).collect();
    let mut other = all[0].clone();
    other["controls"] = json!({ "elevator": "-7 deg", "throttle": "0.8" });
    other["earth"] = json!({ "wgs84": { "latitude": "48 deg", "longitude": "21 deg", "heading": "10 deg" } });
    other["wind"] = json!({ "north": "3 m/s" });
    other["initial"] = json!({ "altitude": "100 m", "u": "25 m/s" });
    other["gusts"] = json!([other["gusts"], { "model": "1-cos", "form": "hold", "length": "25 m", "w": "-3 m/s" }]);
    other["autopilot"]["delay"] = json!(2);
    let mut optimal = other.clone();
    optimal["gusts"] =
        json!({ "model": "dryden", "specification": "MIL-HDBK-1797", "exceedance": "1e-3", "height": "1 km" });
    optimal["autopilot"] = json!({ "rate": "100 Hz", "lqr": {
        "longitudinal": { "states": [0.01, "0.01", 1, 4], "elevator": 1 },
        "lateral": { "states": [0.01, 0.2, 1, 2], "aileron": 1, "rudder": "1" }
    } });
    let mut designed = all[0].clone();
    designed["autopilot"] = json!({ "rate": "100 Hz", "rule": {
        "short_period_damping": 0.6, "dutch_roll_damping": "0.7", "washout": "1 s",
        "pitch_crossover": "1 rad/s", "bank_crossover": "2 rad/s", "bank_lead": "0.1 s"
    } });
    designed["feeds"] = json!([
        { "type": "lqg", "longitudinal": { "states": [0.01, 0.01, 1, 4], "elevator": 1 },
          "lateral": { "states": [0.01, 0.2, 1, 2], "aileron": 1, "rudder": 1 }, "recovery": "1 deg" },
        { "type": "airframe", "schedule": ["20 m/s", "25 m/s"], "lowpass": { "order": 1, "corner": "20 Hz" } },
        { "type": "airframe", "name": "file", "filter": "filter.json" }
    ]);
    designed["optimize"] =
        json!({ "surface_rate": 1, "attitude": "0.5", "margins_lost": "5 %", "held_out_wind": "30 kt" });
    all.extend([other, optimal, designed]);
    agree("flight", &all, |text| FlightDocument::from_json(text, "flight").map(|_| ()).map_err(|e| e.to_string()));
}

/// What the shipped documents name is there.
#[test]
fn shipped_flights_can_be_planned() {
    for (path, _) in shipped("flights") {
        Bench::new().ok(&format!("fly {} --duration 1s", path.display()));
    }
}
