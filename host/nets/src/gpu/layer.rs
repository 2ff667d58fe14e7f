//! Convolutions whose weights are on a device, from the tensors of a file.

use super::pack::{self, Order};
use crate::filter::Filter;
use crate::weights::{Weights, WeightsError};
use nirspi_gpu::Kernels;
use nirspi_gpu::network::Layer;
use nirspi_gpu::network::plan::{COLUMNS, Geometry, channels_a_unit};

/// Uploads a convolution with this stride and `centre` zeros around the image; `slopes` are those
/// of the PReLU after it.
pub(super) fn layer(
    engine: &dyn Kernels,
    filter: &Filter,
    (stride, centre): (usize, usize),
    slopes: Option<&[f32]>,
    order: Order,
) -> Layer {
    let Filter { inputs, outputs, side: kernel, .. } = *filter;
    let channels = channels_a_unit(outputs);
    let packed = pack::weights(filter, COLUMNS * channels, order);
    let table = pack::table(filter, slopes, order);
    let geometry = Geometry { inputs, outputs, kernel, stride, centre };
    Layer::new(geometry, channels, engine.upload(&packed), engine.upload(&table))
}

/// The convolution with this name, with stride 1, which keeps the size of its input.
pub(super) fn named(
    engine: &dyn Kernels,
    weights: &Weights,
    name: &str,
) -> Result<Layer, WeightsError> {
    let filter = checked(weights, name, Filter::convolution(weights, name)?)?;
    Ok(layer(engine, &filter, (1, filter.side / 2), None, Order::AsStored))
}

/// The convolution with this name, before a pixel shuffle.
pub(super) fn shuffled(
    engine: &dyn Kernels,
    weights: &Weights,
    name: &str,
) -> Result<Layer, WeightsError> {
    let filter = checked(weights, name, Filter::convolution(weights, name)?)?;
    Ok(layer(engine, &filter, (1, filter.side / 2), None, Order::Shuffled))
}

/// The fully connected layer with this name.
pub(super) fn linear(
    engine: &dyn Kernels,
    weights: &Weights,
    name: &str,
) -> Result<Layer, WeightsError> {
    let filter = checked(weights, name, Filter::linear(weights, name)?)?;
    Ok(layer(engine, &filter, (1, 0), None, Order::AsStored))
}

/// Checks that a layer is not too wide for a unit.
pub(super) fn checked(
    weights: &Weights,
    name: &str,
    filter: Filter,
) -> Result<Filter, WeightsError> {
    let limit = Geometry::most_inputs(filter.side);
    if filter.inputs > limit {
        return Err(weights.too_wide(name, filter.inputs, limit));
    }
    Ok(filter)
}
