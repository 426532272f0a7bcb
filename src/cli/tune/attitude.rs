//! `tune --plant attitude`.

use anyhow::{Context, bail};
use schemars::JsonSchema;
use serde::Serialize;

use super::objective::ObjectiveArg;
use super::{Args, Status};
use crate::cli::output::{print_json, print_report};
use crate::export::atomic;
use crate::filter::AttitudeDesign;
use crate::params::{Design, Params};
use crate::tune::{AtRest, tune_attitude};
use crate::view;

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
        let mut report = view::tune::attitude(name, &tuned);
        report.written.extend(args.output.as_ref().map(|output| format!("{} written", output.display())));
        print_report(&report);
    }
    Ok(Status::Done)
}
