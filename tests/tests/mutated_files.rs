//! Files of every kind that the program reads, damaged in many ways: each is read, or refused in one line that
//! is no panic, soon, whatever the bytes. The cases are few enough for every run and always the same; `tests/fuzz`
//! searches for others (`bash .ci/run fuzz`). Damaged `.mat`, HDF5 and JPEG files are in the unit tests of their
//! readers (`files::fields`, `files::image`).

#![expect(clippy::unwrap_used, reason = "what a test cannot set up, it cannot pass")]

use nirspi::calibration::KeptCalibration;
use nirspi::capture::{Calibration, CaptureOptions, Record, capture};
use nirspi::files::measurement::{self, Selection};
use nirspi::files::table::Table;
use nirspi::files::{image, npy};
use nirspi::identity::CameraIdentity;
use nirspi::order_table::read_order_table;
use nirspi::problem;
use nirspi::provenance::Made;
use nirspi::recording::{Recording, Target, tally_recording};
use nirspi::response::Settling;
use nirspi::session::Session;
use nirspi::setup::MeasurementSetup;
use nirspi::source::{Source, SourceOptions};
use nirspi_nets::weights::{Array, Precision, Weights};
use nirspi_optics::{CameraModel, Scene};
use nirspi_recon::Order;
use nirspi_serve::settings::Change;
use nirspi_update::gateware;
use nirspi_virtual::{MemoryLink, VirtualOptics, read_camera_model};
use nirspi_wire::tunnel::{REQUEST_BYTES, Request};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use std::fmt::Display;
use std::ops::ControlFlow;
use std::path::Path;
use std::time::{Duration, Instant};

/// Damaged copies of each file.
const CASES: u64 = 300;
/// The longest time for one copy, on a busy machine.
const LIMIT: Duration = Duration::from_secs(20);

/// A reader of bytes: what it says if it refuses them.
type Reader<'r> = &'r dyn Fn(&Path) -> Result<(), String>;

fn told<T>(result: Result<T, impl Display>) -> Result<(), String> {
    result.map(drop).map_err(|error| error.to_string())
}

/// Values that damaged files often have: wrong lengths and counts, NaN and infinity.
const LIES: [&[u8]; 10] = [
    &[0xFF; 8],
    &[0; 8],
    &[0xFF, 0xFF, 0xFF, 0x7F],
    &[0, 0, 0, 0x80],
    b"-1",
    b"NaN",
    b"1e999",
    b"4294967295",
    b"\"\\u0000",
    &[0xC3, 0x28],
];

/// A damaged copy: one to four changes, each of a kind that damage or malice makes.
fn damaged(whole: &[u8], dice: &mut Pcg64Mcg) -> Vec<u8> {
    let mut bytes = whole.to_vec();
    for _ in 0..=dice.random_range(0..4) {
        let at = dice.random_range(0..bytes.len().max(1));
        match dice.random_range(0..7) {
            0 if !bytes.is_empty() => bytes[at] ^= 1 << dice.random_range(0..8),
            1 => bytes.truncate(at),
            2 => bytes.insert(at, dice.random()),
            3 => {
                let end = (at + dice.random_range(0..16)).min(bytes.len());
                bytes.drain(at..end);
            }
            4 => {
                let lie = LIES[dice.random_range(0..LIES.len())];
                let end = (at + lie.len()).min(bytes.len());
                drop(bytes.splice(at..end, lie.iter().copied()));
            }
            5 => {
                // A part of the file comes twice.
                let end = (at + dice.random_range(0..64)).min(bytes.len());
                let part = bytes[at..end].to_vec();
                drop(bytes.splice(at..at, part));
            }
            // A digit of a text is another digit.
            _ => {
                if let Some(digit) = bytes.iter_mut().skip(at).find(|byte| byte.is_ascii_digit()) {
                    *digit = b'0' + dice.random_range(0..10) as u8;
                }
            }
        }
    }
    bytes
}

/// Reads damaged copies of a file; the file itself must be read.
fn survives(name: &str, whole: &[u8], read: Reader<'_>) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, whole).unwrap();
    assert_eq!(read(&path), Ok(()), "the file as it is");
    let mut refused = 0;
    for case in 0..CASES {
        let bytes = damaged(whole, &mut Pcg64Mcg::seed_from_u64(case));
        std::fs::write(&path, &bytes).unwrap();
        let begun = Instant::now();
        if let Err(line) = read(&path) {
            refused += 1;
            assert!(!line.is_empty() && line.lines().count() == 1, "{name}, case {case}: {line:?}");
        }
        assert!(begun.elapsed() < LIMIT, "{name}, case {case}: {:?}", begun.elapsed());
    }
    assert!(refused > 0, "{name}: no damage was noticed");
    println!("{name}: {refused} of {CASES} refused");
}

fn setup() -> MeasurementSetup {
    MeasurementSetup::new(&Order::Sequency, 0.03125).unwrap()
}

fn optics() -> VirtualOptics {
    VirtualOptics::new(Scene::new(vec![0.5; 64], 8, 48.0).unwrap(), 300.0).unwrap().ideal()
}

fn session() -> Session {
    Session::open(Box::new(MemoryLink::new(optics().camera(1).unwrap()))).unwrap()
}

/// The bytes of a recording of four frames.
fn recording() -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("rec.mcap");
    let options = CaptureOptions {
        setup: setup(),
        frames: Some(4),
        calibration: Calibration::None,
        record: Some(Record {
            target: Target::New(path.clone()),
            made: Made::by("a test", None, ["a test"], 0),
        }),
    };
    capture(&mut session(), &options, &mut |_| ControlFlow::Continue(())).unwrap();
    std::fs::read(path).unwrap()
}

#[test]
fn order_tables_and_tables_of_numbers() {
    let order = |path: &Path| match read_order_table(path) {
        Ok(table) => told(Order::Table(table).rows(nirspi_recon::Side::INSTRUMENT)),
        Err(error) => Err(error.to_string()),
    };
    let rows: Vec<String> = (0..1024).rev().map(|row| row.to_string()).collect();
    survives("order.txt", rows.join("\n").as_bytes(), &order);
    let table = |path: &Path| told(Table::read(path).and_then(|table| table.last_column()));
    survives("volumes.csv", b"place,volume\n1,2.5\n2,2.25\n3,1e1\n", &table);
}

#[test]
fn camera_descriptions() {
    let whole = CameraModel::named("paper").unwrap().to_toml();
    survives("lab.toml", whole.as_bytes(), &|path| told(read_camera_model(path.to_str().unwrap())));
}

#[test]
fn calibrations() {
    let camera: CameraIdentity = session().identity().clone();
    let settling = Settling {
        adc_latency: 6,
        response: vec![0.4, 0.9, 1.0],
        dark_counts: 2048.0,
        step_counts: 8000.0,
        noise_counts: 18.5,
        tile_sag: 0.0,
    };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("kept.json");
    let kept = KeptCalibration::new(camera.clone(), settling, Vec::new(), std::time::UNIX_EPOCH);
    kept.keep(Some(&path)).unwrap();
    survives("a.json", &std::fs::read(&path).unwrap(), &|path| {
        told(KeptCalibration::read(path, &camera))
    });
}

#[test]
fn pictures_and_arrays() {
    let grey: Vec<f32> = (0..64).map(|k| k as f32 / 63.0).collect();
    survives("a.png", &image::encode_grey(8, 8, &grey, &provenance()), &|path| {
        told(image::read_grey(path))
    });
    survives("a.npy", &npy::encode(&[1, 8, 8], &grey), &|path| told(npy::read_stack(path)));
}

#[test]
fn measurements_in_every_form() {
    let read = |path: &Path| told(measurement::read(path, &Selection::default()));
    let rows: Vec<u32> = (0..16).collect();
    let readings: Vec<f64> = (0..32).map(|k| f64::from(k * 7 % 11)).collect();
    let rows = nirspi_recon::Rows::new(nirspi_recon::Side::new(4).unwrap(), rows).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("m.npz");
    let measurements =
        nirspi_recon::Measurements::from_pairs(&rows, &readings).unwrap().measurements;
    let npz = measurement::encode(&path, &measurements, &provenance()).unwrap();
    survives("m.npz", &npz, &read);
    let shown = Selection {
        shown: Some(Order::Natural),
        side: Some(nirspi_recon::Side::new(4).unwrap()),
        ..Selection::default()
    };
    let text: Vec<String> = readings.iter().map(f64::to_string).collect();
    survives("m.csv", text.join("\n").as_bytes(), &|path| told(measurement::read(path, &shown)));
    survives("y.npy", &npy::encode(&[32], &readings), &|path| {
        told(measurement::read(path, &shown))
    });
    survives("problem.npz", &npz, &|path| match problem::read(path) {
        // A file of measurements is no problem for a pursuit, and says so.
        Err(error) if path.metadata().unwrap().len() == npz.len() as u64 => {
            assert_eq!(error.to_string().lines().count(), 1);
            Ok(())
        }
        other => told(other),
    });
}

#[test]
fn recordings_are_read_tallied_and_reconstructed() {
    survives("rec.mcap", &recording(), &|path| {
        let mut recording = Recording::open(path).map_err(|error| error.to_string())?;
        told(tally_recording(&mut recording))?;
        told(Source::read_all(path, &SourceOptions::default()))
    });
}

#[test]
fn weights_of_networks() {
    let mut weights = Weights::new("small");
    for (name, shape) in [("a.weight", vec![4, 3, 3]), ("a.bias", vec![4])] {
        let count: usize = shape.iter().product();
        let values = (0..count).map(|k| k as f32 / 8.0).collect();
        weights.insert(name.to_owned(), Array { shape, values });
    }
    weights.set_metadata("model", "small");
    let whole = weights.to_bytes(Precision::Single).unwrap();
    survives("small.safetensors", &whole, &|path| {
        let weights = Weights::read(path).map_err(|error| error.to_string())?;
        told(weights.expect_model("small"))?;
        told(weights.tensor("a.weight", &[4, 3, 3]))?;
        told(weights.tensor("a.bias", &[4]))
    });
}

#[test]
fn what_a_page_asks_for() {
    let whole = br#"{"method":"omp","strength":0.5,"frames":10,"order":"zig-zag","sampling":0.3,"run":true}"#;
    survives("change.json", whole, &|path| told(Change::parse(&std::fs::read(path).unwrap())));
}

#[test]
fn bitstreams() {
    let whole: Vec<u8> = [0xFF, 0x00].into_iter().chain(0..200).chain([0xFF; 40]).collect();
    let mut session = session();
    survives("top.bit", &whole, &|path| {
        let bytes = std::fs::read(path).unwrap();
        // This camera takes no gateware, and says so without a look at the bytes.
        match nirspi_mcu::staging::stored(&bytes) {
            Some(_) => Ok(()),
            None => Err("no bitstream".to_owned()),
        }
    });
    let refused = gateware::load(&mut session, b"\x7fELF", &mut |_| {}).unwrap_err();
    assert_eq!(refused.to_string().lines().count(), 1);
}

#[test]
fn requests_of_the_tunnel() {
    let mut dice = Pcg64Mcg::seed_from_u64(1);
    let mut taken = 0;
    for _ in 0..100_000 {
        let mut bytes = [0; REQUEST_BYTES];
        bytes.fill_with(|| dice.random());
        let mut head = Request::from_bytes(&bytes);
        if head.is_none() {
            // The same with a right checksum.
            let crc = nirspi_wire::crc32(&bytes[..REQUEST_BYTES - 4]);
            bytes[REQUEST_BYTES - 4..].copy_from_slice(&crc.to_le_bytes());
            head = Request::from_bytes(&bytes);
        }
        if let Some(request) = head {
            taken += 1;
            assert!(request.reply_data() <= nirspi_wire::fpga::MAX_FRAME_BYTES);
        }
    }
    assert!(taken > 0, "no request was one");
}

/// A provenance for files of tests.
fn provenance() -> nirspi::provenance::Provenance {
    use nirspi::provenance::{Origin, Taken};
    Taken::without_camera(Origin::Simulated).made(&Made::by("test", None, ["test"], 0))
}
