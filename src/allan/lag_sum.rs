//! Sums over millions of lags of functions that are smooth between known kinks, from a few hundred of their values.
//!
//! Covariances of differences are smooth in the lag except where two of the edges of the differences meet; away from a
//! kink they vary on the scale of the distance to it. So the lags are cut at the kinks and each piece is covered by
//! panels that grow with the distance from its ends; on a panel the integer sum of the quartic through five equally
//! spaced lags is used (Euler-Maclaurin makes it exact for polynomials up to degree five). Within 16 lags of a kink
//! every lag is used.

use std::ops::RangeInclusive;

/// The step of a panel is this fraction of the distance to the nearest kink; a panel has four steps.
const STEP_FRACTION: i64 = 8;

/// `Σ f(h)` over the closed range with half weight at its two ends (so that adjoining ranges add up).
///
/// `kinks`: sorted lags at which `f` or a derivative may jump or have a boundary layer (they need not lie in the
/// range); `breaks`: sorted lags at which `f` only changes its polynomial form (weights), which need no refinement.
pub(super) fn sum(lags: RangeInclusive<i64>, kinks: &[i64], breaks: &[i64], f: impl Fn(i64) -> f64) -> f64 {
    nodes(lags, kinks, breaks).into_iter().map(|(lag, weight)| weight * f(lag)).sum()
}

/// The lags at which [`sum`] asks for values, ascending, and the weight of each: they depend on the kinks only. None
/// of an empty range.
pub(super) fn nodes(lags: RangeInclusive<i64>, kinks: &[i64], breaks: &[i64]) -> Vec<(i64, f64)> {
    let (first, last) = lags.into_inner();
    let mut cuts: Vec<i64> =
        kinks.iter().chain(breaks).copied().filter(|cut| (first..last).contains(cut)).chain([last]).collect();
    cuts.sort_unstable();
    let mut nodes = Vec::new();
    let mut from = first;
    for to in cuts {
        if to > from {
            piece(from, to, kinks, &mut nodes);
            from = to;
        }
    }
    nodes
}

/// One piece with no kink and no break inside.
fn piece(from: i64, to: i64, kinks: &[i64], nodes: &mut Vec<(i64, f64)>) {
    let below = kinks.iter().copied().rfind(|kink| *kink <= from);
    let above = kinks.iter().copied().find(|kink| *kink >= to);
    let mut add = |lag: i64, weight: f64| match nodes.last_mut() {
        // a panel begins where the last one ended
        Some((last, sum)) if *last == lag => *sum += weight,
        _ => nodes.push((lag, weight)),
    };
    let mut at = from;
    while at < to {
        let distance = below
            .map_or(i64::MAX, |kink| at - kink)
            // the panel must stay away from the kink above by as much as it is long
            .min(above.map_or(i64::MAX, |kink| (kink - at) / 2));
        let step = (distance / STEP_FRACTION).min((to - at) / 4);
        if step < 1 {
            add(at, 0.5);
            add(at + 1, 0.5);
            at += 1;
        } else {
            let [end, inner, middle] = panel(step as f64);
            for (i, weight) in (0..).zip([end, inner, middle, inner, end]) {
                add(at + i * step, weight);
            }
            at += 4 * step;
        }
    }
}

/// Weights of f(0), f(s) and f(2s) in the integer sum (half weight at both ends) over 4 s lags of the quartic
/// through f(0), f(s), … f(4s).
fn panel(s: f64) -> [f64; 3] {
    // even part about the middle: f(2s) + c2 (u/s)² + c4 (u/s)⁴, c4 = (outer − 4 inner)/12, c2 = inner − c4, where
    // inner and outer are (f(s) + f(3s))/2 and (f(0) + f(4s))/2 less f(2s); the odd part sums to zero
    let squares = 16.0 * s / 3.0 + 2.0 / (3.0 * s);
    let fourths = 64.0 * s / 5.0 + 16.0 / (3.0 * s) - 2.0 / (15.0 * s * s * s);
    let outer = (fourths - squares) / 12.0;
    let inner = squares - 4.0 * outer;
    [0.5 * outer, 0.5 * inner, 4.0 * s - inner - outer]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn brute(lags: RangeInclusive<i64>, f: impl Fn(i64) -> f64) -> f64 {
        let (first, last) = (*lags.start(), *lags.end());
        lags.map(&f).sum::<f64>() - 0.5 * (f(first) + f(last))
    }

    #[test]
    fn polynomials_to_degree_five_are_exact() {
        let f = |h: i64| {
            let x = h as f64 / 1e4;
            ((((2.0 * x - 1.0) * x + 3.0) * x - 0.5) * x + 1.0) * x - 2.0
        };
        for to in [1, 2, 5, 999, 31_415] {
            let (full, fast) = (brute(-7..=to, f), sum(-7..=to, &[-7], &[], f));
            assert!((fast / full - 1.0).abs() < 1e-12, "to {to}: {fast} and {full}");
        }
    }

    /// Boundary layers of any width at a kink, in the middle of the range and at its ends.
    #[test]
    fn boundary_layers_and_decays_are_resolved() {
        for width in [0.3, 3.0, 50.0, 3000.0, 1e6] {
            let f = |h: i64| {
                let layer = |kink: i64| (-((h - kink).abs() as f64) / width).exp();
                (1.0 + layer(0) - 0.7 * layer(20_011) + layer(400_000)) * (500_000 - h) as f64
            };
            let full = brute(0..=400_000, f);
            let fast = sum(0..=400_000, &[0, 20_011, 400_000], &[123_456], f);
            assert!((fast / full - 1.0).abs() < 1e-5, "width {width}: {fast} and {full}");
        }
        let power = |h: i64| ((h as f64) + 0.5).powf(-1.5);
        let (full, fast) = (brute(0..=300_000, power), sum(0..=300_000, &[0], &[], power));
        assert!((fast / full - 1.0).abs() < 1e-6);
    }

    #[test]
    fn few_values_are_enough() {
        let count = std::cell::Cell::new(0);
        sum(0..=10_000_000, &[0, 1_000_000, 2_000_000], &[], |h| {
            count.set(count.get() + 1);
            1.0 / (h as f64 + 1.0)
        });
        assert!(count.get() < 1500, "{} values", count.get());
    }
}
