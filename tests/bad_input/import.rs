//! Parameter files of other programs, and datasheets.

use super::super::support::Bench;
use super::{Row, assert_refused};

#[test]
fn a_file_of_another_program_that_cannot_be_read() {
    let run = "import imu.yaml -o params.json";
    let file = |text: &str| text.as_bytes().to_vec();
    let rate = "import imu.yaml --rate 200 -o params.json";
    let python = "import imu.py --rate 100 -o params.json";
    let of = |key: &str, value: &str| {
        file(&format!("e = {{\n 'gyro_arw': np.array([1.0, 1.0, 1.0]),\n '{key}': {value},\n}}\n"))
    };
    let rows: Vec<Row<'_>> = vec![
        ("missing", "", vec![], run, &["imu.yaml: cannot read"]),
        ("empty", "imu.yaml", vec![], run, &["imu.yaml: no noise parameters found; expected a Kalibr"]),
        ("prose", "imu.yaml", file("It was a dark\nand stormy night\n"), run, &["no noise parameters found"]),
        ("no text", "imu.yaml", vec![0xff, 0xfe, 0x00, 0x81], run, &["is no text"]),
        ("a log", "imu.yaml", vec![b'1'; 2 << 20], run, &["longer than any file of parameters"]),
        (
            "a word for a number",
            "imu.yaml",
            file("gyroscope_noise_density: small\n"),
            rate,
            &["line 1: gyroscope_noise_density: found 'small', expected a number"],
        ),
        ("infinite", "imu.yaml", file("gyroscope_noise_density: inf\n"), rate, &["line 1", "'inf'"]),
        ("below zero", "imu.yaml", file("a: 1\ngyroscope_noise_density: -1e-3\n"), rate, &["line 2", "'-1e-3'"]),
        (
            "zero",
            "imu.yaml",
            file("gyroscope_noise_density: 0.0\n"),
            rate,
            &["found 0, but every sensor has white noise"],
        ),
        (
            "a walk alone",
            "imu.yaml",
            file("gyroscope_random_walk: 1e-5\n"),
            rate,
            &["stands without gyroscope_noise_density"],
        ),
        (
            "twice",
            "imu.yaml",
            file("gyroscope_noise_density: 1e-3\ngyroscope_noise_density: 2e-3\n"),
            rate,
            &["line 2: gyroscope_noise_density: stands in line 1 too"],
        ),
        ("tab", "imu.yaml", file("imu0:\n\tgyroscope_noise_density: 1e-3\n"), rate, &["line 2: a tab"]),
        (
            "no colon",
            "imu.yaml",
            file("gyroscope_noise_density 1e-3\n"),
            rate,
            &["line 1: found 'gyroscope_noise_density 1e-3', expected 'key: value'"],
        ),
        (
            "no rate",
            "imu.yaml",
            file("gyroscope_noise_density: 1e-3\n"),
            run,
            &["the file has no update_rate: give the sample rate"],
        ),
        (
            "a rate of zero",
            "imu.yaml",
            file("gyroscope_noise_density: 1e-3\nupdate_rate: 0\n"),
            run,
            &["line 2: update_rate: found 0"],
        ),
        ("a bad rate", "imu.yaml", file("gyroscope_noise_density: 1e-3\n"), "import imu.yaml --rate -1", &["--rate"]),
        (
            "no accelerometer",
            "imu.yaml",
            file("gyroscope_noise_density: 1e-3\n"),
            "import imu.yaml --rate 9 --accelerometer a.json",
            &["--accelerometer: imu.yaml has no accelerometer"],
        ),
        (
            "over itself",
            "imu.yaml",
            file("gyroscope_noise_density: 1e-3\n"),
            "import imu.yaml --rate 9 -o imu.yaml",
            &["it is the input file"],
        ),
        ("VINS", "imu.yaml", file("acc_n: 0.08\ngyr_n: 0.004\n"), rate, &["N sqrt(2 rate)", "kfdesign datasheet"]),
        (
            "imu_utils without rate",
            "imu.yaml",
            file("Gyr:\n  unit: \" rad/s\"\n  avg-axis:\n    gyr_n: 1e-3\n    gyr_w: 1e-5\n"),
            run,
            &["gyr_n is N sqrt(rate)", "--rate 200"],
        ),
        (
            "imu_utils without unit",
            "imu.yaml",
            file("Gyr:\n  avg-axis:\n    gyr_n: 1e-3\n    gyr_w: 1e-5\n"),
            rate,
            &["Gyr has no unit line"],
        ),
        (
            "imu_utils of another unit",
            "imu.yaml",
            file("Gyr:\n  unit: \"deg/s\"\n  avg-axis:\n    gyr_n: 1e-3\n    gyr_w: 1e-5\n"),
            rate,
            &["line 2: Gyr.unit: found 'deg/s', expected 'rad/s'"],
        ),
        (
            "imu_utils half an axis",
            "imu.yaml",
            file("Gyr:\n  unit: \"rad/s\"\n  x-axis:\n    gyr_n: 1e-3\n"),
            rate,
            &["line 4: Gyr.x-axis.gyr_n: stands without gyr_w"],
        ),
        (
            "imu_utils no axis",
            "imu.yaml",
            file("Gyr:\n  unit: \"rad/s\"\n  w-axis:\n    gyr_n: 1e-3\n"),
            rate,
            &["Gyr has no axis"],
        ),
        ("dictionary without rate", "imu.py", of("x", "1"), "import imu.py", &["the dictionary has no rate"]),
        (
            "a call",
            "imu.py",
            of("gyro_b_stability", "os.system('rm')"),
            python,
            &["line 3: gyro_b_stability: found 'os.system'"],
        ),
        (
            "two numbers",
            "imu.py",
            of("gyro_b_stability", "[1, 2]"),
            python,
            &["line 3: gyro_b_stability: found 2 numbers"],
        ),
        (
            "lists of two lengths",
            "imu.py",
            of("gyro_b_stability", "[1, 2] * [1, 2, 3]"),
            python,
            &["lists of 2 and of 3"],
        ),
        ("below zero", "imu.py", of("gyro_b_stability", "-1"), python, &["axis x: gyro_b_stability is -1"]),
        ("not closed", "imu.py", of("gyro_b_stability", "[1, 2"), python, &["gyro_b_stability: "]),
        ("too deep", "imu.py", of("gyro_b_stability", &"(".repeat(4000)), python, &["too many brackets"]),
        ("not a number", "imu.py", of("gyro_b_stability", "0 / 0"), python, &["not defined"]),
        ("a sum", "imu.py", of("gyro_b_stability", "1 + 1"), python, &["found '+' behind the numbers"]),
        ("twice", "imu.py", of("gyro_arw", "1"), python, &["line 3: gyro_arw stands in line 2 too"]),
        (
            "compare needs a rate",
            "imu.py",
            of("x", "1"),
            "compare imu.py none.csv",
            &["first kfdesign import imu.py --rate HZ"],
        ),
    ];
    assert_refused(rows);
}

/// Half of each file, and each with one byte changed, ends in a line, never in a panic.
#[test]
fn damaged_files_are_refused_or_read() {
    let kalibr = "imu0:\n  accelerometer_noise_density: 1.86e-03 # x\n  gyroscope_noise_density: '1e-3'\n  T: [[1, 2],\n    [3, 4]]\n  update_rate: 100.0\n";
    let utils = "%YAML:1.0\n---\nGyr:\n   unit: \" rad/s\"\n   x-axis:\n      gyr_n: 1e-04\n      gyr_w: 3e-05\n";
    let python = "imu_err = {'gyro_b': np.zeros(3), 'gyro_arw': np.array([0.25, 0.25, 0.25]) * 1.0, 'gyro_b_stability': (3.5 / 2),\n 'gyro_b_corr': float('inf')}";
    let bench = Bench::new();
    let (mut read, mut refused) = (0, 0);
    for (name, text) in [("a.yaml", kalibr), ("b.yaml", utils), ("c.py", python)] {
        let mut variants: Vec<Vec<u8>> = (0..text.len()).step_by(7).map(|at| text.as_bytes()[..at].to_vec()).collect();
        variants.extend((0..text.len()).step_by(5).map(|at| {
            let mut bytes = text.as_bytes().to_vec();
            bytes[at] = b"\"'[](:#\t*9\xff"[at % 11];
            bytes
        }));
        for bytes in variants {
            let path = bench.file(name, bytes);
            // without the binary's start: a hundred of them in a moment
            match kfdesign::import::read(&path, Some(100.0)) {
                Ok(found) => read += usize::from(!found.sensors.is_empty()),
                Err(error) => {
                    refused += 1;
                    assert!(!error.to_string().contains('\n'), "{error}");
                }
            }
        }
    }
    assert!(read > 20 && refused > 20, "{read} {refused}");
}

#[test]
fn a_datasheet_that_does_not_say_enough() {
    let bench = Bench::new();
    let cases: [(&[&str], &[&str]); 16] = [
        (&[], &["nothing was typed"]),
        (&["--arw", "0.15"], &["--angle-random-walk 0.15", "a number and a unit"]),
        (&["--arw", "0.15 deg/s"], &["--angle-random-walk 0.15 deg/s", "the standard deviation of one sample"]),
        (&["--arw", "0.15 m/s/sqrt(h)"], &["expected a unit of a noise density of angular rate"]),
        (&["--vrw", "0.15 deg/sqrt(h)"], &["expected a unit of a noise density of specific force"]),
        (&["--arw", "-0.15 deg/sqrt(h)"], &["must be greater than zero"]),
        (&["--arw", "0.15 deg/sqrt(h)", "--bias-instability", "0.04 mg"], &["one sensor at a time"]),
        (&["--noise-density", "2.8 mdps/sqrt(Hz)"], &["--sided one or --sided two"]),
        (&["--noise-density", "90 ug"], &["--noise-density 90 ug", "expected a noise density of specific force"]),
        (&["--sided", "one", "--arw", "1 deg/sqrt(h)"], &["--noise-density"]),
        (&["--total-noise", "0.05 deg/s"], &["needs its bandwidth"]),
        (&["--bias-instability", "2.3 deg/h"], &["no white noise"]),
        (&["--arw", "1 deg/sqrt(h)", "--correlation-time", "100 s"], &["without a bias instability"]),
        (
            &["--arw", "1 deg/sqrt(h)", "--bias-instability", "2 deg/h", "--instability", "sigma"],
            &["needs --correlation-time"],
        ),
        (&["--arw", "1 deg/sqrt(h)", "--bandwidth", "92"], &["--bandwidth 92"]),
        (&["--arw", "1 deg/sqrt(h)", "--axes", "x,x"], &["'x' stands twice"]),
    ];
    for (args, words) in cases {
        let all: Vec<&str> = ["datasheet", "--rate", "100", "-o", "params.json"].iter().chain(args).copied().collect();
        let out = bench.run_args(&all);
        let one_line = out.stderr.lines().count() == 1 && out.stderr.starts_with("kfdesign: ");
        let told = words.iter().all(|w| out.stderr.contains(w));
        assert!(out.status == 2 && one_line && told && bench.files().is_empty(), "{args:?}: {out:?}");
    }
    let none = bench.run_args(&["datasheet", "--arw", "1 deg/sqrt(h)"]);
    assert!(none.status == 2 && none.stderr.contains("--rate"), "{none:?}");
}
