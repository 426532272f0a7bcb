//! Reading a text log of a time and three axes, with the log check, against a plain reader on the same file: the csv
//! parser line by line, every field by the standard library.
//!
//! `KFDESIGN_BENCH_GROWTH=1` prints seconds over 10⁴ to 10⁷ rows.

use std::hint::black_box;
use std::io::Write;
use std::path::Path;
use std::time::Instant;

use kfdesign::input::{self, LogOptions};
use kfdesign::numerics::random::{StreamId, fill_normal, stream};
use kfdesign::units::Unit;

const ROWS: usize = 1_000_000;

/// `t,gx,gy,gz` with 12 significant digits.
fn write_log(path: &Path, rows: usize) -> std::io::Result<()> {
    let mut noise = vec![0.0; 3 * rows];
    fill_normal(&mut stream(1, StreamId { run: 0, axis: 0, term: 0 }), &mut noise);
    let mut file = std::io::BufWriter::new(std::fs::File::create(path)?);
    writeln!(file, "t,gx,gy,gz")?;
    for (i, row) in noise.chunks_exact(3).enumerate() {
        write!(file, "{}", i as f64 / 100.0)?;
        for z in row {
            let x = 0.05 + 0.035 * z;
            write!(file, ",{:.*}", (11.0 - x.abs().log10().floor()).clamp(0.0, 16.0) as usize, x)?;
        }
        writeln!(file)?;
    }
    file.flush()
}

fn options() -> LogOptions {
    let unit = Unit::parse("rad/s").ok();
    LogOptions { time: Some("t:s".into()), unit, no_digest: true, ..LogOptions::default() }
}

fn ours(path: &Path) -> Vec<Vec<f64>> {
    match input::read(path, &options()) {
        Ok((log, _)) => log.axes.into_iter().map(|axis| axis.values).collect(),
        Err(error) => panic!("{error}"),
    }
}

/// All four columns.
fn plain(path: &Path) -> Vec<Vec<f64>> {
    let text = std::fs::read(path).expect("the file was just written");
    let mut reader = csv_core::Reader::new();
    let (mut record, mut ends) = (vec![0u8; 1 << 10], vec![0usize; 16]);
    let mut columns = vec![Vec::new(); 4];
    let mut left = &text[..];
    let mut header = true;
    loop {
        let (result, read, _, fields) = reader.read_record(left, &mut record, &mut ends);
        left = &left[read..];
        match result {
            csv_core::ReadRecordResult::Record => {}
            csv_core::ReadRecordResult::InputEmpty => continue,
            _ => return columns.split_off(1),
        }
        let mut from = 0;
        for (column, end) in columns.iter_mut().zip(&ends[..fields]) {
            if !header {
                let field = std::str::from_utf8(&record[from..*end]).expect("the file is ASCII");
                column.push(field.parse::<f64>().expect("every field is a number"));
            }
            from = *end;
        }
        header = false;
    }
}

/// The median of so many.
fn seconds(runs: usize, work: impl Fn() -> Vec<Vec<f64>>) -> f64 {
    let mut all: Vec<f64> = (0..runs)
        .map(|_| {
            let start = Instant::now();
            let read = black_box(work());
            let seconds = start.elapsed().as_secs_f64();
            drop(read);
            seconds
        })
        .collect();
    all.sort_by(f64::total_cmp);
    all[runs / 2]
}

#[allow(clippy::print_stdout, reason = "a bench prints")]
fn main() {
    let folder = tempfile::tempdir().expect("a folder for the log");
    let log = |rows| {
        let path = folder.path().join(format!("{rows}.csv"));
        write_log(&path, rows).expect("the log is written");
        path
    };
    let path = log(ROWS);
    assert_eq!(ours(&path), plain(&path), "every number has the same bits");
    let (fast, slow) = (seconds(9, || ours(&path)), seconds(5, || plain(&path)));
    println!(
        "text log, {ROWS} rows of 4 columns: {fast:.4} s with the log check; plain csv reader {slow:.4} s; ratio {:.2}",
        slow / fast
    );
    if std::env::var_os("KFDESIGN_BENCH_GROWTH").is_some() {
        for rows in [10_000, 100_000, 1_000_000, 10_000_000] {
            let path = log(rows);
            let seconds = seconds(5, || ours(&path));
            println!("growth: text log rows {rows} seconds {seconds:.5}");
        }
    }
    if let Some(folder) = std::env::var_os("KFDESIGN_BENCH_DATA") {
        let path = Path::new(&folder).join("log.csv");
        if path.exists() {
            let rows = ours(&path)[0].len();
            println!(
                "peers: text seconds {:.4} rows {rows} threads {}",
                seconds(5, || ours(&path)),
                rayon::current_num_threads()
            );
        }
    }
}
