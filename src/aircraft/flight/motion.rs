//! Six degrees of freedom: the state, its derivative over either earth, and a step of it.
//!
//! With V the velocity relative to the earth and ω the rate relative to inertial space, both in body axes, C from body
//! to the axes of the position r and ωe the rate of the earth:
//!
//! V̇ = F/m + Cᵀ[g_N(r) − ωe×(ωe×r)] − (ω + Cᵀωe)×V,  ṙ = C V,  q̇ = ½ q∘(ω − Cᵀωe),  J ω̇ = M − ω×(J ω).
//!
//! Over the flat earth ωe = 0 and gravity is constant. The airplane feels V less the wind and the gust, and the rate
//! relative to the earth less the gust's, for the air turns with the earth. Source: Stevens, Lewis and Johnson 2016,
//! sections 1.5 and 1.6.

use super::earth::Earth;
use super::vector::{Vector, back, cross, dot, matrix, minus, plus, times};
use crate::aircraft::airframe::{AirState, Airplane, Controls};
use crate::aircraft::atmosphere::Gust;
use crate::aircraft::atmosphere::standard::DensityNear;

/// Position 0–2, velocity 3–5, attitude 6–9, inertial rate 10–12, way through the air 13.
pub(super) type State = [f64; STATES];
const STATES: usize = 14;

/// What does not change in a flight.
#[derive(Clone, Copy, Debug)]
pub(super) struct World<'a> {
    pub airplane: &'a Airplane,
    pub earth: Earth,
    /// Velocity of the air over the ground, north, east, down, m/s.
    pub wind: Vector,
    /// Of the mass, 1/kg, and of the inertia.
    per_mass: f64,
    inverse_inertia: [f64; 4],
}

/// Everything of an instant that sensors or rows need, besides the state.
#[derive(Clone, Copy, Debug)]
pub(super) struct Instant {
    pub derivative: State,
    /// Aerodynamics and propulsion over mass, body axes: what an accelerometer at the centre of gravity shows.
    pub specific_force: Vector,
    /// Relative to the earth.
    pub rate: Vector,
    /// Relative to the air with its gusts.
    pub air: AirState,
    /// Geometric.
    pub height: f64,
}

#[inline(always)]
pub(super) fn position(x: &State) -> Vector {
    [x[0], x[1], x[2]]
}

#[inline(always)]
pub(super) fn velocity(x: &State) -> Vector {
    [x[3], x[4], x[5]]
}

#[inline(always)]
pub(super) fn attitude(x: &State) -> [f64; 4] {
    [x[6], x[7], x[8], x[9]]
}

/// Relative to inertial space.
#[inline(always)]
pub(super) fn inertial_rate(x: &State) -> Vector {
    [x[10], x[11], x[12]]
}

impl<'a> World<'a> {
    pub(super) fn new(airplane: &'a Airplane, earth: Earth, wind: Vector) -> World<'a> {
        World { airplane, earth, wind, per_mass: 1.0 / airplane.mass, inverse_inertia: airplane.inertia.inverse() }
    }

    /// Velocity through the steady air, body axes.
    pub(super) fn through_air(&self, x: &State) -> Vector {
        let wind = back(&matrix(attitude(x)), self.earth.of_local(position(x), self.wind));
        minus(velocity(x), wind)
    }

    /// `density`: about a height near by.
    #[inline(always)]
    pub(super) fn instant(&self, x: &State, controls: &Controls, gust: &Gust, density: &DensityNear) -> Instant {
        let (v, e) = (velocity(x), attitude(x));
        let c = matrix(e);
        let field = self.earth.field(position(x), &c);
        let inertial = inertial_rate(x);
        let rate = minus(inertial, field.rate);
        let wind = if self.wind == [0.0; 3] { [0.0; 3] } else { back(&c, self.earth.of_local(position(x), self.wind)) };
        let through_air = minus(minus(v, wind), gust.velocity);
        let air = AirState { velocity: through_air, rate: minus(rate, gust.rate) };
        let wrench = self.airplane.forces(&air, controls, density.at(field.height));
        let specific_force = wrench.force.map(|f| f * self.per_mass);
        let accelerated = plus(plus(specific_force, field.gravity), cross(v, plus(inertial, field.rate)));
        let turned = self.airplane.inertia.acceleration(&self.inverse_inertia, wrench.moment, inertial);
        let moved = times(&c, v);
        let [e0, e1, e2, e3] = e;
        let [p, q, r] = rate;
        let derivative = [
            moved[0],
            moved[1],
            moved[2],
            accelerated[0],
            accelerated[1],
            accelerated[2],
            0.5 * (-p * e1 - q * e2 - r * e3),
            0.5 * (p * e0 + r * e2 - q * e3),
            0.5 * (q * e0 - r * e1 + p * e3),
            0.5 * (r * e0 + q * e1 - p * e2),
            turned[0],
            turned[1],
            turned[2],
            // through the air at large: gusts lie along this way
            norm(minus(v, wind)),
        ];
        Instant { derivative, specific_force, rate, air, height: field.height }
    }
}

#[inline(always)]
fn norm(v: Vector) -> f64 {
    dot(v, v).sqrt()
}

/// What moves an airplane: its derivative at a part of a step.
pub(super) trait Rate {
    /// At the beginning, the middle or the end of the step (0, 1, 2).
    fn rate(&self, part: usize, x: &State) -> State;
}

/// One step of the classical Runge–Kutta method (order 4). The quaternion is made a unit one again. `first`: the
/// derivative at the beginning, where it is known.
#[inline(always)]
pub(super) fn step(x: &State, h: f64, first: Option<State>, of: &impl Rate) -> State {
    let ahead = |by: f64, k: &State| -> State { std::array::from_fn(|i| x[i] + by * k[i]) };
    let a = first.unwrap_or_else(|| of.rate(0, x));
    let b = of.rate(1, &ahead(0.5 * h, &a));
    let c = of.rate(1, &ahead(0.5 * h, &b));
    let d = of.rate(2, &ahead(h, &c));
    let mut next: State = std::array::from_fn(|i| x[i] + h / 6.0 * (a[i] + 2.0 * (b[i] + c[i]) + d[i]));
    let per_length = 1.0 / next[6..10].iter().map(|e| e * e).sum::<f64>().sqrt();
    next[6..10].iter_mut().for_each(|e| *e *= per_length);
    next
}
