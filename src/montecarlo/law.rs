//! The law of the gate's statistics for a true filter, by drawing them without simulating the runs.
//!
//! For a true filter the errors at the epochs are a Gauss-Markov chain, e' = Φ e + c with c ~ N(0, P' − Φ P Φᵀ), and
//! the innovations are independent N(0, 1). What the gate looks at are sums over M runs, so only E Eᵀ and E 1 of the
//! n × M matrix E of errors matter. Runs can be rotated without changing the law: the first column is then the mean
//! (times √M), the rest a triangular factor of a Wishart matrix, and a step of the chain needs about n² random
//! numbers whatever M is. Of many states only what two epochs have in common is followed. One replicate of a gate of
//! 1000 runs of 60 000 steps costs microseconds. Exact for NEES, mean errors and block powers; of relative order
//! 1/(number of updates) for autocorrelations. Left out are the dependence between errors and innovations and that
//! between periodogram and block powers; both make the gate milder than alpha, if anything, and whole experiments
//! have not told the difference (docs/validation.md).
//!
//! Sources: Anderson 2003, section 7.2 (Bartlett's decomposition); Bar-Shalom, Li & Kirubarajan 2001, section 5.4.

use nalgebra::{DMatrix, DVector, SymmetricEigen};
use rand::rngs::ChaCha8Rng;
use rand_distr::{ChiSquared, Distribution, Gamma};

use super::course::AxisCourse;
use super::gate::{Kind, Raw};
use super::sums::Channel;
use crate::numerics::distribution::normal_sf;
use crate::numerics::progress::checkpoint;
use crate::numerics::random::{StreamId, fill_normal, normal, stream};

/// Term part of the stream addresses of replicates.
const REPLICATE: u32 = 0x14_0000;

/// The chain of one axis.
#[derive(Clone, Debug)]
pub(super) struct Law {
    runs: u64,
    links: Vec<Link>,
    channels: Vec<ChannelLaw>,
    kinds: Vec<Kind>,
}

/// From the epoch before to this one.
#[derive(Clone, Debug)]
struct Link {
    /// Coordinates of the error that are followed.
    size: usize,
    /// By columns (no sum then waits for the one before it), `size` × that of the epoch before.
    transition: Vec<f64>,
    /// Root C of P' − Φ P Φᵀ, columns of zero variance left out: by columns.
    fresh: Vec<Vec<f64>>,
    /// W B: by columns, r × `size`.
    judged: Vec<f64>,
    /// Judged components that no other epoch knows of: independent N(0, 1).
    rest: usize,
    regular: bool,
}

/// y = to · e and e ≈ from · y of an epoch.
struct Coordinates {
    to: DMatrix<f64>,
    from: DMatrix<f64>,
}

/// Chains of so many states are followed as they are.
const SMALL: usize = 6;
/// Part of its largest sigma from which on an error is rounding.
const KNOWN: f64 = 1e-12;
/// What an epoch tells the next one less than this about (correlation of whitened errors) is not followed.
const NEGLIGIBLE: f64 = 1e-4;

/// Coordinates in which the errors of each epoch are followed: the states scaled to their largest claimed sigma, or,
/// where there are many (lines of vibration have two each, and forget between two epochs), those whitened errors
/// that the next or the last epoch knows something of.
fn coordinates(axis: &AxisCourse) -> Vec<Coordinates> {
    let (n, epochs) = (axis.gains.states, &axis.gains.epochs);
    if n <= SMALL {
        let largest = |i| epochs.iter().map(|e| e.covariance[(i, i)].sqrt()).fold(0.0, f64::max);
        let scale = DVector::from_fn(n, |i, _| Some(largest(i)).filter(|sigma| *sigma > 0.0).unwrap_or(1.0));
        let one =
            || Coordinates { to: DMatrix::from_diagonal(&scale.map(f64::recip)), from: DMatrix::from_diagonal(&scale) };
        return epochs.iter().map(|_| one()).collect();
    }
    // e = L y with y white; a state whose error has died out (of a servo that only a known command drives) is known
    let largest = |i| epochs.iter().map(|e| e.covariance[(i, i)]).fold(0.0, f64::max);
    let known = DVector::from_fn(n, |i, _| KNOWN * KNOWN * largest(i));
    let whitened: Vec<Coordinates> = epochs.iter().map(|epoch| whiten(&epoch.covariance, &known)).collect();
    // Uᵀ and Vᵀ of the transition to each epoch that matter
    let kept: Vec<[DMatrix<f64>; 2]> = (0..epochs.len())
        .map(|k| {
            if k == 0 {
                return [DMatrix::zeros(0, whitened[0].to.nrows()), DMatrix::zeros(0, 0)];
            }
            let (here, before) = (&whitened[k], &whitened[k - 1]);
            let svd = (&here.to * &epochs[k].transition * &before.from).svd(true, true);
            let large = svd.singular_values.iter().filter(|s| **s > NEGLIGIBLE).count();
            let [u, v] = [svd.u.map(|u| u.transpose()), svd.v_t].map(|m| m.unwrap_or_else(|| DMatrix::zeros(0, 0)));
            [u.rows(0, large).into_owned(), v.rows(0, large).into_owned()]
        })
        .collect();
    (0..epochs.len())
        .map(|k| {
            let Coordinates { to, from } = &whitened[k];
            let mut known = kept[k][0].tr_mul(&kept[k][0]);
            if let Some([_, v]) = kept.get(k + 1) {
                known += v.tr_mul(v);
            }
            let judged = &axis.epochs[k].of_estimate * from;
            if judged.nrows() < n {
                known += judged.tr_mul(&judged);
            }
            let eigen = SymmetricEigen::new(known);
            let columns: Vec<_> = (0..to.nrows())
                .filter(|i| eigen.eigenvalues[*i] > 1e-6)
                .map(|i| eigen.eigenvectors.column(i).into_owned())
                .collect();
            // an epoch that knows nothing still has a place in the chain
            let basis =
                if columns.is_empty() { DMatrix::zeros(to.nrows(), 0) } else { DMatrix::from_columns(&columns) };
            Coordinates { to: basis.tr_mul(to), from: from * basis }
        })
        .collect()
}

/// y = L⁺ e, e = L y with L Lᵀ = `covariance`; a variance up to `known` is none.
fn whiten(covariance: &DMatrix<f64>, known: &DVector<f64>) -> Coordinates {
    let n = covariance.nrows();
    let open = |i: usize| covariance[(i, i)] > known[i];
    let sigma = DVector::from_fn(n, |i, _| if open(i) { covariance[(i, i)].sqrt() } else { 1.0 });
    let correlation = |i, j| if open(i) && open(j) { covariance[(i, j)] / (sigma[i] * sigma[j]) } else { 0.0 };
    let eigen = SymmetricEigen::new(DMatrix::from_fn(n, n, correlation));
    let root = eigen.eigenvalues.map(|v| v.max(0.0).sqrt());
    let inverse = root.map(|r| if r > 1e-8 { 1.0 / r } else { 0.0 });
    Coordinates {
        to: DMatrix::from_fn(n, n, |i, j| inverse[i] * eigen.eigenvectors[(j, i)] / sigma[j]),
        from: DMatrix::from_fn(n, n, |i, j| sigma[i] * eigen.eigenvectors[(i, j)] * root[j]),
    }
}

#[derive(Clone, Debug)]
struct ChannelLaw {
    channel: Channel,
    /// χ² of the coarsest blocks, then what each finer length adds.
    blocks: Vec<ChiSquared<f64>>,
    /// Share of the NIS' freedom that is in the finest blocks.
    shared: f64,
    ordinate: Gamma<f64>,
}

/// Sums of one replicate.
pub(super) struct Drawn {
    /// Σ over runs of the NEES, per epoch.
    pub(super) nees: Vec<f64>,
    /// M |mean whitened error|², per epoch.
    pub(super) mean_error: Vec<f64>,
}

impl Law {
    /// `None` when there is nothing to draw: no run, or a measurement without updates.
    pub(super) fn new(axis: &AxisCourse, runs: u64) -> Option<Law> {
        let mut links = Vec::with_capacity(axis.epochs.len());
        let mut before = DMatrix::zeros(0, 0);
        let mut from_before = DMatrix::zeros(axis.gains.states, 0);
        for ((epoch, course), coordinates) in axis.gains.epochs.iter().zip(&axis.epochs).zip(coordinates(axis)) {
            let Coordinates { to, from } = coordinates;
            let covariance = &to * &epoch.covariance * to.transpose();
            let transition = &to * &epoch.transition * &from_before;
            let fresh = &covariance - &transition * &before * transition.transpose();
            let eigen = SymmetricEigen::new((&fresh + fresh.transpose()) * 0.5);
            let columns = eigen.eigenvalues.iter().enumerate().filter(|(_, v)| **v > 1e-15);
            let judged = &course.of_estimate * &from;
            links.push(Link {
                size: to.nrows(),
                fresh: columns
                    .map(|(i, v)| eigen.eigenvectors.column(i).iter().map(|x| x * v.sqrt()).collect())
                    .collect(),
                transition: transition.iter().copied().collect(),
                rest: if judged.nrows() == axis.gains.states { judged.nrows() - to.nrows() } else { 0 },
                judged: judged.iter().copied().collect(),
                regular: course.regular,
            });
            (before, from_before) = (covariance, from);
        }
        let channels = axis.channels.iter().map(|c| ChannelLaw::new(c, runs)).collect::<Option<Vec<_>>>()?;
        Some(Law { runs, links, channels, kinds: Kind::of(axis) })
    }

    /// Raw p-values of replicate number `replicate`, in the order of [`Kind::of`].
    pub(super) fn draw(&self, raw: &Raw<'_>, seed: u64, replicate: u64, axis: u32) -> Vec<f64> {
        checkpoint();
        let mut rng = stream(seed, StreamId { run: replicate, axis, term: REPLICATE });
        let drawn = self.chain(&mut rng);
        let channels: Vec<[f64; 6]> = self.channels.iter().map(|c| c.draw(raw, self.runs, &mut rng)).collect();
        let value = |kind: &Kind| match kind {
            Kind::Nees => raw.nees(&drawn.nees),
            Kind::NeesAverage => {
                let regular = self.links.iter().zip(&drawn.nees).filter(|(link, _)| link.regular);
                raw.nees_average(regular.map(|(_, nees)| nees).sum())
            }
            Kind::MeanError => raw.mean_error(&drawn.mean_error),
            Kind::Nis(c) => channels[*c][0],
            Kind::InnovationMean(c) => channels[*c][1],
            Kind::Autocorrelation(c) => channels[*c][2],
            Kind::LjungBox(c) => channels[*c][3],
            Kind::CumulativePeriodogram(c) => channels[*c][4],
            Kind::LowFrequency(c) => channels[*c][5],
        };
        self.kinds.iter().map(value).collect()
    }

    fn chain(&self, rng: &mut ChaCha8Rng) -> Drawn {
        let others = self.runs - 1;
        let mut drawn =
            Drawn { nees: Vec::with_capacity(self.links.len()), mean_error: Vec::with_capacity(self.links.len()) };
        // the mean, then the columns of all other runs
        let (mut columns, mut before) = (Vec::new(), 0);
        let (mut spare, mut judged): (Vec<f64>, Vec<f64>) = (Vec::new(), Vec::new());
        for link in &self.links {
            let n = link.size;
            let count = columns.len().checked_div(before).unwrap_or(1);
            spare.clear();
            spare.resize(count * n, 0.0);
            for (c, column) in spare.chunks_exact_mut(n.max(1)).enumerate() {
                let old = &columns[c * before..(c + 1) * before];
                add(column, &link.transition, old.iter().copied());
                for fresh in &link.fresh {
                    add(column, fresh, [normal(rng)].into_iter());
                }
            }
            std::mem::swap(&mut columns, &mut spare);
            let free = others - (count - 1) as u64;
            if free > 0 && n > 0 {
                wishart(link, free, n, &mut columns, rng);
                if columns.len() > n + n * n {
                    spare.clear();
                    spare.resize(n * n, 0.0);
                    triangle(n, &columns[n..], &mut spare);
                    columns.truncate(n);
                    columns.extend_from_slice(&spare);
                }
            }
            let power = |column: &[f64]| -> f64 {
                judged.clear();
                judged.resize(link.judged.len() / n.max(1), 0.0);
                add(&mut judged, &link.judged, column.iter().copied());
                judged.iter().map(|u| u.powi(2)).sum()
            };
            let mut powers = columns.chunks_exact(n.max(1)).map(power);
            let of_mean = powers.next().unwrap_or(0.0) + chi_square(link.rest as u64, rng);
            drawn.mean_error.push(of_mean);
            drawn.nees.push(of_mean + powers.sum::<f64>() + chi_square(link.rest as u64 * others, rng));
            before = n;
        }
        drawn
    }
}

/// `sum` += A x, A given by columns.
fn add(sum: &mut [f64], columns: &[f64], x: impl Iterator<Item = f64>) {
    for (column, x) in columns.chunks_exact(sum.len().max(1)).zip(x) {
        sum.iter_mut().zip(column).for_each(|(sum, a)| *sum += a * x);
    }
}

/// A draw of χ²; zero for no degrees of freedom.
fn chi_square(freedom: u64, rng: &mut ChaCha8Rng) -> f64 {
    if freedom == 0 { 0.0 } else { ChiSquared::new(freedom as f64).map_or(0.0, |law| law.sample(rng)) }
}

/// Adds columns X with X Xᵀ ~ C W Cᵀ, W Wishart of identity and `free` degrees of freedom, by Bartlett's triangle.
fn wishart(link: &Link, free: u64, n: usize, columns: &mut Vec<f64>, rng: &mut ChaCha8Rng) {
    let size = link.fresh.len();
    for j in 0..size.min(free as usize) {
        let start = columns.len();
        columns.resize(start + n, 0.0);
        let column = &mut columns[start..];
        for (i, fresh) in link.fresh.iter().enumerate().skip(j) {
            let entry = if i > j {
                normal(rng)
            } else {
                // free − j is at least one here
                chi_square(free - j as u64, rng).sqrt()
            };
            column.iter_mut().zip(fresh).for_each(|(x, c)| *x += c * entry);
        }
    }
}

/// The n columns of a triangular L with L Lᵀ = X Xᵀ, X given by its columns.
fn triangle(n: usize, x: &[f64], l: &mut [f64]) {
    l.fill(0.0);
    for column in x.chunks_exact(n) {
        for j in 0..n {
            add(&mut l[j * n + j..][..n - j], &column[j..], [column[j]].into_iter());
        }
    }
    for j in 0..n {
        let (before, rest) = l.split_at_mut(j * n);
        let own = &mut rest[j..n];
        for column in before.chunks_exact(n) {
            add(own, &column[j..], [-column[j]].into_iter());
        }
        let root = own[0].max(0.0).sqrt();
        own.iter_mut().for_each(|x| *x = if root > 0.0 { *x / root } else { 0.0 });
        own[0] = root;
    }
}

impl ChannelLaw {
    fn new(channel: &Channel, runs: u64) -> Option<ChannelLaw> {
        let freedom: Vec<u64> = channel.lengths.iter().map(|l| runs * channel.blocks_of(*l) as u64).collect();
        let coarser = |i: usize| freedom.get(i + 1).copied().unwrap_or(0);
        let added = (0..freedom.len()).rev().map(|i| freedom[i] - coarser(i));
        let finest = freedom.first().copied().unwrap_or(0) as f64;
        Some(ChannelLaw {
            blocks: added.map(|d| ChiSquared::new(d as f64).ok()).collect::<Option<Vec<_>>>()?,
            shared: finest / (runs * channel.updates) as f64,
            ordinate: Gamma::new(runs as f64, 1.0).ok()?,
            channel: channel.clone(),
        })
    }

    /// Raw p-values: NIS, innovation mean, autocorrelation, Ljung-Box, cumulative periodogram, low frequency.
    fn draw(&self, raw: &Raw<'_>, runs: u64, rng: &mut ChaCha8Rng) -> [f64; 6] {
        let mut power = 0.0;
        let mut powers: Vec<f64> = self
            .blocks
            .iter()
            .map(|law| {
                power += law.sample(rng);
                power
            })
            .collect();
        powers.reverse();
        let finest = powers.first().map_or(0.0, |q| {
            let freedom = self.shared * (runs * self.channel.updates) as f64;
            (q - freedom) / (2.0 * freedom).sqrt()
        });
        let nis = self.shared.sqrt() * finest + (1.0 - self.shared).sqrt() * normal(rng);
        let mean = normal(rng);
        let mut lags = vec![0.0; self.channel.lags];
        fill_normal(rng, &mut lags);
        let ordinates: Vec<f64> = (0..self.channel.ordinates).map(|_| self.ordinate.sample(rng)).collect();
        [
            (2.0 * normal_sf(nis.abs())).min(1.0),
            (2.0 * normal_sf(mean.abs())).min(1.0),
            Raw::autocorrelation(&lags).1,
            Raw::ljung_box(&lags).1,
            raw.cumulative_periodogram(&ordinates).1,
            raw.low_frequency(&self.channel, &powers).1,
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::montecarlo::course::own_models;
    use crate::montecarlo::experiment::course_of;
    use crate::params::Params;
    use crate::tune::{TuneOptions, tune};

    /// Three lines beside a drift: eight states, of which the lines forget within the 1 s between two epochs: what
    /// is followed are two directions back and two forth at most. The time average of the NEES keeps its exact mean
    /// r and variance 2 Σ w²/(E² M), the mean error its mean r: within 5 standard errors of 4000 draws (6e-7 each).
    #[test]
    fn errors_that_are_soon_forgotten_count_without_being_followed() {
        let text = r#"{"format": "kfdesign-params/1", "quantity": "angular-rate", "sample_rate": "100 Hz", "axes": [{"name": "x",
            "turn_on_bias": {"std_dev": "0.1 deg/s"}, "white": {"density": "0.05 deg/s/sqrt(Hz)"},
            "gauss_markov": [{"std_dev": "0.1 deg/s", "correlation_time": "5 s"}],
            "oscillation": [{"std_dev": "0.2 deg/s", "frequency": "11 Hz", "correlation_time": "0.1 s"},
                {"std_dev": "0.1 deg/s", "frequency": "17 Hz", "correlation_time": "0.05 s"},
                {"std_dev": "0.3 deg/s", "frequency": "23 Hz", "correlation_time": "0.1 s"}]}]}"#;
        let params = Params::from_json(text, "params.json").unwrap();
        let design = tune(&params, &TuneOptions::default()).unwrap().design;
        let course = course_of(&design, own_models(&design), 10_000, 1).unwrap();
        let (axis, runs, draws) = (&course.axes[0], 5, 4000);
        let law = Law::new(axis, runs).unwrap();
        assert_eq!(axis.gains.states, 8);
        // the first epochs are closer together
        let followed: Vec<usize> = law.links.iter().skip(8).map(|link| link.size).collect();
        assert!(followed.iter().all(|size| (1..=4).contains(size)), "{followed:?}");
        let form = super::super::gate::nees_over_time(axis);
        let (size, epochs) = (axis.judge.size() as f64, axis.epochs.iter().filter(|e| e.regular).count() as f64);
        let (mut average, mut square, mut error) = (0.0, 0.0, 0.0);
        for replicate in 0..draws {
            let drawn = law.chain(&mut stream(3, StreamId { run: replicate, axis: 0, term: REPLICATE }));
            let regular = drawn.nees.iter().zip(&axis.epochs).filter(|(_, epoch)| epoch.regular);
            let mean = regular.map(|(nees, _)| nees).sum::<f64>() / (epochs * runs as f64);
            average += mean / draws as f64;
            square += (mean - size).powi(2) / draws as f64;
            error += drawn.mean_error.last().unwrap() / draws as f64;
        }
        let variance = 2.0 * form.squares / (epochs.powi(2) * runs as f64);
        let root = (draws as f64).sqrt();
        assert!((average - size).abs() < 5.0 * variance.sqrt() / root, "{average} for {size}");
        // the fourth moment of such a sum is at most that of one χ²: kurtosis 15
        assert!((square / variance - 1.0).abs() < 5.0 * 14f64.sqrt() / root, "{square} for {variance}");
        assert!((error - size).abs() < 5.0 * (2.0 * size).sqrt() / root, "{error} for {size}");
    }
}
