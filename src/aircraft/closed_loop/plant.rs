//! One half of the airplane at the samples of the autopilot: airframe, servos, turbulence, commands on their way.
//!
//! In continuous time ẋ = A x + B δ + E g for the airframe, δ̈ = ω²(δc − δ) − 2ζω δ̇ for each servo and the filters of
//! `atmosphere::dryden` for the gust; all of it is discretised exactly with the command held (Van Loan 1978). A delay
//! of whole samples is a register per sample; of a part of a sample the command before acts first:
//! x⁺ = F x + Γ₀ u(k − n) + Γ₁ u(k − n − 1), Γ₁ = e^(A(Δ − τ)) ∫₀^τ e^(As) ds B, Γ₀ = ∫₀^(Δ−τ) e^(As) ds B.

use nalgebra::DMatrix;

use super::LoopError;
use super::half::{AIRFRAME, Half};
use crate::aircraft::atmosphere::dryden;
use crate::aircraft::flight::Setting;
use crate::model::Named;
use crate::numerics::van_loan::van_loan;

/// Parts of a sample shorter than this are rounding of a whole number of samples.
const NO_PART: f64 = 1e-6;
/// Samples of delay: an autopilot that waits for longer controls nothing, and the cost grows with their third power.
const MOST_DELAY: usize = 100;
/// States and gusts of each half in the turbulence model u | w1 w2 q | v1 v2 r | p.
const TURBULENCE: [(usize, [usize; 3]); 2] = [(0, [0, 2, 4]), (4, [1, 3, 5])];
/// Turbulence states of a half.
const GUST_STATES: usize = dryden::STATES / 2;

/// x⁺ = F x + G u + v, v ~ N(0, Q).
#[derive(Clone, Debug)]
pub struct Plant {
    pub half: Half,
    /// s.
    pub interval: f64,
    pub states: Vec<Named>,
    pub f: DMatrix<f64>,
    /// One column per surface.
    pub g: DMatrix<f64>,
    /// Of the turbulence.
    pub q: DMatrix<f64>,
    /// Of a gust u w q or v p r that is held over a sample.
    pub gust: DMatrix<f64>,
    /// Of each surface: the states of its angle and of its rate; a surface without a servo has no rate.
    pub surfaces: Vec<(Option<usize>, Option<usize>)>,
    /// First and last state of the turbulence, the last not included.
    pub turbulence: (usize, usize),
}

impl Plant {
    /// Of a setting. Errors: numbers too large for the exponential.
    pub fn new(setting: &Setting, half: Half) -> Result<Plant, LoopError> {
        let interval = setting.interval();
        let model = match half {
            Half::Pitch => &setting.models.longitudinal,
            Half::RollYaw => &setting.models.lateral,
        };
        let columns: Vec<usize> =
            (0..model.inputs.len()).filter(|i| half.surfaces().contains(&model.inputs[*i].0)).collect();
        let m = half.surfaces().len();
        let mut states: Vec<Named> = model.states.iter().map(|(name, unit)| named(name, unit)).collect();
        let actuators: Vec<_> = half.actuators().iter().map(|i| setting.airplane.actuators[*i]).collect();
        let servos = actuators.iter().flatten().count();
        let turbulences = setting.dryden.len();
        let n = AIRFRAME + 2 * servos + GUST_STATES * turbulences;
        let mut a = DMatrix::zeros(n, n);
        let mut b = DMatrix::zeros(n, m);
        a.view_mut((0, 0), (AIRFRAME, AIRFRAME)).copy_from(&model.a);
        let mut surfaces = Vec::new();
        for (surface, actuator) in actuators.iter().enumerate() {
            let column = model.b.column(columns[surface]);
            let Some(actuator) = actuator else {
                b.view_mut((0, surface), (AIRFRAME, 1)).copy_from(&column);
                surfaces.push((None, None));
                continue;
            };
            let (at, w) = (states.len(), actuator.frequency);
            a.view_mut((0, at), (AIRFRAME, 1)).copy_from(&column);
            a[(at, at + 1)] = 1.0;
            (a[(at + 1, at)], a[(at + 1, at + 1)]) = (-w * w, -2.0 * actuator.damping * w);
            b[(at + 1, surface)] = w * w;
            let name = half.surfaces()[surface];
            states.extend([named(name, "rad"), named(&format!("{name}_rate"), "rad/s")]);
            surfaces.push((Some(at), Some(at + 1)));
        }
        let first = states.len();
        let mut noise = DMatrix::zeros(n, 4 * turbulences);
        let (part, outputs) = TURBULENCE[usize::from(half == Half::RollYaw)];
        for (i, turbulence) in setting.dryden.iter().enumerate() {
            let at = states.len();
            let gust = turbulence.model();
            a.view_mut((at, at), (GUST_STATES, GUST_STATES))
                .copy_from(&gust.a.view((part, part), (GUST_STATES, GUST_STATES)));
            noise.view_mut((at, 4 * i), (GUST_STATES, 4)).copy_from(&gust.b.view((part, 0), (GUST_STATES, 4)));
            let c = DMatrix::from_fn(3, GUST_STATES, |row, j| gust.c[(outputs[row], part + j)]);
            a.view_mut((0, at), (AIRFRAME, GUST_STATES)).copy_from(&(&model.e * c));
            let numbered =
                |j: usize| if i == 0 { format!("gust.{}", j + 1) } else { format!("gust{}.{}", i + 1, j + 1) };
            states.extend((0..GUST_STATES).map(|j| named(&numbered(j), "1")));
        }
        let mut e = DMatrix::zeros(n, 3);
        e.view_mut((0, 0), (AIRFRAME, 3)).copy_from(&model.e);
        let (f, q) = van_loan(&a, &(&noise * noise.transpose()), interval)?;
        let (_, gust) = held(&a, &e, interval)?;
        let delays: Vec<(usize, f64)> = actuators
            .iter()
            .map(|actuator| parts(setting.delay, actuator.map_or(0.0, |actuator| actuator.delay), interval))
            .collect();
        let registers: Vec<usize> = delays.iter().map(|(whole, part)| whole + usize::from(*part > 0.0)).collect();
        if let Some(late) = registers.iter().find(|late| **late > MOST_DELAY) {
            return Err(LoopError(format!(
                "autopilot.delay: found {late} samples from measurement to servo; expected at most {MOST_DELAY}, each \
                 of which is a state of the loop: lower the delay, or autopilot.rate"
            )));
        }
        let all = n + registers.iter().sum::<usize>();
        let mut plant = Plant {
            half,
            interval,
            f: DMatrix::zeros(all, all),
            g: DMatrix::zeros(all, m),
            q: DMatrix::zeros(all, all),
            gust: DMatrix::zeros(all, 3),
            turbulence: (first, states.len()),
            states,
            surfaces,
        };
        plant.f.view_mut((0, 0), (n, n)).copy_from(&f);
        plant.q.view_mut((0, 0), (n, n)).copy_from(&q);
        plant.gust.view_mut((0, 0), (n, 3)).copy_from(&gust);
        let mut at = n;
        for (surface, (whole, part)) in delays.into_iter().enumerate() {
            let column = b.columns(surface, 1).into_owned();
            let (_, late) = held(&a, &column, interval - part)?;
            plant.enter(n, at, whole, surface, &late);
            if part > 0.0 {
                let (_, early) = held(&a, &column, part)?;
                let (rest, _) = held(&a, &column, interval - part)?;
                plant.enter(n, at, whole + 1, surface, &(rest * early));
            }
            for i in 0..registers[surface] {
                // the newest register takes the command, each other the one before it
                if i == 0 {
                    plant.g[(at, surface)] = 1.0
                } else {
                    plant.f[(at + i, at + i - 1)] = 1.0
                }
                plant.states.push(named(&format!("{}_command.{}", half.surfaces()[surface], i + 1), "rad"));
            }
            if plant.surfaces[surface].0.is_none() && whole > 0 {
                plant.surfaces[surface].0 = Some(at + whole - 1);
            }
            at += registers[surface];
        }
        Ok(plant)
    }

    /// The command of `age` samples ago acts by a column on the first `n` states.
    fn enter(&mut self, n: usize, registers: usize, age: usize, surface: usize, column: &DMatrix<f64>) {
        if age == 0 {
            self.g.view_mut((0, surface), (n, 1)).copy_from(column);
        } else {
            self.f.view_mut((0, registers + age - 1), (n, 1)).copy_from(column);
        }
    }

    pub fn size(&self) -> usize {
        self.states.len()
    }
}

/// Whole samples and the rest (s) of the delay from the measurement to the servo.
fn parts(samples: u64, actuator: f64, interval: f64) -> (usize, f64) {
    let own = actuator / interval;
    let whole = (own + NO_PART).floor();
    let rest = own - whole;
    (samples as usize + whole as usize, if rest > NO_PART { rest * interval } else { 0.0 })
}

/// e^(A t) and ∫₀ᵗ e^(As) ds B.
fn held(a: &DMatrix<f64>, b: &DMatrix<f64>, time: f64) -> Result<(DMatrix<f64>, DMatrix<f64>), LoopError> {
    let (n, m) = b.shape();
    let mut joined = DMatrix::zeros(n + m, n + m);
    joined.view_mut((0, 0), (n, n)).copy_from(a);
    joined.view_mut((0, n), (n, m)).copy_from(b);
    let (step, _) = van_loan(&joined, &DMatrix::zeros(n + m, n + m), time)?;
    Ok((step.view((0, 0), (n, n)).into_owned(), step.view((0, n), (n, m)).into_owned()))
}

pub(super) fn named(name: &str, unit: &str) -> Named {
    Named { name: name.to_string(), unit: unit.to_string() }
}
