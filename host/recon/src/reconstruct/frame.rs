//! The next frame of a video by a method for single images, which gets what the frames before have
//! shown.

use super::{Reconstruct, ReconstructError, Reconstruction, Recursive};
use crate::{Image, Measurements, fwht};

/// The image of the next frame by a method that gets the rows that this frame and earlier ones have
/// shown.
///
/// # Errors
/// The errors of the method and of [`Recursive::add`].
pub fn fused_frame(
    method: &dyn Reconstruct,
    past: &mut Recursive,
    frame: &Measurements,
) -> Result<Reconstruction, ReconstructError> {
    let fused = past.add(frame)?;
    let mut made = method.reconstruct(&fused.fused)?;
    made.report.warm = fused.warm;
    note(&mut made, fused.note());
    Ok(made)
}

/// As [`fused_frame`], for a method that takes the noise of its measurements for white: the image
/// is part that of the fused rows and part that of the frame alone, as far as the readings of the
/// last frames support the fused rows. The method makes two images.
///
/// # Errors
/// The errors of the method and of [`Recursive::add`].
pub fn believed_frame(
    method: &dyn Reconstruct,
    past: &mut Recursive,
    frame: &Measurements,
) -> Result<Reconstruction, ReconstructError> {
    let mut made = method.reconstruct(frame)?;
    let added = past.add(frame)?;
    let share = past.share(frame, added.warm);
    if !added.warm {
        past.remember(&made.image, &made.image);
        note(&mut made, added.note());
        return Ok(made);
    }
    let fused = method.reconstruct(&added.certain)?;
    past.remember(&made.image, &fused.image);
    if share == 0.0 {
        note(&mut made, Some("the readings do not support the frames before".to_owned()));
        return Ok(made);
    }
    let pixels = made.image.pixels().iter().zip(fused.image.pixels());
    let pixels = pixels.map(|(alone, fused)| alone + share as f32 * (fused - alone)).collect();
    let mut mixed =
        Reconstruction { image: Image::new(frame.side(), pixels), report: fused.report };
    mixed.report.warm = true;
    mixed.report.residual = Some(residual(&mixed.image, frame));
    note(&mut mixed, added.note());
    note(&mut mixed, Some(format!("{:.0} % by the frames before", 100.0 * share)));
    Ok(mixed)
}

/// Adds a note to a report.
fn note(made: &mut Reconstruction, more: Option<String>) {
    let notes: Vec<String> = [made.report.note.take(), more].into_iter().flatten().collect();
    made.report.note = (!notes.is_empty()).then(|| notes.join(", "));
}

/// Norm of what an image misses of the measurements, relative to their norm.
pub(super) fn residual(image: &Image, frame: &Measurements) -> f64 {
    let mut rows = image.pixels().to_vec();
    fwht::transform(&mut rows);
    let (mut missed, mut all) = (0.0, 0.0);
    for (&row, value) in frame.rows().iter().zip(frame.values()) {
        missed += (f64::from(rows[row as usize]) - value).powi(2);
        all += value * value;
    }
    if all > 0.0 { (missed / all).sqrt() } else { 0.0 }
}
