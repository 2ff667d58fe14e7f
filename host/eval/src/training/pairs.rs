//! Pairs of sharp scenes and pictures of the virtual camera, as a file for training:
//! `python -m nirspi.train` reads it, and so can other programs.
//!
//! # Invariant
//! Pair k depends on the seed and k only, so a longer file begins with the shorter one
//! (`tests::a_longer_file_begins_with_the_shorter_one_and_is_whole`).

use super::{CameraPicture, LinearCamera, Rainfall, TrainingCameraError};
use nirspi::files::FileError;
use nirspi::files::provenance::FIELD;
use nirspi::files::{archive, npy};
use nirspi::provenance::Provenance;
use nirspi_nets::data::{Origin, Part, Purpose, SIDE_PX, Scene, Scenes, stream};
use nirspi_nets::degrade::READING_PX;
use rayon::prelude::*;
use std::path::Path;

/// A scene and its picture.
#[derive(Debug, Clone, PartialEq)]
pub struct Pair {
    /// The sharp scene.
    pub scene: Scene,
    /// The camera's picture.
    pub picture: CameraPicture,
}

/// Takes pictures of `count` scenes. `taken` is called after each picture.
///
/// # Errors
/// [`TrainingCameraError`] of the first scene that cannot be taken.
pub fn take(
    scenes: &Scenes,
    part: Part,
    camera: &LinearCamera,
    count: usize,
    seed: u64,
    taken: &(dyn Fn() + Sync),
) -> Result<Vec<Pair>, TrainingCameraError> {
    (0..count as u64)
        .into_par_iter()
        .map(|index| {
            let mut rng = stream(seed, Purpose::Pairs, index);
            let scene = scenes.draw(part, &mut rng);
            let conditions = camera.conditions(&mut rng)?;
            let picture = camera.picture(&scene.image, conditions, &mut rng)?;
            taken();
            Ok(Pair { scene, picture })
        })
        .collect()
}

/// The bytes of a `.npz` file of pairs.
///
/// | field | content |
/// |---|---|
/// | `provenance` | text: JSON |
/// | `x` | `(N, 64, 64)` float32: the scene, sharp |
/// | `optical` | `(N, 64, 64)` float32: the scene as light showed it, before sampling and noise |
/// | `y` | `(N, 32, 32)` float32: the camera's image; 1 is a white target |
/// | `depth_m` | `(N, 8, 8)` float32: metres, 0 for a zone without a reading |
/// | `sigma_px`, `noise_std`, `sampling` | `(N,)` float32: blur in pixels of the 64 grid, noise of `y`, share of patterns |
/// | `distance_m` | `(N,)` float32 |
/// | `rain`, `sweeps` | `(N,)` int64: 0 none, 1 light, 2 heavy; sweeps summed |
/// | `label`, `stack`, `index`, `group` | `(N,)` int64: class, stack (in the order given), image in it, its group; -1 if none |
///
/// # Errors
/// [`FileError`] naming `path`, if the archive cannot be written.
pub fn encode(
    path: &Path,
    scenes: &Scenes,
    pairs: &[Pair],
    provenance: &Provenance,
) -> Result<Vec<u8>, FileError> {
    let count = pairs.len();
    let images = |side: usize, of: &dyn Fn(&Pair) -> &[f32]| {
        let values: Vec<f32> = pairs.iter().flat_map(|pair| of(pair).iter().copied()).collect();
        npy::encode(&[count, side, side], &values)
    };
    let floats = |of: &dyn Fn(&Pair) -> f32| {
        npy::encode(&[count], &pairs.iter().map(of).collect::<Vec<f32>>())
    };
    let integers = |of: &dyn Fn(&Pair) -> i64| {
        npy::encode(&[count], &pairs.iter().map(of).collect::<Vec<i64>>())
    };
    let place = |pair: &Pair| match pair.scene.origin {
        Origin::Stack(place) => Some(place),
        Origin::Shape(_) => None,
    };
    let depth: Vec<f32> = pairs
        .iter()
        .flat_map(|pair| pair.picture.reading.depth.as_ref().map_or([0.0; 64], |d| d.metres))
        .collect();
    let members = [
        (FIELD, npy::encode_text(&provenance.json())),
        ("x", images(SIDE_PX, &|p| &p.scene.image)),
        ("optical", images(SIDE_PX, &|p| &p.picture.reading.optical)),
        ("y", images(READING_PX, &|p| &p.picture.reading.image)),
        ("depth_m", npy::encode(&[count, 8, 8], &depth)),
        ("sigma_px", floats(&|p| p.picture.reading.sigma_px)),
        ("noise_std", floats(&|p| p.picture.reading.noise_std)),
        ("sampling", floats(&|p| p.picture.reading.sampling)),
        ("distance_m", floats(&|p| (p.picture.conditions.distance_mm * 1e-3) as f32)),
        (
            "rain",
            integers(&|p| match p.picture.conditions.rain {
                Rainfall::None => 0,
                Rainfall::Light => 1,
                Rainfall::Heavy => 2,
            }),
        ),
        ("sweeps", integers(&|p| i64::from(p.picture.conditions.sweeps))),
        ("label", integers(&|p| p.scene.label.map_or(-1, i64::from))),
        ("stack", integers(&|p| place(p).map_or(-1, |place| place.stack as i64))),
        ("index", integers(&|p| place(p).map_or(-1, |place| place.image as i64))),
        (
            "group",
            integers(&|p| {
                place(p).map_or(-1, |at| i64::from(scenes.stacks()[at.stack].groups()[at.image]))
            }),
        ),
    ];
    archive::encode(path, &members)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::provenance;
    use nirspi_optics::CameraModel;

    #[test]
    fn a_longer_file_begins_with_the_shorter_one_and_is_whole() {
        let scenes = Scenes::procedural();
        let camera = LinearCamera::new(CameraModel::paper(), 1).unwrap();
        let take = |count| take(&scenes, Part::Training, &camera, count, 7, &|| ()).unwrap();
        let (two, four) = (take(2), take(4));
        assert_eq!(two[..], four[..2]);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("pairs.npz");
        std::fs::write(&path, encode(&path, &scenes, &four, &provenance()).unwrap()).unwrap();
        let mut archive = archive::Archive::open(&path).unwrap();
        let y = archive.numbers_of::<f32>("y", |_| Ok(())).unwrap();
        assert_eq!(y.shape, [4, 32, 32]);
        assert_eq!(y.values[..1024], four[0].picture.reading.image);
    }
}
