//! NumPy .npy arrays: one- or two-dimensional numbers in either memory order, or one-dimensional structured arrays.
//!
//! Format: NumPy enhancement proposal 1, versions 1.0 to 3.0. The length of the file is compared with the declared
//! shape before anything is read; memory is one block. Python objects are refused: reading them would mean running a
//! pickle.

mod header;

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use self::header::Header;
use super::account::{Account, JUMP};
use super::names::Head;
use super::number::{Number, since};
use super::{BLOCK, InputError, Rows, Table};

/// More columns are a transposed array.
const MOST_COLUMNS: u64 = 4096;

/// Bytes read at a time.
const LARGEST_READ: u64 = 1 << 22;

/// One column of numbers in the file.
#[derive(Clone, Debug)]
struct Column {
    head: Head,
    number: Number,
    /// First byte of the column's first value, and bytes from one value to the next.
    start: u64,
    stride: u64,
}

pub(super) struct NpyTable {
    path: PathBuf,
    account: Account,
    file: File,
    columns: Vec<Column>,
    named: bool,
    rows: u64,
    next: u64,
    time: Option<usize>,
    /// The axes and what is beside them.
    axes: Vec<usize>,
    /// First stamp, whole and fraction.
    origin: Option<(i128, f64)>,
    buffer: Vec<u8>,
}

fn fail<T>(path: &Path, what: impl std::fmt::Display) -> Result<T, InputError> {
    Err(InputError::new(format!("{}: {what}", path.display())))
}

impl NpyTable {
    pub(super) fn open(path: &Path, account: &Account) -> Result<NpyTable, InputError> {
        let io = |error: std::io::Error| InputError::new(format!("{}: cannot read: {error}", path.display()));
        let mut file = File::open(path).map_err(io)?;
        let length = file.metadata().map_err(io)?.len();
        if length == 0 {
            return fail(path, "the file is empty");
        }
        let header = match Header::read(&mut file, length, account) {
            Ok(header) => header,
            Err(why) => return fail(path, why),
        };
        let (columns, rows) = match layout(&header, length, account) {
            Ok(found) => found,
            Err(why) => return fail(path, why),
        };
        Ok(NpyTable {
            path: path.to_path_buf(),
            account: account.clone(),
            file,
            columns,
            named: header.named,
            rows,
            next: 0,
            time: None,
            axes: Vec::new(),
            origin: None,
            buffer: Vec::new(),
        })
    }

    /// Reads `rows` values of a column, from row `next` on.
    fn fetch(&mut self, column: usize, rows: usize) -> Result<(), InputError> {
        let Column { start, stride, number, .. } = self.columns[column];
        // the bytes between the first and the last value; other columns lie between them in C order
        let bytes = stride as usize * (rows - 1) + number.size();
        self.buffer.resize(bytes, 0);
        let from = SeekFrom::Start(start + self.next * stride);
        match self.file.seek(from).and_then(|_| self.file.read_exact(&mut self.buffer)) {
            Ok(()) => Ok(()),
            Err(error) => fail(&self.path, format!("cannot read on at row {}: {error}", self.next + 1)),
        }
    }

    fn values(&self, column: usize) -> impl Iterator<Item = (i128, f64)> + '_ {
        let Column { stride, number, .. } = self.columns[column];
        self.buffer.chunks(stride as usize).map(move |bytes| number.decode(bytes))
    }
}

impl Table for NpyTable {
    fn heads(&self) -> Vec<&Head> {
        self.columns.iter().map(|c| &c.head).collect()
    }
    fn named(&self) -> bool {
        self.named
    }
    fn place(&self) -> String {
        self.path.display().to_string()
    }
    fn row_place(&self, row: u64) -> String {
        format!("{}: row {row}", self.path.display())
    }
    fn rows(&self) -> Option<u64> {
        Some(self.rows)
    }
    fn select(&mut self, time: Option<usize>, axes: &[usize], beside: Option<usize>) {
        self.time = time;
        self.axes = axes.iter().copied().chain(beside).collect();
    }
    fn rewind(&mut self) -> Result<(), InputError> {
        self.account.renew();
        self.next = 0;
        Ok(())
    }
    fn origin(&self) -> f64 {
        self.origin.map_or(0.0, |(whole, fraction)| whole as f64 + fraction)
    }
    fn next_rows(&mut self, rows: &mut Rows) -> Result<bool, InputError> {
        rows.clear(self.axes.len());
        let widest = self.time.iter().chain(&self.axes).map(|&c| self.columns[c].stride).max().unwrap_or(1);
        let count = (self.rows - self.next).min(BLOCK as u64).min((LARGEST_READ / widest).max(1));
        if count == 0 {
            return Ok(false);
        }
        // all columns of a row lie between two values of one
        let passes = (self.axes.len() + usize::from(self.time.is_some())) as u64;
        let work = passes.saturating_mul(JUMP + count.saturating_mul(widest));
        self.account.work(work).or_else(|excess| fail(&self.path, excess))?;
        if let Some(column) = self.time {
            self.fetch(column, count as usize)?;
            let mut origin = self.origin;
            rows.time.extend(self.values(column).map(|stamp| since(&mut origin, stamp)));
            self.origin = origin;
        }
        for axis in 0..self.axes.len() {
            self.fetch(self.axes[axis], count as usize)?;
            let values = self.values(self.axes[axis]).map(|(whole, fraction)| whole as f64 + fraction);
            rows.values[axis].extend(values.map(|x| if x.is_finite() { x } else { f64::NAN }));
        }
        rows.lines.extend(self.next + 1..=self.next + count);
        self.next += count;
        Ok(true)
    }
}

/// Columns and number of rows, or why the array is none that is read.
fn layout(header: &Header, length: u64, account: &Account) -> Result<(Vec<Column>, u64), String> {
    let (rows, per_row) = match (header.shape[..].iter().as_slice(), header.named) {
        ([rows], _) => (*rows, 1),
        ([rows, columns], false) => (*rows, *columns),
        ([rows, 1], true) => (*rows, 1),
        (shape, true) => return Err(format!("a structured array of {} dimensions; one is read", shape.len())),
        (shape, false) => return Err(format!("an array of {} dimensions; one or two are read", shape.len())),
    };
    if per_row == 0 || header.fields.is_empty() {
        return Err("the array has no columns".into());
    }
    let declared = rows.checked_mul(per_row).and_then(|n| n.checked_mul(header.item_size));
    let there = length - header.data_start;
    match declared {
        Some(bytes) if bytes == there => {}
        Some(bytes) if bytes < there => {
            return Err(format!("{} bytes follow the array; save one array in one file", there - bytes));
        }
        _ => {
            let whole = there / per_row.saturating_mul(header.item_size).max(1);
            return Err(format!("truncated: {rows} rows are declared, but the file holds only {whole}"));
        }
    }
    if per_row > MOST_COLUMNS {
        return Err(format!("{rows} rows of {per_row} columns: samples belong in rows; save the transpose"));
    }
    if rows == 0 {
        return Err("the array has no rows".into());
    }
    account.columns(if header.named { 0 } else { per_row }, Head::numbered(per_row as usize).full.len())?;
    let mut columns = Vec::new();
    if header.named {
        for field in &header.fields {
            let mut head = Head::parse(&field.name);
            if let Some(unit) = field.time_unit {
                head.set_unit_below(unit);
            }
            let start = header.data_start + field.offset;
            columns.push(Column { head, number: field.number, start, stride: header.item_size });
        }
    } else {
        let (number, size) = (header.fields[0].number, header.item_size);
        for i in 0..per_row {
            let (offset, stride) =
                if header.fortran_order { (i * rows * size, size) } else { (i * size, per_row * size) };
            let head = Head::numbered(i as usize + 1);
            columns.push(Column { head, number, start: header.data_start + offset, stride });
        }
    }
    Ok((columns, rows))
}
