//! Allan family: deviations, tau grids, exact degrees of freedom and intervals, noise identification (floor 2).

pub mod covariance;
pub mod deviation;
pub mod edf;
mod lag_sum;
mod moving;
pub mod noise_id;
mod phase;
mod pooled;
mod squares;
pub mod tau;
pub mod wavelet;

use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::noise::NoiseModel;
use crate::numerics::progress::checkpoint;
use crate::units::Unit;
pub use pooled::Pooled;

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

impl Deviation {
    /// In words, for tables and figures.
    pub fn name(self) -> &'static str {
        match self {
            Deviation::Adev => "Allan deviation",
            Deviation::Oadev => "overlapping Allan deviation",
            Deviation::Mdev => "modified Allan deviation",
            Deviation::Hdev => "Hadamard deviation",
            Deviation::Ohdev => "overlapping Hadamard deviation",
            Deviation::Totdev => "total deviation",
        }
    }
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

impl NoiseType {
    /// In words; a dash where too few averages are left to tell.
    pub fn name(self) -> &'static str {
        match self {
            NoiseType::Quantization => "quantization",
            NoiseType::White => "white",
            NoiseType::Flicker => "flicker",
            NoiseType::RandomWalk => "random walk",
            NoiseType::Ramp => "ramp",
            NoiseType::Unknown => "-",
        }
    }
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
    /// Samples used (the longest contiguous stretch), or of one of several windows.
    pub samples: usize,
    /// Windows of that many samples, of which the squares were averaged; 1 unless the log was read in windows.
    pub windows: u64,
    pub points: Vec<AllanPoint>,
}

/// The curve of one axis of a log; SI.
#[derive(Clone, Debug)]
pub struct AxisCurve {
    pub name: String,
    /// Of the rate, in the spelling of the log.
    pub unit: Unit,
    /// What of the log was used, where it was not the whole of it in one piece.
    pub note: Option<String>,
    pub curve: AllanCurve,
    /// The fitted mixture or why there is none.
    pub fit: Result<NoiseModel, String>,
}

#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum AllanError {
    #[error("{samples} samples are too few for a deviation: at least {needed} are needed")]
    TooShort { samples: usize, needed: usize },
    #[error("sample {index} is not finite: cut the log with `start`/`end`")]
    NotFinite { index: usize },
}

/// The curve of uniformly sampled rate data (SI), intervals with the degrees of freedom of the power law identified
/// at each point. [`AllanCurve::refine`] replaces them by the exact ones of a fitted mixture.
///
/// `rate` without gaps, `dt` in s. Fails on fewer samples than one difference needs and on NaN or infinite samples.
///
/// ```
/// use kfdesign::allan::{Deviation, TauGrid, curve};
///
/// // a ramp r(t) = R t has the deviation R τ/√2
/// let ramp: Vec<f64> = (0..4096).map(|k| 2e-3 * k as f64 * 0.01).collect();
/// let curve = curve(&ramp, 0.01, Deviation::Oadev, TauGrid::Octave)?;
/// for point in &curve.points {
///     assert!((point.deviation / (2e-3 * point.tau_s / 2_f64.sqrt()) - 1.0).abs() < 1e-9);
/// }
/// # Ok::<(), kfdesign::allan::AllanError>(())
/// ```
pub fn curve(rate: &[f64], dt: f64, deviation: Deviation, grid: TauGrid) -> Result<AllanCurve, AllanError> {
    check(rate, deviation, 0)?;
    curve_of(&deviation::phase(rate, dt), dt, deviation, grid)
}

/// The same from the phase itself (angle of a gyro, velocity of an accelerometer; unit·s): n + 1 points stand for n
/// rate samples.
pub fn curve_from_phase(phase: &[f64], dt: f64, deviation: Deviation, grid: TauGrid) -> Result<AllanCurve, AllanError> {
    check(phase, deviation, 1)?;
    curve_of(phase, dt, deviation, grid)
}

fn check(values: &[f64], kind: Deviation, extra: usize) -> Result<(), AllanError> {
    let needed = deviation::fewest_samples(kind, 1) as usize + extra;
    if values.len() < needed {
        return Err(AllanError::TooShort { samples: values.len(), needed });
    }
    match values.iter().position(|v| !v.is_finite()) {
        Some(index) => Err(AllanError::NotFinite { index }),
        None => Ok(()),
    }
}

fn curve_of(phase: &[f64], dt: f64, kind: Deviation, grid: TauGrid) -> Result<AllanCurve, AllanError> {
    let mut pooled = Pooled::new(kind, phase.len().saturating_sub(1), dt, grid);
    pooled.add(phase)?;
    Ok(pooled.curve())
}

impl AllanPoint {
    fn set_edf(&mut self, edf: f64) {
        self.edf = edf;
        (self.lower, self.upper) = edf::interval(self.deviation, edf);
    }
}

impl AllanCurve {
    /// Degrees of freedom and intervals for this noise mixture instead of the identified power laws: exact for ADEV,
    /// overlapping ADEV, HDEV and overlapping HDEV; for MDEV and TOTDEV those of the law that dominates at each tau.
    /// Of windows they add up, as if each had its own noise.
    /// Points for which the mixture says nothing (an empty one) are left as they are.
    pub fn refine(&mut self, model: &NoiseModel) {
        let (kind, samples, dt, windows) = (self.deviation, self.samples, self.dt, self.windows as f64);
        self.points.par_iter_mut().for_each(|point| {
            checkpoint();
            let edf = windows * edf::degrees_of_freedom(kind, samples, point.m, dt, model);
            if !edf.is_nan() {
                point.set_edf(edf);
            }
        });
    }
}
