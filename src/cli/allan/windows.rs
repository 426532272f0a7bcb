//! `kfdesign allan` on a log that is too long to be held: window after window.

use std::path::Path;

use anyhow::{Context, bail};

use super::{Args, AxisCurve, Header};
use crate::allan::{Deviation, Pooled, TauGrid, deviation};
use crate::cli::flags::with_unit;
use crate::cli::log_flags::print_check;
use crate::cli::output::digits;
use crate::identify::allan_fit;
use crate::input::{Block, InputKind, LogOptions, LogReader};
use crate::units::{Dimension, Unit};

/// Files above this many bytes (as stored) are read in windows …
const LARGE_FILE: u64 = 4 << 30;
/// … of so many samples: with the phase of one axis at a time 80 MB times the number of axes and one more.
const SAMPLES: usize = 10_000_000;
/// Fewest samples of a window: what the fit of a model takes.
const FEWEST: f64 = 30.0;

/// The curves in windows, if `--window` or the size of the file asks for them.
pub(super) fn axes(args: &Args, options: &LogOptions) -> anyhow::Result<Option<(Header, Vec<AxisCurve>)>> {
    let seconds = match &args.window {
        Some(text) => Some(with_unit("--window", text, Dimension::TIME, "24h")?),
        None if file_size(&args.log) > LARGE_FILE => None,
        None => return Ok(None),
    };
    let mut reader = LogReader::open(&args.log, options)?;
    let check = reader.check().clone();
    let name =
        args.log.file_name().map_or_else(|| args.log.display().to_string(), |n| n.to_string_lossy().into_owned());
    print_check(&name, &check);
    let dt = 1.0 / check.sample_rate_hz;
    let samples = match seconds {
        Some(seconds) => {
            let samples = (seconds / dt).round();
            if samples.is_nan() || samples < FEWEST {
                bail!("--window {}: expected at least {FEWEST} samples: {} s", args.window(), digits(FEWEST * dt));
            }
            samples as usize
        }
        None => SAMPLES,
    };
    if samples as u64 > check.samples {
        bail!("{name}: {} samples are fewer than a window of {samples}; choose a shorter --window", check.samples);
    }
    let mut axes: Vec<Axis> = reader
        .axes()
        .iter()
        .map(|axis| Axis::new(&axis.name, &axis.unit, options.kind, samples, dt, args.deviation.kind(), args.taus))
        .collect();
    let mut block = Block::default();
    while reader.next_block(&mut block)? {
        for (axis, values) in axes.iter_mut().zip(&block.values) {
            axis.take(values, &block.missing)?;
        }
    }
    let header = Header { name, quantity: reader.quantity(), sample_rate_hz: check.sample_rate_hz, check };
    let curves = axes.into_iter().map(Axis::curve).collect::<anyhow::Result<_>>()?;
    Ok(Some((header, curves)))
}

fn file_size(path: &Path) -> u64 {
    std::fs::metadata(path).map_or(0, |file| if file.is_file() { file.len() } else { 0 })
}

/// What is held of one axis: the samples of one window, and the sums over those before.
struct Axis {
    name: String,
    unit: Unit,
    kind: InputKind,
    samples: usize,
    dt: f64,
    /// Of the window in progress; angles are one more than a window has samples.
    held: Vec<f64>,
    /// Samples that are in no window.
    left_out: u64,
    shown: Pooled,
    /// On which a model is fitted.
    fitted: Pooled,
}

impl Axis {
    fn new(
        name: &str,
        unit: &Unit,
        kind: InputKind,
        samples: usize,
        dt: f64,
        deviation: Deviation,
        grid: TauGrid,
    ) -> Axis {
        Axis {
            name: name.into(),
            unit: if kind == InputKind::Rate { unit.clone() } else { unit.times_time(-2) },
            kind,
            samples,
            dt,
            held: Vec::new(),
            left_out: 0,
            shown: Pooled::new(deviation, samples, dt, grid),
            fitted: Pooled::new(Deviation::Oadev, samples, dt, TauGrid::Log(allan_fit::POINTS_PER_DECADE)),
        }
    }

    /// Windows do not reach over gaps and unusable samples: one begins anew behind them.
    fn take(&mut self, values: &[f64], missing: &[u64]) -> anyhow::Result<()> {
        let full = self.samples + usize::from(self.kind == InputKind::Angle);
        for (value, missing) in values.iter().zip(missing) {
            if *missing > 0 || !value.is_finite() {
                self.left_out += self.held.len() as u64;
                self.held.clear();
            }
            if !value.is_finite() {
                self.left_out += 1;
                continue;
            }
            self.held.push(*value);
            if self.held.len() == full {
                self.window()?;
            }
        }
        Ok(())
    }

    fn window(&mut self) -> anyhow::Result<()> {
        let mut phase = Vec::new();
        match self.kind {
            InputKind::Rate => phase = deviation::phase(&self.held, self.dt),
            // an increment is the mean rate of its sample times dt
            InputKind::Increments => phase = deviation::phase(&self.held, 1.0),
            InputKind::Angle => {}
        }
        let phase = if self.kind == InputKind::Angle { &self.held } else { &phase };
        self.shown.add(phase).with_context(|| self.name.clone())?;
        self.fitted.add(phase).with_context(|| self.name.clone())?;
        // the last angle of a window is the first of the next
        let kept = self.held.last().copied().filter(|_| self.kind == InputKind::Angle);
        self.held.clear();
        self.held.extend(kept);
        Ok(())
    }

    fn curve(self) -> anyhow::Result<AxisCurve> {
        let left_out = self.left_out + self.held.len() as u64;
        let length = digits(self.samples as f64 * self.dt);
        if self.shown.windows() == 0 {
            bail!(
                "{}: no window of {length} s without gaps and unusable samples fits in the log; choose a shorter --window",
                self.name
            );
        }
        let mut note = format!("read in {} windows of {length} s, whose squares are averaged", self.shown.windows());
        if left_out > 0 {
            note += &format!("; {left_out} samples fill no window and are left out");
        }
        let mut curve = self.shown.curve();
        let fit = allan_fit::model_of_curve(&self.name, &self.fitted.curve()).map_err(|error| error.to_string());
        if let Ok(model) = &fit {
            curve.refine(model);
        }
        Ok(AxisCurve { name: self.name, unit: self.unit, note: Some(note), curve, fit })
    }
}
