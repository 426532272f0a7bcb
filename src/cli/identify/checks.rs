//! What of the log check and of the fits is a failed check.

use std::path::Path;

use crate::cli::Status;
use crate::cli::output::say;
use crate::identify::IdentifiedAxis;
use crate::params::{Check, Params};
use crate::signal::LogCheck;

/// What was found wrong with the logs and the fits. Without motion no part is named.
pub(super) fn checks(logs: &[LogCheck], axes: &[IdentifiedAxis]) -> Vec<Check> {
    let several = logs.len() > 1;
    let named = |kind: &'static str| {
        logs.iter().enumerate().flat_map(move |(i, check)| {
            let of = if several { format!("log {}: ", i + 1) } else { String::new() };
            check.findings.iter().filter(move |finding| finding.kind == kind).map(move |finding| Check {
                kind: kind.into(),
                axis: finding.axis.clone(),
                message: format!("{of}{}", finding.message),
                numbers: [
                    ("samples", finding.count as f64),
                    ("of", check.samples as f64),
                    ("first_s", finding.first_s),
                ]
                .map(|(name, value)| (name.to_string(), value))
                .into(),
            })
        })
    };
    named(Check::MOTION).chain(named(Check::CALM)).chain(axes.iter().filter_map(|axis| axis.found.missed())).collect()
}

/// A failed check is said on stderr, in one line.
pub(super) fn status(params: &Params, output: Option<&Path>) -> Status {
    let Some(failed) = params.failed_check() else { return Status::Done };
    let kept = output.map_or_else(String::new, |path| format!(", kept in {}", path.display()));
    say(&format!("check failed: {failed} (exit status 1{kept})"));
    Status::CheckFailed
}
