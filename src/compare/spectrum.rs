//! The log's spectrum over the model's, coefficient by coefficient and in bands.

use rayon::prelude::*;
use schemars::JsonSchema;
use serde::Serialize;

use super::curve::{farthest, normal_score};
use crate::consistency::effect::{PERIODOGRAM_TOLERANCE, VARIANCE_RATIO_TOLERANCE};
use crate::consistency::spectrum::departure;
use crate::consistency::whiteness::kolmogorov_quantile;
use crate::consistency::{Effect, Test, TestKind};
use crate::noise::{Grid, NoiseModel, Term};
use crate::numerics::distribution::{chi_square_quantile, normal_quantile, normal_sf};
use crate::signal::cosine::cosine_transform;
use crate::units::digits;

/// Coefficients in the lowest bands.
const FEWEST: usize = 8;
/// Width of a band over its lower end, further up.
const WIDTH: f64 = 0.5;

/// Spectrum of the log over that of the model, in one band.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Band {
    pub from_hz: f64,
    pub to_hz: f64,
    /// Degrees of freedom of the ratio.
    pub dof: f64,
    pub ratio: f64,
    /// For all bands together: under the model every ratio is between these with probability 1 − alpha.
    pub lower: f64,
    pub upper: f64,
}

/// u_j = P_j/S_j: power of the cosine coefficients over the sampled spectrum of the model.
#[derive(Clone, Debug)]
pub(super) struct Ratios {
    /// Numbers `first`, `first` + 1, …
    pub(super) values: Vec<f64>,
    pub(super) first: usize,
    /// Hz between coefficients, 1/(2 n dt).
    pub(super) step_hz: f64,
    /// Degrees of freedom of each; 1 but for a tapered log.
    pub(super) dof: f64,
}

impl Ratios {
    /// Of segments of one length, tapered, together: those of one frequency one after the other, about it, as if the
    /// step were so many times finer. Each coefficient is what it would be of a segment alone.
    pub(super) fn of_segments(segments: &[Vec<f64>], dt: f64, model: &NoiseModel, from_hz: f64) -> Ratios {
        let each: Vec<Ratios> = segments.par_iter().map(|part| Ratios::new(part, dt, model, from_hz)).collect();
        let Some(Ratios { first, step_hz, values, .. }) = each.first() else {
            return Ratios { values: Vec::new(), first: 1, step_hz: f64::NAN, dof: 1.0 };
        };
        let count = each.len();
        Ratios {
            values: (0..values.len()).flat_map(|j| each.iter().map(move |own| own.values[j])).collect(),
            first: first * count - (count - 1) / 2,
            step_hz: step_hz / count as f64,
            dof: 1.0,
        }
    }

    /// From the lowest coefficient at or above `from_hz`. A ramp in the model is taken off the log.
    pub(super) fn new(rate: &[f64], dt: f64, model: &NoiseModel, from_hz: f64) -> Ratios {
        let step_hz = 1.0 / (2.0 * rate.len() as f64 * dt);
        let first = ((from_hz / step_hz).ceil() as usize).max(1);
        let slope: f64 = model.terms.iter().map(|t| if let Term::RateRamp { slope } = t { *slope } else { 0.0 }).sum();
        let coefficients = if slope == 0.0 {
            cosine_transform(rate)
        } else {
            let level: Vec<f64> = rate.iter().enumerate().map(|(k, x)| x - slope * k as f64 * dt).collect();
            cosine_transform(&level)
        };
        let used = coefficients.get(first - 1..).unwrap_or_default();
        let grid = Grid::new((first..first + used.len()).map(|j| j as f64 * step_hz).collect(), dt);
        let mut spectrum = vec![0.0; used.len()];
        for term in &model.terms {
            spectrum.iter_mut().zip(term.psd_on(&grid)).for_each(|(sum, s)| *sum += s);
        }
        let values = used.iter().zip(&spectrum).map(|(c, s)| dt * c * c / s).collect();
        Ratios { values, first, step_hz, dof: 1.0 }
    }

    /// Bands of half an octave and more, and their normal scores; bounds for all together at level alpha.
    pub(super) fn bands(&self, alpha: f64) -> (Vec<Band>, Vec<f64>, f64) {
        let mut ends = Vec::new();
        let mut at = 0;
        while at < self.values.len() {
            let size = (((self.first + at) as f64 * WIDTH) as usize).max(FEWEST);
            at = if at + size + size / 2 >= self.values.len() { self.values.len() } else { at + size };
            ends.push(at);
        }
        let level = -((-alpha).ln_1p() / ends.len() as f64).exp_m1();
        let bound = normal_quantile(1.0 - 0.5 * level);
        let mut start = 0;
        let (mut bands, mut z) = (Vec::new(), Vec::new());
        for end in ends {
            let part = &self.values[start..end];
            let dof = part.len() as f64 * self.dof;
            let ratio = part.iter().sum::<f64>() / part.len() as f64;
            let edge = |p: f64| chi_square_quantile(p, dof) / dof;
            let hz = |index: usize| ((self.first + index) as f64 - 0.5) * self.step_hz;
            bands.push(Band {
                from_hz: hz(start),
                to_hz: hz(end),
                dof,
                ratio,
                lower: edge(0.5 * level),
                upper: edge(1.0 - 0.5 * level),
            });
            z.push(normal_score(ratio * dof, dof));
            start = end;
        }
        (bands, z, bound)
    }
}

/// The tests `spectrum_ratio` (every band: level and shape at all frequencies) and `cumulative_spectrum` (shape,
/// most of all of the high frequencies), on Whittle's approximation that the coefficients are independent.
pub(super) fn spectrum(axis: &str, ratios: &Ratios, alpha: f64) -> (Vec<Band>, [Test; 2]) {
    let (bands, z, bound) = ratios.bands(alpha);
    let (at, shown) = farthest(&z, bound, &|i| bands[i].ratio);
    let range = |i: usize| format!("{} to {} Hz", digits(bands[i].from_hz), digits(bands[i].to_hz));
    let single = 2.0 * normal_sf(z[at].abs());
    let p_value = -((-single).ln_1p() * bands.len() as f64).exp_m1();
    let band = &bands[shown];
    let meaning = if z[at].abs() <= bound {
        format!(
            "the spectrum is the model's in every band; farthest at {}, {} times",
            range(at),
            digits(bands[at].ratio)
        )
    } else {
        let surest = if at == shown {
            String::new()
        } else {
            format!("; surest at {}, {} times", range(at), digits(bands[at].ratio))
        };
        format!("the spectrum is {} times the model's at {}{surest}", digits(band.ratio), range(shown))
    };
    let interval = [band.ratio / band.upper, band.ratio / band.lower];
    let tolerance = [1.0 / VARIANCE_RATIO_TOLERANCE, VARIANCE_RATIO_TOLERANCE];
    let banded = Test::new(axis, TestKind::SpectrumRatio, z[at], [-bound, bound], p_value, meaning)
        .with_effect(Effect::new("band_power_ratio", band.ratio, interval, tolerance));
    (bands, [banded, cumulative(axis, ratios, alpha)])
}

fn cumulative(axis: &str, ratios: &Ratios, alpha: f64) -> Test {
    let parts: Vec<(f64, f64)> = ratios.values.iter().map(|u| (1.0, *u)).collect();
    let found = departure(&parts);
    let bound = kolmogorov_quantile(alpha) / (found.count / 2.0).sqrt();
    let frequency = digits((ratios.first + found.at) as f64 * ratios.step_hz);
    let meaning = if found.distance.abs() <= bound {
        "the shape of the spectrum is the model's".to_string()
    } else if found.distance > 0.0 {
        format!("more of the power is below {frequency} Hz than the model says")
    } else {
        format!("more of the power is above {frequency} Hz than the model says")
    };
    let size = found.distance.abs();
    let effect = Effect::new(
        "periodogram_distance",
        size,
        [(size - bound).max(0.0), size + bound],
        [0.0, PERIODOGRAM_TOLERANCE],
    );
    Test::new(axis, TestKind::CumulativeSpectrum, found.distance, [-bound, bound], found.p_value, meaning)
        .with_effect(effect)
}
