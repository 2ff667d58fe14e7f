//! The first page of help: what the program does, in four groups, on one screen.

use clap::Command;

/// Groups of commands, each with what it gives. A command with `...` has commands of its own.
const GROUPS: [(&str, &[(&str, &str)]); 5] = [
    (
        "Look",
        &[
            ("demo", "the paper's chain on a simulated scene; no camera needed"),
            ("example", "a simulated measurement, to try the next commands on"),
            ("serve", "a camera, live on a web page"),
        ],
    ),
    (
        "Your files",
        &[
            ("reconstruct", "an image of a measurement or a recording"),
            ("inspect", "what is in a file, and the command that reconstructs it"),
            ("readings", "readings of a trace: samples of an oscilloscope or ADC"),
            ("order", "patterns as pictures or an array, for a DMD"),
            ("enhance", "images enlarged and deblurred"),
            ("deblur", "images deblurred, by a network or a classical method"),
            ("metrics", "how far two stacks of images are apart"),
            ("recording ...", "export, recover"),
        ],
    ),
    (
        "Your camera",
        &[
            ("capture", "a recording of frames, each accounted for"),
            ("camera ...", "devices, info, selftest, calibrate, model, safety, update"),
        ],
    ),
    (
        "The paper",
        &[
            ("eval ...", "its tables, with ours beside them; what less sampling costs"),
            ("physics ...", "rain, fog, photon budget, range"),
        ],
    ),
    ("The rest", &[("dev ...", "speed, training pairs, the virtual camera over TCP, completions")]),
];

/// The program, with this page as its help.
pub fn on(program: Command) -> Command {
    let mut page =
        format!("{}\n\n", program.get_about().map(ToString::to_string).unwrap_or_default());
    for (group, commands) in GROUPS {
        for (at, (name, gives)) in commands.iter().enumerate() {
            let group = if at == 0 { group } else { "" };
            page += &format!("  {group:<13}{name:<15}{gives}\n");
        }
    }
    page += "\nBegin with `nirspi demo`. `nirspi COMMAND -h` shows a command, `--help` all of its options.\n";
    program.override_help(page)
}

#[cfg(test)]
mod tests {
    use super::GROUPS;
    use clap::CommandFactory;
    use std::collections::BTreeSet;

    #[test]
    fn the_first_page_has_every_command_and_fits_a_screen() {
        let program = crate::headings::arranged(crate::Cli::command());
        let commands: BTreeSet<String> = program
            .get_subcommands()
            .map(|c| format!("{}{}", c.get_name(), if c.has_subcommands() { " ..." } else { "" }))
            .collect();
        let listed =
            GROUPS.iter().flat_map(|(_, commands)| *commands).map(|(name, _)| (*name).to_owned());
        assert_eq!(listed.collect::<BTreeSet<_>>(), commands);
        let page = program.clone().render_help().to_string();
        assert!(page.lines().count() <= 20 && page.lines().all(|line| line.len() <= 100), "{page}");
    }
}
