//! `--camera`: opens the camera that is meant, and says on stderr what it reports from before.

use super::camera::SceneArgs;
use super::print;
use anyhow::{Context, Result};
pub use nirspi::link::CameraAddress;
use nirspi::link::Link;
use nirspi::session::Session;
use nirspi::virtual_camera::MemoryLink;

/// Opens a conversation with the camera, and says what befell it before. `scene` is what a virtual one looks at.
pub fn open(address: &CameraAddress, scene: &SceneArgs) -> Result<Session> {
    let mut session = open_quietly(address, scene)?;
    for report in session.await_reports().with_context(|| address.to_string())? {
        print::complain(format_args!("before this, {report}"));
    }
    Ok(session)
}

/// The same without a word.
pub fn open_quietly(address: &CameraAddress, scene: &SceneArgs) -> Result<Session> {
    // Mistakes in the scene's arguments are said as mistakes in the call.
    let optics = match address {
        CameraAddress::Virtual => Some(scene.optics()?.1),
        _ => None,
    };
    let link = || -> Result<Box<dyn Link>> {
        let optics = optics.context("it has no optics")?;
        Ok(Box::new(MemoryLink::new(optics.camera(scene.seed)?)))
    };
    Ok(address.open(link)?)
}
