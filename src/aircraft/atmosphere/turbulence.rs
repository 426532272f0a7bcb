//! A path of Dryden turbulence, exact in law at its steps, from its stationary law on.

use nalgebra::{DMatrix, SMatrix, SVector};
use rand::rngs::ChaCha8Rng;

use super::Gust;
use super::dryden::{GustModel, OUTPUTS, PARTS, STATES};
use crate::numerics::linalg::{LinalgError, cholesky_semidefinite};
use crate::numerics::random::normal;

/// Generator of gusts at steps of one length.
#[derive(Debug)]
pub struct Turbulence {
    f: SMatrix<f64, STATES, STATES>,
    /// Lower factor of Q.
    noise: SMatrix<f64, STATES, STATES>,
    c: SMatrix<f64, 6, STATES>,
    x: SVector<f64, STATES>,
    streams: [ChaCha8Rng; 4],
}

impl Turbulence {
    /// At the first step. `streams`: one for each of the white noises u, w, v, p. Errors: the model has no discrete
    /// form over `dt`.
    pub fn new(model: &GustModel, dt: f64, mut streams: [ChaCha8Rng; 4]) -> Result<Turbulence, LinalgError> {
        let step = model.over(dt)?;
        let x = draw(&factor(&model.state_covariance()?)?, &mut streams);
        Ok(Turbulence { f: step.f, noise: factor(&step.q)?, c: model.c, x, streams })
    }

    /// The gust at the present step.
    pub fn gust(&self) -> Gust {
        let mut y = [0.0; 6];
        for ((at, n), outputs) in PARTS.into_iter().zip(OUTPUTS) {
            for output in outputs {
                y[*output] = (at..at + n).map(|i| self.c[(*output, i)] * self.x[i]).sum();
            }
        }
        Gust { velocity: [y[0], y[1], y[2]], rate: [y[3], y[4], y[5]] }
    }

    pub fn step(&mut self) {
        let v = draw(&self.noise, &mut self.streams);
        for (at, n) in PARTS {
            let x: [f64; 3] = std::array::from_fn(|i| if i < n { self.x[at + i] } else { 0.0 });
            for i in 0..n {
                self.x[at + i] = v[at + i] + (0..n).map(|j| self.f[(at + i, at + j)] * x[j]).sum::<f64>();
            }
        }
    }
}

/// L n with n standard normal.
fn draw(factor: &SMatrix<f64, STATES, STATES>, streams: &mut [ChaCha8Rng; 4]) -> SVector<f64, STATES> {
    let mut out = SVector::zeros();
    for ((at, n), stream) in PARTS.into_iter().zip(streams) {
        for j in 0..n {
            let draw = normal(stream);
            for i in j..n {
                out[at + i] += factor[(at + i, at + j)] * draw;
            }
        }
    }
    out
}

/// Lower factor of a covariance, part by part.
fn factor(covariance: &SMatrix<f64, STATES, STATES>) -> Result<SMatrix<f64, STATES, STATES>, LinalgError> {
    let mut out = SMatrix::zeros();
    for (at, n) in PARTS {
        let l = cholesky_semidefinite(&DMatrix::from_fn(n, n, |i, j| covariance[(at + i, at + j)]))?;
        for i in 0..n {
            for j in 0..=i {
                out[(at + i, at + j)] = l[(i, j)];
            }
        }
    }
    Ok(out)
}
