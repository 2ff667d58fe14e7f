//! Errors of the library as Python exceptions, with the text of the command line.

use nirspi::address::OpenError;
use nirspi::causes::in_one_line;
use nirspi::files::FileError;
use nirspi::recording::RecordingError;
use nirspi::source::SourceError;
use pyo3::PyErr;
use pyo3::exceptions::{
    PyConnectionError, PyFileNotFoundError, PyOSError, PyPermissionError, PyValueError,
};
use std::error::Error as StdError;
use std::io;

pyo3::create_exception!(
    nirspi,
    Error,
    PyValueError,
    "What nirspi refuses, in one line: what, where, found, expected."
);

/// A refusal with this text.
pub fn refused(text: impl Into<String>) -> PyErr {
    Error::new_err(text.into())
}

/// The error with its causes, as a refusal.
pub fn refusal(error: impl StdError + 'static) -> PyErr {
    refused(in_one_line(&error))
}

/// An error of the system with this text, as the `OSError` of its kind.
fn system(kind: io::ErrorKind, text: String) -> PyErr {
    match kind {
        io::ErrorKind::NotFound => PyFileNotFoundError::new_err(text),
        io::ErrorKind::PermissionDenied => PyPermissionError::new_err(text),
        _ => PyOSError::new_err(text),
    }
}

/// A file that the system refuses is an `OSError`, a file whose content is wrong a refusal.
pub fn of_file(error: FileError) -> PyErr {
    let text = in_one_line(&error);
    match error {
        FileError::Io { system: cause, .. } => system(cause.kind(), text),
        _ => refused(text),
    }
}

/// As [`of_file`].
pub fn of_recording(error: RecordingError) -> PyErr {
    let text = in_one_line(&error);
    match error {
        RecordingError::Io { source, .. } => system(source.kind(), text),
        _ => refused(text),
    }
}

/// As [`of_file`].
pub fn of_source(error: SourceError) -> PyErr {
    match error {
        SourceError::File(error) => of_file(error),
        SourceError::Recording(error) => of_recording(error),
        error => refusal(error),
    }
}

/// A camera that is not there is a `ConnectionError`, which is an `OSError`.
pub fn of_opening(error: OpenError) -> PyErr {
    let text = in_one_line(&error);
    match error {
        OpenError::Virtual(_) | OpenError::Session { .. } => refused(text),
        _ => PyConnectionError::new_err(text),
    }
}
