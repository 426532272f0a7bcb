//! Units and rates as a log, its names or a line before it says them; and what cannot be read, by its name.

use super::super::support::Bench;
use super::{assert_close, read, read_bytes, refused, shown};
use kfdesign::signal::check::FindingKind;

#[test]
fn counts_of_a_converter_end_at_the_door() {
    let text: String = (0..300).map(|i| format!("{}\n", (i * 7919) % 131)).collect();
    let (log, _) = read(&format!("gx\n{text}"), &[("unit", "1/131 deg/s"), ("rate", "100")]).unwrap();
    assert_eq!(log.axes[0].unit.text(), "deg/s");
    assert_close(&shown(&log, 0)[..2], &[0.0, f64::from(7919 % 131) / 131.0], "counts");
    // what is printed and drawn has no counts either
    let bench = Bench::new();
    bench.file("counts.csv", format!("gx\n{text}"));
    for run in ["allan counts.csv --plot a.svg", "identify counts.csv -o p.json --plot p.svg --report p.html"] {
        let run = format!("{run} --rate 100 --unit").split(' ').map(str::to_string).collect::<Vec<_>>();
        let args: Vec<&str> = run.iter().map(String::as_str).chain(["1/131 deg/s"]).collect();
        let outcome = bench.run_args(&args);
        assert!(!outcome.stdout.contains("1/131"), "{}", outcome.stdout);
    }
    for file in bench.files().iter().filter(|name| name.ends_with(".svg") || name.ends_with(".json")) {
        // but for what was said of the log, which params.json remembers
        let text = bench.read(file).replacen("\"unit\": \"1/131 deg/s\"", "", 1);
        assert!(!text.contains("1/131"), "{file}");
    }
}

fn element(kind: u32, content: &[u8]) -> Vec<u8> {
    let mut element = [kind, content.len() as u32].map(u32::to_le_bytes).concat();
    element.extend(content);
    element.resize(element.len().next_multiple_of(8), 0);
    element
}

fn matrix(name: &str, rows: i32, columns: i32) -> Vec<u8> {
    let shape: Vec<u8> = [rows, columns].iter().flat_map(|n| n.to_le_bytes()).collect();
    let numbers: Vec<u8> = (0..rows * columns).flat_map(|i| (f64::from(i * 37 % 101) - 50.0).to_le_bytes()).collect();
    let head = [element(6, &[6, 0, 0, 0, 0, 0, 0, 0]), element(5, &shape), element(1, name.as_bytes())].concat();
    element(14, &[head, element(9, &numbers)].concat())
}

fn mat(variables: &[Vec<u8>], subsystem: u64) -> Vec<u8> {
    let mut file = b"MATLAB 5.0 MAT-file".to_vec();
    file.resize(116, b' ');
    file.extend(subsystem.to_le_bytes());
    file.extend(b"\0\x01IM");
    [file, variables.concat()].concat()
}

#[test]
fn the_name_of_a_matrix_says_the_unit_of_its_columns() {
    let file = mat(&[matrix("gyro_dps", 300, 3)], 0);
    let (log, _) = read_bytes("log.mat", &file, &[("rate", "100")]).unwrap();
    let names: Vec<&str> = log.axes.iter().map(|axis| axis.name.as_str()).collect();
    assert_eq!(names, ["gyro_x", "gyro_y", "gyro_z"]);
    assert!(log.axes.iter().all(|axis| axis.unit.text() == "deg/s"));
    assert_close(&shown(&log, 2)[1..2], &[f64::from(601 * 37 % 101) - 50.0], "gyro_z");
}

/// A table is an object; what it is made of is an array of bytes in a variable without a name.
#[test]
fn an_object_of_matlab_is_named_and_not_counted() {
    let parts = [element(6, &[17, 0, 0, 0, 0, 0, 0, 0]), element(1, b"imu"), element(1, b"MCOS"), element(1, b"table")];
    let object = element(14, &[parts.concat(), matrix("", 6, 1)].concat());
    let hidden = matrix("", 400, 1);
    let at = 128 + object.len() as u64;
    let bench = Bench::new();
    bench.file("alone.mat", mat(&[object.clone(), hidden.clone()], at));
    let info = bench.run("info alone.mat");
    assert_eq!(info.status, 0, "{}", info.stderr);
    assert!(
        info.stdout.contains("note: imu: a MATLAB object of the class 'table', which cannot be read"),
        "{}",
        info.stdout
    );
    assert!(!info.stdout.contains("400"), "{}", info.stdout);
    let allan = bench.run("allan alone.mat");
    assert_eq!((allan.status, allan.stderr.lines().count()), (2, 1));
    assert!(allan.stderr.contains("imu (table, an object)"), "{}", allan.stderr);
    assert!(bench.run("allan alone.mat --topic imu").stderr.contains("imu is a MATLAB object of the class 'table'"));
    // beside an array that can be read
    let file = mat(&[matrix("gyro_dps", 300, 3), object, hidden], 0);
    assert_eq!(read_bytes("log.mat", &file, &[("rate", "100"), ("topic", "gyro_dps")]).unwrap().0.axes.len(), 3);
}

#[test]
fn a_line_fs_before_the_table_is_the_rate() {
    let rows: String = (0..300).map(|i| format!("{},{}\n", (i * 7919) % 131, i % 7)).collect();
    let (log, check) = read(&format!("Fs,100\n\ngx_dps,gy_dps\n{rows}"), &[]).unwrap();
    assert_eq!(log.sample_rate_hz, 100.0);
    assert!(
        check
            .findings
            .iter()
            .any(|f| f.kind == FindingKind::Rate && f.message == "100 Hz by 'Fs' of the file" && !f.serious)
    );
    // other names must say hertz
    let rows: String = (0..300).map(|i| format!("{},{},1\n", (i * 7919) % 131, i % 7)).collect();
    assert!(refused(&format!("Sample rate,100\n\ngx_dps,gy_dps,n\n{rows}"), &[]).contains("no sample rate"));
}

/// Stamps in seconds whose header says milliseconds.
#[test]
fn a_rate_that_no_sensor_has_is_questioned() {
    let log = |unit: &str, step: f64, rows: i32| {
        let rows: String = (0..rows).map(|i| format!("{:.6},{}\n", f64::from(i) * step, (i * 7919) % 131)).collect();
        let (_, check) = read(&format!("time ({unit}),gx_dps\n{rows}"), &[]).unwrap();
        let asked = |f: &&kfdesign::signal::check::Finding| f.kind == FindingKind::TimeUnit;
        check.findings.iter().find(asked).map(|f| (f.serious, f.message.clone()))
    };
    let (serious, message) = log("ms", 0.01, 10_000).unwrap();
    assert!(serious && message.starts_with("the time stamps say 100000 Hz over 0.1 s"), "{message}");
    assert!(log("s", 0.01, 99).is_some());
    assert!(log("us", 30.0, 40_000).is_some());
    assert_eq!(log("s", 0.01, 101), None);
    assert_eq!(log("us", 32.0, 40_000), None);
}
