//! `kfdesign schema`.

use clap::ValueEnum;

use super::{Status, allan, identify, output, plan, simulate, tune};
use crate::aircraft::airframe::AirplaneDocument;
use crate::aircraft::airframe::check::AirplaneCheck;
use crate::aircraft::control::document::LinearDocument;
use crate::aircraft::flight::{FlightDocument, FlightReport};
use crate::compare::Comparison;
use crate::compare::designs::Ranking;
use crate::compare::inflation::Inflation;
use crate::filter::{AttitudeDesign, FilterDesign};
use crate::input::inspect::Inventory;
use crate::montecarlo;
use crate::params::Params;
use crate::replay::ReplayResult;
use crate::replay::attitude::AttitudeReplay;

/// The JSON schema of a document
#[derive(Debug, clap::Args)]
#[command(after_help = "Example: kfdesign schema params > params.schema.json")]
pub struct Args {
    /// Which document
    #[arg(value_enum)]
    document: Document,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Document {
    /// params.json: noise parameters
    Params,
    /// filter.json: a filter design
    Filter,
    /// attitude.json: the filter of the plant attitude
    Attitude,
    /// airplane.json: an airplane
    Airplane,
    /// linear.json: steady flight and linear models
    Linear,
    /// What `airplane --json` prints
    AirplaneCheck,
    /// flight.json: an airplane, its air and its sensors
    Flight,
    /// What `fly --json` prints
    Fly,
    /// What `info --json` prints
    Info,
    /// What `allan --json` prints
    Allan,
    /// What `identify --json` prints
    Identify,
    /// What `plan --json` prints
    Plan,
    /// What `simulate --json` prints
    Simulation,
    /// What `tune --json` prints
    Tune,
    /// What `tune --plant attitude --json` prints
    TuneAttitude,
    /// What `tune --compare --json` prints
    Ranking,
    /// What `replay --json` prints
    Replay,
    /// What `replay --json` prints of an attitude filter
    AttitudeReplay,
    /// What `compare --json` prints
    Compare,
    /// What `inflate --json` prints
    Inflate,
    /// What `montecarlo` and `merge` write
    Montecarlo,
}

pub(super) fn run(args: &Args) -> anyhow::Result<Status> {
    output::print_json(&match args.document {
        Document::Params => Params::schema(),
        Document::Filter => FilterDesign::schema(),
        Document::Attitude => AttitudeDesign::schema(),
        Document::AttitudeReplay => schemars::schema_for!(AttitudeReplay).to_value(),
        Document::Airplane => AirplaneDocument::schema(),
        Document::Linear => schemars::schema_for!(LinearDocument).to_value(),
        Document::AirplaneCheck => schemars::schema_for!(AirplaneCheck).to_value(),
        Document::Flight => FlightDocument::schema(),
        Document::Fly => schemars::schema_for!(FlightReport).to_value(),
        Document::Montecarlo => montecarlo::document::schema(),
        Document::Compare => schemars::schema_for!(Comparison).to_value(),
        Document::Inflate => schemars::schema_for!(Inflation).to_value(),
        Document::Info => schemars::schema_for!(Inventory).to_value(),
        Document::Allan => schemars::schema_for!(allan::Document).to_value(),
        Document::Identify => schemars::schema_for!(identify::Document<'_>).to_value(),
        Document::Plan => schemars::schema_for!(plan::Document<'_>).to_value(),
        Document::Simulation => schemars::schema_for!(simulate::Summary).to_value(),
        Document::Tune => schemars::schema_for!(tune::Printed<'_>).to_value(),
        Document::TuneAttitude => schemars::schema_for!(tune::attitude::Printed<'_>).to_value(),
        Document::Ranking => schemars::schema_for!(Ranking).to_value(),
        Document::Replay => schemars::schema_for!(ReplayResult).to_value(),
    })?;
    Ok(Status::Done)
}
