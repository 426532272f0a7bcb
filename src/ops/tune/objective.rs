//! What the parameters of a design are chosen by.

use clap::ValueEnum;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::tune::objective::Objective;

/// What the physical parameters of a design are chosen by.
#[derive(Clone, Debug, clap::Args, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[command(next_help_heading = "Choosing the parameters")]
pub struct ObjectiveFlags {
    /// What the physical parameters are chosen by
    #[arg(long, value_enum, default_value_t = ObjectiveArg::Nominal)]
    pub objective: ObjectiveArg,
    /// Parameters that stay as they are, such as gauss_markov.correlation_time, x.white or heading.std_dev
    #[arg(long, value_delimiter = ',', value_name = "NAME")]
    pub hold: Vec<String>,
    /// Last share of each log that is not fitted to but foretold (likelihood, compare)
    #[arg(long, default_value_t = 1.0 / 3.0, value_name = "SHARE", allow_negative_numbers = true)]
    pub held_out: f64,
    /// Objective likelihood: the identified intervals do not count
    #[arg(long)]
    pub no_prior: bool,
}

impl Default for ObjectiveFlags {
    fn default() -> ObjectiveFlags {
        ObjectiveFlags { objective: ObjectiveArg::Nominal, hold: vec![], held_out: 1.0 / 3.0, no_prior: false }
    }
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum ObjectiveArg {
    /// The identified numbers
    #[default]
    Nominal,
    /// The claimed sigma stays honest over the identified intervals, at the least price in accuracy
    Robust,
    /// Innovation likelihood of --log, with priors from the intervals
    Likelihood,
    /// Expected NEES and NIS are one under --truth, with the least movement
    Nees,
    /// Autocovariance least squares on --log: amounts of noise, not times
    Als,
}

impl ObjectiveArg {
    pub(crate) fn objective(self) -> Objective {
        match self {
            ObjectiveArg::Nominal => Objective::Nominal,
            ObjectiveArg::Robust => Objective::Robust,
            ObjectiveArg::Likelihood => Objective::Likelihood,
            ObjectiveArg::Nees => Objective::Nees,
            ObjectiveArg::Als => Objective::Als,
        }
    }

    /// Whether it is found from logs.
    pub(crate) fn needs_logs(self) -> bool {
        matches!(self, ObjectiveArg::Likelihood | ObjectiveArg::Als)
    }
}
