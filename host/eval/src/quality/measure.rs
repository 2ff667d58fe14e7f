//! The figures of a method under a condition.

use super::characters::{Character, Characters};
use super::condition::{Condition, READINGS, SIDE};
use super::contenders::Method;
use crate::bootstrap::{DRAWS, Interval, Redraws};
use crate::error::Result;
use nirspi_nets::Networks;
use nirspi_nets::consistency::Consistency;
use nirspi_nets::images::Images;
use nirspi_nets::metrics::{CharacterJudge, Judged};
use nirspi_recon::metrics;
use serde::Serialize;
use std::fmt;

/// Number of draws for the interval of a distance: each draw takes the roots of a matrix.
const DISTANCE_DRAWS: usize = 100;

/// The figures of a method under a condition.
#[derive(Debug, Clone, Serialize)]
pub struct Figures {
    /// The method's name.
    pub row: String,
    /// The method.
    #[serde(skip)]
    pub method: Method,
    /// The degradation of the images.
    #[serde(flatten)]
    pub condition: Condition,
    /// The stack; `null` means images of all stacks.
    pub stack: Option<String>,
    /// Number of images of the figures.
    pub images: usize,
    /// PSNR, mean over the images; 60 dB for equal images. Intervals draw font families, writers
    /// and photographs again.
    pub psnr_db: Interval,
    /// SSIM, mean over the images.
    pub ssim: Interval,
    /// Difference to the GAN's PSNR, mean over the images; `null` for the GAN and for rows without
    /// a network that deblurs.
    pub psnr_minus_gan_db: Option<Interval>,
    /// Difference to the GAN's SSIM, mean over the images.
    pub ssim_minus_gan: Option<Interval>,
    /// Fréchet distance on the features of nirspi's own classifier, which is not FID.
    pub frechet_character_distance: Interval,
    /// Share of the labelled characters that nirspi's classifier recognises.
    pub character_accuracy: Option<f64>,
    /// Distance of the readings from the readings of the images, divided by the noise: near 1 they
    /// agree. `null` without noise.
    pub inconsistency: Option<Interval>,
}

impl fmt::Display for Figures {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Interval { value, low, high } = self.psnr_db;
        let (ssim, distance) = (self.ssim.value, self.frechet_character_distance.value);
        write!(
            f,
            "  {:<22} {value:5.2} [{low:5.2}, {high:5.2}]  {ssim:.3}  {distance:7.2}",
            self.row
        )?;
        if let Some(accuracy) = self.character_accuracy {
            write!(f, "  {accuracy:.2}")?;
        }
        if let Some(difference) = self.psnr_minus_gan_db {
            write!(f, "  minus GAN {} dB", difference.text(2))?;
        }
        write!(f, "  ({} images)", self.images)
    }
}

/// The judge of characters.
pub struct Judges {
    characters: CharacterJudge,
}

/// One image's figures.
pub struct One {
    psnr_db: f64,
    ssim: f64,
    inconsistency: f64,
}

impl Judges {
    pub fn new(networks: &mut Networks) -> Result<Self> {
        Ok(Self { characters: CharacterJudge::new(&networks.weights("classifier")?)? })
    }

    /// The classifier's result for images (N, 64, 64).
    pub fn judge(&self, images: &[f32]) -> Result<Judged> {
        Ok(self.characters.judge(Images::new(images)?))
    }

    /// The figures of each image that a method made from readings.
    pub fn each(
        condition: Condition,
        characters: &Characters,
        readings: &[f32],
        images: &[f32],
    ) -> Result<Vec<One>> {
        characters
            .iter()
            .zip(images.chunks_exact(SIDE * SIDE))
            .zip(readings.chunks_exact(READINGS * READINGS))
            .map(|((character, image), readings)| one(character, condition, readings, image))
            .collect()
    }

    /// The figures of a method under a condition, for all stacks together and for each stack.
    pub fn figures(
        &self,
        (method, condition): (Method, Condition),
        characters: &Characters,
        (sharp, judged): (&Judged, &Judged),
        each: &[One],
        gan: Option<&[One]>,
    ) -> Result<Vec<Figures>> {
        let compared = gan.filter(|_| method.steps().is_some() || method == Method::Regression);
        let of = |stack: Option<usize>| -> Result<Figures> {
            let taken = |c: &Character| stack.is_none_or(|stack| stack == c.stack);
            let (places, groups): (Vec<usize>, Vec<(usize, u32)>) = characters
                .iter()
                .enumerate()
                .filter(|(_, c)| taken(c))
                .map(|(at, c)| (at, (c.stack, c.group)))
                .unzip();
            let redraws = Redraws::clustered(&groups, DRAWS);
            let mean = |of: &dyn Fn(usize) -> f64| {
                redraws.of_mean(&places.iter().map(|&at| of(at)).collect::<Vec<f64>>())
            };
            let distance = |picked: &[usize]| {
                let picked: Vec<usize> = picked.iter().map(|&k| places[k]).collect();
                self.characters.distance(&self.some(sharp, &picked), &self.some(judged, &picked))
            };
            let whole: Vec<usize> = (0..places.len()).collect();
            let labels: Vec<(u8, u8)> = places
                .iter()
                .filter_map(|&at| characters.iter().nth(at)?.label.map(|l| (l, judged.classes[at])))
                .collect();
            let right = labels.iter().filter(|(label, seen)| label == seen).count();
            let drawn = redraws.first(DISTANCE_DRAWS);
            let drawn =
                drawn.iter().map(|picked| distance(picked)).collect::<Result<Vec<f64>, _>>()?;
            Ok(Figures {
                row: method.name(),
                method,
                condition,
                stack: stack.map(|stack| characters.origins()[stack].stack.clone()),
                images: places.len(),
                psnr_db: mean(&|at| each[at].psnr_db),
                ssim: mean(&|at| each[at].ssim),
                psnr_minus_gan_db: compared
                    .map(|gan| mean(&|at| each[at].psnr_db - gan[at].psnr_db)),
                ssim_minus_gan: compared.map(|gan| mean(&|at| each[at].ssim - gan[at].ssim)),
                frechet_character_distance: Redraws::around(distance(&whole)?, drawn),
                character_accuracy: (!labels.is_empty())
                    .then(|| right as f64 / labels.len() as f64),
                inconsistency: (condition.noise > 0.0).then(|| mean(&|at| each[at].inconsistency)),
            })
        };
        let stacks = (0..characters.origins().len()).map(Some);
        std::iter::once(None).chain(stacks).map(of).collect()
    }

    /// The features of some images.
    fn some(&self, judged: &Judged, places: &[usize]) -> Judged {
        let features = self.characters.features();
        let row = |&at: &usize| judged.features[at * features..][..features].iter().copied();
        Judged { features: places.iter().flat_map(row).collect(), ..Judged::default() }
    }
}

fn one(
    character: &Character,
    condition: Condition,
    readings: &[f32],
    image: &[f32],
) -> Result<One> {
    let sharp = &character.sharp;
    let camera = Consistency::new(READINGS, condition.sigma_px, condition.noise);
    Ok(One {
        // Two equal images have an infinite PSNR, which would make every mean infinite.
        psnr_db: metrics::psnr(sharp, image, SIDE, SIDE, 1.0)?.min(MOST_PSNR_DB),
        ssim: metrics::ssim(sharp, image, SIDE, SIDE, 1.0)?,
        inconsistency: f64::from(camera.residual_ratio(readings, image)),
    })
}

/// The PSNR of an error of a thousandth in every pixel.
const MOST_PSNR_DB: f64 = 60.0;
