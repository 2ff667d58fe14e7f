//! Inception-v3 up to its last pooling, for FID, with the user's weights.
//!
//! This is the network of Szegedy et al. (CVPR 2016) in the form of FID's definition (Heusel et
//! al., NIPS 2017; in PyTorch Seitzer's pytorch-fid): means without the padding, and a maximum in
//! the last block's pooling. The weights are a file of 90 MB and are not shipped.
//!
//! Tensors have torchvision's names and shapes, and are all checked before use
//! (`tests::weights_of_another_network_and_odd_images_are_refused`). Other tensors of the file (the
//! classifier, auxiliary outputs) are ignored.

mod plan;

use crate::weights::{Weights, WeightsError};
use burn::backend::Flex;
use burn::tensor::activation::relu;
use burn::tensor::module::{avg_pool2d, conv2d, max_pool2d};
use burn::tensor::ops::ConvOptions;
use burn::tensor::{Tensor, TensorData};
use plan::Plan;
use thiserror::Error;

/// Number of features of an image: the channels after the last block.
pub const FEATURES: usize = 2048;

/// Number of classes of the published weights that define FID.
pub const FID_CLASSES: usize = 1008;

/// Side of the images that the network expects, in pixels.
const EDGE_PX: usize = 299;

/// Added to the variance in batch normalisation.
const EPSILON: f32 = 1e-3;

/// Error: the values are not an image of this size.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("an image of {found} values, expected {height} x {width}, at least one pixel")]
pub struct ImageSize {
    /// Number of values.
    pub found: usize,
    /// Rows of the image.
    pub height: usize,
    /// Columns of the image.
    pub width: usize,
}

/// The network with its weights, on the CPU.
#[derive(Debug, Clone)]
pub struct Inception {
    layers: Vec<Layer>,
    classes: Option<usize>,
}

#[derive(Debug, Clone)]
enum Layer {
    /// A convolution followed by ReLU.
    Convolution(Box<Convolution>),
    /// Mean of 3 x 3 pixels; keeps the size.
    Mean,
    /// Maximum of 3 x 3 pixels.
    Maximum { stride: usize, padding: usize },
    /// Branches with one input, whose output channels are concatenated.
    Branches(Vec<Vec<Layer>>),
}

/// Kernel and bias, with the batch normalisation folded in.
#[derive(Debug, Clone)]
struct Convolution {
    weight: Tensor<Flex, 4>,
    bias: Tensor<Flex, 1>,
    options: ConvOptions<2>,
}

impl Inception {
    /// The network with these weights.
    ///
    /// # Errors
    /// [`WeightsError`] if a tensor is missing or has another shape.
    pub fn new(weights: &Weights) -> Result<Self, WeightsError> {
        let (layers, _) = build(&plan::network(), "", 3, weights)?;
        let classes = weights.shape::<2>("fc.weight").ok().map(|[classes, _]| classes);
        Ok(Self { layers, classes })
    }

    /// Whether the weights have as many classes as those that define FID.
    #[must_use]
    pub fn is_of_fid(&self) -> bool {
        self.classes == Some(FID_CLASSES)
    }

    /// The [`FEATURES`] features of a grey image of `height` x `width` pixels in [0, 1], row-major,
    /// enlarged to 299 x 299.
    ///
    /// # Errors
    /// [`ImageSize`] if the values are not such an image.
    pub fn features(
        &self,
        image: &[f32],
        (height, width): (usize, usize),
    ) -> Result<Vec<f32>, ImageSize> {
        if image.is_empty() || height.checked_mul(width) != Some(image.len()) {
            return Err(ImageSize { found: image.len(), height, width });
        }
        let grey: Vec<f32> =
            enlarged(image, height, width).iter().map(|pixel| 2.0 * pixel - 1.0).collect();
        let data = TensorData::new(grey, [1, 1, EDGE_PX, EDGE_PX]);
        let image = Tensor::<Flex, 4>::from_data(data, &Default::default()).repeat_dim(1, 3);
        let last = forward(&self.layers, image);
        let [_, channels, rows, columns] = last.dims();
        let mean = last.reshape([channels, rows * columns]).mean_dim(1);
        Ok(mean.into_data().iter::<f32>().collect())
    }
}

fn forward(layers: &[Layer], image: Tensor<Flex, 4>) -> Tensor<Flex, 4> {
    layers.iter().fold(image, |x, layer| match layer {
        Layer::Convolution(conv) => {
            let Convolution { weight, bias, options } = &**conv;
            relu(conv2d(x, weight.clone(), Some(bias.clone()), options.clone()))
        }
        Layer::Mean => avg_pool2d(x, [3, 3], [1, 1], [1, 1], false, false),
        Layer::Maximum { stride, padding } => {
            max_pool2d(x, [3, 3], [*stride; 2], [*padding; 2], [1, 1], false)
        }
        Layer::Branches(branches) => {
            let ends = branches.iter().map(|branch| forward(branch, x.clone())).collect();
            Tensor::cat(ends, 1)
        }
    })
}

/// Layers of the plan for an input with `channels`, and the number of output channels.
fn build(
    plans: &[Plan],
    block: &str,
    mut channels: usize,
    weights: &Weights,
) -> Result<(Vec<Layer>, usize), WeightsError> {
    let device = Default::default();
    let mut layers = Vec::with_capacity(plans.len());
    for plan in plans {
        layers.push(match plan {
            Plan::Convolution { name, outputs, kernel, stride, padding } => {
                let name = format!("{block}{name}");
                let shape = [*outputs, channels, kernel[0], kernel[1]];
                channels = *outputs;
                let (weight, bias) = folded(weights, &name, shape)?;
                Layer::Convolution(Box::new(Convolution {
                    weight: Tensor::from_data(TensorData::new(weight, shape), &device),
                    bias: Tensor::from_data(TensorData::new(bias, [channels]), &device),
                    options: ConvOptions::new([*stride; 2], *padding, [1, 1], 1),
                }))
            }
            Plan::Mean => Layer::Mean,
            Plan::Maximum { stride, padding } => {
                Layer::Maximum { stride: *stride, padding: *padding }
            }
            Plan::Branches { name, branches } => {
                let name = format!("{block}{name}");
                let built = branches
                    .iter()
                    .map(|branch| build(branch, &name, channels, weights))
                    .collect::<Result<Vec<_>, _>>()?;
                channels = built.iter().map(|(_, outputs)| outputs).sum();
                Layer::Branches(built.into_iter().map(|(layers, _)| layers).collect())
            }
        });
    }
    Ok((layers, channels))
}

/// Kernel and bias of a convolution, with the batch normalisation applied once to the kernel
/// instead of to every output.
fn folded(
    weights: &Weights,
    name: &str,
    shape: [usize; 4],
) -> Result<(Vec<f32>, Vec<f32>), WeightsError> {
    let outputs = shape[0];
    let of = |what: &str| -> Result<&[f32], WeightsError> {
        Ok(&weights.tensor(&format!("{name}.bn.{what}"), &[outputs])?.values)
    };
    let (gain, shift) = (of("weight")?, of("bias")?);
    let (mean, variance) = (of("running_mean")?, of("running_var")?);
    let kernel = &weights.tensor(&format!("{name}.conv.weight"), &shape)?.values;
    let scale: Vec<f32> =
        gain.iter().zip(variance).map(|(gain, v)| gain / (v + EPSILON).sqrt()).collect();
    let inner = shape[1..].iter().product();
    let scaled =
        kernel.chunks_exact(inner).zip(&scale).flat_map(|(k, s)| k.iter().map(move |v| v * s));
    let bias = shift.iter().zip(mean).zip(&scale).map(|((shift, mean), s)| shift - mean * s);
    Ok((scaled.collect(), bias.collect()))
}

/// The image at 299 x 299 by bilinear interpolation with aligned pixel centres, as
/// `F.interpolate(align_corners=False)` does.
fn enlarged(image: &[f32], height: usize, width: usize) -> Vec<f32> {
    // The two neighbouring pixels, and the share of the second.
    let beside = |at: usize, length: usize| {
        let x = ((at as f32 + 0.5) * length as f32 / EDGE_PX as f32 - 0.5).max(0.0);
        let first = (x as usize).min(length - 1);
        (first, (first + 1).min(length - 1), x - first as f32)
    };
    let columns: Vec<_> = (0..EDGE_PX).map(|c| beside(c, width)).collect();
    (0..EDGE_PX)
        .flat_map(|r| {
            let (top, bottom, down) = beside(r, height);
            let (top, bottom) = (&image[top * width..], &image[bottom * width..]);
            columns.iter().map(move |&(left, right, across)| {
                let along = |row: &[f32]| row[left] + across * (row[right] - row[left]);
                along(top) + down * (along(bottom) - along(top))
            })
        })
        .collect()
}

#[cfg(test)]
mod tests;
