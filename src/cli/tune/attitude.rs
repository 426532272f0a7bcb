//! `tune --plant attitude`.

use anyhow::{Context, bail};
use schemars::JsonSchema;
use serde::Serialize;

use super::objective::ObjectiveArg;
use super::{Args, Status};
use crate::cli::output::{digits, notes, print_json, print_text, table};
use crate::export::atomic;
use crate::filter::AttitudeDesign;
use crate::params::{Design, Params};
use crate::tune::{AtRest, TunedAttitude, tune_attitude};

/// What `tune --plant attitude --json` prints.
#[derive(Serialize, JsonSchema)]
pub(in crate::cli) struct Printed<'a> {
    /// "kfdesign-tune-attitude/1".
    format: &'static str,
    /// As written with `-o`.
    #[schemars(with = "AttitudeDesign")]
    filter: serde_json::Value,
    at_rest: &'a [AtRest],
}

pub(super) fn run(args: &Args, name: &str, params: &Params, design: &Design) -> anyhow::Result<Status> {
    let given = [
        ("--truth", args.truth.is_some()),
        ("--log", !args.log.is_empty()),
        ("--objective", args.choosing.objective != ObjectiveArg::Nominal),
        ("--hold", !args.choosing.hold.is_empty()),
        ("--insight", args.insight),
        ("--report", args.report.is_some()),
        ("--plot", args.plot.is_some()),
    ];
    if let Some((flag, _)) = given.iter().find(|(_, given)| *given) {
        bail!("{flag} is made for linear filters; an attitude filter is judged on a log with a reference, by replay");
    }
    let tuned = tune_attitude(params, design, args.flicker_horizon).with_context(|| name.to_string())?;
    if let Some(output) = &args.output {
        atomic::write(output, tuned.design.to_json().as_bytes())?;
    }
    if args.json {
        let filter = serde_json::from_str(&tuned.design.to_json())?;
        print_json(&Printed { format: "kfdesign-tune-attitude/1", filter, at_rest: &tuned.at_rest })?;
    } else {
        let mut printed = text(name, &tuned);
        if let Some(output) = &args.output {
            printed.push_str(&format!("\n{} written\n", output.display()));
        }
        print_text(&printed);
    }
    Ok(Status::Done)
}

fn text(name: &str, tuned: &TunedAttitude) -> String {
    let design = &tuned.design;
    let model = &design.model;
    let heading = model.heading.as_ref();
    let aided = heading.map_or("gravity".to_string(), |heading| format!("gravity and {}", heading.name));
    let states = model.states(design.axes.each_ref().map(String::as_str)).len();
    let figure = |what: &str, value: f64, unit: &str| vec![what.to_string(), digits(value), unit.to_string()];
    let mut rows = Vec::new();
    for (axis, gyro) in design.axes.iter().zip(&model.gyro) {
        let density = (gyro.r[(0, 0)] * model.dt).sqrt();
        rows.push(figure(&format!("{axis}: white noise"), density.to_degrees(), "deg/s/sqrt(Hz)"));
        let spread = (&gyro.h * &gyro.p0 * gyro.h.transpose())[(0, 0)].sqrt();
        rows.push(figure(&format!("{axis}: drift before the first sample"), spread.to_degrees(), "deg/s"));
    }
    rows.push(figure("scale factors and misalignments", 100.0 * model.scale_std_dev, "%"));
    rows.push(figure("accelerometer: one sample", model.accelerometer.variance.sqrt(), "m/s^2"));
    rows.push(figure("accelerometer: bias", model.accelerometer.bias_std_dev, "m/s^2"));
    if let Some(heading) = heading {
        let name = &heading.name;
        rows.push(figure(&format!("{name}: one measurement"), heading.std_dev.to_degrees(), "deg"));
        rows.push(figure(&format!("{name}: least disturbance"), heading.disturbance.to_degrees(), "deg"));
        rows.push(figure(&format!("{name}: correlation time"), heading.correlation_time, "s"));
        rows.push(figure(&format!("{name}: delay"), heading.delay_std_dev, "s"));
    }
    let at_rest = tuned.at_rest.iter().map(|rest| {
        let mut row = vec![digits(rest.time_s), digits(rest.inclination.to_degrees())];
        row.push(heading.map_or("free".to_string(), |_| digits(rest.heading.to_degrees())));
        row.extend(rest.drift.iter().map(|sigma| digits(sigma.to_degrees())));
        row
    });
    let at_rest: Vec<Vec<String>> = at_rest.collect();
    let header: Vec<String> = ["time (s)", "inclination (deg)", "heading (deg)"]
        .map(String::from)
        .into_iter()
        .chain(design.axes.iter().map(|axis| format!("{axis} drift (deg/s)")))
        .collect();
    let header: Vec<&str> = header.iter().map(String::as_str).collect();
    format!(
        "{name}: plant attitude, {} Hz, aided by {aided}: {states} error states beside the quaternion\n\n{}\n\
         Predicted sigma of a level body at rest\n{}\n{}",
        digits(design.sample_rate_hz),
        table(&["standard deviation of", "value", "unit"], &rows),
        table(&header, &at_rest),
        notes(std::iter::once(("attitude", tuned.warnings.as_slice())))
    )
}
