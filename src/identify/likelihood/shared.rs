//! Whether the axes of a sensor have one correlation time: their likelihoods, each at its best but for that time,
//! side by side.

use std::convert::Infallible;

use schemars::JsonSchema;
use serde::Serialize;

use super::ordinates::Ordinates;
use super::whittle::{self, Fit};
use crate::noise::{Kind, Role};
use crate::numerics::distribution::{NORMAL_95, chi_square_sf};
use crate::numerics::optimize::{bisect, half_way, lowest};

/// The likelihood of one axis as a function of the correlation time of its only Gauss-Markov process.
#[derive(Clone, Debug)]
pub struct TimeProfile {
    data: Ordinates,
    fit: Fit,
    /// Which logarithm is that of the correlation time.
    index: usize,
}

/// One correlation time for all axes, held against one for each.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct SharedTime {
    /// The best common correlation time, s, with its 95 % interval; an open end is null.
    pub correlation_time_s: f64,
    pub lower_s: Option<f64>,
    pub upper_s: Option<f64>,
    /// 2 (Σ ln L of the axes − ln L with one time), χ² with one degree of freedom less than there are axes if the
    /// time is one.
    pub likelihood_ratio: f64,
    pub p_value: f64,
}

/// Share of the width at which the search ends, in ln of the time.
const CLOSE: f64 = 1e-4;
/// Limits are looked for up to this factor (ln) from the best time.
const FAR: f64 = 4.0;

impl TimeProfile {
    /// `None` for models without, or with several Gauss-Markov processes.
    pub(super) fn new(data: &Ordinates, fit: &Fit) -> Option<TimeProfile> {
        let times = fit.form.roles().into_iter().enumerate().filter(|(_, (piece, role))| {
            *role == Role::CorrelationTime && fit.form.pieces()[*piece].kind() == Kind::GaussMarkov
        });
        match times.map(|(index, _)| index).collect::<Vec<_>>()[..] {
            [index] => Some(TimeProfile { data: data.clone(), fit: fit.clone(), index }),
            _ => None,
        }
    }

    fn ln_time(&self) -> f64 {
        self.fit.logs[self.index]
    }

    /// Largest ln L at this ln of the correlation time.
    fn at(&self, ln_time: f64) -> f64 {
        let mut start = self.fit.logs.clone();
        start[self.index] = ln_time;
        let free: Vec<usize> = (0..start.len()).filter(|i| *i != self.index).collect();
        whittle::climb(&self.data, &self.fit.form, &start, &free).map_or(f64::NAN, |fit| fit.log_likelihood)
    }
}

/// `None` for fewer than two axes.
///
/// Likelihood-ratio test of nested models (Wilks 1938).
pub fn shared_time(axes: &[&TimeProfile]) -> Option<SharedTime> {
    use rayon::prelude::*;
    if axes.len() < 2 {
        return None;
    }
    let joint =
        |ln_time: f64| axes.par_iter().map(|axis| axis.at(ln_time)).collect::<Vec<_>>().into_iter().sum::<f64>();
    let times = || axes.iter().map(|axis| axis.ln_time());
    let (low, high) = (times().fold(f64::INFINITY, f64::min), times().fold(f64::NEG_INFINITY, f64::max));
    // the best common time is between those of the axes
    let best = lowest(|ln_time| -joint(ln_time), low, high, CLOSE);
    let top = joint(best);
    let apart: f64 = axes.iter().map(|axis| axis.at(axis.ln_time())).sum();
    let ratio = (2.0 * (apart - top)).max(0.0);
    let fallen = |ln_time: f64| 2.0 * (top - joint(ln_time)) > NORMAL_95 * NORMAL_95;
    let limit = |side: f64| {
        if !fallen(best + side * FAR) {
            return None;
        }
        let Ok((_, far)) = bisect(0.0, FAR, half_way(10.0 * CLOSE), |at| Ok::<_, Infallible>(fallen(best + side * at)));
        Some((best + side * far).exp())
    };
    Some(SharedTime {
        correlation_time_s: best.exp(),
        lower_s: limit(-1.0),
        upper_s: limit(1.0),
        likelihood_ratio: ratio,
        p_value: chi_square_sf(ratio, (axes.len() - 1) as f64),
    })
}
