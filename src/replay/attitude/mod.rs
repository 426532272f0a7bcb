//! A log that moves through an attitude filter, beside a reference orientation where the log has one.

mod errors;

use nalgebra::{UnitQuaternion, Vector3};
use schemars::JsonSchema;
use serde::Serialize;

use crate::consistency::Verdict;
use crate::filter::attitude::{AttitudeDesign, Mekf, Row};
use crate::units::digits;

pub use errors::{AttitudeError, Errors, Reference};

/// A rest shorter than this is not shown, s.
const SHORTEST_REST: f64 = 3.0;
/// The claimed 3 sigma must hold the error of this share of samples.
const COVERED: f64 = 0.95;

/// One row: the sensors, and the reference where there is one.
#[derive(Clone, Copy, Debug)]
pub struct LogRow {
    pub time_s: f64,
    /// Rows missing right before it.
    pub missing: u64,
    pub sensors: Row,
    pub reference: Option<UnitQuaternion<f64>>,
    /// Whether the body moves, if the log says it.
    pub movement: Option<bool>,
}

/// The filter after a row; nothing before the first specific force.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AttitudeEstimate {
    pub time_s: f64,
    /// w, x, y, z; from the body to east, north, up.
    pub attitude: Option<[f64; 4]>,
    /// Of the rotation error about east, north, up, rad.
    pub sigma: [f64; 3],
    /// rad/s.
    pub drift: [f64; 3],
    pub drift_sigma: [f64; 3],
}

/// The drift at the end of a rest.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct RestPhase {
    pub start_s: f64,
    pub end_s: f64,
    /// rad/s, of x, y, z.
    pub drift: [f64; 3],
    pub sigma: [f64; 3],
    /// Mean of the measured rate in it.
    pub mean_rate: [f64; 3],
}

/// Counts of one measurement.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, JsonSchema)]
pub struct Used {
    pub samples: u64,
    /// Those of which the variance was inflated.
    pub outliers: u64,
    /// Mean of ν²/S.
    pub nis: f64,
}

/// The whole replay.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct AttitudeReplay {
    /// "kfdesign-attitude-replay/1".
    pub format: String,
    pub verdict: Verdict,
    pub meaning: String,
    pub log: Option<String>,
    pub log_sha256: Option<String>,
    /// Hz.
    pub sample_rate: f64,
    pub samples: u64,
    pub gaps: u64,
    pub missing: u64,
    /// Rows without a usable rate.
    pub unusable: u64,
    /// The horizontal parts of the specific force, two for a sample.
    pub specific_force: Used,
    pub heading: Used,
    /// Rows at which the gyro was taken as its own drift.
    pub at_rest: u64,
    pub rests: Vec<RestPhase>,
    /// Error states at the end: name, value, sigma and unit.
    pub final_state: Vec<super::FinalState>,
    /// Against the reference, where there is one.
    pub errors: Option<Errors>,
}

/// An attitude filter over a log, row by row.
#[derive(Clone, Debug)]
pub struct AttitudeReplayer {
    design: AttitudeDesign,
    mekf: Mekf,
    errors: errors::Collected,
    samples: u64,
    gaps: u64,
    missing: u64,
    unusable: u64,
    at_rest: u64,
    force: Used,
    heading: Used,
    rest: Option<Running>,
    rests: Vec<RestPhase>,
}

/// A rest in progress.
#[derive(Clone, Debug)]
struct Running {
    start_s: f64,
    end_s: f64,
    sum: Vector3<f64>,
    rows: f64,
    drift: [(f64, f64); 3],
}

impl AttitudeReplayer {
    pub fn new(design: &AttitudeDesign, reference: Reference) -> AttitudeReplayer {
        AttitudeReplayer {
            mekf: Mekf::new(&design.model),
            errors: errors::Collected::new(reference, design.model.heading.is_some()),
            design: design.clone(),
            samples: 0,
            gaps: 0,
            missing: 0,
            unusable: 0,
            at_rest: 0,
            force: Used::default(),
            heading: Used::default(),
            rest: None,
            rests: Vec::new(),
        }
    }

    pub fn push(&mut self, row: &LogRow) -> AttitudeEstimate {
        self.samples += 1;
        self.gaps += u64::from(row.missing > 0);
        self.missing += row.missing;
        let usable = row.sensors.rate.iter().all(|v| v.is_finite());
        self.unusable += u64::from(!usable);
        let taken = self.mekf.step(&row.sensors, row.missing);
        for normalised in taken.normalised[..2].iter().flatten() {
            self.force.add(*normalised, self.design.model.outlier);
        }
        if let Some(normalised) = taken.normalised[2] {
            self.heading.add(normalised, self.design.model.outlier);
        }
        self.at_rest += u64::from(taken.rest);
        let drift = self.mekf.drift();
        let rests = row.movement.map_or(taken.rest, |moves| !moves) && self.mekf.attitude().is_some();
        self.rests(rests, row, drift);
        if let (Some(attitude), Some(reference)) = (self.mekf.attitude(), row.reference) {
            let rate = if usable { row.sensors.rate.norm() } else { 0.0 };
            let moves = row.movement.unwrap_or(true);
            self.errors.push(&attitude, &self.mekf.attitude_covariance(), &reference, rate, moves);
        }
        let p = self.mekf.attitude_covariance();
        AttitudeEstimate {
            time_s: row.time_s,
            attitude: self.mekf.attitude().map(|q| [q.w, q.i, q.j, q.k]),
            sigma: [0, 1, 2].map(|i| p[(i, i)].max(0.0).sqrt()),
            drift: drift.map(|d| d.0),
            drift_sigma: drift.map(|d| d.1),
        }
    }

    fn rests(&mut self, rests: bool, row: &LogRow, drift: [(f64, f64); 3]) {
        if !rests {
            self.close();
            return;
        }
        let start_s = row.time_s;
        let running = self.rest.get_or_insert_with(|| Running {
            start_s,
            end_s: start_s,
            sum: Vector3::zeros(),
            rows: 0.0,
            drift,
        });
        running.end_s = row.time_s;
        running.drift = drift;
        if row.sensors.rate.iter().all(|v| v.is_finite()) {
            running.sum += row.sensors.rate;
            running.rows += 1.0;
        }
    }

    fn close(&mut self) {
        let Some(running) = self.rest.take() else { return };
        if running.end_s - running.start_s < SHORTEST_REST {
            return;
        }
        let mean = running.sum / running.rows.max(1.0);
        self.rests.push(RestPhase {
            start_s: running.start_s,
            end_s: running.end_s,
            drift: running.drift.map(|d| d.0),
            sigma: running.drift.map(|d| d.1),
            mean_rate: [mean.x, mean.y, mean.z],
        });
    }

    /// Errors, rests and the verdict: consistent when the claimed 3 sigma hold the error of at least 95 % of the
    /// samples.
    pub fn finish(mut self) -> AttitudeReplay {
        self.close();
        let axes = self.design.axes.each_ref().map(String::as_str);
        let (x, p) = (self.mekf.states(), self.mekf.covariance());
        let final_state = self.design.model.states(axes).into_iter().enumerate().map(|(i, state)| super::FinalState {
            name: state.name,
            unit: state.unit,
            value: x[i],
            sigma: p[(i, i)].max(0.0).sqrt(),
        });
        let final_state = final_state.collect();
        let errors = self.errors.conclude();
        let (verdict, meaning) = match &errors {
            None if self.mekf.attitude().is_none() => {
                (Verdict::Inconclusive, "no row has a specific force, so there is no attitude".to_string())
            }
            None => (Verdict::Inconclusive, "the log has no reference to judge by".to_string()),
            Some(errors) => judged(errors),
        };
        AttitudeReplay {
            format: "kfdesign-attitude-replay/1".to_string(),
            verdict,
            meaning,
            log: None,
            log_sha256: None,
            sample_rate: self.design.sample_rate_hz,
            samples: self.samples,
            gaps: self.gaps,
            missing: self.missing,
            unusable: self.unusable,
            specific_force: self.force.mean(),
            heading: self.heading.mean(),
            at_rest: self.at_rest,
            rests: self.rests,
            final_state,
            errors,
        }
    }
}

fn judged(errors: &Errors) -> (Verdict, String) {
    let share = format!("the claimed 3 sigma hold the error of {} % of the samples", digits(100.0 * errors.covered));
    let nees = format!("mean NEES {} of {}", digits(errors.nees), errors.degrees);
    if errors.covered < COVERED {
        return (Verdict::Inconsistent, format!("{share}, fewer than {} %; {nees}", digits(100.0 * COVERED)));
    }
    let generous = if errors.nees < 0.5 * f64::from(errors.degrees) { ": the claim is generous" } else { "" };
    (Verdict::Consistent, format!("{share}; {nees}{generous}"))
}

impl Used {
    /// `nis` is the sum until [`Used::mean`].
    fn add(&mut self, normalised: f64, outlier: f64) {
        self.samples += 1;
        self.outliers += u64::from(normalised.abs() > outlier);
        self.nis += normalised * normalised;
    }

    fn mean(self) -> Used {
        Used { nis: self.nis / self.samples.max(1) as f64, ..self }
    }
}
