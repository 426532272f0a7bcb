//! Numbers of the runs as tables.

use std::ops::Range;
use std::path::Path;

use anyhow::bail;

use super::Request;
use crate::export::table::TableWriter;
use crate::montecarlo::{Course, Experiment};
use crate::units::digits;

/// One run alone, as a table; what there is to say of it.
pub(super) fn one_run(
    request: &Request,
    experiment: &Experiment,
    course: &Course,
    number: u64,
) -> anyhow::Result<String> {
    let Some(path) = &request.output else {
        bail!("`run` {number} needs `output` FILE for its numbers (.csv, .csv.gz or .npy)")
    };
    let traces = course.trace(number);
    let time: Vec<f64> = (0..course.steps).map(|step| step as f64 * course.dt).collect();
    let unit = experiment.design.quantity.si_unit();
    let mut header = vec!["time (s)".to_string()];
    let mut columns = vec![time.as_slice()];
    for (axis, trace) in course.axes.iter().zip(&traces) {
        let name = &axis.name;
        for (states, kind, values) in
            [(&axis.truth.states, "true", &trace.truth), (&axis.filter.states, "estimated", &trace.estimate)]
        {
            header.extend(states.iter().map(|s| format!("{name}_{}_{kind} ({})", s.name, s.unit)));
            columns.extend(values.iter().map(Vec::as_slice));
        }
        for (i, channel) in axis.channels.iter().enumerate() {
            let (place, own) = if axis.channels.len() == 1 {
                (name.clone(), unit.to_string())
            } else {
                (format!("{name}_{}", channel.name), axis.filter.measurements[i].unit.clone())
            };
            let names = ["measured", "innovation"].map(|what| format!("{place}_{what} ({own})"));
            header.extend(names.into_iter().chain([format!("{place}_innovation_normalised")]));
            columns.extend([&trace.measured[i], &trace.innovation[i], &trace.normalised[i]].map(Vec::as_slice));
        }
    }
    let mut writer = TableWriter::create(path, &header)?;
    writer.write(&columns)?;
    writer.finish()?;
    Ok(format!(
        "run {number} (seed {}): {} samples of {} s in {}",
        course.seed,
        course.steps,
        digits(course.dt),
        path.display()
    ))
}

/// Average NEES per component and NIS at every step.
pub(super) fn every_step(path: &Path, course: &Course, runs: Range<u64>) -> anyhow::Result<()> {
    let time: Vec<f64> = (0..course.steps).map(|step| step as f64 * course.dt).collect();
    let averages = course.every_step(runs);
    let mut header = vec!["time (s)".to_string()];
    let mut columns = vec![time.as_slice()];
    for (axis, average) in course.axes.iter().zip(&averages) {
        header.push(format!("{}_nees", axis.name));
        columns.push(&average.nees);
        for (channel, nis) in axis.channels.iter().zip(&average.nis) {
            let name = if axis.channels.len() == 1 { String::new() } else { format!("_{}", channel.name) };
            header.push(format!("{}{name}_nis", axis.name));
            columns.push(nis);
        }
    }
    let mut writer = TableWriter::create(path, &header)?;
    writer.write(&columns)?;
    Ok(writer.finish()?)
}
