//! Laws of everything that reads bytes, and a search for bytes that break them.
//!
//! A law is a function of any bytes that panics where a reader breaks its promise. The search
//! (`main.rs`, `search.py`) is libFuzzer, which keeps bytes that reach new code and changes them
//! further. It begins with the seeds of each law: small sound files that the program's own writers
//! make. `bash .ci/run fuzz` runs it; `docs/log/security.md` has the table of laws.
//!
//! * [`LAWS`] is the list of all laws,
//! * [`memory`] counts what a reader takes, [`place`] gives readers of files a path,
//! * [`seeds`] makes what several laws begin with.
//!
//! # Invariant
//! Every law holds for its own seeds and for the inputs in `found/` that once broke it
//! (`search.py` tries both before it searches).

pub mod laws;
pub mod memory;
pub mod place;
pub mod seeds;

use std::error::Error;

/// A promise of one reader.
pub struct Law {
    /// The law's name on the command line, and of its folder in `found/`.
    pub name: &'static str,
    /// The bytes that come in.
    pub reads: &'static str,
    /// The files of this repository that read them, for the count of reached edges.
    pub readers: &'static [&'static str],
    /// Panics if the reader breaks its promise.
    pub holds: fn(&[u8]),
    /// Small sound inputs.
    pub seeds: fn() -> Vec<Vec<u8>>,
    /// The longest input in bytes that the search makes.
    pub longest: usize,
    /// The most memory in bytes that the law takes at any time.
    pub most_memory: usize,
}

/// Every law, by module.
pub const LAWS: &[&[Law]] = &[
    laws::wire::LAWS,
    laws::camera::LAWS,
    laws::measurements::LAWS,
    laws::recordings::LAWS,
    laws::pictures::LAWS,
    laws::descriptions::LAWS,
    laws::feeds::LAWS,
    laws::weights::LAWS,
    laws::gateware::LAWS,
    laws::service::LAWS,
];

/// All laws in one list.
pub fn all() -> impl Iterator<Item = &'static Law> {
    LAWS.iter().copied().flatten()
}

/// The law of this name.
pub fn named(name: &str) -> Option<&'static Law> {
    all().find(|law| law.name == name)
}

impl Law {
    /// Tries one input.
    ///
    /// # Panics
    /// If the input breaks the law, or the law takes more memory than it says.
    pub fn check(&self, bytes: &[u8]) {
        let (_, taken) = memory::most_during(|| (self.holds)(bytes));
        assert!(
            taken <= self.most_memory,
            "{taken} bytes of memory for an input of {}, expected at most {}",
            bytes.len(),
            self.most_memory
        );
    }
}

/// A mebibyte.
pub const MIB: usize = 1 << 20;

/// The longest line in which a reader refuses something, in characters. Paths are shorter here.
const LONGEST_LINE: usize = 4096;

/// Panics unless the text is one line that a terminal shows as it is.
#[track_caller]
pub fn is_one_line(line: &str) {
    let is_wild = |c: char| c.is_control() || matches!(c, '\u{2028}' | '\u{2029}');
    assert!(!line.is_empty(), "an error without words");
    assert!(!line.contains(is_wild), "more than one plain line: {line:?}");
    let length = line.chars().count();
    assert!(length <= LONGEST_LINE, "a line of {length} characters");
}

/// Panics unless the error is one plain line, as the program prints it.
#[track_caller]
pub fn refused(error: &(dyn Error + 'static)) {
    is_one_line(&nirspi::causes::in_one_line(error));
}

/// What was read; `None` if it was refused in one plain line.
#[track_caller]
pub fn read<T, E: Error + 'static>(result: Result<T, E>) -> Option<T> {
    result.map_err(|error| refused(&error)).ok()
}
