//! A log that is too long to be held at once: the likelihoods of its windows, multiplied.
//!
//! All windows have the same length, so their coefficients have the same frequencies and the same bins, and ln L =
//! Σ_w Σ_j −½ [ln 2πS(f_j)/dt + c²_wj dt/S(f_j)] needs of each bin only its count and its power over all windows
//! (Whittle 1953; Bartlett 1948 for the average of periodograms). Each window has its own mean; windows count as
//! independent, and what is slower than a window is not seen.

use super::super::tails::{MOST_SEGMENTS, SEGMENT};
use super::hold::Hold;
use super::ordinates::Ordinates;
use super::{Candidates, FITTED_SHARE, Identified, IdentifyError, ModelChoice, Whole, choose, usable};
use crate::allan::{Deviation, Pooled, TauGrid, deviation};
use crate::units::Unit;

/// Groups of windows that are held apart at most, at least half of it once there are as many.
const GROUPS: usize = 96;

/// What is kept of the windows of one axis: groups of as many neighbours each, a few hundred bins a group, however
/// many windows there are.
#[derive(Clone, Debug)]
pub struct Windows {
    name: String,
    display: Unit,
    dt: f64,
    groups: Vec<Ordinates>,
    /// Windows of the last group, of a full group, and of all.
    begun: usize,
    size: usize,
    count: usize,
    /// Σ of the means of the windows.
    level: f64,
    curve: Pooled,
    /// The beginnings of some windows, from one in so many, for the kurtosis.
    beginnings: Vec<Vec<f64>>,
    every: usize,
}

impl Windows {
    /// For windows of so many samples of period `dt` (s); `display` is the unit of the log, in whose family results
    /// are written.
    pub fn new(name: &str, samples: usize, dt: f64, display: &Unit) -> Windows {
        let curve = Pooled::new(Deviation::Oadev, samples, dt, TauGrid::Log(super::POINTS_PER_DECADE));
        Windows {
            name: name.into(),
            display: display.clone(),
            dt,
            groups: Vec::new(),
            begun: 0,
            size: 1,
            count: 0,
            level: 0.0,
            curve,
            beginnings: Vec::new(),
            every: 1,
        }
    }

    /// Another window: rate samples, SI. Lines are looked for in the first. Fails on a window of another length, and as
    /// [`identify_axis`](crate::identify::identify_axis) does on samples that say nothing.
    pub fn add(&mut self, rate: &[f64]) -> Result<(), IdentifyError> {
        usable(&self.name, rate)?;
        self.curve
            .add(&deviation::phase(rate, self.dt))
            .map_err(|error| IdentifyError { message: format!("{}: {error}", self.name) })?;
        let lines = self.groups.first().map(|first| first.lines.clone());
        let window = Ordinates::new(rate, self.dt, lines.as_deref());
        match self.groups.last_mut() {
            Some(last) if self.begun < self.size => last.add(&window),
            _ => {
                if self.groups.len() == GROUPS {
                    self.groups = self.groups.chunks(2).filter_map(Ordinates::pooled).collect();
                    self.size *= 2;
                }
                self.groups.push(window);
                self.begun = 0;
            }
        }
        self.begun += 1;
        if self.count.is_multiple_of(self.every) {
            if self.beginnings.len() == MOST_SEGMENTS {
                let mut number = 0..;
                self.beginnings.retain(|_| number.next().is_some_and(|i: usize| i.is_multiple_of(2)));
                self.every *= 2;
            }
            self.beginnings.push(rate[..rate.len().min(SEGMENT)].to_vec());
        }
        self.count += 1;
        self.level += crate::numerics::reduce::mean(rate);
        Ok(())
    }

    /// Windows so far.
    pub fn len(&self) -> usize {
        self.count
    }

    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// Terms chosen, parameters and intervals as from a log held at once, but for the last step on the exact
    /// likelihood. What is held out is the last third of the groups. Fails without a window.
    pub fn identify(self, choice: &ModelChoice, holds: &[Hold]) -> Result<Identified, IdentifyError> {
        let Windows { name, display, dt, groups, count, level, curve, beginnings, .. } = self;
        let Some(data) = Ordinates::pooled(&groups) else {
            return Err(IdentifyError { message: format!("{name}: no window of the log is whole") });
        };
        let early = (groups.len() as f64 * FITTED_SHARE) as usize;
        let parts = || Some([Ordinates::pooled(&groups[..early])?, Ordinates::pooled(&groups[early..])?]);
        let whole = Whole {
            name: &name,
            samples: data.samples * count,
            level: level / count as f64,
            dt,
            display: &display,
            choice,
        };
        let found: Candidates = choose(data, choice, &parts, &[]).holding(holds, &name, &display, &[])?;
        let beginnings: Vec<&[f64]> = beginnings.iter().map(|own| &own[..]).collect();
        Ok(whole.identified(found, curve.curve())?.with_tails(&beginnings, dt))
    }
}
