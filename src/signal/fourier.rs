//! Discrete Fourier transform of many numbers without large tables, on any number of threads.
//!
//! X_k = Σ_j x_j e^{−2πijk/m}. With m = a b, j = b j₁ + j₂ and k = k₁ + a k₂ this is b transforms of length a, factors e^{−2πi j₂k₁/m}, and
//! a transforms of length b, so that plans are made for lengths near √m alone: a plan for half a million points costs more than two
//! transforms of them. Where m has no such factors, a convolution on a length that has. Every number is computed in the same way whatever
//! the threads. Sources: Cooley & Tukey 1965; Bailey 1990 (four steps); Bluestein 1970.

use std::f64::consts::PI;
use std::sync::Arc;

use rayon::prelude::*;
use rustfft::num_complex::Complex;
use rustfft::{Fft, FftDirection, FftPlanner};

/// Columns that are transformed together: two cache lines of every row.
const TILE: usize = 8;
/// The smaller factor at least.
const SHORTEST: usize = 64;
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
    fn at(&self, k: usize) -> Complex<f64> {
        self.fine[k % self.fine.len()] * self.coarse[k / self.fine.len()]
    }

    /// Of `first`, `first + by`, … as far as m.
    pub(crate) fn walk(&self, first: usize, by: usize) -> impl Iterator<Item = Complex<f64>> + '_ {
        let step = self.fine.len();
        let (mut high, mut low) = (first / step, first % step);
        let (by_high, by_low) = (by / step, by % step);
        std::iter::from_fn(move || {
            let root = self.coarse.get(high)? * self.fine[low];
            high += by_high;
            low += by_low;
            if low >= step {
                low -= step;
                high += 1;
            }
            Some(root)
        })
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
            Some(steps) => Some(Spectrum { values: steps.forward(x), a: steps.a, b: steps.b }),
            None => Some(Spectrum { values: chirp(m, x)?, a: 1, b: m }),
        }
    }

    /// Numbers to the next multiple of which neighbours are taken best.
    pub(super) fn rows(&self) -> usize {
        self.a
    }

    /// X_k and X_{m−k} for k from `first`, at least 1.
    pub(super) fn pairs(&self, first: usize) -> impl Iterator<Item = (Complex<f64>, Complex<f64>)> + '_ {
        let (a, b) = (self.a, self.b);
        let (mut row, mut column) = (first % a, first / a);
        std::iter::from_fn(move || {
            let here = *self.values.get(row * b + column)?;
            let mirror = if row == 0 { b - column } else { (a - row) * b + (b - 1 - column) };
            row += 1;
            if row == a {
                (row, column) = (0, column + 1);
            }
            Some((here, *self.values.get(mirror)?))
        })
    }

    pub(super) fn first(&self) -> Complex<f64> {
        self.values[0]
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

    /// Rows of equal k₁.
    fn forward(&self, x: impl Fn(usize) -> Complex<f64> + Sync) -> Vec<Complex<f64>> {
        let (a, b) = (self.a, self.b);
        let [of_columns, of_rows] = self.plans(FftDirection::Forward);
        let mut tiles = vec![ZERO; a * b];
        let memory = || (vec![ZERO; a * TILE], vec![ZERO; of_columns.get_inplace_scratch_len()]);
        tiles.par_chunks_mut(a * TILE).enumerate().for_each_init(memory, |(columns, scratch), (tile, out)| {
            let (width, first) = (out.len() / a, tile * TILE);
            for j in 0..a {
                (0..width).for_each(|t| columns[t * a + j] = x(b * j + first + t));
            }
            of_columns.process_with_scratch(&mut columns[..a * width], scratch);
            for (t, column) in columns.chunks_exact(a).take(width).enumerate() {
                let turned = column.iter().zip(self.roots.walk(0, first + t));
                out[t..].iter_mut().step_by(width).zip(turned).for_each(|(out, (v, root))| *out = v * root);
            }
        });
        let mut rows = vec![ZERO; a * b];
        let memory = || vec![ZERO; of_rows.get_inplace_scratch_len()];
        rows.par_chunks_mut(b).enumerate().for_each_init(memory, |scratch, (k, row)| {
            for (tile, part) in tiles.chunks(a * TILE).zip(row.chunks_mut(TILE)) {
                part.copy_from_slice(&tile[k * part.len()..][..part.len()]);
            }
            of_rows.process_with_scratch(row, scratch);
        });
        rows
    }

    /// Σ_k X_k e^{2πijk/m} of rows of equal k₁; x_j is number a j₂ + j₁.
    fn back(&self, rows: &mut [Complex<f64>]) -> Vec<Complex<f64>> {
        let (a, b) = (self.a, self.b);
        let [of_columns, of_rows] = self.plans(FftDirection::Inverse);
        let memory = || vec![ZERO; of_rows.get_inplace_scratch_len()];
        rows.par_chunks_mut(b).enumerate().for_each_init(memory, |scratch, (k, row)| {
            of_rows.process_with_scratch(row, scratch);
            row.iter_mut().zip(self.roots.walk(0, k)).for_each(|(v, root)| *v *= root.conj());
        });
        let mut columns = vec![ZERO; a * b];
        let memory = || vec![ZERO; of_columns.get_inplace_scratch_len()];
        columns.par_chunks_mut(a * TILE).enumerate().for_each_init(memory, |scratch, (tile, out)| {
            let width = out.len() / a;
            for k in 0..a {
                let from = &rows[k * b + tile * TILE..][..width];
                out[k..].iter_mut().step_by(a).zip(from).for_each(|(to, from)| *to = *from);
            }
            of_columns.process_with_scratch(out, scratch);
        });
        columns
    }
}

/// X_k = w_k Σ_j x_j w_j w*_{k−j}, w_k = e^{−iπk²/m}.
fn chirp(m: usize, x: impl Fn(usize) -> Complex<f64> + Sync) -> Option<Vec<Complex<f64>>> {
    let length = smooth(2 * m - 1);
    let steps = FourSteps::new(length)?;
    let roots = Roots::new(2 * m);
    let w = |k: usize| roots.at((k as u128 * k as u128 % (2 * m as u128)) as usize);
    let kernel = steps.forward(|j| match j.min(length - j) {
        near if near < m => w(near).conj(),
        _ => ZERO,
    });
    let mut product = steps.forward(|j| if j < m { x(j) * w(j) } else { ZERO });
    product.par_iter_mut().zip(&kernel).for_each(|(p, k)| *p *= k);
    let found = steps.back(&mut product);
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

    /// Lengths with factors, with a last tile that is not full, with one large factor, and prime, against a transform of the whole: |x| is about
    /// one, so numbers grow to some thousand; rounding of log m additions of numbers of size √m, 1e-10 is a hundred times that.
    #[test]
    fn is_the_transform_of_the_whole() {
        for m in [8192, 9000, 64 * 131, 2 * 4099, 8209, 10_007] {
            let mut whole: Vec<Complex<f64>> = (0..m).map(number).collect();
            FftPlanner::new().plan_fft_forward(m).process(&mut whole);
            let found = Spectrum::new(m, number).expect("long enough");
            assert!((found.first() - whole[0]).norm() < 1e-10);
            for (k, (here, mirror)) in (1..m).zip(found.pairs(1)) {
                assert!((here - whole[k]).norm() < 1e-10, "{m}, {k}: {here} for {}", whole[k]);
                assert!((mirror - whole[m - k]).norm() < 1e-10, "{m}, {k}: {mirror}");
            }
            let (_, last) = found.pairs(1).nth(m - 2).expect("m − 1 pairs");
            assert!((last - whole[1]).norm() < 1e-10);
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

    /// Two tables against sine and cosine of each: angles below 2π are rounded to 4e-16, on both sides.
    #[test]
    fn roots_lie_on_the_circle() {
        let m = 1003;
        for (k, root) in Roots::new(m).walk(0, 1).take(m).enumerate() {
            let (sin, cos) = (2.0 * PI * k as f64 / m as f64).sin_cos();
            assert!((root - Complex::new(cos, -sin)).norm() < 2e-15, "{k}: {root}");
        }
        assert!((Roots::new(m).walk(5, 37).nth(20).expect("745") - Roots::new(m).at(745)).norm() < 1e-16);
    }
}
