//! Kalman filters as feeds: of a gyro's errors alone, and of the whole airframe.
//!
//! Each runs with its steady gain: x̂ = x⁻ + K (z − H x⁻), x⁻ = F x̂ + G u.

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::{DMatrix, DVector};

use super::LoopError;
use super::half::{AIRFRAME, ANGLE, Half};
use super::half_feed::{HalfFeed, Kalman, pass, raw};
use super::plant::{Plant, named};
use super::sensors::{Sensors, with_bias};
use crate::aircraft::control::margins::margins;
use crate::aircraft::control::response::StateSpace;
use crate::aircraft::flight::{Setting, setting};
use crate::filter::{AIRPLANE, AxisDesign, FilterDesign, steady_state};
use crate::model::plant::angle;
use crate::model::{Attached, DRIFT, LinearModel, Output, Port, aid_errors, augment};
use crate::numerics::linalg::solve;
use crate::numerics::riccati::dare_doubling;
use crate::params::{AxisParams, Params};
use crate::tune::{AxisReport, Joined, designed};
use crate::units::{Quantity, digits};

/// A filter whose white noise differs from that of the gyro by more than this factor is one of another gyro.
const OTHER_GYRO: f64 = 1.5;
/// A filter that takes over less than this of each measurement does not see the steps that a slow aid makes.
const SLOW: f64 = 0.3;
/// Spread of the angle before the first measurement, rad: anything an airplane does.
const ANY_ANGLE: f64 = 1.0;

impl Kalman {
    fn new(name: &str, model: LinearModel) -> Result<Kalman, LoopError> {
        model.check().map_err(|e| LoopError(format!("{name}: {e}")))?;
        let steady = steady_state(&model).map_err(|e| LoopError(format!("{name}: {e}")))?;
        let seen = DMatrix::zeros(model.measurements.len(), AIRFRAME);
        Ok(Kalman { name: name.to_string(), model, steady, seen })
    }

    /// x⁺ = F (I − K H) x + F K z + G u, with x that before the measurement; and (I − K H), K, by which x̂ is made.
    fn parts(&self) -> (StateSpace, DMatrix<f64>, DMatrix<f64>) {
        let n = self.model.states.len();
        let (k, h) = (&self.steady.gain, &self.model.h);
        let corrected = DMatrix::identity(n, n) - k * h;
        let system = StateSpace {
            a: &self.model.f * &corrected,
            b: &self.model.f * k,
            c: DMatrix::zeros(0, n),
            d: DMatrix::zeros(0, h.nrows()),
            interval: Some(self.model.dt),
        };
        (system, corrected, k.clone())
    }
}

fn axis_of(setting: &Setting, axis: usize) -> Result<&AxisParams, LoopError> {
    let gyro = setting.gyro.as_ref().ok_or_else(|| {
        LoopError("a Kalman filter needs the noise of the gyro: give sensors.gyro, or a filter".into())
    })?;
    Ok(&gyro.axes[axis])
}

/// Angle, bias and drift of the gyro that is integrated, made of its parameters and of the reference; other rates of
/// the half pass.
pub fn drift(setting: &Setting, half: Half, walk: f64) -> Result<HalfFeed, LoopError> {
    let axis = axis_of(setting, half.gyros()[0])?;
    let interval = setting.interval();
    let sensors = Sensors::new(setting, half)?;
    let reference = setting
        .reference
        .ok_or_else(|| LoopError("a drift filter needs an attitude to compare with: give sensors.attitude".into()))?;
    let part = |e: crate::model::ModelError| LoopError(e.to_string());
    let plant = angle::plant(ANY_ANGLE, interval).map_err(part)?;
    let errors = with_bias(axis, &sensors.gyros[0], walk, interval)?;
    let drift = reference.drift.map(|(std_dev, time)| [std_dev, time]);
    let aid = aid_errors(named("angle", "rad"), reference.white, drift, interval).map_err(part)?;
    let attached = [
        Attached { name: "", errors: &errors, port: Port::Input(0), every: 1 },
        Attached { name: "attitude", errors: &aid, port: Port::Output(0), every: 1 },
    ];
    let model = augment(&plant, &attached).map_err(part)?.model;
    Ok(of_drift(setting, half, vec![(half.integrated(), Kalman::new(&axis.name, model)?)]))
}

/// The same by filter.json of the plant angle, vertical or rate. An aid at a lower rate is taken at every sample
/// with the same density, which is the same filter while it is slow. Errors: a filter of another rate or gyro, of
/// another plant, or with an aid at another rate that it follows quickly.
pub fn drift_of(setting: &Setting, half: Half, walk: f64, path: &Path) -> Result<HalfFeed, LoopError> {
    let design = FilterDesign::read(path).map_err(|e| LoopError(format!(".filter: {e}")))?;
    let shown = path.display();
    let wrong = |message: String| LoopError(format!(".filter: {shown}: {message}"));
    if design.quantity != Quantity::AngularRate || !["angle", "vertical", "rate"].contains(&design.plant.as_str()) {
        return Err(wrong(format!(
            "is of the plant '{}' of {}; a drift feed takes angle, vertical or rate of an angular rate",
            design.plant,
            design.quantity.name()
        )));
    }
    of_same_rate(&design, setting).map_err(&wrong)?;
    let mut filters = Vec::new();
    for (i, rate) in half.rates().iter().enumerate() {
        let number = half.gyros()[i];
        // nothing measures the angle that the yaw rate is integrated to
        if design.plant != "rate" && *rate != half.integrated() {
            continue;
        }
        let letter = ["x", "y", "z"][number];
        let axis = match design.axes.as_slice() {
            [one] => one,
            axes => axes
                .iter()
                .find(|axis| axis.name == letter)
                .or(axes.get(number))
                .ok_or_else(|| wrong(format!("has no axis {letter}; tune one of three axes, or of one for all")))?,
        };
        of_same_gyro(axis, setting, number).map_err(&wrong)?;
        let mut model = axis.model.clone();
        // an aid at a lower rate is one at every sample with the same density
        let every = model.every.clone();
        for (i, every) in every.iter().enumerate() {
            model.r[(i, i)] *= *every as f64;
        }
        model.every.fill(1);
        let interval = setting.interval();
        for state in 0..model.states.len() {
            // a constant that nothing drives has no steady gain
            if model.states[state].name == "bias" && model.q[(state, state)] == 0.0 {
                model.q[(state, state)] = walk * walk * interval;
            }
        }
        let filter = Kalman::new(&axis.name, model).map_err(|e| wrong(e.0))?;
        let quick = (0..every.len()).find(|i| every[*i] as f64 * filter.steady.gain.column(*i).amax() > SLOW);
        if let Some(i) = quick.filter(|i| every[*i] != 1) {
            return Err(wrong(format!(
                "axis {}: {} is measured every {} samples and moves the estimates too quickly for a loop that is \
                 judged at one rate; tune it with that aid at {} Hz and the same density",
                axis.name,
                filter.model.measurements[i].name,
                every[i],
                digits(setting.rate)
            )));
        }
        filters.push((*rate, filter));
    }
    Ok(of_drift(setting, half, filters))
}

fn of_same_rate(design: &FilterDesign, setting: &Setting) -> Result<(), String> {
    if setting::same_rate(design.sample_rate_hz, setting.rate) {
        return Ok(());
    }
    Err(format!(
        "sample_rate: {} Hz, the autopilot has {} Hz; tune a filter of its rate",
        digits(design.sample_rate_hz),
        digits(setting.rate)
    ))
}

/// `number`: of the gyro that the filter of an axis has.
fn of_same_gyro(axis: &AxisDesign, setting: &Setting, number: usize) -> Result<(), String> {
    let Some(params) = &setting.gyro else { return Ok(()) };
    let [theirs, ours] = [&axis.noise, &params.axes[number]].map(|axis| axis.noise().white_density());
    if !(ours > 0.0 && theirs > 0.0) || (1.0 / OTHER_GYRO..=OTHER_GYRO).contains(&(theirs / ours)) {
        return Ok(());
    }
    Err(format!(
        "axis {}: made for a gyro of {} deg/s/sqrt(Hz), that of sensors.gyro has {}; tune it with these parameters",
        axis.name,
        digits(theirs.to_degrees()),
        digits(ours.to_degrees())
    ))
}

/// The system of filters, each of the gyro of one rate; an angle that none of them has is that of the complementary
/// filter, with the gyro less its drift.
fn of_drift(setting: &Setting, half: Half, mut filters: Vec<(usize, Kalman)>) -> HalfFeed {
    let interval = setting.interval();
    let inputs = AIRFRAME + half.surfaces().len();
    let mut system = pass(half, interval);
    // what the complementary filter then has to take as its rate
    let mut has_angle = false;
    for (rate, filter) in &mut filters {
        let (own, corrected, gain) = filter.parts();
        let model = &filter.model;
        let (n, first) = (model.states.len(), system.states());
        let angle = model.states.iter().position(|state| ["angle", "tilt"].contains(&state.name.as_str()));
        // z of what is measured: the gyro, or the angle times what H has for it
        let mut measured = DMatrix::zeros(model.measurements.len(), inputs);
        for (row, measurement) in model.measurements.iter().enumerate() {
            match angle.map(|angle| model.h[(row, angle)]) {
                Some(scale) if scale != 0.0 => measured[(row, ANGLE)] = scale,
                _ if measurement.name == "angular_rate" => measured[(row, *rate)] = 1.0,
                // an aid of something else that the airplane does not measure stays at what is expected of it
                _ => {}
            }
        }
        filter.seen = measured.columns(0, AIRFRAME).into_owned();
        let mut input = DMatrix::zeros(n, inputs);
        if !model.inputs.is_empty() {
            input.column_mut(*rate).copy_from(&model.g.column(0));
        }
        let wide = StateSpace {
            a: own.a,
            b: own.b * &measured + input,
            c: DMatrix::zeros(AIRFRAME, n),
            d: DMatrix::zeros(AIRFRAME, inputs),
            interval: Some(interval),
        };
        system = joined(&system, &wide);
        // estimates: rows of x̂ = (I − K H) x + K z
        let mut estimate = |row: usize, of: &DMatrix<f64>, keep: f64| {
            system.c.view_mut((row, first), (1, n)).copy_from(&(of * &corrected));
            let direct = of * &gain * &measured;
            for j in 0..inputs {
                system.d[(row, j)] = keep * system.d[(row, j)] + direct[(0, j)];
            }
        };
        match model.states.iter().position(|state| state.name == "rate") {
            Some(state) => estimate(*rate, &unit_row(n, state), 0.0),
            None => estimate(*rate, &-model.drift_row(), 1.0),
        }
        if let Some(angle) = angle {
            estimate(ANGLE, &unit_row(n, angle), 0.0);
            has_angle = true;
        }
    }
    if !has_angle {
        let behind = raw(setting, half).system;
        // the angle behind the estimates; the commands go past
        let mut padded = system.clone();
        let m = half.surfaces().len();
        padded.c = padded.c.insert_rows(AIRFRAME, m, 0.0);
        padded.d = padded.d.insert_rows(AIRFRAME, m, 0.0);
        for i in 0..m {
            padded.d[(AIRFRAME + i, AIRFRAME + i)] = 1.0;
        }
        system = padded.then(&behind);
    }
    HalfFeed { system, filters: filters.into_iter().map(|(_, filter)| filter).collect(), law: None }
}

/// Both with the same inputs, outputs added.
fn joined(a: &StateSpace, b: &StateSpace) -> StateSpace {
    let mut out = a.beside(b);
    let (inputs, outputs) = (a.inputs(), a.c.nrows());
    let add = |both: &DMatrix<f64>, by_rows: bool| {
        let (rows, columns) = if by_rows { (outputs, both.ncols()) } else { (both.nrows(), inputs) };
        let offset = if by_rows { (outputs, 0) } else { (0, inputs) };
        DMatrix::from_fn(rows, columns, |i, j| both[(i, j)] + both[(i + offset.0, j + offset.1)])
    };
    out.b = add(&out.b, false);
    out.c = add(&out.c, true);
    out.d = &a.d + &b.d;
    out
}

fn unit_row(n: usize, at: usize) -> DMatrix<f64> {
    DMatrix::from_fn(1, n, |_, j| f64::from(u8::from(j == at)))
}

/// Model of a half as a Kalman filter knows it: airframe, servos, turbulence, commands on their way, bias and drift of
/// each gyro, drift of the reference; measured are the gyros and the angle.
///
/// Errors: no gyro or reference, or one without white noise.
pub fn airframe_model(setting: &Setting, half: Half, walk: f64) -> Result<LinearModel, LoopError> {
    let plant = Plant::new(setting, half)?;
    let sensors = Sensors::new(setting, half)?;
    let interval = setting.interval();
    let reference = setting.reference.filter(|reference| reference.white > 0.0).ok_or_else(|| {
        LoopError("an airframe filter needs a noisy attitude reference: give sensors.attitude".into())
    })?;
    let mut blocks: Vec<(usize, String, LinearModel)> = Vec::new();
    for (i, rate) in half.rates().iter().enumerate() {
        let axis = axis_of(setting, half.gyros()[i])?;
        let errors = with_bias(axis, &sensors.gyros[i], walk, interval)?;
        blocks.push((*rate, format!("gyro_{}", ["x", "y", "z"][half.gyros()[i]]), errors));
    }
    let drift = reference.drift.map(|(std_dev, time)| [std_dev, time]);
    let aid =
        aid_errors(named("attitude", "rad"), reference.white, drift, interval).map_err(|e| LoopError(e.to_string()))?;
    blocks.push((ANGLE, "attitude".into(), aid));
    let own = plant.size();
    let n = own + blocks.iter().map(|(_, _, block)| block.states.len()).sum::<usize>();
    let m = half.surfaces().len();
    let mut model = LinearModel {
        dt: interval,
        states: plant.states.clone(),
        inputs: half.surfaces().iter().map(|name| named(&format!("{name}_command"), "rad")).collect(),
        measurements: Vec::new(),
        every: vec![1; blocks.len()],
        outputs: Vec::new(),
        f: DMatrix::zeros(n, n),
        g: DMatrix::zeros(n, m),
        h: DMatrix::zeros(blocks.len(), n),
        q: DMatrix::zeros(n, n),
        r: DMatrix::zeros(blocks.len(), blocks.len()),
        x0: DVector::zeros(n),
        p0: DMatrix::zeros(n, n),
    };
    model.f.view_mut((0, 0), (own, own)).copy_from(&plant.f);
    model.g.view_mut((0, 0), (own, m)).copy_from(&plant.g);
    model.q.view_mut((0, 0), (own, own)).copy_from(&plant.q);
    model.p0.view_mut((0, 0), (own, own)).copy_from(&prior(setting, &plant)?);
    let mut at = own;
    for (row, (state, name, block)) in blocks.iter().enumerate() {
        let size = block.states.len();
        model.h[(row, *state)] = 1.0;
        model.h.view_mut((row, at), (1, size)).copy_from(&block.h);
        model.r[(row, row)] = block.r[(0, 0)];
        model.f.view_mut((at, at), (size, size)).copy_from(&block.f);
        model.q.view_mut((at, at), (size, size)).copy_from(&block.q);
        model.p0.view_mut((at, at), (size, size)).copy_from(&block.p0);
        model.states.extend(block.states.iter().map(|s| named(&format!("{name}.{}", s.name), &s.unit)));
        model.measurements.push(named(name, &block.measurements[0].unit));
        at += size;
    }
    let output = |i: usize| Output {
        name: model.states[i].name.clone(),
        unit: model.states[i].unit.clone(),
        row: unit_row(n, i).iter().copied().collect(),
    };
    model.outputs = (0..AIRFRAME).map(output).collect();
    // the drift of each gyro; that of the one the angle is integrated of is the filter's
    let mut first = own;
    for (row, (_, name, block)) in blocks.iter().enumerate().take(half.rates().len()) {
        let drift = block.drift_row();
        let own = row == 0;
        model.outputs.push(Output {
            name: if own { DRIFT.into() } else { format!("{name}.{DRIFT}") },
            unit: block.measurements[0].unit.clone(),
            row: (0..n).map(|j| j.checked_sub(first).and_then(|j| drift.get(j)).copied().unwrap_or(0.0)).collect(),
        });
        first += block.states.len();
    }
    Ok(model)
}

/// The airframe filters of a flight as designs: axis y has the filter of pitch, axis x that of roll and yaw, each about
/// the trim. `params`: of the three gyros. Errors: as of [`airframe_model`]; no steady state.
pub fn airframe_designs(
    setting: &Setting,
    params: &Params,
    walk: f64,
) -> Result<Vec<(AxisDesign, AxisReport)>, LoopError> {
    let each = Half::BOTH.iter().map(|half| {
        let model = airframe_model(setting, *half, walk)?;
        let size = model.states.len();
        let mut turbulence = DMatrix::zeros(size, size);
        let plant = Plant::new(setting, *half)?;
        turbulence.view_mut((0, 0), plant.q.shape()).copy_from(&plant.q);
        let about = about(setting, *half, &model);
        let joined = Joined { model, noise: vec![("gusts".into(), turbulence)], flicker: None, warnings: Vec::new() };
        let number = half.gyros()[0];
        let axis = AxisParams { name: ["x", "y", "z"][number].into(), ..params.axes[number].clone() };
        let (mut design, report) = designed(&axis, joined).map_err(|e| LoopError(e.to_string()))?;
        design.about = about;
        Ok((design, report))
    });
    each.collect()
}

/// Commands and measurements in the steady flight, where they are not zero.
fn about(setting: &Setting, half: Half, model: &LinearModel) -> BTreeMap<String, f64> {
    let trim = &setting.trim;
    let controls = [trim.controls.elevator, trim.controls.aileron, trim.controls.rudder];
    let commands = half.actuators().iter().map(|number| controls[*number]);
    let rates = half.gyros().iter().map(|axis| trim.rate[*axis]);
    let angle = [trim.theta, trim.phi][usize::from(half == Half::RollYaw)];
    let names = model.inputs.iter().chain(&model.measurements).map(|named| named.name.clone());
    names.zip(commands.chain(rates).chain([angle])).filter(|(_, value)| *value != 0.0).collect()
}

/// What is known before the first measurement: the airplane somewhere about its trim, surfaces too, the turbulence
/// by its law.
fn prior(setting: &Setting, plant: &Plant) -> Result<DMatrix<f64>, LoopError> {
    let n = plant.size();
    let mut p0 = DMatrix::zeros(n, n);
    for (i, state) in plant.states.iter().enumerate().take(plant.turbulence.0) {
        // an airplane that has just been handed over: 2 m/s, 10 deg and 10 deg/s off; surfaces 2 deg, at 20 deg/s
        let spread = match (state.unit.as_str(), i < AIRFRAME) {
            ("m/s", _) => 2.0,
            (_, true) => 10.0_f64.to_radians(),
            ("rad", false) => 2.0_f64.to_radians(),
            _ => 20.0_f64.to_radians(),
        };
        p0[(i, i)] = spread * spread;
    }
    let first = usize::from(plant.half == Half::RollYaw) * 4;
    for (i, dryden) in setting.dryden.iter().enumerate() {
        let law = dryden.model().state_covariance()?;
        let at = plant.turbulence.0 + 4 * i;
        p0.view_mut((at, at), (4, 4)).copy_from(&law.view((first, first), (4, 4)));
    }
    for i in plant.turbulence.1..n {
        p0[(i, i)] = 2.0_f64.to_radians().powi(2);
    }
    Ok(p0)
}

/// The airframe filter at the airspeed `at` (m/s) between those of `settings`, slowest first: model and gain are
/// interpolated; beyond the ends they are those of the end.
pub fn scheduled(settings: &[Setting], at: f64, half: Half, walk: f64) -> Result<HalfFeed, LoopError> {
    let speed = |setting: &Setting| setting.trim.airspeed();
    let above = settings.iter().position(|setting| speed(setting) >= at).unwrap_or(settings.len() - 1);
    let below = above.saturating_sub(1);
    let make = |setting: &Setting| Kalman::new(half.name(), airframe_model(setting, half, walk)?);
    let (mut low, high) = (make(&settings[below])?, make(&settings[above])?);
    let (from, to) = (speed(&settings[below]), speed(&settings[above]));
    let share = if to > from { ((at - from) / (to - from)).clamp(0.0, 1.0) } else { 0.0 };
    let between = |a: &mut DMatrix<f64>, b: &DMatrix<f64>| *a = &*a * (1.0 - share) + b * share;
    let (a, b) = (&mut low.model, &high.model);
    for (a, b) in [(&mut a.f, &b.f), (&mut a.g, &b.g), (&mut a.h, &b.h), (&mut a.q, &b.q), (&mut a.r, &b.r)] {
        between(a, b);
    }
    between(&mut a.p0, &b.p0);
    let (a, b) = (&mut low.steady, &high.steady);
    between(&mut a.gain, &b.gain);
    between(&mut a.predicted_covariance, &b.predicted_covariance);
    between(&mut a.innovation_covariance, &b.innovation_covariance);
    Ok(of_airframe(half, low))
}

/// The airframe filter with optimal gains of all its states and what the same gains do on the true states: disk margins
/// of each surface. u = −K x̂, K = (R + GᵀXG)⁻¹GᵀXF with the X of the regulator; `recovery` (rad) is a noise on each
/// command that the filter believes in (Doyle and Stein 1979, IEEE TAC 24(4)).
///
/// Errors: as of [`airframe_model`]; weights without a stabilising gain.
pub fn lqg(
    setting: &Setting,
    half: Half,
    walk: f64,
    weights: (&[f64; 4], &[f64]),
    recovery: f64,
) -> Result<(HalfFeed, Vec<f64>), LoopError> {
    let plant = Plant::new(setting, half)?;
    let (n, m) = (plant.size(), half.surfaces().len());
    let mut q = DMatrix::zeros(n, n);
    (0..AIRFRAME).for_each(|i| q[(i, i)] = weights.0[i]);
    let r = DMatrix::from_diagonal(&DVector::from_column_slice(weights.1));
    let none = |e: crate::numerics::linalg::LinalgError| {
        LoopError(format!("no optimal gains of {}: {e}; give other weights", half.title()))
    };
    // the regulator is the filter of the transposed plant
    let x = dare_doubling(&plant.f.transpose(), &plant.g.transpose(), &q, &r).map_err(none)?.covariance;
    let k = solve(&r + plant.g.transpose() * &x * &plant.g, &(plant.g.transpose() * &x * &plant.f)).map_err(none)?;
    let interval = Some(setting.interval());
    let true_states =
        StateSpace { a: plant.f.clone(), b: plant.g.clone(), c: k.clone(), d: DMatrix::zeros(m, m), interval };
    let of_true = margins(&true_states, 0.0, 0.0).map_err(|e| LoopError(e.to_string()))?;
    let mut model = airframe_model(setting, half, walk)?;
    let mut believed = model.q.view_mut((0, 0), (n, n));
    believed += &plant.g * plant.g.transpose() * (recovery * recovery);
    let mut gains = DMatrix::zeros(m, model.states.len());
    gains.view_mut((0, 0), (m, n)).copy_from(&-&k);
    let filter = Kalman::new(half.name(), model)?;
    let feed = HalfFeed { law: Some(StateSpace::gain(gains, interval)), ..with_outputs(half, filter, None) };
    Ok((feed, of_true.single.iter().map(|margin| margin.disk.margin).collect()))
}

/// The airframe filter of a setting.
pub fn airframe(setting: &Setting, half: Half, walk: f64) -> Result<HalfFeed, LoopError> {
    let model = airframe_model(setting, half, walk)?;
    Ok(of_airframe(half, Kalman::new(half.name(), model)?))
}

/// The airspeed (m/s) that a filter.json of the plant airplane was made for, where it says so.
pub fn airspeed_of(path: &Path) -> Result<Option<f64>, LoopError> {
    let design = FilterDesign::read(path).map_err(|e| LoopError(format!(".filter: {e}")))?;
    Ok(design.tuning["flight"]["airspeed_m_s"].as_f64())
}

/// The same by filter.json of the plant airplane. Errors: another plant, rate or gyro, an axis that is missing,
/// commands and measurements of another half.
pub fn airframe_of(setting: &Setting, half: Half, path: &Path) -> Result<HalfFeed, LoopError> {
    let design = FilterDesign::read(path).map_err(|e| LoopError(format!(".filter: {e}")))?;
    let wrong = |message: String| LoopError(format!(".filter: {}: {message}", path.display()));
    if design.plant != AIRPLANE {
        return Err(wrong(format!("is of the plant '{}'; an airframe feed takes airplane", design.plant)));
    }
    of_same_rate(&design, setting).map_err(&wrong)?;
    let letter = ["x", "y", "z"][half.gyros()[0]];
    let axis = design.axes.iter().find(|axis| axis.name.ends_with(letter));
    let axis = axis.ok_or_else(|| wrong(format!("has no axis {letter}, which has the filter of {}", half.title())))?;
    of_same_gyro(axis, setting, half.gyros()[0]).map_err(&wrong)?;
    let found = [axis.model.inputs.len(), axis.model.measurements.len()];
    let expected = [half.surfaces().len(), half.rates().len() + 1];
    if found != expected || axis.model.states.len() < AIRFRAME {
        return Err(wrong(format!(
            "axis {letter}: {} commands and {} measurements; {} has {} and {}",
            found[0],
            found[1],
            half.title(),
            expected[0],
            expected[1]
        )));
    }
    Ok(of_airframe(half, Kalman::new(&axis.name, axis.model.clone()).map_err(|e| wrong(e.0))?))
}

/// The filter as a feed: what it measures are the gyros and the angle, what it gives are the states of the airframe.
pub fn of_airframe(half: Half, filter: Kalman) -> HalfFeed {
    with_outputs(half, filter, Some(AIRFRAME))
}

/// The same with its first states as outputs, or all.
fn with_outputs(half: Half, mut filter: Kalman, outputs: Option<usize>) -> HalfFeed {
    let (n, m) = (filter.model.states.len(), half.surfaces().len());
    let mut measured = DMatrix::zeros(half.rates().len() + 1, AIRFRAME + m);
    for (row, state) in half.rates().iter().chain(&[ANGLE]).enumerate() {
        measured[(row, *state)] = 1.0;
    }
    filter.seen = measured.columns(0, AIRFRAME).into_owned();
    let (own, corrected, gain) = filter.parts();
    let mut b = own.b * &measured;
    b.view_mut((0, AIRFRAME), (n, m)).copy_from(&filter.model.g);
    let system = StateSpace {
        a: own.a,
        b,
        c: corrected.rows(0, outputs.unwrap_or(n)).into_owned(),
        d: gain.rows(0, outputs.unwrap_or(n)) * &measured,
        interval: own.interval,
    };
    HalfFeed { system, filters: vec![filter], law: None }
}
