//! Opens a measurement file or a recording and compares every method on the first 30 % of its patterns.

use nirspi::source::{FirstPatterns, Source, SourceOptions};
use nirspi_nets::prior;
use nirspi_recon::metrics::correlation;
use nirspi_recon::reconstruct::{Method, hadamard};
use std::path::Path;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let file =
        std::env::args().nth(1).ok_or("which file? give a .npz, .mat, .csv or .mcap file")?;
    let source = Source::read(Path::new(&file), &SourceOptions::default())?;
    let all = hadamard(&source.measurements);
    let (used, order) = FirstPatterns::LowestSequencies.take(&source.measurements, 0.3)?;
    println!("{} patterns in the order {order}; correlation with all of them:", used.rows().len());
    for method in Method::ALL {
        let image = match method.prepare(&prior::settings())?.reconstruct(&used) {
            Ok(made) => made.image,
            Err(why) => {
                println!("{:<16} {why}", method.argument());
                continue;
            }
        };
        let side = image.side().pixels();
        let likeness = correlation(all.pixels(), image.pixels(), side, side)?;
        println!("{:<16} {likeness:.3}", method.argument());
    }
    Ok(())
}
