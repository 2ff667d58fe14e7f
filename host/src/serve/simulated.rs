//! The page of the virtual camera, in turns.

use super::imaging::ImagingError;
use super::line::Line;
use super::settings::{Measuring, Settings};
use super::{CameraSource, Connected, ForeignError, Imaging, StagedScene, Turns};
use crate::calibration::Settling;
use crate::capture::Calibration;
use crate::scene::{SceneError, SceneSource};
use crate::session::Session;
use crate::virtual_camera::{
    MemoryLink, ShotError, VirtualOptics, VirtualOpticsError, calibrate_against_white,
};
use nirspi_nets::{Device, deblur::Model};
use nirspi_optics::CameraModel;
use nirspi_optics::rain::Air;
use nirspi_recon::reconstruct::{Method, MethodSettings};
use nirspi_recon::{Order, RowsError};
use thiserror::Error;

/// Why the virtual camera's page cannot begin.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum SimulatedError {
    /// The scene cannot be drawn.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The optics cannot be built.
    #[error(transparent)]
    Optics(#[from] VirtualOpticsError),
    /// The camera cannot be calibrated.
    #[error(transparent)]
    Calibration(#[from] ShotError),
    /// The patterns cannot be computed.
    #[error(transparent)]
    Rows(#[from] RowsError),
    /// The camera does not answer.
    #[error("the virtual camera does not answer")]
    Camera(#[source] ForeignError),
    /// Methods or networks cannot be prepared.
    #[error(transparent)]
    Imaging(#[from] ImagingError),
}

impl Turns {
    /// The paper's camera with this seed before a letter, half of the patterns, with every method
    /// and the built-in networks on the processor. Its latency and settling are measured against a
    /// white sheet first.
    ///
    /// # Errors
    /// [`SimulatedError`] if the built-in weights are damaged, or because of a bug.
    pub fn virtual_camera(seed: u64) -> Result<Self, SimulatedError> {
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
        let network = Some(nirspi_nets::prior::shipped());
        let methods = MethodSettings { network, ..MethodSettings::default() };
        let imaging = Imaging::new(&methods, Device::cpu())?;
        let settings = Settings {
            method: Method::default().argument(),
            strength: None,
            enhance: true,
            model: Model::DIFFUSION.name(),
            frames: 64,
            measuring: Measuring::of(&source.setup),
            record: false,
        };
        Self::new(source, imaging, settings, Some(line)).map_err(SimulatedError::Camera)
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
