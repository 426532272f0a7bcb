//! What of one axis follows the temperature of its logs.

use schemars::JsonSchema;
use serde::Serialize;

use super::temperature::{Effect, Pair, SMOOTHING_S};
use crate::params::{Measured, TemperatureEffect};
use crate::units::Unit;

/// The temperature and one axis.
#[derive(Clone, Debug)]
pub struct OnTemperature {
    pub column: String,
    pub missing: f64,
    pub reference: Measured,
    /// In the unit of the reference.
    pub range: [f64; 2],
    pub span: Measured,
    /// Unit of the coefficient.
    pub per: Unit,
    /// Or the reason why there is nothing.
    pub found: Result<Effect, String>,
}

/// What `identify --json` says of it.
#[derive(Debug, Serialize, JsonSchema)]
pub struct TemperatureDocument<'a> {
    column: &'a str,
    /// Length of the average by which the temperature is replaced, s.
    averaged_s: f64,
    /// Share of the samples without a temperature, which are filled in.
    missing: f64,
    /// Lowest and highest of the averaged temperature, in the unit of the reference.
    range: [f64; 2],
    reference: &'a Measured,
    span: &'a Measured,
    /// Change of the bias with temperature, with 95 % interval.
    coefficient: Option<Measured>,
    /// 2 Δ ln L by the coefficient.
    likelihood_ratio: Option<f64>,
    p_value: Option<f64>,
    /// The coefficient is on average this share of the true one, for noise of the temperature.
    reliability: Option<f64>,
    /// Of the same model without and with the coefficient.
    parameters: Vec<PairDocument<'a>>,
    /// Why there is no coefficient.
    #[serde(skip_serializing_if = "Option::is_none")]
    reason: Option<&'a str>,
}

#[derive(Debug, Serialize, JsonSchema)]
struct PairDocument<'a> {
    parameter: &'a str,
    without: &'a Measured,
    with: &'a Measured,
}

impl OnTemperature {
    /// Change of the bias with temperature.
    pub fn coefficient(&self, found: &Effect) -> Measured {
        Measured::from_si(found.coefficient, Some(found.interval), self.per.clone())
    }

    /// As params.json has it.
    pub fn record(&self) -> Option<TemperatureEffect> {
        self.found.as_ref().ok().map(|found| TemperatureEffect {
            coefficient: self.coefficient(found),
            reference: self.reference.clone(),
            span: self.span.clone(),
        })
    }

    pub fn document(&self) -> TemperatureDocument<'_> {
        let found = self.found.as_ref().ok();
        let pairs = found.iter().flat_map(|found| &found.parameters);
        let pairs = pairs.map(|Pair { parameter, without, with }| PairDocument { parameter, without, with });
        TemperatureDocument {
            column: &self.column,
            averaged_s: SMOOTHING_S,
            missing: self.missing,
            range: self.range,
            reference: &self.reference,
            span: &self.span,
            coefficient: found.map(|found| self.coefficient(found)),
            likelihood_ratio: found.map(|found| found.likelihood_ratio),
            p_value: found.map(|found| found.p_value),
            reliability: found.and_then(|found| found.reliability),
            parameters: pairs.collect(),
            reason: self.found.as_ref().err().map(String::as_str),
        }
    }
}
