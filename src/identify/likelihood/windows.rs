//! A log that is too long to be held at once: the likelihoods of its windows, multiplied.
//!
//! All windows have the same length, so their coefficients have the same frequencies and the same bins, and
//! ln L = Σ_w Σ_j −½ [ln 2πS(f_j)/dt + c²_wj dt/S(f_j)] needs of each bin only its count and its power over all windows (Whittle 1953; Bartlett
//! 1948 for the average of periodograms). Each window has its own mean; windows count as independent, and what is slower than a window is not seen.

use super::ordinates::Ordinates;
use super::{Candidates, FITTED_SHARE, Identified, IdentifyError, ModelChoice, Whole, choose, usable};
use crate::allan::{Deviation, Pooled, TauGrid, deviation};
use crate::units::Unit;

/// What is kept of the windows of one axis: a few hundred bins each.
#[derive(Clone, Debug)]
pub struct Windows {
    name: String,
    display: Unit,
    dt: f64,
    windows: Vec<Ordinates>,
    /// Σ of the means of the windows.
    level: f64,
    curve: Pooled,
}

impl Windows {
    /// For windows of so many samples of period `dt` (s); `display` is the unit of the log, in whose family results are written.
    pub fn new(name: &str, samples: usize, dt: f64, display: &Unit) -> Windows {
        let curve = Pooled::new(Deviation::Oadev, samples, dt, TauGrid::Log(super::POINTS_PER_DECADE));
        Windows { name: name.into(), display: display.clone(), dt, windows: Vec::new(), level: 0.0, curve }
    }

    /// Another window: rate samples, SI. Lines are looked for in the first. Fails on a window of another length, and as
    /// [`identify_axis`](crate::identify::identify_axis) does on samples that say nothing.
    pub fn add(&mut self, rate: &[f64]) -> Result<(), IdentifyError> {
        usable(&self.name, rate)?;
        self.curve
            .add(&deviation::phase(rate, self.dt))
            .map_err(|error| IdentifyError { message: format!("{}: {error}", self.name) })?;
        let lines = self.windows.first().map(|first| first.lines.clone());
        self.windows.push(Ordinates::new(rate, self.dt, lines.as_deref()));
        self.level += crate::numerics::reduce::mean(rate);
        Ok(())
    }

    /// Windows so far.
    pub fn len(&self) -> usize {
        self.windows.len()
    }

    pub fn is_empty(&self) -> bool {
        self.windows.is_empty()
    }

    /// Terms chosen, parameters and intervals as from a log held at once, but for the last step on the exact likelihood. What is held out is the
    /// last third of the windows. Fails without a window.
    pub fn identify(self, choice: &ModelChoice) -> Result<Identified, IdentifyError> {
        let Windows { name, display, dt, windows, level, curve } = self;
        let Some(data) = Ordinates::pooled(&windows) else {
            return Err(IdentifyError { message: format!("{name}: no window of the log is whole") });
        };
        let early = (windows.len() as f64 * FITTED_SHARE) as usize;
        let parts = || Some([Ordinates::pooled(&windows[..early])?, Ordinates::pooled(&windows[early..])?]);
        let whole = Whole {
            name: &name,
            samples: data.samples * windows.len(),
            level: level / windows.len() as f64,
            dt,
            display: &display,
            choice,
        };
        let found: Candidates = choose(data, choice, &parts, &[]);
        whole.identified(found, curve.curve())
    }
}
