//! Generalised least squares on the overlapping Allan curve.
//!
//! The points are correlated and, at long averaging times, far from normal. Both are taken into account: with v_i
//! the measured and a_i(θ) the sampled-form Allan variance and e_i the exact degrees of freedom, the cube root
//! (v_i/a_i)^(1/3) is nearly normal (Wilson and Hilferty 1931) with the moments of (χ²_e/e)^(1/3), and the points
//! are correlated as the exact covariance of the estimates says. The fit minimises the whitened residuals of the
//! cube roots, recomputes the weights at the minimum and repeats until nothing moves.
//!
//! To half the sum of squares comes ⅓ Σ h_i ln a_i, h_i the leverage of point i (diagonal of D(DᵀC⁻¹D)⁻¹DᵀC⁻¹, D the
//! Jacobian of the cube roots, C their covariance; Σ h_i is the number of parameters): for one variance with e
//! degrees of freedom that moves the estimate from v(1 + 2/(3e)), where the mean of the cube root is met, to v,
//! which is its maximum likelihood. Since a long correlation time has few degrees of freedom, the long upper tails
//! of σ and Tc shrink: on logs of 37 correlation times their variance is 6 % smaller, and the mean of an estimate
//! lies a tenth of its standard deviation low (docs/validation.md).
//!
//! The generalised method of wavelet moments is the same machinery with another distance, Σ_i ((v_i − a_i)/s_i)² at
//! averaging times of 2^i samples (Haar wavelet variances are half the Allan variances, see `allan::wavelet`): s_i² =
//! 2 a_i²/e_i is the exact variance of each estimate under the fitted model, in place of the bootstrap of the
//! source; correlation is left out of the weights. It is taken into account afterwards: with D the Jacobian of the
//! variances, Ω the weights and V the exact covariance, the estimates have the covariance A V Aᵀ, A = (DᵀΩD)⁻¹DᵀΩ.
//! The goodness of fit, and the score by which terms are chosen, is that of the whitened cube roots less what the
//! parameters could still explain. Source: Guerrier, Skaloud, Stebler & Victoria-Feser 2013 (JASA 108), equations 7
//! and 9.

use nalgebra::{DMatrix, DVector};
use statrs::function::gamma::ln_gamma;

use super::points::{Covariance, Distance, Points};
use super::shape::{Shape, one_coefficient};
use crate::noise::{Kind, NoiseModel, Role, Term};
use crate::numerics::distribution::chi_square_sf;
use crate::numerics::linalg::cholesky;
use crate::numerics::optimize::{Look, Optimum, Problem, minimize};

/// The outcome for one model.
#[derive(Clone, Debug)]
pub(super) struct Fit {
    pub(super) shape: Shape,
    pub(super) log_parameters: Vec<f64>,
    /// Standard deviations of the log parameters; infinite where a parameter stands at the edge of what was searched.
    pub(super) log_sigmas: Vec<f64>,
    /// Whitened sum of squares; of the wavelet moments what is left of it beyond all parameters.
    pub(super) chi_square: f64,
    pub(super) points: usize,
    /// −2 ln of the density of the variances under this fit, but for a constant: by it maxima with weights of their
    /// own compare.
    surprise: f64,
}

/// Starting values of one correlation time, equally spaced in its logarithm; of each of several.
const STARTS: [usize; 2] = [6, 4];
/// Starts that are carried on from the diagonal to the full weights.
const CARRIED: usize = 4;
const REWEIGHTINGS: usize = 8;
const WHOLE_STEPS: usize = 3;

impl Fit {
    pub(super) fn model(&self) -> NoiseModel {
        self.shape.model(&self.log_parameters)
    }
    pub(super) fn dof(&self) -> f64 {
        self.points.saturating_sub(self.shape.parameters()) as f64
    }
    /// Probability of a worse fit if the model is right.
    pub(super) fn p_value(&self) -> f64 {
        if self.dof() > 0.0 { chi_square_sf(self.chi_square, self.dof()) } else { f64::NAN }
    }
    /// √(χ²/dof) where the fit is bad, else 1: by this the sigmas are widened.
    pub(super) fn inflation(&self) -> f64 {
        if self.dof() > 0.0 { (self.chi_square / self.dof()).sqrt().max(1.0) } else { 1.0 }
    }
}

/// What turns Allan variances into whitened residuals; belongs to one model.
struct Weights {
    distance: Distance,
    reference: DVector<f64>,
    /// Mean of the observed per point, where the model is right: of (χ²_e/e)^(1/3), or 1.
    mean: DVector<f64>,
    /// Lower factor of the covariance of the observed, or of its diagonal.
    factor: DMatrix<f64>,
    /// Measured over `reference`, or the cube root of that.
    observed: DVector<f64>,
    /// A third of the leverages of the points, by which ln a_i enters; zero but for cube roots at their full weights.
    lean: DVector<f64>,
}

/// What a place in the space of parameters is worth.
struct Place {
    /// Whitened residuals (first column) and their derivatives by the log parameters.
    residuals: DMatrix<f64>,
    /// Σ lean_i ln(a_i/reference_i) and its derivatives.
    lean: f64,
    lean_slope: Vec<f64>,
}

impl Place {
    fn half(&self) -> f64 {
        0.5 * self.residuals.column(0).norm_squared() + self.lean
    }
}

impl Weights {
    /// Independent points, degrees of freedom n/m − 1: good enough to start from.
    fn rough(points: &Points) -> Weights {
        let edf =
            points.factors().iter().map(|m| points.windows() * (points.samples() as f64 / *m as f64 - 1.0).max(1.0));
        let (mean, sigma): (Vec<f64>, Vec<f64>) = edf.map(cube_root_moments).unzip();
        Weights {
            distance: Distance::CubeRoots,
            reference: DVector::from_column_slice(points.variances()),
            mean: DVector::from_vec(mean),
            factor: DMatrix::from_diagonal(&DVector::from_vec(sigma)),
            observed: DVector::repeat(points.len(), 1.0),
            lean: DVector::zeros(points.len()),
        }
    }

    /// Covariance of the points for this model; None where it is not positive definite.
    fn exact(points: &Points, model: &NoiseModel) -> Option<Weights> {
        let Covariance { matrix: covariance, variances } = points.covariance(model);
        let moments = |i: usize| cube_root_moments(2.0 * variances[i] * variances[i] / covariance[(i, i)]);
        let (mean, sigma): (Vec<f64>, Vec<f64>) = (0..points.len()).map(moments).unzip();
        let scaled = DMatrix::from_fn(points.len(), points.len(), |i, j| {
            let correlation = covariance[(i, j)] / (covariance[(i, i)] * covariance[(j, j)]).sqrt();
            correlation * sigma[i] * sigma[j]
        });
        let reference = model_variances(points, model);
        Some(Weights {
            distance: Distance::CubeRoots,
            observed: DVector::from_column_slice(points.variances()).component_div(&reference).map(f64::cbrt),
            mean: DVector::from_vec(mean),
            factor: cholesky(&scaled).ok()?,
            lean: DVector::zeros(points.len()),
            reference,
        })
    }

    /// Variances, each with the weight that it has for this model.
    fn diagonal(points: &Points, model: &NoiseModel) -> Weights {
        let Covariance { matrix: covariance, variances } = points.covariance(model);
        let sigma = DVector::from_fn(points.len(), |i, _| covariance[(i, i)].sqrt() / variances[i]);
        let reference = model_variances(points, model);
        Weights {
            distance: Distance::Variances,
            observed: DVector::from_column_slice(points.variances()).component_div(&reference),
            mean: DVector::repeat(points.len(), 1.0),
            factor: DMatrix::from_diagonal(&sigma),
            lean: DVector::zeros(points.len()),
            reference,
        }
    }

    /// As the distance of these points asks, at these parameters.
    fn of(points: &Points, shape: &Shape, bounds: &[(f64, f64)], log_parameters: &[f64]) -> Option<Weights> {
        let model = shape.model(log_parameters);
        match points.distance() {
            Distance::CubeRoots => {
                let weights = Weights::exact(points, &model)?;
                let lean = weights.leverages(points, shape, bounds, log_parameters).map(|h| h / 3.0);
                Some(Weights { lean: lean.unwrap_or(weights.lean), ..weights })
            }
            Distance::Variances => Some(Weights::diagonal(points, &model)),
        }
    }

    /// Diagonal of D(DᵀC⁻¹D)⁻¹DᵀC⁻¹ = L P L⁻¹, C = L Lᵀ, P the projection on the whitened derivatives by what is not
    /// at a bound.
    fn leverages(
        &self,
        points: &Points,
        shape: &Shape,
        bounds: &[(f64, f64)],
        log_parameters: &[f64],
    ) -> Option<DVector<f64>> {
        let jacobian = jacobian(&self.look(points, shape, log_parameters).residuals, &inside(bounds, log_parameters));
        let inverse = nalgebra::Cholesky::new(jacobian.transpose() * &jacobian)?.inverse();
        let spread = &self.factor * (&jacobian * inverse * jacobian.transpose());
        let whole = self.factor.transpose().solve_upper_triangular(&spread.transpose())?;
        Some(whole.diagonal())
    }

    fn whiten(&self, x: &mut DMatrix<f64>) {
        // the factor has a positive diagonal: it comes out of a Cholesky decomposition
        self.factor.solve_lower_triangular_mut(x);
    }

    fn look(&self, points: &Points, shape: &Shape, log_parameters: &[f64]) -> Place {
        let derivatives = derivatives(points, shape, log_parameters);
        let total = derivatives.column(0).into_owned();
        let mut out = DMatrix::zeros(points.len(), derivatives.ncols());
        for i in 0..points.len() {
            let ratio = total[i] / self.reference[i];
            let (root, power) = match self.distance {
                Distance::CubeRoots => (self.mean[i] * ratio.cbrt(), 1.0 / 3.0),
                Distance::Variances => (self.mean[i] * ratio, 1.0),
            };
            out[(i, 0)] = self.observed[i] - root;
            for j in 1..derivatives.ncols() {
                out[(i, j)] = -power * root * derivatives[(i, j)] / total[i];
            }
        }
        self.whiten(&mut out);
        let over = |i: usize, x: f64| self.lean[i] * x / total[i];
        Place {
            residuals: out,
            lean: (0..points.len()).map(|i| self.lean[i] * (total[i] / self.reference[i]).ln()).sum(),
            lean_slope: (1..derivatives.ncols())
                .map(|j| (0..points.len()).map(|i| over(i, derivatives[(i, j)])).sum())
                .collect(),
        }
    }
}

/// Numbers of the parameters that are not at a bound.
fn inside(bounds: &[(f64, f64)], log_parameters: &[f64]) -> Vec<usize> {
    let off = |j: &usize| {
        let (lo, hi) = bounds[*j];
        log_parameters[*j] > lo + 1e-3 * (hi - lo) && log_parameters[*j] < hi - 1e-3 * (hi - lo)
    };
    (0..log_parameters.len()).filter(off).collect()
}

/// Whitened derivatives by these parameters.
fn jacobian(residuals: &DMatrix<f64>, inside: &[usize]) -> DMatrix<f64> {
    DMatrix::from_fn(residuals.nrows(), inside.len(), |i, j| residuals[(i, inside[j] + 1)])
}

fn model_variances(points: &Points, model: &NoiseModel) -> DVector<f64> {
    let variances = points.factors().iter().map(|m| model.allan_variance(*m, points.dt()));
    DVector::from_iterator(points.len(), variances)
}

fn term_variances(points: &Points, term: &Term) -> DVector<f64> {
    let variances = points.factors().iter().map(|m| term.allan_variance(*m, points.dt()));
    DVector::from_iterator(points.len(), variances)
}

/// Mean and standard deviation of (χ²_e/e)^(1/3).
fn cube_root_moments(edf: f64) -> (f64, f64) {
    let variance = 2.0 / (9.0 * edf);
    if edf > 200.0 || edf.is_nan() {
        return (1.0 - variance, variance.sqrt());
    }
    let half = 0.5 * edf;
    let moment = |power: f64| (ln_gamma(half + power) - ln_gamma(half) - power * half.ln()).exp();
    let mean = moment(1.0 / 3.0);
    (mean, (moment(2.0 / 3.0) - mean * mean).max(0.0).sqrt())
}

/// Allan variances of the model (first column) and their derivatives by the log parameters.
fn derivatives(points: &Points, shape: &Shape, log_parameters: &[f64]) -> DMatrix<f64> {
    const STEP: f64 = 1e-4;
    let mut out = DMatrix::zeros(points.len(), 1 + shape.parameters());
    let mut column = 1;
    for term in shape.model(log_parameters).terms {
        let variances = term_variances(points, &term);
        let mut total = out.column_mut(0);
        total += &variances;
        out.set_column(column, &(2.0 * variances));
        column += 1;
        if let Term::GaussMarkov { std_dev, correlation_time } = term {
            let at = |shift: f64| {
                let moved = correlation_time * shift.exp();
                term_variances(points, &Term::GaussMarkov { std_dev, correlation_time: moved })
            };
            out.set_column(column, &((at(STEP) - at(-STEP)) / (2.0 * STEP)));
            column += 1;
        }
    }
    out
}

/// Lower and upper bounds of the log parameters: a coefficient may be anything from nothing to several times the curve.
fn bounds(points: &Points, shape: &Shape) -> Vec<(f64, f64)> {
    let (shortest, longest) = points.correlation_times();
    let of = |(kind, role): (Kind, Role)| match (kind, role) {
        (_, Role::CorrelationTime) => (shortest.ln(), longest.ln()),
        (Kind::GaussMarkov, Role::Coefficient) => {
            let ends = [shortest, longest].map(|correlation_time| touch(points, kind, correlation_time));
            (ends[0].min(ends[1]) - 7.0, ends[0].max(ends[1]) + 2.0)
        }
        _ => {
            let touch = touch(points, kind, 1.0);
            (touch - 7.0, touch + 2.0)
        }
    };
    shape.roles().into_iter().map(of).collect()
}

/// ln of the largest coefficient with which the term stays below the curve everywhere.
fn touch(points: &Points, kind: Kind, correlation_time: f64) -> f64 {
    let term = match kind {
        Kind::GaussMarkov => Term::GaussMarkov { std_dev: 1.0, correlation_time },
        kind => one_coefficient(kind, 1.0),
    };
    let unit = term_variances(points, &term);
    let ratio = points.variances().iter().zip(unit.iter()).map(|(v, u)| v / u).fold(f64::INFINITY, f64::min);
    0.5 * ratio.ln()
}

/// Starting points: every combination of correlation times on a grid; each term at half of what touches the curve.
fn starts(points: &Points, shape: &Shape) -> Vec<Vec<f64>> {
    let (shortest, longest) = points.correlation_times();
    let several = usize::from(shape.count(Kind::GaussMarkov) > 1);
    let step = (longest / shortest).powf(1.0 / STARTS[several] as f64);
    let grid: Vec<f64> = (0..STARTS[several]).map(|i| shortest * step.powf(i as f64 + 0.5)).collect();
    let mut combinations: Vec<Vec<f64>> = vec![vec![]];
    for _ in 0..shape.count(Kind::GaussMarkov) {
        let longer = |chosen: &Vec<f64>| {
            let next = grid.iter().filter(|t| chosen.last().is_none_or(|last| *t > last));
            next.map(|t| chosen.iter().chain([t]).copied().collect()).collect::<Vec<Vec<f64>>>()
        };
        combinations = combinations.iter().flat_map(longer).collect();
    }
    let start = |times: &Vec<f64>| {
        let mut times = times.iter();
        let mut parameters = Vec::new();
        for kind in shape.kinds() {
            let time = if *kind == Kind::GaussMarkov { times.next().copied() } else { None };
            parameters.push(touch(points, *kind, time.unwrap_or(1.0)) - 0.35);
            parameters.extend(time.map(f64::ln));
        }
        parameters
    };
    combinations.iter().map(start).collect()
}

/// Minimise half the whitened sum of squares, and what leans on it, from a start, within bounds; returns parameters
/// and the minimum.
fn descend(
    points: &Points,
    shape: &Shape,
    weights: &Weights,
    bounds: &[(f64, f64)],
    start: &[f64],
    restarts: usize,
) -> Option<(Vec<f64>, f64)> {
    let look = |at: &[f64], _: &[f64], _: bool| {
        let place = weights.look(points, shape, at);
        let first = place.residuals.column(0);
        let slope = |(j, lean): (usize, &f64)| first.dot(&place.residuals.column(j + 1)) + lean;
        let slopes = vec![place.lean_slope.iter().enumerate().map(slope).collect()];
        Look { values: vec![place.half()], slopes }
    };
    let scale = |at: &[f64], _| {
        let here = weights.look(points, shape, at).residuals;
        (1..here.ncols()).map(|j| (1.0 / here.column(j).norm().clamp(1e-3, 1e6)).min(1.0)).collect()
    };
    let problem = Problem {
        look: &look,
        scale: &scale,
        f_rel: 1e-9,
        evaluations: 300,
        rounds: restarts,
        worth: 1e-4,
        worth_rel: 1e-7,
        ..Problem::default()
    };
    let Optimum { x, f, .. } = minimize(&problem, start, bounds);
    f.is_finite().then_some((x, f))
}

/// Fit a model to the points. None when there are too few points or the weights cannot be formed.
pub(super) fn fit(points: &Points, shape: &Shape) -> Option<Fit> {
    if points.len() <= shape.parameters() {
        return None;
    }
    let bounds = bounds(points, shape);
    let rough = Weights::rough(points);
    let mut found: Vec<(Vec<f64>, f64)> =
        starts(points, shape).iter().filter_map(|start| descend(points, shape, &rough, &bounds, start, 2)).collect();
    found.sort_by(|a, b| a.1.total_cmp(&b.1));
    // different starts that arrived at the same place are one
    found.dedup_by(|b, a| a.0.iter().zip(&b.0).all(|(a, b)| (a - b).abs() < 0.02));
    let fits = found.iter().take(CARRIED).filter_map(|(start, _)| reweighted(points, shape, &bounds, start));
    fits.min_by(|a, b| a.surprise.total_cmp(&b.surprise))
}

/// Alternate between weights at the parameters and parameters for the weights.
fn reweighted(points: &Points, shape: &Shape, bounds: &[(f64, f64)], start: &[f64]) -> Option<Fit> {
    let mut at = start.to_vec();
    let mut last = None;
    for round in 0..REWEIGHTINGS {
        let weights = Weights::of(points, shape, bounds, &at)?;
        let (next, _) = descend(points, shape, &weights, bounds, &at, 6)?;
        let fit = finish(points, shape, &weights, bounds, next.clone())?;
        let moved = next
            .iter()
            .zip(&at)
            .zip(&fit.log_sigmas)
            .map(|((new, old), sigma)| ((new - old) / sigma.min(1.0)).abs())
            .fold(0.0, f64::max);
        // what swings to and fro goes half the way
        let share = if round < WHOLE_STEPS { 1.0 } else { 0.5 };
        at = at.iter().zip(&next).map(|(old, new)| old + share * (new - old)).collect();
        last = Some(fit);
        if moved < 0.03 {
            break;
        }
    }
    last
}

fn finish(
    points: &Points,
    shape: &Shape,
    weights: &Weights,
    bounds: &[(f64, f64)],
    log_parameters: Vec<f64>,
) -> Option<Fit> {
    let inside = inside(bounds, &log_parameters);
    let split = |weights: &Weights| {
        let residuals = weights.look(points, shape, &log_parameters).residuals;
        let jacobian = jacobian(&residuals, &inside);
        (residuals.column(0).into_owned(), jacobian)
    };
    let (residuals, jacobian) = split(weights);
    let sum_of_squares = residuals.norm_squared();
    let inverse = nalgebra::Cholesky::new(jacobian.transpose() * &jacobian).map(|c| c.inverse());
    // wide weights make every residual small: the normal density of the cube roots, as one of the variances, has
    // their price in it
    let volume: f64 = (0..points.len()).map(|i| weights.factor[(i, i)].ln() + weights.reference[i].ln() / 3.0).sum();
    let (covariance, chi_square) = match points.distance() {
        Distance::CubeRoots => (inverse, sum_of_squares),
        Distance::Variances => {
            let model = shape.model(&log_parameters);
            let Covariance { matrix, .. } = points.covariance(&model);
            let correlation = DMatrix::from_fn(points.len(), points.len(), |i, k| {
                matrix[(i, k)] / (matrix[(i, i)] * matrix[(k, k)]).sqrt()
            });
            let covariance = inverse.map(|inverse| {
                let estimator = inverse * jacobian.transpose();
                &estimator * correlation * estimator.transpose()
            });
            let (left, tangent) = split(&Weights::exact(points, &model)?);
            let explained = if inside.is_empty() { 0.0 } else { (tangent.qr().q().transpose() * &left).norm_squared() };
            (covariance, (left.norm_squared() - explained).max(0.0))
        }
    };
    let mut log_sigmas = vec![f64::INFINITY; log_parameters.len()];
    if let Some(covariance) = covariance {
        for (j, index) in inside.iter().enumerate() {
            log_sigmas[*index] = covariance[(j, j)].sqrt();
        }
    }
    let surprise = match points.distance() {
        Distance::CubeRoots => chi_square + 2.0 * volume,
        Distance::Variances => chi_square,
    };
    Some(Fit { shape: shape.clone(), log_parameters, log_sigmas, chi_square, points: points.len(), surprise })
}

/// The smallest sum of squares when a term of this coefficient is added to the model and all other parameters stay
/// but the white density, which is fitted again: how well the log tolerates the term.
pub(super) fn tolerated(points: &Points, fit: &Fit, kind: Kind, log_coefficient: f64) -> Option<f64> {
    let shape = fit.shape.with(kind);
    let mut fitted = fit.log_parameters.iter().copied();
    let mut start = Vec::new();
    let mut added = false;
    for (k, role) in shape.roles() {
        let here = k == kind && role == Role::Coefficient && !added;
        added |= here;
        start.push(if here { log_coefficient } else { fitted.next()? });
    }
    let free = |k: Kind| if k == Kind::White { 1.0 } else { 1e-9 };
    let bounds: Vec<(f64, f64)> =
        shape.roles().iter().zip(&start).map(|((k, _), p)| (p - free(*k), p + free(*k))).collect();
    let weights = Weights::exact(points, &shape.model(&start))?;
    descend(points, &shape, &weights, &bounds, &start, 6).map(|(_, half)| 2.0 * half)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::allan::{self, Deviation, TauGrid};
    use crate::numerics::random::{StreamId, stream};

    /// A white density two standard deviations off the best fit raises the whitened sum of squares by 4, and what no
    /// parameter could explain by nothing, to second order: 1.6 % more density changes expected squares by 3 %, and
    /// the misfit of 13 points by about that share of itself.
    #[test]
    fn misfit_is_what_no_parameter_could_explain() {
        let shape = Shape::new(vec![Kind::White, Kind::GaussMarkov]);
        let terms = [Term::White { density: 0.0562 }, Term::GaussMarkov { std_dev: 0.028, correlation_time: 194.0 }];
        let mut rate = vec![0.0; 8192];
        for (i, term) in terms.iter().enumerate() {
            let mut part = vec![0.0; rate.len()];
            term.sample_path(1.0, stream(41, StreamId { run: 0, axis: 0, term: i as u32 })).fill(&mut part);
            rate.iter_mut().zip(&part).for_each(|(sum, x)| *sum += x);
        }
        let mut curve = allan::curve(&rate, 1.0, Deviation::Oadev, TauGrid::Octave).unwrap();
        // the same points for both
        curve.points.retain(|point| point.m as usize <= rate.len() / 3);
        let best = fit(&Points::of_curve(&curve, Distance::CubeRoots), &shape).unwrap();
        let points = Points::of_curve(&curve, Distance::Variances);
        let mut moved = best.log_parameters.clone();
        moved[0] += 2.0 * best.log_sigmas[0];
        let model = shape.model(&moved);
        let whitened = Weights::exact(&points, &model).unwrap().look(&points, &shape, &moved).residuals;
        let rise = whitened.column(0).norm_squared() - best.chi_square;
        assert!((3.0..5.0).contains(&rise), "{rise}");
        let weights = Weights::diagonal(&points, &model);
        let found = finish(&points, &shape, &weights, &bounds(&points, &shape), moved).unwrap();
        assert!((found.chi_square - best.chi_square).abs() < 0.5, "{} and {}", found.chi_square, best.chi_square);
    }

    /// Leverages are the diagonal of a projection: they sum to the number of parameters. What is minimised, and its
    /// slopes, agree by differences.
    #[test]
    fn leverages_sum_to_the_parameters_and_slopes_are_those_of_the_value() {
        let shape = Shape::new(vec![Kind::White, Kind::GaussMarkov]);
        let mut rate = vec![0.0; 4000];
        let terms = [Term::White { density: 0.0562 }, Term::GaussMarkov { std_dev: 0.028, correlation_time: 100.0 }];
        for (i, term) in terms.iter().enumerate() {
            let mut part = vec![0.0; rate.len()];
            term.sample_path(1.0, stream(42, StreamId { run: 0, axis: 0, term: i as u32 })).fill(&mut part);
            rate.iter_mut().zip(&part).for_each(|(sum, x)| *sum += x);
        }
        let curve = allan::curve(&rate, 1.0, Deviation::Oadev, TauGrid::Log(5)).unwrap();
        let points = Points::of_curve(&curve, Distance::CubeRoots);
        let (bounds, at) = (bounds(&points, &shape), [0.06_f64.ln(), 0.03_f64.ln(), 90_f64.ln()]);
        let weights = Weights::of(&points, &shape, &bounds, &at).unwrap();
        assert!((3.0 * weights.lean.sum() - 3.0).abs() < 1e-9, "{}", weights.lean.sum());
        // parameters at a bound have no part in them
        let mut edge = at;
        edge[2] = bounds[2].1;
        let fewer = Weights::of(&points, &shape, &bounds, &edge).unwrap();
        assert!((3.0 * fewer.lean.sum() - 2.0).abs() < 1e-9, "{}", fewer.lean.sum());
        let place = weights.look(&points, &shape, &at);
        assert!(place.lean.abs() < 1e-12, "the reference is the model itself");
        for j in 0..3 {
            let value = |by: f64| {
                let mut moved = at;
                moved[j] += by;
                weights.look(&points, &shape, &moved).half()
            };
            let slope = place.residuals.column(0).dot(&place.residuals.column(j + 1)) + place.lean_slope[j];
            // differences over 2e-4 of values of about 10: 1e-6 by the third derivative, the derivative by Tc is
            // itself one over 2e-4
            let found = (value(1e-4) - value(-1e-4)) / 2e-4;
            assert!((found - slope).abs() < 1e-5 * (1.0 + slope.abs()), "{j}: {found} {slope}");
        }
    }
}
