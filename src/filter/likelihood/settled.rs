//! The loop over samples once gains are constant.

use super::lane::{Lane, dot};

/// The log, the constant and the ramp.
pub(super) const COLUMNS: usize = 3;

/// Samples as they enter: of the log, and of the ramp.
#[derive(Clone, Copy)]
pub(super) struct Samples<'a> {
    pub(super) log: &'a [f64],
    pub(super) ramp: &'a [f64],
}

impl Samples<'_> {
    pub(super) fn part(&self, from: usize, to: usize) -> Samples<'_> {
        Samples { log: &self.log[from..to], ramp: self.ramp.get(from..to).unwrap_or_default() }
    }
}

/// Constant gains.
pub(super) struct Settled {
    /// F (I − K h), by rows.
    closed: Vec<Lane>,
    /// F K.
    gain: Vec<Lane>,
    /// 1/S.
    pub(super) inverse: Lane,
    /// ln(S/r).
    pub(super) log_variance: Lane,
    /// F x.
    spare: Vec<Lane>,
}

/// Of some samples.
pub(super) struct Totals {
    /// Σ ν_i ν_j, j ≤ i.
    pub(super) products: [[Lane; COLUMNS]; COLUMNS],
    /// Σ ν of the log.
    pub(super) sum: Lane,
}

/// F of one shape: its entries that are not zero, by rows, and its diagonal where there is nothing else.
pub(super) struct Transition {
    pub(super) entries: Vec<(usize, usize, Lane)>,
    pub(super) diagonal: Option<Vec<Lane>>,
}

impl Settled {
    /// `p`: P(k|k−1).
    pub(super) fn new(f: &Transition, h: &[Lane], p: &[Lane], r: Lane) -> Settled {
        let n = h.len();
        let v: Vec<Lane> = p.chunks_exact(n).map(|row| dot(row, h)).collect();
        let variance = dot(&v, h) + r;
        let (mut closed, mut gain) = (vec![Lane::ZERO; n * n], vec![Lane::ZERO; n]);
        for (i, j, f) in &f.entries {
            gain[*i] += *f * v[*j] / variance;
            closed[i * n + j] = *f;
        }
        for i in 0..n {
            (0..n).for_each(|j| closed[i * n + j] = closed[i * n + j] - gain[i] * h[j]);
        }
        let inverse = Lane::all(1.0) / variance;
        let log_variance = Lane(std::array::from_fn(|i| (variance.0[i] / r.0[i]).ln()));
        Settled { closed, gain, inverse, log_variance, spare: vec![Lane::ZERO; n] }
    }
}

/// Takes the first `columns` columns of `x`, x(k|k−1), through the samples.
#[inline(always)]
pub(super) fn run(
    settled: &mut Settled,
    f: &Transition,
    h: &[Lane],
    columns: usize,
    x: &mut [Lane],
    samples: Samples<'_>,
) -> Totals {
    let Settled { closed, gain, spare, .. } = settled;
    match (h.len(), &f.diagonal, columns) {
        (1, _, 1) => closed_loop::<1, 1>(closed, gain, h, x, samples),
        (1, _, 2) => closed_loop::<1, 2>(closed, gain, h, x, samples),
        (1, _, _) => closed_loop::<1, 3>(closed, gain, h, x, samples),
        (2, _, 1) => closed_loop::<2, 1>(closed, gain, h, x, samples),
        (2, _, 2) => closed_loop::<2, 2>(closed, gain, h, x, samples),
        (2, _, _) => closed_loop::<2, 3>(closed, gain, h, x, samples),
        (3, Some(f), 1) => modes::<3, 1>(f, gain, h, x, samples),
        (3, Some(f), 3) => modes::<3, 3>(f, gain, h, x, samples),
        (4, Some(f), 1) => modes::<4, 1>(f, gain, h, x, samples),
        (5, Some(f), 1) => modes::<5, 1>(f, gain, h, x, samples),
        (6, Some(f), 1) => modes::<6, 1>(f, gain, h, x, samples),
        _ => any(&f.entries, gain, h, columns, x, spare, samples),
    }
}

/// The columns as they enter at step `k`.
#[inline(always)]
pub(super) fn entering<const C: usize>(samples: Samples<'_>, k: usize) -> [Lane; C] {
    let mut z = [Lane::ZERO; C];
    for (c, z) in z.iter_mut().enumerate() {
        *z = Lane::all(match c {
            0 => samples.log[k],
            1 => 1.0,
            _ => samples.ramp[k],
        });
    }
    z
}

#[inline(always)]
fn add<const C: usize>(products: &mut [[Lane; C]; C], sum: &mut Lane, innovations: &[Lane; C]) {
    *sum += innovations[0];
    for i in 0..C {
        for j in 0..=i {
            products[i][j] += innovations[i] * innovations[j];
        }
    }
}

fn totals<const C: usize>(of: &[[Lane; C]; C], sum: Lane) -> Totals {
    let mut products = [[Lane::ZERO; COLUMNS]; COLUMNS];
    for (to, from) in products.iter_mut().zip(of) {
        to[..C].copy_from_slice(from);
    }
    Totals { products, sum }
}

/// x ← F (I − K h) x + F K z: few states, whose chain from sample to sample is a product and a sum.
#[inline(always)]
fn closed_loop<const N: usize, const C: usize>(
    closed: &[Lane],
    gain: &[Lane],
    h: &[Lane],
    x: &mut [Lane],
    samples: Samples<'_>,
) -> Totals {
    let mut a = [[Lane::ZERO; N]; N];
    let (mut g, mut row, mut now) = ([Lane::ZERO; N], [Lane::ZERO; N], [[Lane::ZERO; N]; C]);
    g.copy_from_slice(gain);
    row.copy_from_slice(h);
    for (to, from) in a.iter_mut().zip(closed.chunks_exact(N)) {
        to.copy_from_slice(from);
    }
    for (to, from) in now.iter_mut().zip(x.chunks_exact(N)) {
        to.copy_from_slice(from);
    }
    let (mut products, mut sum) = ([[Lane::ZERO; C]; C], Lane::ZERO);
    for k in 0..samples.log.len() {
        let z = entering::<C>(samples, k);
        let mut innovations = [Lane::ZERO; C];
        for c in 0..C {
            let mut predicted = row[0] * now[c][0];
            for i in 1..N {
                predicted += row[i] * now[c][i];
            }
            innovations[c] = z[c] - predicted;
            let mut next = [Lane::ZERO; N];
            for i in 0..N {
                let mut value = g[i] * z[c];
                for j in 0..N {
                    value += a[i][j] * now[c][j];
                }
                next[i] = value;
            }
            now[c] = next;
        }
        add(&mut products, &mut sum, &innovations);
    }
    for (from, to) in now.iter().zip(x.chunks_exact_mut(N)) {
        to.copy_from_slice(from);
    }
    totals(&products, sum)
}

/// x_i ← f_i x_i + (F K)_i ν: states that only meet in the measurement.
#[inline(always)]
fn modes<const N: usize, const C: usize>(
    f: &[Lane],
    gain: &[Lane],
    h: &[Lane],
    x: &mut [Lane],
    samples: Samples<'_>,
) -> Totals {
    let (mut a, mut g, mut row, mut now) = ([Lane::ZERO; N], [Lane::ZERO; N], [Lane::ZERO; N], [[Lane::ZERO; N]; C]);
    a.copy_from_slice(f);
    g.copy_from_slice(gain);
    row.copy_from_slice(h);
    for (to, from) in now.iter_mut().zip(x.chunks_exact(N)) {
        to.copy_from_slice(from);
    }
    let (mut products, mut sum) = ([[Lane::ZERO; C]; C], Lane::ZERO);
    for k in 0..samples.log.len() {
        let mut innovations = entering::<C>(samples, k);
        for c in 0..C {
            let mut predicted = row[0] * now[c][0];
            for i in 1..N {
                predicted += row[i] * now[c][i];
            }
            innovations[c] = innovations[c] - predicted;
            for i in 0..N {
                now[c][i] = a[i] * now[c][i] + g[i] * innovations[c];
            }
        }
        add(&mut products, &mut sum, &innovations);
    }
    for (from, to) in now.iter().zip(x.chunks_exact_mut(N)) {
        to.copy_from_slice(from);
    }
    totals(&products, sum)
}

/// The same for any F.
#[inline(always)]
fn any(
    f: &[(usize, usize, Lane)],
    gain: &[Lane],
    h: &[Lane],
    columns: usize,
    x: &mut [Lane],
    spare: &mut [Lane],
    samples: Samples<'_>,
) -> Totals {
    let n = h.len();
    let (mut products, mut sum) = ([[Lane::ZERO; COLUMNS]; COLUMNS], Lane::ZERO);
    for k in 0..samples.log.len() {
        let z = if columns > 2 {
            entering::<3>(samples, k)
        } else {
            [Lane::all(samples.log[k]), Lane::all(1.0), Lane::ZERO]
        };
        let mut innovations = [Lane::ZERO; COLUMNS];
        for (c, x) in x.chunks_exact_mut(n).take(columns).enumerate() {
            innovations[c] = z[c] - dot(x, h);
            for (to, g) in spare.iter_mut().zip(gain) {
                *to = *g * innovations[c];
            }
            for (i, j, f) in f {
                spare[*i] += *f * x[*j];
            }
            x.copy_from_slice(spare);
        }
        add(&mut products, &mut sum, &innovations);
    }
    Totals { products, sum }
}
