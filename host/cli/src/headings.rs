//! How help is arranged: the headings under which it lists options, and which options `-h` shows. A group of options that
//! several commands share has its heading where the group is defined; the options named here have the same heading everywhere.

use super::first_page;
use clap::builder::Resettable;
use clap::{Arg, Command};

const HEADINGS: [(&str, &[&str]); 5] = [
    ("Measurement", &["frames", "light", "sampling", "order", "orders", "sweeps", "white", "dark"]),
    ("Input", &["resize", "depth"]),
    ("Networks", &["ancestral"]),
    ("Output", &["out", "overwrite", "picture", "panels", FIGURE, "json"]),
    ("Every command", &EVERY_COMMAND),
];

/// Options of all commands, which `-h` leaves out.
const EVERY_COMMAND: [&str; 5] = ["quiet", "verbose", "strict", "settings", "save-settings"];

/// How figures are drawn: `-h` shows it where it is chosen.
const FIGURE: &str = "figure";

/// The most options that `-h` shows of a command, beside `-h` itself.
const SHOWN_SHORT: usize = 11;

/// What `-h` shows of a command that has more options than that.
const SHORT: [(&str, &str); 11] = [
    ("demo", "scene distance-m rain light sampling method seed out figure json"),
    ("reconstruct", "sampling method index shown side field readings matrix enhance out json"),
    ("serve", "camera listen token sampling light method scene distance-m rain record-to"),
    ("capture", "camera frames light sampling order scene picture out overwrite json"),
    ("enhance", "depth resize blur-px noise interval method backend out overwrite json"),
    ("deblur", "model blur-px noise steps resize backend out overwrite json"),
    ("camera selftest", "camera calibration scene camera-model json"),
    ("dev virtual", "listen scene distance-m rain camera-model seed once real-time"),
    ("dev pairs", "data fonts characters camera-model count seed out overwrite json"),
    ("dev bench omp", "input measurements sparsity frames backend precision repeats out json"),
    ("eval sampling", "index shown side field readings against sampling orders out json"),
];

/// The program with its help arranged: the first page, and each command's options.
pub fn arranged(program: Command) -> Command {
    first_page::on(command(program, ""))
}

/// The command at this path and its subcommands, with options under their headings. Every option with a value
/// reads a negative number as its value, so that a message can say what is wrong with the number.
fn command(command: Command, path: &str) -> Command {
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
    let flags = command.get_arguments().filter(is_flag).count();
    let options = command.get_opts().filter(|arg| arg.get_long() != Some(FIGURE)).count() + flags;
    let chosen = SHORT.iter().find(|(of, _)| *of == path).map(|(_, names)| *names);
    let is_long = |arg: &Arg| {
        let Some(name) = arg.get_long().filter(|_| !arg.is_positional()) else { return false };
        let is_chosen = chosen.is_some_and(|chosen| chosen.split(' ').any(|one| one == name));
        EVERY_COMMAND.contains(&name)
            || name == FIGURE && !is_chosen
            || options > SHOWN_SHORT && chosen.is_some() && !is_chosen
    };
    let shorten = |arg: Arg| {
        let hidden = is_long(&arg);
        arg.hide_short_help(hidden)
    };
    let below = |command: Command| {
        let path = format!("{path} {}", command.get_name());
        self::command(command, path.trim_start())
    };
    command.mut_args(|arg| shorten(arrange(arg))).mut_subcommands(below)
}

fn is_flag(arg: &&Arg) -> bool {
    !arg.get_action().takes_values() && arg.get_long().is_some()
}

#[cfg(test)]
mod tests {
    use super::SHORT;
    use clap::CommandFactory;

    #[test]
    fn every_option_that_a_short_help_chooses_belongs_to_its_command() {
        let program = crate::Cli::command();
        for (path, chosen) in SHORT {
            let mut command = &program;
            for name in path.split(' ') {
                command = command.find_subcommand(name).unwrap_or_else(|| panic!("{path}"));
            }
            for name in chosen.split(' ') {
                let mut options = command.get_arguments().filter_map(clap::Arg::get_long);
                assert!(options.any(|option| option == name), "{path}: --{name}");
            }
        }
    }
}
