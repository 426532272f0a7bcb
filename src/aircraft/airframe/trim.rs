//! Steady flight: straight, climbing or turning, over the flat earth in still air.
//!
//! Eight unknowns α, β, φ, θ, δe, δa, δr, δt; p = −ψ̇ sin θ, q = ψ̇ sin φ cos θ, r = ψ̇ cos φ cos θ. Eight equations:
//! the six accelerations vanish, ḣ = V sin γ, and one on the sideways motion. Newton's method from the angles of a
//! point mass; `numerics::optimize` has no systems of equations.

use std::f64::consts::FRAC_PI_2;

use nalgebra::{SMatrix, SVector};

use super::{AirState, Airplane, Controls};
use crate::aircraft::atmosphere::standard;

/// What fixes the sideways motion.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Sideways {
    #[default]
    ZeroSideslip,
    /// The ball is centred.
    ZeroSideForce,
    WingsLevel,
}

impl Sideways {
    /// As in documents and flags.
    pub const NAMES: [&'static str; 3] = ["zero_sideslip", "zero_side_force", "wings_level"];

    pub fn named(name: &str) -> Option<Sideways> {
        let all = [Sideways::ZeroSideslip, Sideways::ZeroSideForce, Sideways::WingsLevel];
        Self::NAMES.iter().position(|known| *known == name).map(|i| all[i])
    }
}

/// How the airplane turns.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Turn {
    /// rad/s, positive to the right.
    Rate(f64),
    /// Angle of bank φ, rad; the rate of the turn follows.
    Bank(f64),
}

/// SI.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrimRequest {
    pub airspeed: f64,
    /// Geometric.
    pub altitude: f64,
    /// Angle of the path, positive up.
    pub climb: f64,
    pub turn: Turn,
    pub sideways: Sideways,
}

/// A steady flight that was found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trim {
    pub alpha: f64,
    pub beta: f64,
    pub phi: f64,
    pub theta: f64,
    /// u, v, w.
    pub velocity: [f64; 3],
    /// p, q, r.
    pub rate: [f64; 3],
    pub turn_rate: f64,
    pub controls: Controls,
    pub density: f64,
    /// Largest of the equations that should vanish, in m/s², rad/s² and m/s.
    pub residual: f64,
}

/// A flight that is not possible, by what is missing.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{message}")]
pub struct TrimError {
    /// "lift", "elevator", "aileron", "rudder", "thrust", "brake"; "solution" when Newton's method finds none,
    /// "request" when it asks for what is nothing.
    pub missing: &'static str,
    pub message: String,
}

impl TrimError {
    pub(super) fn new(missing: &'static str, message: impl Into<String>) -> TrimError {
        TrimError { missing, message: message.into() }
    }
}

type Unknowns = SVector<f64, 8>;

/// What remains, m/s² or rad/s², where the controls are those of the flight asked for, to as many digits as a message
/// shows.
const SOLVED: f64 = 1e-6;

impl Airplane {
    /// ```
    /// use kfdesign::aircraft::airframe::Airplane;
    /// use kfdesign::aircraft::airframe::trim::{Sideways, TrimRequest, Turn};
    ///
    /// let airplane = Airplane::read("data/airplanes/aerosonde.json".as_ref())?;
    /// let sideways = Sideways::ZeroSideslip;
    /// let level = TrimRequest { airspeed: 25.0, altitude: 100.0, climb: 0.0, turn: Turn::Rate(0.0), sideways };
    /// let trim = airplane.trim(&level)?;
    /// assert!((trim.alpha - 0.053874).abs() < 1e-6);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// Errors: outside the standard atmosphere, or lift, elevator, thrust or another control does not suffice.
    pub fn trim(&self, request: &TrimRequest) -> Result<Trim, TrimError> {
        let air = standard::at(request.altitude).map_err(|e| TrimError::new("request", e.to_string()))?;
        let speed = request.airspeed;
        if !(speed > 0.0 && speed.is_finite()) {
            return Err(TrimError::new("request", format!("airspeed {speed} m/s: expected a positive speed")));
        }
        let g = standard::GRAVITY;
        // of a point mass
        let (bank, turn_rate) = match request.turn {
            Turn::Rate(rate) => ((speed * request.climb.cos() * rate / g).atan(), rate),
            Turn::Bank(bank) => (bank, g * bank.tan() / (speed * request.climb.cos())),
        };
        if let (Sideways::WingsLevel, Turn::Bank(_)) = (request.sideways, request.turn) {
            return Err(TrimError::new(
                "request",
                "wings_level and a bank ask for two angles of bank: give a turn rate instead",
            ));
        }
        let pressure = 0.5 * air.density * speed * speed * self.size.area;
        let needed = self.mass * g * request.climb.cos() / (pressure * bank.cos());
        let lift = &self.aerodynamics.lift;
        // wing and elevator do not carry the airplane: said where thrust cannot make up for it, or no steady flight is
        // found
        let mut too_slow = None;
        if let Some(stall) = self.aerodynamics.stall {
            let greatest = |elevator: &dyn Fn(f64) -> f64| {
                let angles = (0..200).map(|i| stall.angle * f64::from(i) / 150.0);
                angles.map(|a| self.aerodynamics.lift_and_drag(a, 0.0, elevator(a)).0).fold(0.0, f64::max)
            };
            let (wing, most) = (greatest(&|_| 0.0), greatest(&|alpha| self.balancing(alpha)));
            // a wing near its stall is helped by the part of the thrust that points up
            let thrust = self.propulsion.running(self.propulsion.greatest(), speed, air.density).thrust;
            let turn = match bank {
                0.0 => String::new(),
                bank => format!(" in a turn of {:.1} deg bank", bank.to_degrees()),
            };
            let error = TrimError::new(
                "lift",
                format!(
                    "no lift: {speed} m/s{turn} needs a lift coefficient of {needed:.2}, it stalls at {most:.2}; \
                     fly faster or turn less"
                ),
            );
            if needed > wing.max(most) + (thrust * (stall.angle + request.climb).sin() / pressure).max(0.0) {
                return Err(error);
            }
            too_slow = (needed > most).then_some(error);
        }
        let alpha = (needed - lift.zero) / lift.alpha;
        let turn = match request.turn {
            Turn::Rate(_) => bank,
            Turn::Bank(_) => turn_rate,
        };
        let most = self.propulsion.greatest().min(2.0 * self.mass * g);
        // half the throttle may lie where a propeller is turned by the air and gives the same thrust at any: then once
        // more from full
        let mut found = (Unknowns::zeros(), f64::INFINITY);
        for share in [0.5, 1.0] {
            let start = [alpha, 0.0, turn, alpha + request.climb, 0.0, 0.0, 0.0, share * most];
            let (x, r) = self.newton(start.into(), request, air.density);
            if r < found.1 {
                found = (x, r);
            }
            if r < SOLVED {
                break;
            }
        }
        let (x, r) = found;
        match too_slow {
            Some(error) if r >= SOLVED || self.aerodynamics.stall.is_some_and(|stall| x[0] >= stall.angle) => {
                Err(error)
            }
            _ => {
                let drag = pressure * self.aerodynamics.lift_and_drag(alpha, 0.0, 0.0).1;
                self.judge(&x, r, drag + self.mass * g * request.climb.sin(), request, air.density)
            }
        }
    }

    /// The elevator (rad), within its stops, that balances the pitching moment without rotation.
    fn balancing(&self, alpha: f64) -> f64 {
        let pitch = &self.aerodynamics.pitch;
        let [least, greatest] = self.actuators[0].map_or([-FRAC_PI_2, FRAC_PI_2], |actuator| actuator.travel);
        if pitch.elevator == 0.0 {
            return 0.0;
        }
        (-(pitch.zero + pitch.alpha * alpha) / pitch.elevator).clamp(least, greatest)
    }

    /// From a start to where no step of Newton's method makes it better, and what remains there.
    fn newton(&self, mut x: Unknowns, request: &TrimRequest, density: f64) -> (Unknowns, f64) {
        let residual = |x: &Unknowns| self.lacks(x, request, density);
        let mut r = residual(&x);
        for _ in 0..100 {
            let mut jacobian = SMatrix::<f64, 8, 8>::zeros();
            for j in 0..8 {
                // central differences: the error of a step of 1e-5 is far below what the last Newton steps need
                let by = 1e-5 * x[j].abs().max(0.1);
                let (mut ahead, mut behind) = (x, x);
                ahead[j] += by;
                behind[j] -= by;
                jacobian.set_column(j, &((residual(&ahead) - residual(&behind)) / (2.0 * by)));
            }
            let Some(step) = jacobian.lu().solve(&r) else { break };
            let better = |after: &Unknowns| after.norm() < r.norm();
            let mut part = 1.0;
            let mut next = x - step;
            let mut after = residual(&next);
            while !better(&after) && part > 1e-4 {
                part *= 0.5;
                next = x - step * part;
                after = residual(&next);
            }
            if !better(&after) {
                break;
            }
            (x, r) = (next, after);
        }
        (x, r.amax())
    }

    /// u̇ v̇ ẇ ṗ q̇ ṙ, climb and the sideways condition at a set of unknowns.
    fn lacks(&self, x: &Unknowns, request: &TrimRequest, density: f64) -> Unknowns {
        let trim = self.state(x, request, density);
        let wrench = self.forces(&AirState { velocity: trim.velocity, rate: trim.rate }, &trim.controls, density);
        let ([u, v, w], [p, q, r]) = (trim.velocity, trim.rate);
        let ((sf, cf), (st, ct)) = (trim.phi.sin_cos(), trim.theta.sin_cos());
        let g = standard::GRAVITY;
        let f = wrench.force.map(|f| f / self.mass);
        let [p_dot, q_dot, r_dot] = self.inertia.acceleration(&self.inertia.inverse(), wrench.moment, trim.rate);
        let climb = u * st - v * sf * ct - w * cf * ct;
        Unknowns::from([
            f[0] - g * st - (q * w - r * v),
            f[1] + g * sf * ct - (r * u - p * w),
            f[2] + g * cf * ct - (p * v - q * u),
            p_dot,
            q_dot,
            r_dot,
            climb - request.airspeed * request.climb.sin(),
            match request.sideways {
                Sideways::ZeroSideslip => trim.beta,
                Sideways::ZeroSideForce => f[1],
                Sideways::WingsLevel => trim.phi,
            },
        ])
    }

    /// The unknowns are α, β, the bank (or the turn rate, when the bank is given), θ, elevator, aileron, rudder,
    /// throttle.
    fn state(&self, x: &Unknowns, request: &TrimRequest, density: f64) -> Trim {
        let [alpha, beta, turn, theta, elevator, aileron, rudder, throttle] = (*x).into();
        let (phi, turn_rate) = match request.turn {
            Turn::Rate(rate) => (turn, rate),
            Turn::Bank(bank) => (bank, turn),
        };
        let speed = request.airspeed;
        let ((sa, ca), (sb, cb)) = (alpha.sin_cos(), beta.sin_cos());
        let ((sf, cf), (st, ct)) = (phi.sin_cos(), theta.sin_cos());
        Trim {
            alpha,
            beta,
            phi,
            theta,
            velocity: [speed * ca * cb, speed * sb, speed * sa * cb],
            rate: [-turn_rate * st, turn_rate * sf * ct, turn_rate * cf * ct],
            turn_rate,
            controls: Controls { elevator, aileron, rudder, throttle },
            density,
            residual: 0.0,
        }
    }

    /// The solution, if the controls reach it. `wanted`: the thrust of a point mass, N, which says what is missing
    /// where there is no solution.
    fn judge(
        &self,
        x: &Unknowns,
        residual: f64,
        wanted: f64,
        request: &TrimRequest,
        density: f64,
    ) -> Result<Trim, TrimError> {
        let speed = request.airspeed;
        let trim = Trim { residual, ..self.state(x, request, density) };
        let c = trim.controls;
        // beyond the stall the other controls say nothing: lift is what is missing
        if let Some(stall) = self.aerodynamics.stall.filter(|stall| trim.alpha >= stall.angle) {
            return Err(TrimError::new(
                "lift",
                format!(
                    "no lift: steady flight at {speed} m/s needs an angle of attack of {:.1} deg, the stall is \
                     at {:.1} deg",
                    trim.alpha.to_degrees(),
                    stall.angle.to_degrees()
                ),
            ));
        }
        for (name, at, actuator) in [("elevator", c.elevator, 0), ("aileron", c.aileron, 1), ("rudder", c.rudder, 2)]
            .map(|(n, c, i)| (n, c, self.actuators[i]))
        {
            let Some([least, greatest]) = actuator.map(|a| a.travel) else { continue };
            if residual < SOLVED && !(least..=greatest).contains(&at) {
                return Err(TrimError::new(
                    name,
                    format!(
                        "no {name}: steady flight at {speed} m/s needs {:.1} deg, the stops are {:.1} deg \
                         and {:.1} deg",
                        at.to_degrees(),
                        least.to_degrees(),
                        greatest.to_degrees()
                    ),
                ));
            }
        }
        let most = self.propulsion.greatest();
        let solved = residual < SOLVED;
        let thrust = |throttle: f64| self.propulsion.running(throttle, speed, density).thrust;
        if !solved && most.is_finite() && wanted > thrust(most) {
            return Err(TrimError::new(
                "thrust",
                format!(
                    "no thrust: steady flight at {speed} m/s needs {wanted:.1} N, there are {:.1} N at full throttle",
                    thrust(most)
                ),
            ));
        }
        if c.throttle > most || (!solved && c.throttle > 0.9 * most) {
            return Err(TrimError::new(
                "thrust",
                format!(
                    "no thrust: steady flight at {speed} m/s needs {}, there is {most}",
                    match self.propulsion {
                        super::Propulsion::Motor(_) => format!("a throttle of {:.3}", c.throttle),
                        super::Propulsion::Thrust { .. } => format!("a thrust of {:.3} N", c.throttle),
                    }
                ),
            ));
        }
        if (solved && c.throttle < 0.0) || (!solved && wanted < thrust(0.0)) {
            return Err(TrimError::new(
                "brake",
                format!(
                    "no brake: steady flight at {speed} m/s needs a throttle below zero; descend less or fly slower"
                ),
            ));
        }
        if residual.is_nan() || residual >= 1e-10 {
            return Err(TrimError::new(
                "solution",
                format!("no steady flight found at {speed} m/s: {residual:.1e} m/s^2 or rad/s^2 remain"),
            ));
        }
        Ok(trim)
    }
}
