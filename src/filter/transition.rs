//! Products with F that skip its zeros: a line of vibration has a block of its own, so that F of many states is
//! nearly empty.

use nalgebra::DMatrix;

use super::large;

/// Fewer states are faster with loops of known size.
const FEWEST: usize = 7;

/// The entries of a square F that are not zero.
#[derive(Clone, Debug)]
pub(super) struct SparseTransition {
    n: usize,
    /// By columns of F: (row, column, value).
    entries: Vec<(usize, usize, f64)>,
}

impl SparseTransition {
    /// `None` where it would not pay.
    pub(super) fn new(f: &DMatrix<f64>) -> Option<SparseTransition> {
        let n = f.nrows();
        let all = (0..n).flat_map(|j| (0..n).map(move |i| (i, j)));
        let entries: Vec<_> = all.map(|(i, j)| (i, j, f[(i, j)])).filter(|entry| entry.2 != 0.0).collect();
        (n >= FEWEST && 4 * entries.len() <= n * n).then_some(SparseTransition { n, entries })
    }

    /// out = F A, both by columns of n numbers.
    pub(super) fn times(&self, a: &[f64], out: &mut [f64]) {
        for (a, out) in a.chunks_exact(self.n).zip(out.chunks_exact_mut(self.n)) {
            out.fill(0.0);
            for &(i, j, f) in &self.entries {
                out[i] += f * a[j];
            }
        }
    }

    /// x ← F x, P ← F P Fᵀ + Q by columns; exactly symmetric when Q is. `v`: n numbers, `m`: n².
    pub(super) fn predict(&self, q: &[f64], x: &mut [f64], p: &mut [f64], v: &mut [f64], m: &mut [f64]) {
        large::predict_sparse(&self.entries, q, x, p, v, m);
    }
}
