//! The cameras of the matrix, and what a script does inside them.

use super::{AFTER, FRAMES, Place, setup};
use nirspi::link::{Link, Received, TcpLink};
use nirspi::recording::Target;
use nirspi::replay::{ReplayAddress, ReplayLink, Speed};
use nirspi::session::{IgnorePackets, Session, SessionError};
use nirspi::setup::MeasurementSetup;
use nirspi_mcu::{BusError, FpgaBus, Limits, Micros};
use nirspi_optics::Scene;
use nirspi_tests::debugger::{Debugger, NOWHERE, Waiting};
use nirspi_tests::emulated::Emulated;
use nirspi_virtual::{
    OpticalFpga, ServeOptions, SimulatedFpga, VirtualCamera, VirtualOptics, serve,
};
use nirspi_wire::State;
use nirspi_wire::register::{Register, control};
use std::io;
use std::net::{SocketAddr, TcpListener};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::Duration;

/// 8 us, the step of the virtual camera.
const STEP_CLOCKS: u32 = 1000;
/// The longest host silence of these cameras, shorter than the usual five seconds to save time. A host that listens
/// asks for the status every second of its own clock.
const SILENCE: Micros = Micros(3_000_000);

/// Longest time until the emulated board is dark after its host is gone: five seconds of silence, on a busy machine.
const DARK_WITHIN: Duration = Duration::from_secs(15);
/// Greetings to a board that may be restarting, whose answers are lost.
const GREETINGS: u32 = 5;

/// What happens inside the camera, once, inside the frame after so many.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Script {
    None,
    Reset {
        frame: u32,
    },
    Jump {
        frame: u32,
    },
    Crash {
        frame: u32,
    },
    /// The supply fails for a moment.
    BrownOut {
        frame: u32,
    },
    /// The link takes nothing until the run is over.
    Unread,
}

/// An FPGA that follows a script.
struct Scripted {
    inner: OpticalFpga,
    script: Script,
    released: u32,
    ahead: u64,
    /// Whether LEDs shine or the FPGA runs, for a test whose FPGA is served by another thread.
    lit: Arc<AtomicBool>,
    /// The debugger that makes an emulated processor crash or start anew.
    debugger: Arc<Mutex<Option<Debugger>>>,
}

impl Scripted {
    fn new(script: Script) -> Self {
        let inner = optics().fpga(1).unwrap();
        let (lit, debugger) = Default::default();
        Self { inner, script, released: 0, ahead: 0, lit, debugger }
    }

    fn note_light(&self) {
        self.lit.store(self.inner.leds_on() || self.inner.running(), Ordering::SeqCst);
    }

    fn is_due(&self, at: u32) -> bool {
        self.released == at && self.inner.running()
    }
}

impl SimulatedFpga for Scripted {
    fn advance(&mut self, clocks: u32) {
        self.inner.advance(clocks);
        self.note_light();
        match self.script {
            Script::Reset { frame } if self.is_due(frame) => self.inner.reset(),
            Script::Jump { frame } if self.is_due(frame) => {
                self.ahead += 3600 * u64::from(nirspi_wire::ADC_HZ);
            }
            // The crash of a camera in this process is made by its cable.
            Script::Crash { frame } if self.is_due(frame) => {
                match &mut *self.debugger.lock().unwrap() {
                    Some(debugger) => debugger.derail(NOWHERE),
                    None => return,
                }
            }
            Script::BrownOut { frame } if self.is_due(frame) => {
                match &mut *self.debugger.lock().unwrap() {
                    Some(debugger) => debugger.power_up(),
                    None => return,
                }
                self.inner.reset();
                self.note_light();
            }
            _ => return,
        }
        self.script = Script::None;
    }

    fn clock(&self) -> u64 {
        self.inner.clock() + self.ahead
    }

    fn running(&self) -> bool {
        self.inner.running()
    }

    fn set_interlock(&mut self, closed: bool) {
        self.inner.set_interlock(closed);
    }

    fn set_board_enable(&mut self, high: bool) {
        self.inner.set_board_enable(high);
    }
}

impl FpgaBus for Scripted {
    fn read(&mut self, address: u16) -> Result<u32, BusError> {
        self.inner.read(address)
    }

    fn write(&mut self, address: u16, value: u32) -> Result<(), BusError> {
        if address == Register::Control.address() && value & control::RELEASE != 0 {
            self.released += 1;
        }
        let written = self.inner.write(address, value);
        self.note_light();
        written
    }

    fn frame_ready(&mut self) -> bool {
        self.inner.frame_ready()
    }

    fn raw_ready(&mut self) -> bool {
        self.inner.raw_ready()
    }

    fn frame(&mut self) -> Result<Option<&[u8]>, BusError> {
        self.inner.frame()
    }

    fn raw(&mut self) -> Result<Option<&[u8]>, BusError> {
        self.inner.raw()
    }
}

type Camera = VirtualCamera<Scripted>;

fn optics() -> VirtualOptics {
    let scene = Scene::new(vec![0.5; 64], 8, 48.0).unwrap();
    VirtualOptics::new(scene, 300.0).unwrap().ideal()
}

fn camera(script: Script) -> Camera {
    let limits = Limits { host_silence: SILENCE, ..Limits::SIMULATED };
    let depth = optics().depth(1).unwrap();
    VirtualCamera::new(Scripted::new(script), depth, "faults").with_limits(limits)
}

/// The firmware's machine code in QEMU, with the FPGA of a script behind it.
struct Board {
    emulated: Emulated,
    lit: Arc<AtomicBool>,
}

impl Board {
    fn start(script: Script) -> Self {
        let fpga = Scripted::new(script);
        let (lit, debugger) = (Arc::clone(&fpga.lit), Arc::clone(&fpga.debugger));
        let needs_debugger = matches!(script, Script::Crash { .. } | Script::BrownOut { .. });
        let waiting = needs_debugger.then(Waiting::listen);
        let arguments = waiting.iter().flat_map(Waiting::arguments).collect::<Vec<_>>();
        let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
        let emulated = Emulated::start_with(fpga, &arguments).unwrap();
        if let Some(waiting) = waiting {
            let mut attached = waiting.attach();
            attached.go();
            *debugger.lock().unwrap() = Some(attached);
        }
        Self { emulated, lit }
    }

    fn darkens(&self) -> Result<(), String> {
        let began = std::time::Instant::now();
        while self.lit.load(Ordering::SeqCst) {
            if began.elapsed() > DARK_WITHIN {
                return Err(format!("an LED shines after {DARK_WITHIN:?}"));
            }
            std::thread::sleep(Duration::from_millis(10));
        }
        Ok(())
    }
}

fn is_dark(camera: &Camera) -> Result<(), String> {
    if camera.fpga().inner.leds_on() {
        return Err("an LED shines".to_owned());
    }
    match camera.state() {
        State::Running => Err("the firmware runs".to_owned()),
        State::Idle | State::Configured | State::Fault => Ok(()),
    }
}

/// A link to a camera in this process, which the camera outlives. The time of the camera advances while the host
/// listens.
struct Cable {
    camera: Arc<Mutex<Camera>>,
    closed: bool,
}

impl Link for Cable {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        if self.closed {
            return Err(io::ErrorKind::BrokenPipe.into());
        }
        self.camera.lock().unwrap().receive(bytes);
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], _: Duration) -> io::Result<Received> {
        let mut camera = self.camera.lock().unwrap();
        for _ in 0..2500 {
            if self.closed {
                return Ok(Received::Closed);
            }
            if !camera.packets_out().waiting().is_empty() {
                break;
            }
            camera.step(STEP_CLOCKS);
            let fpga = camera.fpga_mut();
            let script = fpga.script;
            if let Script::Crash { frame } | Script::BrownOut { frame } = script
                && fpga.is_due(frame)
            {
                fpga.script = Script::None;
                if script == (Script::Crash { frame }) {
                    camera.crash("faults.rs: on purpose");
                } else {
                    fpga.inner.reset();
                    camera.power_up();
                }
                // The first poll of the new start.
                camera.step(STEP_CLOCKS);
                self.closed = true;
            }
        }
        if camera.fpga().script == Script::Unread && camera.state() == State::Running {
            camera.fpga_mut().script = Script::None;
            while camera.fpga().running() {
                camera.step(STEP_CLOCKS);
            }
        }
        let packets = camera.packets_out();
        let length = packets.waiting().len().min(buffer.len());
        buffer[..length].copy_from_slice(&packets.waiting()[..length]);
        packets.sent(length);
        Ok(if length == 0 { Received::Nothing } else { Received::Bytes(length) })
    }
}

impl Drop for Cable {
    fn drop(&mut self) {
        if let Ok(mut camera) = self.camera.lock()
            && !self.closed
        {
            camera.link_closed();
        }
    }
}

/// A camera's server in a thread.
struct Server {
    address: SocketAddr,
    stop: Arc<AtomicBool>,
    thread: JoinHandle<Camera>,
}

impl Server {
    fn start(mut camera: Camera) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap();
        let stop = Arc::<AtomicBool>::default();
        let stopped = Arc::clone(&stop);
        let thread = std::thread::spawn(move || {
            let options = ServeOptions::default();
            serve(&listener, &mut camera, options, &stopped, &mut |_| {}).unwrap();
            camera
        });
        Self { address, stop, thread }
    }

    fn end(self) -> Camera {
        self.stop.store(true, Ordering::Relaxed);
        self.thread.join().unwrap()
    }
}

enum Kind {
    Virtual(Arc<Mutex<Camera>>),
    /// The server is stopped and started again where the camera is looked at.
    Tcp(Mutex<Option<Server>>),
    Replay(tempfile::TempDir),
    Emulated(Board),
}

/// One camera of a cell.
pub struct Lab {
    place: Place,
    kind: Kind,
}

impl Lab {
    pub fn new(place: Place, script: Script) -> Self {
        let kind = match place {
            Place::Virtual => Kind::Virtual(Arc::new(Mutex::new(camera(script)))),
            Place::Tcp => Kind::Tcp(Mutex::new(Some(Server::start(camera(script))))),
            Place::Replay => {
                let folder = tempfile::tempdir().unwrap();
                let camera = Arc::new(Mutex::new(camera(Script::None)));
                let cable = Cable { camera, closed: false };
                let mut session = Session::open(Box::new(cable)).unwrap();
                let target = Target::New(folder.path().join("rec.mcap"));
                let recorded = super::measure(&mut session, FRAMES, Some(target)).unwrap();
                assert_eq!(recorded.missing(), None);
                Kind::Replay(folder)
            }
            Place::Emulated => Kind::Emulated(Board::start(script)),
            Place::Usb => unreachable!("tried in boards/usb"),
        };
        Self { place, kind }
    }

    pub fn place(&self) -> Place {
        self.place
    }

    pub fn setup(&self) -> MeasurementSetup {
        setup()
    }

    /// A replay plays the whole recorded run.
    pub fn frames_after(&self) -> u32 {
        if self.place == Place::Replay { FRAMES } else { AFTER }
    }

    pub fn connect(&self) -> Box<dyn Link> {
        match &self.kind {
            Kind::Virtual(camera) => Box::new(Cable { camera: Arc::clone(camera), closed: false }),
            Kind::Tcp(server) => {
                let address = server.lock().unwrap().as_ref().unwrap().address;
                Box::new(TcpLink::connect(&address.to_string()).unwrap())
            }
            Kind::Replay(folder) => {
                let path = folder.path().join("rec.mcap");
                Box::new(ReplayLink::open(&ReplayAddress { path, speed: Speed::Max }).unwrap())
            }
            Kind::Emulated(board) => board.emulated.link(),
        }
    }

    /// A new session. An emulated board may have restarted, and a greeting sent
    /// during the restart is lost.
    pub fn session(&self) -> Result<Session, SessionError> {
        let last = Session::open(self.connect());
        let again = if self.place == Place::Emulated { GREETINGS - 1 } else { 0 };
        (0..again).fold(last, |last, _| match last {
            Err(SessionError::NoAnswer { .. }) => Session::open(self.connect()),
            other => other,
        })
    }

    /// That no LED shines and nothing runs, once no host is connected.
    pub fn dark(&self) -> Result<(), String> {
        match &self.kind {
            Kind::Virtual(camera) => is_dark(&camera.lock().unwrap()),
            Kind::Tcp(server) => {
                let mut server = server.lock().unwrap();
                let camera = server.take().unwrap().end();
                let dark = is_dark(&camera);
                *server = Some(Server::start(camera));
                dark
            }
            Kind::Replay(_) => Ok(()),
            Kind::Emulated(board) => board.darkens(),
        }
    }

    /// Lets more than the longest silence of a host pass while the link stays open, and looks at the LEDs.
    pub fn let_silence_pass(&self, session: &mut Session) -> Result<(), String> {
        let camera = match &self.kind {
            Kind::Virtual(camera) => camera,
            Kind::Emulated(board) => {
                board.darkens()?;
                let status = session.status(&mut IgnorePackets).map_err(|e| e.to_string())?;
                return match status.fault {
                    Some(nirspi_wire::Fault::HostSilent) => Ok(()),
                    fault => Err(format!("{fault:?} after host silence")),
                };
            }
            Kind::Tcp(_) | Kind::Replay(_) => return Err("no clock to turn".to_owned()),
        };
        let mut camera = camera.lock().unwrap();
        // The clock alone: seconds of samples would take minutes.
        camera.fpga_mut().ahead += 2 * SILENCE.0 * u64::from(nirspi_wire::ADC_HZ / 1_000_000);
        camera.step(STEP_CLOCKS);
        match camera.state() {
            State::Fault => is_dark(&camera),
            state => Err(format!("{state:?} after host silence")),
        }
    }

    pub fn end(self) -> Result<(), String> {
        match self.kind {
            Kind::Tcp(server) => is_dark(&server.into_inner().unwrap().unwrap().end()),
            Kind::Virtual(_) | Kind::Replay(_) => Ok(()),
            Kind::Emulated(board) => board.darkens(),
        }
    }
}
