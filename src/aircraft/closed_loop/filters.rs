//! Filters of one signal: low-pass and notch by the bilinear rule, exact at their own frequency (prewarped).

use std::f64::consts::{PI, SQRT_2};

use nalgebra::{DMatrix, dmatrix};

use crate::aircraft::control::response::StateSpace;

/// H(s) = 1/(1 + s/ω) or 1/(1 + √2 s/ω + s²/ω²) (Butterworth 1930), s → (1/K)(z − 1)/(z + 1), K = tan(π f Δ). `corner`
/// in Hz below half the rate, `interval` in s.
pub fn lowpass(order: u64, corner: f64, interval: f64) -> StateSpace {
    let k = (PI * corner * interval).tan();
    if order == 1 {
        let (b, a) = (k / (1.0 + k), (k - 1.0) / (k + 1.0));
        let system = [-a, b * (1.0 - a), 1.0, b].map(|x| DMatrix::from_element(1, 1, x));
        let [a, b, c, d] = system;
        return StateSpace { a, b, c, d, interval: Some(interval) };
    }
    let scale = 1.0 / (1.0 + SQRT_2 * k + k * k);
    let b = k * k * scale;
    two_poles([b, 2.0 * b, b], [2.0 * (k * k - 1.0) * scale, (1.0 - SQRT_2 * k + k * k) * scale], interval)
}

/// H(s) = (s² + ω²)/(s² + w s + ω²), w the width in rad/s.
pub fn notch(frequency: f64, width: f64, interval: f64) -> StateSpace {
    let k = (PI * frequency * interval).tan();
    let damped = k * width / frequency;
    let scale = 1.0 / (1.0 + damped + k * k);
    let (b, middle) = ((1.0 + k * k) * scale, 2.0 * (k * k - 1.0) * scale);
    two_poles([b, middle, b], [middle, (1.0 - damped + k * k) * scale], interval)
}

/// (b0 + b1 z⁻¹ + b2 z⁻²)/(1 + a1 z⁻¹ + a2 z⁻²).
fn two_poles([b0, b1, b2]: [f64; 3], [a1, a2]: [f64; 2], interval: f64) -> StateSpace {
    StateSpace {
        a: dmatrix![-a1, 1.0; -a2, 0.0],
        b: dmatrix![b1 - a1 * b0; b2 - a2 * b0],
        c: dmatrix![1.0, 0.0],
        d: dmatrix![b0],
        interval: Some(interval),
    }
}
