//! Flight logs and bags: measured files against their own projects' readers, what is chosen of them, and damaged ones.

use kfdesign::input::{self, inspect::inspect};
use kfdesign::signal::check::FindingKind;

use super::super::support::measured;
use super::measured::Independent;
use super::{Flags, damage, options};

/// By pyulog 1.3.0, pymavlink 2.4.50, rosbags 0.11.9 (bags; the database through Python's sqlite3) and mcap 1.6.0
/// with rosbags for the messages; means by NumPy 2.4.6.
#[test]
fn measured_files_agree_with_independent_readers() {
    let files = [
        Independent {
            path: "formats/ulog/mcap_test_ulog.ulg",
            start_s: 27.329869,
            flags: &[],
            samples: 1297,
            rate_hz: 199.69801838238746,
            axes: [
                [-0.12973590195178986, 0.12003400921821594, -0.09421192596619572],
                [-0.03351612016558647, -0.11024883389472961, 0.171975657876193],
                [-0.6194484829902649, -0.08761951327323914, 0.3084812190470468],
            ],
        },
        Independent {
            path: "formats/ulog/mcap_test_ulog.ulg",
            start_s: 28.122608,
            flags: &[("topic", "sensor_gyro:1")],
            samples: 6,
            rate_hz: 0.9996369318663465,
            axes: [
                [1.1275293827056885, -0.24655108153820038, -0.06356239691376686],
                [1.8044939041137695, -0.02233288623392582, 0.40666004673888284],
                [1.306378960609436, 0.12461784482002258, 0.48699183637897175],
            ],
        },
        Independent {
            path: "formats/ulog/mcap_test_ulog.ulg",
            start_s: 27.612617,
            flags: &[("topic", "vehicle_imu:1")],
            samples: 13,
            rate_hz: 1.9992752627172645,
            axes: [
                [0.2821682507849552, -0.19982874252857616, -0.03372515995343152],
                [0.3134521754766972, 0.11785724890106902, 0.23850647041868098],
                [-0.42455307171716317, 0.05805341297437062, 0.39130442061459986],
            ],
        },
        Independent {
            path: "formats/ulog/pyulog_sample.ulg",
            start_s: 112.614307,
            flags: &[],
            samples: 17070,
            rate_hz: 247.81066341959058,
            axes: [
                [-0.001924943644553423, -0.0013746954500675201, -0.00018503056256243377],
                [-0.003310213563963771, -0.0025773236993700266, -0.003085288872420269],
                [-0.0032385666854679585, -0.0037138944026082754, -0.006087944689704374],
            ],
        },
        Independent {
            path: "formats/ulog/pyulog_sample_appended_multiple.ulg",
            start_s: 12.262822,
            flags: &[("topic", "sensor_combined")],
            samples: 2373,
            rate_hz: 246.63117617700883,
            axes: [
                [0.0032860368955880404, 0.05898718535900116, -0.0038622410727393326],
                [0.009327229112386703, 0.03172055631875992, 0.006988638048233598],
                [0.0039487420581281185, 0.012260101735591888, 0.0029761924278798708],
            ],
        },
        Independent {
            path: "formats/ulog/pyulog_sample_log_small.ulg",
            start_s: 20.326716,
            flags: &[],
            samples: 1298,
            rate_hz: 199.65665828016333,
            axes: [
                [0.002968383487313986, 0.0038848412223160267, 0.004457859755187899],
                [0.003646239871159196, -0.0030337886419147253, 0.00031170383523135113],
                [0.0009424961172044277, 0.0007792016840539873, 0.0010095777437240498],
            ],
        },
        Independent {
            path: "formats/ardupilot/MethodicConfigurator_backend_log_80k.bin",
            start_s: 140.209868,
            flags: &[("topic", "IMU:1"), ("sensor", "accel")],
            samples: 10,
            rate_hz: 24.607510212117873,
            axes: [
                [0.48838382959365845, 0.4669237732887268, 0.4776294708251953],
                [0.9139217734336853, 0.9233852624893188, 0.9157509565353393],
                [-9.737777709960938, -9.744965553283691, -9.750291442871093],
            ],
        },
        Independent {
            path: "formats/ardupilot/dronekit-la_log171.bin",
            start_s: 11.46,
            flags: &[],
            samples: 11916,
            rate_hz: 49.11356507186697,
            axes: [
                [0.00014373366138897836, -0.004880261607468128, -0.010425164243305933],
                [-0.00010365076013840735, -0.015385320410132408, 0.020379833819482263],
                [-0.00015082934987731278, -0.05154339224100113, 0.012547164697423474],
            ],
        },
        Independent {
            path: "formats/ardupilot/dronekit-la_log171.bin",
            start_s: 11.46,
            flags: &[("topic", "imu3")],
            samples: 11916,
            rate_hz: 49.11356507186697,
            axes: [
                [0.0009030475048348308, 0.00061048474162817, -0.009711068529712907],
                [0.0007901382632553577, -0.011549088172614574, 0.025527073172080653],
                [-0.0008625033078715205, -0.05682951211929321, 0.013173390430765129],
            ],
        },
        Independent {
            path: "formats/ardupilot/pymavlink_test.BIN",
            start_s: 81.794643,
            flags: &[],
            samples: 45,
            rate_hz: 45.13533419637566,
            axes: [
                [-0.1165708526968956, -0.05384852737188339, -0.006296056488321887],
                [0.009646732360124588, -0.009476035833358765, 0.00031713415584009555],
                [-0.0036614425480365753, -0.004102954640984535, -0.00046794123481959106],
            ],
        },
        Independent {
            path: "formats/rosbag1/imu_tools_sparkfun_razor.bag",
            start_s: 1352907614.798384,
            flags: &[],
            samples: 2144,
            rate_hz: 69.02711244474406,
            axes: [
                [-0.15055361895464128, -0.10077379333254216, 0.014671638630976345],
                [-0.2501132701988396, -0.018212131325158223, 0.12914473758811124],
                [0.2598264069055906, 0.09470308289082274, 0.019216176998028422],
            ],
        },
        Independent {
            path: "formats/rosbag2/imu_tools_sparkfun_razor/razor_db3.db3",
            start_s: 1352907614.798384,
            flags: &[],
            samples: 2144,
            rate_hz: 69.02711244474406,
            axes: [
                [-0.15055361895464128, -0.10077379333254216, 0.014671638630976345],
                [-0.2501132701988396, -0.018212131325158223, 0.12914473758811124],
                [0.2598264069055906, 0.09470308289082274, 0.019216176998028422],
            ],
        },
        Independent {
            path: "formats/rosbag2/imu_tools_sparkfun_razor",
            start_s: 1352907614.798384,
            flags: &[],
            samples: 2144,
            rate_hz: 69.02711244474406,
            axes: [
                [-0.15055361895464128, -0.10077379333254216, 0.014671638630976345],
                [-0.2501132701988396, -0.018212131325158223, 0.12914473758811124],
                [0.2598264069055906, 0.09470308289082274, 0.019216176998028422],
            ],
        },
        Independent {
            path: "formats/mcap/imu_tools_sparkfun_razor.none.mcap",
            start_s: 1352907614.798384,
            flags: &[],
            samples: 2144,
            rate_hz: 69.02711244474406,
            axes: [
                [-0.15055361895464128, -0.10077379333254216, 0.014671638630976345],
                [-0.2501132701988396, -0.018212131325158223, 0.12914473758811124],
                [0.2598264069055906, 0.09470308289082274, 0.019216176998028422],
            ],
        },
        Independent {
            path: "formats/mcap/imu_tools_sparkfun_razor.lz4.mcap",
            start_s: 1352907614.798384,
            flags: &[],
            samples: 2144,
            rate_hz: 69.02711244474406,
            axes: [
                [-0.15055361895464128, -0.10077379333254216, 0.014671638630976345],
                [-0.2501132701988396, -0.018212131325158223, 0.12914473758811124],
                [0.2598264069055906, 0.09470308289082274, 0.019216176998028422],
            ],
        },
        Independent {
            path: "formats/rosbag1/imu_tools_phidgets_imu_upside_down.bag",
            start_s: 1360242236.211313,
            flags: &[("sensor", "accel")],
            samples: 13964,
            rate_hz: 248.27754970970636,
            axes: [
                [-0.202086008644104, -0.17216550736427308, -0.17187377857780428],
                [-0.10555560451507569, -0.09653040412902832, -0.08893743289332989],
                [-9.869743322172164, -9.85551882156372, -9.87640305775494],
            ],
        },
        Independent {
            path: "formats/rosbag1/robot_localization_test1.bag",
            start_s: 1432235497.988949,
            flags: &[("topic", "/imu/data")],
            samples: 11865,
            rate_hz: 30.013253738298506,
            axes: [
                [0.025469467043876648, 0.025452613830566406, 9.749220414153895e-05],
                [-0.010768940672278404, 0.0006675403565168381, -0.009109164394118014],
                [-0.015053699724376202, 0.0006117075681686401, -0.00033513606948643807],
            ],
        },
        Independent {
            path: "formats/mcap/robot_localization_test1_imu.zstd.mcap",
            start_s: 1432235497.988949,
            flags: &[("topic", "/imu/data")],
            samples: 11865,
            rate_hz: 30.013253738298506,
            axes: [
                [0.025469467043876648, 0.025452613830566406, 9.749220414153895e-05],
                [-0.010768940672278404, 0.0006675403565168381, -0.009109164394118014],
                [-0.015053699724376202, 0.0006117075681686401, -0.00033513606948643807],
            ],
        },
    ];
    files.iter().for_each(Independent::check);
}

/// A file of which each message has the same known values.
#[test]
fn a_log_of_constants_is_refused_by_name() {
    let Some(path) = measured("formats/rosbag2/PlotJuggler_rosbag2_test/rosbag2_test_0.db3") else { return };
    let message = input::read(&path, &options(&[])).unwrap_err().to_string();
    assert!(
        message.contains("/imu: column 'angular_velocity.x' is constant: 131 rad/s in all 1565 usable rows"),
        "{message}"
    );
}

#[test]
fn what_was_found_is_said_where_nothing_fits() {
    for name in ["formats/rosbag1/foxglove_example-bz2.bag", "formats/rosbag1/foxglove_example-lz4.bag"] {
        let Some(path) = measured(name) else { return };
        let refused = |flags: Flags| input::read(&path, &options(flags)).map(|_| ()).unwrap_err().to_string();
        let message = refused(&[]);
        assert!(message.contains("no topic has a gyro or an accelerometer"), "{message}");
        assert!(message.contains("/turtle1/color_sensor (1351 turtlesim/Color)"), "{message}");
        assert!(
            refused(&[("topic", "/tf")])
                .contains("topic /tf has messages of the type 'tf/tfMessage', which are not read")
        );
    }
    let Some(path) = measured("formats/ulog/mcap_test_ulog.ulg") else { return };
    let message = input::read(&path, &options(&[("topic", "gyro")])).map(|_| ()).unwrap_err().to_string();
    assert!(message.contains("no topic 'gyro'; there are ") && message.contains("sensor_gyro:1 (6 rows)"), "{message}");
    // filtered rates are read when asked for
    let (log, check) = input::read(&path, &options(&[("topic", "vehicle_angular_velocity")])).unwrap();
    assert_eq!((log.len(), log.axes[0].name.as_str()), (326, "gyro_x"));
    assert!(!check.findings.iter().any(|finding| finding.kind == FindingKind::Topic));
}

#[test]
fn the_inventory_counts_what_independent_readers_count() {
    type Rows = &'static [(&'static str, u64)];
    let counts: [(&str, usize, Rows); 4] = [
        (
            "formats/ulog/pyulog_sample_log_small.ulg",
            70,
            &[("sensor_combined:0", 1298), ("sensor_gyro:2", 6), ("vehicle_angular_velocity:0", 1812)],
        ),
        ("formats/ulog/mcap_test_ulog.ulg", 95, &[("vehicle_imu:1", 13), ("sensors_status_imu:0", 34)]),
        ("formats/rosbag1/robot_localization_test1.bag", 3, &[("/imu/data", 11865), ("/fix", 989)]),
        ("formats/rosbag1/foxglove_example-lz4.bag", 9, &[("/tf", 2688), ("/rosout", 10)]),
    ];
    for (name, topics, rows) in counts {
        let Some(path) = measured(name) else { return };
        let found = inspect(&path).unwrap();
        assert_eq!(found.topics.len(), topics, "{name}");
        for (topic, count) in rows {
            let topic = found.topics.iter().find(|t| t.name == *topic).unwrap();
            assert_eq!(topic.rows, Some(*count), "{name}: {}", topic.name);
        }
    }
}

/// One file per reader and compression, cut where a smaller one does as well.
pub(super) const SAMPLES: [(&str, usize); 9] = [
    ("formats/ulog/mcap_test_ulog.ulg", 60_000),
    ("formats/ardupilot/pymavlink_test.BIN", 65_536),
    ("formats/rosbag1/imu_tools_sparkfun_razor.bag", 60_000),
    ("formats/rosbag1/imu_tools_phidgets_imu_upside_down.bag", 100_000),
    ("formats/rosbag1/foxglove_example-lz4.bag", 100_000),
    ("formats/mcap/imu_tools_sparkfun_razor.none.mcap", 60_000),
    ("formats/mcap/imu_tools_sparkfun_razor.lz4.mcap", 70_000),
    ("formats/mcap/robot_localization_test1_imu.zstd.mcap", 300_000),
    ("formats/rosbag2/imu_tools_sparkfun_razor/razor_db3.db3", 100_000),
];

#[test]
fn damaged_files_end() {
    for (name, most) in SAMPLES {
        let Some(path) = measured(name) else { return };
        let bytes = std::fs::read(path).unwrap();
        damage::survives("log", &bytes[..bytes.len().min(most)], &[&[]], 30);
    }
}

/// `cargo test --release -- --ignored --nocapture ten_thousand_changes`: 10,000 changes of each sample file, whole
/// but for those that take long to unpack, and the most memory that the process held. `KFDESIGN_SAMPLE` picks one by
/// a part of its name.
#[test]
#[ignore = "takes an hour"]
fn ten_thousand_changes() {
    const SLOW: [&str; 2] = ["imu_upside_down.bag", "imu.zstd.mcap"];
    let arrays = [
        ("static/sunsided_sensor-fusion/set-1_unmoved-z-pointing-left/mpu6050_gyroscope.mat", BUFFER),
        ("motion/dlaidig_broad/21_undisturbed_fast_combined.mat", RADIANS),
    ];
    let wanted = std::env::var("KFDESIGN_SAMPLE").unwrap_or_default();
    let kept = |name: &str, most| if SLOW.iter().any(|slow| name.ends_with(slow)) { most } else { usize::MAX };
    for (name, most, flags) in SAMPLES
        .into_iter()
        .map(|(name, most)| (name, kept(name, most), &[] as Flags))
        .chain(arrays.map(|(name, flags)| (name, usize::MAX, flags)))
        .filter(|(name, ..)| name.contains(&wanted))
    {
        let Some(path) = measured(name) else { return };
        let mut bytes = std::fs::read(path).unwrap();
        bytes.truncate(most);
        damage::ten_thousand(name, &bytes, flags);
    }
}

const BUFFER: Flags = &[("unit", "deg/s"), ("rate", "100"), ("columns", "2,3,4")];
const RADIANS: Flags = &[("unit", "rad/s")];
