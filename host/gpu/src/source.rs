//! The CUDA C++ source of every kernel, without a GPU.
//!
//! CubeCL writes the source of a kernel when the kernel is first launched, and NVRTC compiles the
//! source for the GPU. A [`Card`] is a device that only writes the source: networks and pursuits
//! run on it as on a GPU, with zeros for results, and [`written`] then gives each kernel that a GPU
//! of this kind would have been given. `host/gpu/scripts/cuda_source.py` compiles them.
//!
//! There is no list of kernels. A new kernel, or a new variant of one, is written as soon as the
//! networks or the pursuit launch it.

mod server;

use std::collections::BTreeMap;
use std::fmt;
use std::sync::{Mutex, MutexGuard, PoisonError};

use cubecl::prelude::*;
use cubecl::server::CubeCount;

use crate::card::Card;

pub(crate) use server::SourceRuntime;

/// A kernel's source, as CubeCL gives it to NVRTC.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Source {
    /// The kernel's module and function, and the facts that it is compiled for, for people and for
    /// file names: `network-kernels-convolve-pixels8-channels6-Silu`.
    pub name: String,
    /// CubeCL's description of the variant, in full.
    pub variant: String,
    /// The function in the text.
    pub entry: String,
    /// Number of units of a workgroup.
    pub units: u32,
    /// Shared memory of a workgroup, in bytes. The text does not have this number, because the host
    /// gives it with the launch.
    pub shared_bytes: usize,
    /// Number of launches.
    pub launches: usize,
    /// Number of workgroups of the largest launch, 0 where the device would count them.
    pub groups: u64,
    /// The text.
    pub text: String,
}

impl fmt::Display for Source {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "// name: {}", self.name)?;
        writeln!(f, "// variant: {}", self.variant)?;
        writeln!(f, "// entry: {}", self.entry)?;
        writeln!(f, "// units: {}", self.units)?;
        writeln!(f, "// shared bytes: {}", self.shared_bytes)?;
        writeln!(f, "// launches: {}", self.launches)?;
        writeln!(f, "// groups: {}", self.groups)?;
        f.write_str(&self.text)
    }
}

/// A kernel that CubeCL refused, or that no GPU of this kind can run.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{name}: {why}")]
pub struct Refused {
    /// The kernel, as in [`Source::name`].
    pub name: String,
    /// CubeCL's reason.
    pub why: String,
}

/// What was launched on the cards of this process, by CubeCL's description of the variant.
type Launched = BTreeMap<(Card, String), Result<Source, Refused>>;

static LAUNCHED: Mutex<Launched> = Mutex::new(BTreeMap::new());

fn launched() -> MutexGuard<'static, Launched> {
    LAUNCHED.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The source of every kernel that was launched on this card so far, in the order of their names,
/// each of which occurs once.
///
/// # Errors
/// Every kernel that was refused.
pub fn written(card: Card) -> Result<Vec<Source>, Vec<Refused>> {
    // Launches are queued for another thread.
    let synced = cubecl::future::block_on(SourceRuntime::client(&card).sync());
    debug_assert!(synced.is_ok());
    let launched = launched();
    let of_card = launched.iter().filter(|((on, _), _)| *on == card).map(|(_, source)| source);
    let (sources, refused): (Vec<_>, Vec<_>) = of_card.cloned().partition(Result::is_ok);
    if !refused.is_empty() {
        return Err(refused.into_iter().filter_map(Result::err).collect());
    }
    let mut sources: Vec<Source> = sources.into_iter().filter_map(Result::ok).collect();
    sources.sort_by(|a, b| a.name.cmp(&b.name));
    let mut alike = 0;
    for at in 1..sources.len() {
        let first = sources[at - 1 - alike].name.clone();
        alike = if sources[at].name == first { alike + 1 } else { 0 };
        if alike > 0 {
            sources[at].name = format!("{first}-{}", alike + 1);
        }
    }
    Ok(sources)
}

/// A short name from the path of a kernel's type and CubeCL's description of what the kernel is
/// compiled for.
fn name(path: &str, variant: &str) -> String {
    // `nirspi_gpu::network::kernels::convolve::Convolve<...>`: the function is a module.
    let path = path.split('<').next().unwrap_or(path);
    let mut parts: Vec<&str> = path.split("::").skip(1).collect();
    parts.pop();
    let mut name = parts.join("-");
    let (_, compiled_for) = variant.split_once("info: ").unwrap_or_default();
    for (key, value) in facts(compiled_for) {
        match value {
            "false" | "None" | "Nothing" | "()" => {}
            "true" => name.extend(["-", key]),
            number if number.starts_with(|c: char| c.is_ascii_digit()) => {
                name.extend(["-", key, number]);
            }
            word => name.extend(["-", word]),
        }
    }
    name
}

/// The fields of a description that hold no other field, with their values; values without a field
/// have an empty key.
fn facts(variant: &str) -> impl Iterator<Item = (&str, &str)> {
    let pieces = variant.split_inclusive(|c: char| "{}()[],".contains(c));
    // What stands before an opening bracket is the name of a structure.
    let values = pieces.filter(|piece| !piece.ends_with(['{', '(', '[']));
    values.filter_map(|piece| {
        let value = piece.trim_end_matches(['}', ')', ']', ',']).trim();
        if value.is_empty() { None } else { Some(value.split_once(": ").unwrap_or(("", value))) }
    })
}

/// Adds a launch of a variant that is made into a source the first time.
fn add(
    card: Card,
    variant: String,
    count: &CubeCount,
    made: impl FnOnce(&str) -> Result<Source, Refused>,
) {
    let groups = match count {
        CubeCount::Static(x, y, z) => u64::from(*x) * u64::from(*y) * u64::from(*z),
        CubeCount::Dynamic(_) => 0,
    };
    let mut launched = launched();
    let entry = launched.entry((card, variant)).or_insert_with_key(|(_, variant)| made(variant));
    if let Ok(source) = entry {
        source.launches += 1;
        source.groups = source.groups.max(groups);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_kernel_is_named_after_what_it_is_compiled_for() {
        let variant = "KernelId { mode: Unchecked, info: (Shape { pixels: 8, channels: 6, activation: Silu, add: Nothing, clamp: false, activated: true }, 64) }";
        let path = "nirspi_gpu::network::kernels::convolve::Convolve<x::Runtime>";
        let expected = "network-kernels-convolve-pixels8-channels6-Silu-activated-64";
        assert_eq!(name(path, variant), expected);
        let plain =
            name("nirspi_gpu::network::kernels::pooled::Pooled<x::Runtime>", "info: None }");
        assert_eq!(plain, "network-kernels-pooled");
    }

    #[test]
    fn a_kernel_is_written_when_it_is_launched_and_results_are_zeros() {
        // A card of its own: tests of one process share what was launched.
        let card = Card { capability: 86 };
        assert_eq!(written(card), Ok(Vec::new()));
        let engine = crate::open(&card.into());
        let images = engine.upload(&[3.0; 100]);
        for _ in 0..2 {
            let readings = engine.readings(&images, 0, 1.0, 100);
            assert_eq!(engine.read(&[&readings]).unwrap()[0].floats(), [0.0; 100]);
        }
        let [source] = written(card).unwrap().try_into().unwrap();
        assert_eq!(source.name, "network-kernels-readings");
        assert_eq!((source.launches, source.groups, source.shared_bytes), (2, 1, 0));
        assert!(source.text.contains("__global__") && source.text.contains(&source.entry));
    }

    #[test]
    fn a_kernel_that_does_not_fit_the_card_is_refused_by_name() {
        let card = Card { capability: 70 };
        let engine = crate::open(&card.into());
        let shape = crate::pursuit::layout::Shape { units: 64, per_unit: 1, capacity: 1 << 20 };
        let pursuit = crate::pursuit::Pursuit {
            shape,
            frames: 1,
            sparsity: 1,
            gram: engine.empty(64 * 64),
            atoms: engine.empty(128),
            projection: engine.empty(64),
            rows: engine.empty(64),
            support: engine.empty(1),
            values: engine.empty(2),
            state: engine.empty(crate::pursuit::layout::STATE),
            coefficients: engine.empty(1),
            exact: None,
        };
        engine.coefficients(&pursuit);
        let refused = written(card).unwrap_err();
        let expected = "pursuit-kernels-coefficients-units64-per_unit1-capacity1048576: \
                        4194304 bytes of shared memory, sm_70 has 49152";
        assert_eq!(refused.iter().map(ToString::to_string).collect::<Vec<_>>(), [expected]);
    }

    #[test]
    fn a_card_has_the_name_that_nvrtc_gives_it() {
        assert_eq!(Card::HOPPER.to_string(), "sm_90");
        assert_eq!(Card { capability: 75 }.shared_bytes(), 65_536);
        assert_eq!(Card::HOPPER.shared_bytes(), 232_448);
    }
}
