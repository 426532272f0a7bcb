//! A true rate that moves, for rate feedback: the filter takes the gyro's errors off without knowing the motion.

use nalgebra::{DMatrix, DVector, dmatrix};

use super::{ModelError, Plant, measured, named, positive};
use crate::units::Quantity;

/// How the rate moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Motion {
    /// Standard deviation (rad/s) and correlation time (s); stationary from the start.
    GaussMarkov { std_dev: f64, correlation_time: f64 },
    /// Density (rad/s²/√s) of the random walk of the acceleration; the rate before the first measurement is
    /// N(0, `initial_std_dev`²) (rad/s), the acceleration N(0, (`initial_std_dev`/1 s)²).
    IntegratedRandomWalk { density: f64, initial_std_dev: f64 },
}

/// State "rate" (rad/s), and "acceleration" (rad/s²) for the integrated random walk; no input; output "angular_rate".
///
/// Gauss-Markov: F = e^(−dt/Tc), Q = σ²(1 − e^(−2dt/Tc)). Integrated random walk: F = [[1, dt], [0, 1]],
/// Q = k² [[dt³/3, dt²/2], [dt²/2, dt]] (exact). Errors: a value not greater than zero.
/// Source: Bar-Shalom, Li & Kirubarajan 2001, section 6.2.2 (white noise jerk) and 8.2.3 (Singer 1970).
pub fn plant(motion: Motion, dt: f64) -> Result<Plant, ModelError> {
    let dt = positive("dt", dt)?;
    let rate = named("rate", "rad/s");
    let (states, f, q, p0) = match motion {
        Motion::GaussMarkov { std_dev, correlation_time } => {
            let (sigma, tc) = (positive("std_dev", std_dev)?, positive("correlation_time", correlation_time)?);
            let one = |value: f64| DMatrix::from_element(1, 1, value);
            let variance = sigma * sigma;
            (vec![rate], one((-dt / tc).exp()), one(-variance * (-2.0 * dt / tc).exp_m1()), one(variance))
        }
        Motion::IntegratedRandomWalk { density, initial_std_dev } => {
            let k2 = positive("density", density)?.powi(2);
            let start = positive("initial_std_dev", initial_std_dev)?.powi(2);
            (
                vec![rate, named("acceleration", "rad/s^2")],
                dmatrix![1.0, dt; 0.0, 1.0],
                dmatrix![dt.powi(3) / 3.0, dt * dt / 2.0; dt * dt / 2.0, dt] * k2,
                DMatrix::identity(2, 2) * start,
            )
        }
    };
    let n = states.len();
    let mut h = DMatrix::zeros(1, n);
    h[(0, 0)] = 1.0;
    Ok(Plant {
        dt,
        states,
        inputs: Vec::new(),
        outputs: vec![measured(Quantity::AngularRate)],
        f,
        g: DMatrix::zeros(n, 0),
        h,
        q,
        x0: DVector::zeros(n),
        p0,
    })
}
