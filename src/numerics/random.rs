//! Random streams addressed by (seed, run, axis, term): adding threads, runs or axes changes no other number.

use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// What a stream is for; the number is part of the address and never reused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StreamId {
    pub run: u64,
    pub axis: u32,
    /// Term number inside the axis; see [`crate::simulate`] for the table.
    pub term: u32,
}

/// An independent ChaCha8 stream for this address. Same address, same numbers, on any thread.
///
/// The 256-bit key is the address itself (`"kfdesign"`, seed, run, axis, term; little-endian), so two addresses
/// never share a key, and streams of different keys are unrelated by the construction of the cipher (Bernstein
/// 2008).
pub fn stream(seed: u64, id: StreamId) -> ChaCha8Rng {
    let mut key = [0; 32];
    key[..8].copy_from_slice(b"kfdesign");
    key[8..16].copy_from_slice(&seed.to_le_bytes());
    key[16..24].copy_from_slice(&id.run.to_le_bytes());
    key[24..28].copy_from_slice(&id.axis.to_le_bytes());
    key[28..].copy_from_slice(&id.term.to_le_bytes());
    ChaCha8Rng::from_seed(key)
}

/// Fill with independent standard normal numbers.
pub fn fill_normal(rng: &mut ChaCha8Rng, out: &mut [f64]) {
    for x in out {
        *x = StandardNormal.sample(rng);
    }
}

/// One standard normal number.
pub fn normal(rng: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(rng)
}
