//! The last step of the search: the exact likelihood of everything that was recorded, gaps and further logs included.

use nalgebra::{Cholesky, DMatrix, DVector};
use rayon::prelude::*;

use super::form::Form;
use super::ordinates::Ordinates;
use super::whittle;
use crate::filter::likelihood::{LogLikelihood, Stretch, diffuse_log_likelihoods};
use crate::model::{InitialBias, LinearModel, sensor_errors};
use crate::noise::{Kind, NoiseModel};
use crate::numerics::optimize::{hessian, shifted};
use crate::units::Quantity;

/// Numbers that a step of the search may cost: samples × (states² + 4 states) × (1 + 2 parameters), some seconds in
/// all; above, the cosine coefficients have the last word.
const MOST_WORK: f64 = 5e8;
/// Steps of the search at most, from far away most of them; it ends when another would gain less than half of this
/// in ln L: 3e-5 standard deviations from the maximum.
const STEPS: usize = 40;
const ENOUGH: f64 = 1e-9;
/// Twice the gain in ln L of a step from a place that is still far away: the curvature there is not that of the
/// maximum.
const FAR: f64 = 100.0;
/// Longest step, in logarithms.
const REACH: f64 = 1.0;
/// Step of numerical derivatives in standard deviations: small enough that third derivatives of order one leave 2e-5
/// of a standard deviation.
const STEP: f64 = 0.01;
/// Rounding of ln L, relative: a sum of many terms.
const ROUNDING: f64 = 1e-13;

/// The maximum of the exact likelihood.
#[derive(Clone, Debug)]
pub(super) struct Refined {
    pub(super) logs: Vec<f64>,
    /// Diffuse ln L of all logs, SI.
    pub(super) log_likelihood: f64,
    /// That were seen.
    pub(super) samples: usize,
    /// Of the logarithms, by second differences; only where there is more than the one stretch that the cosine
    /// coefficients saw.
    pub(super) information: Option<DMatrix<f64>>,
    /// Per log.
    pub(super) biases: Vec<LogLikelihood>,
}

/// A point of the search.
struct Place {
    at: Vec<f64>,
    value: f64,
    /// Which logarithms may move, and the slopes of ln L by them.
    free: Vec<usize>,
    gradient: DVector<f64>,
    biases: Vec<LogLikelihood>,
}

/// All that was recorded of one axis.
pub(super) struct Exact<'a> {
    data: &'a Ordinates,
    form: &'a Form,
    logs: &'a [Vec<Stretch<'a>>],
}

impl<'a> Exact<'a> {
    /// `None` where it would take too long, or there is nothing but the slope of a ramp to be found.
    pub(super) fn new(
        data: &'a Ordinates,
        form: &'a Form,
        start: &[f64],
        logs: &'a [Vec<Stretch<'a>>],
    ) -> Option<Exact<'a>> {
        let exact = Exact { data, form, logs };
        let states = exact.model(start)?.states.len() as f64;
        let points = 1.0 + 2.0 * start.len() as f64;
        // a search by many coefficients of a filter takes more steps
        let most = if form.has(Kind::BandLimit) { MOST_WORK / 5.0 } else { MOST_WORK };
        (exact.samples() as f64 * (states * states + 4.0 * states) * points < most).then_some(exact)
    }

    fn samples(&self) -> usize {
        self.logs.iter().flatten().map(|part| part.samples.len()).sum()
    }

    fn model(&self, logs: &[f64]) -> Option<LinearModel> {
        model(self.form, logs, self.data.dt, self.data.span_s())
    }

    /// Of every point, log by log; `None` where there is no such model.
    fn each(&self, points: &[Vec<f64>]) -> Option<Vec<Vec<LogLikelihood>>> {
        let models: Vec<LinearModel> = points.iter().map(|logs| self.model(logs)).collect::<Option<_>>()?;
        let slope = self.form.has(Kind::RateRamp);
        let of_log = |log: &Vec<Stretch<'_>>| diffuse_log_likelihoods(&models, log, slope);
        let by_log: Vec<Vec<LogLikelihood>> = self.logs.par_iter().map(of_log).collect();
        Some((0..points.len()).map(|i| by_log.iter().map(|of_points| of_points[i]).collect()).collect())
    }

    /// Of each log, at these logarithms.
    pub(super) fn biases(data: &Ordinates, form: &Form, at: &[f64], logs: &[Vec<Stretch<'_>>]) -> Vec<LogLikelihood> {
        Exact { data, form, logs }.each(&[at.to_vec()]).and_then(|mut each| each.pop()).unwrap_or_default()
    }

    fn values(&self, points: &[Vec<f64>]) -> Vec<f64> {
        let sum = |logs: Vec<LogLikelihood>| logs.iter().map(|log| log.value).sum();
        self.each(points).map_or(vec![f64::NAN; points.len()], |each| each.into_iter().map(sum).collect())
    }

    /// ln L, its slope by the logarithms that may move, and what each log says, in one go through the logs.
    fn look(&self, at: Vec<f64>, bounds: &[(f64, f64)], sigmas: &[f64]) -> Option<Place> {
        // what is at a bound, or of no effect, stays
        let free: Vec<usize> = (0..at.len())
            .filter(|i| {
                let margin = 1.1 * STEP * sigmas[*i];
                at[*i] > bounds[*i].0 + margin && at[*i] < bounds[*i].1 - margin
            })
            .collect();
        let steps: Vec<f64> = free.iter().map(|i| STEP * sigmas[*i]).collect();
        let sides = free.iter().zip(&steps).flat_map(|(i, step)| [*step, -step].map(|by| shifted(&at, &[(*i, by)])));
        let points: Vec<Vec<f64>> = std::iter::once(at.clone()).chain(sides).collect();
        let each = self.each(&points)?;
        let value = |logs: &Vec<LogLikelihood>| logs.iter().map(|log| log.value).sum::<f64>();
        let slope = |(pair, step): (&[Vec<LogLikelihood>], &f64)| (value(&pair[0]) - value(&pair[1])) / (2.0 * step);
        let gradient: Vec<f64> = each[1..].chunks_exact(2).zip(&steps).map(slope).collect();
        let found = value(&each[0]);
        (found.is_finite() && gradient.iter().all(|g| g.is_finite())).then(|| Place {
            value: found,
            biases: each[0].clone(),
            gradient: DVector::from_vec(gradient),
            free,
            at,
        })
    }

    /// From the maximum on the cosine coefficients, by a quasi-Newton method that begins with their information: it
    /// is nearly that of the exact likelihood, and what its slopes tell of the difference is added (BFGS: Broyden,
    /// Fletcher, Goldfarb, Shanno 1970). Far away from the maximum that information is taken anew at every place
    /// (Fisher 1925, scoring). Not `optimize::minimize`: that begins with a unit matrix, and every step it spends on
    /// learning goes through all samples.
    pub(super) fn refine(&self, start: &[f64], bounds: &[(f64, f64)]) -> Option<Refined> {
        let more = self.samples() as f64 * self.data.dt / self.data.total_s();
        let expected = |at: &[f64]| whittle::expected_information(self.data, self.form, at) * more;
        let mut curvature = expected(start);
        let mut sigmas: Vec<f64> = curvature.diagonal().iter().map(|v| 1.0 / v.sqrt()).collect();
        let mut here = self.look(start.to_vec(), bounds, &sigmas)?;
        for _ in 0..STEPS {
            let free = here.free.clone();
            let part = DMatrix::from_fn(free.len(), free.len(), |i, k| curvature[(free[i], free[k])]);
            let mut step = Cholesky::new(part)?.solve(&here.gradient);
            let gain = here.gradient.dot(&step);
            // far away the curvature says how steep it is there, not how far it is to the top
            step *= (REACH / step.amax()).min(1.0);
            if gain < ENOUGH {
                break;
            }
            let next = [1.0, 0.5, 0.25, 0.1].into_iter().find_map(|share| {
                let shifts: Vec<(usize, f64)> = free.iter().zip(step.iter()).map(|(i, s)| (*i, share * s)).collect();
                let mut next = shifted(&here.at, &shifts);
                next.iter_mut().zip(bounds).for_each(|(v, (low, high))| *v = v.clamp(*low, *high));
                let place = self.look(next, bounds, &sigmas)?;
                (place.value > here.value - ROUNDING * here.value.abs()).then_some(place)
            });
            let Some(next) = next else { break };
            if gain > FAR {
                curvature = expected(&next.at);
                sigmas = curvature.diagonal().iter().map(|v| 1.0 / v.sqrt()).collect();
            } else if next.free == free {
                learn(&mut curvature, &here, &next);
            }
            here = next;
        }
        let Place { at, value, biases, .. } = here;
        let seen = self.logs.iter().flatten().flat_map(|part| part.samples).filter(|v| v.is_finite()).count();
        let whole = matches!(self.logs, [log] if log.len() == 1) && seen == self.data.samples;
        Some(Refined {
            samples: seen,
            log_likelihood: value,
            information: (!whole).then(|| self.information(&at, value, more)),
            biases,
            logs: at,
        })
    }

    /// −∂² ln L by second differences.
    fn information(&self, at: &[f64], value: f64, more: f64) -> DMatrix<f64> {
        let expected = whittle::expected_information(self.data, self.form, at) * more;
        // half a standard deviation: the curvature that an interval sees
        let steps: Vec<f64> = expected.diagonal().iter().map(|v| 0.5 / v.sqrt().clamp(0.5, 1e9)).collect();
        -hessian(|points| self.values(points), at, value, &steps)
    }
}

/// −∂² ln L as the slopes at both ends of a step have it along that step: B ← B + y yᵀ/yᵀs − B s sᵀB/sᵀB s.
fn learn(curvature: &mut DMatrix<f64>, from: &Place, to: &Place) {
    let free = &from.free;
    let s = DVector::from_fn(free.len(), |i, _| to.at[free[i]] - from.at[free[i]]);
    let y = &from.gradient - &to.gradient;
    let part = DMatrix::from_fn(free.len(), free.len(), |i, k| curvature[(free[i], free[k])]);
    let known = &part * &s;
    let (seen, expected) = (y.dot(&s), known.dot(&s));
    // far from the maximum, or among roundings, slopes tell nothing of it
    if !(seen > 0.1 * expected && seen < 10.0 * expected) {
        return;
    }
    for (i, row) in free.iter().enumerate() {
        for (k, column) in free.iter().enumerate() {
            curvature[(*row, *column)] += y[i] * y[k] / seen - known[i] * known[k] / expected;
        }
    }
}

/// The filter model of a form at these logarithms; `span_s`: length of the log.
pub(super) fn model(form: &Form, logs: &[f64], dt: f64, span_s: f64) -> Option<LinearModel> {
    let noise = NoiseModel { terms: form.terms(logs).collect() };
    // a model needs a state: for white noise alone one that is zero
    let zero = Some(InitialBias { mean: 0.0, std_dev: 0.0 });
    // the quantity names units, no numbers
    let with = |bias| sensor_errors(Quantity::AngularRate, &noise, bias, dt, span_s);
    with(None).or_else(|_| with(zero)).ok()
}
