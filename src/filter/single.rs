//! What single precision costs: the same filter in f32 beside the one in f64, on the same measurements.
//!
//! The measurements are drawn from the f64 filter's own prediction, z = H x + ν, ν ~ N(0, S), which is the law they
//! have when the model is true. The f64 estimate is then the conditional mean, its error is orthogonal to everything
//! made of the measurements, and so the error of an f32 filter whose estimate differs by d has the variance `P +
//! E[d²]`.

use nalgebra::{DMatrix, DVector};
use rand_distr::{Distribution, StandardNormal};
use schemars::JsonSchema;
use serde::Serialize;

use super::{Kalman, SquareRoot};
use crate::model::LinearModel;
use crate::numerics::linalg::LinalgError;
use crate::numerics::random::{StreamId, stream};

/// Forms of the update that are tried.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SingleForm {
    /// P ← P − K h P.
    Conventional,
    /// P ← (I − K h) P (I − K h)ᵀ + K r Kᵀ.
    Joseph,
    SquareRoot,
}

/// One form in f32 beside the filter in f64.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct SingleResult {
    pub form: SingleForm,
    /// Root mean square error over that of the f64 filter, `√(1 + E[d²]/P)`, of each state over the second half of
    /// the run.
    pub error: Vec<f64>,
    /// Claimed sigma over that of the f64 filter, at the end.
    pub claimed: Vec<f64>,
    /// First step at which a variance was negative or no number; the rest of the run is not counted.
    pub lost_at: Option<u64>,
}

/// The check of one model.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct SinglePrecision {
    pub steps: u64,
    /// Largest over smallest eigenvalue of the correlation matrix of P(k|k) at the end; it does not depend on units.
    pub condition: f64,
    pub forms: Vec<SingleResult>,
}

/// Runs all forms for `steps` steps. Errors: Q or P0 not positive semidefinite.
pub fn single_precision(model: &LinearModel, steps: u64, seed: u64) -> Result<SinglePrecision, LinalgError> {
    let n = model.x0.len();
    let mut reference = Kalman::new(model);
    let mut narrow = [Narrow::new(model, false), Narrow::new(model, true)];
    let mut root = SquareRoot::<f32>::new(model)?;
    let mut watched = [(); 3].map(|()| Watched { squares: vec![0.0; n], counted: 0, lost_at: None });
    let mut rng = stream(seed, StreamId { run: 0, axis: 0, term: 0 });
    for step in 0..steps {
        if step > 0 {
            reference.predict();
            narrow.iter_mut().for_each(Narrow::predict);
            root.predict();
        }
        for (i, every) in model.every.iter().enumerate() {
            if !step.is_multiple_of(*every as u64) {
                continue;
            }
            let h = model.h.row(i);
            let variance = (h * &reference.p * h.transpose())[(0, 0)] + model.r[(i, i)];
            let normal: f64 = StandardNormal.sample(&mut rng);
            let z = (h * &reference.x)[(0, 0)] + variance.sqrt() * normal;
            reference.update(i, z, None);
            narrow.iter_mut().for_each(|filter| filter.update(i, z as f32));
            root.update(i, z, None);
        }
        let count = step >= steps / 2;
        let [conventional, joseph] = &narrow;
        watched[0].look(step, count, &reference, &conventional.x, |i| conventional.p[(i, i)]);
        watched[1].look(step, count, &reference, &joseph.x, |i| joseph.p[(i, i)]);
        watched[2].look(step, count, &reference, &root.x, |i| root.factor().row(i).norm_squared());
    }
    let claimed = |variance: &dyn Fn(usize) -> f32| -> Vec<f64> {
        (0..n).map(|i| (f64::from(variance(i)) / reference.p[(i, i)]).sqrt()).collect()
    };
    let claims = [
        claimed(&|i| narrow[0].p[(i, i)]),
        claimed(&|i| narrow[1].p[(i, i)]),
        claimed(&|i| root.factor().row(i).norm_squared()),
    ];
    let forms = [SingleForm::Conventional, SingleForm::Joseph, SingleForm::SquareRoot];
    let result = |((form, watched), claimed): ((SingleForm, &Watched), Vec<f64>)| SingleResult {
        form,
        error: watched.errors(),
        claimed,
        lost_at: watched.lost_at,
    };
    Ok(SinglePrecision {
        steps,
        condition: correlation_condition(&reference.p),
        forms: forms.into_iter().zip(&watched).zip(claims).map(result).collect(),
    })
}

/// Of a filter with zero variances, of its other states.
fn correlation_condition(p: &DMatrix<f64>) -> f64 {
    let kept: Vec<usize> = (0..p.nrows()).filter(|&i| p[(i, i)] > 0.0).collect();
    let correlation = DMatrix::from_fn(kept.len(), kept.len(), |i, j| {
        let (i, j) = (kept[i], kept[j]);
        p[(i, j)] / (p[(i, i)] * p[(j, j)]).sqrt()
    });
    let eigenvalues = correlation.symmetric_eigenvalues();
    eigenvalues.max() / eigenvalues.min().max(0.0)
}

/// Differences of one filter from the reference.
struct Watched {
    /// Σ d²/P per state.
    squares: Vec<f64>,
    counted: u64,
    lost_at: Option<u64>,
}

impl Watched {
    fn look(&mut self, step: u64, count: bool, reference: &Kalman, x: &DVector<f32>, variance: impl Fn(usize) -> f32) {
        if self.lost_at.is_some() {
            return;
        }
        if (0..x.len()).any(|i| variance(i).is_nan() || variance(i) < 0.0 || !x[i].is_finite()) {
            self.lost_at = Some(step);
        } else if count {
            self.counted += 1;
            for (i, square) in self.squares.iter_mut().enumerate() {
                let d = f64::from(x[i]) - reference.x[i];
                *square += if d == 0.0 { 0.0 } else { d * d / reference.p[(i, i)] };
            }
        }
    }

    fn errors(&self) -> Vec<f64> {
        self.squares.iter().map(|square| (1.0 + square / self.counted.max(1) as f64).sqrt()).collect()
    }
}

/// The textbook filter in f32.
struct Narrow {
    joseph: bool,
    x: DVector<f32>,
    p: DMatrix<f32>,
    f: DMatrix<f32>,
    q: DMatrix<f32>,
    h: DMatrix<f32>,
    r: Vec<f32>,
}

impl Narrow {
    fn new(model: &LinearModel, joseph: bool) -> Narrow {
        let narrow = |a: &DMatrix<f64>| a.map(|v| v as f32);
        Narrow {
            joseph,
            x: model.x0.map(|v| v as f32),
            p: narrow(&model.p0),
            f: narrow(&model.f),
            q: narrow(&model.q),
            h: narrow(&model.h),
            r: model.r.diagonal().iter().map(|v| *v as f32).collect(),
        }
    }

    fn predict(&mut self) {
        self.x = &self.f * &self.x;
        self.p = &self.f * &self.p * self.f.transpose() + &self.q;
    }

    fn update(&mut self, i: usize, z: f32) {
        let h = self.h.row(i);
        let p_h = &self.p * h.transpose();
        let s = (h * &p_h)[(0, 0)] + self.r[i];
        let k = &p_h / s;
        let innovation = z - (h * &self.x)[(0, 0)];
        self.x += &k * innovation;
        if self.joseph {
            let keep = DMatrix::identity(k.len(), k.len()) - &k * h;
            self.p = &keep * &self.p * keep.transpose() + &k * self.r[i] * k.transpose();
        } else {
            self.p -= &k * (h * &self.p);
        }
    }
}
