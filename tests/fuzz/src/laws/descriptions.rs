//! Camera descriptions, calibrations, flat fields, order tables, settings files.

use crate::{Law, MIB, place, read, seeds};
use nirspi::calibration::{KeptCalibration, KeptFlatField};
use nirspi::order_table::read_order_table;
use nirspi::response::Settling;
use nirspi::settings::{Options, Takes, from_file};
use nirspi_optics::CameraModel;
use nirspi_recon::{Order, Side};
use nirspi_virtual::read_camera_model;
use std::collections::BTreeMap;
use std::time::UNIX_EPOCH;

pub const LAWS: &[Law] = &[
    Law {
        name: "cameras",
        reads: "a camera description (TOML)",
        readers: &["host/virtual/src/model.rs", "host/optics/src/camera/file.rs"],
        holds: cameras,
        seeds: camera_seeds,
        longest: 8192,
        most_memory: 16 * MIB,
    },
    Law {
        name: "calibrations",
        reads: "a kept calibration (JSON)",
        readers: &[
            "host/camera/src/calibration/kept.rs",
            "host/camera/src/calibration/file.rs",
            "host/camera/src/response.rs",
        ],
        holds: calibrations,
        seeds: || vec![serde_json::to_vec(&calibration()).expect("JSON")],
        longest: 4096,
        most_memory: 16 * MIB,
    },
    Law {
        name: "flat-fields",
        reads: "a kept flat field (JSON)",
        readers: &[
            "host/camera/src/calibration/flat/kept.rs",
            "host/camera/src/calibration/flat/mod.rs",
            "host/camera/src/calibration/file.rs",
        ],
        holds: flat_fields,
        seeds: || vec![flat_field(1024), flat_field(4)],
        longest: 12_288,
        most_memory: 16 * MIB,
    },
    Law {
        name: "orders",
        reads: "an order table (text)",
        readers: &["host/src/order_table.rs", "host/patterns/src/rows.rs"],
        holds: orders,
        seeds: order_seeds,
        longest: 6144,
        most_memory: 16 * MIB,
    },
    Law {
        name: "settings-files",
        reads: "a settings file (TOML)",
        readers: &["host/src/settings.rs"],
        holds: settings_files,
        seeds: settings_seeds,
        longest: 2048,
        most_memory: 16 * MIB,
    },
];

fn cameras(bytes: &[u8]) {
    let path = place::file("lab.toml", bytes);
    let Some(model) = read(read_camera_model(path.to_str().expect("our own path"))) else { return };
    assert!(model.validate().is_ok(), "a camera that is not valid was read");
    let again = CameraModel::parse(&model.to_toml()).expect("our own file");
    assert_eq!(again, model, "another camera");
    assert_eq!(again.digest(), model.digest());
}

fn camera_seeds() -> Vec<Vec<u8>> {
    let shipped = CameraModel::names().filter_map(CameraModel::shipped_text);
    let mut all: Vec<Vec<u8>> = shipped.map(|text| text.as_bytes().to_vec()).collect();
    all.push(b"name = \"lab\"\n[leds]\npower_mw = 2\n".to_vec());
    all
}

fn calibration() -> KeptCalibration {
    let settling = Settling {
        adc_latency: 6,
        response: vec![0.4, 0.9, 1.0],
        dark_counts: 2048.0,
        step_counts: 8000.0,
        noise_counts: 18.5,
        tile_sag: 0.0,
    };
    KeptCalibration::new(seeds::identity().clone(), settling, Vec::new(), UNIX_EPOCH)
}

fn calibrations(bytes: &[u8]) {
    let path = place::file("kept.json", bytes);
    let camera = seeds::identity();
    let Some(kept) = read(KeptCalibration::read(&path, camera)) else { return };
    kept.settling.check().expect("what was read can be");
    // What a capture makes of it is finite, or refused in one line.
    for (clocks, blanked) in [(5, 2), (1, 0), (40, 39)] {
        if let Some(leak) = read(kept.settling.leak(clocks, blanked)) {
            assert!(!format!("{leak:?}").contains("NaN"), "{leak:?}");
        }
    }
    let path = place::path("again.json");
    kept.keep(Some(&path)).expect("its file");
    assert_eq!(KeptCalibration::read(&path, camera).expect("our own file"), kept);
}

/// A flat field of so many numbers, of which the program writes 1024.
fn flat_field(pixels: usize) -> Vec<u8> {
    let camera = serde_json::to_value(seeds::identity()).expect("JSON");
    let white: Vec<f64> = (0..pixels).map(|at| 100.0 + (at % 7) as f64).collect();
    let kept = serde_json::json!({
        "kind": "nirspi flat field", "version": 1, "measured_unix_s": 0, "measured": "now",
        "camera": camera, "sweeps": {"white": 8, "dark": 0, "map": 8, "check": 8},
        "pattern_before": 0.1, "pattern_after": 0.01,
        "flat": {"white_counts": white, "white_noise_counts": 0.5, "dark_counts": null, "dead_leds": []},
    });
    kept.to_string().into_bytes()
}

fn flat_fields(bytes: &[u8]) {
    let path = place::file("kept.flat.json", bytes);
    let camera = seeds::identity();
    let Some(kept) = read(KeptFlatField::read(&path, camera)) else { return };
    crate::is_one_line(&kept.summary());
    let side = Side::INSTRUMENT;
    assert_eq!(kept.flat.gain().len(), side.area());
    assert!(kept.flat.gain().iter().all(|gain| gain.is_finite()), "a gain that is no number");
    assert!(kept.flat.dead_leds().iter().flatten().all(|place| *place < 32));
    let image = nirspi_recon::Image::new(side, vec![1.0; side.area()]);
    let corrected = kept.flat.correct(&image);
    assert!(corrected.pixels().iter().all(|pixel| pixel.is_finite()), "a pixel that is no number");
    let path = place::path("again.flat.json");
    kept.keep(Some(&path)).expect("its file");
    assert_eq!(KeptFlatField::read(&path, camera).expect("our own file"), kept);
}

fn orders(bytes: &[u8]) {
    let path = place::file("order.txt", bytes);
    let Some(table) = read(read_order_table(&path)) else { return };
    for pixels in [2, 32] {
        let side = Side::new(pixels).expect("a side");
        let Some(rows) = read(Order::Table(table.clone()).rows(side)) else { continue };
        assert_eq!(rows.as_slice(), &table[..], "another order");
        let mut sorted = table.clone();
        sorted.sort_unstable();
        sorted.dedup();
        assert_eq!(sorted.len(), table.len(), "a row twice");
        assert!(sorted.iter().all(|row| (*row as usize) < side.area()));
    }
}

fn order_seeds() -> Vec<Vec<u8>> {
    let rows = |count: u32| (0..count).rev().map(|row| format!("{row}\n")).collect::<String>();
    vec![rows(1024).into_bytes(), rows(4).into_bytes(), b"# mine\n3, 1\n 0 2\n".to_vec()]
}

/// A program of a few commands.
fn options() -> Options {
    let own = |names: &[(&str, Takes)]| -> BTreeMap<String, Takes> {
        names.iter().map(|(name, takes)| ((*name).to_owned(), *takes)).collect()
    };
    let capture = Options {
        own: own(&[
            ("frames", Takes::Value),
            ("distance-m", Takes::Value),
            ("json", Takes::Nothing),
        ]),
        commands: BTreeMap::new(),
    };
    let commands = BTreeMap::from([("capture".to_owned(), capture)]);
    Options { own: own(&[("camera", Takes::Value), ("quiet", Takes::Nothing)]), commands }
}

fn settings_files(bytes: &[u8]) {
    let path = place::file("nirspi.toml", bytes);
    let all = options();
    for command in [&[][..], &["capture".to_owned()][..]] {
        let Some(found) = read(from_file(&path, &all, command)) else { continue };
        for (name, given) in found {
            let known = all.own.get(&name).or_else(|| all.commands["capture"].own.get(&name));
            let takes = known.expect("an option of the program");
            if let Some(given) = given {
                crate::is_one_line(&given.origin);
                assert_eq!(given.values.is_empty(), *takes == Takes::Nothing, "{name}: {given:?}");
            }
        }
    }
}

fn settings_seeds() -> Vec<Vec<u8>> {
    let texts: [&[u8]; 3] = [
        b"camera = \"virtual\"\nquiet = true\n[capture]\nframes = 10\ndistance-m = 0.3\njson = false\n",
        b"[capture]\nframes = [1, 2]\n",
        b"distance_m = 1\n",
    ];
    texts.map(<[u8]>::to_vec).to_vec()
}
