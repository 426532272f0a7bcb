//! Sums without rounding: the order of the terms, the threads and the machines that added them leave no trace.

/// The exact sum of any number of doubles, as a list of doubles that do not overlap.
///
/// Adding, and merging two sums, loses nothing, so any grouping gives the same number. Infinite or NaN terms make
/// the sum so, and for good; so does a sum that leaves the range of doubles on its way. Source: Shewchuk 1997,
/// Discrete Comput. Geom. 18, section 2 (grow-expansion).
#[derive(Clone, Debug, Default)]
pub struct ExactSum {
    /// Increasing magnitude, no zero; their sum is the sum.
    partials: Vec<f64>,
    /// Sum of the terms that are no finite numbers; 0 when there are none.
    unbounded: f64,
}

impl ExactSum {
    pub fn add(&mut self, term: f64) {
        if !term.is_finite() || self.unbounded != 0.0 {
            self.unbounded += term;
            self.partials.clear();
            return;
        }
        let mut carry = term;
        let mut kept = 0;
        for i in 0..self.partials.len() {
            let (large, small) = ordered(carry, self.partials[i]);
            let sum = large + small;
            if !sum.is_finite() {
                // what overflowed stays so: its rest would be no number, and each further term would add one more to
                // the list
                self.unbounded += sum;
                self.partials.clear();
                return;
            }
            let rest = small - (sum - large);
            if rest != 0.0 {
                self.partials[kept] = rest;
                kept += 1;
            }
            carry = sum;
        }
        self.partials.truncate(kept);
        if carry != 0.0 {
            self.partials.push(carry);
        }
    }

    pub fn merge(&mut self, other: &ExactSum) {
        self.unbounded += other.unbounded;
        for &partial in &other.partials {
            self.add(partial);
        }
    }

    /// The sum rounded once, to the nearest double (ties to even).
    pub fn value(&self) -> f64 {
        if self.unbounded != 0.0 {
            return self.unbounded;
        }
        let mut left = self.partials.iter().rev().copied();
        let Some(mut sum) = left.next() else { return 0.0 };
        let mut rest = 0.0;
        for partial in left.by_ref() {
            let before = sum;
            sum = before + partial;
            rest = partial - (sum - before);
            if rest != 0.0 {
                break;
            }
        }
        // half way between two doubles, what is left decides
        if let Some(next) = left.next()
            && (rest > 0.0) == (next > 0.0)
        {
            let twice = 2.0 * rest;
            let rounded = sum + twice;
            if rounded - sum == twice {
                sum = rounded;
            }
        }
        sum
    }

    /// The one list of doubles v₀, v₁, … with v₀ the rounded sum, v₁ the rounded rest, and so on, that adds up to
    /// the sum exactly.
    ///
    /// Empty for zero; one entry that is not finite when a term was not.
    pub fn digits(&self) -> Vec<f64> {
        if self.unbounded != 0.0 {
            return vec![self.unbounded];
        }
        let mut left = self.clone();
        let mut digits = Vec::new();
        while !left.partials.is_empty() {
            let leading = left.value();
            digits.push(leading);
            left.add(-leading);
        }
        digits
    }

    /// The sum of these doubles; the inverse of [`digits`](ExactSum::digits).
    pub fn from_digits(digits: &[f64]) -> ExactSum {
        let mut sum = ExactSum::default();
        digits.iter().for_each(|&digit| sum.add(digit));
        sum
    }
}

fn ordered(a: f64, b: f64) -> (f64, f64) {
    if a.abs() < b.abs() { (b, a) } else { (a, b) }
}

#[cfg(test)]
mod tests {
    use super::ExactSum;
    use crate::numerics::random::{StreamId, fill_normal, stream};

    fn sum(terms: &[f64]) -> ExactSum {
        ExactSum::from_digits(terms)
    }

    /// Sums that a plain loop gets wrong, with the exact answers.
    #[test]
    fn hard_sums() {
        assert_eq!(sum(&[1e100, 1.0, -1e100]).value(), 1.0);
        assert_eq!(sum(&[1.0, 2f64.powi(-53), 2f64.powi(-106)]).value(), 1.0 + f64::EPSILON);
        assert_eq!(sum(&[1.0, 2f64.powi(-53)]).value(), 1.0);
        assert_eq!(sum(&[1.0, 2f64.powi(-53), -(2f64.powi(-106))]).value(), 1.0);
        assert_eq!(sum(&[0.1; 10]).value(), 1.0);
        assert_eq!(sum(&[0.25, -0.25]).digits(), Vec::<f64>::new());
        assert_eq!(sum(&[1e16, 1.0]).digits(), vec![1e16, 1.0]);
        assert_eq!(sum(&[f64::INFINITY, 1.0]).value(), f64::INFINITY);
        assert!(sum(&[f64::INFINITY, f64::NEG_INFINITY]).value().is_nan());
    }

    /// What overflows is infinite and takes no more room for further terms, one by one or merged.
    #[test]
    fn an_overflow_stays_one_number() {
        let mut total = sum(&[f64::MAX, f64::MAX]);
        for i in 0..10_000 {
            total.add(1.0 / f64::from(i + 1));
            assert!(total.partials.len() <= 1);
        }
        assert_eq!(total.value(), f64::INFINITY);
        assert_eq!(total.digits(), [f64::INFINITY]);
        let mut merged = sum(&[1.0, 1e-300]);
        merged.merge(&total);
        merged.add(-5.0);
        assert_eq!((merged.value(), merged.partials.len()), (f64::INFINITY, 0));
        assert_eq!(sum(&[-f64::MAX, -f64::MAX, 1.0]).value(), f64::NEG_INFINITY);
        merged.merge(&sum(&[-f64::MAX, -f64::MAX]));
        assert!(merged.value().is_nan());
    }

    /// Any order and any grouping give the same digits.
    #[test]
    fn order_leaves_no_trace() {
        let mut terms = vec![0.0; 3000];
        fill_normal(&mut stream(1, StreamId { run: 0, axis: 0, term: 0 }), &mut terms);
        for (i, x) in terms.iter_mut().enumerate() {
            *x *= 10f64.powi(i as i32 % 60 - 30);
        }
        let forward = sum(&terms);
        let backward = sum(&terms.iter().rev().copied().collect::<Vec<_>>());
        assert_eq!(forward.digits(), backward.digits());
        for cut in [1, 7, 1500, 2999] {
            let mut merged = sum(&terms[cut..]);
            merged.merge(&ExactSum::from_digits(&sum(&terms[..cut]).digits()));
            assert_eq!(merged.digits(), forward.digits(), "cut at {cut}");
        }
    }
}
