//! Physical parameters refined on logs: the maximum of innovation likelihood times prior.

use rayon::prelude::*;
use schemars::JsonSchema;
use serde::Serialize;

use super::{Found, Log, ObjectiveError, Problem};
use crate::filter::innovations::{log_likelihood, log_likelihoods};
use crate::model::LinearModel;
use crate::numerics::optimize::{self, Optimum, covariance, hessian, look, minimize, shifted};
use crate::tune::parameters::Group;
use crate::units::digits;

/// A correlation time of which nothing else is known needs so many of its lengths.
const LENGTHS_TO_TELL: f64 = 3.0;
/// Fewest samples of a log.
const FEWEST_SAMPLES: usize = 100;
/// A parameter is searched within this of its start, as a logarithm: a factor of a thousand.
const REACH: f64 = 6.907_755_278_982_137;
/// Step of numerical derivatives in standard deviations of what the logs say.
const STEP: f64 = 0.02;
/// The search ends when a restart gains less in ln L.
const ENOUGH: f64 = 1e-7;
/// Bounds of the standard deviations by which logarithms are scaled.
const SCALES: (f64, f64) = (1e-6, 1.0);

/// What the logs said of the parameters of one axis.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct LikelihoodAxis {
    /// Several where they share parameters of an aid.
    pub axis: String,
    /// Whether the identified intervals counted.
    pub priors: bool,
    pub logs: Vec<LikelihoodLog>,
    /// ln L of what was fitted, as identified and at the maximum.
    pub fitted_before: f64,
    pub fitted: f64,
    /// ln of the prior, less its largest value, at the maximum.
    pub prior: f64,
    /// Gain in ln L of what was held out, over all logs; absent when nothing was.
    pub held_out_gain: Option<f64>,
    /// Parameters at an end of the search, where the logs say nothing more than a limit.
    pub at_limit: Vec<String>,
}

/// One log, SI.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct LikelihoodLog {
    pub log: String,
    /// Rows to which parameters were fitted, and rows after them that were held out.
    pub fitted_rows: usize,
    pub held_out_rows: usize,
    /// ln L of the held-out rows given those before, as identified and at the maximum.
    pub held_out_before: f64,
    pub held_out: f64,
}

/// The search of one group.
struct Search<'a> {
    problem: &'a Problem<'a>,
    group: &'a Group,
    /// √P0 of the bias is no matter of the noise here, even where it was guessed from it: variances of constants, by
    /// axis.
    constants: Vec<Vec<(usize, f64)>>,
}

pub(super) fn choose(
    problem: &Problem<'_>,
    group: &Group,
    told: &mut Vec<LikelihoodAxis>,
) -> Result<Found, ObjectiveError> {
    let request = problem.request;
    if request.logs.is_empty() {
        return Err(ObjectiveError::NoLog { objective: request.objective.name() });
    }
    if !(0.0..=0.9).contains(&request.held_out) {
        return Err(ObjectiveError::HeldOut { found: request.held_out });
    }
    refuse_short(problem, group)?;
    let nominal = problem.models(group, &vec![0.0; group.free.len()])?;
    let constant = |model: &LinearModel| -> Vec<(usize, f64)> {
        let holds = |i: &usize| model.f[(*i, *i)] == 1.0;
        (0..model.states.len()).filter(holds).map(|i| (i, model.p0[(i, i)])).collect()
    };
    let search = Search { problem, group, constants: nominal.iter().map(constant).collect() };
    let (shifts, std_devs) = search.run()?;
    let none = vec![0.0; shifts.len()];
    let logs = request.logs.iter().map(|log| search.held_out(log, &none, &shifts)).collect::<Result<Vec<_>, _>>()?;
    let names: Vec<String> = group.axes.iter().map(|&axis| problem.axis_name(axis)).collect();
    let at_limit = |k: &usize| shifts[*k].abs() >= REACH * (1.0 - 1e-6);
    told.push(LikelihoodAxis {
        axis: names.join(", "),
        priors: request.priors,
        fitted_before: search.of_logs(&none)?,
        fitted: search.of_logs(&shifts)?,
        prior: search.of_priors(&shifts),
        held_out_gain: (request.held_out > 0.0)
            .then(|| logs.iter().map(|log| log.held_out - log.held_out_before).sum()),
        at_limit: (0..shifts.len()).filter(at_limit).map(|k| problem.space.name(group.free[k])).collect(),
        logs,
    });
    Ok(Found { shifts, std_devs })
}

/// A log says little of a correlation time that it does not hold some times over, unless there is a prior.
fn refuse_short(problem: &Problem<'_>, group: &Group) -> Result<(), ObjectiveError> {
    for log in problem.request.logs {
        let wrong = |message: String| ObjectiveError::Log { log: log.name.clone(), message };
        let rows = log.axes.iter().map(|axis| axis.len()).min().unwrap_or(0);
        let fitted = fitted_rows(problem, log);
        if fitted < FEWEST_SAMPLES {
            return Err(wrong(format!(
                "{rows} samples are too few; expected at least {FEWEST_SAMPLES} that are not held out"
            )));
        }
        let span = fitted as f64 * problem.dt();
        for &i in &group.free {
            let parameter = &problem.space.parameters[i];
            let known = problem.request.priors && parameter.prior().is_some();
            let time = parameter.value.si();
            if parameter.path.ends_with("correlation_time") && !known && span < LENGTHS_TO_TELL * time {
                let name = problem.space.name(i);
                return Err(wrong(format!(
                    "{} s to be fitted to are too short for {name} of {} s, of which no interval is known; give a log \
                     that holds it {} times \
                     over, or hold it (`hold` {name})",
                    digits(span),
                    digits(time),
                    digits(LENGTHS_TO_TELL)
                )));
            }
        }
    }
    Ok(())
}

fn fitted_rows(problem: &Problem<'_>, log: &Log) -> usize {
    let rows = log.axes.first().map_or(0, |axis| axis.len());
    (rows as f64 * (1.0 - problem.request.held_out)).round() as usize
}

impl Search<'_> {
    /// The models at these shifts, with the P0 of constants that they had.
    fn models(&self, shifts: &[f64]) -> Result<Vec<LinearModel>, ObjectiveError> {
        let mut models = self.problem.models(self.group, shifts)?;
        for (model, constants) in models.iter_mut().zip(&self.constants) {
            for &(i, variance) in constants.iter().filter(|(i, _)| *i < model.states.len()) {
                model.p0[(i, i)] = variance;
            }
        }
        Ok(models)
    }

    /// ln L of the first part of every log.
    fn of_logs(&self, shifts: &[f64]) -> Result<f64, ObjectiveError> {
        let models = self.models(shifts)?;
        let of = |log: &Log| -> f64 {
            let rows = fitted_rows(self.problem, log);
            let axes = self.group.axes.iter().zip(&models);
            axes.map(|(&axis, model)| log_likelihood(model, &log.axes[axis], rows)).sum()
        };
        Ok(self.problem.request.logs.iter().map(of).sum())
    }

    fn of_priors(&self, shifts: &[f64]) -> f64 {
        let of = |(&i, shift): (&usize, &f64)| {
            let parameter = &self.problem.space.parameters[i];
            let prior = parameter.prior().filter(|_| self.problem.request.priors);
            prior.map_or(0.0, |prior| -0.5 * ((parameter.log() + shift - prior.mean) / prior.std_dev).powi(2))
        };
        self.group.free.iter().zip(shifts).map(of).sum()
    }

    /// ln(L · prior) at every point, hugely negative where there is no such model.
    fn values(&self, points: &[Vec<f64>]) -> Vec<f64> {
        let models: Vec<Option<Vec<LinearModel>>> = points.par_iter().map(|at| self.models(at).ok()).collect();
        let mut sums: Vec<f64> = models.iter().map(|models| if models.is_some() { 0.0 } else { f64::NAN }).collect();
        for log in self.problem.request.logs {
            let rows = fitted_rows(self.problem, log);
            let of_axis = |(place, axis): (usize, &usize)| {
                let of_axis: Vec<LinearModel> = models.iter().flatten().map(|models| models[place].clone()).collect();
                log_likelihoods(&of_axis, &log.axes[*axis], rows)
            };
            let by_axis: Vec<Vec<f64>> = self.group.axes.par_iter().enumerate().map(of_axis).collect();
            let there = sums.iter_mut().zip(&models).filter(|(_, models)| models.is_some());
            for (k, (sum, _)) in there.enumerate() {
                *sum += by_axis.iter().map(|values| values[k]).sum::<f64>();
            }
        }
        let finite = |(sum, at): (f64, &Vec<f64>)| {
            let value = sum + self.of_priors(at);
            if value.is_finite() { value } else { -f64::MAX.sqrt() }
        };
        sums.into_iter().zip(points).map(finite).collect()
    }

    /// Shifts at the maximum, and standard deviations from the second differences there.
    fn run(&self) -> Result<(Vec<f64>, Vec<Option<f64>>), ObjectiveError> {
        let n = self.group.free.len();
        let nominal = vec![0.0; n];
        // a model that cannot be built says so
        let best = self.of_logs(&nominal)? + self.of_priors(&nominal);
        let values = |points: &[Vec<f64>]| self.values(points).into_iter().map(|value| vec![-value]).collect();
        let look = |at: &[f64], scale: &[f64], sloped: bool| {
            look(values, at, &scale.iter().map(|s| STEP * s).collect::<Vec<_>>(), sloped)
        };
        let problem = optimize::Problem {
            look: &look,
            scale: &|at, value| self.scales(at, -value),
            start: -best,
            f_abs: 0.1 * ENOUGH,
            worth: ENOUGH,
            ..optimize::Problem::default()
        };
        let Optimum { x, f, .. } = minimize(&problem, &nominal, &vec![(-REACH, REACH); n]);
        let std_devs = self.std_devs(&x, -f);
        Ok((x, std_devs))
    }

    /// Standard deviation of each logarithm alone, from the curvature.
    fn scales(&self, at: &[f64], value: f64) -> Vec<f64> {
        let mut scales = vec![1e-3; at.len()];
        let mut open: Vec<usize> = (0..at.len()).collect();
        for _ in 0..4 {
            let sides = open.iter().flat_map(|k| [1.0, -1.0].map(|sign| shifted(at, &[(*k, sign * scales[*k])])));
            let values = self.values(&sides.collect::<Vec<_>>());
            let mut rough = Vec::new();
            for (k, pair) in open.into_iter().zip(values.chunks_exact(2)) {
                let step = scales[k];
                let curvature = (2.0 * value - pair[0] - pair[1]) / (step * step);
                let next = if curvature > 0.0 { curvature.sqrt().recip().clamp(SCALES.0, SCALES.1) } else { SCALES.1 };
                scales[k] = next;
                if !(next / step > 0.2 && next / step < 5.0) {
                    rough.push(k);
                }
            }
            open = rough;
        }
        scales
    }

    /// Of the logarithms, from the inverse of the matrix of second differences; `None` where the maximum is flat.
    fn std_devs(&self, at: &[f64], value: f64) -> Vec<Option<f64>> {
        let steps: Vec<f64> = self.scales(at, value).iter().map(|s| 0.5 * s).collect();
        let known = covariance(&-hessian(|points| self.values(points), at, value, &steps));
        (0..at.len()).map(|k| known.as_ref().map(|known| known[(k, k)].sqrt())).collect()
    }

    fn held_out(&self, log: &Log, before: &[f64], after: &[f64]) -> Result<LikelihoodLog, ObjectiveError> {
        let fitted = fitted_rows(self.problem, log);
        let all = log.axes.first().map_or(0, |axis| axis.len());
        let rest = |shifts: &[f64]| -> Result<f64, ObjectiveError> {
            let of = |(&axis, model): (&usize, &LinearModel)| {
                let log = &log.axes[axis];
                log_likelihood(model, log, all) - log_likelihood(model, log, fitted)
            };
            Ok(self.group.axes.iter().zip(&self.models(shifts)?).map(of).sum())
        };
        Ok(LikelihoodLog {
            log: log.name.clone(),
            fitted_rows: fitted,
            held_out_rows: all - fitted,
            held_out_before: rest(before)?,
            held_out: rest(after)?,
        })
    }
}
