//! The plant attitude: designs that cannot be tuned, filters and logs that cannot be replayed.

use serde_json::{Value, json};

use super::{Row, assert_refused};
use crate::support::Bench;

const ACCELEROMETER: &str = r#"{ "name": "z", "white": { "density": "0.004 m/s^2/sqrt(Hz)" } }"#;

/// params.json of so many gyro axes in the plant attitude, with these aids.
fn params(axes: usize, aids: &str) -> Vec<u8> {
    let axis = |name: &&str| format!(r#"{{ "name": "{name}", "white": {{ "density": "0.005 deg/s/sqrt(Hz)" }} }}"#);
    let list: Vec<String> = ["x", "y", "z"][..axes].iter().map(axis).collect();
    let design = format!(r#"{{ "plant": "attitude", "accelerometer": {ACCELEROMETER}, "aids": [{aids}] }}"#);
    format!(
        r#"{{ "format": "kfdesign-params/1", "quantity": "angular-rate", "sample_rate": "100 Hz", "design": {design}, "axes": [{}] }}"#,
        list.join(", ")
    )
    .into_bytes()
}

/// attitude.json of three axes and a magnetometer with one change made to its document.
fn filter(change: impl Fn(&mut Value)) -> Vec<u8> {
    let bench = Bench::new();
    bench.file("params.json", params(3, r#"{ "name": "magnetometer", "std_dev": "3 deg" }"#));
    bench.ok("tune params.json -o att.json");
    let mut document: Value = serde_json::from_str(&bench.read("att.json")).unwrap();
    change(&mut document);
    serde_json::to_vec(&document).unwrap()
}

#[test]
fn attitude_filters_that_cannot_be_made() {
    let two = r#"{ "name": "a", "std_dev": "3 deg" }, { "name": "b", "std_dev": "3 deg" }"#;
    let tune = "tune params.json -o att.json";
    assert_refused(vec![
        ("two axes", "params.json", params(2, ""), tune, &["'attitude' needs the three axes x, y, z; found 2 (x, y)"]),
        ("two headings", "params.json", params(3, two), tune, &["aid 'b'", "takes one heading"]),
        (
            "no noise of the accelerometer",
            "params.json",
            params(3, ""),
            "tune params.json --plant attitude --accelerometer params.json -o att.json",
            &["--accelerometer params.json: is of an angular-rate, expected a specific-force"],
        ),
        (
            "a flag of linear filters",
            "params.json",
            params(3, ""),
            "tune params.json -o att.json --truth params.json",
            &["--truth is made for linear filters"],
        ),
    ]);
}

#[test]
fn attitude_logs_that_cannot_be_replayed() {
    fn row<'a>(command: &'a str, words: &'a [&'a str]) -> Row<'a> {
        (command, "att.json", filter(|_| {}), command, words)
    }
    fn changed<'a>(what: &'a str, change: &dyn Fn(&mut Value), words: &'a [&'a str]) -> Row<'a> {
        (what, "att.json", filter(change), "replay att.json log.csv -o out.csv", words)
    }
    assert_refused(vec![
        row(
            "replay att.json log.csv -o out.csv --aid magnetometer=mx,my,mz",
            &["att.json", "needs the accelerometer", "--aid accelerometer=AX,AY,AZ"],
        ),
        row("replay att.json log.csv --aid accelerometer=ax,ay,az", &["measures magnetometer", "--aid magnetometer="]),
        row("replay att.json log.csv --aid accelerometer=ax", &["1 columns", "expected three columns x, y, z"]),
        row(
            "replay att.json log.csv --aid wheel=ax",
            &["no measurement 'wheel'; it has accelerometer and magnetometer"],
        ),
        row(
            "replay att.json log.csv --aid accelerometer=a,b,c --aid magnetometer=d,e,f --reference q_w,q_x,q_y",
            &["--reference: 3 columns; expected four, w, x, y, z"],
        ),
        row("replay att.json log.csv -o out.csv --smooth", &["--smooth is made for linear filters"]),
        row(
            "montecarlo att.json -o out.json",
            &["att.json: format: this is an attitude filter", "only replay takes it"],
        ),
        changed("gravity", &|d| d["gravity"] = json!(0.0), &["att.json: gravity: found 0; expected more than 0"]),
        changed("an axis", &|d| d["gyro"] = json!([]), &["gyro: found 0 axes; expected x, y, z"]),
        changed("F", &|d| d["gyro"][1]["F"] = json!([]), &["gyro[1].F: expected", "one per state"]),
        changed("P0", &|d| d["gyro"][2]["P0"][0][0] = json!(-1.0), &["gyro[2].P0", "negative"]),
        changed("unknown key", &|d| d["wind"] = json!(1), &["wind: unknown key"]),
    ]);
    // the columns are there, but the accelerometer has no number in any row
    let bench = Bench::new();
    bench.file("att.json", filter(|_| {}));
    let rows: String =
        (0..200).map(|i| format!("{:.2},{},{},{},,,,1,2,3\n", 0.01 * f64::from(i), i % 7, i % 5, i % 3)).collect();
    bench.file(
        "log.csv",
        format!("t (s),gx (deg/s),gy (deg/s),gz (deg/s),ax (m/s^2),ay (m/s^2),az (m/s^2),mx,my,mz\n{rows}"),
    );
    let out = bench.run(
        "replay att.json log.csv -o out.csv --columns gx,gy,gz --aid accelerometer=ax,ay,az --aid magnetometer=mx,my,mz",
    );
    assert_eq!(out.status, 2, "{out:?}");
    assert!(out.stderr.contains("no row has a number in all three columns of the accelerometer"), "{}", out.stderr);
    assert!(!bench.files().contains(&"out.csv".to_string()));
}

#[test]
fn flags_of_an_attitude_are_refused_elsewhere() {
    let bench = Bench::new();
    bench.file("params.json", params(3, ""));
    bench.ok("tune params.json --plant static -o filter.json");
    let out = bench.run("replay filter.json log.csv --movement moves");
    assert_eq!(out.status, 2);
    assert!(out.stderr.contains("--movement belongs to a filter of the plant attitude"), "{}", out.stderr);
}
