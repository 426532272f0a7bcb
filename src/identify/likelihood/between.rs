//! Whether several logs are of one sensor in one condition, parameter by parameter; where they are not, the mean
//! over logs and how far it moves from one to the next.
//!
//! Each log has its own maximum θ_l on its own cosine coefficients, with the variance v_l. What is well known is
//! held together by Q = Σ (θ_l − θ̄)²/v_l, what is not by twice the fall of Σ ln L_l when one value has to do for
//! all logs, the other parameters free in each: both are χ²_{k−1} where the k logs do not differ. Where they do, θ_l
//! ~ N(μ, τ² + v_l): τ² is where Q(τ²) = Σ (θ_l − μ)²/(τ² + v_l) is its expectation k − 1, its 95 % limits where Q
//! is at the quantiles of χ²_{k−1}, and μ has the interval of Student's t with k − 1 degrees of freedom. All of
//! logarithms. Lines are not compared, nor is the shape of a filter. Sources: Cochran 1954 (Q); Paule & Mandel 1982
//! (τ²); Viechtbauer 2007 (limits of τ²); Hartung & Knapp 2001 (interval of μ); Wilks 1938.

use rayon::prelude::*;
use schemars::JsonSchema;
use serde::Serialize;

use super::super::tails::widened;
use super::names::name_of;
use super::ordinates::Ordinates;
use super::sums::{Sum, counts_as_white, growth};
use super::whittle::{self, Fit};
use super::{Fitted, Identified, interval};
use crate::identify::FEWEST_SAMPLES;
use crate::noise::{Kind, NoiseModel, Role, Term};
use crate::numerics::distribution::{NORMAL_95, chi_square_quantile, chi_square_sf, student_quantile};
use crate::numerics::optimize::{bracketed_root, lowest};
use crate::params::AxisParams;
use crate::units::digits;

/// Chance that an axis whose logs do not differ is said to differ in anything.
const LEVEL: f64 = 0.01;
/// Standard deviation of a logarithm up to which its likelihood is a parabola, and beyond which one log says too
/// little to be held against others.
const PARABOLA: f64 = 0.03;
const VAGUE: f64 = 1.0;
/// One value for all logs is looked for to this share of what they span: 0.1 % of the ratio.
const WIDTH: f64 = 4e-3;

/// One parameter in each of several logs.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Between {
    /// `white.density`.
    pub parameter: String,
    pub unit: String,
    /// Of each log its own estimate, in `unit`, and its standard deviation, %; null of a log that is too short.
    pub logs: Vec<Option<[f64; 2]>>,
    /// χ² with one degree of freedom less than there are logs, where they do not differ.
    pub chi_square: f64,
    pub degrees_of_freedom: usize,
    pub p_value: f64,
    /// Beyond chance: then value and interval of the parameter are those of the mean over logs.
    pub differs: bool,
    /// Standard deviation from log to log, %, and its 95 % interval.
    pub spread_percent: f64,
    pub spread_interval_percent: [f64; 2],
}

/// Logarithms with their variances, and what is known of them together.
struct Group {
    values: Vec<f64>,
    variances: Vec<f64>,
}

impl Group {
    /// Weighted mean, sum of the weights, and Q, at this variance between.
    fn at(&self, between: f64) -> [f64; 3] {
        let weighted = || self.values.iter().zip(self.variances.iter().map(|v| 1.0 / (v + between)));
        let sum: f64 = weighted().map(|(_, w)| w).sum();
        let mean = weighted().map(|(value, w)| value * w).sum::<f64>() / sum;
        [mean, sum, weighted().map(|(value, w)| w * (value - mean).powi(2)).sum()]
    }

    /// The variance between at which Q is `target`; 0 where it is less without any.
    fn between(&self, target: f64) -> f64 {
        let excess = |between: f64| self.at(between)[2] - target;
        let largest = self.variances.iter().fold(f64::MIN_POSITIVE, |most: f64, v| most.max(*v));
        let high = std::iter::successors(Some(largest), |high| Some(2.0 * high))
            .find(|high| excess(*high) <= 0.0 || high.is_infinite());
        high.and_then(|high| bracketed_root(excess, 0.0, high, 0.0)).unwrap_or(0.0)
    }
}

/// One parameter of the model, in the logs as they are fitted.
struct Place {
    /// Which logarithm, and which of the parameters that are written.
    index: usize,
    written: usize,
    coefficient: bool,
}

impl Identified {
    /// Holds the logs against each other; where a parameter differs, its value and interval become those of the mean
    /// over logs. `stretches`: one per log.
    pub(in super::super) fn with_spread(mut self, stretches: &[&[f64]]) -> Identified {
        let Some(Fitted { fit, lines, .. }) = self.fitted.clone().filter(|_| stretches.len() > 1) else { return self };
        let long: Vec<bool> = stretches.iter().map(|own| own.len() >= FEWEST_SAMPLES).collect();
        let usable: Vec<&[f64]> = stretches.iter().zip(&long).filter(|(_, long)| **long).map(|(own, _)| *own).collect();
        let dt = self.curve.dt;
        let fitted = |rate: &&[f64]| {
            let data = Ordinates::new(rate, dt, Some(&lines));
            let own = whittle::climb_all(&data, &fit.form, &fit.logs)?;
            // at the parameters of all: an estimate that is large by chance has no larger weight
            let sigmas = interval::deviations(whittle::expected_information(&data, &fit.form, &fit.logs));
            Some(Log { data, own, sigmas })
        };
        let Some(logs) = usable.par_iter().map(fitted).collect::<Option<Vec<Log>>>() else { return self };
        let places = places(&mut self.params, &fit);
        let told = |place: &&Place| logs.iter().all(|log| log.sigmas[place.index] < VAGUE);
        let places: Vec<&Place> = places.iter().filter(told).collect();
        if logs.len() < 2 || places.is_empty() {
            return self;
        }
        let level = LEVEL / places.len() as f64;
        let dof = logs.len() - 1;
        for place in places {
            let i = place.index;
            let excess = if place.coefficient { self.tails.excess_kurtosis } else { 0.0 };
            let variance = |log: &Log| log.sigmas[i].powi(2) + excess / (4.0 * log.data.samples as f64);
            let group = Group {
                values: logs.iter().map(|log| log.own.logs[i]).collect(),
                variances: logs.iter().map(variance).collect(),
            };
            let chi_square = if logs.iter().all(|log| log.sigmas[i] < PARABOLA) {
                group.at(0.0)[2]
            } else {
                let known: f64 = logs.iter().map(|log| log.sigmas[i].powi(2)).sum();
                ratio(&logs, i, &group.values) * known / group.variances.iter().sum::<f64>()
            };
            let p_value = chi_square_sf(chi_square, dof as f64);
            let differs = p_value < level;
            let spread = |target: f64| 100.0 * group.between(target).sqrt();
            let ends = [0.975, 0.025].map(|p| spread(chi_square_quantile(p, dof as f64)));
            let mut own = logs.iter().zip(&group.variances);
            let name = name_of(&fit.form, i);
            let Some((parameter, unit)) =
                self.params.noise_parameters().nth(place.written).map(|(name, m)| (name, m.unit.clone()))
            else {
                continue;
            };
            let of_log = |long: &bool| {
                let (log, variance) = if *long { own.next()? } else { return None };
                Some([unit.from_si(log.own.logs[i].exp()), 100.0 * variance.sqrt()])
            };
            let found = Between {
                parameter: if parameter.is_empty() { name } else { parameter },
                unit: unit.text().into(),
                logs: long.iter().map(of_log).collect(),
                chi_square,
                degrees_of_freedom: dof,
                p_value,
                differs,
                spread_percent: spread(dof as f64),
                spread_interval_percent: ends,
            };
            if differs {
                self.take_mean(place.written, &group);
                self.warnings.push(found.words());
            }
            self.between.push(found);
        }
        self
    }

    /// Value and interval of one parameter, and of the sums it is part of, from the mean over logs.
    fn take_mean(&mut self, written: usize, group: &Group) {
        let dof = group.values.len() as f64 - 1.0;
        let [mean, weight, q] = group.at(group.between(dof));
        let half = student_quantile(0.975, dof) * (q.max(dof) / dof / weight).sqrt();
        let dt = self.curve.dt;
        let slopes = |params: &AxisParams| {
            let mut above = params.clone();
            above.noise_parameters().nth(written).iter_mut().for_each(|(_, m)| m.value *= 1.0 + STEP);
            let [here, there] = [params, &above].map(|params| roots(&params.noise(), dt));
            [0, 1].map(|k| (there[k] / here[k]).ln() / STEP)
        };
        let before = roots(&self.params.noise(), dt);
        let Some((name, measured)) = self.params.noise_parameters().nth(written) else { return };
        let value = measured.unit.from_si(mean.exp());
        let known = measured.interval.map_or(0.0, |[low, high]| 0.5 * (high / low).ln()).max(0.0);
        let more = ((half * half - known * known) / (NORMAL_95 * NORMAL_95)).max(0.0);
        measured.value = value;
        measured.interval = Some([value * (-half).exp(), value * half.exp()]);
        if let Some(own) = self.precision.iter_mut().find(|own| own.parameter == name) {
            own.std_dev_percent = 100.0 * (q.max(dof) / dof / weight).sqrt();
        }
        self.model = self.params.noise();
        let (after, slopes) = (roots(&self.model, dt), slopes(&self.params));
        let moved = |sum: Option<Sum>, k: usize| {
            let by = after[k] / before[k];
            let rescaled = |sum: Sum| Sum {
                value: by * sum.value,
                interval: sum
                    .interval
                    .map(|ends| widened(ends, sum.value, slopes[k].powi(2) * more).map(|end| by * end)),
            };
            if by.is_finite() && slopes[k].is_finite() { sum.map(rescaled) } else { sum }
        };
        self.sums = super::sums::Sums { white: moved(self.sums.white, 0), walk: moved(self.sums.walk, 1) };
    }
}

/// Step of ln p for the slopes.
const STEP: f64 = 1e-4;

/// Roots of what counts as white and of the growth of the drift.
fn roots(model: &NoiseModel, dt: f64) -> [f64; 2] {
    let (white, drift): (Vec<&Term>, Vec<&Term>) = model.terms.iter().partition(|term| counts_as_white(term, dt));
    let white: f64 = white.iter().map(|term| term.psd(0.0, dt)).sum();
    [white.sqrt(), drift.into_iter().map(growth).sum::<f64>().sqrt()]
}

/// One log at its own best parameters.
struct Log {
    data: Ordinates,
    own: Fit,
    /// Of a log like this, at the parameters of all logs.
    sigmas: Vec<f64>,
}

/// The logarithms that are written as they were fitted: processes stand in another order there.
fn places(params: &mut AxisParams, fit: &Fit) -> Vec<Place> {
    let written: Vec<(String, f64)> = params.noise_parameters().map(|(name, m)| (name, m.si())).collect();
    let roles = fit.form.roles();
    let kind = |name: &str| name.split(['.', '[']).next().unwrap_or_default().to_string();
    let of = |index: usize| {
        let (piece, role) = roles[index];
        let name = name_of(&fit.form, index);
        let end = name.rsplit('.').next().unwrap_or_default().to_string();
        // a rounding of the unit apart
        let same = |(other, value): &(String, f64)| {
            kind(other) == kind(&name) && other.ends_with(&end) && (value.ln() - fit.logs[index]).abs() < 1e-9
        };
        // the white noise that goes with a band limit is none that was fitted
        let floor = fit.form.pieces()[piece].kind() == Kind::White && fit.form.has(Kind::BandLimit);
        // a line of one start need not be in another, and has a maximum of its own at every frequency
        let line = fit.form.pieces()[piece].kind() == Kind::Oscillation;
        let fitted = role != Role::Shape && !floor && !line;
        let written = written.iter().position(same).filter(|_| fitted)?;
        Some(Place { index, written, coefficient: role == Role::Coefficient })
    };
    (0..roles.len()).filter_map(of).collect()
}

/// Twice the fall of the likelihoods of all logs when one value of one logarithm has to do for them.
fn ratio(logs: &[Log], index: usize, values: &[f64]) -> f64 {
    let apart: f64 = logs.iter().map(|log| log.own.log_likelihood).sum();
    let joint = |at: f64| {
        let of = |log: &Log| {
            let mut start = log.own.logs.clone();
            start[index] = at;
            let free: Vec<usize> = (0..start.len()).filter(|i| *i != index).collect();
            whittle::climb(&log.data, &log.own.form, &start, &free).map_or(f64::NEG_INFINITY, |fit| fit.log_likelihood)
        };
        logs.par_iter().map(of).collect::<Vec<_>>().into_iter().sum::<f64>()
    };
    let (low, high) = values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
    let best = lowest(|at| -joint(at), low, high, WIDTH * (high - low));
    (2.0 * (apart - joint(best))).max(0.0)
}

impl Between {
    /// The log that is farthest from the mean of the others, by its number from 1, and by how much, as a ratio.
    fn farthest(&self) -> Option<(usize, f64)> {
        let all: Vec<(usize, f64)> =
            self.logs.iter().enumerate().filter_map(|(i, own)| Some((i + 1, own.as_ref()?[0].ln()))).collect();
        let sum: f64 = all.iter().map(|(_, ln)| ln).sum();
        let apart = |(_, ln): &(usize, f64)| ln - (sum - ln) / (all.len() as f64 - 1.0);
        let farthest = all.iter().max_by(|a, b| apart(a).abs().total_cmp(&apart(b).abs()))?;
        Some((farthest.0, apart(farthest).exp()))
    }

    fn words(&self) -> String {
        let [low, high] = self.spread_interval_percent.map(digits);
        let which = self.farthest().map_or_else(String::new, |(log, ratio)| {
            format!("; the farthest, log {log}, has {} times that of the others", digits(ratio))
        });
        format!(
            "the logs differ in {} (chi-square {} with {} degrees of freedom, p = {}){which}: its value and interval \
             are those of the mean over logs, \
             and from one log to the next it moves by {} % (1 sigma; 95 %: {low} … {high} %)",
            self.parameter,
            digits(self.chi_square),
            self.degrees_of_freedom,
            digits(self.p_value),
            digits(self.spread_percent)
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Variance between, its limits and the mean of eight trials, against SciPy's `brentq` on Q(τ²), computed apart.
    #[test]
    fn variance_between_is_where_q_is_its_expectation() {
        let group = Group {
            values: vec![0.10, 0.30, 0.35, 0.65, 0.45, 0.15, -0.05, 0.20],
            variances: vec![0.03, 0.01, 0.05, 0.02, 0.01, 0.04, 0.02, 0.01],
        };
        let limits = [0.975, 0.025].map(|p| chi_square_quantile(p, 7.0));
        let found = [7.0, limits[0], limits[1]].map(|target| group.between(target));
        let expected = [0.027_519_890_842_4, 0.001_522_701_966_75, 0.177_157_095_483];
        for (found, expected) in found.iter().zip(expected) {
            assert!((found / expected - 1.0).abs() < 1e-9, "{found} {expected}");
        }
        assert!((group.at(0.0)[2] - 17.405_052_264_8).abs() < 1e-9);
        let alike = Group { values: vec![1.0, 1.001, 0.999], variances: vec![1e-4; 3] };
        assert_eq!(alike.between(2.0), 0.0);
    }
}
