//! Maximum likelihood on the cosine coefficients of the log: terms chosen, intervals given, the Cramér-Rao bound
//! beside them.
//!
//! `ordinates` is the log in bins, `form` what a model consists of, `whittle` the likelihood and its maximum,
//! `growth` the choice of the terms, `interval` what is known of each parameter, `sums` of several together, `plan`
//! how long a log must be for that, `recent` whether it stays the same along the log, `between` whether several logs
//! do not differ, `follow` the wideband part of it anew from the last samples, `temperature` what of it follows the
//! temperature, `words` what is said beside the numbers.

pub(super) mod between;
mod exact;
pub(super) mod follow;
mod form;
mod growth;
pub(super) mod hold;
mod interval;
pub(super) mod maximum;
mod names;
mod ordinates;
pub mod plan;
pub(super) mod recent;
pub(super) mod shared;
pub(super) mod sums;
pub mod temperature;
mod turn_on;
mod whittle;
pub mod windows;
mod words;

use rayon::prelude::*;

use super::{Candidate, Identified, IdentifyError, ModelChoice, Precision as Known, bias, entry, usable};
use crate::allan::{self, AllanCurve, Deviation, Pooled, TauGrid, deviation};
use crate::consistency::spectrum::{Departure, departure};
use crate::filter::likelihood::{LogLikelihood, Stretch};
use crate::noise::{Kind, NoiseModel, Role, Term};
use crate::numerics::distribution::NORMAL_95;
use crate::numerics::reduce::mean;
use crate::params::AxisParams;
use crate::signal::lines::Line;
use crate::units::Unit;
use exact::{Exact, Refined};
use form::{Form, Piece};
use growth::score;
pub(super) use growth::{LONGEST_AVERAGE, MOST_POLES};
use hold::{Hold, HoldCost};
use interval::{Precision, completed, drift_precisions};
use names::{name_of, parameter_name, term_name, unit_of};
use ordinates::Ordinates;
use whittle::{FAST, Fit};
use words::Words;

/// Points of the shown Allan curve per decade of averaging time.
const POINTS_PER_DECADE: usize = 5;
/// A model this close in score to the chosen one explains the log about as well.
const CLOSE: f64 = 6.0;
/// Gain in ln L of the last third that outweighs a worse score.
const CLEARLY: f64 = 3.0;
/// Candidates whose parameters are looked at, at most.
const LOOKED_AT: usize = 12;
/// Candidates that are tried on the part of the log they have not seen.
const HELD_OUT: usize = 6;
/// Standard deviation of a logarithm below which second differences of the exact likelihood give its interval.
const PARABOLA: f64 = 0.3;
/// Share of the log to which the candidates are fitted for that.
const FITTED_SHARE: f64 = 2.0 / 3.0;

/// `stretches`: of each log, on which terms are chosen; `logs`: all of it, for the exact likelihood.
pub(super) fn identify(
    name: &str,
    stretches: &[&[f64]],
    logs: &[Vec<Stretch<'_>>],
    dt: f64,
    display: &Unit,
    choice: &ModelChoice,
    holds: &[Hold],
) -> Result<Identified, IdentifyError> {
    let rates = same_length(stretches);
    let failed = |message: String| IdentifyError { message: format!("{name}: {message}") };
    let nothing = || failed("no samples".into());
    let rate = *rates.first().ok_or_else(nothing)?;
    rates.iter().try_for_each(|own| usable(name, own))?;
    let search = || {
        let data = Ordinates::of_several(&rates, dt)?;
        let lines = data.lines.clone();
        Some(choose(data, choice, &|| thirds(&rates, dt, &lines), logs))
    };
    let allan = || match rates[..] {
        [rate] => allan::curve(rate, dt, Deviation::Oadev, TauGrid::Log(POINTS_PER_DECADE)),
        _ => {
            let mut pooled = Pooled::new(Deviation::Oadev, rate.len(), dt, TauGrid::Log(POINTS_PER_DECADE));
            rates.iter().try_for_each(|rate| pooled.add(&deviation::phase(rate, dt)))?;
            Ok(pooled.curve())
        }
    };
    let (curve, found) = rayon::join(allan, search);
    let curve = curve.map_err(|e| failed(e.to_string()))?;
    let found = found.ok_or_else(nothing)?.holding(holds, name, display, logs)?;
    Whole { name, samples: rate.len(), level: mean(rate), dt, display, choice }.identified(found, curve)
}

/// Of several stretches those that, cut to one length, have the most samples together: with one length they have the
/// same frequencies.
fn same_length<'a>(stretches: &[&'a [f64]]) -> Vec<&'a [f64]> {
    let of = |length: usize| length * stretches.iter().filter(|own| own.len() >= length).count();
    let lengths = stretches.iter().map(|own| own.len());
    let Some(length) = lengths.max_by(|a, b| of(*a).cmp(&of(*b)).then(a.cmp(b))) else { return Vec::new() };
    stretches.iter().filter(|own| own.len() >= length).map(|own| &own[..length]).collect()
}

/// What is said of the log as a whole.
struct Whole<'a> {
    name: &'a str,
    samples: usize,
    /// Their mean.
    level: f64,
    dt: f64,
    display: &'a Unit,
    choice: &'a ModelChoice,
}

impl Whole<'_> {
    /// The chosen candidate in words and numbers.
    fn identified(&self, found: Candidates, mut curve: AllanCurve) -> Result<Identified, IdentifyError> {
        let &Whole { name, samples, level, dt, display, choice } = self;
        let failed = |message: String| IdentifyError { message: format!("{name}: {message}") };
        let forced = *choice != ModelChoice::Auto;
        let Candidates { data, fits, held_out, chosen, refined, biases, hold } = found;
        let used = data.samples * data.windows as usize;
        let (Some((on_cosines, _)), Some((fitted, refined))) = (fits.get(chosen), refined) else {
            let asked = |kind: Kind| matches!(choice, ModelChoice::Terms { kinds, .. } if kinds.contains(&kind));
            return Err(failed(if asked(Kind::Oscillation) {
                "no line stands out of the spectrum: leave osc out of `model`".into()
            } else if asked(Kind::BandLimit) {
                "every filter of this order would be a line (osc) or drift (gm, flicker, rrw): add that to `model`, \
                 take another order, or auto"
                    .into()
            } else {
                format!("{samples} samples say nothing about any noise term; use a longer log")
            }));
        };

        let Fitted { fit, known, .. } = &fitted;
        let words = Words { data: &data, display };
        let terms = known_terms(&data, fit, known);
        let all_known = unknown(&data, fit, known).is_empty();
        let model = NoiseModel { terms: terms.iter().map(|found| found.term).collect() };
        curve.refine(&model);
        let mut not_identified = words.unknown_parameters(fit, known);
        not_identified.extend(words.open_lines(fit, known));
        if !forced {
            if let Some((best, of_best)) = fits.first().filter(|_| chosen > 0) {
                not_identified.extend(words.unknown_parameters(best, of_best));
            }
            not_identified.extend(words.look_alikes(&fits, chosen));
            not_identified.extend(words.no_drift(fit));
        }
        let sums = sums::sums(&data, fit, refined.as_ref().and_then(|refined| refined.information.as_ref()));
        let Departure { p_value: fit_p_value, distance, .. } = goodness(&data, fit);
        let candidate = |(i, (fit, known)): (usize, &(Fit, Vec<Precision>))| Candidate {
            model: fit.form.label(),
            parameters: fit.form.parameters(),
            chi_square: None,
            dof: None,
            log_likelihood: Some(fit.log_likelihood),
            held_out: held_out.get(i).copied().flatten(),
            score: score(fit, &data),
            identified: told(&data, fit, known),
            chosen: i == chosen,
        };
        let candidates = fits.iter().enumerate().map(candidate).collect();
        let (bias, turn_on_bias) = match turn_on::spread(&biases) {
            Some(spread) => spread.measured(display),
            None => {
                // drift that is not told apart is there all the same
                let slopes = model.terms.iter().filter(|term| term.kind() == Kind::RateRamp).copied();
                let every = NoiseModel { terms: fit.form.terms(&fit.logs).chain(slopes).collect() };
                (bias(level, samples, dt, &every, display), None)
            }
        };
        Ok(Identified {
            params: AxisParams {
                name: name.into(),
                bias: Some(bias),
                turn_on_bias,
                temperature: None,
                terms: terms
                    .iter()
                    .map(|found| entry(&found.term, &found.intervals, display))
                    .collect::<Result<_, _>>()?,
                not_identified: not_identified.clone(),
            },
            precision: known_precision(&terms),
            // of what the log says by itself
            time_profile: shared::TimeProfile::new(&data, on_cosines).filter(|_| hold.is_none()),
            hold,
            fitted: Some(fitted.clone()),
            sums,
            tails: crate::identify::Tails::default(),
            between: vec![],
            samples: refined.as_ref().map_or(used, |refined| refined.samples),
            // of the parameters that are written, not of others
            exact_log_likelihood: refined.filter(|_| all_known).map(|refined| refined.log_likelihood),
            warnings: words.warnings(fit, fit_p_value),
            model,
            candidates,
            not_identified,
            steps: vec![],
            fit_p_value,
            fit_distance: Some(distance.abs()),
            first_tau_s: None,
            curve,
        })
    }
}

/// Candidates and the one that was chosen.
struct Candidates {
    data: Ordinates,
    /// Best score first.
    fits: Vec<(Fit, Vec<Precision>)>,
    held_out: Vec<Option<f64>>,
    chosen: usize,
    /// The chosen one at the maximum of the exact likelihood; `None` when there are no candidates.
    refined: Option<(Fitted, Option<Refined>)>,
    /// Of each log; empty for one whose exact likelihood was not searched.
    biases: Vec<LogLikelihood>,
    /// Where parameters are held.
    hold: Option<HoldCost>,
}

/// `parts`: the log in an earlier and a later part, where it can be cut; `logs`: for the exact likelihood, if that
/// is to have the last word.
fn choose(
    data: Ordinates,
    choice: &ModelChoice,
    parts: &(dyn Fn() -> Option<[Ordinates; 2]> + Sync),
    logs: &[Vec<Stretch<'_>>],
) -> Candidates {
    let refined = |fits: &[(Fit, Vec<Precision>)], chosen: usize| {
        fits.get(chosen).map(|(fit, known)| refine(&data, fit, known, fit, logs))
    };
    // where the search had to do without the exact likelihood, one look at it still says what the biases are
    let biases = |refined: &Option<(Fitted, Option<Refined>)>| match refined {
        Some((_, Some(refined))) => refined.biases.clone(),
        Some((Fitted { fit, .. }, None)) if logs.len() > 1 => Exact::biases(&data, &fit.form, &fit.logs, logs),
        _ => vec![],
    };
    let held_out = |parts: Option<[Ordinates; 2]>, fits: &[(Fit, Vec<Precision>)]| {
        parts.map_or_else(|| vec![None; fits.len()], |parts| held_out(&parts, fits))
    };
    match choice {
        ModelChoice::Auto => {
            let (mut fits, parts) = rayon::join(|| fits(&data, choice), parts);
            let held_out = held_out(parts, &fits);
            let chosen = choice_of(&data, &fits, &held_out);
            whole(&data, &mut fits, chosen);
            let refined = refined(&fits, chosen);
            let biases = biases(&refined);
            Candidates { data, fits, held_out, chosen, refined, biases, hold: None }
        }
        // what is held out chooses nothing
        ModelChoice::Terms { .. } => {
            let mut fits = fits(&data, choice);
            whole(&data, &mut fits, 0);
            let (refined, held_out) = rayon::join(|| refined(&fits, 0), || held_out(parts(), &fits));
            let biases = biases(&refined);
            Candidates { data, fits, held_out, chosen: 0, refined, biases, hold: None }
        }
    }
}

/// All that is known of the parameters of one of the fits.
fn whole(data: &Ordinates, fits: &mut [(Fit, Vec<Precision>)], chosen: usize) {
    if let Some((fit, known)) = fits.get_mut(chosen) {
        // once more within the bounds around where its lines have come to
        let again = fit.form.has(Kind::Oscillation).then(|| whittle::climb_all(data, &fit.form, &fit.logs)).flatten();
        if let Some(again) = again.filter(|again| again.log_likelihood > fit.log_likelihood + whittle::WELL) {
            *fit = again;
            *known = drift_precisions(data, fit);
        }
        *known = completed(data, fit, known);
    }
}

/// Fits of the models that come into question, best score first, with what is known of their drift.
fn fits(data: &Ordinates, choice: &ModelChoice) -> Vec<(Fit, Vec<Precision>)> {
    let known = |fit: Fit| {
        let known = drift_precisions(data, &fit);
        (fit, known)
    };
    match choice {
        ModelChoice::Auto => {
            let visited = growth::grow(data);
            let ranked: Vec<&Fit> = visited.ranked(data).into_iter().take(LOOKED_AT).collect();
            let mut fits: Vec<(Fit, Vec<Precision>)> = ranked.into_par_iter().map(|fit| known(fit.clone())).collect();
            if fits.iter().all(|(fit, known)| !told(data, fit, known)) {
                fits.extend(fits.first().and_then(|best| reduced(data, best)));
            }
            fits
        }
        ModelChoice::Terms { kinds, average, order } => {
            let forms = forms(kinds, *average, *order);
            let mut fits: Vec<Fit> = forms.par_iter().filter_map(|form| growth::fit(data, form)).collect();
            let by_score = |a: &Fit, b: &Fit| score(a, data).total_cmp(&score(b, data));
            fits.sort_by(by_score);
            fits.iter_mut().take(LOOKED_AT).for_each(|fit| *fit = growth::replaced(data, fit.clone()));
            fits.sort_by(by_score);
            fits.into_par_iter().map(known).collect()
        }
    }
}

/// A model at its best parameters, drift that is not identified included.
#[derive(Clone, Debug)]
pub struct Fitted {
    fit: Fit,
    known: Vec<Precision>,
    /// Of the log that was fitted.
    lines: Vec<Line>,
}

/// From the maximum on the cosine coefficients to that of the exact likelihood of all logs, where there are any and
/// it can be had; searched from `start`.
fn refine(
    data: &Ordinates,
    on_cosines: &Fit,
    known: &[Precision],
    start: &Fit,
    logs: &[Vec<Stretch<'_>>],
) -> (Fitted, Option<Refined>) {
    let bounds = start.bounds(data);
    let exact = Exact::new(data, &start.form, &start.logs, logs).filter(|_| !logs.is_empty());
    let refined = exact.and_then(|exact| exact.refine(&start.logs, &bounds));
    // a steady tone is no oscillation of any width that is searched: there the two likelihoods differ by more than
    // either knows
    let apart = |refined: &Refined| {
        let outside = |(to, old): (&f64, &Precision)| {
            old.lower.is_some_and(|low| *to < low) || old.upper.is_some_and(|high| *to > high)
        };
        refined.information.is_none() && refined.logs.iter().zip(known).any(outside)
    };
    let refined = refined.filter(|refined| !apart(refined));
    let lines = data.lines.clone();
    let fitted = match &refined {
        Some(refined) => Fitted {
            fit: Fit { logs: refined.logs.clone(), ..on_cosines.clone() },
            known: moved(on_cosines, known, refined, data, logs),
            lines,
        },
        None => Fitted { fit: on_cosines.clone(), known: known.to_vec(), lines },
    };
    (fitted, refined)
}

/// What is known of each logarithm at the maximum of the exact likelihood: intervals of what is known well move
/// along, and shrink where there was more to be seen.
fn moved(
    before: &Fit,
    known: &[Precision],
    refined: &Refined,
    data: &Ordinates,
    logs: &[Vec<Stretch<'_>>],
) -> Vec<Precision> {
    let samples: usize = logs.iter().flatten().map(|part| part.samples.len()).sum();
    let more = samples as f64 * data.dt / data.total_s();
    let ended = interval::ended(before, &before.bounds(data));
    let inside: Vec<usize> = (0..ended.len()).filter(|i| !ended[*i]).collect();
    let sigmas = refined.information.as_ref().map(|all| interval::deviations_of(all, &inside));
    let endless = interval::endless(&before.form, known);
    let of = |(i, old): (usize, &Precision)| {
        let (from, to) = (before.logs[i], refined.logs[i]);
        let sigma = sigmas.as_ref().map_or(old.sigma, |all| all[i]);
        let parabola = old.sigma < PARABOLA;
        let shrunk = if old.sigma.is_finite() { (sigma / old.sigma).min(1.0) } else { 1.0 };
        let limit = |old: Option<f64>, side: f64| match old {
            // of another level where the correlation time has no end
            _ if sigmas.is_some() && sigma < PARABOLA && !endless.contains(&i) => Some(to + side * NORMAL_95 * sigma),
            old if parabola => old.map(|old| to + (old - from) * shrunk),
            // where the likelihood is flat its maximum moves far, its limits do not; one that it has passed is none
            old => old.filter(|old| side * (old - to) > 0.0),
        };
        // a limit on the wrong side is none
        let lower = limit(old.lower, -1.0).filter(|lower| *lower <= to);
        let upper = limit(old.upper, 1.0).filter(|upper| *upper >= to);
        let told = old.told || (lower.is_some() && upper.is_some());
        Precision { sigma, bound: old.bound / more.sqrt(), lower, upper, told }
    };
    interval::keep_open(&before.form, known.iter().enumerate().map(of).collect())
}

/// The forms that a list of kinds may mean: the length of a moving average, and the order of a band limit, may be
/// open. A band limit brings its own white noise.
fn forms(kinds: &[Kind], average: Option<u32>, order: Option<u8>) -> Vec<Form> {
    let limited = kinds.contains(&Kind::BandLimit);
    let with = |samples: u32, order: u8| {
        let piece = |kind: &Kind| match kind {
            Kind::White => Piece::White,
            Kind::MovingAverage => Piece::MovingAverage(samples),
            Kind::BandLimit => Piece::BandLimit(order),
            Kind::Quantization => Piece::Quantization,
            Kind::Oscillation => Piece::Oscillation,
            Kind::BiasInstability => Piece::Flicker,
            Kind::GaussMarkov => Piece::GaussMarkov,
            Kind::RateRandomWalk => Piece::RandomWalk,
            Kind::RateRamp => Piece::Ramp,
        };
        Form::new(kinds.iter().filter(|kind| !(limited && **kind == Kind::White)).map(piece).collect())
    };
    let averages = average.map_or(2..=LONGEST_AVERAGE, |samples| samples..=samples);
    let orders = order.map_or(1..=MOST_POLES, |order| order..=order);
    let mut all: Vec<Form> =
        averages.flat_map(|samples| orders.clone().map(move |order| with(samples, order))).collect();
    all.sort();
    all.dedup();
    all
}

/// Numbers of the drift parameters that the log does not tell. What is faster is judged by the filter's innovations,
/// not by its numbers: also a Gauss-Markov process that surely forgets within [`FAST`] samples.
fn unknown(data: &Ordinates, fit: &Fit, known: &[Precision]) -> Vec<usize> {
    let roles = fit.form.roles();
    let fast = |i: usize| {
        let time = roles.iter().position(|role| *role == (roles[i].0, Role::CorrelationTime));
        time.and_then(|time| known[time].upper).is_some_and(|upper| upper.exp() < FAST * data.dt)
    };
    let drift = |i: &usize| fit.form.pieces()[roles[*i].0].kind().is_drift() && !fast(*i);
    (0..known.len()).filter(|i| !known[*i].told).filter(drift).collect()
}

/// The log tells every drift parameter; the interval of a slope does not hold zero.
fn told(data: &Ordinates, fit: &Fit, known: &[Precision]) -> bool {
    let sloped = || fit.slope.abs() > NORMAL_95 * whittle::slope_sigma(data, &fit.form, &fit.logs);
    unknown(data, fit, known).is_empty() && (!fit.form.has(Kind::RateRamp) || sloped())
}

/// The best fit without the drift processes that its log does not tell, their parameters found anew.
fn reduced(data: &Ordinates, best: &(Fit, Vec<Precision>)) -> Option<(Fit, Vec<Precision>)> {
    let mut found = best.clone();
    while let Some(last) = unknown(data, &found.0, &found.1).pop() {
        let (form, logs) = found.0.form.without(&found.0.logs, found.0.form.roles()[last].0);
        let fit = whittle::climb_all(data, &form, &logs)?;
        let known = drift_precisions(data, &fit);
        found = (fit, known);
    }
    Some(found)
}

/// A process with what is known of its parameters.
struct Found {
    term: Term,
    /// 95 %, SI; an open side is 0 or infinite.
    intervals: Vec<Option<[f64; 2]>>,
    /// Relative standard deviation and its bound.
    precision: Vec<[f64; 2]>,
}

/// The terms but for drift that is not identified.
fn known_terms(data: &Ordinates, fit: &Fit, known: &[Precision]) -> Vec<Found> {
    let unknown = unknown(data, fit, known);
    let bounds = fit.bounds(data);
    // the shortest that is searched is no estimate
    // nor is what was given
    let interval =
        |i: usize| known[i].interval().filter(|_| !interval::shortest(fit, &bounds, i) && !fit.held.contains(&i));
    let mut first = 0;
    let mut found = Vec::new();
    for (piece, own) in fit.form.split(&fit.logs) {
        let indices = first..first + own.len();
        first = indices.end;
        let of = &known[indices.clone()];
        let mut values: Vec<f64> = own.iter().map(|v| v.exp()).collect();
        // a filter needs some measurement noise: where the log sets only an upper limit, half of that
        if let (Piece::White, [Precision { lower: None, upper: Some(upper), .. }]) = (piece, of) {
            values[0] = values[0].max(0.5 * upper.exp());
        }
        match piece.term(&values) {
            Some(term) if !indices.clone().any(|i| unknown.contains(&i)) => {
                let floor = piece.floor(&values).into_iter();
                found.extend(floor.map(|term| Found { term, intervals: vec![], precision: vec![[f64::INFINITY; 2]] }));
                found.push(Found {
                    term,
                    intervals: indices.clone().map(|i| interval(i).map(|limits| limits.map(f64::exp))).collect(),
                    precision: of.iter().map(|p| [p.sigma, p.bound]).collect(),
                })
            }
            Some(_) => {}
            None => {
                let sigma = whittle::slope_sigma(data, &fit.form, &fit.logs);
                let relative = (sigma / fit.slope).abs();
                found.push(Found {
                    term: Term::RateRamp { slope: fit.slope },
                    intervals: vec![Some([fit.slope - NORMAL_95 * sigma, fit.slope + NORMAL_95 * sigma])],
                    precision: vec![[relative; 2]],
                });
            }
        }
    }
    let order = |term: &Term| match *term {
        Term::GaussMarkov { correlation_time, .. } => correlation_time,
        Term::Oscillation { frequency_hz, .. } => frequency_hz,
        _ => 0.0,
    };
    found.sort_by(|a, b| a.term.kind().cmp(&b.term.kind()).then(order(&a.term).total_cmp(&order(&b.term))));
    found
}

/// Names as in params.json.
fn known_precision(terms: &[Found]) -> Vec<Known> {
    let mut all = Vec::new();
    for (i, found) in terms.iter().enumerate() {
        let kind = found.term.kind();
        let number = terms[..i].iter().filter(|other| other.term.kind() == kind).count();
        let names = kind.roles().iter().map(|role| parameter_name(kind, number, *role));
        all.extend(names.zip(&found.precision).map(|(parameter, [sigma, bound])| Known {
            parameter,
            std_dev_percent: 100.0 * sigma,
            cramer_rao_percent: 100.0 * bound,
        }));
    }
    all
}

/// How the cumulative spectrum of the log, divided by that of the model, departs from a straight line.
fn goodness(data: &Ordinates, fit: &Fit) -> Departure {
    let of = |(bin, s): (&ordinates::Bin, &f64)| (bin.count, bin.left(fit.slope) / s);
    departure(&data.bins.iter().zip(&fit.spectrum(data)).map(of).collect::<Vec<_>>())
}

/// The best score among models whose parameters are known, those of several vague processes only where no simpler
/// one is there; a model that is close in score takes its place when it foretells the last third of the log clearly
/// better.
fn choice_of(data: &Ordinates, fits: &[(Fit, Vec<Precision>)], held_out: &[Option<f64>]) -> usize {
    let told = |i: &usize| told(data, &fits[*i].0, &fits[*i].1);
    let Some(best) = (0..fits.len()).find(told) else { return 0 };
    let clear = |i: &usize| told(i) && !interval::vague(data, &fits[*i].0, &fits[*i].1);
    let simpler = |i: &usize| fits[*i].0.form.parameters() < fits[best].0.form.parameters();
    let choose_clear = clear(&best) || (0..fits.len()).filter(simpler).any(|i| clear(&i));
    let identified = |i: &usize| if choose_clear { clear(i) } else { told(i) };
    let Some(first) = (0..fits.len()).find(identified) else { return best };
    let foretold = |i: usize| held_out.get(i).copied().flatten();
    let Some(known) = foretold(first) else { return first };
    (first..fits.len())
        .filter(identified)
        .filter(|i| score(&fits[*i].0, data) - score(&fits[first].0, data) < CLOSE)
        .filter_map(|i| Some((i, foretold(i)?)))
        .filter(|(i, value)| *i == first || value - known > CLEARLY)
        .max_by(|a, b| a.1.total_cmp(&b.1))
        .map_or(first, |(i, _)| i)
}

/// The first two thirds of each log, and the last.
fn thirds(rates: &[&[f64]], dt: f64, lines: &[Line]) -> Option<[Ordinates; 2]> {
    let of = |late: bool| {
        let part = |rate: &&[f64]| {
            let (early, after) = rate.split_at((rate.len() as f64 * FITTED_SHARE) as usize);
            Ordinates::new(if late { after } else { early }, dt, Some(lines))
        };
        Ordinates::pooled(&rates.iter().map(part).collect::<Vec<_>>())
    };
    Some([of(false)?, of(true)?])
}

/// ln L of the last third of the log under the parameters that the first two thirds give, by candidate.
fn held_out([early, late]: &[Ordinates; 2], fits: &[(Fit, Vec<Precision>)]) -> Vec<Option<f64>> {
    let of = |(fit, _): &(Fit, Vec<Precision>)| {
        let seen = whittle::climb_all(early, &fit.form, &fit.logs)?;
        Some(whittle::log_likelihood(late, &fit.form, &seen.logs))
    };
    fits.par_iter().take(HELD_OUT).map(of).collect()
}
