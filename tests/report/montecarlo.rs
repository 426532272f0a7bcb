//! The page of a Monte Carlo experiment shows the numbers of its document.

use serde_json::Value;

use super::{assert_inside, assert_well_formed, save};
use crate::support::{Bench, data, figure};

const RUNS: &str = "--runs 30 --duration 100s --seed 1";

/// A directory with the reference sensor's design.
fn tuned(params: &str) -> Bench {
    let bench = Bench::new();
    let out = bench.run_args(&["tune", data(params).to_str().unwrap(), "-o", "filter.json"]);
    assert_eq!(out.status, 0, "{}", out.stderr);
    bench
}

fn document(bench: &Bench, name: &str) -> Value {
    serde_json::from_str(&bench.read(name)).unwrap()
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect()
}

fn figures(html: &str) -> Vec<&str> {
    html.split("<svg ").skip(1).map(|rest| rest.split("</svg>").next().unwrap()).collect()
}

fn attribute(line: &str, key: &str) -> f64 {
    line.split(&format!(" {key}=\"")).nth(1).unwrap().split('"').next().unwrap().parse().unwrap()
}

/// Value of an upright position by the tick labels of a linear axis, and the value of one unit of length.
fn upright(svg: &str) -> (impl Fn(f64) -> f64, f64) {
    let lines: Vec<&str> = svg.lines().collect();
    let ticks: Vec<(f64, f64)> = lines
        .windows(2)
        .filter(|pair| pair[0].starts_with("<text") && pair[0].contains("text-anchor=\"end\""))
        .map(|pair| (attribute(pair[0], "y"), pair[1].replace('−', "-").parse().unwrap()))
        .collect();
    let ((y0, v0), (y1, v1)) = (ticks[0], ticks[ticks.len() - 1]);
    let slope = (v1 - v0) / (y1 - y0);
    (move |y| v0 + (y - y0) * slope, slope.abs())
}

/// Heights of the last line of a class: its data, behind its sample in the legend.
fn heights(svg: &str, class: &str) -> Vec<f64> {
    let start = format!("<polyline class=\"{class}\" points=\"");
    let line = svg.lines().rfind(|line| line.starts_with(&start)).unwrap();
    let points = line[start.len()..].split('"').next().unwrap();
    points.split_whitespace().map(|pair| pair.split_once(',').unwrap().1.parse().unwrap()).collect()
}

/// Positions are whole units of length, those of ticks too: two units for each number.
fn assert_drawn(svg: &str, drawn: &[f64], expected: &[f64], scale: f64) {
    let (value, unit) = upright(svg);
    assert_eq!(drawn.len(), expected.len());
    for (y, expected) in drawn.iter().zip(expected) {
        assert!((value(*y) - expected * scale).abs() <= 2.0 * unit, "{} drawn, {} meant", value(*y), expected * scale);
    }
}

#[test]
fn the_page_shows_what_the_document_says() {
    let bench = tuned("params.json");
    bench.ok(&format!("montecarlo filter.json {RUNS} -o document.json --report page.html"));
    let (html, document) = (bench.read("page.html"), document(&bench, "document.json"));
    save("montecarlo.html", &html);
    for alien in ["<script", "<link", "@import", "url(", "src=", "NaN"] {
        assert!(!html.contains(alien), "{alien}");
    }
    assert_eq!(html.matches("href=").count(), html.matches("href=\"#").count());
    // NEES, errors of the whole drift and two states, errors beside claims, NIS, autocorrelation, periodogram
    assert_eq!(figures(&html).len(), 8 * 3);
    for svg in figures(&html) {
        let (svg, name) = (format!("<svg {svg}</svg>"), svg.split("</title>").next().unwrap().to_string());
        assert_well_formed(&svg, &name);
        assert_inside(&format!("</style>{svg}"), &name);
    }
    for what in
        ["error of whole drift", "error of bias", "error of gauss_markov", "errors and claims", "innovations: NIS"]
    {
        figure(&html, &format!("y: {what}"));
    }
    for axis in document["axes"].as_array().unwrap() {
        let name = axis["name"].as_str().unwrap();
        let svg = figure(&html, &format!("{name}: NEES of 30 runs"));
        assert_drawn(svg, &heights(svg, "kf20"), &numbers(&axis["nees"]["mean"]), 1.0);
        assert!(!svg.contains("with this truth"));
        let innovations = &axis["innovations"][0];
        let svg = figure(&html, &format!("{name}: innovations: autocorrelation"));
        let dots: Vec<f64> = svg.lines().filter(|l| l.contains("<circle")).map(|l| attribute(l, "cy")).collect();
        assert!(svg.contains("autocorrelation (10⁻³)"));
        assert_drawn(svg, &dots[1..], &numbers(&innovations["autocorrelation"]), 1e3);
        let svg = figure(&html, &format!("{name}: innovations: cumulative periodogram"));
        let share = numbers(&innovations["cumulative_periodogram"]["share"]);
        let drawn = heights(svg, "kf20");
        // from the corner; both ends are exact
        assert!(drawn.len() > 10);
        assert_drawn(svg, &drawn[drawn.len() - 1..], &[share[share.len() - 1] - 1.0], 1.0);
    }
    // every test with its p-value, every mistuning with the test that sees it
    for test in document["tests"].as_array().unwrap() {
        assert!(html.contains(test["meaning"].as_str().unwrap()), "{test}");
        let [low, value, high] = ["lower", "statistic", "upper"].map(|key| test[key].as_f64().unwrap());
        assert_eq!(test["pass"], low <= value && value <= high, "{test}");
    }
    let detects = document["detects"].as_array().unwrap();
    assert_eq!(detects.len(), 5 * 3);
    for found in detects {
        assert!(html.contains(found["parameter"].as_str().unwrap()), "{found}");
        if let Some(factor) = found["too_small"]["size"].as_f64().filter(|_| found["measure"] == "factor") {
            assert!(html.contains(&format!("x {}", &factor.to_string()[..5])), "{found}");
        }
    }
}

/// Threads change nothing; shards merged give the same page but for the names of the files that were read.
#[test]
fn the_page_is_the_same_from_threads_and_shards() {
    let bench = tuned("params.json");
    bench.ok(&format!("montecarlo filter.json {RUNS} --threads 1 --report one.html"));
    bench.ok(&format!("montecarlo filter.json {RUNS} --threads 2 --report two.html"));
    assert_eq!(bench.read("one.html"), bench.read("two.html"));
    for (range, name) in [("0..11", "a.json"), ("11..30", "b.json")] {
        let out = bench.run(&format!("montecarlo filter.json --runs {range} --duration 100s --seed 1 -o {name}"));
        assert!(out.status <= 1, "{}", out.stderr);
    }
    bench.ok("merge b.json a.json --report merged.html");
    let merged = bench.read("merged.html");
    assert!(merged.contains("a.json, b.json"));
    let own = |html: &str| {
        let named = ["filter.json", "merged from", "a.json", "<dt>filter</dt>"];
        html.lines().filter(|line| !named.iter().any(|name| line.contains(name))).collect::<Vec<_>>().join("\n")
    };
    assert_eq!(own(&merged), own(&bench.read("one.html")));
}

/// False alarm: none, the expected curve is exact and the drift is 2.24 times too large.
#[test]
fn under_another_truth_the_page_has_the_expected_curve_and_the_power_table() {
    let bench = tuned("wrong/sigma_x2.24.json");
    let truth = data("wrong/truth.json");
    let command = format!(
        "montecarlo filter.json --truth {} {RUNS} -o document.json --report page.html",
        truth.to_str().unwrap()
    );
    let out = bench.run(&command);
    assert_eq!(out.status, 1, "{}", out.stderr);
    let (html, document) = (bench.read("page.html"), document(&bench, "document.json"));
    save("montecarlo-truth.html", &html);
    let svg = figure(&html, "x: NEES of 30 runs");
    assert!(svg.contains("expected with this truth"));
    let nees = &document["axes"][0]["nees"];
    assert_drawn(svg, &heights(svg, "kf21"), &numbers(&nees["expected"]), 1.0);
    assert_drawn(svg, &heights(svg, "kf20"), &numbers(&nees["mean"]), 1.0);
    assert!(html.contains("<b>inconsistent</b>") && html.contains("rejects this truth"));
    // the table is the page's own: the document was not asked for it
    assert!(html.contains("P0 of bias") && document.get("detects").is_none_or(|d| d.as_array().unwrap().is_empty()));
    // both values of the parameter that differs
    assert!(html.contains(">0.06285<") && html.contains(">2.240<"));
}

#[test]
fn the_page_cannot_replace_an_input() {
    let bench = tuned("params.json");
    let before = bench.read("filter.json");
    let out = bench.run("montecarlo filter.json --runs 3 --duration 100s --report filter.json");
    assert_eq!((out.status, out.stderr.lines().count()), (2, 1), "{}", out.stderr);
    assert_eq!(bench.read("filter.json"), before);
    let out = bench.run("montecarlo filter.json --runs 3 --duration 100s --report no/such/folder/page.html");
    assert_eq!((out.status, out.stderr.lines().count()), (2, 1), "{}", out.stderr);
}
