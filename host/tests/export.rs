//! What an exported file holds is what `reconstruct` takes of the recording.

#![expect(clippy::unwrap_used, reason = "what a test cannot set up, it cannot pass")]

use nirspi::export::{ExportOptions, Format, export};
use nirspi::files::measurement::Selection;
use nirspi::imaging::{Enhance, ImageContext, KnownReadings, MethodReport, SPREAD_COPIES, White};
use nirspi::provenance::Made;
use nirspi::recording::Recording;
use nirspi::source::{Source, SourceOptions};
use nirspi_nets::Device;
use nirspi_recon::reconstruct::Method;
use nirspi_recon::{Order, Side};
use std::path::{Path, PathBuf};

fn made() -> Made {
    Made::by("nirspi 0.1.0", None, ["nirspi", "export", "rec.mcap"], 1_764_059_400)
}

fn recording() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/recordings/v1.mcap")
}

fn image_bits(source: &Source) -> Vec<u32> {
    let method = Method::default().prepare(&nirspi_nets::prior::settings()).unwrap();
    let image = method.reconstruct(&source.measurements).unwrap().image;
    image.pixels().iter().map(|pixel| pixel.to_bits()).collect()
}

fn exported(format: Format, options: &ExportOptions) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join(format!("rec.{}", format.name()));
    let exported = export(&recording(), &out, format, options, &made()).unwrap();
    assert_eq!((exported.frames, exported.patterns), (12, 256));
    assert_eq!(exported.bytes, std::fs::metadata(&out).unwrap().len());
    (folder, out)
}

#[test]
fn an_exported_file_gives_the_image_of_the_recording_to_the_bit() {
    for keep_leak in [false, true] {
        let plain = SourceOptions { keep_leak, ..SourceOptions::default() };
        let options = ExportOptions { keep_leak, ..ExportOptions::default() };
        let whole = Source::read(&recording(), &plain).unwrap();
        let frames = Source::read_all(&recording(), &plain).unwrap();
        for format in [Format::Npz, Format::Csv] {
            let (_folder, out) = exported(format, &options);
            let read = Source::read(&out, &SourceOptions::default()).unwrap();
            assert_eq!(read.measurements, whole.measurements, "{format:?}");
            assert_eq!(image_bits(&read), image_bits(&whole), "{format:?}");
        }
        let (_folder, csv) = exported(Format::Csv, &options);
        let text = std::fs::read_to_string(csv).unwrap();
        assert!(text.starts_with("# mean of 12 frames, ADC counts, simulated\n"), "{text}");
        let (_folder, npz) = exported(Format::Npz, &options);
        let (_other, npy) = exported(Format::Npy, &options);
        let of_npz = Selection {
            field: Some("frames".to_owned()),
            form: Some("differences".parse().unwrap()),
            ..Selection::default()
        };
        let of_npy = Selection {
            shown: Some(Order::CakeCutting),
            side: Some(Side::INSTRUMENT),
            form: of_npz.form,
            ..Selection::default()
        };
        for (path, file) in [(npz, of_npz), (npy, of_npy)] {
            let options = SourceOptions { file, ..SourceOptions::default() };
            let read = Source::read_all(&path, &options).unwrap();
            assert_eq!(read.len(), 12);
            for (read, frame) in read.iter().zip(&frames) {
                // A file of frames does not state the noise of one, which the recording knows.
                let (read, frame) = (&read.measurements, &frame.measurements);
                assert_eq!((read.rows(), read.values()), (frame.rows(), frame.values()));
                assert_eq!((read.noise(), frame.noise().is_some()), (None, true));
            }
        }
    }
}

/// The pixels of the images of a topic of an MCAP file.
fn images(file: &[u8], topic: &str, side: usize) -> Vec<Vec<f32>> {
    let all = mcap::MessageStream::new(file).unwrap().map(Result::unwrap);
    let of_topic = all.filter(|message| message.channel.topic == topic);
    of_topic
        .map(|message| {
            // After the pixels stands the frame of reference: key, length and "nirspi".
            let end = message.data.len() - 8;
            let bytes = &message.data[end - 4 * side * side..end];
            bytes
                .chunks_exact(4)
                .map(|pixel| f32::from_le_bytes(pixel.try_into().unwrap()))
                .collect()
        })
        .collect()
}

#[test]
fn an_exported_recording_has_enhanced_images_and_their_spread_if_asked() {
    let (_folder, plain) = exported(Format::Mcap, &ExportOptions::default());
    let plain = std::fs::read(plain).unwrap();
    for topic in ["/enhanced", "/spread", "/interval"] {
        assert!(images(&plain, topic, 64).is_empty(), "{topic}");
    }
    let options = ExportOptions { enhance: true, ..ExportOptions::default() };
    let (_folder, out) = exported(Format::Mcap, &options);
    let out = std::fs::read(out).unwrap();
    assert_eq!(images(&out, "/image", 32), images(&plain, "/image", 32));

    let whole = Source::read(&recording(), &SourceOptions::default()).unwrap();
    let method = Method::default().prepare(&nirspi_nets::prior::settings()).unwrap();
    let image = method.reconstruct(&whole.measurements).unwrap();
    let report = MethodReport { method: Method::default(), made: image.report.clone() };
    let image = image.with_readings(&whole.measurements);
    let settings = nirspi_nets::prior::settings();
    let readings = KnownReadings::new(&report, &settings, &whole.measurements);
    let (rows, copies) = (Some(whole.measurements.rows()), SPREAD_COPIES);
    let context = ImageContext { rows, readings, copies, ..ImageContext::default() };
    let enhance = Enhance::built_in(&Device::cpu()).unwrap();
    let made = enhance.enhance(&image, White::Brightest, &context).unwrap();
    assert_eq!(images(&out, "/enhanced", 64), [made.pixels]);
    let spread = made.spread.unwrap();
    assert!(spread.iter().all(|&spread| (0.0..0.5).contains(&spread)), "a standard deviation");
    assert!(spread.iter().any(|&spread| spread > 0.0));
    assert_eq!(images(&out, "/spread", 64), [spread]);
    // The spread of the sweeps tells the noise of the readings.
    assert_eq!(images(&out, "/interval", 64), [made.half_width.unwrap()]);
}

#[test]
fn nothing_is_left_of_an_export_that_fails() {
    let folder = tempfile::tempdir().unwrap();
    let cut = folder.path().join("cut.mcap");
    let bytes = std::fs::read(recording()).unwrap();
    std::fs::write(&cut, &bytes[..200]).unwrap();
    for (input, out, overwrite, told) in [
        (cut.clone(), "rec.npz", false, "no identity in the recording"),
        (recording(), "none/rec.npz", false, "none: cannot write to it: no such file or folder"),
        (recording(), "cut.mcap", false, "cut.mcap: is there already"),
        (cut.clone(), "cut.mcap", true, "cut.mcap: the result is made of this file"),
    ] {
        let out = folder.path().join(out);
        let options = ExportOptions { overwrite, ..ExportOptions::default() };
        let error = export(&input, &out, Format::Npz, &options, &made()).unwrap_err();
        let line = nirspi::causes::in_one_line(&error);
        assert!(line.contains(told), "{line}");
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    assert_eq!(Format::Npz.beside(Path::new("a/rec.mcap")), Path::new("a/rec.npz"));
    assert!(Recording::open(&recording()).is_ok());
}
