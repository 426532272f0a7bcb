//! What the processes of a model are together: white noise at low frequencies, and the growth of the drift over short times. Both are known better than
//! their parts, and are what files with one white number and one walk hold.

use super::FAST;
use super::form::Piece;
use super::interval;
use super::ordinates::Ordinates;
use super::whittle::{self, Fit};
use crate::numerics::distribution::NORMAL_95;
use nalgebra::DMatrix;

/// SI, with its 95 % interval by the delta method on the logarithm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sum {
    pub value: f64,
    pub interval: Option<[f64; 2]>,
}

/// Over all processes of a fit.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sums {
    /// N² = Σ N_i² + Σ σ²dt coth(dt/2Tc), the spectrum at f = 0 of the Gauss-Markov processes that forget within ten samples: a matter of bandwidth.
    pub white: Option<Sum>,
    /// K² = Σ K_i² + Σ 2σ²/Tc of the others; none with flicker, whose growth has no limit.
    pub walk: Option<Sum>,
}

/// A part of a square, and by which powers it goes with the parameters.
type Part = (f64, Vec<(usize, f64)>);

/// `information`: of the logarithms, where it is better known than by the cosine coefficients.
pub(super) fn sums(data: &Ordinates, fit: &Fit, information: Option<&DMatrix<f64>>) -> Sums {
    let (mut white, mut walk): (Vec<Part>, Vec<Part>) = (Vec::new(), Vec::new());
    let mut flicker = false;
    let mut at = 0;
    for (piece, logs) in fit.form.split(&fit.logs) {
        let values: Vec<f64> = logs.iter().map(|v| v.exp()).collect();
        match (piece, &values[..]) {
            (Piece::White | Piece::MovingAverage(_), &[n]) => white.push((n * n, vec![(at, 2.0)])),
            (Piece::RandomWalk, &[k]) => walk.push((k * k, vec![(at, 2.0)])),
            (Piece::GaussMarkov, &[sigma, time]) if time < FAST * data.dt => {
                let x = data.dt / time;
                white.push((sigma * sigma * data.dt / (0.5 * x).tanh(), vec![(at, 2.0), (at + 1, x / x.sinh())]));
            }
            (Piece::GaussMarkov, &[sigma, time]) => {
                walk.push((2.0 * sigma * sigma / time, vec![(at, 2.0), (at + 1, -1.0)]));
            }
            (Piece::Flicker, _) => flicker = true,
            _ => {}
        }
        at += logs.len();
    }
    let information = information.cloned().unwrap_or_else(|| whittle::observed_information(data, fit));
    let covariance = interval::covariance(&information);
    let sum = |parts: Vec<Part>| root(&parts, covariance.as_ref());
    Sums { white: sum(white), walk: if flicker { None } else { sum(walk) } }
}

/// √Σ parts; d ln √Σ / d ln p = Σ (part/2Σ) power.
fn root(parts: &[Part], covariance: Option<&DMatrix<f64>>) -> Option<Sum> {
    let square: f64 = parts.iter().map(|(part, _)| part).sum();
    if square <= 0.0 {
        return None;
    }
    let deviation = covariance.map(|covariance| {
        let mut slope = nalgebra::DVector::zeros(covariance.nrows());
        for (part, powers) in parts {
            powers.iter().for_each(|(i, power)| slope[*i] += 0.5 * power * part / square);
        }
        (slope.transpose() * covariance * &slope)[(0, 0)].max(0.0).sqrt()
    });
    let value = square.sqrt();
    let ends = |sd: f64| [(-NORMAL_95 * sd).exp() * value, (NORMAL_95 * sd).exp() * value];
    Some(Sum { value, interval: deviation.map(ends).filter(|ends| ends[1].is_finite()) })
}
