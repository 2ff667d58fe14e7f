//! What viewers such as Foxglove get, and what happens to viewers that misbehave.

use super::{LIMIT, Paper, pinhole, until};
use crate::events::Level;
use crate::recording::schemas::{self, Channel};
use crate::serve::foxglove::viewer::Viewer;
use crate::serve::imaging::Picture;
use crate::serve::lock;
use crate::serve::state::Published;
use data_encoding::BASE64;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::io::Write;
use std::net::TcpStream;
use std::sync::Arc;
use std::time::Duration;
use tungstenite::client::IntoClientRequest;
use tungstenite::handshake::HandshakeError;
use tungstenite::http::HeaderValue;
use tungstenite::{Message, WebSocket};

const SUBPROTOCOL: &str = "foxglove.websocket.v1";

/// What a viewer gets.
#[derive(Debug)]
enum Got {
    Json(Value),
    Data {
        id: u32,
        time_ns: u64,
        payload: Vec<u8>,
    },
    /// The connection is closed, with this code.
    Closed(Option<u16>),
}

/// A viewer as this test writes it, from the specification.
struct Client {
    socket: WebSocket<TcpStream>,
    /// The channels by topic: number and schema's name.
    channels: BTreeMap<String, (u64, String)>,
}

/// Opens a WebSocket, or returns the status of the refusal and its words.
fn connect(
    url: &str,
    headers: &[(&'static str, &'static str)],
) -> Result<WebSocket<TcpStream>, (u16, String)> {
    let mut request = url.into_client_request().unwrap();
    for (name, value) in headers {
        request.headers_mut().insert(*name, HeaderValue::from_static(value));
    }
    let host = url.strip_prefix("ws://").unwrap().split('/').next().unwrap();
    let stream = TcpStream::connect(host).unwrap();
    stream.set_read_timeout(Some(LIMIT)).unwrap();
    match tungstenite::client(request, stream) {
        Ok((socket, response)) => {
            let spoken = response.headers().get("sec-websocket-protocol");
            let asked = headers.iter().find(|(name, _)| *name == "sec-websocket-protocol");
            assert!(
                spoken.is_some_and(|spoken| asked.unwrap().1.contains(spoken.to_str().unwrap()))
            );
            Ok(socket)
        }
        Err(HandshakeError::Failure(tungstenite::Error::Http(response))) => {
            let body = response.body().clone().unwrap_or_default();
            Err((response.status().as_u16(), String::from_utf8(body).unwrap()))
        }
        Err(error) => panic!("{error}"),
    }
}

impl Client {
    fn open(paper: &Paper) -> Self {
        let headers = [("sec-websocket-protocol", SUBPROTOCOL)];
        let mut client =
            Self { socket: connect(&paper.foxglove, &headers).unwrap(), channels: BTreeMap::new() };
        let Got::Json(info) = client.next() else { panic!("no serverInfo") };
        assert_eq!((&info["op"], &info["capabilities"]), (&json!("serverInfo"), &json!([])));
        assert!(info["name"].as_str().unwrap().contains("simulated"), "{info}");
        let Got::Json(advertised) = client.next() else { panic!("no advertise") };
        assert_eq!(advertised["op"], "advertise");
        for channel in advertised["channels"].as_array().unwrap() {
            let text = |key: &str| channel[key].as_str().unwrap().to_owned();
            assert_eq!(
                (text("encoding"), text("schemaEncoding")),
                ("protobuf".into(), "protobuf".into())
            );
            let described = BASE64.decode(text("schema").as_bytes()).unwrap();
            let name = text("schemaName");
            let short = name.split('.').next_back().unwrap();
            assert!(described.windows(short.len()).any(|at| at == short.as_bytes()), "{name}");
            client.channels.insert(text("topic"), (channel["id"].as_u64().unwrap(), name));
        }
        client
    }

    fn say(&mut self, message: &Value) {
        self.socket.send(Message::text(message.to_string())).unwrap();
    }

    /// Subscribes a topic by this number.
    fn subscribe(&mut self, id: u32, topic: &str) {
        let channel = self.channels[topic].0;
        self.say(&json!({"op": "subscribe", "subscriptions": [{"id": id, "channelId": channel}]}));
    }

    fn next(&mut self) -> Got {
        loop {
            match self.socket.read() {
                Ok(Message::Text(text)) => return Got::Json(serde_json::from_str(&text).unwrap()),
                Ok(Message::Binary(data)) => {
                    assert_eq!(data[0], 1, "an operation that is not message data");
                    let id = u32::from_le_bytes(data[1..5].try_into().unwrap());
                    let time_ns = u64::from_le_bytes(data[5..13].try_into().unwrap());
                    return Got::Data { id, time_ns, payload: data[13..].to_vec() };
                }
                Ok(Message::Close(frame)) => {
                    return Got::Closed(frame.map(|frame| frame.code.into()));
                }
                Ok(_) => {}
                Err(_) => return Got::Closed(None),
            }
        }
    }

    /// The next message of this subscription.
    #[track_caller]
    fn data(&mut self, of: u32) -> (u64, Vec<u8>) {
        loop {
            match self.next() {
                Got::Data { id, time_ns, payload } if id == of => return (time_ns, payload),
                Got::Data { .. } => {}
                got => panic!("{got:?} instead of data of {of}"),
            }
        }
    }
}

/// A picture of this number, whose pixels go below black and above white.
fn picture(number: u64) -> Arc<Picture> {
    let counts = (0..1024).map(|pixel| (pixel + number as usize) as f32 / 300.0 - 0.2).collect();
    let enhanced = (0..4096).map(|pixel| pixel as f32 / 4096.0).collect();
    Arc::new(Picture::of_counts(number, counts, Some(enhanced)))
}

impl Paper {
    fn show(&self, picture: &Arc<Picture>) {
        let picture = Some(Arc::clone(picture));
        self.publish.send_replace(Arc::new(Published { picture, ..Published::default() }));
    }

    fn counts(&self) -> (usize, u64, u64) {
        self.shared.foxglove.as_ref().unwrap().counts()
    }
}

#[test]
fn a_viewer_gets_the_images_of_the_page_and_what_a_recording_has() {
    let paper = Paper::new();
    let mut client = Client::open(&paper);
    let topics: Vec<&str> = client.channels.keys().map(String::as_str).collect();
    assert_eq!(topics, ["/calibration", "/depth", "/enhanced", "/image", "/log", "/telemetry"]);
    assert_eq!(client.channels["/enhanced"].1, "foxglove.RawImage");

    let first = picture(1);
    paper.show(&first);
    client.subscribe(7, "/image");
    let time_ns = first.arrived_unix_ms * 1_000_000;
    let shares = first.shares_of_white();
    assert!(shares.contains(&0.0) && shares.contains(&1.0));
    let expected = (time_ns, schemas::raw_image(time_ns, 32, &shares));
    assert_eq!(client.data(7), expected, "an image that was there before the viewer");
    let second = picture(2);
    client.subscribe(8, "/enhanced");
    let enhanced = |of: &Picture| {
        let time_ns = of.arrived_unix_ms * 1_000_000;
        (time_ns, schemas::raw_image(time_ns, 64, of.enhanced.as_ref().unwrap()))
    };
    assert_eq!(client.data(8), enhanced(&first));
    paper.show(&second);
    assert_eq!(client.data(8), enhanced(&second));

    client.subscribe(9, "/calibration");
    let (time_ns, payload) = client.data(9);
    assert_eq!(payload, pinhole().encode(time_ns));
    client.subscribe(10, "/telemetry");
    let (time_ns, payload) = client.data(10);
    assert_eq!(payload, schemas::Telemetry::default().encode(time_ns));
    // Lines of before and of now.
    client.subscribe(11, "/log");
    let line = |got: (u64, Vec<u8>), level, text: &str| {
        assert_eq!(got.1, schemas::log(got.0, level, text));
    };
    let connected = lock(&paper.shared.camera).events()[0].text.clone();
    line(client.data(11), Level::Info, &connected);
    lock(&paper.shared.camera).event(Level::Error, "the roof is on fire".to_owned());
    paper.show(&second);
    line(client.data(11), Level::Error, "the roof is on fire");

    // Nothing more of a subscription that has ended.
    client.say(&json!({"op": "unsubscribe", "subscriptionIds": [8, 10, 11]}));
    client.subscribe(12, "/enhanced");
    assert_eq!(client.data(12), enhanced(&second));
    paper.show(&picture(3));
    for _ in 0..2 {
        let Got::Data { id, .. } = client.next() else { panic!("no data") };
        assert!([7, 12].contains(&id), "{id}");
    }
    paper.end();
}

#[test]
fn a_viewer_that_does_not_read_delays_nothing_and_its_missed_images_are_counted() {
    // Larger together than the buffers of common systems.
    const LAST: u64 = 400;
    let paper = Paper::new();
    let (mut idle, mut keen) = (Client::open(&paper), Client::open(&paper));
    paper.show(&picture(1));
    for client in [&mut idle, &mut keen] {
        client.subscribe(1, "/enhanced");
        client.data(1);
    }
    let mut browser = paper.browser();
    until("seen by all", || paper.shared.viewers() == 1 && paper.counts().0 == 2);
    for number in 2..=LAST {
        let picture = Some(picture(number));
        let message = number.to_string();
        paper.publish.send_replace(Arc::new(Published {
            picture,
            message,
            ..Published::default()
        }));
        keen.data(1);
        assert_eq!(browser.next(), Some(number as usize));
    }
    // The keen viewer has all. The idle viewer has what its buffers hold, and after it has read again,
    // the newest.
    std::thread::sleep(Duration::from_millis(5));
    let newest = picture(LAST + 1);
    paper.show(&newest);
    let time_ns = newest.arrived_unix_ms * 1_000_000;
    let mut got = 2;
    while idle.data(1).0 < time_ns {
        got += 1;
    }
    keen.data(1);
    until("counted", || paper.counts().1 == LAST + 1 + got);
    assert!(got < LAST / 2, "{got} of {LAST}");
    assert_eq!(paper.counts().2, LAST + 1 - got);
    // A viewer that goes away without a word is gone.
    drop(idle);
    until("gone", || paper.counts().0 == 1);
    paper.end();
}

#[test]
fn bad_input_closes_the_viewer_that_sent_it_and_no_other() {
    let paper = Paper::new();
    let mut good = Client::open(&paper);
    good.subscribe(1, "/image");
    let long =
        json!({"op": "subscribe", "subscriptions": [], "more": "x".repeat(1 << 15)}).to_string();
    let bad = [
        (Message::text("subscribe"), Some(1007)),
        (Message::text("[]"), Some(1007)),
        (Message::text(r#"{"op": 1}"#), Some(1007)),
        (Message::text(r#"{"op": "subscribe"}"#), Some(1007)),
        (
            Message::text(r#"{"op": "subscribe", "subscriptions": [{"id": -1, "channelId": 1}]}"#),
            Some(1007),
        ),
        (Message::text(r#"{"op": "unsubscribe", "subscriptionIds": "all"}"#), Some(1007)),
        (Message::binary(vec![1, 0, 0, 0, 0, 7]), Some(1003)),
        (Message::text(long), Some(1002)),
    ];
    for (number, (message, code)) in bad.into_iter().enumerate() {
        let mut client = Client::open(&paper);
        client.socket.send(message.clone()).unwrap();
        let mut told = None;
        let closed = loop {
            match client.next() {
                Got::Json(status) => told = Some(status),
                Got::Closed(closed) => break closed,
                Got::Data { .. } => {}
            }
        };
        assert_eq!(closed, code, "{message:?}");
        assert_eq!(told.unwrap()["level"], 2, "{message:?}");
        paper.show(&picture(number as u64 + 1));
        good.data(1);
    }
    // Bytes that are no frame of WebSocket.
    let mut client = Client::open(&paper);
    client.socket.get_mut().write_all(&[0xff; 64]).unwrap();
    while !matches!(client.next(), Got::Closed(_)) {}
    until("gone", || paper.counts().0 == 1);
    paper.show(&picture(100));
    good.data(1);
    paper.end();
}

#[test]
fn a_channel_has_one_subscription_and_unknown_wishes_are_answered() {
    let mut viewer = Viewer::default();
    let image = Channel::Image as u32 + 1;
    let subscribe = |id: u32, channel: u32| {
        json!({"op": "subscribe", "subscriptions": [{"id": id, "channelId": channel}]}).to_string()
    };
    let mut told = |text: &str| viewer.asked(text).unwrap().join(" ");
    assert_eq!(told(&subscribe(1, image)), "");
    assert!(told(&subscribe(2, image)).contains("/image is subscribed already"));
    assert!(told(&subscribe(1, image + 1)).contains("subscribed already"));
    assert!(told(&subscribe(3, 99)).contains("there is no channel 99"));
    let asked = r#"{"op": "setParameters", "parameters": []}"#;
    assert!(told(asked).contains("does not offer \\\"setParameters\\\""), "{}", told(asked));
    assert_eq!(told(r#"{"op": "unsubscribe", "subscriptionIds": [1, 5]}"#), "");
    assert_eq!(told(&subscribe(2, image)), "");
    let many = vec![json!({"id": 9, "channelId": 99}); 1000];
    let many = json!({"op": "subscribe", "subscriptions": many}).to_string();
    assert!(viewer.asked(&many).unwrap().len() < 20);
}

#[test]
fn a_viewer_without_token_subprotocol_or_room_is_refused_in_one_line() {
    let paper = Paper::with_token(Some("a-token-of-someone_7".parse().unwrap()));
    let plain = paper.foxglove.split('?').next().unwrap();
    assert_eq!(paper.foxglove, format!("{plain}?token=a-token-of-someone_7"));
    let v1 = ("sec-websocket-protocol", SUBPROTOCOL);
    let refused = |url: &str, headers: &[(&'static str, &'static str)], status, words: &str| {
        let (found, text) = connect(url, headers).err().unwrap();
        assert_eq!((found, text.lines().count()), (status, 1), "{text}");
        assert!(text.contains(words), "{text}");
    };
    refused(plain, &[v1], 401, "needs its token");
    refused(&paper.foxglove, &[], 400, "expected foxglove.sdk.v1 or foxglove.websocket.v1");
    let newer = ("sec-websocket-protocol", "foxglove.sdk.v2");
    refused(&paper.foxglove, &[newer], 400, "no subprotocol");
    let foreign = ("origin", "https://viewer.example");
    refused(plain, &[v1, foreign], 403, "page of an unknown site");
    let sdk = ("sec-websocket-protocol", "foxglove.sdk.v1.1, foxglove.sdk.v1");
    let mut open = vec![connect(&paper.foxglove, &[sdk, foreign]).unwrap()];
    while open.len() < crate::serve::connections::STREAMS_OF_CLIENT {
        open.push(connect(&paper.foxglove, &[v1]).unwrap());
    }
    refused(&paper.foxglove, &[v1], 503, "too many pages and viewers");
    paper.end();
}
