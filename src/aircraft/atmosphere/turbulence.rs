//! A path of Dryden turbulence, exact in law at its steps, from its stationary law on.

use std::array::from_fn;

use nalgebra::{DMatrix, SMatrix};
use rand::rngs::ChaCha8Rng;

use super::Gust;
use super::dryden::{GustModel, PARTS, STATES};
use crate::numerics::linalg::{LinalgError, cholesky_semidefinite};
use crate::numerics::random::{fill_normal, normal};

/// Generator of gusts at steps of one length.
#[derive(Debug)]
pub struct Turbulence {
    u: Part<1>,
    w: Part<3>,
    v: Part<3>,
    p: Part<1>,
    c: SMatrix<f64, 6, STATES>,
}

/// The states of one white noise: x⁺ = F x + L n, n standard normal.
#[derive(Debug)]
struct Part<const N: usize> {
    f: [[f64; N]; N],
    /// Lower factor of Q.
    l: [[f64; N]; N],
    x: [f64; N],
    stream: ChaCha8Rng,
    /// Numbers of the steps to come, and the first that is not used.
    drawn: Vec<[f64; N]>,
    next: usize,
}

/// Steps whose numbers are drawn at once.
const BLOCK: usize = 64;

impl Turbulence {
    /// At the first step. `streams`: one for each of the white noises u, w, v, p. Errors: the model has no discrete
    /// form over `dt`.
    pub fn new(model: &GustModel, dt: f64, streams: [ChaCha8Rng; 4]) -> Result<Turbulence, LinalgError> {
        let step = model.over(dt)?;
        let laws = [&step.f, &step.q, &model.state_covariance()?];
        let [u, w, v, p] = streams;
        Ok(Turbulence {
            u: Part::new(PARTS[0].0, laws, u)?,
            w: Part::new(PARTS[1].0, laws, w)?,
            v: Part::new(PARTS[2].0, laws, v)?,
            p: Part::new(PARTS[3].0, laws, p)?,
            c: model.c,
        })
    }

    /// The gust at the present step.
    pub fn gust(&self) -> Gust {
        let [u, w, v, p] = PARTS.map(|(at, _)| at);
        Gust {
            velocity: [self.seen(0, u, &self.u), self.seen(1, v, &self.v), self.seen(2, w, &self.w)],
            rate: [self.seen(3, p, &self.p), self.seen(4, w, &self.w), self.seen(5, v, &self.v)],
        }
    }

    /// An output of the part whose states begin at `at`.
    #[inline(always)]
    fn seen<const N: usize>(&self, output: usize, at: usize, part: &Part<N>) -> f64 {
        (0..N).map(|i| self.c[(output, at + i)] * part.x[i]).sum()
    }

    pub fn step(&mut self) {
        self.u.step();
        self.w.step();
        self.v.step();
        self.p.step();
    }
}

impl<const N: usize> Part<N> {
    /// At its stationary law; `laws`: F, Q and the stationary covariance of all states.
    fn new(
        at: usize,
        [f, q, covariance]: [&SMatrix<f64, STATES, STATES>; 3],
        mut stream: ChaCha8Rng,
    ) -> Result<Part<N>, LinalgError> {
        let factor = |m: &SMatrix<f64, STATES, STATES>| -> Result<[[f64; N]; N], LinalgError> {
            let l = cholesky_semidefinite(&DMatrix::from_fn(N, N, |i, j| m[(at + i, at + j)]))?;
            Ok(from_fn(|i| from_fn(|j| l[(i, j)])))
        };
        let n = from_fn(|_| normal(&mut stream));
        let x = times(&factor(covariance)?, &n);
        let f = from_fn(|i| from_fn(|j| f[(at + i, at + j)]));
        Ok(Part { f, l: factor(q)?, x, stream, drawn: vec![[0.0; N]; BLOCK], next: BLOCK })
    }

    #[inline(always)]
    fn step(&mut self) {
        if self.next == self.drawn.len() {
            fill_normal(&mut self.stream, self.drawn.as_flattened_mut());
            self.next = 0;
        }
        let (moved, driven) = (times(&self.f, &self.x), times(&self.l, &self.drawn[self.next]));
        self.x = from_fn(|i| moved[i] + driven[i]);
        self.next += 1;
    }
}

#[inline(always)]
fn times<const N: usize>(a: &[[f64; N]; N], x: &[f64; N]) -> [f64; N] {
    from_fn(|i| (0..N).map(|j| a[i][j] * x[j]).sum())
}
