#![cfg_attr(not(test), deny(clippy::disallowed_methods))]
#![doc = include_str!("../README.md")]
//!
//! [`Plan`] updates a camera's firmware and gateware from a release folder.
//!
//! # Invariant
//! Every file that an update uses is verified, and the release is held against the camera, before
//! the camera changes at all (`tests::what_does_not_fit_is_refused_before_the_camera_changes`). An
//! update is done only when the camera reports the release's versions.

#[cfg(feature = "flash")]
pub mod flash;
pub mod gateware;
mod release;
#[cfg(test)]
mod tests;

use crate::gateware::GatewareError;
use nirspi::boards::{Board, is_simulated};
use nirspi::files::FileError;
use nirspi::fpga::Fpga;
use nirspi::identity::CameraIdentity;
use nirspi::session::{IgnorePackets, Session};
use nirspi_wire::{Version, register::Design, version};
pub use release::{Asset, Component, MANIFEST, Manifest, Release, Source, pack};
use serde::Serialize;
use std::fmt;
use std::path::PathBuf;
use std::time::{Duration, Instant};
use thiserror::Error;

/// The longest time from the start of new firmware to its answer: USB names the camera again.
const RESTART_TIME: Duration = Duration::from_secs(15);

/// Why a camera is not updated.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum UpdateError {
    /// A file cannot be read or written, or a field of the manifest is wrong.
    #[error(transparent)]
    File(#[from] FileError),
    /// There is no manifest.
    #[error(
        "{}: no {MANIFEST} there, expected a release folder or a file in one; nirspi camera gateware and nirspi camera flash take \
         files of no release", .0.display()
    )]
    NoManifest(PathBuf),
    /// The manifest is not JSON of this form.
    #[error("{}: not the manifest of a release", path.display())]
    Manifest {
        /// The manifest.
        path: PathBuf,
        /// The parser's reason.
        source: serde_json::Error,
    },
    /// The manifest lists no file at all.
    #[error("{}: the release has no files, expected firmware or gateware: get the release again", .0.display())]
    Empty(PathBuf),
    /// The camera has no FPGA that takes a bitstream.
    #[error("{file}: gateware, but the camera's board is {board}, which loads none")]
    LoadsNone {
        /// The file of the release.
        file: String,
        /// The camera's board.
        board: String,
    },
    /// The camera's board has too little memory for the bitstream.
    #[error(
        "{file}: gateware of {bytes} bytes, but the camera's board {board} takes {most} at most: load the gateware into the FPGA board's own flash memory"
    )]
    TooLong {
        /// The file of the release.
        file: String,
        /// Its length.
        bytes: usize,
        /// The camera's board.
        board: String,
        /// The longest bitstream that the board takes.
        most: u64,
    },
    /// The manifest does not list a file.
    #[error("{}: does not list {file}", manifest.display())]
    NotListed {
        /// The manifest.
        manifest: PathBuf,
        /// The file.
        file: String,
    },
    /// A file has another length than the manifest says.
    #[error("{}: {found} bytes, expected {expected}: get the release again", path.display())]
    Cut {
        /// The file.
        path: PathBuf,
        /// Its length.
        found: u64,
        /// Its length by the manifest.
        expected: u64,
    },
    /// A file has another checksum than the manifest says.
    #[error("{}: SHA-256 is {found}, expected {expected}: get the release again", path.display())]
    Changed {
        /// The file.
        path: PathBuf,
        /// Its checksum.
        found: String,
        /// Its checksum by the manifest.
        expected: String,
    },
    /// A file does not begin as firmware or gateware does.
    #[error("{}: this file is not {component}, expected {}", path.display(), match component {
        Component::Firmware => "an ELF file",
        Component::Gateware => "a bitstream for an ECP5",
    })]
    NotOfThisKind {
        /// The file.
        path: PathBuf,
        /// What it should be.
        component: Component,
    },
    /// The release has no firmware for the camera's board.
    #[error("the release has firmware for {there}, but the camera's board is {board}")]
    WrongBoard {
        /// The camera's board.
        board: String,
        /// The boards of the release.
        there: String,
    },
    /// The release has gateware for several FPGA boards.
    #[error("the release has gateware for several FPGA boards, name one of the files: {0}")]
    SeveralBitstreams(String),
    /// The camera already speaks a newer protocol than the release.
    #[error(
        "the release speaks protocol {release}, the camera already speaks {camera}: choose a newer release"
    )]
    OlderProtocol {
        /// Newest protocol version of the release.
        release: u16,
        /// Protocol version of the camera's session.
        camera: u16,
    },
    /// This program does not speak the protocol of the release.
    #[error(
        "the release speaks protocol version {release}, this program {}: update this program first",
        version::Spoken
    )]
    NewerProtocol {
        /// Newest protocol version of the release.
        release: u16,
    },
    /// The gateware is not a camera's.
    #[error(
        "{file}: this gateware is the bring-up design, expected a camera's; load another with nirspi camera gateware FILE"
    )]
    BringUp {
        /// The file of the release.
        file: String,
    },
    /// The gateware does not run.
    #[error(transparent)]
    Gateware(#[from] GatewareError),
    /// The camera reports another version after the update.
    #[error("the {component} was loaded, but the camera reports {found}, expected {expected}")]
    NotRunning {
        /// The part.
        component: Component,
        /// The version that the camera reports.
        found: String,
        /// The version of the release.
        expected: String,
    },
}

/// A part of the camera that an update changes.
#[derive(Debug, Clone, Serialize)]
pub struct Change {
    /// The file.
    #[serde(flatten)]
    pub asset: Asset,
    /// The version that the camera reports before.
    pub before: String,
    /// The file's path.
    #[serde(skip)]
    pub path: PathBuf,
    /// The verified content of the file.
    #[serde(skip)]
    pub content: Vec<u8>,
}

/// What an update of one camera changes.
#[derive(Debug, Clone, Serialize)]
pub struct Plan {
    /// The camera's board.
    pub board: String,
    /// New firmware; `None` if the release has none, or the camera already reports this version.
    pub firmware: Option<Change>,
    /// Gateware; `None` if the release has none. A camera that already runs the same bitstream takes
    /// it and changes nothing.
    pub gateware: Option<Change>,
}

impl Plan {
    /// Verifies the files of the release that this camera needs, and holds the release against the
    /// camera.
    ///
    /// # Errors
    /// [`UpdateError`] if a file is not whole, or the release is not for this camera.
    pub fn new(release: &Release, camera: &CameraIdentity) -> Result<Self, UpdateError> {
        let Manifest { protocol, ref files, .. } = *release.manifest();
        if protocol > version::CURRENT {
            return Err(UpdateError::NewerProtocol { release: protocol });
        }
        if protocol < camera.protocol {
            return Err(UpdateError::OlderProtocol { release: protocol, camera: camera.protocol });
        }
        let of = |component| files.iter().filter(move |asset| asset.component == component);
        let names =
            |component| of(component).map(|a| a.board.as_str()).collect::<Vec<_>>().join(", ");
        let firmware = of(Component::Firmware).find(|asset| asset.board == camera.board);
        // A release of gateware alone is for any board: the firmware checks the FPGA's identity code.
        if firmware.is_none() && of(Component::Firmware).next().is_some() {
            let there = names(Component::Firmware);
            return Err(UpdateError::WrongBoard { board: camera.board.clone(), there });
        }
        let mut gateware = of(Component::Gateware);
        let bitstream = gateware.next();
        if gateware.next().is_some() {
            return Err(UpdateError::SeveralBitstreams(
                of(Component::Gateware).map(|a| a.file.as_str()).collect::<Vec<_>>().join(", "),
            ));
        }
        let change = |asset: &Asset, before: &str| -> Result<Change, UpdateError> {
            let content = release.bytes(asset)?;
            let path = release.path(asset);
            Ok(Change { asset: asset.clone(), before: before.to_owned(), path, content })
        };
        let firmware = firmware.filter(|asset| asset.version != camera.firmware);
        Ok(Self {
            board: camera.board.clone(),
            firmware: firmware.map(|asset| change(asset, &camera.firmware)).transpose()?,
            gateware: bitstream.map(|asset| change(asset, &camera.gateware)).transpose()?,
        })
        .and_then(|plan| match &plan.gateware {
            Some(gateware) if is_simulated(&camera.board) => {
                let (file, board) = (gateware.asset.file.clone(), camera.board.clone());
                Err(UpdateError::LoadsNone { file, board })
            }
            Some(gateware) => {
                let most = Board::named(&camera.board).and_then(|board| board.staging_bytes);
                let bytes = gateware.content.len();
                match most.filter(|&most| bytes as u64 > most) {
                    Some(most) => {
                        let (file, board) = (gateware.asset.file.clone(), camera.board.clone());
                        Err(UpdateError::TooLong { file, bytes, board, most })
                    }
                    None => Ok(plan),
                }
            }
            _ => Ok(plan),
        })
    }

    /// The chip of the camera's board, as probe-rs names it; `None` if the board has none or is
    /// unknown.
    #[must_use]
    pub fn chip(&self) -> Option<&'static str> {
        Board::named(&self.board)?.chip
    }
}

/// One line a part: its version before and after.
impl fmt::Display for Plan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let line = |change: &Option<Change>| match change {
            Some(Change { asset, before, .. }) => {
                format!("{before} -> {} ({})", asset.version, asset.file)
            }
            None => "unchanged".to_owned(),
        };
        write!(f, "firmware: {}\ngateware: {}", line(&self.firmware), line(&self.gateware))
    }
}

/// Loads the gateware of a plan and checks that the FPGA runs its version. A load that was cut goes on
/// where it stopped, if the camera still has the first part. `progress` receives the number of bytes
/// that the camera has.
///
/// # Errors
/// [`UpdateError::Gateware`], or [`UpdateError::NotRunning`] if the FPGA reports another version.
pub fn load_gateware(
    session: &mut Session,
    change: &Change,
    progress: &mut dyn FnMut(u32),
) -> Result<(), UpdateError> {
    let register = gateware::load(session, &change.content, progress)?;
    expect(
        Component::Gateware,
        &Version::of_register(register).to_string(),
        &change.asset.version,
    )?;
    let fpga = Fpga::ask(session, &mut IgnorePackets).map_err(GatewareError::from)?;
    match fpga.check_gateware() {
        Ok(Design::BringUp) => Err(UpdateError::BringUp { file: change.asset.file.clone() }),
        _ => Ok(()),
    }
}

/// Opens a session with a camera whose firmware was just written, as soon as the camera answers, and
/// checks that it reports the new version.
///
/// # Errors
/// That of the last attempt after 15 s; [`UpdateError::NotRunning`] if the camera reports another
/// version.
pub fn await_firmware<E: From<UpdateError>>(
    change: &Change,
    mut open: impl FnMut() -> Result<Session, E>,
) -> Result<Session, E> {
    let begun = Instant::now();
    let session = loop {
        match open() {
            Ok(session) => break session,
            Err(error) if begun.elapsed() > RESTART_TIME => return Err(error),
            Err(_) => std::thread::sleep(Duration::from_millis(250)),
        }
    };
    let reported = &session.identity().firmware;
    expect(Component::Firmware, reported, &change.asset.version).map_err(E::from)?;
    Ok(session)
}

fn expect(component: Component, found: &str, expected: &str) -> Result<(), UpdateError> {
    if found == expected {
        return Ok(());
    }
    let (found, expected) = (found.to_owned(), expected.to_owned());
    Err(UpdateError::NotRunning { component, found, expected })
}
