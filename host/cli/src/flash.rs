//! `nirspi camera flash`: programs a board through a debug probe.

use super::Usage;
use anyhow::Result;
use nirspi::boards::{Board, flashable};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Program a board with its firmware, through a debug probe
///
/// No other program is needed: an ELF file of a release is enough. This command needs a build with the feature `flash`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n\
    \x20 nirspi camera flash --board nucleo-u5a5zj-q\n\
    \x20 nirspi camera flash --list")]
pub struct Args {
    #[arg(long, value_name = "NAME", required_unless_present = "list", help = board_help())]
    board: Option<String>,
    /// Firmware to write [default: the board's release build under boards/target]
    #[arg(long, value_name = "FILE")]
    elf: Option<PathBuf>,
    /// Which probe, where there are several: VID:PID:SERIAL as --list shows it
    #[arg(long, value_name = "PROBE")]
    probe: Option<String>,
    /// List the debug probes that are plugged in
    #[arg(long, conflicts_with_all = ["board", "elf", "probe"])]
    list: bool,
}

fn board_help() -> String {
    format!("Which board: {}", flashable())
}

pub fn run(args: &Args) -> Result<ExitCode> {
    let board = args.board.as_deref().map(board).transpose()?;
    act(args, board)
}

/// The board of this name that can be flashed.
fn board(name: &str) -> Result<(&'static Board, &'static str)> {
    let found = Board::named(name);
    if let Some((board, chip)) = found.and_then(|board| Some((board, board.chip?))) {
        return Ok((board, chip));
    }
    if found.is_some() {
        return Err(
            Usage(format!("--board {name}: runs in QEMU, there is no chip to flash")).into()
        );
    }
    Err(Usage(format!("--board is {name:?}, expected one of {}", flashable())).into())
}

#[cfg(not(feature = "flash"))]
fn act(_: &Args, _: Option<(&'static Board, &'static str)>) -> Result<ExitCode> {
    write("", Path::new(""), &[], None)?;
    Ok(ExitCode::FAILURE)
}

/// Writes firmware, the content of an ELF file, into a board's chip.
#[cfg(not(feature = "flash"))]
pub fn write(_chip: &str, _elf: &Path, _firmware: &[u8], _probe: Option<&str>) -> Result<()> {
    anyhow::bail!(
        "this build cannot flash: cargo run --release --features flash -- camera flash ... (minutes to build), or flash with \
         probe-rs run from the board's folder"
    )
}

#[cfg(feature = "flash")]
fn act(args: &Args, board: Option<(&'static Board, &'static str)>) -> Result<ExitCode> {
    use super::print;
    use anyhow::Context;
    use nirspi::files::read_at_most;

    let Some((board, chip)) = board else {
        let found = nirspi_update::flash::probes();
        if found.is_empty() {
            print::line("no debug probe: plug in the board's ST-LINK connector")?;
        }
        for probe in &found {
            print::line(probe)?;
        }
        return Ok(ExitCode::SUCCESS);
    };
    let elf = args.elf.clone().unwrap_or_else(|| board.elf());
    let firmware = read_at_most(&elf, 256 << 20).with_context(|| {
        let hint = if args.elf.is_none() {
            format!(": build it first, bash boards/build.sh {}", board.name)
        } else {
            String::new()
        };
        format!("{}{hint}", elf.display())
    })?;
    write(chip, &elf, &firmware, args.probe.as_deref())?;
    print::line(format_args!(
        "{} written to {} and verified; it is running",
        elf.display(),
        board.name
    ))?;
    Ok(ExitCode::SUCCESS)
}

/// Writes firmware, the content of an ELF file, into a board's chip.
#[cfg(feature = "flash")]
pub fn write(chip: &str, elf: &Path, firmware: &[u8], probe: Option<&str>) -> Result<()> {
    use super::progress::Progress;
    use anyhow::Context;
    use nirspi_update::flash::{Step, choose, flash, probes};

    let found = probes();
    let probe = choose(&found, probe)?;
    let mut bar = None;
    let mut done = 0;
    let written = flash(probe, chip, firmware, &mut |step| match step {
        Step::Begins { what, bytes } => {
            (bar, done) = (Some(Progress::of(what, bytes, "bytes")), 0);
        }
        Step::Done { bytes } => {
            done += bytes;
            if let Some(bar) = &bar {
                bar.set(done);
            }
        }
    });
    drop(bar);
    written.with_context(|| format!("{} through {probe}", elf.display()))
}
