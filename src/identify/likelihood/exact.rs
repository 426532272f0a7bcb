//! The last step of the search: the exact likelihood of everything that was recorded, gaps and further logs included.

use nalgebra::{Cholesky, DMatrix, DVector};
use rayon::prelude::*;

use super::form::Form;
use super::ordinates::Ordinates;
use super::whittle::{self, Fit};
use crate::filter::likelihood::{LogLikelihood, Stretch, diffuse_log_likelihood};
use crate::model::{InitialBias, LinearModel, sensor_errors};
use crate::noise::{Kind, NoiseModel};
use crate::units::Quantity;

/// Numbers that one likelihood may cost: samples × (states² + 4 states); above, the cosine coefficients have the last word.
const MOST_WORK: f64 = 1e8;
/// Steps of the search at most; it ends when another would gain less than half of this in ln L.
const STEPS: usize = 8;
const ENOUGH: f64 = 1e-4;
/// Step of numerical derivatives in standard deviations: the third derivative is then a thousandth of the second.
const STEP: f64 = 0.05;

/// The maximum of the exact likelihood.
#[derive(Clone, Debug)]
pub(super) struct Refined {
    pub(super) logs: Vec<f64>,
    /// Diffuse ln L of all logs, SI.
    pub(super) log_likelihood: f64,
    /// Of the logarithms, by second differences; only where there is more than the one stretch that the cosine coefficients saw.
    pub(super) information: Option<DMatrix<f64>>,
    /// Per log.
    pub(super) biases: Vec<LogLikelihood>,
}

/// All that was recorded of one axis.
pub(super) struct Exact<'a> {
    data: &'a Ordinates,
    form: &'a Form,
    logs: &'a [Vec<Stretch<'a>>],
}

impl<'a> Exact<'a> {
    /// `None` where it would take too long, or there is nothing but the slope of a ramp to be found.
    pub(super) fn new(data: &'a Ordinates, fit: &'a Fit, logs: &'a [Vec<Stretch<'a>>]) -> Option<Exact<'a>> {
        let exact = Exact { data, form: &fit.form, logs };
        let states = exact.model(&fit.logs)?.states.len() as f64;
        (exact.samples() as f64 * (states * states + 4.0 * states) < MOST_WORK).then_some(exact)
    }

    fn samples(&self) -> usize {
        self.logs.iter().flatten().map(|part| part.samples.len()).sum()
    }

    fn model(&self, logs: &[f64]) -> Option<LinearModel> {
        model(self.form, logs, self.data.dt, self.data.span_s())
    }

    fn each(&self, logs: &[f64]) -> Option<Vec<LogLikelihood>> {
        let model = self.model(logs)?;
        let slope = self.form.has(Kind::RateRamp);
        Some(self.logs.par_iter().map(|log| diffuse_log_likelihood(&model, log, slope)).collect())
    }

    fn value(&self, logs: &[f64]) -> f64 {
        self.each(logs).map_or(f64::NAN, |each| each.iter().map(|log| log.value).sum())
    }

    /// From the maximum on the cosine coefficients, by Newton's method with their information: it is nearly that of the exact likelihood.
    pub(super) fn refine(&self, fit: &Fit) -> Option<Refined> {
        let bounds = whittle::bounds(self.data, self.form, &fit.logs);
        let more = self.samples() as f64 / self.data.samples as f64;
        let mut at = fit.logs.clone();
        let mut value = self.value(&at);
        for _ in 0..STEPS {
            let information = whittle::expected_information(self.data, self.form, &at) * more;
            // what is at a bound, or of no effect, stays
            let free: Vec<usize> = (0..at.len())
                .filter(|i| {
                    let margin = STEP * 1.1 / information[(*i, *i)].sqrt();
                    at[*i] > bounds[*i].0 + margin && at[*i] < bounds[*i].1 - margin
                })
                .collect();
            let steps: Vec<f64> = free.iter().map(|i| STEP / information[(*i, *i)].sqrt()).collect();
            let slope = |(i, step): (&usize, &f64)| {
                let shifted = |by: f64| self.value(&moved(&at, &[(*i, by)]));
                (shifted(*step) - shifted(-step)) / (2.0 * step)
            };
            let gradient: Vec<f64> = free.par_iter().zip(&steps).map(slope).collect();
            let gradient = DVector::from_vec(gradient);
            let part = DMatrix::from_fn(free.len(), free.len(), |i, k| information[(free[i], free[k])]);
            let step = Cholesky::new(part)?.solve(&gradient);
            if gradient.iter().any(|g| !g.is_finite()) {
                return None;
            }
            let promised = gradient.dot(&step);
            let tried = [1.0, 0.5, 0.25, 0.1].into_iter().find_map(|share| {
                let shifts: Vec<(usize, f64)> = free.iter().zip(step.iter()).map(|(i, s)| (*i, share * s)).collect();
                let mut next = moved(&at, &shifts);
                next.iter_mut().zip(&bounds).for_each(|(v, (low, high))| *v = v.clamp(*low, *high));
                let reached = self.value(&next);
                (reached > value).then_some((next, reached))
            });
            let Some((next, reached)) = tried else { break };
            (at, value) = (next, reached);
            if promised < ENOUGH {
                break;
            }
        }
        let whole = matches!(self.logs, [log] if matches!(log[..], [Stretch { samples, .. }] if samples.len() == self.data.samples));
        Some(Refined {
            log_likelihood: value,
            information: (!whole).then(|| self.information(&at, value, more)),
            biases: self.each(&at)?,
            logs: at,
        })
    }

    /// −∂² ln L by second differences.
    fn information(&self, at: &[f64], value: f64, more: f64) -> DMatrix<f64> {
        let expected = whittle::expected_information(self.data, self.form, at) * more;
        // half a standard deviation: the curvature that an interval sees
        let step = |i: usize| 0.5 / expected[(i, i)].sqrt().clamp(0.5, 1e9);
        let pairs: Vec<(usize, usize)> = (0..at.len()).flat_map(|i| (0..=i).map(move |k| (i, k))).collect();
        let second = |&(i, k): &(usize, usize)| {
            let (a, b) = (step(i), step(k));
            if i == k {
                let side = |by: f64| self.value(&moved(at, &[(i, by)]));
                return (2.0 * value - side(a) - side(-a)) / (a * a);
            }
            let corner = |x: f64, y: f64| self.value(&moved(at, &[(i, x), (k, y)]));
            -(corner(a, b) - corner(a, -b) - corner(-a, b) + corner(-a, -b)) / (4.0 * a * b)
        };
        let found: Vec<f64> = pairs.par_iter().map(second).collect();
        let mut information = DMatrix::zeros(at.len(), at.len());
        for ((i, k), v) in pairs.into_iter().zip(found) {
            information[(i, k)] = v;
            information[(k, i)] = v;
        }
        information
    }
}

/// The filter model of a form at these logarithms; `span_s`: length of the log.
pub(super) fn model(form: &Form, logs: &[f64], dt: f64, span_s: f64) -> Option<LinearModel> {
    let terms = form.split(logs).filter_map(|(piece, own)| {
        let values: Vec<f64> = own.iter().map(|v| v.exp()).collect();
        piece.term(&values)
    });
    let noise = NoiseModel { terms: terms.collect() };
    // a model needs a state: for white noise alone one that is zero
    let zero = Some(InitialBias { mean: 0.0, std_dev: 0.0 });
    // the quantity names units, no numbers
    let with = |bias| sensor_errors(Quantity::AngularRate, &noise, bias, dt, span_s);
    with(None).or_else(|_| with(zero)).ok()
}

fn moved(at: &[f64], shifts: &[(usize, f64)]) -> Vec<f64> {
    let mut next = at.to_vec();
    shifts.iter().for_each(|(i, by)| next[*i] += by);
    next
}
