//! Drop sizes: the number of drops of each diameter in a cubic metre of air.
//!
//! Laws of sizes are divided into classes here, and every integral over sizes is a sum over the
//! classes. 100 classes of equal width give extinction and rain rate to better than 1 % of the
//! closed forms (`tests::marshall_palmers_classes_carry_the_law_they_were_cut_from`).

use super::fall::{fall_speed_from_rest_m_per_s, fall_speed_m_per_s};
use super::{RainError, ensure};
use std::f64::consts::PI;

/// Number of classes of a continuous law.
const CLASSES: usize = 100;

/// Smallest raindrop. Below this diameter the fall-speed law ([`super::fall`]) has no positive
/// value.
pub const SMALLEST_RAINDROP_MM: f64 = 0.11;

/// Largest raindrop. Larger drops break up.
pub const LARGEST_RAINDROP_MM: f64 = 8.0;

/// Highest accepted rain rate, in mm/h. A cloudburst has 100 to 200.
pub const HIGHEST_RATE_MM_PER_H: f64 = 300.0;

/// Largest accepted mass of water, smoke or dust, in g/m^3. Natural fog has at most 1, a fog
/// chamber 20.
pub const DENSEST_G_PER_M3: f64 = 100.0;

/// Marshall and Palmer's intercept, in m^-3 mm^-1 (J. Meteorol. 5, 165, 1948).
const MARSHALL_PALMER_INTERCEPT: f64 = 8000.0;

/// Density of water, in g/m^3.
const WATER_G_PER_M3: f64 = 1e6;

/// Drops of one diameter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DropClass {
    /// Diameter.
    pub diameter_mm: f64,
    /// Drops in a cubic metre.
    pub per_m3: f64,
}

/// Drops in the air, by diameter.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Drops {
    classes: Vec<DropClass>,
}

impl Drops {
    /// Dry air.
    #[must_use]
    pub fn none() -> Self {
        Self::default()
    }

    /// Natural rain: `N(D) = 8000 exp(-4.1 R^-0.21 D)` m^-3 mm^-1, D in mm, R in mm/h (Marshall and
    /// Palmer, 1948).
    ///
    /// # Errors
    /// [`RainError::Setting`] for a rate that is not in 0 to [`HIGHEST_RATE_MM_PER_H`].
    pub fn marshall_palmer(rate_mm_per_h: f64) -> Result<Self, RainError> {
        check_rate(rate_mm_per_h)?;
        if rate_mm_per_h == 0.0 {
            return Ok(Self::none());
        }
        let slope = 4.1 * rate_mm_per_h.powf(-0.21);
        Ok(Self::from_law(SMALLEST_RAINDROP_MM, LARGEST_RAINDROP_MM.min(20.0 / slope), |d| {
            MARSHALL_PALMER_INTERCEPT * (-slope * d).exp()
        }))
    }

    /// A gamma law `N(D) = N0 D^shape exp(-slope D)` (Ulbrich, J. Climate Appl. Meteorol. 22, 1764,
    /// 1983), with the N0 of this rain rate. `shape` is the paper's mu, `slope_per_mm` its Lambda.
    ///
    /// # Errors
    /// [`RainError::Setting`] for a rate out of range, a shape not in -1 to 20, a slope not in 0.5
    /// to 50.
    pub fn gamma(rate_mm_per_h: f64, shape: f64, slope_per_mm: f64) -> Result<Self, RainError> {
        check_rate(rate_mm_per_h)?;
        ensure((-1.0..=20.0).contains(&shape), "gamma shape", shape, "-1 to 20")?;
        ensure(
            (0.5..=50.0).contains(&slope_per_mm),
            "gamma slope",
            slope_per_mm,
            "0.5 to 50 per mm",
        )?;
        if rate_mm_per_h == 0.0 {
            return Ok(Self::none());
        }
        let largest = LARGEST_RAINDROP_MM.min((20.0 + 3.0 * shape.max(0.0)) / slope_per_mm);
        let law = |d: f64| d.powf(shape) * (-slope_per_mm * d).exp();
        Ok(Self::from_law(SMALLEST_RAINDROP_MM, largest, law).scaled_to_rate(rate_mm_per_h))
    }

    /// Drops of one size, which the paper states for its nozzles: 0.5 mm light, 2 mm heavy.
    ///
    /// # Errors
    /// [`RainError::Setting`] for a rate out of range, or a diameter that raindrops do not have.
    pub fn monodisperse(rate_mm_per_h: f64, diameter_mm: f64) -> Result<Self, RainError> {
        check_rate(rate_mm_per_h)?;
        let falls = (SMALLEST_RAINDROP_MM..=LARGEST_RAINDROP_MM).contains(&diameter_mm);
        ensure(falls, "drop diameter", diameter_mm, "0.11 to 8 mm")?;
        if rate_mm_per_h == 0.0 {
            return Ok(Self::none());
        }
        let one = Self { classes: vec![DropClass { diameter_mm, per_m3: 1.0 }] };
        Ok(one.scaled_to_rate(rate_mm_per_h))
    }

    /// Counted drops.
    ///
    /// # Errors
    /// [`RainError`] if there are no drops, or a diameter or number is not physical.
    pub fn measured(classes: Vec<DropClass>) -> Result<Self, RainError> {
        if classes.is_empty() {
            return Err(RainError::NoDrops);
        }
        for class in &classes {
            let DropClass { diameter_mm, per_m3 } = *class;
            let sized = diameter_mm > 0.0 && diameter_mm <= LARGEST_RAINDROP_MM;
            ensure(sized, "drop diameter", diameter_mm, "more than 0 and at most 8 mm")?;
            ensure(per_m3.is_finite() && per_m3 >= 0.0, "drops per m3", per_m3, "0 or more")?;
        }
        Ok(Self { classes })
    }

    /// Fog: `N(D) ~ D^6 exp(-6 D / mode)`, the shape of Deirmendjian's cloud C1 (*Electromagnetic
    /// Scattering on Spherical Polydispersions*, 1969) around the most frequent diameter `mode_um`,
    /// with `liquid_g_per_m3` of water.
    ///
    /// # Errors
    /// [`RainError::Setting`] for a mode not in 0.5 to 100 um or more water than
    /// [`DENSEST_G_PER_M3`].
    pub fn fog(mode_um: f64, liquid_g_per_m3: f64) -> Result<Self, RainError> {
        ensure((0.5..=100.0).contains(&mode_um), "fog mode", mode_um, "0.5 to 100 um")?;
        let holds = (0.0..=DENSEST_G_PER_M3).contains(&liquid_g_per_m3);
        ensure(holds, "fog water", liquid_g_per_m3, "0 to 100 g/m3")?;
        let mode_mm = mode_um * 1e-3;
        let law = |d: f64| (d / mode_mm).powi(6) * (-6.0 * d / mode_mm).exp();
        let fog = Self::from_law(0.05 * mode_mm, 5.0 * mode_mm, law);
        let factor = liquid_g_per_m3 / fog.liquid_water_g_per_m3();
        Ok(fog.scaled(factor))
    }

    /// Particles with a log-normal distribution of diameters by number around `median_um`. `spread`
    /// is the geometric standard deviation. The mass is `g_per_m3` of a material of
    /// `density_g_per_cm3`.
    ///
    /// # Errors
    /// [`RainError::Setting`] for a median not in 0.02 to 100 um, or a mass that is not in 0 to
    /// [`DENSEST_G_PER_M3`].
    pub fn lognormal(
        median_um: f64,
        spread: f64,
        g_per_m3: f64,
        density_g_per_cm3: f64,
    ) -> Result<Self, RainError> {
        ensure(
            (0.02..=100.0).contains(&median_um),
            "median diameter",
            median_um,
            "0.02 to 100 um",
        )?;
        ensure((1.1..=3.0).contains(&spread), "geometric standard deviation", spread, "1.1 to 3")?;
        let holds = (0.0..=DENSEST_G_PER_M3).contains(&g_per_m3);
        ensure(holds, "mass in the air", g_per_m3, "0 to 100 g/m3")?;
        let sigma = spread.ln();
        // The third moment, and with it the mass, has its median at 3 sigma^2 above that of the
        // numbers.
        let (low, high) = (-3.0 * sigma, 3.0 * sigma + 3.0 * sigma * sigma);
        let width = (high - low) / CLASSES as f64;
        let class = |i| {
            let log = low + (i as f64 + 0.5) * width;
            let per_m3 = (-log * log / (2.0 * sigma * sigma)).exp() * width;
            DropClass { diameter_mm: median_um * 1e-3 * log.exp(), per_m3 }
        };
        let one = Self { classes: (0..CLASSES).map(class).collect() };
        let factor = g_per_m3 / (one.liquid_water_g_per_m3() * density_g_per_cm3);
        Ok(one.scaled(factor))
    }

    /// Midpoints of equal classes.
    fn from_law(smallest_mm: f64, largest_mm: f64, law: impl Fn(f64) -> f64) -> Self {
        let width = (largest_mm - smallest_mm) / CLASSES as f64;
        let class = |i| {
            let diameter_mm = smallest_mm + (i as f64 + 0.5) * width;
            DropClass { diameter_mm, per_m3: law(diameter_mm) * width }
        };
        Self { classes: (0..CLASSES).map(class).collect() }
    }

    pub(super) fn scaled(mut self, factor: f64) -> Self {
        for class in &mut self.classes {
            class.per_m3 *= factor;
        }
        self
    }

    fn scaled_to_rate(self, rate_mm_per_h: f64) -> Self {
        let factor = rate_mm_per_h / self.rate_mm_per_h();
        self.scaled(factor)
    }

    /// The same water per hour `height_m` below nozzles that release the drops at rest. Drops below
    /// their terminal speed are denser, each class by the ratio of the two speeds. A nozzle that
    /// ejects drops with some speed gives fewer drops, so the result is an upper bound. Droplets
    /// that do not fall stay unchanged.
    ///
    /// # Errors
    /// [`RainError::Setting`] for a height that is not positive.
    pub fn below_nozzles(&self, height_m: f64) -> Result<Self, RainError> {
        let holds = height_m.is_finite() && height_m > 0.0;
        ensure(holds, "height below the nozzles", height_m, "a positive number of metres")?;
        let denser = |class: &DropClass| {
            let slow = fall_speed_from_rest_m_per_s(class.diameter_mm, height_m);
            let factor =
                if slow > 0.0 { fall_speed_m_per_s(class.diameter_mm) / slow } else { 1.0 };
            DropClass { per_m3: class.per_m3 * factor, ..*class }
        };
        Ok(Self { classes: self.classes.iter().map(denser).collect() })
    }

    /// The classes.
    #[must_use]
    pub fn classes(&self) -> &[DropClass] {
        &self.classes
    }

    /// Whether the air is dry.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.concentration_per_m3() == 0.0
    }

    /// Whether the drops fall and can be simulated one by one. Droplets and grains stay in the air.
    #[must_use]
    pub fn fall(&self) -> bool {
        let falls = |class: &DropClass| class.diameter_mm >= SMALLEST_RAINDROP_MM;
        self.classes.iter().any(|class| falls(class) && class.per_m3 > 0.0)
    }

    /// Drops in a cubic metre.
    #[must_use]
    pub fn concentration_per_m3(&self) -> f64 {
        self.classes.iter().map(|class| class.per_m3).sum()
    }

    /// Sum over the drops of a cubic metre.
    pub(super) fn sum(&self, each: impl Fn(f64) -> f64) -> f64 {
        self.classes.iter().map(|class| class.per_m3 * each(class.diameter_mm)).sum()
    }

    /// Depth of water that falls in an hour at sea level, `sum N v pi/6 D^3`.
    #[must_use]
    pub fn rate_mm_per_h(&self) -> f64 {
        // mm^3 m / (m^3 s) = 1e-9 m/s = 1e-6 mm/s
        self.sum(|d| PI / 6.0 * d.powi(3) * fall_speed_m_per_s(d)) * 1e-6 * 3600.0
    }

    /// Water in the air.
    #[must_use]
    pub fn liquid_water_g_per_m3(&self) -> f64 {
        self.sum(|d| PI / 6.0 * (d * 1e-3).powi(3) * WATER_G_PER_M3)
    }

    /// Share of a plane that the drops of one metre of air cover, `sum N pi/4 D^2`: half of the
    /// extinction of drops that are large compared with the wavelength.
    #[must_use]
    pub fn shadow_per_m(&self) -> f64 {
        self.sum(|d| PI / 4.0 * d * d * 1e-6)
    }
}

fn check_rate(rate_mm_per_h: f64) -> Result<(), RainError> {
    let falls = (0.0..=HIGHEST_RATE_MM_PER_H).contains(&rate_mm_per_h);
    ensure(falls, "rain rate", rate_mm_per_h, "0 to 300 mm/h")
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn marshall_palmers_classes_carry_the_law_they_were_cut_from() {
        let rate: f64 = 5.6;
        let slope = 4.1 * rate.powf(-0.21);
        let drops = Drops::marshall_palmer(rate).unwrap();
        // Integral of pi/4 D^2 N0 exp(-slope D) over all D: pi N0 / (2 slope^3), less what is below
        // 0.11 mm.
        let whole = PI * 8000.0 / (2.0 * slope.powi(3)) * 1e-6;
        assert!((drops.shadow_per_m() / whole - 1.0).abs() < 0.01, "{}", drops.shadow_per_m());
        // With the newer fall speeds, the law of 1948 gives 10 to 20 % more rain than its nominal
        // rate.
        assert!((1.0..1.25).contains(&(drops.rate_mm_per_h() / rate)), "{}", drops.rate_mm_per_h());
    }

    #[test]
    fn heavy_rain_of_2_mm_drops_holds_57_of_them_in_a_cubic_metre() {
        // By hand: 5.6 mm/h = 1.5556e-6 m/s; v(2 mm) = 6.548 m/s; 4.1888e-9 m^3 a drop.
        let drops = Drops::monodisperse(5.6, 2.0).unwrap();
        assert!((drops.concentration_per_m3() / 56.72 - 1.0).abs() < 1e-3, "{drops:?}");
        assert!((drops.shadow_per_m() / 1.782e-4 - 1.0).abs() < 1e-3);
    }

    #[test]
    fn below_nozzles_the_same_water_is_in_slower_and_therefore_more_drops() {
        // 6.548 m/s over 2.153 m/s: 3.04 times; 0.5 mm drops are near their terminal speed: 1.2
        // times.
        for (diameter_mm, times) in [(2.0, 3.04), (0.5, 1.17)] {
            let drops = Drops::monodisperse(5.6, diameter_mm).unwrap();
            let rig = drops.below_nozzles(0.25).unwrap();
            let found = rig.concentration_per_m3() / drops.concentration_per_m3();
            assert!((found / times - 1.0).abs() < 0.03, "{diameter_mm} mm: {found}");
        }
        assert!(Drops::none().below_nozzles(0.0).is_err());
    }

    #[test]
    fn fog_holds_the_water_asked_for_in_droplets_around_its_mode() {
        let fog = Drops::fog(10.0, 0.1).unwrap();
        assert!((fog.liquid_water_g_per_m3() / 0.1 - 1.0).abs() < 1e-9);
        let most = fog.classes().iter().max_by(|a, b| a.per_m3.total_cmp(&b.per_m3)).unwrap();
        assert!((most.diameter_mm - 0.010).abs() < 0.0005, "{most:?}");
        assert_eq!(fog.rate_mm_per_h(), 0.0);
    }

    #[test]
    fn impossible_rain_is_named_with_its_range() {
        for rate in [-1.0, 301.0, f64::NAN] {
            for made in [
                Drops::marshall_palmer(rate),
                Drops::gamma(rate, 2.0, 3.0),
                Drops::monodisperse(rate, 2.0),
            ] {
                let message = made.unwrap_err().to_string();
                assert!(message.starts_with("rain: rain rate is"), "{message}");
                assert!(message.ends_with("expected 0 to 300 mm/h"), "{message}");
            }
        }
        assert!(Drops::monodisperse(1.0, 9.0).is_err() && Drops::monodisperse(1.0, 0.05).is_err());
        assert!(Drops::gamma(1.0, 30.0, 3.0).is_err() && Drops::gamma(1.0, 2.0, 0.0).is_err());
        assert!(Drops::fog(0.0, 0.1).is_err() && Drops::fog(10.0, -0.1).is_err());
        assert_eq!(Drops::measured(vec![]), Err(RainError::NoDrops));
        let bad = vec![DropClass { diameter_mm: 1.0, per_m3: f64::NAN }];
        assert!(Drops::measured(bad).is_err());
    }

    proptest! {
        #[test]
        fn rain_of_a_rate_falls_at_that_rate(rate in 0.01..150.0, shape in 0.0..8.0, slope in 1.5..8.0, d in 0.2..6.0) {
            for drops in [Drops::gamma(rate, shape, slope).unwrap(), Drops::monodisperse(rate, d).unwrap()] {
                prop_assert!((drops.rate_mm_per_h() / rate - 1.0).abs() < 1e-9);
            }
        }

        #[test]
        fn more_rain_is_more_water_and_more_shadow(rate in 0.1..100.0) {
            let (less, more) = (Drops::marshall_palmer(rate).unwrap(), Drops::marshall_palmer(rate * 1.5).unwrap());
            prop_assert!(more.shadow_per_m() > less.shadow_per_m());
            prop_assert!(more.liquid_water_g_per_m3() > less.liquid_water_g_per_m3());
        }
    }

    #[test]
    fn no_rain_is_dry_air() {
        for drops in [
            Drops::marshall_palmer(0.0),
            Drops::gamma(0.0, 1.0, 2.0),
            Drops::monodisperse(0.0, 1.0),
        ] {
            assert!(drops.unwrap().is_empty());
        }
    }
}
