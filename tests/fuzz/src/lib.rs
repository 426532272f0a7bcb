//! What every target does with its bytes: what `kfdesign info FILE` and every command with LOG do with a file.

use std::path::PathBuf;
use std::sync::OnceLock;

use kfdesign::input::{self, LogOptions, inspect};
use kfdesign::units::Unit;
use libfuzzer_sys::Corpus;

/// The file of this process, in memory where there is such a folder.
fn file() -> &'static PathBuf {
    static FILE: OnceLock<PathBuf> = OnceLock::new();
    FILE.get_or_init(|| {
        let memory = PathBuf::from("/dev/shm");
        let folder = if memory.is_dir() { memory } else { std::env::temp_dir() };
        folder.join(format!("kfdesign_fuzz_{}", std::process::id()))
    })
}

/// Reads the bytes as a log, without flags and with those that files without units ask for. Bytes without the
/// signature are not kept: they are another reader's.
pub fn read(signature: &[u8], bytes: &[u8]) -> Corpus {
    if !bytes.starts_with(signature) {
        return Corpus::Reject;
    }
    std::fs::write(file(), bytes).expect("the bytes are written");
    let one_line = |error: input::InputError| assert!(!error.message.contains('\n'), "{error}");
    inspect::inspect(file()).map(drop).unwrap_or_else(one_line);
    let without = LogOptions { no_digest: true, ..LogOptions::default() };
    let unit = Unit::parse("deg/s").ok();
    let with = LogOptions { unit, rate_hz: Some(100.0), ..without.clone() };
    for options in [without, with] {
        input::read(file(), &options).map(drop).unwrap_or_else(one_line);
    }
    Corpus::Keep
}
