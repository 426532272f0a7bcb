//! The feeds over airplanes and sensors that may be: in how many of them each criterion is kept.

use rayon::prelude::*;

use super::LoopError;
use super::analysis::analyse;
use super::judged::Judged;
use super::varied::{Kept, Spread};
use super::verdict::judge;
use crate::aircraft::airframe::{Airplane, Lateral};
use crate::aircraft::flight::Setting;
use crate::aircraft::flight::document::UncertaintyEntry;
use crate::numerics::distribution::NORMAL_95;
use crate::numerics::random::{StreamId, normal, stream};

/// Axis part of the stream addresses of drawn airframes and sensors.
const AIRFRAME: u32 = 1 << 28;

/// Draws `cases` airplanes. Errors: nothing is uncertain.
pub fn spread(judged: &Judged, uncertainty: &UncertaintyEntry, cases: u64, seed: u64) -> Result<Spread, LoopError> {
    let mut drawn = Vec::new();
    let UncertaintyEntry { aerodynamics, mass, inertia, servo } = *uncertainty;
    for (name, share) in
        [("aerodynamic derivatives", aerodynamics), ("mass", mass), ("moments of inertia", inertia), ("servos", servo)]
    {
        if share > 0.0 {
            drawn.push(format!("{name} {} %", crate::units::digits(100.0 * share)));
        }
    }
    let mut gyro = judged.truth.gyro.clone();
    let known = gyro.iter_mut().flat_map(|gyro| &mut gyro.axes);
    let intervals: usize =
        known.map(|axis| axis.noise_parameters().filter(|(_, p)| p.log_spread().is_some()).count()).sum();
    if intervals > 0 {
        drawn.push(format!("{intervals} parameters of the gyros by their intervals"));
    }
    if drawn.is_empty() {
        return Err(LoopError(
            "uncertainty: nothing to draw; state it, for example \"uncertainty\": { \"aerodynamics\": \"10 %\" }, or \
             give gyro parameters with intervals"
                .into(),
        ));
    }
    // by case: of each feed whether it is stable and keeps all, and each of the judgements
    type Case = (Vec<[bool; 2]>, Vec<bool>);
    let one = |case: u64| -> Option<Result<Case, LoopError>> {
        let truth = draw(&judged.truth, uncertainty, seed, case)?;
        let judge = || -> Result<Case, LoopError> {
            let results = analyse(&judged.setting, &truth, &judged.feeds)?;
            let judgements = judge(&results.iter().collect::<Vec<_>>(), &judged.criteria);
            let each = results.iter().map(|result| {
                let keeps = judgements.iter().all(|judgement| judgement.feed != result.name || judgement.pass);
                [result.unstable().is_none(), keeps && result.unstable().is_none()]
            });
            Ok((each.collect(), judgements.iter().map(|judgement| judgement.pass).collect()))
        };
        Some(judge())
    };
    let all: Vec<Option<Result<Case, LoopError>>> = (0..cases).into_par_iter().map(one).collect();
    let without_trim = all.iter().filter(|case| case.is_none()).count() as u64;
    let done: Vec<Case> = all.into_iter().flatten().collect::<Result<_, _>>()?;
    let mut kept = Vec::new();
    let mut add = |feed: &str, criterion: String, count: usize| {
        let (share, [lower, upper]) = wilson(count, done.len());
        kept.push(Kept { feed: feed.to_string(), criterion, share, lower, upper });
    };
    for (i, feed) in judged.feeds.iter().enumerate() {
        add(&feed.name, "stable".into(), done.iter().filter(|case| case.0[i][0]).count());
        for (j, judgement) in judged.document.criteria.iter().enumerate().filter(|(_, c)| c.feed == feed.name) {
            let name = format!("{} {} of {}", judgement.name, judgement.kind, judgement.surface).replace('_', " ");
            add(&feed.name, name, done.iter().filter(|case| case.1.get(j) == Some(&true)).count());
        }
        add(&feed.name, "all criteria".into(), done.iter().filter(|case| case.0[i][1]).count());
    }
    Ok(Spread { cases, seed, without_trim, drawn, kept })
}

/// Another airplane with other gyros in the same air; `None` where it does not trim.
fn draw(truth: &Setting, uncertainty: &UncertaintyEntry, seed: u64, case: u64) -> Option<Setting> {
    let mut number = 0;
    let mut factor = |share: f64| {
        let draw = normal(&mut stream(seed, StreamId { run: case, axis: AIRFRAME, term: number }));
        number += 1;
        1.0 + share * draw
    };
    let mut other = truth.clone();
    vary(&mut other.airplane, uncertainty, &mut factor);
    for (axis, params) in (AIRFRAME + 1..).zip(other.gyro.iter_mut().flat_map(|gyro| &mut gyro.axes)) {
        for (term, (_, parameter)) in (0..).zip(params.noise_parameters()) {
            if let Some(spread) = parameter.log_spread() {
                let draw = normal(&mut stream(seed, StreamId { run: case, axis, term }));
                parameter.value *= (spread * draw).exp();
            }
        }
    }
    other.trim = other.airplane.trim(&other.request).ok()?;
    other.models = other.airplane.linear(&other.trim);
    Some(other)
}

fn vary(airplane: &mut Airplane, uncertainty: &UncertaintyEntry, factor: &mut impl FnMut(f64) -> f64) {
    let UncertaintyEntry { aerodynamics, mass, inertia, servo } = *uncertainty;
    let a = &mut airplane.aerodynamics;
    let lateral = |l: &mut Lateral, factor: &mut dyn FnMut(f64) -> f64| {
        for x in [&mut l.beta, &mut l.p, &mut l.r, &mut l.aileron, &mut l.rudder] {
            *x *= factor(aerodynamics);
        }
    };
    for x in [&mut a.lift.alpha, &mut a.lift.pitch_rate, &mut a.lift.elevator, &mut a.parasitic] {
        *x *= factor(aerodynamics);
    }
    for x in [&mut a.pitch.alpha, &mut a.pitch.pitch_rate, &mut a.pitch.elevator] {
        *x *= factor(aerodynamics);
    }
    for part in [&mut a.side, &mut a.roll, &mut a.yaw] {
        lateral(part, factor);
    }
    airplane.mass *= factor(mass);
    let i = &mut airplane.inertia;
    for x in [&mut i.xx, &mut i.yy, &mut i.zz, &mut i.xz] {
        *x *= factor(inertia);
    }
    for actuator in airplane.actuators.iter_mut().flatten() {
        actuator.frequency *= factor(servo).max(0.1);
        actuator.damping *= factor(servo).max(0.1);
    }
}

/// Share and its 95 % interval.
fn wilson(count: usize, of: usize) -> (f64, [f64; 2]) {
    if of == 0 {
        return (f64::NAN, [0.0, 1.0]);
    }
    let (n, z) = (of as f64, NORMAL_95);
    let p = count as f64 / n;
    let middle = (p + z * z / (2.0 * n)) / (1.0 + z * z / n);
    let half = z / (1.0 + z * z / n) * (p * (1.0 - p) / n + z * z / (4.0 * n * n)).sqrt();
    (p, [(middle - half).max(0.0), (middle + half).min(1.0)])
}
