//! The tests of the gate, and how many of them make one verdict.
//!
//! Every test gives a *raw* p-value from its own formula. Tests that look at many epochs, lengths or frequencies at
//! once take the least, and the law of that least value for a true filter, drawn in `super::law`, makes it the
//! p-value of one test: the band is simultaneous. In the same way the least p-value over all tests and axes is held
//! against its own law (Westfall & Young 1993, single step), so that the family-wise false-alarm probability *is*
//! alpha, not merely bounded by it as with Holm's or Bonferroni's rule: the tests are correlated, and the law knows
//! how.

use std::fmt;

use nalgebra::{DMatrix, SymmetricEigen};

use super::course::AxisCourse;
use super::sums::Channel;
use crate::consistency::TestKind;
use crate::consistency::normalized::two_sided_p;
use crate::numerics::distribution::{chi_square_sf, kolmogorov_sf, normal_quantile, normal_sf};
use crate::numerics::linalg::symmetric_eigenvalues;
use crate::numerics::optimize::bracketed_root;
use crate::numerics::quadratic_form::QuadraticForm;

/// Of so many judged components all are looked at together.
const SMALL: usize = 6;
/// Correlation that counts as none: the mean of the sum is exact, its variance off by at most the square.
const UNKNOWN: f64 = 1e-5;
/// Below this many drawn values the tail is extrapolated.
const FEWEST: usize = 50;

/// A test of one axis; the number is that of the measurement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Mean NEES over the runs at every epoch.
    Nees,
    /// NEES averaged over runs and the evenly spread epochs.
    NeesAverage,
    /// Mean error over the runs at every epoch.
    MeanError,
    Nis(usize),
    InnovationMean(usize),
    /// Largest autocorrelation of the innovations.
    Autocorrelation(usize),
    /// All lags together.
    LjungBox(usize),
    CumulativePeriodogram(usize),
    /// Power of block averages at every length.
    LowFrequency(usize),
}

impl Kind {
    /// The tests of an axis, in the order of every list of p-values.
    pub fn of(axis: &AxisCourse) -> Vec<Kind> {
        let mut kinds = Vec::new();
        if !axis.epochs.is_empty() {
            kinds.extend([Kind::Nees, Kind::NeesAverage, Kind::MeanError]);
        }
        for (c, channel) in axis.channels.iter().enumerate() {
            kinds.extend([Kind::Nis(c), Kind::InnovationMean(c), Kind::Autocorrelation(c), Kind::LjungBox(c)]);
            if channel.ordinates > 0 {
                kinds.push(Kind::CumulativePeriodogram(c));
            }
            if !channel.lengths.is_empty() {
                kinds.push(Kind::LowFrequency(c));
            }
        }
        kinds
    }

    /// Without the measurement.
    pub fn of_test(self) -> TestKind {
        match self {
            Kind::Nees => TestKind::Nees,
            Kind::NeesAverage => TestKind::NeesAverage,
            Kind::MeanError => TestKind::MeanError,
            Kind::Nis(_) => TestKind::Nis,
            Kind::InnovationMean(_) => TestKind::InnovationMean,
            Kind::Autocorrelation(_) => TestKind::Autocorrelation,
            Kind::LjungBox(_) => TestKind::LjungBox,
            Kind::CumulativePeriodogram(_) => TestKind::CumulativePeriodogram,
            Kind::LowFrequency(_) => TestKind::LowFrequency,
        }
    }

    /// The name in documents, without the measurement.
    pub fn name(self) -> &'static str {
        self.of_test().name()
    }

    /// Whether the raw p-value is a least one of many, or rests on an approximation that the drawn law replaces.
    fn is_calibrated(self) -> bool {
        use Kind::{CumulativePeriodogram, LowFrequency, MeanError, Nees, NeesAverage};
        matches!(self, Nees | NeesAverage | MeanError | CumulativePeriodogram(_) | LowFrequency(_))
    }

    /// The measurement the test belongs to.
    pub fn channel(self) -> Option<usize> {
        match self {
            Kind::Nees | Kind::NeesAverage | Kind::MeanError => None,
            Kind::Nis(c)
            | Kind::InnovationMean(c)
            | Kind::Autocorrelation(c)
            | Kind::LjungBox(c)
            | Kind::CumulativePeriodogram(c)
            | Kind::LowFrequency(c) => Some(c),
        }
    }
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Raw p-values from sums over `runs` runs.
#[derive(Clone, Copy, Debug)]
pub struct Raw<'a> {
    pub axis: &'a AxisCourse,
    pub runs: u64,
    /// Law of the NEES summed over the evenly spread epochs of a run.
    over_time: &'a QuadraticForm,
}

impl<'a> Raw<'a> {
    pub fn new(axis: &'a AxisCourse, runs: u64) -> Raw<'a> {
        Raw { axis, runs, over_time: nees_over_time(axis) }
    }

    /// Independent NEES values that the average over the evenly spread epochs of one run is worth: E² r / Σ_jk |ρ_jk|².
    ///
    /// For one state and ρ_jk = λ^|j−k| this is n(1 − λ²)/(1 + λ²) (formula of Bar-Shalom, Li & Kirubarajan 2001,
    /// section 5.4, for a Gauss-Markov error): a run of many epochs is worth few independent ones.
    pub fn effective(&self) -> f64 {
        self.over_time.sum.powi(2) / (self.over_time.squares * self.size())
    }

    /// Degrees of freedom of a NEES.
    fn size(&self) -> f64 {
        self.axis.judge.size() as f64
    }

    /// Least two-sided p over the epochs; `nees`: sums over the runs. All epochs have the law χ²(r M).
    pub fn nees(&self, nees: &[f64]) -> f64 {
        let least = nees.iter().copied().fold(f64::INFINITY, f64::min);
        let largest = nees.iter().copied().fold(0.0, f64::max);
        self.nees_at(least).min(self.nees_at(largest))
    }

    /// Two-sided p of one epoch.
    pub fn nees_at(&self, sum: f64) -> f64 {
        two_sided_p(sum, self.size() * self.runs as f64)
    }

    /// `sum` over the runs and evenly spread epochs: a quadratic form of correlated normal numbers.
    pub fn nees_average(&self, sum: f64) -> f64 {
        (2.0 * normal_sf(self.over_time.z(sum, self.runs as f64).abs())).min(1.0)
    }

    /// Sums of which [`nees_average`](Raw::nees_average) makes `p`.
    pub fn nees_average_bounds(&self, p: f64) -> [f64; 2] {
        let z = normal_quantile(1.0 - 0.5 * p);
        [-z, z].map(|z| self.over_time.quantile(z, self.runs as f64))
    }

    /// Least upper-tail p over the epochs of M |ū|², χ²(r).
    pub fn mean_error(&self, statistics: &[f64]) -> f64 {
        chi_square_sf(statistics.iter().copied().fold(0.0, f64::max), self.size())
    }

    /// Largest |z| over the lags and its p-value.
    pub fn autocorrelation(z: &[f64]) -> (f64, f64) {
        let largest = z.iter().map(|z| z.abs()).fold(0.0, f64::max);
        let single = 2.0 * normal_sf(largest);
        (largest, -((-single.min(1.0)).ln_1p() * z.len() as f64).exp_m1())
    }

    /// Σ z² over the lags and its upper-tail p-value.
    pub fn ljung_box(z: &[f64]) -> (f64, f64) {
        let sum: f64 = z.iter().map(|z| z * z).sum();
        (sum, chi_square_sf(sum, z.len() as f64))
    }

    /// Largest distance of the cumulative periodogram from the straight line, with its sign, and Kolmogorov's p-value.
    pub fn cumulative_periodogram(&self, ordinates: &[f64]) -> (f64, f64) {
        let (distance, _) = periodogram_distance(ordinates);
        (distance, kolmogorov_sf(distance.abs() * ((ordinates.len() as u64 * self.runs) as f64).sqrt()))
    }

    /// The length (by its number) that deviates most, and its two-sided p; `powers`: Σ (block sum)²/length.
    pub fn low_frequency(&self, channel: &Channel, powers: &[f64]) -> (usize, f64) {
        let mut least = (0, f64::INFINITY);
        for (i, (power, length)) in powers.iter().zip(&channel.lengths).enumerate() {
            let p = two_sided_p(*power, (self.runs * channel.blocks_of(*length) as u64) as f64);
            if p < least.1 {
                least = (i, p);
            }
        }
        least
    }
}

/// max_j (U_j − j/m) by size, and its j (from 1).
pub fn periodogram_distance(ordinates: &[f64]) -> (f64, usize) {
    let total: f64 = ordinates.iter().sum();
    let count = ordinates.len() as f64;
    let (mut sum, mut distance, mut at) = (0.0, 0.0f64, 0);
    for (j, power) in ordinates.iter().enumerate() {
        sum += power;
        let d = sum / total - (j + 1) as f64 / count;
        if d.abs() > distance.abs() {
            (distance, at) = (d, j + 1);
        }
    }
    (distance, at)
}

/// Law of the NEES summed over the evenly spread epochs of a run of a true filter: its weights are the eigenvalues
/// of the correlation matrix of the whitened errors of all these epochs, blocks ρ_jk = E(u_j u_kᵀ).
pub(super) fn nees_over_time(axis: &AxisCourse) -> &QuadraticForm {
    axis.over_time.get_or_init(|| law_over_time(axis))
}

fn law_over_time(axis: &AxisCourse) -> QuadraticForm {
    let size = axis.judge.size();
    // evenly spread epochs follow those of the start
    let first = axis.epochs.iter().position(|epoch| epoch.regular).unwrap_or(axis.epochs.len());
    let count = axis.epochs.len() - first;
    let mut below: Vec<Vec<DMatrix<f64>>> = Vec::with_capacity(count);
    for k in 0..count {
        let mut cross = &axis.gains.epochs[first + k].covariance * axis.epochs[first + k].of_estimate.transpose();
        let later = k + 1..count;
        let block = |j: usize| {
            cross = &axis.gains.epochs[first + j].transition * &cross;
            &axis.epochs[first + j].of_estimate * &cross
        };
        below.push(later.map(block).collect());
    }
    let weights = if size <= SMALL { of_all(size, &below) } else { of_what_is_known(size, &below) };
    QuadraticForm::new(&weights)
}

/// Eigenvalues of the matrix of unit blocks on the diagonal and ρ_jk, j > k, in `below[k][j − k − 1]`.
fn of_all(size: usize, below: &[Vec<DMatrix<f64>>]) -> Vec<f64> {
    let count = below.len();
    let mut correlation = DMatrix::identity(count * size, count * size);
    for (k, blocks) in below.iter().enumerate() {
        for (block, j) in blocks.iter().zip(k + 1..) {
            correlation.view_mut((j * size, k * size), (size, size)).copy_from(block);
        }
    }
    correlation.fill_upper_triangle_with_lower_triangle();
    symmetric_eigenvalues(&correlation)
}

/// The same of many states, most of which are forgotten between two epochs: what no other epoch knows more than
/// [`UNKNOWN`] of, as correlation, has a weight of one, and the eigenvalues are those of the rest.
fn of_what_is_known(size: usize, below: &[Vec<DMatrix<f64>>]) -> Vec<f64> {
    let count = below.len();
    // of all that epoch k shares with others, Σ_j ρ_jkᵀ ρ_jk
    let mut shared = vec![DMatrix::zeros(size, size); count];
    for (k, blocks) in below.iter().enumerate() {
        for (block, j) in blocks.iter().zip(k + 1..) {
            shared[k] += block.tr_mul(block);
            shared[j] += block * block.transpose();
        }
    }
    let known = |shared: DMatrix<f64>| {
        let eigen = SymmetricEigen::new(shared);
        let columns: Vec<_> = (0..size)
            .filter(|i| eigen.eigenvalues[*i] > UNKNOWN * UNKNOWN)
            .map(|i| eigen.eigenvectors.column(i).into_owned())
            .collect();
        if columns.is_empty() { DMatrix::zeros(size, 0) } else { DMatrix::from_columns(&columns) }
    };
    let bases: Vec<DMatrix<f64>> = shared.into_iter().map(known).collect();
    let first: Vec<usize> = bases
        .iter()
        .scan(0, |sum, basis| {
            let own = *sum;
            *sum += basis.ncols();
            Some(own)
        })
        .collect();
    let total = bases.iter().map(DMatrix::ncols).sum();
    let mut correlation = DMatrix::identity(total, total);
    for (k, blocks) in below.iter().enumerate() {
        for (block, j) in blocks.iter().zip(k + 1..) {
            let block = bases[j].tr_mul(&(block * &bases[k]));
            correlation.view_mut((first[j], first[k]), block.shape()).copy_from(&block);
        }
    }
    correlation.fill_upper_triangle_with_lower_triangle();
    let mut weights = symmetric_eigenvalues(&correlation);
    weights.resize(count * size, 1.0);
    weights
}

/// Law of a least p-value, from drawn ones.
///
/// P(p_min ≤ t) is the share of drawn values up to t. Where fewer than 50 were drawn, it goes on as the power of t
/// that leads from the five-hundredth to the fiftieth: one for exact p-values, less where the raw p-value makes a
/// tail too light.
#[derive(Clone, Debug)]
pub struct LeastLaw {
    drawn: Vec<f64>,
    tail: f64,
    /// Share up to `tail`.
    share: f64,
    power: f64,
}

impl LeastLaw {
    pub fn new(mut drawn: Vec<f64>) -> LeastLaw {
        drawn.sort_by(f64::total_cmp);
        let count = drawn.len().max(1) as f64;
        let value = |at: usize| drawn.get(at.min(drawn.len()).max(1) - 1).copied().unwrap_or(1.0);
        let (tail, further) = (value(FEWEST), value(10 * FEWEST));
        let share = (FEWEST.min(drawn.len()).max(1) as f64 - 0.5) / count;
        let power = 10f64.ln() / (further / tail).ln();
        let power = if power.is_finite() && drawn.len() > 20 * FEWEST { power.clamp(0.3, 1.5) } else { 1.0 };
        LeastLaw { drawn, tail, share, power }
    }

    /// P(p_min ≤ t).
    pub fn cdf(&self, t: f64) -> f64 {
        if t.is_nan() {
            return f64::NAN;
        }
        if t <= self.tail {
            return if t > 0.0 { self.share * (t / self.tail).powf(self.power) } else { 0.0 };
        }
        let above = self.drawn.partition_point(|x| *x <= t);
        if above >= self.drawn.len() {
            return 1.0;
        }
        // between two drawn values the share grows in a straight line
        let (low, high) = (self.drawn[above - 1], self.drawn[above]);
        let part = if high > low { (t - low) / (high - low) } else { 0.0 };
        ((above as f64 - 0.5 + part) / self.drawn.len() as f64).min(1.0)
    }

    /// t with P(p_min ≤ t) = `p`.
    pub fn quantile(&self, p: f64) -> f64 {
        if p <= self.share || self.drawn.is_empty() {
            return (self.tail * (p / self.share).powf(1.0 / self.power)).min(1.0);
        }
        let place = p * self.drawn.len() as f64 - 0.5;
        let (low, last) = (place as usize, self.drawn.len() - 1);
        let (low, high, part) = (self.drawn[low.min(last)], self.drawn[(low + 1).min(last)], place.fract());
        low + part * (high - low)
    }
}

/// The laws of one axis.
#[derive(Clone, Debug)]
pub struct AxisGate {
    pub kinds: Vec<Kind>,
    /// Of the raw p-value of each kind, where it is calibrated.
    laws: Vec<Option<LeastLaw>>,
    /// Of the least p-value over the kinds.
    family: LeastLaw,
}

impl AxisGate {
    /// `drawn`: raw p-values of each replicate.
    pub(super) fn new(kinds: Vec<Kind>, drawn: &[Vec<f64>]) -> AxisGate {
        let column = |i: usize| drawn.iter().map(|raw| raw[i]).collect();
        let law = |(i, kind): (usize, &Kind)| kind.is_calibrated().then(|| LeastLaw::new(column(i)));
        let laws: Vec<Option<LeastLaw>> = kinds.iter().enumerate().map(law).collect();
        let mut gate = AxisGate { kinds, laws, family: LeastLaw::new(Vec::new()) };
        gate.family = LeastLaw::new(drawn.iter().map(|raw| gate.least(raw)).collect());
        gate
    }

    /// p-value of test `kind` from its raw one.
    pub fn p_value(&self, kind: usize, raw: f64) -> f64 {
        self.laws[kind].as_ref().map_or(raw, |law| law.cdf(raw))
    }

    /// The raw p-value that test `kind` must reach for the p-value `p`.
    pub fn raw_for(&self, kind: usize, p: f64) -> f64 {
        self.laws[kind].as_ref().map_or(p, |law| law.quantile(p))
    }

    pub(super) fn p_values(&self, raw: &[f64]) -> Vec<f64> {
        raw.iter().enumerate().map(|(i, p)| self.p_value(i, *p)).collect()
    }

    fn least(&self, raw: &[f64]) -> f64 {
        self.p_values(raw).into_iter().fold(1.0, f64::min)
    }
}

/// All axes.
#[derive(Clone, Debug)]
pub struct Gate {
    pub axes: Vec<AxisGate>,
    pub alpha: f64,
    /// A test whose p-value is at most this fails.
    pub critical: f64,
}

impl Gate {
    pub(super) fn new(axes: Vec<AxisGate>, alpha: f64) -> Gate {
        let mut gate = Gate { axes, alpha, critical: 0.0 };
        gate.critical = bracketed_root(|p| gate.family(p) - alpha, 0.0, 1.0, 0.0).unwrap_or(0.0);
        gate
    }

    /// Probability that some test of some axis of a true filter has a p-value of at most `p`: axes are independent.
    pub fn family(&self, p: f64) -> f64 {
        let none: f64 = self.axes.iter().map(|axis| (-axis.family.cdf(p)).ln_1p()).sum();
        -none.exp_m1()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Nine states of which two, mixed with the others, are remembered (0.9 and 0.5 from one of six epochs to the
    /// next) and one a little (0.01): the weights are those of the whole matrix, to 1e-9, at least 36 of the 54
    /// being one, and those of epochs that know nothing of each other are all one.
    #[test]
    fn weights_of_what_is_known_are_those_of_all() {
        let (size, count) = (9, 6);
        let mix = DMatrix::from_fn(size, size, |i, j| ((1 + i) * (2 + 3 * j) % 17) as f64 - 8.0).qr().q();
        let mut memory = DMatrix::zeros(size, size);
        (memory[(0, 0)], memory[(1, 1)], memory[(2, 2)]) = (0.9, 0.5, 0.01);
        let step = &mix * memory * mix.transpose();
        let power = |n: usize| (1..n).fold(step.clone(), |product, _| product * &step);
        let below: Vec<Vec<DMatrix<f64>>> =
            (0..count).map(|k| (k + 1..count).map(|j| power(j - k)).collect()).collect();
        let sorted = |mut weights: Vec<f64>| {
            weights.sort_by(f64::total_cmp);
            weights
        };
        let (known, all) = (sorted(of_what_is_known(size, &below)), sorted(of_all(size, &below)));
        assert_eq!(known.len(), size * count);
        assert!(known.iter().zip(&all).all(|(a, b)| (a - b).abs() < 1e-9), "{known:?} {all:?}");
        assert!(all[size * count - 1] > 2.0, "{all:?}");
        assert!(known.iter().filter(|w| **w == 1.0).count() >= 6 * count, "{known:?}");
        let strangers: Vec<Vec<DMatrix<f64>>> =
            (0..count).map(|k| (k + 1..count).map(|_| DMatrix::zeros(size, size)).collect()).collect();
        assert!(of_what_is_known(size, &strangers).iter().all(|w| *w == 1.0));
    }
}
