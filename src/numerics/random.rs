//! Random streams addressed by (seed, run, axis, term): adding threads, runs or axes changes no other number.

use rand::rngs::ChaCha8Rng;

/// What a stream is for; the number is part of the address and never reused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StreamId {
    pub run: u64,
    pub axis: u32,
    /// Term number inside the axis; see [`crate::simulate`] for the table.
    pub term: u32,
}

/// An independent ChaCha8 stream for this address. Same address, same numbers, on any thread.
pub fn stream(seed: u64, id: StreamId) -> ChaCha8Rng {
    let _ = (seed, id);
    todo!()
}

/// Fill with independent standard normal numbers.
pub fn fill_normal(rng: &mut ChaCha8Rng, out: &mut [f64]) {
    let _ = (rng, out);
    todo!()
}
/// One standard normal number.
pub fn normal(rng: &mut ChaCha8Rng) -> f64 {
    let _ = rng;
    todo!()
}
