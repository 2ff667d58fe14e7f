//! Convolutions whose weights are on a device, from the tensors of a file.

use super::multiplier::Multiplier;
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

/// Makes convolutions of the tensors of a file, on tensor cores if there is a `multiplier`.
#[derive(Clone, Copy)]
pub(super) struct Maker<'a> {
    pub(super) engine: &'a dyn Kernels,
    pub(super) weights: &'a Weights,
    pub(super) multiplier: Option<&'a Multiplier>,
}

impl Maker<'_> {
    /// The convolution with this name, with stride 1, which keeps the size of its input.
    pub(super) fn same(&self, name: &str, order: Order) -> Result<Layer, WeightsError> {
        let side = Filter::convolution(self.weights, name)?.side;
        self.layer(name, (1, side / 2), order)
    }

    /// The convolution with this name, stride, and number of zeros around the image.
    pub(super) fn layer(
        &self,
        name: &str,
        reach: (usize, usize),
        order: Order,
    ) -> Result<Layer, WeightsError> {
        let filter = Filter::convolution(self.weights, name)?;
        let filter = checked(self.weights, name, filter)?;
        let plain = layer(self.engine, &filter, reach, None, order);
        Ok(match self.multiplier {
            Some(multiplier) => multiplier.equip(self.engine, plain, &filter, order),
            None => plain,
        })
    }
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
