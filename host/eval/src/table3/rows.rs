//! The figures of table 3: rows, intervals and paired differences.
//!
//! The same scenes are taken at every distance, with rain and without, and every picture is made
//! from the same readings. Every interval therefore draws scenes, by glyph and by typeface, and a
//! difference is taken scene by scene before it is averaged. The three distances are the paper's
//! and were not drawn. "all" is the mean of the three distances, whose interval does not include
//! the differences between the distances.

use super::{Judged, PAPER, Paper, Sets, Taken};
use crate::DISTANCES_M;
use crate::bootstrap::{Interval, Redraws};
use crate::error::Result;
use crate::pictures::Picture;
use nirspi_nets::metrics::Judged as Features;
use rayon::prelude::*;
use serde::Serialize;

/// Number of draws for the interval of a distance of sets: each draw takes the root of a matrix.
const DISTANCE_DRAWS: usize = 100;

/// The quality of one kind of image at one distance.
#[derive(Debug, Clone, Serialize)]
pub struct Row {
    /// The kind of image.
    pub image: Picture,
    /// The distance; `null` means the mean of the three distances, or for distances of sets the
    /// pictures of all three distances in one set.
    pub distance_m: Option<f64>,
    /// PSNR after a fit of gain and offset.
    pub psnr_db: Interval,
    /// SSIM after the same fit.
    pub ssim: Interval,
    /// Correlation with the scene: 0 for a blank picture.
    pub correlation: Interval,
    /// PSNR of the same scenes and noise without rain.
    pub dry_psnr_db: Interval,
    /// SSIM of the same scenes and noise without rain.
    pub dry_ssim: Interval,
    /// PSNR of an empty picture: the lowest value of a camera.
    pub blank_psnr_db: Interval,
    /// Whether the image scores as a blank picture does, within half a decibel.
    pub no_measurable_image: bool,
    /// Fréchet distance at 64 x 64 on the features of nirspi's classifier, which is not FID. The
    /// distance grows with fewer scenes.
    pub frechet_character_distance: Interval,
    /// The paper's PSNR.
    pub paper_psnr_db: f64,
    /// The paper's SSIM.
    pub paper_ssim: f64,
    /// The paper's FID.
    pub paper_fid: Option<f64>,
}

/// The difference between two kinds of image of the same scenes.
#[derive(Debug, Clone, Serialize)]
pub struct Difference {
    /// The kind of image.
    pub image: Picture,
    /// The subtracted kind: another kind's name, or `without rain` for the same kind in dry air.
    pub minus: &'static str,
    /// The distance; `null` means the mean of the three distances.
    pub distance_m: Option<f64>,
    /// Mean of the scenes' differences of PSNR.
    pub psnr_db: Interval,
    /// Mean of the scenes' differences of SSIM.
    pub ssim: Interval,
}

/// An image that scores less than this over a blank picture shows nothing of the scene. After the fit of gain and offset no
/// image scores below a blank one: the difference is `-10 lg(1 - r^2)`, and half a decibel is a correlation of a third.
const LEAST_OVER_BLANK_DB: f64 = 0.5;

/// The name of the subtracted kind, if it is the same kind without rain.
const WITHOUT_RAIN: &str = "without rain";

/// Pairs of kinds of interest: the first minus the second.
const PAIRS: [(Picture, Picture); 7] = [
    (Picture::Gan, Picture::NirSpi),
    (Picture::Regression, Picture::NirSpi),
    (Picture::Diffusion, Picture::NirSpi),
    (Picture::Ancestral, Picture::NirSpi),
    (Picture::Regression, Picture::Gan),
    (Picture::Ancestral, Picture::Gan),
    (Picture::Ancestral, Picture::Regression),
];

/// One kind of image of every scene, distance after distance.
pub struct Measured {
    pub image: Picture,
    pub wet: Vec<Judged>,
    pub dry: Vec<Judged>,
}

/// All figures.
pub struct Statistics<'a> {
    pub taken: &'a [Taken],
    pub measured: &'a [Measured],
    pub sets: &'a Sets,
    /// Draws of the scenes of one distance.
    pub redraws: &'a Redraws,
}

impl Statistics<'_> {
    fn scenes(&self) -> usize {
        self.taken.len() / DISTANCES_M.len()
    }

    /// The indices of a distance; all three without a distance.
    fn distances(distance: Option<usize>) -> std::ops::Range<usize> {
        distance.map_or(0..DISTANCES_M.len(), |at| at..at + 1)
    }

    /// The mean of a figure: over the distances for each scene, then over the scenes.
    fn mean(&self, distance: Option<usize>, of: impl Fn(usize) -> f64) -> Interval {
        let at = Self::distances(distance);
        let each = |scene: usize| {
            at.clone().map(|d| of(d * self.scenes() + scene)).sum::<f64>() / at.len() as f64
        };
        self.redraws.of_mean(&(0..self.scenes()).map(each).collect::<Vec<f64>>())
    }

    /// Rows of every kind at each distance and at all.
    pub fn rows(&self) -> Result<Vec<Row>> {
        let fine = |place: &usize| self.taken[*place].wet.truth_fine.as_slice();
        let all: Vec<usize> = (0..self.taken.len()).collect();
        let truth = self.sets.features(&all.iter().map(fine).collect::<Vec<_>>())?;
        let mut rows = Vec::new();
        for measured in self.measured {
            let Some(paper) = PAPER.iter().find(|paper| paper.image == measured.image) else {
                continue;
            };
            let found: Vec<&[f32]> = measured.wet.iter().map(|one| one.fine.as_slice()).collect();
            let found = self.sets.features(&found)?;
            for distance in (0..DISTANCES_M.len()).map(Some).chain([None]) {
                rows.push(self.row(paper, measured, distance, (&truth, &found))?);
            }
        }
        Ok(rows)
    }

    fn row(
        &self,
        paper: &Paper,
        measured: &Measured,
        distance: Option<usize>,
        (truth, found): (&Features, &Features),
    ) -> Result<Row> {
        let Measured { image, wet, dry } = measured;
        let places = |scenes: &[usize]| -> Vec<usize> {
            let at = Self::distances(distance);
            at.flat_map(|d| scenes.iter().map(move |scene| d * self.scenes() + scene)).collect()
        };
        let of = |scenes: &[usize]| self.sets.character_distance(truth, found, &places(scenes));
        let scenes: Vec<usize> = (0..self.scenes()).collect();
        // A set needs two images, and a draw of a few scenes may have fewer.
        let draws = self.redraws.first(DISTANCE_DRAWS);
        let draws: Vec<&Vec<usize>> = draws.iter().filter(|draw| places(draw).len() > 1).collect();
        let drawn = draws.par_iter().map(|draw| of(draw)).collect::<Result<Vec<f64>>>()?;
        let psnr_db = self.mean(distance, |k| wet[k].quality.psnr_db);
        let blank_psnr_db = self.mean(distance, |k| self.taken[k].blank.psnr_db);
        Ok(Row {
            image: *image,
            distance_m: distance.map(|at| DISTANCES_M[at]),
            no_measurable_image: psnr_db.value < blank_psnr_db.value + LEAST_OVER_BLANK_DB,
            psnr_db,
            ssim: self.mean(distance, |k| wet[k].quality.ssim),
            correlation: self.mean(distance, |k| wet[k].quality.correlation),
            dry_psnr_db: self.mean(distance, |k| dry[k].quality.psnr_db),
            dry_ssim: self.mean(distance, |k| dry[k].quality.ssim),
            blank_psnr_db,
            frechet_character_distance: Redraws::around(of(&scenes)?, drawn),
            paper_psnr_db: paper.psnr_db,
            paper_ssim: paper.ssim,
            paper_fid: paper.fid,
        })
    }

    /// The difference by rain of every kind, and the differences between kinds.
    pub fn differences(&self) -> Vec<Difference> {
        let of = |image| self.measured.iter().find(|measured| measured.image == image);
        let rain = self.measured.iter().map(|m| (m.image, WITHOUT_RAIN, &m.wet, &m.dry));
        let kinds = PAIRS
            .iter()
            .filter_map(|&(more, less)| Some((more, less.name(), &of(more)?.wet, &of(less)?.wet)));
        rain.chain(kinds)
            .flat_map(|(image, minus, more, less)| {
                let distances = (0..DISTANCES_M.len()).map(Some).chain([None]);
                distances.map(move |distance| Difference {
                    image,
                    minus,
                    distance_m: distance.map(|at| DISTANCES_M[at]),
                    psnr_db: self
                        .mean(distance, |k| more[k].quality.psnr_db - less[k].quality.psnr_db),
                    ssim: self.mean(distance, |k| more[k].quality.ssim - less[k].quality.ssim),
                })
            })
            .collect()
    }
}
