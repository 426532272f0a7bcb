//! One integration binary, one file per room or concern.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking, helpers too")]
#![allow(clippy::print_stdout, reason = "a skipped test says so")]
#![allow(unreachable_pub, reason = "modules of one binary share the support module")]

mod aircraft;
mod allan;
mod answers;
mod architecture;
mod attitude;
mod bad_input;
mod browser;
mod cli;
mod code;
mod compare;
mod consistency;
mod deployment;
mod docs;
mod export;
mod filter;
mod identify;
mod import;
mod input;
mod interrupted;
mod measured;
mod model;
mod montecarlo;
mod noise;
mod numerics;
mod ops;
mod params;
mod plants;
mod progress;
mod replay;
mod report;
#[cfg(feature = "serve")]
mod serve;
mod shell;
mod simulate;
mod support;
mod tune;
mod units;
