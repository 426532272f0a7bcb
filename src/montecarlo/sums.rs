//! What is added up over runs: without rounding, so that threads, batches, shards and resumed runs leave no trace.

use crate::consistency::low_frequency::block_lengths;
use crate::numerics::exact_sum::ExactSum;

/// Lags of the autocorrelation, at most.
const LAGS: u64 = 20;
/// Series of block means that the cumulative periodogram looks at have at least and at most this many points.
const BLOCKS: [u64; 2] = [32, 1024];
/// Each block length of the low-frequency test is this many times the one before.
const LENGTH_RATIO: u64 = 4;
/// Block lengths go up to this many times the longest time constant of the filter.
const LONGEST_BLOCK: f64 = 16.0;
/// Width of a bin of the NIS histogram, and number of bins; what is beyond goes into one more.
pub(super) const NIS_BIN: f64 = 0.25;
pub(super) const NIS_BINS: usize = 40;

/// Where each sum of an axis stands in the lists of numbers of a run.
///
/// Values: per epoch log₁₀ NEES, u (r numbers), u uᵀ (lower triangle by rows) with u the whitened error of r
/// components; then per measurement Σy, Σy², Σ y_k y_(k−h) for every lag, Σ (block sum)²/length for every block
/// length, the periodogram's ordinates. Counts: per epoch and component how often |e| was within 1, 2, 3 sigma; then
/// per measurement the NIS histogram.
#[derive(Clone, Debug, PartialEq)]
pub struct Layout {
    components: usize,
    epochs: usize,
    /// Offset of each channel's values.
    channels: Vec<usize>,
    lags: Vec<usize>,
    lengths: Vec<usize>,
    pub values: usize,
    pub counts: usize,
}

impl Layout {
    pub(super) fn new(epochs: usize, components: usize, channels: &[Channel]) -> Layout {
        let mut layout = Layout {
            components,
            epochs,
            channels: Vec::new(),
            lags: channels.iter().map(|c| c.lags).collect(),
            lengths: channels.iter().map(|c| c.lengths.len()).collect(),
            values: epochs * epoch_values(components),
            counts: epochs * components * 3 + channels.len() * (NIS_BINS + 1),
        };
        for channel in channels {
            layout.channels.push(layout.values);
            layout.values += 2 + channel.lags + channel.lengths.len() + channel.ordinates;
        }
        layout
    }
    /// log₁₀ NEES, followed by u and u uᵀ.
    pub(super) fn epoch(&self, epoch: usize) -> usize {
        epoch * epoch_values(self.components)
    }
    pub(super) fn mean(&self, epoch: usize) -> usize {
        self.epoch(epoch) + 1
    }
    /// u uᵀ, lower triangle by rows.
    pub(super) fn moments(&self, epoch: usize) -> usize {
        self.mean(epoch) + self.components
    }
    pub(super) fn sum(&self, channel: usize) -> usize {
        self.channels[channel]
    }
    pub(super) fn squares(&self, channel: usize) -> usize {
        self.channels[channel] + 1
    }
    pub(super) fn lags(&self, channel: usize) -> usize {
        self.channels[channel] + 2
    }
    pub(super) fn blocks(&self, channel: usize) -> usize {
        self.lags(channel) + self.lags[channel]
    }
    pub(super) fn ordinates(&self, channel: usize) -> usize {
        self.blocks(channel) + self.lengths[channel]
    }
    /// Within 1, 2, 3 sigma of one component.
    pub(super) fn within(&self, epoch: usize, component: usize) -> usize {
        (epoch * self.components + component) * 3
    }
    pub(super) fn histogram(&self, channel: usize) -> usize {
        self.epochs * self.components * 3 + channel * (NIS_BINS + 1)
    }
}

fn epoch_values(components: usize) -> usize {
    1 + components + components * (components + 1) / 2
}

/// Sums over runs of one axis.
#[derive(Clone, Debug)]
pub struct Totals {
    pub values: Vec<ExactSum>,
    pub counts: Vec<u64>,
}

impl Totals {
    pub fn new(layout: &Layout) -> Totals {
        Totals { values: vec![ExactSum::default(); layout.values], counts: vec![0; layout.counts] }
    }
    pub(super) fn add(&mut self, values: &[f64], counts: &[u32]) {
        for (sum, value) in self.values.iter_mut().zip(values) {
            sum.add(*value);
        }
        for (total, count) in self.counts.iter_mut().zip(counts) {
            *total += u64::from(*count);
        }
    }
    pub fn merge(&mut self, other: &Totals) {
        for (sum, value) in self.values.iter_mut().zip(&other.values) {
            sum.merge(value);
        }
        for (total, count) in self.counts.iter_mut().zip(&other.counts) {
            *total += count;
        }
    }
    /// The rounded sum at a place of the [`Layout`].
    pub(super) fn value(&self, place: usize) -> f64 {
        self.values[place].value()
    }
    pub(super) fn some(&self, first: usize, count: usize) -> Vec<f64> {
        self.values[first..first + count].iter().map(ExactSum::value).collect()
    }
}

/// One measurement of an axis and how its innovations are summed up.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    pub name: String,
    /// Taken at every n-th step.
    pub every: u64,
    /// Updates in a run.
    pub updates: u64,
    /// Lags 1..=lags of the autocorrelation.
    pub lags: usize,
    /// Updates in a base block.
    pub base: u64,
    /// Complete base blocks in a run.
    pub blocks: usize,
    /// Block lengths of the low-frequency test, in base blocks.
    pub lengths: Vec<usize>,
    /// Frequencies of the cumulative periodogram of the base blocks, without zero and Nyquist; 0 when there are too
    /// few.
    pub ordinates: usize,
}

impl Channel {
    pub(super) fn new(name: &str, every: u64, steps: u64, time_constants: &[f64]) -> Channel {
        let updates = steps.div_ceil(every);
        let own: Vec<f64> = time_constants.iter().map(|t| t / every as f64).collect();
        let least = updates.div_ceil(BLOCKS[1]);
        let most = (updates / BLOCKS[0]).max(1);
        let base = block_lengths(&own).first().copied().unwrap_or(1).clamp(least.min(most), most);
        let longest = own.iter().copied().fold(0.0, f64::max) * LONGEST_BLOCK;
        let longest = if longest > 0.0 { longest } else { f64::INFINITY };
        let blocks = updates / base;
        let lengths = std::iter::successors(Some(1), |length| Some(length * LENGTH_RATIO))
            .take_while(|length| *length <= blocks && (*length == 1 || (length * base) as f64 <= longest))
            // single updates are what the NIS judges
            .filter(|length| length * base > 1)
            .map(|length| length as usize)
            .collect();
        let ordinates = (blocks as usize - 1) / 2;
        Channel {
            name: name.into(),
            every,
            updates,
            lags: LAGS.min(updates / 10).max(1) as usize,
            base,
            blocks: blocks as usize,
            lengths,
            ordinates: if ordinates < 8 { 0 } else { ordinates },
        }
    }

    /// Complete blocks of `length` base blocks in a run.
    pub fn blocks_of(&self, length: usize) -> usize {
        self.blocks / length
    }
}
