//! The law of the gate's statistics for a true filter, by drawing them without simulating the runs.
//!
//! For a true filter the errors at the epochs are a Gauss-Markov chain, e' = Φ e + c with c ~ N(0, P' − Φ P Φᵀ), and the innovations are
//! independent N(0, 1). What the gate looks at are sums over M runs, so only E Eᵀ and E 1 of the n × M matrix E of errors matter. Runs can
//! be rotated without changing the law: the first column is then the mean (times √M), the rest a triangular factor of a Wishart matrix, and a
//! step of the chain needs about n² random numbers whatever M is. One replicate of a gate of 1000 runs of 60 000 steps costs microseconds.
//! Exact for NEES, mean errors and block powers; of relative order 1/(number of updates) for autocorrelations. Left out are the dependence
//! between errors and innovations and that between periodogram and block powers; both make the gate milder than alpha, if anything, and
//! whole experiments have not told the difference (docs/validation.md).
//!
//! Sources: Anderson 2003, section 7.2 (Bartlett's decomposition); Bar-Shalom, Li & Kirubarajan 2001, section 5.4.

use nalgebra::{DMatrix, SymmetricEigen};
use rand::rngs::ChaCha8Rng;
use rand_distr::{ChiSquared, Distribution, Gamma};

use super::course::{AxisCourse, Channel};
use super::gate::{Kind, Raw};
use crate::numerics::distribution::normal_sf;
use crate::numerics::random::{StreamId, fill_normal, normal, stream};

/// Term part of the stream addresses of replicates.
const REPLICATE: u32 = 0x14_0000;

/// The chain of one axis, in states scaled to their largest claimed sigma.
#[derive(Clone, Debug)]
pub(super) struct Law {
    states: usize,
    runs: u64,
    links: Vec<Link>,
    channels: Vec<ChannelLaw>,
    kinds: Vec<Kind>,
}

/// From the epoch before to this one.
#[derive(Clone, Debug)]
struct Link {
    /// Row-major, n × n.
    transition: Vec<f64>,
    /// Root C of P' − Φ P Φᵀ, n × n, columns of zero variance left out: by columns.
    fresh: Vec<Vec<f64>>,
    /// W B: row-major, r × n.
    judged: Vec<f64>,
    regular: bool,
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
        let n = axis.gains.states;
        let scale: Vec<f64> = (0..n)
            .map(|i| axis.gains.epochs.iter().map(|e| e.covariance[(i, i)].sqrt()).fold(0.0, f64::max))
            .map(|sigma| if sigma > 0.0 { sigma } else { 1.0 })
            .collect();
        let scaled = |m: &DMatrix<f64>, rows: i32, columns: i32| {
            DMatrix::from_fn(m.nrows(), m.ncols(), |i, j| {
                let row = if rows == 0 { 1.0 } else { scale[i].powi(rows) };
                m[(i, j)] * row * scale[j].powi(columns)
            })
        };
        let mut links = Vec::with_capacity(axis.epochs.len());
        let mut before = DMatrix::zeros(n, n);
        for (epoch, course) in axis.gains.epochs.iter().zip(&axis.epochs) {
            let covariance = scaled(&epoch.covariance, -1, -1);
            let transition = if links.is_empty() { DMatrix::zeros(n, n) } else { scaled(&epoch.transition, -1, 1) };
            let fresh = &covariance - &transition * &before * transition.transpose();
            let eigen = SymmetricEigen::new((&fresh + fresh.transpose()) * 0.5);
            let columns = eigen.eigenvalues.iter().enumerate().filter(|(_, v)| **v > 1e-15);
            links.push(Link {
                fresh: columns
                    .map(|(i, v)| eigen.eigenvectors.column(i).iter().map(|x| x * v.sqrt()).collect())
                    .collect(),
                transition: transition.transpose().iter().copied().collect(),
                judged: scaled(&course.of_estimate, 0, 1).transpose().iter().copied().collect(),
                regular: course.regular,
            });
            before = covariance;
        }
        let channels = axis.channels.iter().map(|c| ChannelLaw::new(c, runs)).collect::<Option<Vec<_>>>()?;
        Some(Law { states: n, runs, links, channels, kinds: Kind::of(axis) })
    }

    /// Raw p-values of replicate number `replicate`, in the order of [`Kind::of`].
    pub(super) fn draw(&self, raw: &Raw<'_>, seed: u64, replicate: u64, axis: u32) -> Vec<f64> {
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
        let n = self.states;
        let others = self.runs - 1;
        let mut drawn =
            Drawn { nees: Vec::with_capacity(self.links.len()), mean_error: Vec::with_capacity(self.links.len()) };
        let mut mean = vec![0.0; n];
        // columns of n numbers
        let mut rest: Vec<f64> = Vec::new();
        let mut spare = vec![0.0; n];
        let mut factor = vec![0.0; n * n];
        for link in &self.links {
            for column in std::iter::once(&mut mean[..]).chain(rest.chunks_exact_mut(n)) {
                for (i, out) in spare.iter_mut().enumerate() {
                    *out = link.transition[i * n..][..n].iter().zip(column.iter()).map(|(f, x)| f * x).sum();
                }
                column.copy_from_slice(&spare);
                for fresh in &link.fresh {
                    let draw = normal(rng);
                    column.iter_mut().zip(fresh).for_each(|(x, c)| *x += c * draw);
                }
            }
            let free = others - (rest.len() / n) as u64;
            if free > 0 {
                wishart(link, free, n, &mut rest, rng);
                if rest.len() > n * n {
                    triangle(n, &rest, &mut factor);
                    rest.clear();
                    rest.extend_from_slice(&factor);
                }
            }
            let size = link.judged.len() / n;
            let power = |column: &[f64]| -> f64 {
                (0..size)
                    .map(|i| link.judged[i * n..][..n].iter().zip(column).map(|(j, x)| j * x).sum::<f64>().powi(2))
                    .sum()
            };
            let of_mean = power(&mean);
            drawn.mean_error.push(of_mean);
            drawn.nees.push(of_mean + rest.chunks_exact(n).map(power).sum::<f64>());
        }
        drawn
    }
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
                ChiSquared::new((free - j as u64) as f64).map_or(0.0, |law| law.sample(rng)).sqrt()
            };
            column.iter_mut().zip(fresh).for_each(|(x, c)| *x += c * entry);
        }
    }
}

/// The n columns of a triangular L with L Lᵀ = X Xᵀ, X given by its columns.
fn triangle(n: usize, x: &[f64], l: &mut [f64]) {
    l.fill(0.0);
    for i in 0..n {
        for j in 0..=i {
            let mut sum: f64 = x.chunks_exact(n).map(|column| column[i] * column[j]).sum();
            for k in 0..j {
                sum -= l[k * n + i] * l[k * n + j];
            }
            l[j * n + i] = if i == j {
                sum.max(0.0).sqrt()
            } else if l[j * n + j] > 0.0 {
                sum / l[j * n + j]
            } else {
                0.0
            };
        }
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
