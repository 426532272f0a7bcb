//! `kfdesign schema`.

use clap::ValueEnum;

use super::{Status, output};
use crate::aircraft::airframe::AirplaneDocument;
use crate::aircraft::airframe::check::AirplaneCheck;
use crate::aircraft::closed_loop::document::LoopDocument;
use crate::aircraft::control::document::LinearDocument;
use crate::aircraft::flight::{FlightDocument, FlightReport};
use crate::compare::Comparison;
use crate::compare::designs::Ranking;
use crate::compare::inflation::Inflation;
use crate::filter::{AttitudeDesign, FilterDesign};
use crate::identify::log_plan::LogPlan;
use crate::input::inspect::Inventory;
use crate::montecarlo;
use crate::ops::montecarlo as runs;
use crate::ops::{
    airplane, allan, closed_loop, compare, datasheet, export, fly, identify, import, inflate, info, plan, replay,
    simulate, trim, tune,
};
use crate::params::Params;
use crate::replay::ReplayResult;
use crate::replay::attitude::AttitudeReplay;
use crate::simulate::Summary;

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
    /// What `loop --json` prints
    Loop,
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
    /// What `tune --rank --json` prints
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
    /// What `allan` is asked for
    AllanRequest,
    /// What `identify` is asked for
    IdentifyRequest,
    /// What `plan` is asked for
    PlanRequest,
    /// What `compare` is asked for
    CompareRequest,
    /// What `inflate` is asked for
    InflateRequest,
    /// What `simulate` is asked for
    SimulateRequest,
    /// What `tune` is asked for
    TuneRequest,
    /// What `replay` is asked for
    ReplayRequest,
    /// What `info` is asked for
    InfoRequest,
    /// What `airplane` is asked for
    AirplaneRequest,
    /// What `trim` is asked for
    TrimRequest,
    /// What `fly` is asked for
    FlyRequest,
    /// What `montecarlo` is asked for
    MontecarloRequest,
    /// What `merge` is asked for
    MergeRequest,
    /// What `export` is asked for
    ExportRequest,
    /// What `import` is asked for
    ImportRequest,
    /// What `datasheet` is asked for
    DatasheetRequest,
    /// What `loop` is asked for
    LoopRequest,
}

pub(super) fn run(args: &Args) -> anyhow::Result<Status> {
    output::print_json(&match args.document {
        Document::Params => Params::schema(),
        Document::Filter => FilterDesign::schema(),
        Document::Attitude => AttitudeDesign::schema(),
        Document::AttitudeReplay => printed::<AttitudeReplay>(),
        Document::Airplane => AirplaneDocument::schema(),
        Document::Linear => printed::<LinearDocument>(),
        Document::AirplaneCheck => printed::<AirplaneCheck>(),
        Document::Flight => FlightDocument::schema(),
        Document::Fly => printed::<FlightReport>(),
        Document::Loop => printed::<LoopDocument>(),
        Document::Montecarlo => montecarlo::document::schema(),
        Document::Compare => printed::<Comparison>(),
        Document::Inflate => printed::<Inflation>(),
        Document::Info => printed::<Inventory>(),
        Document::Allan => printed::<allan::Document>(),
        Document::Identify => printed::<identify::Document<'_>>(),
        Document::Plan => printed::<LogPlan>(),
        Document::Simulation => printed::<Summary>(),
        Document::Tune => printed::<tune::Document<'_>>(),
        Document::TuneAttitude => printed::<tune::attitude::Document<'_>>(),
        Document::Ranking => printed::<Ranking>(),
        Document::Replay => printed::<ReplayResult>(),
        Document::AllanRequest => asked::<allan::Request>(),
        Document::IdentifyRequest => asked::<identify::Request>(),
        Document::PlanRequest => asked::<plan::Request>(),
        Document::CompareRequest => asked::<compare::Request>(),
        Document::InflateRequest => asked::<inflate::Request>(),
        Document::SimulateRequest => asked::<simulate::Request>(),
        Document::TuneRequest => asked::<tune::Request>(),
        Document::ReplayRequest => asked::<replay::Request>(),
        Document::InfoRequest => asked::<info::Request>(),
        Document::AirplaneRequest => asked::<airplane::Request>(),
        Document::TrimRequest => asked::<trim::Request>(),
        Document::FlyRequest => asked::<fly::Request>(),
        Document::MontecarloRequest => asked::<runs::Request>(),
        Document::MergeRequest => asked::<runs::merge::Request>(),
        Document::ExportRequest => asked::<export::Request>(),
        Document::ImportRequest => asked::<import::Request>(),
        Document::DatasheetRequest => asked::<datasheet::Request>(),
        Document::LoopRequest => asked::<closed_loop::Request>(),
    })?;
    Ok(Status::Done)
}

/// The schema of a document that is only written: what it leaves out when there is none is not required.
fn printed<T: schemars::JsonSchema>() -> serde_json::Value {
    schemars::generate::SchemaSettings::draft2020_12()
        .for_serialize()
        .into_generator()
        .into_root_schema_for::<T>()
        .to_value()
}

/// The schema of what is read.
fn asked<T: schemars::JsonSchema>() -> serde_json::Value {
    schemars::schema_for!(T).to_value()
}
