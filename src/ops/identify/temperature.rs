//! The temperature of the logs.

use crate::identify::temperature::{Regressor, Smoothed, effect, smoothed};
use crate::identify::{Fitted, OnTemperature};
use crate::input::InputKind;
use crate::numerics::progress::note;
use crate::ops::stretch::Stretch;
use crate::params::Measured;
use crate::signal::{Gap, LogCheck, Recording};
use crate::units::Unit;

/// Beside the longest stretch of an axis in a log, and beside all its pieces.
type Cut = (Vec<f64>, Vec<Vec<f64>>);

/// The temperature of all logs.
pub(super) struct Temperature {
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

impl Temperature {
    /// `None` when not every log has one; a note where the logs differ.
    pub(super) fn new(readings: &[(Recording, LogCheck)], kind: InputKind) -> Option<Temperature> {
        let columns: Vec<_> = readings.iter().filter_map(|(log, _)| log.temperature.as_ref()).collect();
        let first = *columns.first()?;
        let unit = first.unit.times_time(0);
        if columns.len() < readings.len() || columns.iter().any(|other| other.unit.times_time(0) != unit) {
            note(&format!("  note: the logs do not all have a temperature in {unit}: there is no regression on it"));
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
        Some(Temperature { kind, column: first.name.clone(), unit, logs, reference, range, missing: missing / count })
    }

    /// Held against one axis; `parts`: its stretches, one per log, of which number `longest` chose the terms.
    pub(super) fn against(&self, fitted: &Fitted, parts: &[Stretch], longest: usize, dt: f64) -> OnTemperature {
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
        OnTemperature {
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
