//! Parameters whose claimed sigma stays honest over the identified intervals, at the least price in accuracy.
//!
//! A sensor is drawn with ln θ normal, the intervals its middle 95 %; where they are those of a likelihood, with the
//! correlation that such estimates have. A filter is honest for a sensor when no steady sigma that it claims, of the
//! states of the plant and of the whole drift, is below that of its true error, by the exact covariance of the
//! mismatched filter. The parameters are those of least mean ln(true sigma) among those that are honest for 95 % of
//! the sensors and within the joint 99.7 % region of what was identified (an ellipsoid of χ²).

use nalgebra::DVector;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::Serialize;

use super::belief::Belief;
use super::settled::{Settled, Truth};
use super::{Found, ObjectiveError, Problem};
use crate::model::LinearModel;
use crate::numerics::distribution::chi_square_quantile;
use crate::numerics::optimize::{self, bisect, half_way, look, minimize};
use crate::numerics::progress::checkpoint;
use crate::tune::TuneError;
use crate::tune::parameters::Group;

/// Share of the sensors for which the claim must hold.
pub const HONEST_SHARE: f64 = 0.95;
/// Sensors on which parameters are searched, on which they are made honest, and on which they are checked: sets 0,
/// 1, 2, all different.
const SEARCHED_ON: u64 = 300;
const CHOSEN_ON: u64 = 2000;
const CHECKED_ON: u64 = 2000;
/// The criterion is missed on the checked-on by bad luck, there or in the choice, with a probability of 1 %: so many
/// standard deviations.
const LUCK: f64 = 2.326_347_874_040_841;
/// Probability of the region about the identified parameters in which they may move.
const REGION: f64 = 0.9973;
/// What a squared standard deviation of movement weighs beside ln(true sigma): it decides only where the price does
/// not.
const TIE: f64 = 1e-4;
/// Step of numerical derivatives, standard deviations: the quantile of some hundred sensors is rough.
const STEP: f64 = 0.05;
/// Half width of the window of shares whose order statistics are averaged to a quantile.
const WINDOW: f64 = 0.02;
/// Evaluations of the search at most.
const EVALUATIONS: usize = 40;
/// Where the criterion is met, as a share of the way there.
const SHARPNESS: f64 = 1.0 / 4000.0;

/// What robust parameters buy and cost on sensors that were not used to choose them.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct RobustAxis {
    pub axis: String,
    /// The least share of sensors for which every claimed sigma must hold.
    pub criterion: f64,
    /// Sensors that were drawn for the check.
    pub sensors: u64,
    /// Whether the errors of the identified parameters were drawn with their correlation.
    pub correlated: bool,
    /// Distance of the chosen parameters from the identified ones in standard deviations (Mahalanobis).
    pub distance: f64,
    /// Share of these sensors for which some claimed sigma is too small.
    pub too_small_nominal: f64,
    pub too_small: f64,
    /// Whether the robust one is at most 1 − criterion.
    pub met: bool,
    pub outputs: Vec<RobustOutput>,
}

/// One estimated quantity after a long time, SI; errors are means over the sensors of the true standard deviation.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct RobustOutput {
    pub name: String,
    pub unit: String,
    pub claimed_nominal: f64,
    pub claimed: f64,
    pub error_nominal: f64,
    pub error: f64,
    /// That of filters each of which knows its own sensor.
    pub error_known: f64,
    /// error / error_nominal − 1.
    pub price: f64,
}

/// A drawn sensor on every axis of the group.
struct Sensor {
    models: Vec<LinearModel>,
    truths: Vec<Truth>,
}

/// A candidate with what it does for every sensor.
struct Judged {
    /// True sigma by sensor, axis and output; infinite where the error grows without bound.
    errors: Vec<Vec<Vec<f64>>>,
    /// ln of the largest true over claimed sigma: by axis, sorted.
    ratios: Vec<Vec<f64>>,
}

struct Study<'a> {
    problem: &'a Problem<'a>,
    group: &'a Group,
    belief: Belief,
}

pub(super) fn choose(
    problem: &Problem<'_>,
    group: &Group,
    told: &mut Vec<RobustAxis>,
) -> Result<Found, ObjectiveError> {
    let study = Study { problem, group, belief: Belief::new(problem, group)? };
    let direction = study.search()?;
    let shifts = study.made_honest(&direction)?;
    study.check(&shifts, told)?;
    Ok(Found { std_devs: vec![None; shifts.len()], shifts: shifts.as_slice().to_vec() })
}

impl Study<'_> {
    /// Half axes of the region in standard deviations.
    fn farthest(&self) -> f64 {
        chi_square_quantile(REGION, self.group.free.len() as f64).sqrt()
    }

    /// The settled filters of the axes at these shifts.
    fn filters(&self, shifts: &DVector<f64>) -> Result<Vec<Settled>, ObjectiveError> {
        let models = self.problem.models(self.group, shifts.as_slice())?;
        let settled = |model: &LinearModel| {
            let found = Settled::new(model).map_err(self.problem.linalg(self.group))?;
            found.ok_or_else(|| self.problem.nothing_drifts(self.group))
        };
        models.iter().map(settled).collect()
    }

    fn sensors(&self, set: u32, count: u64) -> Result<Vec<Sensor>, ObjectiveError> {
        let (seed, axis) = (self.problem.request.seed, self.group.axes[0]);
        let sensor = |k: u64| -> Result<Sensor, TuneError> {
            checkpoint();
            let models = self.problem.models(self.group, &self.belief.draw(seed, axis, set, k))?;
            Ok(Sensor { truths: models.iter().map(Truth::new).collect(), models })
        };
        let drawn: Result<Vec<Sensor>, TuneError> = (0..count).into_par_iter().map(sensor).collect();
        Ok(drawn?)
    }

    fn judge(filters: &[Settled], sensors: &[Sensor]) -> Judged {
        let of = |sensor: &Sensor| -> Vec<Vec<f64>> {
            let error = |(filter, truth): (&Settled, &Truth)| {
                filter.under(truth).map_or_else(|_| vec![f64::INFINITY; filter.claimed.len()], |real| real.sigma)
            };
            filters.iter().zip(&sensor.truths).map(error).collect()
        };
        let errors: Vec<Vec<Vec<f64>>> = sensors.par_iter().map(of).collect();
        let ratios = (0..filters.len()).map(|axis| {
            let ratio = |errors: &Vec<Vec<f64>>| {
                let over = errors[axis].iter().zip(&filters[axis].claimed).map(|(real, claimed)| (real / claimed).ln());
                over.fold(f64::NEG_INFINITY, f64::max)
            };
            let mut ratios: Vec<f64> = errors.iter().map(ratio).collect();
            ratios.sort_by(f64::total_cmp);
            ratios
        });
        Judged { ratios: ratios.collect(), errors }
    }

    /// The shifts of least mean error under the criterion, on few sensors.
    fn search(&self) -> Result<DVector<f64>, ObjectiveError> {
        let n = self.group.free.len();
        let farthest = self.farthest();
        let sensors = self.sensors(0, SEARCHED_ON)?;
        let shifts_of = |x: &[f64]| DVector::from_iterator(n, x.iter().zip(&self.belief.std_devs).map(|(x, s)| x * s));
        // ln(claimed) by the logarithms says where to begin: the most likely parameters that claim enough
        let claimed = |shifts: &DVector<f64>| -> Result<f64, ObjectiveError> {
            Ok(self.filters(shifts)?.iter().flat_map(|f| &f.claimed).map(|c| c.ln()).sum())
        };
        let mut gradient = DVector::zeros(n);
        for k in 0..n {
            let mut at = DVector::zeros(n);
            at[k] = STEP * self.belief.std_devs[k];
            gradient[k] = (claimed(&at)? - claimed(&-&at)?) / (2.0 * at[k]);
        }
        let spread = self.belief.std_dev_of(&gradient);
        let start = if spread > 0.0 { self.belief.least_known(&gradient) * (1.7 / spread) } else { gradient };
        let x: Vec<f64> = start.iter().zip(&self.belief.std_devs).map(|(shift, s)| shift / s).collect();
        let values = |x: &[f64]| -> [f64; 3] {
            let shifts = shifts_of(x);
            let distance = self.belief.distance(&shifts);
            let Ok(filters) = self.filters(&shifts) else { return [f64::MAX.sqrt(); 3] };
            let judged = Study::judge(&filters, &sensors);
            let quantile = judged.ratios.iter().map(|ratios| smooth_quantile(ratios, required()));
            let logs = judged.errors.iter().flatten().flatten().map(|sigma| sigma.ln());
            let count = judged.errors.iter().flatten().map(Vec::len).sum::<usize>() as f64;
            let error = logs.sum::<f64>() / count + TIE * distance * distance;
            [error, quantile.fold(f64::NEG_INFINITY, f64::max), distance - farthest].map(|v| v.min(f64::MAX.sqrt()))
        };
        let all = |points: &[Vec<f64>]| points.iter().map(|x| values(x).to_vec()).collect();
        let problem = optimize::Problem {
            look: &|x, _, sloped| look(all, x, &vec![STEP; n], sloped),
            constraints: 2,
            f_abs: 1e-7,
            x_abs: 1e-4,
            evaluations: EVALUATIONS,
            rounds: 1,
            ..optimize::Problem::default()
        };
        let (found, from) = (minimize(&problem, &x, &vec![(-farthest, farthest); n]).x, x);
        // a search that ended outside is worth less than where it began
        let cost = |x: &[f64]| {
            let [error, short, far] = values(x);
            error + 10.0 * (short.max(0.0) + far.max(0.0))
        };
        Ok(shifts_of(if cost(&found) <= cost(&from) { &found } else { &from }))
    }

    /// The direction, as far as it must be gone for the criterion on many sensors.
    fn made_honest(&self, direction: &DVector<f64>) -> Result<DVector<f64>, ObjectiveError> {
        let sensors = self.sensors(1, CHOSEN_ON)?;
        let honest = |t: f64| -> Result<bool, ObjectiveError> {
            let judged = Study::judge(&self.filters(&(direction * t))?, &sensors);
            Ok(judged.ratios.iter().all(|ratios| share_honest(ratios) >= required()))
        };
        let farthest = self.farthest() / self.belief.distance(direction).max(f64::MIN_POSITIVE);
        if honest(0.0)? {
            return Ok(DVector::zeros(direction.len()));
        }
        let mut far = farthest.min(1.0);
        while !honest(far)? {
            if far >= farthest {
                let axis = self.problem.names(self.group);
                return Err(ObjectiveError::OutOfReach { axis, percent: 100.0 * HONEST_SHARE });
            }
            far = (1.25 * far).min(farthest);
        }
        let (_, far) = bisect(0.0, far, half_way(SHARPNESS * far), honest)?;
        Ok(direction * far)
    }

    /// Both parameter sets on sensors that neither saw.
    fn check(&self, shifts: &DVector<f64>, told: &mut Vec<RobustAxis>) -> Result<(), ObjectiveError> {
        let sensors = self.sensors(2, CHECKED_ON)?;
        let nominal = self.filters(&DVector::zeros(shifts.len()))?;
        let robust = self.filters(shifts)?;
        let (before, after) = (Study::judge(&nominal, &sensors), Study::judge(&robust, &sensors));
        for (number, &axis) in self.group.axes.iter().enumerate() {
            let known = |sensor: &Sensor| Settled::new(&sensor.models[number]).ok().flatten().map(|own| own.claimed);
            let known: Vec<Vec<f64>> = sensors.par_iter().filter_map(known).collect();
            let too_small = |judged: &Judged| 1.0 - share_honest(&judged.ratios[number]);
            let outputs = nominal[number].outputs().iter().enumerate().map(|(i, output)| {
                let mean = |values: &mut dyn Iterator<Item = f64>| {
                    let values: Vec<f64> = values.collect();
                    values.iter().sum::<f64>() / values.len() as f64
                };
                let error = |judged: &Judged| mean(&mut judged.errors.iter().map(|e| e[number][i]));
                let (error_nominal, error) = (error(&before), error(&after));
                RobustOutput {
                    name: output.name.clone(),
                    unit: output.unit.clone(),
                    claimed_nominal: nominal[number].claimed[i],
                    claimed: robust[number].claimed[i],
                    error_nominal,
                    error,
                    error_known: mean(&mut known.iter().map(|k| k[i])),
                    price: error / error_nominal - 1.0,
                }
            });
            told.push(RobustAxis {
                axis: self.problem.axis_name(axis),
                criterion: HONEST_SHARE,
                sensors: CHECKED_ON,
                correlated: self.belief.correlated,
                distance: self.belief.distance(shifts),
                too_small_nominal: too_small(&before),
                too_small: too_small(&after),
                met: share_honest(&after.ratios[number]) >= HONEST_SHARE,
                outputs: outputs.collect(),
            });
        }
        Ok(())
    }
}

/// Share of the chosen-on sensors that must be honest so that others are for the criterion too, but for bad luck.
fn required() -> f64 {
    let spread = 1.0 / CHOSEN_ON as f64 + 1.0 / CHECKED_ON as f64;
    HONEST_SHARE + LUCK * (HONEST_SHARE * (1.0 - HONEST_SHARE) * spread).sqrt()
}

/// Share of sorted ln(true/claimed) that are not above zero, but for rounding.
fn share_honest(ratios: &[f64]) -> f64 {
    ratios.partition_point(|ratio| *ratio <= 1e-9) as f64 / ratios.len() as f64
}

/// Mean of the order statistics about this share.
fn smooth_quantile(sorted: &[f64], share: f64) -> f64 {
    let at = |share: f64| (share.clamp(0.0, 1.0) * sorted.len() as f64) as usize;
    let last = sorted.len().saturating_sub(1);
    let half = WINDOW.min(1.0 - share);
    let (from, to) = (at(share - half).min(last), at(share + half).min(last));
    sorted[from..=to].iter().sum::<f64>() / (to - from + 1) as f64
}
