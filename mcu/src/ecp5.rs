//! Configures an ECP5 over its slave SPI port, and decides whether it has to.
//!
//! Source of commands, status bits and their order: Lattice FPGA-TN-02039 (ECP5 and ECP5-5G
//! sysCONFIG), read from the Linux kernel's `drivers/fpga/lattice-sysconfig.c`, which drives the
//! same port; the technical note itself was not available. SPI mode 0, most significant bit first.
//! Each command is one selection of the chip; the bitstream and its command share one selection.
//!
//! [`Configuration::poll`] never waits: one call does one command or sends one piece of the
//! bitstream, and says whether there is more to do. Time is an argument.

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
    /// Kind of error in the bitstream: identity, illegal command, CRC, preamble, ...
    pub const BITSTREAM_ERROR: u32 = 0b111 << 23;
}

/// Time for which `PROGRAMN` is held low; some hundred nanoseconds are enough.
const PROGRAM_PULSE: Micros = Micros(1_000);

/// Time after the pulse in which the chip clears its memory.
const CLEARING: Micros = Micros(50_000);

/// Longest time that the chip may be busy with one command.
const PATIENCE: Micros = Micros(1_000_000);

/// The port's lines.
pub trait SlaveSpi {
    /// Drives `PROGRAMN` low, or releases the line so that it goes high.
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

    /// Reads bytes.
    ///
    /// # Errors
    /// [`BusError`].
    fn read(&mut self, into: &mut [u8]) -> Result<(), BusError>;
}

/// Why the chip is not configured.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ConfigureError {
    /// A transfer failed.
    Bus(BusError),
    /// The chip has another `IDCODE`, is missing, or is not in slave SPI mode.
    WrongDevice {
        /// `IDCODE` that was read.
        found: u32,
    },
    /// The chip was busy for too long.
    Stuck,
    /// The chip did not accept the bitstream.
    Refused {
        /// The status register after the bitstream.
        status: u32,
    },
}

impl From<BusError> for ConfigureError {
    fn from(error: BusError) -> Self {
        Self::Bus(error)
    }
}

/// Whether a bitstream has to be loaded. The chip is left alone only if it is well and is known to
/// run this bitstream. The CRC-32 identifies a bitstream.
#[must_use]
pub fn must_load(is_well: bool, running: Option<u32>, wanted: u32) -> bool {
    !is_well || running != Some(wanted)
}

/// The next step of a configuration.
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

/// Commands that keep the chip busy for a while, in this order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Command {
    Enable,
    Erase,
    Bitstream,
    Disable,
}

/// The transfer of one bitstream into the chip.
#[derive(Debug)]
pub struct Configuration {
    idcode: u32,
    step: Step,
}

impl Configuration {
    /// A transfer into a chip with this `IDCODE`.
    #[must_use]
    pub const fn new(idcode: u32) -> Self {
        Self { idcode, step: Step::Program }
    }

    /// Does the next step. `None`: call again with the same bitstream. A chip that does not accept
    /// the bitstream is restarted, so that the chip loads its configuration from where its mode
    /// pins say.
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
