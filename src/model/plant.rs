//! What is measured beside the sensor's own errors: the plant. One variant per plant, and nothing else names them.

use super::{ModelError, Named};
use crate::units::Quantity;

/// A plant that sensor errors are added to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Plant {
    /// The sensor rests: its true signal is zero, the measurement is the sum of its errors (seed paper, equation 2).
    Static,
}

impl Plant {
    pub const ALL: [Plant; 1] = [Plant::Static];

    /// The name in documents and flags.
    pub fn name(self) -> &'static str {
        match self {
            Plant::Static => "static",
        }
    }

    /// The plant of this name.
    pub fn parse(name: &str) -> Result<Plant, ModelError> {
        Plant::ALL.into_iter().find(|plant| plant.name() == name).ok_or_else(|| ModelError::UnknownPlant {
            found: name.to_owned(),
            known: Plant::ALL.map(Plant::name).join(", "),
        })
    }

    /// What the filter is given: a resting sensor has no input.
    pub fn inputs(self) -> Vec<Named> {
        match self {
            Plant::Static => Vec::new(),
        }
    }

    /// What the filter measures.
    pub fn measurements(self, quantity: Quantity) -> Vec<Named> {
        match self {
            Plant::Static => {
                let name = match quantity {
                    Quantity::AngularRate => "angular_rate",
                    Quantity::SpecificForce => "specific_force",
                };
                vec![Named { name: name.to_owned(), unit: quantity.si_unit().to_owned() }]
            }
        }
    }
}
