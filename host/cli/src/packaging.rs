//! `nirspi completions` and `nirspi man`: what a package of the program contains beside it.

use super::{Cli, print};
use anyhow::{Context, Result};
use clap::CommandFactory;
use nirspi::files::output::OutputDir;
use std::path::PathBuf;
use std::process::ExitCode;

/// Print a shell's completion script
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n\
    \x20 nirspi completions bash > ~/.local/share/bash-completion/completions/nirspi")]
pub struct CompletionsArgs {
    /// The shell
    shell: clap_complete::Shell,
}

/// Write the manual pages, one a command
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n\
    \x20 nirspi man ~/.local/share/man/man1/")]
pub struct ManArgs {
    /// Folder for the pages
    #[arg(value_name = "DIR")]
    out: PathBuf,
}

pub fn completions(args: &CompletionsArgs) -> Result<ExitCode> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut Cli::command(), "nirspi", &mut script);
    print::line(String::from_utf8_lossy(&script).trim_end())?;
    Ok(ExitCode::SUCCESS)
}

pub fn man(args: &ManArgs) -> Result<ExitCode> {
    let mut command = Cli::command().disable_help_subcommand(true);
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
