//! Configures an ECP5 over its slave SPI port, and decides whether it has to.
//!
//! Commands, status bits and their order: Lattice FPGA-TN-02039 (ECP5 and ECP5-5G sysCONFIG), as they stand in the
//! Linux kernel's `drivers/fpga/lattice-sysconfig.c`, which drives the same port; the technical note itself
//! is not at hand. SPI mode 0, most significant bit first; each command is one selection of the chip, and the
//! bitstream goes in one selection together with its command.
//!
//! The one law: [`Configuration::poll`] never waits. It does one command, or one piece of the bitstream, and
//! says that there is more; time is an argument.

use crate::{BusError, Micros};

/// `IDCODE` of the LFE5UM5G-85F.
pub const IDCODE_LFE5UM5G_85F: u32 = 0x8111_3043;

/// Bytes that one poll sends: under a millisecond at 10 MHz.
pub const PIECE_BYTES: usize = 1024;

/// Operation codes, each followed by three bytes of operand.
mod command {
    pub const READ_ID: [u8; 4] = [0xE0, 0, 0, 0];
    pub const READ_STATUS: [u8; 4] = [0x3C, 0, 0, 0];
    pub const ISC_ENABLE: [u8; 4] = [0xC6, 0, 0, 0];
    /// Operand: the configuration memory.
    pub const ISC_ERASE: [u8; 4] = [0x0E, 1, 0, 0];
    pub const INIT_ADDRESS: [u8; 4] = [0x46, 0, 0, 0];
    pub const BITSTREAM_BURST: [u8; 4] = [0x7A, 0, 0, 0];
    pub const ISC_DISABLE: [u8; 4] = [0x26, 0, 0, 0];
}

/// Bits of the status register.
mod status {
    pub const DONE: u32 = 1 << 8;
    pub const BUSY: u32 = 1 << 12;
    pub const FAIL: u32 = 1 << 13;
    /// What was wrong with the bitstream: identity, illegal command, CRC, preamble, ...
    pub const BITSTREAM_ERROR: u32 = 0b111 << 23;
}

/// `PROGRAMN` is held low for this long; some hundred nanoseconds are enough.
const PROGRAM_PULSE: Micros = Micros(1_000);

/// Afterwards the chip clears its memory before it listens.
const CLEARING: Micros = Micros(50_000);

/// Longest time that the chip may be busy with one command.
const PATIENCE: Micros = Micros(1_000_000);

/// The port's lines.
pub trait SlaveSpi {
    /// Drives `PROGRAMN` low, or lets it go high.
    fn program(&mut self, low: bool);

    /// Level of `DONE`: high while the chip is configured.
    fn done(&mut self) -> bool;

    /// Selects the chip, or ends the command.
    fn select(&mut self, selected: bool);

    /// Sends bytes.
    ///
    /// # Errors
    /// [`BusError`].
    fn write(&mut self, bytes: &[u8]) -> Result<(), BusError>;

    /// Takes bytes.
    ///
    /// # Errors
    /// [`BusError`].
    fn read(&mut self, into: &mut [u8]) -> Result<(), BusError>;
}

/// Why the chip is not configured.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ConfigureError {
    /// No transfer.
    Bus(BusError),
    /// Another chip, none, or one that is not in slave SPI mode.
    WrongDevice {
        /// Its `IDCODE`.
        found: u32,
    },
    /// Busy for too long.
    Stuck,
    /// It did not take the bitstream.
    Refused {
        /// The status register.
        status: u32,
    },
}

impl From<BusError> for ConfigureError {
    fn from(error: BusError) -> Self {
        Self::Bus(error)
    }
}

/// Whether a bitstream has to be loaded: the chip is left alone only if it is well and is known to run this one.
/// Bitstreams are told apart by their CRC-32.
#[must_use]
pub fn must_load(is_well: bool, running: Option<u32>, wanted: u32) -> bool {
    !is_well || running != Some(wanted)
}

/// What comes next.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Step {
    Program,
    Clear { since: Micros },
    Identify { since: Micros },
    Command(Command),
    Wait { after: Command, since: Micros },
    Send { next: usize },
    Restart { since: Micros, error: ConfigureError },
    Over(Result<(), ConfigureError>),
}

/// Commands that the chip is busy with for a while, in this order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Command {
    Enable,
    Erase,
    Bitstream,
    Disable,
}

/// The way of one bitstream into the chip.
#[derive(Debug)]
pub struct Configuration {
    idcode: u32,
    step: Step,
}

impl Configuration {
    /// For a chip with this `IDCODE`.
    #[must_use]
    pub const fn new(idcode: u32) -> Self {
        Self { idcode, step: Step::Program }
    }

    /// Goes on; `None`: there is more to do, with the same bitstream. A chip that does not take it is restarted,
    /// so that it looks for its configuration where its mode pins say.
    pub fn poll(
        &mut self,
        now: Micros,
        port: &mut impl SlaveSpi,
        bitstream: &[u8],
    ) -> Option<Result<(), ConfigureError>> {
        if let Step::Over(result) = self.step {
            return Some(result);
        }
        self.step = self.next(now, port, bitstream).unwrap_or_else(|error| {
            port.select(false);
            port.program(true);
            Step::Restart { since: now, error }
        });
        None
    }

    fn next(
        &self,
        now: Micros,
        port: &mut impl SlaveSpi,
        bitstream: &[u8],
    ) -> Result<Step, ConfigureError> {
        Ok(match self.step {
            Step::Program => {
                port.select(false);
                port.program(true);
                Step::Clear { since: now }
            }
            Step::Clear { since } | Step::Restart { since, .. }
                if now.since(since) < PROGRAM_PULSE =>
            {
                self.step
            }
            Step::Clear { .. } => {
                port.program(false);
                Step::Identify { since: now }
            }
            Step::Restart { error, .. } => {
                port.program(false);
                Step::Over(Err(error))
            }
            Step::Identify { since } if now.since(since) < CLEARING => self.step,
            Step::Identify { .. } => {
                let found = ask(port, command::READ_ID)?;
                if found != self.idcode {
                    return Err(ConfigureError::WrongDevice { found });
                }
                Step::Command(Command::Enable)
            }
            Step::Command(command) => give(now, port, command)?,
            Step::Send { next } => {
                let rest = bitstream.get(next..).unwrap_or(&[]);
                let piece = rest.get(..PIECE_BYTES).unwrap_or(rest);
                if piece.is_empty() {
                    port.select(false);
                    Step::Wait { after: Command::Bitstream, since: now }
                } else {
                    port.write(piece)?;
                    Step::Send { next: next.saturating_add(piece.len()) }
                }
            }
            Step::Wait { after, since } => self.wait(now, port, after, since)?,
            Step::Over(_) => self.step,
        })
    }

    fn wait(
        &self,
        now: Micros,
        port: &mut impl SlaveSpi,
        after: Command,
        since: Micros,
    ) -> Result<Step, ConfigureError> {
        let status = ask(port, command::READ_STATUS)?;
        if status & status::BUSY != 0 {
            let stuck = now.since(since) > PATIENCE;
            return if stuck { Err(ConfigureError::Stuck) } else { Ok(self.step) };
        }
        let taken = match after {
            Command::Bitstream => {
                status & (status::DONE | status::FAIL | status::BITSTREAM_ERROR) == status::DONE
            }
            _ => status & status::FAIL == 0,
        };
        if !taken {
            return Err(ConfigureError::Refused { status });
        }
        Ok(Step::Command(match after {
            Command::Enable => Command::Erase,
            Command::Erase => Command::Bitstream,
            Command::Bitstream | Command::Disable => Command::Disable,
        }))
    }
}

fn give(now: Micros, port: &mut impl SlaveSpi, command: Command) -> Result<Step, BusError> {
    match command {
        Command::Enable => tell(port, command::ISC_ENABLE)?,
        Command::Erase => tell(port, command::ISC_ERASE)?,
        Command::Bitstream => {
            tell(port, command::INIT_ADDRESS)?;
            port.select(true);
            port.write(&command::BITSTREAM_BURST)?;
            return Ok(Step::Send { next: 0 });
        }
        Command::Disable => {
            tell(port, command::ISC_DISABLE)?;
            return Ok(Step::Over(Ok(())));
        }
    }
    Ok(Step::Wait { after: command, since: now })
}

fn tell(port: &mut impl SlaveSpi, command: [u8; 4]) -> Result<(), BusError> {
    port.select(true);
    let sent = port.write(&command);
    port.select(false);
    sent
}

fn ask(port: &mut impl SlaveSpi, command: [u8; 4]) -> Result<u32, BusError> {
    let mut word = [0; 4];
    port.select(true);
    let answered = port.write(&command).and_then(|()| port.read(&mut word));
    port.select(false);
    answered.map(|()| u32::from_be_bytes(word))
}
