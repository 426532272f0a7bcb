//! Wideband noise of a known model, found anew from the last samples of a log: noise that changes is followed.
//!
//! Whittle's likelihood of a window of n samples, and that of m − n more whose spectrum is exactly that of the
//! design, S⁰ (a conjugate prior; m is the memory, so that the design is worth as much as the samples that are not
//! there yet): with w = (m − n)/n,
//!
//! −ln L(θ) = ½ Σ_j [(1 + w) ln S_j + (dt c_j² + w S⁰_j)/S_j].
//!
//! Only what is no drift (also Gauss-Markov processes of a few samples) is free, the shape of a filter that was
//! searched included: a window says less about slow noise than the log of the design did. Sources: Whittle 1953;
//! Mehra 1972 (adaptive filtering by maximum likelihood); Bernardo & Smith 2000, section 5.2 (conjugate priors as
//! data).

use schemars::JsonSchema;
use serde::Serialize;

use super::form::Form;
use super::names::{name_of, unit_of};
use super::ordinates::Ordinates;
use super::sums::counts_as_white;
use super::whittle;
use crate::identify::FEWEST_SAMPLES;
use crate::noise::{Filter, Kind, NoiseModel, Role, Term};
use crate::signal::lines::Line;
use crate::units::Unit;

/// The noise of one axis as designed and as it is now, wideband terms at the minimum of −ln L(θ) = ½ Σ_j [(1 + w) ln
/// S_j(θ) + (dt c_j² + w S⁰_j)/S_j(θ)]: c_j cosine coefficients of the last n samples, S⁰ the sampled spectrum of
/// the design, w = (m − n)/n for a memory of m samples (Whittle 1953; the design as a conjugate prior). Drift stays
/// as designed.
#[derive(Clone, Debug)]
pub struct Follower {
    form: Form,
    design: Vec<f64>,
    now: Vec<f64>,
    /// Numbers of the logarithms that move.
    free: Vec<usize>,
    dt: f64,
    /// Samples.
    memory: usize,
}

/// A parameter that is followed, SI.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Followed {
    /// As in params.json: `oscillation[1].frequency`.
    pub parameter: String,
    pub unit: String,
    pub design: f64,
    /// After the last samples.
    pub now: f64,
}

impl Follower {
    /// `memory`: so many samples tell the noise.
    pub fn new(design: &NoiseModel, dt: f64, memory: usize) -> Follower {
        let (form, logs) = Form::of(design);
        let mut first = 0;
        let mut free = Vec::new();
        for (piece, own) in form.split(&logs) {
            let indices = first..first + own.len();
            first = indices.end;
            let term = piece.term(&own.iter().map(|v| v.exp()).collect::<Vec<f64>>());
            let wideband = term.is_some_and(|term| counts_as_white(&term, dt));
            free.extend(indices.filter(|_| wideband));
        }
        Follower { design: logs.clone(), now: logs, free, form, dt, memory }
    }

    /// Moves to the maximum of the likelihood of `window`, the last samples (SI, contiguous, finite; no more than
    /// the memory), searched from where it was and from the design. False where they say nothing: fewer than 30, or
    /// all the same.
    pub fn follow(&mut self, window: &[f64]) -> bool {
        let constant = window.iter().all(|value| *value == window[0]);
        if window.len() < FEWEST_SAMPLES || constant || self.free.is_empty() {
            return false;
        }
        let mut data = Ordinates::new(window, self.dt, Some(&self.lines()));
        let weight = (self.memory as f64 / window.len() as f64 - 1.0).max(0.0);
        data.pretend(weight, &whittle::spectrum_of(&data, &self.form, &self.design));
        let from = |start: &Vec<f64>| whittle::climb(&data, &self.form, start, &self.free);
        let found = [&self.now, &self.design].into_iter().filter_map(from);
        match found.max_by(|a, b| a.log_likelihood.total_cmp(&b.log_likelihood)) {
            Some(fit) => self.now = fit.logs,
            None => return false,
        }
        true
    }

    /// Where the spectrum must be seen finely: lines as designed and as they are.
    fn lines(&self) -> Vec<Line> {
        let both = [&self.design, &self.now].into_iter().flat_map(|logs| self.form.terms(logs));
        both.filter_map(|term| match term {
            Term::Oscillation { frequency_hz, correlation_time, .. } => {
                Some(Line { frequency_hz, width_hz: 1.0 / (std::f64::consts::PI * correlation_time) })
            }
            _ => None,
        })
        .collect()
    }

    /// All processes as they are now, but for flicker and a ramp; those of one kind in the order of the design.
    pub fn noise(&self) -> NoiseModel {
        self.model(&self.now)
    }

    /// The same with all that is followed a little lower: to see what it moves.
    pub fn nudged(&self) -> NoiseModel {
        let mut logs = self.now.clone();
        self.free.iter().for_each(|i| logs[*i] -= 1e-3);
        self.model(&logs)
    }

    fn model(&self, logs: &[f64]) -> NoiseModel {
        NoiseModel { terms: self.form.terms(logs).filter(|term| term.kind() != Kind::BiasInstability).collect() }
    }

    /// `unit`: of the log, SI. The shape of a filter by its coefficients.
    pub fn parameters(&self, unit: &Unit) -> Vec<Followed> {
        let roles = self.form.roles();
        let unit = |i: usize| unit_of(&self.form, i, unit).text().to_string();
        let mut all = Vec::new();
        for &i in &self.free {
            let named = |parameter: String, design: f64, now: f64| Followed { parameter, unit: unit(i), design, now };
            let (piece, role) = roles[i];
            if role != Role::Shape {
                all.push(named(name_of(&self.form, i), self.design[i].exp(), self.now[i].exp()));
            } else if roles[i - 1].1 != Role::Shape {
                let (Some(design), Some(now)) = (self.filter(piece, &self.design), self.filter(piece, &self.now))
                else {
                    continue;
                };
                for (which, of) in
                    [("numerator", Filter::numerator as fn(&Filter) -> &[f64]), ("denominator", Filter::denominator)]
                {
                    let pairs = of(&design).iter().zip(of(&now)).enumerate();
                    all.extend(pairs.map(|(k, (from, to))| named(format!("band_limit.{which}[{k}]"), *from, *to)));
                }
            }
        }
        all
    }

    /// That of a piece which is a band limit.
    fn filter(&self, piece: usize, logs: &[f64]) -> Option<Filter> {
        let (piece, own) = self.form.split(logs).nth(piece)?;
        match piece.term(&own.iter().map(|v| v.exp()).collect::<Vec<f64>>())? {
            Term::BandLimit { filter, .. } => Some(filter),
            _ => None,
        }
    }
}
