//! FSRCNN (Dong, Loy, Tang, ECCV 2016) with the depth map as second input, on the CPU.

use pulp::Arch;

use super::conv::Conv;
use super::layers::{conv, keeping, prelu, slopes};
use super::planes::Planes;
use crate::filter::Filter;
use crate::schema;
use crate::weights::{Weights, WeightsError};

/// The network, with weights in the order of the loops.
#[derive(Debug, Clone)]
pub struct Fsrcnn {
    arch: Arch,
    /// Convolutions, each with the slopes of the PReLU after it.
    layers: Vec<(Conv, Vec<f32>)>,
    /// The transposed convolution as a convolution with four outputs, one for each place in a block
    /// of 2 x 2.
    deconv: Conv,
}

impl Fsrcnn {
    /// The network with these weights.
    ///
    /// # Errors
    /// [`WeightsError`] if a tensor is missing, of another shape, not finite, or unknown.
    pub fn new(weights: &Weights) -> Result<Self, WeightsError> {
        let [_, _, maps] = schema::fsrcnn(weights)?;
        let names = ["feature".to_owned(), "shrink".to_owned()]
            .into_iter()
            .map(|name| (format!("{name}_act"), name))
            .chain((0..maps).map(|i| (format!("map_act.{i}"), format!("map.{i}"))))
            .chain([("expand_act".to_owned(), "expand".to_owned())]);
        let layers = names
            .map(|(act, name)| {
                let conv = conv(weights, &name)?;
                let slopes = slopes(weights, &act, conv.outputs())?;
                Ok((conv, slopes))
            })
            .collect::<Result<Vec<_>, WeightsError>>()?;
        let deconv = keeping(&Filter::transposed(weights, "deconv")?);
        Ok(Self { arch: Arch::new(), layers, deconv })
    }

    /// The image of twice the size, not clamped. `input` holds intensity, depth and validity, each
    /// `height` x `width`.
    pub fn forward(&self, input: &[f32], (height, width): (usize, usize)) -> Vec<f32> {
        let mut h = Planes::new(CHANNELS, height, width, 2);
        for channel in 0..CHANNELS {
            for row in 0..height {
                let start = (channel * height + row) * width;
                h.row_mut(channel, row).copy_from_slice(&input[start..start + width]);
            }
        }
        for (conv, slopes) in &self.layers {
            h = conv.apply(self.arch, &h);
            prelu(self.arch, &mut h, slopes);
        }
        let mut out = self.deconv.apply(self.arch, &h).shuffle(0).pixels();
        for (row, line) in out.chunks_exact_mut(2 * width).enumerate() {
            for (column, value) in line.iter_mut().enumerate() {
                *value += input[row / 2 * width + column / 2];
            }
        }
        out
    }
}

/// Input channels: intensity, depth, validity.
const CHANNELS: usize = 3;
