//! Allan deviations in windows.

use anyhow::Context;

use super::{Header, Request};
use crate::allan::{AxisCurve, Deviation, Pooled, TauGrid, deviation};
use crate::identify::allan_fit;
use crate::input::{InputKind, LogOptions};
use crate::ops::windows::{Windows, note};

/// The curves in windows, if `--window` or the size of the file asks for them.
pub(super) fn axes(
    request: &Request,
    grid: TauGrid,
    options: &LogOptions,
) -> anyhow::Result<Option<(Header, Vec<AxisCurve>)>> {
    let Some(windows) = Windows::open(&request.log, request.window.as_deref(), options)? else { return Ok(None) };
    let (samples, dt, axes, length) = (windows.samples, windows.dt, windows.axes(), windows.length());
    let header = Header {
        name: windows.name.clone(),
        quantity: windows.quantity(),
        sample_rate_hz: windows.check.sample_rate_hz,
        check: windows.check.clone(),
    };
    // shown, and that on which a model is fitted
    let fitted = TauGrid::Log(allan_fit::POINTS_PER_DECADE);
    let pooled = |kind, grid| Pooled::new(kind, samples, dt, grid);
    let mut curves: Vec<[Pooled; 2]> =
        axes.iter().map(|_| [pooled(request.deviation.kind(), grid), pooled(Deviation::Oadev, fitted)]).collect();
    let left_out = windows.read(|axis, values| {
        let phase = match options.kind {
            InputKind::Rate => deviation::phase(values, dt),
            // an increment is the mean rate of its sample times dt
            InputKind::Increments => deviation::phase(values, 1.0),
            InputKind::Angle => values.to_vec(),
        };
        curves[axis].iter_mut().try_for_each(|curve| curve.add(&phase)).with_context(|| axes[axis].0.clone())
    })?;
    let mut found = Vec::with_capacity(axes.len());
    for (((name, unit), [shown, fitted]), left_out) in axes.into_iter().zip(curves).zip(left_out) {
        let note = note(&name, shown.windows(), &length, left_out, "whose squares are averaged")?;
        let mut curve = shown.curve();
        let fit = allan_fit::model_of_curve(&name, &fitted.curve()).map_err(|error| error.to_string());
        if let Ok(model) = &fit {
            curve.refine(model);
        }
        found.push(AxisCurve { name, unit, note: Some(note), curve, fit });
    }
    Ok(Some((header, found)))
}
