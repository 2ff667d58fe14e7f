//! A release folder: `release.json`, and the firmware and gateware that it lists.
//!
//! # Invariant
//! Bytes leave a release only if their number and their SHA-256 are those of the manifest
//! (`tests::a_file_that_is_cut_or_changed_is_refused`).

use super::UpdateError;
use nirspi::boards::BOARDS;
use nirspi::files::output::OutputDir;
use nirspi::files::{FileError, read_at_most, read_text};
use nirspi_mcu::staging;
use nirspi_wire::{Version, register::Register, version};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::fmt;
use std::fs;
use std::path::{Path, PathBuf};

/// The largest file of a release that is read: firmware with all its debug information.
const MAX_BYTES: u64 = 256 << 20;

/// Name of the manifest in a release folder.
pub const MANIFEST: &str = "release.json";

/// The part of a camera that a file is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Component {
    /// The microcontroller's firmware: an ELF file.
    Firmware,
    /// The FPGA's gateware: a bitstream.
    Gateware,
}

impl Component {
    /// Whether a file begins as a file for this part does.
    fn begins(self, bytes: &[u8]) -> bool {
        match self {
            Self::Firmware => bytes.starts_with(b"\x7fELF"),
            Self::Gateware => staging::stored(bytes).is_some(),
        }
    }
}

impl fmt::Display for Component {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Firmware => "firmware",
            Self::Gateware => "gateware",
        })
    }
}

/// One file of a release.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Asset {
    /// Name of the file in the release folder.
    pub file: String,
    /// The part that the file is for.
    pub component: Component,
    /// The board: of the microcontroller for firmware, of the FPGA for gateware.
    pub board: String,
    /// The version that the camera reports when the file runs.
    pub version: String,
    /// Length of the file in bytes.
    pub bytes: u64,
    /// SHA-256 of the file, in hexadecimal.
    pub sha256: String,
}

/// What `release.json` says.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Manifest {
    /// Version of nirspi.
    pub version: String,
    /// The newest protocol version that the firmware speaks.
    pub protocol: u16,
    /// The files, each once.
    pub files: Vec<Asset>,
}

/// A release folder, or one file of it.
#[derive(Debug, Clone)]
pub struct Release {
    folder: PathBuf,
    manifest: Manifest,
}

impl Release {
    /// Reads the manifest of a release folder. For the path of a file, the release is that of its
    /// folder, with this file alone.
    ///
    /// # Errors
    /// [`UpdateError`] if there is no manifest, the manifest is wrong, or it does not list the file.
    pub fn open(path: &Path) -> Result<Self, UpdateError> {
        let is_folder = path.is_dir();
        if !is_folder && !path.is_file() {
            let missing =
                fs::metadata(path).err().unwrap_or_else(|| std::io::ErrorKind::NotFound.into());
            return Err(FileError::io(path, "read", missing).into());
        }
        let folder = if is_folder { path } else { path.parent().unwrap_or(Path::new("")) };
        let manifest = folder.join(MANIFEST);
        if !manifest.is_file() {
            return Err(UpdateError::NoManifest(path.to_owned()));
        }
        let text = read_text(&manifest, "the manifest of a release")?;
        let mut release = Self { folder: folder.to_owned(), manifest: read(&manifest, &text)? };
        if release.manifest.files.is_empty() {
            return Err(UpdateError::Empty(manifest));
        }
        if !is_folder {
            let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
            release.manifest.files.retain(|asset| asset.file == name);
            if release.manifest.files.is_empty() {
                return Err(UpdateError::NotListed { manifest, file: name.to_owned() });
            }
        }
        Ok(release)
    }

    /// What the manifest says.
    #[must_use]
    pub fn manifest(&self) -> &Manifest {
        &self.manifest
    }

    /// The path of a file of the release.
    #[must_use]
    pub fn path(&self, asset: &Asset) -> PathBuf {
        self.folder.join(&asset.file)
    }

    /// Reads a file of the release.
    ///
    /// # Errors
    /// [`UpdateError`] if the file cannot be read, or is not the file that the manifest describes.
    pub fn bytes(&self, asset: &Asset) -> Result<Vec<u8>, UpdateError> {
        let path = self.path(asset);
        let read = |error| FileError::io(&path, "read", error);
        let found = fs::metadata(&path).map_err(read)?;
        // What is no file has no length.
        if found.is_file() && found.len() != asset.bytes {
            let found = found.len();
            return Err(UpdateError::Cut { path, found, expected: asset.bytes });
        }
        let bytes = read_at_most(&path, MAX_BYTES).map_err(read)?;
        let found = sha256(&bytes);
        if found != asset.sha256 {
            return Err(UpdateError::Changed { path, found, expected: asset.sha256.clone() });
        }
        if !asset.component.begins(&bytes) {
            return Err(UpdateError::NotOfThisKind { path, component: asset.component });
        }
        Ok(bytes)
    }
}

fn sha256(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Reads and checks the text of a manifest.
fn read(path: &Path, text: &str) -> Result<Manifest, UpdateError> {
    let manifest: Manifest = serde_json::from_str(text)
        .map_err(|source| UpdateError::Manifest { path: path.to_owned(), source })?;
    for (index, asset) in manifest.files.iter().enumerate() {
        let field = |name: &str| format!("files[{index}].{name}");
        let is_name =
            Path::new(&asset.file).file_name().is_some_and(|name| name == asset.file.as_str());
        if !is_name || asset.file.contains(['/', '\\']) {
            let expected = "the name of a file in the release folder";
            return Err(FileError::field(
                path,
                field("file"),
                format!("{:?}", asset.file),
                expected,
            )
            .into());
        }
        let is_hex = asset.sha256.len() == 64
            && asset.sha256.bytes().all(|byte| matches!(byte, b'0'..=b'9' | b'a'..=b'f'));
        if !is_hex {
            let expected = "64 hexadecimal digits in lower case";
            return Err(FileError::field(
                path,
                field("sha256"),
                format!("{:?}", asset.sha256),
                expected,
            )
            .into());
        }
    }
    Ok(manifest)
}

/// A file that becomes part of a release.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Source {
    /// The file, as a build left it.
    pub path: PathBuf,
    /// The part that it is for.
    pub component: Component,
    /// The board that it is for.
    pub board: String,
}

impl Source {
    /// The files of a release as the builds leave them in a checkout of the repository: the firmware
    /// of every board with a chip (`boards/build.sh`), and the bitstream of every FPGA board that was
    /// built (`hdl/build.py`).
    ///
    /// # Errors
    /// [`FileError`] if a folder cannot be read.
    pub fn of_checkout(root: &Path) -> Result<Vec<Self>, FileError> {
        let boards = BOARDS.iter().filter(|board| board.chip.is_some());
        let firmware = boards.map(|board| Self {
            path: root.join(board.elf()),
            component: Component::Firmware,
            board: board.name.to_owned(),
        });
        let mut sources: Vec<Self> = firmware.collect();
        let gateware = root.join("target/gateware");
        let entries =
            fs::read_dir(&gateware).map_err(|error| FileError::io(&gateware, "read", error))?;
        for entry in entries {
            let entry = entry.map_err(|error| FileError::io(&gateware, "read", error))?;
            let (path, board) = (entry.path().join("nirspi.bit"), entry.file_name());
            if let (true, Some(board)) = (path.is_file(), board.to_str()) {
                sources.push(Self {
                    path,
                    component: Component::Gateware,
                    board: board.to_owned(),
                });
            }
        }
        sources.sort_by(|a, b| a.board.cmp(&b.board));
        Ok(sources)
    }
}

/// Copies files into a release folder and writes its manifest, all at once or not at all. Versions
/// are those of this library, from whose checkout the files were built.
///
/// # Errors
/// [`UpdateError`] if a file cannot be read or written, or is not what it should be.
pub fn pack(sources: &[Source], out: &Path) -> Result<Manifest, UpdateError> {
    let mut folder = OutputDir::create(out)?;
    let mut files = Vec::new();
    for Source { path, component, board } in sources {
        let read = |error| FileError::io(path, "read", error);
        let bytes = read_at_most(path, MAX_BYTES).map_err(read)?;
        if !component.begins(&bytes) {
            return Err(UpdateError::NotOfThisKind { path: path.clone(), component: *component });
        }
        let (ending, version) = match component {
            Component::Firmware => ("elf", env!("CARGO_PKG_VERSION").to_owned()),
            Component::Gateware => {
                ("bit", Version::of_register(Register::Version.reset()).to_string())
            }
        };
        let file = format!("{board}.{ending}");
        folder.write(&file, &bytes)?;
        files.push(Asset {
            file,
            component: *component,
            board: board.clone(),
            version,
            bytes: bytes.len() as u64,
            sha256: sha256(&bytes),
        });
    }
    let manifest = Manifest {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        protocol: version::CURRENT,
        files,
    };
    let text = serde_json::to_string_pretty(&manifest)
        .map_err(|source| UpdateError::Manifest { path: out.join(MANIFEST), source })?;
    folder.write(MANIFEST, format!("{text}\n").as_bytes())?;
    folder.commit()?;
    Ok(manifest)
}
