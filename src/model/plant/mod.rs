//! What is measured beside the sensor's own errors: the plant. One file per plant.
//!
//! A plant is x_{k+1} = F x_k + G u_k + v, y_k = H x_k with named states, inputs and outputs. A sensor is joined to
//! an input (the filter integrates what it measures) or to an output (the filter compares what it measures) by
//! [`augment`](super::augment()).

pub mod angle;
pub mod custom;
pub mod rate;
pub mod vertical;

use nalgebra::{DMatrix, DVector};

use super::{ModelError, Named};
use crate::units::Quantity;

/// A plant before any sensor is joined to it; SI.
#[derive(Clone, Debug, PartialEq)]
pub struct Plant {
    pub dt: f64,
    pub states: Vec<Named>,
    pub inputs: Vec<Named>,
    pub outputs: Vec<Named>,
    pub f: DMatrix<f64>,
    pub g: DMatrix<f64>,
    pub h: DMatrix<f64>,
    /// Of its own motion.
    pub q: DMatrix<f64>,
    pub x0: DVector<f64>,
    pub p0: DMatrix<f64>,
}

/// The sensor rests: its true signal is zero, the measurement is the sum of its errors (seed paper, equation 2). No
/// states.
pub fn at_rest(quantity: Quantity, dt: f64) -> Plant {
    Plant {
        dt,
        states: Vec::new(),
        inputs: Vec::new(),
        outputs: vec![measured(quantity)],
        f: DMatrix::zeros(0, 0),
        g: DMatrix::zeros(0, 0),
        h: DMatrix::zeros(1, 0),
        q: DMatrix::zeros(0, 0),
        x0: DVector::zeros(0),
        p0: DMatrix::zeros(0, 0),
    }
}

/// What a sensor of this quantity measures.
pub fn measured(quantity: Quantity) -> Named {
    let name = match quantity {
        Quantity::AngularRate => "angular_rate",
        Quantity::SpecificForce => "specific_force",
    };
    named(name, quantity.si_unit())
}

fn named(name: &str, unit: &str) -> Named {
    Named { name: name.to_owned(), unit: unit.to_owned() }
}

/// A value that must be greater than zero.
fn positive(name: &'static str, value: f64) -> Result<f64, ModelError> {
    if value > 0.0 && value.is_finite() { Ok(value) } else { Err(ModelError::NotPositive { name, value }) }
}
