//! Where the filter settles: gain, covariance, poles and how long it takes.

use nalgebra::DMatrix;

use crate::model::LinearModel;
use crate::model::observability::{observability, undriven_states};
use crate::numerics::linalg::{LinalgError, eigenvalues, relative_to_diagonal, solve_spd};
use crate::numerics::riccati::{covariance_after, dare_doubling, dare_eigenvector};

/// Time constants that make "settled": e⁻⁴ = 1.8 % of the initial error is left.
const SETTLED: f64 = 4.0;

/// The filter after a long time.
#[derive(Clone, Debug, PartialEq)]
pub struct SteadyState {
    /// n × m gain K (states whose variance tends to zero have 0).
    pub gain: DMatrix<f64>,
    /// P(k|k−1).
    pub predicted_covariance: DMatrix<f64>,
    pub innovation_covariance: DMatrix<f64>,
    /// Closed-loop poles, eigenvalues of (I − K H) F, as (re, im).
    pub poles: Vec<(f64, f64)>,
    /// s; four time constants of the slowest closed-loop pole of the driven states (0 when no state is driven).
    pub settling_time: f64,
    /// Largest relative residual of the Riccati equation.
    pub residual: f64,
    /// Largest relative difference to the eigenvector solution (NaN when that one does not exist).
    pub eigenvector_difference: f64,
}

#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SteadyStateError {
    #[error("there is no steady state: measurement '{measurement}' is taken only every {every} samples")]
    Rate { measurement: String, every: usize },
    #[error("there is no steady state: state '{state}' grows without noise (pole {modulus:.6})")]
    Growing { state: String, modulus: f64 },
    #[error(
        "there is no steady state of the driven states ({states}): {source}; is each of them seen by a measurement?"
    )]
    Riccati { states: String, source: LinalgError },
    #[error(transparent)]
    Linalg(#[from] LinalgError),
}

/// Steady state of a model whose measurements are taken at every sample.
///
/// States that nothing drives and nothing damps (a constant bias, a ramp) are split off: their variance tends to zero (like
/// 1/t for a constant) and their gain is zero. The Riccati equation P = F P Fᵀ − F P Hᵀ S⁻¹ H P Fᵀ + Q of the others is
/// solved by doubling and compared with the eigenvector solution. Where a split-off state cannot be told from a driven one
/// (a constant beside a random walk), the covariance that the filter reaches depends on P0 for ever and is found from it;
/// gain, S and poles do not.
/// Errors: measurements at other rates, a state that grows without noise, a driven state that no measurement sees.
pub fn steady_state(model: &LinearModel) -> Result<SteadyState, SteadyStateError> {
    if let Some(i) = model.every.iter().position(|every| *every != 1) {
        let measurement = model.measurements.get(i).map(|m| m.name.clone()).unwrap_or_default();
        return Err(SteadyStateError::Rate { measurement, every: model.every[i] });
    }
    let n = model.states.len();
    let undriven = undriven_states(model);
    refuse_growth(model, &undriven)?;
    let driven: Vec<usize> = (0..n).filter(|i| !undriven.contains(i)).collect();

    let (f, h, q) =
        (select(&model.f, &driven, &driven), columns(&model.h, &driven), select(&model.q, &driven, &driven));
    let named = |source| SteadyStateError::Riccati { states: names(model, &driven), source };
    let solution = dare_doubling(&f, &h, &q, &model.r).map_err(named)?;
    let p = &solution.covariance;
    let eigenvector_difference = match dare_eigenvector(&f, &h, &q, &model.r) {
        Ok(other) => relative_to_diagonal(&(other.covariance - p), p.diagonal().as_slice()),
        Err(_) => f64::NAN,
    };

    let innovation_covariance = &h * p * h.transpose() + &model.r;
    let driven_gain = solve_spd(&innovation_covariance, &(&h * p))?.transpose();
    let mut gain = DMatrix::zeros(n, model.h.nrows());
    let mut predicted_covariance = DMatrix::zeros(n, n);
    for (i, &state) in driven.iter().enumerate() {
        gain.set_row(state, &driven_gain.row(i));
        for (j, &other) in driven.iter().enumerate() {
            predicted_covariance[(state, other)] = p[(i, j)];
        }
    }
    let identity = DMatrix::<f64>::identity(driven.len(), driven.len());
    let slowest = eigenvalues(&((identity - &driven_gain * &h) * &f)).first().map_or(0.0, |z| z.0.hypot(z.1));
    // −1/ln λ steps; written by 1 − λ so that a pole next to one keeps its digits.
    let time_constant = if slowest > 0.0 { -1.0 / (slowest - 1.0).ln_1p() } else { 0.0 };

    if rests_on_prior(model, &undriven)? {
        let steps = (SETTLED * 10.0 * time_constant).max(1.0);
        let doublings = steps.log2().ceil() as u32;
        predicted_covariance = covariance_after(&model.f, &model.h, &model.q, &model.r, &model.p0, doublings)?;
    }
    let poles = eigenvalues(&((DMatrix::<f64>::identity(n, n) - &gain * &model.h) * &model.f));
    Ok(SteadyState {
        gain,
        predicted_covariance,
        innovation_covariance,
        poles,
        settling_time: SETTLED * time_constant * model.dt,
        residual: solution.relative_residual,
        eigenvector_difference,
    })
}

/// An undriven mode outside the unit circle: its gain would not tend to zero.
fn refuse_growth(model: &LinearModel, undriven: &[usize]) -> Result<(), SteadyStateError> {
    // Double poles of a ramp are found to the root of rounding.
    let limit = 1.0 + 1e-6;
    let modulus = eigenvalues(&select(&model.f, undriven, undriven)).first().map_or(0.0, |z| z.0.hypot(z.1));
    if modulus <= limit {
        return Ok(());
    }
    Err(SteadyStateError::Growing { state: names(model, undriven), modulus })
}

/// Whether some split-off state is part of a combination that no measurement sees.
fn rests_on_prior(model: &LinearModel, undriven: &[usize]) -> Result<bool, LinalgError> {
    if undriven.is_empty() {
        return Ok(false);
    }
    let hidden = observability(model)?.unobservable;
    Ok(hidden.iter().flatten().any(|(name, _)| undriven.iter().any(|&i| model.states[i].name == *name)))
}

fn names(model: &LinearModel, states: &[usize]) -> String {
    let names: Vec<&str> = states.iter().map(|&i| model.states[i].name.as_str()).collect();
    names.join(", ")
}

fn select(a: &DMatrix<f64>, rows: &[usize], columns: &[usize]) -> DMatrix<f64> {
    DMatrix::from_fn(rows.len(), columns.len(), |i, j| a[(rows[i], columns[j])])
}

fn columns(a: &DMatrix<f64>, columns: &[usize]) -> DMatrix<f64> {
    DMatrix::from_fn(a.nrows(), columns.len(), |i, j| a[(i, columns[j])])
}
