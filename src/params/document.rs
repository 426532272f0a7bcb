//! params.json itself: what is written, what is read, the schema.

use std::borrow::Cow;

use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::{Serialize, Serializer};

use super::axis::{axis, in_unit};
use super::measured::Range;
use super::place::{KeyError, Place};
use super::source::{SourceDocument, source};
use super::{AxisParams, Design, Measured, Params, TemperatureEffect, TermEntry};
use crate::units::{Dimension, Quantity};

pub(super) const FORMAT: &str = "kfdesign-params/1";

#[derive(Serialize, JsonSchema)]
enum Format {
    #[serde(rename = "kfdesign-params/1")]
    Params1,
}

/// Noise parameters of an inertial sensor.
#[derive(Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "Params")]
pub(crate) struct ParamsDocument {
    format: Format,
    quantity: Quantity,
    /// Frequency, for example "100 Hz".
    sample_rate: Measured,
    #[schemars(length(min = 1))]
    axes: Vec<AxisDocument>,
    /// The plant that the sensor is part of, and its aids; at rest when absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    design: Option<Design>,
    #[serde(skip_serializing_if = "Option::is_none")]
    source: Option<SourceDocument>,
}

/// One axis: its bias and the noise terms that are present.
#[derive(Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "AxisParams")]
struct AxisDocument {
    /// Unique in the document.
    name: String,
    /// Constant bias.
    #[serde(skip_serializing_if = "Option::is_none")]
    bias: Option<Measured>,
    /// Spread of the bias from one power-up to the next.
    #[serde(skip_serializing_if = "Option::is_none")]
    turn_on_bias: Option<StdDev>,
    /// How the bias followed the temperature of the log. The noise terms are those of the log as it is: this changes
    /// none of them.
    #[serde(skip_serializing_if = "Option::is_none")]
    temperature: Option<TemperatureDocument>,
    #[serde(skip_serializing_if = "Option::is_none")]
    quantization: Option<OneOrMany<Coefficient>>,
    /// Root of the two-sided power spectral density.
    #[serde(skip_serializing_if = "Option::is_none")]
    white: Option<OneOrMany<Density>>,
    /// White noise that the sensor has averaged over neighbouring samples.
    #[serde(skip_serializing_if = "Option::is_none")]
    moving_average: Option<OneOrMany<MovingAverage>>,
    /// White noise behind a digital filter: an anti-alias filter, a low-pass in the sensor.
    #[serde(skip_serializing_if = "Option::is_none")]
    band_limit: Option<OneOrMany<BandLimit>>,
    /// Vibration lines.
    #[serde(skip_serializing_if = "Option::is_none")]
    oscillation: Option<OneOrMany<Oscillation>>,
    /// Flicker: the Allan deviation's floor is 0.664 times the coefficient.
    #[serde(skip_serializing_if = "Option::is_none")]
    bias_instability: Option<OneOrMany<Coefficient>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    gauss_markov: Option<OneOrMany<GaussMarkov>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    rate_random_walk: Option<OneOrMany<Density>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    rate_ramp: Option<OneOrMany<Slope>>,
    /// What the log cannot tell.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    not_identified: Vec<NotIdentifiedDocument>,
}

/// bias + coefficient · (temperature − reference).
#[derive(Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "Temperature")]
struct TemperatureDocument {
    /// Change of the bias with temperature, for example "0.01 deg/s/degC".
    coefficient: Measured,
    /// Mean temperature of the log, to which its bias belongs.
    reference: Measured,
    /// Highest less lowest temperature of the log.
    span: Measured,
}

#[derive(Serialize, JsonSchema)]
#[serde(untagged)]
enum OneOrMany<T> {
    One(T),
    Many(Vec<T>),
}

#[derive(Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct StdDev {
    std_dev: Measured,
}

#[derive(Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Density {
    density: Measured,
}

/// Mean of as many independent samples; the density is that at low frequencies.
#[derive(Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct MovingAverage {
    density: Measured,
    #[schemars(range(min = 2, max = 64))]
    samples: u32,
}

/// White noise of this density at low frequencies behind a filter b/a, as `scipy.signal` and MATLAB write it, at the
/// sample rate of the document.
#[derive(Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct BandLimit {
    density: Measured,
    /// b₀, b₁ …: coefficients of z⁰, z⁻¹ …; any common factor.
    #[schemars(length(min = 1, max = 9))]
    numerator: Vec<f64>,
    /// a₀, a₁ …: stable.
    #[schemars(length(min = 1, max = 9))]
    denominator: Vec<f64>,
}

#[derive(Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Coefficient {
    coefficient: Measured,
}

#[derive(Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Slope {
    slope: Measured,
}

/// Second-order Gauss-Markov process: autocovariance std_dev² exp(−|τ|/correlation_time) cos(2π frequency τ).
#[derive(Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Oscillation {
    std_dev: Measured,
    /// Below half the sample rate.
    frequency: Measured,
    correlation_time: Measured,
}

/// First-order Gauss-Markov process: stationary standard deviation and 1/e correlation time.
#[derive(Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct GaussMarkov {
    std_dev: Measured,
    correlation_time: Measured,
}

#[derive(Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "NotIdentified")]
struct NotIdentifiedDocument {
    /// The term, or one of its parameters: "gauss_markov.correlation_time".
    term: String,
    reason: String,
    /// Length of log that would tell.
    #[serde(skip_serializing_if = "Option::is_none")]
    needed_log: Option<Measured>,
    /// Of "rate_random_walk": the largest density that would not have shown in the log (95 %).
    #[serde(skip_serializing_if = "Option::is_none")]
    upper_limit: Option<Measured>,
}

/// One object for a single term, a list for more.
fn one_or_many<T>(mut items: Vec<T>) -> Option<OneOrMany<T>> {
    if items.len() > 1 { Some(OneOrMany::Many(items)) } else { items.pop().map(OneOrMany::One) }
}

/// A list even of one.
fn list<T>(items: Vec<T>) -> Option<OneOrMany<T>> {
    (!items.is_empty()).then_some(OneOrMany::Many(items))
}

impl From<&AxisParams> for AxisDocument {
    fn from(axis: &AxisParams) -> Self {
        let (mut quantization, mut white, mut bias_instability) = (Vec::new(), Vec::new(), Vec::new());
        let (mut moving_average, mut band_limit, mut oscillation) = (Vec::new(), Vec::new(), Vec::new());
        let (mut gauss_markov, mut rate_random_walk, mut rate_ramp) = (Vec::new(), Vec::new(), Vec::new());
        for term in axis.terms.iter().cloned() {
            match term {
                TermEntry::Quantization { coefficient } => quantization.push(Coefficient { coefficient }),
                TermEntry::White { density } => white.push(Density { density }),
                TermEntry::MovingAverage { density, samples } => {
                    moving_average.push(MovingAverage { density, samples });
                }
                TermEntry::BandLimit { density, filter } => band_limit.push(BandLimit {
                    density,
                    numerator: filter.numerator().to_vec(),
                    denominator: filter.denominator().to_vec(),
                }),
                TermEntry::Oscillation { std_dev, frequency, correlation_time } => {
                    oscillation.push(Oscillation { std_dev, frequency, correlation_time });
                }
                TermEntry::BiasInstability { coefficient } => bias_instability.push(Coefficient { coefficient }),
                TermEntry::GaussMarkov { std_dev, correlation_time } => {
                    gauss_markov.push(GaussMarkov { std_dev, correlation_time });
                }
                TermEntry::RateRandomWalk { density } => rate_random_walk.push(Density { density }),
                TermEntry::RateRamp { slope } => rate_ramp.push(Slope { slope }),
            }
        }
        AxisDocument {
            name: axis.name.clone(),
            bias: axis.bias.clone(),
            turn_on_bias: axis.turn_on_bias.clone().map(|std_dev| StdDev { std_dev }),
            temperature: axis.temperature.clone().map(|TemperatureEffect { coefficient, reference, span }| {
                TemperatureDocument { coefficient, reference, span }
            }),
            quantization: one_or_many(quantization),
            white: one_or_many(white),
            moving_average: one_or_many(moving_average),
            band_limit: one_or_many(band_limit),
            oscillation: list(oscillation),
            bias_instability: one_or_many(bias_instability),
            gauss_markov: list(gauss_markov),
            rate_random_walk: one_or_many(rate_random_walk),
            rate_ramp: one_or_many(rate_ramp),
            not_identified: axis
                .not_identified
                .iter()
                .map(|n| NotIdentifiedDocument {
                    term: n.term.clone(),
                    reason: n.reason.clone(),
                    needed_log: n.needed_log_s.and_then(|s| in_unit(s, "s")),
                    upper_limit: n.upper_limit.clone(),
                })
                .collect(),
        }
    }
}

impl Serialize for AxisParams {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        AxisDocument::from(self).serialize(serializer)
    }
}

impl JsonSchema for AxisParams {
    fn schema_name() -> Cow<'static, str> {
        AxisDocument::schema_name()
    }
    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        AxisDocument::json_schema(generator)
    }
}

impl JsonSchema for Params {
    fn schema_name() -> Cow<'static, str> {
        ParamsDocument::schema_name()
    }
    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        ParamsDocument::json_schema(generator)
    }
}

impl Serialize for Params {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let hertz = in_unit(self.sample_rate_hz, "Hz").ok_or_else(|| serde::ser::Error::custom("Hz is a unit"))?;
        ParamsDocument {
            format: Format::Params1,
            quantity: self.quantity,
            sample_rate: hertz,
            axes: self.axes.iter().map(AxisDocument::from).collect(),
            design: self.design.clone(),
            source: self.source.as_ref().map(SourceDocument::from),
        }
        .serialize(serializer)
    }
}

/// Axes of one document: sixteen sensors of three axes and some more.
const MOST_AXES: usize = 64;

/// The whole document.
pub(super) fn params(root: &Place<'_>) -> Result<Params, KeyError> {
    let object =
        root.document(FORMAT, "a parameter file", &["format", "quantity", "sample_rate", "axes", "design", "source"])?;
    let quantity = quantity(&object.required("quantity")?)?;
    let sample_rate = object.required("sample_rate")?;
    let sample_rate_hz = Measured::from_place(&sample_rate, Dimension::FREQUENCY, Range::Positive)?.si();
    let list = object.required("axes")?;
    let places = list.list()?;
    if places.len() > MOST_AXES {
        return Err(list.error(format!("{} axes; expected at most {MOST_AXES}", places.len())));
    }
    let axes = places.iter().map(|p| axis(p, quantity)).collect::<Result<Vec<_>, _>>()?;
    if axes.is_empty() {
        return Err(list.error("there is no axis; at least one is needed"));
    }
    for (i, later) in axes.iter().enumerate() {
        if let Some(j) = axes[..i].iter().position(|earlier| earlier.name == later.name) {
            let key = format!("axes[{i}].name");
            return Err(KeyError { key, message: format!("'{}' is the name of axes[{j}] too", later.name) });
        }
    }
    let source = object.optional("source").map(|p| source(&p)).transpose()?;
    let design = object.optional("design").map(|p| Design::from_place(&p)).transpose()?;
    Ok(Params { quantity, sample_rate_hz, axes, design, source })
}

pub(crate) fn quantity(place: &Place<'_>) -> Result<Quantity, KeyError> {
    match place.text()? {
        "angular-rate" => Ok(Quantity::AngularRate),
        "specific-force" => Ok(Quantity::SpecificForce),
        other => Err(place.error(format!("expected \"angular-rate\" or \"specific-force\", found \"{other}\""))),
    }
}
