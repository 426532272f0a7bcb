//! The measured Allan curve within the envelope that the model draws around its own.

use nalgebra::DMatrix;
use schemars::JsonSchema;
use serde::Serialize;

use super::CompareError;
use crate::allan::{self, AllanCurve, Deviation, TauGrid, edf};
use crate::consistency::effect::VARIANCE_RATIO_TOLERANCE;
use crate::consistency::{Effect, Test, TestKind};
use crate::noise::NoiseModel;
use crate::numerics::distribution::{chi_square_cdf, chi_square_quantile, chi_square_sf, normal_quantile, normal_sf};
use crate::numerics::largest_normal::LargestNormal;
use crate::units::digits;

/// Averaging times per decade.
const POINTS_PER_DECADE: usize = 5;
/// The longest averaging time is so many times in the log.
const AVERAGES: usize = 3;

/// Overlapping Allan deviations, SI units.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct AllanEnvelope {
    pub tau_s: Vec<f64>,
    pub measured: Vec<f64>,
    pub model: Vec<f64>,
    /// A log of the model stays between these at every averaging time with probability 1 − alpha.
    pub lower: Vec<f64>,
    pub upper: Vec<f64>,
    /// Equivalent degrees of freedom under the model.
    pub edf: Vec<f64>,
    /// Place of the measured deviation in its law under the model, as standard deviations of a normal number.
    pub z: Vec<f64>,
    /// Half width of the envelope in the same measure.
    pub bound: f64,
}

/// The curve, its envelope and the test `allan_curve`.
///
/// σ̂²(τ_i)·edf_i/σ²(τ_i) ~ χ²(edf_i) under the model, edf exact for its mixture; z_i is its normal score. The
/// scores are taken as jointly normal with the exact correlations of the variance estimates, so that P(max |z|) and
/// the envelope hold for all averaging times together.
pub(super) fn allan_curve(
    axis: &str,
    rate: &[f64],
    dt: f64,
    model: &NoiseModel,
    alpha: f64,
) -> Result<(AllanEnvelope, Test), CompareError> {
    let failed = |message: String| CompareError::Axis { axis: axis.to_string(), message };
    let curve =
        allan::curve(rate, dt, Deviation::Oadev, TauGrid::Log(POINTS_PER_DECADE)).map_err(|e| failed(e.to_string()))?;
    let AllanCurve { points, samples, .. } = curve;
    let used: Vec<_> = points.iter().filter(|p| p.m as usize <= samples / AVERAGES).collect();
    let factors: Vec<u64> = used.iter().map(|p| p.m).collect();
    let covariance = edf::covariance(&factors, samples, dt, model);
    let correlation = DMatrix::from_fn(factors.len(), factors.len(), |i, k| {
        if i == k { 1.0 } else { covariance[(i, k)] / (covariance[(i, i)] * covariance[(k, k)]).sqrt() }
    });
    let expected: Vec<f64> = factors.iter().map(|m| model.allan_variance(*m, dt)).collect();
    let freedom: Vec<f64> = expected.iter().enumerate().map(|(i, v)| 2.0 * v * v / covariance[(i, i)]).collect();
    if correlation.iter().chain(&freedom).any(|v| !v.is_finite()) {
        return Err(failed(
            "the model has no random noise at some averaging times: there is no envelope to hold a log against".into(),
        ));
    }
    let law = LargestNormal::new(correlation);
    let bound = law.quantile(alpha);
    let z: Vec<f64> = (0..factors.len())
        .map(|i| normal_score(freedom[i] * used[i].deviation.powi(2) / expected[i], freedom[i]))
        .collect();
    let edge = |i: usize, z: f64| (chi_square_quantile(1.0 - normal_sf(z), freedom[i]) / freedom[i]).sqrt();
    let deviation = |i: usize| expected[i].sqrt();
    let all = |f: &dyn Fn(usize) -> f64| (0..factors.len()).map(f).collect::<Vec<f64>>();
    let envelope = AllanEnvelope {
        tau_s: all(&|i| used[i].tau_s),
        measured: all(&|i| used[i].deviation),
        model: all(&deviation),
        lower: all(&|i| deviation(i) * edge(i, -bound)),
        upper: all(&|i| deviation(i) * edge(i, bound)),
        edf: freedom.clone(),
        z,
        bound,
    };
    let ratio = |i: usize| envelope.measured[i] / envelope.model[i];
    let (at, shown) = farthest(&envelope.z, bound, &ratio);
    let statistic = envelope.z[at];
    let time = |i: usize| format!("{} s", digits(envelope.tau_s[i]));
    let farther = |i: usize| {
        let way = if ratio(i) > 1.0 { "more" } else { "less" };
        format!("{} times the model's at {}: {way} noise than the model says", digits(ratio(i)), time(i))
    };
    let meaning = if statistic.abs() <= bound {
        format!(
            "the Allan curve stays in the model's envelope; farthest at {}, {} times the model's ({:+.2} standard \
             deviations)",
            time(at),
            digits(ratio(at)),
            statistic
        )
    } else if at == shown {
        format!("the Allan deviation is {} ({:+.1} standard deviations)", farther(at), statistic)
    } else {
        format!(
            "the Allan deviation is {}; surest at {}, {} times the model's ({:+.1} standard deviations)",
            farther(shown),
            time(at),
            digits(ratio(at)),
            statistic
        )
    };
    let interval = [ratio(shown) / edge(shown, bound), ratio(shown) / edge(shown, -bound)];
    let tolerated = VARIANCE_RATIO_TOLERANCE.sqrt();
    let test = Test::new(axis, TestKind::AllanCurve, statistic, [-bound, bound], law.tail(statistic.abs()), meaning)
        .with_averaging(envelope.tau_s[shown])
        .with_effect(Effect::new("allan_deviation_ratio", ratio(shown), interval, [1.0 / tolerated, tolerated]));
    Ok((envelope, test))
}

/// z with Φ(z) = P(χ²_edf ≤ x); Fisher's √(2x) − √(2 edf − 1) where the tail underflows.
pub(super) fn normal_score(x: f64, edf: f64) -> f64 {
    let (below, above) = (chi_square_cdf(x, edf), chi_square_sf(x, edf));
    let z = if below < above { normal_quantile(below) } else { -normal_quantile(above) };
    if z.is_finite() { z } else { (2.0 * x).sqrt() - (2.0 * edf - 1.0).max(0.0).sqrt() }
}

/// Where |z| is largest, and, of all places where it is beyond the bound, where the ratio is farthest from one: what
/// a test is surest of is not what matters most. The same place twice if none is beyond.
pub(super) fn farthest(z: &[f64], bound: f64, ratio: &dyn Fn(usize) -> f64) -> (usize, usize) {
    let last = |i: usize, k: usize, size: &dyn Fn(usize) -> f64| if size(k) > size(i) { k } else { i };
    let surest = (1..z.len()).fold(0, |i, k| last(i, k, &|i| z[i].abs()));
    let beyond = (0..z.len()).filter(|i| z[*i].abs() > bound);
    (surest, beyond.fold(surest, |i, k| last(i, k, &|i| ratio(i).ln().abs())))
}
