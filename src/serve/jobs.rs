//! Work that is asked for: it waits in a queue, runs on threads of its own, tells how far it is, and can be stopped.

use std::collections::VecDeque;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread;

use serde::Serialize;
use serde_json::Value;

use super::folder::Prepared;
use crate::cli::in_one_line;
use crate::cli::named::{Made, make};
use crate::cli::output::with_flags;
use crate::numerics::progress::{Progress, watched};
use crate::units::plain;

/// Jobs that may wait: more than a person has in mind, and few enough that a flood costs nothing.
pub(super) const MOST_WAITING: usize = 16;
/// Finished jobs whose results are kept.
const MOST_KEPT: usize = 32;
/// The number of what is in no queue.
const PREVIEW: u64 = 0;
/// Notes of a job: a damaged log has one for each line.
const MOST_NOTES: usize = 100;

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum State {
    Waiting,
    Running,
    Done,
    Failed,
    Stopped,
}

impl State {
    pub(super) fn is_final(self) -> bool {
        matches!(self, State::Done | State::Failed | State::Stopped)
    }

    pub(super) fn name(self) -> &'static str {
        match self {
            State::Waiting => "waiting",
            State::Running => "running",
            State::Done => "done",
            State::Failed => "failed",
            State::Stopped => "stopped",
        }
    }
}

/// What a page sees of a job.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Seen {
    id: u64,
    command: String,
    request: Value,
    /// The command line that does the same.
    shell: String,
    pub(super) state: State,
    stage: &'static str,
    done: u64,
    parts: u64,
    notes: Vec<String>,
    warnings: Vec<String>,
    pub(super) error: Option<String>,
    /// The short answer, as on a terminal.
    brief: Option<String>,
    /// Its verdict in a word, where it has one.
    verdict: Option<String>,
    /// What of it can be had.
    has: Vec<&'static str>,
}

#[derive(Debug)]
pub(super) struct Job {
    pub(super) id: u64,
    pub(super) command: String,
    asked: Mutex<Option<Prepared>>,
    seen: Mutex<Seen>,
    made: Mutex<Option<Arc<Made>>>,
    stopped: AtomicBool,
    /// Parts of the stage that are done.
    done: AtomicU64,
    /// Grows with every change that a page should see.
    pub(super) changes: AtomicU64,
}

fn locked<T>(of: &Mutex<T>) -> MutexGuard<'_, T> {
    of.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Progress for Job {
    fn begin(&self, stage: &'static str, parts: u64) {
        self.done.store(0, Ordering::Relaxed);
        self.change(|seen| (seen.stage, seen.parts) = (stage, parts));
    }
    fn advance(&self, parts: u64) {
        self.done.fetch_add(parts, Ordering::Relaxed);
        self.changes.fetch_add(1, Ordering::Relaxed);
    }
    fn note(&self, line: &str) {
        self.change(|seen| said(&mut seen.notes, line));
    }
    fn warning(&self, line: &str) {
        self.change(|seen| said(&mut seen.warnings, line));
    }
    fn is_stopped(&self) -> bool {
        self.stopped.load(Ordering::Relaxed)
    }
}

fn said(into: &mut Vec<String>, line: &str) {
    if into.len() < MOST_NOTES {
        into.push(plain(&with_flags(line.trim())).into_owned());
    }
}

impl Job {
    pub(super) fn new(id: u64, asked: Prepared) -> Job {
        let seen = Seen {
            id,
            command: asked.command.clone(),
            request: asked.request.clone(),
            shell: asked.shell.clone(),
            state: State::Waiting,
            stage: "",
            done: 0,
            parts: 0,
            notes: Vec::new(),
            warnings: Vec::new(),
            error: None,
            brief: None,
            verdict: None,
            has: Vec::new(),
        };
        Job {
            id,
            command: asked.command.clone(),
            asked: Mutex::new(Some(asked)),
            seen: Mutex::new(seen),
            made: Mutex::new(None),
            stopped: AtomicBool::new(false),
            done: AtomicU64::new(0),
            changes: AtomicU64::new(0),
        }
    }

    fn change(&self, how: impl FnOnce(&mut Seen)) {
        how(&mut locked(&self.seen));
        self.changes.fetch_add(1, Ordering::Release);
    }

    pub(super) fn seen(&self) -> Seen {
        Seen { done: self.done.load(Ordering::Relaxed), ..locked(&self.seen).clone() }
    }

    pub(super) fn made(&self) -> Option<Arc<Made>> {
        locked(&self.made).clone()
    }

    /// Ends the work at its next checkpoint, or before it begins.
    pub(super) fn stop(&self) {
        self.stopped.store(true, Ordering::Relaxed);
        self.change(|seen| {
            if seen.state == State::Waiting {
                seen.state = State::Stopped;
                // its drafts go with it
                locked(&self.asked).take();
            }
        });
    }

    /// Does the work on this thread, unless it was stopped before.
    pub(super) fn run(self: &Arc<Job>) {
        let Some(asked) = locked(&self.asked).take() else { return };
        if self.is_stopped() {
            return;
        }
        self.change(|seen| seen.state = State::Running);
        let request = asked.given.to_string();
        let watch: Arc<dyn Progress> = Arc::clone(self) as _;
        let work = || {
            // of a preview the document alone is looked at
            let whole = self.id != PREVIEW;
            let made = make(&asked.command, &request, whole)?;
            if !whole {
                return Ok((made, None, None));
            }
            // what is said of it is small, and drawn while who asked still waits
            let said = made.shown("brief").and_then(|brief| Ok((brief, made.shown("verdict")?)));
            said.map(|(brief, verdict)| (made, brief, verdict))
        };
        let done = catch_unwind(AssertUnwindSafe(|| watched(&watch, work)));
        match done {
            Ok(Ok(Ok((made, brief, verdict)))) => {
                let has = has(&made, &asked.command);
                *locked(&self.made) = Some(Arc::new(made));
                let brief = brief.map(|text| with_flags(&text).into_owned());
                self.change(|seen| {
                    *seen = Seen { state: State::Done, brief, verdict, has, ..seen.clone() };
                });
            }
            Ok(Ok(Err(error))) => {
                let error = asked.named(&with_flags(&in_one_line(&error)));
                self.change(|seen| (seen.state, seen.error) = (State::Failed, Some(error)));
            }
            Ok(Err(_)) => self.change(|seen| seen.state = State::Stopped),
            Err(_) => {
                let error = "a defect of kfdesign: this work ended without a result; the page can go on".to_string();
                self.change(|seen| (seen.state, seen.error) = (State::Failed, Some(error)));
            }
        }
    }
}

/// What can be had of a result, without drawing it.
fn has(made: &Made, command: &str) -> Vec<&'static str> {
    let drawn = !matches!(command, "export");
    let figures = matches!(command, "airplane" | "allan" | "identify" | "compare" | "fly" | "loop" | "tune" | "replay");
    let all = [
        ("document", true),
        ("file", made.file.is_some()),
        ("page", drawn),
        ("full", drawn),
        ("figures", figures),
        ("curves", matches!(command, "replay" | "loop")),
        ("junit", matches!(command, "montecarlo" | "merge")),
        ("files", !made.files.is_empty()),
    ];
    all.into_iter().filter(|(_, there)| *there).map(|(name, _)| name).collect()
}

/// The queue, and what was made.
#[derive(Debug, Default)]
pub(super) struct Jobs {
    inner: Mutex<Inner>,
    more: Condvar,
    /// What a slider asks for: the newest alone counts.
    preview: Mutex<Option<Arc<Job>>>,
}

#[derive(Debug, Default)]
struct Inner {
    last: u64,
    waiting: VecDeque<Arc<Job>>,
    all: VecDeque<Arc<Job>>,
}

impl Jobs {
    /// The queue with threads that work on it.
    pub(super) fn start(threads: usize) -> std::io::Result<Arc<Jobs>> {
        let jobs = Arc::new(Jobs::default());
        for _ in 0..threads {
            let own = Arc::clone(&jobs);
            thread::Builder::new().name("job".into()).spawn(move || own.work())?;
        }
        Ok(jobs)
    }

    fn work(&self) {
        loop {
            let mut inner = locked(&self.inner);
            let job = loop {
                match inner.waiting.pop_front() {
                    Some(job) => break job,
                    None => inner = self.more.wait(inner).unwrap_or_else(PoisonError::into_inner),
                }
            };
            drop(inner);
            job.run();
        }
    }

    /// Into the queue; `None`: it is full.
    pub(super) fn add(&self, asked: Prepared) -> Option<Arc<Job>> {
        let mut inner = locked(&self.inner);
        inner.waiting.retain(|job| !job.is_stopped());
        if inner.waiting.len() >= MOST_WAITING {
            return None;
        }
        inner.last += 1;
        let job = Arc::new(Job::new(inner.last, asked));
        inner.waiting.push_back(Arc::clone(&job));
        inner.all.push_back(Arc::clone(&job));
        while inner.all.len() > MOST_KEPT + MOST_WAITING {
            let Some(old) = inner.all.iter().position(|job| job.seen().state.is_final()) else { break };
            inner.all.remove(old);
        }
        self.more.notify_one();
        Some(job)
    }

    pub(super) fn get(&self, id: u64) -> Option<Arc<Job>> {
        locked(&self.inner).all.iter().find(|job| job.id == id).cloned()
    }

    /// Whether there is work that is not done.
    pub(super) fn is_busy(&self) -> bool {
        self.all().iter().any(|seen| !seen.state.is_final())
    }

    pub(super) fn all(&self) -> Vec<Seen> {
        let all: Vec<_> = locked(&self.inner).all.iter().cloned().collect();
        all.iter().map(|job| job.seen()).collect()
    }

    /// Work outside the queue, in the place of what was asked for before: that is stopped.
    pub(super) fn replace_preview(&self, asked: Prepared) -> Arc<Job> {
        let job = Arc::new(Job::new(PREVIEW, asked));
        if let Some(old) = locked(&self.preview).replace(Arc::clone(&job)) {
            old.stop();
        }
        job
    }
}
