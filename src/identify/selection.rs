//! Which terms the log asks for, and which averaging times it can be asked at.

use std::collections::BTreeMap;

use rayon::prelude::*;

use super::points::Points;
use super::shape::{Shape, in_allan_curve};
use super::weighted_fit::{Fit, fit};
use crate::noise::Kind;

/// The score of a model is its χ² plus this for every parameter and again for every process; the lowest score wins.
///
/// A random walk or flicker term on a white log must gain 8 (probability 0.0023 by chance), a Gauss-Markov term 12;
/// but to prefer Gauss-Markov to the random walk, its limit, it must gain 4 (0.023). Measured rates:
/// docs/validation.md.
pub(super) const PENALTY: f64 = 4.0;
/// A fit with a smaller p-value does not explain the curve.
pub(super) const FIT_LEVEL: f64 = 0.001;
/// And with one smaller than this, short averaging times are left out: with [`FIT_LEVEL`], one log in a thousand
/// would lose most of what it knows of the white noise.
const LEAVING_OUT_LEVEL: f64 = 1e-4;
/// Most Gauss-Markov processes that are looked for.
const MOST_GAUSS_MARKOV: usize = 2;
/// Short averaging times may be left out up to this many samples …
const LEFT_OUT_FACTOR: u64 = 100;
/// … as long as this range of times remains: ten points of five a decade, seven octaves.
const REMAINING_RANGE: u64 = 62;
/// Times below this many times the first at which the departure is no longer seen are left out too. Of
/// autocovariances γ_k that end, the Allan variance of m samples, (S − 3/(2m) Σ|k|γ_k)/m with S = Σγ_k, keeps a part
/// that fades as 1/m; where it is just not seen it is some standard deviations of N, at eight times m, where N is
/// known √8 times worse, 1/23 of that.
const MARGIN: u64 = 8;

/// All models that were fitted to the same points.
#[derive(Clone, Debug)]
pub(super) struct Table {
    pub(super) points: Points,
    fits: BTreeMap<Shape, Option<Fit>>,
}

pub(super) fn score(fit: &Fit) -> f64 {
    fit.chi_square + PENALTY * (fit.shape.parameters() + fit.shape.kinds().len()) as f64
}

impl Table {
    fn new(points: Points) -> Table {
        Table { points, fits: BTreeMap::new() }
    }
    /// Fit what was not fitted yet.
    fn add(&mut self, shapes: impl IntoIterator<Item = Shape>) {
        let mut new: Vec<Shape> = shapes.into_iter().filter(|s| !self.fits.contains_key(s)).collect();
        new.sort();
        new.dedup();
        let points = &self.points;
        let fits: Vec<Option<Fit>> = new.par_iter().map(|shape| fit(points, shape)).collect();
        self.fits.extend(new.into_iter().zip(fits));
    }
    pub(super) fn get(&self, shape: &Shape) -> Option<&Fit> {
        self.fits.get(shape).and_then(Option::as_ref)
    }
    /// Best score first; equal scores by the fixed order of shapes.
    pub(super) fn ranked(&self) -> Vec<&Fit> {
        let mut fits: Vec<&Fit> = self.fits.values().flatten().collect();
        fits.sort_by(|a, b| score(a).total_cmp(&score(b)));
        fits
    }
    pub(super) fn best(&self) -> Option<&Fit> {
        self.ranked().first().copied()
    }
    fn explains(&self) -> bool {
        self.best().is_some_and(|fit| fit.p_value() >= FIT_LEVEL)
    }
    fn misfit(&self) -> f64 {
        self.best().map_or(f64::INFINITY, Fit::inflation)
    }
}

/// Grow from white noise: add, replace or drop one process at a time while the score falls.
fn grow(points: &Points) -> Table {
    let mut table = Table::new(points.clone());
    let mut current = Shape::new(vec![Kind::White]);
    table.add([current.clone()]);
    loop {
        table.add(neighbours(&current));
        match table.best() {
            Some(best) if best.shape != current => current = best.shape.clone(),
            _ => return table,
        }
    }
}

/// Models that differ by one process, white noise always kept.
fn neighbours(shape: &Shape) -> Vec<Shape> {
    let may_add = |shape: &Shape, kind: Kind| match kind {
        Kind::GaussMarkov => shape.count(kind) < MOST_GAUSS_MARKOV,
        kind => !shape.has(kind),
    };
    let kinds = || Kind::ALL.into_iter().filter(|k| in_allan_curve(*k));
    let mut found: Vec<Shape> = kinds().filter(|k| may_add(shape, *k)).map(|k| shape.with(k)).collect();
    for kind in shape.kinds().iter().filter(|k| **k != Kind::White) {
        let fewer = shape.without(*kind);
        found.extend(kinds().filter(|k| k != kind && may_add(&fewer, *k)).map(|k| fewer.with(k)));
        found.push(fewer);
    }
    found
}

/// Fit the forced model, or grow one, to the points; if that does not explain the curve (p below 10⁻⁴), try without
/// the shortest averaging times.
///
/// The rule: only averaging factors up to 100 samples may be left out for that (anti-alias filters and vibration act
/// there), and [`REMAINING_RANGE`] must remain. A model is found on the points beyond; the shorter ones are then
/// taken in, longest first, as long as the fit keeps a p-value of 0.001. What counts is the model of those beyond
/// [`MARGIN`] times the shortest of them, if enough remain and it explains them. If no model explains even the long
/// averaging times, nothing is left out, unless the misfit √(χ²/dof) more than halves by it.
pub(super) fn search(points: &Points, forced: Option<&Shape>) -> Table {
    let find = |points: &Points| match forced {
        None => grow(points),
        Some(shape) => {
            let mut table = Table::new(points.clone());
            table.add([shape.clone()]);
            table
        }
    };
    let full = find(points);
    if full.best().is_some_and(|fit| fit.p_value() >= LEAVING_OUT_LEVEL) {
        return full;
    }
    let factors = points.factors();
    let remain = |m: u64| factors.last().is_some_and(|longest| *longest >= REMAINING_RANGE * m);
    let firsts: Vec<u64> = factors.iter().skip(1).copied().filter(|m| *m <= LEFT_OUT_FACTOR && remain(*m)).collect();
    let Some(last) = firsts.last() else { return full };
    let beyond = |first: &u64| {
        let start = factors.iter().find(|m| **m >= MARGIN * first).filter(|m| remain(**m))?;
        Some(find(&points.starting_at(*start))).filter(Table::explains)
    };
    let safe = find(&points.starting_at(*last));
    let Some(best) = safe.best().filter(|_| safe.explains()) else {
        return beyond(last).unwrap_or(if 2.0 * safe.misfit() < full.misfit() { safe } else { full });
    };
    let kept = |first: &&u64| fit(&points.starting_at(**first), &best.shape).is_some_and(|f| f.p_value() >= FIT_LEVEL);
    let first = firsts.iter().rev().skip(1).take_while(kept).last().unwrap_or(last);
    if let Some(far) = beyond(first) {
        return far;
    }
    if first == last {
        return safe;
    }
    let mut table = find(&points.starting_at(*first));
    table.add([best.shape.clone()]);
    if table.explains() { table } else { safe }
}
