//! The plant with the sensor's bias and noise processes appended as states.

use nalgebra::{DMatrix, DVector};

use super::{LinearModel, ModelError, Named, Plant};
use crate::noise::{NoiseModel, Realisation, Term};
use crate::units::Quantity;

/// What is known of the constant bias before the first measurement (SI, unit of the quantity).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InitialBias {
    /// x0 of the bias state.
    pub mean: f64,
    /// Root of its P0: the spread from one power-up to the next.
    pub std_dev: f64,
}

/// Sensor model of one axis: z_k = bias + Σ h_i x_i + w_k, states "bias" and those of every noise process, in the fixed order of
/// [`Kind`](crate::noise::Kind), block-diagonal F, Q, P0, each block discretised exactly by its process; R = (Σ N²)/dt.
///
/// `dt` in s; `horizon_s` is the slowest time constant that flicker must cover. `bias` is the constant part; without it there is
/// no "bias" state. State names are unique: "gauss_markov", "gauss_markov.2". P0 of a process is that of its realisation.
/// Errors: `dt`, `horizon_s` or the bias spread out of range, a line not below half the sample rate, or no white noise.
pub fn augment(
    plant: Plant,
    quantity: Quantity,
    noise: &NoiseModel,
    bias: Option<InitialBias>,
    dt: f64,
    horizon_s: f64,
) -> Result<LinearModel, ModelError> {
    for (name, value) in [("dt", dt), ("horizon", horizon_s)] {
        if !(value > 0.0 && value.is_finite()) {
            return Err(ModelError::NotPositive { name, value });
        }
    }
    noise.check_rate(dt)?;
    let Plant::Static = plant;
    let mut blocks = Vec::new();
    let mut x0 = Vec::new();
    if let Some(bias) = bias {
        if !(bias.std_dev >= 0.0 && bias.std_dev.is_finite() && bias.mean.is_finite()) {
            return Err(ModelError::part("bias", format!("found {} ± {}", bias.mean, bias.std_dev)));
        }
        blocks.push(constant(bias.std_dev * bias.std_dev));
        x0.push(bias.mean);
    }
    let mut terms = noise.terms.clone();
    terms.sort_by_key(Term::kind);
    blocks.extend(terms.iter().filter_map(|term| term.realisation(dt, horizon_s)));

    let n: usize = blocks.iter().map(|block| block.names.len()).sum();
    let mut model = LinearModel {
        dt,
        states: Vec::with_capacity(n),
        inputs: plant.inputs(),
        measurements: plant.measurements(quantity),
        every: vec![1],
        f: DMatrix::zeros(n, n),
        g: DMatrix::zeros(n, 0),
        h: DMatrix::zeros(1, n),
        q: DMatrix::zeros(n, n),
        r: DMatrix::from_element(1, 1, noise.white_density().powi(2) / dt),
        x0: DVector::zeros(n),
        p0: DMatrix::zeros(n, n),
    };
    if model.r[(0, 0)] <= 0.0 {
        return Err(ModelError::NoMeasurementNoise);
    }
    model.x0.rows_mut(0, x0.len()).copy_from_slice(&x0);
    for block in &blocks {
        let (first, size) = (model.states.len(), block.names.len());
        model.f.view_mut((first, first), (size, size)).copy_from(&block.phi);
        model.q.view_mut((first, first), (size, size)).copy_from(&block.q);
        model.p0.view_mut((first, first), (size, size)).copy_from(&block.p0);
        model.h.view_mut((0, first), (1, size)).copy_from(&block.h);
        for name in &block.names {
            let name = unique(name, &model.states);
            let unit = unit(&name, quantity).to_owned();
            model.states.push(Named { name, unit });
        }
    }
    model.check()?;
    Ok(model)
}

/// A constant with this variance before the first measurement.
fn constant(variance: f64) -> Realisation {
    let one = DMatrix::from_element(1, 1, 1.0);
    Realisation {
        phi: one.clone(),
        q: DMatrix::zeros(1, 1),
        p0: DMatrix::from_element(1, 1, variance),
        h: nalgebra::RowDVector::from_element(1, 1.0),
        names: vec!["bias".to_owned()],
        exact: true,
    }
}

/// `name`, or `name.2`, `name.3` … where it is taken.
fn unique(name: &str, taken: &[Named]) -> String {
    let free = |candidate: &str| taken.iter().all(|state| state.name != candidate);
    let numbered = (2..).map(|i| format!("{name}.{i}"));
    std::iter::once(name.to_owned()).chain(numbered).find(|candidate| free(candidate)).unwrap_or_default()
}

/// SI unit of a state: quantisation errors are those of the integrated quantity, a slope is the quantity per second, every
/// other state the quantity itself.
fn unit(name: &str, quantity: Quantity) -> &'static str {
    let (integral, itself, slope) = match quantity {
        Quantity::AngularRate => ("rad", quantity.si_unit(), "rad/s^2"),
        Quantity::SpecificForce => ("m/s", quantity.si_unit(), "m/s^3"),
    };
    match name {
        _ if name.starts_with("quantization") => integral,
        _ if name.contains("slope") => slope,
        _ => itself,
    }
}
