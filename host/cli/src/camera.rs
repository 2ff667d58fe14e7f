//! Arguments for the camera, for the scene of a virtual camera, and for the measurement.

use super::{Usage, print};
use anyhow::{Context, Result};
use clap::{Args, ValueEnum};
use nirspi::address::CameraAddress;
use nirspi::devices;
use nirspi::exposure::{Exposure, Length, Light};
use nirspi::feed::Address as FeedAddress;
use nirspi::order_table::read_order_table;
use nirspi::scene::{SceneMap, SceneSource};
use nirspi::setup::MeasurementSetup;
use nirspi_optics::Motion;
use nirspi_optics::rain::{Air, Rainfall};
use nirspi_recon::{Order, Sampling};
use nirspi_virtual::weather::{WeatherError, read_weather};
use nirspi_virtual::{CameraModel, SpecularSpot, VirtualOptics, read_camera_model};
use std::path::Path;
use std::str::FromStr;

/// Edge of a drawn scene's reflectance map.
const SCENE_PX: usize = 256;

/// Which camera.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Camera")]
pub struct CameraArgs {
    /// Which camera: virtual, usb, usb:SERIAL, tcp:HOST:PORT, serial:PATH[:BAUD], or replay:REC[,SPEED]: a recording that
    /// is played back with its own setup and calibration, at 1, 0.5, ... times the camera's time or at max speed. For capture
    /// and serve also feed:ADDR: live readings of any other bench (docs/feeds.md)
    /// [default: the camera on USB, or virtual without a camera there]
    #[arg(long, value_name = "CAMERA")]
    camera: Option<CameraAddress>,
}

impl CameraArgs {
    /// Whether a recording plays the camera.
    pub fn is_replay(&self) -> bool {
        matches!(self.camera, Some(CameraAddress::Replay(_)))
    }

    /// The feed, if the readings come from one.
    pub fn feed(&self) -> Option<&FeedAddress> {
        match &self.camera {
            Some(CameraAddress::Feed(address)) => Some(address),
            _ => None,
        }
    }

    /// The camera's address, and a note that says which camera it is if the user named no camera.
    pub fn address_and_note(&self) -> Result<(CameraAddress, Option<String>)> {
        if let Some(address) = &self.camera {
            return Ok((address.clone(), None));
        }
        let default =
            devices::default_camera().map_err(|several| Usage(format!("--camera: {several}")))?;
        Ok((default.address, Some(default.note)))
    }

    /// The camera's address. Prints the note, but for a result in JSON, which names the camera itself.
    pub fn address(&self, json: bool) -> Result<CameraAddress> {
        let (address, note) = self.address_and_note()?;
        say(note, json)?;
        Ok(address)
    }
}

/// Prints the note of [`CameraArgs::address_and_note`].
pub fn say(note: Option<String>, json: bool) -> Result<()> {
    match note {
        Some(note) if !json => print::note(note),
        _ => Ok(()),
    }
}

/// What stands before a virtual camera.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Scene and weather, simulated")]
pub struct SceneArgs {
    /// What the virtual camera looks at: letter:R (43 mm, bright on dark), word:STOP, white (a sheet), black (a covered
    /// lens), or a PNG or JPEG file (fills the field)
    #[arg(long, value_name = "SCENE", default_value = "letter:R")]
    pub scene: String,
    /// Distance from the virtual camera to the target, in metres [default: where the lens is focused; 0.3 for the paper's
    /// camera]
    #[arg(long, value_name = "M")]
    pub distance_m: Option<f64>,
    /// Rain between the virtual camera and the target, as in the paper's Table 2: light is 1.93 mm/h of 0.5 mm drops,
    /// heavy 5.6 mm/h of 2 mm drops [default: what the camera description says; none for the shipped ones]
    #[arg(long, value_enum, conflicts_with = "weather")]
    pub rain: Option<Rain>,
    #[command(flatten)]
    pub weather: WeatherArgs,
    #[command(flatten)]
    pub motion: MotionArgs,
    /// A spot of the target, as large as a pixel, that throws the LEDs' light straight back. 50 is a spot 50 times as bright
    /// as white paper; 50@8,23 also says its row and column
    #[arg(long, value_name = "TIMES[@ROW,COLUMN]")]
    pub specular: Option<SpecularSpot>,
    #[command(flatten)]
    pub model: ModelArgs,
    /// Seed of the simulated noise: the same seed gives the same bytes
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
}

/// Which simulated camera.
#[derive(Debug, Clone, Args)]
pub struct ModelArgs {
    /// Description of the simulated camera: paper, fga015, one-metre, or a TOML file. `nirspi camera model --print` prints
    /// one to start from
    #[arg(long, value_name = "NAME|FILE", default_value = "paper")]
    pub camera_model: String,
}

impl ModelArgs {
    /// Reads the description.
    pub fn read(&self) -> Result<CameraModel> {
        Ok(read_camera_model(&self.camera_model)?)
    }
}

/// Weather of any kind.
#[derive(Debug, Clone, Args)]
pub struct WeatherArgs {
    /// Weather between the virtual camera and the target, in more detail than --rain. rain:20 is 20 mm/h of natural rain,
    /// rain:20,mono:2 the same of 2 mm drops. fog:0.5 is fog with 0.5 g/m3 of water, fog:5m fog with a visibility of
    /// 5 metres, fog:5m,4 the same of droplets of 4 µm. smoke:... and dust:... are written as fog is;
    /// dust:0.5,2,1.53,0.003 adds the complex refractive index of the grains. A CSV file lists drop diameters in mm and
    /// drops per m3. window:0.2 puts drops of water on a fifth of the window; +window:0.2 adds them to any other weather
    #[arg(long, value_name = "WEATHER")]
    pub weather: Option<String>,
}

impl WeatherArgs {
    /// The requested weather, if any.
    pub fn read(&self) -> Result<Option<Air>> {
        let read = |text: &String| {
            read_weather(text).map_err(|error| match error {
                error @ WeatherError::Text(_) => Usage(format!("--weather: {error}")).into(),
                error => anyhow::Error::from(error),
            })
        };
        self.weather.as_ref().map(read).transpose()
    }
}

/// How the target moves.
#[derive(Debug, Clone, Default, Args)]
pub struct MotionArgs {
    /// Speed of the target across the field, in metres a second. It leaves the field and comes again from the other side
    #[arg(long, value_name = "M_PER_S", default_value_t = 0.0)]
    pub target_speed: f64,
    /// Where the target goes: 0 is to the right, 90 down
    #[arg(
        long,
        value_name = "DEGREES",
        default_value_t = 0.0,
        requires = "target_speed",
        allow_negative_numbers = true
    )]
    pub target_direction: f64,
    /// Degrees a second by which the target turns, clockwise
    #[arg(
        long,
        value_name = "DEGREES_PER_S",
        default_value_t = 0.0,
        allow_negative_numbers = true
    )]
    pub target_turning: f64,
}

impl MotionArgs {
    fn motion(&self) -> Motion {
        Motion {
            speed_m_per_s: self.target_speed,
            direction_deg: self.target_direction,
            turning_deg_per_s: self.target_turning,
        }
    }
}

/// The paper's rain (Table 2).
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Rain {
    /// Dry air.
    None,
    /// 1.93 mm/h, 0.5 mm.
    Light,
    /// 5.6 mm/h, 2 mm.
    Heavy,
}

impl Rain {
    /// The same rain as a value of the optics.
    pub fn rainfall(self) -> Rainfall {
        match self {
            Self::None => Rainfall::None,
            Self::Light => Rainfall::Light,
            Self::Heavy => Rainfall::Heavy,
        }
    }
}

impl SceneArgs {
    /// A white sheet where the lens is focused, for a calibration.
    pub fn white_sheet(model: &ModelArgs, seed: u64) -> Self {
        Self::sheet("white", model, seed)
    }

    /// A cover before the lens, for a dark frame.
    pub fn covered(model: &ModelArgs, seed: u64) -> Self {
        Self::sheet("black", model, seed)
    }

    fn sheet(scene: &str, model: &ModelArgs, seed: u64) -> Self {
        let (scene, model) = (scene.to_owned(), model.clone());
        let weather = WeatherArgs { weather: None };
        let motion = MotionArgs::default();
        let (rain, specular) = (Some(Rain::None), None);
        Self { scene, distance_m: None, rain, weather, motion, specular, model, seed }
    }

    /// The weather in front of this camera.
    pub fn air(&self, model: &CameraModel) -> Result<Air> {
        match (self.weather.read()?, self.rain) {
            (Some(air), _) => Ok(air),
            (None, Some(rain)) => Ok(Air::of_rainfall(rain.rainfall())?),
            (None, None) => Ok(model.weather.air.clone()),
        }
    }

    /// The scene, and the optics in front of it.
    pub fn optics(&self) -> Result<(SceneMap, VirtualOptics)> {
        let model = self.model.read()?;
        let distance_mm = self.distance_m.map_or(model.projector().focus_distance_mm, |m| m * 1e3);
        if !(distance_mm.is_finite() && distance_mm > 0.0) {
            let found = distance_mm / 1e3;
            return Err(Usage(format!(
                "--distance-m is {found}, expected a positive number of metres"
            ))
            .into());
        }
        let source = SceneSource::from_str(&self.scene).map_err(|e| Usage(e.to_string()))?;
        let map = source.load(SCENE_PX)?;
        let distance_m = distance_mm / 1e3;
        let optics = VirtualOptics::before(&model, &map, distance_mm)
            .map_err(|error| Usage(format!("--distance-m {distance_m}: {error}")))?;
        let optics = optics.moving(self.motion.motion()).map_err(|e| Usage(e.to_string()))?;
        let air = self.air(&model)?;
        let optics = optics
            .in_air(&air)
            .map_err(|error| Usage(format!("{air} at --distance-m {distance_m}: {error}")))?;
        let optics = match self.specular {
            Some(spot) => {
                optics.with_specular(spot).map_err(|error| Usage(format!("--specular: {error}")))?
            }
            None => optics,
        };
        Ok((map, optics))
    }
}

/// How to measure.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Measurement")]
pub struct SetupArgs {
    #[arg(long, value_name = "ORDER", default_value = "cake-cutting", help = order_help())]
    pub order: String,
    /// Share of all patterns to show, the first of the order: 0.3 or 30% [default: 0.5]
    #[arg(long, value_name = "SHARE")]
    pub sampling: Option<Sampling>,
    /// Sweeps summed into one frame [default: as many as take about the time of one sweep of all patterns; with --light, as
    /// many as slow the frames down to what the boards' link carries]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub sweeps: Option<u32>,
    /// ADC clocks (of 8 ns) for which each pattern is shown: 5 is 25 MHz [default: what the camera description says; 5 for
    /// the paper's camera]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    pub clocks_per_pattern: Option<u16>,
    /// ADC samples left out at the start of each pattern [default: what the camera description says; 2 for the paper's
    /// camera]
    #[arg(long, value_name = "N")]
    pub blanked: Option<u16>,
    /// Show patterns alone, without their complements
    #[arg(long)]
    pub non_differential: bool,
}

impl SetupArgs {
    /// The setup asked for.
    pub fn setup(&self, default_sampling: Sampling, model: &ModelArgs) -> Result<MeasurementSetup> {
        let order = parse_order("--order", &self.order)?;
        let readout = model.read()?.readout;
        let clocks = self.clocks_per_pattern.unwrap_or(readout.clocks_per_pattern);
        let blanked = self.blanked.unwrap_or(readout.blanked);
        if blanked >= clocks {
            return Err(Usage(format!(
                "--blanked is {blanked}, expected less than the {clocks} of --clocks-per-pattern"
            ))
            .into());
        }
        let sampling = self.sampling.unwrap_or(default_sampling);
        let mut setup = MeasurementSetup::new(&order, sampling.share())
            .with_context(|| format!("--order {}", self.order))?;
        setup = setup.timed(clocks, blanked);
        setup.differential = !self.non_differential;
        setup.sweeps = self.sweeps.unwrap_or_else(|| setup.sweeps_as_long_as_all());
        Ok(setup)
    }

    /// The frames and sweeps that make up this light.
    pub fn exposure(&self, light: Light, setup: &MeasurementSetup) -> Result<Exposure> {
        exposure(Length::Light(light, self.sweeps), setup)
    }
}

/// Help of `--light`.
pub const LIGHT_HELP: &str = "Light of the measurement, as a time with its unit: 20ms, 0.5s. The frames and the sweeps of a frame follow from \
                              it, so that another share of the patterns gets the same light";

/// The frames and sweeps of a measurement.
pub fn exposure(length: Length, setup: &MeasurementSetup) -> Result<Exposure> {
    Exposure::of(length, setup).map_err(|error| Usage(format!("--light: {error}")).into())
}

fn order_help() -> String {
    format!(
        "Order of the patterns: {}, or table:FILE (numbers, entry k the natural-order Hadamard row shown k-th)",
        Order::expected()
    )
}

/// An order by name, or a user's own order from a file. `option` names the option in errors.
pub fn parse_order(option: &str, name: &str) -> Result<Order> {
    if let Some(path) = name.strip_prefix("table:") {
        return Ok(Order::Table(read_order_table(Path::new(path))?));
    }
    Order::from_str(name).map_err(|error| Usage(format!("{option}: {error} or table:FILE")).into())
}
