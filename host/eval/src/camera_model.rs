//! Evaluates a camera description: geometry, light, noise, resolution and eye safety, with charts
//! against distance.

use crate::DISTANCES_M;
use crate::error::Result;
use nirspi::picture::{Axis, Chart, Line};
use nirspi_optics::instrument::SAMPLE_NS;
use nirspi_optics::pixel::PixelBudget;
use nirspi_optics::rain::{Drops, Weather};
use nirspi_optics::safety::EyeSafety;
use nirspi_optics::water::Water;
use nirspi_optics::{CameraModel, LEDS, SIDE};
use serde::Serialize;

/// The contrast that a resolved line keeps.
const RESOLVED: f64 = 0.1;

/// The properties of a camera description.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Report {
    /// Always true.
    pub simulated: bool,
    /// The description's name.
    pub camera: String,
    /// Differential sweeps summed into one picture.
    pub sweeps: u32,
    /// Duration of one sweep.
    pub sweep_us: f64,
    /// Light time of a picture.
    pub picture_ms: f64,
    /// Electrons per photon.
    pub quantum_efficiency: f64,
    /// Input noise of the amplifier.
    pub amplifier_noise_pa_per_sqrt_hz: f64,
    /// Gain-bandwidth product that the amplifier needs.
    pub gain_bandwidth_ghz: f64,
    /// What pixel (0, 0) of a white sheet would be off by in the image of all patterns, in units of white, because the LEDs
    /// rise unlike they fall, if sweeps did not alternate.
    pub first_pixel_off: f64,
    /// The camera at some distances.
    pub distances: Vec<AtDistance>,
    /// The light at an eye in front of the camera; `null` for a wavelength whose limits are not implemented.
    pub eye_safety: Option<EyeSafety>,
    /// Why there is no `eye_safety`.
    pub eye_safety_refused: Option<String>,
}

/// The camera at one distance.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct AtDistance {
    /// Distance of the target.
    pub distance_m: f64,
    /// Side of the field.
    pub field_mm: f64,
    /// Width of a pixel on the target.
    pub pixel_mm: f64,
    /// Diameter of the defocus disc on the target.
    pub defocus_mm: f64,
    /// The finest line that keeps a tenth of its contrast behind lens, emitter and pixel; `null` if
    /// no line up to the field does.
    pub line_mm: Option<f64>,
    /// Light of one LED from a white target.
    pub electrons_per_led: f64,
    /// Signal of a pixel of a white sheet in dry air divided by its noise, in one picture of all
    /// patterns.
    pub picture_snr: f64,
}

/// Evaluates a description at the paper's distances and at its lens's focus.
///
/// # Errors
/// `EvalError` for settings that are not possible at any distance.
pub fn camera_model(camera: &CameraModel) -> Result<Report> {
    let mut distances: Vec<f64> = DISTANCES_M.to_vec();
    distances.push(camera.projector().focus_distance_mm / 1e3);
    distances.sort_by(f64::total_cmp);
    distances.dedup();
    let dry = Weather::new(Drops::none(), camera.wavelength_nm, Water::Segelstein)?;
    let sweep_us = 2.0 * LEDS as f64 * pattern_us(camera);
    let sweeps = camera.readout.sweeps_per_picture;
    let (eye_safety, eye_safety_refused) = match EyeSafety::of(camera) {
        Ok(light) => (Some(light), None),
        Err(outside) => (None, Some(outside.to_string())),
    };
    Ok(Report {
        simulated: true,
        camera: camera.name.clone(),
        sweeps,
        sweep_us,
        picture_ms: sweep_us * f64::from(sweeps) * 1e-3,
        quantum_efficiency: camera.quantum_efficiency(),
        amplifier_noise_pa_per_sqrt_hz: camera.amplifier_noise_pa_per_sqrt_hz(),
        gain_bandwidth_ghz: camera.gain_bandwidth_ghz(),
        first_pixel_off: {
            let readout = camera.readout;
            let chain = camera.chain_settings();
            chain.first_pixel_off(readout.clocks_per_pattern.into(), readout.blanked.into())
        },
        distances: distances.iter().map(|&m| at(camera, &dry, m)).collect::<Result<_>>()?,
        eye_safety,
        eye_safety_refused,
    })
}

/// Time for which a pattern is shown in one sweep.
fn pattern_us(camera: &CameraModel) -> f64 {
    f64::from(camera.readout.clocks_per_pattern) * SAMPLE_NS * 1e-3
}

pub(crate) fn at(camera: &CameraModel, weather: &Weather, distance_m: f64) -> Result<AtDistance> {
    let (lens, distance_mm) = (camera.projector(), distance_m * 1e3);
    let exposure_us = pattern_us(camera) * f64::from(camera.readout.sweeps_per_picture);
    let pixel = PixelBudget::new(&camera.instrument(), weather, distance_mm, 1.0, exposure_us)?;
    let field_mm = lens.field_mm(distance_mm);
    Ok(AtDistance {
        distance_m,
        field_mm,
        pixel_mm: field_mm / SIDE as f64,
        defocus_mm: lens.blur_mm(distance_mm),
        line_mm: lens.finest_line_mm(distance_mm, RESOLVED),
        electrons_per_led: pixel.dry.electrons_per_led,
        picture_snr: pixel.pixel_snr,
    })
}

/// This camera and the shipped cameras that differ from it, with their names.
fn beside(camera: &CameraModel) -> Vec<CameraModel> {
    let mut cameras = vec![camera.clone()];
    let others = CameraModel::names().filter_map(CameraModel::named);
    cameras.extend(others.filter(|other| other.digest() != camera.digest()));
    cameras
}

/// Distances of the charts.
pub(crate) fn along_m() -> impl Iterator<Item = f64> {
    (0..=160).map(|i| 0.2 * 10_f64.powf(f64::from(i) / 160.0))
}

/// The axis of charts against the distance of the target.
pub(crate) fn distance_axis() -> Axis {
    Axis {
        name: "distance, m".to_owned(),
        from: 0.2,
        to: 2.0,
        logarithmic: true,
        ticks: vec![0.2, 0.3, 0.6, 1.0, 2.0],
    }
}

/// A chart of a value against distance, with a line for each camera.
fn chart(
    camera: &CameraModel,
    header: &str,
    y: Axis,
    of: fn(&AtDistance) -> Option<f64>,
) -> Result<Chart> {
    let mut lines = Vec::new();
    for camera in beside(camera) {
        let dry = Weather::new(Drops::none(), camera.wavelength_nm, Water::Segelstein)?;
        let points = along_m().filter_map(|m| Some((m, of(&at(&camera, &dry, m).ok()?)?)));
        let ms = 2.0
            * LEDS as f64
            * pattern_us(&camera)
            * f64::from(camera.readout.sweeps_per_picture)
            * 1e-3;
        let name = format!("{}, {ms:.0} ms", camera.name);
        let colour = lines.len();
        // Cameras with the same optics have the same line: dashes leave the one below visible.
        lines.push(Line { name, colour, dashed: colour % 2 == 1, points: points.collect() });
    }
    Ok(Chart {
        header: header.to_owned(),
        x: distance_axis(),
        y,
        lines,
        footer: "simulated: photon budget and geometry, dry air, white sheet, all patterns"
            .to_owned(),
    })
}

/// The finest line of a camera against its distance, with the shipped cameras for comparison.
///
/// # Errors
/// Does not occur for a description that was read.
pub fn resolution_chart(camera: &CameraModel) -> Result<Chart> {
    let y = Axis {
        name: "line that keeps 10 % of its contrast, mm".to_owned(),
        from: 0.3,
        to: 300.0,
        logarithmic: true,
        ticks: vec![0.3, 1.0, 3.0, 10.0, 30.0, 100.0, 300.0],
    };
    chart(camera, "How fine a camera sees", y, |at| at.line_mm)
}

/// Signal divided by noise of a pixel of one picture against its distance, with the shipped cameras
/// for comparison.
///
/// # Errors
/// Does not occur for a description that was read.
pub fn snr_chart(camera: &CameraModel) -> Result<Chart> {
    let y = Axis {
        name: "SNR of a white pixel in one picture".to_owned(),
        from: 0.1,
        to: 1000.0,
        logarithmic: true,
        ticks: vec![0.1, 1.0, 10.0, 100.0, 1000.0],
    };
    chart(camera, "How well a camera sees", y, |at| Some(at.picture_snr))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_one_metre_camera_sees_finer_and_better_at_one_metre_than_the_papers() {
        let at_1_m = |name: &str| {
            let report = camera_model(&CameraModel::named(name).unwrap()).unwrap();
            assert!(report.picture_ms <= 100.0, "{report:?}");
            *report.distances.iter().find(|at| at.distance_m == 1.0).unwrap()
        };
        let (paper, ours) = (at_1_m("paper"), at_1_m("one-metre"));
        assert!((ours.field_mm - 48.0).abs() < 1e-9 && ours.defocus_mm == 0.0, "{ours:?}");
        assert!((ours.line_mm.unwrap() - 1.5).abs() < 1e-9, "{ours:?}");
        assert!(paper.line_mm.unwrap() > 15.0 && paper.picture_snr < 4.0, "{paper:?}");
        assert!(ours.picture_snr > 25.0, "{ours:?}");
    }

    #[test]
    fn charts_have_a_line_for_each_camera() {
        let lab = CameraModel { name: "lab".to_owned(), ..CameraModel::default() };
        for (camera, lines) in [(CameraModel::default(), 3), (lab, 4)] {
            assert_eq!(resolution_chart(&camera).unwrap().lines.len(), lines);
            assert_eq!(snr_chart(&camera).unwrap().lines.len(), lines);
        }
    }
}
