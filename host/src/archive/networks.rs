//! The networks of the threads that reconstruct: each thread makes them once.

use crate::imaging::{Enhance, FrameReport, FramesError, enhance_frames_by};
use crate::stage_times::StageTimes;
use nirspi_nets::Device;
use nirspi_recon::{Image, Rows};
use std::cell::RefCell;

thread_local! {
    /// Networks that this thread has made and does not use at the moment.
    static IDLE: RefCell<Vec<Enhance>> = const { RefCell::new(Vec::new()) };
}

/// Enhances the images of one file as `crate::imaging::enhance_frames` does.
pub(super) fn enhance(
    device: &Device,
    frames: &[(&Image, &Rows)],
) -> Result<(Vec<f32>, Vec<FrameReport>), FramesError> {
    // The networks are taken out while they work: a thread that waits for others may begin another
    // file meanwhile.
    let idle = IDLE.with_borrow_mut(|idle| {
        let at = idle.iter().position(|networks| networks.device().name() == device.name())?;
        Some(idle.swap_remove(at))
    });
    let networks = match idle {
        Some(networks) => networks,
        None => Enhance::built_in(device)?,
    };
    let made = enhance_frames_by(&networks, frames, &mut StageTimes::default());
    IDLE.with_borrow_mut(|idle| idle.push(networks));
    made
}
