use super::file::RANGES;
use super::*;

fn line(toml: &str) -> String {
    let line = CameraModel::parse(toml).unwrap_err().to_string();
    assert!(!line.contains('\n'), "{line:?}");
    line
}

#[test]
fn every_shipped_camera_is_read_and_the_first_is_the_default() {
    for name in CameraModel::names() {
        let text = CameraModel::shipped_text(name).unwrap();
        let camera = CameraModel::parse(text).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!(camera.name, name);
        camera.validate().unwrap();
        assert_eq!(CameraModel::parse(&camera.to_toml()).unwrap(), camera, "{name}");
    }
    assert_eq!(CameraModel::default().name, "paper");
    assert_eq!(CameraModel::named("none"), None);
}

#[test]
fn the_data_sheets_diode_differs_from_the_papers_in_what_the_sheet_says() {
    let [paper, sheet] = ["paper", "fga015"].map(|name| CameraModel::named(name).unwrap());
    assert!((paper.quantum_efficiency() - 0.9).abs() < 1e-6);
    assert!((sheet.quantum_efficiency() - 0.76).abs() < 1e-3);
    assert_eq!((sheet.detector.dark_current_na, sheet.detector.capacitance_pf), (0.5, 1.5));
    assert_eq!(sheet.projector, paper.projector);
}

#[test]
fn a_description_has_any_weather_that_a_command_line_has() {
    for text in ["none", "heavy", "rain:20,mono:2", "fog:5m+window:0.2", "dust:0.5,2,1.53,0.003"] {
        let camera = CameraModel::parse(&format!("[weather]\nair = \"{text}\"")).unwrap();
        assert_eq!(camera.weather.air, text.parse().unwrap());
        assert_eq!(CameraModel::parse(&camera.to_toml()).unwrap(), camera, "{text}");
    }
    for (text, expected) in [
        ("\"hail\"", "none, light, heavy, rain:MM_PER_H"),
        ("\"fog:x\"", "an amount after the colon"),
        ("\"window:3\"", "possible weather ("),
        ("3", "text in quotes"),
    ] {
        let line = line(&format!("[weather]\nair = {text}"));
        assert!(line.starts_with(&format!("weather.air is {text}, expected {expected}")), "{line}");
    }
}

#[test]
fn what_a_file_does_not_say_is_as_in_its_basis() {
    let paper = CameraModel::default();
    assert_eq!(CameraModel::parse("").unwrap(), paper);
    let brighter = CameraModel::parse("[leds]\npower_mw = 8").unwrap();
    assert_eq!(brighter.leds.power_mw, 8.0);
    assert_eq!(brighter.projector, paper.projector);
    let far = CameraModel::parse("basis = \"one-metre\"\n[light]\nsource = \"halogen\"").unwrap();
    assert_eq!(far.projector.focus_distance_mm, 1000.0);
    assert_eq!(far.light.source, LightSource::Halogen);
}

#[test]
fn mistakes_are_named_with_key_found_and_expected() {
    let cases = [
        ("[leds]\npower = 4", "found leds.power, expected one of dead, fall_ns, half_angle_deg"),
        ("[led]\npower_mw = 4", "found led, expected one of adc, amplifier"),
        ("[leds]\npower_mw = -1", "leds.power_mw is -1.0, expected a number from 0.001 to 1000"),
        (
            "[leds]\npower_mw = \"4\"",
            "leds.power_mw is \"4\", expected a number from 0.001 to 1000",
        ),
        ("[leds]\npower_mw = nan", "leds.power_mw is nan, expected a number from 0.001 to 1000"),
        ("[leds]\nrise_ns = -1", "leds.rise_ns is -1.0, expected a number from 0 to 10000"),
        ("[leds]\nfall_ns = nan", "leds.fall_ns is nan, expected a number from 0 to 10000"),
        ("[leds]\nfall_ns = \"15\"", "leds.fall_ns is \"15\", expected a number from 0 to 10000"),
        (
            "[leds]\nfall_ns = 60",
            "leds.fall_ns is 60, expected at most 22.0 for patterns of 40 ns, because rise and fall differ",
        ),
        ("[leds]\nedge_ns = -1", "leds.edge_ns is -1.0, expected a number from 0 to 10000"),
        ("[leds]\nedge_ns = inf", "leds.edge_ns is inf, expected a number from 0 to 10000"),
        ("[leds]\nedge_ns = \"fast\"", "leds.edge_ns is \"fast\", expected a number from 0 to"),
        (
            "[leds]\nedge_ns = 12\nfall_ns = 13",
            "leds.edge_ns is 12, expected either edge_ns or rise_ns and fall_ns",
        ),
        (
            "[leds]\nturn_on_delay_ns = 8.5",
            "leds.turn_on_delay_ns is 8.5, expected a number from 0 to 8",
        ),
        (
            "[leds]\nturn_off_delay_ns = -1",
            "leds.turn_off_delay_ns is -1.0, expected a number from 0 to 8",
        ),
        ("[leds]\ntile_sag = nan", "leds.tile_sag is nan, expected a number from 0 to 0.5"),
        (
            "[leds]\nline_crosstalk_ff = -3",
            "leds.line_crosstalk_ff is -3.0, expected a number from 0 to 100000",
        ),
        ("leds = 4", "leds is 4, expected a section [leds]"),
        (
            "[leds]\ndead = [[0, 32]]",
            "leds.dead is [[0, 32]], expected a list of [row, column], each 0 to 31",
        ),
        (
            "[adc]\nlatency_clocks = 6.5",
            "adc.latency_clocks is 6.5, expected a whole number from 0 to 63",
        ),
        (
            "[adc]\noffset_counts = 20000",
            "adc.offset_counts is 20000, expected a whole number from 0 to 16383",
        ),
        (
            "[light]\nsource = \"moon\"",
            "light.source is \"moon\", expected daylight, halogen, led-lamp",
        ),
        ("basis = \"mine\"", "basis is \"mine\", expected paper, fga015, one-metre"),
        ("name = 3", "name is 3, expected text in quotes"),
        (
            "[projector]\nemitter_mm = 4.0",
            "projector.emitter_mm is 4, expected at most the 3 of projector.led_pitch_mm",
        ),
        (
            "[projector]\nfocus_distance_mm = 200",
            "projector.focus_distance_mm is 200, expected more than the 200 of projector.focal_length_mm",
        ),
        (
            "[readout]\nblanked = 5",
            "readout.blanked is 5, expected less than the 5 of readout.clocks_per_pattern",
        ),
        ("wavelength_nm = 1000", "an electron for each photon of 1000 nm"),
        ("[leds]\npower_mw = = 4", "line 2: "),
    ];
    for (toml, words) in cases {
        let line = line(toml);
        assert!(line.contains(words), "{toml:?}: {line}");
    }
}

#[test]
fn every_number_has_a_range_and_every_range_a_number() {
    let table: toml::Table = CameraModel::shipped_text("paper").unwrap().parse().unwrap();
    let mut numbers = Vec::new();
    for (section, content) in &table {
        match content {
            toml::Value::Table(content) => numbers.extend(
                content
                    .iter()
                    .filter(|(_, value)| value.is_float() || value.is_integer())
                    .map(|(name, _)| format!("{section}.{name}")),
            ),
            value if value.is_float() => numbers.push(section.clone()),
            _ => {}
        }
    }
    numbers.sort();
    let mut ranged: Vec<String> = RANGES.iter().map(|(key, ..)| (*key).to_owned()).collect();
    ranged.sort();
    assert_eq!(numbers, ranged);
}

#[test]
fn a_number_changed_by_a_program_is_checked_too() {
    let mut camera = CameraModel::default();
    camera.leds.power_mw = f64::INFINITY;
    assert!(camera.validate().unwrap_err().to_string().starts_with("leds.power_mw is inf"));
    let mut camera = CameraModel::default();
    camera.detector.responsivity_a_per_w = 1.28;
    assert!(camera.validate().unwrap_err().to_string().contains("at most 1.250"));
}

#[test]
fn an_ideal_array_has_equal_leds_and_a_real_one_its_spread() {
    assert!(CameraModel::default().led_gains().iter().all(|&gain| gain == 1.0));
    let real = |seed| {
        let toml = format!("[leds]\npower_spread = 0.1\nspread_seed = {seed}\ndead = [[3, 7]]");
        CameraModel::parse(&toml).unwrap().led_gains()
    };
    let gains = real(1);
    let lit: Vec<f64> = gains.iter().filter(|&&gain| gain > 0.0).map(|&gain| gain.into()).collect();
    assert_eq!((lit.len(), gains[3 * 32 + 7]), (1023, 0.0));
    let mean = lit.iter().sum::<f64>() / 1023.0;
    let spread = (lit.iter().map(|gain| (gain - mean).powi(2)).sum::<f64>() / 1023.0).sqrt();
    // 1023 LEDs show a spread to within 1 / sqrt(2 * 1023) = 2.2 %; the limit is four times that.
    assert!((mean - 1.0).abs() < 0.013 && (spread / 0.1 - 1.0).abs() < 0.09, "{mean} {spread}");
    assert_eq!(gains, real(1));
    assert_ne!(gains, real(2));
    let dark_corners =
        CameraModel::parse("[projector]\ncorner_vignetting = 0.3").unwrap().led_gains();
    assert!((dark_corners[0] - 0.7).abs() < 1e-6 && dark_corners[16 * 32 + 16] > 0.999);
    let astray = CameraModel::parse("[leds]\npointing_spread_deg = 2").unwrap().led_gains();
    assert!(astray.iter().all(|&gain| gain > 0.0 && gain <= 1.0));
}

#[test]
fn a_larger_diode_makes_the_amplifier_noisier() {
    // By hand: 0.8677 pA of 22 kilohm and 0.6747 pA of 1 nV across 3.1 pF at 60 MHz.
    let noise = CameraModel::default().amplifier_noise_pa_per_sqrt_hz();
    assert!((noise - 1.0992).abs() < 1e-3, "{noise}");
    let large = CameraModel::parse("[detector]\ncapacitance_pf = 80").unwrap();
    assert!(large.amplifier_noise_pa_per_sqrt_hz() > 15.0);
    // 2 pi * 22 kilohm * 3.1 pF * (60 MHz)^2 = 1.54 GHz.
    assert!((CameraModel::default().gain_bandwidth_ghz() - 1.543).abs() < 0.01);
}

#[test]
fn a_key_depends_on_names_and_values_alone() {
    #[derive(Serialize)]
    struct Inner {
        volts: f64,
        on: bool,
    }
    #[derive(Serialize)]
    struct One {
        name: &'static str,
        part: Inner,
        clocks: u8,
    }
    #[derive(Serialize)]
    struct Other {
        clocks: u8,
        name: &'static str,
        part: std::collections::BTreeMap<&'static str, f64>,
    }
    let part = Inner { volts: f64::INFINITY, on: true };
    let one = canonical(&One { name: "lab \"2\"", part, clocks: 9 });
    assert_eq!(one, "clocks = 9\nname = 'lab \"2\"'\npart.on = true\npart.volts = inf\n");
    let part = [("volts", 0.1)].into();
    let other = canonical(&Other { clocks: 9, name: "lab", part });
    assert_eq!(other, "clocks = 9\nname = \"lab\"\npart.volts = 0.1\n");
}

#[test]
fn one_edge_in_a_file_is_rise_and_fall() {
    let camera = CameraModel::parse("[leds]\nedge_ns = 12").unwrap();
    assert_eq!((camera.leds.rise_ns, camera.leds.fall_ns), (12.0, 12.0));
    // Slow LEDs that rise and fall alike are exact, however short the pattern.
    CameraModel::parse("[leds]\nedge_ns = 60").unwrap();
    assert_eq!(CameraModel::parse(&camera.to_toml()).unwrap(), camera);
    let basis = CameraModel::parse("basis = \"fga015\"\n[leds]\nedge_ns = 9.5").unwrap();
    assert_eq!((basis.leds.rise_ns, basis.leds.fall_ns), (9.5, 9.5));
}

#[test]
fn a_description_has_the_name_that_it_had_before_rise_and_fall_could_differ() {
    let text = |toml: &str| CameraModel::parse(toml).unwrap().key_text();
    let of_leds = |toml: &str| -> Vec<String> {
        text(toml).lines().filter(|line| line.starts_with("leds.")).map(str::to_owned).collect()
    };
    let before = of_leds("");
    assert_eq!(before.len(), 8, "{before:#?}");
    assert_eq!(before[1], "leds.edge_ns = 15.0");
    for (toml, more) in [
        ("fall_ns = 16", "leds.fall_ns = 16.0"),
        ("turn_on_delay_ns = 1", "leds.turn_on_delay_ns = 1.0"),
        ("tile_sag = 0.01", "leds.tile_sag = 0.01"),
        ("line_crosstalk_ff = 1", "leds.line_swing_v = 3.3"),
    ] {
        let found = of_leds(&format!("[leds]\n{toml}"));
        assert!(found.len() > 8 && found.iter().any(|line| line == more), "{found:#?}");
    }
}

#[test]
fn a_line_injects_capacitance_times_swing() {
    let camera = CameraModel::parse("[leds]\nline_crosstalk_ff = 1").unwrap();
    // 1 fF of 3.3 V is 3.3 fC.
    assert!((camera.chain_settings().line_electrons - 20_597.0).abs() < 1.0);
    assert_eq!(CameraModel::default().chain_settings().line_electrons, 0.0);
}

/// The short name is part of the names of trained networks: another compiler or a renamed field must
/// not change it without anybody noticing.
#[test]
fn the_short_name_of_a_description_is_frozen() {
    assert_eq!(format!("{:08x}", CameraModel::paper().digest()), "f4ce53d7");
}
