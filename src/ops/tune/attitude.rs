//! The filter of the plant attitude.

use anyhow::{Context, anyhow};
use schemars::JsonSchema;
use serde::Serialize;

use super::Request;
use super::objective::ObjectiveArg;
use crate::filter::AttitudeDesign;
use crate::params::{Design, Params};
use crate::tune::{AtRest, TunedAttitude, tune_attitude};

/// What `tune` of the plant attitude gives as a document.
#[derive(Serialize, JsonSchema)]
pub struct Document<'a> {
    /// "kfdesign-tune-attitude/1".
    format: &'static str,
    /// As written with `-o`.
    #[schemars(with = "AttitudeDesign")]
    filter: serde_json::Value,
    at_rest: &'a [AtRest],
}

pub(super) fn run(request: &Request, name: &str, params: &Params, design: &Design) -> anyhow::Result<TunedAttitude> {
    let given = [
        ("truth", request.truth.is_some()),
        ("log", !request.log.is_empty()),
        ("objective", request.choosing.objective != ObjectiveArg::Nominal),
        ("hold", !request.choosing.hold.is_empty()),
        ("insight", request.insight),
    ];
    if let Some((option, _)) = given.iter().find(|(_, given)| *given) {
        return Err(linear_only(option));
    }
    tune_attitude(params, design, request.flicker_horizon).with_context(|| name.to_string())
}

/// Of an option that an attitude filter does not have.
pub fn linear_only(option: &str) -> anyhow::Error {
    anyhow!("`{option}` is made for linear filters; an attitude filter is judged on a log with a reference, by replay")
}

pub fn document(tuned: &TunedAttitude) -> anyhow::Result<Document<'_>> {
    let filter = serde_json::from_str(&tuned.design.to_json())?;
    Ok(Document { format: "kfdesign-tune-attitude/1", filter, at_rest: &tuned.at_rest })
}
