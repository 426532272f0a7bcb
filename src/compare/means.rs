//! The means of a real and a simulated log, and why their agreement proves nothing.

use schemars::JsonSchema;
use serde::Serialize;

use super::{CompareError, LogAxis};
use crate::noise::{Kind, NoiseModel};
use crate::numerics::reduce::mean;
use crate::params::{AxisParams, Params};
use crate::simulate::{Scenario, Simulator, TrueRate};
use crate::units::{Quantity, digits};

/// Run number of the simulated log: no log that a person simulates is likely to have it.
const RUN: u64 = 1_000_000;
/// Samples simulated at a time.
const BLOCK: usize = 65_536;

/// SI units.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Means {
    /// Mean of the log.
    pub real: f64,
    /// Mean of a log of the same length simulated from the parameters (seed 1, run 1000000).
    pub simulated: f64,
    /// Standard deviation of the mean of a log of this length under the model.
    pub std_dev: f64,
    /// Why the two numbers prove nothing.
    pub sentence: String,
}

/// The mean of a simulated log for every axis, as long as its real one.
pub(super) fn simulated(
    params: &Params,
    rate_hz: f64,
    pairs: &[(&AxisParams, &LogAxis)],
) -> Result<Vec<f64>, CompareError> {
    let longest = pairs.iter().map(|(_, log)| log.rate.len()).max().unwrap_or(0);
    let scenario = Scenario {
        seed: 1,
        run: RUN,
        samples: longest as u64,
        rate_hz,
        true_rate: TrueRate::Rest,
        turn_on: false,
        saturation: None,
        quantisation: None,
    };
    let mut simulator = Simulator::new(params, &scenario).map_err(|e| CompareError::Axis {
        axis: params.axes.first().map(|a| a.name.clone()).unwrap_or_default(),
        message: e.to_string(),
    })?;
    let (mut sums, mut blocks) = (vec![0.0; pairs.len()], Vec::new());
    let mut done = 0;
    loop {
        let filled = simulator.next_block(BLOCK, &mut blocks);
        if filled == 0 {
            break;
        }
        for ((sum, block), (_, log)) in sums.iter_mut().zip(&blocks).zip(pairs) {
            *sum += block.measured.iter().take(log.rate.len().saturating_sub(done)).sum::<f64>();
        }
        done += filled;
    }
    Ok(sums.iter().zip(pairs).map(|(sum, (_, log))| sum / log.rate.len() as f64).collect())
}

/// `simulated`: from [`simulated`].
pub(super) fn means(
    axis: &AxisParams,
    model: &NoiseModel,
    rate: &[f64],
    dt: f64,
    simulated: f64,
    quantity: Quantity,
) -> Means {
    let std_dev = model.mean_variance(rate.len() as u64, dt).sqrt();
    let unit = axis.display_unit(quantity);
    let shown = |value: f64| format!("{} {unit}", digits(unit.from_si(value)));
    let level =
        model.terms.iter().all(|t| !matches!(t.kind(), Kind::BiasInstability | Kind::RateRandomWalk | Kind::RateRamp));
    let spread = if level {
        format!(
            "under drift the mean of a log of {} s has standard deviation {}",
            digits(rate.len() as f64 * dt),
            shown(std_dev)
        )
    } else {
        format!(
            "drift without a level moves the mean from one log of {} s to the next by {} (standard deviation)",
            digits(rate.len() as f64 * dt),
            shown(std_dev)
        )
    };
    let real = mean(rate);
    let sentence = format!(
        "mean of the log {}, of a simulated one {}: this proves nothing, since the constant bias is set by hand and \
         {spread}; two logs of \
         the same sensor differ by that much anyway",
        shown(real),
        shown(simulated)
    );
    Means { real, simulated, std_dev, sentence }
}
