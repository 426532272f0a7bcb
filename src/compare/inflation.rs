//! How many times louder a log is than the bench: the factor that vibration puts on wideband noise.
//!
//! Above a frequency that motion does not reach, u_j = P_j/S_j with P the power of the log's cosine coefficients
//! (ends tapered, so that motion does not leak upwards) and S the spectrum of the bench model. The factor on
//! densities is √(mean u). Beside it, √(median u/0.4549), 0.4549 the median of χ²₁, which narrow lines do not move.
//!
//! A log in pieces is cut into segments of one length between its gaps, each with a Hann window (in a short one
//! motion leaks further up), whose coefficients are taken together.

use schemars::JsonSchema;
use serde::Serialize;

use super::spectrum::{Band, Ratios};
use super::{CompareError, Log, LogAxis, other_rate, paired};
use crate::noise::{Kind, NoiseModel, Term};
use crate::numerics::distribution::{CHI_SQUARE_1_MEDIAN, NORMAL_95, chi_square_quantile};
use crate::numerics::reduce::mean;
use crate::params::{AxisParams, Inflated, Params, Source, TermEntry};
use crate::signal::lines::find_lines;
use crate::units::{Quantity, digits};

/// Share of the log over which each end is brought to zero.
const TAPER: f64 = 0.05;
/// The log is in pieces when the longest stretch has less than this share of its samples; a length of segments is
/// good when it keeps as much of what the shortest keep.
const MOST_OF_IT: f64 = 0.8;
/// Samples of the shortest segments: a tenth of their band is a dozen coefficients.
const SHORTEST_SEGMENT: usize = 256;
/// How much neighbours go together in being above the median, over how much they do in size: normal probabilities in
/// two dimensions, 0.48 for a Hann window and 0.37 for a narrow taper, which ties little.
const MEDIAN_TIES: f64 = 0.48;
/// Fewest coefficients in the band.
const FEWEST: usize = 100;
/// Level of the bounds of the bands.
const ALPHA: f64 = 0.05;
/// Lines are said to matter when the factor is so many times the robust one.
const LINES_MATTER: f64 = 1.05;
/// And the excess is said not to be white when the powers of two bands are so many times apart.
const NOT_FLAT: f64 = 2.0;

/// A vibration line.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct VibrationLine {
    pub frequency_hz: f64,
    pub width_hz: f64,
    /// Of the line alone, SI.
    pub std_dev: f64,
}

/// One axis of [`Inflation`], SI units.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct AxisInflation {
    /// Of the parameters.
    pub name: String,
    pub log_axis: String,
    /// Used: the longest stretch without gaps and unusable samples, or a longer one whose short holes are filled in;
    /// or of all segments.
    pub samples: usize,
    /// Of equal length, between the gaps of a log in pieces; 1 where it is one stretch.
    pub segments: usize,
    pub filled: usize,
    /// Usable samples beside them.
    pub left_out: usize,
    /// Times the wideband density of the parameters.
    pub factor: f64,
    /// 95 %, from the log's own scatter; the parameters are taken as exact.
    pub interval: [f64; 2],
    /// By the median, which narrow lines do not move.
    pub robust_factor: f64,
    pub robust_interval: [f64; 2],
    /// Equivalent degrees of freedom of the mean ratio.
    pub dof: f64,
    /// Wideband density of the parameters.
    pub density: f64,
    /// Power ratio by bands.
    pub bands: Vec<Band>,
    /// Strongest first.
    pub lines: Vec<VibrationLine>,
    pub notes: Vec<String>,
}

/// What `inflate` finds.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Inflation {
    /// "kfdesign-inflate/1".
    pub format: String,
    pub params: Option<String>,
    /// File name and SHA-256 of the log, if it came from a file.
    pub log: Option<String>,
    pub log_sha256: Option<String>,
    pub quantity: Quantity,
    /// Of the log, Hz.
    pub sample_rate: f64,
    /// Lowest frequency used, Hz.
    pub from_hz: f64,
    /// What the factors hold for.
    pub valid_for: String,
    pub axes: Vec<AxisInflation>,
}

/// The frequency from which noise is measured when none is given: a tenth of the Nyquist frequency.
pub fn usual_from_hz(sample_rate_hz: f64) -> f64 {
    0.05 * sample_rate_hz
}

/// The factor of every axis above `from_hz`.
///
/// Errors: as of [`super::compare`]; a band with fewer than 100 coefficients; no wideband noise in the parameters.
pub fn inflation(params: &Params, log: &Log, from_hz: f64) -> Result<Inflation, CompareError> {
    let nyquist = 0.5 * log.sample_rate_hz;
    if !(from_hz > 0.0 && from_hz < nyquist) {
        let expected = format!("above 0 and below half the sample rate, {} Hz", digits(nyquist));
        return Err(CompareError::Option { flag: "`from`", value: from_hz, expected });
    }
    let axes = paired(params, log)?
        .into_iter()
        .map(|(axis, of_log)| inflation_of(params, axis, of_log, log.sample_rate_hz, from_hz))
        .collect::<Result<_, _>>()?;
    Ok(Inflation {
        format: "kfdesign-inflate/1".into(),
        params: None,
        log: None,
        log_sha256: None,
        quantity: log.quantity,
        sample_rate: log.sample_rate_hz,
        from_hz,
        valid_for: format!(
            "noise above {} Hz sampled at {} Hz, for the vehicle, mounting and engine speed of this log; slower noise \
             and drift are not \
             measured, since motion hides them; motion above {} Hz, if there is any, counts as noise",
            digits(from_hz),
            digits(log.sample_rate_hz),
            digits(from_hz)
        ),
        axes,
    })
}

fn inflation_of(
    params: &Params,
    axis: &AxisParams,
    log: &LogAxis,
    rate_hz: f64,
    from_hz: f64,
) -> Result<AxisInflation, CompareError> {
    let failed = |message: String| CompareError::Axis { axis: log.name.clone(), message };
    let (dt, model) = (1.0 / rate_hz, axis.noise());
    if model.wideband_density() == 0.0 {
        return Err(failed(format!(
            "the parameters of '{}' have no white, moving_average or band_limit density to multiply",
            axis.name
        )));
    }
    let pieces = segments(log);
    let (parts, share) = match &pieces[..] {
        [] => (vec![&log.rate[..]], TAPER),
        pieces => (pieces.to_vec(), 0.5),
    };
    let (tapered, dofs): (Vec<Vec<f64>>, Vec<f64>) = parts.iter().map(|part| tapered(part, share)).unzip();
    let mut ratios = Ratios { dof: mean(&dofs), ..Ratios::of_segments(&tapered, dt, &model, from_hz) };
    let top_hz = pass_band_hz(&model, rate_hz).filter(|top| *top > from_hz && *top < 0.5 * rate_hz);
    if let Some(top) = top_hz {
        ratios.values.truncate(((top / ratios.step_hz) as usize + 1).saturating_sub(ratios.first));
    }
    let samples = parts.iter().map(|part| part.len()).sum::<usize>();
    let count = ratios.values.len();
    if count < FEWEST {
        return Err(failed(format!(
            "{count} spectral coefficients above {} Hz are too few: at least {FEWEST} are needed; use a longer log or \
             a lower `from`",
            digits(from_hz)
        )));
    }
    let ratio = mean(&ratios.values);
    let squares: f64 = ratios.values.iter().map(|u| u * u).sum();
    // E u² = 3 L² for u of local level L: a level that varies leaves fewer degrees of freedom
    let dof = ratios.dof * (3.0 * (ratio * count as f64).powi(2) / squares).min(count as f64);
    let interval = [0.975, 0.025].map(|p| (ratio * dof / chi_square_quantile(p, dof)).sqrt());
    let (robust_factor, robust_interval) = robust(&ratios);
    let (bands, z, bound) = ratios.bands(ALPHA);
    let lines = lines(&ratios, samples, parts.len(), dt, &model);
    let factor = ratio.sqrt();
    let mut notes: Vec<String> = other_rate(params.sample_rate_hz, rate_hz, &model).into_iter().collect();
    if factor > LINES_MATTER * robust_factor {
        notes.push(format!(
            "{} % of the power is in lines or a part of the band: as white noise it is overstated elsewhere; without, \
             the factor is {}",
            digits(100.0 * (1.0 - (robust_factor / factor).powi(2))),
            digits(robust_factor)
        ));
    }
    if let Some(top) = top_hz {
        notes.push(format!(
            "what is above {} Hz, where the band limit lets through less than half, is left out: the converter's own \
             noise has a part there",
            digits(top)
        ));
    }
    notes.extend(not_flat(&bands, &z, bound));
    notes.extend(not_wideband(&model, dt, &ratios));
    let usable = log.rate.len() - log.filled + log.left_out;
    let filled = if pieces.is_empty() { log.filled } else { 0 };
    let left_out = usable + filled - samples;
    if let [piece, ..] = &pieces[..] {
        notes.push(format!(
            "the log is in pieces: {} stretches of {} samples between its gaps are used, {left_out} samples left out",
            pieces.len(),
            piece.len()
        ));
    }
    Ok(AxisInflation {
        name: axis.name.clone(),
        log_axis: log.name.clone(),
        samples,
        segments: parts.len(),
        filled,
        left_out,
        factor,
        interval,
        robust_factor,
        robust_interval,
        dof,
        density: model.wideband_density(),
        bands,
        lines,
        notes,
    })
}

/// Up to where the band limits of the model let half of the power through, Hz.
fn pass_band_hz(model: &NoiseModel, rate_hz: f64) -> Option<f64> {
    let share = |term: &Term| if let Term::BandLimit { filter, .. } = term { filter.half_power() } else { None };
    model.terms.iter().filter_map(share).min_by(f64::total_cmp).map(|share| share * rate_hz)
}

/// Two or more segments of one length between gaps and unusable samples; none where one stretch is most of the log,
/// or no other piece is long enough.
fn segments(log: &LogAxis) -> Vec<&[f64]> {
    let seen = log.rate.len() - log.filled;
    if seen as f64 >= MOST_OF_IT * (seen + log.left_out) as f64 {
        return vec![];
    }
    let finite = log.whole.iter().flat_map(|(_, own)| own.split(|x| !x.is_finite()));
    let pieces: Vec<&[f64]> = finite.filter(|part| part.len() >= SHORTEST_SEGMENT).collect();
    let mut lengths: Vec<usize> = pieces.iter().map(|part| part.len()).collect();
    lengths.sort_unstable();
    let kept = |length: usize| pieces.iter().map(|part| part.len() / length * length).sum::<usize>();
    let most = kept(SHORTEST_SEGMENT) as f64;
    let length = lengths.into_iter().rev().find(|length| kept(*length) as f64 >= MOST_OF_IT * most);
    let cut = |length| pieces.iter().flat_map(|part| part.chunks_exact(length)).collect::<Vec<&[f64]>>();
    length.map(cut).filter(|cut| cut.len() > 1).unwrap_or_default()
}

/// Samples about their mean with both ends brought to zero by half a cosine (Tukey 1967) over a share of them, of
/// the same power, and the degrees of freedom that are left of each coefficient, (Σw²)²/(n Σw⁴).
fn tapered(rate: &[f64], share: f64) -> (Vec<f64>, f64) {
    let (n, level) = (rate.len(), mean(rate));
    let edge = ((share * n as f64) as usize).max(1);
    let window = |k: usize| {
        let from_end = k.min(n - 1 - k);
        if from_end >= edge {
            1.0
        } else {
            0.5 * (1.0 - (std::f64::consts::PI * (from_end as f64 + 0.5) / edge as f64).cos())
        }
    };
    let power = |exponent: i32| (0..n).map(|k| window(k).powi(exponent)).sum::<f64>();
    let (squares, fourth) = (power(2), power(4));
    let scale = (n as f64 / squares).sqrt();
    let out = rate.iter().enumerate().map(|(k, x)| scale * window(k) * (x - level)).collect();
    (out, squares * squares / (n as f64 * fourth))
}

/// √(median/0.4549) with the distribution-free 95 % interval of a median, the order statistics n/2 ± 1.96 √n/2,
/// further apart where a taper ties neighbours together.
fn robust(ratios: &Ratios) -> (f64, [f64; 2]) {
    let mut sorted = ratios.values.clone();
    sorted.sort_by(f64::total_cmp);
    let n = sorted.len() as f64;
    let half = 0.5 * NORMAL_95 * (n * (1.0 + MEDIAN_TIES * (1.0 / ratios.dof - 1.0))).sqrt();
    let at = |rank: f64| (sorted[(rank.max(0.0) as usize).min(sorted.len() - 1)] / CHI_SQUARE_1_MEDIAN).sqrt();
    (at(0.5 * n), [at(0.5 * n - half), at(0.5 * n + half)])
}

/// Peaks over the model's spectrum in the band.
fn lines(ratios: &Ratios, samples: usize, segments: usize, dt: f64, model: &NoiseModel) -> Vec<VibrationLine> {
    // below the band stands its own level, where nothing is a line
    let mut whole = vec![CHI_SQUARE_1_MEDIAN * robust(ratios).0.powi(2); ratios.first - 1];
    whole.extend(&ratios.values);
    let of = |line: crate::signal::lines::Line| {
        let number = |hz: f64| ((hz / ratios.step_hz) as usize).clamp(1, whole.len()) - 1;
        // what the taper spreads: a Hann window over four steps of a segment
        let spread = if segments > 1 { 4 * segments } else { 2 };
        let reach = line.width_hz.max(spread as f64 * ratios.step_hz);
        let inside = number(line.frequency_hz - reach)..number(line.frequency_hz + reach) + 1;
        let around = number(line.frequency_hz - 20.0 * reach)..number(line.frequency_hz + 20.0 * reach) + 1;
        let mut sorted = whole[around].to_vec();
        let middle = sorted.len() / 2;
        let level = *sorted.select_nth_unstable_by(middle, f64::total_cmp).1 / CHI_SQUARE_1_MEDIAN;
        let excess: f64 = whole[inside].iter().map(|u| u - level).sum();
        // Σ c²/n is the variance of the samples, c² = u S/dt
        let variance = excess * model.psd(line.frequency_hz, dt) / (dt * samples as f64);
        VibrationLine { frequency_hz: line.frequency_hz, width_hz: line.width_hz, std_dev: variance.max(0.0).sqrt() }
    };
    let lowest = ratios.first as f64 * ratios.step_hz;
    let found = find_lines(&whole, ratios.step_hz, ratios.dof).into_iter().filter(|l| l.frequency_hz >= lowest);
    found.map(of).filter(|line| line.std_dev > 0.0).collect()
}

/// A sentence when the ratio is surely not the same at all frequencies.
fn not_flat(bands: &[Band], z: &[f64], bound: f64) -> Option<String> {
    let least = bands.iter().min_by(|a, b| a.ratio.total_cmp(&b.ratio))?;
    let most = bands.iter().max_by(|a, b| a.ratio.total_cmp(&b.ratio))?;
    let sure = z.iter().any(|z| z.abs() > bound) && most.ratio / most.upper > least.ratio / least.lower;
    let shown =
        |band: &Band| format!("{} at {} to {} Hz", digits(band.ratio.sqrt()), digits(band.from_hz), digits(band.to_hz));
    let advice = if std::ptr::eq(most, &bands[0]) {
        "motion may reach into the band: try a higher `from`"
    } else {
        "white noise times one factor is a rough picture of it"
    };
    (sure && most.ratio > NOT_FLAT * least.ratio)
        .then(|| format!("the log is not louder by one factor: {}, {}; {advice}", shown(least), shown(most)))
}

/// A sentence when the model's power in the band is not of the terms that are multiplied.
fn not_wideband(model: &NoiseModel, dt: f64, ratios: &Ratios) -> Option<String> {
    let wideband = NoiseModel {
        terms: model
            .terms
            .iter()
            .filter(|t| matches!(t.kind(), Kind::White | Kind::MovingAverage | Kind::BandLimit))
            .copied()
            .collect(),
    };
    const SEEN: usize = 1000;
    let places = (0..SEEN).map(|i| (ratios.first + i * ratios.values.len() / SEEN) as f64 * ratios.step_hz);
    let other = places.map(|f| 1.0 - wideband.psd(f, dt) / model.psd(f, dt)).sum::<f64>() / SEEN as f64;
    (other > 0.1).then(|| {
        format!(
            "{} % of the model's power in the band is not wideband noise (lines, quantisation, fast drift): the factor \
             is that of all of it",
            digits(100.0 * other)
        )
    })
}

/// "white and band_limit densities".
fn densities(multiplied: &[Kind]) -> String {
    let names = [(Kind::White, "white"), (Kind::MovingAverage, "moving_average"), (Kind::BandLimit, "band_limit")];
    let names: Vec<&str> = names.iter().filter(|(kind, _)| multiplied.contains(kind)).map(|(_, name)| *name).collect();
    format!("{} densities", names.join(" and "))
}

/// The parameters with every white, moving_average and band_limit density multiplied by the factor of its axis; all
/// else as it was, and a note in `source`.
///
/// The interval becomes density times the interval of the factor: the product is what the log itself shows, so that
/// the error of the bench value cancels.
pub fn inflated(params: &Params, found: &Inflation) -> Params {
    let mut out = params.clone();
    let mut multiplied = Vec::new();
    for (axis, inflation) in out.axes.iter_mut().zip(&found.axes) {
        for term in &mut axis.terms {
            let kind = term.to_term().kind();
            if let TermEntry::White { density }
            | TermEntry::MovingAverage { density, .. }
            | TermEntry::BandLimit { density, .. } = term
            {
                density.interval = Some(inflation.interval.map(|f| f * density.value));
                density.value *= inflation.factor;
                multiplied.push(kind);
            }
        }
    }
    let factors = found
        .axes
        .iter()
        .map(|a| format!("{} {} [{}, {}]", a.name, digits(a.factor), digits(a.interval[0]), digits(a.interval[1])));
    let log = found.log.as_deref().map_or(String::new(), |log| format!(" of {log}"));
    let sha = found.log_sha256.as_deref().map_or(String::new(), |sha| format!(" (SHA-256 {sha})"));
    let note = format!(
        "{} multiplied: {}; noise{log}{sha} above {} Hz, kfdesign inflate",
        densities(&multiplied),
        factors.collect::<Vec<_>>().join(", "),
        digits(found.from_hz)
    );
    let source = out.source.get_or_insert_with(Source::default);
    for axis in &found.axes {
        // what was inflated before is inflated once more
        let before = source.inflation.iter().position(|known| known.axis == axis.name);
        let before = before.map_or(1.0, |at| source.inflation.remove(at).factor);
        let [factor, low, high] = [axis.factor, axis.interval[0], axis.interval[1]].map(|f| f * before);
        source.inflation.push(Inflated { axis: axis.name.clone(), factor, interval: [low, high] });
    }
    source.note = Some(source.note.take().map_or(note.clone(), |old| format!("{old}; {note}")));
    out
}
