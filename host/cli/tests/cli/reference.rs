//! `docs/commands.md` is the program's own help. `NIRSPI_BLESS=1` writes the page.

use crate::bench::Bench;
use std::fmt::Write;
use std::path::Path;

const HEAD: &str = "\
# Commands

<!-- Written by host/cli/tests/cli/reference.rs: NIRSPI_BLESS=1 cargo test -p nirspi-cli --test cli reference -->

This page is the program's own `--help`, of a build with the default features. `nirspi COMMAND --help` prints the same, and
`nirspi COMMAND -h` a summary. From the repository, `cargo run --release -- COMMAND` runs `nirspi COMMAND`.

Exit codes: 0 done, 1 failed (one line on stderr says why), 2 used wrongly.
";

/// Names of the commands that a help text lists, without `help`. On the first page they stand behind the names of groups.
fn listed(help: &str) -> Vec<&str> {
    if !help.contains("\nUsage: ") {
        let rows = help.lines().skip(2).take_while(|line| !line.is_empty());
        return rows.filter_map(|row| row.get(15..)?.split(' ').next()).collect();
    }
    let lines = help.lines().skip_while(|line| *line != "Commands:").skip(1);
    let entries = lines.take_while(|line| !line.is_empty()).filter_map(|line| {
        let entry = line.strip_prefix("  ")?;
        if entry.starts_with(' ') { None } else { entry.split(' ').next() }
    });
    entries.filter(|name| *name != "help").collect()
}

/// Adds the section of a command, and then those of its subcommands.
fn describe(bench: &Bench, command: &[&str], page: &mut String) {
    let arguments = [command, &["--help"]].concat();
    let help = bench.run(&arguments).succeeded().stdout.replace("nirspi.exe", "nirspi");
    let lines: Vec<&str> = help.trim_end().lines().map(str::trim_end).collect();
    let heading = "#".repeat(command.len().max(1) + 1);
    let name = [&["nirspi"][..], command].concat().join(" ");
    write!(page, "\n{heading} {name}\n\n```text\n{}\n```\n", lines.join("\n")).unwrap();
    for subcommand in listed(&help) {
        describe(bench, &[command, &[subcommand]].concat(), page);
    }
}

#[test]
fn the_reference_of_commands_is_the_help_of_this_program() {
    let mut expected = HEAD.to_owned();
    describe(&Bench::new(), &[], &mut expected);
    assert!(
        expected.contains("\n## nirspi demo\n")
            && expected.contains("\n#### nirspi dev bench omp\n")
    );
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/commands.md");
    if std::env::var_os("NIRSPI_BLESS").is_some() {
        std::fs::write(&path, &expected).unwrap();
    }
    let found = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(found == expected, "{} is stale: NIRSPI_BLESS=1 writes it", path.display());
}
