//! Smoothed estimates against the conditional normal distribution of all states given all measurements.

use kfdesign::filter::smoother::{History, smooth};
use kfdesign::model::LinearModel;
use nalgebra::{DMatrix, DVector};

use super::square_root::{normals, two_measurements};
use super::{bias_and_drift, drift};

/// E[x_k | z] and its covariance for every k, from the joint covariance of all states and measurements (no recursion
/// but x ← F x): with X the stacked states, Z = A X + w: E = μ + C Aᵀ (A C Aᵀ + R)⁻¹ (z − A μ).
fn batch(m: &LinearModel, z: &[Vec<f64>], u: &[Vec<f64>]) -> (Vec<DVector<f64>>, Vec<DMatrix<f64>>) {
    let (n, samples) = (m.x0.len(), z[0].len());
    let mut mean = DVector::zeros(n * samples);
    let mut c = DMatrix::zeros(n * samples, n * samples);
    let (mut x, mut p) = (m.x0.clone(), m.p0.clone());
    for k in 0..samples {
        if k > 0 {
            x = &m.f * x;
            for (j, series) in u.iter().enumerate() {
                x += m.g.column(j) * series[k - 1];
            }
            p = &m.f * p * m.f.transpose() + &m.q;
        }
        mean.rows_mut(k * n, n).copy_from(&x);
        // Cov(x_l, x_k) = F^(l−k) P_k for l ≥ k
        let mut block = p.clone();
        for l in k..samples {
            c.view_mut((l * n, k * n), (n, n)).copy_from(&block);
            c.view_mut((k * n, l * n), (n, n)).copy_from(&block.transpose());
            block = &m.f * block;
        }
    }
    let rows: Vec<(usize, usize)> = (0..samples)
        .flat_map(|k| (0..z.len()).map(move |i| (k, i)))
        .filter(|(k, i)| k % m.every[*i] == 0 && !z[*i][*k].is_nan())
        .collect();
    let mut a = DMatrix::zeros(rows.len(), n * samples);
    let mut r = DMatrix::zeros(rows.len(), rows.len());
    for (row, (k, i)) in rows.iter().enumerate() {
        a.view_mut((row, k * n), (1, n)).copy_from(&m.h.row(*i));
        r[(row, row)] = m.r[(*i, *i)];
    }
    let seen = DVector::from_iterator(rows.len(), rows.iter().map(|(k, i)| z[*i][*k]));
    let cross = &c * a.transpose();
    let inverse = (&a * &cross + r).cholesky().unwrap().inverse();
    let x = &mean + &cross * &inverse * (seen - &a * &mean);
    let p = &c - &cross * &inverse * cross.transpose();
    let states = (0..samples).map(|k| x.rows(k * n, n).into_owned()).collect();
    (states, (0..samples).map(|k| p.view((k * n, k * n), (n, n)).into_owned()).collect())
}

/// 60 samples with holes, singular Q, an input, two rates: x to 1e-9 of its sigma, sigma to 1e-9; the last sample is
/// the filtered one.
#[test]
fn equals_batch_least_squares() {
    let slow = drift(0.03, 40.0, 0.05, 1.0);
    for (case, m) in [slow, bias_and_drift(), two_measurements()].into_iter().enumerate() {
        let samples = 60;
        let z: Vec<Vec<f64>> = (0..m.measurements.len())
            .map(|i| {
                let mut z = normals(samples, 80 + i as u64);
                z.iter_mut().for_each(|z| *z *= 2.0 * m.r[(i, i)].sqrt());
                z[7] = f64::NAN;
                z[20..32].fill(f64::NAN);
                z
            })
            .collect();
        let u: Vec<Vec<f64>> = m.inputs.iter().map(|_| normals(samples, 90)).collect();
        let mut history = History::default();
        for k in 0..samples {
            if z.iter().all(|z| z[k].is_nan()) && (20..32).contains(&k) && u.is_empty() {
                // a gap: no rows, and 13 steps to the next
                continue;
            }
            let steps = if k == 32 && u.is_empty() { 13 } else { u64::from(k > 0) };
            history.row(steps, u.first().filter(|_| k > 0).map(|u| &u[k - 1..k]));
            for (i, z) in z.iter().enumerate().filter(|(i, z)| k % m.every[*i] == 0 && !z[k].is_nan()) {
                history.take(i, z[k]);
            }
        }
        let found = smooth(&m, &history);
        let rows: Vec<usize> = (0..samples).filter(|k| !(u.is_empty() && (20..32).contains(k))).collect();
        assert_eq!(found.smoothed[0].len(), rows.len());
        let (x, p) = batch(&m, &z, &u);
        for (row, k) in rows.iter().enumerate() {
            for s in 0..m.x0.len() {
                let sigma = p[*k][(s, s)].sqrt();
                assert!((found.smoothed[s][row] - x[*k][s]).abs() < 1e-9 * sigma, "case {case}, sample {k}");
                assert!((found.smoothed_sigma[s][row] / sigma - 1.0).abs() < 1e-9, "case {case}, sample {k}");
                assert!(found.smoothed_sigma[s][row] <= found.filtered_sigma[s][row] * (1.0 + 1e-12));
            }
        }
        for s in 0..m.x0.len() {
            assert_eq!(found.smoothed[s].last(), found.filtered[s].last());
        }
    }
}
