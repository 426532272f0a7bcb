//! The measured Allan points and the covariance between them for any mixture.
//!
//! The covariance is a quadratic form in the squared coefficients. Its parts, one matrix per pair of unit processes, cost
//! millions of evaluations each and are kept: a fit then changes coefficients at no cost. A Gauss-Markov process between two
//! tabulated correlation times counts as their mixture, for the weights only (the Allan variances are always exact).

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use nalgebra::DMatrix;

use super::shape::one_coefficient;
use crate::allan::{AllanCurve, edf};
use crate::noise::{Kind, NoiseModel, Term};

/// Correlation times shorter than this many samples are a matter of the sensor's bandwidth, not of drift.
const SHORTEST_CORRELATION: f64 = 10.0;
/// Correlation times are searched up to this many lengths of the log; further out a Gauss-Markov process is a random walk.
const LONGEST_CORRELATION: f64 = 3.0;
/// Ratio of tabulated correlation times.
const NODE_RATIO: f64 = 2.0;

/// In what a fit makes the distance between measured and modelled variances small.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Distance {
    /// Their cube roots, nearly normal, with their whole covariance.
    CubeRoots,
    /// The variances themselves, each weighted by the inverse of its own variance: the generalised method of wavelet moments.
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
    factors: Vec<u64>,
    variances: Vec<f64>,
    /// Length of the log behind them.
    samples: usize,
    /// s.
    dt: f64,
    distance: Distance,
    /// Mixed second derivatives of the covariance by the squared coefficients of two unit processes; row 0 is the whole table.
    parts: Mutex<Parts>,
}

type Parts = BTreeMap<(Unit, Unit), Arc<DMatrix<f64>>>;

/// A process of which the coefficient is such that it just touches the measured curve from below.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Unit {
    /// Any kind but Gauss-Markov.
    Plain(Kind),
    /// Gauss-Markov with the correlation time of this node.
    Node(u32),
}

/// What the weights need.
pub(super) struct Covariance {
    /// Of the Allan variances, unit⁴.
    pub(super) matrix: DMatrix<f64>,
    /// Allan variances of the tabulated mixture it belongs to.
    pub(super) variances: Vec<f64>,
}

impl Points {
    /// Points at averaging times up to a third of the log (three averages and more).
    pub(super) fn of_curve(curve: &AllanCurve, distance: Distance) -> Points {
        let used = curve.points.iter().filter(|p| p.m as usize <= curve.samples / 3 && p.deviation > 0.0);
        let (factors, variances) = used.map(|p| (p.m, p.deviation * p.deviation)).unzip();
        let parts = Mutex::new(BTreeMap::new());
        let table = Table { factors, variances, samples: curve.samples, dt: curve.dt, distance, parts };
        Points { table: Arc::new(table), skip: 0 }
    }
    /// The points at and above an averaging factor.
    pub(super) fn starting_at(&self, first: u64) -> Points {
        let skip = self.table.factors.iter().take_while(|m| **m < first).count();
        Points { table: Arc::clone(&self.table), skip }
    }
    pub(super) fn factors(&self) -> &[u64] {
        &self.table.factors[self.skip..]
    }
    pub(super) fn variances(&self) -> &[f64] {
        &self.table.variances[self.skip..]
    }
    pub(super) fn len(&self) -> usize {
        self.factors().len()
    }
    pub(super) fn samples(&self) -> usize {
        self.table.samples
    }
    pub(super) fn dt(&self) -> f64 {
        self.table.dt
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
        let table = &self.table;
        let mut slope = 0.0;
        let mut weights: BTreeMap<Unit, f64> = BTreeMap::new();
        for term in &model.terms {
            match *term {
                Term::RateRamp { slope: s } => slope += s,
                Term::GaussMarkov { std_dev, correlation_time } => {
                    let place = (correlation_time / (SHORTEST_CORRELATION * table.dt)).ln().max(0.0) / NODE_RATIO.ln();
                    let (node, above) = (place.floor() as u32, place.fract());
                    for (node, share) in [(node, 1.0 - above), (node + 1, above)] {
                        let unit = Unit::Node(node);
                        let size = table.square(&table.unit_term(unit));
                        *weights.entry(unit).or_insert(0.0) += share * std_dev * std_dev / size;
                    }
                }
                other => {
                    let unit = Unit::Plain(other.kind());
                    *weights.entry(unit).or_insert(0.0) += table.square(&other) / table.square(&table.unit_term(unit));
                }
            }
        }
        weights.retain(|_, weight| *weight > 0.0);
        let size = table.factors.len();
        let mut matrix = DMatrix::zeros(size, size);
        let units: Vec<(Unit, f64)> = weights.into_iter().collect();
        for (i, (a, weight_a)) in units.iter().enumerate() {
            for (b, weight_b) in &units[..=i] {
                matrix += (weight_a * weight_b) * &*table.part(*b, *a);
            }
            if slope != 0.0 {
                let ramp = Unit::Plain(Kind::RateRamp);
                matrix += (weight_a * slope * slope / table.square(&table.unit_term(ramp))) * &*table.part(*a, ramp);
            }
        }
        let mixture: Vec<(Term, f64)> = units.iter().map(|(unit, weight)| (table.unit_term(*unit), *weight)).collect();
        let variance = |m: &u64| {
            let noise: f64 = mixture.iter().map(|(term, weight)| weight * term.allan_variance(*m, table.dt)).sum();
            noise + Term::RateRamp { slope }.allan_variance(*m, table.dt)
        };
        let count = self.len();
        Covariance {
            matrix: matrix.view((self.skip, self.skip), (count, count)).into_owned(),
            variances: self.factors().iter().map(variance).collect(),
        }
    }
}

impl Table {
    /// The squared coefficient.
    fn square(&self, term: &Term) -> f64 {
        let coefficient = match *term {
            Term::Quantization { coefficient } | Term::BiasInstability { coefficient } => coefficient,
            Term::White { density } | Term::MovingAverage { density, .. } | Term::RateRandomWalk { density } => density,
            Term::GaussMarkov { std_dev, .. } | Term::Oscillation { std_dev, .. } => std_dev,
            Term::RateRamp { slope } => slope,
        };
        coefficient * coefficient
    }

    fn unit_term(&self, unit: Unit) -> Term {
        let one = match unit {
            Unit::Plain(kind) => one_coefficient(kind, 1.0),
            Unit::Node(node) => {
                let correlation_time = SHORTEST_CORRELATION * self.dt * NODE_RATIO.powi(node as i32);
                Term::GaussMarkov { std_dev: 1.0, correlation_time }
            }
        };
        let ratio = |(m, v): (&u64, &f64)| v / one.allan_variance(*m, self.dt);
        let touch = self.factors.iter().zip(&self.variances).map(ratio).fold(f64::INFINITY, f64::min).sqrt();
        match one {
            Term::GaussMarkov { correlation_time, .. } => Term::GaussMarkov { std_dev: touch, correlation_time },
            other => one_coefficient(other.kind(), touch),
        }
    }

    /// The part of the covariance that two unit processes cause together (a ≤ b): by polarisation of the quadratic form.
    fn part(&self, a: Unit, b: Unit) -> Arc<DMatrix<f64>> {
        // a thread that panicked while it held the lock cannot have left a half-made entry
        let cached = self.parts.lock().unwrap_or_else(PoisonError::into_inner).get(&(a, b)).cloned();
        if let Some(part) = cached {
            return part;
        }
        let of = |units: &[Unit]| {
            let model = NoiseModel { terms: units.iter().map(|u| self.unit_term(*u)).collect() };
            edf::covariance(&self.factors, self.samples, self.dt, &model)
        };
        let part = match (a, b) {
            _ if a == b => of(&[a]),
            // a ramp is no noise: alone it has no covariance
            (_, Unit::Plain(Kind::RateRamp)) => of(&[a, b]) - &*self.part(a, a),
            _ => of(&[a, b]) - &*self.part(a, a) - &*self.part(b, b),
        };
        let part = Arc::new(part);
        self.parts.lock().unwrap_or_else(PoisonError::into_inner).insert((a, b), Arc::clone(&part));
        part
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::allan::{self, Deviation, TauGrid};

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
}
