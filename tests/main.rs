//! One integration binary, one file per room or concern.

mod allan;
mod architecture;
mod bad_input;
mod cli;
mod consistency;
mod docs;
mod filter;
mod identify;
mod input;
mod measured;
mod model;
mod noise;
mod numerics;
mod params;
mod replay;
mod report;
mod simulate;
mod support;
mod tune;
mod units;
