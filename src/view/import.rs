//! Parameters from a file of another program or from a datasheet.

use super::parameters::term_rows;
use crate::import::Imported;
use crate::params::Params;
use crate::report::{Level, Report, Section};
use crate::units::digits;

pub fn import<'a>(found: &Imported) -> Report<'a> {
    let rates: Vec<String> =
        found.sensors.iter().map(|p| format!("{} at {} Hz", p.quantity.name(), digits(p.sample_rate_hz))).collect();
    let parameters = Section::new("")
        .at(Level::Brief)
        .paragraph(format!("{}: {}", found.origin, rates.join(", ")))
        .table("", &["axis", "parameter", "value", "unit", "also"], found.sensors.iter().flat_map(rows));
    let rules = Section::new("").paragraphs(found.rules.iter().map(|rule| format!("{rule}.")).collect());
    Report { title: found.origin.to_string(), sections: vec![parameters, rules], ..Report::default() }
}

/// Axes that are alike in one row.
fn rows(params: &Params) -> Vec<Vec<String>> {
    let mut groups: Vec<(String, Vec<Vec<String>>)> = Vec::new();
    for axis in &params.axes {
        let spread =
            axis.turn_on_bias.iter().map(|v| ("turn-on bias sigma", v)).chain(axis.bias.iter().map(|v| ("bias", v)));
        let own: Vec<Vec<String>> = term_rows(&axis.terms, params.quantity, params.sample_rate_hz)
            .into_iter()
            // a file has no intervals
            .map(|row| [&row[..2], &row[4..]].concat())
            .chain(spread.map(|(name, v)| vec![name.into(), digits(v.value), v.unit.to_string(), String::new()]))
            .collect();
        match groups.iter_mut().find(|(_, rows)| *rows == own) {
            Some((names, _)) => *names += &format!(",{}", axis.name),
            None => groups.push((axis.name.clone(), own)),
        }
    }
    let named = |(names, rows): (String, Vec<Vec<String>>)| {
        rows.into_iter().map(move |row| [vec![names.clone()], row].concat())
    };
    groups.into_iter().flat_map(named).collect()
}
