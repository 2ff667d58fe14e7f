//! `nirspi reconstruct --enhance`: the learned stages on an image whose scale nobody told, as [`nirspi::white`] finds it.

use super::super::report::StageTimes;
use anyhow::{Result, bail};
use nirspi::white::brightest;
use nirspi_nets::{
    Device, Enhanced, Enhancer, Images, MeasuredRows, Method, Networks, Options, Sharpener, deblur,
    fusion,
};
use nirspi_recon::Image;
use serde::Serialize;
use std::num::NonZeroU32;

/// What came of it.
#[derive(Debug, Serialize)]
pub struct Report {
    /// The image's value that was taken for white.
    white: f32,
    /// Blur in pixels of the 64 x 64 grid, as estimated.
    sigma_px: f32,
    /// Noise of a pixel, white being 1, as estimated.
    noise: f32,
    /// Distance of the image from that of the result, over its noise.
    inconsistency: f32,
}

impl Report {
    /// One line for people.
    pub fn line(&self) -> String {
        format!(
            "enhanced: blur {:.2} px, noise {:.4}, inconsistency {:.2}; white is {:.4} of the image's units",
            self.sigma_px, self.noise, self.inconsistency, self.white
        )
    }
}

/// Enhances images of 32 x 32 or 64 x 64, each with the Hadamard rows that it was made from: 64 x 64 pixels in [0, 1]
/// each. White is the same for all, so that a video does not flicker: the median of what each would take for it.
pub fn run(frames: &[(&Image, &[u32])], times: &mut StageTimes) -> Result<(Vec<f32>, Vec<Report>)> {
    let Some((first, _)) = frames.first() else { bail!("--enhance: no image") };
    let side = first.side().pixels();
    if side != fusion::SIDE && side != deblur::SIDE {
        bail!("--enhance is for images of 32 x 32 or 64 x 64 pixels, this one has {side} x {side}");
    }
    let mut whites: Vec<f32> = frames.iter().map(|(f, _)| brightest(f.pixels(), side)).collect();
    whites.sort_by(f32::total_cmp);
    let white = whites[whites.len() / 2];
    if white <= 0.0 {
        bail!("--enhance finds no light in the image");
    }
    let mut networks = Networks::built_in(Device::cpu());
    let method = Method::Diffusion { steps: NonZeroU32::MIN };
    let stages = match side {
        deblur::SIDE => Stages::Second(networks.sharpener(method)?),
        _ => Stages::Both(networks.enhancer(method)?),
    };
    let (mut pixels, mut reports) = (Vec::new(), Vec::new());
    times.time("enhance", || -> Result<()> {
        for (image, rows) in frames {
            let scaled = image.pixels().iter().map(|v| (v / white).clamp(0.0, 1.0));
            let mut result = stages.run(&scaled.collect::<Vec<_>>(), side, rows)?;
            pixels.append(&mut result.images);
            reports.push(Report {
                white,
                sigma_px: result.estimates[0].sigma_px,
                noise: result.estimates[0].noise,
                inconsistency: result.inconsistency[0],
            });
        }
        Ok(())
    })?;
    Ok((pixels, reports))
}

/// What is 64 x 64 already needs no fusion.
enum Stages {
    Both(Enhancer),
    Second(Sharpener),
}

impl Stages {
    fn run(&self, image: &[f32], side: usize, rows: &[u32]) -> Result<Enhanced> {
        let measured = MeasuredRows::new(side, rows)?;
        let options = Options { measured, ..Options::default() };
        Ok(match self {
            Self::Both(both) => both.enhance(Images::new(image)?, None, &options, &mut |_| {})?,
            Self::Second(second) => second.deblur(Images::new(image)?, &options, &mut |_| {})?,
        })
    }
}
