//! The airplane as an object of control: one wing whose rooms stand on floors of their own.
//!
//! Conventions everywhere: body axes x forward, y right, z down; earth axes north, east, down; SI units and radians.
//! The elevator is positive trailing edge down, the aileron when it rolls right, the rudder trailing edge left.

pub mod airframe;
pub mod atmosphere;
pub mod closed_loop;
pub mod control;
pub mod flight;
