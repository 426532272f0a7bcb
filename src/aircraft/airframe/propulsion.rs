//! A propeller on an electric motor in its steady state, or a thrust as it is told.
//!
//! With V_in = Vmax δt, n turns per second, J = V/(nD): thrust ρn²D⁴CT(J), torque ρn²D⁵CQ(J), and the motor gives KV((V_in − KV Ω)/R − i0) (McLain's supplement
//! to Beard and McLain 2012). Inertia and gyroscopic moment of the rotor are left out.

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
    pub fn at(&self, j: f64) -> f64 {
        match self {
            Curve::Quadratic([a, b, c]) => a + j * (b + j * c),
            Curve::Table(points) => {
                let above = points.partition_point(|p| p[0] <= j).clamp(1, points.len() - 1);
                let ([x0, y0], [x1, y1]) = (points[above - 1], points[above]);
                y0 + (y1 - y0) * ((j - x0) / (x1 - x0)).clamp(0.0, 1.0)
            }
        }
    }
}

impl Motor {
    /// Ω at a voltage, an airspeed and a density: where propeller and motor have the same torque.
    fn rate(&self, volts: f64, speed: f64, density: f64) -> f64 {
        let Motor { diameter: d, constant: k, resistance, .. } = self;
        if let Curve::Quadratic([c0, c1, c2]) = self.torque {
            let a = c0 * density * d.powi(5) / (TAU * TAU);
            let b = c1 * density * d.powi(4) * speed / TAU + k * k / resistance;
            let c = c2 * density * d.powi(3) * speed * speed - k * volts / resistance + k * self.no_load_current;
            // a motor that the air does not let turn stands still
            return ((-b + (b * b - 4.0 * a * c).max(0.0).sqrt()) / (2.0 * a)).max(0.0);
        }
        let lack = |rate: f64| {
            let n = rate / TAU;
            let j = if n > 0.0 { speed / (n * d) } else { f64::INFINITY };
            density * n * n * d.powi(5) * self.torque.at(j)
                - k * ((volts - k * rate) / resistance - self.no_load_current)
        };
        let high = (volts / k).max(0.0);
        if lack(high) < 0.0 {
            return high;
        }
        // the torque of the motor falls with the rate and that of the propeller rises: one crossing, or the air turns
        // nothing
        bracketed_root(lack, 0.0, high, 0.0).unwrap_or(0.0)
    }
}

impl Propulsion {
    /// At a throttle (0 to 1, or the thrust in N), an airspeed (m/s) and a density (kg/m³).
    pub fn running(&self, throttle: f64, speed: f64, density: f64) -> Running {
        match self {
            Propulsion::Thrust { .. } => Running { thrust: throttle, ..Running::default() },
            Propulsion::Motor(motor) => {
                let volts = motor.voltage * throttle;
                let rate = motor.rate(volts, speed, density);
                let n = rate / TAU;
                let d = motor.diameter;
                let j = if n > 0.0 { speed / (n * d) } else { 0.0 };
                let scale = density * n * n * d.powi(4);
                Running {
                    thrust: scale * motor.thrust.at(j),
                    reaction: motor.turns * scale * d * motor.torque.at(j),
                    rate,
                    current: (volts - motor.constant * rate) / motor.resistance,
                }
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
