//! What of the log check and of the fits is a failed check.

use crate::identify::IdentifiedAxis;
use crate::params::{Check, CheckKind};
use crate::signal::LogCheck;
use crate::signal::check::FindingKind;

/// What was found wrong with the logs and the fits. Without motion no part is named.
pub(super) fn checks(logs: &[LogCheck], axes: &[IdentifiedAxis]) -> Vec<Check> {
    let several = logs.len() > 1;
    let named = |wanted: FindingKind, kind: CheckKind| {
        logs.iter().enumerate().flat_map(move |(i, check)| {
            let of = if several { format!("log {}: ", i + 1) } else { String::new() };
            check.findings.iter().filter(move |finding| finding.kind == wanted).map(move |finding| Check {
                kind,
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
    let motion = named(FindingKind::Motion, CheckKind::Motion);
    let calm = named(FindingKind::Calm, CheckKind::Calm);
    motion.chain(calm).chain(axes.iter().filter_map(|axis| axis.found.missed())).collect()
}
