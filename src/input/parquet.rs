//! Parquet: flat columns of numbers, row group by row group.
//!
//! Format: Apache Parquet, parquet-format 2.x. The crate `parquet` reads metadata, pages and encodings; compressed
//! pages are unpacked by `pages`. Text, lists and maps are passed over; the fields of a structure are the columns
//! `imu.gyro_x`.

mod guard;
mod pages;
mod thrift;

use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use parquet::basic::{ConvertedType, LogicalType, TimeUnit, Type};
use parquet::column::reader::{ColumnReader, ColumnReaderImpl, get_column_reader};
use parquet::data_type::{DataType, FixedLenByteArray, Int96};
use parquet::errors::ParquetError;
use parquet::file::metadata::{ParquetMetaData, ParquetMetaDataReader};
use parquet::schema::types::ColumnDescriptor;

use self::guard::guarded;
use self::pages::{Disk, Pages};
use self::thrift::Refusal;
use super::account::{Account, STEP};
use super::bytes::printable;
use super::names::Head;
use super::number::{Kind, Number, Split, since};
use super::{BLOCK, InputError, Rows, Table};

pub(super) const SIGNATURE: &[u8] = b"PAR1";
/// Of a file whose metadata are encrypted.
pub(super) const ENCRYPTED: &[u8] = b"PARE";

pub(super) struct ParquetTable {
    path: PathBuf,
    account: Account,
    file: Arc<Disk>,
    metadata: ParquetMetaData,
    columns: Vec<Column>,
    time: Option<usize>,
    /// The axes and what is beside them.
    axes: Vec<usize>,
    /// First stamp.
    origin: Option<Split>,
    /// The row group that is read next.
    group: usize,
    open: Option<Group>,
    /// Rows handed out.
    at: u64,
}

/// A column of numbers.
struct Column {
    head: Head,
    /// Among all columns of the file.
    leaf: usize,
    number: Stored,
}

/// What the integers of a column mean.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Stored {
    Plain,
    Unsigned,
    /// With so many digits behind the point.
    Decimal(i32),
    /// Two bytes.
    Half,
}

/// A row group that is being read: the time, if it is asked for, then the axes.
struct Group {
    readers: Vec<ColumnReader>,
    left: u64,
}

impl ParquetTable {
    pub(super) fn open(path: &Path, account: &Account) -> Result<ParquetTable, InputError> {
        let fail = |what: String| Err(InputError::new(format!("{}: {what}", path.display())));
        let file = match File::open(path) {
            Ok(file) => file,
            Err(error) => return fail(format!("cannot read: {error}")),
        };
        let contents = "truncated or damaged: its table of contents cannot be read";
        match thrift::contents(&file, account) {
            Ok(()) => {}
            Err(Refusal::Endless) => return fail(format!("{contents} (a list declares more than there is)")),
            Err(Refusal::Excess(excess)) => return fail(excess.to_string()),
        }
        let metadata = match guarded(|| ParquetMetaDataReader::new().parse_and_finish(&file)) {
            Some(Ok(metadata)) => metadata,
            Some(Err(error)) => return fail(format!("{contents} ({})", plain(&error))),
            None => return fail(contents.into()),
        };
        let leaves = metadata.file_metadata().schema_descr().columns();
        let columns: Vec<Column> = leaves.iter().enumerate().filter_map(|(leaf, found)| column(leaf, found)).collect();
        if columns.is_empty() {
            let all: Vec<String> = leaves
                .iter()
                .take(40)
                .map(|found| format!("{} ({})", printable(found.path().string().as_bytes()), found.physical_type()))
                .collect();
            return fail(format!("a Parquet file without a column of numbers; there are {}", all.join(", ")));
        }
        Ok(ParquetTable {
            path: path.to_path_buf(),
            account: account.clone(),
            file: Arc::new(Disk(file)),
            metadata,
            columns,
            time: None,
            axes: Vec::new(),
            origin: None,
            group: 0,
            open: None,
            at: 0,
        })
    }

    fn fail<T>(&self, what: &str) -> Result<T, InputError> {
        Err(InputError::new(format!("{}: row group {}: {what}", self.path.display(), self.group)))
    }

    /// Opens the next row group with rows; false at the end.
    fn next_group(&mut self) -> Result<bool, InputError> {
        while self.open.as_ref().is_none_or(|group| group.left == 0) {
            if self.group == self.metadata.num_row_groups() {
                return Ok(false);
            }
            let group = self.metadata.row_group(self.group);
            self.group += 1;
            let rows = group.num_rows().max(0) as u64;
            let wanted = self.time.iter().chain(&self.axes).map(|&column| self.columns[column].leaf);
            let readers = wanted.map(|leaf| {
                let pages = Pages::open(&self.file, group.column(leaf), rows as usize, &self.account)?;
                Ok(get_column_reader(group.column(leaf).column_descr_ptr(), Box::new(pages)))
            });
            match readers.collect::<Result<Vec<_>, ParquetError>>() {
                Ok(readers) => self.open = Some(Group { readers, left: rows }),
                Err(error) => return self.fail(&plain(&error)),
            }
        }
        Ok(true)
    }
}

impl Table for ParquetTable {
    fn heads(&self) -> Vec<&Head> {
        self.columns.iter().map(|column| &column.head).collect()
    }
    fn named(&self) -> bool {
        true
    }
    fn place(&self) -> String {
        self.path.display().to_string()
    }
    fn row_place(&self, row: u64) -> String {
        format!("{}: row {row}", self.path.display())
    }
    /// What is declared is not yet there.
    fn rows(&self) -> Option<u64> {
        None
    }
    fn select(&mut self, time: Option<usize>, axes: &[usize], beside: Option<usize>) {
        self.time = time;
        self.axes = axes.iter().copied().chain(beside).collect();
    }
    fn rewind(&mut self) -> Result<(), InputError> {
        self.account.renew();
        (self.group, self.open, self.at) = (0, None, 0);
        Ok(())
    }
    fn origin(&self) -> f64 {
        self.origin.map_or(0.0, |(whole, part)| whole as f64 + part)
    }
    fn next_rows(&mut self, rows: &mut Rows) -> Result<bool, InputError> {
        rows.clear(self.axes.len());
        if !self.next_group()? {
            return Ok(false);
        }
        let Some(mut group) = self.open.take() else { return Ok(false) };
        let count = group.left.min(BLOCK as u64) as usize;
        if let Err(excess) = self.account.work((count * group.readers.len()) as u64 * STEP / 8) {
            return self.fail(&excess.to_string());
        }
        let mut numbers = Vec::with_capacity(count);
        for (i, reader) in group.readers.iter_mut().enumerate() {
            let column = self.time.iter().chain(&self.axes).nth(i).map(|&column| &self.columns[column]);
            let Some(Column { leaf, number, .. }) = column else { continue };
            let descriptor = self.metadata.file_metadata().schema_descr().column(*leaf);
            numbers.clear();
            let levels = descriptor.max_def_level();
            // pages that are damaged can make the crate panic
            match guarded(|| read(reader, *number, levels, count, &mut numbers)) {
                Some(Ok(())) => {}
                Some(Err(error)) => return self.fail(&format!("{}: {}", name(&descriptor), plain(&error))),
                None => return self.fail(&format!("{}: a damaged page", name(&descriptor))),
            }
            if numbers.len() != count {
                return self.fail(&format!("{} has fewer rows than it declares", name(&descriptor)));
            }
            match (self.time, i) {
                (Some(_), 0) => rows.time.extend(numbers.iter().map(|stamp| since(&mut self.origin, *stamp))),
                (time, i) => {
                    let values = numbers.iter().map(|(whole, part)| *whole as f64 + part);
                    rows.values[i - usize::from(time.is_some())]
                        .extend(values.map(|x| if x.is_finite() { x } else { f64::NAN }));
                }
            }
        }
        rows.lines.extend(self.at + 1..=self.at + count as u64);
        self.at += count as u64;
        group.left -= count as u64;
        self.open = Some(group);
        Ok(true)
    }
}

fn name(column: &ColumnDescriptor) -> String {
    format!("column '{}'", printable(column.path().string().as_bytes()))
}

/// A column that is read, or none of text, lists and the like.
fn column(leaf: usize, found: &ColumnDescriptor) -> Option<Column> {
    if found.max_rep_level() > 0 {
        return None;
    }
    let (logical, converted) = (found.logical_type_ref(), found.converted_type());
    let mut time = match (logical, converted) {
        (Some(LogicalType::Timestamp(stamp)), _) => Some(match stamp.unit {
            TimeUnit::MILLIS => "ms",
            TimeUnit::MICROS => "us",
            TimeUnit::NANOS => "ns",
        }),
        (_, ConvertedType::TIMESTAMP_MILLIS) => Some("ms"),
        (_, ConvertedType::TIMESTAMP_MICROS) => Some("us"),
        _ => None,
    };
    let unsigned = |kind| {
        use ConvertedType::{UINT_8, UINT_16, UINT_32, UINT_64};
        matches!(logical, Some(LogicalType::Integer(kind)) if !kind.is_signed)
            || [UINT_8, UINT_16, UINT_32, UINT_64].contains(&kind)
    };
    let number = match found.physical_type() {
        Type::INT32 | Type::INT64
            if converted == ConvertedType::DECIMAL || matches!(logical, Some(LogicalType::Decimal(_))) =>
        {
            Stored::Decimal(found.type_scale().clamp(0, 38))
        }
        Type::INT32 | Type::INT64 if unsigned(converted) => Stored::Unsigned,
        Type::FIXED_LEN_BYTE_ARRAY if matches!(logical, Some(LogicalType::Float16)) && found.type_length() == 2 => {
            Stored::Half
        }
        Type::INT96 => {
            time = Some("ns");
            Stored::Plain
        }
        Type::BOOLEAN | Type::INT32 | Type::INT64 | Type::FLOAT | Type::DOUBLE => Stored::Plain,
        Type::BYTE_ARRAY | Type::FIXED_LEN_BYTE_ARRAY => return None,
    };
    let mut head = Head::parse(&printable(found.path().string().as_bytes()));
    if let Some(unit) = time {
        head.set_unit_below(unit);
        // a table of stamps whose index has no name
        if head.full == "__index_level_0__" {
            head.name = "time".into();
        }
    }
    Some(Column { head, leaf, number })
}

/// The next rows of a column, at most `count`; a null is NaN. `present`: the level of a number that is there.
fn read(
    reader: &mut ColumnReader,
    stored: Stored,
    present: i16,
    count: usize,
    out: &mut Vec<Split>,
) -> Result<(), ParquetError> {
    let decimal = |whole: i64| match stored {
        Stored::Decimal(digits) => (0, whole as f64 / 10f64.powi(digits)),
        _ => (i128::from(whole), 0.0),
    };
    let half = Number { kind: Kind::Float(2), big_endian: false };
    match reader {
        ColumnReader::BoolColumnReader(column) => values(column, present, count, out, |x: &bool| (i128::from(*x), 0.0)),
        ColumnReader::Int32ColumnReader(column) => values(column, present, count, out, |x: &i32| match stored {
            Stored::Unsigned => (i128::from(*x as u32), 0.0),
            _ => decimal(i64::from(*x)),
        }),
        ColumnReader::Int64ColumnReader(column) => values(column, present, count, out, |x: &i64| match stored {
            Stored::Unsigned => (i128::from(*x as u64), 0.0),
            _ => decimal(*x),
        }),
        ColumnReader::Int96ColumnReader(column) => values(column, present, count, out, julian),
        ColumnReader::FloatColumnReader(column) => values(column, present, count, out, |x: &f32| (0, f64::from(*x))),
        ColumnReader::DoubleColumnReader(column) => values(column, present, count, out, |x: &f64| (0, *x)),
        ColumnReader::FixedLenByteArrayColumnReader(column) => {
            values(column, present, count, out, |x: &FixedLenByteArray| half.decode(x.data()))
        }
        ColumnReader::ByteArrayColumnReader(_) => Ok(()),
    }
}

fn values<T: DataType>(
    column: &mut ColumnReaderImpl<T>,
    present: i16,
    count: usize,
    out: &mut Vec<Split>,
    split: impl Fn(&T::T) -> Split,
) -> Result<(), ParquetError> {
    let (mut levels, mut values) = (Vec::new(), Vec::new());
    column.read_records(count, (present > 0).then_some(&mut levels), None, &mut values)?;
    let mut values = values.iter().map(split);
    match present {
        0 => out.extend(values),
        _ => out.extend(
            levels.iter().map(|level| (*level == present).then(|| values.next()).flatten().unwrap_or((0, f64::NAN))),
        ),
    }
    Ok(())
}

/// Nanoseconds since 1970 of a stamp of the oldest kind: nanoseconds of the day, and the Julian day.
fn julian(stamp: &Int96) -> Split {
    const DAY_NS: i128 = 86_400_000_000_000;
    const DAY_OF_1970: i128 = 2_440_588;
    let [low, high, day] = stamp.data() else { return (0, f64::NAN) };
    let of_day = i128::from(*high) << 32 | i128::from(*low);
    ((i128::from(*day) - DAY_OF_1970) * DAY_NS + of_day, 0.0)
}

/// An error of the crate, on one line and without its kind.
fn plain(error: &ParquetError) -> String {
    let text = match error {
        ParquetError::General(text) | ParquetError::NYI(text) | ParquetError::EOF(text) => text.clone(),
        other => other.to_string(),
    };
    printable(text.split_whitespace().collect::<Vec<_>>().join(" ").as_bytes())
}
