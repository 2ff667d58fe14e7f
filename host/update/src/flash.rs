//! Programs a board's flash through a debug probe, with the probe-rs library (feature `flash`).
//!
//! # Invariant
//! Written firmware is read back and compared before it is started. No test holds this, because it
//! takes a board; probe-rs does it, because `DownloadOptions::verify` is set.

use probe_rs::flashing::{
    DownloadOptions, FileDownloadError, FlashError, FlashProgress, ProgressEvent,
    ProgressOperation, image_format,
};
use probe_rs::probe::list::{Accessibility, Lister, ProbeListItem};
use probe_rs::probe::{DebugProbeError, DebugProbeInfo};
use probe_rs::{Permissions, Session};
use std::fmt;
use std::io::Cursor;
use thiserror::Error;

/// A connected debug probe.
#[derive(Debug, Clone)]
pub struct Probe {
    info: DebugProbeInfo,
    permitted: bool,
}

impl From<ProbeListItem> for Probe {
    fn from(item: ProbeListItem) -> Self {
        Self { info: item.info, permitted: item.accessibility == Accessibility::Accessible }
    }
}

impl Probe {
    /// `VID:PID:SERIAL`, which identifies the probe.
    fn selector(&self) -> String {
        let DebugProbeInfo { vendor_id, product_id, serial_number, .. } = &self.info;
        format!("{vendor_id:04x}:{product_id:04x}:{}", serial_number.as_deref().unwrap_or(""))
    }
}

impl fmt::Display for Probe {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}  {}", self.selector(), self.info.identifier)?;
        if self.permitted { Ok(()) } else { f.write_str("  (no permission)") }
    }
}

/// Why a board was not flashed.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum FlashingError {
    /// No probe is connected.
    #[error(
        "no debug probe: is the board's ST-LINK connector plugged in, with a cable that carries data?"
    )]
    NoProbe,
    /// No probe has the requested name.
    #[error("no debug probe {wanted}; there is {there}")]
    NoSuchProbe {
        /// The requested name.
        wanted: String,
        /// The connected probes.
        there: String,
    },
    /// Several probes are connected and the user did not choose one.
    #[error("several debug probes, name one with --probe: {0}")]
    SeveralProbes(String),
    /// The system denies the user access.
    #[error(
        "no permission to use debug probe {0}: on Linux install probe-rs' udev rules, \
         https://probe.rs/docs/getting-started/probe-setup"
    )]
    Permission(String),
    /// The probe does not work.
    #[error("the debug probe cannot be used")]
    Probe(#[from] DebugProbeError),
    /// The chip does not answer, or is another chip.
    #[error("no {chip} answers: is the board powered, and is it this board?")]
    Attach {
        /// The expected chip.
        chip: String,
        /// The error of probe-rs.
        source: Box<probe_rs::Error>,
    },
    /// The file is not firmware for this chip.
    #[error("not firmware for this chip")]
    Image(#[from] FileDownloadError),
    /// Erasing, writing or comparing failed.
    #[error("the firmware is not written whole: flash it again before use")]
    Write(#[from] FlashError),
    /// The firmware was written but could not be started.
    #[error("written and verified, but not started: press the board's reset button")]
    Reset(#[source] Box<probe_rs::Error>),
}

/// The progress of flashing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Step {
    /// An operation over this many bytes begins.
    Begins {
        /// The operation in one word.
        what: &'static str,
        /// Number of bytes.
        bytes: u64,
    },
    /// A part of the operation is done.
    Done {
        /// Number of bytes of the part.
        bytes: u64,
    },
}

/// The connected debug probes.
#[must_use]
pub fn probes() -> Vec<Probe> {
    Lister::new().list_all_with_access().into_iter().map(Probe::from).collect()
}

/// Chooses the probe with `VID:PID:SERIAL` or serial number `wanted`, or the only probe.
///
/// # Errors
/// [`FlashingError`], which names the connected probes.
pub fn choose<'p>(probes: &'p [Probe], wanted: Option<&str>) -> Result<&'p Probe, FlashingError> {
    let there = || probes.iter().map(Probe::selector).collect::<Vec<_>>().join(", ");
    let meant = |probe: &&Probe| {
        wanted.is_none_or(|wanted| {
            probe.selector().eq_ignore_ascii_case(wanted)
                || probe.info.serial_number.as_deref() == Some(wanted)
        })
    };
    let mut candidates = probes.iter().filter(meant);
    let chosen = match (candidates.next(), candidates.next(), wanted) {
        (Some(probe), None, _) => probe,
        (Some(_), Some(_), _) => return Err(FlashingError::SeveralProbes(there())),
        (None, _, Some(wanted)) if !probes.is_empty() => {
            return Err(FlashingError::NoSuchProbe { wanted: wanted.to_owned(), there: there() });
        }
        (None, ..) => return Err(FlashingError::NoProbe),
    };
    if chosen.permitted { Ok(chosen) } else { Err(FlashingError::Permission(chosen.selector())) }
}

/// Writes `elf` into the chip behind `probe`, compares, and starts the firmware.
///
/// # Errors
/// [`FlashingError`], which says what to do.
pub fn flash(
    probe: &Probe,
    chip: &str,
    elf: &[u8],
    tell: &mut dyn FnMut(Step),
) -> Result<(), FlashingError> {
    let mut session = attach(probe, chip)?;
    let mut loader = session.target().flash_loader();
    let format = image_format("elf")
        .ok_or(FileDownloadError::Object("this build of probe-rs reads no ELF files"))?;
    loader.load_image(&mut session, &mut Cursor::new(elf), format.create_loader(None), None)?;
    let mut options = DownloadOptions::new();
    options.verify = true;
    let mut plan = Plan::default();
    options.progress = FlashProgress::new(|event| {
        plan.step(&event).into_iter().for_each(&mut *tell);
    });
    loader.commit(&mut session, options)?;
    let reset = session.core(0).and_then(|mut core| core.reset());
    reset.map_err(|error| FlashingError::Reset(Box::new(error)))
}

/// Attaches to the chip; under reset if the running firmware keeps the probe out.
fn attach(probe: &Probe, chip: &str) -> Result<Session, FlashingError> {
    match probe.info.open()?.attach(chip, Permissions::default()) {
        Ok(session) => Ok(session),
        Err(_) => {
            probe.info.open()?.attach_under_reset(chip, Permissions::default()).map_err(|source| {
                FlashingError::Attach { chip: chip.to_owned(), source: Box::new(source) }
            })
        }
    }
}

/// Bytes of each operation. probe-rs announces all operations before the first starts.
#[derive(Debug, Default)]
struct Plan([u64; 4]);

impl Plan {
    fn step(&mut self, event: &ProgressEvent) -> Option<Step> {
        match *event {
            ProgressEvent::AddProgressBar { operation, total } => {
                let (slot, _) = place(operation);
                self.0[slot] = total.unwrap_or(0);
                None
            }
            ProgressEvent::Started(operation) => {
                let (slot, what) = place(operation);
                Some(Step::Begins { what, bytes: self.0[slot] })
            }
            ProgressEvent::Progress { size, .. } => Some(Step::Done { bytes: size }),
            _ => None,
        }
    }
}

/// The position of an operation in the plan, and a word for the operation.
fn place(operation: ProgressOperation) -> (usize, &'static str) {
    match operation {
        ProgressOperation::Fill => (0, "reading"),
        ProgressOperation::Erase => (1, "erasing"),
        ProgressOperation::Program => (2, "writing"),
        ProgressOperation::Verify => (3, "comparing"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nirspi::boards::BOARDS;
    use probe_rs::probe::stlink::StLinkFactory;
    use std::io::Write;

    /// An ST-LINK with this serial number.
    fn st_link(serial: &str, permitted: bool) -> Probe {
        let serial = Some(serial.to_owned());
        let info =
            DebugProbeInfo::new("ST-LINK", 0x0483, 0x374e, serial, &StLinkFactory, None, false);
        Probe { info, permitted }
    }

    #[test]
    fn the_probe_that_was_named_is_the_one_that_is_used() {
        let probes = [st_link("00AB12", true), st_link("00AB13", true), st_link("00AB14", false)];
        for wanted in ["0483:374e:00AB13", "0483:374E:00AB13", "00AB13"] {
            let chosen = choose(&probes, Some(wanted)).unwrap();
            assert_eq!(chosen.selector(), "0483:374e:00AB13", "{wanted}");
        }
        let refused = |wanted| choose(&probes, wanted).unwrap_err();
        assert!(matches!(refused(None), FlashingError::SeveralProbes(_)));
        // The nearest wrong one: a serial number that begins so.
        for wanted in ["00AB1", "0483:374e:00AB1", "0483:374f:00AB13"] {
            assert!(matches!(refused(Some(wanted)), FlashingError::NoSuchProbe { .. }), "{wanted}");
        }
        assert!(matches!(refused(Some("00AB14")), FlashingError::Permission(_)));
        assert_eq!(choose(&probes[..1], None).unwrap().selector(), "0483:374e:00AB12");
    }

    #[test]
    fn without_a_probe_there_is_one_line_on_what_to_check() {
        for wanted in [None, Some("0483:374e:1")] {
            let message = choose(&[], wanted).unwrap_err().to_string();
            assert!(message.contains("ST-LINK") && message.lines().count() == 1, "{message}");
        }
    }

    #[test]
    fn each_operation_begins_with_the_bytes_announced_for_it() {
        use ProgressOperation::{Erase, Program};
        let mut plan = Plan::default();
        let announced = [(Erase, 4096), (Program, 1500)];
        for (operation, bytes) in announced {
            let event = ProgressEvent::AddProgressBar { operation, total: Some(bytes) };
            assert_eq!(plan.step(&event), None);
        }
        for ((operation, bytes), what) in announced.into_iter().zip(["erasing", "writing"]) {
            let begins = plan.step(&ProgressEvent::Started(operation));
            assert_eq!(begins, Some(Step::Begins { what, bytes }));
        }
        let time = std::time::Duration::ZERO;
        let done = plan.step(&ProgressEvent::Progress { operation: Program, size: 256, time });
        assert_eq!(done, Some(Step::Done { bytes: 256 }));
    }

    #[test]
    fn every_chip_is_one_that_probe_rs_knows() {
        let registry = probe_rs::config::Registry::from_builtin_families();
        for board in BOARDS {
            let Some(chip) = board.chip else {
                let _ = writeln!(std::io::stderr(), "skipped: {} has no chip", board.name);
                continue;
            };
            let target = registry.get_target_by_name(chip).unwrap();
            assert_eq!(target.name, chip, "probe-rs spells it so");
        }
    }
}
