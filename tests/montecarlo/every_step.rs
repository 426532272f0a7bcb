//! Averages at every step against the runs one by one.

use kfdesign::filter::{FilterDesign, Kalman};
use kfdesign::montecarlo::{Course, Experiment};
use kfdesign::numerics::linalg::cholesky;
use kfdesign::params::Params;
use kfdesign::tune::{TuneOptions, tune};
use nalgebra::DVector;

use super::{SMALL, bench, changed};

const STEPS: u64 = 600;

fn design(params: &str) -> FilterDesign {
    tune(&Params::from_json(params, "params").unwrap(), &TuneOptions::default()).unwrap().design
}

fn course(params: &str, truth: Option<&str>) -> Course {
    let truth = truth.map(|truth| Params::from_json(truth, "truth").unwrap());
    let (seed, alpha) = (7, 0.01);
    Experiment { design: design(params), truth, truth_spread: false, steps: STEPS, seed, alpha, replicates: 0 }
        .course()
        .unwrap()
}

/// [`SMALL`] with a second drift: other states than the filter's, and five in all where the filter has it too with a
/// third.
fn drifts(count: usize) -> String {
    changed(SMALL, |value| {
        let all = (0..count).map(|i| {
            let (sigma, time) = (0.05 / (i + 1) as f64, 5.0 / (i + 1) as f64);
            serde_json::json!({"std_dev": format!("{sigma} deg/s"), "correlation_time": format!("{time} s")})
        });
        value["axes"][0]["gauss_markov"] = all.collect();
    })
}

/// [`SMALL`] with a line: four states, of which two drive each other.
fn line() -> String {
    changed(SMALL, |value| {
        value["axes"][0]["oscillation"] =
            serde_json::json!([{"std_dev": "0.03 deg/s", "frequency": "2 Hz", "correlation_time": "1 s"}]);
    })
}

/// NEES and NIS of runs 3..24 (two groups of lanes and a part of a third) added up from the runs one by one, the
/// covariance from a filter of its own. In registers (two states; four, of which two drive each other), in memory
/// (five), and where filter and truth differ: in the number of states, in parameters alone, and in what is measured
/// of as many states. Rounding of sums over 21 runs: 1e-9.
#[test]
fn averages_are_those_of_the_runs_one_by_one() {
    let cases = [
        (SMALL.to_string(), None),
        (line(), None),
        (drifts(4), None),
        (SMALL.to_string(), Some(drifts(2))),
        (SMALL.to_string(), Some(drifts(1))),
        (drifts(3), Some(line())),
    ];
    for (number, (params, truth)) in cases.iter().enumerate() {
        let course = course(params, truth.as_deref());
        let axis = &course.axes[0];
        let found = &course.every_step(3..24)[0];
        let (mut nees, mut nis) = (vec![0.0; STEPS as usize], vec![0.0; STEPS as usize]);
        for run in 3..24 {
            let trace = &course.trace(run)[0];
            let mut filter = Kalman::new(&axis.filter);
            for k in 0..STEPS as usize {
                if k > 0 {
                    filter.predict();
                }
                filter.update(0, 0.0, None);
                let at = |columns: &[Vec<f64>]| DVector::from_iterator(columns.len(), columns.iter().map(|c| c[k]));
                let (x, estimate) = (at(&trace.truth), at(&trace.estimate));
                // all states where both have the same, else what is measured
                let same = axis.truth.states == axis.filter.states;
                let error = if !same { &axis.truth.h * x - &axis.filter.h * estimate } else { x - estimate };
                let h = &axis.filter.h;
                let p = if !same { h * &filter.p * h.transpose() } else { filter.p.clone() };
                let whitened = cholesky(&p).unwrap().solve_lower_triangular(&error).unwrap();
                nees[k] += whitened.norm_squared() / (21 * error.len()) as f64;
                nis[k] += trace.normalised[0][k].powi(2) / 21.0;
            }
        }
        assert_eq!((found.runs, found.nis.len()), (21, 1));
        for k in 0..STEPS as usize {
            assert!(
                (found.nees[k] - nees[k]).abs() < 1e-9 * nees[k],
                "case {number}, NEES {k}: {} {}",
                found.nees[k],
                nees[k]
            );
            assert!(
                (found.nis[0][k] - nis[k]).abs() < 1e-9 * nis[k],
                "case {number}, NIS {k}: {} {}",
                found.nis[0][k],
                nis[k]
            );
        }
    }
}

/// The same bits for one thread and three, and with the first blocks of runs alone taken from a longer range.
#[test]
fn threads_leave_no_trace() {
    let course = course(SMALL, None);
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| course.every_step(0..700))
    };
    assert_eq!(on(1), on(3));
}

/// A true filter stays between the χ² bounds at each of 600 steps: NEES and NIS both, 2e-9 each side and step,
/// 4.8e-6 in all.
#[test]
fn a_true_filter_stays_between_its_bounds() {
    let found = &course(SMALL, None).every_step(0..500)[0];
    let ([low, high], [least, most]) = (found.bounds(found.components, 4e-9), found.bounds(1, 4e-9));
    assert!(found.nees.iter().all(|nees| (low..high).contains(nees)), "{low} {high}");
    assert!(found.nis[0].iter().all(|nis| (least..most).contains(nis)), "{least} {most}");
}

#[test]
fn the_table_has_a_row_for_every_step() {
    let bench = bench(SMALL);
    bench.ok("montecarlo filter.json --runs 20 --duration 30s --every-step steps.csv");
    let text = bench.read("steps.csv");
    assert_eq!(text.lines().next(), Some("time (s),x_nees,x_nis"));
    assert_eq!(text.lines().count(), 301);
    let out = bench.run("montecarlo filter.json --runs 20 --duration 30s --every-step filter.json");
    assert_eq!(out.status, 2);
    let out = bench.run("montecarlo filter.json --runs 20 --duration 30000s --every-step long.csv");
    assert!(out.status == 2 && out.stderr.contains("at most 200000; shorten --duration"), "{}", out.stderr);
}
