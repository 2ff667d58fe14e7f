//! HTTP: the page, the stream of states to each browser, and the interface for scripts.
//!
//! # Invariant
//! A browser receives the newest state only after its connection has taken the state before. A slow or dead
//! browser therefore delays no other part and uses the memory of one state
//! (`a_browser_that_does_not_read_delays_no_other_and_then_sees_the_newest` and
//! `a_slow_browser_has_few_old_images_before_it` in `host/serve/src/tests.rs`).

use super::access::Access;
use super::change_rate::PER_SECOND;
use super::connections::{Connections, Door, Peer, Streaming};
use super::delays::Passed;
use super::picture::Picture;
use super::server::Server;
use super::state::Published;
use super::token;
use super::{Shared, commands, guard, lock, page};
use axum::Router;
use axum::body::Bytes;
use axum::extract::{ConnectInfo, DefaultBodyLimit, Request, State};
use axum::http::{HeaderName, HeaderValue, Method, StatusCode, Uri, header};
use axum::middleware::{Next, from_fn_with_state};
use axum::response::sse::{Event, Sse};
use axum::response::{IntoResponse, Redirect, Response};
use axum::routing::{get, post};
use axum::serve;
use futures_util::stream::{Stream, unfold};
use nirspi::causes::printable;
use nirspi::files::image::encode_grey;
use nirspi::files::npy;
use nirspi::provenance::Made;
use nirspi_nets::deblur;
use serde::Serialize;
use std::convert::Infallible;
use std::io;
use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;
use tokio::sync::watch;
use tokio::task::JoinHandle;

/// Time between two checks whether the server stops.
const TICK: Duration = Duration::from_millis(50);
/// The most bytes of a settings message.
const MAX_CHANGE_BYTES: usize = 4096;
/// The most bytes of a message with a scene.
const MAX_SCENE_BYTES: usize = 1 << 16;
/// The longest wait for a new state.
const PATIENCE: Duration = Duration::from_secs(1);
/// The header with the age of a state in milliseconds.
const AGE: HeaderName = HeaderName::from_static("state-age-ms");
/// The path of messages with scenes.
const SCENE: &str = "/api/scene";
/// The path of messages that switch the light off.
const STOP: &str = "/api/stop";
/// Tells a reverse proxy (nginx) to hand each state on at once. Else it would keep old states for a slow browser.
const UNBUFFERED: (HeaderName, &str) = (HeaderName::from_static("x-accel-buffering"), "no");

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

/// What the handlers use.
#[derive(Clone)]
struct App {
    shared: Arc<Shared>,
    published: watch::Receiver<Arc<Published>>,
    listen: SocketAddr,
    access: Access,
    made: Made,
}

/// Serves until `is_over`. Open requests are then cut off, because the page detects the end of the
/// server by the closed connection.
pub fn run(
    server: Server,
    shared: Arc<Shared>,
    published: watch::Receiver<Arc<Published>>,
    is_over: impl Fn() -> bool,
) -> io::Result<()> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    runtime.block_on(async move {
        let serving = begin(server, shared, published)?;
        loop {
            if serving.is_finished() {
                return serving.await.map_err(io::Error::other)?;
            }
            if is_over() {
                return Ok(());
            }
            tokio::time::sleep(TICK).await;
        }
    })
}

/// Begins to serve on the runtime of this thread.
pub(super) fn begin(
    server: Server,
    shared: Arc<Shared>,
    published: watch::Receiver<Arc<Published>>,
) -> io::Result<JoinHandle<io::Result<()>>> {
    let Server { listener, access, made, address: listen } = server;
    listener.set_nonblocking(true)?;
    let listener = tokio::net::TcpListener::from_std(listener)?;
    let door = Door::new(listener, Connections::default());
    let router = routes(App { shared, published, listen, access, made });
    let service = router.into_make_service_with_connect_info::<Peer>();
    Ok(tokio::spawn(async move { serve(door, service).await }))
}

/// The page and its interface for scripts, all below the base path.
fn routes(app: App) -> Router {
    let base = app.access.base_path.clone();
    let answers = [
        ("/events", get(events)),
        ("/api/next", get(next_state)),
        ("/api/state", get(state)),
        ("/api/settings", post(settings)),
        (STOP, post(stop)),
        ("/api/start", post(start)),
        (SCENE, post(scene).layer(DefaultBodyLimit::max(MAX_SCENE_BYTES))),
        ("/image.png", get(image)),
        ("/enhanced.png", get(enhanced)),
        ("/image.npy", get(image_numbers)),
        ("/enhanced.npy", get(enhanced_numbers)),
    ];
    let router = answers
        .into_iter()
        .chain(page::routes())
        .fold(Router::new(), |router, (path, answer)| router.route(&base.before(path), answer));
    // The page's own addresses count from its last '/'.
    let router = match base.named() {
        Some(path) => router.route(path, get(to_the_page)),
        None => router,
    };
    router
        .fallback(nothing_there)
        .layer(DefaultBodyLimit::max(MAX_CHANGE_BYTES))
        .layer(from_fn_with_state(app.clone(), only_ours))
        .with_state(app)
}

/// Refuses every request that [`guard`] refuses, that lacks the token, that announces too much, or
/// that is one of too many changes, before any other handler.
async fn only_ours(State(app): State<App>, request: Request, next: Next) -> Response {
    let mut response = match refused(&app, &request) {
        None => next.run(request).await,
        Some(response) => response,
    };
    for (name, value) in HEADERS {
        response.headers_mut().insert(name, HeaderValue::from_static(value));
    }
    response
}

/// The answer to a request that no handler may see.
fn refused(app: &App, request: &Request) -> Option<Response> {
    let (headers, uri) = (request.headers(), request.uri());
    let Access { token, names, base_path: base } = &app.access;
    if let Err(refused) = guard::check(request.method(), headers, app.listen, names) {
        return Some(line(StatusCode::FORBIDDEN, &refused));
    }
    let path = base.below(uri.path()).unwrap_or_default();
    if let Some(token) = token {
        let port = app.listen.port();
        if !token.is_in(headers, uri, port) {
            let words =
                "this camera's page needs its token: open the address that nirspi serve printed";
            return Some(line(StatusCode::UNAUTHORIZED, &words));
        }
        // The browser keeps the token as a cookie, and the address without the token.
        let is_page = path == "/" || base.named() == Some(uri.path());
        if request.method() == Method::GET && is_page && token::in_query(uri).is_some() {
            let cookie = [(header::SET_COOKIE, token.cookie(port, base))];
            return Some((cookie, Redirect::to(&base.relative(uri.path()))).into_response());
        }
    }
    let most = if path == SCENE { MAX_SCENE_BYTES } else { MAX_CHANGE_BYTES };
    let announced = headers.get(header::CONTENT_LENGTH).map(|value| value.to_str().map(str::parse));
    let fits = match announced {
        None => true,
        Some(length) => matches!(length, Ok(Ok::<u64, _>(length)) if length <= most as u64),
    };
    if !fits {
        let words = format!("the request has too long a body, expected at most {most} bytes");
        return Some(line(StatusCode::PAYLOAD_TOO_LARGE, &words));
    }
    let changes = request.method() == Method::POST && path != STOP;
    let peer = request.extensions().get::<ConnectInfo<Peer>>();
    if changes && !peer.is_some_and(|ConnectInfo(peer)| peer.may_change()) {
        let words = format!(
            "too many changes: at most {PER_SECOND} a second; the light can be switched off at any time"
        );
        return Some(line(StatusCode::TOO_MANY_REQUESTS, &words));
    }
    None
}

/// A response of one line, in which nothing of the request can steer a terminal.
fn line(status: StatusCode, text: &impl ToString) -> Response {
    (status, format!("{}\n", printable(&text.to_string()))).into_response()
}

async fn to_the_page(State(app): State<App>, uri: Uri) -> Redirect {
    Redirect::to(&app.access.base_path.relative(uri.path()))
}

async fn nothing_there(State(app): State<App>) -> Response {
    let place = match app.access.base_path.named() {
        Some(path) => format!("nothing there: everything is below {path}, there"),
        None => "nothing there,".to_owned(),
    };
    let there = "expected /, /events, /api/state, /api/next, /api/settings, /api/scene, /api/stop, \
                 /api/start, /image.png, /enhanced.png, /image.npy or /enhanced.npy";
    line(StatusCode::NOT_FOUND, &format!("{place} {there}"))
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

/// The newest state with its images, once its number is another than `seen` of the query, or after a second.
/// The page has the number `page`. Each page asks again and again, so that no page needs a connection of its own.
async fn next_state(State(app): State<App>, uri: Uri) -> Response {
    let mut published = app.published.clone();
    let given = |name: &str| {
        let mut pairs = uri.query().unwrap_or_default().split('&');
        pairs.find_map(|pair| pair.strip_prefix(name)?.strip_prefix('=')?.parse::<u64>().ok())
    };
    let seen = given("seen");
    let is_new =
        |moment: &Arc<Published>| !moment.message.is_empty() && Some(moment.number) != seen;
    // What there is after a second is the answer, and so it is when the server stops.
    let _ = tokio::time::timeout(PATIENCE, published.wait_for(is_new)).await;
    let moment = Arc::clone(&published.borrow());
    let Some(made) = moment.made else {
        return line(StatusCode::SERVICE_UNAVAILABLE, &"nothing has happened yet, ask again");
    };
    if let Some(page) = given("page") {
        let image = moment.picture.as_ref().map_or(0, |picture| picture.number);
        let is_new = lock(&app.shared.pages).gets(page, image, tokio::time::Instant::now());
        if let Some(picture) = moment.picture.as_ref().filter(|_| is_new) {
            app.shared.passed(Passed::Sent, picture.arrived);
        }
    }
    let age = [(AGE, made.elapsed().as_millis().to_string())];
    (age, [UNBUFFERED], json(moment.message.clone())).into_response()
}

/// Height and width of the enhanced image.
const ENHANCED: (usize, usize) = (deblur::SIDE, deblur::SIDE);

async fn image(State(app): State<App>) -> Response {
    let picture = app.published.borrow().picture.clone();
    let size = picture.as_ref().map_or((0, 0), |picture| (picture.height, picture.width));
    png(&app, size, picture.map(|picture| picture.shares_of_white()).as_deref())
}

async fn enhanced(State(app): State<App>) -> Response {
    let picture = app.published.borrow().picture.clone();
    png(&app, ENHANCED, picture.as_ref().and_then(|picture| picture.enhanced.as_deref()))
}

/// ADC counts.
async fn image_numbers(State(app): State<App>) -> Response {
    let picture = app.published.borrow().picture.clone();
    let size = picture.as_ref().map_or((0, 0), |picture| (picture.height, picture.width));
    numbers(size, picture.as_ref().map(|picture| picture.counts.as_slice()))
}

/// Shares of white.
async fn enhanced_numbers(State(app): State<App>) -> Response {
    let picture = app.published.borrow().picture.clone();
    numbers(ENHANCED, picture.as_ref().and_then(|picture| picture.enhanced.as_deref()))
}

fn no_image() -> Response {
    line(StatusCode::SERVICE_UNAVAILABLE, &"there is no such image now")
}

fn png(app: &App, (height, width): (usize, usize), pixels: Option<&[f32]>) -> Response {
    let Some(pixels) = pixels else { return no_image() };
    let provenance = lock(&app.shared.camera).camera.taken().made(&app.made);
    let png = encode_grey(height, width, pixels, &provenance);
    ([(header::CONTENT_TYPE, "image/png")], png).into_response()
}

fn numbers((height, width): (usize, usize), pixels: Option<&[f32]>) -> Response {
    let Some(pixels) = pixels else { return no_image() };
    let kind = [(header::CONTENT_TYPE, "application/octet-stream")];
    (kind, npy::encode(&[height, width], pixels)).into_response()
}

/// Applies a change, and answers with the new settings.
async fn settings(State(app): State<App>, body: Bytes) -> Response {
    answer(commands::settings(&app.shared, &body))
}

/// Changes the scene of a virtual camera.
async fn scene(State(app): State<App>, body: Bytes) -> Response {
    answer(commands::scene(&app.shared, &body))
}

/// Switches the LEDs off. The request needs no body, so nothing in it can be refused.
async fn stop(State(app): State<App>) -> Response {
    answer(Ok::<_, Infallible>(commands::switch(&app.shared, false)))
}

/// Allows the LEDs to go on.
async fn start(State(app): State<App>) -> Response {
    answer(Ok::<_, Infallible>(commands::switch(&app.shared, true)))
}

/// The answer to a command: what the command has set, or why the command is refused.
fn answer<E: ToString>(done: Result<impl Serialize, E>) -> Response {
    match done.map(|value| serde_json::to_string(&value)) {
        Ok(Ok(text)) => json(format!("{text}\n")),
        Ok(Err(error)) => line(StatusCode::INTERNAL_SERVER_ERROR, &error),
        Err(refused) => line(StatusCode::BAD_REQUEST, &refused),
    }
}

/// Counts a page for as long as the page is connected.
struct Viewer {
    shared: Arc<Shared>,
    streaming: Streaming,
    /// The bytes of the connection when the last state has been written.
    written: u64,
}

impl Viewer {
    fn new(shared: Arc<Shared>, streaming: Streaming) -> Self {
        shared.viewers.fetch_add(1, Ordering::Relaxed);
        Self { shared, streaming, written: 0 }
    }
}

impl Drop for Viewer {
    fn drop(&mut self) {
        self.shared.viewers.fetch_sub(1, Ordering::Relaxed);
    }
}

async fn events(State(app): State<App>, ConnectInfo(peer): ConnectInfo<Peer>) -> Response {
    let Some(streaming) = peer.stream() else {
        let words = "too many pages are open: close one, then open this one again";
        return line(StatusCode::SERVICE_UNAVAILABLE, &words);
    };
    ([UNBUFFERED], Sse::new(states(app.published, Viewer::new(app.shared, streaming))))
        .into_response()
}

/// The states for one page, each after the system has taken the one before for sending.
fn states(
    mut published: watch::Receiver<Arc<Published>>,
    viewer: Viewer,
) -> impl Stream<Item = Result<Event, Infallible>> {
    // The first message is the current state, whose image may be old.
    published.mark_changed();
    let first = published.borrow().picture.clone();
    unfold((published, viewer, first), |(mut published, mut viewer, before)| async move {
        viewer.streaming.has_written(viewer.written).await;
        loop {
            // The receiver fails when the server stops.
            published.changed().await.ok()?;
            let moment = Arc::clone(&published.borrow_and_update());
            if !moment.message.is_empty() {
                let picture = moment.picture.clone();
                if let Some(new) = picture.as_ref().filter(|new| !is_same(new, before.as_ref())) {
                    viewer.shared.passed(Passed::Sent, new.arrived);
                }
                // The frame of the message has some bytes more, which do not add up: a state that is
                // written whole ends with all bytes before it.
                viewer.written = viewer.streaming.written() + moment.message.len() as u64;
                let event = Event::default().data(&moment.message);
                return Some((Ok(event), (published, viewer, picture)));
            }
        }
    })
}

fn is_same(a: &Arc<Picture>, b: Option<&Arc<Picture>>) -> bool {
    b.is_some_and(|b| Arc::ptr_eq(a, b))
}
