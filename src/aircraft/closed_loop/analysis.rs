//! What a closed loop does, exactly: motions, margins, covariances by source, offsets, responses. SI and rad.
//!
//! Covariance X = A X Aᵀ + Q, one solution per source; a constant bias b is answered by (I − A)⁻¹ b.

use nalgebra::{Complex, DMatrix, DVector};

use super::LoopError;
use super::circuit::{Circuit, law};
use super::feed::{Feed, Kind};
use super::half::{ANGLE, Half};
use super::half_feed::HalfFeed;
use super::modes::{LoopMode, modes};
use crate::aircraft::atmosphere::discrete::{DiscreteGust, Form};
use crate::aircraft::control::margins::{LoopMargins, margins};
use crate::aircraft::flight::Setting;
use crate::filter::Cycle;
use crate::numerics::linalg::solve;
use crate::numerics::progress::checkpoint;
use crate::numerics::riccati::lyapunov;

/// An offset is removed when less than this part of its largest is left.
const REMOVED: f64 = 0.1;
/// As long as an offset, and a filter that learns it, are followed, s.
const FOLLOWED: f64 = 3600.0;
/// When it is asked what a filter knows of the drift, s.
pub const ASKED: [f64; 2] = [10.0, 100.0];
/// Length of the responses in time, s.
pub const RESPONSE: f64 = 10.0;
/// Band around the last value of a step that it must no longer leave.
const SETTLED: f64 = 0.05;

/// Root mean squares of one number, by source.
#[derive(Clone, Debug, PartialEq)]
pub struct Rms {
    pub name: String,
    pub all: f64,
    /// In the order of `circuit::Source::ALL`.
    pub by: [f64; 4],
}

/// The answer to a commanded angle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// From 10 to 90 % of the last value, s.
    pub rise: Option<f64>,
    /// Beyond the last value, over it.
    pub overshoot: f64,
    /// Until it stays within 5 % of the last value, s.
    pub settling: Option<f64>,
    /// Of the commanded angle.
    pub reached: f64,
}

/// What a filter knows of the drift of a gyro, σ in rad/s at the times of [`ASKED`].
#[derive(Clone, Debug, PartialEq)]
pub struct Known {
    pub filter: String,
    pub gyro: usize,
    pub sigma: [f64; 2],
}

/// All of one half; what an unstable loop has no value of is absent.
#[derive(Clone, Debug)]
pub struct HalfResult {
    pub circuit: Circuit,
    pub modes: Vec<LoopMode>,
    /// Absent when the loop is unstable.
    pub steady: Option<Steady>,
    pub known: Vec<Known>,
}

/// Of a stable loop.
#[derive(Clone, Debug)]
pub struct Steady {
    pub margins: LoopMargins,
    /// In the order of `circuit.looked`.
    pub rms: Vec<Rms>,
    /// What the constant biases of the gyros leave of rates and angle, by name.
    pub offset: Vec<(String, f64)>,
    /// Until less than a tenth of the angle's largest deviation is left, s; absent when it stays.
    pub removed: Option<f64>,
    pub step: Step,
    /// Largest values after a 1 − cos gust, by name.
    pub gust_peaks: Vec<(String, f64)>,
}

/// A feed in both halves.
#[derive(Clone, Debug)]
pub struct FeedResult {
    pub name: String,
    pub kind: Kind,
    pub halves: [HalfResult; 2],
}

impl FeedResult {
    /// The first growing motion of an unstable loop, with its half.
    pub fn unstable(&self) -> Option<(Half, &LoopMode)> {
        let growing = |half: &HalfResult| half.modes.iter().position(|mode| mode.eigenvalue.0 >= 0.0);
        self.halves.iter().find_map(|half| growing(half).map(|i| (half.circuit.half, &half.modes[i])))
    }
}

/// Every feed, with the gains of `setting`, around the airplane of `truth`.
pub fn analyse(setting: &Setting, truth: &Setting, feeds: &[Feed]) -> Result<Vec<FeedResult>, LoopError> {
    feeds.iter().map(|feed| of_feed(setting, truth, feed)).collect()
}

/// The same of one feed.
pub fn of_feed(setting: &Setting, truth: &Setting, feed: &Feed) -> Result<FeedResult, LoopError> {
    let one = |half: Half| {
        let of = &feed.halves[usize::from(half == Half::RollYaw)];
        half_result(truth, half, of, &law(setting, half))
            .map_err(|e| LoopError(format!("{}: {}: {e}", feed.name, half.title())))
    };
    Ok(FeedResult { name: feed.name.clone(), kind: feed.kind, halves: [one(Half::Pitch)?, one(Half::RollYaw)?] })
}

fn half_result(
    truth: &Setting,
    half: Half,
    feed: &HalfFeed,
    law: &crate::aircraft::control::response::StateSpace,
) -> Result<HalfResult, LoopError> {
    checkpoint();
    let circuit = Circuit::new(truth, half, feed, law)?;
    let modes = modes(&circuit);
    let stable = modes.iter().all(|mode| mode.eigenvalue.0 < 0.0);
    let steady = if stable { Some(steady(truth, &circuit)?) } else { None };
    Ok(HalfResult { modes, steady, known: known(half, feed)?, circuit })
}

fn steady(truth: &Setting, circuit: &Circuit) -> Result<Steady, LoopError> {
    // the loop itself is discrete with its delays in it
    let margins = margins(&circuit.broken, 0.0, 0.0).map_err(|e| LoopError(e.to_string()))?;
    let covariances: Vec<DMatrix<f64>> =
        circuit.sources.iter().map(|(_, q)| covariance(&circuit.a, q)).collect::<Result<_, _>>()?;
    let rms = circuit.looked.iter().map(|looked| {
        let i = looked.state;
        let by: [f64; 4] = std::array::from_fn(|s| covariances[s][(i, i)].max(0.0));
        Rms { name: looked.name.clone(), all: by.iter().sum::<f64>().sqrt(), by: by.map(f64::sqrt) }
    });
    let rms = rms.collect();
    let n = circuit.a.nrows();
    let left = solve(DMatrix::identity(n, n) - &circuit.a, &DMatrix::from_column_slice(n, 1, circuit.bias.as_slice()))?;
    let last: DVector<f64> = left.column(0).into_owned();
    let names = circuit.half.rate_names().iter().zip(circuit.half.rates());
    let offset = names.map(|(name, state)| ((*name).to_string(), last[*state]));
    let offset = offset.chain([(circuit.half.angle_name().to_string(), last[ANGLE])]).collect();
    Ok(Steady {
        margins,
        rms,
        offset,
        removed: removed(circuit, &last),
        step: step(circuit, &response(circuit, &circuit.command, None)),
        gust_peaks: gust_peaks(truth, circuit),
    })
}

/// X = A X Aᵀ + Q; a source that is silent needs no equation.
fn covariance(a: &DMatrix<f64>, q: &DMatrix<f64>) -> Result<DMatrix<f64>, LoopError> {
    if q.iter().all(|x| *x == 0.0) {
        return Ok(q.clone());
    }
    Ok(lyapunov(a, q)?)
}

/// From the moment at which the biases appear, second by second.
fn removed(circuit: &Circuit, last: &DVector<f64>) -> Option<f64> {
    if circuit.bias.iter().all(|x| *x == 0.0) {
        return Some(0.0);
    }
    // x(k) = x∞ − Aᵏ x∞
    let per_second = (1.0 / circuit.interval).round().max(1.0) as u64;
    let mut forward = DMatrix::identity(circuit.a.nrows(), circuit.a.nrows());
    let mut power = circuit.a.clone();
    let mut left = per_second;
    while left > 0 {
        if left % 2 == 1 {
            forward = &forward * &power;
        }
        power = &power * &power;
        left /= 2;
    }
    let second = per_second as f64 * circuit.interval;
    let mut away = last.clone();
    let angles: Vec<f64> = (0..=(FOLLOWED / second) as usize)
        .map(|_| {
            let angle = last[ANGLE] - away[ANGLE];
            away = &forward * &away;
            angle.abs()
        })
        .collect();
    let largest = angles.iter().copied().fold(0.0, f64::max);
    let after = angles.iter().rposition(|angle| *angle > REMOVED * largest)? + 1;
    (after < angles.len()).then_some(after as f64 * second)
}

/// States over [`RESPONSE`] seconds from rest, driven by a column at every sample, or by a gust.
pub fn response(circuit: &Circuit, column: &DVector<f64>, gust: Option<&dyn Fn(f64) -> [f64; 3]>) -> Vec<DVector<f64>> {
    let steps = (RESPONSE / circuit.interval).round() as usize;
    let mut x = DVector::zeros(circuit.a.nrows());
    let mut out = Vec::with_capacity(steps + 1);
    for k in 0..=steps {
        out.push(x.clone());
        let mut next = &circuit.a * &x;
        match gust {
            None => next += column,
            Some(gust) => {
                // held over the sample at its middle value
                let held = DVector::from_row_slice(&gust((k as f64 + 0.5) * circuit.interval));
                next += &circuit.gust * held;
            }
        }
        x = next;
    }
    out
}

fn step(circuit: &Circuit, course: &[DVector<f64>]) -> Step {
    let angle: Vec<f64> = course.iter().map(|x| x[ANGLE]).collect();
    let last = angle.last().copied().unwrap_or(0.0);
    let reaches = |share: f64| angle.iter().position(|a| a / last >= share).map(|i| i as f64 * circuit.interval);
    let most = angle.iter().map(|a| a / last).fold(f64::NEG_INFINITY, f64::max);
    let outside = angle.iter().rposition(|a| (a / last - 1.0).abs() > SETTLED);
    Step {
        rise: reaches(0.9).zip(reaches(0.1)).map(|(end, start)| end - start),
        overshoot: (most - 1.0).max(0.0),
        settling: outside.filter(|i| i + 1 < angle.len()).map(|i| (i + 1) as f64 * circuit.interval),
        reached: last,
    }
}

/// The first discrete gust of the flight, or, where there is none, one of 3 m/s that rises over 25 m and falls
/// again: up and from the left.
pub fn discrete_gust(truth: &Setting) -> DiscreteGust {
    truth.discrete.first().copied().unwrap_or(DiscreteGust {
        form: Form::Return,
        velocity: [0.0, 3.0, -3.0],
        length: 25.0,
        start: 0.0,
    })
}

/// u w q or v p r of the air at a time after the airplane meets the gust.
pub fn gust_of(truth: &Setting, half: Half) -> impl Fn(f64) -> [f64; 3] {
    let (gust, speed) = (discrete_gust(truth), truth.trim.airspeed());
    move |time| {
        let [u, v, w] = gust.at(speed * time).velocity;
        match half {
            Half::Pitch => [u, w, 0.0],
            Half::RollYaw => [v, 0.0, 0.0],
        }
    }
}

fn gust_peaks(truth: &Setting, circuit: &Circuit) -> Vec<(String, f64)> {
    let gust = gust_of(truth, circuit.half);
    let course = response(circuit, &circuit.command, Some(&gust));
    let largest = |state: usize| course.iter().map(|x| x[state].abs()).fold(0.0, f64::max);
    circuit.looked.iter().map(|looked| (looked.name.clone(), largest(looked.state))).collect()
}

/// σ of the whole drift of each gyro that a filter follows, from its first measurement on.
fn known(half: Half, feed: &HalfFeed) -> Result<Vec<Known>, LoopError> {
    let mut out = Vec::new();
    for filter in &feed.filters {
        let model = &filter.model;
        let n = model.states.len();
        let of_gyro = |row: usize| {
            // beside the states of the airframe a gyro shows its own errors
            DMatrix::from_fn(1, n, |_, j| {
                let own = model.states[j].name.starts_with(&model.measurements[row].name);
                if own { model.h[(row, j)] } else { 0.0 }
            })
        };
        let rows: Vec<(usize, DMatrix<f64>)> = if model.measurements[0].name.starts_with("gyro_") {
            half.gyros().iter().enumerate().map(|(i, gyro)| (*gyro, of_gyro(i))).collect()
        } else {
            vec![(half.gyros()[0], model.drift_row())]
        };
        let cycle = Cycle::new(&model.every).ok_or_else(|| LoopError("rates without a common period".into()))?;
        for (gyro, row) in rows {
            let mut sigma = [0.0; 2];
            for (sigma, time) in sigma.iter_mut().zip(ASKED) {
                let p = cycle.flow_of(model, 1)?.times((time / model.dt).round() as u64)?.apply(&model.p0)?;
                *sigma = (&row * p * row.transpose())[(0, 0)].max(0.0).sqrt();
            }
            out.push(Known { filter: filter.name.clone(), gyro, sigma });
        }
    }
    Ok(out)
}

/// L of one command over a grid of frequencies (rad/s), the other closed; for figures.
pub fn loop_gain(circuit: &Circuit, command: usize, frequencies: &[f64]) -> Vec<Complex<f64>> {
    let response = circuit.broken.response();
    frequencies.iter().map(|w| crate::aircraft::control::margins::alone(&response.at(*w), command)).collect()
}
