//! Defaults for the options of a program: a settings file (TOML) and environment variables.
//!
//! A settings file names options as the command line does, without the dashes. Options above the
//! first table hold for every command that has them; a table holds for its own command.
//!
//! ```toml
//! camera = "usb"
//!
//! [capture]
//! frames = 1000
//!
//! [eval.table3]
//! scenes = 62
//! ```
//!
//! The variable `NIRSPI_FRAMES` is the option `--frames`.
//!
//! # Invariant
//! The environment beats the file, and a command's own table beats what stands above the table
//! (`tests::the_environment_beats_the_table_and_the_table_beats_what_stands_above`). A name that no
//! command has is refused. What is saved is read back as the same settings
//! (`tests::what_is_saved_is_read_back`).

use crate::files::output::keep;
use crate::files::{FileError, read_text};
use std::collections::BTreeMap;
use std::ffi::OsString;
use std::path::Path;
use thiserror::Error;
use toml::{Table, Value};

const EXPECTED: &str = "a settings file (TOML)";
/// Options that have no environment variable: `NIRSPI_DATA` is the folder of the tests' data.
const NO_VARIABLE: [&str; 1] = ["data"];

/// What an option takes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Takes {
    /// Nothing: the option is there or is not.
    Nothing,
    /// One value or several.
    Value,
}

/// The options of a command and its subcommands, by their long names.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Options {
    /// The command's own options.
    pub own: BTreeMap<String, Takes>,
    /// The subcommands.
    pub commands: BTreeMap<String, Options>,
}

impl Options {
    /// What the option takes, in this command or in one below.
    fn anywhere(&self, name: &str) -> Option<Takes> {
        let below = || self.commands.values().find_map(|command| command.anywhere(name));
        self.own.get(name).copied().or_else(below)
    }

    /// The command at the end of the path.
    fn at(&self, path: &[String]) -> Option<&Self> {
        path.iter().try_fold(self, |command, name| command.commands.get(name))
    }
}

/// One option and where it was given.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Given {
    /// The option's values; none for an option that takes nothing.
    pub values: Vec<String>,
    /// Where the option was given, in words.
    pub origin: String,
}

/// Options by their long names. `None` is an option that is switched off.
pub type Defaults = BTreeMap<String, Option<Given>>;

/// Why settings are refused.
#[derive(Debug, Error)]
pub enum SettingsError {
    /// The settings file.
    #[error(transparent)]
    File(#[from] FileError),
    /// An environment variable.
    #[error("{name} is {found:?}, expected {expected}")]
    Variable {
        /// Name of the variable.
        name: String,
        /// Its value.
        found: String,
        /// What the variable may be.
        expected: &'static str,
    },
}

/// The defaults of the command at the end of `path`, from a settings file.
///
/// # Errors
/// [`FileError`] if the file cannot be read, or names what no command has.
pub fn from_file(file: &Path, all: &Options, path: &[String]) -> Result<Defaults, FileError> {
    let mut found = Defaults::new();
    let leaf = all.at(path).unwrap_or(all);
    walk(
        file,
        &parse(file, &read_text(file, EXPECTED)?)?,
        "",
        (all, leaf),
        Some(path),
        &mut found,
    )?;
    Ok(found)
}

/// The defaults from the environment. `variable` is for example [`std::env::var_os`].
///
/// # Errors
/// [`SettingsError::Variable`] for a value that the option cannot have.
pub fn from_environment(
    options: &Options,
    variable: impl Fn(&str) -> Option<OsString>,
) -> Result<Defaults, SettingsError> {
    let mut found = Defaults::new();
    for (option, takes) in &options.own {
        let name = variable_of(option);
        let Some(value) = variable(&name).filter(|value| !value.is_empty()) else { continue };
        if NO_VARIABLE.contains(&option.as_str()) {
            continue;
        }
        let refuse = |found: String, expected| SettingsError::Variable {
            name: name.clone(),
            found,
            expected,
        };
        let value = value
            .into_string()
            .map_err(|value| refuse(value.to_string_lossy().into_owned(), "text in UTF-8"))?;
        let given = match takes {
            Takes::Value => Some(vec![value]),
            Takes::Nothing => match value.to_lowercase().as_str() {
                "1" | "true" | "yes" | "on" => Some(Vec::new()),
                "0" | "false" | "no" | "off" => None,
                _ => return Err(refuse(value, "1 or 0")),
            },
        };
        let given = given.map(|values| Given { values, origin: name.clone() });
        found.insert(option.clone(), given);
    }
    Ok(found)
}

/// The environment variable of an option: `NIRSPI_DISTANCE_M` of `distance-m`.
#[must_use]
pub fn variable_of(option: &str) -> String {
    format!("NIRSPI_{}", option.to_uppercase().replace('-', "_"))
}

fn field(file: &Path, key: &str, section: &str, found: String, expected: &str) -> FileError {
    let place = if section.is_empty() { String::new() } else { format!("[{section}] ") };
    FileError::Field {
        path: file.to_owned(),
        field: format!("{place}{key}").into(),
        found,
        expected: expected.to_owned(),
    }
}

fn parse(file: &Path, text: &str) -> Result<Table, FileError> {
    text.parse().map_err(|error: toml::de::Error| {
        let before = error.span().map_or("", |span| text.get(..span.start).unwrap_or(""));
        let line = before.matches('\n').count() + 1;
        let why = error.message().split_whitespace().collect::<Vec<_>>().join(" ");
        FileError::Kind {
            path: file.to_owned(),
            found: format!("in line {line}: {why}"),
            expected: EXPECTED,
        }
    })
}

/// Checks a table, and adds the options that hold for the command `leaf` at the end of `path`. A
/// table of another command has no path and is only checked.
fn walk(
    file: &Path,
    table: &Table,
    section: &str,
    (command, leaf): (&Options, &Options),
    path: Option<&[String]>,
    found: &mut Defaults,
) -> Result<(), FileError> {
    let unknown = |key: &str, kind: &str| {
        field(
            file,
            key,
            section,
            format!("is not the name of {kind}"),
            "a long option of the program, without dashes; or a table of a command",
        )
    };
    for (key, value) in table.iter().filter(|(_, value)| !value.is_table()) {
        let own = path.and_then(|_| leaf.own.get(key)).copied();
        let takes =
            own.or_else(|| command.anywhere(key)).ok_or_else(|| unknown(key, "an option"))?;
        let given = values(file, key, section, value, takes)?;
        if own.is_some() {
            let place = if section.is_empty() { String::new() } else { format!(", [{section}]") };
            let origin = format!("{}{place}", file.display());
            found.insert(key.clone(), given.map(|values| Given { values, origin }));
        }
    }
    for (key, value) in table {
        let Value::Table(inner) = value else { continue };
        let below = command.commands.get(key).ok_or_else(|| unknown(key, "a command"))?;
        let section = if section.is_empty() { key.clone() } else { format!("{section}.{key}") };
        let path = path.and_then(|path| path.split_first()).filter(|(first, _)| *first == key);
        walk(file, inner, &section, (below, leaf), path.map(|(_, rest)| rest), found)?;
    }
    Ok(())
}

/// The values of an option; `None` is off.
fn values(
    file: &Path,
    key: &str,
    section: &str,
    value: &Value,
    takes: Takes,
) -> Result<Option<Vec<String>>, FileError> {
    let refuse = |expected| Err(field(file, key, section, format!("is {value}"), expected));
    let one = |value: &Value| match value {
        Value::String(text) => Some(text.clone()),
        Value::Integer(number) => Some(number.to_string()),
        Value::Float(number) => Some(number.to_string()),
        _ => None,
    };
    match (takes, value) {
        (Takes::Nothing, Value::Boolean(on)) => Ok(on.then(Vec::new)),
        (Takes::Nothing, _) => refuse("true or false"),
        (Takes::Value, Value::Array(several)) => match several.iter().map(one).collect() {
            Some(values) => Ok(Some(values)),
            None => refuse("a list of texts or numbers"),
        },
        (Takes::Value, value) => match one(value) {
            Some(value) => Ok(Some(vec![value])),
            None => refuse("a text, a number, or a list of these"),
        },
    }
}

/// One option as a command has used it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Used {
    /// The option's long name.
    pub name: String,
    /// The option's values; none for an option that takes nothing.
    pub values: Vec<String>,
    /// Whether the user gave the option. Otherwise the values are the program's own default.
    pub given: bool,
}

/// Saves the options of a command as its table in a settings file. The rest of the file stays as it
/// is. Options at the program's defaults are comments.
///
/// # Errors
/// [`FileError`] if the file cannot be read or written, or is not a settings file.
pub fn save(file: &Path, path: &[String], used: &[Used]) -> Result<(), FileError> {
    let before = if file.exists() { read_text(file, EXPECTED)? } else { String::new() };
    parse(file, &before)?;
    let after = replaced(&before, &path.join("."), used);
    parse(file, &after)?;
    keep(file, after.as_bytes())
}

/// The text with this section in place of the old one, or at the end.
fn replaced(before: &str, section: &str, used: &[Used]) -> String {
    let heading = format!("[{section}]");
    let mut lines: Vec<String> = Vec::new();
    let mut inside = false;
    for line in before.lines() {
        if line.trim_start().starts_with('[') {
            inside = line.trim() == heading;
        }
        if !inside {
            lines.push(line.to_owned());
        }
    }
    while lines.last().is_some_and(|line| line.trim().is_empty()) {
        lines.pop();
    }
    if !lines.is_empty() {
        lines.push(String::new());
    }
    lines.push(heading);
    for Used { name, values, given } in used {
        let value = match values.as_slice() {
            [] => "true".to_owned(),
            [value] => written(value),
            several => {
                format!("[{}]", several.iter().map(|v| written(v)).collect::<Vec<_>>().join(", "))
            }
        };
        lines.push(format!("{}{name} = {value}", if *given { "" } else { "# " }));
    }
    lines.push(String::new());
    lines.join("\n")
}

/// A value in TOML: a number where TOML gives the same text back, else a text.
fn written(value: &str) -> String {
    let number = |text: String| (text == value).then_some(text);
    let whole = value.parse::<i64>().ok().and_then(|n| number(n.to_string()));
    let broken = || value.parse::<f64>().ok().filter(|n| n.is_finite() && n.fract() != 0.0);
    let broken = || broken().and_then(|n| number(n.to_string()));
    whole.or_else(broken).unwrap_or_else(|| Value::String(value.to_owned()).to_string())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{file, line};
    use proptest::prelude::*;

    fn options() -> Options {
        let command = |names: &[(&str, Takes)], commands: &[(&str, Options)]| Options {
            own: names.iter().map(|(name, takes)| ((*name).to_owned(), *takes)).collect(),
            commands: commands.iter().map(|(n, o)| ((*n).to_owned(), o.clone())).collect(),
        };
        let (value, flag) = (Takes::Value, Takes::Nothing);
        let capture = command(&[("frames", value), ("camera", value), ("calibrate", flag)], &[]);
        let table3 = command(&[("scenes", value), ("frames", value), ("data", value)], &[]);
        let eval = command(&[], &[("table3", table3)]);
        command(&[], &[("capture", capture), ("eval", eval)])
    }

    fn path(words: &[&str]) -> Vec<String> {
        words.iter().map(|word| (*word).to_owned()).collect()
    }

    fn read(text: &str, command: &[&str]) -> Result<Defaults, FileError> {
        let (_folder, file) = file("lab.toml", text.as_bytes());
        from_file(&file, &options(), &path(command))
    }

    fn of(defaults: &Defaults, name: &str) -> Option<Vec<String>> {
        defaults[name].as_ref().map(|given| given.values.clone())
    }

    #[test]
    fn the_environment_beats_the_table_and_the_table_beats_what_stands_above() {
        let text = "frames = 5\ncamera = \"usb\"\n[capture]\nframes = 6\ncalibrate = true\n[eval]\nframes = 7\n\
                    [eval.table3]\nscenes = [1, 2.5, \"x\"]\n";
        let capture = read(text, &["capture"]).unwrap();
        assert_eq!(of(&capture, "frames"), Some(vec!["6".to_owned()]));
        assert_eq!(of(&capture, "camera"), Some(vec!["usb".to_owned()]));
        assert_eq!(of(&capture, "calibrate"), Some(Vec::new()));
        assert!(capture["frames"].as_ref().unwrap().origin.ends_with("lab.toml, [capture]"));
        let table3 = read(text, &["eval", "table3"]).unwrap();
        assert_eq!(of(&table3, "frames"), Some(vec!["7".to_owned()]));
        assert_eq!(of(&table3, "scenes"), Some(path(&["1", "2.5", "x"])));
        assert!(!table3.contains_key("camera"), "{table3:?}");

        let variables =
            [("NIRSPI_FRAMES", "9"), ("NIRSPI_CALIBRATE", "off"), ("NIRSPI_CAMERA", "")];
        let variable = |name: &str| {
            variables.iter().find(|(known, _)| *known == name).map(|(_, value)| value.into())
        };
        let mut found = capture;
        found.extend(from_environment(&options().commands["capture"], variable).unwrap());
        assert_eq!(of(&found, "frames"), Some(vec!["9".to_owned()]));
        assert_eq!(
            (&found["calibrate"], of(&found, "camera")),
            (&None, Some(vec!["usb".to_owned()]))
        );
        assert_eq!(found["frames"].as_ref().unwrap().origin, "NIRSPI_FRAMES");
    }

    #[test]
    fn what_no_command_has_is_refused_in_one_line() {
        for (text, words) in [
            ("frame = 5", "`frame` is not the name of an option"),
            ("[capture]\nscenes = 5", "`[capture] scenes` is not the name of an option"),
            ("[replay]\nframes = 5", "`replay` is not the name of a command"),
            ("[eval.table9]\nframes = 5", "`[eval] table9` is not the name of a command"),
            ("[capture]\ncalibrate = 1", "expected true or false"),
            ("[capture]\nframes = true", "expected a text, a number"),
            ("[capture]\nframes = [[1]]", "expected a list of texts or numbers"),
            ("frames = 1\nframes = = 2", "in line 2"),
        ] {
            // The table of another command is checked, too.
            for command in [&["capture"][..], &["eval", "table3"]] {
                let message = line(&read(text, command).unwrap_err(), "lab.toml");
                assert!(message.contains(words), "{text}: {message}");
            }
        }
        let on = |_: &str| Some("maybe".into());
        let error = from_environment(&options().commands["capture"], on).unwrap_err().to_string();
        assert_eq!(error, "NIRSPI_CALIBRATE is \"maybe\", expected 1 or 0");
    }

    #[test]
    fn the_folder_of_the_tests_data_is_no_option() {
        let table3 = &options().commands["eval"].commands["table3"];
        let found = from_environment(table3, |name| (name == "NIRSPI_DATA").then(|| "x".into()));
        assert_eq!(found.unwrap(), Defaults::new());
    }

    #[test]
    fn saving_replaces_the_commands_own_table_and_nothing_else() {
        let used = |name: &str, value: &str, given| Used {
            name: name.to_owned(),
            values: vec![value.to_owned()],
            given,
        };
        let before =
            "# mine\ncamera = \"usb\"\n\n[capture]\nframes = 5\n\n[eval] # all\nframes = 7\n";
        let after =
            replaced(before, "capture", &[used("frames", "6", true), used("camera", "usb", false)]);
        assert_eq!(
            after,
            "# mine\ncamera = \"usb\"\n\n[eval] # all\nframes = 7\n\n[capture]\nframes = 6\n# camera = \"usb\"\n"
        );
    }

    proptest! {
        #[test]
        fn what_is_saved_is_read_back(
            value in "\\PC{0,12}",
            number: f64,
            whole: i64,
            several in prop::collection::vec("[a-z0-9.\"]{1,4}", 2..5),
        ) {
            let folder = tempfile::tempdir().unwrap();
            let file = folder.path().join("lab.toml");
            let path = path(&["eval", "table3"]);
            let used = |name: &str, values: Vec<String>| Used { name: name.to_owned(), values, given: true };
            for value in [vec![value], vec![number.to_string()], vec![whole.to_string()], several] {
                let all = [used("scenes", value.clone()), used("frames", vec!["3".to_owned()])];
                save(&file, &path, &all).unwrap();
                let found = from_file(&file, &options(), &path).unwrap();
                prop_assert_eq!(of(&found, "scenes"), Some(value));
                prop_assert_eq!(of(&found, "frames"), Some(vec!["3".to_owned()]));
            }
        }
    }
}
