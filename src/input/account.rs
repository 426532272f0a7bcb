//! What reading a file may cost: one account of bytes and of work, sized by the file, that every reader draws on.
//! Whatever a file declares, leads to or unpacks to, the account is asked before room is made for it, and its
//! refusal is the end of the reading.

use std::io::{self, Read};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use super::bytes::Short;

/// Bytes of a name, or of a path of names: thrice what MATLAB, HDF5's tools, ULog and ROS allow, and no name then
/// makes a line that nobody reads.
pub(super) const LONGEST_NAME: usize = 1024;
/// Levels of structures, groups, types and lists: twice what any log is known to have, and far from the end of a stack.
pub(super) const DEEPEST: usize = 32;

/// Memory beside the numbers that are kept: so many times the file, and so much beside it. With what the process
/// itself needs, stacks and buffers, this stays below the 16 MiB that docs/formats.md promises.
const TIMES: u64 = 4;
const ROOM: u64 = 12 << 20;
/// Work of a pass, in units of about a nanosecond (a byte that is unpacked): a message of one byte counts [`STEP`],
/// so that no file that is read from the beginning to its end without being unpacked comes to the limit; the rest is
/// a second.
const EACH: u64 = 64;
const SPARE: u64 = 1 << 30;
/// A record, a field, an element: what is looked at, whatever its length.
pub(super) const STEP: u64 = 64;
/// Going to a place of the file.
pub(super) const JUMP: u64 = 1024;
/// Of a name that is no column's: in the list that is kept, in a note, and in what is printed.
const NAMED: u64 = 3;
/// What has a name, without it, in the copies that a command makes of it: in a list of columns or of topics, as a row
/// of what `info` prints. Measured: of a text without names 15,500 columns stay within the promise, 16,000 do not.
const ENTRY: u64 = 704;
/// Of its name: as header, column, and in the list that `info` prints.
const COPIES: u64 = 10;

/// What a file asks for beyond its account.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub(super) enum Excess {
    #[error(
        "it declares what takes more memory than four times the file and 16 MiB; a log so compressed must be written \
         in smaller blocks"
    )]
    Memory,
    #[error("it unpacks to, or leads back and forth through, more than 1 GiB and 64 times the file")]
    Work,
    #[error("a name of {0} bytes; at most {LONGEST_NAME} are read")]
    Name(usize),
    #[error("nested deeper than {DEEPEST} levels")]
    Depth,
}

impl From<Excess> for String {
    fn from(excess: Excess) -> String {
        excess.to_string()
    }
}

impl From<Excess> for io::Error {
    fn from(excess: Excess) -> io::Error {
        io::Error::other(excess)
    }
}

/// Why a part of a file is not read: it is damaged, and what follows may be read; or it is the end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Fault {
    Short,
    Excess(Excess),
}

impl From<Short> for Fault {
    fn from(_: Short) -> Fault {
        Fault::Short
    }
}

impl From<Excess> for Fault {
    fn from(excess: Excess) -> Fault {
        Fault::Excess(excess)
    }
}

/// The account of one open file; clones draw on the same.
#[derive(Clone, Debug)]
pub(super) struct Account(Arc<Ledger>);

#[derive(Debug)]
struct Ledger {
    file: u64,
    /// Bytes held until the file is closed.
    held: AtomicU64,
    /// Units of this pass.
    work: AtomicU64,
}

impl Account {
    /// Of a file of so many bytes.
    pub(super) fn new(file: u64) -> Account {
        Account(Arc::new(Ledger { file, held: AtomicU64::new(0), work: AtomicU64::new(0) }))
    }

    /// A further pass.
    pub(super) fn renew(&self) {
        self.0.work.store(0, Ordering::Relaxed);
    }

    /// Bytes that are kept while the file is open.
    pub(super) fn hold(&self, bytes: u64) -> Result<(), Excess> {
        self.room(bytes)?;
        self.0.held.fetch_add(bytes, Ordering::Relaxed);
        Ok(())
    }

    /// Bytes that are kept until they are given back.
    pub(super) fn lend(&self, bytes: u64) -> Result<Loan, Excess> {
        self.hold(bytes)?;
        Ok(Loan { account: self.clone(), bytes })
    }

    /// Bytes that are needed at a time, beside those that are held.
    pub(super) fn room(&self, bytes: u64) -> Result<(), Excess> {
        if bytes <= self.left() { Ok(()) } else { Err(Excess::Memory) }
    }

    pub(super) fn left(&self) -> u64 {
        let most = self.0.file.saturating_mul(TIMES).saturating_add(ROOM);
        most.saturating_sub(self.0.held.load(Ordering::Relaxed))
    }

    pub(super) fn work(&self, units: u64) -> Result<(), Excess> {
        let most = self.0.file.saturating_mul(EACH).saturating_add(SPARE);
        match self.0.work.fetch_add(units.min(most), Ordering::Relaxed).checked_add(units) {
            Some(all) if all <= most => Ok(()),
            _ => Err(Excess::Work),
        }
    }

    /// A name that is kept.
    pub(super) fn name(&self, bytes: usize) -> Result<(), Excess> {
        if bytes > LONGEST_NAME {
            return Err(Excess::Name(bytes));
        }
        self.hold(ENTRY + NAMED * bytes as u64)
    }

    /// Columns with names of so many bytes each, or fewer.
    pub(super) fn columns(&self, count: u64, name: usize) -> Result<(), Excess> {
        if name > LONGEST_NAME {
            return Err(Excess::Name(name));
        }
        self.hold(count.saturating_mul(ENTRY + COPIES * name as u64))
    }
}

/// Bytes that are given back when this is dropped.
#[derive(Debug)]
pub(super) struct Loan {
    account: Account,
    bytes: u64,
}

impl Drop for Loan {
    fn drop(&mut self) {
        self.account.0.held.fetch_sub(self.bytes, Ordering::Relaxed);
    }
}

/// The level below this one.
pub(super) fn deeper(depth: usize) -> Result<usize, Excess> {
    if depth < DEEPEST { Ok(depth + 1) } else { Err(Excess::Depth) }
}

/// Bytes as they are unpacked, each a unit of work.
#[derive(Debug)]
pub(super) struct Metered<R> {
    pub(super) inner: R,
    pub(super) account: Account,
}

impl<R: Read> Read for Metered<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.inner.read(buffer)?;
        self.account.work(count as u64)?;
        Ok(count)
    }
}
