//! Where the page is served, and who may open it.

use super::access::Access;
use super::token::{Token, TokenError};
use nirspi::provenance::Made;
use std::fmt::Display;
use std::io;
use std::net::{SocketAddr, TcpListener};
use thiserror::Error;

/// Why there is no server.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum BindError {
    /// The address cannot be used.
    #[error(transparent)]
    Address(#[from] io::Error),
    /// There is no token.
    #[error(transparent)]
    Token(#[from] TokenError),
}

/// A listening server.
#[derive(Debug)]
pub struct Server {
    pub(super) listener: TcpListener,
    pub(super) access: Access,
    /// The program, for the provenance of pictures that a browser asks for.
    pub(super) made: Made,
    /// Where the server listens.
    pub(super) address: SocketAddr,
}

impl Server {
    /// Listens at `address`, `host:port`. A server that other machines reach, by its address or by a name of `access`,
    /// demands a token: the given one, or a random one. `made` is the program, for the provenance of its pictures.
    ///
    /// # Errors
    /// [`BindError`].
    pub fn bind(address: &str, mut access: Access, made: &Made) -> Result<Self, BindError> {
        let listener = TcpListener::bind(address)?;
        let address = listener.local_addr()?;
        if access.token.is_none() && !(address.ip().is_loopback() && access.names.is_empty()) {
            access.token = Some(Token::random()?);
        }
        Ok(Self { listener, access, made: made.clone(), address })
    }

    /// What a user must know to see this camera: the addresses with their tokens, and who else can open
    /// them.
    #[must_use]
    pub fn invitation(&self, camera: &impl Display) -> String {
        let mut text = format!("open {} to see camera {camera}; Ctrl-C ends it", self.url());
        if let Some(notice) = self.notice() {
            text += &format!("\n{notice}");
        }
        text
    }

    /// Host and port of an address that this machine can open.
    fn machine(&self) -> String {
        match self.address.ip() {
            ip if ip.is_unspecified() => format!("localhost:{}", self.address.port()),
            _ => self.address.to_string(),
        }
    }

    /// The address, with the token if there is one.
    #[must_use]
    pub fn url(&self) -> String {
        let (machine, base) = (self.machine(), &self.access.base_path);
        match (&self.access.token, base.named()) {
            (Some(token), _) => format!("http://{machine}{base}?token={token}"),
            (None, Some(_)) => format!("http://{machine}{base}"),
            (None, None) => format!("http://{machine}"),
        }
    }

    /// What a user must know about other machines; `None` if only this machine reaches the server.
    fn notice(&self) -> Option<String> {
        let is_own = self.address.ip().is_loopback();
        let (who, instead) = match self.access.names.first() {
            Some(name) => (
                format!("every machine that reaches {name}"),
                format!(
                    "; there write {name} instead of {}, and https if a proxy adds it",
                    self.machine()
                ),
            ),
            None if is_own => return None,
            None if self.address.ip().is_unspecified() => (
                "every machine in this network".to_owned(),
                "; on another machine write this machine's address instead of localhost".to_owned(),
            ),
            None => ("every machine in this network".to_owned(), String::new()),
        };
        Some(format!(
            "{who} can look at the camera and switch it, if it knows the token in this address{instead}"
        ))
    }
}
