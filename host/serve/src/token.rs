//! The token that lets a client look at the camera and switch it, where other machines reach the
//! server.
//!
//! # Invariant
//! A server that listens beyond its own machine answers nothing without its token
//! (`a_client_in_the_network_gets_nothing_without_the_token` in
//! `host/cli/tests/cli/serve_guarded.rs`). Tokens are compared in constant time.

use super::base_path::BasePath;
use axum::http::{HeaderMap, Uri, header};
use data_encoding::BASE64URL_NOPAD;
use std::fmt;
use std::str::FromStr;
use subtle::ConstantTimeEq;
use thiserror::Error;

/// The least characters of a token.
const LEAST: usize = 16;
/// The most characters of a token.
const MOST: usize = 128;
/// Random bytes of a token that this program makes.
const RANDOM: usize = 16;

/// A secret that requests must carry. `Debug` does not show it.
#[derive(Clone, PartialEq, Eq)]
pub struct Token(String);

/// Why there is no token.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum TokenError {
    /// The token is too short, too long, or has other characters.
    #[error(
        "a token of {found} characters, expected {LEAST} to {MOST} letters of English, digits, '-' and '_'"
    )]
    Form {
        /// The number of characters of the refused token.
        found: usize,
    },
    /// The system gives no random numbers.
    #[error("the system gives no random numbers for a token: {0}; name a token of your own")]
    Random(String),
}

impl Token {
    /// A random token of 128 bits.
    ///
    /// # Errors
    /// [`TokenError::Random`] if the system gives no random numbers.
    pub fn random() -> Result<Self, TokenError> {
        let mut bytes = [0; RANDOM];
        getrandom::fill(&mut bytes).map_err(|error| TokenError::Random(error.to_string()))?;
        Ok(Self(BASE64URL_NOPAD.encode(&bytes)))
    }

    /// Whether `found` is this token. The time does not depend on where they differ.
    fn is(&self, found: &str) -> bool {
        self.0.as_bytes().ct_eq(found.as_bytes()).into()
    }

    /// Whether a request carries this token: as `Authorization: Bearer TOKEN`, in the cookie of this
    /// server, or as `?token=TOKEN`.
    pub(super) fn is_in(&self, headers: &HeaderMap, uri: &Uri, port: u16) -> bool {
        let texts = |name| headers.get_all(name).iter().filter_map(|value| value.to_str().ok());
        let bearer = texts(header::AUTHORIZATION).filter_map(|text| text.strip_prefix("Bearer "));
        let name = cookie(port);
        let cookies = texts(header::COOKIE)
            .flat_map(|text| text.split(';'))
            .filter_map(|pair| pair.trim().strip_prefix(name.as_str())?.strip_prefix('='));
        let mut found = bearer.chain(cookies).chain(in_query(uri));
        found.any(|found| self.is(found))
    }

    /// The cookie by which a browser remembers the token until it is closed. Scripts cannot read
    /// it, and pages of other sites do not send it.
    /// The browser sends it to `base`, with or without its last `/`, and to paths below.
    pub(super) fn cookie(&self, port: u16, base: &BasePath) -> String {
        let path = base.named().unwrap_or("/");
        format!("{}={}; Path={path}; HttpOnly; SameSite=Strict", cookie(port), self.0)
    }
}

/// The name of the cookie. Browsers send a cookie to all ports of a machine.
fn cookie(port: u16) -> String {
    format!("nirspi-{port}")
}

/// The token in the query of an address.
pub(super) fn in_query(uri: &Uri) -> Option<&str> {
    uri.query()?.split('&').find_map(|pair| pair.strip_prefix("token="))
}

impl FromStr for Token {
    type Err = TokenError;

    fn from_str(text: &str) -> Result<Self, TokenError> {
        let found = text.chars().count();
        let is_sign = |sign: char| sign.is_ascii_alphanumeric() || sign == '-' || sign == '_';
        if (LEAST..=MOST).contains(&found) && text.chars().all(is_sign) {
            Ok(Self(text.to_owned()))
        } else {
            Err(TokenError::Form { found })
        }
    }
}

impl fmt::Debug for Token {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Token(..)")
    }
}

/// The token itself, for the address that is printed once.
impl fmt::Display for Token {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::http::HeaderValue;

    const TEXT: &str = "a-token-of-someone_7";

    fn carries(headers: &[(header::HeaderName, &'static str)], uri: &'static str) -> bool {
        let mut map = HeaderMap::new();
        for (name, value) in headers {
            map.append(name, HeaderValue::from_static(value));
        }
        TEXT.parse::<Token>().unwrap().is_in(&map, &Uri::from_static(uri), 8080)
    }

    #[test]
    fn a_request_carries_the_token_as_header_cookie_or_query() {
        assert!(carries(&[(header::AUTHORIZATION, "Bearer a-token-of-someone_7")], "/"));
        assert!(carries(&[(header::COOKIE, "a=b; nirspi-8080=a-token-of-someone_7")], "/"));
        assert!(carries(&[], "/events?x=1&token=a-token-of-someone_7"));
        for (name, value) in [
            (header::AUTHORIZATION, "Bearer a-token-of-someone_8"),
            (header::AUTHORIZATION, "a-token-of-someone_7"),
            (header::COOKIE, "nirspi-8081=a-token-of-someone_7"),
            (header::COOKIE, "nirspi-8080=a-token-of-someone_7x"),
            (header::HOST, TEXT),
        ] {
            assert!(!carries(&[(name, value)], "/?token="), "{value}");
        }
        assert!(!carries(&[], "/?token=a-token-of-someone") && !carries(&[], "/"));
    }

    #[test]
    fn tokens_are_long_and_of_simple_signs_and_random_ones_differ() {
        for text in ["short", "a token with spaces in it", "a-token-of-someone;", &"x".repeat(129)]
        {
            let error = text.parse::<Token>().unwrap_err().to_string();
            assert!(error.contains("expected 16 to 128") && !error.contains(text), "{error}");
        }
        let (a, b) = (Token::random().unwrap(), Token::random().unwrap());
        assert_ne!(a, b);
        assert_eq!(a.to_string().parse(), Ok(a.clone()));
        assert_eq!((a.to_string().len(), format!("{a:?}")), (22, "Token(..)".to_owned()));
    }
}
