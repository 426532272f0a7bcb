//! A log's spectrum over the spectrum a model gives it: whether the ratio is flat.

use crate::numerics::distribution::kolmogorov_sf;

/// How far the cumulative ratio departs from a straight line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Departure {
    /// D = max_j |Σ_{i≤j} u_i/Σ u − j/n|, with the sign of the difference.
    pub distance: f64,
    /// Index of the part that ends there.
    pub at: usize,
    /// Coefficients behind it.
    pub count: f64,
    pub p_value: f64,
}

/// `parts`: neighbouring cosine coefficients by increasing frequency, each part with their number and the sum of u_j =
/// P_j/S_j, P the power of the log and S the spectrum of the model.
///
/// If the model is true up to a factor, u_j ~ χ²₁ are independent and D √(n/2) has Kolmogorov's law. Blind to the
/// factor, and nearly blind to low frequencies, which are few of all. Source: Bartlett 1954.
pub fn departure(parts: &[(f64, f64)]) -> Departure {
    let (count, total) = parts.iter().fold((0.0, 0.0), |(n, sum), (size, u)| (n + size, sum + u));
    let (mut sum, mut before) = (0.0, 0.0);
    let mut found = Departure { distance: 0.0, at: 0, count, p_value: f64::NAN };
    for (at, (size, u)) in parts.iter().enumerate() {
        sum += u;
        before += size;
        let distance = sum / total - before / count;
        if distance.abs() > found.distance.abs() {
            found = Departure { distance, at, ..found };
        }
    }
    found.p_value = kolmogorov_sf(found.distance.abs() * (count / 2.0).sqrt());
    found
}
