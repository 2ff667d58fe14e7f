//! The command line of nirspi.

mod cli;

use std::process::ExitCode;

fn main() -> ExitCode {
    cli::run()
}
