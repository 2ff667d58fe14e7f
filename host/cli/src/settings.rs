//! Options of all commands, and the command line with its defaults from a settings file and from
//! the environment.
//!
//! # Invariant
//! The command line beats the environment, and the environment beats the settings file: a default
//! that conflicts with an option on the command line is left out
//! (`the_command_line_beats_the_environment_and_that_the_file` in `host/cli/tests/cli/settings.rs`).

use super::print;
use anyhow::Result;
use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::parser::ValueSource;
use clap::{Arg, ArgMatches, Command, FromArgMatches};
use nirspi::causes::in_one_line;
use nirspi::settings::{
    Defaults, Options, Takes, Used, from_environment, from_file, save, variable_of,
};
use std::collections::BTreeMap;
use std::ffi::OsString;
use std::path::PathBuf;
use std::sync::OnceLock;

/// What every command takes.
#[derive(Debug, clap::Args)]
pub struct GeneralArgs {
    /// Print results, warnings and errors; no notes, no progress
    #[arg(short, long, global = true)]
    pub quiet: bool,
    /// Exit with code 1 also where the command has succeeded with a warning
    #[arg(long, global = true)]
    pub strict: bool,
    /// Also print, on stderr, the time of each stage and where each default comes from
    #[arg(short, long, global = true)]
    pub verbose: bool,
    /// Take defaults for options from this file (TOML): `frames = 1000` is the same as --frames 1000. The environment variable
    /// NIRSPI_FRAMES beats the file, and the command line beats both
    #[arg(long, value_name = "FILE", global = true)]
    settings: Option<PathBuf>,
    /// When the command has succeeded, save its options in this file, as the table of the command. --out, --overwrite,
    /// --json and --token are left out
    #[arg(long, value_name = "FILE", global = true)]
    save_settings: Option<PathBuf>,
}

/// Options that say what to do with settings, and options that belong to one run.
const NEVER_SAVED: [&str; 9] =
    ["settings", "save-settings", "quiet", "strict", "verbose", "json", "out", "overwrite", "help"];
/// Options whose value is neither saved nor shown.
const SECRET: [&str; 1] = ["token"];
/// Options that cannot have a default.
const NO_DEFAULT: [&str; 4] = ["settings", "save-settings", "help", "version"];

/// The options on the command line.
static GIVEN: OnceLock<Vec<String>> = OnceLock::new();

/// The options that the user has given on the command line, without `--`.
pub fn given() -> &'static [String] {
    GIVEN.get().map_or(&[], Vec::as_slice)
}

/// Why there is nothing to run.
pub enum Refused {
    /// The user wants help.
    Help(clap::Error),
    /// The program was called wrongly.
    Mistake(String),
}

/// The options with which a command runs.
pub struct Settings {
    path: Vec<String>,
    used: Vec<Used>,
    defaults: Defaults,
}

/// Reads the command line, with defaults from the settings file and the environment.
pub fn parse<C: FromArgMatches>(
    mut command: Command,
    raw: Vec<OsString>,
) -> Result<(C, Settings), Refused> {
    command.build();
    let line = Line::new(&command, &raw);
    let defaults = line.defaults(&command).map_err(Refused::Mistake)?;
    let mut all = raw.clone();
    all.splice(line.insert..line.insert, line.arguments(&defaults));
    let refused = |error: clap::Error| match error.kind() {
        ErrorKind::DisplayHelp
        | ErrorKind::DisplayVersion
        | ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand => Refused::Help(error),
        _ => Refused::Mistake(in_words(&error, &defaults)),
    };
    let names = line.given.iter().filter_map(|arg| arg.get_long()).map(str::to_owned);
    let _ = GIVEN.set(names.collect());
    let matches = command.clone().try_get_matches_from(all).map_err(refused)?;
    let used = line.used(&matches);
    let cli = C::from_arg_matches(&matches).map_err(refused)?;
    Ok((cli, Settings { path: line.path.clone(), used, defaults }))
}

impl Settings {
    /// Sets how much the program says, and tells a user who wants detail where defaults come from.
    pub fn begin(&self, asked: &GeneralArgs) {
        print::say(asked.quiet, asked.verbose);
        let given = self.defaults.iter().filter_map(|(name, given)| Some((name, given.as_ref()?)));
        for (name, given) in given {
            let is_secret = SECRET.contains(&name.as_str());
            let values = if is_secret { "(secret)".into() } else { given.values.join(", ") };
            print::detail(format_args!("--{name} {values}: from {}", given.origin));
        }
    }

    /// Saves the options, if the user wants that.
    pub fn save(&self, asked: &GeneralArgs) -> Result<()> {
        if let Some(file) = &asked.save_settings {
            save(file, &self.path, &self.used)?;
            print::remark(format_args!("settings saved in {}", file.display()));
        }
        Ok(())
    }
}

/// A command line, without its values.
struct Line<'c> {
    /// The command that runs, and the words that lead to it.
    leaf: &'c Command,
    path: Vec<String>,
    /// Where its options begin.
    insert: usize,
    /// Its options that the user has given.
    given: Vec<&'c Arg>,
    settings: Option<PathBuf>,
    wants_help: bool,
}

impl<'c> Line<'c> {
    fn new(root: &'c Command, raw: &[OsString]) -> Self {
        let words: Vec<&str> = raw.iter().map(|word| word.to_str().unwrap_or("")).collect();
        let words = words.split(|word| *word == "--").next().unwrap_or(&[]);
        let (mut leaf, mut path, mut insert, mut at) = (root, Vec::new(), 1, 1);
        while let Some(word) = words.get(at).filter(|_| leaf.has_subcommands()) {
            if let Some(below) = leaf.find_subcommand(word) {
                (leaf, insert) = (below, at + 1);
                path.push(below.get_name().to_owned());
            } else if !word.starts_with('-') {
                break;
            }
            let value = !word.contains('=')
                && option(leaf, word).is_some_and(|arg| arg.get_action().takes_values());
            at += if value { 2 } else { 1 };
        }
        let given = words.iter().skip(1).filter_map(|word| option(leaf, word)).collect();
        let is_file =
            |word: &&str| option(leaf, word).is_some_and(|arg| arg.get_id() == "settings");
        let settings = words.iter().position(is_file).and_then(|at| {
            let inline = words[at].split_once('=').map(|(_, file)| OsString::from(file));
            inline.or_else(|| raw.get(at + 1).cloned())
        });
        let settings = settings.or_else(|| std::env::var_os(variable_of("settings")));
        let settings = settings.filter(|file| !file.is_empty()).map(PathBuf::from);
        let help = |word: &&str| ["-h", "--help", "-V", "--version"].contains(word);
        let first = path.first().map(String::as_str);
        let wants_help = matches!(first, None | Some("help")) || words.iter().any(help);
        Self { leaf, path, insert, given, settings, wants_help }
    }

    /// Defaults for options that the user has not given and that conflict with none that he has.
    fn defaults(&self, root: &Command) -> Result<Defaults, String> {
        if self.wants_help {
            return Ok(Defaults::new());
        }
        let mut found = match &self.settings {
            Some(file) => {
                from_file(file, &options(root), &self.path).map_err(|e| in_one_line(&e))?
            }
            None => Defaults::new(),
        };
        let variables = from_environment(&options(self.leaf), |name| std::env::var_os(name));
        found.extend(variables.map_err(|error| in_one_line(&error))?);
        found.retain(|name, _| {
            let own = option(self.leaf, &format!("--{name}"));
            own.is_some_and(|own| !self.given.iter().any(|given| excludes(self.leaf, given, own)))
        });
        Ok(found)
    }

    /// The defaults as arguments.
    fn arguments(&self, defaults: &Defaults) -> Vec<OsString> {
        let mut arguments = Vec::new();
        for (name, given) in defaults {
            let Some(given) = given else { continue };
            if given.values.is_empty() && takes(self.leaf, name) == Some(Takes::Nothing) {
                arguments.push(format!("--{name}").into());
            }
            arguments.extend(given.values.iter().map(|v| OsString::from(format!("--{name}={v}"))));
        }
        arguments
    }

    /// The options with their values, for the settings file.
    fn used(&self, matches: &ArgMatches) -> Vec<Used> {
        let step =
            |matches: &'_ ArgMatches, name: &String| matches.subcommand_matches(name).cloned();
        let matches = self.path.iter().try_fold(matches.clone(), |m, name| step(&m, name));
        let Some(matches) = matches else { return Vec::new() };
        let mut used = Vec::new();
        for arg in self.leaf.get_arguments() {
            let (id, Some(name)) = (arg.get_id().as_str(), arg.get_long()) else { continue };
            if NEVER_SAVED.contains(&name) || SECRET.contains(&name) {
                continue;
            }
            let given = matches.value_source(id) == Some(ValueSource::CommandLine);
            let values = match arg.get_action().takes_values() {
                true => matches.get_raw(id).into_iter().flatten(),
                false if given => None.into_iter().flatten(),
                false => continue,
            };
            let values: Vec<String> = values.map(|v| v.to_string_lossy().into_owned()).collect();
            if given || !values.is_empty() {
                used.push(Used { name: name.to_owned(), values, given });
            }
        }
        used
    }
}

/// The option of a command that this word names.
fn option<'c>(command: &'c Command, word: &str) -> Option<&'c Arg> {
    let name = word.strip_prefix("--")?.split('=').next()?;
    command.get_arguments().find(|arg| {
        let aliases = arg.get_all_aliases().unwrap_or_default();
        arg.get_long() == Some(name) || aliases.contains(&name)
    })
}

/// What an option of a command takes.
fn takes(command: &Command, name: &str) -> Option<Takes> {
    options(command).own.get(name).copied()
}

/// The options of a command and its subcommands.
fn options(command: &Command) -> Options {
    let own = command.get_arguments().filter_map(|arg| {
        let name = arg.get_long().filter(|name| !NO_DEFAULT.contains(name))?;
        let takes_values = arg.get_action().takes_values();
        Some((name.to_owned(), if takes_values { Takes::Value } else { Takes::Nothing }))
    });
    let below = command.get_subcommands().filter(|command| command.get_name() != "help");
    let commands = below.map(|command| (command.get_name().to_owned(), options(command)));
    Options { own: own.collect(), commands: commands.collect() }
}

/// Whether two options are the same, or cannot be given together.
fn excludes(command: &Command, a: &Arg, b: &Arg) -> bool {
    let names = |a: &Arg, b: &Arg| {
        command.get_arg_conflicts_with(a).iter().any(|other| other.get_id() == b.get_id())
    };
    let in_group = |group: &clap::ArgGroup| {
        let members: Vec<_> = group.get_args().collect();
        let both = members.contains(&a.get_id()) && members.contains(&b.get_id());
        both && !group.clone().is_multiple()
    };
    a.get_id() == b.get_id() || names(a, b) || names(b, a) || command.get_groups().any(in_group)
}

/// clap's message of several paragraphs in one line, with the source of a default that was wrong.
fn in_words(error: &clap::Error, defaults: &Defaults) -> String {
    let line = in_line(&error.render().to_string());
    let named: Vec<&String> = match error.get(ContextKind::InvalidArg) {
        Some(ContextValue::String(name)) => vec![name],
        Some(ContextValue::Strings(names)) => names.iter().collect(),
        _ => Vec::new(),
    };
    let name = |text: &String| text.split([' ', '=']).next()?.strip_prefix("--").map(str::to_owned);
    let origins: BTreeMap<String, &str> = named
        .into_iter()
        .filter_map(name)
        .filter_map(|name| {
            let given = defaults.get(&name)?.as_ref()?;
            Some((name, given.origin.as_str()))
        })
        .collect();
    origins
        .iter()
        .fold(line, |line, (name, origin)| format!("{line}; --{name} comes from {origin}"))
}

fn in_line(message: &str) -> String {
    let mut line = String::new();
    let wanted = |text: &&str| !text.starts_with("Usage:") && !text.starts_with("For more");
    // A file may begin with one dash. A word with two is an option that the command does not have.
    let helps = |part: &&str| !part.is_empty() && !part.starts_with("tip: to pass '--");
    for part in message.lines().map(str::trim).take_while(wanted).filter(helps) {
        match line.chars().last() {
            None => {}
            Some(':') => line.push(' '),
            Some(_) => line.push_str("; "),
        }
        line.push_str(part.strip_prefix("error: ").unwrap_or(part));
    }
    line
}
