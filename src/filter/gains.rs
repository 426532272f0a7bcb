//! The gains of a time-invariant model: they do not depend on the data, so they are computed once and shared by many
//! runs.

use nalgebra::{DMatrix, DVector, RowDVector};

use super::Kalman;
use super::transition::SparseTransition;
use crate::model::LinearModel;

/// Gains, innovation weights and covariances of a filter from its first measurement on.
///
/// Measurements of one step are taken one after the other (R is diagonal), so an update is a gain vector K and 1/√S.
/// Updates are in the order they happen: by step, then by measurement.
#[derive(Clone, Debug)]
pub struct GainSequence {
    pub steps: u64,
    /// Number of states.
    pub states: usize,
    /// Measurement i is taken at every `every[i]`-th step, from the first.
    pub every: Vec<u64>,
    /// K of every update, `states` numbers each.
    pub gains: Vec<f64>,
    /// 1/√S of every update.
    pub weights: Vec<f64>,
    /// The wanted steps with what belongs to them.
    pub epochs: Vec<Epoch>,
}

/// The filter at one step, after its updates.
#[derive(Clone, Debug)]
pub struct Epoch {
    /// Steps since the first measurement.
    pub step: u64,
    /// P(k|k).
    pub covariance: DMatrix<f64>,
    /// How the error of the epoch before lives on, Π (I − K h) F over the steps between; I at the first epoch.
    pub transition: DMatrix<f64>,
}

impl GainSequence {
    /// Runs the covariance recursion of `model` for `steps` steps; `epochs` are steps in increasing order, each
    /// below `steps`.
    pub fn new(model: &LinearModel, steps: u64, epochs: &[u64]) -> GainSequence {
        let n = model.x0.len();
        let every: Vec<u64> = model.every.iter().map(|&e| e as u64).collect();
        let updates: u64 = every.iter().map(|e| steps.div_ceil(*e)).sum();
        let mut sequence = GainSequence {
            steps,
            states: n,
            every,
            gains: Vec::with_capacity(updates as usize * n),
            weights: Vec::with_capacity(updates as usize),
            epochs: Vec::with_capacity(epochs.len()),
        };
        let rows: Vec<RowDVector<f64>> = model.h.row_iter().map(|row| row.into_owned()).collect();
        let mut filter = Kalman::new(model);
        let sparse = SparseTransition::new(&model.f);
        let mut transition = DMatrix::identity(n, n);
        let mut advanced = transition.clone();
        let mut gain = DVector::zeros(n);
        let mut seen = RowDVector::zeros(n);
        let mut wanted = epochs.iter().copied().peekable();
        for step in 0..steps {
            if step > 0 {
                filter.predict();
                match &sparse {
                    Some(sparse) => sparse.times(transition.as_slice(), advanced.as_mut_slice()),
                    None => model.f.mul_to(&transition, &mut advanced),
                }
                std::mem::swap(&mut transition, &mut advanced);
            }
            for (i, h) in rows.iter().enumerate() {
                if step % sequence.every[i] != 0 {
                    continue;
                }
                let update = filter.update(i, 0.0, None);
                sequence.weights.push(1.0 / update.variance.sqrt());
                // K = P(k|k) hᵀ / r, the same as P(k|k−1) hᵀ / S
                filter.p.mul_to(&h.transpose(), &mut gain);
                gain /= model.r[(i, i)];
                sequence.gains.extend(gain.iter());
                h.mul_to(&transition, &mut seen);
                transition.ger(-1.0, &gain, &seen.transpose(), 1.0);
            }
            if wanted.next_if_eq(&step).is_some() {
                sequence.epochs.push(Epoch { step, covariance: filter.p.clone(), transition: transition.clone() });
                transition.fill_with_identity();
            }
        }
        if let Some(first) = sequence.epochs.first_mut() {
            first.transition.fill_with_identity();
        }
        sequence
    }
}
