//! Flicker (1/f) noise in discrete time: fractional integration of order 1/2, (1 − z⁻¹)^{−1/2} acting on white noise of
//! standard deviation B (Kasdin 1995). Its spectrum is B²dt/(2|sin πf dt|), which tends to B²/(2π|f|).
//! Other names: bias instability, 1/f noise, pink noise. The floor of the Allan deviation is B √(2 ln2/π) = 0.6643 B.
//!
//! The variance does not exist, that of differences does: the generalised covariance of the samples is −(B²/π) ψ(|l| +
//! ½). Since ψ(l + ½) − ψ(½) = ∫₀^∞ (1 − e^{−lx})/(2 sinh(x/2)) dx, the process is exactly a mixture of
//! Gauss–Markov processes with φ = e^{−x} and variance density B²/(2π sinh(x/2)). The trapezoidal rule in ln x makes
//! of it a chain of few states whose error is known: the filter's realisation and the sample path are such chains.

use std::f64::consts::PI;

use nalgebra::{DMatrix, DVector, RowDVector};
use rand::rngs::ChaCha8Rng;

use super::second_difference::{Side, WEIGHTS, side};
use super::{Realisation, SamplePath, gauss_markov};
use crate::numerics::random::normal;

/// B² dt/(2 |sin πf dt|); infinite at f = 0.
pub(super) fn psd(coefficient: f64, f_hz: f64, dt: f64) -> f64 {
    coefficient * coefficient * dt / (2.0 * (PI * f_hz * dt).sin().abs())
}

/// B²/(8πm²) · [(16m² − 1)(ψ(2m + ½) − ψ(m + ½)) + 3(ψ(m + ½) − ψ(½))]: 2B²/π at m = 1, 2 ln2 B²/π for large m.
pub(super) fn allan_variance(coefficient: f64, m: u64) -> f64 {
    let square = (m as f64).powi(2);
    let psi = digamma_half(u128::from(m));
    let bracket = (16.0 * square - 1.0) * (digamma_half(2 * u128::from(m)) - psi) + 3.0 * (psi - digamma_half(0));
    coefficient * coefficient / (8.0 * PI * square) * bracket
}

/// Generalised covariance of θ: (B²dt²/8π)(4l² − 1)(ψ(|l| + ½) − c), with c chosen so that the bracket is of order one.
pub(super) fn second_difference(coefficient: f64, m1: u64, m2: u64, h: i64, dt: f64) -> f64 {
    let (m1, m2, h) = if m1 <= m2 { (m1, m2, i128::from(h)) } else { (m2, m1, -i128::from(h)) };
    let centre = digamma_half(u128::from(m2));
    let step = i128::from(m2);
    let sum = term(h, m1, centre) - 2.0 * term(h + step, m1, centre) + term(h + 2 * step, m1, centre);
    (coefficient * dt).powi(2) / (8.0 * PI) * sum
}

/// Σ_i d_i (4l² − 1)(ψ(|l| + ½) − c) over l = L − i m.
fn term(lag: i128, m: u64, c: f64) -> f64 {
    match side(lag, m) {
        Side::Clear(distance) if distance >= ASYMPTOTIC => {
            // (4l² − 1)(ψ(l + ½) − c) = (4l² − 1)(ln l − c) + 1/6 + tail(l): the second differences of l² ln l and
            // ln l in closed form
            let (m, x) = (m as f64, distance as f64 + m as f64);
            let r = m / x;
            let logarithm = (-r * r).ln_1p();
            let curvature = (1.0 + r * r) * logarithm / (r * r) + 4.0 * r.atanh() / r;
            8.0 * m * m * (x.ln() - c) + 4.0 * m * m * curvature - logarithm + tail(x - m) - 2.0 * tail(x) + tail(x + m)
        }
        _ => (0..)
            .zip(WEIGHTS)
            .map(|(i, w)| {
                let l = (lag - i * i128::from(m)).unsigned_abs();
                let square = (l as f64).powi(2);
                w as f64 * (4.0 * square - 1.0) * (digamma_half(l) - c)
            })
            .sum(),
    }
}

/// From here on the asymptotic series below are right to 1e-16.
const ASYMPTOTIC: u128 = 16;

/// ψ(l + ½) = ln l + Σ_k A_k l^{−2k}, A_k = −B_{2k}(½)/(2k). Source: DLMF 5.11.2 at half-integers.
const A: [f64; 6] =
    [1.0 / 24.0, -7.0 / 960.0, 31.0 / 8064.0, -127.0 / 30720.0, 511.0 / 67584.0, -1414477.0 / 67_092_480.0];

/// (4l² − 1) Σ_k A_k l^{−2k} − 1/6.
fn tail(l: f64) -> f64 {
    let y = 1.0 / (l * l);
    let mut sum = -A[5];
    for k in (0..5).rev() {
        sum = sum * y + 4.0 * A[k + 1] - A[k];
    }
    sum * y
}

/// ψ(l + ½) for integer l.
fn digamma_half(l: u128) -> f64 {
    if l >= ASYMPTOTIC {
        let x = l as f64;
        let y = 1.0 / (x * x);
        return x.ln() + y * A.iter().rev().fold(0.0, |sum, a| sum * y + a);
    }
    // ψ(½) = −γ − 2 ln 2
    let mut psi = -0.577_215_664_901_532_9 - 2.0 * std::f64::consts::LN_2;
    for k in 1..=l {
        psi += 2.0 / (2 * k - 1) as f64;
    }
    psi
}

/// Nodes x = dt/Tc (fast to slow) with their variances for B = 1: trapezoidal rule in ln x from `fast` to a time
/// constant of twice the horizon, at least `per_decade` of them. The two end variances, which also stand for what
/// lies beyond the ends, are set so that the Allan variance is exact at m = 1 and at the horizon.
fn chain(fast: f64, per_decade: f64, horizon: u64) -> Vec<(f64, f64)> {
    let range = (fast * 2.0 * horizon as f64).ln();
    let steps = (range * per_decade / std::f64::consts::LN_10).ceil().max(1.0);
    let step = range / steps;
    let mut nodes: Vec<(f64, f64)> = (0..=steps as usize)
        .map(|k| {
            let x = fast * (-(k as f64) * step).exp();
            (x, step * x / (2.0 * PI * (0.5 * x).sinh()))
        })
        .collect();
    let missing = |m: u64| {
        let chain: f64 =
            nodes.iter().map(|(x, variance)| variance * gauss_markov::allan_variance(1.0, 1.0, m, *x)).sum();
        allan_variance(1.0, m) - chain
    };
    let (at_1, at_horizon) = (missing(1), missing(horizon));
    if let [first, .., last] = nodes.as_mut_slice() {
        let of = |x: f64, m: u64| gauss_markov::allan_variance(1.0, 1.0, m, x);
        let (a, b, c, d) = (of(first.0, 1), of(last.0, 1), of(first.0, horizon), of(last.0, horizon));
        let determinant = a * d - b * c;
        first.1 += (d * at_1 - b * at_horizon) / determinant;
        last.1 += (a * at_horizon - c * at_1) / determinant;
    }
    nodes
}

/// Three Gauss–Markov states in two decades of time constants, from dt/3 to twice the horizon: the Allan variance is
/// right to 1 % for dt ≤ τ ≤ horizon (at least 30 dt). Not exact: slower drift than that is left to the constant bias.
pub(super) fn realisation(coefficient: f64, dt: f64, horizon_s: f64) -> Realisation {
    let nodes = chain(3.0, 1.5, (horizon_s / dt).clamp(30.0, 1e12) as u64);
    let variance = coefficient * coefficient;
    let of = |f: &dyn Fn(f64, f64) -> f64| {
        DVector::from_iterator(nodes.len(), nodes.iter().map(|(x, v)| f(*x, variance * v)))
    };
    Realisation {
        phi: DMatrix::from_diagonal(&of(&|x, _| (-x).exp())),
        q: DMatrix::from_diagonal(&of(&|x, v| v * -(-2.0 * x).exp_m1())),
        p0: DMatrix::from_diagonal(&of(&|_, v| v)),
        h: RowDVector::from_element(nodes.len(), 1.0),
        names: (1..=nodes.len())
            .map(|k| if k == 1 { "bias_instability".into() } else { format!("bias_instability.{k}") })
            .collect(),
        exact: false,
    }
}

/// Up to this many samples the sample path is right; its slowest time constant is twice that.
const PATH_HORIZON: u64 = 5_000_000_000;

/// A sum of Gauss–Markov processes, three a decade, from dt/12 to 10¹⁰ samples, each with stationary start: the Allan
/// variance is right to 1e-3 up to 10⁸ samples. The level of the path is arbitrary (standard deviation about 2.8 B).
pub(super) struct Path {
    /// (value, φ, driving standard deviation), fast to slow.
    states: Vec<(f64, f64, f64)>,
    rng: ChaCha8Rng,
}

impl Path {
    pub(super) fn new(coefficient: f64, mut rng: ChaCha8Rng) -> Self {
        let states = chain(12.0, 3.0, PATH_HORIZON)
            .into_iter()
            .map(|(x, variance)| {
                let std_dev = coefficient * variance.sqrt();
                (std_dev * normal(&mut rng), (-x).exp(), std_dev * (-(-2.0 * x).exp_m1()).sqrt())
            })
            .collect();
        Path { states, rng }
    }
}

impl SamplePath for Path {
    fn fill(&mut self, out: &mut [f64]) {
        for y in out {
            *y = 0.0;
            for (value, phi, drive) in &mut self.states {
                *y += *value;
                *value = *phi * *value + *drive * normal(&mut self.rng);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Largest relative error of the chain's Allan variance over m = 1 … last, ten points a decade.
    fn worst(nodes: &[(f64, f64)], last: f64) -> f64 {
        (0..=(10.0 * last.log10()).round() as i32)
            .map(|k| {
                let m = 10f64.powf(f64::from(k) / 10.0).round() as u64;
                let sum: f64 = nodes.iter().map(|(x, v)| v * gauss_markov::allan_variance(1.0, 1.0 / x, m, 1.0)).sum();
                (sum / allan_variance(1.0, m) - 1.0).abs()
            })
            .fold(0.0, f64::max)
    }

    #[test]
    fn chain_of_the_filter_is_right_to_its_stated_error() {
        for k in 0..66 {
            let horizon = 10f64.powf(1.5 + 0.1 * f64::from(k)).round() as u64;
            let nodes = chain(3.0, 1.5, horizon);
            let error = worst(&nodes, horizon as f64);
            assert!(error < 1e-2, "horizon {horizon} samples, {} states: {error}", nodes.len());
            assert!(nodes.iter().all(|(_, variance)| *variance > 0.0));
        }
    }

    #[test]
    fn chain_of_the_sample_path_is_right_to_its_stated_error() {
        let nodes = chain(12.0, 3.0, PATH_HORIZON);
        assert!(worst(&nodes, 1e8) < 1e-3, "{}", worst(&nodes, 1e8));
        let level = nodes.iter().map(|(_, v)| v).sum::<f64>().sqrt();
        assert!((2.7..2.9).contains(&level), "level {level} B");
    }
}
