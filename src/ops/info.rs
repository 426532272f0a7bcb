//! What is in a log.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::input::inspect::{Inventory, inspect};

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
