//! A filter whose wideband noise is found anew as the log goes on: an adaptive filter. What it does at a sample
//! depends on earlier ones alone.

use std::collections::VecDeque;

use nalgebra::DMatrix;
use schemars::JsonSchema;
use serde::Serialize;

use crate::filter::AxisDesign;
use crate::identify::{FEWEST_SAMPLES, Followed, Follower};
use crate::model::{InitialBias, LinearModel, sensor_errors};
use crate::units::{Quantity, Unit, digits};

/// The noise is looked for so often within its memory …
const TIMES: usize = 16;
/// … but not more often than every [`FEWEST_SAMPLES`]. Shortest memory:
const SHORTEST: usize = 4 * FEWEST_SAMPLES;
/// Relative difference of matrices that count as the same.
const SAME: f64 = 1e-6;

/// How the noise was followed.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct FollowResult {
    /// Of so many seconds.
    pub memory_s: f64,
    /// Looked for at this distance.
    pub every_s: f64,
    /// How often new parameters were taken.
    pub changes: u64,
    /// As designed and at the end of the log.
    pub parameters: Vec<Followed>,
}

/// One axis.
#[derive(Clone, Debug)]
pub(super) struct Following {
    follower: Follower,
    /// The last samples.
    window: VecDeque<f64>,
    /// Samples.
    memory: usize,
    every: usize,
    /// Samples until the next look.
    left: usize,
    changes: u64,
    quantity: Quantity,
    /// As designed, and the same processes built alone.
    model: LinearModel,
    built: LinearModel,
    /// Where each state of `built` is in `model`.
    places: Vec<Option<usize>>,
}

impl Following {
    /// Errors: a sentence that says why the design cannot be followed.
    pub(super) fn new(design: &AxisDesign, quantity: Quantity, memory_s: f64) -> Result<Following, String> {
        let dt = design.model.dt;
        let memory = (memory_s / dt).round() as usize;
        if memory < SHORTEST {
            let shortest = digits(SHORTEST as f64 * dt);
            return Err(format!("{memory} samples say too little of its noise; give at least {shortest} s"));
        }
        let other = "its matrices are not those of its noise terms, as tune writes them";
        if design.model.every != [1] || !design.model.inputs.is_empty() {
            return Err(other.into());
        }
        let follower = Follower::new(&design.noise.noise(), dt, memory);
        let built = build(&follower, false, quantity, dt).ok_or(other)?;
        let moved = build(&follower, true, quantity, dt).ok_or(other)?;
        let model = design.model.clone();
        let place = |name: &str| model.states.iter().position(|state| state.name == name);
        let places: Vec<Option<usize>> = built.states.iter().map(|state| place(&state.name)).collect();
        if !holds(&model, &built, &moved, &places) {
            return Err(other.into());
        }
        let every = memory.div_ceil(TIMES).max(FEWEST_SAMPLES);
        let window = VecDeque::new();
        Ok(Following { follower, window, memory, every, left: every, changes: 0, quantity, model, built, places })
    }

    /// The next sample (what the filter expected where there is none that can be used). The model from here on,
    /// where it changes.
    pub(super) fn take(&mut self, value: f64) -> Option<LinearModel> {
        if self.window.len() == self.memory {
            self.window.pop_front();
        }
        self.window.push_back(value);
        self.left -= 1;
        if self.left > 0 {
            return None;
        }
        self.left = self.every;
        if !self.follower.follow(self.window.make_contiguous()) {
            return None;
        }
        let model = self.changed()?;
        self.changes += 1;
        Some(model)
    }

    /// After a gap the window begins anew.
    pub(super) fn interrupt(&mut self) {
        self.window.clear();
    }

    /// The design with what is new of its noise.
    fn changed(&self) -> Option<LinearModel> {
        let new = build(&self.follower, false, self.quantity, self.model.dt)?;
        let mut model = self.model.clone();
        for (i, a) in self.places.iter().enumerate() {
            for (k, b) in self.places.iter().enumerate() {
                let Some(place) = a.zip(*b) else { continue };
                for (own, new, built) in [(&mut model.f, &new.f, &self.built.f), (&mut model.q, &new.q, &self.built.q)]
                {
                    if new[(i, k)] != built[(i, k)] {
                        own[place] = new[(i, k)];
                    }
                }
            }
        }
        for (i, place) in self.places.iter().enumerate() {
            if let Some(place) = place.filter(|_| new.h[(0, i)] != self.built.h[(0, i)]) {
                model.h[(0, place)] = new.h[(0, i)];
            }
        }
        model.r[(0, 0)] += new.r[(0, 0)] - self.built.r[(0, 0)];
        Some(model)
    }

    pub(super) fn result(&self) -> FollowResult {
        let dt = self.model.dt;
        let unit = Unit::parse(self.quantity.si_unit()).unwrap_or_else(|_| Unit::one());
        FollowResult {
            memory_s: self.memory as f64 * dt,
            every_s: self.every as f64 * dt,
            changes: self.changes,
            parameters: self.follower.parameters(&unit),
        }
    }
}

/// The processes alone, as they are now or nudged.
fn build(follower: &Follower, nudged: bool, quantity: Quantity, dt: f64) -> Option<LinearModel> {
    let noise = if nudged { follower.nudged() } else { follower.noise() };
    // a model needs a state: for white noise alone one that is zero; without flicker the horizon says nothing
    sensor_errors(quantity, &noise, Some(InitialBias { mean: 0.0, std_dev: 0.0 }), dt, 1.0).ok()
}

/// Whether what `moved` has otherwise than `built` is in `model` as in `built`; `places`: of the states of these in
/// `model`.
fn holds(model: &LinearModel, built: &LinearModel, moved: &LinearModel, places: &[Option<usize>]) -> bool {
    let same = |own: f64, built: f64| (own - built).abs() <= SAME * built.abs();
    let pairs = || (0..places.len()).flat_map(|i| (0..places.len()).map(move |k| (i, k)));
    let matrices = [(&model.f, &built.f, &moved.f), (&model.q, &built.q, &moved.q)];
    let seen = |i: usize| places[i].is_some_and(|place| same(model.h[(0, place)], built.h[(0, i)]));
    let belongs = |own: &DMatrix<f64>, built_part: &DMatrix<f64>, (i, k): (usize, usize)| {
        let place = places[i].zip(places[k]);
        place.is_some_and(|place| same(own[place], built_part[(i, k)])) && seen(i)
    };
    // flicker faster than the log is part of R, so it may be larger
    model.r[(0, 0)] >= built.r[(0, 0)] * (1.0 - SAME)
        && (0..places.len()).filter(|i| moved.h[(0, *i)] != built.h[(0, *i)]).all(seen)
        && matrices.iter().all(|(own, built, moved)| {
            pairs().filter(|pair| moved[*pair] != built[*pair]).all(|pair| belongs(own, built, pair))
        })
}
