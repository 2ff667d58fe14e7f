//! `nirspi serve --camera feed:ADDR`: the live page of a bench that is no camera of nirspi.

use crate::bench::{Bench, Measured};
use crate::feed::{as_text, header, image_of_file};
use crate::serve::serve;
use nirspi::files::npy;
use serde_json::Value;
use std::fs::OpenOptions;
use std::io::Write;

#[test]
fn the_page_shows_a_feed_without_leds_and_says_for_how_long_nothing_came() {
    let bench = Bench::new();
    let scene = Measured::new(16);
    let expected = image_of_file(&bench, &scene);
    let first = format!("{}{}", header(&scene, ",\"name\":\"DMD 3\""), as_text(&scene.y));
    bench.write("log.txt", first.as_bytes());
    std::fs::create_dir(bench.path("kept")).unwrap();
    let arguments = ["--camera", "feed:log.txt", "--method", "hadamard", "--record-to", "kept"];
    let server = serve(&bench, &arguments);
    let state = server.state("shown", |state| state["picture"]["number"] == 1);
    let (camera, picture) = (&state["camera"], &state["picture"]);
    assert_eq!((&camera["identity"], &camera["leds"]), (&().into(), &"none".into()), "{state}");
    assert_eq!((&camera["feed"]["name"], &camera["feed"]["n"]), (&"DMD 3".into(), &16.into()));
    assert_eq!((&picture["n"], &picture["unit"]), (&16.into(), &"V".into()));
    assert_eq!((&picture["frames"], &picture["enhancement"]), (&1.into(), &().into()));
    assert_eq!(
        (&state["frames"]["received"], &state["offered"]["fixed"]),
        (&1.into(), &true.into())
    );
    // The same to the bit as `reconstruct` of a file with these readings.
    bench.write("live.npy", &server.get("/image.npy").body);
    assert_eq!(bench.pixels("live.npy"), expected);
    let silent = server.state("silent", |state| state["camera"]["phase"] == "silent");
    let line = silent["camera"]["line"].as_str().unwrap();
    assert!(line.starts_with("no data for ") && line.ends_with(" s"), "{line}");
    // The patterns are the bench's, and the images are the page's to choose.
    server.change("{\"order\": \"natural\"}").refuses(400, "the patterns are those of the feed");
    assert_eq!(server.change("{\"method\": \"tikhonov\", \"record\": true}").status, 200);
    let mut log = OpenOptions::new().append(true).open(bench.path("log.txt")).unwrap();
    std::thread::sleep(std::time::Duration::from_millis(500));
    log.write_all(as_text(&scene.y).replacen('\n', "\nOOPS ", 1).as_bytes()).unwrap();
    let state = server.state("shown", |state| state["picture"]["number"] == 2);
    assert_eq!(
        (&state["picture"]["method"], &state["camera"]["phase"]),
        (&"tikhonov".into(), &"measuring".into())
    );
    assert_eq!(server.change("{\"record\": false}").status, 200);
    let recorded = server.state("recorded", |state| {
        state["events"].to_string().contains("recorded 1 frame in capture-1.npz")
    });
    assert!(recorded["events"].to_string().contains("a number was refused"), "{recorded}");
    bench
        .run(&["reconstruct", "kept/capture-1.npz", "--index", "all", "--out", "kept"])
        .succeeded();
}

#[test]
fn a_feed_that_ends_is_opened_again_and_may_have_another_side() {
    let bench = Bench::new();
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("feed:{}", listener.local_addr().unwrap());
    let (small, large) = (Measured::new(8), Measured::new(32));
    let texts = [&small, &large].map(|scene| format!("{}{}", header(scene, ""), as_text(&scene.y)));
    let sender = std::thread::spawn(move || {
        for text in texts {
            let (mut stream, _) = listener.accept().unwrap();
            // The last number of each frame is followed by one of a frame that is cut.
            stream.write_all(text.as_bytes()).unwrap();
            stream.write_all(b"1 ").unwrap();
            std::thread::sleep(std::time::Duration::from_millis(1500));
        }
    });
    let server = serve(&bench, &["--camera", &address]);
    server.state("small", |state| state["picture"]["n"] == 8);
    let state = server.state("large", |state| state["picture"]["n"] == 32);
    assert_eq!((&state["frames"]["received"], &state["frames"]["corrupt"]), (&2.into(), &1.into()));
    // Images of this side are enhanced.
    server.state("enhanced", |state| state["picture"]["enhancement"].is_object());
    let lost = server.state("lost", |state| state["camera"]["phase"] == "lost");
    assert!(lost["events"].to_string().contains("the feed ended"), "{lost}");
    sender.join().unwrap();
}

#[test]
fn own_patterns_have_the_pictures_of_a_recording() {
    let bench = Bench::new();
    let weights: Vec<f32> =
        (0..100 * 48_u32).map(|at| (at.wrapping_mul(2_654_435_761) >> 19 & 1) as f32).collect();
    let scene: Vec<f32> = (0..48).map(|at| (at % 8 + at / 8) as f32).collect();
    let see = |row: &[f32]| 7.0 + row.iter().zip(&scene).map(|(w, x)| w * x).sum::<f32>();
    let y: Vec<f32> = weights.chunks(48).map(see).collect();
    bench.write("patterns.npy", &npy::encode(&[100, 6, 8], &weights));
    bench.write("y.npy", &npy::encode(&[100], &y));
    let matrix = ["--matrix", "patterns.npy"];
    bench.run(&[&["reconstruct", "y.npy", "--out", "file"], &matrix[..]].concat()).succeeded();
    let own = "\"height\":6,\"width\":8,\"patterns\":100,\"readings\":\"single\",\"unit\":\"V\"";
    bench.write("log.txt", format!("{{{own}}}\n{}", as_text(&y)).as_bytes());
    let server = serve(&bench, &[&["--camera", "feed:log.txt"], &matrix[..]].concat());
    let state = server.state("shown", |state| state["picture"]["number"] == 1);
    // The same to the bit as `reconstruct --matrix` of a file with these readings.
    bench.write("live.npy", &server.get("/image.npy").body);
    assert_eq!(bench.pixels("live.npy"), bench.pixels("file/image.npy"));
    let (picture, feed) = (&state["picture"], &state["camera"]["feed"]);
    let size = |of: &Value| (of["height"].clone(), of["width"].clone(), of.get("n").is_none());
    assert_eq!(size(picture), (6.into(), 8.into(), true), "{state}");
    assert_eq!((size(feed), &feed["order"]), (size(picture), &"own".into()), "{state}");
    assert_eq!((&picture["unit"], &picture["enhancement"]), (&"V".into(), &().into()));
    assert_eq!(state["camera"]["leds"], "none");
    // Nothing is offered that such patterns do not have.
    let offered = &state["offered"];
    let none = Value::Array(Vec::new());
    assert_eq!((&offered["models"], &offered["with_warm_start"]), (&none, &none));
    assert!(!offered["methods"].to_string().contains("hadamard"), "{offered}");
    server
        .change("{\"method\": \"hadamard\"}")
        .refuses(400, "expected omp, pseudo-inverse, tikhonov, fista, tv or auto");
    // A frame with a reading that was not read, by another method.
    assert_eq!(server.change("{\"method\": \"pseudo-inverse\"}").status, 200);
    let mut log = OpenOptions::new().append(true).open(bench.path("log.txt")).unwrap();
    log.write_all(as_text(&y).replacen(&as_text(&y[..1]), "nan\n", 1).as_bytes()).unwrap();
    let state = server.state("shown", |state| state["picture"]["number"] == 2);
    assert_eq!(state["picture"]["method"], "pseudo-inverse", "{state}");
    let silent = server.state("silent", |state| state["camera"]["phase"] == "silent");
    assert_eq!(silent["camera"]["feed"]["account"]["not_read"], 1, "{silent}");
    assert!(silent["camera"]["line"].as_str().unwrap().starts_with("no data for "), "{silent}");
    // What does not fit is refused before anything is served.
    let refused = |more: &[&str], words: &str| {
        let first = ["serve", "--listen", "127.0.0.1:0", "--camera", "feed:log.txt", "-q"];
        bench
            .run(&[&first[..], more].concat())
            .failed(if more.len() > 2 { 2 } else { 1 }, &[words]);
    };
    refused(&[], "feed:log.txt: the feed shows 100 patterns of its own on 6 x 8 pixels");
    refused(&["--matrix", "s-matrix:31"], "expected 31 pixels for s-matrix:31");
    refused(&["--matrix", "y.npy"], "expected (M, 48) or (M, 6, 8)");
    let hadamard = ["--matrix", "patterns.npy", "--method", "hadamard"];
    refused(&hadamard, "--method hadamard needs Hadamard rows");
    refused(&["--matrix", "patterns.npy", "--warm-start"], "--warm-start");
    let camera = ["serve", "--camera", "virtual", "--matrix", "patterns.npy"];
    bench.run(&camera).failed(2, &["--matrix belongs to --camera feed:ADDR"]);
}

#[test]
fn a_page_of_a_feed_takes_no_options_of_a_camera() {
    let bench = Bench::new();
    let refused = |more: &[&str], words: &str| {
        let arguments = [&["serve", "--listen", "127.0.0.1:0", "--camera"], more].concat();
        bench.run(&arguments).failed(2, &[words]);
    };
    refused(&["feed:-", "--sampling", "0.5"], "--sampling does not go with --camera feed:ADDR");
    refused(&["feed:-", "--light", "1s"], "--light does not go with --camera feed:ADDR");
    let nobody = ["serve", "--listen", "127.0.0.1:0", "--camera", "feed:nothing", "-q"];
    bench.run(&nobody).failed(1, &["feed:nothing: no such file, pipe or socket"]);
}
