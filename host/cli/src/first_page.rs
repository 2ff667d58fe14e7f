//! The first page of help: the commands of the program in groups, on one screen.

use clap::Command;

/// The groups of commands, each with its first command. Commands stand in the order of `Command`.
const GROUPS: [(&str, &str); 5] = [
    ("Look", "demo"),
    ("Your files", "reconstruct"),
    ("Your camera", "capture"),
    ("The paper", "eval"),
    ("The rest", "dev"),
];

/// The program, with this page as its help. A command with `...` has commands of its own.
pub fn on(program: Command) -> Command {
    let about =
        |command: &Command| command.get_about().map(ToString::to_string).unwrap_or_default();
    let mut page = format!("{}\n\n", about(&program));
    for command in program.get_subcommands().filter(|command| !command.is_hide_set()) {
        let group = GROUPS.iter().find(|(_, first)| *first == command.get_name());
        let group = group.map_or("", |(group, _)| group);
        let more = if command.has_subcommands() { " ..." } else { "" };
        let name = format!("{}{more}", command.get_name());
        page += &format!("  {group:<13}{name:<15}{}\n", about(command));
    }
    page += "\nBegin with `nirspi demo`. `nirspi COMMAND -h` shows a command, `--help` all of its options.\n";
    program.override_help(page)
}

#[cfg(test)]
mod tests {
    use super::GROUPS;
    use clap::CommandFactory;

    #[test]
    fn the_first_page_has_every_group_and_fits_a_screen() {
        let page = crate::headings::arranged(crate::Cli::command()).render_help().to_string();
        for (group, first) in GROUPS {
            assert!(page.contains(&format!("\n  {group:<13}{first}")), "{group}: {page}");
        }
        assert!(page.lines().count() <= 20 && page.lines().all(|line| line.len() <= 100), "{page}");
    }
}
