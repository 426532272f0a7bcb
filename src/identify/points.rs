//! The measured Allan points and the covariance between them for any mixture.
//!
//! The covariance is a quadratic form in the squared coefficients. Its parts, one per pair of unit processes, depend
//! on the averaging times and the length of the log only and are worked out once, for all axes of a log together: a
//! fit then changes coefficients at no cost. A Gauss-Markov process between two tabulated correlation times counts
//! as their mixture, for the weights only (the Allan variances are always exact).

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError, Weak};

use nalgebra::DMatrix;

use super::shape::one_coefficient;
use crate::allan::AllanCurve;
use crate::allan::covariance::Form;
use crate::noise::{Kind, NoiseModel, Term};

/// Correlation times shorter than this many samples are a matter of the sensor's bandwidth, not of drift.
const SHORTEST_CORRELATION: f64 = 10.0;
/// Correlation times are searched up to this many lengths of the log; further out a Gauss-Markov process is a random
/// walk.
const LONGEST_CORRELATION: f64 = 3.0;
/// … and, where short averaging times are left out of a short log, up to this many times the shortest at least.
const LEAST_RANGE: f64 = 128.0;
/// Ratio of tabulated correlation times.
const NODE_RATIO: f64 = 2.0;

/// In what a fit makes the distance between measured and modelled variances small.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Distance {
    /// Their cube roots, nearly normal, with their whole covariance.
    CubeRoots,
    /// The variances themselves, each weighted by the inverse of its own variance: the generalised method of wavelet
    /// moments.
    Variances,
}

/// Allan variances at ascending averaging factors, from a shortest one on.
#[derive(Clone, Debug)]
pub(super) struct Points {
    table: Arc<Table>,
    skip: usize,
}

#[derive(Debug)]
struct Table {
    variances: Vec<f64>,
    /// Windows whose variances were averaged: so much smaller is their covariance.
    windows: f64,
    distance: Distance,
    geometry: Arc<Geometry>,
}

/// What does not depend on the values of a log.
#[derive(Debug)]
struct Geometry {
    factors: Vec<u64>,
    /// Length of the log.
    samples: usize,
    /// s.
    dt: f64,
    /// The covariance by the squared coefficients of [`processes`].
    form: Form,
}

/// Geometries in use: axes of one log that are worked on at the same time share theirs. What is found does not
/// depend on it.
static IN_USE: Mutex<Vec<Weak<Geometry>>> = Mutex::new(Vec::new());

/// Kinds without a time that an Allan curve shows, in the order of the processes; Gauss-Markov processes of
/// tabulated times follow.
const PLAIN: [Kind; 4] = [Kind::Quantization, Kind::White, Kind::BiasInstability, Kind::RateRandomWalk];

/// What the weights need.
pub(super) struct Covariance {
    /// Of the Allan variances, unit⁴.
    pub(super) matrix: DMatrix<f64>,
    /// Allan variances of the tabulated mixture it belongs to.
    pub(super) variances: Vec<f64>,
}

impl Points {
    /// Points at averaging times up to half of the log, of wavelet variances up to a third.
    pub(super) fn of_curve(curve: &AllanCurve, distance: Distance) -> Points {
        let parts = match distance {
            Distance::CubeRoots => 2,
            Distance::Variances => 3,
        };
        let used = curve.points.iter().filter(|p| p.m as usize <= curve.samples / parts && p.deviation > 0.0);
        let (factors, variances) = used.map(|p| (p.m, p.deviation * p.deviation)).unzip();
        let geometry = Geometry::shared(factors, curve.samples, curve.dt);
        Points { table: Arc::new(Table { variances, windows: curve.windows as f64, distance, geometry }), skip: 0 }
    }
    /// The points at and above an averaging factor.
    pub(super) fn starting_at(&self, first: u64) -> Points {
        let skip = self.table.geometry.factors.iter().take_while(|m| **m < first).count();
        Points { table: Arc::clone(&self.table), skip }
    }
    pub(super) fn factors(&self) -> &[u64] {
        &self.table.geometry.factors[self.skip..]
    }
    pub(super) fn variances(&self) -> &[f64] {
        &self.table.variances[self.skip..]
    }
    pub(super) fn len(&self) -> usize {
        self.factors().len()
    }
    /// Of one window.
    pub(super) fn samples(&self) -> usize {
        self.table.geometry.samples
    }
    pub(super) fn windows(&self) -> f64 {
        self.table.windows
    }
    pub(super) fn dt(&self) -> f64 {
        self.table.geometry.dt
    }
    pub(super) fn distance(&self) -> Distance {
        self.table.distance
    }
    pub(super) fn span_s(&self) -> f64 {
        self.samples() as f64 * self.dt()
    }
    pub(super) fn first_tau_s(&self) -> f64 {
        self.factors().first().map_or(f64::NAN, |m| *m as f64 * self.dt())
    }
    /// Range of correlation times that is searched, s.
    pub(super) fn correlation_times(&self) -> (f64, f64) {
        let shortest = (SHORTEST_CORRELATION * self.dt()).max(2.0 * self.first_tau_s());
        (shortest, (LONGEST_CORRELATION * self.span_s()).max(4.0 * shortest))
    }

    /// Covariance of the points for this mixture.
    pub(super) fn covariance(&self, model: &NoiseModel) -> Covariance {
        let geometry = &self.table.geometry;
        let mut slope = 0.0;
        let mut weights: BTreeMap<usize, f64> = BTreeMap::new();
        let mut add = |process: usize, weight: f64| *weights.entry(process).or_insert(0.0) += weight;
        for term in &model.terms {
            match *term {
                Term::RateRamp { slope: s } => slope += s,
                Term::GaussMarkov { std_dev, correlation_time } => {
                    let (node, above) = geometry.node(correlation_time);
                    add(PLAIN.len() + node, (1.0 - above) * std_dev * std_dev);
                    add(PLAIN.len() + node + 1, above * std_dev * std_dev);
                }
                Term::Quantization { coefficient } | Term::BiasInstability { coefficient } => {
                    add(plain(term.kind()), coefficient * coefficient);
                }
                Term::White { density } | Term::RateRandomWalk { density } => {
                    add(plain(term.kind()), density * density)
                }
                // averages of the log do not show these apart from white noise: no fit to its Allan curve has them
                Term::MovingAverage { .. } | Term::BandLimit { .. } | Term::Oscillation { .. } => {}
            }
        }
        let weights: Vec<(usize, f64)> = weights.into_iter().filter(|(_, weight)| *weight > 0.0).collect();
        let processes = processes(geometry.samples, geometry.dt);
        let matrix = geometry.form.covariance(&weights, slope) / self.table.windows;
        let variance = |m: &u64| {
            let unit = |process: usize| processes[process].allan_variance(*m, geometry.dt);
            let noise: f64 = weights.iter().map(|(process, weight)| weight * unit(*process)).sum();
            noise + Term::RateRamp { slope }.allan_variance(*m, geometry.dt)
        };
        let count = self.len();
        Covariance {
            matrix: matrix.view((self.skip, self.skip), (count, count)).into_owned(),
            variances: self.factors().iter().map(variance).collect(),
        }
    }
}

/// The number of the process of a kind of [`PLAIN`].
fn plain(kind: Kind) -> usize {
    PLAIN.iter().position(|own| *own == kind).unwrap_or(PLAIN.len())
}

impl Geometry {
    fn shared(factors: Vec<u64>, samples: usize, dt: f64) -> Arc<Geometry> {
        // a thread that panicked while it held the lock cannot have left a half-made entry
        let mut in_use = IN_USE.lock().unwrap_or_else(PoisonError::into_inner);
        in_use.retain(|geometry| geometry.strong_count() > 0);
        let same = |own: &Arc<Geometry>| own.factors == factors && own.samples == samples && own.dt == dt;
        if let Some(found) = in_use.iter().filter_map(Weak::upgrade).find(same) {
            return found;
        }
        let geometry =
            Arc::new(Geometry { form: Form::new(&factors, samples, dt, processes(samples, dt)), factors, samples, dt });
        in_use.push(Arc::downgrade(&geometry));
        geometry
    }

    /// The tabulated correlation time at or below this one, and how far it is to the next.
    fn node(&self, correlation_time: f64) -> (usize, f64) {
        let place = (correlation_time / (SHORTEST_CORRELATION * self.dt)).ln().max(0.0) / NODE_RATIO.ln();
        let place = place.min(last_node(self.samples) as f64);
        (place.floor() as usize, place.fract())
    }
}

/// The number of the last tabulated correlation time but one: beyond what is searched.
fn last_node(samples: usize) -> usize {
    let longest = LONGEST_CORRELATION * samples as f64 / SHORTEST_CORRELATION;
    (longest.max(LEAST_RANGE).ln() / NODE_RATIO.ln()).ceil() as usize
}

/// Unit processes: those of [`PLAIN`], then Gauss-Markov of the tabulated correlation times, all of coefficient one.
fn processes(samples: usize, dt: f64) -> Vec<Term> {
    let node = |node: usize| Term::GaussMarkov {
        std_dev: 1.0,
        correlation_time: SHORTEST_CORRELATION * dt * NODE_RATIO.powi(node as i32),
    };
    PLAIN.iter().map(|kind| one_coefficient(*kind, 1.0)).chain((0..=last_node(samples) + 1).map(node)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rayon::prelude::*;

    use crate::allan::{self, Deviation, TauGrid, edf};

    /// The table against the direct computation, to its quadrature error where every correlation time is a node, and to
    /// the few percent of the interpolation where none is.
    #[test]
    fn tabulated_covariance_equals_the_direct_one() {
        let rate: Vec<f64> = (0..3000).map(|k| f64::from(k * 7919 % 1000) / 1000.0).collect();
        let dt = 0.5;
        let curve = allan::curve(&rate, dt, Deviation::Oadev, TauGrid::Log(3)).unwrap();
        let points = Points::of_curve(&curve, Distance::CubeRoots).starting_at(2);
        let model = |factor: f64| NoiseModel {
            terms: vec![
                Term::Quantization { coefficient: 0.1 },
                Term::White { density: 0.3 },
                Term::BiasInstability { coefficient: 0.02 },
                Term::GaussMarkov { std_dev: 0.05, correlation_time: factor * 5.0 * NODE_RATIO.powi(4) },
                Term::GaussMarkov { std_dev: 0.03, correlation_time: factor * 5.0 * NODE_RATIO.powi(8) },
                Term::RateRandomWalk { density: 0.002 },
                Term::RateRamp { slope: -1e-4 },
            ],
        };
        for (factor, tolerance) in [(1.0, 1e-8), (NODE_RATIO.sqrt(), 0.04)] {
            let found = points.covariance(&model(factor));
            let direct = edf::covariance(points.factors(), rate.len(), dt, &model(factor));
            for i in 0..points.len() {
                let variance = model(factor).allan_variance(points.factors()[i], dt);
                assert!((found.variances[i] / variance - 1.0).abs() < tolerance, "{i}");
                for j in 0..points.len() {
                    let scale = (direct[(i, i)] * direct[(j, j)]).sqrt();
                    let error = (found.matrix[(i, j)] - direct[(i, j)]).abs() / scale;
                    assert!(error < tolerance, "factor {factor}, ({i}, {j}): {error}");
                }
            }
        }
    }

    /// More axes than threads, all of one geometry, each asking from within the work of another: none waits for
    /// ever, all find what one alone does.
    #[test]
    fn axes_share_the_work() {
        let rate: Vec<f64> = (0..2000).map(|k| f64::from(k * 7919 % 1000) / 1000.0).collect();
        let curve = allan::curve(&rate, 0.5, Deviation::Oadev, TauGrid::Log(3)).unwrap();
        let model = NoiseModel { terms: vec![Term::White { density: 0.3 }, Term::RateRandomWalk { density: 0.01 }] };
        let matrix = |_: usize| Points::of_curve(&curve, Distance::CubeRoots).covariance(&model).matrix;
        let alone = matrix(0);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap();
        for _ in 0..5 {
            let all: Vec<DMatrix<f64>> = pool.install(|| (0..8).into_par_iter().map(matrix).collect());
            assert!(all.iter().all(|matrix| *matrix == alone));
        }
    }
}
