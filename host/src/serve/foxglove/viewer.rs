//! What one viewer has asked for, and what the viewer gets next. Without a connection.
//!
//! # Invariant
//! A viewer has one subscription of a channel at most, and what it gets at once is at most one message
//! of an image channel and the lines of the log that are kept
//! (`a_channel_has_one_subscription_and_unknown_wishes_are_answered` in
//! `host/src/serve/tests/foxglove.rs`).

use super::messages::{self, Asked, Refused, WARNING};
use super::{Shared, lock};
use crate::clock;
use crate::recording::Pinhole;
use crate::recording::schemas::{self, Channel, Telemetry};
use crate::serve::imaging::Picture;
use crate::serve::state::Rate;
use nirspi_nets::{deblur, fusion};
use std::collections::BTreeMap;
use std::time::Instant;

/// Time between two messages of telemetry, as in a recording.
const TELEMETRY_NS: u64 = 100_000_000;

/// What one viewer has asked for.
#[derive(Debug, Default)]
pub struct Viewer {
    subscribed: BTreeMap<Channel, Subscribed>,
    frames: Option<Rate>,
}

/// A subscription of a channel.
#[derive(Debug)]
struct Subscribed {
    /// The viewer's number of the subscription.
    id: u32,
    /// What the viewer has: the number of the newest image, the number of lines, the time of the last
    /// telemetry, whether it has the calibration. 0: nothing.
    seen: u64,
}

/// What a viewer gets now.
#[derive(Debug, Default)]
pub struct News {
    /// Messages of channels.
    pub messages: Vec<Vec<u8>>,
    /// Number of images among the messages.
    pub images: u64,
    /// Number of images of subscribed channels that were made since the last time and are not among
    /// the messages.
    pub missed: u64,
}

impl Viewer {
    /// Takes a message of the viewer. Returns what to answer.
    ///
    /// # Errors
    /// [`Refused`] if the connection must be closed.
    pub fn asked(&mut self, text: &str) -> Result<Vec<String>, Refused> {
        let mut told = Vec::new();
        let mut tell = |words: String| told.push(messages::status(WARNING, &words));
        match messages::read(text)? {
            Asked::Subscribe(wishes) => {
                // What the viewer gets stays bounded, however long its list is.
                for wish in wishes.iter().take(2 * Channel::LIVE.len()) {
                    let is_taken = self.subscribed.values().any(|known| known.id == wish.id);
                    match messages::channel(wish.channel_id) {
                        None => tell(format!("there is no channel {}", wish.channel_id)),
                        Some(channel) if is_taken || self.subscribed.contains_key(&channel) => {
                            tell(format!("{} is subscribed already", channel.topic()));
                        }
                        Some(channel) => {
                            self.subscribed.insert(channel, Subscribed { id: wish.id, seen: 0 });
                        }
                    }
                }
            }
            Asked::Unsubscribe(ids) => {
                self.subscribed.retain(|_, subscribed| !ids.contains(&subscribed.id));
            }
            Asked::Other(op) => {
                let op: String = op.chars().take(40).collect();
                tell(format!(
                    "this camera does not offer {op:?}: viewers can look and change nothing"
                ));
            }
        }
        Ok(told)
    }

    /// What the viewer has not had yet.
    pub fn news(&mut self, shared: &Shared, pinhole: Pinhole, picture: Option<&Picture>) -> News {
        let now_ns = clock::since_1970().as_nanos() as u64;
        let mut news = News::default();
        for (&channel, subscribed) in &mut self.subscribed {
            let id = subscribed.id;
            match channel {
                Channel::Calibration if subscribed.seen == 0 => {
                    subscribed.seen = 1;
                    news.messages.push(messages::data(id, now_ns, &pinhole.encode(now_ns)));
                }
                Channel::Calibration => {}
                Channel::Log => {
                    let log = lock(&shared.camera);
                    let (lines, count) = log.after(subscribed.seen);
                    news.messages.extend(lines.map(|line| {
                        let time_ns = line.unix_ms * 1_000_000;
                        let payload = schemas::log(time_ns, line.level, &line.text);
                        messages::data(id, time_ns, &payload)
                    }));
                    subscribed.seen = count;
                }
                Channel::Telemetry => {
                    if now_ns.saturating_sub(subscribed.seen) >= TELEMETRY_NS {
                        subscribed.seen = now_ns;
                        let telemetry = telemetry(shared, &mut self.frames);
                        let payload = telemetry.encode(now_ns);
                        news.messages.push(messages::data(id, now_ns, &payload));
                    }
                }
                // A live camera has neither (`Channel::LIVE`).
                Channel::Spread | Channel::Interval => {}
                Channel::Image | Channel::Enhanced | Channel::Depth => {
                    if let Some(picture) = picture
                        && picture.number > subscribed.seen
                    {
                        if let Some(message) = image(channel, id, picture) {
                            news.messages.push(message);
                            news.images += 1;
                        }
                        // A viewer that has just subscribed has missed nothing.
                        if subscribed.seen > 0 {
                            news.missed += picture.number - subscribed.seen - 1;
                        }
                        subscribed.seen = picture.number;
                    }
                }
            }
        }
        news
    }
}

/// The message of an image channel; `None` if the picture has no such image.
fn image(channel: Channel, id: u32, picture: &Picture) -> Option<Vec<u8>> {
    let time_ns = picture.arrived_unix_ms * 1_000_000;
    let payload = match channel {
        Channel::Enhanced => {
            schemas::raw_image(time_ns, deblur::SIDE, picture.enhanced.as_deref()?)
        }
        Channel::Depth => {
            schemas::raw_image(time_ns, fusion::SIDE, &picture.depth.as_ref()?.pixels_m)
        }
        _ => schemas::raw_image(time_ns, fusion::SIDE, &picture.shares_of_white()),
    };
    Some(messages::data(id, time_ns, &payload))
}

/// The state of the camera at this moment.
fn telemetry(shared: &Shared, frames: &mut Option<Rate>) -> Telemetry {
    let (now, counters) = (Instant::now(), shared.slot.ledger().frames);
    let rate = frames.get_or_insert_with(|| Rate::new(now));
    let said = lock(&shared.camera).camera.said;
    Telemetry {
        device_time_us: said.device_time_us,
        counters,
        damaged_packets: said.damaged_packets,
        frames_per_s: rate.at(now, counters.received),
        status: said.status,
    }
}
