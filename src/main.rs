//! The `kfdesign` command: parse, run, exit. Everything else is in the library.

use std::process::ExitCode;
use std::sync::Arc;

use kfdesign::cli::{self, Stop};

fn main() -> ExitCode {
    let stop = Arc::new(Stop::default());
    #[cfg(unix)]
    signals::watch(Arc::clone(&stop));
    ExitCode::from(cli::run(std::env::args_os(), &stop))
}

#[cfg(unix)]
mod signals {
    use std::sync::{Arc, mpsc};
    use std::thread;

    use kfdesign::cli::Stop;
    use kfdesign::export::atomic;
    use signal_hook::consts::{SIGINT, SIGTERM, SIGXFSZ};
    use signal_hook::iterator::Signals;
    use signal_hook::low_level::emulate_default_handler;

    /// The thread does next to nothing.
    const STACK: usize = 1 << 17;

    /// At Ctrl-C or SIGTERM, work that keeps what it has done stops at its next checkpoint; other work, and any at
    /// the second time, ends as the signal says, but without temporary files. Where no thread can be made, signals
    /// do what they do.
    pub(super) fn watch(stop: Arc<Stop>) {
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
}
