//! The program `nirspi`. Each module reads the arguments of a command, calls the library, and
//! prints the result.
//!
//! Exit codes: 0 done, 1 failed (one line on stderr says why), 2 used wrongly.

mod address;
mod backend;
mod bench;
mod calibrate;
mod calibration;
mod camera;
mod camera_model;
mod capture;
mod deblur;
mod demo;
mod devices;
mod enhance;
mod eval;
mod example;
mod export;
mod flash;
mod gateware;
mod headings;
mod info;
mod method;
mod metrics;
mod networks;
mod packaging;
mod print;
mod progress;
mod rain;
mod range;
mod reconstruct;
mod report;
mod selftest;
mod serve;
mod serve_virtual;
mod settings;
mod setup;
mod source;
mod train;
mod update;
mod upscale;

use clap::{CommandFactory, Parser, Subcommand};
use nirspi::about::About;
use nirspi::files::FileError;
use nirspi_eval::EvalError;
use std::process::ExitCode;
use std::sync::LazyLock;

static VERSION: LazyLock<String> =
    LazyLock::new(|| About::this_build(option_env!("NIRSPI_COMMIT")).to_string());

/// An open near-infrared single-pixel camera: capture, virtual camera, reconstruction.
#[derive(Debug, Parser)]
#[command(name = "nirspi", version, long_version = VERSION.as_str(), arg_required_else_help = true)]
#[command(after_help = "Example, with no camera at hand:\n\
    \x20 nirspi demo --out demo/")]
struct Cli {
    #[command(flatten)]
    general: settings::GeneralArgs,
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Demo(demo::Args),
    Example(example::Args),
    Reconstruct(reconstruct::Args),
    Capture(capture::Args),
    Export(export::Args),
    Serve(serve::Args),
    Virtual(serve_virtual::Args),
    Devices(devices::Args),
    Info(info::Args),
    Calibrate(calibrate::Args),
    CameraModel(camera_model::Args),
    Selftest(selftest::Args),
    Flash(flash::Args),
    Gateware(gateware::Args),
    Update(update::Args),
    Setup(setup::Args),
    Upscale(upscale::Args),
    Deblur(deblur::Args),
    Enhance(enhance::Args),
    Metrics(metrics::Args),
    Rain(rain::Args),
    Range(range::Args),
    Bench(bench::Args),
    Eval(eval::EvalArgs),
    Train(train::TrainArgs),
    Completions(packaging::CompletionsArgs),
    Man(packaging::ManArgs),
}

/// A mistake in how the program was called, rather than in what it was given.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
struct Usage(String);

/// A mistake in the arguments that the evaluation found: its settings are the arguments, in snake case.
fn refused(error: EvalError) -> anyhow::Error {
    match &error {
        EvalError::Setting { name, .. } | EvalError::Refused { name, .. } => {
            let argument = name.replace('_', "-");
            let told = error.to_string();
            Usage(format!("--{argument}{}", told.strip_prefix(name).unwrap_or(&told))).into()
        }
        _ if error.is_setting() => Usage(error.to_string()).into(),
        _ => error.into(),
    }
}

fn main() -> ExitCode {
    let (cli, settings) = match settings::parse::<Cli>(
        headings::arranged(Cli::command()),
        std::env::args_os().collect(),
    ) {
        Ok(parsed) => parsed,
        Err(settings::Refused::Help(answer)) => {
            // A closed stdout does not count as a failure.
            let _ = answer.print();
            return ExitCode::from(answer.exit_code() as u8);
        }
        Err(settings::Refused::Mistake(line)) => {
            print::complain(line);
            return ExitCode::from(2);
        }
    };
    settings.begin(&cli.general);
    let done = run(cli.command).and_then(|code| settings.save(&cli.general).map(|()| code));
    done.unwrap_or_else(|error| {
        print::complain(one_line(&error));
        let used_wrongly =
            error.is::<Usage>() || matches!(error.downcast_ref(), Some(FileError::Choice { .. }));
        ExitCode::from(if used_wrongly { 2 } else { 1 })
    })
}

fn run(command: Command) -> anyhow::Result<ExitCode> {
    match command {
        Command::Demo(args) => demo::run(&args),
        Command::Example(args) => example::run(&args),
        Command::Reconstruct(args) => reconstruct::run(&args),
        Command::Capture(args) => capture::run(&args),
        Command::Export(args) => export::run(args),
        Command::Serve(args) => serve::run(args),
        Command::Virtual(args) => serve_virtual::run(&args),
        Command::Devices(args) => devices::run(&args),
        Command::Info(args) => info::run(&args),
        Command::CameraModel(args) => camera_model::run(&args),
        Command::Calibrate(args) => calibrate::run(&args),
        Command::Selftest(args) => selftest::run(&args),
        Command::Flash(args) => flash::run(&args),
        Command::Gateware(args) => gateware::run(&args),
        Command::Update(args) => update::run(&args),
        Command::Setup(args) => setup::run(&args),
        Command::Upscale(args) => upscale::run(&args),
        Command::Deblur(args) => deblur::run(&args),
        Command::Enhance(args) => enhance::run(&args),
        Command::Metrics(args) => metrics::run(&args),
        Command::Rain(args) => rain::run(&args),
        Command::Range(args) => range::run(&args),
        Command::Bench(args) => bench::run(&args),
        Command::Eval(args) => eval::run(&args),
        Command::Train(args) => train::run(&args),
        Command::Completions(args) => packaging::completions(&args),
        Command::Man(args) => packaging::man(&args),
    }
}

/// The error and its causes in one line.
fn one_line(error: &anyhow::Error) -> String {
    nirspi::causes::in_one_line(error.as_ref())
}
