//! A table written block by block: csv, csv.gz or npy by the extension of the path.
//!
//! Numbers in text are the shortest that read back to the same `f64`; a missing value is `nan`.

use std::collections::BTreeSet;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use flate2::write::GzEncoder;

use super::atomic::{AtomicFile, WriteError, io_error};

/// Streaming writer; nothing appears at `path` before `finish`.
#[derive(Debug)]
pub struct TableWriter {
    path: PathBuf,
    columns: usize,
    sink: Sink,
}

#[derive(Debug)]
enum Sink {
    Csv(AtomicFile),
    Gzip(Box<BufWriter<GzEncoder<AtomicFile>>>),
    /// `shape_at`: where the number of rows stands in the header.
    Npy {
        file: AtomicFile,
        shape_at: u64,
        rows: u64,
    },
}

#[derive(Clone, Copy, PartialEq)]
enum Format {
    Csv,
    Gzip,
    Npy,
}

fn format_of(path: &Path) -> Result<Format, WriteError> {
    let name = path.file_name().map(|n| n.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
    if name.ends_with(".csv") {
        Ok(Format::Csv)
    } else if name.ends_with(".csv.gz") {
        Ok(Format::Gzip)
    } else if name.ends_with(".npy") {
        Ok(Format::Npy)
    } else {
        Err(WriteError::new(path, "the extension says the format: .csv, .csv.gz or .npy"))
    }
}

/// Refuses a path whose ending is none of the formats.
pub fn check_ending(path: &Path) -> Result<(), WriteError> {
    format_of(path).map(|_| ())
}

impl TableWriter {
    /// `header`: column names with units, e.g. `gyro_x (deg/s)`. For npy: a structured 1-D array of f8 fields with
    /// these names.
    pub fn create(path: &Path, header: &[String]) -> Result<TableWriter, WriteError> {
        let format = format_of(path)?;
        if header.is_empty() {
            return Err(WriteError::new(path, "a table without columns"));
        }
        if format == Format::Npy {
            let mut seen = BTreeSet::new();
            if let Some(name) = header.iter().find(|name| !seen.insert(name.as_str())) {
                return Err(WriteError::new(path, format!("two columns are named '{name}'; npy fields must differ")));
            }
        }
        let mut file = AtomicFile::create(path)?;
        let sink = match format {
            Format::Csv => write_names(&mut file, header).map(|()| Sink::Csv(file)),
            Format::Gzip => {
                let mut gzip = BufWriter::with_capacity(1 << 16, GzEncoder::new(file, flate2::Compression::default()));
                write_names(&mut gzip, header).map(|()| Sink::Gzip(Box::new(gzip)))
            }
            Format::Npy => {
                let (bytes, shape_at) = npy_header(header);
                file.write_all(&bytes).map(|()| Sink::Npy { file, shape_at, rows: 0 })
            }
        }
        .map_err(|e| io_error(path, &e))?;
        Ok(TableWriter { path: path.to_path_buf(), columns: header.len(), sink })
    }

    /// Column slices of equal length, as many as the header has names.
    pub fn write(&mut self, columns: &[&[f64]]) -> Result<(), WriteError> {
        let rows = columns.first().map_or(0, |c| c.len());
        if columns.len() != self.columns || columns.iter().any(|c| c.len() != rows) {
            let lengths: Vec<usize> = columns.iter().map(|c| c.len()).collect();
            let reason = format!("{} columns of equal length expected, lengths {lengths:?} given", self.columns);
            return Err(WriteError::new(&self.path, reason));
        }
        match &mut self.sink {
            Sink::Csv(file) => write_text(file, columns, rows),
            Sink::Gzip(file) => write_text(file.as_mut(), columns, rows),
            Sink::Npy { file, rows: total, .. } => {
                *total += rows as u64;
                write_binary(file, columns, rows)
            }
        }
        .map_err(|e| io_error(&self.path, &e))
    }

    pub fn finish(self) -> Result<(), WriteError> {
        let path = self.path;
        match self.sink {
            Sink::Csv(file) => file.commit(),
            Sink::Gzip(file) => {
                let gzip = file.into_inner().map_err(|e| io_error(&path, e.error()))?;
                gzip.finish().map_err(|e| io_error(&path, &e))?.commit()
            }
            Sink::Npy { mut file, shape_at, rows } => {
                file.patch(shape_at, rows.to_string().as_bytes()).map_err(|e| io_error(&path, &e))?;
                file.commit()
            }
        }
    }
}

fn write_names(out: &mut impl Write, header: &[String]) -> io::Result<()> {
    for (i, name) in header.iter().enumerate() {
        if i > 0 {
            out.write_all(b",")?;
        }
        // a spreadsheet would take it for a formula, and run it
        let name = if name.starts_with(['=', '+', '-', '@']) { &format!("'{name}") } else { name };
        if name.contains([',', '"', '\n', '\r', ';', '\t']) {
            write!(out, "\"{}\"", name.replace('"', "\"\""))?;
        } else {
            out.write_all(name.as_bytes())?;
        }
    }
    out.write_all(b"\n")
}

fn write_text(out: &mut impl Write, columns: &[&[f64]], rows: usize) -> io::Result<()> {
    for row in 0..rows {
        for (i, column) in columns.iter().enumerate() {
            if i > 0 {
                out.write_all(b",")?;
            }
            write_number(out, column[row])?;
        }
        out.write_all(b"\n")?;
    }
    Ok(())
}

/// Shortest decimal that reads back to the same value; with an exponent where plain digits would be long.
fn write_number(out: &mut impl Write, x: f64) -> io::Result<()> {
    if x.is_nan() {
        out.write_all(b"nan")
    } else if x == 0.0 || (1e-5..1e16).contains(&x.abs()) || x.is_infinite() {
        write!(out, "{x}")
    } else {
        write!(out, "{x:e}")
    }
}

fn write_binary(out: &mut impl Write, columns: &[&[f64]], rows: usize) -> io::Result<()> {
    for row in 0..rows {
        for column in columns {
            out.write_all(&column[row].to_le_bytes())?;
        }
    }
    Ok(())
}

/// The npy header with room for any number of rows, and the offset of that number.
/// Version 1.0, or 2.0 for a long header, or 3.0 for names outside Latin letters (NumPy NEP 1).
fn npy_header(names: &[String]) -> (Vec<u8>, u64) {
    let mut text = String::from("{'descr': [");
    for name in names {
        let name = name.replace('\\', "\\\\").replace('\'', "\\'").replace('\n', "\\n").replace('\r', "\\r");
        text.push_str(&format!("('{name}', '<f8'), "));
    }
    text.push_str("], 'fortran_order': False, 'shape': (");
    let shape_at = text.len();
    // digits of the largest u64; spaces before the comma are ignored by every reader
    text.push_str(&format!("{:<20},), }}", 0));
    let version: u8 = match (text.is_ascii(), text.len() < 65_000) {
        (false, _) => 3,
        (true, true) => 1,
        (true, false) => 2,
    };
    let prefix = if version == 1 { 10 } else { 12 };
    let unpadded = prefix + text.len() + 1;
    text.push_str(&" ".repeat(unpadded.next_multiple_of(64) - unpadded));
    text.push('\n');
    let mut bytes = b"\x93NUMPY".to_vec();
    bytes.extend([version, 0]);
    if version == 1 {
        bytes.extend((text.len() as u16).to_le_bytes());
    } else {
        bytes.extend((text.len() as u32).to_le_bytes());
    }
    bytes.extend(text.as_bytes());
    (bytes, (prefix + shape_at) as u64)
}

#[cfg(test)]
mod tests {
    use std::io::Read;

    use super::*;

    fn names(list: &[&str]) -> Vec<String> {
        list.iter().map(|s| (*s).to_string()).collect()
    }

    fn written(file: &str, header: &[String], blocks: &[&[&[f64]]]) -> Vec<u8> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(file);
        let mut table = TableWriter::create(&path, header).unwrap();
        for block in blocks {
            table.write(block).unwrap();
        }
        assert!(!path.exists());
        table.finish().unwrap();
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
        std::fs::read(path).unwrap()
    }

    const VALUES: [f64; 7] = [0.1, -2.0, 1e-300, 123_456_789.25, f64::MIN_POSITIVE, -0.0, 1.797e308];

    #[test]
    fn text_reads_back_to_the_same_bits() {
        let bytes =
            written("a.csv", &names(&["a (deg/s)", "b, \"c\""]), &[&[&VALUES, &VALUES], &[&[f64::NAN], &[1.0]]]);
        let text = String::from_utf8(bytes).unwrap();
        let mut lines = text.lines();
        assert_eq!(lines.next(), Some("a (deg/s),\"b, \"\"c\"\"\""));
        for (x, line) in VALUES.into_iter().zip(lines.by_ref()) {
            let (a, b) = line.split_once(',').unwrap();
            assert_eq!(a.parse::<f64>().unwrap().to_bits(), x.to_bits(), "{line}");
            assert_eq!(a, b);
            assert!(a.len() < 25, "{a}");
        }
        assert_eq!(lines.next(), Some("nan,1"));
        assert_eq!(lines.next(), None);
    }

    #[test]
    fn gzip_holds_the_same_text_and_the_same_bytes_each_time() {
        let header = names(&["x"]);
        let plain = written("a.csv", &header, &[&[&VALUES]]);
        let packed = written("a.csv.gz", &header, &[&[&VALUES]]);
        let mut unpacked = Vec::new();
        flate2::read::GzDecoder::new(&packed[..]).read_to_end(&mut unpacked).unwrap();
        assert_eq!(unpacked, plain);
        assert_eq!(packed, written("b.csv.gz", &header, &[&[&VALUES]]));
    }

    // numpy 2.x: numpy.lib.format.write_array of the same structured array puts the descr and shape as here;
    // numpy.load of the file read the names and values back.
    #[test]
    fn npy_is_a_structured_array_with_its_length_in_the_header() {
        let bytes = written("a.npy", &names(&["x (deg/s)", "it's"]), &[&[&[1.0, 2.0], &[3.0, 4.0]], &[&[5.0], &[6.0]]]);
        assert_eq!(&bytes[..8], b"\x93NUMPY\x01\x00");
        let length = usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
        assert_eq!((10 + length) % 64, 0);
        let header = std::str::from_utf8(&bytes[10..10 + length]).unwrap();
        assert!(header.starts_with(
            r"{'descr': [('x (deg/s)', '<f8'), ('it\'s', '<f8'), ], 'fortran_order': False, 'shape': (3 "
        ));
        assert!(header.ends_with('\n'));
        let data: Vec<f64> =
            bytes[10 + length..].chunks_exact(8).map(|b| f64::from_le_bytes(b.try_into().unwrap())).collect();
        assert_eq!(data, [1.0, 3.0, 2.0, 4.0, 5.0, 6.0]);
        let greek = written("a.npy", &names(&["ω"]), &[]);
        assert_eq!(greek[6], 3);
        let long = written("a.npy", &(0..6000).map(|i| format!("column {i}")).collect::<Vec<_>>(), &[]);
        assert_eq!(long[6], 2);
    }

    #[test]
    fn what_cannot_be_written_is_said_and_nothing_is_left() {
        let folder = tempfile::tempdir().unwrap();
        let refuse = |file: &str, header: &[&str]| {
            TableWriter::create(&folder.path().join(file), &names(header)).unwrap_err().to_string()
        };
        assert!(refuse("a.xlsx", &["x"]).contains(".csv, .csv.gz or .npy"));
        assert!(refuse("a.npy", &["x", "x"]).contains("two columns are named 'x'"));
        assert!(refuse("a.csv", &[]).contains("without columns"));
        assert!(refuse("no/a.csv", &["x"]).contains("does not exist"));
        let mut table = TableWriter::create(&folder.path().join("a.csv"), &names(&["x", "y"])).unwrap();
        assert!(table.write(&[&[1.0], &[]]).is_err());
        assert!(table.write(&[&[1.0]]).is_err());
        drop(table);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
