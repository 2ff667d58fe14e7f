//! The live camera for Foxglove, Lichtblick and other viewers, over the Foxglove WebSocket protocol.
//!
//! The channels have the schemas and the encoders of recordings (`recording/schemas.rs`), so a viewer
//! shows a live camera as it shows an exported file. A viewer can look at the camera and change
//! nothing.
//!
//! The WebSocket is that of the web server (`axum` with `tungstenite`): eight crates that the program
//! had not. The official crate `foxglove` 0.30.3 would be 26, with a second server of its own. That
//! server has no token, no limit of connections and no check of a page's origin, and it refuses
//! `foxglove.websocket.v1`, which Lichtblick speaks.
//!
//! # Invariant
//! A viewer receives the newest images only after its connection has taken the images before. A slow
//! or dead viewer therefore delays neither the camera nor a page. The images that a viewer missed are
//! counted (`a_viewer_that_does_not_read_delays_nothing_and_its_missed_images_are_counted` in
//! `host/src/serve/tests/foxglove.rs`). Bad input closes the viewer that sent it and no other
//! (`bad_input_closes_the_viewer_that_sent_it_and_no_other`).

mod messages;
pub mod viewer;

use super::connections::{Peer, Streaming};
use super::http::{App, line};
use super::{Shared, guard, lock};
use crate::clock;
use crate::recording::Pinhole;
use axum::Router;
use axum::extract::ws::rejection::WebSocketUpgradeRejection;
use axum::extract::ws::{CloseFrame, Message, WebSocket, WebSocketUpgrade};
use axum::extract::{ConnectInfo, State};
use axum::http::{HeaderMap, StatusCode, Uri};
use axum::response::Response;
use axum::routing::get;
use futures_util::future::{Either, select};
use messages::Refused;
use std::ops::ControlFlow;
use std::pin::pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::time::Duration;
use tokio::time::{Instant, timeout};
use viewer::Viewer;

/// Time between two pings. A connection to which nothing is written counts as stalled after 2 s.
const PING: Duration = Duration::from_secs(1);
/// A viewer that answers no ping for this long is gone. The answer of a slow connection comes after the
/// images that the system holds for the connection.
const UNANSWERED: Duration = Duration::from_secs(30);
/// The most bytes of a viewer's message.
const MAX_MESSAGE: usize = 1 << 14;
/// Bytes that are read at once.
const READ: usize = 1 << 12;

/// What viewers get beside images, and how many images they got.
#[derive(Debug)]
pub struct Foxglove {
    pinhole: Pinhole,
    /// Tells this start of the program from others.
    session: u128,
    viewers: AtomicUsize,
    sent: AtomicU64,
    dropped: AtomicU64,
}

impl Foxglove {
    /// No viewers yet of a camera with this geometry.
    pub fn new(pinhole: Pinhole) -> Self {
        let session = clock::since_1970().as_nanos();
        let (viewers, sent, dropped) = Default::default();
        Self { pinhole, session, viewers, sent, dropped }
    }

    /// The numbers for scripts: viewers, images sent, and images made and not sent.
    pub fn counts(&self) -> (usize, u64, u64) {
        let count = |of: &AtomicU64| of.load(Ordering::Relaxed);
        (self.viewers.load(Ordering::Relaxed), count(&self.sent), count(&self.dropped))
    }
}

/// The routes of the server for viewers.
pub fn routes(app: App) -> Router {
    Router::new().route("/", get(open)).with_state(app)
}

/// Opens a connection of a viewer.
async fn open(
    State(app): State<App>,
    ConnectInfo(peer): ConnectInfo<Peer>,
    headers: HeaderMap,
    uri: Uri,
    upgrade: Result<WebSocketUpgrade, WebSocketUpgradeRejection>,
) -> Response {
    let token = app.token.as_ref().map(|token| token.is_in(&headers, &uri, app.listen.port()));
    if let Err(refused) = guard::check_viewer(&headers, app.listen, token == Some(true)) {
        return line(StatusCode::FORBIDDEN, &refused);
    }
    if token == Some(false) {
        let words = "this camera needs its token: open the ws:// address that nirspi serve printed";
        return line(StatusCode::UNAUTHORIZED, &words);
    }
    let Ok(upgrade) = upgrade else {
        let words = "this address is for Foxglove and Lichtblick: open a connection of the kind Foxglove WebSocket there";
        return line(StatusCode::UPGRADE_REQUIRED, &words);
    };
    let upgrade = upgrade.protocols(messages::SUBPROTOCOLS);
    if upgrade.selected_protocol().is_none() {
        let known = messages::SUBPROTOCOLS.join(" or ");
        let words = format!("no subprotocol that this server speaks, expected {known}");
        return line(StatusCode::BAD_REQUEST, &words);
    }
    let Some(streaming) = peer.stream() else {
        let words = "too many pages and viewers are open: close one, then open this one again";
        return line(StatusCode::SERVICE_UNAVAILABLE, &words);
    };
    let upgrade = upgrade.max_message_size(MAX_MESSAGE).max_frame_size(MAX_MESSAGE);
    upgrade.read_buffer_size(READ).on_upgrade(move |socket| attend(socket, app, streaming))
}

/// Counts a viewer for as long as its connection is open.
struct Counted<'f>(&'f Foxglove);

impl<'f> Counted<'f> {
    fn new(foxglove: &'f Foxglove) -> Self {
        foxglove.viewers.fetch_add(1, Ordering::Relaxed);
        Self(foxglove)
    }
}

impl Drop for Counted<'_> {
    fn drop(&mut self) {
        self.0.viewers.fetch_sub(1, Ordering::Relaxed);
    }
}

/// Serves one viewer until its connection ends.
async fn attend(mut socket: WebSocket, app: App, streaming: Streaming) {
    let shared = Arc::clone(&app.shared);
    let Some(foxglove) = &shared.foxglove else { return };
    let _counted = Counted::new(foxglove);
    let (mut viewer, published) = (Viewer::default(), app.published.clone());
    let ended = talk(&mut socket, app, foxglove, &mut viewer).await;
    // What the viewer would have got next is lost.
    let picture = published.borrow().picture.clone();
    let lost = viewer.news(&shared, foxglove.pinhole, picture.as_deref());
    foxglove.dropped.fetch_add(lost.images + lost.missed, Ordering::Relaxed);
    if let Err(Some(refused)) = ended {
        // A connection that takes no more is closed all the same.
        let _ = socket.send(Message::text(messages::status(messages::ERROR, &refused))).await;
        let reason = messages::reason(&refused).into();
        let _ =
            socket.send(Message::Close(Some(CloseFrame { code: refused.code(), reason }))).await;
    }
    drop(streaming);
}

/// What a viewer's task wakes up for.
enum Woken {
    Heard(Option<Result<Message, axum::Error>>),
    /// Whether the server goes on.
    News(bool),
    Quiet,
}

/// Talks with a viewer.
///
/// # Errors
/// When the connection must end, and why if the viewer should know.
async fn talk(
    socket: &mut WebSocket,
    app: App,
    foxglove: &Foxglove,
    viewer: &mut Viewer,
) -> Result<(), Option<Refused>> {
    let App { shared, mut published, .. } = app;
    let name = lock(&shared.camera).name();
    send(socket, Message::text(messages::server_info(&name, foxglove.session))).await?;
    send(socket, Message::text(messages::advertise())).await?;
    let (mut pinged, mut heard) = (Instant::now(), Instant::now());
    loop {
        let picture = published.borrow_and_update().picture.clone();
        let news = viewer.news(&shared, foxglove.pinhole, picture.as_deref());
        foxglove.dropped.fetch_add(news.missed, Ordering::Relaxed);
        for message in news.messages {
            if let Err(ended) = send(socket, Message::Binary(message.into())).await {
                foxglove.dropped.fetch_add(news.images, Ordering::Relaxed);
                return Err(ended);
            }
        }
        foxglove.sent.fetch_add(news.images, Ordering::Relaxed);
        if pinged.elapsed() >= PING {
            pinged = Instant::now();
            send(socket, Message::Ping(Vec::new().into())).await?;
        }
        let woken = {
            let next = pin!(socket.recv());
            let changed = pin!(published.changed());
            match timeout(PING, select(next, changed)).await {
                Ok(Either::Left((message, _))) => Woken::Heard(message),
                Ok(Either::Right((changed, _))) => Woken::News(changed.is_ok()),
                Err(_) => Woken::Quiet,
            }
        };
        match woken {
            Woken::Heard(message) => {
                heard = Instant::now();
                if let ControlFlow::Break(()) = answer(socket, viewer, message).await? {
                    return Ok(());
                }
            }
            Woken::News(true) | Woken::Quiet => {}
            Woken::News(false) => return Ok(()),
        }
        if heard.elapsed() > UNANSWERED {
            return Err(Some(Refused::Silent));
        }
    }
}

/// Answers a viewer's message. Breaks if the viewer has gone.
async fn answer(
    socket: &mut WebSocket,
    viewer: &mut Viewer,
    message: Option<Result<Message, axum::Error>>,
) -> Result<ControlFlow<()>, Option<Refused>> {
    match message {
        None | Some(Ok(Message::Close(_))) => return Ok(ControlFlow::Break(())),
        Some(Err(error)) => return Err(Some(Refused::Form(error.to_string()))),
        Some(Ok(Message::Binary(_))) => return Err(Some(Refused::Binary)),
        Some(Ok(Message::Ping(_) | Message::Pong(_))) => {}
        Some(Ok(Message::Text(text))) => {
            for told in viewer.asked(&text)? {
                send(socket, Message::text(told)).await?;
            }
        }
    }
    Ok(ControlFlow::Continue(()))
}

/// Hands a message to the connection, when the connection has taken the messages before.
async fn send(socket: &mut WebSocket, message: Message) -> Result<(), Option<Refused>> {
    socket.send(message).await.map_err(|_| None)
}
