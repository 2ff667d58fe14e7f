//! The virtual camera looks at a letter; the picture is reconstructed, enhanced and saved as letter.png.

use nirspi_virtual::Look;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let picture = Look::paper().at("letter:R")?.capture()?.picture()?;
    picture.warnings.iter().for_each(|warning| eprintln!("warning: {warning}"));
    std::fs::write("letter.png", picture.png())?;
    Ok(())
}
