//! Kalman filter (Joseph form), square root, steady state, the filter.json document, the run record (floor 3).

/// Calls a kernel with its size known to the compiler for the sizes that occur most, so that the loops unroll.
macro_rules! for_size {
    ($n:expr, $kernel:ident($($argument:expr),*)) => {
        match $n {
            1 => $kernel(1, $($argument),*),
            2 => $kernel(2, $($argument),*),
            3 => $kernel(3, $($argument),*),
            4 => $kernel(4, $($argument),*),
            5 => $kernel(5, $($argument),*),
            6 => $kernel(6, $($argument),*),
            n => $kernel(n, $($argument),*),
        }
    };
}

/// Calls a generic method with a size from 0 to 6 known to the compiler; more is 6.
macro_rules! with_size {
    ($n:expr, $own:ident.$method:ident($($argument:expr),*)) => {
        match $n {
            0 => $own.$method::<0>($($argument),*),
            1 => $own.$method::<1>($($argument),*),
            2 => $own.$method::<2>($($argument),*),
            3 => $own.$method::<3>($($argument),*),
            4 => $own.$method::<4>($($argument),*),
            5 => $own.$method::<5>($($argument),*),
            _ => $own.$method::<6>($($argument),*),
        }
    };
}

pub mod attitude;
pub mod constant_gain;
pub mod cycle;
mod design;
pub mod document;
pub mod form;
pub mod gains;
pub mod innovations;
pub mod judge;
pub mod kalman;
mod large;
pub mod likelihood;
mod measurement;
pub mod mismatch;
mod reading;
pub(crate) mod rows;
pub mod single;
pub mod smoother;
pub mod square_root;
pub mod steady_state;
mod transition;
pub mod whole_log;

pub use attitude::{AttitudeDesign, AttitudeModel};
pub use constant_gain::ConstantGain;
pub use cycle::Cycle;
pub use design::{AIRPLANE, AxisDesign, FilterDesign, FilterError};
pub use form::{Form, Running};
pub use gains::GainSequence;
pub use innovations::SensorLog;
pub use judge::Judge;
pub use kalman::Kalman;
pub use square_root::SquareRoot;
pub use steady_state::{SteadyState, SteadyStateError, steady_state};
