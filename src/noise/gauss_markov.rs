//! First-order Gauss–Markov process: y_{k+1} = φ y_k + σ √(1 − φ²) n_k, φ = e^{−dt/Tc}, with stationary start.
//! Other names: Ornstein–Uhlenbeck process, exponentially correlated noise, AR(1).
//!
//! Written in x = dt/Tc with `exp_m1` and short series, so that nothing cancels for x from 1e-9 to 1e3 and beyond.

use nalgebra::{dmatrix, dvector};
use rand::rngs::ChaCha8Rng;

use super::second_difference::{Side, WEIGHTS, side};
use super::{Realisation, SamplePath};
use crate::numerics::random::normal;

/// dt σ² (1 − φ²)/((1 − φ)² + 4 φ sin²(π f dt)) as a function of the sine.
#[derive(Clone, Copy)]
pub(super) struct Spectrum {
    numerator: f64,
    constant: f64,
    slope: f64,
}

impl Spectrum {
    pub(super) fn new(std_dev: f64, correlation_time: f64, dt: f64) -> Spectrum {
        let x = dt / correlation_time;
        Spectrum {
            numerator: dt * std_dev * std_dev * -(-2.0 * x).exp_m1(),
            constant: (-x).exp_m1().powi(2),
            slope: 4.0 * (-x).exp(),
        }
    }

    /// At sin(π f dt).
    pub(super) fn at(&self, sin: f64) -> f64 {
        self.numerator / (self.constant + self.slope * sin * sin)
    }
}

pub(super) fn psd(std_dev: f64, correlation_time: f64, f_hz: f64, dt: f64) -> f64 {
    Spectrum::new(std_dev, correlation_time, dt).at((std::f64::consts::PI * f_hz * dt).sin())
}

/// σ² φ^lag.
pub(super) fn autocovariance(std_dev: f64, correlation_time: f64, lag: u64, dt: f64) -> f64 {
    std_dev * std_dev * (-(lag as f64) * dt / correlation_time).exp()
}

/// σ²/m² · [m(1+φ)/(1−φ) − 2φ(1−φ^m)/(1−φ)² − φ(1−φ^m)²/(1−φ)²], evaluated as r_0/(2 m² dt²).
pub(super) fn allan_variance(std_dev: f64, correlation_time: f64, m: u64, dt: f64) -> f64 {
    let m_real = m as f64;
    std_dev * std_dev * Lags::new(dt / correlation_time, m, m).covariance(0) / (2.0 * m_real * m_real)
}

/// Closed form in O(1); see [`Lags`].
pub(super) fn second_difference(std_dev: f64, correlation_time: f64, m1: u64, m2: u64, h: i64, dt: f64) -> f64 {
    let scale = std_dev * dt;
    let (lags, sign) = Lags::ordered(dt / correlation_time, m1, m2);
    scale * scale * lags.covariance(sign * i128::from(h))
}

/// The same at many lags: what does not depend on the lag is worked out once.
pub(super) fn second_differences(
    std_dev: f64,
    correlation_time: f64,
    m1: u64,
    m2: u64,
    h: &[i64],
    dt: f64,
) -> Vec<f64> {
    let scale = std_dev * dt;
    let (lags, sign) = Lags::ordered(dt / correlation_time, m1, m2);
    h.iter().map(|h| scale * scale * lags.covariance(sign * i128::from(*h))).collect()
}

/// Second differences of θ for σ = dt = 1.
///
/// Generalised covariance of θ: −(a φ^|l| + b |l|), a = φ/(1−φ)², b = (1+φ)/(2(1−φ)). For l on one side of zero the
/// second difference of φ^|l| over a window is a product and that of |l| vanishes; only windows that straddle zero
/// need the terms themselves. As long as the longer window is short against Tc, the common value a (m1 x)² is taken
/// out of each term: it vanishes in the second difference over the other window, and what is left does not cancel.
struct Lags {
    x: f64,
    m1: u64,
    m2: u64,
    /// a = φ/(1−φ)².
    a: f64,
    /// m1 x.
    v1: f64,
    /// 1 − φ^{m1} and 1 − φ^{m2}.
    q1: f64,
    q2: f64,
    /// True: a (m1 x)² has been taken out.
    reduced: bool,
}

impl Lags {
    /// The shorter one first: cov(z1_k, z2_{k+h}) = cov(z2_k, z1_{k−h}), so the sign of the lag may turn.
    fn ordered(x: f64, m1: u64, m2: u64) -> (Self, i128) {
        if m1 <= m2 { (Lags::new(x, m1, m2), 1) } else { (Lags::new(x, m2, m1), -1) }
    }

    /// m1 ≤ m2.
    fn new(x: f64, m1: u64, m2: u64) -> Self {
        let v1 = m1 as f64 * x;
        let a = (-x).exp() / (-x).exp_m1().powi(2);
        Lags { x, m1, m2, a, v1, q1: -(-v1).exp_m1(), q2: -(-(m2 as f64) * x).exp_m1(), reduced: m2 as f64 * x <= 1.0 }
    }

    fn covariance(&self, h: i128) -> f64 {
        let m2 = i128::from(self.m2);
        let gap = (h - 2 * i128::from(self.m1)).max(-h - 2 * m2);
        if gap >= 0 {
            // the windows do not overlap: all nine lags are on one side
            return -self.a * (-real(gap) * self.x).exp() * (self.q1 * self.q2).powi(2);
        }
        -(self.term(h) - 2.0 * self.term(h + m2) + self.term(h + 2 * m2))
    }

    /// Σ_i d_i (a φ^|l| + b |l|) over l = L − i m1, less a (m1 x)² if reduced.
    fn term(&self, lag: i128) -> f64 {
        let (x, a, v1, q1) = (self.x, self.a, self.v1, self.q1);
        match side(lag, self.m1) {
            Side::Clear(distance) => {
                let u = real(distance as i128) * x;
                if self.reduced {
                    a * ((-u).exp_m1() * q1 * q1 - remainder2(v1) * (q1 + v1))
                } else {
                    a * (-u).exp() * q1 * q1
                }
            }
            Side::Straddles => {
                let lags = [0, 1, 2].map(|i| (lag - i * i128::from(self.m1)).abs());
                let absolute = lags.iter().zip(WEIGHTS).map(|(l, w)| l * w).sum::<i128>();
                let absolute = real(absolute);
                let sum = |f: fn(f64) -> f64| -> f64 {
                    lags.iter().zip(WEIGHTS).map(|(l, w)| w as f64 * f(real(*l) * x)).sum()
                };
                if v1 <= 1.0 {
                    // φ^|l| = 1 − u + u²/2 + remainder; the square is the part taken out, b − a x = a (sinh x − x)
                    let whole = a * (sum(remainder3) + absolute * sinh_less_argument(x));
                    if self.reduced { whole } else { whole + a * v1 * v1 }
                } else {
                    let one_less_phi = -(-x).exp_m1();
                    a * sum(|u| (-u).exp()) + (2.0 - one_less_phi) / (2.0 * one_less_phi) * absolute
                }
            }
        }
    }
}

/// A lag as a number; wide integers that fit a narrow one are converted as such, many times faster.
fn real(lag: i128) -> f64 {
    i64::try_from(lag).map_or_else(|_| lag as f64, |lag| lag as f64)
}

/// e^{−u} − 1 + u.
fn remainder2(u: f64) -> f64 {
    if u > 1.0 { (-u).exp_m1() + u } else { tail_series(u, 2) }
}

/// e^{−u} − 1 + u − u²/2.
fn remainder3(u: f64) -> f64 {
    if u > 1.0 { (-u).exp_m1() + u - 0.5 * u * u } else { tail_series(u, 3) }
}

/// Σ_{k ≥ first} (−u)^k/k! for 0 ≤ u ≤ 1.
fn tail_series(u: f64, first: usize) -> f64 {
    /// 1/k: products are faster than quotients.
    const RECIPROCALS: [f64; 21] = {
        let mut reciprocals = [0.0; 21];
        let mut k = 1;
        while k < 21 {
            reciprocals[k] = 1.0 / k as f64;
            k += 1;
        }
        reciprocals
    };
    // Horner from the first term that no longer counts down: below 1/20!, and of small arguments below (1/16)^9/9!
    let terms = if u < 1.0 / 16.0 { 9 } else { 17 };
    let mut sum = 1.0;
    for reciprocal in RECIPROCALS[first + 1..=first + terms].iter().rev() {
        sum = 1.0 - u * reciprocal * sum;
    }
    RECIPROCALS[1..=first].iter().fold(sum, |lead, reciprocal| lead * (-u * reciprocal))
}

/// sinh x − x.
fn sinh_less_argument(x: f64) -> f64 {
    if x > 1.0 {
        return x.sinh() - x;
    }
    let mut sum = 1.0;
    for k in (2..=9).rev() {
        sum = 1.0 + x * x / f64::from(2 * k * (2 * k + 1)) * sum;
    }
    x.powi(3) / 6.0 * sum
}

/// One state with its exact discretisation and stationary start.
pub(super) fn realisation(std_dev: f64, correlation_time: f64, dt: f64) -> Realisation {
    let variance = std_dev * std_dev;
    let x = dt / correlation_time;
    Realisation {
        phi: dmatrix![(-x).exp()],
        q: dmatrix![variance * -(-2.0 * x).exp_m1()],
        p0: dmatrix![variance],
        h: dvector![1.0].transpose(),
        names: vec!["gauss_markov".into()],
        exact: true,
    }
}

pub(super) struct Path {
    value: f64,
    phi: f64,
    drive: f64,
    rng: ChaCha8Rng,
}

impl Path {
    pub(super) fn new(std_dev: f64, correlation_time: f64, dt: f64, mut rng: ChaCha8Rng) -> Self {
        let x = dt / correlation_time;
        Path { value: std_dev * normal(&mut rng), phi: (-x).exp(), drive: std_dev * (-(-2.0 * x).exp_m1()).sqrt(), rng }
    }
}

impl SamplePath for Path {
    fn fill(&mut self, out: &mut [f64]) {
        for y in out {
            *y = self.value;
            self.value = self.phi * self.value + self.drive * normal(&mut self.rng);
        }
    }
}
