//! `identify` in windows.

use anyhow::bail;

use super::{Log, MethodArg, Request, holds_of};
use crate::allan::AxisCurve;
use crate::identify::windows::Windows as Likelihoods;
use crate::identify::{Hold, IdentifiedAxis, ModelChoice};
use crate::input::{LogOptions, TemperatureColumn};
use crate::ops::stretch;
use crate::ops::windows::{Windows, note};

/// The axes in windows, if `--window` or the size of the file asks for it.
pub(super) fn axes(
    request: &Request,
    choice: &ModelChoice,
    holds: &[Hold],
    options: &LogOptions,
) -> anyhow::Result<Option<(Log, Vec<IdentifiedAxis>)>> {
    let other = match () {
        () if request.method != MethodArg::Likelihood => Some("`method` likelihood"),
        () if request.logs.len() > 1 => Some("one log"),
        () if request.without_outliers => Some("a log without `without_outliers`"),
        () if request.temperature.as_deref().is_some_and(|column| column.trim() != "none") => {
            Some("a log without `temperature`")
        }
        () => None,
    };
    if let Some(other) = other {
        if let Some(window) = &request.window {
            bail!("`window` {window}: only {other} is identified in windows");
        }
        return Ok(None);
    }
    let options = &LogOptions { temperature: TemperatureColumn::Ignored, ..options.clone() };
    let Some(windows) = Windows::open(&request.logs[0], request.window.as_deref(), options)? else { return Ok(None) };
    let (samples, dt, axes, length) = (windows.samples, windows.dt, windows.axes(), windows.length());
    let log = Log {
        name: windows.name.clone(),
        quantity: windows.quantity(),
        sample_rate_hz: windows.check.sample_rate_hz,
        sha256: Some(windows.sha256().to_string()),
        checks: vec![windows.check.clone()],
    };
    let mut likelihoods: Vec<Likelihoods> =
        axes.iter().map(|(name, unit)| Likelihoods::new(name, samples, dt, unit)).collect();
    let left_out =
        windows.read(|axis, values| Ok(likelihoods[axis].add(&stretch::rate(values, options.kind, dt))?))?;
    let names: Vec<String> = axes.iter().map(|(name, _)| name.clone()).collect();
    let mut found = Vec::with_capacity(axes.len());
    for (((name, unit), likelihood), left_out) in axes.into_iter().zip(likelihoods).zip(left_out) {
        let count = likelihood.len();
        let said = note(&name, count as u64, &length, left_out, "whose likelihoods are multiplied")?;
        let mut identified = likelihood.identify(choice, &holds_of(holds, &name, &names))?;
        identified.warnings.push(format!("{said}; outliers, steps and a temperature were not looked for"));
        log.warn_of_motion(&name, &mut identified);
        let (curve, fit) = (identified.curve.clone(), Ok(identified.model.clone()));
        found.push(IdentifiedAxis {
            measured: AxisCurve { name, unit, note: None, curve, fit },
            left_out: left_out as usize,
            filled: 0,
            found: identified,
            temperature: None,
        });
    }
    Ok(Some((log, found)))
}
