//! Logs in every form that is read, against what independent readers say.

#[path = "input/arrays.rs"]
mod arrays;
#[path = "input/batches.rs"]
mod batches;
#[path = "input/damage.rs"]
mod damage;
#[path = "input/every_file.rs"]
mod every_file;
#[path = "input/hostile.rs"]
mod hostile;
#[path = "input/lent.rs"]
mod lent;
#[path = "input/measured.rs"]
mod measured;
#[path = "input/memory.rs"]
mod memory;
#[path = "input/messages.rs"]
mod messages;
#[path = "input/npy.rs"]
mod npy;
#[path = "input/parquet.rs"]
mod parquet;
#[path = "input/plain.rs"]
mod plain;
#[path = "input/units.rs"]
mod units;
#[path = "input/vendors.rs"]
mod vendors;

use kfdesign::export::table::TableWriter;
use kfdesign::input::{self, Block, InputKind, LogOptions, LogReader};
use kfdesign::signal::check::{FindingKind, TimeBase};
use kfdesign::signal::{Gap, LogCheck, Recording};
use kfdesign::units::{Quantity, Unit};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

use super::support::Bench;

/// Flags and their values: `[("unit", "deg/s"), ("rate", "100")]`.
type Flags<'a> = &'a [(&'a str, &'a str)];

/// The flags as the command line reads them.
fn options(flags: Flags) -> LogOptions {
    let mut options = LogOptions::default();
    for (flag, value) in flags {
        match *flag {
            "columns" => options.columns = Some(value.split(',').map(str::to_string).collect()),
            "topic" => options.topic = Some((*value).to_string()),
            "time" => options.time = Some((*value).to_string()),
            "unit" => options.unit = Some(Unit::parse(value).unwrap()),
            "rate" => options.rate_hz = Some(value.parse().unwrap()),
            "start" => options.start_s = Some(value.parse().unwrap()),
            "end" => options.end_s = Some(value.parse().unwrap()),
            "input" => options.kind = if *value == "angle" { InputKind::Angle } else { InputKind::Increments },
            "sensor" => {
                let force = *value == "accel";
                options.quantity = Some(if force { Quantity::SpecificForce } else { Quantity::AngularRate });
            }
            other => panic!("{other}"),
        }
    }
    options
}

fn read_bytes(name: &str, bytes: impl AsRef<[u8]>, flags: Flags) -> Result<(Recording, LogCheck), String> {
    let bench = Bench::new();
    let path = bench.file(name, bytes);
    input::read(&path, &options(flags)).map_err(|e| {
        let message = e.to_string();
        assert!(!message.contains('\n'), "{message}");
        message.replace(&path.display().to_string(), name)
    })
}

fn read(text: &str, flags: Flags) -> Result<(Recording, LogCheck), String> {
    read_bytes("log.csv", text, flags)
}

fn refused(text: &str, flags: Flags) -> String {
    match read(text, flags) {
        Ok((log, _)) => panic!("read: {log:?}"),
        Err(message) => message,
    }
}

/// Values of an axis in the log's own unit.
fn shown(log: &Recording, axis: usize) -> Vec<f64> {
    let axis = &log.axes[axis];
    axis.values.iter().map(|x| axis.unit.from_si(*x)).collect()
}

fn close(a: &[f64], b: &[f64]) -> bool {
    let same = |a: f64, b: f64| (a.is_nan() && b.is_nan()) || (a - b).abs() <= 1e-12 * b.abs();
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| same(*a, *b))
}

fn assert_close(found: &[f64], expected: &[f64], what: &str) {
    assert!(close(found, expected), "{what}: {found:?}, expected {expected:?}");
}

const X: [f64; 4] = [1.5, -2.0, 3.25, 1e-3];
const Y: [f64; 4] = [10.0, 12.0, -11.0, 13.0];

/// The same four samples at 100 Hz in every form of text.
#[test]
fn every_form_of_text_gives_the_same_samples() {
    let forms = [
        ("comma", "time (s),gyro_x (deg/s),gyro_y (deg/s)\n0,1.5,10\n0.01,-2,12\n0.02,3.25,-11\n0.03,1e-3,13\n"),
        (
            "no last line end",
            "time (s),gyro_x (deg/s),gyro_y (deg/s)\n0,1.5,10\n0.01,-2,12\n0.02,3.25,-11\n0.03,0.001,13",
        ),
        (
            "byte-order mark and CRLF",
            "\u{feff}time (s),gyro_x (deg/s),gyro_y (deg/s)\r\n0,1.5,10\r\n0.01,-2,12\r\n0.02,3.25,-11\r\n0.03,0.001,13\r\n",
        ),
        ("semicolon", "time (s);gyro_x (deg/s);gyro_y (deg/s)\n0;1.5;10\n0.01;-2;12\n0.02;3.25;-11\n0.03;0.001;13\n"),
        (
            "decimal comma",
            "time (s);gyro_x (deg/s);gyro_y (deg/s)\n0,00;1,5;10,0\n0,01;-2,0;12,0\n0,02;3,25;-11,0\n0,03;0,001;13\n",
        ),
        (
            "tab",
            "time (s)\tgyro_x (deg/s)\tgyro_y (deg/s)\n0\t1.5\t10\n0.01\t-2\t12\n0.02\t3.25\t-11\n0.03\t0.001\t13\n",
        ),
        (
            "tab with decimal comma",
            "t_s\tgyro_x_dps\tgyro_y_dps\n0\t1,5\t10\n0,01\t-2\t12\n0,02\t3,25\t-11\n0,03\t0,001\t13\n",
        ),
        (
            "aligned spaces",
            "   t_s  gyr_x_dps  gyr_y_dps\n  0     1.5    10\n  0.01 -2      12\n  0.02  3.25  -11\n  0.03  0.001  13\n",
        ),
        (
            "spaces and tabs mixed",
            "t_s gyr_x_dps\tgyr_y_dps\n0 \t1.5 10\n0.01  -2\t12\n0.02 3.25 -11\n0.03\t0.001 13\n",
        ),
        (
            "names in a comment",
            "#time [s],w_x [deg/s],w_y [deg/s]\n0,1.5,10\n0.01,-2,12\n0.02,3.25,-11\n0.03,0.001,13\n",
        ),
        (
            "names in a percent comment",
            "% a log\n% t_s,gx_dps,gy_dps\n0,1.5,10\n0.01,-2,12\n# pause\n\n0.02,3.25,-11\n0.03,0.001,13\n",
        ),
        (
            "slashes",
            "// Rate: 100 Hz\n// Firmware: 2\nt_s,gx_dps,gy_dps\n0,1.5,10\n0.01,-2,12\n0.02,3.25,-11\n0.03,0.001,13\n",
        ),
        (
            "preamble",
            "Fs,100\nLogging Type,0\nInit,36.5\n\nt_s,gx_dps,gy_dps\n0,1.5,10\n0.01,-2,12\n0.02,3.25,-11\n0.03,0.001,13\n",
        ),
        (
            "quotes",
            "\"time (s)\",\"gyro, x (deg/s)\",\"gyro, y (deg/s)\"\n\"0\",\"1.5\",10\n0.01,-2,\"12\"\n0.02,3.25,-11\n0.03,0.001,13\n",
        ),
        (
            "comma and space behind each row",
            "t_s,gx_dps,gy_dps,\n0,1.5,10, \n0.01,-2,12, \n0.02,3.25,-11, \n0.03,0.001,13, \n",
        ),
        (
            "tab behind each row, not behind the names",
            "t_s\tgx_dps\tgy_dps\n0\t1.5\t10\t\n0.01\t-2\t12\t\n0.02\t3.25\t-11\t\n0.03\t0.001\t13\t\n",
        ),
        (
            "a row of units",
            "time,gyro x,gyro y\n(s),(deg/s),(deg/s)\n0,1.5,10\n0.01,-2,12\n0.02,3.25,-11\n0.03,0.001,13\n",
        ),
        (
            "other columns",
            "note,t_s,temp_c,gx_dps,gy_dps,state\nok,0,20.5,1.5,10,a\nok,0.01,,-2,12,b\n-,0.02,x,3.25,-11,\n,0.03,21,0.001,13,c\n",
        ),
        ("milliseconds", "t_ms,gx_dps,gy_dps\n1000,1.5,10\n1010,-2,12\n1020,3.25,-11\n1030,0.001,13\n"),
        (
            "microseconds",
            "TimeUS,GyrX (deg/s),GyrY (deg/s)\n500000,1.5,10\n510000,-2,12\n520000,3.25,-11\n530000,0.001,13\n",
        ),
        (
            "nanoseconds since 1970",
            "#timestamp [ns],w_RS_S_x [deg s^-1],w_RS_S_y [deg s^-1]\n1403636579758555392,1.5,10\n1403636579768555392,-2,12\n1403636579778555392,3.25,-11\n1403636579788555392,0.001,13\n",
        ),
    ];
    for (form, text) in forms {
        let (log, check) = read(text, &[]).unwrap_or_else(|e| panic!("{form}: {e}"));
        assert_eq!(log.axes.len(), 2, "{form}");
        assert_close(&shown(&log, 0), &X, form);
        assert_close(&shown(&log, 1), &Y, form);
        assert!((log.sample_rate_hz - 100.0).abs() < 1e-6, "{form}: {}", log.sample_rate_hz);
        assert_eq!((check.samples, check.time_base, log.gaps.len()), (4, TimeBase::Stamps, 0), "{form}");
    }
}

#[test]
fn gzip_is_recognised_by_its_bytes_and_may_have_several_members() {
    let mut bytes = Vec::new();
    for part in ["t_s,gx_dps,gy_dps\n0,1.5,10\n0.01,-2,12\n", "0.02,3.25,-11\n0.03,0.001,13\n"] {
        let mut gz = flate2::write::GzEncoder::new(&mut bytes, flate2::Compression::default());
        std::io::Write::write_all(&mut gz, part.as_bytes()).unwrap();
        gz.finish().unwrap();
    }
    for name in ["log.csv.gz", "log.txt"] {
        let (log, _) = read_bytes(name, &bytes, &[]).unwrap();
        assert_close(&shown(&log, 0), &X, name);
    }
    let cut = read_bytes("log.csv.gz", &bytes[..bytes.len() - 12], &[]).unwrap_err();
    assert!(cut.contains("log.csv.gz") && cut.contains("cannot read"), "{cut}");
}

#[test]
fn columns_by_name_number_and_sensor() {
    let text = "t_s,gyr_x_dps,gyr_y_dps,acc_x_g,acc_y_g,truth_gyr_x_dps\n0,1,2,3,4,9\n1,2,3,4,5,9\n2,3,4,5,6,8\n";
    let first = |flags: Flags| {
        let (log, _) = read(text, flags).unwrap();
        let names: Vec<String> = log.axes.iter().map(|a| a.name.clone()).collect();
        (names.join(" "), log.quantity, shown(&log, 0)[0])
    };
    use Quantity::{AngularRate, SpecificForce};
    assert_eq!(first(&[]), ("gyr_x gyr_y".into(), AngularRate, 1.0));
    assert_eq!(first(&[("sensor", "accel")]), ("acc_x acc_y".into(), SpecificForce, 3.0));
    assert_eq!(first(&[("unit", "g")]), ("acc_x acc_y".into(), SpecificForce, 3.0));
    assert_eq!(first(&[("columns", "gyr_y")]), ("gyr_y".into(), AngularRate, 2.0));
    assert_eq!(first(&[("columns", "GYR_Y_DPS,2")]), ("gyr_y gyr_x".into(), AngularRate, 2.0));
    assert_eq!(first(&[("columns", "4")]), ("acc_x".into(), SpecificForce, 3.0));
    // no header: numbers only
    let (log, _) = read("0 5 1\n1 6 3\n2 7 2\n", &[("columns", "3"), ("time", "1:s"), ("unit", "rad/s")]).unwrap();
    assert_eq!((log.axes[0].name.as_str(), shown(&log, 0)), ("column 3", vec![1.0, 3.0, 2.0]));
    // names without axis words are the axes of one sensor
    let (log, _) = read("t_s,gyro_north_dps,gyro_east_dps\n0,1,2\n1,2,3\n", &[]).unwrap();
    assert_eq!(log.axes.iter().map(|a| a.name.as_str()).collect::<Vec<_>>(), ["gyro_north", "gyro_east"]);
    // a byte-order mark before the first number
    let (log, _) =
        read("\u{feff}5;1,5\n6;3,25\n7;2\n", &[("columns", "1,2"), ("rate", "1"), ("unit", "rad/s")]).unwrap();
    assert_eq!((shown(&log, 0), shown(&log, 1)), (vec![5.0, 6.0, 7.0], vec![1.5, 3.25, 2.0]));
    // one column is the column
    let (log, _) = read("0.5\n0.25\n1\n", &[("rate", "10"), ("unit", "1/4 deg/s")]).unwrap();
    assert_close(&log.axes[0].values, &[0.125f64, 0.0625, 0.25].map(f64::to_radians), "one column");
}

#[test]
fn increments_and_angles_have_their_own_dimension() {
    let text = "t_s,DeltaTheta X [deg]\n0,1\n1,2\n2,4\n";
    for kind in ["increments", "angle"] {
        let (log, _) = read(text, &[("input", kind)]).unwrap();
        assert_close(&log.axes[0].values, &[1f64, 2.0, 4.0].map(f64::to_radians), kind);
        assert_eq!(log.quantity, Quantity::AngularRate);
    }
    let refusal = refused("t_s,gyro_x (deg/s)\n0,1\n1,2\n", &[("input", "angle")]);
    assert!(refusal.contains("'gyro_x (deg/s)'") && refusal.contains("without `input`"), "{refusal}");
}

/// Every refusal names the file, the place, and what to do.
#[test]
fn what_is_ambiguous_or_missing_is_refused_in_one_line() {
    let both = "t_s,gyr_x_dps,gyr_y_dps\n0,1,2\n1,2,3\n";
    let table: [(&str, Flags, &[&str]); 23] = [
        ("t_s,gx\n0,1\n1,2\n", &[], &["line 1", "no unit for column 'gx'", "`unit`"]),
        ("t_s,gx (furlongs)\n0,1\n1,2\n", &[], &["furlongs", "`unit`"]),
        ("t_s,gyro_x (deg)\n0,1\n1,2\n", &[], &["'gyro_x (deg)'", "an angle", "expected", "`input`"]),
        (both, &[("unit", "rad/s")], &["'gyr_x_dps'", "deg/s by its header", "`unit` says rad/s"]),
        (both, &[("columns", "gyr_z")], &["no column 'gyr_z'", "1 't_s', 2 'gyr_x_dps', 3 'gyr_y_dps'"]),
        (both, &[("columns", "7")], &["no column '7'"]),
        (both, &[("columns", "2,gyr_x")], &["asked for twice"]),
        (both, &[("columns", "t_s,2"), ("unit", "deg/s")], &["'t_s'", "`unit` says deg/s"]),
        ("time,gx_dps\n0,1\n1,2\n", &[], &["time column 'time' has no unit", "`time` 'time:s'", "`rate`"]),
        ("time (ms),gx_dps\n0,1\n1,2\n", &[("time", "time:s")], &["ms by its header", "`time` says s"]),
        ("time (degC),gx_dps\n0,1\n1,2\n", &[("time", "time")], &["'time (degC)'", "expected a time"]),
        ("gx_dps\n1\n2\n", &[], &["no sample rate", "`rate`"]),
        (both, &[("time", "none")], &["no sample rate"]),
        (both, &[("rate", "0")], &["`rate` must be a positive number"]),
        (both, &[("start", "5"), ("end", "4")], &["`start` must be before `end`"]),
        (both, &[("start", "50")], &["no sample lies between `start` and `end`"]),
        ("t1 (s),time2 (s),gx_dps\n0,0,1\n1,1,2\n", &[("time", "t3")], &["no column 't3'"]),
        (
            "time (s),timestamp (us),gx_dps\n0,0,1\n1,1,2\n",
            &[],
            &["several columns could be the time", "'timestamp (us)'"],
        ),
        (
            "t_s,gyro1_x_dps,gyro2_x_dps\n0,1,2\n1,2,3\n",
            &[],
            &["more than one sensor", "'gyro1_x_dps', 'gyro2_x_dps'", "`columns`"],
        ),
        ("t_s,pressure (hPa)\n0,1\n1,2\n", &[], &["no gyro or accelerometer column", "2 'pressure (hPa)'"]),
        ("1,2,3\n2,3,4\n", &[("rate", "1"), ("unit", "deg/s")], &["no header", "`columns`"]),
        ("x_dps,x_dps\n1,2\n2,3\n", &[("columns", "x_dps"), ("rate", "1")], &["columns 1 and 2 are both named"]),
        ("t_s,gx_dps\n,1\n1,2\n2,2\n", &[], &["line 2", "'t_s'", "the time stamp is empty"]),
    ];
    for (text, flags, words) in table {
        let message = refused(text, flags);
        assert!(message.starts_with("log.csv: "), "{message}");
        for word in words {
            assert!(message.contains(word), "'{word}' is not in: {message}");
        }
    }
}

#[test]
fn empty_fields_are_nan_and_counted() {
    let text = "t_s,gx_dps\n0,1\n1,\n2,nan\n3,N/A\n4,inf\n5,2\n";
    let (log, check) = read(text, &[]).unwrap();
    assert_close(&shown(&log, 0), &[1.0, f64::NAN, f64::NAN, f64::NAN, f64::NAN, 2.0], "");
    let nan = check.findings.iter().find(|f| f.kind == FindingKind::Nan).unwrap();
    assert_eq!((nan.count, nan.first_index, nan.first_s), (4, 1, 1.0));
}

#[test]
fn start_and_end_are_seconds_from_the_first_row() {
    let rows: String = (0..100).map(|i| format!("{},{}\n", 50.0 + f64::from(i) * 0.1, (i * 7) % 13)).collect();
    let (log, check) = read(&format!("t_s,gx_dps\n{rows}"), &[("start", "2.05"), ("end", "4.01")]).unwrap();
    assert_eq!((check.samples, shown(&log, 0)[0]), (20, f64::from((21 * 7) % 13)));
    assert!((log.start_s - 52.1).abs() < 1e-9, "{}", log.start_s);
    let (log, _) = read(&format!("t_s,gx_dps\n{rows}"), &[("start", "2"), ("end", "3"), ("rate", "20")]).unwrap();
    assert_eq!((log.len(), shown(&log, 0)[0]), (21, f64::from((40 * 7) % 13)));
    // time that goes back is harmless beyond the end
    let broken = format!("t_s,gx_dps\n{rows}0,0\n");
    let message = refused(&broken, &[]);
    assert!(message.contains("line 102") && message.contains("`end`"), "{message}");
    assert_eq!(read(&broken, &[("end", "9.85")]).unwrap().1.samples, 99);
    assert_eq!(read(&broken, &[("rate", "10")]).unwrap().1.samples, 101);
}

/// 10 000 rows (several blocks) with gaps: streaming and in-memory reading agree sample by sample.
#[test]
fn the_streaming_reader_gives_what_read_gives() {
    let mut text = String::from("t_s,gyro_x (deg/s),gyro_y (deg/s)\n");
    let mut time = 0.0;
    for i in 0..10_000 {
        time += 0.004;
        if i == 4096 || i == 7000 {
            time += 0.004 * f64::from(i / 1000);
        }
        text.push_str(&format!("{time:.6},{},{}\n", f64::from(i).sin(), f64::from(i).cos()));
    }
    let bench = Bench::new();
    let path = bench.file("log.csv", &text);
    for flags in [&[][..], &[("start", "10"), ("end", "30")], &[("rate", "250"), ("start", "3")]] {
        let options = options(flags);
        let (log, check) = input::read(&path, &options).unwrap();
        let mut reader = LogReader::open(&path, &options).unwrap();
        assert_eq!(reader.check(), &check);
        assert_eq!(Some(reader.sha256()), log.sha256.as_deref());
        let (mut block, mut values, mut gaps, mut last) = (Block::default(), vec![Vec::new(); 2], Vec::new(), f64::NAN);
        while reader.next_block(&mut block).unwrap() {
            for (i, missing) in block.missing.iter().enumerate().filter(|(_, m)| **m > 0) {
                gaps.push(Gap { index: values[0].len() + i, missing: *missing });
            }
            assert!(block.time_s.windows(2).all(|w| w[1] > w[0]) && !block.time_s.is_empty());
            last = block.time_s[block.time_s.len() - 1];
            values.iter_mut().zip(&block.values).for_each(|(all, part): (&mut Vec<f64>, _)| all.extend(part));
        }
        assert_eq!((&values[0], &values[1], &gaps), (&log.axes[0].values, &log.axes[1].values, &log.gaps));
        match flags.len() {
            0 => {
                assert_eq!(log.gaps, [Gap { index: 4096, missing: 4 }, Gap { index: 7000, missing: 7 }]);
                assert!((last - (time - 0.004)).abs() < 1e-6, "{last}");
                assert!((log.sample_rate_hz - 250.0).abs() < 1e-6);
            }
            _ if flags[0].0 == "rate" => {
                assert_eq!((log.len(), log.gaps.len()), (10_000 - 750, 0));
                assert!((last - 9999.0 / 250.0).abs() < 1e-9, "{last}");
            }
            _ => assert!((last - 30.0).abs() < 0.0041, "{last}"),
        }
    }
}

#[test]
fn what_the_table_writer_writes_is_read_to_the_same_bits() {
    let bench = Bench::new();
    let times: Vec<f64> = (0..5000).map(|i| f64::from(i) / 128.0).collect();
    let wild: Vec<f64> = (0..5000).map(|i| f64::from(i).sin() * 10f64.powi(i % 30 - 15)).collect();
    let mut nan = wild.clone();
    nan[17] = f64::NAN;
    let header = ["time (s)", "gyro_x (rad/s)", "gyro_y (rad/s)"].map(String::from);
    for name in ["log.csv", "log.csv.gz", "log.npy"] {
        let mut table = TableWriter::create(&bench.path(name), &header).unwrap();
        table.write(&[&times[..4000], &wild[..4000], &nan[..4000]]).unwrap();
        table.write(&[&times[4000..], &wild[4000..], &nan[4000..]]).unwrap();
        table.finish().unwrap();
        let (log, check) = input::read(&bench.path(name), &LogOptions::default()).unwrap();
        let bits = |x: &[f64]| x.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(&log.axes[0].values), bits(&wild), "{name}");
        assert_close(&log.axes[1].values, &nan, name);
        assert_eq!((check.sample_rate_hz, check.time_base), (128.0, TimeBase::Stamps), "{name}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, rng_seed: RngSeed::Fixed(1), ..ProptestConfig::default() })]

    /// A good log with bytes changed, dropped or repeated is read or refused in one line, never a panic.
    #[test]
    fn damaged_text_never_panics(cuts in prop::collection::vec((0usize..400, 0usize..40, any::<u8>(), 0u8..4), 1..6)) {
        let mut bytes = b"# log\ntime (s),gyro_x (deg/s),\"gyro, y (deg/s)\",acc_x (g)\n".to_vec();
        (0..12).for_each(|i| bytes.extend(format!("{},{},{},{}\n", 0.01 * f64::from(i), i * i, -i, 1.0).as_bytes()));
        for (at, length, byte, what) in cuts {
            let (at, end) = (at.min(bytes.len()), (at + length).min(bytes.len()));
            match what {
                0 => { bytes.drain(at..end); }
                1 => bytes[at..end].fill(byte),
                2 => bytes.insert(at, byte),
                _ => { let part = bytes[at..end].to_vec(); bytes.extend(part); }
            }
        }
        let _ = read_bytes("log.csv", &bytes, &[]);
        let _ = read_bytes("log.csv", &bytes, &[("columns", "2,3"), ("time", "1:ms"), ("unit", "rad/s")]);
    }
}
