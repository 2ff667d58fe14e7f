//! Makes a release folder, as `nirspi camera update` takes it, from the firmware (`boards/build.sh`) and gateware
//! (`hdl/build.py`) that were built in this checkout: `cargo run --example release_folder -- OUT`.

use nirspi_update::{Source, pack};
use std::path::Path;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let out = std::env::args_os().nth(1).ok_or("usage: release_folder OUT")?;
    let sources = Source::of_checkout(Path::new("."))?;
    for asset in pack(&sources, Path::new(&out))?.files {
        println!("{}  {} {}", asset.sha256, asset.file, asset.version);
    }
    Ok(())
}
