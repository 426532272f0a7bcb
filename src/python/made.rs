//! Requests by name, and what comes of them: document, files, texts. One row per command, which is known nowhere else.

use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};

use anyhow::anyhow;
use kfdesign::cli::output::with_flags;
use kfdesign::export::junit;
use kfdesign::filter::FilterDesign;
use kfdesign::import::Imported;
use kfdesign::ops::montecarlo::{self, Judged, merge};
use kfdesign::ops::{
    allan, closed_loop, compare, datasheet, export, fly, identify, import, inflate, info, plan, replay, simulate, trim,
    tune,
};
use kfdesign::params::Params;
use kfdesign::report::{Report, html, terminal};
use kfdesign::view;
use pyo3::prelude::*;
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::job::call;

/// Characters in a line of a summary, as on a terminal.
const WIDTH: usize = 80;

type Shown = Box<dyn Fn(&str) -> anyhow::Result<Option<String>> + Send + Sync>;

/// What was made.
#[pyclass(frozen, name = "Outcome", module = "kfdesign._native")]
pub(crate) struct Made {
    /// Byte for byte what the command prints with its `json`.
    #[pyo3(get)]
    pub(crate) json: String,
    /// What the command writes with its `output`, where that is not the document above.
    #[pyo3(get)]
    pub(crate) file: Option<String>,
    /// Files of another program; of import, the parameters of every sensor.
    #[pyo3(get)]
    pub(crate) files: Vec<(Option<String>, String)>,
    #[pyo3(get)]
    pub(crate) notes: Vec<String>,
    pub(crate) shown: Shown,
}

#[pymethods]
impl Made {
    /// Texts by name: `brief` and `full` as on a terminal, `page` of HTML, `figures` as SVG, `junit`.
    fn shown(&self, py: Python<'_>, name: &str) -> PyResult<Option<String>> {
        // on threads of its own like any work: figures of runs are simulated
        Ok(call(py, &[], None, None, || (self.shown)(name))?.0)
    }
}

/// A request: unknown keys and kinds are refused in one line.
pub(crate) fn asked<R: DeserializeOwned>(request: &str) -> anyhow::Result<R> {
    serde_json::from_str(request).map_err(|error| {
        let text = error.to_string();
        // the text of a request is nobody's file: its line says nothing
        anyhow!("{}", text.split(" at line ").next().unwrap_or(&text).replace("unknown variant", "unknown value"))
    })
}

fn pretty(document: &impl Serialize) -> anyhow::Result<String> {
    Ok(serde_json::to_string_pretty(document)? + "\n")
}

/// The row of a command: its result; its document, its report and the title of its figures, if it has such, and what
/// is written of it, of the result by that name.
macro_rules! row {
    ($done:expr; $d:ident => $document:expr; $view:expr; $title:expr $(; $file:expr)?) => {{
        let done = $done;
        let $d = &done;
        let (json, file) = (pretty(&$document)?, None$(.or(Some($file)))?);
        Made { file, ..made(json, done, move |$d| ($view, $title)) }
    }};
}

fn made<D: Send + Sync + 'static>(
    json: String,
    done: D,
    view: impl for<'a> Fn(&'a D) -> (Report<'a>, Option<String>) + Send + Sync + 'static,
) -> Made {
    let shown = move |name: &str| {
        let (report, figures) = view(&done);
        text(name, &report, figures)
    };
    Made { shown: Box::new(shown), ..document(json) }
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

/// A document that is read and checked, and written as it is.
fn document(json: String) -> Made {
    Made { json, file: None, files: Vec::new(), notes: Vec::new(), shown: Box::new(|_| Ok(None)) }
}

fn judged(judged: Judged) -> Made {
    let json = judged.json.clone();
    // completed where a page wants more of it
    let judged = Mutex::new(judged);
    let shown = move |name: &str| {
        let mut judged = judged.lock().unwrap_or_else(PoisonError::into_inner);
        match name {
            "junit" => return Ok(Some(junit::report(&judged.outcome)?)),
            "page" => judged.complete()?,
            _ => {}
        }
        text(name, &view::montecarlo::montecarlo(judged.shown()), None)
    };
    Made { shown: Box::new(shown), ..document(json) }
}

fn imported(found: Imported) -> anyhow::Result<Made> {
    let files: Vec<(Option<String>, String)> = found.sensors.iter().map(|params| (None, params.to_json())).collect();
    let file = files.first().map(|(_, text)| text.clone());
    Ok(Made { file, files, ..row!(found; d => d.sensors.first(); view::import::import(d); None) })
}

#[rustfmt::skip] // a table: one row, one command
pub(crate) fn make(name: &str, request: &str) -> anyhow::Result<Made> {
    Ok(match name {
        "params" => document(Params::read(&asked::<PathBuf>(request)?)?.to_json()),
        "design" => document(FilterDesign::read(&asked::<PathBuf>(request)?)?.to_json()),
        "info" => { let name = asked::<info::Request>(request)?.log.display().to_string();
            row!(info::run(&asked(request)?)?; d => d; view::info::info(&name, d, true); None) }
        "allan" => row!(allan::run(&asked(request)?)?; d => d.document; view::allan::allan(&d.name, &d.axes);
            Some(format!("{}: {}", d.name, d.document.deviation.name()))),
        "identify" => row!(identify::run(&asked(request)?)?; d => d.document();
            view::identify::identify(&d.params, &d.axes, d.shared.as_ref());
            Some(format!("{}: overlapping Allan deviation", d.name())); d.params.to_json()),
        "plan" => row!(plan::run(&asked(request)?)?; d => d; view::plan::plan(d); None),
        "compare" => row!(compare::run(&asked(request)?)?; d => d.0; view::compare::compare(&d.0, &d.1);
            Some("Model and log".into())),
        "inflate" => row!(inflate::run(&asked(request)?)?; d => d.found;
            view::inflate::inflate(&d.found, &d.unit); None; d.params.to_json()),
        "simulate" => row!(simulate::run(&asked(request)?)?; d => d; view::simulate::simulate(d); None),
        "trim" => row!(trim::run(&asked(request)?)?; d => d.document;
            view::trim::trim(&d.linearized, &d.document); None),
        "fly" => row!(fly::run(&asked(request)?, true)?; d => d.report; view::fly::fly(&d.report, &d.header,
            d.lines.as_ref(), &d.stops); Some(format!("Flight of {}", d.report.airplane))),
        "loop" => row!(closed_loop::run(&asked(request)?, true)?; d => d.judged.document; view::closed_loop::
            closed_loop(&d.judged, &d.corners); Some(format!("Control loop of {}", d.judged.document.airplane))),
        "tune" => match tune::run(&asked(request)?)? {
            tune::Done::Linear(done) => row!(done; d => d.document()?; view::tune::tune(&d.shown());
                Some("Tuned filter".into()); d.tuned.design.to_json()),
            tune::Done::Attitude(done) => {
                let name = asked::<tune::Request>(request)?.params.unwrap_or_default().display().to_string();
                row!(done; d => tune::attitude::document(d)?; view::tune::attitude(&name, d); None; d.design.to_json())
            }
        },
        "rank" => row!(tune::compare::run(&asked(request)?)?; d => d.0; view::tune::ranking(&d.0, &d.1); None),
        "replay" => {
            let filter = asked::<replay::Request>(request)?.filter.display().to_string();
            match replay::run(&asked(request)?)? {
                replay::Done::Linear(result, unit) => row!((result, unit); d => d.0;
                    view::replay::replay(&d.0, &filter, d.1.as_ref()); Some("Replay".into())),
                replay::Done::Attitude(result, design) => row!((result, design); d => d.0;
                    view::replay::attitude(&d.0, &d.1); None),
            }
        }
        "montecarlo" => {
            let request: montecarlo::Request = asked(request)?;
            match montecarlo::run(&request, &|| false)? {
                montecarlo::Done::One(said) => document(pretty(&said)?),
                montecarlo::Done::Many(done) => judged(done.judge(&request.judging)?),
            }
        }
        "merge" => {
            let request: merge::Request = asked(request)?;
            judged(merge::run(&request)?.judge(&request.judging)?)
        }
        "export" => {
            let request: export::Request = asked(request)?;
            let done = export::run(&request)?;
            // the words of a file of parameters name options, as a shell knows them
            let own = |text: String| if request.to.is_code() { text } else { with_flags(&text).into_owned() };
            let name = |path: Option<PathBuf>| path.map(|path| path.display().to_string());
            let files = done.files.into_iter().map(|file| (name(file.path), own(file.text))).collect();
            Made { files, ..document(pretty(&done.self_test)?) }
        }
        "import" => imported(import::run(&asked(request)?)?)?,
        "datasheet" => imported(datasheet::run(&asked(request)?)?)?,
        other => return Err(anyhow!("no command {other}")),
    })
}
