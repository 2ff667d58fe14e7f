//! A recording with images and depth maps, for viewers of MCAP files such as Foxglove and Rerun.
//!
//! The packets, their times and the information before them are those of the recording, so the
//! exported file is a recording itself.

#[cfg(feature = "enhance")]
use super::enhancing::ForNetworks;
use super::{ExportError, ExportOptions, Whole};
use crate::files::FileError;
use crate::files::output::{Existing, write_in_pieces};
use crate::integrate::Integrated;
use crate::provenance::Provenance;
use crate::recording::{Book, Heard, Opening, Recording, hear_recording};
use crate::tally::Tally;
use crate::{depth_image, recording::Pinhole};
use nirspi_recon::Image;
use nirspi_recon::reconstruct::{Method, Reconstruct, Stacked};
use nirspi_wire::DeviceMessage;
use std::io::{self, Write};
use std::path::Path;

/// The camera's time of one image: 30 images a second.
const IMAGE_US: u64 = 33_333;

/// Writes the file. Returns the number of images.
pub(super) fn write(
    whole: &Whole,
    out: &Path,
    options: &ExportOptions,
    provenance: &Provenance,
) -> Result<usize, ExportError> {
    let (mut images, mut range) = (0, [f32::INFINITY, f32::NEG_INFINITY]);
    #[cfg(feature = "enhance")]
    let mut enhancing = super::enhancing::Enhancing::new(options)?;
    let mut recording = Recording::open(&whole.path)?;
    each(whole, &mut recording, |what| {
        if let What::Image(_, made) = what {
            images += 1;
            #[cfg(feature = "enhance")]
            enhancing.look_at(&made.for_networks);
            range = made
                .image
                .pixels()
                .iter()
                .fold(range, |[least, most], &pixel| [least.min(pixel), most.max(pixel)]);
        }
        Ok(())
    })?;
    write_in_pieces(out, Existing::of(options.overwrite, Some(&whole.path)), |file| {
        let io_error = |error| FileError::io(out, "write", error);
        let mut recording = Recording::open(&whole.path)?;
        let (identity, setup) = (recording.identity.clone(), recording.setup.clone());
        let (settling, run) = (recording.settling.clone(), recording.run);
        let settling = settling.as_ref();
        let (identity, setup, provenance) = (&identity, &setup, Some(provenance));
        let part = recording.part.clone();
        let opening = Opening { identity, setup, settling, run, part: part.as_ref(), provenance };
        let mut book = Book::begin(file, &opening).map_err(io_error)?;
        if let Some(model) = &options.model {
            let time = whole.time_ns.first().map_or(0, |&time| time as u64);
            book.pinhole(time, &Pinhole::from(model)).map_err(io_error)?;
        }
        each(whole, &mut recording, |what| {
            let written = match what {
                What::Packet(heard, tally) => book
                    .packet(heard.time_ns, heard.raw)
                    .and_then(|()| book.heard(heard.time_ns, heard.content, tally))
                    .and_then(|()| depth(&mut book, heard, options)),
                What::Image(time_ns, made) => {
                    let image = made.image;
                    #[cfg(feature = "enhance")]
                    if let Some(made) = enhancing.enhance(whole, time_ns, &made.for_networks)? {
                        let (spread, width) = (made.spread.as_deref(), made.half_width.as_deref());
                        book.enhanced(
                            time_ns,
                            nirspi_nets::deblur::SIDE,
                            &made.pixels,
                            spread,
                            width,
                        )
                        .map_err(io_error)?;
                    }
                    book.image(time_ns, &image, range)
                }
            };
            Ok(written.map_err(io_error)?)
        })?;
        Ok(book.end(recording.end().account.as_ref()).map_err(io_error)?)
    })
    .map(|()| images)
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

enum What<'p> {
    Packet(&'p Heard<'p>, &'p Tally),
    /// An image, and the time at which its last frame arrived.
    Image(u64, Shown),
}

/// An image of some frames.
struct Shown {
    image: Image,
    #[cfg(feature = "enhance")]
    for_networks: ForNetworks,
}

/// Goes through the packets of a recording, and the images of its frames.
fn each(
    whole: &Whole,
    recording: &mut Recording,
    mut on: impl FnMut(What<'_>) -> Result<(), ExportError>,
) -> Result<(), ExportError> {
    let (setup, settling) = (recording.setup.clone(), recording.settling.clone());
    let path = &whole.path;
    let problem = |frame| move |problem| ExportError::Image { path: path.clone(), frame, problem };
    let method = Method::default().prepare(&super::settings()).map_err(problem(0))?;
    let method = Stacked::new(method);
    let image = |sum: Integrated, frame: usize| -> Result<Shown, ExportError> {
        let measurements = sum
            .of_run(&whole.known)
            .measurements(&setup, settling.as_ref(), whole.keep_leak)
            .map_err(|problem| whole.integrate(problem))?;
        let made = method.reconstruct(&measurements).map_err(problem(frame))?;
        Ok(Shown {
            #[cfg(feature = "enhance")]
            for_networks: ForNetworks::of(&made, &measurements, whole.source.flat_field.as_ref()),
            image: whole.source.flattened(made.image),
        })
    };
    let mut sum = Integrated::new(&setup);
    // The image that is being summed: its number, and the time of its newest frame.
    let mut open: Option<(u64, u64)> = None;
    let first = whole.device_time_us.first().map_or(0, |&time| time as u64);
    let mut frames = 0;
    hear_recording(recording, |heard, tally| {
        if let Some(frame) = heard.frame() {
            let number = frame.device_time_us.saturating_sub(first) / IMAGE_US;
            if let Some((before, time_ns)) = open
                && before != number
            {
                let summed = std::mem::replace(&mut sum, Integrated::new(&setup));
                on(What::Image(time_ns, image(summed, frames)?))?;
            }
            sum.add(frame);
            open = Some((number, heard.time_ns));
            frames += 1;
        }
        on(What::Packet(heard, tally))
    })?;
    match open {
        Some((_, time_ns)) => on(What::Image(time_ns, image(sum, frames)?)),
        None => Ok(()),
    }
}
