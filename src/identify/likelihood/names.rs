//! Names and units of parameters.

use super::form::Form;
use crate::noise::{Kind, Role};
use crate::units::Unit;

/// Of a logarithm: its name in params.json.
pub(super) fn name_of(form: &Form, index: usize) -> String {
    let (piece, role) = form.roles()[index];
    let kind = form.pieces()[piece].kind();
    let number = form.pieces()[..piece].iter().filter(|p| p.kind() == kind).count();
    parameter_name(kind, number, role)
}

/// Of a logarithm: the unit of its parameter in the family of the log's unit.
pub(super) fn unit_of(form: &Form, index: usize, display: &Unit) -> Unit {
    let (piece, role) = form.roles()[index];
    match role {
        Role::CorrelationTime => Unit::second(),
        Role::Frequency => Unit::hertz(),
        Role::Shape => Unit::one(),
        Role::Coefficient => display.times_time(form.pieces()[piece].kind().half_seconds()),
    }
}

/// `gauss_markov[1]`.
pub(super) fn term_name(kind: Kind, number: usize) -> String {
    if number == 0 { kind.name().to_string() } else { format!("{}[{number}]", kind.name()) }
}

/// `gauss_markov[1].std_dev`.
pub(super) fn parameter_name(kind: Kind, number: usize, role: Role) -> String {
    let place = term_name(kind, number);
    let index = kind.roles().iter().position(|other| *other == role);
    format!("{place}.{}", index.map_or("shape", |index| kind.parameters()[index]))
}
