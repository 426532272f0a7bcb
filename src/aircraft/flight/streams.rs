//! Where the random numbers of a flight come from.
//!
//! A stream is addressed by (seed, run, axis, term) as in [`crate::simulate`]:
//!
//! | what | axis | term |
//! | --- | --- | --- |
//! | gyro x, y, z | 0, 1, 2 | as in `simulate` |
//! | accelerometer x, y, z | 2³¹, 2³¹ + 1, 2³¹ + 2 | as in `simulate` |
//! | white noises u, w, v, p of turbulence | 2³⁰ … 2³⁰ + 3 | number of the gust |
//! | another measurement (order of its column) | 2²⁹ + number | 0 white, 1 drift |

use rand::rngs::ChaCha8Rng;

use crate::numerics::random::{StreamId, stream};

pub(super) const GYRO: u32 = 0;
pub(super) const ACCELEROMETER: u32 = 1 << 31;
const GUST: u32 = 1 << 30;
const MEASUREMENT: u32 = 1 << 29;

pub(super) fn gust(seed: u64, run: u64, number: u32) -> [ChaCha8Rng; 4] {
    [0, 1, 2, 3].map(|noise| stream(seed, StreamId { run, axis: GUST + noise, term: number }))
}

/// White noise and drift of a measurement.
pub(super) fn measurement(seed: u64, run: u64, number: u32) -> [ChaCha8Rng; 2] {
    [0, 1].map(|term| stream(seed, StreamId { run, axis: MEASUREMENT + number, term }))
}
