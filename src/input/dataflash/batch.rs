//! Batches of raw samples of one sensor at its full rate (IMU batch sampling).
//!
//! Source: ArduPilot, libraries/AP_InertialSensor/BatchSampler.cpp. `ISBH` opens a batch: sensor, multiplier, number
//! of samples, time of the first one, and the sample rate that was measured. Each `ISBD` then has 32 samples as
//! 16-bit numbers, which are the SI value × multiplier, cut towards zero; its `seqno` says which 32. Sample k of a
//! batch is at `SampleUS` + k 10⁶/`smp_rate` in microseconds. One sensor is sampled after the other, so that its
//! batches have gaps between them.

use super::{Form, Number, Split};
use crate::input::names::Head;
use crate::input::number::Kind;
use crate::input::records::{head, instance};

/// Samples in an `ISBD` message.
const SAMPLES: usize = 32;

/// The part a message has in a batch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Part {
    /// `ISBH`.
    Header,
    /// `ISBD`: where its samples of x, y and z begin.
    Data([usize; 3]),
}

impl Part {
    /// Of the messages of a form, if it has what is needed; the blocks are its arrays of numbers.
    pub(super) fn of(form: &Form, blocks: &[(String, usize)]) -> Option<Part> {
        let all = |names: &[&str]| names.iter().all(|name| form.field(name).is_some());
        let block = |name: &str| blocks.iter().find(|(label, _)| label == name).map(|(_, at)| *at);
        match form.name.as_str() {
            "ISBH" if all(&["N", "type", "instance", "mul", "smp_cnt", "SampleUS", "smp_rate"]) => Some(Part::Header),
            "ISBD" if all(&["N", "seqno"]) => Some(Part::Data([block("x")?, block("y")?, block("z")?])),
            _ => None,
        }
    }
}

/// What the last header says.
#[derive(Clone, Debug)]
struct Open {
    number: f64,
    gyro: bool,
    instance: u64,
    /// SI unit of one step.
    step: f64,
    count: f64,
    first_us: i128,
    period_us: f64,
}

/// The batch that is being read.
#[derive(Clone, Debug, Default)]
pub(super) struct Batch {
    open: Option<Open>,
    /// Messages with samples that belong to no batch.
    pub(super) strays: u64,
}

impl Batch {
    pub(super) fn begin(&mut self, form: &Form, message: &[u8]) {
        let split = |name: &str| form.field(name).map_or((0, f64::NAN), |field| field.decode(message));
        let number = |name: &str| {
            let (whole, part) = split(name);
            whole as f64 + part
        };
        let (kind, multiplier, rate) = (number("type"), number("mul"), number("smp_rate"));
        let known = (kind == 0.0 || kind == 1.0) && multiplier > 0.0 && rate > 0.0 && rate.is_finite();
        self.open = known.then(|| Open {
            number: number("N"),
            gyro: kind == 1.0,
            instance: split("instance").0 as u64,
            step: 1.0 / multiplier,
            count: number("smp_cnt"),
            first_us: split("SampleUS").0,
            period_us: 1e6 / rate,
        });
    }

    /// The topic of a message with samples; its rows are appended: time, x, y, z.
    pub(super) fn samples(
        &mut self,
        form: &Form,
        at: [usize; 3],
        message: &[u8],
        rows: &mut Vec<Split>,
    ) -> Option<Topic> {
        let number = |name: &str| {
            let (whole, part) = form.field(name)?.decode(message);
            Some(whole as f64 + part)
        };
        let Some(open) = self.open.as_ref().filter(|open| number("N") == Some(open.number)) else {
            self.strays += 1;
            return None;
        };
        let first = number("seqno").unwrap_or(f64::NAN) * SAMPLES as f64;
        let sample = Number { kind: Kind::Signed(2), big_endian: false };
        for k in 0..SAMPLES {
            let index = first + k as f64;
            // not so for an interval that no version writes
            if index >= open.count {
                break;
            }
            rows.push((open.first_us, index * open.period_us));
            rows.extend(at.iter().map(|at| {
                let bytes = message.get(at + 2 * k..at + 2 * k + 2);
                (0, bytes.map_or(f64::NAN, |bytes| sample.decode(bytes).0 as f64 * open.step))
            }));
        }
        Some(Topic { gyro: open.gyro, instance: open.instance })
    }

    pub(super) fn damage(&self) -> Option<String> {
        let strays = self.strays;
        (strays > 0).then(|| format!("{strays} ISBD messages whose batch has no ISBH before them were passed over"))
    }
}

/// The sensor of a batch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Topic {
    gyro: bool,
    instance: u64,
}

impl Topic {
    pub(super) fn name(self) -> String {
        instance(if self.gyro { "ISB_gyro" } else { "ISB_accel" }, self.instance)
    }

    /// Its columns.
    pub(super) fn heads(self) -> Vec<Head> {
        let (sensor, unit) = if self.gyro { ("gyro", "rad/s") } else { ("accel", "m/s^2") };
        let axes = ["x", "y", "z"].map(|axis| head(axis, &format!("{sensor}_{axis}"), Some(unit)));
        [head("SampleUS", "time", Some("us"))].into_iter().chain(axes).collect()
    }
}
