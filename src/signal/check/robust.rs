//! Medians from a bounded, reproducible sample of a stream.

/// An even sample of a stream of any length: an element stays if a hash of its index is small enough, and the bound is
/// halved whenever more than `capacity` have stayed. No clock and no random state: the same stream gives the same sample.
#[derive(Clone, Debug)]
pub(super) struct Sample {
    kept: Vec<(u64, f64)>,
    level: u32,
    index: u64,
    capacity: usize,
}

impl Sample {
    pub(super) fn new(capacity: usize) -> Self {
        Sample { kept: Vec::new(), level: 0, index: 0, capacity }
    }
    #[inline(never)]
    pub(super) fn add(&mut self, x: f64) {
        let hash = mix(self.index);
        self.index += 1;
        if hash.leading_zeros() < self.level {
            return;
        }
        self.kept.push((hash, x));
        while self.kept.len() > self.capacity {
            self.level += 1;
            let level = self.level;
            self.kept.retain(|(hash, _)| hash.leading_zeros() >= level);
        }
    }
    /// The same one by one.
    #[inline(always)]
    pub(super) fn add_all(&mut self, mut x: &[f64]) {
        /// Looked at together: of most of them nothing stays.
        const GROUP: usize = 64;
        while !x.is_empty() {
            let (group, rest) = x.split_at(x.len().min(GROUP));
            // hash.leading_zeros() >= level
            let bound = u64::MAX >> self.level;
            let first = self.index;
            if group.len() < GROUP || (0..GROUP as u64).fold(false, |any, i| any | (mix(first + i) <= bound)) {
                group.iter().for_each(|x| self.add(*x));
            } else {
                self.index += GROUP as u64;
            }
            x = rest;
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
