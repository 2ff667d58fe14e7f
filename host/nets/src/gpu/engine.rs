//! Launches kernels on one device, for any runtime of CubeCL.
//!
//! A kernel does not check its indices. So every function here checks the lengths of the buffers
//! before its launch.

use super::kernels::{self, Activation, Add, ROWS, Shape, UNITS};
use super::layer::Layer;
use super::plan::pixels_a_unit;
use cubecl::prelude::*;
use cubecl::reader::read_sync;
use cubecl::server::Handle;

/// A buffer of four-byte numbers on a device.
#[derive(Clone, Debug)]
pub(crate) struct Buffer {
    handle: Handle,
    count: usize,
}

impl Buffer {
    /// A buffer of memory that other kernels of the same device have written, with at least `count`
    /// numbers.
    pub(super) fn of(handle: &Handle, count: usize) -> Self {
        Self { handle: handle.clone(), count }
    }

    #[expect(
        unsafe_code,
        reason = "CubeCL trusts the length; it is the one the buffer was made with"
    )]
    fn arg<R: Runtime>(&self) -> ArrayArg<R> {
        // SAFETY: every constructor of a buffer takes the count from what it allocates or uploads,
        // or from a caller that has allocated the memory.
        unsafe { ArrayArg::from_raw_parts(self.handle.clone(), self.count) }
    }
}

/// What is done with the sums of a convolution before they are stored.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Finish<'a> {
    pub activation: Activation,
    /// For [`Activation::FilmSilu`]: scales and shifts of all layers, one row for each frame, and
    /// the index of this layer's first scale.
    pub film: Option<(&'a Buffer, usize)>,
    pub add: Option<(Add, &'a Buffer)>,
    /// Rearrange four channels into one of twice the side.
    pub shuffle: bool,
    pub clamp: bool,
    /// Also store SiLU of the output.
    pub activated: bool,
}

impl Default for Finish<'_> {
    fn default() -> Self {
        Self {
            activation: Activation::Nothing,
            film: None,
            add: None,
            shuffle: false,
            clamp: false,
            activated: false,
        }
    }
}

/// The output of a convolution.
pub(crate) struct Made {
    pub out: Buffer,
    /// SiLU of the output, if requested.
    pub activated: Option<Buffer>,
}

/// The UNet's input for the degraded image.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Degraded<'a> {
    /// An image with as many pixels as the current image.
    Fine(&'a Buffer),
    /// An image with one pixel for each block of 2 x 2.
    Coarse(&'a Buffer),
}

/// Parameters of the kernel that makes the conditions: two numbers of the bridge's path, then the
/// minimum and maximum of blur and of noise, on the scale of the networks.
pub(crate) type Bounds = [f32; 6];

/// One device. Calls only queue work; a failed launch appears in [`read`](Self::read).
pub(crate) trait Engine: Send + Sync {
    /// Size of the device's largest buffer in bytes.
    fn buffer_bytes(&self) -> usize;
    fn upload(&self, numbers: &[f32]) -> Buffer;
    /// A buffer with undefined numbers; in tests, NaN.
    fn empty(&self, count: usize) -> Buffer;
    /// The numbers of each buffer.
    fn read(&self, buffers: &[&Buffer]) -> Vec<Vec<f32>>;
    /// See [`kernels::convolve`]; `input` has `frames` images of `side` x `side`.
    fn convolve(
        &self,
        layer: &Layer,
        input: &Buffer,
        frames: usize,
        side: usize,
        finish: Finish<'_>,
    ) -> Made;
    /// See [`kernels::readings`].
    fn readings(&self, images: &Buffer, first: usize, white: f32, count: usize) -> Buffer;
    /// See [`kernels::stacked`].
    fn stacked(&self, readings: &Buffer, depth: Option<&Buffer>, area: usize) -> Buffer;
    /// See [`kernels::paired`]; `side` is that of the blocks.
    fn paired(&self, current: &Buffer, degraded: Degraded<'_>, side: usize) -> Buffer;
    /// See [`kernels::pooled`].
    fn pooled(&self, input: &Buffer, pixels: usize, channels: usize, log: (f32, f32)) -> Buffer;
    /// See [`kernels::conditions`].
    fn conditions(&self, estimates: &Buffer, bounds: &Bounds, scale: f32) -> Buffer;
}

fn units() -> CubeDim {
    CubeDim::new_1d(UNITS as u32)
}

/// Workgroups for one unit per number.
fn groups(count: usize) -> CubeCount {
    CubeCount::Static(count.div_ceil(UNITS) as u32, 1, 1)
}

impl<R: Runtime> Engine for ComputeClient<R> {
    fn buffer_bytes(&self) -> usize {
        usize::try_from(self.properties().memory.max_page_size).unwrap_or(usize::MAX)
    }

    fn upload(&self, numbers: &[f32]) -> Buffer {
        Buffer { handle: self.create_from_slice(f32::as_bytes(numbers)), count: numbers.len() }
    }

    fn empty(&self, count: usize) -> Buffer {
        if cfg!(test) {
            return self.upload(&vec![f32::NAN; count]);
        }
        Buffer { handle: ComputeClient::empty(self, count * size_of::<f32>()), count }
    }

    fn read(&self, buffers: &[&Buffer]) -> Vec<Vec<f32>> {
        let handles = buffers.iter().map(|buffer| buffer.handle.clone()).collect();
        match read_sync(self.read_async(handles)) {
            Ok(all) => all
                .iter()
                .zip(buffers)
                .map(|(bytes, buffer)| f32::from_bytes(bytes)[..buffer.count].to_vec())
                .collect(),
            Err(error) => panic!("the GPU stopped: {error}"),
        }
    }

    #[expect(unsafe_code, reason = "bounds checks would double the loads of the inner loop")]
    fn convolve(
        &self,
        layer: &Layer,
        input: &Buffer,
        frames: usize,
        side: usize,
        finish: Finish<'_>,
    ) -> Made {
        let geometry = layer.geometry;
        let out_side = geometry.side(side);
        let pixels = frames * out_side * out_side;
        let count = pixels * geometry.outputs;
        let tiles = geometry.outputs.div_ceil(layer.tile());
        let (add, addend) = match finish.add {
            None => (Add::Nothing, None),
            Some((add, addend)) => (add, Some(addend)),
        };
        assert!(geometry.fits() && input.count >= frames * side * side * geometry.inputs);
        assert!(!finish.shuffle || geometry.outputs.is_multiple_of(4));
        match (add, addend) {
            (Add::Alike, Some(addend)) => assert!(addend.count >= count),
            (Add::Pixel, Some(addend)) => assert!(addend.count >= pixels),
            _ => {}
        }
        let (film, film_width, film_first) = match finish.film {
            None => (&layer.table, 0, 0),
            Some((film, first)) => {
                assert!(film.count.is_multiple_of(frames));
                let width = film.count / frames;
                assert!(first + 2 * geometry.outputs <= width);
                (film, width, first)
            }
        };
        assert_eq!(finish.film.is_some(), finish.activation == Activation::FilmSilu);
        let shape = Shape {
            pixels: layer.pixels.unwrap_or_else(|| pixels_a_unit(pixels, tiles)),
            channels: layer.channels,
            activation: finish.activation,
            add,
            shuffle: finish.shuffle,
            clamp: finish.clamp,
            activated: finish.activated,
        };
        let groups =
            CubeCount::Static(pixels.div_ceil(ROWS * shape.pixels) as u32, tiles as u32, 1);
        let out = Engine::empty(self, count);
        let activated = Engine::empty(self, if finish.activated { count } else { 1 });
        // SAFETY: the kernel reads pixels inside `frames` images and weights of `tiles` tiles, and
        // writes pixels below `pixels` and channels below `outputs`. All these lengths are checked
        // above or by the layer; barriers are outside every branch.
        unsafe {
            kernels::convolve::launch_unchecked::<R>(
                self,
                groups,
                units(),
                input.arg(),
                layer.weights.arg(),
                layer.table.arg(),
                film.arg(),
                addend.unwrap_or(&layer.table).arg(),
                out.arg(),
                activated.arg(),
                pixels as u32,
                side as u32,
                out_side as u32,
                geometry.inputs as u32,
                geometry.outputs as u32,
                geometry.kernel as u32,
                geometry.stride as u32,
                geometry.centre as u32,
                film_width as u32,
                film_first as u32,
                shape,
            );
        }
        Made { out, activated: finish.activated.then_some(activated) }
    }

    #[expect(unsafe_code, reason = "the kernel checks its one index itself")]
    fn readings(&self, images: &Buffer, first: usize, white: f32, count: usize) -> Buffer {
        assert!(images.count >= first + count);
        let out = Engine::empty(self, count);
        // SAFETY: indices are below `count`, or `first + count`, by the assert above.
        unsafe {
            kernels::readings::launch_unchecked::<R>(
                self,
                groups(count),
                units(),
                images.arg(),
                out.arg(),
                first as u32,
                white,
                count as u32,
            );
        }
        out
    }

    #[expect(unsafe_code, reason = "the kernel checks its one index itself")]
    fn stacked(&self, readings: &Buffer, depth: Option<&Buffer>, area: usize) -> Buffer {
        assert!(depth.is_none_or(|depth| depth.count >= 2 * readings.count));
        let count = 3 * readings.count;
        let out = Engine::empty(self, count);
        // SAFETY: indices are below `count` of the output; a third of it are readings, two thirds
        // depth.
        unsafe {
            kernels::stacked::launch_unchecked::<R>(
                self,
                groups(count),
                units(),
                readings.arg(),
                depth.unwrap_or(readings).arg(),
                out.arg(),
                area as u32,
                count as u32,
                depth.is_some(),
            );
        }
        out
    }

    #[expect(unsafe_code, reason = "the kernel checks its one index itself")]
    fn paired(&self, current: &Buffer, degraded: Degraded<'_>, side: usize) -> Buffer {
        assert!(current.count.is_multiple_of(4 * side * side));
        let (degraded, coarse) = match degraded {
            Degraded::Fine(degraded) => (degraded, false),
            Degraded::Coarse(degraded) => (degraded, true),
        };
        assert!(degraded.count >= current.count / if coarse { 4 } else { 1 });
        let count = 2 * current.count;
        let out = Engine::empty(self, count);
        // SAFETY: indices are below `count` of the output; half of it are images, an eighth blocks.
        unsafe {
            kernels::paired::launch_unchecked::<R>(
                self,
                groups(count),
                units(),
                current.arg(),
                degraded.arg(),
                out.arg(),
                side as u32,
                count as u32,
                coarse,
            );
        }
        out
    }

    #[expect(unsafe_code, reason = "the kernel checks its one index itself")]
    fn pooled(
        &self,
        input: &Buffer,
        pixels: usize,
        channels: usize,
        (floor, offset): (f32, f32),
    ) -> Buffer {
        assert!(input.count.is_multiple_of(pixels * channels));
        let count = input.count / pixels;
        let out = Engine::empty(self, count);
        // SAFETY: the input has `pixels` numbers for each number of the output.
        unsafe {
            kernels::pooled::launch_unchecked::<R>(
                self,
                groups(count),
                units(),
                input.arg(),
                out.arg(),
                pixels as u32,
                channels as u32,
                count as u32,
                floor,
                offset,
            );
        }
        out
    }

    #[expect(unsafe_code, reason = "the kernel checks its one index itself")]
    fn conditions(&self, estimates: &Buffer, bounds: &Bounds, scale: f32) -> Buffer {
        let frames = estimates.count / 2;
        let out = Engine::empty(self, 6 * frames);
        let bounds = self.upload(bounds);
        // SAFETY: a frame below `frames` has two estimates and six conditions.
        unsafe {
            kernels::conditions::launch_unchecked::<R>(
                self,
                groups(frames),
                units(),
                estimates.arg(),
                bounds.arg(),
                out.arg(),
                scale,
                frames as u32,
            );
        }
        out
    }
}
