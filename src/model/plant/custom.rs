//! A linear plant by its matrices.

use nalgebra::{DMatrix, DVector};

use super::{ModelError, Named, Plant};
use crate::model::discretize::van_loan;

/// Matrices of a plant, SI; shapes n × n, n × inputs, n × any, outputs × n.
#[derive(Clone, Debug, PartialEq)]
pub struct Matrices {
    /// x⁺ = A x + B u + G w, w ~ N(0, I); else ẋ = A x + B u + G w, w white of unit two-sided density.
    pub discrete: bool,
    pub states: Vec<Named>,
    pub inputs: Vec<Named>,
    pub outputs: Vec<Named>,
    pub a: DMatrix<f64>,
    pub b: DMatrix<f64>,
    pub g: DMatrix<f64>,
    pub h: DMatrix<f64>,
    pub x0: DVector<f64>,
    /// Standard deviation of each state before the first measurement.
    pub std_dev: DVector<f64>,
}

/// The plant, a continuous one discretised exactly with inputs held over the sample:
/// F = e^(A dt), ∫₀^dt e^(A s) ds B, Q = ∫₀^dt e^(A s) G Gᵀ e^(Aᵀ s) ds.
///
/// Errors: no state, shapes, numbers that are not finite.
pub fn plant(matrices: &Matrices, dt: f64) -> Result<Plant, ModelError> {
    let Matrices { states, inputs, outputs, a, b, g, h, .. } = matrices;
    let (n, m) = (states.len(), inputs.len());
    if n == 0 {
        return Err(ModelError::part("states", "there is none; at least one is needed"));
    }
    for (letter, matrix, rows, columns) in
        [("A", a, n, n), ("B", b, n, m), ("G", g, n, g.ncols()), ("H", h, outputs.len(), n)]
    {
        if matrix.shape() != (rows, columns) {
            let found = format!("found {} x {}; expected {rows} x {columns}", matrix.nrows(), matrix.ncols());
            return Err(ModelError::part(letter, found));
        }
    }
    let noise = g * g.transpose();
    let (f, input, q) = if matrices.discrete {
        (a.clone(), b.clone(), noise)
    } else {
        let failed = |e: crate::numerics::linalg::LinalgError| ModelError::part("A", e.to_string());
        let (f, q) = van_loan(a, &noise, dt).map_err(failed)?;
        // e^([A B; 0 0] dt) = [F ∫e^(As)ds B; 0 I]
        let mut held = DMatrix::zeros(n + m, n + m);
        held.view_mut((0, 0), (n, n)).copy_from(a);
        held.view_mut((0, n), (n, m)).copy_from(b);
        let (step, _) = van_loan(&held, &DMatrix::zeros(n + m, n + m), dt).map_err(failed)?;
        (f, step.view((0, n), (n, m)).into_owned(), q)
    };
    Ok(Plant {
        dt,
        states: states.clone(),
        inputs: inputs.clone(),
        outputs: outputs.clone(),
        f,
        g: input,
        h: h.clone(),
        q,
        x0: matrices.x0.clone(),
        p0: DMatrix::from_diagonal(&matrices.std_dev.map(|s| s * s)),
    })
}
