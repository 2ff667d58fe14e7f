//! Images of neighbouring frames that were added, as `reconstruct` makes them.

use super::{ExportError, Whole};
use crate::files::FileError;
use crate::files::output::Spool;
use crate::imaging::{KnownReadings, White};
use crate::reconstruct::{Recipe, Solved, Solver};
use crate::source::Stamp;
use nirspi_recon::reconstruct::AT_A_TIME;
use nirspi_recon::{Image, Rows, Side};
use std::io::{self, BufReader, BufWriter, Read, Seek, Write};
use std::path::Path;

/// Makes the images of sums of frames; `begins` says whether a frame begins a new sum. `on` gets each image with the last of
/// its frames.
pub(super) fn each(
    (whole, path): (&Whole<'_>, &Path),
    begins: impl FnMut(Stamp) -> bool + Send + 'static,
    mut on: impl FnMut(Stamp, Solved) -> Result<(), ExportError>,
) -> Result<(), ExportError> {
    let frames = &whole.frames;
    let solver = Solver::new(Recipe::default())?;
    let reading = frames.read_added(AT_A_TIME, Box::new(begins))?;
    while let Some(added) = reading.next() {
        let added = added?;
        let stamps: Vec<Stamp> = added.iter().map(|added| added.last).collect();
        let sources = frames.sources(added).into_iter().collect::<Result<Vec<_>, _>>()?;
        let solved = solver.solve_all(path, &sources, false, &|| Ok(()))?;
        stamps.into_iter().zip(solved).try_for_each(|(stamp, solved)| on(stamp, solved))?;
    }
    Ok(())
}

/// Images in their order, on the disk, because a recording may have more than fit into memory.
pub(super) struct Images {
    pixels: BufReader<Spool>,
    side: Side,
    /// What else is known of each.
    pub known: Vec<OfImage>,
    /// The least and the largest pixel.
    pub range: [f32; 2],
    /// The white level of all.
    pub white: f32,
}

/// What is known of an image besides its pixels.
#[derive(Debug, Clone)]
pub(super) struct OfImage {
    /// The last of its frames.
    pub last: Stamp,
    /// The patterns that it was made of.
    pub rows: Rows,
    /// How its readings were taken, if their noise is known.
    pub readings: Option<KnownReadings>,
}

/// An image for people, and the same for networks.
pub(super) struct Pair {
    pub image: Image,
    pub for_networks: Image,
}

impl Images {
    /// Makes all images; the file of their pixels is beside `out` for a while.
    pub(super) fn of(
        (whole, path): (&Whole<'_>, &Path),
        begins: impl FnMut(Stamp) -> bool + Send + 'static,
        out: &Path,
    ) -> Result<Self, ExportError> {
        let wrong = |error| FileError::io(out, "write", error);
        let mut pixels = BufWriter::new(Spool::beside(out)?);
        let (mut known, mut levels) = (Vec::new(), Vec::new());
        let mut range = [f32::INFINITY, f32::NEG_INFINITY];
        each((whole, path), begins, |last, solved| {
            let Solved { image, with_readings, used, readings, .. } = solved;
            let with_readings = with_readings.as_ref().unwrap_or(&image);
            for image in [&image, with_readings] {
                let bytes: Vec<u8> = image.pixels().iter().flat_map(|p| p.to_le_bytes()).collect();
                pixels.write_all(&bytes).map_err(wrong)?;
            }
            let ends = |[least, most]: [f32; 2], &pixel: &f32| [least.min(pixel), most.max(pixel)];
            range = image.pixels().iter().fold(range, ends);
            levels.push(White::Brightest.level(with_readings));
            known.push(OfImage { last, rows: used.rows().clone(), readings });
            Ok(())
        })?;
        let rewound = || -> io::Result<Spool> {
            let mut file = pixels.into_inner().map_err(io::IntoInnerError::into_error)?;
            file.rewind()?;
            Ok(file)
        };
        let pixels = BufReader::new(rewound().map_err(wrong)?);
        let side = whole.source.measurements.side();
        Ok(Self { pixels, side, known, range, white: White::median(levels) })
    }

    /// The pixels of the next image.
    pub(super) fn next(&mut self) -> io::Result<Pair> {
        let mut read = || -> io::Result<Image> {
            let mut bytes = vec![0; 4 * self.side.area()];
            self.pixels.read_exact(&mut bytes)?;
            let pixels = bytes.as_chunks::<4>().0.iter().map(|&pixel| f32::from_le_bytes(pixel));
            Ok(Image::new(self.side, pixels.collect()))
        };
        Ok(Pair { image: read()?, for_networks: read()? })
    }
}
