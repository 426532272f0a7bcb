//! The inner loops of the [`engine`](super::engine), compiled for each instruction set and chosen at run time.
//!
//! Every lane goes through the same operations in the same order whatever the width of the instructions, so the bits
//! are the same too; a product and a sum are never fused. A lane of eight numbers is `pieces` registers.

use pulp::{Simd, WithSimd};

use super::course::AxisCourse;
use super::lanes::{CHUNK, LANES, Lane, Transition, Truth};
use super::scratch::{ChannelSums, Observer, Runs, Scratch};
use super::sums::{NIS_BIN, NIS_BINS};

/// Registers of a list of lanes, `pieces` each.
#[inline(always)]
fn wide<S: Simd>(lanes: &[Lane]) -> &[S::f64s] {
    S::as_simd_f64s(lanes.as_flattened()).0
}

#[inline(always)]
fn wide_mut<S: Simd>(lanes: &mut [Lane]) -> &mut [S::f64s] {
    S::as_mut_simd_f64s(lanes.as_flattened_mut()).0
}

/// Registers of one lane.
#[inline(always)]
fn pieces<S: Simd>() -> usize {
    LANES / S::F64_LANES
}

/// x ← x + a b.
#[inline(always)]
fn add_product<S: Simd>(simd: S, x: &mut [S::f64s], a: &[S::f64s], b: &[S::f64s]) {
    for ((x, a), b) in x.iter_mut().zip(a).zip(b) {
        *x = simd.add_f64s(*x, simd.mul_f64s(*a, *b));
    }
}

/// Steps `step..stop` of a chunk.
pub(super) struct Stretch<'a, 'o, 'm> {
    pub(super) axis: &'a AxisCourse,
    pub(super) runs: &'a mut Runs<'m>,
    pub(super) scratch: &'a mut Scratch,
    pub(super) observer: Option<&'a mut (dyn Observer + 'o)>,
    pub(super) step: u64,
    pub(super) stop: u64,
}

impl WithSimd for Stretch<'_, '_, '_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let one = self.observer.is_none() && self.axis.channels.len() == 1 && self.axis.channels[0].every == 1;
        let n = self.runs.estimate.len();
        if !one || self.runs.truth.len() != n {
            return self.in_memory(simd);
        }
        // every state by itself: F diagonal, and noise that drives one state alone
        let (filter, truth) = (&self.scratch.f, &self.runs.model);
        let diagonal = filter.diagonal.len() == n && truth.f.diagonal.len() == n;
        let apart = diagonal && truth.process.iter().all(|column| column.len() == 1);
        match (n, apart) {
            (1, true) => self.in_registers::<S, 1, true>(simd),
            (2, true) => self.in_registers::<S, 2, true>(simd),
            (3, true) => self.in_registers::<S, 3, true>(simd),
            (4, true) => self.in_registers::<S, 4, true>(simd),
            (1, false) => self.in_registers::<S, 1, false>(simd),
            (2, false) => self.in_registers::<S, 2, false>(simd),
            (3, false) => self.in_registers::<S, 3, false>(simd),
            (4, false) => self.in_registers::<S, 4, false>(simd),
            _ => self.in_memory(simd),
        }
    }
}

impl Stretch<'_, '_, '_> {
    /// The same as [`in_memory`](Stretch::in_memory) for a filter and a truth of `N` states with one measurement at
    /// every step. `APART`: no state drives another.
    #[inline(always)]
    fn in_registers<S: Simd, const N: usize, const APART: bool>(self, simd: S) {
        let Stretch { axis, runs, scratch, observer: _, step: first, stop } = self;
        let Runs { model, truth: x, estimate, update, .. } = runs;
        let Scratch { f, h, process, noise, channels, judged, .. } = scratch;
        let (at, count) = ((first % CHUNK as u64) as usize, (stop - first) as usize);
        let y = &mut channels[0].y;
        let from = y.len();
        y.grow(count);
        let y = wide_mut::<S>(&mut y.lanes_mut()[from..][..count]);
        let noise = wide::<S>(&noise[0].lanes()[at..][..count]);
        let gains = &axis.gains.gains[*update * N..].as_chunks::<N>().0[..count];
        let weights = &axis.gains.weights[*update..][..count];
        *update += count;
        // the noise of each state; of those without, zero
        let mut roots = [[0.0; LANES]; N];
        let mut draws = [noise; N];
        for (column, numbers) in model.process.iter().zip(process.iter()).filter(|_| APART) {
            let (row, root) = column[0];
            (roots[row], draws[row]) = (root, wide::<S>(&numbers.lanes()[at..][..count]));
        }
        let mut judge = judged.as_mut().map(|judged| judged.of::<N>(first as usize, count));
        let size = judge.as_ref().map_or(0, |([of_truth, _], ..)| of_truth.len() / count.max(1));
        for p in 0..pieces::<S>() {
            let of = |lanes: &[Lane], i: usize| wide::<S>(lanes)[i * pieces::<S>() + p];
            let mut state: [S::f64s; N] = std::array::from_fn(|i| of(x, i));
            let mut found: [S::f64s; N] = std::array::from_fn(|i| of(estimate, i));
            let seen: [S::f64s; N] = std::array::from_fn(|i| of(&model.h[0], i));
            let looked: [S::f64s; N] = std::array::from_fn(|i| simd.splat_f64s(h[0][i]));
            let kept = |f: &Transition<Lane>, i: usize| if APART { of(&f.diagonal, i) } else { simd.splat_f64s(0.0) };
            let state_kept: [S::f64s; N] = std::array::from_fn(|i| kept(&model.f, i));
            let found_kept: [S::f64s; N] = std::array::from_fn(|i| kept(f, i));
            let roots: [S::f64s; N] = std::array::from_fn(|i| of(&roots, i));
            let root = of(&model.root_r, 0);
            for (k, (gain, weight)) in gains.iter().zip(weights).enumerate() {
                let place = k * pieces::<S>() + p;
                if first > 0 || k > 0 {
                    if APART {
                        for i in 0..N {
                            let kick = simd.mul_f64s(roots[i], draws[i][place]);
                            state[i] = simd.add_f64s(simd.mul_f64s(state[i], state_kept[i]), kick);
                            found[i] = simd.mul_f64s(found[i], found_kept[i]);
                        }
                    } else {
                        state = moved(simd, &model.f, &state, p);
                        found = moved(simd, f, &found, p);
                        for (column, numbers) in model.process.iter().zip(process.iter()) {
                            let draw = of(&numbers.lanes()[at + k..at + k + 1], 0);
                            for (row, root) in column {
                                let kick = simd.mul_f64s(of(std::slice::from_ref(root), 0), draw);
                                // a place that is not known to the compiler would keep all states in memory
                                for (i, state) in state.iter_mut().enumerate() {
                                    *state = if i == *row { simd.add_f64s(*state, kick) } else { *state };
                                }
                            }
                        }
                    }
                }
                let mut z = simd.splat_f64s(0.0);
                for (h, x) in seen.iter().zip(&state) {
                    z = simd.add_f64s(z, simd.mul_f64s(*h, *x));
                }
                let mut rest = simd.add_f64s(z, simd.mul_f64s(root, noise[place]));
                for (h, x) in looked.iter().zip(&found) {
                    rest = simd.sub_f64s(rest, simd.mul_f64s(*h, *x));
                }
                for (k, x) in gain.iter().zip(&mut found) {
                    *x = simd.add_f64s(*x, simd.mul_f64s(simd.splat_f64s(*k), rest));
                }
                y[place] = simd.mul_f64s(rest, simd.splat_f64s(*weight));
                if let Some(([of_truth, of_estimate], nees, used)) = &mut judge {
                    let a = &of_truth[k * size..][..size];
                    let found = if of_estimate.is_empty() {
                        let error = std::array::from_fn(|i| simd.sub_f64s(state[i], found[i]));
                        if size == N { squares(simd, &a[..N], &error) } else { squares(simd, a, &error) }
                    } else {
                        squares_apart(simd, a, &of_estimate[k * size..][..size], &state, &found)
                    };
                    let nees = &mut wide_mut::<S>(std::slice::from_mut(&mut nees[k]))[p];
                    *nees = simd.add_f64s(*nees, simd.mul_f64s(found, of(std::slice::from_ref(used), 0)));
                }
            }
            for i in 0..N {
                wide_mut::<S>(x)[i * pieces::<S>() + p] = state[i];
                wide_mut::<S>(estimate)[i * pieces::<S>() + p] = found[i];
            }
        }
    }

    #[inline(always)]
    fn in_memory<S: Simd>(self, simd: S) {
        let Stretch { axis, runs, scratch, mut observer, step: first, stop } = self;
        let Runs { model: truth, truth: x, estimate, update, .. } = runs;
        let Scratch { spare, f, h, process, noise, channels, judged, .. } = scratch;
        let n = axis.gains.states;
        for step in first..stop {
            let k = (step % CHUNK as u64) as usize;
            if step > 0 {
                apply(simd, &truth.f, x, spare);
                for (column, source) in truth.process.iter().zip(process.iter()) {
                    for (i, root) in column {
                        let (root, draw) = (std::slice::from_ref(root), &source.lanes()[k..k + 1]);
                        add_product(simd, wide_mut::<S>(&mut x[*i..i + 1]), wide::<S>(root), wide::<S>(draw));
                    }
                }
                apply(simd, f, estimate, spare);
            }
            for (c, channel) in axis.channels.iter().enumerate() {
                if channel.every != 1 && !step.is_multiple_of(channel.every) {
                    continue;
                }
                let gain = &axis.gains.gains[*update * n..][..n];
                let weight = axis.gains.weights[*update];
                *update += 1;
                let [mut z, mut innovation, mut y] = [[0.0; LANES]; 3];
                measure(simd, truth, c, x, &noise[c].lanes()[k], &mut z);
                innovate(simd, &h[c], gain, &z, estimate, &mut innovation);
                let weight = simd.splat_f64s(weight);
                let registers = wide_mut::<S>(std::slice::from_mut(&mut y)).iter_mut();
                for (y, v) in registers.zip(wide::<S>(std::slice::from_ref(&innovation))) {
                    *y = simd.mul_f64s(*v, weight);
                }
                channels[c].y.push(y);
                if let Some(observer) = &mut observer {
                    observer.update(c, &z, &innovation, &y);
                }
            }
            if let Some(judged) = &mut *judged {
                judged.errors(step as usize, x, estimate);
            }
            if let Some(observer) = &mut observer {
                observer.step(step, x, estimate);
            }
        }
    }
}

/// |A e|² of the rows of A.
#[inline(always)]
fn squares<S: Simd, const N: usize>(simd: S, rows: &[[f64; N]], error: &[S::f64s; N]) -> S::f64s {
    let mut sum = simd.splat_f64s(0.0);
    for row in rows {
        let mut u = simd.mul_f64s(simd.splat_f64s(row[0]), error[0]);
        for i in 1..N {
            u = simd.add_f64s(u, simd.mul_f64s(simd.splat_f64s(row[i]), error[i]));
        }
        sum = simd.add_f64s(sum, simd.mul_f64s(u, u));
    }
    sum
}

/// |A x − B x̂|² of the rows of A and B.
#[inline(always)]
fn squares_apart<S: Simd, const N: usize>(
    simd: S,
    of_truth: &[[f64; N]],
    of_estimate: &[[f64; N]],
    truth: &[S::f64s; N],
    estimate: &[S::f64s; N],
) -> S::f64s {
    let mut sum = simd.splat_f64s(0.0);
    for (a, b) in of_truth.iter().zip(of_estimate) {
        let mut u = simd.splat_f64s(0.0);
        for i in 0..N {
            u = simd.add_f64s(u, simd.mul_f64s(simd.splat_f64s(a[i]), truth[i]));
            u = simd.sub_f64s(u, simd.mul_f64s(simd.splat_f64s(b[i]), estimate[i]));
        }
        sum = simd.add_f64s(sum, simd.mul_f64s(u, u));
    }
    sum
}

/// F x, one register of every lane.
#[inline(always)]
fn moved<S: Simd, const N: usize>(simd: S, f: &Transition<Lane>, x: &[S::f64s; N], p: usize) -> [S::f64s; N] {
    let mut result = [simd.splat_f64s(0.0); N];
    for (row, column, value) in &f.entries {
        let value = wide::<S>(std::slice::from_ref(value))[p];
        result[*row] = simd.add_f64s(result[*row], simd.mul_f64s(value, x[*column]));
    }
    result
}

/// x ← F x.
#[inline(always)]
fn apply<S: Simd>(simd: S, f: &Transition<Lane>, x: &mut [Lane], spare: &mut [Lane]) {
    if f.diagonal.len() == x.len() {
        for (x, f) in wide_mut::<S>(x).iter_mut().zip(wide::<S>(&f.diagonal)) {
            *x = simd.mul_f64s(*x, *f);
        }
        return;
    }
    spare.fill([0.0; LANES]);
    for (i, j, f) in &f.entries {
        let f = std::slice::from_ref(f);
        add_product(simd, wide_mut::<S>(&mut spare[*i..i + 1]), wide::<S>(f), wide::<S>(&x[*j..j + 1]));
    }
    x.copy_from_slice(&spare[..x.len()]);
}

/// z = h x + √r · draw.
#[inline(always)]
fn measure<S: Simd>(simd: S, truth: &Truth, channel: usize, x: &[Lane], draw: &Lane, z: &mut Lane) {
    let (x, draw) = (wide::<S>(x), wide::<S>(std::slice::from_ref(draw)));
    let (h, root) = (wide::<S>(&truth.h[channel]), wide::<S>(&truth.root_r[channel..channel + 1]));
    for (p, z) in wide_mut::<S>(std::slice::from_mut(z)).iter_mut().enumerate() {
        let mut sum = simd.splat_f64s(0.0);
        for (h, x) in h.chunks_exact(pieces::<S>()).zip(x.chunks_exact(pieces::<S>())) {
            sum = simd.add_f64s(sum, simd.mul_f64s(h[p], x[p]));
        }
        *z = simd.add_f64s(sum, simd.mul_f64s(root[p], draw[p]));
    }
}

/// ν = z − h x, x ← x + K ν.
#[inline(always)]
fn innovate<S: Simd>(simd: S, h: &[f64], gain: &[f64], z: &Lane, x: &mut [Lane], innovation: &mut Lane) {
    let (z, x) = (wide::<S>(std::slice::from_ref(z)), wide_mut::<S>(x));
    for (p, innovation) in wide_mut::<S>(std::slice::from_mut(innovation)).iter_mut().enumerate() {
        let mut rest = z[p];
        for (h, x) in h.iter().zip(x.chunks_exact(pieces::<S>())) {
            rest = simd.sub_f64s(rest, simd.mul_f64s(simd.splat_f64s(*h), x[p]));
        }
        for (k, x) in gain.iter().zip(x.chunks_exact_mut(pieces::<S>())) {
            x[p] = simd.add_f64s(x[p], simd.mul_f64s(simd.splat_f64s(*k), rest));
        }
        *innovation = rest;
    }
}

/// sums ← sums + y² · weight.
pub(super) struct AddSquares<'a> {
    pub(super) y: &'a [Lane],
    pub(super) weight: &'a Lane,
    pub(super) sums: &'a mut [Lane],
}

impl WithSimd for AddSquares<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let weight = wide::<S>(std::slice::from_ref(self.weight));
        for (i, (sum, y)) in wide_mut::<S>(self.sums).iter_mut().zip(wide::<S>(self.y)).enumerate() {
            let square = simd.mul_f64s(*y, *y);
            *sum = simd.add_f64s(*sum, simd.mul_f64s(square, weight[i % pieces::<S>()]));
        }
    }
}

/// Adds the innovations of a chunk up and keeps the last ones.
pub(super) struct Absorb<'a> {
    pub(super) sums: &'a mut ChannelSums,
    /// Updates in a block.
    pub(super) base: u64,
    pub(super) histogram: [&'a mut [u32]; LANES],
}

impl WithSimd for Absorb<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Absorb { sums, base, histogram } = self;
        let (y, lags) = (&mut sums.y, sums.lags);
        let fresh = &y.lanes()[lags..];
        let mut squares = [[0.0; LANES]; CHUNK];
        for (square, y) in squares.as_flattened_mut().iter_mut().zip(fresh.as_flattened()) {
            *square = y * y;
        }
        let squares = &squares[..fresh.len()];
        add_up(simd, fresh, &mut sums.sum);
        add_up(simd, squares, &mut sums.squares);
        lag_products(simd, y.lanes(), lags, &mut sums.products);
        let mut bins = [[0_u32; LANES]; CHUNK];
        for (bin, square) in bins.as_flattened_mut().iter_mut().zip(squares.as_flattened()) {
            *bin = ((square / NIS_BIN) as u32).min(NIS_BINS as u32);
        }
        for (l, counts) in histogram.into_iter().enumerate() {
            for bins in &bins[..fresh.len()] {
                counts[bins[l] as usize] += 1;
            }
        }
        let mut rest = fresh;
        while !rest.is_empty() {
            let (some, later) = rest.split_at(rest.len().min((base - sums.filled) as usize));
            add_up(simd, some, &mut sums.block);
            sums.filled += some.len() as u64;
            if sums.filled == base {
                sums.blocks.push(sums.block);
                (sums.block, sums.filled) = ([0.0; LANES], 0);
            }
            rest = later;
        }
        y.keep_last(lags);
    }
}

/// Adds all numbers to the sum, one after the other.
#[inline(always)]
fn add_up<S: Simd>(simd: S, numbers: &[Lane], sum: &mut Lane) {
    for (p, sum) in wide_mut::<S>(std::slice::from_mut(sum)).iter_mut().enumerate() {
        for number in wide::<S>(numbers).chunks_exact(pieces::<S>()) {
            *sum = simd.add_f64s(*sum, number[p]);
        }
    }
}

/// Adds Σ y_k y_(k−h) of the fresh numbers, those after the first `lags`, to the products of lags 1, 2, … Lags are
/// taken some at a time, so that as many sums are under way at once.
#[inline(always)]
fn lag_products<S: Simd>(simd: S, y: &[Lane], lags: usize, products: &mut [Lane]) {
    let (some, rest) = products.as_chunks_mut::<5>();
    for (i, products) in some.iter_mut().enumerate() {
        lags_from(simd, y, lags, 5 * i + 1, products);
    }
    let done = 5 * some.len();
    for (i, product) in rest.iter_mut().enumerate() {
        lags_from(simd, y, lags, done + i + 1, std::array::from_mut(product));
    }
}

/// The same for `N` lags from h on.
#[inline(always)]
fn lags_from<S: Simd, const N: usize>(simd: S, y: &[Lane], lags: usize, h: usize, products: &mut [Lane; N]) {
    let count = y.len() - lags;
    let now = &y[lags..];
    let past: [&[Lane]; N] = std::array::from_fn(|i| &y[lags - h - i..][..count]);
    let products = wide_mut::<S>(products);
    for p in 0..pieces::<S>() {
        let mut sums = [simd.splat_f64s(0.0); N];
        for k in 0..count {
            let now = wide::<S>(&now[k..k + 1])[p];
            for (sum, past) in sums.iter_mut().zip(&past) {
                *sum = simd.add_f64s(*sum, simd.mul_f64s(now, wide::<S>(&past[k..k + 1])[p]));
            }
        }
        for (i, sum) in sums.into_iter().enumerate() {
            let product = &mut products[i * pieces::<S>() + p];
            *product = simd.add_f64s(*product, sum);
        }
    }
}
