//! The kinds of noise, each described once: its names, its parameters with their dimensions, and what it is to a
//! filter.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The kinds of term, in the fixed order used everywhere (documents, tables, random streams).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    Quantization,
    White,
    MovingAverage,
    BandLimit,
    Oscillation,
    BiasInstability,
    GaussMarkov,
    RateRandomWalk,
    RateRamp,
}

/// What one parameter is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// How large the noise is. Enters the Allan variance as its square.
    Coefficient,
    /// Of a filter: an area ratio, no unit.
    Shape,
    /// Hz.
    Frequency,
    /// s.
    CorrelationTime,
}

/// All that is the same in every term of a kind.
struct Description {
    name: &'static str,
    short: &'static str,
    /// Keys in params.json and what they are, in the order of [`super::Term`]; the shape of a band limit is no single
    /// number and none of them.
    parameters: &'static [&'static str],
    roles: &'static [Role],
    /// The coefficient is in the unit of the quantity times so many roots of a second.
    half_seconds: i8,
    is_drift: bool,
}

const C: Role = Role::Coefficient;

/// In the order of [`Kind`].
#[rustfmt::skip]
const DESCRIPTIONS: [Description; 9] = [
    Description { name: "quantization", short: "quantization", half_seconds: 2, is_drift: false,
        parameters: &["coefficient"], roles: &[C] },
    Description { name: "white", short: "white", half_seconds: 1, is_drift: false,
        parameters: &["density"], roles: &[C] },
    Description { name: "moving_average", short: "ma", half_seconds: 1, is_drift: false,
        parameters: &["density"], roles: &[C] },
    Description { name: "band_limit", short: "bl", half_seconds: 1, is_drift: false,
        parameters: &["density"], roles: &[C] },
    Description { name: "oscillation", short: "osc", half_seconds: 0, is_drift: false,
        parameters: &["std_dev", "frequency", "correlation_time"], roles: &[C, Role::Frequency, Role::CorrelationTime] },
    Description { name: "bias_instability", short: "flicker", half_seconds: 0, is_drift: true,
        parameters: &["coefficient"], roles: &[C] },
    Description { name: "gauss_markov", short: "gm", half_seconds: 0, is_drift: true,
        parameters: &["std_dev", "correlation_time"], roles: &[C, Role::CorrelationTime] },
    Description { name: "rate_random_walk", short: "rrw", half_seconds: -1, is_drift: true,
        parameters: &["density"], roles: &[C] },
    Description { name: "rate_ramp", short: "ramp", half_seconds: -2, is_drift: true,
        parameters: &["slope"], roles: &[C] },
];

impl Kind {
    pub const ALL: [Kind; 9] = [
        Kind::Quantization,
        Kind::White,
        Kind::MovingAverage,
        Kind::BandLimit,
        Kind::Oscillation,
        Kind::BiasInstability,
        Kind::GaussMarkov,
        Kind::RateRandomWalk,
        Kind::RateRamp,
    ];

    fn description(self) -> &'static Description {
        &DESCRIPTIONS[self as usize]
    }

    /// The key in params.json, and the beginning of the names of its states.
    pub fn name(self) -> &'static str {
        self.description().name
    }

    /// The word in a model such as `white+gm`.
    pub fn short_name(self) -> &'static str {
        self.description().short
    }

    /// By either name.
    pub fn named(text: &str) -> Option<Kind> {
        Kind::ALL.into_iter().find(|kind| text == kind.name() || text == kind.short_name())
    }

    /// Keys of the parameters in params.json, in the order of [`super::Term`].
    pub fn parameters(self) -> &'static [&'static str] {
        self.description().parameters
    }

    /// What they are.
    pub fn roles(self) -> &'static [Role] {
        self.description().roles
    }

    /// The coefficient is in the unit of the quantity times so many roots of a second.
    pub fn half_seconds(self) -> i8 {
        self.description().half_seconds
    }

    /// Drift of the bias, which a filter estimates and takes off; else noise of the measurement, whatever states it
    /// needs.
    pub fn is_drift(self) -> bool {
        self.description().is_drift
    }

    /// Its states stand for it only together: flicker by a chain of processes, averages and filters by their memory.
    pub fn has_joint_states(self) -> bool {
        matches!(self, Kind::BiasInstability | Kind::MovingAverage | Kind::BandLimit)
    }

    /// The kind of noise that a state of a filter belongs to, by its name: `gauss_markov`, `gauss_markov.2`,
    /// `oscillation.quadrature`, of an aid with the aid's name before it, `heading.gauss_markov`.
    pub fn of_state(name: &str) -> Option<Kind> {
        let parts = || name.split('.');
        Kind::ALL.into_iter().find(|kind| parts().any(|part| part == kind.name()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn descriptions_stand_in_the_order_of_kinds() {
        for kind in Kind::ALL {
            assert_eq!(serde_json::to_value(kind).unwrap(), kind.name());
            assert_eq!(Kind::named(kind.short_name()), Some(kind));
        }
    }

    #[test]
    fn states_are_of_the_kind_in_their_name() {
        for (name, kind) in [
            ("gauss_markov", Some(Kind::GaussMarkov)),
            ("gauss_markov.2", Some(Kind::GaussMarkov)),
            ("rate_ramp.slope", Some(Kind::RateRamp)),
            ("heading.oscillation.quadrature", Some(Kind::Oscillation)),
            ("bias", None),
            ("my_gauss_markov_thing", None),
        ] {
            assert_eq!(Kind::of_state(name), kind, "{name}");
        }
    }
}
