//! Rate dampers and attitude loops, or the linear-quadratic regulator, and the complementary filter that gives them
//! angles.
//!
//! δe = kq q̂ + kθ(θ̂ − θc), δa = −kp p̂ − kφ(φ̂ − φc), δr = +kr · washout(r̂), deviations from trim; the washout
//! τs/(1 + τs) by the bilinear rule. The angles are those of gyro and attitude reference: predicted by the gyro through
//! the kinematics of roll and pitch, and corrected towards the reference with the time constant of the filter by
//! 1 − e^(−Δ/τ) of the difference at each measurement.
//!
//! The regulator is δ = δ₀ − K (x − x₀) of the states u w q θ and v p r φ (`control::regulator`).

/// Gains of rates (s) and angles, SI.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RateGains {
    pub kq: f64,
    pub ktheta: f64,
    pub kp: f64,
    pub kphi: f64,
    pub kr: f64,
    /// Time constant, s.
    pub washout: f64,
}

impl RateGains {
    pub const NAMES: [&str; 5] = ["kq", "ktheta", "kp", "kphi", "kr"];

    /// In the order of the names.
    pub fn values(&self) -> [f64; 5] {
        [self.kq, self.ktheta, self.kp, self.kphi, self.kr]
    }

    /// Of values in the order of the names.
    pub fn of([kq, ktheta, kp, kphi, kr]: [f64; 5], washout: f64) -> RateGains {
        RateGains { kq, ktheta, kp, kphi, kr, washout }
    }
}

/// Feedback of all states, SI.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct StateFeedback {
    /// Of u, w, q, θ to the elevator.
    pub along: [f64; 4],
    /// Of v, p, r, φ to aileron and rudder.
    pub across: [[f64; 4]; 2],
    /// u, v, w through the steady air in trim.
    pub velocity: [f64; 3],
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Law {
    Gains(RateGains),
    Regulator(StateFeedback),
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
    law: Law,
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
        law: Law,
        reference: Reference,
        interval: f64,
        attitude_filter: Option<f64>,
        angles: [f64; 2],
    ) -> Autopilot {
        let correction = attitude_filter.map_or(1.0, |time| -(-interval / time).exp_m1());
        Autopilot { law, reference, interval, correction, angles, last_rate: None, washout: [0.0; 2] }
    }

    /// Commands of elevator, aileron, rudder from rate (rad/s) and roll and pitch (rad) as measured now, and the
    /// velocity through the steady air (m/s); NaN angles were not measured.
    pub(super) fn command(&mut self, rate: [f64; 3], measured: [f64; 2], velocity: [f64; 3]) -> [f64; 3] {
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
        let [p, q, r] = [0, 1, 2].map(|i| rate[i] - self.reference.rate[i]);
        let [phi, theta] = [0, 1].map(|i| self.angles[i] - self.reference.angles[i]);
        let [elevator, aileron, rudder] = self.reference.surfaces;
        let RateGains { kq, ktheta, kp, kphi, kr, washout } = match &self.law {
            Law::Gains(gains) => *gains,
            Law::Regulator(feedback) => {
                let [u, v, w] = [0, 1, 2].map(|i| velocity[i] - feedback.velocity[i]);
                let of = |k: &[f64; 4], x: [f64; 4]| k.iter().zip(x).map(|(k, x)| k * x).sum::<f64>();
                let [across, behind] = &feedback.across;
                let lateral = [v, p, r, phi];
                return [
                    elevator - of(&feedback.along, [u, w, q, theta]),
                    aileron - of(across, lateral),
                    rudder - of(behind, lateral),
                ];
            }
        };
        // y⁺ = ((2τ − Δ) y + 2τ (r⁺ − r))/(2τ + Δ)
        let (two, step) = (2.0 * washout, self.interval);
        let output = ((two - step) * self.washout[1] + two * (r - self.washout[0])) / (two + step);
        self.washout = [r, output];
        [elevator + kq * q + ktheta * theta, aileron - kp * p - kphi * phi, rudder + kr * output]
    }
}
