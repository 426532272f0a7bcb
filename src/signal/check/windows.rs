//! Windows of consecutive values: their moments, and whether they can hold an outlier.

use super::{Place, Places};
use crate::numerics::reduce::{Moments, by_eight};

/// Values whose moments are taken at once; every window is a multiple.
const PIECE: usize = 64;
const WINDOWS: usize = 4096;

/// Moments of consecutive windows; neighbours are merged when there are too many. How the values come, one by one or many at once,
/// makes no difference.
#[derive(Clone, Debug)]
pub(super) struct Windows {
    pub(super) size: u64,
    pub(super) done: Vec<(Moments, Place)>,
    open: Moments,
    start: Option<Place>,
    /// The beginning of a piece, and where.
    piece: Vec<f64>,
    at: Place,
}

impl Windows {
    pub(super) fn new() -> Self {
        let at = Place { index: 0, time_s: f64::NAN };
        let piece = Vec::with_capacity(PIECE);
        Windows { size: PIECE as u64, done: Vec::new(), open: Moments::default(), start: None, piece, at }
    }

    #[inline(always)]
    pub(super) fn add_all(&mut self, mut x: &[f64], mut places: Places) {
        while !x.is_empty() {
            let taken = if self.piece.is_empty() && x.len() >= PIECE {
                self.close(Moments::of(&x[..PIECE]), places.at(0));
                PIECE
            } else {
                if self.piece.is_empty() {
                    self.at = places.at(0);
                }
                let taken = x.len().min(PIECE - self.piece.len());
                self.piece.extend_from_slice(&x[..taken]);
                if self.piece.len() == PIECE {
                    self.close(Moments::of(&self.piece), self.at);
                    self.piece.clear();
                }
                taken
            };
            (x, places) = (&x[taken..], places.skip(taken));
        }
    }

    #[inline(never)]
    fn close(&mut self, piece: Moments, at: Place) {
        let start = *self.start.get_or_insert(at);
        self.open.merge(&piece);
        if self.open.count == self.size {
            self.done.push((std::mem::take(&mut self.open), start));
            self.start = None;
            if self.done.len() == WINDOWS {
                self.size *= 2;
                let merged = self.done.chunks_exact(2).map(|pair| {
                    let mut moments = pair[0].0;
                    moments.merge(&pair[1].0);
                    (moments, pair[0].1)
                });
                self.done = merged.collect();
            }
        }
    }
}

/// True only if no value is further than `bound` median absolute deviations from the median; false says nothing. With c the mean, d the
/// largest distance from it and e = d/32: if fewer than half of the values are below c - e and fewer than half above c + e, the median lies
/// between, and no value is further from it than d + e. If also fewer than half lie within t + e of c, the deviation is at least t; so
/// t = (d + e)/bound is enough. A part in 10^6 is added for rounding.
#[inline(always)]
pub(super) fn surely_quiet(x: &[f64], bound: f64) -> bool {
    let center = by_eight(x, |v| v) / x.len() as f64;
    let (smallest, largest) = extent(x);
    let furthest = (largest - center).max(center - smallest);
    let slack = furthest / 32.0;
    let (low, high) = (center - slack, center + slack);
    let near = (1.0 + 1e-6) * (furthest + slack) / bound + slack;
    let half = 0.5 * x.len() as f64;
    let count = |yes: bool| if yes { 1.0 } else { 0.0 };
    by_eight(x, |v| count(v < low)) < half
        && by_eight(x, |v| count(v > high)) < half
        && by_eight(x, |v| count((v - center).abs() <= near)) < half
}

/// Smallest and largest of finite values.
#[inline(always)]
pub(super) fn extent(x: &[f64]) -> (f64, f64) {
    let (chunks, rest) = x.as_chunks::<8>();
    let (mut low, mut high) = ([f64::INFINITY; 8], [f64::NEG_INFINITY; 8]);
    let mut take = |chunk: &[f64]| {
        for ((low, high), v) in low.iter_mut().zip(&mut high).zip(chunk) {
            *low = if *v < *low { *v } else { *low };
            *high = if *v > *high { *v } else { *high };
        }
    };
    chunks.iter().for_each(|chunk| take(chunk));
    take(rest);
    (low.into_iter().fold(f64::INFINITY, f64::min), high.into_iter().fold(f64::NEG_INFINITY, f64::max))
}
