//! Parquet files: small ones written by pyarrow 26.0.1, polars 2.1.0 and fastparquet 2026.9.0
//! (`written/write_parquet.py` says what is in them).

use kfdesign::input::inspect::inspect;
use kfdesign::signal::check::FindingKind;

use super::super::support::Bench;
use super::{Flags, assert_close, damage, read_bytes, shown};

/// Every compression, and an index of stamps without a name.
const USUAL: [(&str, &[u8]); 5] = [
    ("snappy.parquet", include_bytes!("written/snappy.parquet")),
    ("gzip.parquet", include_bytes!("written/gzip.parquet")),
    ("lz4.parquet", include_bytes!("written/lz4.parquet")),
    ("none.parquet", include_bytes!("written/none.parquet")),
    ("index.parquet", include_bytes!("written/index.parquet")),
];
/// Zstandard; pages of version 2, delta, split bytes, a structure.
const NEWER: &[u8] = include_bytes!("written/newer.parquet");
const POLARS: &[u8] = include_bytes!("written/polars.parquet");
/// Stamps of twelve bytes.
const TWELVE: &[u8] = include_bytes!("written/twelve.parquet");
/// Differences, not compressed.
const DELTA: &[u8] = include_bytes!("written/delta.parquet");
const BROTLI: &[u8] = include_bytes!("written/brotli.parquet");

/// Column k as `write_parquet.py` makes it.
fn column(k: usize) -> Vec<f64> {
    (0..40).map(|i| 0.5 * i as f64 + 10.0 * k as f64 - 3.0).collect()
}

#[test]
fn every_compression_and_writer_gives_the_same_numbers() {
    let files = USUAL.iter().map(|(name, bytes)| (*name, *bytes, 1.6e9));
    for (name, bytes, start_s) in files.chain([("polars.parquet", POLARS, 0.0), ("twelve.parquet", TWELVE, 1.6e9)]) {
        let (log, check) = read_bytes(name, bytes, &[]).unwrap();
        assert_eq!((log.len(), log.axes.len(), log.start_s), (40, 3, start_s), "{name}");
        // stamps are whole numbers of the file's unit: exact but for the division
        assert!((log.sample_rate_hz - 100.0).abs() < 1e-12, "{name}: {}", log.sample_rate_hz);
        assert!(!check.findings.iter().any(|f| f.kind == FindingKind::Nan), "{name}");
        for axis in 0..3 {
            assert_close(&shown(&log, axis), &column(axis), name);
        }
    }
    let (log, check) = read_bytes("snappy.parquet", USUAL[0].1, &[("sensor", "accel")]).unwrap();
    let missing = check.findings.iter().find(|f| f.kind == FindingKind::Nan).unwrap();
    assert_eq!((missing.count, missing.first_index), (1, 7));
    // on both sides of the missing number, and of the border between the row groups at row 25
    let expected: Vec<f64> = column(0).iter().enumerate().map(|(i, x)| if i == 7 { f64::NAN } else { *x }).collect();
    assert_close(&shown(&log, 0), &expected, "a missing number");
    assert_close(&shown(&log, 2), &column(2), "single precision");
}

#[test]
fn newer_pages_and_other_numbers_are_read() {
    let (log, _) = read_bytes("newer.parquet", NEWER, &[("unit", "rad/s")]).unwrap();
    assert_eq!((log.len(), log.start_s), (40, 1.6e9));
    assert!((log.sample_rate_hz - 100.0).abs() < 1e-12, "{}", log.sample_rate_hz);
    assert_eq!(log.axes[2].name, "imu.gyro_z");
    (0..3).for_each(|axis| assert_close(&shown(&log, axis), &column(axis), "imu"));
    let other = |name: &str| {
        let (log, _) = read_bytes("newer.parquet", NEWER, &[("unit", "rad/s"), ("columns", name)]).unwrap();
        shown(&log, 0)
    };
    assert_close(&other("half"), &column(0), "half precision");
    assert_close(&other("price"), &column(0), "one digit behind the point");
    assert_close(&other("counts"), &(0..40).map(|i| 10.0 * f64::from(i)).collect::<Vec<f64>>(), "32 bits");
    let above: Vec<f64> = (0..40).map(|i| 2f64.powi(63) + 4096.0 * f64::from(i)).collect();
    assert_close(&other("above"), &above, "64 bits without a sign");
    assert_eq!(other("still")[..4], [1.0, 0.0, 1.0, 0.0]);
    // whole numbers are stamps too
    let flags: Flags = &[("unit", "rad/s"), ("time", "counts:ms"), ("columns", "imu.gyro_x")];
    assert!((read_bytes("newer.parquet", NEWER, flags).unwrap().0.sample_rate_hz - 100.0).abs() < 1e-12);
}

#[test]
fn what_is_in_it_is_listed() {
    let bench = Bench::new();
    let found = inspect(&bench.file("log", USUAL[0].1)).unwrap();
    let [topic] = &found.topics[..] else { panic!("{found:?}") };
    assert_eq!((found.file.as_str(), topic.rows, topic.time.as_deref()), ("Parquet", Some(40), Some("stamp")));
    assert_eq!(topic.columns.len(), 7, "text and lists are passed over: {:?}", topic.columns);
    assert!((topic.rate_hz.unwrap() - 100.0).abs() < 1e-9);
}

#[test]
fn what_is_not_read_is_refused_by_name() {
    let refused = |bytes: &[u8], flags: Flags| read_bytes("log.parquet", bytes, flags).unwrap_err();
    let message = refused(BROTLI, &[]);
    assert!(message.contains("compressed with BROTLI, which is not read; write it with zstd"), "{message}");
    let message = refused(&USUAL[3].1[..3000], &[]);
    assert!(message.contains("truncated or damaged: its table of contents cannot be read"), "{message}");
    let message = refused(USUAL[0].1, &[("columns", "note")]);
    assert!(message.contains("no column 'note'; there are 1 'stamp'"), "{message}");
    let mut damaged = USUAL[3].1.to_vec();
    // the head of a page
    damaged[4..12].fill(0xff);
    assert!(
        refused(&damaged, &[]).contains("log.parquet: row group 1: column 'stamp': "),
        "{}",
        refused(&damaged, &[])
    );
}

/// Of the crate `parquet`: it panics on a number of more than ten bytes, and nothing of it is seen.
#[test]
fn a_panic_over_a_damaged_page_is_one_line() {
    let (log, _) = read_bytes("log.parquet", DELTA, &[("rate", "100")]).unwrap();
    assert_close(&shown(&log, 0), &(0..40).map(|i| f64::from(7 * i % 11)).collect::<Vec<_>>(), "delta");
    let mut damaged = DELTA.to_vec();
    let page = DELTA.windows(4).position(|bytes| bytes == [0x80, 1, 4, 40]).unwrap();
    damaged[page..page + 11].fill(0xff);
    let bench = Bench::new();
    bench.file("log.parquet", &damaged);
    let out = bench.run("allan log.parquet --rate 100");
    let line = "kfdesign: log.parquet: row group 1: column 'gyro_x (deg/s)': a damaged page\n";
    assert_eq!((out.status, out.stdout.as_str(), out.stderr.as_str()), (2, "", line));
}

/// A page header that declares a list of 2^31 numbers, each of which the crate `parquet` would look for behind the
/// end of the file.
#[test]
fn a_header_that_declares_more_than_the_file_has_ends() {
    let mut damaged = DELTA.to_vec();
    damaged[4..11].copy_from_slice(&[0xf9, 0xf7, 0xff, 0xff, 0xff, 0xff, 0x07]);
    let message = read_bytes("log.parquet", &damaged, &[("rate", "100")]).unwrap_err();
    assert!(message.starts_with("log.parquet: row group 1: column 'gyro_x (deg/s)': "), "{message}");
    // truth values, which take no bytes in its lists: in the header of a page, and in the table of contents
    damaged[5] = 0xf2;
    let message = read_bytes("log.parquet", &damaged, &[("rate", "100")]).unwrap_err();
    assert!(message.ends_with("the header of a page declares more than there is"), "{message}");
    let contents = [0x19, 0xf2, 0xff, 0xff, 0xff, 0xff, 0x07, 0];
    let damaged = [b"PAR1", &contents[..], &8u32.to_le_bytes(), b"PAR1"].concat();
    let message = read_bytes("log.parquet", &damaged, &[("rate", "100")]).unwrap_err();
    assert!(message.ends_with("cannot be read (a list declares more than there is)"), "{message}");
}

#[test]
fn damaged_parquet_files_end() {
    for (name, bytes) in USUAL.into_iter().chain([("newer", NEWER), ("polars", POLARS), ("twelve", TWELVE)]) {
        damage::survives(name, bytes, &[&[("unit", "deg/s")], &[("sensor", "accel")]], 60);
    }
}

/// `cargo test --release -- --ignored --nocapture ten_thousand_changes`
#[test]
#[ignore = "takes minutes"]
fn ten_thousand_changes_of_parquet_files() {
    for (name, bytes) in USUAL.into_iter().chain([("newer", NEWER), ("polars", POLARS), ("twelve", TWELVE)]) {
        damage::ten_thousand(name, bytes, &[("unit", "deg/s")]);
    }
}
