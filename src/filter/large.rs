//! Steps of filters too large for registers: everything by columns, whose numbers stand side by side, compiled for
//! each instruction set.
//!
//! Operations and their order are the same for all of them, and so are the bits. Only one triangle of P is computed,
//! so it stays exactly symmetric.

use pulp::{Arch, NullaryFnOnce};

use super::measurement::{Measurement, Update};

/// y ← y + a x.
#[inline(always)]
pub(super) fn add_multiple(y: &mut [f64], a: f64, x: &[f64]) {
    for (y, x) in y.iter_mut().zip(x) {
        *y += a * x;
    }
}

/// The upper triangle from the lower.
#[inline(always)]
fn mirror(n: usize, p: &mut [f64]) {
    for j in 0..n {
        for i in j + 1..n {
            p[j + n * i] = p[i + n * j];
        }
    }
}

/// x ← F x, P ← F P Fᵀ + Q; F, Q, P by columns, `v` and `m` scratch of n and n² numbers.
pub(super) fn predict(f: &[f64], q: &[f64], x: &mut [f64], p: &mut [f64], v: &mut [f64], m: &mut [f64]) {
    Arch::new().dispatch(Predict { f, q, x, p, v, m });
}

struct Predict<'a> {
    f: &'a [f64],
    q: &'a [f64],
    x: &'a mut [f64],
    p: &'a mut [f64],
    v: &'a mut [f64],
    m: &'a mut [f64],
}

impl NullaryFnOnce for Predict<'_> {
    type Output = ();
    #[inline(always)]
    fn call(self) {
        let Predict { f, q, x, p, v, m } = self;
        let n = x.len();
        let column = |j: usize| &f[n * j..][..n];
        v.fill(0.0);
        for (j, x) in x.iter().enumerate() {
            add_multiple(v, *x, column(j));
        }
        x.copy_from_slice(v);
        for (m, p) in m.chunks_exact_mut(n).zip(p.chunks_exact(n)) {
            m.fill(0.0);
            for (k, p) in p.iter().enumerate() {
                add_multiple(m, *p, column(k));
            }
        }
        p.copy_from_slice(q);
        for (j, p) in p.chunks_exact_mut(n).enumerate() {
            for (k, m) in m.chunks_exact(n).enumerate() {
                add_multiple(&mut p[j..], f[j + n * k], &m[j..]);
            }
        }
        mirror(n, p);
    }
}

/// The same where F has few `entries` (row, column, value).
pub(super) fn predict_sparse(
    entries: &[(usize, usize, f64)],
    q: &[f64],
    x: &mut [f64],
    p: &mut [f64],
    v: &mut [f64],
    m: &mut [f64],
) {
    Arch::new().dispatch(PredictSparse { entries, q, x, p, v, m });
}

struct PredictSparse<'a> {
    entries: &'a [(usize, usize, f64)],
    q: &'a [f64],
    x: &'a mut [f64],
    p: &'a mut [f64],
    v: &'a mut [f64],
    m: &'a mut [f64],
}

impl NullaryFnOnce for PredictSparse<'_> {
    type Output = ();
    #[inline(always)]
    fn call(self) {
        let PredictSparse { entries, q, x, p, v, m } = self;
        let n = x.len();
        v.fill(0.0);
        for &(i, j, f) in entries {
            v[i] += f * x[j];
        }
        x.copy_from_slice(v);
        // P Fᵀ, column by column of Fᵀ
        m.fill(0.0);
        for &(i, j, f) in entries {
            add_multiple(&mut m[i * n..][..n], f, &p[j * n..][..n]);
        }
        // (F P Fᵀ)ᵀ = (P Fᵀ)ᵀ Fᵀ, which is the same again
        for (i, p) in p.chunks_exact_mut(n).enumerate() {
            for (p, m) in p.iter_mut().zip(m[i..].iter().step_by(n)) {
                *p = *m;
            }
        }
        m.copy_from_slice(q);
        for &(i, j, f) in entries {
            add_multiple(&mut m[i * n..][..n], f, &p[j * n..][..n]);
        }
        p.copy_from_slice(m);
        mirror(n, p);
    }
}

/// One scalar update, Joseph form; `v` and `m` are scratch of n and at least 2 n numbers.
pub(super) fn update(
    measurement: &Measurement<'_>,
    x: &mut [f64],
    p: &mut [f64],
    v: &mut [f64],
    m: &mut [f64],
) -> Update {
    Arch::new().dispatch(TakeIn { measurement, x, p, v, m })
}

struct TakeIn<'a> {
    measurement: &'a Measurement<'a>,
    x: &'a mut [f64],
    p: &'a mut [f64],
    v: &'a mut [f64],
    m: &'a mut [f64],
}

impl NullaryFnOnce for TakeIn<'_> {
    type Output = Update;
    #[inline(always)]
    fn call(self) -> Update {
        let TakeIn { measurement: &Measurement { h, r, z, gate }, x, p, v, m } = self;
        let n = x.len();
        // P hᵀ; most of h is zero
        v.fill(0.0);
        for (h, p) in h.iter().zip(p.chunks_exact(n)).filter(|(h, _)| **h != 0.0) {
            add_multiple(v, *h, p);
        }
        let (mut predicted, mut variance) = (0.0, r);
        for ((h, x), v) in h.iter().zip(&*x).zip(&*v) {
            predicted += h * x;
            variance += h * v;
        }
        let update = Update::new(z - predicted, variance, gate);
        if !update.accepted {
            return update;
        }
        let (gain, rest) = m[..2 * n].split_at_mut(n);
        let weight = 1.0 / variance;
        for (gain, v) in gain.iter_mut().zip(&*v) {
            *gain = v * weight;
        }
        add_multiple(x, update.innovation, gain);
        // T = (I − K h) P = P − K vᵀ; P ← T (I − K h)ᵀ + K r Kᵀ = T − (T hᵀ − K r) Kᵀ
        for (p, v) in p.chunks_exact_mut(n).zip(&*v) {
            add_multiple(p, -v, gain);
        }
        for (rest, gain) in rest.iter_mut().zip(&*gain) {
            *rest = -r * gain;
        }
        for (h, p) in h.iter().zip(p.chunks_exact(n)).filter(|(h, _)| **h != 0.0) {
            add_multiple(rest, *h, p);
        }
        for (j, (p, gain)) in p.chunks_exact_mut(n).zip(&*gain).enumerate() {
            add_multiple(&mut p[j..], -gain, &rest[j..]);
        }
        mirror(n, p);
        update
    }
}
