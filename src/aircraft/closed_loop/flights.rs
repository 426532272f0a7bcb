//! The feeds in nonlinear flights: the same gusts and the same noise for each (common random numbers), so that their
//! differences need few flights.
//!
//! A flight begins in trim with its filters at rest and is judged after its first sixth. Gyros have no constant bias
//! then: what it does is the offset of the exact analysis. Root mean squares are of deviations from the trim.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::LoopError;
use super::analysis::FeedResult;
use super::circuit::{Circuit, controller, law};
use super::feed::{Feed, Kind};
use super::flown::{Consistency, Flown, Linear, Paired};
use super::half::{AIRFRAME, ANGLE, Half};
use super::half_feed::{HalfFeed, Kalman};
use super::judged::Judged;
use crate::aircraft::control::response::StateSpace;
use crate::aircraft::flight::{Commander, FlightError, Plan, Seen, Setting, Truth};
use crate::numerics::distribution::student_quantile;
use crate::numerics::linalg::mahalanobis;
use crate::numerics::progress::checkpoint;
use crate::numerics::reduce::Moments;
use crate::numerics::riccati::lyapunov;

/// Part of a flight that is left out: filters and turbulence come together.
const BEFORE: f64 = 1.0 / 6.0;
/// Two-sided; each bound is one-sided at half of what is left.
const LEVEL: f64 = 0.95;
/// By how much a rms may grow and still be called not worse.
pub const MARGIN: f64 = 0.1;
/// Precision of a rms for which the number of flights is said before.
pub const WISHED: f64 = 0.01;

/// Quantities of a flight, in deg and deg/s.
const QUANTITIES: [&str; 8] = ["q", "theta", "p", "r", "phi", "elevator_rate", "aileron_rate", "rudder_rate"];

/// Gains and feed of one half under way.
struct Running {
    system: StateSpace,
    x: DVector<f64>,
    /// Of each Kalman filter in it: first state, and what it claims of the airframe's states.
    filters: Vec<Followed>,
    feed: HalfFeed,
}

/// A Kalman filter whose errors are followed.
struct Followed {
    filter: Kalman,
    /// P(k|k) of the airframe's states, where it has them.
    claimed: Option<DMatrix<f64>>,
    nis: Moments,
    nees: Moments,
    /// Last estimate of the airframe's states.
    estimate: DVector<f64>,
}

impl Running {
    fn new(setting: &Setting, half: Half, feed: &HalfFeed, kind: Kind) -> Running {
        let system = controller(feed, &law(setting, half));
        let follow = |filter: &Kalman| {
            let prior = &filter.steady.predicted_covariance;
            let post = prior - &filter.steady.gain * &filter.model.h * prior;
            let claimed = (kind == Kind::Airframe).then(|| post.view((0, 0), (AIRFRAME, AIRFRAME)).into_owned());
            let (nis, nees) = (Moments::NONE, Moments::NONE);
            Followed { filter: filter.clone(), claimed, nis, nees, estimate: DVector::zeros(AIRFRAME) }
        };
        // only a filter that stands first in the feed has its states at the beginning
        let filters = feed.filters.iter().take(1).map(follow).collect();
        Running { x: DVector::zeros(system.states()), system, filters, feed: feed.clone() }
    }

    /// Commands by the deviations of what was measured; `settled`: innovations count.
    fn command(&mut self, measured: [f64; AIRFRAME], settled: bool) -> DVector<f64> {
        let mut y = DVector::zeros(AIRFRAME + 1);
        y.rows_mut(0, AIRFRAME).copy_from_slice(&measured);
        let y_measured = y.rows(0, AIRFRAME).into_owned();
        let own = self.x.rows(0, self.feed.system.states()).into_owned();
        for followed in &mut self.filters {
            let (model, seen) = (&followed.filter.model, &followed.filter.seen);
            let innovation = seen * &y_measured - &model.h * own.rows(0, model.states.len());
            if settled && let Ok(nis) = mahalanobis(&innovation, &followed.filter.steady.innovation_covariance) {
                followed.nis.add(nis / innovation.len() as f64);
            }
            followed.estimate = &self.feed.system.c * &own + self.feed.system.d.columns(0, AIRFRAME) * &y_measured;
        }
        let u = &self.system.c * &self.x + &self.system.d * &y;
        self.x = &self.system.a * &self.x + &self.system.b * y;
        u
    }

    /// The true deviations at the sample of the last command.
    fn compare(&mut self, truth: [f64; AIRFRAME]) {
        let truth = DVector::from_row_slice(&truth);
        for followed in &mut self.filters {
            if let Some(claimed) = &followed.claimed
                && let Ok(nees) = mahalanobis(&(&followed.estimate - &truth), claimed)
            {
                followed.nees.add(nees / AIRFRAME as f64);
            }
        }
    }
}

/// A feed that flies.
struct Pilot<'a> {
    trim: &'a Setting,
    halves: [Running; 2],
    /// Samples left until it counts.
    before: u64,
}

/// u w q θ and v p r φ of rates, angles (roll, pitch) and velocities, less those of the trim.
fn deviations(setting: &Setting, velocity: [f64; 3], rate: [f64; 3], angles: [f64; 2]) -> [[f64; AIRFRAME]; 2] {
    let trim = &setting.trim;
    let [u, v, w] = [0, 1, 2].map(|i| velocity[i] - trim.velocity[i]);
    let [p, q, r] = [0, 1, 2].map(|i| rate[i] - trim.rate[i]);
    [[u, w, q, angles[1] - trim.theta], [v, p, r, angles[0] - trim.phi]]
}

impl Commander for Pilot<'_> {
    fn command(&mut self, seen: &Seen) -> [f64; 3] {
        let settled = self.before == 0;
        self.before = self.before.saturating_sub(1);
        let [along, across] = deviations(self.trim, seen.velocity, seen.rate, seen.angles);
        let elevator = self.halves[0].command(along, settled);
        let lateral = self.halves[1].command(across, settled);
        let c = self.trim.trim.controls;
        [c.elevator + elevator[0], c.aileron + lateral[0], c.rudder + lateral[1]]
    }
}

/// Of one flight: rms of every quantity (deg, deg/s), and mean NIS and NEES of the filters of both halves, NaN where
/// there is none.
struct Outcome {
    rms: [f64; QUANTITIES.len()],
    consistency: [[f64; 2]; 2],
}

/// `look` sees the deviations of every sample.
fn fly(
    plan: &Plan,
    judged: &Judged,
    feed: &Feed,
    (seed, run): (u64, u64),
    mut look: impl FnMut(f64, [[f64; AIRFRAME]; 2], &Truth),
) -> Result<Outcome, FlightError> {
    checkpoint();
    let setting = &judged.setting;
    let running = |i: usize| Running::new(setting, Half::BOTH[i], &feed.halves[i], feed.kind);
    let before = BEFORE * plan.duration();
    let samples = (before * setting.rate).ceil() as u64;
    let pilot = std::cell::RefCell::new(Pilot { trim: setting, halves: [running(0), running(1)], before: samples });
    let mut squares = [Moments::NONE; QUANTITIES.len()];
    let mut commander = Shared(&pilot);
    plan.fly_by(seed, run, &mut commander, |time, truth| {
        let [along, across] = deviations(setting, truth.velocity, truth.rate, truth.angles);
        look(time, [along, across], truth);
        if time < before {
            return;
        }
        let mut pilot = pilot.borrow_mut();
        pilot.halves[0].compare(along);
        pilot.halves[1].compare(across);
        for (square, x) in squares.iter_mut().zip(values(along, across, truth)) {
            square.add(x * x);
        }
    })?;
    let pilot = pilot.into_inner();
    let of = |half: &Running| half.filters.first().map_or([f64::NAN; 2], |f| [f.nis.mean, f.nees.mean]);
    let consistency = pilot.halves.each_ref().map(of);
    Ok(Outcome { rms: squares.map(|square| square.mean.sqrt().to_degrees()), consistency })
}

/// In the order of [`QUANTITIES`].
fn values(along: [f64; 4], across: [f64; 4], truth: &Truth) -> [f64; QUANTITIES.len()] {
    let [elevator, aileron, rudder] = truth.surface_rates;
    [along[2], along[3], across[1], across[2], across[3], elevator, aileron, rudder]
}

/// The pilot is asked for commands and, between them, compared with the truth.
struct Shared<'p, 'a>(&'p std::cell::RefCell<Pilot<'a>>);

impl Commander for Shared<'_, '_> {
    fn command(&mut self, seen: &Seen) -> [f64; 3] {
        self.0.borrow_mut().command(seen)
    }
}

/// Mean and 95 % interval by Student's law.
fn interval(values: &[f64]) -> (f64, [f64; 2]) {
    let moments = Moments::of(values);
    let half = student_quantile(0.5 + 0.5 * LEVEL, moments.count as f64 - 1.0)
        * (moments.variance() / moments.count as f64).sqrt();
    (moments.mean, [moments.mean - half, moments.mean + half])
}

/// Relative standard error of a rms over one flight of `duration` s: √(Σρ²/2n) with ρ its autocorrelation at the
/// samples (Bartlett 1935), by the exact covariance of the loop.
fn error_of_one(circuit: &Circuit, state: usize, duration: f64) -> Result<f64, LoopError> {
    let n = circuit.a.nrows();
    let q = circuit.sources.iter().fold(DMatrix::zeros(n, n), |sum, (_, q)| sum + q);
    let x = lyapunov(&circuit.a, &q)?;
    let samples = (duration / circuit.interval).max(1.0);
    // cov(x(k), x(0)) = Aᵏ X, of one state: forward from its column
    let mut column: DVector<f64> = x.column(state).into_owned();
    let variance = column[state];
    if variance <= 0.0 {
        return Ok(0.0);
    }
    let mut sum = 1.0;
    for k in 1..samples as usize {
        column = &circuit.a * column;
        let rho = column[state] / variance;
        sum += 2.0 * rho * rho * (1.0 - k as f64 / samples);
    }
    Ok((sum / (2.0 * samples)).sqrt())
}

/// How many flights a rms of every quantity needs for one percent (95 %), the largest of the raw loop.
pub fn needed(raw: &FeedResult, duration: f64) -> Result<u64, LoopError> {
    let mut largest = 0.0_f64;
    for half in &raw.halves {
        for looked in half.circuit.looked.iter().filter(|looked| QUANTITIES.contains(&looked.name.as_str())) {
            largest = largest.max(error_of_one(&half.circuit, looked.state, (1.0 - BEFORE) * duration)?);
        }
    }
    let of_normal = crate::numerics::distribution::NORMAL_95;
    Ok((of_normal * largest / WISHED).powi(2).ceil().max(2.0) as u64)
}

/// One flight of a feed.
#[derive(Clone, Debug)]
pub struct Course {
    pub feed: String,
    /// Of every sample: s; θ and φ less those of the trim, and the elevator and aileron, rad.
    pub samples: Vec<(f64, [f64; 2], [f64; 2])>,
}

/// The first flight of every feed in `plan`; one that cannot be flown on ends there.
pub fn one(judged: &Judged, plan: &Plan, seed: u64) -> Vec<Course> {
    let plan = plan.clone().without_bias();
    let course = |feed: &Feed| {
        let mut samples = Vec::new();
        let _ = fly(&plan, judged, feed, (seed, 0), |time, [along, across], truth| {
            samples.push((time, [along[ANGLE], across[ANGLE]], [truth.surfaces[0], truth.surfaces[1]]));
        });
        Course { feed: feed.name.clone(), samples }
    };
    judged.feeds.par_iter().map(course).collect()
}

/// `runs` flights of every feed in `plan`, which is the flight of the truth. Errors: a flight that cannot be flown.
pub fn flown(judged: &Judged, plan: &Plan, runs: u64, seed: u64) -> Result<Flown, LoopError> {
    let plan = plan.clone().without_bias();
    let needed = needed(&judged.raw, plan.duration())?;
    let jobs: Vec<(u64, usize)> =
        (0..runs).flat_map(|run| (0..judged.feeds.len()).map(move |feed| (run, feed))).collect();
    let outcomes: Vec<Result<Outcome, FlightError>> = jobs
        .par_iter()
        .map(|(run, feed)| fly(&plan, judged, &judged.feeds[*feed], (seed, *run), |_, _, _| {}))
        .collect();
    let mut by_feed: Vec<Vec<Outcome>> = judged.feeds.iter().map(|_| Vec::new()).collect();
    for ((run, feed), outcome) in jobs.iter().zip(outcomes) {
        let name = &judged.feeds[*feed].name;
        by_feed[*feed].push(outcome.map_err(|e| LoopError(format!("feed '{name}', flight {run}: {e}")))?);
    }
    let against = judged.feeds.iter().position(|feed| feed.kind == Kind::Raw).unwrap_or(0);
    let (mut linear, mut paired, mut consistency) = (Vec::new(), Vec::new(), Vec::new());
    for (i, (feed, result)) in judged.feeds.iter().zip(&judged.results).enumerate() {
        for (k, quantity) in QUANTITIES.iter().enumerate() {
            let Some(exact) = rms_of(result, quantity) else { continue };
            let of = |feed: usize| by_feed[feed].iter().map(|outcome| outcome.rms[k]);
            // mean squares are without bias, their roots are not
            let (mean, [low, high]) = interval(&of(i).map(|x| x * x).collect::<Vec<_>>());
            let [simulated, lower, upper] = [mean, low, high].map(|x| x.max(0.0).sqrt());
            let inside = (lower..=upper).contains(&exact);
            let quantity = (*quantity).to_string();
            linear.push(Linear {
                feed: feed.name.clone(),
                quantity: quantity.clone(),
                linear: exact,
                simulated,
                lower,
                upper,
                inside,
            });
            if i == against {
                continue;
            }
            let differences: Vec<f64> = of(i).zip(of(against)).map(|(ours, theirs)| ours - theirs).collect();
            let (difference, [lower, upper]) = interval(&differences);
            let base = Moments::of(&of(against).collect::<Vec<_>>()).mean;
            paired.push(Paired {
                feed: feed.name.clone(),
                against: judged.feeds[against].name.clone(),
                quantity,
                difference,
                lower,
                upper,
                not_worse: upper < MARGIN * base,
                better: upper < 0.0,
            });
        }
        for (h, half) in Half::BOTH.iter().enumerate() {
            let values = |which: usize| -> Vec<f64> {
                by_feed[i]
                    .iter()
                    .map(|outcome| outcome.consistency[h][which])
                    .filter(|x| x.is_finite() && *x > 0.0)
                    .collect()
            };
            let mean = |values: Vec<f64>| {
                (values.len() > 1).then(|| {
                    let (mean, [lower, upper]) = interval(&values);
                    [mean, lower, upper]
                })
            };
            let (nis, nees) = (mean(values(0)), mean(values(1)));
            if nis.is_some() || nees.is_some() {
                consistency.push(Consistency { feed: feed.name.clone(), half: half.name(), nis, nees });
            }
        }
    }
    Ok(Flown {
        runs,
        duration_s: plan.duration(),
        seed,
        level: LEVEL,
        margin: MARGIN,
        needed_for_one_percent: needed,
        linear,
        consistency,
        paired,
    })
}

fn rms_of(result: &FeedResult, quantity: &str) -> Option<f64> {
    let all = result.halves.iter().filter_map(|half| half.steady.as_ref()).flat_map(|steady| &steady.rms);
    all.into_iter().find(|rms| rms.name == quantity).map(|rms| rms.all.to_degrees())
}
