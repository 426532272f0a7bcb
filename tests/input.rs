//! Logs in every form that is read, against what independent readers say.

use kfdesign::export::table::TableWriter;
use kfdesign::input::{self, Block, InputKind, LogOptions, LogReader};
use kfdesign::signal::check::TimeBase;
use kfdesign::signal::{Gap, LogCheck, Recording};
use kfdesign::units::{Quantity, Unit};
use proptest::prelude::*;

use super::support::{Bench, measured};

/// `--unit deg/s --rate 100 …` as the command line reads them.
fn options(flags: &[(&str, &str)]) -> LogOptions {
    let mut options = LogOptions::default();
    for (flag, value) in flags {
        match *flag {
            "columns" => options.columns = Some(value.split(',').map(str::to_string).collect()),
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

fn read_bytes(name: &str, bytes: impl AsRef<[u8]>, flags: &[(&str, &str)]) -> Result<(Recording, LogCheck), String> {
    let bench = Bench::new();
    let path = bench.file(name, bytes);
    input::read(&path, &options(flags)).map_err(|e| {
        let message = e.to_string();
        assert!(!message.contains('\n'), "{message}");
        message.replace(&path.display().to_string(), name)
    })
}

fn read(text: &str, flags: &[(&str, &str)]) -> Result<(Recording, LogCheck), String> {
    read_bytes("log.csv", text, flags)
}

fn refused(text: &str, flags: &[(&str, &str)]) -> String {
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
    let first = |flags: &[(&str, &str)]| {
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
    assert!(refusal.contains("'gyro_x (deg/s)'") && refusal.contains("without --input"), "{refusal}");
}

/// Every refusal names the file, the place, and what to do.
#[test]
fn what_is_ambiguous_or_missing_is_refused_in_one_line() {
    let both = "t_s,gyr_x_dps,gyr_y_dps\n0,1,2\n1,2,3\n";
    let table: [(&str, &[(&str, &str)], &[&str]); 23] = [
        ("t_s,gx\n0,1\n1,2\n", &[], &["line 1", "no unit for column 'gx'", "--unit"]),
        ("t_s,gx (furlongs)\n0,1\n1,2\n", &[], &["furlongs", "--unit"]),
        ("t_s,gyro_x (deg)\n0,1\n1,2\n", &[], &["'gyro_x (deg)'", "an angle", "expected", "--input"]),
        (both, &[("unit", "rad/s")], &["'gyr_x_dps'", "deg/s by its header", "--unit says rad/s"]),
        (both, &[("columns", "gyr_z")], &["no column 'gyr_z'", "1 't_s', 2 'gyr_x_dps', 3 'gyr_y_dps'"]),
        (both, &[("columns", "7")], &["no column '7'"]),
        (both, &[("columns", "2,gyr_x")], &["asked for twice"]),
        (both, &[("columns", "t_s,2"), ("unit", "deg/s")], &["'t_s'", "--unit says deg/s"]),
        ("time,gx_dps\n0,1\n1,2\n", &[], &["time column 'time' has no unit", "--time 'time:s'", "--rate"]),
        ("time (ms),gx_dps\n0,1\n1,2\n", &[("time", "time:s")], &["ms by its header", "--time says s"]),
        ("time (degC),gx_dps\n0,1\n1,2\n", &[("time", "time")], &["'time (degC)'", "expected a time"]),
        ("gx_dps\n1\n2\n", &[], &["no sample rate", "--rate"]),
        (both, &[("time", "none")], &["no sample rate"]),
        (both, &[("rate", "0")], &["--rate must be a positive number"]),
        (both, &[("start", "5"), ("end", "4")], &["--start must be before --end"]),
        (both, &[("start", "50")], &["no sample lies between --start and --end"]),
        ("t1 (s),time2 (s),gx_dps\n0,0,1\n1,1,2\n", &[("time", "t3")], &["no column 't3'"]),
        (
            "time (s),timestamp (us),gx_dps\n0,0,1\n1,1,2\n",
            &[],
            &["several columns could be the time", "'timestamp (us)'"],
        ),
        (
            "t_s,gyro1_x_dps,gyro2_x_dps\n0,1,2\n1,2,3\n",
            &[],
            &["more than one sensor", "'gyro1_x_dps', 'gyro2_x_dps'", "--columns"],
        ),
        ("t_s,pressure (hPa)\n0,1\n1,2\n", &[], &["no gyro or accelerometer column", "2 'pressure (hPa)'"]),
        ("1,2,3\n2,3,4\n", &[("rate", "1"), ("unit", "deg/s")], &["no header", "--columns"]),
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
    let nan = check.findings.iter().find(|f| f.kind == "nan").unwrap();
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
    assert!(message.contains("line 102") && message.contains("--end"), "{message}");
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

/// Files as numpy 2.4.6 wrote them (`numpy.lib.format.write_array`): dtype, version, header length, header text, data.
/// All hold the rows (1, 10), (-2, 12), (3, -11), (4, 13), without the signs if the type has none.
const WRITTEN_BY_NUMPY: [(&str, u8, usize, &str, &str); 23] = [
    (
        "<f8",
        1,
        118,
        "{'descr': '<f8', 'fortran_order': False, 'shape': (4, 2), }",
        "000000000000f03f000000000000244000000000000000c00000000000002840000000000000084000000000000026c000000000000010400000000000002a40",
    ),
    (
        ">f8",
        1,
        118,
        "{'descr': '>f8', 'fortran_order': False, 'shape': (4, 2), }",
        "3ff00000000000004024000000000000c00000000000000040280000000000004008000000000000c0260000000000004010000000000000402a000000000000",
    ),
    (
        "<f4",
        1,
        118,
        "{'descr': '<f4', 'fortran_order': False, 'shape': (4, 2), }",
        "0000803f00002041000000c00000404100004040000030c10000804000005041",
    ),
    (
        ">f4",
        1,
        118,
        "{'descr': '>f4', 'fortran_order': False, 'shape': (4, 2), }",
        "3f80000041200000c00000004140000040400000c13000004080000041500000",
    ),
    ("<f2", 1, 118, "{'descr': '<f2', 'fortran_order': False, 'shape': (4, 2), }", "003c004900c0004a004280c90044804a"),
    ("|i1", 1, 118, "{'descr': '|i1', 'fortran_order': False, 'shape': (4, 2), }", "010afe0c03f5040d"),
    ("<i2", 1, 118, "{'descr': '<i2', 'fortran_order': False, 'shape': (4, 2), }", "01000a00feff0c000300f5ff04000d00"),
    (">i2", 1, 118, "{'descr': '>i2', 'fortran_order': False, 'shape': (4, 2), }", "0001000afffe000c0003fff50004000d"),
    (
        "<i4",
        1,
        118,
        "{'descr': '<i4', 'fortran_order': False, 'shape': (4, 2), }",
        "010000000a000000feffffff0c00000003000000f5ffffff040000000d000000",
    ),
    (
        ">i4",
        1,
        118,
        "{'descr': '>i4', 'fortran_order': False, 'shape': (4, 2), }",
        "000000010000000afffffffe0000000c00000003fffffff5000000040000000d",
    ),
    (
        "<i8",
        1,
        118,
        "{'descr': '<i8', 'fortran_order': False, 'shape': (4, 2), }",
        "01000000000000000a00000000000000feffffffffffffff0c000000000000000300000000000000f5ffffffffffffff04000000000000000d00000000000000",
    ),
    (
        ">i8",
        1,
        118,
        "{'descr': '>i8', 'fortran_order': False, 'shape': (4, 2), }",
        "0000000000000001000000000000000afffffffffffffffe000000000000000c0000000000000003fffffffffffffff50000000000000004000000000000000d",
    ),
    ("|u1", 1, 118, "{'descr': '|u1', 'fortran_order': False, 'shape': (4, 2), }", "010a020c030b040d"),
    ("<u2", 1, 118, "{'descr': '<u2', 'fortran_order': False, 'shape': (4, 2), }", "01000a0002000c0003000b0004000d00"),
    (
        ">u4",
        1,
        118,
        "{'descr': '>u4', 'fortran_order': False, 'shape': (4, 2), }",
        "000000010000000a000000020000000c000000030000000b000000040000000d",
    ),
    (
        "<u8",
        1,
        118,
        "{'descr': '<u8', 'fortran_order': False, 'shape': (4, 2), }",
        "01000000000000000a0000000000000002000000000000000c0000000000000003000000000000000b0000000000000004000000000000000d00000000000000",
    ),
    (
        ">u8",
        1,
        118,
        "{'descr': '>u8', 'fortran_order': False, 'shape': (4, 2), }",
        "0000000000000001000000000000000a0000000000000002000000000000000c0000000000000003000000000000000b0000000000000004000000000000000d",
    ),
    (
        "fortran f8",
        1,
        118,
        "{'descr': '<f8', 'fortran_order': True, 'shape': (4, 2), }",
        "000000000000f03f00000000000000c0000000000000084000000000000010400000000000002440000000000000284000000000000026c00000000000002a40",
    ),
    (
        "fortran i2",
        1,
        118,
        "{'descr': '<i2', 'fortran_order': True, 'shape': (4, 2), }",
        "0100feff030004000a000c00f5ff0d00",
    ),
    (
        "version 2",
        2,
        116,
        "{'descr': '<i2', 'fortran_order': False, 'shape': (4, 2), }",
        "01000a00feff0c000300f5ff04000d00",
    ),
    (
        "structured",
        1,
        182,
        "{'descr': [('time (s)', '<f8'), ('gyro_x (deg/s)', '<f4'), ('gyro_y (deg/s)', '>i2')], 'fortran_order': False, 'shape': (4,), }",
        "00000000000000000000803f000a7b14ae47e17a843f000000c0000c7b14ae47e17a943f00004040fff5b81e85eb51b89e3f00008040000d",
    ),
    (
        "datetime",
        1,
        182,
        "{'descr': [('t', '<M8[ns]'), ('label', '|S3'), ('gyr', '<f4', (2,))], 'fortran_order': False, 'shape': (4,), }",
        "0000a0d8855734166162000000803f00002041809638d985573416616200000000c000004041002dd1d98557341661620000004040000030c181c369da855734166162000000804000005041",
    ),
    (
        "aligned unicode",
        3,
        180,
        "{'descr': [('flag', '|u1'), ('', '|V7'), ('ωx', '<f8'), ('ωy', '<f8')], 'fortran_order': False, 'shape': (4,), }",
        "0000000000000000000000000000f03f0000000000002440000000000000000000000000000000c000000000000028400000000000000000000000000000084000000000000026c0000000000000000000000000000010400000000000002a40",
    ),
];

fn unhex(hex: &str) -> Vec<u8> {
    (0..hex.len() / 2).map(|i| u8::from_str_radix(&hex[2 * i..2 * i + 2], 16).unwrap()).collect()
}

fn npy(version: u8, length: usize, header: &str, data: &[u8]) -> Vec<u8> {
    let mut bytes = b"\x93NUMPY".to_vec();
    bytes.extend([version, 0]);
    let little = (length as u32).to_le_bytes();
    bytes.extend(&little[..if version == 1 { 2 } else { 4 }]);
    bytes.extend(header.as_bytes());
    bytes.extend(std::iter::repeat_n(b' ', length - 1 - header.len()));
    bytes.push(b'\n');
    bytes.extend(data);
    bytes
}

#[test]
fn npy_files_of_numpy_are_read_in_every_type_order_and_version() {
    // one file byte for byte, so that `npy` above is known to assemble what numpy writes
    let whole = "934e554d5059010076007b276465736372273a20273c6932272c2027666f727472616e5f6f72646572273a2046616c73652c20277368617065273a2028342c2032292c207d202020202020202020202020202020202020202020202020202020202020202020202020202020202020202020202020202020202020202020200a01000a00feff0c000300f5ff04000d00";
    let (_, version, length, header, data) = WRITTEN_BY_NUMPY.iter().find(|w| w.0 == "<i2").unwrap();
    assert_eq!(npy(*version, *length, header, &unhex(data)), unhex(whole));
    for (kind, version, length, header, data) in WRITTEN_BY_NUMPY {
        let bytes = npy(version, length, header, &unhex(data));
        let named = ["structured", "datetime", "aligned unicode"].contains(&kind);
        let flags: &[(&str, &str)] = match kind {
            "structured" => &[],
            "datetime" => &[("unit", "deg/s")],
            "aligned unicode" => &[("columns", "ωx,ωy"), ("unit", "deg/s"), ("rate", "100")],
            _ => &[("columns", "1,2"), ("unit", "deg/s"), ("rate", "100")],
        };
        let (log, check) = read_bytes("log.npy", bytes, flags).unwrap_or_else(|e| panic!("{kind}: {e}"));
        let unsigned = kind.contains('u') && kind.len() == 3;
        let sign = |x: f64| if unsigned { x.abs() } else { x };
        assert_close(&shown(&log, 0), &[1.0, -2.0, 3.0, 4.0].map(sign), kind);
        assert_close(&shown(&log, 1), &[10.0, 12.0, -11.0, 13.0].map(sign), kind);
        assert!((check.sample_rate_hz - 100.0).abs() < 0.01, "{kind}: {}", check.sample_rate_hz);
        assert_eq!(log.axes[0].name.starts_with("column"), !named, "{kind}");
        if kind == "datetime" {
            assert!((log.start_s - 1.6e9).abs() < 1e-6);
            assert_eq!(log.axes[1].name, "gyr[1]");
        }
    }
}

#[test]
fn npy_files_that_cannot_be_trusted_are_refused_before_anything_is_allocated() {
    let plain = "{'descr': '<f8', 'fortran_order': False, 'shape': (4, 2), }";
    let good = npy(1, 118, plain, &[0; 64]);
    let shape = |shape: &str| npy(1, 118, &plain.replace("(4, 2)", shape), &[0; 64]);
    let dtype = |dtype: &str| npy(1, 118, &plain.replace("'<f8'", dtype), &[0; 64]);
    let table: [(&str, Vec<u8>, &str); 20] = [
        ("cut data", good[..good.len() - 5].to_vec(), "truncated: 4 rows are declared, but the file holds only 3"),
        ("cut header", good[..60].to_vec(), "truncated"),
        ("cut magic", good[..4].to_vec(), "npy"),
        ("empty", Vec::new(), "empty"),
        ("data behind", [good.clone(), vec![0; 8]].concat(), "8 bytes follow the array"),
        ("huge shape", shape("(100000000000000, 2)"), "truncated: 100000000000000 rows are declared"),
        ("overflowing shape", shape("(99999999999999999999999, 9)"), "truncated"),
        ("no rows", npy(1, 118, &plain.replace("(4, 2)", "(0, 2)"), &[]), "no rows"),
        ("no columns", npy(1, 118, &plain.replace("(4, 2)", "(4, 0)"), &[]), "no columns"),
        ("three dimensions", shape("(2, 2, 2)"), "3 dimensions"),
        ("no dimension", shape("()"), "0 dimensions"),
        ("objects", dtype("'|O'"), "Python objects"),
        ("object field", dtype("[('a', '|O'), ('b', '<f8')]"), "'a' holds Python objects"),
        ("complex", dtype("'<c16'"), "dtype '<c16'"),
        ("long double", dtype("'<f16'"), "dtype '<f16'"),
        ("text", dtype("'<U4'"), "dtype '<U4'"),
        ("nested", dtype("[('a', [('b', '<f8')])]"), "structure itself"),
        ("no dictionary", npy(1, 118, "exit()", &[0; 64]), "damaged"),
        ("pickle", b"\x80\x04\x95\x16\x00\x00\x00\x00\x00\x00\x00]\x94(K\x01K\x02e.".to_vec(), "pickle"),
        ("zip", b"PK\x03\x04________________".to_vec(), "npz"),
    ];
    for (what, bytes, words) in table {
        let flags = [("columns", "1"), ("unit", "deg/s"), ("rate", "100")];
        let message = read_bytes("log.npy", bytes, &flags).unwrap_err();
        assert!(message.starts_with("log.npy: ") && message.contains(words), "{what}: {message}");
    }
    let wide = npy(1, 118, &plain.replace("(4, 2)", "(1, 5000)").replace("<f8", "|i1"), &[0; 5000]);
    assert!(read_bytes("log.npy", wide, &[]).unwrap_err().contains("save the transpose"));
}

/// A measured log: path, flags, samples, rate in Hz, first and last value and mean of each axis in the log's unit.
struct Measured {
    path: &'static str,
    flags: &'static [(&'static str, &'static str)],
    samples: u64,
    rate_hz: f64,
    base: TimeBase,
    missing: u64,
    axes: &'static [[f64; 3]],
}

/// Values by pandas 3.1.1 (`read_csv`, `float_precision="round_trip"`) and numpy 2.4.6; rates of burst stamps by
/// `numpy.polyfit` of stamp on row, of even stamps by (n − 1 + missing) / (last − first).
#[test]
fn measured_logs_agree_with_an_independent_reader() {
    const LSB: &[(&str, &str)] = &[("unit", "1/131 deg/s"), ("rate", "100"), ("columns", "gx,gy,gz")];
    use TimeBase::{Given, MeanRate, Stamps};
    let logs = [
        Measured {
            path: "static/SMAC-Group_imudata/adis16405_recording1.csv.gz",
            flags: &[("rate", "100")],
            samples: 1_000_000,
            rate_hz: 100.0,
            base: Given,
            missing: 0,
            axes: &[[-0.05, 0.35, 0.40168645000000003], [-0.3, -0.2, -0.41584855], [0.7, -0.45, -0.2935425]],
        },
        Measured {
            path: "static/sunsided_sensor-fusion/derived/set-2_unmoved-with-x-pointing-forward-10min.csv.gz",
            flags: &[],
            samples: 65_067,
            rate_hz: 99.29737148399346,
            base: MeanRate,
            missing: 0,
            axes: &[
                [4.770992, 4.648855, 4.5353241819816486],
                [0.129771, 0.129771, 0.04732456265080609],
                [1.198473, 1.076336, 1.122113361135445],
            ],
        },
        Measured {
            path: "static/sunsided_sensor-fusion/derived/set-2_unmoved-with-x-pointing-forward.csv.gz",
            flags: &[],
            samples: 12_243,
            rate_hz: 99.27439574178054,
            base: MeanRate,
            missing: 0,
            axes: &[
                [4.557252, 4.480916, 4.5312635376950094],
                [0.259542, -0.129771, 0.046462448011108395],
                [1.244275, 1.229008, 1.1216404785591767],
            ],
        },
        Measured {
            path: "static/sunsided_sensor-fusion/derived/set-1_unmoved-z-pointing-left.csv.gz",
            flags: &[("end", "62.49")],
            samples: 6267,
            rate_hz: 99.99844503213426,
            base: MeanRate,
            missing: 0,
            axes: &[
                [4.427481, 4.770992, 4.601435835008776],
                [0.396947, 0.038168, 0.09205373496090634],
                [0.969466, 0.839695, 1.061870187649593],
            ],
        },
        Measured {
            path: "static/tomisuarez2_ImuCalibration/example_data_tinit_calc.csv",
            flags: LSB,
            samples: 44_930,
            rate_hz: 100.0,
            base: Given,
            missing: 0,
            axes: &[
                [-429.0, -444.0, -438.1799020698865],
                [140.0, 145.0, 142.67765412864455],
                [-53.0, -57.0, -65.1921655909192],
            ],
        },
        Measured {
            path: "motion/tomisuarez2_ImuCalibration/imu_90_x_rot.csv",
            flags: LSB,
            samples: 9987,
            rate_hz: 100.0,
            base: Given,
            missing: 0,
            axes: &[
                [-449.0, -410.0, -310.7469710623811],
                [166.0, 142.0, 167.24632021628116],
                [-68.0, -71.0, -53.432161810353456],
            ],
        },
        Measured {
            path: "static/UniStuttgart-INS_INSTINCT/vn310-imu.csv",
            flags: &[
                ("columns", "IMU::UncompGyro::X,IMU::UncompGyro::Y,IMU::UncompGyro::Z"),
                ("time", "Time::TimeStartup"),
            ],
            samples: 690,
            rate_hz: 19.999999419448493,
            base: Stamps,
            missing: 0,
            axes: &[
                [0.00098896597, -0.0011074031, 0.0005629478741337681],
                [0.00062227203, 0.0014884394, 0.0011374607511449276],
                [0.00075652631, 0.00018814803, 0.0002710076916818116],
            ],
        },
        Measured {
            path: "formats/text/ansfl_Xsens_DOT1_20220707_111110.csv",
            flags: &[("time", "SampleTimeFine:us"), ("unit", "deg/s")],
            samples: 6796,
            rate_hz: 120.00480019200768,
            base: Stamps,
            missing: 0,
            axes: &[
                [0.0, -3.069584846, -0.7413169780244555],
                [0.0, -8.462021828, -0.4701269841060917],
                [0.0, -3.029447079, -0.524579433983814],
            ],
        },
        Measured {
            path: "formats/text/skinematics_data_ngimu_sensors.csv",
            flags: &[],
            samples: 499,
            rate_hz: 49.91204764059886,
            base: Stamps,
            missing: 0,
            axes: &[
                [-4.378757, -0.02841978, 0.8143928960721443],
                [-0.2601407, -0.1991192, 0.22235524328657325],
                [-0.002004489, 0.240073, -1.347745190623247],
            ],
        },
        Measured {
            path: "formats/text/skinematics_data_polulu.txt",
            flags: &[("columns", "4,5,6"), ("rate", "50"), ("unit", "0.061 deg/s")],
            samples: 3653,
            rate_hz: 50.0,
            base: Given,
            missing: 0,
            axes: &[
                [296.0, -6.0, 228.9124007664933],
                [-415.0, -207.0, -342.6830002737476],
                [-340.0, -297.0, 564.3851628798247],
            ],
        },
        Measured {
            path: "formats/text/skinematics_data_xio3_Inertial.csv",
            flags: &[],
            samples: 500,
            rate_hz: 49.91478475924553,
            base: Stamps,
            missing: 0,
            axes: &[
                [0.032334, 40.442493, 4.885746064000001],
                [0.119268, -304.240845, 5.9516082620000015],
                [0.027162, -40.741676, 9.780581334000003],
            ],
        },
        Measured {
            path: "formats/text/skinematics_data_xsens.txt",
            flags: &[("rate", "50"), ("unit", "rad/s")],
            samples: 953,
            rate_hz: 50.0,
            base: Given,
            missing: 0,
            axes: &[
                [0.059158, -0.201842, 0.037955020986358876],
                [-0.030138, -0.015377, 0.014535544596012619],
                [0.05086, 0.13159, 0.09629486883525709],
            ],
        },
        Measured {
            path: "formats/text/skinematics_data_yei.txt",
            flags: &[("unit", "rad/s")],
            samples: 2715,
            rate_hz: 109.95457142207765,
            base: Stamps,
            missing: 0,
            axes: &[
                [0.0, -0.004654074553400278, 0.0009188154383869515],
                [-0.0011635186383500695, 0.0, -0.25677077735432907],
                [0.008144630119204521, 0.010471668094396591, 0.25878454446175153],
            ],
        },
        Measured {
            path: "formats/euroc/mav0/imu0/data.csv",
            flags: &[],
            samples: 17_142,
            rate_hz: 1e9 / 3_500_000.0,
            base: Stamps,
            missing: 0,
            axes: &[
                [0.003195697860401618, -0.3291760782431385, 0.0032161038158726707],
                [0.002131047016685076, -0.22584211454956224, 0.012537942986361718],
                [-0.0042603487041181585, 0.4538170214450616, 0.12065732458580411],
            ],
        },
        Measured {
            path: "motion/dlaidig_broad/derived/05_undisturbed_slow_rotation_with_breaks_B.csv.gz",
            flags: &[],
            samples: 59_212,
            rate_hz: 285.7142857142857,
            base: Stamps,
            missing: 0,
            axes: &[
                [0.003195698, 0.002131047, 0.005520843215074649],
                [0.002131047, 0.001064651, 0.006004145431939466],
                [-0.004260349, -0.003195698, 0.034105842918918466],
            ],
        },
        Measured {
            path: "motion/xioTechnologies_Fusion/sensor_data.csv",
            flags: &[],
            samples: 13_514,
            // ten steps of 30.2 ms among steps of 10.1 ms: two samples missing in each
            rate_hz: 13_533.0 / 135.326642,
            base: Stamps,
            missing: 20,
            axes: &[
                [0.01644619, -0.2306165, -0.11584868282077852],
                [-0.1517251, 0.03039645, -0.26859208456637573],
                [0.1080897, 0.05691325, 7.970623540672635],
            ],
        },
        Measured {
            path: "motion/mad-lab-fau_imucal/example_ferraris_session.csv",
            flags: &[("rate", "102.4"), ("unit", "deg/s")],
            samples: 10_376,
            rate_hz: 102.4,
            base: Given,
            missing: 0,
            axes: &[
                [-0.6103515625, -0.54931640625, -3.318627797923092],
                [-0.30517578125, -0.30517578125, -2.640229330305513],
                [0.06103515625, 0.18310546875, -3.2556632342665766],
            ],
        },
        Measured {
            path: "motion/mikoff_imu-calib/imu0.log",
            flags: &[("columns", "4,5,6"), ("unit", "rad/s"), ("rate", "100")],
            samples: 15_969,
            rate_hz: 100.0,
            base: Given,
            missing: 0,
            axes: &[
                [0.03515, 0.01917, 0.061464067255307155],
                [0.00213, -0.00639, 0.017616164443609493],
                [0.04155, 0.02237, 0.00741754023420377],
            ],
        },
        Measured {
            path: "motion/Kyle-ak_imu_tk/xsens_gyro.mat",
            flags: &[("columns", "2,3,4"), ("time", "1:s"), ("unit", "1/6258 rad/s")],
            samples: 51_175,
            rate_hz: 100.01013117051603,
            base: Stamps,
            missing: 0,
            axes: &[
                [32786.0, 48789.0, 32715.502784562774],
                [32429.0, 17563.0, 32374.031656082072],
                [32499.0, 13676.0, 32522.153571079627],
            ],
        },
    ];
    for log in logs {
        let Some(path) = measured(log.path) else { return };
        let (recording, check) = input::read(&path, &options(log.flags)).unwrap_or_else(|e| panic!("{e}"));
        let name = log.path;
        assert_eq!((check.samples, check.time_base, check.missing), (log.samples, log.base, log.missing), "{name}");
        let off = (check.sample_rate_hz / log.rate_hz - 1.0).abs();
        // the rate around gaps is that of the steps outside them
        assert!(off < if log.missing > 0 { 5e-5 } else { 1e-9 }, "{name}: {} Hz", check.sample_rate_hz);
        for (axis, [first, last, mean]) in log.axes.iter().enumerate() {
            let x = shown(&recording, axis);
            assert_close(&[x[0], x[x.len() - 1]], &[*first, *last], name);
            let found = x.iter().sum::<f64>() / x.len() as f64;
            assert!((found - mean).abs() < 1e-9 * x.iter().map(|v| v.abs()).fold(0.0, f64::max), "{name}: {found}");
        }
    }
}

/// What the source pages of the logs say about their defects.
#[test]
fn the_check_finds_the_known_defects_of_measured_logs() {
    let found = |path: &str, flags: &[(&str, &str)]| {
        measured(path).map(|p| input::read(&p, &options(flags)).unwrap().1.findings)
    };
    let set1 = "static/sunsided_sensor-fusion/derived/set-1_unmoved-z-pointing-left.csv.gz";
    let Some(findings) = found(set1, &[("rate", "100")]) else { return };
    let zero = findings.iter().find(|f| f.kind == "zero-row").unwrap();
    assert_eq!((zero.count, zero.first_index, zero.serious), (720, 6280, true));
    assert!(findings.iter().any(|f| f.kind == "backward-stamp" && f.count == 1 && f.first_index == 6280));
    let lsb: &[(&str, &str)] = &[("unit", "1/131 deg/s"), ("rate", "100"), ("columns", "gx,gy,gz")];
    let findings = found("motion/tomisuarez2_ImuCalibration/example_data_calibration.csv", lsb).unwrap();
    // ten samples at -32768, the end of 16 bits
    assert!(findings.iter().any(|f| f.kind == "saturated" && f.count == 10 && f.axis.as_deref() == Some("gx")));
    assert!(findings.iter().any(|f| f.kind == "motion" && f.serious));
    let adis = found("static/SMAC-Group_imudata/adis16405_recording1.csv.gz", &[("rate", "100")]).unwrap();
    assert!(adis.iter().all(|f| f.kind == "quantised" && !f.serious) && adis.len() == 3, "{adis:?}");
    assert!(adis[0].message.contains("0.05 deg/s"), "{}", adis[0].message);
    let ten =
        found("static/sunsided_sensor-fusion/derived/set-2_unmoved-with-x-pointing-forward-10min.csv.gz", &[]).unwrap();
    let kinds: Vec<&str> = ten.iter().map(|f| f.kind.as_str()).collect();
    assert_eq!(kinds, ["jitter", "quantised", "quantised", "quantised"]);
}

/// Logs that are refused, each for a reason that it names.
#[test]
fn measured_logs_that_are_refused_say_why() {
    let gyro: &[(&str, &str)] =
        &[("columns", "IMU::UncompGyro::X,IMU::UncompGyro::Y,IMU::UncompGyro::Z"), ("time", "Time::TimeStartup")];
    let table: [(&str, &[(&str, &str)], &str); 6] = [
        ("static/UniStuttgart-INS_INSTINCT/2023-08-15_Multi-IMU_static60s.txt", &[], "no header names the 12 columns"),
        ("static/UniStuttgart-INS_INSTINCT/vn310-imu.csv", &[], "'IMU::AngularRate::X'"),
        (
            "formats/vectornav/vn310-imu.csv",
            gyro,
            "line 20: 5 fields where 53 are expected (the file ends inside this line",
        ),
        ("formats/text/skinematics_data_xsens.txt", &[], "the header gives no unit for column 'Gyr_X'"),
        (
            "static/sunsided_sensor-fusion/derived/set-1_unmoved-z-pointing-left.csv.gz",
            &[],
            "line 6282: time goes back",
        ),
        ("formats/ulog/pyulog_sample.ulg", &[], "this is a PX4 ULog"),
    ];
    for (path, flags, words) in table {
        let Some(path) = measured(path) else { return };
        let message = input::read(&path, &options(flags)).unwrap_err().to_string();
        assert!(message.contains(words), "{message}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]

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

    #[test]
    fn damaged_npy_never_panics(cuts in prop::collection::vec((0usize..300, any::<u8>()), 1..8), length in 0usize..300) {
        let header = "{'descr': [('time (s)', '<f8'), ('gyr', '<f4', (2,))], 'fortran_order': False, 'shape': (6,), }";
        let mut bytes = npy(1, 118, header, &[7; 96]);
        for (at, byte) in cuts {
            let at = at % bytes.len();
            bytes[at] = byte;
        }
        bytes.truncate(length.max(6));
        let _ = read_bytes("log.npy", &bytes, &[]);
        let _ = read_bytes("log.npy", &bytes, &[("columns", "1"), ("rate", "1"), ("unit", "deg/s")]);
    }
}
