//! The weather between camera and target as a user writes it: dry air, rain, fog, smoke, dust,
//! drops on the window.

use super::law::numbers_between;
use super::{DropLaw, Drops, Medium, ParseDropLawError, RainError, Rainfall, Weather, Window};
use crate::mie::Index;
use crate::substance::Substance;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;
use thiserror::Error;

/// Wavelength at which visibility is defined: that of the eye's best sensitivity, in nm.
const VISIBILITY_NM: f64 = 550.0;

/// Default for the most frequent diameter of fog droplets, in um: radiation fog.
const FOG_UM: f64 = 10.0;

/// Default for the median diameter of smoke by number, in um: aged smoke of an open fire.
const SMOKE_UM: f64 = 0.3;

/// Geometric standard deviation of smoke.
const SMOKE_SPREAD: f64 = 1.8;

/// Density of soot, in g/cm^3.
const SMOKE_G_PER_CM3: f64 = 1.8;

/// Default for the median diameter of dust by number, in um: transported mineral dust (Hess, Koepke
/// and Schult, Bull. Am. Meteorol. Soc. 79, 831, 1998: radius 0.5 um, spread 2.2, 2.6 g/cm^3).
const DUST_UM: f64 = 1.0;

/// Geometric standard deviation of dust.
const DUST_SPREAD: f64 = 2.2;

/// Density of dust, in g/cm^3.
const DUST_G_PER_CM3: f64 = 2.6;

/// Default for the index of dust, assumed for every wavelength. A user who knows the mineral gives
/// the index.
const DUST_INDEX: Index = Index { real: 1.53, imaginary: 0.003 };

/// The particles in the air, and the window in front of the camera.
///
/// As text, in a camera description or on the command line: [`Air::EXPECTED`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Air {
    name: String,
    drops: Drops,
    substance: Substance,
    window: Option<Window>,
}

/// Error: the text does not name a weather. `Display` is one line.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum AirError {
    /// The kind does not exist.
    #[error("found {found}, expected {}", Air::EXPECTED)]
    Unknown {
        /// The text.
        found: String,
    },
    /// Numbers are missing, too many, or not numbers.
    #[error(transparent)]
    Numbers(#[from] ParseDropLawError),
    /// Numbers out of range.
    #[error(transparent)]
    Range(#[from] RainError),
    /// The text names two kinds of particles at once.
    #[error("found {found}, expected one kind of weather, and drops on the window beside it")]
    Two {
        /// The text.
        found: String,
    },
}

impl Air {
    /// The allowed texts.
    pub const EXPECTED: &str = "none, light, heavy, rain:MM_PER_H[,LAW], fog:AMOUNT[,UM], \
         smoke:AMOUNT[,UM[,N,K]] or dust:AMOUNT[,UM[,N,K]] (AMOUNT in g/m3, or 5m for a visibility of 5 metres), \
         window:SHARE[,DEG], or two of them with a plus sign";

    /// Dry air.
    #[must_use]
    pub fn dry() -> Self {
        Self {
            name: Rainfall::None.name().to_owned(),
            drops: Drops::none(),
            substance: Substance::default(),
            window: None,
        }
    }

    /// Counted drops of water. `name` says where they come from.
    #[must_use]
    pub fn of_drops(name: String, drops: Drops) -> Self {
        Self { name, drops, ..Self::dry() }
    }

    /// The paper's rain, or dry air.
    ///
    /// # Errors
    /// Does not occur: both kinds of rain are in range.
    pub fn of_rainfall(rainfall: Rainfall) -> Result<Self, RainError> {
        let drops = rainfall.drops()?.unwrap_or_default();
        Ok(Self::of_drops(rainfall.name().to_owned(), drops))
    }

    /// The weather as the user wrote it.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The particles.
    #[must_use]
    pub fn drops(&self) -> &Drops {
        &self.drops
    }

    /// Whether the air and the window are clear.
    #[must_use]
    pub fn is_clear(&self) -> bool {
        self.drops.is_empty() && self.window.is_none()
    }

    /// The effects of this weather on light of `wavelength_nm`.
    ///
    /// # Errors
    /// [`RainError`] for a wavelength at which the material is not known, or for particles outside
    /// the Mie solver's range.
    pub fn weather(&self, wavelength_nm: f64) -> Result<Weather, RainError> {
        let weather = Weather::new(self.drops.clone(), wavelength_nm, self.substance)?;
        match self.window {
            Some(window) => weather.behind(window),
            None => Ok(weather),
        }
    }

    /// The effects of particles that do not fall: fog, smoke, dust, drops on the window. Falling
    /// drops are simulated one by one.
    ///
    /// # Errors
    /// As [`Self::weather`].
    pub fn hanging(&self, wavelength_nm: f64) -> Result<Weather, RainError> {
        let drops = if self.drops.fall() { Drops::none() } else { self.drops.clone() };
        Self { drops, ..self.clone() }.weather(wavelength_nm)
    }

    /// The amount in the text. `made` makes the drops of 1 g/m^3.
    fn amount(
        text: &str,
        amount: &str,
        substance: Substance,
        made: impl Fn(f64) -> Result<Drops, RainError>,
    ) -> Result<Drops, AirError> {
        let number = |amount: &str| {
            amount.parse::<f64>().map_err(|_| ParseDropLawError {
                found: text.to_owned(),
                expected: "an amount after the colon: 0.5 (g/m3) or 5m (visibility)".to_owned(),
            })
        };
        let Some(visibility) = amount.strip_suffix('m') else { return Ok(made(number(amount)?)?) };
        let visibility_m = number(visibility)?;
        let holds = visibility_m.is_finite() && visibility_m > 0.0;
        super::ensure(holds, "visibility", visibility_m, "a positive number of metres")?;
        let thin = Medium::new(&made(1.0)?, VISIBILITY_NM, substance)?;
        Ok(made(thin.visibility_m() / visibility_m)?)
    }

    fn particles(text: &str) -> Result<Self, AirError> {
        let unknown = || AirError::Unknown { found: text.to_owned() };
        let Some((kind, parameters)) = text.split_once(':') else {
            let rainfall = Rainfall::ALL.into_iter().find(|kind| kind.name() == text);
            return Ok(Self::of_rainfall(rainfall.ok_or_else(unknown)?)?);
        };
        let (amount, rest) = match parameters.split_once(',') {
            Some((amount, rest)) => (amount, Some(rest)),
            None => (parameters, None),
        };
        let (substance, drops) = match kind {
            "rain" => {
                let law = rest.map_or(Ok(DropLaw::MarshallPalmer), DropLaw::from_str)?;
                let [rate] = numbers_between(text, amount, 1..=1)?[..] else {
                    return Err(unknown());
                };
                (Substance::default(), law.drops(rate)?)
            }
            "fog" => {
                let mode =
                    rest.map_or(Ok(vec![FOG_UM]), |rest| numbers_between(text, rest, 1..=1))?;
                let water = Substance::default();
                (water, Self::amount(text, amount, water, |g| Drops::fog(mode[0], g))?)
            }
            "smoke" | "dust" => {
                let smoke = kind == "smoke";
                let given = rest.map_or(Ok(vec![]), |rest| numbers_between(text, rest, 1..=3))?;
                let (substance, um, spread, density) = match smoke {
                    true => (Substance::Soot, SMOKE_UM, SMOKE_SPREAD, SMOKE_G_PER_CM3),
                    false => (Substance::Fixed(DUST_INDEX), DUST_UM, DUST_SPREAD, DUST_G_PER_CM3),
                };
                let substance = match given[..] {
                    [_, real, imaginary] => Substance::Fixed(Index { real, imaginary }),
                    [_, _] => {
                        return Err(ParseDropLawError {
                            found: text.to_owned(),
                            expected: "N and K, both parts of the index".to_owned(),
                        }
                        .into());
                    }
                    _ => substance,
                };
                let um = given.first().copied().unwrap_or(um);
                let made = |g| Drops::lognormal(um, spread, g, density);
                (substance, Self::amount(text, amount, substance, made)?)
            }
            _ => return Err(unknown()),
        };
        Ok(Self { name: text.to_owned(), drops, substance, window: None })
    }

    fn window(text: &str, parameters: &str) -> Result<Window, AirError> {
        let given = numbers_between(text, parameters, 1..=2)?;
        let angle = given.get(1).copied().unwrap_or(Window::CONTACT_ANGLE_DEG);
        Ok(Window::new(given[0], angle)?)
    }

    /// This weather with the drops on the window that the text after a plus sign gives.
    ///
    /// # Errors
    /// [`AirError`] for text that does not give drops on a window.
    pub fn and_window(self, text: &str) -> Result<Self, AirError> {
        let parameters = text.strip_prefix("window:");
        let parameters = parameters.ok_or_else(|| AirError::Unknown { found: text.to_owned() })?;
        let window = Some(Self::window(text, parameters)?);
        let name =
            if self.drops.is_empty() { text.to_owned() } else { format!("{}+{text}", self.name) };
        Ok(Self { window, name, ..self })
    }
}

impl Default for Air {
    fn default() -> Self {
        Self::dry()
    }
}

impl fmt::Display for Air {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.name)
    }
}

impl From<Air> for String {
    fn from(air: Air) -> Self {
        air.name
    }
}

impl TryFrom<String> for Air {
    type Error = AirError;

    fn try_from(text: String) -> Result<Self, AirError> {
        text.parse()
    }
}

impl FromStr for Air {
    type Err = AirError;

    fn from_str(text: &str) -> Result<Self, AirError> {
        // A law of sizes contains no plus sign.
        let parts: Vec<&str> = text.split('+').collect();
        match parts[..] {
            [only] if only.starts_with("window:") => Self::dry().and_window(only),
            [only] => Self::particles(only),
            [window, air] if window.starts_with("window:") => {
                Self::particles(air)?.and_window(window)
            }
            [air, window] if window.starts_with("window:") => {
                Self::particles(air)?.and_window(window)
            }
            _ => Err(AirError::Two { found: text.to_owned() }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn air(text: &str) -> Air {
        text.parse().unwrap_or_else(|error| panic!("{text}: {error}"))
    }

    #[test]
    fn each_kind_of_weather_is_read_and_keeps_its_name() {
        for text in [
            "none",
            "light",
            "heavy",
            "rain:20",
            "rain:20,mono:2",
            "rain:20,gamma:2,3",
            "fog:0.5",
            "fog:5m",
            "fog:0.5,4",
            "smoke:0.01",
            "smoke:2m,0.1",
            "dust:0.3,2,1.5,0.01",
            "window:0.2",
            "heavy+window:0.2,60",
            "fog:5m+window:0.1",
        ] {
            assert_eq!(air(text).name(), text);
            assert_eq!(air(text).is_clear(), text == "none", "{text}");
            air(text).weather(1550.0).unwrap();
        }
        assert_eq!(air("window:0.1+fog:5m"), air("fog:5m+window:0.1"));
        assert_eq!(air("light"), Air::of_rainfall(Rainfall::Light).unwrap());
    }

    #[test]
    fn an_amount_is_mass_or_visibility() {
        let fog = air("fog:0.5");
        assert!((fog.drops().liquid_water_g_per_m3() / 0.5 - 1.0).abs() < 1e-9);
        for text in ["fog:5m", "smoke:5m", "dust:5m", "dust:5m,3,1.5,0"] {
            let weather = air(text).weather(550.0).unwrap();
            let seen = weather.medium().visibility_m();
            assert!((seen / 5.0 - 1.0).abs() < 1e-9, "{text}: {seen}");
            // Koschmieder's visibility: the contrast of a black object has fallen to 2 %.
            let contrast = weather.medium().transmission(5.0);
            assert!((contrast / 0.02 - 1.0).abs() < 1e-3, "{text}: {contrast}");
        }
    }

    #[test]
    fn soot_absorbs_what_dust_scatters() {
        let albedo = |text| air(text).weather(1550.0).unwrap().medium().albedo();
        let (smoke, fog, dust) = (albedo("smoke:0.01"), albedo("fog:0.5"), albedo("dust:0.1"));
        assert!(smoke < 0.5 && dust > 0.9 && fog > 0.98, "{smoke} {dust} {fog}");
        assert!(albedo("dust:0.1,1,1.53,0.3") < dust);
    }

    #[test]
    fn text_that_names_no_weather_says_what_is_expected() {
        for (text, told) in [
            ("snow", "found snow, expected none, light, heavy, rain:MM_PER_H"),
            ("hail:3", "found hail:3, expected none"),
            ("fog:", "found fog:, expected an amount after the colon"),
            ("fog:1,2,3", "found fog:1,2,3, expected 1 number after"),
            ("fog:-1", "rain: fog water is -1, expected 0 to 100 g/m3"),
            ("fog:0m", "rain: visibility is 0, expected a positive number of metres"),
            ("rain:x", "found rain:x, expected 1 number after"),
            ("rain:301", "rain: rain rate is 301"),
            ("rain:1,hail", "found hail, expected marshall-palmer"),
            ("dust:1,2,3", "found dust:1,2,3, expected N and K"),
            ("window:2", "rain: covered share of the window is 2, expected 0 to 0.9"),
            ("fog:1+dust:1", "found fog:1+dust:1, expected one kind of weather"),
        ] {
            let error = text.parse::<Air>().unwrap_err().to_string();
            assert!(error.starts_with(told), "{error}");
        }
        assert!(air("dust:1,2,0,0").weather(1550.0).is_err());
    }
}
