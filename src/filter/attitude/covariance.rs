//! What a row does to the covariance, by columns, compiled for each instruction set: the same operations in the same
//! order in all of them. P stays exactly symmetric.

use pulp::{Arch, NullaryFnOnce};

use crate::filter::large::add_multiple;

/// P ← P − k phᵀ − ph kᵀ + s k kᵀ, Joseph's form for any gain k, as P − k uᵀ − u kᵀ with u = ph − ½ s k; `ph`
/// becomes u.
pub(super) fn take_in(p: &mut [f64], k: &[f64], ph: &mut [f64], s: f64) {
    Arch::new().dispatch(TakeIn { p, k, ph, s });
}

struct TakeIn<'a> {
    p: &'a mut [f64],
    k: &'a [f64],
    ph: &'a mut [f64],
    s: f64,
}

impl NullaryFnOnce for TakeIn<'_> {
    type Output = ();
    #[inline(always)]
    fn call(self) {
        let TakeIn { p, k, ph, s } = self;
        add_multiple(ph, -0.5 * s, k);
        for ((p, own_k), own_u) in p.chunks_exact_mut(k.len()).zip(k).zip(&*ph) {
            for ((p, k), u) in p.iter_mut().zip(k).zip(&*ph) {
                // a sum of two products is the same in either order
                *p -= k * own_u + u * own_k;
            }
        }
    }
}

/// The first three states gain A x of those behind them, A (3 × c, by columns): P_θθ + A P_xθ + P_θx Aᵀ + A P_xx Aᵀ,
/// P_xθ + P_xx Aᵀ. `w`: scratch of 3 n numbers.
pub(super) fn turn(p: &mut [f64], a: &[f64], w: &mut [f64]) {
    Arch::new().dispatch(Turn { p, a, w });
}

struct Turn<'a> {
    p: &'a mut [f64],
    a: &'a [f64],
    w: &'a mut [f64],
}

impl NullaryFnOnce for Turn<'_> {
    type Output = ();
    #[inline(always)]
    fn call(self) {
        let Turn { p, a, w } = self;
        let n = w.len() / 3;
        let a = a.as_chunks::<3>().0;
        // P Aᵀ
        w.fill(0.0);
        for (a, p) in a.iter().zip(p[3 * n..].chunks_exact(n)) {
            for (a, w) in a.iter().zip(w.chunks_exact_mut(n)) {
                add_multiple(w, *a, p);
            }
        }
        for i in 0..3 {
            for j in 0..=i {
                let squares: f64 = a.iter().zip(&w[n * i + 3..]).map(|(a, w)| w * a[j]).sum();
                p[i + n * j] += w[i + n * j] + w[j + n * i] + squares;
                p[j + n * i] = p[i + n * j];
            }
            for j in 3..n {
                p[j + n * i] += w[j + n * i];
                p[i + n * j] = p[j + n * i];
            }
        }
    }
}

/// P ← F P Fᵀ + `size` Q of the states from `first` on, F and Q (m × m) by columns; `w`: scratch of m n numbers.
pub(super) fn propagate(p: &mut [f64], n: usize, first: usize, f: &[f64], q: &[f64], size: f64, w: &mut [f64]) {
    Arch::new().dispatch(Propagate { p, n, first, f, q, size, w });
}

struct Propagate<'a> {
    p: &'a mut [f64],
    n: usize,
    first: usize,
    f: &'a [f64],
    q: &'a [f64],
    size: f64,
    w: &'a mut [f64],
}

impl NullaryFnOnce for Propagate<'_> {
    type Output = ();
    #[inline(always)]
    fn call(self) {
        let Propagate { p, n, first, f, q, size, w } = self;
        let m = f.len().isqrt();
        let w = &mut w[..m * n];
        // P Fᵀ of these columns
        w.fill(0.0);
        for (i, w) in w.chunks_exact_mut(n).enumerate() {
            for (k, p) in p[n * first..].chunks_exact(n).take(m).enumerate() {
                add_multiple(w, f[i + m * k], p);
            }
        }
        for (i, w) in w.chunks_exact(n).enumerate() {
            for (j, w) in w.iter().enumerate() {
                p[first + i + n * j] = *w;
            }
            p[n * (first + i)..][..n].copy_from_slice(w);
        }
        for i in 0..m {
            for j in 0..=i {
                let sum: f64 = (0..m).map(|k| f[i + m * k] * w[first + k + n * j]).sum();
                let value = sum + size * q[i + m * j];
                p[first + i + n * (first + j)] = value;
                p[first + j + n * (first + i)] = value;
            }
        }
    }
}
