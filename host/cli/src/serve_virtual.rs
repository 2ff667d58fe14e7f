//! `nirspi dev virtual`: the virtual camera behind a TCP port.

use super::camera::SceneArgs;
use super::print;
use anyhow::{Context, Result};
use nirspi::files::interrupt;
use nirspi_virtual::{
    PrecomputedFpga, ServeOptions, SimulatedFpga, VirtualCamera, serve, serve_tunnel,
};
use std::net::{TcpListener, TcpStream};
use std::process::ExitCode;
use std::sync::atomic::AtomicBool;

/// Serve the virtual camera over TCP, for `capture --camera tcp:ADDR` in another process
///
/// The virtual camera serves one host at a time. Port 0 takes a free port; the first line of output names it.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n\
    \x20 nirspi dev virtual --listen 127.0.0.1:1550 --scene letter:R\n\
    \x20 nirspi dev virtual --tunnel 127.0.0.1:1551      the firmware in QEMU: boards/mps2-an505")]
pub struct Args {
    /// Address to listen on
    #[arg(long, value_name = "ADDR", default_value = nirspi::devices::DEFAULT_TCP)]
    listen: String,
    #[command(flatten)]
    scene: SceneArgs,
    /// Compute this many frames of each run, then repeat them at full speed (for load tests)
    #[arg(long, value_name = "N")]
    precompute: Option<usize>,
    /// Simulate the FPGA and the light alone, for firmware in an emulator that listens at this address
    #[arg(long, value_name = "ADDR", conflicts_with_all = ["listen", "precompute", "once", "drop_when_full", "real_time"])]
    tunnel: Option<String>,
    /// End when the first host disconnects
    #[arg(long)]
    once: bool,
    /// Drop frames when the host is too slow, as a real camera must. Without this option, simulated time waits for the host
    #[arg(long)]
    drop_when_full: bool,
    /// Let the camera's time run no faster than the clock on the wall: the patterns' clock and --sweeps set the frames a second
    #[arg(long)]
    real_time: bool,
}

pub fn run(args: &Args) -> Result<ExitCode> {
    let (map, optics) = args.scene.optics()?;
    let (name, distance_m, seed) = (map.name, optics.distance_mm() / 1e3, args.scene.seed);
    let scene = format!("{name} at {distance_m} m (simulated), seed {seed}");
    if let Some(address) = &args.tunnel {
        let line = TcpStream::connect(address)
            .with_context(|| format!("--tunnel {address}: no emulator there"))?;
        print::line(format_args!("FPGA behind {address}: {scene}"))?;
        serve_tunnel(line, &mut optics.fpga(seed)?, &AtomicBool::new(true))
            .with_context(|| format!("--tunnel {address}"))?;
        print::line("the emulator disconnected")?;
        return Ok(ExitCode::SUCCESS);
    }
    let listener = TcpListener::bind(&args.listen)
        .with_context(|| format!("--listen {}: cannot listen there", args.listen))?;
    let stop = interrupt::stop_flag();
    let address = listener.local_addr()?;
    print::line(format_args!("virtual camera on tcp:{address}: {scene}"))?;
    if !address.ip().is_loopback() {
        print::warning(format_args!(
            "--listen {}: every machine in this network can use this camera; there is no token",
            args.listen
        ));
    }
    let options = ServeOptions {
        once: args.once,
        drop_when_full: args.drop_when_full,
        real_time: args.real_time,
    };
    let (fpga, depth) = (optics.fpga(seed)?, optics.depth(seed)?);
    let serial = optics.serial(seed);
    match args.precompute {
        Some(frames) => {
            let fpga = PrecomputedFpga::new(fpga, frames);
            run_server(&listener, VirtualCamera::new(fpga, depth, &serial), options, &stop)
        }
        None => run_server(&listener, VirtualCamera::new(fpga, depth, &serial), options, &stop),
    }?;
    print::line("stopped")?;
    Ok(ExitCode::SUCCESS)
}

fn run_server<F: SimulatedFpga>(
    listener: &TcpListener,
    mut camera: VirtualCamera<F>,
    options: ServeOptions,
    stop: &AtomicBool,
) -> Result<()> {
    // The camera goes on even if its log cannot be written.
    let mut tell = |event| print::line(event).unwrap_or_default();
    Ok(serve(listener, &mut camera, options, stop, &mut tell)?)
}
