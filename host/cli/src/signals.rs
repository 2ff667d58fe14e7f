//! Catches the signals at which the program ends. `nirspi::files::interrupt` has the rule for all commands.
//!
//! Two signals do not end the program. A reader that closes its pipe (SIGPIPE, which Rust ignores) and a file that
//! reaches the largest size that is allowed (SIGXFSZ) are errors of the write, which the command reports.

use nirspi::files::interrupt::{Signal, act};
use std::io;

/// Has every signal acted on that was not ignored when the program began.
#[cfg(unix)]
pub fn catch() -> io::Result<()> {
    use signal_hook::consts::SIGXFSZ;
    use signal_hook::iterator::Signals;
    use std::sync::Arc;
    use std::sync::atomic::AtomicBool;

    // Nothing reads the flag. Any handler will do: with one, the write fails and the program goes on.
    signal_hook::flag::register(SIGXFSZ, Arc::new(AtomicBool::new(false)))?;
    let heeded = Signal::ALL.into_iter().filter(|signal| !signal.is_ignored());
    let mut signals = Signals::new(heeded.map(Signal::number))?;
    let heed = move || {
        let known = |number| Signal::ALL.into_iter().find(|signal| signal.number() == number);
        signals.forever().filter_map(known).for_each(act);
    };
    std::thread::Builder::new().name("signals".to_owned()).spawn(heed).map(|_| ())
}

/// Has Ctrl-C acted on.
#[cfg(not(unix))]
pub fn catch() -> io::Result<()> {
    ctrlc::set_handler(|| act(Signal::Interrupt)).map_err(io::Error::other)
}
