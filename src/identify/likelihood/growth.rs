//! Which processes the log asks for: the model grows from white noise, one process at a time, and is then pruned and rearranged.
//!
//! Score = −2 ln L + a cost for every process; the lowest wins. The cost of a process is the gain 2 Δln L that noise alone reaches with a
//! probability of about half a percent: for one coefficient that may be zero ½χ²₀ + ½χ²₁ (Self & Liang 1987); more where the log has been searched for a
//! correlation time or a frequency (Davies 1977), which is calibrated by simulation (docs/validation.md).

use std::collections::BTreeMap;
use std::ops::Range;

use rayon::prelude::*;

use super::form::{Form, Piece};
use super::ordinates::Ordinates;
use super::whittle::{self, Fit};
use crate::noise::{Kind, Term};

/// Processes of one kind at most.
const MOST_GAUSS_MARKOV: usize = 3;
const MOST_OSCILLATIONS: usize = 8;
/// Longest moving average that is tried.
pub(in crate::identify) const LONGEST_AVERAGE: u32 = 4;
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
        Piece::MovingAverage(_) => 9.0,
        // at one cost, so that likelihood alone decides between a Gauss-Markov process and a chain of them under one coefficient
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

/// A form with logarithms to climb from, and which of them are new.
type Start = (Form, Vec<f64>, Range<usize>);

/// Grows a model on `data`.
pub(super) fn grow(data: &Ordinates) -> Visited {
    let mut visited = Visited::default();
    let white = Form::new(vec![Piece::White]);
    let Some(mut best) = whittle::climb_all(data, &white, &[whittle::level(data)]) else { return visited };
    visited.keep(best.clone());
    for _ in 0..ROUNDS {
        let mut moves = additions(data, &best);
        let grown = better(data, &mut visited, &best, moves);
        moves = rearrangements(data, grown.as_ref().unwrap_or(&best));
        let rearranged = better(data, &mut visited, grown.as_ref().unwrap_or(&best), moves);
        match rearranged.or(grown) {
            Some(next) => best = next,
            None => break,
        }
    }
    visited
}

/// The maximum of one given form, from many starts.
pub(super) fn fit(data: &Ordinates, form: &Form) -> Option<Fit> {
    let mut partial = whittle::climb_all(data, &Form::new(vec![Piece::White]), &[whittle::level(data)])?;
    let mut rest: Vec<Piece> = form.pieces().iter().copied().filter(|piece| *piece != Piece::White).collect();
    // wideband pieces first: what is left is drift
    rest.sort_by_key(|piece| std::cmp::Reverse(matches!(piece, Piece::MovingAverage(_) | Piece::Quantization)));
    for piece in rest {
        let starts = starts(data, &partial, piece);
        let found = starts.par_iter().filter_map(|(form, logs, _)| whittle::climb_all(data, form, logs));
        partial = found.max_by(|a, b| a.log_likelihood.total_cmp(&b.log_likelihood))?;
    }
    Some(partial)
}

/// The best of the fits from `moves`, if its score is lower than that of `best`.
///
/// First only what is new and the white noise are searched; what then looks best is searched as a whole.
fn better(data: &Ordinates, visited: &mut Visited, best: &Fit, moves: Vec<Start>) -> Option<Fit> {
    let rough = |(form, logs, fresh): &Start| {
        let white = form.roles().iter().position(|(piece, _)| form.pieces()[*piece] == Piece::White);
        let free: Vec<usize> = white.into_iter().filter(|i| !fresh.contains(i)).chain(fresh.clone()).collect();
        whittle::climb(data, form, logs, &free)
    };
    let mut found: Vec<Fit> = moves.par_iter().filter_map(rough).collect();
    found.sort_by(|a, b| score(a, data).total_cmp(&score(b, data)).then_with(|| a.form.cmp(&b.form)));
    found.dedup_by(|b, a| a.form == b.form && (a.log_likelihood - b.log_likelihood).abs() < 1e-3);
    let near = found.first().map_or(0.0, |fit| score(fit, data)) + NEAR;
    let place = found.iter().take_while(|fit| score(fit, data) < near).count().max(POLISHED);
    found.truncate(place.min(2 * POLISHED));
    let found: Vec<Fit> = found.par_iter().filter_map(|fit| whittle::climb_all(data, &fit.form, &fit.logs)).collect();
    let chosen = found.iter().min_by(|a, b| score(a, data).total_cmp(&score(b, data))).cloned();
    for fit in found {
        visited.keep(fit);
    }
    chosen.filter(|fit| score(fit, data) < score(best, data) - 1e-6)
}

/// One process more.
fn additions(data: &Ordinates, base: &Fit) -> Vec<Start> {
    let form = &base.form;
    let mut pieces = Vec::new();
    if !form.has(Kind::Quantization) {
        pieces.push(Piece::Quantization);
    }
    if !form.has(Kind::MovingAverage) {
        pieces.extend((2..=LONGEST_AVERAGE).map(Piece::MovingAverage));
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

/// One process less, or another in its place.
fn rearrangements(data: &Ordinates, base: &Fit) -> Vec<Start> {
    let mut moves = Vec::new();
    for (at, piece) in base.form.pieces().iter().enumerate() {
        if *piece == Piece::White {
            continue;
        }
        let (form, logs) = base.form.without(&base.logs, at);
        moves.push((form.clone(), logs.clone(), 0..0));
        let others = stand_ins(*piece, &form);
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

/// What may stand in the place of `piece`; `form`: without it.
fn stand_ins(piece: Piece, form: &Form) -> Vec<Piece> {
    let mut others = match piece {
        Piece::Flicker | Piece::RandomWalk | Piece::Ramp => {
            vec![Piece::Flicker, Piece::RandomWalk, Piece::GaussMarkov, Piece::Ramp]
        }
        Piece::GaussMarkov => vec![Piece::Flicker, Piece::RandomWalk, Piece::Ramp, Piece::MovingAverage(2)],
        Piece::MovingAverage(_) => {
            (2..=LONGEST_AVERAGE).map(Piece::MovingAverage).chain([Piece::GaussMarkov]).collect()
        }
        Piece::Oscillation | Piece::White | Piece::Quantization => vec![],
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

    /// Power factor of `term` that fits the excess best, and how much of the excess it explains (weighted least squares).
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
