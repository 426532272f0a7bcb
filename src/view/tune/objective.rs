//! What the parameters of a design were chosen by.

use crate::params::Params;
use crate::report::Section;
use crate::tune::objective::{LikelihoodAxis, Moved, NeesAxis, Record, RobustAxis};
use crate::units::{Unit, digits, shown_unit};

/// A gain in ln L that means something: a factor of seven in probability.
const CLEAR_GAIN: f64 = 2.0;

/// A table with what is said above and below it.
struct Part {
    title: String,
    header: Vec<&'static str>,
    rows: Vec<Vec<String>>,
    below: Vec<String>,
}

fn parts(record: &Record, params: &Params) -> Vec<Part> {
    let mut parts = vec![moved(record)];
    parts.extend(record.robust.iter().map(|axis| robust(axis, params)));
    parts.extend(record.likelihood.iter().map(likelihood));
    if !record.nees.is_empty() {
        parts.push(nees(&record.nees));
    }
    for als in &record.als {
        parts[0].below.push(format!(
            "axis {}: from {} innovations and their autocovariance at {} lags; times and frequencies stay as they are",
            als.axis, als.samples, als.lags
        ));
    }
    parts
}

pub(super) fn section<'a>(record: &Record, params: &Params) -> Section<'a> {
    let section = Section::new(format!("Objective {}", record.objective.name()));
    let add = |section: Section<'a>, part: Part| section.table(part.title, &part.header, part.rows).list(part.below);
    parts(record, params).into_iter().fold(section, add)
}

fn moved(record: &Record) -> Part {
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
        vec![name, moved.unit.clone(), from, to, format!("{:.4}", moved.factor), sigmas, lower, upper]
    };
    Part {
        title: "What moved; sigmas are those of the identified interval".into(),
        header: vec!["parameter", "unit", "identified", "chosen", "factor", "sigmas", "95 % from", "to"],
        rows: record.parameters.iter().map(row).collect(),
        below: Vec::new(),
    }
}

fn robust(axis: &RobustAxis, params: &Params) -> Part {
    let unit = params.axes.iter().find(|a| a.name == axis.axis).map(|a| a.display_unit(params.quantity));
    let unit = unit.unwrap_or_else(Unit::one);
    let rows = axis.outputs.iter().map(|output| {
        let (scale, unit) = shown_unit(&output.unit, params.quantity, &unit);
        let values = [output.claimed_nominal, output.claimed, output.error_nominal, output.error, output.error_known];
        let mut row = vec![output.name.clone(), unit];
        row.extend(values.map(|v| digits(v / scale)));
        row.push(format!("{:+.2} %", 100.0 * output.price));
        row
    });
    let percent = |share: f64| format!("{:.1} %", 100.0 * share);
    let law = if axis.correlated { "with the correlation of likelihood estimates" } else { "independently" };
    Part {
        title: format!(
            "Axis {}: on {} other sensors, drawn from the intervals {law}: claimed steady sigma, and the mean over the sensors of the true one",
            axis.axis, axis.sensors
        ),
        header: vec![
            "of",
            "unit",
            "claimed nominal",
            "claimed robust",
            "true nominal",
            "true robust",
            "sensor known",
            "price",
        ],
        rows: rows.collect(),
        below: vec![format!(
            "claimed sigma too small for {} of the sensors as identified, {} robust; criterion, at most {}: {}",
            percent(axis.too_small_nominal),
            percent(axis.too_small),
            percent(1.0 - axis.criterion),
            if axis.met { "met" } else { "MISSED" }
        )],
    }
}

fn likelihood(axis: &LikelihoodAxis) -> Part {
    let rows = axis.logs.iter().map(|log| {
        let gain =
            if log.held_out_rows > 0 { format!("{:+.2}", log.held_out - log.held_out_before) } else { "-".into() };
        let mut row = vec![log.log.clone(), log.fitted_rows.to_string(), log.held_out_rows.to_string()];
        row.extend([log.held_out_before, log.held_out].map(|value| format!("{value:.2}")));
        row.push(gain);
        row
    });
    let mut below = vec![format!(
        "fitted part: ln L {:.3} as identified, {:.3} chosen (gain {:.2}{})",
        axis.fitted_before,
        axis.fitted,
        axis.fitted - axis.fitted_before,
        if axis.priors { format!("; ln of the prior {:.2} below its top", -axis.prior) } else { String::new() }
    )];
    if let Some(gain) = axis.held_out_gain {
        let word = match gain {
            gain if gain > CLEAR_GAIN => "foretold better",
            gain if gain < -CLEAR_GAIN => "foretold worse: keep the identified numbers",
            _ => "foretold about as well",
        };
        below.push(format!("held out: gain in ln L {gain:+.2}: what was not fitted to is {word}"));
    }
    if !axis.at_limit.is_empty() {
        below.push(format!("the logs set only a limit on {}: hold it", axis.at_limit.join(", ")));
    }
    Part {
        title: format!("Axis {}: log-likelihood of what was held out, given what was before", axis.axis),
        header: vec!["log", "rows fitted", "held out", "ln L identified", "ln L chosen", "gain"],
        rows: rows.collect(),
        below,
    }
}

fn nees(axes: &[NeesAxis]) -> Part {
    let row = |axis: &NeesAxis| {
        let outputs = axis.outputs.iter().zip(axis.nees_before.iter().zip(&axis.nees));
        let mut rows: Vec<Vec<String>> = outputs
            .map(|(name, (before, after))| {
                vec![axis.axis.clone(), format!("NEES of {name}"), digits(*before), digits(*after)]
            })
            .collect();
        rows.push(vec![axis.axis.clone(), "NIS".into(), digits(axis.nis_before), digits(axis.nis)]);
        rows
    };
    Part {
        title: "Expected in the truth after a long time, 1 when the covariance is right".into(),
        header: vec!["axis", "what", "identified", "chosen"],
        rows: axes.iter().flat_map(row).collect(),
        below: axes
            .iter()
            .filter(|axis| !axis.met)
            .map(|axis| format!("axis {}: not all of them can be one with what may move: hold less", axis.axis))
            .collect(),
    }
}
