//! One kind of axis as the templates show it: sizes, names, and the entries of its matrices that are not zero.

use nalgebra::DMatrix;
use serde::Serialize;

use super::names::{comment, identifier, number, unique};
use super::vectors::{Vectors, vectors};
use super::{Code, Gain, Precision};
use crate::filter::{AxisDesign, ConstantGain};
use crate::model::{LinearModel, Named, Output};
use crate::units::digits;

/// Places in a matrix are written in one byte.
const MOST_STATES: usize = 255;
/// Of numbers in single precision, so that products of two do not leave its range.
const SINGLE: std::ops::RangeInclusive<f64> = 1e-30..=1e15;
const TURN: &str = "rad";

/// Axes with the same numbers.
#[derive(Serialize)]
pub(super) struct Part {
    /// Of functions and constants.
    prefix: String,
    upper: String,
    /// Names of the axes.
    axes: String,
    states: Vec<Item>,
    inputs: Vec<Item>,
    measurements: Vec<Item>,
    outputs: Vec<Item>,
    /// Some measurement is an angle, known to whole turns.
    turns: bool,
    /// F, or F − I in single precision.
    transition: Vec<Entry>,
    drive: Vec<Entry>,
    /// Row: measurement.
    seen: Vec<Entry>,
    /// Lower triangle, row by row.
    noise: Vec<Entry>,
    variance: Vec<String>,
    start: Vec<String>,
    /// Lower triangle of P0.
    spread: Vec<Entry>,
    /// Row: output.
    combined: Vec<Entry>,
    /// Constant form: row: measurement, column: state.
    gains: Vec<Entry>,
    /// S of each.
    innovation: Vec<String>,
    /// P0 hᵀ, likewise, and h P0 hᵀ.
    first: Vec<Entry>,
    first_variance: Vec<String>,
    settling: String,
    vectors: Vectors,
}

#[derive(Serialize)]
struct Item {
    /// As the document has it.
    name: String,
    unit: String,
    /// In a constant's name.
    upper: String,
    /// Measurements: every n-th sample; whether it is an angle.
    every: usize,
    turn: bool,
    /// Constant form: claimed sigma of a state; empty in the full form.
    sigma: String,
}

#[derive(Serialize)]
struct Entry {
    row: usize,
    column: usize,
    value: String,
}

impl Part {
    /// Errors: too many states, a number outside the range of single precision.
    pub(super) fn new(axis: &AxisDesign, names: &[&str], prefix: String, code: &Code) -> Result<Part, String> {
        let model = &axis.model;
        let n = model.states.len();
        if n > MOST_STATES || model.measurements.len() > MOST_STATES || model.inputs.len() > MOST_STATES {
            return Err(format!("{n} states; code is made for at most {MOST_STATES} states, inputs or measurements"));
        }
        if n == 0 || model.h.iter().all(|h| *h == 0.0) {
            return Err("there is no state that a measurement sees, and so nothing to compute".into());
        }
        let float = code.precision == Precision::Float;
        if float {
            in_range(model)?;
        }
        let drift = Output {
            name: crate::model::DRIFT.to_owned(),
            unit: model.measurements[0].unit.clone(),
            row: model.drift_row().iter().copied().collect(),
        };
        let outputs = if model.outputs.is_empty() { std::slice::from_ref(&drift) } else { &model.outputs };
        let combined = DMatrix::from_fn(outputs.len(), n, |i, j| outputs[i].row.get(j).copied().unwrap_or(0.0));
        let transition = if float { &model.f - DMatrix::identity(n, n) } else { model.f.clone() };
        let constant = ConstantGain::new(model, &axis.steady_state);
        let gains = DMatrix::from_fn(model.measurements.len(), n, |i, j| constant.gain(i).0[j]);
        let first = &model.h * &model.p0;
        let of = |values: &mut dyn Iterator<Item = f64>| values.map(|v| number(v, float)).collect::<Vec<_>>();
        let claimed = |i: usize| match code.gain {
            Gain::Full => String::new(),
            Gain::Constant => number(constant.p()[(i, i)].max(0.0).sqrt(), float),
        };
        let entries = |a: &DMatrix<f64>| entries(a, float, false);
        Ok(Part {
            upper: prefix.to_ascii_uppercase(),
            prefix,
            axes: comment(&names.join(", ")),
            states: items(&model.states, &[], claimed),
            inputs: items(&model.inputs, &[], |_| String::new()),
            measurements: items(&model.measurements, &model.every, |_| String::new()),
            outputs: {
                let named: Vec<Named> =
                    outputs.iter().map(|o| Named { name: o.name.clone(), unit: o.unit.clone() }).collect();
                items(&named, &[], |_| String::new())
            },
            turns: model.measurements.iter().any(|m| m.unit == TURN),
            transition: entries(&transition),
            drive: entries(&model.g),
            seen: entries(&model.h),
            noise: self::entries(&model.q, float, true),
            variance: of(&mut model.r.diagonal().iter().copied()),
            start: of(&mut model.x0.iter().copied()),
            spread: self::entries(&model.p0, float, true),
            combined: entries(&combined),
            gains: entries(&gains),
            innovation: of(&mut (0..model.measurements.len()).map(|i| constant.gain(i).1)),
            first_variance: of(&mut (&first * model.h.transpose()).diagonal().iter().copied()),
            first: entries(&first),
            settling: digits(axis.steady_state.settling_time),
            vectors: vectors(axis, code),
        })
    }
}

fn items(named: &[Named], every: &[usize], sigma: impl Fn(usize) -> String) -> Vec<Item> {
    let mut taken = Vec::new();
    let item = |(i, named): (usize, &Named)| Item {
        name: comment(&named.name),
        unit: comment(&named.unit),
        upper: unique(&identifier(&named.name).to_ascii_uppercase(), &mut taken),
        every: every.get(i).copied().unwrap_or(1).max(1),
        turn: named.unit == TURN,
        sigma: sigma(i),
    };
    named.iter().enumerate().map(item).collect()
}

/// Row by row; of a symmetric matrix the lower triangle.
fn entries(a: &DMatrix<f64>, float: bool, lower: bool) -> Vec<Entry> {
    let places = (0..a.nrows())
        .flat_map(|row| (0..a.ncols()).map(move |column| (row, column)))
        .filter(|(i, j)| !lower || j <= i);
    places
        .filter(|&place| a[place] != 0.0)
        .map(|(row, column)| Entry { row, column, value: number(a[(row, column)], float) })
        .collect()
}

fn in_range(model: &LinearModel) -> Result<(), String> {
    let x0 = DMatrix::from_column_slice(model.x0.len(), 1, model.x0.as_slice());
    let parts = [
        ("F", &model.f),
        ("G", &model.g),
        ("H", &model.h),
        ("Q", &model.q),
        ("R", &model.r),
        ("x0", &x0),
        ("P0", &model.p0),
    ];
    for (name, a) in parts {
        if let Some(value) = a.iter().find(|v| **v != 0.0 && !SINGLE.contains(&v.abs())) {
            return Err(format!(
                "{name} holds {}, which single precision does not carry; give `precision` double",
                digits(*value)
            ));
        }
    }
    Ok(())
}
