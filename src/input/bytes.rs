//! Little-endian numbers and runs of bytes, never beyond the end.

use std::io::Read;

use crate::units::plain;
use ruzstd::decoding::{FrameDecoder, StreamingDecoder};

/// The bytes end before what they declare.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Short;

impl From<Short> for String {
    fn from(_: Short) -> String {
        "truncated or damaged: it ends inside a record".into()
    }
}

/// Reads from the front of some bytes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bytes<'a>(pub(super) &'a [u8]);

impl<'a> Bytes<'a> {
    pub(super) fn take(&mut self, count: usize) -> Result<&'a [u8], Short> {
        let (taken, rest) = self.0.split_at_checked(count).ok_or(Short)?;
        self.0 = rest;
        Ok(taken)
    }
    /// An unsigned number of up to 8 bytes.
    pub(super) fn number(&mut self, size: usize) -> Result<u64, Short> {
        Ok(self.take(size)?.iter().rev().fold(0, |sum, byte| sum << 8 | u64::from(*byte)))
    }
    pub(super) fn u8(&mut self) -> Result<u8, Short> {
        Ok(self.take(1)?[0])
    }
    pub(super) fn u16(&mut self) -> Result<u16, Short> {
        Ok(self.number(2)? as u16)
    }
    pub(super) fn u32(&mut self) -> Result<u32, Short> {
        Ok(self.number(4)? as u32)
    }
    /// A text that ends at a zero byte or with the bytes.
    pub(super) fn text(bytes: &[u8]) -> String {
        let end = bytes.iter().position(|b| *b == 0).unwrap_or(bytes.len());
        printable(&bytes[..end])
    }
}

/// A frame of Zstandard that is to hold about so many bytes: its window, for which room is made at once, may be as
/// large or 8 MiB, which every decoder has (RFC 8878, section 3.1.1.1.2).
pub(super) fn zstd(frame: &[u8], size: u64) -> Result<impl Read + '_, String> {
    let mut decoder = FrameDecoder::new();
    decoder.set_max_window_size(size.clamp(8 << 20, 128 << 20).next_power_of_two());
    StreamingDecoder::new_with_decoder(frame, decoder).map_err(|error| format!("no Zstandard frame: {error}"))
}

/// A name of a binary file: on one line, whatever is in it.
pub(super) fn printable(bytes: &[u8]) -> String {
    plain(&String::from_utf8_lossy(bytes)).into_owned()
}
