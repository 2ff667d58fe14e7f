//! How far the camera sees: the paper's Algorithm 2, as physics has it and as it is printed.
//!
//! Physics: the farthest distance at which one reconstructed pixel's signal reaches a multiple of its noise
//! ([`crate::pixel`]).
//!
//! As printed: z grows in steps of `Z_max / 10`; at each step the source is multiplied by `exp(-alpha z)` *again*, so
//! that after n steps it carries `exp(-alpha (z_1 + ... + z_n))`; it ends where the photons of one exposure of one LED
//! fall to the noise floor of one exposure. That is the listing, and it leaves out that a picture is made of 2048
//! exposures: a differential Hadamard transform gives a pixel `sqrt(N / 2)` times the SNR of one exposure.
//! [`Floor`] names both readings. E(N) is given only by reference; ours is used. The factor A (which is infinite at z = 0 and has
//! the dimension of a volume), Lambda, mu, Z_dr and the reflectivities are computed there and used nowhere. `beta` is
//! a share of an exposure used as a coefficient per metre.

use crate::pixel::{Instrument, PixelBudget, PixelError};
use crate::rain::Weather;
use crate::rain::fall::beta;

/// Nearest distance looked at, in mm.
pub const NEAREST_MM: f64 = 50.0;

/// Farthest distance looked at, in mm.
pub const FARTHEST_MM: f64 = 20_000.0;

/// Steps of Algorithm 2: `Delta z = Z_max / 10`.
const PRINTED_STEPS: usize = 10;

/// What is asked of the camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wanted {
    /// Reflectance of the target.
    pub reflectance: f64,
    /// Exposure of each pattern, in us.
    pub exposure_us: f64,
    /// Signal of a pixel over its noise.
    pub snr: f64,
}

/// The farthest distance at which a pixel reaches the SNR wanted, in mm; none if it does not at [`NEAREST_MM`], and
/// [`FARTHEST_MM`] if it still does there.
///
/// # Errors
/// [`PixelError`] naming what is out of range.
pub fn farthest_mm(
    instrument: &Instrument,
    weather: &Weather,
    wanted: &Wanted,
) -> Result<Option<f64>, PixelError> {
    let reaches = |distance_mm: f64| {
        let Wanted { reflectance, exposure_us, snr } = *wanted;
        PixelBudget::new(instrument, weather, distance_mm, reflectance, exposure_us)
            .map(|pixel| pixel.pixel_snr >= snr)
    };
    let (mut near, mut far) = (NEAREST_MM, FARTHEST_MM);
    if !reaches(near)? {
        return Ok(None);
    }
    // In dense air the farthest distances are refused, not dark.
    if reaches(far).unwrap_or(false) {
        return Ok(Some(far));
    }
    while far - near > 0.1 {
        let middle = (near + far) / 2.0;
        if reaches(middle).unwrap_or(false) {
            near = middle;
        } else {
            far = middle;
        }
    }
    Ok(Some(near))
}

/// The noise floor that Algorithm 2 compares the photons of one exposure with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Floor {
    /// Of one exposure, as the listing has it.
    OneExposure,
    /// Of the pixel that a differential Hadamard transform makes of all exposures: `sqrt(N / 2)` times lower. This factor
    /// is ours; the listing does not have it.
    WholePicture,
}

/// Algorithm 2 as printed, up to `z_max_mm`: the first step at which the photons of one exposure are no more than
/// `wanted.snr` times the noise floor, or `z_max_mm`. `drop_mm` is its D.
///
/// # Errors
/// [`PixelError`] naming what is out of range.
pub fn as_printed_mm(
    instrument: &Instrument,
    weather: &Weather,
    wanted: &Wanted,
    (drop_mm, z_max_mm): (f64, f64),
    compared_with: Floor,
) -> Result<f64, PixelError> {
    let dry = weather.clone().with_extinction(0.0);
    let alpha_per_m = weather.medium().extinction_per_m;
    let beta = beta(drop_mm, wanted.exposure_us * 1e-6);
    let (mut source, mut drops) = (1.0, 0.0);
    for step in 1..=PRINTED_STEPS {
        let z_mm = z_max_mm * step as f64 / PRINTED_STEPS as f64;
        let z_m = z_mm * 1e-3;
        source *= (-alpha_per_m * z_m).exp();
        // L_r, over the daylight of a white target: the drops' brightness.
        let faded = (-beta * z_m).exp();
        drops = drops * faded + (1.0 - faded);
        let pixel =
            PixelBudget::new(instrument, &dry, z_mm, wanted.reflectance, wanted.exposure_us)?;
        let photons = pixel.exposure_signal * source;
        let background = pixel.dry.ambient_electrons_white * drops;
        let floor = (pixel.exposure_noise.powi(2) + background * pixel.samples).sqrt() * wanted.snr;
        let gained = match compared_with {
            Floor::OneExposure => 1.0,
            Floor::WholePicture => pixel.pixel_snr / pixel.exposure_snr,
        };
        if photons <= floor / gained {
            return Ok(z_mm);
        }
    }
    Ok(z_max_mm)
}

/// The exposure of a pattern, in us, with which a pixel at `distance_mm` reaches `snr`. Noise is the same in every sample, so that
/// the SNR goes as the root of the exposure; signal falls as the square of the distance, so that the exposure grows as its fourth
/// power.
///
/// # Errors
/// [`PixelError`] naming what is out of range.
pub fn exposure_needed_us(
    instrument: &Instrument,
    weather: &Weather,
    (distance_mm, reflectance): (f64, f64),
    snr: f64,
) -> Result<f64, PixelError> {
    let pixel = PixelBudget::new(instrument, weather, distance_mm, reflectance, 1.0)?;
    Ok((snr / pixel.pixel_snr).powi(2))
}

/// The extinction that this weather would need, per metre, for the camera to see no farther than `range_mm`; none if
/// it does not see that far in dry air.
///
/// # Errors
/// [`PixelError`] naming what is out of range.
pub fn extinction_needed_per_m(
    instrument: &Instrument,
    weather: &Weather,
    wanted: &Wanted,
    range_mm: f64,
) -> Result<Option<f64>, PixelError> {
    let reaches = |extinction: f64| {
        let weather = weather.clone().with_extinction(extinction);
        let Wanted { reflectance, exposure_us, snr } = *wanted;
        PixelBudget::new(instrument, &weather, range_mm, reflectance, exposure_us)
            .map(|pixel| pixel.pixel_snr >= snr)
    };
    if !reaches(0.0)? {
        return Ok(None);
    }
    // Past the single-scattering limit the blur is no longer known: the answer is "at least".
    let mut high = crate::rain::blur::DEEPEST_SINGLE / (range_mm * 1e-3);
    let mut low = 0.0;
    while high - low > 1e-5 {
        let middle = (low + high) / 2.0;
        if reaches(middle)? { low = middle } else { high = middle }
    }
    Ok(Some(low))
}
