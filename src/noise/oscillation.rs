//! Oscillation, a vibration line: second-order Gauss–Markov process with the autocovariance σ² e^{−|τ|/Tc} cos(2πf₀τ).
//! Source: Maybeck 1979, Stochastic Models, Estimation and Control, vol. 1, section 4.11 (with phase zero).
//!
//! It is the real part of a complex Gauss–Markov process y_{k+1} = φ y_k + …, φ = e^{−z}, z = dt/Tc − i2πf₀dt, so
//! that every form is that of a Gauss–Markov process at a complex argument. The phase of φ^l is reduced exactly, so
//! that no lag is too long. A line above half the sample rate is sampled as its alias;
//! [`super::NoiseModel::check_rate`] refuses it all the same.

use std::f64::consts::TAU;

use nalgebra::{Complex, DMatrix, dmatrix, dvector};
use rand::rngs::ChaCha8Rng;

use super::second_difference::{Side, WEIGHTS, side};
use super::{Realisation, SamplePath, gauss_markov};
use crate::numerics::random::normal;

/// Half the sum of the Gauss–Markov spectrum shifted to f₀ and to −f₀.
pub(super) fn psd(std_dev: f64, frequency_hz: f64, correlation_time: f64, f_hz: f64, dt: f64) -> f64 {
    let at = |f: f64| gauss_markov::psd(std_dev, correlation_time, f, dt);
    0.5 * (at(f_hz - frequency_hz) + at(f_hz + frequency_hz))
}

/// σ² Re φ^lag.
pub(super) fn autocovariance(std_dev: f64, frequency_hz: f64, correlation_time: f64, lag: u64, dt: f64) -> f64 {
    std_dev * std_dev * Rotation::new(frequency_hz, correlation_time, dt).power(lag as f64).re
}

/// σ²/m² Re[m(1+φ)/(1−φ) − 2φ(1−φ^m)/(1−φ)² − φ(1−φ^m)²/(1−φ)²], evaluated as r_0/(2 m² dt²).
pub(super) fn allan_variance(std_dev: f64, frequency_hz: f64, correlation_time: f64, m: u64, dt: f64) -> f64 {
    let m_real = m as f64;
    let rotation = Rotation::new(frequency_hz, correlation_time, dt);
    std_dev * std_dev * Lags::new(rotation, m, m).covariance(0) / (2.0 * m_real * m_real)
}

/// Closed form in O(1); see [`Lags`].
pub(super) fn second_difference(
    [std_dev, frequency_hz, correlation_time]: [f64; 3],
    m1: u64,
    m2: u64,
    h: i64,
    dt: f64,
) -> f64 {
    let (m1, m2, h) = if m1 <= m2 { (m1, m2, i128::from(h)) } else { (m2, m1, -i128::from(h)) };
    let scale = std_dev * dt;
    scale * scale * Lags::new(Rotation::new(frequency_hz, correlation_time, dt), m1, m2).covariance(h)
}

/// z = x − i2π(cycles + rest); cycles + rest is f₀dt without rounding.
#[derive(Clone, Copy)]
struct Rotation {
    x: f64,
    cycles: f64,
    rest: f64,
}

impl Rotation {
    fn new(frequency_hz: f64, correlation_time: f64, dt: f64) -> Self {
        let cycles = frequency_hz * dt;
        Rotation { x: dt / correlation_time, cycles, rest: frequency_hz.mul_add(dt, -cycles) }
    }
    /// l z.
    fn times(self, l: f64) -> Complex<f64> {
        Complex::new(l * self.x, -TAU * l * self.cycles)
    }
    /// Argument of φ^l, within ±π.
    fn phase(self, l: f64) -> f64 {
        let turns = l * self.cycles;
        let error = l.mul_add(self.cycles, -turns) + l * self.rest;
        TAU * (turns - turns.round() + error)
    }
    /// φ^l.
    fn power(self, l: f64) -> Complex<f64> {
        Complex::from_polar((-l * self.x).exp(), self.phase(l))
    }
    /// φ^l − 1.
    fn power_less_one(self, l: f64) -> Complex<f64> {
        let (phase, decay) = (self.phase(l), (-l * self.x).exp_m1());
        let half = (0.5 * phase).sin();
        Complex::new(decay * phase.cos() - 2.0 * half * half, (decay + 1.0) * phase.sin())
    }
}

/// Second differences of θ for σ = dt = 1: those of the Gauss–Markov process at complex argument, real part.
///
/// Generalised covariance of θ: −Re(a φ^|l| + b |l|), a = φ/(1−φ)², b = (1+φ)/(2(1−φ)). As long as the longer window
/// is short,
/// |m2 z| ≤ 1, the common value a (m1 z)² is taken out of each term, as for the real process.
///
/// Error below 3e-14 of √(r_0(m1) r_0(m2)) + |a| (min(1, |m1 z|) min(1, |m2 z|))², the variances and what a pure
/// line shows: only for a nearly pure line with whole turns in m, where its variance vanishes, is the latter the
/// larger.
struct Lags {
    rotation: Rotation,
    m1: u64,
    m2: u64,
    a: Complex<f64>,
    /// Re b.
    b: f64,
    /// m1 z.
    v1: Complex<f64>,
    /// 1 − φ^{m1}.
    q1: Complex<f64>,
    /// True: a (m1 z)² has been taken out.
    reduced: bool,
}

impl Lags {
    /// m1 ≤ m2.
    fn new(rotation: Rotation, m1: u64, m2: u64) -> Self {
        let step = rotation.power_less_one(1.0);
        Lags {
            rotation,
            m1,
            m2,
            a: rotation.power(1.0) / (step * step),
            b: -(-2.0 * rotation.x).exp_m1() / (2.0 * step.norm_sqr()),
            v1: rotation.times(m1 as f64),
            q1: -rotation.power_less_one(m1 as f64),
            reduced: rotation.times(m2 as f64).norm() <= 1.0,
        }
    }

    fn covariance(&self, h: i128) -> f64 {
        let m2 = i128::from(self.m2);
        let gap = (h - 2 * i128::from(self.m1)).max(-h - 2 * m2);
        if gap >= 0 {
            // the windows do not overlap: all nine lags are on one side
            let both = self.q1 * self.rotation.power_less_one(self.m2 as f64);
            return -(self.a * self.rotation.power(gap as f64) * both * both).re;
        }
        -(self.term(h) - 2.0 * self.term(h + m2) + self.term(h + 2 * m2))
    }

    /// Re Σ_i d_i (a φ^|l| + b |l|) over l = L − i m1, less Re a (m1 z)² if reduced.
    fn term(&self, lag: i128) -> f64 {
        let (a, v1, q1) = (self.a, self.v1, self.q1);
        match side(lag, self.m1) {
            Side::Clear(distance) => {
                let l = distance as f64;
                let sum = if self.reduced {
                    self.rotation.power_less_one(l) * q1 * q1 - remainder(v1, 2) * (q1 + v1)
                } else {
                    self.rotation.power(l) * q1 * q1
                };
                (a * sum).re
            }
            Side::Straddles => {
                let lags = [0, 1, 2].map(|i| (lag - i * i128::from(self.m1)).abs());
                let absolute = lags.iter().zip(WEIGHTS).map(|(l, w)| l * w).sum::<i128>() as f64;
                let sum = |f: &dyn Fn(f64) -> Complex<f64>| -> Complex<f64> {
                    lags.iter().zip(WEIGHTS).map(|(l, w)| f(*l as f64) * w as f64).sum()
                };
                if v1.norm() <= 1.0 {
                    // φ^|l| = 1 − u + u²/2 + remainder; the square is the part taken out, b − a z = a (sinh z − z)
                    let odd = sinh_less_argument(self.rotation.times(1.0)) * absolute;
                    let whole = sum(&|l| remainder(self.rotation.times(l), 3)) + odd;
                    (a * if self.reduced { whole } else { whole + v1 * v1 }).re
                } else {
                    (a * sum(&|l| self.rotation.power(l))).re + self.b * absolute
                }
            }
        }
    }
}

/// e^{−u} less the first `first` terms of its series, |u| ≤ 2.
fn remainder(u: Complex<f64>, first: u32) -> Complex<f64> {
    // Horner from the term 2^26/26! < 1e-18 down
    let mut sum = Complex::from(1.0);
    for k in (first + 1..=first + 23).rev() {
        sum = Complex::from(1.0) - u * sum / f64::from(k);
    }
    (1..=first).fold(sum, |lead, k| -lead * u / f64::from(k))
}

/// sinh z − z, |z| ≤ 1.
fn sinh_less_argument(z: Complex<f64>) -> Complex<f64> {
    let mut sum = Complex::from(1.0);
    for k in (2..=9).rev() {
        sum = Complex::from(1.0) + z * z * sum / f64::from(2 * k * (2 * k + 1));
    }
    z * z * z * sum / 6.0
}

/// The process and its quadrature, exact, with stationary start.
pub(super) fn realisation(std_dev: f64, frequency_hz: f64, correlation_time: f64, dt: f64) -> Realisation {
    let rotation = Rotation::new(frequency_hz, correlation_time, dt);
    let phi = rotation.power(1.0);
    let variance = std_dev * std_dev;
    Realisation {
        phi: dmatrix![phi.re, -phi.im; phi.im, phi.re],
        q: DMatrix::identity(2, 2) * (variance * -(-2.0 * rotation.x).exp_m1()),
        p0: DMatrix::identity(2, 2) * variance,
        h: dvector![1.0, 0.0].transpose(),
        names: vec!["oscillation".into(), "oscillation.quadrature".into()],
        exact: true,
    }
}

pub(super) struct Path {
    value: Complex<f64>,
    phi: Complex<f64>,
    drive: f64,
    rng: ChaCha8Rng,
}

impl Path {
    pub(super) fn new(std_dev: f64, frequency_hz: f64, correlation_time: f64, dt: f64, mut rng: ChaCha8Rng) -> Self {
        let rotation = Rotation::new(frequency_hz, correlation_time, dt);
        Path {
            value: pair(&mut rng) * std_dev,
            phi: rotation.power(1.0),
            drive: std_dev * (-(-2.0 * rotation.x).exp_m1()).sqrt(),
            rng,
        }
    }
}

/// Two independent normal numbers.
fn pair(rng: &mut ChaCha8Rng) -> Complex<f64> {
    let re = normal(rng);
    Complex::new(re, normal(rng))
}

impl SamplePath for Path {
    fn fill(&mut self, out: &mut [f64]) {
        for y in out {
            *y = self.value.re;
            self.value = self.phi * self.value + pair(&mut self.rng) * self.drive;
        }
    }
}
