//! What is added up over runs: without rounding, so that threads, batches, shards and resumed runs leave no trace.

use super::course::Channel;
use crate::numerics::exact_sum::ExactSum;

/// Width of a bin of the NIS histogram, and number of bins; what is beyond goes into one more.
pub(super) const NIS_BIN: f64 = 0.25;
pub(super) const NIS_BINS: usize = 40;

/// Where each sum of an axis stands in the lists of numbers of a run.
///
/// Values: per epoch log₁₀ NEES, u (r numbers), u uᵀ (lower triangle by rows) with u the whitened error of r components; then per
/// measurement Σy, Σy², Σ y_k y_(k−h) for every lag, Σ (block sum)²/length for every block length, the periodogram's ordinates.
/// Counts: per epoch and component how often |e| was within 1, 2, 3 sigma; then per measurement the NIS histogram.
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
