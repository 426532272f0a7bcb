//! filter.json into a [`FilterDesign`], with the place of every complaint.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector};
use serde_json::Value;

use super::design::{AIRPLANE, AxisDesign, FilterDesign};
use super::steady_state::{SteadyState, steady_state};
use crate::model::{LinearModel, ModelError, Named, Output};
use crate::params::place::{KeyError, Object, Place};
use crate::params::{self, AxisParams, Design, Measured, PLANTS, Range};
use crate::units::{Dimension, Quantity, Unit, digits};

/// Layout of filter.json.
const FORMAT: &str = "kfdesign-filter/1";

/// A steady state whose gain differs by more than this, relative to the largest gain, belongs to another model.
const GAIN_TOLERANCE: f64 = 1e-6;

/// The whole document.
pub(super) fn design(root: &Place<'_>) -> Result<FilterDesign, KeyError> {
    let known = ["format", "quantity", "sample_rate", "plant", "design", "axes", "tuning"];
    let object = root.document(FORMAT, "a filter file", &known)?;
    let quantity = params::quantity(&object.required("quantity")?)?;
    let rate = Measured::from_place(&object.required("sample_rate")?, Dimension::FREQUENCY, Range::Positive)?;
    let sample_rate_hz = rate.si();
    let plant_place = object.required("plant")?;
    let name = plant_place.text()?;
    let plant = PLANTS
        .into_iter()
        .chain([AIRPLANE])
        .find(|p| *p == name)
        .ok_or_else(|| plant_place.error(params::unknown_plant(name)))?;
    let section =
        object.optional("design").map(|place| Ok((place.clone(), Design::from_place(&place)?))).transpose()?;
    if let Some((place, design)) = section.as_ref().filter(|(_, design)| design.plant.name() != plant) {
        return Err(place.error(format!("is of the plant '{}', the filter of '{plant}'", design.plant.name())));
    }
    let design = section.map(|(_, design)| design);
    let list = object.required("axes")?;
    let mut axes: Vec<AxisDesign> = Vec::new();
    for place in list.list()? {
        let axis = axis(&place, quantity, plant, 1.0 / sample_rate_hz)?;
        if let Some(earlier) = axes.iter().position(|a| a.name == axis.name) {
            let key = format!("{}.name", place.key());
            return Err(KeyError { key, message: format!("'{}' is the name of axes[{earlier}] too", axis.name) });
        }
        axes.push(axis);
    }
    if axes.is_empty() {
        return Err(list.error("there is no axis; at least one is needed"));
    }
    let tuning = object.optional("tuning").map_or(Value::Null, |place| place.value().clone());
    Ok(FilterDesign { quantity, sample_rate_hz, plant: plant.to_owned(), design, axes, tuning })
}

fn axis(place: &Place<'_>, quantity: Quantity, plant: &str, dt: f64) -> Result<AxisDesign, KeyError> {
    let object = place.object(&[
        "name",
        "states",
        "inputs",
        "measurements",
        "outputs",
        "F",
        "G",
        "H",
        "Q",
        "R",
        "x0",
        "P0",
        "steady_state",
        "noise",
        "about",
    ])?;
    let name_place = object.required("name")?;
    let name = name_place.text()?.to_owned();
    if name.trim().is_empty() {
        return Err(name_place.error("the name of an axis must be readable"));
    }
    let model = model(&object, quantity, plant, dt)?;
    model.check().map_err(|error| match error {
        ModelError::Part { part, message } => KeyError { key: format!("{}.{part}", place.key()), message },
        other => place.error(other.to_string()),
    })?;
    let steady_state = steady(&object, place, &model)?;
    let noise = match object.optional("noise") {
        Some(noise) => AxisParams::from_place(&noise, quantity)?,
        None => AxisParams {
            name: name.clone(),
            bias: None,
            turn_on_bias: None,
            temperature: None,
            terms: Vec::new(),
            not_identified: Vec::new(),
        },
    };
    let about = object.optional("about").map_or(Ok(BTreeMap::new()), |place| about(&place, &model))?;
    Ok(AxisDesign { name, model, steady_state, noise, about })
}

/// Values of inputs and measurements, by name.
fn about(place: &Place<'_>, model: &LinearModel) -> Result<BTreeMap<String, f64>, KeyError> {
    let known: Vec<&str> = model.inputs.iter().chain(&model.measurements).map(|named| named.name.as_str()).collect();
    let object = place.object(&known)?;
    let value = |name: &&str| Some((object.optional(name)?.number(), (*name).to_owned()));
    known.iter().filter_map(value).map(|(number, name)| Ok((name, number?))).collect()
}

/// The matrices as they stand; [`LinearModel::check`] judges them.
fn model(object: &Object<'_>, quantity: Quantity, plant: &str, dt: f64) -> Result<LinearModel, KeyError> {
    let states = named_list(&object.required("states")?)?;
    let inputs = object.optional("inputs").map_or(Ok(Vec::new()), |place| inputs(&place, plant))?;
    let (mut measurements, mut every) = (Vec::new(), Vec::new());
    for place in object.required("measurements")?.list()? {
        let entry = place.object(&["name", "unit", "every"])?;
        measurements.push(named(&entry)?);
        let count = entry.optional("every").map_or(Ok(1), |place| place.count())?;
        every.push(usize::try_from(count).unwrap_or(usize::MAX));
    }
    check_measurements(&object.required("measurements")?, &measurements, quantity, plant)?;
    let outputs = object.optional("outputs").map_or(Ok(Vec::new()), |place| place.list())?;
    let outputs = outputs.iter().map(output).collect::<Result<Vec<_>, _>>()?;
    let required = |key: &str| matrix(&object.required(key)?);
    let n = states.len();
    Ok(LinearModel {
        dt,
        f: required("F")?,
        g: input_matrix(object.optional("G"), n, inputs.len())?,
        h: required("H")?,
        q: required("Q")?,
        r: required("R")?,
        x0: DVector::from_vec(numbers(&object.required("x0")?)?),
        p0: required("P0")?,
        states,
        inputs,
        measurements,
        every,
        outputs,
    })
}

/// A sensor at rest and one that measures a rate have no input, one that is integrated has one; a custom plant has any.
fn inputs(place: &Place<'_>, plant: &str) -> Result<Vec<Named>, KeyError> {
    let inputs = named_list(place)?;
    let expected = match plant {
        "static" | "rate" => 0,
        "angle" | "vertical" => 1,
        _ => inputs.len(),
    };
    if inputs.len() != expected {
        return Err(place.error(format!("found {}; the plant '{plant}' has {expected}", inputs.len())));
    }
    Ok(inputs)
}

fn output(place: &Place<'_>) -> Result<Output, KeyError> {
    let entry = place.object(&["name", "unit", "row"])?;
    let Named { name, unit } = named(&entry)?;
    Ok(Output { name, unit, row: numbers(&entry.required("row")?)? })
}

/// G may be left out or be `[]` when there are no inputs.
fn input_matrix(place: Option<Place<'_>>, n: usize, inputs: usize) -> Result<DMatrix<f64>, KeyError> {
    let g = place.map_or_else(|| Ok(DMatrix::zeros(0, 0)), |place| matrix(&place))?;
    Ok(if g.is_empty() && inputs == 0 { DMatrix::zeros(n, 0) } else { g })
}

/// The plant says of what dimension the measurements are, and of a sensor at rest that there is one.
fn check_measurements(
    place: &Place<'_>,
    measurements: &[Named],
    quantity: Quantity,
    plant: &str,
) -> Result<(), KeyError> {
    if plant == "static" && measurements.len() != 1 {
        return Err(place.error(format!("found {} measurements; the plant 'static' has 1", measurements.len())));
    }
    let allowed: &[&str] = match plant {
        "static" => &[quantity.si_unit()],
        "angle" => &["rad"],
        "rate" => &["rad/s"],
        "vertical" => &["rad", "m/s^2"],
        _ => return Ok(()),
    };
    let dimension = |text: &str| Unit::parse(text).map(|u| u.dimension());
    for (i, found) in measurements.iter().enumerate() {
        if allowed.iter().all(|unit| dimension(unit) != dimension(&found.unit)) {
            let key = format!("{}[{i}].unit", place.key());
            return Err(KeyError { key, message: format!("found {}; expected {}", found.unit, allowed.join(" or ")) });
        }
    }
    Ok(())
}

fn named_list(place: &Place<'_>) -> Result<Vec<Named>, KeyError> {
    place.list()?.iter().map(|entry| named(&entry.object(&["name", "unit"])?)).collect()
}

fn named(entry: &Object<'_>) -> Result<Named, KeyError> {
    let name = entry.required("name")?.text()?.to_owned();
    let place = entry.required("unit")?;
    let text = place.text()?;
    let unit = Unit::parse(text).map_err(|e| place.error(e.to_string()))?;
    if unit.scale() != 1.0 {
        return Err(place.error(format!("'{text}' is not an SI unit; the matrices of a filter are in SI")));
    }
    Ok(Named { name, unit: text.to_owned() })
}

fn numbers(place: &Place<'_>) -> Result<Vec<f64>, KeyError> {
    place.list()?.iter().map(Place::number).collect()
}

/// Rows of equal length; `[]` and `[[], []]` are matrices without columns.
fn matrix(place: &Place<'_>) -> Result<DMatrix<f64>, KeyError> {
    let rows = place.list()?.iter().map(numbers).collect::<Result<Vec<_>, _>>()?;
    let columns = rows.first().map_or(0, Vec::len);
    if let Some((i, row)) = rows.iter().enumerate().find(|(_, row)| row.len() != columns) {
        return Err(place.error(format!("row {i} has {} numbers but row 0 has {columns}", row.len())));
    }
    Ok(DMatrix::from_fn(rows.len(), columns, |i, j| rows[i][j]))
}

/// The documented steady state, checked against the model's own; computed when it is left out.
fn steady(object: &Object<'_>, axis: &Place<'_>, model: &LinearModel) -> Result<SteadyState, KeyError> {
    let computed = steady_state(model);
    let Some(place) = object.optional("steady_state") else {
        return computed.map_err(|e| axis.error(format!("{e} (no steady_state is given)")));
    };
    let documented = documented_steady_state(&place, model.states.len(), model.measurements.len())?;
    if let Ok(computed) = computed {
        let difference = (&documented.gain - &computed.gain).amax();
        let size = computed.gain.amax().max(documented.gain.amax());
        if difference > GAIN_TOLERANCE * size {
            return Err(place.error(format!(
                "does not belong to F, H, Q, R: its gain is {} away from theirs; leave steady_state out and it is \
                 computed",
                digits(difference)
            )));
        }
    }
    Ok(documented)
}

fn documented_steady_state(place: &Place<'_>, n: usize, m: usize) -> Result<SteadyState, KeyError> {
    let entry = place.object(&[
        "period",
        "gain",
        "predicted_covariance",
        "innovation_covariance",
        "poles",
        "settling_time",
        "residual",
        "eigenvector_difference",
    ])?;
    let sized = |key: &str, rows: usize, columns: usize| {
        let place = entry.required(key)?;
        let a = matrix(&place)?;
        if a.shape() != (rows, columns) {
            return Err(place.error(format!("found {} x {}; expected {rows} x {columns}", a.nrows(), a.ncols())));
        }
        Ok(a)
    };
    let poles = entry.required("poles")?;
    let pairs = poles.list()?.iter().map(pole).collect::<Result<Vec<_>, _>>()?;
    if pairs.len() != n {
        return Err(poles.error(format!("found {} poles; expected {n}, one per state", pairs.len())));
    }
    let settling = entry.required("settling_time")?;
    let settling_time = Measured::from_place(&settling, Dimension::TIME, Range::Any)?.si();
    if settling_time < 0.0 {
        return Err(settling.error(format!("found {settling_time} s; a time cannot be negative")));
    }
    let figure = |key: &str| entry.optional(key).map_or(Ok(f64::NAN), |place| place.number());
    let period = entry.optional("period").map_or(Ok(1), |place| place.count())?;
    Ok(SteadyState {
        period: period.max(1),
        gain: sized("gain", n, m)?,
        predicted_covariance: sized("predicted_covariance", n, n)?,
        innovation_covariance: sized("innovation_covariance", m, m)?,
        poles: pairs,
        settling_time,
        residual: figure("residual")?,
        eigenvector_difference: figure("eigenvector_difference")?,
    })
}

fn pole(place: &Place<'_>) -> Result<(f64, f64), KeyError> {
    match numbers(place)?.as_slice() {
        [re, im] => Ok((*re, *im)),
        other => Err(place.error(format!("expected [re, im], found {} numbers", other.len()))),
    }
}
