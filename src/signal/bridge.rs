//! Short holes in a log, filled for methods that need every sample: with what the log does elsewhere.
//!
//! A hole gets the straight line between the levels on both sides, plus what the samples of another place of the
//! same log, without a hole, have beside the straight line between *their* sides. So white noise stays white, drift
//! bends in the hole as it does elsewhere, and the variance is kept but for 2/w of it, w samples making a level.
//! What the samples beside a hole say of those in it beyond their level (lines, averaged noise) is lost, for the
//! share of the samples that was missing. Sources: Kreiss & Paparoditis 2003 (residuals of the series itself),
//! Little & Rubin 2002, section 4.3 (hot deck, stochastic regression).

use rand::RngExt;

use crate::numerics::random::{StreamId, stream};

/// Share of the samples that may be filled.
const MOST_FILLED: f64 = 0.05;
/// Longest hole, as a share of the log.
const LONGEST_HOLE: f64 = 0.01;
/// Samples that make a level, at least; as many as the hole if that is longer.
const LEVEL: usize = 32;
/// Places that are tried for one without a hole.
const TRIES: usize = 1000;
/// How much longer than what lies between two holes the filled stretch must be.
const WORTH: f64 = 1.05;

/// A stretch whose holes are filled.
#[derive(Clone, Debug, PartialEq)]
pub struct Bridged {
    /// Its first sample.
    pub start: usize,
    pub samples: Vec<f64>,
    /// How many of them are filled in.
    pub filled: usize,
}

/// Longest hole that is filled in a log of so many samples.
pub fn longest_hole(samples: usize) -> usize {
    (LONGEST_HOLE * samples as f64) as usize
}

/// The stretch with the most samples of `x` (uniform; what is not finite is missing) of which at most 5 % have to be
/// filled in, in holes of at most 1 % of `x`; `None` where the longest stretch without a hole is about as long.
///
/// Same samples, same result: the other places are drawn from a fixed stream.
pub fn bridge(x: &[f64]) -> Option<Bridged> {
    let runs = runs(x);
    let clean = runs.iter().map(|(start, end)| end - start).max()?;
    let longest = longest_hole(x.len());
    let best = runs.chunk_by(|a, b| b.0 - a.1 <= longest).filter_map(joined).max_by_key(|own| own.seen)?;
    if (best.seen as f64) < WORTH * clean as f64 {
        return None;
    }
    let samples = filled(&x[best.start..best.end]);
    Some(Bridged { start: best.start, filled: samples.len() - best.seen, samples })
}

/// Where finite samples begin and end.
fn runs(x: &[f64]) -> Vec<(usize, usize)> {
    let mut runs = Vec::new();
    let mut start = None;
    for (i, v) in x.iter().enumerate() {
        match (v.is_finite(), start) {
            (true, None) => start = Some(i),
            (false, Some(first)) => {
                runs.push((first, i));
                start = None;
            }
            _ => {}
        }
    }
    runs.extend(start.map(|first| (first, x.len())));
    runs
}

/// Runs with the holes between them.
struct Joined {
    start: usize,
    end: usize,
    seen: usize,
}

/// The neighbouring runs with the most samples between which few enough are to be filled in.
///
/// Runs i to j may be joined when 5 % of what they span is not less than what is missing: when the balance at the
/// end of j is not below that at the start of i. Only starts whose balance is lower than every one before can be the
/// first (longest interval of non-negative sum).
fn joined(runs: &[(usize, usize)]) -> Option<Joined> {
    let (mut seen, mut missing) = (0, 0);
    // samples before the run and with it, and the balances
    let mut all: Vec<([usize; 2], [f64; 2])> = Vec::with_capacity(runs.len());
    for (i, &(start, end)) in runs.iter().enumerate() {
        missing += if i > 0 { start - runs[i - 1].1 } else { 0 };
        let own = [seen, seen + end - start];
        seen = own[1];
        all.push((own, own.map(|seen| MOST_FILLED * (seen + missing) as f64 - missing as f64)));
    }
    let mut starts: Vec<usize> = Vec::new();
    for (i, (_, [balance, _])) in all.iter().enumerate() {
        if starts.last().is_none_or(|last| *balance < all[*last].1[0]) {
            starts.push(i);
        }
    }
    let mut best: Option<Joined> = None;
    for (j, ([_, with], [_, balance])) in all.iter().enumerate().rev() {
        while let Some(i) = starts.pop_if(|i| *balance >= all[*i].1[0]) {
            let seen = with.saturating_sub(all[i].0[0]);
            if i <= j && best.as_ref().is_none_or(|best| seen > best.seen) {
                best = Some(Joined { start: runs[i].0, end: runs[j].1, seen });
            }
        }
    }
    best
}

/// `x` begins and ends with finite samples.
fn filled(x: &[f64]) -> Vec<f64> {
    let mut out = x.to_vec();
    // how many samples before each are missing
    let missing: Vec<usize> = std::iter::once(0)
        .chain(x.iter().scan(0, |sum, v| {
            *sum += usize::from(!v.is_finite());
            Some(*sum)
        }))
        .collect();
    let runs = runs(x);
    for (hole, pair) in runs.windows(2).enumerate() {
        let (from, to) = (pair[0].1, pair[1].0);
        let width = LEVEL.max(to - from);
        let whole = |start: usize| missing[start + to - from + width] == missing[start - width];
        let last = x.len().saturating_sub(to - from + width);
        let mut random = stream(0, StreamId { run: hole as u64, axis: 0, term: 0 });
        let place = (width < last)
            .then(|| (0..TRIES).map(|_| random.random_range(width..last)).find(|start| whole(*start)))
            .flatten();
        let line = line(x, from, to, width);
        let other = place.map(|start| (start, self::line(x, start, start + to - from, width)));
        for i in from..to {
            let beside = other.as_ref().map_or(0.0, |(start, other)| x[start + i - from] - other(i - from));
            out[i] = line(i - from) + beside;
        }
    }
    out
}

/// The straight line from the mean of what is there of `width` samples before `from` to that of as many from `to`
/// on; by number of the sample after `from`.
fn line(x: &[f64], from: usize, to: usize, width: usize) -> impl Fn(usize) -> f64 {
    let level = |first: usize, end: usize| {
        let there = (first..end).filter(|i| x[*i].is_finite());
        let (count, place, sum) = there.fold((0.0, 0.0, 0.0), |(n, p, s), i| (n + 1.0, p + i as f64, s + x[i]));
        (place / count, sum / count)
    };
    let (before, left) = level(from.saturating_sub(width), from);
    let (after, right) = level(to, (to + width).min(x.len()));
    let slope = (right - left) / (after - before);
    move |i: usize| left + slope * ((from + i) as f64 - before)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numerics::random::fill_normal;

    fn noise(samples: usize, seed: u64) -> Vec<f64> {
        let mut x = vec![0.0; samples];
        fill_normal(&mut stream(seed, StreamId { run: 0, axis: 0, term: 1 }), &mut x);
        x
    }

    /// Two thousand single holes and ten of 300 in white noise of 200,000 samples, on a slope: what is filled in has
    /// mean 0 and variance 1 + 2/32 beside the slope, and no correlation with its neighbours, each within 4.5
    /// standard deviations (four statements: 3e-5).
    #[test]
    fn filled_samples_are_noise_like_the_others() {
        let clean = noise(200_000, 3);
        let sloped = |i: usize| 1e-4 * i as f64;
        let mut x: Vec<f64> = clean.iter().enumerate().map(|(i, v)| v + sloped(i)).collect();
        (0..2000).for_each(|k| x[50 + 97 * k + k % 7] = f64::NAN);
        (0..10).for_each(|k| x[15_000 * (k + 1)..15_000 * (k + 1) + 300].fill(f64::NAN));
        let found = bridge(&x).unwrap();
        assert_eq!((found.start, found.samples.len()), (0, x.len()));
        let lost: Vec<usize> = (0..x.len()).filter(|i| x[*i].is_nan()).collect();
        assert_eq!(found.filled, lost.len());
        assert!(x.iter().zip(&found.samples).all(|(a, b)| a.is_nan() || a == b));
        let beside = |i: usize| found.samples[i] - sloped(i);
        let n = lost.len() as f64;
        let mean = lost.iter().map(|i| beside(*i)).sum::<f64>() / n;
        let square = lost.iter().map(|i| beside(*i).powi(2)).sum::<f64>() / n;
        let product = |by: usize| lost.iter().map(|i| beside(*i) * beside(i - by)).sum::<f64>() / n;
        // levels are shared within a long hole: ten holes, each two levels of 300 samples and those of the donor
        let of_levels = (10.0 * 300.0 * 300.0 * 4.0 / 300.0_f64).sqrt() / n;
        assert!(mean.abs() < 4.5 * (1.0 / n.sqrt() + of_levels), "{mean}");
        let share = 2000.0 / n;
        assert!((square - 1.0 - share * 2.0 / 32.0).abs() < 4.5 * (2.0 / n).sqrt() + 0.01, "{square}");
        assert!(product(1).abs() < 4.5 / n.sqrt() + 1.0 / 300.0 && product(2).abs() < 4.5 / n.sqrt() + 1.0 / 300.0);
        assert_eq!(found, bridge(&x).unwrap());
    }

    #[test]
    fn what_is_not_worth_it_or_too_much_stays_open() {
        let clean = noise(10_000, 4);
        assert_eq!(bridge(&clean), None);
        assert_eq!(bridge(&[]), None);
        assert_eq!(bridge(&[f64::NAN; 9]), None);
        // a hole at the edge joins nothing worth it
        let mut edge = clean.clone();
        edge[20] = f64::NAN;
        assert_eq!(bridge(&edge), None);
        // more than a hundredth of the log in one hole: two parts
        let mut long = clean.clone();
        long[4000..4200].fill(f64::NAN);
        assert_eq!(bridge(&long), None);
        long[4000..4095].copy_from_slice(&clean[4000..4095]);
        long[4105..4200].copy_from_slice(&clean[4105..4200]);
        let found = bridge(&long).unwrap();
        assert_eq!((found.start, found.filled, found.samples.len()), (0, 10, 10_000));
        // every fifth sample missing in the second half: m of them in 5000 + 5 m samples are 5 % for m = 333
        let mut half = clean.clone();
        (5000..10_000).step_by(5).for_each(|i| half[i] = f64::NAN);
        half[2000] = f64::NAN;
        let found = bridge(&half).unwrap();
        assert!(found.start == 0 && (6600..6700).contains(&found.samples.len()), "{}", found.samples.len());
        assert!((325..335).contains(&found.filled), "{}", found.filled);
        // and where there is nothing to fill a hole from, the line alone
        let mut short = vec![1.0; 100];
        short[50] = f64::NAN;
        assert_eq!(bridge(&short).unwrap().samples, [1.0; 100]);
    }
}
