//! Where the page is served, and who may open it.

use super::token::{Token, TokenError};
use crate::provenance::Made;
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
    pub(super) token: Option<Token>,
    /// The program, for the provenance of pictures that a browser asks for.
    pub(super) made: Made,
    /// Where the server listens.
    pub(super) address: SocketAddr,
}

impl Server {
    /// Listens at `address`, `host:port`. A server that other machines reach demands a token: the
    /// given one, or a random one. `made` is the program, for the provenance of its pictures.
    ///
    /// # Errors
    /// [`BindError`].
    pub fn bind(address: &str, token: Option<Token>, made: &Made) -> Result<Self, BindError> {
        let listener = TcpListener::bind(address)?;
        let address = listener.local_addr()?;
        let token = match token {
            None if !address.ip().is_loopback() => Some(Token::random()?),
            token => token,
        };
        Ok(Self { listener, token, made: made.clone(), address })
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

    /// The address, with the token if there is one.
    fn url(&self) -> String {
        let machine = match self.address.ip() {
            ip if ip.is_unspecified() => format!("localhost:{}", self.address.port()),
            _ => self.address.to_string(),
        };
        match &self.token {
            Some(token) => format!("http://{machine}/?token={token}"),
            None => format!("http://{machine}"),
        }
    }

    /// What a user must know about other machines; `None` if only this machine reaches the server.
    fn notice(&self) -> Option<String> {
        if self.address.ip().is_loopback() {
            return None;
        }
        let instead = if self.address.ip().is_unspecified() {
            "; on another machine write this machine's address instead of localhost"
        } else {
            ""
        };
        Some(format!(
            "every machine in this network can look at the camera and switch it, if it knows the token in this address{instead}"
        ))
    }
}
