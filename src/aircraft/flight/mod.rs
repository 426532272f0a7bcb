//! An airplane over time: the `flight.json` document, earth, servos, autopilot, sensors (floor 4).
//!
//! [`Plan`] is a document with everything it names, in SI; [`fly`] flies it, run by run. Random numbers are addressed
//! as `streams` says, so that no number depends on how many threads or runs there are.

mod air;
mod autopilot;
mod commands;
pub mod document;
pub mod earth;
mod motion;
mod plan;
mod report;
mod rows;
mod run;
mod sensors;
pub mod servo;
pub mod setting;
mod start;
mod streams;
mod surfaces;
mod vector;

pub use autopilot::RateGains;
pub use document::FlightDocument;
pub use plan::{Plan, STEP, Times};
pub use report::{ColumnReport, FlightReport, RowSink, RunReport, fly};
pub use run::{Commander, Seen, Truth};
pub use sensors::three_axes;
pub use setting::Setting;

/// A flight that cannot be flown: one clear line.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{0}")]
pub struct FlightError(pub String);
