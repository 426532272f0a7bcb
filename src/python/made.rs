//! Requests by name, and what comes of them: its document, its files, its texts. One row per command; no command is
//! known by more than its row.

use std::sync::{Mutex, PoisonError};

use anyhow::anyhow;
use kfdesign::cli::output::with_flags;
use kfdesign::export::junit;
use kfdesign::filter::FilterDesign;
use kfdesign::ops::montecarlo::{self, Judged, merge};
use kfdesign::ops::{
    airplane, allan, compare, datasheet, export, fly, identify, import, inflate, info, plan, replay, simulate, trim,
    tune,
};
use kfdesign::params::Params;
use kfdesign::report::{Report, html, terminal};
use kfdesign::view;
use serde::Serialize;
use serde::de::DeserializeOwned;

/// Characters in a line of a summary, as on a terminal.
const WIDTH: usize = 80;

type Shown = Box<dyn Fn(&str) -> anyhow::Result<Option<String>> + Send + Sync>;

/// What was made.
pub(crate) struct Made {
    /// Byte for byte what the command prints with its `json`.
    pub(crate) json: String,
    /// What the command writes with its `output`, where that is not the document above.
    pub(crate) file: Option<String>,
    /// Files of another program; of import, the parameters of every sensor.
    pub(crate) files: Vec<(Option<String>, String)>,
    /// Texts by name: `brief` and `full` as on a terminal, `page` of HTML, `figures` as SVG, `junit`.
    pub(crate) shown: Shown,
}

/// A request: unknown keys and kinds are refused in one line.
pub(crate) fn asked<R: DeserializeOwned>(request: &str) -> anyhow::Result<R> {
    serde_json::from_str(request).map_err(|error| {
        let text = error.to_string();
        // the text of a request is nobody's file: its line says nothing
        anyhow!("{}", text.rsplit_once(" at line ").map_or(text.as_str(), |(said, _)| said))
    })
}

fn pretty(document: &impl Serialize) -> anyhow::Result<String> {
    Ok(serde_json::to_string_pretty(document)? + "\n")
}

/// A result with its document; `view`: its report, with the title of its figures where it has such.
fn made<D: Send + Sync + 'static>(
    done: D,
    json: String,
    view: impl for<'a> Fn(&'a D) -> (Report<'a>, Option<String>) + Send + Sync + 'static,
) -> Made {
    let shown = move |name: &str| {
        let (report, figures) = view(&done);
        text(name, &report, figures)
    };
    Made { json, file: None, files: Vec::new(), shown: Box::new(shown) }
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

fn imported(found: kfdesign::import::Imported) -> anyhow::Result<Made> {
    let json = pretty(&found.sensors.first())?;
    let files: Vec<(Option<String>, String)> = found.sensors.iter().map(|params| (None, params.to_json())).collect();
    let file = files.first().map(|(_, text)| text.clone());
    Ok(Made { file, files, ..made(found, json, |found| (view::import::import(found), None)) })
}

pub(crate) fn make(name: &str, request: &str) -> anyhow::Result<Made> {
    #[derive(serde::Deserialize)]
    struct File {
        file: std::path::PathBuf,
    }
    Ok(match name {
        "params" => document(Params::read(&asked::<File>(request)?.file)?.to_json()),
        "design" => document(FilterDesign::read(&asked::<File>(request)?.file)?.to_json()),
        "info" => {
            let request: info::Request = asked(request)?;
            let (found, name) = (info::run(&request)?, request.log.display().to_string());
            let json = pretty(&found)?;
            made(found, json, move |found| (view::info::info(&name, found, true), None))
        }
        "allan" => {
            let done = allan::run(&asked(request)?)?;
            let json = pretty(&done.document)?;
            let title = format!("{}: {}", done.name, done.document.deviation.name());
            made(done, json, move |done| (view::allan::allan(&done.name, &done.axes), Some(title.clone())))
        }
        "identify" => {
            let done = identify::run(&asked(request)?)?;
            let (json, file) = (pretty(&done.document())?, Some(done.params.to_json()));
            let view = made(done, json, |done| {
                let title = format!("{}: overlapping Allan deviation", done.name());
                (view::identify::identify(&done.params, &done.axes, done.shared.as_ref()), Some(title))
            });
            Made { file, ..view }
        }
        "plan" => {
            let plan = plan::run(&asked(request)?)?;
            let json = pretty(&plan)?;
            made(plan, json, |plan| (view::plan::plan(plan), None))
        }
        "compare" => {
            let done = compare::run(&asked(request)?)?;
            let json = pretty(&done.0)?;
            made(done, json, |(found, unit)| (view::compare::compare(found, unit), Some("Model and log".into())))
        }
        "inflate" => {
            let done = inflate::run(&asked(request)?)?;
            let (json, file) = (pretty(&done.found)?, Some(done.params.to_json()));
            Made { file, ..made(done, json, |done| (view::inflate::inflate(&done.found, &done.unit), None)) }
        }
        "simulate" => {
            let summary = simulate::run(&asked(request)?)?;
            let json = pretty(&summary)?;
            made(summary, json, |summary| (view::simulate::simulate(summary), None))
        }
        "airplane" => {
            let check = airplane::run(&asked(request)?)?;
            let json = pretty(&check)?;
            made(check, json, |check| (view::airplane::airplane(check), None))
        }
        "trim" => {
            let done = trim::run(&asked(request)?)?;
            let json = pretty(&done.document)?;
            made(done, json, |done| (view::trim::trim(&done.linearized, &done.document), None))
        }
        "fly" => {
            let done = fly::run(&asked(request)?, true)?;
            let json = pretty(&done.report)?;
            made(done, json, |done| {
                let title = format!("Flight of {}", done.report.airplane);
                (view::fly::fly(&done.report, &done.header, done.lines.as_ref(), &done.stops), Some(title))
            })
        }
        "tune" => match tune::run(&asked(request)?)? {
            tune::Done::Linear(done) => {
                let (json, file) = (pretty(&done.document()?)?, Some(done.tuned.design.to_json()));
                let view = made(done, json, |done| (view::tune::tune(&done.shown()), Some("Tuned filter".into())));
                Made { file, ..view }
            }
            tune::Done::Attitude(tuned) => {
                let (json, file) = (pretty(&tune::attitude::document(&tuned)?)?, Some(tuned.design.to_json()));
                let name = asked::<tune::Request>(request)?.params.unwrap_or_default().display().to_string();
                Made { file, ..made(tuned, json, move |tuned| (view::tune::attitude(&name, tuned), None)) }
            }
        },
        "rank" => {
            let done = tune::compare::run(&asked(request)?)?;
            let json = pretty(&done.0)?;
            made(done, json, |(ranking, first)| (view::tune::ranking(ranking, first), None))
        }
        "replay" => {
            let request: replay::Request = asked(request)?;
            let filter = request.filter.display().to_string();
            match replay::run(&request)? {
                replay::Done::Linear(result, unit) => {
                    let json = pretty(&result)?;
                    made((result, unit), json, move |(result, unit)| {
                        (view::replay::replay(result, &filter, unit.as_ref()), Some("Replay".into()))
                    })
                }
                replay::Done::Attitude(result, design) => {
                    let json = pretty(&result)?;
                    made((result, design), json, |(result, design)| (view::replay::attitude(result, design), None))
                }
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
            let name = |path: Option<std::path::PathBuf>| path.map(|path| path.display().to_string());
            let files = done.files.into_iter().map(|file| (name(file.path), own(file.text))).collect();
            Made { files, ..document(pretty(&done.self_test)?) }
        }
        "import" => imported(import::run(&asked(request)?)?)?,
        "datasheet" => imported(datasheet::run(&asked(request)?)?)?,
        other => return Err(anyhow!("no command {other}")),
    })
}
