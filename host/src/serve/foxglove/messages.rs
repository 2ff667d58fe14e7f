//! The messages of the Foxglove WebSocket protocol that a camera needs.
//!
//! Source: <https://github.com/foxglove/ws-protocol/blob/main/docs/spec.md>. The subprotocol
//! `foxglove.sdk.v1` of the newer SDK has the same messages.

use crate::recording::schemas::{Channel, ENCODING};
use data_encoding::BASE64;
use serde::Deserialize;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use thiserror::Error;

/// The subprotocols that have these messages, the preferred one first.
pub const SUBPROTOCOLS: [&str; 2] = ["foxglove.sdk.v1", "foxglove.websocket.v1"];

/// The operation code of a message with data.
const MESSAGE_DATA: u8 = 1;
/// The most bytes of a reason for closing (RFC 6455, 5.5: 125 bytes with the code).
const REASON: usize = 123;

/// The levels of a status.
pub const WARNING: u8 = 1;
/// See [`WARNING`].
pub const ERROR: u8 = 2;

/// Why a connection is closed.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum Refused {
    /// The message is not a message of WebSocket.
    #[error("a message that cannot be read: {0}")]
    Form(String),
    /// The message is not JSON with an operation.
    #[error("expected a JSON object with \"op\": {0}")]
    Json(String),
    /// A field of the operation is missing.
    #[error("{op} without {field}")]
    Field {
        /// The operation.
        op: &'static str,
        /// The missing field.
        field: &'static str,
    },
    /// The message is binary.
    #[error("a binary message: this camera takes no data")]
    Binary,
    /// The viewer answers no ping.
    #[error("no answer to pings")]
    Silent,
}

impl Refused {
    /// The code for closing (RFC 6455, 7.4.1).
    pub fn code(&self) -> u16 {
        match self {
            Self::Form(_) => 1002,
            Self::Json(_) | Self::Field { .. } => 1007,
            Self::Binary => 1003,
            Self::Silent => 1008,
        }
    }
}

/// The reason for closing, cut to the length that is allowed.
pub fn reason(refused: &Refused) -> String {
    let mut text = refused.to_string();
    let end = (0..=REASON).rev().find(|&end| text.is_char_boundary(end)).unwrap_or(0);
    text.truncate(end);
    text
}

/// What a viewer asks for.
#[derive(Debug, PartialEq, Eq)]
pub enum Asked {
    /// Messages of channels.
    Subscribe(Vec<Subscription>),
    /// No more messages of these subscriptions.
    Unsubscribe(Vec<u32>),
    /// Something that this server does not offer.
    Other(String),
}

/// A viewer's wish for the messages of a channel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Subscription {
    /// The number by which the viewer knows the subscription.
    pub id: u32,
    /// The number of the channel.
    pub channel_id: u32,
}

/// Reads a viewer's message.
///
/// # Errors
/// [`Refused::Json`] or [`Refused::Field`].
pub fn read(text: &str) -> Result<Asked, Refused> {
    #[derive(Deserialize)]
    #[serde(rename_all = "camelCase")]
    struct Fields {
        op: String,
        subscriptions: Option<Vec<Subscription>>,
        subscription_ids: Option<Vec<u32>>,
    }
    let fields: Fields =
        serde_json::from_str(text).map_err(|error| Refused::Json(error.to_string()))?;
    let missing = |op, field| Refused::Field { op, field };
    match fields.op.as_str() {
        "subscribe" => fields
            .subscriptions
            .map(Asked::Subscribe)
            .ok_or_else(|| missing("subscribe", "subscriptions")),
        "unsubscribe" => fields
            .subscription_ids
            .map(Asked::Unsubscribe)
            .ok_or_else(|| missing("unsubscribe", "subscriptionIds")),
        _ => Ok(Asked::Other(fields.op)),
    }
}

/// The number of a channel.
fn number_of(channel: Channel) -> u32 {
    channel as u32 + 1
}

/// The channel of this number.
pub fn channel(number: u32) -> Option<Channel> {
    Channel::LIVE.into_iter().find(|&channel| number_of(channel) == number)
}

/// The first message to a viewer. No capabilities: a viewer cannot change anything.
pub fn server_info(name: &str, session: u128) -> String {
    let metadata = BTreeMap::from([("nirspi", env!("CARGO_PKG_VERSION"))]);
    let info = json!({
        "op": "serverInfo",
        "name": name,
        "capabilities": [],
        "supportedEncodings": [],
        "metadata": metadata,
        "sessionId": session.to_string(),
    });
    info.to_string()
}

/// The second message to a viewer: all channels.
pub fn advertise() -> String {
    let channels = Channel::LIVE.map(|channel| {
        json!({
            "id": number_of(channel),
            "topic": channel.topic(),
            "encoding": ENCODING,
            "schemaName": channel.schema(),
            "schema": BASE64.encode(&channel.descriptors()),
            "schemaEncoding": ENCODING,
        })
    });
    json!({"op": "advertise", "channels": Value::from(channels.to_vec())}).to_string()
}

/// A line for the user of a viewer.
pub fn status(level: u8, text: &impl ToString) -> String {
    json!({"op": "status", "level": level, "message": text.to_string()}).to_string()
}

/// A message of a channel.
pub fn data(subscription: u32, time_ns: u64, payload: &[u8]) -> Vec<u8> {
    let mut message = Vec::with_capacity(13 + payload.len());
    message.push(MESSAGE_DATA);
    message.extend(subscription.to_le_bytes());
    message.extend(time_ns.to_le_bytes());
    message.extend(payload);
    message
}
