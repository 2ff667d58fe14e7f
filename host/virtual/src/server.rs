//! The virtual camera behind a TCP port. The server accepts one host at a time, as a cable does. A
//! second host is turned away after [`KNOCK_WAIT`], which gives a leaving host time to disconnect.
//!
//! The simulation waits for the network: while the link is full, the camera's time stands still, so
//! a slow host loses nothing. With [`ServeOptions::drop_when_full`] the time goes on, and the
//! firmware drops frames as on the real camera. With [`ServeOptions::real_time`] the time runs no
//! faster than the clock on the wall.

use super::{SimulatedFpga, VirtualCamera};
use nirspi::link::is_hangup;
use std::io::{self, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Clocks between two polls of the firmware: 8 us.
const STEP_CLOCKS: u32 = 1000;
/// How long an idle camera waits for bytes before its time advances.
const IDLE_WAIT: Duration = Duration::from_millis(2);
/// Interval at which a waiting server checks whether to stop, and a busy server checks for a second
/// host.
const ACCEPT_WAIT: Duration = Duration::from_millis(20);
/// How long a second host waits for the first host to leave.
const KNOCK_WAIT: Duration = Duration::from_millis(500);
/// The longest time from a connection to its first byte. Longer connections are of no host.
const GREETING_WAIT: Duration = Duration::from_secs(5);
/// The longest silence of a host while another host waits.
const SILENCE: Duration = Duration::from_secs(60);

/// Options of the server.
#[derive(Debug, Clone, Copy, Default)]
pub struct ServeOptions {
    /// Whether to stop after the first host has disconnected.
    pub once: bool,
    /// Whether the camera's time goes on while the link is full.
    pub drop_when_full: bool,
    /// Whether the camera's time runs no faster than the clock on the wall.
    pub real_time: bool,
}

/// Keeps the camera's time from running faster than the clock on the wall.
///
/// # Invariant
/// The camera is never ahead of the clock since the last time that the camera was [`LATE`] behind
/// (`tests::a_camera_in_real_time_is_never_ahead_and_does_not_make_up_for_long_delays`).
struct Pace {
    /// The moment on the wall that is `clocks` of the camera.
    since: Instant,
    clocks: u64,
}

/// A camera that is further behind the clock on the wall does not make up for the delay.
const LATE: Duration = Duration::from_millis(100);
/// Length of an ADC clock.
const NS_PER_CLOCK: f64 = 1e9 / nirspi_wire::ADC_HZ as f64;
/// The longest sleep of a camera that is ahead, so that its host is heard.
const AHEAD_WAIT: Duration = Duration::from_micros(500);

impl Pace {
    /// How far the camera is ahead of the clock on the wall; `None` if it is not ahead.
    fn ahead(&mut self, now: Instant, clocks: u64) -> Option<Duration> {
        let passed = clocks.saturating_sub(self.clocks);
        let light = Duration::from_nanos((passed as f64 * NS_PER_CLOCK) as u64);
        let wall = now.saturating_duration_since(self.since);
        if wall > light + LATE {
            (self.since, self.clocks) = (now, clocks);
        }
        light.checked_sub(wall).filter(|ahead| !ahead.is_zero())
    }
}

/// An event that the server reports to its user.
#[derive(Debug)]
pub enum ServerEvent {
    /// A host has connected.
    Connected(SocketAddr),
    /// A second host connected while the first was connected.
    TurnedAway(SocketAddr),
    /// The host disconnected; the error, if there was one.
    Disconnected(SocketAddr, Option<io::Error>),
}

impl std::fmt::Display for ServerEvent {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Connected(host) => write!(f, "{host} connected"),
            Self::TurnedAway(host) => write!(f, "{host} turned away: one host at a time"),
            Self::Disconnected(host, None) => write!(f, "{host} disconnected, LEDs off"),
            Self::Disconnected(host, Some(error)) => {
                write!(f, "{host} was cut off ({error}), LEDs off")
            }
        }
    }
}

/// Serves `camera` until `stop` is set.
///
/// # Errors
/// If the listener fails. An error of one host's link is reported as an event, and the server waits
/// for the next host.
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

/// The listening side of the server. Holds a second host that waits for the first to leave.
struct Door<'l> {
    listener: &'l TcpListener,
    waiting: Option<(TcpStream, SocketAddr, Instant)>,
    looked: Instant,
}

impl Door<'_> {
    /// The next host to serve.
    fn next(&mut self) -> io::Result<Option<(TcpStream, SocketAddr)>> {
        if let Some((stream, address, _)) = self.waiting.take() {
            return Ok(Some((stream, address)));
        }
        match self.listener.accept() {
            Ok(accepted) => Ok(Some(accepted)),
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => Ok(None),
            // The host disconnected before it was accepted.
            Err(error) if is_hangup(&error) => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// Checks from time to time for a second host while the first is connected, and turns away a
    /// host that has waited too long.
    /// Returns whether another host waits.
    fn knock(&mut self, tell: &mut dyn FnMut(ServerEvent)) -> bool {
        if self.looked.elapsed() < ACCEPT_WAIT {
            return self.waiting.is_some();
        }
        self.looked = Instant::now();
        match &self.waiting {
            // A listener that fails now will fail again after this host has disconnected.
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
        self.waiting.is_some()
    }
}

/// Moves bytes and advances time until the host disconnects.
fn converse<F: SimulatedFpga>(
    mut stream: TcpStream,
    camera: &mut VirtualCamera<F>,
    options: ServeOptions,
    stop: &AtomicBool,
    knock: &mut dyn FnMut() -> bool,
) -> io::Result<()> {
    stream.set_nodelay(true)?;
    stream.set_nonblocking(true)?;
    let mut buffer = vec![0; 1 << 16];
    let (mut heard, mut greeted) = (Instant::now(), false);
    let mut pace = Pace { since: heard, clocks: camera.fpga().clock() };
    while !stop.load(Ordering::Relaxed) {
        let another_waits = knock();
        let silent = heard.elapsed();
        if (!greeted && silent > GREETING_WAIT) || (another_waits && silent > SILENCE) {
            let reason = format!("silent for {} s", silent.as_secs());
            return Err(io::Error::new(io::ErrorKind::TimedOut, reason));
        }
        let room = if camera.takes_bytes() { &mut buffer[..] } else { &mut [] };
        match stream.read(room) {
            Ok(0) if room.is_empty() => {}
            Ok(0) => return Ok(()),
            Ok(length) => {
                (heard, greeted) = (Instant::now(), true);
                camera.receive(buffer.get(..length).unwrap_or(&[]));
            }
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => {}
            Err(error) if is_hangup(&error) => return Err(error),
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
        let (mut worked, mut ahead) = (false, None);
        // A batch of steps between two reads of the socket, because system calls cost more than
        // frames.
        for _ in 0..64 {
            if camera.packets_out().is_full() && !options.drop_when_full {
                break;
            }
            if options.real_time {
                ahead = pace.ahead(Instant::now(), camera.fpga().clock());
            }
            if ahead.is_some() {
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
        } else if let Some(ahead) = ahead {
            std::thread::sleep(ahead.min(AHEAD_WAIT));
        } else if !worked && !camera.fpga().running() {
            std::thread::sleep(IDLE_WAIT);
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::VirtualOptics;
    use nirspi::link::TcpLink;
    use nirspi::session::Session;
    use nirspi_optics::Scene;
    use nirspi_wire::{Command, RebootInto, Request, encode, version};
    use std::sync::Arc;

    /// The packets of these commands.
    fn packets(commands: &[Command<'_>]) -> Vec<u8> {
        let mut room = [0; 256];
        let one = |(id, command): (u16, &Command<'_>)| {
            encode(&Request { id, command: *command }, &mut room).unwrap().to_vec()
        };
        (0..).zip(commands).map(one).collect::<Vec<_>>().concat()
    }

    /// A host that misbehaves, then the greeting of the next one.
    fn after(misbehave: impl FnOnce(TcpStream)) {
        let sheet = Scene::new(vec![0.9; 4], 2, 48.0).unwrap();
        let optics = VirtualOptics::new(sheet, 300.0).unwrap();
        let mut camera = optics.ideal().camera(1).unwrap();
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap();
        let stop = Arc::new(AtomicBool::new(false));
        let stopped = Arc::clone(&stop);
        let server = std::thread::spawn(move || {
            serve(&listener, &mut camera, ServeOptions::default(), &stopped, &mut |_| {}).unwrap();
        });
        misbehave(TcpStream::connect(address).unwrap());
        let greeted = Session::open(Box::new(TcpLink::connect(&address.to_string()).unwrap()));
        stop.store(true, Ordering::Relaxed);
        server.join().unwrap();
        assert_eq!(greeted.unwrap().identity().board, "virtual");
    }

    #[test]
    fn a_camera_in_real_time_is_never_ahead_and_does_not_make_up_for_long_delays() {
        let start = Instant::now();
        let after = |ms| start + Duration::from_millis(ms);
        let ms = u64::from(nirspi_wire::ADC_HZ) / 1000;
        let mut pace = Pace { since: start, clocks: 7 };
        assert_eq!(pace.ahead(after(0), 7), None);
        assert_eq!(pace.ahead(after(10), 7 + 30 * ms), Some(Duration::from_millis(20)));
        assert_eq!(pace.ahead(after(90), 7 + 30 * ms), None, "a short delay");
        assert_eq!(pace.ahead(after(91), 7 + 95 * ms), Some(Duration::from_millis(4)), "made up");
        assert_eq!(pace.ahead(after(500), 7 + 95 * ms), None, "a long delay");
        assert_eq!(pace.ahead(after(500), 7 + 97 * ms), Some(Duration::from_millis(2)), "lost");
    }

    const HELLO: Command<'_> = Command::Hello { protocol: version::CURRENT };

    #[test]
    fn a_restart_that_a_host_asked_for_leaves_a_camera_for_the_next_host() {
        after(|mut stream| {
            let restart = Command::Reboot(RebootInto::Application);
            stream.write_all(&packets(&[HELLO, restart])).unwrap();
            stream.set_read_timeout(Some(Duration::from_secs(5))).unwrap();
            let mut replies = [0; 8];
            stream.read_exact(&mut replies).unwrap();
            std::thread::sleep(Duration::from_millis(50));
        });
    }

    #[test]
    fn a_connection_that_never_greets_keeps_no_host_out() {
        after(|silent| {
            // The connection stays open beyond the greeting of the next host.
            std::mem::forget(silent.try_clone().unwrap());
            std::thread::sleep(GREETING_WAIT + Duration::from_millis(300));
        });
    }

    #[test]
    fn a_host_that_sends_and_never_reads_takes_no_memory() {
        after(|mut stream| {
            let mut flood = packets(&[HELLO]);
            flood.extend(packets(&[Command::Status]).repeat(1 << 16));
            stream.set_write_timeout(Some(Duration::from_millis(300))).unwrap();
            let mut sent = 0;
            // The sockets of both sides hold a few megabytes.
            while sent < 1 << 26 {
                match stream.write(&flood) {
                    Ok(length) => sent += length,
                    Err(error) => {
                        assert_eq!(error.kind(), io::ErrorKind::WouldBlock, "{error}");
                        return;
                    }
                }
            }
            panic!("{sent} bytes taken from a host that reads nothing");
        });
    }
}
