//! Values as tensors on the device that trains.

use crate::data::SIDE_PX;
use crate::model::CONDITIONS;
use burn::tensor::backend::Backend;
use burn::tensor::{Tensor, TensorData};

/// Images (count, channels, side, side).
pub(super) fn images<B: Backend>(
    values: &[f32],
    channels: usize,
    side: usize,
    device: &B::Device,
) -> Tensor<B, 4> {
    let count = values.len() / (channels * side * side);
    Tensor::from_data(TensorData::new(values.to_vec(), [count, channels, side, side]), device)
}

/// Images of 64 x 64 in one channel.
pub(super) fn scenes<B: Backend>(values: &[f32], device: &B::Device) -> Tensor<B, 4> {
    images(values, 1, SIDE_PX, device)
}

/// The UNet's conditions, one row for each image.
pub(super) fn columns<B: Backend>(rows: &[[f32; CONDITIONS]], device: &B::Device) -> Tensor<B, 2> {
    let values: Vec<f32> = rows.as_flattened().to_vec();
    Tensor::from_data(TensorData::new(values, [rows.len(), CONDITIONS]), device)
}

/// One number for each image, shaped for multiplication with images.
pub(super) fn each<B: Backend>(values: &[f32], device: &B::Device) -> Tensor<B, 4> {
    Tensor::from_data(TensorData::new(values.to_vec(), [values.len(), 1, 1, 1]), device)
}
