//! `cargo run -p nirspi-tests-silicon -- 127.0.0.1:1550`: the released ELF, on a model of its chip, as a camera behind TCP.

use std::process::ExitCode;

fn main() -> ExitCode {
    let address = std::env::args().nth(1).unwrap_or_else(|| "127.0.0.1:1550".to_owned());
    match nirspi_tests_silicon::serve(&address) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}
