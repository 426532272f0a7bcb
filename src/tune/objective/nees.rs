//! Parameters under which the expected NEES and NIS in a given truth are one, with the least movement.

use nalgebra::{DMatrix, DVector};
use schemars::JsonSchema;
use serde::Serialize;

use super::settled::{Settled, Truth};
use super::{Found, ObjectiveError, Problem};
use crate::model::LinearModel;
use crate::numerics::linalg::LinalgError;
use crate::tune::parameters::Group;
use crate::tune::{TuneError, plant};

/// Steps of the search at most.
const STEPS: usize = 60;
/// It ends when no logarithm moves by more.
const ENOUGH: f64 = 1e-9;
/// A logarithm moves by at most this in a step.
const REACH: f64 = 1.0;
/// Of numerical derivatives.
const STEP: f64 = 1e-4;
/// Directions in which the expectations answer by less than this share of the largest are left alone.
const FLAT: f64 = 1e-7;
/// Within this of one an expectation is one.
const MET: f64 = 1e-6;

/// Expectations under the truth after a long time, 1 when the filter is right.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct NeesAxis {
    pub axis: String,
    /// The states of the plant and the drift.
    pub outputs: Vec<String>,
    /// `E[e²]/σ²` of each, as identified.
    pub nees_before: Vec<f64>,
    pub nees: Vec<f64>,
    /// E[ν²/S], mean over the measurements.
    pub nis_before: f64,
    pub nis: f64,
    /// Whether all are one: with too much held they cannot be.
    pub met: bool,
}

/// NEES and NIS of one axis.
struct Expected {
    outputs: Vec<String>,
    nees: Vec<f64>,
    nis: f64,
}

fn expected(filter: &Settled, truth: &Truth) -> Result<Expected, LinalgError> {
    let real = filter.under(truth)?;
    let nees = real.sigma.iter().zip(&filter.claimed).map(|(real, claimed)| (real / claimed).powi(2)).collect();
    Ok(Expected { outputs: filter.outputs().iter().map(|o| o.name.clone()).collect(), nees, nis: real.nis })
}

/// The truth has the same plant and aids; the numbers of the sensor alone move.
///
/// Least |δ|² with ln NEES = ln NIS = 0, δ the shifts of the logarithms, by Newton steps δ ← J⁺(J δ − r), J⁺ the
/// pseudo-inverse; where there are fewer parameters than conditions, these in the sense of least squares. Not
/// `optimize::minimize`: with more parameters than conditions the least |δ|² chooses among many roots.
pub(super) fn choose(problem: &Problem<'_>, group: &Group, told: &mut Vec<NeesAxis>) -> Result<Found, ObjectiveError> {
    let truth = problem.request.truth.ok_or(ObjectiveError::NoTruth)?;
    let space = problem.space;
    if truth.quantity != space.params().quantity {
        let (truth, design) = (truth.quantity.si_unit(), space.params().quantity.si_unit());
        return Err(TuneError::TruthQuantity { truth, design }.into());
    }
    let names = |params: &crate::params::Params| {
        params.axes.iter().map(|axis| axis.name.as_str()).collect::<Vec<_>>().join(", ")
    };
    let mut truths = Vec::with_capacity(group.axes.len());
    for &axis in &group.axes {
        let name = problem.axis_name(axis);
        let found = truth
            .axes
            .iter()
            .find(|axis| axis.name == name)
            .ok_or_else(|| TuneError::TruthAxes { truth: names(truth), design: names(space.params()) })?;
        let built = plant::build(found, truth.quantity, problem.dt(), space.design(), problem.options)?;
        truths.push(Truth::new(&built.model));
    }
    let unbounded = |_| ObjectiveError::Unbounded { axis: problem.names(group) };
    let at = |shifts: &DVector<f64>| -> Result<Vec<Expected>, ObjectiveError> {
        let models = problem.models(group, shifts.as_slice())?;
        let of = |(model, truth): (&LinearModel, &Truth)| {
            let filter = Settled::new(model).map_err(problem.linalg(group))?;
            expected(&filter.ok_or_else(|| problem.nothing_drifts(group))?, truth).map_err(unbounded)
        };
        models.iter().zip(&truths).map(of).collect()
    };
    let residuals = |found: &[Expected]| {
        let of = |e: &Expected| e.nees.iter().copied().chain([e.nis]).map(f64::ln).collect::<Vec<_>>();
        DVector::from_vec(found.iter().flat_map(of).collect())
    };
    let mut shifts = DVector::zeros(group.free.len());
    let before = at(&shifts)?;
    for _ in 0..STEPS {
        let r = residuals(&at(&shifts)?);
        let mut jacobian = DMatrix::zeros(r.len(), group.free.len());
        for k in 0..group.free.len() {
            let side = |step: f64| {
                let mut moved = shifts.clone();
                moved[k] += step;
                at(&moved).map(|found| residuals(&found))
            };
            jacobian.set_column(k, &((side(STEP)? - side(-STEP)?) / (2.0 * STEP)));
        }
        let target = &jacobian * &shifts - &r;
        let largest = jacobian.norm();
        let Ok(inverse) = jacobian.pseudo_inverse(FLAT * largest.max(f64::MIN_POSITIVE)) else { break };
        let mut step = inverse * target - &shifts;
        let size = step.amax();
        if size > REACH {
            step *= REACH / size;
        }
        shifts += &step;
        if size < ENOUGH {
            break;
        }
    }
    let after = at(&shifts)?;
    for ((&axis, before), after) in group.axes.iter().zip(before).zip(after) {
        let one = |value: &f64| (value - 1.0).abs() < MET;
        let met = after.nees.iter().all(one) && one(&after.nis);
        told.push(NeesAxis {
            axis: problem.axis_name(axis),
            met,
            outputs: after.outputs,
            nees_before: before.nees,
            nees: after.nees,
            nis_before: before.nis,
            nis: after.nis,
        });
    }
    Ok(Found { std_devs: vec![None; shifts.len()], shifts: shifts.as_slice().to_vec() })
}
