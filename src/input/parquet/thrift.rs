//! The records of a Parquet file (Thrift's compact protocol) before the crate `parquet` reads them: it passes over the elements of a list one
//! by one, as many as are declared, and truth values take no bytes there. What declares more of them than the record has bytes is damaged.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};

use crate::input::bytes::{Bytes, Short};

/// As deep as the crate goes.
const DEEPEST: u8 = 64;
/// Bytes in which the header of a page is sought, few at first: pages may be many and small. One that is longer is left to the crate.
const HEADER: [u64; 2] = [1 << 9, 1 << 16];

/// More elements without bytes than bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Endless;

/// A record that was passed over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Passed {
    bytes: u64,
    /// Its third field, if that is a 32-bit integer: of the header of a page the bytes of the page.
    third: Option<i64>,
}

enum Fault {
    /// It ends too early, or is none: the crate will say so.
    Short,
    Endless,
}

impl From<Short> for Fault {
    fn from(_: Short) -> Fault {
        Fault::Short
    }
}

struct Walk<'a> {
    left: Bytes<'a>,
    /// So many elements without bytes may follow.
    free: u64,
}

impl Walk<'_> {
    fn varint(&mut self) -> Result<u64, Fault> {
        let (mut number, mut shift) = (0, 0);
        loop {
            let byte = self.left.u8()?;
            number |= u64::from(byte & 0x7f).checked_shl(shift).unwrap_or(0);
            shift = (shift + 7).min(u64::BITS);
            if byte & 0x80 == 0 {
                return Ok(number);
            }
        }
    }

    fn integer(&mut self) -> Result<i64, Fault> {
        let number = self.varint()?;
        Ok((number >> 1) as i64 ^ -((number & 1) as i64))
    }

    /// The fields up to the end of the record; the third, as in [`Passed`].
    fn record(&mut self, depth: u8) -> Result<Option<i64>, Fault> {
        let (mut id, mut third) = (0_i64, None);
        loop {
            let head = self.left.u8()?;
            let kind = head & 0xf;
            if kind == 0 {
                return Ok(third);
            }
            id = if head >> 4 > 0 { id.wrapping_add(i64::from(head >> 4)) } else { self.integer()? };
            if (id, kind) == (3, 5) {
                third = Some(self.integer()?);
            } else {
                self.value(kind, depth)?;
            }
        }
    }

    fn value(&mut self, kind: u8, depth: u8) -> Result<(), Fault> {
        let depth = depth.checked_sub(1).ok_or(Fault::Short)?;
        match kind {
            1 | 2 => {}
            3 => drop(self.left.take(1)?),
            4..=6 => drop(self.varint()?),
            7 => drop(self.left.take(8)?),
            8 => {
                let length = self.varint()?;
                self.left.take(usize::try_from(length).map_err(|_| Fault::Short)?)?;
            }
            9 | 10 => {
                let head = self.left.u8()?;
                let count = if head >> 4 == 15 { self.varint()? } else { u64::from(head >> 4) };
                self.elements(&[head & 0xf], count, depth)?;
            }
            11 => {
                let count = self.varint()?;
                if count > 0 {
                    let kinds = self.left.u8()?;
                    self.elements(&[kinds >> 4, kinds & 0xf], count, depth)?;
                }
            }
            12 => drop(self.record(depth)?),
            13 => drop(self.left.take(16)?),
            _ => return Err(Fault::Short),
        }
        Ok(())
    }

    fn elements(&mut self, kinds: &[u8], count: u64, depth: u8) -> Result<(), Fault> {
        if kinds.iter().all(|kind| matches!(kind, 1 | 2)) {
            self.free = self.free.checked_sub(count).ok_or(Fault::Endless)?;
            return Ok(());
        }
        // each takes a byte at least
        for _ in 0..count {
            kinds.iter().try_for_each(|kind| self.value(*kind, depth))?;
        }
        Ok(())
    }
}

/// The record at the beginning of these bytes; `None` if it is no whole record.
fn pass(bytes: &[u8]) -> Result<Option<Passed>, Endless> {
    let mut walk = Walk { left: Bytes(bytes), free: bytes.len() as u64 };
    match walk.record(DEEPEST) {
        Ok(third) => Ok(Some(Passed { bytes: (bytes.len() - walk.left.0.len()) as u64, third })),
        Err(Fault::Short) => Ok(None),
        Err(Fault::Endless) => Err(Endless),
    }
}

/// Up to so many bytes from there.
fn read(mut file: &File, at: u64, most: u64) -> Option<Vec<u8>> {
    file.seek(SeekFrom::Start(at)).ok()?;
    let mut bytes = Vec::new();
    file.take(most).read_to_end(&mut bytes).ok()?;
    Some(bytes)
}

/// The table of contents at the end of the file, whose length stands before the signature.
pub(super) fn contents_end(file: &File) -> Result<(), Endless> {
    let length = file.metadata().map_or(0, |file| file.len());
    let declared = length.checked_sub(8).and_then(|at| read(file, at, 4));
    let declared = declared.and_then(|bytes| Bytes(&bytes).u32().ok()).map_or(0, u64::from);
    match length.checked_sub(8 + declared).and_then(|at| read(file, at, declared)) {
        Some(contents) => pass(&contents).map(|_| ()),
        None => Ok(()),
    }
}

/// The headers of the pages between these places.
pub(super) fn headers_end(file: &File, mut at: u64, end: u64) -> Result<(), Endless> {
    while at < end {
        let mut header = None;
        for most in HEADER {
            let Some(bytes) = read(file, at, most.min(end - at)) else { return Ok(()) };
            header = pass(&bytes)?;
            if header.is_some() {
                break;
            }
        }
        let Some(Passed { bytes, third: Some(page) }) = header else { break };
        let Ok(page) = u64::try_from(page) else { break };
        at = at.saturating_add(bytes).saturating_add(page);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_are_passed_over_whatever_is_in_them() {
        // fields 1: i32, 2: text, 3: i32 -3, 4: list of two i64, 5: map of a byte to a truth value, 6: record with a double, 7: true
        let mut bytes = vec![0x15, 0x80, 0x01, 0x18, 2, b'a', b'b', 0x15, 5, 0x19, 0x26, 1, 0x82, 3];
        bytes.extend([0x1b, 1, 0x31, 9, 0x1c, 0x17, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0x11, 0]);
        let length = bytes.len() as u64;
        bytes.extend([1, 2, 3]);
        assert_eq!(pass(&bytes), Ok(Some(Passed { bytes: length, third: Some(-3) })));
        for cut in 0..length as usize {
            assert_eq!(pass(&bytes[..cut]), Ok(None));
        }
        // a field whose number stands apart
        assert_eq!(pass(&[0x05, 6, 8, 0]), Ok(Some(Passed { bytes: 4, third: Some(4) })));
    }

    #[test]
    fn elements_without_bytes_are_at_most_as_many_as_bytes() {
        // a list of 2^31 - 1 truth values, alone and in a list of such lists; a map of as many
        let many = [0xff, 0xff, 0xff, 0xff, 0x07];
        let list = [&[0x19, 0xf2], &many[..], &[0]].concat();
        assert_eq!(pass(&list), Err(Endless));
        assert_eq!(pass(&[&[0x19, 0x19, 0xf1], &many[..], &[0]].concat()), Err(Endless));
        assert_eq!(pass(&[&[0x1b], &many[..], &[0x21, 0]].concat()), Err(Endless));
        assert_eq!(pass(&[0x19, 0x42, 0]), Err(Endless));
        assert_eq!(pass(&[0x19, 0x32, 0]), Ok(Some(Passed { bytes: 3, third: None })));
        // a number of a field as large as there is, and a number of many bytes
        let largest = [&[0x05, 0xfe], &[0xff; 8][..], &[0x01, 0, 0x15, 0, 0]].concat();
        assert!(matches!(pass(&largest), Ok(Some(_))));
        assert!(matches!(pass(&[&[0x15], &[0x80; 100][..], &[0, 0]].concat()), Ok(Some(Passed { bytes: 103, .. }))));
        // records in records
        assert_eq!(pass(&[0x1c; 1000]), Ok(None));
    }
}
