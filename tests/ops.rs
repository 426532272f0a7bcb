//! Requests: what the library makes of one is what the command prints, and what is no request is refused in one line.

use kfdesign::ops::{
    airplane, allan, compare, datasheet, export, fly, identify, import, inflate, info, montecarlo, plan, replay,
    simulate, trim, tune,
};
use schemars::JsonSchema;
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Value, json};

use crate::params::accepts;
use crate::support::{Bench, data};

fn request<R: DeserializeOwned + Serialize + JsonSchema>(value: Value) -> R {
    let schema = schemars::schema_for!(R).to_value();
    accepts(&schema, &schema, &value).unwrap();
    let request: R = serde_json::from_value(value).unwrap();
    // what was left out has its default when it is written
    accepts(&schema, &schema, &serde_json::to_value(&request).unwrap()).unwrap();
    request
}

fn same(name: &str, document: &impl Serialize, printed: &str) {
    assert_eq!(serde_json::to_string_pretty(document).unwrap() + "\n", printed, "{name}");
}

/// One sensor at 20 Hz, simulated by request; then each command both ways.
#[test]
fn a_request_gives_what_the_command_prints() {
    let bench = Bench::new();
    bench.file("params.json", std::fs::read(data("params.json")).unwrap());
    let at = |name: &str| bench.path(name).display().to_string();
    let (params, log, filter) = (at("params.json"), at("log.npy"), at("filter.json"));
    let simulated = simulate::run(&request(json!({
        "params": params, "output": log, "duration": "10min", "rate": 20.0, "seed": 5
    })))
    .unwrap();
    let command = format!("simulate {params} -o {log} --duration 10min --rate 20 --seed 5 --json");
    same("simulate", &simulated, &bench.ok(&command));
    let reading = json!({ "columns": ["gyro_x", "gyro_y"] });
    let done = allan::run(&request(json!({ "log": log, "taus": "decade", "reading": reading }))).unwrap();
    let command = format!("allan {log} --taus decade --columns gyro_x,gyro_y --json");
    same("allan", &done.document, &bench.ok(&command));
    let done = identify::run(&request(json!({
        "logs": [log], "model": "white+gm", "hold": ["gauss_markov.correlation_time=200s"], "reading": reading
    })))
    .unwrap();
    let hold = "--hold gauss_markov.correlation_time=200s";
    let command = format!("identify {log} --model white+gm {hold} --columns gyro_x,gyro_y --json");
    same("identify", &done.document(), &bench.ok(&command));
    let wish = json!({ "params": params, "parameter": "white.density", "precision": "1%" });
    let command = format!("plan {params} --parameter white.density --precision 1% --json");
    same("plan", &plan::run(&request(wish)).unwrap(), &bench.ok(&command));
    let (comparison, _) = compare::run(&request(json!({ "params": params, "log": log }))).unwrap();
    same("compare", &comparison, &bench.run(&format!("compare {params} {log} --json")).stdout);
    let done = inflate::run(&request(json!({ "params": params, "log": log, "from": 2.0 }))).unwrap();
    same("inflate", &done.found, &bench.ok(&format!("inflate {params} {log} --from 2 --json")));
    let tune::Done::Linear(done) = tune::run(&request(json!({ "params": params, "runs": 20 }))).unwrap() else {
        panic!("a sensor at rest has a linear filter")
    };
    same("tune", &done.document().unwrap(), &bench.ok(&format!("tune {params} --runs 20 --json -o {filter}")));
    let slower = at("slower.json");
    let text =
        bench.read("params.json").replace("\"value\": 100.0, \"unit\": \"Hz\"", "\"value\": 20.0, \"unit\": \"Hz\"");
    bench.file("slower.json", text);
    bench.ok(&format!("tune {slower} -o {filter}"));
    let replay::Done::Linear(result, _) =
        replay::run(&request(json!({ "filter": filter, "log": log, "alpha": 0.02 }))).unwrap()
    else {
        panic!("the filter is linear")
    };
    same("replay", &result, &bench.run(&format!("replay {filter} {log} --alpha 0.02 --json")).stdout);
}

/// Many runs and one document of them; parameters of other programs, and for them.
#[test]
fn a_request_judges_imports_and_exports_as_the_command_does() {
    let bench = Bench::new();
    let at = |name: &str| bench.path(name).display().to_string();
    let params = data("params.json").display().to_string();
    let (filter, shard) = (at("filter.json"), at("shard.json"));
    bench.ok(&format!("tune {params} -o {filter}"));
    let asked =
        montecarlo::Request { output: None, ..request(json!({ "filter": filter, "runs": "20", "threads": 2 })) };
    let montecarlo::Done::Many(simulated) = montecarlo::run(&asked, &|| false).unwrap() else {
        panic!("these are many runs")
    };
    let judged = simulated.judge(&asked.judging).unwrap();
    let allowed = "--allow-inconclusive";
    assert_eq!(judged.json, bench.ok(&format!("montecarlo {filter} --runs 20 -o {shard} --json {allowed}")));
    let asked: montecarlo::merge::Request = request(json!({ "shards": [shard], "judging": { "power": true } }));
    let judged = montecarlo::merge::run(&asked).unwrap().judge(&asked.judging).unwrap();
    assert_eq!(judged.json, bench.ok(&format!("merge {shard} --power --json {allowed}")));
    let to_kalibr = json!({ "params": params, "to": "kalibr", "rate": 200.0 });
    let exported = export::run(&request(to_kalibr)).unwrap();
    assert_eq!(exported.files[0].text, bench.ok(&format!("export {params} --to kalibr --rate 200")));
    let to_c = json!({ "params": filter, "to": "c", "output": at("drift.c"), "code": { "precision": "double" } });
    let exported = export::run(&request(to_c)).unwrap();
    assert!(!bench.files().iter().any(|name| name.starts_with("drift")), "nothing is written by a request");
    bench.ok(&format!("export {filter} --to c --precision double -o {}", at("drift.c")));
    for file in &exported.files {
        assert_eq!(file.text, std::fs::read_to_string(file.path.as_ref().unwrap()).unwrap());
    }
    assert_eq!(exported.files.len(), 3);
    let yaml = at("imu.yaml");
    bench.ok(&format!("export {params} --to kalibr -o {yaml}"));
    let imported = import::run(&request(json!({ "file": yaml }))).unwrap();
    same("import", &imported.sensors[0], &bench.ok(&format!("import {yaml} --json")));
    let sheet = json!({ "angle_random_walk": "0.13 deg/sqrt(h)", "bias_instability": "2.3 deg/h", "rate": 100.0 });
    let read = datasheet::run(&request(sheet)).unwrap();
    let command = ["datasheet", "--angle-random-walk", "0.13 deg/sqrt(h)", "--bias-instability", "2.3 deg/h"];
    let printed = bench.run_args(&[&command[..], &["--rate", "100", "--json"]].concat());
    same("datasheet", &read.sensors[0], &printed.stdout);
}

/// An airplane, its steady flight, a flight and what is in its log.
#[test]
fn a_request_flies_as_the_command_does() {
    let bench = Bench::new();
    let airplane = data("airplanes/aerosonde.json").display().to_string();
    let flight = data("flights/aerosonde.json").display().to_string();
    let log = bench.path("flight.csv").display().to_string();
    let check = airplane::run(&request(json!({ "airplane": airplane, "altitude": "100 m" }))).unwrap();
    same("airplane", &check, &bench.run_args(&["airplane", &airplane, "--altitude", "100 m", "--json"]).stdout);
    let done = trim::run(&request(json!({ "file": flight, "speed": "22 m/s", "lateral": "wings_level" }))).unwrap();
    let command = ["trim", &flight, "--speed", "22 m/s", "--lateral", "wings_level", "--json"];
    same("trim", &done.document, &bench.run_args(&command).stdout);
    let said = |value| format!("{:#}", trim::run(&request(value)).err().unwrap());
    let found = said(json!({ "file": flight, "turn_rate": "1 deg/s", "bank": "3 deg" }));
    assert_eq!(found, "`turn_rate` and `bank` both say how it turns: give one of them");
    let found = said(json!({ "file": flight, "lateral": "straight" }));
    assert!(found.starts_with("`lateral` straight: expected one of zero_sideslip"), "{found}");
    let done = fly::run(&request(json!({ "flight": flight, "output": log, "duration": "2s" })), true).unwrap();
    assert!(done.lines.is_some());
    same("fly", &done.report, &bench.ok(&format!("fly {flight} -o {log} --duration 2s --json")));
    same("info", &info::run(&request(json!({ "log": log }))).unwrap(), &bench.ok(&format!("info {log} --json")));
}

#[test]
fn what_is_no_request_is_refused_in_one_line() {
    fn refused<R: DeserializeOwned>(value: Value) -> String {
        let message = serde_json::from_value::<R>(value).err().unwrap().to_string();
        assert_eq!(message.lines().count(), 1);
        message
    }
    let unknown = refused::<identify::Request>(json!({ "logs": ["a.csv"], "modle": "auto" }));
    assert!(unknown.starts_with("unknown field `modle`, expected one of `logs`, `method`, `model`"), "{unknown}");
    let unknown = refused::<allan::Request>(json!({ "log": "a.csv", "reading": { "colums": ["x"] } }));
    assert!(unknown.starts_with("unknown field `colums`, expected one of `columns`"), "{unknown}");
    assert_eq!(refused::<allan::Request>(json!({})), "missing field `log`");
    let kind = refused::<identify::Request>(json!({ "logs": ["a.csv"], "method": "guess" }));
    assert!(kind.starts_with("unknown variant `guess`, expected one of"), "{kind}");
    let message = |result: anyhow::Result<identify::Done>| format!("{:#}", result.err().unwrap());
    let lacks = json!({ "logs": ["none.csv"], "hold": ["gauss_markov.correlation_time"] });
    let said = message(identify::run(&serde_json::from_value(lacks).unwrap()));
    assert!(said.starts_with("`hold` gauss_markov.correlation_time: expected NAME=VALUE"), "{said}");
}
