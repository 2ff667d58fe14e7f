//! `nirspi serve` below a path, and under the names of a reverse proxy.

use crate::bench::Bench;
use crate::serve::{Server, serve};
use std::io::{BufRead, BufReader, Write};

const TOKEN: &str = "a-token-for-the-tests";

/// A server below `/lab/camera1` that is also `cam.lab`, and what it said of who can open the page.
fn proxied(bench: &Bench) -> (Server, String) {
    let more =
        ["--base-path", "/lab/camera1/", "--allow-host", "cam.lab", "--allow-host", "192.0.2.9"];
    let mut server = serve(bench, &[&more[..], &["--token", TOKEN]].concat());
    assert_eq!(server.query, format!("token={TOKEN}"));
    let (address, path) = server.address.split_once('/').unwrap();
    assert_eq!(path, "lab/camera1");
    server.address = address.to_owned();
    let notice = server.process.says("every machine that reaches cam.lab");
    (server, notice)
}

#[test]
fn everything_is_below_the_base_path_and_nothing_else_is() {
    let bench = Bench::new();
    let (server, _) = proxied(&bench);
    let header = format!("Authorization: Bearer {TOKEN}");
    let ask = |method: &str, path: &str| server.ask(method, path, &[&header], "");
    for path in ["/", "/page/main.js", "/page/style.css", "/api/state"] {
        let path = format!("/lab/camera1{path}");
        let answer = ask("GET", &path);
        assert_ne!(answer.status, 404, "{path}");
        let refused = server.get(&path);
        refused.refuses(401, "needs its token");
    }
    for path in ["/", "/lab/", "/lab/camera12/", "/page/main.js", "/api/state", "/lab/camera1/none"]
    {
        ask("GET", path)
            .refuses(404, "everything is below /lab/camera1, there expected /, /events");
    }
    // A stop has no limit of changes below the path, too, and a scene has its own length.
    for _ in 0..150 {
        assert_eq!(ask("POST", "/lab/camera1/api/stop").status, 200);
    }
    let scene = format!(r#"{{"weather": "none"{}}}"#, " ".repeat(8000));
    let asked = server.ask("POST", "/lab/camera1/api/scene", &[&header], &scene);
    assert_eq!(asked.status, 200, "{asked:?}");
    // Without the last '/', the page's own addresses would be wrong.
    for (path, place) in [("/lab/camera1", "./camera1/"), ("/lab/camera1/", "./")] {
        let first = server.get(&format!("{path}?token={TOKEN}"));
        let head = first.head.to_lowercase();
        assert_eq!(first.status, 303, "{first:?}");
        assert!(head.contains(&format!("location: {place}\r\n")), "{head}");
        assert!(head.contains("; path=/lab/camera1; httponly; samesite=strict"), "{head}");
    }
    assert!(ask("GET", "/lab/camera1").head.to_lowercase().contains("location: ./camera1/\r\n"));
}

#[test]
fn a_name_that_is_allowed_demands_a_token_and_may_come_by_https() {
    let bench = Bench::new();
    let (server, notice) = proxied(&bench);
    assert!(notice.contains("there write cam.lab instead of 127.0.0.1:"), "{notice}");
    let header = format!("Authorization: Bearer {TOKEN}");
    let ask = |method: &str, headers: &[&str]| {
        let path = "/lab/camera1/api/start";
        server.ask(method, path, &[headers, &[&header]].concat(), "").status
    };
    for host in ["cam.lab", "CAM.lab:8443", "192.0.2.9"] {
        for scheme in ["http", "https"] {
            let headers = [format!("Host: {host}"), format!("Origin: {scheme}://{host}")];
            assert_eq!(ask("POST", &[&headers[0], &headers[1]]), 200, "{headers:?}");
        }
    }
    assert_eq!(ask("POST", &["Host: other.lab"]), 403);
    assert_eq!(ask("POST", &["Host: cam.lab", "Origin: https://evil.example"]), 403);
    assert_eq!(ask("POST", &["Host: cam.lab", "Origin: https://cam.lab:81"]), 403);
    // The server's own addresses come without https.
    let own = [format!("Host: {}", server.address), format!("Origin: https://{}", server.address)];
    assert_eq!(ask("POST", &[&own[0], &own[1]]), 403);
    // A proxy hands each state on at once.
    for path in ["/api/next", "/events"] {
        let mut stream = server.connect();
        let host = &server.address;
        write!(stream, "GET /lab/camera1{path} HTTP/1.1\r\nHost: {host}\r\n{header}\r\n\r\n")
            .unwrap();
        let lines = BufReader::new(stream).lines().map(Result::unwrap);
        let head: Vec<String> = lines.take_while(|line| !line.is_empty()).collect();
        let is_told = head.iter().any(|line| line.eq_ignore_ascii_case("x-accel-buffering: no"));
        assert!(is_told, "{path}: {head:?}");
    }

    // Without a token of the user's, a name makes one.
    let named = serve(&bench, &["--allow-host", "cam.lab"]);
    assert!(named.query.starts_with("token=") && named.query.len() > 22, "{}", named.query);
    named.get("/").refuses(401, "needs its token");
    // A path alone lets no other machine in.
    assert_eq!(serve(&bench, &["--base-path", "/camera1"]).query, "");
}

#[test]
fn a_path_or_a_name_that_cannot_be_served_is_said_in_one_line() {
    let bench = Bench::new();
    for path in ["camera1", "/a b", "/a/../b", "//", "", "/a?b"] {
        let words = ["--base-path", "expected a path as /camera1"];
        bench.run(&["serve", "--base-path", path]).failed(2, &words);
    }
    for name in ["https://cam.lab", "cam.lab:8080", "*.lab", "", "cam lab"] {
        let words = ["--allow-host", "expected the name or the IP address"];
        bench.run(&["serve", "--allow-host", name]).failed(2, &words);
    }
}
