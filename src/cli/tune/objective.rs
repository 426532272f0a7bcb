//! What the parameters of a design are chosen by: flags.

use std::path::PathBuf;

use clap::ValueEnum;

use crate::tune::objective::Objective;

#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Choosing the parameters")]
pub(super) struct ObjectiveFlags {
    /// What the physical parameters are chosen by
    #[arg(long, value_enum, default_value_t = ObjectiveArg::Nominal)]
    pub(super) objective: ObjectiveArg,
    /// Parameters that stay as they are, such as gauss_markov.correlation_time, x.white or heading.std_dev
    #[arg(long, value_delimiter = ',', value_name = "NAME")]
    pub(super) hold: Vec<String>,
    /// Last share of each log that is not fitted to but foretold (likelihood, compare)
    #[arg(long, default_value_t = 1.0 / 3.0, value_name = "SHARE", allow_negative_numbers = true)]
    pub(super) held_out: f64,
    /// Objective likelihood: the identified intervals do not count
    #[arg(long)]
    pub(super) no_prior: bool,
    /// Rank designs (filter.json, or params.json as identified) on logs instead
    #[arg(long, num_args = 1.., value_name = "DESIGN|LOG")]
    pub(super) compare: Vec<PathBuf>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(super) enum ObjectiveArg {
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
    pub(super) fn objective(self) -> Objective {
        match self {
            ObjectiveArg::Nominal => Objective::Nominal,
            ObjectiveArg::Robust => Objective::Robust,
            ObjectiveArg::Likelihood => Objective::Likelihood,
            ObjectiveArg::Nees => Objective::Nees,
            ObjectiveArg::Als => Objective::Als,
        }
    }

    /// Whether it is found from logs.
    pub(super) fn needs_logs(self) -> bool {
        matches!(self, ObjectiveArg::Likelihood | ObjectiveArg::Als)
    }
}
