//! params.json: what is accepted, what is refused and how, the round trip, the schema.

use kfdesign::noise::{Filter, Term};
use kfdesign::params::{AxisParams, Inflated, Measured, NotIdentified, Params, Source, TemperatureEffect, TermEntry};
use kfdesign::units::{Quantity, Unit};
use serde_json::{Value, json};

use super::support::{Bench, data};

fn document() -> Value {
    json!({
        "format": "kfdesign-params/1",
        "quantity": "angular-rate",
        "sample_rate": "100 Hz",
        "axes": [{
            "name": "x",
            "bias": "-0.597 deg/s",
            "turn_on_bias": {"std_dev": "0.6 deg/s"},
            "white": {"density": {"value": 0.0562, "unit": "deg/s/sqrt(Hz)", "interval": [0.0555, 0.0569]}},
            "gauss_markov": [{"std_dev": "0.0280596 deg/s", "correlation_time": "193.9312 s"}],
            "not_identified": [{"term": "rate_random_walk", "reason": "hidden by white noise", "needed_log": "16 h", "upper_limit": "0.002 deg/s/sqrt(s)"}]
        }]
    })
}

fn parse(value: &Value) -> Result<Params, String> {
    Params::from_json(&value.to_string(), "params.json").map_err(|e| e.to_string())
}

/// The document with the value at a JSON pointer replaced.
fn with(pointer: &str, value: Value) -> Value {
    let mut document = document();
    let (parent, key) = pointer.rsplit_once('/').unwrap();
    let parent = if parent.is_empty() { &mut document } else { document.pointer_mut(parent).unwrap() };
    parent.as_object_mut().unwrap().insert(key.into(), value);
    document
}

fn without(pointer: &str) -> Value {
    let mut document = document();
    let (parent, key) = pointer.rsplit_once('/').unwrap();
    let parent = if parent.is_empty() { &mut document } else { document.pointer_mut(parent).unwrap() };
    parent.as_object_mut().unwrap().remove(key).unwrap();
    document
}

#[test]
fn short_and_long_form_read_to_si() {
    let params = parse(&document()).unwrap();
    let degree = std::f64::consts::PI / 180.0;
    assert_eq!(params.quantity, Quantity::AngularRate);
    assert_eq!(params.sample_rate_hz, 100.0);
    let axis = &params.axes[0];
    assert_eq!(axis.bias.as_ref().unwrap().value, -0.597);
    assert!((axis.turn_on_bias.as_ref().unwrap().si() - 0.6 * degree).abs() < 1e-16);
    let [Term::White { density }, Term::GaussMarkov { std_dev, correlation_time }] = axis.noise().terms[..] else {
        panic!("{:?}", axis.terms)
    };
    assert!((density / (0.0562 * degree) - 1.0).abs() < 1e-15);
    assert!((std_dev / (0.0280596 * degree) - 1.0).abs() < 1e-15);
    assert_eq!(correlation_time, 193.9312);
    assert_eq!(axis.not_identified[0].needed_log_s, Some(57_600.0));
    let limit = axis.not_identified[0].upper_limit.as_ref().unwrap().si();
    assert!((limit / (0.002 * degree) - 1.0).abs() < 1e-15, "{limit}");
    let wrong = json!([{"term": "rate_random_walk", "reason": "hidden", "upper_limit": "0.002 deg/s"}]);
    assert!(parse(&with("/axes/0/not_identified", wrong)).unwrap_err().contains("not_identified[0].upper_limit"));
    let TermEntry::White { density } = &axis.terms[0] else { panic!() };
    assert_eq!(density.interval, Some([0.0555, 0.0569]));
}

#[test]
fn writing_and_reading_gives_the_same_document() {
    let measured = |value: f64, unit: &str, interval| Measured { value, unit: Unit::parse(unit).unwrap(), interval };
    let params = Params {
        quantity: Quantity::SpecificForce,
        sample_rate_hz: 1.0 / 0.003,
        axes: vec![
            AxisParams {
                name: "accel x".into(),
                bias: Some(measured(-0.1, "mg", Some([-0.3, 0.1]))),
                turn_on_bias: Some(measured(3.0, "mg", None)),
                temperature: Some(TemperatureEffect {
                    coefficient: measured(0.02, "mg/degC", Some([-0.01, 0.05])),
                    reference: measured(-4.5, "degC", None),
                    span: measured(1.5, "K", None),
                }),
                terms: vec![
                    TermEntry::Quantization { coefficient: measured(1e-6, "m/s", None) },
                    TermEntry::White { density: measured(0.1 + 0.2, "µg/√Hz", Some([0.1, 0.7])) },
                    TermEntry::MovingAverage {
                        density: measured(90.0, "ug/sqrt(Hz)", Some([80.0, 99.0])),
                        samples: 64,
                    },
                    TermEntry::BandLimit {
                        density: measured(80.0, "ug/sqrt(Hz)", Some([70.0, 99.0])),
                        filter: Filter::new(&[0.1, 0.2, 0.1], &[1.0, -1.143, 0.4128]).unwrap(),
                    },
                    TermEntry::Oscillation {
                        std_dev: measured(3.0, "mg", None),
                        frequency: measured(20.0, "Hz", Some([19.5, 20.5])),
                        correlation_time: measured(3.0, "s", None),
                    },
                    TermEntry::BiasInstability { coefficient: measured(12.0, "ug", None) },
                    TermEntry::GaussMarkov {
                        std_dev: measured(5.0, "ug", None),
                        correlation_time: measured(2.0, "h", Some([0.5, f64::INFINITY])),
                    },
                    TermEntry::GaussMarkov {
                        std_dev: measured(7.0, "ug", None),
                        correlation_time: measured(9.0, "s", None),
                    },
                    TermEntry::RateRandomWalk { density: measured(1e-9, "m/s^2/sqrt(s)", None) },
                    TermEntry::RateRamp { slope: measured(-1e-9, "m/s^3", Some([-2e-9, f64::INFINITY])) },
                ],
                not_identified: vec![],
            },
            AxisParams {
                name: "y".into(),
                bias: None,
                turn_on_bias: None,
                temperature: None,
                terms: vec![],
                not_identified: vec![NotIdentified {
                    term: "white".into(),
                    reason: "why".into(),
                    needed_log_s: None,
                    upper_limit: None,
                }],
            },
        ],
        design: None,
        source: Some(Source {
            log: Some("a \"log\".csv".into()),
            samples: Some(u64::MAX),
            span_s: Some(12.5),
            inflation: vec![Inflated { axis: "x".into(), factor: 7.5, interval: [7.25, 7.75] }],
            ..Source::default()
        }),
    };
    let text = params.to_json();
    assert!(text.ends_with("}\n"));
    let again = Params::from_json(&text, "params.json").unwrap();
    assert_eq!(again, params);
    assert_eq!(again.to_json(), text);
}

#[test]
fn each_complaint_names_file_key_and_reason() {
    let white = |density: Value| with("/axes/0/white", json!({ "density": density }));
    let gauss_markov = |term: Value| with("/axes/0/gauss_markov", json!([term]));
    let average =
        |samples: Value| with("/axes/0/moving_average", json!({"density": "1 deg/s/√Hz", "samples": samples}));
    let limit = |numerator: Value, denominator: Value| {
        let term = json!({"density": "1 deg/s/√Hz", "numerator": numerator, "denominator": denominator});
        with("/axes/0/band_limit", term)
    };
    let line = |key: &str, value: Value| {
        let mut term = json!({"std_dev": "1 deg/s", "frequency": "20 Hz", "correlation_time": "3 s"});
        term[key] = value;
        with("/axes/0/oscillation", json!([term]))
    };
    let warm = |key: &str, value: Value| {
        let mut record = json!({"coefficient": "0.02 deg/s/degC", "reference": "25 degC", "span": "3 degC"});
        record[key] = value;
        with("/axes/0/temperature", record)
    };
    let mut twice = document();
    let axis = twice["axes"][0].clone();
    twice["axes"].as_array_mut().unwrap().push(axis);
    #[rustfmt::skip]
    let cases: Vec<(Value, &str, &str)> = vec![
        (without("/format"), "format: ", "kfdesign-params/1"),
        (with("/format", json!("kfdesign-filter/1")), "format: ", "found the text \"kfdesign-filter/1\""),
        (with("/format", json!(1)), "format: ", "found the number 1"),
        (json!([1]), "document: ", "found a list"),
        (without("/quantity"), "quantity: ", "missing"),
        (with("/quantity", json!("rate")), "quantity: ", "\"angular-rate\" or \"specific-force\""),
        (without("/sample_rate"), "sample_rate: ", "missing"),
        (with("/sample_rate", json!(100)), "sample_rate: ", "the number 100 has no unit; write \"100 Hz\""),
        (with("/sample_rate", json!("0.01 s")), "sample_rate: ", "is a time, expected a frequency"),
        (with("/sample_rate", json!("-100 Hz")), "sample_rate: ", "greater than zero"),
        (without("/axes"), "axes: ", "missing"),
        (with("/axes", json!([])), "axes: ", "no axis"),
        (with("/axes", json!({})), "axes: ", "expected a list"),
        (with("/axes", json!([3])), "axes[0]: ", "expected an object"),
        (with("/axis", json!([])), "axis: ", "did you mean 'axes'"),
        (twice, "axes[1].name: ", "'x' is the name of axes[0] too"),
        (with("/axes/0/name", json!("")), "axes[0].name: ", "readable"),
        (without("/axes/0/name"), "axes[0].name: ", "missing"),
        (warm("coefficient", json!("1 deg/s")), "axes[0].temperature.coefficient: ", "expected an angular rate per temperature (for example deg/s/degC)"),
        (warm("coefficient", json!(null)), "axes[0].temperature.coefficient: ", "missing"),
        (warm("reference", json!(20)), "axes[0].temperature.reference: ", "the number 20 has no unit; write \"20 degC\""),
        (warm("span", json!("0 degC")), "axes[0].temperature.span: ", "greater than zero"),
        (warm("spam", json!("1 degC")), "axes[0].temperature.spam: ", "did you mean 'span'"),
        (with("/axes/0/whit", json!({})), "axes[0].whit: ", "did you mean 'white'"),
        (with("/axes/0/gauss_markow", json!([])), "axes[0].gauss_markow: ", "did you mean 'gauss_markov'"),
        (with("/axes/0/rrw", json!({})), "axes[0].rrw: ", "known here: name, bias"),
        (with("/axes/0/white", json!({"densty": "1 deg/s/√Hz"})), "axes[0].white.densty: ", "did you mean 'density'"),
        (with("/axes/0/white", json!({})), "axes[0].white.density: ", "missing"),
        (with("/axes/0/white", json!("0.1 deg/s/√Hz")), "axes[0].white: ", "expected an object with density, found the text"),
        (with("/axes/0/band_limit", json!("20 Hz")), "axes[0].band_limit: ", "expected an object with density, numerator, denominator, found the text \"20 Hz\""),
        (with("/axes/0/gauss_markov", json!([3])), "axes[0].gauss_markov[0]: ", "expected an object with std_dev, correlation_time"),
        (white(json!(0.0562)), "axes[0].white.density: ", "the number 0.0562 has no unit; write \"0.0562 deg/s/sqrt(Hz)\""),
        (white(json!("0.0562")), "axes[0].white.density: ", "a number and a unit"),
        (white(json!("0.0562 deg/s")), "axes[0].white.density: ", "such as the standard deviation of one sample"),
        (white(json!("0.0562 deg/s/√Hzz")), "axes[0].white.density: ", "unknown unit 'deg/s/√Hzz'"),
        (white(json!("0.0562 m/s^2/√Hz")), "axes[0].white.density: ", "specific force"),
        (white(json!("-0.0562 deg/s/√Hz")), "axes[0].white.density: ", "greater than zero"),
        (white(json!("0 deg/s/√Hz")), "axes[0].white.density: ", "greater than zero"),
        (white(json!("NaN deg/s/√Hz")), "axes[0].white.density: ", "not finite"),
        (white(json!("1e999 deg/s/√Hz")), "axes[0].white.density: ", "not finite"),
        (white(json!({"value": "1", "unit": "deg/s/√Hz"})), "axes[0].white.density.value: ", "expected a number"),
        (white(json!({"value": 1})), "axes[0].white.density.unit: ", "missing"),
        (white(json!({"value": 1, "unit": "deg/s/√Hz", "sigma": 1})), "axes[0].white.density.sigma: ", "unknown key"),
        (white(json!({"value": 1, "unit": "deg/s/√Hz", "interval": [2, 1]})), "axes[0].white.density.interval: ", "above"),
        (white(json!({"value": 1, "unit": "deg/s/√Hz", "interval": [1]})), "axes[0].white.density.interval: ", "[lower, upper]"),
        (white(json!({"value": 1, "unit": "deg/s/√Hz", "interval": [-1, 2]})), "axes[0].white.density: ", "below zero"),
        (white(json!({"value": 3, "unit": "deg/s/√Hz", "interval": [1, 2]})), "axes[0].white.density.interval: ", "the value 3 is not in [1, 2]; expected lower"),
        (white(json!({"value": 3, "unit": "deg/s/√Hz", "interval": [null, 2]})), "axes[0].white.density.interval: ", "the value 3 is not in [null, 2]"),
        (with("/axes/0/bias", json!({"value": -3, "unit": "deg/s", "interval": [-2, null]})), "axes[0].bias.interval: ", "the value -3 is not in [-2, null]"),
        (white(json!({"value": 1, "unit": "deg/s/√Hz", "interval": [0, "2"]})), "axes[0].white.density.interval[1]: ", "expected a number"),
        (gauss_markov(json!({"std_dev": "1 deg/s"})), "axes[0].gauss_markov[0].correlation_time: ", "missing"),
        (gauss_markov(json!({"std_dev": "1 deg/s", "correlation_time": "0 s"})), "axes[0].gauss_markov[0].correlation_time: ", "greater than zero"),
        (gauss_markov(json!({"std_dev": "1 deg/s", "correlation_time": "1 Hz"})), "axes[0].gauss_markov[0].correlation_time: ", "expected a time"),
        (average(json!(1)), "axes[0].moving_average.samples: ", "found 1, expected 2 to 64"),
        (average(json!(65)), "axes[0].moving_average.samples: ", "found 65, expected 2 to 64"),
        (average(json!(2.5)), "axes[0].moving_average.samples: ", "whole number"),
        (average(json!(-2)), "axes[0].moving_average.samples: ", "whole number"),
        (average(json!("2")), "axes[0].moving_average.samples: ", "whole number"),
        (average(json!(null)), "axes[0].moving_average.samples: ", "missing"),
        (limit(json!([1, "2"]), json!([1])), "axes[0].band_limit.numerator[1]: ", "expected a number"),
        (limit(json!(1), json!([1])), "axes[0].band_limit.numerator: ", "expected a list"),
        (limit(json!([]), json!([1])), "axes[0].band_limit.numerator: ", "0 coefficients, expected 1 to 9"),
        (limit(json!([1, -1]), json!([1])), "axes[0].band_limit.numerator: ", "passes frequency zero"),
        (limit(json!([0, 1]), json!([1])), "axes[0].band_limit.numerator: ", "leave a delay out"),
        (limit(json!([1]), json!([1, -1.5])), "axes[0].band_limit.denominator: ", "expected a stable filter"),
        (limit(json!([1]), json!([1, -1])), "axes[0].band_limit.denominator: ", "use gauss_markov"),
        (limit(json!([1]), json!(null)), "axes[0].band_limit.denominator: ", "missing"),
        (with("/axes/0/moving_average", json!({"density": "-1 deg/s/√Hz", "samples": 2})), "axes[0].moving_average.density: ", "greater than zero"),
        (with("/axes/0/moving_average", json!({"density": "1 deg/s", "samples": 2})), "axes[0].moving_average.density: ", "standard deviation of one sample"),
        (line("std_dev", json!("-1 deg/s")), "axes[0].oscillation[0].std_dev: ", "greater than zero"),
        (line("frequency", json!("0 Hz")), "axes[0].oscillation[0].frequency: ", "greater than zero"),
        (line("frequency", json!(20)), "axes[0].oscillation[0].frequency: ", "the number 20 has no unit"),
        (line("frequency", json!("20 s")), "axes[0].oscillation[0].frequency: ", "expected a frequency"),
        (line("frequency", json!(null)), "axes[0].oscillation[0].frequency: ", "missing"),
        (line("correlation_time", json!("3 Hz")), "axes[0].oscillation[0].correlation_time: ", "expected a time"),
        (line("phase", json!("0 deg")), "axes[0].oscillation[0].phase: ", "unknown key"),
        (with("/axes/0/bias", json!("1 deg")), "axes[0].bias: ", "the integral of what is wanted"),
        (with("/axes/0/turn_on_bias", json!("1 deg/s")), "axes[0].turn_on_bias: ", "an object with std_dev"),
        (with("/axes/0/rate_ramp", json!({"slope": "1 deg/s"})), "axes[0].rate_ramp.slope: ", "angular acceleration"),
        (with("/axes/0/not_identified", json!([{"term": "white"}])), "axes[0].not_identified[0].reason: ", "missing"),
        (with("/source", json!({"samples": -1})), "source.samples: ", "whole number"),
        (with("/source", json!({"span": 3.0})), "source.span: ", "no unit"),
        (
            with("/source", json!({"inflation": [{"axis": "x", "factor": 0.0, "interval": [1, 2]}]})),
            "source.inflation[0].factor: ",
            "above zero",
        ),
        (
            with("/source", json!({"inflation": [{"axis": "x", "factor": 2, "interval": [1]}]})),
            "source.inflation[0].interval: ",
            "found 1 values",
        ),
    ];
    for (document, place, reason) in cases {
        let Err(message) = parse(&document) else { panic!("accepted: {place}{reason}\n{document:#}") };
        assert!(message.starts_with(&format!("params.json: {place}")), "{message}\nexpected {place}");
        assert!(message.contains(reason), "{message}\nexpected {reason}");
        assert!(!message.contains('\n'), "one line: {message}");
    }
}

#[test]
fn text_that_is_not_json_names_line_and_column() {
    let error = |text: &str| Params::from_json(text, "p.json").unwrap_err().to_string();
    assert!(
        error("").starts_with("p.json: line 1, column 0: not valid JSON: the text ends too early"),
        "{}",
        error("")
    );
    assert!(
        error("{\n \"a\": NaN}").starts_with("p.json: line 2, column 7: not valid JSON: expected a number, a text")
    );
    assert!(error("{\"a\": 1,\n \"a\": 2}").contains("line 2"), "{}", error("{\"a\": 1,\n \"a\": 2}"));
    assert!(error("{\"a\": 1, \"a\": 2}").contains("key 'a' stands twice"));
    assert!(error("{\"a\": 1e999}").contains("number out of range"));
    assert!(error(&"[".repeat(100_000)).contains("recursion"));
    let message = Params::read(&Bench::new().path("none.json")).unwrap_err().to_string();
    assert!(message.contains("none.json: cannot read: "), "{message}");
}

#[test]
fn the_schema_names_what_the_reader_names() {
    let schema = Params::schema();
    let axis = &schema["$defs"]["AxisParams"];
    let properties: Vec<&String> = axis["properties"].as_object().unwrap().keys().collect();
    // the reader's own list of keys, from its complaint
    let message = parse(&with("/axes/0/nonsense", json!(1))).unwrap_err();
    let known = message.rsplit_once("known here: ").unwrap().1;
    let mut known: Vec<&str> = known.split(", ").collect();
    known.sort_unstable();
    assert_eq!(properties, known);
    assert_eq!(axis["additionalProperties"], json!(false));
    assert_eq!(schema["required"], json!(["format", "quantity", "sample_rate", "axes"]));
    assert_eq!(schema["$defs"]["Quantity"]["enum"], json!(["angular-rate", "specific-force"]));
    assert!(schema.to_string().contains("kfdesign-params/1"));
}

/// The part of JSON Schema that our schema uses; anything else in it fails the test.
pub fn accepts(schema: &Value, root: &Value, value: &Value) -> Result<(), String> {
    if let Some(reference) = schema.get("$ref").and_then(Value::as_str) {
        return accepts(root.pointer(reference.trim_start_matches('#')).ok_or("dangling reference")?, root, value);
    }
    if let Some(options) = schema.get("anyOf").and_then(Value::as_array)
        && !options.iter().any(|o| accepts(o, root, value).is_ok())
    {
        return Err(format!("{value} matches none of {options:?}"));
    }
    for (key, rule) in schema.as_object().ok_or("schema is no object")? {
        let fits = match key.as_str() {
            "$schema" | "$defs" | "title" | "description" | "anyOf" | "format" | "default" | "pattern" => true,
            "type" => {
                let name = match value {
                    Value::Null => "null",
                    Value::Bool(_) => "boolean",
                    Value::Number(n) if n.is_u64() => "integer",
                    Value::Number(_) => "number",
                    Value::String(_) => "string",
                    Value::Array(_) => "array",
                    Value::Object(_) => "object",
                };
                let one = |t: &Value| t == name || (t == "number" && name == "integer");
                rule.as_array().map_or_else(|| one(rule), |types| types.iter().any(one))
            }
            "const" => rule == value,
            "enum" => rule.as_array().is_some_and(|e| e.contains(value)),
            "oneOf" => {
                rule.as_array().is_some_and(|o| o.iter().filter(|s| accepts(s, root, value).is_ok()).count() == 1)
            }
            "minimum" => value.as_f64().is_none_or(|x| Some(x) >= rule.as_f64()),
            "maximum" => value.as_f64().is_none_or(|x| Some(x) <= rule.as_f64()),
            "minItems" => value.as_array().is_none_or(|a| a.len() as u64 >= rule.as_u64().unwrap()),
            "maxItems" => value.as_array().is_none_or(|a| a.len() as u64 <= rule.as_u64().unwrap()),
            "required" => rule.as_array().unwrap().iter().all(|k| value.get(k.as_str().unwrap()).is_some()),
            "items" => {
                value.as_array().into_iter().flatten().try_for_each(|item| accepts(rule, root, item))?;
                true
            }
            "properties" => {
                let inner = |(key, value): (&String, &Value)| match rule.get(key) {
                    Some(rule) => accepts(rule, root, value).map_err(|why| format!("{key}: {why}")),
                    None => Ok(()),
                };
                value.as_object().into_iter().flatten().try_for_each(inner)?;
                true
            }
            "additionalProperties" => {
                let more = |(key, _): &(&String, &Value)| schema["properties"].get(key).is_none();
                value.as_object().into_iter().flatten().filter(more).all(|(_, value)| match rule {
                    Value::Bool(allowed) => *allowed,
                    rule => accepts(rule, root, value).is_ok(),
                })
            }
            other => return Err(format!("the test does not know the keyword {other}")),
        };
        if !fits {
            return Err(format!("{value} does not fit {key}: {rule}"));
        }
    }
    Ok(())
}

/// Every parameter file of the repository.
fn shipped() -> Vec<std::path::PathBuf> {
    let mut files = vec![data("params.json")];
    let sensors = std::fs::read_dir(data("sensors")).into_iter().flatten().map(|e| e.unwrap().path());
    files.extend(sensors.filter(|p| p.extension().is_some_and(|e| e == "json")));
    files
}

#[test]
fn shipped_files_read_fit_the_schema_and_name_their_source() {
    let schema = Params::schema();
    for path in shipped() {
        let text = std::fs::read_to_string(&path).unwrap();
        let params = Params::from_json(&text, &path.display().to_string()).unwrap();
        accepts(&schema, &schema, &serde_json::from_str(&text).unwrap()).unwrap();
        accepts(&schema, &schema, &serde_json::from_str(&params.to_json()).unwrap()).unwrap();
        assert!(params.source.unwrap().note.is_some(), "{}", path.display());
    }
    for wrong in [with("/axes", json!([])), with("/extra", json!(1)), without("/quantity"), with("/format", json!("x"))]
    {
        assert!(accepts(&schema, &schema, &wrong).is_err(), "{wrong}");
    }
    accepts(&schema, &schema, &document()).unwrap();
}

#[test]
fn the_reference_sensor_is_the_papers_worked_example() {
    let params = Params::read(&data("params.json")).unwrap();
    assert_eq!(params.axes.iter().map(|a| a.name.as_str()).collect::<Vec<_>>(), ["x", "y", "z"]);
    let degree = std::f64::consts::PI / 180.0;
    for axis in &params.axes {
        let [Term::White { density }, Term::GaussMarkov { std_dev, correlation_time }] = axis.noise().terms[..] else {
            panic!("{:?}", axis.terms)
        };
        // equations (3), (4): one sample has 0.562 deg/s
        assert!((density / params.sample_rate_hz.recip().sqrt() / degree - 0.562).abs() < 1e-12);
        // equations (7), (8): 366.53 s / 1.89 to the printed digits
        assert!((correlation_time - 366.53 / 1.89).abs() < 5e-5);
        assert!((std_dev / degree - 0.0280596).abs() < 1e-12);
    }
}

#[test]
fn the_schema_command_prints_one_document() {
    let bench = Bench::new();
    let printed: Value = serde_json::from_str(&bench.ok("schema params")).unwrap();
    assert_eq!(printed, Params::schema());
    for (document, key) in [("filter", "plant"), ("replay", "verdict")] {
        let printed: Value = serde_json::from_str(&bench.ok(&format!("schema {document}"))).unwrap();
        assert!(printed["properties"].get(key).is_some(), "{printed:#}");
    }
    assert_eq!(bench.run("schema nonsense").status, 2);
}
