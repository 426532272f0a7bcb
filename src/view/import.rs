//! Parameters from a file of another program or from a datasheet.

use super::alike;
use super::parameters::term_rows;
use crate::import::Imported;
use crate::params::{AxisParams, Params};
use crate::report::{Report, Section};
use crate::units::digits;

pub fn import<'a>(found: &Imported) -> Report<'a> {
    let rates: Vec<String> =
        found.sensors.iter().map(|p| format!("{} at {} Hz", p.quantity.name(), digits(p.sample_rate_hz))).collect();
    let parameters = Section::new("").paragraph(format!("{}: {}", found.origin, rates.join(", "))).table(
        "",
        &["axis", "parameter", "value", "unit", "also"],
        found.sensors.iter().flat_map(rows),
    );
    let rules = Section::new("").paragraphs(found.rules.iter().map(|rule| format!("{rule}.")).collect());
    Report { title: found.origin.to_string(), sections: vec![parameters, rules], ..Report::default() }
}

/// Axes that are alike in one row.
fn rows(params: &Params) -> Vec<Vec<String>> {
    let of_axis = |axis: &AxisParams| -> Vec<Vec<String>> {
        let spread = axis.turn_on_bias.iter().map(|v| ("turn-on bias sigma", v));
        let bias = spread.chain(axis.bias.iter().map(|v| ("bias", v)));
        // a file has no intervals
        let terms = term_rows(&axis.terms, params.quantity, params.sample_rate_hz).into_iter();
        let terms = terms.map(|row| [&row[..2], &row[4..]].concat());
        terms
            .chain(bias.map(|(name, v)| vec![name.into(), digits(v.value), v.unit.to_string(), String::new()]))
            .collect()
    };
    let groups = alike(params.axes.iter().map(|axis| (axis.name.as_str(), of_axis(axis))), |a, b| a == b);
    let named = |(names, rows): (Vec<&str>, Vec<Vec<String>>)| {
        let names = names.join(",");
        rows.into_iter().map(move |row| [vec![names.clone()], row].concat())
    };
    groups.into_iter().flat_map(named).collect()
}
