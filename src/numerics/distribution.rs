//! Chi-square, normal and Kolmogorov probabilities and quantiles.
//! All take fractional degrees of freedom where that makes sense and are total: bad arguments give NaN, never a panic.

/// P(χ²_dof ≤ x).
pub fn chi_square_cdf(x: f64, dof: f64) -> f64 {
    let _ = (x, dof);
    todo!()
}
/// P(χ²_dof > x), accurate in the tail.
pub fn chi_square_sf(x: f64, dof: f64) -> f64 {
    let _ = (x, dof);
    todo!()
}
/// x with P(χ²_dof ≤ x) = p.
pub fn chi_square_quantile(p: f64, dof: f64) -> f64 {
    let _ = (p, dof);
    todo!()
}
/// Φ(x).
pub fn normal_cdf(x: f64) -> f64 {
    let _ = x;
    todo!()
}
/// 1 − Φ(x), accurate in the tail.
pub fn normal_sf(x: f64) -> f64 {
    let _ = x;
    todo!()
}
/// Φ⁻¹(p).
pub fn normal_quantile(p: f64) -> f64 {
    let _ = p;
    todo!()
}
/// P(√n·D > x) in the limit (Kolmogorov 1933): for Bartlett's cumulative periodogram test.
pub fn kolmogorov_sf(x: f64) -> f64 {
    let _ = x;
    todo!()
}
