//! Band limit: white noise behind a digital filter, what an anti-alias filter, a low-pass in the sensor's firmware or a decimator leaves of it.
//! Other names: ARMA(p, q) noise, coloured wideband noise, digital low-pass filter (DLPF).
//!
//! A(z) w_k = B(z) n_k with A = 1 + a₁z⁻¹ + …, B = b₀ + b₁z⁻¹ + …, gain one at frequency zero, n_k independent of variance N²/dt: at low frequencies it is
//! white noise of density N.
//!
//! Its states are those of the normalised lattice (Gray & Markel 1975): the backward prediction errors β₀ … of the autoregression, each of variance one,
//! so that P0 = I and nothing is lost however slow the filter is. With reflection coefficients κ_i, s_i = √(1 − κ_i²), f_p the new draw:
//! f_{i−1} = s_i f_i − κ_i β_{i−1}(k), β_i(k+1) = κ_i f_i + s_i β_{i−1}(k), β₀(k+1) = f₀.

use std::cmp::Ordering;
use std::hash::{Hash, Hasher};

use nalgebra::{Complex, DMatrix, DVector, RowDVector};
use rand::rngs::ChaCha8Rng;

use super::second_difference::{WEIGHTS, lag_sum};
use super::{Realisation, SamplePath};
use crate::numerics::optimize::bracketed_root;
use crate::numerics::random::{fill_normal, normal};

/// Of numerator and denominator, at most.
pub const HIGHEST_ORDER: usize = 8;
const PLACES: usize = HIGHEST_ORDER + 1;
/// |A(1)| and |B(1)| over the sum of their coefficients' sizes, at least: below, rounding decides on the gain.
const LEAST_SUM: f64 = 1e-9;

/// A stable digital filter with gain one at frequency zero.
#[derive(Clone, Copy, Debug)]
pub struct Filter {
    a: [f64; PLACES],
    b: [f64; PLACES],
    poles: usize,
    zeros: usize,
}

/// Why coefficients are no band limit.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FilterError {
    #[error("{found} coefficients, expected 1 to {}", PLACES)]
    Length { name: &'static str, found: usize },
    #[error("a coefficient is not finite, or would not be at gain one")]
    NotFinite { name: &'static str },
    #[error("begins with 0, expected the coefficient of the newest sample: leave a delay out")]
    Delay { name: &'static str },
    #[error("a pole is on or outside the unit circle, expected a stable filter")]
    Unstable,
    #[error("adds up to nearly nothing: {meaning}")]
    NoGain { name: &'static str, meaning: &'static str },
}

impl FilterError {
    /// Which coefficients: "numerator" or "denominator".
    pub fn name(&self) -> &'static str {
        match self {
            FilterError::Length { name, .. }
            | FilterError::NotFinite { name }
            | FilterError::Delay { name }
            | FilterError::NoGain { name, .. } => name,
            FilterError::Unstable => "denominator",
        }
    }
}

impl Filter {
    /// Coefficients of z⁰, z⁻¹, … as `scipy.signal` and MATLAB write them (b, a); scaled so that a₀ = 1 and B(1) = A(1).
    pub fn new(numerator: &[f64], denominator: &[f64]) -> Result<Filter, FilterError> {
        for (name, own) in [("numerator", numerator), ("denominator", denominator)] {
            if !(1..=PLACES).contains(&own.len()) {
                return Err(FilterError::Length { name, found: own.len() });
            }
            if own.iter().any(|v| !v.is_finite()) {
                return Err(FilterError::NotFinite { name });
            }
            if own[0] == 0.0 {
                return Err(FilterError::Delay { name });
            }
        }
        let sums = [numerator, denominator].map(|own| {
            let sum: f64 = own.iter().sum();
            (sum, sum.abs() / own.iter().map(|v| v.abs()).sum::<f64>())
        });
        let [(gain, relative_gain), (slow, relative_slow)] = sums;
        if relative_gain < LEAST_SUM {
            return Err(FilterError::NoGain {
                name: "numerator",
                meaning: "expected a filter that passes frequency zero",
            });
        }
        if relative_slow < LEAST_SUM {
            let meaning = "a pole so close to 1 is drift: use gauss_markov";
            return Err(FilterError::NoGain { name: "denominator", meaning });
        }
        // what is at gain one stays as it is to the last digit
        let scale = match slow / gain {
            ratio if (ratio - 1.0).abs() < 1e-9 => 1.0,
            ratio => ratio,
        };
        let (a, b) = (numbers(denominator, 1.0 / denominator[0]), numbers(numerator, scale / denominator[0]));
        let filter = Filter { a, b, poles: denominator.len() - 1, zeros: numerator.len() - 1 };
        if filter.reflection().is_none() {
            return Err(FilterError::Unstable);
        }
        if b.iter().any(|v| !v.is_finite()) {
            return Err(FilterError::NotFinite { name: "numerator" });
        }
        Ok(filter)
    }

    /// Of `order` area ratios g for the denominator and as many for the numerator, reflection coefficient (g − 1)/(g + 1) (Viswanathan & Makhoul 1975):
    /// any positive ratios give a stable filter of minimum phase, and all of these are reached.
    ///
    /// `None` where the ratios are no even number of them, or the filter is too slow for numbers.
    pub(crate) fn from_area_ratios(ratios: &[f64]) -> Option<Filter> {
        let order = ratios.len() / 2;
        if ratios.len() % 2 == 1 || order > HIGHEST_ORDER {
            return None;
        }
        let kappa: Vec<f64> = ratios.iter().map(|g| (g - 1.0) / (g + 1.0)).collect();
        let (a, b) = (step_up(&kappa[..order]), step_up(&kappa[order..]));
        Filter::new(&b[..=order], &a[..=order]).ok()
    }

    /// ∂ ln|B/A|² by the logarithm of each of the area ratios of which the filter was made, at every frequency with this sine and cosine of π f dt, and
    /// ∂ ln b₀² by it.
    ///
    /// 2 Re B'/B − 2 B'(1)/B(1), of poles with the other sign, and the second part alone; B' = ∂B/∂κ · (1 − κ²)/2, since κ = tanh(½ ln g).
    pub(super) fn slopes(ratios: &[f64], sin: &[f64], cos: &[f64]) -> Vec<(Vec<f64>, f64)> {
        let order = ratios.len() / 2;
        let kappa: Vec<f64> = ratios.iter().map(|g| (g - 1.0) / (g + 1.0)).collect();
        let points: Vec<Complex<f64>> =
            sin.iter().zip(cos).map(|(s, c)| Complex::new((c - s) * (c + s), -2.0 * s * c)).collect();
        let at = |own: &[f64], z: &Complex<f64>| own.iter().rev().fold(Complex::from(0.0), |sum, c| sum * z + c);
        let mut all = Vec::with_capacity(ratios.len());
        for (own, sign) in [(&kappa[..order], -1.0), (&kappa[order..], 1.0)] {
            let whole = step_up(own);
            let whole = &whole[..=order];
            let inverse: Vec<Complex<f64>> = points.iter().map(|z| at(whole, z).inv()).collect();
            for i in 0..order {
                // a polynomial is linear in each of its reflection coefficients
                let ends = [1.0, 0.0].map(|k| {
                    let mut moved = own.to_vec();
                    moved[i] = k;
                    step_up(&moved)
                });
                let scale = 0.5 * (1.0 - own[i]) * (1.0 + own[i]);
                let slope: Vec<f64> = (0..=order).map(|j| scale * (ends[0][j] - ends[1][j])).collect();
                let level = 2.0 * slope.iter().sum::<f64>() / whole.iter().sum::<f64>();
                let of =
                    |(z, inverse): (&Complex<f64>, &Complex<f64>)| sign * (2.0 * (at(&slope, z) * inverse).re - level);
                all.push((points.iter().zip(&inverse).map(of).collect(), -sign * level));
            }
        }
        all
    }

    /// The other way round; `None` for a filter of another shape.
    pub(crate) fn area_ratios(&self) -> Option<Vec<f64>> {
        if self.zeros != self.poles {
            return None;
        }
        let b = numbers(self.numerator(), 1.0 / self.b[0]);
        let kappa = step_down(&self.a, self.poles)?.into_iter().chain(step_down(&b, self.zeros)?);
        Some(kappa.map(|k| (1.0 + k) / (1.0 - k)).collect())
    }

    /// As it is where all zeros are inside the unit circle, else with all of them moved towards the origin by this factor.
    pub(crate) fn zeros_within(self, factor: f64) -> Filter {
        if self.area_ratios().is_some_and(|ratios| ratios.iter().all(|g| *g > 0.0 && g.is_finite())) {
            return self;
        }
        let moved: Vec<f64> = self
            .numerator()
            .iter()
            .scan(1.0, |by, b| {
                let own = *by * b;
                *by *= factor;
                Some(own)
            })
            .collect();
        Filter::new(&moved, self.denominator()).unwrap_or(self)
    }

    /// With these poles and zeros, each standing for itself and, where it is not real, its conjugate.
    pub(crate) fn of_roots(zeros: &[Complex<f64>], poles: &[Complex<f64>]) -> Option<Filter> {
        Filter::new(&polynomial(zeros), &polynomial(poles)).ok()
    }

    /// Variance of the innovations over that of white noise of the same density at low frequencies: b₀².
    pub(crate) fn innovation(&self) -> f64 {
        self.b[0] * self.b[0]
    }

    /// b₀ …, for a₀ = 1.
    pub fn numerator(&self) -> &[f64] {
        &self.b[..=self.zeros]
    }

    /// 1, a₁ …
    pub fn denominator(&self) -> &[f64] {
        &self.a[..=self.poles]
    }

    /// |B/A|² at frequency f; `turns` = f dt.
    pub(crate) fn power_gain(&self, turns: f64) -> f64 {
        let (sin, cos) = (std::f64::consts::PI * turns).sin_cos();
        self.power_gain_at(sin, cos)
    }

    /// The same from sine and cosine of π f dt.
    pub(super) fn power_gain_at(&self, sin: f64, cos: f64) -> f64 {
        let z = Complex::new((cos - sin) * (cos + sin), -2.0 * sin * cos);
        let at = |own: &[f64]| own.iter().rev().fold(Complex::from(0.0), |sum, c| sum * z + c).norm_sqr();
        at(self.numerator()) / at(self.denominator())
    }

    /// Frequency, as share of the sample rate, at which the power has first fallen to half; `None` if it does not.
    pub fn half_power(&self) -> Option<f64> {
        const STEPS: usize = 4096;
        let at = |i: usize| 0.5 * i as f64 / STEPS as f64;
        let first = (1..=STEPS).find(|i| self.power_gain(at(*i)) <= 0.5)?;
        bracketed_root(|turns| self.power_gain(turns) - 0.5, at(first - 1), at(first), 0.0)
    }

    /// Samples in which what the slowest pole remembers falls to 1/e: −1/ln of the growth of Fᵏ, k = 2¹⁰.
    pub(crate) fn memory(&self) -> f64 {
        let mut power = self.lattice().f;
        let mut log = 0.0;
        // F^(2^i), its size kept in `log`
        for _ in 0..10 {
            let size = power.norm();
            if size == 0.0 {
                return 0.0;
            }
            power /= size;
            log = 2.0 * (log + size.ln());
            power = &power * &power;
        }
        let log = log + power.norm().ln();
        match log {
            f64::NEG_INFINITY => 0.0,
            // the size of Fᵏ is more than that of the slowest pole alone
            log if log < 0.0 => -1024.0 / log,
            _ => f64::INFINITY,
        }
    }

    /// The largest of |B/A|² at 513 frequencies from zero to half the sample rate.
    pub(crate) fn peak_gain(&self) -> f64 {
        (0..=512).map(|i| self.power_gain(f64::from(i) / 1024.0)).fold(0.0, f64::max)
    }

    /// Reflection coefficients of the denominator, the rest zero; `None` if it is not stable.
    fn reflection(&self) -> Option<[f64; PLACES]> {
        let mut all = [0.0; PLACES];
        for (place, k) in all.iter_mut().zip(step_down(&self.a, self.poles)?) {
            *place = k;
        }
        Some(all)
    }

    /// States in the lattice.
    fn size(&self) -> usize {
        self.poles.max(self.zeros + 1)
    }

    fn lattice(&self) -> Lattice {
        let size = self.size();
        let kappa = self.reflection().unwrap_or_default();
        // power of the prediction error of order i over that of the draws
        let mut errors = [1.0; PLACES + 1];
        for i in (0..size.min(HIGHEST_ORDER)).rev() {
            errors[i] = errors[i + 1] / (1.0 - kappa[i] * kappa[i]);
        }
        // B as a sum of the reversed polynomials, from the highest order down
        let mut rest = self.b;
        let mut taps = vec![0.0; size];
        for i in (0..=self.zeros).rev() {
            let polynomial = step_up(&kappa[..i]);
            let tap = rest[i];
            for (j, v) in rest.iter_mut().enumerate().take(i + 1) {
                *v -= tap * polynomial[i - j];
            }
            taps[i] = tap * errors[i].sqrt();
        }
        let mut f = DMatrix::zeros(size, size);
        for j in 0..size {
            let mut unit = [0.0; PLACES];
            unit[j] = 1.0;
            turn(&kappa[..size], &mut unit[..size], 0.0);
            f.column_mut(j).copy_from_slice(&unit[..size]);
        }
        let mut drive = [0.0; PLACES];
        turn(&kappa[..size], &mut drive[..size], 1.0);
        Lattice { f, drive: DVector::from_column_slice(&drive[..size]), taps: RowDVector::from_vec(taps), kappa }
    }
}

/// ∏ (1 − root z⁻¹) over the roots and the conjugates of those that are not real.
fn polynomial(roots: &[Complex<f64>]) -> Vec<f64> {
    let mut all = vec![1.0];
    for root in roots {
        let factor = if root.im == 0.0 { vec![1.0, -root.re] } else { vec![1.0, -2.0 * root.re, root.norm_sqr()] };
        let mut next = vec![0.0; all.len() + factor.len() - 1];
        for (i, a) in all.iter().enumerate() {
            for (j, b) in factor.iter().enumerate() {
                next[i + j] += a * b;
            }
        }
        all = next;
    }
    all
}

fn numbers(own: &[f64], factor: f64) -> [f64; PLACES] {
    let mut all = [0.0; PLACES];
    all.iter_mut().zip(own).for_each(|(place, v)| *place = v * factor);
    all
}

impl PartialEq for Filter {
    fn eq(&self, other: &Filter) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Filter {}

impl PartialOrd for Filter {
    fn partial_cmp(&self, other: &Filter) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Filter {
    fn cmp(&self, other: &Filter) -> Ordering {
        let all = |own: &Filter| own.a.into_iter().chain(own.b).collect::<Vec<f64>>();
        let numbers = all(self).into_iter().zip(all(other)).map(|(a, b)| a.total_cmp(&b));
        let orders = (self.poles, self.zeros).cmp(&(other.poles, other.zeros));
        numbers.fold(orders, Ordering::then)
    }
}

impl Hash for Filter {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.a.iter().chain(&self.b).for_each(|v| v.to_bits().hash(state));
    }
}

/// 1, a₁ … from reflection coefficients (Levinson 1947, Durbin 1960): a_j ← a_j + κ_i a_{i−j}.
fn step_up(kappa: &[f64]) -> [f64; PLACES] {
    let mut a = [0.0; PLACES];
    a[0] = 1.0;
    for (i, k) in (1..).zip(kappa) {
        let before = a;
        for j in 1..=i {
            a[j] = before[j] + k * before[i - j];
        }
    }
    a
}

/// The other way round (Schur, Cohn); `None` unless all roots are inside the unit circle.
fn step_down(a: &[f64; PLACES], order: usize) -> Option<Vec<f64>> {
    let mut a = *a;
    let mut kappa = vec![0.0; order];
    for i in (1..=order).rev() {
        let k = a[i];
        let left = 1.0 - k * k;
        if left.is_nan() || left <= 0.0 {
            return None;
        }
        kappa[i - 1] = k;
        let before = a;
        for j in 1..i {
            a[j] = (before[j] - k * before[i - j]) / left;
        }
        a[i] = 0.0;
    }
    Some(kappa)
}

/// One sample of the lattice: the states move on, `draw` enters.
fn turn(kappa: &[f64], states: &mut [f64], draw: f64) {
    let mut forward = draw;
    for i in (1..=states.len()).rev() {
        let (k, before) = (kappa[i - 1], states[i - 1]);
        let s = ((1.0 - k) * (1.0 + k)).sqrt();
        if i < states.len() {
            states[i] = k * forward + s * before;
        }
        forward = s * forward - k * before;
    }
    states[0] = forward;
}

/// x_{k+1} = F x_k + drive n, y = taps x, all for draws of variance one; F Fᵀ + drive driveᵀ = I.
struct Lattice {
    f: DMatrix<f64>,
    drive: DVector<f64>,
    taps: RowDVector<f64>,
    kappa: [f64; PLACES],
}

impl Lattice {
    /// F^lag tapsᵀ from the left: what taps times it is the covariance at that lag.
    fn remembered(&self, lag: u128) -> RowDVector<f64> {
        let mut row = self.taps.clone();
        let mut power = self.f.clone();
        let mut left = lag;
        while left > 0 {
            if left & 1 == 1 {
                row = &row * &power;
            }
            left >>= 1;
            if left > 0 {
                power = &power * &power;
                // forgotten
                if power.amax() < 1e-200 {
                    return row * 0.0;
                }
            }
        }
        row
    }
}

/// N² |B/A|².
pub(super) fn psd(density: f64, filter: &Filter, f_hz: f64, dt: f64) -> f64 {
    density * density * filter.power_gain(f_hz * dt)
}

/// N²/dt · taps F^lag tapsᵀ.
pub(super) fn autocovariance(density: f64, filter: &Filter, lag: u64, dt: f64) -> f64 {
    let lattice = filter.lattice();
    density * density / dt * lattice.remembered(u128::from(lag)).dot(&lattice.taps)
}

/// r_0/(2 m² dt²): N²/τ for long τ.
pub(super) fn allan_variance(density: f64, filter: &Filter, m: u64, dt: f64) -> f64 {
    second_differences(density, filter, m, m, &[0], dt)[0] / (2.0 * (m as f64 * dt).powi(2))
}

/// Windows up to so many samples are added up lag by lag, where the closed form would lose digits.
const SHORT: u64 = 128;
/// And up to this lag; beyond, covariances have died away as far as the closed form needs.
const NEAR: u64 = 4096;

/// Generalised covariance of θ: −N² dt [taps F (I − F)⁻² F^|l| tapsᵀ + ½ |l| taps (I + F)(I − F)⁻¹ tapsᵀ], that of a Gauss-Markov process at a
/// matrix argument.
pub(super) fn second_differences(density: f64, filter: &Filter, m1: u64, m2: u64, lags: &[i64], dt: f64) -> Vec<f64> {
    let lattice = filter.lattice();
    let scale = density * density * dt;
    let near = lags.iter().map(|h| h.unsigned_abs()).max().unwrap_or(0);
    if m1.max(m2) <= SHORT && near <= NEAR {
        return added_up(&lattice, m1, m2, near, lags).into_iter().map(|sum| scale * sum).collect();
    }
    let size = lattice.taps.len();
    let identity = DMatrix::<f64>::identity(size, size);
    // A is stable: I − F has an inverse
    let inverse = (&identity - &lattice.f).lu().try_inverse().unwrap_or_else(|| identity.clone());
    let once = &inverse * lattice.taps.transpose();
    let linear = 0.5 * (&lattice.taps * (&identity + &lattice.f) * &once)[(0, 0)];
    let column = &lattice.f * &inverse * once;
    let exponential = |l: i128| (lattice.remembered(l.unsigned_abs()) * &column)[(0, 0)];
    let of = |h: &i64| {
        let mut sum = linear * lag_sum(m1, m2, *h, i128::wrapping_abs);
        for (j, wj) in (0..).zip(WEIGHTS) {
            for (i, wi) in (0..).zip(WEIGHTS) {
                sum += (wi * wj) as f64 * exponential(i128::from(*h) + j * i128::from(m2) - i * i128::from(m1));
            }
        }
        -scale * sum
    };
    lags.iter().map(of).collect()
}

/// Σ_i Σ_j u_i v_j r(h + j − i), u and v the weights of the samples in z of both windows: −1 m times, then 1 m times.
fn added_up(lattice: &Lattice, m1: u64, m2: u64, near: u64, lags: &[i64]) -> Vec<f64> {
    let (m1, m2) = (m1 as i64, m2 as i64);
    // covariances of neighbouring samples up to the longest lag
    let mut row = lattice.taps.clone();
    let covariances: Vec<f64> = (0..near as i64 + 2 * (m1 + m2))
        .map(|_| {
            let own = row.dot(&lattice.taps);
            row = &row * &lattice.f;
            own
        })
        .collect();
    // Σ_i u_i v_{i+d}, from the overlaps of their halves
    let overlap = |d: i64| (m1.min(m2 - d) - (-d).max(0)).max(0);
    let weight = |d: i64| overlap(d) + overlap(d + m1 - m2) - overlap(d + m1) - overlap(d - m2);
    lags.iter()
        .map(|h| {
            let of = |d: i64| weight(d) as f64 * covariances[(h + d).unsigned_abs() as usize];
            (1 - 2 * m1..2 * m2).map(of).sum()
        })
        .collect()
}

/// The states of the lattice, in units of the sample.
pub(super) fn realisation(density: f64, filter: &Filter, dt: f64) -> Realisation {
    let Lattice { f, drive, taps, .. } = filter.lattice();
    let variance = density * density / dt;
    let size = taps.len();
    Realisation {
        phi: f,
        q: &drive * drive.transpose() * variance,
        p0: DMatrix::identity(size, size) * variance,
        h: taps,
        names: (1..=size).map(|k| if k == 1 { "band_limit".into() } else { format!("band_limit.{k}") }).collect(),
        exact: true,
    }
}

pub(super) struct Path {
    states: Vec<f64>,
    kappa: [f64; PLACES],
    taps: RowDVector<f64>,
    rng: ChaCha8Rng,
}

impl Path {
    pub(super) fn new(density: f64, filter: &Filter, dt: f64, mut rng: ChaCha8Rng) -> Self {
        let Lattice { taps, kappa, .. } = filter.lattice();
        let mut states = vec![0.0; taps.len()];
        fill_normal(&mut rng, &mut states);
        Path { states, kappa, taps: taps * (density / dt.sqrt()), rng }
    }
}

impl SamplePath for Path {
    fn fill(&mut self, out: &mut [f64]) {
        for y in out {
            *y = self.taps.iter().zip(&self.states).map(|(tap, state)| tap * state).sum();
            let draw = normal(&mut self.rng);
            turn(&self.kappa[..self.states.len()], &mut self.states, draw);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against central differences of ln|B/A|² and of ln b₀²: steps of 1e-4, errors of their square.
    #[test]
    fn slopes_are_those_of_the_spectrum() {
        let ratios = [3.0, 0.4, 12.0, 0.3, 2.0, 0.7];
        let turns = [0.0, 0.01, 0.13, 0.31, 0.5];
        let [sin, cos]: [Vec<f64>; 2] =
            [f64::sin, f64::cos].map(|of| turns.iter().map(|f| of(std::f64::consts::PI * f)).collect());
        for (i, (slope, level)) in Filter::slopes(&ratios, &sin, &cos).into_iter().enumerate() {
            let moved = |by: f64| {
                let mut own = ratios;
                own[i] *= f64::exp(by);
                Filter::from_area_ratios(&own).unwrap()
            };
            let (above, below) = (moved(1e-4), moved(-1e-4));
            let of = |value: &dyn Fn(&Filter) -> f64| (value(&above).ln() - value(&below).ln()) / 2e-4;
            for (f, found) in turns.iter().zip(&slope) {
                let expected = of(&|filter| filter.power_gain(*f));
                assert!((found - expected).abs() < 1e-6, "{i} at {f}: {found}, not {expected}");
            }
            let expected = of(&|filter| filter.innovation());
            assert!((level - expected).abs() < 1e-6, "{i}: {level}, not {expected}");
        }
    }
}
