//! The errors of a sensor as states, and a plant joined with the errors of its sensors.

use nalgebra::{DMatrix, DVector};

use super::plant::{self, Plant};
use super::{DRIFT, LinearModel, ModelError, Named, Output};
use crate::noise::{Kind, NoiseModel, Realisation, Term};
use crate::units::Quantity;

/// What is known of the constant bias before the first measurement (SI, unit of the quantity).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InitialBias {
    /// x0 of the bias state.
    pub mean: f64,
    /// Root of its P0: the spread from one power-up to the next.
    pub std_dev: f64,
}

/// Errors of a sensor of one axis at rest: z_k = bias + Σ h_i x_i + w_k, states "bias" and those of every noise
/// process, in the fixed order of [`Kind`], block-diagonal F, Q, P0, each block discretised exactly by its process;
/// R = (Σ N²)/dt.
///
/// `dt` in s; `horizon_s` is the slowest time constant that flicker must cover. `bias` is the constant part; without
/// it there is no "bias" state. State names are unique: "gauss_markov", "gauss_markov.2". P0 of a process is that of
/// its realisation. Errors: `dt`, `horizon_s` or the bias spread out of range, a line not below half the sample
/// rate, or no white noise.
pub fn sensor_errors(
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
    let variance = noise.white_density().powi(2) / dt;
    if variance <= 0.0 {
        return Err(ModelError::NoMeasurementNoise);
    }
    let mut model = joined(plant::measured(quantity), &blocks, variance, dt, |name| unit(name, quantity).to_owned());
    model.x0.rows_mut(0, x0.len()).copy_from_slice(&x0);
    model.check()?;
    Ok(model)
}

/// Errors of an aid that measures `output`: white noise of standard deviation `std_dev` per measurement, and a
/// Gauss-Markov process (`std_dev`, correlation time in s) where there is one; SI.
///
/// Errors: a value not greater than zero.
pub fn aid_errors(
    output: Named,
    std_dev: f64,
    gauss_markov: Option<[f64; 2]>,
    dt: f64,
) -> Result<LinearModel, ModelError> {
    let values = [("dt", dt), ("std_dev", std_dev)].into_iter();
    let drift = gauss_markov.into_iter().flat_map(|[s, tc]| [("gauss_markov.std_dev", s), ("correlation_time", tc)]);
    if let Some((name, value)) = values.chain(drift).find(|(_, value)| !(*value > 0.0 && value.is_finite())) {
        return Err(ModelError::NotPositive { name, value });
    }
    let term = gauss_markov.map(|[std_dev, correlation_time]| Term::GaussMarkov { std_dev, correlation_time });
    let blocks: Vec<Realisation> = term.iter().filter_map(|term| term.realisation(dt, dt)).collect();
    let unit = output.unit.clone();
    Ok(joined(output, &blocks, std_dev * std_dev, dt, |_| unit.clone()))
}

/// One measurement, the sum of all blocks and of white noise.
fn joined(
    measurement: Named,
    blocks: &[Realisation],
    white: f64,
    dt: f64,
    unit: impl Fn(&str) -> String,
) -> LinearModel {
    let n: usize = blocks.iter().map(|block| block.names.len()).sum();
    let mut model = LinearModel {
        dt,
        states: Vec::with_capacity(n),
        inputs: Vec::new(),
        measurements: vec![measurement],
        every: vec![1],
        outputs: Vec::new(),
        f: DMatrix::zeros(n, n),
        g: DMatrix::zeros(n, 0),
        h: DMatrix::zeros(1, n),
        q: DMatrix::zeros(n, n),
        r: DMatrix::from_element(1, 1, white),
        x0: DVector::zeros(n),
        p0: DMatrix::zeros(n, n),
    };
    for block in blocks {
        let (first, size) = (model.states.len(), block.names.len());
        model.f.view_mut((first, first), (size, size)).copy_from(&block.phi);
        model.q.view_mut((first, first), (size, size)).copy_from(&block.q);
        model.p0.view_mut((first, first), (size, size)).copy_from(&block.p0);
        model.h.view_mut((0, first), (1, size)).copy_from(&block.h);
        for name in &block.names {
            let name = unique(name, &model.states);
            let unit = unit(&name);
            model.states.push(Named { name, unit });
        }
    }
    model
}

/// Where a sensor is joined to a plant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Port {
    /// The filter integrates what it measures.
    Input(usize),
    /// The filter compares what it measures.
    Output(usize),
}

/// A sensor or aid of a plant.
#[derive(Clone, Copy, Debug)]
pub struct Attached<'a> {
    /// Of its measurement; stands before the names of its states (`heading.gauss_markov`). Empty for the sensor that
    /// the design is of: its measurement has the name of the port, its states have their own.
    pub name: &'a str,
    /// One measurement: from [`sensor_errors`] or [`aid_errors`].
    pub errors: &'a LinearModel,
    pub port: Port,
    /// Samples from one measurement to the next.
    pub every: usize,
}

/// A plant with its sensors, and which noise is whose.
#[derive(Clone, Debug)]
pub struct Augmented {
    pub model: LinearModel,
    /// Process noise that is not of a state of its own: "motion" of the plant, "white" of a sensor at an input
    /// ("heading.white"). The rest of Q belongs to the state it stands at.
    pub noise: Vec<(String, DMatrix<f64>)>,
}

/// The plant with the errors of its sensors as states: first those of the plant, then those of each sensor.
///
/// With e_k = H_s s_k + w_k the error of a sensor, s_{k+1} = F_s s_k + v and var w = R_s (N²/dt of white noise):
///
/// - at an output y = H_p x the sensor is a measurement, z = H_p x + H_s s + w, a row of H and R;
/// - at an input it drives the plant, x_{k+1} = F_p x_k + G_p (u_k − e_k) + v: F has −G_p H_s beside F_p, Q has G_p
///   R_s G_pᵀ.
///
/// This is the sampled form: the error is held over a sample, as the sensor's sample is. The continuous form of a
/// gyro with a Gauss-Markov drift is [`angle_and_drift`](super::discretize::angle_and_drift); they agree to
/// O(dt/Tc). A plant with states has its states and the drift of the first sensor as `outputs`. Errors: a state name
/// that stands twice, and what [`LinearModel::check`] says.
pub fn augment(plant: &Plant, sensors: &[Attached<'_>]) -> Result<Augmented, ModelError> {
    let own = plant.states.len();
    let n = own + sensors.iter().map(|sensor| sensor.errors.states.len()).sum::<usize>();
    let measuring: Vec<usize> = (0..sensors.len()).filter(|&i| matches!(sensors[i].port, Port::Output(_))).collect();
    let mut model = LinearModel {
        dt: plant.dt,
        states: plant.states.clone(),
        inputs: plant.inputs.clone(),
        measurements: Vec::new(),
        every: Vec::new(),
        outputs: Vec::new(),
        f: DMatrix::zeros(n, n),
        g: DMatrix::zeros(n, plant.inputs.len()),
        h: DMatrix::zeros(measuring.len(), n),
        q: DMatrix::zeros(n, n),
        r: DMatrix::zeros(measuring.len(), measuring.len()),
        x0: DVector::zeros(n),
        p0: DMatrix::zeros(n, n),
    };
    model.f.view_mut((0, 0), (own, own)).copy_from(&plant.f);
    model.g.view_mut((0, 0), (own, plant.inputs.len())).copy_from(&plant.g);
    model.x0.rows_mut(0, own).copy_from(&plant.x0);
    model.p0.view_mut((0, 0), (own, own)).copy_from(&plant.p0);
    let mut noise = Vec::new();
    if plant.q.iter().any(|q| *q != 0.0) {
        add(&mut model.q, &plant.q);
        noise.push(("motion".to_owned(), padded(&plant.q, n)));
    }
    for sensor in sensors {
        let errors = sensor.errors;
        let (first, size) = (model.states.len(), errors.states.len());
        model.f.view_mut((first, first), (size, size)).copy_from(&errors.f);
        model.q.view_mut((first, first), (size, size)).copy_from(&errors.q);
        model.p0.view_mut((first, first), (size, size)).copy_from(&errors.p0);
        model.x0.rows_mut(first, size).copy_from(&errors.x0);
        for state in &errors.states {
            let name = prefixed(sensor.name, &state.name);
            if let Some(i) = model.states.iter().position(|taken| taken.name == name) {
                let message = format!("'{name}' is the name of a state of the sensor too; choose another");
                return Err(ModelError::part(format!("states[{i}].name"), message));
            }
            model.states.push(Named { name, unit: state.unit.clone() });
        }
        match sensor.port {
            Port::Input(input) => {
                let g = plant.g.column(input);
                model.f.view_mut((0, first), (own, size)).copy_from(&(-(g * &errors.h)));
                let white = g * errors.r[(0, 0)] * g.transpose();
                add(&mut model.q, &white);
                noise.push((prefixed(sensor.name, "white"), padded(&white, n)));
            }
            Port::Output(output) => {
                let row = model.measurements.len();
                model.h.view_mut((row, 0), (1, own)).copy_from(&plant.h.row(output));
                model.h.view_mut((row, first), (1, size)).copy_from(&errors.h);
                model.r[(row, row)] = errors.r[(0, 0)];
                let Named { name, unit } = plant.outputs[output].clone();
                let name = if sensor.name.is_empty() { name } else { sensor.name.to_owned() };
                model.measurements.push(Named { name, unit });
                model.every.push(sensor.every);
            }
        }
    }
    if let Some(sensor) = sensors.first().filter(|_| own > 0) {
        model.outputs = outputs(&model, own, sensor);
    }
    model.check()?;
    Ok(Augmented { model, noise })
}

/// Every state of the plant, then the drift of the sensor whose states follow them.
fn outputs(model: &LinearModel, own: usize, sensor: &Attached<'_>) -> Vec<Output> {
    let n = model.states.len();
    let state = |i: usize| Output {
        name: model.states[i].name.clone(),
        unit: model.states[i].unit.clone(),
        row: (0..n).map(|j| f64::from(i == j)).collect(),
    };
    let drift = sensor.errors.drift_row();
    let of_sensor = |j: usize| j.checked_sub(own).and_then(|j| drift.get(j)).copied().unwrap_or(0.0);
    let unit = sensor.errors.measurements[0].unit.clone();
    let drift = Output { name: DRIFT.to_owned(), unit, row: (0..n).map(of_sensor).collect() };
    (0..own).map(state).chain([drift]).collect()
}

fn prefixed(sensor: &str, name: &str) -> String {
    if sensor.is_empty() { name.to_owned() } else { format!("{sensor}.{name}") }
}

/// Adds to the upper left corner.
fn add(q: &mut DMatrix<f64>, part: &DMatrix<f64>) {
    let mut corner = q.view_mut((0, 0), part.shape());
    corner += part;
}

fn padded(part: &DMatrix<f64>, n: usize) -> DMatrix<f64> {
    let mut all = DMatrix::zeros(n, n);
    add(&mut all, part);
    all
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

/// SI unit of a state: quantisation errors are those of the integrated quantity, a slope is the quantity per second,
/// every other state the quantity itself.
fn unit(name: &str, quantity: Quantity) -> &'static str {
    let (integral, itself, slope) = match quantity {
        Quantity::AngularRate => ("rad", quantity.si_unit(), "rad/s^2"),
        Quantity::SpecificForce => ("m/s", quantity.si_unit(), "m/s^3"),
    };
    match name {
        _ if Kind::of_state(name) == Some(Kind::Quantization) => integral,
        _ if name.contains("slope") => slope,
        _ => itself,
    }
}
