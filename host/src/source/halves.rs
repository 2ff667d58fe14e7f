//! A recording in two halves, so that a picture of one can be judged by readings of the other.

use super::recording::from_recording;
use super::{Source, SourceError, SourceOptions};
use nirspi_recon::Measurements;
use std::path::Path;

impl Source {
    /// The means of every other frame of a recording: of the first, third, ... and of the second,
    /// fourth, ... frame. They show the same scene, and share no noise. `None` for a file that is no
    /// recording, and for fewer than two frames.
    ///
    /// # Errors
    /// As [`Source::read`].
    pub fn halves(
        path: &Path,
        options: &SourceOptions,
    ) -> Result<Option<[Measurements; 2]>, SourceError> {
        if !options.fits_recording(path)? {
            return Ok(None);
        }
        let noise = from_recording(path, options)?.measurements.noise();
        let frames = Self::read_all(path, options)?;
        let half = |first: usize| -> Option<Result<Measurements, SourceError>> {
            let mut frames = frames.iter().skip(first).step_by(2).map(|frame| &frame.measurements);
            let rows = frames.clone().next()?.rows();
            let count = frames.clone().filter(|frame| frame.rows() == rows).count() as f64;
            let mut mean = vec![0.0; rows.len()];
            for frame in frames.by_ref().filter(|frame| frame.rows() == rows) {
                mean.iter_mut().zip(frame.values()).for_each(|(mean, v)| *mean += v / count);
            }
            let made = Measurements::from_differential(rows, &mean).and_then(|mean| match noise {
                // Half of the frames.
                Some(noise) => mean.with_noise(noise * std::f64::consts::SQRT_2),
                None => Ok(mean),
            });
            let path = path.to_owned();
            Some(made.map_err(|problem| SourceError::Measurements { path, problem }))
        };
        match (half(0), half(1)) {
            (Some(first), Some(second)) => Ok(Some([first?, second?])),
            _ => Ok(None),
        }
    }
}
