//! Bad input: each with one clear line on stderr, exit status 2, and nothing left half-written.
//!
//! One table per kind of file; a row is what is wrong, the command, and words that the line must contain.

mod attitude;
mod code;
mod import;
mod temperature;

use super::support::Bench;

/// What is wrong, the file's name and bytes, the command's arguments, words of the message.
type Row<'a> = (&'a str, &'a str, Vec<u8>, &'a str, &'a [&'a str]);

/// Runs each row in a directory of its own that holds only the file; every file made there would be a leftover.
fn assert_refused(rows: Vec<Row>) {
    let mut wrong = Vec::new();
    for (what, name, bytes, command, words) in rows {
        let bench = Bench::new();
        if !name.is_empty() {
            bench.file(name, bytes);
        }
        let before = bench.files();
        let out = bench.run(command);
        let one_line = out.stderr.lines().count() == 1 && out.stderr.starts_with("kfdesign: ");
        let told = words.iter().all(|word| out.stderr.contains(word));
        if out.status != 2 || !out.stdout.is_empty() || !one_line || !told || bench.files() != before {
            wrong.push(format!("{what}: kfdesign {command}\n{out:?}, files {:?}, expected {words:?}", bench.files()));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n\n"));
}

/// Twenty good rows under this header, with one row replaced or added.
fn log(header: &str, at: usize, row: &str) -> Vec<u8> {
    let mut lines: Vec<String> =
        (0..20).map(|i| format!("{:.2},{},{}", 0.01 * f64::from(i), i * 7 % 5, i * 3 % 7)).collect();
    if at < lines.len() {
        lines[at] = row.to_string();
    }
    format!("{header}\n{}\n", lines.join("\n")).into_bytes()
}

fn npy(header: &str, data: &[u8]) -> Vec<u8> {
    let mut bytes = b"\x93NUMPY\x01\x00\x76\x00".to_vec();
    bytes.extend(format!("{header:<117}\n").as_bytes());
    bytes.extend(data);
    bytes
}

#[test]
fn a_log_that_cannot_be_read() {
    const HEADER: &str = "t_s,gyro_x (deg/s),gyro_y (deg/s)";
    const GOOD: usize = usize::MAX;
    let npy_flags = "allan log.npy --columns 1 --unit deg/s --rate 100 -o out.json";
    let shape = "{'descr': '<f8', 'fortran_order': False, 'shape': (40, 2), }";
    let constant: String = (0..20).map(|i| format!("{i},0.5,{}\n", i % 3)).collect();
    let empty: String = (0..20).map(|i| format!("{i},,{}\n", i % 3)).collect();
    let run = "allan log.csv -o out.json --plot out.svg";
    assert_refused(vec![
        ("missing file", "", vec![], run, &["log.csv: there is no such file"]),
        ("a folder", "x.csv", vec![], "allan . -o out.json", &[".: this is a folder"]),
        ("empty file", "log.csv", vec![], run, &["log.csv: the file is empty"]),
        ("header only", "log.csv", format!("{HEADER}\n").into_bytes(), run, &["log.csv: line 1", "no row of numbers"]),
        ("comments only", "log.csv", b"# nothing\n# here\n".to_vec(), run, &["log.csv: no data"]),
        (
            "a negative rate",
            "log.csv",
            log(HEADER, 99, ""),
            "allan log.csv --rate -100",
            &["--rate must be a positive number of Hz"],
        ),
        ("a negative start", "log.csv", log(HEADER, 99, ""), "allan log.csv --start -5", &["--start", "0 or more"]),
        ("prose", "log.csv", b"It was a dark\nand stormy night.\n".to_vec(), run, &["log.csv: no rows of numbers"]),
        (
            "text in a number column",
            "log.csv",
            log(HEADER, 4, "0.04,abc,1"),
            run,
            &["log.csv: line 6, column 'gyro_x (deg/s)': 'abc' is not a number"],
        ),
        ("short row", "log.csv", log(HEADER, 4, "0.04,1"), run, &["log.csv: line 6: 2 fields where 3 are expected"]),
        ("long row", "log.csv", log(HEADER, 4, "0.04,1,2,3"), run, &["log.csv: line 6: 4 fields where 3 are expected"]),
        (
            "missing column",
            "log.csv",
            log(HEADER, GOOD, ""),
            "allan log.csv --columns gyro_x,gyro_z",
            &["log.csv: line 1: no column 'gyro_z'", "1 't_s', 2 'gyro_x (deg/s)', 3 'gyro_y (deg/s)'"],
        ),
        (
            "no unit",
            "log.csv",
            log("t_s,gyro_x,gyro_y", GOOD, ""),
            run,
            &["log.csv: line 1", "'gyro_x'", "--unit deg/s"],
        ),
        (
            "wrong unit",
            "log.csv",
            log("t_s,gyro_x (deg),gyro_y (deg)", GOOD, ""),
            run,
            &["log.csv: line 1: column 'gyro_x (deg)'", "an angle", "expected an angular rate"],
        ),
        (
            "wrong unit by flag",
            "log.csv",
            log("t_s,gyro_x,gyro_y", GOOD, ""),
            "allan log.csv --unit deg",
            &["log.csv: line 1: column 'gyro_x'", "an angle", "expected an angular rate"],
        ),
        (
            "unit that is none",
            "log.csv",
            log(HEADER, GOOD, ""),
            "allan log.csv --unit parsec/s",
            &["--unit", "parsec/s"],
        ),
        (
            "unit against the header",
            "log.csv",
            log(HEADER, GOOD, ""),
            "allan log.csv --unit rad/s",
            &["log.csv: line 1", "deg/s by its header", "--unit says rad/s"],
        ),
        (
            "no rate",
            "log.csv",
            log("n,gyro_x (deg/s),gyro_y (deg/s)", GOOD, ""),
            run,
            &["log.csv: line 1: no sample rate", "--rate"],
        ),
        (
            "rate of nothing",
            "log.csv",
            log(HEADER, GOOD, ""),
            "allan log.csv --rate=-5",
            &["--rate must be a positive number"],
        ),
        (
            "rate of NaN",
            "log.csv",
            log(HEADER, GOOD, ""),
            "allan log.csv --rate NaN",
            &["--rate must be a positive number"],
        ),
        (
            "time without a unit",
            "log.csv",
            log("time,gyro_x (deg/s),gyro_y (deg/s)", GOOD, ""),
            run,
            &["log.csv: line 1: time column 'time' has no unit", "--time 'time:s'"],
        ),
        (
            "backward time",
            "log.csv",
            log(HEADER, 10, "0.05,1,2"),
            run,
            &["log.csv: line 12: time goes back from 0.090000 s to 0.050000 s", "--rate"],
        ),
        (
            "time that stands still",
            "log.csv",
            b"t_s,gyro_x (deg/s)\n1,1\n1,2\n1,3\n1,1\n".to_vec(),
            run,
            &["log.csv", "do not advance"],
        ),
        (
            "all NaN",
            "log.csv",
            format!("{HEADER}\n{empty}").into_bytes(),
            run,
            &["log.csv", "'gyro_x' holds no number in 20 rows"],
        ),
        (
            "constant column",
            "log.csv",
            format!("{HEADER}\n{constant}").into_bytes(),
            run,
            &["log.csv", "'gyro_x' is constant: 0.5 deg/s in all 20"],
        ),
        ("one sample", "log.csv", format!("{HEADER}\n0,1,2\n").into_bytes(), run, &["log.csv", "only one sample"]),
        (
            "nothing selected",
            "log.csv",
            log(HEADER, GOOD, ""),
            "allan log.csv --start 900",
            &["log.csv", "--start and --end"],
        ),
        (
            "truncated npy",
            "log.npy",
            npy(shape, &[1; 600]),
            npy_flags,
            &["log.npy: truncated: 40 rows are declared", "only 37"],
        ),
        ("npy header cut", "log.npy", npy(shape, &[])[..50].to_vec(), npy_flags, &["log.npy: truncated"]),
        (
            "pickled npy",
            "log.npy",
            b"\x80\x04\x95\x16\x00\x00\x00\x00\x00\x00\x00]\x94(K\x01K\x02e.".to_vec(),
            npy_flags,
            &["log.npy: this is a Python pickle"],
        ),
        (
            "object dtype",
            "log.npy",
            npy("{'descr': '|O', 'fortran_order': False, 'shape': (3,), }", b"\x80\x04]."),
            npy_flags,
            &["log.npy: the array holds Python objects"],
        ),
        (
            "huge declared shape",
            "log.npy",
            npy("{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000000000, 2), }", &[0; 64]),
            npy_flags,
            &["log.npy: truncated: 1000000000000000 rows are declared"],
        ),
        (
            "shape beyond 64 bits",
            "log.npy",
            npy("{'descr': '<f8', 'fortran_order': False, 'shape': (99999999999999999999999, 2), }", &[0; 64]),
            npy_flags,
            &["log.npy: truncated"],
        ),
        (
            "a cut HDF5 file",
            "log.h5",
            b"\x89HDF\r\n\x1a\n\0\0".to_vec(),
            "allan log.h5",
            &["log.h5: truncated or damaged"],
        ),
        (
            "a MATLAB file that is only its header",
            "log.mat",
            b"MATLAB 5.0 MAT-file, cut".to_vec(),
            "allan log.mat",
            &["log.mat: truncated: the file ends inside a variable"],
        ),
        (
            "a ULog without data",
            "log.ulg",
            [b"ULog\x01\x12\x35\x01".as_slice(), &[0; 8]].concat(),
            "allan log.ulg",
            &["log.ulg: no data"],
        ),
        ("a bag without messages", "log.bag", b"#ROSBAG V2.0\n".to_vec(), "allan log.bag", &["log.bag: no messages"]),
        (
            "an MCAP file that is cut",
            "log.mcap",
            b"\x89MCAP0\r\n\x01\xff".to_vec(),
            "allan log.mcap",
            &["log.mcap: damaged at byte 8"],
        ),
        ("a cut database", "log.db3", b"SQLite format 3\0".to_vec(), "allan log.db3", &["log.db3: truncated"]),
        ("a cut DataFlash log", "log.bin", b"\xa3\x95\x80\x80".to_vec(), "allan log.bin", &["log.bin: no data"]),
        (
            "a cut Parquet file",
            "log.parquet",
            b"PAR1\x15\0PAR1".to_vec(),
            "allan log.parquet",
            &["log.parquet: truncated or damaged: its table of contents"],
        ),
        ("nothing to list", "log.bag", b"#ROSBAG V2.0\n".to_vec(), "info log.bag", &["log.bag: no messages"]),
        ("binary file", "log.csv", vec![0, 1, 2, 3, 0, 255], run, &["log.csv: this is a binary file"]),
        (
            "damaged gzip",
            "log.csv.gz",
            b"\x1f\x8b\x08\x00garbage".to_vec(),
            "allan log.csv.gz",
            &["log.csv.gz: cannot read"],
        ),
    ]);
}

/// A sound params.json with one piece of text replaced.
fn params(found: &str, replaced: &str) -> Vec<u8> {
    let good = r#"{
  "format": "kfdesign-params/1",
  "quantity": "angular-rate",
  "sample_rate": "100 Hz",
  "axes": [
    {
      "name": "x",
      "bias": "0.1 deg/s",
      "white": { "density": "0.0562 deg/s/sqrt(Hz)" },
      "gauss_markov": [{ "std_dev": "0.028 deg/s", "correlation_time": "190 s" }]
    }
  ]
}
"#;
    assert!(good.contains(found), "the row replaces nothing: {found}");
    good.replace(found, replaced).into_bytes()
}

const LINE: &str = r#""oscillation": { "std_dev": "0.1 deg/s", "frequency": "20 Hz", "correlation_time": "3 s" },
      "gauss_markov""#;

/// Limits that are said, and sizes that no arithmetic in doubles can hold.
#[test]
fn parameters_beyond_the_limits() {
    fn row<'a>(what: &'a str, found: &str, replaced: &str, words: &'a [&'a str]) -> Row<'a> {
        (what, "params.json", params(found, replaced), "tune params.json -o out.json", words)
    }
    const TERM: &str = r#"{ "std_dev": "0.028 deg/s", "correlation_time": "190 s" }"#;
    let terms = |count: usize| vec![TERM; count].join(", ");
    let axis = |i: usize| format!(r#"{{"name": "a{i}", "white": {{"density": "1 deg/s/sqrt(Hz)"}}}}, "#);
    let axes = |count: usize| format!("\"axes\": [{}", (1..count).map(axis).collect::<String>());
    let sizes = "expected a size of 1e-30 to 1e30 in SI";
    assert_refused(vec![
        row("25 terms", TERM, &terms(24), &["axes[0].gauss_markov[23]: more than 24 noise terms on one axis; join"]),
        row("65 axes", "\"axes\": [", &axes(65), &["axes: 65 axes; expected at most 64"]),
        row("a million axes", "\"axes\": [", &axes(1_000_000), &["axes: 1000000 axes; expected at most 64"]),
        row("large bias", "0.1 deg/s", "1e200 deg/s", &["axes[0].bias: ", "larger than any sensor's", sizes]),
        row("large drift", "0.028 deg/s", "1e154 deg/s", &["axes[0].gauss_markov[0].std_dev: ", "larger", sizes]),
        row("long drift", "190 s", "1e300 s", &["correlation_time: ", "larger than any sensor's", sizes]),
        row("small drift", "0.028 deg/s", "1e-160 deg/s", &["std_dev: ", "smaller than any sensor's", sizes]),
    ]);
    // the advice is true: the density that it names makes a filter that its own verification passes; so do as many
    // terms as may be
    let bench = Bench::new();
    bench.file("params.json", params("0.0562 deg/s/sqrt(Hz)", "2.8e-10 deg/s/sqrt(Hz)"));
    let said = bench.run("tune params.json").stdout;
    let least = said.split("from a density of ").nth(1).unwrap().split(' ').next().unwrap().parse::<f64>().unwrap();
    bench.file("quiet.json", params("0.0562 deg/s/sqrt(Hz)", &format!("{:e} rad/s/sqrt(Hz)", least)));
    let said = bench.ok("tune quiet.json");
    assert!(said.contains("consistent: 100 runs") && !said.contains("double precision"), "{said}");
    let many: Vec<String> = (0..23).map(|k| TERM.replace("190", &format!("{}", 10.0 * 1.3f64.powi(k)))).collect();
    bench.file("many.json", params(TERM, &many.join(", ")));
    bench.ok("tune many.json --runs 8");
}

/// One sample that no sensor gives is named and left out; of a log of them nothing is left. No sum overflows, and
/// nothing that was not judged passes.
#[test]
fn values_that_overflow_are_named() {
    let bench = Bench::new();
    bench.file("params.json", params("190 s", "5 s"));
    bench.ok("simulate params.json -o good.csv --duration 200s --no-truth");
    bench.ok("tune params.json -o filter.json");
    let good = bench.read("good.csv");
    for (value, count) in [("1e308", 1), ("-1e308", 1), ("1e155", 1), ("1e40", 3)] {
        let mut lines: Vec<String> = good.lines().map(str::to_owned).collect();
        for line in &mut lines[101..101 + count] {
            *line = format!("{},{value}", line.split(',').next().unwrap());
        }
        bench.file("log.csv", lines.join("\n") + "\n");
        for args in [
            "compare params.json log.csv",
            "replay filter.json log.csv --allow-inconclusive",
            "identify log.csv",
            "identify log.csv --method graphical",
            "allan log.csv",
            "inflate params.json log.csv",
        ] {
            let out = bench.run(args);
            let are = if count == 1 { "1 value is".to_string() } else { format!("{count} values are") };
            let named = format!("{are} infinite or beyond 1e30 in SI, which no sensor gives; skipped, not replaced");
            assert!(out.status < 2 && out.stderr.contains(&named), "{args}, {value}: {out:?}");
            let words = |text: &str| text.split(|c: char| !c.is_alphanumeric()).any(|w| ["inf", "NaN"].contains(&w));
            assert!(!words(&out.stdout) && !words(&out.stderr), "{args}, {value}: {out:?}");
        }
    }
    let all: String = good.lines().map(|l| format!("{},1e200\n", l.split(',').next().unwrap())).collect();
    bench.file("log.csv", all.replacen(",1e200", ",gyro_x (deg/s)", 1));
    for args in ["compare params.json log.csv", "replay filter.json log.csv", "identify log.csv"] {
        let out = bench.run(args);
        assert!(out.status != 0 && out.stderr.contains("values are infinite or beyond 1e30"), "{args}: {out:?}");
    }
}

#[test]
fn parameters_that_cannot_be_used() {
    let run = "tune params.json -o out.json";
    fn row<'a>(what: &'a str, found: &str, replaced: &str, words: &'a [&'a str]) -> Row<'a> {
        let run = "tune params.json -o out.json --report out.html --plot out.svg";
        (what, "params.json", params(found, replaced), run, words)
    }
    assert_refused(vec![
        ("missing file", "", vec![], run, &["params.json: cannot read"]),
        ("empty file", "params.json", vec![], run, &["params.json: line 1", "not valid JSON"]),
        row("cut short", "\"axes\": [", "\"axes\": [[", &["params.json", "line", "not valid JSON"]),
        row(
            "another format",
            "kfdesign-params/1",
            "kfdesign-params/9",
            &["format", "kfdesign-params/9", "kfdesign-params/1"],
        ),
        row("unknown key", "\"white\"", "\"whit\"", &["axes[0]", "whit", "white"]),
        row("unknown key in a term", "\"density\"", "\"dens\"", &["axes[0].white", "dens", "density"]),
        row(
            "wrong unit",
            "0.0562 deg/s/sqrt(Hz)",
            "0.0562 deg/s",
            &["axes[0].white.density", "deg/s", "deg/s/sqrt(Hz)"],
        ),
        row("no unit", "\"0.0562 deg/s/sqrt(Hz)\"", "0.0562", &["axes[0].white.density", "unit"]),
        row("specific force in a gyro", "0.028 deg/s", "0.028 m/s^2", &["axes[0].gauss_markov[0].std_dev", "m/s^2"]),
        row("negative density", "0.0562 deg", "-0.0562 deg", &["axes[0].white.density", "-0.0562"]),
        row("not a number", "0.0562 deg", "NaN deg", &["axes[0].white.density", "NaN"]),
        row("zero correlation time", "190 s", "0 s", &["axes[0].gauss_markov[0].correlation_time", "0"]),
        row(
            "line above half the sample rate",
            "\"gauss_markov\"",
            &LINE.replace("20 Hz", "60 Hz"),
            &["axis 'x'", "oscillation", "60.00 Hz", "half the sample rate"],
        ),
        (
            "simulated line above half the sample rate",
            "params.json",
            params("\"gauss_markov\"", LINE),
            "simulate params.json -o log.csv --duration 10s --rate 30",
            &["axis 'x'", "20.00 Hz", "30.00 Hz"],
        ),
        row("zero sample rate", "100 Hz", "0 Hz", &["sample_rate", "0"]),
        row("no white noise", "\"white\": { \"density\": \"0.0562 deg/s/sqrt(Hz)\" },", "", &["x", "white"]),
        (
            "no axes",
            "params.json",
            br#"{"format": "kfdesign-params/1", "quantity": "angular-rate", "sample_rate": "100 Hz", "axes": []}"#
                .to_vec(),
            run,
            &["axes", "params.json"],
        ),
        (
            "output in no folder",
            "params.json",
            params("x", "x"),
            "tune params.json -o no/such/out.json",
            &["no/such/out.json"],
        ),
        (
            "output equal to input",
            "params.json",
            params("x", "x"),
            "tune params.json -o params.json",
            &["params.json", "input"],
        ),
        (
            "output equal to input by another path",
            "params.json",
            params("x", "x"),
            "tune params.json -o ./params.json",
            &["params.json", "input"],
        ),
        (
            "simulated log over its parameters",
            "params.json",
            params("x", "x"),
            "simulate params.json -o params.json --duration 10s",
            &["params.json"],
        ),
        (
            "negative duration",
            "params.json",
            params("x", "x"),
            "simulate params.json -o log.csv --duration=-5s",
            &["duration"],
        ),
        (
            "simulated log of no known format",
            "params.json",
            params("x", "x"),
            "simulate params.json -o log.xyz --duration 10s",
            &["log.xyz", "csv"],
        ),
    ]);
}

#[test]
fn plants_that_cannot_be_tuned() {
    /// The sound parameters with this design section.
    fn row<'a>(what: &'a str, design: &str, words: &'a [&'a str]) -> Row<'a> {
        let section = format!("\"design\": {design}, \"quantity\"");
        (what, "params.json", params("\"quantity\"", &section), "tune params.json -o out.json", words)
    }
    fn flags<'a>(command: &'a str, words: &'a [&'a str]) -> Row<'a> {
        (command, "params.json", params("x", "x"), command, words)
    }
    // two states of which only the first is seen, and the second moves
    let unseen = r#"{"plant": "custom", "custom": {"time": "continuous", "sensor": "turn", "A": [[-1, 0], [0, 0]], "G": [[1, 0], [0, 1]],
        "H": [[1, 0]], "states": [{"name": "turn", "unit": "rad/s", "std_dev": "1 rad/s"}, {"name": "slip", "unit": "m", "std_dev": "1 m"}],
        "outputs": [{"name": "turn", "unit": "rad/s"}]}}"#;
    let angle = r#"{"plant": "angle", "aids": [{"name": "heading", "std_dev": "2 deg", "rate": "1 Hz"}]}"#;
    assert_refused(vec![
        row(
            "no such plant",
            r#"{"plant": "rocket"}"#,
            &["design.plant: unknown plant 'rocket'; known plants: static, angle"],
        ),
        row("unknown key", r#"{"plant": "angle", "aid": []}"#, &["design.aid: unknown key; did you mean 'aids'?"]),
        row(
            "key of another plant",
            r#"{"plant": "angle", "motion": {}}"#,
            &["design.motion: is no matter of the plant 'angle'"],
        ),
        row("no aid", r#"{"plant": "angle"}"#, &["axis 'x': nothing measures the angle; give an aid"]),
        row(
            "aid of nothing",
            r#"{"plant": "static", "aids": [{"name": "a", "std_dev": "1 deg"}]}"#,
            &["'static' has nothing to aid"],
        ),
        row(
            "aid without noise",
            &angle.replace("2 deg", "0 deg"),
            &["design.aids[0].std_dev: 0 deg must be greater than zero"],
        ),
        row(
            "aid in another unit",
            &angle.replace("2 deg", "2 deg/s"),
            &["design.aids[0].std_dev", "deg/s", "expected an angle"],
        ),
        row("aid of no rate", &angle.replace("1 Hz", "0 Hz"), &["design.aids[0].rate: 0 Hz must be greater than zero"]),
        row("motion left out", r#"{"plant": "rate"}"#, &["design.motion: missing"]),
        row("accelerometer left out", r#"{"plant": "vertical"}"#, &["design.accelerometer: missing"]),
        row("unseen state", unseen, &["axis 'x': there is no steady state: slip reaches no measurement"]),
        row(
            "contradictory units",
            &unseen.replace(r#""unit": "rad/s"}]}}"#, r#""unit": "m/s"}]}}"#),
            &["sensor: 'turn' is in m/s, but the sensor measures in rad/s"],
        ),
        row("unit that is not SI", &unseen.replace("\"m\"", "\"km\""), &["states[1].unit", "'km' is not an SI unit"]),
        row(
            "matrix of another size",
            &unseen.replace("[[1, 0]]", "[[1]]"),
            &["design.custom.H: expected 1 rows of 2 numbers"],
        ),
        row(
            "no sensor",
            &unseen.replace("\"sensor\": \"turn\"", "\"sensor\": \"gyro\""),
            &["'gyro' is neither an input nor an output"],
        ),
        row(
            "state with the name of another",
            &unseen.replace("slip", "bias"),
            &["states[1].name: 'bias' is the name of a state of the sensor too"],
        ),
        flags("tune params.json --plant rocket -o out.json", &["--plant: unknown plant 'rocket'"]),
        flags("tune params.json --plant angle -o out.json", &["nothing measures the angle", "--aid"]),
        flags(
            "tune params.json --plant angle --aid 2deg -o out.json",
            &["--aid \"2deg\"", "expected a number and a unit"],
        ),
        flags("tune params.json --plant rate -o out.json", &["--plant rate", "--motion"]),
        flags("tune params.json --plant vertical -o out.json", &["--plant vertical", "--accelerometer"]),
        flags("tune params.json --plant custom -o out.json", &["--plant custom", "--plant FILE.json"]),
        flags("tune params.json --plant none.json -o out.json", &["--plant none.json: cannot read"]),
        flags("tune params.json --motion 5deg -o out.json", &["--motion is no matter of the plant 'static'"]),
    ]);
}

#[test]
fn plans_that_cannot_be_made() {
    fn row<'a>(flags: &'a str, words: &'a [&'a str]) -> Row<'a> {
        (flags, "params.json", params("x", "x"), flags, words)
    }
    let good = "plan params.json --parameter white.density --precision 10% -o out.json";
    let rate = params("\"sample_rate\"", "\"sample_rates\"");
    assert_refused(vec![
        ("missing file", "", vec![], good, &["params.json: cannot read"]),
        ("no sample rate", "params.json", rate, good, &["params.json", "sample_rate"]),
        row("plan params.json --precision 10%", &["--parameter"]),
        row("plan params.json --parameter white.density", &["--precision"]),
        row(
            "plan params.json --parameter white.std_dev --precision 10% -o out.json",
            &[
                "--parameter white.std_dev: params.json has no such parameter; it has white.density, gauss_markov.std_dev",
            ],
        ),
        row(
            "plan params.json --parameter white.density --precision 10% --axis w",
            &["--axis w: params.json has no such axis; it has"],
        ),
        row(
            "plan params.json --parameter white.density --precision 10",
            &["--precision 10: expected a share above 0 and at most 1, such as 10% or 0.1"],
        ),
        row("plan params.json --parameter white.density --precision ten", &["--precision ten: expected"]),
        row("plan params.json --parameter white.density --precision 0%", &["--precision 0%: expected"]),
        row("plan params.json --parameter white.density --precision=-5%", &["--precision -5%: expected"]),
        row("plan params.json --parameter white.density --precision nan", &["--precision nan: expected"]),
        row("plan params.json --parameter white.density --precision 10% --rate 0", &["--rate 0: expected a positive"]),
        row("plan params.json --parameter white.density --precision 10% -o params.json", &["params.json", "input"]),
    ]);
}

/// filter.json of the sound parameters with one change made to its document, and a log beside it.
fn filter(change: impl Fn(&mut serde_json::Value)) -> Vec<u8> {
    let bench = Bench::new();
    bench.file("params.json", params("x", "x"));
    bench.ok("tune params.json -o filter.json");
    let mut document: serde_json::Value = serde_json::from_str(&bench.read("filter.json")).unwrap();
    change(&mut document);
    serde_json::to_vec(&document).unwrap()
}

#[test]
fn filters_that_cannot_be_used() {
    use serde_json::json;
    // the log is never reached
    fn row<'a>(what: &'a str, change: &dyn Fn(&mut serde_json::Value), words: &'a [&'a str]) -> Row<'a> {
        let run = "replay filter.json log.csv -o out.csv --report out.html --plot out.svg";
        (what, "filter.json", filter(change), run, words)
    }
    let run = "replay filter.json log.csv -o out.csv";
    assert_refused(vec![
        ("missing file", "", vec![], run, &["filter.json: cannot read"]),
        row("non-square F", &|d| d["axes"][0]["F"] = json!([[1.0, 0.0]]), &["filter.json", "axes[0].F", "2"]),
        row("asymmetric P0", &|d| d["axes"][0]["P0"][0][1] = json!(1e-3), &["axes[0].P0", "symmetric"]),
        row("negative variance", &|d| d["axes"][0]["Q"][1][1] = json!(-1e-9), &["axes[0].Q[1][1]", "negative"]),
        row("indefinite Q", &|d| d["axes"][0]["Q"] = json!([[1e-9, 1e-6], [1e-6, 1e-9]]), &["axes[0].Q", "definite"]),
        row("R is zero", &|d| d["axes"][0]["R"][0][0] = json!(0.0), &["axes[0].R"]),
        row("mismatched sizes", &|d| d["axes"][0]["H"] = json!([[1.0, 1.0, 1.0]]), &["axes[0].H", "3"]),
        row("ragged matrix", &|d| d["axes"][0]["Q"][1] = json!([0.0]), &["axes[0].Q"]),
        row("x0 too short", &|d| d["axes"][0]["x0"] = json!([0.0]), &["axes[0].x0"]),
        row("text in a matrix", &|d| d["axes"][0]["F"][0][0] = json!("one"), &["axes[0].F"]),
        row("null in a matrix", &|d| d["axes"][0]["F"][0][0] = json!(null), &["axes[0].F"]),
        row("unknown key", &|d| d["axes"][0]["Qq"] = json!(1), &["axes[0]", "Qq"]),
        row("no axes", &|d| d["axes"] = json!([]), &["axes"]),
        row("another format", &|d| d["format"] = json!("kfdesign-params/1"), &["format", "kfdesign-filter/1"]),
    ]);
}

/// What is wrong, the parameters, the log, its flags, words of the message.
type Held<'a> = (&'a str, Vec<u8>, Vec<u8>, String, &'a [&'a str]);

/// A sensor with one axis "x" and two terms, of which one may be changed.
fn noise(white: &str, more: &str) -> Vec<u8> {
    format!(
        r#"{{"format": "kfdesign-params/1", "quantity": "angular-rate", "sample_rate": "100 Hz", "axes": [{{"name": "x"{white}{more}}}]}}"#
    )
    .into_bytes()
}

#[test]
fn models_that_cannot_be_held_against_a_log() {
    const WHITE: &str = r#", "white": {"density": "0.1 deg/s/sqrt(Hz)"}"#;
    // log.npy is what the test makes of rows of two numbers
    let table = |rows: &dyn Fn(usize) -> f64, count: usize| {
        let data: Vec<u8> = (0..count).flat_map(|i| rows(i).to_le_bytes()).collect();
        npy(&format!("{{'descr': '<f8', 'fortran_order': False, 'shape': ({count}, 1), }}"), &data)
    };
    let noisy = |i: usize| (i * 7919 % 1000) as f64 * 1e-3;
    let flags = "--columns 1 --unit deg/s --rate 100";
    let line = r#", "oscillation": [{"std_dev": "1 deg/s", "frequency": "80 Hz", "correlation_time": "1 s"}]"#;
    let mut wrong = Vec::new();
    for verb in ["compare", "inflate"] {
        let more = if verb == "compare" { "--report out.html --plot out.svg" } else { "" };
        let rows: Vec<Held> = vec![
            ("no log", noise(WHITE, ""), vec![], flags.into(), &["log.npy"]),
            ("no params", b"{".to_vec(), table(&noisy, 500), flags.into(), &["params.json", "line 1"]),
            ("too short", noise(WHITE, ""), table(&noisy, 60), flags.into(), &["log.npy", "60 samples", "100"]),
            ("constant", noise(WHITE, ""), table(&|_| 0.5, 500), flags.into(), &["log.npy", "constant", "column"]),
            (
                "another quantity",
                noise(WHITE, ""),
                table(&noisy, 500),
                "--columns 1 --unit g --rate 100".into(),
                &["log.npy", "m/s^2", "rad/s", "--columns"],
            ),
            ("no noise", noise("", ""), table(&noisy, 500), flags.into(), &["log.npy", "'x'", "no random noise"]),
            (
                "a fast line",
                noise(WHITE, line),
                table(&noisy, 500),
                flags.into(),
                &["log.npy", "80", "half the sample rate"],
            ),
        ];
        for (what, params, log, flags, words) in rows {
            let bench = Bench::new();
            bench.file("params.json", params);
            if !log.is_empty() {
                bench.file("log.npy", log);
            }
            let before = bench.files();
            let out = bench.run(&format!("{verb} params.json log.npy {flags} -o out.json {more}"));
            let last = out.stderr.lines().last().unwrap_or_default();
            let told = last.starts_with("kfdesign: ") && words.iter().all(|word| last.contains(word));
            let once = out.stderr.lines().filter(|line| line.starts_with("kfdesign: ")).count() == 1;
            if out.status != 2 || !told || !once || !out.stdout.is_empty() || bench.files() != before {
                wrong.push(format!("{verb}, {what}: {out:?}, files {:?}, expected {words:?}", bench.files()));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n\n"));
    assert_refused(vec![
        ("alpha of two", "x.csv", vec![], "compare p.json x.csv --alpha 2", &["--alpha", "2", "between 0 and 1"]),
        ("params as output", "p.json", vec![], "compare p.json x.csv -o p.json", &["p.json", "input"]),
        ("params as inflated", "p.json", vec![], "inflate p.json x.csv -o p.json", &["p.json", "input"]),
        ("a negative frequency", "p.json", vec![], "inflate p.json x.csv --from=-1", &["--from", "-1"]),
    ]);
}

#[test]
fn outputs_that_cannot_be_written() {
    let csv = || log("t_s,gyro_x (deg/s),gyro_y (deg/s)", usize::MAX, "");
    assert_refused(vec![
        ("no such folder", "log.csv", csv(), "allan log.csv -o no/such/out.json", &["no/such/out.json: cannot write"]),
        (
            "plot in no folder",
            "log.csv",
            csv(),
            "allan log.csv --plot no/such/out.svg",
            &["no/such/out.svg: cannot write"],
        ),
        ("output equal to input", "log.csv", csv(), "allan log.csv -o log.csv", &["log.csv", "input"]),
        ("plot equal to input", "log.csv", csv(), "allan log.csv --plot log.csv", &["log.csv", "input"]),
    ]);
}
