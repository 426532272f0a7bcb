//! Which columns of a log are the aids of a filter.

use std::collections::BTreeSet;

use anyhow::{Context, bail};

use crate::filter::FilterDesign;
use crate::input::ExtraColumn;
use crate::replay::aids;
use crate::units::Unit;

/// The extra columns of the log, in the order of [`aids`].
pub(crate) fn aid_columns(flags: &[String], design: &FilterDesign) -> anyhow::Result<Vec<ExtraColumn>> {
    let needed = aids(design)?;
    let mut given: Vec<(&str, Vec<&str>)> = Vec::new();
    for flag in flags {
        let (name, columns) = flag.split_once('=').with_context(|| format!("`aid` {flag}: expected NAME=COLUMN"))?;
        let (name, columns) = (name.trim(), columns.split(',').map(str::trim).collect::<Vec<_>>());
        let axes = needed.iter().filter(|aid| aid.measurement.name == name).count();
        if axes == 0 {
            let known: BTreeSet<&str> = needed.iter().map(|aid| aid.measurement.name.as_str()).collect();
            let known = if known.is_empty() { "none".into() } else { known.into_iter().collect::<Vec<_>>().join(", ") };
            bail!("`aid` {flag}: the filter has no measurement or input '{name}' beside the sensor; it has {known}");
        }
        if given.iter().any(|(known, _)| *known == name) {
            bail!("`aid` {flag}: '{name}' is given twice");
        }
        if columns.len() != axes {
            bail!(
                "`aid` {flag}: {} columns for {axes} axes; expected one per axis of the filter, in its order",
                columns.len()
            );
        }
        given.push((name, columns));
    }
    let mut taken = vec![0; given.len()];
    let mut extra = Vec::with_capacity(needed.len());
    for aid in &needed {
        let measurement = &aid.measurement;
        let Some(at) = given.iter().position(|(name, _)| *name == measurement.name) else {
            bail!(
                "the filter needs {} beside the sensor; say which column that is, `aid` {0}=COLUMN",
                measurement.name
            );
        };
        let text = given[at].1[taken[at]];
        taken[at] += 1;
        let (column, unit) = column_and_unit(text);
        let dimension = Unit::parse(&measurement.unit).with_context(|| measurement.name.clone())?.dimension();
        let flag = format!("`aid` {}={column}", measurement.name);
        extra.push(ExtraColumn { column: column.to_string(), unit, dimension, flag });
    }
    Ok(extra)
}

/// `COLUMN` or `COLUMN:UNIT`: a unit behind the last colon, unless the name itself has it.
pub(crate) fn column_and_unit(text: &str) -> (&str, Option<Unit>) {
    let unit = text.rsplit_once(':').and_then(|(column, unit)| Some((column, Unit::parse(unit).ok()?)));
    unit.map_or((text, None), |(column, unit)| (column, Some(unit)))
}
