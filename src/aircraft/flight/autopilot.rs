//! Rate dampers and attitude loops, and the complementary filter that gives them angles.
//!
//! δe = kq q̂ + kθ(θ̂ − θc), δa = −kp p̂ − kφ(φ̂ − φc), δr = +kr · washout(r̂), deviations from trim; washout τs/(τs +
//! 1) by the bilinear rule. The angles are those of gyro and attitude reference: predicted by the gyro through the
//! kinematics of roll and pitch, and corrected towards the reference with the time constant of the filter, 1 − e^(−Δ/τ)
//! of the difference at each measurement.

/// Gains in SI: s for the rates, plain for the angles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gains {
    pub kq: f64,
    pub ktheta: f64,
    pub kp: f64,
    pub kphi: f64,
    pub kr: f64,
    /// Time constant, s.
    pub washout: f64,
}

/// What the deviations are from.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Reference {
    /// p, q, r.
    pub rate: [f64; 3],
    /// Commanded roll and pitch.
    pub angles: [f64; 2],
    /// Elevator, aileron, rudder.
    pub surfaces: [f64; 3],
}

#[derive(Clone, Debug)]
pub(super) struct Autopilot {
    gains: Gains,
    reference: Reference,
    /// s.
    interval: f64,
    /// Part of the difference to the attitude reference that is taken over at each measurement.
    correction: f64,
    /// φ̂, θ̂ at the present measurement.
    angles: [f64; 2],
    /// The rate of the measurement before.
    last_rate: Option<[f64; 3]>,
    /// Last input and output of the washout.
    washout: [f64; 2],
}

impl Autopilot {
    /// `attitude_filter`: time constant, s; none takes the measured angles as they are.
    pub(super) fn new(
        gains: Gains,
        reference: Reference,
        interval: f64,
        attitude_filter: Option<f64>,
        angles: [f64; 2],
    ) -> Autopilot {
        let correction = attitude_filter.map_or(1.0, |time| -(-interval / time).exp_m1());
        Autopilot { gains, reference, interval, correction, angles, last_rate: None, washout: [0.0; 2] }
    }

    /// Commands of elevator, aileron, rudder from rate (rad/s) and roll and pitch (rad) as measured now; NaN angles
    /// were not measured.
    pub(super) fn command(&mut self, rate: [f64; 3], measured: [f64; 2]) -> [f64; 3] {
        if let Some([p, q, r]) = self.last_rate {
            let ((sin, cos), tan) = (self.angles[0].sin_cos(), self.angles[1].tan());
            self.angles[0] += self.interval * (p + tan * (q * sin + r * cos));
            self.angles[1] += self.interval * (q * cos - r * sin);
        }
        self.last_rate = Some(rate);
        for (angle, measured) in self.angles.iter_mut().zip(measured) {
            if measured.is_finite() {
                // the shorter way round
                let turn = std::f64::consts::TAU;
                let difference = measured - *angle;
                *angle += self.correction * (difference - turn * (difference / turn).round());
            }
        }
        let Gains { kq, ktheta, kp, kphi, kr, washout } = self.gains;
        let [p, q, r] = [0, 1, 2].map(|i| rate[i] - self.reference.rate[i]);
        let [phi, theta] = [0, 1].map(|i| self.angles[i] - self.reference.angles[i]);
        // y⁺ = ((2τ − Δ) y + 2τ (r⁺ − r))/(2τ + Δ)
        let (two, step) = (2.0 * washout, self.interval);
        let output = ((two - step) * self.washout[1] + two * (r - self.washout[0])) / (two + step);
        self.washout = [r, output];
        let [elevator, aileron, rudder] = self.reference.surfaces;
        [elevator + kq * q + ktheta * theta, aileron - kp * p - kphi * phi, rudder + kr * output]
    }
}
