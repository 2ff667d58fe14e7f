//! Opens the camera at the address of `--camera`, and prints its earlier reports on stderr.

use super::camera::SceneArgs;
use super::print;
use anyhow::{Context, Result};
use nirspi::address::CameraAddress;
use nirspi::link::Link;
use nirspi::session::Session;
use nirspi_virtual::MemoryLink;

/// Opens a session with the camera, and prints its earlier reports. `scene` is the scene of a
/// virtual camera.
pub fn open(address: &CameraAddress, scene: &SceneArgs) -> Result<Session> {
    let mut session = open_quietly(address, scene)?;
    for report in &session.await_reports().with_context(|| address.to_string())?.lines {
        print::remark(format_args!("before this, {report}"));
    }
    Ok(session)
}

/// Opens a session with the camera, and prints nothing.
pub fn open_quietly(address: &CameraAddress, scene: &SceneArgs) -> Result<Session> {
    // Mistakes in the scene's arguments are reported as wrong usage.
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
