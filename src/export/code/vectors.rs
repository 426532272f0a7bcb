//! What the self-test of the generated code is held against: our own filter on measurements drawn from its own
//! prediction.

use serde::Serialize;

use super::names::number;
use super::{Code, Gain, Precision};
use crate::filter::innovations::nearest_turn;
use crate::filter::kalman::Update;
use crate::filter::{AxisDesign, ConstantGain, Kalman};
use crate::numerics::random::{StreamId, normal, stream};

const STEPS: usize = 40;
/// Nothing is measured from the one to the other.
const PAUSE: std::ops::Range<usize> = 20..25;
/// One measurement is this far out, in sigmas, and so beyond the gate.
const FAR: f64 = 20.0;
const GATE: f64 = 10.0;
const SEED: u64 = 7;

/// A run of the filter.
#[derive(Serialize)]
pub(super) struct Vectors {
    steps: usize,
    gate: String,
    /// Inputs of every step.
    inputs: Vec<Vec<String>>,
    updates: Vec<Expected>,
    /// At the end.
    states: Vec<String>,
    states_allowed: Vec<String>,
    variances: Vec<String>,
}

#[derive(Serialize)]
struct Expected {
    step: usize,
    measurement: usize,
    z: String,
    innovation: String,
    /// How far the innovation may be off.
    allowed: String,
    variance: String,
    accepted: bool,
}

/// Either form.
#[derive(Clone)]
enum Reference {
    Full(Box<Kalman>),
    Constant(Box<ConstantGain>),
}

impl Reference {
    fn predict(&mut self, input: &[f64]) {
        match self {
            Reference::Full(kalman) => {
                kalman.predict();
                kalman.drive(input);
            }
            Reference::Constant(constant) => {
                constant.advance(1, None);
                constant.drive(input);
            }
        }
    }

    fn update(&mut self, index: usize, z: f64) -> Update {
        match self {
            Reference::Full(kalman) => kalman.update(index, z, Some(GATE)),
            Reference::Constant(constant) => constant.update(index, z, Some(GATE)),
        }
    }

    fn state(&self, i: usize) -> f64 {
        match self {
            Reference::Full(kalman) => kalman.x[i],
            Reference::Constant(constant) => constant.x()[i],
        }
    }

    fn variance(&self, i: usize) -> f64 {
        match self {
            Reference::Full(kalman) => kalman.p[(i, i)],
            Reference::Constant(constant) => constant.p()[(i, i)],
        }
    }
}

/// Measurements that are seldom are taken every third sample here, so that there are several; those of the generated
/// code may come at any sample.
pub(super) fn vectors(axis: &AxisDesign, code: &Code) -> Vectors {
    let model = &axis.model;
    let float = code.precision == Precision::Float;
    // the code must get the very numbers that our filter gets
    let held = |value: f64| if float { f64::from(value as f32) } else { value };
    let mut reference = match code.gain {
        Gain::Full => Reference::Full(Box::new(Kalman::new(model))),
        Gain::Constant => Reference::Constant(Box::new(ConstantGain::new(model, &axis.steady_state))),
    };
    let tolerance = code.precision.tolerance();
    let mut rng = stream(SEED, StreamId { run: 0, axis: 0, term: 0 });
    let (mut inputs, mut updates) = (Vec::new(), Vec::new());
    for step in 0..STEPS {
        if step > 0 {
            let input: Vec<f64> = model.inputs.iter().map(|_| held(0.1 * normal(&mut rng))).collect();
            reference.predict(&input);
            inputs.push(input.iter().map(|u| number(*u, float)).collect());
        }
        for (index, every) in model.every.iter().enumerate() {
            if PAUSE.contains(&step) || !step.is_multiple_of((*every).min(3)) {
                continue;
            }
            let expected: f64 = (0..model.states.len()).map(|i| model.h[(index, i)] * reference.state(i)).sum();
            // a measurement as expected tells S
            let sigma = reference.clone().update(index, expected).variance.sqrt();
            let sigmas = if step == STEPS / 2 + 10 && index == 0 { FAR } else { normal(&mut rng) };
            let z = held(expected + sigma * sigmas);
            let near = if model.measurements[index].unit == "rad" { nearest_turn(z, expected) } else { z };
            let update = reference.update(index, near);
            updates.push(Expected {
                step,
                measurement: index,
                z: number(z, float),
                innovation: number(update.innovation, float),
                allowed: number(tolerance * (z.abs() + sigma), float),
                variance: number(update.variance, float),
                accepted: update.accepted,
            });
        }
    }
    let all = |of: &dyn Fn(usize) -> f64| (0..model.states.len()).map(|i| number(of(i), float)).collect();
    Vectors {
        steps: STEPS,
        gate: number(GATE, float),
        inputs,
        updates,
        states: all(&|i| reference.state(i)),
        states_allowed: all(&|i| tolerance * (reference.state(i).abs() + reference.variance(i).max(0.0).sqrt())),
        variances: all(&|i| reference.variance(i)),
    }
}
