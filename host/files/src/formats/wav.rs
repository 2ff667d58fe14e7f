//! Samples of a WAV file, which audio interfaces and loggers write: integers of 8 to 32 bits, or 32-bit floats.

use super::{Columns, EXPECTED};
use crate::FileError;
use crate::field::Field;
use crate::plain::{MAX_MEMORY_BYTES, open_file};
use hound::{Error, SampleFormat, WavReader};
use nirspi_recon::words::count_of;
use std::io::{BufReader, ErrorKind};
use std::path::Path;

/// Channels as columns.
pub(super) const FORMAT: Columns = Columns { name: "a WAV file", is_start, read };

/// Whether a file with these first bytes is a WAV file.
fn is_start(start: &[u8]) -> bool {
    start.starts_with(b"RIFF") && start.get(8..12) == Some(b"WAVE")
}

/// The samples of each channel, as the file has them: integers are not scaled.
fn read(path: &Path) -> Result<Vec<Field>, FileError> {
    let (file, length) = open_file(path, EXPECTED)?;
    let wrong = |found: String| FileError::kind(path, format!("a WAV file {found}"), EXPECTED);
    let refused = |error: Error| match error {
        Error::IoError(error)
            if !matches!(error.kind(), ErrorKind::UnexpectedEof | ErrorKind::Other) =>
        {
            FileError::io(path, "read", error)
        }
        Error::IoError(_) => wrong("that ends before its samples do".to_owned()),
        Error::Unsupported => {
            wrong("of samples that are no integers and no 32-bit floats".to_owned())
        }
        error => wrong(format!("that cannot be read ({error})")),
    };
    let mut reader = WavReader::new(BufReader::new(file)).map_err(refused)?;
    let (spec, count) = (reader.spec(), u64::from(reader.len()));
    let channels = usize::from(spec.channels);
    if channels == 0 || count == 0 || !count.is_multiple_of(channels as u64) {
        let channels = count_of(channels, "channel");
        return Err(wrong(format!("of {count} samples in {channels}")));
    }
    if count * 8 > MAX_MEMORY_BYTES {
        let found = format!("of {count} samples");
        return Err(FileError::kind(path, format!("a WAV file {found}"), "at most 2^26 samples"));
    }
    // The file may claim more samples than it has bytes.
    let each = count.min(length) as usize / channels;
    let mut columns: Vec<Vec<f64>> = (0..channels).map(|_| Vec::with_capacity(each)).collect();
    let mut places = (0..channels).cycle();
    let mut add = |sample: Result<f64, Error>| {
        let sample = sample.map_err(refused)?;
        places.next().into_iter().for_each(|at| columns[at].push(sample));
        Ok(())
    };
    match spec.sample_format {
        SampleFormat::Int => {
            reader.samples::<i32>().try_for_each(|sample| add(sample.map(f64::from)))?;
        }
        SampleFormat::Float => {
            reader.samples::<f32>().try_for_each(|sample| add(sample.map(f64::from)))?;
        }
    }
    let field = |real: Vec<f64>| Field { shape: vec![real.len()], real, imaginary: None };
    Ok(columns.into_iter().map(field).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fields::Fields;
    use crate::testing::{file, line};
    use hound::{WavSpec, WavWriter};
    use std::io::Cursor;

    fn wav(channels: u16, bits_per_sample: u16, samples: &[i32]) -> Vec<u8> {
        let sample_format = match bits_per_sample {
            0 => SampleFormat::Float,
            _ => SampleFormat::Int,
        };
        let bits_per_sample = if bits_per_sample == 0 { 32 } else { bits_per_sample };
        let spec = WavSpec { channels, sample_rate: 48_000, bits_per_sample, sample_format };
        let mut bytes = Cursor::new(Vec::new());
        let mut writer = WavWriter::new(&mut bytes, spec).unwrap();
        for &sample in samples {
            match sample_format {
                SampleFormat::Int => writer.write_sample(sample).unwrap(),
                SampleFormat::Float => writer.write_sample(sample as f32 / 4.0).unwrap(),
            }
        }
        writer.finalize().unwrap();
        bytes.into_inner()
    }

    #[test]
    fn samples_of_every_kind_are_read_as_they_are() {
        let samples = [0, -7, 100, 127, -128, 3];
        for bits in [8, 16, 24, 32, 0] {
            let (_folder, path) = file("adc.wav", &wav(1, bits, &samples));
            let [field] = &read(&path).unwrap()[..] else { panic!("one channel") };
            let unit = if bits == 0 { 0.25 } else { 1.0 };
            assert_eq!(field.real, samples.map(|sample| unit * f64::from(sample)), "{bits} bits");
            assert!(Fields::open(&path, false).unwrap().is_unnamed());
        }
        let large = [8_388_607, -8_388_608];
        let (_folder, path) = file("adc.wav", &wav(1, 24, &large));
        assert_eq!(read(&path).unwrap()[0].real, large.map(f64::from));
    }

    #[test]
    fn channels_are_columns_with_their_numbers_for_names() {
        let (_folder, path) = file("adc.wav", &wav(2, 16, &[1, -1, 2, -2, 3, -3]));
        let mut fields = Fields::open(&path, false).unwrap();
        assert_eq!(
            (fields.names(), fields.format()),
            (&["1", "2"].map(str::to_owned)[..], "a WAV file")
        );
        let second = fields.read("2", |_| Ok(())).unwrap();
        assert_eq!((second.shape, second.real), (vec![3], vec![-1.0, -2.0, -3.0]));
    }

    #[test]
    fn a_file_that_is_cut_or_of_another_kind_is_refused_in_one_line() {
        let whole = wav(2, 16, &[5; 400]);
        for length in 12..whole.len() {
            let (_folder, path) = file("adc.wav", &whole[..length]);
            line(&Fields::open(&path, false).err().unwrap(), "adc.wav");
        }
        // MP3 in a WAV file, no channel, and a claim of 4 GiB.
        for (at, bytes) in [(20, &[0x55][..]), (22, &[0, 0]), (40, &[0xff; 4])] {
            let mut odd = wav(2, 16, &[5; 40]);
            odd[at..at + bytes.len()].copy_from_slice(bytes);
            let (_folder, path) = file("adc.wav", &odd);
            line(&Fields::open(&path, false).err().unwrap(), "adc.wav");
        }
    }
}
