//! The log as cosine coefficients, gathered in bins over which no spectrum changes much.

use rayon::prelude::*;

use crate::noise::Grid;
use crate::signal::cosine::cosine_transform;
use crate::signal::fourier::Roots;
use crate::signal::lines::{Line, find_lines};

/// Coefficients up to this number stand alone.
const ALONE: usize = 32;
/// Relative width of a bin above.
const WIDTH: f64 = 1.0 / 40.0;
/// At most this share of the distance to half the sample rate.
const NYQUIST_WIDTH: f64 = 0.2;
/// A log with more of its power than this at one frequency is a sinusoid.
const TONE: f64 = 0.98;
/// A bin is halved while its halves, or its middle and its ends, differ in power by more than this in ln, and by
/// more than so many standard deviations.
const LEVEL: f64 = 0.1;
const SURE: f64 = 2.0;
/// Share of the power within [`ALONE`] coefficients of the largest, in a log that is mostly a tone.
const LOUD: f64 = 0.5;
/// A line's surroundings are binned this finely: each bin is at most this share of its distance from the line.
const LINE_WIDTH: f64 = 0.25;

/// Neighbouring coefficients.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Bin {
    /// Their middle, Hz.
    pub(super) frequency_hz: f64,
    pub(super) count: f64,
    /// dt Σ c².
    pub(super) power: f64,
    /// dt Σ c r, r the coefficients of a ramp of slope 1.
    pub(super) with_ramp: f64,
    /// dt Σ r².
    pub(super) ramp: f64,
}

impl Bin {
    /// dt Σ (c − slope r)².
    pub(super) fn left(&self, slope: f64) -> f64 {
        self.power - slope * (2.0 * self.with_ramp - slope * self.ramp)
    }
}

#[derive(Clone, Debug)]
pub(super) struct Ordinates {
    pub(super) bins: Vec<Bin>,
    /// Their frequencies.
    pub(super) grid: Grid,
    pub(super) lines: Vec<Line>,
    /// Of the log, or of each of its windows.
    pub(super) samples: usize,
    pub(super) windows: f64,
    /// s.
    pub(super) dt: f64,
}

impl Ordinates {
    /// `x`: consecutive samples; `lines`: as found elsewhere, or looked for.
    pub(super) fn new(x: &[f64], dt: f64, lines: Option<&[Line]>) -> Ordinates {
        let coefficients = coefficients(x, dt);
        let step = step(&coefficients, dt);
        let lines = lines.map_or_else(|| find_lines(&squares(&coefficients), step, 1.0), <[Line]>::to_vec);
        let layout = layout(coefficients.len(), step, &lines);
        Ordinates::gathered(&coefficients, dt, layout, lines)
    }

    /// Stretches of one length, with the lines that stand out of any of them, in bins as fine as all together ask
    /// for; `None` of none.
    pub(super) fn of_several(rates: &[&[f64]], dt: f64) -> Option<Ordinates> {
        let each: Vec<Vec<f64>> = rates.par_iter().map(|rate| coefficients(rate, dt)).collect();
        let step = step(each.first()?, dt);
        let mut lines: Vec<Line> = each.par_iter().flat_map(|own| find_lines(&squares(own), step, 1.0)).collect();
        lines.sort_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz));
        if each.len() > 1 {
            lines.dedup_by(|b, a| b.frequency_hz - a.frequency_hz < a.width_hz.max(b.width_hz));
        }
        let (first, others) = each.split_first()?;
        let mut power = squares(first);
        others.iter().for_each(|own| power.iter_mut().zip(own).for_each(|(sum, c)| *sum += c * c));
        let layout = halved(&power, each.len(), layout(power.len(), step, &lines));
        let gathered = |own: &Vec<f64>| Ordinates::gathered(own, dt, layout.clone(), lines.clone());
        Ordinates::pooled(&each.par_iter().map(gathered).collect::<Vec<_>>())
    }

    /// Coefficients of a ramp of slope 1: r_j = −√(2/n) dt cos(πj/2n)/(2 sin²(πj/2n)) for odd j, else 0 (summation
    /// by parts).
    fn gathered(coefficients: &[f64], dt: f64, layout: Layout, lines: Vec<Line>) -> Ordinates {
        let n = coefficients.len() + 1;
        let (root, step) = (dt.sqrt(), step(coefficients, dt));
        let angles = Roots::new(4 * n);
        let scale = -root * dt * (2.0 / n as f64).sqrt();
        let bin = |(first, size): (usize, usize)| {
            let own = &coefficients[first..first + size];
            let (mut with_ramp, mut ramp) = (0.0, 0.0);
            // the numbers first + 1, …; even ones have none of a ramp
            let skipped = first % 2;
            angles.walk(first + 1 + skipped, 2, (size - skipped).div_ceil(2), |i, angle| {
                let r = scale * angle.re / (2.0 * angle.im * angle.im);
                with_ramp += own[skipped + 2 * i] * r;
                ramp += r * r;
            });
            let power = own.iter().map(|c| c * c).sum();
            Bin { frequency_hz: middle(first, size) * step, count: size as f64, power, with_ramp, ramp }
        };
        let bins: Vec<Bin> = layout.into_par_iter().map(bin).collect();
        let grid = Grid::new(bins.iter().map(|bin: &Bin| bin.frequency_hz).collect(), dt);
        Ordinates { bins, grid, lines, samples: n, windows: 1.0, dt }
    }

    /// Windows of the same length and lines taken together; `None` of none.
    pub(super) fn pooled(windows: &[Ordinates]) -> Option<Ordinates> {
        let (first, others) = windows.split_first()?;
        let mut all = first.clone();
        others.iter().for_each(|other| all.add(other));
        Some(all)
    }

    /// Takes in windows of the same length and lines.
    pub(super) fn add(&mut self, other: &Ordinates) {
        self.windows += other.windows;
        for (bin, own) in self.bins.iter_mut().zip(&other.bins) {
            bin.count += own.count;
            bin.power += own.power;
            bin.with_ramp += own.with_ramp;
            bin.ramp += own.ramp;
        }
    }

    /// As if so many more windows, or parts of one, had been seen in which every coefficient is just what `spectrum`
    /// expects of it.
    pub(super) fn pretend(&mut self, windows: f64, spectrum: &[f64]) {
        for (bin, s) in self.bins.iter_mut().zip(spectrum) {
            bin.power += windows * bin.count * s;
            bin.count *= 1.0 + windows;
        }
        self.windows += windows;
    }

    /// What a log of so many samples would have before it is recorded: bins without power. `grid` is made of their
    /// frequencies.
    pub(super) fn expected(samples: usize, dt: f64, lines: &[Line], grid: impl Fn(&[f64]) -> Grid) -> Ordinates {
        let step = 1.0 / (2.0 * samples as f64 * dt);
        let bin = |(first, size): (usize, usize)| {
            let number = middle(first, size);
            let (sin, cos) = (std::f64::consts::FRAC_PI_2 * number / samples as f64).sin_cos();
            // numbers from first + 1 to first + size
            let odd = (first + size).div_ceil(2) - first.div_ceil(2);
            let ramp = odd as f64 * dt.powi(3) * (2.0 / samples as f64) * (cos / (2.0 * sin * sin)).powi(2);
            Bin { frequency_hz: number * step, count: size as f64, power: 0.0, with_ramp: 0.0, ramp }
        };
        let bins: Vec<Bin> = layout(samples.saturating_sub(1), step, lines).into_iter().map(bin).collect();
        let grid = grid(&bins.iter().map(|bin| bin.frequency_hz).collect::<Vec<f64>>());
        Ordinates { bins, grid, lines: lines.to_vec(), samples, windows: 1.0, dt }
    }

    /// Around a frequency: where bins are at most twice as wide as there, and how wide they are there, Hz.
    pub(super) fn fine_around(&self, frequency_hz: f64) -> (f64, f64, f64) {
        let step = 1.0 / (2.0 * self.span_s());
        let at = self.bins.partition_point(|bin| bin.frequency_hz < frequency_hz).min(self.bins.len() - 1);
        let most = 2.0 * self.bins[at].count;
        let first = (0..at).rev().take_while(|i| self.bins[*i].count <= most).last().unwrap_or(at);
        let last = (at..self.bins.len()).take_while(|i| self.bins[*i].count <= most).last().unwrap_or(at);
        let (low, high) = (self.bins[first].frequency_hz, self.bins[last].frequency_hz);
        (low.min(frequency_hz), high.max(frequency_hz), self.bins[at].count / self.windows * step)
    }

    /// Of a log that is a sinusoid: the frequency with most power among those above the coefficients that stand
    /// alone, and the share of all power there, within 32 coefficients, beyond which a sinusoid has less than 1 % of
    /// its own.
    pub(super) fn tone(&self) -> Option<(f64, f64)> {
        let step = 1.0 / (2.0 * self.span_s());
        let density = |bin: &&Bin| bin.power / bin.count;
        let top = self.bins.iter().max_by(|a, b| density(a).total_cmp(&density(b)))?.frequency_hz;
        // drift has most of its power in the lowest
        if top <= ALONE as f64 * step {
            return None;
        }
        let near = |bin: &&Bin| (bin.frequency_hz - top).abs() <= ALONE as f64 * step + 0.5 * bin.count * step;
        let all: f64 = self.bins.iter().map(|bin| bin.power).sum();
        let own =
            self.bins.iter().filter(near).fold((0.0, 0.0), |(p, f), b| (p + b.power, f + b.power * b.frequency_hz));
        Some((own.1 / own.0, own.0 / all)).filter(|(_, share)| *share > TONE)
    }

    /// Length of the log, or of each of its windows, s.
    pub(super) fn span_s(&self) -> f64 {
        self.samples as f64 * self.dt
    }

    /// Length of all windows, s.
    pub(super) fn total_s(&self) -> f64 {
        self.windows * self.span_s()
    }
}

/// How many coefficients come before each bin, and how many are in it.
type Layout = Vec<(usize, usize)>;

/// Cosine coefficients 1, 2 … of consecutive samples, times √dt.
fn coefficients(x: &[f64], dt: f64) -> Vec<f64> {
    let mut all = cosine_transform(x);
    let root = dt.sqrt();
    all.iter_mut().for_each(|c| *c *= root);
    all
}

fn squares(coefficients: &[f64]) -> Vec<f64> {
    coefficients.iter().map(|c| c * c).collect()
}

/// Hz between coefficients.
fn step(coefficients: &[f64], dt: f64) -> f64 {
    1.0 / (2.0 * (coefficients.len() + 1) as f64 * dt)
}

/// The bins, halved where the spectrum changes within them: at the zeros of an average, on the skirts of a filter.
/// Not those about lines, which are fine enough, and none beside a tone that is most of the log: the skirts that it
/// has are of the ends of the log, and no process. `power`: of each coefficient, of so many logs together.
fn halved(power: &[f64], logs: usize, layout: Layout) -> Layout {
    let all: f64 = power.iter().sum();
    let peak = (0..power.len()).max_by(|i, j| power[*i].total_cmp(&power[*j])).unwrap_or(0);
    let near = peak.saturating_sub(ALONE)..(peak + ALONE).min(power.len());
    if peak > ALONE && power[near].iter().sum::<f64>() > LOUD * all {
        return layout;
    }
    let mut done = Layout::new();
    for (first, size) in layout {
        if size < width(first + 1, 1.0, &[]) {
            done.push((first, size));
            continue;
        }
        let mut left = vec![(first, size)];
        while let Some((first, size)) = left.pop() {
            let quarter = size / 4;
            let of = |part: usize| power[first + part * quarter..first + (part + 1) * quarter].iter().sum::<f64>();
            let [a, b, c, d] = [0, 1, 2, 3].map(of);
            // each side has 2 · quarter coefficients of every log, the logarithm of its power a variance of
            // 1/(quarter · logs)
            let limit = LEVEL.max(SURE * (2.0 / (quarter * logs) as f64).sqrt());
            let far = |ratio: f64| ratio.ln().abs() > limit;
            if quarter > 1 && (far((a + b) / (c + d)) || far((a + d) / (b + c))) {
                let half = size / 2;
                left.extend([(first + half, size - half), (first, half)]);
            } else {
                done.push((first, size));
            }
        }
    }
    done
}

fn layout(coefficients: usize, step: f64, lines: &[Line]) -> Layout {
    let mut bins = Vec::new();
    let mut first = 0;
    while first < coefficients {
        // a filter may have a zero at half the sample rate
        let before_nyquist = ((coefficients - first) as f64 * NYQUIST_WIDTH) as usize;
        let size = width(first + 1, step, lines).min(before_nyquist.max(1)).min(coefficients - first);
        bins.push((first, size));
        first += size;
    }
    bins
}

/// Mean number of the coefficients in a bin.
fn middle(first: usize, size: usize) -> f64 {
    first as f64 + 1.0 + 0.5 * (size as f64 - 1.0)
}

/// Coefficients in the bin that begins with number `j`.
fn width(j: usize, step: f64, lines: &[Line]) -> usize {
    if j <= ALONE {
        return 1;
    }
    let mut size = j as f64 * WIDTH;
    for line in lines {
        let distance = (j as f64 - line.frequency_hz / step).abs();
        size = size.min((LINE_WIDTH * distance).max(0.1 * line.width_hz / step));
    }
    (size as usize).max(1)
}
