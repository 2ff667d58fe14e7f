//! The scene as the LEDs' spots see it: through the lens, at a distance, in some weather.

use crate::lesson::SIDE;
use crate::{Problem, in_one_line};
use nirspi_optics::rain::{Air, BeamShadows, RainySpots};
use nirspi_optics::{Budget, CameraModel, Scene};
use nirspi_recon::Image;

/// Seconds before the look, so that drops are everywhere in the air.
const LOOK_AFTER_S: f64 = 0.1;

/// What the paper's camera sees of a scene at `distance_mm`, in this weather, at one moment. The
/// scene fills the field of view at every distance, so that what changes is sharpness.
///
/// # Errors
/// If there is no such weather, or no light is left at this distance.
pub fn seen(scene: &Image, distance_mm: f64, weather: &str, seed: u64) -> Result<Image, Problem> {
    let air: Air = weather.parse().map_err(in_one_line)?;
    let camera = CameraModel::paper();
    let projector = camera.projector();
    let field_mm = projector.field_mm(distance_mm);
    let scene =
        Scene::new(scene.pixels().to_vec(), SIDE.pixels(), field_mm).map_err(in_one_line)?;
    let footprint = projector.footprint(&scene, distance_mm).map_err(in_one_line)?;
    if air.is_clear() {
        return Ok(Image::new(SIDE, footprint.weights().to_vec()));
    }
    let budget = Budget::new(&camera.budget_settings(), &projector, distance_mm);
    let beams = BeamShadows {
        projector,
        distance_mm,
        baseline_mm: camera.collector.baseline_mm,
        collector_mm: budget.map_err(in_one_line)?.effective_collector_mm,
    };
    let weather = air.weather(camera.wavelength_nm).map_err(in_one_line)?;
    let mut spots = RainySpots::new(&weather, &footprint, beams, seed).map_err(in_one_line)?;
    spots.advance(LOOK_AFTER_S);
    Ok(Image::new(SIDE, spots.reflectance()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lesson::named;

    /// Mean squared difference.
    fn apart(a: &Image, b: &Image) -> f32 {
        a.pixels().iter().zip(b.pixels()).map(|(a, b)| (a - b).powi(2)).sum::<f32>() / 1024.0
    }

    #[test]
    fn distance_blurs_more_than_rain() {
        let scene = named("letter:R").unwrap();
        let sharp = seen(&scene, 300.0, "none", 1).unwrap();
        let rain = seen(&scene, 300.0, "rain:50", 1).unwrap();
        let far = seen(&scene, 600.0, "none", 1).unwrap();
        assert!(apart(&scene, &sharp) < 1e-3, "{}", apart(&scene, &sharp));
        let (by_rain, by_distance) = (apart(&sharp, &rain), apart(&sharp, &far));
        assert!(by_rain > 0.0 && by_rain < 0.05 * by_distance, "{by_rain} {by_distance}");
        // Blur moves light and takes none, and rain at a distance is as harmless.
        let mean = |image: &Image| image.pixels().iter().sum::<f32>() / 1024.0;
        assert!((mean(&far) / mean(&sharp) - 1.0).abs() < 0.05, "{} {}", mean(&far), mean(&sharp));
        let both = apart(&far, &seen(&scene, 600.0, "rain:50", 1).unwrap());
        assert!(both > 0.0 && both < 0.05 * by_distance, "{both} {by_distance}");
        let window = apart(&sharp, &seen(&scene, 300.0, "window:0.3", 1).unwrap());
        assert!(window > 10.0 * by_rain, "{window} {by_rain}");
    }

    #[test]
    fn no_such_weather_gets_a_line() {
        let scene = named("letter:R").unwrap();
        assert!(seen(&scene, 300.0, "hail", 1).unwrap_err().contains("expected"));
        assert!(seen(&scene, 0.0, "none", 1).is_err());
    }
}
