//! A scene that moved while its frames were taken: the newest frames, added along its way.

use crate::integrate::{IntegrateError, Integrated};
use crate::response::Settling;
use crate::setup::MeasurementSetup;
use nirspi_follow::{FollowSettings, Followed, Timed, follow};
use nirspi_recon::Measurements;

/// The measurements of a sum of frames, and what is said of them. Where the scene changed, they are those of the newest frames,
/// added along its way, if these have less error than the sum of all frames.
///
/// # Errors
/// The errors of [`Integrated::measurements`].
pub fn followed(
    integrated: &Integrated,
    setup: &MeasurementSetup,
    settling: Option<&Settling>,
    keep_leak: bool,
) -> Result<(Measurements, Vec<String>), IntegrateError> {
    let sum = integrated.measurements(setup, settling, keep_leak)?;
    let Some(changed) = integrated.changed() else { return Ok((sum, integrated.warnings())) };
    let newest: Vec<(u64, Measurements)> = integrated
        .newest()
        .map(|(number, frame)| Ok((number, frame.measurements(setup, settling, keep_leak)?)))
        .collect::<Result<_, IntegrateError>>()?;
    let timed: Vec<Timed<'_>> =
        newest.iter().map(|(number, frame)| Timed { frame, at: *number as f64 }).collect();
    // Frames of one run have the same patterns, and their numbers rise.
    match follow(&timed, &FollowSettings::default()) {
        Ok(followed) if has_less_error(&followed.measurements, &sum, changed) => {
            let mut said = integrated.warnings_of_flags();
            let of_change = integrated.said_of_change().unwrap_or_default();
            said.push(format!("{of_change}; {}", said_of(&followed, integrated.frames())));
            Ok((followed.measurements, said))
        }
        _ => Ok((sum, integrated.warnings())),
    }
}

/// Whether what was followed has less error than the sum of all frames: noise here, noise and the change there. So a slow drift
/// does not cost the light of a long run.
fn has_less_error(followed: &Measurements, sum: &Measurements, changed: f64) -> bool {
    let squares = sum.rows().iter().zip(sum.values()).filter(|(row, _)| **row != 0);
    let (squares, count) =
        squares.fold((0.0, 0), |(all, count), (_, value)| (all + value * value, count + 1));
    let of_change = changed * squares / f64::from(count.max(1));
    let of_noise = sum.noise().unwrap_or_default().powi(2);
    followed.noise().is_some_and(|noise| noise.powi(2) < of_change + of_noise)
}

/// What is said of the frames that were added.
fn said_of(followed: &Followed, all: u64) -> String {
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

#[cfg(test)]
mod tests {
    use super::*;
    use nirspi_recon::{Rows, Side};

    /// Of a run of 1000 frames a drift of 2 % is less than the noise of one frame, and a motion is more.
    #[test]
    fn a_slow_drift_keeps_the_light_of_all_frames() {
        let rows = Rows::natural(Side::new(8).unwrap());
        let of = |noise: f64| {
            let values = Measurements::from_differential(&rows, &[10.0; 64]).unwrap();
            values.with_noise(noise).unwrap()
        };
        let (sum, one, some) = (of(0.1), of(3.0), of(1.0));
        assert!(!has_less_error(&one, &sum, 0.02) && has_less_error(&some, &sum, 0.02));
        assert!(has_less_error(&one, &sum, 0.85));
        let unknown = Measurements::from_differential(&rows, &[10.0; 64]).unwrap();
        assert!(!has_less_error(&unknown, &sum, 0.85));
    }
}
