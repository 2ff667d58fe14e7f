//! A convolution whose weights are on a device.

use super::engine::{Buffer, Engine};
use super::kernels::COLUMNS;
use super::pack::{self, Order};
use super::plan::{Geometry, channels_a_unit};
use crate::filter::Filter;
use crate::weights::{Weights, WeightsError};

/// A convolution whose weights are on a device, in the order of its kernel.
pub(crate) struct Layer {
    pub geometry: Geometry,
    /// Number of channels of a unit.
    pub channels: usize,
    /// Number of pixels of a unit; `None` if the number of pixels in all decides.
    pub pixels: Option<usize>,
    pub weights: Buffer,
    /// The bias of each channel, followed by the slope of its PReLU.
    pub table: Buffer,
}

impl Layer {
    /// Uploads a convolution with this stride and zeros around the image; `slopes` are those of the
    /// PReLU after it.
    pub fn new(
        engine: &dyn Engine,
        filter: &Filter,
        (stride, centre): (usize, usize),
        slopes: Option<&[f32]>,
        order: Order,
    ) -> Self {
        let Filter { inputs, outputs, side: kernel, .. } = *filter;
        let channels = channels_a_unit(outputs);
        let packed = pack::weights(filter, COLUMNS * channels, order);
        let table = pack::table(filter, slopes, order);
        let geometry = Geometry { inputs, outputs, kernel, stride, centre };
        assert_eq!(
            packed.len(),
            outputs.next_multiple_of(COLUMNS * channels) * geometry.steps() * super::kernels::DEPTH
        );
        let [weights, table] = [&packed, &table].map(|numbers| engine.upload(numbers));
        Self { geometry, channels, pixels: None, weights, table }
    }

    /// The convolution with this name, with stride 1, which keeps the size of its input.
    pub fn named(engine: &dyn Engine, weights: &Weights, name: &str) -> Result<Self, WeightsError> {
        let filter = checked(weights, name, Filter::convolution(weights, name)?)?;
        Ok(Self::new(engine, &filter, (1, filter.side / 2), None, Order::AsStored))
    }

    /// The convolution with this name, before a pixel shuffle.
    pub fn shuffled(
        engine: &dyn Engine,
        weights: &Weights,
        name: &str,
    ) -> Result<Self, WeightsError> {
        let filter = checked(weights, name, Filter::convolution(weights, name)?)?;
        Ok(Self::new(engine, &filter, (1, filter.side / 2), None, Order::Shuffled))
    }

    /// The fully connected layer with this name.
    pub fn linear(
        engine: &dyn Engine,
        weights: &Weights,
        name: &str,
    ) -> Result<Self, WeightsError> {
        let filter = checked(weights, name, Filter::linear(weights, name)?)?;
        Ok(Self::new(engine, &filter, (1, 0), None, Order::AsStored))
    }

    /// Number of channels that a workgroup computes.
    pub fn tile(&self) -> usize {
        COLUMNS * self.channels
    }
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
