//! A recording with images and depth maps, for viewers of MCAP files such as Foxglove and Rerun.
//!
//! The packets, their times and the information before them are those of the recording, so the
//! exported file is a recording itself.

use super::images::{Images, OfImage, Pair};
use super::{ExportError, ExportOptions, Whole};
use crate::files::FileError;
use crate::files::output::{Existing, write_in_pieces};
use crate::imaging::{Enhance, EnhancedImage, ImageContext, SPREAD_COPIES, White};
use crate::provenance::Provenance;
use crate::recording::{Book, Heard, Opening, Recording, hear_recording};
use crate::source::{SourceError, Stamp};
use crate::{depth_image, recording::Pinhole};
use nirspi_nets::{Device, deblur};
use nirspi_wire::DeviceMessage;
use std::io::{self, Write};
use std::path::Path;

/// The camera's time of one image: 30 images a second.
const IMAGE_US: u64 = 33_333;

/// Whether a frame begins a new image, by the camera's time since the first frame.
fn begins() -> impl FnMut(Stamp) -> bool + Send {
    let (mut first, mut open) = (None, None);
    move |stamp| {
        let first = *first.get_or_insert(stamp.device_time_us);
        let number = stamp.device_time_us.saturating_sub(first) / IMAGE_US;
        open.replace(number) != Some(number)
    }
}

/// Writes the file. Returns the number of images.
pub(super) fn write(
    (whole, path): (&Whole<'_>, &Path),
    out: &Path,
    options: &ExportOptions,
    provenance: &Provenance,
) -> Result<usize, ExportError> {
    let enhance = options.enhance.then(|| Enhance::built_in(&Device::cpu())).transpose()?;
    let mut images = Images::of((whole, path), begins(), out)?;
    write_in_pieces(out, Existing::of(options.overwrite, Some(path)), |file| {
        let io_error = |error| FileError::io(out, "write", error);
        let mut recording = Recording::open(path)?;
        let (identity, setup) = (recording.identity.clone(), recording.setup.clone());
        let (settling, run) = (recording.settling.clone(), recording.run);
        let settling = settling.as_ref();
        let (identity, setup, provenance) = (&identity, &setup, Some(provenance));
        let part = recording.part.clone();
        let opening = Opening { identity, setup, settling, run, part: part.as_ref(), provenance };
        let mut book = Book::begin(file, &opening).map_err(io_error)?;
        let mut pinhole = options.model.as_ref().map(Pinhole::from);
        let known = images.known.clone();
        let mut known = known.iter().peekable();
        hear_recording(&mut recording, |heard, count| {
            pinhole
                .take()
                .map_or(Ok(()), |pinhole| book.pinhole(heard.time_ns, &pinhole))
                .and_then(|()| book.packet(heard.time_ns, heard.raw))
                .and_then(|()| book.heard(heard.time_ns, heard.content, count))
                .and_then(|()| depth(&mut book, heard, options))
                .map_err(io_error)?;
            if heard.frame().is_none() {
                return Ok(());
            }
            let number = count.account().accounted() as i64 - 1;
            match known.next_if(|of| of.last.sequence == number) {
                Some(of) => image(&mut book, &mut images, of, enhance.as_ref(), (path, out)),
                None => Ok(()),
            }
        })?;
        if known.next().is_some() {
            return Err(SourceError::Changed(path.to_owned()).into());
        }
        Ok(book.end(recording.end().account.as_ref()).map_err(io_error)?)
    })
    .map(|()| images.known.len())
}

/// Writes the next image, and what networks make of it.
fn image<W: Write>(
    book: &mut Book<W>,
    images: &mut Images,
    of: &OfImage,
    enhance: Option<&Enhance>,
    (path, out): (&Path, &Path),
) -> Result<(), ExportError> {
    let Pair { image, for_networks } =
        images.next().map_err(|error| FileError::io(out, "read", error))?;
    let time_ns = of.last.time_ns;
    // A recording that shows no light has no enhanced images.
    let enhance = enhance.filter(|_| images.white > 0.0);
    let enhanced = enhance.map(|enhance| {
        let (rows, readings, copies) = (Some(&of.rows), of.readings, SPREAD_COPIES);
        let context = ImageContext { rows, readings, copies, ..ImageContext::default() };
        enhance
            .enhance(&for_networks, White::Known(images.white), &context)
            .map_err(|problem| ExportError::Enhance { path: path.to_owned(), time_ns, problem })
    });
    let written = match enhanced.transpose()? {
        Some(EnhancedImage { pixels, spread, half_width, .. }) => {
            let (spread, width) = (spread.as_deref(), half_width.as_deref());
            book.enhanced(time_ns, deblur::SIDE, &pixels, spread, width)
        }
        None => Ok(()),
    };
    let written = written.and_then(|()| book.image(time_ns, &image, images.range));
    Ok(written.map_err(|error| FileError::io(out, "write", error))?)
}

/// Writes the depth map of a packet that has one, if the camera is described.
fn depth<W: Write>(
    book: &mut Book<W>,
    heard: &Heard<'_>,
    options: &ExportOptions,
) -> io::Result<()> {
    let (Ok(DeviceMessage::Depth(depth)), Some(model)) = (heard.content, &options.model) else {
        return Ok(());
    };
    match depth_image::pixels_m(model, depth) {
        Some(pixels_m) => book.depth(heard.time_ns, &pixels_m),
        None => Ok(()),
    }
}
