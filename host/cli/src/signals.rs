//! Catches the signals at which the program ends. `nirspi::files::interrupt` has the rule for all commands.

use nirspi::files::interrupt::{Signal, act};
use std::io;

/// Has every signal acted on that was not ignored when the program began.
#[cfg(unix)]
pub fn catch() -> io::Result<()> {
    use signal_hook::iterator::Signals;

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
