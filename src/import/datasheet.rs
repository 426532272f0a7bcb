//! A datasheet's words to parameters.
//!
//! Sources: IEEE Std 952-1997, Annexes B and C (angle random walk N, its floor B √(2 ln 2/π)); the maximum of a
//! Gauss-Markov process's Allan deviation is 0.6174 σ, at 1.893 Tc; equivalent noise bandwidth of a Butterworth
//! filter of order n: (π/2n)/sin(π/2n) of its −3 dB frequency.

use std::f64::consts::{FRAC_PI_2, SQRT_2};

use super::{Imported, axis, source};
use crate::noise::{FLICKER_FLOOR, GAUSS_MARKOV_PEAK};
use crate::params::{Measured, Params, TermEntry};
use crate::units::{Quantity, digits};

/// What a noise density's frequencies run over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sides {
    /// 0 to ∞: the deviation in a band B is density · √B, as a spectrum analyser shows it.
    One,
    /// −∞ to ∞: the density is N.
    Two,
}

/// What a bias instability is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Instability {
    /// The lowest value of the Allan deviation.
    Floor,
    /// The coefficient B of IEEE Std 952, whose floor is 0.664 B.
    Coefficient,
    /// The standard deviation of the drift; it needs a correlation time.
    Sigma,
}

/// What is printed, in its own units; all positive.
#[derive(Clone, Debug, PartialEq)]
pub struct Datasheet {
    pub quantity: Quantity,
    pub sample_rate_hz: f64,
    pub axes: Vec<String>,
    /// Of the product, for the source.
    pub name: Option<String>,
    /// Angle or velocity random walk.
    pub random_walk: Option<Measured>,
    pub noise_density: Option<Measured>,
    pub sides: Option<Sides>,
    /// Deviation of the whole noise in the bandwidth.
    pub total_noise: Option<Measured>,
    /// −3 dB.
    pub bandwidth: Option<Measured>,
    /// Of the low-pass filter, for its noise bandwidth.
    pub filter_order: u32,
    pub bias_instability: Option<Measured>,
    pub instability: Instability,
    pub correlation_time: Option<Measured>,
    pub rate_random_walk: Option<Measured>,
    pub turn_on_bias: Option<Measured>,
}

/// Two white figures this close, relatively, say the same.
const ALIKE: f64 = 0.1;

/// Parameters of a datasheet, with every rule that was used in words.
///
/// Errors: no white noise; a density of which nobody says whether it is one-sided; figures that need each other.
pub fn parameters(sheet: &Datasheet) -> Result<Imported, String> {
    let mut said = Said::default();
    let mut terms = vec![TermEntry::White { density: white(sheet, &mut said)? }];
    terms.extend(drift(sheet, &mut said)?);
    if let Some(density) = &sheet.rate_random_walk {
        said.rule(format!("rate random walk: K = {}", shown(density)));
        terms.push(TermEntry::RateRandomWalk { density: density.clone() });
    }
    if terms.len() == 1 {
        said.warnings.push(
            "no drift: a filter of these numbers averages for ever; a bias instability or a rate random \
                            walk would bound it"
                .into(),
        );
    }
    if let Some(bias) = &sheet.turn_on_bias {
        said.rule(format!("turn-on bias {} is one standard deviation; of a limit, give a third", shown(bias)));
    }
    bandwidth(sheet, &terms[0], &mut said);
    let axes = sheet.axes.iter().map(|name| axis(name, None, sheet.turn_on_bias.clone(), terms.clone())).collect();
    let name = sheet.name.as_ref().map_or_else(String::new, |name| format!("{name}: "));
    let params = Params {
        quantity: sheet.quantity,
        sample_rate_hz: sheet.sample_rate_hz,
        axes,
        design: None,
        source: Some(source(format!("{name}{}", said.rules.join("; ")), ORIGIN)),
    };
    Ok(Imported { origin: ORIGIN, sensors: vec![params], rules: said.rules, warnings: said.warnings })
}

const ORIGIN: &str = "datasheet";

#[derive(Default)]
struct Said {
    rules: Vec<String>,
    warnings: Vec<String>,
}

impl Said {
    fn rule(&mut self, sentence: String) {
        self.rules.push(sentence);
    }
}

fn shown(value: &Measured) -> String {
    format!("{} {}", digits(value.value), value.unit)
}

/// The same unit, another value.
fn times(value: &Measured, factor: f64) -> Measured {
    Measured { value: value.value * factor, unit: value.unit.clone(), interval: None }
}

fn noise_bandwidth(sheet: &Datasheet) -> Option<f64> {
    let angle = FRAC_PI_2 / f64::from(sheet.filter_order.max(1));
    sheet.bandwidth.as_ref().map(|b| b.si() * angle / angle.sin())
}

/// N by the surest figure there is, held against the others.
fn white(sheet: &Datasheet, said: &mut Said) -> Result<Measured, String> {
    let of_total = match (&sheet.total_noise, noise_bandwidth(sheet)) {
        (Some(total), Some(band)) => {
            let density = Measured::from_si(total.si() / (2.0 * band).sqrt(), None, total.unit.times_time(1));
            let rule = format!(
                "total noise {} in {}: N = {} = total/sqrt(2 B), B = {} Hz the noise bandwidth of a filter of order {}",
                shown(total),
                sheet.bandwidth.as_ref().map(shown).unwrap_or_default(),
                shown(&density),
                digits(band),
                sheet.filter_order
            );
            Some((density, rule))
        }
        (Some(total), None) => {
            return Err(format!("total noise {} needs its bandwidth: give `bandwidth`", shown(total)));
        }
        (None, _) => None,
    };
    let walk = sheet.random_walk.as_ref();
    let of_density = match (&sheet.noise_density, sides(sheet)) {
        (Some(density), Some(sides)) => {
            let (n, rule) = match sides {
                Sides::One => (times(density, 1.0 / SQRT_2), "is one-sided: N = density/sqrt(2)"),
                Sides::Two => (density.clone(), "is two-sided: N = density"),
            };
            let rule = format!("noise density {} {rule} = {}", shown(density), shown(&n));
            Some((n, rule))
        }
        (Some(density), None) if walk.is_none() => {
            return Err(format!(
                "the noise density {} may be one-sided (deviation in a band = density sqrt(band), as spectrum \
                 analysers show it) or two-sided (as an angle random walk \
                 is): a factor of sqrt(2) in N. Give `sided` one or `sided` two, or the angle random walk beside it, \
                 which tells",
                shown(density)
            ));
        }
        (Some(density), None) => {
            said.warnings.push(format!(
                "the noise density {} is neither the random walk nor sqrt(2) times it (ratio {}): the random walk is \
                 taken",
                shown(density),
                walk.map_or_else(String::new, |walk| digits(density.si() / walk.si()))
            ));
            None
        }
        (None, _) => None,
    };
    let of_walk = walk.map(|walk| {
        let name = match sheet.quantity {
            Quantity::AngularRate => "angle random walk",
            Quantity::SpecificForce => "velocity random walk",
        };
        let unit = match sheet.quantity {
            Quantity::AngularRate => "deg/s/sqrt(Hz)",
            Quantity::SpecificForce => "m/s^2/sqrt(Hz)",
        };
        let also = crate::units::Unit::parse(unit)
            .map_or_else(|_| String::new(), |u| format!(" = {} {unit}", digits(u.from_si(walk.si()))));
        (walk.clone(), format!("{name} {}: N{also}", shown(walk)))
    });
    let mut found = [of_walk, of_density, of_total].into_iter().flatten();
    let (n, rule) = found
        .next()
        .ok_or("no white noise: give `angle_random_walk`, `noise_density` or `total_noise` with `bandwidth`")?;
    said.rule(rule);
    for (other, rule) in found {
        let ratio = other.si() / n.si();
        if (ratio - 1.0).abs() > ALIKE {
            said.warnings.push(format!("{rule}: {} times the N that is taken", digits(ratio)));
        } else {
            said.rule(format!("{rule}, which agrees"));
        }
    }
    Ok(n)
}

/// As said, or as the random walk beside it tells.
fn sides(sheet: &Datasheet) -> Option<Sides> {
    let told = || {
        let ratio = sheet.noise_density.as_ref()?.si() / sheet.random_walk.as_ref()?.si();
        [(Sides::One, SQRT_2), (Sides::Two, 1.0)]
            .into_iter()
            .find(|(_, at)| (ratio / at - 1.0).abs() < ALIKE)
            .map(|(sides, _)| sides)
    };
    sheet.sides.or_else(told)
}

/// Flicker, or a Gauss-Markov process where there is a correlation time.
fn drift(sheet: &Datasheet, said: &mut Said) -> Result<Option<TermEntry>, String> {
    let Some(given) = &sheet.bias_instability else {
        return match &sheet.correlation_time {
            Some(time) => Err(format!(
                "a correlation time of {} without a bias instability: give `bias_instability`",
                shown(time)
            )),
            None => Ok(None),
        };
    };
    let (factor, floor) = match sheet.instability {
        Instability::Floor => (1.0, "the floor of the Allan deviation".to_owned()),
        Instability::Coefficient => (
            FLICKER_FLOOR,
            format!("the coefficient B, of which the floor of the Allan deviation is {FLICKER_FLOOR:.4}"),
        ),
        Instability::Sigma => {
            let time =
                sheet.correlation_time.clone().ok_or("a bias instability that is a sigma needs `correlation_time`")?;
            said.rule(format!(
                "bias instability {}: the sigma of a Gauss-Markov drift of Tc = {}",
                shown(given),
                shown(&time)
            ));
            return Ok(Some(TermEntry::GaussMarkov { std_dev: given.clone(), correlation_time: time }));
        }
    };
    let is = format!("bias instability {} is {floor}", shown(given));
    Ok(Some(match &sheet.correlation_time {
        None => {
            let coefficient = times(given, factor / FLICKER_FLOOR);
            let by = if factor == 1.0 { format!(" = floor/{FLICKER_FLOOR:.4}") } else { String::new() };
            said.rule(format!("{is}: flicker B{by} = {}", shown(&coefficient)));
            TermEntry::BiasInstability { coefficient }
        }
        Some(time) => {
            let std_dev = times(given, factor / GAUSS_MARKOV_PEAK);
            said.rule(format!(
                "{is}: with Tc = {} the Gauss-Markov process whose Allan deviation rises to that floor, sigma = \
                 floor/{GAUSS_MARKOV_PEAK:.4} = {}",
                shown(time),
                shown(&std_dev)
            ));
            TermEntry::GaussMarkov { std_dev, correlation_time: time.clone() }
        }
    }))
}

/// What a log of this rate shows of noise in this bandwidth.
fn bandwidth(sheet: &Datasheet, white: &TermEntry, said: &mut Said) {
    let (Some(band), TermEntry::White { density }) = (noise_bandwidth(sheet), white) else { return };
    let half = 0.5 * sheet.sample_rate_hz;
    let shown_band = sheet.bandwidth.as_ref().map(shown).unwrap_or_default();
    if band > half * (1.0 + ALIKE) {
        let folded = times(density, (band / half).sqrt());
        said.warnings.push(format!(
            "the bandwidth of {shown_band} reaches beyond half the sample rate of {} Hz: where the sensor does not \
             average before it gives a sample, the noise above \
             folds into the log, which then shows N = {}",
            digits(sheet.sample_rate_hz),
            shown(&folded)
        ));
    } else if band < half * (1.0 - ALIKE) {
        said.warnings.push(format!(
            "the bandwidth of {shown_band} is below half the sample rate of {} Hz: neighbouring samples of a log are \
             alike, N holds for the low frequencies",
            digits(sheet.sample_rate_hz)
        ));
    }
}
