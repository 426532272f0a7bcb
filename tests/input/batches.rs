//! Batches of raw samples in ArduPilot DataFlash logs.

use kfdesign::signal::LogCheck;
use kfdesign::signal::check::FindingKind;

use super::measured::Independent;
use super::{Flags, damage, read_bytes};

/// A log of messages as ArduPilot writes them (libraries/AP_Logger/LogStructure.h).
struct Dataflash(Vec<u8>);

const HEADER: u8 = 164;
const DATA: u8 = 165;

impl Dataflash {
    fn new() -> Dataflash {
        let mut log = Dataflash(Vec::new());
        log.format(128, 89, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns");
        log.format(HEADER, 31, "ISBH", "QHBBHHQf", "TimeUS,N,type,instance,mul,smp_cnt,SampleUS,smp_rate");
        log.format(DATA, 207, "ISBD", "QHHaaa", "TimeUS,N,seqno,x,y,z");
        log
    }
    fn message(&mut self, kind: u8, parts: &[&[u8]]) {
        self.0.extend([0xa3, 0x95, kind]);
        parts.iter().for_each(|part| self.0.extend(*part));
    }
    fn format(&mut self, kind: u8, size: u8, name: &str, codes: &str, labels: &str) {
        let padded = |text: &str, size: usize| {
            let mut bytes = text.as_bytes().to_vec();
            bytes.resize(size, 0);
            bytes
        };
        self.message(128, &[&[kind, size], &padded(name, 4), &padded(codes, 16), &padded(labels, 64)]);
    }
    /// The sensor: 0 accelerometer or 1 gyro, and which of them.
    fn header(&mut self, number: u16, sensor: [u8; 2], multiplier: u16, count: u16, first_us: u64, rate: f32) {
        let (us, number) = (first_us + 16_000, number.to_le_bytes());
        let (multiplier, count) = (multiplier.to_le_bytes(), count.to_le_bytes());
        let fields: [&[u8]; 7] =
            [&us.to_le_bytes(), &number, &sensor, &multiplier, &count, &first_us.to_le_bytes(), &rate.to_le_bytes()];
        self.message(HEADER, &fields);
    }
    /// 32 samples from `first` on: x = k, y = −2k, z = 7 or 8.
    fn data(&mut self, number: u16, sequence: u16, first: i16) {
        let axis =
            |value: fn(i16) -> i16| (first..first + 32).flat_map(|k| value(k).to_le_bytes()).collect::<Vec<u8>>();
        let (x, y, z) = (axis(|k| k), axis(|k| -2 * k), axis(|k| 7 + k % 2));
        self.message(DATA, &[&9_000_000u64.to_le_bytes(), &number.to_le_bytes(), &sequence.to_le_bytes(), &x, &y, &z]);
    }
}

/// Two batches of a gyro at 1 kHz with one of the accelerometer between them, and one of a second gyro. Of the
/// second gyro batch the second message is lost, and there is one message that belongs to no batch.
fn log() -> Vec<u8> {
    let mut log = Dataflash::new();
    log.data(6, 3, 0);
    log.header(7, [1, 0], 938, 96, 1_000_000, 1000.0);
    (0..3).for_each(|i| log.data(7, i, 32 * i as i16));
    log.header(8, [0, 0], 208, 64, 1_200_000, 1000.0);
    (0..2).for_each(|i| log.data(8, i, 32 * i as i16));
    log.header(9, [1, 1], 938, 32, 1_400_000, 2000.0);
    log.data(9, 0, 100);
    log.header(10, [1, 0], 1000, 96, 1_600_000, 1000.0);
    log.data(10, 0, 0);
    log.data(10, 2, 64);
    log.0
}

const GYRO: Flags = &[("topic", "ISB_gyro")];

#[test]
fn a_batch_is_samples_of_one_sensor_in_si_at_their_own_times() {
    let (gyro, check) = read_bytes("log.bin", log(), GYRO).unwrap();
    let names: Vec<&str> = gyro.axes.iter().map(|axis| axis.name.as_str()).collect();
    assert_eq!((gyro.len(), names), (96 + 64, vec!["gyro_x", "gyro_y", "gyro_z"]));
    // the multiplier of each batch, to rounding
    let x = &gyro.axes[0].values;
    let expected = (0..96).map(|k| f64::from(k) / 938.0).chain((0..32).chain(64..96).map(|k| f64::from(k) / 1000.0));
    assert!(x.iter().zip(expected).all(|(found, k)| (found - k).abs() <= 1e-15), "{x:?}");
    assert!((gyro.axes[1].values[95] + 190.0 / 938.0).abs() < 1e-15);
    // 1.000 s + 95 ms to 1.600 s: 504 samples are missing; then the message that was lost
    // stamps are k 10⁶/rate from the first, to rounding
    let rate = |check: &LogCheck, hz: f64| assert!((check.sample_rate_hz / hz - 1.0).abs() < 1e-12, "{hz}");
    assert_eq!(gyro.start_s, 1.0);
    rate(&check, 1000.0);
    let gaps: Vec<(usize, u64)> = gyro.gaps.iter().map(|gap| (gap.index, gap.missing)).collect();
    assert_eq!(gaps, [(96, 504), (128, 32)]);
    let damaged = check.findings.iter().find(|finding| finding.kind == FindingKind::Damaged).unwrap();
    assert!(damaged.message.contains("1 ISBD messages whose batch has no ISBH"), "{}", damaged.message);
    let (accel, check) = read_bytes("log.bin", log(), &[("topic", "isb_accel:0")]).unwrap();
    assert_eq!((accel.len(), accel.start_s), (64, 1.2));
    rate(&check, 1000.0);
    assert!((accel.axes[0].values[63] - 63.0 / 208.0).abs() < 1e-15);
    let (second, check) = read_bytes("log.bin", log(), &[("topic", "ISB_gyro:1")]).unwrap();
    assert_eq!((second.len(), second.start_s), (32, 1.4));
    rate(&check, 2000.0);
}

/// By pymavlink 2.4.50: samples / `mul` at SampleUS + k / `smp_rate`, means by NumPy 2.4.6.
#[test]
fn a_measured_batch_agrees_with_pymavlink() {
    let file = Independent {
        path: "formats/ardupilot/MethodicConfigurator_backend_log_80k.bin",
        start_s: 140.184099,
        flags: &[("topic", "ISB_gyro:0")],
        samples: 576,
        rate_hz: 2000.3150634765625,
        axes: [
            [0.0042643923240938165, 0.0031982942430703624, 0.0042810501066098084],
            [-0.0021321961620469083, -0.0010660980810234541, -0.002134047026770907],
            [-0.0031982942430703624, 0.0, -0.00013881485429992894],
        ],
    };
    file.check();
}

/// A header without a multiplier or a rate opens nothing; samples beyond the count are none.
#[test]
fn a_batch_that_says_nothing_is_passed_over() {
    let mut log = Dataflash::new();
    log.header(1, [1, 0], 0, 32, 1_000_000, 1000.0);
    log.data(1, 0, 0);
    log.header(2, [1, 0], 938, 32, 2_000_000, f32::NAN);
    log.data(2, 0, 0);
    log.header(3, [2, 0], 938, 32, 3_000_000, 1000.0);
    log.data(3, 0, 0);
    let message = read_bytes("log.bin", &log.0, &[]).unwrap_err();
    assert!(message.contains("no data in it"), "{message}");
    log.header(4, [1, 0], 938, 48, 4_000_000, 1000.0);
    (0..3).for_each(|i| log.data(4, i, 32 * i as i16));
    let (gyro, _) = read_bytes("log.bin", &log.0, &[]).unwrap();
    assert_eq!((gyro.len(), gyro.start_s), (48, 4.0));
}

#[test]
fn damaged_batches_end() {
    damage::survives("log.bin", &log(), &[GYRO], 500);
}
