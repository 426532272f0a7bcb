//! The `source` section of `params.json`: where the numbers come from, and what is known against them.

use schemars::JsonSchema;
use serde::Serialize;

use super::axis::{in_unit, seconds};
use super::place::{KeyError, Place};
use super::{BetweenLogs, Check, CheckKind, Inflated, Measured, Reading, Source};

/// Where the numbers come from.
#[derive(Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "Source")]
pub(super) struct SourceDocument {
    #[serde(skip_serializing_if = "Option::is_none")]
    log: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    sha256: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    samples: Option<u64>,
    /// Time from the first to the last sample.
    #[serde(skip_serializing_if = "Option::is_none")]
    span: Option<Measured>,
    #[serde(skip_serializing_if = "Option::is_none")]
    method: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    version: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    note: Option<String>,
    /// What the white noise was multiplied with after the bench, by axis.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    inflation: Vec<Inflated>,
    /// Checks that the log, or the fit to it, has failed; none: nothing was found.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    checks: Vec<Check>,
    /// Of several logs: parameters that are not the same in all.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    between_logs: Vec<BetweenLogs>,
    /// How the log was read, for the next log of the same kind.
    #[serde(skip_serializing_if = "Option::is_none")]
    reading: Option<Reading>,
}

impl From<&Source> for SourceDocument {
    fn from(source: &Source) -> Self {
        SourceDocument {
            log: source.log.clone(),
            sha256: source.sha256.clone(),
            samples: source.samples,
            span: source.span_s.and_then(|s| in_unit(s, "s")),
            method: source.method.clone(),
            version: source.version.clone(),
            note: source.note.clone(),
            inflation: source.inflation.clone(),
            checks: source.checks.clone(),
            between_logs: source.between_logs.clone(),
            reading: source.reading.clone(),
        }
    }
}

pub(super) fn source(place: &Place<'_>) -> Result<Source, KeyError> {
    let object = place.object(&[
        "log",
        "sha256",
        "samples",
        "span",
        "method",
        "version",
        "note",
        "inflation",
        "checks",
        "between_logs",
        "reading",
    ])?;
    let text = |key: &str| object.optional(key).map(|p| p.text().map(str::to_string)).transpose();
    Ok(Source {
        log: text("log")?,
        sha256: text("sha256")?,
        samples: object.optional("samples").map(|p| p.count()).transpose()?,
        span_s: seconds(&object, "span")?,
        method: text("method")?,
        version: text("version")?,
        note: text("note")?,
        inflation: match object.optional("inflation") {
            Some(list) => list.list()?.iter().map(inflated).collect::<Result<_, _>>()?,
            None => Vec::new(),
        },
        checks: match object.optional("checks") {
            Some(list) => list.list()?.iter().map(check).collect::<Result<_, _>>()?,
            None => Vec::new(),
        },
        between_logs: match object.optional("between_logs") {
            Some(list) => list.list()?.iter().map(between_logs).collect::<Result<_, _>>()?,
            None => Vec::new(),
        },
        reading: object.optional("reading").map(|p| reading(&p)).transpose()?,
    })
}

/// Of a log: in params.json, and in the record of the tuning in filter.json.
pub(super) fn reading(place: &Place<'_>) -> Result<Reading, KeyError> {
    let object = place.object(&["columns", "topic", "time", "unit", "rate"])?;
    let text = |key: &str| object.optional(key).map(|p| p.text().map(str::to_string)).transpose();
    let columns = object.optional("columns").map(|p| p.list()).transpose()?.unwrap_or_default();
    Ok(Reading {
        columns: columns.iter().map(|p| p.text().map(str::to_string)).collect::<Result<_, _>>()?,
        topic: text("topic")?,
        time: text("time")?,
        unit: text("unit")?,
        rate: object.optional("rate").map(|p| p.number()).transpose()?,
    })
}

fn check(place: &Place<'_>) -> Result<Check, KeyError> {
    let object = place.object(&["kind", "axis", "message", "numbers"])?;
    let numbers = object.optional("numbers").map(|numbers| numbers.entries()).transpose()?.unwrap_or_default();
    Ok(Check {
        kind: check_kind(&object.required("kind")?)?,
        axis: object.optional("axis").map(|p| p.text().map(str::to_string)).transpose()?,
        message: object.required("message")?.text()?.to_string(),
        numbers: numbers.iter().map(|(name, p)| Ok((name.to_string(), p.number()?))).collect::<Result<_, _>>()?,
    })
}

fn check_kind(place: &Place<'_>) -> Result<CheckKind, KeyError> {
    match place.text()? {
        "motion" => Ok(CheckKind::Motion),
        "fit" => Ok(CheckKind::Fit),
        "calm" => Ok(CheckKind::Calm),
        other => Err(place.error(format!("{other}, expected motion, fit or calm"))),
    }
}

fn between_logs(place: &Place<'_>) -> Result<BetweenLogs, KeyError> {
    let object = place.object(&["axis", "parameter", "spread_percent", "interval_percent", "p_value"])?;
    let not_negative = |place: &Place<'_>| match place.number()? {
        value if value >= 0.0 => Ok(value),
        value => Err(place.error(format!("{value}, expected a number that is not negative"))),
    };
    Ok(BetweenLogs {
        axis: object.required("axis")?.text()?.to_string(),
        parameter: object.required("parameter")?.text()?.to_string(),
        spread_percent: not_negative(&object.required("spread_percent")?)?,
        interval_percent: ends(&object.required("interval_percent")?, not_negative)?,
        p_value: not_negative(&object.required("p_value")?)?,
    })
}

fn inflated(place: &Place<'_>) -> Result<Inflated, KeyError> {
    let object = place.object(&["axis", "factor", "interval"])?;
    let positive = |place: &Place<'_>| match place.number()? {
        value if value > 0.0 => Ok(value),
        value => Err(place.error(format!("{value}, expected a factor above zero"))),
    };
    Ok(Inflated {
        axis: object.required("axis")?.text()?.to_string(),
        factor: positive(&object.required("factor")?)?,
        interval: ends(&object.required("interval")?, positive)?,
    })
}

/// `[lower, upper]`.
fn ends(interval: &Place<'_>, read: impl Fn(&Place<'_>) -> Result<f64, KeyError>) -> Result<[f64; 2], KeyError> {
    let ends = interval.list()?.iter().map(read).collect::<Result<Vec<_>, _>>()?;
    ends.try_into()
        .map_err(|ends: Vec<f64>| interval.error(format!("expected [lower, upper], found {} values", ends.len())))
}
