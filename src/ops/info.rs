//! What is in a log, and what it looks like.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::reading::{Reading, note_check};
use crate::input::inspect::{Inventory, inspect};
use crate::signal::course::Course;

/// A log.
#[derive(Clone, Debug, clap::Args, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Request {
    /// A log of any format that is read
    pub log: PathBuf,
}

/// Its topics, columns, units, rates and spans.
pub fn run(request: &Request) -> anyhow::Result<Inventory> {
    Ok(inspect(&request.log)?)
}

/// The values over time, as every other command reads them.
pub fn course(request: &Request, reading: &Reading) -> anyhow::Result<Course> {
    let (recording, check) = crate::input::read(&request.log, &reading.options()?)?;
    note_check(&recording.name, &check);
    Ok(Course::of(recording, check))
}
