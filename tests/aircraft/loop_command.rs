//! `kfdesign loop` as a user has it: verdict, exit status, documents, and what is refused.

use serde_json::{Value, json};

use super::closed_loop::{MODERATE, TIGHT, flight, gyro, judged, low};
use crate::params::accepts;
use crate::support::{Bench, data};

fn feeds() -> Value {
    json!([{ "type": "raw" }, low(2, 10.0), low(1, 10.0), { "type": "drift" }, { "type": "airframe" }])
}

/// Not worse than raw by more than 10 % in what section 1 of the sheet names.
fn criteria() -> Value {
    let other = json!({ "not_worse_than": { "feed": "raw", "by": "10 %" } });
    json!({ "disk_margin": other, "damping": other })
}

fn document(gains: [f64; 5]) -> Value {
    let mut document = flight(gains, "15 kt", feeds());
    document["criteria"] = criteria();
    document
}

/// Names of criteria and surfaces that a feed does not keep.
fn failed(document: &Value, feed: &str) -> Vec<String> {
    let judged = judged(document);
    let own = judged.document.criteria.iter().filter(|c| c.feed == feed && !c.pass);
    own.map(|c| format!("{} {}", c.name, c.surface)).collect()
}

/// What the sheet calls true: a low-pass of 10 Hz with tight gains fails in damping and disk margin.
#[test]
fn a_low_pass_with_tight_gains_fails() {
    let failed = failed(&document(TIGHT), "LP2 10 Hz");
    for expected in ["disk_margin elevator", "damping pitch", "damping roll_yaw"] {
        assert!(failed.iter().any(|f| f == expected), "{failed:?}");
    }
}

/// The drift filter leaves the loop as it is, and takes the offset away.
#[test]
fn the_drift_filter_passes() {
    for gains in [MODERATE, TIGHT] {
        let mut document = document(gains);
        document["criteria"]["offset"] = json!({ "at_most": "0.1 deg" });
        assert_eq!(failed(&document, "drift KF"), Vec::<String>::new());
        assert_eq!(failed(&document, "raw"), ["offset pitch", "offset roll_yaw"]);
    }
}

/// The airframe filter passes in pitch and fails in yaw.
#[test]
fn the_airframe_filter_passes_in_pitch_and_fails_in_yaw() {
    for gains in [MODERATE, TIGHT] {
        let failed = failed(&document(gains), "airframe KF");
        assert!(failed.iter().any(|f| f == "disk_margin rudder"), "{failed:?}");
        assert!(!failed.iter().any(|f| f.contains("pitch") || f.contains("elevator")), "{failed:?}");
    }
}

/// The report says that white noise stays, and what a filter makes worse.
#[test]
fn notes_say_what_a_filter_does_not_do() {
    let notes = judged(&document(MODERATE)).document.notes.join("\n");
    assert!(notes.contains("drift KF: does not lower the surface activity"), "{notes}");
    assert!(notes.contains("elevator rate 2.378 -> 2.377 deg/s"), "{notes}");
    let low = notes.lines().find(|line| line.starts_with("LP2 10 Hz")).unwrap();
    assert!(low.split("worse").nth(1).unwrap().contains("elevator rate 4.68"), "{low}");
}

#[test]
fn a_filter_for_calm_air_is_flagged() {
    let calm = json!({ "type": "airframe", "wind_at_20ft": "0.5 kt" });
    let feeds = json!([{ "type": "raw" }, calm, { "type": "airframe", "name": "own" }]);
    let warnings = judged(&flight(MODERATE, "30 kt", feeds)).document.warnings;
    let weak = |name: &str| warnings.iter().any(|w| w.starts_with(name) && w.contains("a large margin of a weak loop"));
    assert!(weak("airframe KF, pitch") && weak("airframe KF, roll and yaw"), "{warnings:?}");
    assert!(!warnings.iter().any(|w| w.starts_with("own") && w.contains("weak loop")), "{warnings:?}");
}

#[test]
fn a_filter_off_its_speed_is_flagged() {
    let mut document = flight(TIGHT, "15 kt", json!([{ "type": "raw" }, { "type": "airframe", "airspeed": "25 m/s" }]));
    assert!(!judged(&document).document.warnings.iter().any(|w| w.contains("designed for")));
    document["trim"]["airspeed"] = json!("30 m/s");
    let warnings = judged(&document).document.warnings;
    assert!(
        warnings.iter().any(|w| w.contains("designed for 25.00 m/s and flown at 30.00 m/s, faster")),
        "{warnings:?}"
    );
}

#[test]
fn a_slow_servo_is_flagged_in_severe_turbulence() {
    let mut document = flight(TIGHT, "15 kt", json!([{ "type": "raw" }]));
    let mut airplane: Value =
        serde_json::from_str(&std::fs::read_to_string(data("airplanes/aerosonde.json")).unwrap()).unwrap();
    airplane["actuators"]["elevator"]["rate_limit"] = json!("40 deg/s");
    document["airplane"] = airplane;
    let warnings = judged(&document).document.warnings;
    assert!(
        warnings.iter().any(|w| w.contains("elevator: in severe turbulence") && w.contains("saturates")),
        "{warnings:?}"
    );
    let usual = judged(&flight(TIGHT, "15 kt", json!([{ "type": "raw" }]))).document.warnings;
    assert!(!usual.iter().any(|w| w.contains("saturates")), "{usual:?}");
}

/// Surfaces that do more than modelled: of a loop with little gain to spare, and of a filter that knows the command.
#[test]
fn surfaces_that_do_more_are_flagged() {
    let feeds = json!([{ "type": "raw" }, low(2, 5.0), { "type": "airframe" }]);
    let warnings = judged(&flight(TIGHT, "15 kt", feeds)).document.warnings;
    let said = |start: &str, part: &str| warnings.iter().any(|w| w.starts_with(start) && w.contains(part));
    // 3.63 and 4.91 dB of the sheet
    assert!(said("LP2 5 Hz, elevator: a surface 51", "makes the loop oscillate"), "{warnings:?}");
    assert!(said("LP2 5 Hz, aileron: a surface 75", "makes the loop oscillate"), "{warnings:?}");
    assert!(said("airframe KF, pitch: with surfaces 25 % more effective", "falls from 0.592"), "{warnings:?}");
    assert!(!warnings.iter().any(|w| w.starts_with("raw")), "{warnings:?}");
}

/// A vibration line of the gyro rings as lightly as it likes: it is no motion of the airplane, and no damping is asked
/// of it.
#[test]
fn a_line_of_the_gyro_is_no_motion_of_the_airplane() {
    let mut document = flight(MODERATE, "15 kt", json!([{ "type": "raw" }, { "type": "airframe" }]));
    let least = |document: &Value| {
        let feeds = judged(document).document.feeds;
        feeds.iter().map(|feed| feed.pitch.least_damped.as_ref().unwrap().damping).collect::<Vec<_>>()
    };
    let quiet = least(&document);
    let mut gyro = gyro(1.0);
    for axis in gyro["axes"].as_array_mut().unwrap() {
        axis["oscillation"] = json!([{ "std_dev": "0.01 deg/s", "frequency": "17 Hz", "correlation_time": "10 s" }]);
    }
    document["sensors"]["gyro"] = gyro;
    let (loud, modes) = (least(&document), judged(&document).document.feeds[0].pitch.modes.len());
    assert!((loud[0] - quiet[0]).abs() < 1e-9 && (loud[1] - quiet[1]).abs() < 0.02, "{quiet:?} {loud:?}");
    let rings = |mode: &kfdesign::aircraft::closed_loop::document::LoopModeDocument| mode.damping.abs() < 1e-3;
    assert!(judged(&document).document.feeds[0].pitch.modes.iter().any(rings), "{modes}");
}

/// Optimal gains on estimates without recovery.
#[test]
fn lqg_is_flagged() {
    let mut document = flight(TIGHT, "15 kt", json!([{ "type": "raw" }, { "type": "airframe" }]));
    document["autopilot"] = json!({ "rate": "100 Hz", "delay": 1, "lqr": {
        "longitudinal": { "states": [0.01, 0.01, 1, 4], "elevator": 1 },
        "lateral": { "states": [0.01, 0.2, 1, 2], "aileron": 1, "rudder": 1 }
    } });
    let warnings = judged(&document).document.warnings;
    assert!(
        warnings.iter().any(|w| w.starts_with("airframe KF: optimal gains") && w.contains("Doyle")),
        "{warnings:?}"
    );
}

fn bench(document: &Value) -> Bench {
    let bench = Bench::new();
    bench.file("flight.json", document.to_string());
    bench
}

#[test]
fn exit_status_follows_the_verdict() {
    let bench = bench(&document(TIGHT));
    let out = bench.run("loop flight.json --junit loop.xml -o loop.json --report loop.html");
    assert_eq!(out.status, 1, "{out:?}");
    assert!(out.stdout.contains("FAIL"), "{out:?}");
    let xml = bench.read("loop.xml");
    assert!(xml.contains("<testsuite name=\"feed LP2 10 Hz\"") && xml.contains("<failure"), "{xml}");
    let found: Value = serde_json::from_str(&bench.read("loop.json")).unwrap();
    assert_eq!((found["format"].as_str(), found["verdict"].as_str()), (Some("kfdesign-loop/1"), Some("fail")));
    let page = bench.read("loop.html");
    for figure in
        ["Pitch: poles", "Loop gain of the elevator", "Sensitivity of the rudder", "Disk margin of the aileron"]
    {
        assert!(page.contains(figure), "{figure}");
    }
    let mut kept = document(TIGHT);
    kept["feeds"] = json!([{ "type": "raw" }, { "type": "drift" }]);
    bench.file("kept.json", kept.to_string());
    bench.ok("loop kept.json");
}

#[test]
fn the_document_is_what_its_schema_says() {
    let bench = bench(&document(MODERATE));
    let schema: Value = serde_json::from_str(&bench.ok("schema loop")).unwrap();
    let out = bench.run("loop flight.json --sweep delay --json");
    let found: Value = serde_json::from_str(&out.stdout).unwrap();
    accepts(&schema, &schema, &found).unwrap();
    assert_eq!(found["sweep"]["points"].as_array().unwrap().len(), 6);
    bench.ok("schema loop-request");
}

/// Another airplane, speed and gust under the same gains and filters.
#[test]
fn another_truth() {
    let mut bench_document = document(MODERATE);
    bench_document["criteria"] = Value::Null;
    bench_document.as_object_mut().unwrap().remove("criteria");
    let bench = bench(&bench_document);
    let mut other = bench_document.clone();
    other["gusts"]["wind_at_20ft"] = json!("30 kt");
    other["sensors"]["gyro"] = gyro(10.0);
    bench.file("other.json", other.to_string());
    let found: Value = serde_json::from_str(&bench.ok("loop flight.json --truth other.json --json")).unwrap();
    let rate = &found["feeds"][0]["pitch"]["rms"]["elevator_rate"];
    // twice the wind, ten times the noise of the table
    assert!((rate["gust"].as_f64().unwrap() - 2.0 * 3.899).abs() < 4e-3, "{rate}");
    assert!((rate["gyro_white"].as_f64().unwrap() - 23.78).abs() < 0.02, "{rate}");
}

/// Filters by their files: the drift filter of `tune` is the one that is made here.
#[test]
fn a_drift_filter_of_tune() {
    let bench = Bench::new();
    let mut params = gyro(1.0);
    params["design"] = json!({ "plant": "angle", "initial_std_dev": "57.29577951308232 deg", "aids": [
        { "name": "heading", "std_dev": "2 deg", "rate": "1 Hz" }
    ] });
    bench.file("params.json", params.to_string());
    bench.ok("tune params.json --runs 20 -o filter.json");
    let feeds =
        json!([{ "type": "drift", "name": "made" }, { "type": "drift", "filter": "filter.json", "name": "read" }]);
    bench.file("flight.json", flight(MODERATE, "15 kt", feeds).to_string());
    let found: Value = serde_json::from_str(&bench.ok("loop flight.json --json")).unwrap();
    for name in ["q", "theta", "elevator_rate"] {
        let [made, read] = [0, 1].map(|i| found["feeds"][i]["pitch"]["rms"][name]["all"].as_f64().unwrap());
        assert!((made / read - 1.0).abs() < 1e-6, "{name}: {made}, {read}");
    }
    // the sheet: with an aid of 2 deg at 1 Hz the whole drift is known to 0.18 deg/s after 10 s, to 0.018 after 100 s
    let known = &found["feeds"][1]["pitch"]["known"][0];
    for (key, expected) in [("after_10_s", 0.18), ("after_100_s", 0.018)] {
        assert!((known[key].as_f64().unwrap() / expected - 1.0).abs() < 0.15, "{known}");
    }
}

#[test]
fn sweeps_say_where_the_best_filter_changes() {
    let bench = bench(&document(TIGHT));
    for what in ["lowpass", "noise", "airspeed", "gust", "gain"] {
        let out = bench.run(&format!("loop flight.json --sweep {what} --json"));
        let found: Value = serde_json::from_str(&out.stdout).unwrap_or_else(|_| panic!("{what}: {out:?}"));
        let points = found["sweep"]["points"].as_array().unwrap();
        assert!(points.iter().filter(|p| p["feeds"].as_array().unwrap().len() == 5).count() >= 4, "{what}: {found}");
    }
    // the louder the gyro, the less the raw one is worth
    let mut limits = document(TIGHT);
    limits["criteria"] = json!({ "damping": { "at_least": 0.4 } });
    bench.file("noise.json", limits.to_string());
    let found: Value = serde_json::from_str(&bench.run("loop noise.json --sweep noise --json").stdout).unwrap();
    let best = |i: usize| found["sweep"]["points"][i]["best"].as_str().unwrap().to_string();
    assert!(best(0) != "airframe KF" && best(6) == "airframe KF", "{} {}", best(0), best(6));
    assert!(!found["sweep"]["changes"].as_array().unwrap().is_empty());
}

#[test]
fn a_spread_counts_what_is_kept() {
    let mut document = document(MODERATE);
    document["criteria"] = json!({ "disk_margin": { "at_least": 0.5 } });
    document["uncertainty"] = json!({ "aerodynamics": "10 %", "mass": "3 %", "inertia": 0.05, "servo": "10 %" });
    let bench = bench(&document);
    let run = || bench.ok("loop flight.json --spread 40 --seed 3 --json");
    let found: Value = serde_json::from_str(&run()).unwrap();
    let kept = found["spread"]["kept"].as_array().unwrap();
    let stable = kept.iter().find(|k| k["feed"] == "raw" && k["criterion"] == "stable").unwrap();
    assert_eq!(stable["share"], 1.0);
    assert!(stable["lower"].as_f64().unwrap() > 0.9);
    // moderate gains have a disk margin of 1.219 in pitch: one of 1.2 is kept by some of the drawn airplanes
    document["criteria"] = json!({ "disk_margin": { "at_least": 1.2 } });
    bench.file("some.json", document.to_string());
    let some: Value = serde_json::from_str(&bench.run("loop some.json --spread 40 --seed 3 --json").stdout).unwrap();
    let kept = some["spread"]["kept"].as_array().unwrap();
    let share = kept.iter().find(|k| k["feed"] == "raw" && k["criterion"] == "disk margin at least of elevator");
    assert!((0.2..0.98).contains(&share.unwrap()["share"].as_f64().unwrap()), "{share:?}");
    assert_eq!(found, serde_json::from_str::<Value>(&run()).unwrap(), "a seed is a result");
    document["uncertainty"] = json!({});
    bench.file("sure.json", document.to_string());
    let out = bench.run("loop sure.json --spread 40");
    assert!(out.status == 2 && out.stderr.contains("uncertainty: nothing to draw"), "{out:?}");
}

/// One line each: file, key, found, expected, remedy.
#[test]
fn what_is_refused() {
    let good = document(TIGHT);
    let with = |pointer: &str, value: Value| {
        let mut document = good.clone();
        *document.pointer_mut(pointer).unwrap() = value;
        document
    };
    let four_times = json!({ "kq": "1.2 s", "ktheta": 4.0, "kp": "0.12 s", "kphi": 0.9, "kr": "0.3 s" });
    let slow = json!({ "not_worse_than": "nobody" });
    for (document, said) in [
        (with("/sensors/gyro/sample_rate", json!("200 Hz")), vec!["sensors.gyro: 200.0 Hz", "100.0 Hz", "give"]),
        (with("/sensors/attitude", json!({ "white": "2 deg", "rate": "10 Hz" })), vec!["sensors.attitude", "every 10"]),
        (with("/feeds/1/corner", json!("60 Hz")), vec!["feeds[1].corner", "60.00 Hz", "below half the 100.0 Hz"]),
        (with("/feeds/1/order", json!(3)), vec!["feeds[1].order", "found 3", "1 or 2"]),
        (
            with("/autopilot/gains", four_times),
            vec!["feed 'raw'", "the loop of pitch is unstable", "rad/s grows, damping -"],
        ),
        (
            with("/criteria/damping", json!({ "at_least": 0.5, "at_most": 0.3 })),
            vec!["criteria.damping", "contradicts"],
        ),
        (with("/criteria/damping", slow), vec!["criteria.damping.not_worse_than", "nobody", "there are raw"]),
        (with("/criteria/damping", json!({})), vec!["criteria.damping", "no limit"]),
        (
            with("/autopilot/gains/kq", json!("-0.3 s")),
            vec!["autopilot.gains.kq", "drives the pitch rate on", "positive"],
        ),
        (with("/autopilot/gains/kphi", json!(-0.9)), vec!["autopilot.gains.kphi", "bank angle", "positive"]),
        (with("/autopilot/delay", json!(100_000)), vec!["autopilot.delay", "100000 samples", "at most 100"]),
        (with("/autopilot/rate", json!("1 MHz")), vec!["autopilot.rate", "found 1.000e6 Hz", "at most 40000 Hz"]),
        (with("/trim/airspeed", json!("12 m/s")), vec!["trim", "no elevator"]),
        (with("/trim/airspeed", json!("60 m/s")), vec!["trim", "no thrust"]),
        (with("/feeds/2", json!({ "type": "raw" })), vec!["feeds[2]", "'raw' is the name of feeds[0] too"]),
        (with("/feeds/2", json!({ "type": "notch" })), vec!["feeds[2].frequency", "missing"]),
        (
            with("/feeds/2", json!({ "type": "drift", "name": "other", "filter": "no.json" })),
            vec!["feeds[2].filter", "no.json", "cannot read"],
        ),
    ] {
        let bench = bench(&document);
        let out = bench.run("loop flight.json");
        assert_eq!(out.status, 2, "{said:?}: {out:?}");
        assert_eq!(out.stderr.trim().lines().count(), 1, "{out:?}");
        for words in said.iter().chain(&["flight.json"]) {
            assert!(out.stderr.contains(words), "{words}: {}", out.stderr);
        }
    }
}

/// A filter of another gyro or rate.
#[test]
fn a_filter_of_another_sensor_is_refused() {
    for (params, said) in [
        (gyro(5.0), vec!["feeds[0].filter", "made for a gyro of 0.2810", "0.05620"]),
        (
            {
                let mut slow = gyro(1.0);
                slow["sample_rate"] = json!("50 Hz");
                slow
            },
            vec!["feeds[0].filter", "50.00 Hz", "100.0 Hz"],
        ),
    ] {
        let bench = Bench::new();
        let mut params = params;
        let rate = params["sample_rate"].clone();
        params["design"] = json!({ "plant": "angle", "initial_std_dev": "10 deg", "aids": [
            { "name": "heading", "std_dev": "20 deg", "rate": rate }
        ] });
        bench.file("params.json", params.to_string());
        bench.run("tune params.json --runs 20 -o filter.json");
        let feeds = json!([{ "type": "drift", "filter": "filter.json" }]);
        bench.file("flight.json", flight(MODERATE, "15 kt", feeds).to_string());
        let out = bench.run("loop flight.json");
        assert_eq!(out.status, 2, "{out:?}");
        for words in said {
            assert!(out.stderr.contains(words), "{words}: {}", out.stderr);
        }
    }
}
