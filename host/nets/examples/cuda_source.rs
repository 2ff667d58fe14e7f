//! The CUDA source of every kernel of the shipped networks and of orthogonal matching pursuit,
//! without a GPU: one file for each variant of each kernel, in a folder for each kind of GPU.
//!
//! `cargo run -p nirspi-nets --features gpu,nirspi-gpu/source --example cuda_source -- FOLDER [CAPABILITY...]`
//!
//! `CAPABILITY` is a compute capability without its point, such as 90 for an H100.
//! `host/gpu/scripts/cuda_source.py` runs this example and compiles the files.

use std::error::Error;
use std::fs;
use std::path::PathBuf;

use nalgebra::DMatrix;
use nirspi_gpu::card::Card;
use nirspi_gpu::source::written;
use nirspi_nets::consistency::MeasuredRows;
use nirspi_nets::enhance::{DeviceEnhancer, Options};
use nirspi_nets::fusion::{self, DepthMaps};
use nirspi_nets::weights::Weights;
use nirspi_nets::{Arithmetic, Device};
use nirspi_recon::omp::gpu::{self, DeviceDictionary, DeviceImages, path_over};
use nirspi_recon::omp::{DenseDictionary, Limits};

/// Number of pixels of an image, and of atoms.
const AREA: usize = fusion::SIDE * fusion::SIDE;

/// Numbers of images: kernels for few images differ from those for many.
const FRAMES: [usize; 2] = [1, 256];

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let folder =
        PathBuf::from(arguments.next().ok_or("no folder, expected FOLDER [CAPABILITY...]")?);
    let mut cards = Vec::new();
    for capability in arguments {
        cards.push(Card { capability: capability.parse()? });
    }
    if cards.is_empty() {
        cards.push(Card::HOPPER);
    }
    for card in cards {
        pursue(card)?;
        for arithmetic in [Arithmetic::F32, Arithmetic::F16] {
            enhance(card, arithmetic)?;
        }
        let sources = written(card).map_err(|refused| {
            refused.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")
        })?;
        let folder = folder.join(card.to_string());
        fs::create_dir_all(&folder)?;
        for source in &sources {
            fs::write(folder.join(format!("{}.cu", source.name)), source.to_string())?;
        }
        println!("{}: {} kernels", folder.display(), sources.len());
    }
    Ok(())
}

/// Both ends of a pipeline: images of OMP in the pixels' basis and in another, and paths.
fn pursue(card: Card) -> Result<(), Box<dyn Error>> {
    let device = gpu::Device::of(&card.into());
    for (measurements, sparsity) in [(AREA, 64), (AREA / 2, 64)] {
        let matrix = DMatrix::from_fn(measurements, AREA, |row, column| {
            1.0 - 2.0 * f64::from((row & column).count_ones() % 2)
        });
        let limits = Limits::atoms(sparsity);
        let dictionary = DeviceDictionary::new(&device, matrix.clone(), true)?;
        for frames in FRAMES {
            let y = vec![1.0; frames * measurements];
            let solutions = dictionary.pursue(&limits, &dictionary.upload(&y)?)?;
            let pictures = dictionary.upload_pictures(&vec![0.0; AREA * AREA], AREA)?;
            dictionary.images(&solutions, Some(&pictures))?;
            dictionary.images(&solutions, None)?;
            dictionary.download_with_doubts(&solutions)?;
        }
        let dictionary = DenseDictionary::<f32>::new(&matrix.map(|v| v as f32));
        path_over(&device, &dictionary, &limits, &vec![1.0; measurements])?;
    }
    Ok(())
}

/// The networks, with and without depth maps and agreement with the readings of all and of half of
/// the patterns.
fn enhance(card: Card, arithmetic: Arithmetic) -> Result<(), Box<dyn Error>> {
    let device = Device::on(card.into()).with_arithmetic(arithmetic);
    let [fsrcnn, estimator, bridge] = ["fsrcnn", "estimator", "diffusion"].map(Weights::embedded);
    let there = DeviceEnhancer::new(&device, &fsrcnn?, &estimator?, &bridge?)?;
    let half: Vec<u32> = (0..AREA as u32 / 2).collect();
    for frames in FRAMES {
        let omp = gpu::Device::of(&card.into());
        let images = DeviceImages::upload(&omp, &vec![0.5; frames * AREA], AREA)?;
        let depth = DepthMaps::new(vec![0.5; 64], [1, 8, 8], frames)?;
        for measured in [MeasuredRows::All, MeasuredRows::new(fusion::SIDE, &half)?] {
            let options = Options { measured, ..Options::default() };
            there.enhance(&images, 1.0, None, &options, &mut |_| {})?;
        }
        let options = Options { consistency: false, ..Options::default() };
        there.enhance(&images, 1.0, Some(&depth), &options, &mut |_| {})?;
    }
    for note in device.notes() {
        println!("{card}: {note}");
    }
    Ok(())
}
