//! Linux: the udev rule that gives the user at the machine, and a group, access to cameras on USB.
//!
//! # Invariant
//! A file of another program is neither replaced nor removed
//! (`tests::a_file_of_someone_else_is_left_as_it_is`).

use nirspi_files::FileError;
use nirspi_files::output::keep;
use nirspi_files::read_small_text;
use nirspi_wire::usb::{PRODUCT, PRODUCT_ID, VENDOR_ID};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::str::FromStr;
use thiserror::Error;

/// The folder of the machine's local rules.
pub const RULES_DIR: &str = "/etc/udev/rules.d";
/// Name of the rule. `uaccess` acts in `73-seat-late.rules`, so the number must be lower.
pub const RULE_NAME: &str = "60-nirspi.rules";
/// The first words of every version of the rule.
const OURS: &str = "# The nirspi camera";

/// A group of users who may open the camera wherever they are: over SSH, in a service.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Group(String);

/// Why a group cannot be in the rule.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum GroupError {
    /// The name has other characters than names of groups.
    #[error("{0:?} is no name of a group: expected letters, digits, _ and -")]
    Name(String),
    /// This machine has no such group.
    #[error("this machine has no group {0}")]
    Unknown(String),
}

impl FromStr for Group {
    type Err = GroupError;

    fn from_str(name: &str) -> Result<Self, GroupError> {
        let is_of_name = |byte: u8| byte.is_ascii_alphanumeric() || byte == b'_' || byte == b'-';
        if name.is_empty() || name.starts_with('-') || !name.bytes().all(is_of_name) {
            return Err(GroupError::Name(name.to_owned()));
        }
        Ok(Self(name.to_owned()))
    }
}

impl Group {
    /// Checks that this machine has the group. udev passes over one that it does not have.
    ///
    /// # Errors
    /// If this machine says that it has none of this name.
    pub fn check(&self) -> Result<(), GroupError> {
        // Code 2: no such entry. Without the program nothing is known.
        let asked = Command::new("getent").args(["group", &self.0]).stdout(Stdio::null()).status();
        match asked.map(|status| status.code()) {
            Ok(Some(2)) => Err(GroupError::Unknown(self.0.clone())),
            _ => Ok(()),
        }
    }
}

const MODE_AND_GROUP: &str = ", MODE=\"0660\", GROUP=\"";

/// The group in the text of a rule.
fn group_of(text: &str) -> Option<Group> {
    text.split_once(MODE_AND_GROUP)?.1.split_once('"')?.0.parse().ok()
}

/// The text of the rule, for a group too if there is one.
#[must_use]
pub fn rule(group: Option<&Group>) -> String {
    let group = group.map_or(String::new(), |Group(name)| format!("{MODE_AND_GROUP}{name}\""));
    format!(
        "{OURS} (mcu/wire/src/usb.rs). The user logged in at this machine may open the camera.\n\
         # The number 60 must be below 73, because the tag uaccess takes effect in 73-seat-late.rules.\n\
         SUBSYSTEM==\"usb\", ATTR{{idVendor}}==\"{VENDOR_ID:04x}\", ATTR{{idProduct}}==\"{PRODUCT_ID:04x}\", \
         ATTR{{product}}==\"{PRODUCT}\", TAG+=\"uaccess\"{group}\n"
    )
}

/// Whether the rule is installed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Installed {
    /// Installed, with the text of this version.
    Yes,
    /// Installed, with the text of another version.
    Other,
    /// Not installed.
    No,
}

/// Why the rule was not changed.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum RuleError {
    /// A file of another program has the rule's name.
    #[error("{0}: not written by nirspi, so left as it is")]
    Foreign(PathBuf),
    /// The rule cannot be read or removed.
    #[error("{path}: cannot read or remove it")]
    Io {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: io::Error,
    },
    /// The rule cannot be written.
    #[error(transparent)]
    Write(#[from] FileError),
}

impl RuleError {
    /// Whether more rights would help.
    #[must_use]
    pub fn is_permission(&self) -> bool {
        let source = match self {
            Self::Foreign(_) => return false,
            Self::Io { source, .. } => Some(source),
            Self::Write(FileError::Io { system, .. }) => Some(system),
            Self::Write(_) => None,
        };
        source.is_some_and(|source| source.kind() == io::ErrorKind::PermissionDenied)
    }
}

/// Whether the rule is installed in `folder`.
///
/// # Errors
/// If another file has the rule's name, or the rule cannot be read.
pub fn check(folder: &Path) -> Result<Installed, RuleError> {
    let path = folder.join(RULE_NAME);
    match read_small_text(&path) {
        Ok(text) if text == rule(group_of(&text).as_ref()) => Ok(Installed::Yes),
        Ok(text) if text.starts_with(OURS) => Ok(Installed::Other),
        Ok(_) => Err(RuleError::Foreign(path)),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(Installed::No),
        Err(source) => Err(RuleError::Io { path, source }),
    }
}

/// Writes the rule into `folder`, for `group` too, or for the group of the rule that is there. Returns
/// whether anything was changed.
///
/// # Errors
/// As [`check`], and if the rule cannot be written.
pub fn install(folder: &Path, group: Option<&Group>) -> Result<bool, RuleError> {
    let path = folder.join(RULE_NAME);
    let there = match check(folder)? {
        Installed::No => None,
        Installed::Yes | Installed::Other => read_small_text(&path).ok(),
    };
    let wanted = rule(group.cloned().or_else(|| group_of(there.as_deref()?)).as_ref());
    if there.as_ref() == Some(&wanted) {
        return Ok(false);
    }
    keep(&path, wanted.as_bytes())?;
    Ok(true)
}

/// Removes the rule from `folder`. Returns whether there was a rule.
///
/// # Errors
/// As [`check`], and if the rule cannot be removed.
pub fn uninstall(folder: &Path) -> Result<bool, RuleError> {
    if check(folder)? == Installed::No {
        return Ok(false);
    }
    let path = folder.join(RULE_NAME);
    fs::remove_file(&path).map_err(|source| RuleError::Io { path, source })?;
    Ok(true)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rule_is_installed_once_replaced_when_old_and_removed() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        assert_eq!(check(folder).unwrap(), Installed::No);
        assert!(install(folder, None).unwrap());
        assert!(!install(folder, None).unwrap());
        assert_eq!(check(folder).unwrap(), Installed::Yes);
        fs::write(folder.join(RULE_NAME), format!("{OURS} as of long ago\n")).unwrap();
        assert_eq!(check(folder).unwrap(), Installed::Other);
        assert!(install(folder, None).unwrap());
        assert!(uninstall(folder).unwrap());
        assert!(!uninstall(folder).unwrap());
        assert_eq!(fs::read_dir(folder).unwrap().count(), 0);
    }

    #[test]
    fn a_group_is_in_the_rule_and_stays_until_another_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        let text = || fs::read_to_string(folder.join(RULE_NAME)).unwrap();
        let group = |name: &str| name.parse::<Group>().unwrap();
        assert!(install(folder, None).unwrap());
        assert!(install(folder, Some(&group("plugdev"))).unwrap());
        assert!(
            text().ends_with("TAG+=\"uaccess\", MODE=\"0660\", GROUP=\"plugdev\"\n"),
            "{}",
            text()
        );
        assert_eq!(check(folder).unwrap(), Installed::Yes);
        assert!(!install(folder, None).unwrap());
        assert!(!install(folder, Some(&group("plugdev"))).unwrap());
        assert!(install(folder, Some(&group("lab"))).unwrap());
        assert!(text().contains("GROUP=\"lab\""), "{}", text());
        for name in ["", "-x", "a b", "x\", RUN+=\"sh", "grüppe"] {
            assert!(name.parse::<Group>().is_err(), "{name}");
        }
        assert_eq!(group("root").check(), Ok(()));
    }

    #[test]
    fn a_file_of_someone_else_is_left_as_it_is() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(RULE_NAME);
        fs::write(&path, "# mine\n").unwrap();
        for error in
            [install(folder.path(), None).unwrap_err(), uninstall(folder.path()).unwrap_err()]
        {
            assert!(matches!(error, RuleError::Foreign(_)), "{error}");
        }
        assert_eq!(fs::read_to_string(&path).unwrap(), "# mine\n");
    }

    #[test]
    fn a_missing_permission_is_told_from_other_trouble() {
        let error = |kind: io::ErrorKind| {
            RuleError::Write(FileError::Io {
                path: PathBuf::from("/etc/udev/rules.d"),
                attempt: "write",
                system: kind.into(),
            })
        };
        assert!(error(io::ErrorKind::PermissionDenied).is_permission());
        assert!(!error(io::ErrorKind::StorageFull).is_permission());
        assert!(!RuleError::Foreign(PathBuf::new()).is_permission());
    }

    /// `boards/60-nirspi.rules` is for users who install the rule by hand.
    #[test]
    fn the_rule_is_that_of_the_boards_folder() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../boards").join(RULE_NAME);
        assert_eq!(fs::read_to_string(path).unwrap(), rule(None));
    }
}
