//! Plants, augmentation with noise states, discretisation, observability (floor 2).

pub mod augment;
pub mod discretize;
pub mod observability;
pub mod plant;

use nalgebra::{DMatrix, DVector};

/// A state, input or measurement with its SI unit.
#[derive(Clone, Debug, PartialEq)]
pub struct Named {
    pub name: String,
    pub unit: String,
}

/// A named discrete-time linear model x_{k+1} = F x_k + G u_k + v, z_k = H x_k + w, v ~ N(0,Q), w ~ N(0,R), x_0 ~ N(x0, P0). SI.
#[derive(Clone, Debug)]
pub struct LinearModel {
    pub dt: f64,
    pub states: Vec<Named>,
    pub inputs: Vec<Named>,
    pub measurements: Vec<Named>,
    /// Measurement taken every n-th sample, per measurement.
    pub every: Vec<usize>,
    pub f: DMatrix<f64>,
    pub g: DMatrix<f64>,
    pub h: DMatrix<f64>,
    pub q: DMatrix<f64>,
    pub r: DMatrix<f64>,
    pub x0: DVector<f64>,
    pub p0: DMatrix<f64>,
}
