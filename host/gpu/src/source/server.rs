//! CubeCL's side of a [`Card`]: a runtime whose device compiles kernels to text and runs none.
//!
//! Properties and options are those of `cubecl-cuda`'s `runtime.rs`, so that the text is what a GPU
//! of this kind is given.

use std::any::Any;
use std::sync::Arc;

use cubecl::backtrace::BackTrace;
use cubecl::bytes::Bytes;
use cubecl::cuda::{CUDA_MAX_BINDINGS, CudaCompiler, CudaRuntime};
use cubecl::device::{Device, DeviceId, DeviceService};
use cubecl::future::DynFut;
use cubecl::ir::features::{Plane, Tma, TypeUsage};
use cubecl::ir::{
    BarrierLevel, DeviceProperties, ElemType, FloatKind, HardwareProperties,
    MemoryDeviceProperties, OpaqueType, SemanticType, StorageType, TargetProperties, VectorSize,
};
use cubecl::prelude::*;
use cubecl::profile::{ProfileDuration, TimingMethod};
use cubecl::server::{
    Binding, ComputeServer, CopyDescriptor, IoError, KernelArguments, ProfileError, ProfilingToken,
    ServerCommunication, ServerError, ServerUtilities,
};
use cubecl::stream_id::StreamId;
use cubecl::zspace::{Shape, Strides};
use cubecl::{CubeTask, MemoryAllocationMode, MemoryUsage};
use cubecl_cpp::cuda::arch::CudaArchitecture;
use cubecl_cpp::cuda::mma::CudaWmmaCompiler;
use cubecl_cpp::shared::{
    CompilationOptions, CppSupportedFeatures, DialectWmmaCompiler, register_mma_features,
    register_scaled_mma_features, register_wmma_features,
};
use cubecl_cpp::{ComputeKernel, register_supported_types};
use cubecl_runtime::allocator::PitchedMemoryLayoutPolicy;
use cubecl_runtime::logging::ServerLogger;
use cubecl_runtime::memory_management::ManagedMemoryHandle;
use cubecl_runtime::storage::{ComputeStorage, ManagedResource, StorageHandle, StorageId};
use cubecl_runtime::validation::{validate_cube_dim, validate_units};
use cudarc::driver::sys::CUDA_VERSION;

use super::{Refused, Source};
use crate::card::Card;

/// Alignment of buffers in bytes.
const ALIGNMENT: usize = 512;

/// Memory of the GPU in bytes, of which a quarter is the largest buffer: 80 GB, as an H100.
const MEMORY: u64 = 80_000_000_000;

impl Device for Card {
    fn from_id(id: DeviceId) -> Self {
        Self { capability: id.index_id }
    }

    fn to_id(&self) -> DeviceId {
        DeviceId { type_id: 0, index_id: self.capability }
    }
}

/// The runtime of a [`Card`].
#[derive(Debug, Clone)]
pub(crate) struct SourceRuntime;

impl Runtime for SourceRuntime {
    type Compiler = CudaCompiler;
    type Server = SourceServer;
    type Device = Card;

    fn client(card: &Card) -> ComputeClient<Self> {
        ComputeClient::load(card)
    }

    fn name(_: &ComputeClient<Self>) -> &'static str {
        "cuda source"
    }

    fn require_array_lengths() -> bool {
        CudaRuntime::require_array_lengths()
    }

    fn max_cube_count() -> (u32, u32, u32) {
        CudaRuntime::max_cube_count()
    }

    fn can_read_tensor(shape: &Shape, strides: &Strides) -> bool {
        CudaRuntime::can_read_tensor(shape, strides)
    }

    fn target_properties() -> TargetProperties {
        CudaRuntime::target_properties()
    }

    fn enumerate_devices(_: u16, (): &()) -> Vec<DeviceId> {
        Vec::new()
    }
}

/// Compiles kernels to text, and has no memory.
#[derive(Debug)]
pub(crate) struct SourceServer {
    card: Card,
    options: CompilationOptions,
    utilities: Arc<ServerUtilities<Self>>,
}

/// No memory.
#[derive(Debug, Default)]
pub(crate) struct Nowhere;

impl ComputeStorage for Nowhere {
    type Resource = ();

    fn alignment(&self) -> usize {
        ALIGNMENT
    }

    fn get(&mut self, _: &StorageHandle) {}

    fn alloc(&mut self, _: u64) -> Result<StorageHandle, IoError> {
        Err(IoError::UnsupportedIoOperation { backtrace: BackTrace::capture() })
    }

    fn dealloc(&mut self, _: StorageId) {}

    fn flush(&mut self) {}
}

impl DeviceService for SourceServer {
    fn init(id: DeviceId) -> Self {
        let card = Card::from_id(id);
        let logger = Arc::new(ServerLogger::default());
        let policy = PitchedMemoryLayoutPolicy::new(ALIGNMENT);
        let utilities = Arc::new(ServerUtilities::new(properties(card), logger, (), policy));
        Self { card, options: options(card), utilities }
    }

    fn utilities(&self) -> Arc<dyn Any + Send + Sync> {
        Arc::clone(&self.utilities) as Arc<dyn Any + Send + Sync>
    }
}

impl ServerCommunication for SourceServer {
    const SERVER_COMM_ENABLED: bool = false;
}

impl SourceServer {
    /// The source of a kernel.
    fn compile(
        &self,
        variant: &str,
        kernel: &dyn CubeTask<CudaCompiler>,
        mode: ExecutionMode,
    ) -> Result<Source, Refused> {
        let name = super::name(kernel.name(), variant);
        let refused =
            |error: &dyn std::fmt::Display| Refused { name: name.clone(), why: error.to_string() };
        let id = kernel.id();
        let properties = &self.utilities.properties;
        validate_cube_dim(properties, &id).map_err(|error| refused(&error))?;
        validate_units(properties, &id).map_err(|error| refused(&error))?;
        let compiled = kernel
            .compile(&mut CudaCompiler::default(), &self.options, mode, kernel.address_type())
            .map_err(|error| refused(&error))?;
        let shared_bytes = compiled.repr.as_ref().map_or(0, ComputeKernel::shared_memory_size);
        let limit = properties.hardware.max_shared_memory_size;
        if shared_bytes > limit {
            return Err(refused(&format_args!(
                "{shared_bytes} bytes of shared memory, {} has {limit}",
                self.card
            )));
        }
        Ok(Source {
            name,
            variant: variant.split_whitespace().collect::<Vec<_>>().join(" "),
            entry: compiled.entrypoint_name,
            units: compiled.cube_dim.num_elems(),
            shared_bytes,
            launches: 0,
            groups: 0,
            text: compiled.source,
        })
    }
}

impl ComputeServer for SourceServer {
    type Kernel = Box<dyn CubeTask<CudaCompiler>>;
    type Info = ();
    type MemoryLayoutPolicy = PitchedMemoryLayoutPolicy;
    type Storage = Nowhere;

    fn initialize_memory(&mut self, _: ManagedMemoryHandle, _: u64, _: StreamId) {}

    fn logger(&self) -> Arc<ServerLogger> {
        Arc::clone(&self.utilities.logger)
    }

    fn utilities(&self) -> Arc<ServerUtilities<Self>> {
        Arc::clone(&self.utilities)
    }

    fn read(
        &mut self,
        descriptors: Vec<CopyDescriptor>,
        _: StreamId,
    ) -> DynFut<Result<Vec<Bytes>, ServerError>> {
        let zeros = descriptors.into_iter().map(|read| {
            let count = read.shape.iter().product::<usize>() * read.elem_size;
            Bytes::from_bytes_vec(vec![0; count])
        });
        let zeros = zeros.collect();
        Box::pin(async move { Ok(zeros) })
    }

    fn write(&mut self, _: Vec<(CopyDescriptor, Bytes)>, _: StreamId) {}

    fn sync(&mut self, _: StreamId) -> DynFut<Result<(), ServerError>> {
        Box::pin(async { Ok(()) })
    }

    fn get_resource(
        &mut self,
        binding: Binding,
        _: StreamId,
    ) -> Result<ManagedResource<()>, ServerError> {
        Ok(ManagedResource::new(binding.memory, ()))
    }

    #[expect(
        unsafe_code,
        reason = "the function of the trait is unsafe; this one launches nothing"
    )]
    unsafe fn launch(
        &mut self,
        kernel: Self::Kernel,
        count: CubeCount,
        _: KernelArguments,
        mode: ExecutionMode,
        _: StreamId,
    ) {
        let mut id = kernel.id();
        id.mode(mode);
        let variant = format!("{id:?}");
        super::add(self.card, variant, &count, |variant| {
            self.compile(variant, kernel.as_ref(), mode)
        });
    }

    fn flush(&mut self, _: StreamId) -> Result<(), ServerError> {
        Ok(())
    }

    fn memory_usage(&mut self, _: StreamId) -> Result<MemoryUsage, ServerError> {
        Ok(MemoryUsage { number_allocs: 0, bytes_in_use: 0, bytes_padding: 0, bytes_reserved: 0 })
    }

    fn memory_cleanup(&mut self, _: StreamId) {}

    fn start_profile(&mut self, _: StreamId) -> Result<ProfilingToken, ServerError> {
        Ok(ProfilingToken { id: 0 })
    }

    fn end_profile(
        &mut self,
        _: StreamId,
        _: ProfilingToken,
    ) -> Result<ProfileDuration, ProfileError> {
        Err(ProfileError::NotRegistered { backtrace: BackTrace::capture() })
    }

    fn allocation_mode(&mut self, _: MemoryAllocationMode, _: StreamId) {}
}

/// What CubeCL's compiler may use on this card.
fn options(card: Card) -> CompilationOptions {
    CompilationOptions {
        warp_size: 32,
        supports_features: CppSupportedFeatures {
            grid_constants: card.capability >= 70,
            clusters: card.capability >= 90,
            fast_math: true,
            fast_tanh: card.capability >= 75 && CUDA_VERSION >= 12080,
            elect_sync: card.capability >= 90,
        },
    }
}

/// What kernels may use on this card: what ours ask for, of what `cubecl-cuda` registers.
fn properties(card: Card) -> DeviceProperties {
    let arch = CudaArchitecture { version: u32::from(card.capability) };
    let hardware = HardwareProperties {
        load_width: 128,
        plane_size_min: 32,
        plane_size_max: 32,
        max_bindings: CUDA_MAX_BINDINGS,
        max_shared_memory_size: card.shared_bytes(),
        max_cube_count: (i32::MAX as u32, u32::from(u16::MAX), u32::from(u16::MAX)),
        max_units_per_cube: 1024,
        max_cube_dim: (1024, 1024, 64),
        num_streaming_multiprocessors: None,
        num_tensor_cores: Some(4),
        min_tensor_cores_dim: Some(8),
        num_cpu_cores: None,
        max_vector_size: VectorSize::MAX,
    };
    let memory = MemoryDeviceProperties { max_page_size: MEMORY / 4, alignment: ALIGNMENT as u64 };
    let mut properties =
        DeviceProperties::new(Default::default(), memory, hardware, TimingMethod::System);
    register_supported_types(&mut properties);
    properties.register_type_usage(ElemType::Float(FloatKind::TF32), TypeUsage::Conversion);
    let halves =
        [FloatKind::F16, FloatKind::BF16].map(|kind| StorageType::from(ElemType::Float(kind)));
    let features = &mut properties.features;
    if card.capability >= 70 {
        features.plane.insert(Plane::Sync);
    }
    if card.capability >= 75 {
        features.matmul.ldmatrix.extend(halves);
    }
    if card.capability >= 80 {
        features.copy_async = true;
    }
    if card.capability >= 90 {
        features.tma.insert(Tma::Base);
        features.cube_cluster = true;
        features.matmul.stmatrix.extend(halves);
    }
    features.memory_reinterpret = true;
    features.alignment = true;
    features.plane.insert(Plane::Ops);
    features.plane.insert(Plane::NonUniformControlFlow);
    if card.capability >= 70 {
        properties.register_semantic_type(SemanticType::Pipeline);
        for level in [BarrierLevel::Unit, BarrierLevel::Cube] {
            properties.register_type_usage(OpaqueType::Barrier(level), TypeUsage::Buffer);
        }
    }
    register_wmma_features(CudaWmmaCompiler::supported_wmma_combinations(&arch), &mut properties);
    register_mma_features(CudaWmmaCompiler::supported_mma_combinations(&arch), &mut properties);
    register_scaled_mma_features(
        CudaWmmaCompiler::supported_scaled_mma_combinations(&arch),
        &mut properties,
    );
    properties
}
