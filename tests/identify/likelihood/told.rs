//! Which correlation times a log tells, and what is said of those that it bounds to one side.

use kfdesign::filter::likelihood::Stretch;
use kfdesign::identify::{Identified, ModelChoice, identify_logs};
use kfdesign::units::Unit;

use super::super::{gauss_markov, intervals, log, white};
use super::{N, SIGMA, TC, identify};

/// χ²₁(0.90) and χ²₁(0.95).
const TOLD: f64 = 2.706;
const CLOSED: f64 = 3.841;
/// The search ends at ten times the log, where a Gauss-Markov process is no random walk yet.
const END: f64 = 0.15;

/// The same log without its sample 1800: intervals are then moved by the information of the exact likelihood.
fn with_one_missing(rate: &[f64]) -> Identified {
    let [early, late] = [&rate[..1800], &rate[1801..]];
    let pieces = vec![Stretch { missing: 0, samples: early }, Stretch { missing: 1, samples: late }];
    let mut filled = rate.to_vec();
    filled[1800] = 0.5 * (rate[1799] + rate[1801]);
    identify_logs("x", &[&filled], &[pieces], 1.0, &Unit::parse("rad/s").unwrap(), &ModelChoice::Auto, &[]).unwrap()
}

/// An hour of the reference sensor, 18 correlation times. A random walk is a Gauss-Markov process whose correlation
/// time has no end: white+gm is identified where it is χ²₁(0.90) above white+rrw in 2 ln L; from there to χ²₁(0.95)
/// Tc and σ have lower limits alone, which are in the document and in words.
#[test]
fn a_correlation_time_is_told_where_a_random_walk_is_refused() {
    let [mut told, mut open, mut closed, mut untold] = [0; 4];
    for run in 0..100 {
        let rate = log(&[white(N), gauss_markov(SIGMA, TC)], 3600, 1.0, 47, run);
        let found = identify(&rate, 1.0, &ModelChoice::Auto);
        let of = |model: &str| found.candidates.iter().find(|candidate| candidate.model == model);
        let (Some(gm), Some(walk)) = (of("white+gm"), of("white+rrw")) else { continue };
        let gain = 2.0 * (gm.log_likelihood.unwrap() - walk.log_likelihood.unwrap());
        let near = |level: f64| (gain - level).abs() < END;
        assert!(near(TOLD) || gm.identified == (gain > TOLD), "run {run}: gain {gain}, {gm:?}");
        told += usize::from(gm.identified);
        untold += usize::from(!gm.identified);
        if gm.chosen && !near(CLOSED) {
            let [_, sigma, time] = intervals(&found);
            let said =
                |name: &str| found.not_identified.iter().any(|n| n.term == name && n.reason.starts_with("above"));
            let both = said("gauss_markov.std_dev") && said("gauss_markov.correlation_time");
            assert!(sigma[0] > 0.0 && time[0] > 0.0 && time[0] < time[1], "run {run}: {sigma:?}, {time:?}");
            assert_eq!(
                [time[1].is_infinite(), sigma[1].is_infinite(), both],
                [gain < CLOSED; 3],
                "run {run}: gain {gain}"
            );
            if gain < CLOSED {
                let [lower, other] = [&found, &with_one_missing(&rate)].map(|found| intervals(found)[1][0]);
                assert!((other / lower - 1.0).abs() < 0.05, "run {run}: {lower}, with a sample missing {other}");
            }
            open += usize::from(gain < CLOSED);
            closed += usize::from(gain > CLOSED);
        }
    }
    assert!(told >= 20 && untold >= 10 && open >= 3 && closed >= 20, "{told} {untold} {open} {closed}");
}
