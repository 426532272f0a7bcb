//! What the parameters of a design were chosen by.

use crate::params::Params;
use crate::report::Section;
use crate::tune::objective::{LikelihoodAxis, Moved, NeesAxis, Record, RobustAxis};
use crate::units::{Unit, digits, shown_unit};

const ROBUST: [&str; 8] =
    ["of", "unit", "claimed nominal", "claimed robust", "true nominal", "true robust", "sensor known", "price"];
/// A gain in ln L that means something: a factor of seven in probability.
const CLEAR_GAIN: f64 = 2.0;

pub(super) fn section<'a>(record: &Record, params: &Params) -> Section<'a> {
    let als = record.als.iter().map(|als| {
        format!(
            "axis {}: from {} innovations and their autocovariance at {} lags; times and frequencies stay as they are",
            als.axis, als.samples, als.lags
        )
    });
    let section = Section::new(format!("Objective {}", record.objective.name()));
    let section = moved(section, record).list(als.collect());
    let section = record.robust.iter().fold(section, |section, axis| robust(section, axis, params));
    let section = record.likelihood.iter().fold(section, likelihood);
    nees(section, &record.nees)
}

fn moved<'a>(section: Section<'a>, record: &Record) -> Section<'a> {
    let row = |moved: &Moved| {
        let name = match &moved.axis {
            Some(axis) => format!("{axis}.{}", moved.parameter),
            None => moved.parameter.clone(),
        };
        let [lower, upper] = moved.interval.map_or(["-".into(), "-".into()], |interval| interval.map(digits));
        let sigmas = match (moved.held, moved.sigmas) {
            (true, _) => "held".into(),
            (false, Some(sigmas)) => format!("{sigmas:+.2}"),
            (false, None) => "-".into(),
        };
        let (from, to) = (digits(moved.from), digits(moved.to));
        [name, moved.unit.clone(), from, to, format!("{:.4}", moved.factor), sigmas, lower, upper]
    };
    section.table(
        "What moved; sigmas are those of the identified interval",
        &["parameter", "unit", "identified", "chosen", "factor", "sigmas", "95 % from", "to"],
        record.parameters.iter().map(row),
    )
}

fn robust<'a>(section: Section<'a>, axis: &RobustAxis, params: &Params) -> Section<'a> {
    let unit = params.axes.iter().find(|a| a.name == axis.axis).map(|a| a.display_unit(params.quantity));
    let unit = unit.unwrap_or_else(Unit::one);
    let rows = axis.outputs.iter().map(|output| {
        let (scale, unit) = shown_unit(&output.unit, params.quantity, &unit);
        let values = [output.claimed_nominal, output.claimed, output.error_nominal, output.error, output.error_known];
        let numbers = values.map(|v| digits(v / scale));
        [output.name.clone(), unit].into_iter().chain(numbers).chain([format!("{:+.2} %", 100.0 * output.price)])
    });
    let law = if axis.correlated { "with the correlation of likelihood estimates" } else { "independently" };
    let caption = format!(
        "Axis {}: on {} other sensors, drawn from the intervals {law}: claimed steady sigma, and the mean over the \
         sensors of the true one",
        axis.axis, axis.sensors
    );
    let [nominal, robust, most] = [axis.too_small_nominal, axis.too_small, 1.0 - axis.criterion].map(|s| 100.0 * s);
    let met = if axis.met { "met" } else { "MISSED" };
    let sentence = format!(
        "claimed sigma too small for {nominal:.1} % of the sensors as identified, {robust:.1} % robust; criterion, \
         at most {most:.1} %: {met}"
    );
    section.table(caption, &ROBUST, rows).list(vec![sentence])
}

fn likelihood<'a>(section: Section<'a>, axis: &LikelihoodAxis) -> Section<'a> {
    let rows = axis.logs.iter().map(|log| {
        let gain = (log.held_out_rows > 0).then(|| format!("{:+.2}", log.held_out - log.held_out_before));
        let [before, chosen] = [log.held_out_before, log.held_out].map(|value| format!("{value:.2}"));
        let [fitted, held_out] = [log.fitted_rows, log.held_out_rows].map(|rows| rows.to_string());
        [log.log.clone(), fitted, held_out, before, chosen, gain.unwrap_or_else(|| "-".into())]
    });
    let prior = if axis.priors { format!("; ln of the prior {:.2} below its top", -axis.prior) } else { String::new() };
    let gain = axis.fitted - axis.fitted_before;
    let mut sentences = vec![format!(
        "fitted part: ln L {:.3} as identified, {:.3} chosen (gain {gain:.2}{prior})",
        axis.fitted_before, axis.fitted
    )];
    if let Some(gain) = axis.held_out_gain {
        let word = match gain {
            gain if gain > CLEAR_GAIN => "foretold better",
            gain if gain < -CLEAR_GAIN => "foretold worse: keep the identified numbers",
            _ => "foretold about as well",
        };
        sentences.push(format!("held out: gain in ln L {gain:+.2}: what was not fitted to is {word}"));
    }
    if !axis.at_limit.is_empty() {
        sentences.push(format!("the logs set only a limit on {}: hold it", axis.at_limit.join(", ")));
    }
    let caption = format!("Axis {}: log-likelihood of what was held out, given what was before", axis.axis);
    let header = ["log", "rows fitted", "held out", "ln L identified", "ln L chosen", "gain"];
    section.table(caption, &header, rows).list(sentences)
}

fn nees<'a>(section: Section<'a>, axes: &[NeesAxis]) -> Section<'a> {
    let rows = |axis: &NeesAxis| -> Vec<[String; 4]> {
        let outputs = axis.outputs.iter().map(|name| format!("NEES of {name}"));
        let before = axis.nees_before.iter().chain([&axis.nis_before]);
        let after = axis.nees.iter().chain([&axis.nis]);
        let named = outputs.chain(["NIS".into()]).zip(before.zip(after));
        named.map(|(name, (before, after))| [axis.axis.clone(), name, digits(*before), digits(*after)]).collect()
    };
    let unmet = axes.iter().filter(|axis| !axis.met);
    section
        .table(
            "Expected in the truth after a long time, 1 when the covariance is right",
            &["axis", "what", "identified", "chosen"],
            axes.iter().flat_map(rows),
        )
        .list(
            unmet
                .map(|axis| format!("axis {}: not all of them can be one with what may move: hold less", axis.axis))
                .collect(),
        )
}
