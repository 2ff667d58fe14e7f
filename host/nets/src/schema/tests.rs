//! Each network's small weights from PyTorch, with one tensor damaged.

use proptest::prelude::*;

use super::*;
use crate::weights::Array;

type Check = fn(&Weights) -> Result<(), WeightsError>;

macro_rules! network {
    ($name:literal, $check:expr) => {
        (
            Weights::parse(
                $name,
                include_bytes!(concat!("../../tests/pytorch/", $name, ".safetensors")),
            )
            .unwrap(),
            (|weights| $check(weights).map(drop)) as Check,
        )
    };
}

/// The networks, and what takes weights for each: the forward passes themselves where there are
/// some.
fn networks() -> [(Weights, Check); 5] {
    [
        network!("unet", crate::cpu::UNet::new),
        network!("fsrcnn", crate::cpu::Fsrcnn::new),
        network!("estimator", crate::cpu::Estimator::new),
        network!("classifier", crate::cpu::Classifier::new),
        network!("prior", crate::cpu::Prior::new),
    ]
}

#[derive(Debug, Clone)]
enum Damage {
    Dropped,
    Renamed(String),
    /// Another length of an axis: which, and by how much more or less.
    Longer(usize, isize),
    /// An axis more, or the first one gone.
    Axes(bool),
    /// The same numbers in one row.
    Flat,
    Empty,
    Poisoned(usize, f32),
}

fn damage() -> impl Strategy<Value = Damage> {
    let poison = prop_oneof![Just(f32::NAN), Just(f32::INFINITY), Just(f32::NEG_INFINITY)];
    prop_oneof![
        Just(Damage::Dropped),
        "[a-z_.]{0,9}[0-9]{0,3}".prop_map(Damage::Renamed),
        (0..4usize, prop_oneof![Just(-1), Just(1), Just(2), Just(7)])
            .prop_map(|(axis, by)| Damage::Longer(axis, by)),
        any::<bool>().prop_map(Damage::Axes),
        Just(Damage::Flat),
        Just(Damage::Empty),
        (any::<usize>(), poison).prop_map(|(at, value)| Damage::Poisoned(at, value)),
    ]
}

/// The weights with the tensor `name` damaged.
fn damaged(weights: &Weights, name: &str, damage: &Damage) -> Weights {
    let mut altered = Weights::new("altered");
    for other in weights.names().filter(|other| *other != name) {
        altered.insert(other.to_owned(), weights.get(other).unwrap().clone());
    }
    let Array { mut shape, mut values } = weights.get(name).unwrap().clone();
    let mut name = name.to_owned();
    match damage {
        Damage::Dropped => return altered,
        Damage::Renamed(end) => name.push_str(end),
        Damage::Longer(axis, by) => {
            let axis = axis % shape.len();
            shape[axis] = shape[axis].saturating_add_signed(*by);
            values.resize(shape.iter().product(), 0.1);
        }
        Damage::Axes(true) => shape.push(1),
        Damage::Axes(false) => {
            let first = shape.remove(0);
            values.truncate(values.len() / first);
        }
        Damage::Flat => shape = vec![values.len()],
        Damage::Empty => {
            shape[0] = 0;
            values.clear();
        }
        Damage::Poisoned(at, value) => {
            let at = at % values.len();
            values[at] = *value;
        }
    }
    altered.insert(name, Array { shape, values });
    altered
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]
    #[test]
    fn a_damaged_tensor_is_named_with_what_was_found_and_expected(
        network in 0..5usize, tensor in any::<prop::sample::Index>(), damage in damage(),
    ) {
        let (weights, check) = &networks()[network];
        let names: Vec<&str> = weights.names().collect();
        let name = names[tensor.index(names.len())];
        let sound = weights.get(name).unwrap();
        let altered = damaged(weights, name, &damage);
        let found = altered.get(name).ok();
        // A rename to nothing, or a row of one number that was a row of one number.
        let same = found.is_some_and(|found| found == sound);
        match (check(&altered), same) {
            (Ok(()), true) => {}
            (Err(error), false) => {
                let line = error.to_string();
                let expected = crate::weights::by(&sound.shape);
                prop_assert!(line.contains(&format!(" {name}")), "{line}: not {name}");
                prop_assert!(!line.contains('\n'), "{line}");
                match (found, error) {
                    (Some(found), WeightsError::NotFinite { value, .. }) => {
                        let told = format!("{name}, {expected}, holds {value} at ");
                        prop_assert!(line.contains(&told), "{line}: not {told}");
                        prop_assert_eq!(&found.shape, &sound.shape);
                    }
                    (Some(found), _) => {
                        let found = crate::weights::by(&found.shape);
                        let told = format!("{name} is {found}, expected {expected}");
                        prop_assert!(line.contains(&told), "{line}: not {told}");
                    }
                    (None, _) => {
                        let told = format!("no tensor {name}, expected {expected}");
                        prop_assert!(line.contains(&told), "{line}: not {told}");
                    }
                }
            }
            (taken, same) => prop_assert!(false, "{name}, {damage:?}: {taken:?}, the same: {same}"),
        }
    }
}

#[test]
fn sound_weights_have_the_sizes_that_pytorch_made_them_with() {
    let of = |name: &str| networks().into_iter().find(|(w, _)| w.label() == name).unwrap().0;
    let UNetSizes { channels, blocks, .. } = unet(&of("unet")).unwrap();
    assert_eq!((channels, blocks), (vec![8, 12, 16], 2));
    assert_eq!(fsrcnn(&of("fsrcnn")).unwrap(), [8, 5, 3]);
    assert_eq!(estimator(&of("estimator")).unwrap(), [4, 6, 8, 10, 7]);
    assert_eq!(classifier(&of("classifier")).unwrap(), [4, 6, 8]);
    let sizes = PriorSizes { stages: 2, blocks: 2, widths: [6, 5] };
    assert_eq!(prior(&of("prior")).unwrap(), sizes);
}

#[test]
fn the_embedded_weights_are_whole() {
    let embedded = |model| Weights::embedded(model).unwrap();
    for model in ["diffusion", "gan", "ancestral", "regression"] {
        unet(&embedded(model)).unwrap();
    }
    fsrcnn(&embedded("fsrcnn")).unwrap();
    estimator(&embedded("estimator")).unwrap();
    classifier(&embedded("classifier")).unwrap();
    prior(&embedded("prior")).unwrap();
}

#[test]
fn weights_of_no_tensor_and_of_another_network_are_refused() {
    let none = Weights::new("none");
    for (weights, check) in networks() {
        assert!(matches!(check(&none), Err(WeightsError::Missing { .. })), "{}", weights.label());
        let others = networks().into_iter().filter(|(other, _)| other.label() != weights.label());
        for (other, _) in others {
            assert!(check(&other).is_err(), "{} for {}", other.label(), weights.label());
        }
    }
}
