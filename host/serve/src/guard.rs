//! Accepts requests of pages from this server, and of programs on machines that reach this server.
//!
//! A browser carries requests of any page to this address. A page of another site may post to the
//! address. If the site's own name resolves to this machine (DNS rebinding), the page may even
//! read. Both attacks show in the headers, which pages cannot forge.
//!
//! # Invariant
//! A request is accepted only from this server's pages or without a page
//! (`tests::our_own_pages_and_scripts_pass`, `tests::foreign_names_are_refused`,
//! `tests::foreign_pages_are_refused`). The check comes before any other use of the request.

use super::access::HostName;
use axum::http::uri::Authority;
use axum::http::{HeaderMap, HeaderName, HeaderValue, Method, header};
use std::net::{IpAddr, SocketAddr};
use thiserror::Error;

/// Why a request is refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum Refused {
    /// The requested host name is not this server's.
    #[error(
        "this server does not go by that name: open it by its IP address, or as localhost on its own machine, or start it \
         with --allow-host NAME"
    )]
    Host,
    /// A page of another site sent the request.
    #[error(
        "a page of another site asked: open this server's own page; a proxy must pass the header Host on as it comes"
    )]
    Origin,
}

/// Accepts a request or returns the reason for refusing. `listen` is where this server listens, `names` are its further
/// names. A page that was opened by one of these names may come by `https`, which a proxy before the server adds.
///
/// The port in `Host` is not checked. The port differs if a user forwards the server's port (ssh
/// -L), and a page of another site cannot choose the port.
///
/// # Errors
/// [`Refused`].
pub fn check(
    method: &Method,
    headers: &HeaderMap,
    listen: SocketAddr,
    names: &[HostName],
) -> Result<(), Refused> {
    let (host, by_name) = our_host(headers, listen, names)?;
    if headers.contains_key(header::ORIGIN) {
        let origin = only(headers, &header::ORIGIN).and_then(|origin| {
            let secure = origin.strip_prefix("https://").filter(|_| by_name);
            secure.or_else(|| origin.strip_prefix("http://"))
        });
        if !origin.is_some_and(|origin| origin.eq_ignore_ascii_case(host)) {
            return Err(Refused::Origin);
        }
    }
    // Images embedded in pages of other sites come without `Origin`. Following a link is harmless.
    let told = |name| headers.get(HeaderName::from_static(name)).map(HeaderValue::as_bytes);
    let foreign = matches!(told("sec-fetch-site"), Some(b"cross-site" | b"same-site"));
    let follows = method == Method::GET && told("sec-fetch-mode") == Some(b"navigate");
    if foreign && !follows {
        return Err(Refused::Origin);
    }
    Ok(())
}

/// Host and port of a request, if they are this server's, and whether its host is one of `names`.
fn our_host<'h>(
    headers: &'h HeaderMap,
    listen: SocketAddr,
    names: &[HostName],
) -> Result<(&'h str, bool), Refused> {
    let host = only(headers, &header::HOST).ok_or(Refused::Host)?;
    let authority: Authority = host.parse().map_err(|_| Refused::Host)?;
    let by_name = names.iter().any(|name| name.is(authority.host()));
    if by_name || is_ours(authority.host(), listen) {
        Ok((host, by_name))
    } else {
        Err(Refused::Host)
    }
}

/// The value of a header that occurs once.
fn only<'h>(headers: &'h HeaderMap, name: &HeaderName) -> Option<&'h str> {
    let mut all = headers.get_all(name).iter();
    let first = all.next()?;
    if all.next().is_some() { None } else { first.to_str().ok() }
}

/// Whether an address may be this server's. `localhost` is the only name that is accepted unasked, because DNS
/// rebinding needs a name.
fn is_ours(host: &str, listen: SocketAddr) -> bool {
    is_this_machine(host)
        || address(host).is_some_and(|ip| listen.ip().is_unspecified() || ip == listen.ip())
}

fn is_this_machine(host: &str) -> bool {
    host.eq_ignore_ascii_case("localhost") || address(host).is_some_and(|ip| ip.is_loopback())
}

fn address(host: &str) -> Option<IpAddr> {
    host.trim_start_matches('[').trim_end_matches(']').parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    type Headers<'h> = &'h [(&'static str, &'static str)];

    fn asked(listen: &str, headers: Headers<'_>) -> Result<(), Refused> {
        asked_by(Method::GET, listen, headers)
    }

    fn asked_by(method: Method, listen: &str, headers: Headers<'_>) -> Result<(), Refused> {
        let mut map = HeaderMap::new();
        for &(name, value) in headers {
            map.append(HeaderName::from_static(name), value.parse().unwrap());
        }
        let names = ["cam.lab", "192.0.2.9"].map(|name| name.parse().unwrap());
        check(&method, &map, listen.parse().unwrap(), &names)
    }

    #[test]
    fn our_own_pages_and_scripts_pass() {
        for host in
            ["127.0.0.1:8080", "localhost:8080", "LOCALHOST", "[::1]:8080", "localhost:9000"]
        {
            assert_eq!(asked("127.0.0.1:8080", &[("host", host)]), Ok(()), "{host}");
        }
        for (host, origin) in [
            ("127.0.0.1:8080", "http://127.0.0.1:8080"),
            ("localhost:9000", "http://localhost:9000"),
        ] {
            let headers = [("host", host), ("origin", origin), ("sec-fetch-site", "same-origin")];
            assert_eq!(asked("127.0.0.1:8080", &headers), Ok(()), "{host}");
        }
        assert_eq!(asked("0.0.0.0:80", &[("host", "192.168.1.7")]), Ok(()));
        assert_eq!(asked("192.168.1.7:80", &[("host", "192.168.1.7")]), Ok(()));
        let link = [("sec-fetch-site", "cross-site"), ("sec-fetch-mode", "navigate")];
        assert_eq!(asked("[::1]:80", &[&[("host", "localhost")], &link[..]].concat()), Ok(()));
    }

    #[test]
    fn pages_of_a_name_that_is_allowed_pass_with_http_and_https() {
        for (host, origin) in [
            ("cam.lab", "https://cam.lab"),
            ("CAM.lab:8443", "https://cam.lab:8443"),
            ("cam.lab:81", "http://cam.lab:81"),
            ("192.0.2.9", "https://192.0.2.9"),
        ] {
            let headers = [("host", host), ("origin", origin), ("sec-fetch-site", "same-origin")];
            assert_eq!(asked("127.0.0.1:8080", &headers), Ok(()), "{host}");
        }
        for (host, origin) in [
            ("cam.lab", "https://cam.lab:8443"),
            ("cam.lab", "https://other.lab"),
            ("cam.lab", "ftp://cam.lab"),
            ("cam.lab", "https://http://cam.lab"),
            ("cam.lab:8080", "https://cam.lab"),
            ("127.0.0.1:8080", "https://cam.lab"),
        ] {
            let asked = asked("127.0.0.1:8080", &[("host", host), ("origin", origin)]);
            assert_eq!(asked, Err(Refused::Origin), "{host}, {origin}");
        }
        for host in ["xcam.lab", "cam.lab.example", "lab", "192.0.2.8"] {
            assert_eq!(asked("127.0.0.1:8080", &[("host", host)]), Err(Refused::Host), "{host}");
        }
    }

    #[test]
    fn foreign_names_are_refused() {
        for host in
            ["evil.example:8080", "evil.example", "localhost.evil.example", "192.168.1.7", "", "@"]
        {
            assert_eq!(asked("127.0.0.1:8080", &[("host", host)]), Err(Refused::Host), "{host}");
        }
        assert_eq!(asked("127.0.0.1:80", &[]), Err(Refused::Host));
        let twice = [("host", "localhost"), ("host", "localhost")];
        assert_eq!(asked("127.0.0.1:80", &twice), Err(Refused::Host));
        assert_eq!(asked("0.0.0.0:80", &[("host", "lab.example")]), Err(Refused::Host));
        assert_eq!(asked("10.0.0.1:80", &[("host", "10.0.0.2")]), Err(Refused::Host));
    }

    #[test]
    fn foreign_pages_are_refused() {
        let host = ("host", "127.0.0.1:8080");
        for origin in [
            "http://evil.example",
            "null",
            "https://127.0.0.1:8080",
            "http://127.0.0.1:3000",
            "",
            // The nearest wrong ones.
            "http://127.0.0.1:80800",
            "http://127.0.0.1:808",
            "http://127.0.0.1",
            "http://127.0.0.1:8080.evil.example",
            "http://127.0.0.1:8080@evil.example",
            "http://127.0.0.1:8080/",
            "http://x127.0.0.1:8080",
            "127.0.0.1:8080",
        ] {
            let asked = asked("127.0.0.1:8080", &[host, ("origin", origin)]);
            assert_eq!(asked, Err(Refused::Origin), "{origin}");
        }
        for site in ["cross-site", "same-site"] {
            let picture = [host, ("sec-fetch-site", site), ("sec-fetch-mode", "no-cors")];
            assert_eq!(asked("127.0.0.1:8080", &picture), Err(Refused::Origin), "{site}");
            let form = [host, ("sec-fetch-site", site), ("sec-fetch-mode", "navigate")];
            let posted = asked_by(Method::POST, "127.0.0.1:8080", &form);
            assert_eq!(posted, Err(Refused::Origin), "{site}");
        }
    }
}
