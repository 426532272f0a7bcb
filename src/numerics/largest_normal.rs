//! Law of the largest absolute value of correlated standard normal numbers.

use std::convert::Infallible;

use nalgebra::{DMatrix, DVector, SymmetricEigen};

use super::distribution::{normal_quantile, normal_sf};
use super::optimize::{bisect, half_way};
use super::random::{StreamId, fill_normal, stream};

/// Draws behind every probability, at least; its relative error is then below 2 %.
const DRAWS: usize = 4096;
const SEED: u64 = 1;

/// max_i |Z_i| of Z ~ N(0, C), C a correlation matrix.
///
/// P(max |Z| > z) = K p E[1/#{i: |Z_i| > z}], p = P(|Z_1| > z), where one Z_j, j uniform of K, is drawn from its
/// tail and the others given it: unbiased, and of bounded relative error however small the probability. The draws
/// have a fixed seed, so that the same C gives the same numbers. Source: Adler, Blanchet & Liu 2012, Ann. Appl.
/// Probab. 22 (section 3).
#[derive(Clone, Debug)]
pub struct LargestNormal {
    correlation: DMatrix<f64>,
    draws: Vec<Draw>,
}

#[derive(Clone, Debug)]
struct Draw {
    values: Vec<f64>,
    /// The one that is put in its tail, and where in it.
    chosen: usize,
    share: f64,
}

impl LargestNormal {
    /// `correlation`: symmetric with ones on the diagonal; negative eigenvalues (rounding) count as zero.
    pub fn new(correlation: DMatrix<f64>) -> LargestNormal {
        let count = correlation.nrows();
        let SymmetricEigen { eigenvectors, eigenvalues } = SymmetricEigen::new(correlation.clone());
        let root = eigenvectors * DMatrix::from_diagonal(&eigenvalues.map(|v| v.max(0.0).sqrt()));
        let mut rng = stream(SEED, StreamId { run: 0, axis: 0, term: 0 });
        let mut normals = vec![0.0; count];
        // strata in place of random numbers: every value is chosen equally often, all over its tail
        let strata = DRAWS.div_ceil(count.max(1));
        let draws = (0..strata * count).map(|number| {
            fill_normal(&mut rng, &mut normals);
            let values = (&root * DVector::from_column_slice(&normals)).iter().copied().collect();
            Draw { values, chosen: number % count, share: ((number / count) as f64 + 0.5) / strata as f64 }
        });
        LargestNormal { draws: draws.collect(), correlation }
    }

    /// P(max |Z| > z); NaN of nothing.
    pub fn tail(&self, z: f64) -> f64 {
        let count = self.correlation.nrows();
        if count == 0 || z.is_nan() {
            return f64::NAN;
        }
        let single = normal_sf(z.max(0.0));
        if single == 0.0 {
            return 0.0;
        }
        let inverse = |draw: &Draw| {
            let tail = -normal_quantile(draw.share * single);
            let shift = tail - draw.values[draw.chosen];
            let column = self.correlation.column(draw.chosen);
            let above = draw.values.iter().zip(column.iter()).filter(|(v, c)| (*v + *c * shift).abs() > z);
            1.0 / above.count().max(1) as f64
        };
        let mean = self.draws.iter().map(inverse).sum::<f64>() / self.draws.len() as f64;
        (2.0 * single * count as f64 * mean).min(1.0)
    }

    /// z with P(max |Z| > z) = p, which moves in the steps of the draws.
    pub fn quantile(&self, p: f64) -> f64 {
        let Ok((low, high)) = bisect(0.0, 38.0, half_way(5e-11), |z| Ok::<_, Infallible>(self.tail(z) <= p));
        0.5 * (low + high)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Independent: 1 − (1 − 2(1 − Φ(z)))^K; all equal: 2(1 − Φ(z)). The draws' own error is 1 % of what is not one
    /// value alone.
    #[test]
    fn closed_forms_at_both_ends() {
        for count in [1, 2, 7, 30] {
            let apart = LargestNormal::new(DMatrix::identity(count, count));
            let together = LargestNormal::new(DMatrix::from_element(count, count, 1.0));
            for z in [0.5, 2.0, 4.0, 8.0, 30.0] {
                let single: f64 = 2.0 * normal_sf(z);
                let expected = -((-single).ln_1p() * count as f64).exp_m1();
                assert!((apart.tail(z) / expected - 1.0).abs() < 0.03, "{count} {z}: {}", apart.tail(z) / expected);
                assert!((together.tail(z) / single - 1.0).abs() < 1e-6, "{count} {z}");
            }
        }
    }

    /// Two values of correlation r: P(max < 0-symmetric box) by numerical integration over the first,
    /// ∫ φ(x) [Φ((z − rx)/s) − Φ((−z − rx)/s)] dx over |x| < z, s² = 1 − r².
    #[test]
    fn two_correlated_values() {
        for r in [0.5, 0.9, -0.7] {
            let law = LargestNormal::new(DMatrix::from_row_slice(2, 2, &[1.0, r, r, 1.0]));
            for z in [1.0, 2.5, 4.0] {
                let s = f64::sqrt(1.0 - r * r);
                let steps = 4000;
                let h = 2.0 * z / f64::from(steps);
                let outside: f64 = (0..steps)
                    .map(|i| {
                        let x = -z + (f64::from(i) + 0.5) * h;
                        let density = (-0.5 * x * x).exp() / (2.0 * std::f64::consts::PI).sqrt();
                        density * (normal_sf((z - r * x) / s) + normal_sf((z + r * x) / s)) * h
                    })
                    .sum();
                let expected = 2.0 * normal_sf(z) + outside;
                let found = law.tail(z);
                // 4096 draws of a value between 1/2 and 1: error below 0.4 %, four of them
                assert!((found / expected - 1.0).abs() < 0.016, "{r} {z}: {found} and {expected}");
                // the probability moves in steps of a draw, 1/8192 of it at most: 1e-4 in z
                assert!((law.quantile(found) - z).abs() < 1e-3 * z, "{r} {z}: {}", law.quantile(found));
            }
        }
    }
}
