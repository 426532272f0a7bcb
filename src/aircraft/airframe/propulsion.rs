//! A propeller on an electric motor in its steady state, or a thrust as it is told.
//!
//! With V_in = Vmax δt, n turns per second, J = V/(nD): thrust ρn²D⁴CT(J), torque ρn²D⁵CQ(J), and the motor gives
//! KV((V_in − KV Ω)/R − i0) (McLain's supplement to Beard and McLain 2012). Inertia and gyroscopic moment of the rotor
//! are left out.

use std::f64::consts::TAU;

use crate::numerics::optimize::bracketed_root;

/// A coefficient over the advance ratio J.
#[derive(Clone, Debug, PartialEq)]
pub enum Curve {
    /// c0 + c1 J + c2 J².
    Quadratic([f64; 3]),
    /// Straight between points of rising J, and beyond them as at the ends.
    Table(Vec<[f64; 2]>),
}

/// Motor and propeller, SI.
#[derive(Clone, Debug, PartialEq)]
pub struct Motor {
    /// m.
    pub diameter: f64,
    /// KV, V s/rad: volts per rate, and N m per ampere.
    pub constant: f64,
    pub resistance: f64,
    /// KV/R, N m/V.
    pub torque_per_volt: f64,
    /// KV²/R 2π/D: torque that is lost per w = nD, N s.
    pub loss: f64,
    pub no_load_current: f64,
    /// At full throttle.
    pub voltage: f64,
    pub thrust: Curve,
    pub torque: Curve,
    /// Clockwise seen from behind: +1, else −1.
    pub turns: f64,
}

#[derive(Clone, Debug, PartialEq)]
pub enum Propulsion {
    Motor(Motor),
    /// The throttle is the thrust, N, up to this.
    Thrust {
        greatest: f64,
    },
}

/// What the propulsion does.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Running {
    /// N.
    pub thrust: f64,
    /// Moment about x is less this, N m.
    pub reaction: f64,
    /// Ω, rad/s.
    pub rate: f64,
    /// A.
    pub current: f64,
}

impl Curve {
    /// w² C(v/w), the coefficient with its powers of the propeller's own speed w = nD (m/s): no division where it is a
    /// polynomial, and no break where the propeller stands still.
    #[inline(always)]
    fn of_speeds(&self, w: f64, v: f64) -> f64 {
        match self {
            Curve::Quadratic([a, b, c]) => a * w * w + v * (b * w + v * c),
            Curve::Table(points) => {
                let j = if w > 0.0 { v / w } else { f64::INFINITY };
                let above = points.partition_point(|p| p[0] <= j).clamp(1, points.len() - 1);
                let ([x0, y0], [x1, y1]) = (points[above - 1], points[above]);
                w * w * (y0 + (y1 - y0) * ((j - x0) / (x1 - x0)).clamp(0.0, 1.0))
            }
        }
    }
}

impl Motor {
    /// w = nD at a voltage, an airspeed and a density: where propeller and motor have the same torque, ρD³ w²CQ(v/w) =
    /// KV((V_in − KV Ω)/R − i0), Ω = 2πw/D.
    #[inline(always)]
    fn speed(&self, volts: f64, v: f64, density: f64) -> f64 {
        let Motor { diameter: d, constant: k, loss, .. } = self;
        let scale = density * d * d * d;
        // the motor's torque at rest
        let rest = self.torque_per_volt * volts - k * self.no_load_current;
        if let Curve::Quadratic([c0, c1, c2]) = self.torque {
            let (a, b, c) = (scale * c0, scale * c1 * v + loss, scale * c2 * v * v - rest);
            // a motor that the air does not let turn stands still
            return (((b * b - 4.0 * a * c).max(0.0).sqrt() - b) / (2.0 * a)).max(0.0);
        }
        let lack = |w: f64| scale * self.torque.of_speeds(w, v) + loss * w - rest;
        let high = (volts / k * d / TAU).max(0.0);
        if lack(high) < 0.0 {
            return high;
        }
        // the torque of the motor falls with the rate and that of the propeller rises: one crossing, or the air turns
        // nothing
        bracketed_root(lack, 0.0, high, 0.0).unwrap_or(0.0)
    }

    /// Thrust and reaction at a speed w = nD of the propeller.
    #[inline(always)]
    fn wrench(&self, w: f64, v: f64, density: f64) -> (f64, f64) {
        let scale = density * self.diameter * self.diameter;
        let torque = self.turns * scale * self.diameter * self.torque.of_speeds(w, v);
        (scale * self.thrust.of_speeds(w, v), torque)
    }
}

impl Propulsion {
    /// Thrust (N) along x and the moment (N m) about it that the airplane feels less.
    #[inline(always)]
    pub(super) fn thrust_and_reaction(&self, throttle: f64, speed: f64, density: f64) -> (f64, f64) {
        match self {
            Propulsion::Thrust { .. } => (throttle, 0.0),
            Propulsion::Motor(motor) => {
                motor.wrench(motor.speed(motor.voltage * throttle, speed, density), speed, density)
            }
        }
    }

    /// At a throttle (0 to 1, or the thrust in N), an airspeed (m/s) and a density (kg/m³).
    pub fn running(&self, throttle: f64, speed: f64, density: f64) -> Running {
        match self {
            Propulsion::Thrust { .. } => Running { thrust: throttle, ..Running::default() },
            Propulsion::Motor(motor) => {
                let volts = motor.voltage * throttle;
                let w = motor.speed(volts, speed, density);
                let (thrust, reaction) = motor.wrench(w, speed, density);
                let rate = TAU * w / motor.diameter;
                Running { thrust, reaction, rate, current: (volts - motor.constant * rate) / motor.resistance }
            }
        }
    }

    /// Largest setting of the throttle.
    pub fn greatest(&self) -> f64 {
        match self {
            Propulsion::Motor(_) => 1.0,
            Propulsion::Thrust { greatest } => *greatest,
        }
    }
}
