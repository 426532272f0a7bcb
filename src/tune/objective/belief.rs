//! What the identified intervals say of a sensor: the law from which sensors are drawn.

use nalgebra::{DMatrix, DVector};

use super::{ObjectiveError, Problem};
use crate::numerics::linalg::cholesky;
use crate::numerics::optimize::covariance;
use crate::numerics::random::{StreamId, fill_normal, stream};
use crate::tune::parameters::{Group, Prior};

/// Frequencies per decade at which the information is summed.
const PER_DECADE: f64 = 40.0;
/// Step of numerical derivatives by a logarithm.
const STEP: f64 = 1e-4;
/// Lowest frequency, Hz, where the length of the log is not known.
const LOWEST_HZ: f64 = 1e-5;

/// Stream addresses of the drawn sensors; no other use has these.
const DRAW: u32 = 0x20_0000;

/// The logarithms of the free parameters of a group: normal, with the intervals as middle 95 %.
pub(super) struct Belief {
    /// Mean less the identified value.
    offset: DVector<f64>,
    pub(super) std_devs: DVector<f64>,
    /// Lower factor of the covariance.
    factor: DMatrix<f64>,
    /// Whether the errors of the estimates are taken as correlated.
    pub(super) correlated: bool,
}

impl Belief {
    /// Errors: a parameter that moves and has no interval.
    pub(super) fn new(problem: &Problem<'_>, group: &Group) -> Result<Belief, ObjectiveError> {
        let space = problem.space;
        let unknown = |i: &usize| !space.parameters[*i].held && space.parameters[*i].prior().is_none();
        let missing: Vec<String> = (0..space.parameters.len()).filter(unknown).map(|i| space.name(i)).collect();
        let priors: Vec<Prior> = group.free.iter().filter_map(|&i| space.parameters[i].prior()).collect();
        if !missing.is_empty() || priors.len() != group.free.len() {
            return Err(ObjectiveError::NoIntervals { names: missing.join(", ") });
        }
        let n = priors.len();
        let mut correlation = DMatrix::identity(n, n);
        let source = space.params().source.as_ref();
        let by_likelihood = source.and_then(|s| s.method.as_deref()) == Some("likelihood");
        let mut correlated = false;
        for (numbers, known) in
            group.axes.iter().filter(|_| by_likelihood).filter_map(|&axis| correlations(problem, axis))
        {
            let place = |k: usize| numbers.iter().position(|&number| number == group.free[k]);
            for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))).filter(|(i, j)| i != j) {
                if let (Some(p), Some(q)) = (place(i), place(j)) {
                    correlation[(i, j)] = known[(p, q)];
                    correlated = true;
                }
            }
        }
        let covariance = DMatrix::from_fn(n, n, |i, j| correlation[(i, j)] * priors[i].std_dev * priors[j].std_dev);
        let offset = |(prior, &i): (&Prior, &usize)| prior.mean - space.parameters[i].log();
        Ok(Belief {
            offset: DVector::from_iterator(n, priors.iter().zip(&group.free).map(offset)),
            std_devs: DVector::from_iterator(n, priors.iter().map(|prior| prior.std_dev)),
            factor: cholesky(&covariance).map_err(problem.linalg(group))?,
            correlated,
        })
    }

    /// Shifts of the logarithms from the identified ones of sensor number `sensor` of a set.
    pub(super) fn draw(&self, seed: u64, axis: usize, set: u32, sensor: u64) -> Vec<f64> {
        let mut z = DVector::zeros(self.std_devs.len());
        let address = StreamId { run: sensor, axis: axis as u32, term: DRAW + set };
        fill_normal(&mut stream(seed, address), z.as_mut_slice());
        (&self.offset + &self.factor * z).as_slice().to_vec()
    }

    /// Covariance times a gradient: the direction in which what has this gradient is known least.
    pub(super) fn least_known(&self, gradient: &DVector<f64>) -> DVector<f64> {
        &self.factor * (self.factor.transpose() * gradient)
    }

    /// Standard deviation of what has this gradient by the logarithms.
    pub(super) fn std_dev_of(&self, gradient: &DVector<f64>) -> f64 {
        (self.factor.transpose() * gradient).norm()
    }

    /// Distance from the identified parameters in standard deviations (Mahalanobis).
    pub(super) fn distance(&self, shifts: &DVector<f64>) -> f64 {
        self.factor.solve_lower_triangular(shifts).map_or(f64::INFINITY, |z| z.norm())
    }
}

/// Correlations of maximum-likelihood estimates of the parameters of an axis from a log at rest, and the numbers of
/// these parameters: the inverse of Whittle's information I_ij ∝ ∫ ∂_i ln S ∂_j ln S df from 1/span to half the
/// sample rate. `None` where the log would not tell them apart.
fn correlations(problem: &Problem<'_>, axis: usize) -> Option<(Vec<usize>, DMatrix<f64>)> {
    let space = problem.space;
    let of_axis = |i: &usize| space.parameters[*i].axis == Some(axis);
    let numbers: Vec<usize> = (0..space.parameters.len()).filter(of_axis).collect();
    let dt = problem.dt();
    let span = space.params().source.as_ref().and_then(|source| source.span_s);
    let (lowest, highest) = (span.map_or(LOWEST_HZ, |span| 1.0 / span), 0.5 / dt);
    let count = ((highest / lowest).log10() * PER_DECADE).ceil().max(1.0) as usize;
    let frequency = |k: usize| lowest * (highest / lowest).powf((k as f64 + 0.5) / count as f64);
    let spectrum = |number: usize, shift: f64| -> Vec<f64> {
        let mut shifts = vec![0.0; space.parameters.len()];
        shifts[number] = shift;
        let noise = space.shifted(&shifts).0.axes[axis].noise();
        (0..count).map(|k| noise.psd(frequency(k), dt).ln()).collect()
    };
    let derivatives: Vec<Vec<f64>> = numbers
        .iter()
        .map(|&number| {
            let (above, below) = (spectrum(number, STEP), spectrum(number, -STEP));
            above.iter().zip(&below).map(|(a, b)| (a - b) / (2.0 * STEP)).collect()
        })
        .collect();
    let sum = |a: &[f64], b: &[f64]| (0..count).map(|k| frequency(k) * a[k] * b[k]).sum::<f64>();
    let n = numbers.len();
    let information = DMatrix::from_fn(n, n, |i, j| sum(&derivatives[i], &derivatives[j]));
    let inverse = covariance(&information)?;
    Some((numbers, DMatrix::from_fn(n, n, |i, j| inverse[(i, j)] / (inverse[(i, i)] * inverse[(j, j)]).sqrt())))
}
