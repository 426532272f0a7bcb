//! Intervals of the parameters: from the observed information, or from the profile likelihood where that is not enough.

use nalgebra::DMatrix;
use rayon::prelude::*;

use super::form::{Form, Piece};
use super::ordinates::Ordinates;
use super::whittle::{self, Fit};
use crate::noise::{Kind, Role};
use crate::numerics::distribution::{NORMAL_90, NORMAL_95, NORMAL_99};
use crate::numerics::optimize::covariance;

/// Standard deviation of a logarithm from which the likelihood is no parabola any more; of drift parameters, and of
/// others.
const ROUGH: [f64; 2] = [0.03, 0.15];
/// Of what is no drift where a band limit of many coefficients would have to be found anew at every step of a profile.
const ROUGH_BESIDE_A_FILTER: f64 = 0.5;
/// Standard deviation of a logarithm from which a parameter is as good as unknown.
const UNSURE: f64 = 1.0;
/// Of the search for a limit.
const STEPS: usize = 32;
/// A root of twice the fall this far from the level, however near the places that are tried.
const LEAP: f64 = 0.3;
/// A logarithm this near an end of its range is at it: the search ends on the bound itself but for rounding.
const AT_END: f64 = 1e-6;

/// What the log says about one logarithm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Precision {
    /// From the observed information; infinite where that is singular.
    pub(super) sigma: f64,
    /// Cramér-Rao bound of the standard deviation, at the estimate.
    pub(super) bound: f64,
    /// 95 % limits, of the shape of a filter none; None where the likelihood stays above its 95 % level up to the
    /// end of what is searched.
    pub(super) lower: Option<f64>,
    pub(super) upper: Option<f64>,
    /// The 90 % interval has both ends: one-sided tests at 5 % refuse that there is nothing of it, and that a
    /// correlation time has no end (a random walk).
    pub(super) told: bool,
}

impl Precision {
    /// What is known, an open side infinite; `None` where both are.
    pub(super) fn interval(&self) -> Option<[f64; 2]> {
        let limits = [self.lower.unwrap_or(f64::NEG_INFINITY), self.upper.unwrap_or(f64::INFINITY)];
        limits.iter().any(|limit| limit.is_finite()).then_some(limits)
    }

    /// Known to one side only, or to none.
    pub(super) fn open(&self) -> bool {
        self.lower.is_none() || self.upper.is_none()
    }
}

/// Of every logarithm of a fit.
pub(super) fn precisions(data: &Ordinates, fit: &Fit) -> Vec<Precision> {
    completed(data, fit, &drift_precisions(data, fit))
}

/// The same, but for what is no drift from the observed information alone: enough to say what the log tells of its
/// drift.
pub(super) fn drift_precisions(data: &Ordinates, fit: &Fit) -> Vec<Precision> {
    let bounds = fit.bounds(data);
    let ended = ended(fit, &bounds);
    // what is at an end of its range has no curvature there, and is held while others are told
    let inside: Vec<usize> = (0..fit.logs.len()).filter(|i| !ended[*i]).collect();
    let expected = deviations_of(&whittle::expected_information(data, &fit.form, &fit.logs), &inside);
    let observed = deviations_of(&whittle::observed_information(data, fit), &inside);
    let roles = fit.form.roles();
    let limited = fit.form.has(Kind::BandLimit);
    let mut known: Vec<Precision> = (0..fit.logs.len())
        .into_par_iter()
        .map(|i| {
            let (mut sigma, bound) = (observed[i], expected[i]);
            if roles[i].1 == Role::Shape {
                return Precision { sigma, bound, lower: None, upper: None, told: true };
            }
            let drift = fit.form.pieces()[roles[i].0].kind().is_drift();
            if limited && !drift && !sigma.is_finite() {
                // a shape at its bounds makes the observed one singular
                sigma = bound;
            }
            if drift && (sigma >= ROUGH[0] || beside_an_end(fit, &ended, i)) {
                return profiled(data, fit, i, &bounds, [sigma, bound, ROUGH[0]]);
            }
            let [lower, upper] = [-1.0, 1.0].map(|side| Some(fit.logs[i] + side * NORMAL_95 * sigma));
            Precision { sigma, bound, lower, upper, told: true }
        })
        .collect();
    for std_dev in endless(&fit.form, &known) {
        let step = first_step(known[std_dev].sigma, known[std_dev].bound, ROUGH[0]);
        known[std_dev].lower = profile(data, fit, std_dev, -step, &bounds, NORMAL_99).ok();
    }
    keep_open(&fit.form, known)
}

/// All that is known, from what [`drift_precisions`] gave.
pub(super) fn completed(data: &Ordinates, fit: &Fit, known: &[Precision]) -> Vec<Precision> {
    let bounds = fit.bounds(data);
    let ended = ended(fit, &bounds);
    let roles = fit.form.roles();
    let rough = if fit.form.has(Kind::BandLimit) { ROUGH_BESIDE_A_FILTER } else { ROUGH[1] };
    let of = |i: usize| {
        let (piece, role) = roles[i];
        let drift = fit.form.pieces()[piece].kind().is_drift();
        let Precision { sigma, bound, .. } = known[i];
        if drift || role == Role::Shape || (sigma < rough && !beside_an_end(fit, &ended, i)) {
            known[i]
        } else {
            profiled(data, fit, i, &bounds, [sigma, bound, rough])
        }
    };
    keep_open(&fit.form, (0..known.len()).into_par_iter().map(of).collect())
}

/// From the profile likelihood; `rough`: σ from which on it is asked for.
fn profiled(
    data: &Ordinates,
    fit: &Fit,
    i: usize,
    bounds: &[(f64, f64)],
    [sigma, bound, rough]: [f64; 3],
) -> Precision {
    // beside an end also what is known well: a frequency
    let step = first_step(sigma, bound, if sigma.is_finite() { sigma.min(rough) } else { rough });
    let limits = [-1.0, 1.0].map(|side| profile(data, fit, i, side * step, bounds, NORMAL_95));
    let told = limits.iter().all(|limit| limit.map_or_else(|root| root >= NORMAL_90, |_| true));
    let [lower, upper] = limits.map(Result::ok);
    Precision { sigma, bound, lower, upper, told }
}

/// Numbers of σ of the Gauss-Markov processes whose correlation time has a lower limit and no upper one. Their lower
/// limit is that of 99 %, because that of 95 % is right in 90 % of the logs in which it is the only one
/// (docs/validation.md).
pub(super) fn endless(form: &Form, known: &[Precision]) -> Vec<usize> {
    std_devs_of_endless(form, known, Piece::GaussMarkov)
}

/// `known` without upper limits of σ where the correlation time has none: σ grows with it, and the end of the search
/// is no limit.
pub(super) fn keep_open(form: &Form, mut known: Vec<Precision>) -> Vec<Precision> {
    for piece in [Piece::GaussMarkov, Piece::Oscillation] {
        for std_dev in std_devs_of_endless(form, &known, piece) {
            known[std_dev].upper = None;
        }
    }
    known
}

fn std_devs_of_endless(form: &Form, known: &[Precision], piece: Piece) -> Vec<usize> {
    let open = |[_, time]: &[usize; 2]| known[*time].upper.is_none() && known[*time].lower.is_some();
    processes(form, piece).into_iter().filter(open).map(|[std_dev, _]| std_dev).collect()
}

fn first_step(sigma: f64, bound: f64, shortest: f64) -> f64 {
    [sigma, bound].into_iter().filter(|s| s.is_finite()).fold(shortest, f64::max).min(2.0)
}

/// Numbers of σ and Tc of every process that is such a piece: its first parameter and its last.
pub(super) fn processes(form: &Form, piece: Piece) -> Vec<[usize; 2]> {
    let is_time =
        |(_, (of, role)): &(usize, (usize, Role))| form.pieces()[*of] == piece && *role == Role::CorrelationTime;
    let before = piece.roles().len() - 1;
    form.roles().into_iter().enumerate().filter(is_time).map(|(i, _)| [i - before, i]).collect()
}

/// Which logarithms of a fit are at an end of what is searched.
pub(super) fn ended(fit: &Fit, bounds: &[(f64, f64)]) -> Vec<bool> {
    let at_end = |(log, (low, high)): (&f64, &(f64, f64))| *log <= low + AT_END || *log >= high - AT_END;
    fit.logs.iter().zip(bounds).map(at_end).collect()
}

/// The logarithm is that of a correlation time at the shortest that is searched: a limit of the search, where the
/// low end of a coefficient stands for none of it.
pub(super) fn shortest(fit: &Fit, bounds: &[(f64, f64)], i: usize) -> bool {
    fit.form.roles()[i].1 == Role::CorrelationTime && fit.logs[i] <= bounds[i].0 + AT_END
}

/// At least two processes with a parameter of more than 100 % standard deviation, or at the shortest correlation
/// time that is searched. Not those without an end: a steady tone has no width to be known.
pub(super) fn vague(data: &Ordinates, fit: &Fit, known: &[Precision]) -> bool {
    let bounds = fit.bounds(data);
    let roles = fit.form.roles();
    let unsure = |i: usize| {
        let sigma = known[i].sigma;
        roles[i].1 != Role::Shape && ((sigma.is_finite() && sigma > UNSURE) || shortest(fit, &bounds, i))
    };
    let process = |piece: usize| (0..roles.len()).any(|i| roles[i].0 == piece && unsure(i));
    (0..fit.form.pieces().len()).filter(|piece| process(*piece)).count() > 1
}

/// A logarithm of the piece, this one or another, is at an end: no parabola tells how far the others go with it.
fn beside_an_end(fit: &Fit, ended: &[bool], i: usize) -> bool {
    let roles = fit.form.roles();
    roles.iter().zip(ended).any(|((piece, role), ended)| *ended && *role != Role::Shape && *piece == roles[i].0)
}

/// Standard deviations of the logarithms `inside`, the others held; infinite for these.
pub(super) fn deviations_of(information: &DMatrix<f64>, inside: &[usize]) -> Vec<f64> {
    let part = DMatrix::from_fn(inside.len(), inside.len(), |i, k| information[(inside[i], inside[k])]);
    let mut all = vec![f64::INFINITY; information.nrows()];
    inside.iter().zip(deviations(part)).for_each(|(i, sigma)| all[*i] = sigma);
    all
}

/// Standard deviations that belong to an information matrix.
pub(super) fn deviations(information: DMatrix<f64>) -> Vec<f64> {
    let p = information.nrows();
    match covariance(&information) {
        Some(covariance) => (0..p).map(|i| covariance[(i, i)].max(0.0).sqrt()).collect(),
        None => vec![f64::INFINITY; p],
    }
}

/// Where the likelihood, maximised over all other parameters, has fallen by `level`²/2 on the side of the `first`
/// step; within `bounds`, which hold the fit. Where it has not fallen so far, the root of twice its fall at the end
/// (0 where it cannot be had).
///
/// The signed root of the fall is nearly straight in the logarithm and is followed by secants; where it levels off,
/// by growing steps. Not `optimize::bracketed_root`: there is no bracket before the end is met, and each place
/// begins where the one before ended.
fn profile(
    data: &Ordinates,
    fit: &Fit,
    index: usize,
    first: f64,
    bounds: &[(f64, f64)],
    level: f64,
) -> Result<f64, f64> {
    let centre = fit.logs[index];
    let end = if first > 0.0 { bounds[index].1 } else { bounds[index].0 };
    let inside = |v: f64| if first > 0.0 { v.min(end) } else { v.max(end) };
    let mut at = inside(centre + level * first);
    let mut from = fit.logs.clone();
    let roles = fit.form.roles();
    let kind = |i: usize| fit.form.pieces()[roles[i].0].kind();
    // beside a band limit slow noise is profiled over slow noise and densities: its lines and the shape of its
    // filter stand far away, and would take a search of their own
    let beside_a_filter = fit.form.has(Kind::BandLimit) && kind(index).is_drift();
    let far_away = |i: usize| beside_a_filter && (roles[i].1 == Role::Shape || kind(i) == Kind::Oscillation);
    let free: Vec<usize> = (0..from.len()).filter(|i| *i != index && !far_away(*i)).collect();
    let (mut near, mut far): (f64, Option<f64>) = (centre, None);
    let mut before = 0.0;
    for step in 0..STEPS {
        let mut start = from.clone();
        start[index] = at;
        let held = whittle::climb_within(data, &fit.form, &start, &free, bounds).ok_or(0.0)?;
        let root = (2.0 * (fit.log_likelihood - held.log_likelihood)).max(0.0).sqrt();
        from = held.logs;
        if (root - level).abs() < 0.01 {
            return Ok(at);
        }
        // relative: a frequency is known to parts in 10⁵; where the fall leaps over the level, another maximum was
        // met, and nothing is known
        if far.is_some_and(|far| (far - near).abs() < 1e-3 * (far - centre).abs()) {
            return if (root - level).abs() < LEAP { Ok(at) } else { Err(0.0) };
        }
        if root < level {
            near = at;
            if at == end {
                return Err(root);
            }
        } else {
            far = Some(at);
        }
        let levels_off = far.is_none() && step > 1 && root - before < 0.3 * (level - before);
        let shortest = if levels_off { 1.5 } else { 0.2 };
        before = root;
        let straight = centre + (at - centre) * (level / root.max(0.3)).clamp(shortest, 3.0);
        at = match far {
            // between the limits, or halfway when the secant leaves them
            Some(far) if (straight - near) * (straight - far) >= 0.0 => 0.5 * (near + far),
            _ => inside(straight),
        };
    }
    far.map_or(Err(before), |_| Ok(at))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numerics::random::{StreamId, normal, stream};

    /// 600 samples of a Gauss-Markov process of σ 0.3 and 50 samples, in white noise of 1.
    fn fitted(run: u64) -> (Ordinates, Fit) {
        let mut rng = stream(48, StreamId { run, axis: 0, term: 0 });
        let (phi, mut drift) = ((-1.0 / 50.0_f64).exp(), 0.3 * normal(&mut rng));
        let sample = |_| {
            drift = phi * drift + 0.3 * (1.0 - phi * phi).sqrt() * normal(&mut rng);
            drift + normal(&mut rng)
        };
        let rate: Vec<f64> = (0..600).map(sample).collect();
        let data = Ordinates::new(&rate, 1.0, Some(&[]));
        let form = Form::new(vec![Piece::White, Piece::GaussMarkov]);
        let fit = whittle::climb_all(&data, &form, &[0.0, 0.3_f64.ln(), 50.0_f64.ln()]).unwrap();
        (data, fit)
    }

    /// The search for a limit that ends where the value is (a line that has moved to wider bins than those around
    /// its start is narrower than what is searched there) finds none, instead of one that the value has passed, or
    /// of no width: `tune` refuses the first, and the second claims to know.
    #[test]
    fn no_limit_is_on_the_wrong_side_of_its_value() {
        let (data, fit) = fitted(1);
        for (index, value) in fit.logs.iter().enumerate() {
            for first in [0.1, -0.1] {
                let mut bounds = fit.bounds(&data);
                bounds[index] = (*value, *value);
                assert_eq!(profile(&data, &fit, index, first, &bounds, NORMAL_95), Err(0.0), "{index}");
            }
        }
    }

    /// Where a limit stands, the likelihood, at its maximum over all other parameters, has fallen by half of 1.96²,
    /// of σ beside a correlation time without an upper limit by half of 2.576² (the search ends within 0.01 of the
    /// root; a parabola's limits are not looked at).
    #[test]
    fn limits_are_where_the_likelihood_has_fallen() {
        let [mut open, mut closed] = [0; 2];
        for run in 0..60 {
            let (data, fit) = fitted(run);
            let known = precisions(&data, &fit);
            let root = |index: usize, at: f64| {
                let mut start = fit.logs.clone();
                start[index] = at;
                let free: Vec<usize> = (0..3).filter(|i| *i != index).collect();
                let held = whittle::climb(&data, &fit.form, &start, &free).unwrap();
                (2.0 * (fit.log_likelihood - held.log_likelihood)).sqrt()
            };
            let [std_dev, time] = processes(&fit.form, Piece::GaussMarkov)[0];
            let (Some(low), Some(shortest)) = (known[std_dev].lower, known[time].lower) else { continue };
            let level = if known[time].upper.is_none() { NORMAL_99 } else { NORMAL_95 };
            assert!((root(std_dev, low) - level).abs() < 0.02, "run {run}: {}", root(std_dev, low));
            assert!((root(time, shortest) - NORMAL_95).abs() < 0.02, "run {run}: {}", root(time, shortest));
            match known[time].upper {
                None => {
                    assert_eq!(known[std_dev].upper, None);
                    open += 1;
                }
                Some(longest) => {
                    assert!((root(time, longest) - NORMAL_95).abs() < 0.02, "run {run}: {}", root(time, longest));
                    closed += 1;
                }
            }
        }
        assert!(open >= 5 && closed >= 5, "{open} {closed}");
    }
}
