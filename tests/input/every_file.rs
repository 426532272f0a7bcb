//! Every measured file that is at hand is read or refused as the table in docs/validation/reading.md says, and the
//! table has all of them.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use kfdesign::input;
use kfdesign::units::Unit;
use rayon::prelude::*;

use super::super::support::measured;
use super::{assert_close, options};

/// A row of the table.
struct Row {
    file: String,
    /// Flag and value.
    flags: Vec<(String, String)>,
    expected: Expected,
}

enum Expected {
    Read { what: String, samples: usize, rate_hz: f64, unit: Unit, first: f64, last: f64 },
    Refused(String),
}

/// `--unit "1/131 deg/s" --rate 100` as flags and values.
fn flags(text: &str) -> Vec<(String, String)> {
    let (mut words, mut quoted) = (vec![String::new()], false);
    for c in text.trim_matches(['`', ' ']).chars() {
        match c {
            '"' => quoted = !quoted,
            ' ' if !quoted => words.push(String::new()),
            c => words.last_mut().unwrap().push(c),
        }
    }
    words.chunks_exact(2).map(|pair| (pair[0].trim_start_matches("--").to_string(), pair[1].clone())).collect()
}

fn table() -> Vec<Row> {
    let page =
        std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/validation/reading.md")).unwrap();
    let rows =
        page.lines().filter(|line| ["| formats/", "| static/", "| motion/"].iter().any(|row| line.starts_with(row)));
    rows.map(|line| {
        let cells: Vec<&str> = line.trim_matches('|').split('|').map(str::trim).collect();
        let number = |i: usize| cells[i].parse::<f64>().unwrap_or_else(|_| panic!("{line}"));
        let expected = match cells[2].strip_prefix("refused: ") {
            Some(words) => Expected::Refused(words.to_string()),
            None => Expected::Read {
                what: cells[2].to_string(),
                samples: number(3) as usize,
                rate_hz: number(4),
                unit: Unit::parse(cells[5]).unwrap(),
                first: number(6),
                last: number(7),
            },
        };
        Row { file: cells[0].to_string(), flags: flags(cells[1]), expected }
    })
    .collect()
}

impl Row {
    fn check(&self, path: &Path) {
        let file = &self.file;
        let mut flags: Vec<(&str, &str)> =
            self.flags.iter().map(|(flag, value)| (flag.as_str(), value.as_str())).collect();
        match &self.expected {
            Expected::Refused(words) => match input::read(path, &options(&flags)) {
                Ok(_) => panic!("{file}: read"),
                Err(error) => assert!(error.message.contains(words), "{error}"),
            },
            Expected::Read { what, samples, rate_hz, unit, first, last } => {
                // a column in backticks, else a topic, which is the one that is read without the flag
                let (log, check) = input::read(path, &options(&flags)).unwrap_or_else(|error| panic!("{error}"));
                match what.strip_prefix('`') {
                    Some(column) => assert_eq!(log.axes[0].name, column.trim_matches('`'), "{file}"),
                    None => {
                        flags.retain(|(flag, _)| *flag != "topic");
                        flags.push(("topic", what));
                        let (same, _) = input::read(path, &options(&flags)).unwrap();
                        assert_eq!(same.axes[0].values[0].to_bits(), log.axes[0].values[0].to_bits(), "{file}");
                    }
                }
                let x: Vec<f64> = log.axes[0].values.iter().map(|x| unit.from_si(*x)).collect();
                assert_eq!(x.len(), *samples, "{file}");
                assert_eq!(log.axes[0].unit, unit.times_time(0), "{file}");
                assert_close(&[x[0], x[x.len() - 1]], &[*first, *last], file);
                // six digits are written, and each gap is a whole number of periods only to half a period
                let steps = (x.len() - 1) as f64;
                let mean = check.sample_rate_hz * steps / (steps + check.missing as f64);
                let off = (mean / rate_hz - 1.0).abs();
                assert!(off < 1e-5 + 0.5 * log.gaps.len() as f64 / steps, "{file}: {mean} Hz");
            }
        }
    }
}

/// The files below a folder, with their paths from the root.
fn files(root: &Path, folder: &Path, found: &mut BTreeSet<String>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path: PathBuf = entry.unwrap().path();
        if path.is_dir() {
            files(root, &path, found);
        } else {
            found.insert(path.strip_prefix(root).unwrap().to_str().unwrap().to_string());
        }
    }
}

#[test]
fn every_measured_file_is_read_or_refused_as_the_table_says() {
    let Some(formats) = measured("formats") else { return };
    let (root, rows) = (formats.parent().unwrap(), table());
    let mut there = BTreeSet::new();
    ["formats", "static", "motion"].iter().for_each(|folder| files(root, &root.join(folder), &mut there));
    let named: BTreeSet<String> = rows.iter().map(|row| row.file.clone()).collect();
    assert_eq!(named, there, "the table in docs/validation/reading.md and the folder differ");
    rows.par_iter().for_each(|row| row.check(&root.join(&row.file)));
}
