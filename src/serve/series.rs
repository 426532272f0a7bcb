//! A log as a picture needs it: the least and the greatest value of every pixel.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::SystemTime;

use serde::{Deserialize, Serialize};

use super::{Refused, folder};
use crate::cli::output::with_flags;
use crate::input::{self, LogOptions};
use crate::ops::reading::Reading;
use crate::signal::{LogCheck, Recording};

/// Pixels of any screen.
const MOST_POINTS: usize = 10_000;

/// Which part of which axis.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Asked {
    log: String,
    /// Options of reading, as JSON.
    #[serde(default)]
    reading: Option<String>,
    #[serde(default)]
    pub(super) axis: Option<usize>,
    /// Seconds from the start of the log.
    #[serde(default)]
    from: Option<f64>,
    #[serde(default)]
    to: Option<f64>,
    #[serde(default)]
    points: Option<usize>,
}

/// What a page must know before it draws.
#[derive(Debug, Serialize)]
pub(super) struct Head<'a> {
    axes: Vec<&'a str>,
    unit: &'a str,
    /// Hz.
    rate: f64,
    samples: usize,
    /// From the first sample to the last.
    seconds: f64,
    /// Time of the first sample, s.
    start: f64,
    check: &'a LogCheck,
}

/// A log in memory, and what it was read from.
#[derive(Debug)]
pub(super) struct Held {
    key: (PathBuf, String, u64, Option<SystemTime>),
    recording: Recording,
    check: LogCheck,
}

/// The one log that is in memory.
#[derive(Debug, Default)]
pub(super) struct Series(Mutex<Option<Arc<Held>>>);

impl Series {
    /// The log, read anew where it or the options have changed.
    pub(super) fn held(&self, asked: &Asked) -> Result<Arc<Held>, Refused> {
        let path = folder::inside(&asked.log)?;
        let said = asked.reading.clone().unwrap_or_else(|| "{}".into());
        let reading: Reading = serde_json::from_str(&said).map_err(|error| {
            Refused::unprocessable(format!("reading: {}", crate::cli::named::without_place(&error)))
        })?;
        let found =
            path.metadata().map_err(|_| Refused::unprocessable(format!("{}: is no longer there", asked.log)))?;
        let key = (path, said, found.len(), found.modified().ok());
        let mut held = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(log) = held.as_ref().filter(|log| log.key == key) {
            return Ok(Arc::clone(log));
        }
        // before the next is read: there is memory for one
        *held = None;
        let options =
            reading.options().map_err(|error| Refused::unprocessable(with_flags(&error.to_string()).into()))?;
        let options = LogOptions { no_digest: true, ..options };
        let (recording, check) = input::read(&key.0, &options).map_err(|error| {
            let missing = error.missing.iter().map(|(name, _)| (*name).to_string()).collect();
            Refused { missing, ..Refused::unprocessable(with_flags(&error.to_string()).into()) }
        })?;
        let log = Arc::new(Held { key, recording, check });
        *held = Some(Arc::clone(&log));
        Ok(log)
    }
}

impl Held {
    pub(super) fn head(&self) -> Head<'_> {
        let log = &self.recording;
        Head {
            axes: log.axes.iter().map(|axis| axis.name.as_str()).collect(),
            unit: log.axes.first().map_or("", |axis| axis.unit.text()),
            rate: log.sample_rate_hz,
            samples: log.len(),
            seconds: log.span_s(),
            start: log.start_s,
            check: &self.check,
        }
    }

    /// Time from the start, least and greatest value of every pixel that has samples, in the log's unit, as
    /// little-endian doubles.
    pub(super) fn pixels(&self, asked: &Asked) -> Result<Vec<u8>, Refused> {
        let log = &self.recording;
        let number = asked.axis.unwrap_or(0);
        let axis = log.axes.get(number);
        let axis =
            axis.ok_or_else(|| Refused::unprocessable(format!("axis {number}: the log has {}", log.axes.len())))?;
        let dt = log.dt();
        let (from, to) = (asked.from.unwrap_or(0.0), asked.to.unwrap_or(f64::INFINITY));
        if from.is_nan() || to.is_nan() || from >= to {
            return Err(Refused::unprocessable("from must be before to".into()));
        }
        let points = asked.points.unwrap_or(1000).clamp(1, MOST_POINTS);
        // pieces between gaps: first sample, samples missing before it
        let mut missing = 0;
        let gaps = log.gaps.iter().map(|gap| {
            missing += gap.missing;
            (gap.index, missing)
        });
        let starts: Vec<(usize, u64)> = std::iter::once((0, 0)).chain(gaps).collect();
        let end = to.min((log.len() as u64 + missing) as f64 * dt);
        let width = ((end - from) / points as f64).max(dt);
        let mut out = Vec::with_capacity(points * 24);
        let mut pixel: Option<(u64, f64, f64)> = None;
        let mut write = |pixel: &Option<(u64, f64, f64)>| {
            if let Some((at, least, most)) = pixel {
                let time = from + (*at as f64 + 0.5) * width;
                [time, axis.unit.from_si(*least), axis.unit.from_si(*most)]
                    .iter()
                    .for_each(|value| out.extend_from_slice(&value.to_le_bytes()));
            }
        };
        for (piece, &(first, before)) in starts.iter().enumerate() {
            let last = starts.get(piece + 1).map_or(log.len(), |next| next.0);
            let index = |time: f64| (time / dt).ceil().max(0.0) as usize;
            let begin = index(from).saturating_sub(before as usize).clamp(first, last);
            let stop = index(to.min(end + dt)).saturating_sub(before as usize).clamp(begin, last);
            for (i, &value) in axis.values[begin..stop].iter().enumerate().filter(|(_, value)| !value.is_nan()) {
                let at = (((begin + i) as u64 + before) as f64 * dt - from) / width;
                let at = at.max(0.0) as u64;
                match &mut pixel {
                    Some((own, least, most)) if *own == at => (*least, *most) = (least.min(value), most.max(value)),
                    _ => {
                        write(&pixel);
                        pixel = Some((at, value, value));
                    }
                }
            }
        }
        write(&pixel);
        Ok(out)
    }
}
