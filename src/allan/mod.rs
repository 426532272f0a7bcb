//! Allan family: deviations, tau grids, exact degrees of freedom and intervals, noise identification (floor 2).

pub mod deviation;
pub mod edf;
pub mod noise_id;
pub mod tau;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::noise::NoiseModel;

/// Which deviation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Deviation {
    Adev,
    Oadev,
    Mdev,
    Hdev,
    Ohdev,
    Totdev,
}

/// Tau grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TauGrid {
    Octave,
    Decade,
    /// Points per decade, log-spaced, distinct integers.
    Log(usize),
    All,
}

/// Power-law type identified at a point ("white" slope −1/2 of the rate …).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum NoiseType {
    Quantization,
    White,
    Flicker,
    RandomWalk,
    Ramp,
    Unknown,
}

/// One averaging time. Deviations are SI.
#[derive(Clone, Debug, PartialEq)]
pub struct AllanPoint {
    pub m: u64,
    pub tau_s: f64,
    pub deviation: f64,
    /// 95 % chi-square interval with `edf`.
    pub lower: f64,
    pub upper: f64,
    pub edf: f64,
    /// Number of second (third) differences that were averaged.
    pub terms: u64,
    pub noise: NoiseType,
}

#[derive(Clone, Debug)]
pub struct AllanCurve {
    pub deviation: Deviation,
    pub dt: f64,
    /// Samples used (the longest contiguous stretch).
    pub samples: usize,
    pub points: Vec<AllanPoint>,
}

#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum AllanError {
    #[error("{samples} samples are too few for a deviation: at least {needed} are needed")]
    TooShort { samples: usize, needed: usize },
    #[error("sample {index} is not finite: cut the log with --start/--end")]
    NotFinite { index: usize },
}

/// The curve of uniformly sampled rate data (SI), intervals with the degrees of freedom of the power law identified at each point.
/// [`AllanCurve::refine`] replaces them by the exact ones of a fitted mixture.
pub fn curve(rate: &[f64], dt: f64, deviation: Deviation, grid: TauGrid) -> Result<AllanCurve, AllanError> {
    let _ = (rate, dt, deviation, grid);
    todo!()
}

impl AllanCurve {
    /// Exact degrees of freedom and intervals for this noise mixture (`formulas`: M² r₀² / [M r₀² + 2 Σ (M−h) r_h²]).
    pub fn refine(&mut self, model: &NoiseModel) {
        let _ = model;
        todo!()
    }
}
