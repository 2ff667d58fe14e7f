//! The pictures of a feed of its own patterns.

use super::look::Look;
use super::picture::{CHOSEN_EVERY, Picture, PictureError, made_of, ms_since};
use super::settings::Settings;
use super::{Passed, Shared};
use nirspi::clock::Instant;
use nirspi::files::measurement::{Patterns, Plain};
use nirspi::imaging::{SteadyWhite, White};
use nirspi::reconstruct::{matrix_doubts, matrix_warnings};
use nirspi_own::{LiveMatrix, OwnMatrix};
use nirspi_recon::reconstruct::{
    MatrixSettings, Method, MethodSettings, ReconstructError, Strength,
};
use std::sync::Arc;

/// Makes the pictures of one sweep after another.
///
/// # Invariant
/// The first picture is that which `nirspi reconstruct --matrix` makes of the same readings
/// (`own_patterns_have_the_pictures_of_a_recording`, in `host/cli/tests/cli/serve_feed.rs`). What depends on the patterns is
/// found out once, until other patterns are read or a page chooses another method or strength.
pub struct OwnImages {
    settings: MethodSettings,
    ready: Option<Ready>,
}

/// Patterns that are ready for one sweep after another.
struct Ready {
    patterns: Arc<Patterns>,
    /// The patterns that were read.
    places: Vec<usize>,
    dark: bool,
    method: &'static str,
    strength: Option<f64>,
    matrix: LiveMatrix,
    /// What the patterns leave open.
    doubts: Vec<String>,
}

impl OwnImages {
    /// Pictures with these settings, the first by this method.
    ///
    /// # Errors
    /// [`ReconstructError`] if the method needs Hadamard rows.
    pub fn new(method: Method, settings: &MethodSettings) -> Result<Self, ReconstructError> {
        method.matrix_settings(settings)?;
        Ok(Self { settings: settings.clone(), ready: None })
    }

    /// The picture of these readings.
    pub fn picture(
        &mut self,
        plain: &Plain,
        look: &Look,
        settings: &Settings,
        white: &mut SteadyWhite,
        shared: &Shared,
    ) -> Result<Picture, PictureError> {
        let started = Instant::now();
        let ready = self.ready(plain, settings)?;
        let made = ready.matrix.image(&plain.values)?;
        let reconstruct_ms = ms_since(started);
        if made.image.pixels().iter().any(|pixel| !pixel.is_finite()) {
            return Err(PictureError::NotFinite);
        }
        shared.passed(Passed::Reconstructed, look.arrived);
        let white_counts = white.follow(White::Brightest.level(&made.image));
        let warnings = matrix_warnings(&made, |k| ready.places[k]).into_iter();
        let warnings = warnings.chain(ready.doubts.iter().cloned());
        let warnings = warnings.chain(made.dark.note().map(str::to_owned)).collect();
        let picture = made_of(look, settings, shared, &made.image, white_counts, reconstruct_ms);
        Ok(Picture { warnings, ..picture })
    }

    /// The patterns of these readings, ready for this method.
    fn ready(&mut self, plain: &Plain, settings: &Settings) -> Result<&mut Ready, PictureError> {
        let is_ours = |ready: &Ready| {
            Arc::ptr_eq(&ready.patterns, &plain.patterns)
                && ready.places == plain.places
                && ready.dark == plain.dark
                && (ready.method, ready.strength) == (settings.method, settings.strength)
        };
        if !self.ready.as_ref().is_some_and(is_ours) {
            self.ready = None;
        }
        match &mut self.ready {
            Some(ready) => Ok(ready),
            none => Ok(none.insert(Ready::new(&self.settings, plain, settings)?)),
        }
    }
}

impl Ready {
    fn new(
        base: &MethodSettings,
        plain: &Plain,
        settings: &Settings,
    ) -> Result<Self, PictureError> {
        let unknown = |_| PictureError::Method(settings.method);
        let method: Method = settings.method.parse().map_err(unknown)?;
        let strength = settings.strength.map_or_else(Strength::default, Strength::Fixed);
        let base = MethodSettings { strength, ..base.clone() };
        let of_method = method.matrix_settings(&base)?;
        let of_method = MatrixSettings {
            dark: plain.dark,
            noise: plain.noise,
            most_noise: vec![plain.most_noise],
            ..of_method
        };
        let own = OwnMatrix::new(plain.patterns.size, &plain.patterns.select(&plain.places))?;
        Ok(Self {
            patterns: Arc::clone(&plain.patterns),
            places: plain.places.clone(),
            dark: plain.dark,
            method: settings.method,
            strength: settings.strength,
            doubts: matrix_doubts(&own).collect(),
            matrix: LiveMatrix::new(own, of_method, CHOSEN_EVERY),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::camera_log::CameraLog;
    use super::super::look::{Bench, Seen};
    use super::super::settings::Offer;
    use super::super::stage::Stage;
    use super::*;
    use nirspi::account::LossCounters;
    use nirspi::feed::Header;
    use nirspi::provenance::Taken;
    use nirspi_recon::Size;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;

    #[test]
    fn what_was_chosen_serves_the_next_pictures_until_other_patterns_are_read() {
        let size = Size::new(6, 8).unwrap();
        let (count, area) = (40, size.area());
        let mut random = Pcg64::seed_from_u64(1);
        let weights: Vec<f64> =
            (0..count * area).map(|_| f64::from(u8::from(random.random_bool(0.5)))).collect();
        let scene = |at: usize| (at % 8 + at / 8) as f64;
        let see = |row: &[f64]| row.iter().enumerate().map(|(at, w)| w * scene(at)).sum::<f64>();
        let mut seen = |noise: f64| -> Vec<f64> {
            let mut off = || noise * (random.random::<f64>() - 0.5);
            weights.chunks(area).map(|row| see(row) + off()).collect()
        };
        let (clear, noisy, others) = (seen(0.0), seen(200.0), seen(200.0));
        let patterns = Arc::new(Patterns { size, count, weights });
        let plain = |values: &[f64], places: &[usize]| Plain {
            patterns: Arc::clone(&patterns),
            values: places.iter().map(|&at| values[at]).collect(),
            places: places.to_vec(),
            not_read: Vec::new(),
            taken: Taken::simulated_or(None),
            noise: None,
            most_noise: None,
            notes: Vec::new(),
            dark: true,
        };
        let header: Header =
            r#"{"n": 2, "order": "natural", "readings": "single", "unit": "V"}"#.parse().unwrap();
        let bench = Arc::new(Bench::new("test", &header, None).unwrap());
        let look = Look {
            seen: Seen::Feed { frames: Vec::new(), bench },
            arrived: Instant::now(),
            counters: LossCounters::default(),
            newest: 1,
        };
        let settings = Settings { method: "tikhonov", ..super::super::settings::tests::settings() };
        let log = CameraLog::of_feed("test");
        let shared = Shared::new(log, Offer::default(), settings.clone(), Stage::of(None));
        let mut images = OwnImages::new(Method::TIKHONOV, &MethodSettings::default()).unwrap();
        let mut picture = |plain: &Plain| {
            let mut white = SteadyWhite::default();
            images.picture(plain, &look, &settings, &mut white, &shared).unwrap()
        };
        let every: Vec<usize> = (0..count).collect();
        let alone = |plain: &Plain, strength: Option<f64>| {
            let own = OwnMatrix::new(size, &patterns.select(&plain.places)).unwrap();
            let method = Method::TIKHONOV.with_matrix().unwrap();
            let settings = MatrixSettings { strength, ..MatrixSettings::new(method) };
            own.reconstruct(&plain.values, &settings).unwrap()
        };
        let (clear, noisy) = (plain(&clear, &every), plain(&noisy, &every));
        let first = alone(&clear, None);
        let shown = picture(&clear);
        assert_eq!((shown.height, shown.width, shown.n), (6, 8, None));
        assert_eq!((&shown.counts[..], shown.readings), (first.image.pixels(), None));
        // Alone, the noisy readings would have another strength.
        let kept = alone(&noisy, first.strength);
        assert_ne!(kept.strength, alone(&noisy, None).strength);
        assert_eq!(picture(&noisy).counts, kept.image.pixels());
        // Without the first pattern, everything is found out anew.
        let others = plain(&others, &every[1..]);
        assert_eq!(picture(&others).counts, alone(&others, None).image.pixels());
        let needs =
            OwnImages::new("hadamard".parse().unwrap(), &MethodSettings::default()).err().unwrap();
        assert!(needs.to_string().starts_with("method hadamard needs Hadamard rows"), "{needs}");
    }
}
