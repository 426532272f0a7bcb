//! What the measurements can tell about the states, in numbers and in words.

use nalgebra::DMatrix;

use super::LinearModel;
use crate::numerics::linalg::{LinalgError, eigenvalues, singular_values};
use crate::units::digits;

/// Poles this close to the unit circle count as lying on it (a time constant of 10¹² samples).
pub const MARGINAL: f64 = 1e-12;

/// Singular values below this fraction of the largest are rounding.
const RANK_TOLERANCE: f64 = 1e-12;

/// Powers of F are taken up to this size.
const LARGEST_POWER: f64 = 1e60;

/// Result of [`observability`].
#[derive(Clone, Debug, PartialEq)]
pub struct Observability {
    /// Number of independent combinations of states that the measurements determine.
    pub rank: usize,
    /// Largest over smallest counted singular value, columns scaled to unit length: how unequally well they are
    /// determined.
    pub condition: f64,
    /// Time over which the rows were taken, s: several times the slowest time constant.
    pub span_s: f64,
    /// States that are constant or grow and have no driving noise.
    pub undriven: Vec<String>,
    /// Directions that leave every measurement unchanged: (state, component), largest component 1.
    pub unobservable: Vec<Vec<(String, f64)>>,
    /// The above and what it means, one sentence each.
    pub sentences: Vec<String>,
}

/// Rank, condition and unobservable directions from the singular values of the observability matrix with rows h
/// F^j/√r for j = 0, 1, …, n − 1 and then 1, 2, 4, 8 … up to four times the slowest time constant, j counting the
/// samples at which the measurement is taken, each column scaled to length one.
///
/// Rows that far apart are needed because consecutive samples of a slow drift and of a constant look alike to rounding.
/// Errors: entries that are not finite.
/// Source: Kalman 1963, SIAM J. Control 1 (rank condition).
pub fn observability(model: &LinearModel) -> Result<Observability, LinalgError> {
    let n = model.states.len();
    let slowest = slowest_decay(&model.f);
    let span_steps = slowest.map_or(n as f64, |steps| (4.0 * steps).max(n as f64));
    let rows = observability_rows(model, span_steps);

    let norms: Vec<f64> = (0..n).map(|j| rows.column(j).norm()).collect();
    let scaled = DMatrix::from_fn(rows.nrows(), n, |i, j| if norms[j] > 0.0 { rows[(i, j)] / norms[j] } else { 0.0 });
    let (singular, v) = singular_values(&scaled)?;
    let largest = singular.first().copied().unwrap_or(0.0);
    let rank = singular.iter().filter(|&&s| s > RANK_TOLERANCE * largest).count();
    let condition = if rank == 0 { f64::INFINITY } else { largest / singular[rank - 1] };
    let null = DMatrix::from_fn(n, n - rank, |i, j| v[(i, rank + j)]);
    let unobservable: Vec<Vec<(String, f64)>> =
        sparse_basis(&null).into_iter().map(|direction| in_states(model, &direction, &norms)).collect();

    let undriven = undriven_states(model).into_iter().map(|i| model.states[i].name.clone()).collect();
    let mut result =
        Observability { rank, condition, span_s: span_steps * model.dt, undriven, unobservable, sentences: Vec::new() };
    result.sentences = sentences(model, &result);
    Ok(result)
}

/// Indices of states that nothing drives and that do not decay: no process noise on them or on any state that feeds
/// them, and poles on (or outside) the unit circle. A measurement that sees them drives their variance to zero, like
/// 1/t.
pub fn undriven_states(model: &LinearModel) -> Vec<usize> {
    let n = model.states.len();
    let mut still: Vec<bool> = (0..n).map(|i| model.q[(i, i)] == 0.0).collect();
    // A state fed by a driven one is driven; n passes reach the end of every chain.
    for _ in 0..n {
        for i in 0..n {
            if still[i] && (0..n).any(|j| j != i && model.f[(i, j)] != 0.0 && !still[j]) {
                still[i] = false;
            }
        }
    }
    let mut result = Vec::new();
    let mut visited = vec![false; n];
    for start in 0..n {
        if still[start] && !visited[start] {
            let group = connected(&model.f, start, &still, &mut visited);
            let block = DMatrix::from_fn(group.len(), group.len(), |i, j| model.f[(group[i], group[j])]);
            let slowest = eigenvalues(&block).first().map_or(0.0, |z| z.0.hypot(z.1));
            if slowest >= 1.0 - MARGINAL {
                result.extend(group);
            }
        }
    }
    result.sort_unstable();
    result
}

/// States among `allowed` that are coupled to `start` by F, in either direction.
fn connected(f: &DMatrix<f64>, start: usize, allowed: &[bool], visited: &mut [bool]) -> Vec<usize> {
    let mut group = vec![start];
    visited[start] = true;
    let mut next = 0;
    while next < group.len() {
        let i = group[next];
        next += 1;
        for j in 0..allowed.len() {
            if allowed[j] && !visited[j] && (f[(i, j)] != 0.0 || f[(j, i)] != 0.0) {
                visited[j] = true;
                group.push(j);
            }
        }
    }
    group
}

/// Time constant of the slowest decaying pole, in steps.
fn slowest_decay(f: &DMatrix<f64>) -> Option<f64> {
    eigenvalues(f)
        .iter()
        .map(|z| z.0.hypot(z.1))
        .filter(|modulus| *modulus < 1.0 - MARGINAL && *modulus > 0.0)
        .map(|modulus| -1.0 / modulus.ln())
        .max_by(f64::total_cmp)
}

/// Every measurement at its own rate, each in units of its own noise.
fn observability_rows(model: &LinearModel, span_steps: f64) -> DMatrix<f64> {
    let n = model.f.nrows();
    let mut rows = Vec::new();
    for (i, &every) in model.every.iter().enumerate() {
        let between = model.f.pow(every.min(u32::MAX as usize) as u32);
        let h = model.h.row(i) / model.r[(i, i)].sqrt();
        let mut row = h.clone_owned();
        for _ in 0..n {
            rows.push(row.clone());
            row = &row * &between;
        }
        let mut power = between;
        let mut steps = every as f64;
        // what grows for ever is seen long before its numbers overflow
        while steps < span_steps && power.amax() < LARGEST_POWER {
            power = &power * &power;
            steps *= 2.0;
            rows.push(&h * &power);
        }
    }
    DMatrix::from_fn(rows.len(), n, |i, j| rows[i][j])
}

/// Null-space basis in reduced echelon form, so that a direction names as few states as possible.
fn sparse_basis(null: &DMatrix<f64>) -> Vec<Vec<f64>> {
    let mut vectors: Vec<Vec<f64>> = null.column_iter().map(|c| c.iter().copied().collect()).collect();
    let mut used = vec![false; null.nrows()];
    for k in 0..vectors.len() {
        // Pivot: the largest component among the states not used yet.
        let free = (0..null.nrows()).filter(|&i| !used[i]);
        let Some(pivot) = free.max_by(|&i, &j| vectors[k][i].abs().total_cmp(&vectors[k][j].abs())) else { continue };
        used[pivot] = true;
        let divisor = vectors[k][pivot];
        vectors[k].iter_mut().for_each(|v| *v /= divisor);
        let row = vectors[k].clone();
        for (other, vector) in vectors.iter_mut().enumerate() {
            if other != k {
                let factor = vector[pivot];
                vector.iter_mut().zip(&row).for_each(|(v, r)| *v -= factor * r);
            }
        }
    }
    vectors
}

/// A direction of scaled columns as (state, component) with the largest component 1 and rounding dropped.
fn in_states(model: &LinearModel, direction: &[f64], norms: &[f64]) -> Vec<(String, f64)> {
    let unscaled: Vec<f64> =
        direction.iter().zip(norms).map(|(v, norm)| if *norm > 0.0 { v / norm } else { *v }).collect();
    let relative: Vec<bool> = direction.iter().map(|v| v.abs() > 1e-6).collect();
    let kept = |i: &usize| relative[*i];
    let largest = (0..unscaled.len())
        .filter(kept)
        .map(|i| unscaled[i])
        .fold(0.0, |a: f64, b| if b.abs() > a.abs() { b } else { a });
    (0..unscaled.len()).filter(kept).map(|i| (model.states[i].name.clone(), unscaled[i] / largest)).collect()
}

fn sentences(model: &LinearModel, found: &Observability) -> Vec<String> {
    let n = model.states.len();
    let mut lines = Vec::new();
    if found.rank == n {
        let (condition, span) = (digits(found.condition), digits(found.span_s));
        lines.push(format!("All {n} states are observable (condition {condition} over {span} s)."));
    } else {
        lines.push(format!("{} of {n} independent combinations of states are observable.", found.rank));
    }
    lines.extend(found.unobservable.iter().map(|direction| direction_in_words(direction)));
    let hidden = |name: &String| found.unobservable.iter().flatten().any(|(state, _)| state == name);
    for name in found.undriven.iter().filter(|name| !hidden(name)) {
        lines
            .push(format!("{name} has no driving noise: its variance falls towards zero and its steady gain is zero."));
    }
    if let [constant] = found.undriven.as_slice()
        && !hidden(constant)
    {
        lines.extend(told_apart(model, constant));
    }
    lines
}

fn direction_in_words(direction: &[(String, f64)]) -> String {
    if let [(name, _)] = direction {
        return format!("{name} reaches no measurement: nothing reduces its variance.");
    }
    let (names, change) = in_words(direction);
    format!(
        "{names} cannot be told apart: a change of {change} leaves every measurement as it was; what the measurement \
         sees of them together is \
         estimated, the split rests on P0."
    )
}

/// A direction that no measurement sees and that noise drives, in words.
pub fn undetermined(direction: &[(String, f64)]) -> String {
    if let [(name, _)] = direction {
        return format!(
            "{name} reaches no measurement and its variance grows for ever; add a measurement (an aid) that sees it"
        );
    }
    let (names, change) = in_words(direction);
    format!(
        "{names} cannot be told apart: a change of {change} leaves every measurement as it was, and noise drives it; \
         add a measurement (an \
         aid) that sees one of them"
    )
}

/// The states of a direction and how they change, SI.
fn in_words(direction: &[(String, f64)]) -> (String, String) {
    let names: Vec<&str> = direction.iter().map(|(name, _)| name.as_str()).collect();
    let change: Vec<String> = direction
        .iter()
        .map(|(name, v)| format!("{}{} in {name}", if *v < 0.0 { "−" } else { "+" }, digits(v.abs())))
        .collect();
    (names.join(" and "), change.join(", "))
}

/// How long it takes, at best, to tell a constant from each first-order drift that acts where it acts: the mean of the
/// drift over T has variance 2σ²Tc/T for T ≫ Tc, so the constant is known to σ/2 after 8 Tc and to σ/10 after 200 Tc.
fn told_apart(model: &LinearModel, constant: &str) -> Vec<String> {
    let n = model.states.len();
    let Some(c) = model.states.iter().position(|state| state.name == constant) else { return Vec::new() };
    let first_order = |i: usize| (0..n).all(|j| j == i || model.f[(i, j)] == 0.0);
    let seen = |i: usize| {
        let acts = model.h.column(i).iter().any(|h| *h != 0.0) || (0..n).any(|k| k != i && model.f[(k, i)] != 0.0);
        acts && model.h.column(i) == model.h.column(c)
            && (0..n).all(|k| k == i || k == c || model.f[(k, i)] == model.f[(k, c)])
    };
    let mut lines = Vec::new();
    for i in (0..n).filter(|&i| first_order(i) && seen(i) && model.q[(i, i)] > 0.0) {
        let pole = model.f[(i, i)];
        if pole > 0.0 && pole < 1.0 - MARGINAL {
            let tc = -model.dt / pole.ln();
            let name = &model.states[i].name;
            lines.push(format!(
                "{constant} and {name} (correlation time {} s) are told apart only through the drift's decay: \
                 {constant} is known to half \
                 the standard deviation of {name} after about {} s (8 correlation times), to a tenth after {} s (200).",
                digits(tc),
                digits(8.0 * tc),
                digits(200.0 * tc)
            ));
        }
    }
    lines
}
