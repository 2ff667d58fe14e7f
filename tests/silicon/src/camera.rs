//! The camera as a test has it: the machine on a thread of its own, and links of the host's library to it.

use crate::chip::{Chip, Connected, OnTheBus, Ready, parallel, table};
use crate::ecp5::Ecp5;
use crate::fpga::{Fpga, Golden};
use crate::machine::Machine;
use crate::usb::Cable;
use nirspi::link::{Link, Received};
use std::io::{self, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::sync::mpsc::{self, Sender};
use std::time::{Duration, Instant};

/// The board whose ELF runs.
pub const BOARD: &str = "nucleo-u5a5zj-q";

/// Unicorn's library; `None`, with a printed message, if the environment does not name it.
#[must_use]
pub fn library() -> Option<PathBuf> {
    let named = std::env::var_os("NIRSPI_UNICORN").map(PathBuf::from);
    if named.is_none() {
        println!(
            "skipped: NIRSPI_UNICORN does not name Unicorn's library (bash .ci/run silicon sets it)"
        );
    }
    named
}

/// The root of the repository.
#[must_use]
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// The ELF that is tried: the board's, as `boards/build.sh` makes it, or the one that the environment names.
#[must_use]
pub fn elf() -> PathBuf {
    std::env::var_os("NIRSPI_SILICON_ELF").map_or_else(
        || root().join("boards/target/thumbv8m.main-none-eabihf/release").join(BOARD),
        PathBuf::from,
    )
}

/// The same with the feature `parallel`, where `bash .ci/run silicon` puts it.
#[must_use]
pub fn parallel_elf() -> PathBuf {
    std::env::var_os("NIRSPI_SILICON_PARALLEL_ELF")
        .map_or_else(|| root().join("boards/target/silicon/parallel"), PathBuf::from)
}

/// What a camera is made of.
pub struct Plan {
    /// The FPGA, made on the machine's thread.
    pub fpga: Box<dyn FnOnce() -> Box<dyn Fpga> + Send>,
    pub plugged: bool,
    /// The firmware with the parallel port, and its wires.
    pub parallel: bool,
    pub on_the_bus: OnTheBus,
    pub stuck: Option<Ready>,
    /// A register that reads with bits that never fall and bits that never rise: its address, and these bits.
    pub frozen: Option<(u32, u32, u32)>,
    /// Bytes of stack that the processor begins with, in place of all.
    pub stack_room: Option<u32>,
    /// What becomes of a write to a register, by address and value: another value, or no write.
    pub mutation: fn(u32, u32) -> Option<u32>,
}

impl Plan {
    /// A camera with this FPGA, a host at its cable, and no depth sensor.
    pub fn new(fpga: impl FnOnce() -> Box<dyn Fpga> + Send + 'static) -> Self {
        Self {
            fpga: Box::new(fpga),
            plugged: true,
            parallel: false,
            on_the_bus: OnTheBus::Nobody,
            stuck: None,
            frozen: None,
            stack_room: None,
            mutation: |_, value| Some(value),
        }
    }

    /// Makes the machine.
    ///
    /// # Panics
    /// If library or ELF cannot be read.
    #[must_use]
    pub fn machine(self, library: &Path) -> Machine {
        let board = root().join("boards").join(BOARD);
        let read =
            |file: &str| std::fs::read_to_string(board.join(file)).expect("a file of the board");
        let mut pins = table(&read("src/pins.rs"));
        if self.parallel {
            let lines = parallel(&read("README.md"));
            // A line of the port has the pin of a lamp.
            pins.retain(|pin| {
                !lines.iter().any(|line| (line.port, line.bit) == (pin.port, pin.bit))
            });
            pins.extend(lines);
        }
        let connected = Connected {
            pins,
            fpga: (self.fpga)(),
            configuration: Box::new(Ecp5::default()),
            on_the_bus: self.on_the_bus,
            stuck: self.stuck,
            frozen: self.frozen,
            mutation: self.mutation,
        };
        let elf = if self.parallel { parallel_elf() } else { elf() };
        Machine::new(library, &elf, self.plugged, self.stack_room, connected)
            .unwrap_or_else(|error| panic!("{error}"))
    }
}

type Work = Box<dyn FnOnce(&mut Machine) + Send>;

/// A handle of the machine's thread. Without one the thread ends.
#[derive(Clone)]
pub struct Camera(Sender<Work>);

impl Camera {
    /// Powers up. `None`, with a printed message, without Unicorn.
    #[must_use]
    pub fn start(plan: Plan) -> Option<Self> {
        let library = library()?;
        let (sender, receiver) = mpsc::channel::<Work>();
        std::thread::spawn(move || {
            let mut machine = plan.machine(&library);
            while let Ok(work) = receiver.recv() {
                work(&mut machine);
            }
        });
        Some(Self(sender))
    }

    /// Does something with the machine.
    ///
    /// # Panics
    /// If the machine's thread has panicked.
    pub fn with<T: Send + 'static>(
        &self,
        work: impl FnOnce(&mut Machine) -> T + Send + 'static,
    ) -> T {
        let (sender, receiver) = mpsc::channel();
        let work: Work = Box::new(move |machine| {
            let _ = sender.send(work(machine));
        });
        let sent = self.0.send(work).is_ok();
        receiver.recv().ok().filter(|_| sent).expect("the machine's thread runs")
    }

    /// Runs until a host has the device, for at most a second.
    ///
    /// # Panics
    /// If no host gets it.
    pub fn connect(&self) {
        let (there, state) = self.with(|machine| {
            let there = machine.run_while(1e6, |chip| chip.usb.is_configured());
            (
                there,
                format!(
                    "{:x?} at {:.0} us, pc {:#x}, {:?}",
                    machine.resets,
                    machine.now_us(),
                    machine.pc(),
                    machine.violations()
                ),
            )
        });
        assert!(there, "no host has got the device: {state}");
    }

    /// A link to the camera: bytes over the cable, while the chip's time goes on.
    #[must_use]
    pub fn link(&self) -> Box<dyn Link> {
        Box::new(ChipLink(self.clone()))
    }

    /// Fails if a rule was broken.
    ///
    /// # Panics
    /// If a rule was broken.
    pub fn assert_no_violation(&self) {
        let violations = self.with(|machine| machine.violations());
        assert!(violations.is_empty(), "{violations:#?}");
    }
}

struct ChipLink(Camera);

fn cable(chip: &Chip) -> Rc<Cable> {
    Rc::clone(&chip.usb.cable)
}

impl Link for ChipLink {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        let bytes = bytes.to_vec();
        let sent = self.0.with(move |machine| {
            let cable = machine.chip(|chip| cable(chip));
            if cable.configured.get() {
                cable.to_device.borrow_mut().extend(bytes);
            }
            cable.configured.get()
        });
        if sent { Ok(()) } else { Err(io::ErrorKind::BrokenPipe.into()) }
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<Received> {
        let most = buffer.len();
        let (came, there) = self.0.with(move |machine| {
            let cable = machine.chip(|chip| cable(chip));
            let session = cable.sessions.get();
            machine.run_while(timeout.as_secs_f64() * 1e6, |chip| {
                !chip.usb.cable.from_device.borrow().is_empty() || !chip.usb.is_configured()
            });
            let mut waiting = cable.from_device.borrow_mut();
            let length = waiting.len().min(most);
            let came: Vec<u8> = waiting.drain(..length).collect();
            (came, cable.configured.get() && cable.sessions.get() == session)
        });
        buffer[..came.len()].copy_from_slice(&came);
        Ok(match came.len() {
            0 if there => Received::Nothing,
            0 => Received::Closed,
            length => Received::Bytes(length),
        })
    }
}

/// Serves the camera over TCP for ever, for a host's program in another process: bytes of the socket go over the cable.
/// Where the program disconnects, the cable is pulled and plugged in again. The chip's time is not faster than the clock on
/// the wall.
///
/// # Errors
/// In words, if the address cannot be listened on, or without Unicorn.
pub fn serve(address: &str) -> Result<(), String> {
    let library = library().ok_or("no Unicorn")?;
    let optics = nirspi_virtual::VirtualOptics::new(nirspi_optics::Scene::white(), 300.0);
    let model = optics.and_then(|optics| optics.fpga(1)).map_err(|error| error.to_string())?;
    let listener = TcpListener::bind(address).map_err(|error| format!("{address}: {error}"))?;
    let address = listener.local_addr().map_err(|error| error.to_string())?;
    println!("{BOARD} on a model of its chip: tcp:{address}");
    let mut machine = Plan::new(|| Box::new(Golden::new(model))).machine(&library);
    Bridge::new(&listener)?.serve(&mut machine, &mut |_| true)
}

/// A TCP listener before the host's end of the cable.
pub struct Bridge<'l> {
    listener: &'l TcpListener,
    client: Option<TcpStream>,
    begun: Instant,
}

impl<'l> Bridge<'l> {
    /// # Errors
    /// In words, if the listener cannot be made not to wait.
    pub fn new(listener: &'l TcpListener) -> Result<Self, String> {
        listener.set_nonblocking(true).map_err(|error| error.to_string())?;
        Ok(Self { listener, client: None, begun: Instant::now() })
    }

    /// Serves while `goes_on`.
    ///
    /// # Errors
    /// None; the signature is that of what comes after.
    pub fn serve(
        &mut self,
        machine: &mut Machine,
        goes_on: &mut dyn FnMut(&mut Machine) -> bool,
    ) -> Result<(), String> {
        let cable = machine.chip(|chip| cable(chip));
        while goes_on(machine) {
            machine.run_while(500.0, |_| false);
            let ahead = machine.now_us() / 1e6 - self.begun.elapsed().as_secs_f64();
            if ahead > 0.001 {
                std::thread::sleep(Duration::from_secs_f64(ahead.min(0.01)));
            }
            let gone = !self.move_bytes(&cable);
            if gone && self.client.take().is_some() {
                cable.plugged.set(false);
                machine.run_while(10_000.0, |_| false);
                cable.plugged.set(true);
            }
        }
        Ok(())
    }

    /// Moves what can be moved. False: there is no client.
    fn move_bytes(&mut self, cable: &Cable) -> bool {
        if self.client.is_none()
            && cable.configured.get()
            && let Ok((client, _)) = self.listener.accept()
        {
            let ready =
                client.set_nodelay(true).and_then(|()| client.set_nonblocking(true)).is_ok();
            self.client = ready.then_some(client);
        }
        let Some(client) = &mut self.client else { return false };
        let mut chunk = [0; 1 << 14];
        match client.read(&mut chunk) {
            Ok(0) => return false,
            Ok(length) => cable.to_device.borrow_mut().extend(&chunk[..length]),
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => {}
            Err(_) => return false,
        }
        let mut waiting = cable.from_device.borrow_mut();
        let bytes = waiting.make_contiguous();
        match client.write(bytes) {
            Ok(length) => {
                waiting.drain(..length);
                true
            }
            Err(error) => error.kind() == io::ErrorKind::WouldBlock,
        }
    }
}
