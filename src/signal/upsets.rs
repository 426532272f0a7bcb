//! What no stationary noise does: single samples far off, and steps of the level. Medians find them, so that they do
//! not hide themselves.

use super::check::robust;
use crate::numerics::distribution::normal_quantile;
use crate::numerics::progress::checkpoint;

/// Chance of calling anything in a log of normal noise an outlier, and likewise a step.
pub const FALSE_ALARM: f64 = 1e-3;
/// Samples whose median is the level that an outlier is held against; so many memories of the noise, where it has one.
const LEVEL: usize = 31;
/// Levels over which the noise is taken as equal.
const REACH: usize = 128;
/// Longest memory, in samples, and differences of which it is judged.
const LONGEST_MEMORY: usize = 512;
const JUDGED: usize = 20_000;
/// Power of differences over two, four and eight times as many samples as the memory, over that of those over it, at
/// most.
const SETTLED: [f64; 3] = [1.25, 1.5, 1.75];
/// Limits are wider by this for the scatter of level (3 %) and scale (2 %): simulated logs then have outliers as
/// seldom as intended.
const SCATTER: f64 = 1.07;
/// Scale of a normal law in median absolute deviations.
const MAD: f64 = 1.482_602_218_505_602;
/// Shortest block of the search for steps, and the fewest blocks.
const SHORTEST: usize = 8;
const FEWEST: usize = 64;

/// A step of the level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// Sample at which it stands out most.
    pub index: usize,
    /// Mean after minus mean before, in the unit of the samples.
    pub size: f64,
    /// The same in robust standard deviations of such differences elsewhere in the log.
    pub sigmas: f64,
}

/// Indices of samples that are farther from the median of their surroundings than normal noise of the same robust
/// scale would put any of them with a probability of 10⁻³ (per log; Bonferroni). A sample that is not finite is
/// none. Source: Hampel 1974.
pub fn outliers(x: &[f64]) -> Vec<usize> {
    outliers_about(x, LEVEL * memory(x))
}

/// Samples after which noise behind a low-pass has forgotten what it was: a power of two from which on the robust
/// power of differences hardly grows any more; 1 for white noise, and where it grows for ever (drift) or as long as
/// the log is short.
fn memory(x: &[f64]) -> usize {
    let stride = x.len() / JUDGED + 1;
    let power = |lag: usize| {
        let apart: Vec<f64> = (lag..x.len()).step_by(stride).map(|k| x[k] - x[k - lag]).collect();
        scale(&apart).powi(2)
    };
    let longest = LONGEST_MEMORY.min(x.len() / (8 * LEVEL));
    let lags = std::iter::successors(Some(1), |lag| Some(2 * lag)).take_while(|lag| *lag <= 8 * longest);
    let powers: Vec<f64> = lags.map(power).collect();
    let settled = |of: &[f64]| of[1..].iter().zip(SETTLED).all(|(power, most)| *power <= most * of[0]);
    powers.windows(1 + SETTLED.len()).position(settled).map_or(1, |i| 1 << i)
}

fn outliers_about(x: &[f64], level_samples: usize) -> Vec<usize> {
    let limit = SCATTER * normal_quantile(1.0 - 0.5 * FALSE_ALARM / x.len().max(1) as f64);
    let reach = REACH * level_samples;
    let mut found = Vec::new();
    for (first, part) in x.chunks(reach).enumerate().map(|(i, part)| (i * reach, part)) {
        checkpoint();
        let residuals: Vec<f64> = part
            .chunks(level_samples)
            .flat_map(|own| {
                let level = median(own.to_vec());
                own.iter().map(move |v| v - level)
            })
            .collect();
        let scale = scale(&residuals);
        let far = residuals.iter().enumerate().filter(|(_, r)| r.abs() > limit * scale);
        found.extend(far.map(|(i, _)| first + i));
    }
    found
}

/// Puts the median of its surroundings in the place of every outlier; which samples these are.
pub fn fill_outliers(x: &mut [f64]) -> Vec<usize> {
    let level_samples = LEVEL * memory(x);
    let found = outliers_about(x, level_samples);
    for &index in &found {
        let first = index / level_samples * level_samples;
        let end = (first + level_samples).min(x.len());
        x[index] = median(x[first..end].to_vec());
    }
    found
}

/// Steps of the level, largest first, at most `most`: differences of the means of neighbouring blocks, of all
/// lengths from 8 samples to a sixty-fourth of the log, that are larger than normal ones of the same robust scale
/// would be with a probability of 10⁻³. A random walk, whose differences are normal, has none.
pub fn steps(x: &[f64], most: usize) -> Vec<Step> {
    let lengths: Vec<usize> =
        std::iter::successors(Some(SHORTEST), |m| Some(2 * m)).take_while(|m| m * FEWEST <= x.len()).collect();
    let mut sums = Vec::with_capacity(x.len() + 1);
    sums.push(0.0);
    let level = median(x.iter().copied().step_by(x.len() / 1000 + 1).collect());
    x.iter().fold(0.0, |sum: f64, v| {
        let next = sum + if v.is_finite() { v - level } else { 0.0 };
        sums.push(next);
        next
    });
    let rounding = 8.0 * f64::EPSILON * sums.iter().fold(0.0, |most: f64, sum| most.max(sum.abs()));
    let mut found: Vec<(Step, usize)> = Vec::new();
    let tried: usize = lengths.iter().map(|m| 2 * x.len() / m).sum();
    let limit = normal_quantile(1.0 - 0.5 * FALSE_ALARM / tried.max(1) as f64);
    for m in lengths {
        let at: Vec<usize> = (m..=x.len() - m).step_by((m / 2).max(1)).collect();
        let differences: Vec<f64> = at
            .iter()
            .map(|k| sums[k + m] - 2.0 * sums[*k] + sums[k - m])
            .map(|d| if d.abs() > rounding { d / m as f64 } else { 0.0 })
            .collect();
        let scale = robust_scale(&differences);
        if scale == 0.0 {
            continue;
        }
        for (index, size) in at.into_iter().zip(differences) {
            let sigmas = size.abs() / scale;
            if sigmas > limit {
                found.push((Step { index, size, sigmas }, m));
            }
        }
    }
    found.sort_by(|a, b| b.0.sigmas.total_cmp(&a.0.sigmas));
    let mut kept: Vec<(Step, usize)> = Vec::new();
    for (step, m) in found {
        // the same step seen with other blocks
        if kept.len() < most && kept.iter().all(|(other, n)| step.index.abs_diff(other.index) > m.max(*n) + m) {
            kept.push((step, m));
        }
    }
    kept.into_iter().map(|(step, _)| step).collect()
}

/// Robust standard deviation about zero; zero of values that are mostly equal (coarse steps of the sensor).
fn robust_scale(values: &[f64]) -> f64 {
    MAD * median(values.iter().map(|v| v.abs()).collect())
}

/// The same, of values that are mostly equal the plain one.
fn scale(values: &[f64]) -> f64 {
    let robust = robust_scale(values);
    if robust > 0.0 {
        return robust;
    }
    let finite = || values.iter().filter(|v| v.is_finite());
    (finite().map(|v| v * v).sum::<f64>() / finite().count().max(1) as f64).sqrt()
}

/// Of the finite values; NaN for none.
fn median(mut values: Vec<f64>) -> f64 {
    values.retain(|v| v.is_finite());
    robust::median(&mut values)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numerics::random::{StreamId, fill_normal, stream};

    fn noise(samples: usize, run: u64) -> Vec<f64> {
        let mut x = vec![0.0; samples];
        fill_normal(&mut stream(11, StreamId { run, axis: 0, term: 0 }), &mut x);
        x
    }

    /// White noise, a random walk and both rounded coarsely: nothing, in 10 logs of each kind; each has a chance of
    /// 10⁻³ or so (4000 logs of 10,000 samples of white noise: 4 with steps, 8 with outliers where limits were 2 %
    /// narrower), but the seeds are fixed.
    #[test]
    fn normal_noise_has_no_upsets() {
        for run in 0..10 {
            let white = noise(20_000, run);
            let mut sum = 0.0;
            let walk: Vec<f64> = noise(20_000, 100 + run)
                .iter()
                .zip(&white)
                .map(|(w, v)| {
                    sum += 0.05 * w;
                    v + sum
                })
                .collect();
            let rounded: Vec<f64> = white.iter().map(|v| v.round()).collect();
            for x in [white, walk, rounded] {
                assert_eq!((outliers(&x), steps(&x, 5)), (vec![], vec![]), "run {run}");
            }
        }
    }

    /// Behind a low-pass of 32 samples (two poles at 0.9) neighbours are alike: no outlier in 10 logs of 50,000,
    /// where levels of 31 samples would find dozens in each; one of 12 standard deviations is found. Means of a
    /// coarse converter's values are mostly equal but for rounding, and that is no scale.
    #[test]
    fn coloured_noise_has_no_upsets() {
        let low_passed = |run: u64| {
            let mut poles = [0.0; 2];
            let of = |draw: f64| {
                poles[0] += 0.1 * (draw - poles[0]);
                poles[1] += 0.1 * (poles[0] - poles[1]);
                poles[1]
            };
            noise(51_000, run).into_iter().map(of).skip(1000).collect::<Vec<f64>>()
        };
        for run in 0..10 {
            let x = low_passed(200 + run);
            assert!(memory(&x) >= 8, "{}", memory(&x));
            assert_eq!((outliers(&x), steps(&x, 5)), (vec![], vec![]), "run {run}");
        }
        // two poles of 0.9 at a draw of one: variance (1 − a)⁴(1 + a²)/(1 − a²)³
        let mut x = low_passed(220);
        x[20_000] += 12.0 * (1e-4_f64 * 1.81 / 0.19_f64.powi(3)).sqrt();
        assert_eq!(outliers(&x), [20_000]);
        assert_eq!(memory(&noise(50_000, 230)), 1);
        let lattice: Vec<f64> = noise(50_000, 231).iter().map(|v| 0.1 + if *v > 3.5 { 0.1 } else { 0.0 }).collect();
        assert_eq!(steps(&lattice, 5), vec![]);
    }

    #[test]
    fn upsets_are_found_where_they_are() {
        let mut x = noise(50_000, 7);
        for (index, size) in [(123, 12.0), (30_000, -9.0), (49_999, 50.0)] {
            x[index] += size;
        }
        x[77] = f64::NAN;
        assert_eq!(outliers(&x), [123, 30_000, 49_999]);
        fill_outliers(&mut x);
        assert!(outliers(&x).is_empty() && x[77].is_nan() && x[123].abs() < 1.5);
        let mut stepped = noise(50_000, 8);
        stepped[20_000..].iter_mut().for_each(|v| *v += 1.0);
        stepped[41_000..].iter_mut().for_each(|v| *v -= 2.0);
        let found = steps(&stepped, 5);
        assert_eq!(found.len(), 2, "{found:?}");
        // blocks of up to 781 samples, half a block apart
        for (step, (index, size)) in found.iter().zip([(41_000, -2.0), (20_000, 1.0)]) {
            assert!(step.index.abs_diff(index) <= 400 && (step.size - size).abs() < 0.3, "{step:?}");
        }
        assert_eq!(steps(&stepped, 1).len(), 1);
        assert!(outliers(&[]).is_empty() && steps(&[], 3).is_empty() && steps(&[1.0; 600], 3).is_empty());
        assert!(outliers(&[2.0; 99]).is_empty());
    }
}
