//! The estimates as quadratic forms of the samples, by matrices: slow and plain.

use super::*;

/// Covariance and mean of n consecutive samples. The walk starts anywhere; quantisation is the difference of a white
/// angle error.
pub(super) fn samples(model: &NoiseModel, n: usize, dt: f64) -> (DMatrix<f64>, DVector<f64>) {
    let mut covariance = DMatrix::zeros(n, n);
    let mut mean = DVector::zeros(n);
    for term in &model.terms {
        for i in 0..n {
            for j in 0..n {
                let lag = i.abs_diff(j);
                covariance[(i, j)] += match *term {
                    Term::White { density } => f64::from(u8::from(lag == 0)) * density.powi(2) / dt,
                    Term::GaussMarkov { std_dev, correlation_time } => {
                        std_dev.powi(2) * (-(lag as f64) * dt / correlation_time).exp()
                    }
                    Term::RateRandomWalk { density } => density.powi(2) * dt * (i.min(j) as f64),
                    Term::Quantization { coefficient } => {
                        (coefficient / dt).powi(2) * [2.0, -1.0].get(lag).unwrap_or(&0.0)
                    }
                    Term::MovingAverage { .. } | Term::BandLimit { .. } | Term::Oscillation { .. } => {
                        term.autocovariance(lag as u64, dt).unwrap()
                    }
                    Term::RateRamp { .. } => 0.0,
                    Term::BiasInstability { .. } => f64::NAN,
                };
            }
            if let Term::RateRamp { slope } = term {
                mean[i] += slope * dt * i as f64;
            }
        }
    }
    (covariance, mean)
}

/// The matrix A of σ̂² = yᵀ A y, from the definitions (dt = 1).
pub(super) fn form(kind: Deviation, n: usize, m: usize) -> DMatrix<f64> {
    let (weights, step, norm): (&[f64], usize, f64) = match kind {
        Deviation::Adev => (&[-1.0, 1.0], m, 2.0),
        Deviation::Oadev | Deviation::Mdev => (&[-1.0, 1.0], 1, 2.0),
        Deviation::Hdev => (&[1.0, -2.0, 1.0], m, 6.0),
        Deviation::Ohdev => (&[1.0, -2.0, 1.0], 1, 6.0),
        Deviation::Totdev => panic!("no quadratic form here"),
    };
    let starts: Vec<usize> = (0..=n - weights.len() * m).step_by(step).collect();
    let mut difference = DMatrix::zeros(starts.len(), n);
    for (row, start) in starts.iter().enumerate() {
        for (block, weight) in weights.iter().enumerate() {
            for k in 0..m {
                difference[(row, start + block * m + k)] = weight / m as f64;
            }
        }
    }
    if kind == Deviation::Mdev {
        let rows = starts.len() + 1 - m;
        difference = DMatrix::from_fn(rows, n, |j, k| difference.view((j, k), (m, 1)).sum() / m as f64);
    }
    difference.transpose() * &difference / (norm * difference.nrows() as f64)
}
