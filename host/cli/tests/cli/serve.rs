//! `nirspi serve`: what a browser and a script get, and who gets nothing.

use crate::bench::{Bench, Process, correlation};
use nirspi::scene::SceneSource;
use nirspi_optics::Scene;
use nirspi_virtual::VirtualOptics;
use serde_json::Value;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::time::{Duration, Instant};

/// No answer takes longer, on a busy machine either.
pub const LIMIT: Duration = Duration::from_secs(40);

/// A server that has said where it is.
pub struct Server {
    pub process: Process,
    pub address: String,
    /// The query of the address, with the token if there is one.
    pub query: String,
}

/// What was answered.
#[derive(Debug)]
pub struct Answer {
    pub status: u16,
    pub head: String,
    pub body: Vec<u8>,
}

impl Answer {
    #[track_caller]
    pub fn json(&self) -> Value {
        assert_eq!(self.status, 200, "{self:?}");
        serde_json::from_slice(&self.body).unwrap()
    }

    /// One line, with this status and these words.
    #[track_caller]
    pub fn refuses(&self, status: u16, words: &str) {
        let text = String::from_utf8_lossy(&self.body);
        assert_eq!((self.status, text.lines().count()), (status, 1), "{text}");
        assert!(text.contains(words), "{text}");
    }
}

pub fn serve(bench: &Bench, more: &[&str]) -> Server {
    let listen = if more.contains(&"--listen") { &[][..] } else { &["--listen", "127.0.0.1:0"] };
    let mut process = bench.start(&[&["serve"], listen, more].concat());
    let line = process.says("open http://");
    let url = line.split_whitespace().find_map(|word| word.strip_prefix("http://")).unwrap();
    let (address, query) = url.split_once("/?").unwrap_or((url, ""));
    Server { address: address.to_owned(), query: query.to_owned(), process }
}

impl Server {
    pub fn connect(&self) -> TcpStream {
        let stream = TcpStream::connect(&self.address).unwrap();
        stream.set_read_timeout(Some(LIMIT)).unwrap();
        stream
    }

    /// Sends these bytes and reads to the end.
    fn raw(&self, request: &[u8]) -> Answer {
        let mut stream = self.connect();
        // A server that has refused already may have closed.
        let _ = stream.write_all(request);
        let mut answer = Vec::new();
        stream.read_to_end(&mut answer).unwrap();
        let head_end = answer.windows(4).position(|w| w == b"\r\n\r\n").unwrap_or(answer.len());
        let head = String::from_utf8_lossy(&answer[..head_end]).into_owned();
        let status = head.split(' ').nth(1).and_then(|code| code.parse().ok()).unwrap_or(0);
        Answer { status, head, body: answer.split_off((head_end + 4).min(answer.len())) }
    }

    pub fn ask(&self, method: &str, path: &str, headers: &[&str], body: &str) -> Answer {
        let mut lines = vec![format!("{method} {path} HTTP/1.1")];
        if !headers.iter().any(|header| header.starts_with("Host:")) {
            lines.push(format!("Host: {}", self.address));
        }
        lines.extend(headers.iter().map(|&header| header.to_owned()));
        lines.push(format!("Connection: close\r\nContent-Length: {}\r\n\r\n{body}", body.len()));
        self.raw(lines.join("\r\n").as_bytes())
    }

    pub fn get(&self, path: &str) -> Answer {
        self.ask("GET", path, &[], "")
    }

    pub fn change(&self, body: &str) -> Answer {
        self.ask("POST", "/api/settings", &[], body)
    }

    /// Asks for the state until it is as wanted.
    #[track_caller]
    pub fn state(&self, what: &str, mut wanted: impl FnMut(&Value) -> bool) -> Value {
        let deadline = Instant::now() + LIMIT;
        loop {
            let answer = self.get("/api/state");
            // Before the first moment there is none.
            if answer.status != 503 && wanted(&answer.json()) {
                return answer.json();
            }
            let text = String::from_utf8_lossy(&answer.body);
            assert!(Instant::now() < deadline, "not {what} within {LIMIT:?}: {text}");
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// An image as a script gets it.
    fn image(&self, bench: &Bench, path: &str) -> Vec<f32> {
        let answer = self.get(path);
        assert!(answer.head.contains("image/png"), "{answer:?}");
        bench.write("got.png", &answer.body);
        nirspi::files::image::read_grey(&bench.path("got.png")).unwrap().values
    }

    /// The moments as a browser gets them.
    pub fn browser(&self) -> impl Iterator<Item = Value> + use<> {
        let mut stream = self.connect();
        write!(stream, "GET /events HTTP/1.1\r\nHost: {}\r\n\r\n", self.address).unwrap();
        let lines = BufReader::new(stream).lines().map(Result::unwrap);
        lines.filter_map(|line| serde_json::from_str(line.strip_prefix("data: ")?).unwrap())
    }
}

pub fn shows_enhanced(state: &Value) -> bool {
    state["picture"]["enhancement"].is_object()
}

/// Every frame received is in one of the images' counters.
#[track_caller]
fn adds_up(state: &Value) {
    let images = ["shown", "passed_over", "failed", "waiting"].map(|n| state["images"][n].as_u64());
    let counted: u64 = images.iter().map(|count| count.unwrap()).sum();
    assert_eq!(Some(counted), state["frames"]["received"].as_u64(), "{state}");
}

#[test]
fn a_browser_gets_the_page_and_a_script_the_images_of_the_scene() {
    let bench = Bench::new();
    let server = serve(&bench, &[]);
    let page = server.get("/");
    let html = String::from_utf8_lossy(&page.body);
    assert!(page.head.contains("text/html") && html.contains("/page/main.js"), "{html}");
    // Every module that a module needs is there.
    let mut files = vec!["style.css".to_owned(), "main.js".to_owned()];
    let (mut scripts, mut at) = (String::new(), 0);
    while let Some(file) = files.get(at) {
        let answer = server.get(&format!("/page/{file}"));
        assert_eq!(answer.status, 200, "{file}");
        let text = String::from_utf8(answer.body).unwrap();
        let needs = text.split("from \"./").skip(1).filter_map(|rest| rest.split('"').next());
        let new: Vec<String> =
            needs.map(str::to_owned).filter(|name| !files.contains(name)).collect();
        files.extend(new);
        scripts += &text;
        at += 1;
    }
    assert!(files.len() > 8, "{files:?}");
    assert!(scripts.contains("./api/next?seen="));
    // The page works without any other network.
    assert!(!(html + scripts.as_str()).contains("://"), "something from elsewhere");
    assert!(page.head.contains("frame-ancestors 'none'"), "{}", page.head);

    let state = server.state("enhanced", shows_enhanced);
    assert_eq!(state["camera"]["simulated"], true, "{state}");
    assert_eq!(state["camera"]["identity"]["serial"], "virtual-1");
    assert_eq!(state["camera"]["measurement"]["calibrated"], true);
    assert_eq!((&state["frames"]["lost"], &state["frames"]["corrupt"]), (&0.into(), &0.into()));
    adds_up(&state);
    server.state("of as many frames as asked for", |state| state["picture"]["frames"] == 64);

    let map = "letter:R".parse::<SceneSource>().unwrap().load(256).unwrap();
    let scene = Scene::new(map.reflectance, map.size_px, map.side_mm.unwrap()).unwrap();
    let optics = VirtualOptics::new(scene, 300.0).unwrap();
    let truth = optics.focused_footprint().unwrap().weights().to_vec();
    let likeness = correlation(&server.image(&bench, "/image.png"), &truth);
    assert!(likeness > 0.9, "{likeness}");
    let likeness = correlation(&server.image(&bench, "/enhanced.png"), &optics.focused(64));
    assert!(likeness > 0.95, "{likeness}");
    // The sweeps tell the noise of the readings, and with it each pixel's interval.
    assert_eq!(interval(&server), Some(64 * 64));
}

/// Number of pixels with an interval in the next enhanced image; `None` without intervals.
#[track_caller]
pub fn interval(server: &Server) -> Option<usize> {
    let mut moments = server.browser();
    let moment = moments.find(|moment| shows_enhanced(&moment["state"])).unwrap();
    moment["interval"].as_str().map(|numbers| numbers.trim_end_matches('=').len() * 3 / 4 / 4)
}

#[test]
fn two_browsers_see_the_same_images_and_an_account_that_adds_up() {
    let bench = Bench::new();
    let server = serve(&bench, &["--method", "hadamard"]);
    server.change(r#"{"enhance": false}"#).json();
    let (mut first, mut second) = (server.browser(), server.browser());
    let number = |moment: &Value| moment["state"]["images"]["shown"].as_u64().unwrap();
    let (mut a, mut b) = (first.next().unwrap(), second.next().unwrap());
    let (mut same, mut different) = (0, std::collections::BTreeSet::new());
    while same < 10 {
        adds_up(&a["state"]);
        if number(&a) > 0 && number(&a) == number(&b) {
            assert_eq!(a["image"], b["image"]);
            assert_eq!(a["image"].as_str().unwrap().len(), 5464, "32 x 32 numbers in base64");
            different.insert(a["image"].to_string());
            same += 1;
            (a, b) = (first.next().unwrap(), second.next().unwrap());
        } else if number(&a) < number(&b) {
            let next = first.next().unwrap();
            assert!(number(&next) >= number(&a), "back in time");
            a = next;
        } else {
            b = second.next().unwrap();
        }
    }
    assert!(different.len() > 5, "noise makes each image another");
    // Each stage is later than the one before, and nothing is given up.
    let p50 = |state: &Value, stage: &str| state["delays"][stage]["p50_ms"].as_f64().unwrap_or(0.0);
    let state = server.state("sent", |state| p50(state, "sent") > 0.0);
    assert!(p50(&state, "counted") <= p50(&state, "reconstructed"), "{}", state["delays"]);
    assert_eq!(
        (&state["overload"]["show_every"], &state["overload"]["line"]),
        (&1.into(), &Value::Null)
    );
    server.state("seen by two", |state| state["viewers"] == 2);
    drop(first);
    server.state("seen by one", |state| state["viewers"] == 1);
}

#[cfg(unix)]
#[test]
fn browsers_that_never_read_hold_up_nobody_not_even_the_end() {
    let bench = Bench::new();
    let server = serve(&bench, &[]);
    let silent: Vec<TcpStream> = (0..8)
        .map(|number| {
            let mut stream = server.connect();
            // Some do not even finish asking.
            let rest = if number % 2 == 0 { "\r\n" } else { "" };
            write!(stream, "GET /events HTTP/1.1\r\nHost: {}\r\n{rest}", server.address).unwrap();
            stream
        })
        .collect();
    server.state("seen by four", |state| state["viewers"] == 4);
    let shown = |moment: &Value| moment["state"]["images"]["shown"].as_u64().unwrap();
    let mut browser = server.browser();
    let start = shown(&browser.next().unwrap());
    assert!(browser.any(|moment| shown(&moment) > start + 5));
    server.process.signal("INT");
    let said = server.process.wait().succeeded();
    assert!(said.stdout.contains("\nstopped: "), "{said:?}");
    assert!(said.stdout.contains(" shown; delay from frame to page "), "{said:?}");
    drop(silent);
}

#[test]
fn pages_switch_method_enhancement_and_number_of_frames() {
    let bench = Bench::new();
    let server = serve(&bench, &["--frames", "5"]);
    let state = server.state("enhanced", shows_enhanced);
    assert_eq!(state["settings"]["frames"], 5);
    let about = state["offered"]["about"].as_array().unwrap();
    assert!(about.iter().all(|line| line.as_str().unwrap().len() > 20), "{about:?}");
    let every = ["hadamard", "omp", "pseudo-inverse", "tikhonov", "fista", "tv", "prior", "auto"];
    assert_eq!(state["offered"]["methods"], serde_json::json!(every));
    // Without a word of the user's, the default of the library's list.
    let default = nirspi_recon::reconstruct::Method::default();
    assert_eq!(state["picture"]["method"], default.argument());
    let set = server.change(r#"{"method": "hadamard", "enhance": false, "frames": 3}"#).json();
    let expected = serde_json::json!({
        "method": "hadamard", "strength": null, "warm_start": false, "enhance": false, "model": "diffusion", "frames": 3,
        "order": "cake-cutting", "sampling": 0.5, "sweeps": 2, "record": false
    });
    assert_eq!(set, expected);
    server.state("switched", |state| {
        let picture = &state["picture"];
        picture["method"] == "hadamard"
            && picture["frames"] == 3
            && picture["enhancement"].is_null()
    });
    server.get("/enhanced.png").refuses(503, "no such image");
    server.get("/enhanced.npy").refuses(503, "no such image");
    bench.write("got.npy", &server.get("/image.npy").body);
    let counts = bench.pixels("got.npy");
    assert!(counts.len() == 1024 && counts.iter().any(|&count| count > 1.0), "{counts:?}");

    server
        .change(r#"{"method": "magic", "enhance": true}"#)
        .refuses(400, "expected hadamard, omp, ");
    server.change(r#"{"frames": 0}"#).refuses(400, "frames is 0");
    server.change(r#"{"laser": "on"}"#).refuses(400, "laser");
    server.change("\u{0}").refuses(400, "expected for example");
    server.get("/etc/passwd").refuses(404, "/api/state");
    assert_eq!(server.ask("DELETE", "/", &[], "").status, 405);
    assert_eq!(server.change(&" ".repeat(5000)).status, 413);
    assert_eq!(server.raw(b"\x16\x03\x01\x00\xee garbage\r\n\r\n").status, 400);
    // What was refused has changed nothing.
    let state = server.state("there", |_| true);
    assert_eq!(state["settings"], set);
}

#[test]
fn a_page_switches_the_leds_off_and_on_and_the_last_of_two_commands_counts() {
    let bench = Bench::new();
    let server = serve(&bench, &[]);
    let (mut first, mut second) = (server.browser(), server.browser());
    let measuring = |state: &Value| state["camera"]["phase"] == "measuring";
    server.state("measuring", measuring);
    let stopped = server.ask("POST", "/api/stop", &[], "").json();
    assert_eq!(stopped["run"], false);
    // Both pages show the camera's own word.
    let dark = |moment: &Value| {
        let (camera, light) = (&moment["state"]["camera"], &moment["state"]["light"]);
        camera["phase"] == "stopped" && camera["leds"] == "off" && light["allowed"] == false
    };
    assert!(first.any(|moment| dark(&moment)) && second.any(|moment| dark(&moment)));
    let received = server.state("there", |_| true)["frames"]["received"].clone();
    std::thread::sleep(Duration::from_millis(1500));
    let state = server.state("there", |_| true);
    assert_eq!(
        (&state["camera"]["phase"], &state["frames"]["received"]),
        (&"stopped".into(), &received)
    );

    // Commands of two pages at once, in turns.
    let commands: Vec<Value> = std::thread::scope(|scope| {
        let ask = |path: &'static str| scope.spawn(|| server.ask("POST", path, &[], "").json());
        let paths = ["/api/start", "/api/stop", "/api/start", "/api/stop", "/api/start"];
        let asked: Vec<_> = paths.into_iter().map(ask).collect();
        asked.into_iter().map(|asked| asked.join().unwrap()).collect()
    });
    let last = commands.iter().max_by_key(|answer| answer["command"].as_u64()).unwrap();
    let phase = if last["run"] == true { "measuring" } else { "stopped" };
    for browser in [&mut first, &mut second] {
        assert!(browser.any(|moment| {
            let state = &moment["state"];
            state["light"]["commands"] == last["command"]
                && state["light"]["allowed"] == last["run"]
                && state["camera"]["phase"] == phase
        }));
    }
    server.change(r#"{"run": true}"#).json();
    server.state("measuring again", |state| {
        measuring(state)
            && state["camera"]["leds"] == "on"
            && state["frames"]["received"].as_u64() > received.as_u64()
    });
}

#[test]
fn pages_of_other_sites_get_nothing_and_change_nothing() {
    let bench = Bench::new();
    let server = serve(&bench, &[]);
    let state = server.state("there", |_| true);
    let wish = r#"{"method": "hadamard"}"#;
    for path in ["/", "/events", "/api/state", "/image.png", "/enhanced.png", "/nothing"] {
        let host = ["Host: camera.evil.example"];
        server.ask("GET", path, &host, "").refuses(403, "does not go by that name");
        let origin = ["Origin: http://evil.example"];
        server.ask("GET", path, &origin, "").refuses(403, "another site");
    }
    for header in ["Host: evil.example:8080", "Origin: http://localhost:3000", "Origin: null"] {
        for path in ["/api/settings", "/api/stop", "/api/start"] {
            assert_eq!(server.ask("POST", path, &[header], wish).status, 403, "{header}");
        }
    }
    assert_eq!(server.raw(b"GET / HTTP/1.0\r\n\r\n").status, 403);
    assert_eq!(server.state("there", |_| true)["settings"], state["settings"]);
    let own = format!("Origin: http://{}", server.address);
    server.ask("POST", "/api/settings", &[&own], wish).json();
}

#[test]
fn a_camera_of_unknown_latency_shows_a_red_state_and_no_picture() {
    let bench = Bench::new();
    // A letter at 1 m is too dim to show the latency, and no calibration is kept.
    let server = serve(&bench, &["--distance-m", "1"]);
    let is_red = |state: &Value| state["camera"]["phase"] == "uncalibrated";
    let red = server.state("uncalibrated", is_red);
    let line = red["camera"]["line"].as_str().unwrap();
    assert!(line.contains("too dim") && line.contains("nirspi camera calibrate"), "{line}");
    assert!(red["picture"].is_null(), "{red}");
    server.get("/image.png").refuses(503, "no such image");
}

#[test]
fn what_cannot_be_served_is_said_in_one_line() {
    let bench = Bench::new();
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = taken.local_addr().unwrap().to_string();
    bench.run(&["serve", "--listen", &address]).failed(1, &["--listen", &address, "in use"]);
    bench.run(&["serve", "--listen", "nonsense"]).failed(1, &["--listen nonsense"]);
    let nobody = ["serve", "--listen", "127.0.0.1:0", "--camera", "tcp:127.0.0.1:1"];
    bench.run(&nobody).failed(1, &["no camera at tcp:127.0.0.1:1"]);
    let lost = ["serve", "--listen", "127.0.0.1:0", "--record-to", "nowhere"];
    bench.run(&lost).failed(1, &["--record-to nowhere", "no such folder"]);
    bench.run(&["serve", "--token", "short"]).failed(2, &["--token", "expected 16 to 128"]);
    bench.run(&["serve", "--frames", "2000"]).failed(2, &["--frames", "1024"]);
    bench.run(&["serve", "--method", "magic"]).failed(2, &["--method", "magic"]);
    let none = ["serve", "--listen", "127.0.0.1:0", "--method=omp", "--dictionary", "none.npy"];
    bench.run(&none).failed(1, &["none.npy"]);
    // The camera itself refuses.
    let late = ["--no-calibration", "--adc-latency", "200"];
    let said = bench.run(&[&["serve", "--listen", "127.0.0.1:0"], &late[..]].concat());
    said.failed(1, &["refused Configure", "the ADC latency is 200"]);
}

#[cfg(unix)]
#[test]
fn a_camera_that_goes_is_said_to_be_gone_and_looked_for_again() {
    let bench = Bench::new();
    let virtual_camera = |at: &str| {
        let mut camera = bench.start(&["dev", "virtual", "--listen", at]);
        let line = camera.says("virtual camera on tcp:");
        let address = line.split_whitespace().find_map(|word| word.strip_prefix("tcp:")).unwrap();
        (camera, address.trim_end_matches(':').to_owned())
    };
    let (mut camera, address) = virtual_camera("127.0.0.1:0");
    let server = serve(&bench, &["--camera", &format!("tcp:{address}")]);
    server.state("measuring", |state| state["camera"]["phase"] == "measuring");
    server.state("shown", |state| state["images"]["shown"].as_u64() > Some(0));
    camera.kill();
    let lost = server.state("lost", |state| state["camera"]["phase"] == "lost");
    let line = lost["camera"]["line"].as_str().unwrap();
    assert!(line.ends_with("trying again") && line.lines().count() == 1, "{line}");
    assert_eq!(server.get("/image.png").status, 200, "what was seen last can still be seen");
    let received = |state: &Value| state["frames"]["received"].as_u64().unwrap();
    let before = received(&lost);

    let (mut camera, _) = virtual_camera(&address);
    let found = server.state("found", |state| {
        state["camera"]["phase"] == "measuring" && received(state) > before + 100
    });
    adds_up(&found);
    server.process.signal("INT");
    server.process.wait().succeeded();
    camera.says("LEDs off");
}
