//! Discrete Fourier transform of many numbers without large tables, on any number of threads.
//!
//! X_k = Σ_j x_j e^{−2πijk/m}. With m = a b, j = b j₁ + j₂ and k = k₁ + a k₂ this is b transforms of length a,
//! factors e^{−2πi j₂k₁/m}, and a transforms of length b, so that plans are made for lengths near √m alone: a plan
//! for half a million points costs more than two transforms of them. Where m has no such factors, a convolution on a
//! length that has. Every number is computed in the same way whatever the threads. Sources: Cooley & Tukey 1965;
//! Bailey 1990 (four steps); Bluestein 1970.

use std::f64::consts::PI;
use std::ops::Range;
use std::sync::Arc;

use rayon::prelude::*;
use rustfft::num_complex::Complex;
use rustfft::{Fft, FftDirection, FftPlanner};

use crate::numerics::progress::checkpoint;

/// Columns that are transformed together: two cache lines of every row.
const TILE: usize = 8;
/// The smaller factor at least.
const SHORTEST: usize = 64;
/// Factors of so many neighbours are made of one.
const RUN: usize = 32;
/// Shorter transforms are not worth the trouble.
pub(super) const FEWEST: usize = 8192;
const ZERO: Complex<f64> = Complex::new(0.0, 0.0);

/// e^{−2πik/m} from two tables of about √m numbers, right to 1e-15.
pub(crate) struct Roots {
    fine: Vec<Complex<f64>>,
    coarse: Vec<Complex<f64>>,
}

impl Roots {
    pub(crate) fn new(m: usize) -> Roots {
        let step = m.isqrt().max(1);
        let root = |k: usize| {
            let (sin, cos) = (-2.0 * PI * k as f64 / m as f64).sin_cos();
            Complex::new(cos, sin)
        };
        Roots { fine: (0..step).map(root).collect(), coarse: (0..=m / step).map(|i| root(i * step)).collect() }
    }

    /// `k` at most m.
    pub(super) fn at(&self, k: usize) -> Complex<f64> {
        self.fine[k % self.fine.len()] * self.coarse[k / self.fine.len()]
    }

    /// Calls `visit(i, root)` for `count` roots, number `first` + `by` i each, up to m.
    pub(crate) fn walk(&self, first: usize, by: usize, count: usize, mut visit: impl FnMut(usize, Complex<f64>)) {
        let run = RUN.min(count);
        let fine: [Complex<f64>; RUN] = std::array::from_fn(|i| if i < run { self.at(by * i) } else { ZERO });
        for start in (0..count).step_by(RUN) {
            let coarse = self.at(first + by * start);
            let last = RUN.min(count - start);
            fine[..last].iter().enumerate().for_each(|(i, fine)| visit(start + i, coarse * fine));
        }
    }

    /// v_k ← v_k e^{−2πi by k/m}, or by its conjugate.
    fn turn(&self, values: &mut [Complex<f64>], by: usize, back: bool) {
        self.walk(0, by, values.len(), |k, root| values[k] *= if back { root.conj() } else { root });
    }
}

/// X_k, k below m.
pub(super) struct Spectrum {
    /// X_k with k = k₁ + a k₂ is number b k₁ + k₂.
    values: Vec<Complex<f64>>,
    a: usize,
    b: usize,
}

impl Spectrum {
    /// `x`: number j of `m`; `None` where m is too small.
    pub(super) fn new(m: usize, x: impl Fn(usize) -> Complex<f64> + Sync) -> Option<Spectrum> {
        if m < FEWEST {
            return None;
        }
        match FourSteps::new(m) {
            Some(steps) => Some(Spectrum { values: steps.forward(x, &mut Vec::new()), a: steps.a, b: steps.b }),
            None => Some(Spectrum { values: chirp(m, x)?, a: 1, b: m }),
        }
    }

    /// Calls `visit(k, X_k, X_{m−k})` for k = a c + r, c in `columns`, r below a; X_m is X_0. Rows are read along.
    pub(super) fn pairs(&self, columns: Range<usize>, mut visit: impl FnMut(usize, usize, Complex<f64>, Complex<f64>)) {
        let (a, b) = (self.a, self.b);
        for r in 0..a {
            let (row, mirror) = (&self.values[r * b..][..b], &self.values[(a - r) % a * b..][..b]);
            for c in columns.clone() {
                visit(c, r, row[c], mirror[if r == 0 { (b - c) % b } else { b - 1 - c }]);
            }
        }
    }

    pub(super) fn first(&self) -> Complex<f64> {
        self.values[0]
    }

    /// a and b: k = r + a c with r below a and c below b.
    pub(super) fn shape(&self) -> (usize, usize) {
        (self.a, self.b)
    }
}

/// Transforms of one length m = a b.
struct FourSteps {
    a: usize,
    b: usize,
    roots: Roots,
}

impl FourSteps {
    /// `None` where m has no factors to split it by.
    fn new(m: usize) -> Option<FourSteps> {
        let a = (SHORTEST..=m.isqrt()).rev().find(|a| m.is_multiple_of(*a))?;
        Some(FourSteps { a, b: m / a, roots: Roots::new(m) })
    }

    fn plans(&self, direction: FftDirection) -> [Arc<dyn Fft<f64>>; 2] {
        let mut planner = FftPlanner::new();
        [self.a, self.b].map(|length| planner.plan_fft(length, direction))
    }

    /// Rows of equal k₁; `tiles` is memory that is used on the way.
    fn forward(&self, x: impl Fn(usize) -> Complex<f64> + Sync, tiles: &mut Vec<Complex<f64>>) -> Vec<Complex<f64>> {
        let (a, b) = (self.a, self.b);
        let [of_columns, of_rows] = self.plans(FftDirection::Forward);
        tiles.resize(a * b, ZERO);
        let memory = || (vec![ZERO; a * TILE], vec![ZERO; of_columns.get_inplace_scratch_len()]);
        tiles.par_chunks_mut(a * TILE).enumerate().for_each_init(memory, |(columns, scratch), (tile, out)| {
            checkpoint();
            let (width, first) = (out.len() / a, tile * TILE);
            for j in 0..a {
                (0..width).for_each(|t| columns[t * a + j] = x(b * j + first + t));
            }
            of_columns.process_with_scratch(&mut columns[..a * width], scratch);
            for (t, column) in columns.chunks_exact_mut(a).take(width).enumerate() {
                self.roots.turn(column, first + t, false);
                out[t..].iter_mut().step_by(width).zip(column).for_each(|(out, v)| *out = *v);
            }
        });
        let mut rows = vec![ZERO; a * b];
        let memory = || vec![ZERO; of_rows.get_inplace_scratch_len()];
        rows.par_chunks_mut(b).enumerate().for_each_init(memory, |scratch, (k, row)| {
            checkpoint();
            for (tile, part) in tiles.chunks(a * TILE).zip(row.chunks_mut(TILE)) {
                let from = &tile[k * part.len()..];
                part.iter_mut().zip(from).for_each(|(to, from)| *to = *from);
            }
            of_rows.process_with_scratch(row, scratch);
        });
        rows
    }

    /// Σ_k X_k e^{2πijk/m} of rows of equal k₁, into as many `columns`; x_j is number a j₂ + j₁.
    fn back(&self, rows: &mut [Complex<f64>], columns: &mut [Complex<f64>]) {
        let (a, b) = (self.a, self.b);
        let [of_columns, of_rows] = self.plans(FftDirection::Inverse);
        let memory = || vec![ZERO; of_rows.get_inplace_scratch_len()];
        rows.par_chunks_mut(b).enumerate().for_each_init(memory, |scratch, (k, row)| {
            checkpoint();
            of_rows.process_with_scratch(row, scratch);
            self.roots.turn(row, k, true);
        });
        let memory = || vec![ZERO; of_columns.get_inplace_scratch_len()];
        columns.par_chunks_mut(a * TILE).enumerate().for_each_init(memory, |scratch, (tile, out)| {
            checkpoint();
            let width = out.len() / a;
            for k in 0..a {
                let from = &rows[k * b + tile * TILE..][..width];
                out[k..].iter_mut().step_by(a).zip(from).for_each(|(to, from)| *to = *from);
            }
            of_columns.process_with_scratch(out, scratch);
        });
    }
}

/// X_k = w_k Σ_j x_j w_j w*_{k−j}, w_k = e^{−iπk²/m}.
fn chirp(m: usize, x: impl Fn(usize) -> Complex<f64> + Sync) -> Option<Vec<Complex<f64>>> {
    let length = smooth(2 * m - 1);
    let steps = FourSteps::new(length)?;
    let roots = Roots::new(2 * m);
    let w = |k: usize| roots.at((k as u64 * k as u64 % (2 * m as u64)) as usize);
    let kernel = |j: usize| match j.min(length - j) {
        near if near < m => w(near).conj(),
        _ => ZERO,
    };
    let mut found = Vec::new();
    let kernel = steps.forward(kernel, &mut found);
    let mut product = steps.forward(|j| if j < m { x(j) * w(j) } else { ZERO }, &mut found);
    product.par_iter_mut().zip(&kernel).for_each(|(p, k)| *p *= k);
    steps.back(&mut product, &mut found);
    let of = |k: usize| found[k % steps.b * steps.a + k / steps.b] * w(k) / length as f64;
    Some((0..m).into_par_iter().map(of).collect())
}

/// The least 2^p 3^q 5^r not below `m`.
fn smooth(m: usize) -> usize {
    let powers = |base: usize| std::iter::successors(Some(1), move |v| Some(v * base)).take_while(move |v| *v < 5 * m);
    let of = |odd: usize| odd * m.div_ceil(odd).next_power_of_two();
    powers(5).flat_map(|five| powers(3).map(move |three| of(five * three))).min().unwrap_or(m)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn number(j: usize) -> Complex<f64> {
        Complex::new((j as f64 * 0.37).sin() + 0.1, (j as f64 * j as f64 * 0.011).cos())
    }

    /// Lengths with factors, with a last tile that is not full, with one large factor, and prime, against a
    /// transform of the whole: |x| is about one, so numbers grow to some thousand; rounding of log m additions of
    /// numbers of size √m, 1e-10 is a hundred times that.
    #[test]
    fn is_the_transform_of_the_whole() {
        for m in [8192, 9000, 64 * 131, 2 * 4099, 8209, 10_007] {
            let mut whole: Vec<Complex<f64>> = (0..m).map(number).collect();
            FftPlanner::new().plan_fft_forward(m).process(&mut whole);
            let found = Spectrum::new(m, number).expect("long enough");
            let (a, b) = found.shape();
            let mut seen = 0;
            found.pairs(0..b, |c, r, here, mirror| {
                let k = a * c + r;
                assert!((here - whole[k]).norm() < 1e-10, "{m}, {k}: {here} for {}", whole[k]);
                assert!((mirror - whole[(m - k) % m]).norm() < 1e-10, "{m}, {k}: {mirror}");
                seen += 1;
            });
            assert_eq!(seen, m);
        }
    }

    /// Same bits on one thread and on three.
    #[test]
    fn threads_do_not_matter() {
        for m in [9000, 10_007] {
            let on = |threads: usize| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
                pool.install(|| Spectrum::new(m, number).map(|s| s.values).unwrap_or_default())
            };
            assert!(on(1) == on(3));
        }
    }

    #[test]
    fn lengths_are_smooth() {
        assert_eq!([1, 7, 11, 31, 33, 1001].map(smooth), [1, 8, 12, 32, 36, 1024]);
        assert_eq!(smooth(333_333), 337_500);
    }

    /// Tables against sine and cosine of each: angles below 2π are rounded to 4e-16, on both sides, and once more in
    /// a walk.
    #[test]
    fn roots_lie_on_the_circle() {
        let m = 1003;
        let expected = |k: usize| Complex::new(0.0, -2.0 * PI * k as f64 / m as f64).exp();
        let roots = Roots::new(m);
        (0..=m).for_each(|k| assert!((roots.at(k) - expected(k)).norm() < 2e-15, "{k}"));
        let mut seen = 0;
        roots.walk(5, 12, 83, |i, root| {
            assert!((root - expected(5 + 12 * i)).norm() < 3e-15, "{i}: {root}");
            seen += 1;
        });
        assert_eq!(seen, 83);
    }
}
