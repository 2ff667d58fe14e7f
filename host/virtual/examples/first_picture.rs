//! The virtual camera looks at a letter; the picture is reconstructed, enhanced and saved as letter.png.

use nirspi::imaging::{Enhance, ImageContext, White, warnings};
use nirspi::picture::{Panel, SideBySide, Unit};
use nirspi::provenance::{Made, Taken};
use nirspi::scene::SceneSource;
use nirspi::setup::MeasurementSetup;
use nirspi_nets::Device;
use nirspi_recon::Order;
use nirspi_recon::reconstruct::{Method, MethodSettings};
use nirspi_virtual::{CameraModel, VirtualOptics, calibrate_against_white, shoot};
use std::ops::ControlFlow;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let letter = "letter:R".parse::<SceneSource>()?.load(256)?;
    let optics = VirtualOptics::before(CameraModel::paper(), &letter, 300.0)?;
    let settling = calibrate_against_white(&optics, 1)?;
    let half_of_the_patterns = MeasurementSetup::new(&Order::CakeCutting, 0.5)?;
    let go_on = &mut |_: &_| ControlFlow::Continue(());
    let shot = shoot(&optics, half_of_the_patterns, &settling, 244, 1, go_on)?;

    let measurements = shot.measurements()?;
    let method = Method::default().prepare(&MethodSettings::default())?;
    let image = method.reconstruct(&measurements)?.image;

    let networks = Enhance::built_in(&Device::cpu())?;
    let context = ImageContext { rows: Some(measurements.rows()), ..ImageContext::default() };
    let picture = networks.enhance(&image, White::Brightest, &context)?;
    warnings(&picture).iter().for_each(|warning| eprintln!("warning: {warning}"));
    let made = Made::now("first_picture", None, std::env::args());
    let provenance = Taken::by(shot.session.identity()).made(&made);
    let panel = Panel::square("enhanced (simulated)", 64, &picture.pixels, Unit::OfWhite);
    std::fs::write("letter.png", SideBySide::from(panel).png(&provenance))?;
    println!("blur {:.2} px, inconsistency {:.2}", picture.blur_px, picture.inconsistency);
    Ok(())
}
