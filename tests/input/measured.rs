//! Measured logs: counts, rates, first and last values and means as an independent reader gives them, and known
//! defects.

use kfdesign::input::{self, Block, LogReader};
use kfdesign::signal::check::{FindingKind, TimeBase};

use super::super::support::measured;
use super::{Flags, assert_close, options, shown};

/// A measured log: path, flags, samples, rate in Hz, first and last value and mean of each axis in the log's unit.
struct Measured {
    path: &'static str,
    flags: Flags<'static>,
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
    const LSB: Flags = &[("unit", "1/131 deg/s"), ("rate", "100"), ("columns", "gx,gy,gz")];
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
            // the rate stands in the header
            flags: &[("unit", "rad/s")],
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
            // by the other reader as they are stored, some as counts
            let unit = options(log.flags).unit.unwrap_or_else(|| recording.axes[axis].unit.clone());
            let x: Vec<f64> = recording.axes[axis].values.iter().map(|x| unit.from_si(*x)).collect();
            assert_close(&[x[0], x[x.len() - 1]], &[*first, *last], name);
            let found = x.iter().sum::<f64>() / x.len() as f64;
            assert!((found - mean).abs() < 1e-9 * x.iter().map(|v| v.abs()).fold(0.0, f64::max), "{name}: {found}");
        }
    }
}

/// What the source pages of the logs say about their defects.
#[test]
fn the_check_finds_the_known_defects_of_measured_logs() {
    let found = |path: &str, flags: Flags| measured(path).map(|p| input::read(&p, &options(flags)).unwrap().1.findings);
    let set1 = "static/sunsided_sensor-fusion/derived/set-1_unmoved-z-pointing-left.csv.gz";
    let Some(findings) = found(set1, &[("rate", "100")]) else { return };
    let zero = findings.iter().find(|f| f.kind == FindingKind::ZeroRow).unwrap();
    assert_eq!((zero.count, zero.first_index, zero.serious), (720, 6280, true));
    assert!(findings.iter().any(|f| f.kind == FindingKind::BackwardStamp && f.count == 1 && f.first_index == 6280));
    let lsb: Flags = &[("unit", "1/131 deg/s"), ("rate", "100"), ("columns", "gx,gy,gz")];
    let findings = found("motion/tomisuarez2_ImuCalibration/example_data_calibration.csv", lsb).unwrap();
    // ten samples at -32768, the end of 16 bits
    assert!(
        findings.iter().any(|f| f.kind == FindingKind::Saturated && f.count == 10 && f.axis.as_deref() == Some("gx"))
    );
    assert!(findings.iter().any(|f| f.kind == FindingKind::Motion && f.serious));
    let adis = found("static/SMAC-Group_imudata/adis16405_recording1.csv.gz", &[("rate", "100")]).unwrap();
    assert!(adis.iter().all(|f| f.kind == FindingKind::Quantised && !f.serious) && adis.len() == 3, "{adis:?}");
    assert!(adis[0].message.contains("0.05 deg/s"), "{}", adis[0].message);
    let ten =
        found("static/sunsided_sensor-fusion/derived/set-2_unmoved-with-x-pointing-forward-10min.csv.gz", &[]).unwrap();
    let kinds: Vec<FindingKind> = ten.iter().map(|f| f.kind).collect();
    let quantised = FindingKind::Quantised;
    assert_eq!(kinds, [FindingKind::Jitter, quantised, quantised, quantised]);
}

/// Logs that are refused, each for a reason that it names.
#[test]
fn measured_logs_that_are_refused_say_why() {
    let gyro: Flags =
        &[("columns", "IMU::UncompGyro::X,IMU::UncompGyro::Y,IMU::UncompGyro::Z"), ("time", "Time::TimeStartup")];
    let table: [(&str, Flags, &str); 8] = [
        ("formats/rosbag2/imu_tools_sparkfun_razor/metadata.yaml", &[], "give the folder it lies in"),
        ("motion/mad-lab-fau_imucal/example_ferraris_session_list.json", &[], "this is a JSON document"),
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
        (
            "formats/betaflight/blackbox-library_normal.bfl",
            &[],
            "this is a Betaflight blackbox log, of which blackbox_decode makes a csv",
        ),
    ];
    for (path, flags, words) in table {
        let Some(path) = measured(path) else { return };
        let message = input::read(&path, &options(flags)).unwrap_err().to_string();
        assert!(message.contains(words), "{message}");
    }
}

/// What an independent reader says of a file: samples, mean rate, first stamp, and first and last value and mean per
/// axis.
pub struct Independent {
    pub path: &'static str,
    pub start_s: f64,
    pub flags: Flags<'static>,
    pub samples: usize,
    /// Of a log with gaps: (samples − 1) / (last stamp − first).
    pub rate_hz: f64,
    pub axes: [[f64; 3]; 3],
}

impl Independent {
    pub fn check(&self) {
        let Some(path) = measured(self.path) else { return };
        let options = options(self.flags);
        let (log, _) = input::read(&path, &options).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(log.len(), self.samples, "{}", self.path);
        assert!((log.start_s - self.start_s).abs() <= 1e-9 * self.start_s, "{}: {}", self.path, log.start_s);
        // each gap is a whole number of periods only to half a period
        let missing: u64 = log.gaps.iter().map(|gap| gap.missing).sum();
        let rate_hz = self.rate_hz * (1.0 + missing as f64 / (log.len() - 1) as f64);
        let tolerance = 1e-9 + 0.5 * log.gaps.len() as f64 / log.len() as f64;
        assert!((log.sample_rate_hz / rate_hz - 1.0).abs() < tolerance, "{}: {}", self.path, log.sample_rate_hz);
        for (axis, [first, last, mean]) in self.axes.into_iter().enumerate() {
            let values = shown(&log, axis);
            // conversion to SI and back rounds twice
            assert_close(&[values[0], values[values.len() - 1]], &[first, last], self.path);
            let sum: f64 = values.iter().sum();
            assert!((sum / values.len() as f64 - mean).abs() <= 1e-9 * mean.abs().max(0.01), "{}: {sum}", self.path);
        }
        // and in blocks
        let mut reader = LogReader::open(&path, &options).unwrap();
        let (mut block, mut rows) = (Block::default(), 0);
        while reader.next_block(&mut block).unwrap() {
            assert_eq!(block.values[2][0].to_bits(), log.axes[2].values[rows].to_bits());
            rows += block.values[2].len();
        }
        assert_eq!(rows, log.len());
    }
}
