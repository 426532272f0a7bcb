//! Roll or pitch: the gyro is integrated, gravity along the accelerometer's axis tells the tilt, f = g θ for small
//! tilts.

use nalgebra::dmatrix;

use super::{ModelError, Plant, angle, measured, named, positive};
use crate::units::Quantity;

/// m/s².
pub const STANDARD_GRAVITY: f64 = 9.80665;

/// State "tilt" (rad), input "angular_rate", outputs "specific_force" (g θ, m/s²) and "tilt" (rad).
///
/// g θ stands for g sin θ: 0.5 % too large at 10 deg. Errors: `gravity` (m/s²), `initial_std_dev` (rad) or `dt` (s) not
/// greater than zero.
pub fn plant(gravity: f64, initial_std_dev: f64, dt: f64) -> Result<Plant, ModelError> {
    let gravity = positive("gravity", gravity)?;
    let tilt = named("tilt", "rad");
    Ok(Plant {
        states: vec![tilt.clone()],
        outputs: vec![measured(Quantity::SpecificForce), tilt],
        h: dmatrix![gravity; 1.0],
        ..angle::plant(initial_std_dev, dt)?
    })
}

/// Number of the output that the accelerometer measures.
pub const SPECIFIC_FORCE: usize = 0;
/// Number of the output that other aids measure.
pub const TILT: usize = 1;
