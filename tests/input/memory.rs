//! Memory of a process that reads a file, intact or damaged: under a limit set by the system, of which any excess
//! ends it.

use std::process::Command;
use std::time::{Duration, Instant};

use rayon::prelude::*;

use super::super::support::{Bench, measured};
use super::damage::{changed, cuts};
use super::messages::SAMPLES;

/// Beyond four times the file, in KiB: twice what the most demanding file takes. Most is the window of a Zstandard
/// block, 8 MiB, and stacks; a process that reads next to nothing has 2.7 MiB.
const ROOM: u64 = 16 << 10;

/// Status, stderr and stdout of a command and its flags with a file of so many bytes, within the memory that is
/// promised for it. Data of the process, stacks included, are limited by `ulimit -d`.
pub fn within(path: &std::path::Path, command: &[&str], bytes: usize) -> (Option<i32>, String, String) {
    let limit = 4 * (bytes as u64).div_ceil(1024) + ROOM;
    let bench = Bench::new();
    let file = |name: &str| std::fs::File::create(bench.path(name)).unwrap();
    let mut child = Command::new("sh")
        .args(["-c", &format!("ulimit -d {limit}; exec \"$0\" \"$@\""), env!("CARGO_BIN_EXE_kfdesign"), command[0]])
        .arg(path)
        .args(&command[1..])
        .arg("-v")
        // stacks and heaps come by the thread
        .env("RAYON_NUM_THREADS", "2")
        .env("MALLOC_ARENA_MAX", "2")
        .stdout(file("stdout"))
        .stderr(file("stderr"))
        .spawn()
        .unwrap();
    let began = Instant::now();
    let status = loop {
        if let Some(status) = child.try_wait().unwrap() {
            break status.code();
        }
        // a thread that finds no memory may leave the others waiting
        if began.elapsed() > Duration::from_secs(60) {
            child.kill().unwrap();
            child.wait().unwrap();
            break None;
        }
        std::thread::sleep(Duration::from_millis(1));
    };
    let text = |name: &str| String::from_utf8_lossy(&std::fs::read(bench.path(name)).unwrap()).into_owned();
    (status, text("stderr"), text("stdout"))
}

/// `info` goes through every table, `allan` keeps the samples of one.
fn stays_inside(bench: &Bench, name: &str, bytes: &[u8], flags: &[&str], intact: bool) {
    let path = bench.file(name, bytes);
    for command in ["info", "allan"] {
        let flags: Vec<&str> =
            [command].into_iter().chain(flags.iter().copied().filter(|_| command == "allan")).collect();
        let (status, ..) = within(&path, &flags, bytes.len());
        // where the limit could not be set, the shell ends with 2
        let fine = if intact && command == "info" { status == Some(0) } else { matches!(status, Some(0..=2)) };
        assert!(fine, "{command} of {name}, {} bytes: {status:?}", bytes.len());
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_file_takes_four_times_its_size_and_some_room_at_most() {
    let written =
        ["level5.mat", "level5-compressed.mat", "earliest.h5", "latest.h5", "snappy.parquet", "newer.parquet"];
    let mut files: Vec<(std::path::PathBuf, &[&str])> = written
        .iter()
        .map(|name| std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/input/written").join(name))
        .map(|path| (path, &["--unit", "deg/s", "--rate", "100"] as &[&str]))
        .collect();
    let Some(formats) = measured("formats") else { return };
    files.extend(SAMPLES.iter().map(|(name, _)| (formats.join("..").join(name), &[] as &[&str])));
    files.push((formats.join("euroc"), &[]));
    files.par_iter().for_each(|(path, flags)| {
        let path = if path.is_dir() { path.join("mav0/imu0/data.csv") } else { path.clone() };
        let bytes = std::fs::read(&path).unwrap();
        let (bench, name) = (Bench::new(), path.file_name().unwrap().to_str().unwrap());
        stays_inside(&bench, name, &bytes, flags, true);
        cuts(&bytes).step_by(17).chain(changed(&bytes, 12)).for_each(|damaged| {
            stays_inside(&bench, name, &damaged, flags, false);
        });
    });
}
