//! Whether the noise is the same all along the log, or its end tells what follows better than all of it.
//!
//! What is known of the future of a sensor is how well its past told what came then. The last third of the log is
//! held against the samples before it: the parameters of all of them, and those of their last 7/8, 6/8 … 2/8, each
//! at the maximum of its own likelihood (forecasts from rolling windows of the past: Giacomini & White 2006). In
//! noise that stays the same, all of them tell most. Parameters from elsewhere then lose about ½ χ²_p (1 + length of
//! the last third/length of the part) against the best that the last third can have, p their number: so much is what
//! a part could gain at the most, and more than p + 10 is beyond chance.

use rayon::prelude::*;

use super::ordinates::Ordinates;
use super::{FITTED_SHARE, Fitted, whittle};

/// A part may begin at each of so many equal steps …
const STEPS: usize = 8;
/// … but must have at least so many of them.
const SHORTEST: usize = 2;
/// Gain in ln L beyond one for every parameter.
const BEYOND_CHANCE: f64 = 10.0;

/// The end of a log whose noise changes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Recent {
    /// Its first sample.
    pub start: usize,
    /// ln L of the last third of the log under the parameters of the part before it, less that under those of
    /// everything before it.
    pub gain: f64,
    /// Samples of that part.
    pub part: usize,
    /// Samples before the last third.
    pub before: usize,
}

/// The part of the log (SI, contiguous, finite; `dt` in s) at its end whose parameters should tell best what
/// follows, where that is not all of it.
///
/// The same share of the whole log as that of the first two thirds which told the last third best. A short part
/// knows little of slow drift, whatever it gains: who takes it should compare.
///
/// `fitted`: the model as [`identify_logs`](crate::identify::identify_logs) found it in all of the log.
pub fn recent(rate: &[f64], dt: f64, fitted: &Fitted) -> Option<Recent> {
    let fit = &fitted.fit;
    let before = (rate.len() as f64 * FITTED_SHARE) as usize;
    let lines = &fitted.lines;
    let late = Ordinates::new(&rate[before..], dt, Some(lines));
    // that a tone goes on is no matter of noise that changes
    late.tone().is_none().then_some(())?;
    // one after the other: a transform takes three times the memory of its samples, and has all threads anyway
    let part = |step: usize| (step, Ordinates::new(&rate[before * step / STEPS..before], dt, Some(lines)));
    let parts: Vec<(usize, Ordinates)> = (0..=STEPS - SHORTEST).map(part).collect();
    let told = |(step, early): &(usize, Ordinates)| {
        let seen = whittle::climb_all(early, &fit.form, &fit.logs)?;
        Some((*step, whittle::log_likelihood(&late, &fit.form, &seen.logs)))
    };
    let found: Vec<(usize, f64)> = parts.par_iter().filter_map(told).collect();
    let (first, others) = found.split_first().filter(|((step, _), _)| *step == 0)?;
    let (step, best) = others.iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
    let gain = best - first.1;
    let recent = Recent { start: rate.len() * step / STEPS, gain, part: before - before * step / STEPS, before };
    (gain > BEYOND_CHANCE + fit.form.parameters() as f64).then_some(recent)
}
