//! The low-frequency innovation test: what mean NIS at 100 Hz cannot see.
//!
//! Sampled fast, S is nearly R and the mean NIS says nothing about the bias model. A wrong drift shows in the
//! innovations only below the filter's bandwidth. So the normalised innovations y are averaged over blocks of L
//! samples: √L·ȳ is N(0, 1) exactly when the design is true, the sum of L ȳ² over n blocks is χ²(n), and its mean is
//! the ratio of the innovation spectrum below about 1/(2L) to what the filter says. Lengths run from a quarter of
//! the filter's time constant to several of it. Bartlett's cumulative periodogram of the block means looks at the
//! shape of the same band.

use super::effect::{Effect, VARIANCE_RATIO_TOLERANCE};
use super::normalized::mean_of_chi_squares;
use super::whiteness::{CumulativePeriodogram, cumulative_periodogram};
use super::{Test, TestKind};
use crate::numerics::distribution::chi_square_quantile;
use crate::units::digits;

/// Below this number of blocks a length is not judged.
pub const FEWEST_BLOCKS: u64 = 8;
/// Filter time constants that a log must have before its drift is judged at all.
pub const ENOUGH_TIME_CONSTANTS: f64 = 30.0;
/// At most this many block lengths, each four times the one before.
const MOST_LENGTHS: usize = 8;
/// Block means kept for the periodogram; when full, neighbours are merged and the blocks are twice as long.
const KEPT_BLOCKS: usize = 16_384;

/// Block lengths in samples for a filter with these closed-loop time constants (in samples): a quarter of the
/// shortest, then four times longer each until sixteen times the longest is reached, at most eight; lengths of one
/// sample are left to the NIS. Without time constants (a filter that follows no drift): 16, 64, … samples.
pub fn block_lengths(time_constants: &[f64]) -> Vec<u64> {
    let usable = || time_constants.iter().copied().filter(|t| t.is_finite() && *t > 0.0);
    let shortest = usable().fold(f64::INFINITY, f64::min);
    let longest = usable().fold(0.0, f64::max);
    let (first, last) = if longest > 0.0 { (shortest / 4.0, 16.0 * longest) } else { (16.0, f64::INFINITY) };
    // a time constant of 10¹² samples is no different from one that is longer still
    let mut length = first.clamp(1.0, 1e12).round() as u64;
    let mut lengths = Vec::new();
    while lengths.len() < MOST_LENGTHS && length as f64 <= last.max(4.0) * 1.001 {
        if length > 1 {
            lengths.push(length);
        }
        length = length.saturating_mul(4);
    }
    lengths
}

/// Time constants in samples of closed-loop poles given as (re, im): −1/ln|λ| of those inside the unit circle.
///
/// Poles on the circle belong to constants the filter has learnt for good; poles at zero have no memory. Neither
/// counts.
pub fn time_constants(poles: &[(f64, f64)]) -> Vec<f64> {
    poles
        .iter()
        .map(|(re, im)| re.hypot(*im))
        .filter(|modulus| (1e-9..1.0 - 1e-9).contains(modulus))
        .map(|modulus| -1.0 / modulus.ln())
        .collect()
}

/// Sums over blocks of one length.
#[derive(Clone, Debug)]
struct Blocks {
    length: u64,
    filled: u64,
    sum: f64,
    count: u64,
    /// Σ (sum of a block)²/length.
    squares: f64,
}

/// Block means of bounded number, for the periodogram.
#[derive(Clone, Debug)]
struct Kept {
    length: u64,
    filled: u64,
    sum: f64,
    /// √length times the mean of each block.
    values: Vec<f64>,
}

impl Kept {
    fn push(&mut self, y: f64) {
        self.sum += y;
        self.filled += 1;
        if self.filled < self.length {
            return;
        }
        self.values.push(self.sum / (self.length as f64).sqrt());
        self.filled = 0;
        self.sum = 0.0;
        if self.values.len() == KEPT_BLOCKS {
            self.values =
                self.values.chunks_exact(2).map(|pair| (pair[0] + pair[1]) * std::f64::consts::FRAC_1_SQRT_2).collect();
            self.length *= 2;
        }
    }
}

/// Streaming accumulator; memory does not grow with the log.
#[derive(Clone, Debug)]
pub struct LowFrequency {
    blocks: Vec<Blocks>,
    kept: Kept,
    count: u64,
    enough: u64,
}

impl LowFrequency {
    /// For a filter with these closed-loop time constants, in samples; see [`block_lengths`]. `gain` is that of the
    /// steady filter from innovation to predicted measurement, H K: a filter averages over about 1/(H K) samples,
    /// whatever the number of its states, and a log of [`ENOUGH_TIME_CONSTANTS`] times that is enough for a
    /// judgement. A filter without gain follows no drift; for it the block lengths decide.
    pub fn new(time_constants: &[f64], gain: f64) -> LowFrequency {
        let mut low_frequency = LowFrequency::with_lengths(&block_lengths(time_constants));
        if gain > 1e-12 {
            low_frequency.enough = (ENOUGH_TIME_CONSTANTS / gain).ceil() as u64;
        }
        low_frequency
    }

    /// With block lengths in samples, shortest first; enough are 120 of the shortest.
    pub fn with_lengths(lengths: &[u64]) -> LowFrequency {
        let blocks = lengths.iter().map(|&length| Blocks { length, filled: 0, sum: 0.0, count: 0, squares: 0.0 });
        LowFrequency {
            blocks: blocks.collect(),
            kept: Kept {
                length: lengths.first().copied().unwrap_or(1).max(1),
                filled: 0,
                sum: 0.0,
                values: Vec::with_capacity(KEPT_BLOCKS),
            },
            count: 0,
            enough: lengths.first().map_or(0, |length| length.saturating_mul(120)),
        }
    }

    /// The next normalised innovation. Missing samples are left out: a block is that many innovations.
    pub fn push(&mut self, y: f64) {
        for block in &mut self.blocks {
            block.sum += y;
            block.filled += 1;
            if block.filled == block.length {
                block.squares += block.sum * block.sum / block.length as f64;
                block.count += 1;
                block.filled = 0;
                block.sum = 0.0;
            }
        }
        self.kept.push(y);
        self.count += 1;
    }

    /// The lengths that have enough blocks, shortest first. `variance` is the mean of y² under the model: 1, or less
    /// behind a gate.
    pub fn results(&self, variance: f64, alpha: f64) -> Vec<BlockResult> {
        self.blocks
            .iter()
            .filter(|b| b.count >= FEWEST_BLOCKS)
            .map(|b| BlockResult::new(b.length, b.count, b.squares / variance, alpha))
            .collect()
    }

    /// Cumulative periodogram of the shortest blocks (longer ones on a very long log), with the number of samples
    /// per block.
    pub fn periodogram(&self, alpha: f64) -> Option<(u64, CumulativePeriodogram)> {
        cumulative_periodogram(&self.kept.values, alpha).map(|p| (self.kept.length, p))
    }

    /// Whether the log is long enough for its drift to be judged.
    pub fn is_enough(&self) -> bool {
        self.count >= self.enough
    }

    /// Innovations that [`LowFrequency::is_enough`] asks for.
    pub fn samples_needed(&self) -> u64 {
        self.enough
    }
}

/// One block length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BlockResult {
    /// Samples per block.
    pub length: u64,
    pub blocks: u64,
    /// Mean of L ȳ²: innovation power below about 1/(2L) over what the filter says; 1 when the design is true.
    pub ratio: f64,
    /// Bounds of `ratio` under the model at level alpha.
    pub lower: f64,
    pub upper: f64,
    pub p_value: f64,
    /// Interval for the true ratio of confidence 1 − alpha, taking the block means as independent and Gaussian.
    pub interval: [f64; 2],
    /// Ratios at or beyond these are rejected at level alpha with 90 % probability.
    pub detects: [f64; 2],
}

impl BlockResult {
    fn new(length: u64, blocks: u64, squares: f64, alpha: f64) -> BlockResult {
        let mean = mean_of_chi_squares(squares, blocks, 1.0, alpha);
        let dof = blocks as f64;
        BlockResult {
            length,
            blocks,
            ratio: mean.mean,
            lower: mean.lower,
            upper: mean.upper,
            p_value: mean.p_value,
            interval: [mean.mean / mean.upper, mean.mean / mean.lower],
            detects: detectable_ratio(dof, alpha, 0.9),
        }
    }

    /// The record of the test; `dt` in s.
    pub fn test(&self, axis: &str, dt: f64) -> Test {
        let seconds = self.length as f64 * dt;
        let meaning = if self.ratio > self.upper {
            format!(
                "averaged over {} s the innovations have {} times the predicted power: the filter is optimistic about \
                 slow drift (it expects less than there is)",
                digits(seconds),
                digits(self.ratio)
            )
        } else if self.ratio < self.lower {
            format!(
                "averaged over {} s the innovations have {} times the predicted power: the filter is pessimistic about \
                 slow drift (it expects more than there is)",
                digits(seconds),
                digits(self.ratio)
            )
        } else {
            format!("averaged over {} s the innovations have the predicted power", digits(seconds))
        };
        Test::new(axis, TestKind::LowFrequency, self.ratio, [self.lower, self.upper], self.p_value, meaning)
            .with_averaging(seconds)
            .with_effect(Effect::new(
                "variance_ratio",
                self.ratio,
                self.interval,
                [1.0 / VARIANCE_RATIO_TOLERANCE, VARIANCE_RATIO_TOLERANCE],
            ))
    }
}

/// Variance ratios [low, high] at which the two-sided χ²(dof) test of level `alpha` rejects with probability `power`.
///
/// low = χ²(α/2)/χ²(power), high = χ²(1 − α/2)/χ²(1 − power), quantiles with dof degrees of freedom.
pub fn detectable_ratio(dof: f64, alpha: f64, power: f64) -> [f64; 2] {
    [
        chi_square_quantile(alpha / 2.0, dof) / chi_square_quantile(power, dof),
        chi_square_quantile(1.0 - alpha / 2.0, dof) / chi_square_quantile(1.0 - power, dof),
    ]
}
