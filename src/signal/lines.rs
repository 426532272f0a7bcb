//! Narrow peaks that stand out of the spectrum of a log.

use rayon::prelude::*;

use crate::numerics::distribution::{CHI_SQUARE_1_MEDIAN, chi_square_sf};

/// Chance of taking noise for a line, over all frequencies and widths of a log.
const FALSE_LINE: f64 = 1e-3;
/// Most lines that are looked for.
const LINES: usize = 12;

/// A peak in the spectrum.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    pub frequency_hz: f64,
    /// Width of the window in which it stands out most, Hz.
    pub width_hz: f64,
}

/// Peaks that white noise shaped like the surroundings would show with probability 10⁻³ at most, strongest first.
///
/// `power`: squares of the cosine coefficients 1, 2, …, in any unit; `step`: their distance in Hz, 1/(2 n dt);
/// `dof`: degrees of freedom that each adds to a sum, below 1 where a taper ties neighbours together. Looked for
/// above number 256. The level of the surroundings is the median over a band, which a narrow line does not move (the
/// median of χ²₁ is 0.4549).
pub fn find_lines(power: &[f64], step: f64, dof: f64) -> Vec<Line> {
    // below, drift has its own shapes
    const FIRST: usize = 256;
    const BAND: f64 = 0.1;
    let mut bands = Vec::new();
    let mut first = FIRST;
    while first < power.len() {
        let size = ((first as f64 * BAND) as usize).max(128).min(power.len() - first);
        bands.push((first, size));
        first += size;
    }
    let level = |&(first, size): &(usize, usize)| {
        let around = first.saturating_sub(size / 2).max(FIRST / 2)..(first + size + size / 2).min(power.len());
        let mut sorted = power[around].to_vec();
        let middle = sorted.len() / 2;
        let (_, median, _) = sorted.select_nth_unstable_by(middle, f64::total_cmp);
        *median / CHI_SQUARE_1_MEDIAN
    };
    let levels: Vec<f64> = bands.par_iter().map(level).collect();
    // of the power over the level of its surroundings
    let mut sums = Vec::with_capacity(power.len() + 1);
    sums.push(0.0);
    let mut sum = 0.0;
    let mut add = |whitened: f64| {
        sum += whitened;
        sums.push(sum);
    };
    (0..FIRST.min(power.len())).for_each(|_| add(1.0));
    for ((first, size), level) in bands.into_iter().zip(levels) {
        power[first..first + size].iter().for_each(|p| add(if level > 0.0 { p / level } else { 1.0 }));
    }
    let of_size = |size: usize| {
        let tried = (power.len() / size).max(1) as f64 * 16.0;
        let count = size as f64;
        let enough = count + 4.0 * (2.0 * count).sqrt();
        let stands_out = |at: usize| {
            let sum = sums[at + size] - sums[at];
            // far beyond the threshold the tail underflows; the excess then ranks
            let line = sum > enough && chi_square_sf(dof * sum, dof * count) < FALSE_LINE / tried;
            line.then(|| ((sum - count) / (2.0 * count).sqrt(), at, size))
        };
        let places = (FIRST.max(size * 8)..(power.len() + 1).saturating_sub(size)).step_by(size.div_ceil(2));
        places.filter_map(stands_out).collect::<Vec<(f64, usize, usize)>>()
    };
    let largest = (power.len() - FIRST.min(power.len())) / 8;
    let sizes = std::iter::successors(Some(1), |size| Some(2 * size)).take_while(|size| *size <= largest);
    let mut peaks: Vec<(f64, usize, usize)> =
        sizes.collect::<Vec<usize>>().into_par_iter().flat_map_iter(of_size).collect();
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
