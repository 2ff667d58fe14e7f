//! Images on their way into an array on the disk, of which some can be read again for pictures.

use crate::files::output::{Growing, OutputDir};
use crate::files::{FileError, npy};
use crate::picture::{Sheet, Unit, chosen};
use std::io::{self, Write};

/// Images that become an array in a file.
pub(super) struct Images {
    to: Growing,
    /// Height and width.
    pub size: (usize, usize),
    pub count: usize,
}

impl Images {
    /// None yet, of this height and width.
    pub(super) fn new(
        out: &OutputDir,
        name: &str,
        size: (usize, usize),
    ) -> Result<Self, FileError> {
        Ok(Self { to: out.grow(name, Self::header(0, size).len())?, size, count: 0 })
    }

    /// The bytes before the pixels, whose number is the same for any number of images
    /// (`tests::a_header_has_one_length`).
    fn header(count: usize, (height, width): (usize, usize)) -> Vec<u8> {
        npy::header::<f32>(&[count, height, width])
    }

    /// Adds the pixels of the next one.
    pub(super) fn push(&mut self, pixels: &[f32]) -> io::Result<()> {
        write_pixels(&mut self.to, pixels)?;
        self.count += 1;
        Ok(())
    }

    /// Brings what there is to the disk.
    pub(super) fn flush(&mut self) -> io::Result<()> {
        self.to.flush()
    }

    /// Number of bytes of `count` images.
    pub(super) fn bytes_of(&self, count: usize) -> u64 {
        4 * (self.size.0 * self.size.1 * count) as u64
    }

    /// The first images alone.
    pub(super) fn cut(self, count: usize) -> io::Result<Self> {
        let bytes = self.bytes_of(count);
        Ok(Self { to: self.to.cut(bytes)?, count, ..self })
    }

    /// Those that pictures show.
    pub(super) fn chosen(&mut self) -> io::Result<Shown> {
        let numbers = chosen(self.count);
        let area = self.size.0 * self.size.1;
        let mut bytes = vec![0; 4 * area];
        let mut pixels = Vec::with_capacity(area * numbers.len());
        for &number in &numbers {
            self.to.read_at((number * bytes.len()) as u64, &mut bytes)?;
            pixels.extend(values(&bytes));
        }
        Ok(Shown { count: self.count, size: self.size, numbers, pixels })
    }

    /// Stages the array.
    pub(super) fn finish(self, out: &mut OutputDir) -> Result<(), FileError> {
        out.take(self.to, &Self::header(self.count, self.size))
    }
}

/// Some images of a stack.
pub(super) struct Shown {
    count: usize,
    size: (usize, usize),
    numbers: Vec<usize>,
    pixels: Vec<f32>,
}

impl Shown {
    /// As a picture shows them.
    pub(super) fn sheet(&self, header: String, unit: Unit) -> Sheet<'_> {
        let images = self.pixels.chunks_exact(self.size.0 * self.size.1).collect();
        Sheet::of_chosen(header, self.size, self.count, (self.numbers.clone(), images), unit)
    }
}

/// Writes pixels as an array has them.
pub(super) fn write_pixels(to: &mut impl Write, pixels: &[f32]) -> io::Result<()> {
    let bytes: Vec<u8> = pixels.iter().flat_map(|pixel| pixel.to_le_bytes()).collect();
    to.write_all(&bytes)
}

/// Pixels that were written so.
pub(super) fn values(bytes: &[u8]) -> impl Iterator<Item = f32> {
    bytes.as_chunks::<4>().0.iter().map(|&pixel| f32::from_le_bytes(pixel))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_header_has_one_length() {
        for size in [(1, 1), (32, 32), (12, 15), (4096, 4096)] {
            for count in [1, 9, 1_000_000, usize::MAX] {
                assert_eq!(Images::header(count, size).len(), Images::header(0, size).len());
            }
        }
    }
}
