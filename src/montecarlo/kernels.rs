//! The inner loops of [`lanes`](super::lanes), compiled for each instruction set and chosen at run time.
//!
//! Every lane goes through the same operations in the same order whatever the width of the instructions, so the bits are the same too; a
//! product and a sum are never fused. A lane of eight numbers is `pieces` registers.

use pulp::{NullaryFnOnce, Simd, WithSimd};

use super::course::AxisCourse;
use super::lanes::{CHUNK, ChannelSums, LANES, Lane, Observer, Scratch, Transition, Truth};
use super::sums::{NIS_BIN, NIS_BINS};
use crate::numerics::normals::Normals;

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

/// Fresh numbers of a source of noise.
pub(super) struct Draw<'a> {
    pub(super) normals: &'a mut Normals<LANES>,
    pub(super) words: &'a mut [[u64; LANES]],
    pub(super) numbers: &'a mut [Lane],
}

impl NullaryFnOnce for Draw<'_> {
    type Output = ();
    #[inline(always)]
    fn call(self) {
        self.normals.fill(self.words, self.numbers);
    }
}

/// Steps `step..stop` of a chunk; hands back the number of updates so far.
pub(super) struct Stretch<'a, 'o> {
    pub(super) axis: &'a AxisCourse,
    pub(super) truth: &'a Truth,
    pub(super) scratch: &'a mut Scratch,
    pub(super) observer: Option<&'a mut (dyn Observer + 'o)>,
    pub(super) step: u64,
    pub(super) stop: u64,
    pub(super) update: usize,
}

impl WithSimd for Stretch<'_, '_> {
    type Output = usize;
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> usize {
        let one = self.observer.is_none() && self.axis.channels.len() == 1 && self.axis.channels[0].every == 1;
        match (self.scratch.estimate.len(), self.scratch.truth.len()) {
            (1, 1) if one => self.in_registers::<S, 1>(simd),
            (2, 2) if one => self.in_registers::<S, 2>(simd),
            (3, 3) if one => self.in_registers::<S, 3>(simd),
            (4, 4) if one => self.in_registers::<S, 4>(simd),
            _ => self.in_memory(simd),
        }
    }
}

impl Stretch<'_, '_> {
    /// The same as [`in_memory`](Stretch::in_memory) for a filter and a truth of `N` states with one measurement at every step.
    #[inline(always)]
    fn in_registers<S: Simd, const N: usize>(self, simd: S) -> usize {
        let Stretch { axis, truth, scratch, observer: _, step: first, stop, update } = self;
        let Scratch { truth: x, estimate, f, h, process, noise, channels, judged, .. } = scratch;
        let y = &mut channels[0].y;
        let from = y.len();
        let at = (first % CHUNK as u64) as usize;
        let count = (stop - first) as usize;
        y.grow(count);
        let y = wide_mut::<S>(&mut y.lanes_mut()[from..]);
        let noise = wide::<S>(&noise[0].numbers.lanes()[at..at + count]);
        let gains = axis.gains.gains[update * N..].as_chunks::<N>().0;
        let weights = &axis.gains.weights[update..update + count];
        let diagonal = f.diagonal.len() == N && truth.f.diagonal.len() == N;
        let h: [S::f64s; N] = std::array::from_fn(|i| simd.splat_f64s(h[0][i]));
        for p in 0..pieces::<S>() {
            let of = |lanes: &[Lane], i: usize| wide::<S>(lanes)[i * pieces::<S>() + p];
            let mut state: [S::f64s; N] = std::array::from_fn(|i| of(x, i));
            let mut found: [S::f64s; N] = std::array::from_fn(|i| of(estimate, i));
            let seen: [S::f64s; N] = std::array::from_fn(|i| of(&truth.h[0], i));
            let root = of(&truth.root_r, 0);
            for k in 0..count {
                if first > 0 || k > 0 {
                    if diagonal {
                        for i in 0..N {
                            state[i] = simd.mul_f64s(state[i], of(&truth.f.diagonal, i));
                            found[i] = simd.mul_f64s(found[i], of(&f.diagonal, i));
                        }
                    } else {
                        state = moved(simd, &truth.f, &state, p);
                        found = moved(simd, f, &found, p);
                    }
                    for (column, source) in truth.process.iter().zip(process.iter()) {
                        let draw = of(&source.numbers.lanes()[at + k..at + k + 1], 0);
                        for (row, root) in column {
                            let root = of(std::slice::from_ref(root), 0);
                            for (i, state) in state.iter_mut().enumerate() {
                                if i == *row {
                                    *state = simd.add_f64s(*state, simd.mul_f64s(root, draw));
                                }
                            }
                        }
                    }
                }
                let mut z = simd.splat_f64s(0.0);
                for (h, x) in seen.iter().zip(&state) {
                    z = simd.add_f64s(z, simd.mul_f64s(*h, *x));
                }
                let mut rest = simd.add_f64s(z, simd.mul_f64s(root, noise[k * pieces::<S>() + p]));
                for (h, x) in h.iter().zip(&found) {
                    rest = simd.sub_f64s(rest, simd.mul_f64s(*h, *x));
                }
                for (k, x) in gains[k].iter().zip(&mut found) {
                    *x = simd.add_f64s(*x, simd.mul_f64s(simd.splat_f64s(*k), rest));
                }
                let normalised = simd.mul_f64s(rest, simd.splat_f64s(weights[k]));
                y[k * pieces::<S>() + p] = normalised;
                if let Some(judged) = &mut *judged {
                    let step = first as usize + k;
                    let size = judged.components;
                    let rows = judged.whiten[step * size * 2 * N..][..size * 2 * N].as_chunks::<N>().0;
                    let (of_truth, of_estimate) = rows.split_at(size);
                    let mut nees = simd.splat_f64s(0.0);
                    for (a, b) in of_truth.iter().zip(of_estimate) {
                        let mut u = simd.splat_f64s(0.0);
                        for i in 0..N {
                            u = simd.add_f64s(u, simd.mul_f64s(simd.splat_f64s(a[i]), state[i]));
                            u = simd.sub_f64s(u, simd.mul_f64s(simd.splat_f64s(b[i]), found[i]));
                        }
                        nees = simd.add_f64s(nees, simd.mul_f64s(u, u));
                    }
                    wide_mut::<S>(&mut judged.nees.lanes_mut()[step % CHUNK..][..1])[p] = nees;
                }
            }
            for i in 0..N {
                wide_mut::<S>(x)[i * pieces::<S>() + p] = state[i];
                wide_mut::<S>(estimate)[i * pieces::<S>() + p] = found[i];
            }
        }
        update + count
    }

    #[inline(always)]
    fn in_memory<S: Simd>(self, simd: S) -> usize {
        let Stretch { axis, truth, scratch, mut observer, step: first, stop, mut update } = self;
        let Scratch { truth: x, estimate, spare, f, h, process, noise, channels, judged, .. } = scratch;
        let n = axis.gains.states;
        for step in first..stop {
            let k = (step % CHUNK as u64) as usize;
            if step > 0 {
                apply(simd, &truth.f, x, spare);
                for (column, source) in truth.process.iter().zip(process.iter()) {
                    for (i, root) in column {
                        let (root, draw) = (std::slice::from_ref(root), &source.numbers.lanes()[k..k + 1]);
                        add_product(simd, wide_mut::<S>(&mut x[*i..i + 1]), wide::<S>(root), wide::<S>(draw));
                    }
                }
                apply(simd, f, estimate, spare);
            }
            for (c, channel) in axis.channels.iter().enumerate() {
                if channel.every != 1 && !step.is_multiple_of(channel.every) {
                    continue;
                }
                let gain = &axis.gains.gains[update * n..][..n];
                let weight = axis.gains.weights[update];
                update += 1;
                let [mut z, mut innovation, mut y] = [[0.0; LANES]; 3];
                measure(simd, truth, c, x, &noise[c].numbers.lanes()[k], &mut z);
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
        update
    }
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

/// Adds Σ y_k y_(k−h) of the fresh numbers, those after the first `lags`, to the products of lags 1, 2, … Lags are taken some at a time, so
/// that as many sums are under way at once.
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
