//! How much louder a log is than the bench.

use super::by_name;
use crate::compare::inflation::{AxisInflation, Inflation};
use crate::report::{Report, Section};
use crate::units::{Unit, digits};

const FACTORS: [&str; 11] =
    ["axis", "log column", "samples", "factor", "95 % from", "to", "by median", "95 % from", "to", "bench N", "here"];

/// `unit`: of the log.
pub fn inflate<'a>(found: &Inflation, unit: &Unit) -> Report<'a> {
    let density = unit.times_time(1);
    let row = |a: &AxisInflation| {
        let factors = [a.factor, a.interval[0], a.interval[1]];
        let by_median = [a.robust_factor, a.robust_interval[0], a.robust_interval[1]];
        let densities = [a.density, a.density * a.factor].map(|n| density.from_si(n));
        let numbers = factors.into_iter().chain(by_median).chain(densities).map(digits);
        [a.name.clone(), a.log_axis.clone(), a.samples.to_string()].into_iter().chain(numbers)
    };
    let lines = found.axes.iter().flat_map(|a| a.lines.iter().map(move |line| (a, line)));
    let sigma = format!("sigma ({unit})");
    let section = Section::new("")
        .table(
            format!(
                "Noise above {} Hz over that of the parameters, as a factor on the density (N in {density})",
                digits(found.from_hz)
            ),
            &FACTORS,
            found.axes.iter().map(row),
        )
        .minor(&["log column", "samples", "by median"])
        .table(
            "Lines",
            &["axis", "frequency (Hz)", "width (Hz)", &sigma],
            lines.map(|(a, line)| {
                [a.name.clone(), digits(line.frequency_hz), digits(line.width_hz), digits(unit.from_si(line.std_dev))]
            }),
        )
        .findings("note", by_name(found.axes.iter().map(|a| (a.name.as_str(), a.notes.as_slice()))));
    let valid = Section::new("").paragraph(format!("Valid for {}.", found.valid_for));
    Report { title: "Noise over that of the bench".into(), sections: vec![section, valid], ..Report::default() }
}
