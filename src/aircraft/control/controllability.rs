//! How well modes are reached by controls and seen by sensors.
//!
//! Everything here depends on units: it is that of the model as given, in SI, or with velocities divided by the
//! airspeed (`LinearModel::in_angles`). PBH: the smallest singular value of [A − λI, B] (Popov, Belevitch, Hautus);
//! modal measure |vᴴb|/(|v||b|), v the left eigenvector (Hamdan and Nayfeh 1989); Gramian W(T) = ∫₀ᵀ e^(At)BBᵀe^(Aᵀt)
//! dt.

use nalgebra::DMatrix;

use crate::aircraft::airframe::linear::LinearModel;
use crate::aircraft::airframe::modes::{Mode, left_eigenvector, null_vector};
use crate::numerics::linalg::{LinalgError, singular_values, symmetric_eigenvalues};
use crate::numerics::van_loan::van_loan;

/// Of one mode.
#[derive(Clone, Debug, PartialEq)]
pub struct Reach {
    pub mode: Mode,
    /// Smallest singular value of [A − λI, B] or [A − λI; C].
    pub pbh: f64,
    /// One per input or output.
    pub cosines: Vec<f64>,
}

/// Of a Gramian.
#[derive(Clone, Debug, PartialEq)]
pub struct Gramian {
    /// Ascending.
    pub eigenvalues: Vec<f64>,
    /// Largest over smallest.
    pub condition: f64,
}

/// The smallest singular value of [A − λI, B], for complex λ by the real form of twice the size.
fn pbh(a: &DMatrix<f64>, b: &DMatrix<f64>, (re, im): (f64, f64)) -> Result<f64, LinalgError> {
    let n = a.nrows();
    let mut wide = DMatrix::zeros(2 * n, 2 * (n + b.ncols()));
    let shifted = a - DMatrix::identity(n, n) * re;
    for half in 0..2 {
        wide.view_mut((half * n, half * n), (n, n)).copy_from(&shifted);
        wide.view_mut((half * n, 2 * n + half * b.ncols()), b.shape()).copy_from(b);
    }
    for i in 0..n {
        wide[(i, n + i)] = im;
        wide[(n + i, i)] = -im;
    }
    let (values, _) = singular_values(&wide)?;
    Ok(values.last().copied().unwrap_or(0.0))
}

/// |xᴴb|/(|x||b|) of a complex unit vector given as real parts, then imaginary ones.
fn cosine(x: &[f64], b: &[f64]) -> f64 {
    let (re, im) = x.split_at(b.len());
    let with = |part: &[f64]| part.iter().zip(b).map(|(x, b)| x * b).sum::<f64>();
    let length = b.iter().map(|b| b * b).sum::<f64>().sqrt();
    if length > 0.0 { with(re).hypot(with(im)) / length } else { 0.0 }
}

/// How the inputs of these columns reach each mode of a model.
pub fn controllability(model: &LinearModel, modes: &[Mode], inputs: &[usize]) -> Result<Vec<Reach>, LinalgError> {
    let b = model.b.select_columns(inputs);
    let one = |mode: &Mode| {
        let v = left_eigenvector(&model.a, mode.eigenvalue)?;
        let cosines = b.column_iter().map(|b| cosine(&v, b.into_owned().as_slice())).collect();
        Ok(Reach { mode: *mode, pbh: pbh(&model.a, &b, mode.eigenvalue)?, cosines })
    };
    modes.iter().map(one).collect()
}

/// How measured states show each mode.
pub fn observability(model: &LinearModel, modes: &[Mode], outputs: &[usize]) -> Result<Vec<Reach>, LinalgError> {
    let n = model.a.nrows();
    let c = DMatrix::from_fn(n, outputs.len(), |i, j| f64::from(u8::from(outputs[j] == i)));
    let one = |mode: &Mode| {
        let v = null_vector(&model.a, mode.eigenvalue)?;
        let cosines = c.column_iter().map(|c| cosine(&v, c.into_owned().as_slice())).collect();
        Ok(Reach { mode: *mode, pbh: pbh(&model.a.transpose(), &c, mode.eigenvalue)?, cosines })
    };
    modes.iter().map(one).collect()
}

/// W over a finite horizon (s): an unstable spiral has none over infinite time.
pub fn gramian(model: &LinearModel, inputs: &[usize], horizon: f64) -> Result<Gramian, LinalgError> {
    let b = model.b.select_columns(inputs);
    let (_, w) = van_loan(&model.a, &(&b * b.transpose()), horizon)?;
    let eigenvalues = symmetric_eigenvalues(&w);
    let [least, most] = [eigenvalues.first(), eigenvalues.last()].map(|e| e.copied().unwrap_or(f64::NAN));
    Ok(Gramian { condition: most / least, eigenvalues })
}
