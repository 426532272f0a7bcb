//! Objective robust: the criterion on sensors drawn here, by the recursion of the mismatched filter over time.

use kfdesign::filter::mismatch::expect;
use kfdesign::filter::{GainSequence, Judge};
use kfdesign::model::LinearModel;
use kfdesign::numerics::random::{StreamId, normal, stream};
use kfdesign::params::{Params, Source};
use kfdesign::tune::objective::{HONEST_SHARE, Objective, Request};
use kfdesign::tune::{TuneOptions, Tuned, sensor_model};

use super::super::{close, gauss_markov, sensor, tuned, white};
use super::{chosen, moved, refused, request, with_intervals};

const INTERVALS: [(&str, [f64; 2]); 3] = [
    ("white.density", [0.0561, 0.0563]),
    ("gauss_markov.std_dev", [0.0222, 0.0354]),
    ("gauss_markov.correlation_time", [111.0, 339.0]),
];

/// The reference sensor at 1 Hz with what a log of two hours tells of it.
fn uncertain() -> Params {
    with_intervals(sensor(1.0, vec![white(0.0562), gauss_markov(0.02806, 193.93)], Some(0.6)), &INTERVALS)
}

/// Whether the claimed sigma of the drift is below that of its true error after ten settling times.
fn too_small(design: &Tuned, truth: &LinearModel) -> bool {
    let filter = &design.design.axes[0].model;
    let last = 2000;
    let gains = GainSequence::new(filter, last + 1, &[last]);
    let judge = Judge { components: vec![], of_truth: truth.drift_row(), of_estimate: filter.drift_row() };
    let error = &expect(filter, truth, &gains, &judge, &[vec![]]).epochs[0];
    error.covariance[(0, 0)] > error.claimed[(0, 0)]
}

/// 80 sensors: as identified, the claim is too small for half of them; robust, for 5 % at most. False alarm:
/// P(Bin(80, 0.05) > 17) = 8e-8, P(Bin(80, 0.5) ≤ 17) = 1e-7.
#[test]
fn the_claim_holds_for_sensors_drawn_from_the_intervals() {
    let params = uncertain();
    let (robust, record) = chosen(&params, &request(Objective::Robust));
    let nominal = tuned(&params);
    let mut counts = [0, 0];
    for run in 0..80 {
        let mut rng = stream(12, StreamId { run, axis: 0, term: 0 });
        let mut drawn = |[lower, upper]: [f64; 2]| {
            let (mean, half) = (0.5 * (lower * upper).ln(), 0.5 * (upper / lower).ln());
            (mean + half / 1.959_964 * normal(&mut rng)).exp()
        };
        let [density, std_dev, time] = INTERVALS.map(|(_, interval)| drawn(interval));
        let its = sensor(1.0, vec![white(density), gauss_markov(std_dev, time)], Some(0.6));
        let truth = sensor_model(&its.axes[0], its.quantity, 1.0, &TuneOptions::default()).unwrap();
        counts[0] += usize::from(too_small(&nominal, &truth));
        counts[1] += usize::from(too_small(&robust, &truth));
    }
    assert!(counts[0] > 17 && counts[1] <= 17, "{counts:?}");
    let of_axis = &record.robust[0];
    assert!(of_axis.met && of_axis.too_small <= 1.0 - HONEST_SHARE && !of_axis.correlated, "{of_axis:?}");
    // half of the sensors are worse than the middle one
    assert!((of_axis.too_small_nominal - 0.5).abs() < 0.1, "{of_axis:?}");
}

#[test]
fn the_price_is_small_and_the_record_is_that_of_the_design() {
    let params = uncertain();
    let (robust, record) = chosen(&params, &request(Objective::Robust));
    let drift = &record.robust[0].outputs[0];
    // identities with the steady states of the two designs
    let sigma = |tuned: &Tuned| tuned.reports[0].error_budget.iter().map(|s| s.variance_si).sum::<f64>().sqrt();
    close(drift.claimed, sigma(&robust), 1e-9);
    close(drift.claimed_nominal, sigma(&tuned(&params)), 1e-9);
    close(drift.price, drift.error / drift.error_nominal - 1.0, 1e-9);
    // nobody is better than those who know their sensor; errors near the best grow with the square of the mistuning
    assert!(drift.error_known < drift.error_nominal && drift.error_known < drift.error, "{drift:?}");
    assert!(drift.price > 0.0 && drift.price < 0.05, "{drift:?}");
    // a well known density is no means to claim more
    assert!(moved(&record, "white.density").sigmas.unwrap().abs() < 3.0, "{record:?}");
    // the root of χ²₃ at 99.73 %
    assert!(record.robust[0].distance <= 3.77);
    // with fewer parameters to move the price is not lower, but for the roughness of a quantile
    let hold = ["gauss_markov.correlation_time".to_string()];
    let (_, fewer) = chosen(&params, &Request { hold: &hold, ..request(Objective::Robust) });
    assert_eq!(moved(&fewer, "gauss_markov.correlation_time").factor, 1.0);
    assert!(fewer.robust[0].met);
}

/// Estimates of sigma and time err together; what the filter uses, sigma²/time, is known better than each: less
/// inflation is needed.
#[test]
fn correlated_errors_of_a_likelihood_ask_for_less() {
    let params = uncertain();
    let source = Source { method: Some("likelihood".into()), span_s: Some(7200.0), ..Source::default() };
    let (_, apart) = chosen(&params, &request(Objective::Robust));
    let (_, together) = chosen(&Params { source: Some(source), ..params }, &request(Objective::Robust));
    assert!(together.robust[0].correlated && together.robust[0].met);
    let claimed = |record: &kfdesign::tune::objective::Record| record.robust[0].outputs[0].claimed;
    assert!(claimed(&together) < 0.97 * claimed(&apart), "{} {}", claimed(&together), claimed(&apart));
}

#[test]
fn what_cannot_be_robust_is_refused() {
    let known = sensor(1.0, vec![white(0.0562), gauss_markov(0.02806, 193.93)], Some(0.6));
    let message = refused(&known, &request(Objective::Robust));
    assert!(
        message.contains("no interval of white.density, gauss_markov.std_dev") && message.contains("identify"),
        "{message}"
    );
    let open = with_intervals(known, &[("gauss_markov.correlation_time", [100.0, f64::INFINITY])]);
    assert!(refused(&open, &request(Objective::Robust)).contains("correlation_time"));
    let still = with_intervals(sensor(1.0, vec![white(0.05)], Some(0.6)), &[("white.density", [0.04, 0.06])]);
    assert!(refused(&still, &request(Objective::Robust)).contains("nothing drifts"));
    let hold = ["gauss".to_string()];
    let message = refused(&uncertain(), &Request { hold: &hold, ..request(Objective::Robust) });
    assert!(
        message.contains("`hold` gauss: there is no such parameter; there are gauss_markov.correlation_time"),
        "{message}"
    );
    let all = ["white".to_string(), "gauss_markov".to_string()];
    assert!(
        refused(&uncertain(), &Request { hold: &all, ..request(Objective::Robust) })
            .contains("every parameter is held")
    );
}
