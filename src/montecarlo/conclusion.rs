//! From the sums over runs to tests, curves and sentences.

use super::course::AxisCourse;
use super::gate::{AxisGate, Gate, Kind, Raw, periodogram_distance};
use super::outcome::{
    AxisOutcome, Component, Credibility, Histogram, Innovations, LowFrequency, NeesAverage, NeesCurve, Periodogram,
};
use super::sums::Channel;
use super::sums::{NIS_BIN, NIS_BINS, Totals};
use super::{credibility, sentences};
use crate::consistency::Test;
use crate::consistency::normalized::two_sided_p;
use crate::filter::mismatch::expect;
use crate::numerics::distribution::{chi_square_cdf, chi_square_quantile, normal_quantile};

/// Sums of one axis with what they belong to.
pub(super) struct Summary<'a> {
    pub(super) axis: &'a AxisCourse,
    pub(super) totals: &'a Totals,
    pub(super) raw: Raw<'a>,
    /// Some sum is not a number.
    broken: bool,
}

impl<'a> Summary<'a> {
    pub(super) fn new(axis: &'a AxisCourse, totals: &'a Totals, runs: u64) -> Summary<'a> {
        let broken = totals.values.iter().any(|sum| sum.value().is_nan());
        Summary { axis, totals, raw: Raw::new(axis, runs), broken }
    }

    fn runs(&self) -> f64 {
        self.raw.runs as f64
    }

    fn size(&self) -> usize {
        self.axis.judge.size()
    }

    /// Mean of u, and of u uᵀ as a lower triangle by rows.
    pub(super) fn mean(&self, epoch: usize) -> Vec<f64> {
        let sums = self.totals.some(self.axis.layout.mean(epoch), self.size());
        sums.into_iter().map(|sum| sum / self.runs()).collect()
    }
    pub(super) fn moments(&self, epoch: usize) -> Vec<f64> {
        let sums = self.totals.some(self.axis.layout.moments(epoch), self.size() * (self.size() + 1) / 2);
        sums.into_iter().map(|sum| sum / self.runs()).collect()
    }

    /// Σ over the runs of the NEES.
    fn nees(&self, epoch: usize) -> f64 {
        let first = self.axis.layout.moments(epoch);
        (0..self.size()).map(|i| self.totals.value(first + i * (i + 3) / 2)).sum()
    }
    fn all_nees(&self) -> Vec<f64> {
        (0..self.axis.epochs.len()).map(|epoch| self.nees(epoch)).collect()
    }
    fn mean_errors(&self) -> Vec<f64> {
        let one = |epoch| self.mean(epoch).iter().map(|u| u * u).sum::<f64>() * self.runs();
        (0..self.axis.epochs.len()).map(one).collect()
    }
    /// Σ of the NEES over runs and evenly spread epochs, and the number of these.
    fn nees_over_time(&self) -> (f64, usize) {
        let regular = self.axis.epochs.iter().enumerate().filter(|(_, epoch)| epoch.regular);
        regular.fold((0.0, 0), |(sum, count), (epoch, _)| (sum + self.nees(epoch), count + 1))
    }

    /// Bounds of the average NEES, as a share of the number of components.
    fn average_band(&self, p: f64) -> [f64; 2] {
        let scale = self.nees_over_time().1 as f64 * self.size() as f64 * self.runs();
        self.raw.nees_average_bounds(p).map(|sum| sum / scale)
    }

    fn updates(&self, channel: usize) -> f64 {
        self.runs() * self.axis.channels[channel].updates as f64
    }
    fn squares(&self, channel: usize) -> f64 {
        self.totals.value(self.axis.layout.squares(channel))
    }
    fn innovation_mean(&self, channel: usize) -> f64 {
        self.totals.value(self.axis.layout.sum(channel)) / self.updates(channel)
    }
    /// Autocorrelation at lags 1.. and the same in standard deviations.
    fn lags(&self, channel: usize) -> (Vec<f64>, Vec<f64>) {
        let Channel { lags, updates, .. } = self.axis.channels[channel];
        let products = self.totals.some(self.axis.layout.lags(channel), lags);
        let variance = self.squares(channel) / self.updates(channel);
        let pairs = (1..=lags as u64).map(|lag| self.runs() * (updates - lag) as f64);
        products.iter().zip(pairs).map(|(p, n)| (p / (n * variance), p / (n.sqrt() * variance))).unzip()
    }
    fn powers(&self, channel: usize) -> Vec<f64> {
        self.totals.some(self.axis.layout.blocks(channel), self.axis.channels[channel].lengths.len())
    }
    fn ordinates(&self, channel: usize) -> Vec<f64> {
        self.totals.some(self.axis.layout.ordinates(channel), self.axis.channels[channel].ordinates)
    }

    /// Not a number, which is no pass, when some sum is none: least and largest values would step over it.
    fn raw_p(&self, kind: Kind) -> f64 {
        if self.broken {
            return f64::NAN;
        }
        match kind {
            Kind::Nees => self.raw.nees(&self.all_nees()),
            Kind::NeesAverage => self.raw.nees_average(self.nees_over_time().0),
            Kind::MeanError => self.raw.mean_error(&self.mean_errors()),
            Kind::Nis(c) => two_sided_p(self.squares(c), self.updates(c)),
            Kind::InnovationMean(c) => {
                let z = self.innovation_mean(c) * self.updates(c).sqrt();
                (2.0 * crate::numerics::distribution::normal_sf(z.abs())).min(1.0)
            }
            Kind::Autocorrelation(c) => Raw::autocorrelation(&self.lags(c).1).1,
            Kind::LjungBox(c) => Raw::ljung_box(&self.lags(c).1).1,
            Kind::CumulativePeriodogram(c) => self.raw.cumulative_periodogram(&self.ordinates(c)).1,
            Kind::LowFrequency(c) => self.raw.low_frequency(&self.axis.channels[c], &self.powers(c)).1,
        }
    }

    /// The test of a kind with the bounds that belong to the p-value `critical`.
    fn test(&self, number: usize, kind: Kind, gate: &AxisGate, critical: f64) -> Test {
        let p = gate.p_value(number, self.raw_p(kind));
        let at = gate.raw_for(number, critical);
        let dt = self.axis.filter.dt;
        let (mut averaging, n) = (None, self.runs());
        let (statistic, bounds, meaning) = match kind {
            Kind::Nees => {
                let nees = self.all_nees();
                let freedom = self.size() as f64 * n;
                let worst = lowest(nees.iter().map(|sum| self.raw.nees_at(*sum)));
                let value = nees[worst] / freedom;
                let bounds = band(at, freedom);
                let time = self.axis.epochs[worst].step as f64 * dt;
                (value, bounds, sentences::nees(value, bounds, time))
            }
            Kind::NeesAverage => {
                let (sum, count) = self.nees_over_time();
                let value = sum / (count as f64 * self.size() as f64 * n);
                let bounds = self.average_band(at);
                (value, bounds, sentences::nees_average(value, bounds, self.raw.effective()))
            }
            Kind::MeanError => {
                let errors = self.mean_errors();
                let worst = lowest(errors.iter().map(|e| -e));
                let upper = chi_square_quantile(1.0 - at, self.size() as f64);
                let time = self.axis.epochs[worst].step as f64 * dt;
                (errors[worst], [0.0, upper], sentences::mean_error(errors[worst] > upper, time))
            }
            Kind::Nis(c) => {
                let value = self.squares(c) / self.updates(c);
                let bounds = band(at, self.updates(c));
                (value, bounds, sentences::nis(value, bounds))
            }
            Kind::InnovationMean(c) => {
                let bound = normal_quantile(1.0 - 0.5 * at) / self.updates(c).sqrt();
                let value = self.innovation_mean(c);
                (value, [-bound, bound], sentences::innovation_mean(value, bound))
            }
            Kind::Autocorrelation(c) => {
                let (r, z) = self.lags(c);
                let worst = lowest(z.iter().map(|z| -z.abs()));
                let bound = self.autocorrelation_bound(c, at, worst as u64 + 1);
                let lag = (worst + 1) as f64 * self.interval(c);
                (r[worst], [-bound, bound], sentences::autocorrelation(r[worst], bound, worst + 1, lag))
            }
            Kind::LjungBox(c) => {
                let (_, z) = self.lags(c);
                let value = Raw::ljung_box(&z).0;
                let upper = chi_square_quantile(1.0 - at, z.len() as f64);
                (value, [0.0, upper], sentences::ljung_box(value > upper, z.len()))
            }
            Kind::CumulativePeriodogram(c) => {
                let ordinates = self.ordinates(c);
                let (distance, j) = periodogram_distance(&ordinates);
                let bound = self.periodogram_bound(c, at);
                let channel = &self.axis.channels[c];
                let interval = channel.base as f64 * self.interval(c);
                averaging = Some(interval);
                let period = interval * channel.blocks as f64 / j.max(1) as f64;
                (distance, [-bound, bound], sentences::cumulative_periodogram(distance, bound, period, 2.0 * interval))
            }
            Kind::LowFrequency(c) => {
                let (channel, powers) = (&self.axis.channels[c], self.powers(c));
                let (worst, _) = self.raw.low_frequency(channel, &powers);
                let freedom = n * channel.blocks_of(channel.lengths[worst]) as f64;
                let seconds = self.averaging(c, worst);
                averaging = Some(seconds);
                let value = powers[worst] / freedom;
                let bounds = band(at, freedom);
                (value, bounds, sentences::low_frequency(value, bounds, seconds))
            }
        };
        let test = Test::new(&self.axis.name, &test_name(self.axis, kind), statistic, bounds, p, meaning);
        averaging.into_iter().fold(test, Test::with_averaging)
    }

    /// s between updates.
    fn interval(&self, channel: usize) -> f64 {
        self.axis.filter.dt * self.axis.channels[channel].every as f64
    }
    fn averaging(&self, channel: usize, length: usize) -> f64 {
        let c = &self.axis.channels[channel];
        (c.lengths[length] as u64 * c.base) as f64 * self.interval(channel)
    }
    /// Autocorrelation at `lag` of one measurement, such that all lags keep theirs with probability 1 − `p`.
    fn autocorrelation_bound(&self, channel: usize, p: f64, lag: u64) -> f64 {
        let Channel { lags, updates, .. } = self.axis.channels[channel];
        let single = -((-p).ln_1p() / lags as f64).exp_m1();
        normal_quantile(1.0 - 0.5 * single) / (self.runs() * (updates - lag) as f64).sqrt()
    }
    /// Distance that Kolmogorov's law exceeds with probability `p`.
    fn periodogram_bound(&self, channel: usize, p: f64) -> f64 {
        let count = self.runs() * self.axis.channels[channel].ordinates as f64;
        crate::consistency::whiteness::kolmogorov_quantile(p) / count.sqrt()
    }

    fn outcome(&self, gate: &AxisGate, critical: f64) -> AxisOutcome {
        let none: Vec<Vec<u64>> = vec![Vec::new(); self.axis.channels.len()];
        let expected = expect(&self.axis.filter, &self.axis.truth, &self.axis.gains, &self.axis.judge, &none);
        let size = self.size() as f64;
        let curve: Vec<f64> = expected.epochs.iter().map(|e| e.nees().map_or(f64::NAN, |nees| nees / size)).collect();
        let regular: Vec<f64> =
            curve.iter().zip(&self.axis.epochs).filter(|(_, epoch)| epoch.regular).map(|(nees, _)| *nees).collect();
        let level = |wanted: &dyn Fn(Kind) -> bool| {
            let number = gate.kinds.iter().position(|kind| wanted(*kind));
            number.map_or(critical, |number| gate.raw_for(number, critical))
        };
        let freedom = self.size() as f64 * self.runs();
        let (sum, count) = self.nees_over_time();
        let nees = level(&|kind| kind == Kind::Nees);
        let average = level(&|kind| kind == Kind::NeesAverage);
        let [lower, upper] = self.average_band(average);
        AxisOutcome {
            name: self.axis.name.clone(),
            nees: NeesCurve {
                time_s: self.axis.epochs.iter().map(|e| e.step as f64 * self.axis.filter.dt).collect(),
                mean: self.all_nees().into_iter().map(|sum| sum / freedom).collect(),
                expected: curve,
                lower: band(nees, freedom)[0],
                upper: band(nees, freedom)[1],
            },
            nees_average: NeesAverage {
                mean: sum / (count as f64 * freedom),
                expected: regular.iter().sum::<f64>() / regular.len() as f64,
                lower,
                upper,
                effective_epochs: self.raw.effective(),
            },
            credibility: self.credibility(),
            errors: (0..self.size()).map(|component| self.component(component)).collect(),
            innovations: (0..self.axis.channels.len())
                .map(|c| {
                    let bound = |kind| level(&|other| other == kind);
                    let kinds = [Kind::Autocorrelation(c), Kind::LowFrequency(c), Kind::CumulativePeriodogram(c)];
                    self.innovations(c, expected.innovations[c].nis, kinds.map(bound))
                })
                .collect(),
        }
    }

    fn credibility(&self) -> Option<Credibility> {
        let regular: Vec<usize> = (0..self.axis.epochs.len()).filter(|&i| self.axis.epochs[i].regular).collect();
        let logs = regular.iter().map(|&e| self.totals.value(self.axis.layout.epoch(e)) / self.runs());
        let mean_log = logs.sum::<f64>() / regular.len() as f64;
        let moments: Vec<Vec<f64>> = regular.iter().map(|&e| self.moments(e)).collect();
        credibility::credibility(mean_log, &moments, self.size(), self.runs() * self.raw.effective())
    }

    fn component(&self, component: usize) -> Component {
        let named = &self.axis.judge.components[component];
        let (mut mean, mut sigma, mut predicted) = (Vec::new(), Vec::new(), Vec::new());
        let mut within = [Vec::new(), Vec::new(), Vec::new()];
        for (e, epoch) in self.axis.epochs.iter().enumerate() {
            let (u, moments) = (self.mean(e), self.moments(e));
            let row = epoch.root.row(component);
            mean.push((0..=component).map(|j| row[j] * u[j]).sum());
            let mut square = 0.0;
            for i in 0..=component {
                for j in 0..=component {
                    let (high, low) = (i.max(j), i.min(j));
                    square += row[i] * row[j] * moments[high * (high + 1) / 2 + low];
                }
            }
            sigma.push(square.max(0.0).sqrt());
            predicted.push(epoch.sigma[component]);
            let counts = &self.totals.counts[self.axis.layout.within(e, component)..][..3];
            within.iter_mut().zip(counts).for_each(|(shares, count)| shares.push(*count as f64 / self.runs()));
        }
        Component {
            name: named.name.clone(),
            unit: named.unit.clone(),
            mean,
            rms: sigma,
            predicted_sigma: predicted,
            within_1_sigma: std::mem::take(&mut within[0]),
            within_2_sigma: std::mem::take(&mut within[1]),
            within_3_sigma: std::mem::take(&mut within[2]),
        }
    }

    /// `levels`: raw p-values at which autocorrelation, low-frequency power and cumulative periodogram are rejected.
    fn innovations(&self, c: usize, expected_nis: f64, levels: [f64; 3]) -> Innovations {
        let [autocorrelation, low_frequency, periodogram] = levels;
        let channel = &self.axis.channels[c];
        let powers = self.powers(c);
        let averages = powers.iter().zip(&channel.lengths).enumerate().map(|(i, (power, length))| {
            let freedom = self.runs() * channel.blocks_of(*length) as f64;
            let [lower, upper] = band(low_frequency, freedom);
            LowFrequency { averaging_s: self.averaging(c, i), ratio: power / freedom, lower, upper }
        });
        let ordinates = self.ordinates(c);
        let total: f64 = ordinates.iter().sum();
        let mut sum = 0.0;
        let share: Vec<f64> = ordinates
            .iter()
            .map(|power| {
                sum += power / total;
                sum
            })
            .collect();
        let span = channel.base as f64 * channel.blocks as f64 * self.interval(c);
        let place = self.axis.layout.histogram(c);
        let edges: Vec<f64> = (0..=NIS_BINS).map(|i| i as f64 * NIS_BIN).collect();
        Innovations {
            name: channel.name.clone(),
            updates: channel.updates * self.raw.runs,
            nis: self.squares(c) / self.updates(c),
            expected_nis,
            mean: self.innovation_mean(c),
            autocorrelation: self.lags(c).0,
            autocorrelation_bound: self.autocorrelation_bound(c, autocorrelation, 1),
            low_frequency: averages.collect(),
            cumulative_periodogram: Periodogram {
                frequency_hz: (1..=ordinates.len()).map(|j| j as f64 / span).collect(),
                share,
                half_width: if ordinates.is_empty() { f64::NAN } else { self.periodogram_bound(c, periodogram) },
            },
            nis_histogram: Histogram {
                observed: self.totals.counts[place..=place + NIS_BINS]
                    .iter()
                    .map(|count| *count as f64 / self.updates(c))
                    .collect(),
                expected: edges
                    .iter()
                    .zip(edges.iter().skip(1).chain([&f64::INFINITY]))
                    .map(|(low, high)| chi_square_cdf(*high, 1.0) - chi_square_cdf(*low, 1.0))
                    .collect(),
                edges,
            },
        }
    }
}

/// χ² bounds of a mean of `freedom` squares, each tail p/2.
fn band(p: f64, freedom: f64) -> [f64; 2] {
    [chi_square_quantile(0.5 * p, freedom) / freedom, chi_square_quantile(1.0 - 0.5 * p, freedom) / freedom]
}

/// Position of the lowest value.
fn lowest(values: impl Iterator<Item = f64>) -> usize {
    values.enumerate().min_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(i, _)| i)
}

/// The name in documents: with the measurement where there are several.
pub(super) fn test_name(axis: &AxisCourse, kind: Kind) -> String {
    match kind.channel().filter(|_| axis.channels.len() > 1) {
        Some(c) => format!("{kind} of {}", axis.channels[c].name),
        None => kind.to_string(),
    }
}

/// Raw p-values of an axis in the order of [`Kind::of`].
pub(super) fn raw_p_values(axis: &AxisCourse, totals: &Totals, runs: u64) -> Vec<f64> {
    let summary = Summary::new(axis, totals, runs);
    Kind::of(axis).into_iter().map(|kind| summary.raw_p(kind)).collect()
}

/// Tests, adjusted and judged, and curves of an axis.
pub(super) fn conclude(
    number: usize,
    axis: &AxisCourse,
    totals: &Totals,
    runs: u64,
    gate: &Gate,
) -> (AxisOutcome, Vec<Test>) {
    let summary = Summary::new(axis, totals, runs);
    let own = &gate.axes[number];
    let tests = own.kinds.iter().enumerate().map(|(i, kind)| {
        let mut test = summary.test(i, *kind, own, gate.critical);
        test.judge(gate.family(test.p_value), |test| test.p_value > gate.critical);
        test
    });
    (summary.outcome(own, gate.critical), tests.collect())
}
