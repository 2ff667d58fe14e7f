//! The page of the virtual camera, in turns.

use super::begin::TurnsError;
use super::line::Line;
use super::{CameraSource, Connected, ForeignError, StagedScene, Turns};
use nirspi::capture::Calibration;
use nirspi::response::Settling;
use nirspi::scene::SceneSource;
use nirspi::session::Session;
use nirspi_optics::CameraModel;
use nirspi_optics::rain::Air;
use nirspi_recon::Order;
use nirspi_virtual::{MemoryLink, VirtualOptics, calibrate_against_white};

impl Turns {
    /// The paper's camera with this seed before a letter, half of the patterns, with every method
    /// and the built-in networks on the processor. Its latency and settling are measured against a
    /// white sheet first.
    ///
    /// # Errors
    /// [`TurnsError`] if the built-in weights are damaged, or because of a bug.
    pub fn virtual_camera(seed: u64) -> Result<Self, TurnsError> {
        let model = CameraModel::paper().clone();
        let map = "letter:R".parse::<SceneSource>()?.load(256)?;
        let scene = StagedScene { map, distance_m: 0.3, air: Air::default() };
        let optics = VirtualOptics::before(&model, &scene.map, 1e3 * scene.distance_m)?;
        let setup = optics.setup(&Order::CakeCutting, 0.5)?;
        let settling = calibrate_against_white(&optics, seed)?;
        let line = Line::new(seed);
        let connect = {
            let (model, line) = (model.clone(), line.clone());
            move |scene: Option<&StagedScene>| {
                connected(scene.ok_or("no scene")?, &model, seed, &settling, &line)
            }
        };
        let source = CameraSource {
            address: "virtual".to_owned(),
            setup,
            model,
            scene: Some(scene),
            record_to: None,
            connect: Box::new(connect),
        };
        Self::with_every_method(source, Some(line))
    }
}

/// A virtual camera before this scene, behind this line.
fn connected(
    scene: &StagedScene,
    model: &CameraModel,
    seed: u64,
    settling: &Settling,
    line: &Line,
) -> Result<Connected, ForeignError> {
    let link = MemoryLink::new(scene.camera(model, seed)?);
    let mut session = Session::open(line.through(Box::new(link)))?;
    session.await_reports()?;
    let calibration = Calibration::Kept(settling.clone());
    Ok(Connected { session, calibration, note: None, flat_field: None })
}
