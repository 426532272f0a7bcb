//! Six degrees of freedom: the state, its derivative over either earth, and a step of it.
//!
//! With V the velocity relative to the earth and ω the rate relative to inertial space, both in body axes, C from body to the axes of the position r and ωe
//! the rate of the earth:
//!
//! V̇ = F/m + Cᵀ[g_N(r) − ωe×(ωe×r)] − (ω + Cᵀωe)×V,  ṙ = C V,  q̇ = ½ q∘(ω − Cᵀωe),  J ω̇ = M − ω×(J ω).
//!
//! Over the flat earth ωe = 0 and gravity is constant. The airplane feels V less the wind and the gust, and the rate relative to the earth less the gust's,
//! for the air turns with the earth. Source: Stevens, Lewis and Johnson 2016, sections 1.5 and 1.6.

use super::earth::Earth;
use super::vector::{Vector, back, cross, dot, matrix, minus, plus, times};
use crate::aircraft::airframe::{AirState, Airplane, Controls};
use crate::aircraft::atmosphere::{AirError, Gust, standard};

/// Position 0–2, velocity 3–5, attitude 6–9, inertial rate 10–12, way through the air 13.
pub(super) type State = [f64; 14];

/// What does not change in a flight.
#[derive(Clone, Copy, Debug)]
pub(super) struct World<'a> {
    pub airplane: &'a Airplane,
    pub earth: Earth,
    /// Velocity of the air over the ground, north, east, down, m/s.
    pub wind: Vector,
    /// The inverse of the inertia, by rows.
    pub inverse_inertia: [[f64; 3]; 3],
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
    pub airspeed: f64,
    /// Geometric.
    pub height: f64,
}

pub(super) fn position(x: &State) -> Vector {
    [x[0], x[1], x[2]]
}

pub(super) fn velocity(x: &State) -> Vector {
    [x[3], x[4], x[5]]
}

pub(super) fn attitude(x: &State) -> [f64; 4] {
    [x[6], x[7], x[8], x[9]]
}

/// Relative to inertial space.
pub(super) fn inertial_rate(x: &State) -> Vector {
    [x[10], x[11], x[12]]
}

impl<'a> World<'a> {
    pub(super) fn new(airplane: &'a Airplane, earth: Earth, wind: Vector) -> World<'a> {
        let i = airplane.inertia;
        // rows of J⁻¹ with J = [xx 0 −xz; 0 yy 0; −xz 0 zz]
        let determinant = i.xx * i.zz - i.xz * i.xz;
        let inverse_inertia = [
            [i.zz / determinant, 0.0, i.xz / determinant],
            [0.0, 1.0 / i.yy, 0.0],
            [i.xz / determinant, 0.0, i.xx / determinant],
        ];
        World { airplane, earth, wind, inverse_inertia }
    }

    /// The angular momentum J ω.
    fn momentum(&self, [p, q, r]: Vector) -> Vector {
        let i = self.airplane.inertia;
        [i.xx * p - i.xz * r, i.yy * q, i.zz * r - i.xz * p]
    }

    /// Errors: the height is outside the standard atmosphere.
    pub(super) fn instant(&self, x: &State, controls: &Controls, gust: &Gust) -> Result<Instant, AirError> {
        let (v, e) = (velocity(x), attitude(x));
        let c = matrix(e);
        let field = self.earth.field(position(x));
        let inertial = inertial_rate(x);
        let earth_rate = back(&c, field.rate);
        let rate = minus(inertial, earth_rate);
        let wind = if self.wind == [0.0; 3] { [0.0; 3] } else { back(&c, self.earth.of_local(position(x), self.wind)) };
        let through_air = minus(minus(v, wind), gust.velocity);
        let air = AirState { velocity: through_air, rate: minus(rate, gust.rate) };
        let wrench = self.airplane.forces(&air, controls, standard::at(field.height)?.density);
        let specific_force = wrench.force.map(|f| f / self.airplane.mass);
        let accelerated = plus(plus(specific_force, back(&c, field.gravity)), cross(v, plus(inertial, earth_rate)));
        let turned = times(&self.inverse_inertia, plus(wrench.moment, cross(self.momentum(inertial), inertial)));
        let moved = times(&c, v);
        let [e0, e1, e2, e3] = e;
        let [p, q, r] = rate;
        let airspeed = dot(through_air, through_air).sqrt();
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
            if gust.velocity == [0.0; 3] { airspeed } else { norm(minus(v, wind)) },
        ];
        Ok(Instant { derivative, specific_force, rate, airspeed, height: field.height })
    }
}

fn norm(v: Vector) -> f64 {
    dot(v, v).sqrt()
}

/// One step of the classical Runge–Kutta method (order 4): `rate` is the derivative at a part of the step (0, ½ or 1) and a state. The quaternion is made a
/// unit one again.
pub(super) fn step<E>(x: &State, h: f64, rate: impl Fn(usize, &State) -> Result<State, E>) -> Result<State, E> {
    let ahead = |k: &State, by: f64| -> State { std::array::from_fn(|i| x[i] + by * k[i]) };
    let k1 = rate(0, x)?;
    let k2 = rate(1, &ahead(&k1, 0.5 * h))?;
    let k3 = rate(1, &ahead(&k2, 0.5 * h))?;
    let k4 = rate(2, &ahead(&k3, h))?;
    let mut next: State = std::array::from_fn(|i| x[i] + h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]));
    let length = next[6..10].iter().map(|e| e * e).sum::<f64>().sqrt();
    next[6..10].iter_mut().for_each(|e| *e /= length);
    Ok(next)
}
