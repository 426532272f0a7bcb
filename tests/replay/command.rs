//! `kfdesign replay` as a user runs it.

use approx::assert_relative_eq;

use super::{draw, skydog};

/// The log of the small oracle as text, three decimals would not do: shortest exact numbers.
fn log_text(z: &[f64], dt: f64) -> String {
    let mut text = String::from("t (s),x (rad/s)\n");
    for (k, value) in z.iter().enumerate() {
        text.push_str(&format!("{},{value}\n", k as f64 * dt));
    }
    text
}

/// A filter runs on rates: increments and angles, which other commands turn into rates, are refused, not taken for
/// them.
#[test]
fn increments_are_no_rates() {
    let bench = crate::support::Bench::new();
    let right = skydog(0.1, 1.0, 1.0, 1.0);
    bench.file("filter.json", right.to_json());
    bench.file("log.csv", log_text(&draw(&right, 5, 2000), 0.1));
    let params = crate::support::data("params.json").display().to_string();
    for kind in ["increments", "angle"] {
        for command in [
            "replay filter.json log.csv --unit rad".to_string(),
            format!("tune {params} --objective likelihood --log log.csv -o f.json"),
        ] {
            let out = bench.run(&format!("{command} --input {kind}"));
            assert_eq!(out.status, 2, "{command}: {}", out.stdout);
            assert!(out.stderr.contains(&format!("--input {kind}: a filter runs on rates")), "{}", out.stderr);
        }
    }
    assert!(!bench.files().contains(&"f.json".to_string()));
}

/// The command on a right and on a wrong design: exit status, the document's keys, the estimates file, page and
/// figures.
#[test]
fn command_end_to_end() {
    let bench = crate::support::Bench::new();
    let right = skydog(0.1, 1.0, 1.0, 1.0);
    let log = draw(&right, 5, 12_000);
    bench.file("filter.json", right.to_json());
    bench.file("wrong.json", skydog(0.1, 1.2, 1.0, 1.0).to_json());
    bench.file("log.csv", log_text(&log, 0.1));

    let text = bench.ok("replay filter.json log.csv -o est.csv --innovations --report page.html --plot figures.svg");
    assert!(text.contains("\nconsistent: "), "{text}");
    let estimates = bench.read("est.csv");
    let header = "time (s),x_bias (rad/s),x_bias_sigma (rad/s),x_drift (rad/s),x_drift_sigma (rad/s),\
                  x_innovation (rad/s),x_innovation_sigma (rad/s),x_nis";
    assert_eq!(estimates.lines().next(), Some(header));
    assert_eq!(estimates.lines().count(), 12_001);
    let page = bench.read("page.html");
    assert!(page.contains("consistent") && page.contains("<svg") && !page.contains("<script"));
    assert!(bench.read("figures.svg").starts_with("<svg"));

    let document: serde_json::Value = serde_json::from_str(&bench.ok("replay filter.json log.csv --json")).unwrap();
    assert_eq!(document["format"], "kfdesign-replay/1");
    assert_eq!(document["verdict"], "consistent");
    let axis = &document["axes"][0];
    assert_eq!(
        (&axis["name"], &axis["samples"], &axis["gaps"], &axis["rejected"]),
        (&"x".into(), &12_000.into(), &0.into(), &0.into())
    );
    for (object, keys) in [
        (&axis["nis"], &["mean", "lower", "upper"][..]),
        (&axis["whiteness"], &["max_abs_autocorrelation", "lag", "interval", "ljung_box"]),
        (
            &document["tests"][0],
            &["axis", "name", "statistic", "lower", "upper", "p_value", "adjusted_p_value", "pass", "meaning"],
        ),
    ] {
        for key in keys {
            assert!(!object[key].is_null(), "{key} in {object}");
        }
    }
    // the file's innovations give the document's log-likelihood and mean NIS: one record, one truth
    let rows = estimates.lines().skip(1).map(|l| l.split(',').map(|c| c.parse::<f64>().unwrap()).collect::<Vec<_>>());
    let (mut log_likelihood, mut nis) = (0.0, 0.0);
    for row in rows {
        log_likelihood -= 0.5 * ((std::f64::consts::TAU * row[6] * row[6]).ln() + row[7]);
        nis += row[7] / 12_000.0;
    }
    assert_relative_eq!(axis["log_likelihood"].as_f64().unwrap(), log_likelihood, max_relative = 1e-11);
    assert_relative_eq!(axis["nis"]["mean"].as_f64().unwrap(), nis, max_relative = 1e-11);

    let failed = bench.run("replay wrong.json log.csv --json");
    assert_eq!(failed.status, 1, "{}", failed.stderr);
    assert!(failed.stdout.contains("\"verdict\": \"inconsistent\""));
    let short = bench.run("replay filter.json log.csv --end 60");
    // what says nothing is no green light, unless that is asked for
    assert_eq!(short.status, 1);
    assert!(short.stdout.contains("\ninconclusive: x: "), "{}", short.stdout);
    let allowed = bench.run("replay filter.json log.csv --end 60 --allow-inconclusive");
    assert_eq!((allowed.status, &allowed.stdout), (0, &short.stdout));
    assert_eq!(bench.run("replay wrong.json log.csv --allow-inconclusive").status, 1);
}

/// What the model is linear about is taken off on every road: whole stretches, row by row and smoothed, a log 0.1 rad/s
/// higher gives the numbers of the log itself, but for the rounding of 0.1.
#[test]
fn about_is_taken_off() {
    let bench = crate::support::Bench::new();
    let right = skydog(0.1, 1.0, 1.0, 1.0);
    let log = draw(&right, 5, 9000);
    bench.file("filter.json", right.to_json());
    bench.file("log.csv", log_text(&log, 0.1));
    let mut about: serde_json::Value = serde_json::from_str(&right.to_json()).unwrap();
    about["axes"][0]["about"] = serde_json::json!({ right.axes[0].model.measurements[0].name.as_str(): 0.1 });
    bench.file("about.json", about.to_string());
    bench.file("higher.csv", log_text(&log.iter().map(|z| z + 0.1).collect::<Vec<_>>(), 0.1));
    for more in ["", "-o NAME", "-o NAME --innovations", "-o NAME --smooth"] {
        let replay = |filter: &str, log: &str, name: &str| -> (serde_json::Value, Vec<f64>) {
            let flags = more.replace("NAME", name);
            let out = bench.run(&format!("replay {filter} {log} {flags} --json --allow-inconclusive"));
            let rows = if flags.is_empty() { String::new() } else { bench.read(name) };
            let numbers = rows.lines().skip(1).flat_map(|l| l.split(',').map(|c| c.parse().unwrap()));
            (serde_json::from_str(&out.stdout).unwrap(), numbers.collect())
        };
        let (plain, rows) = replay("filter.json", "log.csv", "plain.csv");
        let (shifted, others) = replay("about.json", "higher.csv", "shifted.csv");
        for key in ["nis", "log_likelihood", "whiteness"] {
            let ([a, b], mut numbers) = ([&plain, &shifted].map(|found| &found["axes"][0][key]), 0);
            near(a, b, key, &mut numbers);
            assert!(numbers > 0, "{more}: {key}");
        }
        assert_eq!(rows.len(), others.len());
        assert_eq!(rows.is_empty(), more.is_empty());
        let differs = rows.iter().zip(&others).find(|(a, b)| (**a - **b).abs() > 1e-9);
        assert_eq!(differs, None, "{more}");
    }
}

/// Every number within 1e-9 of its size; how many there are.
fn near(a: &serde_json::Value, b: &serde_json::Value, at: &str, numbers: &mut u32) {
    use serde_json::Value::{Array, Number, Object};
    match (a, b) {
        (Number(x), Number(y)) => {
            *numbers += 1;
            assert_relative_eq!(x.as_f64().unwrap(), y.as_f64().unwrap(), max_relative = 1e-9, epsilon = 1e-9);
        }
        (Object(x), Object(y)) => x.iter().for_each(|(key, value)| near(value, &y[key], key, numbers)),
        (Array(x), Array(y)) => x.iter().zip(y).for_each(|(x, y)| near(x, y, at, numbers)),
        _ => assert_eq!(a, b, "{at}"),
    }
}

/// `--smooth` over a gap and an outlier: the filtered columns are those of the plain output, to the bit; sigmas
/// shrink, at the last sample nothing does.
#[test]
fn command_smooths() {
    let bench = crate::support::Bench::new();
    let right = skydog(0.1, 1.0, 1.0, 1.0);
    let mut log = draw(&right, 5, 3000);
    log[700] = 1e3;
    bench.file("filter.json", right.to_json());
    let text = log_text(&log, 0.1);
    let lines: Vec<&str> =
        text.lines().enumerate().filter(|(i, _)| !(1200..1300).contains(i)).map(|(_, l)| l).collect();
    bench.file("log.csv", lines.join("\n") + "\n");
    bench.ok("replay filter.json log.csv --gate 6 -o plain.csv --allow-inconclusive");
    let said = bench.ok("replay filter.json log.csv --gate 6 -o smooth.csv --smooth --allow-inconclusive");
    assert!(said.contains("\nx "), "{said}");
    let rows = |name: &str| -> Vec<Vec<String>> {
        bench.read(name).lines().map(|l| l.split(',').map(str::to_owned).collect()).collect()
    };
    let (plain, smooth) = (rows("plain.csv"), rows("smooth.csv"));
    assert_eq!((plain.len(), smooth.len()), (2901, 2901));
    assert_eq!(smooth[0][3..5], ["x_bias_smoothed (rad/s)", "x_bias_smoothed_sigma (rad/s)"]);
    let (mut filtered, mut smoothed) = (0.0, 0.0);
    for (a, b) in plain.iter().zip(&smooth) {
        assert_eq!([&a[0], &a[1], &a[2], &a[3], &a[4]], [&b[0], &b[1], &b[2], &b[5], &b[6]]);
    }
    let number = |text: &String| text.parse::<f64>().unwrap();
    for row in &smooth[1..] {
        assert!(number(&row[8]) <= number(&row[6]) * (1.0 + 1e-12), "{row:?}");
        filtered += number(&row[6]);
        smoothed += number(&row[8]);
    }
    // far from the ends the drift is seen from both sides
    assert!(smoothed < 0.95 * filtered, "{smoothed} {filtered}");
    assert_eq!(smooth[2900][5], smooth[2900][7]);
}

/// What cannot be done: one line, exit 2, and no file left behind.
#[test]
fn command_refuses() {
    let bench = crate::support::Bench::new();
    let right = skydog(0.1, 1.0, 1.0, 1.0);
    bench.file("filter.json", right.to_json());
    bench.file("log.csv", log_text(&draw(&right, 5, 200), 0.1));
    bench.file("fast.csv", log_text(&draw(&right, 5, 200), 0.01));
    let before = bench.files();
    let cases = [
        ("replay filter.json fast.csv -o e.csv", "the filter is for 10 Hz"),
        ("replay filter.json log.csv --alpha 0", "alpha is 0"),
        ("replay filter.json log.csv --gate 0.1", "gate is 0.1"),
        ("replay filter.json log.csv -o log.csv", "it is the input file"),
        ("replay filter.json log.csv --report filter.json", "it is the input file"),
        ("replay filter.json log.csv -o e.txt", "extension"),
        ("replay filter.json log.csv -o e.csv --plot nowhere/f.svg", "cannot write"),
        ("replay filter.json log.csv --innovations", "--output"),
        ("replay filter.json log.csv --smooth", "--output"),
        ("replay filter.json log.csv -o e.csv --smooth --innovations", "--innovations"),
        ("replay missing.json log.csv", "missing.json"),
        ("replay filter.json missing.csv", "missing.csv"),
    ];
    for (command, message) in cases {
        let out = bench.run(command);
        assert_eq!(out.status, 2, "{command}: {}", out.stderr);
        assert!(out.stderr.contains(message), "{command}: {}", out.stderr);
        assert_eq!(bench.files(), before, "{command}");
    }
}
