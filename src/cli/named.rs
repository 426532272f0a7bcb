//! Commands by name: a request as JSON becomes a document, and what else comes of it. One row per command; Python and
//! the workbench in the browser know of no other.

use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};

use anyhow::anyhow;
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

use super::output::with_flags;
use crate::export::junit;
use crate::filter::FilterDesign;
use crate::import::Imported;
use crate::ops::montecarlo::{self, Judged, merge};
use crate::ops::{
    airplane, allan, closed_loop, compare, datasheet, export, fly, identify, import, inflate, info, plan, replay,
    simulate, trim, tune,
};
use crate::params::Params;
use crate::report::{Report, html, terminal};
use crate::view;

/// Characters in a line of a summary, as on a terminal.
const WIDTH: usize = 80;

type Shown = Box<dyn Fn(&str) -> anyhow::Result<Option<String>> + Send + Sync>;

/// What was made.
pub struct Made {
    /// Byte for byte what the command prints with its `json`.
    pub json: String,
    /// What the command writes with its `output`, where that is not the document above.
    pub file: Option<String>,
    /// Files of another program; of import, the parameters of every sensor.
    pub files: Vec<(Option<String>, String)>,
    shown: Shown,
}

impl std::fmt::Debug for Made {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Made").field("json", &self.json).finish_non_exhaustive()
    }
}

impl Made {
    /// Texts by name: `brief` and `full` as on a terminal, `page` of HTML, `figures` as SVG, `junit`, `verdict` in a
    /// word, `curves` as JSON; `None` where there is none. It may take long: figures of runs are simulated.
    pub fn shown(&self, name: &str) -> anyhow::Result<Option<String>> {
        (self.shown)(name)
    }
}

/// A request: unknown keys and kinds are refused in one line.
pub fn asked<R: DeserializeOwned>(request: &str) -> anyhow::Result<R> {
    serde_json::from_str(request).map_err(|error| anyhow!(without_place(&error)))
}

/// The text of a request is nobody's file: its line says nothing.
pub fn without_place(error: &serde_json::Error) -> String {
    let text = error.to_string();
    let said = text.rsplit_once(" at line ").map_or(text.as_str(), |(said, _)| said);
    said.replace("unknown variant", "unknown value")
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
        Made { file, ..made(json, done, move |$d| ($view, Extra::from($title))) }
    }};
}

/// What there is of a result beside its report.
struct Extra<'a> {
    /// Of its figures.
    title: Option<String>,
    /// The numbers behind them.
    curves: Option<Box<dyn Fn() -> Value + 'a>>,
}

impl From<Option<String>> for Extra<'_> {
    fn from(title: Option<String>) -> Self {
        Extra { title, curves: None }
    }
}

fn made<D: Send + Sync + 'static>(
    json: String,
    done: D,
    view: impl for<'a> Fn(&'a D) -> (Report<'a>, Extra<'a>) + Send + Sync + 'static,
) -> Made {
    let shown = move |name: &str| {
        let (report, extra) = view(&done);
        match (name, extra.curves) {
            ("curves", curves) => Ok(curves.map(|curves| curves().to_string())),
            _ => text(name, &report, extra.title),
        }
    };
    Made { shown: Box::new(shown), ..document(json) }
}

fn text(name: &str, report: &Report<'_>, figures: Option<String>) -> anyhow::Result<Option<String>> {
    Ok(match name {
        "brief" => Some(terminal::brief(report, "", WIDTH)),
        "full" => Some(terminal::full(report, None)),
        // byte for byte that of the command
        "page" => Some(with_flags(&html::page(report)?).into_owned()),
        "verdict" => report.verdict.as_ref().map(|verdict| verdict.word.clone()),
        "figures" => figures.map(|title| report.sheet(&title)),
        _ => None,
    })
}

/// A document that is read and checked, and written as it is.
fn document(json: String) -> Made {
    Made { json, file: None, files: Vec::new(), shown: Box::new(|_| Ok(None)) }
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

/// `figures`: also work out what only they show. Errors: the request is none, or its work has failed; one line.
#[rustfmt::skip] // a table: one row, one command
pub fn make(name: &str, request: &str, figures: bool) -> anyhow::Result<Made> {
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
        "airplane" => row!(airplane::run(&asked(request)?)?; d => d; view::airplane::airplane(d);
            Some(format!("Level flight of {}", d.name))),
        "simulate" => row!(simulate::run(&asked(request)?)?; d => d; view::simulate::simulate(d); None),
        "trim" => row!(trim::run(&asked(request)?)?; d => d.document;
            view::trim::trim(&d.linearized, &d.document); None),
        "fly" => row!(fly::run(&asked(request)?, figures)?; d => d.report; view::fly::fly(&d.report, &d.header,
            d.lines.as_ref(), &d.stops); Some(format!("Flight of {}", d.report.airplane))),
        "loop" => row!(closed_loop::run(&asked(request)?, figures)?; d => d.judged.document;
            view::closed_loop::closed_loop(&d.judged, &d.drawn);
            Extra { title: Some(format!("Control loop of {}", d.judged.document.airplane)),
                curves: Some(Box::new(|| view::closed_loop::curves(&d.judged))) }),
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
                    view::replay::replay(&d.0, &filter, d.1.as_ref());
                    Extra { title: Some("Replay".into()), curves: Some(Box::new(|| view::replay::curves(&d.0))) }),
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
