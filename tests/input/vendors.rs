//! Headers as vendors' programs and phone apps write them; the rows below are made here. Measured exports are in
//! `measured`.

use super::{Flags, read, refused};
use kfdesign::signal::check::FindingKind;

/// A header and so many rows: the first column k × step, in the others k + column.
fn export(header: &str, separator: char, step: f64) -> String {
    let columns = header.lines().next_back().unwrap_or(header).trim_end_matches(separator).split(separator).count();
    let rows = (0..60).map(|k| {
        let first = format!("{}", step * f64::from(k));
        let others = (1..columns).map(|c| format!("{}", (k * (c as i32 + 3)) % 17 + c as i32));
        let cells: Vec<String> = [first].into_iter().chain(others).collect();
        cells.join(&separator.to_string()) + "\n"
    });
    format!("{header}\n{}", rows.collect::<String>())
}

/// A header, its separator and the step of the first column; flags; names of the axes, rate in Hz, and what says the
/// rate.
struct Export {
    text: String,
    flags: Flags<'static>,
    axes: [&'static str; 3],
    rate_hz: f64,
    by: Option<&'static str>,
}

#[test]
fn exports_are_read_by_their_headers() {
    let xsens = "// Start Time: Unknown\n// Update Rate: 100.0Hz\n// Filter Profile: human (46.1)\n// Option Flags: AHS Disabled ICC Disabled\n\
                 // Firmware Version: 4.0.2\nPacketCounter\tSampleTimeFine\tAcc_X\tAcc_Y\tAcc_Z\tGyr_X\tGyr_Y\tGyr_Z";
    let phyphox =
        "\"Time (s)\",\"Gyroscope x (rad/s)\",\"Gyroscope y (rad/s)\",\"Gyroscope z (rad/s)\",\"Absolute (rad/s)\"";
    let sensor_log = "gyroTimestamp_sinceReboot(s),loggingSample(N),accelerometerTimestamp_sinceReboot(s),accelerometerAccelerationX(G),accelerometerAccelerationY(G),\
                      accelerometerAccelerationZ(G),gyroRotationX(rad/s),gyroRotationY(rad/s),gyroRotationZ(rad/s)";
    let androsensor = "Time since start in ms ;ACCELEROMETER X (m/s²);ACCELEROMETER Y (m/s²);ACCELEROMETER Z (m/s²);GYROSCOPE X (rad/s);\
                       GYROSCOPE Y (rad/s);GYROSCOPE Z (rad/s);LIGHT (lux)";
    let x_imu = "Packet number,Gyroscope X (deg/s),Gyroscope Y (deg/s),Gyroscope Z (deg/s),Accelerometer X (g),Accelerometer Y (g),Accelerometer Z (g)";
    let sensor_logger = "seconds_elapsed,time,z,y,x";
    let blackbox = "time (us),loopIteration,gyroADC[0],gyroADC[1],gyroADC[2],accSmooth[0],accSmooth[1],accSmooth[2]";
    let exports = [
        Export {
            text: export(xsens, '\t', 1.0),
            flags: &[("unit", "rad/s"), ("time", "none")],
            axes: ["Gyr_X", "Gyr_Y", "Gyr_Z"],
            rate_hz: 100.0,
            by: Some("100 Hz by 'Update Rate' of the file"),
        },
        Export {
            text: export(phyphox, ',', 0.01),
            flags: &[],
            axes: ["Gyroscope x", "Gyroscope y", "Gyroscope z"],
            rate_hz: 100.0,
            by: None,
        },
        Export {
            text: export(sensor_log, ',', 0.02),
            flags: &[("time", "gyroTimestamp_sinceReboot")],
            axes: ["gyroRotationX", "gyroRotationY", "gyroRotationZ"],
            rate_hz: 50.0,
            by: None,
        },
        Export {
            text: export(androsensor, ';', 5.0),
            flags: &[],
            axes: ["GYROSCOPE X", "GYROSCOPE Y", "GYROSCOPE Z"],
            rate_hz: 200.0,
            by: None,
        },
        Export {
            text: export(x_imu, ',', 1.0),
            flags: &[("rate", "256")],
            axes: ["Gyroscope X", "Gyroscope Y", "Gyroscope Z"],
            rate_hz: 256.0,
            by: None,
        },
        Export {
            text: export(sensor_logger, ',', 0.01),
            flags: &[("columns", "x,y,z"), ("unit", "rad/s"), ("time", "seconds_elapsed:s")],
            axes: ["x", "y", "z"],
            rate_hz: 100.0,
            by: None,
        },
        Export {
            text: export(blackbox, ',', 500.0),
            flags: &[("unit", "deg/s")],
            axes: ["gyroADC[0]", "gyroADC[1]", "gyroADC[2]"],
            rate_hz: 2000.0,
            by: None,
        },
    ];
    for Export { text, flags, axes, rate_hz, by } in exports {
        let (log, check) = read(&text, flags).unwrap_or_else(|message| panic!("{message}\n{text}"));
        let names: Vec<&str> = log.axes.iter().map(|axis| axis.name.as_str()).collect();
        assert_eq!(names, axes);
        assert!((log.sample_rate_hz / rate_hz - 1.0).abs() < 1e-9, "{} Hz: {text}", log.sample_rate_hz);
        let said = check
            .findings
            .iter()
            .find(|finding| finding.kind == FindingKind::Rate)
            .map(|finding| finding.message.as_str());
        assert_eq!(said, by);
    }
    // the unit is asked for first, then what the stamps are
    assert!(refused(&export(xsens, '\t', 1.0), &[]).contains("no unit for column 'Gyr_X'; say it with `unit`"));
    let message = refused(&export(xsens, '\t', 1.0), &[("unit", "rad/s")]);
    assert!(
        message.contains("'SampleTimeFine' has no unit")
            && message.ends_with("100 Hz that the file says with `time` none"),
        "{message}"
    );
}

/// A rate is taken only in hertz and under a name that says it; the stamps come before it.
#[test]
fn a_rate_in_the_header_is_no_guess() {
    let rows = "gx (deg/s),gy (deg/s),gz (deg/s)\n1,2,3\n3,4,4\n5,7,9\n";
    for line in [
        "# Sample rate: 50",
        "# Bandwidth: 50 Hz",
        "# Sample rate: fast",
        "# Sample rate: -50 Hz",
        "Sample rate: 1e999 Hz",
    ] {
        assert!(refused(&format!("{line}\n{rows}"), &[]).contains("no sample rate"), "{line}");
    }
    for line in
        ["# Sample rate: 50 Hz", "% sampling_frequency = 50Hz", "Sample Rate (Hz),50", "// Output Data Rate:\t50 hz"]
    {
        let (log, _) = read(&format!("{line}\n{rows}"), &[]).unwrap_or_else(|message| panic!("{line}: {message}"));
        assert_eq!((log.sample_rate_hz, log.len()), (50.0, 3), "{line}");
    }
    let stamped = "# Sample rate: 50 Hz\ntime (s),gx (deg/s)\n0,1\n0.01,2\n0.02,4\n";
    assert!((read(stamped, &[]).unwrap().0.sample_rate_hz - 100.0).abs() < 1e-9);
    let (log, _) = read(&format!("# Sample rate: 50 Hz\n{rows}"), &[("rate", "25")]).unwrap();
    assert_eq!(log.sample_rate_hz, 25.0);
}
