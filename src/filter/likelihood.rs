//! Exact Gaussian likelihood of a log whose constant bias (and slope) is unknown or known to some precision, gaps
//! included.

mod bank;
mod lane;
mod settled;

use nalgebra::{Cholesky, DMatrix, DVector};
use rayon::prelude::*;

use crate::model::LinearModel;
use crate::numerics::progress::checkpoint;
use bank::{BLOCK, Bank};
use lane::LANES;
use settled::Samples;

/// Consecutive samples of a log.
#[derive(Clone, Copy, Debug)]
pub struct Stretch<'a> {
    /// Samples missing between the stretch before and this one.
    pub missing: u64,
    pub samples: &'a [f64],
}

/// What one log says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LogLikelihood {
    /// Diffuse ln L.
    pub value: f64,
    /// Generalised least-squares estimate of the bias; with a slope, of the bias in the middle of the log.
    pub bias: f64,
    /// Its variance.
    pub bias_variance: f64,
}

/// ln L of z_k = b + a (t_k − t_mid) + h x_k + v_k, b (and a, with `slope`) unknown with a flat prior, x the states
/// of `model`, which has one measurement and no state for b:
///
/// ln L = −½ [n ln 2π + Σ ln S_k + ν̃ᵀ S⁻¹ ν̃ + ln det A], A = Uᵀ S⁻¹ U, with U the innovations of the filter on the
/// regressors (1 and t_k − t_mid), ν̃ what is left of those of the log after least squares on U. This is the diffuse
/// likelihood of a filter with states for b and a.
///
/// The filter predicts over missing samples and over samples that are not finite. Units: SI. NaN when nothing can be
/// said (fewer usable samples than unknowns). Sources: Rosenberg 1973; Durbin & Koopman 2012, sections 5.6 and 7.2.
pub fn diffuse_log_likelihood(model: &LinearModel, log: &[Stretch<'_>], slope: bool) -> LogLikelihood {
    diffuse_log_likelihoods(std::slice::from_ref(model), log, slope)[0]
}

/// The same of several models: eight neighbours of equally many states go through the log together, for little more
/// than one costs.
///
/// The covariance of each is carried until it no longer moves (in all eight), then their gains are constant. Lanes
/// do not mix but for that moment, so a number depends on its companions by rounding alone.
pub fn diffuse_log_likelihoods(models: &[LinearModel], log: &[Stretch<'_>], slope: bool) -> Vec<LogLikelihood> {
    likelihoods(models, log, slope, &[])
}

/// The same with b ~ N(mean, variance), one pair per model, and no slope: A has 1/variance more and ln L has −½ ln
/// variance, the likelihood of a filter with a constant state for b. `bias` and its variance are those after the
/// log.
pub fn log_likelihoods_with_bias(
    models: &[LinearModel],
    log: &[Stretch<'_>],
    biases: &[[f64; 2]],
) -> Vec<LogLikelihood> {
    likelihoods(models, log, false, biases)
}

fn likelihoods(models: &[LinearModel], log: &[Stretch<'_>], slope: bool, priors: &[[f64; 2]]) -> Vec<LogLikelihood> {
    let level = level(log);
    let mut groups = Vec::new();
    let mut first = 0;
    for group in models.chunk_by(|a, b| a.x0.len() == b.x0.len()).flat_map(|alike| alike.chunks(LANES)) {
        groups.push((first, group));
        first += group.len();
    }
    let together = |(first, models): (usize, &[LinearModel])| {
        let bank = pass(models, log, slope, level);
        let of = |lane| conclude(&bank, lane, slope, level, priors.get(first + lane));
        (0..models.len()).map(of).collect::<Vec<_>>()
    };
    groups.into_par_iter().flat_map_iter(together).collect()
}

/// Near what the log measures: taken off so that a large constant costs no digits.
fn level(log: &[Stretch<'_>]) -> f64 {
    let first = log.iter().flat_map(|part| part.samples).copied().filter(|z| z.is_finite()).take(BLOCK);
    let (sum, count) = first.fold((0.0, 0.0), |(sum, count), z| (sum + z, count + 1.0));
    sum / f64::max(count, 1.0)
}

fn pass(models: &[LinearModel], log: &[Stretch<'_>], slope: bool, level: f64) -> Bank {
    let total: u64 = log.iter().map(|part| part.missing + part.samples.len() as u64).sum();
    let middle = 0.5 * (total as f64 - 1.0);
    let mut bank = Bank::new(models, slope);
    let (mut data, mut ramp) = ([0.0; BLOCK], [0.0; BLOCK]);
    let mut step = 0;
    for part in log {
        // x0, P0 belong to the first sample, missing or not
        bank.pause(part.missing);
        step += part.missing;
        for block in part.samples.chunks(BLOCK) {
            checkpoint();
            data.iter_mut().zip(block).for_each(|(out, z)| *out = z - level);
            if slope {
                ramp.iter_mut().zip(step..).for_each(|(t, k)| *t = (k as f64 - middle) * models[0].dt);
            }
            let used = if slope { block.len() } else { 0 };
            bank.block(Samples { log: &data[..block.len()], ramp: &ramp[..used] });
            step += block.len() as u64;
        }
    }
    bank
}

/// Of the model in one lane, from its sums.
fn conclude(bank: &Bank, lane: usize, slope: bool, level: f64, prior: Option<&[f64; 2]>) -> LogLikelihood {
    let unknowns = if slope { 2 } else { 1 };
    let nothing = LogLikelihood { value: f64::NAN, bias: f64::NAN, bias_variance: f64::NAN };
    if bank.count <= unknowns as u64 {
        return nothing;
    }
    let mut sums = DMatrix::from_fn(1 + unknowns, 1 + unknowns, |i, j| bank.sums[i.max(j)][i.min(j)].0[lane]);
    let [mean, variance] = prior.map_or([level, 1.0], |prior| *prior);
    if prior.is_some() {
        // innovations of the log less its expected bias
        let rest = mean - level;
        sums[(0, 0)] += rest * (rest * sums[(1, 1)] - 2.0 * sums[(1, 0)]);
        sums[(1, 0)] -= rest * sums[(1, 1)];
        sums[(1, 1)] += 1.0 / variance;
    }
    let information = sums.view((1, 1), (unknowns, unknowns));
    // a bias and a slope differ in unit
    let scale = information.diagonal().map(|v| 1.0 / v.sqrt());
    let scaled = DMatrix::from_fn(unknowns, unknowns, |i, j| information[(i, j)] * scale[i] * scale[j]);
    let Some(factor) = Cholesky::new(scaled) else { return nothing };
    let cross = DVector::from_fn(unknowns, |i, _| sums[(i + 1, 0)] * scale[i]);
    let solved = factor.solve(&cross);
    let rest = sums[(0, 0)] - cross.dot(&solved);
    let log_determinant = 2.0 * factor.l().diagonal().iter().zip(scale.iter()).map(|(l, s)| (l / s).ln()).sum::<f64>();
    let constant = bank.count as f64 * std::f64::consts::TAU.ln();
    LogLikelihood {
        value: -0.5 * (constant + bank.log_variance(lane) + rest + log_determinant + variance.ln()),
        bias: mean + solved[0] * scale[0],
        bias_variance: factor.inverse()[(0, 0)] * scale[0] * scale[0],
    }
}
