//! What the page may ask for.

use std::convert::Infallible;
use std::io::Write;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use axum::body::Bytes;
use axum::extract::{DefaultBodyLimit, Path, Query, Request as Asked, State as With};
use axum::http::header::{CONTENT_TYPE, ETAG, HeaderMap, IF_NONE_MATCH};
use axum::http::{Method, StatusCode};
use axum::response::sse::{Event, Sse};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post, put};
use axum::{Json, Router};
use futures_util::{Stream, StreamExt, stream};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::{Value, json};
use tokio::task::spawn_blocking;
use tokio::time::timeout;

use super::guard::{BODY_TIME, LARGEST_REQUEST};
use super::jobs::{Job, Jobs, Seen};
use super::series::{self, Series};
use super::{Options, Refused, curve, folder, page};
use crate::cli::in_one_line;
use crate::cli::named::without_place;

/// Between two looks at a job that is followed: a person sees no more.
const TICK: Duration = Duration::from_millis(100);
/// After so many ticks without news the browser hears that the server is there.
const TICKS_OF_SILENCE: u32 = 150;

/// A report has its style with it; it may do nothing else, and is no part of the workbench.
const OF_REPORTS: &str = "default-src 'none'; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; \
                          form-action 'none'; frame-ancestors 'self'; sandbox";

/// What routes know.
#[derive(Debug)]
pub(super) struct Workbench {
    pub(super) jobs: Arc<Jobs>,
    series: Series,
    read_only: bool,
    upload_limit: u64,
    folder: String,
    /// Requests so far.
    pub(super) requests: AtomicU64,
}

type Bench = With<Arc<Workbench>>;

impl Workbench {
    pub(super) fn new(options: &Options<'_>, jobs: Arc<Jobs>) -> Workbench {
        let folder = std::env::current_dir().unwrap_or_default();
        Workbench {
            jobs,
            series: Series::default(),
            read_only: options.read_only,
            upload_limit: options.upload_limit,
            folder: folder.display().to_string(),
            requests: AtomicU64::new(0),
        }
    }

    fn may_write(&self) -> Result<(), Refused> {
        let refused = || Refused::forbidden("this folder is served read-only".into());
        if self.read_only { Err(refused()) } else { Ok(()) }
    }

    fn job(&self, id: u64) -> Result<Arc<Job>, Refused> {
        self.jobs.get(id).ok_or_else(|| Refused::new(StatusCode::NOT_FOUND, format!("job {id}: not there any more")))
    }
}

pub(super) fn routes(workbench: Arc<Workbench>) -> Router {
    let counted = Arc::clone(&workbench);
    Router::new()
        .route("/api/project", get(project))
        .route("/api/jobs", post(add))
        .route("/api/jobs/{id}", get(seen).delete(stop))
        .route("/api/jobs/{id}/events", get(events))
        .route("/api/jobs/{id}/save", post(save_of))
        .route("/api/jobs/{id}/{what}", get(part))
        .route("/api/preview", post(preview))
        .route("/api/curve", post(curve_of))
        .route("/api/series", get(series_of))
        .route("/api/document", get(document))
        .route("/api/save", post(save))
        .layer(DefaultBodyLimit::max(LARGEST_REQUEST))
        // its body is counted where it is written
        .route("/api/upload/{name}", put(upload).layer(DefaultBodyLimit::disable()))
        .fallback(asset)
        .layer(axum::middleware::from_fn(move |request: Asked, next: axum::middleware::Next| {
            counted.requests.fetch_add(1, Ordering::Relaxed);
            next.run(request)
        }))
        .with_state(workbench)
}

/// JSON of a body: unknown keys and kinds are refused in one line.
fn body<T: DeserializeOwned>(bytes: &Bytes) -> Result<T, Refused> {
    serde_json::from_slice(bytes).map_err(|error| Refused::new(StatusCode::BAD_REQUEST, without_place(&error)))
}

/// On a thread that may wait.
async fn blocking<T: Send + 'static>(work: impl FnOnce() -> Result<T, Refused> + Send + 'static) -> Result<T, Refused> {
    let done = spawn_blocking(work).await;
    done.unwrap_or_else(|_| Err(Refused::failed("a defect of kfdesign: this work ended without a result".into())))
}

async fn asset(request: Asked) -> Result<Response, Refused> {
    if ![Method::GET, Method::HEAD].contains(request.method()) {
        return Err(Refused::new(StatusCode::METHOD_NOT_ALLOWED, "no such method here"));
    }
    let found = page::file(request.uri().path().trim_start_matches('/'));
    let (kind, bytes) = found.ok_or_else(|| Refused::new(StatusCode::NOT_FOUND, "not found"))?;
    Ok(([(CONTENT_TYPE, kind)], bytes).into_response())
}

async fn project(With(bench): Bench) -> Result<Json<Value>, Refused> {
    let files = blocking(|| Ok(folder::list())).await?;
    Ok(Json(json!({
        "version": env!("CARGO_PKG_VERSION"),
        "folder": bench.folder,
        "read_only": bench.read_only,
        "files": files,
        "jobs": bench.jobs.all(),
    })))
}

async fn add(With(bench): Bench, bytes: Bytes) -> Result<(StatusCode, Json<Seen>), Refused> {
    let asked: folder::Asked = body(&bytes)?;
    let own = Arc::clone(&bench);
    let asked = blocking(move || asked.prepared(own.read_only)).await?;
    let full = || Refused::new(StatusCode::TOO_MANY_REQUESTS, "too many jobs wait: stop one, or wait for one");
    let job = bench.jobs.add(asked).ok_or_else(full)?;
    Ok((StatusCode::ACCEPTED, Json(job.seen())))
}

async fn seen(With(bench): Bench, Path(id): Path<u64>) -> Result<Json<Seen>, Refused> {
    Ok(Json(bench.job(id)?.seen()))
}

async fn stop(With(bench): Bench, Path(id): Path<u64>) -> Result<Json<Seen>, Refused> {
    let job = bench.job(id)?;
    job.stop();
    Ok(Json(job.seen()))
}

/// The job whenever it has changed, until it ends.
async fn events(
    With(bench): Bench,
    Path(id): Path<u64>,
) -> Result<Sse<impl Stream<Item = Result<Event, Infallible>>>, Refused> {
    let job = bench.job(id)?;
    let news = stream::unfold((job, None, false), |(job, told, over)| async move {
        if over {
            return None;
        }
        let mut silent = 0;
        loop {
            let changes = job.changes.load(Ordering::Acquire);
            if told != Some(changes) {
                let seen = job.seen();
                let over = seen.state.is_final();
                let event = Event::default().event(seen.state.name()).id(changes.to_string()).json_data(seen);
                return Some((Ok(event.unwrap_or_default()), (job, Some(changes), over)));
            }
            silent += 1;
            if silent == TICKS_OF_SILENCE {
                return Some((Ok(Event::default().comment("")), (job, told, false)));
            }
            tokio::time::sleep(TICK).await;
        }
    });
    // not more often than a person sees
    let paced = news.then(|event| async {
        tokio::time::sleep(TICK).await;
        event
    });
    Ok(Sse::new(paced))
}

/// A part of a result: its type and its text.
fn text(job: &Job, what: &str) -> Result<(&'static str, String), Refused> {
    let missing = || Refused::new(StatusCode::NOT_FOUND, format!("{what}: {} makes none", job.command));
    let Some(made) = job.made() else {
        return Err(Refused::conflict(format!("job {}: {}, so there is no {what}", job.id, job.seen().state.name())));
    };
    let shown = |name: &str| {
        let text = made.shown(name).map_err(|error| Refused::failed(in_one_line(&error)))?;
        text.ok_or_else(missing)
    };
    Ok(match what {
        "document" => ("application/json", made.json.clone()),
        "file" => ("application/json", made.file.clone().ok_or_else(missing)?),
        "files" => ("application/json", json!(made.files).to_string()),
        "page" => ("text/html; charset=utf-8", shown("page")?),
        "figures" => ("image/svg+xml", shown("figures")?),
        "full" => ("text/plain; charset=utf-8", crate::cli::output::with_flags(&shown("full")?).into_owned()),
        "curves" => ("application/json", shown("curves")?),
        "junit" => ("application/xml", shown("junit")?),
        _ => return Err(missing()),
    })
}

async fn part(
    With(bench): Bench,
    Path((id, what)): Path<(u64, String)>,
    headers: HeaderMap,
) -> Result<Response, Refused> {
    let job = bench.job(id)?;
    // a result does not change
    let tag = format!("\"{id}-{what}\"");
    if headers.get(IF_NONE_MATCH).is_some_and(|known| *known == *tag) {
        return Ok(StatusCode::NOT_MODIFIED.into_response());
    }
    let (kind, text) = blocking(move || text(&job, &what)).await?;
    let mut answer = ([(CONTENT_TYPE, kind), (ETAG, tag.as_str())], text).into_response();
    if kind.starts_with("text/html") || kind.starts_with("image") {
        answer.headers_mut().insert("content-security-policy", axum::http::HeaderValue::from_static(OF_REPORTS));
    }
    Ok(answer)
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Named {
    name: String,
}

/// A document of the folder.
async fn document(Query(asked): Query<Named>) -> Result<Response, Refused> {
    let text = blocking(move || folder::document(&asked.name)).await?;
    Ok(([(CONTENT_TYPE, "application/json")], text).into_response())
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SaveOf {
    what: String,
    name: String,
    #[serde(default)]
    replace: bool,
}

async fn save_of(With(bench): Bench, Path(id): Path<u64>, bytes: Bytes) -> Result<Json<Value>, Refused> {
    bench.may_write()?;
    let (job, asked): (_, SaveOf) = (bench.job(id)?, body(&bytes)?);
    blocking(move || {
        let (_, text) = text(&job, &asked.what)?;
        folder::save(&asked.name, text.as_bytes(), asked.replace)?;
        Ok(Json(json!({ "name": asked.name })))
    })
    .await
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Save {
    name: String,
    #[serde(default)]
    document: Option<Value>,
    #[serde(default)]
    text: Option<String>,
    #[serde(default)]
    replace: bool,
}

async fn save(With(bench): Bench, bytes: Bytes) -> Result<Json<Value>, Refused> {
    bench.may_write()?;
    let asked: Save = body(&bytes)?;
    let content = match (asked.document, asked.text) {
        (Some(document), None) => folder::pretty(&document),
        (None, Some(text)) => text.into_bytes(),
        _ => return Err(Refused::unprocessable("expected one of document and text".into())),
    };
    blocking(move || {
        folder::save(&asked.name, &content, asked.replace)?;
        Ok(Json(json!({ "name": asked.name })))
    })
    .await
}

/// A file, whole or not at all.
async fn upload(With(bench): Bench, Path(name): Path<String>, request: Asked) -> Result<StatusCode, Refused> {
    bench.may_write()?;
    let most = bench.upload_limit;
    let too_large = || Refused::new(StatusCode::PAYLOAD_TOO_LARGE, format!("a file may have {most} bytes at most"));
    let length = request.headers().get("content-length").and_then(|length| length.to_str().ok()?.parse::<u64>().ok());
    if length.is_some_and(|length| length > most) {
        return Err(too_large());
    }
    let mut file = folder::upload(&name)?;
    let mut body = request.into_body().into_data_stream();
    let mut written = 0;
    let broken = || Refused::new(StatusCode::BAD_REQUEST, "the upload broke off");
    while let Some(chunk) = timeout(BODY_TIME, body.next()).await.map_err(|_| broken())? {
        let chunk = chunk.map_err(|_| broken())?;
        written += chunk.len() as u64;
        if written > most {
            return Err(too_large());
        }
        file = blocking(move || {
            file.write_all(&chunk).map_err(|error| Refused::failed(error.to_string()))?;
            Ok(file)
        })
        .await?;
    }
    blocking(move || file.commit().map_err(|error| Refused::failed(error.to_string()))).await?;
    Ok(StatusCode::CREATED)
}

/// What a slider asks for: its document, at once; it takes the place of what was asked for before.
async fn preview(With(bench): Bench, bytes: Bytes) -> Result<Response, Refused> {
    let asked: folder::Asked = body(&bytes)?;
    let stopped = || Refused::conflict("a newer one was asked for".into());
    let json = blocking(move || {
        let job = bench.jobs.replace_preview(asked.prepared(bench.read_only)?);
        job.run();
        match (job.made(), job.seen()) {
            (Some(made), _) => Ok(made.json.clone()),
            (None, seen) => Err(seen.error.map_or_else(stopped, Refused::unprocessable)),
        }
    });
    Ok(([(CONTENT_TYPE, "application/json")], json.await?).into_response())
}

async fn curve_of(bytes: Bytes) -> Result<Json<curve::Curve>, Refused> {
    let asked = body(&bytes)?;
    Ok(Json(blocking(move || curve::curve(&asked)).await?))
}

async fn series_of(With(bench): Bench, Query(asked): Query<series::Asked>) -> Result<Response, Refused> {
    blocking(move || {
        let log = bench.series.held(&asked)?;
        Ok(match asked.axis {
            None => Json(log.head()).into_response(),
            Some(_) => ([(CONTENT_TYPE, "application/octet-stream")], log.pixels(&asked)?).into_response(),
        })
    })
    .await
}
