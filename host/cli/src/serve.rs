//! `nirspi serve`: a camera live on a web page.

use super::calibration::CalibrationArgs;
use super::camera::{self, CameraArgs, SceneArgs, SetupArgs};
use super::method::MethodArgs;
use super::provenance::made;
use super::{Usage, address, feed, print};
use anyhow::{Context, Result, anyhow, bail};
use nirspi::address::CameraAddress;
use nirspi::capture::Choice;
use nirspi::exposure::Light;
use nirspi::feed::{Address, Feed};
use nirspi::files::{interrupt, read_small_text};
use nirspi::session::Session;
use nirspi::setup::MeasurementSetup;
use nirspi_recon::{Sampling, Side, Size};
use nirspi_serve::settings::{MAX_FRAMES, Settings};
use nirspi_serve::{
    Access, BasePath, CameraSource, Connect, Connected, FeedSource, HostName, Imaging, Server,
    StagedScene, Token, serve, serve_feed,
};
use nirspi_virtual::MemoryLink;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::atomic::Ordering;

/// Show a camera live on a web page, each frame accounted for
///
/// The page shows images reconstructed, enlarged and deblurred. The command prints the address of the page. docs/live-page.md lists the settings that the page changes. The stop button,
/// Escape and the space bar switch the LEDs off. If the link to the camera is lost, the program opens the camera again. After
/// a stop or a fault, a person must allow the LEDs to go on, on the page. Only browsers on this machine can open the page,
/// unless --listen says otherwise; then the page demands a token. Ctrl-C switches the LEDs off and ends the program.
///
/// With --camera feed:ADDR, the page shows the live readings of any other bench, without LEDs: docs/feeds.md.
///
/// For scripts: GET /api/state, /events, /image.png, /image.npy, /enhanced.png and /enhanced.npy; POST /api/settings, /api/scene,
/// /api/stop and /api/start. --backend holds for the networks, too.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n\
    \x20 nirspi serve\n\
    \x20 nirspi serve --camera usb --sampling 0.3\n\
    \x20 nirspi serve --camera feed:127.0.0.1:5025\n\
    \x20 curl http://127.0.0.1:8080/api/state\n\
    \x20 curl -d '{\"method\": \"hadamard\"}' http://127.0.0.1:8080/api/settings")]
pub struct Args {
    /// Address of the page; port 0 takes a free port. An address that other machines reach demands a token
    #[arg(long, value_name = "ADDR", default_value = "127.0.0.1:8080")]
    listen: String,
    /// Token that browsers and scripts must know, 16 characters or more [default: none for an address that only this machine
    /// reaches, else a random one, in the printed address]
    #[arg(long, value_name = "TOKEN")]
    token: Option<Token>,
    /// File whose only line is the token. Other users of this machine can read a token on the command line, but not this file
    /// if its mode forbids that
    #[arg(long, value_name = "FILE", conflicts_with = "token")]
    token_file: Option<PathBuf>,
    /// Serve everything below this path, as /camera1: for a reverse proxy that has more than this page
    #[arg(long, value_name = "PATH", default_value = "/")]
    base_path: BasePath,
    /// Name under which a reverse proxy or other machines open the page, as camera.example.org. It demands a token. Give the
    /// option again for another name [default: localhost and the addresses of this machine]
    #[arg(long, value_name = "NAME")]
    allow_host: Vec<HostName>,
    /// Folder for recordings, which the page begins and ends. Without it, the page cannot record
    #[arg(long, value_name = "DIR")]
    record_to: Option<PathBuf>,
    /// The patterns of a feed that shows its own, as for `nirspi reconstruct --matrix`: docs/feeds.md
    #[arg(long, value_name = "FILE|DIR|SET")]
    matrix: Option<PathBuf>,
    /// Newest frames to sum into each image; of a feed, 1 if the option is not given
    #[arg(long, value_name = "N", default_value_t = 64,
          value_parser = clap::value_parser!(u32).range(1..=i64::from(MAX_FRAMES)))]
    frames: u32,
    #[arg(
        long,
        value_name = "TIME",
        conflicts_with = "frames",
        allow_hyphen_values = true,
        help = "Light of each image, as a time with its unit: 20ms, 0.2s. --frames and --sweeps follow from it"
    )]
    light: Option<Light>,
    /// Start each image from the images before, moved with the scene. Each frame is then in one image only: a new image
    /// comes after --frames new frames
    #[arg(long)]
    warm_start: bool,
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

impl Args {
    /// The token that the user has chosen.
    fn token(&self) -> Result<Option<Token>> {
        let Some(file) = &self.token_file else { return Ok(self.token.clone()) };
        let named = || format!("--token-file {}", file.display());
        let text = read_small_text(file).with_context(named)?;
        Ok(Some(text.trim().parse::<Token>().map_err(|why| anyhow!("{}: {why}", named()))?))
    }

    /// The server, listening.
    fn server(&self) -> Result<Server> {
        if let Some(folder) = self.record_to.as_ref().filter(|folder| !folder.is_dir()) {
            bail!("--record-to {}: found no such folder", folder.display());
        }
        let access = Access {
            token: self.token()?,
            names: self.allow_host.clone(),
            base_path: self.base_path.clone(),
        };
        Server::bind(&self.listen, access, made())
            .with_context(|| format!("--listen {}: cannot listen there", self.listen))
    }

    /// Methods and networks, and the settings with which the page begins.
    fn imaging(&self, size: Size, settings: Settings) -> Result<(Imaging, Settings)> {
        let method = &self.method;
        let mut imaging = Imaging::new(&method.settings_for(size)?, method.device()?)?;
        if self.matrix.is_some() {
            let refused = |why| Usage(format!("--{why}"));
            imaging = imaging.of_own_patterns(method.method).map_err(refused)?;
        }
        let settings =
            Settings { strength: method.strength, warm_start: self.warm_start, ..settings };
        if self.warm_start {
            let refused = |why| Usage(format!("--warm-start: {why}"));
            imaging.check_warm_start(settings.method).map_err(refused)?;
        }
        Ok((imaging, settings))
    }
}

pub fn run(args: &Args) -> Result<ExitCode> {
    args.method.check(false)?;
    if let Some(address) = args.camera.feed() {
        return run_feed(args, address);
    }
    if args.matrix.is_some() {
        return Err(Usage("--matrix belongs to --camera feed:ADDR".to_owned()).into());
    }
    let mut setup = args.setup.setup(Sampling::HALF, &args.scene.model)?;
    setup.adc_latency = args.calibration.adc_latency();
    let mut sum = args.frames;
    if let Some(light) = args.light {
        let exposure = args.setup.exposure(light, &setup)?;
        (sum, setup.sweeps) = (exposure.frames, exposure.sweeps);
        if sum > MAX_FRAMES {
            let advice = "sum more sweeps into a frame with --sweeps";
            return Err(Usage(format!(
                "--light {light} is {sum} frames an image, expected at most {MAX_FRAMES}: {advice}"
            ))
            .into());
        }
    }
    let server = args.server()?;
    let settings = Settings::new(args.method.method, sum, &setup);
    let (imaging, settings) = args.imaging(Side::INSTRUMENT.into(), settings)?;
    let stop = interrupt::stop_flag();
    let (address, note) = args.camera.address_and_note()?;
    let session = address::open(&address, &args.scene)?;
    let connected = prepared(session, &args.calibration, &setup)?;
    print::line(server.invitation(&address))?;
    camera::say(note, false)?;
    let source = CameraSource {
        address: address.to_string(),
        setup: setup.clone(),
        model: args.scene.model.read()?,
        scene: scene(args, &address)?,
        record_to: args.record_to.clone(),
        connect: connect(args, address, setup),
    };
    let served = serve(server, source, connected, imaging, settings, &stop)?;
    print::line(format_args!("stopped: {served}"))?;
    Ok(ExitCode::SUCCESS)
}

/// Shows a feed instead of a camera.
fn run_feed(args: &Args, address: &Address) -> Result<ExitCode> {
    const OWN: [&str; 16] = [
        "matrix",
        "listen",
        "token",
        "token-file",
        "base-path",
        "allow-host",
        "record-to",
        "sum",
        "frames",
        "warm-start",
        "method",
        "basis",
        "dictionary",
        "sparsity",
        "strength",
        "backend",
    ];
    const MORE: [&str; 4] = ["residual", "stop-at-noise", "as-printed", "non-negative"];
    feed::refuse_others(&[&OWN[..], &MORE].concat())?;
    let server = args.server()?;
    let stop = interrupt::stop_flag();
    print::remark(format_args!("{address}: waiting for the header"));
    let feed = Feed::open(address, || !stop.load(Ordering::Relaxed))?;
    // A bench takes longer for a frame than a camera: each frame is an image.
    let sum = if feed::is_given("frames") { args.frames } else { 1 };
    let again = (*address != Address::Stdin).then(|| address.clone());
    let (matrix, record_to) = (args.matrix.clone(), args.record_to.clone());
    let source = FeedSource::new(address.to_string(), feed, again, matrix, record_to)
        .with_context(|| address.to_string())?;
    let settings = source.settings(args.method.method, sum);
    let (imaging, settings) = args.imaging(source.header().size(), settings)?;
    print::line(server.invitation(address))?;
    let served = serve_feed(server, source, imaging, settings, &stop)?;
    print::line(format_args!("stopped: {served}"))?;
    Ok(ExitCode::SUCCESS)
}

/// The scene before a virtual camera in this process.
fn scene(args: &Args, address: &CameraAddress) -> Result<Option<StagedScene>> {
    if *address != CameraAddress::Virtual {
        return Ok(None);
    }
    let (map, optics) = args.scene.optics()?;
    let air = args.scene.air(optics.camera_model())?;
    Ok(Some(StagedScene { map, distance_m: optics.distance_mm() / 1e3, air }))
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
fn connect(args: &Args, camera: CameraAddress, setup: MeasurementSetup) -> Connect {
    let (staged, calibration) = (args.scene.clone(), args.calibration.clone());
    let found = move |scene: Option<&StagedScene>| {
        let mut session = match scene {
            Some(scene) => {
                let camera = scene.camera(&staged.model.read()?, staged.seed)?;
                Session::open(Box::new(MemoryLink::new(camera)))?
            }
            None => address::open_quietly(&camera, &staged)?,
        };
        session.await_reports()?;
        prepared(session, &calibration, &setup)
    };
    Box::new(move |scene| found(scene).map_err(Into::into))
}
