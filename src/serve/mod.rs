//! The workbench in the browser (floor 9): a server for one person on one machine.
//!
//! It runs the commands of the command line and hands out what they make; every number on the page is the library's.
//! `guard` says who may ask, `folder` which files there are, `jobs` does the work, `routes` answers.

mod curve;
mod folder;
mod guard;
mod jobs;
mod page;
mod routes;
mod series;

use std::io;
use std::net::{Ipv4Addr, Ipv6Addr, SocketAddr};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

use axum::http::StatusCode;
use axum::response::{IntoResponse, Response};
use axum::{Json, Router};
use hyper::body::Incoming;
use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper_util::rt::{TokioIo, TokioTimer};
use serde_json::json;
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::Semaphore;
use tower_service::Service;

use self::guard::{Guard, Token};
use self::jobs::Jobs;
use self::routes::Workbench;

/// Connections at a time: more than two tabs of a browser open, few enough that those of a flood cost nothing.
const MOST_CONNECTIONS: usize = 64;
/// Until the headers of a request must be there: also on loopback a laptop may sleep between.
const HEADER_TIME: Duration = Duration::from_secs(10);
/// Ports that are tried where the first is taken.
const PORTS: u16 = 20;

/// What is served.
#[derive(Clone, Debug)]
pub struct Options<'a> {
    pub folder: &'a Path,
    /// 0: any; where another is taken, the next free one of twenty.
    pub port: u16,
    pub read_only: bool,
    /// Jobs at a time.
    pub jobs: usize,
    /// The server ends after so long without a request.
    pub idle: Duration,
    /// Bytes of an uploaded file.
    pub upload_limit: u64,
}

/// Why a request is not answered: a status and a line for a person.
#[derive(Debug)]
struct Refused {
    status: StatusCode,
    error: String,
    /// Options of reading that are missing.
    missing: Vec<String>,
}

impl Refused {
    fn new(status: StatusCode, error: impl Into<String>) -> Refused {
        Refused { status, error: error.into(), missing: Vec::new() }
    }

    fn forbidden(error: String) -> Refused {
        Refused::new(StatusCode::FORBIDDEN, error)
    }

    fn conflict(error: String) -> Refused {
        Refused::new(StatusCode::CONFLICT, error)
    }

    fn unprocessable(error: String) -> Refused {
        Refused::new(StatusCode::UNPROCESSABLE_ENTITY, error)
    }

    fn failed(error: String) -> Refused {
        Refused::new(StatusCode::INTERNAL_SERVER_ERROR, error)
    }
}

impl IntoResponse for Refused {
    fn into_response(self) -> Response {
        let mut body = json!({ "error": self.error });
        if !self.missing.is_empty() {
            body["missing"] = json!(self.missing);
        }
        (self.status, Json(body)).into_response()
    }
}

/// Serves the folder until nobody asks any more; `ready` is told the address. The process's working directory becomes
/// the folder. Errors: one line.
pub fn serve(options: &Options<'_>, ready: impl FnOnce(&str)) -> Result<(), String> {
    folder::enter(options.folder).map_err(|error| folder::why_not(options.folder, &error))?;
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
    let runtime = runtime.map_err(|error| format!("no server can be started: {error}"))?;
    runtime.block_on(async {
        let listeners = listen(options.port).await?;
        let port = listeners.first().and_then(|one| one.local_addr().ok()).map_or(0, |address| address.port());
        let token = Token::new()?;
        let jobs = Jobs::start(options.jobs).map_err(|error| format!("no thread can be made: {error}"))?;
        let workbench = Arc::new(Workbench::new(options, jobs));
        let guard = Guard { token: token.clone(), port };
        let guarded = axum::middleware::from_fn(move |request, next| guard.clone().pass(request, next));
        // around the routes, not in them: the path loses its token before a route is chosen
        let app = Router::new().fallback_service(routes::routes(Arc::clone(&workbench))).layer(guarded);
        let room = Arc::new(Semaphore::new(MOST_CONNECTIONS));
        for listener in listeners {
            tokio::spawn(accept(listener, app.clone(), Arc::clone(&room)));
        }
        ready(&format!("http://127.0.0.1:{port}/{}/", token.text()));
        idle(&workbench, options.idle).await;
        Ok(())
    })
}

/// On loopback alone, in both families where there are two.
async fn listen(port: u16) -> Result<Vec<TcpListener>, String> {
    let last = if port == 0 { 0 } else { port.saturating_add(PORTS - 1) };
    let mut why = String::new();
    for port in port..=last {
        match TcpListener::bind(SocketAddr::from((Ipv4Addr::LOCALHOST, port))).await {
            Ok(first) => {
                let port = first.local_addr().map_or(port, |address| address.port());
                let second = TcpListener::bind(SocketAddr::from((Ipv6Addr::LOCALHOST, port))).await;
                return Ok(std::iter::once(first).chain(second).collect());
            }
            Err(error) if error.kind() == io::ErrorKind::AddrInUse => why = "all are in use".into(),
            Err(error) => why = crate::export::atomic::in_words(&error),
        }
    }
    Err(format!("`port` {port} to {last}: {why}; give another, or 0 for any"))
}

async fn accept(listener: TcpListener, app: Router, room: Arc<Semaphore>) {
    loop {
        let Ok(place) = Arc::clone(&room).acquire_owned().await else { return };
        match listener.accept().await {
            Ok((stream, _)) => {
                let app = app.clone();
                tokio::spawn(async move {
                    answer(stream, app).await;
                    drop(place);
                });
            }
            // no descriptor is free: one will be
            Err(_) => tokio::time::sleep(Duration::from_millis(100)).await,
        }
    }
}

async fn answer(stream: TcpStream, app: Router) {
    let service =
        service_fn(move |request: hyper::Request<Incoming>| app.clone().call(request.map(axum::body::Body::new)));
    let mut server = http1::Builder::new();
    server.timer(TokioTimer::new()).header_read_timeout(HEADER_TIME).max_buf_size(64 << 10);
    // a client that goes away is no error
    let _ = server.serve_connection(TokioIo::new(stream), service).await;
}

/// Until nobody has asked for so long, and no job runs.
async fn idle(workbench: &Workbench, most: Duration) {
    let mut asked = workbench.requests.load(Ordering::Relaxed);
    let mut quiet = Duration::ZERO;
    let step = (most / 100).clamp(Duration::from_millis(100), Duration::from_secs(60));
    while quiet < most {
        tokio::time::sleep(step).await;
        let now = workbench.requests.load(Ordering::Relaxed);
        quiet = if now == asked && !workbench.jobs.is_busy() { quiet + step } else { Duration::ZERO };
        asked = now;
    }
}
