//! The spot of each LED in rain: the target between drops, light scattered from the surroundings,
//! and the veil.
//!
//! # Invariant
//! The average over time of a white target is that of [`super::ForwardBlur`]
//! (`over_time_single_drops_cost_what_the_mean_says` in `host/optics/tests/scene_in_rain.rs`).
//! Single drops make the frames differ. Droplets that are too many to simulate (fog) contribute
//! only their average.

use super::{BeamShadows, FallingDrops, RainError, Weather};
use crate::Footprint;

/// The 32 x 32 spots of one scene in rain, over time.
#[derive(Debug, Clone)]
pub struct RainySpots {
    dry: Vec<f32>,
    /// Scattered light of each spot and the veil, in units of a white target.
    added: Vec<f32>,
    /// Average share that remains without the shadows of single drops.
    kept: f64,
    falling: Option<FallingDrops>,
}

impl RainySpots {
    /// `footprint` seen through `beams` in this weather. The same seed gives the same rain.
    ///
    /// # Errors
    /// [`RainError`] for air too dense for a picture, or too many drops.
    pub fn new(
        weather: &Weather,
        footprint: &Footprint,
        beams: BeamShadows,
        seed: u64,
    ) -> Result<Self, RainError> {
        let BeamShadows { projector, distance_mm, baseline_mm, .. } = beams;
        let blur = weather.blur(distance_mm)?;
        let field_mm = projector.field_mm(distance_mm);
        let kernel = blur.kernel(field_mm / crate::SIDE as f64);
        let through = |kernel| weather.through_window(kernel, distance_mm, field_mm);
        // On the path back, light that crosses a drop on the window is lost.
        let returned = blur.returned(field_mm / distance_mm) * weather.clear();
        let drops = weather.drops();
        let rains = drops.fall();
        // Simulated drops block the light in their shadow. Their diffraction, an equal amount,
        // stays in the spot and is not subtracted.
        let shadow = if rains { (-drops.shadow_per_m() * distance_mm * 1e-3).exp() } else { 1.0 };
        let (kernel, kept) = if rains {
            let kept = returned / shadow * weather.clear();
            (through(kernel.without_own(1.0 - shadow)), kept)
        } else {
            let kernel = through(kernel);
            let own = kernel.unscattered + kernel.scattered(0, 0);
            (kernel.without_own(f64::INFINITY), own * returned)
        };
        let veil = weather.veil(&projector, distance_mm, baseline_mm)?;
        let halo = kernel.halo(footprint.weights());
        Ok(Self {
            dry: footprint.weights().to_vec(),
            added: halo.iter().map(|h| (h * returned + veil.backscatter) as f32).collect(),
            kept,
            falling: if rains { Some(FallingDrops::new(drops, beams, seed)?) } else { None },
        })
    }

    /// Another target in the same place, or the same after it has moved: the mean reflectance that each spot sees in dry
    /// air. The light scattered from its surroundings stays that of the first target.
    pub fn look_at(&mut self, seen: Vec<f32>) {
        self.dry = seen;
    }

    /// Advances the time.
    pub fn advance(&mut self, seconds: f64) {
        if let Some(falling) = &mut self.falling {
            falling.advance(seconds);
        }
    }

    /// The current spot of each LED, 32 x 32, row-major: reflectances as seen by a camera in dry
    /// air.
    #[must_use]
    pub fn reflectance(&self) -> Vec<f32> {
        let kept = self.kept as f32;
        let spots = self.dry.iter().zip(&self.added);
        match &self.falling {
            None => spots.map(|(dry, added)| dry * kept + added).collect(),
            Some(falling) => {
                let shadows = falling.kept();
                spots.zip(shadows).map(|((dry, added), share)| dry * kept * share + added).collect()
            }
        }
    }
}
