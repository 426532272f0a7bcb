//! Compensated and ordered sums: the same bytes for any number of threads.

/// Neumaier's compensated sum.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sum {
    sum: f64,
    compensation: f64,
}

impl Sum {
    pub fn add(&mut self, x: f64) {
        let _ = x;
        todo!()
    }
    pub fn value(&self) -> f64 {
        self.sum + self.compensation
    }
}

/// Running count, mean and variance (Welford, mergeable by Chan's formula).
#[derive(Clone, Copy, Debug, Default)]
pub struct Moments {
    pub count: u64,
    pub mean: f64,
    m2: f64,
}

impl Moments {
    pub fn add(&mut self, x: f64) {
        let _ = x;
        todo!()
    }
    pub fn merge(&mut self, other: &Moments) {
        let _ = other;
        todo!()
    }
    /// Unbiased variance (n − 1); NaN below two samples.
    pub fn variance(&self) -> f64 {
        let _ = self.m2;
        todo!()
    }
}
/// Compensated mean of a slice.
pub fn mean(x: &[f64]) -> f64 {
    let _ = x;
    todo!()
}
