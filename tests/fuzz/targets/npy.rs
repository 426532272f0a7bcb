#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| -> libfuzzer_sys::Corpus { kfdesign_fuzz::read(b"\x93NUMPY", bytes) });
