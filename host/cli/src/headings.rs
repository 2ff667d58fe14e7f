//! The headings under which help lists options. A group of options that several commands share has
//! its heading where the group is defined; the options named here have the same heading everywhere.

use clap::builder::Resettable;
use clap::{Arg, Command};

const HEADINGS: [(&str, &[&str]); 8] = [
    (
        "Measurement",
        &["frames", "light", "sum", "sampling", "order", "orders", "sweeps", "white", "dark"],
    ),
    ("Input", &["resize", "depth"]),
    ("Networks", &["ancestral"]),
    ("One sphere", &["mie", "x", "m-re", "m-im"]),
    ("Photon budget", &["budget", "reflectance", "exposure-us"]),
    ("Rain simulator", &["uniformity", "rig", "tilt-deg"]),
    ("Output", &["out", "overwrite", "picture", "json"]),
    ("Every command", &["quiet", "verbose", "settings", "save-settings"]),
];

/// The command and its subcommands, with options under their headings. Every option with a value
/// reads a negative number as its value, so that a message can say what is wrong with the number.
pub fn arranged(command: Command) -> Command {
    let arrange = |arg: Arg| {
        let named =
            |(_, names): &&(&str, &[&str])| arg.get_long().is_some_and(|n| names.contains(&n));
        let heading = HEADINGS.iter().find(named).map(|(heading, _)| *heading);
        let arg = match heading {
            Some(heading) => arg.help_heading(heading),
            // A positional argument does not stand under the heading of the group before it.
            None if arg.is_positional() => arg.help_heading(Resettable::Reset),
            None => arg,
        };
        let is_option = arg.get_action().takes_values() && !arg.is_positional();
        if is_option { arg.allow_negative_numbers(true) } else { arg }
    };
    command.mut_args(arrange).mut_subcommands(arranged)
}
