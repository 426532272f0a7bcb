//! The seed paper's recipe, step by step, with what each step costs.
//!
//! Read N off the −1/2 line, σ_g = N/√dt, smooth the log with a 100-sample moving average and take its standard
//! deviation for σ_GM, Tc = τ_max/1.89 from the maximum of the Allan curve after its minimum, B = minimum/0.664. No
//! step has an interval.

use schemars::JsonSchema;
use serde::Serialize;

use super::{Identified, IdentifyError, entry, usable};
use crate::allan::{self, AllanCurve, AllanPoint, Deviation, TauGrid, edf};
use crate::noise::{NoiseModel, Term};
use crate::numerics::reduce::{Moments, Sum, mean};
use crate::params::{AxisParams, Measured, NotIdentified};
use crate::units::{Unit, digits};

/// One step of the recipe.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Step {
    /// "N: the −1/2 line at tau = 1 s".
    pub what: String,
    pub formula: String,
    /// In `unit`; absent where the recipe finds nothing to read.
    pub value: Option<f64>,
    pub unit: String,
    /// What the recipe costs here, in a sentence.
    pub cost: String,
}

/// Samples in the recipe's moving average.
pub const WINDOW: usize = 100;
/// Position of the Gauss-Markov maximum as the recipe has it; 1.892618 to seven digits.
pub const PEAK_POSITION: f64 = 1.89;
/// Floor of flicker noise as the recipe has it; √(2 ln 2/π) = 0.664282 to six digits.
pub const FLICKER_FLOOR: f64 = 0.664;
/// Averages in the log at the longest averaging time that is read: fewer leave an error of more than 25 % (1/√(2(n/m
/// − 1)), IEEE Std 952), and the end of the curve then passes for a maximum.
const FEWEST_AVERAGES: usize = 9;
/// No maximum exists in white noise + Gauss-Markov when N/(σ√Tc) is larger.
const LARGEST_RATIO: f64 = 0.35610;

/// σ_g = N/√dt: standard deviation of a white sample; N in unit/√Hz, dt in s.
pub fn sample_std_dev(density: f64, dt: f64) -> f64 {
    density / dt.sqrt()
}
/// Tc = τ_max/1.89, s.
pub fn correlation_time(tau_max_s: f64) -> f64 {
    tau_max_s / PEAK_POSITION
}
/// B = σ_min/0.664.
pub fn bias_instability(minimum: f64) -> f64 {
    minimum / FLICKER_FLOOR
}

/// What the recipe reads off the curve; SI.
#[derive(Clone, Debug, Default)]
struct Reading {
    density: Option<f64>,
    /// Standard deviation of the samples.
    spread: f64,
    /// Of their moving average.
    std_dev: Option<f64>,
    minimum: Option<AllanPoint>,
    /// Maximum after the minimum, not the end of the curve.
    peak: Option<AllanPoint>,
}

pub(super) fn identify(name: &str, rate: &[f64], dt: f64, display: &Unit) -> Result<Identified, IdentifyError> {
    usable(name, rate)?;
    let mut curve = allan::curve(rate, dt, Deviation::Oadev, TauGrid::Log(20))
        .map_err(|e| IdentifyError { message: format!("{name}: {e}") })?;
    let reading = read(&curve, rate);
    let mut not_identified = Vec::new();
    let mut terms = Vec::new();
    match reading.density {
        Some(density) => terms.push(Term::White { density }),
        None => not_identified.push(NotIdentified {
            term: "white".into(),
            reason: "the Allan curve has no stretch of slope -1/2".into(),
            needed_log_s: None,
            upper_limit: None,
        }),
    }
    match (reading.std_dev, &reading.peak) {
        (Some(std_dev), Some(peak)) => {
            terms.push(Term::GaussMarkov { std_dev, correlation_time: correlation_time(peak.tau_s) });
        }
        _ => not_identified.push(NotIdentified {
            term: "gauss_markov".into(),
            reason: format!(
                "no maximum after the minimum of the Allan curve up to a ninth of the log: the recipe has nothing to \
                 read the correlation time from \
                 (a maximum exists only if N/(σ√Tc) < {LARGEST_RATIO}, and shows only in a log of many Tc)"
            ),
            needed_log_s: None,
            upper_limit: None,
        }),
    }
    let model = NoiseModel { terms };
    curve.refine(&model);
    let steps = steps(&reading, &curve, &model, dt, display);
    let mut warnings = vec![
        "the graphical recipe gives no intervals and is biased on its own model (see the cost of each step); `method` \
         allan is \
         nearly unbiased on the same log"
            .to_string(),
    ];
    if model.terms.is_empty() {
        warnings.push("the recipe reads no noise term off this curve".into());
    }
    Ok(Identified {
        params: AxisParams {
            name: name.into(),
            // without an interval: what the recipe reads of the drift is too little for one
            bias: Some(Measured::from_si(mean(rate), None, display.times_time(0))),
            turn_on_bias: None,
            temperature: None,
            terms: model.terms.iter().map(|t| entry(t, &[None, None], display)).collect::<Result<_, _>>()?,
            not_identified: not_identified.clone(),
        },
        model,
        curve,
        candidates: vec![],
        precision: vec![],
        exact_log_likelihood: None,
        hold: None,
        time_profile: None,
        fitted: None,
        sums: super::Sums::default(),
        tails: crate::identify::Tails::default(),
        between: vec![],
        not_identified,
        warnings,
        steps,
        fit_p_value: f64::NAN,
        fit_distance: None,
        first_tau_s: Some(dt),
        samples: rate.len(),
    })
}

fn read(curve: &AllanCurve, rate: &[f64]) -> Reading {
    let readable = |p: &&AllanPoint| p.m as usize <= curve.samples / FEWEST_AVERAGES && p.deviation > 0.0;
    let points: Vec<&AllanPoint> = curve.points.iter().filter(readable).collect();
    let peak = peak(&points);
    // a long log falls below its first minimum again after the maximum, with slope −1/2 as well
    let before = &points[..peak.unwrap_or(points.len())];
    let minimum = lowest(before).map(|i| before[i]).filter(|m| points.last().is_some_and(|last| m.m != last.m));
    Reading {
        density: white_line(before),
        spread: Moments::of(rate).variance().sqrt(),
        std_dev: smoothed_std_dev(rate, WINDOW),
        minimum: minimum.cloned(),
        peak: peak.map(|j| points[j].clone()),
    }
}

fn lowest(points: &[&AllanPoint]) -> Option<usize> {
    (0..points.len()).min_by(|i, j| points[*i].deviation.total_cmp(&points[*j].deviation))
}

/// The maximum after the minimum: the point that rises most above the lowest one before it, unless it is the last of
/// all or rises by less than its own standard deviation, 1/√(2 edf) of the deviation.
fn peak(points: &[&AllanPoint]) -> Option<usize> {
    let mut below = f64::INFINITY;
    let mut found: Option<(f64, usize)> = None;
    for (j, point) in points.iter().enumerate() {
        let rise = (point.deviation / below).ln();
        if found.is_none_or(|(most, _)| rise > most) && rise > (2.0 * point.edf).sqrt().recip() {
            found = Some((rise, j));
        }
        below = below.min(point.deviation);
    }
    found.map(|(_, j)| j).filter(|j| j + 1 < points.len())
}

/// N: where the line of slope −1/2 through the −1/2 stretch of the curve crosses 1 s; points weigh by their degrees of
/// freedom. The stretch: neighbours between which the slope of the deviation is within 0.1 of −1/2.
fn white_line(points: &[&AllanPoint]) -> Option<f64> {
    let (mut weight, mut sum) = (0.0, 0.0);
    for pair in points.windows(2) {
        let [a, b] = pair else { continue };
        let slope = (b.deviation / a.deviation).ln() / (b.tau_s / a.tau_s).ln();
        if (slope + 0.5).abs() <= 0.1 {
            for p in [a, b] {
                weight += p.edf;
                sum += p.edf * p.deviation * p.deviation * p.tau_s;
            }
        }
    }
    (weight > 0.0).then(|| (sum / weight).sqrt())
}

/// Standard deviation of the moving average over `window` samples; None when the log is shorter than two windows.
fn smoothed_std_dev(rate: &[f64], window: usize) -> Option<f64> {
    if rate.len() < 2 * window {
        return None;
    }
    let mut moments = Moments::default();
    let mut sum = Sum::default();
    for (i, x) in rate.iter().enumerate() {
        sum.add(*x);
        if i >= window {
            sum.add(-rate[i - window]);
        }
        if i + 1 >= window {
            moments.add(sum.value() / window as f64);
        }
    }
    Some(moments.variance().sqrt())
}

fn steps(reading: &Reading, curve: &AllanCurve, model: &NoiseModel, dt: f64, display: &Unit) -> Vec<Step> {
    let rate = display.times_time(0);
    let density_unit = display.times_time(1);
    let density = reading.density;
    let shown = |unit: &Unit, si: f64| format!("{} {unit}", digits(unit.from_si(si)));
    let white = Step {
        what: "N, white-noise density".into(),
        formula: "the -1/2 line at tau = 1 s".into(),
        value: density.map(|n| density_unit.from_si(n)),
        unit: density_unit.to_string(),
        cost: match density {
            Some(_) => "no interval; otherwise sound where the curve really has slope -1/2".into(),
            None => "the curve has no stretch of slope -1/2".into(),
        },
    };
    let sigma_g = Step {
        what: "sigma_g, white noise per sample".into(),
        formula: "N/sqrt(dt)".into(),
        value: density.map(|n| rate.from_si(sample_std_dev(n, dt))),
        unit: rate.to_string(),
        cost: "too large for a band-limited sensor, whose samples scatter less than this".into(),
    };
    let whole = Step {
        what: "std, of the log".into(),
        formula: "standard deviation of the samples".into(),
        value: Some(rate.from_si(reading.spread)),
        unit: rate.to_string(),
        cost: match density.map(|n| reading.spread / sample_std_dev(n, dt)) {
            Some(ratio) if ratio < 1.0 => format!(
                "{} of sigma_g, and white noise cannot be less than all of it: N is read too high, or a low-pass \
                 makes samples alike",
                digits(ratio)
            ),
            _ => "a check of sigma_g, which cannot be larger: the drift adds its square".into(),
        },
    };
    let residual = density.map(|n| n / (WINDOW as f64 * dt).sqrt());
    let sigma_gm = Step {
        what: "sigma_GM, standard deviation of the drift".into(),
        formula: format!("standard deviation of the {WINDOW}-sample moving average"),
        value: reading.std_dev.map(|s| rate.from_si(s)),
        unit: rate.to_string(),
        cost: match (reading.std_dev, residual) {
            (None, _) => format!("the log is shorter than {} samples", 2 * WINDOW),
            (Some(_), None) => "white noise that is left in the average cannot be told without N".into(),
            (Some(s), Some(left)) if left >= s => format!(
                "white noise of N/sqrt({WINDOW} dt) = {} is left in the average: all of it; there is no drift to read",
                shown(&rate, left)
            ),
            (Some(s), Some(left)) => {
                let without = (s * s - left * left).sqrt();
                format!(
                    "white noise of N/sqrt({WINDOW} dt) = {} is left in the average; without it {}: {} times too large",
                    shown(&rate, left),
                    shown(&rate, without),
                    digits(s / without)
                )
            }
        },
    };
    let tc = Step {
        what: "Tc, correlation time".into(),
        formula: match &reading.peak {
            Some(peak) => format!("tau_max/{PEAK_POSITION}, tau_max = {} s", digits(peak.tau_s)),
            None => format!("tau_max/{PEAK_POSITION}"),
        },
        value: reading.peak.as_ref().map(|p| correlation_time(p.tau_s)),
        unit: "s".into(),
        cost: peak_cost(reading, curve, model, &rate),
    };
    let b = Step {
        what: "B, bias instability".into(),
        formula: match &reading.minimum {
            Some(minimum) => format!(
                "minimum/{FLICKER_FLOOR}, minimum = {} at {} s",
                shown(&rate, minimum.deviation),
                digits(minimum.tau_s)
            ),
            None => format!("minimum/{FLICKER_FLOOR}"),
        },
        value: reading.minimum.as_ref().map(|m| rate.from_si(bias_instability(m.deviation))),
        unit: rate.to_string(),
        cost: "in white noise + Gauss-Markov the minimum is where the two slopes cross, not a flicker floor: B is no \
               parameter of \
               that model and is not written to the parameters"
            .into(),
    };
    vec![white, sigma_g, whole, sigma_gm, tc, b]
}

fn peak_cost(reading: &Reading, curve: &AllanCurve, model: &NoiseModel, rate: &Unit) -> String {
    let Some(peak) = &reading.peak else {
        return "the curve has no maximum after its minimum: nothing to read".into();
    };
    let edf = edf::degrees_of_freedom(Deviation::Oadev, curve.samples, peak.m, curve.dt, model);
    let (lower, upper) = edf::interval(peak.deviation, edf);
    // the deviation stays within 1 % of its maximum for tau/Tc in [1.474, 2.421]
    let mut cost = format!(
        "the maximum is flat (within 1 % from {} to {} s) and has {} degrees of freedom (95 %: {} to {} {rate}): Tc \
         scatters by \
         far more than the curve is wide",
        digits(peak.tau_s * 1.474 / 1.8926),
        digits(peak.tau_s * 2.421 / 1.8926),
        digits(edf),
        digits(rate.from_si(lower)),
        digits(rate.from_si(upper)),
    );
    if let (Some(n), Some(s)) = (reading.density, reading.std_dev) {
        let ratio = n / (s * correlation_time(peak.tau_s).sqrt());
        if ratio >= LARGEST_RATIO {
            cost += &format!(
                "; N/(sigma sqrt(Tc)) = {} is above {LARGEST_RATIO}: a model with these numbers has no maximum at all",
                digits(ratio)
            );
        } else {
            cost +=
                &format!("; N/(sigma sqrt(Tc)) = {}: white noise pulls the maximum to shorter times", digits(ratio));
        }
    }
    cost
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn worked_example_of_the_paper() {
        assert!((sample_std_dev(0.0562, 0.01) - 0.562).abs() < 1e-12);
        assert!((correlation_time(366.53) - 193.9312).abs() < 5e-5);
        assert!((bias_instability(0.013114) - 0.01975).abs() < 5e-7);
    }

    #[test]
    fn moving_average_of_a_ramp_and_of_a_short_log() {
        // averages of 0..=9 over 4 samples: 1.5, 2.5 … 7.5, sample variance 7·8/12
        let ramp: Vec<f64> = (0..10).map(f64::from).collect();
        assert!((smoothed_std_dev(&ramp, 4).unwrap() - (56.0_f64 / 12.0).sqrt()).abs() < 1e-12);
        assert!(smoothed_std_dev(&ramp, 6).is_none());
    }
}
