//! How far the image of the fused rows is believed, against the image of the frame alone.
//!
//! The rows of a recursive estimate have the errors of old readings: a scene that turned, or detail
//! between the pixels of a motion. A method that was made for white noise takes such errors for the
//! scene. The readings of the next frame are new, so their noise is that of neither image. They
//! judge both images of the frame before, moved as the scene has moved: the place between the two
//! images that predicts the readings best, less one standard error, is the share of the fused image
//! in the next one.
//!
//! # Invariant
//! Without readings that judge, the image is that of the frame alone
//! (`recursive::tests::a_past_that_misleads_a_method_is_not_believed_and_one_that_helps_is`).

use super::Past;
use crate::reconstruct::selection::Line;
use crate::{Image, Measurements, fwht};
use std::collections::VecDeque;

/// Number of frames whose readings judge.
const FRAMES: usize = 6;

/// The two images of the last frame, and what the readings of the frames after each pair have said.
#[derive(Debug, Clone, Default)]
pub(super) struct Belief {
    last: Option<Images>,
    lines: VecDeque<Line>,
}

/// Every row of two images, in the measurements' units.
#[derive(Debug, Clone)]
struct Images {
    alone: Vec<f32>,
    fused: Vec<f32>,
}

impl Belief {
    /// Takes the readings of a frame that has been added to the past.
    pub fn judge(&mut self, past: &Past, frame: &Measurements) {
        let Some(Images { alone, fused }) = &self.last else { return };
        let operator = past.spectrum.shift(past.shift);
        let (alone, fused) = (operator.apply(alone), operator.apply(fused));
        let mut line = Line::default();
        // The mean of the image says nothing about its detail.
        let readings = frame.rows().iter().zip(frame.values()).filter(|(row, _)| **row != 0);
        for (&row, &value) in readings {
            let row = row as usize;
            line.add(f64::from(fused[row] - alone[row]), value - f64::from(alone[row]));
        }
        self.lines.truncate(FRAMES - 1);
        self.lines.push_front(line);
    }

    /// The share of the fused image, 0 to 1.
    pub fn share(&self) -> f64 {
        self.lines.iter().fold(Line::default(), |all, line| all.and(*line)).least_trust(1.0)
    }

    /// Takes the images of the same frame.
    pub fn remember(&mut self, alone: &Image, fused: &Image) {
        let rows = |image: &Image| {
            let mut rows = image.pixels().to_vec();
            fwht::transform(&mut rows);
            rows
        };
        self.last = Some(Images { alone: rows(alone), fused: rows(fused) });
    }
}
