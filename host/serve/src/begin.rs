//! The beginning of a page in turns: what it offers, and why it cannot begin.

use super::imaging::ImagingError;
use super::line::Line;
use super::settings::Settings;
use super::{CameraSource, Connected, ForeignError, Imaging, StagedScene, Turns};
use nirspi::capture::Calibration;
use nirspi::link::Link;
use nirspi::scene::SceneError;
use nirspi::session::Session;
use nirspi::setup::MeasurementSetup;
use nirspi_nets::Device;
use nirspi_optics::CameraModel;
use nirspi_recon::reconstruct::Method;
use nirspi_recon::{Order, RowsError};
use nirspi_virtual::{ShotError, VirtualOpticsError};
use thiserror::Error;

/// Why a page in turns cannot begin.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum TurnsError {
    /// The scene cannot be drawn.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The optics cannot be built.
    #[error(transparent)]
    Optics(#[from] VirtualOpticsError),
    /// The virtual camera cannot be calibrated.
    #[error(transparent)]
    Calibration(#[from] ShotError),
    /// The patterns cannot be computed.
    #[error(transparent)]
    Rows(#[from] RowsError),
    /// There is no session with the camera.
    #[error("the camera does not answer")]
    Camera(#[source] ForeignError),
    /// Methods or networks cannot be prepared.
    #[error(transparent)]
    Imaging(#[from] ImagingError),
}

impl Turns {
    /// A real camera behind the links that `open` opens, one for each session: half of the
    /// patterns, with every method and the built-in networks on the processor. Each run measures
    /// the camera's latency and settling first.
    ///
    /// # Errors
    /// [`TurnsError`] if the camera does not answer, or because of a bug.
    pub fn linked(
        address: &str,
        mut open: impl FnMut() -> Result<Box<dyn Link>, ForeignError> + Send + 'static,
    ) -> Result<Self, TurnsError> {
        let model = CameraModel::paper().clone();
        let readout = model.readout;
        let setup = MeasurementSetup::new(&Order::CakeCutting, 0.5)?
            .timed(readout.clocks_per_pattern, readout.blanked);
        let connect = move |_: Option<&StagedScene>| {
            let mut session = Session::open(open()?)?;
            session.await_reports()?;
            Ok::<_, ForeignError>(Connected {
                session,
                calibration: Calibration::Measure,
                note: None,
                flat_field: None,
            })
        };
        let source = CameraSource {
            address: address.to_owned(),
            setup,
            model,
            scene: None,
            record_to: None,
            connect: Box::new(connect),
        };
        Self::with_every_method(source, None)
    }

    /// A page with every method and the built-in networks on the processor.
    pub(super) fn with_every_method(
        source: CameraSource,
        line: Option<Line>,
    ) -> Result<Self, TurnsError> {
        let imaging = Imaging::new(&nirspi_nets::prior::settings(), Device::cpu())?;
        let settings = Settings::new(Method::default(), 64, &source.setup);
        Self::new(source, imaging, settings, line).map_err(TurnsError::Camera)
    }
}
