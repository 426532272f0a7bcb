//! Whittle's likelihood on cosine coefficients, its maximum and its information.
//!
//! The coefficients c_j of n samples are nearly independent N(0, S(f_j)/dt), S the sampled spectrum of the model:
//! −ln L = ½ Σ_j [ln(2π S_j/dt) + dt (c_j − a r_j)²/S_j], a the slope of a ramp and r_j its coefficients. The slope
//! is eliminated: a = Σ dt c r/S / Σ dt r²/S. Expected information of the log parameters: I_ik = ½ Σ_j ∂_i ln S_j
//! ∂_k ln S_j; its inverse is the Cramér-Rao bound. Sources: Whittle 1953; Kay 1993, section 3.11 (asymptotic
//! bound).

use nalgebra::{DMatrix, DVector};

use super::form::{Form, Piece};
use super::ordinates::Ordinates;
use crate::noise::{Kind, Role, Term};
use crate::numerics::optimize::{Look, Optimum, Problem, minimize};
use crate::numerics::progress::checkpoint;

/// The correlation time of a line is at least this many samples.
const SHORTEST: f64 = 0.3;
/// That of a drift; what is shorter is wideband noise: white, and averaged by the sensor.
const SHORTEST_DRIFT: f64 = 2.0;
/// A Gauss-Markov process that forgets within so many samples is a matter of the sensor's bandwidth, not drift.
pub(super) const FAST: f64 = 10.0;
/// Beside a band limit a drift that forgets sooner is part of the filter; a line may be as wide as what is no drift
/// elsewhere, [`FAST`]: what is not allowed to be one wide line becomes several, each as wide as it may be. That a
/// filter's own resonance is no line is a matter of cost.
pub(super) const WIDE_LINE: f64 = 30.0;
/// And at most so many lengths of the log; beyond it a Gauss-Markov process is a random walk.
const LONGEST: f64 = 10.0;
/// Logarithm of an area ratio: a pole or zero within 10⁻⁵ of the unit circle.
pub(super) const STEEPEST: f64 = 12.0;
/// Logarithm of the density of a band limit over that of white noise of the same power, at most.
const LOUDEST: f64 = 7.0;
/// Steps of scoring at most, and the gain in ln L of one that ends them.
const SCORING_STEPS: usize = 40;
const SCORED: f64 = 1e-5;
/// A maximum is found when another step would gain half of this in ln L.
pub(super) const WELL: f64 = 1e-2;
/// What a step may be, in logarithms: where the log says next to nothing, the parabola reaches further than it is true.
const REACH: f64 = 2.0;
/// Step of numerical derivatives by a logarithm.
const STEP: f64 = 1e-4;

/// The best parameters of one form.
#[derive(Clone, Debug)]
pub(super) struct Fit {
    pub(super) form: Form,
    pub(super) logs: Vec<f64>,
    /// Of the ramp, unit/s; 0 without one.
    pub(super) slope: f64,
    /// Of the coefficients: all that n samples say apart from their mean.
    pub(super) log_likelihood: f64,
    /// gᵀ (I + 1/reach²)⁻¹ g: what another step would still gain, twice, in log-likelihood.
    pub(super) decrement: f64,
    /// Which logarithms keep a value that was given.
    pub(super) held: Vec<usize>,
}

/// Spectrum and derivatives by the logarithms at every bin.
struct Spectrum {
    total: Vec<f64>,
    /// ∂S/∂θ, by parameter.
    derivatives: Vec<Vec<f64>>,
}

impl Fit {
    /// At every bin, without a ramp.
    pub(super) fn spectrum(&self, data: &Ordinates) -> Vec<f64> {
        spectrum_of(data, &self.form, &self.logs)
    }

    /// What is searched around the fit, wide enough to hold it; what is held does not move.
    pub(super) fn bounds(&self, data: &Ordinates) -> Vec<(f64, f64)> {
        let mut bounds = bounds_around(data, &self.form, &self.logs);
        self.held.iter().for_each(|i| bounds[*i] = (self.logs[*i], self.logs[*i]));
        bounds
    }

    /// The maximum from a start with this form; what is held stays there.
    pub(super) fn climb_from(&self, data: &Ordinates, start: &[f64]) -> Option<Fit> {
        let free: Vec<usize> = (0..start.len()).filter(|i| !self.held.contains(i)).collect();
        Some(Fit { held: self.held.clone(), ..climb(data, &self.form, start, &free)? })
    }
}

/// Of a form at every bin, without a ramp.
pub(super) fn spectrum_of(data: &Ordinates, form: &Form, logs: &[f64]) -> Vec<f64> {
    spectrum(data, form, logs, &Held::nothing(data, form), false).total
}

/// What stays while others are searched: the pieces of which no logarithm is free.
struct Held {
    fixed: Vec<bool>,
    /// The shape of a band limit stays, too.
    shape: bool,
    /// Their spectrum.
    total: Vec<f64>,
}

impl Held {
    fn nothing(data: &Ordinates, form: &Form) -> Held {
        Held { fixed: vec![false; form.pieces().len()], shape: false, total: vec![0.0; data.bins.len()] }
    }

    fn new(data: &Ordinates, form: &Form, logs: &[f64], free: &[usize]) -> Held {
        let mut held = Held::nothing(data, form);
        held.shape = !free.iter().any(|i| form.roles()[*i].1 == Role::Shape);
        let mut first = 0;
        for (fixed, (piece, own)) in held.fixed.iter_mut().zip(form.split(logs)) {
            let indices = first..first + own.len();
            first = indices.end;
            *fixed = !free.iter().any(|i| indices.contains(i));
            let values: Vec<f64> = own.iter().map(|v| v.exp()).collect();
            if *fixed {
                add(&mut held.total, piece, &values, data);
            }
        }
        held
    }
}

/// The spectrum of one piece on top; none that is finite where there is no such process.
fn add(total: &mut [f64], piece: Piece, values: &[f64], data: &Ordinates) {
    let mut terms = piece.terms(values).peekable();
    if terms.peek().is_none() && !piece.roles().is_empty() {
        total.fill(f64::INFINITY);
    }
    terms.for_each(|term| total.iter_mut().zip(term.psd_on(&data.grid)).for_each(|(t, psd)| *t += psd));
}

fn spectrum(data: &Ordinates, form: &Form, logs: &[f64], held: &Held, with_derivatives: bool) -> Spectrum {
    let mut total = held.total.clone();
    let mut derivatives = Vec::new();
    for ((piece, own), fixed) in form.split(logs).zip(&held.fixed) {
        if *fixed {
            if with_derivatives {
                derivatives.extend(own.iter().map(|_| Vec::new()));
            }
            continue;
        }
        let at = |index: usize, shift: f64| {
            let values: Vec<f64> =
                own.iter().enumerate().map(|(i, v)| if i == index { (v + shift).exp() } else { v.exp() }).collect();
            let mut psd = vec![0.0; data.bins.len()];
            add(&mut psd, piece, &values, data);
            psd
        };
        if own.is_empty() {
            continue;
        }
        let psd = at(0, 0.0);
        total.iter_mut().zip(&psd).for_each(|(t, p)| *t += p);
        if with_derivatives {
            let shapes = if held.shape { None } else { shape_derivatives(data, piece, own) };
            for (i, role) in piece.roles().iter().enumerate() {
                derivatives.push(match role {
                    Role::Coefficient => psd.iter().map(|p| 2.0 * p).collect(),
                    Role::Shape if held.shape => Vec::new(),
                    Role::Shape if shapes.is_some() => {
                        shapes.as_ref().and_then(|all| all.get(i - 1)).cloned().unwrap_or_default()
                    }
                    Role::CorrelationTime | Role::Frequency | Role::Shape => {
                        // a line is as narrow as its correlation time is long
                        let step = match (role, piece) {
                            (Role::Frequency, Piece::Oscillation) => STEP.min(1e-2 / (own[1] + own[2]).exp()),
                            _ => STEP,
                        };
                        let (above, below) = (at(i, step), at(i, -step));
                        above.iter().zip(&below).map(|(a, b)| (a - b) / (2.0 * step)).collect()
                    }
                });
            }
        }
    }
    Spectrum { total, derivatives }
}

/// ∂S/∂θ by each logarithm of the shape of a band limit, its floor included; `None` for other pieces.
fn shape_derivatives(data: &Ordinates, piece: Piece, own: &[f64]) -> Option<Vec<Vec<f64>>> {
    matches!(piece, Piece::BandLimit(_)).then_some(())?;
    let values: Vec<f64> = own.iter().map(|v| v.exp()).collect();
    let (psd, floor) = (piece.term(&values)?.psd_on(&data.grid), piece.floor(&values)?.psd_on(&data.grid));
    let of = |(slope, level): &(Vec<f64>, f64)| {
        psd.iter().zip(&floor).zip(slope).map(|((p, f), s)| p * s + f * level).collect()
    };
    Some(data.grid.shape_slopes(&values[1..])?.iter().map(of).collect())
}

/// The slope of a ramp that the log suggests under this spectrum, and its standard deviation.
fn slope(data: &Ordinates, form: &Form, total: &[f64]) -> (f64, f64) {
    if !form.has(Kind::RateRamp) {
        return (0.0, 0.0);
    }
    let (cross, own) = data
        .bins
        .iter()
        .zip(total)
        .fold((0.0, 0.0), |(cross, own), (bin, s)| (cross + bin.with_ramp / s, own + bin.ramp / s));
    (cross / own, 1.0 / own.sqrt())
}

/// −ln L, and its gradient.
fn objective(data: &Ordinates, form: &Form, logs: &[f64], held: &Held, gradient: Option<&mut [f64]>) -> f64 {
    checkpoint();
    objective_of(data, form, &spectrum(data, form, logs, held, gradient.is_some()), gradient)
}

fn objective_of(data: &Ordinates, form: &Form, spectrum: &Spectrum, gradient: Option<&mut [f64]>) -> f64 {
    let Spectrum { total, derivatives } = spectrum;
    let (slope, _) = slope(data, form, total);
    let constant = (std::f64::consts::TAU / data.dt).ln();
    let sum: f64 =
        data.bins.iter().zip(total).map(|(bin, s)| bin.count * (constant + s.ln()) + bin.left(slope) / s).sum();
    if let Some(gradient) = gradient {
        for (g, derivative) in gradient.iter_mut().zip(derivatives) {
            let terms = data.bins.iter().zip(total).zip(derivative);
            *g = 0.5 * terms.map(|((bin, s), d)| (bin.count - bin.left(slope) / s) * d / s).sum::<f64>();
        }
    }
    0.5 * sum
}

/// Expected information of the logarithms.
pub(super) fn expected_information(data: &Ordinates, form: &Form, logs: &[f64]) -> DMatrix<f64> {
    information(data, form, logs, &Held::nothing(data, form))
}

fn information(data: &Ordinates, form: &Form, logs: &[f64], held: &Held) -> DMatrix<f64> {
    information_of(data, &spectrum(data, form, logs, held, true))
}

/// Rows of held pieces are zero.
fn information_of(data: &Ordinates, Spectrum { total, derivatives }: &Spectrum) -> DMatrix<f64> {
    let p = derivatives.len();
    let weights: Vec<f64> = data.bins.iter().zip(total).map(|(bin, s)| (0.5 * bin.count).sqrt() / s).collect();
    let weighted = |own: &Vec<f64>| own.iter().zip(&weights).map(|(d, w)| d * w).collect::<Vec<f64>>();
    let derivatives: Vec<Vec<f64>> = derivatives.iter().map(weighted).collect();
    let mut information = DMatrix::zeros(p, p);
    for i in 0..p {
        for k in 0..=i {
            information[(i, k)] = dot(&derivatives[i], &derivatives[k]);
        }
    }
    information.fill_upper_triangle_with_lower_triangle();
    information
}

/// Σ a b in four sums, which the processor takes side by side; 0 with a held piece, which has none.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    if a.len() != b.len() {
        return 0.0;
    }
    let (fours, rest) = a.as_chunks::<4>();
    let (others, end) = b.as_chunks::<4>();
    let mut sums = [0.0; 4];
    for (a, b) in fours.iter().zip(others) {
        for ((sum, a), b) in sums.iter_mut().zip(a).zip(b) {
            *sum += a * b;
        }
    }
    sums.iter().sum::<f64>() + rest.iter().zip(end).map(|(a, b)| a * b).sum::<f64>()
}

/// Second derivatives of −ln L by the logarithms.
pub(super) fn observed_information(data: &Ordinates, fit: &Fit) -> DMatrix<f64> {
    let p = fit.logs.len();
    let expected = expected_information(data, &fit.form, &fit.logs);
    let nothing = Held::nothing(data, &fit.form);
    let mut information = DMatrix::zeros(p, p);
    for i in 0..p {
        // a hundredth of a standard deviation
        let step = 0.01 / expected[(i, i)].sqrt().clamp(1e-2, 1e9);
        let gradient = |shift: f64| {
            let mut logs = fit.logs.clone();
            logs[i] += shift;
            let mut gradient = vec![0.0; p];
            objective(data, &fit.form, &logs, &nothing, Some(&mut gradient));
            gradient
        };
        let (above, below) = (gradient(step), gradient(-step));
        for k in 0..p {
            information[(i, k)] = (above[k] - below[k]) / (2.0 * step);
        }
    }
    (&information + information.transpose()) * 0.5
}

/// Standard deviation of the slope of a ramp.
pub(super) fn slope_sigma(data: &Ordinates, form: &Form, logs: &[f64]) -> f64 {
    slope(data, form, &spectrum(data, form, logs, &Held::nothing(data, form), false).total).1
}

/// ln L of `form` at given parameters on other data.
pub(super) fn log_likelihood(data: &Ordinates, form: &Form, logs: &[f64]) -> f64 {
    -objective(data, form, logs, &Held::nothing(data, form), None)
}

/// Bounds of the logarithms; a line stays where the bins are as fine as around its start, and no narrower than they
/// are.
pub(super) fn bounds(data: &Ordinates, form: &Form, start: &[f64]) -> Vec<(f64, f64)> {
    let limited = form.has(Kind::BandLimit);
    let least = if limited { [FAST, WIDE_LINE] } else { [SHORTEST, SHORTEST_DRIFT] };
    let [shortest, shortest_drift] = least.map(|samples| (samples * data.dt).ln());
    let of = |(piece, own): (Piece, &[f64])| {
        let touch = touch(data, piece);
        let coefficient = (touch.0 - 9.0, touch.1 + 5.0);
        match piece {
            Piece::Oscillation => {
                let (low, high, width) = data.fine_around(own[1].exp());
                // a wide line needs no fine bins, and its place is not known better than its width
                let half = 0.5 / (std::f64::consts::PI * own[2].exp());
                let last = data.bins.last().map_or(high, |bin| bin.frequency_hz);
                let low = low.min((own[1].exp() - half).max(0.5 * low));
                let high = high.max((own[1].exp() + half).min(last));
                let longest = (1.0 / (std::f64::consts::PI * width)).min(data.span_s());
                vec![coefficient, (low.ln(), high.ln()), (shortest, longest.ln().max(shortest))]
            }
            Piece::GaussMarkov => vec![coefficient, (shortest_drift, (LONGEST * data.span_s()).ln())],
            Piece::Ramp => vec![],
            Piece::BandLimit(_) => {
                let shape = piece.roles()[1..].iter().map(|_| (-STEEPEST, STEEPEST));
                std::iter::once((level(data) - LOUDEST, level(data) + LOUDEST)).chain(shape).collect()
            }
            // as far as all power together
            Piece::White => vec![(coefficient.0, coefficient.1.max(level(data) + 1.0))],
            _ => vec![coefficient],
        }
    };
    form.split(start).flat_map(of).collect()
}

/// The same around a place, as wide as to hold it: a line that has moved on to wider bins than those around its
/// start is narrower than what would be searched there, and a search from it that begins with another correlation
/// time begins lower.
fn bounds_around(data: &Ordinates, form: &Form, logs: &[f64]) -> Vec<(f64, f64)> {
    let wide = |((low, high), at): ((f64, f64), &f64)| (low.min(*at), high.max(*at));
    bounds(data, form, logs).into_iter().zip(logs).map(wide).collect()
}

/// ln of the density of white noise with the power of the log.
pub(super) fn level(data: &Ordinates) -> f64 {
    let (power, count) = data.bins.iter().fold((0.0, 0.0), |(p, c), bin| (p + bin.power, c + bin.count));
    0.5 * (power / f64::max(count, 1.0)).ln()
}

/// ln of the coefficient with which a process alone touches the spectrum from below, for its extreme correlation times.
fn touch(data: &Ordinates, piece: Piece) -> (f64, f64) {
    let ends: Vec<Vec<f64>> = match piece {
        Piece::GaussMarkov => [SHORTEST_DRIFT * data.dt, LONGEST * data.span_s()].map(|time| vec![1.0, time]).into(),
        Piece::Oscillation => [SHORTEST * data.dt, data.span_s()].map(|time| vec![1.0, 0.25 / data.dt, time]).into(),
        Piece::BandLimit(_) => vec![],
        _ => vec![vec![1.0]],
    };
    let of = |values: &Vec<f64>| piece.term(values).map(|term| touching(data, &term));
    let found: Vec<f64> = ends.iter().filter_map(of).collect();
    let (low, high) = found.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
    (low, high)
}

/// ln of the factor by which this process touches the spectrum from below; a few neighbouring bins are taken together.
pub(super) fn touching(data: &Ordinates, term: &Term) -> f64 {
    let mut least = f64::INFINITY;
    let (mut power, mut own, mut count) = (0.0, 0.0, 0.0);
    for (bin, psd) in data.bins.iter().zip(term.psd_on(&data.grid)) {
        power += bin.power;
        own += bin.count * psd;
        count += bin.count;
        if count >= 8.0 {
            if own > 0.0 {
                least = least.min(power / own);
            }
            (power, own, count) = (0.0, 0.0, 0.0);
        }
    }
    if least.is_finite() && least > 0.0 { 0.5 * least.ln() } else { 0.0 }
}

/// The maximum from a start by the logarithms of `free` alone, within bounds. None when nothing finite was met.
///
/// SLSQP (Kraft 1988) on logarithms scaled by their information, restarted until it gains less than 10⁻⁵.
pub(super) fn climb(data: &Ordinates, form: &Form, start: &[f64], free: &[usize]) -> Option<Fit> {
    climb_within(data, form, start, free, &bounds(data, form, start))
}

/// The same within given bounds.
pub(super) fn climb_within(
    data: &Ordinates,
    form: &Form,
    start: &[f64],
    free: &[usize],
    bounds: &[(f64, f64)],
) -> Option<Fit> {
    let mut at = start.to_vec();
    for i in free {
        at[*i] = at[*i].clamp(bounds[*i].0, bounds[*i].1);
    }
    let held = Held::new(data, form, &at, free);
    let scored = form.has(Kind::BandLimit);
    if scored {
        scoring(data, form, &mut at, &held, free, bounds);
    }
    let place = |x: &[f64]| {
        let mut logs = at.clone();
        free.iter().zip(x).for_each(|(i, x)| logs[*i] = *x);
        logs
    };
    let look = |x: &[f64], _: &[f64], sloped: bool| {
        let logs = place(x);
        let mut gradient = vec![0.0; if sloped { logs.len() } else { 0 }];
        let value = objective(data, form, &logs, &held, sloped.then_some(&mut gradient[..]));
        let slopes = if sloped { vec![free.iter().map(|i| gradient[*i]).collect()] } else { vec![] };
        Look { values: vec![value], slopes }
    };
    let scale = |x: &[f64], _| {
        let information = information(data, form, &place(x), &held);
        free.iter().map(|i| 1.0 / information[(*i, *i)].sqrt().clamp(1.0, 1e8)).collect()
    };
    let problem = Problem {
        look: &look,
        scale: &scale,
        start: objective(data, form, &at, &held, None),
        rounds: if scored { 0 } else { 8 },
        ..Problem::default()
    };
    let start: Vec<f64> = free.iter().map(|i| at[*i]).collect();
    let limits: Vec<(f64, f64)> = free.iter().map(|i| bounds[*i]).collect();
    let Optimum { x, f: best, .. } = minimize(&problem, &start, &limits);
    let at = place(&x);
    best.is_finite().then(|| finish(data, form, at, best, free, bounds))
}

/// Steps of Fisher's scoring, damped (Levenberg 1944, Marquardt 1963), until another would gain less than
/// [`SCORED`]: coefficients of a filter go together as no search that has to learn it from slopes can know. How far
/// it is from the end is told by the decrement. Not `optimize::minimize`, which would have to learn them.
fn scoring(data: &Ordinates, form: &Form, at: &mut [f64], held: &Held, free: &[usize], bounds: &[(f64, f64)]) {
    let mut damping = 1e-2;
    let mut value = objective(data, form, at, held, None);
    for _ in 0..SCORING_STEPS {
        let spectrum = spectrum(data, form, at, held, true);
        let mut gradient = vec![0.0; at.len()];
        objective_of(data, form, &spectrum, Some(&mut gradient));
        let information = information_of(data, &spectrum);
        // what is at a bound and would leave stays there
        let leaves = |i: &usize| {
            (at[*i] <= bounds[*i].0 && gradient[*i] > 0.0) || (at[*i] >= bounds[*i].1 && gradient[*i] < 0.0)
        };
        let free: Vec<usize> = free.iter().copied().filter(|i| !leaves(i)).collect();
        let slope = DVector::from_fn(free.len(), |i, _| -gradient[free[i]]);
        if free.is_empty() || !slope.iter().all(|g| g.is_finite()) {
            return;
        }
        let mut gain = 0.0;
        let next = std::iter::from_fn(|| {
            let part = DMatrix::from_fn(free.len(), free.len(), |i, k| {
                let own = information[(free[i], free[k])];
                if i == k { own * (1.0 + damping) + 1e-3 * damping } else { own }
            });
            damping *= 4.0;
            Some(nalgebra::Cholesky::new(part).map(|part| part.solve(&slope)))
        })
        .take(12)
        .flatten()
        .find_map(|step| {
            let mut next = at.to_vec();
            for (i, s) in free.iter().zip(step.iter()) {
                next[*i] = (next[*i] + s.clamp(-REACH, REACH)).clamp(bounds[*i].0, bounds[*i].1);
            }
            let found = objective(data, form, &next, held, None);
            gain = value - found;
            (gain > 0.0).then_some((next, found))
        });
        // no step leads up, however short
        let Some((next, found)) = next else { return };
        at.copy_from_slice(&next);
        value = found;
        damping = (damping / 40.0).max(1e-9);
        if gain < SCORED {
            return;
        }
    }
}

/// The same by all logarithms.
pub(super) fn climb_all(data: &Ordinates, form: &Form, start: &[f64]) -> Option<Fit> {
    climb(data, form, start, &(0..start.len()).collect::<Vec<_>>())
}

fn finish(data: &Ordinates, form: &Form, logs: Vec<f64>, value: f64, free: &[usize], bounds: &[(f64, f64)]) -> Fit {
    let held = Held::new(data, form, &logs, free);
    let spectrum = spectrum(data, form, &logs, &held, true);
    let mut gradient = vec![0.0; logs.len()];
    objective_of(data, form, &spectrum, Some(&mut gradient));
    // at a bound the gradient may point outwards
    let off = |i: &usize| logs[*i] > bounds[*i].0 + 1e-6 && logs[*i] < bounds[*i].1 - 1e-6;
    let inside: Vec<usize> = free.iter().copied().filter(off).collect();
    let information = information_of(data, &spectrum);
    let reach = DMatrix::from_diagonal_element(inside.len(), inside.len(), REACH.powi(-2));
    let part = DMatrix::from_fn(inside.len(), inside.len(), |i, k| information[(inside[i], inside[k])]) + reach;
    let g = DMatrix::from_fn(inside.len(), 1, |i, _| gradient[inside[i]]);
    let decrement = nalgebra::Cholesky::new(part)
        .map_or(f64::NAN, |c| (g.transpose() * c.solve(&g)).get(0).copied().unwrap_or(0.0));
    let (slope, _) = slope(data, form, &spectrum.total);
    Fit { form: form.clone(), logs, slope, log_likelihood: -value, decrement, held: vec![] }
}
