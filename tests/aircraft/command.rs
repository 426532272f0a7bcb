//! `kfdesign fly` as a user has it: logs that other commands read, and what is refused.

use serde_json::{Value, json};

use super::flights::level;
use crate::support::{Bench, data};

fn document() -> Value {
    let mut document = level();
    document["airplane"] = json!(data("airplanes/aerosonde.json"));
    document["gusts"] = json!({ "model": "dryden", "specification": "MIL-F-8785C", "wind_at_20ft": "15 kt" });
    document["sensors"] = json!({ "gyro": data("params.json"), "accelerometer": {
        "format": "kfdesign-params/1", "quantity": "specific-force", "sample_rate": "100 Hz",
        "axes": [{ "name": "x", "white": { "density": "0.002 m/s^2/sqrt(Hz)" } }]
    } });
    document["autopilot"] = json!({
        "rate": "100 Hz", "delay": 1,
        "gains": { "kq": "0.2 s", "ktheta": 0.6, "kp": "0.06 s", "kphi": 0.6, "kr": "0.15 s", "washout": "1 s" }
    });
    document
}

fn bench() -> Bench {
    let bench = Bench::new();
    bench.file("flight.json", document().to_string());
    bench
}

#[test]
fn the_log_is_one_that_the_other_commands_read() {
    let bench = bench();
    let params = data("params.json").display().to_string();
    bench.ok("fly flight.json -o flight.csv --duration 120s");
    // an airplane in gusts is not at rest: found, written, and exit 1
    for columns in ["gyro_x,gyro_y,gyro_z", "accel_x,accel_y,accel_z"] {
        let out = bench.run(&format!("identify flight.csv --columns {columns} --method allan -o found.json"));
        assert!(out.status == 1 && out.stderr.contains("not at rest"), "{out:?}");
    }
    bench.ok(&format!("tune {params} -o filter.json"));
    // a gyro in flight is not the gyro at rest: both verdicts may be against it, but they are verdicts
    for command in [
        "replay filter.json flight.csv --columns gyro_x,gyro_y,gyro_z --json".to_string(),
        format!("compare {params} flight.csv --columns gyro_x,gyro_y,gyro_z --json"),
        format!("inflate {params} flight.csv --columns gyro_x,gyro_y,gyro_z -o loud.json --json"),
    ] {
        let out = bench.run(&command);
        assert!(out.status < 2, "{command}: {out:?}");
    }
}

#[test]
fn every_format_holds_the_same_rows_and_runs_have_files_of_their_own() {
    let bench = bench();
    for name in ["a.csv", "b.csv.gz", "c.npy"] {
        bench.ok(&format!("fly flight.json -o {name} --duration 1s --seed 5"));
    }
    let text = bench.read("a.csv");
    assert_eq!(text.lines().count(), 102);
    let header = "time (s),north (m),east (m),down (m),u (m/s),v (m/s),w (m/s),phi (rad),theta (rad),psi (rad),\
                  p (rad/s),q (rad/s),r (rad/s),elevator (rad),aileron (rad),rudder (rad),throttle,gust_u (m/s)";
    assert!(text.starts_with(header));
    assert!(text.lines().last().unwrap().starts_with("1,"));
    let report: Value =
        serde_json::from_str(&bench.ok("fly flight.json -o r.csv --duration 1s --seed 5 --runs 3 --json")).unwrap();
    assert_eq!(report["format"], "kfdesign-fly/1");
    assert_eq!(report["runs"].as_array().unwrap().len(), 3);
    assert_eq!(report["runs"][2]["log"], "r-2.csv");
    assert!(bench.read("r-0.csv") == text && bench.read("r-1.csv") != text);
    let rows = bench.ok("fly flight.json --duration 1s --every 0.25s --json");
    assert!(rows.contains("\"rows\": 5"));
}

#[test]
fn what_cannot_be_flown_is_refused_in_one_line() {
    let change = |key: &str, value: Value| {
        let mut document = document();
        document[key] = value;
        document
    };
    let trim = |altitude: &str, airspeed: &str| change("trim", json!({ "airspeed": airspeed, "altitude": altitude }));
    let mut quiet = document();
    quiet.as_object_mut().unwrap().remove("autopilot");
    let dryden = |more: Value| {
        let mut gust = json!({ "model": "dryden", "specification": "MIL-F-8785C", "wind_at_20ft": "15 kt" });
        gust.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
        change("gusts", gust)
    };
    let pilot = |more: Value| {
        let mut document = document();
        document["autopilot"].as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
        document
    };
    let lqr = |states: Value, elevator: u32| {
        json!({
            "longitudinal": { "states": states, "elevator": elevator },
            "lateral": { "states": [0, 0, 0, 0], "aileron": 1, "rudder": 1 }
        })
    };
    let rows: Vec<(Value, &str, &[&str])> = vec![
        (trim("25 km", "25 m/s"), "", &["flight.json: trim:", "altitude 24902", "-2000 m to 20000 m"]),
        (trim("100 m", "25"), "", &["trim.airspeed", "\"25\""]),
        (trim("100 m", "25 deg"), "", &["trim.airspeed", "expected a velocity"]),
        (trim("100 m", "10 m/s"), "", &["no lift", "stalls at"]),
        (trim("100 m", "45 m/s"), "", &["no thrust", "a throttle of"]),
        (trim("100 m", "16 m/s"), "", &["no elevator", "the stops are"]),
        (dryden(json!({ "height": "2 m" })), "", &["gusts[0]", "from 10 ft"]),
        (dryden(json!({ "height": "500 m" })), "", &["gusts[0]", "std_dev"]),
        (dryden(json!({ "specification": "MIL-F-8785B" })), "", &["gusts.specification", "MIL-F-8785C, MIL-HDBK-1797"]),
        (change("gusts", json!({ "model": "von Karman" })), "", &["gusts.model", "known are dryden, 1-cos"]),
        (change("earth", json!("round")), "", &["earth", "known are flat, wgs84"]),
        (change("earth", json!({ "wgs84": {} })), "", &["earth.wgs84.latitude", "missing"]),
        (
            change("earth", json!({ "wgs84": { "latitude": "95 deg", "longitude": "0 deg" } })),
            "",
            &["latitude: 95.000 deg", "-90 to 90 deg"],
        ),
        (change("controls", json!({ "elevator": "30 deg" })), "", &["controls.elevator", "beyond the stops"]),
        (change("controls", json!({ "throttle": 1.5 })), "", &["controls.throttle", "expected 0 to 1"]),
        (change("controls", json!({ "thrust": "5 N" })), "", &["controls.thrust", "give its throttle"]),
        (change("controls", json!("much.csv")), "", &["controls.throttle: 1.5 is not from 0 to 1"]),
        (change("control", json!({})), "", &["unknown key", "did you mean 'controls'"]),
        (change("airplane", json!("none.json")), "", &["airplane", "none.json", "cannot read"]),
        (change("controls", json!("none.csv")), "", &["none.csv", "cannot read"]),
        (change("controls", json!("short.csv")), "--duration 4s", &["short.csv: ends at 3 s, before the 4 s"]),
        (change("ground", json!("200 m")), "", &["altitude: 100 m is below the ground at 200 m"]),
        (trim("1000 m", "25 m/s"), "", &["gusts[0]", "1000 m (3281 ft)", "needs std_dev", "or exceedance"]),
        (dryden(json!({ "exceedance": 0.3 })), "", &["gusts[0]: exceedance 0.3", "curves for"]),
        (dryden(json!({ "exceedance": 1e-3, "std_dev": "1 m/s" })), "", &["gusts.exceedance", "beside std_dev"]),
        (pilot(json!({ "gains": null })), "", &["autopilot: expected one of gains, lqr and rule"]),
        (
            pilot(json!({ "gains": null, "lqr": lqr(json!([1, 1, 1]), 1) })),
            "",
            &["longitudinal.states", "u, w, q, theta"],
        ),
        (pilot(json!({ "gains": null, "lqr": lqr(json!([1, 1, 1, 1]), 0) })), "", &["elevator", "more than zero"]),
        (quiet.clone(), "--duration 1.003s", &["duration 1.003 s is no whole number of samples at 100 Hz"]),
        (quiet.clone(), "--every 3ms", &["every 0.003 s"]),
        (quiet.clone(), "--duration -1s", &["duration -1 s: expected a positive time"]),
        (
            {
                quiet.as_object_mut().unwrap().remove("sensors");
                quiet.clone()
            },
            "--duration 10s --every 1s --step 0.5s",
            &["a step of 0.5 s", "give --step"],
        ),
    ];
    for (document, flags, words) in rows {
        let bench = Bench::new();
        bench.file("much.csv", "time (s),throttle\n0,0.7\n90,1.5\n");
        bench.file("short.csv", "time (s),throttle\n0,0.7\n3,0.8\n");
        bench.file("flight.json", document.to_string());
        let out = bench.run(&format!("fly flight.json -o out.csv {flags}"));
        assert_eq!(out.status, 2, "{document}\n{out:?}");
        assert_eq!(out.stderr.lines().count(), 1, "{out:?}");
        assert!(words.iter().all(|word| out.stderr.contains(word)), "{words:?}\n{out:?}");
        assert_eq!(bench.files(), ["flight.json", "much.csv", "short.csv"]);
    }
}

/// No row is left of a flight that meets the ground or leaves the standard atmosphere; the message says when. The dive
/// goes through 40 m at 30 m/s and steeply, in between one and two seconds.
#[test]
fn the_ground_and_the_end_of_the_atmosphere_are_said_with_their_time() {
    for (ground, altitude, u, theta, words) in [
        ("0 m", "40 m", "30 m/s", "-60 deg", "at 1.* s: the airplane meets the ground, which is at 0 m;"),
        ("500 m", "540 m", "30 m/s", "-60 deg", "at 1.* s: the airplane meets the ground, which is at 500 m;"),
        ("0 m", "20050 m", "300 m/s", "80 deg", "at 0.* s: altitude 20000.* m (geopotential) is outside the standard"),
        ("600 m", "540 m", "30 m/s", "0 deg", "altitude: 540 m is below the ground at 600 m;"),
    ] {
        let bench = Bench::new();
        let mut dive = level();
        dive["airplane"] = json!(data("airplanes/aerosonde.json"));
        dive["initial"] = json!({ "altitude": altitude, "u": u, "theta": theta });
        dive["ground"] = json!(ground);
        bench.file("flight.json", dive.to_string());
        let out = bench.run("fly flight.json -o out.csv --duration 60s");
        assert_eq!((out.status, out.stderr.lines().count()), (2, 1), "{out:?}");
        let mut rest = out.stderr.as_str();
        for word in words.split('*') {
            let found = rest.find(word).unwrap_or_else(|| panic!("{words}: {out:?}"));
            rest = &rest[found + word.len()..];
        }
        assert_eq!(bench.files(), ["flight.json"]);
    }
}

/// Turbulence is that of the height above the ground.
#[test]
fn heights_of_gusts_are_above_the_ground() {
    let bench = bench();
    let figures = |ground: &str, altitude: &str| {
        let mut document = document();
        document["trim"]["altitude"] = json!(altitude);
        document["ground"] = json!(ground);
        bench.file("flight.json", document.to_string());
        let rows: Value = serde_json::from_str(&bench.ok("fly flight.json --duration 5s --json")).unwrap();
        let columns = rows["runs"][0]["columns"].as_array().unwrap();
        columns.iter().find(|c| c["name"] == "gust_w (m/s)").unwrap()["std_dev"].as_f64().unwrap()
    };
    let (low, high, nearer) = (figures("0 m", "100 m"), figures("500 m", "600 m"), figures("50 m", "100 m"));
    assert!((low / high - 1.0).abs() < 1e-6 && (low / nearer - 1.0).abs() > 1e-3, "{low} {high} {nearer}");
}
