//! `nirspi serve`: what the page changes while the camera runs.

use crate::bench::{Bench, correlation};
use crate::serve::{interval, serve};
use nirspi::recording::{Recording, tally_recording};
use serde_json::{Value, json};

/// The bytes in base64. Their number is padded to a multiple of 3 by zeros that the text leaves out.
fn base64(bytes: &[u8]) -> String {
    const SIGNS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let group = |three: &[u8]| {
        let at = |n: usize| u32::from(three.get(n).copied().unwrap_or(0));
        let bits = at(0) << 16 | at(1) << 8 | at(2);
        let sign = |n: usize| SIGNS[(bits >> (18 - 6 * n) & 63) as usize] as char;
        (0..4).map(|n| if n > three.len() { '=' } else { sign(n) }).collect::<String>()
    };
    bytes.chunks(3).map(group).collect()
}

fn measuring(state: &Value) -> bool {
    state["camera"]["phase"] == "measuring"
}

#[test]
fn a_page_changes_order_sampling_sweeps_strength_and_network_while_the_camera_runs() {
    let bench = Bench::new();
    let server = serve(&bench, &["--method", "tikhonov"]);
    let state = server.state("measuring", measuring);
    let offered = &state["offered"];
    let orders = offered["orders"].as_array().unwrap();
    assert!(
        orders.iter().any(|order| order["name"] == "zig-zag" && order["about"].as_str().is_some())
    );
    assert!(offered["with_strength"].as_array().unwrap().contains(&json!("tv")), "{offered}");
    assert_eq!(offered["records"], false);

    let set = server
        .change(r#"{"order": "zig-zag", "sampling": 0.25, "sweeps": 4, "strength": 3}"#)
        .json();
    assert_eq!((&set["order"], &set["sampling"]), (&json!("zig-zag"), &json!(0.25)));
    let state = server.state("measured so", |state| {
        let run = &state["camera"]["measurement"];
        measuring(state)
            && run["order"] == "zig-zag"
            && run["patterns"] == 256
            && run["sweeps"] == 4
    });
    // The calibration of the first run holds.
    assert_eq!(state["camera"]["measurement"]["calibrated"], true);
    let before = state["images"]["shown"].as_u64();
    let state = server.state("shown so", |state| state["images"]["shown"].as_u64() > before);
    assert_eq!(state["settings"]["strength"], 3.0);
    assert!(state["problem"].is_null(), "{state}");
    // Intervals are calibrated for the strength that the method chooses.
    assert_eq!(interval(&server), None);

    let models = state["offered"]["models"].as_array().unwrap().clone();
    assert!(models.contains(&json!("diffusion")), "{models:?}");
    if models.contains(&json!("gan")) {
        server.change(r#"{"model": "gan"}"#).json();
        server.state("deblurred so", |state| state["picture"]["enhancement"]["model"] == "gan");
    }
    server
        .change(r#"{"order": "sideways"}"#)
        .refuses(400, "order is \"sideways\", expected natural");
    server.change(r#"{"record": true}"#).refuses(400, "--record-to");
    // Nothing was lost on the way.
    let state = server.state("there", |_| true);
    assert_eq!((&state["frames"]["lost"], &state["frames"]["corrupt"]), (&json!(0), &json!(0)));
}

#[test]
fn a_page_records_into_the_folder_of_the_command_line_under_names_of_the_program() {
    let bench = Bench::new();
    std::fs::create_dir(bench.path("kept")).unwrap();
    let server = serve(&bench, &["--record-to", "kept", "--method", "hadamard"]);
    server.change(r#"{"enhance": false}"#).json();
    server.state("measuring", measuring);
    let recorded = |state: &Value| {
        let events = state["events"].as_array().unwrap();
        events
            .iter()
            .filter(|event| event["text"].as_str().unwrap().starts_with("recorded "))
            .count()
    };
    for number in 1..=2 {
        server.change(r#"{"record": true}"#).json();
        let before = server.state("there", |_| true)["frames"]["received"].as_u64().unwrap();
        server.state("recorded", |state| {
            state["frames"]["received"].as_u64().unwrap() > before + 500
        });
        if number == 1 {
            server.change(r#"{"record": false}"#).json();
        } else {
            // A stop ends the recording, and a start begins no other.
            server.ask("POST", "/api/stop", &[], "").json();
        }
        server.state("ended", |state| {
            recorded(state) == number && state["settings"]["record"] == false
        });
    }
    server.ask("POST", "/api/start", &[], "").json();
    server.state("measuring", measuring);
    let mut names: Vec<String> = std::fs::read_dir(bench.path("kept"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    assert_eq!(names, ["capture-1.mcap", "capture-2.mcap"]);
    assert_eq!(bench.names(), ["kept"], "nothing outside the folder");
    for name in names {
        let mut recording = Recording::open(&bench.path("kept").join(name)).unwrap();
        let tally = tally_recording(&mut recording).unwrap();
        assert!(tally.account().counters().received > 100);
        assert!(tally.account().counters().is_complete());
    }
    // A field with a name is refused: the program chooses the name.
    server.change(r#"{"record": "../../x.mcap"}"#).refuses(400, "expected");
}

#[test]
fn a_page_draws_the_scene_of_a_virtual_camera_and_moves_it() {
    let bench = Bench::new();
    let server = serve(&bench, &["--method", "tikhonov"]);
    server.change(r#"{"enhance": false, "frames": 256}"#).json();
    let state = server.state("measuring", measuring);
    assert_eq!(state["scene"]["name"], "letter R");

    // The left half is bright.
    let side = 32;
    let half: Vec<u8> =
        (0..side * side).map(|at| if at % side < side / 2 { 255 } else { 0 }).collect();
    let levels = base64(&half);
    let drawing =
        json!({"scene": {"side": side, "levels": levels}, "distance_m": 0.35}).to_string();
    server.ask("POST", "/api/scene", &[], &drawing).json();
    server.state("drawn", |state| {
        let (scene, frames) = (&state["scene"], state["picture"]["frames"].as_u64());
        measuring(state)
            && scene["name"] == "drawing"
            && scene["distance_m"] == 0.35
            && frames == Some(256)
    });
    let shown = server.state("there", |_| true)["images"]["shown"].as_u64();
    server.state("of the drawing alone", |state| {
        state["images"]["shown"].as_u64() > shown.map(|n| n + 20)
    });
    bench.write("got.npy", &server.get("/image.npy").body);
    let truth: Vec<f32> = half.iter().map(|&level| f32::from(level)).collect();
    let likeness = correlation(&bench.pixels("got.npy"), &truth);
    assert!(likeness > 0.9, "{likeness}");

    server.ask("POST", "/api/scene", &[], r#"{"weather": "fog:5m"}"#).json();
    server.state("in fog", |state| measuring(state) && state["scene"]["weather"] == "fog:5m");
    // What the optics refuse is said, and the scene before stays.
    server.ask("POST", "/api/scene", &[], r#"{"distance_m": 99}"#).json();
    let state = server.state("refused", |state| state["scene"]["problem"].is_string());
    assert_eq!(state["scene"]["distance_m"], 0.35);
    server.state("measuring", measuring);
    let refuses =
        |body: &str, words| server.ask("POST", "/api/scene", &[], body).refuses(400, words);
    refuses(r#"{"scene": "/etc/passwd"}"#, "expected letter:R");
    refuses(r#"{"weather": "/etc/passwd"}"#, "weather");
    refuses("[", "expected for example");
    // A stopped camera stays dark before another scene.
    server.ask("POST", "/api/stop", &[], "").json();
    server.ask("POST", "/api/scene", &[], r#"{"scene": "letter:A"}"#).json();
    let state = server.state("before another scene", |state| state["scene"]["name"] == "letter A");
    let state = if state["camera"]["phase"] == "stopped" {
        state
    } else {
        server.state("dark", |state| state["camera"]["phase"] == "stopped")
    };
    assert_eq!(state["camera"]["leds"], "off");
}

#[test]
fn the_scene_of_a_real_camera_cannot_be_changed() {
    let bench = Bench::new();
    let mut camera = bench.start(&["dev", "virtual", "--listen", "127.0.0.1:0"]);
    let line = camera.says("virtual camera on tcp:");
    let address = line.split_whitespace().find_map(|word| word.strip_prefix("tcp:")).unwrap();
    let server = serve(&bench, &["--camera", &format!("tcp:{}", address.trim_end_matches(':'))]);
    assert!(server.state("there", |_| true)["scene"].is_null());
    let answer = server.ask("POST", "/api/scene", &[], r#"{"scene": "letter:A"}"#);
    answer.refuses(400, "only a virtual camera");
}

#[test]
fn images_that_start_from_those_before_are_switched_on_by_an_option_and_off_by_the_page() {
    let bench = Bench::new();
    let server = serve(&bench, &["--method", "tikhonov", "--warm-start", "--frames", "8"]);
    let state = server.state("recursive", |state| state["picture"]["past"].is_string());
    let past = state["picture"]["past"].as_str().unwrap();
    assert!(past.contains("patterns known, scene moved by"), "{past}");
    assert_eq!(state["picture"]["frames"], 8);
    assert_eq!(
        state["offered"]["with_warm_start"],
        json!(["tikhonov", "fista", "tv", "prior", "auto"])
    );
    server.change(r#"{"warm_start": false}"#).json();
    server.state("alone", |state| state["picture"]["past"].is_null());
    server.change(r#"{"warm_start": "yes"}"#).refuses(400, "expected a boolean");
    let start = ["serve", "--listen", "127.0.0.1:0", "--warm-start"];
    for (method, words) in [
        (&["--method", "omp"][..], "--warm-start: omp makes each image by itself"),
        (
            &["--method", "tikhonov", "--basis", "haar"],
            "--warm-start: frames that start from the frame before need the dct",
        ),
    ] {
        bench.run(&[&start[..], method].concat()).failed(2, &[words]);
    }
}

#[test]
fn a_change_while_the_camera_is_prepared_holds_for_the_first_run() {
    let bench = Bench::new();
    let server = serve(&bench, &["--method", "hadamard"]);
    for order in ["natural", "zig-zag"] {
        server.change(&json!({ "order": order }).to_string()).json();
    }
    let state = server.state("measuring", measuring);
    assert_eq!(state["camera"]["measurement"]["order"], "zig-zag");
}
