//! Controllability, optimal gains and the `linear.json` document (floor 3).

pub mod controllability;
pub mod document;
pub mod margins;
pub mod regulator;
pub mod response;
