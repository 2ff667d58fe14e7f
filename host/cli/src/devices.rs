//! `nirspi devices`: lists the cameras that answer.

use super::print;
use anyhow::Result;
use nirspi::link::usb::{self, UsbCamera, identify::check_version};
use nirspi::link::{TcpLink, serial_ports};
use nirspi::session::{CameraIdentity, Session, SessionError};
use serde::Serialize;
use std::io;
use std::path::PathBuf;
use std::process::ExitCode;

/// Default address of `nirspi virtual`.
pub const DEFAULT_TCP: &str = "127.0.0.1:1550";

/// List the cameras that can be used
///
/// Looks at USB, at the TCP addresses given and at the default one of `nirspi virtual`. Serial ports are listed and not
/// asked: who knows what else listens there. The virtual camera inside this program is always there.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n\
    \x20 nirspi devices --tcp 192.168.0.7:1550")]
pub struct Args {
    /// Also look here; may be repeated
    #[arg(long, value_name = "HOST:PORT")]
    tcp: Vec<String>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// One camera, with its address for `--camera`.
#[derive(Debug, Serialize)]
struct Device {
    camera: String,
    identity: Option<CameraIdentity>,
    /// The protocol version of a USB camera that was not opened.
    #[serde(skip_serializing_if = "Option::is_none")]
    protocol: Option<u16>,
    #[serde(skip_serializing_if = "Option::is_none")]
    note: Option<String>,
    problem: Option<String>,
}

impl Device {
    fn new(camera: String) -> Self {
        Self { camera, identity: None, protocol: None, note: None, problem: None }
    }

    fn noting(self, note: &str) -> Self {
        Self { note: Some(note.to_owned()), ..self }
    }
}

pub fn run(args: &Args) -> Result<ExitCode> {
    let default = (!args.tcp.iter().any(|a| a == DEFAULT_TCP)).then_some(DEFAULT_TCP);
    let asked = args.tcp.iter().map(|address| (address.as_str(), true));
    let addresses: Vec<(&str, bool)> =
        asked.chain(default.map(|address| (address, false))).collect();
    // The addresses are tried in parallel, because an address without an answer takes time.
    let answers: Vec<_> = std::thread::scope(|scope| {
        let asking: Vec<_> =
            addresses.iter().map(|(address, _)| scope.spawn(|| identify(address))).collect();
        asking.into_iter().map(std::thread::ScopedJoinHandle::join).collect()
    });

    let mut devices = vec![
        Device::new("virtual".to_owned())
            .noting("built in: optics simulator, gateware model, real firmware logic"),
    ];
    for ((address, named), answer) in addresses.into_iter().zip(answers) {
        let camera = format!("tcp:{address}");
        match answer.map_err(|_| anyhow::anyhow!("asking {address} failed"))? {
            Ok(identity) => {
                devices.push(Device { identity: Some(identity), ..Device::new(camera) });
            }
            // A missing camera at the default address is not reported.
            Err(SessionError::Link(error))
                if !named && error.kind() == io::ErrorKind::ConnectionRefused => {}
            Err(error) => {
                let problem = Some(nirspi::causes::in_one_line(&error));
                devices.push(Device { problem, ..Device::new(camera) });
            }
        }
    }
    devices.extend(on_usb());
    devices.extend(on_serial_ports());
    if args.json {
        print::json(&devices)?;
    } else {
        for device in &devices {
            print::line(format_args!("{:<28} {}", device.camera, describe(device)))?;
        }
    }
    let failed = devices.iter().any(|device| device.problem.is_some());
    Ok(if failed { ExitCode::FAILURE } else { ExitCode::SUCCESS })
}

fn describe(device: &Device) -> String {
    match (&device.identity, &device.problem, &device.note) {
        (Some(id), _, _) => format!(
            "{} {}, firmware {}, gateware {}, protocol {}",
            id.board, id.serial, id.firmware, id.gateware, id.protocol
        ),
        (None, Some(text), _) | (None, None, Some(text)) => text.clone(),
        (None, None, None) => String::new(),
    }
}

fn identify(address: &str) -> Result<CameraIdentity, SessionError> {
    let link = TcpLink::connect(address)?;
    Ok(Session::open(Box::new(link))?.identity().clone())
}

/// Cameras on USB, by their descriptors; empty on a system without USB.
fn on_usb() -> Vec<Device> {
    let cameras = match usb::usb_cameras() {
        Ok(cameras) => cameras,
        Err(error) => {
            return vec![
                Device::new("usb".to_owned())
                    .noting(&format!("not listed: {}", nirspi::causes::in_one_line(&error))),
            ];
        }
    };
    let device = |camera: UsbCamera| {
        let said = match camera.protocol.map(|protocol| (protocol, check_version(protocol))) {
            None => "protocol not known before it is opened".to_owned(),
            Some((oldest, Ok(()))) => format!("protocol {oldest} or newer"),
            Some((_, Err(problem))) => problem.to_string(),
        };
        let protocol = camera.protocol;
        Device { protocol, ..Device::new(camera.to_string()).noting(&said) }
    };
    cameras.into_iter().map(device).collect()
}

/// Serial ports; empty on a system that does not list its ports.
fn on_serial_ports() -> Vec<Device> {
    let ports = serial_ports().unwrap_or_default();
    let device = |port: PathBuf| {
        let camera = format!("serial:{}", port.display());
        let note = format!("a serial port, not asked: nirspi info --camera {camera}");
        Device::new(camera).noting(&note)
    };
    ports.into_iter().map(device).collect()
}
