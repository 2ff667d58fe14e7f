//! The virtual camera behind a TCP port: one host at a time, as with a cable. A second one is turned away
//! after [`KNOCK_WAIT`], time enough for a host that is just leaving.
//!
//! The simulation waits for the network: while the link is full, the camera's time stands still, so
//! nothing is lost by a slow host. With [`ServeOptions::drop_when_full`] time goes on, and the firmware drops
//! frames as the real one must.

use super::{SimulatedFpga, VirtualCamera};
use crate::link::is_hangup;
use std::io::{self, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Clocks between two looks of the firmware: 8 us.
const STEP_CLOCKS: u32 = 1000;
/// How long an idle camera waits for bytes before its time goes on.
const IDLE_WAIT: Duration = Duration::from_millis(2);
/// How often a waiting server looks whether it should end, and a busy one whether someone knocks.
const ACCEPT_WAIT: Duration = Duration::from_millis(20);
/// How long a second host waits for the first to leave.
const KNOCK_WAIT: Duration = Duration::from_millis(500);

/// How to serve.
#[derive(Debug, Clone, Copy, Default)]
pub struct ServeOptions {
    /// End after the first host has gone.
    pub once: bool,
    /// Let time go on while the link is full.
    pub drop_when_full: bool,
}

/// What a server tells its user.
#[derive(Debug)]
pub enum ServerEvent {
    /// A host has connected.
    Connected(SocketAddr),
    /// Another one has, while the first was there.
    TurnedAway(SocketAddr),
    /// It has gone, in order or not.
    Disconnected(SocketAddr, Option<io::Error>),
}

/// Serves `camera` until `stop` is set.
///
/// # Errors
/// When the listener fails; the failure of one host's link is told and the next host is waited for.
pub fn serve<F: SimulatedFpga>(
    listener: &TcpListener,
    camera: &mut VirtualCamera<F>,
    options: ServeOptions,
    stop: &AtomicBool,
    tell: &mut dyn FnMut(ServerEvent),
) -> io::Result<()> {
    listener.set_nonblocking(true)?;
    let mut door = Door { listener, waiting: None, looked: Instant::now() };
    while !stop.load(Ordering::Relaxed) {
        let Some((stream, address)) = door.next()? else {
            std::thread::sleep(ACCEPT_WAIT);
            continue;
        };
        tell(ServerEvent::Connected(address));
        let ended = converse(stream, camera, options, stop, &mut || door.knock(tell));
        camera.link_closed();
        tell(ServerEvent::Disconnected(address, ended.err()));
        if options.once {
            break;
        }
    }
    Ok(())
}

/// Where hosts knock. Holds the one that waits for another to leave.
struct Door<'l> {
    listener: &'l TcpListener,
    waiting: Option<(TcpStream, SocketAddr, Instant)>,
    looked: Instant,
}

impl Door<'_> {
    /// The host to talk to next.
    fn next(&mut self) -> io::Result<Option<(TcpStream, SocketAddr)>> {
        if let Some((stream, address, _)) = self.waiting.take() {
            return Ok(Some((stream, address)));
        }
        match self.listener.accept() {
            Ok(accepted) => Ok(Some(accepted)),
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => Ok(None),
            // The host gave up between knocking and entering.
            Err(error) if is_hangup(&error) => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// Looks, now and then, who knocks while a host is there; who has waited long enough is turned away.
    fn knock(&mut self, tell: &mut dyn FnMut(ServerEvent)) {
        if self.looked.elapsed() < ACCEPT_WAIT {
            return;
        }
        self.looked = Instant::now();
        match &self.waiting {
            // A listener that fails now will fail again when it is this conversation's turn to end.
            None => {
                let knocked = self.next().ok().flatten();
                self.waiting = knocked.map(|(stream, address)| (stream, address, Instant::now()));
            }
            Some((_, address, since)) if since.elapsed() > KNOCK_WAIT => {
                tell(ServerEvent::TurnedAway(*address));
                self.waiting = None;
            }
            Some(_) => {}
        }
    }
}

/// Moves bytes and time until the host hangs up.
fn converse<F: SimulatedFpga>(
    mut stream: TcpStream,
    camera: &mut VirtualCamera<F>,
    options: ServeOptions,
    stop: &AtomicBool,
    knock: &mut dyn FnMut(),
) -> io::Result<()> {
    stream.set_nodelay(true)?;
    stream.set_nonblocking(true)?;
    let mut buffer = vec![0; 1 << 16];
    while !stop.load(Ordering::Relaxed) {
        knock();
        match stream.read(&mut buffer) {
            Ok(0) => return Ok(()),
            Ok(length) => camera.receive(buffer.get(..length).unwrap_or(&[])),
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => {}
            Err(error) if is_hangup(&error) => return Err(error),
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
        let mut worked = false;
        // A batch between two looks at the socket: system calls cost more than frames.
        for _ in 0..64 {
            if camera.packets_out().is_full() && !options.drop_when_full {
                break;
            }
            worked |= camera.step(STEP_CLOCKS);
        }
        let mut blocked = false;
        while !camera.packets_out().waiting().is_empty() {
            match stream.write(camera.packets_out().waiting()) {
                Ok(0) => return Err(io::ErrorKind::WriteZero.into()),
                Ok(length) => camera.packets_out().sent(length),
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => {
                    blocked = true;
                    break;
                }
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err(error),
            }
        }
        if blocked && !options.drop_when_full {
            std::thread::sleep(Duration::from_micros(50));
        } else if !worked && !camera.fpga().running() {
            std::thread::sleep(IDLE_WAIT);
        }
    }
    Ok(())
}
