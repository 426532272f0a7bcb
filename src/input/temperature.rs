//! The column with the temperature of the sensor: by its name or unit, or as a flag says it.

use super::columns::{Table, Temperature, same};
use super::names::{is_of, is_temperature, words};
use super::{AxisInfo, InputError, LogOptions};
use crate::signal::check::{Finding, FindingKind};
use crate::units::{Dimension, Quantity};

/// Which column is the temperature.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum TemperatureColumn {
    /// None is read.
    #[default]
    Ignored,
    /// The one that its name or unit tells, if there is one.
    Found,
    /// `NAME`, `NAME:degC`, `3`, `3:degC`.
    Named(String),
}

impl Table<'_> {
    /// The temperature beside `axes` of this quantity. What cannot be decided is an error where a flag asks for it,
    /// else a note.
    pub(super) fn temperature(
        &self,
        wanted: &TemperatureColumn,
        axes: &[usize],
        time: Option<usize>,
        quantity: Quantity,
    ) -> Result<Temperature, InputError> {
        match wanted {
            TemperatureColumn::Ignored => Ok(Temperature::default()),
            TemperatureColumn::Named(text) => {
                let column = self.named_temperature(text, axes, time)?;
                Ok(Temperature { column: Some(column), note: None })
            }
            TemperatureColumn::Found => Ok(self.temperature_by_name(axes, time, quantity)),
        }
    }

    fn named_temperature(
        &self,
        text: &str,
        axes: &[usize],
        time: Option<usize>,
    ) -> Result<(usize, AxisInfo), InputError> {
        let (column, flag) = self.with_unit(text.trim(), Dimension::TEMPERATURE)?;
        let head = self.heads[column];
        if axes.contains(&column) || time == Some(column) {
            let other = if time == Some(column) { "time" } else { "an axis" };
            return self.fail(format!("column '{}' is taken both as temperature and as {other}", head.full));
        }
        let unit = match (&head.unit, flag) {
            (Some(header), Some(flag)) if !same(header, &flag) => {
                return self.fail(format!(
                    "column '{}' is in {header} by its header, but `temperature` says {flag}",
                    head.full
                ));
            }
            (Some(unit), _) if unit.dimension() == Dimension::TEMPERATURE => unit.clone(),
            (None, Some(flag)) => flag,
            (found, _) => {
                let found = match found {
                    Some(unit) => format!("is in {unit} by its header, which is no temperature"),
                    None => "has no unit".into(),
                };
                return self.fail(format!(
                    "temperature column '{0}' {found}; say it with `temperature` \"{0}:degC\" (or K, degF)",
                    head.full
                ));
            }
        };
        Ok((column, AxisInfo { name: head.name.clone(), unit }))
    }

    /// A column in a unit of temperature, or with a word for it in its name; of several the one that names the sensor.
    fn temperature_by_name(&self, axes: &[usize], time: Option<usize>, quantity: Quantity) -> Temperature {
        let warm = |i: &usize| {
            let head = self.heads[*i];
            let by_unit = head.unit.as_ref().is_some_and(|unit| unit.dimension() == Dimension::TEMPERATURE);
            self.named && (by_unit || is_temperature(&words(&head.name)))
        };
        let free = |i: &usize| !axes.contains(i) && time != Some(*i);
        let mut hits: Vec<usize> = (0..self.heads.len()).filter(free).filter(warm).collect();
        let of_sensor: Vec<usize> =
            hits.iter().copied().filter(|i| is_of(&words(&self.heads[*i].name), quantity)).collect();
        if hits.len() > 1 && of_sensor.len() == 1 {
            hits = of_sensor;
        }
        let full = |i: &usize| format!("'{}'", self.heads[*i].full);
        match hits[..] {
            [] => Temperature::default(),
            [column] => {
                let head = self.heads[column];
                match head.unit.as_ref().filter(|unit| unit.dimension() == Dimension::TEMPERATURE) {
                    Some(unit) => {
                        let info = AxisInfo { name: head.name.clone(), unit: unit.clone() };
                        Temperature { column: Some((column, info)), note: None }
                    }
                    None => Temperature::passed_over(format!(
                        "column '{0}' looks like a temperature, but its unit is not known; say it with `temperature` \
                         \"{0}:degC\" (or K, degF)",
                        head.full
                    )),
                }
            }
            _ => {
                let names: Vec<String> = hits.iter().map(full).collect();
                Temperature::passed_over(format!(
                    "several columns could be the temperature: {}; choose with `temperature`",
                    names.join(", ")
                ))
            }
        }
    }
}

/// The column and its values.
type Read = (AxisInfo, Vec<f64>);

/// The temperature as read, or the note why there is none; the error is what is wrong with a column that was asked for.
pub(super) fn usable(
    found: Temperature,
    values: Option<Vec<f64>>,
    options: &LogOptions,
) -> Result<(Option<Read>, Option<Finding>), String> {
    let note = |message: String| Finding::note(FindingKind::Temperature, message);
    match (found.column, values) {
        (Some((_, info)), Some(values)) if !values.iter().any(|v| v.is_finite()) => {
            let message = format!("temperature column '{}' holds no number in {} rows", info.name, values.len());
            match options.temperature {
                TemperatureColumn::Named(_) => Err(message),
                _ => Ok((None, Some(note(message)))),
            }
        }
        (Some((_, info)), Some(values)) => Ok((Some((info, values)), None)),
        _ => Ok((None, found.note.map(note))),
    }
}
