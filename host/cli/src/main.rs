//! The program `nirspi`.

use std::process::ExitCode;

fn main() -> ExitCode {
    ExitCode::from(nirspi_cli::main(std::env::args_os().collect()))
}
