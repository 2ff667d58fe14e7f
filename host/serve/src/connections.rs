//! Limits of connections: how many, how many for one client, and how long a connection may do
//! nothing.
//!
//! One rule closes silent connections, half requests, and streams that are not read: a connection
//! to which nothing could be written for [`SILENT`] is closed. An open event stream gets a state
//! twice a second at least, so its connection stays open as long as its client reads.
//!
//! # Invariant
//! At most [`MOST`] connections are open, [`MOST_OF_CLIENT`] of one client, and [`STREAMS_OF_CLIENT`]
//! event streams of one client. A new connection takes the place of the oldest one without an event
//! stream, so connections that ask nothing keep no page away
//! (`tests::a_new_connection_takes_the_place_of_the_oldest_without_a_stream`,
//! `a_page_goes_on_among_hundreds_of_clients_that_misbehave` in `host/cli/tests/cli/serve_guarded.rs`).
//!
//! An event stream has one state in this program and [`SENDING`] bytes in the system that its client
//! has not taken, so a slow connection shows new images and not old ones
//! (`a_slow_browser_has_few_old_images_before_it` in `host/serve/src/tests.rs`).

use super::change_rate::ChangeRate;
use super::lock;
use axum::extract::connect_info::Connected;
use axum::serve::{IncomingStream, Listener};
use socket2::SockRef;
use std::collections::BTreeMap;
use std::fmt;
use std::future::Future;
use std::io;
use std::net::{IpAddr, Ipv6Addr, SocketAddr};
use std::pin::Pin;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::task::{Context, Poll};
use std::time::Duration;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{Notify, oneshot};
use tokio::time::{Instant, Sleep, sleep};

/// The most connections.
pub const MOST: usize = 128;
/// The most connections of one client.
pub const MOST_OF_CLIENT: usize = 48;
/// The most event streams.
pub const STREAMS: usize = 32;
/// The most event streams of one client.
pub const STREAMS_OF_CLIENT: usize = 16;
/// The longest time in which nothing could be written to an open connection.
pub const SILENT: Duration = Duration::from_secs(10);
/// An event stream that has taken nothing for this long gives its place to a new stream.
const STALLED: Duration = Duration::from_secs(2);
/// Bytes that the system keeps for sending. Linux doubles the number for its own needs.
const SENDING: usize = 128 << 10;
/// Time until the next attempt to accept a connection, if the system has no room for one.
const NO_ROOM: Duration = Duration::from_millis(100);

/// The address that counts as one client: an IPv4 address, or the network of an IPv6 address.
fn client(address: SocketAddr) -> IpAddr {
    match address.ip().to_canonical() {
        IpAddr::V6(ip) => {
            let [a, b, c, d, ..] = ip.segments();
            IpAddr::V6(Ipv6Addr::new(a, b, c, d, 0, 0, 0, 0))
        }
        ip => ip,
    }
}

/// An open connection, as the limits know it.
struct Entry {
    client: IpAddr,
    /// Closes the connection when dropped.
    _close: oneshot::Sender<()>,
    streams: bool,
    /// When bytes were last written.
    wrote: Instant,
}

/// All open connections by number. Later connections have larger numbers.
#[derive(Default)]
struct Table {
    entries: BTreeMap<u64, Entry>,
    next: u64,
    changes: ChangeRate,
}

impl Table {
    fn count(&self, is_counted: impl Fn(&Entry) -> bool) -> usize {
        self.entries.values().filter(|entry| is_counted(entry)).count()
    }

    /// Makes room for a connection of this client. Returns its number, or `None` if only event
    /// streams are open.
    fn admit(&mut self, client: IpAddr, close: oneshot::Sender<()>) -> Option<u64> {
        let own = self.count(|entry| entry.client == client) >= MOST_OF_CLIENT;
        if own || self.entries.len() >= MOST {
            let is_old = |entry: &Entry| !entry.streams && (!own || entry.client == client);
            let oldest = self.entries.iter().find(|(_, entry)| is_old(entry))?;
            let oldest = *oldest.0;
            self.entries.remove(&oldest);
        }
        let number = self.next;
        self.next += 1;
        let entry = Entry { client, _close: close, streams: false, wrote: Instant::now() };
        self.entries.insert(number, entry);
        Some(number)
    }

    /// Makes connection `number` an event stream. Returns `false` if there are too many that are
    /// read.
    fn stream(&mut self, number: u64) -> bool {
        let Some(client) = self.entries.get(&number).map(|entry| entry.client) else {
            return false;
        };
        let own = self.count(|entry| entry.streams && entry.client == client) >= STREAMS_OF_CLIENT;
        if own || self.count(|entry| entry.streams) >= STREAMS {
            let is_stalled = |entry: &Entry| {
                entry.streams && (!own || entry.client == client) && entry.wrote.elapsed() > STALLED
            };
            let mut stalled = self.entries.iter().filter(|(_, entry)| is_stalled(entry));
            let Some((&worst, _)) = stalled.by_ref().min_by_key(|(_, entry)| entry.wrote) else {
                return false;
            };
            self.entries.remove(&worst);
        }
        if let Some(entry) = self.entries.get_mut(&number) {
            entry.streams = true;
        }
        true
    }
}

/// All open connections.
#[derive(Clone, Default)]
pub struct Connections(Arc<Mutex<Table>>);

/// The number of bytes that the system has taken for a connection.
#[derive(Default)]
struct Written {
    bytes: AtomicU64,
    more: Notify,
}

/// One open connection, for handlers of its requests.
#[derive(Clone)]
pub struct Peer {
    connections: Connections,
    number: u64,
    written: Arc<Written>,
}

impl Peer {
    /// Makes the connection an event stream until the result is dropped; `None` if there are too
    /// many event streams.
    pub fn stream(&self) -> Option<Streaming> {
        lock(&self.connections.0).stream(self.number).then(|| Streaming(self.clone()))
    }

    /// Whether the client of this connection may change the camera now; counts the change.
    pub fn may_change(&self) -> bool {
        let table = &mut *lock(&self.connections.0);
        let entry = table.entries.get(&self.number);
        entry.is_some_and(|entry| table.changes.admit(entry.client, Instant::now().into_std()))
    }
}

impl fmt::Debug for Peer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "connection {}", self.number)
    }
}

/// An open event stream.
pub struct Streaming(Peer);

impl Streaming {
    /// Number of bytes that the system has taken so far.
    pub fn written(&self) -> u64 {
        self.0.written.bytes.load(Ordering::Relaxed)
    }

    /// Waits until the system has taken so many bytes.
    pub async fn has_written(&self, bytes: u64) {
        loop {
            let more = self.0.written.more.notified();
            if self.written() >= bytes {
                return;
            }
            more.await;
        }
    }
}

impl Drop for Streaming {
    fn drop(&mut self) {
        if let Some(entry) = lock(&self.0.connections.0).entries.get_mut(&self.0.number) {
            entry.streams = false;
        }
    }
}

/// Accepts connections within the limits.
pub struct Door {
    listener: TcpListener,
    connections: Connections,
}

impl Door {
    /// A door at this listener. The limits hold for all doors with the same connections together.
    pub fn new(listener: TcpListener, connections: Connections) -> Self {
        Self { listener, connections }
    }
}

impl Listener for Door {
    type Io = Guarded;
    type Addr = Peer;

    async fn accept(&mut self) -> (Guarded, Peer) {
        loop {
            let Ok((stream, address)) = self.listener.accept().await else {
                sleep(NO_ROOM).await;
                continue;
            };
            // A socket that cannot set the options works with more delay.
            let _ = stream.set_nodelay(true);
            let _ = SockRef::from(&stream).set_send_buffer_size(SENDING);
            let (close, closed) = oneshot::channel();
            let Some(number) = lock(&self.connections.0).admit(client(address), close) else {
                continue;
            };
            let written = Arc::default();
            let peer = Peer { connections: self.connections.clone(), number, written };
            let silent = Box::pin(sleep(SILENT));
            return (Guarded { stream, peer: peer.clone(), closed, silent, ended: false }, peer);
        }
    }

    fn local_addr(&self) -> io::Result<Peer> {
        let connections = self.connections.clone();
        Ok(Peer { connections, number: u64::MAX, written: Arc::default() })
    }
}

impl Connected<IncomingStream<'_, Door>> for Peer {
    fn connect_info(stream: IncomingStream<'_, Door>) -> Self {
        stream.remote_addr().clone()
    }
}

/// A connection that ends when nothing could be written for [`SILENT`], or when another connection
/// takes its place.
pub struct Guarded {
    stream: TcpStream,
    peer: Peer,
    closed: oneshot::Receiver<()>,
    silent: Pin<Box<Sleep>>,
    ended: bool,
}

impl Guarded {
    /// Fails if the connection must end. Otherwise the task is woken when it must.
    fn check(&mut self, context: &mut Context<'_>) -> io::Result<()> {
        // A receiver that has answered must not be asked again.
        self.ended = self.ended
            || Pin::new(&mut self.closed).poll(context).is_ready()
            || self.silent.as_mut().poll(context).is_ready();
        if self.ended { Err(io::ErrorKind::TimedOut.into()) } else { Ok(()) }
    }

    /// Records the result of writing.
    fn wrote(&mut self, result: Poll<io::Result<usize>>) -> Poll<io::Result<usize>> {
        if let Poll::Ready(Ok(bytes @ 1..)) = result {
            self.peer.written.bytes.fetch_add(bytes as u64, Ordering::Relaxed);
            self.peer.written.more.notify_waiters();
            let now = Instant::now();
            self.silent.as_mut().reset(now + SILENT);
            if let Some(entry) = lock(&self.peer.connections.0).entries.get_mut(&self.peer.number) {
                entry.wrote = now;
            }
        }
        result
    }
}

impl Drop for Guarded {
    fn drop(&mut self) {
        lock(&self.peer.connections.0).entries.remove(&self.peer.number);
    }
}

impl AsyncRead for Guarded {
    fn poll_read(
        self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        let this = self.get_mut();
        this.check(context)?;
        Pin::new(&mut this.stream).poll_read(context, buffer)
    }
}

impl AsyncWrite for Guarded {
    fn poll_write(
        self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        let this = self.get_mut();
        this.check(context)?;
        let result = Pin::new(&mut this.stream).poll_write(context, bytes);
        this.wrote(result)
    }

    fn poll_flush(self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        let this = self.get_mut();
        this.check(context)?;
        Pin::new(&mut this.stream).poll_flush(context)
    }

    fn poll_shutdown(self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.get_mut().stream).poll_shutdown(context)
    }

    fn poll_write_vectored(
        self: Pin<&mut Self>,
        context: &mut Context<'_>,
        slices: &[io::IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        let this = self.get_mut();
        this.check(context)?;
        let result = Pin::new(&mut this.stream).poll_write_vectored(context, slices);
        this.wrote(result)
    }

    fn is_write_vectored(&self) -> bool {
        self.stream.is_write_vectored()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ip(last: u8) -> IpAddr {
        IpAddr::from([192, 0, 2, last])
    }

    /// Admits a connection. The receiver reports when the connection is closed.
    fn admit(table: &mut Table, client: IpAddr) -> (Option<u64>, oneshot::Receiver<()>) {
        let (close, closed) = oneshot::channel();
        (table.admit(client, close), closed)
    }

    fn is_closed(closed: &mut oneshot::Receiver<()>) -> bool {
        closed.try_recv() == Err(oneshot::error::TryRecvError::Closed)
    }

    #[test]
    fn a_new_connection_takes_the_place_of_the_oldest_without_a_stream() {
        let mut table = Table::default();
        let (page, mut page_closed) = admit(&mut table, ip(1));
        assert!(table.stream(page.unwrap()));
        let (_, mut silent_closed) = admit(&mut table, ip(1));
        for _ in 0..1000 {
            assert!(admit(&mut table, ip(1)).0.is_some());
            assert!(table.entries.len() <= MOST_OF_CLIENT);
        }
        assert!(is_closed(&mut silent_closed) && !is_closed(&mut page_closed));
        // Other clients have room, until all of them together have too much.
        for client in 2..10 {
            for _ in 0..MOST_OF_CLIENT {
                assert!(admit(&mut table, ip(client)).0.is_some());
                assert!(table.entries.len() <= MOST);
            }
        }
        assert!(!is_closed(&mut page_closed));
    }

    #[test]
    fn event_streams_are_limited_and_one_that_is_not_read_gives_way() {
        let mut table = Table::default();
        let mut open = |client| {
            let number = admit(&mut table, client).0.unwrap();
            (table.stream(number), number)
        };
        let all: Vec<(bool, u64)> = (0..STREAMS_OF_CLIENT).map(|_| open(ip(1))).collect();
        assert!(all.iter().all(|(opened, _)| *opened));
        assert!(!open(ip(1)).0, "one client has its limit");
        assert!((0..STREAMS_OF_CLIENT).all(|_| open(ip(2)).0));
        assert!(!open(ip(3)).0, "all clients have their limit");
        let unread = all[7].1;
        table.entries.get_mut(&unread).unwrap().wrote -= 2 * STALLED;
        let (_, number) = (0, admit(&mut table, ip(1)).0.unwrap());
        assert!(table.stream(number) && !table.entries.contains_key(&unread));
    }

    #[test]
    fn one_client_is_one_address_or_one_network() {
        let client = |text: &str| client(text.parse().unwrap());
        assert_eq!(client("[2001:db8:1:2::7]:80"), client("[2001:db8:1:2:ffff::9]:81"));
        assert_ne!(client("[2001:db8:1:2::7]:80"), client("[2001:db8:1:3::7]:80"));
        assert_eq!(client("[::ffff:192.0.2.1]:80"), client("192.0.2.1:9"));
        assert_ne!(client("192.0.2.1:80"), client("192.0.2.2:80"));
    }
}
