//! Signals of a process that is the command and nothing else.

use std::sync::Arc;

use super::Stop;

/// The thread does next to nothing.
#[cfg(unix)]
const STACK: usize = 1 << 17;

/// At Ctrl-C or SIGTERM, work that keeps what it has done stops at its next checkpoint; other work, and any at the
/// second time, ends as the signal says, but without temporary files. Where no thread can be made, signals do what
/// they do. Not for a process with other work, whose handlers this takes away.
#[cfg(unix)]
pub fn watch_signals(stop: &Arc<Stop>) {
    use std::sync::mpsc;
    use std::thread;

    use signal_hook::consts::{SIGINT, SIGTERM, SIGXFSZ};
    use signal_hook::iterator::Signals;
    use signal_hook::low_level::emulate_default_handler;

    use crate::export::atomic;

    let stop = Arc::clone(stop);
    let (ready, watching) = mpsc::channel();
    let watch = move || {
        // a file larger than it may be (SIGXFSZ) is an error that the write reports
        let Ok(mut signals) = Signals::new([SIGINT, SIGTERM, SIGXFSZ]) else { return };
        let _ = ready.send(());
        for signal in &mut signals {
            if signal != SIGXFSZ && !stop.ask() {
                atomic::abandon();
                let _ = emulate_default_handler(signal);
            }
        }
    };
    if thread::Builder::new().name("signals".into()).stack_size(STACK).spawn(watch).is_ok() {
        let _ = watching.recv();
    }
}

/// There are no signals here.
#[cfg(not(unix))]
pub fn watch_signals(_: &Arc<Stop>) {}
