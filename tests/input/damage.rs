//! Files cut off and changed at random: whatever a reader makes of them, it ends, in one line if it refuses.

use std::time::{Duration, Instant};

use super::{Flags, read_bytes};

/// Cuts the file at every 1 % and changes up to eight bytes of it, `count` times with a fixed seed; half of the changes are
/// near the beginning, where the structure is. Returns the longest time for one file. A panic or an abort fails the test, and so does a minute for one file.
pub fn survives(name: &str, bytes: &[u8], flags: &[Flags], count: u64) -> Duration {
    let cuts = (0..100).map(|percent| bytes[..bytes.len() * percent / 100].to_vec());
    let mut state = 0x9e37_79b9_7f4a_7c15u64;
    let mut draw = move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 16) as usize
    };
    let changed = (0..count).map(|i| {
        let mut copy = bytes.to_vec();
        let reach = if i % 2 == 0 { copy.len().min(2048) } else { copy.len() };
        for _ in 0..=draw() % 8 {
            let at = draw() % reach;
            copy[at] = draw() as u8;
        }
        copy
    });
    let mut slowest = Duration::ZERO;
    for damaged in cuts.chain(changed) {
        for flags in flags {
            let began = Instant::now();
            let _ = read_bytes(name, &damaged, flags);
            slowest = slowest.max(began.elapsed());
            assert!(began.elapsed() < Duration::from_secs(60), "{name}: {:?}", began.elapsed());
        }
    }
    slowest
}
