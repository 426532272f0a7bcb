//! Autocovariance least squares: variances from the autocovariance of the innovations of a filter that is not the
//! best one.
//!
//! Of a filter with any stable gain K in a world with Q and R, Ā = F (I − K H), P = Ā P Āᵀ + Q + F K R Kᵀ Fᵀ, the
//! innovations have C₀ = H P Hᵀ + R and C_j = H Ā^j P Hᵀ − H Ā^(j−1) F K R: linear in Q and R. The sample
//! autocovariances are fitted by least squares. Sources: Odelson, Rajamani & Rawlings 2006, Automatica 42, 303–308;
//! Rajamani & Rawlings 2009, Automatica 45, 142–148.

use nalgebra::{DMatrix, DVector};
use schemars::JsonSchema;
use serde::Serialize;

use super::{Found, ObjectiveError, Problem};
use crate::filter::innovations::run;
use crate::filter::steady_state;
use crate::model::LinearModel;
use crate::model::observability::undriven_states;
use crate::numerics::linalg::LinalgError;
use crate::numerics::riccati::lyapunov;
use crate::signal::correlation::lagged_products;
use crate::tune::parameters::Group;
use crate::units::digits;

/// More unknowns are refused: every subset of them is tried.
const MOST_SOURCES: usize = 12;
/// Lags in time constants of the filter, and at least.
const TIME_CONSTANTS: f64 = 5.0;
const FEWEST_LAGS: usize = 15;
/// Settling times that are left out at the start.
const LEFT_OUT: f64 = 1.0;
/// The log must be so many times as long as the lags.
const LENGTHS: usize = 10;

/// A part of Q and R whose size is unknown.
#[derive(Clone, Debug, PartialEq)]
pub struct Source {
    pub q: DMatrix<f64>,
    pub r: DMatrix<f64>,
}

#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum AlsError {
    #[error("{found} unknown variances; at most {MOST_SOURCES} can be told apart")]
    TooMany { found: usize },
    #[error("the autocovariances do not tell the variances apart; hold some of them")]
    Alike,
    #[error(transparent)]
    Linalg(#[from] LinalgError),
}

/// Sizes of the sources.
#[derive(Clone, Debug, PartialEq)]
pub struct Estimate {
    /// Not negative.
    pub sizes: Vec<f64>,
    /// Their standard deviations, as if the innovations were nearly white; those at zero have none.
    pub std_devs: Vec<Option<f64>>,
}

/// Sizes v ≥ 0 of `sources`, Q = Σ v Q_i and R = Σ v R_i beside a known `fixed` part, from sample autocovariances
/// C_0 … C_N of the innovations of the filter x⁺ = F (x + K ν), made of `samples` of them.
///
/// Least squares with weights 1/var of each entry, that of nearly white innovations: var C_j[a, b] = C₀[a, a] C₀[b,
/// b]/samples, twice that for variances. v ≥ 0 by trying every subset of the unknowns, which is exact. Shapes: `f` n
/// × n, `h` m × n, `gain` n × m, C_j m × m, C_j[a, b] = E[ν_a(k + j) ν_b(k)]. Errors: more than twelve unknowns,
/// unknowns that the autocovariances do not tell apart, an unstable filter.
pub fn als(
    f: &DMatrix<f64>,
    h: &DMatrix<f64>,
    gain: &DMatrix<f64>,
    sources: &[Source],
    fixed: Option<&Source>,
    autocovariance: &[DMatrix<f64>],
    samples: f64,
) -> Result<Estimate, AlsError> {
    if sources.len() > MOST_SOURCES {
        return Err(AlsError::TooMany { found: sources.len() });
    }
    let Some(c0) = autocovariance.first() else { return Err(AlsError::Alike) };
    let lags = autocovariance.len();
    let entries: Vec<(usize, usize, usize, f64)> = (0..lags)
        .flat_map(|j| (0..c0.nrows()).flat_map(move |a| (0..c0.ncols()).map(move |b| (j, a, b))))
        // C₀ is symmetric: one half of it
        .filter(|(j, a, b)| *j > 0 || a >= b)
        .map(|(j, a, b)| {
            let own = if j == 0 { c0[(a, b)] * c0[(a, b)] } else { 0.0 };
            (j, a, b, (samples / (c0[(a, a)] * c0[(b, b)] + own)).sqrt())
        })
        .collect();
    let column = |source: &Source| -> Result<DVector<f64>, LinalgError> {
        let all = expected(f, h, gain, source, lags)?;
        Ok(DVector::from_iterator(entries.len(), entries.iter().map(|&(j, a, b, weight)| weight * all[j][(a, b)])))
    };
    let mut target =
        DVector::from_iterator(entries.len(), entries.iter().map(|&(j, a, b, w)| w * autocovariance[j][(a, b)]));
    if let Some(fixed) = fixed {
        target -= column(fixed)?;
    }
    let columns = sources.iter().map(column).collect::<Result<Vec<_>, _>>()?;
    let n = columns.len();
    let scale: Vec<f64> = columns.iter().map(|column| column.norm()).collect();
    if scale.iter().any(|s| s.is_nan() || *s <= 0.0) {
        return Err(AlsError::Alike);
    }
    let normal = DMatrix::from_fn(n, n, |i, k| columns[i].dot(&columns[k]) / (scale[i] * scale[k]));
    let right = DVector::from_fn(n, |i, _| columns[i].dot(&target) / scale[i]);
    if nalgebra::Cholesky::new(&normal - DMatrix::identity(n, n) * 1e-10).is_none() {
        return Err(AlsError::Alike);
    }
    // of a subset: the sizes, what is left of the squares but for a constant, and the covariance of the sizes
    let solved = |kept: &[usize]| {
        let wanted = right.select_rows(kept);
        let factor = nalgebra::Cholesky::new(normal.select_rows(kept).select_columns(kept))?;
        let sizes = factor.solve(&wanted);
        let rest = -sizes.dot(&wanted);
        Some((sizes, rest, factor.inverse()))
    };
    let mut best: (f64, Vec<usize>) = (f64::INFINITY, Vec::new());
    for chosen in 0..1_usize << n {
        let kept: Vec<usize> = (0..n).filter(|i| chosen >> i & 1 == 1).collect();
        let Some((sizes, rest, _)) = solved(&kept) else { continue };
        if sizes.iter().all(|v| *v >= 0.0) && rest < best.0 {
            best = (rest, kept);
        }
    }
    let kept = best.1;
    let (sizes, _, covariance) = solved(&kept).ok_or(AlsError::Alike)?;
    let mut estimate = Estimate { sizes: vec![0.0; n], std_devs: vec![None; n] };
    for (k, &i) in kept.iter().enumerate() {
        estimate.sizes[i] = sizes[k] / scale[i];
        estimate.std_devs[i] = Some(covariance[(k, k)].sqrt() / scale[i]);
    }
    Ok(estimate)
}

/// C_0 … C_(lags−1) of the innovations where Q and R are those of a source.
pub fn expected(
    f: &DMatrix<f64>,
    h: &DMatrix<f64>,
    gain: &DMatrix<f64>,
    source: &Source,
    lags: usize,
) -> Result<Vec<DMatrix<f64>>, LinalgError> {
    let f_k = f * gain;
    let closed = f - &f_k * h;
    let p = lyapunov(&closed, &(&source.q + &f_k * &source.r * f_k.transpose()))?;
    let mut all = Vec::with_capacity(lags);
    all.push(h * &p * h.transpose() + &source.r);
    // Ā P Hᵀ − F K R, then Ā times that
    let mut state = &closed * &p * h.transpose() - &f_k * &source.r;
    for _ in 1..lags {
        all.push(h * &state);
        state = &closed * state;
    }
    Ok(all)
}

/// What the autocovariances said of the parameters of one axis.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct AlsAxis {
    pub axis: String,
    /// Innovations, and lags of their autocovariance.
    pub samples: usize,
    pub lags: usize,
    /// Parameters that were found: amounts of noise. Times and frequencies stay as they are.
    pub parameters: Vec<String>,
}

/// Sample autocovariances of the innovations after the first `first` steps of every log, and how many innovations
/// there are.
fn sample(
    problem: &Problem<'_>,
    model: &LinearModel,
    axis: usize,
    first: usize,
    lags: usize,
) -> Result<(Vec<DMatrix<f64>>, usize), ObjectiveError> {
    let m = model.measurements.len();
    let mut sums = vec![DMatrix::<f64>::zeros(m, m); lags + 1];
    let mut pairs = sums.clone();
    let mut samples = 0;
    for log in problem.request.logs {
        let own = &log.axes[axis];
        let rows = own.len();
        if rows < first + LENGTHS * lags {
            let seconds = |rows: usize| digits(rows as f64 * model.dt);
            let message = format!(
                "{} s are too short for als: the filter settles in {} s and the autocovariance is taken up to {} s; \
                 expected at least {} s",
                seconds(rows),
                seconds(first),
                seconds(lags),
                seconds(first + LENGTHS * lags)
            );
            return Err(ObjectiveError::Log { log: log.name.clone(), message });
        }
        // where each row stands in time; a gap longer than the lags is as long as them
        let mut place = Vec::with_capacity(rows);
        let mut next = 0;
        for (row, &missing) in own.missing.iter().enumerate() {
            next += if row == 0 { 0 } else { 1 + missing.min(lags as u64) as usize };
            place.push(next);
        }
        let mut values = vec![vec![0.0; next + 1]; m];
        let mut present = values.clone();
        run(model, own, rows, |row, index, update| {
            if row >= first && update.accepted {
                values[index][place[row]] = update.innovation;
                present[index][place[row]] = 1.0;
                samples += usize::from(index == 0);
            }
        });
        for (a, b) in (0..m).flat_map(|a| (0..m).map(move |b| (a, b))) {
            let products = lagged_products(&values[a], &values[b], lags);
            let counts = lagged_products(&present[a], &present[b], lags);
            for j in 0..=lags {
                sums[j][(a, b)] += products[j];
                pairs[j][(a, b)] += counts[j].round();
            }
        }
    }
    let mean = |(sum, pairs): (DMatrix<f64>, DMatrix<f64>)| sum.zip_map(&pairs, |sum, pairs| sum / pairs.max(1.0));
    Ok((sums.into_iter().zip(pairs).map(mean).collect(), samples))
}

/// Every free parameter of a group is an amount of noise: others are held before.
pub(super) fn choose(problem: &Problem<'_>, group: &Group, told: &mut Vec<AlsAxis>) -> Result<Found, ObjectiveError> {
    let request = problem.request;
    if request.logs.is_empty() {
        return Err(ObjectiveError::NoLog { objective: request.objective.name() });
    }
    let failed = |message: String| ObjectiveError::Als { axis: problem.names(group), message };
    let models = problem.models(group, &vec![0.0; group.free.len()])?;
    let (&[axis], [model]) = (group.axes.as_slice(), models.as_slice()) else {
        return Err(failed("als finds the parameters of one axis at a time; hold those of the aids".into()));
    };
    if model.every.iter().any(|&every| every != 1) {
        return Err(failed(
            "als needs every measurement at every sample; use `objective` likelihood where an aid is slower".into(),
        ));
    }
    let undriven = undriven_states(model);
    let kept: Vec<usize> = (0..model.states.len()).filter(|i| !undriven.contains(i)).collect();
    let part = model.part(&kept);
    let steady = steady_state(&part).map_err(|error| failed(error.to_string()))?;
    let settling = steady.settling_time / model.dt;
    let lags = ((TIME_CONSTANTS * settling / 4.0).ceil() as usize).max(FEWEST_LAGS);
    let first = (LEFT_OUT * settling).ceil() as usize;
    let (autocovariance, samples) = sample(problem, model, axis, first, lags)?;
    // Q and R are linear in the square of every amount: twice the square less once
    let root = 0.5 * 2.0_f64.ln();
    let mut sources = Vec::with_capacity(group.free.len());
    let mut fixed = Source { q: part.q.clone(), r: part.r.clone() };
    for k in 0..group.free.len() {
        let mut shifts = vec![0.0; group.free.len()];
        shifts[k] = root;
        let more = &problem.models(group, &shifts)?[0];
        if more.states != model.states {
            let name = problem.space.name(group.free[k]);
            return Err(failed(format!("the number of states depends on the size of {name}; hold it (`hold` {name})")));
        }
        let more = more.part(&kept);
        let source = Source { q: &more.q - &part.q, r: &more.r - &part.r };
        fixed.q -= &source.q;
        fixed.r -= &source.r;
        sources.push(source);
    }
    let found = als(&part.f, &part.h, &steady.gain, &sources, Some(&fixed), &autocovariance, samples as f64)
        .map_err(|error| failed(error.to_string()))?;
    let names: Vec<String> = group.free.iter().map(|&i| problem.space.name(i)).collect();
    if let Some(k) = found.sizes.iter().position(|size| *size <= 0.0) {
        let name = &names[k];
        return Err(failed(format!(
            "the autocovariances of {samples} innovations show nothing of {name}: its variance is best zero; hold it \
             (`hold` {name}), leave its \
             term out, or give a longer log"
        )));
    }
    told.push(AlsAxis { axis: problem.axis_name(axis), samples, lags, parameters: names });
    Ok(Found {
        shifts: found.sizes.iter().map(|size| 0.5 * size.ln()).collect(),
        std_devs: found.sizes.iter().zip(&found.std_devs).map(|(v, s)| s.map(|s| 0.5 * s / v)).collect(),
    })
}
