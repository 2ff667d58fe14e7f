//! A scene that moved while its frames were taken: the newest frames, added along its way.

use crate::integrate::{IntegrateError, Integrated};
use crate::response::Settling;
use crate::setup::MeasurementSetup;
use nirspi_follow::{FollowSettings, Followed, Timed, follow};
use nirspi_recon::Measurements;

/// The measurements of a sum of frames, and what is said of them. Where the scene changed, the newest frames are added along
/// its way, as many as one motion explains; all others give the sum of all frames.
///
/// # Errors
/// The errors of [`Integrated::measurements`].
pub(super) fn measurements(
    integrated: &Integrated,
    setup: &MeasurementSetup,
    settling: Option<&Settling>,
    keep_leak: bool,
) -> Result<(Measurements, Vec<String>), IntegrateError> {
    let newest: Vec<(u64, Measurements)> = integrated
        .newest()
        .map(|(number, frame)| Ok((number, frame.measurements(setup, settling, keep_leak)?)))
        .collect::<Result<_, IntegrateError>>()?;
    let timed: Vec<Timed<'_>> =
        newest.iter().map(|(number, frame)| Timed { frame, at: *number as f64 }).collect();
    let changed = integrated.changed();
    // Frames of one run fit together, and their numbers rise.
    match (changed, follow(&timed, &FollowSettings::default()).ok()) {
        (Some(changed), Some(followed)) if followed.frames > 0 => {
            let mut said = integrated.warnings_of_flags();
            said.push(format!("{changed}; {}", of(&followed, integrated.frames())));
            Ok((followed.measurements, said))
        }
        _ => {
            let measurements = integrated.measurements(setup, settling, keep_leak)?;
            Ok((measurements, integrated.warnings()))
        }
    }
}

/// What is said of the frames that were added.
fn of(followed: &Followed, all: u64) -> String {
    let frames = match followed.frames {
        1 => format!("the picture is that of the newest of {all} frames alone"),
        some => format!("the picture is that of the newest {some} of {all} frames"),
    };
    let [down, right] = followed.velocity_px;
    match followed.velocity_px == [0.0; 2] {
        true => frames,
        false => format!(
            "{frames}, added along its way ({down:.2} pixels down and {right:.2} to the right a frame)"
        ),
    }
}
