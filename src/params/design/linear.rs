//! linear.json, the small motions of an airplane, as a custom plant.

use serde_json::Value;

use super::super::Measured;
use super::super::place::{KeyError, Place};
use super::{CustomEntry, Design, NamedEntry, PlantEntry, StateEntry, matrix};
use crate::units::Unit;

/// Of the document.
const LINEAR_FORMAT: &str = "kfdesign-linear/1";

/// Rates that a gyro measures, each with the model it belongs to.
const RATES: [(&str, &str); 3] = [("q", "longitudinal"), ("p", "lateral"), ("r", "lateral")];

/// Before the first measurement, in the SI unit of a state.
const SPREAD: [(&str, f64); 3] = [("m/s", 1.0), ("rad/s", 0.1), ("rad", 0.1)];

/// True of the text of a linear.json.
pub(super) fn is_linear(value: &Value) -> bool {
    value.get("format").and_then(Value::as_str) == Some(LINEAR_FORMAT)
}

/// The plant whose rate `sensor` (q, p or r) the gyro measures: states of its model, controls as known inputs, every
/// state an output, driven by white gusts of 1 m/s/√Hz along each axis (light turbulence at low frequencies).
/// Errors: a rate that no model has, or a document without its parts.
pub(super) fn linear(place: &Place<'_>, sensor: &str) -> Result<Design, KeyError> {
    let Some((_, name)) = RATES.iter().find(|(rate, _)| *rate == sensor) else {
        return Err(place.error(format!("'{sensor}' is no rate of a linear model; known are q, p, r")));
    };
    let part = |place: &Place<'_>, key: &str| {
        let value = place.value().get(key);
        value.cloned().ok_or_else(|| place.error(format!("{key} is missing")))
    };
    let model = part(place, "models").and_then(|models| part(&Place::at("models", &models), name))?;
    let model = Place::at("models", &model);
    let ports = |key: &str| -> Result<Vec<NamedEntry>, KeyError> {
        let value = part(&model, key)?;
        let one = |port: &Place<'_>| -> Result<NamedEntry, KeyError> {
            let object = port.object(&["name", "unit"])?;
            let text = |key: &str| Ok(object.required(key)?.text()?.to_string());
            Ok(NamedEntry { name: text("name")?, unit: text("unit")? })
        };
        Place::at(&format!("models.{name}.{key}"), &value).list()?.iter().map(one).collect()
    };
    let (outputs, inputs, gusts) = (ports("states")?, ports("inputs")?, ports("gusts")?);
    let numbers = |key: &str, columns: usize| {
        let value = part(&model, key)?;
        matrix(&Place::at(&format!("models.{name}.{key}"), &value), outputs.len(), Some(columns))
    };
    let e = numbers("E", gusts.len())?;
    // a gust of rate is the slope of one of velocity, and no white noise of its own
    let g =
        e.iter().map(|row| row.iter().zip(&gusts).filter(|(_, gust)| gust.unit == "m/s").map(|(x, _)| *x).collect());
    let spread = |state: &NamedEntry| -> Result<StateEntry, KeyError> {
        let size = SPREAD.iter().find(|(unit, _)| *unit == state.unit).map_or(1.0, |s| s.1);
        let unit = Unit::parse(&state.unit).map_err(|e| place.error(e.to_string()))?;
        Ok(StateEntry {
            name: state.name.clone(),
            unit: state.unit.clone(),
            mean: None,
            std_dev: Measured { value: size, unit, interval: None },
        })
    };
    let n = outputs.len();
    let identity = (0..n).map(|i| (0..n).map(|j| f64::from(u8::from(i == j))).collect()).collect();
    Ok(Design {
        plant: PlantEntry::Custom(Box::new(CustomEntry {
            discrete: false,
            states: outputs.iter().map(spread).collect::<Result<_, _>>()?,
            a: numbers("A", n)?,
            b: numbers("B", inputs.len())?,
            g: g.collect(),
            h: identity,
            inputs,
            outputs,
            sensor: sensor.to_string(),
        })),
        aids: Vec::new(),
    })
}
