//! filter.json: what is written is read back, what is wrong is named.

use kfdesign::filter::{AxisDesign, FilterDesign, steady_state};
use kfdesign::model::LinearModel;
use kfdesign::params::{AxisParams, Measured, TermEntry};
use kfdesign::units::{Quantity, Unit};
use serde_json::{Value, json};

use super::{bias_and_drift, drift, model};

fn axis(name: &str, model: LinearModel) -> AxisDesign {
    let unit = |text: &str, value| Measured { value, unit: Unit::parse(text).unwrap(), interval: None };
    let noise = AxisParams {
        name: name.into(),
        bias: None,
        turn_on_bias: Some(unit("deg/s", 0.5)),
        temperature: None,
        terms: vec![
            TermEntry::White { density: unit("deg/s/sqrt(Hz)", 0.0562) },
            TermEntry::GaussMarkov { std_dev: unit("deg/s", 0.03), correlation_time: unit("s", 193.9312) },
        ],
        not_identified: vec![],
    };
    AxisDesign {
        name: name.into(),
        steady_state: steady_state(&model).unwrap(),
        model,
        noise,
        about: Default::default(),
    }
}

fn design() -> FilterDesign {
    let two = LinearModel { dt: 0.01, ..bias_and_drift() };
    // Nothing symmetric that need not be: a transposed matrix would show.
    let dense = model(
        &[&[0.9, 0.1 / 3.0], &[-0.2, 0.7]],
        &[1.0, 1.0 / 7.0],
        &[&[0.02, 0.005], &[0.005, 0.03]],
        0.25,
        &[0.5, -0.2],
        &[&[1.0, 0.3], &[0.3, 0.5]],
    );
    let dense = LinearModel { dt: 0.01, ..dense };
    FilterDesign {
        quantity: Quantity::AngularRate,
        sample_rate_hz: 100.0,
        plant: "static".into(),
        design: None,
        axes: vec![axis("x", two), axis("y", drift(0.1 / 3.0, 100.0 / 7.0, 0.05, 0.01)), axis("z", dense)],
        tuning: json!({ "method": "exact", "moved": [1, 2.5, "R"] }),
    }
}

#[test]
fn every_number_reads_back_as_the_same_double() {
    let written = design();
    let text = written.to_json();
    let read = FilterDesign::from_json(&text, "filter.json").unwrap();
    assert_eq!(read.to_json(), text);
    for (a, b) in written.axes.iter().zip(&read.axes) {
        assert_eq!(a.name, b.name);
        assert_eq!(a.model, b.model);
        assert_eq!(a.steady_state, b.steady_state);
        assert_eq!(a.noise, b.noise);
    }
    assert_eq!((read.quantity, read.sample_rate_hz, read.plant), (written.quantity, 100.0, "static".to_string()));
    assert_eq!(read.tuning, written.tuning);
}

#[test]
fn the_layout_is_the_documented_one() {
    let text = design().to_json();
    let keys = [
        "\"format\": \"kfdesign-filter/1\"",
        "\"quantity\": \"angular-rate\"",
        "\"sample_rate\": {\n    \"value\": 100.0,\n    \"unit\": \"Hz\"\n  }",
        "\"plant\": \"static\"",
        "\"axes\": [",
        "\"name\": \"x\"",
        "\"states\": [",
        "\"inputs\": []",
        "\"measurements\": [",
        "\"every\": 1",
        "\"F\": [\n        [1.0, 0.0],\n        [0.0, 0.999948436651]\n      ]",
        "\"G\": [",
        "\"H\": [\n        [1.0, 1.0]\n      ]",
        "\"Q\": [",
        "\"R\": [",
        "\"x0\": [0.0, 0.0]",
        "\"P0\": [",
        "\"steady_state\": {",
        "\"gain\": [",
        "\"predicted_covariance\": [",
        "\"innovation_covariance\": [",
        "\"poles\": [",
        "\"settling_time\": {",
        "\"noise\": {",
        "\"tuning\": {",
    ];
    let mut from = 0;
    for key in keys {
        let at = text[from..].find(key).unwrap_or_else(|| panic!("{key} after byte {from} of\n{text}"));
        from += at;
    }
    assert!(text.ends_with("}\n"));
    let schema = FilterDesign::schema();
    let axis = &schema["$defs"]["AxisFilter"];
    for key in ["F", "G", "H", "Q", "R", "x0", "P0", "states", "measurements", "steady_state", "noise"] {
        assert!(!axis["properties"][key].is_null(), "{key}");
    }
    let required: Vec<&str> = axis["required"].as_array().unwrap().iter().filter_map(Value::as_str).collect();
    assert_eq!(required, ["name", "states", "measurements", "F", "H", "Q", "R", "x0", "P0"]);
}

/// The design as JSON, changed.
fn changed(change: impl FnOnce(&mut Value)) -> Result<FilterDesign, String> {
    let mut value: Value = serde_json::from_str(&design().to_json()).unwrap();
    change(&mut value);
    FilterDesign::from_json(&value.to_string(), "f.json").map_err(|e| e.to_string())
}

#[test]
fn what_can_be_computed_may_be_left_out() {
    let expected = design();
    let read = changed(|v| {
        v.as_object_mut().unwrap().remove("tuning");
        for axis in v["axes"].as_array_mut().unwrap() {
            for key in ["steady_state", "noise", "inputs", "G"] {
                axis.as_object_mut().unwrap().remove(key);
            }
            axis["measurements"][0].as_object_mut().unwrap().remove("every");
        }
        v["sample_rate"] = json!("0.1 kHz");
    })
    .unwrap();
    for (a, b) in expected.axes.iter().zip(&read.axes) {
        assert_eq!(a.model, b.model);
        assert_eq!(a.steady_state, b.steady_state);
        assert!(b.noise.terms.is_empty());
    }
}

#[test]
fn every_fault_is_named_with_file_and_key() {
    type Change = fn(&mut Value);
    let cases: [(&str, Change); 32] = [
        ("f.json: format: missing; a filter file has", |v| {
            v.as_object_mut().unwrap().remove("format");
        }),
        ("f.json: format: found", |v| v["format"] = json!("kfdesign-params/1")),
        ("f.json: colour: unknown key", |v| v["colour"] = json!("red")),
        ("f.json: axes[1].S: unknown key", |v| v["axes"][1]["S"] = json!([[1]])),
        ("f.json: axes[0].steady_state.gian: unknown key; did you mean 'gain'?", |v| {
            v["axes"][0]["steady_state"]["gian"] = json!(1);
        }),
        ("f.json: quantity: expected", |v| v["quantity"] = json!("temperature")),
        ("f.json: sample_rate: the number 100 has no unit", |v| v["sample_rate"] = json!(100)),
        ("f.json: sample_rate: ", |v| v["sample_rate"] = json!("0 Hz")),
        ("f.json: plant: unknown plant 'rocket'; known plants: static", |v| v["plant"] = json!("rocket")),
        ("f.json: axes: there is no axis; at least one is needed", |v| v["axes"] = json!([])),
        ("f.json: axes[1].name: 'x' is the name of axes[0] too", |v| v["axes"][1]["name"] = json!("x")),
        ("f.json: axes[0].states[1].name: 'x0' appears twice", |v| v["axes"][0]["states"][1]["name"] = json!("x0")),
        ("f.json: axes[0].states[0].unit: 'deg/s' is not an SI unit", |v| {
            v["axes"][0]["states"][0]["unit"] = json!("deg/s");
        }),
        ("f.json: axes[0].states[0].unit: unknown unit", |v| v["axes"][0]["states"][0]["unit"] = json!("furlong")),
        ("f.json: axes[0].measurements: found 0 measurements; the plant 'static' has 1", |v| {
            v["axes"][0]["measurements"] = json!([]);
        }),
        ("f.json: axes[0].inputs: found 1; the plant 'static' has 0", |v| {
            v["axes"][0]["inputs"] = json!([{ "name": "u", "unit": "rad/s" }]);
        }),
        ("f.json: axes[0].measurements[0].unit: found rad; expected rad/s", |v| {
            v["axes"][0]["measurements"][0]["unit"] = json!("rad");
        }),
        ("f.json: axes[0].measurements[0].every: found 0; expected a whole number from 1", |v| {
            v["axes"][0]["measurements"][0]["every"] = json!(0);
        }),
        ("f.json: axes[0].F: found 2 x 3; expected 2 x 2", |v| v["axes"][0]["F"] = json!([[1, 0, 0], [0, 1, 0]])),
        ("f.json: axes[0].F: row 1 has 1 numbers but row 0 has 2", |v| v["axes"][0]["F"] = json!([[1, 0], [0]])),
        ("f.json: axes[0].F[0][1]: expected a number, found the text \"1\"", |v| v["axes"][0]["F"][0][1] = json!("1")),
        ("f.json: axes[0].H: found 1 x 1; expected 1 x 2", |v| v["axes"][0]["H"] = json!([[1]])),
        ("f.json: axes[0].G: found 2 x 1; expected 2 x 0", |v| v["axes"][0]["G"] = json!([[1], [1]])),
        ("f.json: axes[0].x0: found 1 numbers; expected 2", |v| v["axes"][0]["x0"] = json!([0])),
        ("f.json: axes[0].P0: is not symmetric", |v| v["axes"][0]["P0"] = json!([[1, 0.5], [0, 1]])),
        ("f.json: axes[0].Q: is not positive semidefinite", |v| v["axes"][0]["Q"] = json!([[1, 2], [2, 1]])),
        ("f.json: axes[0].Q[1][1]: found -1e0; a variance cannot be negative", |v| {
            v["axes"][0]["Q"] = json!([[0, 0], [0, -1]]);
        }),
        ("f.json: axes[0].R: is not positive definite", |v| v["axes"][0]["R"] = json!([[0]])),
        ("f.json: axes[0].steady_state: does not belong to F, H, Q, R", |v| {
            v["axes"][0]["Q"] = json!([[0, 0], [0, 1e-7]]);
        }),
        ("f.json: axes[0].steady_state.gain: found 1 x 1; expected 2 x 1", |v| {
            v["axes"][0]["steady_state"]["gain"] = json!([[0]]);
        }),
        ("f.json: axes[0].steady_state.poles: found 1 poles; expected 2", |v| {
            v["axes"][0]["steady_state"]["poles"] = json!([[1, 0]]);
        }),
        ("f.json: axes[0].noise.white.density: ", |v| {
            v["axes"][0]["noise"]["white"]["density"] = json!("-1 deg/s/sqrt(Hz)");
        }),
    ];
    for (message, change) in cases {
        let Err(found) = changed(change) else { panic!("accepted: {message}") };
        assert!(found.starts_with(message), "expected {message}\nfound    {found}");
        assert!(!found.contains('\n'), "{found}");
    }
    // A growing state without noise has no steady state to compute.
    let growing = changed(|v| {
        v["axes"][0]["F"] = json!([[1.5, 0], [0, 0.9]]);
        v["axes"][0].as_object_mut().unwrap().remove("steady_state");
    });
    assert!(growing.unwrap_err().starts_with("f.json: axes[0]: there is no steady state: state 'x0' grows"));
}

#[test]
fn text_that_is_not_json_is_placed() {
    let text = design().to_json();
    let nan = text.replacen("0.999948436651", "NaN", 1);
    let error = FilterDesign::from_json(&nan, "f.json").unwrap_err().to_string();
    let line = text.lines().position(|l| l.contains("0.999948436651")).unwrap() + 1;
    assert!(error.starts_with(&format!("f.json: line {line}, column ")), "{error}");
    let infinite = text.replacen("0.999948436651", "1e999", 1);
    assert!(FilterDesign::from_json(&infinite, "f.json").unwrap_err().to_string().contains("out of range"));
    assert!(FilterDesign::from_json("", "f.json").is_err());
    let missing = FilterDesign::read(std::path::Path::new("no/such/filter.json")).unwrap_err().to_string();
    assert!(missing.starts_with("no/such/filter.json: cannot read: "), "{missing}");
}
