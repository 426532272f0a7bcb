//! Logs for a design: opened, with the columns of its aids; read into memory, or replayed for the verdict alone.

use std::path::Path;

use anyhow::{Context, bail};

use crate::filter::{FilterDesign, SensorLog};
use crate::input::{Block, LogOptions, LogReader};
use crate::model::LinearModel;
use crate::numerics::progress::{advance, begin};
use crate::ops::aid_columns::aid_columns;
use crate::ops::reading::{Reading, note_check};
use crate::params::Reading as Known;
use crate::replay::axes::assign;
use crate::replay::{LogShape, Options, ReplayResult, Replayer};
use crate::signal::LogCheck;
use crate::tune::READING;
use crate::tune::objective::Log;

/// How logs are read, and the columns of the aids.
pub(crate) struct Logs<'a> {
    pub(crate) reading: &'a Reading,
    pub(crate) aids: &'a [String],
}

/// A log opened for a design.
pub(crate) struct Opened {
    pub(crate) name: String,
    pub(crate) reader: LogReader,
    pub(crate) shape: LogShape,
    /// What was found that a log of this plant should not have.
    pub(crate) check: LogCheck,
}

impl Logs<'_> {
    pub(crate) fn open(&self, path: &Path, design: &FilterDesign) -> anyhow::Result<Opened> {
        let name = path.display().to_string();
        let extra = aid_columns(self.aids, design)?;
        let aids = extra.len();
        self.reading.rates()?;
        let known = Known::of(&design.tuning, READING);
        let open = |options| LogReader::open(path, &LogOptions { extra: extra.clone(), ..options });
        let reader = self.reading.read(known.as_ref(), open)?;
        let mut check = reader.check().clone();
        // a plant's log is one that moves
        if design.plant != "static" {
            check.expect_motion();
        }
        note_check(&name, &check);
        Ok(Opened { shape: LogShape::of(&reader, aids), name, reader, check })
    }

    /// The whole log, its axes in the order of the design's, and its SHA-256.
    pub(crate) fn read(&self, path: &Path, design: &FilterDesign) -> anyhow::Result<(Log, String)> {
        let Opened { name, mut reader, shape, .. } = self.open(path, design)?;
        let assigned = assign(design, &shape).with_context(|| name.clone())?;
        let beside = |model: &LinearModel| model.measurements.len() - usize::from(model.inputs.is_empty());
        if design.axes.iter().map(|axis| beside(&axis.model)).sum::<usize>() != shape.aids {
            bail!(
                "{name}: the plant has an input of its own beside the sensor; parameters are chosen on logs only where \
                 the sensor is the one input"
            );
        }
        let mut axes = vec![SensorLog::default(); design.axes.len()];
        let mut block = Block::default();
        while reader.next_block(&mut block)? {
            let mut extra = block.extra.iter();
            for ((log, axis), &column) in axes.iter_mut().zip(&design.axes).zip(&assigned) {
                log.sensor.extend_from_slice(&block.values[column]);
                log.missing.extend_from_slice(&block.missing);
                log.aids.resize_with(beside(&axis.model), Vec::new);
                log.aids.iter_mut().zip(&mut extra).for_each(|(aid, values)| aid.extend_from_slice(values));
            }
        }
        let sha256 = reader.sha256().to_string();
        Ok((Log { name, axes }, sha256))
    }

    /// The log through the design; only the verdict is wanted.
    pub(crate) fn replay(&self, path: &Path, design: &FilterDesign) -> anyhow::Result<ReplayResult> {
        let Opened { name, mut reader, shape, .. } = self.open(path, design)?;
        let mut replayer = Replayer::new(design, &shape, Options::default()).with_context(|| name.clone())?;
        let mut block = Block::default();
        begin("replay", reader.check().samples);
        while reader.next_block(&mut block)? {
            replayer.push(&block, None);
            advance(block.time_s.len() as u64);
        }
        let mut result = replayer.finish();
        result.log = Some(name);
        result.log_sha256 = Some(reader.sha256().to_string());
        Ok(result)
    }
}
