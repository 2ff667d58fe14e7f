//! HTTP: the page, the stream of states to each browser, and the interface for scripts.
//!
//! # Invariant
//! A browser receives the newest state only after it has taken the state before. A slow or dead
//! browser therefore delays no other part and uses the memory of one state
//! (`a_browser_that_does_not_read_costs_nobody_and_then_sees_the_newest` in
//! `host/src/serve/tests.rs`).

use super::settings::Change;
use super::state::Published;
use super::{Shared, guard, lock, page};
use crate::files::image::encode_grey;
use axum::body::Bytes;
use axum::extract::{DefaultBodyLimit, Request, State};
use axum::http::{HeaderName, HeaderValue, StatusCode, header};
use axum::middleware::{Next, from_fn_with_state};
use axum::response::sse::{Event, Sse};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use axum::serve::ListenerExt;
use axum::{Router, serve};
use futures_util::stream::{Stream, unfold};
use nirspi_nets::{deblur, fusion};
use serde::Serialize;
use std::convert::Infallible;
use std::io;
use std::net::{SocketAddr, TcpListener};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;
use tokio::sync::watch;

/// Time between two checks whether the server stops.
const TICK: Duration = Duration::from_millis(50);
/// The most bytes of a settings message.
const MAX_CHANGE_BYTES: usize = 4096;

/// Security headers for every response: no external content, no framing, no caching.
const HEADERS: [(HeaderName, &str); 5] = [
    (
        header::CONTENT_SECURITY_POLICY,
        "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src data: blob:; base-uri 'none'; \
         form-action 'none'; frame-ancestors 'none'",
    ),
    (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
    (header::REFERRER_POLICY, "no-referrer"),
    (HeaderName::from_static("cross-origin-resource-policy"), "same-origin"),
    (header::CACHE_CONTROL, "no-store"),
];

#[derive(Clone)]
struct App {
    shared: Arc<Shared>,
    published: watch::Receiver<Arc<Published>>,
    listen: SocketAddr,
}

/// Serves until `is_over`. Open requests are then cut off, because the page detects the end of the
/// server by the closed connection.
pub fn run(
    listener: TcpListener,
    shared: Arc<Shared>,
    published: watch::Receiver<Arc<Published>>,
    is_over: impl Fn() -> bool,
) -> io::Result<()> {
    let app = App { shared, published, listen: listener.local_addr()? };
    let router = Router::new()
        .merge(page::routes())
        .route("/events", get(events))
        .route("/api/state", get(state))
        .route("/api/settings", post(settings))
        .route("/api/stop", post(stop))
        .route("/api/start", post(start))
        .route("/image.png", get(image))
        .route("/enhanced.png", get(enhanced))
        .fallback(nothing_there)
        .layer(DefaultBodyLimit::max(MAX_CHANGE_BYTES))
        .layer(from_fn_with_state(app.clone(), only_ours))
        .with_state(app);
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    listener.set_nonblocking(true)?;
    runtime.block_on(async move {
        let listener = tokio::net::TcpListener::from_std(listener)?.tap_io(|stream| {
            // A socket that cannot set the option works with more delay.
            let _ = stream.set_nodelay(true);
        });
        let serving = tokio::spawn(async move { serve(listener, router).await });
        while !is_over() && !serving.is_finished() {
            tokio::time::sleep(TICK).await;
        }
        if serving.is_finished() {
            return serving.await.map_err(io::Error::other)?;
        }
        Ok(())
    })
}

/// Refuses every request that [`guard`] refuses, before any other handler.
async fn only_ours(State(app): State<App>, request: Request, next: Next) -> Response {
    let mut response = match guard::check(request.headers(), app.listen) {
        Ok(()) => next.run(request).await,
        Err(refused) => line(StatusCode::FORBIDDEN, &refused),
    };
    for (name, value) in HEADERS {
        response.headers_mut().insert(name, HeaderValue::from_static(value));
    }
    response
}

/// A response of one line.
fn line(status: StatusCode, text: &impl ToString) -> Response {
    (status, format!("{}\n", text.to_string())).into_response()
}

async fn nothing_there() -> Response {
    let there = "nothing there, expected /, /events, /api/state, /api/settings, /api/stop, /api/start, \
                 /image.png or /enhanced.png";
    line(StatusCode::NOT_FOUND, &there)
}

fn json(text: String) -> Response {
    ([(header::CONTENT_TYPE, "application/json")], text).into_response()
}

async fn state(State(app): State<App>) -> Response {
    match app.published.borrow().state.as_str() {
        "" => line(StatusCode::SERVICE_UNAVAILABLE, &"nothing has happened yet, ask again"),
        state => json(format!("{state}\n")),
    }
}

async fn image(State(app): State<App>) -> Response {
    let picture = app.published.borrow().picture.clone();
    png(fusion::SIDE, picture.as_ref().map(|picture| picture.image.as_slice()))
}

async fn enhanced(State(app): State<App>) -> Response {
    let picture = app.published.borrow().picture.clone();
    png(deblur::SIDE, picture.as_ref().and_then(|picture| picture.enhanced.as_deref()))
}

fn png(side: usize, pixels: Option<&[f32]>) -> Response {
    match pixels {
        None => line(StatusCode::SERVICE_UNAVAILABLE, &"there is no such image now"),
        Some(pixels) => {
            ([(header::CONTENT_TYPE, "image/png")], encode_grey(side, side, pixels)).into_response()
        }
    }
}

/// Applies a change, and answers with the new settings.
async fn settings(State(app): State<App>, body: Bytes) -> Response {
    let shared = &app.shared;
    let mut settings = lock(&shared.settings);
    let changed = Change::parse(&body).and_then(|change| {
        let settings = settings.with(&change, &shared.methods)?;
        Ok((settings, change.run))
    });
    match changed {
        Err(error) => line(StatusCode::BAD_REQUEST, &error),
        Ok((changed, run)) => {
            *settings = changed;
            drop(settings);
            if let Some(on) = run {
                shared.light.set(on);
            }
            shared.slot.wake();
            answer(&changed)
        }
    }
}

/// Switches the LEDs off. The request needs no body, so nothing in it can be refused.
async fn stop(State(app): State<App>) -> Response {
    switch(&app.shared, false)
}

/// Allows the LEDs to go on.
async fn start(State(app): State<App>) -> Response {
    switch(&app.shared, true)
}

/// The answer to a command for the LEDs.
#[derive(Serialize)]
struct Switched {
    /// Whether light is allowed now.
    run: bool,
    /// The number of this command; later commands have larger numbers.
    command: u64,
}

fn switch(shared: &Shared, on: bool) -> Response {
    let command = shared.light.set(on);
    shared.slot.wake();
    answer(&Switched { run: on, command })
}

fn answer(value: &impl Serialize) -> Response {
    match serde_json::to_string(value) {
        Ok(text) => json(format!("{text}\n")),
        Err(error) => line(StatusCode::INTERNAL_SERVER_ERROR, &error),
    }
}

/// Counts a page for as long as the page is connected.
struct Viewer(Arc<Shared>);

impl Viewer {
    fn new(shared: Arc<Shared>) -> Self {
        shared.viewers.fetch_add(1, Ordering::Relaxed);
        Self(shared)
    }
}

impl Drop for Viewer {
    fn drop(&mut self) {
        self.0.viewers.fetch_sub(1, Ordering::Relaxed);
    }
}

async fn events(State(app): State<App>) -> Sse<impl Stream<Item = Result<Event, Infallible>>> {
    let mut published = app.published;
    // The first message is the current state.
    published.mark_changed();
    let viewer = Viewer::new(app.shared);
    Sse::new(unfold((published, viewer), |(mut published, viewer)| async move {
        loop {
            // The receiver fails when the server stops.
            published.changed().await.ok()?;
            let moment = Arc::clone(&published.borrow_and_update());
            if !moment.message.is_empty() {
                return Some((Ok(Event::default().data(&moment.message)), (published, viewer)));
            }
        }
    }))
}
