//! The program's help as it prints it: every command that it lists, from the first page on.

use crate::bench::Bench;

/// The help of a command.
pub struct Page {
    /// The words behind `nirspi`; none for the first page.
    pub path: Vec<String>,
    /// The group of the first page that the command belongs to.
    pub group: String,
    /// What `--help` prints.
    pub help: String,
    /// Whether the command has commands of its own.
    pub has_commands: bool,
}

impl Page {
    /// The command as a user types it.
    pub fn name(&self) -> String {
        [&["nirspi".to_owned()], &self.path[..]].concat().join(" ")
    }

    /// The words behind `nirspi`.
    pub fn words(&self) -> Vec<&str> {
        self.path.iter().map(String::as_str).collect()
    }
}

/// Groups and names of the commands that a help text lists, without `help`. On the first page a group stands before its first
/// command.
fn listed(help: &str) -> Vec<(String, String)> {
    if !help.contains("\nUsage: ") {
        let mut group = String::new();
        let rows = help.lines().skip(2).take_while(|line| !line.is_empty());
        return rows
            .map(|row| {
                let (first, rest) = row.split_at(15);
                if !first.trim().is_empty() {
                    group = first.trim().to_owned();
                }
                (group.clone(), rest.split(' ').next().unwrap().to_owned())
            })
            .collect();
    }
    let lines = help.lines().skip_while(|line| *line != "Commands:").skip(1);
    let entries = lines.take_while(|line| !line.is_empty()).filter_map(|line| {
        let entry = line.strip_prefix("  ")?;
        if entry.starts_with(' ') { None } else { entry.split(' ').next() }
    });
    entries.filter(|name| *name != "help").map(|name| (String::new(), name.to_owned())).collect()
}

fn add(bench: &Bench, path: &[String], group: &str, pages: &mut Vec<Page>) {
    let words: Vec<&str> = path.iter().map(String::as_str).chain(["--help"]).collect();
    let help = bench.run(&words).succeeded().stdout.replace("nirspi.exe", "nirspi");
    let below = listed(&help);
    let has_commands = !below.is_empty();
    pages.push(Page { path: path.to_owned(), group: group.to_owned(), help, has_commands });
    for (own, name) in below {
        let group = if own.is_empty() { group } else { &own };
        add(bench, &[path, &[name]].concat(), group, pages);
    }
}

/// The first page and the page of every command, each before those of its own commands.
pub fn pages(bench: &Bench) -> Vec<Page> {
    let mut pages = Vec::new();
    add(bench, &[], "", &mut pages);
    let names: Vec<String> = pages.iter().map(Page::name).collect();
    for known in ["nirspi demo", "nirspi camera devices", "nirspi dev bench omp"] {
        assert!(names.iter().any(|name| name == known), "{known} is not listed: {names:?}");
    }
    pages
}

/// Every command that does something.
pub fn commands(bench: &Bench) -> Vec<Page> {
    pages(bench).into_iter().filter(|page| !page.has_commands).collect()
}
