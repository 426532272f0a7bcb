//! A gyro integrated to an angle: θ_{k+1} = θ_k + dt ω_k.

use nalgebra::{DMatrix, DVector};

use super::{ModelError, Plant, measured, named, positive};
use crate::units::Quantity;

/// State "angle" (rad), input "angular_rate" (rad/s, held over the sample), output "angle"; θ_0 ~ N(0,
/// `initial_std_dev`²).
///
/// Errors: `dt` (s) or `initial_std_dev` (rad) not greater than zero.
pub fn plant(initial_std_dev: f64, dt: f64) -> Result<Plant, ModelError> {
    let (dt, sigma) = (positive("dt", dt)?, positive("initial_std_dev", initial_std_dev)?);
    let one = |value: f64| DMatrix::from_element(1, 1, value);
    Ok(Plant {
        dt,
        states: vec![named("angle", "rad")],
        inputs: vec![measured(Quantity::AngularRate)],
        outputs: vec![named("angle", "rad")],
        f: one(1.0),
        g: one(dt),
        h: one(1.0),
        q: one(0.0),
        x0: DVector::zeros(1),
        p0: one(sigma * sigma),
    })
}
