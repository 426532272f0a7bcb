//! Squares of moving sums of second differences, for the modified Allan variance.

use rayon::prelude::*;

use crate::numerics::reduce::Sum;

/// Sums that are moved along from one that is computed anew; more where a sum is longer, so that starting costs as
/// much as moving at most.
const FEWEST: usize = 1 << 14;
/// Sums squared between two compensated additions.
const BLOCK: usize = 1024;

/// Σ_{j<count} (Σ_{i=j}^{j+m−1} z_i)², z the second differences of x at factor m.
///
/// The inner sum is moved along by z_{j+m} − z_j, plainly: over the stretch that one start serves rounding adds up
/// to less than its length in units of 2^−53 of the largest sum. Stretches are added in their order, whichever
/// thread did them.
pub(super) fn sum_of_squares(x: &[f64], count: usize, m: usize) -> f64 {
    let stretch = FEWEST.max(m);
    let parts: Vec<f64> = (0..count)
        .into_par_iter()
        .step_by(stretch)
        .map(|first| {
            let mut start = Sum::default();
            for i in first..first + m {
                start.add(second(x, i, m));
            }
            let mut moving = start.value();
            let mut total = Sum::default();
            let last = (first + stretch).min(count);
            for block in (first..last).step_by(BLOCK) {
                let mut squares = 0.0;
                for j in block..(block + BLOCK).min(last) {
                    squares += moving * moving;
                    // beyond the last sum there is nothing to move to
                    if j + 1 < count {
                        moving += second(x, j + m, m) - second(x, j, m);
                    }
                }
                total.add(squares);
            }
            total.value()
        })
        .collect();
    let mut total = Sum::default();
    parts.into_iter().for_each(|part| total.add(part));
    total.value()
}

pub(super) fn second(x: &[f64], k: usize, m: usize) -> f64 {
    (x[k + 2 * m] - x[k + m]) - (x[k + m] - x[k])
}
