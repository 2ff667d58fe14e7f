//! The functions of the CUDA driver that CubeCL calls (CUDA Driver API, version 13).

#![expect(unsafe_code, reason = "the interface is that of a library in C")]
#![allow(non_snake_case, reason = "names of the interface")]

use crate::ptx::Kernel;
use crate::run::{Launch, launch};
use std::alloc::{Layout, alloc_zeroed};
use std::ffi::{CStr, c_char, c_int, c_uint, c_void};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::{env, fs, ptr, slice};

/// `CUresult`: success, an invalid value, an unusable PTX, a kernel that failed.
const SUCCESS: c_int = 0;
const INVALID_VALUE: c_int = 1;
const INVALID_PTX: c_int = 218;
const LAUNCH_FAILED: c_int = 719;

/// Handles have no contents here.
const HANDLE: *mut c_void = ptr::dangling_mut::<u64>().cast();

#[repr(C)]
pub struct Copy2d {
    src_x: usize,
    src_y: usize,
    src_type: c_uint,
    src_host: *const c_void,
    src_device: u64,
    src_array: *mut c_void,
    src_pitch: usize,
    dst_x: usize,
    dst_y: usize,
    dst_type: c_uint,
    dst_host: *mut c_void,
    dst_device: u64,
    dst_array: *mut c_void,
    dst_pitch: usize,
    width: usize,
    height: usize,
}

#[unsafe(no_mangle)]
pub extern "C" fn cuInit(_flags: c_uint) -> c_int {
    SUCCESS
}

/// Stores `value` where a caller wants it.
///
/// # Safety
/// `place` must be valid for a write.
unsafe fn put<T>(place: *mut T, value: T) -> c_int {
    // SAFETY: the caller's promise.
    unsafe { place.write(value) };
    SUCCESS
}

macro_rules! puts {
    ($($name:ident($place:ident: *mut $kind:ty $(, $other:ident: $of:ty)*) = $value:expr;)*) => {$(
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $name($place: *mut $kind $(, $other: $of)*) -> c_int {
            // SAFETY: the interface demands a valid pointer.
            unsafe { put($place, $value) }
        }
    )*};
}

macro_rules! succeeds {
    ($($name:ident($($of:ty),*);)*) => {$(
        #[unsafe(no_mangle)]
        pub extern "C" fn $name($(_: $of),*) -> c_int {
            SUCCESS
        }
    )*};
}

puts! {
    cuDriverGetVersion(version: *mut c_int) = 13000;
    cuDeviceGetCount(count: *mut c_int) = 1;
    cuDeviceGet(device: *mut c_int, _ordinal: c_int) = 0;
    cuDevicePrimaryCtxRetain(context: *mut *mut c_void, _device: c_int) = HANDLE;
    cuCtxGetCurrent(context: *mut *mut c_void) = HANDLE;
    cuDeviceTotalMem_v2(bytes: *mut usize, _device: c_int) = 8 << 30;
    cuStreamCreate(stream: *mut *mut c_void, _flags: c_uint) = HANDLE;
    cuEventCreate(event: *mut *mut c_void, _flags: c_uint) = HANDLE;
    cuDeviceGetAttribute(value: *mut c_int, attribute: c_int, _device: c_int) = property(attribute);
    cuEventElapsedTime(ms: *mut f32, _start: *mut c_void, _end: *mut c_void) = 0.0;
    cuMemAlloc_v2(place: *mut u64, bytes: usize) = memory(bytes) as u64;
    cuMemAllocAsync(place: *mut u64, bytes: usize, _stream: *mut c_void) = memory(bytes) as u64;
    cuMemAllocHost_v2(place: *mut *mut c_void, bytes: usize) = memory(bytes).cast();
}

succeeds! {
    cuCtxSetCurrent(*mut c_void);
    cuDevicePrimaryCtxRelease_v2(c_int);
    cuStreamDestroy_v2(*mut c_void);
    cuStreamSynchronize(*mut c_void);
    cuStreamWaitEvent(*mut c_void, *mut c_void, c_uint);
    cuCtxSynchronize();
    cuEventRecord(*mut c_void, *mut c_void);
    cuEventSynchronize(*mut c_void);
    cuEventQuery(*mut c_void);
    cuEventDestroy_v2(*mut c_void);
    cuFuncSetAttribute(*mut c_void, c_int, c_int);
    cuModuleUnload(*mut c_void);
    // Memory is not given back: a test has little, and a layout would have to be kept for each block.
    cuMemFree_v2(u64);
    cuMemFreeAsync(u64, *mut c_void);
    cuMemFreeHost(*mut c_void);
}

/// A property of the device, by `CUdevice_attribute`.
fn property(attribute: c_int) -> c_int {
    match attribute {
        // Units of a workgroup, in all and in each direction.
        1..=3 => 1024,
        4 => 64,
        // Workgroups in each direction.
        5 => c_int::MAX,
        6 | 7 => 65_535,
        10 => 32,
        16 => 132,
        75 => 9,
        76 => 0,
        97 => 227 << 10,
        _ => 0,
    }
}

fn memory(bytes: usize) -> *mut u8 {
    let layout = Layout::from_size_align(bytes.max(1), 512).unwrap_or(Layout::new::<[u8; 512]>());
    // SAFETY: the size is not 0.
    unsafe { alloc_zeroed(layout) }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn cuDeviceGetName(name: *mut c_char, length: c_int, _: c_int) -> c_int {
    let text = c"no GPU: PTX on the processor".to_bytes_with_nul();
    if length < text.len() as c_int {
        return INVALID_VALUE;
    }
    // SAFETY: the place has `length` bytes.
    unsafe { ptr::copy_nonoverlapping(text.as_ptr(), name.cast(), text.len()) };
    SUCCESS
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn cuGetErrorString(_: c_int, text: *mut *const c_char) -> c_int {
    // SAFETY: the interface demands a valid pointer.
    unsafe { put(text, c"see stderr".as_ptr()) }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn cuGetErrorName(_: c_int, text: *mut *const c_char) -> c_int {
    // SAFETY: the interface demands a valid pointer.
    unsafe { put(text, c"CUDA_ERROR".as_ptr()) }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn cuMemcpyHtoDAsync_v2(
    to: u64,
    from: *const c_void,
    bytes: usize,
    _: *mut c_void,
) -> c_int {
    // SAFETY: both places have `bytes` bytes; device memory is the host's.
    unsafe { ptr::copy(from.cast::<u8>(), to as *mut u8, bytes) };
    SUCCESS
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn cuMemcpyDtoHAsync_v2(
    to: *mut c_void,
    from: u64,
    bytes: usize,
    _: *mut c_void,
) -> c_int {
    // SAFETY: both places have `bytes` bytes; device memory is the host's.
    unsafe { ptr::copy(from as *const u8, to.cast::<u8>(), bytes) };
    SUCCESS
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn cuMemcpy2DAsync_v2(copy: *const Copy2d, _: *mut c_void) -> c_int {
    // SAFETY: the interface demands a valid pointer.
    let copy = unsafe { &*copy };
    // CU_MEMORYTYPE_HOST is 1.
    let from = if copy.src_type == 1 { copy.src_host as u64 } else { copy.src_device };
    let to = if copy.dst_type == 1 { copy.dst_host as u64 } else { copy.dst_device };
    for line in 0..copy.height {
        let from = from as usize + (copy.src_y + line) * copy.src_pitch + copy.src_x;
        let to = to as usize + (copy.dst_y + line) * copy.dst_pitch + copy.dst_x;
        // SAFETY: the caller promises that both rectangles are there.
        unsafe { ptr::copy(from as *const u8, to as *mut u8, copy.width) };
    }
    SUCCESS
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn cuModuleLoadData(module: *mut *mut c_void, image: *const c_void) -> c_int {
    // SAFETY: CubeCL gives PTX, which ends with 0.
    let text = unsafe { CStr::from_ptr(image.cast()) }.to_string_lossy();
    if let Some(folder) = env::var_os("NIRSPI_CUDA_DUMP") {
        static NUMBER: AtomicUsize = AtomicUsize::new(0);
        let number = NUMBER.fetch_add(1, Ordering::Relaxed);
        let file = format!("{}-{number:03}.ptx", std::process::id());
        if let Err(error) = fs::write(std::path::Path::new(&folder).join(file), text.as_bytes()) {
            eprintln!("NIRSPI_CUDA_DUMP: {error}");
        }
    }
    match Kernel::read(&text) {
        // SAFETY: the interface demands a valid pointer.
        Ok(kernel) => unsafe { put(module, Box::into_raw(Box::new(kernel)).cast()) },
        Err(error) => {
            eprintln!("PTX: {error}");
            INVALID_PTX
        }
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn cuModuleGetFunction(
    function: *mut *mut c_void,
    module: *mut c_void,
    _name: *const c_char,
) -> c_int {
    // A module of CubeCL has one kernel.
    // SAFETY: the interface demands a valid pointer.
    unsafe { put(function, module) }
}

#[unsafe(no_mangle)]
#[allow(clippy::too_many_arguments, reason = "the interface")]
pub unsafe extern "C" fn cuLaunchKernel(
    function: *mut c_void,
    groups_x: c_uint,
    groups_y: c_uint,
    groups_z: c_uint,
    units_x: c_uint,
    units_y: c_uint,
    units_z: c_uint,
    shared_bytes: c_uint,
    _: *mut c_void,
    arguments: *mut *mut c_void,
    _: *mut *mut c_void,
) -> c_int {
    // SAFETY: functions are made by `cuModuleLoadData` and never freed.
    let kernel = unsafe { &*function.cast::<Kernel>() };
    let mut parameters = vec![0; kernel.parameter_bytes()];
    for (index, parameter) in kernel.parameters.iter().enumerate() {
        // SAFETY: the caller gives as many arguments as the kernel has parameters, of their sizes.
        let argument =
            unsafe { slice::from_raw_parts((*arguments.add(index)).cast::<u8>(), parameter.bytes) };
        parameters[parameter.at..][..parameter.bytes].copy_from_slice(argument);
    }
    let work = Launch {
        kernel,
        groups: [groups_x, groups_y, groups_z],
        units: [units_x, units_y, units_z],
        shared_bytes: shared_bytes as usize,
        parameters: &parameters,
    };
    match launch(&work) {
        Ok(()) => SUCCESS,
        Err(error) => {
            eprintln!("PTX: {}: {error}", kernel.name);
            LAUNCH_FAILED
        }
    }
}
