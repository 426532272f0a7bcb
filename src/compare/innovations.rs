//! What the model's own filter leaves of the log.

use schemars::JsonSchema;
use serde::Serialize;

use super::LogAxis;
use crate::consistency::{Test, TestKind};
use crate::input::Block;
use crate::numerics::reduce::mean;
use crate::params::{AxisParams, Measured, Params};
use crate::replay::{LogShape, Nis, Options, Replayer, WhitenessSummary};
use crate::tune::{TuneOptions, tune};
use crate::units::{Quantity, Unit};

/// Tests of a replay that judge the noise model: where the log starts is no matter of it, and slow drift is the
/// Allan curve's.
const JUDGED: [TestKind; 2] = [TestKind::Nis, TestKind::Whiteness];
/// Samples handed to the filter at a time.
const BLOCK: usize = 4096;

/// Of all samples of the log, by the filter that `tune` builds of the model at the log's rate; over a gap it predicts.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Innovations {
    pub nis: Option<Nis>,
    pub whiteness: Option<WhitenessSummary>,
}

/// The constant bias is no part of the comparison: the filter starts at the log's mean and is as unsure of it as ten
/// times the log's spread.
pub(super) fn innovations(
    quantity: Quantity,
    rate_hz: f64,
    axis: &AxisParams,
    log: &LogAxis,
    alpha: f64,
) -> Result<(Innovations, Vec<Test>), String> {
    let rate = &log.rate;
    let level = mean(rate);
    let spread = (rate.iter().map(|x| (x - level).powi(2)).sum::<f64>() / rate.len() as f64).sqrt();
    let unit = Unit::parse(quantity.si_unit()).map_err(|e| e.to_string())?;
    let si = |value: f64| Some(Measured::from_si(value, None, unit.clone()));
    let axis = AxisParams { bias: si(level), turn_on_bias: si(10.0 * spread), ..axis.clone() };
    let name = axis.name.clone();
    let params = Params { quantity, sample_rate_hz: rate_hz, axes: vec![axis], design: None, source: None };
    let design = tune(&params, &TuneOptions::default()).map_err(|e| e.to_string())?.design;
    let shape = LogShape { axes: vec![name], quantity, sample_rate_hz: rate_hz, aids: 0 };
    let mut replayer =
        Replayer::new(&design, &shape, Options { alpha, ..Options::default() }).map_err(|e| e.to_string())?;
    let (mut first, mut before) = (0.0, 0);
    for piece in log.pieces() {
        before += piece.missing;
        for part in piece.samples.chunks(BLOCK) {
            first += before as f64;
            let mut missing = vec![0; part.len()];
            missing[0] = std::mem::take(&mut before);
            let time_s = (0..part.len()).map(|k| (first + k as f64) / rate_hz).collect();
            replayer.push(&Block { values: vec![part.to_vec()], extra: vec![], missing, time_s }, None);
            first += part.len() as f64;
        }
    }
    let result = replayer.finish();
    let tests = result.tests.into_iter().filter(|t| JUDGED.contains(&t.kind)).collect();
    let (nis, whiteness) = result.axes.into_iter().next().map_or((None, None), |a| (a.nis, a.whiteness));
    Ok((Innovations { nis, whiteness }, tests))
}
