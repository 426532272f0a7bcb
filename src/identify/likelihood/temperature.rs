//! What of the drift follows the temperature: z = b + k (T − T_ref) + noise of the fitted model.
//!
//! k by generalised least squares under that noise, not by a straight line through the samples: with P = C⁻¹ − C⁻¹ U
//! (Uᵀ C⁻¹ U)⁻¹ Uᵀ C⁻¹, C the covariance of the noise, U a column of ones for the bias b of each log (and time,
//! where the model has a ramp),
//!
//! k = Tᵀ P z / Tᵀ P T, var k = 1/(Tᵀ P T).
//!
//! C is never formed: the diffuse ln L of a Kalman filter is a constant − ½ zᵀ P z, so that Tᵀ P T = 2 [ln L(0) − ln
//! L(T)] and Tᵀ P z = ½ [ln L(z − T) − ln L(z + T)], gaps and several logs included. k and the parameters of the
//! noise are searched in turns until k stays; a parameter of the mean and those of the covariance carry no
//! information on each other, so two or three turns do.
//!
//! The temperature itself is measured: its noise and steps would pull k to zero (errors in variables), all the more
//! as the whitening that drift asks for lifts what is fast. It is therefore averaged over [`SMOOTHING_S`]. What
//! noise is left after that is told by two averages made of alternating blocks of it: half their difference has that
//! noise and no temperature.
//!
//! Sources: Aitken 1935; Rosenberg 1973; Wilks 1938 for the likelihood ratio; Fuller 1987, section 1.1, for the
//! errors in variables.

use rayon::prelude::*;

use super::super::coefficient_unit;
use super::interval::{Precision, precisions};
use super::ordinates::Ordinates;
use super::whittle::{self, Fit};
use super::{Fitted, exact, name_of, parameter_name, refine, turn_on, unit_of};
use crate::filter::likelihood::{LogLikelihood, Stretch, diffuse_log_likelihood};
use crate::model::LinearModel;
use crate::noise::{Kind, Role};
use crate::numerics::distribution::{NORMAL_95, chi_square_sf};
use crate::numerics::reduce::mean;
use crate::params::Measured;
use crate::signal::smoothing::{moving_average, places};
use crate::signal::{Gap, lines};
use crate::units::Unit;

/// Length of the average that the temperature is replaced by, s: short beside the minutes in which a package warms
/// up, long beside the period of its samples.
pub const SMOOTHING_S: f64 = 10.0;
/// Length of the blocks by which its noise is told, s; noise that lasts longer, such as a value held for longer, is
/// taken for temperature.
const BLOCK_S: f64 = 1.0;
/// Turns of the search at most; it ends when k moves by less than this many standard deviations.
const TURNS: usize = 6;
const STILL: f64 = 0.02;
/// Places that are tried for an end of the interval, and how near one must come, in standard deviations.
const PLACES: usize = 40;
const NEAR: f64 = 0.02;
/// Share of the information on k that a ramp must leave for the two to be told apart, and the longest stretch must
/// have for its noise to be looked at.
const LEAST_LEFT: f64 = 1e-6;

/// The temperature of a log, sample by sample.
#[derive(Clone, Debug, PartialEq)]
pub struct Smoothed {
    /// Averaged over [`SMOOTHING_S`]; NaN throughout if there is none.
    pub values: Vec<f64>,
    /// The noise that is left, as large as it is there, though not the same; `None` where samples are too far apart
    /// to tell.
    pub noise: Option<Vec<f64>>,
}

/// Averages the temperature; it may be missing here and there.
pub fn smoothed(temperature: &[f64], gaps: &[Gap], dt: f64) -> Smoothed {
    let half = (0.5 * SMOOTHING_S / dt) as usize;
    let block = ((BLOCK_S / dt).round() as u64).max(1);
    let values = moving_average(temperature, gaps, half);
    let place = places(temperature.len(), gaps);
    let last = place.last().copied().unwrap_or(0);
    if 2 * half as u64 + 1 < 4 * block || last < 2 * half as u64 {
        return Smoothed { values, noise: None };
    }
    let of_blocks = |which: u64| {
        let own = |(v, k): (&f64, &u64)| if (k / block) % 2 == which { *v } else { f64::NAN };
        moving_average(&temperature.iter().zip(&place).map(own).collect::<Vec<f64>>(), gaps, half)
    };
    let (even, odd) = (of_blocks(0), of_blocks(1));
    // where the window shrinks it may hold no more than one block
    let whole = |k: &u64| *k >= half as u64 && last - k >= half as u64;
    let difference = |((a, b), k): ((&f64, &f64), &u64)| if whole(k) { 0.5 * (a - b) } else { 0.0 };
    let noise = even.iter().zip(&odd).zip(&place).map(difference).collect();
    Smoothed { values, noise: Some(noise) }
}

/// Cut and ordered as the samples of an axis are: by log, by stretch.
pub type Beside = Vec<Vec<Vec<f64>>>;

/// The temperature beside the samples of an axis; K, or any other unit, in which k is then.
#[derive(Clone, Debug)]
pub struct Regressor {
    /// Beside the longest stretch; above the reference temperature.
    pub rate: Vec<f64>,
    /// Beside all that was recorded, above the reference temperature, finite.
    pub logs: Beside,
    /// Noise that is in it.
    pub noise: Option<Beside>,
}

/// What the temperature explains; SI.
#[derive(Clone, Debug)]
pub struct Effect {
    /// k, and its standard deviation under the noise as it was found.
    pub coefficient: f64,
    pub sigma: f64,
    /// 95 %: between where 2 ln L, the noise at its best for every k, has fallen by χ²₁(0.95). Wider than 1.96
    /// sigma, for the noise is not known.
    pub interval: [f64; 2],
    /// 2 Δ ln L between the model with and without k, each at its best parameters; χ² with one degree of freedom if
    /// k is zero.
    pub likelihood_ratio: f64,
    pub p_value: f64,
    /// Share of Tᵀ P T that is not noise of the temperature: k is on average this share of the true one.
    pub reliability: Option<f64>,
    /// The parameters of the model without and with k, in the unit of the log; an end of an interval that the log
    /// leaves open is zero or infinite. A ramp has none: it shares its own with k.
    pub parameters: Vec<Pair>,
}

/// One parameter, `gauss_markov.std_dev`.
#[derive(Clone, Debug)]
pub struct Pair {
    pub parameter: String,
    pub without: Measured,
    pub with: Measured,
}

/// The effect of the temperature on an axis of which `fitted` is the model; `rate`, `logs`, `dt` and `display` as
/// for `identify`.
///
/// The error is the reason why nothing can be said: a temperature that does not change, or only as a ramp of the
/// model does.
pub fn effect(
    fitted: &Fitted,
    rate: &[f64],
    logs: &[Vec<Stretch<'_>>],
    dt: f64,
    display: &Unit,
    temperature: &Regressor,
) -> Result<Effect, String> {
    let steady = |own: &Vec<Vec<f64>>| own.iter().flatten().all(|t| Some(t) == own.iter().flatten().next());
    if temperature.logs.iter().all(steady) {
        return Err("the temperature is constant: there is no coefficient".into());
    }
    let data = Data { rate, logs, temperature, dt, slope: fitted.fit.form.has(Kind::RateRamp) };
    let failed = || "the likelihood cannot be computed".to_string();
    let alone = data.model(&fitted.fit).ok_or_else(failed)?;
    let mut line = data.line(&alone)?;
    let mut near = fitted.fit.clone();
    for _ in 0..TURNS {
        near = best_noise(&data.stretch(line.coefficient, None), &near).ok_or_else(failed)?;
        let moved = data.line(&data.model(&near).ok_or_else(failed)?)?;
        let step = (moved.coefficient - line.coefficient).abs();
        line = moved;
        if step < STILL * line.sigma {
            break;
        }
    }
    // the exact maximum is about as far from that on the coefficients as it was without k
    let before = best_noise(&data.stretch(0.0, None), &fitted.fit).ok_or_else(failed)?;
    let step = fitted.fit.logs.iter().zip(&before.logs).map(|(exact, near)| exact - near);
    let start = Fit { logs: near.logs.iter().zip(step).map(|(near, step)| near + step).collect(), ..near.clone() };
    let with = data.refined(line.coefficient, &near, &start);
    let model = data.model(&with.fit).ok_or_else(failed)?;
    let line = data.line(&model)?;
    let value = total(&data.each(&model, &temperature.logs, |z, t| z - line.coefficient * t));
    let interval = data.interval(line, [&near, &before]).ok_or_else(failed)?;
    let likelihood_ratio = (2.0 * (value - total(&data.each(&alone, &temperature.logs, |z, _| z)))).max(0.0);
    let mut parameters = pairs(fitted, &with, display);
    parameters.extend(data.turn_on([&alone, &model], line, display));
    Ok(Effect {
        coefficient: line.coefficient,
        sigma: line.sigma,
        interval,
        likelihood_ratio,
        p_value: chi_square_sf(likelihood_ratio, 1.0),
        reliability: data.reliability(&model),
        parameters,
    })
}

/// The samples of all logs, and the temperature beside them.
struct Data<'a> {
    rate: &'a [f64],
    logs: &'a [Vec<Stretch<'a>>],
    temperature: &'a Regressor,
    dt: f64,
    /// The model has a ramp.
    slope: bool,
}

/// k with its standard deviation.
#[derive(Clone, Copy, Debug)]
struct Line {
    coefficient: f64,
    sigma: f64,
}

fn total(each: &[LogLikelihood]) -> f64 {
    each.iter().map(|log| log.value).sum()
}

impl Data<'_> {
    fn model(&self, fit: &Fit) -> Option<LinearModel> {
        exact::model(&fit.form, &fit.logs, self.dt, self.rate.len() as f64 * self.dt)
    }

    /// The longest stretch without `coefficient` times the temperature.
    fn stretch(&self, coefficient: f64, lines: Option<&[lines::Line]>) -> Ordinates {
        let less = |(z, t): (&f64, &f64)| z - coefficient * t;
        let rate: Vec<f64> = self.rate.iter().zip(&self.temperature.rate).map(less).collect();
        Ordinates::new(&rate, self.dt, lines)
    }

    /// The maximum of the exact likelihood of what does not follow the temperature, from `start`; `near`: that on
    /// the cosine coefficients.
    fn refined(&self, coefficient: f64, near: &Fit, start: &Fit) -> Fitted {
        let less = |(z, t): (&f64, &f64)| z - coefficient * t;
        let of_log = |(log, beside): (&Vec<Stretch<'_>>, &Vec<Vec<f64>>)| {
            log.iter().zip(beside).map(|(part, t)| part.samples.iter().zip(t).map(less).collect()).collect()
        };
        let owned: Beside = self.logs.iter().zip(&self.temperature.logs).map(of_log).collect();
        let logs: Vec<Vec<Stretch<'_>>> = self
            .logs
            .iter()
            .zip(&owned)
            .map(|(log, own)| {
                log.iter().zip(own).map(|(part, samples)| Stretch { missing: part.missing, samples }).collect()
            })
            .collect();
        let data = self.stretch(coefficient, None);
        refine(&data, near, &precisions(&data, near), start, &logs).0
    }

    /// Diffuse ln L of every log with f(z, t) in the place of its samples z, t what is beside them; z and with it
    /// the bias counts from the mean of the log.
    fn each(&self, model: &LinearModel, beside: &Beside, f: impl Fn(f64, f64) -> f64 + Sync) -> Vec<LogLikelihood> {
        let of_log = |(log, beside): (&Vec<Stretch<'_>>, &Vec<Vec<f64>>)| {
            let level = level(log);
            let combined: Vec<Vec<f64>> = log
                .iter()
                .zip(beside)
                .map(|(part, t)| part.samples.iter().zip(t).map(|(z, t)| f(z - level, *t)).collect())
                .collect();
            let parts = log.iter().zip(&combined);
            let parts: Vec<Stretch<'_>> =
                parts.map(|(part, samples)| Stretch { missing: part.missing, samples }).collect();
            diffuse_log_likelihood(model, &parts, self.slope)
        };
        self.logs.par_iter().zip(beside).map(of_log).collect()
    }

    /// xᵀ P x of what is beside the samples.
    fn square(&self, model: &LinearModel, beside: &Beside, scale: f64) -> f64 {
        // what is not there stays not there
        let zero = |z: f64| if z.is_finite() { 0.0 } else { z };
        let none = total(&self.each(model, beside, |z, _| zero(z)));
        2.0 * (none - total(&self.each(model, beside, |z, t| zero(z) + scale * t)))
    }

    fn line(&self, model: &LinearModel) -> Result<Line, String> {
        let beside = &self.temperature.logs;
        // as large as the samples are, so that no digits are lost between the two
        let scale = self.scale();
        let information = self.square(model, beside, scale);
        if self.slope {
            let without_ramp = Data { slope: false, ..*self };
            if information <= LEAST_LEFT * without_ramp.square(model, beside, scale) {
                return Err("the temperature changes in proportion to time, as the ramp of the model does".into());
            }
        }
        let value = |sign: f64| total(&self.each(model, beside, |z, t| z + sign * scale * t));
        let cross = 0.5 * (value(-1.0) - value(1.0));
        let line = Line { coefficient: cross / information * scale, sigma: scale / information.sqrt() };
        match line.coefficient.is_finite() && line.sigma.is_finite() && information > 0.0 {
            true => Ok(line),
            false => Err("the temperature changes too little to be told from the bias".into()),
        }
    }

    /// Scatter of the samples about the mean of their log, over that of the temperature.
    fn scale(&self) -> f64 {
        let mut squares = [0.0, 0.0];
        for (log, beside) in self.logs.iter().zip(&self.temperature.logs) {
            let middles = [level(log), mean(&beside.concat())];
            for (part, t) in log.iter().zip(beside) {
                for (z, t) in part.samples.iter().zip(t).filter(|(z, _)| z.is_finite()) {
                    squares[0] += (z - middles[0]).powi(2);
                    squares[1] += (t - middles[1]).powi(2);
                }
            }
        }
        (squares[0] / squares[1]).sqrt()
    }

    /// Where, to both sides of k, 2 ln L has fallen by χ²₁(0.95) from its value there, the noise at its best for
    /// every k: searched from each of `noise`, that of the model with k and that without, for drift that k took the
    /// place of may be there all the same.
    ///
    /// On the cosine coefficients of the longest stretch, which may know less of k than all logs do: counted from
    /// its own k in its own standard deviations, as the noise of the model with k gives them, and taken from k in
    /// those of all logs.
    fn interval(&self, line: Line, noise: [&Fit; 2]) -> Option<[f64; 2]> {
        let lines = self.stretch(line.coefficient, None).lines;
        let less = |away: f64| self.stretch(line.coefficient + away, Some(&lines));
        let held = |away: f64| whittle::log_likelihood(&less(away), &noise[0].form, &noise[0].logs);
        // a parabola of k: its second difference, and how far away its top is
        let [below, here, above] = [-1.0, 0.0, 1.0].map(|side| held(side * line.sigma));
        let fall = 2.0 * here - below - above;
        if fall.is_nan() || fall <= LEAST_LEFT {
            return Some([-1.0, 1.0].map(|side| line.coefficient + side * NORMAL_95 * line.sigma));
        }
        let (own, top) = (line.sigma / fall.sqrt(), 0.5 * (above - below) / fall * line.sigma);
        let value = |z: f64| {
            let data = less(top + z * own);
            let found = noise.par_iter().filter_map(|from| best_noise(&data, from));
            found.map(|fit| fit.log_likelihood).max_by(f64::total_cmp)
        };
        let best = value(0.0)?;
        let limit = |side: f64| {
            // with the roots of the fall there, which are nearly straight in k
            let (mut at, mut near, mut far) = (2.0, (0.0, 0.0), None);
            for place in 0..PLACES {
                let root = (2.0 * (best - value(side * at)?)).max(0.0).sqrt();
                if (root - NORMAL_95).abs() < NEAR || far.is_some_and(|(far, _)| far - near.0 < NEAR) {
                    return Some(line.coefficient + side * at * line.sigma);
                }
                if root < NORMAL_95 {
                    near = (at, root);
                } else {
                    far = Some((at, root));
                }
                at = match far {
                    None => at * (NORMAL_95 / root.max(0.3)).max(1.2),
                    Some((far, _)) if place % 2 == 1 => 0.5 * (near.0 + far),
                    Some((far, above)) => near.0 + (far - near.0) * (NORMAL_95 - near.1) / (above - near.1),
                };
            }
            None
        };
        let (low, high) = rayon::join(|| limit(-1.0), || limit(1.0));
        Some([low?, high?])
    }

    fn reliability(&self, model: &LinearModel) -> Option<f64> {
        let noise = self.temperature.noise.as_ref()?;
        let scale = self.scale();
        let share = self.square(model, noise, scale) / self.square(model, &self.temperature.logs, scale);
        share.is_finite().then(|| (1.0 - share).clamp(0.0, 1.0))
    }

    /// The spread of the biases from start to start, at their own temperatures and at that of reference.
    fn turn_on(&self, [without, with]: [&LinearModel; 2], line: Line, display: &Unit) -> Option<Pair> {
        let spread = |model, coefficient: f64| {
            let mut biases = self.each(model, &self.temperature.logs, |z, t| z - coefficient * t);
            biases.iter_mut().zip(self.logs).for_each(|(found, log)| found.bias += level(log));
            turn_on::spread(&biases)?.measured(display).1
        };
        Some(Pair {
            parameter: "turn_on_bias.std_dev".into(),
            without: spread(without, 0.0)?,
            with: spread(with, line.coefficient)?,
        })
    }
}

/// The maximum on the cosine coefficients, from another; and from the same with a tenth of the drift, which may be
/// all gone.
fn best_noise(data: &Ordinates, from: &Fit) -> Option<Fit> {
    let lower = from.form.roles().into_iter().zip(&from.logs).map(|((piece, role), log)| {
        let drift = role == Role::Coefficient && from.form.pieces()[piece].kind().is_drift();
        if drift { log - std::f64::consts::LN_10 } else { *log }
    });
    let starts = [from.logs.clone(), lower.collect()];
    let fits = starts.par_iter().filter_map(|start| from.climb_from(data, start));
    fits.max_by(|a, b| a.log_likelihood.total_cmp(&b.log_likelihood))
}

/// Mean of the samples that can be used.
fn level(log: &[Stretch<'_>]) -> f64 {
    mean(&log.iter().flat_map(|part| part.samples).copied().filter(|z| z.is_finite()).collect::<Vec<f64>>())
}

/// The parameters of two fits of one form, side by side.
fn pairs(without: &Fitted, with: &Fitted, display: &Unit) -> Vec<Pair> {
    let form = &without.fit.form;
    let value = |of: &Fitted, index: usize| {
        let Precision { lower, upper, .. } = of.known[index];
        let interval = [lower.map_or(0.0, f64::exp), upper.map_or(f64::INFINITY, f64::exp)];
        Measured::from_si(of.fit.logs[index].exp(), Some(interval), unit_of(form, index, display))
    };
    let roles = form.roles();
    let mut pairs: Vec<Pair> = (0..without.fit.logs.len())
        .filter(|i| roles[*i].1 != Role::Shape)
        .map(|i| Pair { parameter: name_of(form, i), without: value(without, i), with: value(with, i) })
        .collect();
    if form.has(Kind::RateRamp) {
        let unit = coefficient_unit(Kind::RateRamp, display);
        let slope = |of: &Fitted| Measured::from_si(of.fit.slope, None, unit.clone());
        let parameter = parameter_name(Kind::RateRamp, 0, Role::Coefficient);
        pairs.push(Pair { parameter, without: slope(without), with: slope(with) });
    }
    pairs
}
