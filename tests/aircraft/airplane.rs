//! `kfdesign airplane` and `kfdesign trim` as a user has them: documents, views, and what is refused in one line.

use kfdesign::aircraft::airframe::Airplane;
use kfdesign::aircraft::airframe::trim::{Sideways, TrimRequest, Turn};
use serde_json::{Value, json};

use crate::support::{Bench, data};

fn document(name: &str) -> Value {
    serde_json::from_str(&std::fs::read_to_string(data(&format!("airplanes/{name}.json"))).unwrap()).unwrap()
}

fn bench() -> Bench {
    let bench = Bench::new();
    bench.file("airplane.json", document("aerosonde").to_string());
    bench
}

/// Exit status 2 and one line with these words.
fn refused(bench: &Bench, args: &[&str], words: &[&str]) {
    let out = bench.run_args(args);
    assert_eq!(out.status, 2, "{args:?}: {} {}", out.stdout, out.stderr);
    assert_eq!(out.stderr.trim_end().lines().count(), 1, "{args:?}: {}", out.stderr);
    for word in words {
        assert!(out.stderr.contains(word), "{args:?}: no '{word}' in {}", out.stderr);
    }
}

fn trim<'a>(speed: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    [&["trim", "airplane.json", "--speed", speed, "--altitude", "100 m"], more].concat()
}

#[test]
fn level_flight_ends_where_the_sheet_says() {
    let bench = bench();
    let out = bench.run_args(&["airplane", "airplane.json", "--altitude", "100 m", "--json", "--plot", "speeds.svg"]);
    assert_eq!(out.status, 0, "{}", out.stderr);
    let check: Value = serde_json::from_str(&out.stdout).unwrap();
    let range = &check["level_flight"];
    // elevator at its stop of 25 deg below, full throttle above
    assert!((range["slowest"].as_f64().unwrap() - 17.164588).abs() < 1e-5, "{range}");
    assert!((range["fastest"].as_f64().unwrap() - 32.434619).abs() < 1e-5, "{range}");
    assert_eq!(range["slowest_limit"], "elevator");
    assert_eq!(range["fastest_limit"], "thrust");
    assert!((check["static_margin"].as_f64().unwrap() - 2.74 / 5.61).abs() < 1e-12);
    let warnings = check["warnings"].to_string();
    assert!(warnings.contains("static margin 0.488") && warnings.contains("stall angle 26.9"), "{warnings}");
    assert!(bench.read("speeds.svg").contains("Drag and thrust"));
    let text = bench.ok("airplane airplane.json");
    assert!(text.contains("ended by elevator") && text.contains("ended by thrust"), "{text}");
}

/// At half the throttle the air turns this propeller from 17.7 m/s on, and its thrust is the same at any setting.
#[test]
fn flight_faster_than_half_the_throttle_is_found() {
    let file = data("airplanes/ultrastick-25e-propeller.json").display().to_string();
    let check: Value = serde_json::from_str(&bench().ok(&format!("airplane {file} --json"))).unwrap();
    let range = &check["level_flight"];
    assert_eq!(range["fastest_limit"], "thrust", "{range}");
    assert!(range["fastest"].as_f64().unwrap() > 22.0, "{range}");
}

/// Measured inertias may miss the triangle by a little: read with a warning; by more than a percent they are refused.
#[test]
fn published_inertias_that_miss_the_triangle_are_warned_of() {
    let text = Bench::new().ok(&format!("airplane {}", data("airplanes/ultrastick-25e.json").display()));
    assert!(text.contains("largest principal moment is 0.3 % above the sum"), "{text}");
    let text = Bench::new().ok(&format!("airplane {}", data("airplanes/aerosonde.json").display()));
    assert!(!text.contains("principal moment is"), "{text}");
    let bench = Bench::new();
    let mut more = document("ultrastick-25e");
    more["inertia"]["zz"] = json!("0.156 kg m^2");
    bench.file("airplane.json", more.to_string());
    refused(&bench, &["airplane", "airplane.json"], &["airplane.json: inertia", "belong to no body"]);
}

#[test]
fn trim_writes_one_document_and_a_page() {
    let bench = bench();
    let out =
        bench.run_args(&trim("25 m/s", &["-o", "linear.json", "--report", "page.html", "--json", "--froude", "3.8"]));
    assert_eq!(out.status, 0, "{}", out.stderr);
    assert_eq!(out.stdout, bench.read("linear.json"));
    let linear: Value = serde_json::from_str(&out.stdout).unwrap();
    assert_eq!(linear["format"], "kfdesign-linear/1");
    assert!((linear["trim"]["elevator"].as_f64().unwrap() + 0.135469407).abs() < 1e-8);
    assert_eq!(linear["models"]["full"]["A"].as_array().unwrap().len(), 8);
    let page = bench.read("page.html");
    assert!(page.contains("Poles") && page.contains("Response to aileron 1 deg"), "page");
    let text = bench.run_args(&trim("25 m/s", &[])).stdout;
    assert!(text.contains("short period") && text.contains("Caution"), "{text}");
}

#[test]
fn flight_that_is_not_possible_is_refused_by_what_is_missing() {
    let bench = bench();
    refused(&bench, &trim("33 m/s", &[]), &["no thrust", "throttle"]);
    refused(&bench, &trim("17 m/s", &[]), &["no elevator", "stops"]);
    refused(&bench, &trim("8 m/s", &[]), &["no lift"]);
    refused(&bench, &trim("20 m/s", &["--bank", "80 deg"]), &["no lift", "bank"]);
    refused(&bench, &trim("25 m/s", &["--climb", "20 deg"]), &["no thrust"]);
    refused(&bench, &trim("25 m", &[]), &["--speed 25 m", "a velocity"]);
    refused(&bench, &trim("25 m/s", &["--bank", "10 deg", "--lateral", "wings_level"]), &["two angles of bank"]);
    refused(&bench, &["trim", "airplane.json", "--speed", "25 m/s"], &["--altitude"]);
    // 25 m/s needs 3.1 deg
    let mut early = document("aerosonde");
    early["aerodynamics"]["stall"]["angle"] = json!("2 deg");
    bench.file("airplane.json", early.to_string());
    refused(&bench, &trim("25 m/s", &[]), &["no lift", "stall"]);
    bench.file("airplane.json", document("aerosonde").to_string());
    refused(&bench, &["trim", "airplane.json", "--speed", "25 m/s", "--altitude", "30 km"], &["standard atmosphere"]);
}

/// Where no setting of the throttle is a solution: a descent steeper than the drag of a propeller at rest allows, and a
/// speed at which the air turns the propeller at any.
#[test]
fn what_is_missing_is_named_where_there_is_no_solution() {
    refused(&bench(), &trim("25 m/s", &["--climb", "-30 deg"]), &["no brake", "descend less"]);
    let file = data("airplanes/ultrastick-25e-propeller.json").display().to_string();
    let fast = ["trim", &file, "--speed", "45 m/s", "--altitude", "100 m"];
    refused(&bench(), &fast, &["no thrust", "there are 0.0 N at full throttle"]);
}

/// The elevator of this airplane holds its wing down near the stall, where Newton's method fails: what is missing is
/// lift, at every speed below the slowest.
#[test]
fn what_ends_slow_flight_is_lift() {
    let mut document = document("ultrastick-25e");
    document["aerodynamics"]["stall"] = json!({ "sharpness": "40", "angle": "13 deg" });
    document["aerodynamics"]["lift"]["elevator"] = json!("0.8 1/rad");
    let airplane = Airplane::from_json(&document.to_string(), "made up").unwrap();
    let trim = |airspeed: f64| {
        let (turn, sideways) = (Turn::Rate(0.0), Sideways::ZeroSideslip);
        airplane.trim(&TrimRequest { airspeed, altitude: 0.0, climb: 0.0, turn, sideways })
    };
    let missing: Vec<_> = (0..100).map(|i| trim(8.0 + 0.05 * f64::from(i)).map_err(|e| e.missing).err()).collect();
    let slowest = missing.iter().position(Option::is_none).unwrap();
    assert!((20..90).contains(&slowest), "{missing:?}");
    assert!(missing[..slowest].iter().all(|m| *m == Some("lift")), "{missing:?}");
    assert!(missing[slowest..].iter().all(Option::is_none), "{missing:?}");
}

#[test]
fn a_wrong_document_is_refused_by_its_key() {
    let bench = bench();
    let wrong = |change: &dyn Fn(&mut Value), words: &[&str]| {
        let mut document = document("aerosonde");
        change(&mut document);
        bench.file("wrong.json", document.to_string());
        refused(&bench, &["airplane", "wrong.json"], words);
    };
    wrong(&|d| d["mass"] = json!("-11 kg"), &["wrong.json", "mass"]);
    wrong(&|d| d["mass"] = json!("11 m"), &["mass", "a length"]);
    wrong(&|d| d["mass"] = json!(11), &["mass", "no unit"]);
    wrong(&|d| d["inertia"]["zz"] = json!("5 kg m^2"), &["inertia", "principal moments"]);
    wrong(&|d| d["aerodynamics"]["lift"]["alpha"] = json!(5.61), &["aerodynamics.lift.alpha", "1/rad"]);
    wrong(
        &|d| {
            d["aerodynamics"]["yaw"].as_object_mut().unwrap().remove("beta");
        },
        &["aerodynamics.yaw.beta", "missing", "would mean that sideslip makes no yawing moment"],
    );
    for (key, value) in [("frequency", "0 rad/s"), ("damping", "0"), ("rate_limit", "-1 rad/s")] {
        wrong(&|d| d["actuators"]["rudder"][key] = json!(value), &["actuators.rudder", key, "more than zero"]);
    }
    wrong(&|d| d["actuators"]["rudder"]["delay"] = json!("-1 ms"), &["actuators.rudder.delay", "zero or more"]);
    wrong(&|d| d["actuators"]["rudder"]["limit"] = json!("-5 deg"), &["actuators.rudder", "lower stop"]);
    wrong(&|d| d["aerodynamics"]["stall"]["sharpness"] = json!("-5"), &["stall.sharpness", "more than zero"]);
    wrong(&|d| d["reference"]["chord"] = json!("0 m"), &["reference.chord", "more than zero"]);
    wrong(&|d| d["aerodynamics"]["pitch"]["alhpa"] = json!("1 1/rad"), &["alhpa", "did you mean 'alpha'"]);
}

#[test]
fn a_linear_model_is_a_plant_for_tune() {
    let bench = bench();
    assert_eq!(bench.run_args(&trim("25 m/s", &["-o", "linear.json"])).status, 0);
    let params = data("params.json").display().to_string();
    for (plant, state) in [("linear.json", "theta"), ("linear.json#p", "phi")] {
        let out = bench.run_args(&["tune", &params, "--plant", plant, "-o", "filter.json", "--runs", "20"]);
        assert!(out.status < 2, "{plant}: {}", out.stderr);
        if out.status == 0 {
            assert!(bench.read("filter.json").contains(state), "{plant}");
        }
    }
    let out = bench.run_args(&["tune", &params, "--plant", "linear.json#phi"]);
    assert!(out.status == 2 && out.stderr.contains("known are q, p, r"), "{}", out.stderr);
}
