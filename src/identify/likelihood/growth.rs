//! Which processes the log asks for: the model grows from white noise, one process at a time, and is then pruned and
//! rearranged.
//!
//! Score = −2 ln L + a cost for every process; the lowest wins. The cost of a process is the gain 2 Δln L that noise
//! alone reaches with a probability of about half a percent: for one coefficient that may be zero ½χ²₀ + ½χ²₁ (Self
//! & Liang 1987); more where the log has been searched for a correlation time or a frequency (Davies 1977), which is
//! calibrated by simulation (docs/validation.md).

use std::collections::{BTreeMap, BTreeSet};
use std::ops::{Range, RangeInclusive};

use nalgebra::Complex;
use rayon::prelude::*;

use super::form::{Form, Piece};
use super::ordinates::Ordinates;
use super::whittle::{self, Fit, WIDE_LINE};
use crate::noise::{Filter, Kind, Term};

/// Processes of one kind at most.
const MOST_GAUSS_MARKOV: usize = 3;
const MOST_OSCILLATIONS: usize = 8;
/// Moving averages of up to so many samples are all tried …
const EACH_AVERAGE: u32 = 16;
/// … and of up to so many the [`CARRIED`] that explain most of what is left, since each sample more is a state of
/// the filter; longest that is tried.
pub(in crate::identify) const LONGEST_AVERAGE: u32 = 64;
/// What is near an average of more than [`EACH_AVERAGE`] samples differs from it by at most so many.
const NEAR_AVERAGE: u32 = 2;
/// Most poles, and zeros, of a band limit that are tried.
pub(in crate::identify) const MOST_POLES: u8 = 6;
/// And at first; more by one at a time.
const FIRST_ORDERS: u8 = 4;
/// A band limit that remembers longer than so many samples is drift, or a line.
const LONGEST_MEMORY: f64 = 100.0;
/// Peak of a band limit over its density at low frequencies, in power: resonances, and noise that rises as
/// differences do; more, and nothing is known of that density.
const LARGEST_GAIN: f64 = 1e4;
/// Ratio of the correlation times from which a new Gauss-Markov process starts.
const TIME_RATIO: f64 = 4.0;
/// Starts that are carried to their maximum.
const CARRIED: usize = 3;
/// Models that are searched as a whole in each round; twice as many when their scores are within [`NEAR`].
const POLISHED: usize = 3;
const NEAR: f64 = 12.0;
/// Rounds of growing and rearranging.
const ROUNDS: usize = 24;

/// Every form that was fitted.
#[derive(Clone, Debug, Default)]
pub(super) struct Visited {
    fits: BTreeMap<Form, Fit>,
}

/// Gain in 2 ln L that a process must bring.
fn cost(piece: Piece, data: &Ordinates) -> f64 {
    match piece {
        Piece::White => 0.0,
        // longer ones are many more tries
        Piece::MovingAverage(samples) => {
            if samples > 4 {
                12.0
            } else {
                9.0
            }
        }
        Piece::Filtered(_) => 9.0,
        // two coefficients for every pole, searched over everything that they can be
        Piece::BandLimit(order) => 12.0 + 12.0 * f64::from(order),
        // at one cost, so that likelihood alone decides between a Gauss-Markov process and a chain of them under one
        // coefficient
        Piece::Flicker | Piece::GaussMarkov => 10.0,
        Piece::Quantization | Piece::RandomWalk => 7.0,
        // beside drift of unknown size noise alone gains more: at 8, 1.7 % of random walks had one
        Piece::Ramp => 10.0,
        // looked for at every frequency
        Piece::Oscillation => 9.0 + 2.0 * (data.samples as f64).ln(),
    }
}

pub(super) fn score(fit: &Fit, data: &Ordinates) -> f64 {
    -2.0 * fit.log_likelihood + fit.form.pieces().iter().map(|piece| cost(*piece, data)).sum::<f64>()
}

impl Visited {
    fn keep(&mut self, fit: Fit) {
        match self.fits.get(&fit.form) {
            Some(known) if known.log_likelihood >= fit.log_likelihood => {}
            _ => {
                self.fits.insert(fit.form.clone(), fit);
            }
        }
    }

    /// Best score first.
    pub(super) fn ranked(&self, data: &Ordinates) -> Vec<&Fit> {
        let mut all: Vec<&Fit> = self.fits.values().collect();
        all.sort_by(|a, b| score(a, data).total_cmp(&score(b, data)).then_with(|| a.form.cmp(&b.form)));
        all
    }
}

/// A form with its logarithms, and the shape of a band limit with its order.
type Bare = (Form, Vec<f64>);
type OfOrder = (u8, Vec<f64>);

/// A form with logarithms to climb from, and which of them are new.
type Start = (Form, Vec<f64>, Range<usize>);

/// Grows a model on `data`: without a band limit first, which would take the power of lines for a resonance of its
/// own; then with one in place of what stands for it there, and with one from the beginning.
pub(super) fn grow(data: &Ordinates) -> Visited {
    let mut visited = Visited::default();
    let white = Form::new(vec![Piece::White]);
    let Some(white) = whittle::climb_all(data, &white, &[whittle::level(data)]) else { return visited };
    visited.keep(white.clone());
    let best = grown(data, &mut visited, white.clone(), 0);
    let limited = band_limits(data, &best, 1..=FIRST_ORDERS);
    let limited = best_of(data, &mut visited, limited);
    if best.form.split(&best.logs).any(|(piece, own)| stands_for_a_limit(data, piece, own)) {
        // it may have to grow before it is better; what has taken its place may have taken that of drift too
        let beside =
            beside_drift(data, &white).iter().flat_map(|base| band_limits(data, base, 1..=FIRST_ORDERS)).collect();
        let beside = best_of(data, &mut visited, beside);
        for start in limited.into_iter().chain(beside).chain([white]) {
            grown(data, &mut visited, start, FIRST_ORDERS);
        }
    } else if let Some(limited) = limited.filter(|limited| score(limited, data) < score(&best, data)) {
        grown(data, &mut visited, limited, FIRST_ORDERS);
    }
    // lines may have come where the shape of the band limit was not right yet
    let best = visited.ranked(data)[0].clone();
    if let Some(bare) = without_lines(data, &best) {
        visited.keep(bare.clone());
        if score(&bare, data) < score(&best, data) {
            grown(data, &mut visited, bare, FIRST_ORDERS);
        }
    }
    visited
}

/// The best of the same drift beside a band limit of this order, or one more or less, and no lines, each from many
/// starts; `None` where there are no lines beside a band limit.
fn without_lines(data: &Ordinates, fit: &Fit) -> Option<Fit> {
    let pieces = fit.form.pieces();
    let of = |piece: &Piece| if let Piece::BandLimit(order) = piece { Some(*order) } else { None };
    let order = pieces.iter().find_map(of).filter(|_| fit.form.has(Kind::Oscillation))?;
    let drift = pieces.iter().filter(|piece| !matches!(piece.kind(), Kind::BandLimit | Kind::Oscillation));
    let with = |order: u8| Form::new(drift.clone().copied().chain([Piece::BandLimit(order)]).collect());
    let forms: Vec<Form> = (order.saturating_sub(1).max(1)..=(order + 1).min(MOST_POLES)).map(with).collect();
    let found: Vec<Fit> = forms.par_iter().filter_map(|form| self::fit(data, form)).collect();
    found.into_iter().min_by(|a, b| score(a, data).total_cmp(&score(b, data)))
}

/// By rounds of additions and rearrangements, until none is better; `orders`: of a band limit that may be added.
fn grown(data: &Ordinates, visited: &mut Visited, mut best: Fit, orders: u8) -> Fit {
    for _ in 0..ROUNDS {
        let mut moves = additions(data, &best);
        if !best.form.has(Kind::BandLimit) {
            moves.extend(band_limits(data, &best, 1..=orders));
        }
        let grown = better(data, visited, &best, moves);
        moves = rearrangements(data, grown.as_ref().unwrap_or(&best));
        let rearranged = better(data, visited, grown.as_ref().unwrap_or(&best), moves);
        match rearranged.or(grown) {
            Some(next) => best = next,
            None => break,
        }
    }
    best
}

/// The maximum of one given form: each round adds that piece of it which gives the best score, from many starts.
pub(super) fn fit(data: &Ordinates, form: &Form) -> Option<Fit> {
    let mut partial = whittle::climb_all(data, &Form::new(vec![Piece::White]), &[whittle::level(data)])?;
    let mut rest: Vec<Piece> = form.pieces().iter().copied().filter(|piece| *piece != Piece::White).collect();
    if let Some(Piece::BandLimit(order)) = rest.iter().find(|piece| piece.kind() == Kind::BandLimit).copied() {
        let bases = beside_drift(data, &partial).into_iter().chain([partial.clone()]);
        let starts: Vec<Start> = bases.flat_map(|base| band_limits(data, &base, order..=order)).collect();
        let found: Vec<Fit> =
            starts.par_iter().filter_map(|(form, logs, _)| whittle::climb_all(data, form, logs)).collect();
        let best = found.into_iter().filter(limits).max_by(|a, b| a.log_likelihood.total_cmp(&b.log_likelihood))?;
        let at = best.form.pieces().iter().position(|piece| piece.kind() == Kind::BandLimit)?;
        let others: Vec<usize> = (0..best.form.pieces().len()).rev().filter(|i| *i != at).collect();
        let (form, logs) = others.iter().fold((best.form.clone(), best.logs.clone()), |(f, l), i| f.without(&l, *i));
        partial = Fit { form, logs, ..best };
        rest.retain(|piece| piece.kind() != Kind::BandLimit);
    }
    while !rest.is_empty() {
        // wideband pieces first: what is left is drift and lines
        let wideband =
            |piece: &Piece| matches!(piece, Piece::MovingAverage(_) | Piece::BandLimit(_) | Piece::Quantization);
        let first = rest.iter().any(wideband);
        let next: BTreeSet<Piece> = rest.iter().copied().filter(|piece| wideband(piece) == first).collect();
        let found = next.into_iter().filter_map(|piece| Some((piece, placed(data, &partial, piece)?)));
        let (piece, best) = found.min_by(|(_, a), (_, b)| score(a, data).total_cmp(&score(b, data)))?;
        rest.remove(rest.iter().position(|other| *other == piece)?);
        partial = best;
    }
    Some(partial)
}

/// The best of `base` with one piece more.
fn placed(data: &Ordinates, base: &Fit, piece: Piece) -> Option<Fit> {
    let starts = starts(data, base, piece);
    // a shape of many coefficients leads astray when what is new is far from its place
    let limited = base.form.has(Kind::BandLimit);
    let found = starts.par_iter().filter_map(|(form, logs, fresh)| {
        let fresh: Vec<usize> = if limited { fresh.clone().collect() } else { vec![] };
        let logs = if limited { whittle::climb(data, form, logs, &fresh)?.logs } else { logs.clone() };
        whittle::climb_all(data, form, &logs).filter(limits)
    });
    found.max_by(|a, b| a.log_likelihood.total_cmp(&b.log_likelihood))
}

/// The maximum when each piece that may stand in the place of another has been taken out and placed anew, until no
/// place is better: drift looks like a line of low frequency, and a line like a Gauss-Markov process.
pub(super) fn replaced(data: &Ordinates, mut fit: Fit) -> Fit {
    let moves = |piece: &Piece| !matches!(piece, Piece::White | Piece::BandLimit(_) | Piece::Ramp);
    if fit.form.pieces().iter().filter(|piece| moves(piece)).count() < 2 {
        return fit;
    }
    for _ in 0..ROUNDS {
        let again = |at: usize| {
            let (form, logs) = fit.form.without(&fit.logs, at);
            placed(data, &whittle::climb_all(data, &form, &logs)?, fit.form.pieces()[at])
        };
        let places = (0..fit.form.pieces().len()).filter(|at| moves(&fit.form.pieces()[*at]));
        let best = places.filter_map(again).max_by(|a, b| a.log_likelihood.total_cmp(&b.log_likelihood));
        match best.filter(|best| best.log_likelihood > fit.log_likelihood + 1e-6) {
            Some(best) => fit = best,
            None => break,
        }
    }
    fit
}

/// White noise beside some drift, which the shape of a band limit is not to follow.
fn beside_drift(data: &Ordinates, white: &Fit) -> Vec<Fit> {
    let drift = [Piece::Flicker, Piece::RandomWalk].into_iter().flat_map(|piece| starts(data, white, piece));
    drift.filter_map(|(form, logs, _)| whittle::climb_all(data, &form, &logs)).collect()
}

/// The best of the fits from `moves`, if its score is lower than that of `best`.
fn better(data: &Ordinates, visited: &mut Visited, best: &Fit, moves: Vec<Start>) -> Option<Fit> {
    best_of(data, visited, moves).filter(|fit| score(fit, data) < score(best, data) - 1e-6)
}

/// The best of the fits from `moves`.
///
/// First only what is new and the white noise are searched; what then looks best is searched as a whole.
fn best_of(data: &Ordinates, visited: &mut Visited, moves: Vec<Start>) -> Option<Fit> {
    let rough = |(form, logs, fresh): &Start| {
        let white = form.roles().iter().position(|(piece, _)| form.pieces()[*piece] == Piece::White);
        let free: Vec<usize> = white.into_iter().filter(|i| !fresh.contains(i)).chain(fresh.clone()).collect();
        whittle::climb(data, form, logs, &free)
    };
    let mut found: Vec<Fit> = moves.par_iter().filter_map(rough).filter(limits).collect();
    found.sort_by(|a, b| score(a, data).total_cmp(&score(b, data)).then_with(|| a.form.cmp(&b.form)));
    found.dedup_by(|b, a| a.form == b.form && (a.log_likelihood - b.log_likelihood).abs() < 1e-3);
    let near = found.first().map_or(0.0, |fit| score(fit, data)) + NEAR;
    let place = found.iter().take_while(|fit| score(fit, data) < near).count().max(POLISHED);
    found.truncate(place.min(2 * POLISHED));
    let whole = |fit: &Fit| whittle::climb_all(data, &fit.form, &fit.logs);
    let found: Vec<Fit> = found.par_iter().filter_map(whole).filter(limits).collect();
    let chosen = found.iter().min_by(|a, b| score(a, data).total_cmp(&score(b, data))).cloned();
    for fit in found {
        visited.keep(fit);
    }
    chosen
}

/// One process more.
fn additions(data: &Ordinates, base: &Fit) -> Vec<Start> {
    let form = &base.form;
    let mut pieces = Vec::new();
    // a band limit has both in itself
    let limited = form.has(Kind::BandLimit);
    if !form.has(Kind::Quantization) && !limited {
        pieces.push(Piece::Quantization);
    }
    if !form.has(Kind::MovingAverage) && !limited {
        pieces.extend((2..=EACH_AVERAGE).map(Piece::MovingAverage));
        pieces.extend(long_averages(data, base));
    }
    for (piece, most) in [
        (Piece::Flicker, 1),
        (Piece::RandomWalk, 1),
        (Piece::Ramp, 1),
        (Piece::GaussMarkov, MOST_GAUSS_MARKOV),
        (Piece::Oscillation, MOST_OSCILLATIONS),
    ] {
        if form.count(piece.kind()) < most {
            pieces.push(piece);
        }
    }
    pieces.into_iter().flat_map(|piece| starts(data, base, piece)).collect()
}

/// Averages of more than [`EACH_AVERAGE`] samples that explain most of what `base` leaves.
fn long_averages(data: &Ordinates, base: &Fit) -> Vec<Piece> {
    let residual = Residual::new(data, base);
    let of = |samples: u32| {
        let piece = Piece::MovingAverage(samples);
        Some((residual.gain(&piece.term(&[1.0])?).0, piece))
    };
    let mut found: Vec<(f64, Piece)> = (EACH_AVERAGE + 1..=LONGEST_AVERAGE).filter_map(of).collect();
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    found.iter().take(CARRIED).filter(|(gain, _)| *gain > 0.0).map(|(_, piece)| *piece).collect()
}

/// Not more than a band limit is: it is forgotten soon, so that it takes no drift, and its density is that of the
/// noise, no part of it that is hidden below something else; true of all without a band limit.
fn limits(fit: &Fit) -> bool {
    fit.form.terms(&fit.logs).all(|term| match term {
        Term::BandLimit { filter, .. } => filter.memory() <= LONGEST_MEMORY && filter.peak_gain() <= LARGEST_GAIN,
        _ => true,
    })
}

/// Wideband noise that is not white; `own`: its logarithms.
fn stands_for_a_limit(data: &Ordinates, piece: Piece, own: &[f64]) -> bool {
    let short = |time: f64| time.exp() < WIDE_LINE * data.dt;
    match piece {
        Piece::MovingAverage(_) | Piece::Quantization | Piece::BandLimit(_) | Piece::Filtered(_) => true,
        Piece::Oscillation => short(own[2]),
        Piece::GaussMarkov => short(own[1]),
        Piece::White | Piece::Flicker | Piece::RandomWalk | Piece::Ramp => false,
    }
}

/// A band limit in place of the wideband noise of `base`; also of its wide lines, which may have stood for it.
fn band_limits(data: &Ordinates, base: &Fit, orders: RangeInclusive<u8>) -> Vec<Start> {
    let wideband = |piece: Piece, own: &[f64], lines: bool| match piece {
        Piece::White => true,
        Piece::Oscillation | Piece::GaussMarkov => lines && stands_for_a_limit(data, piece, own),
        _ => stands_for_a_limit(data, piece, own),
    };
    let without = |lines: bool| {
        let of = |(form, logs): (Form, Vec<f64>), at: usize| {
            let known = form.split(&logs).nth(at).is_some_and(|(piece, own)| wideband(piece, own, lines));
            if known { form.without(&logs, at) } else { (form, logs) }
        };
        (0..base.form.pieces().len()).rev().fold((base.form.clone(), base.logs.clone()), of)
    };
    let mut bare = vec![without(false), without(true)];
    bare.dedup();
    let level = whittle::level(data);
    let shapes: Vec<(u8, Vec<f64>)> =
        orders.clone().flat_map(|order| shapes(order).into_iter().map(move |own| (order, own))).collect();
    let tried = bare.iter().flat_map(|bare| shapes.iter().map(move |shape| (bare, shape)));
    let of = |((form, logs), (order, shape)): (&Bare, &OfOrder)| {
        let own: Vec<f64> = std::iter::once(level).chain(shape.iter().copied()).collect();
        let (form, logs, fresh) = form.with(logs, Piece::BandLimit(*order), &own);
        let fit = whittle::climb(data, &form, &logs, &[fresh.start])?;
        Some((fit.log_likelihood, *order, (form, fit.logs, fresh)))
    };
    let tried: Vec<_> = tried.collect();
    let mut found: Vec<(f64, u8, Start)> = tried.into_par_iter().filter_map(of).collect();
    found.sort_by(|a, b| a.1.cmp(&b.1).then(b.0.total_cmp(&a.0)));
    // the best of each order, and one that is nearly white
    let best =
        found.chunk_by(|a, b| a.1 == b.1).filter_map(|of_order| of_order.first()).map(|(_, _, start)| start.clone());
    let nearly_white = bare.iter().flat_map(|(form, logs)| {
        orders.clone().map(move |order| {
            let own: Vec<f64> =
                std::iter::once(level).chain((0..order).map(|_| 0.3)).chain((0..order).map(|_| -0.3)).collect();
            form.with(logs, Piece::BandLimit(order), &own)
        })
    });
    best.chain(nearly_white).collect()
}

/// Logarithms of the area ratios of low-passes of this order from a hundredth of the sample rate up: Butterworth's
/// by the bilinear transform, with their zeros within the unit circle.
fn shapes(order: u8) -> Vec<Vec<f64>> {
    let corners = [0.01, 0.02, 0.04, 0.07, 0.12, 0.18, 0.25, 0.32, 0.4, 0.45];
    let of = |corner: f64| {
        let analog = 2.0 * (std::f64::consts::PI * corner).tan();
        let n = usize::from(order);
        let pole = |k: usize| {
            let angle = std::f64::consts::PI * (2 * k + n + 1) as f64 / (2 * n) as f64;
            let s = Complex::from_polar(analog, angle) * 0.5;
            let z = (s + 1.0) / (-s + 1.0);
            if 2 * k + 1 == n { Complex::from(z.re) } else { z }
        };
        let poles: Vec<Complex<f64>> = (0..n.div_ceil(2)).map(pole).collect();
        let filter = Filter::of_roots(&vec![Complex::from(-0.9); n], &poles)?;
        Some(filter.area_ratios()?.into_iter().map(f64::ln).collect())
    };
    corners.into_iter().filter_map(of).collect()
}

/// One process less, or another in its place.
fn rearrangements(data: &Ordinates, base: &Fit) -> Vec<Start> {
    let mut moves = Vec::new();
    for (at, piece) in base.form.pieces().iter().enumerate() {
        if *piece == Piece::White {
            continue;
        }
        let (form, logs) = base.form.without(&base.logs, at);
        let own = base.form.split(&base.logs).nth(at).map(|(_, own)| own.to_vec()).unwrap_or_default();
        if let Piece::BandLimit(order) = *piece {
            moves.extend(other_orders(&form, &logs, order, &own));
            let (form, logs, fresh) = form.with(&logs, Piece::White, &[whittle::level(data)]);
            moves.push((form, logs, fresh));
            continue;
        }
        moves.push((form.clone(), logs.clone(), 0..0));
        let others =
            if is_drift(*piece, &own) { stand_ins(Piece::GaussMarkov, &form) } else { stand_ins(*piece, &form) };
        if others.is_empty() {
            continue;
        }
        // without the piece, but for the white noise as it was: others must fill the same hole
        let less = Fit { form: form.clone(), logs: logs.clone(), ..base.clone() };
        for other in others {
            moves.extend(starts(data, &less, other));
        }
        if *piece == Piece::Flicker && form.count(Kind::GaussMarkov) + 2 <= MOST_GAUSS_MARKOV {
            for (form, logs, fresh) in starts(data, &less, Piece::GaussMarkov) {
                if let Some(one) = whittle::climb(data, &form, &logs, &fresh.collect::<Vec<_>>()) {
                    moves.extend(starts(data, &one, Piece::GaussMarkov));
                }
            }
        }
    }
    moves
}

/// A band limit with a pole and a zero more, at first near the origin, or one less; `form`: without it, `own`: its
/// logarithms.
fn other_orders(form: &Form, logs: &[f64], order: u8, own: &[f64]) -> Vec<Start> {
    let (a, b) = own[1..].split_at(usize::from(order));
    let with = |order: u8, a: Vec<f64>, b: Vec<f64>| {
        let own: Vec<f64> = own[..1].iter().copied().chain(a).chain(b).collect();
        form.with(logs, Piece::BandLimit(order), &own)
    };
    let mut moves = Vec::new();
    if order < MOST_POLES {
        for (pole, zero) in [(0.3, -0.3), (-0.3, 0.3), (0.3, 0.3)] {
            moves.push(with(order + 1, [a, &[pole]].concat(), [b, &[zero]].concat()));
        }
    }
    if order > 1 {
        moves.push(with(order - 1, a[..a.len() - 1].to_vec(), b[..b.len() - 1].to_vec()));
    }
    moves
}

/// A line that is forgotten within a period is none: it has come for the lobe of an average, say, and stayed for the
/// drift. `own`: its logarithms.
fn is_drift(piece: Piece, own: &[f64]) -> bool {
    piece == Piece::Oscillation && own[1] + own[2] < 0.0
}

/// What may stand in the place of `piece`; `form`: without it.
fn stand_ins(piece: Piece, form: &Form) -> Vec<Piece> {
    let mut others = match piece {
        Piece::Flicker | Piece::RandomWalk | Piece::Ramp => {
            vec![Piece::Flicker, Piece::RandomWalk, Piece::GaussMarkov, Piece::Ramp]
        }
        Piece::GaussMarkov => vec![Piece::Flicker, Piece::RandomWalk, Piece::Ramp, Piece::MovingAverage(2)],
        Piece::MovingAverage(samples) => {
            let near = samples.saturating_sub(NEAR_AVERAGE)..=(samples + NEAR_AVERAGE).min(LONGEST_AVERAGE);
            let long = near.filter(|samples| *samples > EACH_AVERAGE);
            (2..=EACH_AVERAGE).chain(long).map(Piece::MovingAverage).chain([Piece::GaussMarkov]).collect()
        }
        Piece::Oscillation | Piece::White | Piece::Quantization | Piece::BandLimit(_) | Piece::Filtered(_) => vec![],
    };
    let most = |other: &Piece| if *other == Piece::GaussMarkov { MOST_GAUSS_MARKOV } else { 1 };
    others.retain(|other| *other != piece && form.count(other.kind()) < most(other));
    others
}

/// `base` with `piece` added, at the values that look best.
fn starts(data: &Ordinates, base: &Fit, piece: Piece) -> Vec<Start> {
    let residual = Residual::new(data, base);
    let shapes: Vec<Vec<f64>> = match piece {
        Piece::Ramp => return vec![base.form.with(&base.logs, piece, &[])],
        Piece::Oscillation => residual.peaks().into_iter().map(|peak| peak.to_vec()).collect(),
        Piece::GaussMarkov => {
            let longest = 3.0 * data.span_s();
            std::iter::successors(Some(4.0 * data.dt), |time| Some(time * TIME_RATIO))
                .take_while(|time| *time < longest)
                .map(|time| vec![0.0, time.ln()])
                .collect()
        }
        _ => vec![vec![0.0]],
    };
    let mut found: Vec<(f64, Vec<f64>)> = shapes
        .into_iter()
        .filter_map(|shape| {
            let values: Vec<f64> = shape.iter().map(|v| v.exp()).collect();
            let term = piece.term(&values)?;
            let (gain, factor) = residual.gain(&term);
            let touch = whittle::touching(data, &term) - 1.0;
            let mut own = shape;
            own[0] += if factor > 0.0 { 0.5 * factor.ln() } else { touch };
            Some((gain, own))
        })
        .collect();
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    found.truncate(CARRIED);
    found.into_iter().map(|(_, own)| base.form.with(&base.logs, piece, &own)).collect()
}

/// What a model leaves unexplained.
struct Residual<'a> {
    data: &'a Ordinates,
    spectrum: Vec<f64>,
}

impl<'a> Residual<'a> {
    fn new(data: &'a Ordinates, fit: &Fit) -> Residual<'a> {
        Residual { data, spectrum: fit.spectrum(data) }
    }

    /// Power factor of `term` that fits the excess best, and how much of the excess it explains (weighted least
    /// squares).
    fn gain(&self, term: &Term) -> (f64, f64) {
        let (mut cross, mut own) = (0.0, 0.0);
        for ((bin, s), psd) in self.data.bins.iter().zip(&self.spectrum).zip(term.psd_on(&self.data.grid)) {
            let psd = psd / s;
            cross += psd * (bin.power / s - bin.count);
            own += psd * psd * bin.count;
        }
        if own > 0.0 && cross > 0.0 { (cross * cross / own, cross / own) } else { (0.0, 0.0) }
    }

    /// ln of standard deviation, frequency and correlation time of what stands out most.
    fn peaks(&self) -> Vec<[f64; 3]> {
        let bins = &self.data.bins;
        let mut found: Vec<(f64, [f64; 3])> = Vec::new();
        let mut size = 1;
        while size <= bins.len() / 8 {
            for (window, s) in bins.windows(size).zip(self.spectrum.windows(size)) {
                let count: f64 = window.iter().map(|bin| bin.count).sum();
                let excess: f64 = window.iter().zip(s).map(|(bin, s)| bin.power / s - bin.count).sum();
                let z = excess / (2.0 * count).sqrt();
                if z < 4.0 {
                    continue;
                }
                let power: f64 = window.iter().zip(s).map(|(bin, s)| bin.power - s * bin.count).sum();
                let variance = power / self.data.total_s();
                let middle = window.iter().map(|bin| bin.frequency_hz * bin.power).sum::<f64>()
                    / window.iter().map(|bin| bin.power).sum::<f64>();
                let width = count / (2.0 * self.data.total_s());
                let time = (1.0 / (std::f64::consts::PI * width)).min(self.data.span_s());
                found.push((z, [0.5 * variance.max(1e-300).ln(), middle.ln(), time.ln()]));
            }
            size *= 2;
        }
        found.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut kept: Vec<[f64; 3]> = Vec::new();
        for (_, peak) in found {
            let near = |other: &[f64; 3]| (other[1] - peak[1]).abs() < 0.02 && (other[2] - peak[2]).abs() < 1.0;
            if kept.len() < CARRIED && !kept.iter().any(near) {
                kept.push(peak);
            }
        }
        kept
    }
}
