//! Where the page is served, and who may open it.

use super::token::{Token, TokenError};
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
    /// Where the server listens.
    pub(super) address: SocketAddr,
}

impl Server {
    /// Listens at `address`, `host:port`. A server that other machines reach demands a token: the
    /// given one, or a random one.
    ///
    /// # Errors
    /// [`BindError`].
    pub fn bind(address: &str, token: Option<Token>) -> Result<Self, BindError> {
        let listener = TcpListener::bind(address)?;
        let address = listener.local_addr()?;
        let token = match token {
            None if !address.ip().is_loopback() => Some(Token::random()?),
            token => token,
        };
        Ok(Self { listener, token, address })
    }

    /// The address of the page, with the token if there is one.
    #[must_use]
    pub fn url(&self) -> String {
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
    #[must_use]
    pub fn notice(&self) -> Option<String> {
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
