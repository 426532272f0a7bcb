//! The wish to stop, for work that keeps what it has done.

use std::sync::atomic::{AtomicBool, Ordering};

/// Set by who is asked to stop, looked at by the work.
#[derive(Debug, Default)]
pub struct Stop {
    heeded: AtomicBool,
    wanted: AtomicBool,
}

impl Stop {
    /// From now on the work looks whether it should stop, or no longer does.
    pub fn heed(&self, heeded: bool) {
        self.heeded.store(heeded, Ordering::SeqCst);
    }

    /// Whether the work should stop.
    pub fn is_wanted(&self) -> bool {
        self.wanted.load(Ordering::SeqCst)
    }

    /// Asks the work to stop; false when it does not look, or was asked before: it must be ended then.
    pub fn ask(&self) -> bool {
        self.heeded.load(Ordering::SeqCst) && !self.wanted.swap(true, Ordering::SeqCst)
    }
}
