//! Objective nees, against the exact expectation over time.

use kfdesign::tune::objective::{Objective, Request};
use kfdesign::tune::{TuneOptions, under_truth};

use super::super::{close, gauss_markov, random_walk, sensor, white};
use super::{chosen, moved, refused, request};

#[test]
fn nees_and_nis_become_one_also_where_the_truth_has_other_processes() {
    let params = sensor(10.0, vec![white(0.05), gauss_markov(0.03, 200.0)], Some(0.5));
    let two = [white(0.06), gauss_markov(0.02, 40.0), gauss_markov(0.05, 600.0)];
    for terms in [vec![white(0.06), gauss_markov(0.05, 60.0)], two.to_vec()] {
        let truth = sensor(10.0, terms, Some(0.5));
        let (tuned, record) = chosen(&params, &Request { truth: Some(&truth), ..request(Objective::Nees) });
        let found = &record.nees[0];
        assert_eq!(found.outputs, ["drift"]);
        assert!(found.nees_before[0] > 1.2 && found.nis_before > 1.2, "{found:?}");
        // Newton's steps end below 1e-9
        close(found.nees[0], 1.0, 1e-8);
        close(found.nis, 1.0, 1e-8);
        assert!(found.met);
        // the recursion from the first measurement on: after ten settling times as settled, but for the constant
        // bias, of which a tenth of the first settling time's variance is left
        let over_time = &under_truth(&tuned, &truth, &TuneOptions::default()).unwrap()[0];
        let (real, claimed) = (over_time.drift.real.last().unwrap(), over_time.drift.claimed.last().unwrap());
        close(real / claimed, 1.0, 2e-2);
        // the whole run, its start included
        close(over_time.nis, 1.0, 1e-3);
    }
}

#[test]
fn what_is_right_does_not_move_and_what_moves_moves_least() {
    let params = sensor(10.0, vec![white(0.05), gauss_markov(0.03, 200.0)], Some(0.5));
    let (_, record) = chosen(&params, &Request { truth: Some(&params), ..request(Objective::Nees) });
    assert!(record.parameters.iter().all(|moved| (moved.factor - 1.0).abs() < 1e-9), "{record:?}");
    let truth = sensor(10.0, vec![white(0.06), gauss_markov(0.05, 60.0)], Some(0.5));
    let length = |hold: &[String]| {
        let (_, record) = chosen(&params, &Request { truth: Some(&truth), hold, ..request(Objective::Nees) });
        close(record.nees[0].nees[0], 1.0, 1e-8);
        if let [held] = hold {
            assert_eq!(moved(&record, held).factor, 1.0);
        }
        record.parameters.iter().map(|moved| moved.factor.ln().powi(2)).sum::<f64>().sqrt()
    };
    let least = length(&[]);
    assert!(length(&["gauss_markov.correlation_time".into()]) > least * 1.001);
    // with the amount of drift held, no time makes the claim large enough: as near as can be, and said
    let hold = ["gauss_markov.std_dev".to_string()];
    let (_, record) = chosen(&params, &Request { truth: Some(&truth), hold: &hold, ..request(Objective::Nees) });
    let found = &record.nees[0];
    assert!(!found.met && found.nees[0] > 1.05 && found.nees[0] < found.nees_before[0], "{found:?}");
}

#[test]
fn a_truth_is_needed_that_the_filter_can_follow() {
    let params = sensor(10.0, vec![white(0.05), gauss_markov(0.03, 200.0)], Some(0.5));
    assert!(refused(&params, &request(Objective::Nees)).contains("`truth` PARAMS"));
    let walk = sensor(10.0, vec![white(0.05), gauss_markov(0.03, 200.0), random_walk(1e-3)], Some(0.5));
    let message = refused(&params, &Request { truth: Some(&walk), ..request(Objective::Nees) });
    assert!(message.contains("grows without bound"), "{message}");
    let still = sensor(10.0, vec![white(0.05)], Some(0.5));
    let message = refused(&still, &Request { truth: Some(&still), ..request(Objective::Nees) });
    assert!(message.contains("`objective` nees: axis x: nothing drifts"), "{message}");
}
