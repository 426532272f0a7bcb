//! The weighted fit of the whole Allan curve, or of the Haar wavelet variances: terms chosen, intervals given, what
//! the log cannot tell said.
//!
//! Rules. A parameter is identified when the upper end of its 95 % interval is at most ten times the lower end; its
//! interval is exp(ln θ ± 1.96 s), s from the fit, widened by √(χ²/dof) when the model does not explain the curve.
//! The model is the one of the lowest score (see `selection`) whose parameters are all identified. Interval widths
//! shrink as T^(−1/2) with the length T of the log (Cramér-Rao): from that the log length that would tell.

use super::points::{Distance, Points};
use super::selection::{FIT_LEVEL, PENALTY, Table, score, search};
use super::shape::Shape;
use super::weighted_fit::{Fit, tolerated};
use super::{
    Candidate, Identified, IdentifyError, LENGTHS_TO_TELL, ModelChoice, WIDEST_INTERVAL, bias, entry, usable,
    worth_recording,
};
use crate::allan::{self, AllanCurve, Deviation, TauGrid};
use crate::noise::{Kind, NoiseModel, Role, Term};
use crate::numerics::distribution::{NORMAL_90, NORMAL_95};
use crate::numerics::optimize::{bisect, half_way};
use crate::numerics::reduce::mean;
use crate::params::{AxisParams, Measured, NotIdentified};
use crate::units::{Unit, digits};

/// Points of the curve per decade of averaging time; denser ones add correlation, not information.
pub const POINTS_PER_DECADE: usize = 5;
/// A model this close in score to the chosen one explains the log about as well.
const CLOSE: f64 = 2.0 * PENALTY;

pub(super) fn identify(
    name: &str,
    rate: &[f64],
    dt: f64,
    display: &Unit,
    choice: &ModelChoice,
    distance: Distance,
) -> Result<Identified, IdentifyError> {
    usable(name, rate)?;
    let failed = |message: String| IdentifyError { message: format!("{name}: {message}") };
    let grid = match distance {
        Distance::CubeRoots => TauGrid::Log(POINTS_PER_DECADE),
        Distance::Variances => TauGrid::Octave,
    };
    let mut curve = allan::curve(rate, dt, Deviation::Oadev, grid).map_err(|e| failed(e.to_string()))?;
    let points = Points::of_curve(&curve, distance);
    let forced = match choice {
        ModelChoice::Auto => None,
        ModelChoice::Terms { kinds, .. } => Some(Shape::new(kinds.clone())),
    };
    if let Some(reason) = choice.beyond_a_curve() {
        return Err(failed(reason));
    }
    let table = search(&points, forced.as_ref());
    let fit = match &forced {
        Some(_) => table.best(),
        None => table.ranked().into_iter().find(|fit| unknown(fit).is_empty()),
    };
    let fit = fit.ok_or_else(|| match &forced {
        Some(shape) => failed(format!(
            "{} samples give {} points of the Allan curve: too few for {} parameters ({}); use a longer log or a \
             smaller `model`",
            rate.len(),
            points.len(),
            shape.parameters(),
            shape.label()
        )),
        None => failed(format!("{} samples say nothing about any noise term; use a longer log", rate.len())),
    })?;

    let known = known_terms(fit, rate);
    let model = NoiseModel { terms: known.iter().map(|(term, _)| *term).collect() };
    curve.refine(&model);
    let words = Words { points: &table.points, display };
    let mut not_identified = words.unknown_parameters(fit);
    if forced.is_none() {
        not_identified.extend(words.better_but_unknown(&table, fit));
        not_identified.extend(words.look_alikes(&table, fit));
        not_identified.extend(words.no_drift(fit));
    }
    let mut warnings = words.misfit(fit, &curve);
    warnings.extend(words.precision(fit));
    Ok(Identified {
        params: AxisParams {
            name: name.into(),
            bias: Some(bias(mean(rate), rate.len(), dt, &model, display)),
            turn_on_bias: None,
            temperature: None,
            terms: known.iter().map(|(term, intervals)| entry(term, intervals, display)).collect::<Result<_, _>>()?,
            not_identified: not_identified.clone(),
        },
        model,
        candidates: candidates(&table, fit),
        precision: vec![],
        exact_log_likelihood: None,
        hold: None,
        time_profile: None,
        fitted: None,
        sums: super::Sums::default(),
        tails: crate::identify::Tails::default(),
        between: vec![],
        not_identified,
        warnings,
        steps: vec![],
        fit_p_value: fit.p_value(),
        fit_distance: None,
        first_tau_s: Some(table.points.first_tau_s()),
        samples: rate.len(),
        curve,
    })
}

/// The model that [`Method::Allan`](super::Method::Allan) would choose for a curve of overlapping Allan deviations,
/// five a decade or so, of one log or of windows; the sign of a ramp is not in it.
pub fn model_of_curve(name: &str, curve: &AllanCurve) -> Result<NoiseModel, IdentifyError> {
    let table = search(&Points::of_curve(curve, Distance::CubeRoots), None);
    let fit = table.ranked().into_iter().find(|fit| unknown(fit).is_empty()).ok_or_else(|| IdentifyError {
        message: format!("{name}: {} samples say nothing about any noise term; use a longer log", curve.samples),
    })?;
    Ok(NoiseModel { terms: known_terms(fit, &[]).into_iter().map(|(term, _)| term).collect() })
}

fn candidates(table: &Table, chosen: &Fit) -> Vec<Candidate> {
    let row = |fit: &Fit| Candidate {
        model: fit.shape.label(),
        parameters: fit.shape.parameters(),
        chi_square: Some(fit.chi_square),
        dof: Some(fit.dof()),
        log_likelihood: None,
        held_out: None,
        score: score(fit),
        identified: unknown(fit).is_empty(),
        chosen: fit.shape == chosen.shape,
    };
    table.ranked().into_iter().map(row).collect()
}

/// Standard deviation of a log parameter as reported.
fn log_sigma(fit: &Fit, index: usize) -> f64 {
    let widened = if fit.p_value() < FIT_LEVEL { fit.inflation() } else { 1.0 };
    fit.log_sigmas[index] * widened
}

/// 95 % interval, SI; None where it says nothing.
fn interval(fit: &Fit, index: usize) -> Option<[f64; 2]> {
    let half = NORMAL_95 * log_sigma(fit, index);
    (2.0 * half <= WIDEST_INTERVAL.ln()).then(|| [-half, half].map(|shift| (fit.log_parameters[index] + shift).exp()))
}

/// Indices of the parameters that are not identified.
fn unknown(fit: &Fit) -> Vec<usize> {
    (0..fit.log_parameters.len()).filter(|j| interval(fit, *j).is_none()).collect()
}

/// The terms whose parameters are all identified, with their intervals; Gauss-Markov by ascending correlation time,
/// the sign of a ramp from the log.
fn known_terms(fit: &Fit, rate: &[f64]) -> Vec<(Term, [Option<[f64; 2]>; 2])> {
    let mut index = 0;
    let mut known = Vec::new();
    for term in fit.model().terms {
        let parameters = term.kind().roles().len();
        let intervals: Vec<Option<[f64; 2]>> = (index..index + parameters).map(|j| interval(fit, j)).collect();
        index += parameters;
        if intervals.iter().all(Option::is_some) {
            let signed = match term {
                Term::RateRamp { slope } if trend_is_down(rate) => Term::RateRamp { slope: -slope },
                other => other,
            };
            let mut pair = [intervals[0], intervals.get(1).copied().flatten()];
            if let (Term::RateRamp { slope }, Some([lower, upper])) = (signed, pair[0])
                && slope < 0.0
            {
                pair[0] = Some([-upper, -lower]);
            }
            known.push((signed, pair));
        }
    }
    let time =
        |term: &Term| if let Term::GaussMarkov { correlation_time, .. } = term { *correlation_time } else { 0.0 };
    known.sort_by(|(a, _), (b, _)| a.kind().cmp(&b.kind()).then(time(a).total_cmp(&time(b))));
    known
}

/// Sign of the least-squares slope.
fn trend_is_down(rate: &[f64]) -> bool {
    let middle = (rate.len() as f64 - 1.0) / 2.0;
    let origin = rate.first().copied().unwrap_or(0.0);
    rate.iter().enumerate().map(|(i, x)| (i as f64 - middle) * (x - origin)).sum::<f64>() < 0.0
}

/// Sentences about one axis, numbers in the unit of the log.
struct Words<'a> {
    points: &'a Points,
    display: &'a Unit,
}

impl Words<'_> {
    fn parameter_name(fit: &Fit, index: usize) -> String {
        let (kind, role) = fit.shape.roles()[index];
        let name = kind.name();
        match role {
            Role::CorrelationTime => format!("{name}.correlation_time"),
            Role::Frequency => format!("{name}.frequency"),
            Role::Shape => format!("{name}.shape"),
            Role::Coefficient if kind.roles().len() > 1 => format!("{name}.std_dev"),
            Role::Coefficient => name.into(),
        }
    }

    /// One parameter's value in the unit of the log.
    fn shown(&self, fit: &Fit, index: usize) -> String {
        let (kind, role) = fit.shape.roles()[index];
        let value = fit.log_parameters[index].exp();
        match role {
            Role::CorrelationTime => format!("{} s", digits(value)),
            Role::Frequency => format!("{} Hz", digits(value)),
            Role::Shape => digits(value),
            Role::Coefficient => {
                let unit = super::coefficient_unit(kind, self.display);
                format!("{} {unit}", digits(unit.from_si(value)))
            }
        }
    }

    /// Length of a log in which the interval of this parameter would span `ratio`.
    fn length_for(&self, fit: &Fit, index: usize, ratio: f64) -> Option<f64> {
        let sigma = log_sigma(fit, index);
        let length = self.points.span_s() * (2.0 * NORMAL_95 * sigma / ratio.ln()).powi(2);
        length.is_finite().then_some(length)
    }

    fn not_identified(&self, fit: &Fit, index: usize) -> NotIdentified {
        let factor = (NORMAL_95 * log_sigma(fit, index)).exp();
        let reason = if factor.is_finite() && factor < 1e4 {
            format!(
                "the {} s log gives {} within a factor of {} (95 %)",
                digits(self.points.span_s()),
                self.shown(fit, index),
                digits(factor)
            )
        } else {
            format!("the {} s log bounds it on one side at most", digits(self.points.span_s()))
        };
        NotIdentified {
            term: Words::parameter_name(fit, index),
            reason: format!("{reason}, model {}", fit.shape.label()),
            needed_log_s: self
                .length_for(fit, index, WIDEST_INTERVAL)
                .and_then(|needed| worth_recording(needed, self.points.span_s())),
            upper_limit: None,
        }
    }

    fn unknown_parameters(&self, fit: &Fit) -> Vec<NotIdentified> {
        unknown(fit).into_iter().map(|j| self.not_identified(fit, j)).collect()
    }

    /// The best-scoring model, when some of its parameters are unknown and another had to be taken.
    fn better_but_unknown(&self, table: &Table, chosen: &Fit) -> Vec<NotIdentified> {
        match table.best() {
            Some(best) if best.shape != chosen.shape => self.unknown_parameters(best),
            _ => vec![],
        }
    }

    /// Drift processes that would explain the log about as well as the chosen one.
    fn look_alikes(&self, table: &Table, chosen: &Fit) -> Vec<NotIdentified> {
        let drifts = [Kind::BiasInstability, Kind::GaussMarkov, Kind::RateRandomWalk, Kind::RateRamp];
        let mut found: Vec<NotIdentified> = Vec::new();
        for own in drifts.into_iter().filter(|k| chosen.shape.has(*k)) {
            for other in drifts.into_iter().filter(|k| !chosen.shape.has(*k)) {
                let Some(fit) = table.get(&chosen.shape.without(own).with(other)) else { continue };
                let new = found.iter().all(|f| f.term != other.name());
                if new && fit.p_value() >= FIT_LEVEL && score(fit) < score(chosen) + CLOSE {
                    found.push(self.look_alike(chosen, own, fit, other));
                }
            }
        }
        found
    }

    fn look_alike(&self, chosen: &Fit, own: Kind, fit: &Fit, other: Kind) -> NotIdentified {
        let time = fit
            .model()
            .terms
            .iter()
            .filter_map(
                |t| if let Term::GaussMarkov { correlation_time, .. } = t { Some(*correlation_time) } else { None },
            )
            .fold(f64::NAN, f64::max);
        let inside = time < self.points.span_s();
        let at = if inside { format!(", correlation time about {} s", digits(time)) } else { String::new() };
        NotIdentified {
            term: other.name().into(),
            reason: format!(
                "{} in place of {} explains the curve about as well (score {} against {}{at}): the log does not tell \
                 them apart",
                other.short_name(),
                own.short_name(),
                digits(score(fit)),
                digits(score(chosen)),
            ),
            needed_log_s: inside.then_some((LENGTHS_TO_TELL * time).max(4.0 * self.points.span_s())),
            upper_limit: None,
        }
    }

    /// White noise alone: how much random walk would have gone unseen.
    fn no_drift(&self, fit: &Fit) -> Vec<NotIdentified> {
        let kind = Kind::RateRandomWalk;
        if fit.shape.kinds().iter().any(|k| !matches!(k, Kind::White | Kind::Quantization)) {
            return vec![];
        }
        let unit = super::coefficient_unit(kind, self.display);
        let limit = largest_tolerated(self.points, fit, kind).map(|limit| Measured::from_si(limit, None, unit));
        vec![NotIdentified {
            term: kind.name().into(),
            reason: format!(
                "no drift is seen above the white noise in {} s{}",
                digits(self.points.span_s()),
                super::would_have_shown(limit.as_ref())
            ),
            needed_log_s: None,
            upper_limit: limit,
        }]
    }

    /// Averaging times that were left out, and a model that does not explain the rest.
    fn misfit(&self, fit: &Fit, curve: &AllanCurve) -> Vec<String> {
        let mut warnings = Vec::new();
        let first = self.points.first_tau_s();
        let shortest = curve.points.first().filter(|p| p.tau_s < 0.99 * first);
        if let Some(shortest) = shortest {
            let expected = fit.model().allan_variance(shortest.m, curve.dt).sqrt();
            let percent = 100.0 * (shortest.deviation / expected - 1.0);
            let why = if percent < 0.0 {
                "the log is band-limited (filter of the sensor)"
            } else {
                "vibration, aliasing or quantisation show"
            };
            warnings.push(format!(
                "averaging times below {} s left out: {why}, and N of shorter times would feel it; the deviation of \
                 single samples is {:+.0} % off the model, so \
                 neighbouring innovations of a filter at this rate will not be white (`method` likelihood looks for \
                 filters and lines)",
                digits(first),
                percent
            ));
        }
        if fit.p_value() < FIT_LEVEL {
            warnings.push(format!(
                "the model does not explain the curve (chi-square {} on {} degrees of freedom, p = {}): intervals \
                 widened by {}",
                digits(fit.chi_square),
                fit.dof(),
                digits(fit.p_value()),
                digits(fit.inflation())
            ));
        }
        warnings
    }

    /// Correlation times that are known only roughly.
    fn precision(&self, fit: &Fit) -> Vec<String> {
        let roles = fit.shape.roles();
        let rough = |j: &usize| {
            let factor = (NORMAL_95 * log_sigma(fit, *j)).exp();
            roles[*j].1 == Role::CorrelationTime && factor > 1.5 && interval(fit, *j).is_some()
        };
        let sentence = |j: usize| {
            let hours = |ratio: f64| digits(self.length_for(fit, j, ratio).unwrap_or(f64::NAN) / 3600.0);
            format!(
                "correlation time known within a factor of {} (95 %); a factor of 1.5 takes a log of {} h, 1.2 takes \
                 {} h",
                digits((NORMAL_95 * log_sigma(fit, j)).exp()),
                hours(1.5 * 1.5),
                hours(1.2 * 1.2)
            )
        };
        (0..roles.len()).filter(rough).map(sentence).collect()
    }
}

/// The coefficient of a term that raises χ² by [`NORMAL_90`]² (one-sided 95 %) over the fit without it.
fn largest_tolerated(points: &Points, fit: &Fit, kind: Kind) -> Option<f64> {
    let excess = |log_coefficient: f64| {
        tolerated(points, fit, kind, log_coefficient).map(|chi_square| chi_square - fit.chi_square - NORMAL_90.powi(2))
    };
    // where the term alone reaches the model's variance at the longest averaging time; far too much
    let longest = *points.factors().last()?;
    let unit = super::shape::one_coefficient(kind, 1.0).allan_variance(longest, points.dt());
    let above = 0.5 * (fit.model().allan_variance(longest, points.dt()) / unit).ln() + 2.0;
    let below = above - 5.0;
    if excess(above)? < 0.0 || excess(below)? > 0.0 {
        return None;
    }
    let past = |at| Ok::<_, ()>(excess(at).ok_or(())? > 0.0);
    let (below, above) = bisect(below, above, half_way(0.02), past).ok()?;
    Some((0.5 * (above + below)).exp())
}
