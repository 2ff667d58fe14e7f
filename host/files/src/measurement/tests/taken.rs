//! Where readings come from, by what their file says.

use super::*;
use crate::contents::Contents;
use crate::provenance::tests::provenance;
use crate::provenance::{Origin, Taken, beside_array};
use crate::trace::{self, Cut};

fn expected() -> Taken {
    let taken = provenance().taken;
    assert!(taken.camera.is_some());
    taken
}

/// An archive of four differences with this provenance.
fn archive(provenance: &str, simulated: i32) -> Vec<u8> {
    let members = [
        ("n.npy", npy_i32("()", &[2])),
        ("h_row.npy", npy_i32("(4,)", &[0, 1, 2, 3])),
        ("d.npy", npy_f64("(4,)", &[4.0, 1.0, 2.0, -1.0])),
        ("simulated.npy", npy_i32("()", &[simulated])),
        ("provenance.npy", crate::npy::encode_text(provenance)),
    ];
    zip(Zip::Stored, &members)
}

#[test]
fn the_camera_of_a_file_is_kept_by_every_reader() {
    let json = provenance().json();
    let table = format!(
        "# mean of 12 frames\n# provenance: {json}\nn,h_row,d\n2,0,4\n2,1,1\n2,2,2\n2,3,-1\n"
    );
    let weights: Vec<f64> = (0..16).map(|k| f64::from(k % 5)).collect();
    let (_kept, matrix) = file("matrix.npy", &npy_f64("(4, 2, 2)", &weights));
    for (name, bytes) in [("m.npz", archive(&json, 1)), ("m.csv", table.into_bytes())] {
        let (_guard, path) = file(name, &bytes);
        assert_eq!(read(&path, &as_is()).unwrap().taken, expected(), "{name}");
        let named = expected().from_file(&path);
        assert_eq!(Contents::open(&path, false).unwrap().taken(), named, "{name}");
        let cut = Cut { samples: Some(2), field: Some("d".to_owned()), ..Cut::default() };
        assert_eq!(trace::read(&path, &cut).unwrap().taken, named, "{name}");
        let plain = read_plain(&matrix, &PatternSelection::default(), &path, &as_is()).unwrap();
        assert_eq!(plain.taken, expected(), "{name}");
    }
    // An array has its provenance beside it.
    let (_guard, path) = file("d.npy", &npy_f64("(4,)", &[4.0, 1.0, 2.0, -1.0]));
    let natural = || Selection {
        shown: Some(Order::Natural),
        form: Some(Form::Differences),
        ..Selection::default()
    };
    assert_eq!(read(&path, &natural()).unwrap().taken, Taken::simulated_or(None));
    let signed = provenance().sign(&serde_json::json!({})).unwrap();
    std::fs::write(beside_array(&path), signed).unwrap();
    assert_eq!(read(&path, &natural()).unwrap().taken, expected());
    let cut = Cut { samples: Some(2), ..Cut::default() };
    assert_eq!(trace::read(&path, &cut).unwrap().taken, expected().from_file(&path));
}

#[test]
fn a_provenance_that_says_nothing_leaves_what_the_file_says() {
    let unknown = provenance().json().replace("\"simulated\"", "\"unknown (readings of a file)\"");
    for (json, simulated, origin) in [
        ("nonsense", 1, Origin::Simulated),
        (&unknown, 0, Origin::Measured),
        ("{\"origin\": 3}", 0, Origin::Measured),
    ] {
        let (_guard, path) = file("m.npz", &archive(json, simulated));
        let taken = read(&path, &as_is()).unwrap().taken;
        assert_eq!((taken.origin, taken.camera), (origin, None), "{json}");
    }
}
