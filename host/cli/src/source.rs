//! Arguments that say which measurements to read, and how.

use super::Usage;
use anyhow::Result;
use nirspi::source::{Index, Source, SourceError, SourceOptions};
use std::path::PathBuf;

/// Which measurements.
#[derive(Debug, clap::Args)]
pub struct SourceArgs {
    /// Measurement file or recording
    pub input: PathBuf,
    /// Which measurement of a file that holds several: a number, or all of them, as frames of a video; all frames of a
    /// recording likewise, which are summed otherwise
    #[arg(long, value_name = "N|all")]
    pub index: Option<Index>,
    /// The file's `y` holds one reading a pattern, taken without complements
    #[arg(long)]
    pub non_differential: bool,
    /// Leave the settling leak of a recording as it is
    #[arg(long)]
    pub keep_leak: bool,
    /// Leave the pattern of unequal LEDs of a recording as it is, though a flat field is kept for its camera
    #[arg(long)]
    pub no_flat_field: bool,
}

impl SourceArgs {
    fn options(&self) -> SourceOptions {
        let Self { index, non_differential, keep_leak, no_flat_field, .. } = *self;
        SourceOptions { index, non_differential, keep_leak, no_flat_field }
    }

    /// Reads one.
    pub fn load(&self) -> Result<Source> {
        Source::read(&self.input, self.options()).map_err(usage_or_failure)
    }

    /// Reads all of a file or recording.
    pub fn load_all(&self) -> Result<Vec<Source>> {
        Source::read_all(&self.input, self.options()).map_err(usage_or_failure)
    }

    /// The one that is asked for.
    pub fn one(&self) -> Result<Option<usize>> {
        self.options().one().map_err(usage_or_failure)
    }
}

/// Options that do not go together were used wrongly; all else is a failure.
fn usage_or_failure(error: SourceError) -> anyhow::Error {
    match error {
        SourceError::NotForRecordings | SourceError::One => Usage(error.to_string()).into(),
        // The command line knows these by their own types.
        SourceError::File(error) => error.into(),
        SourceError::Recording(error) => error.into(),
        error => error.into(),
    }
}
