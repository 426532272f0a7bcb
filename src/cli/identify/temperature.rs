//! The temperature of the logs beside what `identify` found, in words, as a table and as JSON.

use schemars::JsonSchema;
use serde::Serialize;

use super::tables;
use crate::cli::output::digits;
use crate::cli::output::say;
use crate::cli::stretch::Stretch;
use crate::identify::Fitted;
use crate::identify::temperature::{Effect, Pair, Regressor, SMOOTHING_S, Smoothed, effect, smoothed};
use crate::input::InputKind;
use crate::params::{Measured, TemperatureEffect};
use crate::signal::{Gap, LogCheck, Recording};
use crate::units::Unit;

/// Above this p-value the log does not show that the bias follows the temperature.
const SHOWN: f64 = 0.05;
/// Below this share of temperature in what was taken for it, its noise is told.
const RELIABLE: f64 = 0.9;

/// Beside the longest stretch of an axis in a log, and beside all its pieces.
type Cut = (Vec<f64>, Vec<Vec<f64>>);

/// The temperature of all logs.
pub(super) struct Warmth {
    kind: InputKind,
    column: String,
    unit: Unit,
    /// Of each log: averaged, above the reference.
    logs: Vec<(Smoothed, Vec<Gap>)>,
    /// Mean of all, which is the reference, lowest and highest; SI.
    reference: f64,
    range: [f64; 2],
    /// Share of the samples that have none.
    missing: f64,
}

impl Warmth {
    /// `None` when not every log has one; a note where the logs differ.
    pub(super) fn new(readings: &[(Recording, LogCheck)], kind: InputKind) -> Option<Warmth> {
        let columns: Vec<_> = readings.iter().filter_map(|(log, _)| log.temperature.as_ref()).collect();
        let first = *columns.first()?;
        let unit = first.unit.times_time(0);
        if columns.len() < readings.len() || columns.iter().any(|other| other.unit.times_time(0) != unit) {
            say(&format!("  note: the logs do not all have a temperature in {unit}: there is no regression on it"));
            return None;
        }
        let mut logs: Vec<(Smoothed, Vec<Gap>)> = readings
            .iter()
            .zip(&columns)
            .map(|((log, _), column)| (smoothed(&column.values, &log.gaps, log.dt()), log.gaps.clone()))
            .collect();
        let all = || logs.iter().flat_map(|(log, _)| &log.values).copied();
        let count = all().count() as f64;
        let reference = all().map(|t| t / count).sum();
        let range = [all().fold(f64::INFINITY, f64::min), all().fold(f64::NEG_INFINITY, f64::max)];
        logs.iter_mut().for_each(|(log, _)| log.values.iter_mut().for_each(|t| *t -= reference));
        let missing = columns.iter().flat_map(|column| &column.values).filter(|t| !t.is_finite()).count() as f64;
        Some(Warmth { kind, column: first.name.clone(), unit, logs, reference, range, missing: missing / count })
    }

    /// Held against one axis; `parts`: its stretches, one per log, of which number `longest` chose the terms.
    pub(super) fn shown(&self, fitted: &Fitted, parts: &[Stretch], longest: usize, dt: f64) -> Shown {
        let cut = |of: &dyn Fn(&Smoothed) -> Option<&Vec<f64>>| -> Option<Vec<Cut>> {
            let one =
                |(part, (log, gaps)): (&Stretch, &(Smoothed, Vec<Gap>))| Some(part.beside(of(log)?, gaps, self.kind));
            parts.iter().zip(&self.logs).map(one).collect()
        };
        let (mut rates, logs): (Vec<_>, Vec<_>) = cut(&|log| Some(&log.values)).unwrap_or_default().into_iter().unzip();
        let noise = cut(&|log| log.noise.as_ref()).map(|all| all.into_iter().map(|(_, pieces)| pieces).collect());
        let regressor = Regressor { rate: rates.swap_remove(longest), logs, noise };
        let samples: Vec<_> = parts.iter().map(Stretch::pieces).collect();
        let part = &parts[longest];
        let found = effect(fitted, &part.rate, &samples, dt, &part.unit, &regressor);
        let reading = |value: f64| Measured::from_si(value, None, self.unit.clone());
        Shown {
            column: self.column.clone(),
            missing: self.missing,
            reference: reading(self.reference),
            range: self.range.map(|t| self.unit.from_si(t)),
            span: reading(self.range[1] - self.range[0]),
            per: part.unit.times_time(0).per(&self.unit),
            found,
        }
    }
}

/// The temperature and one axis.
pub(super) struct Shown {
    column: String,
    missing: f64,
    reference: Measured,
    /// In the unit of the reference.
    range: [f64; 2],
    span: Measured,
    /// Unit of the coefficient.
    per: Unit,
    /// Or the reason why there is nothing.
    found: Result<Effect, String>,
}

/// What `identify --json` says of it.
#[derive(Debug, Serialize, JsonSchema)]
pub(super) struct Document<'a> {
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

impl Shown {
    fn coefficient(&self, found: &Effect) -> Measured {
        Measured::from_si(found.coefficient, Some(found.interval), self.per.clone())
    }

    /// As params.json has it.
    pub(super) fn record(&self) -> Option<TemperatureEffect> {
        self.found.as_ref().ok().map(|found| TemperatureEffect {
            coefficient: self.coefficient(found),
            reference: self.reference.clone(),
            span: self.span.clone(),
        })
    }

    pub(super) fn document(&self) -> Document<'_> {
        let found = self.found.as_ref().ok();
        let pairs = found.iter().flat_map(|found| &found.parameters);
        let pairs = pairs.map(|Pair { parameter, without, with }| PairDocument { parameter, without, with });
        Document {
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

    /// For a person.
    pub(super) fn sentences(&self) -> Vec<String> {
        let [low, high] = self.range.map(digits);
        let unit = &self.reference.unit;
        let filled = match self.missing {
            0.0 => String::new(),
            share => format!("; {} % of the samples have none and are filled in", digits(100.0 * share)),
        };
        let temperature = format!(
            "Temperature {}, averaged over {} s: {low} … {high} {unit}{filled}.",
            self.column,
            digits(SMOOTHING_S)
        );
        let found = match &self.found {
            Ok(found) => found,
            Err(reason) => return vec![format!("{temperature} No regression: {reason}.")],
        };
        let coefficient = self.coefficient(found);
        let [from, to] = coefficient.interval.map_or_else(Default::default, |ends| ends.map(digits));
        let verdict = if found.p_value < SHOWN {
            "the bias follows the temperature".to_string()
        } else {
            format!("a span of {} {unit} does not show that the bias follows the temperature", digits(self.span.value))
        };
        let mut sentences = vec![format!(
            "{temperature} Bias with temperature: {} {} (95 %: {from} … {to}); 2 Δ ln L {}, p = {}: {verdict}.",
            digits(coefficient.value),
            self.per,
            digits(found.likelihood_ratio),
            digits(found.p_value)
        )];
        if let Some(share) = found.reliability.filter(|share| *share < RELIABLE) {
            sentences.push(format!(
                "The temperature is noisy: this coefficient is on average {} % of the true one.",
                digits(100.0 * share)
            ));
        }
        sentences
    }

    /// The parameters without and with the regression.
    pub(super) fn table(&self) -> Option<tables::Shown> {
        let found = self.found.as_ref().ok()?;
        let cells = |measured: &Measured| {
            let Some([low, high]) = measured.interval else {
                return [digits(measured.value), "-".into(), "-".into()];
            };
            let [open_below, open_above] = [low <= 0.0, !high.is_finite()];
            let cell = |open: bool, value: f64| if open { "-".to_string() } else { digits(value) };
            [cell(open_below || open_above, measured.value), cell(open_below, low), cell(open_above, high)]
        };
        let row = |pair: &Pair| {
            let numbers = [cells(&pair.without), cells(&pair.with)].concat();
            [vec![pair.parameter.clone()], numbers, vec![pair.without.unit.to_string()]].concat()
        };
        Some(tables::Shown {
            caption: "Parameters without the regression, which are those above and those written, and with it",
            header: &["parameter", "without", "95 % from", "to", "with", "95 % from", "to", "unit"],
            rows: found.parameters.iter().map(row).collect(),
        })
    }
}
