//! Several filters of one shape side by side over one log: covariances until they have settled, then constant gains.

#![allow(clippy::needless_range_loop, reason = "indices as in the equations")]

use nalgebra::DMatrix;
use pulp::{Arch, Simd, WithSimd};

use super::lane::{LANES, Lane, dot};
use super::settled::{self, COLUMNS, Samples, Settled, Totals, Transition};
use crate::filter::Kalman;
use crate::model::LinearModel;

/// Samples that go through at once.
pub(super) const BLOCK: usize = 1024;
/// The covariance has settled when no entry moves by more than this many roundings of its diagonal in a step.
const ROUNDINGS: f64 = 4.0 * f64::EPSILON;
/// Steps from one look at the covariance to the next.
const LOOK: usize = 16;
/// A product of variances whose logarithm is due.
const LARGE: f64 = 1e200;

/// Filters in progress. Lanes beyond the models repeat the last one.
pub(super) struct Bank {
    /// One per model: carries states and covariances over gaps.
    carriers: Vec<Kalman>,
    n: usize,
    /// The log, the constant and, with a slope, the ramp.
    columns: usize,
    f: Transition,
    q: Vec<Lane>,
    h: Vec<Lane>,
    r: Lane,
    inverse_r: Lane,
    /// P(k|k−1), by rows.
    p: Vec<Lane>,
    /// x(k|k−1) of every column, one after the other.
    x: Vec<Lane>,
    settled: Option<Settled>,
    /// ν of the constant, once it is constant.
    steady: Option<Lane>,
    /// Σ ν_i ν_j/S.
    pub(super) sums: [[Lane; COLUMNS]; COLUMNS],
    log_variance: Lane,
    /// Of S/r, whose logarithm is still to be added.
    product: Lane,
    pub(super) count: u64,
    scratch: Scratch,
}

/// Memory of a step, taken once.
struct Scratch {
    v: Vec<Lane>,
    w: Vec<Lane>,
    gain: Vec<Lane>,
    matrix: Vec<Lane>,
    before: Vec<Lane>,
}

impl Bank {
    /// One to [`LANES`] models of the same number of states.
    pub(super) fn new(models: &[LinearModel], slope: bool) -> Bank {
        let n = models[0].x0.len();
        let lane = |of: &dyn Fn(&LinearModel) -> f64| {
            let last = models.len() - 1;
            Lane(std::array::from_fn(|i| of(&models[i.min(last)])))
        };
        let matrix = |of: &dyn Fn(&LinearModel) -> &DMatrix<f64>| -> Vec<Lane> {
            (0..n * n).map(|k| lane(&|m: &LinearModel| of(m)[(k / n, k % n)])).collect()
        };
        let f = matrix(&|m| &m.f);
        let entry = |(k, v): (usize, &Lane)| (*v != Lane::ZERO).then_some((k / n, k % n, *v));
        let entries: Vec<(usize, usize, Lane)> = f.iter().enumerate().filter_map(entry).collect();
        let diagonal = entries.iter().all(|(i, j, _)| i == j).then(|| (0..n).map(|i| f[i * n + i]).collect());
        let columns = if slope { 3 } else { 2 };
        let mut x = vec![Lane::ZERO; columns * n];
        (0..n).for_each(|i| x[i] = lane(&|m| m.x0[i]));
        Bank {
            carriers: models.iter().map(Kalman::new).collect(),
            n,
            columns,
            f: Transition { entries, diagonal },
            q: matrix(&|m| &m.q),
            h: (0..n).map(|i| lane(&|m| m.h[(0, i)])).collect(),
            r: lane(&|m| m.r[(0, 0)]),
            inverse_r: lane(&|m| 1.0 / m.r[(0, 0)]),
            p: matrix(&|m| &m.p0),
            x,
            settled: None,
            steady: None,
            sums: [[Lane::ZERO; COLUMNS]; COLUMNS],
            log_variance: Lane::ZERO,
            product: Lane::all(1.0),
            count: 0,
            scratch: Scratch {
                v: vec![Lane::ZERO; n],
                w: vec![Lane::ZERO; n],
                gain: vec![Lane::ZERO; n],
                matrix: vec![Lane::ZERO; n * n],
                before: vec![Lane::ZERO; n * n],
            },
        }
    }

    /// Steps without a measurement; the cost grows with their logarithm.
    pub(super) fn pause(&mut self, steps: u64) {
        if steps == 0 {
            return;
        }
        let n = self.n;
        let last = self.carriers.len() - 1;
        for (lane, carrier) in self.carriers.iter_mut().enumerate() {
            // lanes beyond the models go with the last
            let lanes = lane..if lane == last { LANES } else { lane + 1 };
            for x in self.x.chunks_exact_mut(n) {
                carrier.p.iter_mut().zip(&self.p).for_each(|(to, from)| *to = from.0[lane]);
                carrier.x.iter_mut().zip(x.iter()).for_each(|(to, from)| *to = from.0[lane]);
                carrier.predict_many(steps);
                x.iter_mut().zip(carrier.x.iter()).for_each(|(to, from)| to.0[lanes.clone()].fill(*from));
            }
            // symmetric: by rows is by columns
            self.p.iter_mut().zip(carrier.p.iter()).for_each(|(to, from)| to.0[lanes.clone()].fill(*from));
        }
        (self.settled, self.steady) = (None, None);
    }

    /// At most [`BLOCK`] consecutive samples; those that are not finite are predicted over.
    pub(super) fn block(&mut self, samples: Samples<'_>) {
        Arch::new().dispatch(Pass { bank: self, samples });
    }

    /// `n`: of states, known to the compiler where they are few.
    #[inline(always)]
    fn pass(&mut self, n: usize, samples: Samples<'_>) {
        let length = samples.log.len();
        let mut at = 0;
        while at < length {
            if !samples.log[at].is_finite() {
                (self.settled, self.steady) = (None, None);
                self.predict(n);
                at += 1;
                continue;
            }
            if self.settled.is_some() {
                let end = samples.log[at..].iter().position(|z| !z.is_finite()).map_or(length, |bad| at + bad);
                self.constant_gain(samples.part(at, end));
                at = end;
                continue;
            }
            let usable = samples.log[at..length.min(at + LOOK)].iter().take_while(|z| z.is_finite()).count();
            self.moving_gain(n, samples.part(at, at + usable));
            at += usable;
            // P0 may be zero
            if self.count > 1 && self.is_still(n) {
                self.settled = Some(Settled::new(&self.f, &self.h, &self.p, self.r));
            }
        }
        self.take_logarithm();
    }

    /// Finite samples, each with its own gain.
    #[inline(always)]
    fn moving_gain(&mut self, n: usize, samples: Samples<'_>) {
        match (n, self.f.diagonal.is_some(), self.columns) {
            (1, true, 2) => self.few_modes::<1, 2>(samples),
            (1, true, _) => self.few_modes::<1, 3>(samples),
            (2, true, 2) => self.few_modes::<2, 2>(samples),
            (2, true, _) => self.few_modes::<2, 3>(samples),
            _ => {
                for k in 0..samples.log.len() {
                    if k + 1 == samples.log.len() {
                        self.scratch.before.copy_from_slice(&self.p);
                    }
                    self.update(n, [samples.log[k], 1.0, samples.ramp.get(k).copied().unwrap_or(0.0)]);
                    self.predict(n);
                }
            }
        }
    }

    /// [`Bank::update`] and [`Bank::predict`] in registers, for a diagonal F of few states.
    #[inline(always)]
    fn few_modes<const N: usize, const C: usize>(&mut self, samples: Samples<'_>) {
        let Some(diagonal) = &self.f.diagonal else { return };
        let (mut f, mut h, mut x) = ([Lane::ZERO; N], [Lane::ZERO; N], [[Lane::ZERO; N]; C]);
        let (mut p, mut q, mut before) = ([[Lane::ZERO; N]; N], [[Lane::ZERO; N]; N], [[Lane::ZERO; N]; N]);
        f.copy_from_slice(diagonal);
        h.copy_from_slice(&self.h);
        p.iter_mut().zip(self.p.chunks_exact(N)).for_each(|(to, from)| to.copy_from_slice(from));
        q.iter_mut().zip(self.q.chunks_exact(N)).for_each(|(to, from)| to.copy_from_slice(from));
        x.iter_mut().zip(self.x.chunks_exact(N)).for_each(|(to, from)| to.copy_from_slice(from));
        let (r, inverse_r, mut sums, mut product) = (self.r, self.inverse_r, [[Lane::ZERO; C]; C], self.product);
        for k in 0..samples.log.len() {
            before = p;
            let (mut v, mut variance) = ([Lane::ZERO; N], r);
            for i in 0..N {
                (0..N).for_each(|j| v[i] += p[i][j] * h[j]);
                variance += h[i] * v[i];
            }
            let inverse = Lane::all(1.0) / variance;
            let (mut gain, mut w) = ([Lane::ZERO; N], [Lane::ZERO; N]);
            for i in 0..N {
                gain[i] = v[i] * inverse;
                w[i] = r * gain[i];
                for j in 0..N {
                    p[i][j] = p[i][j] - gain[i] * v[j];
                    w[i] = w[i] - p[i][j] * h[j];
                }
            }
            for i in 0..N {
                for j in 0..=i {
                    let value = (p[i][j] + w[i] * gain[j]) * f[i] * f[j] + q[i][j];
                    (p[i][j], p[j][i]) = (value, value);
                }
            }
            let z = settled::entering::<C>(samples, k);
            let mut innovations = [Lane::ZERO; C];
            for c in 0..C {
                let mut predicted = h[0] * x[c][0];
                (1..N).for_each(|i| predicted += h[i] * x[c][i]);
                innovations[c] = z[c] - predicted;
                (0..N).for_each(|i| x[c][i] = f[i] * (x[c][i] + gain[i] * innovations[c]));
            }
            for i in 0..C {
                let weighted = innovations[i] * inverse;
                (0..=i).for_each(|j| sums[i][j] += weighted * innovations[j]);
            }
            product *= variance * inverse_r;
            if !product.all_at_most(Lane::all(LARGE)) {
                self.product = product;
                self.take_logarithm();
                product = self.product;
            }
        }
        self.product = product;
        self.count += samples.log.len() as u64;
        for i in 0..C {
            (0..=i).for_each(|j| self.sums[i][j] += sums[i][j]);
        }
        let back = |to: &mut [Lane], from: &[[Lane; N]]| {
            to.chunks_exact_mut(N).zip(from).for_each(|(to, from)| to.copy_from_slice(from));
        };
        back(&mut self.p, &p);
        back(&mut self.scratch.before, &before);
        back(&mut self.x, &x);
    }

    /// K = P hᵀ/S, P ← (I − K h) P (I − K h)ᵀ + K r Kᵀ, x ← x + K ν.
    #[inline(always)]
    fn update(&mut self, n: usize, z: [f64; COLUMNS]) {
        let (h, p) = (&self.h[..n], &mut self.p[..n * n]);
        let Scratch { v, w, gain, .. } = &mut self.scratch;
        let (v, w, gain) = (&mut v[..n], &mut w[..n], &mut gain[..n]);
        let mut variance = self.r;
        for i in 0..n {
            v[i] = dot(&p[i * n..][..n], h);
            variance += h[i] * v[i];
        }
        let inverse = Lane::all(1.0) / variance;
        (0..n).for_each(|i| gain[i] = v[i] * inverse);
        // A = P − K vᵀ, w = A hᵀ, P = A + (K r − w) Kᵀ
        for i in 0..n {
            w[i] = self.r * gain[i];
            for j in 0..n {
                p[i * n + j] = p[i * n + j] - gain[i] * v[j];
                w[i] = w[i] - p[i * n + j] * h[j];
            }
        }
        for i in 0..n {
            for j in 0..=i {
                let value = p[i * n + j] + w[i] * gain[j];
                p[i * n + j] = value;
                p[j * n + i] = value;
            }
        }
        let mut innovations = [Lane::ZERO; COLUMNS];
        for (c, x) in self.x.chunks_exact_mut(n).enumerate() {
            let innovation = Lane::all(z[c]) - dot(x, h);
            x.iter_mut().zip(&gain[..]).for_each(|(x, k)| *x += *k * innovation);
            innovations[c] = innovation;
        }
        for (i, (sums, v)) in self.sums.iter_mut().zip(innovations).take(self.columns).enumerate() {
            let weighted = v * inverse;
            for (sum, other) in sums.iter_mut().zip(innovations).take(i + 1) {
                *sum += weighted * other;
            }
        }
        self.product *= variance * self.inverse_r;
        if !self.product.all_at_most(Lane::all(LARGE)) {
            self.take_logarithm();
        }
        self.count += 1;
    }

    /// x ← F x, P ← F P Fᵀ + Q.
    #[inline(always)]
    fn predict(&mut self, n: usize) {
        let Scratch { v, matrix, .. } = &mut self.scratch;
        if let Some(f) = &self.f.diagonal {
            let (f, p, q) = (&f[..n], &mut self.p[..n * n], &self.q[..n * n]);
            for i in 0..n {
                self.x.chunks_exact_mut(n).for_each(|x| x[i] *= f[i]);
                for j in 0..=i {
                    let value = p[i * n + j] * f[i] * f[j] + q[i * n + j];
                    p[i * n + j] = value;
                    p[j * n + i] = value;
                }
            }
            return;
        }
        for x in self.x.chunks_exact_mut(n) {
            v.fill(Lane::ZERO);
            self.f.entries.iter().for_each(|(i, j, f)| v[*i] += *f * x[*j]);
            x.copy_from_slice(v);
        }
        matrix.fill(Lane::ZERO);
        for (i, j, f) in &self.f.entries {
            (0..n).for_each(|k| matrix[i * n + k] += *f * self.p[j * n + k]);
        }
        self.p.copy_from_slice(&self.q);
        for (i, j, f) in &self.f.entries {
            // the lower triangle, row k from column i
            (*i..n).for_each(|k| self.p[k * n + i] += *f * matrix[k * n + j]);
        }
        for i in 0..n {
            (0..i).for_each(|j| self.p[j * n + i] = self.p[i * n + j]);
        }
    }

    /// The covariance is that of the step before, in every lane.
    #[inline(always)]
    fn is_still(&self, n: usize) -> bool {
        let (p, before) = (&self.p[..n * n], &self.scratch.before[..n * n]);
        let entry = |(i, j): (usize, usize)| {
            let moved = p[i * n + j] - before[i * n + j];
            let scale = Lane::all(ROUNDINGS * ROUNDINGS) * p[i * n + i] * p[j * n + j];
            (moved * moved).all_at_most(scale)
        };
        (0..n).all(|i| (0..=i).all(|j| entry((i, j))))
    }

    /// Finite samples, after the covariance has settled.
    #[inline(always)]
    fn constant_gain(&mut self, samples: Samples<'_>) {
        let Some(settled) = &mut self.settled else { return };
        let n = self.n;
        let moving = if self.steady.is_some() { 1 } else { self.columns };
        let (length, before) = (samples.log.len(), self.x[n..2 * n].to_vec());
        let Totals { products, sum } = settled::run(settled, &self.f, &self.h, moving, &mut self.x, samples);
        let length_of_all = Lane::all(length as f64);
        match self.steady {
            Some(constant) => {
                self.sums[0][0] += products[0][0] * settled.inverse;
                self.sums[1][0] += constant * sum * settled.inverse;
                self.sums[1][1] += length_of_all * constant * constant * settled.inverse;
            }
            None => {
                for (i, (sums, products)) in self.sums.iter_mut().zip(&products).take(self.columns).enumerate() {
                    for (sum, product) in sums.iter_mut().zip(products).take(i + 1) {
                        *sum += *product * settled.inverse;
                    }
                }
            }
        }
        self.log_variance += length_of_all * settled.log_variance;
        self.count += length as u64;
        // a ramp never comes to rest
        if self.steady.is_none() && self.columns == 2 && 2 * length >= BLOCK {
            let after = &self.x[n..2 * n];
            let largest = after.iter().fold(Lane::ZERO, |largest, x| largest.max(x.abs())) * Lane::all(ROUNDINGS);
            if after.iter().zip(&before).all(|(a, b)| (*a - *b).abs().all_at_most(largest)) {
                self.steady = Some(Lane::all(1.0) - dot(after, &self.h));
            }
        }
    }

    #[inline(always)]
    fn take_logarithm(&mut self) {
        for (sum, product) in self.log_variance.0.iter_mut().zip(&mut self.product.0) {
            *sum += product.ln();
            *product = 1.0;
        }
    }

    /// Σ ln S of model `lane`.
    pub(super) fn log_variance(&self, lane: usize) -> f64 {
        self.log_variance.0[lane] + self.count as f64 * self.r.0[lane].ln()
    }
}

/// A block, compiled for the instruction set at hand; results are the same for all of them.
struct Pass<'a> {
    bank: &'a mut Bank,
    samples: Samples<'a>,
}

impl WithSimd for Pass<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        match self.bank.n {
            1 => self.bank.pass(1, self.samples),
            2 => self.bank.pass(2, self.samples),
            3 => self.bank.pass(3, self.samples),
            n => self.bank.pass(n, self.samples),
        }
    }
}
