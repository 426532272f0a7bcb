//! A feed in one half: estimates of the four states of the airframe by what is measured of them.

use nalgebra::DMatrix;

use super::half::{AIRFRAME, ANGLE, Half};
use crate::aircraft::control::response::StateSpace;
use crate::aircraft::flight::Setting;
use crate::filter::SteadyState;
use crate::model::LinearModel;

/// A Kalman filter with its steady gain.
#[derive(Clone, Debug)]
pub struct Kalman {
    /// Of which axis or half: "x", "pitch".
    pub name: String,
    pub model: LinearModel,
    pub steady: SteadyState,
    /// What it compares of the four measured states: measurements by states.
    pub seen: DMatrix<f64>,
}

/// In one half.
#[derive(Clone, Debug)]
pub struct HalfFeed {
    pub system: StateSpace,
    /// The Kalman filters in it; their states come first in the system.
    pub filters: Vec<Kalman>,
    /// Gains of its own, of all outputs of the system, instead of those of the autopilot.
    pub law: Option<StateSpace>,
}

/// Every input passes but for the commands.
pub(super) fn pass(half: Half, interval: f64) -> StateSpace {
    let m = half.surfaces().len();
    StateSpace::gain(DMatrix::identity(AIRFRAME, AIRFRAME + m), Some(interval))
}

/// The gyro as it is; the angle predicted by it and corrected towards the reference by 1 − e^(−Δ/τ) of the difference.
pub fn raw(setting: &Setting, half: Half) -> HalfFeed {
    let interval = setting.interval();
    let mut system = pass(half, interval);
    if setting.reference.is_some() {
        let correction = -(-interval / setting.attitude_filter).exp_m1();
        let inputs = system.inputs();
        system.a = DMatrix::from_element(1, 1, 1.0 - correction);
        system.b = DMatrix::zeros(1, inputs);
        system.b[(0, half.integrated())] = interval;
        system.b[(0, ANGLE)] = correction;
        system.c = DMatrix::zeros(AIRFRAME, 1);
        system.c[(ANGLE, 0)] = 1.0 - correction;
        system.d[(ANGLE, ANGLE)] = correction;
    }
    HalfFeed { system, filters: Vec::new(), law: None }
}

impl HalfFeed {
    /// A filter on each rate behind it.
    #[must_use]
    pub fn behind(self, filters: &[StateSpace], half: Half) -> HalfFeed {
        let one = StateSpace::gain(DMatrix::identity(1, 1), self.system.interval);
        let mut all: Option<StateSpace> = None;
        for state in 0..AIRFRAME {
            let next = half.rates().iter().position(|rate| *rate == state).map_or(&one, |i| &filters[i]);
            all = Some(all.map_or(next.clone(), |before| before.beside(next)));
        }
        match all {
            Some(all) => HalfFeed { system: self.system.then(&all), ..self },
            None => self,
        }
    }
}
