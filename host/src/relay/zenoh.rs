//! Packets over [Zenoh](https://zenoh.io): publisher, subscriber, any number of routers between.
//!
//! | key | content |
//! | -- | -- |
//! | `KEY/wire` | each intact packet of the camera, as a recording holds it |
//! | `KEY/setup` | the announcement, JSON: published at the start of a run, and the answer to a query |
//!
//! A publisher that finds no room drops the packet, so the camera's thread never waits, and the gap in
//! the frames' numbers says what is lost. A router may restart: both ends connect again by themselves.

use super::{Announcement, Publish, RelayLink, Subscribe};
use ::zenoh::handlers::{FifoChannel, FifoChannelHandler};
use ::zenoh::pubsub::{Publisher, Subscriber};
use ::zenoh::qos::CongestionControl;
use ::zenoh::query::Queryable;
use ::zenoh::sample::Sample;
use ::zenoh::{Config, Session, Wait};
use std::fmt;
use std::io;
use std::str::FromStr;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};
use thiserror::Error;

/// Packets that wait for a slow host. Further ones wait in the network, and then at the publisher.
const WAITING: usize = 4096;
/// The longest announcement: one of 1024 rows has 6 kB.
const ANNOUNCEMENT_BYTES: usize = 1 << 20;
/// The longest wait for a camera's announcement.
const PATIENCE: Duration = Duration::from_secs(5);

/// Where a camera is published: `KEY` or `KEY@ENDPOINT`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ZenohAddress {
    /// The key, without wildcards: `lab/left`.
    pub key: String,
    /// The router, such as `tcp/192.168.0.7:7447`. Without one, Zenoh's own configuration counts
    /// (`ZENOH_CONFIG`), and its search for others on the network.
    pub endpoint: Option<String>,
}

impl FromStr for ZenohAddress {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (key, endpoint) = match text.split_once('@') {
            Some((key, endpoint)) => (key, Some(endpoint.to_owned())),
            None => (text, None),
        };
        let is_key = ::zenoh::key_expr::KeyExpr::new(key).is_ok() && !key.contains(['*', '$']);
        if is_key && endpoint.as_ref().is_none_or(|endpoint| endpoint.contains('/')) {
            return Ok(Self { key: key.to_owned(), endpoint });
        }
        Err("expected zenoh:KEY or zenoh:KEY@tcp/HOST:PORT, such as zenoh:lab/left".to_owned())
    }
}

impl fmt::Display for ZenohAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "zenoh:{}", self.key)?;
        self.endpoint.iter().try_for_each(|endpoint| write!(f, "@{endpoint}"))
    }
}

/// Why there is no camera at a key.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ZenohError {
    /// No router or other program answers.
    #[error("{address}: Zenoh cannot be reached")]
    Unreachable {
        /// The address.
        address: ZenohAddress,
        /// Zenoh's reason.
        #[source]
        problem: Box<dyn std::error::Error + Send + Sync>,
    },
    /// No program publishes a camera.
    #[error(
        "{0}: no camera is published there: start nirspi capture --publish {key} at the camera",
        key = .0.key
    )]
    NoCamera(ZenohAddress),
    /// The announcement cannot be read.
    #[error("{address}: the announcement of the camera does not read: {reason}")]
    Announcement {
        /// The address.
        address: ZenohAddress,
        /// The parser's reason.
        reason: String,
    },
}

impl ZenohAddress {
    fn unreachable(&self, problem: ::zenoh::Error) -> ZenohError {
        ZenohError::Unreachable { address: self.clone(), problem }
    }

    fn session(&self) -> Result<Session, ZenohError> {
        let configured = || -> ::zenoh::Result<Config> {
            let mut config = match std::env::var_os("ZENOH_CONFIG") {
                Some(_) => Config::from_env()?,
                None => Config::default(),
            };
            if let Some(endpoint) = &self.endpoint {
                let endpoints = serde_json::to_string(&[endpoint])?;
                config.insert_json5("mode", "\"client\"")?;
                config.insert_json5("connect/endpoints", &endpoints)?;
                config.insert_json5("scouting/multicast/enabled", "false")?;
            }
            Ok(config)
        };
        let opened = configured().and_then(|config| ::zenoh::open(config).wait());
        opened.map_err(|problem| self.unreachable(problem))
    }

    /// Makes a publisher at this key.
    ///
    /// # Errors
    /// [`ZenohError::Unreachable`].
    pub fn publish(&self) -> Result<ZenohPublisher, ZenohError> {
        let session = self.session()?;
        let announced = Arc::new(Mutex::new(None::<String>));
        let (answer, setup) = (Arc::clone(&announced), format!("{}/setup", self.key));
        let key = setup.clone();
        let declared = || -> ::zenoh::Result<_> {
            let packets = session
                .declare_publisher(format!("{}/wire", self.key))
                .congestion_control(CongestionControl::Drop)
                .wait()?;
            let setups = session.declare_publisher(setup.clone()).wait()?;
            let queries = session
                .declare_queryable(setup.clone())
                .callback(move |query| {
                    let json = answer.lock().unwrap_or_else(PoisonError::into_inner).clone();
                    // A host that is gone needs no answer.
                    let _ = json.map(|json| query.reply(&key, json).wait());
                })
                .wait()?;
            Ok((packets, setups, queries))
        };
        let (packets, setups, queries) = declared().map_err(|error| self.unreachable(error))?;
        Ok(ZenohPublisher { announced, packets, setups, _queries: queries, _session: session })
    }

    /// Joins the camera that is published at this key.
    ///
    /// # Errors
    /// [`ZenohError`].
    pub fn join(&self) -> Result<RelayLink, ZenohError> {
        let session = self.session()?;
        let packets = session
            .declare_subscriber(format!("{}/wire", self.key))
            .with(FifoChannel::new(WAITING))
            .wait()
            .map_err(|problem| self.unreachable(problem))?;
        let json = self.ask(&session)?;
        let announced: Announcement = serde_json::from_slice(&json).map_err(|error| {
            ZenohError::Announcement { address: self.clone(), reason: error.to_string() }
        })?;
        announced.setup.check().map_err(|problem| ZenohError::Announcement {
            address: self.clone(),
            reason: problem.to_string(),
        })?;
        let source = ZenohPackets { packets, _session: session };
        Ok(RelayLink::new(announced, Box::new(source)))
    }

    /// The announcement of the camera.
    fn ask(&self, session: &Session) -> Result<Vec<u8>, ZenohError> {
        let until = Instant::now() + PATIENCE;
        while Instant::now() < until {
            let replies = session
                .get(format!("{}/setup", self.key))
                .timeout(Duration::from_secs(1))
                .wait()
                .map_err(|problem| self.unreachable(problem))?;
            while let Ok(reply) = replies.recv() {
                if let Ok(sample) = reply.result()
                    && sample.payload().len() <= ANNOUNCEMENT_BYTES
                {
                    return Ok(sample.payload().to_bytes().into_owned());
                }
            }
            std::thread::sleep(Duration::from_millis(200));
        }
        Err(ZenohError::NoCamera(self.clone()))
    }
}

/// Publishes packets at a key.
pub struct ZenohPublisher {
    announced: Arc<Mutex<Option<String>>>,
    packets: Publisher<'static>,
    setups: Publisher<'static>,
    _queries: Queryable<()>,
    _session: Session,
}

impl Publish for ZenohPublisher {
    fn announce(&mut self, json: &str) {
        *self.announced.lock().unwrap_or_else(PoisonError::into_inner) = Some(json.to_owned());
        // A put without subscribers is lost, and that is well: each host asks when it joins.
        let _ = self.setups.put(json).wait();
    }

    fn packet(&mut self, raw: &[u8]) {
        // A packet that is lost shows in the frames' numbers.
        let _ = self.packets.put(raw).wait();
    }
}

struct ZenohPackets {
    packets: Subscriber<FifoChannelHandler<Sample>>,
    _session: Session,
}

impl Subscribe for ZenohPackets {
    fn packet(&mut self, timeout: Duration) -> io::Result<Option<Vec<u8>>> {
        match self.packets.recv_timeout(timeout) {
            Ok(sample) => Ok(sample.map(|sample| sample.payload().to_bytes().into_owned())),
            Err(error) => Err(io::Error::other(error)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_are_understood_and_said_again() {
        let of = |key: &str, endpoint: Option<&str>| ZenohAddress {
            key: key.to_owned(),
            endpoint: endpoint.map(str::to_owned),
        };
        for (text, expected) in [
            ("lab/left", of("lab/left", None)),
            ("left@tcp/[::1]:7447", of("left", Some("tcp/[::1]:7447"))),
        ] {
            assert_eq!(text.parse(), Ok(expected.clone()));
            assert_eq!(expected.to_string(), format!("zenoh:{text}"));
        }
        for text in ["", "lab/*", "lab//left", "/lab", "left@", "left@nowhere"] {
            assert!(text.parse::<ZenohAddress>().is_err(), "{text}");
        }
    }

    #[test]
    fn where_no_router_is_the_address_is_named() {
        let address: ZenohAddress = "lab/left@tcp/127.0.0.1:1".parse().unwrap();
        let said = match address.join() {
            Err(error) => crate::causes::in_one_line(&error),
            Ok(_) => panic!("a router answered at port 1"),
        };
        assert!(said.starts_with("zenoh:lab/left@tcp/127.0.0.1:1: Zenoh cannot be"), "{said}");
    }
}
