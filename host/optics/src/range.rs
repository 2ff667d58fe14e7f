//! The range of the camera by physics, and by the paper's Algorithm 2 as printed.
//!
//! By physics, the range is the farthest distance at which one reconstructed pixel's signal reaches
//! a multiple of its noise ([`crate::pixel`]).
//!
//! As printed, z grows in steps of `Z_max / 10`. At each step the source is multiplied by
//! `exp(-alpha z)` *again*, so after n steps its factor is `exp(-alpha (z_1 + ... + z_n))`. The
//! algorithm ends where the photons of one exposure of one LED fall to the noise floor of one
//! exposure. The listing leaves out that a picture has 2048 exposures: a differential Hadamard
//! transform gives a pixel `sqrt(N / 2)` times the SNR of one exposure. [`Floor`] has both
//! readings. The paper gives E(N) only by reference; nirspi's noise is used. The factor A (which is
//! infinite at z = 0 and has the dimension of a volume), Lambda, mu, Z_dr and the reflectivities
//! are computed in the listing and never used. `beta` is a share of an exposure, used as a
//! coefficient per metre.

use crate::camera::Instrument;
use crate::pixel::{PixelBudget, PixelError};
use crate::rain::Weather;
use crate::rain::fall::beta;

/// Nearest distance of the search, in mm.
pub const NEAREST_MM: f64 = 50.0;

/// Farthest distance of the search, in mm.
pub const FARTHEST_MM: f64 = 20_000.0;

/// Steps of Algorithm 2: `Delta z = Z_max / 10`.
const PRINTED_STEPS: usize = 10;

/// The requirements on a pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wanted {
    /// Reflectance of the target.
    pub reflectance: f64,
    /// Exposure of each pattern, in us.
    pub exposure_us: f64,
    /// Signal of a pixel divided by its noise.
    pub snr: f64,
}

/// The farthest distance at which a pixel reaches the required SNR, in mm; `None` if the SNR is not
/// reached at [`NEAREST_MM`], and [`FARTHEST_MM`] if the SNR is still reached there.
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
    // In dense air the farthest distances are errors, not dark images.
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
    /// The floor of one exposure, as in the listing.
    OneExposure,
    /// The floor of the pixel that a differential Hadamard transform makes of all exposures, which
    /// is `sqrt(N / 2)` times lower. This factor is nirspi's; the listing does not have it.
    WholePicture,
}

/// Algorithm 2 as printed, up to `z_max_mm`: the first step at which the photons of one exposure
/// are at most `wanted.snr` times the noise floor, or `z_max_mm`. `drop_mm` is the listing's D.
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
        // L_r, divided by the daylight of a white target: the drops' brightness.
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

/// The exposure of a pattern, in us, with which a pixel at `distance_mm` reaches `snr`. Every
/// sample has the same noise, so the SNR grows as the root of the exposure. The signal falls as the
/// square of the distance, so the exposure grows as the fourth power of the distance.
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

/// The extinction, per metre, with which the camera's range in this weather would be `range_mm`;
/// `None` if the range in dry air is smaller.
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
    // Above the single-scattering limit the blur is not known, so the result is a lower bound.
    let mut high = crate::rain::blur::DEEPEST_SINGLE / (range_mm * 1e-3);
    let mut low = 0.0;
    while high - low > 1e-5 {
        let middle = (low + high) / 2.0;
        if reaches(middle)? { low = middle } else { high = middle }
    }
    Ok(Some(low))
}
