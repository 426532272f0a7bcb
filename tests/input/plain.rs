//! Names and texts of files, wherever they come out again: no control character, no separator of lines, no mark that
//! turns the direction of what follows, no formula in a table.

use super::super::support::Bench;

/// An escape sequence, a bell, separators of lines and paragraphs, the next line of the C1 controls, an override of
/// the direction, a mark.
const ACTING: &str = "\x1b[31m\x07\u{85}\u{2028}\u{2029}\u{202e}\u{2066}\u{200f}\u{61c}";

fn clean(what: &str, bytes: &[u8]) {
    let text = String::from_utf8_lossy(bytes);
    let acts = |c: char| {
        (c.is_control() && !matches!(c, '\n' | '\r' | '\t'))
            || "\u{2028}\u{2029}\u{61c}\u{200e}\u{200f}\u{202a}\u{202b}\u{202c}\u{202d}\u{202e}".contains(c)
            || ('\u{2066}'..='\u{2069}').contains(&c)
    };
    if let Some(at) = text.find(acts) {
        panic!("{what}: {:?}", text[at..].chars().take(60).collect::<String>());
    }
}

/// White noise of a fixed seed, about 0.1 deg/s, with time in the first column.
fn rows(columns: usize) -> String {
    let mut state = 0x2545_f491_4f6c_dd1d_u64;
    let mut uniform = || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) as f64 / (1u64 << 53) as f64
    };
    (0..20_000)
        .map(|row| {
            let cells: Vec<String> =
                (0..columns).map(|_| format!("{:.4}", 0.2 * (0..6).map(|_| uniform() - 0.5).sum::<f64>())).collect();
            format!("{:.2},{}\n", f64::from(row) * 0.01, cells.join(","))
        })
        .collect()
}

#[test]
fn names_of_a_log_and_of_documents_come_out_plain() {
    let bench = Bench::new();
    bench.file("log.csv", format!("time (s),=gyro{ACTING}x (deg/s),@gyro{ACTING}y (deg/s)\n{}", rows(2)));
    let axis = |name: &str| {
        format!(
            r#"{{"name": {}, "white": {{"density": {{"value": 0.01, "unit": "deg/s/sqrt(Hz)"}}}}, "gauss_markov": [{{"std_dev": {{"value": 0.003, "unit": "deg/s"}}, "correlation_time": {{"value": 100, "unit": "s"}}}}]}}"#,
            serde_json::to_string(name).unwrap()
        )
    };
    let names = [format!("=gyro{ACTING}x"), format!("@gyro{ACTING}y --><evil/><!-- */ ]]>")];
    bench.file(
        "params.json",
        format!(
            r#"{{"format": "kfdesign-params/1", "quantity": "angular-rate", "sample_rate": {{"value": 100, "unit": "Hz"}}, "axes": [{}, {}]}}"#,
            axis(&names[0]),
            axis(&names[1])
        ),
    );
    let runs = [
        "info log.csv",
        "info log.csv --json",
        "allan log.csv --plot allan.svg --report allan.html",
        "allan log.csv --json",
        "identify log.csv -o found.json --plot found.svg --report found.html",
        "identify log.csv --json",
        "tune params.json -o filter.json --report tune.html",
        "tune params.json --json",
        "compare params.json log.csv --report compare.html",
        "replay filter.json log.csv -o estimates.csv --report replay.html",
        "replay filter.json log.csv --json",
        "simulate params.json -o simulated.csv --duration 20s --seed 1",
        "montecarlo filter.json --runs 20 --duration 3000s --junit runs.xml --report runs.html -o runs.json",
        "export params.json --to kalibr --walk horizon=60s -o imu.yaml",
        "export params.json --to openvins --walk horizon=60s -o openvins.yaml",
        "export params.json --to px4 --walk horizon=60s --axis mean -o px4.params",
        "export params.json --to gtsam --walk horizon=60s -o gtsam.txt",
        "export filter.json --to c -o filter.c",
        "export filter.json --to rust -o filter.rs",
    ];
    for run in runs {
        let outcome = bench.run(run);
        clean(run, outcome.stdout.as_bytes());
        clean(run, outcome.stderr.as_bytes());
        let wrong = |word: &str| outcome.stderr.contains(word);
        assert!(!wrong("panicked") && !wrong("no such file"), "{run}: {}", outcome.stderr);
    }
    let written = bench.files();
    for file in ["filter.json", "estimates.csv", "simulated.csv", "runs.xml", "imu.yaml", "filter.c", "filter.rs"] {
        assert!(written.iter().any(|name| name == file), "{file} is not written");
    }
    for name in written.iter().filter(|name| !["log.csv", "params.json"].contains(&name.as_str())) {
        clean(name, &std::fs::read(bench.path(name)).unwrap());
        if name.ends_with(".csv") {
            let header = bench.read(name).lines().next().unwrap().to_string();
            let formula = |cell: &str| cell.trim_start_matches('"').starts_with(['=', '+', '-', '@']);
            assert!(header.contains("gyro") && !header.split(',').any(formula), "{name}: {header}");
        }
    }
}

#[test]
fn messages_quote_plain_words() {
    let bench = Bench::new();
    let quoted = serde_json::to_string(ACTING).unwrap();
    let params = |key: &str, rate: &str, format: &str| {
        format!(
            r#"{{"format": {format}, {key}: 1, "quantity": "angular-rate", "sample_rate": {{"value": 1, "unit": {rate}}}, "axes": []}}"#
        )
    };
    let format = "\"kfdesign-params/1\"";
    bench.file("key.json", params(&quoted, "\"Hz\"", format));
    bench.file("unit.json", params("\"source\"", &quoted, format));
    bench.file("format.json", params("\"source\"", "\"Hz\"", &quoted));
    bench.file("cell.csv", format!("time (s),gyro_x (deg/s)\n0,1\n0.01,{ACTING}X\n0.02,3\n"));
    bench.file("unit.csv", format!("time (s),gyro_x ({ACTING})\n0,1\n0.01,2\n0.02,3\n"));
    bench.file("imu.yaml", format!("gyroscope_noise_density: {ACTING}\nupdate_rate: 200\n"));
    bench.file("log\x1b[31m\u{2028}.csv", "no rows");
    let runs: [&[&str]; 8] = [
        &["tune", "key.json"],
        &["tune", "unit.json"],
        &["tune", "format.json"],
        &["allan", "cell.csv"],
        &["allan", "unit.csv"],
        &["import", "imu.yaml"],
        &["info", "log\x1b[31m\u{2028}.csv"],
        &["allan", "cell.csv", "--columns", "2", "--time", "none", "--rate", "100"],
    ];
    for run in runs {
        let outcome = bench.run_args(run);
        assert_eq!(outcome.status, 2, "{run:?}: {}", outcome.stderr);
        assert_eq!(outcome.stderr.lines().count(), 1, "{run:?}: {}", outcome.stderr);
        clean(&format!("{run:?}"), outcome.stderr.as_bytes());
    }
}
