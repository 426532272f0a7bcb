//! Medians from a bounded, reproducible sample of a stream.

/// Indices that share a hash.
const GROUP: u64 = 64;

/// An even sample of a stream of any length: an element stays if the rank of its index is high enough, and the bound
/// rises by one whenever more than `capacity` have stayed. No clock and no random state: the same stream gives the
/// same sample.
#[derive(Clone, Debug)]
pub(super) struct Sample {
    kept: Vec<(u32, f64)>,
    /// The least rank that stays.
    level: u32,
    index: u64,
    capacity: usize,
}

/// Of every 64 indices 64/2^r have at least rank r: every 2^r-th of them from a random place on; one has rank 6, and
/// it has rank 6 + k in one of 2^k groups.
#[inline(always)]
fn rank(index: u64) -> u32 {
    let hash = mix(index / GROUP);
    match ((index ^ hash) | GROUP).trailing_zeros() {
        6 => 6 + hash.leading_zeros(),
        below => below,
    }
}

impl Sample {
    pub(super) fn new(capacity: usize) -> Self {
        Sample { kept: Vec::new(), level: 0, index: 0, capacity }
    }
    pub(super) fn add(&mut self, x: f64) {
        self.add_all(&[x]);
    }
    /// The same as one by one.
    pub(super) fn add_all(&mut self, x: &[f64]) {
        let (first, end) = (self.index, self.index + x.len() as u64);
        self.index = end;
        for group in first / GROUP..end.div_ceil(GROUP) {
            let hash = mix(group);
            if 6 + hash.leading_zeros() < self.level {
                continue;
            }
            let step = 1 << self.level.min(6);
            let from = group * GROUP;
            let places = (from + hash % step..from + GROUP).step_by(step as usize);
            for index in places.filter(|index| (first..end).contains(index)) {
                self.keep(rank(index), x[(index - first) as usize]);
            }
        }
    }
    #[inline(never)]
    fn keep(&mut self, rank: u32, x: f64) {
        if rank < self.level {
            return;
        }
        self.kept.push((rank, x));
        while self.kept.len() > self.capacity {
            self.level += 1;
            let level = self.level;
            self.kept.retain(|(rank, _)| *rank >= level);
        }
    }
    pub(super) fn values(&self) -> Vec<f64> {
        self.kept.iter().map(|(_, x)| *x).collect()
    }
}

/// The finaliser of SplitMix64 (Steele, Lea and Flood 2014).
#[inline(always)]
fn mix(index: u64) -> u64 {
    let mut z = index.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// Median; the mean of the two middle values for an even number. Reorders `x`; NaN for none.
pub(in crate::signal) fn median(x: &mut [f64]) -> f64 {
    let n = x.len();
    if n == 0 {
        return f64::NAN;
    }
    let (below, middle, _) = x.select_nth_unstable_by(n / 2, f64::total_cmp);
    let middle = *middle;
    if n % 2 == 1 {
        return middle;
    }
    let lower = below.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    0.5 * (lower + middle)
}

/// Median, and 1.4826 × the median absolute deviation from it: the standard deviation if the values are normal.
pub(super) fn median_and_spread(x: &mut [f64]) -> (f64, f64) {
    let center = median(x);
    x.iter_mut().for_each(|v| *v = (*v - center).abs());
    (center, 1.4826 * median(x))
}

/// The value below which this share of the sorted values lies (nearest rank).
pub(super) fn quantile(sorted: &[f64], share: f64) -> f64 {
    match sorted.len() {
        0 => f64::NAN,
        n => sorted[((n - 1) as f64 * share).round() as usize],
    }
}

/// Four significant digits for a sentence.
pub(super) fn short(x: f64) -> String {
    if x == 0.0 || !x.is_finite() {
        return x.to_string();
    }
    let exponent = x.abs().log10().floor();
    if (-4.0..6.0).contains(&exponent) {
        let text = format!("{:.*}", (3.0 - exponent).max(0.0) as usize, x);
        if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_string() } else { text }
    } else {
        format!("{x:.3e}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn medians_of_odd_even_and_empty() {
        assert_eq!(median(&mut [3.0, 1.0, 2.0]), 2.0);
        assert_eq!(median(&mut [4.0, 1.0, 2.0, 3.0]), 2.5);
        assert!(median(&mut []).is_nan());
        let (center, spread) = median_and_spread(&mut [1.0, 2.0, 3.0, 4.0, 100.0]);
        assert_eq!((center, spread), (3.0, 1.4826));
    }

    #[test]
    fn a_sample_is_bounded_even_and_reproducible() {
        let mut a = Sample::new(1000);
        (0..100_000).for_each(|i| a.add(f64::from(i)));
        let values = a.values();
        assert!(values.len() <= 1000 && values.len() > 400, "{}", values.len());
        // 500 draws or more from 0..1e5: the mean has a standard error below 1300; 6 of them
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        assert!((mean - 50_000.0).abs() < 7800.0, "{mean}");
        let mut b = Sample::new(1000);
        (0..100_000).for_each(|i| b.add(f64::from(i)));
        assert_eq!(values, b.values());
        let mut rest = &(0..100_000).map(f64::from).collect::<Vec<_>>()[..];
        let mut c = Sample::new(1000);
        for size in (1..200).cycle() {
            let (part, others) = rest.split_at(size.min(rest.len()));
            c.add_all(part);
            rest = others;
            if rest.is_empty() {
                break;
            }
        }
        assert_eq!(values, c.values());
        // whatever went before: those of high rank, of which one in 2^level has it
        let kept: Vec<f64> = (0..100_000).filter(|i| rank(*i) >= a.level).map(|i| i as f64).collect();
        assert!(a.level > 6 && values == kept, "{}", a.level);
        for level in 0..=10 {
            let count = (0..1 << 20).filter(|i| rank(*i) >= level).count() as f64;
            // 2^14 groups: above level 6 a binomial number of them, within 6 standard deviations
            let (expected, groups) = (2f64.powi(20 - level as i32), 2f64.powi(14));
            let slack = if level <= 6 { 0.0 } else { 6.0 * groups.sqrt() * 2f64.powi(-(level as i32 - 6)).sqrt() };
            assert!((count - expected).abs() <= slack, "{level}: {count}");
        }
        let mut small = Sample::new(1000);
        (0..1000).for_each(|i| small.add(f64::from(i)));
        assert_eq!(small.values().len(), 1000);
    }

    #[test]
    fn numbers_are_short() {
        let shown = [0.0, 0.007634, 99.31234, 12.0, 1234.4, 1e-9, -0.05, 1e7].map(short);
        assert_eq!(shown, ["0", "0.007634", "99.31", "12", "1234", "1.000e-9", "-0.05", "1.000e7"]);
    }
}
