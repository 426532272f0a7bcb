//! One file per command: what it is asked for, a `Request`, becomes a result with its document (floor 8).
//!
//! A request is described once: its fields are flags of the command line, and keys of a JSON object (unknown ones are
//! refused). Nothing here prints: notes and progress go to who waits ([`crate::numerics::progress`]), files other than
//! tables that are longer than memory are written by who asked. Errors are one line each, for a person.
//!
//! ```
//! use kfdesign::ops::{identify, simulate};
//! use serde_json::{from_value, json};
//!
//! let folder = tempfile::tempdir()?;
//! let log = folder.path().join("log.npy");
//! simulate::run(&from_value(json!({ "params": "data/params.json", "output": log, "duration": "10min" }))?)?;
//! let found = identify::run(&from_value(json!({ "logs": [log], "model": "white" }))?)?;
//! let density = found.axes[0].found.model.wideband_density().to_degrees();
//! assert!((density / 0.0562 - 1.0).abs() < 0.02, "{density}");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod aid_columns;
pub mod airplane;
pub mod allan;
pub mod amounts;
pub mod checked;
pub mod closed_loop;
pub mod compare;
pub mod datasheet;
pub mod export;
pub mod fly;
pub mod identify;
pub mod import;
pub mod inflate;
pub mod info;
mod logs;
pub mod montecarlo;
pub mod plan;
pub mod reading;
pub mod replay;
pub mod simulate;
pub mod stretch;
pub mod trim;
pub mod tune;
pub mod windows;
