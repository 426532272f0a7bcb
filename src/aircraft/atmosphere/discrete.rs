//! Discrete gusts of 1 − cos form along the way through the air.

use std::f64::consts::PI;

use super::Gust;

/// What comes behind the rise.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// MIL-F-8785C, section 3.7.1.3: (Vm/2)(1 − cos(πx/d)) for 0 ≤ x ≤ d, then Vm.
    Hold,
    /// Of the rules for loads (CS-23.333, 25.341): (U/2)(1 − cos(πx/H)) for 0 ≤ x ≤ 2H, zero behind.
    Return,
}

/// One gust: it begins where the airplane is at `start`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DiscreteGust {
    pub form: Form,
    /// Largest velocity of the air in body axes, m/s; an up-gust has w < 0.
    pub velocity: [f64; 3],
    /// Length of the rise, m.
    pub length: f64,
    /// s.
    pub start: f64,
}

impl DiscreteGust {
    /// The part of the largest velocity at a distance (m) from where the gust begins.
    pub fn part(&self, distance: f64) -> f64 {
        let x = distance / self.length;
        match self.form {
            _ if x <= 0.0 => 0.0,
            Form::Hold if x >= 1.0 => 1.0,
            Form::Return if x >= 2.0 => 0.0,
            _ => 0.5 * (1.0 - (PI * x).cos()),
        }
    }

    pub fn at(&self, distance: f64) -> Gust {
        let part = self.part(distance);
        Gust { velocity: self.velocity.map(|v| part * v), rate: [0.0; 3] }
    }
}
