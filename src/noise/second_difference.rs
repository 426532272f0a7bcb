//! Second differences of the integrated process, from which Allan estimates are made.
//!
//! θ_k is the running sum of samples times dt and z_k = θ_{k+2m} − 2θ_{k+m} + θ_k. For a process whose increments of
//! θ are stationary there is a generalised covariance G, known up to an even polynomial of degree 2, with
//! cov(z⁽¹⁾_k, z⁽²⁾_{k+h}) = Σ_i Σ_j d_i d_j G(h + j m2 − i m1), d = (1, −2, 1).

/// (1, −2, 1).
pub(super) const WEIGHTS: [i128; 3] = [1, -2, 1];

/// Σ_i Σ_j d_i d_j g(h + j m2 − i m1), exact in integers while the result is below 2^127 (for cubes: lags below 10¹²).
pub(super) fn lag_sum(m1: u64, m2: u64, h: i64, g: impl Fn(i128) -> i128) -> f64 {
    let mut sum: i128 = 0;
    for (j, wj) in (0..).zip(WEIGHTS) {
        let start = i128::from(h) + j * i128::from(m2);
        for (i, wi) in (0..).zip(WEIGHTS) {
            sum = sum.wrapping_add((wi * wj).wrapping_mul(g(start - i * i128::from(m1))));
        }
    }
    sum as f64
}

/// Where the three lags L, L − m, L − 2m lie.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Side {
    /// All on one side of zero; the smallest distance to it.
    Clear(u128),
    /// Zero is strictly inside.
    Straddles,
}

pub(super) fn side(lag: i128, m: u64) -> Side {
    let far = lag - 2 * i128::from(m);
    if lag <= 0 || far >= 0 { Side::Clear(far.max(-lag).unsigned_abs()) } else { Side::Straddles }
}
