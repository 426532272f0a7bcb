//! The filter in two stages once its gains have settled: eight samples at a time.
//!
//! A linear recursion x ← A x + d z with ν̃ = z − h x gives eight innovations at once: ν̃ = O x + T z with rows −h
//! Aʲ of O and the lower triangular T of the responses −h Aʲ⁻¹⁻ⁱ d, and so, without another recursion, their sums up
//! to each sample, which are what the bias needs: b̂ = η/I with η ← η + (s/S̃) ν̃ (the information form of its
//! filter).

use pulp::{Simd, WithSimd};

/// Samples in one product.
const LANES: usize = 8;
/// Samples whose divisions are done at once.
const BLOCK: usize = 1024;

/// What eight samples in a row do to `N` states: every row of a column is one of them.
#[derive(Clone, Copy, Debug)]
struct Eight<const N: usize> {
    /// Columns of O and T, and of the sums over the samples before each.
    seen: [[f64; LANES]; N],
    response: [[f64; LANES]; LANES],
    seen_before: [[f64; LANES]; N],
    response_before: [[f64; LANES]; LANES],
    /// A⁸ by rows, and A⁷ d, A⁶ d … d for each state.
    power: [[f64; N]; N],
    driven: [[f64; LANES]; N],
}

/// The recursion with constant gains: `N` states and the bias.
#[derive(Clone, Debug)]
pub(super) struct Settled<const N: usize> {
    /// A = F (I − K h) by rows, d = F K, h.
    closed: [[f64; N]; N],
    driven: [f64; N],
    h: [f64; N],
    eight: Eight<N>,
    /// x(k|k−1) without the bias.
    pub(super) x: [f64; N],
    pub(super) bias: Bias,
}

/// The bias and what is known of it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bias {
    /// How ν̃ answers to it.
    pub(super) s: f64,
    /// 1/S̃.
    pub(super) weight: f64,
    /// Information on it before the first of these samples; infinite when it is known.
    pub(super) start: f64,
    /// Samples since.
    pub(super) steps: f64,
    /// b̂ of these samples is `before` + `drawn`/I, with `before` what a known bias is.
    pub(super) before: f64,
    pub(super) drawn: f64,
}

impl Bias {
    /// I = I₀ + k s²/S̃: by multiplication, so that many small additions do not round it away.
    #[inline(always)]
    pub(super) fn information(&self) -> f64 {
        self.start + self.steps * (self.s * self.s * self.weight)
    }

    /// b̂ with b̂ = `estimate` at information `start`.
    pub(super) fn new(s: f64, weight: f64, start: f64, estimate: f64) -> Bias {
        let (before, drawn) = if start.is_finite() { (0.0, estimate * start) } else { (estimate, 0.0) };
        Bias { s, weight, start, steps: 0.0, before, drawn }
    }

    pub(super) fn estimate(&self) -> f64 {
        if self.start.is_finite() { self.drawn / self.information() } else { self.before }
    }
}

impl<const N: usize> Settled<N> {
    pub(super) fn new(closed: [[f64; N]; N], driven: [f64; N], h: [f64; N], x: [f64; N], bias: Bias) -> Settled<N> {
        Settled { eight: eight(&closed, &driven, &h), closed, driven, h, x, bias }
    }

    /// ν̃, and the next prediction.
    #[inline(always)]
    fn step(&mut self, z: f64) -> f64 {
        step(&self.closed, &self.driven, &self.h, &mut self.x, z)
    }

    /// Writes ν and 1/S of at most [`BLOCK`] samples, hands back Σ ν²/S.
    #[inline(always)]
    fn block<S: Simd>(&mut self, simd: S, z: &[f64], innovation: &mut [f64], weight: &mut [f64]) -> f64 {
        // b̂ = b₀ + η/I before each sample; 1/S = I/(I + s²/S̃)/S̃
        let mut inverse = [0.0; BLOCK + 1];
        let bias = &mut self.bias;
        let more = bias.s * bias.s * bias.weight;
        if bias.start.is_finite() {
            let first = bias.information();
            for (k, inverse) in inverse.iter_mut().enumerate().take(z.len() + 1) {
                *inverse = 1.0 / (first + k as u32 as f64 * more);
            }
            for (k, (weight, inverse)) in weight.iter_mut().zip(&inverse[1..]).enumerate() {
                *weight = (first + k as u32 as f64 * more) * inverse * bias.weight;
            }
        } else {
            weight.fill(bias.weight);
        }
        let (s, gain, before) = (bias.s, bias.s * bias.weight, bias.before);
        let mut drawn = bias.drawn;
        let (eights, rest) = z.as_chunks::<LANES>();
        let (innovations, innovation_rest) = innovation.as_chunks_mut::<LANES>();
        let (weights, weight_rest) = weight.as_chunks::<LANES>();
        let mut squares = [0.0; LANES];
        for (((z, innovation), weight), k) in eights.iter().zip(innovations).zip(weights).zip((0..).step_by(LANES)) {
            let eight = &self.eight;
            let inverse = wide::<S>(&inverse[k..k + LANES]);
            let mut total = [0.0; LANES];
            for (p, inverse) in inverse.iter().enumerate() {
                // ν̃, and its sum over the samples before each
                let mut rest = simd.mul_f64s(simd.splat_f64s(z[0]), wide::<S>(&eight.response[0])[p]);
                let mut sums = simd.mul_f64s(simd.splat_f64s(z[0]), wide::<S>(&eight.response_before[0])[p]);
                for i in 1..LANES {
                    let z = simd.splat_f64s(z[i]);
                    rest = simd.add_f64s(rest, simd.mul_f64s(z, wide::<S>(&eight.response[i])[p]));
                    sums = simd.add_f64s(sums, simd.mul_f64s(z, wide::<S>(&eight.response_before[i])[p]));
                }
                for j in 0..N {
                    let x = simd.splat_f64s(self.x[j]);
                    rest = simd.add_f64s(rest, simd.mul_f64s(x, wide::<S>(&eight.seen[j])[p]));
                    sums = simd.add_f64s(sums, simd.mul_f64s(x, wide::<S>(&eight.seen_before[j])[p]));
                }
                let eta = simd.add_f64s(simd.splat_f64s(drawn), simd.mul_f64s(simd.splat_f64s(gain), sums));
                let estimate = simd.add_f64s(simd.splat_f64s(before), simd.mul_f64s(eta, *inverse));
                let v = simd.sub_f64s(rest, simd.mul_f64s(simd.splat_f64s(s), estimate));
                wide_mut::<S>(innovation)[p] = v;
                let square = simd.mul_f64s(simd.mul_f64s(v, v), wide::<S>(weight)[p]);
                let squares = &mut wide_mut::<S>(&mut squares)[p];
                *squares = simd.add_f64s(*squares, square);
                wide_mut::<S>(&mut total)[p] = simd.add_f64s(rest, sums);
            }
            drawn += gain * total[LANES - 1];
            let mut next = [0.0; N];
            for ((next, row), driven) in next.iter_mut().zip(&eight.power).zip(&eight.driven) {
                let products: [f64; LANES] = std::array::from_fn(|l| driven[l] * z[l]);
                let fours: [f64; 4] = std::array::from_fn(|l| products[l] + products[l + 4]);
                let mut sum = (fours[0] + fours[2]) + (fours[1] + fours[3]);
                for (a, x) in row.iter().zip(&self.x) {
                    sum += a * x;
                }
                *next = sum;
            }
            self.x = next;
        }
        let mut sum: f64 = squares.iter().sum();
        let inverse = &inverse[z.len() - rest.len()..];
        for (((z, innovation), weight), inverse) in rest.iter().zip(innovation_rest).zip(weight_rest).zip(inverse) {
            let rest = self.step(*z);
            *innovation = rest - s * (before + drawn * inverse);
            drawn += gain * rest;
            sum += *innovation * *innovation * weight;
        }
        self.bias.drawn = drawn;
        self.bias.steps += z.len() as f64;
        sum
    }
}

/// x ← A x + d z; hands back z − h x.
#[inline(always)]
fn step<const N: usize>(closed: &[[f64; N]; N], driven: &[f64; N], h: &[f64; N], x: &mut [f64; N], z: f64) -> f64 {
    let mut rest = z;
    for (h, x) in h.iter().zip(&*x) {
        rest -= h * x;
    }
    let mut next = driven.map(|d| d * z);
    for (next, row) in next.iter_mut().zip(closed) {
        for (a, x) in row.iter().zip(&*x) {
            *next += a * x;
        }
    }
    *x = next;
    rest
}

/// The recursion run on every unit of state and sample.
fn eight<const N: usize>(closed: &[[f64; N]; N], driven: &[f64; N], h: &[f64; N]) -> Eight<N> {
    let run = |mut x: [f64; N], z: [f64; LANES]| {
        let rest = z.map(|z| step(closed, driven, h, &mut x, z));
        let mut sum = 0.0;
        let before = rest.map(|rest| {
            let before = sum;
            sum += rest;
            before
        });
        (rest, before, x)
    };
    let states: [_; N] = std::array::from_fn(|j| run(unit(j), [0.0; LANES]));
    let samples: [_; LANES] = std::array::from_fn(|i| run([0.0; N], unit(i)));
    Eight {
        seen: states.map(|(rest, ..)| rest),
        response: samples.map(|(rest, ..)| rest),
        seen_before: states.map(|(_, before, _)| before),
        response_before: samples.map(|(_, before, _)| before),
        power: std::array::from_fn(|i| states.map(|(.., x)| x[i])),
        driven: std::array::from_fn(|i| samples.map(|(.., x)| x[i])),
    }
}

fn unit<const M: usize>(i: usize) -> [f64; M] {
    std::array::from_fn(|j| if i == j { 1.0 } else { 0.0 })
}

/// A stretch with settled gains, compiled for each instruction set; hands back Σ ν²/S.
pub(super) struct Run<'a, const N: usize> {
    pub(super) gains: &'a mut Settled<N>,
    pub(super) z: &'a [f64],
    pub(super) innovation: &'a mut [f64],
    pub(super) weight: &'a mut [f64],
}

impl<const N: usize> WithSimd for Run<'_, N> {
    type Output = f64;
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> f64 {
        let blocks = self.z.chunks(BLOCK).zip(self.innovation.chunks_mut(BLOCK)).zip(self.weight.chunks_mut(BLOCK));
        let mut sum = 0.0;
        for ((z, innovation), weight) in blocks {
            sum += self.gains.block(simd, z, innovation, weight);
        }
        sum
    }
}

/// Registers of a list.
#[inline(always)]
fn wide<S: Simd>(numbers: &[f64]) -> &[S::f64s] {
    S::as_simd_f64s(numbers).0
}

#[inline(always)]
fn wide_mut<S: Simd>(numbers: &mut [f64]) -> &mut [S::f64s] {
    S::as_mut_simd_f64s(numbers).0
}
