//! What is said of one axis beside the numbers: what its log does not tell, and warnings.

use super::super::selection::FIT_LEVEL;
use super::super::{LENGTHS_TO_TELL, WIDEST_INTERVAL, coefficient_unit, worth_recording, would_have_shown};
use super::CLOSE;
use super::form::Piece;
use super::growth::score;
use super::interval::{Precision, processes, shortest};
use super::names::{name_of, unit_of};
use super::ordinates::Ordinates;
use super::whittle::{self, Fit};
use crate::noise::{Kind, Role, Term};
use crate::numerics::distribution::{NORMAL_90, NORMAL_95};
use crate::numerics::optimize::bracketed_root;
use crate::params::{Measured, NotIdentified};
use crate::units::{Unit, digits};

/// Sentences about one axis, numbers in the unit of the log.
pub(super) struct Words<'a> {
    pub(super) data: &'a Ordinates,
    pub(super) display: &'a Unit,
}

impl Words<'_> {
    /// A value of one parameter in the unit of the log.
    fn shown(&self, fit: &Fit, index: usize, log: f64) -> String {
        let unit = unit_of(&fit.form, index, self.display);
        format!("{} {unit}", digits(unit.from_si(log.exp())))
    }

    pub(super) fn unknown_parameters(&self, fit: &Fit, known: &[Precision]) -> Vec<NotIdentified> {
        let line = |i: &usize| fit.form.pieces()[fit.form.roles()[*i].0] != Piece::Oscillation;
        let open = |i: &usize| known[*i].open();
        let shape = |i: &usize| fit.form.roles()[*i].1 == Role::Shape;
        (0..known.len())
            .filter(open)
            .filter(line)
            .filter(|i| !shape(i))
            .map(|i| self.not_identified(fit, i, &known[i]))
            .collect()
    }

    /// Parameters of lines without a limit: of those that are as narrow as the log is long how long their
    /// correlation times are at least (their σ has no upper limit for that reason), of those that are as wide as is
    /// searched that they are.
    pub(super) fn open_lines(&self, fit: &Fit, known: &[Precision]) -> Vec<NotIdentified> {
        let roles = fit.form.roles();
        let line = |i: &usize| fit.form.pieces()[roles[*i].0] == Piece::Oscillation;
        let with_its_time = |i: &usize| roles[*i].1 == Role::Coefficient && known[*i].lower.is_some();
        let open = |i: &usize| known[*i].open() && !with_its_time(i);
        (0..roles.len()).filter(line).filter(open).map(|i| self.not_identified(fit, i, &known[i])).collect()
    }

    fn not_identified(&self, fit: &Fit, index: usize, known: &Precision) -> NotIdentified {
        let span = digits(self.data.total_s());
        let value = |log: f64| self.shown(fit, index, log);
        let reason = match (known.lower, known.upper) {
            (Some(low), _) => format!("above {} (95 %); the {span} s log sets no upper limit", value(low)),
            (None, Some(high)) => format!("below {} (95 %); the {span} s log sets no lower limit", value(high)),
            (None, None) => format!("the {span} s log bounds it on no side"),
        };
        let bounds = fit.bounds(self.data);
        let reason = match shortest(fit, &bounds, index) {
            true => format!("at the shortest that is searched, {}; {reason}", value(fit.logs[index])),
            false => reason,
        };
        // widths shrink like T^(−1/2)
        let needed = self.data.total_s() * (2.0 * NORMAL_95 * known.bound / WIDEST_INTERVAL.ln()).powi(2);
        // and a correlation time without end is told from a random walk by more of them
        let time = processes(&fit.form, Piece::GaussMarkov)
            .into_iter()
            .find(|pair| known.upper.is_none() && pair.contains(&index))
            .map(|[_, time]| fit.logs[time].exp());
        let needed = needed.max(time.map_or(0.0, |time| LENGTHS_TO_TELL * time));
        NotIdentified {
            term: name_of(&fit.form, index),
            reason: format!("{reason}, model {}", fit.form.label()),
            needed_log_s: worth_recording(needed, self.data.total_s()),
            upper_limit: None,
        }
    }

    /// Models of other drift that explain the log about as well.
    pub(super) fn look_alikes(&self, fits: &[(Fit, Vec<Precision>)], chosen: usize) -> Vec<NotIdentified> {
        let own = &fits[chosen].0;
        let slow = |fit: &Fit| {
            let kinds = fit.form.pieces().iter().map(|p| p.kind());
            kinds
                .filter(|k| {
                    matches!(k, Kind::BiasInstability | Kind::GaussMarkov | Kind::RateRandomWalk | Kind::RateRamp)
                })
                .collect::<Vec<_>>()
        };
        let mut found: Vec<NotIdentified> = Vec::new();
        for (i, (fit, known)) in fits.iter().enumerate() {
            // something more is no look-alike
            let more =
                own.form.pieces().iter().all(|piece| fit.form.count(piece.kind()) >= own.form.count(piece.kind()));
            let new: Vec<Kind> = slow(fit).into_iter().filter(|k| !own.form.has(*k)).collect();
            let [kind] = new[..] else { continue };
            let worse = score(fit, self.data) - score(own, self.data);
            if i == chosen || more || worse.abs() >= CLOSE || found.iter().any(|f| f.term == kind.name()) {
                continue;
            }
            let time = fit.form.roles().iter().position(|(piece, role)| {
                kind == Kind::GaussMarkov && *role == Role::CorrelationTime && fit.form.pieces()[*piece].kind() == kind
            });
            let estimate = time.map(|i| fit.logs[i].exp()).filter(|time| *time < self.data.span_s());
            let at_least = time.and_then(|i| known[i].lower.filter(|_| known[i].upper.is_none()));
            let at = match (at_least, estimate) {
                (Some(low), _) => format!(", correlation time above {} s (95 %)", digits(low.exp())),
                (None, Some(time)) => format!(", correlation time about {} s", digits(time)),
                (None, None) => String::new(),
            };
            found.push(NotIdentified {
                term: kind.name().into(),
                reason: format!(
                    "{} explains the log about as well as {} (score {worse:+.2}{at}): the log does not tell them apart",
                    fit.form.label(),
                    own.form.label(),
                ),
                needed_log_s: estimate.map(|time| (LENGTHS_TO_TELL * time).max(4.0 * self.data.total_s())),
                upper_limit: None,
            });
        }
        found
    }

    /// No drift: how much random walk would have shown.
    pub(super) fn no_drift(&self, fit: &Fit) -> Vec<NotIdentified> {
        let slow = [Kind::BiasInstability, Kind::GaussMarkov, Kind::RateRandomWalk, Kind::RateRamp];
        if slow.iter().any(|kind| fit.form.has(*kind)) {
            return vec![];
        }
        let unit = coefficient_unit(Kind::RateRandomWalk, self.display);
        let limit = self.largest_walk(fit).map(|density| Measured::from_si(density, None, unit));
        vec![NotIdentified {
            term: Kind::RateRandomWalk.name().into(),
            reason: format!(
                "no drift is seen above the white noise in {} s{}",
                digits(self.data.total_s()),
                would_have_shown(limit.as_ref())
            ),
            needed_log_s: None,
            upper_limit: limit,
        }]
    }

    /// Density of a random walk that lowers ln L by χ²₁(0.90)/2.
    fn largest_walk(&self, fit: &Fit) -> Option<f64> {
        let touch = whittle::touching(self.data, &Term::RateRandomWalk { density: 1.0 });
        // the last step of the search was on another likelihood
        let without = whittle::log_likelihood(self.data, &fit.form, &fit.logs);
        let fall = |log: f64| {
            let (form, logs, _) = fit.form.with(&fit.logs, Piece::RandomWalk, &[log]);
            2.0 * (without - whittle::log_likelihood(self.data, &form, &logs)) - NORMAL_90.powi(2)
        };
        bracketed_root(fall, touch - 9.0, touch + 6.0, 1e-9).map(f64::exp)
    }

    pub(super) fn warnings(&self, fit: &Fit, p_value: f64) -> Vec<String> {
        let mut warnings = Vec::new();
        if fit.decrement > whittle::WELL || fit.decrement.is_nan() {
            warnings.push(format!(
                "the search for the maximum has not converged (another step would gain {} in ln L)",
                digits(0.5 * fit.decrement)
            ));
        }
        if let Some((frequency, share)) = self.data.tone() {
            warnings.push(format!(
                "{} % of the power is at {} Hz: a sinusoid, not noise; is the sensor at rest?",
                digits(100.0 * share),
                digits(frequency)
            ));
        }
        if p_value < FIT_LEVEL {
            warnings.push(format!(
                "the model does not explain the spectrum (cumulative periodogram, p = {}): intervals are too narrow",
                digits(p_value)
            ));
        }
        warnings
    }
}
