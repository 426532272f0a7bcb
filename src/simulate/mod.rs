//! Parameters to a sensor stream with truth (floor 3).

use crate::params::Params;

/// The true rate the sensor sees, SI.
#[derive(Clone, Debug)]
pub enum TrueRate {
    Rest,
    Constant(f64),
    Sinusoid {
        amplitude: f64,
        frequency_hz: f64,
    },
    /// Sampled at the simulation's own rate; the run ends with it.
    Samples(Vec<f64>),
}

#[derive(Clone, Debug)]
pub struct Scenario {
    pub seed: u64,
    pub run: u64,
    pub samples: u64,
    pub rate_hz: f64,
    pub true_rate: TrueRate,
    /// ± limit, SI.
    pub saturation: Option<f64>,
    /// Step, SI.
    pub quantisation: Option<f64>,
}

/// One axis' samples of a block: measured and its truth, SI.
#[derive(Clone, Debug, Default)]
pub struct AxisBlock {
    pub measured: Vec<f64>,
    pub true_rate: Vec<f64>,
    /// Bias + all drift terms (everything that is neither true rate nor white/quantisation noise).
    pub drift: Vec<f64>,
    /// Per term of the axis (order of `AxisParams::terms`), its contribution.
    pub terms: Vec<Vec<f64>>,
}

/// Streaming simulator: the same numbers for any block size.
pub struct Simulator {
    _private: (),
}

impl Simulator {
    pub fn new(params: &Params, scenario: &Scenario) -> Simulator {
        let _ = (params, scenario);
        todo!()
    }
    /// Next at most `n` samples per axis; empty at the end.
    pub fn next_block(&mut self, n: usize, axes: &mut Vec<AxisBlock>) -> usize {
        let _ = (n, axes);
        todo!()
    }
}
