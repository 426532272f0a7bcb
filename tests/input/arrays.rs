//! MATLAB and HDF5 files: small ones written by SciPy 1.17.1 and h5py 3.16.0 (`written/write.py` says what is in
//! them), and measured ones.

use super::measured::Independent;
use super::{Flags, assert_close, damage, read_bytes, shown};
use kfdesign::signal::check::FindingKind;

const WRITTEN: [(&str, &[u8]); 4] = [
    ("level5.mat", include_bytes!("written/level5.mat")),
    ("level5-compressed.mat", include_bytes!("written/level5-compressed.mat")),
    ("earliest.h5", include_bytes!("written/earliest.h5")),
    ("latest.h5", include_bytes!("written/latest.h5")),
];

/// Column k as `write.py` makes it.
fn column(k: usize, rows: usize) -> Vec<f64> {
    (0..rows).map(|i| 0.5 * i as f64 + 10.0 * k as f64 - 3.0).collect()
}

#[test]
fn every_written_form_gives_the_same_numbers() {
    for (name, bytes) in WRITTEN {
        let mat = name.ends_with("mat");
        let flags: &[Flags] = match mat {
            true => &[&[("unit", "deg/s"), ("time", "t:ms")], &[("unit", "deg/s"), ("time", "none")]],
            false => &[&[("time", "stamp:ns")], &[("time", "none")], &[("unit", "deg/s"), ("time", "none")]],
        };
        for flags in flags {
            let (log, check) = read_bytes(name, bytes, flags).unwrap();
            assert_eq!((log.len(), log.axes.len()), (40, 3), "{name}");
            // "sampling_rate", or the stamps
            assert!((log.sample_rate_hz - 100.0).abs() < 1e-9, "{name}: {}", log.sample_rate_hz);
            assert_eq!(
                check.findings.iter().any(|f| f.kind == FindingKind::Rate),
                flags.last() == Some(&("time", "none"))
            );
            for axis in 0..3 {
                assert_close(&shown(&log, axis), &column(axis, 40), name);
                let sensor = if mat { "gyr" } else { "gyro" };
                assert_eq!(log.axes[axis].name, format!("{sensor}_{}", ["x", "y", "z"][axis]));
            }
        }
        // the other sensor is stored across, or as big-endian single precision
        let accel: Flags = match mat {
            true => &[("sensor", "accel"), ("unit", "m/s^2"), ("time", "none")],
            false => &[("sensor", "accel"), ("time", "none")],
        };
        let (log, _) = read_bytes(name, bytes, accel).unwrap();
        assert_close(&shown(&log, 2), &column(2, 40), name);
    }
}

#[test]
fn nanoseconds_since_1970_keep_every_digit() {
    let (log, _) = read_bytes("earliest.h5", WRITTEN[2].1, &[("time", "stamp:ns")]).unwrap();
    assert_eq!(log.start_s, 1.6e9);
    assert_eq!(log.sample_rate_hz, 100.0);
}

#[test]
fn structures_groups_and_records_are_topics() {
    for (name, bytes) in &WRITTEN[..2] {
        let (log, check) = read_bytes(name, bytes, &[("topic", "imu.omega"), ("unit", "rad/s")]).unwrap();
        assert_eq!((log.len(), log.axes[1].name.as_str()), (30, "omega_y"), "{name}");
        assert_close(&shown(&log, 1), &column(1, 30), name);
        assert!(!check.findings.iter().any(|f| f.kind == FindingKind::Topic));
        let quaternion: Flags = &[("topic", "imu.part.q"), ("unit", "rad/s"), ("columns", "q_w,q_z")];
        assert_close(&shown(&read_bytes(name, bytes, quaternion).unwrap().0, 1), &column(3, 30), name);
        // without the flag the longest table with a gyro, and it is said
        let (log, check) = read_bytes(name, bytes, &[("unit", "rad/s"), ("time", "none")]).unwrap();
        assert_eq!(log.len(), 40);
        let note = check.findings.iter().find(|f| f.kind == FindingKind::Topic).unwrap();
        assert!(note.message.contains("imu.omega (30 rows)"), "{}", note.message);
    }
    for (name, bytes) in &WRITTEN[2..] {
        let (log, _) = read_bytes(name, bytes, &[("topic", "other/log")]).unwrap();
        assert_eq!((log.len(), log.axes.len(), log.axes[0].unit.to_string().as_str()), (30, 1, "deg/s"));
        assert_close(&shown(&log, 0), &column(0, 30), name);
    }
}

#[test]
fn what_is_meant_is_never_guessed() {
    let refused = |name: &str, bytes: &[u8], flags: Flags| read_bytes(name, bytes, flags).map(|_| ()).unwrap_err();
    let (name, bytes) = WRITTEN[0];
    let message = refused(name, bytes, &[("time", "none")]);
    assert_eq!(
        message,
        format!("{name}: the header gives no unit for column 'gyr_x'; say it with `unit`, for example `unit` deg/s")
    );
    let message = refused(name, bytes, &[("topic", "nix")]);
    assert!(message.starts_with(&format!("{name}: no topic 'nix'; there are gyr (40 rows: gyr_x gyr_y gyr_z accT_x")));
    assert!(refused(name, bytes, &[("unit", "deg/s")]).contains("time column 't' has no unit"));
    assert!(refused(name, bytes, &[("columns", "none_such")]).contains("no topic has the columns none_such; choose"));
    let npy = b"time (s),gyro_x (deg/s)\n0,1\n1,2\n";
    assert!(refused("log.csv", npy, &[("topic", "gyr")]).contains("`topic` gyr: this is text with one table"));
}

#[test]
fn damaged_files_end_in_one_line() {
    for (name, bytes) in WRITTEN {
        let flags: Flags = &[("unit", "deg/s"), ("time", "none")];
        damage::survives(name, bytes, &[flags], 150);
    }
}

/// `cargo test --release -- --ignored --nocapture ten_thousand_changes`
#[test]
#[ignore = "takes minutes"]
fn ten_thousand_changes_of_array_files() {
    for (name, bytes) in WRITTEN {
        damage::ten_thousand(name, bytes, &[("unit", "deg/s"), ("time", "none")]);
    }
}

const BROAD: Flags = &[("unit", "rad/s")];
const BROAD_FORCE: Flags = &[("unit", "m/s^2")];
const BUFFER: Flags = &[("unit", "deg/s"), ("time", "gyroBuffer_1:s"), ("columns", "2,3,4")];
const BUFFER_FORCE: Flags = &[("unit", "g"), ("time", "accelBuffer_1:s"), ("columns", "2,3,4")];

/// Values by h5py 3.16.0 and scipy.io 1.17.1; means by NumPy 2.4.6; rate of the burst stamps by `numpy.polyfit`.
#[test]
fn measured_files_agree_with_independent_readers() {
    let files = [
        Independent {
            path: "motion/dlaidig_broad/02_undisturbed_slow_rotation_B.hdf5",
            start_s: 0.0,
            flags: BROAD,
            samples: 53240,
            rate_hz: 285.7142857142857,
            axes: [
                [0.003195697860401618, 0.006391395720803235, -0.02706709652298508],
                [0.003195697860401617, -7.827202311565772e-19, 0.0061034132799063934],
                [0.0, -0.0053267448770866945, 0.03817249991542913],
            ],
        },
        Independent {
            path: "motion/dlaidig_broad/05_undisturbed_slow_rotation_with_breaks_B.hdf5",
            start_s: 0.0,
            flags: BROAD_FORCE,
            samples: 59212,
            rate_hz: 285.7142857142857,
            axes: [
                [0.11546628800383582, 0.08701728800383583, 0.26564307029458767],
                [-0.0018427877345625308, 0.07467521226543747, -0.006775356200414087],
                [9.860071125378163, 9.816907125378162, 8.498320227012966],
            ],
        },
        Independent {
            path: "motion/dlaidig_broad/07_undisturbed_fast_rotation_B.hdf5",
            start_s: 0.0,
            flags: BROAD,
            samples: 52518,
            rate_hz: 285.7142857142857,
            axes: [
                [0.00745779189377177, 0.0042603487041181585, -0.015476853267439989],
                [0.00106465084371654, -5.217422403749877e-19, 0.02451790521526202],
                [-0.0053267448770866945, -0.0021310470166850766, -0.0007302355166322816],
            ],
        },
        Independent {
            path: "motion/dlaidig_broad/21_undisturbed_fast_combined.mat",
            start_s: 0.0,
            flags: BROAD,
            samples: 53612,
            rate_hz: 285.7142857142857,
            axes: [
                [0.003195697860401618, 0.0042603487041181585, -0.043977142777446535],
                [0.002131047016685076, 0.002131047016685076, -2.7337759001563136],
                [-0.0031956978604016175, -0.0021310470166850766, 0.03562997261077026],
            ],
        },
        Independent {
            path: "static/sunsided_sensor-fusion/set-2_unmoved-with-x-pointing-forward-10min/mpu6050_gyroscope.mat",
            start_s: 0.008780029081872982,
            flags: BUFFER,
            samples: 65067,
            rate_hz: 99.29737148399346,
            axes: [
                [4.770992366412214, 4.648854961832061, 4.535324187857097],
                [0.1297709923664122, 0.1297709923664122, 0.04732456046187036],
                [1.1984732824427482, 1.0763358778625953, 1.1221133542090556],
            ],
        },
        Independent {
            path: "static/sunsided_sensor-fusion/set-1_unmoved-x-pointing-forward/mpu6050_accelerometer.mat",
            start_s: 0.008047002001083742,
            flags: BUFFER_FORCE,
            samples: 6383,
            rate_hz: RATE_OF_SET_1,
            axes: [
                [0.02392578125, 0.017578125, 0.02107438857365267],
                [0.006591796875, 0.0068359375, 0.005838108794845684],
                [1.042236328125, 1.04931640625, 1.037353974607845],
            ],
        },
    ];
    files.iter().for_each(Independent::check);
}

/// By `numpy.polyfit(arange(n), t, 1)`.
const RATE_OF_SET_1: f64 = 99.99850144045386;
