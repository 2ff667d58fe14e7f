use super::*;
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
