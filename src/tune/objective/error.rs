//! Why an objective finds no parameters.

use crate::numerics::linalg::LinalgError;
use crate::tune::TuneError;

#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ObjectiveError {
    #[error(transparent)]
    Tune(#[from] TuneError),
    #[error("--hold {name}: there is no such parameter; there are {known}")]
    Hold { name: String, known: String },
    #[error("every parameter is held; nothing is left to be chosen")]
    AllHeld,
    #[error(
        "--objective robust: no interval of {names}, or one without an end; run identify first, which gives intervals, \
         on a log long enough to tell both ends, or hold what is known exactly (--hold NAME)"
    )]
    NoIntervals { names: String },
    #[error(
        "--objective {objective}: {axis}: nothing drifts, so that no error is left after a long time that could \
         be judged"
    )]
    NothingDrifts { objective: &'static str, axis: String },
    #[error(
        "--objective robust: {axis}: no parameters within the 99.7 % region of the identified ones are honest for \
         {percent} % of the sensors; the intervals are too wide to design on: record a longer log"
    )]
    OutOfReach { axis: String, percent: f64 },
    #[error("--objective nees needs the truth: --truth PARAMS")]
    NoTruth,
    #[error(
        "--objective nees: {axis}: in this truth the error of the filter grows without bound; the truth drifts in \
         a way that the filter does not know"
    )]
    Unbounded { axis: String },
    #[error("--objective {objective} needs a log: --log LOG")]
    NoLog { objective: &'static str },
    #[error("{log}: {message}")]
    Log { log: String, message: String },
    #[error("{axis}: {message}")]
    Als { axis: String, message: String },
    #[error("--held-out is {found}; expected a share of the log from 0 to 0.9")]
    HeldOut { found: f64 },
    #[error("{axis}: {source}")]
    Linalg { axis: String, source: LinalgError },
}
