//! Tails of the noise: how much more than of normal noise its level scatters, and a level that does not leave the
//! tails out.
//!
//! N is the root of a density: variance per sample × sample period, because a filter that adds up many samples sees
//! their variance, whatever their law. The log is whitened by the spectrum of its model, z = C⁻¹ (c_j √(dt/S_j)), c =
//! C x cosine coefficients of segments. Of a linear process whose innovations have the excess kurtosis κ the power
//! of z has the variance (2 + κ)/n, and the inverse information of Whittle's likelihood lacks u uᵀ κ/4n, u = 1 for
//! the logarithm of every coefficient (in the unit of the log) and 0 for every time and frequency: I u = ½ Σ_j ∂ ln
//! S_j, so that this is its sandwich exactly. So one rule serves every method: var ln θ grows by κ/4n for every
//! coefficient θ. 2 + κ is the variance of the sum of z² over blocks by their length: blocks as long as a filter of
//! the sensor remembers, because z is that process but for its phases. Squares of Student-t noise of 4 degrees of
//! freedom have no variance, yet their mean over its own standard error becomes normal.
//!
//! Where samples are left out as outliers, the rest is cut where outliers begin, and the law of what was cut is
//! found from it: Student's t with scale s and ν degrees of freedom, of which normal noise is the limit, at the
//! maximum of the likelihood of the samples within the cut, given that they are there. Noise of that law has the
//! variance s² ν/(ν − 2), its tails included. Sources: Whittle 1953; Hannan 1973 and Hosoya & Taniguchi 1982 (κ in
//! the covariance of Whittle's estimates); Giné, Götze & Mason 1997 (self-normalised sums); Lange, Little & Taylor
//! 1989 (t likelihood); Cohen 1991, chapter 2 (truncated samples).

use rayon::prelude::*;
use schemars::JsonSchema;
use serde::Serialize;

use super::{FEWEST_SAMPLES, Identified, Sum, counts_as_white};
use crate::noise::{Grid, NoiseModel, Term};
use crate::numerics::distribution::{NORMAL_95, normal_quantile};
use crate::numerics::optimize::lowest;
use crate::signal::cosine::{Inverse, cosine_transform};
use crate::signal::upsets::FALSE_ALARM;
use crate::units::digits;

/// Samples that are whitened at once, about: drift that is slower is taken off with their mean.
pub(super) const SEGMENT: usize = 1 << 14;
/// Segments that tell the kurtosis, at most, evenly spread: a quarter of a million samples know it to 0.01 (√(24/n)),
/// which is a quarter of a percent of an interval.
pub(super) const MOST_SEGMENTS: usize = 16;
/// Lengths of blocks, the longest as long as filters of sensors remember.
const BLOCKS: [usize; 3] = [1, 8, 64];
/// Fewest blocks whose variance says something.
const FEWEST_BLOCKS: f64 = 32.0;
/// An excess this many standard deviations above that of normal noise counts: one log of a hundred has it by chance,
/// and hardly wider intervals for it.
const BEYOND_CHANCE: f64 = 2.33;
/// Twice the gain in ln L by which Student's t is told from normal noise: of chance once in two hundred logs.
const STUDENT: f64 = 6.6;
/// Where 1/ν ends that is searched: the variance of noise with ν = 2 has no end.
const HEAVIEST: f64 = 0.4999;
/// Cells of the histogram of |z|.
const CELLS: usize = 1024;

/// How the level of the noise scatters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, JsonSchema)]
pub struct Tails {
    /// Of the log whitened by its model; 0 where it is that of normal noise within chance.
    pub excess_kurtosis: f64,
    /// With `--without-outliers`, where what is not left out has tails.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub student: Option<Student>,
}

/// The law of the noise whose tails were left out.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Student {
    /// ν.
    pub degrees_of_freedom: f64,
    /// N with the tails over N without.
    pub factor: f64,
    /// ν within its interval may be 2 or less: the variance, and N, has no upper limit.
    pub open: bool,
}

/// Per-sample variance of z² beyond that of normal noise. `rates`: stretches of one log, or of several.
pub(super) fn tails(rates: &[&[f64]], dt: f64, model: &NoiseModel) -> Tails {
    let Some(white) = Whitener::new(rates, dt, model) else { return Tails::default() };
    let segments = white.segments(rates);
    let step = segments.len().div_ceil(MOST_SEGMENTS).max(1);
    let some: Vec<usize> = (0..segments.len()).step_by(step).collect();
    let of = |i: usize| (segments[i].0.0, Blocks::of(&white.series(segments[i].1)));
    let sums: Vec<(usize, Blocks)> = some.into_par_iter().map(of).collect();
    Tails { excess_kurtosis: Blocks::excess(&sums), student: None }
}

impl Identified {
    /// Intervals of the coefficients as the kurtosis of the log has them.
    pub(super) fn with_tails(mut self, rates: &[&[f64]], dt: f64) -> Identified {
        let tails = tails(rates, dt, &self.model);
        self.tails = tails;
        self.scale(1.0, tails.excess_kurtosis / (4.0 * self.samples as f64), false);
        self
    }

    /// N of logs from which outliers were left out, its tails put back where they are of the noise. `left_out`: of
    /// each stretch the samples of `rates` that are not of the log.
    pub fn put_tails_back(&mut self, rates: &[&[f64]], left_out: &[&[usize]], dt: f64) {
        let Some(white) = Whitener::new(rates, dt, &self.model) else { return };
        let segments = white.segments(rates);
        let mut kept: Vec<(usize, Vec<f64>)> = segments
            .par_iter()
            .map(|(place, samples)| {
                let lost = left_out.get(place.0).copied().unwrap_or_default();
                let own = white.series(samples).into_iter().enumerate();
                let own = own.filter(|(i, _)| lost.binary_search(&(place.1 + i)).is_err()).map(|(_, z)| z);
                (place.0, own.collect())
            })
            .collect();
        let before = self.tails.excess_kurtosis;
        alike(&mut kept);
        let (excess, student) = match Law::of(kept.iter().flat_map(|(_, z)| z).map(|z| z.abs()).collect()) {
            Some(law) => (law.excess, Some(law.student)),
            None => (Blocks::excess(&kept.iter().map(|(i, z)| (*i, Blocks::of(z))).collect::<Vec<_>>()), None),
        };
        let factor = student.map_or(1.0, |student| student.factor);
        self.tails = Tails { excess_kurtosis: excess, student };
        self.scale(factor, (excess - before) / (4.0 * self.samples as f64), student.is_some_and(|own| own.open));
        if let Some(student) = student {
            // of normal noise, at the level without tails
            self.exact_log_likelihood = None;
            self.warnings.push(student.words());
        }
    }

    /// Multiplies what is white by `factor` and adds `variance` to that of the logarithm of every coefficient;
    /// `open`: there is no upper limit of what is white.
    fn scale(&mut self, factor: f64, variance: f64, open: bool) {
        if variance == 0.0 && factor == 1.0 && !open {
            return;
        }
        let wideband = |name: &str| ["white", "moving_average", "band_limit"].iter().any(|kind| name.starts_with(kind));
        for (name, measured) in self.params.noise_parameters().filter(|(name, _)| is_level(name)) {
            let value = measured.value;
            let by = if wideband(&name) { factor } else { 1.0 };
            measured.value *= by;
            measured.interval = measured.interval.map(|ends| {
                let [low, high] = widened(ends, value, variance).map(|end| by * end);
                [low, if open && wideband(&name) { f64::INFINITY } else { high }]
            });
        }
        for own in self.precision.iter_mut().filter(|own| is_level(&own.parameter)) {
            let square = (0.01 * own.std_dev_percent).powi(2) + variance;
            own.std_dev_percent = 100.0 * square.max(0.0).sqrt();
        }
        let dt = self.curve.dt;
        let white = |model: &NoiseModel| {
            let own = model.terms.iter().filter(|term| counts_as_white(term, dt));
            own.map(|term| term.psd(0.0, dt)).sum::<f64>().sqrt()
        };
        let before = white(&self.model);
        for term in &mut self.model.terms {
            if let Term::White { density } | Term::MovingAverage { density, .. } | Term::BandLimit { density, .. } =
                term
            {
                *density *= factor;
            }
        }
        let of_white = if before > 0.0 { white(&self.model) / before } else { 1.0 };
        let rescaled = |sum: Sum, by: f64, open: bool| Sum {
            value: by * sum.value,
            interval: sum.interval.map(|ends| widened(ends, sum.value, variance).map(|end| by * end)).filter(|_| !open),
        };
        self.sums.white = self.sums.white.map(|sum| rescaled(sum, of_white, open));
        self.sums.walk = self.sums.walk.map(|sum| rescaled(sum, 1.0, false));
    }
}

/// A coefficient in the unit of the log, not of a sloping line: it grows with the level of the noise.
fn is_level(name: &str) -> bool {
    ["density", "std_dev", "coefficient"].iter().any(|end| name.ends_with(end))
}

/// 95 % limits of a positive value whose logarithm has so much more variance; sides that are open stay so.
pub(super) fn widened(ends: [f64; 2], value: f64, variance: f64) -> [f64; 2] {
    let square = NORMAL_95 * NORMAL_95 * variance;
    ends.map(|end| {
        let half = (end / value).ln();
        if end <= 0.0 || !half.is_finite() || half == 0.0 {
            return end;
        }
        value * ((half * half + square).max(0.0).sqrt().copysign(half)).exp()
    })
}

/// Segments of one length by the spectrum of a model.
struct Whitener {
    length: usize,
    /// √(dt/S) at every frequency.
    weights: Vec<f64>,
    inverse: Inverse,
}

impl Whitener {
    /// `None` without samples or noise.
    fn new(rates: &[&[f64]], dt: f64, model: &NoiseModel) -> Option<Whitener> {
        let longest = rates.iter().map(|rate| rate.len()).max().filter(|longest| *longest > 1)?;
        let length = longest / longest.div_ceil(SEGMENT);
        // whole blocks
        let most = BLOCKS[BLOCKS.len() - 1];
        let length = if length > SEGMENT / 4 { length / most * most } else { length };
        let span = length as f64 * dt;
        let grid = Grid::new((1..length).map(|j| j as f64 / (2.0 * span)).collect(), dt);
        let mut total = vec![0.0; length - 1];
        for term in &model.terms {
            let term = match *term {
                // seen for so long a line is so wide
                Term::Oscillation { std_dev, frequency_hz, correlation_time } => {
                    let correlation_time = correlation_time.min(0.25 * span);
                    Term::Oscillation { std_dev, frequency_hz, correlation_time }
                }
                term => term,
            };
            total.iter_mut().zip(term.psd_on(&grid)).for_each(|(sum, psd)| *sum += psd);
        }
        let weight = |s: &f64| if *s > 0.0 { (dt / s).sqrt() } else { 0.0 };
        let weights: Vec<f64> = total.iter().map(weight).collect();
        weights.iter().any(|w| *w > 0.0).then(|| Whitener { length, weights, inverse: Inverse::new(length) })
    }

    /// With the stretch and the sample at which each begins.
    fn segments<'a>(&self, rates: &[&'a [f64]]) -> Vec<((usize, usize), &'a [f64])> {
        let of = |(i, rate): (usize, &&'a [f64])| {
            let own = rate.chunks_exact(self.length).enumerate();
            own.map(|(k, samples)| ((i, k * self.length), samples)).collect::<Vec<_>>()
        };
        rates.iter().enumerate().flat_map(of).collect()
    }

    /// Of variance one where the model is true.
    fn series(&self, samples: &[f64]) -> Vec<f64> {
        let mut coefficients = cosine_transform(samples);
        coefficients.iter_mut().zip(&self.weights).for_each(|(c, w)| *c *= w);
        self.inverse.series(&coefficients)
    }
}

/// Each stretch at the level of all: that logs differ is no tail.
fn alike(kept: &mut [(usize, Vec<f64>)]) {
    let power = |parts: &[(usize, Vec<f64>)]| {
        let all = parts.iter().flat_map(|(_, z)| z);
        let (sum, count) = all.fold((0.0, 0.0), |(sum, count), z| (sum + z * z, count + 1.0));
        sum / f64::max(count, 1.0)
    };
    let whole = power(kept);
    for own in kept.chunk_by_mut(|a, b| a.0 == b.0) {
        let by = (whole / power(own)).sqrt();
        if by.is_finite() {
            own.iter_mut().flat_map(|(_, z)| z).for_each(|z| *z *= by);
        }
    }
}

/// Of the power in blocks of each length: how many there are, their sum, and the sum of their squares.
struct Blocks([[f64; 3]; BLOCKS.len()]);

impl Blocks {
    fn of(z: &[f64]) -> Blocks {
        Blocks(BLOCKS.map(|length| {
            z.chunks_exact(length).fold([0.0; 3], |[count, sum, squares], block| {
                let power: f64 = block.iter().map(|z| z * z).sum();
                [count + 1.0, sum + power, squares + power * power]
            })
        }))
    }

    /// Variance of the power per sample over its square, less the 2 of normal noise, of that length of blocks which
    /// shows most; 0 within chance.
    ///
    /// Each stretch, whose number stands first, about its own mean.
    fn excess(all: &[(usize, Blocks)]) -> f64 {
        let of = |i: usize| {
            let own = |stretch: &[(usize, Blocks)]| {
                let [count, sum, squares] = stretch
                    .iter()
                    .fold([0.0; 3], |sums: [f64; 3], (_, own)| std::array::from_fn(|k| sums[k] + own.0[i][k]));
                let mean = sum / count;
                let relative = squares / (mean * mean) - count;
                if relative.is_finite() { [count, relative] } else { [0.0; 2] }
            };
            let add = |[n, s]: [f64; 2], [count, square]: [f64; 2]| [n + count, s + square];
            let [count, square] = all.chunk_by(|a, b| a.0 == b.0).map(own).fold([0.0; 2], add);
            let length = BLOCKS[i] as f64;
            let excess = length * square / count - 2.0;
            // of normal noise: E (Σ(z² − 1))⁴ = 12 l² + 48 l for blocks of length l
            let sigma = ((8.0 + 48.0 / length) / count).sqrt();
            (count >= FEWEST_BLOCKS && excess > BEYOND_CHANCE * sigma).then_some(excess)
        };
        (0..BLOCKS.len()).filter_map(of).fold(0.0, f64::max)
    }
}

/// Student's t for samples within a cut.
struct Law {
    student: Student,
    /// Of so many samples: n times the variance of ln of the variance, less 2.
    excess: f64,
}

impl Law {
    /// `None` where the samples within the cut are as those of normal noise.
    ///
    /// `sizes`: |z|.
    fn of(mut sizes: Vec<f64>) -> Option<Law> {
        let samples = sizes.len();
        if samples < FEWEST_SAMPLES {
            return None;
        }
        let (_, middle, _) = sizes.select_nth_unstable_by(samples / 2, f64::total_cmp);
        let scale = *middle / normal_quantile(0.75);
        if scale <= 0.0 {
            return None;
        }
        let cut = scale * normal_quantile(1.0 - 0.5 * FALSE_ALARM / samples as f64);
        let mut cells = vec![0.0; CELLS];
        let width = cut / CELLS as f64;
        for size in &sizes {
            if let Some(cell) = cells.get_mut((size / width) as usize) {
                *cell += 1.0;
            }
        }
        let count: f64 = cells.iter().sum();
        let squares: Vec<f64> = (0..CELLS).map(|i| ((i as f64 + 0.5) * width).powi(2)).collect();
        // −ln L per sample; the middles of the cells make the integral of the law over the cut, too
        let cost = |ln_scale: f64, inverse: f64| {
            let by = (-2.0 * ln_scale).exp();
            let (mut sum, mut whole) = (0.0, 0.0);
            for (square, count) in squares.iter().zip(&cells) {
                let x = by * square;
                let ln = if inverse < 1e-6 { -0.5 * x } else { -0.5 * (1.0 + 1.0 / inverse) * (inverse * x).ln_1p() };
                sum += count * ln;
                whole += ln.exp();
            }
            whole.ln() - sum / count
        };
        let around = scale.ln();
        let best_scale = |inverse: f64| lowest(|ln_scale| cost(ln_scale, inverse), around - 1.0, around + 1.0, 1e-7);
        let inverse = lowest(|inverse| cost(best_scale(inverse), inverse), 0.0, HEAVIEST, 1e-7);
        let ln_scale = best_scale(inverse);
        let normal = cost(best_scale(0.0), 0.0);
        let here = cost(ln_scale, inverse);
        if !(here.is_finite() && 2.0 * count * (normal - here) > STUDENT) {
            return None;
        }
        let ln_variance = |ln_scale: f64, inverse: f64| 2.0 * ln_scale - (1.0 - 2.0 * inverse).ln();
        // information of one sample, by second differences
        let step = (0.1 * inverse).min(0.1 * (0.5 - inverse)).min(1e-2);
        let second = |a: f64, b: f64| {
            let at = |x: f64, y: f64| cost(ln_scale + x, inverse + y);
            (at(a, b) + at(-a, -b) - 2.0 * here) / (step * step)
        };
        let (ss, kk) = (second(step, 0.0), second(0.0, step));
        let sk = 0.5 * (second(step, step) - ss - kk);
        let slope = [2.0, 2.0 / (1.0 - 2.0 * inverse)];
        let determinant = ss * kk - sk * sk;
        let square =
            (slope[0] * slope[0] * kk - 2.0 * slope[0] * slope[1] * sk + slope[1] * slope[1] * ss) / determinant;
        let of_inverse = ss / determinant / count;
        let factor = (0.5 * ln_variance(ln_scale, inverse)).exp();
        let known = square > 0.0 && square.is_finite() && of_inverse > 0.0;
        known.then(|| Law {
            student: Student {
                degrees_of_freedom: 1.0 / inverse,
                factor,
                open: inverse + NORMAL_95 * of_inverse.sqrt() >= 0.5,
            },
            excess: square * samples as f64 / count - 2.0,
        })
    }
}

impl Student {
    fn words(&self) -> String {
        let end = if self.open {
            "; so few degrees of freedom that the variance, and N, has no upper limit: is it noise?"
        } else {
            ""
        };
        format!(
            "the noise has tails, those of Student's t with {} degrees of freedom: N holds their variance, {} of what \
             is within the limits of outliers{end}",
            digits(self.degrees_of_freedom),
            digits(self.factor)
        )
    }
}
