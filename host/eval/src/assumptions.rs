//! How much the picture of the paper's camera rests on each constant that the paper does not give.

use crate::camera_model::{along_m, at, distance_axis};
use crate::error::Result;
use nirspi::picture::{Axis, Chart, Line};
use nirspi_optics::CameraModel;
use nirspi_optics::rain::{Drops, Weather};
use nirspi_optics::water::Water;

/// Distance of the white sheet.
const DISTANCE_M: f64 = 0.3;

/// A constant of the camera that is assumed, and what else it could be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Assumption {
    /// What is assumed.
    pub what: &'static str,
    /// Its value.
    pub taken: &'static str,
    /// Another value.
    pub instead: &'static str,
    /// The change of the description, as parts of TOML.
    pub change: &'static [&'static str],
}

const fn assumed(
    what: &'static str,
    taken: &'static str,
    instead: &'static str,
    change: &'static [&'static str],
) -> Assumption {
    Assumption { what, taken, instead, change }
}

/// The constants that were assumed. A test holds the diode to `fga015` and the amplifier to `boards/electronics/camera.toml`.
pub const ASSUMED: [Assumption; 15] = [
    assumed("light of an LED", "4 mW", "2 mW", &["leds.power_mw = 2.0"]),
    assumed("half angle of an LED", "5 degrees", "10 degrees", &["leds.half_angle_deg = 10.0"]),
    assumed("spectrum of an LED", "100 nm", "130 nm", &["leds.spectrum_fwhm_nm = 130.0"]),
    assumed("glass of the collector", "0.79", "0.7", &["collector.glass_transmission = 0.7"]),
    assumed(
        "cover glass",
        "none",
        "throws back 0.2 of a white sheet's light",
        &["collector.cover_veil = 0.2"],
    ),
    assumed("aperture of the detector", "NA 1", "NA 0.6", &["detector.numerical_aperture = 0.6"]),
    assumed(
        "efficiency of the detector",
        "0.9, the paper's",
        "0.76, the data sheet's",
        &["detector.responsivity_a_per_w = 0.95"],
    ),
    assumed("dark current", "2 nA", "20 nA", &["detector.dark_current_na = 20.0"]),
    assumed("noise of the ADC", "72 dB", "62 dB", &["adc.snr_db = 62.0"]),
    assumed(
        "daylight",
        "15 klx, the paper's",
        "100 klx, full sun",
        &["light.illuminance_klx = 100.0"],
    ),
    assumed(
        "rise and fall of an LED",
        "15 ns",
        "20 ns",
        &["leds.rise_ns = 20.0\nleds.fall_ns = 20.0"],
    ),
    assumed("supply of a tile", "stiff", "sags by 1.65 %", &["leds.tile_sag = 0.0165"]),
    assumed("diode", "NA 1, efficiency 0.9", "the data sheet's FGA015", &[DIODE]),
    assumed("amplifier", "1.10 pA/sqrt(Hz)", "the simulated circuit's", &[AMPLIFIER]),
    assumed("diode and amplifier", "both", "the sheet's and the circuit's", &[DIODE, AMPLIFIER]),
];

const DIODE: &str = "[detector]\nnumerical_aperture = 0.6\nresponsivity_a_per_w = 0.95\ncapacitance_pf = 1.5\n\
                     dark_current_na = 0.5";
const AMPLIFIER: &str = "[amplifier]\nbandwidth_mhz = 60.5\nfeedback_kohm = 22.0\ninput_capacitance_pf = 1.1\n\
                         voltage_noise_nv_per_sqrt_hz = 2.93";
/// What is left of the picture if one assumption is wrong.
#[derive(Debug, Clone, PartialEq)]
pub struct Weight {
    /// The assumption.
    pub assumption: Assumption,
    /// The camera with the other value.
    pub camera: CameraModel,
    /// SNR of a white pixel at 0.3 m in dry air, in one picture of all patterns.
    pub snr: f64,
}

/// SNR of a white pixel at 0.3 m in dry air, in one picture of all patterns.
///
/// # Errors
/// Does not occur for a description that was read.
pub fn snr(camera: &CameraModel) -> Result<f64> {
    let dry = Weather::new(Drops::none(), camera.wavelength_nm, Water::Segelstein)?;
    Ok(at(camera, &dry, DISTANCE_M)?.picture_snr)
}

/// The weight of each assumption, the heaviest first.
///
/// # Errors
/// Does not occur: a test reads every change.
pub fn weights() -> Result<Vec<Weight>> {
    let mut weights = Vec::new();
    for assumption in ASSUMED {
        let text =
            format!("basis = \"paper\"\nname = \"changed\"\n{}\n", assumption.change.join("\n"));
        let camera = CameraModel::parse(&text)?;
        weights.push(Weight { assumption, snr: snr(&camera)?, camera });
    }
    weights.sort_by(|a, b| a.snr.total_cmp(&b.snr));
    Ok(weights)
}

/// SNR against distance: the camera as assumed, and with each of the heaviest assumptions changed.
///
/// # Errors
/// As [`weights`].
pub fn chart() -> Result<Chart> {
    let paper = CameraModel::paper();
    let dry = Weather::new(Drops::none(), paper.wavelength_nm, Water::Segelstein)?;
    let line = |name: String, colour, camera: &CameraModel| {
        let points = along_m().filter_map(|m| Some((m, at(camera, &dry, m).ok()?.picture_snr)));
        Line { name, colour, dashed: false, points: points.collect() }
    };
    let mut lines = vec![line("as assumed".to_owned(), 0, paper)];
    for Weight { assumption, camera, .. } in weights()?.iter().take(Line::LOOKS - 1) {
        let Assumption { what, instead, .. } = assumption;
        lines.push(line(format!("{what}: {instead}"), lines.len(), camera));
    }
    Ok(Chart {
        header: "What each assumption weighs".to_owned(),
        x: distance_axis(),
        y: Axis {
            name: "SNR of a white pixel in one picture".to_owned(),
            from: 0.1,
            to: 100.0,
            logarithmic: true,
            ticks: vec![0.1, 1.0, 10.0, 100.0],
        },
        lines,
        footer: "simulated: the paper's camera with one constant changed at a time, dry air, white sheet, all patterns"
            .to_owned(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fmt::Write as _;
    use std::path::Path;

    /// The marks around the table of docs/log/physics.md.
    const BEGIN: &str = "<!-- table: NIRSPI_BLESS=1 cargo test -p nirspi-eval assumptions -->\n";
    const END: &str = "\n<!-- end of table -->";

    fn root() -> &'static Path {
        Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))
    }

    fn weight_of(what: &str) -> Weight {
        weights().unwrap().into_iter().find(|weight| weight.assumption.what == what).unwrap()
    }

    fn table() -> String {
        let as_assumed = snr(CameraModel::paper()).unwrap();
        let mut table = format!(
            "\n| assumed | taken | instead | SNR then, in place of {as_assumed:.1} | share |\n| -- | -- | -- | -- | -- |\n"
        );
        for Weight { assumption: Assumption { what, taken, instead, .. }, snr, .. } in
            weights().unwrap()
        {
            let share = (100.0 * snr / as_assumed).round();
            writeln!(table, "| {what} | {taken} | {instead} | {snr:.1} | {share} % |").unwrap();
        }
        table
    }

    #[test]
    fn the_page_says_what_each_assumption_weighs() {
        let path = root().join("docs/log/physics.md");
        let page = std::fs::read_to_string(&path).unwrap();
        let (before, rest) = page.split_once(BEGIN).unwrap();
        let (found, after) = rest.split_once(END).unwrap();
        let wanted = table();
        if std::env::var_os("NIRSPI_BLESS").is_some() {
            std::fs::write(&path, format!("{before}{BEGIN}{wanted}{END}{after}")).unwrap();
        } else {
            assert_eq!(found, wanted, "NIRSPI_BLESS=1 writes it anew");
        }
    }

    /// Section 8 of the page computes the first by hand. Half of the light halves the ratio, but for the light's own noise,
    /// which is little.
    #[test]
    fn the_camera_as_assumed_is_the_one_that_was_computed_by_hand() {
        let as_assumed = snr(CameraModel::paper()).unwrap();
        assert!((as_assumed - 26.8).abs() < 0.05, "{as_assumed}");
        let half = weight_of("light of an LED").snr / as_assumed;
        assert!((0.5..0.52).contains(&half), "{half}");
    }

    #[test]
    fn diode_and_amplifier_are_those_of_the_sheet_and_of_the_circuit() {
        let circuit = std::fs::read_to_string(root().join("boards/electronics/camera.toml"));
        let circuit = CameraModel::parse(&circuit.unwrap()).unwrap();
        let sheet = CameraModel::named("fga015").unwrap();
        assert_eq!(weight_of("diode").camera.detector, sheet.detector);
        assert_eq!(weight_of("amplifier").camera.amplifier, circuit.amplifier);
        let both = weight_of("diode and amplifier").camera;
        assert_eq!((both.detector, both.amplifier), (sheet.detector, circuit.amplifier));
    }

    #[test]
    fn the_chart_shows_the_heaviest_assumptions_below_the_camera_as_assumed() {
        let Chart { lines, y, .. } = chart().unwrap();
        assert_eq!(lines.len(), Line::LOOKS);
        let at_first = |line: &Line| line.points[0].1;
        assert!(lines[1..].iter().all(|line| at_first(line) < at_first(&lines[0])));
        assert!(at_first(&lines[0]) < y.to);
    }
}
