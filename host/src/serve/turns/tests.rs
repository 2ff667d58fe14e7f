use super::*;
use crate::serve::lock;
use crate::serve::overload::tests::given_up;
use serde_json::Value;

/// The page of a virtual camera without networks, whose images sum 8 frames.
fn page() -> Turns {
    let mut page = Turns::virtual_camera(1).unwrap();
    page.command("/api/settings", br#"{"enhance": false, "method": "hadamard", "frames": 8}"#)
        .unwrap();
    page
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
