//! Keeps compiled CUDA kernels between runs of a program.
//!
//! CubeCL compiles a kernel when it is first launched, which takes seconds for all kernels of the
//! networks together. CubeCL can keep their PTX in a folder, and does so if its configuration names
//! one. This module names one, in the user's folder for caches.
//!
//! # Invariant
//! A kernel of another version of this crate, or for another GPU, is never loaded. CubeCL keeps a
//! kernel by the name of its function and by what the function is compiled for, and neither of them
//! says what the function does. So the folder's name has the version and a number of all sources
//! of this crate, the GPU's compute capability and NVRTC's version
//! (`tests::another_version_or_gpu_has_another_folder`). CubeCL adds its own version.
//!
//! CubeCL panics if it cannot write to the folder, so `enable` tries that first. If it fails, kernels
//! are compiled in each run, and [`trouble`] says why.

use cubecl::config::cache::CacheConfig;
use cubecl::config::{CubeClRuntimeConfig, RuntimeConfig};
use etcetera::BaseStrategy;
use std::ffi::OsString;
use std::fmt;
use std::fs::{self, OpenOptions};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, Once, PoisonError};
use std::time::{Duration, SystemTime};

/// The environment variable that names the folder; `off` for none.
const VARIABLE: &str = "NIRSPI_KERNEL_CACHE";

/// A number of all sources of this crate, by `build.rs`.
const SOURCES: &str = env!("NIRSPI_GPU_SOURCES");

/// A folder of another build is removed if no program has used it for this time.
const KEPT: Duration = Duration::from_secs(30 * 24 * 3600);

/// What compiled kernels depend on, besides this crate's sources.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Compiled {
    /// The GPU's compute capability, major and minor.
    pub capability: (i32, i32),
    /// NVRTC's version, major and minor.
    pub compiler: (i32, i32),
}

impl fmt::Display for Compiled {
    /// The name of the folder.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { capability: (major, minor), compiler: (nvrtc, point) } = self;
        let version = env!("CARGO_PKG_VERSION");
        write!(f, "{version}-{SOURCES}-sm_{major}{minor}-nvrtc{nvrtc}.{point}")
    }
}

static TROUBLE: Mutex<Option<String>> = Mutex::new(None);

/// Why compiled kernels cannot be kept, in one line; `None` if they are, if the user turned that off,
/// or after the first call.
#[must_use]
pub fn trouble() -> Option<String> {
    TROUBLE.lock().unwrap_or_else(PoisonError::into_inner).take()
}

/// Has CubeCL keep compiled kernels from now on, if it has made no client yet and the user has not
/// configured it otherwise (`compilation.cache` in `cubecl.toml`).
pub(crate) fn enable(compiled: Compiled) {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        let mut config = CubeClRuntimeConfig::from_current_dir().override_from_env();
        if config.compilation.cache.is_none() {
            match folder(std::env::var_os(VARIABLE), caches(), compiled) {
                Ok(found) => config.compilation.cache = found.map(CacheConfig::File),
                Err(why) => *TROUBLE.lock().unwrap_or_else(PoisonError::into_inner) = Some(why),
            }
        }
        let mut used = CubeClRuntimeConfig::storage().lock();
        // A program that uses CubeCL itself may have been first.
        if used.is_none() {
            *used = Some(Arc::new(config));
        }
    });
}

/// The user's folder for caches, if there is a home directory.
fn caches() -> Option<PathBuf> {
    Some(etcetera::choose_base_strategy().ok()?.cache_dir())
}

/// The folder for these kernels, which can be written to; `None` if the user wants none.
fn folder(
    variable: Option<OsString>,
    caches: Option<PathBuf>,
    compiled: Compiled,
) -> Result<Option<PathBuf>, String> {
    let parent = match variable {
        Some(off) if off == "off" => return Ok(None),
        Some(path) if !path.is_empty() => PathBuf::from(path),
        _ => caches
            .ok_or_else(|| {
                format!(
                    "GPU kernels are compiled in each run, which takes seconds: no home directory; \
                     set {VARIABLE} to a folder, or to off"
                )
            })?
            .join("nirspi")
            .join("kernels"),
    };
    let folder = parent.join(compiled.to_string());
    let is_new = !folder.exists();
    fs::create_dir_all(&folder).and_then(|()| writable(&folder)).map_err(|error| {
        format!(
            "GPU kernels are compiled in each run, which takes seconds: {}: {error}; set {VARIABLE} \
             to a folder that can be written to, or to off",
            folder.display()
        )
    })?;
    if is_new {
        clear(&parent, SystemTime::now());
    }
    Ok(Some(folder))
}

/// Checks that a folder and everything in it can be written to. This also marks the folder as used.
fn writable(folder: &Path) -> io::Result<()> {
    let attempt = folder.join(format!("attempt-{}", std::process::id()));
    fs::write(&attempt, b"nirspi looks whether this folder can be written to\n")?;
    fs::remove_file(&attempt)?;
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_dir() {
            writable(&path)?;
        } else if path
            .extension()
            .is_some_and(|extension| extension == "cbor" || extension == "log")
        {
            OpenOptions::new().append(true).open(&path)?;
        }
    }
    Ok(())
}

/// Removes the folders of other builds whose last use is longer ago than [`KEPT`]. A folder that
/// cannot be removed stays.
fn clear(parent: &Path, now: SystemTime) {
    let Ok(entries) = fs::read_dir(parent) else { return };
    for path in entries.filter_map(|entry| Some(entry.ok()?.path())) {
        let is_ours =
            path.file_name().is_some_and(|name| name.to_string_lossy().contains("-nvrtc"));
        let used = path.metadata().and_then(|found| found.modified());
        let is_old = used.is_ok_and(|used| now.duration_since(used).is_ok_and(|age| age > KEPT));
        if is_ours && is_old {
            let _ = fs::remove_dir_all(&path);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const H100: Compiled = Compiled { capability: (9, 0), compiler: (13, 0) };

    /// An empty folder of this test.
    fn empty(test: &str) -> PathBuf {
        let path = std::env::temp_dir().join(format!("nirspi-gpu-{test}-{}", std::process::id()));
        let _ = fs::remove_dir_all(&path);
        fs::create_dir_all(&path).unwrap();
        path
    }

    #[test]
    fn another_version_or_gpu_has_another_folder() {
        let name = H100.to_string();
        let start = format!("{}-{SOURCES}-sm_90-", env!("CARGO_PKG_VERSION"));
        assert!(name.starts_with(&start) && SOURCES.len() == 16, "{name}");
        assert_ne!(Compiled { capability: (8, 0), ..H100 }.to_string(), name);
        assert_ne!(Compiled { compiler: (12, 8), ..H100 }.to_string(), name);
    }

    #[test]
    fn the_folder_is_below_the_users_caches_or_where_the_variable_says() {
        let caches = empty("caches");
        let usual = folder(None, Some(caches.clone()), H100).unwrap().unwrap();
        assert_eq!(usual, caches.join("nirspi").join("kernels").join(H100.to_string()));
        let other = caches.join("other");
        let named = folder(Some(other.clone().into()), None, H100).unwrap().unwrap();
        assert_eq!(named, other.join(H100.to_string()));
        assert!(usual.is_dir() && named.is_dir());
        assert_eq!(fs::read_dir(&usual).unwrap().count(), 0, "nothing is left of the attempt");
        assert_eq!(folder(Some("off".into()), Some(caches.clone()), H100), Ok(None));
        fs::remove_dir_all(caches).unwrap();
    }

    #[test]
    fn a_folder_that_cannot_be_written_to_is_one_line() {
        let caches = empty("refused");
        // A file stands where the folder would be: also root is refused.
        fs::write(caches.join("nirspi"), "").unwrap();
        let line = folder(None, Some(caches.clone()), H100).unwrap_err();
        assert!(line.starts_with("GPU kernels are compiled in each run") && !line.contains('\n'));
        assert!(line.contains(VARIABLE), "{line}");
        let line = folder(None, None, H100).unwrap_err();
        assert!(line.contains("no home directory"), "{line}");
        fs::remove_dir_all(caches).unwrap();
    }

    #[test]
    fn folders_of_other_builds_are_removed_after_a_time_without_use() {
        let parent = empty("old");
        for name in ["0.0.1-0-sm_90-nvrtc13.0", "mine"] {
            fs::create_dir_all(parent.join(name).join("cuda")).unwrap();
        }
        clear(&parent, SystemTime::now());
        assert!(parent.join("0.0.1-0-sm_90-nvrtc13.0").exists());
        clear(&parent, SystemTime::now() + 2 * KEPT);
        assert!(!parent.join("0.0.1-0-sm_90-nvrtc13.0").exists());
        assert!(parent.join("mine").exists(), "not a folder of kernels");
        fs::remove_dir_all(parent).unwrap();
    }
}
