//! The log as cosine coefficients, gathered in bins over which no spectrum changes much.

use crate::noise::Grid;
use crate::numerics::distribution::chi_square_sf;
use crate::signal::cosine::cosine_transform;

/// Coefficients up to this number stand alone.
const ALONE: usize = 32;
/// Relative width of a bin above.
const WIDTH: f64 = 1.0 / 40.0;
/// A line's surroundings are binned this finely: each bin is at most this share of its distance from the line.
const LINE_WIDTH: f64 = 0.25;
/// Chance of taking noise for a line, over all frequencies and widths of a log.
const FALSE_LINE: f64 = 1e-3;
/// Most lines that are looked for.
const LINES: usize = 12;

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

/// A peak in the spectrum.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Line {
    pub(super) frequency_hz: f64,
    /// Width of the window in which it stands out most, Hz.
    pub(super) width_hz: f64,
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
    pub(super) samples: usize,
    /// s.
    pub(super) dt: f64,
}

impl Ordinates {
    /// `x`: consecutive samples; `lines`: as found elsewhere, or looked for.
    pub(super) fn new(x: &[f64], dt: f64, lines: Option<&[Line]>) -> Ordinates {
        let n = x.len();
        let power: Vec<f64> = cosine_transform(x).iter().map(|c| c * dt.sqrt()).collect();
        let step = 1.0 / (2.0 * n as f64 * dt);
        let lines = match lines {
            Some(lines) => lines.to_vec(),
            None => find_lines(&power.iter().map(|c| c * c).collect::<Vec<_>>(), step),
        };
        let ramp: Vec<f64> = {
            let middle = (n as f64 - 1.0) / 2.0;
            let line: Vec<f64> = (0..n).map(|k| (k as f64 - middle) * dt).collect();
            cosine_transform(&line).iter().map(|c| c * dt.sqrt()).collect()
        };
        let bin = |(first, size): (usize, usize)| {
            let (own, own_ramp) = (&power[first..first + size], &ramp[first..first + size]);
            Bin {
                frequency_hz: middle(first, size) * step,
                count: size as f64,
                power: own.iter().map(|c| c * c).sum(),
                with_ramp: own.iter().zip(own_ramp).map(|(c, r)| c * r).sum(),
                ramp: own_ramp.iter().map(|r| r * r).sum(),
            }
        };
        let bins: Vec<Bin> = layout(power.len(), step, &lines).into_iter().map(bin).collect();
        let grid = Grid::new(bins.iter().map(|bin: &Bin| bin.frequency_hz).collect(), dt);
        Ordinates { bins, grid, lines, samples: n, dt }
    }

    /// What a log of so many samples would have before it is recorded: bins without power. `grid` is made of their frequencies.
    ///
    /// Coefficients of a ramp of slope 1: r_j = −√(2/n) dt cos(πj/2n)/(2 sin²(πj/2n)) for odd j, else 0 (summation by parts).
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
        Ordinates { bins, grid, lines: lines.to_vec(), samples, dt }
    }

    /// Around a frequency: where bins are at most twice as wide as there, and how wide they are there, Hz.
    pub(super) fn fine_around(&self, frequency_hz: f64) -> (f64, f64, f64) {
        let step = 1.0 / (2.0 * self.span_s());
        let at = self.bins.partition_point(|bin| bin.frequency_hz < frequency_hz).min(self.bins.len() - 1);
        let most = 2.0 * self.bins[at].count;
        let first = (0..at).rev().take_while(|i| self.bins[*i].count <= most).last().unwrap_or(at);
        let last = (at..self.bins.len()).take_while(|i| self.bins[*i].count <= most).last().unwrap_or(at);
        let (low, high) = (self.bins[first].frequency_hz, self.bins[last].frequency_hz);
        (low.min(frequency_hz), high.max(frequency_hz), self.bins[at].count * step)
    }

    /// Length of the log, s.
    pub(super) fn span_s(&self) -> f64 {
        self.samples as f64 * self.dt
    }
}

/// How many coefficients come before each bin, and how many are in it.
fn layout(coefficients: usize, step: f64, lines: &[Line]) -> Vec<(usize, usize)> {
    let mut bins = Vec::new();
    let mut first = 0;
    while first < coefficients {
        let size = width(first + 1, step, lines).min(coefficients - first);
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

/// Peaks that white noise shaped like the surroundings would show with probability 10⁻³ at most.
///
/// The level of the surroundings is the median over a band, which a narrow line does not move (the median of χ²₁ is 0.4549).
fn find_lines(power: &[f64], step: f64) -> Vec<Line> {
    const MEDIAN: f64 = 0.454_936_423_119_572_8;
    // below, drift has its own shapes
    const FIRST: usize = 256;
    const BAND: f64 = 0.1;
    let mut whitened = vec![1.0; power.len()];
    let mut first = FIRST;
    while first < power.len() {
        let size = ((first as f64 * BAND) as usize).max(128).min(power.len() - first);
        let around = first.saturating_sub(size / 2).max(FIRST / 2)..(first + size + size / 2).min(power.len());
        let mut sorted = power[around].to_vec();
        let middle = sorted.len() / 2;
        let (_, median, _) = sorted.select_nth_unstable_by(middle, f64::total_cmp);
        let level = *median / MEDIAN;
        for (w, p) in whitened[first..first + size].iter_mut().zip(&power[first..first + size]) {
            *w = if level > 0.0 { p / level } else { 1.0 };
        }
        first += size;
    }
    let mut sums = Vec::with_capacity(power.len() + 1);
    sums.push(0.0);
    whitened.iter().fold(0.0, |sum, w| {
        sums.push(sum + w);
        sum + w
    });
    let mut peaks: Vec<(f64, usize, usize)> = Vec::new();
    let mut size = 1;
    while size * 8 <= power.len() - FIRST.min(power.len()) {
        let tried = (power.len() / size).max(1) as f64 * 16.0;
        let mut at = FIRST.max(size * 8);
        while at + size <= power.len() {
            let sum = sums[at + size] - sums[at];
            // far beyond the threshold the tail underflows; the excess then ranks
            if sum > size as f64 + 4.0 * (2.0 * size as f64).sqrt()
                && chi_square_sf(sum, size as f64) < FALSE_LINE / tried
            {
                peaks.push(((sum - size as f64) / (2.0 * size as f64).sqrt(), at, size));
            }
            at += size.div_ceil(2);
        }
        size *= 2;
    }
    peaks.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut found: Vec<Line> = Vec::new();
    for (_, at, size) in peaks {
        let frequency_hz = (at as f64 + 1.0 + 0.5 * (size as f64 - 1.0)) * step;
        let width_hz = size as f64 * step;
        let near = |line: &Line| (line.frequency_hz - frequency_hz).abs() < 8.0 * (line.width_hz + width_hz);
        if found.len() < LINES && !found.iter().any(near) {
            found.push(Line { frequency_hz, width_hz });
        }
    }
    found
}
