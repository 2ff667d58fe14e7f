//! Figures of the user's pages that follow from constants and models of the code. A test finds each figure by its sentence on the
//! page, and compares the figure, to its last digit, with what the code holds or computes. Figures that commands print are
//! compared in `host/cli/tests/cli/figures.rs`.

#![expect(clippy::unwrap_used, reason = "what a test cannot set up, it cannot pass")]

use nirspi_eval::assumptions::weights;
use nirspi_eval::camera_model::{AtDistance, camera_model};
use nirspi_eval::rain::rain;
use nirspi_mcu::{BOARD_WATCHDOG_US, CLOCK_CHECK, Limits, flashes};
use nirspi_optics::CameraModel;
use nirspi_optics::rain::Drops;
use nirspi_optics::safety::{EyeSafety, WAVELENGTHS_NM};
use nirspi_optics::water::Water;
use nirspi_tests::figures::{constant, figures, numbers, says, says_about};
use nirspi_tests::pages::page;
use nirspi_wire::message::HOST_SILENCE_US;
use nirspi_wire::ready::MAX_NARROW_SAMPLES;
use nirspi_wire::register::{self, Register, clocks};
use nirspi_wire::{ADC_HZ, ADC_MAX, CLOCKS_PER_PATTERN, Fault, PATTERN_HZ, PATTERNS, SIDE};

#[test]
fn limits_of_the_live_page_are_those_of_its_server() {
    let page = "docs/live-page-network.md";
    let of = |file: &str, name: &str| constant(&format!("host/serve/src/{file}.rs"), name);
    let connections = |name: &str| of("connections", name);
    says(
        page,
        "| open connections: all clients, one client | {}, {} |",
        &[connections("MOST"), connections("MOST_OF_CLIENT")],
    );
    says(
        page,
        "| open event streams: all clients, one client | {}, {} |",
        &[connections("STREAMS"), connections("STREAMS_OF_CLIENT")],
    );
    says(
        page,
        "| a connection to which nothing can be written | closed after {} s |",
        &[connections("SILENT")],
    );
    let bodies = [of("http", "MAX_SCENE_BYTES") / 1024.0, of("http", "MAX_CHANGE_BYTES") / 1024.0];
    says(page, "of a scene, of any other request | {} KiB, {} KiB |", &bodies);
    let (burst, rate) = (of("change_rate", "BURST"), of("change_rate", "PER_SECOND"));
    says(
        page,
        "(every `POST` except `/api/stop`) | {} at once, then {} a second |",
        &[burst, rate],
    );
    says("docs/security.md", "one client has {} changes a second and {} at once", &[rate, burst]);
    says(page, "makes a random token of {} bits", &[8.0 * of("token", "RANDOM")]);
    says(page, "has another `number`, or after {} s.", &[of("http", "PATIENCE")]);
    let drawing = of("stage", "SHOWN_PX");
    says(page, "and `drawing`, the {} x {} grey levels of", &[drawing; 2]);
}

#[test]
fn times_and_sizes_of_the_live_page_are_those_of_its_scripts() {
    let page = "docs/live-page.md";
    let of = |file: &str, name: &str| constant(&format!("host/serve/src/page/{file}.js"), name);
    let silent = of("connection", "SILENT_MS") / 1e3;
    says(page, "A state that is older than {} s counts as unknown", &[silent]);
    says(page, "**The last {} images** of this page", &[of("history", "MOST")]);
    says(page, "which the browser scales to {} x {} grey levels", &[of("scene", "SIDE"); 2]);
    let answer = constant("host/camera/src/session.rs", "ANSWER_TIMEOUT");
    says(page, "If a camera does not confirm within {} s,", &[answer]);
    says("docs/browser.md", "A damaged command gets no answer; after {} s the program", &[answer]);
    let silence_s = HOST_SILENCE_US as f64 / 1e6;
    says(page, "the camera switches its LEDs off {} s after the last command", &[silence_s]);
    says("docs/browser.md", "one byte in {} is damaged", &[1.0 / of("line", "HELD")]);
    let dropped = constant("host/serve/src/line.rs", "DROPPED");
    says(
        "docs/browser.md",
        "{} of {} damaged bytes have one wrong bit",
        &[(1.0 - dropped) / dropped, 1.0 / dropped],
    );
    let tick = constant("host/serve/src/rest.rs", "TICK");
    says("docs/architecture.md", "that the camera's thread reads {} times a second", &[1.0 / tick]);
    let busy = 100.0 * constant("host/serve/src/overload.rs", "BUSY");
    says("docs/glossary.md", "Above {} %, the page shows fewer images", &[busy]);
}

#[test]
fn sizes_and_times_of_recordings_and_feeds_are_those_of_the_code() {
    let of = |file: &str, name: &str| constant(&format!("host/record/src/{file}.rs"), name);
    const MIB: f64 = 1024.0 * 1024.0;
    let page = "docs/recordings.md";
    says(page, "file in chunks of about {} MiB", &[of("recording/book", "CHUNK") / MIB]);
    let telemetry = 1e9 / of("recording/monitor", "EVERY_NS");
    says(page, "Protocol Buffers | {} times a second", &[telemetry]);
    let images = 1e6 / constant("host/src/export/mcap.rs", "IMAGE_US");
    says(page, "at most {} images for each second of the camera's time", &[images]);
    let means = constant("host/src/export/video.rs", "MOST");
    says(page, "or of {} means of neighbouring frames", &[means]);
    let copies = constant("host/src/imaging/enhance.rs", "SPREAD_COPIES");
    says(page, "(standard deviation of {} simulated repetitions)", &[copies]);
    let flushed = 1.0 / of("recording/writer", "FLUSH_EVERY");
    let synced = of("recording/file", "SYNC_EVERY");
    says(
        "docs/invariants.md",
        "A recording is flushed {} a second and synced every {} seconds",
        &[flushed, synced],
    );
    says("docs/glossary.md", "A recording writes to the disk {} a second", &[flushed]);
    let queue = of("recording/spool", "QUEUE") * of("recording/spool", "BUFFER") / MIB;
    says("docs/glossary.md", "Share of the recording's queue, {} MiB,", &[queue]);
    let junk = of("capture/junk", "ALLOWED") / MIB;
    says("docs/security.md", "when the recording has {} MiB more of them", &[junk]);
    let lines = constant("host/camera/src/session.rs", "MOST");
    says("docs/security.md", "| {} lines are kept |", &[lines]);
    let header = constant("host/feed/src/stream.rs", "MAX_HEADER_BYTES") / MIB;
    says("docs/feeds.md", "or with one of more than {} MiB", &[header]);
    let chosen = constant("host/serve/src/picture.rs", "CHOSEN_EVERY");
    says("docs/feeds.md", "are chosen again after every {} pictures", &[chosen]);
    let after = constant("host/files/src/text/export.rs", "MOST_AFTER");
    says("docs/measurements.md", "lines before its table and up to {} after it", &[after]);
}

#[test]
fn sizes_of_figures_are_those_of_the_code() {
    let page = "docs/results.md";
    let look = "host/picture/src/look.rs";
    let of = |style: &str| numbers(look, &format!("Self::{style} => light("), ")");
    let (paper, column, slide) = (of("Paper"), of("Column"), of("Slide"));
    says(
        page,
        "| white | {} mm, both columns of a page; a single image {} mm | {} points | {} dpi |",
        &paper,
    );
    says(
        page,
        "| `column` | white | {} mm | {} points | {} dpi |",
        &[column[0], column[2], column[3]],
    );
    says(page, "| `slide` | white | {} mm | {} points | {} dpi |", &[slide[0], slide[2], slide[3]]);
    let screen = numbers(look, "..light(", ")");
    let pixels = screen[0] / 25.4 * screen[3];
    says(
        page,
        "| `screen` | dark | {} pixels | {} points | {} dpi |",
        &[pixels, screen[2], screen[3]],
    );
    let percentiles = numbers("host/picture/src/scale.rs", "PERCENTILES: [f64; 2] = [", "]");
    says(page, "The percentiles {} and {} of the image's pixels", &percentiles);
    let sheet = |name: &str| constant("host/picture/src/sheet.rs", name);
    says(page, "Of more than {} images, the sheet shows {}, evenly chosen", &[sheet("MOST"); 2]);
    let (rate, most) = (
        constant("host/picture/src/video.rs", "RATE_HZ"),
        constant("host/picture/src/video.rs", "MOST"),
    );
    says(page, "a video of {} frames a second", &[rate]);
    says(page, "of up to {} frames, evenly chosen", &[sheet("MOST_BESIDE")]);
    says(page, "makes a video of up to {} frames", &[most]);
}

#[test]
fn limits_of_computing_are_those_of_the_code() {
    let gpu = constant("host/omp/src/gpu/choice.rs", "FRAMES_WORTH_A_GPU");
    says("docs/gpu.md", "For a stack of {} images or more,", &[gpu]);
    says("docs/gpu.md", "always takes a GPU for {} frames or more", &[gpu]);
    let tried = constant("host/own/src/lib.rs", "TRIED");
    says("docs/own-patterns.md", "A matrix of more than {} weights", &[tried]);
    // Weights of n x n patterns of n x n pixels, as float64.
    let largest = (constant("host/files/src/plain.rs", "MAX_MEMORY_BYTES") / 8.0).powf(0.25);
    says_about("docs/own-patterns.md", "The largest image has about {} x ", largest, 0.02);
    let contradicted = constant("host/nets/src/consistency.rs", "CONTRADICTED");
    for page in ["docs/networks.md", "docs/how-it-works.md"] {
        says(page, "Above {}, the picture has the warning", &[contradicted]);
    }
    let noise = constant("host/src/imaging/warning.rs", "TRAINED_NOISE");
    says("docs/how-it-works.md", "the noise of a pixel is over {} % of white", &[100.0 * noise]);
    let guessed = constant("host/nets/src/interval.rs", "PRIORS_HALF_WIDTH");
    says("docs/networks.md", "A half-width of at least {} of white", &[guessed]);
    let deepest = constant("host/optics/src/rain/blur.rs", "DEEPEST");
    says("docs/rain.md", "it refuses an optical depth above {}.", &[deepest]);
    let letter = constant("host/src/scene.rs", "LETTER_SIDE_MM");
    says("docs/first-picture.md", "looks at a letter R, {} mm high,", &[letter]);
    says("docs/paper.md", "the letters are {} mm, so they could not", &[letter]);
}

#[test]
fn defaults_of_training_and_of_clusters_are_those_of_the_package() {
    let page = "docs/training.md";
    let of = |name: &str| constant("host/python/python/nirspi/train/settings.py", name);
    says(page, "A share of the groups of each file, `--held-out` ({}),", &[of("held_out")]);
    says(page, "written every `--judge-every` steps ({})", &[of("judge_every")]);
    says(page, "a line of JSON every `--log-every` steps ({})", &[of("log_every")]);
    says(page, "Training ends when `--patience` ({}) scores", &[of("patience")]);
    says(page, "number of held-out examples in a score ({})", &[of("judged")]);
    let ray = "host/python/python/nirspi/ray.py";
    says("docs/clusters.md", "(`batch=`, {} items by default)", &[constant(ray, "batch")]);
    says("docs/clusters.md", "that does not answer within {} s", &[constant(ray, "_ANSWER_S")]);
}

#[test]
fn the_timing_of_patterns_is_that_of_the_wire_protocol() {
    let paper = CameraModel::paper();
    let patterns = f64::from(PATTERNS);
    let pattern_us = 1e6 / f64::from(PATTERN_HZ);
    let clocks = f64::from(CLOCKS_PER_PATTERN);
    let page = "docs/inside.md";
    says(
        page,
        "A sweep of {} patterns and complements takes {} microseconds",
        &[patterns, 2.0 * patterns * pattern_us],
    );
    says(page, "The FPGA runs on the ADC's clock of {} MHz", &[f64::from(ADC_HZ) / 1e6]);
    says(page, "A pattern takes {} clocks and its complement {} more", &[clocks; 2]);
    says(
        page,
        "samples of the complement. {} of {} samples are left out",
        &[paper.readout.blanked.into(), clocks],
    );
    says(page, "The FPGA has {} memory banks", &[(register::WAITING_FRAMES + 1) as f64]);
    says(page, "Sums of up to {} ADC samples are sent in 24 bits", &[MAX_NARROW_SAMPLES.into()]);
    let page = "docs/how-it-works.md";
    says(page, "The next pattern follows, {} ns later", &[1e3 * pattern_us]);
    says(page, "takes {} million samples a second", &[f64::from(ADC_HZ) / 1e6]);
    says(
        page,
        "So {} lines are enough to show any Hadamard pattern on {} LEDs",
        &[2.0 * f64::from(SIDE), patterns],
    );
    says(page, "{} patterns for {} pixels", &[patterns; 2]);
    let sweeps = f64::from(paper.readout.sweeps_per_picture);
    let picture_ms = sweeps * 2.0 * patterns * pattern_us / 1e3;
    says("docs/paper.md", "sums sweeps: {} are {} ms", &[sweeps, picture_ms]);
    says("docs/build-the-camera.md", "A new pattern can come every {} ns", &[1e3 * pattern_us]);
}

#[test]
fn limits_that_keep_leds_dark_are_those_of_firmware_and_gateware() {
    let page = "docs/safety.md";
    let limits = Limits::REFERENCE;
    let watchdog_s = f64::from(limits.watchdog_clocks) / f64::from(ADC_HZ);
    let silence_s = limits.host_silence.0 as f64 / 1e6;
    says(
        page,
        "| watchdog, {} ms without an access | independent watchdog, {} s,",
        &[1e3 * watchdog_s, f64::from(BOARD_WATCHDOG_US) / 1e6],
    );
    says(page, "| the host is silent | - | LEDs off after {} s |", &[silence_s]);
    says(page, "| the host reads nothing | - | LEDs off, session ended after {} s |", &[silence_s]);
    let celsius = |hundredths: i16| f64::from(hundredths) / 100.0;
    says(
        page,
        "| the array is over {} °C, or its sensor is broken | - | LEDs off until {} °C,",
        &[celsius(limits.trip_centi_celsius), celsius(limits.release_centi_celsius)],
    );
    let duty = f64::from(limits.duty_permille_max) / 10.0;
    says(page, "| more than {} % of the array lit over a duty window", &[duty]);
    let off_ms = (CLOCK_CHECK.0 + limits.running_check.0) as f64 / 1e3;
    says(
        page,
        "| the ADC's clock is over {} % off | - | LEDs off within {} ms, fault |",
        &[clocks::TOLERANCE_PERCENT.into(), off_ms],
    );
    let tries = |field: &str| numbers("mcu/src/enables.rs", field, ",")[0];
    let shown_ms = 2.0 * tries("dwell: ") * tries("sweeps: ") / f64::from(ADC_HZ) * 1e3;
    says(page, "it shows all LEDs on and off, three times for {} ms", &[shown_ms]);
    says(page, "Below {} nm light reaches the retina", &[*WAVELENGTHS_NM.start()]);
    says(
        "docs/troubleshooting.md",
        "the host sent no command for {} s while LEDs were on",
        &[silence_s],
    );
    says(
        "docs/troubleshooting.md",
        "or differs from {} MHz by more than {} %",
        &[f64::from(ADC_HZ) / 1e6, clocks::TOLERANCE_PERCENT.into()],
    );
}

#[test]
fn what_bring_up_expects_is_what_registers_and_lamps_say() {
    let page = "docs/bring-up.md";
    says(page, "| `Identity` (0x00) | {} |", &[register::IDENTITY.into()]);
    says(page, "| `Version` (0x01) | {} (", &[Register::Version.reset().into()]);
    let units = register::BRING_UP_HZ / clocks::UNIT_HZ;
    let word = clocks::LOCKED | clocks::ALIVE | clocks::READY | units;
    says(
        page,
        "| `Clocks` (0x06) | {}: bits 16 to 18 set, {} units of {} kHz, within {} % |",
        &[
            word.into(),
            units.into(),
            f64::from(clocks::UNIT_HZ) / 1e3,
            clocks::TOLERANCE_PERCENT.into(),
        ],
    );
    says(
        page,
        "holds each bit as 0 and as 1 | {}: the ADC's domain has no clock",
        &[register::NO_CLOCK.into()],
    );
    let latency = constant("host/virtual/src/fpga.rs", "LOOPBACK_CLOCKS");
    says(
        page,
        "latency {} clocks, {} lines follow their patterns",
        &[latency, 2.0 * f64::from(SIDE)],
    );
    let narrowest = constant("host/camera/src/selftest/mod.rs", "MIN_SAMPLING_WINDOW_NS");
    says(page, "and fails below {} ns", &[narrowest]);
    let limits = Limits::REFERENCE;
    says(
        page,
        "| stop the host program with `kill -STOP` | low after {} s |",
        &[limits.host_silence.0 as f64 / 1e6],
    );
    says(
        page,
        "low after {} s (FPGA's watchdog)",
        &[f64::from(limits.watchdog_clocks) / f64::from(ADC_HZ)],
    );
    says(page, "or the level is near 0 or {} counts", &[f64::from(ADC_MAX) + 1.0]);
    says(
        page,
        "with the interlock open: {} flash, then a pause; without the thermistor: {};",
        &[flashes(Fault::Interlock).into(), flashes(Fault::TemperatureSensor).into()],
    );
}

fn seen(name: &str, distance_m: f64) -> AtDistance {
    let report = camera_model(&CameraModel::named(name).unwrap()).unwrap();
    *report.distances.iter().find(|at| at.distance_m == distance_m).unwrap()
}

#[test]
fn what_the_cameras_see_is_what_their_descriptions_give() {
    let page = "docs/light.md";
    let paper = [0.3, 0.6, 1.0].map(|m| seen("paper", m));
    let ours = seen("one-metre", 1.0);
    let snr = paper.map(|at| at.picture_snr);
    says(page, "| signal-to-noise ratio of a white pixel | {} | {} | {} |", &snr);
    says(page, "| SNR of a white pixel at 1 m | {} | {} |", &[snr[2], ours.picture_snr]);
    assert_eq!(ours.line_mm, Some(ours.pixel_mm), "{page}: the pixel");
    let camera = |name: &str| CameraModel::named(name).unwrap();
    let (a, b) = (camera("paper"), camera("one-metre"));
    let both =
        |sentence: &str, of: fn(&CameraModel) -> f64| says(page, sentence, &[of(&a), of(&b)]);
    both("| focus | {} m | {} m |", |camera| camera.projector().focus_distance_mm / 1e3);
    both("| LED pitch | {} mm | {} mm, bare chips |", |camera| camera.projector().led_pitch_mm);
    both("| projection lens | {} mm | {} mm |", |camera| camera.projector().aperture_mm);
    both("| detector | {} mm | {} mm |", |camera| camera.detector.diameter_mm);
    both("| pattern | {} ns | {} ns |", |camera| {
        f64::from(camera.readout.clocks_per_pattern) / f64::from(ADC_HZ) * 1e9
    });
    both("| picture | {} ms | {} ms |", |camera| camera_model(camera).unwrap().picture_ms);
    let light = [&a, &b].map(|camera| EyeSafety::of(camera).unwrap());
    says(
        page,
        "| light at the lens, limit {} W/m^2 | {} W/m^2 | {} W/m^2 |",
        &[light[0].limit_w_per_m2, light[0].at_lens_w_per_m2, light[1].at_lens_w_per_m2],
    );
    // The exposure that a pixel needs grows as the fourth power.
    let times = (1.0_f64 / 0.3).powi(4);
    says("docs/paper.md", "needs (1 / 0.3)^4 = {} times the exposure", &[times]);

    let changed = |what: &str| {
        let all = weights().unwrap();
        all.into_iter().find(|weight| weight.assumption.what == what).unwrap().snr
    };
    says(page, "| assumed | instead | SNR then, in place of {} |", &[snr[0]]);
    for (row, what) in [
        ("a data sheet's diode and a circuit that can be bought | {} |", "diode and amplifier"),
        ("| half angle of an LED, 5 degrees | 10 degrees | {} |", "half angle of an LED"),
        ("| 4 mW from an LED | 2 mW | {} |", "light of an LED"),
        ("| 15 klx of daylight | full sun, 100 klx | {} |", "daylight"),
    ] {
        says(page, row, &[changed(what)]);
    }

    let page = "docs/build-the-camera.md";
    says(page, "| {} at 0.3 m, {} at 1 m | {} at 1 m |", &[snr[0], snr[2], ours.picture_snr]);
    says(
        page,
        "focused at 0.3 m: the array is {} mm behind the lens",
        &[a.projector().array_distance_mm()],
    );
    says(
        page,
        "focused at 1 m: the array is {} mm behind the lens",
        &[b.projector().array_distance_mm()],
    );
    says(
        page,
        "| amplifier | {} MHz, {} kilohm (assumed) | {} MHz, {} kilohm |",
        &[
            a.amplifier.bandwidth_mhz,
            a.amplifier.feedback_kohm,
            b.amplifier.bandwidth_mhz,
            b.amplifier.feedback_kohm,
        ],
    );
    says(
        page,
        "LEDs | {} of 1550 nm, {} mW each (assumed), edges of {} ns (assumed)",
        &[f64::from(PATTERNS), a.leds.power_mw, a.leds.rise_ns],
    );
}

#[test]
fn what_rain_takes_away_is_what_mie_scattering_gives() {
    let page = "docs/rain.md";
    let lost = |drops: &Drops, nm: f64, m: f64| {
        let report = rain("", drops, &[nm], m, false).unwrap();
        100.0 * report.wavelengths[0].loss_there_and_back
    };
    let light = Drops::monodisperse(1.93, 0.5).unwrap();
    let heavy = Drops::monodisperse(5.6, 2.0).unwrap();
    let rows = [
        ("| light, 1.93 mm/h | all 0.5 mm | {} % |", &light),
        ("| heavy, 5.6 mm/h | all 2 mm | {} % |", &heavy),
        (
            "| natural, 5.6 mm/h | Marshall and Palmer | {} % |",
            &Drops::marshall_palmer(5.6).unwrap(),
        ),
        (
            "| natural, 50 mm/h | Marshall and Palmer | {} % |",
            &Drops::marshall_palmer(50.0).unwrap(),
        ),
        ("| fog, 0.1 g/m^3 | 10 um | {} % |", &Drops::fog(10.0, 0.1).unwrap()),
    ];
    for (row, drops) in rows {
        says(page, row, &[lost(drops, 1550.0, 1.0)]);
    }
    let times = lost(&light, 1550.0, 1.0) / lost(&heavy, 1550.0, 1.0);
    says_about(page, "takes away {} times as much light", times, 0.11);
    let page = "docs/paper.md";
    let heavy_2_m = lost(&heavy, 1550.0, 2.0);
    says(page, "the heavy rain takes away {} % of the light over 2 m and back", &[heavy_2_m]);
    let absorption = |nm: f64| Water::Segelstein.absorption_per_cm(nm).unwrap();
    let times = absorption(1550.0) / absorption(850.0);
    says_about(page, "absorption is some {} times larger than at 850 nm", times, 0.1);
    says_about(page, "a 2 mm drop is {} wavelengths of green light wide", 2e6 / 550.0, 0.02);
    let floor_m2 = 1.2 * 0.6;
    says(page, "over 1.2 x 0.6 m is {} mm/h;", &[1.0 / floor_m2]);
    says(page, "5.6 mm/h take {} and {} L/h", &[1.93 * floor_m2, 5.6 * floor_m2]);
}

/// The cells of the log's row that begins so, in the first table below this text.
#[track_caller]
fn row_of_log(path: &str, below: &str, beginning: &str) -> Vec<String> {
    let text = page(path);
    let Some((_, rest)) = text.split_once(below) else { panic!("{path} has no {below:?}") };
    let row = rest.lines().find(|line| line.starts_with(beginning));
    let row = row.unwrap_or_else(|| panic!("{path} has no row {beginning:?} below {below:?}"));
    row.trim_matches('|').split('|').map(|cell| cell.trim().replace("**", "")).collect()
}

/// The first number of a cell.
#[track_caller]
fn first(cell: &str) -> f64 {
    cell.split([' ', '/', ','])
        .next()
        .unwrap()
        .parse()
        .unwrap_or_else(|_| panic!("no number: {cell}"))
}

/// A cell of a table of docs/log/physics.md, in which the rows of an image at 0.3 m, 0.6 m and 1 m follow one another.
#[track_caller]
fn in_table(below: &str, image: &str, distance: &str, column: usize) -> f64 {
    let log = page("docs/log/physics.md");
    let (_, table) = log.split_once(below).unwrap();
    let nearest = format!("| {image} | 0.3 m |");
    let rows = table.lines().skip_while(|line| !line.starts_with(&nearest));
    let row = rows.take(3).find(|line| line.contains(&format!("| {distance} |"))).unwrap();
    first(row.trim_matches('|').split('|').nth(column).unwrap().trim())
}

/// A study takes minutes or data of other groups. The log has its table, to more digits than the user's page.
#[test]
fn figures_of_studies_are_those_of_the_log() {
    let page = "docs/reconstruction.md";
    let methods = ["hadamard", "omp", "tikhonov", "tv", "prior"];
    let below = "| noise 2 %, PSNR in dB / SSIM |";
    let log =
        |method: &str| row_of_log("docs/log/reconstruction.md", below, &format!("| `{method}` |"));
    for (share, column) in [(5, 1), (10, 2), (20, 3), (50, 5)] {
        let right = methods.map(|method| first(&log(method)[column]));
        says(
            page,
            &format!("| {share} % | {{}} dB | {{}} dB | {{}} dB | {{}} dB | {{}} dB |"),
            &right,
        );
    }

    let page = "docs/videos.md";
    for (row, of_log) in [
        ("still letter", "| still letter |"),
        ("letter that moves by 1 pixel a frame", "| 1 px |"),
        ("letter that turns by 10 degrees a frame", "| 10 degrees |"),
    ] {
        let cells = row_of_log("docs/log/reconstruction.md", "### What the past adds", of_log);
        let right: Vec<f64> = [&cells[1], &cells[4]]
            .into_iter()
            .flat_map(|cell| cell.split(" / ").map(first))
            .collect();
        says(page, &format!("| {row} | {{}} / {{}} | {{}} / {{}} |"), &right);
    }

    let physics =
        |image: &str, distance: &str| in_table("# 12. Tables 3 and 4", image, distance, 2);
    let gains = ["0.3 m", "0.6 m"].map(|m| [physics("NIR-SPI", m), physics("with diffusion", m)]);
    says(
        "docs/light.md",
        "before and after the networks | {}, {} dB | {}, {} dB |",
        gains.as_flattened(),
    );
    let finest = ["0.3 m", "0.6 m", "1 m"].map(|m| in_table("| Table 4, mm |", "NIR-SPI", m, 6));
    says(
        "docs/light.md",
        "| finest line that keeps a tenth of its contrast | {} mm | {} mm | {} mm |",
        &finest,
    );
    let ours = seen("one-metre", 1.0);
    says(
        "docs/light.md",
        "| finest line at 1 m | {} mm | {} mm, the pixel |",
        &[finest[2], ours.line_mm.unwrap()],
    );
    let [near, far] = gains.map(|[before, after]| after - before);
    says(
        "docs/networks.md",
        "gain {} dB at 0.3 m, where the lens is focused, {} dB at 0.6 m",
        &[near, far],
    );
    let at_1_m = physics("with diffusion", "1 m") - physics("NIR-SPI", "1 m");
    assert!(
        at_1_m.abs() < 0.5,
        "docs/networks.md says nothing is gained at 1 m, the log {at_1_m} dB"
    );

    let lost = figures("docs/log/physics.md", "NIR-SPI loses {} dB at 0.3 m (")[0].1;
    says("docs/rain.md", "covered, a letter at 0.3 m loses {} dB", &[lost]);
    let log = "docs/log/live-page.md";
    let off_s = figures(log, "the page said \"off\" for {} s at most while")[0].1;
    says(
        "docs/live-page.md",
        "the page said \"off\" for at most {} s while LEDs were on",
        &[off_s],
    );
    let feed = |row: &str| row_of_log("docs/log/performance.md", "### Feeds", row)[2].clone();
    let binary = feed("| `capture --camera feed:ADDR`, `f32` | 200 million");
    let slowest = first(binary.strip_prefix("all recorded, ").unwrap());
    let sentence = "The program records {} million binary numbers a second";
    says_about("docs/feeds.md", sentence, slowest, 0.02);
    let text = feed("| the same, text |");
    let text = first(text.strip_prefix("all recorded, ").unwrap());
    says("docs/feeds.md", "or {} million numbers as text, without loss", &[text]);

    let cells =
        row_of_log("docs/log/quality.md", "Share of the pixels whose truth", "| hadamard |");
    let coverage: Vec<f64> = cells[1].split(" / ").map(first).collect();
    says(
        "docs/networks.md",
        "in about {} % of the pixels, and in about {} % of the pixels at edges",
        &coverage,
    );
}

/// `.ci/run electronics` compares the tables of that page with its circuits.
#[test]
fn figures_of_circuits_are_those_of_their_page() {
    let circuit = |row: &str| {
        first(&row_of_log("boards/electronics/README.md", "\n| ", &format!("| {row} |"))[1])
    };
    let page = "docs/build-the-camera.md";
    let half_lit = circuit("LEDs' supply, half lit");
    says(page, "With half of the array lit, the simulated circuit takes {} W", &[half_lit]);
    let unbuffered = circuit("row line at the last gate, without buffers");
    says(page, "to 32 gates are as long as a pattern, {} ns", &[unbuffered]);
    let buffered = circuit("row line at the last gate, buffered");
    says(page, "for every eight gates shortens the edges to {} ns", &[buffered]);
}

#[test]
fn counts_of_files_and_lines_are_those_of_the_repository() {
    let lines = |path: &str| page(path).lines().count() as f64;
    says(
        "docs/training.md",
        "such a network, in {} lines",
        &[lines("host/nets/examples/own_network.rs")],
    );
    let own_method = lines("host/recon/examples/own_method.rs");
    let (shown, most, _) = figures("docs/library.md", "does in less than {} lines")[0].clone();
    assert!(
        own_method < most,
        "docs/library.md says less than {shown}, the example has {own_method}"
    );
    let files = std::fs::read_dir(nirspi_tests::root().join("docs/notebooks")).unwrap();
    let is_notebook =
        |entry: &std::fs::DirEntry| entry.path().extension().is_some_and(|end| end == "ipynb");
    let notebooks = files.filter(|entry| is_notebook(entry.as_ref().unwrap())).count() as f64;
    says("README.md", "and its {} [notebooks]", &[notebooks]);
}
