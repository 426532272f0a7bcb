//! Names and units of parameters.

use super::super::shape::{Role, document_name};
use super::form::Form;
use crate::noise::Kind;
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
        Role::Coefficient => super::super::coefficient_unit(form.pieces()[piece].kind(), display),
    }
}

/// `gauss_markov[1]`.
pub(super) fn term_name(kind: Kind, number: usize) -> String {
    if number == 0 { document_name(kind).to_string() } else { format!("{}[{number}]", document_name(kind)) }
}

/// `gauss_markov[1].std_dev`.
pub(super) fn parameter_name(kind: Kind, number: usize, role: Role) -> String {
    let place = term_name(kind, number);
    match role {
        Role::CorrelationTime => format!("{place}.correlation_time"),
        Role::Frequency => format!("{place}.frequency"),
        Role::Shape => format!("{place}.shape"),
        Role::Coefficient => match kind {
            Kind::GaussMarkov | Kind::Oscillation => format!("{place}.std_dev"),
            Kind::White | Kind::MovingAverage | Kind::BandLimit | Kind::RateRandomWalk => format!("{place}.density"),
            Kind::RateRamp => format!("{place}.slope"),
            Kind::Quantization | Kind::BiasInstability => format!("{place}.coefficient"),
        },
    }
}
