//! The closed loop of one half: plant, sensors, feed and gains as one linear system.
//!
//! Truth: states of the plant and of the sensors' errors. Measured: y = H x + w. The controller has the states of
//! feed and gains, x_c⁺ = A_c x_c + B_c (y, θc), u = C_c x_c + D_c (y, θc), where the command that the feed knows is
//! its own.

use nalgebra::{DMatrix, DVector};

use super::LoopError;
use super::half::{AIRFRAME, ANGLE, Half};
use super::half_feed::HalfFeed;
use super::plant::{Plant, named};
use super::sensors::Sensors;
use crate::aircraft::control::response::{StateSpace, diagonal};
use crate::aircraft::flight::setting::Control;
use crate::aircraft::flight::{RateGains, Setting};
use crate::model::Named;

/// Where what moves the airplane comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    Gust,
    /// White noise of the gyro, and what else of its noise is no drift.
    GyroWhite,
    Drift,
    /// The attitude reference.
    Reference,
}

impl Source {
    pub const ALL: [Source; 4] = [Source::Gust, Source::GyroWhite, Source::Drift, Source::Reference];

    /// As in documents.
    pub fn name(self) -> &'static str {
        match self {
            Source::Gust => "gust",
            Source::GyroWhite => "gyro_white",
            Source::Drift => "drift",
            Source::Reference => "reference",
        }
    }
}

/// A number that is looked at: a row over all states.
#[derive(Clone, Debug)]
pub struct Looked {
    /// "q", "theta", "elevator", "elevator_rate".
    pub name: String,
    /// rad or rad/s.
    pub unit: &'static str,
    pub state: usize,
}

/// One half with its loop closed.
#[derive(Clone, Debug)]
pub struct Circuit {
    pub half: Half,
    /// s.
    pub interval: f64,
    /// Plant, then errors of the sensors, then controller.
    pub states: Vec<Named>,
    /// How many of them are of the plant, and of plant and sensors.
    pub plant: usize,
    pub truth: usize,
    pub a: DMatrix<f64>,
    /// Broken at all commands: inputs are those at the airplane, outputs those of the controller with the other
    /// sign, so that 1 + L is the return difference.
    pub broken: StateSpace,
    /// Covariance per sample that each source adds.
    pub sources: Vec<(Source, DMatrix<f64>)>,
    pub looked: Vec<Looked>,
    /// What the constant biases of the gyros add per sample.
    pub bias: DVector<f64>,
    /// What a commanded angle of one rad adds per sample.
    pub command: DVector<f64>,
    /// What a gust u w q or v p r, held over a sample, adds.
    pub gust: DMatrix<f64>,
}

/// The gains of a half: estimates of the four states in, commands out.
pub fn law(setting: &Setting, half: Half) -> StateSpace {
    let interval = setting.interval();
    let gains = match &setting.control {
        Control::Gains(gains) => gains,
        Control::Regulator(gains) => {
            return StateSpace::gain(-&gains[usize::from(half == Half::RollYaw)], Some(interval));
        }
    };
    let RateGains { kq, ktheta, kp, kphi, kr, washout } = *gains;
    let mut d = DMatrix::zeros(half.surfaces().len(), AIRFRAME);
    if half == Half::Pitch {
        (d[(0, 2)], d[(0, ANGLE)]) = (kq, ktheta);
        return StateSpace::gain(d, Some(interval));
    }
    (d[(0, 1)], d[(0, ANGLE)]) = (-kp, -kphi);
    // τs/(1 + τs) by the bilinear rule: y⁺ = a y + b (r⁺ − r)
    let (a, b) = ((2.0 * washout - interval) / (2.0 * washout + interval), 2.0 * washout / (2.0 * washout + interval));
    d[(1, 2)] = kr * b;
    let mut input = DMatrix::zeros(1, AIRFRAME);
    input[(0, 2)] = (a - 1.0) * b;
    let output = DMatrix::from_column_slice(2, 1, &[0.0, kr]);
    StateSpace { a: DMatrix::from_element(1, 1, a), b: input, c: output, d, interval: Some(interval) }
}

/// Feed and gains, those of the autopilot unless the feed has its own, with the loop of the command that the feed knows
/// closed: four measured states and the commanded angle in, commands out; states of the feed first.
pub fn controller(feed: &HalfFeed, autopilot: &StateSpace) -> StateSpace {
    let (feed, law) = (&feed.system, feed.law.as_ref().unwrap_or(autopilot));
    let (nf, nl, m) = (feed.states(), law.states(), law.c.nrows());
    let measured = feed.b.columns(0, AIRFRAME).into_owned();
    let known = feed.b.columns(AIRFRAME, m).into_owned();
    // what the gains see of (y, θc) beside the states of the feed
    let outputs = feed.c.nrows();
    let mut direct = DMatrix::zeros(outputs, AIRFRAME + 1);
    direct.view_mut((0, 0), (outputs, AIRFRAME)).copy_from(&feed.d.columns(0, AIRFRAME));
    direct[(ANGLE, AIRFRAME)] = -1.0;
    let mut c = DMatrix::zeros(m, nf + nl);
    c.view_mut((0, 0), (m, nf)).copy_from(&(&law.d * &feed.c));
    c.view_mut((0, nf), (m, nl)).copy_from(&law.c);
    let d = &law.d * &direct;
    let mut a = DMatrix::zeros(nf + nl, nf + nl);
    a.view_mut((0, 0), (nf, nf)).copy_from(&feed.a);
    a.view_mut((nf, 0), (nl, nf)).copy_from(&(&law.b * &feed.c));
    a.view_mut((nf, nf), (nl, nl)).copy_from(&law.a);
    let mut b = DMatrix::zeros(nf + nl, AIRFRAME + 1);
    b.view_mut((0, 0), (nf, AIRFRAME)).copy_from(&measured);
    b.view_mut((nf, 0), (nl, AIRFRAME + 1)).copy_from(&(&law.b * &direct));
    let mut fed_a = a.rows_mut(0, nf);
    fed_a += &known * &c;
    let mut fed_b = b.rows_mut(0, nf);
    fed_b += &known * &d;
    StateSpace { a, b, c, d, interval: law.interval }
}

impl Circuit {
    /// The loop of `feed` and of the gains of `law` around the airplane of `truth`.
    pub fn new(truth: &Setting, half: Half, feed: &HalfFeed, law: &StateSpace) -> Result<Circuit, LoopError> {
        let plant = Plant::new(truth, half)?;
        let sensors = Sensors::new(truth, half)?;
        let controller = controller(feed, law);
        let m = half.surfaces().len();
        let (n, nc) = (plant.size(), controller.states());
        // truth: plant, errors of each gyro, drift of the reference
        let mut states = plant.states.clone();
        let mut blocks = vec![plant.f.clone()];
        let mut noises: Vec<(usize, DMatrix<f64>, Source)> = vec![(0, plant.q.clone(), Source::Gust)];
        let mut measured: Vec<(usize, usize, DMatrix<f64>)> = Vec::new();
        for (gyro, rate) in sensors.gyros.iter().zip(half.rates()) {
            let Some(errors) = &gyro.errors else { continue };
            let (at, size) = (states.len(), errors.states.len());
            let keep = |drift: bool| {
                DMatrix::from_fn(size, size, |i, j| {
                    if gyro.is_drift(i) == drift && gyro.is_drift(j) == drift { errors.q[(i, j)] } else { 0.0 }
                })
            };
            noises.push((at, keep(true), Source::Drift));
            noises.push((at, keep(false), Source::GyroWhite));
            measured.push((*rate, at, errors.h.clone()));
            blocks.push(errors.f.clone());
            states.extend(errors.states.iter().map(|s| named(&format!("gyro.{}", s.name), &s.unit)));
        }
        let drift = sensors.reference.and_then(|reference| reference.drift);
        if let Some((std_dev, time)) = drift {
            let forgets = (-plant.interval / time).exp();
            let one = |x: f64| DMatrix::from_element(1, 1, x);
            noises.push((states.len(), one(std_dev * std_dev * (1.0 - forgets * forgets)), Source::Reference));
            measured.push((ANGLE, states.len(), one(1.0)));
            blocks.push(one(forgets));
            states.push(named("attitude.gauss_markov", "rad"));
        }
        let f = diagonal(&blocks.iter().collect::<Vec<_>>());
        let nt = states.len();
        let mut h = DMatrix::zeros(AIRFRAME + 1, nt);
        for i in 0..AIRFRAME {
            h[(i, i)] = 1.0;
        }
        for (row, at, of) in &measured {
            h.view_mut((*row, *at), (1, of.ncols())).copy_from(of);
        }
        let mut g = DMatrix::zeros(nt, m);
        g.view_mut((0, 0), (n, m)).copy_from(&plant.g);
        states.extend((0..nc).map(|i| named(&format!("controller.{}", i + 1), "1")));
        let total = nt + nc;
        let mut open = DMatrix::zeros(total, total);
        open.view_mut((0, 0), (nt, nt)).copy_from(&f);
        open.view_mut((nt, 0), (nc, nt)).copy_from(&(&controller.b * &h));
        open.view_mut((nt, nt), (nc, nc)).copy_from(&controller.a);
        let mut b = DMatrix::zeros(total, m);
        b.view_mut((0, 0), (nt, m)).copy_from(&g);
        let mut c = DMatrix::zeros(m, total);
        c.view_mut((0, 0), (m, nt)).copy_from(&(&controller.d * &h));
        c.view_mut((0, nt), (m, nc)).copy_from(&controller.c);
        let a = &open + &b * &c;
        // by which errors of the measurements, and the commanded angle, enter
        let mut enter = DMatrix::zeros(total, AIRFRAME + 1);
        enter.view_mut((0, 0), (nt, AIRFRAME + 1)).copy_from(&(&g * &controller.d));
        enter.view_mut((nt, 0), (nc, AIRFRAME + 1)).copy_from(&controller.b);
        let mut sources: Vec<(Source, DMatrix<f64>)> =
            Source::ALL.iter().map(|source| (*source, DMatrix::zeros(total, total))).collect();
        let mut add = |source: Source, at: usize, q: &DMatrix<f64>| {
            let Some((_, all)) = sources.iter_mut().find(|(known, _)| *known == source) else { return };
            let mut view = all.view_mut((at, at), q.shape());
            view += q;
        };
        for (at, q, source) in &noises {
            add(*source, *at, q);
        }
        let mut bias = DVector::zeros(total);
        for (gyro, rate) in sensors.gyros.iter().zip(half.rates()) {
            let column = enter.column(*rate).into_owned();
            add(Source::GyroWhite, 0, &(&column * column.transpose() * (gyro.white * gyro.white)));
            bias += column * gyro.bias;
        }
        if let Some(reference) = sensors.reference {
            let column = enter.column(ANGLE).into_owned();
            add(Source::Reference, 0, &(&column * column.transpose() * (reference.white * reference.white)));
        }
        let mut gust = DMatrix::zeros(total, 3);
        gust.view_mut((0, 0), (n, 3)).copy_from(&plant.gust);
        let command = enter.column(AIRFRAME).into_owned();
        let d = DMatrix::zeros(m, m);
        let looked = looked(half, &plant);
        let interval = Some(plant.interval);
        Ok(Circuit {
            half,
            interval: plant.interval,
            states,
            plant: n,
            truth: nt,
            a,
            broken: StateSpace { a: open, b, c: -c, d, interval },
            sources,
            looked,
            bias,
            command,
            gust,
        })
    }

    /// The number of a looked-at value's state.
    pub fn state(&self, name: &str) -> Option<usize> {
        self.looked.iter().find(|looked| looked.name == name).map(|looked| looked.state)
    }
}

/// Rates, angle, and of each surface the angle and the rate that there are.
fn looked(half: Half, plant: &Plant) -> Vec<Looked> {
    let rates = half.rate_names().iter().zip(half.rates());
    let mut out: Vec<Looked> =
        rates.map(|(name, state)| Looked { name: (*name).into(), unit: "rad/s", state: *state }).collect();
    out.push(Looked { name: half.angle_name().into(), unit: "rad", state: ANGLE });
    for (name, (angle, rate)) in half.surfaces().iter().zip(&plant.surfaces) {
        out.extend(angle.map(|state| Looked { name: (*name).into(), unit: "rad", state }));
        out.extend(rate.map(|state| Looked { name: format!("{name}_rate"), unit: "rad/s", state }));
    }
    out
}
