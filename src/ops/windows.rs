//! A log that is too long to be held, window after window: `--window` of the commands that have it.

use std::path::Path;

use anyhow::bail;

use super::amounts::with_unit;
use super::reading::note_check;
use crate::input::{Block, InputKind, LogOptions, LogReader};
use crate::signal::LogCheck;
use crate::units::{Dimension, Quantity, Unit, digits};

/// Files above this many bytes (as stored) are read in windows …
const LARGE_FILE: u64 = 4 << 30;
/// … of so many samples: 80 MB for each axis.
const SAMPLES: usize = 10_000_000;
/// Fewest samples of a window: what the fit of a model takes.
const FEWEST: f64 = 30.0;

/// An open log and how it is cut.
pub(crate) struct Windows {
    pub(crate) name: String,
    pub(crate) check: LogCheck,
    /// Of a window.
    pub(crate) samples: usize,
    /// s.
    pub(crate) dt: f64,
    kind: InputKind,
    reader: LogReader,
}

impl Windows {
    /// `None` unless `--window` or the size of the file asks for it. Prints the log check.
    pub(crate) fn open(log: &Path, window: Option<&str>, options: &LogOptions) -> anyhow::Result<Option<Windows>> {
        let seconds = match window {
            Some(text) => Some(with_unit("`window`", text, Dimension::TIME, "24h")?),
            None if file_size(log) > LARGE_FILE => None,
            None => return Ok(None),
        };
        let reader = LogReader::open(log, options)?;
        let check = reader.check().clone();
        let name = log.file_name().map_or_else(|| log.display().to_string(), |n| n.to_string_lossy().into_owned());
        note_check(&name, &check);
        let dt = 1.0 / check.sample_rate_hz;
        let samples = match seconds {
            Some(seconds) => {
                let samples = (seconds / dt).round();
                if samples.is_nan() || samples < FEWEST {
                    let text = window.unwrap_or_default();
                    bail!("`window` {text}: expected at least {FEWEST} samples: {} s", digits(FEWEST * dt));
                }
                samples as usize
            }
            None => SAMPLES,
        };
        if samples as u64 > check.samples {
            bail!("{name}: {} samples are fewer than a window of {samples}; choose a shorter `window`", check.samples);
        }
        Ok(Some(Windows { name, check, samples, dt, kind: options.kind, reader }))
    }

    pub(crate) fn quantity(&self) -> Quantity {
        self.reader.quantity()
    }

    /// Hex SHA-256 of the file.
    pub(crate) fn sha256(&self) -> &str {
        self.reader.sha256()
    }

    /// Name of every axis and the unit of its rate.
    pub(crate) fn axes(&self) -> Vec<(String, Unit)> {
        let unit = |unit: &Unit| if self.kind == InputKind::Rate { unit.clone() } else { unit.times_time(-2) };
        self.reader.axes().iter().map(|axis| (axis.name.clone(), unit(&axis.unit))).collect()
    }

    /// Hands every window of every axis to `take` as it is complete: rates, increments or (one more of them) angles.
    /// Gives the samples of each axis that are in no window: windows do not reach over gaps and unusable samples,
    /// one begins anew behind them.
    pub(crate) fn read(
        mut self,
        mut take: impl FnMut(usize, &[f64]) -> anyhow::Result<()>,
    ) -> anyhow::Result<Vec<u64>> {
        let angles = self.kind == InputKind::Angle;
        let full = self.samples + usize::from(angles);
        let mut axes = vec![(Vec::new(), 0_u64); self.reader.axes().len()];
        let mut block = Block::default();
        while self.reader.next_block(&mut block)? {
            for (axis, ((held, left_out), values)) in axes.iter_mut().zip(&block.values).enumerate() {
                for (value, missing) in values.iter().zip(&block.missing) {
                    if *missing > 0 || !value.is_finite() {
                        *left_out += held.len() as u64;
                        held.clear();
                    }
                    if !value.is_finite() {
                        *left_out += 1;
                        continue;
                    }
                    held.push(*value);
                    if held.len() == full {
                        take(axis, held)?;
                        // the last angle of a window is the first of the next
                        held.clear();
                        held.extend(angles.then_some(*value));
                    }
                }
            }
        }
        Ok(axes.into_iter().map(|(held, left_out)| left_out + held.len() as u64).collect())
    }

    /// Length of a window in s, as text.
    pub(crate) fn length(&self) -> String {
        digits(self.samples as f64 * self.dt)
    }
}

/// What of an axis was used, or that nothing was.
pub(crate) fn note(axis: &str, windows: u64, length: &str, left_out: u64, joined: &str) -> anyhow::Result<String> {
    if windows == 0 {
        bail!(
            "{axis}: no window of {length} s without gaps and unusable samples fits in the log; choose a shorter \
             `window`"
        );
    }
    let mut note = format!("read in {windows} windows of {length} s, {joined}");
    if left_out > 0 {
        note += &format!("; {left_out} samples fill no window and are left out");
    }
    Ok(note)
}

fn file_size(path: &Path) -> u64 {
    std::fs::metadata(path).map_or(0, |file| if file.is_file() { file.len() } else { 0 })
}
