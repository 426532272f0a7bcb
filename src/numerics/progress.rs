//! Who waits for long work: hears how far it is, and may ask it to stop.
//!
//! [`watched`] runs the work on threads that know who waits, so that nothing has to be handed through the calls
//! between. Loops that may take long call [`checkpoint`] every few milliseconds at most; a stop unwinds the work
//! from there, without a message, to [`watched`]. What was held is released on the way: unfinished files vanish.
//! Work that nobody watches is never stopped.
//!
//! A stop is no panic of the program: it is the way out that rayon's threads carry to their caller.
//!
//! Who waits may also lend samples that are in memory: where the work opens a log of that name, it reads them.

use std::cell::RefCell;
use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::path::Path;
use std::sync::Arc;

use rayon::ThreadPoolBuilder;

/// Who waits. Called from any thread.
pub trait Progress: Send + Sync {
    /// A stage of so many parts begins.
    fn begin(&self, _stage: &'static str, _parts: u64) {}

    /// So many more of its parts are done.
    fn advance(&self, _parts: u64) {}

    /// A line about what the work was given: a check of a log, a column that was chosen.
    fn note(&self, _line: &str) {}

    /// A line about what may make the result worth less.
    fn warning(&self, _line: &str) {}

    /// Whether the work should end. Asked every few milliseconds by every thread, so it should do next to nothing.
    fn is_stopped(&self) -> bool {
        false
    }

    /// The log of this name, where it is in memory and not in a file.
    fn lent(&self, _name: &Path) -> Option<Arc<dyn Samples>> {
        None
    }
}

/// Columns of numbers in memory, which whoever waits has and the work reads. They do not change meanwhile.
pub trait Samples: Send + Sync {
    /// Names of the columns with their units, as in the first line of a text log; empty where nothing names them.
    fn names(&self) -> Vec<String>;

    fn columns(&self) -> usize;

    fn rows(&self) -> u64;

    /// Appends these rows of a column; fewer: there is nothing left to read from.
    fn read(&self, column: usize, rows: Range<u64>, into: &mut Vec<f64>);
}

/// The work was asked to stop.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("stopped")]
pub struct Stopped;

thread_local! {
    static WATCH: RefCell<Option<Arc<dyn Progress>>> = const { RefCell::new(None) };
}

/// Runs the work so that `watch` hears of it and can stop it; the error: it did. Threads are as many as rayon makes by
/// default; where the machine gives none, this one does all the work.
pub fn watched<T: Send>(watch: &Arc<dyn Progress>, work: impl FnOnce() -> T + Send) -> Result<T, Stopped> {
    let theirs = Arc::clone(watch);
    let pool = ThreadPoolBuilder::new().start_handler(move |_| WATCH.set(Some(Arc::clone(&theirs)))).build();
    let done = catch_unwind(AssertUnwindSafe(|| match pool {
        Ok(pool) => pool.install(work),
        Err(_) => {
            let before = Before(WATCH.replace(Some(Arc::clone(watch))));
            let done = work();
            drop(before);
            done
        }
    }));
    done.map_err(|why| if is_stop(&*why) { Stopped } else { resume_unwind(why) })
}

/// Does the work on so many threads, which know who waits; `None`: on those that are there. Where there are no more
/// threads to be had, those that are there do the work.
pub fn on_threads<T: Send>(threads: Option<usize>, work: impl FnOnce() -> T + Send) -> T {
    let watch = WATCH.with_borrow(Clone::clone);
    let pool = |threads| {
        ThreadPoolBuilder::new().num_threads(threads).start_handler(move |_| WATCH.set(watch.clone())).build()
    };
    match threads.map(pool) {
        Some(Ok(pool)) => pool.install(work),
        Some(Err(_)) | None => work(),
    }
}

/// Who waited before, who waits again when this is dropped.
struct Before(Option<Arc<dyn Progress>>);

impl Drop for Before {
    fn drop(&mut self) {
        WATCH.set(self.0.take());
    }
}

/// Ends the work here if it was asked to stop.
#[inline]
pub fn checkpoint() {
    if WATCH.with_borrow(|watch| watch.as_ref().is_some_and(|watch| watch.is_stopped())) {
        resume_unwind(Box::new(Stopped));
    }
}

/// A stage of so many parts begins.
pub fn begin(stage: &'static str, parts: u64) {
    WATCH.with_borrow(|watch| watch.iter().for_each(|watch| watch.begin(stage, parts)));
}

/// So many more parts of the stage are done.
pub fn advance(parts: u64) {
    WATCH.with_borrow(|watch| watch.iter().for_each(|watch| watch.advance(parts)));
}

/// A line about what the work was given. Nobody hears it where nobody waits: what matters is in the result, too.
pub fn note(line: &str) {
    WATCH.with_borrow(|watch| watch.iter().for_each(|watch| watch.note(line)));
}

/// A line about what may make the result worth less. As with [`note`], it is in the result, too.
pub fn warning(line: &str) {
    WATCH.with_borrow(|watch| watch.iter().for_each(|watch| watch.warning(line)));
}

/// The log of this name, where who waits has lent it.
pub fn lent(name: &Path) -> Option<Arc<dyn Samples>> {
    // what waits may do as it likes, so it is asked while nothing is borrowed
    let watch = WATCH.with_borrow(Clone::clone)?;
    watch.lent(name)
}

/// Whether this is the end of work that was asked to stop: who catches panics hands it on.
pub fn is_stop(why: &(dyn std::any::Any + Send)) -> bool {
    why.is::<Stopped>()
}
