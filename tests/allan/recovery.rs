//! Recovery of known truth from simulated logs; every test states its false-alarm probability.

use super::*;

/// The measured curve of simulated data against the sampled forms (formulas, section 1): each ratio inside its
/// two-sided chi-square interval with the exact degrees of freedom, 5e-7 outside; 17 points, so below 1e-5 in all.
#[test]
fn curves_of_single_terms() {
    let (n, dt) = (200_000, 0.01);
    for (term, factors) in [
        (Term::White { density: 0.0562 }, vec![1, 10, 100, 1000]),
        (Term::Quantization { coefficient: 1e-3 / 12_f64.sqrt() }, vec![1, 3, 10, 1000]),
        (Term::RateRandomWalk { density: 0.0028 }, vec![1, 2, 50, 5000]),
        (gauss_markov(0.03, 19.4), vec![1, 10, 100, 1000, 3665]),
    ] {
        let mixture = model(&[term]);
        let phase = deviation::phase(&path(&mixture, dt, n, 1, 0), dt);
        for m in factors {
            let measured = deviation::variance(Deviation::Oadev, &phase, dt, m).unwrap().variance;
            let ratio = measured / term.allan_variance(m, dt);
            let dof = edf::degrees_of_freedom(Deviation::Oadev, n, m, dt, &mixture);
            let (low, high) = (chi_square_quantile(2.5e-7, dof) / dof, chi_square_quantile(1.0 - 2.5e-7, dof) / dof);
            assert!((low..high).contains(&ratio), "{term:?} m = {m}: {ratio} outside {low} … {high}");
        }
    }
}

/// The 95 % interval of the refined curve holds the true deviation 95 % of the time: 2000 logs of white +
/// Gauss-Markov at three taus. Allowed 92.4 … 97.6 %: 5 standard errors (0.49 % each) and 0.15 % for the chi-square
/// shape; false alarm 2e-6.
#[test]
fn interval_coverage() {
    let (n, dt, runs) = (1000, 0.1, 2000);
    let mixture = model(&[Term::White { density: 0.3 }, gauss_markov(0.4, 8.0)]);
    let factors = [4, 32, 128];
    let mut inside = [0; 3];
    let dofs = factors.map(|m| edf::degrees_of_freedom(Deviation::Oadev, n, m, dt, &mixture));
    for run in 0..runs {
        let phase = deviation::phase(&path(&mixture, dt, n, 3, run), dt);
        for (i, m) in factors.into_iter().enumerate() {
            let estimate = deviation::variance(Deviation::Oadev, &phase, dt, m).unwrap();
            let (lower, upper) = edf::interval(estimate.variance.sqrt(), dofs[i]);
            inside[i] += u32::from((lower..upper).contains(&mixture.allan_variance(m, dt).sqrt()));
        }
    }
    for (m, count) in factors.iter().zip(inside) {
        let coverage = f64::from(count) / runs as f64;
        assert!((0.924..0.976).contains(&coverage), "m = {m}: {coverage}");
    }
}

/// MDEV and TOTDEV: the published degrees of freedom against the spread over 1500 logs, within 25 % (the spread itself
/// has a standard error of at most 6 %, so 4 of them and the approximation's own error; false alarm 1e-5 in all).
#[test]
fn approximate_degrees_of_freedom() {
    let (n, runs) = (600, 1500);
    for (term, noise) in [
        (Term::White { density: 1.0 }, NoiseType::White),
        (Term::RateRandomWalk { density: 1.0 }, NoiseType::RandomWalk),
    ] {
        for kind in [Deviation::Mdev, Deviation::Totdev] {
            for m in [1, 4, 32] {
                let values: Vec<f64> = (0..runs)
                    .map(|run| {
                        let phase = deviation::phase(&path(&model(&[term]), 1.0, n, 4, run), 1.0);
                        deviation::variance(kind, &phase, 1.0, m).unwrap().variance
                    })
                    .collect();
                let count = runs as f64;
                let mean = values.iter().sum::<f64>() / count;
                let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (count - 1.0);
                let spread = 2.0 * mean * mean / variance;
                let published = edf::power_law_degrees_of_freedom(kind, n, m, noise);
                assert!(
                    (0.75..1.25).contains(&(published / spread)),
                    "{kind:?} {noise:?} m = {m}: {published} and {spread}"
                );
            }
        }
    }
}

#[test]
fn refine_replaces_power_laws() {
    let (n, dt) = (20_000, 0.1);
    let mixture = model(&[Term::White { density: 0.3 }, gauss_markov(0.4, 8.0)]);
    let rate = path(&mixture, dt, n, 5, 0);
    for kind in ALL {
        let before = allan::curve(&rate, dt, kind, TauGrid::Octave).unwrap();
        let mut after = before.clone();
        after.refine(&mixture);
        for (a, b) in before.points.iter().zip(&after.points) {
            assert_eq!(a.deviation, b.deviation);
            assert_eq!(b.edf, edf::degrees_of_freedom(kind, n, b.m, dt, &mixture));
            assert_eq!((b.lower, b.upper), edf::interval(b.deviation, b.edf));
        }
        let mut same = before.clone();
        same.refine(&NoiseModel::default());
        assert_eq!(same.points, before.points);
    }
}
