//! Law of a sum of weighted chi-square values: quadratic forms of normal vectors.

/// Least and largest |2 t λ_max| of the saddlepoints that are tabulated, and the ratio of neighbours: a straight
/// line between them is within 1e-3 of z wherever |z| < 9.
const LEAST: f64 = 1e-6;
const RATIO: f64 = 1.05;
const MOST_BELOW: f64 = 1e6;
/// The singularity of the upper tail is at 1.
const MOST_ABOVE: f64 = 1.0 - 1e-6;

/// X = Σ_i w_i χ²_k, all χ² independent and of the same k degrees of freedom.
///
/// Saddlepoint approximation: with K(t) = −½ Σ ln(1 − 2 t w_i) and K'(t) = x/k, z = √k r + ln(q/r)/(√k r) is
/// standard normal, where r = sign(t) √(2(t K'(t) − K(t))), q = t √K''(t). Right to a few per cent of either tail
/// for one degree of freedom, to 1/k of that for k of them. Source: Barndorff-Nielsen 1990; Kuonen 1999.
#[derive(Clone, Debug, PartialEq)]
pub struct QuadraticForm {
    /// Σ w and Σ w².
    pub sum: f64,
    pub squares: f64,
    /// (ln K', r, ln(q/r)/r), by increasing K'.
    nodes: Vec<[f64; 3]>,
}

impl QuadraticForm {
    /// `weights`: eigenvalues of the form; those that are not positive (rounding) are left out.
    pub fn new(weights: &[f64]) -> QuadraticForm {
        let weights: Vec<f64> = weights.iter().copied().filter(|w| *w > 0.0).collect();
        let largest = weights.iter().copied().fold(0.0, f64::max);
        let upwards =
            |most: f64| std::iter::successors(Some(LEAST), |tau| Some(tau * RATIO)).take_while(move |t| *t < most);
        let below: Vec<f64> = upwards(MOST_BELOW).map(|tau| -tau).collect();
        // towards the singularity the distance from it shrinks by the same ratio
        let near = std::iter::successors(Some(0.5), |left| Some(left / RATIO)).map(|left| 1.0 - left);
        let above = upwards(0.5).chain(near.take_while(|tau| *tau < MOST_ABOVE));
        if weights.is_empty() {
            return QuadraticForm { sum: 0.0, squares: 0.0, nodes: Vec::new() };
        }
        let node = |tau: f64| {
            let (mut mean, mut curvature, mut half_square) = (0.0, 0.0, 0.0);
            for weight in &weights {
                let a = tau * weight / largest;
                mean += weight / (1.0 - a);
                curvature += 2.0 * (weight / (1.0 - a)).powi(2);
                half_square += 0.5 * legendre(a);
            }
            let t = 0.5 * tau / largest;
            let r = (2.0 * half_square).sqrt().copysign(tau);
            let q = t * f64::sqrt(curvature);
            [f64::ln(mean), r, (q / r).ln() / r]
        };
        QuadraticForm {
            sum: weights.iter().sum(),
            squares: weights.iter().map(|w| w * w).sum(),
            nodes: below.into_iter().rev().chain(above).map(node).collect(),
        }
    }

    /// z with P(X ≤ x) = Φ(z).
    pub fn z(&self, x: f64, freedom: f64) -> f64 {
        let (at, root) = ((x / freedom).ln(), freedom.sqrt());
        if at.is_nan() || self.nodes.len() < 2 {
            return f64::NAN;
        }
        let z = |[_, r, c]: [f64; 3]| root * r + c / root;
        let above = self.nodes.partition_point(|node| node[0] <= at).clamp(1, self.nodes.len() - 1);
        let (low, high) = (self.nodes[above - 1], self.nodes[above]);
        let part = (at - low[0]) / (high[0] - low[0]);
        z(low) + part * (z(high) - z(low))
    }

    /// The inverse: x with P(X ≤ x) = Φ(z).
    pub fn quantile(&self, z: f64, freedom: f64) -> f64 {
        let root = freedom.sqrt();
        let z_of = |[_, r, c]: [f64; 3]| root * r + c / root;
        if z.is_nan() || self.nodes.len() < 2 {
            return f64::NAN;
        }
        let above = self.nodes.partition_point(|node| z_of(*node) <= z).clamp(1, self.nodes.len() - 1);
        let (low, high) = (self.nodes[above - 1], self.nodes[above]);
        let part = (z - z_of(low)) / (z_of(high) - z_of(low));
        (low[0] + part * (high[0] - low[0])).exp() * freedom
    }
}

/// a/(1 − a) + ln(1 − a), without cancellation: Σ_{j ≥ 2} (j − 1)/j a^j for small a.
fn legendre(a: f64) -> f64 {
    if a.abs() > 0.02 {
        return a / (1.0 - a) + (-a).ln_1p();
    }
    (2..10).rev().fold(0.0, |sum, j| sum * a + f64::from(j - 1) / f64::from(j)) * a * a
}
