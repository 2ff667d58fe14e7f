//! `nirspi serve`: a camera live on a web page.

use super::address::{self, CameraAddress};
use super::calibration::CalibrationArgs;
use super::camera::{SceneArgs, SetupArgs};
use super::method::MethodArgs;
use super::print;
use super::serve_virtual::stop_on_signal;
use anyhow::{Context, Result};
use nirspi::calibration::Choice;
use nirspi::imaging::Enhance;
use nirspi::serve::settings::{MAX_FRAMES, Settings};
use nirspi::serve::{CameraSource, Connect, Connected, Imaging, serve};
use nirspi::session::Session;
use nirspi::setup::MeasurementSetup;
use nirspi_nets::Device;
use nirspi_recon::Side;
use nirspi_recon::omp::Backend;
use nirspi_recon::reconstruct::{Method, Reconstruct};
use std::net::TcpListener;
use std::process::ExitCode;

/// Half of the patterns, which give twice the frames; OMP predicts the other half.
const DEFAULT_SAMPLING: f64 = 0.5;

/// Show a camera live on a web page: reconstructed, fused with depth and deblurred, with every frame accounted for
///
/// Prints the address to open. The page shows images, estimated blur and noise, rates, the account of all frames and the
/// camera's events; it switches the method, the enhancement and how many frames are summed. A camera that goes away is looked
/// for again; after a fault somebody has to say on the page that LEDs may go on. Only this machine can look, unless
/// --listen says otherwise. Ctrl-C switches the LEDs off and ends it.
///
/// For scripts: GET /api/state (JSON: account, rates, versions, settings), /image.png (32 x 32), /enhanced.png (64 x 64) and
/// /events (a stream of all of it); POST /api/settings takes {"method": "omp", "enhance": true, "frames": 64, "resume": true} or a
/// part of it. --backend holds for the networks too.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n\
    \x20 nirspi serve\n\
    \x20 nirspi serve --camera usb --sampling 0.3\n\
    \x20 curl http://127.0.0.1:8080/api/state\n\
    \x20 curl -d '{\"method\": \"hadamard\"}' http://127.0.0.1:8080/api/settings")]
pub struct Args {
    /// Which camera: virtual, usb, usb:SERIAL, tcp:HOST:PORT or serial:PATH[:BAUD]
    #[arg(long, value_name = "CAMERA", default_value = "virtual")]
    camera: CameraAddress,
    /// Where to listen; port 0 takes a free one
    #[arg(long, value_name = "ADDR", default_value = "127.0.0.1:8080")]
    listen: String,
    /// Newest frames that are summed into each image
    #[arg(long, value_name = "N", default_value_t = 64,
          value_parser = clap::value_parser!(u32).range(1..=i64::from(MAX_FRAMES)))]
    frames: u32,
    #[command(flatten)]
    calibration: CalibrationArgs,
    #[command(flatten)]
    setup: SetupArgs,
    #[command(flatten)]
    method: MethodArgs,
    #[command(flatten)]
    scene: SceneArgs,
}

pub fn run(args: Args) -> Result<ExitCode> {
    args.method.check()?;
    let mut setup = args.setup.setup(DEFAULT_SAMPLING, &args.scene.model)?;
    setup.adc_latency = args.calibration.adc_latency();
    let listener = TcpListener::bind(&args.listen)
        .with_context(|| format!("--listen {}: cannot listen there", args.listen))?;
    let address = listener.local_addr()?;
    let methods = methods(&args.method)?;
    let imaging = Imaging { methods, enhance: enhance(args.method.backend)? };
    let settings =
        Settings { method: args.method.method.argument(), enhance: true, frames: args.frames };
    let stop = stop_on_signal()?;
    let session = address::open(&args.camera, &args.scene)?;
    let connected = prepared(session, &args.calibration, &setup)?;

    let machine = match address.ip() {
        ip if ip.is_unspecified() => format!("localhost:{}", address.port()),
        _ => address.to_string(),
    };
    print::line(format_args!(
        "open http://{machine} to see camera {}; Ctrl-C ends it",
        args.camera
    ))?;
    if !address.ip().is_loopback() {
        print::line("everybody in the network can look at it and switch it")?;
    }
    let camera = CameraSource {
        address: args.camera.to_string(),
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
fn connect(args: Args, setup: MeasurementSetup) -> Connect {
    let found = move || {
        let mut session = address::open_quietly(&args.camera, &args.scene)?;
        session.await_reports()?;
        prepared(session, &args.calibration, &setup)
    };
    Box::new(move || found().map_err(Into::into))
}
