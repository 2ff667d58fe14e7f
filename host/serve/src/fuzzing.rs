//! The servers of pages without a camera and without threads, for the search in
//! `tests/fuzz`: any bytes go in on a connection, and what the server says comes out.
//!
//! Compiled with `--cfg fuzzing` alone.

use super::camera_log::CameraLog;
use super::picture::Picture;
use super::settings::{Measuring, Offer, Settings};
use super::stage::{Stage, StagedScene};
use super::state::Published;
use super::{Access, Server, Shared, Token, http, lock};
use nirspi::identity::CameraIdentity;
use nirspi::scene::SceneSource;
use nirspi::setup::MeasurementSetup;
use nirspi_optics::rain::Air;
use nirspi_recon::Order;
use nirspi_recon::reconstruct::Method;
use std::net::{Ipv4Addr, SocketAddr};
use std::sync::Arc;
use std::time::Duration;
use tokio::net::{TcpSocket, TcpStream};
use tokio::runtime::Runtime;
use tokio::sync::watch;
use tokio::time::timeout;

/// The token of [`Place::Guarded`].
pub const TOKEN: &str = "fuzzing-0123456789abcdef";
/// Edge in pixels of the scene's map.
const SCENE_PX: usize = 64;
/// The longest time from the client's last byte to the end of the connection.
const PATIENCE: Duration = Duration::from_secs(5);
/// The most bytes that are taken of an answer.
const MOST: usize = 1 << 20;
/// An event stream goes on for as long as its client reads. This one reads no longer than this.
const STREAM: Duration = Duration::from_millis(5);
const IS_STREAM: &[u8] = b"text/event-stream";

/// Which server a client connects to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// The page on this machine, without a token.
    Page,
    /// The page that demands [`TOKEN`].
    Guarded,
}

/// Servers before a camera that never changes.
pub struct Still {
    runtime: Runtime,
    shared: Arc<Shared>,
    places: [SocketAddr; 2],
    /// Number of connections so far. Each comes from an address of its own, so that no client is
    /// slowed down for what others did.
    clients: u32,
    _publish: watch::Sender<Arc<Published>>,
}

/// A connection that does not end, or cannot be opened.
#[derive(Debug)]
pub struct Stuck(pub String);

impl Still {
    /// Servers at ports that the system chooses.
    ///
    /// # Panics
    /// If the system gives no ports.
    #[must_use]
    pub fn new(identity: &CameraIdentity) -> Self {
        let setup = MeasurementSetup::new(&Order::CakeCutting, 0.125).expect("a setup");
        let offer = Offer {
            methods: Method::ALL.iter().map(|method| method.argument()).collect(),
            models: vec!["diffusion", "gan"],
            base: Some(setup.clone()),
            ..Offer::default()
        };
        let settings = Settings {
            measuring: Measuring::of(&setup),
            ..Settings::new(Method::ALL[0], 8, &setup)
        };
        let letter = "letter:R".parse::<SceneSource>().expect("a scene");
        let air: Air = "none".parse().expect("clear air");
        let map = letter.load(SCENE_PX).expect("its map");
        let stage = Stage::of(Some(StagedScene { map, distance_m: 0.3, air }));
        let shared = Shared::new(CameraLog::new("fuzzing", identity), offer, settings, stage);
        let shared = Arc::new(shared);
        let picture = Picture::of_counts(1, vec![1.0; 1024], Some(vec![0.5; 4096]));
        let (publish, published) = watch::channel(Arc::new(Published {
            state: "{}".to_owned(),
            message: "{}".to_owned(),
            picture: Some(Arc::new(picture)),
            ..Published::default()
        }));
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
        let runtime = runtime.expect("a runtime");
        let made = nirspi::provenance::Made::by("fuzzing", None, ["fuzzing"], 0);
        let bind = |token| {
            let access = Access { token, ..Access::default() };
            Server::bind("127.0.0.1:0", access, &made).expect("a port")
        };
        let open = bind(None);
        let guarded = bind(Some(TOKEN.parse::<Token>().expect("a token")));
        let places = [open.address, guarded.address];
        runtime.block_on(async {
            for server in [open, guarded] {
                let begun = http::begin(server, Arc::clone(&shared), published.clone());
                drop(begun.expect("a listener"));
            }
        });
        Self { runtime, shared, places, clients: 0, _publish: publish }
    }

    /// Sends these bytes on a connection of its own and hangs up. Returns what the server said.
    ///
    /// # Errors
    /// If the server does not end the connection.
    pub fn ask(&mut self, place: Place, bytes: &[u8]) -> Result<Vec<u8>, Stuck> {
        self.clients = self.clients.wrapping_add(1);
        let [_, b, c, d] = self.clients.to_be_bytes();
        let client = Ipv4Addr::new(127, b, c, d.max(1));
        let server = self.places[place as usize];
        let stuck = |what: &str| Stuck(format!("{what} at {place:?}"));
        self.runtime.block_on(async {
            let talked = timeout(PATIENCE, talk(client, server, bytes)).await;
            talked
                .map_err(|_| stuck("the connection does not end"))?
                .map_err(|error| stuck(&error.to_string()))
        })
    }

    /// The settings now.
    #[must_use]
    pub fn settings(&self) -> Settings {
        lock(&self.shared.settings).clone()
    }

    /// Distance of the wanted scene in metres, and edge and levels of its map.
    #[must_use]
    pub fn scene(&self) -> (f64, usize, Vec<f32>) {
        let scene = self.shared.stage.wanted().expect("a virtual camera");
        (scene.distance_m, scene.map.size_px, scene.map.reflectance.clone())
    }
}

async fn talk(client: Ipv4Addr, server: SocketAddr, bytes: &[u8]) -> std::io::Result<Vec<u8>> {
    let socket = TcpSocket::new_v4()?;
    socket.set_reuseaddr(true)?;
    socket.bind((client, 0).into())?;
    let stream = socket.connect(server).await?;
    let mut rest = bytes;
    let mut heard = Vec::new();
    while !rest.is_empty() {
        stream.writable().await?;
        match stream.try_write(rest) {
            Ok(length) => rest = rest.get(length..).unwrap_or(&[]),
            Err(error) if error.kind() == std::io::ErrorKind::WouldBlock => {}
            // The server has closed the connection before the last byte.
            Err(_) => break,
        }
    }
    let _ = socket2::SockRef::from(&stream).shutdown(std::net::Shutdown::Write);
    hear(&stream, &mut heard).await;
    Ok(heard)
}

/// Reads to the end of the connection. Of an event stream, reads what comes at once.
async fn hear(stream: &TcpStream, heard: &mut Vec<u8>) {
    let mut room = [0; 1 << 14];
    while heard.len() < MOST {
        let streams = heard.windows(IS_STREAM.len()).any(|part| part == IS_STREAM);
        let readable = match streams {
            true => timeout(STREAM, stream.readable()).await.unwrap_or(Ok(())),
            false => stream.readable().await,
        };
        match stream.try_read(&mut room) {
            Ok(length @ 1..) => heard.extend_from_slice(room.get(..length).unwrap_or(&[])),
            Err(error) if error.kind() == std::io::ErrorKind::WouldBlock && !streams => {}
            _ => return,
        }
        if readable.is_err() {
            return;
        }
    }
}
