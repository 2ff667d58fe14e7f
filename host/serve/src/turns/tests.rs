use super::*;
use crate::camera::Connected;
use crate::lock;
use crate::look::{Measured, Seen};
use crate::overload::tests::given_up;
use data_encoding::BASE64;
use nirspi::capture::Calibration;
use nirspi::scene::SceneSource;
use nirspi::session::Session;
use nirspi::setup::MeasurementSetup;
use nirspi_optics::{CameraModel, Motion};
use nirspi_recon::reconstruct::{Method, MethodSettings};
use nirspi_recon::{Measurements, Order};
use nirspi_virtual::{MemoryLink, VirtualOptics, calibrate_against_white};
use serde_json::Value;

/// The page of a virtual camera without networks, whose images sum 8 frames.
fn page() -> Turns {
    let mut page = Turns::virtual_camera(1).unwrap();
    page.command("/api/settings", br#"{"enhance": false, "method": "hadamard", "frames": 8}"#)
        .unwrap();
    page
}

/// What was measured by Hadamard patterns, and its warnings.
fn of_rows(measured: Measured) -> (Measurements, Vec<String>) {
    match measured {
        Measured::Hadamard { measurements, warnings } => (measurements, warnings),
        Measured::Own(_) => panic!("a camera"),
    }
}

fn state(page: &mut Turns, turns: usize) -> Value {
    for _ in 1..turns {
        page.turn();
    }
    let message: Value = serde_json::from_str(page.turn()).unwrap();
    message["state"].clone()
}

fn count(state: &Value, name: &str) -> u64 {
    state["frames"][name].as_u64().unwrap()
}

#[test]
fn only_a_person_starts_a_stopped_camera_again() {
    let mut page = page();
    let measuring = state(&mut page, 3);
    assert_eq!(measuring["camera"]["phase"], "measuring");
    assert_eq!((count(&measuring, "received"), count(&measuring, "lost")), (3 * FRAMES, 0));
    page.command("/api/stop", b"").unwrap();
    let stopped = state(&mut page, 3);
    assert_eq!(stopped["camera"]["phase"], "stopped");
    assert_eq!(
        (&stopped["camera"]["leds"], &stopped["light"]["allowed"]),
        (&"off".into(), &false.into())
    );
    let still = state(&mut page, 3);
    assert_eq!(stopped["frames"], still["frames"]);
    page.command("/api/start", b"").unwrap();
    let again = state(&mut page, 2);
    assert_eq!(again["camera"]["phase"], "measuring");
    assert!(count(&again, "received") > count(&stopped, "received"));
}

#[test]
fn an_overloaded_page_leaves_enhancement_out_and_says_so() {
    let mut page = Turns::virtual_camera(1).unwrap();
    page.command("/api/settings", br#"{"method": "hadamard", "frames": 8}"#).unwrap();
    let all = state(&mut page, 1);
    assert!(all["picture"]["enhancement"].is_object() && all["overload"]["line"].is_null());
    *lock(&page.shared.overload) = given_up(4);
    let less = state(&mut page, 1);
    assert!(less["picture"]["enhancement"].is_null(), "{}", less["picture"]);
    assert_eq!(
        (&less["overload"]["show_every"], &less["settings"]["enhance"]),
        (&8.into(), &true.into())
    );
    let line = less["overload"]["line"].as_str().unwrap();
    assert!(line.starts_with("the page shows every 8th image and enhancement is off"), "{line}");
    assert_eq!(count(&less, "received"), 2 * FRAMES);
    *lock(&page.shared.overload) = given_up(3);
    assert!(state(&mut page, 1)["picture"]["enhancement"].is_object());
}

#[test]
fn each_stage_says_how_long_its_frames_took() {
    let mut page = page();
    let after = state(&mut page, 3);
    let delays = &after["delays"];
    assert_eq!(delays["counted"]["count"], 3 * FRAMES);
    assert_eq!(delays["reconstructed"]["count"], 3);
    // Nothing was enhanced, and there is no server that sends.
    assert!(delays["enhanced"].is_null() && delays["sent"].is_null(), "{delays}");
    let p50 = |stage: &str| delays[stage]["p50_ms"].as_f64().unwrap();
    assert!(p50("reconstructed") > p50("counted"), "{delays}");
}

/// Takes turns of a page; returns the message of each new image, with what the image was made of.
fn watched(page: &mut Turns, turns: usize) -> Vec<(Value, Measurements)> {
    let shown = |page: &Turns| page.shared.slot.ledger().images.shown;
    let mut made = Vec::new();
    for _ in 0..turns {
        page.camera();
        let Some(look) = page.shared.slot.take_now() else { continue };
        let before = shown(page);
        page.studio.make(&page.shared, &look);
        let published = lock(&page.studio.told()).state(&page.shared).unwrap();
        if shown(page) > before {
            let message = serde_json::from_str(&published.message).unwrap();
            made.push((message, of_rows(look.measured(true).unwrap()).0));
        }
    }
    made
}

/// Whether each new image of these turns starts from the images before.
fn warm(page: &mut Turns, turns: usize) -> Vec<bool> {
    let made = watched(page, turns);
    made.iter().map(|(message, _)| message["state"]["picture"]["past"].is_string()).collect()
}

/// Compares images of a page with those of the recorded video of the same frames.
#[track_caller]
fn are_those_of_a_video(method: Method, made: &[(Value, Measurements)]) {
    let network = Some(nirspi_nets::prior::shipped());
    let settings = MethodSettings { network, ..MethodSettings::default() };
    let frames: Vec<Measurements> = made.iter().map(|(_, frames)| frames.clone()).collect();
    let video = method.prepare(&settings).unwrap().reconstruct_video(&frames).unwrap();
    for (at, ((message, _), frame)) in made.iter().zip(&video).enumerate() {
        let pixels = frame.image.pixels().iter().flat_map(|pixel| pixel.to_le_bytes());
        let sent = BASE64.encode(&pixels.collect::<Vec<u8>>());
        assert_eq!(message["image"], sent, "{method}, image {at}");
        let past = &message["state"]["picture"]["past"];
        assert_eq!(past.is_string(), frame.report.warm, "{method}, image {at}: {past}");
    }
    assert!(!video[0].report.warm && video[4].report.warm, "{method}");
}

#[test]
fn images_that_start_from_those_before_are_those_of_a_recorded_video() {
    for method in [Method::TIKHONOV, Method::PRIOR] {
        let mut page = page();
        let wanted = format!(r#"{{"method": "{}", "warm_start": true}}"#, method.argument());
        page.command("/api/settings", wanted.as_bytes()).unwrap();
        let made = watched(&mut page, 5);
        assert!(made.len() == 5 && made[3].1 != made[4].1);
        are_those_of_a_video(method, &made);
    }
}

#[test]
fn another_run_method_strength_or_sum_begins_a_new_estimate() {
    let mut page = page();
    page.command("/api/settings", br#"{"method": "tikhonov", "warm_start": true}"#).unwrap();
    assert_eq!(warm(&mut page, 3), [false, true, true]);
    for (path, change) in [
        ("/api/settings", r#"{"order": "zig-zag"}"#),
        ("/api/settings", r#"{"sampling": 0.3}"#),
        ("/api/settings", r#"{"sweeps": 9}"#),
        ("/api/settings", r#"{"strength": 2}"#),
        ("/api/settings", r#"{"method": "tv"}"#),
        ("/api/settings", r#"{"frames": 4}"#),
        ("/api/scene", r#"{"scene": "letter:K"}"#),
        ("/api/stop", ""),
    ] {
        page.command(path, change.as_bytes()).unwrap();
        let mut made = warm(&mut page, 2);
        page.command("/api/start", b"").unwrap();
        made.extend(warm(&mut page, 5));
        let begun = made.iter().filter(|warm| !**warm).count();
        assert_eq!((begun, made.last()), (1, Some(&true)), "{change}: {made:?}");
    }
    // A setting of a later stage does not end the estimate.
    page.command("/api/settings", br#"{"model": "gan"}"#).unwrap();
    assert_eq!(warm(&mut page, 2), [true, true]);
    page.command("/api/settings", br#"{"warm_start": false}"#).unwrap();
    assert_eq!(warm(&mut page, 2), [false, false]);
}

#[test]
fn a_method_that_makes_each_image_by_itself_shows_the_newest_frames_as_before() {
    let mut page = page();
    let wanted = br#"{"method": "hadamard", "warm_start": true, "frames": 16}"#;
    page.command("/api/settings", wanted).unwrap();
    let made = watched(&mut page, 4);
    assert_eq!(made.len(), 4, "an image in each turn, though a turn has half of the frames");
    for (message, _) in &made {
        let picture = &message["state"]["picture"];
        assert_eq!((&picture["method"], picture["past"].is_null()), (&"hadamard".into(), true));
    }
    page.command("/api/settings", br#"{"method": "tikhonov"}"#).unwrap();
    assert_eq!(warm(&mut page, 4), [false, true]);
}

/// A page of a letter that crosses the field at half a metre a second: a pixel in each frame.
fn page_of_a_moving_letter() -> Turns {
    let model = CameraModel::paper().clone();
    let map = "letter:R".parse::<SceneSource>().unwrap().load(256).unwrap();
    let optics = VirtualOptics::before(&model, &map, 300.0).unwrap();
    let motion = Motion { speed_m_per_s: 0.5, ..Motion::default() };
    let optics = optics.moving(motion).unwrap();
    let setup = optics.setup(&Order::ZigZag, 1.0).unwrap();
    let settling = calibrate_against_white(&optics, 1).unwrap();
    let connect = move |_: Option<&_>| {
        let session = Session::open(Box::new(MemoryLink::new(optics.camera(1)?)))?;
        let calibration = Calibration::Kept(settling.clone());
        Ok(Connected { session, calibration, note: None, flat_field: None })
    };
    let source = CameraSource {
        address: "virtual".to_owned(),
        setup: MeasurementSetup { sweeps: 36, ..setup },
        model,
        scene: None,
        record_to: None,
        connect: Box::new(connect),
    };
    let mut page = Turns::with_every_method(source, None).unwrap();
    page.command("/api/settings", br#"{"enhance": false, "method": "tikhonov", "frames": 16}"#)
        .unwrap();
    page
}

/// Judged by the newest frame alone, whose noise is small beside the smear of 16 frames.
#[test]
fn an_image_of_a_moving_target_stands_where_its_newest_frame_does() {
    let mut page = page_of_a_moving_letter();
    for _ in 0..3 {
        page.camera();
    }
    let look = page.shared.slot.take_now().unwrap();
    let Seen::Camera { frames, run, .. } = &look.seen else { panic!("a camera") };
    let (_, newest) = frames.sum().newest().last().unwrap();
    let newest = newest.measurements(&run.setup, run.settling.as_ref(), false).unwrap();
    let off = |remembers: bool| {
        let (measurements, warnings) = of_rows(look.measured(remembers).unwrap());
        let pairs = measurements.values().iter().zip(newest.values());
        (pairs.map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt(), warnings)
    };
    let ((along, said), (smeared, warned)) = (off(false), off(true));
    assert!(along < 0.4 * smeared, "{along} and {smeared}");
    assert!(said.iter().any(|said| said.contains("added along its way")), "{said:?}");
    assert!(warned.iter().any(|said| said.contains("smeared")), "{warned:?}");
    page.studio.make(&page.shared, &look);
    let published = lock(&page.studio.told()).state(&page.shared).unwrap();
    assert!(published.message.contains("added along its way"), "{}", published.message);
}

#[test]
fn a_frame_is_in_one_image_of_an_estimate_only() {
    let mut page = page();
    let wanted = br#"{"method": "tikhonov", "warm_start": true, "frames": 16}"#;
    page.command("/api/settings", wanted).unwrap();
    // The sum of 16 frames is whole in the second turn: the first image is made alone.
    let numbers: Vec<u64> =
        (0..8).map(|_| state(&mut page, 1)["picture"]["number"].as_u64().unwrap()).collect();
    assert_eq!(numbers, [1, 2, 2, 3, 3, 4, 4, 5]);
    let images = &state(&mut page, 1)["images"];
    let count = |name: &str| images[name].as_u64().unwrap();
    assert_eq!((count("shown"), count("waiting"), count("failed")), (5, 0, 0));
    assert_eq!(count("passed_over"), 9 * FRAMES - 5);
}

#[test]
fn an_estimate_goes_on_after_lost_frames_and_takes_no_frame_twice() {
    let mut page = page();
    let wanted = br#"{"method": "tikhonov", "warm_start": true, "frames": 12}"#;
    page.command("/api/settings", wanted).unwrap();
    let mut made = watched(&mut page, 2);
    page.command("/api/line", br#"{"damage": 0.0005}"#).unwrap();
    made.extend(watched(&mut page, 16));
    page.command("/api/line", br#"{"damage": 0}"#).unwrap();
    made.extend(watched(&mut page, 4));
    let state = &made.last().unwrap().0["state"];
    let missed = count(state, "lost") + count(state, "corrupt");
    assert!(missed > 12 && state["problem"].is_null(), "{}", state["frames"]);
    // The first image is made alone: the sum of 12 frames is whole in the second turn.
    are_those_of_a_video(Method::TIKHONOV, &made[1..]);
    let received: Vec<u64> =
        made[1..].iter().map(|(message, _)| count(&message["state"], "received")).collect();
    assert!(received.len() > 4, "{received:?}");
    assert!(received.windows(2).all(|pair| pair[1] >= pair[0] + 12), "{received:?}");
}

#[test]
fn a_shaken_line_loses_frames_and_every_one_is_counted() {
    let mut page = page();
    assert_eq!(count(&state(&mut page, 1), "received"), FRAMES);
    page.command("/api/line", br#"{"damage": 0.0005}"#).unwrap();
    let shaken = state(&mut page, 12);
    let (line, missed) = (&shaken["line"], count(&shaken, "lost") + count(&shaken, "corrupt"));
    assert!(line["flipped"].as_u64() > Some(5) && line["dropped"].as_u64() > Some(0), "{line}");
    assert!(missed > 5 && count(&shaken, "received") > 20, "{}", shaken["frames"]);
    page.command("/api/line", br#"{"damage": 0}"#).unwrap();
    let steady = state(&mut page, 2);
    let after = state(&mut page, 5);
    let misses = |state| count(state, "lost") + count(state, "corrupt");
    assert_eq!(misses(&steady), misses(&after));
    assert_eq!(count(&after, "received") - count(&steady, "received"), 5 * FRAMES);
}

#[test]
fn another_scene_order_and_share_are_what_the_next_images_show() {
    let mut page = page();
    let letter = state(&mut page, 4)["picture"]["white_counts"].as_f64().unwrap();
    page.command("/api/scene", br#"{"scene": "white", "distance_m": 0.5}"#).unwrap();
    page.command("/api/settings", br#"{"order": "zig-zag", "sampling": 0.25}"#).unwrap();
    let after = state(&mut page, 6);
    assert_eq!(after["scene"]["name"], "white");
    let measurement = &after["camera"]["measurement"];
    assert_eq!((&measurement["order"], &measurement["patterns"]), (&"zig-zag".into(), &256.into()));
    assert_ne!(after["picture"]["white_counts"].as_f64().unwrap(), letter);
    page.command("/api/scene", br#"{"distance_m": 90}"#).unwrap();
    let refused = state(&mut page, 6);
    assert!(refused["scene"]["problem"].is_string(), "{}", refused["scene"]);
    assert_eq!(refused["camera"]["phase"], "measuring");
}

#[test]
fn commands_that_cannot_be_are_refused_in_one_line() {
    let mut page = page();
    for (path, body, words) in [
        ("/api/settings", r#"{"sweeps": 0}"#, "sweeps is 0"),
        ("/api/scene", r#"{"scene": "/etc/passwd"}"#, "expected letter:R"),
        ("/api/line", r#"{"damage": 2}"#, "damage is 2"),
        ("/api/reboot", "", "there is no command /api/reboot, expected"),
    ] {
        let line = page.command(path, body.as_bytes()).unwrap_err();
        assert!(line.contains(words) && line.lines().count() == 1, "{line}");
    }
}
