//! Transfers weights into a burn module, and back into a file.
//!
//! The file has PyTorch's layout: names joined by dots, a linear layer as outputs x inputs (burn:
//! inputs x outputs), PReLU's slopes called `weight` (burn: `alpha`).

use std::collections::BTreeSet;

use burn::module::{Module, ModuleMapper, ModuleVisitor, Param};
use burn::tensor::backend::Backend;
use burn::tensor::{Tensor, TensorData};

use crate::weights::{Array, Weights, WeightsError};

/// The module with these weights. Each tensor of the file is used exactly once.
///
/// # Errors
/// [`WeightsError`] names the first tensor that is missing, has another shape, or is unknown.
pub fn fill<B: Backend, M: Module<B>>(module: M, weights: &Weights) -> Result<M, WeightsError> {
    let mut filler =
        Filler { place: Place::default(), weights, taken: BTreeSet::new(), error: None };
    let filled = module.map(&mut filler);
    if let Some(error) = filler.error {
        return Err(error);
    }
    match weights.names().find(|name| !filler.taken.contains(*name)) {
        Some(name) => Err(weights.unknown(name)),
        None => Ok(filled),
    }
}

/// The weights of a module, in PyTorch's layout, without metadata.
pub fn weights_of<B: Backend, M: Module<B>>(label: &str, module: &M) -> Weights {
    let mut reader = Reader { place: Place::default(), weights: Weights::new(label) };
    module.visit(&mut reader);
    reader.weights
}

/// The current place of a walk through the module.
#[derive(Default)]
struct Place {
    path: Vec<String>,
    kinds: Vec<String>,
}

impl Place {
    fn enter(&mut self, name: &str, kind: &str) {
        let name = if kind == "Struct:PRelu" && name == "alpha" { "weight" } else { name };
        self.path.push(name.to_owned());
        self.kinds.push(kind.to_owned());
    }

    fn leave(&mut self) {
        self.path.pop();
        self.kinds.pop();
    }

    fn name(&self) -> String {
        self.path.join(".")
    }

    /// Whether the parameter here is a matrix that PyTorch stores transposed.
    fn is_turned(&self, axes: usize) -> bool {
        axes == 2 && self.kinds.last().is_some_and(|kind| kind == "Struct:Linear")
    }
}

struct Filler<'w> {
    place: Place,
    weights: &'w Weights,
    taken: BTreeSet<String>,
    error: Option<WeightsError>,
}

impl<B: Backend> ModuleMapper<B> for Filler<'_> {
    fn enter_module(&mut self, name: &str, kind: &str) {
        self.place.enter(name, kind);
    }

    fn exit_module(&mut self, _name: &str, _kind: &str) {
        self.place.leave();
    }

    fn map_float<const D: usize>(&mut self, param: Param<Tensor<B, D>>) -> Param<Tensor<B, D>> {
        let name = self.place.name();
        let turned = self.place.is_turned(D);
        let mut expected = param.lazy_shape().to_vec();
        if turned {
            expected.reverse();
        }
        let array = match self.weights.tensor(&name, &expected) {
            Ok(array) => array,
            Err(error) => {
                self.error.get_or_insert(error);
                return param;
            }
        };
        let (id, device) = (param.id, param.lazy_device());
        let data = TensorData::new(array.values.clone(), array.shape.clone());
        let mut tensor = Tensor::<B, D>::from_data(data, &device);
        if turned {
            tensor = tensor.transpose();
        }
        self.taken.insert(name);
        param.transform_for_load(tensor, id)
    }
}

struct Reader {
    place: Place,
    weights: Weights,
}

impl<B: Backend> ModuleVisitor<B> for Reader {
    fn enter_module(&mut self, name: &str, kind: &str) {
        self.place.enter(name, kind);
    }

    fn exit_module(&mut self, _name: &str, _kind: &str) {
        self.place.leave();
    }

    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<B, D>>) {
        let mut tensor = param.val();
        if self.place.is_turned(D) {
            tensor = tensor.transpose();
        }
        let shape = tensor.dims().to_vec();
        let values = tensor.into_data().convert::<f32>().iter::<f32>().collect();
        self.weights.insert(self.place.name(), Array { shape, values });
    }
}
