//! `nirspi devices`: cameras that answer.

use super::print;
use anyhow::Result;
use nirspi::link::TcpLink;
use nirspi::session::{CameraIdentity, Session, SessionError};
use serde::Serialize;
use std::io;
use std::process::ExitCode;

/// Where `nirspi virtual` listens unless told otherwise.
pub const DEFAULT_TCP: &str = "127.0.0.1:1550";

/// List the cameras that can be used
///
/// Looks at the TCP addresses given and at the default one of `nirspi virtual`. The virtual camera inside this
/// program is always there.
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

/// One camera, as `--camera` names it.
#[derive(Debug, Serialize)]
struct Device {
    camera: String,
    identity: Option<CameraIdentity>,
    problem: Option<String>,
}

pub fn run(args: &Args) -> Result<ExitCode> {
    let default = (!args.tcp.iter().any(|a| a == DEFAULT_TCP)).then_some(DEFAULT_TCP);
    let asked = args.tcp.iter().map(|address| (address.as_str(), true));
    let addresses: Vec<(&str, bool)> =
        asked.chain(default.map(|address| (address, false))).collect();
    // All at once: an address where nobody answers takes its time.
    let answers: Vec<_> = std::thread::scope(|scope| {
        let asking: Vec<_> =
            addresses.iter().map(|(address, _)| scope.spawn(|| identify(address))).collect();
        asking.into_iter().map(std::thread::ScopedJoinHandle::join).collect()
    });

    let mut devices = vec![Device { camera: "virtual".to_owned(), identity: None, problem: None }];
    for ((address, named), answer) in addresses.into_iter().zip(answers) {
        let camera = format!("tcp:{address}");
        match answer.map_err(|_| anyhow::anyhow!("asking {address} failed"))? {
            Ok(identity) => {
                devices.push(Device { camera, identity: Some(identity), problem: None });
            }
            // Nobody at the default address is no news.
            Err(SessionError::Link(error))
                if !named && error.kind() == io::ErrorKind::ConnectionRefused => {}
            Err(error) => {
                let problem = Some(error.to_string());
                devices.push(Device { camera, identity: None, problem });
            }
        }
    }
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
    match (&device.identity, &device.problem) {
        (Some(id), _) => format!(
            "{} {}, firmware {}, gateware {}, protocol {}",
            id.board, id.serial, id.firmware, id.gateware, id.protocol
        ),
        (None, Some(problem)) => problem.clone(),
        (None, None) => {
            "built in: optics simulator, gateware model, real firmware logic".to_owned()
        }
    }
}

fn identify(address: &str) -> Result<CameraIdentity, SessionError> {
    let link = TcpLink::connect(address)?;
    Ok(Session::open(Box::new(link))?.identity().clone())
}
