//! The records of a Parquet file (Thrift's compact protocol) before the crate `parquet` reads them: it passes over
//! the elements of a list one by one, as many as are declared, and truth values take no bytes there. What declares
//! more of them than the record has bytes is damaged. It goes down the tree of columns by recursion, and makes room
//! for the children that a group declares and for each whole path: these are looked at before.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};

use crate::input::account::{Account, DEEPEST, Excess, JUMP, LONGEST_NAME};
use crate::input::bytes::{Bytes, Short};

/// What the crate makes of a record, and of an element of a list, about.
const RECORD: u64 = 512;
const ELEMENT: u64 = 16;
/// Bytes in which the header of a page is sought, few at first: pages may be many and small. One that is longer is
/// left to the crate.
const HEADER: [u64; 2] = [1 << 9, 1 << 16];

/// Why the crate does not get to see a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Refusal {
    /// More elements without bytes than bytes.
    Endless,
    Excess(Excess),
}

impl From<Excess> for Refusal {
    fn from(excess: Excess) -> Refusal {
        Refusal::Excess(excess)
    }
}

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
    Refused(Refusal),
}

impl From<Short> for Fault {
    fn from(_: Short) -> Fault {
        Fault::Short
    }
}

impl From<Excess> for Fault {
    fn from(excess: Excess) -> Fault {
        Fault::Refused(excess.into())
    }
}

struct Walk<'a> {
    left: Bytes<'a>,
    /// So many elements without bytes may follow.
    free: u64,
    /// Bytes that the crate will need for it.
    needs: u64,
}

impl<'a> Walk<'a> {
    fn new(bytes: &'a [u8]) -> Walk<'a> {
        Walk { left: Bytes(bytes), free: bytes.len() as u64, needs: 0 }
    }

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

    /// Number and kind of the next field of a record, whose last field had the given number; none at its end.
    fn field(&mut self, id: i64) -> Result<Option<(i64, u8)>, Fault> {
        let head = self.left.u8()?;
        let id = match (head & 0xf, head >> 4) {
            (0, _) => return Ok(None),
            (_, 0) => self.integer()?,
            (_, step) => id.wrapping_add(i64::from(step)),
        };
        Ok(Some((id, head & 0xf)))
    }

    /// The fields up to the end of the record; the third, as in [`Passed`].
    fn record(&mut self, depth: usize) -> Result<Option<i64>, Fault> {
        let (mut id, mut third) = (0_i64, None);
        self.needs += RECORD;
        while let Some((next, kind)) = self.field(id)? {
            id = next;
            if (id, kind) == (3, 5) {
                third = Some(self.integer()?);
            } else {
                self.value(kind, depth)?;
            }
        }
        Ok(third)
    }

    /// Kind and number of the elements of a list.
    fn list(&mut self) -> Result<(u8, u64), Fault> {
        let head = self.left.u8()?;
        Ok((head & 0xf, if head >> 4 == 15 { self.varint()? } else { u64::from(head >> 4) }))
    }

    fn text(&mut self) -> Result<u64, Fault> {
        let length = self.varint()?;
        self.left.take(usize::try_from(length).map_err(|_| Fault::Short)?)?;
        self.needs = self.needs.saturating_add(length);
        Ok(length)
    }

    /// The table of contents: a record whose second field is the tree of columns.
    fn contents(&mut self) -> Result<(), Fault> {
        let mut id = 0;
        while let Some((next, kind)) = self.field(id)? {
            id = next;
            match (id, kind) {
                (2, 9) => self.columns()?,
                _ => self.value(kind, DEEPEST)?,
            }
        }
        Ok(())
    }

    /// The tree of columns, as a list in which a node stands before its children: the fourth field of a node is its
    /// name, the fifth the number of its children.
    fn columns(&mut self) -> Result<(), Fault> {
        let (kind, mut left) = self.list()?;
        // children that are still to come, and bytes of the path, from the root down
        let mut above: Vec<(u64, u64)> = Vec::new();
        while left > 0 {
            left -= 1;
            if kind != 12 {
                self.value(kind, DEEPEST)?;
                continue;
            }
            let (mut id, mut name, mut children) = (0, 0, 0);
            while let Some((next, kind)) = self.field(id)? {
                id = next;
                match (id, kind) {
                    (4, 8) => name = self.text()?,
                    (5, 5) => children = u64::try_from(self.integer()?).unwrap_or(0),
                    _ => self.value(kind, DEEPEST)?,
                }
            }
            // the crate would say so as well, but makes room first
            if children > left {
                return Err(Fault::Refused(Refusal::Endless));
            }
            let path = above.last().map_or(0, |(_, path)| path + 1) + name;
            if path > LONGEST_NAME as u64 {
                return Err(Excess::Name(path as usize).into());
            }
            if above.len() >= DEEPEST {
                return Err(Excess::Depth.into());
            }
            // each part of the path is a text of its own
            self.needs += 2 * RECORD + 2 * path + 64 * above.len() as u64;
            if let Some((coming, _)) = above.last_mut() {
                *coming = coming.saturating_sub(1);
            }
            above.push((children, path));
            while above.last().is_some_and(|(coming, _)| *coming == 0) {
                above.pop();
            }
        }
        Ok(())
    }

    fn value(&mut self, kind: u8, depth: usize) -> Result<(), Fault> {
        let depth = depth.checked_sub(1).ok_or(Excess::Depth)?;
        match kind {
            1 | 2 => {}
            3 => drop(self.left.take(1)?),
            4..=6 => drop(self.varint()?),
            7 => drop(self.left.take(8)?),
            8 => drop(self.text()?),
            9 | 10 => {
                let (kind, count) = self.list()?;
                self.elements(&[kind], count, depth)?;
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

    fn elements(&mut self, kinds: &[u8], count: u64, depth: usize) -> Result<(), Fault> {
        if kinds.iter().all(|kind| matches!(kind, 1 | 2)) {
            self.free = self.free.checked_sub(count).ok_or(Fault::Refused(Refusal::Endless))?;
            self.needs = self.needs.saturating_add(count);
            return Ok(());
        }
        // each takes a byte at least
        for _ in 0..count {
            self.needs += ELEMENT;
            kinds.iter().try_for_each(|kind| self.value(*kind, depth))?;
        }
        Ok(())
    }
}

/// The record at the beginning of these bytes; `None` if it is no whole record.
fn pass(bytes: &[u8]) -> Result<Option<Passed>, Refusal> {
    let mut walk = Walk::new(bytes);
    match walk.record(DEEPEST) {
        Ok(third) => Ok(Some(Passed { bytes: (bytes.len() - walk.left.0.len()) as u64, third })),
        Err(Fault::Short) => Ok(None),
        Err(Fault::Refused(why)) => Err(why),
    }
}

/// Up to so many bytes from there.
fn read(mut file: &File, at: u64, most: u64) -> Option<Vec<u8>> {
    file.seek(SeekFrom::Start(at)).ok()?;
    let mut bytes = Vec::new();
    file.take(most).read_to_end(&mut bytes).ok()?;
    Some(bytes)
}

/// The table of contents at the end of the file, whose length stands before the signature: what the crate will need
/// for it is held.
pub(super) fn contents(file: &File, account: &Account) -> Result<(), Refusal> {
    let length = file.metadata().map_or(0, |file| file.len());
    let declared = length.checked_sub(8).and_then(|at| read(file, at, 4));
    let declared = declared.and_then(|bytes| Bytes(&bytes).u32().ok()).map_or(0, u64::from);
    match length.checked_sub(8 + declared).and_then(|at| read(file, at, declared)) {
        Some(contents) => {
            let mut walk = Walk::new(&contents);
            match walk.contents() {
                Err(Fault::Refused(why)) => Err(why),
                // of one that ends too early the crate reads a part
                Ok(()) | Err(Fault::Short) => Ok(account.hold(walk.needs)?),
            }
        }
        None => Ok(()),
    }
}

/// The headers of the pages between these places.
pub(super) fn headers_end(file: &File, mut at: u64, end: u64, account: &Account) -> Result<(), Refusal> {
    while at < end {
        account.work(JUMP)?;
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
        // fields 1: i32, 2: text, 3: i32 -3, 4: list of two i64, 5: map of a byte to a truth value, 6: record with a
        // double, 7: true
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
        assert_eq!(pass(&list), Err(Refusal::Endless));
        assert_eq!(pass(&[&[0x19, 0x19, 0xf1], &many[..], &[0]].concat()), Err(Refusal::Endless));
        assert_eq!(pass(&[&[0x1b], &many[..], &[0x21, 0]].concat()), Err(Refusal::Endless));
        assert_eq!(pass(&[0x19, 0x42, 0]), Err(Refusal::Endless));
        assert_eq!(pass(&[0x19, 0x32, 0]), Ok(Some(Passed { bytes: 3, third: None })));
        // a number of a field as large as there is, and a number of many bytes
        let largest = [&[0x05, 0xfe], &[0xff; 8][..], &[0x01, 0, 0x15, 0, 0]].concat();
        assert!(matches!(pass(&largest), Ok(Some(_))));
        assert!(matches!(pass(&[&[0x15], &[0x80; 100][..], &[0, 0]].concat()), Ok(Some(Passed { bytes: 103, .. }))));
        // records in records
        assert_eq!(pass(&[0x1c; 1000]), Err(Refusal::Excess(Excess::Depth)));
    }
}
