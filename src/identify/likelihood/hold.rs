//! Parameters that keep a value that was given, and what that costs.
//!
//! The terms are chosen, and the maximum found, as if nothing were held; from there the held parameters are moved to
//! their values in small steps, the others following (the path of the profile likelihood). Twice the loss of ln L is
//! χ² with one degree of freedom for each if the values are true (Wilks 1938).

use schemars::JsonSchema;
use serde::Serialize;

use super::interval::{Precision, precisions};
use super::names::parameter_name;
use super::ordinates::Ordinates;
use super::whittle::Fit;
use super::{Candidates, Fitted, IdentifyError, refine};
use crate::filter::likelihood::Stretch;
use crate::noise::{Kind, Role};
use crate::numerics::distribution::chi_square_sf;
use crate::params::place::meant;
use crate::units::{Unit, digits};

/// Steps from the free maximum to the held values. A correlation time is searched between two samples and ten lengths
/// of the log, for a log of a million samples a factor of e¹⁵: no step is much longer than a factor of e.
const STEPS: usize = 15;

/// A parameter that keeps a value.
#[derive(Clone, Debug, PartialEq)]
pub struct Hold {
    /// As in params.json: `gauss_markov.correlation_time`, `gauss_markov[1].std_dev`.
    pub parameter: String,
    pub value: f64,
    pub unit: Unit,
}

/// What the log says of a parameter that was held, in the unit of the hold.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Held {
    pub parameter: String,
    pub value: f64,
    pub unit: String,
    /// Where the log puts it.
    pub free: f64,
    /// 95 %, an open end null; absent where the log says nothing.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub interval: Option<[Option<f64>; 2]>,
    /// The value is in that interval.
    pub inside: bool,
}

/// What holding costs.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct HoldCost {
    pub parameters: Vec<Held>,
    /// ln L of the log with the values held, less that of the free maximum.
    pub log_likelihood: f64,
    /// Of so large a loss or a larger one if the values are true.
    pub p_value: f64,
}

impl Candidates {
    /// The chosen candidate with parameters held; `name`: of the axis. Errors: a parameter that the model lacks, a unit
    /// that is not its own, a value that no search can reach.
    pub(super) fn holding(
        mut self,
        holds: &[Hold],
        name: &str,
        display: &Unit,
        logs: &[Vec<Stretch<'_>>],
    ) -> Result<Candidates, IdentifyError> {
        if holds.is_empty() {
            return Ok(self);
        }
        let Some((free, refined)) = self.refined.take() else { return Ok(self) };
        let found = numbered(&free.fit, display);
        let mut held: Vec<(usize, f64, &Hold)> = Vec::new();
        for hold in holds {
            let failed =
                |message: String| IdentifyError { message: format!("{name}: hold {}: {message}", hold.parameter) };
            let Some((_, index, unit)) = found.iter().find(|(parameter, ..)| *parameter == hold.parameter) else {
                let known: Vec<&str> = found.iter().map(|(parameter, ..)| parameter.as_str()).collect();
                let model = free.fit.form.label();
                let meant = meant(&hold.parameter, known.iter().copied());
                let known = known.join(", ");
                return Err(failed(format!("the model {model} has no such parameter; {meant}it has {known}")));
            };
            hold.unit.require(unit.dimension()).map_err(|error| failed(error.to_string()))?;
            let value = hold.unit.to_si(hold.value);
            if !(value > 0.0 && value.is_finite()) {
                return Err(failed(format!("{} {}: expected a value above zero", hold.value, hold.unit)));
            }
            if held.iter().any(|(other, ..)| other == index) {
                return Err(failed("it is held twice".into()));
            }
            held.push((*index, value.ln(), hold));
        }
        let at: Vec<(usize, f64)> = held.iter().map(|(index, log, _)| (*index, *log)).collect();
        let fit = followed(&self.data, &free.fit, &at).ok_or_else(|| IdentifyError {
            message: format!("{name}: the likelihood cannot be computed with these values held"),
        })?;
        let known = precisions(&self.data, &fit);
        let (mut fitted, exact) = refine(&self.data, &fit, &known, &fit, logs);
        for (index, log) in &at {
            let all = f64::INFINITY;
            fitted.known[*index] =
                Precision { sigma: all, bound: all, lower: Some(*log), upper: Some(*log), told: true };
        }
        let loss = match (&refined, &exact) {
            (Some(free), Some(held)) => held.log_likelihood - free.log_likelihood,
            _ => fit.log_likelihood - free.fit.log_likelihood,
        };
        self.biases = exact.as_ref().map_or(self.biases, |exact| exact.biases.clone());
        self.hold = Some(HoldCost {
            parameters: held.iter().map(|(index, log, hold)| said(&free, *index, *log, hold)).collect(),
            log_likelihood: loss,
            p_value: chi_square_sf((-2.0 * loss).max(0.0), held.len() as f64),
        });
        self.refined = Some((fitted, exact));
        Ok(self)
    }
}

/// The maximum with the logarithms held at these values, followed from the free one.
fn followed(data: &Ordinates, free: &Fit, at: &[(usize, f64)]) -> Option<Fit> {
    let mut fit = Fit { held: at.iter().map(|(index, _)| *index).collect(), ..free.clone() };
    for step in 1..=STEPS {
        let share = step as f64 / STEPS as f64;
        let mut start = fit.logs.clone();
        at.iter().for_each(|(index, log)| start[*index] = free.logs[*index] + share * (log - free.logs[*index]));
        fit = fit.climb_from(data, &start)?;
    }
    Some(fit)
}

/// Names as in params.json, where terms of one kind stand in the order of their times or frequencies; with the number
/// of the logarithm and its unit. The shape of a filter has none.
fn numbered(fit: &Fit, display: &Unit) -> Vec<(String, usize, Unit)> {
    let form = &fit.form;
    let roles = form.roles();
    let order = |piece: usize| {
        let kind = form.pieces()[piece].kind();
        let by = if kind == Kind::Oscillation { Role::Frequency } else { Role::CorrelationTime };
        let log = roles.iter().position(|role| *role == (piece, by)).map(|i| fit.logs[i]);
        (kind, log.unwrap_or(0.0))
    };
    let mut pieces: Vec<usize> = (0..form.pieces().len()).collect();
    pieces.sort_by(|a, b| {
        let ((a, a_at), (b, b_at)) = (order(*a), order(*b));
        a.cmp(&b).then(a_at.total_cmp(&b_at))
    });
    let mut all = Vec::new();
    for (place, piece) in pieces.iter().enumerate() {
        let kind = form.pieces()[*piece].kind();
        let number = pieces[..place].iter().filter(|other| form.pieces()[**other].kind() == kind).count();
        let own = roles.iter().enumerate().filter(|(_, (of, role))| of == piece && *role != Role::Shape);
        all.extend(
            own.map(|(i, (_, role))| (parameter_name(kind, number, *role), i, super::names::unit_of(form, i, display))),
        );
    }
    all
}

/// What the log says of a held parameter where it is free.
fn said(free: &Fitted, index: usize, log: f64, hold: &Hold) -> Held {
    let known = &free.known[index];
    let shown = |log: f64| hold.unit.from_si(log.exp());
    let ends = [known.lower, known.upper];
    Held {
        parameter: hold.parameter.clone(),
        value: hold.value,
        unit: hold.unit.to_string(),
        free: shown(free.fit.logs[index]),
        interval: ends.iter().any(Option::is_some).then(|| ends.map(|end| end.map(shown))),
        inside: known.lower.is_none_or(|low| low <= log) && known.upper.is_none_or(|high| log <= high),
    }
}

impl HoldCost {
    /// In a sentence.
    pub fn sentence(&self) -> String {
        let of = |held: &Held| {
            let end = |end: Option<f64>| end.map_or("open".into(), digits);
            let interval = held.interval.map_or_else(String::new, |[lower, upper]| {
                let place = if held.inside { "inside" } else { "outside" };
                format!(", {place} 95 % {} … {}", end(lower), end(upper))
            });
            let Held { parameter, value, unit, free, .. } = held;
            format!("{parameter} at {} {unit} (the log alone: {}{interval})", digits(*value), digits(*free))
        };
        let each: Vec<String> = self.parameters.iter().map(of).collect();
        format!(
            "Held: {}; costs {} of ln L (p = {})",
            each.join(", "),
            digits((-self.log_likelihood).max(0.0)),
            digits(self.p_value)
        )
    }
}
