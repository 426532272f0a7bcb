//! The same after a long time, in closed form.

use nalgebra::{DMatrix, DVector};

use super::{ExpectedError, Joint};
use crate::filter::judge::Judge;
use crate::filter::{Cycle, Kalman};
use crate::model::LinearModel;
use crate::numerics::linalg::{LinalgError, symmetrise};
use crate::numerics::riccati::lyapunov;

/// What a settled filter does on average when the world is the truth.
#[derive(Clone, Debug, PartialEq)]
pub struct Settled {
    /// At a sample at which every measurement is taken, after them.
    pub error: ExpectedError,
    /// Mean of E[ν²/S] over the updates of one period: 1 when the filter is right.
    pub nis: f64,
}

/// [`expect`](super::expect) in the limit of long times.
///
/// `filter.p0` is its steady P(k|k−1) at a sample at which every measurement is taken, so that its gains repeat with
/// the period of `cycle`. Over one period the joint state of [`expect`](super::expect) obeys s ← M s + n, cov n = N,
/// and its covariance is that of X = M X Mᵀ + N. States that keep their uncertainty for ever (a constant) must be
/// left out of both models. Means are zero. Errors: the filter's error grows without bound in this truth.
pub fn expect_settled(
    filter: &LinearModel,
    truth: &LinearModel,
    judge: &Judge,
    cycle: &Cycle,
) -> Result<Settled, LinalgError> {
    let joint = Joint::new(filter, truth, judge);
    let n = joint.size;
    let mut phi = DMatrix::from_diagonal(&DVector::from_column_slice(&joint.diagonal));
    for &(i, j, value) in &joint.coupling {
        phi[(i, j)] = value;
    }
    let noise = DMatrix::from_column_slice(n, n, &joint.noise);
    let mut kalman = Kalman::new(filter);
    for i in cycle.taken(0) {
        kalman.update(i, 0.0, None);
    }
    let claimed = judge.claimed(&kalman.p);
    // c, (I + k cᵀ), k r kᵀ and 1/S of every update of a period, with the steps before it
    let mut updates = Vec::new();
    let mut steps = 0;
    for step in 1..=cycle.period {
        kalman.predict();
        steps += 1;
        for i in cycle.taken(step) {
            let update = kalman.update(i, 0.0, None);
            let gain = &kalman.p * filter.h.row(i).transpose() / filter.r[(i, i)];
            let mut k = DVector::zeros(n);
            k.rows_mut(joint.error_at, gain.len()).copy_from(&-gain);
            let c = DVector::from_column_slice(&joint.seen[i * n..(i + 1) * n]);
            updates.push(Step { steps, c, k, r: joint.r[i], weight: 1.0 / update.variance });
            steps = 0;
        }
    }
    let mut transition = DMatrix::identity(n, n);
    let mut driven = DMatrix::zeros(n, n);
    for update in &updates {
        for _ in 0..update.steps {
            transition = &phi * transition;
            driven = &phi * driven * phi.transpose() + &noise;
        }
        let keep = update.keep();
        transition = &keep * transition;
        driven = &keep * driven * keep.transpose() + update.added();
    }
    symmetrise(&mut driven);
    let settled = lyapunov(&transition, &driven)?;
    let mut covariance = &joint.judged * &settled * joint.judged.transpose();
    symmetrise(&mut covariance);
    let mut x = settled;
    let mut nis = 0.0;
    for update in &updates {
        for _ in 0..update.steps {
            x = &phi * x * phi.transpose() + &noise;
        }
        nis += update.weight * ((&x * &update.c).dot(&update.c) + update.r);
        let keep = update.keep();
        x = &keep * x * keep.transpose() + update.added();
    }
    let mean = DVector::zeros(judge.size());
    Ok(Settled { error: ExpectedError { mean, covariance, claimed }, nis: nis / updates.len() as f64 })
}

/// ν = c s + w, var w = r, then s ← s + k ν.
struct Step {
    /// Predictions since the update before.
    steps: u64,
    c: DVector<f64>,
    k: DVector<f64>,
    r: f64,
    /// 1/S as claimed.
    weight: f64,
}

impl Step {
    fn keep(&self) -> DMatrix<f64> {
        DMatrix::identity(self.c.len(), self.c.len()) + &self.k * self.c.transpose()
    }

    fn added(&self) -> DMatrix<f64> {
        &self.k * self.r * self.k.transpose()
    }
}
