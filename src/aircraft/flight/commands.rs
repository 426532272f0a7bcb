//! Commands of the surfaces over time: fixed, or by a file of rows.

use std::path::Path;

use super::FlightError;
use super::document::ControlsEntry;
use super::surfaces::CONTROLS;
use crate::aircraft::airframe::{Airplane, Propulsion};
use crate::params::Measured;
use crate::units::{Dimension, Unit};

/// Names of the surfaces in documents and files.
pub(super) const SURFACES: [&str; 3] = ["elevator", "aileron", "rudder"];

/// Names of all controls of an airplane.
pub(super) fn names(airplane: &Airplane) -> [&'static str; CONTROLS] {
    let [elevator, aileron, rudder] = SURFACES;
    let propulsion = match airplane.propulsion {
        Propulsion::Motor(_) => "throttle",
        Propulsion::Thrust { .. } => "thrust",
    };
    [elevator, aileron, rudder, propulsion]
}

/// SI; each row holds until the next.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Commands {
    pub fixed: [f64; CONTROLS],
    /// Time and commands; the first row is at or before the start.
    pub rows: Vec<(f64, [f64; CONTROLS])>,
}

impl Commands {
    pub(super) fn at_start(&self) -> [f64; CONTROLS] {
        let before = self.rows.iter().take_while(|(time, _)| *time <= 0.0).last();
        before.map_or(self.fixed, |(_, row)| *row)
    }
}

/// `trim`: what is not given; `None` refuses that. Errors: a control nobody gives or that the airplane does not have, a
/// file that cannot be read or ends before `duration` (s).
pub(super) fn read(
    entry: &ControlsEntry,
    folder: &Path,
    airplane: &Airplane,
    trim: Option<[f64; CONTROLS]>,
    duration: f64,
) -> Result<Commands, FlightError> {
    let angle = |m: &Option<Measured>| m.as_ref().map(Measured::si);
    let names = names(airplane);
    let (throttle, other) = match airplane.propulsion {
        Propulsion::Motor(_) => (entry.throttle, entry.thrust.as_ref().map(|_| "thrust")),
        Propulsion::Thrust { .. } => (angle(&entry.thrust), entry.throttle.map(|_| "throttle")),
    };
    if let Some(other) = other {
        return Err(FlightError(format!("controls.{other}: this airplane has none; give its {}", names[3])));
    }
    let given = [angle(&entry.elevator), angle(&entry.aileron), angle(&entry.rudder), throttle];
    let table = entry.file.as_ref().map(|file| table(&folder.join(file), names)).transpose()?;
    let in_file = |i: usize| table.as_ref().and_then(|t| t.columns[i]);
    let mut fixed = [0.0; CONTROLS];
    for (i, name) in names.iter().enumerate() {
        if let (Some(_), Some(file)) = (given[i].and(in_file(i)), &entry.file) {
            return Err(FlightError(format!("controls.{name}: stands in {} too; give it once", file.display())));
        }
        fixed[i] = match (given[i], trim, in_file(i)) {
            (Some(value), _, _) => value,
            (None, Some(trim), _) => trim[i],
            (None, None, Some(_)) => 0.0,
            (None, None, None) => {
                return Err(FlightError(format!(
                    "controls.{name}: missing; give it, or a trim from which it is taken"
                )));
            }
        };
    }
    let Some(table) = table else { return Ok(Commands { fixed, rows: Vec::new() }) };
    if table.rows.first().is_none_or(|row| row.0 > 0.0) {
        return Err(FlightError(format!("{}: the first row must be at or before 0 s", table.shown)));
    }
    let last = table.rows.last().map_or(0.0, |row| row.0);
    if last < duration {
        return Err(FlightError(format!(
            "{}: ends at {last} s, before the {duration} s of the flight; add rows, or fly shorter with `duration`",
            table.shown
        )));
    }
    let row = |values: &[f64]| std::array::from_fn(|i| table.columns[i].map_or(fixed[i], |column| values[column]));
    let rows = table.rows.iter().map(|(time, values)| (*time, row(values))).collect();
    Ok(Commands { fixed, rows })
}

/// A file of commands, SI.
struct Table {
    shown: String,
    /// Which column of the values is which control.
    columns: [Option<usize>; CONTROLS],
    rows: Vec<(f64, Vec<f64>)>,
}

/// A csv with a header of names and units, `time (s),elevator (deg)`.
fn table(path: &Path, names: [&str; CONTROLS]) -> Result<Table, FlightError> {
    let shown = path.display().to_string();
    let fail = |what: String| FlightError(format!("{shown}: {what}"));
    let text = std::fs::read_to_string(path).map_err(|e| fail(format!("cannot read: {e}")))?;
    let mut lines = (1..).zip(text.lines()).filter(|(_, line)| !line.trim().is_empty());
    let (_, header) =
        lines.next().ok_or_else(|| fail("empty; expected a header, time (s),elevator (deg), and rows".into()))?;
    let mut time = None;
    let mut columns = [None; CONTROLS];
    let mut scales = Vec::new();
    for (i, cell) in header.trim_start_matches('\u{feff}').split(',').enumerate() {
        let cell = cell.trim().trim_matches('"');
        let (name, unit) = match cell.split_once('(') {
            Some((name, unit)) => (name.trim(), Some(unit.trim_end_matches(')').trim())),
            None => (cell, None),
        };
        let control = names.iter().position(|known| *known == name);
        let dimension = match (name, control) {
            ("time", _) => Dimension::TIME,
            ("thrust", Some(_)) => Dimension::FORCE,
            ("throttle", Some(place)) => {
                columns[place] = Some(i);
                scales.push(1.0);
                continue;
            }
            (_, Some(_)) => Dimension::new(2, 0, 0),
            _ => return Err(fail(format!("column '{cell}' is not known; known are time, {}", names.join(", ")))),
        };
        let example = dimension.example();
        let unit = unit.ok_or_else(|| fail(format!("column '{cell}' says no unit; write '{name} ({example})'")))?;
        let unit = Unit::parse(unit).map_err(|e| fail(format!("column '{cell}': {e}")))?;
        unit.require(dimension).map_err(|e| fail(format!("column '{cell}': {e}")))?;
        scales.push(unit.scale());
        let place = control.map_or(&mut time, |control| &mut columns[control]);
        if place.replace(i).is_some() {
            return Err(fail(format!("column '{name}' stands twice")));
        }
    }
    let time = time.ok_or_else(|| fail("no column 'time (s)'".into()))?;
    let mut rows: Vec<(f64, Vec<f64>)> = Vec::new();
    for (number, line) in lines {
        let values: Vec<f64> = line.split(',').map(|cell| cell.trim().parse().unwrap_or(f64::NAN)).collect();
        if values.len() != scales.len() || values.iter().any(|x| !x.is_finite()) {
            return Err(fail(format!("line {number}: expected {} numbers, found '{}'", scales.len(), line.trim())));
        }
        let values: Vec<f64> = values.iter().zip(&scales).map(|(x, scale)| x * scale).collect();
        if let Some((before, _)) = rows.last().filter(|(before, _)| *before >= values[time]) {
            return Err(fail(format!(
                "line {number}: time goes from {before} s to {} s; expected it to rise",
                values[time]
            )));
        }
        rows.push((values[time], values));
    }
    Ok(Table { shown, columns, rows })
}
