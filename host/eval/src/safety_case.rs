//! The safety case of a camera's light: what eye and skin receive, and what each single fault
//! leaves lit, for how long.
//!
//! The light is computed from the camera's description. The times are the limits of firmware and
//! gateware themselves. Nothing here was measured on a camera.

mod faults;

use nirspi_optics::CameraModel;
use nirspi_optics::safety::{
    EyeSafety, OutsideTheLimits, RiskGroup, eye_limit_w_per_m2, longest_for_eyes_s,
    longest_for_skin_s,
};
use serde::Serialize;
use std::fmt::{self, Display};

pub use faults::{DarkAfter, FAULTS, Lit, SingleFault};

/// The light at one place, beside the limits.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Exposure {
    /// Which LEDs are lit.
    pub lit: Lit,
    /// Where eye or skin is.
    pub place: &'static str,
    /// Irradiance there, averaged over a sweep.
    pub w_per_m2: f64,
    /// Longest exposure of cornea and lens; `null` means unlimited.
    pub longest_for_eyes_s: Option<f64>,
    /// Longest exposure of the skin; `null` means that the limits name none.
    pub longest_for_skin_s: Option<f64>,
}

/// What follows from a single fault for a person whose eye is at the lens.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Consequence {
    /// The fault, what ends the light, and the tests that show it.
    #[serde(flatten)]
    pub fault: SingleFault,
    /// Irradiance at the lens until the light ends.
    pub at_lens_w_per_m2: f64,
    /// Share of the eye's limit at the lens that is used up when the light ends; `null` if nothing ends the
    /// light.
    pub share_of_limit: Option<f64>,
    /// Longest exposure of an eye at the lens; `null` means unlimited.
    pub longest_for_eyes_s: Option<f64>,
}

/// The safety case of one camera description.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SafetyCase {
    /// Always true: computed from a description, never measured.
    pub simulated: bool,
    /// The description's name.
    pub camera: String,
    /// Light at each place, as designed, with the brightest order file, and with every LED lit.
    pub exposures: Vec<Exposure>,
    /// Risk group of IEC 62471 with the brightest order file, 0.2 m before the lens.
    pub risk_group: RiskGroup,
    /// The same before the array, lens taken off.
    pub risk_group_without_lens: RiskGroup,
    /// Single faults, one by one.
    pub faults: Vec<Consequence>,
}

impl SafetyCase {
    /// The safety case of this camera.
    ///
    /// # Errors
    /// [`OutsideTheLimits`], for a wavelength whose limits are not implemented.
    pub fn of(camera: &CameraModel) -> Result<Self, OutsideTheLimits> {
        let of_share = |lit: Lit| Ok((lit, EyeSafety::with_lit(camera, lit.share())?));
        let lights = [of_share(Lit::Half)?, of_share(Lit::Brightest)?, of_share(Lit::All)?];
        let [_, (_, brightest), _] = lights;
        let exposures = lights.into_iter().flat_map(|(lit, light)| {
            [
                ("at the lens", light.at_lens_w_per_m2),
                ("0.2 m before the lens", light.at_200_mm_w_per_m2),
                ("at the array, lens taken off", light.at_array_w_per_m2),
                ("0.2 m before the array, lens taken off", light.before_array_w_per_m2),
            ]
            .map(|(place, w_per_m2)| Exposure {
                lit,
                place,
                w_per_m2,
                longest_for_eyes_s: longest_for_eyes_s(w_per_m2),
                longest_for_skin_s: longest_for_skin_s(w_per_m2),
            })
        });
        let faults = FAULTS.iter().map(|&fault| {
            let at_lens = EyeSafety::with_lit(camera, fault.lit.share())?.at_lens_w_per_m2;
            Ok(Consequence {
                fault,
                at_lens_w_per_m2: at_lens,
                share_of_limit: fault.dark_after.seconds().map(|s| at_lens / eye_limit_w_per_m2(s)),
                longest_for_eyes_s: longest_for_eyes_s(at_lens),
            })
        });
        Ok(Self {
            simulated: true,
            camera: camera.name.clone(),
            exposures: exposures.collect(),
            risk_group: RiskGroup::of(brightest.at_200_mm_w_per_m2),
            risk_group_without_lens: RiskGroup::of(brightest.before_array_w_per_m2),
            faults: faults.collect::<Result<_, _>>()?,
        })
    }

    /// The exposures as a table in Markdown.
    #[must_use]
    pub fn exposure_table(&self) -> String {
        let head = "| LEDs lit | place | irradiance | eye's limit reached after | skin's limit reached after |\n\
                    | -- | -- | -- | -- | -- |\n";
        let rows = self.exposures.iter().map(|at| {
            let (eyes, skin) = (Span(at.longest_for_eyes_s), Span(at.longest_for_skin_s));
            format!("| {} | {} | {:.1} W/m² | {eyes} | {skin} |\n", at.lit, at.place, at.w_per_m2)
        });
        rows.fold(head.to_owned(), |table, row| table + &row)
    }

    /// The risk groups in a sentence.
    #[must_use]
    pub fn risk_groups(&self) -> String {
        format!(
            "By IEC 62471, at 0.2 m and with the brightest order file: {}; with the lens taken off: {}.",
            self.risk_group, self.risk_group_without_lens
        )
    }

    /// The single faults as a table in Markdown.
    #[must_use]
    pub fn fault_table(&self) -> String {
        let head = "| single fault | LEDs lit until then | what ends the light | dark after | of the eye's limit at the lens |\n\
             | -- | -- | -- | -- | -- |\n";
        let rows = self.faults.iter().map(|found| {
            let SingleFault { fault, lit, ended_by, dark_after, .. } = found.fault;
            let used = match (found.share_of_limit, found.longest_for_eyes_s) {
                _ if lit == Lit::None => "no light".to_owned(),
                (Some(share), _) if share < 1e-4 => "below 0.01 %".to_owned(),
                (Some(share), _) => format!("{:.2} %", 100.0 * share),
                (None, None) => "never reached".to_owned(),
                (None, after) => format!("reached after {}", Span(after)),
            };
            format!("| {fault} | {lit} | {ended_by} | {dark_after} | {used} |\n")
        });
        rows.fold(head.to_owned(), |table, row| table + &row)
    }
}

/// A time in words, or never.
struct Span(Option<f64>);

impl Display for Span {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            None => f.write_str("never"),
            Some(s) if s < 1e-3 => write!(f, "{:.2} µs", s * 1e6),
            Some(s) if s < 1.0 => write!(f, "{:.0} ms", s * 1e3),
            Some(s) if s < 60.0 => write!(f, "{s:.1} s"),
            Some(s) => write!(f, "{:.1} minutes", s / 60.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_written_in_fitting_units() {
        let words = [None, Some(0.41e-6), Some(0.2), Some(5.0), Some(528.0)];
        let words = words.map(|s| Span(s).to_string());
        assert_eq!(words, ["never", "0.41 µs", "200 ms", "5.0 s", "8.8 minutes"]);
    }

    #[test]
    fn a_fault_that_is_ended_soon_uses_little_of_the_limit_and_one_that_is_not_has_a_time() {
        let case = SafetyCase::of(CameraModel::paper()).unwrap();
        for found in &case.faults {
            match found.share_of_limit {
                // The longest that a barrier takes is 5 s.
                Some(share) => assert!(share < 0.1, "{found:?}"),
                None => assert_eq!(found.fault.dark_after, DarkAfter::Never),
            }
        }
        // By hand: 5 s with 62.5 % of the LEDs lit, 204.3 W/m^2 of 18 000 / 5^0.75 = 5383 W/m^2.
        let silent = case.faults.iter().find(|found| found.fault.fault.contains("silent")).unwrap();
        assert!((silent.share_of_limit.unwrap() / 0.03795 - 1.0).abs() < 0.01, "{silent:?}");
        // All LEDs: twice the light, 0.4 of the time.
        let all = case.exposures.iter().find(|at| at.lit == Lit::All).unwrap();
        assert!((all.longest_for_eyes_s.unwrap() / 209.5 - 1.0).abs() < 0.01, "{all:?}");
        // 50.1 and 222.2 W/m^2 with half of the LEDs.
        assert_eq!(case.risk_group, RiskGroup::Exempt);
        assert_eq!(case.risk_group_without_lens, RiskGroup::Low);
        // A shorted converter: 204.3 W/m^2, and 10.92 V in place of 1.42 V at each resistor.
        let supply = case.faults.iter().find(|found| found.fault.lit == Lit::Overdriven).unwrap();
        assert!((supply.at_lens_w_per_m2 / 1571.0 - 1.0).abs() < 0.01, "{supply:?}");
    }
}
