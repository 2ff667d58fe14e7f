//! The figures of table 3: rows, intervals and paired differences.
//!
//! The same scenes are taken at every distance, with rain and without it, and every picture is made of the same readings. So every
//! interval draws scenes, by glyph and by typeface, and a difference is taken scene by scene before it is averaged. The three
//! distances are the paper's and were not drawn: "all" is the mean of the three, whose interval has no part that comes from the
//! distances' being different.

use super::{Judged, PAPER, Paper, Sets, Taken};
use crate::DISTANCES_M;
use crate::bootstrap::{Interval, Redraws};
use crate::error::Result;
use crate::pictures::Picture;
use nirspi_nets::metrics::Judged as Features;
use rayon::prelude::*;
use serde::Serialize;

/// Draws for the interval of a distance of sets: each takes the root of a matrix.
const DISTANCE_DRAWS: usize = 100;

/// The quality of one kind of image at one distance.
#[derive(Debug, Clone, Serialize)]
pub struct Row {
    /// The kind of image.
    pub image: Picture,
    /// `null`: the mean of the three distances; for distances of sets, the pictures of all three in one set.
    pub distance_m: Option<f64>,
    /// After a fit of gain and offset.
    pub psnr_db: Interval,
    /// After the same fit.
    pub ssim: Interval,
    /// The same scenes and noise without rain.
    pub dry_psnr_db: Interval,
    /// As `dry_psnr_db`.
    pub dry_ssim: Interval,
    /// Of a picture with nothing on it: the least that a camera can get.
    pub blank_psnr_db: Interval,
    /// At 64 x 64, on the features of our own classifier: not FID. It grows as the number of scenes falls.
    pub frechet_character_distance: Interval,
    /// With the user's Inception weights.
    pub fid: Option<f64>,
    /// The paper's.
    pub paper_psnr_db: f64,
    /// The paper's.
    pub paper_ssim: f64,
    /// The paper's.
    pub paper_fid: Option<f64>,
}

/// What one kind of image gains over another on the same scenes.
#[derive(Debug, Clone, Serialize)]
pub struct Difference {
    /// The kind of image.
    pub image: Picture,
    /// What is subtracted from it: another kind's name, or `without rain` for the same kind in dry air.
    pub minus: &'static str,
    /// `null`: the mean of the three distances.
    pub distance_m: Option<f64>,
    /// Mean of the scenes' differences.
    pub psnr_db: Interval,
    /// The same of SSIM.
    pub ssim: Interval,
}

/// What a difference is taken from where it is the same kind without rain.
const WITHOUT_RAIN: &str = "without rain";

/// Pairs of kinds whose difference is of interest: the first minus the second.
const PAIRS: [(Picture, Picture); 6] = [
    (Picture::Gan, Picture::NirSpi),
    (Picture::Diffusion, Picture::NirSpi),
    (Picture::Ancestral, Picture::NirSpi),
    (Picture::Diffusion, Picture::Gan),
    (Picture::Ancestral, Picture::Gan),
    (Picture::Ancestral, Picture::Diffusion),
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
    /// Of the scenes of one distance.
    pub redraws: &'a Redraws,
}

impl Statistics<'_> {
    fn scenes(&self) -> usize {
        self.taken.len() / DISTANCES_M.len()
    }

    /// Where the scenes of a distance are, all three if none is named.
    fn distances(distance: Option<usize>) -> std::ops::Range<usize> {
        distance.map_or(0..DISTANCES_M.len(), |at| at..at + 1)
    }

    /// The mean of a figure: of each scene over the distances, then over the scenes.
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
        // A set needs two images; a draw of a few scenes can have fewer.
        let draws = self.redraws.first(DISTANCE_DRAWS);
        let draws: Vec<&Vec<usize>> = draws.iter().filter(|draw| places(draw).len() > 1).collect();
        let drawn = draws.par_iter().map(|draw| of(draw)).collect::<Result<Vec<f64>>>()?;
        let (sharp, made): (Vec<&[f32]>, Vec<&[f32]>) = places(&scenes)
            .iter()
            .map(|&k| (self.taken[k].wet.truth_fine.as_slice(), wet[k].fine.as_slice()))
            .unzip();
        Ok(Row {
            image: *image,
            distance_m: distance.map(|at| DISTANCES_M[at]),
            psnr_db: self.mean(distance, |k| wet[k].quality.psnr_db),
            ssim: self.mean(distance, |k| wet[k].quality.ssim),
            dry_psnr_db: self.mean(distance, |k| dry[k].quality.psnr_db),
            dry_ssim: self.mean(distance, |k| dry[k].quality.ssim),
            blank_psnr_db: self.mean(distance, |k| self.taken[k].blank.psnr_db),
            frechet_character_distance: Redraws::around(of(&scenes)?, drawn),
            fid: self.sets.fid(&sharp, &made)?,
            paper_psnr_db: paper.psnr_db,
            paper_ssim: paper.ssim,
            paper_fid: paper.fid,
        })
    }

    /// What rain costs every kind, and what each kind gains over others.
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
