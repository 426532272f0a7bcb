//! What it costs when a filter takes the drift of a sensor for a random walk, and which walk costs least.

use nalgebra::{DMatrix, DVector};

use crate::filter::gains::GainSequence;
use crate::filter::mismatch::{ExpectedError, expect, expect_settled};
use crate::filter::{Cycle, Judge, Kalman};
use crate::model::{DRIFT, LinearModel, Named, Output};
use crate::noise::Term;
use crate::numerics::optimize::lowest;
use crate::numerics::riccati::dare_doubling;
use crate::units::Quantity;

/// How long the start is followed, s.
const START: f64 = 60.0;
/// Points over which the least price is looked for before it is bracketed: two neighbours are less than a factor of
/// three apart.
const COARSE: usize = 12;
/// K is looked for to this share of the bracket, where the price is flat.
const WIDTH: f64 = 4e-3;

/// A filter that integrates a sensor and is aided; SI.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AidedFilter {
    /// s from one prediction to the next.
    pub step: f64,
    /// What is measured: 1 the integral of the sensor (an angle, a velocity), 2 the integral of that (a position).
    pub integrals: usize,
    /// Of one measurement of it.
    pub aid_std_dev: f64,
    /// Measurements per second; rounded to whole steps.
    pub aid_rate_hz: f64,
    /// Of the constant bias at the start.
    pub bias_std_dev: f64,
}

/// A sensor as the filter adds it up; SI.
#[derive(Clone, Debug, PartialEq)]
pub struct SensorDrift {
    pub quantity: Quantity,
    /// N.
    pub white: f64,
    /// Gauss-Markov processes (σ, Tc).
    pub processes: Vec<[f64; 2]>,
    /// K of a walk in the drift itself.
    pub walk: f64,
}

/// Error of the estimated drift with a walk, over the least possible error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WalkPrice {
    /// In steady state, root mean square.
    pub settled: f64,
    /// The largest ratio after any measurement of the first minute.
    pub first_minute: f64,
    /// E[e²/P] in steady state: 1 when the claimed sigma is the real one.
    pub nees: f64,
}

impl WalkPrice {
    /// The one number that is made least.
    pub fn worst(&self) -> f64 {
        self.settled.max(self.first_minute)
    }
}

/// A filter with a walk in place of the true drift, beside the right filter.
#[derive(Clone, Debug, PartialEq)]
pub struct WalkTrial {
    filter: AidedFilter,
    sensor: SensorDrift,
    truth: LinearModel,
    /// The states of the truth that stay uncertain.
    kept: Vec<usize>,
    /// Variance of the drift estimate of the right filter: settled, and after every measurement of the first minute.
    least_settled: f64,
    least_start: Vec<f64>,
}

impl WalkTrial {
    /// The right filter. `None` where it does not settle (no drift), or a number is out of range.
    pub fn new(sensor: &SensorDrift, filter: &AidedFilter) -> Option<WalkTrial> {
        let truth = model(sensor, filter, &sensor.processes, sensor.walk, filter.bias_std_dev);
        truth.check().ok()?;
        let row = truth.drift_row();
        // a bias that nothing drives is learnt for good
        let kept: Vec<usize> =
            (0..truth.states.len()).filter(|&i| i != filter.integrals || sensor.walk > 0.0).collect();
        if kept.len() == filter.integrals {
            return None;
        }
        let right = settled(&truth.part(&kept))?;
        let mut best = Kalman::new(&right);
        best.update(0, 0.0, None);
        let of = |row: &DMatrix<f64>, p: &DMatrix<f64>| (row * p * row.transpose())[(0, 0)];
        let least_settled = of(&row.select_columns(&kept), &best.p);
        let mut best = Kalman::new(&truth);
        let mut least_start = Vec::new();
        for step in 0..=(START / truth.dt).floor() as u64 {
            if step > 0 {
                best.predict();
            }
            best.update(0, 0.0, None);
            least_start.push(of(&row, &best.p));
        }
        let fine = least_start.iter().chain([&least_settled]).all(|v| *v > 0.0 && v.is_finite());
        let (filter, sensor) = (*filter, sensor.clone());
        fine.then_some(WalkTrial { filter, sensor, truth, kept, least_settled, least_start })
    }

    /// The price of the walk `k` (unit/s/√Hz), exactly, from the covariances of both filters in the true sensor's
    /// errors. The filter starts with the spread of bias and drift together. `None` where it does not settle.
    pub fn price(&self, k: f64) -> Option<WalkPrice> {
        let spread = self.sensor.processes.iter().fold(self.filter.bias_std_dev, |sum, [sigma, _]| sum.hypot(*sigma));
        let simple = model(&self.sensor, &self.filter, &[], k, spread);
        let judge = |kept: &[usize]| Judge {
            components: vec![Named { name: DRIFT.into(), unit: self.sensor.quantity.si_unit().into() }],
            of_truth: self.truth.drift_row().select_columns(kept),
            of_estimate: simple.drift_row(),
        };
        let cycle = Cycle::new(&simple.every)?;
        let truth = self.truth.part(&self.kept);
        let error = expect_settled(&settled(&simple)?, &truth, &judge(&self.kept), &cycle).ok()?.error;
        let real = error.covariance[(0, 0)];
        let steps: Vec<u64> = (0..self.least_start.len() as u64).collect();
        let gains = GainSequence::new(&simple, steps.len() as u64, &steps);
        let all: Vec<usize> = (0..self.truth.states.len()).collect();
        let start = expect(&simple, &self.truth, &gains, &judge(&all), &[vec![]]);
        let ratio = |(epoch, least): (&ExpectedError, &f64)| (epoch.covariance[(0, 0)] / least).sqrt();
        Some(WalkPrice {
            settled: (real / self.least_settled).sqrt(),
            first_minute: start.epochs.iter().zip(&self.least_start).map(ratio).fold(1.0, f64::max),
            nees: real / error.claimed[(0, 0)],
        })
    }

    /// The walk of the least price, between the growth of the drift over `longest_s` and that over the shortest times.
    ///
    /// A coarse search over ln K finds the valley, a golden section its floor.
    pub fn least(&self, longest_s: f64) -> Option<(f64, WalkPrice)> {
        let growth = |horizon: Option<f64>| {
            let of = |[sigma, tc]: &[f64; 2]| match horizon {
                None => 2.0 * sigma * sigma / tc,
                Some(h) => -2.0 * sigma * sigma * (-h / tc).exp_m1() / h,
            };
            (self.sensor.walk.powi(2) + self.sensor.processes.iter().map(of).sum::<f64>()).sqrt().ln()
        };
        let (low, high) = (growth(Some(longest_s)), growth(None));
        if self.sensor.processes.is_empty() {
            return Some((self.sensor.walk, self.price(self.sensor.walk)?));
        }
        let price = |log: f64| self.price(log.exp()).map_or(f64::INFINITY, |price| price.worst());
        let step = (high - low) / COARSE as f64;
        let at = |i: usize| low + step * i as f64;
        let best = (0..=COARSE).map(|i| (i, price(at(i)))).min_by(|a, b| a.1.total_cmp(&b.1))?.0;
        let k = valley(price, at(best.saturating_sub(1)), at((best + 1).min(COARSE))).exp();
        Some((k, self.price(k)?))
    }
}

/// The walk for several sensors at once: the largest price is least. It lies between those of the sensors, `least`
/// by [`WalkTrial::least`].
pub fn shared_walk(trials: &[&WalkTrial], least: &[f64]) -> f64 {
    let ends = |of: fn(f64, f64) -> f64| least.iter().copied().reduce(of).unwrap_or(0.0);
    let (low, high) = (ends(f64::min), ends(f64::max));
    if low == high {
        return low;
    }
    let dearest = |log: f64| {
        let price = |trial: &&WalkTrial| trial.price(log.exp()).map_or(f64::INFINITY, |price| price.worst());
        trials.iter().map(price).fold(0.0, f64::max)
    };
    valley(dearest, low.ln(), high.ln()).exp()
}

fn valley(price: impl Fn(f64) -> f64, low: f64, high: f64) -> f64 {
    lowest(price, low, high, WIDTH * (high - low))
}

/// From one measurement to the next: y_1 ← y_1 + dt y_2 …, the last y ← y + dt (b + Σ d_i + w), var w = N²/dt, each
/// step; b a walk of density `walk` from N(0, `bias`²), d_i the processes. y_1 is measured. The step of the model is
/// that of the aid.
fn model(sensor: &SensorDrift, filter: &AidedFilter, processes: &[[f64; 2]], walk: f64, bias: f64) -> LinearModel {
    let (dt, m) = (filter.step, filter.integrals);
    let n = m + 1 + processes.len();
    let mut f = DMatrix::identity(n, n);
    let mut q = DMatrix::zeros(n, n);
    let mut p0 = DMatrix::zeros(n, n);
    for i in 0..m {
        // nothing is known of what is measured, and a velocity to 1 m/s
        p0[(i, i)] = if i == 0 { (10.0 * filter.aid_std_dev).powi(2) } else { 1.0 };
        if i + 1 < m {
            f[(i, i + 1)] = dt;
        }
    }
    f.view_mut((m - 1, m), (1, n - m)).fill(dt);
    q[(m - 1, m - 1)] = sensor.white.powi(2) * dt;
    q[(m, m)] = walk.powi(2) * dt;
    p0[(m, m)] = bias.powi(2);
    for (i, &[std_dev, correlation_time]) in (m + 1..).zip(processes) {
        if let Some(own) = (Term::GaussMarkov { std_dev, correlation_time }).realisation(dt, dt) {
            (f[(i, i)], q[(i, i)], p0[(i, i)]) = (own.phi[(0, 0)], own.q[(0, 0)], own.p0[(0, 0)]);
        }
    }
    let steps = (1.0 / (filter.aid_rate_hz * dt)).round().max(1.0) as u32;
    let (mut whole, mut noise) = (DMatrix::identity(n, n), DMatrix::zeros(n, n));
    for _ in 0..steps {
        noise = &f * noise * f.transpose() + &q;
        whole = &f * whole;
    }
    let unit = sensor.quantity.si_unit();
    let named = |i: usize| Named {
        name: match i {
            _ if i < m => format!("integral.{i}"),
            _ if i == m => "bias".into(),
            _ => format!("gauss_markov.{}", i - m),
        },
        unit: unit.into(),
    };
    let drift = DMatrix::from_fn(1, n, |_, j| f64::from(j >= m));
    LinearModel {
        dt: dt * f64::from(steps),
        states: (0..n).map(named).collect(),
        inputs: Vec::new(),
        measurements: vec![Named { name: "aid".into(), unit: unit.into() }],
        every: vec![1],
        outputs: vec![Output { name: DRIFT.into(), unit: unit.into(), row: drift.iter().copied().collect() }],
        f: whole,
        g: DMatrix::zeros(n, 0),
        h: DMatrix::from_fn(1, n, |_, j| f64::from(j == 0)),
        q: noise,
        r: DMatrix::from_element(1, 1, filter.aid_std_dev.powi(2)),
        x0: DVector::zeros(n),
        p0,
    }
}

/// With its steady P(k|k−1) as P0.
fn settled(model: &LinearModel) -> Option<LinearModel> {
    let p0 = dare_doubling(&model.f, &model.h, &model.q, &model.r).ok()?.covariance;
    Some(LinearModel { p0, ..model.clone() })
}
