//! The filter in the control loop: what a sensor and its filter do to stability, damping, gust response and accuracy of
//! an airplane (floor 5).
//!
//! Everything here is linear about one steady flight and exact at the samples of the autopilot; `flights` checks it
//! against the nonlinear airplane. A [`Feed`](feed::Feed) stands between the sensors and the gains; `circuit` closes
//! the loop with it, `analysis` judges it.

pub mod analysis;
pub mod circuit;
pub mod curves;
pub mod document;
pub mod feed;
pub mod filters;
pub mod flights;
pub mod flown;
pub mod half;
pub mod half_feed;
pub mod judged;
pub mod kalman;
pub mod modes;
pub mod optimize;
pub mod plant;
pub mod rule;
pub mod schedule;
pub mod sensors;
pub mod spread;
pub mod sweep;
pub mod varied;
pub mod verdict;
pub mod warnings;

use crate::numerics::linalg::LinalgError;

/// A loop that cannot be judged: one clear line.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{0}")]
pub struct LoopError(pub String);

impl From<LinalgError> for LoopError {
    fn from(error: LinalgError) -> LoopError {
        LoopError(error.to_string())
    }
}

impl From<crate::aircraft::flight::FlightError> for LoopError {
    fn from(error: crate::aircraft::flight::FlightError) -> LoopError {
        LoopError(error.0)
    }
}

pub use judged::Judged;
