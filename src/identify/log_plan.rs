//! How long to record, and at which rate, to know a parameter to a wished precision: what `plan` says.

use rayon::prelude::*;
use schemars::JsonSchema;
use serde::Serialize;

use super::plan::{LONGEST_S, Planned, Sampling, Thinning};
use crate::noise::NoiseModel;
use crate::params::AxisParams;
use crate::units::digits;

/// Lengths of the reverse table, h.
pub const HOURS: [f64; 4] = [1.0, 2.0, 4.0, 10.0];
/// A lower rate is worth its while when the log becomes longer by at most this.
const WORTH: f64 = 1.05;
/// The table of rates ends with one at which the log is this much longer.
const DEAR: f64 = 2.0;
/// Samples of the sensor in one of the log, at most.
const MOST: usize = 100_000;

/// What `plan --json` prints.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct LogPlan {
    /// "kfdesign-plan/1".
    pub format: &'static str,
    pub parameter: String,
    /// Wished relative standard deviation, 1 sigma.
    pub precision: f64,
    pub sample_rate_hz: f64,
    pub axes: Vec<AxisPlan>,
}

#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct AxisPlan {
    pub name: String,
    /// At the sensor's own rate; absent when ten years are not enough.
    pub duration_s: Option<f64>,
    /// Relative standard deviation after ten years, when those are not enough; absent when they say nothing at all.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub precision_after_ten_years: Option<f64>,
    pub rates: Vec<RatePlan>,
    /// The lowest rate of which the log is at most 5 % longer.
    pub recommended: Option<RatePlan>,
    pub parameters: Vec<ParameterPlan>,
    /// Of the parameter, with its unit.
    #[serde(skip)]
    pub value: Option<String>,
    #[serde(skip)]
    pub model: NoiseModel,
}

/// A rate, and what it asks for.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct RatePlan {
    pub rate_hz: f64,
    /// Samples of the sensor in one of the log.
    pub every: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub thinning: Option<Thinning>,
    pub duration_s: Option<f64>,
    /// Against the sensor's own rate.
    pub ratio: Option<f64>,
}

/// Relative standard deviations; absent where the log cannot tell the parameter.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct ParameterPlan {
    pub parameter: String,
    pub after_duration: Option<f64>,
    pub after_hours: Vec<AfterHours>,
}

#[derive(Clone, Copy, Debug, Serialize, JsonSchema)]
pub struct AfterHours {
    pub hours: f64,
    pub precision: Option<f64>,
}

/// `axes` without the parameter are left out; axes alike are planned once.
pub fn log_plan(axes: &[&AxisParams], parameter: &str, precision: f64, sample_rate_hz: f64) -> LogPlan {
    let mut unlike: Vec<&AxisParams> = Vec::new();
    for axis in axes {
        if !unlike.iter().any(|other| other.noise() == axis.noise()) {
            unlike.push(axis);
        }
    }
    let planned = unlike.into_par_iter().filter_map(|axis| of_axis(axis, parameter, precision, sample_rate_hz));
    let plans: Vec<AxisPlan> = planned.collect();
    let of = |axis: &&AxisParams| {
        let plan = plans.iter().find(|plan| plan.model == axis.noise())?;
        Some(AxisPlan { name: axis.name.clone(), ..plan.clone() })
    };
    let axes = axes.iter().filter_map(of).collect();
    LogPlan { format: "kfdesign-plan/1", parameter: parameter.to_string(), precision, sample_rate_hz, axes }
}

fn of_axis(axis: &AxisParams, parameter: &str, precision: f64, rate_hz: f64) -> Option<AxisPlan> {
    let model = axis.noise();
    let planned = Planned::new(&model);
    let index = planned.names().position(|name| name == parameter)?;
    let own = Sampling { sensor_rate_hz: rate_hz, every: 1, thinning: Thinning::Averages };
    let duration_s = planned.duration(index, precision, &own);
    let row = |sampling: &Sampling, of_the_sensor: bool| {
        let needed = planned.duration(index, precision, sampling);
        RatePlan {
            rate_hz: sampling.rate_hz(),
            every: sampling.every,
            thinning: (!of_the_sensor).then_some(sampling.thinning),
            duration_s: needed,
            ratio: needed.zip(duration_s).map(|(needed, own)| needed / own),
        }
    };
    let faster = model.of_samples().is_none();
    let rates = if duration_s.is_some() { rates(&own, &row, faster) } else { vec![] };
    let recommended = duration_s.map(|_| recommended(&own, &row));
    let at = |span_s: f64| planned.precision(span_s, &own);
    let after: Vec<f64> = duration_s.map(&at).unwrap_or_default();
    let after_hours = HOURS.map(|hours| (hours, at(3600.0 * hours)));
    let finite = |values: &[f64], i: usize| values.get(i).copied().filter(|v| v.is_finite());
    let parameters = planned.names().enumerate().map(|(i, name)| ParameterPlan {
        parameter: name.to_string(),
        after_duration: finite(&after, i),
        after_hours: after_hours
            .iter()
            .map(|(hours, all)| AfterHours { hours: *hours, precision: finite(all, i) })
            .collect(),
    });
    let mut written = axis.clone();
    let value = written.noise_parameters().find(|(name, _)| name == parameter);
    Some(AxisPlan {
        name: axis.name.clone(),
        precision_after_ten_years: if duration_s.is_some() { None } else { finite(&at(LONGEST_S), index) },
        duration_s,
        rates,
        recommended,
        parameters: parameters.collect(),
        value: value.map(|(_, value)| format!("{} {}", digits(value.value), value.unit)),
        model,
    })
}

/// Ten times the rate (if no term counts samples), the rate itself, a tenth, … until averages ask for a log twice as
/// long.
fn rates(own: &Sampling, row: &impl Fn(&Sampling, bool) -> RatePlan, faster: bool) -> Vec<RatePlan> {
    let ten_times = Sampling { sensor_rate_hz: 10.0 * own.sensor_rate_hz, ..*own };
    let of_the_sensor = if faster { vec![ten_times, *own] } else { vec![*own] };
    let mut rates: Vec<RatePlan> = of_the_sensor.iter().map(|sampling| row(sampling, true)).collect();
    let mut every = 10;
    while every <= MOST {
        let averages = row(&Sampling { every, ..*own }, false);
        let dear = averages.ratio.is_none_or(|ratio| ratio > DEAR);
        rates.push(averages);
        if dear {
            break;
        }
        rates.push(row(&Sampling { every, thinning: Thinning::Decimation, ..*own }, false));
        every *= 10;
    }
    rates
}

/// Means of 2, 5, 10, 20 … samples, as many as cost at most 5 %.
fn recommended(own: &Sampling, row: &impl Fn(&Sampling, bool) -> RatePlan) -> RatePlan {
    let mut best = row(own, true);
    let steps = (0..).flat_map(|decade| [1, 2, 5].map(|digit| digit * 10_usize.pow(decade)));
    for every in steps.skip(1).take_while(|every| *every <= MOST) {
        let next = row(&Sampling { every, ..*own }, false);
        if next.ratio.is_none_or(|ratio| ratio > WORTH) {
            break;
        }
        best = next;
    }
    best
}
