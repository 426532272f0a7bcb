//! The parameters of one axis as they are read.

use super::measured::Range;
use super::place::{KeyError, Object, Place};
use super::{AxisParams, Measured, NotIdentified, TemperatureEffect, TermEntry};
use crate::noise::Filter;
use crate::units::{Dimension, Quantity, Unit};

const TERM_KEYS: [&str; 9] = [
    "quantization",
    "white",
    "moving_average",
    "band_limit",
    "oscillation",
    "bias_instability",
    "gauss_markov",
    "rate_random_walk",
    "rate_ramp",
];

/// A longer average is a filter that a log at a lower rate would show as well; each sample is a state.
const LONGEST_AVERAGE: u64 = 64;

/// Noise terms of one axis. Each makes a state or two, and the work grows with the cube of their number: so many take
/// some ten seconds to tune, sixty took more than a minute. `identify` finds at most half as many.
const MOST_TERMS: usize = 24;

pub(super) fn axis(place: &Place<'_>, quantity: Quantity) -> Result<AxisParams, KeyError> {
    let mut known = vec!["name", "bias", "turn_on_bias", "temperature"];
    known.extend(TERM_KEYS);
    known.push("not_identified");
    let object = place.object(&known)?;
    let name = object.required("name")?;
    let text = name.text()?;
    if text.trim().is_empty() {
        return Err(name.error("the name of an axis must be readable"));
    }
    let base = quantity.dimension();
    let mut terms = Vec::new();
    for key in TERM_KEYS {
        let Some(place) = object.optional(key) else { continue };
        for item in place.one_or_many()? {
            if terms.len() == MOST_TERMS {
                return Err(item.error(format!(
                    "more than {MOST_TERMS} noise terms on one axis; join those of nearly one correlation \
                     time or frequency"
                )));
            }
            terms.push(term(key, &item, base)?);
        }
    }
    let turn_on_bias =
        object.optional("turn_on_bias").map(|p| positive(&p.object(&["std_dev"])?, "std_dev", base)).transpose()?;
    let not_identified = match object.optional("not_identified") {
        Some(place) => place.list()?.iter().map(|item| not_identified(item, base)).collect::<Result<Vec<_>, _>>()?,
        None => Vec::new(),
    };
    Ok(AxisParams {
        name: text.to_string(),
        bias: object.optional("bias").map(|p| Measured::from_place(&p, base, Range::Any)).transpose()?,
        turn_on_bias,
        temperature: object.optional("temperature").map(|p| temperature(&p, base)).transpose()?,
        terms,
        not_identified,
    })
}

fn temperature(place: &Place<'_>, base: Dimension) -> Result<TemperatureEffect, KeyError> {
    let object = place.object(&["coefficient", "reference", "span"])?;
    let of = |key: &str, dimension| Measured::from_place(&object.required(key)?, dimension, Range::Any);
    Ok(TemperatureEffect {
        coefficient: of("coefficient", base.per_temperature())?,
        reference: of("reference", Dimension::TEMPERATURE)?,
        span: positive(&object, "span", Dimension::TEMPERATURE)?,
    })
}

fn term(key: &str, place: &Place<'_>, base: Dimension) -> Result<TermEntry, KeyError> {
    Ok(match key {
        "quantization" => TermEntry::Quantization {
            coefficient: positive(&place.object(&["coefficient"])?, "coefficient", base.times_time(2))?,
        },
        "white" => TermEntry::White { density: positive(&place.object(&["density"])?, "density", base.times_time(1))? },
        "moving_average" => {
            let object = place.object(&["density", "samples"])?;
            let samples = object.required("samples")?;
            let count = samples.count()?;
            if !(2..=LONGEST_AVERAGE).contains(&count) {
                let expected = format!("expected 2 to {LONGEST_AVERAGE}; an average over one sample is 'white'");
                return Err(samples.error(format!("found {count}, {expected}")));
            }
            TermEntry::MovingAverage {
                density: positive(&object, "density", base.times_time(1))?,
                samples: count as u32,
            }
        }
        "band_limit" => {
            let object = place.object(&["density", "numerator", "denominator"])?;
            let numbers = |key: &str| -> Result<Vec<f64>, KeyError> {
                object.required(key)?.list()?.iter().map(Place::number).collect()
            };
            let filter = Filter::new(&numbers("numerator")?, &numbers("denominator")?);
            TermEntry::BandLimit {
                density: positive(&object, "density", base.times_time(1))?,
                filter: filter.or_else(|e| Err(object.required(e.name())?.error(e.to_string())))?,
            }
        }
        "oscillation" => {
            let object = place.object(&["std_dev", "frequency", "correlation_time"])?;
            TermEntry::Oscillation {
                std_dev: positive(&object, "std_dev", base)?,
                frequency: positive(&object, "frequency", Dimension::FREQUENCY)?,
                correlation_time: positive(&object, "correlation_time", Dimension::TIME)?,
            }
        }
        "bias_instability" => {
            TermEntry::BiasInstability { coefficient: positive(&place.object(&["coefficient"])?, "coefficient", base)? }
        }
        "gauss_markov" => {
            let object = place.object(&["std_dev", "correlation_time"])?;
            TermEntry::GaussMarkov {
                std_dev: positive(&object, "std_dev", base)?,
                correlation_time: positive(&object, "correlation_time", Dimension::TIME)?,
            }
        }
        "rate_random_walk" => TermEntry::RateRandomWalk {
            density: positive(&place.object(&["density"])?, "density", base.times_time(-1))?,
        },
        _ => {
            let slope = place.object(&["slope"])?.required("slope")?;
            TermEntry::RateRamp { slope: Measured::from_place(&slope, base.times_time(-2), Range::Any)? }
        }
    })
}

fn positive(object: &Object<'_>, key: &str, expected: Dimension) -> Result<Measured, KeyError> {
    Measured::from_place(&object.required(key)?, expected, Range::Positive)
}

fn not_identified(place: &Place<'_>, base: Dimension) -> Result<NotIdentified, KeyError> {
    let object = place.object(&["term", "reason", "needed_log", "upper_limit"])?;
    let limit = |place: Place<'_>| Measured::from_place(&place, base.times_time(-1), Range::Positive);
    Ok(NotIdentified {
        term: object.required("term")?.text()?.to_string(),
        reason: object.required("reason")?.text()?.to_string(),
        needed_log_s: seconds(&object, "needed_log")?,
        upper_limit: object.optional("upper_limit").map(limit).transpose()?,
    })
}

pub(super) fn seconds(object: &Object<'_>, key: &str) -> Result<Option<f64>, KeyError> {
    let place = object.optional(key);
    place.map(|p| Ok(Measured::from_place(&p, Dimension::TIME, Range::Positive)?.si())).transpose()
}

pub(super) fn in_unit(value: f64, unit: &str) -> Option<Measured> {
    Unit::parse(unit).ok().map(|unit| Measured { value, unit, interval: None })
}
