//! `nirspi serve`: clients without the token, and clients that misbehave.

use crate::bench::Bench;
use crate::serve::{LIMIT, serve};
use serde_json::Value;
use std::io::{Read, Write};
use std::net::TcpStream;

const TOKEN: &str = "a-token-for-the-tests";

#[test]
fn a_client_in_the_network_gets_nothing_without_the_token() {
    let bench = Bench::new();
    let mut server = serve(&bench, &["--listen", "0.0.0.0:0"]);
    let notice = server.process.says("every machine in this network");
    assert!(notice.contains("token"), "{notice}");
    let token = server.query.strip_prefix("token=").unwrap().to_owned();
    assert!(token.len() >= 22, "{token}");

    let paths =
        ["/", "/page/main.js", "/events", "/api/state", "/image.png", "/image.npy", "/none"];
    for path in paths {
        server.get(path).refuses(401, "needs its token");
        server.get(&format!("{path}?token={}x", &token[1..])).refuses(401, "needs its token");
    }
    for path in ["/api/settings", "/api/scene", "/api/stop", "/api/start"] {
        server.ask("POST", path, &[], "{}").refuses(401, "needs its token");
    }
    // The token as header, query and cookie.
    let port = server.address.rsplit(':').next().unwrap();
    let header = format!("Authorization: Bearer {token}");
    let cookie = format!("Cookie: a=b; nirspi-{port}={token}");
    let ask = |headers: &[&str], path: &str| server.ask("GET", path, headers, "");
    assert_eq!(ask(&[&header], "/page/main.js").status, 200);
    assert_eq!(ask(&[&cookie], "/page/main.js").status, 200);
    assert_eq!(ask(&[], &format!("/page/main.js?token={token}")).status, 200);
    assert_eq!(server.ask("POST", "/api/stop", &[&header], "").status, 200);
    // The printed address gives a browser the cookie, and an address without the token.
    let first = ask(&[], &format!("/?token={token}"));
    assert_eq!(first.status, 303, "{first:?}");
    let head = first.head.to_lowercase();
    assert!(
        head.contains("location: ./\r\n") && head.contains("httponly; samesite=strict"),
        "{head}"
    );
    // The token does not open the door for pages of other sites.
    let foreign = ["Host: camera.evil.example", header.as_str()];
    ask(&foreign, "/").refuses(403, "by that name");
    let foreign = ["Origin: http://evil.example", cookie.as_str()];
    assert_eq!(server.ask("POST", "/api/start", &foreign, "").status, 403);
    assert_eq!(ask(&["Host: 192.0.2.7", &header], "/").status, 200);
}

#[test]
fn a_token_is_read_from_a_file_and_is_neither_saved_nor_shown() {
    let bench = Bench::new();
    bench.write("token.txt", format!("{TOKEN}\r\n").as_bytes());
    let server = serve(&bench, &["--token-file", "token.txt"]);
    assert_eq!(server.query, format!("token={TOKEN}"));
    bench.write("token.txt", b"short");
    let told = ["--token-file token.txt", "a token of 5 characters, expected 16 to 128"];
    bench.run(&["serve", "--token-file", "token.txt"]).failed(1, &told);

    bench.write("lab.toml", format!("[serve]\ntoken = \"{TOKEN}\"\n").as_bytes());
    let more = ["--settings", "lab.toml", "--save-settings", "new.toml", "--verbose"];
    let server = serve(&bench, &more);
    assert_eq!(server.query, format!("token={TOKEN}"));
    server.process.signal("INT");
    let outcome = server.process.wait();
    let saved = std::fs::read_to_string(bench.path("new.toml")).unwrap();
    assert!(saved.contains("[serve]") && !saved.contains(TOKEN), "{saved}");
    let told = outcome.stderr.lines().filter(|line| line.contains("token"));
    let told: Vec<&str> = told.collect();
    assert_eq!(told, ["nirspi: --token (secret): from lab.toml, [serve]"], "{outcome:?}");
}

#[test]
fn a_token_of_the_user_counts_on_this_machine_too_and_comes_from_the_environment() {
    let bench = Bench::new();
    let server = serve(&bench, &["--token", TOKEN]);
    assert_eq!(server.query, format!("token={TOKEN}"));
    server.get("/api/state").refuses(401, "needs its token");
    assert_ne!(server.get(&format!("/api/state?token={TOKEN}")).status, 401);
    let refused = bench.run_with(&[("NIRSPI_TOKEN", "short")], &["serve"]);
    refused.failed(2, &["expected 16 to 128"]);
}

/// Opens a connection and sends these bytes, if there is a place for the connection.
fn misbehave(address: &str, bytes: &[u8]) -> Option<TcpStream> {
    let mut stream = TcpStream::connect(address).ok()?;
    let _ = stream.write_all(bytes);
    Some(stream)
}

#[test]
#[ignore = "long: .ci/run demo"]
fn a_page_goes_on_among_hundreds_of_clients_that_misbehave() {
    let bench = Bench::new();
    let server = serve(&bench, &["--method", "hadamard"]);
    server.change(r#"{"enhance": false}"#).json();
    let shown = |moment: &Value| moment["state"]["images"]["shown"].as_u64().unwrap();
    let mut page = server.browser();
    let mut last = shown(&page.next().unwrap());
    let host = format!("Host: {}\r\n", server.address);
    let bad = [
        String::new(),
        format!("GET / HTTP/1.1\r\n{host}X-Slow: a"),
        format!("POST /api/settings HTTP/1.1\r\n{host}Content-Length: 4000\r\n\r\n{{"),
        format!("GET /events HTTP/1.1\r\n{host}\r\n"),
    ];
    const UNREAD: usize = 3;
    let mut open = Vec::new();
    for number in 0..400 {
        let kind = number % bad.len();
        let client = misbehave(&server.address, bad[kind].as_bytes());
        open.extend(client.map(|stream| (kind, stream)));
        if number % 40 == 0 {
            // The page goes on, and new requests are answered.
            let now = shown(&page.next().unwrap());
            assert!(now >= last, "back in time");
            last = now;
            assert_eq!(server.get("/api/state").status, 200, "after {number} connections");
        }
    }
    assert_eq!(server.ask("POST", "/api/stop", &[], "").json()["run"], false);
    assert!(page.any(|moment| moment["state"]["camera"]["phase"] == "stopped"));
    server.ask("POST", "/api/start", &[], "").json();
    assert!(page.any(|moment| shown(&moment) > last + 5));
    // The server has closed the streams that were not read, so the page is its only client.
    assert!(page.any(|moment| moment["state"]["viewers"] == 1));
    // Silent connections and half requests are closed, too.
    for (_, mut stream) in open.into_iter().filter(|(kind, _)| *kind != UNREAD) {
        stream.set_read_timeout(Some(LIMIT)).unwrap();
        match stream.read(&mut [0; 1024]) {
            Ok(0) => {}
            Err(error) => assert_eq!(error.kind(), std::io::ErrorKind::ConnectionReset),
            Ok(bytes) => panic!("{bytes} bytes for half a request"),
        }
    }
    // The program had nothing to complain of.
    #[cfg(unix)]
    {
        server.process.signal("INT");
        let said = server.process.wait().succeeded();
        assert!(said.stdout.contains("\nstopped: "), "{said:?}");
    }
}

#[test]
fn a_body_that_is_too_long_is_refused_before_it_comes() {
    let bench = Bench::new();
    let server = serve(&bench, &[]);
    for length in ["4097", "99999999999999", "99999999999999999999999999", "-1"] {
        let mut stream = server.connect();
        let host = &server.address;
        let head = format!(
            "POST /api/settings HTTP/1.1\r\nHost: {host}\r\nContent-Length: {length}\r\n\r\n"
        );
        stream.write_all(head.as_bytes()).unwrap();
        let mut answer = [0; 12];
        stream.read_exact(&mut answer).unwrap();
        let status = String::from_utf8_lossy(&answer).into_owned();
        assert!(["HTTP/1.1 413", "HTTP/1.1 400"].contains(&status.as_str()), "{length}: {status}");
    }
}
