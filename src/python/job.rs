//! The one gate of every long call: the work runs on threads of its own, without the interpreter; this thread waits,
//! looks for Ctrl-C, has rows of arrays handed over, and tells who listens how far the work is.
//!
//! The threads live as long as the call, so a process that forks after one finds no pool whose threads are gone.

use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use kfdesign::numerics::progress::{Progress, Samples, on_threads, watched};
use pyo3::exceptions::{PyKeyboardInterrupt, PyOSError};
use pyo3::prelude::*;

use crate::arrays::{Lent, Seen};
use crate::errors::{defect, raised};

/// Between two looks for Ctrl-C: a person does not feel it, and it costs nothing.
const TICK: Duration = Duration::from_millis(50);

/// To the thread that waits.
pub(crate) enum Message {
    Rows { log: usize, column: usize, rows: Range<u64>, back: Sender<Vec<f64>> },
    Begin(&'static str, u64),
    Warning(String),
    Done,
}

/// What the work knows of who waits.
struct Watch {
    tell: Sender<Message>,
    stopped: AtomicBool,
    /// Of the stage.
    done: AtomicU64,
    notes: Mutex<Vec<String>>,
    logs: Vec<(PathBuf, Arc<Seen>)>,
}

impl Progress for Watch {
    fn begin(&self, stage: &'static str, parts: u64) {
        self.done.store(0, Ordering::Relaxed);
        let _ = self.tell.send(Message::Begin(stage, parts));
    }
    fn advance(&self, parts: u64) {
        self.done.fetch_add(parts, Ordering::Relaxed);
    }
    fn note(&self, line: &str) {
        self.notes.lock().unwrap_or_else(PoisonError::into_inner).push(line.trim().to_string());
    }
    fn warning(&self, line: &str) {
        let _ = self.tell.send(Message::Warning(line.trim().to_string()));
    }
    fn is_stopped(&self) -> bool {
        self.stopped.load(Ordering::Relaxed)
    }
    fn lent(&self, name: &Path) -> Option<Arc<dyn Samples>> {
        self.logs.iter().find(|(own, _)| own == name).map(|(_, log)| Arc::clone(log) as _)
    }
}

/// Does the work, with its notes. Errors of the work and of who listens become exceptions, a stop by the user
/// KeyboardInterrupt.
pub(crate) fn call<T: Send>(
    py: Python<'_>,
    logs: &[Lent],
    listener: Option<Py<PyAny>>,
    threads: Option<usize>,
    work: impl FnOnce() -> anyhow::Result<T> + Send,
) -> PyResult<(T, Vec<String>)> {
    let (tell, inbox) = channel();
    let seen = |(number, log): (usize, &Lent)| (PathBuf::from(&log.0), Arc::new(log.seen(number, tell.clone())));
    let watch = Arc::new(Watch {
        logs: logs.iter().enumerate().map(seen).collect(),
        tell: tell.clone(),
        stopped: AtomicBool::new(false),
        done: AtomicU64::new(0),
        notes: Mutex::new(Vec::new()),
    });
    let known: Arc<dyn Progress> = Arc::clone(&watch) as _;
    let own = &watch;
    let done = py.detach(move || {
        thread::scope(|scope| {
            let worker = move || {
                let work = || watched(&known, || on_threads(threads, work));
                let done = catch_unwind(AssertUnwindSafe(work));
                let _ = own.tell.send(Message::Done);
                done
            };
            let worker = thread::Builder::new().name("kfdesign".into()).spawn_scoped(scope, worker);
            let worker = worker.map_err(|error| PyOSError::new_err(format!("no thread can be made: {error}")))?;
            let stopped_by = wait(own, &inbox, logs, listener.as_ref());
            let done = worker.join().unwrap_or_else(Err).map_err(|why| defect(&*why))?;
            match (stopped_by, done) {
                (Some(error), _) => Err(error),
                (None, Ok(done)) => done.map_err(|error| raised(&error)),
                (None, Err(_)) => Err(PyKeyboardInterrupt::new_err(())),
            }
        })
    })?;
    let notes = std::mem::take(&mut *watch.notes.lock().unwrap_or_else(PoisonError::into_inner));
    Ok((done, notes))
}

/// Until the work is done; what made it stop, if anything did.
fn wait(watch: &Watch, inbox: &Receiver<Message>, logs: &[Lent], listener: Option<&Py<PyAny>>) -> Option<PyErr> {
    let mut stopped_by: Option<PyErr> = None;
    let mut stage = ("", 0);
    let mut looked = Instant::now();
    loop {
        let message = inbox.recv_timeout(TICK.saturating_sub(looked.elapsed()));
        let mut heard = Ok(());
        match message {
            Ok(Message::Done) | Err(RecvTimeoutError::Disconnected) => {
                return stopped_by.or_else(|| tell(listener, stage, watch.done.load(Ordering::Relaxed)).err());
            }
            Ok(Message::Rows { log, column, rows, back }) => {
                match Python::attach(|py| logs[log].rows(py, column, rows)) {
                    Ok(values) => drop(back.send(values)),
                    // an answer without rows ends the reading
                    Err(error) => heard = Err(error),
                }
            }
            Ok(Message::Begin(name, parts)) => {
                stage = (name, parts);
                heard = tell(listener, stage, 0);
            }
            Ok(Message::Warning(line)) => heard = warn(&line),
            Err(RecvTimeoutError::Timeout) => {}
        }
        if heard.is_ok() && looked.elapsed() >= TICK {
            looked = Instant::now();
            heard = Python::attach(|py| py.check_signals());
            heard = heard.and_then(|()| tell(listener, stage, watch.done.load(Ordering::Relaxed)));
        }
        if let Err(error) = heard {
            watch.stopped.store(true, Ordering::Relaxed);
            stopped_by.get_or_insert(error);
        }
    }
}

/// How far a stage is.
fn tell(listener: Option<&Py<PyAny>>, (stage, parts): (&str, u64), done: u64) -> PyResult<()> {
    match listener {
        Some(listener) if parts > 0 => Python::attach(|py| listener.call1(py, (stage, done, parts)).map(|_| ())),
        _ => Ok(()),
    }
}

fn warn(line: &str) -> PyResult<()> {
    Python::attach(|py| py.import("kfdesign.errors")?.call_method1("warn", (line,)).map(|_| ()))
}
