//! What Algorithm 2 promises here: ranges that follow from light and noise, and an honest comparison with the
//! paper's.

#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

use nirspi_optics::camera::Instrument;
use nirspi_optics::pixel::PixelBudget;
use nirspi_optics::rain::{Drops, Weather};
use nirspi_optics::range::{
    FARTHEST_MM, Floor, Wanted, as_printed_mm, exposure_needed_us, extinction_needed_per_m,
    farthest_mm,
};
use nirspi_optics::water::Water;

fn weather(rate: f64, drop_mm: f64) -> Weather {
    let drops = Drops::monodisperse(rate, drop_mm).unwrap();
    Weather::new(drops, 1550.0, Water::Segelstein).unwrap()
}

fn wanted(exposure_us: f64) -> Wanted {
    Wanted { reflectance: 1.0, exposure_us, snr: 1.0 }
}

fn range_m(weather: &Weather, wanted: &Wanted) -> f64 {
    farthest_mm(&Instrument::default(), weather, wanted).unwrap().unwrap() * 1e-3
}

#[test]
fn at_its_range_a_pixel_has_the_snr_wanted() {
    let heavy = weather(5.6, 2.0);
    let range_mm = range_m(&heavy, &wanted(25.0)) * 1e3;
    let pixel = PixelBudget::new(&Instrument::default(), &heavy, range_mm, 1.0, 25.0).unwrap();
    assert!((pixel.pixel_snr - 1.0).abs() < 1e-3, "{}", pixel.pixel_snr);
}

#[test]
fn natural_amounts_of_rain_hardly_change_the_range() {
    let dry = range_m(&weather(0.0, 2.0), &wanted(25.0));
    for (rate, drop_mm) in [(1.93, 0.5), (5.6, 2.0)] {
        let wet = range_m(&weather(rate, drop_mm), &wanted(25.0));
        assert!(wet < dry && wet > 0.99 * dry, "{wet} of {dry}");
    }
}

#[test]
fn exposure_changes_the_range_by_its_fourth_root() {
    // Amplifier noise: SNR goes as exposure^(1/2) / distance^2. From 8 to 25 us: 1.33, the ratio of the paper's two
    // ranges.
    let light = weather(1.93, 0.5);
    let ratio = range_m(&light, &wanted(25.0)) / range_m(&light, &wanted(8.0));
    assert!((ratio - (25.0_f64 / 8.0).powf(0.25)).abs() < 0.02, "{ratio}");
}

#[test]
fn seeing_1_5_m_where_dry_air_shows_2_takes_hundreds_of_times_the_papers_rain() {
    let instrument = Instrument::default();
    let (light, heavy) = (weather(1.93, 0.5), weather(5.6, 2.0));
    let snr = PixelBudget::new(&instrument, &light, 2000.0, 1.0, 25.0).unwrap().pixel_snr;
    let two_metres = Wanted { snr, ..wanted(25.0) };
    let needed =
        extinction_needed_per_m(&instrument, &heavy, &two_metres, 1500.0).unwrap().unwrap();
    let factor = needed / heavy.medium().extinction_per_m;
    assert!(factor > 300.0, "{factor}");
    assert_eq!(extinction_needed_per_m(&instrument, &heavy, &two_metres, 3000.0), Ok(None));
}

#[test]
fn as_printed_the_range_is_the_first_step_at_which_one_exposure_drowns_in_its_noise() {
    let instrument = Instrument::default();
    for (rate, drop_mm, exposure_us) in [(1.93, 0.5, 8.0), (5.6, 2.0, 8.0), (5.6, 2.0, 25.0)] {
        let rain = weather(rate, drop_mm);
        let asked = wanted(exposure_us);
        let printed =
            as_printed_mm(&instrument, &rain, &asked, (drop_mm, 3000.0), Floor::OneExposure)
                .unwrap();
        assert_eq!(printed % 300.0, 0.0);
        // One exposure of one LED: at the step before it is above its noise, at this one below.
        let snr =
            |mm| PixelBudget::new(&instrument, &rain, mm, 1.0, exposure_us).unwrap().exposure_snr;
        assert!(snr(printed) < 1.01, "{}", snr(printed));
        assert!(printed == 300.0 || snr(printed - 300.0) > 1.0, "{}", snr(printed - 300.0));
    }
}

#[test]
fn with_the_gain_of_all_patterns_algorithm_2_ends_within_a_step_of_the_physics() {
    let (instrument, heavy) = (Instrument::default(), weather(5.6, 2.0));
    let printed = |z_max_mm| {
        as_printed_mm(&instrument, &heavy, &wanted(25.0), (2.0, z_max_mm), Floor::WholePicture)
    };
    let (stepped, physics) = (printed(10_000.0).unwrap(), range_m(&heavy, &wanted(25.0)) * 1e3);
    assert_eq!(stepped % 1000.0, 0.0);
    assert!(stepped >= physics && stepped < physics + 1000.0, "{stepped} {physics}");
    assert_eq!(printed(1000.0), Ok(1000.0));
}

#[test]
fn the_exposure_needed_grows_as_the_fourth_power_of_the_distance_not_by_the_papers_three() {
    let (instrument, heavy) = (Instrument::default(), weather(5.6, 2.0));
    let at = |mm| exposure_needed_us(&instrument, &heavy, (mm, 1.0), 5.0).unwrap();
    let ratio = at(1000.0) / at(300.0);
    // (1 / 0.3)^4 = 123; shot noise of the array's own light is larger near by.
    assert!((100.0..125.0).contains(&ratio), "{ratio}");
    let pixel = PixelBudget::new(&instrument, &heavy, 600.0, 1.0, at(600.0)).unwrap();
    assert!((pixel.pixel_snr - 5.0).abs() < 1e-9, "{}", pixel.pixel_snr);
}

#[test]
fn a_camera_in_the_dark_sees_nothing_and_a_bright_one_to_the_end() {
    let mut instrument = Instrument::default();
    instrument.budget.led_power_mw = 1e-9;
    assert_eq!(farthest_mm(&instrument, &weather(0.0, 1.0), &wanted(8.0)), Ok(None));
    instrument.budget.led_power_mw = 4.0;
    let easy = Wanted { snr: 1e-6, ..wanted(25.0) };
    assert_eq!(farthest_mm(&instrument, &weather(0.0, 1.0), &easy), Ok(Some(FARTHEST_MM)));
}
