//! `nirspi dev completions` and `nirspi dev man`: what a package of the program contains beside it.

use super::headings::arranged;
use super::{Cli, print};
use anyhow::{Context, Result};
use clap::CommandFactory;
use nirspi::files::output::OutputDir;
use std::path::PathBuf;
use std::process::ExitCode;

/// Print a shell's completion script
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n\
    \x20 nirspi dev completions bash > ~/.local/share/bash-completion/completions/nirspi")]
pub struct CompletionsArgs {
    /// The shell
    shell: clap_complete::Shell,
}

/// Write the manual pages, one a command
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n\
    \x20 nirspi dev man ~/.local/share/man/man1/")]
pub struct ManArgs {
    /// Folder for the pages
    #[arg(value_name = "DIR")]
    out: PathBuf,
}

pub fn completions(args: &CompletionsArgs) -> Result<ExitCode> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut arranged(Cli::command()), "nirspi", &mut script);
    let script = String::from_utf8_lossy(&script);
    let script = match args.shell {
        clap_complete::Shell::Bash => with_files(&script),
        _ => script.into_owned(),
    };
    print::line(script.trim_end())?;
    Ok(ExitCode::SUCCESS)
}

/// The script for bash, which then offers files where a file or any other value can stand. The generated
/// one offers options there, and names of files without their spaces. Bash itself offers files where a
/// script offers nothing.
fn with_files(script: &str) -> String {
    const OPTIONS: &str = "COMPREPLY=( $(compgen -W \"${opts}\" -- \"${cur}\") )";
    const FILES: &str = "COMPREPLY=($(compgen -f \"${cur}\"))";
    let mut changed = String::new();
    // Whether the part for one command, so far, is for one that takes no words of a list.
    let (mut takes_files, mut offered) = (false, false);
    for line in script.lines() {
        let code = line.trim_start();
        if let Some(words) = code.strip_prefix("opts=\"") {
            let mut words = words.trim_end_matches('"').split(' ').filter(|word| !word.is_empty());
            (takes_files, offered) = (words.all(|word| word.starts_with(['-', '[', '<'])), false);
        }
        let line = match code {
            FILES => line.replace(FILES, "COMPREPLY=()"),
            OPTIONS if takes_files && offered => line.replace(OPTIONS, "COMPREPLY=()"),
            OPTIONS => {
                offered = true;
                line.to_owned()
            }
            _ if takes_files && code.starts_with("if [[ ${cur} == -* || ") => {
                let indent = &line[..line.len() - code.len()];
                format!("{indent}if [[ ${{cur}} == -* ]] ; then")
            }
            _ => line.to_owned(),
        };
        changed.push_str(&line);
        changed.push('\n');
    }
    changed
}

pub fn man(args: &ManArgs) -> Result<ExitCode> {
    let mut command = arranged(Cli::command()).disable_help_subcommand(true);
    command.build();
    let mut out = OutputDir::create(&args.out)?;
    write_page(command, &mut out)?;
    let pages = out.commit()?;
    print::line(format_args!("{} pages in {}", pages.len(), args.out.display()))?;
    Ok(ExitCode::SUCCESS)
}

/// Writes the page of a command, and those of its subcommands.
fn write_page(command: clap::Command, out: &mut OutputDir) -> Result<()> {
    for subcommand in command.get_subcommands().filter(|command| !command.is_hide_set()) {
        write_page(subcommand.clone(), out)?;
    }
    let page = clap_mangen::Man::new(command);
    let (name, mut text) = (page.get_filename(), Vec::new());
    page.render(&mut text).with_context(|| name.clone())?;
    Ok(out.write(&name, &text)?)
}
