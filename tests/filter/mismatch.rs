//! The exact expectation of a mismatched filter against identities, printed values, an explicit linear map and a
//! simulation.

use kfdesign::filter::Kalman;
use kfdesign::filter::gains::GainSequence;
use kfdesign::filter::judge::Judge;
use kfdesign::filter::mismatch::{Expectation, ExpectedError, expect};
use kfdesign::model::{LinearModel, Named};
use kfdesign::numerics::linalg::{cholesky, relative_to_diagonal};
use kfdesign::numerics::random::{StreamId, fill_normal, stream};
use kfdesign::numerics::reduce::Moments;
use nalgebra::{DMatrix, DVector, dmatrix, dvector};

use super::{bias_and_drift, drift, named};

/// `filter` in the world `truth`, judged at `epochs`.
fn expectation(
    filter: &LinearModel,
    truth: &LinearModel,
    steps: u64,
    epochs: &[u64],
    blocks: &[Vec<u64>],
) -> Expectation {
    let gains = GainSequence::new(filter, steps, epochs);
    expect(filter, truth, &gains, &Judge::new(filter, truth, &gains.epochs), blocks)
}

#[track_caller]
fn close(found: f64, expected: f64, tolerance: f64) {
    assert!((found - expected).abs() <= tolerance, "found {found:e}, expected {expected:e}");
}

fn states(names: &[&str]) -> Vec<Named> {
    names.iter().map(|name| named(name)).collect()
}

/// Coupled states a, b; one measurement at every step, one at every third.
fn two_rates() -> LinearModel {
    LinearModel {
        dt: 1.0,
        states: states(&["a", "b"]),
        inputs: vec![],
        measurements: states(&["first", "second"]),
        every: vec![1, 3],
        outputs: vec![],
        f: dmatrix![0.9, 0.1; 0.0, 0.97],
        g: DMatrix::zeros(2, 0),
        h: dmatrix![1.0, 0.0; 0.5, 1.0],
        q: dmatrix![0.02, 0.0; 0.0, 0.05],
        r: dmatrix![0.4, 0.0; 0.0, 0.9],
        x0: dvector![0.3, -0.2],
        p0: dmatrix![1.0, 0.0; 0.0, 0.5],
    }
}

/// The same measurements of three states in another order, with other noise, start and dynamics.
fn another_world() -> LinearModel {
    LinearModel {
        states: states(&["b", "c", "a"]),
        f: dmatrix![0.97, 0.0, 0.02; 0.0, 0.8, 0.0; 0.1, 0.05, 0.88],
        g: DMatrix::zeros(3, 0),
        h: dmatrix![0.0, 0.3, 1.0; 1.0, 0.0, 0.5],
        q: dmatrix![0.03, 0.01, 0.0; 0.01, 0.1, 0.0; 0.0, 0.0, 0.04],
        r: dmatrix![0.5, 0.0; 0.0, 0.7],
        x0: dvector![0.5, 0.1, -0.4],
        p0: dmatrix![0.8, 0.1, 0.0; 0.1, 0.6, 0.0; 0.0, 0.0, 1.5],
        ..two_rates()
    }
}

/// Identity: where the filter is right, Σ = P(k|k), NEES is χ²(n) and innovations are independent N(0, 1).
/// The tolerance is that of 2·10⁴ roundings of P0, which is 10³ to 10⁴ times the last covariance.
#[test]
fn a_true_filter_is_as_good_as_it_claims() {
    let epochs = [0, 1, 2, 30, 999, 19_999];
    for (model, blocks) in [
        (bias_and_drift(), vec![vec![1, 2, 100, 1963]]),
        (drift(0.0280596, 193.9312, 0.0562, 0.01), vec![vec![]]),
        (two_rates(), vec![vec![1, 4], vec![7, 3, 50]]),
    ] {
        let found = expectation(&model, &model, 20_000, &epochs, &blocks);
        let n = model.states.len() as f64;
        let mut filter = Kalman::new(&model);
        let mut covariances = Vec::new();
        for step in 0..20_000 {
            if step > 0 {
                filter.predict();
            }
            for i in 0..model.every.len() {
                if step % model.every[i] == 0 {
                    filter.update(i, 0.0, None);
                }
            }
            if epochs.contains(&(step as u64)) {
                covariances.push(filter.p.clone());
            }
        }
        assert_eq!(found.epochs.len(), covariances.len());
        for (epoch, p) in found.epochs.iter().zip(&covariances) {
            assert!(relative_to_diagonal(&(&epoch.covariance - p), p.diagonal().as_slice()) < 1e-9);
            assert_eq!(epoch.mean, DVector::zeros(p.nrows()));
            assert_eq!(&epoch.claimed, p);
            close(epoch.nees().unwrap(), n, 1e-9 * n);
            close(epoch.nees_variance().unwrap(), 2.0 * n, 4e-9 * n);
        }
        assert_eq!(found.innovations.len(), blocks.len());
        for (innovations, lengths) in found.innovations.iter().zip(&blocks) {
            close(innovations.nis, 1.0, 1e-9);
            assert_eq!(innovations.mean, 0.0);
            assert_eq!(innovations.blocks.len(), lengths.len());
            for block in &innovations.blocks {
                close(*block, 1.0, 1e-9);
            }
        }
    }
}

/// Mis-tuned filters on the reference sensor, in steady state: printed values, computed by an independent program
/// from the Lyapunov equation. Tolerances are half of the last printed digit (one NEES lies on the border).
#[test]
fn mistuned_filters_have_the_printed_nees_nis_and_bias_error() {
    let (sigma, tc, n, dt) = (0.0280596, 193.9312, 0.0562, 0.01);
    let truth = drift(sigma, tc, n, dt);
    // 400 s are nine time constants of the slowest of these filters: its start is forgotten to e⁻¹⁸.
    let (settled, end) = (40_000, 50_000);
    let steady = |filter: &LinearModel| {
        let until = |steps: u64| expectation(filter, &truth, steps, &[steps - 1], &[vec![]]);
        let (short, long) = (until(settled), until(end));
        let total = |e: &Expectation, steps: u64| e.innovations[0].nis * steps as f64;
        let nis = (total(&long, end) - total(&short, settled)) / (end - settled) as f64;
        let error = &long.epochs[0];
        (error.nees().unwrap(), nis, error.covariance[(0, 0)].sqrt())
    };
    let (nees, nis, best) = steady(&truth);
    close(nees, 1.0, 1e-9);
    close(nis, 1.0, 1e-9);
    close(best, 0.01202704693, 5e-12);
    for (what, filter, printed) in [
        ("sigma x 2.24", drift(2.24 * sigma, tc, n, dt), [0.5817, 0.99955, 17.4]),
        ("sigma / 2.24", drift(sigma / 2.24, tc, n, dt), [3.4548, 1.00044, 16.7]),
        ("Tc x 2", drift(sigma, 2.0 * tc, n, dt), [1.4349, 1.00015, 2.2]),
        ("Tc / 2", drift(sigma, tc / 2.0, n, dt), [0.7714, 0.99986, 2.3]),
        ("N x 1.06", drift(sigma, tc, 1.06 * n, dt), [0.9509, 0.89002, 0.1]),
        ("N x 2", drift(sigma, tc, 2.0 * n, dt), [0.6997, 0.25009, 12.5]),
    ] {
        let (nees, nis, error) = steady(&filter);
        println!("{what}: {nees:.5} {nis:.6} {:+.2} %", 100.0 * (error / best - 1.0));
        close(nees, printed[0], 6e-5);
        close(nis, printed[1], 5e-6);
        close(100.0 * (error / best - 1.0), printed[2], 0.05);
    }
}

/// NumPy 2.4.6: every error, innovation and block sum written out as a linear map of all noises of the run, then
/// squared with their covariance; no recursion of moments.
#[test]
fn moments_are_those_of_the_explicit_linear_map() {
    let (filter, truth) = (two_rates(), another_world());
    let gains = GainSequence::new(&filter, 40, &[0, 1, 17, 39]);
    let judge = Judge {
        components: filter.states.clone(),
        of_truth: dmatrix![0.0, 0.0, 1.0; 1.0, 0.0, 0.0],
        of_estimate: DMatrix::identity(2, 2),
    };
    let found = expect(&filter, &truth, &gains, &judge, &[vec![4, 7, 41], vec![2, 5]]);
    #[rustfmt::skip]
    let expected = [
        ([-0.27864077669902915, 0.49975728155339816], [0.3848242058629466, -0.10748421151852203, 0.44601399754925075], 3.6375593311758365, 12.84400848045394),
        ([-0.12722116855307436, 0.47409133527072506], [0.20780609061962252, -0.0329490471170682, 0.4471627535434337], 3.3582532144564383, 10.875319412218017),
        ([0.003370297626460461, 0.048687624443151], [0.09760527453224971, 0.03143872290993967, 0.21199718670118567], 2.3099423070330984, 5.913722716077919),
        ([-0.006626097160904315, 0.03634856363891967], [0.09246429463986952, 0.014618921704692447, 0.170107250259518], 2.329982607249306, 6.008705526116139),
    ];
    // both sides round at 1e-16 of numbers up to 10
    let close = |a, b| close(a, b, 1e-13);
    for (epoch, (mean, [aa, ab, bb], nees, variance)) in found.epochs.iter().zip(expected) {
        close(epoch.mean[0], mean[0]);
        close(epoch.mean[1], mean[1]);
        close(epoch.covariance[(0, 0)], aa);
        close(epoch.covariance[(0, 1)], ab);
        close(epoch.covariance[(1, 0)], ab);
        close(epoch.covariance[(1, 1)], bb);
        close(epoch.nees().unwrap(), nees);
        close(epoch.nees_variance().unwrap(), variance);
    }
    let [first, second] = &found.innovations[..] else { panic!("{found:?}") };
    close(first.nis, 1.3421062359933298);
    close(first.mean, -0.007359916879891617);
    close(first.blocks[0], 1.4675072115721997);
    close(first.blocks[1], 1.4968265417181805);
    assert!(first.blocks[2].is_nan(), "no block of 41 in 40 steps");
    close(second.nis, 0.8469772631415368);
    close(second.mean, 0.1230134772530435);
    close(second.blocks[0], 0.9108309451174552);
    close(second.blocks[1], 1.160943868759431);
}

/// A filter that believes in no drift at all lets every measurement through: E[(Σ y)²/L] = (r + σ² (1 + 2 Σ (1 −
/// j/L) a^j))/R, closed form.
#[test]
fn blocks_of_a_blind_filter_are_those_of_the_drift_itself() {
    let (sigma, tc, n, dt) = (0.3, 20.0, 0.5, 1.0);
    let truth = drift(sigma, tc, n, dt);
    let mut blind = drift(sigma, tc, 1.2 * n, dt);
    blind.p0[(0, 0)] = 0.0;
    blind.q[(0, 0)] = 0.0;
    let lengths = [1u64, 2, 10, 100];
    let found = expectation(&blind, &truth, 1000, &[999], &[lengths.to_vec()]);
    let a = (-dt / tc).exp();
    for (&length, found) in lengths.iter().zip(&found.innovations[0].blocks) {
        let correlated: f64 = (1..length).map(|j| (1.0 - j as f64 / length as f64) * a.powi(j as i32)).sum();
        let expected = (n * n + sigma * sigma * (1.0 + 2.0 * correlated)) / (1.44 * n * n);
        close(*found, expected, 1e-12 * expected);
    }
    // it claims to know the drift exactly: there is no NEES
    let error = &found.epochs[0];
    close(error.covariance[(0, 0)], sigma * sigma, 1e-12);
    assert_eq!((error.nees(), error.nees_variance()), (None, None));
}

/// Whether states carry the same names or not only changes how the moments are carried, not what they are.
/// (With foreign names the whole states are carried: the tolerance is the rounding of their covariance.)
#[test]
fn names_change_nothing() {
    let (filter, truth) = (two_rates(), another_world());
    let foreign = LinearModel { states: states(&["u", "v", "w"]), ..truth.clone() };
    let blocks = [vec![5], vec![3]];
    let [known, unknown] = [truth, foreign].map(|truth| expectation(&filter, &truth, 300, &[0, 10, 299], &blocks));
    for (a, b) in known.epochs.iter().zip(&unknown.epochs) {
        assert!((&a.covariance - &b.covariance).abs().max() < 1e-12 && (&a.mean - &b.mean).abs().max() < 1e-12);
        assert_eq!(a.claimed, b.claimed);
    }
    for (a, b) in known.innovations.iter().zip(&unknown.innovations) {
        close(a.nis, b.nis, 1e-12);
        close(a.mean, b.mean, 1e-12);
        close(a.blocks[0], b.blocks[0], 1e-12);
    }
}

/// Every noise level of truth and filter times c: same NEES and NIS; the truth's alone times c: c² times both.
#[test]
fn a_common_scale_cancels() {
    let (filter, truth) = (drift(0.03, 50.0, 0.2, 0.1), drift(0.05, 20.0, 0.3, 0.1));
    let scaled = |model: &LinearModel| LinearModel {
        q: &model.q * 9.0,
        r: &model.r * 9.0,
        p0: &model.p0 * 9.0,
        ..model.clone()
    };
    let of = |filter: &LinearModel, truth: &LinearModel| {
        let found = expectation(filter, truth, 500, &[499], &[vec![10]]);
        let innovations = &found.innovations[0];
        [found.epochs[0].nees().unwrap(), innovations.nis, innovations.blocks[0]]
    };
    let (plain, both, one) = (of(&filter, &truth), of(&scaled(&filter), &scaled(&truth)), of(&filter, &scaled(&truth)));
    for i in 0..3 {
        close(both[i], plain[i], 1e-12 * plain[i]);
        close(one[i], 9.0 * plain[i], 1e-11 * plain[i]);
    }
}

/// x ← x + L n with the next numbers of `normal`.
fn add(x: &mut DVector<f64>, l: &DMatrix<f64>, normal: &mut impl Iterator<Item = f64>) {
    let n = DVector::from_fn(l.ncols(), |_, _| normal.next().unwrap());
    *x += l * n;
}

/// Wrong P0, wrong x0, a drift state left out, a second measurement every third step, judged by the output; 20 000
/// runs.
///
/// 26 means are compared at 5.2 of their own standard errors: false alarm below 1e-4 in all, with room for the
/// skewness of squares (Edgeworth's factor at 5.2 is below 2).
#[test]
fn a_simulation_agrees_while_the_gain_still_changes() {
    const RUNS: u64 = 20_000;
    const STEPS: usize = 60;
    let blocks = [vec![1u64, 7], vec![2, 5]];
    let epochs = [0u64, 12, 59];
    let (filter, truth) = (two_rates(), another_world());
    let found = expectation(&filter, &truth, STEPS as u64, &epochs, &blocks);

    let (p0, q) = (cholesky(&truth.p0).unwrap(), cholesky(&truth.q).unwrap());
    let mut errors = vec![vec![Moments::default(); 6]; epochs.len()];
    let mut innovations = vec![vec![Moments::default(); 4]; 2];
    let mut numbers = vec![0.0; STEPS * 5 + 3];
    for run in 0..RUNS {
        fill_normal(&mut stream(5, StreamId { run, axis: 0, term: 0 }), &mut numbers);
        let mut normal = numbers.iter().copied();
        let mut x = truth.x0.clone();
        add(&mut x, &p0, &mut normal);
        let mut kalman = Kalman::new(&filter);
        let mut y = [vec![], vec![]];
        for step in 0..STEPS {
            if step > 0 {
                x = &truth.f * x;
                add(&mut x, &q, &mut normal);
                kalman.predict();
            }
            for (i, y) in y.iter_mut().enumerate() {
                if step % truth.every[i] == 0 {
                    let z = (truth.h.row(i) * &x)[0] + truth.r[(i, i)].sqrt() * normal.next().unwrap();
                    let update = kalman.update(i, z, None);
                    y.push(update.innovation / update.variance.sqrt());
                }
            }
            if let Some(at) = epochs.iter().position(|&epoch| epoch == step as u64) {
                let e = &truth.h * &x - &filter.h * &kalman.x;
                let claimed = &filter.h * &kalman.p * filter.h.transpose();
                let nees = e.dot(&(claimed.try_inverse().unwrap() * &e));
                for (sum, value) in errors[at].iter_mut().zip([e[0], e[1], e[0] * e[0], e[0] * e[1], e[1] * e[1], nees])
                {
                    sum.add(value);
                }
            }
        }
        for (i, y) in y.iter().enumerate() {
            let n = y.len() as f64;
            let block = |length: u64| {
                let sums = y.chunks_exact(length as usize).map(|block| block.iter().sum::<f64>().powi(2));
                sums.clone().sum::<f64>() / (length as f64 * sums.count() as f64)
            };
            let values = [
                y.iter().map(|y| y * y).sum::<f64>() / n,
                y.iter().sum::<f64>() / n,
                block(blocks[i][0]),
                block(blocks[i][1]),
            ];
            for (sum, value) in innovations[i].iter_mut().zip(values) {
                sum.add(value);
            }
        }
    }
    let agree = |what: &str, moments: &Moments, expected: f64| {
        let z = (moments.mean - expected) / (moments.variance() / RUNS as f64).sqrt();
        assert!(z.abs() < 5.2, "{what}: {} ± …, expected {expected}: z = {z}", moments.mean);
    };
    for (epoch, moments) in found.epochs.iter().zip(&errors) {
        let ExpectedError { mean, covariance, .. } = epoch;
        agree("mean", &moments[0], mean[0]);
        agree("mean", &moments[1], mean[1]);
        for (moments, (i, j)) in moments[2..5].iter().zip([(0, 0), (0, 1), (1, 1)]) {
            agree("second moment", moments, covariance[(i, j)] + mean[i] * mean[j]);
        }
        agree("NEES", &moments[5], epoch.nees().unwrap());
    }
    for (expected, moments) in found.innovations.iter().zip(&innovations) {
        agree("NIS", &moments[0], expected.nis);
        agree("mean", &moments[1], expected.mean);
        agree("blocks", &moments[2], expected.blocks[0]);
        agree("blocks", &moments[3], expected.blocks[1]);
    }
}
