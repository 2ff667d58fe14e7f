//! `nirspi serve`: a camera live on a web page.

use super::calibration::CalibrationArgs;
use super::camera::{CameraArgs, SceneArgs, SetupArgs};
use super::method::MethodArgs;
use super::serve_virtual::stop_on_signal;
use super::{address, print};
use anyhow::{Context, Result};
use nirspi::calibration::Choice;
use nirspi::imaging::Enhance;
use nirspi::serve::settings::{MAX_FRAMES, Settings};
use nirspi::serve::{CameraSource, Connect, Connected, Imaging, serve};
use nirspi::session::Session;
use nirspi::setup::MeasurementSetup;
use nirspi_nets::Device;
use nirspi_recon::omp::Backend;
use nirspi_recon::reconstruct::{Method, Reconstruct};
use nirspi_recon::{Sampling, Side};
use std::net::TcpListener;
use std::process::ExitCode;

/// Show a camera live on a web page: reconstructed, fused with depth and deblurred, with every frame accounted for
///
/// The command prints the address of the page. The page shows images, estimated blur and noise, rates, the account of all
/// frames and the camera's events. Controls on the page choose the method, switch the enhancement, and say how many frames
/// are summed. If the link to the camera is lost, the program opens the camera again. After a fault, a person must allow the
/// LEDs to go on, on the page. Only browsers on this machine can open the page, unless --listen says otherwise. Ctrl-C
/// switches the LEDs off and ends the program.
///
/// For scripts: GET /api/state (JSON: account, rates, versions, settings), /image.png (32 x 32), /enhanced.png (64 x 64) and
/// /events (a stream of states with images). POST /api/settings takes {"method": "tv", "enhance": true, "frames": 64, "resume": true}
/// or a part of that; "frames" is --sum. --backend holds for the networks, too.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n\
    \x20 nirspi serve\n\
    \x20 nirspi serve --camera usb --sampling 0.3\n\
    \x20 curl http://127.0.0.1:8080/api/state\n\
    \x20 curl -d '{\"method\": \"hadamard\"}' http://127.0.0.1:8080/api/settings")]
pub struct Args {
    /// Address of the page; port 0 takes a free port
    #[arg(long, value_name = "ADDR", default_value = "127.0.0.1:8080")]
    listen: String,
    /// Newest frames to sum into each image
    #[arg(long, alias = "frames", value_name = "N", default_value_t = 64,
          value_parser = clap::value_parser!(u32).range(1..=i64::from(MAX_FRAMES)))]
    sum: u32,
    #[command(flatten)]
    camera: CameraArgs,
    #[command(flatten)]
    calibration: CalibrationArgs,
    #[command(flatten)]
    setup: SetupArgs,
    #[command(flatten)]
    method: MethodArgs,
    #[command(flatten)]
    scene: SceneArgs,
}

pub fn run(args: &Args) -> Result<ExitCode> {
    args.method.check()?;
    let mut setup = args.setup.setup(Sampling::HALF, &args.scene.model)?;
    setup.adc_latency = args.calibration.adc_latency();
    let listener = TcpListener::bind(&args.listen)
        .with_context(|| format!("--listen {}: cannot listen there", args.listen))?;
    let address = listener.local_addr()?;
    let methods = methods(&args.method)?;
    let imaging = Imaging { methods, enhance: enhance(args.method.backend)? };
    let settings =
        Settings { method: args.method.method.argument(), enhance: true, frames: args.sum };
    let stop = stop_on_signal()?;
    let session = address::open(&args.camera.camera, &args.scene)?;
    let connected = prepared(session, &args.calibration, &setup)?;

    let machine = match address.ip() {
        ip if ip.is_unspecified() => format!("localhost:{}", address.port()),
        _ => address.to_string(),
    };
    print::line(format_args!(
        "open http://{machine} to see camera {}; Ctrl-C ends it",
        args.camera.camera
    ))?;
    if !address.ip().is_loopback() {
        print::line("every machine in this network can open the page and switch the camera")?;
    }
    let camera = CameraSource {
        address: args.camera.camera.to_string(),
        setup: setup.clone(),
        model: args.scene.model.read()?,
        connect: connect(args, setup),
    };
    let ledger = serve(listener, camera, connected, imaging, settings, &stop)?;
    let shown = ledger.images.shown;
    print::line(format_args!("stopped: {}; {shown} shown", ledger.frames))?;
    Ok(ExitCode::SUCCESS)
}

/// Every method, each with the settings that it accepts, because a page can switch to any method.
fn methods(args: &MethodArgs) -> Result<Vec<(&'static str, Box<dyn Reconstruct>)>> {
    let settings = args.settings_for(Side::INSTRUMENT.pixels())?;
    let ready =
        |method: &Method| Ok((method.argument(), method.prepare(&settings.taken_by(*method))?));
    Method::ALL.iter().map(ready).collect()
}

/// The learned stages, on the backend of OMP. One image at a time is too little work for a GPU that
/// was not requested.
fn enhance(backend: Backend) -> Result<Enhance> {
    let backend = if backend == Backend::Auto { Backend::Cpu } else { backend };
    Ok(Enhance::built_in(&Device::open(backend)?)?)
}

/// A camera with its calibration.
fn prepared(
    session: Session,
    args: &CalibrationArgs,
    setup: &MeasurementSetup,
) -> Result<Connected> {
    let Choice { calibration, note, flat_field, .. } = args.choose(setup, session.identity())?;
    Ok(Connected { session, calibration, note, flat_field })
}

/// A function that connects to the camera again.
fn connect(args: &Args, setup: MeasurementSetup) -> Connect {
    let (camera, scene, calibration) =
        (args.camera.camera.clone(), args.scene.clone(), args.calibration.clone());
    let found = move || {
        let mut session = address::open_quietly(&camera, &scene)?;
        session.await_reports()?;
        prepared(session, &calibration, &setup)
    };
    Box::new(move || found().map_err(Into::into))
}
