//! Requests by name, and what comes of them: its document, its texts, its files. One row per command; no command is
//! known by more than its row.

use std::sync::{Mutex, PoisonError};

use anyhow::Context;
use kfdesign::aircraft::airframe::check::AirplaneCheck;
use kfdesign::cli::output::with_flags;
use kfdesign::compare::Comparison;
use kfdesign::compare::designs::Ranking;
use kfdesign::export::junit;
use kfdesign::filter::FilterDesign;
use kfdesign::identify::log_plan::LogPlan;
use kfdesign::import::Imported;
use kfdesign::input::inspect::Inventory;
use kfdesign::ops::montecarlo::{self, Judged, merge};
use kfdesign::ops::{
    airplane, allan, compare, datasheet, export, fly, identify, import, inflate, info, plan, replay, simulate, trim,
    tune,
};
use kfdesign::report::{Report, html, terminal};
use kfdesign::simulate::Summary;
use kfdesign::units::Unit;
use kfdesign::view;
use serde::Serialize;
use serde::de::DeserializeOwned;

/// Characters in a line of a summary, as on a terminal.
const WIDTH: usize = 80;

/// What was made.
pub(crate) enum Made {
    Info(Inventory, String),
    Allan(allan::Done),
    Identify(identify::Done),
    Plan(LogPlan),
    Compare(Comparison, Unit),
    Inflate(inflate::Done),
    Simulate(Summary),
    Airplane(AirplaneCheck),
    Trim(Box<trim::Done>),
    Fly(fly::Done),
    Tune(tune::Done),
    Rank(Ranking, Box<FilterDesign>),
    Replay(replay::Done, String),
    OneRun(String),
    /// Completed when a page wants more of it.
    Judged(Box<Mutex<Judged>>),
    Export(export::Done, bool),
    Import(Imported),
}

/// A request: unknown keys and kinds are refused in one line.
pub(crate) fn asked<R: DeserializeOwned>(request: &str) -> anyhow::Result<R> {
    let mut reader = serde_json::Deserializer::from_str(request);
    let found = R::deserialize(&mut reader);
    found.map_err(|error| {
        // the text of a request is nobody's file: its line says nothing
        let text = error.to_string();
        anyhow::anyhow!("{}", text.rsplit_once(" at line ").map_or(text.as_str(), |(said, _)| said))
    })
}

pub(crate) fn make(name: &str, request: &str) -> anyhow::Result<Made> {
    Ok(match name {
        "info" => {
            let request: info::Request = asked(request)?;
            Made::Info(info::run(&request)?, request.log.display().to_string())
        }
        "allan" => Made::Allan(allan::run(&asked(request)?)?),
        "identify" => Made::Identify(identify::run(&asked(request)?)?),
        "plan" => Made::Plan(plan::run(&asked(request)?)?),
        "compare" => {
            let (comparison, unit) = compare::run(&asked(request)?)?;
            Made::Compare(comparison, unit)
        }
        "inflate" => Made::Inflate(inflate::run(&asked(request)?)?),
        "simulate" => Made::Simulate(simulate::run(&asked(request)?)?),
        "airplane" => Made::Airplane(airplane::run(&asked(request)?)?),
        "trim" => Made::Trim(Box::new(trim::run(&asked(request)?)?)),
        "fly" => Made::Fly(fly::run(&asked(request)?, true)?),
        "tune" => Made::Tune(tune::run(&asked(request)?)?),
        "rank" => {
            let (ranking, first) = tune::compare::run(&asked(request)?)?;
            Made::Rank(ranking, Box::new(first))
        }
        "replay" => {
            let request: replay::Request = asked(request)?;
            Made::Replay(replay::run(&request)?, request.filter.display().to_string())
        }
        "montecarlo" => {
            let request: montecarlo::Request = asked(request)?;
            match montecarlo::run(&request, &|| false)? {
                montecarlo::Done::One(said) => Made::OneRun(said),
                montecarlo::Done::Many(done) => Made::Judged(Box::new(Mutex::new(done.judge(&request.judging)?))),
            }
        }
        "merge" => {
            let request: merge::Request = asked(request)?;
            Made::Judged(Box::new(Mutex::new(merge::run(&request)?.judge(&request.judging)?)))
        }
        "export" => {
            let request: export::Request = asked(request)?;
            Made::Export(export::run(&request)?, request.to.is_code())
        }
        "import" => Made::Import(import::run(&asked(request)?)?),
        "datasheet" => Made::Import(datasheet::run(&asked(request)?)?),
        other => anyhow::bail!("no command {other}"),
    })
}

fn pretty(document: &impl Serialize) -> anyhow::Result<String> {
    Ok(serde_json::to_string_pretty(document)? + "\n")
}

impl Made {
    /// Byte for byte what the command prints with its `json`.
    pub(crate) fn json(&self) -> anyhow::Result<String> {
        match self {
            Made::Info(found, _) => pretty(found),
            Made::Allan(done) => pretty(&done.document),
            Made::Identify(done) => pretty(&done.document()),
            Made::Plan(plan) => pretty(plan),
            Made::Compare(comparison, _) => pretty(comparison),
            Made::Inflate(done) => pretty(&done.found),
            Made::Simulate(summary) => pretty(summary),
            Made::Airplane(check) => pretty(check),
            Made::Trim(done) => pretty(&done.document),
            Made::Fly(done) => pretty(&done.report),
            Made::Tune(tune::Done::Linear(done)) => pretty(&done.document()?),
            Made::Tune(tune::Done::Attitude(tuned)) => pretty(&tune::attitude::document(tuned)?),
            Made::Rank(ranking, _) => pretty(ranking),
            Made::Replay(replay::Done::Linear(result, _), _) => pretty(result),
            Made::Replay(replay::Done::Attitude(result, _), _) => pretty(result),
            Made::OneRun(said) => pretty(said),
            Made::Judged(judged) => Ok(judged.lock().unwrap_or_else(PoisonError::into_inner).json.clone()),
            Made::Export(done, _) => pretty(&done.self_test),
            Made::Import(found) => pretty(&found.sensors.first()),
        }
    }

    /// What the command writes with its `output`, where that is not the document above.
    pub(crate) fn file(&self) -> Option<String> {
        match self {
            Made::Identify(done) => Some(done.params.to_json()),
            Made::Inflate(done) => Some(done.params.to_json()),
            Made::Import(found) => Some(found.sensors.first()?.to_json()),
            Made::Tune(tune::Done::Linear(done)) => Some(done.tuned.design.to_json()),
            Made::Tune(tune::Done::Attitude(tuned)) => Some(tuned.design.to_json()),
            _ => None,
        }
    }

    /// Files of another program, whose words name options as a shell knows them; of import the second sensor.
    pub(crate) fn files(&self) -> Vec<(Option<String>, String)> {
        match self {
            Made::Export(done, code) => {
                let text = |text: &str| if *code { text.to_string() } else { with_flags(text).into_owned() };
                let name = |path: &Option<std::path::PathBuf>| path.as_ref().map(|path| path.display().to_string());
                done.files.iter().map(|file| (name(&file.path), text(&file.text))).collect()
            }
            Made::Import(found) => found.sensors.iter().map(|params| (None, params.to_json())).collect(),
            _ => Vec::new(),
        }
    }

    pub(crate) fn shown(&self, name: &str) -> anyhow::Result<Option<String>> {
        if let Made::Judged(judged) = self {
            let mut judged = judged.lock().unwrap_or_else(PoisonError::into_inner);
            return match name {
                "junit" => Ok(Some(junit::report(&judged.outcome)?)),
                "page" => {
                    judged.complete()?;
                    text(name, &view::montecarlo::montecarlo(judged.shown()), None)
                }
                _ => text(name, &view::montecarlo::montecarlo(judged.shown()), None),
            };
        }
        let (report, figures) = self.report().context("there is nothing to show")?;
        text(name, &report, figures)
    }

    /// With the title of its figures, where there are such.
    fn report(&self) -> Option<(Report<'_>, Option<String>)> {
        Some(match self {
            Made::Info(found, name) => (view::info::info(name, found, true), None),
            Made::Allan(done) => (
                view::allan::allan(&done.name, &done.axes),
                Some(format!("{}: {}", done.name, done.document.deviation.name())),
            ),
            Made::Identify(done) => (
                view::identify::identify(&done.params, &done.axes, done.shared.as_ref()),
                Some(format!("{}: overlapping Allan deviation", done.name())),
            ),
            Made::Plan(plan) => (view::plan::plan(plan), None),
            Made::Compare(comparison, unit) => {
                (view::compare::compare(comparison, unit), Some("Model and log".into()))
            }
            Made::Inflate(done) => (view::inflate::inflate(&done.found, &done.unit), None),
            Made::Simulate(summary) => (view::simulate::simulate(summary), None),
            Made::Airplane(check) => (view::airplane::airplane(check), None),
            Made::Trim(done) => (view::trim::trim(&done.linearized, &done.document), None),
            Made::Fly(done) => (
                view::fly::fly(&done.report, &done.header, done.lines.as_ref(), &done.stops),
                Some(format!("Flight of {}", done.report.airplane)),
            ),
            Made::Tune(tune::Done::Linear(done)) => (view::tune::tune(&done.shown()), Some("Tuned filter".into())),
            Made::Tune(tune::Done::Attitude(tuned)) => (view::tune::attitude("attitude", tuned), None),
            Made::Rank(ranking, first) => (view::tune::ranking(ranking, first), None),
            Made::Replay(replay::Done::Linear(result, unit), filter) => {
                (view::replay::replay(result, filter, unit.as_ref()), Some("Replay".into()))
            }
            Made::Replay(replay::Done::Attitude(result, design), _) => (view::replay::attitude(result, design), None),
            Made::Import(found) => (view::import::import(found), None),
            Made::OneRun(_) | Made::Judged(_) | Made::Export(..) => return None,
        })
    }
}

fn text(name: &str, report: &Report<'_>, figures: Option<String>) -> anyhow::Result<Option<String>> {
    Ok(match name {
        "brief" => Some(terminal::brief(report, "", WIDTH)),
        "full" => Some(terminal::full(report, None)),
        // byte for byte that of the command
        "page" => Some(with_flags(&html::page(report)?).into_owned()),
        "figures" => figures.map(|title| report.sheet(&title)),
        _ => None,
    })
}
