//! What an airplane document says.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::amounts::with_unit;
use crate::aircraft::airframe::Airplane;
use crate::aircraft::airframe::check::AirplaneCheck;
use crate::units::Dimension;

/// An airplane, and where it flies.
#[derive(Clone, Debug, clap::Args, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Request {
    /// airplane.json
    pub airplane: PathBuf,
    /// Where speeds are looked at
    #[arg(long, value_name = "LENGTH", default_value = "0 m", allow_hyphen_values = true)]
    #[serde(default = "sea_level")]
    pub altitude: String,
}

fn sea_level() -> String {
    "0 m".into()
}

/// What it is, and whether it makes sense.
pub fn run(request: &Request) -> anyhow::Result<AirplaneCheck> {
    let altitude = with_unit("`altitude`", &request.altitude, Dimension::new(0, 2, 0), "100 m")?;
    Ok(Airplane::read(&request.airplane)?.check(altitude)?)
}
