//! Rate into phase: one prefix sum, in blocks that threads take as they come.

use rayon::prelude::*;

use super::squares::folded;
use crate::numerics::reduce::Sum;

/// Samples of a block, and chains of consecutive samples in which it is summed at once.
const BLOCK: usize = 1 << 13;
const CHAINS: usize = 8;

/// Phase of rate samples without their mean: `θ_0 = 0, θ_k = dt Σ_{j<k} (y_j − ȳ)`, n + 1 values in unit·s.
///
/// No member of the family sees the mean; without it the phase stays small and the differences keep their digits.
/// The sums at the starts of blocks are compensated, within a block of 8192 samples they are plain. The same to the
/// bit for any number of threads.
pub fn phase(rate: &[f64], dt: f64) -> Vec<f64> {
    let level = mean(rate);
    let mut so_far = Sum::default();
    let starts: Vec<f64> = sums(rate, |block| chains(block, level).iter().sum())
        .into_iter()
        .map(|sum| {
            let start = so_far.value();
            so_far.add(sum);
            start
        })
        .collect();
    let mut phase = vec![0.0; rate.len() + 1];
    let blocks = phase[1..].par_chunks_mut(BLOCK).zip(rate.par_chunks(BLOCK)).zip(starts);
    blocks.for_each(|((phase, rate), start)| integrate(rate, level, start, dt, phase));
    phase
}

/// NaN if there are no samples.
fn mean(rate: &[f64]) -> f64 {
    let lanes = |block: &[f64]| {
        let (whole, rest) = block.as_chunks::<CHAINS>();
        let mut lanes = [0.0; CHAINS];
        for chunk in whole {
            (0..CHAINS).for_each(|i| lanes[i] += chunk[i]);
        }
        folded(lanes) + rest.iter().sum::<f64>()
    };
    let mut total = Sum::default();
    sums(rate, lanes).into_iter().for_each(|sum| total.add(sum));
    total.value() / rate.len() as f64
}

fn sums(rate: &[f64], of: impl Fn(&[f64]) -> f64 + Sync + Send) -> Vec<f64> {
    rate.par_chunks(BLOCK).map(of).collect()
}

/// Σ (y − level) of each chain of a block; of a short block one chain.
fn chains(rate: &[f64], level: f64) -> [f64; CHAINS] {
    let mut sums = [0.0; CHAINS];
    let length = rate.len() / CHAINS;
    if rate.len() == BLOCK {
        for k in 0..length {
            (0..CHAINS).for_each(|c| sums[c] += rate[c * length + k] - level);
        }
    } else {
        sums[0] = rate.iter().map(|y| y - level).sum();
    }
    sums
}

/// The phase at the end of each sample of a block that starts at `start`/dt.
fn integrate(rate: &[f64], level: f64, start: f64, dt: f64, phase: &mut [f64]) {
    let sums = chains(rate, level);
    let mut at = [start; CHAINS];
    for c in 1..CHAINS {
        at[c] = at[c - 1] + sums[c - 1];
    }
    let (chains, length) = if rate.len() == BLOCK { (CHAINS, BLOCK / CHAINS) } else { (1, rate.len()) };
    for k in 0..length {
        for c in 0..chains {
            at[c] += rate[c * length + k] - level;
            phase[c * length + k] = at[c] * dt;
        }
    }
}
