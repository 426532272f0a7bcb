//! Where the filter settles: gain, covariance, poles and how long it takes.

use nalgebra::DMatrix;

use super::cycle::Cycle;
use crate::model::LinearModel;
use crate::model::observability::{observability, undetermined, undriven_states};
use crate::numerics::linalg::{LinalgError, eigenvalues, relative_to_diagonal, solve_spd};
use crate::numerics::riccati::{Flow, RiccatiSolution, dare_doubling, dare_eigenvector};

/// Time constants that make "settled": e⁻⁴ = 1.8 % of the initial error is left.
const SETTLED: f64 = 4.0;

/// With a larger residual an eigenvector solution is none.
const EIGENVECTOR_RESIDUAL: f64 = 1e-3;

/// The filter after a long time, at a sample at which every measurement is taken.
///
/// With measurements at several rates the covariance repeats after `period` samples; between two such samples it is
/// another.
#[derive(Clone, Debug, PartialEq)]
pub struct SteadyState {
    /// Samples after which the pattern of measurements repeats; 1 when all are taken at every sample.
    pub period: u64,
    /// n × m gain K (states whose variance tends to zero have 0).
    pub gain: DMatrix<f64>,
    /// P(k|k−1).
    pub predicted_covariance: DMatrix<f64>,
    pub innovation_covariance: DMatrix<f64>,
    /// Closed-loop poles per sample, eigenvalues of (I − K H) F, as (re, im). With a longer period, the principal
    /// roots of the eigenvalues of what an error becomes over one period.
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
    #[error(
        "the measurements, taken every {every} samples, fall together only after more than a million samples; choose \
         rates that divide each other"
    )]
    Period { every: String },
    #[error("there is no steady state: state '{state}' grows without noise (pole {modulus:.6})")]
    Growing { state: String, modulus: f64 },
    #[error(
        "there is no steady state of the driven states ({states}): {source}; is each of them seen by a measurement?"
    )]
    Riccati { states: String, source: LinalgError },
    /// `why` names the directions, one sentence each.
    #[error("there is no steady state: {why}")]
    Unobservable { why: String },
    #[error(transparent)]
    Linalg(#[from] LinalgError),
}

/// Steady state of a model, with measurements at any rates.
///
/// States that nothing drives and nothing damps (a constant bias, a ramp) are split off: their variance tends to
/// zero (like 1/t for a constant) and their gain is zero. The Riccati equation P = F P Fᵀ − F P Hᵀ S⁻¹ H P Fᵀ + Q of
/// the others, over one period of the measurements where they have several rates, is solved by doubling and compared
/// with the eigenvector solution. Where a split-off state cannot be told from a driven one (a constant beside a
/// random walk), the covariance that the filter reaches depends on P0 for ever and is found from it; gain, S and
/// poles do not. Errors: rates with no common period, a state that grows without noise, driven states that no
/// measurement sees or tells apart. Source of the periodic equation: Bittanti, Colaneri, De Nicolao 1991, "The
/// periodic Riccati equation".
pub fn steady_state(model: &LinearModel) -> Result<SteadyState, SteadyStateError> {
    let cycle = Cycle::new(&model.every).ok_or_else(|| {
        let every: Vec<String> = model.every.iter().map(ToString::to_string).collect();
        SteadyStateError::Period { every: every.join(", ") }
    })?;
    let n = model.states.len();
    let undriven = undriven_states(model);
    refuse_growth(model, &undriven)?;
    let driven: Vec<usize> = (0..n).filter(|i| !undriven.contains(i)).collect();

    let (f, h, q) =
        (select(&model.f, &driven, &driven), columns(&model.h, &driven), select(&model.q, &driven, &driven));
    let settled = Settled::new(&cycle, &f, &h, &q, &model.r).map_err(|source| unsettled(model, &driven, source))?;
    let p = &settled.solution.covariance;

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
    // eigenvalues of what an error becomes over a period
    let own = match &settled.closed_loop {
        Some(closed_loop) => eigenvalues(closed_loop),
        None => eigenvalues(&((DMatrix::<f64>::identity(driven.len(), driven.len()) - &driven_gain * &h) * &f)),
    };
    let slowest = own.first().map_or(0.0, |z| z.0.hypot(z.1));
    // −1/ln λ periods; written by 1 − λ so that a pole next to one keeps its digits.
    let periods = if slowest > 0.0 { -1.0 / (slowest - 1.0).ln_1p() } else { 0.0 };
    let time_constant = periods * cycle.period as f64;

    if rests_on_prior(model, &undriven)? {
        let doublings = (SETTLED * 10.0 * periods).max(1.0).log2().ceil() as u32;
        let mut flow = cycle.flow_of(model, cycle.period)?;
        for _ in 0..doublings {
            flow.double()?;
        }
        predicted_covariance = flow.apply(&model.p0)?;
    }
    let poles = if cycle.period == 1 {
        eigenvalues(&((DMatrix::<f64>::identity(n, n) - &gain * &model.h) * &model.f))
    } else {
        let mut poles: Vec<(f64, f64)> = own.iter().map(|z| root(*z, cycle.period)).collect();
        poles.extend(eigenvalues(&select(&model.f, &undriven, &undriven)));
        poles.sort_by(|a, b| b.0.hypot(b.1).total_cmp(&a.0.hypot(a.1)));
        poles
    };
    Ok(SteadyState {
        period: cycle.period,
        gain,
        predicted_covariance,
        innovation_covariance,
        poles,
        settling_time: SETTLED * time_constant * model.dt,
        residual: settled.solution.relative_residual,
        eigenvector_difference: settled.eigenvector_difference,
    })
}

/// The driven states after a long time.
struct Settled {
    solution: RiccatiSolution,
    eigenvector_difference: f64,
    /// What an error becomes over a period of several samples.
    closed_loop: Option<DMatrix<f64>>,
}

impl Settled {
    fn new(
        cycle: &Cycle,
        f: &DMatrix<f64>,
        h: &DMatrix<f64>,
        q: &DMatrix<f64>,
        r: &DMatrix<f64>,
    ) -> Result<Settled, LinalgError> {
        let difference = |p: &DMatrix<f64>, other: Result<DMatrix<f64>, LinalgError>| {
            other.map_or(f64::NAN, |other| relative_to_diagonal(&(other - p), p.diagonal().as_slice()))
        };
        if cycle.period == 1 {
            let solution = dare_doubling(f, h, q, r)?;
            let other = dare_eigenvector(f, h, q, r).map(|other| other.covariance);
            let eigenvector_difference = difference(&solution.covariance, other);
            return Ok(Settled { solution, eigenvector_difference, closed_loop: None });
        }
        let flow = cycle.flow(f, h, q, r, cycle.period)?;
        let solution = flow.periodic()?;
        let eigenvector_difference = difference(&solution.covariance, by_eigenvectors(&flow));
        let closed_loop = Some(flow.closed_loop(&solution.covariance)?);
        Ok(Settled { solution, eigenvector_difference, closed_loop })
    }
}

/// The eigenvector solution, where it is one.
fn by_eigenvectors(flow: &Flow) -> Result<DMatrix<f64>, LinalgError> {
    let other = flow.periodic_eigenvector()?;
    if other.relative_residual <= EIGENVECTOR_RESIDUAL { Ok(other.covariance) } else { Err(LinalgError::Singular) }
}

/// The principal root.
fn root((re, im): (f64, f64), degree: u64) -> (f64, f64) {
    let (modulus, angle) = (re.hypot(im).powf(1.0 / degree as f64), im.atan2(re) / degree as f64);
    (modulus * angle.cos(), modulus * angle.sin())
}

/// Why the Riccati equation has no solution: in directions, where some are not seen.
fn unsettled(model: &LinearModel, driven: &[usize], source: LinalgError) -> SteadyStateError {
    let hidden = observability(model).map(|found| found.unobservable).unwrap_or_default();
    let is_driven = |name: &String| driven.iter().any(|&i| model.states[i].name == *name);
    let why: Vec<String> = hidden
        .iter()
        .filter(|direction| direction.iter().any(|(name, _)| is_driven(name)))
        .map(|direction| undetermined(direction))
        .collect();
    if why.is_empty() {
        return SteadyStateError::Riccati { states: names(model, driven), source };
    }
    SteadyStateError::Unobservable { why: why.join("; ") }
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
