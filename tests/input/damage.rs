//! Files cut off and changed at random: whatever a reader makes of them, it ends, in one line if it refuses.

use std::time::{Duration, Instant};

use super::{Flags, read_bytes};

/// The file cut at every 1 %.
pub fn cuts(bytes: &[u8]) -> impl Iterator<Item = Vec<u8>> {
    (0..100).map(|percent| bytes[..bytes.len() * percent / 100].to_vec())
}

/// The file with up to eight bytes changed, `count` times with a fixed seed; half of the changes are near the
/// beginning, where the structure is.
pub fn changed(bytes: &[u8], count: u64) -> impl Iterator<Item = Vec<u8>> {
    let mut state = 0x9e37_79b9_7f4a_7c15u64;
    let mut draw = move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 16) as usize
    };
    (0..count).map(move |i| {
        let mut copy = bytes.to_vec();
        let reach = if i % 2 == 0 { copy.len().min(2048) } else { copy.len() };
        for _ in 0..=draw() % 8 {
            let at = draw() % reach;
            copy[at] = draw() as u8;
        }
        copy
    })
}

/// Reads [`cuts`] and [`changed`]. Returns the longest time for one file. A panic or an abort fails the test, and so
/// does a minute for one file.
pub fn survives(name: &str, bytes: &[u8], flags: &[Flags], count: u64) -> Duration {
    let mut slowest = Duration::ZERO;
    for damaged in cuts(bytes).chain(changed(bytes, count)) {
        for flags in flags {
            let began = Instant::now();
            let _ = read_bytes(name, &damaged, flags);
            slowest = slowest.max(began.elapsed());
            assert!(began.elapsed() < Duration::from_secs(60), "{name}: {:?}", began.elapsed());
        }
    }
    slowest
}

/// The same 10,000 times, and prints the longest time and the most memory that the process has held.
pub fn ten_thousand(name: &str, bytes: &[u8], flags: Flags) {
    let slowest = survives("log", bytes, &[flags], 10_000);
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let peak = status.lines().find(|line| line.starts_with("VmHWM")).unwrap_or_default();
    println!("{name}: {} bytes, slowest {slowest:?}, process {peak}", bytes.len());
}
