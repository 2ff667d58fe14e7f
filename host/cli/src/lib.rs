//! The program `nirspi`, also for the Python package, which brings it as a script. Each module reads the arguments of a
//! command, calls the library, and prints the result.
//!
//! Exit codes: 0 done, 1 failed (one line on stderr says why; with --strict this may be a warning), 2 used wrongly.

#![cfg_attr(not(test), deny(clippy::disallowed_methods))]

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
mod feed;
mod first_page;
mod flash;
mod gateware;
mod headings;
mod info;
mod inspect;
mod method;
mod metrics;
mod networks;
mod order;
mod packaging;
mod pairs;
mod print;
mod progress;
mod provenance;
mod rain;
mod range;
mod readings;
mod reconstruct;
mod report;
mod safety;
mod selftest;
mod serve;
mod serve_virtual;
mod settings;
mod setup;
mod sharpening;
mod signals;
mod source;
mod update;
mod upscale;

use clap::{CommandFactory, Parser, Subcommand};
use nirspi::about::About;
use nirspi::files::FileError;
use nirspi_eval::EvalError;
use std::ffi::OsString;
use std::process::ExitCode;
use std::sync::LazyLock;

/// The features of this program, and whether this build has each one.
const FEATURES: &[(&str, bool)] =
    &[("flash", cfg!(feature = "flash")), ("wgpu", cfg!(feature = "wgpu"))];

/// The first twelve digits of the commit of the sources. `None` in builds without optimisation, and where the build script
/// finds neither git nor a published package.
pub const COMMIT: Option<&str> = option_env!("NIRSPI_COMMIT");

static VERSION: LazyLock<String> =
    LazyLock::new(|| About::this_build(COMMIT, FEATURES).to_string());

/// nirspi, an open near-infrared single-pixel camera
#[derive(Debug, Parser)]
#[command(name = "nirspi", bin_name = "nirspi", version, long_version = VERSION.as_str(), arg_required_else_help = true)]
struct Cli {
    #[command(flatten)]
    general: settings::GeneralArgs,
    #[command(subcommand)]
    command: Command,
}

/// Commands: each with its arguments and the function that runs it.
macro_rules! commands {
    ($commands:ident, $run:ident: $($(#[$about:meta])* $name:ident($args:ty) => $run_one:path,)*) => {
        #[derive(Debug, Subcommand)]
        enum $commands { $($(#[$about])* $name($args),)* }

        fn $run(command: &$commands) -> anyhow::Result<ExitCode> {
            match command { $($commands::$name(args) => $run_one(args),)* }
        }
    };
}

commands! { Command, run:
    Demo(demo::Args) => demo::run,
    Example(example::Args) => example::run,
    Serve(serve::Args) => serve::run,
    Reconstruct(reconstruct::Args) => reconstruct::run,
    Inspect(inspect::Args) => inspect::run,
    Readings(readings::Args) => readings::run,
    Order(order::Args) => order::run,
    Enhance(enhance::Args) => enhance::run,
    Deblur(deblur::Args) => deblur::run,
    Metrics(metrics::Args) => metrics::run,
    /// Export or repair recordings
    #[command(subcommand)]
    Recording(RecordingCommand) => run_recording,
    Capture(capture::Args) => feed::capture,
    /// Find a camera, check and calibrate it, bring it up to date
    #[command(subcommand)]
    Camera(CameraCommand) => run_camera,
    Eval(eval::EvalArgs) => eval::run,
    /// Compute what rain does to light, and how far the camera sees
    #[command(subcommand)]
    Physics(PhysicsCommand) => run_physics,
    /// Measure speed, make training pairs, serve the virtual camera
    #[command(subcommand)]
    Dev(DevCommand) => run_dev,
}

commands! { CameraCommand, run_camera:
    Devices(devices::Args) => devices::run,
    Info(info::Args) => info::run,
    Selftest(selftest::Args) => selftest::run,
    Calibrate(calibrate::Args) => calibrate::run,
    Model(camera_model::Args) => camera_model::run,
    Safety(safety::Args) => safety::run,
    Setup(setup::Args) => setup::run,
    Update(update::Args) => update::run,
    Gateware(gateware::Args) => gateware::run,
    #[command(hide = !cfg!(feature = "flash"))]
    Flash(flash::Args) => flash::run,
}

commands! { RecordingCommand, run_recording:
    Export(export::Args) => export::run,
    Recover(export::RecoverArgs) => export::recover,
}

commands! { PhysicsCommand, run_physics:
    Rain(rain::Args) => rain::run,
    Budget(rain::BudgetArgs) => rain::budget,
    Sphere(rain::SphereArgs) => rain::sphere,
    Rig(rain::RigArgs) => rain::rig,
    Range(range::Args) => range::run,
}

commands! { DevCommand, run_dev:
    Bench(bench::Args) => bench::run,
    Pairs(pairs::Args) => pairs::run,
    Upscale(upscale::Args) => upscale::run,
    Virtual(serve_virtual::Args) => serve_virtual::run,
    Completions(packaging::CompletionsArgs) => packaging::completions,
    Man(packaging::ManArgs) => packaging::man,
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

/// Runs the command of these arguments, the first of which is the program's own name, and returns the exit code. Catches
/// signals, so a process calls this once.
pub fn main(arguments: Vec<OsString>) -> u8 {
    provenance::begin(&arguments);
    let (cli, settings) =
        match settings::parse::<Cli>(headings::arranged(Cli::command()), arguments) {
            Ok(parsed) => parsed,
            Err(settings::Refused::Help(answer)) => {
                // A closed stdout does not count as a failure.
                let _ = answer.print();
                return answer.exit_code() as u8;
            }
            Err(settings::Refused::Mistake(line)) => {
                print::complain(line);
                return 2;
            }
        };
    settings.begin(&cli.general);
    if let Err(error) = signals::catch() {
        // Signals then end the program at once, and a capture with it.
        print::remark(format_args!("signals cannot be caught: {error}"));
    }
    let done = run(&cli.command).and_then(|code| settings.save(&cli.general).map(|()| code));
    match done {
        Ok(code) => {
            u8::from(code != ExitCode::SUCCESS || cli.general.strict && print::has_warned())
        }
        Err(error) => {
            print::complain(one_line(&error));
            let used_wrongly = error.is::<Usage>()
                || matches!(error.downcast_ref(), Some(FileError::Choice { .. }));
            if used_wrongly { 2 } else { 1 }
        }
    }
}

/// The error and its causes in one line.
fn one_line(error: &anyhow::Error) -> String {
    nirspi::causes::in_one_line(error.as_ref())
}
