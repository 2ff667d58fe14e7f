//! A fake ECP5 at its slave SPI port: strict about the order of commands, with faults that a test
//! chooses.

use crate::ecp5::{IDCODE_LFE5UM5G_85F, SlaveSpi};
use crate::{BusError, Micros};
use std::vec::Vec;

/// The fault of a fake chip.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Illness {
    /// Busy for ever after the first command.
    Stuck,
    /// Reports a damaged bitstream.
    BadCrc,
    /// Has this status after the bitstream.
    Ends(u32),
    /// Fails to erase itself.
    Fails,
    /// No transfer succeeds.
    Unplugged,
}

#[derive(Debug)]
pub struct FakeEcp5 {
    pub idcode: u32,
    pub illness: Option<Illness>,
    /// The bitstream that the chip runs.
    pub runs: Option<Vec<u8>>,
    /// Falling edges of `PROGRAMN`.
    pub restarts: u32,
    /// Operation codes received, except status reads.
    pub commands: Vec<u8>,
    now: Micros,
    programn_low_since: Option<Micros>,
    clear_at: Micros,
    busy_reads: u32,
    status: u32,
    selection: Option<Vec<u8>>,
}

impl Default for FakeEcp5 {
    fn default() -> Self {
        Self {
            idcode: IDCODE_LFE5UM5G_85F,
            illness: None,
            runs: None,
            restarts: 0,
            commands: Vec::new(),
            now: Micros(0),
            programn_low_since: None,
            clear_at: Micros(0),
            busy_reads: 0,
            status: 0,
            selection: None,
        }
    }
}

impl FakeEcp5 {
    pub fn ill(illness: Illness) -> Self {
        Self { illness: Some(illness), ..Self::default() }
    }

    pub fn with_idcode(idcode: u32) -> Self {
        Self { idcode, ..Self::default() }
    }

    pub fn running(bitstream: &[u8]) -> Self {
        Self { runs: Some(bitstream.to_vec()), ..Self::default() }
    }

    /// Lets time pass. Only steps that take time in the chip depend on it.
    pub fn pass(&mut self, now: Micros) {
        self.now = now;
    }

    /// Carries out a command after its last byte.
    fn carry_out(&mut self, sent: &[u8]) {
        let (&[code, operands @ ..], rest) = sent.split_first_chunk::<4>().expect("four bytes");
        if code == 0x3C {
            return;
        }
        self.commands.push(code);
        let before = |code: u8| self.commands.contains(&code);
        match code {
            0xE0 => {}
            0xC6 => self.busy_reads = 2,
            0x0E => {
                assert!(before(0xC6) && operands == [1, 0, 0], "enable, then erase the memory");
                self.busy_reads = 5;
                if self.illness == Some(Illness::Fails) {
                    self.status |= 1 << 13;
                }
            }
            0x46 => assert!(before(0x0E) && operands == [0; 3]),
            0x7A => {
                assert!(self.commands.ends_with(&[0x46, 0x7A]));
                if self.illness == Some(Illness::BadCrc) {
                    self.status |= 3 << 23;
                } else if let Some(Illness::Ends(status)) = self.illness {
                    self.status |= status;
                } else {
                    self.status |= 1 << 8;
                    self.runs = Some(rest.to_vec());
                }
            }
            0x26 => assert!(self.commands.ends_with(&[0x7A, 0x26]), "nothing but the end"),
            other => panic!("command {other:#04x}"),
        }
    }
}

impl SlaveSpi for FakeEcp5 {
    fn program(&mut self, low: bool) {
        if low {
            self.restarts += 1;
            self.programn_low_since = Some(self.now);
            self.runs = None;
            self.status = 0;
        } else if let Some(since) = self.programn_low_since.take() {
            assert!(self.now == Micros(0) || self.now.since(since).0 >= 1, "a pulse that is seen");
            self.clear_at = Micros(self.now.0 + 20_000);
        }
    }

    fn done(&mut self) -> bool {
        self.runs.is_some()
    }

    fn select(&mut self, selected: bool) {
        if selected {
            assert!(self.selection.is_none(), "selected twice");
            assert!(self.programn_low_since.is_none(), "in reset");
            self.selection = Some(Vec::new());
        } else if let Some(sent) = self.selection.take()
            && self.illness != Some(Illness::Unplugged)
        {
            self.carry_out(&sent);
        }
    }

    fn write(&mut self, bytes: &[u8]) -> Result<(), BusError> {
        if self.illness == Some(Illness::Unplugged) {
            return Err(BusError::Transfer);
        }
        assert!(self.now == Micros(0) || self.now >= self.clear_at, "it still clears its memory");
        self.selection.as_mut().expect("not selected").extend(bytes);
        Ok(())
    }

    fn read(&mut self, into: &mut [u8]) -> Result<(), BusError> {
        let word = match self.selection.as_deref() {
            Some([0xE0, 0, 0, 0]) => self.idcode,
            Some([0x3C, 0, 0, 0]) => {
                let stuck = self.illness == Some(Illness::Stuck);
                let busy = stuck || self.busy_reads > 0;
                self.busy_reads = self.busy_reads.saturating_sub(1);
                self.status | u32::from(busy) << 12
            }
            other => panic!("nothing to read after {other:?}"),
        };
        into.copy_from_slice(&word.to_be_bytes());
        Ok(())
    }
}
