//! Gains by a rule instead of by hand: successive loop closure on exact sensors, with servos and delay.

use std::path::Path;

use nalgebra::DMatrix;

use super::LoopError;
use super::circuit::{Circuit, law};
use super::half::{ANGLE, Half};
use super::half_feed::raw;
use super::modes::modes;
use crate::aircraft::control::response::StateSpace;
use crate::aircraft::flight::document::{GainsEntry, RuleEntry};
use crate::aircraft::flight::setting::Control;
use crate::aircraft::flight::{FlightDocument, RateGains, Setting};
use crate::numerics::optimize::bracketed_root;
use crate::params::Measured;
use crate::units::{Unit, digits};

/// The gain is looked for between these, times s of rate over rad of surface: below the first no damper acts, beyond
/// the second every servo is in its stop.
const GAINS: (f64, f64) = (1e-3, 10.0);
/// Steps of the search for the first gain that damps enough: a tenth of a decade each.
const STEPS: i32 = 40;

/// The document with gains in place of its rule, where it has one; paths are taken from `folder`. Errors: as of
/// [`Setting::new`]; no gain does what is asked for.
pub fn resolved(mut document: FlightDocument, folder: &Path) -> Result<FlightDocument, LoopError> {
    let Some(rule) = document.autopilot.as_mut().and_then(|autopilot| autopilot.rule.take()) else {
        return Ok(document);
    };
    let mut with = |gains: &RateGains| {
        document.autopilot.iter_mut().for_each(|autopilot| autopilot.gains = Some(entry(gains)));
        document.clone()
    };
    let washout = rule.washout.as_ref().map_or(1.0, Measured::si);
    let none = RateGains::of([0.0; 5], washout);
    let setting = Setting::new(&with(&none), folder)?;
    Ok(with(&gains(&setting, &rule, none)?))
}

/// Rate gain of the pitch damper: the least that damps the slowest oscillation enough; pitch angle: |L| = 1 at the
/// crossover, L of both gains together. Bank: the rate gain is a lead of the angle's, |L| = 1 at its crossover; yaw
/// damper: as that of pitch, the bank loop closed.
fn gains(setting: &Setting, rule: &RuleEntry, none: RateGains) -> Result<RateGains, LoopError> {
    let exact = Setting { gyro: None, reference: None, ..setting.clone() };
    let along = Loops { setting: &exact, half: Half::Pitch };
    let across = Loops { setting: &exact, half: Half::RollYaw };
    let kq = along.damper("short_period_damping", rule.short_period_damping, |kq| RateGains { kq, ..none })?;
    let ktheta = along.angle(&none, &[(2, kq)], &[(ANGLE, 1.0)], rule.pitch_crossover.si());
    let ktheta = ktheta?.ok_or_else(|| {
        LoopError(format!(
            "autopilot.rule.pitch_crossover: at {} rad/s the damper of kq {} s alone has a loop gain above one; ask \
             for a faster crossover or less damping",
            digits(rule.pitch_crossover.si()),
            digits(kq)
        ))
    })?;
    // bank and yaw act on each other: twice round is enough, since the second loop is the weaker
    let lead = rule.bank_lead.si();
    let (mut kphi, mut kr) = (0.0, 0.0);
    for _ in 0..2 {
        let found =
            across.angle(&RateGains { kr, ..none }, &[], &[(ANGLE, 1.0), (1, lead)], rule.bank_crossover.si())?;
        // the law has the other sign: δa = −kp p − kφ φ
        kphi = -found.unwrap_or_default();
        let held = RateGains { kphi, kp: lead * kphi, ..none };
        kr = across.damper("dutch_roll_damping", rule.dutch_roll_damping, |kr| RateGains { kr, ..held })?;
    }
    Ok(RateGains { kq, ktheta, kp: lead * kphi, kphi, kr, ..none })
}

struct Loops<'a> {
    setting: &'a Setting,
    half: Half,
}

impl Loops<'_> {
    fn circuit(&self, gains: RateGains) -> Result<Circuit, LoopError> {
        let with = Setting { control: Control::Gains(gains), ..self.setting.clone() };
        Circuit::new(self.setting, self.half, &raw(self.setting, self.half), &law(&with, self.half))
    }

    /// The least gain, of the sign that damps, by which the slowest oscillation has this damping. Errors: none does.
    fn damper(&self, key: &str, wanted: f64, with: impl Fn(f64) -> RateGains) -> Result<f64, LoopError> {
        // the slowest of them is the airframe's, the others are of servos
        let damping = |gain: f64| -> Result<f64, LoopError> {
            let modes = modes(&self.circuit(with(gain))?);
            Ok(modes.iter().find(|mode| mode.oscillates()).map_or(1.0, |mode| mode.damping()))
        };
        if damping(0.0)? >= wanted {
            return Ok(0.0);
        }
        let sign = if damping(GAINS.0)? >= damping(-GAINS.0)? { 1.0 } else { -1.0 };
        let (mut low, mut most) = (0.0, f64::NEG_INFINITY);
        for step in 0..=STEPS {
            let gain = GAINS.0 * (GAINS.1 / GAINS.0).powf(f64::from(step) / f64::from(STEPS));
            let found = damping(sign * gain)?;
            most = most.max(found);
            if found >= wanted {
                let over = |gain: f64| damping(sign * gain).ok().map(|found| found - wanted);
                let gain = bracketed_root(over, low, gain, 1e-9 * gain).unwrap_or(gain);
                return Ok(sign * gain);
            }
            low = gain;
        }
        Err(LoopError(format!(
            "autopilot.rule.{key}: expected {}, the servos and the delay allow at most {}; ask for less, or raise \
             autopilot.rate",
            digits(wanted),
            digits(most)
        )))
    }

    /// The gain k of the states `more` by which |Σ fixed + k Σ more| = 1 at `omega` (rad/s): those of the first
    /// surface, whose own loop is open while `others` are closed. None where the fixed part alone is above one.
    fn angle(
        &self,
        others: &RateGains,
        fixed: &[(usize, f64)],
        more: &[(usize, f64)],
        omega: f64,
    ) -> Result<Option<f64>, LoopError> {
        let circuit = self.circuit(*others)?;
        let n = circuit.a.nrows();
        let mut c = DMatrix::zeros(2, n);
        fixed.iter().for_each(|(state, factor)| c[(0, *state)] = *factor);
        more.iter().for_each(|(state, factor)| c[(1, *state)] = *factor);
        let b = circuit.broken.b.columns(0, 1).into_owned();
        let interval = Some(self.setting.interval());
        let response = StateSpace { a: circuit.a, b, c, d: DMatrix::zeros(2, 1), interval }.response().at(omega);
        let (have, add) = (response[(0, 0)], response[(1, 0)]);
        // the surface that raises the angle must fall with it
        let models = [&self.setting.models.longitudinal, &self.setting.models.lateral];
        let model = models[usize::from(self.half == Half::RollYaw)];
        let name = self.half.surfaces()[0];
        let column = model.inputs.iter().position(|(known, _)| *known == name).unwrap_or(0);
        let sign = -model.b[(self.half.integrated(), column)].signum();
        // |have + sign k add|² = 1
        let (square, half, rest) = (add.norm_sqr(), sign * (have * add.conj()).re, have.norm_sqr() - 1.0);
        Ok((rest < 0.0).then(|| sign * (-half + (half * half - square * rest).sqrt()) / square))
    }
}

/// Gains as they stand in flight.json.
fn entry(gains: &RateGains) -> GainsEntry {
    let time = |seconds: f64| Measured::from_si(seconds, None, Unit::second());
    GainsEntry {
        kq: time(gains.kq),
        ktheta: gains.ktheta,
        kp: time(gains.kp),
        kphi: gains.kphi,
        kr: time(gains.kr),
        washout: Some(time(gains.washout)),
    }
}
