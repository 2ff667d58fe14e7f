//! Tensor cores for the convolutions of the UNet, which are 95 % of all multiplications.
//!
//! # Invariant
//! In [`Arithmetic::F32`] a layer goes by tensor cores only if its weights are exact in `f16`, as
//! those of the shipped networks are. An activation is then multiplied as the sum of two numbers in
//! `f16`, so results are those of `f32`
//! (`tests::the_unet_by_products_is_the_unet_in_both_precisions`).

use nirspi_gpu::network::tiles::Columns;
use nirspi_gpu::network::{LARGEST_F16, Layer, Product, Products};
use nirspi_gpu::{Buffer, Kernels};

use super::pack::{self, Order};
use crate::arithmetic::Arithmetic;
use crate::filter::Filter;
use crate::note::{Note, Notes};

/// How convolutions multiply on a device with tensor cores.
#[derive(Debug, Clone)]
pub(crate) struct Multiplier {
    product: Product,
    arithmetic: Arithmetic,
    /// Becomes 1 as soon as an activation is not a number of `f16`.
    beyond: Buffer,
    notes: Notes,
    /// Factor on the weights of products: a fault, for tests.
    #[cfg(test)]
    pub(super) fault: f32,
}

impl Multiplier {
    /// Convolutions by `product` on the engine's device; `notes` are told of what is not done with
    /// the tensor cores, and why.
    pub(crate) fn new(
        engine: &dyn Kernels,
        product: Product,
        arithmetic: Arithmetic,
        notes: Notes,
    ) -> Self {
        Self {
            product,
            arithmetic,
            beyond: engine.upload(&[0.0]),
            notes,
            #[cfg(test)]
            fault: 1.0,
        }
    }

    /// Tells the user.
    pub(super) fn note(&self, note: Note) {
        self.notes.add(note);
    }

    /// Largest difference of two outputs of the UNet, with tensor cores and without them, at which
    /// both count as right: ten times what was seen on images, because this is asked of noise.
    pub(super) fn bound(&self) -> f32 {
        match self.arithmetic {
            Arithmetic::F32 => 1e-3,
            Arithmetic::F16 => 5e-2,
        }
    }

    /// A number that is not 0 if an activation was not a number of `f16`.
    pub(super) fn beyond(&self) -> &Buffer {
        &self.beyond
    }

    /// The layer with weights for products, if its weights and sizes allow that.
    pub(super) fn equip(
        &self,
        engine: &dyn Kernels,
        layer: Layer,
        filter: &Filter,
        order: Order,
    ) -> Layer {
        let (planes, numbers): (usize, fn(f32) -> bool) = match self.arithmetic {
            Arithmetic::F32 => (2, nirspi_gpu::network::is_f16),
            Arithmetic::F16 => (1, |weight| weight.abs() <= LARGEST_F16),
        };
        let columns = Columns::of(filter.outputs).filter(|_| filter.inputs.is_multiple_of(8));
        match columns {
            Some(columns) if filter.weights.iter().copied().all(numbers) => {
                let packed = pack::products(filter, columns, order);
                #[cfg(test)]
                let packed: Vec<f32> = packed.iter().map(|weight| weight * self.fault).collect();
                layer.with_products(Products {
                    product: self.product,
                    planes,
                    columns,
                    weights: engine.narrow(&packed),
                    beyond: self.beyond.clone(),
                })
            }
            Some(_) => {
                self.note(match self.arithmetic {
                    Arithmetic::F32 => Note::WeightsNotF16,
                    Arithmetic::F16 => Note::WeightsBeyondF16,
                });
                layer
            }
            None => layer,
        }
    }
}
