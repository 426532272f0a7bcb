//! Windows of consecutive values: their moments, and whether they can hold an outlier.

use super::{Place, Places};
use crate::numerics::reduce::{Moments, by_eight};

/// Values whose moments are taken at once; every window is a multiple.
pub(super) const PIECE: usize = 64;
const WINDOWS: usize = 4096;

/// Moments of consecutive windows; neighbours are merged when there are too many. How the values come, one by one or
/// many at once, makes no difference.
#[derive(Clone, Debug)]
pub(super) struct Windows {
    pub(super) size: u64,
    pub(super) done: Vec<(Moments, Place)>,
    /// Of each of them.
    within: Vec<Within>,
    open: Piece,
    start: Option<Place>,
    /// The beginning of a piece, and where.
    piece: Vec<f64>,
    at: Place,
}

/// What the pieces of a window have about their own means.
#[derive(Clone, Copy, Debug, Default)]
struct Within {
    /// Sum of absolute values.
    distances: f64,
    squares: f64,
}

impl Within {
    fn merge(&mut self, other: &Within) {
        self.distances += other.distances;
        self.squares += other.squares;
    }
}

/// What is kept of consecutive values.
#[derive(Clone, Copy, Debug, Default)]
struct Piece {
    moments: Moments,
    within: Within,
}

impl Piece {
    /// Inlined where the processor can do more at once.
    #[inline(always)]
    fn of(x: &[f64]) -> Piece {
        let moments = Moments::of(x);
        let distances = by_eight(x, |v| (v - moments.mean).abs());
        Piece { moments, within: Within { distances, squares: moments.squares() } }
    }
    fn merge(&mut self, other: &Piece) {
        self.moments.merge(&other.moments);
        self.within.merge(&other.within);
    }
}

impl Windows {
    pub(super) fn new() -> Self {
        let at = Place { index: 0, time_s: f64::NAN };
        let piece = Vec::with_capacity(PIECE);
        let open = Piece::default();
        Windows { size: PIECE as u64, done: Vec::new(), within: Vec::new(), open, start: None, piece, at }
    }

    #[inline(always)]
    pub(super) fn add_all(&mut self, mut x: &[f64], mut places: Places) {
        while !x.is_empty() {
            let taken = if self.piece.is_empty() && x.len() >= PIECE {
                self.close(Piece::of(&x[..PIECE]), places.at(0));
                PIECE
            } else {
                if self.piece.is_empty() {
                    self.at = places.at(0);
                }
                let taken = x.len().min(PIECE - self.piece.len());
                self.piece.extend_from_slice(&x[..taken]);
                if self.piece.len() == PIECE {
                    self.close(Piece::of(&self.piece), self.at);
                    self.piece.clear();
                }
                taken
            };
            (x, places) = (&x[taken..], places.skip(taken));
        }
    }

    #[inline(never)]
    fn close(&mut self, piece: Piece, at: Place) {
        let start = *self.start.get_or_insert(at);
        self.open.merge(&piece);
        if self.open.moments.count == self.size {
            let Piece { moments, within } = std::mem::take(&mut self.open);
            self.done.push((moments, start));
            self.within.push(within);
            self.start = None;
            if self.done.len() == WINDOWS {
                self.size *= 2;
                let merged = self.done.chunks_exact(2).map(|pair| {
                    let mut moments = pair[0].0;
                    moments.merge(&pair[1].0);
                    (moments, pair[0].1)
                });
                self.done = merged.collect();
                let merged = self.within.chunks_exact(2).map(|pair| {
                    let mut within = pair[0];
                    within.merge(&pair[1]);
                    within
                });
                self.within = merged.collect();
            }
        }
    }

    /// The variance of each window as of normal values: π/2 times the square of the mean distance from the means of its
    /// pieces, and the variance of those. A few values that are far away, which are no motion, weigh by their distance
    /// and not by its square.
    pub(super) fn variances(&self) -> Vec<f64> {
        let of = |((moments, _), within): (&(Moments, Place), &Within)| {
            let distance = within.distances / moments.count as f64;
            let between = (moments.squares() - within.squares).max(0.0) / moments.count as f64;
            std::f64::consts::FRAC_PI_2 * distance * distance + between
        };
        self.done.iter().zip(&self.within).map(of).collect()
    }
}

/// True only if no value is further than `bound` median absolute deviations from the median; false says nothing.
/// With c the mean, d the largest distance from it and e = d/32: if fewer than half of the values are below c - e
/// and fewer than half above c + e, the median lies between, and no value is further from it than d + e. If also
/// fewer than half lie within t + e of c, the deviation is at least t; so t = (d + e)/bound is enough. A part in
/// 10^6 is added for rounding.
#[inline(always)]
pub(super) fn surely_quiet(x: &[f64], bound: f64) -> bool {
    let center = by_eight(x, |v| v) / x.len() as f64;
    let Extent { smallest, largest, .. } = Extent::of(x);
    let furthest = (largest - center).max(center - smallest);
    let slack = furthest / 32.0;
    let (low, high) = (center - slack, center + slack);
    let near = (1.0 + 1e-6) * (furthest + slack) / bound + slack;
    let bounds = Bounds { low, high, center, near };
    let (chunks, rest) = x.as_chunks::<LANES>();
    let mut counts = [[0; LANES]; 3];
    for chunk in chunks {
        bounds.count(chunk, &mut counts);
    }
    bounds.count(rest, &mut counts);
    counts.iter().all(|count| 2 * count.iter().sum::<u64>() < x.len() as u64)
}

/// Values side by side, so that none waits for the one before.
const LANES: usize = 16;

struct Bounds {
    low: f64,
    high: f64,
    center: f64,
    near: f64,
}

impl Bounds {
    /// Values below, above, and near the center.
    #[inline(always)]
    fn count(&self, values: &[f64], [below, above, close]: &mut [[u64; LANES]; 3]) {
        for (i, v) in values.iter().enumerate() {
            below[i] += u64::from(*v < self.low);
            above[i] += u64::from(*v > self.high);
            close[i] += u64::from((*v - self.center).abs() <= self.near);
        }
    }
}

/// What one look at many values says.
#[derive(Clone, Copy, Debug)]
pub(super) struct Extent {
    /// Of the finite values, if all are.
    pub(super) smallest: f64,
    pub(super) largest: f64,
    pub(super) finite: bool,
    pub(super) zeros: u64,
}

/// The look in the making.
struct Looks {
    low: [f64; LANES],
    high: [f64; LANES],
    /// NaN after what is not finite.
    nothing: [f64; LANES],
    zeros: [u64; LANES],
}

impl Looks {
    #[inline(always)]
    fn add(&mut self, values: &[f64]) {
        for (i, v) in values.iter().enumerate() {
            self.low[i] = if *v < self.low[i] { *v } else { self.low[i] };
            self.high[i] = if *v > self.high[i] { *v } else { self.high[i] };
            self.nothing[i] += 0.0 * *v;
            self.zeros[i] += u64::from(*v == 0.0);
        }
    }
}

impl Extent {
    #[inline(always)]
    pub(super) fn of(x: &[f64]) -> Extent {
        let (low, high) = ([f64::INFINITY; LANES], [f64::NEG_INFINITY; LANES]);
        let mut looks = Looks { low, high, nothing: [0.0; LANES], zeros: [0; LANES] };
        let (chunks, rest) = x.as_chunks::<LANES>();
        for chunk in chunks {
            looks.add(chunk);
        }
        looks.add(rest);
        Extent {
            smallest: looks.low.into_iter().fold(f64::INFINITY, f64::min),
            largest: looks.high.into_iter().fold(f64::NEG_INFINITY, f64::max),
            finite: looks.nothing.iter().sum::<f64>() == 0.0,
            zeros: looks.zeros.iter().sum(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_value_counts_whatever_the_length() {
        for length in 1..70 {
            for at in 0..length {
                let with = |value: f64| {
                    let mut x: Vec<f64> = (0..length).map(|i| 1.0 + f64::from(i)).collect();
                    x[at as usize] = value;
                    Extent::of(&x)
                };
                assert_eq!((with(-3.0).smallest, with(99.0).largest), (-3.0, 99.0));
                assert_eq!((with(0.0).zeros, with(1.5).zeros), (1, 0));
                assert!(with(0.0).finite && !with(f64::NAN).finite && !with(f64::NEG_INFINITY).finite);
            }
        }
    }

    /// Never quiet where a value is further than the bound, by the definition; mostly quiet where none is far.
    #[test]
    fn what_is_called_quiet_is_quiet() {
        let bound = 4.0;
        let mut quiet = 0;
        for case in 0..2000_u64 {
            let length = 3 + (case * 7 % 60) as usize;
            // a line of values in any order, some of them moved away
            let mut x: Vec<f64> = (0..length).map(|i| ((i as u64 * 37 + case) % 61) as f64).collect();
            if case % 3 > 0 {
                x[(case % length as u64) as usize] = 30.0 + (case % 400) as f64;
            }
            let mut scratch = x.clone();
            let (center, spread) = super::super::robust::median_and_spread(&mut scratch);
            let far = x.iter().any(|v| (v - center).abs() > bound * spread / 1.4826);
            let says = surely_quiet(&x, bound);
            assert!(!(says && far), "{x:?}");
            quiet += usize::from(says);
        }
        assert!(quiet > 400, "{quiet}");
    }
}
