//! The crate `parquet` panics on some damaged pages. Here such a panic is an answer, and prints nothing.

use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind, set_hook, take_hook};
use std::sync::Once;

use crate::numerics::progress::is_stop;

thread_local! {
    static GUARDED: Cell<bool> = const { Cell::new(false) };
}

/// What the work returns, or `None` if it panics. The hook that prints panics is passed over for this thread during
/// the work, and for nothing else.
pub(super) fn guarded<T>(work: impl FnOnce() -> T) -> Option<T> {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let before = take_hook();
        set_hook(Box::new(move |panic| {
            if !GUARDED.get() {
                before(panic);
            }
        }));
    });
    GUARDED.set(true);
    let done = catch_unwind(AssertUnwindSafe(work));
    GUARDED.set(false);
    match done {
        Err(why) if is_stop(&*why) => resume_unwind(why),
        done => done.ok(),
    }
}
