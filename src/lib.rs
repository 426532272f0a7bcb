//! Kalman-filter design workbench for inertial sensors.
//!
//! Modules are ordered in floors; each uses only lower floors (`tests/architecture.rs` checks it).

#![forbid(unsafe_code)]

pub mod aircraft;
pub mod allan;
pub mod cli;
pub mod compare;
pub mod consistency;
pub mod export;
pub mod filter;
pub mod identify;
pub mod import;
pub mod input;
pub mod model;
pub mod montecarlo;
pub mod noise;
pub mod numerics;
pub mod params;
pub mod replay;
pub mod report;
pub mod signal;
pub mod simulate;
pub mod tune;
pub mod units;
