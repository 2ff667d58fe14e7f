//! The table of docs/log/physics.md that says how much the picture of the paper's camera rests on each assumed constant.
//! `NIRSPI_BLESS=1` writes it anew.

#![expect(clippy::unwrap_used, reason = "a failed unwrap in a helper fails its test")]

use nirspi_optics::CameraModel;
use nirspi_optics::instrument::SAMPLE_NS;
use nirspi_optics::pixel::PixelBudget;
use nirspi_optics::rain::{Drops, Weather};
use nirspi_optics::water::Water;
use std::fmt::Write as _;
use std::path::Path;

/// The marks around the table.
const BEGIN: &str = "<!-- table: NIRSPI_BLESS=1 cargo test --test optics error_budget -->\n";
const END: &str = "\n<!-- end of table -->";

/// What is assumed, its value, another value, and the change of the description.
const ASSUMED: [(&str, &str, &str, &str); 11] = [
    ("light of an LED", "4 mW", "2 mW", "leds.power_mw = 2.0"),
    ("half angle of an LED", "5 degrees", "10 degrees", "leds.half_angle_deg = 10.0"),
    ("spectrum of an LED", "100 nm", "130 nm", "leds.spectrum_fwhm_nm = 130.0"),
    ("glass of the collector", "0.79", "0.7", "collector.glass_transmission = 0.7"),
    ("aperture of the detector", "NA 1", "NA 0.6", "detector.numerical_aperture = 0.6"),
    (
        "efficiency of the detector",
        "0.9, the paper's",
        "0.76, the data sheet's",
        "detector.responsivity_a_per_w = 0.95",
    ),
    ("dark current", "2 nA", "20 nA", "detector.dark_current_na = 20.0"),
    ("noise of the ADC", "72 dB", "62 dB", "adc.snr_db = 62.0"),
    ("daylight", "15 klx, the paper's", "100 klx, full sun", "light.illuminance_klx = 100.0"),
    ("rise and fall of an LED", "15 ns", "20 ns", "leds = { rise_ns = 20.0, fall_ns = 20.0 }"),
    ("supply of a tile", "stiff", "sags by 1.65 %", "leds.tile_sag = 0.0165"),
];

/// SNR of a white pixel at 0.3 m in dry air, in one picture of all patterns, of the paper's camera with this change.
fn snr(change: &str) -> f64 {
    snr_of(
        &CameraModel::parse(&format!("basis = \"paper\"\nname = \"changed\"\n{change}\n")).unwrap(),
    )
}

fn snr_of(camera: &CameraModel) -> f64 {
    let readout = camera.readout;
    let pattern_us = f64::from(readout.clocks_per_pattern) * SAMPLE_NS * 1e-3;
    let exposure_us = pattern_us * f64::from(readout.sweeps_per_picture);
    let dry = Weather::new(Drops::none(), camera.wavelength_nm, Water::Segelstein).unwrap();
    PixelBudget::new(&camera.instrument(), &dry, 300.0, 1.0, exposure_us).unwrap().pixel_snr
}

/// The table, the weightiest assumption first.
fn table() -> String {
    let paper = CameraModel::paper();
    let as_assumed = snr_of(paper);
    let mut rows: Vec<(f64, [&str; 3])> = ASSUMED
        .iter()
        .map(|&(what, taken, other, change)| (snr(change), [what, taken, other]))
        .collect();
    // The diode's data sheet and the simulated circuit have descriptions of their own.
    let circuit =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../boards/electronics/camera.toml");
    let circuit = CameraModel::parse(&std::fs::read_to_string(circuit).unwrap()).unwrap();
    let sheet = CameraModel::named("fga015").unwrap();
    let with = |detector: &CameraModel, amplifier: &CameraModel| {
        let (detector, amplifier) = (detector.detector, amplifier.amplifier);
        snr_of(&CameraModel { detector, amplifier, ..paper.clone() })
    };
    rows.extend([
        (with(&sheet, paper), ["diode", "NA 1, efficiency 0.9", "the data sheet's FGA015"]),
        (with(paper, &circuit), ["amplifier", "1.10 pA/sqrt(Hz)", "the simulated circuit's"]),
        (with(&sheet, &circuit), ["diode and amplifier", "both", "both"]),
    ]);
    rows.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut table = format!(
        "\n| assumed | taken | instead | SNR then, in place of {as_assumed:.1} | share |\n| -- | -- | -- | -- | -- |\n"
    );
    for (snr, [what, taken, other]) in rows {
        let share = (100.0 * snr / as_assumed).round();
        writeln!(table, "| {what} | {taken} | {other} | {snr:.1} | {share} % |").unwrap();
    }
    table
}

#[test]
fn the_page_says_what_each_assumption_weighs() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/log/physics.md");
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

/// Section 8 computes the first by hand. Half of the light halves the ratio, but for the light's own noise, which is little.
#[test]
fn the_camera_as_assumed_is_the_one_that_was_computed_by_hand() {
    let as_assumed = snr_of(CameraModel::paper());
    assert!((as_assumed - 26.8).abs() < 0.05, "{as_assumed}");
    let half = snr("leds.power_mw = 2.0") / as_assumed;
    assert!((0.5..0.52).contains(&half), "{half}");
}
