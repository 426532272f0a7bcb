//! A log in memory, lent by who waits: read as the same columns in a file are.

use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

use kfdesign::export::table::TableWriter;
use kfdesign::input::{self, Block, LogOptions, LogReader};
use kfdesign::numerics::progress::{Progress, Samples, watched};

use crate::support::Bench;

/// More rows than are asked for at a time, and no multiple of it.
const ROWS: usize = 150_001;
const NAMES: [&str; 3] = ["time (s)", "gyro_x (deg/s)", "gyro_y (deg/s)"];

fn column(number: usize) -> Vec<f64> {
    let value = |row: usize| match number {
        // a hole of 30 samples behind row 70 000, and a number that is none
        0 => (row + if row > 70_000 { 30 } else { 0 }) as f64 * 0.01 + 1e9,
        1 if row == 99_999 => f64::NAN,
        _ => (((row * 37 + number * 11) % 101) as f64 - 50.0) * 0.1,
    };
    (0..ROWS).map(value).collect()
}

/// Three columns of the name "held"; the first `whole` rows of them are there.
struct Held {
    whole: usize,
}

struct Columns(Vec<Vec<f64>>);

impl Samples for Columns {
    fn names(&self) -> Vec<String> {
        NAMES.map(String::from).to_vec()
    }
    fn columns(&self) -> usize {
        NAMES.len()
    }
    fn rows(&self) -> u64 {
        ROWS as u64
    }
    fn read(&self, column: usize, rows: Range<u64>, into: &mut Vec<f64>) {
        let own = &self.0[column];
        into.extend_from_slice(&own[(rows.start as usize).min(own.len())..(rows.end as usize).min(own.len())]);
    }
}

impl Progress for Held {
    fn lent(&self, name: &Path) -> Option<Arc<dyn Samples>> {
        let columns = (0..NAMES.len()).map(|number| column(number)[..self.whole].to_vec());
        (name == Path::new("held")).then(|| Arc::new(Columns(columns.collect())) as _)
    }
}

fn with<T: Send>(whole: usize, work: impl FnOnce() -> T + Send) -> T {
    let watch: Arc<dyn Progress> = Arc::new(Held { whole });
    watched(&watch, work).unwrap()
}

#[test]
fn a_lent_log_is_read_like_a_file() {
    let bench = Bench::new();
    let path = bench.path("held.npy");
    let mut writer = TableWriter::create(&path, &NAMES.map(String::from)).unwrap();
    let columns: Vec<Vec<f64>> = (0..NAMES.len()).map(column).collect();
    writer.write(&columns.iter().map(Vec::as_slice).collect::<Vec<_>>()).unwrap();
    writer.finish().unwrap();
    let options = LogOptions::default();
    let (file, checked) = input::read(&path, &options).unwrap();
    let (lent, said) = with(ROWS, || input::read(Path::new("held"), &options)).unwrap();
    assert_eq!((&lent.gaps, lent.start_s, lent.sample_rate_hz), (&file.gaps, file.start_s, file.sample_rate_hz));
    for (own, other) in lent.axes.iter().zip(&file.axes) {
        assert_eq!((&own.name, &own.unit), (&other.name, &other.unit));
        assert!(own.values.iter().zip(&other.values).all(|(a, b)| a.to_bits() == b.to_bits()));
    }
    assert_eq!(serde_json::to_string(&said).unwrap(), serde_json::to_string(&checked).unwrap());
    assert_eq!((lent.name.as_str(), lent.sha256.map(|hash| hash.len())), ("held", Some(64)));
    // block by block, and twice over
    let rows = with(ROWS, || {
        let mut reader = LogReader::open(Path::new("held"), &options).unwrap();
        let (mut block, mut rows) = (Block::default(), 0);
        while reader.next_block(&mut block).unwrap() {
            rows += block.time_s.len();
        }
        rows
    });
    assert_eq!(rows, ROWS);
}

#[test]
fn who_does_not_lend_it_has_no_such_log() {
    let options = LogOptions::default();
    let message = |found: Result<_, input::InputError>| found.err().unwrap().message;
    assert_eq!(message(input::read(Path::new("held"), &options)), "held: there is no such file");
    assert_eq!(message(with(100_000, || input::read(Path::new("held"), &options))), "held: its samples are gone");
}
