//! The estimates are the maximum of the exact likelihood.

use kfdesign::identify::parse_model;
use nalgebra::{Matrix3, Vector3};

use super::super::{gauss_markov, log, logs, white};
use super::identify;

/// Diffuse ln L of white noise and a Gauss-Markov process about an unknown constant, sample by sample; ln of N, σ, Tc.
fn plain(z: &[f64], at: Vector3<f64>, dt: f64) -> f64 {
    let [n, sigma, time] = [at[0].exp(), at[1].exp(), at[2].exp()];
    let (r, phi) = (n * n / dt, (-dt / time).exp());
    let q = -sigma * sigma * (-2.0 * dt / time).exp_m1();
    let (mut p, mut x, mut unit) = (sigma * sigma, 0.0, 0.0);
    let [mut squares, mut cross, mut information, mut logs] = [0.0; 4];
    for z in z {
        let s = p + r;
        let (v, u, gain) = (z - x, 1.0 - unit, p / s);
        squares += v * v / s;
        cross += u * v / s;
        information += u * u / s;
        logs += s.ln();
        x = phi * (x + gain * v);
        unit = phi * (unit + gain * u);
        p = phi * phi * (p - gain * p) + q;
    }
    let constant = z.len() as f64 * std::f64::consts::TAU.ln();
    -0.5 * (constant + logs + squares - cross * cross / information + information.ln())
}

/// Newton's step from the estimates on the plain likelihood is 1e-4 standard deviations at most: the search ends at
/// 3e-5 and its derivatives are right to 2e-5, those here, with steps of a three-hundredth of a standard deviation,
/// to 2e-6. ln L is that of the plain one but for rounding. A log of 50 correlation times, one of 15, where both
/// likelihoods differ most, and one of drift that fills the samples.
#[test]
fn estimates_are_the_maximum_of_the_plain_likelihood() {
    let cases: [(usize, f64, f64, f64); 3] =
        [(50_000, 0.1, 100.0, 0.05), (30_000, 0.1, 200.0, 0.1), (5000, 1.0, 40.0, 3.0)];
    for (samples, dt, time, loudness) in cases {
        let z = log(&[white(dt.sqrt()), gauss_markov(loudness, time)], samples, dt, 61, 0);
        let found = identify(&z, dt, &parse_model("white+gm").unwrap());
        let at = Vector3::from(logs(&found.model));
        let value = |shift: Vector3<f64>| plain(&z, at + shift, dt);
        let top = value(Vector3::zeros());
        let told = found.exact_log_likelihood.unwrap();
        assert!((told / top - 1.0).abs() < 1e-12, "{told} for {top}");
        let mut steps = Vector3::repeat(1e-3);
        let axis = |i: usize, step: f64| Vector3::from_fn(|k, _| if i == k { step } else { 0.0 });
        let curvature = |steps: &Vector3<f64>| {
            Matrix3::from_fn(|i, k| {
                let (a, b) = (axis(i, steps[i]), axis(k, steps[k]));
                if i == k {
                    return (2.0 * top - value(a) - value(-a)) / steps[i].powi(2);
                }
                -(value(a + b) - value(a - b) - value(b - a) + value(-a - b)) / (4.0 * steps[i] * steps[k])
            })
        };
        let rough = curvature(&steps);
        steps = Vector3::from_fn(|i, _| 0.003 / rough[(i, i)].sqrt());
        let information = curvature(&(steps * 10.0));
        let slope = Vector3::from_fn(|i, _| {
            let side = axis(i, steps[i]);
            (value(side) - value(-side)) / (2.0 * steps[i])
        });
        let step = information.try_inverse().unwrap() * slope;
        let far = step.dot(&slope).sqrt();
        assert!(far < 1e-4, "{samples} samples: {far} standard deviations from the maximum");
    }
}
