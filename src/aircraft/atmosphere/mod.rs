//! Standard atmosphere, Dryden turbulence, discrete gusts (floor 1).

pub mod discrete;
pub mod dryden;
pub mod exceedance;
pub mod standard;
pub mod turbulence;

/// Motion of the air at the airplane beside the steady wind, body axes: velocity u, v, w (m/s) and rate p, q, r
/// (rad/s). The airplane feels its own velocity and rate less these; an up-gust has w < 0.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Gust {
    pub velocity: [f64; 3],
    pub rate: [f64; 3],
}

impl Gust {
    /// The way from this one to another, 0 to 1.
    #[inline(always)]
    pub fn towards(&self, other: &Gust, part: f64) -> Gust {
        let mix = |a: &[f64; 3], b: &[f64; 3]| std::array::from_fn(|i| a[i] + part * (b[i] - a[i]));
        Gust { velocity: mix(&self.velocity, &other.velocity), rate: mix(&self.rate, &other.rate) }
    }

    #[inline(always)]
    pub fn plus(&self, other: &Gust) -> Gust {
        let sum = |a: &[f64; 3], b: &[f64; 3]| std::array::from_fn(|i| a[i] + b[i]);
        Gust { velocity: sum(&self.velocity, &other.velocity), rate: sum(&self.rate, &other.rate) }
    }
}

/// What the air of a model does not reach: one clear line.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{0}")]
pub struct AirError(pub String);
