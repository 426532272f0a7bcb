//! How far a feedback loop is from losing its stability.
//!
//! L is the loop broken at one command, the others closed, with the sign that makes 1 + L the return difference;
//! S = 1/(1 + L), T = 1 − S.
//!
//! - Gain margin: the factors next to one, above and below, at which −1/L is real; each is confirmed by eigenvalues.
//! - Phase and delay margin: at every |L| = 1 the phase that is left, and that phase over ω, the least of all.
//! - Disk margin (Seiler, Packard and Gahinet 2020, IEEE Control Systems 40(5)): α = 1/‖S + (σ − 1)/2‖∞ with the skew
//!   σ; for σ = 0 it is 1/‖(S − T)/2‖∞, and every gain in [(2 − α)/(2 + α), (2 + α)/(2 − α)] and every phase within
//!   ±2 atan(α/2) keeps the loop stable, also together.
//! - Multiloop disk margin: the same of all commands at once, α = 1/max μ((S − T)/2); for two commands the bound by
//!   diagonal scaling is exact (Packard and Doyle 1993, Automatica 29).

use std::f64::consts::{PI, TAU};

use nalgebra::{Complex, DMatrix};

use super::response::{Response, StateSpace, in_time};
use crate::numerics::linalg::eigenvalues;
use crate::numerics::optimize::{bisect, bracketed_root, lowest};
use crate::numerics::progress::checkpoint;

type C = Complex<f64>;

/// Points of the first grid in a decade of frequency; peaks and crossings are then found to rounding between them.
const PER_DECADE: f64 = 40.0;
/// A local peak of less than this share of the largest on the grid cannot be the peak: the grid sees each mode at its
/// own frequency and beside it.
const NEAR_PEAK: f64 = 0.8;
/// Between a gain limit and one, stability is looked at in so many places, so that no interval of it is overlooked.
const PROBES: u32 = 4;
/// Beyond this factor a gain is no margin of an actuator: 60 dB.
const LARGEST_FACTOR: f64 = 1000.0;

/// A factor on the loop and where it makes it oscillate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GainLimit {
    pub factor: f64,
    /// rad/s.
    pub frequency: f64,
}

impl GainLimit {
    pub fn decibels(&self) -> f64 {
        20.0 * self.factor.log10()
    }
}

/// Where |L| = 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crossover {
    /// What is left to −180 deg, rad, −π to π.
    pub phase: f64,
    /// rad/s.
    pub frequency: f64,
}

impl Crossover {
    /// Delay that brings the phase to −180 deg, s.
    pub fn delay(&self) -> f64 {
        self.phase.rem_euclid(TAU) / self.frequency
    }
}

/// A largest value over frequency.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Peak {
    pub value: f64,
    /// rad/s.
    pub frequency: f64,
}

/// Disk margin α with its frequency.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Disk {
    pub margin: f64,
    /// rad/s.
    pub frequency: f64,
    pub skew: f64,
}

impl Disk {
    fn of(peak: Peak, skew: f64) -> Disk {
        Disk { margin: 1.0 / peak.value, frequency: peak.frequency, skew }
    }

    /// Lower and upper gain that the disk holds, the upper infinite where the disk reaches beyond every gain.
    pub fn gains(&self) -> [f64; 2] {
        let (a, s) = (self.margin, self.skew);
        let below = 2.0 - a * (1.0 + s);
        let upper = if below > 0.0 { (2.0 + a * (1.0 - s)) / below } else { f64::INFINITY };
        [((2.0 - a * (1.0 - s)) / (2.0 + a * (1.0 + s))).max(0.0), upper]
    }

    /// Of skew 0: ± phase, rad.
    pub fn phase(&self) -> f64 {
        2.0 * (0.5 * self.margin).atan()
    }
}

/// Of one command.
#[derive(Clone, Debug, PartialEq)]
pub struct Margins {
    /// The next factor above one at which the loop is no longer stable; `None`: there is none.
    pub gain_up: Option<GainLimit>,
    /// The same below one, down to zero: a loop that needs its feedback.
    pub gain_down: Option<GainLimit>,
    /// By rising frequency.
    pub crossovers: Vec<Crossover>,
    pub disk: Disk,
    /// max |S|.
    pub sensitivity: Peak,
}

impl Margins {
    /// The crossover with the least phase.
    pub fn phase(&self) -> Option<Crossover> {
        self.crossovers.iter().copied().min_by(|a, b| a.phase.abs().total_cmp(&b.phase.abs()))
    }

    /// The least delay that makes the loop unstable, s; `None` without a crossover.
    pub fn delay(&self) -> Option<f64> {
        self.crossovers.iter().map(Crossover::delay).min_by(f64::total_cmp)
    }
}

/// Of all commands of a loop.
#[derive(Clone, Debug, PartialEq)]
pub struct LoopMargins {
    /// One per command.
    pub single: Vec<Margins>,
    /// All commands at once; that of the command where there is one.
    pub multiloop: Disk,
    /// max σ̄(S).
    pub sensitivity: Peak,
}

#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MarginError {
    /// Growing motions of the closed loop, 1/s.
    #[error("the closed loop is unstable: {}", shown(.poles))]
    Unstable { poles: Vec<(f64, f64)> },
    #[error("{found} commands: margins are those of one or two at once")]
    Commands { found: usize },
    #[error("the loop cannot be closed: 1 + L vanishes at every frequency")]
    Singular,
}

/// A loop that is looked at.
struct Looked<'a> {
    system: &'a StateSpace,
    response: Response,
    /// s, in series with every command; not a part of `system`.
    delay: f64,
}

/// Poles in 1/s.
fn shown(poles: &[(f64, f64)]) -> String {
    poles.iter().map(|(re, im)| format!("{re:.4} ± {im:.4}i 1/s")).collect::<Vec<_>>().join(", ")
}

/// Margins of L with `system` its state-space form (inputs: commands at the airplane, outputs: what the controller then
/// commands, with the sign of 1 + L), one or two commands, and a pure `delay` (s) in series.
///
/// Errors: the closed loop is unstable (a delay in series is not seen by that test), or another number of commands.
pub fn margins(system: &StateSpace, delay: f64, skew: f64) -> Result<LoopMargins, MarginError> {
    let m = system.inputs();
    if !(1..=2).contains(&m) || system.c.nrows() != m {
        return Err(MarginError::Commands { found: m });
    }
    let looked = Looked { system, response: system.response(), delay };
    let closed = looked.closed(None, 1.0).ok_or(MarginError::Singular)?;
    let poles = in_time(&eigenvalues(&closed), system.interval);
    if delay == 0.0 && poles.iter().any(|p| p.0 >= 0.0) {
        return Err(MarginError::Unstable { poles: poles.into_iter().filter(|p| p.0 >= 0.0 && p.1 >= 0.0).collect() });
    }
    let grid = looked.grid(&poles);
    let loops: Vec<DMatrix<C>> = grid.iter().map(|w| looked.at(*w)).collect();
    let single = (0..m).map(|i| looked.single(i, &grid, &loops, skew)).collect();
    let multiloop = looked.peak(&grid, &loops, |l| scaled_norm(&disk_matrix(l, skew)));
    let sensitivity = looked.peak(&grid, &loops, |l| largest_singular_value(&sensitivity(l)));
    Ok(LoopMargins { single, multiloop: Disk::of(multiloop, skew), sensitivity })
}

impl Looked<'_> {
    fn at(&self, omega: f64) -> DMatrix<C> {
        let turned = C::new(0.0, -omega * self.delay).exp();
        self.response.at(omega).map(|l| l * turned)
    }

    /// The closed loop with a factor on one command.
    fn closed(&self, command: Option<usize>, factor: f64) -> Option<DMatrix<f64>> {
        let m = self.system.inputs();
        let mut gain = -DMatrix::<f64>::identity(m, m);
        if let Some(i) = command {
            gain[(i, i)] = -factor;
        }
        self.system.closed(&gain)
    }

    fn stable(&self, command: usize, factor: f64) -> bool {
        checkpoint();
        let Some(closed) = self.closed(Some(command), factor) else { return false };
        let limit = |(re, im): &(f64, f64)| match self.system.interval {
            Some(_) => re.hypot(*im) < 1.0,
            None => *re < 0.0,
        };
        eigenvalues(&closed).iter().all(limit)
    }

    /// Frequencies over all modes of the open and the closed loop, close together where one is lightly damped, rad/s.
    fn grid(&self, closed: &[(f64, f64)]) -> Vec<f64> {
        let open = self.system.poles();
        let sizes = || open.iter().chain(closed).map(|p| p.0.hypot(p.1)).filter(|w| *w > 1e-9);
        let slowest = sizes().fold(f64::INFINITY, f64::min).clamp(1e-6, 1.0);
        let fastest = sizes().fold(1.0, f64::max);
        // two decades beyond the modes L is a power of ω; a discrete loop ends at half its rate
        let (low, high) = (1e-2 * slowest, self.system.interval.map_or(1e2 * fastest, |interval| PI / interval));
        let count = ((high / low).log10() * PER_DECADE).ceil().max(2.0) as u32;
        let mut grid: Vec<f64> =
            (0..=count).map(|i| low * (high / low).powf(f64::from(i) / f64::from(count))).collect();
        for (re, im) in open.iter().chain(closed).filter(|p| p.1 > 0.0) {
            let beside = [-2.0, -1.0, -0.5, -0.25, 0.0, 0.25, 0.5, 1.0, 2.0].map(|k: f64| im + k * re.abs());
            grid.extend(beside);
        }
        if self.delay > 0.0 {
            // a delay turns the phase for ever: a tenth of a radian at a time, over thirty turns
            grid.extend((1..2000).map(|i| 0.1 * f64::from(i) / self.delay));
        }
        grid.retain(|w| (low..=high).contains(w));
        if let Some(last) = grid.iter_mut().find(|w| **w == high) {
            *last = high;
        } else {
            grid.push(high);
        }
        grid.sort_by(f64::total_cmp);
        grid.dedup();
        grid
    }

    /// The largest value over frequency.
    fn peak(&self, grid: &[f64], loops: &[DMatrix<C>], of: impl Fn(&DMatrix<C>) -> f64) -> Peak {
        let values: Vec<f64> = loops.iter().map(&of).map(|v| if v.is_finite() { v } else { 0.0 }).collect();
        let largest = values.iter().copied().fold(0.0, f64::max);
        // where L is real and a real pole may be next: the start of the frequency axis, which no logarithm reaches
        let start = Some(of(&self.at(0.0))).filter(|value| value.is_finite());
        let mut best = Peak { value: start.unwrap_or(0.0), frequency: 0.0 };
        let mut take = |value: f64, frequency: f64| {
            if value > best.value {
                best = Peak { value, frequency };
            }
        };
        for i in 0..grid.len() {
            take(values[i], grid[i]);
            let (before, after) = (i.saturating_sub(1), (i + 1).min(grid.len() - 1));
            if values[i] < NEAR_PEAK * largest || values[i] < values[before] || values[i] < values[after] {
                continue;
            }
            let (low, high) = (grid[before].ln(), grid[after].ln());
            let at = lowest(|w| -of(&self.at(w.exp())), low, high, 1e-9).exp();
            take(of(&self.at(at)), at);
        }
        best
    }

    fn single(&self, command: usize, grid: &[f64], loops: &[DMatrix<C>], skew: f64) -> Margins {
        let l = |omega: f64| alone(&self.at(omega), command);
        let on_grid: Vec<C> = loops.iter().map(|all| alone(all, command)).collect();
        let disk = self.peak(grid, loops, |all| disk_matrix(&one(alone(all, command)), skew)[(0, 0)].norm());
        let sensitivity = self.peak(grid, loops, |all| (C::ONE / (C::ONE + alone(all, command))).norm());
        let mut limits: Vec<GainLimit> = Vec::new();
        let mut crossovers = Vec::new();
        let mut real = |l: C, frequency: f64| {
            if l.re < 0.0 && l.re.is_finite() {
                limits.push(GainLimit { factor: -1.0 / l.re, frequency });
            }
        };
        for (pair, w) in on_grid.windows(2).zip(grid.windows(2)) {
            let (a, b) = (pair[0], pair[1]);
            // crossings of the negative real axis; a leap through infinity has the other sign of its real parts
            if a.im * b.im < 0.0 && (a.re < 0.0 || b.re < 0.0) {
                let root = bracketed_root(|w| l(w).im, w[0], w[1], 0.0);
                if let Some(frequency) = root {
                    real(l(frequency), frequency);
                }
            }
            if (a.norm() - 1.0) * (b.norm() - 1.0) < 0.0 {
                let root = bracketed_root(|w| l(w).norm() - 1.0, w[0], w[1], 0.0);
                crossovers.extend(root.map(|frequency| Crossover { phase: (-l(frequency)).arg(), frequency }));
            }
        }
        // the ends of the frequency axis, where L of a real system is real
        real(l(0.0), 0.0);
        if let (Some(_), Some(last), Some(frequency)) = (self.system.interval, on_grid.last(), grid.last()) {
            real(*last, *frequency);
        }
        Margins {
            gain_up: self.limit(command, &limits, true),
            gain_down: self.limit(command, &limits, false),
            crossovers,
            disk: Disk::of(disk, skew),
            sensitivity,
        }
    }

    /// The limit next to one, above or below. Eigenvalues on both sides confirm it; where they find instability nearer
    /// to one than any crossing, the place is found by them.
    fn limit(&self, command: usize, crossings: &[GainLimit], above: bool) -> Option<GainLimit> {
        let mut candidates: Vec<GainLimit> = crossings
            .iter()
            .copied()
            .filter(|c| if above { c.factor > 1.0 } else { c.factor < 1.0 } && c.factor < LARGEST_FACTOR)
            .collect();
        candidates.sort_by(|a, b| a.factor.ln().abs().total_cmp(&b.factor.ln().abs()));
        if self.delay > 0.0 {
            return candidates.first().copied();
        }
        // to either side of a factor, away from one
        let beyond = |factor: f64| if above { factor * (1.0 + 1e-6) } else { factor * (1.0 - 1e-6) };
        let found = candidates.into_iter().find(|c| !self.stable(command, beyond(c.factor)));
        let end = found.map_or(if above { LARGEST_FACTOR } else { 1.0 / LARGEST_FACTOR }, |c| c.factor);
        let place = |i: u32| end.powf(f64::from(i) / f64::from(PROBES + 1));
        let mut inside = 1.0;
        for i in 1..=PROBES {
            let factor = place(i);
            if !self.stable(command, factor) {
                let close = |a: f64, b: f64| ((a / b).ln().abs() > 1e-10).then_some((a * b).sqrt());
                let unstable = |factor: f64| Ok::<_, ()>(!self.stable(command, factor));
                let (_, factor) = bisect(inside, factor, close, unstable).ok()?;
                return Some(GainLimit { factor, frequency: self.oscillation(command, factor) });
            }
            inside = factor;
        }
        found
    }

    /// Of the mode next to the limit of stability, rad/s.
    fn oscillation(&self, command: usize, factor: f64) -> f64 {
        let Some(closed) = self.closed(Some(command), factor) else { return f64::NAN };
        let poles = in_time(&eigenvalues(&closed), self.system.interval);
        poles.iter().max_by(|a, b| a.0.total_cmp(&b.0)).map_or(f64::NAN, |p| p.1.abs())
    }
}

fn one(l: C) -> DMatrix<C> {
    DMatrix::from_element(1, 1, l)
}

/// L of one command, the other closed: L_ii − L_ij (1 + L_jj)⁻¹ L_ji.
pub fn alone(l: &DMatrix<C>, command: usize) -> C {
    match l.nrows() {
        1 => l[(0, 0)],
        _ => {
            let other = 1 - command;
            l[(command, command)] - l[(command, other)] * l[(other, command)] / (C::ONE + l[(other, other)])
        }
    }
}

/// (I + L)⁻¹.
fn sensitivity(l: &DMatrix<C>) -> DMatrix<C> {
    if l.nrows() == 1 {
        return one(C::ONE / (C::ONE + l[(0, 0)]));
    }
    let [a, b, c, d] = [C::ONE + l[(0, 0)], l[(0, 1)], l[(1, 0)], C::ONE + l[(1, 1)]];
    let determinant = a * d - b * c;
    DMatrix::from_row_slice(2, 2, &[d, -b, -c, a]).map(|x| x / determinant)
}

/// S + (σ − 1)/2.
fn disk_matrix(l: &DMatrix<C>, skew: f64) -> DMatrix<C> {
    let mut s = sensitivity(l);
    for i in 0..s.nrows() {
        s[(i, i)] += 0.5 * (skew - 1.0);
    }
    s
}

/// σ̄ of one or two rows: σ̄² = (f + √(f² − 4|det|²))/2 with f the sum of squares.
fn largest_singular_value(m: &DMatrix<C>) -> f64 {
    of_squares(m, m.iter().map(|x| x.norm_sqr()).sum())
}

/// The least σ̄ of D M D⁻¹ over diagonal D: with d² = |m21|/|m12| both off-diagonal entries have the same size and the
/// sum of squares is least; the determinant is that of M.
fn scaled_norm(m: &DMatrix<C>) -> f64 {
    match m.nrows() {
        1 => m[(0, 0)].norm(),
        _ => {
            let squares = m[(0, 0)].norm_sqr() + m[(1, 1)].norm_sqr() + 2.0 * (m[(0, 1)] * m[(1, 0)]).norm();
            of_squares(m, squares)
        }
    }
}

fn of_squares(m: &DMatrix<C>, squares: f64) -> f64 {
    let determinant = if m.nrows() == 1 { C::ZERO } else { m[(0, 0)] * m[(1, 1)] - m[(0, 1)] * m[(1, 0)] };
    (0.5 * (squares + (squares * squares - 4.0 * determinant.norm_sqr()).max(0.0).sqrt())).sqrt()
}
