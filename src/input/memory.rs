//! Samples in memory, lent by who waits for the work ([`crate::numerics::progress`]), as a table like that of a file.
//!
//! A request names its logs by paths. A log in memory has a name in the place of one, and everything behind the door
//! of this room (columns, units, rate, check, blocks) is the same for both: nothing else of the house knows of it.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use sha2::{Digest, Sha256};

use super::names::Head;
use super::number::since;
use super::{BLOCK, InputError, Rows, Table};
use crate::numerics::progress::{Samples, checkpoint};

/// Rows that are asked for at a time, since each question may be a message to another thread.
const AHEAD: u64 = 16 * BLOCK as u64;

pub(super) struct MemoryTable {
    name: PathBuf,
    samples: Arc<dyn Samples>,
    heads: Vec<Head>,
    named: bool,
    next: u64,
    time: Option<usize>,
    /// The axes and what is beside them.
    axes: Vec<usize>,
    /// First stamp, whole and fraction.
    origin: Option<(i128, f64)>,
    /// Of time and axes, the rows from `first` on.
    ahead: Vec<Vec<f64>>,
    first: u64,
}

impl MemoryTable {
    pub(super) fn new(name: &Path, samples: Arc<dyn Samples>) -> MemoryTable {
        let names = samples.names();
        let named = !names.is_empty();
        let heads = match named {
            true => names.iter().map(|name| Head::parse(name)).collect(),
            false => (1..=samples.columns()).map(Head::numbered).collect(),
        };
        MemoryTable {
            name: name.to_path_buf(),
            samples,
            heads,
            named,
            next: 0,
            time: None,
            axes: Vec::new(),
            origin: None,
            ahead: Vec::new(),
            first: 0,
        }
    }

    fn fetch(&mut self) -> Result<(), InputError> {
        let rows = self.next..self.samples.rows().min(self.next + AHEAD);
        self.first = self.next;
        self.ahead.resize_with(self.axes.len() + usize::from(self.time.is_some()), Vec::new);
        for (column, into) in self.time.iter().chain(&self.axes).zip(&mut self.ahead) {
            into.clear();
            self.samples.read(*column, rows.clone(), into);
            if into.len() as u64 != rows.end - rows.start {
                return Err(InputError::new(format!("{}: its samples are gone", self.name.display())));
            }
        }
        Ok(())
    }
}

impl Table for MemoryTable {
    fn heads(&self) -> Vec<&Head> {
        self.heads.iter().collect()
    }
    fn named(&self) -> bool {
        self.named
    }
    fn place(&self) -> String {
        self.name.display().to_string()
    }
    fn row_place(&self, row: u64) -> String {
        format!("{}: row {row}", self.name.display())
    }
    fn rows(&self) -> Option<u64> {
        Some(self.samples.rows())
    }
    fn select(&mut self, time: Option<usize>, axes: &[usize], beside: Option<usize>) {
        self.time = time;
        self.axes = axes.iter().copied().chain(beside).collect();
        self.ahead.clear();
    }
    fn rewind(&mut self) -> Result<(), InputError> {
        self.next = 0;
        self.ahead.clear();
        Ok(())
    }
    fn origin(&self) -> f64 {
        self.origin.map_or(0.0, |(whole, fraction)| whole as f64 + fraction)
    }
    fn next_rows(&mut self, rows: &mut Rows) -> Result<bool, InputError> {
        rows.clear(self.axes.len());
        let count = (self.samples.rows() - self.next).min(BLOCK as u64);
        if count == 0 {
            return Ok(false);
        }
        if self.ahead.is_empty() || self.next >= self.first + AHEAD {
            self.fetch()?;
        }
        // AHEAD is a multiple of BLOCK, so a block lies within what was fetched
        let from = (self.next - self.first) as usize;
        let here = from..from + count as usize;
        let mut columns = self.ahead.iter();
        if let Some(stamps) = columns.next().filter(|_| self.time.is_some()) {
            let mut origin = self.origin;
            let stamp = |t: &f64| since(&mut origin, (t.trunc() as i128, t - t.trunc()));
            rows.time.extend(stamps[here.clone()].iter().map(stamp));
            self.origin = origin;
        }
        for (values, ahead) in rows.values.iter_mut().zip(&self.ahead[usize::from(self.time.is_some())..]) {
            values.extend(ahead[here.clone()].iter().map(|x| if x.is_finite() { *x } else { f64::NAN }));
        }
        rows.lines.extend(self.next + 1..=self.next + count);
        self.next += count;
        Ok(true)
    }
}

/// Hex SHA-256 of the numbers, column by column, as little-endian doubles.
pub(super) fn sha256(samples: &dyn Samples) -> String {
    let (mut hash, mut block) = (Sha256::new(), Vec::new());
    for column in 0..samples.columns() {
        for start in (0..samples.rows()).step_by(AHEAD as usize) {
            checkpoint();
            block.clear();
            samples.read(column, start..samples.rows().min(start + AHEAD), &mut block);
            block.iter().for_each(|x| hash.update(x.to_le_bytes()));
        }
    }
    super::hex(&hash.finalize())
}
