//! Requests: what the library makes of one is what the command prints, and what is no request is refused in one line.

use kfdesign::ops::{allan, compare, identify, inflate, plan, replay, simulate, tune};
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
