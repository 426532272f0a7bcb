//! Logs with gaps, and several logs of one sensor.

use kfdesign::filter::likelihood::Stretch;
use kfdesign::identify::identify_logs;

use super::*;
use crate::support::Bench;

fn together(logs: &[Vec<Stretch<'_>>], stretches: &[&[f64]], model: &str) -> Identified {
    let choice = parse_model(model).unwrap();
    identify_logs("x", stretches, logs, 1.0, &Unit::parse("rad/s").unwrap(), &choice, &[]).unwrap()
}

/// Ten hours at 1 Hz, of which three gaps take a tenth, and one sample is not a number. What the stretches say
/// together is known as well as from a log of their length without gaps (within 15 %: of 180 correlation times few
/// are cut), much better than from the longest alone; each parameter is within 4 standard deviations of the truth
/// (2e-4 for the three).
#[test]
fn gaps_cost_no_more_than_what_is_missing() {
    let samples = 36_000;
    let mut rate = log(&[white(N), gauss_markov(SIGMA, TC)], samples, 1.0, 5, 0);
    rate[20_000] = f64::NAN;
    let pieces: Vec<Stretch<'_>> =
        [(0, 0..9000), (1000, 10_000..19_000), (600, 19_600..27_000), (2000, 29_000..36_000)]
            .into_iter()
            .map(|(missing, range)| Stretch { missing, samples: &rate[range] })
            .collect();
    let longest = &rate[..9000];
    let found = together(&[pieces], &[longest], "white+gm");
    let estimate = ln_estimate(&found).unwrap();
    let expected = bound(N, SIGMA, TC, 32_400, 1.0);
    let truth = [N.ln(), SIGMA.ln(), TC.ln()];
    for (i, precision) in found.precision.iter().enumerate() {
        let sigma = 0.01 * precision.std_dev_percent;
        // the curvature scatters, too: 25 % for the longest correlation, whose own relative error is 0.13
        assert!(
            (sigma / expected[i] - 1.0).abs() < [0.15, 0.4, 0.4][i],
            "{}: {sigma}, not {}",
            precision.parameter,
            expected[i]
        );
        assert!((estimate[i] - truth[i]).abs() < 4.0 * expected[i], "{}: {}", precision.parameter, estimate[i]);
    }
    let alone = identify(longest, 1.0, &parse_model("white+gm").unwrap());
    for (together, alone) in found.precision.iter().zip(&alone.precision) {
        assert!(together.std_dev_percent < 0.7 * alone.std_dev_percent, "{}", together.parameter);
    }
    assert!(found.exact_log_likelihood.unwrap() > 3.0 * alone.exact_log_likelihood.unwrap());
}

/// So many samples of so many states that the search does without the exact likelihood: the spread of three starts
/// is told all the same, from one look at it. Sample standard deviation to 5 % (each bias is known to 0.02, the
/// spread is 1).
#[test]
fn the_turn_on_bias_of_long_logs_is_told_too() {
    let filter =
        kfdesign::noise::Filter::new(&[1.0, 2.0, 1.0], &[1.0, -1.142_980_502_539_901_1, 0.412_801_598_096_188_77]);
    let terms = [white(0.0001), Term::BandLimit { density: 0.1, filter: filter.unwrap() }, gauss_markov(0.05, 20.0)];
    let starts = [-1.0, 0.0, 1.0];
    let of = |i: usize| log(&terms, 80_000, 0.01, 8, i as u64).iter().map(|x| x + starts[i]).collect::<Vec<f64>>();
    let all: Vec<Vec<f64>> = (0..3).map(of).collect();
    let logs: Vec<Vec<Stretch<'_>>> = all.iter().map(|x| vec![Stretch { missing: 0, samples: x }]).collect();
    let stretches: Vec<&[f64]> = all.iter().map(|x| &x[..]).collect();
    let unit = Unit::parse("rad/s").unwrap();
    let found = identify_logs("x", &stretches, &logs, 0.01, &unit, &parse_model("bl2+gm").unwrap(), &[]).unwrap();
    assert!(found.exact_log_likelihood.is_none(), "the search was on the exact likelihood");
    assert!((found.params.turn_on_bias.unwrap().si() - 1.0).abs() < 0.05);
    assert!(found.params.bias.unwrap().si().abs() < 0.05);
}

/// Twelve starts of an hour with biases of known spread: what each log says of its bias is exact beside that spread,
/// so the estimate is their sample standard deviation (the restricted likelihood divides by m − 1) to 2 %, and its
/// 95 % interval that of χ²₁₁, 0.71 … 1.70 of it, to 10 % (profile for exact).
#[test]
fn repeated_starts_give_the_turn_on_bias() {
    let starts: Vec<f64> = (0..12).map(|i| 0.3 * f64::from(i * 5 % 12) - 1.0).collect();
    let of = |i: usize| log(&[white(0.05)], 3600, 1.0, 7, i as u64).iter().map(|x| x + starts[i]).collect::<Vec<f64>>();
    let all: Vec<Vec<f64>> = (0..12).map(of).collect();
    let logs: Vec<Vec<Stretch<'_>>> = all.iter().map(|x| vec![Stretch { missing: 0, samples: x }]).collect();
    let found = together(&logs, &[&all[0]], "white");
    let mean = starts.iter().sum::<f64>() / 12.0;
    let spread = (starts.iter().map(|b| (b - mean).powi(2)).sum::<f64>() / 11.0).sqrt();
    let bias = found.params.bias.unwrap();
    let turn_on = found.params.turn_on_bias.unwrap();
    assert!((turn_on.si() / spread - 1.0).abs() < 0.02, "{} for {spread}", turn_on.si());
    let [low, high] = turn_on.interval_si().unwrap();
    assert!((low / spread / 0.708 - 1.0).abs() < 0.1 && (high / spread / 1.698 - 1.0).abs() < 0.1, "{low} {high}");
    assert!((bias.si() - mean).abs() < 0.01 && found.model.white_density() > 0.0);
    // white noise from twelve hours: 4 standard deviations of 1/√(2n)
    assert!((found.model.white_density() / 0.05 - 1.0).abs() < 4.0 / (2.0 * 12.0 * 3600.0f64).sqrt());
    // equal biases: no spread is claimed
    let same: Vec<Vec<Stretch<'_>>> =
        all.iter().take(1).cycle().take(3).map(|x| vec![Stretch { missing: 0, samples: x }]).collect();
    let none = together(&same, &[&all[0]], "white").params.turn_on_bias;
    assert!(none.is_none_or(|spread| spread.interval_si().unwrap()[0] == 0.0));
}

/// Five starts of half an hour: the terms are chosen on all of them. What one log alone does not tell (each has nine
/// correlation times) is told by all five, in any order of the logs, a short one among them or not: the search may
/// end elsewhere by a thousandth of a standard deviation.
#[test]
fn terms_are_chosen_on_all_logs() {
    let of = |run: u64| log(&[white(N), gauss_markov(SIGMA, TC)], 1800, 1.0, 14, run);
    let all: Vec<Vec<f64>> = (0..5).map(of).chain([of(5)[..100].to_vec()]).collect();
    let found = |order: &[usize]| {
        let logs: Vec<Vec<Stretch<'_>>> =
            order.iter().map(|i| vec![Stretch { missing: 0, samples: &all[*i] }]).collect();
        let stretches: Vec<&[f64]> = order.iter().map(|i| &all[*i][..]).collect();
        together(&logs, &stretches, "auto")
    };
    let first = found(&[0, 1, 2, 3, 4, 5]);
    assert_eq!((label(&first.model).as_str(), first.samples), ("GaussMarkov+White", 9100));
    let alone = (0..5).filter(|i| label(&found(&[*i]).model) == "GaussMarkov+White").count();
    assert!(alone < 3, "{alone} logs tell by themselves: nothing is shown");
    let estimate = ln_estimate(&first).unwrap();
    for order in [[5, 4, 3, 2, 1, 0], [2, 5, 0, 4, 1, 3]] {
        let other = found(&order);
        let names = |found: &Identified| found.candidates.iter().map(|c| c.model.clone()).collect::<Vec<_>>();
        assert_eq!(names(&other), names(&first));
        for (i, precision) in other.precision.iter().enumerate() {
            let moved = ln_estimate(&other).unwrap()[i] - estimate[i];
            assert!(moved.abs() < 1e-3 * 0.01 * precision.std_dev_percent, "{}: {moved}", precision.parameter);
        }
    }
    // the mean interval of one log of this length is half as wide again as that of all: counts of the bound
    let alone = bound(N, SIGMA, TC, 9100, 1.0);
    for (precision, bound) in first.precision.iter().zip(alone) {
        assert!((0.01 * precision.cramer_rao_percent / bound - 1.0).abs() < 0.5, "{}", precision.parameter);
    }
}

/// A line of one start and another line of the other: both are looked for in both, on the same coefficients. Lines
/// of 300 s of correlation time are 0.001 Hz wide, fewer coefficients than are taken together where no line is; a
/// frequency is known to a tenth of that. White noise: 5 of its standard deviations (1e-6).
#[test]
fn lines_of_every_log_are_found() {
    let of = |run: u64, frequency_hz: f64| {
        let line = Term::Oscillation { std_dev: 0.2, frequency_hz, correlation_time: 300.0 };
        log(&[white(0.1), line], 40_000, 1.0, 16, run)
    };
    let all = [of(0, 0.11), of(1, 0.37)];
    let logs: Vec<Vec<Stretch<'_>>> = all.iter().map(|x| vec![Stretch { missing: 0, samples: x }]).collect();
    let found = together(&logs, &[&all[0], &all[1]], "white+osc+osc");
    let mut lines: Vec<f64> = found
        .model
        .terms
        .iter()
        .filter_map(|term| match term {
            Term::Oscillation { frequency_hz, .. } => Some(*frequency_hz),
            _ => None,
        })
        .collect();
    lines.sort_by(f64::total_cmp);
    assert!(lines.len() == 2 && (lines[0] - 0.11).abs() < 3e-4 && (lines[1] - 0.37).abs() < 3e-4, "{lines:?}");
    let white = found.model.white_density() / 0.1 - 1.0;
    assert!(white.abs() < 5.0 / (2.0 * 80_000.0_f64).sqrt(), "{white}");
}

/// Two hours at 10 Hz of which two samples in a hundred are not a number, twelve rows of a hundred are not there,
/// one gap of ten minutes begins the last quarter: the terms are those of the whole log, and each parameter is
/// within 4.5 standard deviations of what 12 % of the samples more can move it by (√(2 · 0.12) of its own; 2e-5 for
/// the three). Cut at its holes, the longest part would be of a minute.
#[test]
fn holes_take_no_terms_away() {
    let bench = Bench::new();
    let rate = log(&[white(N), gauss_markov(SIGMA, TC)], 72_000, 0.1, 15, 0);
    let row = |k: usize, value: f64| format!("{:.1},{value:.6}\n", 0.1 * k as f64);
    let header = "time (s),gyro_x (deg/s)\n";
    bench.file("whole.csv", header.to_string() + &(0..72_000).map(|k| row(k, rate[k])).collect::<String>());
    let absent = |k: usize| (k > 100 && k % 6000 < 100) || (54_000..60_000).contains(&k);
    let there = |k: &usize| !absent(*k);
    let holed = |k: usize| if k % 50 == 17 { format!("{:.1},nan\n", 0.1 * k as f64) } else { row(k, rate[k]) };
    bench.file("holed.csv", header.to_string() + &(0..72_000).filter(there).map(holed).collect::<String>());
    let found = |name: &str| {
        let out = bench.run(&format!("identify {name} --json"));
        assert_eq!(out.status, 0, "{}", out.stderr);
        let document: serde_json::Value = serde_json::from_str(&out.stdout).unwrap();
        (document["params"]["axes"][0].clone(), document["axes"][0].clone())
    };
    let ((whole, of_whole), (holed, of_holed)) = (found("whole.csv"), found("holed.csv"));
    let paths = ["/white/density", "/gauss_markov/0/std_dev", "/gauss_markov/0/correlation_time"];
    for (i, path) in paths.iter().enumerate() {
        let value =
            |axis: &serde_json::Value| axis.pointer(&format!("{path}/value")).and_then(|v| v.as_f64()).expect(path);
        let sd = 0.01 * of_whole["precision"][i]["std_dev_percent"].as_f64().unwrap();
        let moved = (value(&holed) / value(&whole)).ln();
        assert!(moved.abs() < 4.5 * (2.0 * 0.12_f64).sqrt() * sd, "{path}: {moved}, sd {sd}");
    }
    let count = |name: &str| of_holed[name].as_u64().unwrap_or(0);
    let finite = (0..72_000).filter(there).filter(|k| k % 50 != 17).count() as u64;
    assert_eq!(count("samples"), finite);
    // the gap is too long to be filled: what comes after it takes no part in the choice
    let before = (0..54_000).filter(there).filter(|k| k % 50 != 17).count() as u64;
    assert_eq!((count("filled"), count("left_out")), (54_000 - before, finite - before));
}

#[test]
fn several_logs_on_the_command_line() {
    let bench = Bench::new();
    for (name, bias, header) in [("a", 0.3, "x"), ("b", -0.4, "x"), ("c", 0.1, "x"), ("other", 0.0, "y")] {
        let rate = log(&[white(0.05)], 2000, 0.01, 3, bias.to_string().len() as u64);
        let rows: String = rate.iter().map(|x| format!("{:.6}\n", x + bias)).collect();
        bench.file(&format!("{name}.csv"), format!("gyro_{header} (deg/s)\n{rows}"));
    }
    bench.file("accel.csv", "acc_x (g)\n".to_string() + &"0.1\n0.2\n".repeat(100));
    let text = bench.ok("identify a.csv b.csv c.csv --rate 100 -o p.json");
    assert!(text.contains("turn-on bias sigma") && text.contains("bias (mean of all starts)"), "{text}");
    let params: serde_json::Value = serde_json::from_str(&bench.read("p.json")).unwrap();
    assert_eq!(params["source"]["log"], "a.csv, b.csv, c.csv");
    assert_eq!(params["source"]["samples"], 6000);
    assert!(params["axes"][0]["turn_on_bias"]["std_dev"]["interval"][1].as_f64().unwrap() > 0.0);
    bench.ok("tune p.json -o f.json");
    for (arguments, words) in [
        ("identify a.csv other.csv --rate 100", "other.csv: axes gyro_y, but a.csv has gyro_x"),
        ("identify a.csv accel.csv --rate 100", "accel.csv: quantity"),
        ("identify a.csv b.csv --rate 100 --method allan", "2 logs: only --method likelihood takes more than one"),
        ("identify a.csv b.csv --rate 100 -o b.csv", "b.csv: cannot write: it is the input file"),
        ("identify a.csv b.csv a.csv --rate 100", "a.csv: the same samples as a.csv: a log counts once"),
        ("identify", "LOG"),
    ] {
        let out = bench.run(arguments);
        assert_eq!(out.status, 2, "{arguments}: {}", out.stderr);
        assert!(out.stderr.contains(words), "{arguments}: {}", out.stderr);
    }
}

/// Twenty samples 40 sigma off double the power of 20,000 (1 + 20 · 40²/20,000 = 2.6, N 1.6 times); left out, N is
/// the true one within 4 standard deviations of 1/√(2n). A step of the level is named.
#[test]
fn outliers_and_steps_are_told() {
    let bench = Bench::new();
    let mut rate = log(&[white(0.05)], 20_000, 0.01, 9, 0);
    (0..20).for_each(|i| rate[500 + 900 * i] += if i % 2 == 0 { 20.0 } else { -20.0 });
    let text =
        |rate: &[f64]| String::from("gyro_x (deg/s)\n") + &rate.iter().map(|x| format!("{x:.6}\n")).collect::<String>();
    bench.file("spikes.csv", text(&rate));
    let density = |flags: &str| {
        let out = bench.run(&format!("identify spikes.csv --rate 100 --model white --json{flags}"));
        assert_eq!(out.status, 0, "{}", out.stderr);
        let document: serde_json::Value = serde_json::from_str(&out.stdout).unwrap();
        let axis = &document["axes"][0];
        (document["params"]["axes"][0]["white"]["density"]["value"].as_f64().unwrap(), axis["warnings"].to_string())
    };
    let (plain, warnings) = density("");
    assert!((plain / 0.05 - 1.6).abs() < 0.1, "{plain}");
    assert!(warnings.contains("20 of 20000 samples") && warnings.contains("`without_outliers`"), "{warnings}");
    let (robust, warnings) = density(" --without-outliers");
    assert!((robust / 0.05 - 1.0).abs() < 4.0 / 40_000f64.sqrt(), "{robust}");
    assert!(warnings.contains("20 outliers were left out") && !warnings.contains("`without_outliers`"), "{warnings}");
    let mut stepped = log(&[white(0.05)], 20_000, 0.01, 9, 0);
    stepped[12_000..].iter_mut().for_each(|x| *x += 0.3);
    bench.file("step.csv", text(&stepped));
    let text = bench.ok("identify step.csv --rate 100");
    assert!(text.contains("the level moves at once: 0.") && text.contains("deg/s at 1"), "{text}");
}
