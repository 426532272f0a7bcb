//! Roots, minima and second differences: the only searches of the house.

use super::progress::checkpoint;
use std::cell::{Cell, RefCell};

use nalgebra::DMatrix;
use slsqp::{FailStatus, Func, StopTols, SuccessStatus};

/// What stands for a value that is none: far above every other, and its square is still finite.
const NOWHERE: f64 = 1.3e154;

/// x between `low` and `high` with f(x) = 0, to ±`tolerance` and rounding: secants and inverse parabolas, halving where
/// these leave the bracket. `f` may fail.
///
/// `None` when f has one sign at both ends, fails, or is not a number. Of a function that leaps over zero, the place of
/// the leap. Source: Brent 1973, Algorithms for Minimization without Derivatives, chapter 4.
pub fn bracketed_root<V: Into<Option<f64>>>(
    mut f: impl FnMut(f64) -> V,
    low: f64,
    high: f64,
    tolerance: f64,
) -> Option<f64> {
    let mut value = |x: f64| {
        checkpoint();
        f(x).into().filter(|v| !v.is_nan())
    };
    // b is the best point, a the one before it, and the root is between b and c
    let (mut a, mut b) = (low, high);
    let (mut f_a, mut f_b) = (value(a)?, value(b)?);
    if f_a == 0.0 {
        return Some(a);
    }
    if f_b != 0.0 && (f_a > 0.0) == (f_b > 0.0) {
        return None;
    }
    let (mut c, mut f_c) = (a, f_a);
    let (mut step, mut before) = (b - a, b - a);
    loop {
        if f_c.abs() < f_b.abs() {
            (a, b, c) = (b, c, b);
            (f_a, f_b, f_c) = (f_b, f_c, f_b);
        }
        let enough = 2.0 * f64::EPSILON * b.abs() + 0.5 * tolerance;
        let half = 0.5 * (c - b);
        if half.abs() <= enough || f_b == 0.0 {
            return Some(b);
        }
        let s = f_b / f_a;
        let (p, q) = if a == c {
            (2.0 * half * s, 1.0 - s)
        } else {
            let (q, r) = (f_a / f_c, f_b / f_c);
            (s * (2.0 * half * q * (q - r) - (b - a) * (r - 1.0)), (q - 1.0) * (r - 1.0) * (s - 1.0))
        };
        let (p, q) = if p > 0.0 { (p, -q) } else { (-p, q) };
        let inside = 2.0 * p < (3.0 * half * q - (enough * q).abs()).min((before * q).abs());
        (before, step) =
            if before.abs() >= enough && f_a.abs() > f_b.abs() && inside { (step, p / q) } else { (half, half) };
        (a, f_a) = (b, f_b);
        b += if step.abs() > enough { step } else { enough.copysign(half) };
        f_b = value(b)?;
        if (f_b > 0.0) == (f_c > 0.0) {
            (c, f_c) = (a, f_a);
            (step, before) = (b - a, b - a);
        }
    }
}

/// The neighbours between which an answer turns from no (at the first end) to yes (at the second): of what is whole
/// numbers, a count of draws, or too dear to be known to rounding. `between` gives the next place, `None` when the two
/// are close enough.
///
/// # Errors
///
/// Those of `past`.
pub fn bisect<T: Copy, E>(
    mut low: T,
    mut high: T,
    between: impl Fn(T, T) -> Option<T>,
    mut past: impl FnMut(T) -> Result<bool, E>,
) -> Result<(T, T), E> {
    while let Some(middle) = between(low, high) {
        if past(middle)? { high = middle } else { low = middle }
    }
    Ok((low, high))
}

/// Half way between two numbers that are further apart than `width`: for [`bisect`].
pub fn half_way(width: f64) -> impl Fn(f64, f64) -> Option<f64> {
    move |low, high| ((high - low).abs() > width).then_some(0.5 * (low + high))
}

/// The place of the least value of a function with one valley between `low` and `high`, within ±`width`/2: golden
/// section, which kinks do not mislead. Source: Kiefer 1953, Proc. Amer. Math. Soc. 4.
pub fn lowest(mut f: impl FnMut(f64) -> f64, mut low: f64, mut high: f64, width: f64) -> f64 {
    let golden = 0.5 * (5f64.sqrt() - 1.0);
    let (mut a, mut b) = (high - golden * (high - low), low + golden * (high - low));
    let (mut at_a, mut at_b) = (f(a), f(b));
    while high - low > width {
        if at_a < at_b {
            (high, b, at_b) = (b, a, at_a);
            a = high - golden * (high - low);
            at_a = f(a);
        } else {
            (low, a, at_a) = (a, b, at_b);
            b = low + golden * (high - low);
            at_b = f(b);
        }
    }
    0.5 * (low + high)
}

/// What is known at a point: the objective, then the constraints, and the slopes of each by every x; none where they
/// were not asked for.
#[derive(Clone, Debug, Default)]
pub struct Look {
    pub values: Vec<f64>,
    pub slopes: Vec<Vec<f64>>,
}

/// A look at x, with what it is divided by, and whether slopes are wanted.
pub type Looks<'a> = dyn Fn(&[f64], &[f64], bool) -> Look + 'a;

/// A look by central differences of these steps; `values` gives objective and constraints at many points at once.
pub fn look(values: impl Fn(&[Vec<f64>]) -> Vec<Vec<f64>>, at: &[f64], steps: &[f64], sloped: bool) -> Look {
    let asked = if sloped { steps.len() } else { 0 };
    let sides = (0..asked).flat_map(|k| [steps[k], -steps[k]].map(|s| shifted(at, &[(k, s)])));
    let mut found = values(&std::iter::once(at.to_vec()).chain(sides).collect::<Vec<_>>()).into_iter();
    let values = found.next().unwrap_or_default();
    let pairs: Vec<Vec<f64>> = found.collect();
    let slope =
        |i: usize| pairs.chunks_exact(2).zip(steps).map(|(pair, s)| (pair[0][i] - pair[1][i]) / (2.0 * s)).collect();
    Look { slopes: (0..if sloped { values.len() } else { 0 }).map(slope).collect(), values }
}

/// What is to be minimised, and how well.
pub struct Problem<'a> {
    /// Every constraint is at most 0 at the end.
    pub look: &'a Looks<'a>,
    pub constraints: usize,
    /// By x and f(x): how far each x moves the objective by about ½.
    pub scale: &'a dyn Fn(&[f64], f64) -> Vec<f64>,
    /// The objective at the start; infinite where the first round counts whatever it finds, as under constraints.
    pub start: f64,
    /// A round ends when f changes by less than this plus this share of it, when no x/scale changes by more than this,
    /// or after so many evaluations.
    pub f_abs: f64,
    pub f_rel: f64,
    pub x_abs: f64,
    pub evaluations: usize,
    /// Rounds at most, each with a fresh scale; another follows only after a gain of `worth` plus the share `worth_rel`
    /// of f.
    pub rounds: usize,
    pub worth: f64,
    pub worth_rel: f64,
}

impl Default for Problem<'_> {
    /// Nothing to be minimised, of one scale, to 10⁻⁵ of what is a logarithm of a likelihood.
    fn default() -> Self {
        Problem {
            look: &|_, _, _| Look::default(),
            constraints: 0,
            scale: &|x, _| vec![1.0; x.len()],
            start: f64::INFINITY,
            f_abs: 1e-6,
            f_rel: 1e-14,
            x_abs: 0.0,
            evaluations: 100,
            rounds: 8,
            worth: 1e-5,
            worth_rel: 0.0,
        }
    }
}

/// Why a search ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reason {
    /// By the tolerances.
    Converged,
    /// More evaluations or rounds might gain.
    OutOfEvaluations,
    /// Rounding leaves no step downwards.
    Rounding,
    /// No finite value, or a contradiction of constraints.
    Failed,
}

/// The best that was found.
#[derive(Clone, Debug, PartialEq)]
pub struct Optimum {
    pub x: Vec<f64>,
    pub f: f64,
    pub reason: Reason,
    /// Looks that were taken.
    pub evaluations: usize,
}

/// The minimum next to a start within bounds, which the start is moved into: sequential quadratic programming on
/// x/scale, begun again with fresh scales while that gains. Without constraints never worse than the start; with them
/// the result may break one (a place counts as good only where they hold to the last bit): look at it. Source: Kraft
/// 1988, DFVLR-FB 88-28; the crate `slsqp`.
pub fn minimize(problem: &Problem<'_>, start: &[f64], bounds: &[(f64, f64)]) -> Optimum {
    let within = |(x, (low, high)): (f64, &(f64, f64))| x.clamp(*low, *high);
    let x: Vec<f64> = start.iter().copied().zip(bounds).map(within).collect();
    let mut best = Optimum { x, f: problem.start, reason: Reason::Converged, evaluations: 0 };
    for _ in 0..if start.is_empty() { 0 } else { problem.rounds } {
        let scale = (problem.scale)(&best.x, best.f);
        let whole = |x: &[f64]| x.iter().zip(&scale).map(|(x, s)| x * s).zip(bounds).map(within).collect::<Vec<f64>>();
        // objective and constraints are asked one after the other
        let (last, looks) = (RefCell::new((Vec::new(), Look::default())), Cell::new(0));
        let of = |which: usize, x: &[f64], slopes: Option<&mut [f64]>| {
            let mut last = last.borrow_mut();
            if last.0 != x || (slopes.is_some() && last.1.slopes.is_empty()) {
                checkpoint();
                *last = (x.to_vec(), (problem.look)(&whole(x), &scale, slopes.is_some()));
                looks.set(looks.get() + 1);
            }
            let own = last.1.slopes.get(which).into_iter().flatten().zip(&scale);
            slopes.into_iter().flatten().zip(own).for_each(|(out, (slope, s))| *out = slope * s);
            last.1.values.get(which).copied().filter(|value| value.is_finite()).unwrap_or(NOWHERE)
        };
        let part = |which: usize| move |x: &[f64], slopes: Option<&mut [f64]>, _: &mut ()| of(which, x, slopes);
        let constraints: Vec<_> = (1..=problem.constraints).map(part).collect();
        let constraints: Vec<&dyn Func<()>> = constraints.iter().map(|f| f as &dyn Func<()>).collect();
        let scaled: Vec<f64> = best.x.iter().zip(&scale).map(|(x, s)| x / s).collect();
        let limits: Vec<(f64, f64)> = bounds.iter().zip(&scale).map(|((low, high), s)| (low / s, high / s)).collect();
        let tolerances = StopTols {
            ftol_abs: problem.f_abs,
            ftol_rel: problem.f_rel,
            xtol_abs: vec![problem.x_abs; scale.len()],
            ..StopTols::default()
        };
        let most = problem.evaluations;
        let (reason, x, f) = match slsqp::minimize(part(0), &scaled, &limits, &constraints, (), most, Some(tolerances))
        {
            Ok((SuccessStatus::MaxEvalReached, x, f)) => (Reason::OutOfEvaluations, x, f),
            Ok((_, x, f)) => (Reason::Converged, x, f),
            Err((FailStatus::RoundoffLimited, x, f)) => (Reason::Rounding, x, f),
            Err((_, x, f)) => (Reason::Failed, x, f),
        };
        let good = f < NOWHERE && x.iter().all(|x| x.is_finite());
        best.evaluations += looks.get();
        best.reason = if good { reason } else { Reason::Failed };
        let gain = if good { best.f - f } else { f64::NEG_INFINITY };
        if gain > 0.0 {
            (best.x, best.f) = (whole(&x), f);
        }
        if gain < problem.worth + problem.worth_rel * best.f {
            break;
        }
    }
    best
}

/// The least value near `start` by steps of `step` along each axis, halved down to `least` while none leads down:
/// kinks and limits (where f is infinite) do not mislead it. Within `bounds`. Source: Kolda, Lewis and Torczon 2003,
/// SIAM Review 45(3), compass search.
pub fn compass(
    values: impl Fn(&[Vec<f64>]) -> Vec<f64>,
    start: &[f64],
    bounds: &[(f64, f64)],
    mut step: f64,
    least: f64,
) -> (Vec<f64>, f64) {
    let mut x = start.to_vec();
    let mut f = values(&[x.clone()]).first().copied().unwrap_or(f64::INFINITY);
    while step >= least {
        checkpoint();
        let ways = (0..x.len()).flat_map(|k| [step, -step].map(|by| shifted(&x, &[(k, by)])));
        let inside = |x: &Vec<f64>| x.iter().zip(bounds).all(|(x, (low, high))| (*low..=*high).contains(x));
        let ways: Vec<Vec<f64>> = ways.filter(inside).collect();
        let found = values(&ways).into_iter().zip(ways).min_by(|a, b| a.0.total_cmp(&b.0));
        match found.filter(|(value, _)| *value < f) {
            Some((value, next)) => (f, x) = (value, next),
            None => step *= 0.5,
        }
    }
    (x, f)
}

/// The matrix of second derivatives ∂²f/∂x_i∂x_k by central differences of these steps; `value` is f(at). `values`
/// gives f at many points at once.
pub fn hessian(values: impl Fn(&[Vec<f64>]) -> Vec<f64>, at: &[f64], value: f64, steps: &[f64]) -> DMatrix<f64> {
    let n = at.len();
    let pairs = || (0..n).flat_map(|i| (0..=i).map(move |k| (i, k)));
    let corners = |(i, k): (usize, usize)| {
        let signs: &[(f64, f64)] =
            if i == k { &[(1.0, 0.0), (-1.0, 0.0)] } else { &[(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)] };
        signs.iter().map(move |(a, b)| shifted(at, &[(i, a * steps[i]), (k, b * steps[k])]))
    };
    let values = values(&pairs().flat_map(corners).collect::<Vec<_>>());
    let mut rest = &values[..];
    let mut second = DMatrix::zeros(n, n);
    for (i, k) in pairs() {
        let (own, later) = rest.split_at(if i == k { 2 } else { 4 });
        rest = later;
        let difference = match own {
            [above, below] => above + below - 2.0 * value,
            [x, y, z, w] => 0.25 * (x - y - z + w),
            _ => f64::NAN,
        };
        second[(i, k)] = difference / (steps[i] * steps[k]);
        second[(k, i)] = second[(i, k)];
    }
    second
}

/// The inverse of an information matrix; `None` where that is singular.
pub fn covariance(information: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let p = information.nrows();
    // scaled to unit diagonal: logarithms of a frequency and of a coefficient differ by many orders
    let scale: Vec<f64> = (0..p).map(|i| information[(i, i)].abs().sqrt().max(1e-300)).collect();
    let scaled = DMatrix::from_fn(p, p, |i, k| information[(i, k)] / (scale[i] * scale[k]));
    let inverse = nalgebra::Cholesky::new(scaled)?.inverse();
    Some(DMatrix::from_fn(p, p, |i, k| inverse[(i, k)] / (scale[i] * scale[k])))
}

/// A point with some of its numbers moved.
pub fn shifted(at: &[f64], shifts: &[(usize, f64)]) -> Vec<f64> {
    let mut next = at.to_vec();
    shifts.iter().for_each(|(i, by)| next[*i] += by);
    next
}
