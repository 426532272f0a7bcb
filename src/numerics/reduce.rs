//! Compensated and ordered sums: the same bytes for any number of threads.

/// Neumaier's compensated sum.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sum {
    sum: f64,
    compensation: f64,
}

impl Sum {
    pub fn add(&mut self, x: f64) {
        let total = self.sum + x;
        self.compensation += if self.sum.abs() >= x.abs() { (self.sum - total) + x } else { (x - total) + self.sum };
        self.sum = total;
    }
    pub fn value(&self) -> f64 {
        // an infinite or NaN sum has a NaN compensation: the plain sum says which
        if self.sum.is_finite() { self.sum + self.compensation } else { self.sum }
    }
}

/// Running count, mean and variance (Welford 1962, mergeable by the formula of Chan, Golub, LeVeque 1979).
#[derive(Clone, Copy, Debug, Default)]
pub struct Moments {
    pub count: u64,
    pub mean: f64,
    m2: f64,
}

impl Moments {
    /// Of no values.
    pub const NONE: Moments = Moments { count: 0, mean: 0.0, m2: 0.0 };

    /// Of these values: their mean, then the squares about it, each in eight partial sums.
    #[inline(always)]
    pub fn of(x: &[f64]) -> Moments {
        if x.is_empty() {
            return Moments::default();
        }
        let mean = by_eight(x, |v| v) / x.len() as f64;
        Moments { count: x.len() as u64, mean, m2: by_eight(x, |v| (v - mean) * (v - mean)) }
    }
    pub fn add(&mut self, x: f64) {
        self.count += 1;
        let delta = x - self.mean;
        self.mean += delta / self.count as f64;
        self.m2 += delta * (x - self.mean);
    }
    pub fn merge(&mut self, other: &Moments) {
        if other.count == 0 {
            return;
        }
        let count = self.count + other.count;
        let delta = other.mean - self.mean;
        let weight = other.count as f64 / count as f64;
        self.mean += delta * weight;
        self.m2 += other.m2 + delta * delta * self.count as f64 * weight;
        self.count = count;
    }
    /// Sum of squares about the mean.
    pub fn squares(&self) -> f64 {
        self.m2
    }
    /// Unbiased variance (n − 1); NaN below two samples.
    pub fn variance(&self) -> f64 {
        if self.count < 2 { f64::NAN } else { self.m2 / (self.count - 1) as f64 }
    }
}

/// Sum of a term of each value, in eight partial sums whatever the processor can do at once.
#[inline(always)]
pub fn by_eight(x: &[f64], term: impl Fn(f64) -> f64) -> f64 {
    let (chunks, rest) = x.as_chunks::<8>();
    let mut sums = [0.0; 8];
    for chunk in chunks {
        for (sum, v) in sums.iter_mut().zip(chunk) {
            *sum += term(*v);
        }
    }
    for (sum, v) in sums.iter_mut().zip(rest) {
        *sum += term(*v);
    }
    let [a, b, c, d, e, f, g, h] = sums;
    ((a + b) + (c + d)) + ((e + f) + (g + h))
}

/// Compensated mean of a slice; NaN if it is empty.
///
/// Eight sums side by side, each addition with its rounding (Knuth 1998, section 4.2.2), so that no sample waits for
/// the one before.
pub fn mean(x: &[f64]) -> f64 {
    const SIDE_BY_SIDE: usize = 8;
    let (mut sums, mut lost) = ([0.0; SIDE_BY_SIDE], [0.0; SIDE_BY_SIDE]);
    let (eights, rest) = x.as_chunks::<SIDE_BY_SIDE>();
    for eight in eights {
        for i in 0..SIDE_BY_SIDE {
            let total = sums[i] + eight[i];
            let part = total - sums[i];
            lost[i] += (sums[i] - (total - part)) + (eight[i] - part);
            sums[i] = total;
        }
    }
    let mut all = Sum::default();
    sums.iter().chain(rest).for_each(|sum| all.add(*sum));
    // an infinite sum has lost what is not a number
    if all.sum.is_finite() {
        lost.iter().for_each(|part| all.add(*part));
    }
    all.value() / x.len() as f64
}
