//! What a page, a script or any client sends to the live page's servers.

use crate::{Law, MIB, is_one_line, read, seeds};
use nirspi_recon::reconstruct::Method;
use nirspi_serve::fuzzing::{Place, Still, TOKEN};
use nirspi_serve::settings::{Change, MAX_FRAMES, MAX_SWEEPS, Offer, Settings};
use std::cell::RefCell;

pub const LAWS: &[Law] = &[
    Law {
        name: "changes",
        reads: "a change of the settings (JSON)",
        readers: &["host/serve/src/settings.rs"],
        holds: changes,
        seeds: change_seeds,
        longest: 1024,
        most_memory: 16 * MIB,
    },
    Law {
        name: "http",
        reads: "any bytes on a connection to the page, without a token and with one",
        readers: &[
            "host/serve/src/http.rs",
            "host/serve/src/access.rs",
            "host/serve/src/base_path.rs",
            "host/serve/src/guard.rs",
            "host/serve/src/token.rs",
            "host/serve/src/connections.rs",
            "host/serve/src/commands.rs",
            "host/serve/src/stage.rs",
            "host/serve/src/page.rs",
        ],
        holds: http,
        seeds: http_seeds,
        longest: 8192,
        most_memory: 64 * MIB,
    },
];

thread_local! {
    /// Kept for the run: a server per input would be most of the work.
    static STILL: RefCell<Still> = RefCell::new(Still::new(seeds::identity()));
}

/// Sends the bytes; the connection must end. The server is made before memory is counted.
fn ask(place: Place, bytes: &[u8]) -> Vec<u8> {
    let heard = STILL.with_borrow_mut(|still| still.ask(place, bytes));
    heard.unwrap_or_else(|stuck| panic!("{}", stuck.0))
}

fn are_sound(settings: &Settings) {
    assert!(Method::ALL.iter().any(|method| method.argument() == settings.method));
    assert!((1..=MAX_FRAMES).contains(&settings.frames));
    assert!((1..=MAX_SWEEPS).contains(&settings.measuring.sweeps));
    let sampling = settings.measuring.sampling;
    assert!(sampling > 0.0 && sampling <= 1.0, "{sampling}");
    assert!(settings.strength.is_none_or(|strength| strength > 0.0 && strength.is_finite()));
}

fn changes(bytes: &[u8]) {
    let base = seeds::setup();
    let offer = Offer {
        methods: Method::ALL.iter().map(|method| method.argument()).collect(),
        models: vec!["diffusion", "gan"],
        base: Some(base.clone()),
        ..Offer::default()
    };
    let Some(change) = read(Change::parse(bytes)) else { return };
    let before = Settings::new(Method::ALL[0], 8, &base);
    let Some(after) = read(before.with(&change, &offer)) else { return };
    are_sound(&after);
    let again = after.with(&change, &offer).expect("the same change");
    assert_eq!(again, after, "the same change changes something");
    let setup = after.measuring.setup(&base).expect("what was taken can be measured");
    assert!(setup.check().is_ok());
}

fn change_seeds() -> Vec<Vec<u8>> {
    let texts: [&[u8]; 4] = [
        br#"{"method":"omp","strength":0.5,"frames":10,"order":"zig-zag","sampling":0.3,"run":true}"#,
        br#"{"strength":"auto","enhance":false,"model":"gan","warm_start":true,"sweeps":4}"#,
        br#"{"record":true}"#,
        br#"{"resume":false,"order":"random(7)"}"#,
    ];
    texts.map(<[u8]>::to_vec).to_vec()
}

/// The parts of the first response: status, headers, what follows.
fn response(heard: &[u8]) -> Option<(u16, String, &[u8])> {
    let end = heard.windows(4).position(|four| four == b"\r\n\r\n")?;
    let head = std::str::from_utf8(&heard[..end]).expect("a head of plain text");
    let status = head.strip_prefix("HTTP/1.").and_then(|rest| rest.get(2..5)?.parse().ok());
    Some((status.expect("a status"), head.to_lowercase(), &heard[end + 4..]))
}

/// The first answer has our headers, and a refusal is one plain line.
fn is_plain(asked: &[u8], heard: &[u8]) {
    let Some((status, head, rest)) = response(heard) else {
        assert!(heard.is_empty(), "half an answer: {:?}", String::from_utf8_lossy(heard));
        return;
    };
    // 500 is a fault of the program.
    assert!(status != 500 && (100..=599).contains(&status), "{head}");
    // Bytes that are no HTTP request are answered by the HTTP library, without our headers.
    if !head.contains("content-security-policy") {
        assert!(matches!(status, 100 | 400 | 414 | 431), "no security headers: {head}");
        return;
    }
    for header in ["x-content-type-options: nosniff", "cache-control: no-store"] {
        assert!(head.contains(header), "{header} is missing: {head}");
    }
    let length = head.lines().find_map(|line| line.strip_prefix("content-length: ")?.parse().ok());
    let is_head = asked.starts_with(b"HEAD");
    if let (400..=599, Some(length @ 1..), false) = (status, length, is_head) {
        let body = rest.get(..length).expect("the whole refusal");
        let line = std::str::from_utf8(body).expect("words");
        is_one_line(line.strip_suffix('\n').unwrap_or(line));
    }
}

fn http(bytes: &[u8]) {
    STILL.with_borrow(|still| are_sound(&still.settings()));
    let heard = ask(Place::Page, bytes);
    is_plain(bytes, &heard);
    STILL.with_borrow(|still| {
        are_sound(&still.settings());
        let (distance_m, side, levels) = still.scene();
        assert!((0.01..=100.0).contains(&distance_m) && levels.len() == side * side);
        assert!(levels.iter().all(|level| (0.0..=1.0).contains(level)));
    });
    let at = bytes.windows(TOKEN.len()).position(|part| part == TOKEN.as_bytes());
    let heard = ask(Place::Guarded, bytes);
    is_plain(bytes, &heard);
    assert!(at.is_some() || !gets(&heard), "an answer without the token");
    // The same with a part of the token, which a search hardly cuts out.
    if let Some(at) = at {
        let kept = at + bytes.len() % TOKEN.len();
        let cut = [&bytes[..kept], &bytes[at + TOKEN.len()..]].concat();
        let knows = cut.windows(TOKEN.len()).any(|part| part == TOKEN.as_bytes());
        assert!(knows || !gets(&ask(Place::Guarded, &cut)), "an answer for a part of the token");
    }
}

/// Whether an answer gives anything but a refusal.
fn gets(heard: &[u8]) -> bool {
    [b"HTTP/1.1 2", b"HTTP/1.0 2"]
        .iter()
        .any(|status| heard.windows(10).any(|part| part == *status))
}

fn http_seeds() -> Vec<Vec<u8>> {
    let ask = |line: &str, headers: &str, body: &str| {
        format!("{line} HTTP/1.1\r\nHost: localhost\r\n{headers}\r\n{body}").into_bytes()
    };
    let post = |path: &str, body: &str| {
        ask(&format!("POST {path}"), &format!("Content-Length: {}\r\n", body.len()), body)
    };
    let token = format!("Authorization: Bearer {TOKEN}\r\n");
    let scene = r#"{"scene": "letter:A", "distance_m": 0.5, "weather": "light"}"#;
    let drawing = format!(r#"{{"scene": {{"side": 8, "levels": "{}AA=="}}}}"#, "AAAA".repeat(21));
    vec![
        ask("GET /", "", ""),
        ask("GET /api/state", &token, ""),
        ask(&format!("GET /?token={TOKEN}"), "", ""),
        ask("GET /image.png", "Cookie: a=b; nirspi-80=x\r\n", ""),
        ask("GET /enhanced.npy", "Origin: http://localhost\r\nSec-Fetch-Site: same-origin\r\n", ""),
        ask("GET /events", "", ""),
        post("/api/settings", r#"{"method":"omp","frames":3}"#),
        post("/api/settings", "{\"a\\nb\":1}"),
        post("/api/scene", scene),
        post("/api/scene", &drawing),
        post("/api/stop", ""),
        [post("/api/start", ""), ask("HEAD /none", "Connection: close\r\n", "")].concat(),
        ask("POST /api/settings", "Transfer-Encoding: chunked\r\n", "2\r\n{}\r\n0\r\n\r\n"),
        ask("OPTIONS *", "Expect: 100-continue\r\n", ""),
    ]
}
