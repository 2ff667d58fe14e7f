//! Who can open the page, and under which names and path: what a reverse proxy before the server needs.

use super::base_path::BasePath;
use super::token::Token;
use std::fmt;
use std::net::IpAddr;
use std::str::FromStr;
use thiserror::Error;

/// The most characters of a host's name (RFC 1035, section 2.3.4).
const LONGEST_NAME: usize = 253;

/// Who can open the page, and where.
#[derive(Debug, Clone, Default)]
pub struct Access {
    /// The secret that requests must carry. Without one, a server that other machines reach makes a random token.
    pub token: Option<Token>,
    /// Names of the server beside its own addresses: those of a reverse proxy before the server. With a name, other
    /// machines reach the server.
    pub names: Vec<HostName>,
    /// The path below which everything is served.
    pub base_path: BasePath,
}

/// A name of a host, or its address, without a port.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct HostName(String);

/// A text that is no name of a host.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error(
    "found {0:?}, expected the name or the IP address that people open, as camera.example.org, without https:// and without \
     a port"
)]
pub struct HostNameError(String);

impl HostName {
    /// Whether a request was sent to this name. Upper and lower case are alike.
    pub(super) fn is(&self, host: &str) -> bool {
        self.0.eq_ignore_ascii_case(host.trim_start_matches('[').trim_end_matches(']'))
    }
}

impl FromStr for HostName {
    type Err = HostNameError;

    fn from_str(text: &str) -> Result<Self, HostNameError> {
        let is_sign = |sign: char| sign.is_ascii_alphanumeric() || sign == '-' || sign == '_';
        let is_label = |label: &str| !label.is_empty() && label.chars().all(is_sign);
        let is_name = text.len() <= LONGEST_NAME && text.split('.').all(is_label);
        if is_name || text.parse::<IpAddr>().is_ok() {
            Ok(Self(text.to_owned()))
        } else {
            Err(HostNameError(text.chars().take(LONGEST_NAME).collect()))
        }
    }
}

impl fmt::Display for HostName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_host_name_has_no_scheme_port_or_pattern() {
        for text in ["camera.example.org", "cam", "cam_1.lab", "192.0.2.7", "2001:db8::7"] {
            let name: HostName = text.parse().unwrap();
            assert!(name.is(&text.to_uppercase()) && !name.is("cam.example.org"), "{text}");
        }
        assert!("2001:db8::7".parse::<HostName>().unwrap().is("[2001:db8::7]"));
        for text in [
            "",
            "https://cam.lab",
            "cam.lab:8080",
            "*.lab",
            "cam..lab",
            ".",
            "cam.lab/",
            "a b",
            "a@b",
        ] {
            let line = text.parse::<HostName>().unwrap_err().to_string();
            assert!(line.contains("expected the name") && line.lines().count() == 1, "{line}");
        }
    }
}
