//! What a design does when the sensor is another.

use kfdesign::params::{AxisParams, Params, TermEntry};
use kfdesign::tune::{Tendency, TuneOptions, UnderTruth, predicted_sigma, tune, under_truth};

use super::{DEGREE, close, gauss_markov, measured, random_walk, sensor, skydog, tuned, white};
use crate::support::{Bench, data};

fn under(design: &Params, truth: &Params) -> Vec<UnderTruth> {
    under_truth(&tuned(design), truth, &TuneOptions::default()).unwrap()
}

/// The reference sensor with a constant bias known to 1e-9 deg/s.
fn drift(std_dev: f64, correlation_time: f64, density: f64) -> Params {
    sensor(100.0, vec![white(density), gauss_markov(std_dev, correlation_time)], Some(1e-9))
}

/// Identity: under its own truth every error is what the filter claims, and that is what `tune` predicts by another
/// road (doubling).
#[test]
fn under_its_own_truth_a_design_is_as_claimed() {
    let params = skydog();
    let design = tuned(&params);
    let results = under_truth(&design, &params, &TuneOptions::default()).unwrap();
    assert_eq!(results.iter().map(|r| r.name.as_str()).collect::<Vec<_>>(), ["x", "y", "z"]);
    let result = &results[2];
    let model = &design.design.axes[2].model;
    let predicted = predicted_sigma(model, design.reports[2].settling_time_s).unwrap();
    assert_eq!(result.states.iter().map(|s| s.name.as_str()).collect::<Vec<_>>(), ["bias", "gauss_markov"]);
    // two times that both tables have
    for time in [0.0, 0.01] {
        let ours = result.time_s.iter().position(|t| (t - time).abs() < 1e-9).unwrap();
        let theirs = predicted.time_s.iter().position(|t| (t - time).abs() < 1e-9).unwrap();
        close(result.drift.claimed[ours], predicted.total[theirs], 1e-9);
        close(result.states[1].claimed[ours], predicted.sigma[1][theirs], 1e-9);
    }
    close(*result.time_s.last().unwrap(), 10.0 * design.reports[2].settling_time_s, 1e-4);
    for error in result.states.iter().chain([&result.drift]) {
        assert!((8..=9).contains(&error.real.len()));
        for (real, claimed) in error.real.iter().zip(&error.claimed) {
            close(*real, *claimed, 1e-9);
        }
        assert!(error.mean.iter().all(|mean| *mean == 0.0));
    }
    for nees in &result.nees {
        close(nees.unwrap(), 1.0, 1e-9);
    }
    close(result.nis, 1.0, 1e-9);
    assert_eq!(result.tendency, Tendency::AsClaimed);
    assert_eq!(result.meaning, "as claimed: every error and the innovations are within 1 % of what the filter says");
    assert!(result.notes.is_empty());
}

/// The printed table of mis-tuned filters through the whole road from parameters: NEES of the drift in steady state
/// is the square of its ratio. Ten settling times leave e⁻⁴⁰ of the start; the tolerance is half of the last printed
/// digit (one value lies on the border).
#[test]
fn mistuned_designs_have_the_printed_nees() {
    let (sigma, tc, n) = (0.0280596, 193.9312, 0.0562);
    let truth = drift(sigma, tc, n);
    let best = under(&truth, &truth)[0].drift.real.last().copied().unwrap();
    close(best / DEGREE, 0.01202704693, 1e-9);
    for (design, nees, worse, tendency, word) in [
        (drift(2.24 * sigma, tc, n), 0.5817, 1.174, Tendency::Pessimistic, "pessimistic: the error of "),
        (drift(sigma / 2.24, tc, n), 3.4548, 1.167, Tendency::Optimistic, "optimistic: the error of "),
        (drift(sigma, 2.0 * tc, n), 1.4349, 1.022, Tendency::Optimistic, "optimistic: the error of "),
        (drift(sigma, tc / 2.0, n), 0.7714, 1.023, Tendency::Pessimistic, "pessimistic: the error of "),
        (drift(sigma, tc, 1.06 * n), 0.9509, 1.001, Tendency::Pessimistic, "pessimistic: the innovations are 0.943"),
        (drift(sigma, tc, 2.0 * n), 0.6997, 1.125, Tendency::Pessimistic, "pessimistic: the innovations are 0.500"),
    ] {
        let result = &under(&design, &truth)[0];
        let (real, claimed) = (result.drift.real.last().unwrap(), result.drift.claimed.last().unwrap());
        assert!(((real / claimed).powi(2) - nees).abs() < 6e-5, "{} {nees}", (real / claimed).powi(2));
        assert!((real / best - worse).abs() < 6e-4, "{} {worse}", real / best);
        assert_eq!(result.tendency, tendency, "{}", result.meaning);
        assert!(result.meaning.starts_with(word), "{word}: {}", result.meaning);
    }
}

/// A bias that is 0.3 deg/s off at power-up: the first error has it as its mean, and it is learnt.
#[test]
fn a_wrong_start_is_a_mean_error_that_fades() {
    let mut design = sensor(10.0, vec![white(0.05), gauss_markov(0.03, 20.0)], Some(0.1));
    let mut truth = design.clone();
    truth.axes[0].bias = Some(measured(0.3, "deg/s"));
    design.axes[0].bias = Some(measured(0.0, "deg/s"));
    let result = &under(&design, &truth)[0];
    // (1 − K₀) 0.3 with K₀ of the whole drift = P/(P + R)
    let (p, r) = (0.01 + 0.0009, 0.025);
    close(result.drift.mean[0] / DEGREE, 0.3 * r / (p + r), 1e-12);
    let variance = result.drift.claimed[0].powi(2);
    close(result.drift.real[0], (variance + result.drift.mean[0].powi(2)).sqrt(), 1e-12);
    // of the bias: mean (1 − K) 0.3, variance (1 − K) 0.01 with K = 0.01/(P + R), by hand 2.737 claimed sigmas; the
    // drift is learnt at once, its share in bias and process slowly
    assert!(result.drift.mean.last().unwrap().abs() < 0.01 * result.drift.mean[0]);
    assert!(result.nees.is_sorted_by(|a, b| a > b) && result.nees[0].unwrap() > 4.0, "{:?}", result.nees);
    assert_eq!(result.tendency, Tendency::Optimistic);
    assert!(result.meaning.starts_with("optimistic: the error of bias is 2.737 times"), "{}", result.meaning);
}

#[test]
fn a_truth_of_other_states_is_compared_by_the_whole_drift() {
    let design = sensor(10.0, vec![white(0.05), random_walk(1e-3)], Some(0.1));
    let more = sensor(10.0, vec![white(0.05), random_walk(1e-3), gauss_markov(0.03, 20.0)], Some(0.1));
    let result = &under(&design, &more)[0];
    assert!(result.states.is_empty());
    let last = result.nees.len() - 1;
    close(result.nees[last].unwrap(), (result.drift.real[last] / result.drift.claimed[last]).powi(2), 1e-12);
    assert!(result.tendency == Tendency::Optimistic && result.nees[last].unwrap() > 2.0, "{result:?}");
    // the other way round the filter expects more than there is
    let result = &under(&more, &design)[0];
    assert_eq!(result.tendency, Tendency::Pessimistic, "{}", result.meaning);
    // too sure of the bias, but louder in its drift
    let proud = sensor(10.0, vec![white(0.05), gauss_markov(0.1, 2.0)], Some(0.05));
    let other = sensor(10.0, vec![white(0.05), gauss_markov(0.03, 2.0)], Some(0.1));
    let result = &under(&proud, &other)[0];
    assert_eq!(result.tendency, Tendency::Mixed);
    assert!(result.meaning.starts_with("optimistic and pessimistic: the error of bias is 1.9"), "{}", result.meaning);
    assert!(result.meaning.contains(", but the error of gauss_markov is 0."), "{}", result.meaning);
}

/// A filter that claims to know the bias exactly.
#[test]
fn claims_of_certainty_have_no_nees() {
    let design = sensor(10.0, vec![white(0.05), gauss_markov(0.03, 2.0)], Some(0.0));
    let truth = sensor(10.0, vec![white(0.05), gauss_markov(0.03, 2.0)], Some(0.5));
    let result = &under(&design, &truth)[0];
    assert!(result.nees.iter().all(Option::is_none));
    assert!(
        result
            .meaning
            .starts_with("optimistic: the filter claims to know bias exactly at 0 s, which it does not; in the end"),
        "{}",
        result.meaning
    );
    let own = &under(&design, &design)[0];
    assert_eq!(own.tendency, Tendency::AsClaimed);
}

#[test]
fn the_length_is_bounded_and_said() {
    let flicker = TermEntry::BiasInstability { coefficient: measured(10.0, "deg/h") };
    let quiet = sensor(1000.0, vec![white(0.001), gauss_markov(1e-5, 3000.0)], None);
    let result = &under(&quiet, &quiet)[0];
    assert_eq!(*result.time_s.last().unwrap(), 1000.0);
    assert!(
        result.notes[0].starts_with("the first 1000 s are followed; ten settling times are "),
        "{:?}",
        result.notes
    );
    assert!(result.notes[1].starts_with("the truth: no turn-on bias is given"), "{:?}", result.notes);
    // nothing to settle: 1000 s; states that stand for flicker are not spoken of
    let still = sensor(1.0, vec![white(0.01)], Some(0.1));
    let truth = sensor(1.0, vec![white(0.01), flicker], Some(0.1));
    let result = &under(&still, &truth)[0];
    assert_eq!(*result.time_s.last().unwrap(), 1000.0);
    assert_eq!(result.tendency, Tendency::Optimistic);
}

#[test]
fn axes_are_matched_by_name_and_others_refused() {
    let mut truth = skydog();
    truth.axes.reverse();
    truth.axes[0].terms[0] = white(0.1);
    let results = under(&skydog(), &truth);
    assert_eq!(results[0].name, "x");
    assert_eq!(results[0].tendency, Tendency::AsClaimed);
    assert_eq!(results[2].tendency, Tendency::Optimistic);
    let refused = |change: &dyn Fn(&mut Params)| {
        let mut truth = skydog();
        change(&mut truth);
        under_truth(&tuned(&skydog()), &truth, &TuneOptions::default()).unwrap_err().to_string()
    };
    let axes = "; expected the same names";
    assert_eq!(
        refused(&|t| t.axes[1].name = "w".into()),
        format!("the truth has the axes x, w, z, the design x, y, z{axes}")
    );
    assert_eq!(refused(&|t| t.axes.truncate(1)), format!("the truth has the axes x, the design x, y, z{axes}"));
    assert!(refused(&|t| t.axes[1].terms.truncate(0)).contains("axis 'y': no measurement noise"));
    let accelerometer: AxisParams = AxisParams {
        terms: vec![TermEntry::White { density: measured(1e-3, "m/s^2/sqrt(Hz)") }],
        ..skydog().axes[0].clone()
    };
    let force = Params {
        quantity: kfdesign::units::Quantity::SpecificForce,
        axes: vec![AxisParams { bias: None, turn_on_bias: None, ..accelerometer }],
        ..skydog()
    };
    let error = under_truth(&tune(&skydog(), &TuneOptions::default()).unwrap(), &force, &TuneOptions::default());
    assert_eq!(error.unwrap_err().to_string(), "the truth is in m/s^2, the design in rad/s");
}

#[test]
fn the_command_shows_the_design_under_a_truth() {
    let bench = Bench::new();
    let (wrong, truth) = (data("wrong/sigma_x2.24.json"), data("wrong/truth.json"));
    let command = format!("tune {} --truth {} --runs 10", wrong.display(), truth.display());
    let printed = bench.ok(&format!("{command} --report page.html"));
    for part in [
        "wrong/truth.json: axis x\nRoot mean square error beside the sigma that the filter claims, exact, no simulation\n",
        "time (s)     bias  claimed  gauss_markov  claimed  whole drift (deg/s)  claimed    NEES",
        "Expected NEES per state; expected NIS 0.9996 over 351.8 s: both would be 1 if all were as claimed.",
        "pessimistic: the error of gauss_markov is 0.45",
        "in the end, the error of the whole drift is 0.766",
    ] {
        assert!(printed.contains(part), "{part} is missing:\n{printed}");
    }
    let page = bench.read("page.html");
    assert!(page.contains("Under the truth") && page.contains("pessimistic: the error of gauss_markov"));
    let document: serde_json::Value = serde_json::from_str(&bench.ok(&format!("{command} --json"))).unwrap();
    let axis = &document["under_truth"][0];
    assert_eq!(axis["name"], "x");
    assert_eq!(axis["tendency"], "pessimistic");
    assert_eq!(axis["states"][1]["name"], "gauss_markov");
    assert_eq!(axis["drift"]["real"].as_array().unwrap().len(), axis["time_s"].as_array().unwrap().len());
    // without a truth there is no such key
    let plain = bench.ok(&format!("tune {} --runs 10 --json", wrong.display()));
    assert!(!plain.contains("under_truth"));
    // refused in one line, nothing written
    for (given, words) in [
        (data("params.json").display().to_string(), "the truth has the axes x, y, z, the design x"),
        ("missing.json".into(), "missing.json: cannot read"),
    ] {
        let out = bench.run(&format!("tune {} --truth {given} -o out.json", wrong.display()));
        assert_eq!((out.status, out.stderr.lines().count()), (2, 1), "{out:?}");
        assert!(out.stderr.contains(words), "{out:?}");
    }
    std::fs::copy(&truth, bench.path("truth.json")).unwrap();
    let out = bench.run(&format!("tune {} --truth truth.json -o truth.json", wrong.display()));
    assert!(out.status == 2 && out.stderr.contains("it is the input file"), "{out:?}");
    assert_eq!(bench.files(), ["page.html", "truth.json"]);
}
