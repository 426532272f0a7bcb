//! From the running sums to tests, effects and the verdict.
//!
//! Per axis: `start` (does the log begin where x0 and P0 say?), `nis` (mean size of the innovations), `whiteness`
//! (largest autocorrelation of lags 1–50), `ljung_box` (all these lags together), `low_frequency` (innovations
//! averaged over a quarter to sixteen times the filter's time constant; see [`crate::consistency::low_frequency`]),
//! `cumulative_periodogram` (shape of their low-frequency spectrum) and, behind a gate, `rejected`. Holm's
//! adjustment runs over all tests and axes; [`effect::judge`] states how p-values and effect sizes make the verdict.

use super::axis::{AxisReplay, Channel};
use super::follow::Following;
use super::{
    AxisResult, Curves, FinalState, LowFrequencySummary, Nis, Options, ReplayResult, Replayer, Start, WhitenessSummary,
};
use crate::consistency::effect::{self, Effect};
use crate::consistency::normalized::{gated_moments, moment_matched};
use crate::consistency::whiteness::Whiteness;
use crate::consistency::{Test, TestKind, Verdict};
use crate::filter::AxisDesign;
use crate::numerics::distribution::{chi_square_cdf, chi_square_quantile, chi_square_sf, normal_quantile, normal_sf};
use crate::units::digits;

/// With fewer accepted samples no test is made.
const FEWEST_SAMPLES: u64 = 30;
/// Share of rejected samples, beyond what the gate rejects of a true design, that is tolerated.
const REJECTED_TOLERANCE: f64 = 0.01;

/// What the tests of slow drift leave out.
const EXACT: &str = "; slow drift is judged as if the design's parameters were exact, whatever their intervals";

/// All statistics of a finished replay.
pub(super) fn conclude(replayer: Replayer) -> ReplayResult {
    let Replayer { options, design, log_axes, axes, .. } = replayer;
    let mut tests = Vec::new();
    let mut results = Vec::new();
    let mut short = Vec::new();
    for ((axis, design), log_axis) in axes.into_iter().zip(&design.axes).zip(log_axes) {
        for (index, channel) in axis.channels.iter().enumerate() {
            let view = View { axis: &axis, channel, design, index };
            if let Some(reason) = view.too_short() {
                short.push(reason);
            }
            let (result, its_tests) = axis_result(&view, log_axis.clone(), &options);
            results.push(result);
            tests.extend(its_tests);
        }
    }
    let verdict = effect::judge(&mut tests, options.alpha, short.is_empty());
    let mut meaning = meaning(verdict, options.alpha, &tests, &results, &short);
    if verdict != Verdict::Inconclusive && results.iter().any(|axis| !axis.low_frequency.is_empty()) {
        meaning.push_str(EXACT);
    }
    let changes: Vec<u64> =
        results.iter().filter_map(|axis| axis.follow.as_ref()).map(|follow| follow.changes).collect();
    if changes.iter().any(|changes| *changes > 0) {
        meaning.push_str("; the wideband noise is that found along the log, not that of the design");
    } else if !changes.is_empty() {
        meaning.push_str(
            "; beside so long a memory the log is too short to find any noise anew: it is that of the design",
        );
    }
    ReplayResult {
        format: "kfdesign-replay/1".to_string(),
        verdict,
        meaning,
        alpha: options.alpha,
        log: None,
        log_sha256: None,
        gate: options.gate,
        quantity: design.quantity,
        sample_rate: design.sample_rate_hz,
        axes: results,
        tests,
    }
}

/// One measurement of an axis.
struct View<'a> {
    axis: &'a AxisReplay,
    channel: &'a Channel,
    design: &'a AxisDesign,
    index: usize,
}

impl View<'_> {
    /// The axis, and the measurement where there are several.
    fn name(&self) -> String {
        let (name, measurements) = (&self.design.name, &self.design.model.measurements);
        if measurements.len() == 1 { name.clone() } else { format!("{name}.{}", measurements[self.index].name) }
    }

    /// Rows at which the filter expects this measurement.
    fn expected(&self) -> u64 {
        self.axis.samples.div_ceil(self.channel.every)
    }

    /// Why this cannot be judged, if so.
    fn too_short(&self) -> Option<String> {
        let (channel, name) = (self.channel, self.name());
        let accepted = channel.autocorrelation.count();
        if channel.low_frequency.is_enough() && accepted >= FEWEST_SAMPLES {
            return None;
        }
        let expected = self.expected();
        if accepted < expected / 2 {
            return Some(format!("{name}: only {accepted} of {expected} samples were accepted"));
        }
        let needed = channel.low_frequency.samples_needed().saturating_mul(channel.every);
        Some(format!(
            "{name}: {accepted} accepted samples are too few to judge the drift, {needed} are needed ({} s)",
            digits(needed as f64 * self.design.model.dt)
        ))
    }
}

fn axis_result(view: &View<'_>, log_axis: String, options: &Options) -> (AxisResult, Vec<Test>) {
    let View { axis, channel, design, index } = *view;
    let name = view.name();
    let name = name.as_str();
    let dt = design.model.dt * channel.every as f64;
    let sums = &channel.autocorrelation;
    let accepted = sums.count();
    let mut result = AxisResult {
        name: name.to_string(),
        axis: design.name.clone(),
        of_plant: !design.model.outputs.is_empty(),
        measurement: design.model.measurements[index].name.clone(),
        unit: design.model.measurements[index].unit.clone(),
        log_axis,
        samples: axis.samples,
        accepted,
        unusable: axis.unusable + channel.unusable,
        gaps: axis.gaps,
        missing: axis.missing,
        rejected: channel.rejected,
        log_likelihood: channel.log_likelihood.value(),
        final_output: final_output(axis, design),
        final_state: final_state(axis, design),
        nis: None,
        whiteness: None,
        low_frequency: Vec::new(),
        start: None,
        follow: axis.following.as_ref().map(Following::result),
        curves: Curves {
            trace: channel.trace.points().to_vec(),
            samples_per_point: channel.trace.samples_per_point(),
            nis_histogram: channel.nis_histogram.to_vec(),
            ..Curves::default()
        },
    };
    let mut tests = Vec::new();
    if accepted + channel.rejected < FEWEST_SAMPLES {
        return (result, tests);
    }
    let Options { alpha, gate, .. } = *options;
    let (expected, variance) = gate.map_or((1.0, 2.0), gated_moments);
    // a robust filter is one that expects outliers
    if let Some(gate) = gate.filter(|_| !options.clip) {
        tests.push(rejected_test(name, gate, channel.rejected, accepted, alpha));
    }
    if accepted < FEWEST_SAMPLES {
        return (result, tests);
    }
    if index == 0 && axis.start.information > 0.0 {
        let (start, test) = start_test(name, axis.start.score, axis.start.information, alpha);
        result.start = Some(start);
        tests.push(test);
    }
    let whiteness = sums.whiteness(alpha);
    let nis = moment_matched(sums.squares(), accepted, expected, variance, alpha);
    tests.push(nis.nis(name, nis_error(sums.squares(), sums.fourth(), &whiteness), alpha));
    result.nis = Some(Nis { mean: nis.mean, expected, lower: nis.lower, upper: nis.upper, p_value: nis.p_value });
    tests.extend(whiteness.tests(name, dt, alpha));
    for block in channel.low_frequency.results(expected, alpha) {
        tests.push(block.test(name, dt));
        result.low_frequency.push(LowFrequencySummary {
            block_s: block.length as f64 * dt,
            blocks: block.blocks,
            ratio: block.ratio,
            lower: block.lower,
            upper: block.upper,
            p_value: block.p_value,
            interval: block.interval,
            detects: block.detects,
        });
    }
    if let Some((length, periodogram)) = channel.low_frequency.periodogram(alpha) {
        let interval_s = length as f64 * dt;
        tests.push(periodogram.test(name, interval_s));
        let blocks = 2 * periodogram.ordinates + 1;
        result.curves.periodogram_bound = periodogram.bound;
        result.curves.cumulative_periodogram = thinned(&periodogram.share)
            .map(|(i, share)| ((i + 1) as f64 / (blocks as f64 * interval_s), share))
            .collect();
    }
    result.whiteness = Some(WhitenessSummary {
        max_abs_autocorrelation: whiteness.max_abs_autocorrelation,
        lag: whiteness.max_lag,
        interval: whiteness.interval,
        ljung_box: whiteness.ljung_box,
        ljung_box_p_value: whiteness.ljung_box_upper_p_value,
        lags: whiteness.lags,
    });
    result.curves.autocorrelation_bound = normal_quantile(1.0 - alpha / 2.0) / (accepted as f64).sqrt();
    result.curves.autocorrelation = whiteness.autocorrelation;
    (result, tests)
}

/// At most a thousand values with their index, for a figure.
fn thinned(values: &[f64]) -> impl Iterator<Item = (usize, f64)> + '_ {
    let step = values.len().div_ceil(1000).max(1);
    values.iter().copied().enumerate().step_by(step)
}

/// The first output of a plant, else the whole drift.
fn final_output(axis: &AxisReplay, design: &AxisDesign) -> FinalState {
    let model = &design.model;
    let (named, row) = match model.outputs.first() {
        Some(output) => (Some((output.name.clone(), output.unit.clone())), output.row.clone()),
        None => {
            let measured = model.measurements.first().map(|m| (m.name.clone(), m.unit.clone()));
            (measured, model.drift_row().iter().copied().collect())
        }
    };
    let (name, unit) = named.unwrap_or_default();
    let (value, sigma) = axis.filter.of_row(&row);
    FinalState { name, unit, value, sigma }
}

fn final_state(axis: &AxisReplay, design: &AxisDesign) -> Vec<FinalState> {
    let states = design.model.states.iter().enumerate();
    states
        .map(|(i, state)| FinalState {
            name: state.name.clone(),
            unit: state.unit.clone(),
            value: axis.filter.x()[i],
            sigma: axis.filter.sigma(i),
        })
        .collect()
}

/// Standard error of the mean of y² from the data's own spread, √(var(y²)·(1 + 2 Σ ρ_h²)/n): the squares of a
/// Gaussian process have the squared autocorrelation; each r_h² is lowered by 1/n, what it is without any
/// correlation.
fn nis_error(squares: f64, fourth: f64, whiteness: &Whiteness) -> f64 {
    let n = whiteness.samples as f64;
    let variance = (fourth / n - (squares / n).powi(2)).max(0.0);
    let correlated: f64 = whiteness.autocorrelation.iter().map(|r| (r * r - 1.0 / n).max(0.0)).sum();
    (variance * (1.0 + 2.0 * correlated) / n).sqrt()
}

/// score/√information is N(0, 1); score/information is the shift of x0 in standard deviations of P0.
fn start_test(axis: &str, score: f64, information: f64, alpha: f64) -> (Start, Test) {
    let z = score / information.sqrt();
    let sigmas = score / information;
    let p_value = (2.0 * normal_sf(z.abs())).min(1.0);
    let bound = normal_quantile(1.0 - alpha / 2.0);
    let meaning = if z.abs() > bound {
        format!(
            "the log starts {} sigma from x0: its bias is outside what P0 allows; raise the turn-on bias (the other \
             tests feel this start too)",
            digits(sigmas)
        )
    } else {
        "the log starts where x0 and P0 say".to_string()
    };
    (Start { sigmas, p_value }, Test::new(axis, TestKind::Start, z, [-bound, bound], p_value, meaning))
}

/// Number of rejected samples against the Poisson law of a true design (which is conservative beside the binomial).
fn rejected_test(axis: &str, gate: f64, rejected: u64, accepted: u64, alpha: f64) -> Test {
    let total = (rejected + accepted) as f64;
    let expected = total * 2.0 * normal_sf(gate);
    let count = rejected as f64;
    // P(X ≥ k) = P(χ²_{2k} ≤ 2λ), P(X ≤ k) = P(χ²_{2k+2} > 2λ)
    let more = if rejected == 0 { 1.0 } else { chi_square_cdf(2.0 * expected, 2.0 * count) };
    let fewer = chi_square_sf(2.0 * expected, 2.0 * count + 2.0);
    let low = if rejected == 0 { 0.0 } else { chi_square_quantile(alpha / 2.0, 2.0 * count) / 2.0 };
    let high = chi_square_quantile(1.0 - alpha / 2.0, 2.0 * count + 2.0) / 2.0;
    let share = count / total;
    let normal = expected / total;
    // bounds of the share by the normal approximation, for the eye; the p-value is the Poisson one
    let spread = normal_quantile(1.0 - alpha / 2.0) * expected.sqrt() / total;
    let meaning = format!(
        "{rejected} samples ({} %) are outside {gate} sigma; a true design rejects {}",
        digits(100.0 * share),
        digits(expected)
    );
    let p_value = (2.0 * more.min(fewer)).min(1.0);
    Test::new(axis, TestKind::Rejected, share, [(normal - spread).max(0.0), normal + spread], p_value, meaning)
        .with_effect(Effect::new(
            "rejected_share",
            share,
            [low / total, high / total],
            [(normal - REJECTED_TOLERANCE).max(0.0), normal + REJECTED_TOLERANCE],
        ))
}

/// The verdict in a few sentences, axis by axis.
fn meaning(verdict: Verdict, alpha: f64, tests: &[Test], axes: &[AxisResult], short: &[String]) -> String {
    let tell = |chosen: &dyn Fn(&Test) -> bool| {
        let said = axes.iter().filter_map(|axis| {
            let own = || tests.iter().filter(|t| t.axis == axis.name);
            let sentences: Vec<&str> = own().filter(|t| chosen(t)).map(|t| t.meaning.as_str()).collect();
            let drift = (!sentences.is_empty() && drift_holds(axis, own())).then(|| slow_part(axis));
            (!sentences.is_empty())
                .then(|| format!("{}: {}{}", axis.name, sentences.join("; "), drift.unwrap_or_default()))
        });
        said.collect::<Vec<_>>().join(". ")
    };
    match verdict {
        Verdict::Inconsistent => tell(&|t| !t.pass()),
        Verdict::Inconclusive if !short.is_empty() => short.join("; "),
        Verdict::Inconclusive => format!(
            "deviations are real but the log is too short to tell whether they matter: {}",
            tell(&|t| effect::is_undecided(t, alpha))
        ),
        Verdict::Consistent => {
            let shortest =
                axes.iter().filter(|a| !a.low_frequency.is_empty()).min_by(|a, b| longest(a).total_cmp(&longest(b)));
            let small = tests.iter().filter(|t| t.adjusted_p_value < alpha).count();
            let deviations = match small {
                0 => "the innovations are white and as large as the filter says".to_string(),
                1 => "one deviation is significant but small, within what is tolerated".to_string(),
                n => format!("{n} deviations are significant but small, within what is tolerated"),
            };
            format!("{deviations}{}", shortest.map(slow_part).unwrap_or_default())
        }
    }
}

/// The longest averages that were judged, s.
fn longest(axis: &AxisResult) -> f64 {
    axis.low_frequency.last().map_or(0.0, |l| l.block_s)
}

/// The low-frequency tests were made and none of them failed.
fn drift_holds<'a>(axis: &AxisResult, mut tests: impl Iterator<Item = &'a Test>) -> bool {
    !axis.low_frequency.is_empty() && tests.all(|t| t.pass() || !t.kind.is_of_drift())
}

fn slow_part(axis: &AxisResult) -> String {
    format!("; the drift is as predicted, up to averages of {} s", digits(longest(axis)))
}
