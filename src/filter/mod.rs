//! Kalman filter (Joseph form), square root, steady state, the filter.json document, the run record (floor 3).

pub mod document;
pub mod gains;
pub mod judge;
pub mod kalman;
mod reading;
mod rows;
pub mod steady_state;

pub use document::{AxisDesign, FilterDesign, FilterError};
pub use gains::GainSequence;
pub use judge::Judge;
pub use kalman::Kalman;
pub use steady_state::{SteadyState, SteadyStateError, steady_state};
