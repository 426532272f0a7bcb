//! Bad input of `montecarlo` and `merge`: one clear line, exit status 2, nothing left behind.

use serde_json::{Value, json};

use super::{SMALL, bench, changed, two_axes};
use crate::support::Bench;

const RUN: &str = "montecarlo filter.json --duration 20s";

/// Each row: the arguments, and words that the line on stderr must contain.
fn assert_refused(bench: &Bench, rows: &[(&[&str], &[&str])]) {
    let before: Vec<(String, Vec<u8>)> =
        bench.files().into_iter().map(|name| (name.clone(), std::fs::read(bench.path(&name)).unwrap())).collect();
    let mut wrong = Vec::new();
    for (args, words) in rows {
        let out = bench.run_args(args);
        let one_line = out.stderr.lines().count() == 1 && out.stderr.starts_with("kfdesign: ");
        let told = words.iter().all(|word| out.stderr.contains(word));
        let kept = bench.files().len() == before.len()
            && before.iter().all(|(name, bytes)| std::fs::read(bench.path(name)).unwrap() == *bytes);
        if out.status != 2 || !out.stdout.is_empty() || !one_line || !told || !kept {
            wrong.push(format!("kfdesign {args:?}\n{out:?}, files {:?}, expected {words:?}", bench.files()));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n\n"));
}

/// The same for flags after [`RUN`], split at spaces.
fn assert_flags_refused(bench: &Bench, rows: &[(&str, &[&str])]) {
    let words: Vec<(Vec<&str>, &[&str])> =
        rows.iter().map(|(flags, words)| (RUN.split(' ').chain(flags.split(' ')).collect(), *words)).collect();
    let rows: Vec<(&[&str], &[&str])> = words.iter().map(|(args, words)| (args.as_slice(), *words)).collect();
    assert_refused(bench, &rows);
}

#[test]
fn numbers_that_make_no_experiment() {
    let bench = bench(SMALL);
    let runs = "expected a number of runs of at least 1, or a range like 500..1000";
    let below = "expected run numbers up to 1099511627776";
    let probability = "expected a probability between 0 and 1";
    let replicates = "expected at most 1000000";
    assert_flags_refused(
        &bench,
        &[
            ("--runs 0", &["--runs 0:", runs]),
            ("--runs -5", &["--runs -5:", runs]),
            ("--runs 5..5", &["--runs 5..5:", runs]),
            ("--runs 9..3", &["--runs 9..3:", runs]),
            ("--runs ..3", &["--runs ..3:", runs]),
            ("--runs 2.5", &["--runs 2.5:", runs]),
            ("--runs 1e30", &["--runs 1e30:", runs]),
            ("--runs 18446744073709551616", &["--runs 18446744073709551616:", runs]),
            ("--runs 0..18446744073709551615", &["--runs 0..18446744073709551615:", below]),
            ("--runs 18446744073709551600..18446744073709551615", &[below]),
            ("--runs 1", &["--runs 1:", "expected at least 2"]),
            ("--runs 10 --alpha 0", &["--alpha 0:", probability]),
            ("--runs 10 --alpha 1", &["--alpha 1:", probability]),
            ("--runs 10 --alpha -1", &["--alpha -1:", probability]),
            ("--runs 10 --alpha nan", &["--alpha NaN:", probability]),
            ("--runs 10 --alpha many", &["--alpha", "'many'"]),
            ("--runs 10 --threads 0", &["--threads 0:", "expected 1 to 1024"]),
            ("--runs 10 --threads 100000", &["--threads 100000:", "expected 1 to 1024"]),
            ("--runs 10 --threads -1", &["-1"]),
            ("--runs 10 --replicates -1", &["-1"]),
            ("--runs 10 --replicates 18446744073709551615", &["replicates is 1844674407370955", replicates]),
            ("--runs 10 --confirm 18446744073709551615", &["--confirm 18446744073709551615:", replicates]),
            ("--runs 10 --seed -1", &["-1"]),
            ("--run 3", &["--run 3", "-o FILE"]),
            ("--run -1 -o run.csv", &["-1"]),
            ("--run 18446744073709551615 -o run.csv", &["--run 18446744073709551615:", "below 1099511627776"]),
            ("--run 3 -o run.xlsx", &["run.xlsx"]),
            ("--run 3 --runs 10 -o run.csv", &["--run", "--runs"]),
            ("--runs 10 --resume", &["--output"]),
        ],
    );
}

#[test]
fn a_duration_that_is_none_or_too_short() {
    let bench = bench(SMALL);
    let number = "expected a number and a unit";
    let rows: [(&str, &[&str]); 9] = [
        ("0s", &["--duration 0s:", "expected 6.400 s to"]),
        ("-5s", &["--duration -5s:", "expected 6.400 s to"]),
        ("1s", &["--duration 1s:", "expected 6.400 s to", "(64 to 10000000 samples at 10 Hz)"]),
        ("1e300s", &["--duration 1e300s:", "expected 6.400 s to"]),
        ("nan", &["--duration nan:", number]),
        ("infs", &["--duration infs:", number]),
        ("60", &["--duration 60:", number]),
        ("60m", &["--duration 60m:", "is a length, expected a time"]),
        ("60parsec", &["--duration 60parsec:", "unknown unit"]),
    ];
    let args: Vec<[&str; 6]> =
        rows.iter().map(|(text, _)| ["montecarlo", "filter.json", "--runs", "10", "--duration", text]).collect();
    let rows: Vec<(&[&str], &[&str])> = args.iter().zip(&rows).map(|(args, (_, words))| (&args[..], *words)).collect();
    assert_refused(&bench, &rows);
}

#[test]
fn a_truth_that_does_not_fit() {
    let bench = bench(SMALL);
    bench.file("two.json", two_axes());
    bench.file("renamed.json", changed(SMALL, |p| p["axes"][0]["name"] = json!("y")));
    let accelerometer = SMALL.replace("angular-rate", "specific-force").replace("deg/s", "m/s^2");
    bench.file("force.json", accelerometer);
    bench.file("units.json", SMALL.replace("0.5 deg/s", "0.5 deg"));
    bench.file("broken.json", &SMALL[..100]);
    assert_flags_refused(
        &bench,
        &[
            ("--truth none.json", &["none.json: cannot read"]),
            ("--truth filter.json", &["filter.json: format"]),
            ("--truth broken.json", &["broken.json: line", "not valid JSON"]),
            ("--truth two.json", &["the truth has the axes x, y, the filter x", "expected the same names"]),
            ("--truth renamed.json", &["the truth has the axes y, the filter x", "expected the same names"]),
            ("--truth force.json", &["the truth is specific-force, the filter angular-rate"]),
            ("--truth units.json", &["units.json: axes[0].turn_on_bias.std_dev", "is an angle"]),
            ("--truth-spread", &["axis 'x': no parameter has an interval to draw from"]),
        ],
    );
}

#[test]
fn a_plan_that_names_nothing() {
    let bench = bench(SMALL);
    let rows = [
        ("gauss_markov.std_dev", "expected a parameter and a factor"),
        ("gauss_markov.std_dev x0", "expected a parameter and a factor"),
        ("gauss_markov.std_dev x-1", "expected a parameter and a factor"),
        ("gauss_markov.std_dev xNaN", "expected a parameter and a factor"),
        ("gauss_markov.std_dev x1", "expected a parameter and a factor"),
        ("gauss_markov.std_dev x1e9", "expected a parameter and a factor"),
        ("gauss_markov.deviation x1.3", "parameters: white.density, gauss_markov.std_dev"),
        ("z:gauss_markov.std_dev x1.3", "no axis 'z'; there are x"),
    ];
    // refused before the work, so that a long experiment is not thrown away for a slip of the hand
    let args: Vec<[&str; 8]> = rows
        .iter()
        .map(|(plan, _)| ["montecarlo", "filter.json", "--duration", "20s", "--runs", "100000000", "--runs-for", *plan])
        .collect();
    let words: Vec<[&str; 2]> = rows.iter().map(|(plan, words)| [*plan, *words]).collect();
    let rows: Vec<(&[&str], &[&str])> = args.iter().zip(&words).map(|(args, words)| (&args[..], &words[..])).collect();
    assert_refused(&bench, &rows);
}

#[test]
fn outputs_that_cannot_be() {
    let bench = bench(SMALL);
    bench.file("shard.json", "{}");
    assert_flags_refused(
        &bench,
        &[
            ("--runs 10 -o filter.json", &["filter.json: cannot write: it is the input file"]),
            ("--runs 10 --junit filter.json", &["filter.json: cannot write: it is the input file"]),
            ("--runs 10 --truth params.json -o params.json", &["params.json: cannot write: it is the input file"]),
            ("--run 3 -o filter.json", &["filter.json: cannot write: it is the input file"]),
            ("--runs 10 -o no/where.json", &["no/where.json: cannot write: the folder 'no' does not exist"]),
            ("--runs 10 --junit no/where.xml", &["no/where.xml: cannot write: the folder 'no' does not exist"]),
            ("--runs 10 -o out --junit out", &["out: named by both -o and --junit; give them"]),
            ("--runs 10 -o out.json --junit ./out.json", &["out.json: named by both -o and --junit; give them"]),
            ("--runs 10 --resume -o shard.json", &["shard.json: format: found null"]),
        ],
    );
    assert_refused(&bench, &[(&["merge", "shard.json", "-o", "shard.json"], &["it is the input file"])]);
}

/// Documents of `runs` with further flags, by name.
fn shard(bench: &Bench, name: &str, runs: &str, flags: &str) {
    let out = bench.run(&format!("{RUN} --runs {runs} -o {name}.json {flags}"));
    assert!(out.status < 2, "{out:?}");
}

#[test]
fn shards_that_do_not_belong_together() {
    let bench = bench(SMALL);
    shard(&bench, "a", "0..8", "");
    shard(&bench, "b", "8..20", "");
    shard(&bench, "overlap", "6..20", "");
    shard(&bench, "late", "12..20", "");
    shard(&bench, "seed", "8..20", "--seed 2");
    shard(&bench, "alpha", "8..20", "--alpha 0.02");
    let longer = bench.run("montecarlo filter.json --duration 21s --runs 8..20 -o longer.json");
    assert!(longer.status < 2, "{longer:?}");
    shard(&bench, "truth", "8..20", "--truth params.json");
    shard(&bench, "replicates", "8..20", "--replicates 1");
    bench.file("params.json", SMALL.replace("5 s", "6 s"));
    bench.ok("tune params.json -o filter.json");
    shard(&bench, "design", "8..20", "");
    let other = "not the same experiment";
    assert_refused(
        &bench,
        &[
            (&["merge"], &["<SHARDS>"]),
            (&["merge", "none.json"], &["none.json: cannot read"]),
            (&["merge", "."], &["."]),
            (&["merge", "filter.json"], &["filter.json: format: found \"kfdesign-filter/1\", expected"]),
            (&["merge", "a.json", "overlap.json"], &["overlap.json: runs: runs 6..8 are also in a.json"]),
            (&["merge", "a.json", "late.json"], &["late.json: runs: runs 8..12 are missing between a.json and this"]),
            (&["merge", "a.json", "b.json", "a.json"], &["a.json: runs: runs 0..8 are also in a.json"]),
            (&["merge", "a.json", "seed.json"], &["seed.json: experiment.seed: found 2, but 1 in a.json", other]),
            (&["merge", "a.json", "alpha.json"], &["experiment.alpha: found 0.02, but 0.01 in a.json", other]),
            (&["merge", "a.json", "longer.json"], &["experiment.steps: found 210, but 200 in a.json", other]),
            (&["merge", "a.json", "truth.json"], &["experiment.truth: found an object, but null in a.json", other]),
            (&["merge", "a.json", "replicates.json"], &["experiment.replicates: found 1, but 0 in a.json", other]),
            (&["merge", "a.json", "design.json"], &["design.json: experiment.filter.axes[0].F[1][1]", other]),
        ],
    );
    // going on with another experiment, or from other runs
    assert_flags_refused(
        &bench,
        &[
            ("--runs 20 --resume -o a.json", &["a.json: experiment.filter.axes[0].F[1][1]", "in this command", other]),
            ("--runs 5..20 --resume -o design.json", &["design.json: runs: holds 8..20, which is no beginning of"]),
            ("--runs 8..19 --resume -o design.json", &["design.json: runs: holds 8..20, which is no beginning of"]),
            ("--runs 8..30 --seed 2 --resume -o design.json", &["experiment.seed: found 1, but 2 in this command"]),
        ],
    );
}

#[test]
fn documents_that_were_changed_or_damaged() {
    let bench = bench(SMALL);
    shard(&bench, "good", "0..8", "");
    let good = bench.read("good.json");
    let changed = |change: &dyn Fn(&mut Value)| changed(&good, change);
    let sums = |change: &dyn Fn(&mut Value)| changed(&|d| change(&mut d["sums"][0]));
    let damaged = "the file was changed or damaged";
    // log NEES, two means, then the lower triangle of the moments
    let rows: Vec<(&str, String, Vec<&str>)> = vec![
        ("truncated", good[..good.len() / 2].to_string(), vec!["not valid JSON"]),
        ("empty", String::new(), vec!["not valid JSON"]),
        ("other format", changed(&|d| d["format"] = json!("kfdesign-montecarlo/2")), vec!["format: found"]),
        ("no sums", changed(&|d| d["sums"] = json!([])), vec!["sums: found 0 axes, expected 1"]),
        ("sums of words", sums(&|s| s["values"][0] = json!(["x"])), vec!["sums[0]: expected \"values\""]),
        ("a sum short", sums(&|s| drop(s["values"].as_array_mut().unwrap().pop())), vec!["sums: axis 'x': found"]),
        ("a count short", sums(&|s| drop(s["counts"].as_array_mut().unwrap().pop())), vec!["sums: axis 'x': found"]),
        ("negative count", sums(&|s| s["counts"][0] = json!(-1)), vec!["sums[0]: expected", "counts"]),
        ("half a count", sums(&|s| s["counts"][0] = json!(0.5)), vec!["sums[0]: expected", "counts"]),
        ("count above runs", sums(&|s| s["counts"][2] = json!(9)), vec!["within 1, 2, 3 sigma", damaged]),
        ("largest count", sums(&|s| s["counts"][2] = json!(u64::MAX)), vec!["within 1, 2, 3 sigma", damaged]),
        ("counts that shrink", sums(&|s| s["counts"][1] = json!(0)), vec!["within 1, 2, 3 sigma", damaged]),
        (
            "histogram",
            sums(&|s| *s["counts"].as_array_mut().unwrap().last_mut().unwrap() = json!(u64::MAX)),
            vec!["innovations in the histogram, expected 1600", damaged],
        ),
        ("negative square", sums(&|s| s["values"][3] = json!([-1.0])), vec!["sum of squares of -1", damaged]),
        ("mean", sums(&|s| s["values"][1] = json!([1e6])), vec!["a sum of errors of 1000000", damaged]),
        ("more runs", changed(&|d| d["runs"]["end"] = json!(9)), vec!["expected 1800", damaged]),
        ("no runs", changed(&|d| d["runs"]["end"] = json!(0)), vec!["runs: found", "A below B"]),
        ("runs without end", changed(&|d| d["runs"]["end"] = json!(u64::MAX)), vec!["B at most 1099511627776"]),
        ("runs of none", changed(&|d| d["runs"] = json!(8)), vec!["runs: found 8"]),
        ("longer", changed(&|d| d["experiment"]["steps"] = json!(210)), vec!["sums: axis 'x': found 655 values"]),
        ("too long", changed(&|d| d["experiment"]["steps"] = json!(u64::MAX)), vec!["steps is", "expected 64 to"]),
        ("no level", changed(&|d| d["experiment"]["alpha"] = Value::Null), vec!["experiment.alpha: found null"]),
        ("level", changed(&|d| d["experiment"]["alpha"] = json!(1.5)), vec!["alpha is 1.5, expected between 0 and 1"]),
        (
            "replicates",
            changed(&|d| d["experiment"]["replicates"] = json!(u64::MAX)),
            vec!["replicates is", "expected at most 1000000"],
        ),
        (
            "design",
            changed(&|d| d["experiment"]["filter"]["axes"][0]["R"][0][0] = json!(-1.0)),
            vec!["experiment.filter", "axes[0].R"],
        ),
        ("truth", changed(&|d| d["experiment"]["truth"] = json!({})), vec!["experiment.truth", "format"]),
    ];
    for (what, text, words) in rows {
        println!("{what}");
        bench.file("bad.json", text);
        let words: Vec<&str> = std::iter::once("bad.json: ").chain(words).collect();
        assert_refused(&bench, &[(&["merge", "bad.json", "-o", "out.json", "--junit", "out.xml"], &words)]);
    }
    // null stands for what is not finite, as of a truth that runs away: no panic, no pass
    bench.file("bad.json", sums(&|s| s["values"][3] = json!([null])));
    let out = bench.run("merge bad.json");
    assert!(out.status == 1 && out.stderr.is_empty(), "{out:?}");
}
