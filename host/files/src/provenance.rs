//! Where the readings of a picture, report or export come from, and what made it of them.
//!
//! Every function that writes one takes a [`Provenance`], so that none can leave it out. A PNG has it
//! in text chunks, a picture for people also as a line of text below the image, JSON as the object
//! `provenance`, an `.npz` file as the field `provenance`, an MCAP file as a metadata record.
//! `docs/results.md` lists where each kind of file has it.
//!
//! # Invariant
//! No secret of the command line is written (`tests::secrets_of_the_command_line_are_left_out`).

use crate::identity::CameraIdentity;
use crate::{boards, clock};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// The key of the JSON text: a PNG's text chunk and an MCAP file's metadata record.
pub const KEY: &str = "nirspi-provenance";

/// The field with the provenance as JSON: of an archive, and of the report beside an array.
pub const FIELD: &str = "provenance";

/// Where readings come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Origin {
    /// A virtual camera or a model: no light was measured.
    #[serde(rename = "simulated")]
    Simulated,
    /// A camera measured light.
    #[serde(rename = "measured")]
    Measured,
    /// There are no readings: times of a benchmark, a comparison of two files.
    #[serde(rename = "computed")]
    Computed,
    /// A file that does not say what its numbers are.
    #[serde(rename = "unknown (readings of a file)")]
    Unknown,
}

impl fmt::Display for Origin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Simulated => "simulated",
            Self::Measured => "measured",
            Self::Computed => "computed",
            Self::Unknown => "origin unknown",
        })
    }
}

/// The camera that made the readings.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Camera {
    /// Board name.
    pub board: String,
    /// Serial number.
    pub serial: String,
    /// Firmware version.
    pub firmware: String,
    /// Gateware version.
    pub gateware: String,
    /// Protocol version.
    pub protocol: u16,
}

impl From<&CameraIdentity> for Camera {
    fn from(camera: &CameraIdentity) -> Self {
        Self {
            board: camera.board.clone(),
            serial: camera.serial.clone(),
            firmware: camera.firmware.clone(),
            gateware: camera.gateware.clone(),
            protocol: camera.protocol,
        }
    }
}

/// What readings are: their origin, the camera if it is known, and the file if they were read from
/// one.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Taken {
    /// Where the readings come from.
    pub origin: Origin,
    /// The camera; `None` for readings without a camera, or of an unknown one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub camera: Option<Camera>,
    /// The name of the file that held the readings, without its folder.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub file: Option<String>,
}

impl Taken {
    /// Readings of a camera.
    #[must_use]
    pub fn by(camera: &CameraIdentity) -> Self {
        let origin = match boards::is_simulated(&camera.board) {
            true => Origin::Simulated,
            false => Origin::Measured,
        };
        Self { origin, camera: Some(camera.into()), file: None }
    }

    /// Readings of a file whose camera is unknown. `simulated` is what the file says of that.
    #[must_use]
    pub fn of_file(path: &Path, simulated: Option<bool>) -> Self {
        Self::simulated_or(simulated).from_file(path)
    }

    /// Readings of which no more is known than whether they are simulated, and maybe not that.
    #[must_use]
    pub fn simulated_or(simulated: Option<bool>) -> Self {
        Self::without_camera(match simulated {
            Some(true) => Origin::Simulated,
            Some(false) => Origin::Measured,
            None => Origin::Unknown,
        })
    }

    /// No readings of a camera: those of a model, or none.
    #[must_use]
    pub fn without_camera(origin: Origin) -> Self {
        Self { origin, camera: None, file: None }
    }

    /// The same readings, which a file held.
    #[must_use]
    pub fn from_file(self, path: &Path) -> Self {
        let name = path.file_name().unwrap_or(path.as_os_str());
        Self { file: Some(name.to_string_lossy().into_owned()), ..self }
    }

    /// Whether no light was measured; `None` if that is not known.
    #[must_use]
    pub fn simulated(&self) -> Option<bool> {
        match self.origin {
            Origin::Simulated => Some(true),
            Origin::Measured => Some(false),
            Origin::Computed | Origin::Unknown => None,
        }
    }

    /// The provenance of what `made` makes of these readings.
    #[must_use]
    pub fn made(&self, made: &Made) -> Provenance {
        Provenance { taken: self.clone(), made: made.clone() }
    }
}

/// The program that makes pictures, reports and exports: its version, command and date.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Made {
    /// Name and version, such as `nirspi 0.1.0`.
    pub program: String,
    /// The commit of the sources; `None` if the program's build did not know the commit.
    pub commit: Option<String>,
    /// The command line as typed, without secrets.
    pub command: String,
    /// When the program started, in UTC, RFC 3339: `2026-11-25T08:30:00Z`.
    pub date: String,
}

impl Made {
    /// A program that was started `unix_s` seconds after 1970 by these arguments, of which the first
    /// is its name.
    #[must_use]
    pub fn by<A: AsRef<str>>(
        program: &str,
        commit: Option<&str>,
        arguments: impl IntoIterator<Item = A>,
        unix_s: u64,
    ) -> Self {
        Self {
            program: program.to_owned(),
            commit: commit.map(str::to_owned),
            command: command_line(arguments),
            date: clock::rfc3339(unix_s),
        }
    }

    /// As [`by`](Self::by), started at this moment. The variable `SOURCE_DATE_EPOCH` of the
    /// environment, in seconds since 1970, gives another date: for files that are the same whenever
    /// they are made (<https://reproducible-builds.org/specs/source-date-epoch>).
    #[must_use]
    pub fn now<A: AsRef<str>>(
        program: &str,
        commit: Option<&str>,
        arguments: impl IntoIterator<Item = A>,
    ) -> Self {
        let epoch = std::env::var("SOURCE_DATE_EPOCH").ok();
        let given = epoch.and_then(|seconds| seconds.trim().parse().ok());
        let unix_s = given.unwrap_or_else(|| clock::since_1970().as_secs());
        Self::by(program, commit, arguments, unix_s)
    }
}

/// Where the readings of a picture, report or export come from, and what made it of them.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Provenance {
    /// What the readings are.
    #[serde(flatten)]
    pub taken: Taken,
    /// What made the file of them.
    #[serde(flatten)]
    pub made: Made,
}

impl Provenance {
    /// The readings in words: `simulated, camera virtual-1`.
    #[must_use]
    pub fn source(&self) -> String {
        let Taken { origin, camera, file } = &self.taken;
        let mut text = origin.to_string();
        match (camera, file) {
            (Some(camera), _) => text += &format!(", camera {}", camera.serial),
            (None, Some(file)) => text += &format!(", file {file}"),
            (None, None) => {}
        }
        text.replace(char::is_control, "?")
    }

    /// The program in words: `nirspi 0.1.0 (0123456789ab)`.
    #[must_use]
    pub fn software(&self) -> String {
        match &self.made.commit {
            Some(commit) => format!("{} ({commit})", self.made.program),
            None => self.made.program.clone(),
        }
    }

    /// The provenance as JSON in one line, in ASCII.
    #[must_use]
    pub fn json(&self) -> String {
        let text = serde_json::to_string(self).unwrap_or_default();
        let mut ascii = String::with_capacity(text.len());
        for letter in text.chars() {
            match letter.is_ascii() {
                true => ascii.push(letter),
                false => {
                    let units = letter.encode_utf16(&mut [0; 2]).to_vec();
                    units.iter().for_each(|unit| ascii += &format!("\\u{unit:04x}"));
                }
            }
        }
        ascii
    }

    /// A report with its provenance, as readable JSON that ends with a line break. The report must be
    /// a structure or map.
    ///
    /// # Errors
    /// [`serde_json::Error`] if the report is no structure or map.
    pub fn sign(&self, report: &(impl Serialize + ?Sized)) -> serde_json::Result<String> {
        let mut text = Vec::new();
        self.sign_into(report, &mut text).map_err(serde_json::Error::io)?;
        Ok(String::from_utf8_lossy(&text).into_owned())
    }

    /// As [`sign`](Self::sign), for a report that is longer than the memory.
    ///
    /// # Errors
    /// As [`sign`](Self::sign), and those of `to`.
    pub fn sign_into(
        &self,
        report: &(impl Serialize + ?Sized),
        mut to: impl Write,
    ) -> io::Result<()> {
        #[derive(Serialize)]
        struct Signed<'s, R: ?Sized> {
            #[serde(flatten)]
            report: &'s R,
            provenance: &'s Provenance,
        }
        serde_json::to_writer_pretty(&mut to, &Signed { report, provenance: self })?;
        to.write_all(b"\n")
    }
}

/// One short line: `simulated, camera virtual-1, nirspi 0.1.0 (0123456789ab), 2026-11-25`.
impl fmt::Display for Provenance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let day = self.made.date.split('T').next().unwrap_or_default();
        write!(f, "{}, {}, {day}", self.source(), self.software())
    }
}

/// The name of the file with the provenance of an `.npy` file: the same name with `.json` after it.
#[must_use]
pub fn beside_array(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(".json");
    name.into()
}

/// Words in the names of options and of parts of addresses whose values are secrets.
const SECRETS: [&str; 4] = ["token", "password", "secret", "credential"];
/// What stands in the place of a secret.
const HIDDEN: &str = "hidden";

/// The arguments in one line as a shell reads them, without secrets. The name of the program is
/// written without its folder.
fn command_line<A: AsRef<str>>(arguments: impl IntoIterator<Item = A>) -> String {
    let mut words = Vec::new();
    let mut hidden = false;
    for (at, argument) in arguments.into_iter().enumerate() {
        let argument = argument.as_ref();
        let word = match at {
            0 => argument.rsplit(['/', '\\']).next().unwrap_or_default().to_owned(),
            _ if hidden => HIDDEN.to_owned(),
            _ => without_secrets(argument),
        };
        // `--token VALUE`; `--token=VALUE` is one argument.
        hidden = argument.starts_with('-') && is_secret(argument) && !argument.contains('=');
        words.push(quoted(&word));
    }
    words.join(" ")
}

fn is_secret(name: &str) -> bool {
    let name = name.to_ascii_lowercase();
    SECRETS.iter().any(|secret| name.contains(secret))
}

/// An argument without the values of `--token=VALUE` and `?token=VALUE&`, and without the name and
/// password of `scheme://name:password@host`.
fn without_secrets(argument: &str) -> String {
    let mut text = String::new();
    for part in argument.split_inclusive(['?', '&', ';']) {
        let (part, end) = match part.strip_suffix(['?', '&', ';']) {
            Some(inner) => (inner, &part[inner.len()..]),
            None => (part, ""),
        };
        match part.split_once('=') {
            Some((name, _)) if is_secret(name) => text += &format!("{name}={HIDDEN}"),
            _ => text += part,
        }
        text += end;
    }
    let Some((scheme, rest)) = text.split_once("://") else { return text };
    let host_end = rest.find('/').unwrap_or(rest.len());
    match rest[..host_end].rfind('@') {
        Some(at) => format!("{scheme}://{HIDDEN}{}", &rest[at..]),
        None => text,
    }
}

/// A word as a POSIX shell reads it.
#[must_use]
pub fn quoted(word: &str) -> String {
    let plain = |letter: char| letter.is_alphanumeric() || "_-./:=,%+@".contains(letter);
    match !word.is_empty() && word.chars().all(plain) {
        true => word.to_owned(),
        false => format!("'{}'", word.replace('\'', r"'\''")),
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// A provenance for tests of writers.
    pub(crate) fn provenance() -> Provenance {
        let made =
            Made::by("nirspi 0.1.0", Some("0123456789ab"), ["nirspi", "demo"], 1_764_059_400);
        let camera = Camera {
            board: "virtual".into(),
            serial: "virtual-1".into(),
            firmware: "0.1.0".into(),
            gateware: "0.4.0".into(),
            protocol: 1,
        };
        let taken = Taken { origin: Origin::Simulated, camera: Some(camera), file: None };
        taken.made(&made)
    }

    #[test]
    fn the_line_says_all_that_matters_and_json_everything() {
        let all = provenance();
        let line = "simulated, camera virtual-1, nirspi 0.1.0 (0123456789ab), 2025-11-25";
        assert_eq!(all.to_string(), line);
        let expected = serde_json::json!({
            "origin": "simulated",
            "camera": {
                "board": "virtual", "serial": "virtual-1", "firmware": "0.1.0",
                "gateware": "0.4.0", "protocol": 1
            },
            "program": "nirspi 0.1.0",
            "commit": "0123456789ab",
            "command": "nirspi demo",
            "date": "2025-11-25T08:30:00Z",
        });
        assert_eq!(serde_json::to_value(&all).unwrap(), expected);
        assert_eq!(serde_json::from_str::<Provenance>(&all.json()).unwrap(), all);
    }

    #[test]
    fn readings_of_others_are_named_by_their_file_and_have_no_camera() {
        let made = Made::by("nirspi 0.1.0", None, ["nirspi"], 0);
        let path = Path::new("data/flügel \u{1f680}.npz");
        let all = Taken::of_file(path, None).made(&made);
        let line = "origin unknown, file flügel \u{1f680}.npz, nirspi 0.1.0, 1970-01-01";
        assert_eq!(all.to_string(), line);
        let json = all.json();
        assert!(json.is_ascii() && json.contains("\"unknown (readings of a file)\""), "{json}");
        assert_eq!(serde_json::from_str::<Provenance>(&json).unwrap(), all);
        assert_eq!(Taken::of_file(path, Some(true)).simulated(), Some(true));
        assert_eq!(Taken::of_file(path, Some(false)).origin, Origin::Measured);
    }

    #[test]
    fn a_camera_in_an_emulator_is_simulated_and_one_on_a_board_measures() {
        let of = |board: &str| {
            let camera = CameraIdentity::current(board, "A1");
            Taken::by(&camera).origin
        };
        assert_eq!((of("virtual"), of("mps2-an505")), (Origin::Simulated, Origin::Simulated));
        assert_eq!(of("nucleo-u5a5zj-q"), Origin::Measured);
    }

    #[test]
    fn a_report_is_signed_beside_its_own_fields() {
        #[derive(Serialize)]
        struct Report {
            n: usize,
        }
        let text = provenance().sign(&Report { n: 32 }).unwrap();
        let json: serde_json::Value = serde_json::from_str(&text).unwrap();
        assert_eq!((&json["n"], &json["provenance"]["origin"]), (&32.into(), &"simulated".into()));
        assert!(text.ends_with("}\n"));
        assert!(provenance().sign(&[1, 2]).is_err());
    }

    #[test]
    fn secrets_of_the_command_line_are_left_out() {
        for (arguments, line) in [
            (&["/usr/bin/nirspi", "serve", "--token", "abc"][..], "nirspi serve --token hidden"),
            (
                &["nirspi", "serve", "--token=abc", "--frames", "8"],
                "nirspi serve --token=hidden --frames 8",
            ),
            (
                &["nirspi", "x", "http://h:1/?token=abc&a=1"],
                "nirspi x 'http://h:1/?token=hidden&a=1'",
            ),
            (&["nirspi", "http://me:abc@host/b"], "nirspi http://hidden@host/b"),
            (&["nirspi", "tcp:lab@host:7447"], "nirspi tcp:lab@host:7447"),
            (&["nirspi", "--scene", "word:A B", ""], "nirspi --scene 'word:A B' ''"),
            (&["nirspi", "it's"], r"nirspi 'it'\''s'"),
        ] {
            assert_eq!(command_line(arguments), line);
        }
    }
}
