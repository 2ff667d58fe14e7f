//! What rain promises: energy conserved, sums that agree with single photons and single drops, the honest sizes of
//! effects.

#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

use crate::beams;
use nirspi_optics::mie::Mie;
use nirspi_optics::rain::falling::FallingDrops;
use nirspi_optics::rain::{
    BackwardLobe, DropClass, Drops, ForwardBlur, Medium, RainError, ScatteringAngles, Veil,
};
use nirspi_optics::water::Water;
use nirspi_optics::{LEDS, Projector};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use std::f64::consts::PI;

fn medium(drops: &Drops, nm: f64) -> Medium {
    Medium::new(drops, nm, Water::Segelstein).unwrap()
}

fn angles(drops: &Drops, nm: f64) -> ScatteringAngles {
    ScatteringAngles::new(drops, nm, Water::Segelstein).unwrap()
}

#[test]
fn rain_extinction_is_nearly_the_same_at_every_wavelength() {
    for drops in [Drops::marshall_palmer(5.6).unwrap(), Drops::monodisperse(5.6, 2.0).unwrap()] {
        let green = medium(&drops, 550.0).extinction_per_m;
        for nm in [850.0, 1550.0] {
            let ratio = medium(&drops, nm).extinction_per_m / green;
            assert!((ratio - 1.0).abs() < 0.03, "{nm} nm: {ratio}");
        }
        // Twice the shadow, and a little for the edges.
        assert!((green / (2.0 * drops.shadow_per_m()) - 1.0).abs() < 0.03, "{green}");
    }
}

#[test]
fn natural_rain_costs_less_than_a_percent_over_two_metres() {
    for rate in [1.93, 5.6] {
        let loss = 1.0 - medium(&Drops::marshall_palmer(rate).unwrap(), 1550.0).transmission(2.0);
        assert!((5e-4..1e-2).contains(&loss), "{rate} mm/h: {loss}");
    }
}

#[test]
fn what_1550_nm_gains_is_less_scattered_light_not_less_extinction() {
    let drops = Drops::monodisperse(5.6, 2.0).unwrap();
    let (visible, infrared) = (medium(&drops, 550.0), medium(&drops, 1550.0));
    assert!(visible.albedo() > 0.9999, "{}", visible.albedo());
    assert!((0.55..0.65).contains(&infrared.albedo()), "{}", infrared.albedo());
    assert!(infrared.absorption_per_m > 1e3 * visible.absorption_per_m);
}

#[test]
fn fog_takes_far_more_than_rain_of_ten_times_its_water() {
    let (fog, rain) = (Drops::fog(10.0, 0.1).unwrap(), Drops::marshall_palmer(20.0).unwrap());
    assert!(rain.liquid_water_g_per_m3() > 9.0 * fog.liquid_water_g_per_m3());
    let ratio = medium(&fog, 1550.0).extinction_per_m / medium(&rain, 1550.0).extinction_per_m;
    assert!(ratio > 5.0, "{ratio}");
    // Nor does 1550 nm see much further in such fog: droplets are larger than either wavelength.
    let flat = medium(&fog, 1550.0).extinction_per_m / medium(&fog, 550.0).extinction_per_m;
    assert!((0.9..1.25).contains(&flat), "{flat}");
}

#[test]
fn binned_angles_keep_the_phase_functions_integral_and_mean_cosine() {
    for drops in [
        Drops::monodisperse(5.6, 2.0).unwrap(),
        Drops::monodisperse(1.93, 0.5).unwrap(),
        Drops::marshall_palmer(5.6).unwrap(),
        Drops::fog(10.0, 0.1).unwrap(),
    ] {
        for nm in [850.0, 1550.0] {
            let (angles, medium) = (angles(&drops, nm), medium(&drops, nm));
            assert!((angles.raw_total() - 1.0).abs() < 0.03, "{}", angles.raw_total());
            let off = angles.asymmetry() - medium.asymmetry;
            assert!(off.abs() < 0.01, "{} against {}", angles.asymmetry(), medium.asymmetry);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]
    #[test]
    fn what_is_taken_out_is_scattered_or_absorbed(rate in 0.1..100.0, nm in 400.0..2000.0) {
        let medium = medium(&Drops::marshall_palmer(rate).unwrap(), nm);
        let sum = medium.scattering_per_m + medium.absorption_per_m;
        prop_assert!((sum / medium.extinction_per_m - 1.0).abs() < 1e-12);
        prop_assert!(medium.asymmetry > 0.7 && medium.asymmetry < 1.0);
        prop_assert!(medium.backscatter_per_m_sr > 0.0);
    }

    #[test]
    fn a_share_of_the_light_leaves_within_its_quantile(shares in prop::collection::vec(0.0..1.0, 20), mm in 0.2..1.0) {
        let angles = angles(&Drops::monodisperse(5.6, mm).unwrap(), 1550.0);
        for share in shares {
            prop_assert!((angles.within(angles.quantile_rad(share)) - share).abs() < 1e-9);
        }
    }
}

/// Drops of one size as single photons meet them: straight from Mie, sharing neither the coefficients of [`Medium`] nor the bins
/// of [`ScatteringAngles`].
struct MieDrops {
    extinction_per_m: f64,
    albedo: f64,
    /// Mean cosine of the scattering angle by Mie's sums.
    asymmetry: f64,
    angles_rad: Vec<f64>,
    /// Share of the scattered light within each angle.
    cumulative: Vec<f64>,
}

impl MieDrops {
    fn new(drops: &Drops, nm: f64) -> Self {
        let [DropClass { diameter_mm, per_m3 }] = drops.classes() else { panic!("of one size") };
        let x = PI * diameter_mm * 1e6 / nm;
        let mut mie = Mie::new();
        let sphere = mie.sphere(x, Water::Segelstein.index(nm).unwrap()).unwrap();
        let q = sphere.efficiencies();
        // Lobes are pi / x wide: twenty points for each.
        let count = (20.0 * x) as usize;
        let angles_rad: Vec<f64> = (0..=count).map(|i| PI * i as f64 / count as f64).collect();
        let cosines: Vec<f64> = angles_rad.iter().map(|a| a.cos()).collect();
        let phase = sphere.phase(&cosines).unwrap();
        let density = |i: usize| phase[i] / 2.0 * angles_rad[i].sin() * PI / count as f64;
        let mut sum = 0.0;
        let mut cumulative = vec![0.0];
        for i in 1..=count {
            sum += (density(i - 1) + density(i)) / 2.0;
            cumulative.push(sum);
        }
        assert!((sum - 1.0).abs() < 1e-3, "a phase function of {sum} in all");
        Self {
            extinction_per_m: per_m3 * q.extinction * PI / 4.0 * (diameter_mm * 1e-3).powi(2),
            albedo: q.scattering / q.extinction,
            asymmetry: q.asymmetry,
            angles_rad,
            cumulative,
        }
    }

    /// The angle that a share of the light is within.
    fn angle_rad(&self, share: f64) -> f64 {
        let share = share * self.cumulative[self.cumulative.len() - 1];
        let at =
            self.cumulative.partition_point(|&c| c < share).clamp(1, self.cumulative.len() - 1);
        let (low, high) = (self.cumulative[at - 1], self.cumulative[at]);
        let part = if high > low { (share - low) / (high - low) } else { 0.5 };
        self.angles_rad[at - 1] + part * (self.angles_rad[at] - self.angles_rad[at - 1])
    }
}

/// Photons followed one by one through a slab: free paths, absorption, angles, any number of scatterings, in three
/// dimensions. Returns the shares that arrive having been scattered, within each radius, and untouched.
fn photons(drops: &MieDrops, slab_m: f64, radii_mm: &[f64]) -> (Vec<f64>, f64) {
    let mut rng = Pcg64Mcg::seed_from_u64(7);
    let count = 400_000;
    let (mut within, mut untouched) = (vec![0.0; radii_mm.len()], 0.0);
    for _ in 0..count {
        let (mut at, mut along, mut scattered) = ([0.0; 3], [0.0, 0.0, 1.0], false);
        loop {
            let free_m = -(1.0 - rng.random::<f64>()).ln() / drops.extinction_per_m;
            let to_target = (slab_m - at[2]) / along[2];
            if along[2] > 0.0 && free_m >= to_target {
                let radius_mm =
                    1e3 * (at[0] + along[0] * to_target).hypot(at[1] + along[1] * to_target);
                if scattered {
                    for (sum, &limit) in within.iter_mut().zip(radii_mm) {
                        *sum += f64::from(radius_mm <= limit) / f64::from(count);
                    }
                } else {
                    untouched += 1.0 / f64::from(count);
                }
                break;
            }
            at = std::array::from_fn(|i| at[i] + along[i] * free_m);
            if at[2] < 0.0 || rng.random::<f64>() > drops.albedo {
                break;
            }
            scattered = true;
            let angle = drops.angle_rad(rng.random());
            along = turned(along, angle, rng.random::<f64>() * std::f64::consts::TAU);
        }
    }
    (within, untouched)
}

/// A direction turned by `angle`, around itself by `azimuth`.
fn turned(along: [f64; 3], angle: f64, azimuth: f64) -> [f64; 3] {
    let helper = if along[2].abs() < 0.9 { [0.0, 0.0, 1.0] } else { [1.0, 0.0, 0.0] };
    let cross = |a: [f64; 3], b: [f64; 3]| {
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    };
    let unit = |v: [f64; 3]| v.map(|x| x / v.iter().map(|y| y * y).sum::<f64>().sqrt());
    let side = unit(cross(along, helper));
    let other = cross(along, side);
    let (sin, cos) = angle.sin_cos();
    unit(std::array::from_fn(|i| {
        along[i] * cos + (side[i] * azimuth.cos() + other[i] * azimuth.sin()) * sin
    }))
}

#[test]
fn angles_drawn_for_photons_have_the_mean_cosine_that_mie_sums_say() {
    let drops = Drops::monodisperse(100.0, 0.5).unwrap();
    for nm in [550.0, 1550.0] {
        let drops = MieDrops::new(&drops, nm);
        let draws = 20_000;
        let cosine = |i| drops.angle_rad((f64::from(i) + 0.5) / f64::from(draws)).cos();
        let mean = (0..draws).map(cosine).sum::<f64>() / f64::from(draws);
        assert!((mean - drops.asymmetry).abs() < 1e-3, "{nm} nm: {mean}, {}", drops.asymmetry);
    }
}

#[test]
fn the_point_spread_function_agrees_with_photons_followed_one_by_one() {
    // 100 mm/h and 0.5 mm drops, dense enough that 400 000 photons say something: an optical depth of 0.085 over a
    // metre.
    let drops = Drops::monodisperse(100.0, 0.5).unwrap();
    for nm in [550.0, 1550.0] {
        let (medium, angles) = (medium(&drops, nm), angles(&drops, nm));
        let slab_m = 1.0;
        let blur = ForwardBlur::new(medium, Some(angles.clone()), slab_m * 1e3).unwrap();
        let radii_mm = [0.3, 1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1000.0];
        let (within, untouched) = photons(&MieDrops::new(&drops, nm), slab_m, &radii_mm);
        assert!((untouched - blur.unscattered()).abs() < 3.0 * (0.085_f64 / 400_000.0).sqrt());
        for (radius, found) in radii_mm.into_iter().zip(within) {
            let expected = blur.scattered_within(radius);
            // Four standard deviations of the count, and what double scattering may add.
            let depth = medium.scattering_per_m * slab_m;
            let allowed = 4.0 * (found / 400_000.0).sqrt() + depth * depth / 2.0;
            assert!(
                (found - expected).abs() < allowed,
                "{nm} nm, {radius} mm: {found} against {expected}"
            );
            assert!(
                expected > 5.0 * allowed || radius < 1.0,
                "the test sees something: {expected} {allowed}"
            );
        }
    }
}

#[test]
fn dense_air_spreads_light_as_photons_followed_without_the_bins_say() {
    // 300 mm/h of 0.2 mm drops, more than nature has: an optical depth of 1.5 over 0.6 m, most light scattered twice or
    // more often.
    let drops = Drops::monodisperse(300.0, 0.2).unwrap();
    let (medium, angles) = (medium(&drops, 1550.0), angles(&drops, 1550.0));
    let slab_m = 1.5 / medium.extinction_per_m;
    let blur = ForwardBlur::new(medium, Some(angles), slab_m * 1e3).unwrap();
    let radii_mm = [1.0, 3.0, 10.0, 30.0, 100.0, 300.0];
    let (within, untouched) = photons(&MieDrops::new(&drops, 1550.0), slab_m, &radii_mm);
    assert!((untouched - blur.unscattered()).abs() < 0.003, "{untouched}");
    for (radius, found) in radii_mm.into_iter().zip(within) {
        let expected = blur.scattered_within(radius);
        // Four standard deviations of the 60 000 photons of the library, and 1 % for its bins.
        let allowed = 4.0 * (found / 60_000.0).sqrt() + 0.01 * found;
        assert!((found - expected).abs() < allowed, "{radius} mm: {found} against {expected}");
    }
}

#[test]
fn the_kernel_on_the_led_grid_holds_the_light_that_lands_there() {
    let drops = Drops::monodisperse(100.0, 0.5).unwrap();
    let blur =
        ForwardBlur::new(medium(&drops, 1550.0), Some(angles(&drops, 1550.0)), 1000.0).unwrap();
    let pitch_mm = 5.0;
    let kernel = blur.kernel(pitch_mm);
    let all = || (-31..=31).flat_map(|r| (-31..=31).map(move |c| (r, c)));
    let sum: f64 = all().map(|(r, c)| kernel.scattered(r, c)).sum();
    let (inside, outside) =
        (blur.scattered_within(31.5 * pitch_mm), blur.scattered_within(31.5 * 1.5 * pitch_mm));
    assert!(sum > 0.98 * inside && sum < 1.02 * outside, "{inside} {sum} {outside}");
    for (r, c) in all() {
        assert!((kernel.scattered(r, c) / kernel.scattered(-r, -c) - 1.0).abs() < 1e-9);
    }
    assert_eq!(kernel.scattered(32, 0), 0.0);
    // A white grid sees the whole kernel from its middle.
    let white = kernel.halo(&vec![1.0; LEDS]);
    assert!(
        white[16 * 32 + 16] < sum
            && white[16 * 32 + 16] > 0.8 * sum
            && white[0] < white[16 * 32 + 16]
    );
}

#[test]
fn the_two_tables_of_water_agree_in_extinction_and_differ_in_albedo() {
    let drops = Drops::monodisperse(5.6, 2.0).unwrap();
    let by = |water| Medium::new(&drops, 1550.0, water).unwrap();
    let (one, other) = (by(Water::Segelstein), by(Water::HaleQuerry));
    assert!((one.extinction_per_m / other.extinction_per_m - 1.0).abs() < 1e-3);
    assert!(
        (one.albedo() - 0.605).abs() < 1e-3 && (other.albedo() - 0.654).abs() < 1e-3,
        "{other:?}"
    );
}

#[test]
fn dry_air_does_nothing() {
    let dry = medium(&Drops::none(), 1550.0);
    assert_eq!((dry.extinction_per_m, dry.transmission(1000.0), dry.albedo()), (0.0, 1.0, 1.0));
    let blur = ForwardBlur::new(dry, None, 1000.0).unwrap();
    assert_eq!(
        (blur.unscattered(), blur.scattered_within(1e9), blur.returned(0.16)),
        (1.0, 0.0, 1.0)
    );
    let veil = Veil::new(&dry, None, &Projector::default(), 1000.0, 40.0).unwrap();
    assert_eq!((veil.backscatter, veil.airlight), (0.0, 0.0));
    assert_eq!(
        ScatteringAngles::new(&Drops::none(), 1550.0, Water::Segelstein),
        Err(RainError::NoDrops)
    );
}

#[test]
fn air_through_which_no_picture_comes_is_refused() {
    let fog = Drops::fog(10.0, 2.0).unwrap();
    let error = ForwardBlur::new(medium(&fog, 1550.0), None, 30_000.0).unwrap_err();
    assert!(error.to_string().contains("expected at most 5"), "{error}");
    assert!(ForwardBlur::new(medium(&fog, 1550.0), None, -1.0).is_err());
}

fn backward(drops: &Drops, nm: f64) -> BackwardLobe {
    BackwardLobe::new(drops, nm, Water::Segelstein).unwrap()
}

#[test]
fn the_veil_of_the_papers_heavy_rain_is_a_millionth_of_a_white_target() {
    let drops = Drops::monodisperse(5.6, 2.0).unwrap();
    let (heavy, lobe) = (medium(&drops, 1550.0), backward(&drops, 1550.0));
    let scattered = (&lobe, &angles(&drops, 1550.0));
    let veil = |mm| Veil::new(&heavy, Some(scattered), &Projector::default(), mm, 40.0).unwrap();
    let (near, far) = (veil(300.0), veil(1000.0));
    assert!(far.backscatter > near.backscatter && far.backscatter < 1e-5, "{near:?} {far:?}");
    // albedo times loss
    assert!((far.airlight / (heavy.albedo() * heavy.extinction_per_m) - 1.0).abs() < 1e-3);
    assert!(Veil::new(&heavy, Some(scattered), &Projector::default(), 0.0, 40.0).is_err());
}

#[test]
fn light_sent_back_hardly_depends_on_a_percent_of_the_drop_size_once_it_is_averaged() {
    let phase = |mm: f64| {
        let lobe = backward(&Drops::monodisperse(5.6, mm).unwrap(), 550.0);
        lobe.phase(176_f64.to_radians())
    };
    let exact = |mm: f64| {
        let medium = medium(&Drops::monodisperse(5.6, mm).unwrap(), 550.0);
        4.0 * PI * medium.backscatter_per_m_sr / medium.scattering_per_m
    };
    let sizes = || (0..6).map(|k| 2.0 + 0.004 * f64::from(k));
    let spread = |of: &dyn Fn(f64) -> f64| {
        let (low, high) =
            sizes().map(of).fold((f64::MAX, 0.0_f64), |(l, h), v| (l.min(v), h.max(v)));
        high / low
    };
    let (averaged, at_180) = (spread(&phase), spread(&exact));
    assert!(averaged < 1.5, "{averaged}");
    assert!(at_180 > 3.0 * averaged, "{at_180} against {averaged}");
}

#[test]
fn the_backward_bands_carry_what_the_whole_phase_function_does() {
    // Share of the light beyond 140 degrees: from the bands, and from the cumulative distribution.
    for drops in [Drops::marshall_palmer(5.6).unwrap(), Drops::fog(10.0, 0.1).unwrap()] {
        let lobe = backward(&drops, 1550.0);
        let share: f64 = (0..40)
            .map(|k| {
                let (low, high) = (140.0 + f64::from(k), 141.0 + f64::from(k));
                let [low, high, middle] = [low, high, (low + high) / 2.0].map(f64::to_radians);
                lobe.phase(middle) * (low.cos() - high.cos()) / 2.0
            })
            .sum();
        let whole = 1.0 - angles(&drops, 1550.0).within(140_f64.to_radians());
        assert!((share / whole - 1.0).abs() < 0.15, "{share} against {whole}");
    }
}

#[test]
fn single_drops_take_on_average_what_their_shadows_say() {
    let drops = Drops::monodisperse(100.0, 1.0).unwrap();
    let mut rain = FallingDrops::new(&drops, beams(1000.0), 3).unwrap();
    let (mut sum, frames) = (0.0, 1500);
    for _ in 0..frames {
        // A drop falls through the view in about 60 ms.
        rain.advance(0.05);
        sum += rain.kept().iter().map(|&k| f64::from(k)).sum::<f64>() / LEDS as f64;
    }
    let loss = 1.0 - sum / f64::from(frames);
    // Out and back; the two shadows are of the same drops, but in different places.
    let expected = 1.0 - (-2.0 * drops.shadow_per_m()).exp();
    assert!((loss / expected - 1.0).abs() < 0.06, "{loss} against {expected}");
}

#[test]
fn a_seed_repeats_its_rain_and_the_drops_stay_as_many() {
    let drops = Drops::marshall_palmer(5.6).unwrap();
    let of = |seed| FallingDrops::new(&drops, beams(600.0), seed).unwrap();
    let (mut one, mut same, other) = (of(1), of(1), of(2));
    let count = one.count();
    for _ in 0..50 {
        one.advance(1e-3);
        same.advance(1e-3);
        assert_eq!(one.kept(), same.kept());
    }
    assert_eq!(one.count(), count);
    assert_ne!(one.kept(), other.kept());
}

#[test]
fn rain_that_cannot_be_followed_drop_by_drop_is_refused() {
    let fog = Drops::fog(10.0, 0.1).unwrap();
    let error = FallingDrops::new(&fog, beams(1000.0), 1).map(|_| ()).unwrap_err().to_string();
    assert!(error.contains("drops in view") && error.contains("at most 200000"), "{error}");
    assert!(FallingDrops::new(&Drops::none(), beams(-1.0), 1).is_err());
}
