//! Images to compare, from any program's files and this program's own, brought to one scale.
//!
//! # Invariant
//! Images are scaled or fitted only on the caller's request
//! (`tests::nothing_is_fitted_unless_asked_for`).

use crate::error::{EvalError, Result};
use nirspi::files::image::{is_picture, pictures_in, read_grey};
use nirspi::files::measurement::read_images_of;
use nirspi::files::npy::{Stack, read_stack};
use nirspi::imaging::Fit;
use std::path::Path;

/// Images that `reconstruct` and `demo` write, in the order of search in a folder.
const OWN: [&str; 2] = ["image.npy", "reconstruction.npy"];

/// Reads a stack of images: `.npy`; `.npz` with `recon`, `image` or `images`; a PNG or JPEG
/// picture, as grey levels from 0 to 1; a folder of `reconstruct` or `demo` (its `image.npy` or
/// `reconstruction.npy`); or a folder of pictures of one size.
///
/// # Errors
/// [`EvalError`] for a file that cannot be read, no images, or pictures of different sizes.
pub fn read_images(path: &Path) -> Result<Stack> {
    let stack = if path.is_dir() { read_folder(path)? } else { read_file(path)? };
    if stack.count == 0 {
        return Err(EvalError::Content(format!("{}: no images", path.display())));
    }
    Ok(stack)
}

fn read_file(path: &Path) -> Result<Stack> {
    let is = |extension: &str| path.extension().is_some_and(|e| e.eq_ignore_ascii_case(extension));
    if is("npz") {
        return Ok(read_images_of(path)?);
    }
    if is_picture(path) {
        let picture = read_grey(path)?;
        let (height, width) = (picture.height as usize, picture.width as usize);
        return Ok(Stack { count: 1, height, width, values: picture.values });
    }
    Ok(read_stack(path)?)
}

fn read_folder(path: &Path) -> Result<Stack> {
    if let Some(own) = OWN.iter().map(|name| path.join(name)).find(|file| file.is_file()) {
        return Ok(read_stack(&own)?);
    }
    let wrong = |what: String| EvalError::Content(format!("{}: {what}", path.display()));
    let mut all: Option<Stack> = None;
    for file in &pictures_in(path)? {
        let one = read_file(file)?;
        match &mut all {
            None => all = Some(one),
            Some(all) if (all.height, all.width) == (one.height, one.width) => {
                all.count += 1;
                all.values.extend(one.values);
            }
            Some(all) => {
                return Err(EvalError::Content(format!(
                    "{}: {} x {} pixels, expected {} x {} as the pictures before",
                    file.display(),
                    one.height,
                    one.width,
                    all.height,
                    all.width
                )));
            }
        }
    }
    all.ok_or_else(|| {
        wrong(format!("found neither {} nor pictures, expected one of these", OWN.join(" nor ")))
    })
}

/// How the test's images are brought to the reference's scale.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Align {
    /// Unchanged.
    #[default]
    None,
    /// Each image by the gain (0 or more) and offset of least squares, because a single-pixel
    /// camera has no absolute scale.
    GainOffset,
}

/// Two stacks on the scale of the comparison.
#[derive(Debug, Clone, PartialEq)]
pub struct Scaled {
    /// The reference divided by the data range.
    pub reference: Stack,
    /// The test, fitted on request, divided by the data range.
    pub test: Stack,
    /// The range of the data for PSNR and SSIM, in the reference's units.
    pub data_range: f64,
}

/// Brings two stacks of the same shape to one scale. The default data range is 1 for a reference in
/// `[0, 1]`; with `align`, the default for any other reference is its own range.
///
/// # Errors
/// [`EvalError`] for stacks of different shapes, images outside `[0, 1]` without a data range or a
/// fit, or a range that is not positive.
pub fn scaled(
    [reference_path, test_path]: [&Path; 2],
    mut reference: Stack,
    mut test: Stack,
    align: Align,
    data_range: Option<f64>,
) -> Result<Scaled> {
    let shape = |s: &Stack| (s.count, s.height, s.width);
    if shape(&reference) != shape(&test) {
        let (found, expected) = (shape(&test), shape(&reference));
        let (path, as_in) = (test_path.display(), reference_path.display());
        return Err(EvalError::Content(format!(
            "{path}: shape {found:?}, expected {expected:?} as in {as_in}"
        )));
    }
    if let Some(range) = data_range
        && !(range > 0.0 && range.is_finite())
    {
        return Err(EvalError::setting("data_range", range, "more than 0"));
    }
    if align == Align::None && data_range.is_none() {
        for (path, stack) in [(reference_path, &reference), (test_path, &test)] {
            if let Some(at) = outside(stack) {
                let area = stack.height * stack.width;
                let (image, row, column) = (at / area, at % area / stack.width, at % stack.width);
                return Err(EvalError::Content(format!(
                    "{}: {} at [{image}, {row}, {column}], expected 0 to 1, or --data-range R or --align gain-offset",
                    path.display(),
                    stack.values[at]
                )));
            }
        }
    }
    if align == Align::GainOffset {
        let area = test.height * test.width;
        let pairs = test.values.chunks_exact_mut(area).zip(reference.values.chunks_exact(area));
        for (image, like) in pairs {
            let fit = Fit::of(image, like);
            image.iter_mut().for_each(|pixel| *pixel = fit.apply(*pixel));
        }
    }
    let data_range = data_range.unwrap_or_else(|| match outside(&reference) {
        None => 1.0,
        Some(_) => {
            let least = reference.values.iter().copied().fold(f32::INFINITY, f32::min);
            let most = reference.values.iter().copied().fold(f32::NEG_INFINITY, f32::max);
            f64::from(most - least).max(f64::MIN_POSITIVE)
        }
    });
    for stack in [&mut reference, &mut test] {
        stack.values.iter_mut().for_each(|v| *v = (f64::from(*v) / data_range) as f32);
    }
    Ok(Scaled { reference, test, data_range })
}

/// The first value outside `[0, 1]`.
pub(super) fn outside(stack: &Stack) -> Option<usize> {
    stack.values.iter().position(|v| !(0.0..=1.0).contains(v))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nirspi::files::image::encode_grey;
    use nirspi::files::npy::encode;
    use nirspi::provenance::{Made, Origin, Taken};

    fn stack(values: &[f32]) -> Stack {
        Stack { count: values.len() / 4, height: 2, width: 2, values: values.to_vec() }
    }

    fn scale(test: &[f32], align: Align, range: Option<f64>) -> Result<Scaled, String> {
        let reference = stack(&[0.0, 0.25, 0.5, 1.0]);
        let paths = [Path::new("a.npy"), Path::new("b.npy")];
        scaled(paths, reference, stack(test), align, range).map_err(|error| error.to_string())
    }

    #[test]
    fn nothing_is_fitted_unless_asked_for() {
        let test = [0.1, 0.2, 0.3, 0.4];
        let found = scale(&test, Align::None, None).unwrap();
        assert_eq!((found.test.values.as_slice(), found.data_range), (&test[..], 1.0));
        let fitted = scale(&[-5.0, -2.5, 0.0, 5.0], Align::GainOffset, None).unwrap();
        let off = |(a, b): (&f32, &f32)| (a - b).abs();
        assert!(fitted.test.values.iter().zip(&fitted.reference.values).map(off).all(|d| d < 1e-6));
        // The fit does not invert an inverted image.
        let inverted = scale(&[1.0, 0.75, 0.5, 0.0], Align::GainOffset, None).unwrap();
        assert!(inverted.test.values.iter().all(|&v| (v - 0.4375).abs() < 1e-6));
        let halved = scale(&test, Align::None, Some(2.0)).unwrap();
        assert_eq!(halved.test.values, [0.05, 0.1, 0.15, 0.2]);
    }

    #[test]
    fn an_image_out_of_range_is_named_with_its_place_and_a_way_out() {
        let told = scale(&[0.5, 0.5, 1.5, 0.5], Align::None, None).unwrap_err();
        assert_eq!(
            told,
            "b.npy: 1.5 at [0, 1, 0], expected 0 to 1, or --data-range R or --align gain-offset"
        );
        assert!(scale(&[0.5; 4], Align::None, Some(0.0)).unwrap_err().contains("data_range is 0"));
        assert!(scale(&[0.5; 8], Align::None, None).unwrap_err().contains("shape (2, 2, 2)"));
    }

    #[test]
    fn images_are_read_from_what_the_program_writes() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, bytes: &[u8]| {
            let path = folder.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(&path, bytes).unwrap();
            path
        };
        let values = [0.0_f32, 0.2, 0.4, 1.0];
        write("out/image.npy", &encode(&[2, 2], &values));
        write("demo/reconstruction.npy", &encode(&[2, 2], &values));
        let made = Made::by("test", None, ["test"], 0);
        let provenance = Taken::without_camera(Origin::Computed).made(&made);
        write("pictures/b.png", &encode_grey(2, 2, &values, &provenance));
        write("pictures/a.png", &encode_grey(2, 2, &values, &provenance));
        for (name, count) in [("out", 1), ("demo", 1), ("pictures", 2), ("pictures/a.png", 1)] {
            let found = read_images(&folder.path().join(name)).unwrap();
            assert_eq!((found.count, found.height, found.width), (count, 2, 2), "{name}");
            assert_eq!(found.values[..4], values, "{name}");
        }
        std::fs::create_dir(folder.path().join("empty")).unwrap();
        let told = read_images(&folder.path().join("empty")).unwrap_err().to_string();
        assert!(told.contains("neither image.npy nor reconstruction.npy"), "{told}");
    }
}
