//! The `airplane.json` document, aerodynamics, propulsion and trim (floor 2).
//!
//! [`Airplane`] is an airplane in SI; what it feels in moving air is [`Airplane::forces`], a pure function of the state
//! of the air, the controls and the density.

mod aerodynamics;
pub mod check;
mod document;
pub mod levels;
pub mod linear;
pub mod modes;
mod propulsion;
mod schema;
pub mod trim;

pub use aerodynamics::{Aerodynamics, Drag, Lateral, Lift, Pitch, Stall};
pub use propulsion::{Curve, Motor, Propulsion, Running};
pub use schema::AirplaneDocument;

/// Velocity (m/s) and rate (rad/s) against the air, body axes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AirState {
    pub velocity: [f64; 3],
    pub rate: [f64; 3],
}

/// Where surfaces (rad) and throttle stand. An airplane whose propulsion is a thrust has it, in N, in place of the
/// throttle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Controls {
    pub elevator: f64,
    pub aileron: f64,
    pub rudder: f64,
    pub throttle: f64,
}

/// Force (N) and moment about the centre of gravity (N m), body axes, gravity left out.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Wrench {
    pub force: [f64; 3],
    pub moment: [f64; 3],
}

/// Moments of inertia about the centre of gravity, kg m². `xz` is the integral ∫xz dm, so that the matrix is [xx 0 −xz;
/// 0 yy 0; −xz 0 zz].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Inertia {
    pub xx: f64,
    pub yy: f64,
    pub zz: f64,
    pub xz: f64,
}

impl Inertia {
    /// Ascending; the y axis is one of theirs.
    pub fn principal_moments(&self) -> [f64; 3] {
        let (mean, half) = (0.5 * (self.xx + self.zz), (0.5 * (self.xx - self.zz)).hypot(self.xz));
        let mut moments = [mean - half, self.yy, mean + half];
        moments.sort_by(f64::total_cmp);
        moments
    }
}

/// Wing area (m²), span and mean chord (m).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Size {
    pub area: f64,
    pub span: f64,
    pub chord: f64,
}

/// A servo of second order; angles in rad.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Actuator {
    /// rad/s.
    pub frequency: f64,
    pub damping: f64,
    /// Stops, lower and upper.
    pub travel: [f64; 2],
    /// rad/s; infinite for none.
    pub rate_limit: f64,
    /// From the command to the servo, s.
    pub delay: f64,
}

/// An airplane in SI.
#[derive(Clone, Debug, PartialEq)]
pub struct Airplane {
    pub name: String,
    pub mass: f64,
    pub inertia: Inertia,
    pub size: Size,
    pub aerodynamics: Aerodynamics,
    pub propulsion: Propulsion,
    /// Of elevator, aileron, rudder; a surface without one stands where it is told at once.
    pub actuators: [Option<Actuator>; 3],
    /// Where sensors are, from the centre of gravity in body axes, m, by name.
    pub positions: Vec<(String, [f64; 3])>,
}

impl Airplane {
    /// What it feels in air of a density (kg/m³).
    #[inline(always)]
    pub fn forces(&self, air: &AirState, controls: &Controls, density: f64) -> Wrench {
        let [u, v, w] = air.velocity;
        let speed = (u * u + v * v + w * w).sqrt();
        let mut wrench = self.aerodynamics.forces(&self.size, air, speed, controls, density);
        let (thrust, reaction) = self.propulsion.thrust_and_reaction(controls.throttle, speed, density);
        wrench.force[0] += thrust;
        wrench.moment[0] -= reaction;
        wrench
    }

    /// Where a sensor is; at the centre of gravity when the document does not say.
    pub fn position(&self, sensor: &str) -> [f64; 3] {
        self.positions.iter().find(|(name, _)| name == sensor).map_or([0.0; 3], |(_, at)| *at)
    }
}
